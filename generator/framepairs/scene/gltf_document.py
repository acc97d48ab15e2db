"""glTF 2.0's JSON, from .gltf and .glb files, with the type of everything that is read checked once.

Behind `read_document` a value is of the type and length that the specification gives it; whether an index points at
something is asked by `entry`. Source: Khronos, glTF 2.0 specification, chapters 3 to 5.
"""

import base64
import binascii
import json
import math
import struct
import urllib.parse
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError

INDEX, NUMBER, TEXT, BOOLEAN, OBJECT = "a whole number from 0", "a number", "a text", "true or false", "an object"
GLB_MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942

# One entry per key: a kind, (kind, length) for numbers in a row, [item] for lists, {...} for objects. "!" marks what must be
# there, "*" every key that is not named.
_TRANSFORM = {"offset": (NUMBER, 2), "rotation": NUMBER, "scale": (NUMBER, 2), "texCoord": INDEX}
_INFO = {"index!": INDEX, "texCoord": INDEX, "extensions": {"KHR_texture_transform": _TRANSFORM, "*": OBJECT}}
_PBR = {
    "baseColorFactor": (NUMBER, 4),
    "metallicFactor": NUMBER,
    "roughnessFactor": NUMBER,
    "baseColorTexture": _INFO,
    "metallicRoughnessTexture": _INFO,
}
_MATERIAL_EXTENSIONS = {
    "KHR_materials_emissive_strength": {"emissiveStrength": NUMBER},
    "KHR_materials_ior": {"ior": NUMBER},
    "KHR_materials_specular": {"specularFactor": NUMBER, "specularColorFactor": (NUMBER, 3)},
    "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": (NUMBER, 4),
        "glossinessFactor": NUMBER,
        "diffuseTexture": _INFO,
    },
    "KHR_materials_clearcoat": {"clearcoatFactor": NUMBER},
    "KHR_materials_sheen": {"sheenColorFactor": (NUMBER, 3)},
    "KHR_materials_transmission": {"transmissionFactor": NUMBER},
    "KHR_materials_volume": {"thicknessFactor": NUMBER},
    "KHR_materials_iridescence": {"iridescenceFactor": NUMBER},
    "KHR_materials_anisotropy": {"anisotropyStrength": NUMBER},
    "KHR_materials_dispersion": {"dispersion": NUMBER},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": NUMBER},
    "*": OBJECT,
}
_MATERIAL = {
    "name": TEXT,
    "pbrMetallicRoughness": _PBR,
    "normalTexture": {**_INFO, "scale": NUMBER},
    "occlusionTexture": {**_INFO, "strength": NUMBER},
    "emissiveTexture": _INFO,
    "emissiveFactor": (NUMBER, 3),
    "alphaMode": TEXT,
    "alphaCutoff": NUMBER,
    "extensions": _MATERIAL_EXTENSIONS,
}
_PART = {"bufferView!": INDEX, "byteOffset": INDEX}
_ACCESSOR = {
    "bufferView": INDEX,
    "byteOffset": INDEX,
    "componentType!": INDEX,
    "count!": INDEX,
    "type!": TEXT,
    "normalized": BOOLEAN,
    "sparse": {"count!": INDEX, "indices!": {**_PART, "componentType!": INDEX}, "values!": _PART},
}
_NODE = {
    "name": TEXT,
    "children": [INDEX],
    "mesh": INDEX,
    "skin": INDEX,
    "matrix": (NUMBER, 16),
    "translation": (NUMBER, 3),
    "rotation": (NUMBER, 4),
    "scale": (NUMBER, 3),
    "weights": [NUMBER],
}
_PRIMITIVE = {"attributes!": {"*": INDEX}, "indices": INDEX, "material": INDEX, "mode": INDEX, "targets": [{"*": INDEX}]}
_CHANNEL = {"sampler!": INDEX, "target!": {"node": INDEX, "path!": TEXT}}
SCHEMA = {
    "asset!": {"version!": TEXT},
    "extensionsUsed": [TEXT],
    "extensionsRequired": [TEXT],
    "scene": INDEX,
    "scenes": [{"name": TEXT, "nodes": [INDEX]}],
    "nodes": [_NODE],
    "meshes": [{"name": TEXT, "primitives!": [_PRIMITIVE], "weights": [NUMBER]}],
    "skins": [{"name": TEXT, "joints!": [INDEX], "inverseBindMatrices": INDEX, "skeleton": INDEX}],
    "animations": [
        {
            "name": TEXT,
            "channels!": [_CHANNEL],
            "samplers!": [{"input!": INDEX, "output!": INDEX, "interpolation": TEXT}],
        }
    ],
    "accessors": [_ACCESSOR],
    "bufferViews": [{"buffer!": INDEX, "byteOffset": INDEX, "byteLength!": INDEX, "byteStride": INDEX}],
    "buffers": [{"uri": TEXT, "byteLength!": INDEX}],
    "materials": [_MATERIAL],
    "textures": [{"source": INDEX, "sampler": INDEX, "extensions": {"EXT_texture_webp": {"source!": INDEX}, "*": OBJECT}}],
    "images": [{"uri": TEXT, "bufferView": INDEX}],
    "samplers": [{"wrapS": INDEX, "wrapT": INDEX}],
}


@dataclass(frozen=True)
class Document:
    """file: the .gltf or .glb. json: its JSON, of checked types. binary: the binary chunk of a .glb."""

    file: Path
    json: dict[str, Any]
    binary: bytes | None

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
        return tuple(self._buffer(index, item) for index, item in enumerate(self.all("buffers")))

    def _buffer(self, index: int, item: dict[str, Any]) -> bytes:
        if "uri" in item:
            data = read_uri(item["uri"], self.file, "buffers")
        elif index == 0 and self.binary is not None:
            data = self.binary
        else:
            data = b""  # allowed where no accessor reads it; one that does finds it too short
        if "uri" in item and len(data) < item["byteLength"]:
            problem = f"buffer {index} has {len(data)} bytes of {item['byteLength']}"
            raise InputError(problem, file=self.file, field="buffers")
        return data

    def view(self, index: int) -> memoryview:
        """The bytes of buffer view `index`. Raises InputError where its buffer ends before."""
        view = self.entry("bufferViews", index)
        self.entry("buffers", view["buffer"])
        start, data = view.get("byteOffset", 0), self.buffers[view["buffer"]]
        if start + view["byteLength"] > len(data):
            problem = f"buffer view {index} ends at byte {start + view['byteLength']} of {len(data)}"
            raise InputError(problem, file=self.file, field="bufferViews")
        return memoryview(data)[start : start + view["byteLength"]]


def read_document(file: Path) -> Document:
    """The checked JSON of a file. Raises InputError naming the file, the key, what was expected and what stands there."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    text, binary = _chunks(data, file) if file.suffix.lower() == ".glb" else (data, None)
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not glTF: {type(error).__name__}: {error}", file=file) from None
    try:
        _check(values, SCHEMA, "")
    except InputError as error:
        raise InputError(error.problem, file=file, field=error.field) from None
    if not values["asset"]["version"].startswith("2."):
        raise InputError(f"glTF {values['asset']['version']}: only 2 is read", file=file, field="asset.version")
    return Document(file, values, binary)


def is_elsewhere(uri: str) -> bool:
    """Whether the URI names a file beside this one, and not data."""
    return not uri.startswith("data:")


def path_of(uri: str, file: Path) -> Path:
    return file.parent / urllib.parse.unquote(uri)


def read_uri(uri: str, file: Path, field: str) -> bytes:
    """The bytes of a data URI or of a file beside `file`. Raises InputError naming both."""
    if is_elsewhere(uri):
        try:
            return path_of(uri, file).read_bytes()
        except (OSError, ValueError):
            what = "texture" if field == "images" else "buffer"
            raise InputError(f"missing {what} {uri[:200]}", file=file, field=field) from None
    head, comma, body = uri.partition(",")
    try:
        if not comma or not head.endswith(";base64"):
            raise ValueError
        return base64.b64decode(urllib.parse.unquote(body))
    except (ValueError, binascii.Error):
        raise InputError(f"data URI {uri[:40]!r} is not base64", file=file, field=field) from None


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


def _check(value: Any, kind: Any, where: str) -> None:
    """Raises InputError where `value` is not of the kind; `where` is its place in the JSON."""
    if isinstance(kind, dict):
        _expect(isinstance(value, dict), "an object", value, where)
        for key, inner in kind.items():
            name = key.rstrip("!")
            _expect(name in value or not key.endswith("!"), f"{name} in it", value, where)
            if name in value:
                _check(value[name], inner, f"{where}.{name}".lstrip("."))
        if "*" in kind:
            for name in value.keys() - {key.rstrip("!") for key in kind}:
                _check(value[name], kind["*"], f"{where}.{name}")
    elif isinstance(kind, list | tuple):
        _expect(isinstance(value, list), "a list", value, where)
        _expect(isinstance(kind, list) or len(value) == kind[1], f"{kind[-1]} numbers", value, where)
        for index, item in enumerate(value):
            _check(item, kind[0], f"{where}[{index}]")
    else:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        fits = {
            INDEX: number and isinstance(value, int) and 0 <= value < 2**53,
            NUMBER: number and abs(value) < 1e300 and math.isfinite(value),
            TEXT: isinstance(value, str),
            BOOLEAN: isinstance(value, bool),
            OBJECT: isinstance(value, dict),
        }
        _expect(fits[kind], kind, value, where)


def _expect(holds: bool, what: str, value: Any, where: str) -> None:
    if not holds:
        raise InputError(f"{what} was expected, {json.dumps(value)[:60]} came", field=where or None)
