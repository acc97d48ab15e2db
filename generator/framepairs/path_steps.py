"""The steps of a light path: the next surface along a ray, light drawn from the lights, light that a drawn direction meets.

Both ways of finding light are weighted by the balance heuristic (Veach and Guibas 1995). Surfaces met here have no footprint
and read their finest texels. A blended surface is met, or stops a ray to a light, with the probability of its opacity.
"""

from dataclasses import dataclass

from .backend import dr, mi
from .brdf import density, evaluate, sample
from .conventions import BrdfModel
from .environment import sample_sky, sky_along
from .gbuffer import GBuffer
from .geometry import Pose
from .kept_bsdfs import KeptPoint, evaluate_kept, kept_point, sample_kept
from .lights import FAR, SHORT_OF_LIGHT, Lights, choose_light, light_along, sample_light
from .materials import is_blended, opacity_of
from .mesh_lights import mesh_light_density
from .shading import Shading, is_above, is_shadowed, lifted
from .solid import SKIP, SKIP_ORIGIN, Pixel, first_solid, footprint_of
from .tracing import Hit, triangle_of


@dataclass(frozen=True)
class World:
    """What every step of a path needs."""

    shading: Shading
    lights: Lights
    pose: Pose
    pixel: Pixel
    max_depth: mi.UInt32


@dataclass
class Point:
    """A surface at which a path turns; `view` points back along it. distance: of the rays so far, for offsets. Not frozen:
    it is the state of a loop."""

    position: mi.Point3f
    geometric: mi.Vector3f
    normal: mi.Vector3f
    view: mi.Vector3f
    base_color: mi.Color3f
    metallic: mi.Float
    roughness: mi.Float
    f0: mi.Color3f
    distance: mi.Float
    kept: KeptPoint | None


def point_of(world: World, sample: GBuffer, distance: mi.Float) -> Point:
    surface, shading = sample.surface, world.shading
    kept = None if shading.kept is None else kept_point(shading.kept, shading.geometry, world.pose, sample.hit)
    return Point(
        position=mi.Point3f(sample.position),
        geometric=mi.Vector3f(sample.geometric),
        normal=mi.Vector3f(sample.normal),
        view=mi.Vector3f(sample.view),
        base_color=mi.Color3f(surface.base_color),
        metallic=mi.Float(surface.metallic),
        roughness=mi.Float(surface.roughness),
        f0=mi.Color3f(sample.f0),
        distance=mi.Float(distance),
        kept=kept,
    )


def reflected_at(
    model: BrdfModel, point: Point, towards: mi.Vector3f, active: mi.Bool
) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
    """(BSDF times the cosine [3], density of `drawn_at`, whether the surface passes light that way at all)."""
    values = point.base_color, point.metallic, point.roughness, point.f0, point.normal, point.view, towards
    value, chance, open_ = evaluate(model, *values), density(model, *values), is_above(point, towards)
    if point.kept is not None:
        kept, (theirs, likely) = point.kept.number != 0, evaluate_kept(point.kept, point.view, towards, active)
        value, chance, open_ = dr.select(kept, theirs, value), dr.select(kept, likely, chance), open_ | kept
    return value, chance, open_


def drawn_at(
    model: BrdfModel, point: Point, choice: mi.Float, place: mi.Point2f, active: mi.Bool
) -> tuple[mi.Vector3f, mi.Color3f, mi.Float]:
    """(direction of light, BSDF times the cosine over the density [3], the density); 0 where the path ends."""
    towards = sample(
        model, point.base_color, point.metallic, point.roughness, point.f0, point.normal, point.view, choice, place
    )
    value, chance, is_open = reflected_at(model, point, towards, active)
    chance = dr.select(is_open, chance, 0)
    weight = value / dr.maximum(chance, 1e-30)
    if point.kept is not None:
        kept, (theirs, share, likely) = point.kept.number != 0, sample_kept(point.kept, point.view, choice, place, active)
        towards, weight = dr.select(kept, theirs, towards), dr.select(kept, share, weight)
        chance = dr.select(kept, likely, chance)
    return towards, dr.select(active & (chance > 0), weight, 0), dr.select(active, chance, 0)


def leaving(point: Point, towards: mi.Vector3f) -> mi.Ray3f:
    """The ray from a surface, on the side to which it goes."""
    geometric = point.geometric
    if point.kept is not None:
        geometric = geometric * dr.select(dr.dot(geometric, towards) < 0, -1, mi.Float(1))
    return lifted(point.position, geometric, towards, point.distance)


@dr.syntax
def from_lights(world: World, point: Point, rng: mi.PCG32, active: mi.Bool) -> mi.Color3f:
    """Radiance [3] reflected from one drawn light, or from the sky."""
    shading, lights, sky = world.shading, world.lights, world.shading.sky
    choice, place = mi.Float(rng.next_float32()), mi.Point2f(rng.next_float32(), rng.next_float32())
    index, share = choose_light(lights, choice)
    towards, distance = mi.Vector3f(0, 0, 1), mi.Float(FAR)
    radiance, chance, extent = mi.Color3f(0), mi.Float(0), mi.Bool(True)
    if dr.hint(not sky.black, mode="scalar"):
        towards, radiance, chance = sample_sky(sky, place)
    if dr.hint(bool(lights.kinds), mode="scalar"):
        is_light = active & (index < lights.count)
        drawn = sample_light(
            lights, shading.geometry, shading.materials, world.pose, index, point.position, place, is_light
        )
        towards, distance = dr.select(is_light, drawn.towards, towards), dr.select(is_light, drawn.distance, distance)
        radiance, chance = dr.select(is_light, drawn.radiance, radiance), dr.select(is_light, drawn.density, chance)
        extent = dr.select(is_light, drawn.extent, True)
    reflected, likely, is_open = reflected_at(shading.brdf.model, point, towards, active)
    lit = active & (chance > 0) & is_open
    chance *= share
    rival = dr.select(extent, likely, 0)
    ray = leaving(point, towards)
    ray.maxt = distance * SHORT_OF_LIGHT
    value = reflected * radiance / dr.maximum(chance + rival, 1e-30)
    return dr.select(lit, value * _passes(world, ray, rng, lit), 0)


@dr.syntax
def _passes(world: World, ray: mi.Ray3f, rng, active: mi.Bool) -> mi.Float:
    """1 where nothing stops the ray, else 0; a blended surface stops it with the probability of its opacity."""
    shading, pose = world.shading, world.pose
    stopped = mi.Bool(False)
    if dr.hint(shading.materials.blends, mode="scalar"):
        hit, _ = next_surface(shading, pose, ray, None, mi.Float(0), rng, active)
        stopped = hit.valid
    else:
        stopped = is_shadowed(shading, pose, ray, active)
    return dr.select(stopped, mi.Float(0), 1)


@dr.syntax
def met_light(world: World, ray, hit: Hit, distance, glow, chance, active: mi.Bool) -> mi.Color3f:
    """Radiance [3] that a drawn direction meets: sky, lights with an extent, and the emission of the surface, each weighted
    against being drawn as a light. `chance` is the direction's density."""
    shading, lights, sky = world.shading, world.lights, world.shading.sky
    total, rival = mi.Color3f(0), mi.Float(0)
    if dr.hint("mesh" in lights.kinds, mode="scalar"):
        rival = mesh_light_density(lights.meshes, shading.geometry, world.pose, hit, ray.d, distance)
        rank = dr.gather(mi.UInt32, lights.meshes.rank, hit.object, hit.valid)
        rival *= dr.gather(mi.Float, lights.choice, lights.first_mesh + rank, rival > 0)
    total += dr.select(hit.valid, glow * (chance / dr.maximum(chance + rival, 1e-30)), 0)
    if dr.hint(not sky.black, mode="scalar"):
        radiance, drawn = sky_along(sky, ray.d, active & ~hit.valid)
        drawn *= dr.gather(mi.Float, lights.choice, lights.count)
        total += dr.select(hit.valid, 0, radiance * (chance / dr.maximum(chance + drawn, 1e-30)))
    if dr.hint(bool(lights.kinds & {"rectangle", "disk", "sphere"}), mode="scalar"):
        k = mi.UInt32(0)
        while dr.hint(k < lights.count, exclude=[world, shading, lights, sky, hit, ray, distance, glow, chance, active]):
            radiance, drawn = light_along(lights, k, ray.o, ray.d, distance)
            drawn *= dr.gather(mi.Float, lights.choice, k)
            total += radiance * (chance / dr.maximum(chance + drawn, 1e-30))
            k += 1
    return dr.select(active, total, 0)


@dr.syntax
def next_surface(
    shading: Shading, pose: Pose, ray: mi.Ray3f, pixel: Pixel | None, start: mi.Float, rng: mi.PCG32, active: mi.Bool
) -> tuple[Hit, mi.Float]:
    """The next surface along a ray and its parameter; a blended one is met with the probability of its opacity."""
    geometry, materials = shading.geometry, shading.materials
    layered = materials.blends
    hit, distance = first_solid(geometry, materials, pose, ray, pixel, active, start=start, blended_too=layered)
    if dr.hint(layered, mode="scalar"):
        least = SKIP_ORIGIN * dr.max(dr.abs(ray.o)) / dr.norm(ray.d)
        valid, item, face, uv, reached = mi.Bool(hit.valid), hit.object, hit.face, mi.Point2f(hit.uv), mi.Float(distance)
        going = valid & True
        while dr.hint(going, exclude=[shading, geometry, materials, pose, ray, pixel, layered, hit, least]):
            here = Hit(valid, item, face, uv)
            material = dr.gather(mi.UInt32, geometry.tables.material, item, valid)
            triangle = triangle_of(geometry.tables, pose, here)
            footprint = footprint_of(triangle, ray, pixel)
            opacity = opacity_of(materials, material, footprint, valid)
            going &= is_blended(materials, material, valid) & (rng.next_float32() >= opacity)
            behind = dr.maximum(reached * (1 + SKIP), reached + least)
            after, t = first_solid(geometry, materials, pose, ray, pixel, going, start=behind, blended_too=True)
            valid, item = dr.select(going, after.valid, valid), dr.select(going, after.object, item)
            face, uv, reached = dr.select(going, after.face, face), dr.select(going, after.uv, uv), dr.select(going, t, reached)
            going &= valid
        hit, distance = Hit(valid, item, face, uv), reached
    return hit, distance

