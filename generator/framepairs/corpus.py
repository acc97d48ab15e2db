"""Reading a corpus: NumPy arrays out of files and constants. Needs neither Mitsuba, Dr.Jit nor a GPU."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .channels import CHANNEL, channel_named
from .conventions import frame_name
from .errors import InputError
from .exr import read_checked
from .manifest import CorpusManifest, FrameRecord, SequenceRecord, from_json


class Corpus:
    """A corpus on disk. Arrays are [height, width, components]: float32, or uint32 for object_id and visibility.

    `check` compares each file's sha256 before decoding it; without, a damaged file may decode to wrong pixels.
    """

    def __init__(self, folder: Path | str, *, check: bool = True):
        self.folder, self.check = Path(folder), check
        if not (self.folder / "corpus.json").is_file():
            raise InputError("no corpus.json in it: not a corpus", file=self.folder)
        self.manifest: CorpusManifest = from_json(CorpusManifest, self.folder / "corpus.json")
        self._record = lru_cache(maxsize=4096)(self._read_record)

    @property
    def sequences(self) -> list[str]:
        return sorted(self.manifest.sequences)

    def sequence(self, name: str) -> SequenceRecord:
        if name not in self.manifest.sequences:
            raise InputError(f"no sequence {name!r}; there are {', '.join(self.sequences)}", file=self.folder)
        return self.manifest.sequences[name]

    def frames(self, sequence: str) -> list[int]:
        """Numbers of the frames that are whole, in order."""
        folder = self.folder / sequence / "frames"
        return sorted(int(file.stem) for file in folder.glob("*.json") if file.stem.isdigit())

    def streams(self, sequence: str) -> list[str]:
        """Streams of the sequence, in the plan's order, also those that equal another one."""
        names = [row["name"] for row in self.manifest.streams]
        frames = self.frames(sequence)
        return [name for name in names if frames and name in self.record(sequence, frames[0]).streams]

    def record(self, sequence: str, frame: int) -> FrameRecord:
        """Camera, jitter, time and files of one frame."""
        return self._record(sequence, frame)

    def read(self, sequence: str, stream: str, channel: str, frame: int) -> NDArray:
        """One channel of one stream of one frame, from its file or from its constant.

        Raises InputError that names the file, or the channel that the corpus does not hold.
        """
        if channel_named(channel) is None:
            raise InputError(f"unknown channel {channel!r}; known are {', '.join(CHANNEL)}")
        entry = self.sequence(sequence)
        if channel in entry.channels:
            return self._read_file(sequence, stream, channel, frame)
        if channel in entry.constants:
            return self._constant(sequence, stream, channel, frame)
        raise InputError(f"channel {channel!r} was not rendered", file=self.folder, frame=frame, field=stream)

    def file_of(self, sequence: str, stream: str, channel: str, frame: int) -> tuple[Path, str]:
        """Path and recorded sha256 of a channel's file."""
        source = self.sequence(sequence).equal_streams.get(stream, stream)
        relative = f"{source}/{channel}/{frame_name(frame)}.exr"
        hashes = {item.path: item.sha256 for item in self.record(sequence, frame).files}
        if relative not in hashes:
            raise InputError(f"no stream {stream!r} in this frame", file=self.folder, frame=frame, field=channel)
        return self.folder / sequence / relative, hashes[relative]

    def brdf_table(self) -> NDArray[np.float32]:
        """A and B [size, size, 2]: rows are roughness, columns the root of cos(n, v), both from 0 to 1; zeros where no surface
        has a specular lobe. Raises InputError naming the file."""
        record = self.manifest.brdf_table
        if record is None:
            return np.zeros((self.manifest.plan.brdf_table,) * 2 + (2,), np.float32)
        return read_checked(self.folder / record.path, record.sha256 if self.check else None, ("A", "B"))

    def _read_record(self, sequence: str, frame: int) -> FrameRecord:
        """The record on disk, and in it the streams that are no files because they equal others."""
        record = from_json(FrameRecord, self.folder / sequence / "frames" / f"{frame_name(frame)}.json")
        biases = {row["name"]: row["mip_bias"] for row in self.manifest.streams}
        for name, other in self.sequence(sequence).equal_streams.items():
            if other in record.streams and name in biases:
                record.streams[name] = record.streams[other].model_copy(update={"mip_bias": biases[name]})
        return record

    def _read_file(self, sequence: str, stream: str, channel: str, frame: int) -> NDArray:
        file, sha256 = self.file_of(sequence, stream, channel, frame)
        array = read_checked(file, sha256 if self.check else None, channel_named(channel).exr)
        width, height = self.record(sequence, frame).streams[stream].size
        if array.shape[:2] != (height, width):
            raise InputError(f"is {array.shape[1]}x{array.shape[0]}, not {width}x{height}", file=file, frame=frame)
        return array.astype(np.uint32 if channel_named(channel).dtype == "uint" else np.float32, copy=False)

    def _constant(self, sequence: str, stream: str, channel: str, frame: int) -> NDArray:
        constant, row = self.sequence(sequence).constants[channel], channel_named(channel)
        if constant.same_as:
            return self.read(sequence, stream, constant.same_as, frame)
        record = self.record(sequence, frame)
        if stream not in record.streams:
            raise InputError(f"no stream {stream!r} in this frame", file=self.folder, frame=frame, field=channel)
        width, height = record.streams[stream].size
        dtype = np.uint32 if row.dtype == "uint" else np.float32
        stored = np.float16 if row.dtype == "half" else dtype
        if constant.everywhere is not None:
            value = np.zeros(row.components) if record.reset else np.array(constant.everywhere)
            return np.broadcast_to(value.astype(dtype), (height, width, row.components)).copy()
        value = np.array(constant.surface).astype(stored).astype(dtype)
        background = np.array(row.background if row.background is not None else (0.0,) * row.components, dtype=dtype)
        if np.array_equal(value, background):
            return np.broadcast_to(value, (height, width, row.components)).copy()
        covered = self.read(sequence, stream, "object_id", frame) > 0
        return np.where(covered, value, background)
