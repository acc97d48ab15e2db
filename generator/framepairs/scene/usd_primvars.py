"""Primvars of USD meshes at the corners that are drawn: constant, uniform, varying, vertex or face-varying, indexed or not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from ..errors import InputError
from .usd_arrays import EARLIEST
from .usd_subdivision import refine, value_net
from .usd_surfaces import Surface

LINEAR_RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")


@dataclass(frozen=True, kw_only=True)
class CornerValues:
    """values: [N, k] float32. element: [C] which of them each drawn corner takes."""

    values: NDArray[np.float32]
    element: NDArray[np.int64]


def primvar_of(surface: Surface, name: str) -> UsdGeom.Primvar | None:
    """A primvar with values, of the mesh itself or, where constant, of a prim above it."""
    found = UsdGeom.PrimvarsAPI(surface.mesh).FindPrimvarWithInheritance(name)
    return found if found and found.HasValue() else None


def corner_values(surface: Surface, name: str, width: int) -> CornerValues | None:
    """The first `width` components of a primvar at the drawn corners, refined with the surface; None where there is none.

    Raises InputError naming the prim where it does not fit the mesh or is not finite.
    """
    if (name, width) not in surface.known:
        primvar = primvar_of(surface, name)
        surface.known[name, width] = _read(surface, primvar, width) if primvar else None
    return surface.known[name, width]


def _read(surface: Surface, primvar: UsdGeom.Primvar, width: int) -> CornerValues:
    name = primvar.GetPrimvarName()
    try:
        values = np.array(primvar.Get(EARLIEST), dtype=np.float32)
    except (TypeError, ValueError):
        raise InputError(f"primvar {name} is of type {primvar.GetTypeName()}", field=surface.path) from None
    listed = values.ndim > 0 and primvar.GetTypeName().isArray
    rows = values.reshape(len(values) if listed else 1, -1) if values.size else np.zeros((0, width))
    if rows.size and rows.shape[1] < width:
        raise InputError(f"primvar {name} has {rows.shape[1]} components, {width} are needed", field=surface.path)
    if not np.isfinite(rows).all():
        raise InputError(f"primvar {name} is not finite", field=surface.path)
    rows = rows[:, :width].astype(np.float32)
    indices = np.array(primvar.GetIndices(EARLIEST), dtype=np.int64) if primvar.IsIndexed() else None
    interpolation = str(primvar.GetInterpolation())
    element = elements_at_corners(surface, len(rows), indices, interpolation, name)
    if interpolation == "faceVarying":
        found = distinct(rows, element)
        return found if surface.refinement is None else _refined_face_varying(surface, found)
    if surface.refinement is None or interpolation in ("constant", "uniform"):
        return CornerValues(values=rows, element=element)
    return _refined_at_points(surface, rows, element, linear=interpolation == "varying")


def elements_at_corners(
    surface: Surface, size: int, indices: NDArray[np.int64] | None, interpolation: str, name: str
) -> NDArray[np.int64]:
    """Which of `size` elements each corner takes: each drawn corner [C] for constant and uniform data, else each corner of
    the control mesh. indices: into them, or None.

    Raises InputError naming the prim where they do not fit the mesh.
    """
    if interpolation == "constant":
        place = np.zeros(len(surface.point), np.int64)
    elif interpolation == "uniform":
        place = np.repeat(np.maximum(surface.of_face, 0), surface.counts)
    elif interpolation == "faceVarying":
        place = surface.corner
    elif interpolation in ("vertex", "varying"):
        place = surface.net.vertex
    else:
        raise InputError(f"primvar {name} has the unknown interpolation {interpolation}", field=surface.path)
    laid_out = size if indices is None else len(indices)
    if place.max(initial=-1) >= laid_out:
        problem = f"{interpolation} primvar {name} has {laid_out} values, {place.max() + 1} are needed"
        raise InputError(problem, field=surface.path)
    if indices is None:
        return place
    if indices.size and (indices.min() < 0 or indices.max() >= size):
        wrong = indices.max() if indices.max() >= size else indices.min()
        raise InputError(f"index {wrong} of primvar {name} with only {size} values", field=surface.path)
    return indices[place]


def _refined_at_points(surface: Surface, values: NDArray, element: NDArray, linear: bool) -> CornerValues:
    """Values of the points of the control mesh, refined as these are, or linearly."""
    net = surface.net
    at_points = np.zeros((net.size, values.shape[1]))
    at_points[net.vertex] = values[element]
    refinement = refine(net, surface.levels, surface.scheme, linear=True) if linear else surface.refinement
    return CornerValues(values=refinement(at_points).astype(np.float32), element=surface.point)


def distinct(values: NDArray[np.float32], element: NDArray[np.int64]) -> CornerValues:
    """Values at corners with equal ones as one: files without indices repeat them at every corner."""
    rank = np.zeros(len(values), np.int64)
    for column in (values + np.float32(0)).T:  # -0 becomes 0
        own = np.unique(column, return_inverse=True)[1]
        rank = np.unique(rank * (int(own.max(initial=0)) + 1) + own, return_inverse=True)[1]
    _, first = np.unique(rank, return_index=True)
    return CornerValues(values=values[first], element=rank[element])


def _refined_face_varying(surface: Surface, given: CornerValues) -> CornerValues:
    """Values that are refined with the surface, or linearly at seams and corners (faceVaryingLinearInterpolation)."""
    rule = str(surface.mesh.GetFaceVaryingLinearInterpolationAttr().Get(EARLIEST))
    if rule not in LINEAR_RULES:
        raise InputError(f"unknown faceVaryingLinearInterpolation {rule}", field=surface.path)
    net, element = value_net(surface.net, given.element, rule)
    smooth_triangles = str(surface.mesh.GetTriangleSubdivisionRuleAttr().Get(EARLIEST)) == "smooth"
    refinement = refine(net, surface.levels, surface.scheme, linear=rule == "all", smooth_triangles=smooth_triangles)
    values = refinement(given.values[element].astype(np.float64)).astype(np.float32)
    return CornerValues(values=values, element=refinement.corners.reshape(-1))
