"""The part of a scene that cameras are sent through: its bounds without absurdly large planes, domes and strays."""

import numpy as np
from numpy.typing import NDArray

from ..scene.description import SceneDescription
from ..transforms import Vector

VAST = 16.0  # times the diagonal of everything smaller
STRAY = 8.0  # times the distance of the 90th percentile from the median
MOST_TRIANGLES = 2_000_000


def work_bounds(scene: SceneDescription, times: tuple[float, ...]) -> tuple[Vector, Vector]:
    """Least and greatest corner [3] in world space of what matters, over all of `times` (seconds of the animation).

    Items are the objects' boxes, or the triangles' where the scene has one object. From the smallest on, the union of their
    boxes grows; an item whose diagonal is more than VAST times that of the union so far is left out, with all larger ones
    (a ground plane to the horizon, a sky dome), provided that at least half of the items stay. So is one whose middle lies
    more than STRAY times as far from the median middle as the 90th percentile does.
    """
    low, high = _items(scene, times)
    middles = (low + high) / 2
    away = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    near = away <= STRAY * np.percentile(away, 90) if np.any(away > 0) else np.ones(len(low), dtype=bool)
    low, high = low[near], high[near]
    sizes = np.linalg.norm(high - low, axis=1)
    order = np.argsort(sizes, kind="stable")
    low, high, sizes = low[order], high[order], sizes[order]
    lows, highs = np.minimum.accumulate(low), np.maximum.accumulate(high)
    unions = np.linalg.norm(highs - lows, axis=1)
    smaller = np.arange(1, len(sizes))
    vast = np.flatnonzero((sizes[1:] > VAST * unions[:-1]) & (unions[:-1] > 0) & (2 * smaller >= len(sizes)))
    last = vast[0] if len(vast) else len(sizes) - 1
    return lows[last], highs[last]


def _items(scene: SceneDescription, times: tuple[float, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(low, high) [items, 3]."""
    if len(scene.objects) == 1 and len(scene.meshes[scene.objects[0].mesh].faces) <= MOST_TRIANGLES:
        mesh = scene.meshes[scene.objects[0].mesh]
        positions = (scene.deformed(times[0]) if scene.deformed else {}).get(scene.objects[0].mesh, mesh).positions
        matrix = scene.world_from_object(times[0])[0]
        corners = (positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])[mesh.faces]
        return corners.min(axis=1), corners.max(axis=1)
    boxes = [object_boxes(scene, time_s) for time_s in times]
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def mesh_boxes(scene: SceneDescription, time_s: float) -> NDArray[np.float64]:
    """[meshes, 2, 3] least and greatest corner of every mesh in object space; zeros for those that no object uses."""
    deformed = scene.deformed(time_s) if scene.deformed else {}
    boxes = np.zeros((len(scene.meshes), 2, 3))
    for index in {item.mesh for item in scene.objects}:
        positions = deformed.get(index, scene.meshes[index]).positions
        boxes[index] = positions.min(axis=0), positions.max(axis=0)
    return boxes


def object_boxes(
    scene: SceneDescription, time_s: float, boxes: NDArray | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Boxes around the objects' transformed boxes at a time, in world space: (low, high) [objects, 3]. boxes: of the meshes
    at that time, where they are known."""
    boxes = mesh_boxes(scene, time_s) if boxes is None else boxes
    mine = boxes[[item.mesh for item in scene.objects]]
    middle, half = mine.mean(axis=1), (mine[:, 1] - mine[:, 0]) / 2
    matrices = scene.world_from_object(time_s)
    centre = np.einsum("nij,nj->ni", matrices[:, :3, :3], middle) + matrices[:, :3, 3]
    reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
    return centre - reach, centre + reach
