"""glTF's vertices: colours, sets of texture coordinates, tangents, and meshes that a node draws many times."""

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene import load_scene
from gltf_files import CORNERS, GltfFile, turned_about_z, world_vertices
from usd_stages import image

FLOAT32 = 2.0**-23
SETS = [np.float32([[k, 0.25], [k + 0.5, 0.75], [k, 1]]) for k in range(4)]
UP = np.float32([[0, 0, 1]] * 3)


def flipped(uv):
    return uv * [1, -1] + [0, 1]


def textured(folder, attributes, **sets):
    """One triangle with a material; sets: the set that each of the material's references reads."""
    image(folder / "t.png")
    pbr = {
        key: {"index": 0, "texCoord": n} for key, n in sets.items() if key in ("baseColorTexture", "metallicRoughnessTexture")
    }
    others = {key: {"index": 0, "texCoord": n} for key, n in sets.items() if key not in pbr}
    file = GltfFile(images=[{"uri": "t.png"}], textures=[{"source": 0}])
    file.json["materials"] = [{"name": "m", "pbrMetallicRoughness": pbr, **others}]
    file.node(mesh=file.mesh(primitive_keys={"material": 0}, **attributes), name="n")
    return file


@pytest.mark.parametrize("dtype", ["float32", "uint8", "uint16"])
@pytest.mark.parametrize("width", [3, 4])
def test_vertex_colours_of_every_type(tmp_path, dtype, width):
    shares = np.array([[0, 0.2, 0.4, 0.6], [0.8, 1, 0, 0.2], [0.4, 0.6, 0.8, 1]])[:, :width]
    most = 1 if dtype == "float32" else np.iinfo(dtype).max
    file = GltfFile()
    # rows of 8 and 4 bytes, as glTF aligns them, keep their padding out of the colours
    padded = np.zeros((3, 4), dtype)
    padded[:, :width] = (shares * most).round() if dtype != "float32" else shares
    view = file.view(padded.tobytes(), byteStride=4 * padded.itemsize)
    code = {"float32": 5126, "uint8": 5121, "uint16": 5123}[dtype]
    colors = {"bufferView": view, "componentType": code, "count": 3, "type": f"VEC{width}", "normalized": dtype != "float32"}
    file.node(mesh=file.mesh(COLOR_0=file._add("accessors", colors)))
    found = file.load(tmp_path).meshes[0].colors
    assert found.dtype == np.float32 and found.shape == (3, 4)
    np.testing.assert_allclose(found[:, :width], shares, atol=FLOAT32)  # 0.2 is whole numbers of 255 and of 65535
    assert width == 4 or (found[:, 3] == 1).all()


def test_vertex_colours_are_clamped(tmp_path):
    file = GltfFile()
    file.node(mesh=file.mesh(COLOR_0=np.float32([[-1, 0.5, 7], [0, 1, 2], [0, 0, 0]])))
    np.testing.assert_array_equal(file.load(tmp_path).meshes[0].colors[0], [0, 0.5, 1, 1])


def test_vertex_colours_of_meshes_that_deform(tmp_path):
    file = GltfFile()
    colors = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    node = file.node(mesh=file.mesh(targets=[{"POSITION": UP}], COLOR_0=colors))
    file.clip((node, "weights", [0, 1], [0, 1], "LINEAR"))
    mesh = file.load(tmp_path).meshes[0]
    assert mesh.deforms
    np.testing.assert_array_equal(mesh.colors[:, :3], colors)


@pytest.mark.parametrize(
    ("read", "uv", "uv2", "uv_sets"),
    [
        ({"baseColorTexture": 0}, 0, None, (0, None)),
        ({"baseColorTexture": 1}, 1, None, (0, None)),
        ({"baseColorTexture": 0, "normalTexture": 1}, 0, 1, (0, 1)),
        ({"baseColorTexture": 1, "normalTexture": 0}, 0, 1, (1, 0)),
        ({"baseColorTexture": 3, "normalTexture": 2}, 2, 3, (1, 0)),
        ({}, 0, None, (None, None)),
    ],
)
def test_the_sets_that_a_material_reads_become_uv_and_uv2(tmp_path, read, uv, uv2, uv_sets):
    file = textured(tmp_path, {f"TEXCOORD_{k}": values for k, values in enumerate(SETS)}, **read)
    scene = file.load(tmp_path)
    mesh, material = scene.meshes[0], scene.materials[0]
    np.testing.assert_array_equal(mesh.uv, flipped(SETS[uv]))
    assert mesh.uv2 is None if uv2 is None else (mesh.uv2 == flipped(SETS[uv2])).all()
    slots = material.base_texture, material.normal_texture
    assert tuple(slot.uv_set if slot else None for slot in slots) == uv_sets
    assert material.not_read == () and scene.not_read == ()


def test_the_set_of_a_texture_transform_stands_before_that_of_the_reference(tmp_path):
    file = textured(tmp_path, {"TEXCOORD_0": SETS[0], "TEXCOORD_1": SETS[1]}, normalTexture=0, emissiveTexture=0)
    file.json["materials"][0]["emissiveTexture"]["extensions"] = {"KHR_texture_transform": {"texCoord": 1, "offset": [0.5, 0]}}
    material = file.load(tmp_path).materials[0]
    assert (material.normal_texture.uv_set, material.emission_texture.uv_set) == (0, 1)
    assert material.emission_texture.uv == ((1, 0, 0.5), (0, 1, 0))


def test_a_third_set_is_named(tmp_path):
    sets = {"baseColorTexture": 0, "metallicRoughnessTexture": 2, "normalTexture": 1, "emissiveTexture": 2}
    file = textured(tmp_path, {f"TEXCOORD_{k}": values for k, values in enumerate(SETS)}, **sets)
    material = file.load(tmp_path).materials[0]
    told = "texCoord 2 of metallicRoughnessTexture", "texCoord 2 of emissiveTexture"
    assert material.not_read == tuple(f"{text}: it is read with 0" for text in told)
    assert (material.surface_texture.uv_set, material.normal_texture.uv_set) == (0, 1)


def test_the_set_of_an_occlusion_map_takes_no_place(tmp_path):
    file = textured(tmp_path, {"TEXCOORD_0": SETS[0]}, baseColorTexture=0, occlusionTexture=1)
    scene = file.load(tmp_path)
    assert scene.meshes[0].uv2 is None and scene.not_read == () and scene.materials[0].not_read == ("occlusion map",)


def test_sets_that_the_mesh_lacks_are_named(tmp_path):
    file = textured(tmp_path, {"TEXCOORD_0": SETS[0]}, baseColorTexture=0, normalTexture=1)
    scene = file.load(tmp_path)
    assert scene.meshes[0].uv2 is None and scene.not_read == ("textures of n by TEXCOORD_1, which its mesh lacks",)


SQUARE = np.float32([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]])  # seen from +z, counter-clockwise
SQUARE_UP = np.float32([[0, 0, 1]] * 4)


def square(folder, uv, tangents, *, normals=SQUARE_UP, key="normalTexture", **node_keys):
    image(folder / "t.png")
    file = GltfFile(images=[{"uri": "t.png"}], textures=[{"source": 0}], materials=[{key: {"index": 0}}])
    attributes = {} if normals is None else {"NORMAL": np.float32(normals)}
    mesh = file.mesh(
        SQUARE, [[0, 1, 2], [0, 2, 3]], primitive_keys={"material": 0}, TEXCOORD_0=np.float32(uv), TANGENT=np.float32(tangents),
        **attributes,
    )  # fmt: skip
    file.node(mesh=mesh, name="n", **node_keys)
    return file


UPRIGHT = [[0, 1], [1, 1], [1, 0], [0, 0]]  # glTF's (0, 0) is the image's upper left corner
MIRRORED = [[1, 1], [0, 1], [0, 0], [1, 0]]


@pytest.mark.parametrize(("uv", "along", "sign"), [(UPRIGHT, [1, 0, 0], 1), (MIRRORED, [-1, 0, 0], -1)])
def test_tangents_of_an_image_on_a_square(tmp_path, uv, along, sign):
    """Upright, u grows with x, and the image's top, where our v grows to, is +y = cross(z, x): sign 1. Mirrored, u falls
    with x and cross(z, -x) = -y, so that the sign is -1. glTF's own rule for w gives these (MikkTSpace with v up)."""
    mesh = square(tmp_path, uv, [[*along, sign]] * 4).load(tmp_path).meshes[0]
    np.testing.assert_array_equal(mesh.tangents, [[*along, sign]] * 4)
    edge_x, edge_y = mesh.uv[1] - mesh.uv[0], mesh.uv[3] - mesh.uv[0]  # over 2 in x, over 3 in y
    tangent, bitangent = mesh.tangents[0, :3], np.cross(SQUARE_UP[0], mesh.tangents[0, :3]) * mesh.tangents[0, 3]
    assert edge_x[0] * tangent[0] > 0 and edge_x[1] == 0  # u grows along the tangent
    assert edge_y[1] * bitangent[1] > 0 and edge_y[0] == 0  # v up grows along the bitangent


def test_tangents_have_unit_length_and_signs_of_1(tmp_path):
    mesh = square(tmp_path, UPRIGHT, [[2, 0, 0, 0.5], [0, 0.1, 0, -0.25], [3, 4, 0, 1], [0, 0, 0, -1]]).load(tmp_path).meshes[0]
    np.testing.assert_allclose(mesh.tangents[:3], [[1, 0, 0, 1], [0, 1, 0, -1], [0.6, 0.8, 0, 1]], atol=FLOAT32)
    lost = mesh.tangents[3]
    assert lost[2] == 0 and np.linalg.norm(lost[:3]) == pytest.approx(1, abs=FLOAT32) and lost[3] == -1


def test_tangents_without_normals_or_without_a_normal_map_are_left_out(tmp_path):
    tangents = [[1, 0, 0, 1]] * 4
    for keys in ({"normals": None}, {"key": "emissiveTexture"}):
        scene = square(tmp_path, UPRIGHT, tangents, **keys).load(tmp_path)
        assert scene.meshes[0].tangents is None and scene.not_read == ()


@pytest.mark.parametrize(("key", "says"), [("normalTexture", True), ("emissiveTexture", False)])
def test_tangents_of_what_deforms_are_left_out_and_named_where_a_normal_map_asks(tmp_path, key, says):
    file = square(tmp_path, UPRIGHT, [[1, 0, 0, 1]] * 4, key=key)
    file.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": file.accessor(SQUARE)}]
    file.clip((0, "weights", [0, 1], [0, 1], "LINEAR"))
    scene = file.load(tmp_path)
    assert scene.meshes[0].tangents is None and scene.meshes[0].deforms
    told = "tangents of n, whose vertices move: they are taken from its texture coordinates"
    assert scene.not_read == ((told,) if says else ())


def test_tangents_of_the_flight_helmet_run_with_u_and_v_up(assets):
    scene = load_scene(assets / "FlightHelmet" / "FlightHelmet.gltf")
    for mesh in scene.meshes:
        np.testing.assert_allclose(np.linalg.norm(mesh.tangents[:, :3], axis=1), 1, atol=2 * FLOAT32)
        points, uv = mesh.positions[mesh.faces].astype(float), mesh.uv[mesh.faces].astype(float)
        edges, steps = points[:, 1:] - points[:, :1], uv[:, 1:] - uv[:, :1]
        whole = np.abs(np.linalg.det(steps)) > 1e-12
        along = np.linalg.solve(steps[whole], edges[whole])  # rows: change of place with u, with v
        tangent, normal = mesh.tangents[mesh.faces[whole, 0]].astype(float), mesh.normals[mesh.faces[whole, 0]].astype(float)
        bitangent = np.cross(normal, tangent[:, :3]) * tangent[:, 3:]
        agree = [(along[:, k] * axis).sum(axis=1) > 0 for k, axis in enumerate((tangent[:, :3], bitangent))]
        # exporters average over seams: 0.5 % of the triangles of its metal parts disagree
        assert np.mean(agree[0]) > 0.99 and np.mean(agree[1]) > 0.99


@pytest.mark.parametrize("name", ["TEXCOORD_0", "COLOR_0", "TANGENT"])
def test_attributes_of_another_length_are_named(tmp_path, name):
    file = square(tmp_path, UPRIGHT, [[1, 0, 0, 1]] * 4)
    width = {"TEXCOORD_0": 2, "COLOR_0": 3, "TANGENT": 4}[name]
    file.json["meshes"][0]["primitives"][0]["attributes"][name] = file.accessor(np.ones((3, width), np.float32))
    what = {"TEXCOORD_0": "texture coordinates", "COLOR_0": "vertex colours", "TANGENT": "tangents"}[name]
    with pytest.raises(InputError, match=rf"meshes\[0\].primitives\[0\]: 3 {what} of 4 vertices"):
        file.load(tmp_path)


INSTANCING = "EXT_mesh_gpu_instancing"


def instanced(file, mesh, **attributes):
    attributes = {key: file.accessor(values) for key, values in attributes.items()}
    return file.node(mesh=mesh, name="n", extensions={INSTANCING: {"attributes": attributes}}, translation=[0, 10, 0])


def test_a_mesh_that_its_node_draws_many_times(tmp_path):
    file = GltfFile(extensionsUsed=[INSTANCING], extensionsRequired=[INSTANCING])
    values = {"TRANSLATION": np.float32([[1, 0, 0], [0, 2, 0]]), "SCALE": np.float32([[1, 1, 1], [2, 2, 2]])}
    node = instanced(file, file.mesh(), **values, ROTATION=np.float32([turned_about_z(0), turned_about_z(90)]))
    file.clip((node, "translation", [0, 1], [[0, 10, 0], [0, 10, 5]], "LINEAR"))
    scene = file.load(tmp_path)
    assert [item.name for item in scene.objects] == ["n (instance 0)", "n (instance 1)"]
    assert {item.mesh for item in scene.objects} == {0} and all(item.moves for item in scene.objects) and scene.not_read == ()
    np.testing.assert_array_equal(world_vertices(scene, 0, 1), CORNERS + [1, 10, 5])
    # twice as large, turned (x, y) -> (-y, x), moved by (0, 2) and by the node
    expected = [[0, 12, 5], [0, 14, 5], [-4, 12, 5]]
    np.testing.assert_allclose(world_vertices(scene, 1, 1), expected, atol=8 * FLOAT32)


def test_instances_whose_counts_differ_and_those_that_deform_are_refused(tmp_path):
    file = GltfFile()
    mesh = file.mesh(targets=[{"POSITION": UP}])
    node = instanced(file, mesh, TRANSLATION=np.zeros((2, 3), np.float32), SCALE=np.ones((3, 3), np.float32))
    with pytest.raises(InputError, match=rf"nodes\[0\].extensions.{INSTANCING}: attributes of \[2, 3\] instances"):
        file.load(tmp_path)
    del file.json["nodes"][0]["extensions"][INSTANCING]["attributes"]["SCALE"]
    assert len(file.load(tmp_path).objects) == 2
    file.clip((node, "weights", [0, 1], [0, 1], "LINEAR"))
    with pytest.raises(InputError, match=r"nodes\[0\]: instances of a mesh that deforms"):
        file.load(tmp_path)


def test_primitives_without_triangles_are_no_objects(tmp_path):
    file = GltfFile()
    file.node(mesh=file.mesh(CORNERS[:2], primitive_keys={"mode": 5}))
    file.node(mesh=file.mesh(CORNERS))
    file.json["accessors"][1]["count"] = 0
    with pytest.raises(InputError, match="no geometry in it"):
        file.load(tmp_path)
    file.node(mesh=file.mesh(), name="whole")
    assert [item.name for item in file.load(tmp_path).objects] == ["whole"]


def test_webp_images_are_preferred(tmp_path):
    Image.new("RGB", (6, 4), (200, 100, 50)).save(tmp_path / "t.webp", lossless=True)
    file = textured(tmp_path, {"TEXCOORD_0": SETS[0]}, baseColorTexture=0)
    file.json["images"].append({"uri": "t.webp"})
    file.json["textures"][0]["extensions"] = {"EXT_texture_webp": {"source": 1}}
    file.json["extensionsRequired"] = file.json["extensionsUsed"] = ["EXT_texture_webp"]
    scene = file.load(tmp_path)
    assert [item.name for item in scene.files] == ["scene.gltf", "t.webp"] and scene.not_read == ()
    assert (scene.textures[0].texels == [200, 100, 50, 255]).all() and scene.textures[0].texels.shape == (4, 6, 4)


def test_images_of_the_same_bytes_are_decoded_once(tmp_path):
    file = textured(tmp_path, {"TEXCOORD_0": SETS[0]}, baseColorTexture=0, emissiveTexture=0)
    file.json["images"] = [{"uri": "t.png"}, {"uri": "t.png"}]
    file.json["textures"] = [{"source": 0}, {"source": 1}]
    file.json["materials"][0]["emissiveTexture"]["index"] = 1
    assert len(file.load(tmp_path).textures) == 1
