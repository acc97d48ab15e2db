"""From a curve and viewing directions to a camera path file: when the camera is where, and what its keyframes are."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..transforms import Vector
from .gaze import between, direction_of
from .routes import at_arcs
from .styles import Style

MOST_KEYFRAMES = 64


@dataclass(frozen=True)
class Schedule:
    """When a path's keyframes are. times, holds: [k] seconds; moving: [k] seconds of movement before each; fractions: [k] of
    the path's length, 0 to 1. gaze_moving, gaze_fractions: [g], the same of the places where it is chosen what to look at."""

    times: NDArray[np.float64]
    holds: NDArray[np.float64]
    moving: NDArray[np.float64]
    fractions: NDArray[np.float64]
    gaze_moving: NDArray[np.float64]
    gaze_fractions: NDArray[np.float64]

    @property
    def moving_s(self) -> float:
        """Seconds of movement."""
        return float(self.moving[-1])


def make_schedule(style: Style, seconds: float, keyframes: int, rng) -> Schedule:
    """Evenly spaced keyframes, or moves that ease in and out between holds where the style stops."""
    if style.stop_s is not None and seconds >= style.move_s[0] + style.stop_s[0]:
        return _with_stops(style, seconds, rng)
    times = np.linspace(0, seconds, keyframes)
    gaze = np.linspace(0, seconds, max(round(seconds / style.gaze_s), 1) + 1)
    return Schedule(times, np.zeros(keyframes), times, times / seconds, gaze, gaze / seconds)


def _with_stops(style: Style, seconds: float, rng) -> Schedule:
    """Every hold lasts at least the style's shortest; the first move begins at time 0."""
    moves, holds, left = [], [], seconds
    while left > 0:
        move = rng.uniform(*style.move_s)
        if left - move < style.stop_s[0]:  # no time for another hold; the first one it always has
            move = left if holds else left - style.stop_s[0]
        moves.append(move)
        left -= move
        hold = min(rng.uniform(*style.stop_s), left)
        if left - hold < style.move_s[0]:
            hold = left
        holds.append(hold)
        left -= hold
    total = sum(moves)
    steps = np.array([1 / 3, 2 / 3, 1])
    eased = steps * steps * (3 - 2 * steps)
    rows = [(0.0, 0.0, 0.0, 0.0)]
    time = moving = 0.0
    for move, hold in zip(moves, holds, strict=True):
        for step, ease in zip(steps, eased, strict=True):
            stop = hold if step == 1 else 0.0
            rows.append((time + step * move, stop, moving + step * move, (moving + ease * move) / total))
        time, moving = time + move + hold, moving + move
    times, stops, before, fractions = np.array(rows).T
    return Schedule(times, stops, before, fractions, before[::3], fractions[::3])


def keyframes_for(length: float, cell: float, frames: int) -> int:
    """Enough keyframes that the spline follows a curve smoothed over half a cell."""
    return int(np.clip(math.ceil(length / cell) + 1, 2, min(frames, MOST_KEYFRAMES)))


def path_values(
    schedule: Schedule,
    curve: NDArray,
    gaze: tuple[NDArray, NDArray],
    style: Style,
    *,
    fps: float,
    fov_y_deg: float,
    origin: Vector,
    unit: float,
    clearance: float,
    up: int,
    seed: int,
) -> dict[str, Any]:
    """The camera path as JSON values. curve: [n, 3] relative to `origin`; gaze: yaw and pitch at the schedule's gaze places.

    Keyframes look at a point, so that the horizon stays level; it lies 10 m ahead, or four keyframes' way.
    """
    points = at_arcs(curve, schedule.fractions)
    yaw, pitch = (between(schedule.gaze_moving, values, schedule.moving) for values in gaze)
    ahead = max(10 * unit, 4 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).max(initial=0)))
    targets = points + ahead * direction_of(yaw, pitch, up)
    digits = max(0, math.ceil(-math.log10(clearance)) + 4)

    def rounded(place: Vector) -> list[float]:
        return [round(value, digits) + 0.0 for value in (place + origin).tolist()]

    keyframes = []
    for time, hold, point, target in zip(schedule.times, schedule.holds, points, targets, strict=True):
        keyframe = {"time": round(float(time), 9), "position": rounded(point), "look_at": rounded(target)}
        if hold > 0:
            keyframe |= {"hold": round(float(hold), 9), "animation": "runs"}
        keyframes.append(keyframe)
    values = {"version": 1, "fps": fps, "fov_y_deg": round(fov_y_deg, 2), "near": round(clearance / 2, digits)}
    if style.shake is not None:
        values["shake"] = {
            "position": round(style.shake.position_m * unit, digits + 2),
            "rotation_deg": style.shake.rotation_deg,
            "low_hz": style.shake.low_hz,
            "high_hz": style.shake.high_hz,
            "seed": seed,
        }
    return values | {"keyframes": keyframes}
