"""What the pixel sees: the nearest opaque or alpha-tested surface along a camera ray, and its material."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .backend import dr, mi
from .brdf import Brdf, f0_of, look_up, pre_integrated
from .geometry import Geometry, Pose
from .materials import (
    MaterialTable,
    Surface,
    bump_change,
    bumps_by_second,
    emitted,
    is_kept,
    surfaces_of,
)
from .projection import View, direction, origin, project
from .solid import Pixel, footprint_of, search
from .tracing import Hit, Triangle, triangle_of


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
    return gbuffers(geometry, materials, brdf, pose, view, x, y, pixel, (pixel.bias,))[0][0]


def gbuffers(
    geometry: Geometry,
    materials: MaterialTable,
    brdf: Brdf,
    pose: Pose,
    view: View,
    x: mi.Float,
    y: mi.Float,
    pixel: Pixel,
    biases: Sequence[mi.Float],
) -> tuple[list[GBuffer], list[mi.Bool]]:
    """`gbuffer` for each of `biases` in place of the pixel's, and whether its hit may differ from that of the first.

    One ray serves all, but for alpha tests that end otherwise with another bias: there it has its own.
    """
    ray = camera_ray(view, x, y)
    hit, _, differ = search(geometry, materials, pose, ray, pixel, biases, mi.Bool(True), view.near)
    scene = geometry, materials, brdf, pose, view
    first, *others = _described(*scene, ray, hit, pixel, biases)
    others = [_own(scene, ray, *each, pixel) for each in zip(others, differ[1:], biases[1:], strict=True)]
    return [first, *others], differ


@dr.syntax
def _own(scene, ray: mi.Ray3f, sample: GBuffer, differs: mi.Bool, bias: mi.Float, pixel: Pixel) -> GBuffer:
    """The sample, as a ray of its own meets it where it differs."""
    if dr.hint(scene[1].masks, mode="scalar"):
        values = _unpacked(sample)
        if dr.hint(differs, exclude=[scene, ray, sample, bias, pixel]):
            hit = search(scene[0], scene[1], scene[3], ray, pixel, (bias,), differs, scene[4].near)[0]
            values = _unpacked(_described(*scene, ray, hit, pixel, (bias,))[0])
        sample = _packed(values)
    return sample


def _unpacked(sample: GBuffer) -> dict:
    """A copy that may be the state of a branch."""
    return vars(sample) | {"hit": dict(vars(sample.hit)), "surface": dict(vars(sample.surface))}


def _packed(values: dict) -> GBuffer:
    return GBuffer(**values | {"hit": Hit(**values["hit"]), "surface": Surface(**values["surface"])})


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
    biases = (mi.Float(0) if pixel is None else pixel.bias,)
    return _described(geometry, materials, brdf, pose, view, ray, hit, pixel, biases)[0]


def _described(geometry, materials, brdf, pose, view, ray, hit: Hit, pixel: Pixel | None, biases) -> list[GBuffer]:
    """`describe_hit` for each of `biases`."""
    valid = hit.valid
    triangle = triangle_of(geometry.tables, pose, hit)
    material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, valid)
    behind = dr.dot(triangle.geometric, ray.d) > 0  # surfaces are seen from both sides
    towards, depth = dr.normalize(-ray.d), project(view, triangle.position).z

    def described(surface: Surface) -> GBuffer:
        emission = emitted(materials, material, surface.emission, triangle.outward, ray.d, valid)
        normal = triangle.normal
        if "normal_texture" in materials.used:
            normal = _bent(triangle, materials, material, surface.tangent_normal, valid)
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
            depth=dr.select(valid, depth, dr.inf),
            object_id=dr.select(valid, hit.object + 1, 0),
            surface=replace(surface, emission=emission),
            f0=f0,
            f_beta=dr.select(valid, f_beta, 0),
            a=a,
            b=b,
        )

    return [described(each) for each in surfaces_of(materials, material, footprint_of(triangle, ray, pixel), biases, valid)]


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
