"""The JSON files of a corpus: their models, how they are written, and the key that says which pixels a frame has.

`corpus.json` at the top, `<sequence>/sequence.json` rebuilt from the frame records, and `<sequence>/frames/<frame>.json`,
written last, so that a frame that has one is whole. None holds a time stamp or a host name: two runs give equal bytes.
"""

import hashlib
import json
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import rfc8785
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from .camera_path import CameraPath
from .errors import InputError, MachineError
from .plan import RenderPlan

LOCK = ".lock"  # at the top of a corpus that is being written
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Matrix4 = Annotated[list[Annotated[list[float], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CameraRecord(_Model):
    """The camera of one frame, without jitter, now and one frame earlier."""

    fov_y_rad: float = Field(description="vertical field of view, radians")
    near: float = Field(description="scene units")
    far: float = Field(description="scene units")
    view_from_world: Matrix4 = Field(description="camera x right, y up, looking along -z")
    clip_from_view: Matrix4 = Field(description="perspective, clip z in [-1, 1]")
    previous_view_from_world: Matrix4 = Field(description="of the previous frame; the present one's on a reset")
    previous_clip_from_view: Matrix4 = Field(description="of the previous frame; the present one's on a reset")


class StreamRecord(_Model):
    """One stream of one frame."""

    size: tuple[int, int] = Field(description="width and height, pixels")
    scale: tuple[float, float] = Field(description="display pixels per pixel, per axis, exactly")
    jitter: tuple[float, float] = Field(description="J in pixels of this stream, y down: pixels sample centre - J")
    mip_bias: float = Field(description="levels added to what the stream's own pixel asks for; in hr, averaged channels only")
    saturated: int = Field(description="values cut to the largest half float")
    fireflies: int = Field(0, description="pixels that owe more than half of their light to one of at least 8 light paths")
    rejected_paths: int = Field(0, description="light paths that were not finite and count as black")
    part: Sha256 | None = Field(None, description="sha256 of this stream's own: size, samples, bias, jitter, seed")


class FileRecord(_Model):
    """One file of one frame."""

    path: str = Field(description="relative to the sequence's folder, with forward slashes")
    sha256: Sha256
    size: int = Field(description="bytes")


class FrameRecord(_Model):
    """`<sequence>/frames/<frame>.json`."""

    frame: int
    time_s: float = Field(description="seconds since the path began")
    frame_time_ms: float = Field(description="milliseconds between frames")
    reset: bool = Field(description="first frame of the path or of a shot: no history")
    exposure_ev: float = Field(description="display = colour * 2^exposure_ev")
    camera: CameraRecord
    streams: dict[str, StreamRecord]
    files: list[FileRecord]
    parts: dict[str, Sha256] = Field({}, description="sha256 by part of what decides the pixels")
    inputs: Sha256 | None = Field(None, description="sha256 of the files, plan and versions behind the parts")
    key: Sha256 = Field(description="sha256 of `parts`: of everything that decides this frame's pixels")


class FrameEntry(_Model):
    """One frame in sequence.json."""

    frame: int
    time_s: float
    reset: bool
    key: Sha256


class SequenceIndex(_Model):
    """`<sequence>/sequence.json`."""

    sequence: str
    frames: list[FrameEntry] = Field(description="in order; those that are whole")
    streams: list[str] = Field(description="streams that every frame has")
    bytes: int = Field(description="of all files of all frames")


class Constant(_Model):
    """The value of a channel that is not in files: exactly one of the three."""

    surface: list[float] | None = Field(None, description="its value on surfaces; the background has the channel's own")
    everywhere: list[float] | None = Field(None, description="its value at each pixel; 0 on a reset")
    same_as: str | None = Field(None, description="the channel that it equals")


class SequenceRecord(_Model):
    """One sequence in corpus.json."""

    scene: str = Field(description="bundled name or file, as given")
    scene_sha256: Sha256 = Field(description="over all files of the scene")
    environment: str | None = Field(description="file that lights the scene, 'default', or null for the scene's own")
    camera_path: CameraPath = Field(description="as sampled")
    camera_path_name: str = Field(description="bundled name or file, as given, or 'orbit'")
    frames: int = Field(description="frames of the whole path")
    up_axis: Literal["X", "Y", "Z"]
    metres_per_unit: float
    objects: list[str] = Field(description="names; object_id is 1 + index")
    moving: list[int] = Field(description="object_id of every object that is animated")
    deforming: list[int] = Field([], description="object_id of every object whose vertices move")
    not_demodulated: list[int] = Field(
        [], description="object_id of every object whose F_beta is 1, because Mitsuba's own BSDF draws it (path)"
    )
    animation_clip: str | None = Field(None, description="the clip that was asked for, of files that hold several")
    overlay: str | None = Field(None, description="what is drawn over colour: a file as given, or 'scene': the one beside it")
    overlay_sha256: Sha256 | None = Field(None, description="over the overlay's files")
    variation: int | None = Field(None, description="seed of the content's variation; null for the scene as it is")
    channels: list[str] = Field(description="channels that are files")
    constants: dict[str, Constant] = Field(description="channels that are not")
    equal_streams: dict[str, str] = Field({}, description="streams that are no files, and the stream that each equals")
    split: Literal["train", "val", "test"] = Field("train", description="of a sampled camera path; train for others")


class TableRecord(_Model):
    """The A, B table of the BRDF model that shades."""

    model: str
    path: str
    sha256: Sha256
    axes: str


class CorpusManifest(_Model):
    """`corpus.json`."""

    format: Literal["framepairs"] = "framepairs"
    version: Literal[1] = 1
    plan: RenderPlan
    backend: str = Field(description="variant of Mitsuba that rendered")
    versions: dict[str, str] = Field(description="of the packages that decide pixels and files")
    conventions: dict[str, str]
    channels: list[dict[str, Any]] = Field(description="the channel table")
    streams: list[dict[str, Any]] = Field(description="the plan's streams, resolved")
    brdf_table: TableRecord | None = Field(None, description="null where no surface has a specular lobe: A and B are 0")
    sequences: dict[str, SequenceRecord]


def to_json(model: BaseModel) -> bytes:
    """Sorted keys and one indentation: equal models give equal bytes."""
    values = model.model_dump(mode="json")
    return (json.dumps(values, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n").encode()


def from_json(kind: type[BaseModel], file: Path):
    """Read one of the models above. Raises InputError naming the file and the field."""
    try:
        return kind.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise InputError(first["msg"], file=file, field=field) from None


def frame_key(values: dict[str, Any]) -> str:
    """sha256 of the canonical JSON (RFC 8785) of everything that decides a frame's pixels."""
    return hashlib.sha256(rfc8785.dumps(values)).hexdigest()


def write_atomically(file: Path, data: bytes, sync: bool = True) -> None:
    """The file appears whole or not at all. sync: and outlives a loss of power. Raises MachineError naming the file."""
    temporary = file.with_name(f".{file.name}.{secrets.token_hex(4)}.part")  # others may write the same file
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MachineError(f"{file}: cannot be written: {error.strerror}") from None
    try:
        with open(temporary, "wb") as stream:
            stream.write(data)
            stream.flush()
            if sync:
                os.fsync(stream.fileno())
        os.replace(temporary, file)
        if sync:
            _sync(file.parent)
    except OSError as error:
        raise MachineError(f"{file}: cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)  # after a failure or an interrupt; else it has become the file


def sync_files(files: Iterable[Path]) -> None:
    """Files that were written without `sync` are on the disk, under their names. Together they cost little more than one: file
    systems commit what is waiting at once. Raises MachineError naming the file."""
    files = list(files)
    for file in (*files, *sorted({file.parent for file in files})):
        try:
            _sync(file)
        except OSError as error:
            raise MachineError(f"{file}: cannot be written: {error.strerror}") from None


def _sync(file: Path) -> None:
    descriptor = os.open(file, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folder(folder: Path) -> None:
    """A folder that can be written into. Raises InputError: an output folder is chosen by the user."""
    probe = folder / f".probe.{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"cannot be written into: {error.strerror}", file=folder) from None


def rebuild_sequence_index(folder: Path) -> SequenceIndex:
    """Write sequence.json anew from the frame records of a sequence's folder."""
    entries, streams, size = [], None, 0
    for file in (folder / "frames").glob("*.json"):
        try:
            record = from_json(FrameRecord, file)
        except InputError:
            continue  # a damaged record is a frame that is not whole; rendering it writes it anew
        entries.append(FrameEntry(frame=record.frame, time_s=record.time_s, reset=record.reset, key=record.key))
        streams = {*record.streams} if streams is None else streams & {*record.streams}
        size += sum(item.size for item in record.files)
    entries.sort(key=lambda entry: entry.frame)
    index = SequenceIndex(sequence=folder.name, frames=entries, streams=sorted(streams or ()), bytes=size)
    write_atomically(folder / "sequence.json", to_json(index))
    return index
