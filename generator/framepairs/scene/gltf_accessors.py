"""glTF's accessors as arrays: strides, normalized integers, sparse values (glTF 2.0, chapter 3.6.2)."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .gltf_document import Document

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES = {width: kind for kind, width in WIDTHS.items()}


def read_numbers(document: Document, index: int, *types: str) -> NDArray:
    """[count, width]: accessor `index`, which must be of one of `types`; read once, and not to be written to.

    float32 as stored; float64 for integers, which are divided by their greatest value where they are normalized (signed
    ones clamped to -1, equation of chapter 3.6.2.2) and kept as they are where not. Raises InputError naming the accessor,
    also for values that are not finite.
    """
    if ("numbers", index) not in document.arrays:
        document.arrays["numbers", index] = _numbers(document, index, types)
    values = document.arrays["numbers", index]
    _expect_type(document, index, TYPES[values.shape[1]], types)
    return values


def read_integers(document: Document, index: int, kind: str) -> NDArray:
    """[count, width]: accessor `index` of whole numbers from 0. Raises InputError where it holds others."""
    values = _read(document, index, (kind,))
    if values.dtype.kind != "u":
        problem = f"unsigned whole numbers were expected, {values.dtype} came"
        raise InputError(problem, file=document.file, field=f"accessors[{index}]")
    return values


def _numbers(document: Document, index: int, types: tuple[str, ...]) -> NDArray:
    values = _read(document, index, types)
    if values.dtype == np.float32:
        if not np.isfinite(values).all():
            raise InputError("values are not finite", file=document.file, field=f"accessors[{index}]")
        return values
    if not document.entry("accessors", index).get("normalized", False):
        return values.astype(np.float64)
    return np.maximum(values / np.float64(np.iinfo(values.dtype).max), -1.0)


def _expect_type(document: Document, index: int, kind: str, types: tuple[str, ...]) -> None:
    if kind not in types:
        problem = f"type {' or '.join(types)} was expected, {kind} came"
        raise InputError(problem, file=document.file, field=f"accessors[{index}]")


def _read(document: Document, index: int, types: tuple[str, ...]) -> NDArray:
    accessor, field = document.entry("accessors", index), f"accessors[{index}]"
    _expect_type(document, index, accessor["type"], types)
    dtype, width, count = _component(document, accessor, field), WIDTHS[accessor["type"]], accessor["count"]
    if "bufferView" in accessor:
        values = _elements(document, accessor, dtype, width, count, field)
    else:
        document.spend(count * width * np.dtype(dtype).itemsize, field)
        values = np.zeros((count, width), dtype)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        kind = _component(document, sparse["indices"], field)
        places = _elements(document, sparse["indices"], kind, 1, sparse["count"], field)[:, 0]
        if places.dtype.kind != "u":
            raise InputError(f"sparse indices of {places.dtype}", file=document.file, field=field)
        if len(places) and places.max() >= count:
            raise InputError(f"sparse index {places.max()} of {count} elements", file=document.file, field=field)
        values[places] = _elements(document, sparse["values"], dtype, width, sparse["count"], field)
    return values


def _component(document: Document, holder: dict, field: str) -> type[np.generic]:
    if holder["componentType"] not in COMPONENTS:
        raise InputError(f"component type {holder['componentType']} is none of glTF's", file=document.file, field=field)
    return COMPONENTS[holder["componentType"]]


def _elements(document: Document, place: dict, dtype: type, width: int, count: int, field: str) -> NDArray:
    """[count, width] copied from the buffer view that `place` names, at its byte offset."""
    data, size = document.view(place["bufferView"]), np.dtype(dtype).itemsize
    stride = document.entry("bufferViews", place["bufferView"]).get("byteStride", 0) or size * width
    start = place.get("byteOffset", 0)
    end = start + (count - 1) * stride + size * width
    if count and end > len(data):
        raise InputError(f"needs {end} bytes of a buffer view of {len(data)}", file=document.file, field=field)
    if not count:
        return np.zeros((0, width), dtype)
    document.spend(count * width * size, field)
    little = np.dtype(dtype).newbyteorder("<")
    return np.ndarray((count, width), little, buffer=data, offset=start, strides=(stride, size)).astype(dtype)
