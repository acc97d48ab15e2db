"""Sequences upscaled by several methods, measured against the truth: a row of figures per sequence, stream and method."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..corpus import Corpus
from ..metrics import decibels, flip, psnr, ssim, to_display
from .inputs import FrameReader
from .measures import Deviation, change_error, settled_frames, still_shots, warp_error
from .sequence import upscale_frames
from .settings import DEFAULTS, UpscaleSettings

JUDGES = 2  # threads that compute metrics
MOST_PSNR = 100.0  # what a frame that equals the truth counts, dB
FLIP_FRAMES = 8  # of a sequence, at equal distances: FLIP takes longer than everything else together


@dataclass(frozen=True, kw_only=True)
class Judged:
    """One frame, stream and method. image: scene-linear. shown: display codes. psnr in dB; ssim; flip,
    change_error (`measures`) and warp_error in codes of 255 are None where they are not taken or have no previous frame."""

    stream: str
    method: str
    frame: int
    image: NDArray
    shown: NDArray
    milliseconds: float
    psnr: float
    ssim: float
    flip: float | None
    change_error: float | None
    warp_error: float | None


@dataclass(frozen=True, kw_only=True)
class JudgedFrame:
    """truth: display codes. follows: whether the frame before is of the same shot."""

    frame: int
    truth: NDArray
    follows: bool
    results: tuple[Judged, ...]


def judge_sequence(
    corpus: Corpus,
    sequence: str,
    pairs: Sequence[tuple[str, str]],
    truth_stream: str = "hr",
    settings: UpscaleSettings = DEFAULTS,
) -> Iterator[JudgedFrame]:
    """Frame by frame, every (stream, method) of `pairs` against `truth_stream`."""
    frames = corpus.frames(sequence)
    sampled = {frames[k] for k in np.linspace(0, len(frames) - 1, FLIP_FRAMES).round().astype(int)} if frames else set()
    before: JudgedFrame | None = None
    with ThreadPoolExecutor(JUDGES) as judges:
        for reader, step in upscale_frames(corpus, sequence, pairs, settings):
            frame, record = reader.frame, reader.record
            follows = before is not None and before.frame == frame - 1 and not record.reset
            truth = to_display(corpus.read(sequence, truth_stream, "color", frame), record.exposure_ev)
            shown = [to_display(np.maximum(each.image, 0), record.exposure_ev) for each in step]
            warped = _warp_errors(reader, shown, before) if follows else [None] * len(pairs)

            def judge(index, *, shown=shown, truth=truth, follows=follows, before=before, taken=frame in sampled):
                image = shown[index]
                lag = change_error(image, before.results[index].shown, truth, before.truth) if follows else None
                return {"psnr": psnr(image, truth), "ssim": ssim(image, truth), "change_error": lag,
                        "flip": flip(image, truth) if taken else None}  # fmt: skip

            figures = judges.map(judge, range(len(pairs)))
            results = tuple(
                Judged(stream=stream, method=method, frame=frame, image=each.image, shown=picture,
                       milliseconds=each.milliseconds, warp_error=error, **figure)
                for (stream, method), each, picture, error, figure in zip(pairs, step, shown, warped, figures, strict=True)
            )  # fmt: skip
            before = JudgedFrame(frame=frame, truth=truth, follows=follows, results=results)
            yield before


def summarise(
    corpus: Corpus,
    sequence: str,
    pairs: Sequence[tuple[str, str]],
    truth_stream: str = "hr",
    settings: UpscaleSettings = DEFAULTS,
    on_frame: Callable[[JudgedFrame], None] = lambda judged: None,
) -> list[dict]:
    """A row per (stream, method): means over frames of psnr [dB, at most MOST_PSNR each], ssim, warp_error [codes of 255], and
    flip over up to FLIP_FRAMES of them; tpsnr, the PSNR of changes from frame to frame over all of them [dB]; static_std, the
    deviation over time where nothing moves [codes of 255]; ms, the median of all frames but the first. None where a figure has
    no frames, and tpsnr where all changes are equal."""
    settled = {frame: shot for shot in settled_frames(still_shots(corpus, sequence)) for frame in shot}
    collected: list[list[Judged]] = [[] for _ in pairs]
    deviations, stills = [Deviation() for _ in pairs], [[] for _ in pairs]
    for judged in judge_sequence(corpus, sequence, pairs, truth_stream, settings):
        shot = settled.get(judged.frame)
        for index, result in enumerate(judged.results):
            collected[index].append(replace(result, image=None, shown=None))
            if shot:
                deviations[index].add(result.shown)
            if shot and judged.frame == shot[-1]:
                stills[index].append(deviations[index].result())
                deviations[index] = Deviation()
        on_frame(judged)
    return [_row(sequence, results, still) for results, still in zip(collected, stills, strict=True) if results]


def _row(sequence: str, results: list[Judged], stills: list[float | None]) -> dict:
    changed = _mean([result.change_error for result in results])
    return {
        "sequence": sequence,
        "stream": results[0].stream,
        "method": results[0].method,
        "psnr": _mean([min(result.psnr, MOST_PSNR) for result in results]),
        "ssim": _mean([result.ssim for result in results]),
        "flip": _mean([result.flip for result in results]),
        "tpsnr": decibels(changed) if changed else None,
        "warp_error": _mean([result.warp_error for result in results]),
        "static_std": _mean(stills),
        "ms": float(np.median([result.milliseconds for result in results[1:] or results])),
    }


def _warp_errors(reader: FrameReader, shown: list[NDArray], before: JudgedFrame) -> list:
    entry = reader.corpus.sequence(reader.sequence)
    if any(name not in entry.channels and name not in entry.constants for name in ("motion", "visibility")):
        return [None] * len(shown)
    guides = [reader.image("hr", name) for name in ("motion", "visibility")]
    return [warp_error(image, old.shown, *guides) for image, old in zip(shown, before.results, strict=True)]


def _mean(values: list) -> float | None:
    known = [value for value in values if value is not None and not np.isnan(value)]
    return float(np.mean(known)) if known else None
