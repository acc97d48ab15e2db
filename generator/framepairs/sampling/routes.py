"""Ways through the reachable space: shortest walks over its cells, smoothed into curves."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from ..backend import mi
from .free_space import FreeSpace, within_step
from .probe import first_hits, hits_around, turned_spheres
from .styles import Style

ROOMIER = 2.0  # a way costs twice its length where the room is ROOMIER times the clearance
ROUGH_RAYS = 48
ROUGH_MARGIN = 1.15


@dataclass(frozen=True)
class Walks:
    """A style's reachable cells as a graph. nodes: [n] indices of open cells; places: [n, 3]; costs: [n, n], lengths of the
    ways between neighbours, more where there is little room."""

    space: FreeSpace
    nodes: NDArray[np.int64]
    places: NDArray[np.float64]
    costs: csr_array


def make_walks(space: FreeSpace, nodes: NDArray, style: Style, unit: float, clearance: float) -> Walks:
    """unit: scene units per metre of the style."""
    joined = within_step(space, None if style.step_m is None else style.step_m * unit)[nodes][:, nodes]
    start, end = joined.nonzero()
    places, room = space.centres[nodes], space.room[nodes]
    length = np.linalg.norm(places[end] - places[start], axis=1)
    cost = length * (1 + (ROOMIER * clearance / np.minimum(room[start], room[end])) ** 2)
    both = (np.concatenate([cost, cost]), (np.concatenate([start, end]), np.concatenate([end, start])))
    return Walks(space, nodes, places, coo_array(both, shape=joined.shape).tocsr())


def routes_from(walks: Walks, start: int, length: float, wanted: NDArray, count: int, rng) -> list[NDArray[np.float64]]:
    """Up to `count` polylines [m, 3] from node `start`, each about `length` long, or as long as there is room for.

    wanted: [n], how much a node is worth as a goal, 0 to 1.
    """
    limit = max(6 * length, 2 * float(walks.costs.data.max(initial=0)))  # a way that is shorter than a cell begins a longer one
    costs, before = dijkstra(walks.costs, indices=start, limit=limit, return_predecessors=True)
    found = np.flatnonzero(np.isfinite(costs) & (np.arange(len(costs)) != start))
    if not len(found):
        return []
    away = costs[found]
    far = found[(away >= min(1.25 * length, 0.8 * away.max())) & (away <= 2.5 * length)]
    far = far if len(far) else found[away >= 0.8 * away.max()]
    worth = wanted[far] + rng.uniform(0, 0.5, len(far))
    goals, lines = [], []
    for goal in far[np.argsort(-worth, kind="stable")]:
        if all(np.linalg.norm(walks.places[goal] - walks.places[other]) > length / 4 for other in goals):
            goals.append(goal)
            lines.append(walks.places[_chain(before, start, goal)])
        if len(goals) == count:
            break
    return lines


def _chain(before: NDArray, start: int, goal: int) -> list[int]:
    chain = [int(goal)]
    while chain[-1] != start:
        chain.append(int(before[chain[-1]]))
    return chain[::-1]


def smoothed(line: NDArray, length: float, spacing: float, deviation: float) -> NDArray[np.float64]:
    """The polyline [m, 3] as points [n, 3] at most `spacing` apart, smoothed over `deviation`, and cut at `length`."""
    arcs = arc_lengths(line)
    points = _resampled(line, arcs, np.linspace(0, arcs[-1], max(math.ceil(arcs[-1] / spacing), 1) + 1))
    points = gaussian_filter1d(points, deviation / spacing, axis=0, mode="nearest")
    arcs = arc_lengths(points)
    end = min(length, arcs[-1])
    return _resampled(points, arcs, np.linspace(0, end, max(math.ceil(end / spacing), 1) + 1))


def arc_lengths(points: NDArray) -> NDArray[np.float64]:
    """[n]: length of the polyline [n, 3] up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def at_arcs(points: NDArray, fractions: NDArray) -> NDArray[np.float64]:
    """Points [k, 3] of a polyline at fractions [k] of its length."""
    arcs = arc_lengths(points)
    return _resampled(points, arcs, fractions * arcs[-1])


def _resampled(points: NDArray, arcs: NDArray, wanted: NDArray) -> NDArray[np.float64]:
    return np.stack([np.interp(wanted, arcs, points[:, axis]) for axis in range(3)], axis=1)


def over_ground(
    scene: mi.Scene, points: NDArray, style: Style, height: float, unit: float, up: int, spacing: float, deviation: float
) -> NDArray[np.float64]:
    """The curve [n, 3] at `height` over the smoothed ground, or, of styles that do not follow it, within their heights."""
    down = first_hits(scene, points, np.tile(-np.eye(3)[up], (len(points), 1)))
    ground = np.where(np.isfinite(down), points[:, up] - down, points[:, up] - height)
    ground = gaussian_filter1d(ground, max(deviation, unit) / spacing, mode="nearest")
    moved = points.copy()
    low, high = (ground + value * unit for value in style.height_m)
    moved[:, up] = ground + height if style.follows_ground else np.clip(points[:, up], low, high)
    return moved


def free_length(scene: mi.Scene, curve: NDArray, clearance: float, up: int) -> int:
    """How many points of a curve [n, 3], from its start, seem to keep ROUGH_MARGIN times the clearance, by a few rays from
    each."""
    reach = ROUGH_MARGIN * clearance
    hit = np.isfinite(hits_around(scene, curve, turned_spheres(len(curve), ROUGH_RAYS, up), reach)).any(axis=1)
    return int(np.argmax(hit)) if hit.any() else len(curve)
