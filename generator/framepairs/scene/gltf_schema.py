"""The type of everything that is read of glTF's JSON, checked once (Khronos, glTF 2.0 specification, chapter 5)."""

import json
from typing import Any, NamedTuple

from ..errors import InputError

INDEX, NUMBER, TEXT, BOOLEAN, OBJECT = "a whole number from 0", "a number", "a text", "true or false", "an object"

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
    "doubleSided": BOOLEAN,
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
    "camera": INDEX,
    "matrix": (NUMBER, 16),
    "translation": (NUMBER, 3),
    "rotation": (NUMBER, 4),
    "scale": (NUMBER, 3),
    "weights": [NUMBER],
    "extensions": {
        "KHR_lights_punctual": {"light!": INDEX},
        "EXT_mesh_gpu_instancing": {"attributes!": {"*": INDEX}},
        "*": OBJECT,
    },
}
_PRIMITIVE = {
    "attributes!": {"*": INDEX},
    "indices": INDEX,
    "material": INDEX,
    "mode": INDEX,
    "targets": [{"*": INDEX}],
    "extensions": {"*": OBJECT},
}
_CHANNEL = {"sampler!": INDEX, "target!": {"node": INDEX, "path!": TEXT}}
_LIGHT = {
    "name": TEXT,
    "type!": TEXT,
    "color": (NUMBER, 3),
    "intensity": NUMBER,
    "range": NUMBER,
    "spot": {"innerConeAngle": NUMBER, "outerConeAngle": NUMBER},
}
_CAMERA = {
    "name": TEXT,
    "type!": TEXT,
    "perspective": {"yfov!": NUMBER, "znear": NUMBER, "zfar": NUMBER},
    "orthographic": {"ymag!": NUMBER, "znear": NUMBER, "zfar": NUMBER},
}
SCHEMA = {
    "asset!": {"version!": TEXT},
    "extensionsUsed": [TEXT],
    "extensionsRequired": [TEXT],
    "extensions": {"KHR_lights_punctual": {"lights!": [_LIGHT]}, "*": OBJECT},
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
    "bufferViews": [
        {"buffer!": INDEX, "byteOffset": INDEX, "byteLength!": INDEX, "byteStride": INDEX, "extensions": {"*": OBJECT}}
    ],
    "buffers": [{"uri": TEXT, "byteLength!": INDEX}],
    "cameras": [_CAMERA],
    "materials": [_MATERIAL],
    "textures": [
        {
            "source": INDEX,
            "sampler": INDEX,
            "extensions": {"EXT_texture_webp": {"source!": INDEX}, "*": OBJECT},
        }
    ],
    "images": [{"uri": TEXT, "bufferView": INDEX}],
    "samplers": [{"wrapS": INDEX, "wrapT": INDEX}],
}


_FITS = {
    INDEX: lambda value: type(value) is int and 0 <= value < 2**53,
    NUMBER: lambda value: type(value) in (int, float) and abs(value) < 1e300,
    TEXT: lambda value: isinstance(value, str),
    BOOLEAN: lambda value: isinstance(value, bool),
    OBJECT: lambda value: isinstance(value, dict),
}


class _Mismatch(Exception):
    """problem: in words. place: where, innermost name or index first."""

    def __init__(self, expected: str, value: Any) -> None:
        super().__init__()
        self.problem, self.place = f"{expected} was expected, {json.dumps(value)[:60]} came", []


def check_json(values: Any) -> None:
    """Raises InputError naming the place in the JSON where a document's `values` are not what SCHEMA says."""
    try:
        _check(values, _COMPILED)
    except _Mismatch as wrong:
        place = "".join(f"[{item}]" if isinstance(item, int) else f".{item}" for item in reversed(wrong.place))
        raise InputError(wrong.problem, field=place.lstrip(".") or None) from None


def _compiled(kind: Any) -> Any:
    """The schema with its dictionaries as (required names, kinds by name, kind of other names or None)."""
    if isinstance(kind, dict):
        required = {name[:-1] for name in kind if name.endswith("!")}
        by_name = {name.removesuffix("!"): _compiled(inner) for name, inner in kind.items() if name != "*"}
        return _Object(required, by_name, _compiled(kind["*"]) if "*" in kind else None)
    return type(kind)((_compiled(kind[0]), *kind[1:])) if isinstance(kind, list | tuple) else kind


class _Object(NamedTuple):
    required: set[str]
    by_name: dict[str, Any]
    others: Any


def _check(value: Any, kind: Any) -> None:
    if isinstance(kind, _Object):
        if not isinstance(value, dict):
            raise _Mismatch(OBJECT, value)
        if not value.keys() >= kind.required:
            raise _Mismatch(f"{min(kind.required - value.keys())} in it", value)
        for name, item in value.items():
            inner = kind.by_name.get(name, kind.others)
            if inner is not None:
                _descend(item, inner, name)
    elif isinstance(kind, str):
        if not _FITS[kind](value):
            raise _Mismatch(kind, value)
    elif not isinstance(value, list):
        raise _Mismatch("a list", value)
    elif isinstance(kind, tuple) and len(value) != kind[1]:
        raise _Mismatch(f"{kind[1]} numbers", value)
    else:
        for index, item in enumerate(value):
            _descend(item, kind[0], index)


def _descend(value: Any, kind: Any, place: str | int) -> None:
    try:
        _check(value, kind)
    except _Mismatch as wrong:
        wrong.place.append(place)
        raise


_COMPILED = _compiled(SCHEMA)
