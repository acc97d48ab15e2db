"""Orthographic cameras, shifted lenses and changing focal lengths: rays, depth, motion, texture footprints."""

import numpy as np
import pytest

from analytic import Stage, at, fractions, make_scene, path_of, quad
from framepairs.camera_path import make_camera_path
from framepairs.consistency import NEEDED, warp_consistency
from framepairs.errors import InputError
from framepairs.manifest import CameraRecord
from framepairs.scene.description import Material, Slot, Texture
from framepairs.scene.needs import channel_needs

GRAY = Material(name="gray")
DISPLAY = (192, 108)
ERROR = 200 * 16 * 4 * 2.0**-24  # 16 roundings of places of some 4 units over a view of one unit on 200 pixels


def path(*stops: dict, **keys):
    poses = [{"time": k, "world_from_camera": np.eye(4).tolist()} | stop for k, stop in enumerate(stops)]
    return make_camera_path({"version": 1, "fps": 1, "near": 0.01, "far": 1000, **keys, "poses": poses})


def seen(x, y, depth, *, fov_y_deg=60.0, height=None, shift=(0.0, 0.0), aspect=16 / 9):
    """Camera-space point [..., 3] that the fractions (x, y) show at view_z `depth`, in float64."""
    half = np.tan(np.radians(fov_y_deg) / 2) * depth if height is None else height / 2 + 0 * depth
    right = (2 * (x - shift[0]) - 1) * half * aspect
    return np.stack([right, -(2 * (y - shift[1]) - 1) * half, -depth + 0 * right], axis=-1)


def placed(point, *, fov_y_deg=60.0, height=None, shift=(0.0, 0.0), aspect=16 / 9):
    """Fractions [..., 2] at which a camera-space point appears."""
    half = -point[..., 2] * np.tan(np.radians(fov_y_deg) / 2) if height is None else height / 2
    x = 0.5 + shift[0] + point[..., 0] / (2 * half * aspect)
    return np.stack([x, 0.5 + shift[1] - point[..., 1] / (2 * half)], axis=-1)


LENSES = [
    ({"height": 3.0}, {"height": 2.0}, {"projection": "orthographic"}),
    ({"lens_shift": [0.1, -0.2]}, {"lens_shift": [-0.15, 0.05]}, {"fov_y_deg": 60}),
    ({"fov_y_deg": 40}, {"fov_y_deg": 55}, {}),
    ({"height": 3.0, "lens_shift": [0.2, 0.1]}, {"height": 3.0}, {"projection": "orthographic"}),
]


def lens(stop: dict, keys: dict) -> dict:
    shift = tuple(stop.get("lens_shift", (0.0, 0.0)))
    return {"fov_y_deg": stop.get("fov_y_deg", keys.get("fov_y_deg", 45)), "height": stop.get("height"), "shift": shift}


@pytest.mark.parametrize("before, now, keys", LENSES)
def test_depth_and_motion_of_a_slanted_wall(before, now, keys):
    """The wall z = -3 + 0.5 x, by float64; the lens changes and the camera steps aside."""
    wall = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0.5, 0, 1, -3], [0, 0, 0, 1.0]])
    step = {"world_from_camera": at(0.1, 0.05, 0.2).tolist()}
    stage = Stage(make_scene((quad(40, 40), GRAY, wall)), path(before | step, now, **keys), display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    x, y = fractions(*DISPLAY)
    # along a pixel's ray the point is linear in its depth: two depths give the line, and the wall cuts it
    near, far = (seen(x, y, np.full_like(x, d), **lens(now, keys)) for d in (1.0, 2.0))
    slope = far - near
    t = (-3 + 0.5 * near[..., 0] - near[..., 2]) / (slope[..., 2] - 0.5 * slope[..., 0])
    point = near + t[..., None] * slope
    assert np.abs(arrays["depth"][..., 0] + point[..., 2]).max() < 1e-5
    then = placed(point - [0.1, 0.05, 0.2], **lens(before, keys))
    assert np.abs(arrays["motion"] - (then - np.stack([x, y], -1)) * DISPLAY).max() < ERROR


@pytest.mark.parametrize("before, now, keys", LENSES)
def test_stored_matrices_project_what_the_pixels_show(before, now, keys):
    stage = Stage(make_scene((quad(40, 40), GRAY, at(0, 0, -3))), path(before, now, **keys), display=DISPLAY)
    depth = stage.arrays(1, "hr")["depth"][..., 0].astype(float)
    x, y = fractions(*DISPLAY)
    point = seen(x, y, depth, **lens(now, keys))
    clip = np.concatenate([point, np.ones_like(depth)[..., None]], -1) @ stage.shoot.camera(1).clip_from_view.T
    device = clip[..., :2] / clip[..., 3:]
    assert np.abs(0.5 + 0.5 * device * [1, -1] - np.stack([x, y], -1)).max() < 1e-12


def test_the_sky_of_an_orthographic_camera_stands_still_and_a_shifted_lens_moves_it():
    turned = {"world_from_camera": np.array([[0.8, 0, 0.6, 0], [0, 1, 0, 0], [-0.6, 0, 0.8, 0], [0, 0, 0, 1]]).tolist()}
    still = Stage(make_scene(), path({}, turned, projection="orthographic", height=2), display=DISPLAY).arrays(1, "hr")
    assert not still["motion"].any() and (still["visibility"] == 7).all()
    moved = Stage(make_scene(), path({"lens_shift": [0.25, -0.125]}, {}), display=DISPLAY).arrays(1, "hr")["motion"]
    np.testing.assert_allclose(moved, np.broadcast_to([48.0, -13.5], moved.shape), atol=ERROR)


def test_an_orthographic_footprint_is_a_pixel_of_the_texture_at_any_depth():
    """A 256-texel wall that fills a view of 64 pixels: 4 texels a pixel, level 2, near and far alike."""
    stripes = np.full((256, 256, 4), 255, np.uint8)
    stripes[:, np.arange(256) % 4 > 0, :3] = 0
    material = Material(name="stripes", base_color=(1, 1, 1), base_texture=Slot(texture=0))
    texture = Texture(name="stripes", texels=stripes, srgb=False)
    for depth in (1.0, 50.0):
        scene = make_scene((quad(2, 2), material, at(0, 0, -depth)), textures=(texture,))
        stage = Stage(scene, path({}, projection="orthographic", height=2), display=(64, 64))
        albedo = stage.arrays(0, "hr")["albedo"]
        assert np.abs(albedo - 0.25).max() < 1e-3  # level 0 would be black between the white texels


def test_a_lens_that_changes_needs_motion():
    scene = make_scene((quad(4, 4), GRAY, at(0, 0, -3)))
    for stops in (({"lens_shift": [0.1, 0]}, {}), ({"fov_y_deg": 30}, {"fov_y_deg": 31})):
        stage = Stage(scene, path(*stops), display=DISPLAY)
        assert channel_needs(scene, stage.shoot.samples, stage.plan)["motion"].needed


@pytest.mark.parametrize(
    "keys, says",
    [
        ({"projection": "orthographic"}, "needs a height"),
        ({"height": 2}, "height is of orthographic"),
        ({"projection": "orthographic", "height": 0}, "height"),
        ({"lens_shift": [float("nan"), 0]}, "lens_shift"),
        ({"projection": "fisheye"}, "projection"),
    ],
)
def test_lenses_that_cannot_be_are_refused(keys, says):
    with pytest.raises(InputError, match=says):
        path({}, **keys)


def test_lenses_are_interpolated():
    stage = Stage(make_scene(), path({"height": 2}, {"height": 4, "time": 2}, projection="orthographic"), display=DISPLAY)
    assert [stage.shoot.camera(k).height for k in range(3)] == [2, 3, 4]
    plain = path_of(np.eye(4))
    assert Stage(make_scene(), plain, display=DISPLAY).shoot.camera(0).height is None


@pytest.mark.parametrize("before, now, keys", LENSES)
def test_depth_and_matrices_witness_the_motion_of_every_lens(before, now, keys):
    """What `validate` measures: wall and sky, under a lens that changes, land where the stored matrices say."""
    wall = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0.5, 0, 1, -3], [0, 0, 0, 1.0]])
    stage = Stage(make_scene((quad(1.5, 40), GRAY, wall)), path(before, now, **keys), display=DISPLAY)
    first, second = (stage.arrays(frame, "hr", frozenset(NEEDED)) for frame in (0, 1))
    state = stage.shoot.state(1)
    record = CameraRecord(
        fov_y_rad=state.camera.fov_y, near=0.01, far=1000.0,
        view_from_world=state.camera.view_from_world.tolist(), clip_from_view=state.camera.clip_from_view.tolist(),
        previous_view_from_world=state.previous_camera.view_from_world.tolist(),
        previous_clip_from_view=state.previous_camera.clip_from_view.tolist(),
    )  # fmt: skip
    result = warp_consistency(second, first, record, (0.0, 0.0), (0.0, 0.0), [])
    assert result.pixels > 2000 and result.same_object == 1 and result.same_place == 1 and result.residual_p99 < 0.01
