"""Where a camera may be: cells of a grid with room around them, at camera heights over the ground, and joined to each other.

The grid spans `work_bounds` and some air around. A cell is open where no ray from its centre meets a surface within the
clearance, at any of the probe's times, and two neighbours are joined where the straight line between their centres is free.
Of what is joined, the part from which most cells with a surface are near is the reachable space: inside a solid there are
few, and the outside of a closed room loses against its inside.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from ..transforms import Vector
from .probe import Probe, first_hits, hits_around, turned_spheres

MOST_CELLS = 6_000_000
ROUTE_CELLS = 30_000  # of the volume at camera heights, for the default size
GROUND_COLUMNS = 48
MARGIN = 0.25  # of the largest horizontal extent, around the bounds
OFFSETS = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)])


@dataclass(frozen=True)
class Grid:
    """Cells of size [3] from `low` [3] on, relative to the probe's origin; shape: cells per axis. up: index of the up axis."""

    low: Vector
    size: Vector
    shape: tuple[int, int, int]
    up: int

    def cell_of(self, points: NDArray) -> NDArray[np.int64]:
        """Number of the cell [n] that holds each point [n, 3]; -1 outside the grid."""
        index = np.floor((points - self.low) / self.size).astype(np.int64)
        inside = np.all((index >= 0) & (index < self.shape), axis=1)
        return np.where(inside, np.ravel_multi_index(np.clip(index, 0, np.array(self.shape) - 1).T, self.shape), -1)

    def centres(self, cells: NDArray) -> NDArray[np.float64]:
        """[n, 3], relative to the probe's origin."""
        return self.low + (np.stack(np.unravel_index(cells, self.shape), axis=1) + 0.5) * self.size


@dataclass(frozen=True)
class FreeSpace:
    """Open cells. cells: [n], numbers in the grid, ascending; centres: [n, 3]; room: [n], distance to the nearest surface
    that a ray found, at most `clearance` times 4; height: [n] of the centre over the ground. joined: [n, n], 1 where
    neighbours see each other (upper triangle). surfaces: numbers of the cells with a surface near cell n, from
    surface_start[n] to surface_start[n + 1]. has_ground: the scene stands on something. All lengths in scene units."""

    grid: Grid
    cells: NDArray[np.int64]
    centres: NDArray[np.float64]
    room: NDArray[np.float32]
    height: NDArray[np.float32]
    joined: csr_array
    surfaces: NDArray[np.int64]
    surface_start: NDArray[np.int64]
    has_ground: bool

    def surfaces_near(self, nodes: NDArray) -> NDArray[np.int64]:
        """Numbers of the cells with a surface near any of the open cells `nodes` (indices), ascending."""
        parts = [self.surfaces[self.surface_start[node] : self.surface_start[node + 1]] for node in nodes]
        return np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64)


def air_around(probe: Probe, bounds: tuple[Vector, Vector], up: int, highest: float, ground: bool) -> tuple[Vector, Vector]:
    """`bounds` (corners relative to the probe's origin) with room for cameras: up to `highest` over the ground and, where the
    ground goes on, MARGIN of the horizontal extent around; without ground, the whole extent all around."""
    low, high = (np.array(corner, dtype=float) for corner in bounds)
    across = [axis for axis in range(3) if axis != up]
    if not ground:
        margin = float((high - low).max())
        return low - margin, high + margin
    margin = MARGIN * float((high - low)[across].max())
    angle = 2 * np.pi * np.arange(64) / 64
    ring = np.full((64, 3), high[up])
    half = (high - low)[across] / 2 + margin / 2
    ring[:, across] = (low + high)[across] / 2 + half * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    below = first_hits(probe.posed(probe.times[0]), ring, np.tile(-np.eye(3)[up], (64, 1)))
    if np.isfinite(below).mean() > 0.5:
        low[across] -= margin
        high[across] += margin
    high[up] = max(high[up], low[up] + 1.25 * highest)
    return low, high


def make_grid(
    bounds: tuple[Vector, Vector], up: int, heights: tuple[float, float], cell: float | None, least: float, ground: bool
) -> Grid:
    """Cells that fill `bounds` (corners relative to the probe's origin). heights: least and greatest of any camera over the
    ground. cell: horizontal size; None: so that about ROUTE_CELLS fill the volume at camera heights, but at least `least`.
    Over a ground, cells are half as high as wide."""
    low, high = bounds
    span = high - low
    across = [axis for axis in range(3) if axis != up]
    layer = min(heights[1] - heights[0], span[up]) if ground else span[up]
    volume = span[across[0]] * span[across[1]] * layer * (2 if ground else 1)
    size = cell if cell is not None else max((volume / ROUTE_CELLS) ** (1 / 3), least)
    sizes = np.full(3, size)
    sizes[up] = size / 2 if ground else size
    shape = np.maximum(np.ceil(span / sizes), 1)
    while cell is None and shape.prod() > MOST_CELLS:
        sizes = 1.1 * sizes
        shape = np.maximum(np.ceil(span / sizes), 1)
    if shape.prod() > MOST_CELLS:
        raise InputError(f"gives {shape.prod():.3g} cells, more than {MOST_CELLS}: choose larger ones", field="cell")
    return Grid(low + (span - shape * sizes) / 2, sizes, tuple(int(count) for count in shape), up)


def stands_on_ground(probe: Probe, bounds: tuple[Vector, Vector], up: int) -> bool:
    """Whether rays from below meet something wide and level: in at least half of the columns, whose heights' 10th to 90th
    percentile lie within a fifth of the horizontal extent."""
    low, high = bounds
    extent = high - low
    across = [axis for axis in range(3) if axis != up]
    if min(extent[across]) <= 0:
        return False
    steps = (np.arange(GROUND_COLUMNS) + 0.5) / GROUND_COLUMNS
    points = np.empty((GROUND_COLUMNS**2, 3))
    points[:, across] = low[across] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * extent[across]
    below = 0.01 * float(extent.max())
    points[:, up] = low[up] - below
    found = first_hits(probe.posed(probe.times[0]), points, np.tile(np.eye(3)[up], (len(points), 1)), extent[up] + 2 * below)
    hit = found[np.isfinite(found)]
    if len(hit) < len(found) / 2:
        return _lies_on_something(probe, points, up)
    return bool(np.subtract(*np.percentile(hit, (90, 10))) <= 0.2 * max(extent[across]))


def _lies_on_something(probe: Probe, points: NDArray, up: int) -> bool:
    """Whether rays straight down from just under the bounds meet a vast ground that the bounds leave out."""
    found = first_hits(probe.posed(probe.times[0]), points, np.tile(-np.eye(3)[up], (len(points), 1)))
    return bool(np.isfinite(found).mean() >= 0.5)


def explore(
    probe: Probe, grid: Grid, heights: tuple[float, float], clearance: float, near: float, rays: int, has_ground: bool
) -> FreeSpace:
    """The open cells of `grid` whose height over the ground overlaps `heights`, with what is around them.

    near: how far away a surface is still near a cell. rays: per cell, over the sphere. Ground is the first surface straight
    below, at the first time; a cell without is not open where the scene stands on ground. Without ground, heights do not count.
    """
    cells = np.arange(np.prod(grid.shape))
    points = grid.centres(cells)
    down = np.full(len(cells), np.inf, dtype=np.float32)
    if has_ground:
        down = first_hits(probe.posed(probe.times[0]), points, np.tile(-np.eye(3)[grid.up], (len(cells), 1)))
    half = grid.size[grid.up] / 2
    fits = (down >= heights[0] - half) & (down <= heights[1] + half) if has_ground else np.ones(len(cells), dtype=bool)
    cells, points, down = cells[fits], points[fits], down[fits]
    directions = turned_spheres(len(cells), rays, grid.up)
    reach = max(near, 4 * clearance)
    seen = None
    room = np.full(len(cells), np.inf, dtype=np.float32)
    for scene in probe.poses():
        found = hits_around(scene, points, directions, reach)
        seen = found if seen is None else seen
        room = np.minimum(room, found.min(axis=1, initial=np.inf))
    room = np.minimum(room, 4 * clearance)
    is_open = room >= clearance
    if not is_open.any():
        raise InputError(f"no cell of the grid has {clearance:.4g} scene units of room at camera heights", field="clearance")
    cells, points, down, room = cells[is_open], points[is_open], down[is_open], room[is_open]
    surfaces, start = _surfaces(grid, points, directions[is_open], seen[is_open], near)
    return FreeSpace(grid, cells, points, room, down, _joined(probe, grid, cells, points), surfaces, start, has_ground)


def surface_cells(grid: Grid, points: NDArray, directions: NDArray, distances: NDArray, farthest: float) -> NDArray[np.int64]:
    """Number of the cell [n] that holds the surface that a ray met at `distances` [n], taken a hundredth of a cell in front
    of it; -1 where it met none within `farthest` or outside the grid."""
    met = distances <= farthest
    back = np.where(met, distances, 0)[:, None] - 0.01 * float(grid.size.min())
    return np.where(met, grid.cell_of(points + back * directions), -1)


def _surfaces(grid: Grid, points, directions, distances, near: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    count = directions.shape[1]
    origins = np.repeat(points, count, axis=0)
    found = surface_cells(grid, origins, directions.reshape(-1, 3), distances.ravel(), near).reshape(-1, count)
    found.sort(axis=1)
    new = (found >= 0) & (np.diff(found, axis=1, prepend=-1) != 0)
    return found[new], np.concatenate([[0], np.cumsum(new.sum(axis=1))])


def _joined(probe: Probe, grid: Grid, cells: NDArray, points: NDArray) -> csr_array:
    """1 where two neighbours (of 26) see each other at all times; upper triangle."""
    index = np.stack(np.unravel_index(cells, grid.shape), axis=1)
    starts, ends = [], []
    for offset in OFFSETS:
        there = index + offset
        inside = np.flatnonzero(np.all((there >= 0) & (there < grid.shape), axis=1))
        wanted = np.ravel_multi_index(there[inside].T, grid.shape)
        place = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
        found = cells[place] == wanted
        starts.append(inside[found])
        ends.append(place[found])
    start, end = np.concatenate(starts), np.concatenate(ends)
    way = points[end] - points[start]
    length = np.linalg.norm(way, axis=1)
    free = np.ones(len(start), dtype=bool)
    for scene in probe.poses():
        free &= first_hits(scene, points[start], way / length[:, None], float(length.max(initial=0))) > length
    ones = np.ones(int(free.sum()), dtype=np.int8)
    return coo_array((ones, (start[free], end[free])), shape=(len(cells), len(cells))).tocsr()


def reachable(space: FreeSpace, heights: tuple[float, float], step: float | None = None) -> NDArray[np.int64]:
    """Indices of the open cells at `heights` (least, greatest over the ground) that belong to the joined part near which
    most cells hold a surface; the larger part among equals. step: neighbours whose ground differs by more are not joined."""
    half = space.grid.size[space.grid.up] / 2
    fits = np.ones(len(space.cells), dtype=bool)
    if space.has_ground:
        fits = (space.height >= heights[0] - half) & (space.height <= heights[1] + half)
    nodes = np.flatnonzero(fits)
    if not len(nodes):
        raise InputError("no free space at the camera heights of this style", field="style")
    _, part = connected_components(within_step(space, step)[nodes][:, nodes], directed=False)
    sizes = np.bincount(part)
    largest = np.argsort(-sizes, kind="stable")[:8]
    return max((nodes[part == one] for one in largest), key=lambda some: (len(space.surfaces_near(some)), len(some)))


def within_step(space: FreeSpace, step: float | None) -> csr_array:
    """`joined` without neighbours whose ground differs by more than `step`; None: all."""
    if step is None or not space.has_ground:
        return space.joined
    start, end = space.joined.nonzero()
    ground = space.centres[:, space.grid.up] - space.height
    near = np.abs(ground[start] - ground[end]) <= step
    ones = np.ones(int(near.sum()), dtype=np.int8)
    return coo_array((ones, (start[near], end[near])), shape=space.joined.shape).tocsr()
