"""Rays and projections against Mitsuba's own perspective camera and against float64."""

import numpy as np
import pytest

from analytic import at
from framepairs.backend import dr, mi
from framepairs.frame import CameraState
from framepairs.projection import direction, project, project_direction, view_of
from framepairs.transforms import look_at

EPSILON = 2.0**-24
CAMERA = CameraState(
    world_from_camera=look_at(np.array([1.0, 2.0, 5.0]), np.array([-0.5, 0.3, 0.2]), np.array([0.0, 1.0, 0.0])),
    fov_y=np.radians(50),
    aspect=16 / 9,
    near=0.01,
    far=100,
)


def test_jitter_is_mitsubas_principal_point_offset_negated():
    width, height, jitter = 32, 18, (0.3, -0.2)
    x = np.array([3.5, 20.5, 31.5])
    y = np.array([2.5, 9.5, 17.5])
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": 50,
            "fov_axis": "y",
            "principal_point_offset_x": -jitter[0] / width,
            "principal_point_offset_y": -jitter[1] / height,
            # Mitsuba's camera looks along +z with x to the left: turn ours by half a turn about y
            "to_world": mi.ScalarTransform4f((CAMERA.world_from_camera @ np.diag([-1, 1, -1, 1])).tolist()),
            "film": {"type": "hdrfilm", "width": width, "height": height},
        }
    )
    theirs = np.array(sensor.sample_ray(0, 0.5, mi.Point2f(x / width, y / height), mi.Point2f(0.5))[0].d)
    view = view_of(CAMERA, np.zeros(3))
    ours = np.array(
        dr.normalize(direction(view, mi.Float((x - jitter[0]) / width), mi.Float((y - jitter[1]) / height)))
    )
    assert np.abs(ours - theirs).max() < 16 * EPSILON  # two float32 transforms and a normalisation each


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_projection_takes_a_ray_back_to_its_fraction(offset):
    origin = np.array([offset, -offset, offset])
    moved = CameraState(**{**vars(CAMERA), "world_from_camera": at(*origin) @ CAMERA.world_from_camera})
    view = view_of(moved, origin)
    x, y = mi.Float(0.1, 0.5, 0.93), mi.Float(0.2, 0.5, 0.77)
    point = view.origin + 7 * direction(view, x, y)
    back = project(view, point)
    # coordinates of some 10 around the render origin, over a view of some 7 across: a handful of roundings
    assert np.abs(np.array(back.x) - np.array(x)).max() < 16 * EPSILON
    assert np.abs(np.array(back.y) - np.array(y)).max() < 16 * EPSILON
    assert np.abs(np.array(back.z) - 7).max() < 7 * 16 * EPSILON


def test_image_axes_are_x_right_and_y_down():
    view = view_of(CameraState(**{**vars(CAMERA), "world_from_camera": np.eye(4)}), np.zeros(3))
    above_left = project(view, mi.Point3f(-1, 1, -5))
    assert above_left.x[0] < 0.5 and above_left.y[0] < 0.5


def test_directions_project_like_points_infinitely_far_away():
    view = view_of(CAMERA, np.zeros(3))
    ray = direction(view, mi.Float(0.3), mi.Float(0.8))
    back = project_direction(view, ray)
    assert back.x[0] == pytest.approx(0.3, abs=8 * EPSILON) and back.y[0] == pytest.approx(0.8, abs=8 * EPSILON)
