"""Camera paths at their edges: steep views of one keyframe, cuts after holds, numbers of any size, sampled folders."""

import json
import random
from types import SimpleNamespace

import numpy as np
import pytest

from framepairs.camera.track import prepare_track, sample
from framepairs.camera_path import end_of, frame_times, make_camera_path
from framepairs.errors import InputError
from framepairs.sampling import writer
from framepairs.sampling.files import CamerasFile, PathRecord, make_options

UP = np.array([0.0, 1.0, 0.0])
HERE = {"position": [0, 0, 0], "look_at": [0, 0, -5]}
THERE = {"position": [5, 0, 0], "look_at": [0, 0, -5]}
EXTREMES = (0.0, -0.0, 1.0, -1.0, 1e-9, 1e9, -1e12, 1e12, 1e-12, 1e18, 1e154, -1e300, 1e-300, 5e-324, 1.7e308)


def track_of(*keyframes, **keys):
    return prepare_track(make_camera_path({"version": 1, "keyframes": keyframes, **keys}), UP)


@pytest.mark.parametrize("before", [(), ({"time": 0, **HERE},)])
def test_a_shot_of_one_keyframe_may_look_down_steeply(before):
    """78.7 degrees down: between the level camera and the free one, where a heading is asked of a piece of one time."""
    track = track_of(*before, {"time": len(before), "cut": bool(before), "position": [0, 5, 0], "look_at": [1, 0, 0]})
    rotation = sample(track, 1.0).world_from_camera[:3, :3]
    np.testing.assert_allclose(-rotation[:, 2], np.array([1, -5, 0]) / np.sqrt(26), atol=1e-15)
    np.testing.assert_allclose(rotation[1, 0], 0, atol=1e-15)  # level: its own heading is the only one


@pytest.mark.parametrize("aside", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("moved", [0.0, 5.0])
def test_a_camera_almost_at_the_nadir_keeps_its_heading(aside, moved):
    """It looks towards +x all along, so its up is +x to within `aside` / 10. 1e-4: rounding of a heading's equations, whose
    condition LEAST_WEIGHT bounds."""
    keys = [{"time": t, "position": [x, 10, 0], "look_at": [x + aside, 0, 0]} for t, x in ((0, 0.0), (4, moved))]
    track = track_of(*keys)
    for t in (0, 1.3, 4):
        up = sample(track, t).world_from_camera[:3, 1]
        np.testing.assert_allclose(up, [1, 0, 0], atol=aside / 5 + 1e-4)


@pytest.mark.parametrize(("arrives", "hold", "cut"), [(0, 2, 2), (0.7, 0.1, 0.8)])
def test_a_cut_at_the_end_of_a_hold_comes_at_its_time(arrives, hold, cut):
    """0.7 + 0.1 is below 0.8 by rounding."""
    first = [{"time": 0, **HERE}] if arrives else []
    track = track_of(*first, {"time": arrives, "hold": hold, **HERE}, {"time": cut, "cut": True, **THERE})
    assert [sample(track, t).shot for t in (cut - 1e-3, cut)] == [0, 1]
    np.testing.assert_array_equal(sample(track, cut).world_from_camera[:3, 3], THERE["position"])
    assert sample(track, cut).scene_time_s == arrives


def test_a_move_with_a_cut_after_a_hold_begins_at_its_time():
    moves = [
        {"move": "pan", "duration": 1, "position": [0, 0, 0], "to_yaw_deg": 30},
        {"move": "hold", "duration": 1},
        {"move": "pan", "duration": 1, "position": [5, 0, 0], "to_yaw_deg": 30, "cut": True},
    ]
    track = prepare_track(make_camera_path({"version": 1, "moves": moves}), UP)
    assert [sample(track, t).shot for t in (1.999, 2.0)] == [0, 1]


def test_numbers_of_any_size_are_refused_or_give_finite_cameras():
    """Random keyframes of extreme numbers: a finite rigid camera, or one InputError, and no warning of NumPy's."""
    rng, used = random.Random(3), 0

    def number():
        return rng.choice(EXTREMES) if rng.random() < 0.08 else rng.uniform(-10, 10)

    for _ in range(400):
        keyframes, at = [], 0.0
        for _ in range(rng.randint(1, 4)):
            aim = (
                {"look_at": [number() for _ in range(3)]}
                if rng.random() < 0.6
                else {"quaternion": [number() for _ in range(4)]}
            )
            hold = rng.choice([0, 0, 0.5, 1e-9, 1e-20, 1e-300])
            lens = rng.choice([{}, {}, {"fov_y_deg": rng.choice([1e-3, 179.9, 1e-300])}, {"focal_length_mm": abs(number())}])
            keyframes.append({"time": at, "position": [number() for _ in range(3)], "hold": hold, **aim, **lens})
            at += hold + rng.choice([1.0, 1e-9, 1e-12, 1e-300, 0.3, 1e300 if rng.random() < 0.1 else 2.0])
        with np.errstate(all="raise", under="ignore"):
            try:
                path = make_camera_path(
                    {"version": 1, "keyframes": keyframes, "up": [0, number(), 1], "fps": rng.choice([24, 1e-300])}
                )
                track = prepare_track(path, UP)
                times = [*frame_times(path)[:20], *(key.time for key in path.keyframes), end_of(path) / 3]
                matrices = [sample(track, t).world_from_camera for t in times]
            except InputError:
                continue
        used += 1
        for matrix in matrices:
            np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-9)
            assert np.isfinite(matrix).all()
    assert used > 50


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"moves": [{"move": "fly_through", "points": [[0, 0, 0], [9, 0, 0]], "speed": 5e-324}]}, "moves.0.speed"),
        ({"keyframes": [{"time": 0, "position": [1e300, 0, 0], "look_at": [0, 0, 0]}]}, "keyframes.0.position.0"),
        ({"keyframes": [{"time": 0, **HERE, "hold": 1e308}], "fps": 1000}, "keyframes.0.hold"),
        ({"keyframes": [{"time": 0, "position": [0, 0, 0], "quaternion": [1e-200, 0, 0, 0]}]}, "keyframes.0"),
    ],
)
def test_numbers_out_of_range_name_their_field(values, field):
    with pytest.raises(InputError) as caught:
        make_camera_path({"version": 1, **values})
    assert caught.value.field == field


def test_a_move_that_is_too_short_at_its_time_is_refused_by_name():
    moves = [{"move": "pan", "duration": 2, "position": [0, 0, 0]}, {"move": "pan", "duration": 1e-12, "to_yaw_deg": 9}]
    moves.append({"move": "hold", "duration": 1e-12})
    with pytest.raises(InputError) as caught:
        prepare_track(make_camera_path({"version": 1, "moves": moves}), UP)
    assert caught.value.field == "moves.1"


RECORD = {
    "file": "calm_000.json", "style": "calm", "split": "train", "frames": 2, "length_m": 1, "speed_m_s": 1,
    "clearance_m": 1, "turn_deg_s": 1, "motion_px": 1, "cells_seen": 1,
}  # fmt: skip


@pytest.mark.parametrize(
    "name", ["../x_0.json", "/tmp/x_0.json", "a/b_0.json", "cameras.json", "paths.svg", "..", "x_0.json\n"]
)
def test_a_sampling_names_path_files_in_its_own_folder_alone(name):
    PathRecord.model_validate(RECORD)
    with pytest.raises(ValueError, match="pattern"):
        PathRecord.model_validate({**RECORD, "file": name})


def sampling_of(files):
    values = {
        "scene": "s", "scene_sha256": "0" * 64, "options": {}, "clearance_m": 1, "cell_m": [1, 1, 1], "view_distance_m": 1,
        "has_ground": True, "moving_checked": 0, "reachable_cells": 1, "cells": 1, "cells_seen": 1, "coverage": 1,
        "coverage_of": {"train": 1, "val": 0, "test": 0}, "paths": [{**RECORD, "file": name} for name in files],
    }  # fmt: skip

    texts = tuple({"path": name} for name in files)
    return SimpleNamespace(file=CamerasFile.model_validate(values), values=texts)


@pytest.mark.parametrize("damaged", [False, True])
def test_a_replaced_sampling_that_is_interrupted_is_none(tmp_path, monkeypatch, damaged):
    monkeypatch.setattr(writer, "plot_paths", lambda sampling, kind: b"")
    writer.write_sampling(sampling_of(["calm_000.json", "calm_001.json"]), tmp_path)
    if damaged:
        (tmp_path / "cameras.json").write_text("{")

    def interrupted(sampling, kind):
        raise KeyboardInterrupt

    monkeypatch.setattr(writer, "plot_paths", interrupted)
    with pytest.raises(KeyboardInterrupt):
        writer.write_sampling(sampling_of(["calm_000.json"]), tmp_path, force=True)
    assert not (tmp_path / "cameras.json").exists()
    monkeypatch.setattr(writer, "plot_paths", lambda sampling, kind: b"")
    writer.write_sampling(sampling_of(["calm_000.json"]), tmp_path, force=True)
    assert [record["file"] for record in json.loads((tmp_path / "cameras.json").read_text())["paths"]] == ["calm_000.json"]


def test_a_sampling_of_endless_paths_is_refused():
    with pytest.raises(InputError, match="2 frames at 1e-06 fps last 1e[+]06 s"):
        make_options(frames=2, fps=1e-6)
    assert make_options(frames=100_000, fps=24).frames == 100_000
