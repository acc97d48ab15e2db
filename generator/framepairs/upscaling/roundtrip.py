"""What upscaling proves about a corpus: relations between methods and streams that healthy data show.

Each is judged per sequence and scale by differences of PSNR on the display transform `aces_srgb`. A relation that data cannot
show, because nothing stands still or a stream is missing, is not applicable, and says why.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..corpus import Corpus
from ..metrics import psnr, to_display
from .measures import still_shots
from .sequence import METHODS, upscale_frames
from .settings import DEFAULTS, UpscaleSettings

SHORTEST_SHOT = 8  # frames that a still shot must have
LEAST_TEXTURED = 0.01  # share of pixels
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
             ("jittered", "oracle"), ("jittered", "bicubic"), "moving", 0.5),
    Relation("lr_history_beats_bicubic", "LR motion and depth as recorded: history lands on the surface that it shows",
             ("jittered", "temporal"), ("jittered", "bicubic"), "moving", 0.25),
    Relation("oracle_beats_heuristic", "HR motion and visibility are not worse than what a game guesses from LR",
             ("jittered", "oracle"), ("jittered", "temporal"), "all", -0.25),
    Relation("guides_beat_color", "HR G-buffers lie on the truth: they tell more than LR colour alone",
             ("jittered", "guided"), ("jittered", "bicubic"), "all", 0.0),
    Relation("demodulation_beats_none", "F_beta is the material of the colour: light without it is smoother",
             ("jittered", "guided"), ("jittered", "joint_bilateral"), "surfaces", 0.0),
)  # fmt: skip


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
    lacking = {relation.id: _lacking(corpus, sequence, relation, streams) for relation in RELATIONS}
    wanted = [relation for relation in RELATIONS if not lacking[relation.id]]
    pairs = list(dict.fromkeys((streams[kind], method) for r in wanted for kind, method in (r.better, r.worse)))
    scores, textured = _scores(corpus, sequence, pairs, settings, on_frame) if pairs else ({}, {})
    shots = [shot for shot in still_shots(corpus, sequence) if len(shot) >= SHORTEST_SHOT]
    for relation in RELATIONS:
        figure, why = None, lacking[relation.id]
        if not why:
            better, worse = ((streams[kind], method) for kind, method in (relation.better, relation.worse))
            table = textured if relation.over == "surfaces" else scores
            figure, why = _difference(corpus, sequence, relation, table[better], table[worse], shots)
        verdict = "not applicable" if figure is None else "holds" if figure >= relation.needed else "broken"
        yield Verdict(id=relation.id, proves=relation.proves, sequence=sequence, scale=scale, verdict=verdict,
                      figure=figure, needed=relation.needed, why=why)  # fmt: skip


def _lacking(corpus: Corpus, sequence: str, relation: Relation, streams: dict[str, str]) -> str:
    """Why a relation cannot be judged, or nothing."""
    entry = corpus.sequence(sequence)
    kinds, methods = zip(relation.better, relation.worse, strict=True)
    absent = [kind for kind in kinds if kind not in streams]
    if absent:
        return f"no {absent[0]} stream at this scale"
    sources = {entry.equal_streams.get(streams[kind], streams[kind]) for kind in kinds}
    if kinds[0] != kinds[1] and len(sources) == 1:
        return "both streams are the same files"
    known = {*entry.channels, *entry.constants}
    missing = [name for method in methods for name in (*METHODS[method].lr, *METHODS[method].hr) if name not in known]
    return f"{missing[0]} was not rendered" if missing else ""


def _scores(corpus, sequence: str, pairs: Sequence[tuple[str, str]], settings, on_frame) -> tuple[dict, dict]:
    """PSNR by pair and frame: of whole pictures, and on textured surfaces."""
    scores, textured = ({pair: {} for pair in pairs} for _ in range(2))
    for reader, step in upscale_frames(corpus, sequence, pairs, settings):
        exposure = reader.record.exposure_ev
        truth = to_display(corpus.read(sequence, "hr", "color", reader.frame), exposure)
        mask = _textured(corpus, sequence, reader.frame)
        for pair, result in zip(pairs, step, strict=True):
            shown = to_display(np.maximum(result.image, 0), exposure)
            scores[pair][reader.frame] = psnr(shown, truth)
            if mask is not None and mask.mean() >= LEAST_TEXTURED:
                textured[pair][reader.frame] = psnr(shown[mask], truth[mask])
        on_frame()
    return scores, textured


def _textured(corpus: Corpus, sequence: str, frame: int) -> NDArray | None:
    """[height, width] where F_beta varies within 3x3 pixels of one object; None without `brdf` or `object_id`."""
    entry = corpus.sequence(sequence)
    if any(name not in entry.channels and name not in entry.constants for name in ("brdf", "object_id")):
        return None
    material = corpus.read(sequence, "hr", "brdf", frame).mean(axis=-1)
    identity = corpus.read(sequence, "hr", "object_id", frame)[..., 0]
    around = np.stack([np.roll(material, (j, i), (0, 1)) for j in (-1, 0, 1) for i in (-1, 0, 1)])
    same = np.all([np.roll(identity, (j, i), (0, 1)) == identity for j in (-1, 0, 1) for i in (-1, 0, 1)], axis=0)
    return same & (identity > 0) & (around.std(axis=0) > TEXTURE * np.maximum(around.mean(axis=0), 1e-6))


def _difference(corpus, sequence: str, relation: Relation, better: dict, worse: dict, shots) -> tuple[float | None, str]:
    if relation.over in ("start", "end"):
        if not shots:
            return None, f"no {SHORTEST_SHOT} frames in which nothing moves"
        shot = max(shots, key=len)
        return float(better[shot[-1]] - worse[shot[0] if relation.over == "start" else shot[-1]]), ""
    if relation.over == "surfaces" and not better:
        return None, "no textured surfaces"
    standing = {frame for shot in still_shots(corpus, sequence) for frame in shot[1:]}
    frames = [
        frame
        for frame in better
        if relation.over != "moving" or not (frame in standing or corpus.record(sequence, frame).reset)
    ]
    if not frames:
        return None, "nothing moves"
    return float(np.mean([better[frame] - worse[frame] for frame in frames])), ""
