"""How much do sampled paths see, for how many seconds? Coverage against run time by cell size and rays.

    .venv/bin/python tests/benchmarks/bench_camera_sampler.py [SCENE] [--count 18]

Coverage by cells of other sizes is not comparable: so each sampling's frames are judged again by one fine grid of the scene.
CPU seconds are those of all threads, without reading the scene; the first run compiles kernels and is left out.
"""

import argparse
import time

import numpy as np
from history import record

from framepairs.bundled import find_scene
from framepairs.sampling.coverage import seen_cells
from framepairs.sampling.files import make_options
from framepairs.sampling.sampler import sample_cameras
from framepairs.sampling.setting import prepare
from framepairs.scene import load_scene

RUNS = ((2.0, 96), (1.4, 96), (1.0, 96), (1.0, 32), (1.0, 256), (0.7, 96))


def judged(judge, sampling) -> float:
    """Share of the judge's cells that the sampling's cameras see."""
    coverage, origin = judge.coverage, judge.probe.origin
    seen = np.zeros(len(coverage.cells), dtype=bool)
    for cameras, values in zip(sampling.cameras, sampling.values, strict=True):
        local = cameras.copy()
        local[:, :3, 3] -= origin
        (found,) = seen_cells(coverage, judge.probe.posed(judge.probe.times[0]), [local], [np.radians(values["fov_y_deg"])])
        seen[found] = True
    return float(seen.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="market")
    parser.add_argument("--count", type=int, default=18)
    parser.add_argument("--style", default="fast")
    given = parser.parse_args()
    scene = load_scene(find_scene(given.scene))
    common = {"count": given.count, "frames": 100, "styles": (given.style,), "seed": 7}
    judge = prepare(scene, make_options(**common, cell_m=0.7))
    sample_cameras(scene, make_options(**common | {"count": 1}, cell_m=2.0))
    print(f"{given.scene}: {given.count} {given.style} paths of 100 frames")
    print(f"{'cell, m':>8} {'rays':>5} {'explore, CPU s':>15} {'all, CPU s':>11} {'own coverage':>13} {'by 0.7 m cells':>15}")
    spent_by, ratios = {}, {}
    for cell, rays in RUNS:
        options = make_options(**common, cell_m=cell, rays=rays)
        start = time.process_time()
        prepare(scene, options)
        explored = time.process_time() - start
        start = time.process_time()
        sampling = sample_cameras(scene, options)
        spent = time.process_time() - start
        own, seen = sampling.file.coverage, judged(judge, sampling)
        print(f"{cell:8.2f} {rays:5d} {explored:15.1f} {spent:11.1f} {own:13.3f} {seen:15.3f}", flush=True)
        spent_by[cell, rays] = spent
        ratios[f"{cell} m, {rays} rays: coverage by 0.7 m cells"] = seen
    costs = {f"{cell} m, {rays} rays: time / 1.0 m, 96 rays": t / spent_by[1.0, 96] for (cell, rays), t in spent_by.items()}
    record("camera_sampler", ratios | costs, scene=given.scene, count=given.count, style=given.style)


if __name__ == "__main__":
    main()
