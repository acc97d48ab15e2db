"""A whole Mitsuba scene against Mitsuba's own reading of it: what rays hit, where, with which normal, uv and camera."""

import json
from pathlib import Path

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene.containment import Reach, reach_of
from framepairs.scene.description import scene_bounds
from framepairs.scene.mitsuba import load_mitsuba, scene_from_dict
from framepairs.transforms import clip_from_view
from mitsuba_files import SCENE, mitsubas_hits, nearest_hit, write_scene

SINGLE = 2.0**-23
CHORD = 0.00095  # of a sphere, in radii


def load(file: Path):
    return load_mitsuba(file, reach_of(file))


@pytest.mark.renders
def test_rays_hit_what_mitsubas_hit(tmp_path):
    """The sphere is inscribed, its hits err by a chord's error, twice on a quad's diagonal, over the cosine; float32 at 10."""
    from framepairs.backend import mi

    file = write_scene(tmp_path)
    ours, theirs = load(file), mi.load_file(str(file), optimize=False)
    names = [shape.id() for shape in theirs.shapes()]
    eye = np.array([1.0, 2, 9])
    directions = np.random.default_rng(5).uniform([-4, -2, -2], [4, 2, 2], (200, 3)) - eye
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hit = set()
    for direction, expected in zip(directions, mitsubas_hits(theirs, np.tile(eye, (200, 1)), directions), strict=True):
        found = nearest_hit(ours, eye, direction)
        if expected is None:
            assert found is None
            continue
        index, place, normal, uv = found
        name = ours.objects[index].name
        cosine = abs(normal @ direction)
        if name == "lamp" and cosine < 0.3:
            continue
        assert name == names[expected["shape"]]
        hit.add(name)
        slack = 2 * 0.5 * CHORD / cosine if name == "lamp" else 256 * SINGLE * 10
        np.testing.assert_allclose(place, expected["place"], atol=slack)
        np.testing.assert_allclose(normal, expected["normal"], atol=4 * slack)
        np.testing.assert_allclose(uv, expected["uv"], atol=16 * slack)
    assert hit == {"floor", "thing", "lamp", "block"}


@pytest.mark.renders
def test_bounds_are_mitsubas(tmp_path):
    from framepairs.backend import mi

    file = write_scene(tmp_path)
    ours, theirs = load(file), mi.load_file(str(file), optimize=False).bbox()
    expected = [np.array(corner).ravel() for corner in (theirs.min, theirs.max)]
    np.testing.assert_allclose(scene_bounds(ours), expected, atol=0.5e-3)  # of the inscribed sphere


@pytest.mark.renders
@pytest.mark.parametrize(
    "lens",
    [
        {"fov": 40.0},
        {"fov": 40.0, "fov_axis": "y"},
        {"fov": 40.0, "fov_axis": "smaller"},
        {"fov": 40.0, "fov_axis": "larger"},
        {"fov": 40.0, "fov_axis": "diagonal"},
        {"focal_length": "35mm"},
        {"fov": 60.0, "principal_point_offset_x": 0.1, "principal_point_offset_y": -0.2},
    ],
)
@pytest.mark.parametrize("size", [(160, 90), (70, 110)])
def test_cameras_see_what_mitsubas_see(lens, size):
    from framepairs.backend import mi

    place = mi.ScalarTransform4f().look_at([1, 2, 3], [0, 0.5, 0.25], [0.1, 1, 0])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1]}
    values = {"type": "perspective", "to_world": place, "film": film, **lens}
    scene = scene_from_dict({"type": "scene", "eye": values}, Path("."))
    view = scene.cameras[0].at(0.0)
    clip = clip_from_view(view.fov_y, size[0] / size[1], 0.1, 10, view.shift)
    sensor = mi.load_dict(values)
    for x, y in ((0.2, 0.3), (0.9, 0.6), (0.5, 0.5)):
        ray, _ = sensor.sample_ray(0, 0, mi.Point2f(x, y), mi.Point2f(0, 0))
        point = np.append(np.array(ray.o).ravel() + 2 * np.array(ray.d).ravel(), 1)
        clipped = clip @ np.linalg.inv(view.world_from_camera) @ point
        found = (clipped[0] / clipped[3] + 1) / 2, (1 - clipped[1] / clipped[3]) / 2
        np.testing.assert_allclose(found, (x, y), atol=64 * SINGLE)


@pytest.mark.renders
def test_orthographic_cameras_are_as_high_as_mitsubas():
    from framepairs.backend import mi

    place = mi.ScalarTransform4f().look_at([1, 2, 3], [0, 0.5, 0.25], [0.1, 1, 0]).scale([1.5, 1.5, 1])
    film = {"type": "hdrfilm", "width": 160, "height": 90}
    values = {"type": "orthographic", "to_world": place, "film": film}
    view = scene_from_dict({"type": "scene", "eye": values}, Path(".")).cameras[0].at(0.0)
    sensor = mi.load_dict(values)
    for x, y in ((0.2, 0.3), (0.9, 0.6)):
        ray, _ = sensor.sample_ray(0, 0, mi.Point2f(x, y), mi.Point2f(0, 0))
        local = np.linalg.inv(view.world_from_camera) @ np.append(np.array(ray.o).ravel(), 1)
        expected = (x - 0.5) * view.height * 160 / 90, (0.5 - y) * view.height
        np.testing.assert_allclose(local[:2], expected, atol=64 * SINGLE)


def test_the_scene_is_read_without_mitsuba_and_names_what_it_leaves(tmp_path):
    scene = load(write_scene(tmp_path))
    assert [item.name for item in scene.objects] == ["floor", "thing", "lamp", "block"]
    assert [material.name for material in scene.materials] == ["bumpy", "paint", "black of lamp", "glass"]
    assert [item.double_sided for item in scene.objects] == [False, True, False, True]
    lamp, glass = scene.materials[2:]
    assert lamp.base_color == (0, 0, 0)
    assert (lamp.emission, lamp.emits, lamp.shines) == ((5, 4, 3), "front", True)
    assert (dict(glass.bsdf), glass.alpha) == ({"type": "dielectric", "int_ior": 1.5}, "blend")
    assert glass.not_read == ("BSDF dielectric: kept for path, raster draws a stand-in, not demodulated",)
    assert (scene.up_axis, scene.not_read, scene.moves) == ("Y", (), False)
    assert [file.name for file in scene.files] == ["scene.xml", "thing.obj", "colors.png", "sky.exr"]


def test_the_animation_beside_it_moves_it(tmp_path):
    still, moving = load(write_scene(tmp_path)), load(write_scene(tmp_path, animated=True))
    assert [item.moves for item in moving.objects] == [False, True, False, True]
    assert (moving.animation_end_s, moving.files[-1].name) == (2.0, "scene.animation.json")
    world = moving.world_from_object(1.0)
    np.testing.assert_array_equal(world[[0, 2, 3]], still.world_from_object(1.0)[[0, 2, 3]])
    half_turn = [[0, 0, 1, -1], [0, 1, 0, 0.5], [-1, 0, 0, 0], [0, 0, 0, 1]]  # 90 of 180 degrees about y
    np.testing.assert_allclose(world[1], half_turn, atol=1e-15)
    assert [list(moving.visible(time)) for time in (0.5, 1.0)] == [[True] * 4, [True, True, True, False]]


def test_a_mesh_that_stands_twice_is_read_once(tmp_path):
    write_scene(tmp_path)
    thing = {"type": "obj", "filename": "thing.obj"}
    group = {"type": "shapegroup", "first": thing, "second": {"type": "sphere"}}
    move = [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    values = {
        "type": "scene",
        "a": thing,
        "b": {**thing, "to_world": move},
        "flipped": {**thing, "flip_normals": True},
        "group": group,
        "one": {"type": "instance", "shapegroup": {"type": "ref", "id": "group"}, "to_world": move},
        "two": {"type": "instance", "shapegroup": {"type": "ref", "id": "group"}},
    }
    scene = scene_from_dict(values, tmp_path)
    names = [item.name for item in scene.objects]
    assert names == ["a", "b", "flipped", "one/obj 1", "one/sphere 2", "two/obj 1", "two/sphere 2"]
    assert [item.mesh for item in scene.objects] == [0, 0, 1, 0, 2, 0, 2]
    assert [matrix[0, 3] for matrix in scene.world_from_object(0.0)] == [0, 5, 0, 5, 5, 0, 0]


@pytest.mark.parametrize(
    ("up", "axis"), [((0, 1, 0), "Y"), ((0, 0, 1), "Z"), ((1, 0, 0), "X"), ((0, 0.1, -1), "Z"), ((0.6, 0.6, 0.6), "Y")]
)
def test_up_is_the_cameras(up, axis):
    forward = np.cross(up, [0.3, 0.7, -0.2])
    left = np.cross(up, forward)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([v / np.linalg.norm(v) for v in (left, np.array(up, float), forward)], axis=1)
    values = {"type": "scene", "eye": {"type": "perspective", "to_world": matrix}}
    assert scene_from_dict(values, Path(".")).up_axis == axis


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"s": {"type": "sphere", "radius": -1}}, "s: radius is -1"),
        ({"s": {"type": "sphere", "radius": float("nan")}}, "s: radius is nan"),
        ({"s": {"type": "spher"}}, "unknown type 'spher'"),
        ({"s": {"type": "../../evil"}}, "unknown type '../../evil'"),
        ({"s": {"type": "obj", "filename": "../secret.obj"}}, "s: .*lies outside the scene's folder"),
        ({"s": {"type": "obj", "filename": "none.obj"}}, "s: missing mesh none.obj"),
        ({"s": {"type": "obj", "filename": "thing.txt"}}, "s: thing.txt does not end in .obj"),
        ({"s": {"type": "obj"}}, "s: filename is 'None'"),
        ({"s": {"type": "cube", "to_world": [[1, 2], [3, 4]]}}, "s: to_world is no finite affine 4x4 matrix"),
        ({"s": {"type": "cube", "bsdf": {"type": "ref", "id": "no"}}}, "no: no object has the id 'no'"),
        ({"s": {"type": "cube", "a": {"type": "diffuse"}, "b": {"type": "diffuse"}}}, "s: 2 BSDFs, one is expected"),
        ({"s": {"type": "cylinder", "p0": [0, 0, 1]}}, "s: p0 and p1 of a cylinder are one point"),
        ({"s": {"type": "instance"}}, "s: an instance holds one shapegroup"),
        ({"e": {"type": "spot", "cutoff_angle": 10.0, "beam_width": 20.0}}, "e: beam_width 20 and cutoff_angle 10"),
        ({"e": {"type": "directional", "direction": [0, 0, 0]}}, "e: direction gives no direction"),
        ({"e": {"type": "constant"}, "f": {"type": "constant"}}, "f: 2 environments, one is expected"),
        ({"c": {"type": "perspective", "fov": 180.0}}, "c: fov is 180"),
        ({"c": {"type": "perspective", "fov_axis": "z"}}, "c: fov_axis is 'z'"),
        ({"c": {"type": "perspective", "to_world": np.diag([0.0, 1, 1, 1])}}, "c: to_world is singular"),
        ({"c": {"type": "perspective", "film": {"type": "hdrfilm", "width": 0}}}, "c: a film of 0 x 576 pixels"),
        ({"s": {"type": "cube", "f": object()}}, "cube.f: object is no plain data"),
    ],
)
def test_what_is_wrong_is_named_with_its_object(tmp_path, values, says):
    folder = tmp_path / "scene"
    folder.mkdir()
    write_scene(folder)
    (tmp_path / "secret.obj").write_text("")
    (folder / "thing.txt").write_text("")
    with pytest.raises(InputError, match=says):
        scene_from_dict({"type": "scene", **values}, folder)


def test_references_in_circles_and_without_end_are_refused():
    circle: dict = {"type": "twosided"}
    circle["bsdf"] = circle
    with pytest.raises(InputError, match="nested deeper"):
        scene_from_dict({"type": "scene", "s": {"type": "cube", "bsdf": circle}}, Path("."))
    values: dict = {"type": "scene", "b0": {"type": "diffuse"}}
    for k in range(30):
        ref = {"type": "ref", "id": f"b{k}"}
        values[f"b{k + 1}"] = {"type": "blendbsdf", "one": ref, "two": ref}
    with pytest.raises(InputError, match="200000 are read"):
        scene_from_dict(values, Path("."))
    values = {"type": "scene", "a": {"type": "twosided", "x": {"type": "ref", "id": "b"}}}
    values["b"] = {"type": "twosided", "x": {"type": "ref", "id": "a"}}
    with pytest.raises(InputError, match="refers to itself"):
        scene_from_dict(values, Path("."))


def test_a_dictionary_says_the_same_as_the_file(tmp_path):
    """Both ways lead through the same dictionaries; here with Mitsuba's own transforms written as arrays."""
    file = write_scene(tmp_path, SCENE)
    matrix = load(file).world_from_object(0.0)[1]
    values = {"type": "scene", "thing": {"type": "obj", "filename": "thing.obj", "to_world": matrix}}
    scene = scene_from_dict(json.loads(json.dumps(values, default=np.ndarray.tolist)), tmp_path)
    np.testing.assert_array_equal(scene.world_from_object(0.0)[0], matrix)
    assert scene_from_dict(values, tmp_path).materials[0].base_color == (0.5, 0.5, 0.5)


def test_files_outside_are_read_where_that_is_allowed(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    write_scene(tmp_path)
    file = folder / "s.xml"
    file.write_text('<scene version="3.0.0"><shape type="obj"><string name="filename" value="../thing.obj"/></shape></scene>')
    with pytest.raises(InputError, match="s.xml, obj 1: ../thing.obj lies outside"):
        load(file)
    assert len(load_mitsuba(file, Reach(folder, outside=True)).meshes[0].faces) == 3
