"""G-buffers of scenes known by hand: a slanted plane, quads in the corners, masks, tiny and empty scenes."""

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, fractions, make_scene, path_of, quad
from framepairs.jitter import jitter
from framepairs.scene.description import Material, Mesh, Slot, Texture

RED = Material(name="red", base_color=(0.8, 0.1, 0.2), roughness=0.25, metallic=0.75, specular=0.5)
EPSILON = 2.0**-24


def slanted(angle: float, distance: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    matrix = at(0, 0, -distance)
    matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    return matrix


@pytest.mark.parametrize("stream", ["hr", "lr_x2", "lr_x2_jittered_mip-1", "lr_x2.7_jittered_mip-1.433"])
def test_depth_and_normal_of_a_slanted_plane_at_each_streams_own_sample(stream):
    angle, distance, frame = np.radians(25), 3.0, 5
    stage = Stage(make_scene((quad(40, 40), RED, slanted(angle, distance))), path_of(*[np.eye(4)] * 6), scales=(2, 2.7))
    arrays = stage.arrays(frame, stream)
    width, height = stage.streams[stream].size
    length = {"2": 32, "2.7": int(8 * 2.7**2)}["2.7" if "2.7" in stream else "2"]
    offset = jitter(frame, length) if "jittered" in stream else (0.0, 0.0)
    x, _ = fractions(width, height, offset)
    _, tan_x, _ = camera_basis(stage)
    normal = np.array([np.sin(angle), 0, np.cos(angle)])
    ray = np.stack([(2 * x - 1) * tan_x, 0 * x, -np.ones_like(x)], axis=-1)  # y does not change depth here
    exact = (normal @ np.array([0, 0, -distance])) / (ray @ normal)
    # depth is interpolated over a triangle 40 units wide, seen at up to 70 degrees: some 40 roundings of 40 units
    assert np.abs(arrays["depth"][..., 0] - exact).max() < 40 * 40 * EPSILON
    assert np.abs(arrays["normal"] - normal).max() < 8 * EPSILON
    assert (arrays["object_id"] == 1).all()


def test_quads_appear_where_they_are_and_the_background_is_as_declared():
    part = quad(0.5, 0.5)
    stage = Stage(make_scene((part, RED, at(-1, 0.5, -2)), (part, RED, at(1, -0.5, -2))), path_of(np.eye(4)))
    arrays = stage.arrays(0, "hr")
    identity = arrays["object_id"][..., 0]
    rows, columns = np.nonzero(identity == 1)
    assert rows.max() < 27 / 2 and columns.max() < 48 / 2  # x = -1, y = +0.5: upper left
    rows, columns = np.nonzero(identity == 2)
    assert rows.min() > 27 / 2 and columns.min() > 48 / 2
    sky = identity == 0
    assert sky.any() and np.isinf(arrays["depth"][sky]).all()
    for name in ("albedo", "normal", "roughness", "metallic", "specular", "brdf"):
        background = sky if name != "brdf" else np.logical_and.reduce([sky, np.roll(sky, 1, 0), np.roll(sky, 1, 1)])
        background = background & np.roll(sky, -1, 0) & np.roll(sky, -1, 1)
        assert not arrays[name][background].any(), name


def test_material_values_reach_the_gbuffer():
    stage = Stage(make_scene((quad(40, 40), RED, at(0, 0, -2))), path_of(np.eye(4)))
    arrays = stage.arrays(0, "lr_x2")
    for name, value in (("albedo", RED.base_color), ("roughness", 0.25), ("metallic", 0.75), ("specular", 0.5)):
        assert np.abs(arrays[name] - value).max() < 2 * EPSILON, name


def test_a_surface_seen_from_behind_turns_its_normal_to_the_camera():
    turned = slanted(np.pi, 2.0)
    arrays = Stage(make_scene((quad(40, 40), RED, turned)), path_of(np.eye(4))).arrays(0, "hr")
    assert (arrays["normal"][..., 2] > 0.999).all()


def test_near_and_far_planes_cut():
    scene = make_scene((quad(40, 40), RED, at(0, 0, -2)), (quad(40, 40), RED, at(0, 0, -5)))
    near = Stage(scene, path_of(np.eye(4), near=3)).arrays(0, "hr")
    assert (near["object_id"] == 2).all()
    far = Stage(scene, path_of(np.eye(4), near=0.1, far=1.5)).arrays(0, "hr")
    assert (far["object_id"] == 0).all()


def test_alpha_masks_are_passed_through_and_their_holes_show_what_is_behind():
    texels = np.full((1, 2, 4), 255, np.uint8)
    texels[0, 1, 3] = 0  # right half is a hole
    mask = Material(name="mask", base_color=(1, 1, 1), alpha="mask", base_texture=Slot(texture=0))
    leaf = Texture(name="leaf", texels=texels, srgb=True, wrap=("clamp", "clamp"))
    scene = make_scene((quad(40, 40), mask, at(0, 0, -2)), (quad(40, 40), RED, at(0, 0, -3)), textures=(leaf,))
    identity = Stage(scene, path_of(np.eye(4))).arrays(0, "hr")["object_id"][..., 0]
    assert (identity[:, :20] == 1).all() and (identity[:, 28:] == 2).all()


def test_coplanar_masked_layers_end():
    """A hundred holes at one place: the ray must get past them, or give up, but never hang."""
    hole = Material(name="hole", opacity=0.0, alpha="mask")
    parts = [(quad(40, 40), hole, at(0, 0, -2))] * 100
    identity = Stage(make_scene(*parts, (quad(40, 40), RED, at(0, 0, -3))), path_of(np.eye(4))).arrays(0, "hr")["object_id"]
    assert (identity == 101).all()


def test_an_empty_scene_and_a_scene_of_degenerate_triangles_are_all_sky():
    flat = Mesh(name="flat", positions=np.zeros((3, 3), np.float32), faces=np.array([[0, 1, 2]], np.uint32))
    for scene in (make_scene(), make_scene((flat, RED, at(0, 0, -2)))):
        arrays = Stage(scene, path_of(np.eye(4), at(1, 0, 0))).arrays(1, "hr")
        assert not arrays["object_id"].any() and np.isinf(arrays["depth"]).all()
        assert all(np.isfinite(array).all() for name, array in arrays.items() if name != "depth")


def test_a_needle_triangle_and_zero_area_uv_give_finite_values():
    needle = Mesh(
        name="needle",
        positions=np.array([[-20, -1e-6, 0], [20, -1e-6, 0], [0, 3, 0], [0, -3, 0]], np.float32),
        faces=np.array([[0, 1, 2], [0, 1, 3]], np.uint32),
        uv=np.zeros((4, 2), np.float32),
    )
    normal_map = Texture(
        name="n", texels=np.full((4, 4, 4), 200, np.uint8), srgb=False, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)
    )
    bumpy = Material(name="bumpy", normal_texture=Slot(texture=0), base_texture=Slot(texture=0))
    arrays = Stage(make_scene((needle, bumpy, at(0, 0, -2)), textures=(normal_map,)), path_of(np.eye(4))).arrays(0, "hr")
    hit = arrays["object_id"][..., 0] > 0
    assert hit.any() and all(np.isfinite(array[hit]).all() for array in arrays.values())
    assert np.abs(np.linalg.norm(arrays["normal"][hit], axis=-1) - 1).max() < 8 * EPSILON


def test_a_scene_of_one_pixel_renders():
    stage = Stage(make_scene((quad(40, 40), RED, at(0, 0, -2))), path_of(np.eye(4)), display=(1, 1), scales=(1,))
    for stream in stage.streams:
        assert stage.arrays(0, stream)["color"].shape == (1, 1, 3)


def test_instances_of_one_mesh_are_told_apart_and_placed():
    scene = make_scene(*[(quad(0.4, 0.4), RED, at(x, 0, -2)) for x in (-0.9, 0.0, 0.9)])
    shared = scene.__class__(**{
        **vars(scene), "meshes": scene.meshes[:1],
        "objects": tuple(item.__class__(**{**vars(item), "mesh": 0}) for item in scene.objects),
    })  # fmt: skip
    one, many = (Stage(s, path_of(np.eye(4))).arrays(0, "hr") for s in (scene, shared))
    assert set(np.unique(one["object_id"])) == {0, 1, 2, 3}
    assert np.array_equal(one["object_id"], many["object_id"])
    covered = one["object_id"][..., 0] > 0
    assert np.abs(one["depth"][covered] - many["depth"][covered]).max() < 8 * EPSILON
