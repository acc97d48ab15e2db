"""Renders a sequence into a corpus: rendering beside encoding and writing, resuming by itself.

One thread renders. Others encode and write the files of the frame before, each atomically; then one makes them last and
writes the frame's record: a frame with a record is whole. Memory holds two frames at most, however long the sequence is.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

from .backend import dr, release_memory
from .channels import Channel
from .conventions import CONVENTIONS, frame_name
from .engine import Engine
from .errors import MachineError
from .exr import encode
from .frame import FrameState, check_frames
from .frame_parts import stream_part
from .job import Job
from .launched import StreamFrame, fetch
from .locking import corpus_lock, is_held
from .manifest import (
    CameraRecord,
    FileRecord,
    FrameRecord,
    StreamRecord,
    frame_key,
    rebuild_sequence_index,
    sync_files,
    to_json,
    write_atomically,
)
from .opening import clear_left_overs, open_corpus, write_manifest
from .resume import Wanted, drop_outdated, record_file, stream_files, wanted_of

FLOAT_COLORS = frozenset({"color", "emission", "brdf"})


@dataclass(frozen=True, kw_only=True)
class FrameProfile:
    """What a frame cost, in seconds: state (scene and camera at its time), render (until its arrays are there), encode and
    write (its files, summed over threads), close (until they last and have a record). launches, compiled: of kernels, where
    they were counted."""

    state: float
    render: float
    encode: float = 0.0
    write: float = 0.0
    close: float = 0.0
    launches: int | None = None
    compiled: int | None = None


@dataclass(frozen=True, kw_only=True)
class Progress:
    """One frame is on disk. rendered: False where it was there already; why: what made it necessary. worker: who did it, where
    there are several."""

    frame: int
    rendered: bool
    bytes: int
    why: str = ""
    profile: FrameProfile | None = None
    worker: str = ""


# Who renders: gets the job, the frames, and the token of the lock in whose name files are written.
Renderer = Callable[[Job, Sequence[int], str], Iterator[Progress]]


@dataclass(frozen=True)
class _Written:
    file: FileRecord
    saturated: int
    encode_s: float
    write_s: float


@dataclass(frozen=True)
class _Pending:
    """A frame on its way to the disk. files: of each stream."""

    wanted: Wanted
    rendered: list[StreamFrame]
    files: list[list[Future]]
    profile: FrameProfile | None


def usable_cores() -> int:
    """Cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def estimated_bytes(job: Job, frames: int) -> int:
    """Upper bound: the uncompressed size of what will be written (ZIP brings it to 30 to 60 percent)."""
    pixels = sum(stream.size[0] * stream.size[1] for stream in job.streams)
    return frames * pixels * sum(channel.bytes_per_pixel for channel in job.channels)


def render_sequence(
    job: Job,
    frames: Sequence[int],
    *,
    add_streams: bool = False,
    update: bool = False,
    profile: bool = False,
    renderer: Renderer | None = None,
) -> Iterator[Progress]:
    """Render `frames` of the job's path into its corpus, and yield after each frame is on disk.

    Frames that lie there and would come out the same stay; those that would not are rendered again, and `why` says what
    changed. add_streams: the plan may have more scales and variants than the corpus. update: its other keys may differ, too.
    renderer: who renders, instead of this process.

    At the first step, raises InputError for a corpus of another plan, and MachineError for one that another process writes;
    later, MachineError where a file cannot be written.
    """
    check_frames(frames, len(job.shoot))
    folder = job.out / job.sequence
    # What cannot be drawn is refused before anything is written.
    engine = _engine(job) if renderer is None and not folder.is_dir() else None
    with corpus_lock(job.out) as hold:
        opened = open_corpus(job, add_streams=add_streams, update=update)
        outdated = drop_outdated(job, frames) if opened.changes else {}
        write_manifest(job, opened)
        engines = [] if engine is None else [engine]
        if renderer is None:
            steps = render_frames(job, frames, hold.token, engines=engines, profile=profile)
        else:
            steps = renderer(job, frames, hold.token)
        for step in steps:
            if hold.lost.is_set():
                raise MachineError(f"{job.out}: the lock of this corpus was lost while we wrote into it")
            yield replace(step, why=outdated.get(step.frame, step.why))
        if renderer is not None:
            clear_left_overs(job)  # of a worker that was lost
        rebuild_sequence_index(folder)
    dr.flush_malloc_cache()


def render_frames(
    job: Job,
    frames: Sequence[int],
    token: str,
    *,
    engines: list[Engine] | None = None,
    profile: bool = False,
    writers: int | None = None,
) -> Iterator[Progress]:
    """Render what `frames` lack into an opened corpus that `token` holds the lock of. writers: threads that encode and write.

    engines: of this job, one or none; an engine that is made is left there for the next call. Raises MachineError where the
    lock is another's: whoever ordered these frames has gone.
    """
    engines = [] if engines is None else engines
    with ThreadPoolExecutor(1) as closer, ThreadPoolExecutor(writers or max(2, usable_cores())) as pool:
        waiting: list[Future[Progress]] = []
        for frame in frames:
            wanted = wanted_of(job, frame)
            if wanted.streams and not engines:
                engines.append(_engine(job))
            if wanted.as_recorded:
                yield from (waiting.pop(0).result() for _ in waiting[:])
                yield Progress(frame=frame, rendered=False, bytes=0)
                continue
            waiting.append(closer.submit(_close, _render(engines, pool, wanted, token, profile), token))
            if len(waiting) > 1:  # one frame is being written while the next is rendered
                yield waiting.pop(0).result()
        yield from (item.result() for item in waiting)


def _engine(job: Job) -> Engine:
    engine = Engine(job.scene, job.plan, job.overlay)
    release_memory()  # of what it was built from
    return engine


def _render(engines: list[Engine], pool: ThreadPoolExecutor, wanted: Wanted, token: str, profile: bool) -> _Pending:
    """Render the streams that a frame lacks, and hand their arrays to the threads that encode and write."""
    job, start = wanted.job, time.perf_counter()
    names, state = frozenset(channel.name for channel in job.channels), wanted.state  # here: `Shoot` is for one thread
    if not wanted.streams:
        return _Pending(wanted, [], [], None)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, profile):
        middle = time.perf_counter()
        streams = fetch(engines[0].launch(state, wanted.streams, names, job.seed))
        costs = FrameProfile(state=middle - start, render=time.perf_counter() - middle)
        if profile:
            kernels = [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]
            compiled = sum(not entry["cache_hit"] for entry in kernels)
            costs = replace(costs, launches=len(kernels), compiled=compiled)
    write = partial(pool.submit, _write_channel, job, token, wanted.frame)
    return _Pending(wanted, streams, [[write(stream, channel) for channel in job.channels] for stream in streams], costs)


def _write_channel(job: Job, token: str, frame: int, rendered: StreamFrame, channel: Channel) -> _Written:
    start = time.perf_counter()
    relative = f"{rendered.stream.name}/{channel.name}/{frame_name(frame)}.exr"
    attributes = {
        "framepairs:sequence": job.sequence,
        "framepairs:stream": rendered.stream.name,
        "framepairs:convention": CONVENTIONS.get(channel.name, channel.meaning),
    }
    as_float = job.plan.color_precision == "float" and channel.name in FLOAT_COLORS
    array = rendered.arrays.pop(channel.name)
    encoded = encode(channel, array, attributes=attributes, dtype="float" if as_float else None)
    middle = time.perf_counter()
    _check_held(job, token)
    write_atomically(job.out / job.sequence / relative, encoded.data, sync=False)
    file = FileRecord(path=relative, sha256=encoded.sha256, size=len(encoded.data))
    return _Written(file, encoded.saturated, middle - start, time.perf_counter() - middle)


def _check_held(job: Job, token: str) -> None:
    if not is_held(job.out, token):
        raise MachineError(f"{job.out}: whoever ordered these frames holds the lock of this corpus no more")


def _close(pending: _Pending, token: str) -> Progress:
    """Wait for the frame's files and make them last, then write its record."""
    wanted, folder = pending.wanted, pending.wanted.job.out / pending.wanted.job.sequence
    job, state, record = wanted.job, wanted.state, wanted.record
    written = [[future.result() for future in futures] for futures in pending.files]
    start = time.perf_counter()
    sync_files(folder / item.file.path for group in written for item in group)
    fresh = {r.stream.name: _stream_record(job, state, r, files) for r, files in zip(pending.rendered, written, strict=True)}
    kept = {path for s in job.streams if s.name not in fresh for path in stream_files(job, s, wanted.frame)}
    before, every = record.files if record else [], [item for group in written for item in group]
    new = FrameRecord(
        frame=state.frame,
        time_s=state.time_s,
        frame_time_ms=state.frame_time_ms,
        reset=state.reset,
        exposure_ev=state.exposure_ev,
        camera=_camera_record(state),
        streams={stream.name: fresh.get(stream.name) or record.streams[stream.name] for stream in job.streams},
        files=sorted([*(f for f in before if f.path in kept), *(item.file for item in every)], key=lambda item: item.path),
        parts=wanted.parts,
        inputs=job.inputs(wanted.frame),
        key=frame_key(wanted.parts),
    )
    _check_held(job, token)
    write_atomically(record_file(job, wanted.frame), to_json(new))
    for surplus in {item.path for item in before} - {item.path for item in new.files}:
        (folder / surplus).unlink(missing_ok=True)  # of channels and streams that there are no more
    costs = pending.profile
    if costs is not None:
        encode_s, write_s = sum(item.encode_s for item in every), sum(item.write_s for item in every)
        costs = replace(costs, encode=encode_s, write=write_s, close=time.perf_counter() - start)
    size = sum(item.file.size for item in every)
    return Progress(frame=wanted.frame, rendered=bool(wanted.streams), bytes=size, why=wanted.why, profile=costs)


def _stream_record(job: Job, state: FrameState, rendered: StreamFrame, written: list[_Written]) -> StreamRecord:
    stream = rendered.stream
    return StreamRecord(
        size=stream.size,
        scale=stream.effective_scale(job.plan.display),
        jitter=rendered.jitter,
        mip_bias=stream.mip_bias,
        saturated=sum(item.saturated for item in written),
        fireflies=rendered.fireflies,
        rejected_paths=rendered.rejected_paths,
        part=stream_part(job, state.frame, stream),
    )


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
