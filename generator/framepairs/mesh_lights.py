"""Emissive objects as lights: which faces they have, how a point of them is chosen, and how likely a ray's hit was."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .colour import LUMINANCE_709
from .geometry import Geometry, Pose
from .materials import MaterialTable, emitted, opacity_of, surface_of
from .scene.description import Material, SceneDescription
from .scene.images import linear_texels
from .solid import finest_footprint
from .tracing import Hit, triangle_of

NOT_A_LIGHT = 0xFFFFFFFF
LOOKS = 33  # times at which changing emission is looked at: what never shines at one of them is no light
MEAN_TEXELS = 64  # per axis of an emission texture, of which the mean is taken


@dataclass(frozen=True)
class MeshLights:
    """Emissive objects as lights; fixed for a scene.

    objects: their indices. luminances: of their mean emission. moments: [n, 3, 3], sums over the faces of area times the
    outer square of the normal, in object space. faces: their numbers of faces. probability, cumulative: of the choice of a
    face within its object, by area. first: [objects] where an object's faces begin in them, or NOT_A_LIGHT. rank:
    [objects] an object's place in `objects`.
    """

    objects: tuple[int, ...]
    luminances: NDArray[np.float64]
    moments: NDArray[np.float64]
    faces: tuple[int, ...]
    probability: mi.Float
    cumulative: mi.Float
    first: mi.UInt32
    rank: mi.UInt32


def build_mesh_lights(scene: SceneDescription, wanted: bool) -> MeshLights:
    """All emissive objects whose triangles have an area; those alone whose material `shines` where not `wanted`."""
    materials = at_their_brightest(scene)
    emissive = [
        index
        for index, item in enumerate(scene.objects)
        if materials
        and (wanted or materials[item.material].shines)
        and any(materials[item.material].emission)
        and len(scene.meshes[item.mesh].faces)
    ]
    vectors = {mesh: _area_vectors(scene, mesh) for mesh in {scene.objects[index].mesh for index in emissive}}
    chosen = [index for index in emissive if vectors[scene.objects[index].mesh].any()]
    first = np.full(max(len(scene.objects), 1), NOT_A_LIGHT, np.uint32)
    rank = np.zeros_like(first)
    moments, probabilities, place = np.zeros((len(chosen), 3, 3)), [], 0
    for number, index in enumerate(chosen):
        vector = vectors[scene.objects[index].mesh]
        area = np.linalg.norm(vector, axis=1)
        moments[number] = np.einsum("fi,fj,f->ij", vector, vector, 1 / np.maximum(area, 1e-300))
        probabilities.append(area / area.sum())
        first[index], rank[index], place = place, number, place + len(area)
    return MeshLights(
        objects=tuple(chosen),
        luminances=np.array([_mean_luminance(scene, materials[scene.objects[index].material]) for index in chosen]),
        moments=moments,
        faces=tuple(len(part) for part in probabilities),
        probability=_floats(probabilities),
        cumulative=_floats([np.cumsum(part) for part in probabilities]),
        first=mi.UInt32(first),
        rank=mi.UInt32(rank),
    )


def mesh_light_powers(meshes: MeshLights, world_from_object: NDArray[np.float64]) -> NDArray[np.float64]:
    """[n] pi times luminance times area in the world, exact for flat meshes and matrices that scale evenly.

    Area vectors go with the matrix of cofactors: this is the root of the mean squared stretch, times the area.
    """
    linear = np.asarray(world_from_object, float)[list(meshes.objects), :3, :3].reshape(-1, 3, 3)
    a, b, c = linear[:, 0], linear[:, 1], linear[:, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    squared = np.einsum("nij,njk,nik->n", cofactors, meshes.moments, cofactors)
    return np.pi * meshes.luminances * np.sqrt(squared * np.trace(meshes.moments, axis1=1, axis2=2))


def sample_mesh_light(
    meshes: MeshLights,
    geometry: Geometry,
    materials: MaterialTable,
    pose: Pose,
    item: mi.UInt32,
    faces: mi.UInt32,
    position: mi.Point3f,
    u: mi.Point2f,
    active: mi.Bool,
) -> tuple[mi.Vector3f, mi.Float, mi.Color3f, mi.Float]:
    """A point of emissive object `item` with its number of faces: (direction, distance, radiance, density per solid angle)."""
    first = dr.gather(mi.UInt32, meshes.first, item, active)
    found = first_above(meshes.cumulative, first, faces, max(meshes.faces), u.x, active)
    chosen = dr.gather(mi.Float, meshes.probability, found, active)
    before = dr.gather(mi.Float, meshes.cumulative, found, active) - chosen
    root = dr.sqrt(dr.clip((u.x - before) / dr.maximum(chosen, 1e-20), 0, 1))
    hit = Hit(active, item, found - first, mi.Point2f(1 - root, u.y * root))
    triangle = triangle_of(geometry.tables, pose, hit)
    there = mi.Vector3f(triangle.position - position)
    distance = dr.maximum(dr.norm(there), 1e-18)
    towards = there / distance
    density = chosen * _per_area(triangle.edge1, triangle.edge2, towards, distance)
    return towards, distance, emission_at(geometry, materials, pose, hit, towards), dr.select(active, density, 0)


def mesh_light_density(
    meshes: MeshLights, geometry: Geometry, pose: Pose, hit: Hit, direction: mi.Vector3f, distance: mi.Float
) -> mi.Float:
    """For a hit on any object: density per solid angle with which `sample_mesh_light` gives its direction; 0 where it is no
    light."""
    first = dr.gather(mi.UInt32, meshes.first, hit.object, hit.valid)
    known = hit.valid & (first != NOT_A_LIGHT)
    triangle = triangle_of(geometry.tables, pose, hit)
    chosen = dr.gather(mi.Float, meshes.probability, first + hit.face, known)
    return dr.select(known, chosen * _per_area(triangle.edge1, triangle.edge2, direction, distance), 0)


def first_above(
    cumulative: mi.Float, first: mi.UInt32, count: mi.UInt32, largest: int, u: mi.Float, active: mi.Bool
) -> mi.UInt32:
    """Index of the first of `count` (at most `largest`) rising values from `first` on that is greater than u; the last one
    where none is."""
    low, high = mi.UInt32(first), first + dr.maximum(count, 1) - 1
    for _ in range(max(largest - 1, 0).bit_length()):
        middle = (low + high) >> 1
        above = dr.gather(mi.Float, cumulative, middle, active) > u
        low, high = dr.select(above, low, dr.minimum(middle + 1, high)), dr.select(above, middle, high)
    return low


def emission_at(
    geometry: Geometry, materials: MaterialTable, pose: Pose, hit: Hit, direction: mi.Vector3f
) -> mi.Color3f:
    """Radiance [3] that an object emits at a hit against a ray's direction, at the finest texture level, thinned by its
    opacity."""
    material = dr.gather(mi.UInt32, geometry.tables.material, hit.object, hit.valid)
    triangle = triangle_of(geometry.tables, pose, hit)
    footprint = finest_footprint(triangle)
    surface = surface_of(materials, material, footprint, hit.valid)
    emission = emitted(materials, material, surface.emission, triangle.outward, direction, hit.valid)
    opacity = mi.Float(1)
    if materials.masks or materials.blends:
        opacity = opacity_of(materials, material, footprint, hit.valid)
    drawn = hit.valid
    if geometry.hides:
        drawn &= ~dr.gather(mi.Bool, pose.hidden, hit.object, hit.valid)
    return dr.select(drawn, emission * opacity, 0)


def _per_area(edge1: mi.Vector3f, edge2: mi.Vector3f, direction: mi.Vector3f, distance: mi.Float) -> mi.Float:
    """Density per solid angle of a point drawn evenly from a triangle; 0 for one that is seen from its edge."""
    projected = 0.5 * dr.abs(dr.dot(dr.cross(edge1, edge2), direction))
    return dr.select(projected > 0, dr.square(distance) / dr.maximum(projected, 1e-30), 0)


def _area_vectors(scene: SceneDescription, mesh: int) -> NDArray[np.float64]:
    """[faces, 3] normals as long as the faces' areas."""
    corners = scene.meshes[mesh].positions[scene.meshes[mesh].faces].astype(float)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def at_their_brightest(scene: SceneDescription) -> tuple[Material, ...]:
    """The materials, those that change with the brightest emission of the times that are looked at."""
    if scene.materials_at is None:
        return scene.materials
    times = np.linspace(0, scene.animation_end_s, LOOKS)
    moments = zip(*(scene.materials_at(float(time)) for time in times), strict=True)
    return tuple(max(moment, key=lambda material: sum(material.emission)) for moment in moments)


def _mean_luminance(scene: SceneDescription, material: Material) -> float:
    """Of the emission, its texture taken as the mean over some thousand of its texels."""
    emission = np.array(material.emission, float)
    if material.emission_texture is not None:
        texture = scene.textures[material.emission_texture.texture]
        rows, columns = (max(1, extent // MEAN_TEXELS) for extent in texture.texels.shape[:2])
        coarse = replace(texture, texels=texture.texels[rows // 2 :: rows, columns // 2 :: columns])
        emission = emission * np.nan_to_num(linear_texels(coarse)[..., :3]).mean(axis=(0, 1))
    return float(np.maximum(emission, 0) @ LUMINANCE_709)


def _floats(parts: list[NDArray]) -> mi.Float:
    return mi.Float(np.concatenate(parts or [np.zeros(1)]).astype(np.float32))
