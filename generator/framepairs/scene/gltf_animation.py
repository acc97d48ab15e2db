"""Clips: the animated properties of a glTF's nodes over time (glTF 2.0, chapter 3.11 and appendix C)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .gltf_accessors import read_numbers
from .gltf_document import Document

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One animated property of one node.

    times: [K] seconds, not decreasing. values: [K, n] float64 at the keys; rotations are quaternions (x, y, z, w). arriving,
    leaving: [K, n] tangents per second at the keys, for CUBICSPLINE alone.
    """

    path: Literal["translation", "rotation", "scale", "weights"]
    interpolation: Literal["STEP", "LINEAR", "CUBICSPLINE"]
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    arriving: NDArray[np.float64] | None = None
    leaving: NDArray[np.float64] | None = None

    @property
    def is_constant(self) -> bool:
        still = [part is None or not part.any() for part in (self.arriving, self.leaving)]
        return all(still) and bool((self.values == self.values[0]).all())


def sample(channel: Channel, time_s: float) -> NDArray[np.float64]:
    """The value [n] at a time in seconds; before the first and after the last key it is that key's.

    STEP holds the key before. LINEAR blends, rotations along the shorter great circle (appendix C.4). CUBICSPLINE is
    appendix C.5, where the tangents are multiplied by the time between the keys. Rotations have unit length.
    """
    times, values = channel.times, channel.values
    after = int(np.searchsorted(times, time_s, side="right"))
    key = after - 1
    if after == 0 or after == len(times) or channel.interpolation == "STEP":
        found = values[max(key, 0)]
    else:
        interval = times[after] - times[key]
        u = (time_s - times[key]) / interval
        if channel.interpolation == "CUBICSPLINE":
            arriving, leaving = interval * channel.arriving[after], interval * channel.leaving[key]
            found = (2 * u**3 - 3 * u**2 + 1) * values[key] + (u**3 - 2 * u**2 + u) * leaving
            found = found + (3 * u**2 - 2 * u**3) * values[after] + (u**3 - u**2) * arriving
        elif channel.path == "rotation":
            found = slerp(values[key], values[after], u)
        else:
            found = (1 - u) * values[key] + u * values[after]
    return unit(found) if channel.path == "rotation" else found


def slerp(start: NDArray[np.float64], end: NDArray[np.float64], u: float) -> NDArray[np.float64]:
    """The quaternion at share u of the shorter great circle between two of unit length."""
    end = -end if start @ end < 0 else end
    angle = 2 * math.atan2(np.linalg.norm(start - end), np.linalg.norm(start + end))
    if angle < 1e-7:  # here a straight blend differs by angle^2, which float64 does not hold
        return (1 - u) * start + u * end
    return (math.sin((1 - u) * angle) * start + math.sin(u * angle) * end) / math.sin(angle)


def clip_index(document: Document, clip: str | None) -> int | None:
    """Index of the clip of that name (its number where it has none), the first for None; None where there are no clips.

    Raises InputError for a name that no clip has.
    """
    names = clip_names(document)
    if clip is None:
        return 0 if names else None
    if clip not in names:
        known = ", ".join(names) or "none"
        raise InputError(f"no animation {clip!r}; there are: {known}", file=document.file, field="animations")
    return names.index(clip)


def clip_names(document: Document) -> list[str]:
    return [item.get("name") or str(index) for index, item in enumerate(document.all("animations"))]


def read_channels(document: Document, clip: int | None) -> Iterator[tuple[int, Channel]]:
    """(node, Channel) of a clip; channels without a node, or of an extension, move nothing here."""
    animation = document.entry("animations", clip) if clip is not None else {"channels": [], "samplers": []}
    for number, item in enumerate(animation["channels"]):
        target, field = item["target"], f"animations[{clip}].channels[{number}]"
        if "node" not in target or target["path"] == "pointer":
            continue
        if target["path"] not in (*REST, "weights"):
            raise InputError(f"path {target['path']!r} is none of glTF's", file=document.file, field=field)
        document.entry("nodes", target["node"])
        if item["sampler"] >= len(animation["samplers"]):
            problem = f"names sampler {item['sampler']}, there are {len(animation['samplers'])}"
            raise InputError(problem, file=document.file, field=field)
        try:
            key = "channel", clip, item["sampler"], target["path"]  # exporters let many nodes share a sampler
            if key not in document.arrays:
                document.arrays[key] = _channel(document, animation["samplers"][item["sampler"]], target["path"])
            yield target["node"], document.arrays[key]
        except InputError as error:
            where = f"{field}, {error.field}" if error.field else field
            raise InputError(error.problem, file=document.file, field=where) from None


def _channel(document: Document, sampler: dict, path: str) -> Channel:
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("STEP", "LINEAR", "CUBICSPLINE"):
        raise InputError(f"interpolation {interpolation!r} is none of glTF's")
    times = np.asarray(read_numbers(document, sampler["input"], "SCALAR")[:, 0], dtype=float)
    if not len(times) or (np.diff(times) < 0).any():
        raise InputError("its times are none, or not in order")
    kind = {3: "VEC3", 4: "VEC4"}.get(WIDTHS.get(path, 1), "SCALAR")
    stored = read_numbers(document, sampler["output"], kind)
    document.spend(8 * (times.size + stored.size), f"accessors[{sampler['output']}]")
    values = stored.astype(float)
    parts = 3 if interpolation == "CUBICSPLINE" else 1
    per_key, rest = divmod(len(values), len(times) * parts)
    if rest or per_key == 0 or (path != "weights" and per_key != 1):
        raise InputError(f"{len(values)} values for {len(times)} keys of {interpolation} {path}")
    values = values.reshape(len(times), parts, -1)
    keys = values[:, parts // 2]
    if path == "rotation":
        if not keys.any(axis=1).all():
            raise InputError("a rotation of length 0")
        keys = keys if parts == 3 else unit(keys)
    tangents = {"arriving": values[:, 0], "leaving": values[:, 2]} if parts == 3 else {}
    return Channel(path=path, interpolation=interpolation, times=times, values=keys, **tangents)


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """[..., n] of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
