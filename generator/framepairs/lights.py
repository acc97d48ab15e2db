"""Lights other than the sky, in one table: where they are, how their light is sampled, and what a ray meets of them.

Lights with an extent shine and show in reflections, but are no geometry: they neither stop rays nor hide each other.
Emissive objects are lights, too, where the caller asks for them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .colour import LUMINANCE_709
from .frame import FrameState
from .geometry import Geometry, Pose
from .materials import MaterialTable
from .mesh_lights import MeshLights, first_above, mesh_light_powers, sample_mesh_light
from .scene.description import Light, SceneDescription

KINDS = ("directional", "point", "spot", "rectangle", "disk", "sphere", "mesh")
ROWS = 5  # of four floats per light
SHORT_OF_LIGHT = 1 - 1e-3  # the share of the way to a light on which shadow rays look
LEVEL = 1 + 1e-3  # a light that lies on a surface is met before it, as far as shadow rays end before their light
FAR = 1e30  # distance of directional lights
EQUAL_SHARE = 0.1  # of the choice between lights: what is bright in general may be far from the point at hand


@dataclass(frozen=True)
class Lights:
    """The lights around a render origin.

    values: [20 lights]: radiance 3, kind; position 3, inner cosine of the cone; direction 3, outer cosine; half_u 3, area or
    object; half_v 3, faces of a mesh. kinds: those that occur. choice: probability of each light when one is drawn, the
    sky's last. meshes: the emissive objects among them; they follow the others, from `first_mesh` on.
    """

    values: mi.Float
    count: mi.UInt32
    kinds: frozenset[str]
    first_mesh: mi.UInt32
    choice: mi.Float
    cumulative_choice: mi.Float
    meshes: MeshLights

    @property
    def have_extent(self) -> bool:
        return bool(self.kinds & {"rectangle", "disk", "sphere", "mesh"})


@dataclass(frozen=True)
class LightSample:
    """Light from one point of a light. towards: unit direction to it. radiance: [3], for lights without extent the irradiance
    on a facing surface. density: per solid angle, 1 for lights without extent, 0 where no light comes from there."""

    towards: mi.Vector3f
    distance: mi.Float
    radiance: mi.Color3f
    density: mi.Float
    extent: mi.Bool


def lights_around(scene: SceneDescription, meshes: MeshLights, frame: FrameState) -> Lights:
    """The scene's lights at a frame, with positions relative to its render origin."""
    count = len(frame.lights) + len(meshes.objects)
    rows = np.zeros((max(count, 1), ROWS, 4), dtype=np.float32)
    for row, light in zip(rows, frame.lights, strict=False):
        row[0] = *light.radiance, KINDS.index(light.kind)
        row[1] = *(np.array(light.position) - frame.render_origin), light.cone[0]
        row[2] = *light.direction, light.cone[1] if light.kind == "spot" else -2
        row[3] = *light.half_u, _area(light)
        row[4, :3] = light.half_v
    for row, index, faces in zip(rows[len(frame.lights) : count], meshes.objects, meshes.faces, strict=True):
        row[0, 3], row[3, 3], row[4, 3] = KINDS.index("mesh"), index, faces
    choice = _choice(scene, frame.lights, mesh_light_powers(meshes, frame.objects.world_from_object))
    return Lights(
        values=mi.Float(rows.ravel()),
        count=dr.opaque(mi.UInt32, count),
        kinds=frozenset(light.kind for light in frame.lights) | ({"mesh"} if meshes.objects else set()),
        first_mesh=dr.opaque(mi.UInt32, len(frame.lights)),
        choice=mi.Float(choice.astype(np.float32)),
        cumulative_choice=mi.Float(np.cumsum(choice).astype(np.float32)),
        meshes=meshes,
    )


def choose_light(lights: Lights, u: mi.Float) -> tuple[mi.UInt32, mi.Float]:
    """(index, its probability) of one light drawn with `u` in [0, 1); index `count` is the sky."""
    number = dr.width(lights.choice)
    index = first_above(lights.cumulative_choice, mi.UInt32(0), mi.UInt32(number), number, u, mi.Bool(True))
    return index, dr.gather(mi.Float, lights.choice, index)


def sample_light(
    lights: Lights,
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    index: mi.UInt32,
    position: mi.Point3f,
    u: mi.Point2f,
    active: mi.Bool,
) -> LightSample:
    """Light `index` from the point of it that `u` in [0, 1)^2 picks, as it arrives at `position`."""
    row = [dr.gather(mi.Vector4f, lights.values, index * ROWS + k, active) for k in range(ROWS)]
    kind = mi.UInt32(row[0].w)
    centre, aim = _three(row[1]) - position, _three(row[2])
    towards, distance = -aim, mi.Float(FAR)
    radiance, density = mi.Color3f(_three(row[0])), mi.Float(1)
    extent = kind >= KINDS.index("rectangle")
    if lights.kinds & {"point", "spot"}:
        local = (kind == KINDS.index("point")) | (kind == KINDS.index("spot"))
        length = dr.maximum(dr.norm(centre), 1e-18)
        unit = centre / length
        cone = dr.clip((dr.dot(-unit, aim) - row[2].w) / dr.maximum(row[1].w - row[2].w, 1e-4), 0, 1)
        falloff = dr.select(row[2].w > -1, cone, 1) / dr.square(length)  # a point shines all around
        towards, distance = dr.select(local, unit, towards), dr.select(local, length, distance)
        radiance = dr.select(local, radiance * falloff, radiance)
    if lights.kinds & {"rectangle", "disk"}:
        flat = (kind == KINDS.index("rectangle")) | (kind == KINDS.index("disk"))
        place = 2 * u - 1
        if "disk" in lights.kinds:
            place = dr.select(kind == KINDS.index("disk"), mi.warp.square_to_uniform_disk_concentric(u), place)
        there = centre + place.x * _three(row[3]) + place.y * _three(row[4])
        length = dr.maximum(dr.norm(there), 1e-18)
        unit = there / length
        towards, distance = dr.select(flat, unit, towards), dr.select(flat, length, distance)
        density = dr.select(flat, _per_solid_angle(length, dr.dot(-unit, aim), row[3].w), density)
    if "sphere" in lights.kinds:
        ball = kind == KINDS.index("sphere")
        unit, length, chance = _sample_sphere(centre, row[3], u)
        towards, distance = dr.select(ball, unit, towards), dr.select(ball, length, distance)
        density = dr.select(ball, chance, density)
    if "mesh" in lights.kinds:
        mesh = active & (kind == KINDS.index("mesh"))
        item, faces = mi.UInt32(row[3].w), mi.UInt32(row[4].w)
        unit, length, glow, chance = sample_mesh_light(
            lights.meshes, geometry, materials, pose, item, faces, position, u, mesh
        )
        towards, distance = dr.select(mesh, unit, towards), dr.select(mesh, length, distance)
        radiance, density = dr.select(mesh, glow, radiance), dr.select(mesh, chance, density)
    return LightSample(towards, distance, radiance, density, extent)


def mesh_behind(lights: Lights, index: mi.UInt32) -> tuple[mi.Bool, mi.UInt32]:
    """(whether light `index` is an emissive object, the object's index)."""
    is_mesh = (index >= lights.first_mesh) & (index < lights.count)
    return is_mesh, mi.UInt32(dr.gather(mi.Float, lights.values, (index * ROWS + 3) * 4 + 3, is_mesh))


def light_along(
    lights: Lights, index: mi.UInt32, origin: mi.Point3f, direction: mi.Vector3f, limit: mi.Float
) -> tuple[mi.Color3f, mi.Float]:
    """What a ray of unit direction meets of a rectangle, disk or sphere nearer than `limit`: (radiance [3], density per solid
    angle with which `sample_light` gives this direction); zeros where it meets nothing."""
    row = [dr.gather(mi.Vector4f, lights.values, index * ROWS + k) for k in range(ROWS)]
    kind, aim, density = mi.UInt32(row[0].w), _three(row[2]), mi.Float(0)
    centre = _three(row[1]) - origin
    if lights.kinds & {"rectangle", "disk"}:
        half_u, half_v = _three(row[3]), _three(row[4])
        facing = dr.dot(-direction, aim)
        t = -dr.dot(centre, aim) / dr.select(facing > 0, facing, 1)
        place = t * direction - centre
        x, y = _coordinates(place, half_u, half_v)
        inside = dr.select(kind == KINDS.index("disk"), dr.square(x) + dr.square(y) <= 1, dr.maximum(dr.abs(x), dr.abs(y)) <= 1)
        flat = (kind == KINDS.index("rectangle")) | (kind == KINDS.index("disk"))
        met = flat & (facing > 0) & (t > 0) & (t < limit * LEVEL) & inside
        density = dr.select(met, _per_solid_angle(t, facing, row[3].w), density)
    if "sphere" in lights.kinds:
        squared, radius = dr.squared_norm(centre), dr.norm(_three(row[3]))
        along = dr.dot(centre, direction)
        beside = dr.squared_norm(centre - along * direction)
        t = along - dr.safe_sqrt(dr.square(radius) - beside)
        met = (kind == KINDS.index("sphere")) & (squared > dr.square(radius)) & (beside < dr.square(radius))
        met &= (along > 0) & (t < limit * LEVEL)
        density = dr.select(met, _cone_density(dr.square(radius) / squared), density)
    return dr.select(density > 0, mi.Color3f(_three(row[0])), 0), density


def _sample_sphere(centre: mi.Vector3f, row: mi.Vector4f, u: mi.Point2f) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
    """(direction, distance, density) of a direction within the cone that the sphere fills; density 0 from inside."""
    squared, radius2 = dr.squared_norm(centre), dr.squared_norm(_three(row))
    outside = (squared > radius2) & (radius2 > 0)
    squared = dr.select(outside, squared, 1)
    sine2 = dr.select(outside, radius2 / squared, 0)
    rise = u.x * sine2 / (1 + dr.safe_sqrt(1 - sine2))  # 1 - cosine, without cancellation
    cosine = 1 - rise
    sine = dr.safe_sqrt(rise * (1 + cosine))
    phi = dr.two_pi * u.y
    distance = dr.sqrt(squared)
    frame = mi.Frame3f(dr.select(outside, centre / distance, mi.Vector3f(0, 0, 1)))
    unit = frame.to_world(mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine))
    reach = distance * cosine - dr.safe_sqrt(radius2 - squared * dr.square(sine))
    return unit, reach, dr.select(outside, _cone_density(sine2), 0)


def _cone_density(sine2: mi.Float) -> mi.Float:
    """1 / solid angle of a cone whose half angle has this squared sine."""
    return (1 + dr.safe_sqrt(1 - sine2)) / (dr.two_pi * dr.maximum(sine2, 1e-30))


def _per_solid_angle(distance: mi.Float, cosine: mi.Float, area: mi.Float) -> mi.Float:
    return dr.select((cosine > 0) & (area > 0), dr.square(distance) / dr.maximum(cosine * area, 1e-30), 0)


def _coordinates(place: mi.Vector3f, half_u: mi.Vector3f, half_v: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Coordinates of a vector in a plane along two axes that need not be orthogonal."""
    uu, vv, uv = dr.squared_norm(half_u), dr.squared_norm(half_v), dr.dot(half_u, half_v)
    pu, pv = dr.dot(place, half_u), dr.dot(place, half_v)
    scale = 1 / dr.maximum(uu * vv - dr.square(uv), 1e-30)
    return (pu * vv - pv * uv) * scale, (pv * uu - pu * uv) * scale


def _choice(scene: SceneDescription, lights: tuple[Light, ...], mesh_powers: NDArray[np.float64]) -> NDArray[np.float64]:
    """By what each light gives at the distance of the scene's radius, a part equally; 0 for lights that are black."""
    radius2 = max(scene.squared_diagonal / 4, 1e-12)
    given = [float(np.dot(LUMINANCE_709, light.radiance)) * (_area(light) if light.has_extent else 1) for light in lights]
    given = [value if light.kind == "directional" else value / radius2 for value, light in zip(given, lights, strict=True)]
    given += list(mesh_powers / np.pi / radius2)
    given += [np.pi * scene.environment.mean if scene.environment is not None else 0.0]
    weights = np.maximum(np.array(given, dtype=float), 0)
    if not weights.any():
        return np.eye(1, len(weights), len(weights) - 1)[0]
    return (1 - EQUAL_SHARE) * weights / weights.sum() + EQUAL_SHARE * (weights > 0) / (weights > 0).sum()


def _area(light: Light) -> float:
    half_u, half_v = np.array(light.half_u, float), np.array(light.half_v, float)
    flat = float(np.linalg.norm(np.cross(half_u, half_v)))
    return {"rectangle": 4 * flat, "disk": np.pi * flat, "sphere": np.pi * float(half_u @ half_u)}.get(light.kind, 0.0)


def _three(row: mi.Vector4f) -> mi.Vector3f:
    return mi.Vector3f(row.x, row.y, row.z)
