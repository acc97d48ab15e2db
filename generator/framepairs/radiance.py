"""`raster` shading: what a real-time engine draws, deterministic and without noise.

Direct light of directional, point and spot lights with one shadow ray each, image-based light by the split sum, emission,
and blended layers over the opaque surface. Nothing here is random.
"""

from dataclasses import dataclass

import numpy as np

from .backend import dr, mi
from .brdf import Brdf, evaluate
from .environment import Sky, build_sky, diffuse_light, sky_radiance, specular_light
from .gbuffer import SKIP, SKIP_ORIGIN, GBuffer, Pixel, camera_ray, describe_hit, first_solid, footprint_of
from .geometry import Geometry, Pose
from .materials import MaterialTable, build_materials, opacity_of
from .projection import View
from .scene.description import SceneDescription
from .tracing import triangle_of
from .transforms import Vector

FLOATS_PER_LIGHT = 16
SHADOW_OFFSET = 3e-5  # of the distances at play: a few hundred float32 roundings


@dataclass(frozen=True)
class Lights:
    """values: [16 lights]: radiance 3, is directional, position 3 (render space), cone cosine inner, direction 3, outer."""

    values: mi.Float
    count: mi.UInt32
    none: bool


@dataclass(frozen=True)
class Shading:
    """Everything that decides colour, on the device."""

    geometry: Geometry
    materials: MaterialTable
    brdf: Brdf
    sky: Sky


@dataclass(frozen=True)
class Radiance:
    """One sample, or the mean over a pixel's samples: color, emission, f_beta [3] and transparency."""

    color: mi.Color3f
    emission: mi.Color3f
    f_beta: mi.Color3f
    transparency: mi.Float


def build_shading(scene: SceneDescription, brdf: Brdf) -> Shading:
    """`scene` must have an environment."""
    return Shading(Geometry(scene), build_materials(scene), brdf, build_sky(scene.environment, brdf.model))


def lights_around(scene: SceneDescription, origin: Vector) -> Lights:
    """The lights with positions relative to the render origin."""
    rows = np.zeros((max(len(scene.lights), 1), FLOATS_PER_LIGHT), dtype=np.float32)
    for row, light in zip(rows, scene.lights, strict=False):
        row[0:4] = *light.radiance, light.kind == "directional"
        row[4:8] = *(np.array(light.position) - origin), light.cone[0]
        row[8:12] = *light.direction, light.cone[1]
    return Lights(mi.Float(rows.ravel()), dr.opaque(mi.UInt32, len(scene.lights)), not scene.lights)


@dr.syntax
def shade(
    shading: Shading,
    lights: Lights,
    pose: Pose,
    view: View,
    x: mi.Float,
    y: mi.Float,
    pixel: Pixel,
    sample: GBuffer,
) -> Radiance:
    """What is drawn at the sample: the opaque surface or the sky, and the blended layers before it."""
    ray = camera_ray(view, x, y)
    solid, sky = sample.hit.valid, mi.Color3f(0)
    if dr.hint(~solid, exclude=[shading, lights, pose, view, pixel, sample]):
        sky = sky_radiance(shading.sky, ray.d, pixel.ddx, pixel.ddy, ~solid)
    color = dr.select(solid, _surface_color(shading, lights, pose, sample), sky)
    emission = dr.select(solid, sample.surface.emission, sky)
    transparency = mi.Float(0)
    if dr.hint(shading.materials.blends, mode="scalar"):
        layers, transmittance = _layers(shading, lights, pose, view, ray, pixel, sample)
        color, transparency = layers + transmittance * color, 1 - transmittance
    return Radiance(color, emission, sample.f_beta, transparency)


def _surface_color(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer) -> mi.Color3f:
    """Outgoing radiance [3] of a surface towards the camera."""
    surface, n, v = sample.surface, sample.normal, sample.view
    reflection = 2 * dr.dot(n, v) * n - v
    ambient = (1 - surface.metallic) * surface.base_color * diffuse_light(shading.sky, n)
    ambient += specular_light(shading.sky, reflection, surface.roughness, sample.hit.valid) * (sample.f0 * sample.a + sample.b)
    return surface.emission + ambient + _direct(shading, lights, pose, sample)


@dr.syntax
def _direct(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer) -> mi.Color3f:
    """Light [3] that arrives straight from the lights."""
    total, k = mi.Color3f(0), mi.UInt32(0)
    if dr.hint(not lights.none, mode="scalar"):
        while dr.hint(k < lights.count, exclude=[shading, lights, pose, sample]):
            total += _one_light(shading, lights, pose, sample, k)
            k += 1
    return total


def _one_light(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer, index: mi.UInt32) -> mi.Color3f:
    radiance, place, aim = (dr.gather(mi.Vector4f, lights.values, index * 4 + k) for k in range(3))
    directional = radiance.w > 0.5
    aim_direction = mi.Vector3f(aim.x, aim.y, aim.z)
    to_light = mi.Vector3f(place.x, place.y, place.z) - mi.Vector3f(sample.position)
    distance = dr.norm(to_light)
    towards = dr.select(directional, -aim_direction, to_light / dr.maximum(distance, 1e-20))
    cone = dr.clip((dr.dot(-towards, aim_direction) - aim.w) / dr.maximum(place.w - aim.w, 1e-4), 0, 1)
    cone = dr.select(aim.w > -1, cone, 1)  # a point light shines all around
    falloff = cone / dr.maximum(dr.square(distance), 1e-12)
    strength = mi.Color3f(radiance.x, radiance.y, radiance.z) * dr.select(directional, 1, falloff)
    surface, model = sample.surface, shading.brdf.model
    reflected = evaluate(
        model, surface.base_color, surface.metallic, surface.roughness, sample.f0, sample.normal, sample.view, towards
    )
    lit = sample.hit.valid & (dr.dot(sample.geometric, towards) > 0) & (dr.dot(sample.normal, towards) > 0)
    step = SHADOW_OFFSET * (dr.max(dr.abs(sample.position)) + sample.depth)
    ray = mi.Ray3f(sample.position + step * sample.geometric, towards)
    ray.maxt = dr.select(directional, dr.largest(mi.Float), distance * (1 - 1e-3))
    return dr.select(lit & ~_is_shadowed(shading, pose, ray, lit), reflected * strength, 0)


def _is_shadowed(shading: Shading, pose: Pose, ray: mi.Ray3f, active: mi.Bool) -> mi.Bool:
    if not (shading.materials.masks or shading.materials.blends):
        return pose.scene.ray_test(ray, active=active)
    hit, _ = first_solid(shading.geometry, shading.materials, pose, ray, None, active, start=mi.Float(0))
    return hit.valid


@dr.syntax
def _layers(
    shading: Shading, lights: Lights, pose: Pose, view: View, ray: mi.Ray3f, pixel: Pixel, sample: GBuffer
) -> tuple[mi.Color3f, mi.Float]:
    """Blended surfaces before the opaque one, front to back: (premultiplied colour [3], transmittance)."""
    geometry, materials = shading.geometry, shading.materials
    total, transmittance = mi.Color3f(0), mi.Float(1)
    passed = mi.Float(view.near)
    end = dr.select(sample.hit.valid, sample.depth * (1 - 1e-6), view.far)
    least = SKIP_ORIGIN * dr.max(dr.abs(ray.o)) / dr.norm(ray.d)
    going = mi.Bool(True)
    while dr.hint(going, exclude=[geometry, materials, shading, lights, pose, view, pixel, sample]):
        hit, t = first_solid(geometry, materials, pose, ray, pixel, going, start=passed, blended_too=True)
        going = hit.valid & (t < end)
        layer = describe_hit(geometry, materials, shading.brdf, pose, view, ray, hit, pixel)
        material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
        footprint = footprint_of(triangle_of(geometry.tables, pose, hit), ray, pixel)
        opacity = dr.select(going, opacity_of(materials, material, footprint, hit.valid), 0)
        total += transmittance * opacity * dr.select(going, _surface_color(shading, lights, pose, layer), 0)
        transmittance *= 1 - opacity
        going &= transmittance > 1e-4
        passed = dr.maximum(t * (1 + SKIP), t + least)
    return total, transmittance
