"""What the pixel sees: the nearest opaque or alpha-tested surface along a camera ray, and its material."""

from dataclasses import dataclass, replace

from .backend import dr, mi
from .brdf import Brdf, f0_of, look_up, pre_integrated
from .geometry import Geometry, Pose
from .materials import (
    Footprint,
    MaterialTable,
    Surface,
    bump_change,
    bumps_by_second,
    emitted,
    is_blended,
    is_kept,
    is_opaque,
    opacity_of,
    surface_of,
)
from .projection import View, direction, origin, project
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


@dataclass(frozen=True)
class GBuffer:
    """One sample. view: unit vector towards the camera. normal: shading normal, towards the camera. depth: view_z, +inf in
    the background. f_beta: pre-integrated BRDF, 0 in the background."""

    hit: Hit
    position: mi.Point3f
    geometric: mi.Vector3f
    normal: mi.Vector3f
    view: mi.Vector3f
    depth: mi.Float
    object_id: mi.UInt32
    surface: Surface
    f0: mi.Color3f
    f_beta: mi.Color3f
    a: mi.Float
    b: mi.Float


def pixel_of(view: View, size: tuple[mi.Float, mi.Float], bias: mi.Float) -> Pixel:
    """The footprint of one pixel of an image of `size` pixels."""
    across, down = (view.across, view.origin_across), (view.down, view.origin_down)
    (ddx, origin_ddx), (ddy, origin_ddy) = ([vector / size[k] for vector in pair] for k, pair in enumerate((across, down)))
    return Pixel(ddx, ddy, origin_ddx, origin_ddy, bias)


def camera_ray(view: View, x: mi.Float, y: mi.Float) -> mi.Ray3f:
    """Ray through fraction (x, y) of the frame; its parameter is view_z."""
    ray = mi.Ray3f(origin(view, x, y), direction(view, x, y))
    ray.maxt = view.far
    return ray


def gbuffer(
    geometry: Geometry,
    materials: MaterialTable,
    brdf: Brdf,
    pose: Pose,
    view: View,
    x: mi.Float,
    y: mi.Float,
    pixel: Pixel,
) -> GBuffer:
    """The G-buffer of the samples at fractions (x, y) of the frame."""
    ray = camera_ray(view, x, y)
    hit, _ = first_solid(geometry, materials, pose, ray, pixel, mi.Bool(True), start=view.near)
    return describe_hit(geometry, materials, brdf, pose, view, ray, hit, pixel)


def describe_hit(
    geometry: Geometry,
    materials: MaterialTable,
    brdf: Brdf,
    pose: Pose,
    view: View,
    ray: mi.Ray3f,
    hit: Hit,
    pixel: Pixel | None,
) -> GBuffer:
    """Interpolate and look up everything at a hit, with the pixel's footprint or (None) at the finest texels."""
    valid = hit.valid
    triangle = triangle_of(geometry.tables, pose, hit)
    material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, valid)
    surface = surface_of(materials, material, footprint_of(triangle, ray, pixel), valid)
    surface = replace(surface, emission=emitted(materials, material, surface.emission, triangle.outward, ray.d, valid))
    normal = triangle.normal
    if "normal_texture" in materials.used:
        normal = _bent(triangle, materials, material, surface.tangent_normal, valid)
    behind = dr.dot(triangle.geometric, ray.d) > 0  # surfaces are seen from both sides
    towards = dr.normalize(-ray.d)
    normal = dr.select(behind, -normal, normal)
    f0 = f0_of(surface.base_color, surface.metallic, surface.specular)
    a, b = look_up(brdf, dr.dot(normal, towards), surface.roughness, valid)
    f_beta = pre_integrated(surface.base_color, surface.metallic, f0, a, b)
    if materials.keeps:
        f_beta = dr.select(is_kept(materials, material, valid), 1, f_beta)
    return GBuffer(
        hit=hit,
        position=triangle.position,
        geometric=dr.select(behind, -triangle.geometric, triangle.geometric),
        normal=dr.select(valid, normal, 0),
        view=towards,
        depth=dr.select(valid, project(view, triangle.position).z, dr.inf),
        object_id=dr.select(valid, hit.object + 1, 0),
        surface=surface,
        f0=f0,
        f_beta=dr.select(valid, f_beta, 0),
        a=a,
        b=b,
    )


@dr.syntax
def first_solid(
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    ray: mi.Ray3f,
    pixel: Pixel | None,
    active: mi.Bool,
    start: mi.Float,
    blended_too: bool = False,
) -> tuple[Hit, mi.Float]:
    """The first hit beyond `start` that is opaque after the alpha test, and its ray parameter.

    Blended surfaces are passed through unless `blended_too`. Alpha is looked up with the pixel's footprint, or at the
    finest level for `pixel` None (shadow rays have no footprint).
    """
    passed = mi.Float(start)
    searching = mi.Bool(active)
    least = SKIP_ORIGIN * dr.max(dr.abs(ray.o)) / dr.norm(ray.d)
    layer = mi.UInt32(0)
    shell = dr.arange(mi.UInt32, dr.width(ray)) * 0
    valid, item, face, uv = mi.Bool(shell == 1), mi.UInt32(shell), mi.UInt32(shell), mi.Point2f(shell, shell)
    while dr.hint(searching, exclude=[geometry, materials, pose, pixel, blended_too]):
        onward = mi.Ray3f(ray.o + passed * ray.d, ray.d)
        onward.maxt = ray.maxt - passed
        hit, t = trace(geometry, pose, onward, searching, coherent=pixel is not None)
        through = mi.Bool(False)
        if dr.hint(materials.masks or materials.blends, mode="scalar"):
            material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
            doubtful = hit.valid & ~is_opaque(materials, material, hit.valid)
            if dr.hint(doubtful, exclude=[geometry, materials, pose, hit, pixel, blended_too]):
                through = _lets_through(geometry, materials, pose, ray, hit, pixel, blended_too)
        if dr.hint(geometry.culls and pixel is not None, mode="scalar"):
            through |= _is_culled(geometry, pose, ray, hit)
        if dr.hint(geometry.hides, mode="scalar"):
            through |= hit.valid & dr.gather(mi.Bool, pose.hidden, hit.object, hit.valid)
        valid, item, face, uv = hit.valid, hit.object, hit.face, hit.uv
        reached = passed + dr.select(hit.valid, t, 0)
        passed = dr.select(through, dr.maximum(reached * (1 + SKIP), reached + least), reached)
        layer += 1
        searching = through & (layer < MOST_LAYERS)
    return Hit(valid, item, face, uv), dr.select(valid, passed, dr.inf)


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


def _is_culled(geometry, pose, ray, hit) -> mi.Bool:
    """Whether the hit is on the back of an object whose back faces are not drawn."""
    single = hit.valid & dr.gather(mi.Bool, geometry.tables.single_sided, hit.object, hit.valid)
    return single & (dr.dot(triangle_of(geometry.tables, pose, hit).outward, ray.d) > 0)


def _lets_through(geometry, materials, pose, ray, hit, pixel, blended_too) -> mi.Bool:
    material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
    triangle = triangle_of(geometry.tables, pose, hit)
    clear = opacity_of(materials, material, footprint_of(triangle, ray, pixel), hit.valid) <= 0
    return clear if blended_too else clear | is_blended(materials, material, hit.valid)


def _bent(
    triangle: Triangle, materials: MaterialTable, material: mi.UInt32, tangent_normal: mi.Vector3f, valid: mi.Bool
) -> mi.Vector3f:
    """The normal map's normal [3] in render space, by the mesh's tangents or else by uv; the interpolated one where neither
    gives a direction."""
    normal, uv_edge1, uv_edge2 = triangle.normal, triangle.uv_edge1, triangle.uv_edge2
    if triangle.second is not None:
        second = bumps_by_second(materials, material, valid)
        uv_edge1, uv_edge2 = dr.select(second, triangle.second[1], uv_edge1), dr.select(second, triangle.second[2], uv_edge2)
    if materials.moves_uv:
        uv_edge1, uv_edge2 = (bump_change(materials, material, edge, valid) for edge in (uv_edge1, uv_edge2))
    determinant = uv_edge1.x * uv_edge2.y - uv_edge1.y * uv_edge2.x
    tangent = (triangle.edge1 * uv_edge2.y - triangle.edge2 * uv_edge1.y) * dr.sign(determinant)
    tangent = tangent - normal * dr.dot(normal, tangent)
    usable = (dr.squared_norm(tangent) > 0) & (determinant != 0)
    tangent = dr.normalize(dr.select(usable, tangent, mi.Vector3f(1, 0, 0)))
    handedness = dr.sign(determinant) * dr.sign(
        dr.dot(dr.cross(triangle.edge1, triangle.edge2), normal)
    )  # mirrored uv turn the bitangent, not the normal
    if triangle.tangent is not None:
        given, sign = mi.Vector3f(triangle.tangent.x, triangle.tangent.y, triangle.tangent.z), triangle.tangent.w
        is_given = dr.squared_norm(given) > 0
        tangent, handedness = dr.select(is_given, given, tangent), dr.select(is_given, sign, handedness)
        usable |= is_given
    bitangent = dr.cross(normal, tangent) * handedness
    bent = tangent_normal.x * tangent + tangent_normal.y * bitangent + tangent_normal.z * normal
    return dr.select(usable, dr.normalize(bent), normal)
