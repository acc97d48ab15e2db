"""Scenes for tests of camera sampling: boxes, rooms, mazes and fields of posts, as plain descriptions."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analytic import at, make_scene
from framepairs.scene.description import Material, Mesh, SceneDescription

GREY = Material(name="grey")
FACES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]]
    + [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]],
    np.uint32,
)


def box(low, high, name: str = "box") -> Mesh:
    """A closed box between two corners [3]."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    return Mesh(name=name, positions=(np.array(low) + corners * np.subtract(high, low)).astype(np.float32), faces=FACES)


def merged(*meshes: Mesh) -> Mesh:
    """All triangles in one mesh."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    positions = np.concatenate([mesh.positions for mesh in meshes])
    return Mesh(name="merged", positions=positions, faces=np.concatenate(faces).astype(np.uint32))


def flat_ground(half: float, name: str = "ground") -> Mesh:
    """A square of two triangles at y = 0."""
    positions = np.array([[-half, 0, -half], [half, 0, -half], [half, 0, half], [-half, 0, half]], np.float32)
    return Mesh(name=name, positions=positions, faces=np.array([[0, 2, 1], [0, 3, 2]], np.uint32))


def posts(count: int = 40, half: float = 12.0, seed: int = 1) -> list[Mesh]:
    """Square posts, 0.3 to 0.8 wide and 4 high, at random places."""
    rng = np.random.default_rng(seed)
    places, widths = rng.uniform(-half, half, (count, 2)), rng.uniform(0.15, 0.4, count)
    return [
        box([x - w, 0, z - w], [x + w, 4, z + w], f"post{k}") for k, ((x, z), w) in enumerate(zip(places, widths, strict=True))
    ]


def field_of_posts(ground: float = 14.0, scale: float = 1.0, centre=(0.0, 0.0, 0.0)) -> SceneDescription:
    """Posts on a ground. scale: scene units per metre; centre: where the middle lies, by matrices."""
    matrix = at(*centre) @ np.diag([scale, scale, scale, 1.0])
    return make_scene(*((mesh, GREY, matrix) for mesh in (flat_ground(ground), *posts())))


def room(size: float = 6.0, height: float = 3.0) -> SceneDescription:
    """A closed box that is meant to be seen from inside, with a table."""
    half = size / 2
    walls = box([-half, 0, -half], [half, height, half], "walls")
    return make_scene((walls, GREY, np.eye(4)), (box([-0.6, 0, -0.4], [0.6, 0.8, 0.4], "table"), GREY, np.eye(4)))


def maze() -> SceneDescription:
    """A walled yard of 5 x 5 chambers of 3 m, with gaps in the walls between."""
    parts, pitch = [flat_ground(7.6)], 3.0
    for k in range(6):
        x = -7.5 + k * pitch
        for j in range(5):
            z = -7.5 + j * pitch
            gap = 0.0 if k in (0, 5) else 1.4
            parts += [box([x - 0.1, 0, z], [x + 0.1, 3, z + pitch - gap]), box([z, 0, x - 0.1], [z + pitch - gap, 3, x + 0.1])]
    return make_scene(*((mesh, GREY, np.eye(4)) for mesh in parts))


def with_mover(moves: Callable[[float], np.ndarray], end_s: float, mover: Mesh) -> SceneDescription:
    """The field of posts with one more object that moves."""
    parts = [(mesh, GREY, np.eye(4)) for mesh in (flat_ground(14.0), *posts())]
    return replace(make_scene(*parts, (mover, GREY, moves)), animation_end_s=end_s)


def world_triangles(scene: SceneDescription, time_s: float = 0.0) -> np.ndarray:
    """[n, 3, 3] corners of all triangles in world space, float64."""
    found, poses = [], scene.deformed(time_s) if scene.deformed else {}
    for item, matrix in zip(scene.objects, scene.world_from_object(time_s), strict=True):
        mesh = scene.meshes[item.mesh]
        positions = poses.get(item.mesh, mesh).positions.astype(np.float64)
        found.append((positions @ matrix[:3, :3].T + matrix[:3, 3])[mesh.faces])
    return np.concatenate(found)


def distances_to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Exact least distance [n] of points [n, 3] to triangles [t, 3, 3]: to the plane where the foot lies inside, else to the
    nearest edge (each as a segment)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    away = points[:, None] - a
    height = np.einsum("ntk,tk->nt", away, normal)
    inside = np.ones(height.shape, dtype=bool)
    nearest = np.full(height.shape, np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, way = end - start, points[:, None] - start
        inside &= np.einsum("ntk,tk->nt", way, np.cross(normal, edge)) >= 0
        share = np.clip(np.einsum("ntk,tk->nt", way, edge) / np.maximum(np.sum(edge * edge, axis=1), 1e-300), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(way - share[..., None] * edge, axis=2))
    return np.minimum(nearest, np.where(inside, np.abs(height), np.inf)).min(axis=1)
