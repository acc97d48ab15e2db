"""What do workers bring, and what does their scheduler cost?   python tests/benchmarks/bench_fleet.py [WIDTH HEIGHT]

Frames of the market through `--engine dask` with one single-threaded worker per core, over one process that uses all cores:
frames per second from the first to the last that lies on the disk, when kernels and scenes are loaded. Then the same frames
again, which are all there: what is left is the scheduler's, at one frame per task.
"""

import sys
import tempfile
import time
from pathlib import Path

from history import print_ratios, record

from framepairs.bundled import find_scene
from framepairs.fleet import Fleet, connected, fleet_renderer
from framepairs.options import make_job
from framepairs.orders import order_of
from framepairs.pipeline import render_sequence, usable_cores
from framepairs.plan import make_plan

WARM_UP, FRAMES = 8, 24


def seconds_per_frame(steps) -> float:
    """From one frame on the disk to another, after warm-up."""
    times = []
    for _ in steps:
        times.append(time.perf_counter())
    return (times[-1] - times[WARM_UP - 1]) / (len(times) - WARM_UP)


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (640, 360)
    plan, frames = make_plan({"display": size, "channels": "all"}), range(WARM_UP + FRAMES)
    with tempfile.TemporaryDirectory() as folder:
        def made(name: str):
            return make_job("market", find_scene("market"), None, plan, Path(folder) / name, overlay="none")

        alone = seconds_per_frame(render_sequence(made("alone"), frames))
        job, fleet = made("together"), Fleet(workers=usable_cores(), frames_per_task=1)
        with connected(fleet, job.variant) as client:
            client.wait_for_workers(usable_cores())
            renderer = fleet_renderer(client, order_of(job), fleet)
            together = seconds_per_frame(render_sequence(job, frames, renderer=renderer))
            there = seconds_per_frame(render_sequence(job, frames, renderer=renderer))
        resumed = seconds_per_frame(render_sequence(job, frames))
    ratios = {"frames per second, workers / one process": alone / together}
    facts = {"alone_s": alone, "workers_s": together, "scheduler_ms_per_frame": 1000 * (there - resumed)}
    print(f"{size[0]}x{size[1]}: {alone:.3f} s a frame in one process, {together:.3f} s with {usable_cores()} workers; "
          f"scheduler {facts['scheduler_ms_per_frame']:.1f} ms a frame")  # fmt: skip
    print_ratios(ratios)
    record("fleet", ratios, size=list(size), workers=usable_cores(), **facts)


if __name__ == "__main__":
    main()
