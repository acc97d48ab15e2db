"""Mitsuba's shapes as meshes: places, sides, normals and uv are those of Mitsuba's own, of every kind and transform."""

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene.description import Mesh
from framepairs.scene.mitsuba import scene_from_dict
from framepairs.scene.mitsuba_serialized import read_serialized
from framepairs.scene.mitsuba_shapes import smooth_normals
from framepairs.scene.mitsuba_tessellation import SEGMENTS, cube, cylinder, disk, rectangle, sphere
from mitsuba_files import OBJ, mitsubas_hits, nearest_hit

SINGLE = 2.0**-23
CHORD = 1 - np.cos(np.pi / SEGMENTS)
IDENTITY = np.eye(4)
MIRROR = np.diag([-1.0, 1, 1, 1])
TURNED = np.array([[0.0, -2, 0, 0.5], [2, 0, 0, -0.25], [0, 0, 2, 1], [0, 0, 0, 1]])
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float u
property float v
element face 2
property list uchar int vertex_indices
end_header
0 0 0 0.1 0.2
2 0 0 0.9 0.2
2 1 0 0.9 0.7
0 0 3 0.2 0.6
3 0 1 2
3 0 2 3
"""


def serialized(version=4, *, flags=0x1000 | 0x2, vertices=None, announced=None):
    """A file of two meshes, of which the second has the vertices."""
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 0, 3]], float) if vertices is None else vertices
    uv = np.array([[0.1, 0.2], [0.9, 0.2], [0.9, 0.7], [0.2, 0.6]])
    kind = np.float32 if flags & 0x1000 else np.float64

    def mesh(scale):
        counts = struct.pack("<QQ", announced or len(points), 2)
        name = b"name\0" if version == 4 else b""
        arrays = [(scale * points).astype(kind)]
        arrays += [np.tile([0, 0, 1], (4, 1)).astype(kind)] if flags & 1 else []
        arrays += [uv.astype(kind)] if flags & 2 else []
        arrays += [np.ones((4, 3), kind)] if flags & 8 else []
        arrays += [np.array([[0, 1, 2], [0, 2, 3]], np.uint32)]
        body = struct.pack("<I", flags) + name + counts + b"".join(array.tobytes() for array in arrays)
        return struct.pack("<HH", 0x041C, version) + zlib.compress(body)

    first, second = mesh(7), mesh(1)
    return first + second + struct.pack("<QQI" if version == 4 else "<III", 0, len(first), 2)


def write_meshes(folder):
    (folder / "m.obj").write_text(OBJ)
    (folder / "m.ply").write_text(PLY)
    (folder / "m.serialized").write_bytes(serialized())


SHAPES = {
    "rectangle": {},
    "disk": {},
    "cube": {},
    "sphere": {"center": [0.25, -0.5, 0.125], "radius": 1.5},
    "cylinder": {"p0": [0.0, -1, 0.25], "p1": [0.5, 1, 0.5], "radius": 0.5},
    "obj": {"filename": "m.obj"},
    "ply": {"filename": "m.ply"},
    "serialized": {"filename": "m.serialized", "shape_index": 1},
}
CASES = [(kind, {}, place) for kind in SHAPES for place in (IDENTITY, MIRROR, TURNED)]
CASES += [(kind, {"flip_normals": True}, place) for kind in SHAPES for place in (IDENTITY, MIRROR)]
CASES += [(kind, {"face_normals": True}, place) for kind in ("obj", "ply", "serialized") for place in (IDENTITY, MIRROR)]
CASES += [(kind, {"flip_tex_coords": value}, IDENTITY) for kind in ("obj", "ply") for value in (True, False)]


@pytest.mark.renders
@pytest.mark.parametrize(("kind", "keys", "place"), CASES)
def test_what_rays_find_is_mitsubas(tmp_path, kind, keys, place):
    """Chords err by 0.00095 radii, and by that over the cosine along the ray; the angle over a chord is at most 5 degrees,
    and a flat disk's angle in uv is linear in it only near the rim."""
    from framepairs.backend import mi

    write_meshes(tmp_path)
    values = {"type": kind, **SHAPES[kind], **keys}
    ours = scene_from_dict({"type": "scene", "s": {**values, "to_world": place}}, tmp_path)
    theirs = dict(values)
    if "filename" in values:
        theirs["filename"] = str(tmp_path / values["filename"])
    scene = mi.load_dict({"type": "scene", "s": {**theirs, "to_world": mi.ScalarTransform4f(place)}})
    is_round = kind in ("sphere", "cylinder")
    random = np.random.default_rng(4)
    origins = 6 * random.normal(size=(60, 3))
    targets = random.uniform([-1, -1, -0.5], [1, 1, 0.5], (60, 3)) @ place[:3, :3].T + place[:3, 3]
    directions = (targets - origins) / np.linalg.norm(targets - origins, axis=1, keepdims=True)
    compared = 0
    for origin, direction, wanted in zip(origins, directions, mitsubas_hits(scene, origins, directions), strict=True):
        found = nearest_hit(ours, origin, direction)
        if wanted is None or found is None:
            continue
        _, position, normal, uv = found
        cosine, expected = abs(direction @ normal), wanted["uv"]
        if cosine < 0.3 or (kind == "cylinder" and not 0.05 < min(expected[1], uv[1]) <= max(expected[1], uv[1]) < 0.95):
            continue  # grazing rays and the cylinder's rims, where a chord more or less decides
        compared += 1
        slack = 2 * 3 * CHORD / cosine if is_round else 256 * SINGLE
        np.testing.assert_allclose(position, wanted["place"], atol=slack)
        np.testing.assert_allclose(normal, wanted["normal"], atol=4 * slack if is_round else 1e-4)
        if kind == "disk":
            np.testing.assert_allclose(uv[0], expected[0], atol=2 * CHORD)
            np.testing.assert_allclose((uv[1] - expected[1] + 0.5) % 1 - 0.5, 0, atol=0.5 / SEGMENTS)
        else:
            near_pole = kind == "sphere" and min(expected[1], 1 - expected[1]) < 0.2
            np.testing.assert_allclose((uv - expected + 0.5) % 1 - 0.5, 0, atol=0.02 if near_pole else 4 * slack)
    assert compared >= 5


@pytest.mark.renders
@pytest.mark.parametrize("linear", [np.diag([0.5, 1.5, 0.75]), np.diag([-0.5, 1.5, 0.75]), [[1, 1, 0], [0, 1, 0], [0, 0.5, 2]]])
def test_smooth_normals_of_stretched_meshes_are_mitsubas(tmp_path, linear):
    """At a vertex; between vertices Mitsuba mixes unit normals in world space, and we in object space."""
    from framepairs.backend import mi

    (tmp_path / "p.obj").write_text("v 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 -0.5 0\nf 1 2 3\nf 1 3 4\nf 1 4 2\n")
    place = np.eye(4)
    place[:3, :3] = linear
    values = {"type": "obj", "filename": str(tmp_path / "p.obj")}
    theirs = mi.load_dict({**values, "to_world": mi.ScalarTransform4f(place)})
    expected = np.array(mi.traverse(theirs)["vertex_normals"]).reshape(-1, 3)
    scene = scene_from_dict({"type": "scene", "s": {**values, "to_world": place}, "t": values}, tmp_path)
    assert [item.mesh for item in scene.objects] == [0, 1]
    found = scene.meshes[0].normals @ np.linalg.inv(place[:3, :3])
    np.testing.assert_allclose(found / np.linalg.norm(found, axis=1, keepdims=True), expected, atol=32 * SINGLE)


def test_smooth_normals_are_weighted_by_angle():
    """A corner of a cube whose third side is two triangles: each side counts a right angle."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], np.float32)
    faces = np.array([[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]], np.uint32)
    normals = smooth_normals(Mesh(name="corner", positions=positions, faces=faces))
    np.testing.assert_allclose(normals[0], np.full(3, 3**-0.5), atol=4 * SINGLE)
    np.testing.assert_allclose(normals[4], [0, 0, 1], atol=4 * SINGLE)


@pytest.mark.parametrize(
    "mesh", [rectangle(), cube(), disk(), sphere(np.zeros(3), 2.0), cylinder(np.zeros(3), np.array([0.3, 0.2, 1.0]), 0.5)]
)
def test_fronts_are_counter_clockwise(mesh):
    corners = mesh.positions[mesh.faces.astype(int)].astype(float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = mesh.normals[mesh.faces.astype(int)].sum(axis=1)
    assert ((across * normals).sum(-1) > 0).all()


@pytest.mark.parametrize("kind", ["rectangle", "cube", "sphere", "ply", "obj"])
@pytest.mark.parametrize("place", [IDENTITY, MIRROR])
def test_normal_maps_are_laid_along_u_and_to_the_left_of_it(tmp_path, kind, place):
    """Mitsuba's frame of a normal map is (dp/du, cross(normal, dp/du), normal), in world space and whichever way v runs."""
    write_meshes(tmp_path)
    Image.fromarray(np.full((5, 7, 3), 128, np.uint8)).save(tmp_path / "n.png")
    texture = {"type": "bitmap", "filename": "n.png", "raw": True}
    bumpy = {"type": "normalmap", "normalmap": texture, "bsdf": {"type": "diffuse"}}
    plain = {"type": kind, **SHAPES[kind], "to_world": place}
    scene = scene_from_dict({"type": "scene", "a": {**plain, "bsdf": bumpy}, "b": plain}, tmp_path)
    bumpy, plain = scene.meshes
    assert plain.tangents is None
    assert (bumpy.tangents[:, 3] == np.sign(np.linalg.det(place[:3, :3]))).all()
    corners, uv = (a[bumpy.faces.astype(int)].astype(float) for a in (bumpy.positions, bumpy.uv))
    edges, steps = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    along = np.linalg.solve(steps + 1e-12 * np.eye(2), edges)[:, 0]  # dp/du
    mean = bumpy.tangents[bumpy.faces.astype(int), :3].mean(axis=1)
    cosines = (along * mean).sum(-1) / np.linalg.norm(along, axis=-1) / np.linalg.norm(mean, axis=-1)
    assert cosines.min() > {"sphere": 0.99, "ply": 0.5, "obj": 0.5}.get(kind, 1 - 1e-6)


def test_a_sphere_has_the_area_and_the_chord_error_that_it_states():
    assert CHORD < 1e-3
    mesh = sphere(np.zeros(3), 1.0)
    corners = mesh.positions[mesh.faces.astype(int)].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1).sum() / 2
    assert 4 * np.pi * (1 - 3 * CHORD) < area < 4 * np.pi
    middles = corners.mean(axis=1)
    assert (normal * middles).sum(-1).min() > 0
    # on a quad's diagonal both directions fall short, each by one chord
    assert 1 - 2.1 * CHORD < np.linalg.norm((corners + np.roll(corners, 1, axis=1)) / 2, axis=-1).min() <= 1


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("flags", [0x1000, 0x2000, 0x1001, 0x2003, 0x100B, 0x1012])
def test_serialized_meshes_of_every_kind(tmp_path, version, flags):
    (tmp_path / "m.serialized").write_bytes(serialized(version, flags=flags))
    mesh, by_faces = read_serialized(tmp_path / "m.serialized", 1)
    np.testing.assert_array_equal(mesh.positions[3], [0, 0, 3])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3]])
    assert (mesh.normals is not None, mesh.uv is not None, by_faces) == (bool(flags & 1), bool(flags & 2), bool(flags & 16))
    assert mesh.name == ("name" if version == 4 else "m")
    assert read_serialized(tmp_path / "m.serialized", 0)[0].positions[3, 2] == 21


@pytest.mark.parametrize(
    ("data", "index", "says"),
    [
        (b"", 0, "cannot be read as serialized mesh 0"),
        (b"no mesh at all, but long enough", 0, "header is not of format 3 or 4"),
        (serialized(), 2, "it has 2 meshes"),
        (serialized(), -1, "it has 2 meshes"),
        (serialized(announced=2**60), 1, "more is announced than it can hold"),
        (serialized(announced=5), 1, "cut short|more is announced"),
        (serialized(flags=0x3002), 1, "neither of single nor of double"),
        (serialized(vertices=np.full((4, 3), np.nan)), 1, "points are not finite"),
        (serialized(flags=0x2002, vertices=np.full((4, 3), 1e300)), 1, "points are not finite"),
        (serialized()[:60] + serialized()[-20:], 1, "cannot be read"),
        (struct.pack("<HH", 0x041C, 4) + b"x" * 50 + struct.pack("<I", 2**31), 0, "meshes"),
    ],
)
def test_damaged_serialized_meshes_are_refused(tmp_path, data, index, says):
    (tmp_path / "m.serialized").write_bytes(data)
    with pytest.raises(InputError, match=says) as caught:
        read_serialized(tmp_path / "m.serialized", index)
    assert str(tmp_path) in str(caught.value)


def test_any_damage_to_a_serialized_mesh_is_one_error_or_a_mesh(tmp_path):
    whole, random = serialized(), np.random.default_rng(7)
    for _ in range(300):
        data = bytearray(whole)
        for place in random.integers(0, len(data), random.integers(1, 5)):
            data[place] = random.integers(0, 256)
        (tmp_path / "m.serialized").write_bytes(data[: random.integers(0, len(data) + 1)] if random.random() < 0.3 else data)
        try:
            read_serialized(tmp_path / "m.serialized", 1)
        except InputError:
            pass
