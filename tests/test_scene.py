"""USD stages: geometry, primvars, transforms, instances, what is left out, and broken files."""

import math

import numpy as np
import OpenEXR
import pytest

from framepairs.errors import InputError
from framepairs.scene import light_scene, load_scene
from usd_stages import BINDING, POINTS, QUAD, load, placed, prim, usd

ROUNDING = 32 * np.finfo(np.float64).eps
HOUSE = f"int[] faceVertexCounts = [4, 3]\nint[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 4]\n{POINTS}"
FLAT = 'uniform token subdivisionScheme = "none"'


def corners(mesh, values):
    """[T, 3, k] of per-vertex values."""
    return values[mesh.faces]


def test_polygons_become_fans_that_keep_their_side(tmp_path):
    scene = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT))
    mesh = scene.meshes[0]
    expected = [[(0, 0), (2, 0), (2, 1)], [(0, 0), (2, 1), (0, 1)], [(0, 1), (2, 1), (1, 3)]]
    np.testing.assert_array_equal(corners(mesh, mesh.positions)[..., :2], expected)
    assert mesh.normals is None and mesh.uv is None and mesh.faces.dtype == np.uint32
    assert [(item.name, item.mesh, item.moves) for item in scene.objects] == [("/house", 0, False)]


def test_left_handed_meshes_are_turned_over(tmp_path):
    mesh = load(tmp_path, prim("Mesh", "house", HOUSE, 'uniform token orientation = "leftHanded"')).meshes[0]
    a, b, c = np.moveaxis(corners(mesh, mesh.positions), 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()
    np.testing.assert_array_equal(mesh.normals, np.tile([0, 0, -1], (len(mesh.normals), 1)))


def test_meshes_without_normals_are_smooth_unless_their_scheme_is_none(tmp_path):
    # A roof: two unit squares' halves at right angles, meeting in an edge of vertices 0 and 1.
    roof = "int[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 1, 2, 1, 0, 3]\n"
    roof += "point3f[] points = [(0,0,0), (1,0,0), (0,1,0), (0,0,1)]"
    mesh = load(tmp_path, prim("Mesh", "roof", roof), subdivision=0).meshes[0]
    on_edge = mesh.normals[np.all(mesh.positions[:, 1:] == 0, axis=1)]
    np.testing.assert_allclose(on_edge, np.tile([0, math.sqrt(0.5), math.sqrt(0.5)], (2, 1)), atol=2.0**-23)


@pytest.mark.parametrize(
    ("interpolation", "values", "u_at_corners"),
    [
        ("constant", "(3, 0)", [(3, 3, 3)] * 3),
        ("uniform", "(1, 0), (2, 0)", [(1, 1, 1), (1, 1, 1), (2, 2, 2)]),
        ("vertex", "(0,0), (1,0), (2,0), (3,0), (4,0)", [(0, 1, 2), (0, 2, 3), (3, 2, 4)]),
        ("faceVarying", "(0,0), (1,0), (2,0), (3,0), (4,0), (5,0), (6,0)", [(0, 1, 2), (0, 2, 3), (4, 5, 6)]),
    ],
)
def test_primvars_reach_the_corners(tmp_path, interpolation, values, u_at_corners):
    uv = f'texCoord2f[] primvars:st = [{values}] (interpolation = "{interpolation}")'
    mesh = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, uv)).meshes[0]
    np.testing.assert_array_equal(corners(mesh, mesh.uv)[..., 0], u_at_corners)


def test_indexed_face_varying_normals_split_vertices(tmp_path):
    normals = 'normal3f[] primvars:normals = [(0,0,1), (0,1,0)] (interpolation = "faceVarying")'
    indices = "int[] primvars:normals:indices = [0, 0, 0, 0, 1, 1, 1]"
    mesh = load(tmp_path, prim("Mesh", "house", HOUSE, normals, indices)).meshes[0]
    np.testing.assert_array_equal(corners(mesh, mesh.normals), [[(0, 0, 1)] * 3] * 2 + [[(0, 1, 0)] * 3])
    assert len(mesh.positions) == 7


def test_three_component_texture_coordinates_give_their_first_two(tmp_path):
    uv = 'texCoord3f[] primvars:st = [(0,0,9), (1,0,9), (1,1,9), (0,1,9), (0,0,9)] (interpolation = "vertex")'
    mesh = load(tmp_path, prim("Mesh", "quad", QUAD, FLAT, uv)).meshes[0]
    np.testing.assert_array_equal(corners(mesh, mesh.uv)[0], [(0, 0), (1, 0), (1, 1)])


def test_subsets_divide_a_mesh_by_material(tmp_path):
    binding = "rel material:binding = </{}>"
    kind = 'uniform token elementType = "face"', 'uniform token familyName = "materialBind"'
    subset = prim("GeomSubset", "roof", *kind, "int[] indices = [1]", binding.format("b"), metadata=BINDING)
    house = prim("Mesh", "house", HOUSE, FLAT, binding.format("a"), subset, metadata=BINDING)
    scene = load(tmp_path, prim("Material", "a"), prim("Material", "b"), house)
    named = [(item.name, scene.materials[item.material].name) for item in scene.objects]
    assert named == [("/house/roof", "/b"), ("/house", "/a")]
    assert [len(scene.meshes[item.mesh].faces) for item in scene.objects] == [1, 2]


def test_nested_animated_transforms_at_any_time(tmp_path):
    # 10 time codes a second: the parent moves by (6, 0, 0) in 2 s; the child turns by 90 degrees about z in 1 s.
    parent = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 20: (6, 0, 0) }"
    turn = "double xformOp:rotateZ.timeSamples = { 0: 0, 10: 90 }"
    place = "double3 xformOp:translate = (0, 5, 0)"
    child = prim("Mesh", "m", QUAD, place, turn, 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]')
    still = prim("Mesh", "still", QUAD)
    body = prim("Xform", "p", parent, 'uniform token[] xformOpOrder = ["xformOp:translate"]', child)
    scene = load(tmp_path, body, still, header="timeCodesPerSecond = 10\nstartTimeCode = 0\nendTimeCode = 25")
    assert [item.moves for item in scene.objects] == [True, False] and scene.moves
    assert scene.animation_end_s == 2.5
    for seconds in (0, 1 / 3, 0.77, 1, 1.9, 7):
        angle, x = math.radians(90 * min(seconds, 1)), 6 * min(seconds / 2, 1)
        c, s = math.cos(angle), math.sin(angle)
        expected = [[c, -s, 0, x], [s, c, 0, 5], [0, 0, 1, 0], [0, 0, 0, 1]]
        found = scene.world_from_object(seconds)
        np.testing.assert_allclose(found[0], expected, atol=4 * ROUNDING)
        np.testing.assert_array_equal(found[1], np.eye(4))


def test_instances_share_one_mesh_and_keep_their_places(tmp_path):
    metadata = "instanceable = true\nreferences = </_proto>"
    places = [placed("double3 xformOp:translate", (k, 0, 7)) for k in range(3)]
    shown = [prim("Xform", f"i{k}", *place, metadata=metadata) for k, place in enumerate(places)]
    proto = 'class Xform "_proto" {\n' + prim("Mesh", "m", QUAD) + "}\n"
    scene = load(tmp_path, proto, *shown)
    assert [(item.name, item.mesh) for item in scene.objects] == [(f"/i{k}/m", 0) for k in range(3)]
    assert len(scene.meshes) == 1
    np.testing.assert_array_equal(scene.world_from_object(0)[:, :3, 3], [[k, 0, 7] for k in range(3)])


def test_axes_and_units_are_those_of_the_stage(tmp_path):
    scene = load(tmp_path, prim("Mesh", "m", QUAD), header='upAxis = "Z"\nmetersPerUnit = 0.0254')
    assert (scene.up_axis, scene.metres_per_unit) == ("Z", 0.0254)
    np.testing.assert_array_equal(scene.up, [0, 0, 1])
    assert load(tmp_path, prim("Mesh", "m", QUAD), name="bare.usda").metres_per_unit == 0.01  # USD's fallback


def test_what_is_not_shown_is_left_out(tmp_path):
    invisible = 'token visibility = "invisible"'
    scene = load(
        tmp_path,
        prim("Mesh", "hidden", QUAD, invisible),
        prim("Xform", "gone", invisible, prim("Mesh", "m", QUAD)),
        *(prim("Mesh", name, QUAD, FLAT, f'uniform token purpose = "{name}"') for name in ("guide", "proxy", "render")),
        prim("Xform", "all", 'uniform token purpose = "proxy"', prim("Mesh", "m", QUAD)),
    )
    assert [item.name for item in scene.objects] == ["/render"]
    assert scene.not_read == (
        "1 prims of purpose guide, as /guide: they are for viewports",
        "2 prims of purpose proxy, as /proxy: they are for viewports",
    )


def test_prims_that_are_not_read_are_named(tmp_path):
    kinds = "Sphere", "BasisCurves", "Mesh", "PointInstancer", "Skeleton", "PortalLight"
    said = load(tmp_path, *(prim(kind, f"p{k}") for k, kind in enumerate(kinds))).not_read
    assert [f"/p{k}" in sentence for k, sentence in enumerate(said)] == [True] * len(kinds)


def test_prototypes_of_an_instancer_are_not_drawn_in_their_own_place(tmp_path):
    many = "rel prototypes = [</many/m>]", "int[] protoIndices = [0]", "point3f[] positions = [(7,0,0)]"
    scene = load(tmp_path, prim("PointInstancer", "many", *many, prim("Mesh", "m", QUAD, FLAT)))
    assert [item.name for item in scene.objects] == ["/many[0]/m"] and scene.not_read == ()
    np.testing.assert_array_equal(scene.world_from_object(0)[0, :3, 3], [7, 0, 0])


def test_points_that_move_belong_to_one_object_and_begin_at_time_0(tmp_path):
    moving = POINTS.replace(" = [", ".timeSamples = { 0: [") + ", 5: [(9,0,0), (2,0,0), (2,1,0), (0,1,0), (1,3,0)] }"
    scene = load(tmp_path, prim("Mesh", "m", QUAD.replace(POINTS, moving), FLAT))
    assert scene.meshes[0].positions[:, 0].max() == 2
    assert scene.meshes[0].deforms and scene.objects[0].moves and scene.not_read == ()


def colors_at_corners(scene, item=0):
    mesh = scene.meshes[scene.objects[item].mesh]
    return corners(mesh, mesh.colors)


@pytest.mark.parametrize(
    ("interpolation", "colors", "red"),
    [
        ("constant", "(0.25, 0, 1)", [(0.25,) * 3] * 3),
        ("uniform", "(1, 0, 0), (0.5, 0, 0)", [(1, 1, 1), (1, 1, 1), (0.5, 0.5, 0.5)]),
        ("vertex", "(0,0,0), (1,0,0), (2,0,0), (3,0,0), (4,0,0)", [(0, 1, 2), (0, 2, 3), (3, 2, 4)]),
    ],
)
def test_meshes_without_material_have_their_display_colour(tmp_path, interpolation, colors, red):
    line = f'color3f[] primvars:displayColor = [{colors}] (interpolation = "{interpolation}")'
    scene = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, line))
    material = scene.materials[scene.objects[0].material]
    assert (material.base_color, material.alpha, scene.not_read) == ((1, 1, 1), "opaque", ())
    np.testing.assert_array_equal(colors_at_corners(scene)[..., 0], red)
    np.testing.assert_array_equal(colors_at_corners(scene)[..., 3], 1)


def test_display_opacities_blend(tmp_path):
    opacity = 'float[] primvars:displayOpacity = [1, 0.5] (interpolation = "uniform")'
    scene = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, opacity))
    assert scene.materials[scene.objects[0].material].alpha == "blend"
    np.testing.assert_array_equal(colors_at_corners(scene)[:, 0, 3], [1, 1, 0.5])
    np.testing.assert_allclose(colors_at_corners(scene)[..., :3], 0.8, atol=2.0**-24)  # the default material's grey
    solid = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, opacity.replace("0.5", "1")), name="solid.usda")
    assert solid.materials[solid.objects[0].material].alpha == "opaque"


def test_a_material_decides_about_colours(tmp_path):
    color = "color3f[] primvars:displayColor = [(1, 0, 0)]"
    bound = prim("Mesh", "bound", QUAD, FLAT, color, "rel material:binding = </a>", metadata=BINDING)
    scene = load(tmp_path, prim("Material", "a"), bound)
    assert scene.meshes[0].colors is None and scene.not_read == ()
    reader = prim("Shader", "colors", 'uniform token info:id = "UsdPrimvarReader_float3"', 'string inputs:varname = "tint"',
                  "float3 inputs:fallback = (0.5, 0.25, 0)", "float3 outputs:result")  # fmt: skip
    surface = prim("Shader", "s", 'uniform token info:id = "UsdPreviewSurface"', "token outputs:surface",
                   "color3f inputs:diffuseColor.connect = </b/colors.outputs:result>")  # fmt: skip
    material = prim("Material", "b", "token outputs:surface.connect = </b/s.outputs:surface>", reader, surface)
    bind = "rel material:binding = </b>"
    tint = 'color3f[] primvars:tint = [(0,0,0), (1,0,0), (2,0,0), (3,0,0), (4,0,0)] (interpolation = "vertex")'
    meshes = (
        prim("Mesh", "with", QUAD, FLAT, bind, tint, metadata=BINDING),
        prim("Mesh", "without", QUAD, FLAT, bind, metadata=BINDING),
    )
    scene = load(tmp_path, material, *meshes, name="read.usda")
    np.testing.assert_array_equal(colors_at_corners(scene)[..., 0], [(0, 1, 2), (0, 2, 3)])
    np.testing.assert_array_equal(colors_at_corners(scene, 1)[0], [(0.5, 0.25, 0, 1)] * 3)


def test_constant_primvars_are_inherited(tmp_path):
    uv = "texCoord2f[] primvars:st = [(3, 4)]"
    scene = load(tmp_path, prim("Xform", "x", uv, prim("Mesh", "m", QUAD, FLAT)))
    np.testing.assert_array_equal(scene.meshes[0].uv, [(3, 4)] * len(scene.meshes[0].positions))


def test_indexed_primvars_and_equal_values_share_vertices(tmp_path):
    """Face-varying uv without indices repeat a value at every corner: the vertices stay whole where they are equal."""
    uv = 'texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1), (0,1), (1,1), (5,5)] (interpolation = "faceVarying")'
    assert len(load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, uv)).meshes[0].positions) == 5
    seam = uv.replace("(1,1), (5,5)", "(7,7), (5,5)")
    assert len(load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, seam), name="seam.usda").meshes[0].positions) == 6
    picked = 'texCoord2f[] primvars:st = [(0,0), (9,9)] (interpolation = "uniform")', "int[] primvars:st:indices = [1, 0]"
    mesh = load(tmp_path, prim("Mesh", "house", HOUSE, FLAT, *picked), name="picked.usda").meshes[0]
    np.testing.assert_array_equal(corners(mesh, mesh.uv)[:, 0, 0], [9, 9, 0])


def test_meshes_say_whether_they_are_seen_from_behind(tmp_path):
    many = "rel prototypes = [</many/m>]", "int[] protoIndices = [0]", "point3f[] positions = [(7,0,0)]"
    both = "uniform bool doubleSided = {}"
    scene = load(
        tmp_path, prim("Mesh", "one", QUAD, FLAT), prim("Mesh", "two", QUAD, FLAT, both.format("true")),
        prim("Mesh", "said", QUAD, FLAT, both.format("false")),
        prim("PointInstancer", "many", *many, prim("Mesh", "m", QUAD, FLAT, both.format("true"))),
    )  # fmt: skip
    assert [item.double_sided for item in scene.objects] == [False, True, False, True]


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_sides_are_those_of_the_orientation_in_object_space(tmp_path, orientation, mirrored, shared, scheme):
    """A mirroring transform is not the mesh's business: faces and normals agree in object space, whatever it is."""
    lines = f'uniform token orientation = "{orientation}"', f'uniform token subdivisionScheme = "{scheme}"'
    place = placed("float3 xformOp:scale", "(-1, 1, 1)") if mirrored else ()
    mesh = prim("Mesh", "m", QUAD, *lines)
    if shared:
        proto = 'class Xform "_proto" {\n' + mesh + "}\n"
        prims = proto, prim("Xform", "i", *place, metadata="instanceable = true\nreferences = </_proto>")
    else:
        prims = (prim("Xform", "i", *place, mesh),)
    scene = load(tmp_path, *prims)
    mesh = scene.meshes[0]
    sign = -1 if orientation == "leftHanded" else 1
    a, b, c = np.moveaxis(corners(mesh, mesh.positions), 1, 0)
    assert (np.sign(np.cross(b - a, c - a)[:, 2]) == sign).all()
    assert mesh.normals is None or (np.sign(mesh.normals[:, 2]) == sign).all()
    assert np.linalg.det(scene.world_from_object(0.0)[0]) == (-1 if mirrored else 1)


def test_face_counts_that_are_keyed_are_read_as_they_begin(tmp_path):
    keyed = QUAD.replace("faceVertexCounts = [4]", "faceVertexCounts.timeSamples = { 0: [4], 5: [4] }")
    assert len(load(tmp_path, prim("Mesh", "m", keyed, FLAT)).meshes[0].faces) == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (prim("Mesh", "m", QUAD.replace("[0, 1, 2, 3]", "[0, 1, 2, 9]")), "/m: face index 9 with only 5 points"),
        (prim("Mesh", "m", QUAD.replace("[0, 1, 2, 3]", "[0, 1, -2, 3]")), "/m: face index"),
        (prim("Mesh", "m", QUAD.replace("[4]", "[5]")), "/m: face counts ask for 5 indices, there are 4"),
        (prim("Mesh", "m", QUAD, 'texCoord2f[] primvars:st = [(nan,0)] (interpolation = "constant")'), "/m: .*finite"),
        (prim("Mesh", "m", QUAD.replace("(2,1,0)", "(nan,1,0)")), "/m: points are not finite"),
        (prim("Mesh", "m", QUAD, 'texCoord2f[] primvars:st = [(0,0)] (interpolation = "vertex")'), "/m: vertex.* has 1 values"),
        (prim("Mesh", "m", QUAD.replace("[4]", "[5, -1]")), "/m: face counts ask for 4 indices, there are 4"),
        (prim("Mesh", "m", QUAD.replace("[4]", "[2147483647, 2147483647]")), "/m: face counts ask for 4294967294 indices"),
        (prim("Mesh", "m", QUAD.replace(POINTS, "")), "/m: face index 3 with only 0 points"),
        (prim("Mesh", "m", QUAD, 'texCoord2f[] primvars:st = [(0,0)] (interpolation = "facevarying")'), "/m: .*unknown interp"),
        (prim("Mesh", "m", QUAD, "string[] primvars:st = ['a']"), "/m: primvar st is of type string"),
        (prim("Mesh", "m", QUAD, "float[] primvars:st = [1, 2]"), "/m: primvar st has 1 components, 2 are needed"),
        (
            prim("Mesh", "m", QUAD, "texCoord2f[] primvars:st = [(0,0)]", "int[] primvars:st:indices = [-1]"),
            "/m: index -1 of primvar st with only 1 values",
        ),
        (prim("Mesh", "m", QUAD, *placed("double3 xformOp:translate", "(nan, 0, 0)")), "/m: its transform is not finite"),
        (prim("Mesh", "m", QUAD.replace(POINTS, "int points = 3")), "/m: points holds values of another type than"),
        (prim("Mesh", "m", QUAD, 'string[] normals = ["a"]'), "/m: normals holds values of another type"),
        (prim("Mesh", "m", QUAD, "float creaseIndices = nan"), "/m: creaseIndices holds values of another type"),
        (prim("Mesh", "m", QUAD, *placed("point3f[] xformOp:rotateX", "[(0,0,0)]")), "USD: .*xformOp"),
        (prim("Mesh", "m", QUAD.replace(POINTS, "int points = 3")), "/m: points holds values of another type than"),
        (prim("Mesh", "m", QUAD, 'string[] normals = ["a"]'), "/m: normals holds values of another type"),
        (prim("Mesh", "m", QUAD, "float creaseIndices = nan"), "/m: creaseIndices holds values of another type"),
        (prim("Mesh", "m", QUAD, *placed("point3f[] xformOp:rotateX", "[(0,0,0)]")), "USD: .*xformOp"),
        (prim("Xform", "x", metadata="references = @nowhere.usda@"), "nowhere.usda"),
        ('def Mesh "m" {\nint a = }\n', "not a USD stage: .*:6:.*Expected"),
    ],
    ids=[
        "index",
        "negative index",
        "counts",
        "nan uv",
        "nan point",
        "primvar",
        "negative count",
        "huge counts",
        "no points",
        "interpolation",
        "strings",
        "components",
        "negative element",
        "transform",
        "type of points",
        "type of normals",
        "type of creases",
        "type of a transform",
        "type of points",
        "type of normals",
        "type of creases",
        "type of a transform",
        "missing layer",
        "syntax",
    ],
)
def test_broken_stages_are_named_with_the_prim(tmp_path, text, says):
    file = usd(tmp_path, text)
    with pytest.raises(InputError, match=f"^{file}[,:].*{says}"):
        load_scene(file)


def test_an_environment_with_texels_that_are_no_radiance_is_drawn_and_named(tmp_path):
    file = tmp_path / "sky.exr"
    texels = np.ones((4, 8, 3), np.float32)
    texels[0, 0], texels[1, 1, 0], texels[2, 2, 1] = np.inf, -3, np.nan
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": texels}) as image:
        image.write(str(file))
    (tmp_path / "s.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    lit, _ = light_scene(load_scene(tmp_path / "s.obj"), file)
    sky = lit.environment.texels
    assert np.isfinite(sky).all() and sky.min() == 0 and sky[0, 0].tolist() == [65504] * 3 and sky[2, 2].tolist() == [1, 0, 1]
    assert [line for line in lit.not_read if line.startswith("3 texels of environment sky.exr")]
