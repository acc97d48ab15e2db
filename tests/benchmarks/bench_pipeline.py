"""What does writing add to rendering?   python tests/benchmarks/bench_pipeline.py [WIDTH HEIGHT [all]]

Frames of the market with all channels, 16 samples of truth and LR at 2x (`all`: 2x and 3x in all variants): rendered, encoded,
hashed and written by the pipeline, over the same frames rendered alone, in wall time and in core-seconds (CPU time of all
threads; a GPU's is not in it). Four frames each, after two of warm-up, which compile kernels.
"""

import sys
import tempfile
import time
from pathlib import Path

from history import print_ratios, record

from framepairs.bundled import find_scene
from framepairs.channels import CHANNEL
from framepairs.engine import Engine
from framepairs.frame import frame_states
from framepairs.launched import fetch
from framepairs.options import make_job
from framepairs.pipeline import render_sequence
from framepairs.plan import make_plan

WARM_UP, FRAMES = 2, 4
VARIANTS = ("native", "jittered", "mip", "jittered_mip")


def clocks() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()


def since(start: tuple[float, float]) -> tuple[float, float]:
    """(wall, core) seconds per frame."""
    return tuple((now - then) / FRAMES for now, then in zip(clocks(), start, strict=True))


def whole(job) -> tuple[float, float, int]:
    """Seconds per frame of the pipeline, from one frame on disk to another four later; and bytes of a frame."""
    steps = render_sequence(job, range(WARM_UP + FRAMES + 1))
    for _ in range(WARM_UP):
        next(steps)
    start = clocks()
    size = sum(next(steps).bytes for _ in range(FRAMES)) / FRAMES
    wall, core = since(start)
    list(steps)
    return wall, core, int(size)


def alone(job) -> tuple[float, float]:
    engine, names = Engine(job.scene, job.plan, job.overlay), frozenset(CHANNEL)
    start = clocks()
    for index, state in enumerate(frame_states(job.shoot, range(WARM_UP + FRAMES))):
        if index == WARM_UP:
            start = clocks()
        fetch(engine.launch(state, job.streams, names, 0))
    return since(start)


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (1920, 1080)
    streams = {"scales": (2, 3), "variants": VARIANTS} if sys.argv[3:] == ["all"] else {"scales": (2,)}
    plan = make_plan({"display": size, "channels": "all"} | streams)
    with tempfile.TemporaryDirectory() as folder:
        job = make_job("market", find_scene("market"), None, plan, Path(folder) / "corpus", overlay="none")
        wall, core, count = whole(job)
        wall_alone, core_alone = alone(job)
    ratios = {
        "whole frame / its rendering alone, wall time": wall / wall_alone,
        "whole frame / its rendering alone, core-seconds": core / core_alone,
    }
    print(f"{size[0]}x{size[1]}, {len(job.streams)} streams, {count / 1e6:.1f} MB a frame: {wall:.2f} s and {core:.2f} "
          f"core-seconds written, {wall_alone:.2f} s and {core_alone:.2f} core-seconds rendered alone")  # fmt: skip
    print_ratios(ratios)
    facts = {"wall_s": wall, "core_s": core, "wall_alone_s": wall_alone, "core_alone_s": core_alone, "bytes_per_frame": count}
    record("pipeline", ratios, size=list(size), streams=len(job.streams), **facts)


if __name__ == "__main__":
    main()
