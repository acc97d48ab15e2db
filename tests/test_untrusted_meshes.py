"""Mesh files that are damaged or made to harm: one error that names the file, at once, and never a crash."""

import random
import resource
import time

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.trimesh_meshes import MOST_PARTS

POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list uchar int vertex_indices\n"
TRIANGLE = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def ply(elements, body="", form="ascii"):
    return f"ply\nformat {form} 1.0\n{elements}end_header\n".encode() + (body.encode() if isinstance(body, str) else body)


def ply_triangle(vertices=3, faces=1, body=TRIANGLE, form="ascii", extra=""):
    return ply(f"element vertex {vertices}\n{XYZ}element face {faces}\n{LIST}{extra}", body, form)


def stl(count, triangles):
    return b"x" * 80 + count.to_bytes(4, "little") + np.zeros((triangles, 50), np.uint8).tobytes()


def written(folder, name, data):
    file = folder / name
    file.write_bytes(data.encode() if isinstance(data, str) else data)
    return file


BROKEN = {
    "nothing.obj": ("", "no faces"),
    "points.obj": (POINTS, "point clouds"),
    "nan.obj": (POINTS + "v nan 0 0\nv 0 inf 0\nf 1 2 4\n", "1 of 3 points of nan.obj are not finite"),
    "huge.obj": (POINTS + "v 1e39 0 0\nf 1 2 4\n", "1 of 3 points of huge.obj are not finite"),
    "nan uv.obj": (POINTS + "vt nan 0\nf 1/1 2/1 3/1\n", "texture coordinates of nan uv.obj are not finite"),
    "above.obj": (POINTS + "f 1 2 9\n", "IndexError: index 8 is out of bounds"),
    "zero.obj": (POINTS + "f 0 1 2\n", "index 0: they count from 1"),
    "below.obj": (POINTS + "f -4 1 2\n", "index -4 of a face: there are 3 before it"),
    "long.obj": (POINTS + f"f 1 2 {'9' * 5000}\n", "out of bounds"),
    "back.obj": (POINTS + f"f 1 2 -{'9' * 5000}\n", "of a face: there are 3 before it"),
    "minus.obj": (POINTS + "f 1 2-1 3\n", "index 2-1 of a face"),
    "no point.obj": (POINTS + "vt 0 0\nf /1 /1 /1\n", "corners other than"),
    "slashes.obj": (POINTS + "f 1/1/1/1 2 3\n", "corners other than"),
    "words.obj": (POINTS + "f one two three\n", "corners other than v, v/vt, v//vn or v/vt/vn, as '(one|three|two)'"),
    "half.obj": (POINTS + "f 1.5 2 3\n", "corners other than"),
    "short.obj": (POINTS + "v 1 2\nf 1 2 3\n", "points of short.obj with other than 3 numbers"),
    "letters.obj": (POINTS + "v 1 2 three\nf 1 2 3\n", "ValueError"),
    "binary.obj": (ply_triangle(form="binary_little_endian", body=bytes(50)), "no faces"),
    "lines.obj": (POINTS + "f 1 2\n", "no triangles in it"),
    "nothing.ply": ("", "no PLY header"),
    "endless.ply": ("ply\nformat ascii 1.0\n" + "comment a\n" * 10_000, "no PLY header"),
    "points.ply": (ply(f"element vertex 3\n{XYZ}", "0 0 0\n" * 3), "point clouds"),
    "strips.ply": (ply(f"element vertex 3\n{XYZ}element tristrips 1\n{LIST}", TRIANGLE), "strips"),
    "many.ply": (ply_triangle(vertices=10**12), "1000000000000 rows of vertex in 37 bytes"),
    "faces.ply": (ply_triangle(faces=10**12, form="binary_little_endian", body=bytes(40)), "1000000000000 rows of face in"),
    "list.ply": (
        ply(f"element vertex 3\n{XYZ}element face 1\nproperty list uint int vertex_indices\n", bytes(36) + b"\xff" * 8,
            "binary_big_endian"), "cut short or damaged"),
    "cut.ply": (ply_triangle(form="binary_little_endian", body=bytes(36) + b"\3" + bytes(11)), "unexpected length"),
    "lines.ply": (ply_triangle(faces=2), "5 rows in 4 lines"),
    "index.ply": (ply_triangle(body=TRIANGLE.replace("3 0 1 2", "3 0 1 7")), "1 of 3 indices .* outside 0 to 2, as 7"),
    "negative.ply": (ply_triangle(body=TRIANGLE.replace("3 0 1 2", "3 0 1 -1")), "outside 0 to 2, as -1"),
    "nan.ply": (ply_triangle(body=TRIANGLE.replace("1 0 0", "nan 0 0")), "1 of 3 points of nan.ply are not finite"),
    "nan index.ply": (ply_triangle(body=TRIANGLE.replace("3 0 1 2", "3 0 1 nan")), "outside 0 to 2"),
    "words.ply": (ply_triangle(body=TRIANGLE.replace("1 0 0", "one 0 0")), "ValueError"),
    "text.ply": (ply_triangle(form="binary_little_endian"), "unexpected length|outside|not finite"),
    "type.ply": (ply_triangle(extra="property quad x\n"), "KeyError: 'quad'"),
    "negative rows.ply": (ply("element vertex -3\n"), "'element vertex -3' in its PLY header"),
    "twice.ply": (ply(f"element vertex 1\n{XYZ}element vertex 1\n"), "'element vertex 1' in its PLY header"),
    "no x.ply": (ply(f"element vertex 1\nproperty float y\nelement face 1\n{LIST}", "0\n3 0 0 0\n"), "KeyError: 'x'"),
    "thin.ply": (ply_triangle(body=TRIANGLE.replace("3 0 1 2", "2 0 1")), "no triangles in it"),
    "nothing.stl": ("", "header of 84 bytes, there are 0"),
    "many.stl": (stl(2**32 - 1, 2), "4294967295 triangles of 214748364834 bytes, there are 184"),
    "cut.stl": (stl(3, 3)[:-1], "cut short"),
    "none.stl": (stl(0, 0), "no triangles"),
    "text cut.stl": ("solid a\n" + FACET + FACET[:60], "cut short or damaged: 0 vertices in 1 finished facets"),
    "text end.stl": ("solid a\n" + FACET, "cut short or damaged"),
    "text nan.stl": ("solid a\n" + FACET.replace("vertex 1", "vertex nan") + "endsolid", "points of a are not finite"),
    "text words.stl": ("solid a\n" + FACET.replace("vertex 1", "vertex one") + "endsolid", "ValueError"),
    "text none.stl": ("solid a\nendsolid a\n", "no triangles"),
    "nothing.off": ("", "no OFF header"),
    "header.off": ("OFF\n", "no vertices and no faces"),
    "many.off": ("OFF\n3 1000000000000 0\n" + TRIANGLE, "3 vertices and 1000000000000 faces on"),
    "long.off": (f"OFF\n{'9' * 5000} 1 0\n" + TRIANGLE, "no vertices and no faces"),
    "points.off": ("OFF\n3 0 0\n" + TRIANGLE, "point clouds"),
    "index.off": ("OFF\n3 1 0\n" + TRIANGLE.replace("3 0 1 2", "3 0 1 7"), "index outside the range"),
    "negative.off": ("OFF\n3 1 0\n" + TRIANGLE.replace("3 0 1 2", "3 0 1 -1"), "index outside the range"),
    "half.off": ("OFF\n3 1 0\n" + TRIANGLE.replace("3 0 1 2", "3 0 1 nan"), "ValueError"),
    "binary.off": ("OFF BINARY\n" + TRIANGLE, "binary"),
    "four.off": ("4OFF\n3 1 0\n" + TRIANGLE, "3 dimensions"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_with_their_problem(tmp_path, name):
    data, says = BROKEN[name]
    file = written(tmp_path, name, data)
    start = time.process_time()
    with pytest.raises(InputError, match=f"^{file}[:,] .*({says})"):
        load_scene(file)
    assert time.process_time() - start < 2


def test_a_folder_is_no_mesh(tmp_path):
    (tmp_path / "a.ply").mkdir()
    with pytest.raises(InputError, match="a.ply"):
        load_scene(tmp_path / "a.ply")


# Small files that ask for much: [name, the text, what is drawn of it (triangles), or the error].
HEAVY = {
    "number line.obj": (POINTS + "v " + "1 " * 10**6 + "\nf 1 2 3\n", 1),
    "polygon.obj": (POINTS + "f" + " 1 2 3" * 200_000, 599_998),
    "spaces.obj": (POINTS + " " * 10**7 + "\nf 1 2 3\n", 1),
    "comment.obj": ("#" * 10**7 + "\n" + POINTS + "f 1 2 3\n", 1),
    "name.obj": (POINTS + "g " + "x" * 10**6 + "\nf 1 2 3\n", 1),
    "continued.obj": (POINTS + "\\\n" * 10**6 + "f 1 2 3\n", 1),
    "slashes.obj": (POINTS + "f " + "/" * 10**6, "corners other than"),
    "statements.obj": (POINTS + "o\ng\ns 1\n" * 300_000 + "f 1 2 3\n", 1),
    "materials.obj": (POINTS + "".join(f"usemtl {k}\nf 1 2 3\n" for k in range(50_000)), "50000 materials"),
    "library.obj": ("mtllib " + "a " * 10**5 + "\n" + POINTS + "f 1 2 3\n", "cannot name a file"),
    "solids.stl": ("".join(f"solid {k}\n{FACET}endsolid\n" for k in range(MOST_PARTS + 1)), MOST_PARTS + 1),
    "words.stl": ("solid\nfacet\n" + "solid\n" * 10**6, "cut short"),
    "polygon.off": ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n600000" + " 0 1 2" * 200_000, 599_998),
    "comments.off": ("#\n" * 10**6 + "OFF\n", "no vertices"),
    "ragged.ply": (ply_triangle(3, 100_000, TRIANGLE[:18] + "3 0 1 2\n4 0 1 2 0\n" * 50_000), 150_000),
    "empty lists.ply": (ply_triangle(faces=10**6, form="binary_little_endian", body=bytes(36 + 10**6)), "no triangles"),
}  # fmt: skip


@pytest.mark.parametrize("name", HEAVY)
def test_small_files_cost_little(tmp_path, name):
    data, expected = HEAVY[name]
    file = written(tmp_path, name, data)
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    if isinstance(expected, str):
        with pytest.raises(InputError, match=expected):
            load_scene(file)
    else:
        assert sum(len(mesh.faces) for mesh in load_scene(file).meshes) == expected
    assert time.process_time() - start < 5  # seconds; the slowest takes 0.6 s on an idle core
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**20  # KiB


def test_groups_beyond_what_can_be_drawn_are_joined_and_named(tmp_path):
    groups = "".join(f"g {k}\nf 1 2 3\n" for k in range(MOST_PARTS + 1))
    scene = load_scene(written(tmp_path, "a.obj", POINTS + groups))
    assert len(scene.objects) == 1 and len(scene.meshes[0].faces) == MOST_PARTS + 1
    assert scene.not_read == (f"{MOST_PARTS + 1} objects, groups and materials: they are drawn as one for each material",)


def test_solids_beyond_what_can_be_drawn_are_joined_and_named(tmp_path):
    scene = load_scene(written(tmp_path, "a.stl", "".join(f"solid {k}\n{FACET}endsolid\n" for k in range(MOST_PARTS + 1))))
    assert len(scene.objects) == 1 and scene.not_read == (f"{MOST_PARTS + 1} solids: they are drawn as one",)


def test_degenerate_and_double_faces_stay(tmp_path):
    scene = load_scene(written(tmp_path, "a.obj", POINTS + "f 1 1 1\nf 1 2 3\nf 1 2 3\nf 3 2 1\nf 1 2 2\n"))
    assert len(scene.meshes[0].faces) == 5


WHOLE = {
    ".obj": "o a\n" + POINTS + "vt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 3/1/1\ng b\nf -1 -2 -3\nf 1//1 2//1 3//1 2//1\n",
    ".ply": ply_triangle(2 + 1, 2, TRIANGLE + "4 0 1 2 0\n"),
    ".stl": stl(3, 3),
    ".off": "COFF\n3 2 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 1 9\n3 0 1 2\n3 2 1 0 255 0 0\n",
    ".text.stl": "solid a\n" + FACET + "endsolid a\nsolid b\n" + FACET + "endsolid b\n",
    ".bytes.ply": ply_triangle(
        3, 2, bytes(36) + b"\3" + bytes(12) + b"\4" + bytes(16), "binary_little_endian", extra="property uchar red\n"
    ),
}
WORDS = [
    b"nan",
    b"-1",
    b"0",
    b"9" * 25,
    b"1e39",
    b"\\\n",
    b"/",
    b"//",
    b"\0",
    b"\xff",
    b"#",
    b"\r",
    b"\n",
    b"1.5",
    b"\nf 1 2 3\n",
]


@pytest.mark.parametrize("kind", WHOLE)
def test_any_bytes_give_a_scene_or_one_error(tmp_path, kind):
    whole = WHOLE[kind].encode() if isinstance(WHOLE[kind], str) else WHOLE[kind]
    chance, read = random.Random(kind), 0
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(chance.choice([1, 1, 2, 4])):
            place, choice = chance.randrange(len(data) + 1), chance.random()
            if choice < 0.3:
                data[place : place + 1] = bytes([chance.randrange(256)])
            elif choice < 0.7:
                data[place:place] = chance.choice(WORDS)
            elif choice < 0.9:
                del data[place : place + chance.randrange(1, 12)]
            else:
                del data[place:]
        file = written(tmp_path, "a" + kind, bytes(data))
        try:
            meshes = load_scene(file).meshes
        except InputError as error:
            assert str(error).startswith(str(file))
            continue
        read += 1
        for mesh in meshes:
            assert len(mesh.faces) and mesh.faces.max() < len(mesh.positions)
            for array in (mesh.positions, mesh.normals, mesh.uv, mesh.colors):
                assert array is None or len(array) == len(mesh.positions) and np.isfinite(array).all()
    assert 0 < read < 400
