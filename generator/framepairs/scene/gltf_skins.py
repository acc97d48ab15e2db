"""Vertices that glTF moves: morph targets and skins, evaluated in float64 (glTF 2.0, chapters 3.7.2.2 and 3.7.3)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Deformed
from .gltf_accessors import read_integers, read_numbers
from .gltf_document import Document
from .gltf_nodes import NodeTree


@dataclass(frozen=True, kw_only=True)
class Shape:
    """The vertices of a primitive before they move.

    positions: [3, V] and normals: [3, V] float64 (components first), normals None for flat shading. targets: per morph
    target the displacements ([3, V] of positions, of normals), either None where it has none. joints: [K, V] indices into
    the skin's joints; weights: [K, V], of sum 1; both None without a skin.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    targets: tuple[tuple[NDArray | None, NDArray | None], ...] = ()
    joints: NDArray[np.int64] | None = None
    weights: NDArray[np.float64] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Skin:
    """Joints of one figure; two are equal only where they are the same one.

    joints: nodes. root: the nearest node above all joints, itself one of them or not; None where only the world is.
    joint_from_bind: [joints, 4, 4], glTF's inverse bind matrices. deforms: whether a joint moves against the root.
    """

    joints: tuple[int, ...]
    root: int | None
    joint_from_bind: NDArray[np.float64]
    deforms: bool


def read_skin(document: Document, index: int, tree: NodeTree) -> Skin:
    """Skin number `index`. glTF's `skeleton` is a hint that may lie far above the figure; the root is found anew.

    Raises InputError naming the skin.
    """
    skin, where = document.entry("skins", index), {"file": document.file, "field": f"skins[{index}]"}
    joints = tuple(skin["joints"])
    if not joints:
        raise InputError("no joints", **where)
    for joint in joints:
        document.entry("nodes", joint)
    if "inverseBindMatrices" in skin:
        stored = read_numbers(document, skin["inverseBindMatrices"], "MAT4").astype(float)
        if len(stored) < len(joints):
            raise InputError(f"{len(stored)} inverse bind matrices for {len(joints)} joints", **where)
        matrices = stored[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)  # stored by columns
    else:
        matrices = np.tile(np.eye(4), (len(joints), 1, 1))
    root, between = _root(tree, joints)
    return Skin(joints=joints, root=root, joint_from_bind=matrices, deforms=bool(tree.turning[between].any()))


def _root(tree: NodeTree, joints: tuple[int, ...]) -> tuple[int | None, list[int]]:
    """(the nearest node above all joints or None, the nodes between it and the joints with these)."""
    above: dict[int, set[int]] = {}  # of every node above a joint, those below it that lead to one
    tops: set[int] = set()
    for joint in joints:
        node, below = joint, None
        while True:
            known = node in above
            above.setdefault(node, set()).update(() if below is None else (below,))
            if known:
                break
            if tree.parents[node] is None:
                tops.add(node)
                break
            node, below = tree.parents[node], node
    if len(tops) > 1:
        return None, list(above)
    (root,), ends = tops, set(joints)
    shared = {root}
    while root not in ends and len(above[root]) == 1:
        (root,) = above[root]
        shared.add(root)
    return root, [node for node in above if node not in shared]


def read_shape(document: Document, primitive: dict[str, Any], joint_count: int, field: str) -> Shape:
    """The vertices of a primitive; joint_count: how many its skin has, 0 without a skin. Raises InputError naming `field`."""
    attributes, where = primitive["attributes"], {"file": document.file, "field": field}
    positions = read_numbers(document, attributes["POSITION"], "VEC3")
    count = len(positions)

    def displacements(target: dict[str, int], name: str) -> NDArray | None:
        if name not in target or name not in attributes:
            return None
        values = read_numbers(document, target[name], "VEC3")
        if len(values) != count:
            raise InputError(f"a morph target of {len(values)} vertices on a mesh of {count}", **where)
        document.spend(values.nbytes, field)
        return np.ascontiguousarray(values.T)

    document.spend(2 * 24 * count, field)
    targets = [(displacements(item, "POSITION"), displacements(item, "NORMAL")) for item in primitive.get("targets", ())]
    normals = read_normals(document, primitive, count, field)
    joints, weights = _influences(document, attributes, count, joint_count, where) if joint_count else (None, None)
    return Shape(
        positions=np.ascontiguousarray(positions.T, dtype=float),
        normals=np.ascontiguousarray(normals.T, dtype=float) if normals is not None else None,
        targets=tuple(targets),
        joints=joints,
        weights=weights,
    )


def read_normals(document: Document, primitive: dict[str, Any], count: int, field: str) -> NDArray | None:
    """[V, 3]: float32 as stored, or float64 of unit length where they are integers; None where there are none."""
    if "NORMAL" not in primitive["attributes"]:
        return None
    normals = read_numbers(document, primitive["attributes"]["NORMAL"], "VEC3")
    if len(normals) != count:
        raise InputError(f"{len(normals)} normals of {count} vertices", file=document.file, field=field)
    return normals if normals.dtype == np.float32 else _unit(normals.T).T


def most_weighted(shape: Shape) -> int:
    """The joint with the greatest sum of weights; 0 where there are no vertices."""
    return int(np.bincount(shape.joints.ravel(), shape.weights.ravel(), minlength=1).argmax())


def skinning(skin: Skin, anchor: int, root_from_joint: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(origin [3] of the object's space in the root's, object_from_bind [joints, 4, 4]).

    The object's space has the axes of the skin's root and its origin at joint `anchor`. root_from_joint: [joints, 4, 4].
    """
    origin = root_from_joint[anchor, :3, 3].copy()
    object_from_bind = root_from_joint @ skin.joint_from_bind
    object_from_bind[:, :3, 3] -= origin
    return origin, object_from_bind


def deform(shape: Shape, target_weights: NDArray[np.float64], object_from_bind: NDArray[np.float64] | None) -> Deformed:
    """The vertices at one time, morphed first and then skinned; rounded to float32 at the very end.

    target_weights: [targets]. object_from_bind: [joints, 4, 4], the joints' matrices times their inverse bind matrices;
    None without a skin. Normals go by the blended inverse transposes of the joints' matrices (as in UsdSkel and the Khronos
    glTF-Sample-Viewer) and have unit length.
    """
    positions, normals = shape.positions, shape.normals
    for weight, (of_positions, of_normals) in zip(target_weights, shape.targets, strict=True):
        if weight != 0 and of_positions is not None:
            positions = positions + np.multiply(of_positions, weight, dtype=float)
        if weight != 0 and of_normals is not None and normals is not None:
            normals = normals + np.multiply(of_normals, weight, dtype=float)
    if object_from_bind is not None:
        if normals is not None:
            x, y, z = normals
            turns = _blend(shape, _normal_matrices(object_from_bind[:, :3, :3]))
            normals = np.stack([row[0] * x + row[1] * y + row[2] * z for row in turns])
        x, y, z = positions
        blended = _blend(shape, object_from_bind[:, :3])
        positions = np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in blended])
    rounded = np.ascontiguousarray(positions.T, dtype=np.float32)
    return Deformed(
        positions=rounded,
        normals=np.ascontiguousarray(_unit(normals).T, dtype=np.float32) if normals is not None else None,
    )


def _influences(document: Document, attributes: dict[str, int], count: int, joint_count: int, where: dict):
    """Joints and weights [K, V] of all sets JOINTS_n, WEIGHTS_n. A vertex without any weight follows its first joint."""
    sets = 0
    while f"JOINTS_{sets}" in attributes and f"WEIGHTS_{sets}" in attributes:
        sets += 1
    if not sets:
        raise InputError("a skin on a mesh without JOINTS_0 and WEIGHTS_0", **where)
    joints = np.concatenate([read_integers(document, attributes[f"JOINTS_{k}"], "VEC4") for k in range(sets)], axis=1)
    joints = joints.astype(np.int64)
    weights = np.concatenate([read_numbers(document, attributes[f"WEIGHTS_{k}"], "VEC4") for k in range(sets)], axis=1)
    if len(joints) != count or len(weights) != count:
        raise InputError(f"joints of {len(joints)} and weights of {len(weights)} vertices on a mesh of {count}", **where)
    weights = weights.astype(float)
    weights[weights.sum(axis=1) == 0, 0] = 1
    weights /= weights.sum(axis=1, keepdims=True)
    joints = np.where(weights != 0, joints, 0)
    if count and joints.max() >= joint_count:
        raise InputError(f"joint {joints.max()} of a skin of {joint_count}", **where)
    acting = np.flatnonzero(weights.any(axis=0))  # most exporters leave places empty
    return np.ascontiguousarray(joints.T[acting]), np.ascontiguousarray(weights.T[acting])


def _blend(shape: Shape, matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """[3, k, V]: per vertex the weighted mean of its joints' `matrices` [joints, 3, k]."""
    columns = np.ascontiguousarray(matrices.reshape(len(matrices), -1).T)
    total = np.zeros((len(columns), shape.positions.shape[1]))
    for joints, weights in zip(shape.joints, shape.weights, strict=True):
        total += weights * np.take(columns, joints, axis=1)
    return total.reshape(3, matrices.shape[2], -1)


def _normal_matrices(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse transposes of [joints, 3, 3]; of singular ones the cofactors, which have the same direction."""
    a, b, c = np.moveaxis(linear, 1, 0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    determinant = (a * cofactors[:, 0]).sum(axis=1)
    return cofactors / np.where(determinant == 0, 1, determinant)[:, None, None]


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """[3, V] of length 1; what has no direction stays 0."""
    lengths = np.sqrt((vectors * vectors).sum(axis=0))
    return vectors / np.where(lengths > 0, lengths, 1.0)
