"""`path` shading: the light that a raster pixel's surface reflects, estimated by path tracing from that surface.

The primary surface is the G-buffer's: fixed at the jittered place (LR) or at the AA positions (HR), with the texture levels of
the stream. So the frame is aliased like a rasterised one and only its light converges. Surfaces met later have no footprint
and read their finest texels. Lights and BRDF lobes are drawn in turn and weighted by the balance heuristic (Veach and Guibas
1995). Diffuse and specular may reflect more than arrives at grazing angles (the papers' model); `max_depth` bounds that.
"""

import hashlib
from dataclasses import dataclass

import numpy as np

from .backend import dr, mi, opaque
from .conventions import Stream
from .environment import sky_radiance
from .gbuffer import GBuffer, camera_ray, describe_hit, gbuffer
from .geometry import Pose
from .jitter import antialiasing_positions
from .lanes import Lanes
from .lights import Lights
from .path_steps import (
    World,
    drawn_at,
    from_lights,
    leaving,
    met_light,
    next_surface,
    point_of,
)
from .plan import RenderPlan
from .projection import View
from .shading import Shading
from .solid import Pixel

SURE_DEPTH = 5  # edges before Russian roulette begins


@dataclass(frozen=True)
class PathLight:
    """Per pixel. reflected: radiance [3] beyond the `emission` of the opaque surface or sky: colour is their sum. variance:
    [3], of that mean, 0 for a single path. firefly: one light path brings more than half of the sum. rejected: paths that
    were not finite."""

    reflected: mi.Color3f
    variance: mi.Color3f
    firefly: mi.Bool
    rejected: mi.UInt32


def path_light(
    shading: Shading,
    lights: Lights,
    plan: RenderPlan,
    pose: Pose,
    view: View,
    pixel: Pixel,
    stream: Stream,
    lanes: Lanes,
    jitter: tuple[float, float],
    seed: int,
) -> PathLight:
    """The mean over plan.samples_per_pixel light paths per pixel, in the order of `lanes`.

    HR's AA positions share them (at least one each). `seed` decides all random numbers: see `path_seed`.
    """
    paths = max(1, plan.samples_per_pixel // stream.samples)
    # Optimising a loop records it twice, and loops here are nested six deep.
    with dr.scoped_set_flag(dr.JitFlag.OptimizeLoops, False):
        mean, variance, largest, total, rejected = _means(
            World(shading, lights, pose, pixel, dr.opaque(mi.UInt32, plan.max_depth)),
            view,
            random_numbers(lanes.index, seed),
            corner=mi.Vector2f(lanes.x, lanes.y),
            inside=mi.Float(np.array(antialiasing_positions(stream.samples, stream.pattern), dtype=np.float32).ravel()),
            jitter=opaque(mi.Vector2f, jitter),
            size=opaque(mi.Vector2f, stream.size),
            places=dr.opaque(mi.UInt32, stream.samples),
            paths=dr.opaque(mi.UInt32, paths),
            limit=dr.opaque(mi.Float, plan.clamp_radiance or float("inf")),
        )
    enough = paths * stream.samples >= 8
    return PathLight(mean, variance, (2 * largest > total) & (total > 0) & enough, rejected)


def path_seed(seed: int, frame: int, stream: Stream) -> int:
    """32 bits from the sequence's seed, the frame's number and the stream."""
    text = f"{seed} {frame} {stream.name} {stream.size[0]}x{stream.size[1]}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def random_numbers(index: mi.UInt32, seed: int) -> mi.PCG32:
    """A generator per pixel `index`. The pixels are scrambled (Zafar et al. 2010): PCG's neighbouring sequences resemble
    each other."""
    state, sequence = mi.sample_tea_32(dr.opaque(mi.UInt32, seed), index)
    return mi.PCG32(1, mi.UInt64(state), mi.UInt64(sequence))


@dr.syntax
def _means(world: World, view, rng, corner, inside, jitter, size, places, paths, limit):
    """(mean [3], its variance [3], luminance of the brightest path, sum of luminances, number of rejected paths).

    A loop and no film, so that a pixel's paths are summed in one order: equal calls give equal bytes. The variance is that
    within the AA positions, where each has more than one path; else that over all paths, which is an upper bound.
    """
    shading, pose, pixel = world.shading, world.pose, world.pixel
    total, within, largest, bright = mi.Color3f(0), mi.Color3f(0), mi.Float(0), mi.Float(0)
    mean, spread, seen = mi.Color3f(0), mi.Color3f(0), mi.Float(0)
    rejected, place_index = mi.UInt32(0), mi.UInt32(0)
    one_each = paths == 1
    while dr.hint(place_index < places, exclude=[world, shading, pose, pixel, view, inside, jitter, size, paths, limit]):
        place = (corner + dr.gather(mi.Vector2f, inside, place_index) - jitter) / size
        ray = camera_ray(view, place.x, place.y)
        first = gbuffer(shading.geometry, shading.materials, shading.brdf, pose, view, place.x, place.y, pixel)
        mean, spread, seen = (
            dr.select(one_each, mean, 0),
            dr.select(one_each, spread, 0),
            dr.select(one_each, seen, 0),
        )
        k = mi.UInt32(0)
        while dr.hint(k < paths, exclude=[world, shading, pose, pixel, view, first, ray, paths, limit]):
            value = _one_path(world, view, first, ray, rng)
            finite = dr.all(dr.isfinite(value))
            rejected += dr.select(finite, mi.UInt32(0), 1)
            value = dr.select(finite, value, 0)
            brightness = mi.luminance(value)
            value *= dr.minimum(1, limit / dr.maximum(brightness, 1e-30))
            brightness = dr.minimum(brightness, limit)
            largest, bright = dr.maximum(largest, brightness), bright + brightness
            total += value
            seen += 1
            step = value - mean
            mean += step / seen
            spread += step * (value - mean)
            k += 1
        within += dr.select(one_each, 0, spread / dr.maximum(seen - 1, 1) / seen)
        place_index += 1
    n, groups = mi.Float(paths * places), mi.Float(places)
    over_all = spread / dr.maximum(seen - 1, 1) / dr.maximum(seen, 1)
    return total / n, dr.select(one_each, over_all, within / dr.square(groups)), largest, bright, rejected


@dr.syntax
def _one_path(world: World, view: View, first: GBuffer, ray: mi.Ray3f, rng: mi.PCG32) -> mi.Color3f:
    """Radiance [3] of one path beyond what the opaque surface (or the sky) emits itself."""
    shading, lights, pose, pixel = world.shading, world.lights, world.pose, world.pixel
    model, light = shading.brdf.model, mi.Color3f(0)
    start = first
    if dr.hint(shading.materials.blends, mode="scalar"):
        hit, _ = next_surface(shading, pose, ray, pixel, mi.Float(view.near), rng, mi.Bool(True))
        start = describe_hit(shading.geometry, shading.materials, shading.brdf, pose, view, ray, hit, pixel)
        sky = sky_radiance(shading.sky, ray.d, pixel.ddx, pixel.ddy, ~first.hit.valid)
        light = dr.select(start.hit.valid, start.surface.emission, sky)
        light -= dr.select(first.hit.valid, first.surface.emission, sky)
    point = point_of(world, start, dr.select(start.hit.valid, start.depth, 0))
    throughput, depth = mi.Color3f(1), mi.UInt32(1)
    active = mi.Bool(start.hit.valid)
    while dr.hint(
        active & (depth < world.max_depth), exclude=[world, shading, lights, pose, pixel, view, first, start, ray, model]
    ):
        light += throughput * from_lights(world, point, rng, active)
        chosen = mi.Float(rng.next_float32())
        drawn = mi.Point2f(rng.next_float32(), rng.next_float32())
        towards, weight, chance = drawn_at(model, point, chosen, drawn, active)
        active &= chance > 0
        throughput *= weight
        onward = leaving(point, towards)
        hit, distance = next_surface(shading, pose, onward, None, mi.Float(0), rng, active)
        following = describe_hit(shading.geometry, shading.materials, shading.brdf, pose, view, onward, hit, None)
        light += throughput * met_light(world, onward, hit, distance, following.surface.emission, chance, active)
        active &= hit.valid
        point = point_of(world, following, dr.maximum(point.distance, dr.select(active, distance, 0)))
        depth += 1
        survival = dr.select(depth > SURE_DEPTH, dr.clip(dr.max(throughput), 0.05, 0.95), 1)
        active &= (rng.next_float32() < survival) & (dr.max(throughput) > 0)
        throughput /= survival
    return light
