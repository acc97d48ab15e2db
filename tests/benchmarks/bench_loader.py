"""What does it cost to read a corpus?   python tests/benchmarks/bench_loader.py [WIDTH HEIGHT]

HR of four frames of the market with all channels, read through framepairs.corpus.Corpus from the page cache by one thread,
in CPU time: colour alone, with and without the check of sha256, over the bare reading of the same files, and over the
encoding of the same arrays. All take turns; the least of seven rounds after one of warm-up, per frame.
"""

import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from history import print_ratios, record

from framepairs.bundled import find_scene
from framepairs.channels import CHANNEL
from framepairs.corpus import Corpus
from framepairs.exr import encode
from framepairs.options import make_job
from framepairs.pipeline import render_sequence
from framepairs.plan import make_plan

FRAMES, ROUNDS = range(4), 7
COLOR = ("color",)


def rendered(folder: Path, size: tuple[int, int]) -> tuple[Path, str]:
    """(a corpus, its sequence)."""
    plan = make_plan({"display": size, "scales": (2,), "variants": (), "channels": "all"})
    job = make_job("market", find_scene("market"), None, plan, folder / "corpus", overlay="none")
    list(render_sequence(job, FRAMES))
    return job.out, job.sequence


def read(corpus: Corpus, sequence: str, names: tuple[str, ...]) -> None:
    for frame in FRAMES:
        for name in names:
            corpus.read(sequence, "hr", name, frame)


def read_records(folder: Path, sequence: str) -> None:
    """Of a corpus just opened: it keeps the records that it has read."""
    corpus = Corpus(folder)
    for frame in FRAMES:
        corpus.record(sequence, frame)


def read_bytes(files: list[Path]) -> int:
    return sum(len(file.read_bytes()) for file in files)


def encode_all(arrays: dict[tuple[int, str], object]) -> None:
    for (_, name), array in arrays.items():
        encode(CHANNEL[name], array, attributes={})


def seconds_per_frame(runs: dict) -> dict[str, float]:
    least = dict.fromkeys(runs, float("inf"))
    for k in range(ROUNDS + 1):
        for name, run in runs.items():
            start = time.process_time()
            run()
            least[name] = min(least[name], (time.process_time() - start) / len(FRAMES) if k else float("inf"))
    return least


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (960, 540)
    with tempfile.TemporaryDirectory() as temporary:
        folder, sequence = rendered(Path(temporary), size)
        checked, unchecked = Corpus(folder), Corpus(folder, check=False)
        names = tuple(checked.sequence(sequence).channels)
        files = [checked.file_of(sequence, "hr", name, frame)[0] for frame in FRAMES for name in names]
        arrays = {(frame, name): checked.read(sequence, "hr", name, frame) for frame in FRAMES for name in names}
        megabytes = read_bytes(files) / len(FRAMES) / 1e6
        runs = {
            "all": partial(read, checked, sequence, names),
            "unchecked": partial(read, unchecked, sequence, names),
            "color": partial(read, checked, sequence, COLOR),
            "records": partial(read_records, folder, sequence),
            "bytes": partial(read_bytes, files),
            "encoding": partial(encode_all, arrays),
        }
        spent = seconds_per_frame(runs)
    ratios = {
        "colour alone / all channels": spent["color"] / spent["all"],
        "with check of sha256 / without": spent["all"] / spent["unchecked"],
        "all channels / bare reading of the files": spent["all"] / spent["bytes"],
        "all channels / encoding them": spent["all"] / spent["encoding"],
        "opening the corpus and reading records / all channels": spent["records"] / spent["all"],
    }
    per_second = 1 / spent["all"]
    print(f"{size[0]}x{size[1]}, {len(names)} channels of HR, {megabytes:.1f} MB a frame: {per_second:.1f} frames per CPU "
          f"second, colour alone {1 / spent['color']:.1f}")  # fmt: skip
    print_ratios(ratios)
    record("loader", ratios, size=list(size), frames_per_cpu_second=per_second, megabytes_per_frame=megabytes)


if __name__ == "__main__":
    main()
