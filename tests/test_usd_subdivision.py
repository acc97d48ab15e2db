"""Subdivision surfaces of USD against the rules of Catmull and Clark and of DeRose et al., worked out plainly."""

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene import load_scene
from usd_stages import BINDING, load, prim, usd, values

SINGLE = float(np.finfo(np.float32).eps)
CUBE = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
CUBE_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
CUBE_EDGES = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
GRID = np.array([(x, y, 0) for y in range(4) for x in range(4)], dtype=float)
GRID_FACES = tuple((4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3))
FLAT = 'uniform token subdivisionScheme = "none"'
SCHEME = 'uniform token subdivisionScheme = "catmullClark"'


def polygons(points, faces, *lines, name="m"):
    flat = [index for face in faces for index in face]
    return prim(
        "Mesh", name, f"int[] faceVertexCounts = {[len(face) for face in faces]}", f"int[] faceVertexIndices = {flat}",
        f"point3f[] points = {values(points)}", *lines,
    )  # fmt: skip


def creases(edges, sharpness):
    edges = np.asarray(edges).reshape(-1, 2)
    return (
        f"int[] creaseIndices = {edges.reshape(-1).tolist()}",
        f"int[] creaseLengths = {[2] * len(edges)}",
        f"float[] creaseSharpnesses = {[sharpness] * len(edges)}",
    )


def refined(folder, points, faces, *lines, level=1):
    return load(folder, polygons(points, faces, *lines), subdivision=level).meshes[0]


def distinct(points):
    """Rows in order, equal ones (to 6 digits) once."""
    return np.unique(np.round(np.asarray(points, float), 6) + 0.0, axis=0)


def same_points(mesh, expected, atol=4 * SINGLE):
    found, expected = distinct(mesh.positions), distinct(expected)
    assert found.shape == expected.shape
    distance = np.linalg.norm(found[:, None] - expected, axis=2)
    assert distance.min(axis=0).max() < atol + 2e-6 and distance.min(axis=1).max() < atol + 2e-6


def plainly(points, faces):
    """Points after one step on a closed mesh of smooth edges: Catmull and Clark's three rules, one vertex at a time."""
    centre = {face: np.mean([points[i] for i in face], axis=0) for face in faces}
    sides = {}
    for face in faces:
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            sides.setdefault(frozenset((a, b)), []).append(face)
    middles = [(sum(points[i] for i in edge) + sum(centre[f] for f in both)) / 4 for edge, both in sides.items()]
    corners = []
    for index, point in enumerate(points):
        around = [centre[face] for face in faces if index in face]
        edges = [np.mean([points[i] for i in edge], axis=0) for edge in sides if index in edge]
        n = len(around)
        corners.append((np.mean(around, axis=0) + 2 * np.mean(edges, axis=0) + (n - 3) * point) / n)
    return corners + middles + list(centre.values())


def test_one_step_on_a_cube_is_catmull_and_clarks(tmp_path):
    """By hand: faces' middles at 1, edges' at 3/4, corners at 5/9."""
    mesh = refined(tmp_path, CUBE, CUBE_FACES)
    middles = [row * np.where(row == 0, 0, 3 / 4) for a, b in CUBE_EDGES for row in [(CUBE[a] + CUBE[b]) / 2]]
    by_hand = [*(5 / 9 * CUBE), *middles, *(sign * axis for axis in np.eye(3) for sign in (-1, 1))]
    same_points(mesh, by_hand)
    same_points(mesh, plainly(CUBE, CUBE_FACES))
    assert len(mesh.faces) == 48 and len(mesh.positions) == 26


def test_a_mesh_of_triangles_and_pentagons_follows_the_same_rules(tmp_path):
    rng = np.random.default_rng(2)
    angle = np.arange(5) * 2 * np.pi / 5
    ring = np.stack([np.cos(angle), np.sin(angle), rng.normal(size=5) / 9], axis=1).round(3)
    points = np.concatenate([ring - (0, 0, 1), ring + (0, 0, 1), [(0, 0, 2)]])
    faces = [(4, 3, 2, 1, 0), *((k, (k + 1) % 5, 5 + (k + 1) % 5, 5 + k) for k in range(5))]
    faces += [(5 + k, 5 + (k + 1) % 5, 10) for k in range(5)]
    same_points(refined(tmp_path, points, faces), plainly(points, faces), atol=8 * SINGLE)


def test_two_steps_are_one_step_twice(tmp_path):
    once = refined(tmp_path, CUBE, CUBE_FACES)
    quads = once.faces.reshape(-1, 2, 3)
    faces = [(a, b, c, d) for (a, b, c), (_, _, d) in quads.tolist()]
    again = refined(tmp_path, once.positions.tolist(), faces)
    same_points(refined(tmp_path, CUBE, CUBE_FACES, level=2), again.positions, atol=8 * SINGLE)


@pytest.mark.parametrize("level", [1, 3])
def test_infinitely_sharp_edges_keep_a_cube_a_cube(tmp_path, level):
    mesh = refined(tmp_path, CUBE, CUBE_FACES, *creases(CUBE_EDGES, 10), level=level)
    np.testing.assert_array_equal(np.abs(mesh.positions).max(axis=1), 1)
    assert {tuple(row) for row in CUBE} <= {tuple(row) for row in mesh.positions.tolist()}
    np.testing.assert_array_equal(np.sort(np.abs(mesh.normals), axis=1), np.tile([0, 0, 1], (len(mesh.normals), 1)))
    across = np.cross(*np.diff(mesh.positions[mesh.faces], axis=1).transpose(1, 0, 2))
    assert (np.sum(across * mesh.normals[mesh.faces[:, 0]], axis=1) > 0).all()
    assert len(mesh.positions) == 6 * (2**level + 1) ** 2  # split along the edges alone


def test_a_crease_around_a_face_gives_cubic_b_splines_along_it(tmp_path):
    """The crease rule by hand: a corner of the ring goes to 3/4 of itself and an eighth of each neighbour, edges to their
    middles; at the next step again."""
    ring = [(4, 5), (5, 7), (7, 6), (6, 4)]
    mesh = refined(tmp_path, CUBE, CUBE_FACES, *creases(ring, 10), level=1)
    on_ring = distinct(mesh.positions[mesh.positions[:, 2] == 1])
    expected = [(0.75 * x, 0.75 * y, 1) for x in (-1, 1) for y in (-1, 1)] + [
        (1, 0, 1),
        (-1, 0, 1),
        (0, 1, 1),
        (0, -1, 1),
        (0, 0, 1),
    ]
    np.testing.assert_allclose(on_ring, distinct(expected), atol=1e-6)


@pytest.mark.parametrize("sharpness", [0.5, 1.0, 1.7])
def test_semi_sharp_creases_fade(tmp_path, sharpness):
    """All edges of a cube alike, by hand: an edge's middle goes to max(1 - s, 0) of 3/4 and the rest of 1. A corner, where
    three sharp edges meet, keeps its place while they stay sharp, and min(s, 1) of it on the step on which they fade."""
    mesh = refined(tmp_path, CUBE, CUBE_FACES, *creases(CUBE_EDGES, sharpness))
    share = min(sharpness, 1)
    far = share + (1 - share) * 5 / 9
    middle = share + (1 - share) * 3 / 4
    expected = [*(far * CUBE), *(middle * (CUBE[a] + CUBE[b]) / 2 for a, b in CUBE_EDGES)]
    same_points(mesh, [*expected, *(sign * axis for axis in np.eye(3) for sign in (-1, 1))])


def test_a_crease_of_two_and_a_half_is_sharp_twice_and_half_sharp_once(tmp_path):
    """Two steps leave a cube; a third mixes its points: by hand at a corner, half of it and half of the smooth rule."""
    sharp = refined(tmp_path, CUBE, CUBE_FACES, *creases(CUBE_EDGES, 2.5), level=2)
    np.testing.assert_allclose(np.abs(sharp.positions).max(axis=1), 1, atol=SINGLE)
    third = refined(tmp_path, CUBE, CUBE_FACES, *creases(CUBE_EDGES, 2.5), level=3)
    step = 0.5  # the quads of the second level
    n = 3
    ends = np.array([1, 1, 1]) - step / n * np.ones(3)  # mean of the three neighbours along the edges
    middles = np.array([1, 1, 1]) - step / n * np.ones(
        3
    )  # mean of the three quads' middles: each is half a step in from two sides
    smooth = ((n - 2) * np.ones(3) + ends + middles) / n
    corner = third.positions[np.argmax(third.positions.sum(axis=1))]
    np.testing.assert_allclose(corner, (np.ones(3) + smooth) / 2, atol=4 * SINGLE)


@pytest.mark.parametrize(("boundary", "corner"), [("edgeAndCorner", (0, 0)), ("edgeOnly", (1 / 8, 1 / 8))])
def test_boundaries_are_curves_of_their_own(tmp_path, boundary, corner):
    """A bulge in the middle does not move the boundary. By hand: a corner of one face stays, or goes to 3/4 of itself and an
    eighth of both neighbours, one unit away."""
    points = GRID.copy()
    points[[5, 6, 9, 10], 2] = 1
    mesh = refined(tmp_path, points, GRID_FACES, f'uniform token interpolateBoundary = "{boundary}"')
    edge = mesh.positions[(mesh.positions[:, :2].min(axis=1) < 0.2) | (mesh.positions[:, :2].max(axis=1) > 2.8)]
    np.testing.assert_array_equal(edge[:, 2], 0)
    first = edge[np.argmin(edge.sum(axis=1))]
    np.testing.assert_allclose(first, (*corner, 0), atol=SINGLE)


def test_faces_at_a_boundary_that_is_not_interpolated_are_not_drawn(tmp_path):
    mesh = refined(tmp_path, GRID, GRID_FACES, 'uniform token interpolateBoundary = "none"', level=2)
    assert len(mesh.faces) == 2 * 16
    assert mesh.positions.min(axis=0)[:2].tolist() == [1, 1] and mesh.positions.max(axis=0)[:2].tolist() == [2, 2]


def test_holes_shape_the_surface_and_are_not_drawn(tmp_path):
    whole = refined(tmp_path, CUBE, CUBE_FACES)
    open_box = refined(tmp_path, CUBE, CUBE_FACES, "int[] holeIndices = [1]")
    assert len(open_box.faces) == 40 and open_box.positions[:, 2].max() == 0.75
    assert {tuple(row) for row in open_box.positions.tolist()} < {tuple(row) for row in whole.positions.tolist()}


def test_sharp_corners_stay(tmp_path):
    lines = "int[] cornerIndices = [7]", "float[] cornerSharpnesses = [10]"
    mesh = refined(tmp_path, CUBE, CUBE_FACES, *lines, level=3)
    assert (1, 1, 1) in {tuple(row) for row in mesh.positions.tolist()}


@pytest.mark.parametrize("scheme", ["catmullClark", "bilinear"])
def test_a_shift_of_the_control_mesh_shifts_the_surface(tmp_path, scheme):
    line = f'uniform token subdivisionScheme = "{scheme}"'
    here = refined(tmp_path, CUBE, CUBE_FACES, line, *creases(CUBE_EDGES[:5], 1.3), level=3)
    there = refined(tmp_path, CUBE + 1024, CUBE_FACES, line, *creases(CUBE_EDGES[:5], 1.3), level=3)
    np.testing.assert_allclose(there.positions, here.positions + 1024, atol=1024 * SINGLE)


def test_bilinear_surfaces_keep_their_shape_and_their_facets(tmp_path):
    mesh = refined(tmp_path, CUBE, CUBE_FACES, 'uniform token subdivisionScheme = "bilinear"', level=2)
    assert len(mesh.faces) == 6 * 16 * 2 and len(mesh.positions) == 6 * 25
    np.testing.assert_array_equal(np.abs(mesh.positions).max(axis=1), 1)
    np.testing.assert_array_equal(np.sort(np.abs(mesh.normals), axis=1), np.tile([0, 0, 1], (len(mesh.normals), 1)))


def test_levels_converge_to_the_limit(tmp_path):
    """A vertex goes to n^2 of itself, 4 of its neighbours along edges and 1 of those across its quads, over n (n + 5)
    (Halstead, Kass and DeRose, "Efficient, fair interpolation using Catmull-Clark surfaces", 1993, section 2)."""
    n = 3
    ends = sum(CUBE[k] for k in (6, 5, 3))
    opposite = sum(CUBE[k] for k in (4, 2, 1))
    limit = (n * n * CUBE[7] + 4 * ends + opposite) / (n * (n + 5))
    errors = []
    for level in (1, 2, 3, 4):
        mesh = refined(tmp_path, CUBE, CUBE_FACES, level=level)
        errors.append(np.linalg.norm(mesh.positions[np.argmax(mesh.positions.sum(axis=1))] - limit))
    # around three faces, the surface closes in by more than 2 a step
    assert errors[3] < 0.02 and all(b < a / 2 for a, b in zip(errors, errors[1:], strict=False))


def test_normals_of_a_sphere_like_surface_point_outwards(tmp_path):
    """Catmull and Clark's cube is nearly a ball: its normals part from the radius by less than 11 degrees, most at corners."""
    mesh = refined(tmp_path, CUBE, CUBE_FACES, level=3)
    outwards = mesh.positions / np.linalg.norm(mesh.positions, axis=1, keepdims=True)
    assert np.sum(outwards * mesh.normals, axis=1).min() > np.cos(np.radians(11))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=2 * SINGLE)


UV = 'texCoord2f[] primvars:st = {} (interpolation = "{}")'


def by_place(mesh, array):
    """array of the vertices that stand on each place of a flat grid, {(x, y): {values}}."""
    out = {}
    for place, value in zip(mesh.positions[:, :2].round(4).tolist(), array.round(4).tolist(), strict=True):
        out.setdefault(tuple(place), set()).add(tuple(value))
    return out


def test_vertex_primvars_go_with_the_points_and_varying_ones_straight(tmp_path):
    bulge = GRID[:, :2] ** 2
    smooth = refined(tmp_path, bulge @ [[1, 0, 0], [0, 1, 0]], GRID_FACES, UV.format(values(bulge), "vertex"))
    np.testing.assert_allclose(smooth.uv, smooth.positions[:, :2], atol=9 * SINGLE)
    straight = refined(tmp_path, GRID, GRID_FACES, UV.format(values(bulge), "varying"))
    middles = by_place(straight, straight.uv)
    assert middles[1.5, 0.5] == {(2.5, 0.5)} and middles[1.0, 1.0] == {(1.0, 1.0)}  # mean of four, and the point itself


def test_uniform_primvars_stay_with_their_face(tmp_path):
    mesh = refined(tmp_path, CUBE, CUBE_FACES, UV.format(values([(k, 0) for k in range(6)]), "uniform"), level=2)
    assert np.bincount(mesh.uv[mesh.faces][..., 0].astype(int).ravel()).tolist() == [16 * 6] * 6


@pytest.mark.parametrize(
    ("rule", "corner", "side"),
    [
        ("all", (0, 0), (1, 0)), ("boundaries", (0, 0), (1, 0)), ("cornersOnly", (0, 0), (1.25, 0)),
        ("cornersPlus1", (0, 0), (1.25, 0)), ("cornersPlus2", (0, 0), (1.25, 0)), ("none", (0.125, 0.125), (1.25, 0)),
    ],
)  # fmt: skip
def test_face_varying_primvars_on_a_boundary(tmp_path, rule, corner, side):
    """st = place squared on a grid: a boundary value stays where the rule is linear, else it takes an eighth of its neighbours
    (1.25 = 3/4 * 1 + 1/8 * 4); a corner takes them where even corners are smooth, as the points' corners are here."""
    lines = f'uniform token faceVaryingLinearInterpolation = "{rule}"', 'uniform token interpolateBoundary = "edgeOnly"'
    st = [GRID[k, :2] ** 2 for face in GRID_FACES for k in face]
    mesh = refined(tmp_path, GRID, GRID_FACES, *lines, UV.format(values(st), "faceVarying"))
    found = by_place(mesh, mesh.uv)
    assert found[0.125, 0.125] == {corner} and found[1.0, 0.0] == {side}


def test_seams_of_face_varying_primvars_stay_open_and_straight_rules_end_there(tmp_path):
    """Two charts, left and right of x = 2. On the seam each side keeps its own values, refined along it as on a boundary."""
    st = [(GRID[k, 0] + (10 if face[0] % 4 >= 2 else 0), GRID[k, 1] ** 2) for face in GRID_FACES for k in face]
    mesh = refined(tmp_path, GRID, GRID_FACES, UV.format(values(st), "faceVarying"))
    found = by_place(mesh, mesh.uv)
    assert found[2.0, 1.0] == {(2, 1.25), (12, 1.25)}  # (0 + 6 * 1 + 4) / 8
    assert found[2.0, 0.0] == {(2, 0), (12, 0)} and found[1.0, 1.5] == {(1, 2.5)}  # inside: (1 + 4 + 2.5 + 2.5) / 4


CHARTS = {  # of a face of the grid, at a point of it
    "junction": lambda face, k: 0 if face % 3 == 0 else 1 + face // 3,  # one on the left, three beside it
    "crease": lambda face, k: int(face % 3 > 0),  # two that meet at x = 1
    "island": lambda face, k: int(face == 4),  # the face in the middle
    "cut": lambda face, k: int(k == 1 and face % 3 > 0),  # from the boundary at (1, 0) to (1, 1)
}


@pytest.mark.parametrize(
    ("chart", "rule", "expected"),
    [
        ("junction", "cornersOnly", {(0, 1.25), (10, 1), (20, 1)}), ("junction", "cornersPlus1", {(0, 1), (10, 1), (20, 1)}),
        ("crease", "cornersOnly", {(0, 1.25), (10, 1)}), ("crease", "cornersPlus1", {(0, 1), (10, 1)}),
        ("island", "cornersPlus1", {(0, 1.375), (10, 1)}), ("island", "cornersPlus2", {(0, 1), (10, 1)}),
        ("cut", "cornersPlus1", {(1.25, 0.75)}), ("cut", "cornersPlus2", {(0, 1)}),
    ],
)  # fmt: skip
def test_where_seams_meet_or_end(tmp_path, chart, rule, expected):
    """st = (10 times the chart, y squared) at the point (1, 1). By hand: on a seam an eighth of the values before and behind
    and 3/4 of its own: (0 + 6 + 4) / 8, round the island (1 + 6 + 4) / 8, where a cut ends (0 + 6 + 0) / 8; pinned: 1."""
    st = [(10 * CHARTS[chart](side, k), GRID[k, 1] ** 2) for side, face in enumerate(GRID_FACES) for k in face]
    lines = f'uniform token faceVaryingLinearInterpolation = "{rule}"', UV.format(values(st), "faceVarying")
    sharp = creases([(5, 6), (6, 7)], 10) if chart == "crease" else ()
    mesh = refined(tmp_path, GRID, GRID_FACES, *lines, *sharp)
    assert by_place(mesh, mesh.uv)[1.0, 1.0] == expected


# What OpenSubdiv 3.5.0 (far::TopologyRefiner, edgeAndCorner, two uniform levels) gives for CUBE with the creases below, a
# corner, and three numbers that change between the faces 0 to 2 and 3 to 5: means of the products of (x, y, z, a, b, c) over
# the corners of all quads, upper triangle by rows, 5 digits. Run 2026-11-22 in float32.
OPENSUBDIV = {
    "cornersPlus1": (
        0.33965, 0.01094, -0.05013, 1.59052, -0.92907, 0.02086, 0.31587, 0.01994, 3.4541, -2.18115, 0.14448, 0.31936, 5.57073,
        -3.57505, -0.00354, 464.00765, -233.04075, 9.89925, 123.76799, -4.58577, 0.5,
    ),
    "boundaries": (
        0.33965, 0.01094, -0.05013, 1.58314, -0.92785, 0.02086, 0.31587, 0.01994, 3.51163, -2.2195, 0.14448, 0.31936, 5.62298,
        -3.57129, -0.00354, 462.85865, -231.76641, 9.89714, 122.99536, -4.57682, 0.5,
    ),
}  # fmt: skip


@pytest.mark.parametrize("rule", OPENSUBDIV)
def test_fading_creases_and_seams_agree_with_opensubdiv(tmp_path, rule):
    numbers = [
        (k * k, (k + chart) * (3 - k), chart) for side, face in enumerate(CUBE_FACES) for k in face for chart in [side // 3]
    ]
    second = [(row[2], 0) for row in numbers]
    sharp = creases([(0, 1), (1, 3), (3, 7)], 0)
    lines = (
        *sharp[:2], "float[] creaseSharpnesses = [0.5, 1.7, 2.5]", "int[] cornerIndices = [6]",
        "float[] cornerSharpnesses = [1.5]", f'uniform token faceVaryingLinearInterpolation = "{rule}"',
    )  # fmt: skip
    mesh = refined(tmp_path, CUBE, CUBE_FACES, *lines, UV.format(values([row[:2] for row in numbers]), "faceVarying"), level=2)
    chart = refined(tmp_path, CUBE, CUBE_FACES, *lines, UV.format(values(second), "faceVarying"), level=2)
    corners = [np.concatenate([face[0], face[1, 2:]]) for face in mesh.faces.reshape(-1, 2, 3)]
    of_chart = [np.concatenate([face[0], face[1, 2:]]) for face in chart.faces.reshape(-1, 2, 3)]
    found = np.concatenate(
        [mesh.positions[np.ravel(corners)], mesh.uv[np.ravel(corners)], chart.uv[np.ravel(of_chart)][:, :1]], axis=1
    ).astype(float)
    moments = (found.T @ found / len(found))[np.triu_indices(6)]
    # the last of 5 digits, and a rounding of float32 in values of up to 49 * 49
    np.testing.assert_allclose(moments, OPENSUBDIV[rule], rtol=8 * SINGLE, atol=1e-5)


OCTAHEDRON = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=float)
TRIANGLES = tuple((a, b, c) if (a == 0) ^ (b == 2) ^ (c == 4) else (b, a, c) for a in (0, 1) for b in (2, 3) for c in (4, 5))
SIDES = [(a, b) for a in range(6) for b in range(a) if a // 2 != b // 2]
LOOP = 'uniform token subdivisionScheme = "loop"'


def test_one_step_on_an_octahedron_is_loops(tmp_path):
    """By hand: four neighbours weigh beta = (5/8 - (3/8)^2) / 4 each and cancel: corners go to 1 - 4 beta. An edge goes to
    3/8 of its ends; the points across it cancel."""
    mesh = refined(tmp_path, OCTAHEDRON, TRIANGLES, LOOP)
    corner = 1 - (5 / 8 - 9 / 64)
    same_points(mesh, [*(corner * OCTAHEDRON), *(3 / 8 * (OCTAHEDRON[a] + OCTAHEDRON[b]) for a, b in SIDES)])
    assert len(mesh.faces) == 32
    assert (np.sum(mesh.normals * mesh.positions, axis=1) > 0).all()
    across = np.cross(*np.diff(mesh.positions[mesh.faces], axis=1).transpose(1, 0, 2))
    assert (np.sum(across * mesh.positions[mesh.faces[:, 0]], axis=1) > 0).all()


def test_loop_surfaces_carry_creases_and_primvars(tmp_path):
    sharp = refined(tmp_path, OCTAHEDRON, TRIANGLES, LOOP, *creases(SIDES, 10), level=2)
    np.testing.assert_allclose(np.abs(sharp.positions).sum(axis=1), 1, atol=SINGLE)
    np.testing.assert_allclose(np.abs(sharp.normals), np.sqrt(1 / 3), atol=2 * SINGLE)
    smooth = refined(tmp_path, OCTAHEDRON, TRIANGLES, LOOP, UV.format(values(OCTAHEDRON[:, :2]), "vertex"), level=2)
    np.testing.assert_array_equal(smooth.uv, smooth.positions[:, :2])
    linear = UV.format(values(OCTAHEDRON[:, :2]), "varying")
    straight = refined(tmp_path, OCTAHEDRON, TRIANGLES, LOOP, linear, *creases(SIDES, 10), level=2)
    np.testing.assert_array_equal(straight.uv, straight.positions[:, :2])
    st = [OCTAHEDRON[k, :2] for face in TRIANGLES for k in face]
    seamless = refined(tmp_path, OCTAHEDRON, TRIANGLES, LOOP, UV.format(values(st), "faceVarying"), level=2)
    np.testing.assert_array_equal(seamless.uv, seamless.positions[:, :2])


def test_loop_surfaces_of_quads_are_drawn_as_polygons(tmp_path):
    scene = load(tmp_path, polygons(CUBE, CUBE_FACES, LOOP))
    assert len(scene.meshes[0].faces) == 12
    assert scene.not_read == ("Loop subdivision of /m: it has faces that are no triangles, its control mesh is drawn",)


def test_smooth_triangles_weigh_their_middles(tmp_path):
    """By hand (OpenSubdiv's weight of 0.470): an edge of two triangles goes to 0.47 of both middles and 0.03 of its ends."""
    rule = 'uniform token triangleSubdivisionRule = "smooth"'
    mesh = refined(tmp_path, OCTAHEDRON, TRIANGLES, rule)
    far = 0.03 + 0.47 * 2 / 3
    expected = [far * (OCTAHEDRON[a] + OCTAHEDRON[b]) for a, b in SIDES]
    places = distinct(mesh.positions)
    assert all(np.linalg.norm(places - row, axis=1).min() < 2e-6 for row in expected)


def test_materials_of_subsets_follow_their_faces(tmp_path):
    kind = 'uniform token elementType = "face"', 'uniform token familyName = "materialBind"'
    subset = prim("GeomSubset", "top", *kind, "int[] indices = [1]", "rel material:binding = </a>", metadata=BINDING)
    scene = load(tmp_path, prim("Material", "a"), polygons(CUBE, CUBE_FACES, subset), subdivision=2)
    top, rest = (scene.meshes[item.mesh] for item in scene.objects)
    assert [item.name for item in scene.objects] == ["/m/top", "/m"] and (len(top.faces), len(rest.faces)) == (32, 160)
    assert top.positions[:, 2].min() > 0
    seam = {tuple(p): tuple(n) for p, n in zip(top.positions.tolist(), top.normals.tolist(), strict=True)}
    shared = [
        (seam[tuple(p)], n) for p, n in zip(rest.positions.tolist(), rest.normals.tolist(), strict=True) if tuple(p) in seam
    ]
    assert len(shared) == 16 and all(a == tuple(b) for a, b in shared)  # smooth over the border


def test_animated_points_are_refined_after_they_have_moved(tmp_path):
    moved = CUBE * (1, 1, 3)
    keyed = f"point3f[] points.timeSamples = {{ 0: {values(CUBE)}, 24: {values(moved)} }}"
    text = polygons(CUBE, CUBE_FACES).replace(f"point3f[] points = {values(CUBE)}", keyed)
    scene = load(tmp_path, text, header="timeCodesPerSecond = 24", subdivision=2, name="moving.usda")
    still = refined(tmp_path, CUBE, CUBE_FACES, level=2)
    half = scene.deformed(0.5)[0]
    np.testing.assert_allclose(half.positions, scene.meshes[0].positions * (1, 1, 2), atol=4 * SINGLE)
    same_points(scene.meshes[0], still.positions)
    tall = refined(tmp_path, CUBE * (1, 1, 2), CUBE_FACES, level=2)
    nearest = np.linalg.norm(half.positions[:, None] - tall.positions, axis=2).argmin(axis=1)
    np.testing.assert_allclose(half.normals, tall.normals[nearest], atol=8 * SINGLE)


def test_which_meshes_are_refined(tmp_path):
    normals = f'normal3f[] normals = {values(CUBE)} (interpolation = "vertex")'
    scene = load(
        tmp_path,
        polygons(CUBE, CUBE_FACES, name="bare"),
        polygons(CUBE, CUBE_FACES, normals, name="exported"),
        polygons(CUBE, CUBE_FACES, normals, SCHEME, name="named"),
        polygons(CUBE, CUBE_FACES, normals, FLAT, name="polygons"),
        subdivision=1,
    )
    assert [len(mesh.faces) for mesh in scene.meshes] == [48, 12, 48, 12]
    np.testing.assert_array_equal(scene.meshes[1].normals[0], CUBE[0])
    assert scene.not_read == ("subdivision of /exported: it has normals, its polygons are drawn",)
    control = load(tmp_path, polygons(CUBE, CUBE_FACES), subdivision=0, name="control.usda")
    assert len(control.meshes[0].faces) == 12 and control.not_read == ("subdivision of /m: its control mesh is drawn",)
    np.testing.assert_allclose(np.abs(control.meshes[0].normals), np.sqrt(1 / 3), atol=SINGLE)


def test_meshes_that_are_no_manifold_are_refined_with_sharp_edges_there(tmp_path):
    """Three quads on one edge: it stays a curve of its own, and the rest is finite."""
    points = [(0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 0, 1), (-1, 1, 0), (-1, 1, 1), (-1, -1, 0), (-1, -1, 1)]
    mesh = refined(tmp_path, points, [(0, 1, 3, 2), (0, 1, 5, 4), (0, 1, 7, 6)], level=2)
    assert np.isfinite(mesh.positions).all() and len(mesh.faces) == 96
    assert {(0, 0, 0), (0, 0, 0.5), (0, 0, 1)} <= {tuple(row) for row in mesh.positions.tolist()}


def test_faces_of_two_corners_are_passed_over(tmp_path):
    faces = (*CUBE_FACES[:3], (0, 7), *CUBE_FACES[3:])
    uv = UV.format(values([(k, 0) for k in range(7)]), "uniform")
    mesh = refined(tmp_path, CUBE, faces, uv)
    same_points(mesh, plainly(CUBE, CUBE_FACES))
    assert set(mesh.uv[:, 0].tolist()) == {0, 1, 2, 4, 5, 6}


def test_absurd_numbers_are_refused(tmp_path):
    file = usd(tmp_path, polygons(CUBE, CUBE_FACES))
    with pytest.raises(InputError, match=f"^{file}, /m: 6 faces refined 11 times are 25165824, more than 16777216"):
        load_scene(file, subdivision=11)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (("int[] creaseIndices = [0, 99]", "int[] creaseLengths = [2]", "float[] creaseSharpnesses = [1]"), "creases of /m"),
        (("int[] creaseIndices = [0, 1]", "int[] creaseLengths = [3]", "float[] creaseSharpnesses = [1]"), "creases of /m"),
        (("int[] creaseIndices = [0, 1]", "int[] creaseLengths = [-2]", "float[] creaseSharpnesses = [1]"), "creases of /m"),
        (("int[] creaseIndices = [0, 1]", "int[] creaseLengths = [2]"), "creases of /m"),
        (("int[] cornerIndices = [9]", "float[] cornerSharpnesses = [1]"), "corners of /m"),
        (("int[] cornerIndices = [1]",), "corners of /m"),
        (('uniform token subdivisionScheme = "cubic"',), "subdivision scheme cubic of /m"),
    ],
)
def test_what_does_not_fit_is_left_out_and_named(tmp_path, lines, says):
    scene = load(tmp_path, polygons(CUBE, CUBE_FACES, *lines), subdivision=1)
    assert len(scene.not_read) == 1 and scene.not_read[0].startswith(says)
    if "scheme" not in says:
        same_points(scene.meshes[0], plainly(CUBE, CUBE_FACES))
