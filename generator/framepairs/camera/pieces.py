"""Pieces of a camera track: internal curves over time, whatever they were written as, and what they say at given times.

A piece is smooth: place and direction have a continuous velocity inside it. Keyframes and moves become pieces; a cut, or a move
after another one, begins the next.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .rotations import (
    Horizon,
    RotationSpline,
    camera_rotations,
    direction_of,
    level_rotations,
    rotations_at,
    smooth_headings,
)
from .splines import CHUNK, Cubic, Curve, cubic_at, curve_at, smoothstep
from .springs import Spring, spring_at

Array = NDArray[np.float64]
Places = Callable[[str, Array], Array]  # of an object's name and times [t] of the path: its place [t, 3]

GRID_PER_S, GRID_PER_SEGMENT, GRID_MOST = 120, 16, 2e6  # nodes between which a heading is smoothed


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Along a curve, at arc lengths over time. anchor: the object that the curve goes along with."""

    curve: Curve
    timing: Cubic
    anchor: str | None = None


@dataclass(frozen=True, kw_only=True)
class Hanging:
    """On a spring. seconds: of times [t] of the path to seconds [t] since the spring's first node."""

    spring: Spring
    seconds: Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True)
class Targets:
    """Looks at a point. runs: motions one after another; between the end of one and the begin of the next they are blended."""

    runs: tuple[Motion, ...]


@dataclass(frozen=True, kw_only=True)
class Angles:
    """Looks at headings and elevations, radians: values [k, 2]."""

    angles: Cubic


@dataclass(frozen=True, kw_only=True)
class Ahead:
    """Looks at the point of its own way that lies `distance` ahead."""

    distance: float


@dataclass(frozen=True, kw_only=True)
class Piece:
    """begin, end: seconds; outside it stands still. shot: index. knots: [k] times at which curves change. fields: of the
    knots, for messages. lens: values [k, 6], see `camera.lens`."""

    begin: float
    end: float
    shot: int
    knots: Array
    fields: tuple[str, ...]
    position: Motion | Hanging
    view: Targets | RotationSpline | Angles | Ahead
    lens: Cubic


def field_at(piece: Piece, time: float) -> str:
    return piece.fields[max(int(np.searchsorted(piece.knots, time, side="right")) - 1, 0)]


def motion_at(motion: Motion, times: Array, places: Places) -> Array:
    """[t, 3]."""
    found = curve_at(motion.curve, cubic_at(motion.timing, times))
    return found if motion.anchor is None else found + places(motion.anchor, times)


def positions_at(piece: Piece, times: Array, places: Places) -> Array:
    """[t, 3]."""
    if isinstance(piece.position, Hanging):
        return spring_at(piece.position.spring, piece.position.seconds(times))
    return motion_at(piece.position, times, places)


def _targets_at(targets: Targets, times: Array, places: Places) -> Array:
    begins = np.array([run.timing.times[0] for run in targets.runs])
    ends = np.array([run.timing.times[-1] for run in targets.runs])
    which = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, None)
    found = np.empty((len(times), 3))
    for index in np.unique(which):
        here = which == index
        run, t = targets.runs[index], times[here]
        found[here] = motion_at(run, t, places)
        between = here & (times > ends[index])
        if index + 1 < len(targets.runs) and between.any():
            t = times[between]
            share = smoothstep((t - ends[index]) / (begins[index + 1] - ends[index]))[:, None]
            after = motion_at(targets.runs[index + 1], t, places)
            found[between] = (1 - share) * motion_at(run, t, places) + share * after
    return found


def forwards_at(piece: Piece, times: Array, horizon: Horizon, places: Places) -> Array:
    """Unit viewing axes [t, 3]; NaN where the camera is at its own target."""
    if isinstance(piece.view, Angles):
        return direction_of(*cubic_at(piece.view.angles, times).T, horizon)
    if isinstance(piece.view, RotationSpline):
        return -rotations_at(piece.view, times)[:, :, 2]
    if isinstance(piece.view, Ahead):
        at = cubic_at(piece.position.timing, times)
        away = curve_at(piece.position.curve, at + piece.view.distance) - curve_at(piece.position.curve, at)
    else:
        away = _targets_at(piece.view, times, places) - positions_at(piece, times, places)
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    return np.divide(away, distance, out=np.full_like(away, np.nan), where=distance > 0)


def rotations_of(piece: Piece, times: Array, horizon: Horizon, places: Places, smooth: Callable[[], Cubic]) -> Array:
    """world_from_camera rotations [t, 3, 3], without roll. smooth: gives `headings_of_piece`, called only near the poles.

    Raises InputError where the camera is at its own target.
    """
    if isinstance(piece.view, RotationSpline):
        return rotations_at(piece.view, times)
    forwards = forwards_at(piece, times, horizon, places)
    if isinstance(piece.view, Angles):
        return camera_rotations(forwards, cubic_at(piece.view.angles, times)[:, 0], horizon)
    lost = np.isnan(forwards).any(axis=1)
    if lost.any():
        time = float(times[np.argmax(lost)])
        problem = f"the camera meets its target on the way, at {time:g} s"
        raise InputError(problem, file="camera path", field=field_at(piece, time))
    return level_rotations(forwards, times, horizon, smooth)


def headings_of_piece(piece: Piece, horizon: Horizon, places: Places) -> Cubic:
    """The smooth heading of a whole piece, from a grid of times that depends on the piece alone."""
    knots = np.unique(np.clip(piece.knots, piece.begin, piece.end))
    rate = min(GRID_PER_S, GRID_MOST / max(knots[-1] - knots[0], 1.0))
    counts = np.maximum(np.ceil(np.diff(knots) * rate), GRID_PER_SEGMENT).astype(int)
    inside = [a + (b - a) * np.arange(n) / n for a, b, n in zip(knots, knots[1:], counts, strict=False)]
    times = np.unique(np.concatenate([*inside, knots[-1:]]))
    chunks = [times[first : first + CHUNK] for first in range(0, len(times), CHUNK)]
    forwards = np.concatenate([forwards_at(piece, chunk, horizon, places) for chunk in chunks])
    seen = ~np.isnan(forwards).any(axis=1)
    return smooth_headings(times[seen], forwards[seen], horizon)
