"""glTF that moves: clips, skins and morph targets, against values by hand and against a plain evaluation with SciPy."""

import base64
import json
import re
import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation, Slerp

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.description import scene_bounds
from gltf_files import CORNERS, GltfFile, moved, turned_about_z, world_vertices
from usd_stages import image

FLOAT32 = 2.0**-23
UP = np.float32([[0, 0, 1]] * 3)


def animated(folder, path, times, values, interpolation="LINEAR", clip=None, **node_keys):
    """A triangle whose one node is animated."""
    file = GltfFile()
    node = file.node(mesh=file.mesh(), name="n", **node_keys)
    file.clip((node, path, times, values, interpolation))
    return file.load(folder, clip)


def places(scene, *times):
    return [scene.world_from_object(t)[0, :3, 3].tolist() for t in times]


def test_linear_translations_and_what_lies_outside_the_keys(tmp_path):
    scene = animated(tmp_path, "translation", [1, 2, 4], [[0, 0, 0], [1, 2, 3], [1, 2, 7]])
    assert places(scene, -1, 0, 1, 1.25, 2, 3.5, 4, 9) == [
        [0, 0, 0], [0, 0, 0], [0, 0, 0], [0.25, 0.5, 0.75], [1, 2, 3], [1, 2, 6], [1, 2, 7], [1, 2, 7],
    ]  # fmt: skip
    assert scene.animation_end_s == 4 and scene.moves and scene.deformed is None and scene.not_read == ()


def test_steps_hold_the_key_before(tmp_path):
    scene = animated(tmp_path, "scale", [1, 2, 4], [[1, 1, 1], [2, 3, 4], [5, 6, 7]], "STEP")
    found = [np.diag(scene.world_from_object(t)[0])[:3].tolist() for t in (0, 1.99, 2, 3.99, 4, 5)]
    assert found == [[1, 1, 1], [1, 1, 1], [2, 3, 4], [2, 3, 4], [5, 6, 7], [5, 6, 7]]


def test_cubic_splines_multiply_their_tangents_by_the_interval(tmp_path):
    # Keys of tangent in, value, tangent out. From 0 to 2 s: x is 0 -> 0 with leaving 4 and arriving 0: at u = 1/4 it is
    # 2 (u^3 - 2 u^2 + u) 4 = 1.125. y is 0 -> 1 without tangents: 3 u^2 - 2 u^3 = 0.15625. z arrives with -8 at 0:
    # 2 (u^3 - u^2) (-8) = 0.75.
    keys = [[9, 9, 9], [0, 0, 0], [4, 0, 0], [0, 0, -8], [0, 1, 0], [9, 9, 9]]
    scene = animated(tmp_path, "translation", [0, 2], keys, "CUBICSPLINE")
    assert places(scene, -1, 0, 0.5, 2, 3) == [[0, 0, 0], [0, 0, 0], [1.125, 0.15625, 0.75], [0, 1, 0], [0, 1, 0]]


def test_rotations_take_the_shorter_way_at_even_speed(tmp_path):
    far = (-np.array(turned_about_z(90))).tolist()  # the same rotation by the other quaternion
    scene = animated(tmp_path, "rotation", [0, 3], [turned_about_z(0), far])
    for t, degrees in ((0, 0), (1, 30), (2, 60), (3, 90), (4, 90)):
        expected = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
        # the file holds the quaternion in float32
        np.testing.assert_allclose(scene.world_from_object(t)[0, :3, :3], expected, atol=2 * FLOAT32)


def test_cubic_rotations_are_made_of_unit_length(tmp_path):
    zero = [0, 0, 0, 0]
    keys = [zero, turned_about_z(0), zero, zero, turned_about_z(90), zero]
    matrix = animated(tmp_path, "rotation", [0, 1], keys, "CUBICSPLINE").world_from_object(0.5)[0, :3, :3]
    # half way without tangents it is the mean of the keys, of length cos 22.5: 45 degrees once of unit length
    np.testing.assert_allclose(matrix, Rotation.from_euler("z", 45, degrees=True).as_matrix(), atol=2 * FLOAT32)


def test_normalized_integers_are_rotations(tmp_path):
    codes = np.int16(np.round(np.array([turned_about_z(0), turned_about_z(90)]) * 32767))
    file = GltfFile()
    node = file.node(mesh=file.mesh())
    file.clip((node, "rotation", [0, 1], file.accessor(codes, normalized=True), "LINEAR"))
    found = file.load(tmp_path).world_from_object(1)[0, :3, :3]
    # half a code in each of two components: at most 2 x 0.5 x sqrt(2) / 32767 radians
    np.testing.assert_allclose(found, Rotation.from_euler("z", 90, degrees=True).as_matrix(), atol=1.42 / 32767)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(("dtype", "most"), [("int8", 127), ("uint8", 255), ("int16", 32767), ("uint16", 65535)])
def test_normalized_weights_of_every_integer(tmp_path, dtype, most):
    file = GltfFile()
    node = file.node(mesh=file.mesh(targets=[{"POSITION": np.float32([[0, 0, 1]] * 3)}]))
    values = file.accessor(np.array([0, most], dtype=dtype), normalized=True)
    file.clip((node, "weights", [0, 1], values, "LINEAR"))
    scene = file.load(tmp_path)
    for t in (0, 0.5, 1):
        np.testing.assert_array_equal(scene.deformed(t)[0].positions, CORNERS + np.float32([0, 0, t]))


def test_a_node_scales_then_rotates_then_moves(tmp_path):
    file = GltfFile()
    file.node(mesh=file.mesh(), rotation=[0, 0, 3, 3], scale=[2, 3, 4], translation=[5, 6, 7])  # a quaternion not of length 1
    # (x, y, z) -> (2 x, 3 y, 4 z) -> by 90 degrees about z (-3 y, 2 x, 4 z) -> moved
    expected = [[0, -3, 0, 5], [2, 0, 0, 6], [0, 0, 4, 7], [0, 0, 0, 1]]
    np.testing.assert_allclose(file.load(tmp_path).world_from_object(0)[0], expected, atol=4e-15)


def test_children_follow_and_others_stand_still(tmp_path):
    file = GltfFile()
    mesh = file.mesh()
    child, still = file.node(mesh=mesh, name="child", translation=[0, 3, 0]), file.node(mesh=mesh, name="still")
    parent = file.node(name="parent", children=[child], scale=[2, 2, 2])
    file.clip((parent, "rotation", [0, 1], [turned_about_z(0), turned_about_z(90)], "STEP"))
    scene = file.load(tmp_path)
    assert {item.name: item.moves for item in scene.objects} == {"child": True, "still": False}
    assert len(scene.meshes) == 1  # nodes share what does not deform
    np.testing.assert_allclose(scene.world_from_object(1)[0] @ [1, 0, 0, 1], [-6, 2, 0, 1], atol=8 * FLOAT32)
    np.testing.assert_array_equal(scene.world_from_object(1)[still], np.eye(4))


def test_channels_that_hold_one_value_move_nothing(tmp_path):
    scene = animated(tmp_path, "translation", [0, 1], [[1, 2, 3]] * 2, translation=[9, 9, 9])
    assert not scene.moves and places(scene, 0.5) == [[1, 2, 3]]


def test_clips_are_chosen_by_name_and_the_others_named(tmp_path):
    file = GltfFile()
    node = file.node(mesh=file.mesh())
    for x, name in ((1, "walk"), (2, None), (3, "run")):
        file.clip((node, "translation", [0, x], [[0, 0, 0], [x, 0, 0]], "LINEAR"), name=name)
    found = {name: file.load(tmp_path, name) for name in (None, "walk", "1", "run")}
    assert {name: scene.animation_end_s for name, scene in found.items()} == {None: 1, "walk": 1, "1": 2, "run": 3}
    assert found[None].not_read == ("animation 1: walk is played", "animation run: walk is played")
    assert found["run"].not_read == ("animation walk: run is played", "animation 1: run is played")
    with pytest.raises(InputError, match="scene.gltf, animations: no animation 'swim'; there are: walk, 1, run"):
        file.load(tmp_path, "swim")


def test_mirrored_and_scaled_nodes(tmp_path):
    file = GltfFile()
    file.node(mesh=file.mesh(NORMAL=UP), scale=[-1, 2, 3], translation=[5, 0, 0])
    scene = file.load(tmp_path)
    np.testing.assert_array_equal(world_vertices(scene, 0, 0), [[5, 0, 0], [4, 0, 0], [5, 4, 0]])
    assert np.linalg.det(scene.world_from_object(0)[0]) == -6


def sparse(file, base, places, values, **keys):
    """Index of an accessor of three VEC3, `base` or zeros where it is None, with some replaced."""
    index = file.accessor(CORNERS if base is None else base, **keys)
    accessor = file.json["accessors"][index]
    accessor["sparse"] = {
        "count": len(places),
        "indices": {"bufferView": file.view(np.uint8(places).tobytes()), "componentType": 5121},
        "values": {"bufferView": file.view(np.float32(values).tobytes())},
    }
    if base is None:
        del accessor["bufferView"]
    return index


def test_sparse_accessors_with_and_without_a_base(tmp_path):
    file = GltfFile()
    target = {"POSITION": sparse(file, None, [2], [[0, 0, 8]])}
    positions = sparse(file, CORNERS, [1], [[3, 0, 0]])
    file.node(mesh=file.mesh(positions, targets=[target]), weights=[0.5])
    mesh = file.load(tmp_path).meshes[0]
    np.testing.assert_array_equal(mesh.positions, [[0, 0, 0], [3, 0, 0], [0, 2, 4]])
    assert not mesh.deforms


def test_strides_and_offsets_of_interleaved_vertices(tmp_path):
    file = GltfFile()
    vertices = np.concatenate([np.zeros((3, 1), np.float32), CORNERS, UP], axis=1).astype(np.float32)
    view = file.view(vertices.tobytes(), byteStride=28)
    both = [
        file._add("accessors", {"bufferView": view, "byteOffset": at, "componentType": 5126, "type": "VEC3", "count": 3})
        for at in (4, 16)
    ]
    file.node(mesh=file.mesh(both[0], NORMAL=both[1]))
    mesh = file.load(tmp_path).meshes[0]
    np.testing.assert_array_equal(mesh.positions, CORNERS)
    np.testing.assert_array_equal(mesh.normals, UP)


def test_quantized_meshes(tmp_path):
    file = GltfFile(extensionsRequired=["KHR_mesh_quantization"], extensionsUsed=["KHR_mesh_quantization"])
    positions = np.int16([[0, 0, 0, 0], [32767, -32768, 0, 0], [0, 16384, 0, 0]])
    view = file.view(positions.tobytes(), byteStride=8)
    kind = {"bufferView": view, "componentType": 5122, "type": "VEC3", "count": 3}
    normalized, plain = (file._add("accessors", {**kind, "normalized": flag}) for flag in (True, False))
    normals = file.accessor(np.int8([[0, 0, 127], [0, 90, 90], [-128, 0, 0]]), normalized=True)
    uv = file.accessor(np.uint16([[0, 0], [65535, 0], [0, 65535]]), normalized=True)
    file.node(mesh=file.mesh(normalized, NORMAL=normals, TEXCOORD_0=uv), scale=[2, 2, 2])
    file.node(mesh=file.mesh(plain))
    scene = file.load(tmp_path)
    exact = [[0, 0, 0], [1, -1, 0], [0, 16384 / 32767, 0]]  # max(c / 32767, -1)
    np.testing.assert_array_equal(scene.meshes[0].positions, np.float32(exact))
    np.testing.assert_array_equal(scene.meshes[1].positions, positions[:, :3])
    half = np.sqrt(0.5)
    np.testing.assert_allclose(scene.meshes[0].normals, [[0, 0, 1], [0, half, half], [-1, 0, 0]], atol=FLOAT32)
    np.testing.assert_array_equal(scene.meshes[0].uv, [[0, 1], [1, 1], [0, 0]])
    assert scene.not_read == ()


@pytest.mark.parametrize(
    ("mode", "faces"), [(4, [[0, 1, 2]]), (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]])]
)
def test_lists_strips_and_fans(tmp_path, mode, faces):
    file = GltfFile()
    count = 3 if mode == 4 else 5
    file.node(mesh=file.mesh(np.float32(np.arange(3 * count).reshape(-1, 3)), primitive_keys={"mode": mode}))
    np.testing.assert_array_equal(file.load(tmp_path).meshes[0].faces, faces)


MORPHS = [
    {"POSITION": np.float32([[0, 0, 1]] * 3), "NORMAL": np.float32([[1, 0, 0]] * 3)},
    {"POSITION": np.float32([[0, 4, 0]] * 3)},
]


def test_morph_targets_by_hand(tmp_path):
    file = GltfFile()
    mesh = file.mesh(NORMAL=UP, targets=MORPHS, mesh_keys={"weights": [0.5, 0]})
    file.node(mesh=mesh, name="of the mesh")
    file.node(mesh=mesh, name="of the node", weights=[0, 0.25])
    moving = file.node(mesh=mesh, name="moving")
    file.clip((moving, "weights", [0, 1], [0, 0, 1, 0.5], "LINEAR"))
    scene = file.load(tmp_path)
    assert [item.moves for item in scene.objects] == [False, False, True]
    first, second, third = (scene.meshes[item.mesh] for item in scene.objects)
    assert [mesh.deforms for mesh in (first, second, third)] == [False, False, True]
    np.testing.assert_array_equal(first.positions, CORNERS + np.float32([0, 0, 0.5]))
    np.testing.assert_array_equal(second.positions, CORNERS + np.float32([0, 1, 0]))
    np.testing.assert_allclose(first.normals, [np.array([0.5, 0, 1]) / np.sqrt(1.25)] * 3, atol=FLOAT32)
    (at_half,) = scene.deformed(0.5).values()  # weights 0.5 and 0.25: both at once
    np.testing.assert_array_equal(at_half.positions, CORNERS + np.float32([0, 1, 0.5]))
    np.testing.assert_allclose(at_half.normals, [np.array([0.5, 0, 1]) / np.sqrt(1.25)] * 3, atol=FLOAT32)
    np.testing.assert_array_equal(third.positions, scene.deformed(0)[scene.objects[2].mesh].positions)


def test_cubic_weights_of_two_targets(tmp_path):
    file = GltfFile()
    node = file.node(mesh=file.mesh(targets=MORPHS))
    # per key: arriving, value, leaving of both targets
    file.clip((node, "weights", [0, 2], [0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], "CUBICSPLINE"))
    (found,) = file.load(tmp_path).deformed(1).values()
    # u = 1/2: the first has 2 (u^3 - 2 u^2 + u) = 0.25, the second 3 u^2 - 2 u^3 = 0.5 of its 4
    np.testing.assert_array_equal(found.positions, CORNERS + np.float32([0, 2, 0.25]))


ARM = np.float32([[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 2, 0]])
JOINTS = np.uint8([[0, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]])
WEIGHTS = np.float32([[2, 0, 0, 0], [0.5, 0.5, 0, 0], [1, 0, 0, 0], [0.5, 0, 0, 0]])  # two are not of sum 1


def arm(file, root_place=(0, 0, 0), **attributes):
    """Two joints up the y axis, the elbow at (0, 1, 0), and a strip of skin; nodes: arm, shoulder, elbow."""
    attributes = {"JOINTS_0": JOINTS, "WEIGHTS_0": WEIGHTS, **attributes}
    mesh = file.mesh(ARM, [[0, 3, 1], [1, 3, 2]], **attributes)
    node = file.node(mesh=mesh, name="arm", translation=[100, 100, 100], scale=[7, 7, 7])  # glTF: to be ignored
    shoulder = file.node(name="shoulder", children=[node + 2], translation=list(root_place))
    elbow = file.node(name="elbow", translation=[0, 1, 0])
    file.json["nodes"][node]["skin"] = file.skin([shoulder, elbow], [np.eye(4), moved(0, -1, 0)])
    return node, shoulder, elbow


def test_two_joints_by_hand(tmp_path):
    file = GltfFile()
    _, shoulder, elbow = arm(file, (10, 0, 0), NORMAL=np.float32([[1, 0, 0]] * 4))
    file.clip((elbow, "rotation", [0, 1], [turned_about_z(0), turned_about_z(90)], "LINEAR"))
    scene = file.load(tmp_path)
    assert [item.moves for item in scene.objects] == [True] and scene.meshes[0].deforms
    shift = np.array([10, 0, 0])
    np.testing.assert_allclose(world_vertices(scene, 0, 0), ARM + shift, atol=10 * FLOAT32)
    # bent by 90 degrees about (0, 1, 0): (0, 2) -> (-1, 1) and (1, 2) -> (-1, 2); the elbow itself stays
    bent = np.array([[0, 0, 0], [0, 1, 0], [-1, 1, 0], [-1, 2, 0]])
    np.testing.assert_allclose(world_vertices(scene, 0, 1), bent + shift, atol=10 * FLOAT32)
    # half and half of 0 and 90 degrees: the blended matrix turns by 45 and scales by cos 45
    half = np.sqrt(0.5)
    expected = [[1, 0, 0], [half, half, 0], [0, 1, 0], [0, 1, 0]]
    np.testing.assert_allclose(scene.deformed(1)[0].normals, expected, atol=4 * FLOAT32)


def test_normals_under_uneven_scale_of_a_joint(tmp_path):
    file = GltfFile()
    _, _, elbow = arm(file, NORMAL=np.float32([[0, 0.6, 0.8]] * 4))
    file.clip((elbow, "scale", [0, 1], [[1, 1, 1], [1, -2, 4]], "STEP"))
    normals = file.load(tmp_path).deformed(1)[0].normals
    slanted = np.array([0, 0.6 / -2, 0.8 / 4])  # inverse transpose of diag(1, -2, 4)
    np.testing.assert_allclose(normals[2], slanted / np.linalg.norm(slanted), atol=2 * FLOAT32)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=2 * FLOAT32)


def test_more_than_four_joints_per_vertex(tmp_path):
    file = GltfFile()
    joints = [file.node(translation=[k, 0, 0]) for k in range(6)]
    root = file.node(children=joints)
    influences = {"JOINTS_0": np.uint16([[0, 1, 2, 3]] * 3), "WEIGHTS_0": np.uint8([[51] * 4] * 3)}
    mesh = file.mesh(**influences, JOINTS_1=np.uint16([[4, 5, 0, 0]] * 3), WEIGHTS_1=np.uint8([[51, 51, 0, 0]] * 3))
    for name, accessor in file.json["meshes"][mesh]["primitives"][0]["attributes"].items():
        file.json["accessors"][accessor]["normalized"] = name.startswith("WEIGHTS")
    file.node(mesh=mesh, skin=file.skin(joints))
    scene = file.load(tmp_path)
    assert root == 6 and not scene.moves and not scene.meshes[0].deforms
    # six equal weights that add up to 1.2: the mean of translations 0 to 5
    np.testing.assert_allclose(world_vertices(scene, 0, 0), CORNERS + [2.5, 0, 0], atol=4 * FLOAT32)


def test_morph_targets_act_before_the_skin(tmp_path):
    file = GltfFile()
    node, _, elbow = arm(file, targets=[{"POSITION": np.float32([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]])}])
    turn = [turned_about_z(0), turned_about_z(90)]
    file.clip((elbow, "rotation", [0, 1], turn, "LINEAR"), (node, "weights", [0, 1], [0, 1], "LINEAR"))
    np.testing.assert_allclose(world_vertices(file.load(tmp_path), 0, 1)[2], [-2, 1, 0], atol=4 * FLOAT32)


@pytest.mark.parametrize("far_below_the_root", [False, True])
def test_a_figure_far_from_the_origin_keeps_its_shape(tmp_path, far_below_the_root):
    """Its float32 vertices err by a share of the figure's size, not of the way to the origin."""
    file = GltfFile()
    place = (1e6, -1e6, 1e6)
    _, shoulder, elbow = arm(file, place if not far_below_the_root else (0, 0, 0))
    skin = file.json["skins"][0]
    top = file.node(name="top", children=[shoulder])
    skin["skeleton"] = top
    if far_below_the_root:  # both joints far below the node that they share
        nodes = file.json["nodes"]
        nodes[shoulder].update(children=[], translation=list(place))
        nodes[elbow]["translation"] = [place[0], place[1] + 1, place[2]]
        nodes[top]["children"] = [shoulder, elbow]
    file.clip((elbow, "rotation", [0, 1], [turned_about_z(0), turned_about_z(90)], "STEP"))
    scene = file.load(tmp_path)
    bent = np.array([[0, 0, 0], [0, 1, 0], [-1, 1, 0], [-1, 2, 0]])
    # float32 on a figure of size 2, and float64 on matrices of 1e6
    np.testing.assert_allclose(world_vertices(scene, 0, 1) - place, bent, atol=2 * FLOAT32 + 4e6 * 2.0**-52)
    assert np.abs(scene.deformed(1)[0].positions).max() < 4


def test_a_skeleton_that_moves_as_a_whole_deforms_nothing(tmp_path):
    file = GltfFile()
    _, shoulder, _ = arm(file)
    file.clip((shoulder, "translation", [0, 1], [[0, 0, 0], [0, 0, 5]], "LINEAR"))
    scene = file.load(tmp_path)
    assert scene.moves and not scene.meshes[0].deforms and scene.deformed is None
    np.testing.assert_allclose(world_vertices(scene, 0, 1), ARM + [0, 0, 5], atol=5 * FLOAT32)


def test_what_did_not_change_is_not_rebuilt(tmp_path):
    file = GltfFile()
    _, _, elbow = arm(file)
    file.clip((elbow, "rotation", [0, 1], [turned_about_z(0), turned_about_z(90)], "LINEAR"))
    scene = file.load(tmp_path)
    now, before = scene.deformed(0.5), scene.deformed(0.25)
    assert scene.deformed(0.5)[0] is now[0] and now[0] is not before[0]
    assert scene.deformed(7)[0] is scene.deformed(8)[0]  # past the last key it stands


def test_skins_without_a_common_root_stand_in_the_world(tmp_path):
    file = GltfFile()
    joints = [file.node(translation=[0, 0, 1]), file.node(translation=[0, 0, 3])]
    mesh = file.mesh(JOINTS_0=np.uint8([[0, 1, 0, 0]] * 3), WEIGHTS_0=np.float32([[0.5, 0.5, 0, 0]] * 3))
    file.node(mesh=mesh, skin=file.skin(joints))
    np.testing.assert_allclose(world_vertices(file.load(tmp_path), 0, 0), CORNERS + [0, 0, 2], atol=4 * FLOAT32)


IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
CHANNEL = {"sampler": 0, "target": {"node": 2, "path": "rotation"}}
ABSENT = object()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"nodes.2.matrix": IDENTITY}, "a matrix beside translation"),
        ({"nodes.2.matrix": IDENTITY, "nodes.2.translation": ABSENT}, "node 2 is animated and has a matrix"),
        ({"nodes.2.matrix": [1.0] * 16, "nodes.2.translation": ABSENT}, "last row"),
        ({"nodes.2.rotation": [0, 0, 0, 0]}, r"nodes\[2\]: a rotation of length 0"),
        ({"nodes.2.children": [1]}, "its own ancestor"),
        ({"nodes.0.children": [2]}, "two parents"),
        ({"nodes.1.children": [7]}, "names 7 of nodes, there are 3"),
        ({"nodes.0.skin": 4}, "names 4 of skins, there are 1"),
        ({"nodes.0.weights": [1.0]}, "1 weights of node 0 for 0 morph targets"),
        ({"nodes.0.mesh": "x"}, r'nodes\[0\].mesh: a whole number from 0 was expected, "x" came'),
        ({"nodes.0.scale": [1, 2]}, r"nodes\[0\].scale: 3 numbers was expected, \[1, 2\] came"),
        ({"skins.0.joints": []}, r"skins\[0\]: no joints"),
        ({"skins.0.joints": [1]}, r"meshes\[0\].primitives\[0\]: joint 1 of a skin of 1"),
        ({"skins.0.joints": [1, 2, 0]}, "2 inverse bind matrices for 3 joints"),
        ({"meshes.0.primitives.0.attributes.JOINTS_0": ABSENT}, "without JOINTS_0"),
        ({"meshes.0.primitives.0.mode": 4, "accessors.3.count": 5}, "5 corners are no triangles"),
        ({"animations.0.samplers.0.interpolation": "CUBIC"}, "interpolation 'CUBIC'"),
        ({"animations.0.samplers.0.input": 4}, r"animations\[0\].channels\[0\], accessors\[4\]: type SCALAR was"),
        ({"animations.0.samplers.0.interpolation": "CUBICSPLINE"}, "2 values for 2 keys of CUBICSPLINE rotation"),
        ({"animations.0.channels.0.sampler": 2}, "names sampler 2, there are 1"),
        ({"animations.0.channels.0.target.path": "colour"}, "path 'colour'"),
        ({"animations.0.channels": [CHANNEL, CHANNEL]}, "two channels move the rotation of node 2"),
        ({"accessors.0.count": 99}, r"accessors\[0\]: needs 1188 bytes of a buffer view of 48"),
        ({"accessors.0.componentType": 5124}, "component type 5124"),
        ({"accessors.0.count": 10**12}, r"accessors\[0\]: needs 1\d+ bytes of a buffer view of 48"),
        ({"bufferViews.0.byteLength": 10**6}, "buffer view 0 ends at byte 1000000"),
        ({"accessors.6": ABSENT}, "names 6 of accessors, there are 6"),
        ({"asset.version": "1.0"}, "asset.version: glTF 1.0: only 2 is read"),
        ({"asset": ABSENT}, "asset in it was expected"),
    ],
    ids=lambda item: "-".join(item) if isinstance(item, dict) else "",
)
def test_damaged_files_are_named(tmp_path, changes, says):
    file = bent_arm()
    for path, value in changes.items():
        *keys, last = (int(key) if key.isdigit() else key for key in path.split("."))
        inner = file.json
        for key in keys:
            inner = inner[key]
        if value is ABSENT:
            del inner[last]
        else:
            inner[last] = value
    with pytest.raises(InputError, match=f"^{re.escape(str(tmp_path))}/scene.gltf[,:] .*{says}"):
        file.load(tmp_path)


def bent_arm(**attributes):
    file = GltfFile()
    _, _, elbow = arm(file, **attributes)
    file.clip((elbow, "rotation", [0, 1], [turned_about_z(0), turned_about_z(90)], "LINEAR"))
    return file


def test_keys_out_of_order_are_named(tmp_path):
    with pytest.raises(InputError, match=r"animations\[0\].channels\[0\]: its times are none, or not in order"):
        animated(tmp_path, "translation", [1, 0], [[0, 0, 0], [1, 0, 0]])


def paths_in(value, path=()):
    """The way to every value inside a JSON document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from paths_in(inner, (*path, key))


@pytest.mark.parametrize("wrong", [None, "x", -1, 0.5, 10**9, [], {}, True], ids=str)
def test_a_wrong_value_anywhere_gives_a_scene_or_one_input_error(tmp_path, wrong):
    file = bent_arm(targets=[{"POSITION": ARM}], NORMAL=np.float32([[1, 0, 0]] * 4))
    transform = {"KHR_texture_transform": {"offset": [0, 0], "scale": [1, 1], "rotation": 0.0}}
    pbr = {"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": {"index": 0, "extensions": transform}}
    sheen = {"KHR_materials_sheen": {"sheenColorFactor": [0, 0, 0]}}
    file.json["materials"] = [{"name": "m", "pbrMetallicRoughness": pbr, "extensions": sheen}]
    image(tmp_path / "t.png")
    file.json["images"] = [{"bufferView": file.view((tmp_path / "t.png").read_bytes())}]
    file.json["textures"], file.json["samplers"] = [{"source": 0, "sampler": 0}], [{"wrapS": 10497}]
    file.json["scenes"], file.json["scene"] = [{"nodes": [0, 1]}], 0
    file.json["meshes"][0]["primitives"][0]["material"] = 0
    written = file.save(tmp_path)
    assert len(load_scene(written).textures) == 1
    whole = json.loads(written.read_text())
    for path in list(paths_in(whole)):
        changed = json.loads(json.dumps(whole))
        inner = changed
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = wrong
        written.write_text(json.dumps(changed))
        try:
            scene = load_scene(written)
        except InputError as error:
            assert str(error).startswith(f"{written}"), path
        else:
            assert scene.world_from_object(0.5).shape == (len(scene.objects), 4, 4)


def test_glb_and_gltf_are_read_alike(tmp_path):
    file = bent_arm()
    text, binary = (load_scene(file.save(tmp_path, name)) for name in ("a.gltf", "a.glb"))
    np.testing.assert_array_equal(text.deformed(0.3)[0].positions, binary.deformed(0.3)[0].positions)


# Third-party files against a plain evaluation: JSON and arrays read anew, rotations by SciPy, one vertex at a time.


def opened(file):
    data = file.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + length]), data[28 + length :]

    def array(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        dtype = {5123: "<u2", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        start, size = view.get("byteOffset", 0) + accessor.get("byteOffset", 0), np.dtype(dtype).itemsize
        stride = view.get("byteStride", width * size)
        rows = [np.frombuffer(binary, dtype, width, start + k * stride) for k in range(accessor["count"])]
        return np.array(rows, dtype=float)

    return document, array


def plain_matrices(document, array, clip, t):
    """world_from_node of every node, with channels of linear interpolation."""
    parts = [dict(node) for node in document["nodes"]]
    for channel in document["animations"][clip]["channels"]:
        sampler = document["animations"][clip]["samplers"][channel["sampler"]]
        times, values, path = array(sampler["input"])[:, 0], array(sampler["output"]), channel["target"]["path"]
        clamped = np.clip(t, times[0], times[-1])
        if path == "rotation":
            value = Slerp(times, Rotation.from_quat(values))(clamped).as_quat()
        else:
            value = [np.interp(clamped, times, column) for column in values.T]
        parts[channel["target"]["node"]][path] = value

    def world(number):
        part = parts[number]
        if "matrix" in part:
            local = np.array(part["matrix"]).reshape(4, 4).T
        else:
            local = moved(*part.get("translation", (0, 0, 0)))
            turn = Rotation.from_quat(part.get("rotation", (0, 0, 0, 1))).as_matrix()
            local[:3, :3] = turn @ np.diag(part.get("scale", (1, 1, 1)))
        above = [k for k, node in enumerate(document["nodes"]) if number in node.get("children", ())]
        return world(above[0]) @ local if above else local

    return [world(number) for number in range(len(parts))]


@pytest.mark.parametrize("clip", ["Survey", "Walk", "Run"])
def test_the_fox_against_a_plain_evaluation(assets, clip):
    file = assets / "Fox" / "Fox.glb"
    scene = load_scene(file, clip)
    document, array = opened(file)
    number = [item["name"] for item in document["animations"]].index(clip)
    attributes, skin = document["meshes"][0]["primitives"][0]["attributes"], document["skins"][0]
    positions, joints, weights = (array(attributes[key]) for key in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
    binds = [matrix.reshape(4, 4).T for matrix in array(skin["inverseBindMatrices"])]
    others = {"Survey", "Walk", "Run"} - {clip}
    assert {text.split(":")[0] for text in scene.not_read} == {f"animation {name}" for name in others}
    assert scene.moves and scene.meshes[0].deforms and scene.meshes[0].normals is None
    for t in (0, 0.31, 0.75 * scene.animation_end_s, scene.animation_end_s + 1):
        worlds = plain_matrices(document, array, number, t)
        found = world_vertices(scene, 0, t)
        for vertex in range(0, len(positions), 41):
            share = weights[vertex] / weights[vertex].sum()
            point = np.array([*positions[vertex], 1])
            expected = sum(
                w * worlds[skin["joints"][int(j)]] @ binds[int(j)] @ point for w, j in zip(share, joints[vertex], strict=True)
            )
            np.testing.assert_allclose(found[vertex], expected[:3], atol=2 * 160 * FLOAT32)  # a fox is 160 long
        low, high = found.min(axis=0), found.max(axis=0)
        assert (high - low > 20).all() and (high - low < 200).all()


def test_the_truck_turns_its_wheels_alone(assets):
    file = assets / "CesiumMilkTruck" / "CesiumMilkTruck.glb"
    scene = load_scene(file)
    document, array = opened(file)
    assert [(item.name, item.moves) for item in scene.objects] == [
        ("Cesium_Milk_Truck/0", False), ("Cesium_Milk_Truck/1", False), ("Cesium_Milk_Truck/2", False),
        ("Wheels", True), ("Wheels (node 4)", True),
    ]  # fmt: skip
    for t in (0, 0.2, 0.9, 2):
        worlds = plain_matrices(document, array, 0, t)
        np.testing.assert_allclose(scene.world_from_object(t), [worlds[k] for k in (0, 0, 0, 2, 4)], atol=1e-14)
    assert np.abs(scene.world_from_object(0.1)[3] - scene.world_from_object(0.5)[3]).max() > 0.1


def test_the_morph_stress_test_against_a_plain_sum(assets):
    scene = load_scene(assets / "MorphStressTest" / "MorphStressTest.gltf")
    document = json.loads((assets / "MorphStressTest" / "MorphStressTest.gltf").read_text())
    mesh, channel = document["meshes"][0], document["animations"][0]["samplers"][0]

    def array(index):
        return inner_accessor(document, index)

    times, values = array(channel["input"])[:, 0], array(channel["output"]).reshape(-1, 8)
    for t in (0, 0.4, 1.7, scene.animation_end_s, 99):
        weights = [np.interp(t, times, column) for column in values.T]
        deformed = scene.deformed(t)
        for index, primitive in enumerate(mesh["primitives"]):
            for key, found in (("POSITION", deformed[index].positions), ("NORMAL", deformed[index].normals)):
                moves = [w * array(target[key]) for w, target in zip(weights, primitive["targets"], strict=True)]
                expected = array(primitive["attributes"][key]) + sum(moves)
                if key == "NORMAL":
                    expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
                np.testing.assert_allclose(found, expected, atol=4 * FLOAT32)
    assert all(item.moves for item in scene.objects)


def inner_accessor(document, index):
    """[count, width] float64 of a tight float accessor, from data inside the file."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    data = base64.b64decode(document["buffers"][view["buffer"]]["uri"].split(",")[1])
    width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(data, "<f4", accessor["count"] * width, start).reshape(-1, width).astype(float)


@pytest.mark.parametrize("name", ["FlightHelmet/FlightHelmet.gltf", "BreakfastRoom/BreakfastRoom.gltf"])
def test_still_files_equal_what_trimesh_reads(assets, name):
    scene, other = load_scene(assets / name), trimesh.load_scene(assets / name, process=False)
    assert not scene.moves and scene.deformed is None and scene.animation_end_s == 0
    np.testing.assert_allclose(scene_bounds(scene), other.bounds, atol=20 * FLOAT32)
    assert len(scene.objects) == len(other.graph.nodes_geometry)
    faces = sum(len(scene.meshes[item.mesh].faces) for item in scene.objects)
    assert faces == sum(len(other.geometry[other.graph[node][1]].faces) for node in other.graph.nodes_geometry)
    for mesh, stored in zip(scene.meshes, other.geometry.values(), strict=True):
        np.testing.assert_array_equal(mesh.positions, np.float32(stored.vertices))
        np.testing.assert_array_equal(mesh.faces, stored.faces)
        np.testing.assert_allclose(mesh.normals, stored.vertex_normals, atol=4 * FLOAT32)
