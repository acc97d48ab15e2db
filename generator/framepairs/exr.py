"""OpenEXR files: one single-part, tiled file per channel, encoded in memory, never decoded before its hash was checked.

The traps of the Python binding (3.5.3) that this file guards against: non-contiguous arrays are written wrong without a
word, truncated files decode to a warning, flipped bits to wrong pixels, and the caller's dictionaries are changed.
"""

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from .channels import Channel
from .errors import InputError

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
DTYPE = {"half": np.float16, "float": np.float32, "uint": np.uint32}
LARGEST_HALF = 65504.0
TILE = 256

OpenEXR.set_global_thread_count(0)  # the pipeline encodes several files at once


@dataclass(frozen=True)
class Encoded:
    """A file's bytes, their sha256, and how many values were cut to the largest half."""

    data: bytes
    sha256: str
    saturated: int


def encode(channel: Channel, array: NDArray, *, attributes: dict[str, str], dtype: str | None = None) -> Encoded:
    """The EXR file of one channel. array: [height, width, components]. dtype overrides the channel's ('float' colours)."""
    assert array.ndim == 3 and array.shape[2] == channel.components, (channel.name, array.shape)
    stored = dtype or channel.dtype
    saturated = 0
    if stored == "half":
        over = np.abs(array) > LARGEST_HALF
        saturated = int(over.sum())
        if saturated:
            array = np.clip(array, -LARGEST_HALF, LARGEST_HALF)
    planes = {
        name: np.ascontiguousarray(array[..., index], dtype=DTYPE[stored]) for index, name in enumerate(channel.exr)
    }
    assert all(plane.flags.c_contiguous for plane in planes.values())
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.tiledimage,
        "tiles": _tiles(),
        "framepairs:channel": channel.name,
        "framepairs:meaning": channel.meaning,
        "framepairs:unit": channel.unit,
        "framepairs:frame_of_reference": channel.frame_of_reference,
        "framepairs:sampling": "see plan" if channel.averaged else "one sample per pixel",
        **attributes,
    }
    if channel.exr == ("R", "G", "B"):
        header["chromaticities"] = REC_709
    stream = io.BytesIO()
    OpenEXR.File(header, planes).write(stream)
    data = stream.getvalue()
    return Encoded(data, hashlib.sha256(data).hexdigest(), saturated)


def decode(data: bytes, names: tuple[str, ...], file: Path) -> tuple[NDArray, dict]:
    """([height, width, components] as stored, contiguous; header). `names` are the EXR channels, in order.

    Raises InputError naming `file`. Only bytes whose hash was checked should come here.
    """
    try:
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as opened:
            channels = opened.channels()
            missing = [name for name in names if name not in channels]
            if missing:
                raise InputError(f"EXR channel {missing[0]} is missing (it has {', '.join(channels)})", file=file)
            planes = [channels[name].pixels for name in names]
            return np.stack(planes, axis=-1), dict(opened.header())
    except (RuntimeError, ValueError) as error:
        raise InputError(f"not a readable OpenEXR file: {error}", file=file) from None


def read_checked(file: Path, sha256: str | None, names: tuple[str, ...]) -> NDArray:
    """Read and decode a file whose sha256 must match. Raises InputError naming it."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    if sha256 is not None and hashlib.sha256(data).hexdigest() != sha256:
        raise InputError("its bytes are not those that were recorded (sha256 differs)", file=file)
    return decode(data, names, file)[0]


def _tiles() -> OpenEXR.TileDescription:
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = TILE
    tiles.mode, tiles.roundingMode = OpenEXR.ONE_LEVEL, OpenEXR.ROUND_DOWN
    return tiles
