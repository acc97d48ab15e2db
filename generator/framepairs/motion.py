"""Motion, dual motion and visibility by ray: where the surface point was, and what stood there.

Directions and signs are those of `conventions`: motion = previous - current place in pixels, y down; dual motion after
Zeng et al. 2021 and section 2 of the NSRD supplement.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .backend import dr, mi
from .channels import IN_FRONT_OF_PREVIOUS_CAMERA, INSIDE_PREVIOUS_FRAME, SEEN_BY_PREVIOUS_CAMERA
from .gbuffer import GBuffer, camera_ray
from .geometry import Geometry, Pose
from .materials import MaterialTable
from .precise import is_large, precise_motion
from .projection import Projected, View, direction, project, project_direction
from .solid import Pixel, search
from .tracing import point_of

# A point counts as seen when the surface met on its way lies nearer by less than this share of its depth: float32 places
# have a relative error of some 2^-22 after the transforms, and a surface at 1 degree grazing turns that into 1.4e-5 of z.
SEEN_TOLERANCE = 1e-4


@dataclass(frozen=True)
class Motion:
    """motion, dual_motion: [2] pixels, y down. visibility: bits, see channels."""

    motion: mi.Vector2f
    dual_motion: mi.Vector2f
    visibility: mi.UInt32


@dataclass(frozen=True)
class Before:
    """The previous frame: pose, view (and the same in float64), the pixel's footprint in it, and whether there is one
    (false on a reset)."""

    pose: Pose
    view: View
    precise_view: View
    pixel: Pixel
    exists: mi.Bool


def motion_of(
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    view: View,
    precise_view: View,
    before: Before,
    sample: GBuffer,
    x: mi.Float,
    y: mi.Float,
    size: tuple[mi.Float, mi.Float],
    with_occlusion: bool = True,
) -> Motion:
    """Motion of the samples that `sample` describes, seen at fractions (x, y) of a frame of `size` pixels.

    Without `with_occlusion` no ray is traced: dual motion equals motion, and bit 2 of visibility is 0.
    """
    now = geometry, materials, pose, view, precise_view
    return _motion_and_tests(*now, before, (before.pixel.bias,), sample, x, y, size, with_occlusion)[0]


def motions_of(
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    view: View,
    precise_view: View,
    before: Before,
    biases: Sequence[mi.Float],
    samples: list[GBuffer],
    differ: list[mi.Bool],
    x: mi.Float,
    y: mi.Float,
    size: tuple[mi.Float, mi.Float],
    with_occlusion: bool = True,
) -> list[Motion]:
    """`motion_of` what `gbuffers` found for each of `biases`, which are those of the previous frame's pixels, too: computed
    anew where it is another surface, or where alpha tests of the previous frame end otherwise."""
    now = geometry, materials, pose, view, precise_view
    first, tests = _motion_and_tests(*now, before, biases, samples[0], x, y, size, with_occlusion)
    befores = [replace(before, pixel=replace(before.pixel, bias=bias)) for bias in biases]
    anew = [surface | test for surface, test in zip(differ, tests, strict=True)]
    rest = zip(befores[1:], samples[1:], anew[1:], strict=True)
    return [first, *(_own(now, *each, first, x, y, size, with_occlusion) for each in rest)]


@dr.syntax
def _own(now, before: Before, sample: GBuffer, differs: mi.Bool, first: Motion, x, y, size, with_occlusion: bool) -> Motion:
    motion, dual, bits = mi.Vector2f(first.motion), mi.Vector2f(first.dual_motion), mi.UInt32(first.visibility)
    if dr.hint(now[1].masks, mode="scalar"):
        if dr.hint(differs, exclude=[now, before, sample, first, x, y, size, with_occlusion]):
            own = motion_of(*now, before, sample, x, y, size, with_occlusion)
            motion, dual, bits = own.motion, own.dual_motion, own.visibility
    return Motion(motion, dual, bits)


def _motion_and_tests(
    geometry, materials, pose, view, precise_view, before: Before, biases, sample: GBuffer, x, y, size, with_occlusion
) -> tuple[Motion, list[mi.Bool]]:
    """(`motion_of` with the first of `biases`, where the previous frame's alpha tests end otherwise with each of them)."""
    hit = sample.hit
    sky = direction(view, x, y)
    then = _choose(
        hit.valid,
        project(before.view, point_of(geometry.tables, before.pose, hit)),
        _sky_place(before.view, sky, x, y),
    )
    now = _choose(hit.valid, project(view, sample.position), _sky_place(view, sky, x, y))
    then, apart = _refined(geometry, pose, view, precise_view, before, sample, x, y, then, now)
    in_front = then.z > 0
    motion = mi.Vector2f(apart.x * size[0], apart.y * size[1])
    motion = dr.select(in_front, motion, _turned_away(then, size))
    inside = in_front & (then.x >= 0) & (then.x < 1) & (then.y >= 0) & (then.y < 1)
    dual, seen, differ = motion, mi.Bool(False), [mi.Bool(False) for _ in biases]
    if with_occlusion:
        dual, seen, differ = _dual(geometry, materials, pose, view, before, biases, hit, then, motion, inside, (x, y), size)
    bits = dr.select(inside, mi.UInt32(INSIDE_PREVIOUS_FRAME), 0)
    bits |= dr.select(in_front, mi.UInt32(IN_FRONT_OF_PREVIOUS_CAMERA), 0)
    bits |= dr.select(seen, mi.UInt32(SEEN_BY_PREVIOUS_CAMERA), 0)
    found = Motion(
        motion=dr.select(before.exists, motion, 0),
        dual_motion=dr.select(before.exists, dual, 0),
        visibility=dr.select(before.exists, bits, 0),
    )
    return found, differ


@dr.syntax
def _refined(
    geometry, pose, view, precise_view, before, sample, x, y, then: Projected, now: Projected
) -> tuple[Projected, mi.Vector2f]:
    """(previous place, previous minus present place in fractions of the frame), in float64 on large triangles."""
    place, z, apart = mi.Point2f(then.x, then.y), mi.Float(then.z), mi.Vector2f(then.x - now.x, then.y - now.y)
    hit = sample.hit
    large = is_large(geometry, pose, view, hit, sample.depth)
    if dr.hint(large, exclude=[geometry, pose, view, precise_view, before, sample, hit, then, now]):
        place, z, apart = precise_motion(geometry, pose, before.pose, precise_view, before.precise_view, hit, x, y)
    return Projected(place.x, place.y, z, then.lateral), apart


def _dual(
    geometry, materials, pose, view, before, biases, hit, then, motion, inside, place, size
) -> tuple[mi.Vector2f, mi.Bool, list[mi.Bool]]:
    """(dual motion, seen by the previous camera, where alpha tests end otherwise with each bias)."""
    ray = camera_ray(before.view, then.x, then.y)
    met, z, differ = search(geometry, materials, before.pose, ray, before.pixel, biases, inside, start=before.view.near)
    same = met.valid & hit.valid & (met.object == hit.object) & (met.face == hit.face)
    seen = inside & dr.select(hit.valid, same | ~met.valid | (z >= then.z * (1 - SEEN_TOLERANCE)), ~met.valid)
    if geometry.hides:  # what was not drawn was not seen, whatever stood there
        seen &= ~(hit.valid & dr.gather(mi.Bool, before.pose.hidden, hit.object, hit.valid))
    occluder = _choose(
        met.valid,
        project(view, point_of(geometry.tables, pose, met)),
        _sky_place(view, ray.d, then.x, then.y),
    )
    # y - z = (x + motion) - z, with x the sample's own place
    relative = mi.Vector2f((place[0] - occluder.x) * size[0], (place[1] - occluder.y) * size[1]) + motion
    occluded = inside & ~seen & (occluder.z > 0)
    return dr.select(occluded, relative, motion), seen, differ


def _sky_place(view: View, towards: mi.Vector3f, x: mi.Float, y: mi.Float) -> Projected:
    """Where the sky of a direction appears. An orthographic camera sees one direction everywhere: its sky stands still."""
    here = Projected(x, y, mi.Float(1), mi.Vector2f(0))
    return _choose(view.perspective, project_direction(view, towards), here)


def _choose(condition: mi.Bool, a: Projected, b: Projected) -> Projected:
    return Projected(*(dr.select(condition, *pair) for pair in zip(vars(a).values(), vars(b).values(), strict=True)))


def _turned_away(then: Projected, size: tuple[mi.Float, mi.Float]) -> mi.Vector2f:
    """For points behind the previous camera: along their lateral direction, 2 max(width, height) long."""
    towards = mi.Vector2f(then.lateral.x * size[0], then.lateral.y * size[1])
    length = dr.norm(towards)
    unit = dr.select(length > 0, towards / dr.select(length > 0, length, 1), mi.Vector2f(1, 0))
    return unit * (2 * dr.maximum(size[0], size[1]))
