"""What decides colour besides the view: geometry, materials, BRDF, sky and lights; and what lies in the way of a ray."""

from dataclasses import dataclass

import numpy as np

from .backend import dr, mi
from .brdf import Brdf
from .environment import Sky, build_sky
from .gbuffer import GBuffer
from .geometry import Geometry, Pose
from .jitter import antialiasing_positions
from .kept_bsdfs import KeptBsdfs, build_kept
from .materials import MaterialTable, build_materials
from .mesh_lights import MeshLights, build_mesh_lights
from .plan import RenderPlan
from .scene.description import SceneDescription
from .solid import first_solid
from .textures import TextureSettings

OFFSET = 3e-5  # of the distances at play: a few hundred float32 roundings


@dataclass(frozen=True)
class Pattern:
    """The points at which `raster` samples lights, one set for all pixels.

    lights: [4 count]: index of a light, a point in the unit square, 1 / number of points of that light. lobe: [2 points] of
    the specular lobe. occlusion: [2 directions] of the cosine hemisphere. number: of points of a light with an extent.
    """

    lights: mi.Float
    count: mi.UInt32
    number: mi.UInt32
    lobe: mi.Float
    occlusion: mi.Float
    occlusion_count: mi.UInt32


@dataclass(frozen=True)
class Shading:
    """Everything that decides colour. kept: BSDFs of the file, in `path` alone. occlusion_radius: scene units; occludes:
    whether ambient light is occluded at all."""

    geometry: Geometry
    materials: MaterialTable
    brdf: Brdf
    sky: Sky
    mesh_lights: MeshLights
    kept: KeptBsdfs | None
    pattern: Pattern
    occlusion_radius: mi.Float
    occludes: bool


def build_shading(scene: SceneDescription, plan: RenderPlan, brdf: Brdf) -> Shading:
    """`scene` must have an environment."""
    meshes = build_mesh_lights(scene, plan.mesh_lights or plan.shading == "path")
    traces = plan.shading == "path"
    texture_settings = TextureSettings(plan.anisotropy, plan.normal_variance, plan.mask_coverage)
    return Shading(
        geometry=Geometry(scene, plan.cull_back_faces),
        materials=build_materials(scene, brdf.model, texture_settings, keep_bsdfs=traces),
        brdf=brdf,
        sky=build_sky(scene.environment, brdf.model),
        mesh_lights=meshes,
        kept=build_kept(scene) if traces else None,
        pattern=_pattern(scene, meshes, plan),
        occlusion_radius=dr.opaque(mi.Float, plan.ambient_occlusion_radius_m / scene.metres_per_unit),
        occludes=plan.ambient_occlusion > 0,
    )


def lifted(position: mi.Point3f, geometric: mi.Vector3f, direction: mi.Vector3f, distance: mi.Float) -> mi.Ray3f:
    """A ray from a surface with this geometric normal, far enough off it not to meet it again. `distance`: of the rays that
    found the surface."""
    return mi.Ray3f(position + OFFSET * (dr.max(dr.abs(position)) + distance) * geometric, direction)


def lifted_from(sample: GBuffer, direction: mi.Vector3f) -> mi.Ray3f:
    """`lifted` from a G-buffer's surface."""
    depth = dr.select(sample.hit.valid, sample.depth, 0)
    return lifted(sample.position, sample.geometric, direction, depth)


def is_above(surface, towards: mi.Vector3f) -> mi.Bool:
    """Whether a direction leaves a surface, by its `geometric` and by its shading `normal`."""
    return (dr.dot(surface.geometric, towards) > 0) & (dr.dot(surface.normal, towards) > 0)


def is_shadowed(shading: Shading, pose: Pose, ray: mi.Ray3f, active: mi.Bool, coherent: bool = False) -> mi.Bool:
    """Whether an opaque surface stops the ray before its end; blended ones do not. coherent: neighbouring rays go alike,
    which changes no result.

    With masks, asking first whether anything is met costs more than it saves: half of the packets need the second ray.
    """
    if not (shading.materials.masks or shading.materials.blends or shading.geometry.hides):
        return pose.scene.ray_test(ray, active=active, coherent=coherent)
    surfaces = shading.geometry, shading.materials, pose
    hit, _ = first_solid(*surfaces, ray, None, active, start=mi.Float(0), coherent=coherent)
    return hit.valid


@dr.syntax
def ambient_visibility(shading: Shading, pose: Pose, sample: GBuffer) -> mi.Float:
    """The share of the cosine hemisphere that is free within the occlusion radius: 1 where nothing is near."""
    free, k = mi.Float(1), mi.UInt32(0)
    if dr.hint(shading.occludes, mode="scalar"):
        pattern = shading.pattern
        frame = mi.Frame3f(dr.select(sample.hit.valid, sample.normal, mi.Vector3f(0, 0, 1)))
        share = 1 / mi.Float(pattern.occlusion_count)
        while dr.hint(k < pattern.occlusion_count, exclude=[shading, pose, sample, pattern, frame, share]):
            place = dr.gather(mi.Point2f, pattern.occlusion, k)
            towards = frame.to_world(mi.warp.square_to_cosine_hemisphere(place))
            ray = lifted_from(sample, towards)
            ray.maxt = mi.Float(shading.occlusion_radius)
            above = sample.hit.valid & (dr.dot(sample.geometric, towards) > 0)
            free -= dr.select(is_shadowed(shading, pose, ray, above), share, 0)
            k += 1
    return free


def specular_visibility(free: mi.Float, cos_v: mi.Float, roughness: mi.Float) -> mi.Float:
    """Occlusion of the specular lobe from that of the hemisphere (Lagarde and de Rousiers 2014, section 4.10.2)."""
    cos_v = dr.clip(cos_v, 0, 1)
    return dr.clip(dr.power(dr.maximum(cos_v + free, 1e-6), dr.exp2(-16 * roughness - 1)) - 1 + free, 0, 1)


def _pattern(scene: SceneDescription, meshes: MeshLights, plan: RenderPlan) -> Pattern:
    extents = [light.has_extent for light in scene.lights] + [True] * len(meshes.objects)
    points = antialiasing_positions(plan.light_samples)
    rows = [
        (index, *place, 1 / len(chosen))
        for index, extent in enumerate(extents)
        for chosen in [points if extent else points[:1]]
        for place in chosen
    ]
    occlusion = antialiasing_positions(max(plan.ambient_occlusion, 1))
    return Pattern(
        lights=mi.Float(np.array(rows or [(0, 0, 0, 0)], np.float32).ravel()),
        count=dr.opaque(mi.UInt32, len(rows)),
        number=dr.opaque(mi.UInt32, plan.light_samples),
        lobe=mi.Float(np.array(points, np.float32).ravel()),
        occlusion=mi.Float(np.array(occlusion, np.float32).ravel()),
        occlusion_count=dr.opaque(mi.UInt32, plan.ambient_occlusion),
    )
