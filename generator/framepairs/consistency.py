"""Whether motion leads to where a surface was: by object id, and by reprojecting depth with the stored matrices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, jit
from .channels import IN_FRONT_OF_PREVIOUS_CAMERA, INSIDE_PREVIOUS_FRAME, SEEN_BY_PREVIOUS_CAMERA
from .manifest import CameraRecord
from .warp import Image, bilinear, fetch, nearest, pixel_centres, to_image

TOLERANCE_PX = 0.05
FEWEST_PIXELS = 32  # an object with fewer interior pixels is not judged: an affine map has twelve unknowns
ALL_SEEN = INSIDE_PREVIOUS_FRAME | IN_FRONT_OF_PREVIOUS_CAMERA | SEEN_BY_PREVIOUS_CAMERA


@dataclass(frozen=True, kw_only=True)
class WarpConsistency:
    """Over pixels that the previous frame saw, away from edges of objects by one pixel: how many there are, the share that
    lands on its own object, the share that lands within 0.05 px of its surface point, and the residuals' percentiles."""

    pixels: int
    same_object: float
    same_place: float
    residual_median: float
    residual_p99: float


def warp_consistency(
    now: dict[str, NDArray],
    before: dict[str, NDArray],
    camera: CameraRecord,
    jitter: tuple[float, float],
    previous_jitter: tuple[float, float],
    moving: list[int],
) -> WarpConsistency:
    """`now` and `before`: object_id, depth, motion and visibility of one stream in two frames that follow each other.
    moving: the ids of animated objects."""
    motion = to_image(now["motion"])
    identity, old_identity = to_image(now["object_id"]), to_image(before["object_id"])
    width, height = motion.width, motion.height
    centre_x, centre_y = pixel_centres(width, height)
    x, y = centre_x - dr.opaque(jit.Float, jitter[0]), centre_y - dr.opaque(jit.Float, jitter[1])
    old_x, old_y = x + motion.planes[0], y + motion.planes[1]
    # the pixel of the previous buffer that holds the place p is the one whose centre is nearest to p + J
    in_old_x, in_old_y = (
        old_x + dr.opaque(jit.Float, previous_jitter[0]),
        old_y + dr.opaque(jit.Float, previous_jitter[1]),
    )
    inside = (centre_x > 1) & (centre_x < width - 1) & (centre_y > 1) & (centre_y < height - 1)
    inside &= _uniform(identity, centre_x, centre_y) & _uniform(old_identity, in_old_x, in_old_y)
    judged = inside & ((to_image(now["visibility"]).planes[0] & ALL_SEEN) == ALL_SEEN)
    same = nearest(old_identity, in_old_x, in_old_y)[0] == identity.planes[0]
    inverse_depth = bilinear(to_image(1 / before["depth"]), in_old_x, in_old_y)[0]
    dr.eval(judged, same, old_x, old_y, inverse_depth, x, y)
    pick = np.flatnonzero(np.array(judged))
    if not len(pick):
        return WarpConsistency(pixels=0, same_object=1.0, same_place=1.0, residual_median=0.0, residual_p99=0.0)
    fractions = [np.array(v)[pick] / extent for v, extent in ((x, width), (y, height), (old_x, width), (old_y, height))]
    residual = _residuals(
        ids=now["object_id"].ravel()[pick],
        inverse_depth=1 / now["depth"].ravel()[pick].astype(np.float64),
        old_inverse_depth=np.array(inverse_depth)[pick].astype(np.float64),
        place=np.stack(fractions[:2], axis=1).astype(np.float64),
        old_place=np.stack(fractions[2:], axis=1).astype(np.float64),
        camera=camera,
        moving=moving,
        size=np.array([width, height]),
    )
    known = np.isfinite(residual)
    residual = residual[known] if known.any() else np.zeros(1)
    return WarpConsistency(
        pixels=len(pick),
        same_object=float(np.array(same)[pick].mean()),
        same_place=float((residual <= TOLERANCE_PX).mean()),
        residual_median=float(np.median(residual)),
        residual_p99=float(np.percentile(residual, 99)),
    )


def _uniform(identity: Image, x, y) -> jit.Bool:
    """Whether the 3x3 pixels around a place have one id."""
    i, j = jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y))
    centre = fetch(identity, i, j)[0]
    same = jit.Bool(True)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            same &= fetch(identity, i + column, j + row)[0] == centre
    return same


def _residuals(*, ids, inverse_depth, old_inverse_depth, place, old_place, camera: CameraRecord, moving, size) -> NDArray:
    """Pixels between where motion leads and where the point was; NaN for objects that are too small to tell.

    What is not animated must stand still in the world. An animated object is given the affine motion that fits its own
    points in space, so that it is not blamed on the camera.
    """
    clip, old_clip = np.array(camera.clip_from_view), np.array(camera.previous_clip_from_view)
    old_from_now = np.array(camera.previous_view_from_world) @ np.linalg.inv(np.array(camera.view_from_world))
    points = _homogeneous(place, inverse_depth, clip)
    old_points = _homogeneous(old_place, old_inverse_depth, old_clip)
    residual = _distance(points @ old_from_now.T, old_clip, old_place, size)
    for identity in np.intersect1d(ids, moving):
        own = np.flatnonzero(ids == identity)
        if len(own) < FEWEST_PIXELS:
            residual[own] = np.nan
            continue
        moved = _fitted(points[own], old_points[own])
        residual[own] = np.minimum(residual[own], _distance(moved, old_clip, old_place[own], size))
    return residual


def _homogeneous(place: NDArray, inverse_depth: NDArray, clip: NDArray) -> NDArray:
    """[n, 4] view-space points over depth: (x / z, y / z, -1, 1 / z); directions where the depth is infinite."""
    x = (2 * place[:, 0] - 1) / clip[0, 0]
    y = (1 - 2 * place[:, 1]) / clip[1, 1]
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
    z = np.where(-moved[:, 2] > 0, -moved[:, 2], np.nan)
    x = 0.5 + 0.5 * clip[0, 0] * moved[:, 0] / z
    y = 0.5 - 0.5 * clip[1, 1] * moved[:, 1] / z
    distance = np.hypot((x - place[:, 0]) * size[0], (y - place[:, 1]) * size[1])
    return np.where(np.isnan(distance), np.inf, distance)
