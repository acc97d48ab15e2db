"""Meshes of UsdGeomMesh prims: their parts by material, triangles, merged vertices and where each vertex comes from."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from ..errors import InputError
from .description import Mesh, validate_mesh
from .polygons import fan, merged
from .usd_arrays import EARLIEST, integers, vectors
from .usd_materials import MaterialReader
from .usd_primvars import CornerValues, corner_values, distinct, elements_at_corners, primvar_of
from .usd_surfaces import Surface, has_normals

GREY = (0.8, 0.8, 0.8)  # the default material's
OPAQUE = 1 - 2.0**-9  # an opacity that half of an 8-bit step parts from 1


@dataclass(frozen=True, kw_only=True)
class MeshPart:
    """Faces of a prim that share a material. name: path of the prim and name of the subset. key: equal for the same part of
    two instances of one prototype. faces: [F] drawn faces. uv_names: primvars of one or two sets of texture coordinates.
    color, opacity: the primvar, its fallback where the mesh has none, or None where the material does not ask for it."""

    surface: Surface
    name: str
    material: int
    key: tuple
    faces: NDArray[np.int64]
    uv_names: tuple[str, ...]
    color: tuple[str, tuple[float, ...]] | None
    opacity: tuple[str, float] | None


@dataclass(frozen=True, kw_only=True)
class VertexSource:
    """Where the vertices of a Mesh come from. point: [V] drawn point of the surface. group: [V] smooth normal of the surface,
    or None. normals: attribute of the authored normals, normal: [V] element of it; None where there are none."""

    surface: Surface
    point: NDArray[np.int64]
    group: NDArray[np.int64] | None
    normals: Usd.Attribute | None
    normal: NDArray[np.int64] | None


def shape_key(prim: Usd.Prim) -> tuple[str, ...]:
    """Equal for mesh prims of one shape: two instances of a prototype, unless they inherit primvars from outside it."""
    if not prim.IsInstanceProxy():
        return (str(prim.GetPath()),)
    above = UsdGeom.PrimvarsAPI(prim.GetParent()).FindInheritablePrimvars()
    outside = [item.GetAttr() for item in above if not item.GetAttr().GetPrim().IsInstanceProxy()]
    return (str(prim.GetPrimInPrototype().GetPath()), *(str(attribute.GetPath()) for attribute in outside))


def mesh_parts(prim: Usd.Prim, surface: Surface, reader: MaterialReader) -> Iterator[MeshPart]:
    """The material subsets of a mesh and the faces in none. Raises InputError naming the prim."""
    path, shared = str(prim.GetPath()), shape_key(prim)
    rest = np.ones(surface.faces_in_file, dtype=bool)
    selections: list[tuple[str, Usd.Prim, NDArray]] = []
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        faces = integers(subset.GetIndicesAttr())
        if len(faces) and (faces.min() < 0 or faces.max() >= len(rest)):
            raise InputError("subset names a face that the mesh has not", field=str(subset.GetPath()))
        selected = np.zeros(len(rest), dtype=bool)
        selected[faces] = True
        selections.append((subset.GetPrim().GetName(), subset.GetPrim(), selected))
        rest &= ~selected
    if rest.any():
        selections.append(("", prim, rest))
    for name, bound, selected in selections:
        material = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()[0]
        index, color, opacity = _material(surface, material if material else None, reader)
        uv_names = reader.uv_names.get(index, "st")
        uv_names = (uv_names,) if isinstance(uv_names, str) else tuple(uv_names)
        yield MeshPart(
            surface=surface,
            name=f"{path}/{name}" if name else path,
            material=index,
            key=(shared, name, uv_names, color, opacity),
            faces=np.flatnonzero(selected[surface.of_face] & (surface.of_face >= 0)),
            uv_names=uv_names,
            color=color,
            opacity=opacity,
        )


def _material(surface: Surface, material: UsdShade.Material | None, reader: MaterialReader) -> tuple:
    """Index of the material, and the primvars of the vertices' colour and opacity, as in MeshPart."""
    if material is None:
        opacity = corner_values(surface, "displayOpacity", 1)
        if opacity is None and primvar_of(surface, "displayColor") is None:
            return reader.material_index(None), None, None
        blend = opacity is not None and bool((opacity.values < OPAQUE).any())
        return reader.colored_default(blend), ("displayColor", GREY), ("displayOpacity", 1.0)
    index = reader.material_index(material)
    color = (reader.color_names[index], reader.color_fallbacks[index]) if index in reader.color_names else None
    opacity = (reader.opacity_names[index], reader.opacity_fallbacks[index]) if index in reader.opacity_names else None
    return index, color, opacity


def mesh_of(part: MeshPart) -> tuple[Mesh, VertexSource]:
    """A Mesh whose positions and normals are still to be set, and where they come from.

    Corners are merged where they share the point and have equal normals, texture coordinates and colours.
    """
    surface = part.surface
    starts = np.cumsum(surface.counts) - surface.counts
    counts = surface.counts[part.faces]
    corners = np.repeat(starts[part.faces] - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())
    normals, normal, rank = _authored_normals(surface) if surface.smooth is None else (None, None, None)
    uvs = [corner_values(surface, name, 2) for name in part.uv_names]
    colors, opacities = (
        corner_values(surface, item[0], width) if item else None for item, width in ((part.color, 3), (part.opacity, 1))
    )
    columns = [surface.point[corners]]
    columns += [surface.smooth.group[corners]] if surface.smooth is not None else []
    columns += [rank[corners]] if rank is not None else []
    columns += [item.element[corners] for item in (*uvs, colors, opacities) if item is not None]
    first, vertex = merged(columns)
    triangles = vertex[fan(counts)[0]]
    chosen = corners[first]
    source = VertexSource(
        surface=surface,
        point=surface.point[chosen],
        group=surface.smooth.group[chosen] if surface.smooth is not None else None,
        normals=normals,
        normal=normal[chosen] if normal is not None else None,
    )
    uv, uv2 = (item.values[item.element[chosen]] if item else None for item in (*uvs, None)[:2])
    mesh = Mesh(
        name=part.name,
        positions=np.zeros((len(first), 3), np.float32),
        faces=np.ascontiguousarray(triangles[:, ::-1] if surface.left_handed else triangles, dtype=np.uint32),
        uv=uv,
        uv2=uv2,
        colors=_colors(part, colors, opacities, chosen),
    )
    return mesh, source


def _colors(
    part: MeshPart, colors: CornerValues | None, opacities: CornerValues | None, chosen: NDArray
) -> NDArray[np.float32] | None:
    if part.color is None and part.opacity is None:
        return None
    out = np.ones((len(chosen), 4), np.float32)
    if part.color is not None:
        out[:, :3] = colors.values[colors.element[chosen]] if colors is not None else part.color[1][:3]
    if part.opacity is not None:
        out[:, 3] = opacities.values[opacities.element[chosen], 0] if opacities is not None else part.opacity[1]
    return out


def _authored_normals(surface: Surface) -> tuple[Usd.Attribute | None, NDArray | None, NDArray | None]:
    """The attribute of the normals of a mesh that is not refined, the element of it that each corner takes, and equal
    numbers [C] for equal normals, by which corners are merged."""
    if not has_normals(surface.mesh):
        return None, None, None
    primvar = UsdGeom.PrimvarsAPI(surface.mesh).GetPrimvar("normals")
    indices = None
    if primvar and primvar.HasValue():
        attribute, interpolation = primvar.GetAttr(), str(primvar.GetInterpolation())
        indices = np.array(primvar.GetIndices(EARLIEST), dtype=np.int64) if primvar.IsIndexed() else None
    else:
        attribute, interpolation = surface.mesh.GetNormalsAttr(), str(surface.mesh.GetNormalsInterpolation())
    values = vectors(attribute).astype(np.float32)
    normal = elements_at_corners(surface, len(values), indices, interpolation, "normals")
    if attribute.ValueMightBeTimeVarying():
        return attribute, normal, normal
    return attribute, normal, distinct(values, normal).element


def still_mesh(part: MeshPart) -> Mesh:
    """The Mesh of a part that keeps its shape. Raises InputError where its values are not finite."""
    mesh, source = mesh_of(part)
    drawn, smooth = part.surface.rest
    normals = smooth[source.group] if smooth is not None else None
    if source.normals is not None:
        normals = vectors(source.normals).astype(np.float32)[source.normal]
    return with_vertices(mesh, drawn[source.point].astype(np.float32), normals, deforms=False)


def with_vertices(mesh: Mesh, positions: NDArray, normals: NDArray | None, deforms: bool) -> Mesh:
    """The mesh with its vertices set. Raises InputError naming it where they are not finite."""
    mesh = replace(mesh, positions=positions, normals=normals, deforms=deforms)
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, field=mesh.name)
    return mesh
