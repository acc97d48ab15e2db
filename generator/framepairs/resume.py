"""What a corpus still lacks: which streams of a frame are to be rendered, and why."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from .conventions import Stream, frame_name
from .errors import InputError
from .frame import FrameState
from .frame_parts import frame_parts, stream_part
from .job import Job
from .manifest import FrameRecord, frame_key, from_json, to_json, write_atomically

NEW, DAMAGED, MISSING = "not there", "its record is damaged", "files are missing"


@dataclass(frozen=True)
class Wanted:
    """What one frame lacks. streams: to render, all their channels. record: what lies there, if it can be read. outdated:
    streams in it that would come out otherwise today. why: empty where nothing is rendered. as_recorded: it may stay."""

    job: Job
    frame: int
    streams: tuple[Stream, ...]
    record: FrameRecord | None
    outdated: tuple[str, ...]
    why: str
    as_recorded: bool

    @cached_property
    def state(self) -> FrameState:
        return self.job.shoot.state(self.frame)

    @cached_property
    def parts(self) -> dict[str, str]:
        return frame_parts(self.job, self.state)


def record_file(job: Job, frame: int) -> Path:
    return job.out / job.sequence / "frames" / f"{frame_name(frame)}.json"


def stream_files(job: Job, stream: Stream, frame: int) -> list[str]:
    """The files of one stream of a frame, relative to the sequence's folder."""
    return [f"{stream.name}/{channel.name}/{frame_name(frame)}.exr" for channel in job.channels]


def wanted_of(job: Job, frame: int) -> Wanted:
    """What of a frame is to be rendered. Where its inputs are the record's, nothing is compared; else its parts are."""
    record, problem = _record(job, frame)
    if record is None:
        return Wanted(job, frame, job.streams, None, (), problem, False)
    whole = _whole_files(job, record)
    why = {}
    for stream in job.streams:
        if not whole.issuperset(stream_files(job, stream, frame)):
            why[stream.name] = MISSING if stream.name in record.streams else f"{stream.name} {NEW}"
    there = [stream for stream in job.streams if stream.name in record.streams]
    others = tuple(s.name for s in there if stream_part(job, frame, s) != record.streams[s.name].part)
    why |= {name: f"{name} changed" for name in others}
    streams = tuple(stream for stream in job.streams if stream.name in why)
    lists = {path for stream in job.streams for path in stream_files(job, stream, frame)} == {f.path for f in record.files}
    as_before = Wanted(job, frame, streams, record, others, _joined(why.values()), not streams and lists)
    if record.inputs is not None and record.inputs == job.inputs(frame):
        return as_before
    parts = as_before.parts
    changed = [name for name in sorted({*parts, *record.parts}) if parts.get(name) != record.parts.get(name)]
    if changed:
        reason = _joined(f"{name} changed" for name in changed)
        return replace(as_before, streams=job.streams, outdated=tuple(record.streams), why=reason, as_recorded=False)
    return replace(as_before, as_recorded=False)


def drop_outdated(job: Job, frames: Sequence[int]) -> dict[int, str]:
    """Take what would come out otherwise today out of the sequence, before its manifest says that it is today's: by frame, why.

    Raises InputError, and drops nothing, where that concerns a frame outside `frames`: it would be gone and not come again.
    """
    folder, asked = job.out / job.sequence, {*frames}
    numbers = sorted(int(file.stem) for file in (folder / "frames").glob("*.json") if file.stem.isdecimal())
    outdated = {}
    for number in numbers:
        wanted = wanted_of(job, number) if number < len(job.shoot) else None
        if wanted is not None and wanted.outdated:
            outdated[number] = wanted.why
    beyond = [number for number in outdated if number not in asked]
    if beyond:
        problem = f"{outdated[beyond[0]]} since it was rendered; ask for all {len(beyond)} such frames, or for another folder"
        raise InputError(problem, file=folder, frame=beyond[0], field="frames")
    for number in outdated:
        wanted = wanted_of(job, number)
        _drop_streams(job, wanted.record, wanted.outdated)
    for number in numbers:
        if number >= len(job.shoot) and (record := _record(job, number)[0]) is not None:
            _drop_streams(job, record, tuple(record.streams))
    _sweep(folder)
    return outdated


def _sweep(folder: Path) -> None:
    """Removes the images of frames that have no record: a render that was killed left them."""
    whole = {file.stem for file in (folder / "frames").glob("*.json")}
    for image in folder.glob("*/*/*.exr"):
        if image.stem not in whole:
            image.unlink(missing_ok=True)


def _drop_streams(job: Job, record: FrameRecord, names: tuple[str, ...]) -> None:
    """The record goes first, or loses the streams: what it no longer names are no frames."""
    dropped = [item for item in record.files if item.path.split("/")[0] in names]
    streams = {name: stream for name, stream in record.streams.items() if name not in names}
    file = record_file(job, record.frame)
    if streams:
        files = [item for item in record.files if item not in dropped]
        write_atomically(file, to_json(record.model_copy(update={"streams": streams, "files": files})))
    else:
        file.unlink(missing_ok=True)
    for item in dropped:
        (job.out / job.sequence / item.path).unlink(missing_ok=True)


def _record(job: Job, frame: int) -> tuple[FrameRecord | None, str]:
    file = record_file(job, frame)
    if not file.is_file():
        return None, NEW
    try:
        record = from_json(FrameRecord, file)
    except InputError:
        return None, DAMAGED
    return (record, "") if record.key == frame_key(record.parts) else (None, DAMAGED)


def _whole_files(job: Job, record: FrameRecord) -> set[str]:
    """Paths of a record's files that are there in their size."""
    folder = job.out / job.sequence
    return {item.path for item in record.files if _size(folder / item.path) == item.size}


def _size(file: Path) -> int | None:
    try:
        return file.stat().st_size
    except OSError:
        return None


def _joined(reasons: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(reasons))
