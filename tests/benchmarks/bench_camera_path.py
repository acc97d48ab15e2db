"""What does a camera path cost, and how exact is its arc length?   python tests/benchmarks/bench_camera_path.py

CPU seconds (time.process_time) to read, prepare and sample 1000 times a path of N keyframes, each the least of three; then the
largest error of places along curves against adaptive quadrature (SciPy's quad), as a share of the length, by parts per segment.
"""

import time

import numpy as np
from history import record
from scipy.integrate import quad

from framepairs.camera import splines
from framepairs.camera.track import prepare_track, sample
from framepairs.camera_path import make_camera_path

UP = np.array([0.0, 1, 0])


def keyframes(count: int) -> list[dict]:
    return [
        {"time": i / 24, "position": [i, float(np.sin(i)), float(np.cos(i / 3))], "look_at": [i + 1, 0, -9]}
        for i in range(count)
    ]


def seconds(function):
    start = time.process_time()
    result = function()
    return time.process_time() - start, result


def costs(count: int) -> tuple[float, float, float]:
    values = {"version": 1, "keyframes": keyframes(count)}
    reading, path = min((seconds(lambda: make_camera_path(values)) for _ in range(3)), key=lambda pair: pair[0])
    preparing, track = min((seconds(lambda: prepare_track(path, UP)) for _ in range(3)), key=lambda pair: pair[0])
    times = np.linspace(0, (count - 1) / 24, 1000)
    sampling = min(seconds(lambda: [sample(track, t) for t in times])[0] for _ in range(3))
    return reading, preparing, sampling


def error(parts: int, points: np.ndarray) -> float:
    """Largest distance of places at exact arc lengths from where they ought to be, over the curve's length."""
    splines.PARTS = parts
    curve, _ = splines.catmull_rom(points)
    worst, total = 0.0, 0.0
    for row in range(len(points) - 1):
        width, chord = curve.knots[row + 1] - curve.knots[row], points[row + 1] - points[row]
        start, end = curve.tangents[row : row + 2] * width

        def speed(u, chord=chord, start=start, end=end):
            return np.linalg.norm(6 * u * (1 - u) * chord + (1 - u) * (1 - 3 * u) * start + u * (3 * u - 2) * end)

        for u in (0.2, 0.5, 0.9):
            length = total + quad(speed, 0, u, epsabs=1e-13, epsrel=1e-13, limit=200)[0]
            place = points[row] + u * u * (3 - 2 * u) * chord + u * (1 - u) * ((1 - u) * start - u * end)
            worst = max(worst, float(np.linalg.norm(splines.curve_at(curve, np.array([length]))[0] - place)))
        total += quad(speed, 0, 1, epsabs=1e-13, epsrel=1e-13, limit=200)[0]
    return worst / total


def main() -> None:
    ratios, errors = {}, {}
    for count in (100, 10_000, 100_000):
        reading, preparing, sampling = costs(count)
        print(f"{count:7} keyframes: read {reading:.3f} s, prepare {preparing:.3f} s, 1000 samples {sampling:.3f} s")
        ratios[f"{count} keyframes: read / 1000 samples"] = reading / sampling
        ratios[f"{count} keyframes: prepare / 1000 samples"] = preparing / sampling
    random = np.random.default_rng(0)
    smooth, wild = np.cumsum(random.normal(size=(40, 3)), axis=0), random.normal(size=(40, 3))
    for parts in (1, 2, 4, 8):
        walk, turns = errors[f"{parts} parts"] = error(parts, smooth), error(parts, wild)
        print(f"{parts} parts of 8 nodes: error {walk:.1e} (a walk), {turns:.1e} (sharp turns)")
    record("camera_path", ratios, errors=errors)


if __name__ == "__main__":
    main()
