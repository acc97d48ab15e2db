"""The animation file beside a scene: what moves, how it moves, and what is refused."""

import json

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene.animation import SceneAnimation, animation_beside, apply_animation, read_animation, with_animation
from framepairs.scene.containment import Reach
from framepairs.scene.mitsuba import scene_from_dict
from framepairs.transforms import rotation_from_quaternion

HALF = 0.5**0.5


@pytest.fixture
def scene(tmp_path):
    move = np.diag([2.0, 2, 2, 1])
    return scene_from_dict(
        {"type": "scene", "a": {"type": "cube", "to_world": move}, "b": {"type": "cube"}, "eye": {"type": "perspective"}},
        tmp_path,
    )


def animated(scene, folder, **keys):
    file = folder / "x.animation.json"
    file.write_text(json.dumps({"version": 1, **keys}))
    return apply_animation(scene, file)


def track(*keyframes, **keys):
    return {"keyframes": list(keyframes), **keys}


def test_things_that_are_not_named_stay(scene, tmp_path):
    moved = animated(scene, tmp_path, objects={"b": track({"time": 0, "translation": [1, 2, 3]})})
    np.testing.assert_array_equal(moved.world_from_object(0.0)[0], np.diag([2, 2, 2, 1]))
    np.testing.assert_array_equal(moved.world_from_object(7.0)[1][:3, 3], [1, 2, 3])
    assert [item.moves for item in moved.objects] == [False, False]  # one keyframe places, and moves nothing
    assert (moved.animation_end_s, moved.visible, moved.files[-1].name) == (0.0, None, "x.animation.json")


def test_places_between_keyframes(scene, tmp_path):
    keyframes = (
        {"time": 1, "translation": [0, 0, 0], "scale": 1},
        {"time": 3, "translation": [2, 4, 0], "scale": [3, 1, 5], "rotation": [HALF, 0, 0, HALF]},  # 90 degrees about z
        {"time": 4, "rotation": [2, 0, 0, 2]},
    )
    moved = animated(scene, tmp_path, objects={"a": track(*keyframes)})
    at = lambda time: moved.world_from_object(time)[0]  # noqa: E731
    for time, key in ((0.0, 1), (1.0, 1), (4.0, 4), (9.0, 4)):
        np.testing.assert_array_equal(at(time), at(float(key)))
    half = rotation_from_quaternion(np.array([np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]))
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = half * [2, 1, 3], [1, 2, 0]
    np.testing.assert_allclose(at(2.0), expected, atol=1e-15)
    np.testing.assert_allclose(at(3.5)[:3, 3], [1, 2, 0], atol=1e-15)
    assert (moved.animation_end_s, moved.objects[0].moves, moved.moves) == (4.0, True, True)


def test_matrices_are_taken_apart(scene, tmp_path):
    """A turn by 90 degrees passes 45 degrees without shrinking; mirrors stay mirrors."""
    for mirror in (1, -1):
        first, second = np.diag([mirror * 2.0, 1, 1, 1]), np.diag([1.0, 1, 1, 1])
        second[:3, :3] = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) * [mirror * 4, 1, 1]
        keyframes = [{"time": t, "world_from_object": m.tolist()} for t, m in ((0, first), (1, second))]
        middle = animated(scene, tmp_path, objects={"a": track(*keyframes)}).world_from_object(0.5)[0]
        expected = np.array([[HALF, -HALF, 0], [HALF, HALF, 0], [0, 0, 1]]) * [mirror * 3, 1, 1]
        np.testing.assert_allclose(middle[:3, :3], expected, atol=1e-15)


def test_sheared_and_collapsed_matrices_run_along_a_line(scene, tmp_path):
    sheared = np.eye(4)
    sheared[0, 1] = 1
    for second in (sheared, np.diag([0.0, 1, 1, 1])):
        keyframes = [{"time": t, "world_from_object": m.tolist()} for t, m in ((0, np.eye(4)), (1, second))]
        moved = animated(scene, tmp_path, objects={"a": track(*keyframes)})
        np.testing.assert_array_equal(moved.world_from_object(0.25)[0], 0.75 * np.eye(4) + 0.25 * second)


def test_steps_keep_the_earlier_keyframe(scene, tmp_path):
    keyframes = ({"time": 0, "translation": [0, 0, 0]}, {"time": 0.1, "translation": [1, 0, 0]})
    moved = animated(scene, tmp_path, objects={"a": track(*keyframes, interpolation="step")})
    found = [moved.world_from_object(time)[0, 0, 3] for time in (0.0, 0.0999, 0.1, 3 / 30, 0.1 - 1e-12)]
    assert found == [0, 0, 1, 1, 1]  # a frame's time and a keyframe's decimals are the same within 1e-9


def test_visibility(scene, tmp_path):
    shown = [{"time": 1, "visible": False}, {"time": 2, "visible": True}]
    moved = animated(scene, tmp_path, objects={"b": {"visibility": shown}})
    assert [bool(moved.visible(time)[1]) for time in (0.0, 0.99, 1.0, 1.99, 2.0, 5.0)] == [True, True, False, False, True, True]
    assert all(moved.visible(time)[0] for time in (0.0, 1.5))
    assert (moved.animation_end_s, moved.objects[1].moves) == (2.0, True)


def test_cameras_move(scene, tmp_path):
    keyframes = ({"time": 0, "translation": [0, 0, 0]}, {"time": 2, "translation": [0, 0, 4], "rotation": [0, 0, 1, 0]})
    moved = animated(scene, tmp_path, cameras={"eye": track(*keyframes)})
    (camera,) = moved.cameras
    view = camera.at(1.0)
    expected = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 2], [0, 0, 0, 1]]
    np.testing.assert_allclose(view.world_from_camera, expected, atol=1e-15)
    assert (camera.moves, view.fov_y, moved.objects[0].moves) == (True, scene.cameras[0].at(0.0).fov_y, False)


PLACED = {"time": 0, "translation": [0, 0, 0]}


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"object": {}}, "object: Extra inputs are not permitted"),
        ({"version": 2}, "version: Input should be 1"),
        ({"objects": {"c": track(PLACED)}}, "objects.c: no such object in the scene, which has a, b"),
        ({"cameras": {"c": track(PLACED)}}, "cameras.c: no such camera in the scene, which has eye"),
        ({"objects": {"a": track({"time": 0})}}, "objects.a.keyframes.0: give either world_from_object, or translation"),
        ({"objects": {"a": track({**PLACED, "world_from_object": np.eye(4).tolist()})}}, "give either world_from_object"),
        ({"objects": {"a": track({"time": 0, "world_from_object": [[1, 2]]})}}, "objects.a.keyframes.0.world_from_object"),
        ({"objects": {"a": track({"time": 0, "world_from_object": np.ones((4, 4)).tolist()})}}, "last row"),
        ({"objects": {"a": track({"time": 0, "rotation": [0, 0, 0, 0]})}}, "rotation has no length"),
        ({"objects": {"a": track({"time": 0, "translation": [0, float("nan"), 0]})}}, "keyframes.0.translation.1: .*finite"),
        ({"objects": {"a": track({"time": 0, "translation": [0, 1e300, 0]})}}, "keyframes.0.translation.1: .*less than"),
        ({"objects": {"a": track(PLACED, PLACED)}}, "objects.a: keyframes.1: time 0 is not after the one before it"),
        ({"objects": {"a": track({"time": -1, "translation": [0, 0, 0]})}}, "objects.a.keyframes.0.time"),
        ({"objects": {"a": track(PLACED, interpolation="cubic")}}, "objects.a.interpolation"),
        ({"objects": {"a": {"visibility": [{"time": 1, "visible": "maybe"}]}}}, "objects.a.visibility.0.visible"),
        ({"cameras": {"eye": track({"time": 0, "scale": 2})}}, "cameras.eye.keyframes.0: a camera's place is a rotation"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_field(scene, tmp_path, keys, says):
    with pytest.raises(InputError, match=says) as caught:
        animated(scene, tmp_path, **keys)
    assert "x.animation.json" in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", "[" * 100_000, '{"version": 1, "objects": NaN}', "\x00\xff"])
def test_files_that_are_no_animation_are_refused(tmp_path, text):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(InputError, match="x.json"):
        read_animation(tmp_path / "x.json")
    with pytest.raises(InputError, match="No such file"):
        read_animation(tmp_path / "nowhere.json")


def test_where_it_lies_and_what_its_schema_says(tmp_path):
    assert animation_beside(tmp_path / "a.b.xml").name == "a.b.animation.json"
    schema = SceneAnimation.model_json_schema()
    assert set(schema["properties"]) == {"version", "objects", "cameras"} and schema["additionalProperties"] is False


def test_a_link_that_leaves_the_folder_is_not_followed(scene, tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "secret.json").write_text('{"version": 1}')
    assert with_animation(scene, folder / "s.xml", Reach(folder)) is scene
    (folder / "s.animation.json").symlink_to(tmp_path / "secret.json")
    with pytest.raises(InputError, match="lies outside the scene's folder"):
        with_animation(scene, folder / "s.xml", Reach(folder))
    assert with_animation(scene, folder / "s.xml", Reach(folder, outside=True)).files[-1].name == "secret.json"
