"""Whether a camera path keeps its distance from every surface, by rays.

From points along the path, close together, rays over the sphere meet no surface within the clearance and half the points'
distance, and the straight lines from point to point meet none. A surface may be missed only where it passes between rays:
one that fills a disc of radius 2.8 / sqrt(rays) times their length, seen from the point, is met. Objects that move are asked
in their own space, where they are at the nearest frame's time: near paths alone, and without posing the scene anew.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..backend import mi
from ..transforms import Vector
from .bounds import mesh_boxes, object_boxes
from .path_frames import PathFrames, PathPoints
from .probe import Probe, first_hits, hits_around, mesh_scene, turned_spheres

FARTHEST = 4.0  # clearances up to which distances are told


def clearance_of(scene: mi.Scene, path: PathPoints, clearance: float, rays: int, up: int) -> float:
    """Least distance of the whole path to a surface, as rays tell, at most FARTHEST clearances; 0 where it crosses one."""
    way = np.diff(path.points, axis=0)
    length = np.linalg.norm(way, axis=1)
    moves = length > 0
    if moves.any():
        direction = way[moves] / length[moves, None]
        if (first_hits(scene, path.points[:-1][moves], direction, float(length.max())) <= length[moves]).any():
            return 0.0
    reach = FARTHEST * clearance + path.spacing / 2
    found = hits_around(scene, path.points, turned_spheres(len(path.points), rays, up), reach).min(initial=np.inf)
    return max(min(float(found), reach) - path.spacing / 2, 0.0)


@dataclass(frozen=True)
class _Near:
    """A place on a path that a moving object's box comes near: number of the path, place [3], index of the object, its
    matrix [4, 4], and the time that decides its vertices (0 where they do not move)."""

    path: int
    place: Vector
    item: int
    matrix: NDArray[np.float64]
    time_s: float


def clearances_while_moving(
    probe: Probe, frames: list[PathFrames], points: list[PathPoints], clearance: float, rays: int, up: int
) -> NDArray[np.float64]:
    """Least distance [paths] of each path to what moves, as it is at the time of the frame that is nearest along the path; at
    most FARTHEST clearances."""
    least = np.full(len(frames), FARTHEST * clearance)
    groups: dict[tuple[int, float], list[_Near]] = {}
    for near in _near_moving(probe, frames, points, clearance):
        groups.setdefault((probe.scene.objects[near.item].mesh, near.time_s), []).append(near)
    for (mesh, time_s), group in groups.items():
        described = probe.scene.meshes[mesh]
        moved = probe.scene.deformed(time_s) if described.deforms else {}
        scene = mesh_scene(moved.get(mesh, described).positions, described.faces)
        inverse = np.linalg.inv([near.matrix for near in group])
        places = np.einsum("nij,nj->ni", inverse[:, :3, :3], [near.place for near in group]) + inverse[:, :3, 3]
        directions = np.einsum("nij,nkj->nki", inverse[:, :3, :3], turned_spheres(len(group), rays, up))
        found = hits_around(scene, places, directions, FARTHEST * clearance).min(axis=1)
        for near, value in zip(group, found, strict=True):
            least[near.path] = min(least[near.path], max(value - points[near.path].spacing / 2, 0.0))
    return least


def _near_moving(probe: Probe, frames: list[PathFrames], points: list[PathPoints], clearance: float) -> list[_Near]:
    scene, found = probe.scene, []
    moving = np.flatnonzero([item.moves for item in scene.objects])
    times = [np.clip(path.times, 0, scene.animation_end_s) for path in frames]
    still = None if scene.deformed else mesh_boxes(scene, 0.0)
    for time in np.unique(np.concatenate(times)).tolist():
        low, high = (corner[moving] - probe.origin for corner in object_boxes(scene, time, still))
        matrices = scene.world_from_object(time)
        for number, (mine, path) in enumerate(zip(times, points, strict=True)):
            at_frames = np.flatnonzero(mine == time)[:, None] * path.per_frame
            if not len(at_frames):
                continue
            around = np.arange(-(path.per_frame // 2) - 1, path.per_frame // 2 + 2)
            places = path.points[np.unique(np.clip(at_frames + around, 0, len(path.points) - 1))]
            reach = clearance + path.spacing
            some = np.all((places.max(axis=0) > low - reach) & (places.min(axis=0) < high + reach), axis=1)
            for which in np.flatnonzero(some):
                item = int(moving[which])
                matrix = matrices[item].copy()
                matrix[:3, 3] -= probe.origin
                time_s = time if scene.meshes[scene.objects[item].mesh].deforms else 0.0
                near = np.all((places > low[which] - reach) & (places < high[which] + reach), axis=1)
                found += [_Near(number, place, item, matrix, time_s) for place in places[near]]
    return found
