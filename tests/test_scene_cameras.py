"""Cameras that a scene brings, flown as camera paths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analytic import at, make_scene, plan_of, quad
from framepairs.camera.track import prepare_track, sample
from framepairs.camera_path import frame_times
from framepairs.errors import InputError
from framepairs.frame import path_of_camera
from framepairs.job import Job
from framepairs.options import camera_path_of
from framepairs.scene.description import CameraView, Material, SceneCamera
from framepairs.transforms import look_at

UP = np.array([0.0, 1, 0])


def flying(time_s: float) -> CameraView:
    matrix = look_at(np.array([time_s, 1.0, 5 - time_s]), np.zeros(3), UP)
    return CameraView(world_from_camera=matrix, fov_y=0.5 + 0.1 * time_s, shift=(0.1, -0.05 * time_s), near=0.5, far=50)


def test_a_moving_camera_has_a_pose_for_every_frame():
    path = path_of_camera(SceneCamera(name="c", at=flying, moves=True), end_s=1.5, fps=24)
    assert len(frame_times(path)) == 37 and (path.near, path.far) == (0.5, 50)
    for frame in (0, 1, 17, 36):
        seen, view = sample(prepare_track(path, UP), frame / 24), flying(frame / 24)
        assert np.array_equal(seen.world_from_camera, view.world_from_camera)
        assert seen.fov_y == pytest.approx(view.fov_y, rel=1e-14) and seen.shift == view.shift
        assert seen.scene_time_s == frame / 24


def test_a_still_camera_sees_the_whole_animation_or_a_second_of_stillness():
    still = SceneCamera(name="c", at=lambda time_s: flying(1.0))
    for end_s, frames in ((2.0, 49), (0.0, 32)):
        path = path_of_camera(still, end_s)
        assert len(frame_times(path)) == frames
        views = [sample(prepare_track(path, UP), frame / 24).world_from_camera for frame in range(frames)]
        assert all(np.array_equal(view, views[0]) for view in views)


def test_an_animation_shorter_than_a_frame_is_one_pose():
    assert len(frame_times(path_of_camera(SceneCamera(name="c", at=lambda time_s: flying(0.0)), end_s=0.03))) == 1


def test_a_near_plane_behind_an_orthographic_camera_is_the_default():
    view = CameraView(world_from_camera=np.eye(4), height=1.0, near=-5.0, far=10.0)
    path = path_of_camera(SceneCamera(name="c", at=lambda time_s: view), 0.0)
    assert path.near is None and path.far == 10


def test_sequences_are_named_by_all_of_a_camera_s_name(tmp_path):
    names = ("Camera", "Camera.001", "/A/Cam", "/B/Cam")
    cameras = tuple(SceneCamera(name=name, at=flying, moves=True) for name in names)
    scene = replace(make_scene((quad(1, 1), Material(name="m"), at(0, 0, 0))), cameras=cameras)

    def sequence(name: str) -> str:
        path = path_of_camera(cameras[0], 0.5)
        keys = {"scene_name": "two.usda", "environment": None, "plan": plan_of(), "out": tmp_path}
        return Job(scene=scene, path=path, path_name=name, **keys).sequence

    assert [sequence(name) for name in names] == ["two_Camera", "two_Camera.001", "two_A_Cam", "two_B_Cam"]
    assert sequence("paths/fly.json") == "two_fly"


def test_an_orthographic_camera_keeps_its_height():
    flat = CameraView(world_from_camera=np.eye(4), height=3.5)
    path = path_of_camera(SceneCamera(name="c", at=lambda time_s: flat), 0.0)
    assert path.projection == "orthographic" and sample(prepare_track(path, UP), 0.5).height == 3.5


def test_a_camera_that_changes_its_kind_is_refused():
    def changing(time_s: float) -> CameraView:
        flat = {"height": 2.0} if time_s > 0.5 else {"fov_y": 1.0}
        return CameraView(world_from_camera=np.eye(4), **flat)

    with pytest.raises(InputError, match="lens: changes between a perspective and an orthographic view"):
        path_of_camera(SceneCamera(name="lens", at=changing, moves=True), 1.0)


def test_a_camera_of_the_scene_goes_by_its_name():
    scene = make_scene((quad(1, 1), Material(name="m"), at(0, 0, 0)))
    scene = replace(scene, cameras=(SceneCamera(name="/World/Main", at=flying, moves=True),), animation_end_s=1.0)
    path, name = camera_path_of("thing.usda", "/World/Main", scene)
    assert name == "/World/Main" and len(frame_times(path)) == 25
    assert math.isclose(sample(prepare_track(path, UP), 1.0).fov_y, 0.6)
    with pytest.raises(InputError, match=r"no such camera path: neither a file nor a bundled name \(.*market, .*/World/Main\)"):
        camera_path_of("thing.usda", "/World/Other", scene)
