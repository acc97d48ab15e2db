"""Rotations over time: quaternion algebra, the C1 spline, and level cameras that pass a pole."""

import math

import numpy as np
import pytest

from framepairs.camera.rotations import (
    camera_rotations,
    direction_of,
    headings_of,
    horizon_of,
    level_rotations,
    multiply,
    quaternion_of_turn,
    rotation_of_quaternion,
    rotation_spline,
    rotations_at,
    smooth_headings,
    turn_of_quaternion,
)
from framepairs.transforms import look_at

EPSILON = np.finfo(np.float64).eps
Y_UP = horizon_of(np.array([0.0, 1, 0]))
RESTLESS = np.zeros(4, dtype=bool)


def random_quaternions(count, seed=0):
    found = np.random.default_rng(seed).normal(size=(count, 4))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def about_y(degrees):
    return quaternion_of_turn(np.radians(np.asarray(degrees, dtype=float))[..., None] * [0, 1, 0])


def rates(rotations, h):
    """Angular velocity [t - 1, 3] in world axes between neighbours h seconds apart."""
    turned = rotations[1:] @ np.swapaxes(rotations[:-1], 1, 2)
    axial = np.stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]], 1
    )
    return axial / 2 / h


@pytest.mark.parametrize("angle", [0, 1e-300, 1e-9, 0.3, 3.0, math.pi - 1e-9, math.pi])
def test_turns_round_trip(angle):
    axis = np.array([2.0, -1, 2]) / 3
    quaternion = quaternion_of_turn(angle * axis)
    assert np.linalg.norm(quaternion) == pytest.approx(1, abs=4 * EPSILON)
    np.testing.assert_allclose(turn_of_quaternion(-3 * quaternion), angle * axis, rtol=1e-14, atol=8 * EPSILON * angle)


def test_products_of_quaternions_are_those_of_rotations():
    a, b = random_quaternions(2)
    product = rotation_of_quaternion(multiply(a, b))
    np.testing.assert_allclose(product, rotation_of_quaternion(a) @ rotation_of_quaternion(b), atol=16 * EPSILON)


def test_the_spline_meets_its_keys_and_two_of_them_are_a_slerp():
    quaternions, times = random_quaternions(4), np.array([0, 0.5, 3, 3.25])
    spline = rotation_spline(times, quaternions, RESTLESS)
    np.testing.assert_allclose(rotations_at(spline, times), rotation_of_quaternion(quaternions), atol=8 * EPSILON)
    pair = rotation_spline(np.array([0, 2.0]), np.stack([about_y(20), -about_y(100)]), RESTLESS[:2])
    found = rotations_at(pair, np.array([-1, 0.5, 1.5, 9]))
    np.testing.assert_allclose(found, rotation_of_quaternion(about_y([20, 40, 80, 100])), atol=16 * EPSILON)


def test_its_angular_velocity_is_continuous_and_zero_at_rest():
    times, h = np.array([0, 0.5, 3, 3.25, 5]), 1e-6
    spline = rotation_spline(times, random_quaternions(5, 2), np.array([False, False, False, True, False]))
    before = [rates(rotations_at(spline, np.array([t - h, t])), h)[0] for t in times[1:-1]]
    after = [rates(rotations_at(spline, np.array([t, t + h])), h)[0] for t in times[1:-1]]
    # One-sided: h times the angular acceleration (some 1e2) and rounding of 1e-16 / h.
    np.testing.assert_allclose(before, after, atol=1e-3)
    assert np.linalg.norm(before[0]) > 0.1
    np.testing.assert_allclose(after[2], 0, atol=1e-3)


def test_steady_turning_stays_steady_over_uneven_keys():
    times = np.array([0, 0.1, 1, 1.01, 4])
    spline = rotation_spline(times, about_y(50 * times), np.zeros(5, dtype=bool))
    found = rates(rotations_at(spline, np.linspace(0, 4, 401)), 0.01)
    # sin(x) / x is 1 - 1.3e-5 for steps of x = 0.0087.
    np.testing.assert_allclose(found, np.radians(50) * np.array([[0, 1, 0]]).repeat(400, 0), atol=2e-5)


def test_a_pair_of_keys_next_to_each_other_makes_no_whirl():
    times = np.array([0, 1, 1 + 1e-9, 2])
    spline = rotation_spline(times, about_y([0, 30, 90, 120]), RESTLESS)
    around = np.concatenate([np.linspace(0, 1, 500)[:-1], np.linspace(1 + 1e-9, 2, 500)])
    degrees = np.degrees(np.unwrap(np.arctan2(rotations_at(spline, around)[:, 0, 2], rotations_at(spline, around)[:, 0, 0])))
    assert (np.diff(degrees) > -1e-6).all() and degrees[-1] == pytest.approx(120)


def test_a_turn_there_and_back_stops_at_its_end():
    spline = rotation_spline(np.array([0.0, 1, 2]), about_y([0, 80, 20]), RESTLESS[:3])
    found = rotations_at(spline, np.linspace(0, 2, 201))
    degrees = np.degrees(np.arctan2(found[:, 0, 2], found[:, 0, 0]))
    assert degrees.max() == pytest.approx(80) and degrees.min() >= -1e-9


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 3), (-2, 0, 0), (1, 2, 3)])
def test_a_level_camera_is_look_at(up):
    horizon = horizon_of(np.array(up, dtype=float))
    assert np.dot(horizon.right, horizon.up) == pytest.approx(0, abs=EPSILON)
    forwards = np.random.default_rng(1).normal(size=(50, 3))
    forwards /= np.linalg.norm(forwards, axis=1, keepdims=True)
    found = camera_rotations(forwards, headings_of(forwards, horizon), horizon)
    expected = [look_at(np.zeros(3), forward, np.array(up, dtype=float))[:3, :3] for forward in forwards]
    np.testing.assert_allclose(found, expected, atol=1e-13)  # rounding over the sine of the distance to the pole, here > 0.01


def test_headings_and_elevations_are_directions():
    assert np.allclose(direction_of(np.zeros(1), np.zeros(1), Y_UP), [[0, 0, -1]])
    assert np.allclose(direction_of(np.radians([90.0]), np.zeros(1), Y_UP), [[-1, 0, 0]])  # to the left
    assert np.allclose(direction_of(np.zeros(1), np.radians([30.0]), Y_UP), [[0, 0.5, -math.sqrt(0.75)]])
    assert np.allclose(horizon_of(np.array([0, 0, 1.0])).ahead, [0, 1, 0])
    yaw = np.radians([-170.0, -20, 100])
    np.testing.assert_allclose(headings_of(direction_of(yaw, yaw / 3, Y_UP), Y_UP), yaw, atol=1e-15)


def over_the_pole(offset, count=2001):
    """Unit forwards from elevation 10 over (or `offset` radians beside) the zenith to elevation 10 on the other side."""
    angle = np.linspace(math.radians(10), math.radians(170), count)
    forwards = np.stack([np.full(count, math.sin(offset)), np.sin(angle), -np.cos(angle)], axis=1)
    return forwards / np.linalg.norm(forwards, axis=1, keepdims=True)


@pytest.mark.parametrize("offset", [0, 1e-12, 1e-6, 0.01, 0.1, 0.3])
@pytest.mark.parametrize("sign", [1, -1])
def test_over_a_pole_it_neither_flips_nor_whirls(offset, sign):
    forwards = over_the_pole(offset) * [1, sign, 1]
    times = np.linspace(0, 1, len(forwards))
    found = level_rotations(forwards, times, Y_UP, lambda: smooth_headings(times, forwards, Y_UP))
    np.testing.assert_allclose(-found[:, :, 2], forwards, atol=4 * EPSILON)
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-14)
    level = np.abs(forwards[:, 1]) < math.sin(math.radians(60)) - 1e-9
    assert np.abs(found[level, 1, 0]).max() < 1e-15 and (found[level, 1, 1] > 0).all()
    turning = np.linalg.norm(rates(found, times[1]), axis=1)
    travelling = math.radians(160)  # a second
    # Half a turn of roll within 60 degrees of the way, smoothly: 3 times that rate on the mean, here at most twice as much.
    assert turning.max() < 6 * travelling
    jumps = []
    for count in (2001, 8001):
        fine, forwards = np.linspace(0, 1, count), over_the_pole(offset, count) * [1, sign, 1]
        heading = smooth_headings(times, over_the_pole(offset) * [1, sign, 1], Y_UP)
        turned = rates(level_rotations(forwards, fine, Y_UP, lambda heading=heading: heading), fine[1])
        jumps.append(np.abs(np.diff(turned, axis=0)).max())
    assert jumps[1] < 0.35 * jumps[0]  # a quarter of the step, a quarter of the change: nothing jumps


def test_circling_high_up_stays_level():
    yaw = np.linspace(0, 4 * math.pi, 1501)
    forwards = direction_of(yaw, np.full(1501, math.radians(75)), Y_UP)
    found = level_rotations(forwards, yaw, Y_UP, lambda: smooth_headings(yaw, forwards, Y_UP))
    assert np.abs(found[:, 1, 0]).max() < 1e-6


def test_a_camera_that_looks_straight_up_throughout_has_heading_zero():
    forwards = np.repeat([[0.0, 1, 0]], 5, axis=0)
    times = np.arange(5.0)
    found = level_rotations(forwards, times, Y_UP, lambda: smooth_headings(times, forwards, Y_UP))
    np.testing.assert_allclose(found[:, :, 0], np.repeat([[1.0, 0, 0]], 5, axis=0), atol=1e-15)
    assert len({rotation.tobytes() for rotation in found}) == 1
