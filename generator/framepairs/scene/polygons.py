"""Polygons as triangles, and corners with values of their own as vertices."""

import numpy as np
from numpy.typing import NDArray


def fan(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Fans of polygons whose corners stand one after the other.

    counts: corners [F] of each polygon; those of fewer than 3 give nothing. Gives the corners [T, 3] of the triangles, as
    indices into the concatenated polygons, and the polygon [T] of each.
    """
    inner = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), inner)
    start = (np.cumsum(counts) - counts)[polygon]
    if len(counts) and inner.max() == 1 and inner.min() == 1:
        return start[:, None] + np.arange(3), polygon
    step = np.arange(len(polygon)) - (np.cumsum(inner) - inner)[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def merged(columns: list[NDArray[np.int64]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Equal corners as one vertex. columns: non-negative indices [C] each, by which corners differ.

    Gives a corner [V] for each vertex, and the vertex [C] of each corner.
    """
    group, columns = columns[0], [column for column in columns[1:] if not np.array_equal(column, columns[0])]
    size = int(group.max(initial=-1)) + 1
    if size > 4 * len(group):
        keys, group = np.unique(group, return_inverse=True)
        count = len(keys)
    else:  # counting instead of sorting
        used = np.zeros(size, bool)
        used[group] = True
        group, count = (np.cumsum(used) - 1)[group], int(used.sum())
    for column in columns:
        keys, group = np.unique(group * (int(column.max(initial=0)) + 1) + column, return_inverse=True)
        count = len(keys)
    corner = np.empty(count, np.int64)
    corner[group[::-1]] = np.arange(len(group))[::-1]
    return corner, group
