"""glTF 2.0's JSON and bytes, from .gltf and .glb files and the files that they name.

Behind `read_document` a value is of the type and length that the specification gives it; whether an index points at
something is asked by `entry`. Source: Khronos, glTF 2.0 specification, chapters 3 to 5.
"""

import base64
import binascii
import json
import struct
import urllib.parse
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError
from .containment import Reach, within
from .gltf_schema import check_json

GLB_MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
COMPRESSED_VIEWS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
# What may be built of a file: a damaged one must not ask for memory that its own size does not tell.
SPARE_BYTES, BYTES_PER_BYTE = 2**28, 32


@dataclass(frozen=True)
class Document:
    """file: the .gltf or .glb. reach: which files it may name. json: its JSON, of checked types. binary: the binary chunk of
    a .glb. arrays: what `gltf_accessors` has read, by accessor and purpose. spent: bytes that were built, see `spend`."""

    file: Path
    reach: Reach
    json: dict[str, Any]
    binary: bytes | None
    arrays: dict[tuple, Any] = field(default_factory=dict)
    spent: list[int] = field(default_factory=lambda: [0])

    def all(self, kind: str) -> list[dict[str, Any]]:
        """The top-level list `kind`, empty where the file has none."""
        return self.json.get(kind, [])

    def entry(self, kind: str, index: int) -> dict[str, Any]:
        """Entry `index` of the top-level list `kind`. Raises InputError where it has fewer."""
        entries = self.all(kind)
        if index >= len(entries):
            raise InputError(f"names {index} of {kind}, there are {len(entries)}", file=self.file, field=kind)
        return entries[index]

    @cached_property
    def buffers(self) -> tuple[bytes, ...]:
        """The bytes of all buffers. Raises InputError for a file that is not there or shorter than said."""
        named = {item["uri"] for item in self.all("buffers") if "uri" in item}
        found = {uri: read_uri(self, uri, "buffers") for uri in sorted(named)}
        return tuple(self._buffer(index, item, found) for index, item in enumerate(self.all("buffers")))

    @cached_property
    def most_bytes(self) -> int:
        """What may be built of buffers of this size."""
        return SPARE_BYTES + BYTES_PER_BYTE * sum({id(data): len(data) for data in self.buffers}.values())

    def _buffer(self, index: int, item: dict[str, Any], found: dict[str, bytes]) -> bytes:
        if "uri" in item:
            data = found[item["uri"]]
        elif index == 0 and self.binary is not None:
            data = self.binary
        else:
            data = b""  # allowed where no accessor reads it; one that does finds it too short
        if "uri" in item and len(data) < item["byteLength"]:
            problem = f"buffer {index} has {len(data)} bytes of {item['byteLength']}"
            raise InputError(problem, file=self.file, field="buffers")
        return data

    def view(self, index: int) -> memoryview:
        """The bytes of buffer view `index`. Raises InputError where its buffer ends before, naming the extension where an
        extension holds the bytes."""
        view = self.entry("bufferViews", index)
        self.entry("buffers", view["buffer"])
        start, data = view.get("byteOffset", 0), self.buffers[view["buffer"]]
        if start + view["byteLength"] > len(data):
            packed = [name for name in COMPRESSED_VIEWS if name in view.get("extensions", {})]
            ends = f"buffer view {index} ends at byte {start + view['byteLength']} of {len(data)}"
            problem = f"extension {packed[0]} is not read, and buffer view {index} has no other data" if packed else ends
            raise InputError(problem, file=self.file, field="bufferViews")
        return memoryview(data)[start : start + view["byteLength"]]

    def spend(self, size: int, where: str) -> None:
        """Counts `size` bytes that are about to be built. Raises InputError where a file of these buffers cannot mean them."""
        self.spent[0] += size
        if self.spent[0] > self.most_bytes:
            problem = f"needs {self.spent[0]} bytes of memory, more than the {self.most_bytes} that its buffers can mean"
            raise InputError(problem, file=self.file, field=where)


def read_document(file: Path, reach: Reach) -> Document:
    """The checked JSON of a file. Raises InputError naming the file, the key, what was expected and what stands there."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    text, binary = _chunks(data, file) if file.suffix.lower() == ".glb" else (data, None)
    try:
        values = json.loads(text)
        check_json(values)
    except InputError as error:
        raise InputError(error.problem, file=file, field=error.field) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not glTF: {type(error).__name__}: {error}", file=file) from None
    if not values["asset"]["version"].startswith("2."):
        raise InputError(f"glTF {values['asset']['version']}: only 2 is read", file=file, field="asset.version")
    return Document(file, reach, values, binary)


def is_elsewhere(uri: str) -> bool:
    """Whether the URI names a file beside this one, and not data."""
    return not uri.startswith("data:")


def path_of(document: Document, uri: str, where: str) -> Path:
    """The file that a URI of the document's list `where` names. Raises InputError for one out of reach, on a network, or that
    is not there."""
    if "://" in uri or uri.lower().startswith("file:"):
        problem = f"{uri[:200]}: only data: and files beside it are read"
        raise InputError(problem, file=document.file, field=where)
    found = within(document.reach, urllib.parse.unquote(uri), file=document.file, field=where)
    if not found.exists():
        what = "texture" if where == "images" else "buffer"
        raise InputError(f"missing {what} {uri[:200]}", file=document.file, field=where)
    return found


def read_uri(document: Document, uri: str, where: str) -> bytes:
    """The bytes of a data URI or of a file beside the document's. Raises InputError naming both."""
    if is_elsewhere(uri):
        try:
            return path_of(document, uri, where).read_bytes()
        except (OSError, MemoryError) as error:
            problem = getattr(error, "strerror", None) or "it does not fit into memory"
            raise InputError(f"{uri[:200]}: {problem}", file=document.file, field=where) from None
    head, comma, body = uri.partition(",")
    try:
        if not comma or not head.endswith(";base64"):
            raise ValueError
        return base64.b64decode(urllib.parse.unquote(body))
    except (ValueError, binascii.Error):
        raise InputError(f"data URI {uri[:40]!r} is not base64", file=document.file, field=where) from None


def _chunks(data: bytes, file: Path) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a .glb (specification, chapter 4)."""
    if len(data) < 20 or struct.unpack_from("<II", data) != (GLB_MAGIC, 2):
        raise InputError("not glTF: no header of a version 2 GLB", file=file)
    if struct.unpack_from("<I", data, 8)[0] > len(data):
        raise InputError(f"not glTF: cut short, {len(data)} bytes of {struct.unpack_from('<I', data, 8)[0]}", file=file)
    found, place = {}, 12
    while place + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, place)
        if place + 8 + length > len(data):
            raise InputError("not glTF: a chunk is cut short", file=file)
        found.setdefault(kind, data[place + 8 : place + 8 + length])
        place += 8 + length
    if JSON_CHUNK not in found:
        raise InputError("not glTF: no JSON chunk", file=file)
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)
