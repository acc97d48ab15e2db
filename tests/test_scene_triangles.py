"""OBJ, PLY, STL and OFF through trimesh: numbers exact, colours decoded, groups and files found, what is missing named."""

import numpy as np
import pytest
import trimesh

from framepairs.errors import InputError
from framepairs.scene import load_scene, scene_hash
from framepairs.scene.containment import reach_of
from framepairs.scene.triangles import read_meshes
from usd_stages import image

UV = np.float32([[0, 0], [1, 0], [0, 0.25]])
HALF = ((128 / 255 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
OBJ = """mtllib a.mtl
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
vt 0 0\nvt 1 0\nvt 0 0.25\nvn 0 0 1
usemtl red\nf 1/1/1 2/2/1 3/3/1
usemtl blue\nf 1/1/1 2/2/1 4/3/1
"""
MTL = "newmtl red\nKd 1 0 0\nmap_Kd t.png\nnewmtl blue\nKd 0.2 0.4 0.6\n"
POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
XYZ = ("property float x", "property float y", "property float z")
FACES = "property list uchar int vertex_indices"


def obj(folder, text=OBJ, mtl=MTL):
    image(folder / "t.png")
    (folder / "a.mtl").write_text(mtl)
    (folder / "a.obj").write_text(text)
    return folder / "a.obj"


def ply(folder, vertices, faces, body, form="ascii", comments=()):
    """The file of a PLY: the property lines of vertices and faces as (count, *lines), and what stands behind the header."""
    lines = ["ply", f"format {form} 1.0", *(f"comment {comment}" for comment in comments)]
    for name, (count, *properties) in (("vertex", vertices), ("face", faces)):
        lines += [f"element {name} {count}", *properties]
    file = folder / "a.ply"
    file.write_bytes("\n".join([*lines, "end_header\n"]).encode() + (body.encode() if isinstance(body, str) else body))
    return file


def only_mesh(file):
    (mesh,) = load_scene(file).meshes
    return mesh


def corners(mesh, name="positions"):
    """[T, 3, k]: what stands at the corners of the triangles."""
    return getattr(mesh, name)[mesh.faces]


def named(scene):
    return {item.name: scene.meshes[item.mesh] for item in scene.objects}


def test_obj_files_keep_materials_uv_and_normals(tmp_path):
    scene = load_scene(obj(tmp_path))
    found = {material.name: material for material in scene.materials}
    assert found["blue"].base_color == (0.2, 0.4, 0.6) and found["blue"].base_texture is None
    assert scene.textures[found["red"].base_texture.texture].texels.shape == (5, 7, 4)
    mesh = next(mesh for mesh in scene.meshes if mesh.name == "blue")
    np.testing.assert_array_equal(corners(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(corners(mesh, "uv")[0], UV)
    np.testing.assert_array_equal(mesh.normals, np.tile([0, 0, 1], (3, 1)))


def test_objects_and_groups_are_objects_and_materials_split_them(tmp_path):
    house = "o house\ng roof\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 2 4\ng wall\nf 2 3 4\n"
    tree_and_roof = "o tree\nf 1 3 4\ng roof\no house\nf 1 2 3\n"
    scene = load_scene(obj(tmp_path, "mtllib a.mtl\n" + POINTS + house + tree_and_roof))
    names = ["house_roof_red", "house_roof_blue", "house_wall_blue", "tree_wall_blue"]
    assert [item.name for item in scene.objects] == names and [len(mesh.faces) for mesh in scene.meshes] == [1, 2, 1, 1]
    assert [scene.materials[item.material].name for item in scene.objects] == ["red", "blue", "blue", "blue"]


def test_objects_stand_in_the_order_of_the_file(tmp_path):
    text = "o a\ng x\nf 1 2 3\no b\nf 1 2 3\no a\ng y\nf 1 2 3\n"
    assert [item.name for item in load_scene(obj(tmp_path, POINTS + text)).objects] == ["a_x", "b_x", "a_y"]


def test_without_usemtl_nothing_is_missing(tmp_path):
    scene = load_scene(obj(tmp_path, OBJ.replace("usemtl red\n", "o a\n").replace("usemtl blue\n", "")))
    assert scene.not_read == () and [material.name for material in scene.materials] == ["default"]


def test_names_of_materials_may_hold_spaces(tmp_path):
    text, mtl = OBJ.replace("usemtl red", "usemtl dark  red"), MTL.replace("newmtl red", "newmtl dark  red")
    assert {material.name for material in load_scene(obj(tmp_path, text, mtl)).materials} == {"dark red", "blue"}


def test_a_file_without_names_goes_by_its_own(tmp_path):
    assert [item.name for item in load_scene(obj(tmp_path, POINTS + "f 1 2 3\n")).objects] == ["a.obj"]


def test_polygons_are_fans_and_corners_share_vertices(tmp_path):
    points = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    mesh = only_mesh(obj(tmp_path, POINTS + "f 1 2 3 4\nf 1 2\nf 1 2 3\n"))
    np.testing.assert_array_equal(corners(mesh), points[[[0, 1, 2], [2, 3, 0], [0, 1, 2]]])
    assert load_scene(tmp_path / "a.obj").not_read == ("1 faces with fewer than 3 corners",)
    pentagon = corners(only_mesh(obj(tmp_path, POINTS + "f 1 2 3 4 2\n")))
    np.testing.assert_array_equal(pentagon, points[[[0, 1, 2], [0, 2, 3], [0, 3, 1]]])
    assert len(only_mesh(obj(tmp_path, POINTS + "f 1 2 3\nf 1 2 4\n")).positions) == 4


@pytest.mark.parametrize("corner", ["2//9", "2"], ids=["none", "some"])
def test_what_only_some_corners_have_is_named(tmp_path, corner):
    scene = load_scene(obj(tmp_path, POINTS + f"vn 1 0 0\nf 1//1 2//1 3//1\no b\nf 1//1 2//1 3//1\nf 1//1 {corner} 4//1\n"))
    np.testing.assert_array_equal(named(scene)["a.obj"].normals, [[1, 0, 0]] * 3)
    assert named(scene)["b"].normals is None
    assert scene.not_read == ("normals of 1 meshes, as b: not all of their corners have some",)


def test_kinds_of_corners_that_look_alike_stand_in_meshes_of_their_own(tmp_path):
    text = POINTS + "vt 0 1\nvt 0 0.5\nvn 0 0 1\nvn 1 0 0\no a\nf 1/2 2/2 3/2\n{}f 1//2 2//2 4//2\n"
    meshes = named(load_scene(obj(tmp_path, text.format("o b\n"))))
    np.testing.assert_array_equal(meshes["a"].uv, [[0, 0.5]] * 3)
    np.testing.assert_array_equal(meshes["b"].normals, [[1, 0, 0]] * 3)
    assert meshes["a"].normals is None and meshes["b"].uv is None
    with pytest.raises(InputError, match="several kinds in one group, as 'f 1//2 2//2 4//2'"):
        load_scene(obj(tmp_path, text.format("")))


def test_negative_indices_count_back_from_their_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.5\nf -3/-1 -2/-1 -1/-1\nv 5 0 0\nvt 0 1\nf 1/-1 2/-1 -1/-1\n"
    mesh = only_mesh(obj(tmp_path, text))
    np.testing.assert_array_equal(corners(mesh), [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0], [5, 0, 0]]])
    np.testing.assert_array_equal(corners(mesh, "uv")[:, 0], [[0, 0.5], [0, 1]])


@pytest.mark.parametrize(
    "change",
    [
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("f 1", "f \\\n1"),
        ("v 1", "  v\t1"),
        ("f 1/1/1", "f 1/1/1#"),
        ("v 0 0 1\n", "v 0 0 1 # peak\n"),
    ],
)
def test_spellings_of_obj(tmp_path, change):
    text = OBJ.replace(*change).replace("1#", "1")
    mesh = next(mesh for mesh in load_scene(obj(tmp_path, text)).meshes if mesh.name == "blue")
    np.testing.assert_array_equal(corners(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(("codes", "largest"), [("0.5019608", 1), ("128", 255)])
def test_colours_of_obj_are_srgb_codes(tmp_path, codes, largest):
    rows = "".join(f"v {p} {codes} 0 {largest}\n" for p in ("0 0 0", "1 0 0", "0 1 0"))
    scene = load_scene(obj(tmp_path, rows + "f 1 2 3\n"))
    np.testing.assert_allclose(scene.meshes[0].colors, [[HALF, 0, 1, 1]] * 3, rtol=2**-20)  # 16 roundings of float32
    assert scene.materials[0].base_color == (1, 1, 1) and scene.not_read == ()


def test_what_of_an_obj_is_not_drawn_is_named(tmp_path):
    text = POINTS + "s 1\nf 1 2 3\nl 1 2\np 1\nusemtl nowhere\nf 1 2 4\n"
    told = "lines", "points", "smoothing groups: without normals it is drawn flat", "material nowhere: no library holds it"
    assert load_scene(obj(tmp_path, text)).not_read == told
    assert load_scene(obj(tmp_path, POINTS + "s off\nf 1 2 3\n")).not_read == ()


@pytest.mark.parametrize("name", ["a.mtl", "t.png"])
def test_what_an_obj_file_names_is_hashed_and_must_be_there(tmp_path, name):
    file = obj(tmp_path)
    first = scene_hash(load_scene(file))
    (tmp_path / name).write_text(MTL + "\n") if name == "a.mtl" else image(tmp_path / name, seed=2)
    assert scene_hash(load_scene(file)) != first
    (tmp_path / name).unlink()
    with pytest.raises(InputError, match=f"^{tmp_path}.*{name}"):
        load_scene(file)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".off"])
def test_meshes_alone_are_grey(tmp_path, suffix):
    file = tmp_path / f"box{suffix}"
    trimesh.creation.box(extents=(1, 2, 3)).export(file)
    scene = load_scene(file)
    mesh = scene.meshes[0]
    assert mesh.faces.shape == (12, 3) and scene.materials[0].base_color == (0.8, 0.8, 0.8)
    assert (mesh.normals, mesh.colors, mesh.uv) == (None, None, None)
    np.testing.assert_array_equal(mesh.positions.max(axis=0), [0.5, 1, 1.5])


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off"])
def test_every_format_against_trimesh(tmp_path, suffix):
    file = tmp_path / f"ball{suffix}"
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.export(file)
    theirs = trimesh.load_mesh(file, process=False)
    (mesh,) = read_meshes(file, reach_of(file))
    np.testing.assert_array_equal(corners(mesh), theirs.vertices.astype(np.float32)[theirs.faces])


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("polygons", [[(0, 1, 2), (1, 2, 3)], [(0, 1, 2, 3), (3, 2, 1, 0)]], ids=["triangles", "quads"])
def test_ply_in_every_byte_order(tmp_path, form, polygons):
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    rows = np.arange(4 * 8, dtype=np.float64).reshape(4, 8) / 8
    lines = [*XYZ, *(f"property float n{k}" for k in "xyz"), "property double s", "property double t"]
    kind = np.dtype([("a", "f4", 6), ("b", "f8", 2)]).newbyteorder(order or "<")
    if order is None:
        body = "\n".join(" ".join(map(str, row)) for row in rows) + "\n"
        body += "\n".join(" ".join(map(str, (7, len(face), *face))) for face in polygons)
    else:
        table = np.zeros(4, kind)
        table["a"], table["b"] = rows[:, :6], rows[:, 6:]
        lists = (
            np.uint16(7).astype(order + "u2").tobytes() + bytes([len(f)]) + np.array(f, order + "i4").tobytes()
            for f in polygons
        )
        body = table.tobytes() + b"".join(lists)
    mesh = only_mesh(ply(tmp_path, (4, *lines), (2, "property ushort flags", FACES), body, form))
    quads = [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]
    expected = rows[[[0, 1, 2], [1, 2, 3]] if len(polygons[1]) == 3 else quads]
    np.testing.assert_array_equal(corners(mesh), expected[..., :3])
    np.testing.assert_array_equal(corners(mesh, "normals"), expected[..., 3:6])
    np.testing.assert_array_equal(corners(mesh, "uv"), expected[..., 6:])


@pytest.mark.parametrize(
    ("kind", "value", "expected"), [("uchar", 128, HALF), ("ushort", 128 * 257, HALF), ("float", 0.25, 0.25)]
)
def test_integer_colours_of_ply_are_srgb_codes_and_floats_are_linear(tmp_path, kind, value, expected):
    colors = [f"property {kind} {name}" for name in ("red", "green", "blue")]
    body = f"0 0 0 {value} 0 0\n1 0 0 0 {value} 0\n0 1 0 0 0 {value}\n3 0 1 2\n"
    scene = load_scene(ply(tmp_path, (3, *XYZ, *colors), (1, FACES), body))
    rgba = np.concatenate([np.eye(3) * expected, np.ones((3, 1))], axis=1)
    np.testing.assert_allclose(scene.meshes[0].colors, rgba, rtol=2**-20)  # 16 roundings of float32
    material = scene.materials[scene.objects[0].material]
    assert (material.base_color, material.alpha, scene.not_read) == ((1, 1, 1), "opaque", ())


@pytest.mark.parametrize(("alpha", "expected", "mode"), [(51, 0.2, "blend"), (255, 1, "opaque"), (0, 1, "opaque")])
def test_opacities_of_vertices_blend_unless_all_are_0(tmp_path, alpha, expected, mode):
    colors = [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    body = "".join(f"{p} 255 255 255 {alpha}\n" for p in ("0 0 0", "1 0 0", "0 1 0")) + "3 0 1 2\n"
    scene = load_scene(ply(tmp_path, (3, *XYZ, *colors), (1, FACES), body))
    np.testing.assert_allclose(scene.meshes[0].colors[:, 3], expected, rtol=2**-23)
    assert scene.materials[0].alpha == mode


def test_polygons_of_several_sizes_are_read_from_text_alone(tmp_path):
    body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 0 1 2 3\n5 0 1 2 3 1\n"
    mesh = only_mesh(ply(tmp_path, (4, *XYZ), (3, FACES), body))
    expected = [[0, 1, 2], [0, 1, 2], [2, 3, 0], [0, 1, 2], [0, 2, 3], [0, 3, 1]]
    np.testing.assert_array_equal(mesh.faces, expected)
    table = np.zeros((4, 3), "<f4").tobytes() + bytes([3]) + np.int32([0, 1, 2]).tobytes() + bytes([4]) + bytes(16)
    with pytest.raises(InputError, match="polygons of several sizes are read from text alone"):
        load_scene(ply(tmp_path, (4, *XYZ), (2, FACES), table, "binary_little_endian"))


def test_face_colours_of_ply_split_the_vertices(tmp_path):
    colors = [f"property uchar {name}" for name in ("red", "green", "blue")]
    body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n4 0 1 2 3 255 0 0\n4 3 2 1 0 0 255 0\n"
    mesh = only_mesh(ply(tmp_path, (4, *XYZ), (2, FACES, *colors), body))
    np.testing.assert_array_equal(corners(mesh, "colors")[:, 1], [[1, 0, 0, 1]] * 2 + [[0, 1, 0, 1]] * 2)
    np.testing.assert_array_equal(corners(mesh)[1], [[0, 0, 0], [0, 1, 0], [0, 0, 1]])
    scene = load_scene(ply(tmp_path, (4, *XYZ), (2, FACES, *colors), body.replace("4 0 1 2 3", "3 0 1 2")))
    assert scene.meshes[0].colors is None and scene.not_read == ("face colours of a.ply: its faces are of several sizes",)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_texture_coordinates_at_the_corners_of_ply_and_its_image(tmp_path, form):
    image(tmp_path / "my image.png")
    properties = FACES, "property list uchar float texcoord", "property int texnumber"
    normals = np.float32([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    vertices = np.concatenate([np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), normals], axis=1)
    uv = np.float32([[0, 0, 1, 0, 0, 0.25], [0, 0, 0.5, 0, 0, 1]])
    if form == "ascii":
        body = "".join(" ".join(map(str, row)) + "\n" for row in vertices)
        body += "".join(f"3 0 1 2 6 {' '.join(map(str, row))} 0\n" for row in uv)
    else:
        index = np.int32([0, 1, 2]).tobytes()
        body = vertices.tobytes() + b"".join(b"\3" + index + b"\6" + row.tobytes() + bytes(4) for row in uv)
    lines = *XYZ, *(f"property float n{k}" for k in "xyz")
    images = "TextureFile my image.png", "TextureFile b.png"
    scene = load_scene(ply(tmp_path, (3, *lines), (2, *properties), body, form, images))
    (mesh,) = scene.meshes
    np.testing.assert_array_equal(corners(mesh, "uv").reshape(2, 6), uv)
    np.testing.assert_array_equal(corners(mesh, "normals"), np.tile(normals, (2, 1, 1)))
    assert scene.textures[scene.materials[0].base_texture.texture].name == "my image.png"
    assert {file.name for file in scene.files} == {"a.ply", "my image.png"}
    assert scene.not_read == ("1 images of a.ply beyond my image.png",)


def stl_text(*solids):
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nVertex 1 0 {z}\nvertex 0 1e0 {z}\nendloop\nendfacet\n"
    return "".join(f"solid {name}\n{facet.format(z=z)}endsolid {name}\n" for z, name in enumerate(solids))


def test_solids_of_a_text_stl_are_objects(tmp_path):
    (tmp_path / "a.stl").write_text(stl_text("Left Hand", "", "", "Left Hand"))
    meshes = named(load_scene(tmp_path / "a.stl"))
    assert list(meshes) == ["Left Hand", "a.stl", "geometry_2", "Left Hand_1"]
    np.testing.assert_array_equal(corners(meshes["a.stl"])[0], [[0, 0, 1], [1, 0, 1], [0, 1, 1]])


def test_a_binary_stl_that_begins_with_solid_is_binary(tmp_path):
    file = tmp_path / "a.stl"
    trimesh.creation.box().export(file)
    data = bytearray(file.read_bytes())
    data[:80] = b"solid facet".ljust(80)
    file.write_bytes(data)
    assert len(only_mesh(file).faces) == 12
    data[-2] = 1
    file.write_bytes(data + b"more")
    assert load_scene(file).not_read == ("colours or other attributes of a.stl", "4 bytes behind the triangles of a.stl")


@pytest.mark.parametrize("header", ["OFF\n", "OFF", "# of ModelNet\nOFF  "])
def test_off_headers(tmp_path, header):
    (tmp_path / "a.off").write_text(header + "4 2 0\n0 0 0\n1 0 0\n\n0 1 0 # corner\n0 0 1\n3 0 1 2\n4 0 1 2 3\n")
    mesh = only_mesh(tmp_path / "a.off")
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 1, 2], [2, 3, 0]])


def test_what_of_off_is_not_read_is_named(tmp_path):
    rows = "0 0 0 0 0 1 128 0 255 255 0 0\n1 0 0 0 0 1 128 0 255 255 1 0\n0 1 0 0 0 1 128 0 255 255 0 0.25\n"
    (tmp_path / "a.off").write_text("STCNOFF\n3 1 0\n" + rows + "3 0 1 2 255 0 0\n")
    scene = load_scene(tmp_path / "a.off")
    np.testing.assert_array_equal(corners(scene.meshes[0]), [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    kinds = "texture coordinates", "colours", "normals", "colours of the faces"
    assert scene.not_read == tuple(f"{kind} of a.off" for kind in kinds)


def test_files_without_animations_have_no_clip_to_choose(tmp_path):
    with pytest.raises(InputError, match="no clip 'walk'"):
        load_scene(obj(tmp_path), "walk")


@pytest.mark.parametrize(
    ("vertices", "says"),
    [
        (("0 0 0", "1 0 0", "0 1 0"), ()),
        (("0 0 0 1 0 0", "1 0 0 0 1 0", "0 1 0 0 0 1"), ()),
        (("0 0 0 1 0 0", "1 0 0", "0 1 0"), ("colours of 1 of 3 vertices: the others have none",)),
        (("0 0 0 1 0 0 0.5", "1 0 0 0 1 0 0.5", "0 1 0 0 0 1 0.5"), ("opacities behind the colours of vertices",)),
    ],
)
def test_colours_that_obj_gives_in_part_are_named(tmp_path, vertices, says):
    (tmp_path / "a.obj").write_text("".join(f"v {vertex}\n" for vertex in vertices) + "f 1 2 3\n")
    assert load_scene(tmp_path / "a.obj").not_read == says


def test_texture_coordinates_of_ply_by_an_unknown_name_are_named(tmp_path):
    names = ("x", "y", "z", "texture_s", "texture_t")
    properties = "".join(f"property float {name}\n" for name in names)
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    header = f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}{faces}"
    (tmp_path / "a.ply").write_text(header + "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n")
    scene = load_scene(tmp_path / "a.ply")
    assert scene.meshes[0].uv is None and scene.not_read == ("texture coordinates of a.ply",)
