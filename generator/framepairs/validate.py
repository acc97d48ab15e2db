"""`framepairs validate`: named checks of a corpus, each with a figure, a threshold and a verdict. Needs no renderer."""

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .channels import SEEN_BY_PREVIOUS_CAMERA, channels_with
from .consistency import warp_consistency
from .corpus import Corpus
from .errors import InputError
from .jitter import jitter
from .manifest import FrameRecord, SequenceIndex, from_json
from .schemas import check_file

READERS = 2
WARP_CHANNELS = frozenset({"object_id", "depth", "motion", "visibility"})
UNIT_NORMAL = 2e-3  # three halves, each rounded by 2^-11 at most


@dataclass(frozen=True, kw_only=True)
class Check:
    """What a check proves, and the least (or greatest) figure that passes."""

    id: str
    proves: str
    threshold: float
    at_least: bool = False

    def passes(self, figure: float) -> bool:
        return figure >= self.threshold if self.at_least else figure <= self.threshold


CHECKS = (
    Check(id="schema", proves="every JSON file follows its published schema", threshold=0),
    Check(id="files", proves="every recorded file is there with its sha256, size and resolution", threshold=0),
    Check(id="complete", proves="every frame has every stream, sequence.json lists them, the BRDF table is the recorded one",
          threshold=0),
    Check(id="surplus", proves="there is no file that no record names", threshold=0),
    Check(id="finite", proves="every value is finite, but for depth's declared background", threshold=0),
    Check(id="range", proves="normals are unit or zero, shares lie in 0 to 1, depth is infinite only in the background",
          threshold=0),
    Check(id="jitter", proves="the recorded J is the declared sequence, and 0 in streams without", threshold=0),
    Check(id="reset", proves="motion, dual motion and visibility are 0 on a reset", threshold=0),
    Check(id="dual_motion", proves="dual motion equals motion wherever the previous frame saw the surface", threshold=0),
    Check(id="still", proves="where nothing moved between two frames, motion is exactly 0 in every stream", threshold=0),
    Check(id="warp_object", proves="motion lands on the right object (share of visible interior pixels)",
          threshold=0.999, at_least=True),
    Check(id="warp_place", proves="motion lands within 0.05 px of the surface point that depth and matrices give (share)",
          threshold=0.999, at_least=True),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """figure: the worst over all frames and streams (a count of offences where the threshold is 0), or None where the check
    did not apply. worst: where, most telling first."""

    id: str
    proves: str
    verdict: Literal["pass", "fail", "not applicable"]
    figure: float | None
    threshold: float
    worst: tuple[str, ...] = ()


@dataclass
class _Findings:
    figures: dict[str, list[tuple[float, str]]] = field(default_factory=dict)

    def add(self, check: str, figure: float, where: str) -> None:
        self.figures.setdefault(check, []).append((float(figure), where))


def validate_corpus(corpus: Corpus, on_frame: Callable[[str, int], None] | None = None) -> list[CheckResult]:
    """Run all checks. `on_frame` is called after each frame, with sequence and frame."""
    found = _Findings()
    _check_schema(corpus.folder / "corpus.json", "corpus", found)
    with ThreadPoolExecutor(READERS) as readers:
        for sequence in corpus.sequences:
            _check_schema(corpus.folder / sequence / "sequence.json", "sequence", found)
            _check_surplus(corpus, sequence, found)
            _check_complete(corpus, sequence, found)
            moved = corpus.sequence(sequence).moving, corpus.sequence(sequence).deforming
            before: dict[str, dict[str, NDArray]] = {}
            last: FrameRecord | None = None
            for frame in corpus.frames(sequence):
                _check_schema(corpus.folder / sequence / "frames" / f"{frame:06d}.json", "frame", found)
                try:
                    record = corpus.record(sequence, frame)
                except InputError:
                    continue  # the schema check has named it
                follows = last is not None and last.frame == frame - 1 and not record.reset
                now: dict[str, dict[str, NDArray]] = {}
                for stream in _in_plan_order(corpus, record):
                    where = f"{sequence} {stream} frame {frame}"
                    arrays = _read(corpus, sequence, stream, frame, readers, found)
                    _check_arrays(arrays, record, where, found)
                    _check_jitter(corpus, record, stream, where, found)
                    now[stream] = {name: arrays[name] for name in WARP_CHANNELS & set(arrays)}
                    if follows and stream in before:
                        _check_warp(arrays, before[stream], record, last, stream, moved, where, found)
                    if follows and _stands_still(now, before, record) and "motion" in arrays:
                        found.add("still", np.count_nonzero(arrays["motion"]), where)
                before, last = now, record
                if on_frame:
                    on_frame(sequence, frame)
    return list(_verdicts(found))


def _verdicts(found: _Findings) -> Iterator[CheckResult]:
    for check in CHECKS:
        figures = found.figures.get(check.id, [])
        worst = sorted(figures, key=lambda item: item[0] if check.at_least else -item[0])
        figure = worst[0][0] if worst else None
        verdict = "not applicable" if figure is None else "pass" if check.passes(figure) else "fail"
        offending = tuple(where for value, where in worst if not check.passes(value))[:5]
        yield CheckResult(
            id=check.id, proves=check.proves, verdict=verdict, figure=figure, threshold=check.threshold, worst=offending
        )


def _in_plan_order(corpus: Corpus, record: FrameRecord) -> list[str]:
    order = [row["name"] for row in corpus.manifest.streams]
    return sorted(record.streams, key=lambda name: order.index(name) if name in order else len(order))


def _stands_still(now: dict[str, dict], before: dict[str, dict], record: FrameRecord) -> bool:
    """The camera did not move, and the HR frame holds the same surfaces at the same depths."""
    camera = record.camera
    if (camera.view_from_world, camera.clip_from_view) != (
        camera.previous_view_from_world,
        camera.previous_clip_from_view,
    ):
        return False
    return all(
        name in now.get("hr", {}) and name in before.get("hr", {}) and np.array_equal(now["hr"][name], before["hr"][name])
        for name in ("depth", "object_id")
    )


def _check_schema(file, name: str, found: _Findings) -> None:
    try:
        check_file(name, file)
        found.add("schema", 0, str(file))
    except InputError as error:
        found.add("schema", 1, str(error))


def _check_complete(corpus: Corpus, sequence: str, found: _Findings) -> None:
    table = corpus.manifest.brdf_table
    if table is not None:
        file = corpus.folder / table.path
        same = file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() == table.sha256
        found.add("complete", not same, f"{file}: missing, or not the recorded bytes")
    promised = {row["name"] for row in corpus.manifest.streams}
    keys = {}
    for frame in corpus.frames(sequence):
        try:
            record = corpus.record(sequence, frame)
        except InputError:
            continue  # the schema check names it
        keys[frame] = record.key
        missing = sorted(promised - set(record.streams))
        found.add("complete", len(missing), f"{sequence} frame {frame}: lacks {', '.join(missing)}")
    try:
        index = from_json(SequenceIndex, corpus.folder / sequence / "sequence.json")
        differs = {entry.frame: entry.key for entry in index.frames} != keys
        found.add("complete", differs, f"{sequence}/sequence.json does not list the frames that are there")
    except InputError:
        return  # the schema check names it


def _check_surplus(corpus: Corpus, sequence: str, found: _Findings) -> None:
    folder = corpus.folder / sequence
    recorded = {"sequence.json"}
    for frame in corpus.frames(sequence):
        recorded.add(f"frames/{frame:06d}.json")
        try:
            recorded.update(item.path for item in corpus.record(sequence, frame).files)
        except InputError:
            continue
    there = {file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()}
    found.add("surplus", len(there - recorded), f"{sequence}: {', '.join(sorted(there - recorded)[:3])}")


def _read(corpus: Corpus, sequence: str, stream: str, frame: int, readers, found: _Findings) -> dict[str, NDArray]:
    """All channels that can be read; what cannot is found."""
    entry = corpus.sequence(sequence)
    table = channels_with(corpus.manifest.plan.motion_offsets)
    names = [c.name for c in table if c.name in entry.channels or c.name in entry.constants]
    futures = {name: readers.submit(corpus.read, sequence, stream, name, frame) for name in names}
    arrays = {}
    for name, future in futures.items():
        try:
            arrays[name] = future.result()
            found.add("files", 0, "")
        except InputError as error:
            found.add("files", 1, str(error))
    return arrays


def _check_arrays(arrays: dict[str, NDArray], record: FrameRecord, where: str, found: _Findings) -> None:
    for name, array in arrays.items():
        bad = np.isnan(array) | np.isneginf(array) if name == "depth" else ~np.isfinite(array)
        found.add("finite", np.count_nonzero(bad), f"{where} {name}")
    found.add("range", sum(_out_of_range(arrays)), where)
    if record.reset:
        moved = [np.count_nonzero(arrays[n]) for n in ("motion", "dual_motion", "visibility") if n in arrays]
        found.add("reset", sum(moved), where)
    if {"motion", "dual_motion", "visibility"} <= set(arrays):
        seen = (arrays["visibility"][..., 0] & SEEN_BY_PREVIOUS_CAMERA) > 0
        differs = np.any(arrays["motion"] != arrays["dual_motion"], axis=-1)
        found.add("dual_motion", np.count_nonzero(differs & seen), where)


def _out_of_range(arrays: dict[str, NDArray]) -> Iterator[int]:
    """Counts of offending pixels."""
    for name in ("albedo", "roughness", "metallic", "specular", "transparency", "overlay"):
        if name in arrays:
            yield np.count_nonzero((arrays[name] < 0) | (arrays[name] > 1))
    for name in ("color", "emission", "brdf"):
        if name in arrays:
            yield np.count_nonzero(arrays[name] < 0)
    if "normal" in arrays:
        length = np.linalg.norm(arrays["normal"], axis=-1)
        yield np.count_nonzero((np.abs(length - 1) > UNIT_NORMAL) & (length != 0))
    if {"depth", "object_id"} <= set(arrays):
        yield np.count_nonzero(np.isinf(arrays["depth"]) != (arrays["object_id"] == 0))
        yield np.count_nonzero(arrays["depth"] <= 0)


def _check_jitter(corpus: Corpus, record: FrameRecord, stream: str, where: str, found: _Findings) -> None:
    row = next((row for row in corpus.manifest.streams if row["name"] == stream), None)
    if row is None:
        found.add("jitter", 1, f"{where}: corpus.json does not know the stream")
        return
    expected = jitter(record.frame, row["jitter_length"]) if row["jittered"] else (0.0, 0.0)
    error = max(abs(a - b) for a, b in zip(record.streams[stream].jitter, expected, strict=True))
    found.add("jitter", error, where)


def _check_warp(arrays, before, record, last, stream: str, moved, where: str, found: _Findings) -> None:
    if not set(arrays) >= WARP_CHANNELS or not set(before) >= WARP_CHANNELS:
        return
    jitters = record.streams[stream].jitter, last.streams[stream].jitter
    result = warp_consistency(arrays, before, record.camera, *jitters, *moved)
    if result.pixels:
        found.add("warp_object", result.same_object, f"{where}: {result.same_object:.5f}")
        found.add("warp_place", result.same_place, f"{where}: {result.same_place:.5f}, p99 {result.residual_p99:.3g} px")
