"""glTF that is damaged or hostile: one InputError that names the place, no crash, no wait, no memory beyond its means."""

import json
import random
import time
import tracemalloc

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene import load_scene
from gltf_files import CORNERS, GltfFile, turned_about_z
from usd_stages import image

LARGEST = 2**28 + 2**20  # bytes: what a small file may build, and what reading it takes besides


def triangle(**keys):
    file = GltfFile(**keys)
    file.node(mesh=file.mesh(), name="n")
    return file


def refused(folder, file, says, seconds=5):
    """That reading ends in an InputError with these words, soon, and without more memory than SPARE_BYTES."""
    written = file.save(folder)
    tracemalloc.start()
    start = time.process_time()
    try:
        with pytest.raises(InputError, match=says) as caught:
            load_scene(written)
        assert time.process_time() - start < seconds and tracemalloc.get_traced_memory()[1] < LARGEST
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith(str(written))


def outside(folder):
    """A folder of a scene, beside which lie an image and a buffer that it must not read."""
    image(folder / "secret.png")
    (folder / "secret.bin").write_bytes(bytes(100))
    inner = folder / "scene"
    inner.mkdir()
    image(inner / "mine.png")
    return inner


ESCAPES = [
    "../secret{}",
    "..%2Fsecret{}",
    "%2e%2e/secret{}",
    "{folder}/secret{}",
    "./a/../../secret{}",
    "//{folder}/secret{}",
    "link{}",
    "inner/link{}",
]


@pytest.mark.parametrize("uri", ESCAPES)
@pytest.mark.parametrize("kind", [".bin", ".png"])
def test_files_outside_the_scene_s_folder_are_refused(tmp_path, uri, kind):
    folder = outside(tmp_path)
    (folder / f"link{kind}").symlink_to(tmp_path / f"secret{kind}")
    (folder / "inner").symlink_to(folder)
    named = uri.format(kind, folder=tmp_path)
    file = triangle()
    if kind == ".bin":
        file.json["buffers"] = [{"byteLength": 36, "uri": named}]
        written, field = folder / "scene.gltf", "buffers"
        written.write_text(json.dumps(file.json))
    else:
        file.json.update(images=[{"uri": named}], textures=[{"source": 0}], materials=[{"emissiveTexture": {"index": 0}}])
        file.json["meshes"][0]["primitives"][0]["material"] = 0
        written, field = file.save(folder), "images"
    with pytest.raises(InputError, match=rf"^{written}, {field}: .* lies outside the scene's folder"):
        load_scene(written)
    assert len(load_scene(written, allow_outside=True).files) == 2


@pytest.mark.parametrize("uri", ["http://x/a.bin", "https://x/a.bin", "file:///etc/hostname", "FILE:a.bin", "ftp://x/a.bin"])
def test_other_schemes_are_refused(tmp_path, uri):
    file = tmp_path / "scene.gltf"
    file.write_text(json.dumps({**triangle().json, "buffers": [{"byteLength": 36, "uri": uri}]}))
    for allow_outside in (False, True):
        with pytest.raises(InputError, match=rf"^{file}, buffers: {uri}: only data: and files beside it are read$"):
            load_scene(file, allow_outside=allow_outside)


@pytest.mark.parametrize("uri", [".", "folder", "a" * 5000, "\0.bin", "loop.bin"])
def test_names_that_are_no_files_are_refused(tmp_path, uri):
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop.bin").symlink_to(tmp_path / "loop.bin")
    file = tmp_path / "scene.gltf"
    file.write_text(json.dumps({**triangle().json, "buffers": [{"byteLength": 36, "uri": uri}]}))
    with pytest.raises(InputError, match=f"^{file}, buffers: "):
        load_scene(file)


def test_names_with_spaces_and_other_letters_are_read(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a b é%.bin").write_bytes(CORNERS.tobytes())
    file = tmp_path / "scene.gltf"
    for uri in ("sub/a%20b%20%C3%A9%25.bin", "./sub/../sub/a b é%25.bin"):
        file.write_text(json.dumps({**triangle().json, "buffers": [{"byteLength": 36, "uri": uri}]}))
        np.testing.assert_array_equal(load_scene(file).meshes[0].positions, CORNERS)


@pytest.mark.parametrize("count", [2**25, 10**9, 2**52])
@pytest.mark.parametrize("kind", ["VEC3", "MAT4"])
def test_counts_without_data_ask_for_no_memory(tmp_path, count, kind):
    file = triangle()
    target = "meshes" if kind == "VEC3" else "skins"
    index = file._add("accessors", {"componentType": 5126, "count": count, "type": kind})
    if target == "meshes":
        file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = index
    else:
        file.json["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}}]})
        file.node(mesh=1, skin=file._add("skins", {"joints": [0], "inverseBindMatrices": index}))
    refused(tmp_path, file, rf"accessors\[{index}\]: needs \d+ bytes of memory, more than")


def test_one_accessor_in_many_places_asks_for_no_memory(tmp_path):
    file = GltfFile()
    points, corners = file.accessor(np.tile(CORNERS, (10**4, 1))), file.accessor(np.zeros(3 * 10**5, np.uint8))
    primitive = {"attributes": {"POSITION": points, "TEXCOORD_0": file.accessor(np.zeros((3 * 10**4, 2), np.float32))}}
    file.node(mesh=file._add("meshes", {"primitives": [{**primitive, "indices": corners}] * 1000}))
    refused(tmp_path, file, r"primitives\[\d+\]: needs \d+ bytes of memory")


def test_many_instances_of_no_data_are_refused(tmp_path):
    file = triangle()
    places = file._add("accessors", {"componentType": 5126, "count": 10**6, "type": "VEC3"})
    file.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    refused(tmp_path, file, "EXT_mesh_gpu_instancing: needs")


@pytest.mark.parametrize(
    ("sparse", "says"),
    [
        ({"count": 2**50}, "needs 1125899906842624 bytes of a buffer view of 36"),
        ({"count": 5}, "needs 60 bytes of a buffer view of 36"),
        ({"indices": {"bufferView": 0, "componentType": 5126}}, "sparse indices of float32"),
        ({"indices": {"bufferView": 1, "componentType": 5121}}, "sparse index 200 of 3"),
        ({"values": {"bufferView": 9}}, "names 9 of bufferViews"),
        ({"values": {"bufferView": 0, "byteOffset": 2**50}}, "bytes of a buffer view"),
    ],
)
def test_sparse_values_that_cannot_be(tmp_path, sparse, says):
    file = triangle()
    file.view(bytes([200, 0, 0, 0]))
    whole = {"count": 1, "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 0}}
    file.json["accessors"][0]["sparse"] = {**whole, **sparse}
    refused(tmp_path, file, rf"accessors\[0\]: .*{says}|{says}")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "TRANSLATION", "times", "values"])
def test_numbers_that_are_none_are_named(tmp_path, value, name):
    file = GltfFile()
    width = 2 if name == "TEXCOORD_0" else 3
    bad = np.ones((3, width), np.float32)
    bad[1, 1] = value
    node = file.node(mesh=file.mesh(**({name: bad} if name.isupper() and name != "TRANSLATION" else {})))
    times, values = np.float32([0, 1, 2]), np.zeros((3, 3), np.float32)
    if name == "times":
        times[1] = value
    file.clip((node, "translation", times, bad if name == "values" else values, "LINEAR"))
    if name == "TRANSLATION":
        file.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {name: file.accessor(bad)}}}
    refused(tmp_path, file, r"accessors\[\d\]: values are not finite")


def test_indices_below_0_are_refused(tmp_path):
    file = triangle()
    file.json["meshes"][0]["primitives"][0]["indices"] = file.accessor(np.int8([0, 1, -1]))
    refused(tmp_path, file, r"accessors\[1\]: unsigned whole numbers were expected, int8 came")


def test_places_beyond_all_numbers_are_refused(tmp_path):
    file = GltfFile()
    file.node(scale=[1e299] * 3, children=[1])
    file.node(mesh=file.mesh(), scale=[1e299] * 3)
    refused(tmp_path, file, r"nodes\[1\]: its place in the world is not finite")


def test_deep_hierarchies_are_read(tmp_path):
    depth = 20000
    file = GltfFile()
    file.json["nodes"] = [{"children": [k + 1], "translation": [1, 0, 0]} for k in range(depth)]
    file.node(mesh=file.mesh(JOINTS_0=np.uint16([[0] * 4] * 3), WEIGHTS_0=np.float32([[1, 0, 0, 0]] * 3)))
    file.json["nodes"][-1]["skin"] = file.skin(list(range(depth)))
    file.json["scenes"] = [{"nodes": list(range(depth)) * 3}]
    start = time.process_time()
    scene = file.load(tmp_path)
    assert time.process_time() - start < 5
    np.testing.assert_array_equal(scene.world_from_object(0)[0, :3, 3], [1, 0, 0])


def test_more_nodes_than_are_read_are_refused(tmp_path):
    file = triangle()
    file.json["nodes"] += [{}] * 2**18
    refused(tmp_path, file, "nodes: 262145 nodes, at most 262144 are read")


def test_deep_json_is_refused(tmp_path):
    file = tmp_path / "scene.gltf"
    for depth in (900, 990, 10**5):
        file.write_text('{"asset": {"version": ' + "[" * depth + "]" * depth + "}}")
        with pytest.raises(InputError, match=f"^{file}"):
            load_scene(file)


@pytest.mark.parametrize("mode", [7, 100])
def test_modes_that_are_none_of_gltf_s(tmp_path, mode):
    file = triangle()
    file.json["meshes"][0]["primitives"][0]["mode"] = mode
    refused(tmp_path, file, rf"meshes\[0\].primitives\[0\]: mode {mode} is none")


def everything(folder):
    """A .glb of 2 kB in which all that is read stands."""
    file = GltfFile(extensionsUsed=["KHR_lights_punctual"])
    lights = [{"type": "spot", "spot": {"innerConeAngle": 0.5}, "range": 3}, {"type": "point", "intensity": 2}]
    file.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    file.json["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.5}},
        {"type": "orthographic", "orthographic": {"ymag": 1, "znear": 0, "zfar": 9}},
    ]
    file.json["materials"] = [
        {"normalTexture": {"index": 0, "texCoord": 1}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        {"extensions": {"KHR_materials_unlit": {}}, "doubleSided": True, "alphaMode": "BLEND"},
    ]
    image(folder / "t.png")
    file.json["images"] = [{"bufferView": file.view((folder / "t.png").read_bytes())}]
    file.json["textures"] = [{"source": 0}]
    uv = np.float32([[0, 0], [1, 0], [0, 1]])
    up = np.float32([[0, 0, 1]] * 3)
    plain = file.mesh(
        faces=[[0, 1, 2]], NORMAL=up, TANGENT=np.float32([[1, 0, 0, 1]] * 3), TEXCOORD_0=uv, TEXCOORD_1=uv,
        COLOR_0=np.uint8([[0, 1, 2, 3]] * 3), primitive_keys={"material": 0},
    )  # fmt: skip
    bent = file.mesh(
        targets=[{"POSITION": up}], JOINTS_0=np.uint8([[0, 1, 0, 0]] * 3), WEIGHTS_0=np.float32([[1, 1, 0, 0]] * 3),
        primitive_keys={"material": 1},
    )  # fmt: skip
    instances = {"attributes": {"TRANSLATION": file.accessor(up), "ROTATION": file.accessor(np.float32([[0, 0, 0, 1]] * 3))}}
    file.node(mesh=plain, extensions={"EXT_mesh_gpu_instancing": instances}, children=[3])
    file.node(mesh=bent, skin=file.skin([2, 3], [np.eye(4)] * 2))
    file.node(camera=0, extensions={"KHR_lights_punctual": {"light": 0}})
    file.node(camera=1, extensions={"KHR_lights_punctual": {"light": 1}})
    turn = [turned_about_z(0), turned_about_z(90)]
    file.clip((3, "rotation", [0, 1], turn, "LINEAR"), (1, "weights", [0, 1], [0, 1], "LINEAR"))
    file.json["scenes"] = [{"nodes": [0, 1, 2]}]
    return file


def seen(file):
    """The scene with all that it gives, or the message of its one error."""
    try:
        scene = load_scene(file)
    except InputError as error:
        assert str(error).startswith(str(file)), error
        return None
    for time_s in (0.0, 0.5):
        assert scene.world_from_object(time_s).shape == (len(scene.objects), 4, 4)
        assert len(scene.lights_at(time_s) if scene.lights_at else scene.lights) == len(scene.lights)
        assert all(np.isfinite(camera.at(time_s).world_from_camera).all() for camera in scene.cameras)
        assert scene.deformed is None or all(len(mesh.positions) for mesh in scene.deformed(time_s).values())
    return scene


def test_everything_is_read(tmp_path):
    scene = seen(everything(tmp_path).save(tmp_path, "a.glb"))
    assert (len(scene.objects), len(scene.lights), len(scene.cameras), len(scene.meshes)) == (4, 2, 2, 2)
    assert scene.meshes[0].uv2 is not None and scene.meshes[0].tangents is not None and scene.meshes[1].deforms


def places_in(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from places_in(inner, (*path, key))


@pytest.mark.parametrize("wrong", [None, "x", -1, 0, 1e-320, 1e299, 10**9, [], {}], ids=str)
def test_a_wrong_value_anywhere_gives_a_scene_or_one_error(tmp_path, wrong):
    written = everything(tmp_path).save(tmp_path)
    whole = json.loads(written.read_text())
    for path in list(places_in(whole)):
        changed = json.loads(json.dumps(whole))
        inner = changed
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = wrong
        written.write_text(json.dumps(changed))
        seen(written)


def test_bytes_that_fell_over_give_a_scene_or_one_error(tmp_path):
    written = everything(tmp_path).save(tmp_path, "a.glb")
    whole, chance = written.read_bytes(), random.Random(1)
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(chance.choice((1, 2, 8))):
            data[chance.randrange(len(data))] = chance.randrange(256)
        written.write_bytes(data[: chance.choice((len(data), chance.randrange(len(data))))])
        seen(written)
