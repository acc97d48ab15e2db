"""Lights and cameras of glTF's nodes: values, places, motion, and what is named or refused."""

import math

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene import load_scene
from gltf_files import GltfFile, turned_about_z

EXTENSION = "KHR_lights_punctual"
HALF = math.sqrt(0.5)
ABOUT_X = [HALF, 0, 0, HALF]  # by 90 degrees: -z becomes +y
FLOAT32 = 2.0**-23


def lit(*lights, **node_keys):
    """A triangle, and one node per light, at (1, 2, 3) and turned so that its -z is +y."""
    file = GltfFile(extensions={EXTENSION: {"lights": list(lights)}}, extensionsUsed=[EXTENSION])
    file.node(mesh=file.mesh())
    for index in range(len(lights)):
        keys = {"translation": [1, 2, 3], "rotation": ABOUT_X, **node_keys}
        file.node(extensions={EXTENSION: {"light": index}}, **keys)
    return file


def test_lights_of_every_type(tmp_path):
    spot = {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}, "color": [1, 0.5, 0], "intensity": 8}
    scene = lit({"type": "directional", "name": "sun", "intensity": 3}, {"type": "point", "color": [0.5, 1, 0]}, spot).load(
        tmp_path
    )
    assert [light.kind for light in scene.lights] == ["directional", "point", "spot"]
    assert [light.name for light in scene.lights] == ["sun", "light 1", "light 2"]
    assert [light.radiance for light in scene.lights] == [(3, 3, 3), (0.5, 1, 0), (8, 4, 0)]
    assert [light.position for light in scene.lights] == [(1, 2, 3)] * 3
    for light in scene.lights:
        np.testing.assert_allclose(light.direction, [0, 1, 0], atol=4e-16)
    assert scene.lights[2].cone == (math.cos(0.25), math.cos(0.5)) and scene.lights[1].cone == (-1, -1)
    assert scene.lights_at is None and scene.not_read == ()


def test_the_defaults_of_a_light(tmp_path):
    spot, point = lit({"type": "spot", "spot": {}}, {"type": "point"}).load(tmp_path).lights
    assert spot.cone == (1, math.cos(math.pi / 4)) and spot.radiance == point.radiance == (1, 1, 1)


def test_an_inner_angle_beyond_the_outer_one_is_a_hard_cone(tmp_path):
    angles = {"innerConeAngle": 0.75, "outerConeAngle": 0.5}
    assert lit({"type": "spot", "spot": angles}).load(tmp_path).lights[0].cone == (math.cos(0.5),) * 2


@pytest.mark.parametrize("scale", [[5, 5, 5], [2, 3, 4], [-1, 2, 3], [0, 0, 0], [1, 0, 1]])
def test_the_scale_of_a_node_changes_no_light(tmp_path, scale):
    light = lit({"type": "spot", "intensity": 2}, scale=scale).load(tmp_path).lights[0]
    assert light.radiance == (2, 2, 2) and np.linalg.norm(light.direction) == pytest.approx(1, abs=1e-15)
    if all(scale):
        np.testing.assert_allclose(light.direction, [0, 1, 0], atol=4e-16)


def test_the_range_of_a_light_is_named(tmp_path):
    lights = {"type": "point", "range": 10, "name": "lamp"}, {"type": "spot", "range": 2.5}, {"type": "directional", "range": 1}
    found = lit(*lights).load(tmp_path).not_read
    assert found == ("range 10 of light lamp: it shines without end", "range 2.5 of light 1: it shines without end")


def test_lights_follow_their_nodes(tmp_path):
    file = lit({"type": "spot"}, {"type": "directional"}, {"type": "point"})
    parent = file.node(name="carrier", children=[1, 2])
    file.clip(
        (parent, "translation", [0, 2], [[0, 0, 0], [4, 0, 0]], "LINEAR"),
        (2, "rotation", [0, 2], [turned_about_z(0), ABOUT_X], "STEP"),
    )
    scene = file.load(tmp_path)
    assert [light.position for light in scene.lights_at(1.0)] == [(3, 2, 3), (3, 2, 3), (1, 2, 3)]
    assert [light.position for light in scene.lights_at(0.0)] == [light.position for light in scene.lights]
    before, after = (scene.lights_at(time_s)[1].direction for time_s in (1, 2))
    np.testing.assert_allclose([before, after], [[0, 0, -1], [0, 1, 0]], atol=FLOAT32)
    pairs = zip(scene.lights_at(2), scene.lights, strict=True)
    changed = {name for now, first in pairs for name in vars(now) if getattr(now, name) != getattr(first, name)}
    assert changed == {"position", "direction"}


def test_one_light_at_two_nodes_and_none_outside_the_scene(tmp_path):
    file = lit({"type": "point"}, {"type": "point"})
    file.json["nodes"][2]["extensions"][EXTENSION]["light"] = 0
    file.node(extensions={EXTENSION: {"light": 1}})
    file.json["scenes"] = [{"nodes": [0, 1, 2]}]
    assert [light.name for light in file.load(tmp_path).lights] == ["light 0", "light 0"]


@pytest.mark.parametrize(
    ("light", "says"),
    [
        ({"type": "area"}, "light type 'area' is none of glTF's"),
        ({"type": "point", "intensity": -1}, "colour .* and intensity -1: they begin at 0"),
        ({"type": "point", "color": [1, -1, 1]}, "colour .* they begin at 0"),
        ({"type": "spot", "spot": {"outerConeAngle": 2}}, "cone from 0 to 2: angles from 0 to pi / 2"),
        ({"type": "spot", "spot": {"innerConeAngle": -0.5}}, "cone from -0.5"),
        ({"type": "spot", "spot": {"outerConeAngle": 0}}, "cone from 0 to 0"),
    ],
)
def test_lights_that_cannot_be_are_refused(tmp_path, light, says):
    with pytest.raises(InputError, match=rf"scene.gltf, extensions.{EXTENSION}.lights\[0\]: {says}"):
        lit(light).load(tmp_path)


def test_a_light_that_is_not_there_is_named(tmp_path):
    file = lit({"type": "point"})
    file.json["nodes"][1]["extensions"][EXTENSION]["light"] = 4
    with pytest.raises(InputError, match="node 1 names light 4, there are 1"):
        file.load(tmp_path)


def filmed(camera, **node_keys):
    file = GltfFile(cameras=[camera])
    file.node(mesh=file.mesh())
    file.node(camera=0, **{"translation": [1, 2, 3], "rotation": ABOUT_X, **node_keys})
    return file


PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": 0.75, "znear": 0.5, "zfar": 20, "aspectRatio": 2}}
ORTHOGRAPHIC = {"type": "orthographic", "orthographic": {"xmag": 9, "ymag": 1.5, "znear": 0, "zfar": 7}}
# columns: the camera's x, its y up (the node's), and backwards, against +y
PLACE = [[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]]


def test_cameras_of_both_types(tmp_path):
    (camera,) = filmed(PERSPECTIVE, name="eye").load(tmp_path).cameras
    view = camera.at(0.0)
    assert (camera.name, camera.moves) == ("eye", False)
    assert (view.fov_y, view.height, view.near, view.far) == (0.75, None, 0.5, 20)
    np.testing.assert_allclose(view.world_from_camera, PLACE, atol=4e-16)
    (camera,) = filmed(ORTHOGRAPHIC).load(tmp_path).cameras
    view = camera.at(0.0)
    assert (camera.name, view.fov_y, view.height, view.near, view.far) == ("camera 0", None, 3, 0, 7)


def test_a_perspective_without_end(tmp_path):
    view = filmed({"type": "perspective", "perspective": {"yfov": 1, "znear": 0.5}}).load(tmp_path).cameras[0].at(0)
    assert (view.near, view.far) == (0.5, None)


@pytest.mark.parametrize("scale", [[0.5, 0.5, 0.5], [2, 3, 4], [-1, 1, 1]])
def test_a_scaled_or_mirrored_node_carries_a_rigid_camera(tmp_path, scale):
    matrix = filmed(PERSPECTIVE, scale=scale).load(tmp_path).cameras[0].at(0).world_from_camera
    np.testing.assert_allclose(matrix, PLACE, atol=4e-16)


def test_a_sheared_node_keeps_the_direction_of_its_camera(tmp_path):
    columns = [1, 0, 0, 0, 0.5, 1, 0.25, 0, 0, 0, 3, 0, 7, 8, 9, 1]
    file = filmed(PERSPECTIVE)
    file.json["nodes"][1] = {"camera": 0, "matrix": columns}
    matrix = file.load(tmp_path).cameras[0].at(0).world_from_camera
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=4e-16)
    np.testing.assert_allclose(matrix[:3, 2], [0, 0, 1], atol=4e-16)
    # its y is the node's (0.5, 1, 0.25) without its share along z
    np.testing.assert_allclose(matrix[:3, 1], np.array([0.5, 1, 0]) / math.sqrt(1.25), atol=4e-16)
    assert matrix[:3, 3].tolist() == [7, 8, 9]


def test_cameras_follow_their_nodes_and_have_names_of_their_own(tmp_path):
    file = filmed(PERSPECTIVE, name="eye")
    still = file.node(camera=0, name="eye")
    file.clip((1, "translation", [0, 2], [[0, 0, 0], [4, 0, 0]], "LINEAR"))
    first, second = file.load(tmp_path).cameras
    assert (first.name, second.name) == ("eye", f"eye (node {still})") and (first.moves, second.moves) == (True, False)
    assert first.at(0.5).world_from_camera[:3, 3].tolist() == [1, 0, 0]
    np.testing.assert_array_equal(second.at(0.5).world_from_camera, np.eye(4))


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        ({"type": "panorama"}, "camera type 'panorama'"),
        ({"type": "name", "name": "perspective"}, "camera type 'name'"),
        ({"type": "perspective"}, "camera type 'perspective': .* with its values"),
        ({"type": "perspective", "perspective": {"yfov": 0}}, "yfov 0: an angle"),
        ({"type": "perspective", "perspective": {"yfov": 4}}, "yfov 4: an angle"),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 0}}, "znear 0"),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 2, "zfar": 1}}, "znear 2 and zfar 1"),
        ({"type": "orthographic", "orthographic": {"ymag": 0}}, "ymag is 0"),
        ({"type": "orthographic", "orthographic": {"ymag": 1, "znear": -1}}, "znear -1"),
    ],
)
def test_cameras_that_cannot_be_are_refused(tmp_path, camera, says):
    with pytest.raises(InputError, match=rf"scene.gltf, cameras\[0\]: {says}"):
        filmed(camera).load(tmp_path)


def test_the_cameras_of_a_third_party_room(assets):
    scene = load_scene(assets / "BreakfastRoom" / "BreakfastRoom.gltf")
    assert [camera.name for camera in scene.cameras] == ["CameraMain", "CameraTableTop", "CameraTopDown"]
    view = scene.cameras[0].at(0.0)
    assert view.fov_y == pytest.approx(math.pi / 4, abs=1e-7) and (view.far, view.shift) == (20, (0, 0))
    np.testing.assert_allclose(view.world_from_camera[:3, :3] @ view.world_from_camera[:3, :3].T, np.eye(3), atol=4e-16)
    # a node scaled by one half, looking by its quaternion: -z turned by hand from (x, y, z, w)
    x, y, z, w = scene_rotation = [0.0076817236840724945, 0.2081897258758545, -0.0016351358499377966, 0.9780569672584534]
    length = sum(c * c for c in scene_rotation)
    expected = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), length - 2 * (x * x + y * y)]) / length
    np.testing.assert_allclose(view.world_from_camera[:3, 2], expected, atol=4e-16)
