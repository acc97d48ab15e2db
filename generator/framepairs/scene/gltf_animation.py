"""glTF's nodes as a tree of matrices, and the clip that moves them (glTF 2.0, chapters 3.5, 3.11 and appendix C)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
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


@dataclass(frozen=True, kw_only=True)
class NodeTree:
    """All nodes of a file under one clip.

    parents: per node, None for roots. order: every node, parents first. fixed: per node its "matrix", or "translation",
    "rotation", "scale", and its "weights", as far as they are given. channels: by node, then by path; only what changes.
    end_s: the last key of the clip, seconds.
    """

    parents: tuple[int | None, ...]
    order: tuple[int, ...]
    fixed: tuple[dict[str, NDArray[np.float64]], ...]
    channels: dict[int, dict[str, Channel]]
    end_s: float

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """[nodes]: whether the node's own matrix changes."""
        return np.array([bool(self.channels.get(node, {}).keys() & REST.keys()) for node in range(len(self.parents))], bool)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """[nodes]: whether the node's place in the world changes."""
        found = self.turning.copy()
        for node in self.order:
            parent = self.parents[node]
            found[node] |= parent is not None and found[parent]
        return found

    @cached_property
    def rest(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Matrices [nodes, 4, 4] with what is fixed alone: parent_from_node and world_from_node."""
        local = np.array([_local(fixed) for fixed in self.fixed]).reshape(-1, 4, 4)
        world = local.copy()
        _chain(self, local, world, self.order)
        return local, world


def node_matrices(tree: NodeTree, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """parent_from_node and world_from_node, each [nodes, 4, 4], at a time in seconds. Only what moves is computed."""
    local, world = (array.copy() for array in tree.rest)
    for node in np.flatnonzero(tree.turning):
        sampled = {path: sample(item, time_s) for path, item in tree.channels[node].items() if path in REST}
        local[node] = _local({**tree.fixed[node], **sampled})
    _chain(tree, local, world, [node for node in tree.order if tree.moving[node]])
    return local, world


def relative_matrices(
    tree: NodeTree, local: NDArray[np.float64], root: int | None, nodes: Sequence[int]
) -> NDArray[np.float64]:
    """root_from_node [len(nodes), 4, 4] of nodes under `root`, whose own matrix does not enter; None is the world."""
    known: dict[int | None, NDArray[np.float64]] = {root: np.eye(4)}
    for node in nodes:
        climbed, ancestor = [], node
        while ancestor not in known:
            climbed.append(ancestor)
            ancestor = tree.parents[ancestor]
        for step in reversed(climbed):
            known[step] = known[tree.parents[step]] @ local[step]
    return np.array([known[node] for node in nodes])


def ancestors(tree: NodeTree, node: int) -> list[int]:
    """The node and all above it, up to its root."""
    found: list[int] = []
    above: int | None = node
    while above is not None:
        found.append(above)
        above = tree.parents[above]
    return found


def property_at(tree: NodeTree, node: int, path: str, time_s: float) -> NDArray[np.float64] | None:
    """The animated value, or else the fixed one, or None where the node has neither."""
    channel = tree.channels.get(node, {}).get(path)
    return sample(channel, time_s) if channel is not None else tree.fixed[node].get(path)


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
    return _unit(found) if channel.path == "rotation" else found


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


def read_tree(document: Document, clip: int | None) -> NodeTree:
    """The nodes under clip number `clip`. Raises InputError naming the node or the channel."""
    nodes = document.all("nodes")
    parents: list[int | None] = [None] * len(nodes)
    for number, node in enumerate(nodes):
        for child in node.get("children", ()):
            document.entry("nodes", child)
            if parents[child] is not None:
                raise InputError(f"node {child} has two parents", file=document.file, field=f"nodes[{number}].children")
            parents[child] = number
    order = [number for number, parent in enumerate(parents) if parent is None]
    for node in order:  # grows while it is walked
        order += nodes[node].get("children", ())
    if len(order) < len(nodes):
        raise InputError("a node is its own ancestor", file=document.file, field="nodes")
    fixed = [_fixed(document, number) for number in range(len(nodes))]
    channels: dict[int, dict[str, Channel]] = {}
    end_s = 0.0
    for node, channel in _channels(document, clip):
        of_node = channels.setdefault(node, {})
        field = f"animations[{clip}].channels"
        if channel.path in of_node:
            raise InputError(f"two channels move the {channel.path} of node {node}", file=document.file, field=field)
        if "matrix" in fixed[node] and channel.path in REST:
            raise InputError(f"node {node} is animated and has a matrix", file=document.file, field=field)
        of_node[channel.path] = channel
        end_s = max(end_s, float(channel.times[-1]))
    for node, of_node in channels.items():
        still = {path: sample(item, 0.0) for path, item in of_node.items() if item.is_constant}
        fixed[node].update(still)
        channels[node] = {path: item for path, item in of_node.items() if path not in still}
    return NodeTree(parents=tuple(parents), order=tuple(order), fixed=tuple(fixed), channels=channels, end_s=end_s)


def _fixed(document: Document, number: int) -> dict[str, NDArray[np.float64]]:
    node = document.entry("nodes", number)
    found = {path: np.array(node[path], dtype=float) for path in (*REST, "weights") if path in node}
    where = {"file": document.file, "field": f"nodes[{number}]"}
    if "matrix" in node:
        found["matrix"] = np.array(node["matrix"], dtype=float).reshape(4, 4).T  # stored by columns
        if found.keys() & REST.keys():
            raise InputError("a matrix beside translation, rotation or scale", **where)
        if found["matrix"][3].tolist() != [0, 0, 0, 1]:
            raise InputError("the last row of its matrix is not 0, 0, 0, 1", **where)
    if "rotation" in found:
        if not found["rotation"].any():
            raise InputError("a rotation of length 0", **where)
        found["rotation"] = _unit(found["rotation"])
    return found


def _channels(document: Document, clip: int | None):
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
            yield target["node"], _channel(document, animation["samplers"][item["sampler"]], target["path"])
        except InputError as error:
            where = f"{field}, {error.field}" if error.field else field
            raise InputError(error.problem, file=document.file, field=where) from None


def _channel(document: Document, sampler: dict, path: str) -> Channel:
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("STEP", "LINEAR", "CUBICSPLINE"):
        raise InputError(f"interpolation {interpolation!r} is none of glTF's")
    times = read_numbers(document, sampler["input"], "SCALAR")[:, 0].astype(float)
    if not len(times) or (np.diff(times) < 0).any():
        raise InputError("its times are none, or not in order")
    kind = {3: "VEC3", 4: "VEC4"}.get(WIDTHS.get(path, 1), "SCALAR")
    values = read_numbers(document, sampler["output"], kind).astype(float)
    parts = 3 if interpolation == "CUBICSPLINE" else 1
    per_key, rest = divmod(len(values), len(times) * parts)
    if rest or per_key == 0 or (path != "weights" and per_key != 1):
        raise InputError(f"{len(values)} values for {len(times)} keys of {interpolation} {path}")
    values = values.reshape(len(times), parts, -1)
    keys = values[:, parts // 2]
    if path == "rotation":
        if not keys.any(axis=1).all():
            raise InputError("a rotation of length 0")
        keys = keys if parts == 3 else _unit(keys)
    tangents = {"arriving": values[:, 0], "leaving": values[:, 2]} if parts == 3 else {}
    return Channel(path=path, interpolation=interpolation, times=times, values=keys, **tangents)


def _chain(tree: NodeTree, local: NDArray, world: NDArray, nodes: Sequence[int]) -> None:
    """Writes world_from_node of `nodes`, which stand parents first."""
    for node in nodes:
        parent = tree.parents[node]
        world[node] = local[node] if parent is None else world[parent] @ local[node]


def _local(values: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """parent_from_node = translation x rotation (of unit length) x scale, or the matrix that stands for it."""
    if "matrix" in values:
        return values["matrix"]
    translation, rotation, scale = (np.asarray(values.get(path, REST[path]), dtype=float) for path in REST)
    x, y, z, w = rotation
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= scale
    matrix[:3, 3] = translation
    return matrix


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
