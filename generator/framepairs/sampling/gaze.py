"""Where a camera looks on its way: towards what few paths have seen, or none, within the style's turn rate.

Directions are yaw and pitch: yaw from the axis after up's towards the one after that, pitch towards up, radians.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from ..backend import mi
from .coverage import ASPECT, Coverage
from .free_space import surface_cells
from .probe import first_hits
from .styles import Style

YAWS = 48
PITCHES = np.radians(np.linspace(-50, 50, 9))
NEARNESS = 0.5
STEEPEST = 1.9  # the interpolated turn's highest rate, over its mean rate between two choices


def direction_of(yaw: NDArray, pitch: NDArray, up: int) -> NDArray[np.float64]:
    """[..., 3] unit vectors."""
    direction = np.empty((*np.shape(yaw), 3))
    direction[..., (up + 1) % 3] = np.cos(pitch) * np.cos(yaw)
    direction[..., (up + 2) % 3] = np.cos(pitch) * np.sin(yaw)
    direction[..., up] = np.sin(pitch)
    return direction


def heading_of(points: NDArray, up: int) -> NDArray[np.float64]:
    """Yaw [n] of the way through points [n, 3], without jumps of a whole turn."""
    way = np.gradient(points, axis=0) if len(points) > 1 else np.zeros_like(points)
    return np.unwrap(np.arctan2(way[:, (up + 2) % 3], way[:, (up + 1) % 3]))


def worth_around(scene: mi.Scene, coverage: Coverage, points: NDArray, close: float) -> NDArray[np.float64]:
    """[n, YAWS, pitches]: worth of the cell that a ray from points [n, 3] in that direction meets, 0 to 1, less
    NEARNESS where it is nearer than `close`: a wall before the lens is no view."""
    yaw = 2 * math.pi * np.arange(YAWS) / YAWS
    directions = direction_of(*np.meshgrid(yaw, PITCHES, indexing="ij"), coverage.grid.up).reshape(-1, 3)
    origins = np.repeat(points, len(directions), axis=0)
    rays = np.tile(directions, (len(points), 1))
    found = first_hits(scene, origins, rays, coverage.farthest)
    index = coverage.index_of(surface_cells(coverage.grid, origins, rays, found, coverage.farthest))
    worth = np.append(coverage.worth, 0.0)[index]  # index -1: nothing that counts
    worth -= NEARNESS * (found < close)
    return worth.reshape(len(points), YAWS, len(PITCHES))


def choose_gaze(
    worth: NDArray, heading: NDArray, seconds: NDArray, style: Style, fov_y: float, rng
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(yaw, pitch) [n] at places along a path: the best sequence of directions, by dynamic programming.

    worth: [n, YAWS, pitches] of `worth_around`. heading: [n]. seconds: [n - 1] of movement between the places.
    """
    fov_x = 2 * math.atan(math.tan(fov_y / 2) * ASPECT)
    width = max(round(fov_x / (2 * math.pi) * YAWS), 1)
    seen = np.stack([np.roll(worth, shift - width // 2, axis=1) for shift in range(width)]).mean(axis=0)
    pitch_of = np.radians(np.linspace(*style.pitch_deg, 5))
    window = np.abs(PITCHES[None, :] - pitch_of[:, None]) <= fov_y / 2
    gains = seen @ (window / window.sum(axis=1, keepdims=True)).T  # [n, YAWS, 5]
    yaw = 2 * math.pi * np.arange(YAWS) / YAWS
    off = np.abs(_wrapped(yaw[None, :] - heading[:, None]))
    excess = np.maximum(off - math.radians(style.off_heading_deg), 0)
    score = gains.max(axis=2) + rng.uniform(0, 0.05, gains.shape[:2]) - 0.05 * off / math.pi - 20 * excess
    picks = _best_sequence(score, yaw, seconds, style)
    pitch = pitch_of[np.argmax(gains[np.arange(len(picks)), picks] - 0.05 * np.abs(pitch_of), axis=1)]
    if len(pitch) > 2:
        pitch[1:-1] = (pitch[:-2] + 2 * pitch[1:-1] + pitch[2:]) / 4
    return np.unwrap(yaw[picks]), pitch


def _best_sequence(score: NDArray, yaw: NDArray, seconds: NDArray, style: Style) -> NDArray[np.int64]:
    """Index of the yaw [n] at each place: the largest sum of scores, less the cost of turning, within the turn rate."""
    turn = np.abs(_wrapped(yaw[None, :] - yaw[:, None]))
    total, steps = score[0], []
    for place in range(1, len(score)):
        most = max(math.radians(style.turn_deg_s) * seconds[place - 1] / STEEPEST, 1e-9)
        share = turn / most
        step = style.restless * np.minimum(share, 1) - 0.02 * share - 100 * np.maximum(share - 1, 0)
        paths = total[:, None] + step
        steps.append(np.argmax(paths, axis=0))
        total = paths.max(axis=0) + score[place]
    picks = [int(np.argmax(total))]
    for back in reversed(steps):
        picks.append(int(back[picks[-1]]))
    return np.array(picks[::-1])


def between(places: NDArray, values: NDArray, wanted: NDArray) -> NDArray[np.float64]:
    """Values at `wanted` of those given at increasing `places`: monotone cubics, at rest at either end."""
    return PchipInterpolator(places, values)(wanted) if len(places) > 1 else np.full(len(wanted), values[0])


def _wrapped(angle: NDArray) -> NDArray[np.float64]:
    return (angle + math.pi) % (2 * math.pi) - math.pi
