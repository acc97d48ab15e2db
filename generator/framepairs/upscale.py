"""The reference upscaler: LR streams back to the display's size, so that errors in the data show.

Spatial: nearest, bilinear, bicubic (Catmull-Rom). Temporal: `accumulate`, which keeps a weighted sum of jittered samples at
their unjittered places, carries it along the motion, and forgets it where the previous frame did not see the surface. It does
not rectify colours, so a static scene converges to its truth.
"""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PngImage

from .backend import dr, jit
from .channels import INSIDE_PREVIOUS_FRAME, SEEN_BY_PREVIOUS_CAMERA
from .conventions import frame_name
from .corpus import Corpus
from .errors import InputError
from .metrics import psnr, ssim, to_display
from .warp import Image, bilinear, catmull_rom, fetch, nearest, pixel_centres, to_array, to_image

SPATIAL = {"nearest": nearest, "bilinear": bilinear, "bicubic": catmull_rom}
METHODS = (*SPATIAL, "accumulate")
JUDGES = 2  # threads that compute metrics


@dataclass(frozen=True, kw_only=True)
class AccumulateSettings:
    """sigma: of the Gaussian that spreads a sample, HR pixels (0.35 was best after 16 frames of `market`, at 2x and 3x; 0.3
    to 0.5 lose at most 1.1 dB). wide: weight of a second Gaussian as wide as the LR pixel, which fills places where no
    sample fell. most_moving: samples that a moving pixel remembers; each resampling blurs, so old ones are worth less."""

    sigma: float = 0.35
    wide: float = 2e-3
    most_moving: float = 6.0


@dataclass(frozen=True)
class History:
    """Weighted sum of colour [3] and weight, per HR pixel."""

    color: Image
    weight: Image


@dataclass(frozen=True, kw_only=True)
class ReportRow:
    """One frame, stream and method against HR `color`; psnr in dB and ssim on `aces_srgb`, ms without reading files."""

    sequence: str
    stream: str
    method: str
    frame: int
    psnr: float
    ssim: float
    ms: float


def upscale(image: Image, method: str, size: tuple[int, int], jitter: tuple[float, float]) -> list:
    """One LR image at the HR pixel centres, for `size` = (width, height): planes of the result.

    The LR pixel (i, j) shows the place (i + 0.5 - Jx, j + 0.5 - Jy), so a place p of the frame is looked up at p + J.
    """
    x, y = _lr_position(image, size)
    return SPATIAL[method](image, x + dr.opaque(jit.Float, jitter[0]), y + dr.opaque(jit.Float, jitter[1]))


def accumulate(
    history: History | None,
    color: Image,
    motion: Image,
    visibility: Image,
    size: tuple[int, int],
    jitter: tuple[float, float],
    settings: AccumulateSettings,
) -> History:
    """Add one LR frame to what is remembered (None after a reset). color, motion and visibility are LR."""
    width, height = size
    sums, weight = _splat(color, size, jitter, settings)
    if history is not None:
        carried, old_weight = _carried(history, color, motion, visibility, size, jitter, settings)
        sums = [new + old for new, old in zip(sums, carried, strict=True)]
        weight += old_weight
    dr.eval(sums, weight)
    return History(Image(tuple(sums), width, height), Image((weight,), width, height))


def resolved(history: History) -> list:
    """The mean colour that is remembered: planes of the upscaled image."""
    return [plane / history.weight.planes[0] for plane in history.color.planes]


def upscale_sequence(
    corpus: Corpus, sequence: str, stream: str, method: str, settings: AccumulateSettings | None = None
) -> Iterator[tuple[int, NDArray, float]]:
    """(frame, [height, width, 3] scene-linear, milliseconds) of every frame, in order."""
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; known are {', '.join(METHODS)}")
    size = tuple(corpus.manifest.plan.display)
    history, last = None, None
    for frame in corpus.frames(sequence):
        record = corpus.record(sequence, frame)
        color = to_image(corpus.read(sequence, stream, "color", frame))
        jitter = record.streams[stream].jitter
        if method != "accumulate":
            start = time.perf_counter()
            planes = upscale(color, method, size, jitter)
        else:
            guides = [to_image(corpus.read(sequence, stream, name, frame)) for name in ("motion", "visibility")]
            start = time.perf_counter()
            follows = history is not None and not record.reset and last == frame - 1
            history = accumulate(
                history if follows else None, color, *guides, size, jitter, settings or AccumulateSettings()
            )
            planes, last = resolved(history), frame
        dr.eval(planes)
        dr.sync_thread()
        elapsed = 1000 * (time.perf_counter() - start)
        yield frame, to_array(planes, *size), elapsed


def compare_sequence(
    corpus: Corpus, sequence: str, pairs: list[tuple[str, str]], truth_stream: str = "hr"
) -> Iterator[list[tuple[ReportRow, NDArray]]]:
    """Frame by frame, for each (stream, method) of `pairs`: its ReportRow against `truth_stream`, and the upscaled frame
    [height, width, 3] as display codes in [0, 1]. The truth of a frame is read once."""
    running = [upscale_sequence(corpus, sequence, stream, method) for stream, method in pairs]
    with ThreadPoolExecutor(JUDGES) as judges:
        for step in zip(*running, strict=True):
            frame = step[0][0]
            exposure = corpus.record(sequence, frame).exposure_ev
            truth = to_display(corpus.read(sequence, truth_stream, "color", frame), exposure)
            shown = [to_display(np.maximum(image, 0), exposure) for _, image, _ in step]
            scores = judges.map(lambda image, truth=truth: (psnr(image, truth), ssim(image, truth)), shown)
            yield [
                (ReportRow(sequence=sequence, stream=s, method=m, frame=frame, psnr=p, ssim=q, ms=elapsed), image)
                for (s, m), (_, _, elapsed), image, (p, q) in zip(pairs, step, shown, scores, strict=True)
            ]


def summarise(
    corpus: Corpus,
    sequence: str,
    pairs: list[tuple[str, str]],
    out: Path | None = None,
    on_frame: Callable[[], None] | None = None,
    truth_stream: str = "hr",
) -> list[dict]:
    """For each (stream, method), means over all frames ("all") and over those in which nothing moves ("still"; the last of
    them as "still, end"). With `out`, every upscaled frame is written there as a PNG."""
    rows: list[ReportRow] = []
    for results in compare_sequence(corpus, sequence, pairs, truth_stream):
        for row, shown in results:
            rows.append(row)
            if out is not None:
                file = out / sequence / row.stream / row.method / f"{frame_name(row.frame)}.png"
                file.parent.mkdir(parents=True, exist_ok=True)
                PngImage.fromarray(np.round(shown * 255).astype(np.uint8)).save(file)
        if on_frame:
            on_frame()
    still = {frame for frame in {row.frame for row in rows} if _is_still(corpus, sequence, frame)}
    return [entry for pair in pairs for entry in _summary(sequence, pair, rows, still)]


def _summary(sequence: str, pair: tuple[str, str], rows: list[ReportRow], still: set[int]) -> Iterator[dict]:
    own = [row for row in rows if (row.stream, row.method) == pair]
    standing = [row for row in own if row.frame in still]
    for part, members in (("all", own), ("still", standing), ("still, end", standing[-1:])):
        if members:
            means = {key: float(np.mean([getattr(row, key) for row in members])) for key in ("psnr", "ssim", "ms")}
            yield {
                "sequence": sequence, "stream": pair[0], "method": pair[1], "part": part, "frames": len(members), **means
            }  # fmt: skip


def _is_still(corpus: Corpus, sequence: str, frame: int) -> bool:
    """Whether HR motion is 0 everywhere in a frame that follows another of its shot."""
    entry = corpus.sequence(sequence)
    known = "motion" in entry.channels or "motion" in entry.constants
    return known and not corpus.record(sequence, frame).reset and not corpus.read(sequence, "hr", "motion", frame).any()


def _lr_position(image: Image, size: tuple[int, int]) -> tuple:
    """Position in LR pixels of every HR pixel's centre."""
    x, y = pixel_centres(*size)
    return x * dr.opaque(jit.Float, image.width / size[0]), y * dr.opaque(jit.Float, image.height / size[1])


def _splat(color: Image, size: tuple[int, int], jitter: tuple[float, float], settings: AccumulateSettings) -> tuple:
    """Weighted sum of the 3x3 LR samples nearest to each HR pixel, by distance in HR pixels: (sums [3], weight)."""
    x, y = _lr_position(color, size)
    x, y = x + dr.opaque(jit.Float, jitter[0]), y + dr.opaque(jit.Float, jitter[1])
    i, j = jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y))
    scale_x, scale_y = (dr.opaque(jit.Float, hr / lr) for hr, lr in zip(size, (color.width, color.height), strict=True))
    narrow = dr.opaque(jit.Float, -0.5 / settings.sigma**2)
    wide, share = dr.opaque(jit.Float, -0.5 / 0.5**2), dr.opaque(jit.Float, settings.wide)
    sums, weight = [jit.Float(0)] * 3, jit.Float(0)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            dx, dy = jit.Float(i + column) + 0.5 - x, jit.Float(j + row) + 0.5 - y
            squared = dr.square(dx) + dr.square(dy)
            w = dr.exp(narrow * (dr.square(dx * scale_x) + dr.square(dy * scale_y))) + share * dr.exp(wide * squared)
            pixel = fetch(color, i + column, j + row)
            sums = [dr.fma(w, value, so_far) for value, so_far in zip(pixel, sums, strict=True)]
            weight += w
    return sums, weight


def _carried(history, color, motion, visibility, size, jitter, settings) -> tuple:
    """What is remembered, at the place where each HR pixel's surface was: (sums [3], weight); 0 where it was not seen."""
    x, y = _lr_position(color, size)
    x, y = x + dr.opaque(jit.Float, jitter[0]), y + dr.opaque(jit.Float, jitter[1])
    moved = nearest(motion, x, y)
    bits = nearest(visibility, x, y)[0]
    trusted = INSIDE_PREVIOUS_FRAME | SEEN_BY_PREVIOUS_CAMERA
    seen = (bits & trusted) == trusted
    hx, hy = pixel_centres(*size)
    dx = moved[0] * dr.opaque(jit.Float, size[0] / color.width)
    dy = moved[1] * dr.opaque(jit.Float, size[1] / color.height)
    still = (dx == 0) & (dy == 0)
    old = bilinear(history.weight, hx + dx, hy + dy)[0]
    mean = [
        value / dr.maximum(old, 1e-12) for value in bilinear(history.color, hx + dx, hy + dy)
    ]
    kept = dr.select(still, old, dr.minimum(old, dr.opaque(jit.Float, settings.most_moving)))
    kept = dr.select(seen, kept, 0)
    return [value * kept for value in mean], kept
