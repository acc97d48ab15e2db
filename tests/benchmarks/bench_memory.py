"""How many bytes does a pixel of HR take while it is rendered?   python tests/benchmarks/bench_memory.py [4k]

The largest resident memory of a process of its own (getrusage's ru_maxrss; a GPU's memory is not in it), for the market with
16 samples and all channels: one frame, each stream rendered and encoded in turn, and three frames through the pipeline, which
renders one while it writes another. The peak while the scene is built, which hides that of small frames, is told apart: Linux
can forget a peak (clear_refs). A line through the peaks of three HR sizes gives bytes per pixel (its slope) and what scene and
kernels take by themselves. Dr.Jit keeps freed memory in blocks of powers of two, so the points do not lie on the line.

4k: instead, 3840x2160 with scales 4 and 8, one frame and three; exits with 1 where either takes more than 6 GB.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from history import print_ratios, record

SIZES, SCALES = ((480, 270), (960, 540), (1920, 1080)), (2.0, 3.0)
LARGE, LARGE_SCALES, LARGE_LIMIT = (3840, 2160), (4.0, 8.0), 6e9
WAYS = {"one frame": 1, "pipeline": 3}


def child(way: str, width: int, height: int, scales: list[float]) -> None:
    """Renders, and prints the largest resident memory, bytes: [while the scene is built, and a pipeline's first frame
    rendered; afterwards]."""
    from framepairs.bundled import find_scene
    from framepairs.channels import CHANNEL
    from framepairs.engine import Engine
    from framepairs.exr import encode
    from framepairs.options import make_job
    from framepairs.pipeline import render_sequence
    from framepairs.plan import make_plan

    with tempfile.TemporaryDirectory() as folder:
        plan = make_plan({"display": (width, height), "scales": scales, "channels": "all"})
        job = make_job("market", find_scene("market"), None, plan, Path(folder) / "corpus", overlay="none")
        if way == "pipeline":
            steps = render_sequence(job, range(WAYS[way]))
            next(steps)
            first = forgotten_peak()
            list(steps)
        else:
            engine, state = Engine(job.scene, plan), job.shoot.state(10)
            first = forgotten_peak()
            for stream in job.streams:
                arrays = engine.render(state, stream, frozenset(CHANNEL), 0).arrays
                for name in list(arrays):
                    encode(CHANNEL[name], arrays.pop(name), attributes={})
    print(json.dumps([first, peak()]))


def peak() -> int:
    """Largest resident memory of this process, bytes, since its start or the last forgotten peak."""
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


def forgotten_peak() -> int:
    """The peak so far; from now on it counts anew, where the system can do that."""
    before = peak()
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        pass
    return before


def peak_of(way: str, size: tuple[int, int], scales: tuple[float, ...]) -> tuple[int, int]:
    arguments = [way, *(str(value) for value in (*size, *scales))]
    done = subprocess.run([sys.executable, __file__, "child", *arguments], stdout=subprocess.PIPE, check=True)
    return tuple(json.loads(done.stdout))


def large() -> int:
    found = {way: max(peak_of(way, LARGE, LARGE_SCALES)) for way in WAYS}
    pixels = LARGE[0] * LARGE[1]
    ratios = {f"{way}, peak / 6 GB": most / LARGE_LIMIT for way, most in found.items()}
    for way, most in found.items():
        print(f"3840x2160 with scales 4 and 8, {way}: {most / 1e9:.2f} GB, {most / pixels:.0f} bytes per pixel of HR")
    record("memory 4k", ratios, peak_bytes=found)
    return int(max(found.values()) > LARGE_LIMIT)


def main() -> int:
    if sys.argv[1:] == ["4k"]:
        return large()
    ratios, facts = {}, {}
    pixels = np.array([width * height for width, height in SIZES])
    for way in WAYS:
        found = np.array([peak_of(way, size, SCALES) for size in SIZES], float)
        slope, constant = np.polyfit(pixels, found[:, 1], 1)
        off = np.abs(np.polyval((slope, constant), pixels) - found[:, 1]).max()
        sizes = ", ".join(f"{w}x{h} {most / 1e6:.0f} MB" for (w, h), most in zip(SIZES, found[:, 1], strict=True))
        print(f"{way}: {sizes}; off the line by at most {off / 1e6:.0f} MB; building the scene {found[0, 0] / 1e6:.0f} MB")
        ratios |= {f"{way}: bytes per pixel of HR": slope, f"{way}: constant, in megabytes": constant / 1e6}
        facts[way] = dict(zip(("x".join(map(str, size)) for size in SIZES), found[:, 1], strict=True))
    print_ratios(ratios)
    record("memory", ratios, scales=list(SCALES), peak_bytes=facts)
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), [float(value) for value in sys.argv[5:]])
    else:
        sys.exit(main())
