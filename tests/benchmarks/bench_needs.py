"""What does a frame cost without what its scene does not need?   python tests/benchmarks/bench_needs.py [WIDTH HEIGHT]

A static camera before diffuse, untextured balls (the scene of tests/test_left_out.py), with all four LR variants at 2x and 16
samples of truth: whole frames, rendered, encoded and written, with what is needed and with everything forced. Both take turns;
the least of five rounds of four frames after one of warm-up.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from history import record

from framepairs.backend import mi
from framepairs.pipeline import render_sequence
from test_left_out import plain_job

ROUNDS, FRAMES = 5, 4


def job_of(folder: Path, channels: str, size: tuple[int, int]):
    job = plain_job(folder, channels, frames=FRAMES)
    return replace(job, plan=job.plan.model_copy(update={"display": size, "antialiasing": 16, "brdf_table": 512}))


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (960, 540)
    least, disk = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(ROUNDS + 1):
            for name in ("needed", "all"):
                start = time.perf_counter()
                steps = list(render_sequence(job_of(Path(folder) / f"{name}{k}", name, size), range(FRAMES)))
                spent = (time.perf_counter() - start) / FRAMES
                least[name] = min(least.get(name, spent), spent) if k else spent
                disk[name] = sum(step.bytes for step in steps) / FRAMES
    ratios = least["needed"] / least["all"], disk["needed"] / disk["all"]
    everything = f"{1000 * least['all']:.0f} ms and {disk['all'] / 1e6:.2f} MB"
    print(f"{size[0]}x{size[1]}, {mi.variant()}: {everything} a frame with everything;")
    print(f"what is needed alone: {ratios[0]:.2f} of the time, {ratios[1]:.2f} of the bytes")
    record("needs", dict(zip(("needed / all: time", "needed / all: bytes"), ratios, strict=True)), size=list(size))


if __name__ == "__main__":
    main()
