"""Curves through points, read by arc length, and monotone cubics through values over time.

A curve is a chain of cubic Hermite segments. `catmull_rom` gives the centripetal one (Barry and Goldman 1988; Yuksel, Schaefer
and Keyser 2011: alpha = 1/2 has neither cusps nor loops inside a segment). A monotone cubic (Fritsch and Carlson 1980, slopes
of Fritsch and Butland 1984) never runs back: as arc length over time it makes the velocity continuous at every point.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PARTS = 4  # of a segment, each with its own quadrature
NODES, WEIGHTS = ((x + 1) / 2 if k == 0 else x / 2 for k, x in enumerate(np.polynomial.legendre.leggauss(8)))
CHUNK = 8192  # segments or times that are worked on at once: bounds the memory
STEEPEST = 3.0  # slope over a segment's mean slope up to which a cubic is monotone (Fritsch and Carlson 1980)


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A C1 curve in space. knots: [n] increasing parameter. points, tangents: [n, 3], tangents by the parameter. table:
    [n - 1, PARTS + 1] arc length from a segment's begin to the end of each of its parts. lengths: [n] arc length up to a
    point. turns: [n] whether the curve turns back on itself there, so that its direction jumps."""

    knots: Array
    points: Array
    tangents: Array
    table: Array
    lengths: Array
    turns: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Cubic:
    """Cubic Hermite pieces. times: [k] increasing. values, slopes: [k] or [k, components]."""

    times: Array
    values: Array
    slopes: Array


def hermite_curve(knots: Array, points: Array, tangents: Array) -> Curve:
    """The curve with given tangents. One point alone is a curve of length 0."""
    table = np.zeros((len(knots) - 1, PARTS + 1))
    for first in range(0, len(table), CHUNK):
        rows = np.arange(first, min(first + CHUNK, len(table)))
        for part in range(PARTS):
            inside = (part + NODES) / PARTS
            speed = np.linalg.norm(_derivative(knots, points, tangents, rows[:, None], inside[None]), axis=-1)
            widths = (knots[rows + 1] - knots[rows]) / PARTS
            table[rows, part + 1] = table[rows, part] + widths * (speed @ WEIGHTS)
    lengths = np.concatenate([[0.0], np.cumsum(table[:, -1])])
    return Curve(knots=knots, points=points, tangents=tangents, table=table, lengths=lengths, turns=~tangents.any(axis=1))


def catmull_rom(points: Array) -> tuple[Curve, NDArray[np.intp]]:
    """The centripetal Catmull-Rom curve through points [m, 3], and which of its points each of them is.

    Points that repeat the one before are one point of the curve. At the ends the tangent is the chord. Where the way leads
    straight back the tangent is zero, as the formula has it up to rounding.
    """
    if len(points) == 1:  # a shot of one keyframe: there may be very many
        return _point(points), np.zeros(1, dtype=np.intp)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    differs = steps > 4 * np.finfo(float).eps * np.abs(points).max(initial=0.0)
    index = np.concatenate([[0], np.cumsum(differs)])
    points, steps = points[np.concatenate([[True], differs])], steps[differs]
    widths = np.sqrt(steps)
    knots = np.concatenate([[0.0], np.cumsum(widths)])
    widths = np.diff(knots)
    chords = np.diff(points, axis=0) / widths[:, None]
    tangents = np.zeros_like(points)
    if len(chords):
        tangents[0], tangents[-1] = chords[0], chords[-1]
    if len(chords) > 1:
        across = (points[2:] - points[:-2]) / (widths[1:] + widths[:-1])[:, None]
        tangents[1:-1] = chords[:-1] - across + chords[1:]
        size = np.linalg.norm(chords, axis=1)
        tangents[1:-1][np.linalg.norm(tangents[1:-1], axis=1) < 1e-9 * np.maximum(size[:-1], size[1:])] = 0
    return hermite_curve(knots, points, tangents), index


def _point(points: Array) -> Curve:
    """The curve of one point [1, 3]."""
    one = np.zeros(1)
    still = np.ones(1, dtype=bool)
    return Curve(knots=one, points=points, tangents=np.zeros((1, 3)), table=np.zeros((0, PARTS + 1)), lengths=one, turns=still)


def curve_at(curve: Curve, lengths: Array) -> Array:
    """Points [t, 3] at arc lengths [t]; beyond its ends the curve goes straight on."""
    if len(curve.table) == 0:
        return np.broadcast_to(curve.points[0], (len(lengths), 3)).copy()
    end = curve.lengths[-1]
    inside = np.minimum(np.maximum(lengths, 0.0), end)
    rows = np.minimum(np.searchsorted(curve.lengths, inside, side="right") - 1, len(curve.table) - 1)
    places = _positions(curve, rows, _parameters(curve, rows, inside - curve.lengths[rows]))
    places[inside >= end] = curve.points[-1]
    over = lengths - inside
    if over.any():
        for beyond, direction in ((over < 0, curve.tangents[0]), (over > 0, curve.tangents[-1])):
            places[beyond] += over[beyond, None] * direction / np.linalg.norm(direction)
    return places


def _positions(curve: Curve, rows: NDArray[np.intp], u: Array) -> Array:
    """u: [t] fraction of the segment. Exact at u = 0."""
    a, b = curve.points[rows], curve.points[rows + 1]
    width = (curve.knots[rows + 1] - curve.knots[rows])[:, None]
    start, end = curve.tangents[rows] * width, curve.tangents[rows + 1] * width
    u = u[:, None]
    return a + u * u * (3 - 2 * u) * (b - a) + u * (1 - u) * ((1 - u) * start - u * end)


def _derivative(knots: Array, points: Array, tangents: Array, rows: NDArray[np.intp], u: Array) -> Array:
    """By the parameter, at fractions u of segments; rows and u broadcast."""
    chord = (points[rows + 1] - points[rows]) / (knots[rows + 1] - knots[rows])[..., None]
    u = u[..., None]
    return 6 * u * (1 - u) * chord + (1 - u) * (1 - 3 * u) * tangents[rows] + u * (3 * u - 2) * tangents[rows + 1]


def _parameters(curve: Curve, rows: NDArray[np.intp], arcs: Array) -> Array:
    """Fractions [t] of segments at which they are `arcs` long: Newton's steps, halving the bracket where one leaves it."""
    table = curve.table[rows]
    part = np.minimum((table[:, 1:] <= arcs[:, None]).sum(axis=1), PARTS - 1)
    at = np.arange(len(rows))
    goal = np.minimum(arcs, table[:, -1]) - table[at, part]
    whole = table[at, part + 1] - table[at, part]
    u = np.divide(goal, whole, out=np.zeros_like(goal), where=whole > 0)
    low, high = np.zeros_like(u), np.ones_like(u)
    widths = (curve.knots[rows + 1] - curve.knots[rows]) / PARTS
    precise = 1e-14 * table[:, -1]
    for _ in range(60):
        places = (part[:, None] + u[:, None] * np.append(NODES, 1.0)) / PARTS
        speed = (
            np.linalg.norm(_derivative(curve.knots, curve.points, curve.tangents, rows[:, None], places), axis=-1)
            * widths[:, None]
        )
        error = u * (speed[:, :-1] @ WEIGHTS) - goal
        done = (np.abs(error) <= precise) | (u <= 0)
        if done.all():
            break
        low, high = np.where(error < 0, u, low), np.where(error > 0, u, high)
        step = u - np.divide(error, speed[:, -1], out=np.full_like(u, np.inf), where=speed[:, -1] > 0)
        u = np.where(done, u, np.where((step > low) & (step < high), step, (low + high) / 2))
    return (part + u) / PARTS


def monotone_cubic(times: Array, values: Array, resting: NDArray[np.bool_] | None = None) -> Cubic:
    """A C1 cubic through values [k] or [k, components] that rises only where they rise.

    Slopes are weighted harmonic means of the neighbouring mean slopes, those of one neighbour at the ends, and 0 where
    `resting` [k] or where a component has an extreme or stands.
    """
    slopes = np.zeros_like(values, dtype=float)
    if len(times) == 1:
        return Cubic(times=times, values=np.asarray(values, dtype=float), slopes=slopes)
    widths = np.diff(times).reshape(-1, *[1] * (values.ndim - 1))
    means = np.diff(values, axis=0) / widths
    if len(means):
        slopes[0], slopes[-1] = means[0], means[-1]
    if len(means) > 1:
        before, after = means[:-1], means[1:]
        weight_before, weight_after = widths[:-1] + 2 * widths[1:], 2 * widths[:-1] + widths[1:]
        agree = np.sign(before) * np.sign(after) > 0
        both = np.where(agree, before, 1.0), np.where(agree, after, 1.0)
        with np.errstate(over="ignore"):  # of means that are next to nothing: the slope is 0
            slopes[1:-1] = np.where(
                agree, (weight_before + weight_after) / (weight_before / both[0] + weight_after / both[1]), 0.0
            )
    if resting is not None:
        slopes[resting] = 0.0
    return Cubic(times=times, values=np.asarray(values, dtype=float), slopes=slopes)


def cubic_at(cubic: Cubic, times: Array) -> Array:
    """Values [t] or [t, components]; before the first and after the last time they stand still. Exact at its times."""
    if len(cubic.times) == 1:
        return np.broadcast_to(cubic.values[0], (len(times), *cubic.values.shape[1:])).copy()
    row = np.clip(np.searchsorted(cubic.times, times, side="right") - 1, 0, len(cubic.times) - 2)
    width = cubic.times[row + 1] - cubic.times[row]
    shape = (-1, *[1] * (cubic.values.ndim - 1))
    u = np.clip((times - cubic.times[row]) / width, 0.0, 1.0).reshape(shape)
    width = width.reshape(shape)
    a, b = cubic.values[row], cubic.values[row + 1]
    start, end = cubic.slopes[row] * width, cubic.slopes[row + 1] * width
    between = a + u * u * (3 - 2 * u) * (b - a) + u * (1 - u) * ((1 - u) * start - u * end)
    return np.where(u >= 1, b, between)


def smoothstep(x: Array) -> Array:
    """3 x^2 - 2 x^3 of x clamped to [0, 1]."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)
