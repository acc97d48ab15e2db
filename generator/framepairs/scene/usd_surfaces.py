"""The polygons that are drawn of a UsdGeomMesh: those of the file, or those of its refined subdivision surface."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom
from scipy.sparse import csr_array

from ..errors import InputError
from .usd_arrays import EARLIEST, CornerBudget, integers, numbers, vectors
from .usd_subdivision import Refinement, refine, refined_corners, smooth_groups
from .usd_subdivision_steps import INFINITE, Net, crease_sharpness, net_of

MOST_FACES = 2**24
SMOOTH_SCHEMES = ("catmullClark", "loop")
SCHEMES = ("none", "bilinear", *SMOOTH_SCHEMES)


@dataclass(frozen=True, kw_only=True)
class Smooth:
    """Normals that are made from the faces. group: [C] the normal that a drawn corner takes; sums: [G, F] the faces that
    meet in each of them."""

    group: NDArray[np.int64]
    sums: csr_array


@dataclass(frozen=True, kw_only=True)
class Surface:
    """What is drawn of a mesh prim.

    faces_in_file: their number. counts: corners [F] of each drawn face; point: [C] the drawn point of each drawn corner, of
    `size` in all. of_face: [F] the face of the file that it comes from, -1 for holes. corner: [K] the corners of the file's
    faces of three corners and more, net: these faces; refinement: None where they are drawn themselves. left_handed: faces
    are clockwise from outside. known: values at corners that were read so far, by their names.
    """

    mesh: UsdGeom.Mesh
    faces_in_file: int
    counts: NDArray[np.int64]
    point: NDArray[np.int64]
    size: int
    of_face: NDArray[np.int64]
    corner: NDArray[np.int64]
    net: Net
    levels: int
    scheme: str
    refinement: Refinement | None
    smooth: Smooth | None
    left_handed: bool
    known: dict = field(default_factory=dict)

    @property
    def path(self) -> str:
        return str(self.mesh.GetPath())

    @cached_property
    def rest(self) -> tuple[NDArray[np.float64], NDArray[np.float32] | None]:
        """Drawn points and smooth normals at the earliest time. Raises InputError where points are not finite."""
        points = vectors(self.mesh.GetPointsAttr())
        if not np.isfinite(points).all():
            raise InputError("points are not finite", field=self.path)
        drawn = self.drawn(points)
        return drawn, self.normals(drawn)

    def drawn(self, points: NDArray) -> NDArray:
        """The drawn points [size, 3] from those of the prim."""
        return points if self.refinement is None else self.refinement(points)

    def normals(self, drawn: NDArray[np.float64]) -> NDArray[np.float32] | None:
        """Area-weighted normals [G, 3] of the groups of `smooth` from the drawn points; zero where there is no area."""
        if self.smooth is None:
            return None
        sums = self.smooth.sums @ _vector_areas(self.counts, self.point, drawn)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        sums *= -1 if self.left_handed else 1
        return (sums / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def _vector_areas(counts: NDArray, point: NDArray, drawn: NDArray) -> NDArray[np.float64]:
    """Twice the vector area [F, 3] of each face."""
    if len(counts) and (counts == 4).all():
        a, b, c, d = drawn[point].reshape(-1, 4, 3).transpose(1, 2, 0)
        return _cross(c - a, d - b).T
    face, starts = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    arms = (drawn[point] - drawn[point[starts]][face]).T
    following = np.roll(arms, -1, axis=1)  # the last arm meets the next face's first, which is zero
    weighted = _cross(arms, following)
    return np.stack([np.bincount(face, axis, len(counts)) for axis in weighted], axis=1)


def _cross(a: NDArray, b: NDArray) -> NDArray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def read_surface(
    usd_mesh: UsdGeom.Mesh, levels: int, not_read: list[str], budget: CornerBudget | None = None
) -> Surface | None:
    """The surface of a mesh, refined `levels` times where it is a subdivision surface; None where it has no faces.

    A mesh that has normals and does not name its scheme is taken for polygons: exporters leave the scheme out. Raises
    InputError naming the prim where its topology does not fit or changes, or where it is beyond the budget.
    """
    path = str(usd_mesh.GetPath())
    counts, indices, size = _topology(usd_mesh)
    long_enough = counts >= 3
    if not long_enough.any():
        not_read.append(f"mesh {path}: it has no faces")
        return None
    scheme, levels = _scheme(usd_mesh, counts[long_enough], levels, not_read)
    if budget is not None:
        budget.spend(int(counts[long_enough].sum()) * 4**levels, path)
    corner = np.flatnonzero(np.repeat(long_enough, counts))
    net = _sharpened(usd_mesh, counts[long_enough], indices[corner], size, scheme, not_read)
    refinement = None
    if levels:
        triangles = str(usd_mesh.GetTriangleSubdivisionRuleAttr().Get(EARLIEST)) == "smooth"
        refinement = refine(net, levels, scheme, smooth_triangles=triangles)
    faces = np.flatnonzero(long_enough)
    of_face = faces if refinement is None else faces[refinement.face]
    point = net.vertex if refinement is None else refinement.corners.reshape(-1)
    smooth = _smooth(net, scheme, levels, len(of_face)) if _is_smooth(usd_mesh, scheme) else None
    return Surface(
        mesh=usd_mesh,
        faces_in_file=len(counts),
        counts=net.counts if refinement is None else np.full(len(of_face), refinement.corners.shape[1]),
        point=point,
        size=size if refinement is None else refinement.size,
        of_face=_without_holes(usd_mesh, of_face, net, faces, levels),
        corner=corner,
        net=net,
        levels=levels,
        scheme=scheme,
        refinement=refinement,
        smooth=smooth,
        left_handed=usd_mesh.GetOrientationAttr().Get(EARLIEST) == UsdGeom.Tokens.leftHanded,
    )


def _topology(usd_mesh: UsdGeom.Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Face counts and indices, which fit each other and the number of points, which is the third."""
    path = str(usd_mesh.GetPath())
    for attribute in (usd_mesh.GetFaceVertexCountsAttr(), usd_mesh.GetFaceVertexIndicesAttr()):
        times = attribute.GetTimeSamples() if attribute.ValueMightBeTimeVarying() else []
        for time in times[1:]:
            if not np.array_equal(integers(attribute, time), integers(attribute, times[0])):
                raise InputError(f"its faces change at time code {time:g}: only points may move", field=path)
    points = usd_mesh.GetPointsAttr()
    times = points.GetTimeSamples() if points.ValueMightBeTimeVarying() else []
    sizes = [len(vectors(points, time)) for time in times]
    for time, size in zip(times, sizes, strict=True):
        if size != sizes[0]:
            raise InputError(f"{size} points at time code {time:g}, {sizes[0]} at the first", field=path)
    counts = integers(usd_mesh.GetFaceVertexCountsAttr())
    indices = integers(usd_mesh.GetFaceVertexIndicesAttr())
    size = len(vectors(points))
    if counts.min(initial=0) < 0 or counts.sum() != len(indices):
        raise InputError(f"face counts ask for {counts.sum()} indices, there are {len(indices)}", field=path)
    if len(indices) and (indices.min() < 0 or indices.max() >= size):
        wrong = indices.max() if indices.max() >= size else indices.min()
        raise InputError(f"face index {wrong} with only {size} points", field=path)
    return counts, indices, size


def has_normals(usd_mesh: UsdGeom.Mesh) -> bool:
    primvar = UsdGeom.PrimvarsAPI(usd_mesh).GetPrimvar("normals")
    return bool(primvar and primvar.HasValue()) or len(vectors(usd_mesh.GetNormalsAttr())) > 0


def _is_smooth(usd_mesh: UsdGeom.Mesh, scheme: str) -> bool:
    return scheme != "none" and not (scheme == "polygons" and has_normals(usd_mesh))


def _scheme(usd_mesh: UsdGeom.Mesh, counts: NDArray, levels: int, not_read: list[str]) -> tuple[str, int]:
    """The scheme, `polygons` where its polygons are drawn with the normals of the file, and how often it is refined."""
    path, attribute = str(usd_mesh.GetPath()), usd_mesh.GetSubdivisionSchemeAttr()
    scheme = str(attribute.Get(EARLIEST))
    if scheme == "none":
        return "none", 0
    if scheme not in SCHEMES:
        not_read.append(f"subdivision scheme {scheme} of {path}: its polygons are drawn")
        return "none", 0
    if has_normals(usd_mesh) and not (levels and attribute.HasAuthoredValue()):
        not_read.append(f"subdivision of {path}: it has normals, its polygons are drawn")
        return "polygons", 0
    if not levels:
        not_read.append(f"subdivision of {path}: its control mesh is drawn")
        return "none" if scheme == "bilinear" else "polygons", 0
    if scheme == "loop" and (counts != 3).any():
        not_read.append(f"Loop subdivision of {path}: it has faces that are no triangles, its control mesh is drawn")
        return "polygons", 0
    number = max(len(counts) * 4**levels, int(counts.sum()) * 4 ** (levels - 1))
    if number > MOST_FACES:
        raise InputError(f"{len(counts)} faces refined {levels} times are {number}, more than {MOST_FACES}", field=path)
    return scheme, levels


def _sharpened(usd_mesh: UsdGeom.Mesh, counts: NDArray, vertex: NDArray, size: int, scheme: str, not_read: list[str]) -> Net:
    """The net of a mesh with its creases and corners; those that do not fit the mesh are left out and named."""
    if scheme == "none":
        none, smooth = np.zeros(0, np.int64), np.zeros(0)
        ends = none.reshape(-1, 2)
        return Net(
            counts=counts, vertex=vertex, size=size, edge=none, ends=ends, edge_sharpness=smooth, vertex_sharpness=smooth
        )  # fmt: skip
    path = str(usd_mesh.GetPath())
    edges, sharpness = _creases(usd_mesh, size)
    if edges is None:
        not_read.append(f"creases of {path}: they do not fit it and are left out")
    corner_sharpness = np.zeros(len(vertex))
    if edges is not None and len(edges):
        corner_sharpness = crease_sharpness(counts, vertex, size, edges, sharpness)
    corners = integers(usd_mesh.GetCornerIndicesAttr())
    values = numbers(usd_mesh.GetCornerSharpnessesAttr())
    pinned = np.zeros(size)
    if len(corners) != len(values) or (len(corners) and not 0 <= corners.min() <= corners.max() < size):
        not_read.append(f"corners of {path}: they do not fit it and are left out")
    else:
        np.maximum.at(pinned, corners, np.clip(np.nan_to_num(values), 0, INFINITE))
    if usd_mesh.GetInterpolateBoundaryAttr().Get(EARLIEST) == UsdGeom.Tokens.edgeAndCorner:
        pinned[np.bincount(vertex, minlength=size) == 1] = INFINITE
    return net_of(counts, vertex, size, corner_sharpness, pinned)


def _creases(usd_mesh: UsdGeom.Mesh, size: int) -> tuple[NDArray[np.int64] | None, NDArray[np.float64]]:
    """Creased edges [K, 2] and their sharpness [K]; None for what does not fit."""
    indices, lengths = integers(usd_mesh.GetCreaseIndicesAttr()), integers(usd_mesh.GetCreaseLengthsAttr())
    sharpness = np.nan_to_num(numbers(usd_mesh.GetCreaseSharpnessesAttr()))
    fits = lengths.min(initial=2) >= 2 and lengths.sum() == len(indices)
    per_edge = lengths - 1
    fits = fits and len(sharpness) in (len(lengths), per_edge.sum())
    if not fits or (len(indices) and not 0 <= indices.min() <= indices.max() < size):
        return None, sharpness
    first = np.ones(len(indices), bool)
    first[np.cumsum(lengths) - 1] = False
    edges = np.stack([indices[first], indices[np.flatnonzero(first) + 1]], axis=1).reshape(-1, 2)
    of_edge = sharpness if len(sharpness) == per_edge.sum() else np.repeat(sharpness, per_edge)
    return edges, np.clip(of_edge, 0, INFINITE)


def _smooth(net: Net, scheme: str, levels: int, drawn_faces: int) -> Smooth | None:
    """Which corners share a normal: none across edges that are still sharp after all levels; the faces of a bilinear surface
    are smooth inside alone."""
    if scheme == "bilinear":
        labels = np.arange(len(net.vertex))
    else:
        labels = smooth_groups(net, min(levels + 1, INFINITE))
    count = int(labels.max(initial=-1)) + 1
    if levels:
        fresh = net_of(net.counts, labels, count, np.zeros(len(labels)), np.zeros(count))
        corners = refined_corners(fresh, levels, scheme)
        group, face = corners.reshape(-1), np.repeat(np.arange(drawn_faces), corners.shape[1])
    else:
        group, face = labels, net.face
    order = np.argsort(group, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(group))])
    sums = csr_array((np.ones(len(group)), face[order], starts), shape=(len(starts) - 1, drawn_faces))
    return Smooth(group=group, sums=sums)


def _without_holes(usd_mesh: UsdGeom.Mesh, of_face: NDArray, net: Net, faces: NDArray, levels: int) -> NDArray[np.int64]:
    """`of_face` with -1 where a face is a hole, or lies on a boundary that is not interpolated."""
    if usd_mesh.GetSubdivisionSchemeAttr().Get(EARLIEST) == UsdGeom.Tokens.none:
        return of_face
    hidden = integers(usd_mesh.GetHoleIndicesAttr())
    if levels and usd_mesh.GetInterpolateBoundaryAttr().Get(EARLIEST) == UsdGeom.Tokens.none:
        on_boundary = np.zeros(net.size, bool)
        on_boundary[net.ends[net.faces_at == 1]] = True
        touching = np.bincount(net.face, on_boundary[net.vertex], len(net.counts)) > 0
        hidden = np.concatenate([hidden, faces[touching]])
    return np.where(np.isin(of_face, hidden), -1, of_face) if len(hidden) else of_face
