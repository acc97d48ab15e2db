"""Vertices of USD meshes over time: sampled points and normals, blend shapes, and UsdSkel's linear blend skinning.

Everything is float64 until the positions are rounded. A skinned mesh stands in the space of its skeleton, as UsdSkel has it
(the mesh's own transform is not used), shifted to the figure where the figure is far from the skeleton's origin.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdSkel, Vt

from ..errors import InputError
from .description import Deformed
from .usd_arrays import begin_of, vectors
from .usd_meshes import VertexSource
from .usd_surfaces import Surface

FAR = 1.0  # a figure is far from the origin of its skeleton where its centre lies outside the sphere of its radius there


@dataclass(frozen=True, kw_only=True)
class Skin:
    """Joints that move a mesh. rigid: all points alike. ranks: for the strongest influence of each point, the second, and so
    on: points [n], joints [n] and weights [n] of those that have it. origin: [3] in the skeleton's space."""

    skeleton: UsdSkel.SkeletonQuery
    query: UsdSkel.SkinningQuery
    rigid: bool
    ranks: tuple[tuple[NDArray, NDArray, NDArray], ...]
    origin: NDArray[np.float64]
    moves: bool


@dataclass(frozen=True, kw_only=True)
class BlendShapes:
    """Offsets to the points of a mesh. targets: for each sub-shape of the query, points [n], offsets [n, 3] and offsets to
    normals [n, 3]; the latter may be None."""

    animation: UsdSkel.AnimQuery
    skinning: UsdSkel.SkinningQuery
    query: UsdSkel.BlendShapeQuery
    targets: tuple[tuple[NDArray, NDArray, NDArray | None], ...]
    moves: bool


@dataclass(frozen=True, kw_only=True)
class Deformation:
    """What acts on the vertices of one mesh. anchor: the prim in whose space they stand (with the skin's origin)."""

    prim: Usd.Prim
    surface: Surface
    anchor: Usd.Prim
    sampled: bool
    skin: Skin | None
    shapes: BlendShapes | None

    @property
    def reshapes(self) -> bool:
        """The vertices are not simply those authored."""
        return self.sampled or self.shapes is not None or (self.skin is not None and not self.skin.rigid)

    @property
    def moves(self) -> bool:
        """The vertices move."""
        skin = self.skin is not None and not self.skin.rigid and self.skin.moves
        return self.sampled or skin or (self.shapes is not None and self.shapes.moves)


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A mesh at one time in object space: its drawn points [D, 3] and smooth normals [G, 3]; for authored normals, where the
    drawn points are those of the prim, offsets [D, 3] to them and matrices [D, 3, 3]."""

    points: NDArray[np.float64]
    smooth: NDArray[np.float32] | None
    normal_offsets: NDArray[np.float64] | None
    normal_matrices: NDArray[np.float64] | None


Skins = dict[str, tuple[Usd.Prim, UsdSkel.SkeletonQuery, UsdSkel.SkinningQuery]]


def find_skins(root: Usd.Prim, predicate, cache: UsdSkel.Cache) -> Skins:
    """For each mesh under a SkelRoot, by its path: the skeleton's prim (that of the query is the one of the prototype, where
    there is one), the skeleton and the binding."""
    skel_root = UsdSkel.Root(root)
    cache.Populate(skel_root, predicate)
    return {
        str(target.GetPrim().GetPath()): (binding.GetSkeleton().GetPrim(), cache.GetSkelQuery(binding.GetSkeleton()), target)
        for binding in cache.ComputeSkelBindings(skel_root, predicate)
        for target in binding.GetSkinningTargets()
    }


def read_deformation(
    prim: Usd.Prim, surface: Surface, skins: Skins, top: Usd.Prim | None, not_read: list[str]
) -> Deformation | None:
    """What moves the vertices of a mesh, or None. surface: what is drawn of it. top: root of the prototype that the mesh
    is part of.

    Raises InputError naming the prim where skin or blend shapes do not fit the mesh.
    """
    usd_mesh, path = UsdGeom.Mesh(prim), str(prim.GetPath())
    normals = UsdGeom.PrimvarsAPI(usd_mesh).GetPrimvar("normals")
    own = normals.GetAttr() if normals and normals.HasValue() else usd_mesh.GetNormalsAttr()
    turning = surface.smooth is None and own.ValueMightBeTimeVarying()
    sampled = usd_mesh.GetPointsAttr().ValueMightBeTimeVarying() or turning
    skin, shapes = None, None
    binding = UsdSkel.BindingAPI(prim)
    if path in skins:
        bones, skeleton, query = skins[path]
        beside = top is not None and not bones.GetPath().HasPrefix(top.GetPath())
        if beside and query.HasJointInfluences():
            not_read.append(f"skinning of {path}: its skeleton lies outside its prototype")
        elif query.HasJointInfluences():
            skin = _read_skin(usd_mesh, skeleton, query, not_read)
        if query.HasBlendShapes() and skeleton.GetAnimQuery():
            shapes = _read_shapes(usd_mesh, skeleton.GetAnimQuery(), query)
    elif binding.GetJointIndicesAttr().HasAuthoredValue() or binding.GetBlendShapesAttr().HasAuthoredValue():
        not_read.append(f"skinning of {path}: it is bound to no skeleton under a SkelRoot")
    if skin is None and shapes is None and not sampled:
        return None
    anchor = bones if skin else prim
    deformation = Deformation(surface=surface, prim=prim, anchor=anchor, sampled=sampled, skin=skin, shapes=shapes)
    if skin is None or skin.rigid:
        return deformation
    points = pose(deformation, Usd.TimeCode(begin_of(usd_mesh.GetPrim().GetStage()))).points
    low, high = points.min(axis=0), points.max(axis=0)
    centre, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    return replace(deformation, skin=replace(skin, origin=centre)) if np.linalg.norm(centre) > FAR * radius else deformation


def _read_skin(
    usd_mesh: UsdGeom.Mesh, skeleton: UsdSkel.SkeletonQuery, query: UsdSkel.SkinningQuery, not_read: list[str]
) -> Skin | None:
    path = str(usd_mesh.GetPath())
    start = Usd.TimeCode.EarliestTime()
    if not skeleton.HasBindPose():
        not_read.append(f"skinning of {path}: {skeleton.GetPrim().GetPath()} has no bind pose")
        return None
    if query.GetSkinningMethod() == UsdSkel.Tokens.dualQuaternion:
        not_read.append(f"dual quaternion skinning of {path}: joints are blended linearly")
    rigid = query.IsRigidlyDeformed()
    count = 1 if rigid else len(usd_mesh.GetPointsAttr().Get(start) or ())
    influences = query.ComputeJointInfluences(start) if rigid else query.ComputeVaryingJointInfluences(count, start)
    if not influences or not len(influences[0]) or len(influences[0]) != len(influences[1]):
        raise InputError(f"joint influences do not fit its {count} points", field=path)
    joints, weights = (np.array(array).reshape(count, -1) for array in influences)
    joint_count = len(query.GetJointOrder() or skeleton.GetJointOrder())
    used = joints[weights != 0]
    if used.size and (used.min() < 0 or used.max() >= joint_count):
        raise InputError(f"joint index {used.max()} with only {joint_count} joints", field=path)
    animation = skeleton.GetAnimQuery()
    bind = UsdSkel.BindingAPI(usd_mesh.GetPrim()).GetGeomBindTransformAttr()
    moves = bool(animation and animation.JointTransformsMightBeTimeVarying())
    return Skin(
        skeleton=skeleton,
        query=query,
        rigid=rigid,
        ranks=_ranks(joints.astype(np.int64), weights.astype(np.float64)),
        origin=np.zeros(3),
        moves=moves or bool(bind and bind.ValueMightBeTimeVarying()),
    )


def _ranks(joints: NDArray, weights: NDArray) -> tuple[tuple[NDArray, NDArray, NDArray], ...]:
    order = np.argsort(-np.abs(weights), axis=1, kind="stable")
    joints, weights = (np.take_along_axis(array, order, axis=1) for array in (joints, weights))
    points = [np.flatnonzero(column) for column in weights.T]
    return tuple((some, joints[some, k], weights[some, k]) for k, some in enumerate(points) if len(some))


def _read_shapes(usd_mesh: UsdGeom.Mesh, animation: UsdSkel.AnimQuery, query: UsdSkel.SkinningQuery) -> BlendShapes:
    count = len(usd_mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()) or ())
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(usd_mesh.GetPrim()))
    chosen = shapes.ComputeBlendShapePointIndices()
    targets = []
    for index, offsets in enumerate(shapes.ComputeSubShapePointOffsets()):
        which = shapes.GetBlendShapeIndex(index)
        shape, between = shapes.GetBlendShape(which), shapes.GetInbetween(index)
        normals = between.GetNormalOffsets() if between else shape.GetNormalOffsetsAttr().Get()
        points = np.array(chosen[which], dtype=np.int64) if len(chosen[which]) else np.arange(len(offsets))
        shifts = np.array(offsets, dtype=np.float64).reshape(-1, 3)
        turns = np.array(normals or (), dtype=np.float64).reshape(-1, 3)
        if len(shifts) == 0:  # the shape that a weight of zero means
            targets.append((np.zeros(0, np.int64), shifts, None))
            continue
        if len(shifts) != len(points) or points.min() < 0 or points.max() >= count or len(turns) not in (0, len(points)):
            raise InputError(f"offsets do not fit the {count} points of {usd_mesh.GetPath()}", field=str(shape.GetPath()))
        targets.append((points, shifts, turns if len(turns) else None))
    moves = animation.BlendShapeWeightsMightBeTimeVarying()
    return BlendShapes(animation=animation, skinning=query, query=shapes, targets=tuple(targets), moves=moves)


def sampled(attribute: Usd.Attribute, code: Usd.TimeCode) -> NDArray[np.float64]:
    """An array of vectors [n, 3] at a time, interpolated linearly between its samples (UsdGeom), in float64."""
    held = attribute.GetStage().GetInterpolationType() == Usd.InterpolationTypeHeld
    bracket = attribute.GetBracketingTimeSamples(code.GetValue())
    if held or not bracket or bracket[0] == bracket[1]:
        return vectors(attribute, code)
    before, after = (vectors(attribute, time) for time in bracket)
    if len(before) != len(after):
        return before
    return before + (after - before) * ((code.GetValue() - bracket[0]) / (bracket[1] - bracket[0]))


def pose(deformation: Deformation, code: Usd.TimeCode) -> Pose:
    """The mesh at a time. Raises InputError naming the prim where its points are not finite."""
    points = sampled(UsdGeom.Mesh(deformation.prim).GetPointsAttr(), code)
    offsets = matrices = None
    if deformation.shapes is not None:
        points, offsets = _blended_shapes(deformation.shapes, points, code)
    skin = deformation.skin
    if skin is not None and not skin.rigid:
        joints = _skeleton_from_mesh(skin, code)
        blended = _blended(skin, joints[:, :3].reshape(-1, 12), len(points)).reshape(-1, 3, 4)
        points = np.einsum("pij,pj->pi", blended[:, :, :3], points) + blended[:, :, 3]
        matrices = _blended(skin, _normal_matrices(joints).reshape(-1, 9), len(points)).reshape(-1, 3, 3)
    if not (np.abs(points) < np.finfo(np.float32).max).all():
        raise InputError(f"points are not finite at time code {code.GetValue():g}", field=str(deformation.prim.GetPath()))
    points = deformation.surface.drawn(points)
    return Pose(points=points, smooth=deformation.surface.normals(points), normal_offsets=offsets, normal_matrices=matrices)


def object_matrix(deformation: Deformation, code: Usd.TimeCode) -> NDArray[np.float64]:
    """Matrix [4, 4] from object space to the space of the anchor."""
    skin = deformation.skin
    matrix = np.eye(4)
    if skin is not None and skin.rigid:
        matrix[:3] = _blended(skin, _skeleton_from_mesh(skin, code)[:, :3].reshape(-1, 12), 1).reshape(3, 4)
    elif skin is not None:
        matrix[:3, 3] = skin.origin
    return matrix


def _blended_shapes(shapes: BlendShapes, points: NDArray, code: Usd.TimeCode) -> tuple[NDArray, NDArray | None]:
    weights = shapes.skinning.GetBlendShapeMapper().Remap(shapes.animation.ComputeBlendShapeWeights(code))
    sub_weights, _, indices = shapes.query.ComputeSubShapeWeights(weights)
    normal_offsets = None
    for weight, index in zip(sub_weights, indices, strict=True):
        chosen, offsets, turns = shapes.targets[index]
        if weight == 0:
            continue
        np.add.at(points, chosen, weight * offsets)
        if turns is not None:
            normal_offsets = np.zeros_like(points) if normal_offsets is None else normal_offsets
            np.add.at(normal_offsets, chosen, weight * turns)
    return points, normal_offsets


def _skeleton_from_mesh(skin: Skin, code: Usd.TimeCode) -> NDArray[np.float64]:
    """For each joint in the order of the mesh: where it takes the mesh's points, [joints, 4, 4], less the skin's origin."""
    transforms = skin.skeleton.ComputeSkinningTransforms(code)
    mapper = skin.query.GetJointMapper()
    if mapper:
        transforms = mapper.RemapTransforms(transforms, Vt.Matrix4dArray())
    bind = np.array(skin.query.GetGeomBindTransform(code))
    matrices = (bind @ np.array(transforms).reshape(-1, 4, 4)).transpose(0, 2, 1)
    if any(joints.max() >= len(matrices) for _, joints, _ in skin.ranks):  # USD gives none where a pose does not fit
        raise InputError("its pose has fewer joints than are used", field=str(skin.skeleton.GetPrim().GetPath()))
    matrices[:, :3, 3] -= skin.origin
    return matrices


def _normal_matrices(matrices: NDArray) -> NDArray[np.float64]:
    """Inverse transposes [n, 3, 3] of the linear parts; of singular ones the cofactors, which have the same direction."""
    a, b, c = np.moveaxis(matrices[:, :3, :3], 2, 0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
    determinant = np.sum(a * cofactors[:, :, 0], axis=1)
    return cofactors / np.where(determinant == 0, 1, determinant)[:, None, None]


def _blended(skin: Skin, rows: NDArray, count: int) -> NDArray[np.float64]:
    """Sum over the influences of weight * row of the joint: [count, k] from rows [joints, k]."""
    out = np.zeros((count, rows.shape[1]))
    for points, joints, weights in skin.ranks:
        contribution = rows[joints] * weights[:, None]
        if len(points) == count:
            out += contribution
        else:
            out[points] += contribution
    return out


def deformed_vertices(deformation: Deformation, now: Pose, source: VertexSource, code: Usd.TimeCode) -> Deformed:
    """The vertices of one part of the mesh in its pose: a gather. Normals are recomputed where none are authored."""
    positions = now.points.astype(np.float32)[source.point]
    if source.group is not None:
        return Deformed(positions=positions, normals=now.smooth[source.group])
    if source.normals is None:
        return Deformed(positions=positions)
    normals = sampled(source.normals, code)[source.normal]
    if now.normal_offsets is not None:
        normals = normals + now.normal_offsets[source.point]
    if now.normal_matrices is not None:
        normals = np.einsum("vij,vj->vi", now.normal_matrices[source.point], normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return Deformed(positions=positions, normals=(normals / np.where(lengths > 0, lengths, 1)).astype(np.float32))
