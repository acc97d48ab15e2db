"""What upscaling proves about a corpus: relations between methods and streams that healthy data show.

Each is judged per sequence and scale by differences of PSNR on the display transform `aces_srgb`. A relation that data cannot
show, because nothing stands still or a stream is missing, is not applicable, and says why.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..channels import seen_before
from ..corpus import Corpus
from ..metrics import psnr, to_display
from ..warp import to_array
from .hypotheses import jitter_fits, motion_fits
from .inputs import FrameReader
from .measures import still_shots
from .sequence import METHODS, upscale_frames
from .settings import DEFAULTS, UpscaleSettings

SHORTEST_SHOT = 8  # frames that a still shot must have
LEAST_TEXTURED = 0.01  # share of pixels
LEAST_SIZE = 12  # pixels of LR frames, of which smaller ones have too little to be judged by
LEAST_SCALE = 1.2  # at which jitter and history have something to gain
MOST_PSNR = 60.0  # dB that a frame counts; what is equal, or nearly, has no relation
CHANGED = 2 / 255  # display codes of the truth by which light that changes is told
BRIGHTENED = 0.05  # display codes by which the whole picture must change to be told so where everything moves
TEXTURE = 0.05  # least relative deviation of F_beta within 3x3 pixels of a textured surface


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """figure: dB by which the relation holds; needed: that it takes; None where it is not applicable, and why."""

    id: str
    proves: str
    sequence: str
    scale: float
    verdict: Literal["holds", "broken", "not applicable"]
    figure: float | None
    needed: float
    why: str = ""


@dataclass(frozen=True)
class Relation:
    """better exceeds worse by `needed` dB. better, worse: (kind of stream, method). over: which frames count: `all`, `moving`,
    the `end` of the longest still shot, or textured `surfaces`; `start` is the same method at that shot's beginning."""

    id: str
    proves: str
    better: tuple[str, str]
    worse: tuple[str, str]
    over: Literal["all", "moving", "end", "start", "surfaces"]
    needed: float


RELATIONS = (
    Relation("converges", "jitter as recorded: where nothing moves, accumulated frames approach the truth",
             ("jittered", "accumulate"), ("jittered", "accumulate"), "start", 2.0),
    Relation("accumulation_beats_bicubic", "jitter as recorded: accumulated samples lie where they are said to lie",
             ("jittered", "accumulate"), ("jittered", "bicubic"), "end", 2.0),
    Relation("jittered_beats_unjittered", "jitter is in the pictures: frames add detail to each other",
             ("jittered", "accumulate"), ("native", "accumulate"), "end", 1.0),
    Relation("bias_beats_native", "mip bias is in the pictures: biased textures hold more detail when accumulated",
             ("biased", "accumulate"), ("unbiased", "accumulate"), "end", 0.05),
    Relation("history_beats_bicubic", "HR motion as recorded: history lands on the surface that it shows",
             ("jittered", "oracle"), ("jittered", "bicubic"), "moving", 0.25),
    Relation("lr_history_beats_bicubic", "LR motion and depth as recorded: history lands on the surface that it shows",
             ("jittered", "temporal"), ("jittered", "bicubic"), "moving", 0.25),
    Relation("oracle_beats_heuristic", "HR motion and visibility are not worse than what a game guesses from LR",
             ("jittered", "oracle"), ("jittered", "temporal"), "all", -1.0),
    Relation("guides_beat_color", "HR G-buffers lie on the truth: they tell more than LR colour alone",
             ("jittered", "guided"), ("jittered", "bicubic"), "all", 0.0),
    Relation("demodulation_beats_none", "F_beta is the material of the colour: light without it is smoother",
             ("jittered", "guided"), ("jittered", "joint_bilateral"), "surfaces", -0.25),
)  # fmt: skip
DECLARED = {
    "declared_jitter_wins": "jitter as recorded explains single frames better than what it is often confused with",
    "declared_motion_wins": "HR motion as recorded explains the truth better than what it is often confused with",
    "declared_lr_motion_wins": "LR motion as recorded explains the truth better than what it is often confused with",
}


@dataclass
class _Scores:
    """What was measured of a sequence and scale: PSNR by pair and frame, of whole pictures and on textured surfaces; PSNR by
    hypothesis and frame, by what of DECLARED it is about. steady: frames whose truth equals that of the frame before.
    relit: whether light changes where nothing moves, or everywhere."""

    whole: dict
    textured: dict
    declared: dict
    steady: set
    relit: bool = False


def roundtrip(
    corpus: Corpus,
    settings: UpscaleSettings = DEFAULTS,
    on_frame: Callable[[], None] = lambda: None,
) -> list[Verdict]:
    """Every relation for every sequence and scale."""
    return [
        verdict
        for sequence in corpus.sequences
        for scale in scales_of(corpus, sequence)
        for verdict in _judge(corpus, sequence, scale, settings, on_frame)
    ]


def scales_of(corpus: Corpus, sequence: str) -> list[float]:
    """Nominal scales that the sequence has LR streams of."""
    return sorted({row["scale"] for row in _lr_rows(corpus, sequence)})


def _lr_rows(corpus: Corpus, sequence: str) -> list[dict]:
    names = set(corpus.streams(sequence))
    return [row for row in corpus.manifest.streams if row["name"] in names and row["name"].startswith("lr_")]


def _streams(corpus: Corpus, sequence: str, scale: float) -> dict[str, str]:
    """Kinds of streams by name: native; jittered (biased where there is one); biased and unbiased, both jittered."""
    rows = [row for row in _lr_rows(corpus, sequence) if row["scale"] == scale]
    found = {}
    for row in rows:
        if row["jittered"]:
            found["biased" if row["mip_bias"] else "unbiased"] = row["name"]
        elif not row["mip_bias"]:
            found["native"] = row["name"]
    jittered = found.get("biased", found.get("unbiased"))
    return found | ({"jittered": jittered} if jittered else {})


def _judge(corpus, sequence: str, scale: float, settings, on_frame) -> Iterator[Verdict]:
    streams = _streams(corpus, sequence, scale)
    lacking = {relation.id: _lacking(corpus, sequence, relation, streams, scale) for relation in RELATIONS}
    wanted = [relation for relation in RELATIONS if not lacking[relation.id]]
    pairs = list(dict.fromkeys((streams[kind], method) for r in wanted for kind, method in (r.better, r.worse)))
    scores = _scores(corpus, sequence, pairs, streams.get("jittered"), settings, on_frame)
    stills = still_shots(corpus, sequence)
    for relation in RELATIONS:
        figure, why = None, lacking[relation.id]
        if not why:
            pair = [(streams[kind], method) for kind, method in (relation.better, relation.worse)]
            figure, why = _difference(corpus, sequence, relation, pair, scores, stills)
        yield _verdict(relation.id, relation.proves, sequence, scale, figure, relation.needed, why)
    for name, proves in DECLARED.items():
        figure, why = _margin(list(scores.declared.get(name, {}).values()))
        yield _verdict(name, proves, sequence, scale, figure, 0.0, why)


def _verdict(name: str, proves: str, sequence: str, scale: float, figure: float | None, needed: float, why: str) -> Verdict:
    verdict = "not applicable" if figure is None else "holds" if figure >= needed else "broken"
    return Verdict(
        id=name, proves=proves, sequence=sequence, scale=scale, verdict=verdict, figure=figure, needed=needed, why=why
    )


def _lacking(corpus: Corpus, sequence: str, relation: Relation, streams: dict[str, str], scale: float) -> str:
    """Why a relation cannot be judged, or nothing."""
    entry = corpus.sequence(sequence)
    kinds, methods = zip(relation.better, relation.worse, strict=True)
    absent = [kind for kind in kinds if kind not in streams]
    if absent:
        return f"no {absent[0]} stream at this scale"
    if scale < LEAST_SCALE and relation.over in ("start", "end", "moving"):
        return "at this scale there is nothing to gain"
    if min(size for kind in kinds for size in _size(corpus, sequence, streams[kind])) < LEAST_SIZE:
        return f"LR frames have less than {LEAST_SIZE} pixels"
    sources = {entry.equal_streams.get(streams[kind], streams[kind]) for kind in kinds}
    if kinds[0] != kinds[1] and len(sources) == 1:
        return "both streams are the same files"
    known = {*entry.channels, *entry.constants}
    missing = [name for method in methods for name in (*METHODS[method].lr, *METHODS[method].hr) if name not in known]
    return f"{missing[0]} was not rendered" if missing else ""


def _size(corpus: Corpus, sequence: str, stream: str) -> tuple[int, int]:
    return corpus.record(sequence, corpus.frames(sequence)[0]).streams[stream].size


def _scores(corpus, sequence: str, pairs: Sequence[tuple[str, str]], jittered: str | None, settings, on_frame) -> _Scores:
    scores = _Scores({pair: {} for pair in pairs}, {pair: {} for pair in pairs}, {name: {} for name in DECLARED}, set())
    entry = corpus.sequence(sequence)
    moves = all(name in entry.channels or name in entry.constants for name in ("motion", "visibility"))
    previous = None
    for reader, step in upscale_frames(corpus, sequence, pairs, settings):
        frame, exposure = reader.frame, reader.record.exposure_ev
        truth = to_display(corpus.read(sequence, "hr", "color", frame), exposure)
        mask = _textured(reader)
        for pair, result in zip(pairs, step, strict=True):
            shown = to_display(np.maximum(result.image, 0), exposure)
            scores.whole[pair][frame] = min(psnr(shown, truth), MOST_PSNR)
            if mask is not None and mask.mean() >= LEAST_TEXTURED:
                scores.textured[pair][frame] = min(psnr(shown[mask], truth[mask]), MOST_PSNR)
        follows = previous is not None and previous[0] == frame - 1 and not reader.record.reset
        if jittered and min(_size(corpus, sequence, jittered)) >= LEAST_SIZE:
            before = tuple(corpus.record(sequence, frame - 1).streams[jittered].jitter) if follows else None
            scores.declared["declared_jitter_wins"][frame] = jitter_fits(reader, jittered, truth, before)
        if follows and moves:
            changed = np.abs(truth - previous[1]).max(axis=-1) > CHANGED
            if not changed.any():
                scores.steady.add(frame)
            still = _still(reader)
            dimmed = abs(float(truth.mean() - previous[1].mean())) > BRIGHTENED
            scores.relit |= dimmed or bool((changed & still).mean() > LEAST_TEXTURED)
            scores.declared["declared_motion_wins"][frame] = motion_fits(reader, "hr", truth, previous[1])
            if jittered:
                scores.declared["declared_lr_motion_wins"][frame] = motion_fits(reader, jittered, truth, previous[1])
        previous = (frame, truth)
        on_frame()
    return scores


def _still(reader: FrameReader) -> NDArray:
    """[height, width] pixels whose surface, and all within 5x5, stands still and was seen before."""
    motion, bits = (reader.image("hr", name) for name in ("motion", "visibility"))
    still = (motion.planes[0] == 0) & (motion.planes[1] == 0) & seen_before(bits.planes[0])
    return _all_around(np.array(still).reshape(motion.height, motion.width))


def _all_around(mask: NDArray) -> NDArray:
    """Where it holds within 5x5 pixels: colours are means over the pixel, and ids and motion are of its centre."""
    reach = range(-2, 3)
    return np.all([np.roll(mask, (j, i), (0, 1)) for j in reach for i in reach], axis=0)


def _margin(fits: list[dict[str, float]]) -> tuple[float | None, str]:
    """By how many dB the declared hypothesis is better than the best other one, means over frames; and which that is."""
    known = [fit for fit in fits if fit and not any(np.isnan(value) for value in fit.values())]
    names = [name for name in (known[0] if known else ()) if name != "declared"]
    if not names:
        return None, "nothing to tell it by"
    capped = [{name: min(value, MOST_PSNR) for name, value in fit.items()} for fit in known]
    means = {name: np.mean([fit["declared"] - fit[name] for fit in capped if name in fit]) for name in names}
    closest = min(means, key=means.get)
    return float(means[closest]), f"closest: {closest}"


def _textured(reader: FrameReader) -> NDArray | None:
    """[height, width] where F_beta varies within 3x3 pixels of one object; None without `brdf` or `object_id`."""
    entry = reader.corpus.sequence(reader.sequence)
    if any(name not in entry.channels and name not in entry.constants for name in ("brdf", "object_id")):
        return None
    images = (reader.image("hr", name) for name in ("brdf", "object_id"))
    material, identity = (to_array(image.planes, image.width, image.height) for image in images)
    material, identity = material.mean(axis=-1), identity[..., 0]
    around = np.stack([np.roll(material, (j, i), (0, 1)) for j in (-1, 0, 1) for i in (-1, 0, 1)])
    same = _all_around(np.all([np.roll(identity, -1, axis) == identity for axis in (0, 1)], axis=0))
    return same & (identity > 0) & (around.std(axis=0) > TEXTURE * np.maximum(around.mean(axis=0), 1e-6))


def _difference(corpus, sequence: str, relation: Relation, pair, scores: _Scores, stills) -> tuple[float | None, str]:
    table = scores.textured if relation.over == "surfaces" else scores.whole
    better, worse = (table[each] for each in pair)
    if relation.over in ("start", "end"):
        shots = [shot for shot in stills if len(shot) >= SHORTEST_SHOT and scores.steady >= set(shot[1:])]
        if not shots:
            return None, f"no {SHORTEST_SHOT} frames in which nothing changes"
        shot = max(shots, key=len)
        return float(better[shot[-1]] - worse[shot[0] if relation.over == "start" else shot[-1]]), ""
    if relation.over == "surfaces" and not better:
        return None, "no textured surfaces"
    if scores.relit and ("oracle" in (pair[0][1], pair[1][1]) or relation.over == "moving"):
        return None, "light changes"
    standing = {frame for shot in stills for frame in shot[1:]}
    frames = [
        frame
        for frame in better
        if relation.over != "moving" or not (frame in standing or corpus.record(sequence, frame).reset)
    ]
    if not frames:
        return None, "nothing moves"
    figure = float(np.mean([better[frame] - worse[frame] for frame in frames]))
    return (figure, "") if np.isfinite(figure) else (None, "the truth is not finite")
