"""The first surface along a ray that stops it: past what is cut out by its alpha, blended, culled or hidden."""

from dataclasses import dataclass, replace

from .backend import dr, mi
from .geometry import Geometry, Pose
from .materials import Footprint, MaterialTable, is_blended, is_opaque, opacities_of
from .tracing import Hit, Triangle, trace, triangle_of

# Past a layer that lets a ray through, it goes on behind this share of its parameter and of its origin's coordinates.
SKIP, SKIP_ORIGIN = 1e-5, 1e-6
MOST_LAYERS = 256


@dataclass(frozen=True)
class Pixel:
    """Derivatives of a ray's direction and origin per pixel in x and y, and the stream's mip bias in levels."""

    ddx: mi.Vector3f
    ddy: mi.Vector3f
    origin_ddx: mi.Vector3f
    origin_ddy: mi.Vector3f
    bias: mi.Float


def first_solid(
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    ray: mi.Ray3f,
    pixel: Pixel | None,
    active: mi.Bool,
    start: mi.Float,
    blended_too: bool = False,
    coherent: bool | None = None,
) -> tuple[Hit, mi.Float]:
    """The first hit beyond `start` that is opaque after the alpha test, and its ray parameter.

    Blended surfaces are passed through unless `blended_too`. Alpha is looked up with the pixel's footprint, or at the
    finest level for `pixel` None (shadow rays have no footprint). coherent: neighbouring rays go alike, which changes no
    result; by default those with a footprint.
    """
    biases = (mi.Float(0) if pixel is None else pixel.bias,)
    return search(geometry, materials, pose, ray, pixel, biases, active, start, blended_too, coherent)[:2]


@dr.syntax
def search(
    geometry, materials, pose, ray, pixel, biases, active, start, blended_too: bool = False, coherent: bool | None = None
) -> tuple[Hit, mi.Float, list[mi.Bool]]:
    """`first_solid` with the first of `biases` in place of the pixel's, and for each of them whether an alpha test on the way
    ends otherwise with it than with the first."""
    coherent = pixel is not None if dr.hint(coherent is None, mode="scalar") else coherent
    least = SKIP_ORIGIN * dr.max(dr.abs(ray.o)) / dr.norm(ray.d)
    hit, passed = _next_hit(geometry, pose, ray, mi.Float(start), active, coherent)
    valid, item, face, uv = mi.Bool(hit.valid), mi.UInt32(hit.object), mi.UInt32(hit.face), mi.Point2f(hit.uv)
    differ = [mi.Bool(False) for _ in biases]
    if dr.hint(materials.masks or materials.blends or geometry.hides or geometry.culls, mode="scalar"):
        searching, layer = _may_let_through(geometry, materials, pose, hit, pixel), mi.UInt32(1)
        while dr.hint(
            searching, exclude=[geometry, materials, pose, pixel, biases, blended_too, coherent, hit, ray, least, active]
        ):
            met = Hit(valid, item, face, uv)
            passes = _lets_through(geometry, materials, pose, ray, met, pixel, biases, blended_too)
            differ = _noted(differ, passes)
            further = passes[0] & (layer < MOST_LAYERS)
            behind = dr.maximum(passed * (1 + SKIP), passed + least)
            following, reached = _next_hit(geometry, pose, ray, behind, further, coherent)
            valid, item = dr.select(further, following.valid, valid), dr.select(further, following.object, item)
            face, uv = dr.select(further, following.face, face), dr.select(further, following.uv, uv)
            passed = dr.select(further, reached, passed)
            layer += 1
            searching = further & _may_let_through(geometry, materials, pose, following, pixel)
    return Hit(valid, item, face, uv), dr.select(valid, passed, dr.inf), differ


def _next_hit(geometry, pose, ray, start: mi.Float, active: mi.Bool, coherent: bool) -> tuple[Hit, mi.Float]:
    """The first triangle beyond `start`, and the ray's parameter there (`start` where nothing is met)."""
    onward = mi.Ray3f(ray.o + start * ray.d, ray.d)
    onward.maxt = ray.maxt - start
    hit, t = trace(geometry, pose, onward, active, coherent=coherent)
    return hit, start + dr.select(hit.valid, t, 0)


def _may_let_through(geometry, materials, pose, hit: Hit, pixel) -> mi.Bool:
    """Whether the hit needs a closer look."""
    doubtful = mi.Bool(False)
    if materials.masks or materials.blends:
        material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
        doubtful |= ~is_opaque(materials, material, hit.valid)
    if geometry.culls and pixel is not None:
        doubtful |= dr.gather(mi.Bool, geometry.tables.single_sided, hit.object, hit.valid)
    if geometry.hides:
        doubtful |= dr.gather(mi.Bool, pose.hidden, hit.object, hit.valid)
    return hit.valid & doubtful


def _noted(differ: list[mi.Bool], passes: list[mi.Bool]) -> list[mi.Bool]:
    return [before | (own ^ passes[0]) for before, own in zip(differ, passes, strict=True)]


def _lets_through(geometry, materials, pose, ray, hit: Hit, pixel, biases, blended_too: bool) -> list[mi.Bool]:
    """For each bias, whether the ray goes on behind the hit: it is clear, blended, on a back that is not drawn, or hidden."""
    triangle, always, clear = triangle_of(geometry.tables, pose, hit), mi.Bool(False), [mi.Bool(False) for _ in biases]
    if materials.masks or materials.blends:
        material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
        opacities = opacities_of(materials, material, footprint_of(triangle, ray, pixel), biases, hit.valid)
        clear = [opacity <= 0 for opacity in opacities]
        if not blended_too:
            always |= is_blended(materials, material, hit.valid)
    if geometry.culls and pixel is not None:
        single = dr.gather(mi.Bool, geometry.tables.single_sided, hit.object, hit.valid)
        always |= single & (dr.dot(triangle.outward, ray.d) > 0)
    if geometry.hides:
        always |= dr.gather(mi.Bool, pose.hidden, hit.object, hit.valid)
    return [hit.valid & (always | each) for each in clear]


def footprint_of(triangle: Triangle, ray: mi.Ray3f, pixel: Pixel | None) -> Footprint:
    """uv and its change per pixel: the neighbouring pixels' rays meet the triangle's plane, in barycentric coordinates.

    None has no extent and reads the finest texels.
    """
    if pixel is None:
        return finest_footprint(triangle)
    normal = dr.cross(triangle.edge1, triangle.edge2)
    squared = dr.squared_norm(normal)
    scale = dr.select(squared > 0, 1 / squared, 0)
    facing = dr.dot(normal, ray.d)
    facing = dr.select(dr.abs(facing) > 0, facing, 1e-30)
    t = dr.dot(normal, triangle.position - ray.o) / facing

    def change(derivative: mi.Vector3f, origin_derivative: mi.Vector3f) -> mi.Vector2f:
        beside = t * derivative + origin_derivative
        moved = beside - ray.d * (dr.dot(normal, beside) / facing)
        u = dr.dot(dr.cross(moved, triangle.edge2), normal) * scale
        v = dr.dot(dr.cross(triangle.edge1, moved), normal) * scale
        return mi.Vector2f(u, v)

    dx, dy = change(pixel.ddx, pixel.origin_ddx), change(pixel.ddy, pixel.origin_ddy)

    def covered(uv: mi.Point2f, edge1: mi.Vector2f, edge2: mi.Vector2f) -> Footprint:
        return Footprint(uv, dx.x * edge1 + dx.y * edge2, dy.x * edge1 + dy.y * edge2, pixel.bias)

    first = covered(triangle.uv, triangle.uv_edge1, triangle.uv_edge2)
    second = None if triangle.second is None else covered(*triangle.second)
    return replace(first, second=second, color=triangle.color)


def finest_footprint(triangle: Triangle) -> Footprint:
    """One without extent, which reads the finest texels."""
    none, level = mi.Vector2f(0), mi.Float(0)
    second = None if triangle.second is None else Footprint(triangle.second[0], none, none, level)
    return Footprint(triangle.uv, none, none, level, second, triangle.color)
