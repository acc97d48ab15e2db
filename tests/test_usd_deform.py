"""USD that moves: skins, blend shapes, sampled points, visibility and point instancers, against hand-made answers."""

import math

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from framepairs.errors import InputError
from framepairs.scene import load_scene, usd_placement
from usd_stages import BINDING, QUAD, figure, influences, load, matrix, placed, prim, skinned, triangles, usd, values

SINGLE = float(np.finfo(np.float32).eps)
DOUBLE = float(np.finfo(np.float64).eps)
FLAT = 'uniform token subdivisionScheme = "none"'
CODES = "timeCodesPerSecond = 10\nstartTimeCode = 0\nendTimeCode = 10"  # a second is ten codes
TRIANGLE = ((0, 0, 0), (1, 0, 0), (0, 1, 0))
ONCE, TWICE = "point3f[] positions = [(0,0,0)]", "int[] protoIndices = [0, 0]"


def move(x=0.0, y=0.0, z=0.0):
    moved = np.eye(4)
    moved[:3, 3] = x, y, z
    return moved


def turn_z(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def in_world(scene, seconds, item=0):
    """World positions [V, 3] float64 of an object, and its vertices."""
    mesh = scene.objects[item].mesh
    vertices = (scene.deformed(seconds) if scene.deformed else {}).get(mesh, scene.meshes[mesh])
    world = scene.world_from_object(seconds)[item]
    return vertices.positions.astype(np.float64) @ world[:3, :3].T + world[:3, 3], vertices


def in_order(scene, found, rest, item=0):
    """`found` at the vertices that stand at the points `rest` at time 0, in the order of these."""
    begin = in_world(scene, 0.0, item)[0]
    distance = np.linalg.norm(begin[:, None] - np.asarray(rest, float), axis=2)
    assert distance.min(axis=0).max() < 1e-4 * (1 + np.abs(rest).max())
    return found[distance.argmin(axis=0)]


# An arm along x: the shoulder at the origin, the elbow at x = 2. In a second the elbow turns by 90 degrees about z.
ARM = ((0, 0, 0), (1, 1, 0), (2, 1, 0), (3, 0, 0), (4, 1, 0))
ARM_FACES = ((0, 1, 2), (1, 3, 2), (2, 3, 4))
ARM_JOINTS = np.array([(0, 1), (0, 1), (1, 0), (0, 1), (1, 0)])
ARM_WEIGHTS = np.array([(1, 0), (1, 0), (0.5, 0.5), (0, 1), (1, 0)])
HALF = math.sqrt(0.5)
BEND = (
    'uniform token[] joints = ["a", "a/b"]',
    "float3[] translations = [(0, 0, 0), (2, 0, 0)]",
    f"quatf[] rotations.timeSamples = {{ 0: [(1,0,0,0), (1,0,0,0)], 10: [(1,0,0,0), ({HALF},0,0,{HALF})] }}",
    "half3[] scales = [(1, 1, 1), (1, 1, 1)]",
)


def arm(*lines, animation=BEND, away=0.0, skeleton=(), faces=ARM_FACES):
    binds = np.array([move(away), move(away + 2)])
    rests = np.array([move(), move(2)])
    mesh = skinned("arm", triangles(ARM, faces), *influences(ARM_JOINTS, ARM_WEIGHTS), *lines)
    return figure(["a", "a/b"], binds, animation, mesh, rests=rests, skeleton=skeleton)


def bent_arm(degrees):
    """World points of the arm: a point's weight on the elbow turns that share of it about (2, 0, 0)."""
    turned = np.array([(move(2) @ turn_z(degrees) @ move(-2) @ (*point, 1))[:3] for point in ARM])
    share = np.array([[0], [0], [0.5], [1], [1.0]])
    return (1 - share) * np.array(ARM) + share * turned


@pytest.mark.parametrize("seconds", [0.0, 0.5, 1.0, 3.0])
def test_two_joints_bend_an_arm(tmp_path, seconds):
    scene = load(tmp_path, arm(FLAT), header=CODES)
    assert scene.not_read == () and scene.meshes[0].deforms and scene.objects[0].moves
    found = in_order(scene, in_world(scene, seconds)[0], ARM)
    # slerp of float32 quaternions: two roundings of the angle, at a lever of 3
    np.testing.assert_allclose(found, bent_arm(90 * min(seconds, 1)), atol=8 * SINGLE)
    np.testing.assert_array_equal(scene.meshes[0].positions, scene.deformed(0.0)[0].positions)


def test_authored_normals_turn_with_their_joints_and_others_are_made_anew(tmp_path):
    authored = 'normal3f[] normals = [(0,1,0), (0,1,0), (0,1,0), (0,1,0), (0,1,0)] (interpolation = "vertex")'
    scene = load(tmp_path, arm(FLAT, authored), header=CODES)
    normals = in_order(scene, in_world(scene, 1.0)[1].normals, ARM)
    expected = [(0, 1, 0), (0, 1, 0), (-HALF, HALF, 0), (-1, 0, 0), (-1, 0, 0)]
    np.testing.assert_allclose(normals, expected, atol=4 * SINGLE)
    smooth = load(tmp_path, arm(), header=CODES, name="smooth.usda", subdivision=0)  # all triangles stay in the plane z = 0
    facing = np.sign(np.cross(*(np.diff(bent_arm(90)[list(ARM_FACES[0])], axis=0)))[2])
    corner = in_order(smooth, in_world(smooth, 1.0)[1].normals, ARM)[0]
    np.testing.assert_allclose(corner, [0, 0, facing], atol=SINGLE)
    flat = load(tmp_path, arm(FLAT), header=CODES, name="flat.usda")
    assert in_world(flat, 1.0)[1].normals is None


@pytest.mark.parametrize(("scale", "normal"), [(4, (0.25, 1, 0)), (0, (1, 0, 0))])
def test_normals_follow_a_joint_that_scales_unevenly(tmp_path, scale, normal):
    """The elbow scales x: the normal (1, 1, 0) becomes (1/4, 1, 0), not (4, 1, 0); flattened, it is the plane's."""
    stretch = [line.replace("(1, 1, 1)]", f"({scale}, 1, 1)]") if "scales" in line else line for line in BEND]
    still = [line.split(".timeSamples")[0] + " = [(1,0,0,0), (1,0,0,0)]" if "rotations" in line else line for line in stretch]
    authored = f'normal3f[] normals = {values([(1, 1, 0)] * 5)} (interpolation = "vertex")'
    scene = load(tmp_path, arm(FLAT, authored, animation=still), header=CODES)
    assert scene.deformed is None and not scene.meshes[0].deforms and not scene.objects[0].moves  # posed once and for all
    tip = np.array([2 + scale, 0, 0])  # (3, 0, 0), scaled about (2, 0, 0)
    place = np.argmin(np.linalg.norm(scene.meshes[0].positions - tip, axis=1))
    np.testing.assert_allclose(scene.meshes[0].positions[place], tip, atol=8 * SINGLE)
    np.testing.assert_allclose(scene.meshes[0].normals[place], np.array(normal) / np.linalg.norm(normal), atol=2 * SINGLE)


def random_figure(folder, rigid=False):
    """A figure of 5 joints and 40 points whose mesh lists its own joints in another order, with a bind transform."""
    rng = np.random.default_rng(5)
    joints = ["a", "a/b", "a/b/c", "a/d", "a/d/e"]
    frames = np.array([np.array(Gf.Matrix4d(_rotation(rng), Gf.Vec3d(*rng.normal(size=3)))).T for _ in range(10)])
    points, width = rng.normal(size=(40, 3)).round(3), 1 if rigid else 7
    count = 1 if rigid else 40
    weights = rng.random((count, width)) * (rng.random((count, width)) < 0.7)
    own = 'uniform token[] skel:joints = ["a/d/e", "a", "a/b/c", "a/d"]'
    bind = np.array(Gf.Matrix4d(_rotation(rng), Gf.Vec3d(1, 2, 3))).T
    geometry = f"matrix4d primvars:skel:geomBindTransform = {matrix(bind)}"
    quaternions = [[_rotation(rng).GetQuat() for _ in joints] for _ in range(2)]
    text = ["[" + ", ".join(str((q.GetReal(), *q.GetImaginary())) for q in row) + "]" for row in quaternions]
    animation = (
        f"uniform token[] joints = {str(joints).replace(chr(39), chr(34))}",
        f"float3[] translations = {values(rng.normal(size=(5, 3)))}",
        f"quatf[] rotations.timeSamples = {{ 0: {text[0]}, 10: {text[1]} }}",
        f"half3[] scales = {values(rng.uniform(0.5, 2, (5, 3)))}",
    )
    chosen = rng.integers(0, 4, (count, width))
    lines = influences(chosen, weights.round(4), "constant" if rigid else "vertex")
    faces = rng.permuted(np.tile(np.arange(40), (20, 1)), axis=1)[:, :3]
    elsewhere = placed("double3 xformOp:translate", "(9, 9, 9)")  # a skinned mesh does not stand where its prim does
    mesh = skinned("skin", triangles(points, faces), own, geometry, FLAT, *lines, *elsewhere)
    return usd(folder, figure(joints, frames[:5], animation, mesh, rests=frames[5:]), header=CODES)


def _rotation(rng):
    return Gf.Rotation(Gf.Vec3d(*rng.normal(size=3)), float(rng.uniform(0, 180)))


def usdskel_points(file, seconds, path=None):
    """World points [P, 3] as UsdSkel skins them, in float32: the oracle."""
    stage = Usd.Stage.Open(str(file))
    cache, code = UsdSkel.Cache(), Usd.TimeCode(seconds * stage.GetTimeCodesPerSecond())
    root = UsdSkel.Root(next(item for item in stage.Traverse() if item.IsA(UsdSkel.Root)))
    cache.Populate(root, Usd.TraverseInstanceProxies())
    binding = cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies())[0]
    skeleton, target = cache.GetSkelQuery(binding.GetSkeleton()), binding.GetSkinningTargets()[0]
    transforms = skeleton.ComputeSkinningTransforms(code)
    points = UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get(code)
    if target.IsRigidlyDeformed():
        whole = np.array(target.ComputeSkinnedTransform(transforms, code))
        points = np.array(points) @ whole[:3, :3] + whole[3, :3]
    else:
        assert target.ComputeSkinnedPoints(transforms, points, code)
    world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(skeleton.GetPrim()))
    faces = np.array(UsdGeom.Mesh(target.GetPrim()).GetFaceVertexIndicesAttr().Get())
    return (np.array(points, dtype=np.float64) @ world[:3, :3] + world[3, :3])[faces.reshape(-1, 3)]


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("seconds", [0.0, 0.37, 1.0])
def test_skinning_agrees_with_usdskels_own(tmp_path, rigid, seconds):
    file = random_figure(tmp_path, rigid)
    scene = load_scene(file)
    expected = usdskel_points(file, seconds)
    found = in_world(scene, seconds)[0][scene.meshes[0].faces]
    # UsdSkel sums up to 7 influences of size <= 40 in float32: 16 roundings
    np.testing.assert_allclose(found, expected, atol=16 * SINGLE * np.abs(expected).max())
    assert scene.meshes[0].deforms is not rigid and scene.objects[0].moves


def test_more_influences_than_a_gpu_would_take(tmp_path):
    # 12 influences of 1/12 each on joints that all move by (0, 3, 0): the points move by that
    names = [f"j{k}" for k in range(12)]
    identity = np.tile(np.eye(4), (12, 1, 1))
    animation = (
        f"uniform token[] joints = {str(names).replace(chr(39), chr(34))}",
        f"float3[] translations.timeSamples = {{ 0: {values([(0, 0, 0)] * 12)}, 10: {values([(0, 3, 0)] * 12)} }}",
        f"quatf[] rotations = {values([(1, 0, 0, 0)] * 12)}",
        f"half3[] scales = {values([(1, 1, 1)] * 12)}",
    )
    lines = influences(np.tile(np.arange(12), (3, 1)), np.full((3, 12), 1 / 12))
    mesh = skinned("m", triangles(TRIANGLE), FLAT, *lines)
    scene = load(tmp_path, figure(names, identity, animation, mesh), header=CODES)
    moved = in_world(scene, 0.5)[0] - in_world(scene, 0.0)[0]
    # twelve float32 weights of 1/12 sum to 1 within 12 roundings
    np.testing.assert_allclose(moved, np.tile([0, 1.5, 0], (3, 1)), atol=12 * SINGLE)


@pytest.mark.parametrize("where", ["bones", "bind", "animation"])
def test_a_figure_a_million_units_away_keeps_its_shape(tmp_path, where):
    """The skeleton's prim, the pose in which it was bound, or its root joint lies 1e6 away."""
    away = 1e6
    bind = f"matrix4d primvars:skel:geomBindTransform = {matrix(move(away))}"
    far_joint = [line.replace("[(0, 0, 0), (2", f"[({away}, 0, 0), (2") for line in BEND]
    text = {
        "bones": arm(FLAT, skeleton=placed("double3 xformOp:translate", f"({away}, 0, 0)")),
        "bind": arm(FLAT, bind, away=away),
        "animation": arm(FLAT, animation=far_joint),
    }[where]
    scene = load(tmp_path, text, header=CODES)
    shift = np.array([0 if where == "bind" else away, 0, 0])
    for seconds in (0.0, 0.5, 1.0):
        found = in_order(scene, in_world(scene, seconds)[0], ARM + shift) - shift
        size = 4.1
        # float32 of coordinates below the figure's size, the float32 slerp at a lever of 3, and float64 at 1e6
        np.testing.assert_allclose(found, bent_arm(90 * seconds), atol=8 * SINGLE + 1e-7 * size + 16 * DOUBLE * away)
    assert np.abs(scene.meshes[0].positions).max() < 5


def shape(name, *lines):
    return prim("BlendShape", name, *(f"uniform {line}" for line in lines))


def blended(weights, *shapes, lines=(), names=("up", "out")):
    listed = ", ".join(f'"{name}"' for name in names)
    targets = ", ".join(f"</fig/m/{name}>" for name in names)
    mesh = skinned(
        "m", triangles(TRIANGLE), *lines, f"uniform token[] skel:blendShapes = [{listed}]",
        f"rel skel:blendShapeTargets = [{targets}]", *shapes,
    )  # fmt: skip
    animation = 'uniform token[] blendShapes = ["out", "up"]', f"float[] blendShapeWeights.timeSamples = {weights}"
    return figure(["a"], np.eye(4)[None], animation, mesh)


UP = shape("up", "vector3f[] offsets = [(0,0,1), (0,0,2), (0,0,4)]", "vector3f[] normalOffsets = [(3,0,0), (0,3,0), (0,0,3)]")
OUT = shape("out", "vector3f[] offsets = [(8, 0, 0)]", "int[] pointIndices = [2]")


def test_blend_shapes_half_way_dense_and_sparse(tmp_path):
    authored = 'normal3f[] normals = [(0,0,1), (0,0,1), (0,0,1)] (interpolation = "vertex")'
    text = blended("{ 0: [0, 0], 10: [0.5, 1] }", UP, OUT, lines=(FLAT, authored))
    scene = load(tmp_path, text, header=CODES)
    assert scene.not_read == () and scene.objects[0].moves
    points, vertices = in_world(scene, 0.5)  # out 0.25, up 0.5
    expected = np.array(TRIANGLE) + [(0, 0, 0.5), (0, 0, 1), (2, 0, 2)]
    np.testing.assert_array_equal(in_order(scene, points, TRIANGLE), expected)
    normals = np.array([(1.5, 0, 1), (0, 1.5, 1), (0, 0, 2.5)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(in_order(scene, vertices.normals, TRIANGLE), normals, atol=SINGLE)


@pytest.mark.parametrize(("weight", "z"), [(0.25, 2.5), (0.5, 5.0), (0.75, 3.0), (1.0, 1.0)])
def test_in_between_shapes_are_met_on_the_way(tmp_path, weight, z):
    between = "vector3f[] inbetweens:half = [(0,0,5), (0,0,5), (0,0,5)] (weight = 0.5)"
    full = shape("up", "vector3f[] offsets = [(0,0,1), (0,0,1), (0,0,1)]", between)
    text = blended("{ 0: [0, 0], 10: [0, 1] }", full, OUT, lines=(FLAT,))
    scene = load(tmp_path, text, header=CODES)
    np.testing.assert_allclose(in_world(scene, weight)[0][:, 2], z, atol=8 * SINGLE)


def test_points_and_normals_between_their_samples(tmp_path):
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0)], 10: [(0,0,4), (1,8,0), (0,1,0)] }"
    normals = "normal3f[] normals.timeSamples = { 0: [(0,0,1), (0,0,1), (0,0,1)], 10: [(1,0,0), (0,0,1), (0,0,1)] }"
    scene = load(tmp_path, prim("Mesh", "m", triangles(points), FLAT, normals), header=CODES)  # vertex unless said otherwise
    positions, vertices = in_world(scene, 0.25)
    np.testing.assert_array_equal(in_order(scene, positions, TRIANGLE), [(0, 0, 1), (1, 2, 0), (0, 1, 0)])
    slanted = np.array([0.25, 0, 0.75]) / math.hypot(0.25, 0.75)
    np.testing.assert_allclose(in_order(scene, vertices.normals, TRIANGLE)[0], slanted, atol=SINGLE)
    np.testing.assert_array_equal(in_world(scene, 9.0)[0], in_world(scene, 1.0)[0])  # held past the last sample


def test_points_that_begin_in_one_place_may_part(tmp_path):
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0), (0,0,0)], 10: [(0,0,0), (1,0,0), (0,1,0), (0,0,7)] }"
    scene = load(tmp_path, prim("Mesh", "m", triangles(points, ((0, 1, 2), (3, 2, 1))), FLAT), header=CODES)
    faces = scene.meshes[0].faces
    assert len(scene.meshes[0].positions) == 4
    np.testing.assert_array_equal(in_world(scene, 1.0)[0][faces][:, 0], [(0, 0, 0), (0, 0, 7)])


def test_material_subsets_of_a_moving_mesh_move_together(tmp_path):
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0), (1,1,0)], 10: [(0,0,2), (1,0,2), (0,1,2), (1,1,2)] }"
    kind = 'uniform token elementType = "face"', 'uniform token familyName = "materialBind"'
    subset = prim("GeomSubset", "part", *kind, "int[] indices = [1]", "rel material:binding = </a>", metadata=BINDING)
    uv = 'texCoord2f[] primvars:st = [(0,0), (1,0), (0,1), (1,1)] (interpolation = "vertex")'
    mesh = prim("Mesh", "m", triangles(points, ((0, 1, 2), (2, 1, 3))), uv, subset, metadata=BINDING)
    scene = load(tmp_path, prim("Material", "a"), mesh, header=CODES, subdivision=0)
    assert [item.name for item in scene.objects] == ["/m/part", "/m"] and set(scene.deformed(0.5)) == {0, 1}
    for index in (0, 1):
        now = scene.deformed(0.5)[index]
        np.testing.assert_array_equal(now.positions[:, 2], [1, 1, 1])
        np.testing.assert_array_equal(now.positions[:, :2], scene.meshes[index].uv)
        np.testing.assert_array_equal(now.normals, np.tile([0, 0, 1], (3, 1)))


def test_seams_of_normals_and_uv_stay_open_while_points_move(tmp_path):
    """Two triangles on an edge: one corner of it differs in its normal, the other in its uv."""
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0), (1,1,0)], 10: [(0,0,2), (1,0,2), (0,1,2), (1,1,2)] }"
    faces = np.array([(0, 1, 2), (2, 1, 3)])
    normals = np.array([[(0, 0, 1), (0, 0, 1), (0, 0, 1)], [(0, 0, 1), (1, 0, 0), (0, 0, 1)]])
    uv = np.array([[(0, 0), (1, 0), (0, 1)], [(5, 5), (1, 0), (1, 1)]])
    per_corner = '(interpolation = "faceVarying")'
    lines = (
        f"normal3f[] primvars:normals = {values(normals.reshape(-1, 3))} {per_corner}",
        f"texCoord2f[] primvars:st = {values(uv.reshape(-1, 2))} {per_corner}",
    )
    scene = load(tmp_path, prim("Mesh", "m", triangles(points, faces), FLAT, *lines), header=CODES)
    mesh, now = scene.meshes[0], scene.deformed(0.5)[0]
    assert len(mesh.positions) == 6  # four points, two of them twice; the other four corners are merged or alone
    np.testing.assert_array_equal(mesh.uv[mesh.faces], uv)
    np.testing.assert_array_equal(now.normals[mesh.faces], normals)
    expected = np.array([(0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1)])[faces]
    np.testing.assert_array_equal(now.positions[mesh.faces], expected)


def test_visibility_switches_and_is_inherited(tmp_path):
    blink = 'token visibility.timeSamples = { 0: "inherited", 4: "invisible", 8: "inherited" }'
    never = 'token visibility.timeSamples = { 0: "invisible", 4: "invisible" }'
    always = 'token visibility.timeSamples = { 0: "inherited", 4: "inherited" }'
    scene = load(
        tmp_path,
        prim("Xform", "x", blink, prim("Mesh", "m", QUAD)),
        *(prim("Mesh", name, QUAD, line) for name, line in (("never", never), ("always", always))),
        header=CODES,
    )
    assert [(item.name, item.moves) for item in scene.objects] == [("/x/m", True), ("/always", False)]
    for seconds, shown in ((0.0, True), (0.39, True), (0.4, False), (0.79, False), (0.8, True), (5.0, True)):
        assert scene.visible(seconds).tolist() == [shown, True] and scene.visible(seconds).dtype == np.bool_
    assert load(tmp_path, prim("Mesh", "m", QUAD), name="still.usda").visible is None


def instancer(*lines, prototypes=("a",), name="many"):
    bodies = [
        prim("Xform", key, *placed("double3 xformOp:translate", "(0, 0, 5)"), prim("Mesh", "m", QUAD)) for key in prototypes
    ]
    targets = ", ".join(f"</{name}/{key}>" for key in prototypes)
    return prim("PointInstancer", name, f"rel prototypes = [{targets}]", *lines, *bodies)


def test_instances_are_scaled_turned_and_placed_with_their_prototypes_transform(tmp_path):
    lines = (
        "int[] protoIndices = [0, 1, 0]",
        "point3f[] positions = [(1,0,0), (2,0,0), (3,0,0)]",
        "quath[] orientations = [(1,0,0,0), (1,0,0,0), (0,0,0,1)]",
        "float3[] scales = [(1,1,1), (2,3,4), (1,2,1)]",
    )
    scene = load(tmp_path, instancer(*lines, prototypes="ab"))
    assert [(item.name, item.mesh, item.moves) for item in scene.objects] == [
        ("/many[0]/a/m", 0, False), ("/many[2]/a/m", 0, False), ("/many[1]/b/m", 1, False)
    ]  # fmt: skip
    found = scene.world_from_object(0.0)
    lift = move(0, 0, 5)
    expected = [
        move(1) @ lift,
        move(3) @ turn_z(180) @ np.diag([1, 2, 1, 1]) @ lift,
        move(2) @ np.diag([2, 3, 4, 1]) @ lift,
    ]
    np.testing.assert_allclose(found, expected, atol=8 * DOUBLE)


def test_instances_move_hide_come_and_go_by_their_ids(tmp_path):
    lines = (
        "int[] protoIndices.timeSamples = { 0: [0, 0], 5: [0, 0, 0] }",
        "int64[] ids.timeSamples = { 0: [7, 3], 5: [9, 7, 3] }",
        "int64[] invisibleIds.timeSamples = { 0: [], 8: [7] }",
        "point3f[] positions.timeSamples = { 0: [(7,0,0), (3,0,0)], 5: [(9,0,0), (7,1,0), (3,0,0)] }",
    )
    scene = load(tmp_path, instancer(*lines), header=CODES)
    assert [item.name for item in scene.objects] == ["/many[7]/a/m", "/many[3]/a/m", "/many[9]/a/m"]
    assert all(item.moves for item in scene.objects)
    assert [scene.visible(t).tolist() for t in (0.0, 0.5, 0.8)] == [[1, 1, 0], [1, 1, 1], [0, 1, 1]]
    np.testing.assert_array_equal(scene.world_from_object(0.0)[:, :3, 3], [(7, 0, 5), (3, 0, 5), (9, 0, 5)])
    np.testing.assert_array_equal(scene.world_from_object(0.6)[:, :3, 3], [(7, 1, 5), (3, 0, 5), (9, 0, 5)])


def test_instances_that_are_never_shown_are_left_out(tmp_path):
    lines = "int[] protoIndices = [0, 0, 0]", "point3f[] positions = [(0,0,0), (1,0,0), (2,0,0)]", "int64[] invisibleIds = [1]"
    scene = load(tmp_path, instancer(*lines))
    assert [item.name for item in scene.objects] == ["/many[0]/a/m", "/many[2]/a/m"] and scene.visible is None
    np.testing.assert_array_equal(scene.world_from_object(0.0)[:, 0, 3], [0, 2])


def test_a_prototype_in_a_hidden_folder_shows_in_its_instances(tmp_path):
    store = prim("Scope", "store", 'token visibility = "invisible"', prim("Mesh", "m", QUAD))
    lines = "rel prototypes = [</store/m>]", "int[] protoIndices = [0]", ONCE
    scene = load(tmp_path, store, prim("PointInstancer", "many", *lines))
    assert [item.name for item in scene.objects] == ["/many[0]/m"]


def test_what_moves_or_hides_behind_instances_keeps_its_row(tmp_path):
    slide = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (0, 8, 0) }"
    blink = 'token visibility.timeSamples = { 0: "inherited", 5: "invisible" }'
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    many = instancer(TWICE, "point3f[] positions = [(1,0,0), (2,0,0)]")
    scene = load(tmp_path, many, prim("Mesh", "m", QUAD, slide, blink, order), header=CODES)
    assert [item.moves for item in scene.objects] == [False, False, True]
    np.testing.assert_array_equal(scene.world_from_object(0.5)[:, :3, 3], [(1, 0, 5), (2, 0, 5), (0, 4, 0)])
    assert scene.visible(0.5).tolist() == [True, True, False]


def test_instances_follow_their_velocities(tmp_path):
    # 4 units a second from code 0 on, and 10 codes a second
    lines = (
        "int[] protoIndices = [0]",
        "point3f[] positions.timeSamples = { 0: [(1,0,0)] }",
        "vector3f[] velocities.timeSamples = { 0: [(0,4,0)] }",
    )
    scene = load(tmp_path, instancer(*lines), header=CODES)
    assert scene.objects[0].moves
    np.testing.assert_allclose(scene.world_from_object(0.5)[0, :3, 3], [1, 2, 5], atol=4 * SINGLE)


def test_instances_share_the_meshes_of_a_skinned_prototype(tmp_path):
    """Two arms, one beside the other, bend together."""
    body = arm(FLAT).replace("/fig/", "/many/fig/").rstrip()[:-1] + prim("Mesh", "box", QUAD) + "}\n"
    lines = "rel prototypes = [</many/fig>]", "int[] protoIndices = [0, 0]", "point3f[] positions = [(0,0,0), (0,0,9)]"
    scene = load(tmp_path, prim("PointInstancer", "many", *lines, body), header=CODES)
    assert [(item.name, item.mesh, item.moves) for item in scene.objects] == [
        ("/many[0]/fig/arm", 0, True), ("/many[1]/fig/arm", 0, True),
        ("/many[0]/fig/box", 1, False), ("/many[1]/fig/box", 1, False),
    ]  # fmt: skip
    for item, z in ((0, 0), (1, 9)):
        rest = np.array(ARM) + (0, 0, z)
        found = in_order(scene, in_world(scene, 1.0, item)[0], rest, item)
        np.testing.assert_allclose(found, bent_arm(90) + (0, 0, z), atol=8 * SINGLE)


def test_native_instances_of_a_skinned_figure_bend_each_in_its_place(tmp_path):
    body = arm(FLAT).replace('def SkelRoot "fig"', 'class SkelRoot "_fig"').replace("/fig/", "/_fig/")
    places = (placed("double3 xformOp:translate", (0, 0, z)) for z in (0, 9))
    shares = "instanceable = true\nreferences = </_fig>"
    shown = [prim("SkelRoot", f"i{k}", *place, metadata=shares) for k, place in enumerate(places)]
    scene = load(tmp_path, body, *shown, header=CODES)
    assert [(item.name, item.mesh) for item in scene.objects] == [("/i0/arm", 0), ("/i1/arm", 1)] and scene.not_read == ()
    for item, z in ((0, 0), (1, 9)):
        found = in_order(scene, in_world(scene, 1.0, item)[0], np.array(ARM) + (0, 0, z), item)
        np.testing.assert_allclose(found, bent_arm(90) + (0, 0, z), atol=8 * SINGLE)


def test_native_instances_share_a_mesh_whose_points_are_sampled(tmp_path):
    """As leaves in the wind; each has its place, and the mesh is computed once."""
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0)], 10: [(0,0,1), (1,0,1), (0,1,3)] }"
    body = prim("Xform", "_tree", prim("Mesh", "leaf", triangles(points), FLAT)).replace("def Xform", "class Xform")
    places = (placed("double3 xformOp:translate", (0, 0, z)) for z in (0, 9))
    shares = "instanceable = true\nreferences = </_tree>"
    shown = [prim("Xform", f"i{k}", *place, metadata=shares) for k, place in enumerate(places)]
    scene = load(tmp_path, body, *shown, header=CODES)
    assert [(item.name, item.mesh, item.moves) for item in scene.objects] == [("/i0/leaf", 0, True), ("/i1/leaf", 0, True)]
    assert len(scene.meshes) == 1 and list(scene.deformed(0.5)) == [0]
    for item, z in ((0, 0), (1, 9)):
        assert {tuple(point) for point in in_world(scene, 1.0, item)[0]} == {(0, 0, 1 + z), (1, 0, 1 + z), (0, 1, 3 + z)}


def test_a_part_that_hangs_on_one_joint_moves_with_it_in_every_instance(tmp_path):
    """A blade on the elbow keeps its shape: the instances share its mesh, and their transforms turn."""
    blade = skinned("blade", triangles(TRIANGLE), *influences([(1,)], [(1,)], "constant"))
    body = figure(["a", "a/b"], [np.eye(4), move(2)], BEND, blade).replace("/fig/", "/many/fig/")
    scales = "float3[] scales = [(1,1,1), (2,2,2)]"
    lines = "rel prototypes = [</many/fig>]", TWICE, "point3f[] positions = [(0,0,0), (0,0,9)]", scales
    scene = load(tmp_path, prim("PointInstancer", "many", *lines, body), header=CODES)
    assert [(item.mesh, item.moves) for item in scene.objects] == [(0, True), (0, True)] and scene.deformed is None
    turned = move(2) @ turn_z(90) @ move(-2)
    expected = [turned, move(0, 0, 9) @ np.diag([2, 2, 2, 1]) @ turned]
    np.testing.assert_allclose(scene.world_from_object(1.0), expected, atol=16 * SINGLE)


def test_equal_ids_are_still_separate_instances(tmp_path):
    lines = TWICE, "int64[] ids = [4, 4]", "point3f[] positions = [(0,0,0), (1,0,0)]"
    np.testing.assert_array_equal(load(tmp_path, instancer(*lines)).world_from_object(0.0)[:, 0, 3], [0, 1])


def test_ten_thousand_instances(tmp_path):
    count = 10_000
    positions = np.arange(3 * count).reshape(-1, 3) % 97
    scene = load(tmp_path, instancer(f"int[] protoIndices = {[0] * count}", f"point3f[] positions = {values(positions)}"))
    assert len(scene.objects) == count and len(scene.meshes) == 1
    found = scene.world_from_object(0.7)
    np.testing.assert_array_equal(found[:, :3, 3], positions + [0, 0, 5])


def test_too_many_instances_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_placement, "MOST_INSTANCES", 2)
    load(tmp_path, instancer(TWICE, "point3f[] positions = [(0,0,0), (1,0,0)]"))
    with pytest.raises(InputError, match=r"more.usda, /many: 3 instances, more than 2"):
        load(tmp_path, instancer("int[] protoIndices = [0, 0, 0]"), name="more.usda")


TURNED = triangles(TRIANGLE).replace("Indices = [0, 1, 2]", "Indices.timeSamples = { 0: [0,1,2], 5: [0,2,1] }")
ELBOW = "[0, 1, 0, 1, 1, 0, 0, 1, 1, 0]"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (prim("Mesh", "m", TURNED), "/m: its faces change at time code 5"),
        (
            prim("Mesh", "m", triangles(".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0)], 5: [(0,0,0)] }")),
            "/m: 1 points at time code 5, 3 at the first",
        ),
        (arm().replace(ELBOW, "[0, 1, 0, 1, 1, 0, 0, 1]"), "/fig/arm: joint influences do not fit"),
        (arm().replace(ELBOW, "[0, 1, 0, 1, 1, 0, 0, 5, 1, 0]"), "/fig/arm: joint index 5 with only 2"),
        (blended("{ 0: [0, 0] }", UP, OUT.replace("[2]", "[3]")), "/fig/m/out: offsets do not fit the 3 points of /fig/m"),
        (instancer("int[] protoIndices = [2]", ONCE), "/many: prototype index 2 with only 1"),
        (instancer("int[] protoIndices = [-1]", ONCE), "/many: prototype index -1 with only 1"),
        (instancer("int[] protoIndices = [0]", ONCE.replace("(0,0,0)", "(nan,0,0)")), "/many: positions,.*not finite"),
        (
            prim("PointInstancer", "many", "rel prototypes = [</gone>]", "int[] protoIndices = [0]", ONCE),
            "/many: names a prototype that is not there",
        ),
        (instancer(TWICE, ONCE), "/many: positions, orient.* its 2 instances"),
    ],
    ids=["faces", "points", "influences", "joint", "offsets", "prototype", "negative", "nan", "gone", "positions"],
)
def test_what_does_not_fit_is_refused_with_the_prim(tmp_path, text, says):
    file = usd(tmp_path, text)
    with pytest.raises(InputError, match=f"^{file}, {says}"):
        load_scene(file)


def test_points_that_are_not_finite_later_are_named_when_they_come(tmp_path):
    points = ".timeSamples = { 0: [(0,0,0), (1,0,0), (0,1,0)], 10: [(nan,0,4), (1,8,0), (0,1,0)] }"
    scene = load(tmp_path, prim("Mesh", "m", triangles(points), FLAT), header=CODES)
    with pytest.raises(InputError, match=r"scene.usda, /m: points are not finite at time code 5"):
        scene.deformed(0.5)


def test_what_is_still_not_read_is_named(tmp_path):
    quaternion = 'uniform token primvars:skel:skinningMethod = "dualQuaternion"'
    said = load(tmp_path, arm(FLAT, quaternion), header=CODES).not_read
    assert said == ("dual quaternion skinning of /fig/arm: joints are blended linearly",)
    loose = skinned("m", triangles(TRIANGLE), *influences([(0,)] * 3, [(1,)] * 3))
    said = load(tmp_path, loose, name="loose.usda").not_read
    assert said == ("skinning of /m: it is bound to no skeleton under a SkelRoot",)
    lamp = prim("DomeLight", "lamp", 'token visibility.timeSamples = { 0: "inherited", 4: "invisible" }')
    assert any("visibility of light /lamp" in item for item in load(tmp_path, lamp, name="lamp.usda").not_read)
    inner = instancer("int[] protoIndices = [0]", ONCE, name="many/in").replace('"many/in"', '"in"')
    lines = "rel prototypes = [</many/in>]", "int[] protoIndices = [0]", ONCE
    nested = load(tmp_path, prim("PointInstancer", "many", *lines, inner), name="nested.usda")
    assert nested.not_read == ("PointInstancer /many/in in a prototype of /many",) and nested.objects == ()


def test_the_rigged_figure_walks_as_usdskel_has_it(assets):
    file = assets / "RiggedFigureUSD" / "RiggedFigure.usdz"
    scene = load_scene(file)
    assert scene.not_read == () and scene.objects[0].moves and scene.meshes[0].deforms
    for seconds in (0.0, 0.3, 1.25):
        expected = usdskel_points(file, seconds)
        found, vertices = in_world(scene, seconds)
        # UsdSkel skins in float32 what is 2 units high: 16 roundings
        np.testing.assert_allclose(found[scene.meshes[0].faces], expected, atol=16 * SINGLE * 2)
        np.testing.assert_allclose(np.linalg.norm(vertices.normals, axis=1), 1, atol=4 * SINGLE)
    assert np.abs(in_world(scene, 1.25)[0] - in_world(scene, 0.0)[0]).max() > 0.1


def test_still_assets_are_read_as_before(assets):
    cube = load_scene(assets / "AnimatedCubeUSD" / "AnimatedCube.usdz")
    assert cube.deformed is None and cube.visible is None and [item.moves for item in cube.objects] == [True]
    rough = load_scene(assets / "RoughnessTestUSD" / "RoughnessTest.usdz")
    assert rough.deformed is None and rough.visible is None and not rough.moves and len(rough.objects) >= 6
