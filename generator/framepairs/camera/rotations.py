"""Rotations over time: quaternions [..., 4] as (w, x, y, z), a C1 spline through them, and level cameras that pass the poles.

A turn is a rotation vector [..., 3]: axis times angle in radians.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from .splines import Cubic, cubic_at, monotone_cubic, smoothstep

Array = NDArray[np.float64]

LEVEL_DEG, FREE_DEG = 60.0, 80.0  # elevation up to which the horizon is level, and from which its roll is the smooth one
LEAST_WEIGHT = 1e-12  # of a smoothed heading, over that of its turning: far above rounding, so that it can be solved for
REACH, NEAR = 0.25, 0.15  # radians around a pole: within them the heading is smoothed, and does not take over its own turning


@dataclass(frozen=True, kw_only=True)
class RotationSpline:
    """times: [k]. quaternions: [k, 4]. rates: [k, 3] angular velocity in the rotating frame, radians per second."""

    times: Array
    quaternions: Array
    rates: Array


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """The world's axes for level cameras. up: unit [3]. right, ahead: unit [3], the right and forward axis of a camera of
    heading 0; the heading grows to the left."""

    up: Array
    right: Array
    ahead: Array


def multiply(a: Array, b: Array) -> Array:
    """Quaternion products."""
    (w, x, y, z), (W, X, Y, Z) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    parts = (w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y)
    return np.stack([*parts, w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W], axis=-1)


def conjugate(a: Array) -> Array:
    return a * np.array([1.0, -1, -1, -1])


def quaternion_of_turn(turn: Array) -> Array:
    half = np.linalg.norm(turn, axis=-1, keepdims=True) / 2
    return np.concatenate([np.cos(half), np.sinc(half / np.pi) * turn / 2], axis=-1)


def turn_of_quaternion(quaternion: Array) -> Array:
    """Of at most half a circle, whatever the quaternion's sign and length."""
    w, v = quaternion[..., :1], quaternion[..., 1:]
    w, v = np.abs(w), np.where(w < 0, -v, v)
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, w)
    small = size <= 1e-12 * w
    return v * np.where(small, 2 / np.where(w > 0, w, 1.0), angle / np.where(small, 1.0, size))


def rotation_of_quaternion(quaternion: Array) -> Array:
    """[..., 3, 3] of unit quaternions."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_spline(times: Array, quaternions: Array, resting: NDArray[np.bool_]) -> RotationSpline:
    """Through unit quaternions [k, 4] at times [k], with angular velocity 0 where `resting` [k].

    Each segment takes the shorter way. At a key the speed is the weighted harmonic mean of the neighbouring segments' speeds
    (Fritsch and Butland 1984), the axis the mean of theirs; where they turn back, it is 0. So no segment, however short, makes
    its neighbours whirl. Ends have the speed of their segment: two keys are a slerp.
    """
    widths = np.diff(times)
    turns = turn_of_quaternion(multiply(conjugate(quaternions[:-1]), quaternions[1:])) / widths[:, None]
    rates = np.zeros((len(times), 3))
    if len(turns):
        rates[0], rates[-1] = turns[0], turns[-1]
    if len(turns) > 1:
        speeds = np.linalg.norm(turns, axis=1)
        axes = turns / np.where(speeds > 0, speeds, 1.0)[:, None]
        before, after = 1 / np.where(speeds > 0, speeds, np.inf)[:-1], 1 / np.where(speeds > 0, speeds, np.inf)[1:]
        moving = (speeds[:-1] > 0) & (speeds[1:] > 0)
        weight_before, weight_after = widths[:-1] + 2 * widths[1:], 2 * widths[:-1] + widths[1:]
        sums = np.where(moving, weight_before * before + weight_after * after, 1.0)
        harmonic = np.where(moving, (weight_before + weight_after) / sums, 0.0)
        rates[1:-1] = harmonic[:, None] * (axes[:-1] + axes[1:]) / 2
    rates[resting] = 0.0
    return RotationSpline(times=times, quaternions=quaternions, rates=rates)


def rotations_at(spline: RotationSpline, times: Array) -> Array:
    """[t, 3, 3] at times [t]: the cumulative cubic of Kim, Kim and Shin (1995), with given angular velocity at both ends."""
    if len(spline.times) == 1:
        return np.repeat(rotation_of_quaternion(spline.quaternions), len(times), axis=0)
    row = np.clip(np.searchsorted(spline.times, times, side="right") - 1, 0, len(spline.times) - 2)
    width = spline.times[row + 1] - spline.times[row]
    u = np.clip((times - spline.times[row]) / width, 0.0, 1.0)[:, None]
    first, last = spline.quaternions[row], spline.quaternions[row + 1]
    leaves, arrives = spline.rates[row] * width[:, None] / 3, spline.rates[row + 1] * width[:, None] / 3
    inner = multiply(multiply(quaternion_of_turn(-leaves), conjugate(first)), multiply(last, quaternion_of_turn(-arrives)))
    middle = turn_of_quaternion(inner)
    turned = multiply(first, quaternion_of_turn((1 - (1 - u) ** 3) * leaves))
    turned = multiply(turned, quaternion_of_turn(u * u * (3 - 2 * u) * middle))
    turned = multiply(turned, quaternion_of_turn(u**3 * arrives))
    turned = np.where(u <= 0, first, np.where(u >= 1, last, turned))
    return rotation_of_quaternion(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


def horizon_of(up: Array) -> Horizon:
    """Heading 0 looks along -z where y is up, along +y where z is, along +z where x is."""
    up = up / np.linalg.norm(up)
    right = np.eye(3)[np.argmin(np.abs(up))]
    right = right - (right @ up) * up
    right = right / np.linalg.norm(right)
    return Horizon(up=up, right=right, ahead=np.cross(up, right))


def headings_of(forwards: Array, horizon: Horizon) -> Array:
    """[t] radians of forward axes [t, 3]; at a pole 0."""
    return np.arctan2(-(forwards @ horizon.right), forwards @ horizon.ahead)


def direction_of(yaw: Array, pitch: Array, horizon: Horizon) -> Array:
    """Unit forward axes [t, 3] of headings and elevations [t], radians."""
    flat = np.cos(yaw)[:, None] * horizon.ahead - np.sin(yaw)[:, None] * horizon.right
    return np.cos(pitch)[:, None] * flat + np.sin(pitch)[:, None] * horizon.up


def camera_rotations(forwards: Array, headings: Array, horizon: Horizon) -> Array:
    """[t, 3, 3] world_from_camera of forward axes with the right axis of given headings, as nearly as they allow.

    The right axis is horizontal where the heading is the forward axis' own.
    """
    own = headings_of(forwards, horizon)
    rights = np.cos(own)[:, None] * horizon.right + np.sin(own)[:, None] * horizon.ahead
    rights = rights - np.sum(rights * forwards, axis=1, keepdims=True) * forwards
    rights /= np.linalg.norm(rights, axis=1, keepdims=True)
    ups = np.cross(rights, forwards)
    angle = (headings - own) * np.where(forwards @ horizon.up < 0, -1.0, 1.0)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    rolled = cosine * rights - sine * ups
    return np.stack([rolled, np.cross(rolled, forwards), -forwards], axis=2)


def smooth_headings(times: Array, forwards: Array, horizon: Horizon) -> Cubic:
    """A heading over time that follows the forward axes' own, yet turns slowly where they pass a pole.

    It minimises the integral, over the angle that the axis travels, of (h' - s own')^2 + (r / REACH^2)^2 (h - own)^2, r the
    sine of the distance to the pole, s = min(1, r / NEAR)^2: at a pole, where the own heading whirls, it weighs nothing. Where
    the elevation is below LEVEL_DEG it is the own one. times: [t]; forwards: [t, 3].
    """
    own = headings_of(forwards, horizon)
    radius = np.linalg.norm(forwards - (forwards @ horizon.up)[:, None] * horizon.up, axis=1)
    known = np.flatnonzero(radius > 1e-6)
    if len(known) == 0:
        return monotone_cubic(times, np.zeros(len(times)))
    if len(times) == 1:
        return monotone_cubic(times, own)
    nearest = known[np.clip(np.searchsorted(known, np.arange(len(times)), side="right") - 1, 0, None)]
    own = np.unwrap(own[nearest])
    steps = np.maximum(np.linalg.norm(np.diff(forwards, axis=0), axis=1), 1e-6)
    shares = (np.append(steps, 0) + np.insert(steps, 0, 0)) / 2
    bands = np.zeros((2, len(times)))
    bands[1, :-1] += 1 / steps
    bands[1, 1:] += 1 / steps
    bands[0, 1:] = -1 / steps
    weights = np.where(radius > 1e-6, shares * radius**2 / REACH**4, 0.0) + LEAST_WEIGHT * bands[1]
    weights[radius > math.cos(math.radians(LEVEL_DEG))] = 1e9
    bands[1] += weights
    lost = (np.minimum(1.0, np.minimum(radius[1:], radius[:-1]) / NEAR) ** 2 - 1) * np.diff(own) / steps
    return monotone_cubic(times, own + solveh_banded(bands, np.append(0, lost) - np.append(lost, 0)))  # of h - own


def level_rotations(forwards: Array, times: Array, horizon: Horizon, smooth) -> Array:
    """[t, 3, 3] of forward axes [t, 3] at times [t]: level up to LEVEL_DEG, from FREE_DEG on with the heading of `smooth`,
    between them blended. smooth: function without arguments that gives the Cubic of `smooth_headings`; called only near poles.
    """
    own = headings_of(forwards, horizon)
    elevation = np.degrees(np.arctan2(np.abs(forwards @ horizon.up), np.linalg.norm(np.cross(forwards, horizon.up), axis=1)))
    share = smoothstep((elevation - LEVEL_DEG) / (FREE_DEG - LEVEL_DEG))
    if share.any():
        away = cubic_at(smooth(), times) - own
        own = own + share * (np.remainder(away + np.pi, 2 * np.pi) - np.pi)
    return camera_rotations(forwards, own, horizon)
