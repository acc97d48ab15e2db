"""`raster` shading: what a real-time engine draws, deterministic and without noise.

Direct light, image-based light by the split sum, ambient occlusion, emission, and blended layers over the opaque surface.
Nothing here is random.
"""

import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

from .backend import dr, mi
from .brdf import f90_of
from .direct_light import direct_light, direct_lights
from .environment import diffuse_light, sky_radiance, specular_light
from .gbuffer import GBuffer, camera_ray, describe_hit
from .geometry import Pose
from .lights import Lights
from .materials import opacity_of
from .projection import View
from .shading import Shading, ambient_visibility, specular_visibility
from .solid import SKIP, SKIP_ORIGIN, Pixel, first_solid, footprint_of
from .tracing import triangle_of


@dataclass(frozen=True)
class Radiance:
    """One sample, or the mean over a pixel's samples: color, emission, f_beta [3] and transparency."""

    color: mi.Color3f
    emission: mi.Color3f
    f_beta: mi.Color3f
    transparency: mi.Float


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
    samples, differ = [sample], [mi.Bool(False)]
    return shade_each(shading, lights, pose, view, x, y, pixel, (pixel.bias,), samples, differ, lit)[0]


def shade_each(
    shading: Shading,
    lights: Lights,
    pose: Pose,
    view: View,
    x: mi.Float,
    y: mi.Float,
    pixel: Pixel,
    biases: Sequence[mi.Float],
    samples: list[GBuffer],
    differ: list[mi.Bool],
    lit: bool,
) -> list[Radiance]:
    """`shade` of what `gbuffers` found for each of `biases`: sky and shadow rays serve all."""
    ray = camera_ray(view, x, y)
    sky = _sky(shading, ray, pixel, samples)
    direct = direct_lights(shading, lights, pose, samples, differ) if lit else [mi.Color3f(0)] * len(samples)
    drawn = []
    for bias, sample, reflected in zip(biases, samples, direct, strict=True):
        solid, color, transparency = sample.hit.valid, mi.Color3f(0), mi.Float(0)
        if lit:
            color = dr.select(solid, _surface_color(shading, pose, sample, reflected), sky)
        if shading.materials.blends:
            own = replace(pixel, bias=bias)
            layers, transmittance = _layers(shading, lights, pose, view, ray, own, sample, lit)
            color, transparency = layers + transmittance * color, 1 - transmittance
        emission = dr.select(solid, sample.surface.emission, sky)
        drawn.append(Radiance(color, emission, sample.f_beta, transparency))
    return drawn


@dr.syntax
def _sky(shading: Shading, ray: mi.Ray3f, pixel: Pixel, samples: list[GBuffer]) -> mi.Color3f:
    """The sky behind the samples that lie on no surface."""
    sky, seen = mi.Color3f(0), ~samples[0].hit.valid
    if dr.hint(len(samples) > 1, mode="scalar"):
        seen = reduce(operator.or_, [~sample.hit.valid for sample in samples])
    if dr.hint(seen, exclude=[shading, ray, pixel, samples]):
        sky = sky_radiance(shading.sky, ray.d, pixel.ddx, pixel.ddy, seen)
    return sky


def _surface_color(shading: Shading, pose: Pose, sample: GBuffer, direct: mi.Color3f) -> mi.Color3f:
    """Outgoing radiance [3] of a surface towards the camera, of which `direct` is the lights'."""
    surface, n, v = sample.surface, sample.normal, sample.view
    cos_v = dr.dot(n, v)
    diffuse = (1 - surface.metallic) * surface.base_color * diffuse_light(shading.sky, n)
    specular = specular_light(shading.sky, 2 * cos_v * n - v, surface.roughness, sample.hit.valid)
    specular *= sample.f0 * sample.a + f90_of(sample.f0) * sample.b
    if shading.occludes:
        free = ambient_visibility(shading, pose, sample)
        diffuse, specular = free * diffuse, specular_visibility(free, cos_v, surface.roughness) * specular
    return surface.emission + diffuse + specular + direct


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
            color = _surface_color(shading, pose, layer, direct_light(shading, lights, pose, layer))
            total += transmittance * opacity * dr.select(going, color, 0)
        transmittance *= 1 - opacity
        going &= transmittance > 1e-4
        passed = dr.maximum(t * (1 + SKIP), t + least)
    return total, transmittance
