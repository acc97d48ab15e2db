"""BSDFs that have no counterpart among our materials, drawn by `path` as Mitsuba draws them.

The surface that a ray met is described to Mitsuba's BSDF as its own shapes would: uv with v down, a shading frame along
dp/du, and directions on either side, so that glass refracts. Only scenes that hold such BSDFs have any of this in a kernel.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .backend import dr, mi
from .errors import InputError
from .geometry import Geometry, Pose
from .scene.description import SceneDescription
from .tracing import Hit, triangle_of

DELTA_DENSITY = 1e20  # against which any other way of finding the same light weighs nothing


@dataclass(frozen=True)
class KeptBsdfs:
    """number: [materials] of Mitsuba's registry, 0 for materials of ours. bsdfs: they, which the registry does not own."""

    number: mi.UInt32
    bsdfs: tuple[mi.BSDF, ...]


@dataclass
class KeptPoint:
    """What such a BSDF asks of the surface at which a path turns. number: 0 where the material is ours. Vectors in render
    space; `outward` and `normal` do not turn towards the viewer; along_u, along_v: by what the place changes with Mitsuba's u
    and v. Not frozen: it is the state of a loop."""

    number: mi.UInt32
    position: mi.Point3f
    outward: mi.Vector3f
    normal: mi.Vector3f
    along_u: mi.Vector3f
    along_v: mi.Vector3f
    uv: mi.Point2f


def build_kept(scene: SceneDescription) -> KeptBsdfs | None:
    """None where no drawn material keeps its BSDF. Raises InputError naming the material that Mitsuba refuses."""
    used = {item.material for item in scene.objects}
    numbers, bsdfs = np.zeros(max(len(scene.materials), 1), np.uint32), []
    for index, material in enumerate(scene.materials):
        if material.bsdf is None or index not in used:
            continue
        try:
            bsdf = mi.load_dict(_for_mitsuba(material.bsdf))
        except Exception as error:  # Mitsuba raises RuntimeError, TypeError and others, for all that can be wrong
            problem = f"Mitsuba refuses this BSDF: {' '.join(str(error).split())[:300]}"
            raise InputError(problem, file=scene.files[0] if scene.files else None, field=material.name) from None
        bsdfs.append(bsdf)
        numbers[index] = dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(bsdf))[0]
    return KeptBsdfs(mi.UInt32(numbers), tuple(bsdfs)) if bsdfs else None


def kept_point(kept: KeptBsdfs, geometry: Geometry, pose: Pose, hit: Hit) -> KeptPoint:
    """The surface of a hit."""
    material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
    triangle = triangle_of(geometry.tables, pose, hit)
    side = dr.select(dr.dot(triangle.normal, triangle.outward) < 0, -1, mi.Float(1))
    edge1, edge2, uv1, uv2 = triangle.edge1, triangle.edge2, triangle.uv_edge1, triangle.uv_edge2
    determinant = uv1.x * uv2.y - uv1.y * uv2.x
    has_uv = determinant != 0
    scale = dr.select(has_uv, 1 / dr.select(has_uv, determinant, 1), 0)
    s, t = mi.coordinate_system(triangle.normal * side)  # as Mitsuba's meshes have it without uv
    return KeptPoint(
        number=dr.select(hit.valid, dr.gather(mi.UInt32, kept.number, material, hit.valid), 0),
        position=mi.Point3f(triangle.position),
        outward=dr.normalize(triangle.outward),
        normal=triangle.normal * side,
        along_u=dr.select(has_uv, (edge1 * uv2.y - edge2 * uv1.y) * scale, s),
        along_v=dr.select(has_uv, (edge1 * uv2.x - edge2 * uv1.x) * scale, t),  # Mitsuba's v runs against ours
        uv=mi.Point2f(triangle.uv.x, 1 - triangle.uv.y),
    )


def evaluate_kept(
    point: KeptPoint, view: mi.Vector3f, towards: mi.Vector3f, active: mi.Bool
) -> tuple[mi.Color3f, mi.Float]:
    """(BSDF times the cosine [3], density per steradian of `sample_kept`) for world directions away from the surface."""
    there = _interaction(point, view)
    value, density = _bsdf(point).eval_pdf(mi.BSDFContext(), there, there.to_local(towards), active & (point.number != 0))
    return mi.Color3f(value), density


def sample_kept(
    point: KeptPoint, view: mi.Vector3f, choice: mi.Float, place: mi.Point2f, active: mi.Bool
) -> tuple[mi.Vector3f, mi.Color3f, mi.Float]:
    """(direction of light, BSDF times the cosine over its density [3], the density); the density of mirrors and clear glass
    is DELTA_DENSITY, and 0 where nothing was found."""
    there = _interaction(point, view)
    found, weight = _bsdf(point).sample(mi.BSDFContext(), there, choice, place, active & (point.number != 0))
    is_delta = mi.has_flag(found.sampled_type, mi.BSDFFlags.Delta) | mi.has_flag(found.sampled_type, mi.BSDFFlags.Null)
    density = dr.select(is_delta & (found.pdf > 0), DELTA_DENSITY, found.pdf)
    return there.to_world(found.wo), mi.Color3f(weight), density


def _bsdf(point: KeptPoint) -> mi.BSDFPtr:
    return dr.reinterpret_array(mi.BSDFPtr, point.number)


def _interaction(point: KeptPoint, view: mi.Vector3f) -> mi.SurfaceInteraction3f:
    there = dr.zeros(mi.SurfaceInteraction3f)
    there.t = mi.Float(1)
    there.p, there.n, there.uv = point.position, mi.Normal3f(point.outward), point.uv
    there.dp_du = point.along_u
    flat = point.along_u - point.normal * dr.dot(point.normal, point.along_u)
    usable = dr.squared_norm(flat) > 0
    s = dr.select(usable, dr.normalize(dr.select(usable, flat, 1)), mi.coordinate_system(point.normal)[0])
    there.sh_frame = mi.Frame3f(s, dr.cross(point.normal, s), point.normal)
    there.dp_dv = point.along_v
    there.wi = there.to_local(view)
    return there


def _for_mitsuba(values: Mapping[str, Any]) -> dict[str, Any]:
    """A dictionary of plain values as Mitsuba takes it: matrices become transforms."""
    made = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            value = _for_mitsuba(value)
        elif key in ("to_uv", "to_world"):
            rows = [[float(number) for number in row] for row in value]
            value = mi.ScalarTransform4f(rows) if len(rows) == 4 else mi.ScalarTransform3f(rows)
        elif isinstance(value, tuple):
            value = list(value)
        made[key] = value
    return made
