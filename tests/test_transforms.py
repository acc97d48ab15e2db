"""Float64 matrices on the host: look_at, quaternions, slerp and the projection matrix."""

import math

import numpy as np
import pytest

from framepairs.transforms import (
    clip_from_view,
    look_at,
    quaternion_from_rotation,
    rigid,
    rotation_from_quaternion,
    slerp,
    translation,
)

EPSILON = np.finfo(np.float64).eps
Y_UP = np.array([0.0, 1.0, 0.0])
# A matrix entry comes from some ten rounded operations on numbers of size 1.
ROUNDING = 16 * EPSILON

QUATERNIONS = [
    (1, 0, 0, 0),
    (0, 1, 0, 0),  # half turns about the axes: w = 0, where dividing by w would give NaN
    (0, 0, 1, 0),
    (0, 0, 0, 1),
    (0, 0.6, 0.8, 0),
    (0, -1, 2, -3),
    (0.3, -0.5, 0.7, 0.2),
    (-0.3, 0.5, 0.7, 0.2),
    (1e-9, 1, 1, 1),
    (1, 1e-9, -1e-9, 0),
]


def unit(*values):
    return np.array(values, dtype=float) / np.linalg.norm(values)


def about_y(degrees):
    half = math.radians(degrees) / 2
    return np.array([math.cos(half), 0, math.sin(half), 0])


def assert_rotation(matrix):
    np.testing.assert_allclose(matrix.T @ matrix, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=ROUNDING)


def test_look_at_agrees_with_a_camera_placed_by_hand():
    # At (5, 7, 9) looking along +x with y up: right is +z, so x_camera -> +z, y -> +y, z (backward) -> -x.
    matrix = look_at(np.array([5.0, 7.0, 9.0]), np.array([8.0, 7.0, 9.0]), Y_UP)
    np.testing.assert_array_equal(matrix, [[0, 0, -1, 5], [0, 1, 0, 7], [1, 0, 0, 9], [0, 0, 0, 1]])


def test_look_at_is_rigid_and_sees_the_target_on_its_axis():
    position, target = np.array([3.0, -2.0, 0.5]), np.array([-1.0, 4.0, 11.0])
    matrix = look_at(position, target, np.array([0.2, 3.0, -0.4]))
    assert_rotation(matrix[:3, :3])
    seen = np.linalg.inv(matrix) @ [*target, 1]
    distance = np.linalg.norm(target - position)
    np.testing.assert_allclose(seen, [0, 0, -distance, 1], atol=ROUNDING * distance)
    assert matrix[1, 1] > 0  # the camera's y axis points to the side of up


def test_up_needs_no_unit_length():
    arguments = np.array([1.0, 2, 3]), np.array([4.0, 5, 7])
    np.testing.assert_allclose(look_at(*arguments, 1e-6 * Y_UP), look_at(*arguments, 1e6 * Y_UP), atol=ROUNDING)


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 250, 0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_looking_along_up_gives_a_rotation(up, sign):
    up = np.array(up, dtype=float)
    position = np.array([5.0, -7.0, 2.0])
    matrix = look_at(position, position + sign * 3 * up, up)
    assert_rotation(matrix[:3, :3])
    np.testing.assert_allclose(matrix[:3, 2], -sign * up / np.linalg.norm(up), atol=ROUNDING)


def test_looking_almost_along_up_is_still_a_rotation():
    for angle in (1e-6, 1e-8, 1e-10, 1e-12, 1e-15):
        matrix = look_at(np.zeros(3), np.array([math.sin(angle), -math.cos(angle), 0]), Y_UP)
        assert_rotation(matrix[:3, :3])


def test_a_target_at_the_position_is_refused():
    with pytest.raises(ValueError, match="own position"):
        look_at(np.array([1.0, 2, 3]), np.array([1.0, 2, 3]), Y_UP)


def test_rigid_and_translation_move_points():
    quarter_about_z = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(rigid(quarter_about_z, np.array([10.0, 20, 30])) @ [5, 7, 1, 1], [3, 25, 31, 1])
    np.testing.assert_array_equal(translation(np.array([1.0, 2, 3])) @ [5, 7, 1, 0], [5, 7, 1, 0])


def test_rotation_from_quaternion_turns_as_the_right_hand_says():
    # A quarter about +y takes +z to +x.
    np.testing.assert_allclose(rotation_from_quaternion(about_y(90)) @ [0, 0, 1], [1, 0, 0], atol=ROUNDING)


def test_rotation_from_quaternion_ignores_its_length():
    quaternion = np.array([0.3, -0.5, 0.7, 0.2])
    np.testing.assert_allclose(
        rotation_from_quaternion(1e-3 * quaternion), rotation_from_quaternion(quaternion), atol=ROUNDING
    )


@pytest.mark.parametrize("quaternion", QUATERNIONS)
def test_quaternions_round_trip_up_to_sign(quaternion):
    q = unit(*quaternion)
    rotation = rotation_from_quaternion(q)
    assert_rotation(rotation)
    back = quaternion_from_rotation(rotation)
    assert np.linalg.norm(back) == pytest.approx(1, abs=ROUNDING)
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=ROUNDING)


@pytest.mark.parametrize("degrees", [179.0, 179.999999, 180.0, 180.000001])
def test_rotations_about_a_half_turn_round_trip(degrees):
    rotation = rotation_from_quaternion(about_y(degrees))
    np.testing.assert_allclose(
        rotation_from_quaternion(quaternion_from_rotation(rotation)), rotation, atol=ROUNDING
    )


def test_slerp_gives_its_ends():
    a, b = unit(1, 2, 3, 4), unit(-1, 0.5, 2, 1)
    np.testing.assert_allclose(slerp(a, b, 0), a, atol=ROUNDING)
    np.testing.assert_allclose(slerp(a, b, 1), b, atol=ROUNDING)


@pytest.mark.parametrize("t", [0, 0.25, 0.5, 1])
def test_slerp_turns_evenly(t):
    # From 20 to 100 degrees about y: at t, 20 + 80 t.
    np.testing.assert_allclose(slerp(about_y(20), about_y(100), t), about_y(20 + 80 * t), atol=ROUNDING)


def test_slerp_takes_the_shorter_arc():
    # -q is the same rotation as q: a quarter of the way from 0 to 80 degrees is 20, not the other way round.
    np.testing.assert_allclose(slerp(about_y(0), -about_y(80), 0.25), about_y(20), atol=ROUNDING)
    # From 170 to -170 degrees through 180.
    middle = slerp(about_y(170), about_y(-170), 0.5)
    np.testing.assert_allclose(
        rotation_from_quaternion(middle), rotation_from_quaternion(about_y(180)), atol=ROUNDING
    )


def test_slerp_of_equal_and_opposite_quaternions_stands_still():
    q = unit(0.1, -0.4, 0.8, 0.3)
    for other in (q, -q):
        for t in (0, 0.3, 1):
            np.testing.assert_allclose(slerp(q, other, t), q, atol=ROUNDING)


@pytest.mark.parametrize("degrees", [1e-3, 1e-6, 1e-7, 1e-9, 1e-14])
def test_slerp_of_nearly_equal_quaternions_is_finite_and_between(degrees):
    a, b = about_y(30), about_y(30 + degrees)
    between = slerp(a, b, 0.25)
    assert np.linalg.norm(between) == pytest.approx(1, abs=ROUNDING)
    np.testing.assert_allclose(between, about_y(30 + degrees / 4), atol=ROUNDING)


def test_slerp_of_rotations_a_half_turn_apart_is_a_quarter_from_each():
    middle = slerp(about_y(0), about_y(180), 0.5)
    np.testing.assert_allclose(np.abs(middle @ about_y(0)), math.cos(math.pi / 4), atol=ROUNDING)


def test_clip_from_view_maps_the_planes_to_minus_one_and_one():
    near, far = 0.25, 700.0
    clip = clip_from_view(math.radians(40), 7 / 5, near, far)
    for distance, expected in ((near, -1), (far, 1)):
        x, y, z, w = clip @ [0, 0, -distance, 1]
        assert w == distance
        # z is a difference of numbers of size 2 far / (far - near) * distance.
        assert z / w == pytest.approx(expected, abs=4 * ROUNDING)


def test_clip_from_view_maps_the_corner_of_the_frustum_to_one():
    fov_y, aspect = math.radians(40), 7 / 5
    top = 3 * math.tan(fov_y / 2)
    x, y, _, w = clip_from_view(fov_y, aspect, 0.1, 10) @ [aspect * top, top, -3, 1]
    assert (x / w, y / w) == (pytest.approx(1, abs=ROUNDING), pytest.approx(1, abs=ROUNDING))
