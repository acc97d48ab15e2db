"""`raster`'s direct light: one shadow ray per point and directional light, a fixed pattern for lights with an extent.

Each light with an extent is sampled at N points of it and at N directions of the specular lobe, weighted against each other
by the balance heuristic (Veach and Guibas 1995): points suit rough surfaces and small lights, the lobe smooth ones. The
points are the same for all pixels, so what they miss shows as steps and not as noise: a shadow's edge has about N levels.
What they err by is measured in docs/shading.md.
"""

import operator
from functools import reduce

from .backend import dr, mi
from .brdf import evaluate, sample_specular, specular_density
from .gbuffer import GBuffer
from .geometry import Pose
from .lights import SHORT_OF_LIGHT, Lights, LightSample, light_along, mesh_behind, sample_light
from .materials import is_blended
from .mesh_lights import emission_at, mesh_light_density
from .shading import Shading, is_above, is_shadowed, lifted_from
from .solid import first_solid


def direct_light(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer) -> mi.Color3f:
    """Radiance [3] that a surface reflects towards the camera straight from the lights."""
    return direct_lights(shading, lights, pose, [sample], [mi.Bool(False)])[0]


@dr.syntax
def direct_lights(
    shading: Shading, lights: Lights, pose: Pose, samples: list[GBuffer], differ: list[mi.Bool]
) -> list[mi.Color3f]:
    """`direct_light` of samples that lie on one surface except where they `differ` from the first: one shadow ray serves
    all that do not."""
    totals = [mi.Color3f(0) for _ in samples]
    if dr.hint(bool(lights.kinds), mode="scalar"):
        totals = _from_points(shading, lights, pose, samples, [sample.hit.valid for sample in samples], differ)
        totals = _with_own(shading, lights, pose, samples, differ, totals)
    if dr.hint(lights.have_extent, mode="scalar"):
        totals = _from_lobes(shading, lights, pose, samples, totals)
    return totals


@dr.syntax
def _from_points(shading: Shading, lights: Lights, pose: Pose, samples, valid, differ) -> list[mi.Color3f]:
    totals, k = [mi.Color3f(0) for _ in samples], mi.UInt32(0)
    valid = _without(valid, differ)
    while dr.hint(k < shading.pattern.count, exclude=[shading, lights, pose, samples, valid, differ]):
        point = dr.gather(mi.Vector4f, shading.pattern.lights, k)
        totals = _sums(totals, _from_point(shading, lights, pose, samples, valid, point))
        k += 1
    return totals


def _with_own(shading: Shading, lights: Lights, pose: Pose, samples, differ, totals) -> list[mi.Color3f]:
    rest = zip(samples[1:], differ[1:], totals[1:], strict=True)
    return [totals[0], *(_own(shading, lights, pose, *each) for each in rest)]


@dr.syntax
def _own(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer, differs: mi.Bool, total: mi.Color3f) -> mi.Color3f:
    if dr.hint(differs, exclude=[shading, lights, pose, sample]):
        own = _from_points(shading, lights, pose, [sample], [sample.hit.valid & differs], [mi.Bool(False)])
        total = dr.select(differs, own[0], total)
    return total


def _from_lobes(shading: Shading, lights: Lights, pose: Pose, samples, totals) -> list[mi.Color3f]:
    return [_with_lobe(shading, lights, pose, *each) for each in zip(samples, totals, strict=True)]


@dr.syntax
def _with_lobe(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer, total: mi.Color3f) -> mi.Color3f:
    j = mi.UInt32(0)
    while dr.hint(j < shading.pattern.number, exclude=[shading, lights, pose, sample]):
        total += _from_lobe(shading, lights, pose, sample, dr.gather(mi.Point2f, shading.pattern.lobe, j))
        j += 1
    return total


@dr.syntax
def _from_point(shading: Shading, lights: Lights, pose: Pose, samples, valid, point: mi.Vector4f) -> list[mi.Color3f]:
    """A branch and no select: where no pixel of a packet is lit (outside a spot's cone), neither BRDF nor ray are computed."""
    index, place = mi.UInt32(point.x), mi.Point2f(point.y, point.z)
    first, any_valid = samples[0], _any(valid)
    light = sample_light(lights, shading.geometry, shading.materials, pose, index, first.position, place, any_valid)
    shines = (light.density > 0) & (dr.max(light.radiance) > 0)
    lit = _facing(samples, valid, light, shines)
    values, any_lit = [mi.Color3f(0) for _ in samples], _any(lit)
    if dr.hint(any_lit, exclude=[shading, lights, pose, samples, first, light, index, point, lit]):
        ray = lifted_from(first, light.towards)
        ray.maxt = light.distance * SHORT_OF_LIGHT
        stopped = is_shadowed(shading, pose, ray, any_lit, coherent=True)
        values = _unshadowed_each(shading, lights, samples, lit, stopped, light, index, point.w)
    return values


def _unshadowed_each(shading: Shading, lights: Lights, samples, lit, stopped, light, index, share) -> list[mi.Color3f]:
    free = [each & ~stopped for each in lit]
    values = [_unshadowed(shading, lights, sample, light, index, share) for sample in samples]
    return [dr.select(*each, 0) for each in zip(free, values, strict=True)]


def _facing(samples, valid, light: LightSample, shines: mi.Bool) -> list[mi.Bool]:
    return [each & shines & is_above(sample, light.towards) for sample, each in zip(samples, valid, strict=True)]


def _without(masks: list[mi.Bool], others: list[mi.Bool]) -> list[mi.Bool]:
    return [mask & ~other for mask, other in zip(masks, others, strict=True)]


def _any(masks: list[mi.Bool]) -> mi.Bool:
    return reduce(operator.or_, masks)


def _sums(first: list, second: list) -> list:
    return [a + b for a, b in zip(first, second, strict=True)]


def _unshadowed(
    shading: Shading, lights: Lights, sample: GBuffer, light: LightSample, index: mi.UInt32, share: mi.Float
) -> mi.Color3f:
    weight = share / dr.select(light.density > 0, light.density, 1)
    if lights.have_extent:
        lobe = specular_density(shading.brdf.model, sample.surface.roughness, sample.normal, sample.view, light.towards)
        rivals = light.extent & ~_is_passed_through(shading, lights, index)
        weight *= dr.select(rivals, light.density / dr.maximum(light.density + lobe, 1e-30), 1)
    return _reflected(shading, sample, light.towards) * light.radiance * weight


def _is_passed_through(shading: Shading, lights: Lights, index: mi.UInt32) -> mi.Bool:
    """Whether rays of the lobe pass this light: only its points stand for a blended surface."""
    if not (shading.materials.blends and "mesh" in lights.kinds):
        return mi.Bool(False)
    is_mesh, item = mesh_behind(lights, index)
    material = dr.gather(mi.UInt32, shading.geometry.tables.material, item, is_mesh)
    return is_mesh & is_blended(shading.materials, material, is_mesh)


@dr.syntax
def _from_lobe(shading: Shading, lights: Lights, pose: Pose, sample: GBuffer, place: mi.Point2f) -> mi.Color3f:
    model, roughness = shading.brdf.model, sample.surface.roughness
    towards = sample_specular(model, roughness, sample.normal, sample.view, place)
    lobe = specular_density(model, roughness, sample.normal, sample.view, towards)
    active = sample.hit.valid & (lobe > 0) & is_above(sample, towards)
    ray = lifted_from(sample, towards)
    hit, distance = first_solid(shading.geometry, shading.materials, pose, ray, None, active, start=mi.Float(0))
    total = mi.Color3f(0)
    if dr.hint("mesh" in lights.kinds, mode="scalar"):
        chance = mesh_light_density(lights.meshes, shading.geometry, pose, hit, towards, distance)
        glow = emission_at(shading.geometry, shading.materials, pose, hit, towards)
        total += dr.select(chance > 0, glow / dr.maximum(lobe + chance, 1e-30), 0)
    if dr.hint(bool(lights.kinds & {"rectangle", "disk", "sphere"}), mode="scalar"):
        k = mi.UInt32(0)
        while dr.hint(k < lights.count, exclude=[lights, hit, ray, towards, distance, lobe, active]):
            radiance, chance = light_along(lights, k, ray.o, towards, distance)
            total += radiance / dr.maximum(lobe + chance, 1e-30)
            k += 1
    return dr.select(active, total * _reflected(shading, sample, towards) / mi.Float(shading.pattern.number), 0)


def _reflected(shading: Shading, sample: GBuffer, towards: mi.Vector3f) -> mi.Color3f:
    surface = sample.surface
    return evaluate(
        shading.brdf.model,
        surface.base_color,
        surface.metallic,
        surface.roughness,
        sample.f0,
        sample.normal,
        sample.view,
        towards,
    )
