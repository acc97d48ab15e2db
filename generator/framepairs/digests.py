"""sha256 of plain data, by value: what a part of a scene or of a frame is, whatever file it came from."""

import dataclasses
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

NOT_DRAWN = frozenset({"name", "not_read", "bsdf"})  # fields of a scene's parts; files stand for BSDFs that Mitsuba draws


def digest(value: Any) -> str:
    """sha256 of plain data: numbers, texts, arrays, sequences, mappings and dataclasses of them. Names of things, and what a
    file holds but nothing draws, do not count."""
    hashed = hashlib.sha256()
    _feed(hashed, value)
    return hashed.hexdigest()


def _feed(hashed, value: Any) -> None:
    if isinstance(value, np.ndarray):
        hashed.update(f"array {value.dtype} {value.shape};".encode())
        hashed.update(np.ascontiguousarray(value).data)
    elif isinstance(value, BaseModel):
        _feed(hashed, value.model_dump(mode="json"))
    elif dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value) if field.name not in NOT_DRAWN]
        _feed(hashed, {name: getattr(value, name) for name in fields})
    elif isinstance(value, Mapping):
        hashed.update(f"map {len(value)};".encode())
        for key in sorted(value, key=str):
            _feed(hashed, str(key))
            _feed(hashed, value[key])
    elif isinstance(value, (tuple, list)):
        hashed.update(f"list {len(value)};".encode())
        for item in value:
            _feed(hashed, item)
    elif isinstance(value, (str, Path)):
        text = str(value).encode()
        hashed.update(b"text %d;" % len(text) + text)
    else:  # numbers, truth values, None, and what Mitsuba's dictionaries hold
        hashed.update(f"{type(value).__name__} {value!r};".encode())
