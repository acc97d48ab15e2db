"""`raster` shading: what a real-time engine draws, deterministic and without noise.

Direct light, image-based light by the split sum, ambient occlusion, emission, and blended layers over the opaque surface.
Nothing here is random.
"""

from dataclasses import dataclass

from .backend import dr, mi
from .brdf import f90_of
from .direct_light import direct_light
from .environment import diffuse_light, sky_radiance, specular_light
from .gbuffer import SKIP, SKIP_ORIGIN, GBuffer, Pixel, camera_ray, describe_hit, first_solid, footprint_of
from .geometry import Pose
from .lights import Lights
from .materials import opacity_of
from .projection import View
from .shading import Shading, ambient_visibility, specular_visibility
from .tracing import triangle_of


@dataclass(frozen=True)
class Radiance:
    """One sample, or the mean over a pixel's samples: color, emission, f_beta [3] and transparency."""

    color: mi.Color3f
    emission: mi.Color3f
    f_beta: mi.Color3f
    transparency: mi.Float


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
    lit: bool,
) -> Radiance:
    """What is drawn at the sample: the opaque surface or the sky, and the blended layers before it. Without `lit`, colour is
    left out (0)."""
    ray = camera_ray(view, x, y)
    solid, sky = sample.hit.valid, mi.Color3f(0)
    if dr.hint(~solid, exclude=[shading, lights, pose, view, pixel, sample]):
        sky = sky_radiance(shading.sky, ray.d, pixel.ddx, pixel.ddy, ~solid)
    color, transparency = mi.Color3f(0), mi.Float(0)
    if dr.hint(lit, mode="scalar"):
        color = dr.select(solid, _surface_color(shading, lights, pose, sample), sky)
    emission = dr.select(solid, sample.surface.emission, sky)
    if dr.hint(shading.materials.blends, mode="scalar"):
        layers, transmittance = _layers(shading, lights, pose, view, ray, pixel, sample, lit)
        color, transparency = layers + transmittance * color, 1 - transmittance
    return Radiance(color, emission, sample.f_beta, transparency)


def _surface_color(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer) -> mi.Color3f:
    """Outgoing radiance [3] of a surface towards the camera."""
    surface, n, v = sample.surface, sample.normal, sample.view
    cos_v = dr.dot(n, v)
    diffuse = (1 - surface.metallic) * surface.base_color * diffuse_light(shading.sky, n)
    specular = specular_light(shading.sky, 2 * cos_v * n - v, surface.roughness, sample.hit.valid)
    specular *= sample.f0 * sample.a + f90_of(sample.f0) * sample.b
    if shading.occludes:
        free = ambient_visibility(shading, pose, sample)
        diffuse, specular = free * diffuse, specular_visibility(free, cos_v, surface.roughness) * specular
    return surface.emission + diffuse + specular + direct_light(shading, lights, pose, sample)


@dr.syntax
def _layers(
    shading: Shading, lights: Lights, pose: Pose, view: View, ray: mi.Ray3f, pixel: Pixel, sample: GBuffer, lit: bool
) -> tuple[mi.Color3f, mi.Float]:
    """Blended surfaces before the opaque one, front to back: (premultiplied colour [3], transmittance)."""
    geometry, materials = shading.geometry, shading.materials
    total, transmittance = mi.Color3f(0), mi.Float(1)
    passed = mi.Float(view.near)
    end = dr.select(sample.hit.valid, sample.depth * (1 - 1e-6), view.far)
    least = SKIP_ORIGIN * dr.max(dr.abs(ray.o)) / dr.norm(ray.d)
    going = mi.Bool(True)
    while dr.hint(going, exclude=[geometry, materials, shading, lights, pose, view, pixel, sample, lit]):
        hit, t = first_solid(geometry, materials, pose, ray, pixel, going, start=passed, blended_too=True)
        going = hit.valid & (t < end)
        layer = describe_hit(geometry, materials, shading.brdf, pose, view, ray, hit, pixel)
        material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
        footprint = footprint_of(triangle_of(geometry.tables, pose, hit), ray, pixel)
        opacity = dr.select(going, opacity_of(materials, material, footprint, hit.valid), 0)
        if dr.hint(lit, mode="scalar"):
            total += transmittance * opacity * dr.select(going, _surface_color(shading, lights, pose, layer), 0)
        transmittance *= 1 - opacity
        going &= transmittance > 1e-4
        passed = dr.maximum(t * (1 + SKIP), t + least)
    return total, transmittance
