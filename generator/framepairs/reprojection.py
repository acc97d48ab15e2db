"""Where surface points were, by depth and the stored matrices: the witness against which motion is judged."""

import numpy as np
from numpy.typing import NDArray

FEWEST_PIXELS = 32  # an object with fewer interior pixels is not judged: an affine map has twelve unknowns


def residuals(*, ids, inverse_depth, old_inverse_depth, place, old_place, camera, moving, deforming, size) -> NDArray:
    """Pixels between where motion leads and where the point was; NaN for objects that deform or are too small to tell.

    What is not animated must stand still in the world. An animated object is given the affine motion that fits its own
    points in space, so that it is not blamed on the camera.
    """
    clip, old_clip = np.array(camera.clip_from_view), np.array(camera.previous_clip_from_view)
    old_from_now = np.array(camera.previous_view_from_world) @ np.linalg.inv(np.array(camera.view_from_world))
    points = _homogeneous(place, inverse_depth, clip)
    old_points = _homogeneous(old_place, old_inverse_depth, old_clip)
    residual = _distance(points @ old_from_now.T, old_clip, old_place, size)
    if not clip[3, 2]:  # an orthographic camera sees one direction of the sky everywhere
        residual[inverse_depth == 0] = np.nan
    for identity in np.intersect1d(ids, moving):
        own = np.flatnonzero(ids == identity)
        if len(own) < FEWEST_PIXELS or identity in deforming:
            residual[own] = np.nan
            continue
        moved = _fitted(points[own], old_points[own])
        residual[own] = np.minimum(residual[own], _distance(moved, old_clip, old_place[own], size))
    return residual


def _homogeneous(place: NDArray, inverse_depth: NDArray, clip: NDArray) -> NDArray:
    """[n, 4] view-space points over depth: (x / z, y / z, -1, 1 / z); directions where the depth is infinite."""
    x, y = 2 * place[:, 0] - 1, 1 - 2 * place[:, 1]
    if clip[3, 2]:
        x, y = (x + clip[0, 2]) / clip[0, 0], (y + clip[1, 2]) / clip[1, 1]
    else:
        x, y = ((v - clip[k, 3]) / clip[k, k] * inverse_depth for k, v in enumerate((x, y)))
    return np.stack([x, y, -np.ones_like(x), inverse_depth], axis=1)


def _fitted(points: NDArray, old_points: NDArray) -> NDArray:
    """`points` moved by the affine map that best takes them to `old_points`, weighted towards the median's surroundings."""
    a, b = points / points[:, 3:], old_points / old_points[:, 3:]
    centre, spread = a[:, :3].mean(axis=0), a[:, :3].std() or 1.0
    columns = np.concatenate([(a[:, :3] - centre) / spread, np.ones((len(a), 1))], axis=1)
    good = np.isfinite(b).all(axis=1)
    for _ in range(3):
        solution = np.linalg.lstsq(columns[good], b[good, :3], rcond=1e-7)[0]
        error = np.linalg.norm(columns @ solution - b[:, :3], axis=1)
        good = np.isfinite(error) & (error <= np.nanpercentile(error, 80))
    moved = columns @ solution
    return np.concatenate([moved, np.ones((len(moved), 1))], axis=1)


def _distance(moved: NDArray, clip: NDArray, place: NDArray, size: NDArray) -> NDArray:
    """Pixels between the projection of view-space points and a place of the frame."""
    there = moved @ clip.T
    w = np.where(there[:, 3] > 0, there[:, 3], np.nan)
    x, y = 0.5 + 0.5 * there[:, 0] / w, 0.5 - 0.5 * there[:, 1] / w
    distance = np.hypot((x - place[:, 0]) * size[0], (y - place[:, 1]) * size[1])
    return np.where(np.isnan(distance), np.inf, distance)
