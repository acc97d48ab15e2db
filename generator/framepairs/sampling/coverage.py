"""What the cameras of a path see: cells with a surface, by rays through the frustum that stop at the first surface."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from ..backend import mi
from .free_space import FreeSpace, Grid, surface_cells
from .probe import first_hits

ASPECT = 16 / 9
COLUMNS, ROWS = 32, 18
REFERENCE_HEIGHT = 540  # pixels, for motion in pixels a frame


@dataclass
class Coverage:
    """Cells that count, and how many paths have seen each. cells: [n] numbers in the grid, ascending: those that hold a
    surface near reachable space. times_seen: [n]. farthest: how far away a surface still counts as seen, scene units."""

    grid: Grid
    cells: NDArray[np.int64]
    times_seen: NDArray[np.int64]
    farthest: float

    @property
    def share(self) -> float:
        """Of the cells, those that were seen, 0 to 1."""
        return float(np.mean(self.times_seen > 0)) if len(self.cells) else 1.0

    @property
    def worth(self) -> NDArray[np.float64]:
        """[n]: what seeing each cell is worth: 1 where no path has, (1 + times_seen)^-1.5 else. A steeper fall would send path
        after path to the few cells that are hard to see."""
        return (1.0 + self.times_seen) ** -1.5

    def index_of(self, numbers: NDArray) -> NDArray[np.int64]:
        """Index into `cells` of numbers of the grid, any shape; -1 for cells that do not count."""
        place = np.minimum(np.searchsorted(self.cells, numbers), max(len(self.cells) - 1, 0))
        return np.where(self.cells[place] == numbers, place, -1) if len(self.cells) else np.full_like(numbers, -1)

    def add(self, seen: NDArray[np.int64], times: int = 1) -> None:
        """Count cells (indices, each once) as seen by one more path; times -1 takes them back."""
        self.times_seen[seen] += times


def make_coverage(space: FreeSpace, parts: list[NDArray], farthest: float) -> Coverage:
    """parts: indices of the open cells that are reachable, one array for each style."""
    cells = space.surfaces_near(np.unique(np.concatenate(parts)))
    return Coverage(space.grid, cells, np.zeros(len(cells), np.int64), farthest)


def frustum(fov_y: float, columns: int = COLUMNS, rows: int = ROWS) -> NDArray[np.float64]:
    """[rows * columns, 3] unit directions in camera axes through the centres of a grid over the image. fov_y: radians."""
    y = (1 - 2 * (np.arange(rows) + 0.5) / rows) * math.tan(fov_y / 2)
    x = (2 * (np.arange(columns) + 0.5) / columns - 1) * math.tan(fov_y / 2) * ASPECT
    grid = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1).reshape(-1, 3)
    return grid / np.linalg.norm(grid, axis=1, keepdims=True)


def view(scene: mi.Scene, cameras: NDArray, fov_y: float, farthest: float) -> tuple[NDArray, NDArray, NDArray]:
    """What cameras [n, 4, 4] (relative to the probe's origin) see: (points [n * rays, 3], directions, distances)."""
    rays = frustum(fov_y)
    directions = np.einsum("nij,kj->nki", cameras[:, :3, :3], rays).reshape(-1, 3)
    points = np.repeat(cameras[:, :3, 3], len(rays), axis=0)
    return points, directions, first_hits(scene, points, directions, farthest)


def seen_cells(coverage: Coverage, scene: mi.Scene, paths: list[NDArray], fovs: list[float]) -> list[NDArray[np.int64]]:
    """Indices of the cells that count and that each path of cameras [n, 4, 4] sees, ascending."""
    views = [view(scene, cameras, fov, coverage.farthest) for cameras, fov in zip(paths, fovs, strict=True)]
    found = (coverage.index_of(surface_cells(coverage.grid, *rays, coverage.farthest)) for rays in views)
    return [np.unique(index[index >= 0]) for index in found]


def lacking(coverage: Coverage, places: NDArray, spread: float) -> NDArray[np.float64]:
    """How much there is to see around each place [n, 3], 0 to 1: the worth of the cells, summed over each column of the grid
    and blurred over `spread` scene units."""
    grid = coverage.grid
    across = [axis for axis in range(3) if axis != grid.up]
    index = np.unravel_index(coverage.cells, grid.shape)
    columns = np.zeros([grid.shape[axis] for axis in across])
    np.add.at(columns, tuple(index[axis] for axis in across), coverage.worth)
    blurred = gaussian_filter(columns, spread / grid.size[across[0]], mode="constant")
    there = np.floor((places - grid.low) / grid.size).astype(np.int64)
    values = blurred[tuple(np.clip(there[:, axis], 0, grid.shape[axis] - 1) for axis in across)]
    return values / values.max() if values.max(initial=0) > 0 else np.zeros(len(places))


def median_motion(scene: mi.Scene, cameras: NDArray, fov_y: float, farthest: float) -> float:
    """Median length of motion between neighbouring frames, pixels at 960 x 540: over all rays through the frusta, what the
    camera's own movement shifts the surface that was hit (or the sky) by."""
    if len(cameras) < 2:
        return 0.0
    points, directions, distances = view(scene, cameras[1:], fov_y, farthest)
    distances = np.where(np.isfinite(distances), distances, 1e4 * farthest)
    met = (points + distances[:, None] * directions).reshape(len(cameras) - 1, -1, 3)
    now, before = (_pixels(part, met, fov_y) for part in (cameras[1:], cameras[:-1]))
    return float(np.median(np.linalg.norm(before - now, axis=-1)))


def _pixels(cameras: NDArray, points: NDArray, fov_y: float) -> NDArray[np.float64]:
    local = np.einsum("nji,nkj->nki", cameras[:, :3, :3], points - cameras[:, None, :3, 3])
    depth = np.maximum(-local[..., 2:], 1e-9)
    return local[..., :2] / depth * (REFERENCE_HEIGHT / 2 / math.tan(fov_y / 2))
