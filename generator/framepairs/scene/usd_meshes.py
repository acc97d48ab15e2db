"""Triangles of UsdGeomMesh prims: fans, primvars at the corners, merged vertices and where each comes from."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from ..errors import InputError
from .description import Mesh, validate_mesh
from .usd_materials import MaterialReader


@dataclass(frozen=True, kw_only=True)
class MeshPart:
    """Faces of a prim that share a material. name: path of the prim and name of the subset. key: equal for the same part of
    two instances of one prototype. faces: [F] face indices."""

    mesh: UsdGeom.Mesh
    name: str
    material: int
    key: tuple
    faces: NDArray[np.int64]
    uv_name: str


@dataclass(frozen=True, kw_only=True)
class Corners:
    """Triangles of a part as indices into what its prim holds.

    points: [T, 3]. normals: attribute of the authored normals, or None; normal: [T, 3] indices into it. smooth: normals are
    to be made from the triangles. uv: [T, 3, 2] float32 or None.
    """

    points: NDArray[np.int64]
    normals: Usd.Attribute | None
    normal: NDArray[np.int64] | None
    smooth: bool
    uv: NDArray[np.float32] | None


@dataclass(frozen=True, kw_only=True)
class VertexSource:
    """Where the vertices of a Mesh come from. point: [V] point of the prim. normal: [V] element of the authored normals, or
    None. triangles: [T, 3] points of the prim where normals are made from them, else None."""

    point: NDArray[np.int64]
    normals: Usd.Attribute | None
    normal: NDArray[np.int64] | None
    triangles: NDArray[np.int64] | None


def mesh_parts(usd_mesh: UsdGeom.Mesh, reader: MaterialReader, not_read: list[str]) -> Iterator[MeshPart]:
    """The material subsets of a mesh and the faces in none. Raises InputError naming the prim."""
    prim = usd_mesh.GetPrim()
    path = str(prim.GetPath())
    shared = str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
    count = len(_face_counts(usd_mesh))
    if not count:
        return
    _check_topology(usd_mesh)
    if usd_mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none and (_face_counts(usd_mesh) != 3).any():
        not_read.append(f"subdivision of {path}: its control mesh is drawn")
    rest = np.ones(count, dtype=bool)
    selections: list[tuple[str, Usd.Prim, NDArray]] = []
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        faces = np.array(subset.GetIndicesAttr().Get() or (), dtype=np.int64)
        if len(faces) and (faces.min() < 0 or faces.max() >= count):
            raise InputError("subset names a face that the mesh has not", field=str(subset.GetPath()))
        rest[faces] = False
        selections.append((subset.GetPrim().GetName(), subset.GetPrim(), faces))
    if rest.any():
        selections.append(("", prim, np.flatnonzero(rest)))
    for name, bound, faces in selections:
        material = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()[0]
        index = reader.material_index(material if material else None)
        if not material and UsdGeom.Gprim(prim).GetDisplayColorAttr().HasAuthoredValue():
            not_read.append(f"displayColor of {path}: it is drawn grey")
        uv_name = reader.uv_names.get(index, "st")
        part = f"{path}/{name}" if name else path
        yield MeshPart(
            mesh=usd_mesh, name=part, material=index, key=(shared, name, uv_name), faces=faces, uv_name=uv_name
        )  # fmt: skip


def _face_counts(usd_mesh: UsdGeom.Mesh) -> NDArray[np.int64]:
    return np.array(usd_mesh.GetFaceVertexCountsAttr().Get(Usd.TimeCode.EarliestTime()) or (), dtype=np.int64)


def _check_topology(usd_mesh: UsdGeom.Mesh) -> None:
    """Raises InputError where faces, or the number of points, differ from one time sample to another."""
    path = str(usd_mesh.GetPath())
    for attribute in (usd_mesh.GetFaceVertexCountsAttr(), usd_mesh.GetFaceVertexIndicesAttr()):
        times = attribute.GetTimeSamples() if attribute.ValueMightBeTimeVarying() else []
        for time in times[1:]:
            if not np.array_equal(attribute.Get(time) or (), attribute.Get(times[0]) or ()):
                raise InputError(f"its faces change at time code {time:g}: only points may move", field=path)
    points = usd_mesh.GetPointsAttr()
    times = points.GetTimeSamples() if points.ValueMightBeTimeVarying() else []
    sizes = [len(points.Get(time) or ()) for time in times]
    for time, size in zip(times, sizes, strict=True):
        if size != sizes[0]:
            raise InputError(f"{size} points at time code {time:g}, {sizes[0]} at the first", field=path)


def part_corners(part: MeshPart) -> Corners:
    """The triangles of a part. Raises InputError naming it where indices do not fit."""
    usd_mesh, name = part.mesh, part.name
    time = Usd.TimeCode.EarliestTime()
    counts = _face_counts(usd_mesh)
    points = len(usd_mesh.GetPointsAttr().Get(time) or ())
    indices = np.array(usd_mesh.GetFaceVertexIndicesAttr().Get(time) or (), dtype=np.int64)
    if counts.min() < 0 or counts.sum() != len(indices):
        raise InputError(f"face counts ask for {counts.sum()} indices, there are {len(indices)}", field=name)
    if len(indices) and (indices.min() < 0 or indices.max() >= points):
        raise InputError(f"face index {indices.max()} with only {points} points", field=name)
    corner, face = _fan(counts, part.faces)
    if usd_mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        corner, face = corner[:, ::-1], face[:, ::-1]
    api = UsdGeom.PrimvarsAPI(usd_mesh)
    normals, normal = None, None
    primvar = api.GetPrimvar("normals")
    if primvar and primvar.HasValue():
        normals = primvar.GetAttr()
        size = len(normals.Get(time))
        elements = np.array(primvar.GetIndices(time), dtype=np.int64) if primvar.IsIndexed() else np.arange(size)
        normal = elements[_lookup(len(elements), str(primvar.GetInterpolation()), corner, face, indices, name)]
        if normal.size and (normal.min() < 0 or normal.max() >= size):
            raise InputError(f"index {normal.max()} with only {size} normals", field=name)
    elif usd_mesh.GetNormalsAttr().Get(time):
        normals = usd_mesh.GetNormalsAttr()
        interpolation = str(usd_mesh.GetNormalsInterpolation())
        normal = _lookup(len(normals.Get(time)), interpolation, corner, face, indices, name)
    uv = None
    primvar = api.GetPrimvar(part.uv_name)
    if primvar and primvar.HasValue():
        flat = primvar.ComputeFlattened(time)
        values = np.array(flat, dtype=np.float32).reshape(len(flat), -1)[:, :2]
        uv = values[_lookup(len(values), str(primvar.GetInterpolation()), corner, face, indices, name)]
    smooth = normals is None and usd_mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none
    return Corners(points=indices[corner], normals=normals, normal=normal, smooth=smooth, uv=uv)


def _fan(counts: NDArray, faces: NDArray) -> tuple[NDArray, NDArray]:
    """Corner indices [T, 3] of fan triangles of the chosen faces, and the face [T, 3] each corner belongs to."""
    starts = np.concatenate([[0], np.cumsum(counts)])[faces]
    inner = np.maximum(counts[faces] - 2, 0)
    start, face = np.repeat(starts, inner), np.repeat(faces, inner)
    step = np.arange(len(start)) - np.repeat(np.cumsum(inner) - inner, inner)
    return np.stack([start, start + step + 1, start + step + 2], axis=1), np.stack([face] * 3, axis=1)


def _lookup(size: int, interpolation: str, corner: NDArray, face: NDArray, indices: NDArray, name: str) -> NDArray:
    """Element [T, 3] of a primvar of `size` elements that each corner takes."""
    lookup = {
        "constant": np.zeros_like(corner),
        "uniform": face,
        "vertex": indices[corner],
        "varying": indices[corner],
        "faceVarying": corner,
    }[interpolation]
    if lookup.size and lookup.max() >= size:
        raise InputError(f"{interpolation} primvar has {size} values, {lookup.max() + 1} are needed", field=name)
    return lookup


def still_mesh(part: MeshPart) -> Mesh:
    """The Mesh of a part that keeps its shape, with equal corners merged."""
    corners = part_corners(part)
    time = Usd.TimeCode.EarliestTime()
    points = np.array(part.mesh.GetPointsAttr().Get(time) or (), dtype=np.float32).reshape(-1, 3)
    normals = None
    if corners.normals is not None:
        normals = np.array(corners.normals.Get(time), dtype=np.float32)[corners.normal]
    elif corners.smooth:
        normals = vertex_normals(points, corners.points)[corners.points]
    return checked(_indexed(part.name, points[corners.points], normals, corners.uv))


def checked(mesh: Mesh) -> Mesh:
    """The mesh itself. Raises InputError naming it where its values are not finite."""
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, field=mesh.name)
    return mesh


def vertex_normals(points: NDArray, triangles: NDArray) -> NDArray[np.float32]:
    """Area-weighted normals [V, 3] of points [V, 3] with triangles [T, 3]; zero where a point belongs to no area."""
    corners = points.astype(np.float64).take(triangles.T, axis=0)
    ab, ac = (corners[1] - corners[0]).T, (corners[2] - corners[0]).T
    weighted = ab[[1, 2, 0]] * ac[[2, 0, 1]] - ab[[2, 0, 1]] * ac[[1, 2, 0]]
    order = triangles.T.reshape(-1)
    sums = np.stack([np.bincount(order, np.tile(axis, 3), len(points)) for axis in weighted], axis=1)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return (sums / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def _indexed(name: str, positions: NDArray, normals: NDArray | None, uv: NDArray | None) -> Mesh:
    """A mesh from corner values [T, 3, k], with equal corners merged."""
    parts = [array.reshape(-1, array.shape[-1]) for array in (positions, normals, uv) if array is not None]
    corners = np.ascontiguousarray(np.concatenate(parts, axis=1))
    unique, inverse = np.unique(corners, axis=0, return_inverse=True) if len(corners) else (corners, np.zeros(0, int))
    columns = iter(np.split(unique, np.cumsum([part.shape[1] for part in parts])[:-1], axis=1))
    return Mesh(
        name=name,
        positions=np.ascontiguousarray(next(columns)),
        normals=np.ascontiguousarray(next(columns)) if normals is not None else None,
        uv=np.ascontiguousarray(next(columns)) if uv is not None else None,
        faces=inverse.reshape(-1, 3).astype(np.uint32),
    )


def moving_mesh(part: MeshPart) -> tuple[Mesh, VertexSource]:
    """A Mesh whose positions and normals are still to be set, and where they come from.

    Corners are merged where they share the point and have equal normals and uv: two points of one place may part later.
    """
    corners = part_corners(part)
    columns = [corners.points.reshape(-1)]
    normal = corners.normal
    if normal is not None and not corners.normals.ValueMightBeTimeVarying():
        values = np.array(corners.normals.Get(Usd.TimeCode.EarliestTime()), dtype=np.float32)
        _, first, rank = np.unique(values, axis=0, return_index=True, return_inverse=True)
        normal = first[rank.reshape(-1)][normal]
    columns += [normal.reshape(-1)] if normal is not None else []
    if corners.uv is not None:
        columns += list(corners.uv.reshape(-1, 2).T)
    first, faces = _merged(columns)
    source = VertexSource(
        point=columns[0][first],
        normals=corners.normals,
        normal=columns[1][first] if normal is not None else None,
        triangles=corners.points if corners.smooth else None,
    )
    uv = corners.uv.reshape(-1, 2)[first] if corners.uv is not None else None
    unset = np.zeros((len(first), 3), np.float32)
    return Mesh(name=part.name, positions=unset, faces=faces.reshape(-1, 3).astype(np.uint32), uv=uv), source


def _merged(columns: list[NDArray]) -> tuple[NDArray, NDArray]:
    """First row of each set of equal rows, and the set [rows] of every row."""
    group = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        rank = np.unique(column, return_inverse=True)[1].reshape(-1)
        group = np.unique(group * (rank.max(initial=0) + 1) + rank, return_inverse=True)[1].reshape(-1)
    return np.unique(group, return_index=True)[1], group


def with_vertices(mesh: Mesh, positions: NDArray, normals: NDArray | None, deforms: bool) -> Mesh:
    """The mesh with its vertices set. Raises InputError where they are not finite."""
    return checked(replace(mesh, positions=positions, normals=normals, deforms=deforms))
