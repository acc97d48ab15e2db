"""PNG contact sheets: every channel with a display that a person can read."""

import colorsys
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from .consistency import TOLERANCES, FrameConsistency, consistency_picture, frame_errors, worst_frames
from .conventions import frame_name
from .corpus import Corpus
from .manifest import make_folder
from .metrics import to_display

CELL, LABEL = 320, 16
SHEET = (
    ("color", "albedo", "normal", "depth", "roughness", "metallic"),
    ("brdf", "emission", "object_id", "motion", "dual_motion", "visibility"),
)


def picture_of(channel: str, array: NDArray, exposure_ev: float = 0.0) -> NDArray[np.uint8]:
    """[height, width, 3] codes for the screen.

    Colours with the display transform; normals as (n + 1) / 2; depth as nearness within the image; motion as a wheel: hue
    is the direction towards the previous place, brightness the length; ids in distinct hues; visibility red where the
    previous frame did not see the surface, blue outside it, grey elsewhere.
    """
    if channel in ("color", "emission"):
        return _codes(to_display(array, exposure_ev))
    if channel in ("albedo", "brdf"):
        return _codes(np.clip(array, 0, 1) ** (1 / 2.2))
    if channel == "normal":
        return _codes(np.where(np.any(array != 0, axis=-1, keepdims=True), array * 0.5 + 0.5, 0))
    if channel == "depth":
        return _depth_picture(array)
    if channel in ("motion", "dual_motion"):
        return wheel(array)
    if channel == "object_id":
        return _palette()[array[..., 0] % 4096]
    if channel == "visibility":
        return _visibility_picture(array[..., 0])
    return _codes(np.repeat(array, 3, axis=-1))


def wheel(motion: NDArray, longest: float | None = None) -> NDArray[np.uint8]:
    """Motion [height, width, 2] as a colour wheel: red to the right, through yellow-green down, and so on clockwise.

    `longest` (the 99th percentile by default) is drawn at full brightness; no motion is black.
    """
    x, y = motion[..., 0].astype(float), motion[..., 1].astype(float)
    length = np.hypot(x, y)
    reach = longest or float(np.percentile(length, 99)) or 1.0
    hue = (np.arctan2(y, x) / (2 * math.pi)) % 1.0
    value = np.clip(length / reach, 0, 1) ** 0.7
    sector = hue * 6
    rgb = [np.clip(np.abs((sector + shift) % 6 - 3) - 1, 0, 1) for shift in (0, 4, 2)]
    return _codes(np.stack(rgb, axis=-1) * value[..., None])


def contact_sheet(corpus: Corpus, sequence: str, frames: list[int], stream: str = "hr") -> Image.Image:
    """For each frame, the rows of SHEET."""
    width, height = corpus.record(sequence, frames[0]).streams[stream].size
    cell = (CELL, max(1, round(CELL * height / width)))
    rows = [(frame, names) for frame in frames for names in SHEET]
    return grid([[_cell(corpus, sequence, stream, name, frame, cell) for name in names] for frame, names in rows])


def stream_sheet(corpus: Corpus, sequence: str, frame: int) -> Image.Image:
    """Colour of every stream of one frame, LR pixels enlarged without smoothing."""
    streams = corpus.streams(sequence)
    width, height = corpus.manifest.plan.display
    cell = (2 * CELL, max(1, round(2 * CELL * height / width)))
    exposure = corpus.record(sequence, frame).exposure_ev
    cells = []
    for stream in streams:
        codes = picture_of("color", corpus.read(sequence, stream, "color", frame), exposure)
        cells.append(labelled(codes, f"{stream}  frame {frame}", cell))
    return grid([cells[k : k + 3] for k in range(0, len(cells), 3)])


def interesting_frames(corpus: Corpus, sequence: str, count: int = 4) -> list[int]:
    """Frames to look at: the first, the last, and those between at equal distances."""
    frames = corpus.frames(sequence)
    picks = np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).round().astype(int))
    return [frames[index] for index in picks]


def write_previews(corpus: Corpus, out: Path) -> list[Path]:
    """Sheets of every sequence as PNG files; returns their paths."""
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for sequence in corpus.sequences:
        frames = interesting_frames(corpus, sequence)
        if not frames:
            continue
        sheets = {f"{sequence}_channels.png": contact_sheet(corpus, sequence, frames)}
        if "color" in corpus.sequence(sequence).channels:
            sheets[f"{sequence}_streams.png"] = stream_sheet(corpus, sequence, frames[len(frames) // 2])
        for name, sheet in sheets.items():
            sheet.save(out / name)
            written.append(out / name)
    return written


def write_consistency(corpus: Corpus, sequence: str, stream: str, results: list[FrameConsistency], out: Path) -> list[Path]:
    """For each measure, a picture of the worst frame: grey where it agrees, red where not, dark where it is not judged."""
    make_folder(out)
    written = []
    for name in TOLERANCES:
        for worst in worst_frames(results, name, 1):
            errors = frame_errors(corpus, sequence, stream, worst.frame)
            file = out / f"{sequence}_{stream}_{name}_{frame_name(worst.frame)}.png"
            Image.fromarray(consistency_picture({name: errors[name]})).save(file)
            written.append(file)
    return written


def _cell(corpus: Corpus, sequence: str, stream: str, channel: str, frame: int, size: tuple[int, int]) -> Image.Image:
    entry = corpus.sequence(sequence)
    if channel not in entry.channels and channel not in entry.constants:
        return labelled(np.zeros((1, 1, 3), np.uint8), f"{channel}: not rendered", size)
    array = corpus.read(sequence, stream, channel, frame)
    constant = "" if channel in entry.channels else " (constant)"
    exposure = corpus.record(sequence, frame).exposure_ev
    return labelled(picture_of(channel, array, exposure), f"{channel}{constant}  frame {frame}", size)


def labelled(codes: NDArray[np.uint8], text: str, size: tuple[int, int]) -> Image.Image:
    """A picture [height, width, 3] at `size`, under a line of text."""
    picture = Image.fromarray(codes)
    smaller = picture.width > size[0]
    picture = picture.resize(size, Image.Resampling.BOX if smaller else Image.Resampling.NEAREST)
    cell = Image.new("RGB", (size[0], size[1] + LABEL), (24, 24, 24))
    cell.paste(picture, (0, LABEL))
    ImageDraw.Draw(cell).text((4, 2), text, fill=(230, 230, 230))
    return cell


def grid(rows: list[list[Image.Image]]) -> Image.Image:
    """Pictures of one size in rows."""
    width, height = rows[0][0].size
    sheet = Image.new("RGB", (width * max(len(row) for row in rows), height * len(rows)), (24, 24, 24))
    for j, row in enumerate(rows):
        for i, cell in enumerate(row):
            sheet.paste(cell, (i * width, j * height))
    return sheet


def _codes(display: NDArray) -> NDArray[np.uint8]:
    return np.round(np.clip(display, 0, 1) * 255).astype(np.uint8)


def _depth_picture(depth: NDArray) -> NDArray[np.uint8]:
    """Near is bright; logarithmic between the 1st and 99th percentile; the background is black."""
    finite = np.isfinite(depth)
    if not finite.any():
        return np.zeros((*depth.shape[:2], 3), np.uint8)
    logs = np.log(np.where(finite, np.maximum(depth, 1e-20), 1.0))
    near, far = np.percentile(logs[finite], [1, 99])
    nearness = 1 - 0.9 * np.clip((logs - near) / max(far - near, 1e-6), 0, 1)
    return _codes(np.repeat(np.where(finite, nearness, 0), 3, axis=-1))


def _visibility_picture(bits: NDArray) -> NDArray[np.uint8]:
    picture = np.full((*bits.shape, 3), 90, np.uint8)
    picture[(bits & 4) == 0] = (220, 40, 40)
    picture[(bits & 1) == 0] = (40, 60, 200)
    return picture


def _palette() -> NDArray[np.uint8]:
    """4096 colours; neighbours differ (golden-ratio hues); 0 is black."""
    golden = 0.6180339887498949
    colors = [colorsys.hsv_to_rgb((k * golden) % 1, 0.55 + 0.4 * ((k * 7) % 5) / 5, 0.95) for k in range(4096)]
    table = (np.array(colors) * 255).astype(np.uint8)
    table[0] = 0
    return table
