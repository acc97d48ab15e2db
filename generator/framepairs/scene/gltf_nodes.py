"""glTF's nodes as a tree of matrices under one clip (glTF 2.0, chapter 3.5)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..transforms import look_at
from .gltf_animation import REST, Channel, read_channels, sample, unit
from .gltf_document import Document

MOST_NODES = 2**18  # such a file takes 5 s; what refers to them in a scene is less than that


@dataclass(frozen=True, kw_only=True)
class NodeTree:
    """All nodes of a file under one clip.

    parents: per node, None for roots. levels: the nodes [n] of each depth, roots first. fixed: per node its "matrix", or
    "translation", "rotation", "scale", and its "weights", as far as they are given. channels: by node, then by path; only
    what changes. end_s: the last key of the clip, seconds.
    """

    parents: tuple[int | None, ...]
    levels: tuple[NDArray[np.int64], ...]
    fixed: tuple[dict[str, NDArray[np.float64]], ...]
    channels: dict[int, dict[str, Channel]]
    end_s: float

    @cached_property
    def parent_indices(self) -> NDArray[np.int64]:
        """[nodes]: -1 for roots."""
        return np.array([-1 if parent is None else parent for parent in self.parents], dtype=np.int64)

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """[nodes]: whether the node's own matrix changes."""
        return np.array([bool(self.channels.get(node, {}).keys() & REST.keys()) for node in range(len(self.parents))], bool)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """[nodes]: whether the node's place in the world changes."""
        found = self.turning.copy()
        for level in self.levels[1:]:
            found[level] |= found[self.parent_indices[level]]
        return found

    @cached_property
    def moving_levels(self) -> list[NDArray[np.int64]]:
        """The moving nodes of each depth that has some, upper ones first."""
        return [chosen for level in self.levels if len(chosen := level[self.moving[level]])]

    @cached_property
    def rest(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Matrices [nodes, 4, 4] with what is fixed alone: parent_from_node and world_from_node."""
        local = _local_matrices(self.fixed)
        world = local.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # `read_tree` refuses what is not finite
            _chain(self, local, world, self.levels)
        return local, world


def node_matrices(tree: NodeTree, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """parent_from_node and world_from_node, each [nodes, 4, 4], at a time in seconds. Only what moves is computed."""
    local, world = (array.copy() for array in tree.rest)
    turning = np.flatnonzero(tree.turning)
    if len(turning):
        local[turning] = _local_matrices([{**tree.fixed[node], **_sampled(tree, node, time_s)} for node in turning])
    _chain(tree, local, world, tree.moving_levels)
    return local, world


def remembered_matrices(tree: NodeTree) -> Callable[[float], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """`node_matrices` of the time alone; the last few results are kept, for all that asks about one frame."""
    return lru_cache(maxsize=4)(lambda time_s: node_matrices(tree, time_s))


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


def rigid_place(world_from_node: NDArray[np.float64]) -> NDArray[np.float64]:
    """[4, 4]: the node's place without scale, shear and mirroring. It looks along the node's -z, its y near the node's."""
    x, y, z = world_from_node[:3, :3].T
    z = next(axis for axis in (z, np.cross(x, y), np.array([0, 0, 1.0])) if axis.any())
    y = y if y.any() else np.eye(3)[np.argmin(np.abs(z))]
    matrix = look_at(np.zeros(3), -z, y)
    matrix[:3, 3] = world_from_node[:3, 3]
    return matrix


def drawn_nodes(document: Document) -> list[int]:
    """All nodes of the file's scene (of the whole file where it has no scenes), in their order."""
    nodes = document.all("nodes")
    if document.all("scenes"):
        found = document.entry("scenes", document.json.get("scene", 0)).get("nodes", ())
    else:
        children = {child for node in nodes for child in node.get("children", ())}
        found = [number for number in range(len(nodes)) if number not in children]
    seen: set[int] = set()
    waiting = list(found)
    while waiting:
        number = waiting.pop()
        if number not in seen:
            seen.add(number)
            waiting += document.entry("nodes", number).get("children", ())
    return sorted(seen)


def property_at(tree: NodeTree, node: int, path: str, time_s: float) -> NDArray[np.float64] | None:
    """The animated value, or else the fixed one, or None where the node has neither."""
    channel = tree.channels.get(node, {}).get(path)
    return sample(channel, time_s) if channel is not None else tree.fixed[node].get(path)


def read_tree(document: Document, clip: int | None) -> NodeTree:
    """The nodes under clip number `clip`. Raises InputError naming the node or the channel."""
    count = len(document.all("nodes"))
    if count > MOST_NODES:
        raise InputError(f"{count} nodes, at most {MOST_NODES} are read", file=document.file, field="nodes")
    parents = _parents(document)
    levels = tuple(_levels(document, parents))
    if sum(map(len, levels)) < count:
        raise InputError("a node is its own ancestor", file=document.file, field="nodes")
    fixed = [_fixed(document, number) for number in range(count)]
    channels: dict[int, dict[str, Channel]] = {}
    end_s = 0.0
    for node, channel in read_channels(document, clip):
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
    tree = NodeTree(parents=tuple(parents), levels=levels, fixed=tuple(fixed), channels=channels, end_s=end_s)
    finite = np.isfinite(tree.rest[1]).all(axis=(1, 2))
    if not finite.all():
        problem = "its place in the world is not finite"
        raise InputError(problem, file=document.file, field=f"nodes[{np.argmin(finite)}]")
    return tree


def transforms_of(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Matrices [n, 4, 4] = translation [n, 3] x rotation (quaternions [n, 4] of unit length) x scale [n, 3]."""
    x, y, z, w = rotation.T
    matrices = np.tile(np.eye(4), (len(translation), 1, 1))
    matrices[:, :3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3] = translation
    return matrices


def _parents(document: Document) -> list[int | None]:
    parents: list[int | None] = [None] * len(document.all("nodes"))
    for number, node in enumerate(document.all("nodes")):
        for child in node.get("children", ()):
            document.entry("nodes", child)
            if parents[child] is not None:
                raise InputError(f"node {child} has two parents", file=document.file, field=f"nodes[{number}].children")
            parents[child] = number
    return parents


def _levels(document: Document, parents: list[int | None]) -> Iterator[NDArray[np.int64]]:
    """The nodes of each depth; those of a ring of nodes have none."""
    nodes = document.all("nodes")
    level = [number for number, parent in enumerate(parents) if parent is None]
    while level:
        yield np.array(level, dtype=np.int64)
        level = [child for number in level for child in nodes[number].get("children", ())]


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
        found["rotation"] = unit(found["rotation"] / np.abs(found["rotation"]).max())
    return found


def _sampled(tree: NodeTree, node: int, time_s: float) -> dict[str, NDArray[np.float64]]:
    return {path: sample(item, time_s) for path, item in tree.channels[node].items() if path in REST}


def _chain(tree: NodeTree, local: NDArray, world: NDArray, levels: Sequence[NDArray[np.int64]]) -> None:
    """Writes world_from_node of the nodes of `levels`, upper ones first."""
    for level in levels:
        above = tree.parent_indices[level]
        under, roots = level[above >= 0], level[above < 0]
        world[roots] = local[roots]
        world[under] = world[above[above >= 0]] @ local[under]


def _local_matrices(values: Sequence[dict[str, NDArray[np.float64]]]) -> NDArray[np.float64]:
    """parent_from_node [n, 4, 4] = translation x rotation (of unit length) x scale, or the matrix that stands for it."""
    parts = {path: np.tile(rest, (len(values), 1)) for path, rest in REST.items()}
    for path, array in parts.items():
        given = [index for index, item in enumerate(values) if path in item]
        if given:
            array[given] = [values[index][path] for index in given]
    matrices = transforms_of(**parts)
    whole = [index for index, item in enumerate(values) if "matrix" in item]
    if whole:
        matrices[whole] = [values[index]["matrix"] for index in whole]
    return matrices
