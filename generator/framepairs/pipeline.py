"""Renders a sequence into a corpus: frames in order, rendering beside encoding and writing, resuming by itself.

A frame's files are written first, each atomically, its record last. What already lies there is kept where the record's key
equals the key of what would be rendered and every stream is in it.
"""

import hashlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from .backend import dr
from .channels import Channel
from .conventions import CONVENTIONS, Stream, frame_name
from .engine import Engine, StreamFrame
from .errors import InputError
from .exr import encode
from .frame import FrameState, frame_states
from .job import Job, open_corpus
from .manifest import (
    CameraRecord,
    FileRecord,
    FrameRecord,
    StreamRecord,
    from_json,
    rebuild_sequence_index,
    to_json,
    write_atomically,
)

FLOAT_COLORS = frozenset({"color", "emission", "brdf"})
WRITERS = 2


@dataclass(frozen=True, kw_only=True)
class Progress:
    """One frame is on disk. rendered: False where it was there already."""

    frame: int
    rendered: bool
    bytes: int


def estimated_bytes(job: Job, frames: int) -> int:
    """Upper bound: the uncompressed size of what will be written (ZIP brings it to 30 to 60 percent)."""
    pixels = sum(stream.size[0] * stream.size[1] for stream in job.streams)
    return frames * pixels * sum(channel.bytes_per_pixel for channel in job.channels)


def render_sequence(job: Job, frames: Sequence[int], *, add_streams: bool = False) -> Iterator[Progress]:
    """Render `frames` of the job's path into its corpus, and yield after each frame is on disk.

    At the first step, raises InputError for an existing corpus of another plan; later, MachineError where a file cannot be
    written.
    """
    states = frame_states(job.shoot, frames)
    folder = job.out / job.sequence
    # What cannot be drawn is refused before anything is written.
    engine = Engine(job.scene, job.plan, job.overlay) if not folder.is_dir() else None
    open_corpus(job, add_streams=add_streams)
    with ThreadPoolExecutor(WRITERS) as writers:
        waiting: list[tuple[FrameState, FrameRecord | None, list]] = []
        for state in states:
            record = _existing_record(job, folder, state.frame)
            missing = [s for s in job.streams if record is None or s.name not in record.streams]
            if not missing:
                while waiting:
                    yield _finish(job, folder, *waiting.pop(0))
                yield Progress(frame=state.frame, rendered=False, bytes=0)
                continue
            if engine is None:
                engine = Engine(job.scene, job.plan, job.overlay)
            jobs = [_submit(job, engine, writers, folder, state, stream) for stream in missing]
            waiting.append((state, record, jobs))
            if len(waiting) > 1:  # one frame is being written while the next is rendered
                yield _finish(job, folder, *waiting.pop(0))
        for item in waiting:
            yield _finish(job, folder, *item)
    rebuild_sequence_index(folder)
    dr.flush_malloc_cache()


def _submit(job: Job, engine: Engine, writers: ThreadPoolExecutor, folder: Path, state: FrameState, stream: Stream):
    names = frozenset(channel.name for channel in job.channels)
    seed = int(hashlib.sha256(f"{job.plan.seed} {job.sequence}".encode()).hexdigest()[:8], 16)
    rendered = engine.render(state, stream, names, seed)
    files = [writers.submit(_write_channel, job, folder, state.frame, rendered, channel) for channel in job.channels]
    return rendered, files


def _write_channel(
    job: Job, folder: Path, frame: int, rendered: StreamFrame, channel: Channel
) -> tuple[FileRecord, int]:
    relative = f"{rendered.stream.name}/{channel.name}/{frame_name(frame)}.exr"
    attributes = {
        "framepairs:sequence": job.sequence,
        "framepairs:stream": rendered.stream.name,
        "framepairs:convention": CONVENTIONS.get(channel.name, channel.meaning),
    }
    as_float = job.plan.color_precision == "float" and channel.name in FLOAT_COLORS
    array = rendered.arrays.pop(channel.name)
    encoded = encode(channel, array, attributes=attributes, dtype="float" if as_float else None)
    write_atomically(folder / relative, encoded.data)
    return FileRecord(path=relative, sha256=encoded.sha256, size=len(encoded.data)), encoded.saturated


def _finish(job: Job, folder: Path, state: FrameState, before: FrameRecord | None, jobs: list) -> Progress:
    """Wait for the frame's files, then write its record."""
    streams = dict(before.streams) if before else {}
    files = list(before.files) if before else []
    fresh = 0
    for rendered, futures in jobs:
        stream = rendered.stream
        written: list[tuple[FileRecord, int]] = [future.result() for future in futures]
        files += [record for record, _ in written]
        fresh += sum(record.size for record, _ in written)
        streams[stream.name] = StreamRecord(
            size=stream.size,
            scale=stream.effective_scale(job.plan.display),
            jitter=rendered.jitter,
            mip_bias=stream.mip_bias,
            saturated=sum(saturated for _, saturated in written),
            fireflies=rendered.fireflies,
            rejected_paths=rendered.rejected_paths,
        )
    record = FrameRecord(
        frame=state.frame,
        time_s=state.time_s,
        frame_time_ms=state.frame_time_ms,
        reset=state.reset,
        exposure_ev=state.exposure_ev,
        camera=_camera_record(state),
        streams=streams,
        files=sorted(files, key=lambda item: item.path),
        key=job.key(state.frame),
    )
    write_atomically(folder / "frames" / f"{frame_name(state.frame)}.json", to_json(record))
    return Progress(frame=state.frame, rendered=True, bytes=fresh)


def _camera_record(state: FrameState) -> CameraRecord:
    return CameraRecord(
        fov_y_rad=state.camera.fov_y,
        near=state.camera.near,
        far=state.camera.far,
        view_from_world=state.camera.view_from_world.tolist(),
        clip_from_view=state.camera.clip_from_view.tolist(),
        previous_view_from_world=state.previous_camera.view_from_world.tolist(),
        previous_clip_from_view=state.previous_camera.clip_from_view.tolist(),
    )


def _existing_record(job: Job, folder: Path, frame: int) -> FrameRecord | None:
    """The record of a frame that is there and would come out the same; None otherwise."""
    file = folder / "frames" / f"{frame_name(frame)}.json"
    if not file.is_file():
        return None
    try:
        record = from_json(FrameRecord, file)
    except InputError:
        return None  # a damaged record is a frame to render again
    whole = all((folder / item.path).is_file() and (folder / item.path).stat().st_size == item.size for item in record.files)
    return record if whole and record.key == job.key(frame) else None
