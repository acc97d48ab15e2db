"""Moves: where each leads, that they join, and what is refused."""

import math

import numpy as np
import pytest

from framepairs.camera.track import prepare_track, sample
from framepairs.camera_path import end_of, frame_times, make_camera_path
from framepairs.errors import InputError
from framepairs.transforms import rigid

Y_UP = np.array([0.0, 1, 0])
ORBIT = {"move": "orbit", "duration": 2, "center": [1, 2, 3], "radius": 5, "to_deg": 90}
HOLD = {"move": "hold", "duration": 1}


def moved(*moves, **keys):
    return make_camera_path({"version": 1, "moves": moves, **keys})


def drives(name, time):
    return rigid(np.eye(3), np.array([2.0 * time, 0, 0]))


def track_of(*moves, up=Y_UP, **keys):
    return prepare_track(moved(*moves, **keys), up, drives)


def seen(track, *times):
    """Places and viewing axes at times."""
    matrices = [sample(track, t).world_from_camera for t in times]
    return np.array([m[:3, 3] for m in matrices]), np.array([-m[:3, 2] for m in matrices])


def test_an_orbit_is_a_circle_around_its_centre_which_it_looks_at():
    track = track_of({**ORBIT, "elevation_deg": 30, "from_deg": 10, "to_deg": 370, "ease": "none"})
    times = np.linspace(0, 2, 41)
    positions, forwards = seen(track, *times)
    away = np.array([1, 2, 3]) - positions
    # Hermite segments of 1 degree err by (pi / 180)^4 / 384 = 2.4e-10 of the radius.
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 5, rtol=3e-10)
    np.testing.assert_allclose(away / 5, forwards, atol=1e-9)
    np.testing.assert_allclose(positions[:, 1], 2 + 2.5, atol=1e-9)
    headings = np.degrees(np.unwrap(np.arctan2(-forwards[:, 0], -forwards[:, 2])))
    np.testing.assert_allclose(headings, 10 + 180 * times, atol=1e-4)  # even in arc length: 1e-6 of a degree of arc


def test_in_and_out_eases_from_rest_to_rest():
    track = track_of(ORBIT)
    positions, forwards = seen(track, 0, 1e-4, 0.5, 1, 2 - 1e-4, 2)
    headings = np.degrees(np.arctan2(-forwards[:, 0], -forwards[:, 2]))
    np.testing.assert_allclose(headings, [0, 0, 90 * (3 / 16 - 2 / 64), 45, 90, 90], atol=1e-5)
    np.testing.assert_allclose(positions[0], [1, 2, 8], atol=1e-12)  # heading 0 looks along -z


def test_an_orbit_rises_and_goes_along_with_an_object():
    track = track_of({**ORBIT, "center": {"object": "cart", "offset": [0, 1, 0]}, "rise": 3})
    positions, forwards = seen(track, 0, 2)
    np.testing.assert_allclose(positions, [[0, 1, 5], [4 + 5, 1 + 3, 0]], atol=1e-9)
    np.testing.assert_allclose(forwards[1], np.array([-5, -3, 0]) / math.sqrt(34), atol=1e-9)
    still = track_of({**ORBIT, "to_deg": 0})
    assert np.array_equal(*seen(still, 0.0, 1.3)[0])


def test_heading_zero_of_a_z_up_scene_looks_along_y():
    _, forwards = seen(
        track_of({"move": "pan", "duration": 1, "position": [0, 0, 0], "to_yaw_deg": 90}, up=np.array([0, 0, 1.0])), 0, 1
    )
    np.testing.assert_allclose(forwards, [[0, 1, 0], [-1, 0, 0]], atol=1e-15)


def test_a_dolly_keeps_its_direction_or_its_target():
    dolly = {"move": "dolly", "duration": 1, "from_position": [0, 0, 0], "to_position": [4, 0, 0]}
    positions, forwards = seen(track_of({**dolly, "yaw_deg": 90, "pitch_deg": -30}), 0, 0.25, 1)
    np.testing.assert_allclose(positions[:, 0], [0, 4 * (3 / 16 - 2 / 64), 4], atol=1e-12)
    np.testing.assert_allclose(forwards, [[-math.sqrt(0.75), -0.5, 0]] * 3, atol=1e-15)
    positions, forwards = seen(track_of({**dolly, "look_at": [2, 0, -9]}), 0, 0.3, 1)
    away = np.array([2, 0, -9]) - positions
    np.testing.assert_allclose(forwards, away / np.linalg.norm(away, axis=1, keepdims=True), atol=1e-15)


def test_a_fly_through_meets_its_points_and_looks_ahead():
    points = [[0, 1, 0], [3, 1, -4], [9, 2, -4], [12, 1, 0]]
    move = {"move": "fly_through", "points": points, "speed": 2, "ease": "none"}
    path = moved(move)
    length = 2 * end_of(path)
    assert 16.2 < length < 17.5  # the polygon is 16.18 long
    track = prepare_track(path, Y_UP)
    times = np.linspace(0, end_of(path), 4001)
    positions, forwards = seen(track, *times)
    for point in points:
        assert np.linalg.norm(positions - point, axis=1).min() < length / 4000
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    np.testing.assert_allclose(steps, length / 4000, rtol=1e-5)
    ahead = positions[200:] - positions[:-200]  # a twentieth of the way
    np.testing.assert_allclose(forwards[:-200], ahead / np.linalg.norm(ahead, axis=1, keepdims=True), atol=1e-6)
    turning = np.linalg.norm(np.diff(forwards, 2, axis=0), axis=1)
    assert turning.max() < 1e-4  # some 2 rad over 4000 steps, without a corner


def test_a_pan_turns_on_the_spot_also_more_than_once_and_to_the_zenith():
    track = track_of(
        {"move": "pan", "duration": 2, "position": [1, 2, 3], "to_yaw_deg": 720, "to_pitch_deg": 90, "ease": "none"}
    )
    times = np.linspace(0, 2, 401)
    matrices = np.array([sample(track, t).world_from_camera for t in times])
    assert (matrices[:, :3, 3] == [1, 2, 3]).all()
    yaw_90 = [-math.cos(math.pi / 16), math.sin(math.pi / 16), 0]
    np.testing.assert_allclose(-matrices[50, :3, 2], yaw_90, atol=1e-12)
    np.testing.assert_allclose(-matrices[-1, :3, 2], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(matrices[-1, :3, 0], [1, 0, 0], atol=1e-12)
    assert np.abs(matrices[:, 1, 0]).max() < 1e-12


def test_moves_go_on_where_the_last_one_ended():
    path = moved(
        {**ORBIT, "elevation_deg": 20},
        HOLD,
        {"move": "pan", "duration": 1, "to_yaw_deg": 30, "roll_deg": 10, "fov_y_deg": 30, "exposure_ev": 2},
        {"move": "dolly", "duration": 1, "to_position": [0, 0, 0]},
        {**HOLD, "animation": "runs"},
    )
    track = prepare_track(path, Y_UP)
    assert len(frame_times(path)) == 6 * 24 + 1
    end = sample(track, 2.0)
    assert np.array_equal(sample(track, 2.7).world_from_camera, end.world_from_camera)
    last = sample(track, 5.0)
    np.testing.assert_allclose(last.world_from_camera[:3, 3], 0, atol=1e-12)
    assert math.degrees(last.fov_y) == pytest.approx(30) and last.exposure_ev == 2
    np.testing.assert_allclose(
        math.degrees(math.asin(-last.world_from_camera[1, 0] / math.cos(math.radians(20)))), 10, atol=1e-9
    )
    assert [sample(track, t).scene_time_s for t in (2, 2.5, 3, 5, 6)] == [2, 2, 2, 4, 5]
    assert np.array_equal(sample(track, 5.9).world_from_camera, last.world_from_camera)
    assert {sample(track, t).shot for t in (0, 3, 6)} == {0}


def test_a_cut_begins_a_new_shot_anywhere_with_its_own_lens():
    track = track_of({**ORBIT, "ease": "none", "fov_y_deg": 20}, {**ORBIT, "center": [50, 0, 0], "cut": True, "ease": "none"})
    before, after = sample(track, 2 - 1e-6), sample(track, 2.0)
    assert (before.shot, after.shot) == (0, 1) and after.world_from_camera[0, 3] == pytest.approx(50)
    assert [math.degrees(item.fov_y) for item in (before, after)] == pytest.approx([20, 45])


def test_constant_speed_goes_on_at_the_same_speed():
    walk = {"move": "dolly", "duration": 1, "ease": "none", "to_position": [1, 0, 0], "yaw_deg": 0}
    track = track_of({**walk, "from_position": [0, 0, 0]}, {**walk, "to_position": [3, 0, 0], "duration": 2})
    np.testing.assert_allclose(seen(track, 0.5, 1, 2)[0][:, 0], [0.5, 1, 2], atol=1e-12)


REST = {**ORBIT, "duration": 1}
AT = {"move": "dolly", "duration": 1, "from_position": [0, 0, 0], "to_position": [1, 0, 0]}
REFUSED = [
    (
        [REST, {**REST, "from_deg": 90, "to_deg": 180, "radius": 6}],
        r"moves\.1: begins at \[7, 2, 3\], yet the move before ends at \[6, 2, 3\]",
    ),
    ([AT, {**AT, "from_position": [1, 0, 0], "to_position": [2, 0, 0], "yaw_deg": 20}], r"moves\.1: begins 20 degrees away"),
    (
        [{**AT, "ease": "none"}, {**AT, "from_position": None, "to_position": [3, 0, 0], "ease": "none"}],
        r"moves\.1: .*speed jumps from 1 to 2",
    ),
    ([{**AT, "ease": "none"}, {**AT, "from_position": None, "to_position": [2, 0, 0]}], r"moves\.1: .*speed jumps from 1 to"),
    (
        [{**AT, "ease": "none"}, {**AT, "from_position": None, "to_position": [1, 1, 0], "ease": "none"}],
        r"moves\.1: .*changes its direction",
    ),
    (
        [{"move": "pan", "duration": 1, "position": [0, 0, 0], "to_yaw_deg": 30, "ease": "none"}, HOLD],
        r"moves\.1: .*turning jumps from 30 to 0",
    ),
    ([{**AT, "ease": "none"}, HOLD], r"moves\.1: .*speed jumps from 1 to 0"),
    ([REST, HOLD, {**REST, "from_deg": 90, "to_deg": 180, "ease": "none"}], r"moves\.2: .*speed jumps from 0 to 7\.8"),
    ([{**AT, "from_position": None}], r"moves\.0\.from_position: is missing"),
    ([REST, {"move": "pan", "duration": 1, "cut": True}], r"moves\.1\.position: is missing"),
    (
        [{"move": "fly_through", "duration": 1, "points": [[0, 0, 0], [1, 0, 0], [0, 0, 0]]}],
        r"moves\.0\.points: turn straight back",
    ),
    ([{**AT, "look_at": [0.5, 0, 0]}], r"moves\.0: the camera meets its target"),
]


@pytest.mark.parametrize(("moves", "says"), REFUSED)
def test_what_does_not_join_is_refused_and_named(moves, says):
    with pytest.raises(InputError, match=says):
        track = track_of(*moves)
        sample(track, 0.5)


def test_unknown_objects_of_moves_are_named():
    path = moved({**ORBIT, "center": {"object": "cart"}})
    with pytest.raises(InputError, match=r"moves\.0\.center: there is no scene that has 'cart'"):
        prepare_track(path, Y_UP)
