"""Does a long render grow in memory or slow down?   python tests/benchmarks/bench_steady.py [FRAMES] [PLOT.svg]

The market and the crowd, whose figures deform, through framepairs.pipeline at 128x72, each in a process of its own; files are
deleted when their frame is whole. The camera goes 45 frames forth along the scene's path and the same back again and again, so
that late frames see what early ones saw, while the scene's animation runs once. Printed: the last tenth of the frames over
those from 5 % to 15 %, medians, for resident memory and for seconds per frame (CPU time on LLVM), and what memory grows by per
1000 frames, by a line through all frames after 15 %. Default: 2000 frames.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from history import print_ratios, record

SCENES, SIZE, TURN = ("market", "crowd"), (128, 72), 45


def there_and_back(job, frames: int):
    """The job along a path of `frames` frames: the first 45 of its own at 72 fps, forth and back."""
    from framepairs.camera_path import make_camera_path

    poses = [job.shoot.state(k).camera.world_from_camera.tolist() for k in range(TURN)]
    cycle = [*range(TURN), *range(TURN - 2, 0, -1)]
    fps = min(frames / job.scene.animation_end_s, 1000)
    own = job.path.model_dump(include={"version", "fov_y_deg", "near", "far"})
    stops = [{"time": k / fps, "world_from_camera": poses[cycle[k % len(cycle)]]} for k in range(frames)]
    return replace(job, path=make_camera_path({**own, "fps": fps, "poses": stops}), path_name="there_and_back")


def child(scene: str, frames: int) -> None:
    """Renders, and prints a line per frame: [resident bytes, CPU seconds, wall seconds]. Nothing is rendered while the last
    frame is written, so its seconds are no frame's."""
    from framepairs.bundled import find_scene
    from framepairs.conventions import frame_name
    from framepairs.options import make_job
    from framepairs.pipeline import render_sequence
    from framepairs.plan import make_plan

    with tempfile.TemporaryDirectory() as folder:
        plan = make_plan({"display": SIZE, "scales": (2,), "variants": ("jittered_mip",), "antialiasing": 4})
        made = make_job(scene, find_scene(scene), None, plan, Path(folder) / "corpus", fps=72, overlay="none")
        job = there_and_back(made, frames)
        cpu, wall = time.process_time(), time.perf_counter()
        for step in render_sequence(job, range(frames)):
            print(json.dumps([resident(), time.process_time() - cpu, time.perf_counter() - wall]), flush=True)
            for file in (job.out / job.sequence).glob(f"*/*/{frame_name(step.frame)}.exr"):
                file.unlink()
            cpu, wall = time.process_time(), time.perf_counter()


def resident() -> int:
    """Resident memory of this process, bytes; its peak where there is no /proc."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def per_frame(lines: bytes) -> dict[str, np.ndarray]:
    """bytes and seconds of each frame but the last, from what `child` prints."""
    rows = np.array([json.loads(line) for line in lines.splitlines()])[:-1]
    # On a GPU the CPU waits; on LLVM, CPU time is what other processes disturb least.
    waits = np.median(rows[:, 1]) < 0.2 * np.median(rows[:, 2])
    return {"bytes": rows[:, 0], "seconds": rows[:, 2 if waits else 1]}


def late_over_early(values: np.ndarray) -> float:
    count = len(values)
    return float(np.median(values[count - count // 10 :]) / np.median(values[count // 20 : 3 * count // 20]))


def growth(values: np.ndarray) -> float:
    """Per 1000 frames, by the line of least squares through all frames after 15 %."""
    kept = np.arange(len(values)) >= 3 * len(values) // 20
    return float(1000 * np.polyfit(np.flatnonzero(kept), values[kept], 1)[0])


def plot(found: dict[str, dict[str, np.ndarray]], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "framepairs"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, len(found), figsize=(8.0, 4.8), layout="constrained", sharex=True, squeeze=False)
    for column, (scene, values) in enumerate(found.items()):
        memory, cost = values["bytes"] / 1e6, 1000 * values["seconds"]
        axes[0, column].plot(memory, linewidth=1)
        axes[0, column].set(title=scene, ylim=(0, 1.2 * memory.max()))
        axes[1, column].plot(cost, ".", markersize=1.5, alpha=0.4, rasterized=True)
        width = max(len(cost) // 20, 1)
        smooth = [np.median(cost[max(k - width, 0) : k + width]) for k in range(len(cost))]
        axes[1, column].plot(smooth, linewidth=1.5)
        axes[1, column].set(xlabel="frame", ylim=(0, 2 * np.median(cost)))
    axes[0, 0].set(ylabel="resident memory, MB")
    axes[1, 0].set(ylabel="ms per frame")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main() -> None:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    found = {}
    for scene in SCENES:
        done = subprocess.run([sys.executable, __file__, "child", scene, str(frames)], stdout=subprocess.PIPE, check=True)
        found[scene] = per_frame(done.stdout)
    report(found)
    if len(sys.argv) > 2:
        plot(found, Path(sys.argv[2]))


def report(found: dict[str, dict[str, np.ndarray]]) -> None:
    ratios, facts = {}, {}
    for scene, values in found.items():
        ratios[f"{scene}: resident memory, last 10 % / 5 to 15 %"] = late_over_early(values["bytes"])
        ratios[f"{scene}: seconds per frame, last 10 % / 5 to 15 %"] = late_over_early(values["seconds"])
        slope, most, spent = growth(values["bytes"]), values["bytes"].max(), float(np.median(values["seconds"]))
        facts[scene] = {"frames": len(values["bytes"]), "bytes_per_1000_frames": slope, "peak_bytes": most}
        facts[scene]["s_per_frame"] = spent
        print(f"{scene}: {most / 1e6:.0f} MB at most, {slope / 1e6:+.2f} MB per 1000 frames, {1000 * spent:.0f} ms per frame")
    print_ratios(ratios)
    record("steady", ratios, **facts)


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        child(sys.argv[2], int(sys.argv[3]))
    else:
        main()
