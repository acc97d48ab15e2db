"""Mitsuba's `serialized` meshes: zlib streams of little-endian arrays.

Format 3 and 4 as Mitsuba's manual has it (plugin `serialized`): 0x041C and the version as uint16, then a zlib stream of flags
(uint32), from version 4 on a name (ended by 0), the numbers of vertices and triangles (uint64), positions, normals, texture
coordinates and colours as flagged, and indices (uint32). The file ends with the offsets of its meshes (uint64; uint32 in
version 3) and their number (uint32). What does not fit the file's length is refused before it is unpacked.
"""

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Mesh, validate_mesh

MAGIC = 0x041C
HAS_NORMALS, HAS_UV, HAS_COLORS, FACE_NORMALS, SINGLE, DOUBLE = 0x1, 0x2, 0x8, 0x10, 0x1000, 0x2000
# What a stream may unpack to: deflate packs 1032 equal bytes into one, meshes pack to a third or so.
SPARE_BYTES, BYTES_PER_BYTE = 2**26, 16
LONGEST_NAME = 4096


def read_serialized(file: Path, index: int) -> tuple[Mesh, bool]:
    """Mesh `index` of a file, and whether it asks for the normals of its faces. Its normals are None where the file has none,
    its uv as stored, colours left out. Raises InputError naming the file."""
    try:
        data = file.read_bytes()
        mesh, has_face_normals = _mesh(_stream(data, index), file.stem)
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except (struct.error, ValueError, zlib.error) as error:
        raise InputError(f"cannot be read as serialized mesh {index}: {error}", file=file) from None
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, file=file)
    return mesh, has_face_normals


class _Stream:
    """Bytes of a zlib stream, unpacked as they are asked for."""

    def __init__(self, packed: bytes) -> None:
        self._unpacker = zlib.decompressobj()
        self._packed = packed
        self._most = SPARE_BYTES + BYTES_PER_BYTE * len(packed)

    def take(self, count: int) -> bytes:
        if count > self._most:
            raise ValueError("it is cut short: more is announced than it can hold")
        parts, missing = [], count
        while missing:
            part = self._unpacker.decompress(self._packed, missing)
            self._packed = self._unpacker.unconsumed_tail
            if not part:
                raise ValueError("it is cut short")
            parts.append(part)
            missing -= len(part)
        self._most -= count
        return b"".join(parts)

    def array(self, kind: str, rows: int, columns: int) -> NDArray:
        """[rows, columns]"""
        dtype = np.dtype(kind)
        return np.frombuffer(self.take(rows * columns * dtype.itemsize), dtype).reshape(rows, columns)


def _stream(data: bytes, index: int) -> "tuple[_Stream, int]":
    """The stream of a mesh and the version of its format."""
    magic, version = struct.unpack_from("<HH", data, 0)
    if magic != MAGIC or version not in (3, 4):
        raise ValueError("its header is not of format 3 or 4")
    (count,) = struct.unpack_from("<I", data, len(data) - 4)
    width = 8 if version == 4 else 4
    table = len(data) - 4 - width * count
    if not 0 <= index < count or table < 4:
        raise ValueError(f"it has {count} meshes")
    offsets = struct.unpack_from(f"<{count}{'Q' if version == 4 else 'I'}", data, table)
    begin = offsets[index]
    if begin > table:
        raise ValueError("its table of meshes is damaged")
    end = min([offset for offset in offsets if offset > begin], default=table)
    magic, version = struct.unpack_from("<HH", data, begin)
    if magic != MAGIC or version not in (3, 4) or end > table:
        raise ValueError("its table of meshes is damaged")
    return _Stream(data[begin + 4 : end]), version


def _mesh(opened: tuple[_Stream, int], name: str) -> tuple[Mesh, bool]:
    stream, version = opened
    (flags,) = struct.unpack("<I", stream.take(4))
    if bool(flags & SINGLE) == bool(flags & DOUBLE):
        raise ValueError("it is neither of single nor of double precision")
    if version == 4:
        letters = bytearray()
        while (letter := stream.take(1)) != b"\0":
            letters += letter
            if len(letters) > LONGEST_NAME:
                raise ValueError("its name does not end")
        name = letters.decode(errors="replace") or name
    vertices, triangles = struct.unpack("<QQ", stream.take(16))
    kind = "<f8" if flags & DOUBLE else "<f4"
    positions = stream.array(kind, vertices, 3)
    normals = stream.array(kind, vertices, 3) if flags & HAS_NORMALS else None
    uv = stream.array(kind, vertices, 2) if flags & HAS_UV else None
    if flags & HAS_COLORS:
        stream.array(kind, vertices, 3)
    faces = stream.array("<u4", triangles, 3)
    with np.errstate(over="ignore"):  # doubles beyond single precision become infinite, which is refused
        single = [None if a is None else np.ascontiguousarray(a, np.float32) for a in (positions, normals, uv)]
    mesh = Mesh(
        name=name,
        positions=single[0],
        faces=np.ascontiguousarray(faces, np.uint32),
        normals=single[1],
        uv=single[2],
    )
    return mesh, bool(flags & FACE_NORMALS)
