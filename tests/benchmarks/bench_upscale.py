"""What does each upscaling method cost, in units of bicubic?   python tests/benchmarks/bench_upscale.py [WIDTH HEIGHT [SCALE]]

Smooth random images stand for a corpus: costs do not depend on what is in them, but on how far motion reaches, which is some
pixels here. All methods take turns, frame by frame; the median of 15 frames after two of warm-up, in wall time without reading;
then 150 more frames of `temporal`, for the memory of the process.
"""

import sys
import time
from pathlib import Path

import numpy as np
from history import record

from framepairs.backend import dr, mi
from framepairs.conventions import lr_size
from framepairs.jitter import jitter
from framepairs.upscaling.inputs import UpscaleFrame
from framepairs.upscaling.sequence import METHODS
from framepairs.upscaling.settings import DEFAULTS
from framepairs.warp import to_image

ROUNDS, WARM_UP, LONG = 15, 2, 150
COMPONENTS = {"color": 3, "emission": 3, "brdf": 3, "normal": 3, "depth": 1, "motion": 2}


def images(size: tuple[int, int], seed: int) -> dict:
    """Every channel that a method reads."""
    width, height = size
    rng = np.random.default_rng(seed)
    y, x = np.indices((height, width)) / height
    found = {}
    for name, count in COMPONENTS.items():
        phases = rng.uniform(0, 6, count)
        found[name] = np.stack([1 + 0.5 * np.sin(9 * x + phase) * np.cos(7 * y + phase) for phase in phases], axis=-1)
    found["normal"] /= np.linalg.norm(found["normal"], axis=-1, keepdims=True)
    found["depth"] *= 5
    found["motion"] *= 3
    arrays = {name: array.astype(np.float32) for name, array in found.items()}
    arrays["object_id"] = (1 + (x > 0.8)).astype(np.uint32)[..., None]
    arrays["visibility"] = np.full((height, width, 1), 7, np.uint32)
    return {name: to_image(array) for name, array in arrays.items()}


def resident() -> float:
    """Megabytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (1920, 1080)
    scale = float(sys.argv[3]) if len(sys.argv) > 3 else 2.0
    lr, hr = images(lr_size(size, scale), 1), images(size, 2)
    histories, times = dict.fromkeys(METHODS), {name: [] for name in METHODS}

    def step(name: str, frame: int) -> None:
        given = UpscaleFrame(
            lr=lr, hr=hr, size=size, jitter=jitter(frame, 32), exposure=1.0, previous_depth=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        )
        start = time.perf_counter()
        histories[name], planes = METHODS[name].step(histories[name], given, DEFAULTS)
        dr.eval(planes)
        dr.sync_thread()
        if frame >= WARM_UP:
            times[name].append(time.perf_counter() - start)

    for frame in range(WARM_UP + ROUNDS):
        for name in METHODS:
            step(name, frame)
    medians = {name: float(np.median(values)) for name, values in times.items()}
    print(f"{size[0]}x{size[1]} from {scale:g}x, {mi.variant()}; bicubic {1000 * medians['bicubic']:.1f} ms")
    for name, value in medians.items():
        print(f"  {name:16s} {value / medians['bicubic']:6.2f}")
    before = resident()
    for frame in range(LONG):
        step("temporal", frame)
    growth = resident() / before
    print(f"  memory after {LONG} more frames of temporal: x {growth:.3f}")
    record(
        "upscale",
        {name: value / medians["bicubic"] for name, value in medians.items()} | {"memory": growth},
        size=f"{size[0]}x{size[1]}",
        scale=scale,
        bicubic_ms=1000 * medians["bicubic"],
    )


if __name__ == "__main__":
    main()
