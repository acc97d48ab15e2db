"""Cameras of USD stages, held against GfCamera's own frustum."""

import math

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.transforms import clip_from_view, orthographic_clip_from_view
from usd_stages import load, placed, prim, usd

SINGLE = 2.0**-23  # USD's numbers are float32
ROUNDING = 32 * np.finfo(np.float64).eps
LENS = "float focalLength = 35", "float horizontalAperture = 36", "float verticalAperture = 20"
SHIFTED = "float horizontalApertureOffset = 5", "float verticalApertureOffset = -3"
CLIPPED = "float2 clippingRange = (0.5, 250)"
ORTHOGRAPHIC = 'token projection = "orthographic"'


def camera_of(folder, *lines, **keys):
    """(the only camera of a scene, the scene)."""
    scene = load(folder, prim("Camera", "c", *lines), **keys)
    assert len(scene.cameras) == 1
    return scene.cameras[0], scene


@pytest.mark.parametrize("more", [(), SHIFTED, (ORTHOGRAPHIC,), (ORTHOGRAPHIC, *SHIFTED)])
def test_projections_are_those_of_gf(tmp_path, more):
    file = usd(tmp_path, prim("Camera", "c", *LENS, CLIPPED, *more))
    view = load_scene(file).cameras[0].at(0)
    stage = Usd.Stage.Open(str(file))
    gf = UsdGeom.Camera(stage.GetPrimAtPath("/c")).GetCamera(Usd.TimeCode(0))
    expected = np.array(gf.frustum.ComputeProjectionMatrix()).T
    project, size = (clip_from_view, view.fov_y) if view.height is None else (orthographic_clip_from_view, view.height)
    found = project(size, 36 / 20, view.near, view.far, view.shift)
    np.testing.assert_allclose(found, expected, rtol=4 * SINGLE, atol=4 * SINGLE)  # Gf's aperture unit is a float32 0.1


def test_a_lens_by_hand(tmp_path):
    camera, scene = camera_of(tmp_path, *LENS, *SHIFTED)
    view = camera.at(0)
    assert view.fov_y == pytest.approx(2 * math.atan(10 / 35), rel=SINGLE)
    assert view.shift == pytest.approx((-5 / 36, -3 / 20), rel=SINGLE)  # the image goes against the aperture
    assert (view.height, view.near, view.far) == (None, None, None)  # a clippingRange that nobody authored cuts nothing
    assert (camera.name, camera.moves, scene.not_read) == ("/c", False, ())


def test_an_orthographic_camera_has_a_height_in_scene_units(tmp_path):
    view = camera_of(tmp_path, *LENS, CLIPPED, ORTHOGRAPHIC)[0].at(0)
    assert (view.fov_y, view.height, view.near, view.far) == (None, 2, 0.5, 250)  # a tenth of 20


def test_a_camera_stands_and_looks_as_its_transform_says(tmp_path):
    turned = placed("double xformOp:rotateY", 90)
    camera = prim("Camera", "c", *placed("double3 xformOp:translate", "(1, 2, 3)"))
    view = load(tmp_path, prim("Xform", "x", *turned, camera)).cameras[0].at(0)
    # 90 degrees about y take x to -z and z to x
    expected = [[0, 0, 1, 3], [0, 1, 0, 2], [-1, 0, 0, -1], [0, 0, 0, 1]]
    np.testing.assert_allclose(view.world_from_camera, expected, atol=ROUNDING)


SHEARED = "((2, 1, 0, 0), (1, 3, 1, 0), (0, 0, 4, 0), (5, 6, 7, 1))"  # rows: images of x, y, z and the origin


def test_scale_and_shear_do_not_reach_a_camera(tmp_path):
    view = camera_of(tmp_path, *placed("matrix4d xformOp:transform", SHEARED))[0].at(0)
    matrix = view.world_from_camera
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=ROUNDING)
    np.testing.assert_allclose(matrix[:3, 2], (0, 0, 1), atol=ROUNDING)  # it looks along the image of -z
    np.testing.assert_allclose(matrix[:3, 1], np.array([1, 3, 0]) / math.sqrt(10), atol=ROUNDING)  # y without its part along z
    assert np.linalg.det(matrix) == pytest.approx(1, rel=ROUNDING)
    assert matrix[:3, 3].tolist() == [5, 6, 7]


def test_a_mirrored_camera_is_drawn_unmirrored_and_named(tmp_path):
    camera, scene = camera_of(tmp_path, *placed("double3 xformOp:scale", "(-1, 1, 1)"))
    np.testing.assert_array_equal(camera.at(0).world_from_camera, np.eye(4))
    assert scene.not_read == ("mirroring of camera /c",)


ZOOM = "float focalLength.timeSamples = { 0: 20, 24: 40 }"
SLIDE = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (8, 0, 0) }"
TRANSLATED = 'uniform token[] xformOpOrder = ["xformOp:translate"]'


def test_lens_and_place_follow_the_time_in_seconds(tmp_path):
    camera, _ = camera_of(tmp_path, ZOOM, SLIDE, TRANSLATED, header="timeCodesPerSecond = 48")
    half = camera.at(0.25)  # time code 12 of 24
    assert half.fov_y == pytest.approx(2 * math.atan(15.2908 / 60), rel=1e-6)  # the default aperture, 6 digits
    assert half.world_from_camera[0, 3] == 4 and camera.moves


@pytest.mark.parametrize(
    "lines", [(ZOOM,), (SLIDE, TRANSLATED), ("float horizontalApertureOffset.timeSamples = { 0: 0, 9: 1 }",)]
)
def test_what_changes_the_view_makes_a_camera_move(tmp_path, lines):
    assert camera_of(tmp_path, *lines)[0].moves


def test_a_camera_moves_with_what_carries_it(tmp_path):
    (camera,) = load(tmp_path, prim("Xform", "x", SLIDE, TRANSLATED, prim("Camera", "c"))).cameras
    assert camera.moves and camera.at(1).world_from_camera[0, 3] == 8


def test_cameras_of_instances_are_there_and_inactive_ones_are_not(tmp_path):
    rig = 'class Xform "rig"\n{\n' + prim("Camera", "c") + "}\n"
    copy = prim("Xform", "a", metadata="instanceable = true\nreferences = </rig>")
    gone = prim("Camera", "gone", metadata="active = false")
    points = "point3f[] positions = [(0, 0, 0)]", "int[] protoIndices = [0]", "rel prototypes = </p/x>"
    instancer = prim("PointInstancer", "p", *points, prim("Xform", "x", prim("Camera", "inside")))
    scene = load(tmp_path, rig, copy, gone, instancer, 'over "unknown"\n{\n' + prim("Camera", "c") + "}\n")
    assert [camera.name for camera in scene.cameras] == ["/a/c"]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (("float fStop = 2.8", "float focusDistance = 5"), "depth of field (fStop 2.8, focusDistance 5) of camera /c"),
        (("double shutter:open = -0.25", "double shutter:close = 0.25"), "shutter (-0.25 to 0.25) of camera /c"),
        (("float exposure = 2",), "exposure (4 times) of camera /c"),
        (("float exposure:iso = 200",), "exposure (2 times) of camera /c"),
        (("float4[] clippingPlanes = [(0, 0, 1, 1)]",), "clippingPlanes of camera /c"),
    ],
)
def test_what_a_camera_does_beyond_its_view_is_named(tmp_path, lines, says):
    assert camera_of(tmp_path, *lines)[1].not_read == (says,)


def test_what_does_not_act_is_not_named(tmp_path):
    neutral = "float fStop = 2.8", "float focusDistance = 0", "double shutter:open = 0", "double shutter:close = 0"
    assert camera_of(tmp_path, *neutral)[1].not_read == ()


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (("float focalLength = 0",), "focal length 0"),
        (("float verticalAperture = -1",), "aperture 20.955 x -1"),
        (("float2 clippingRange = (0, 5)",), "clippingRange (0, 5)"),
        (("float2 clippingRange = (5, 5)", ORTHOGRAPHIC), "clippingRange (5, 5)"),
        (placed("double3 xformOp:scale", "(1, 0, 1)"), "a transform that is not finite, or that flattens it"),
    ],
)
def test_a_camera_that_sees_nothing_is_left_out_and_named(tmp_path, lines, says):
    scene = load(tmp_path, prim("Camera", "c", *lines))
    assert scene.cameras == () and scene.not_read[0].startswith(f"camera /c: {says}")


def test_a_camera_that_stops_seeing_is_an_error_with_its_file(tmp_path):
    file = usd(tmp_path, prim("Camera", "c", "float focalLength.timeSamples = { 0: 20, 24: -20 }"))
    with pytest.raises(InputError, match=f"^{file}, /c: focal length -20"):
        load_scene(file).cameras[0].at(1)


def test_an_orthographic_camera_may_see_what_lies_behind_it(tmp_path):
    assert camera_of(tmp_path, ORTHOGRAPHIC, "float2 clippingRange = (-5, 5)")[0].at(0).near == -5
