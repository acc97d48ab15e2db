"""Upscaled frames as files: EXR, PNG and difference pictures, and the trajectory of one pixel row through time."""

import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PngImage

from ..channels import CHANNEL
from ..conventions import frame_name
from ..corpus import Corpus
from ..exr import encode
from ..manifest import write_atomically
from ..metrics import to_display
from ..preview import grid, labelled
from .comparison import Judged, JudgedFrame
from .page import Compared

DIFFERENCE_GAIN = 4  # differences are shown this many times as large
WRITERS = 2  # threads that encode
ROW_HEIGHT = 4  # picture rows per frame of a trajectory


def write_frame(corpus: Corpus, sequence: str, judged: JudgedFrame, out: Path) -> None:
    """`<out>/<sequence>/<stream>/<method>/<frame>.exr` (scene-linear), `.png` (display) and `<frame>_difference.png`; beside
    them `<sequence>/truth/<frame>.png` and `<sequence>/<stream>/lr/<frame>.png`. Raises MachineError where it cannot write."""
    name, record = frame_name(judged.frame), corpus.record(sequence, judged.frame)
    _write_png(judged.truth, out / sequence / "truth" / f"{name}.png")
    for stream in dict.fromkeys(result.stream for result in judged.results):
        low = to_display(corpus.read(sequence, stream, "color", judged.frame), record.exposure_ev)
        _write_png(low, out / sequence / stream / "lr" / f"{name}.png")

    def write(result: Judged) -> None:
        folder = out / sequence / result.stream / result.method
        _write_png(result.shown, folder / f"{name}.png")
        off = np.clip(DIFFERENCE_GAIN * np.abs(result.shown - judged.truth), 0, 1)
        _write_png(off, folder / f"{name}_difference.png")
        attributes = {"framepairs:method": result.method, "framepairs:stream": result.stream}
        write_atomically(folder / f"{name}.exr", encode(CHANNEL["color"], result.image, attributes=attributes).data, sync=False)

    with ThreadPoolExecutor(WRITERS) as writers:
        list(writers.map(write, judged.results))


def compared(corpus: Corpus, sequence: str, rows: list[dict]) -> Compared:
    """What the side-by-side page shows of a sequence whose frames `write_frame` wrote. rows: of `summarise`."""
    frames = corpus.frames(sequence)
    names = [f"{frame_name(frame)}.png" for frame in frames]
    pictures = {"truth": tuple(f"{sequence}/truth/{name}" for name in names)}
    figures = {}
    for row in rows:
        stream, method = row["stream"], row["method"]
        pictures[stream] = tuple(f"{sequence}/{stream}/lr/{name}" for name in names)
        pictures[f"{stream} {method}"] = tuple(f"{sequence}/{stream}/{method}/{name}" for name in names)
        known = [("psnr", "{:.2f} dB"), ("ssim", "SSIM {:.3f}"), ("flip", "FLIP {:.3f}")]
        figures[f"{stream} {method}"] = "  ".join(text.format(row[key]) for key, text in known if row[key] is not None)
    size = tuple(corpus.manifest.plan.display)
    return Compared(sequence=sequence, size=size, frames=tuple(frames), pictures=pictures, figures=figures)


def add_row(lines: dict[str, list[NDArray]], judged: JudgedFrame, row: int) -> None:
    """Append one pixel row of the truth and of every result, counted from the top."""
    lines.setdefault("truth", []).append(judged.truth[row])
    for result in judged.results:
        lines.setdefault(f"{result.stream} {result.method}", []).append(result.shown[row])


def write_trajectory(lines: dict[str, list[NDArray]], row: int, file: Path) -> None:
    """An epipolar plane image of what `add_row` collected: the row of every frame, time downwards, the truth above and each
    stream and method below. What moves steadily is a straight line, flicker a pattern along it, lag a ghost beside it.
    Raises MachineError where it cannot be written."""
    cells = []
    for name, rows in lines.items():
        codes = np.round(np.repeat(np.stack(rows), ROW_HEIGHT, axis=0) * 255).astype(np.uint8)
        cells.append([labelled(codes, f"{name}  row {row}", (codes.shape[1], codes.shape[0]))])
    _write_image(grid(cells), file)


def _write_png(shown: NDArray, file: Path) -> None:
    _write_image(PngImage.fromarray(np.round(shown * 255).astype(np.uint8)), file)


def _write_image(image: PngImage.Image, file: Path) -> None:
    stream = io.BytesIO()
    image.save(stream, format="PNG", compress_level=1)
    write_atomically(file, stream.getvalue(), sync=False)
