"""Camera paths: reading, refusals, frames in time, holds, cuts, poses and lenses. Curves are in test_camera_track."""

import json
import math
import time

import numpy as np
import pytest

from framepairs.camera.track import prepare_track
from framepairs.camera.track import sample as sample_track
from framepairs.camera_path import (
    CameraPath,
    frame_durations,
    frame_times,
    make_camera_path,
    read_camera_path,
    with_fps,
)
from framepairs.errors import InputError
from framepairs.transforms import rigid, rotation_from_quaternion

Y_UP = np.array([0.0, 1.0, 0.0])
AHEAD = {"look_at": [0, 0, -100]}
ROUNDING = 32 * np.finfo(np.float64).eps  # of matrix entries of size 1


def keyed(*keyframes, **keys):
    return make_camera_path({"version": 1, "keyframes": [{**AHEAD, **keyframe} for keyframe in keyframes], **keys})


def posed(*poses, **keys):
    return make_camera_path({"version": 1, "poses": poses, **keys})


def turned_about_y(degrees, position=(0, 0, 0)):
    half = math.radians(degrees) / 2
    return rigid(rotation_from_quaternion(np.array([math.cos(half), 0, math.sin(half), 0])), np.array(position))


def sample(path, time, up=Y_UP):
    return sample_track(prepare_track(path, up), time)


def samples(path):
    track = prepare_track(path, Y_UP)
    return [sample_track(track, time) for time in frame_times(path)]


def positions(path, times):
    track = prepare_track(path, Y_UP)
    return np.array([sample_track(track, t).world_from_camera[:3, 3] for t in times])


WALK = (
    {"time": 0, "position": [0, 1, 5]},
    {"time": 0.5, "position": [2, 1.5, 4], "fov_y_deg": 60},
    {"time": 1.25, "position": [3, 1, 2]},
    {"time": 2, "position": [3, 0.5, -1]},
)


@pytest.mark.parametrize(
    ("fps", "end", "hold", "frames"),
    [(24, 1, 0, 25), (24, 0, 0, 1), (24, 0.999, 0, 24), (10, 0.7, 0, 8), (10, 0.7, 0.1, 9), (30, 2 / 3, 0, 21), (0.5, 7, 0, 4)],
)
def test_frames_include_the_end(fps, end, hold, frames):
    first = [{"time": 0, "position": [0, 0, 0]}] if end else []
    path = keyed(*first, {"time": end, "position": [1, 0, 0], "hold": hold}, fps=fps)
    assert frame_times(path) == tuple(i / fps for i in range(frames))
    assert frame_durations(path) == (1 / fps,) * frames


def test_keyframes_are_met_at_their_times_and_not_left_at_the_ends():
    path = keyed(*WALK)
    at_keyframes = positions(path, [keyframe["time"] for keyframe in WALK])
    np.testing.assert_array_equal(at_keyframes, [keyframe["position"] for keyframe in WALK])
    np.testing.assert_array_equal(positions(path, [-1, 3]), [WALK[0]["position"], WALK[-1]["position"]])


def test_rates_of_24_and_60_agree_at_common_times():
    slow, fast = (samples(keyed(*WALK, fps=fps)) for fps in (24, 60))
    for a, b in zip(slow[::2], fast[::5], strict=True):  # every twelfth of a second
        np.testing.assert_allclose(a.world_from_camera, b.world_from_camera, atol=1e-9)
        assert a.fov_y == pytest.approx(b.fov_y, abs=1e-9)
        assert a.scene_time_s == pytest.approx(b.scene_time_s, abs=1e-9)


HOLDS = [
    (24, 2 / 3, 0.625),  # as in the bundled path market
    (10, 0.7, 0.1),  # 0.7 + 0.1 < 0.8 in float64
    (10, 0.1, 0.2),  # 0.1 + 0.2 > 0.3
    (24, 0.3333333334, 1 / 3),  # a decimal that lies a little after its frame
    (30, 1.1, 0.7),
]


@pytest.mark.parametrize(("fps", "start", "hold"), HOLDS)
@pytest.mark.parametrize("goes_on", [False, True])
def test_a_hold_gives_bit_identical_frames(fps, start, hold, goes_on):
    stops = [{"time": 0, "position": [0, 0, 5]}, {"time": start, "position": [1, 0, 4], "hold": hold}]
    stops += [{"time": start + hold + 1, "position": [7, 1, 0]}] if goes_on else []
    everything = samples(keyed(*stops, fps=fps))
    held = everything[round(start * fps) : round((start + hold) * fps) + 1]
    assert len(held) > 1
    assert len({item.world_from_camera.tobytes() for item in held}) == 1
    assert len({item.scene_time_s for item in held}) == 1
    assert len(everything) == round((start + hold + goes_on) * fps) + 1


def test_animation_resumes_where_a_hold_stopped_it():
    path = keyed(
        {"time": 0, "position": [0, 0, 5], "hold": 0.25},
        {"time": 1, "position": [1, 0, 5], "hold": 0.5},
        {"time": 3, "position": [2, 0, 5]},
    )
    times = [0, 0.2, 0.25, 0.5, 1, 1.3, 1.5, 1.5 + 1e-9, 2, 3]
    expected = [0, 0, 0, 0.25, 0.75, 0.75, 0.75, 0.75, 1.25, 2.25]
    # 1e-9 s is the tolerance with which a stop counts as reached.
    assert [sample(path, t, Y_UP).scene_time_s for t in times] == pytest.approx(expected, abs=2e-9)


def test_animation_runs_through_a_hold_that_says_so():
    path = keyed({"time": 0, "position": [0, 0, 5], "hold": 1, "animation": "runs"}, {"time": 2, "position": [1, 0, 5]})
    assert [sample(path, t, Y_UP).scene_time_s for t in (0, 0.3, 1, 1.7)] == [0, 0.3, 1, 1.7]
    assert len({sample(path, t, Y_UP).world_from_camera.tobytes() for t in (0, 0.3, 1)}) == 1


def test_a_hold_is_reached_and_left_at_rest():
    walk = [{"time": t, "position": [x, 0, 5], "hold": h} for t, x, h in ((0, 0, 0), (1, 1, 1), (3, 2, 0))]
    # At rest the way is quadratic: no more than some 3 t^2 for a step of 1 in 1 s.
    np.testing.assert_allclose(positions(keyed(*walk), [1 - 1e-3, 2 + 1e-3])[:, 0], [1, 1], atol=4e-6)


def test_nothing_is_interpolated_across_a_cut():
    before = ({"time": 0, "position": [0, 0, 5]}, {"time": 1, "position": [1, 2, 5]})
    after = ({"time": 2, "position": [50, 0, 0], "cut": True, "fov_y_deg": 90}, {"time": 3, "position": [51, 3, 0]})
    path = keyed(*before, *after)
    alone = keyed(*before)
    for t in (0, 0.3, 0.9, 1, 1.7, 1.999):
        a, b = sample(path, t, Y_UP), sample(alone, t, Y_UP)
        np.testing.assert_array_equal(a.world_from_camera, b.world_from_camera)
        assert (a.fov_y, a.shot) == (b.fov_y, 0)
    later = keyed(*({**stop, "time": stop["time"] - 2} for stop in after))
    for t in (2, 2.25, 3):
        a, b = sample(path, t, Y_UP), sample(later, t - 2, Y_UP)
        np.testing.assert_array_equal(a.world_from_camera, b.world_from_camera)
        assert (a.fov_y, a.shot) == (b.fov_y, 1)
        assert a.scene_time_s == t  # the scene's time knows no cuts


def test_poses_come_back_bit_for_bit_at_their_frames():
    matrices = [turned_about_y(17 * i, (i, -0.1 * i, 1e6 + i / 3)) for i in range(7)]
    path = posed(*({"time": i / 24, "world_from_camera": m.tolist()} for i, m in enumerate(matrices)))
    assert len(frame_times(path)) == 7
    for frame, matrix in enumerate(matrices):
        np.testing.assert_array_equal(sample(path, frame / 24, Y_UP).world_from_camera, matrix)


def test_between_poses_the_rotation_is_slerped_and_the_position_linear():
    ends = turned_about_y(20, (0, 0, 0)), turned_about_y(100, (4, 2, -8))
    path = posed(*({"time": i, "world_from_camera": m.tolist()} for i, m in enumerate(ends)), fps=4)
    expected = turned_about_y(40, (1, 0.5, -2))
    np.testing.assert_allclose(sample(path, 0.25, Y_UP).world_from_camera, expected, atol=ROUNDING)


def test_a_cut_between_poses_holds_the_pose_before_it():
    ends = turned_about_y(20), turned_about_y(100)
    path = posed(*({"time": i, "world_from_camera": m.tolist(), "cut": i == 1} for i, m in enumerate(ends)), fps=4)
    assert [sample(path, t, Y_UP).shot for t in (0, 0.75, 1)] == [0, 0, 1]
    np.testing.assert_array_equal(sample(path, 0.75, Y_UP).world_from_camera, ends[0])


def test_quaternions_are_slerped_and_mix_with_targets():
    quarter = [math.cos(math.pi / 4), 0, math.sin(math.pi / 4), 0]  # about +y: looks along -x
    ends = {"look_at": [0, 0, -3]}, {"quaternion": [5 * part for part in quarter]}
    keyframes = [{"time": time, "position": [0, 0, 0], **end} for time, end in enumerate(ends)]
    path = make_camera_path({"version": 1, "keyframes": keyframes})
    np.testing.assert_allclose(sample(path, 0.5, Y_UP).world_from_camera, turned_about_y(45), atol=ROUNDING)


def test_the_field_of_view_runs_on_a_line():
    path = keyed({"time": 0, "position": [0, 0, 0]}, {"time": 1, "position": [1, 0, 0], "fov_y_deg": 75}, fov_y_deg=35)
    degrees = [math.degrees(sample(path, t, Y_UP).fov_y) for t in (0, 0.25, 1, 2)]
    assert degrees == pytest.approx([35, 45, 75, 75], abs=75 * ROUNDING)


def test_up_comes_from_the_path_before_the_scene():
    matrix = sample(keyed({"time": 0, "position": [0, 0, 0]}, up=[1, 0, 0]), 0, Y_UP).world_from_camera
    np.testing.assert_array_equal(matrix[:3, 1], [1, 0, 0])


@pytest.mark.parametrize("height", [5, -5])
def test_looking_straight_up_or_down_gives_no_nan(height):
    path = keyed({"time": 0, "position": [1, 0, 2], "look_at": [1, height, 2]}, {"time": 1, "position": [1, 0, 0]})
    for item in samples(path):
        assert np.isfinite(item.world_from_camera).all()


def test_a_camera_that_meets_its_target_on_the_way_is_bad_input():
    walk = [{"time": time, "position": [0, 0, -4 * time], "look_at": [0, 0, -2]} for time in (0, 1)]
    with pytest.raises(InputError, match="target"):
        sample(keyed(*walk), 0.5, Y_UP)


def test_a_hundred_thousand_keyframes_load_and_sample():
    began = time.process_time()
    path = keyed(*({"time": i / 24, "position": [i, 0, 0]} for i in range(100_000)))
    track = prepare_track(path, Y_UP)
    found = [sample_track(track, (50_000.5 + i) / 24).world_from_camera[:3, 3] for i in range(1000)]
    # A guard against quadratic work (minutes), not a benchmark: 3 s of CPU on the machine that this was written on.
    assert time.process_time() - began < 20
    np.testing.assert_allclose(found, [[50_000.5 + i, 0, 0] for i in range(1000)], atol=1e-6)


def test_frame_rates_hold_from_their_keyframe_on():
    stops = [{"time": t, "position": [t, 0, 0], **fps} for t, fps in ((0, {}), (1, {"fps": 4}), (1.6, {}), (2.6, {"fps": 1}))]
    path = keyed(*stops, {"time": 4.6, "position": [5, 0, 0]}, fps=2)
    assert frame_times(path) == (0, 0.5, 1, 1.25, 1.5, 1.75, 2, 2.25, 2.5, 2.6, 3.6, 4.6)
    durations = [0.5, 0.5, 0.5, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.1, 1, 1]
    assert frame_durations(path) == pytest.approx(durations, abs=1e-15)
    everywhere = with_fps(path, 10)
    assert frame_times(everywhere) == tuple(i / 10 for i in range(47))
    assert np.array_equal(positions(path, [0.7, 2.55]), positions(everywhere, [0.7, 2.55]))


def test_poses_and_moves_have_frame_rates_too():
    still = {"world_from_camera": np.eye(4).tolist()}
    assert frame_times(posed({"time": 0, **still, "fps": 2}, {"time": 1, **still, "fps": 1})) == (0, 0.5, 1)
    pan = {"move": "pan", "duration": 1, "position": [0, 0, 0]}
    path = make_camera_path({"version": 1, "fps": 2, "moves": [pan, {"move": "hold", "duration": 1, "fps": 4}]})
    assert frame_times(path) == (0, 0.5, 1, 1.25, 1.5, 1.75, 2)


def test_two_keyframes_close_together_may_both_begin_a_frame_rate():
    near = [{"time": t, "position": [t, 0, 0], "fps": fps} for t, fps in ((0, 10), (0.5, 20), (0.5 + 1e-9, 10))]
    times = frame_times(keyed(*near, {"time": 1, "position": [1, 0, 0]}))
    assert np.all(np.diff(times) > 0) and times[5:7] == (0.5, 0.5 + 1e-9)


def test_a_focal_length_is_a_field_of_view():
    path = keyed({"time": 0, "position": [0, 0, 0]}, {"time": 1, "position": [1, 0, 0], "fov_y_deg": 60}, focal_length_mm=12)
    assert [math.degrees(sample(path, t).fov_y) for t in (0, 1)] == pytest.approx([90, 60], rel=1e-14)
    wide = keyed({"time": 0, "position": [0, 0, 0], "focal_length_mm": 18}, sensor_height_mm=36)
    assert math.degrees(sample(wide, 0).fov_y) == pytest.approx(90, rel=1e-14)


def test_exposure_lens_shift_and_height_run_smoothly_between_keyframes():
    keys = {"projection": "orthographic", "height": 2}
    stops = [
        {"time": 0, "position": [0, 0, 0], "exposure_ev": -1},
        {"time": 1, "position": [1, 0, 0], "exposure_ev": 3, "lens_shift": [0.1, -0.2], "height": 4},
        {"time": 2, "position": [2, 0, 0], "hold": 1},
    ]
    track = prepare_track(keyed(*stops, **keys), Y_UP)
    found = [sample_track(track, t) for t in np.linspace(0, 3, 3001)]
    ev, height = np.array([[item.exposure_ev, item.height] for item in found]).T
    assert ev[[0, 1000, 2000, 3000]].tolist() == [-1, 3, 0, 0] and height[[0, 1000, 2000]].tolist() == [2, 4, 2]
    assert found[1000].shift == (0.1, -0.2) and ev.max() == 3 and height.min() == 2
    assert np.abs(np.diff(ev, 2)).max() < 40 * 1e-6  # a second derivative of at most 6 * 4 + 2 * 4: slopes do not jump


def test_roll_turns_clockwise_seen_from_behind():
    path = keyed({"time": 0, "position": [0, 0, 0], "roll_deg": 30})
    right = sample(path, 0).world_from_camera[:3, 0]
    np.testing.assert_allclose(right, [math.cos(math.radians(30)), -0.5, 0], atol=ROUNDING)  # its right side goes down


@pytest.mark.parametrize("kind", ["keyframes", "poses", "moves"])
def test_paths_round_trip_through_their_json(kind):
    look = {"object": "cart", "offset": [0, 1, 0]}
    stops = {
        "keyframes": [{"time": 0, "position": [0, 0, 0], "look_at": look, "roll_deg": 3, "fps": 30}, LATER],
        "poses": [POSE],
        "moves": [
            {"move": "orbit", "duration": 1, "center": look, "radius": 2, "to_deg": 90, "roll_deg": 4},
            {"move": "hold", "duration": 0.5, "animation": "runs"},
            {"move": "fly_through", "speed": 2, "points": [[0, 0, 0], [1, 1, 1]], "look": "ahead", "cut": True},
        ],
    }
    path = make_camera_path({"version": 1, "focal_length_mm": 35, "shake": {"position": 0.1}, kind: stops[kind]})
    again = CameraPath.model_validate(path.model_dump(mode="json"))
    assert again == path and CameraPath.model_validate_json(path.model_dump_json()) == path


def test_a_path_that_an_older_corpus_stores_is_read():
    old = {"fov_y_deg": 45.0, "height": None, "lens_shift": [0, 0], "near": None, "far": None, "exposure_ev": 0, "up": None}
    key = {**KEY, "quaternion": None, "fov_y_deg": None, "height": None, "lens_shift": None, "hold": 0, "cut": False}
    stored = {
        "version": 1,
        "fps": 24.0,
        "projection": "perspective",
        **old,
        "keyframes": [{**key, "animation": "stops"}],
        "poses": [],
    }
    assert CameraPath.model_validate(stored) == make_camera_path({"version": 1, "keyframes": [KEY]})


KEY = {"time": 0, "position": [0, 0, 0], "look_at": [0, 0, -1]}
LATER = {**KEY, "time": 1}
PAN = {"move": "pan", "duration": 1, "position": [0, 0, 0], "to_yaw_deg": 30}
POSE = {"time": 0, "world_from_camera": np.eye(4).tolist()}
SHEARED = {**POSE, "world_from_camera": [[1, 0.1, 0, 0], *POSE["world_from_camera"][1:]]}
MIRRORED = {**POSE, "world_from_camera": [[-1, 0, 0, 0], *POSE["world_from_camera"][1:]]}
PROJECTIVE = {**POSE, "world_from_camera": [*POSE["world_from_camera"][:3], [0, 0, -1, 0]]}


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"keyframes": [KEY, KEY]}, r"keyframes\.1: two keyframes at time 0"),
        ({"poses": [{**POSE, "world_from_camera": [[math.nan, 0, 0, 0], *np.eye(4)[1:].tolist()]}]}, r"poses\.0.*finite"),
        ({"keyframes": [{**KEY, "position": [0, math.inf, 0]}]}, r"keyframes\.0\.position\.1: .*finite"),
        ({"keyframes": [KEY], "speed": 2}, "speed: Extra inputs"),
        ({"keyframes": [KEY], "moves": [PAN]}, "either keyframes or poses"),
        ({"keyframes": [{**KEY, "look_at": [0, "a", 1]}]}, r"keyframes\.0\.look_at\.1: "),
        ({"keyframes": [{**KEY, "look_at": {"object": 3}}]}, r"keyframes\.0\.look_at\.object: "),
        ({"keyframes": [{**KEY, "look_at": {"object": "a", "place": 1}}]}, r"keyframes\.0\.look_at\.place: Extra"),
        ({"keyframes": [{**KEY, "hold": -1}]}, r"keyframes\.0\.hold: "),
        ({"keyframes": [{**KEY, "hold": 1, "speed": 2}]}, r"keyframes\.0: speed is not 0"),
        ({"keyframes": [{"time": 0, "look_at": [0, 0, 1]}]}, r"keyframes\.0\.position: is missing"),
        ({"keyframes": [{"time": 0, "position": [0, 0, 0]}]}, r"keyframes\.0: give exactly one"),
        ({"keyframes": [{**KEY, "fov_y_deg": 40, "focal_length_mm": 50}]}, r"keyframes\.0: give one of fov_y_deg"),
        ({"keyframes": [KEY], "fov_y_deg": 40, "focal_length_mm": 50}, "give one of fov_y_deg"),
        ({"keyframes": [KEY], "fps": 0}, "fps: "),
        ({"keyframes": [KEY, {**LATER, "time": 1e6}]}, "keyframes: more than 1000000 frames"),
        ({"keyframes": [KEY], "follow": {"object": "a"}}, r"keyframes\.0: position and speed come from follow"),
        ({"poses": [POSE], "follow": {"object": "a"}}, "follow: is of paths with keyframes"),
        ({"keyframes": [KEY], "shake": {"low_hz": 9, "high_hz": 2}}, "shake: low_hz is greater"),
        ({"keyframes": [KEY], "height": 3}, "height is of orthographic paths"),
        ({"moves": [{**PAN, "move": "zoom"}]}, r"moves\.0: Input tag 'zoom'"),
        ({"moves": [{**PAN, "duration": 0}]}, r"moves\.0\.duration: "),
        ({"moves": [{"move": "hold", "duration": 1}]}, r"moves\.0: a hold keeps the last view"),
        ({"moves": [PAN, {"move": "hold", "duration": 1, "roll_deg": 3}]}, r"moves\.1: a hold .* has no roll_deg"),
        ({"moves": [{"move": "fly_through", "points": [[0, 0, 0], [1, 0, 0]]}]}, r"moves\.0: give exactly one of duration"),
        (
            {"moves": [{"move": "dolly", "duration": 1, "to_position": [0, 0, 0], "look_at": [1, 1, 1], "yaw_deg": 3}]},
            r"moves\.0: ",
        ),
        ({"keyframes": [{**KEY, "holds": 2}]}, r"keyframes\.0\.holds: Extra inputs"),
        ({"poses": [SHEARED]}, r"poses\.0: .*not a rotation"),
        ({"poses": [MIRRORED]}, r"poses\.0: .*not a rotation"),
        ({"poses": [PROJECTIVE]}, r"poses\.0: .*last row"),
        ({"keyframes": [KEY], "poses": [POSE]}, "either keyframes or poses"),
        ({"keyframes": [LATER]}, r"keyframes\.0: the first time must be 0, not 1"),
        ({"keyframes": [{"time": 0, "position": [0, 0, 0], "quaternion": [0, 0, 0, 0]}]}, r"keyframes\.0: quaternion"),
        ({"keyframes": [{**KEY, "quaternion": [1, 0, 0, 0]}]}, r"keyframes\.0: .*exactly one"),
        ({"keyframes": [{**KEY, "hold": 1.5}, LATER]}, r"keyframes\.1: time 1 lies before"),
        ({"keyframes": [KEY], "near": 5, "far": 5}, "far must be greater than near"),
        ({"keyframes": [KEY], "up": [0, 0, 0]}, "up has length zero"),
        ({"keyframes": [KEY], "fov_y_deg": 180}, "fov_y_deg: "),
    ],
)
def test_errors_name_the_file_and_the_field(tmp_path, keys, says):
    file = tmp_path / "walk.json"
    file.write_text(json.dumps({"version": 1, **keys}))  # json writes NaN and Infinity as it reads them
    with pytest.raises(InputError, match=f"^{file}[:,] .*{says}"):
        read_camera_path(file)


@pytest.mark.parametrize("data", [b'{"version": 1,', b"", b"\xff\xfe\x00", b"[" * 100_000, None])
def test_what_is_no_json_is_bad_input(tmp_path, data):
    file = tmp_path / "walk.json"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: "):
        read_camera_path(file)
