"""Rays through a scene as it is posed over time: how far surfaces are, for those who look for room.

Everything that is drawn counts as solid: masked leaves, blended panes, and back faces too. Points are relative to the
probe's origin, in scene units, so that float32 resolves them however far the scene lies from its own origin.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..backend import dr, mi
from ..frame import FrameState, ObjectStates, Shoot, orbit
from ..geometry import Geometry
from ..scene.description import SceneDescription
from ..transforms import Vector

RAYS_AT_ONCE = 1 << 21
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True)
class Probe:
    """A scene that rays are traced through. scene: what is drawn of it. frame: the state that poses are made of. origin:
    [3], scene units; points of rays are relative to it. times: seconds at which the scene is looked at as a whole."""

    scene: SceneDescription
    geometry: Geometry
    frame: FrameState
    origin: Vector
    times: tuple[float, ...]
    _kept: dict[float, mi.Scene] = field(default_factory=dict)

    def posed(self, time_s: float) -> mi.Scene:
        """What rays meet at a time of the animation. The scene that was handed out for another time is gone."""
        if time_s in self._kept:
            return self._kept[time_s]
        scene = self.scene
        deformed = scene.deformed(time_s) if scene.deformed else {}
        visible = np.ones(len(scene.objects), dtype=bool)
        states = ObjectStates(world_from_object=scene.world_from_object(time_s), visible=visible, deformed=deformed)
        frame = replace(self.frame, objects=states, previous_objects=states)
        self._kept.clear()
        self._kept[time_s] = self.geometry.pose(frame)[0].scene
        return self._kept[time_s]

    def poses(self) -> Iterator[mi.Scene]:
        """The scene at each of `times`, one after the other."""
        return (self.posed(time_s) for time_s in self.times)


def make_probe(scene: SceneDescription, origin: Vector, times: tuple[float, ...]) -> Probe:
    """`scene` must have something drawn at one of `times` (seconds of its animation, the first is what is seen)."""
    drawn = drawn_objects(scene, times)
    frame = Shoot(drawn, orbit(drawn, frames=1), 1.0).state(0)
    return Probe(drawn, Geometry(drawn), replace(frame, render_origin=np.asarray(origin, dtype=float)), origin, times)


def drawn_objects(scene: SceneDescription, times: tuple[float, ...]) -> SceneDescription:
    """The scene without objects that are hidden, without triangles, or flattened by their matrix at all of `times`; those
    that are drawn at one of them stay for all."""
    kept = np.zeros(len(scene.objects), dtype=bool)
    for time_s in times:
        visible = scene.visible(time_s) if scene.visible else np.ones(len(scene.objects), dtype=bool)
        kept |= visible & (np.linalg.det(scene.world_from_object(time_s)[:, :3, :3]) != 0)
    kept &= np.array([len(scene.meshes[item.mesh].faces) > 0 for item in scene.objects], dtype=bool)
    if kept.all():
        return replace(scene, visible=None)
    chosen = np.flatnonzero(kept)
    return replace(
        scene,
        objects=tuple(scene.objects[index] for index in chosen),
        world_from_object=lambda time_s: scene.world_from_object(time_s)[chosen],
        visible=None,
    )


def animation_times(scene: SceneDescription, seconds: float, count: int) -> tuple[float, ...]:
    """`count` times evenly over the first `seconds` of the animation, or 0 alone where nothing moves."""
    end = min(seconds, scene.animation_end_s)
    return tuple(np.linspace(0, end, count).tolist()) if scene.moves and end > 0 else (0.0,)


def mesh_scene(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> mi.Scene:
    """One mesh alone, in its own space: what rays meet. positions: [V, 3]; faces: [T, 3]."""
    shape = mi.Mesh("mesh", len(positions), len(faces))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(positions).ravel()
    parameters["faces"] = np.ascontiguousarray(faces).ravel()
    parameters.update()
    return mi.load_dict({"type": "scene", "mesh": shape})


def first_hits(scene: mi.Scene, points: NDArray, directions: NDArray, reach: float = math.inf) -> NDArray[np.float32]:
    """Distance [n] to the first surface along rays from points [n, 3] in directions [n, 3], in units of their lengths; inf
    where there is none within `reach`."""
    distances = np.empty(len(points), dtype=np.float32)
    farthest = dr.opaque(mi.Float, min(reach, 1e30))
    for first in range(0, len(points), RAYS_AT_ONCE):
        part = slice(first, first + RAYS_AT_ONCE)
        ray = mi.Ray3f(_vectors(mi.Point3f, points[part]), _vectors(mi.Vector3f, directions[part]))
        ray.maxt = farthest
        found = scene.ray_intersect_preliminary(ray, coherent=False)
        distances[part] = dr.select(found.is_valid(), found.t, dr.inf).numpy()
    return distances


def hits_around(scene: mi.Scene, points: NDArray, directions: NDArray, reach: float) -> NDArray[np.float32]:
    """Distance [n, k] from points [n, 3] along directions [n, k, 3], inf where nothing is within `reach`."""
    count = directions.shape[1]
    found = first_hits(scene, np.repeat(points, count, axis=0), directions.reshape(-1, 3), reach)
    return found.reshape(len(points), count)


def turned_spheres(points: int, count: int, up: int) -> NDArray[np.float32]:
    """[points, count, 3] unit directions over the sphere for each of `points`: a Fibonacci lattice (Gonzalez 2010), turned
    about axis `up` by another multiple of the golden angle for each, so that neighbours fill each other's gaps.

    Every direction lies within 2.8 / sqrt(count) radians of one of them (measured for 96 to 1024).
    """
    lattice = sphere_directions(count)
    angle = (np.arange(points) % 89) * (GOLDEN_ANGLE / 89 * 34)
    cosine, sine = (f(angle).astype(np.float32)[:, None] for f in (np.cos, np.sin))
    turned = np.empty((points, count, 3), dtype=np.float32)
    a, b = (up + 1) % 3, (up + 2) % 3
    turned[..., up] = lattice[:, 2]
    turned[..., a] = cosine * lattice[:, 0] - sine * lattice[:, 1]
    turned[..., b] = sine * lattice[:, 0] + cosine * lattice[:, 1]
    return turned


def sphere_directions(count: int) -> NDArray[np.float32]:
    """[count, 3]: a Fibonacci lattice over the unit sphere about the third axis."""
    index = np.arange(count)
    height = 1 - (2 * index + 1) / count
    radius, azimuth = np.sqrt(1 - height * height), GOLDEN_ANGLE * index
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=1).astype(np.float32)


def _vectors(kind, rows: NDArray):
    return kind(*(mi.Float(np.ascontiguousarray(rows[:, axis], dtype=np.float32)) for axis in range(3)))
