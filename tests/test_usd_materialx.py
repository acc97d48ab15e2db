"""MaterialX networks in USD: surface shaders, images, their coordinates and colour spaces, and what is not read."""

import math

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.images import linear_texels
from usd_stages import BINDING, QUAD, image, prim, usd

ROUNDING = 4 * 2.0**-24  # USD's numbers are float32
STANDARD, OPEN, GLTF = (f"ND_{name}_surfaceshader" for name in ("standard_surface", "open_pbr_surface", "gltf_pbr"))
PREVIEW = "ND_UsdPreviewSurface_surfaceshader"


def node(name, kind, *lines, out="color3f"):
    return prim("Shader", name, f'uniform token info:id = "{kind}"', *lines, f"{out} outputs:out")


def picture(name, kind="ND_image_color3", *lines, file="t.png", space=""):
    metadata = f' (colorSpace = "{space}")' if space else ""
    return node(name, kind, f"asset inputs:file = @{file}@{metadata}", *lines)


def link(kind, key, name, output="out"):
    return f"{kind} inputs:{key}.connect = </M/{name}.outputs:{output}>"


BASE = link("color3f", "base_color", "I")


def surface(folder, kind, *lines, nodes=(), terminal="outputs:mtlx:surface", mesh=(), others=()):
    """The file of a scene with one mesh, whose material M has a MaterialX surface with `lines`."""
    shader = node("S", kind, *lines, out="token")
    material = prim("Material", "M", f"token {terminal}.connect = </M/S.outputs:out>", shader, *nodes, *others)
    return usd(folder, material, prim("Mesh", "m", QUAD, "rel material:binding = </M>", *mesh, metadata=BINDING))


def read(folder, kind, *lines, **keys):
    """(scene, its material)."""
    scene = load_scene(surface(folder, kind, *lines, **keys))
    return scene, scene.materials[scene.objects[0].material]


def texels_of(scene, slot):
    return linear_texels(scene.textures[slot.texture])


def decoded(codes):
    """IEC 61966-2-1."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    ("kind", "base", "roughness", "metallic"),
    [(STANDARD, 0.8, 0.2, 0), (f"{STANDARD}_100", 0.8, 0.2, 0), (OPEN, 0.8, 0.3, 0), (GLTF, 1, 1, 1)],
)
def test_defaults_are_those_of_the_libraries(tmp_path, kind, base, roughness, metallic):
    _, material = read(tmp_path, kind)
    np.testing.assert_allclose(material.base_color, [base] * 3, rtol=ROUNDING)
    assert (material.roughness, material.metallic, material.emission) == (roughness, metallic, (0, 0, 0))
    assert (material.specular, material.alpha, material.not_read) == (0.5, "opaque", ())  # F0 of 1.5 is 0.04 = 0.08 x 0.5


def test_standard_surface_constants(tmp_path):
    _, material = read(
        tmp_path,
        STANDARD,
        "float inputs:base = 0.5",
        "color3f inputs:base_color = (0.25, 0.5, 1)",
        "float inputs:metalness = 0.25",
        "float inputs:specular_roughness = 0.75",
        "float inputs:specular = 0.5",
        "float inputs:specular_IOR = 1.5",
        "float inputs:emission = 3",
        "color3f inputs:emission_color = (1, 2, 0)",
    )
    assert (material.base_color, material.metallic, material.roughness) == ((0.125, 0.25, 0.5), 0.25, 0.75)
    assert (material.emission, material.specular, material.not_read) == ((3, 6, 0), 0.25, ())


def test_open_pbr_constants(tmp_path):
    lines = "float inputs:base_weight = 0.5", "float inputs:base_metalness = 0.25", "float inputs:emission_luminance = 4"
    more = "float inputs:geometry_opacity = 0.5", "color3f inputs:emission_color = (1, 0.5, 0)", "float inputs:specular_ior = 1"
    _, material = read(tmp_path, OPEN, *lines, *more)
    np.testing.assert_allclose(material.base_color, [0.4] * 3, rtol=ROUNDING)
    assert (material.metallic, material.emission, material.specular) == (0.25, (4, 2, 0), 0)
    assert (material.alpha, material.opacity, material.not_read) == ("blend", 0.5, ())


@pytest.mark.parametrize(("mode", "alpha", "opacity"), [(0, "opaque", 0.25), (1, "mask", 0.25), (2, "blend", 0.25)])
def test_gltf_alpha_modes(tmp_path, mode, alpha, opacity):
    lines = "float inputs:alpha = 0.25", f"int inputs:alpha_mode = {mode}", "float inputs:alpha_cutoff = 0.125"
    emissive = "color3f inputs:emissive = (1, 2, 3)", "float inputs:emissive_strength = 2"
    _, material = read(tmp_path, GLTF, *lines, *emissive)
    assert (material.alpha, material.opacity, material.alpha_cutoff, material.emission) == (alpha, opacity, 0.125, (2, 4, 6))
    assert material.not_read == ()


def test_opacity_of_standard_surface_is_its_mean_where_it_is_coloured(tmp_path):
    _, material = read(tmp_path, STANDARD, "color3f inputs:opacity = (0.25, 0.5, 0.75)")
    assert (material.alpha, material.opacity, material.not_read) == (
        "blend",
        0.5,
        ("opacity (0.25, 0.5, 0.75): its mean is drawn",),
    )


@pytest.mark.parametrize(
    ("space", "kind", "srgb"),
    [
        ("srgb_texture", "ND_image_color3", True),
        ("lin_rec709", "ND_image_color3", False),
        ("raw", "ND_image_color3", False),
        ("", "ND_image_color3", True),
        ("", "ND_image_vector3", False),
        ("srgb_texture", "ND_tiledimage_color3", True),
    ],
)
def test_colour_spaces_of_images(tmp_path, space, kind, srgb):
    codes = image(tmp_path / "t.png") / 255
    scene, material = read(tmp_path, STANDARD, BASE, nodes=[picture("I", kind, space=space)])
    expected = decoded(codes) if srgb else codes
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., :3], expected, rtol=ROUNDING)
    assert material.base_color == (1, 1, 1) and material.not_read == ()


def test_another_colour_space_is_named(tmp_path):
    image(tmp_path / "t.png")
    _, material = read(tmp_path, STANDARD, BASE, nodes=[picture("I", space="acescg")])
    assert material.not_read == ("colour space acescg of t.png: it is read as sRGB, of base_color",)


def test_the_weight_of_the_base_multiplies_its_texture(tmp_path):
    image(tmp_path / "t.png")
    _, material = read(tmp_path, STANDARD, "float inputs:base = 0.5", BASE, nodes=[picture("I")])
    assert material.base_color == (0.5, 0.5, 0.5) and material.base_texture is not None


@pytest.mark.parametrize(
    ("kind", "lines", "function"),
    [
        ("ND_multiply_color3", ("color3f inputs:in2 = (0.5, 0.25, 2)",), lambda x: x * [0.5, 0.25, 2]),
        ("ND_multiply_color3FA", ("float inputs:in2 = 0.5",), lambda x: x * 0.5),
        ("ND_add_color3", ("color3f inputs:in2 = (0.5, 0.25, 0)",), lambda x: x + [0.5, 0.25, 0]),
        ("ND_subtract_color3FA", ("float inputs:in2 = 0.25",), lambda x: x - 0.25),
        ("ND_divide_color3FA", ("float inputs:in2 = 4",), lambda x: x / 4),
    ],
)
def test_arithmetic_with_constants_becomes_scale_and_bias(tmp_path, kind, lines, function):
    codes = image(tmp_path / "t.png") / 255
    nodes = picture("P", space="raw"), node("I", kind, link("color3f", "in1", "P"), *lines)
    scene, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., :3], function(codes), atol=ROUNDING)
    assert material.not_read == ()


def test_a_chain_of_arithmetic_is_followed_from_the_image_on(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = (
        picture("P", "ND_image_float"),
        node("A", "ND_multiply_float", link("float", "in2", "P"), "float inputs:in1 = 2", out="float"),
        node("I", "ND_subtract_float", "float inputs:in1 = 1", link("float", "in2", "A"), out="float"),
    )
    scene, material = read(tmp_path, STANDARD, link("float", "specular_roughness", "I"), nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.surface_texture)[..., 1], 1 - 2 * codes[..., 0], atol=ROUNDING)
    assert (material.roughness, material.not_read) == (1, ())


def test_what_multiplies_a_sum_multiplies_its_constant_too(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = (
        picture("P", space="raw"),
        node("A", "ND_add_color3FA", link("color3f", "in1", "P"), "float inputs:in2 = 0.5"),
        node("I", "ND_multiply_color3FA", link("color3f", "in1", "A"), "float inputs:in2 = 0.25"),
    )
    scene, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., :3], (codes + 0.5) / 4, rtol=ROUNDING)


def test_a_grey_specular_colour_scales_f0(tmp_path):
    _, material = read(tmp_path, STANDARD, "color3f inputs:specular_color = (0.5, 0.5, 0.5)")
    assert (material.specular, material.not_read) == (0.25, ())


def test_constant_networks_are_constants(tmp_path):
    nodes = (
        node("C", "ND_constant_color3", "color3f inputs:value = (0.5, 0.25, 1)"),
        node("I", "ND_multiply_color3FA", link("color3f", "in1", "C"), "float inputs:in2 = 0.5"),
    )
    _, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    assert (material.base_color, material.base_texture, material.not_read) == ((0.25, 0.125, 0.5), None, ())


@pytest.mark.parametrize(
    ("kind", "lines", "output"),
    [
        ("ND_extract_color3", ("int inputs:index = 2",), "out"),
        ("ND_separate3_color3", (), "outb"),
        ("ND_swizzle_color3_float", ('string inputs:channels = "b"',), "out"),
    ],
)
def test_channels_of_an_image_are_read_in_place(tmp_path, kind, lines, output):
    codes = image(tmp_path / "t.png") / 255
    nodes = picture("P", space="raw"), node("X", kind, link("color3f", "in", "P"), *lines, "float outputs:outb")
    scene, material = read(tmp_path, STANDARD, link("float", "metalness", "X", output), nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.surface_texture)[..., 2], codes[..., 2], rtol=ROUNDING)
    assert material.metallic == 1


def test_roughness_metalness_and_specular_fill_one_texture(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = (
        picture("P", "ND_image_vector3"),
        *(node(n, "ND_extract_vector3", link("float3", "in", "P"), f"int inputs:index = {k}") for k, n in enumerate("XYZ")),
    )
    keys = ("specular", "X"), ("specular_roughness", "Y"), ("metalness", "Z")
    scene, material = read(tmp_path, STANDARD, *(link("float", key, name) for key, name in keys), nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.surface_texture)[..., :3], codes, rtol=ROUNDING)
    assert (material.specular, material.not_read, len(scene.textures)) == (0.5, (), 1)


def test_a_grey_image_becomes_a_colour(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = picture("P", "ND_image_float"), node("I", "ND_convert_float_color3", link("float", "in", "P"))
    scene, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    np.testing.assert_allclose(
        texels_of(scene, material.base_texture)[..., :3], np.stack([codes[..., 0]] * 3, -1), rtol=ROUNDING
    )


def test_opacity_of_an_image_blends_beside_the_colour(tmp_path):
    codes = image(tmp_path / "t.png", channels=4) / 255
    nodes = (
        picture("P", "ND_image_color4", space="raw"),
        node("I", "ND_convert_color4_color3", link("color4f", "in", "P")),
        node("A", "ND_extract_color4", link("color4f", "in", "P"), "int inputs:index = 3"),
    )
    scene, material = read(tmp_path, OPEN, BASE, link("float", "geometry_opacity", "A"), nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.base_texture), codes, rtol=ROUNDING)
    assert (material.alpha, len(scene.textures), material.not_read) == ("blend", 1, ())


def test_normal_maps_are_decoded_and_keep_their_strength(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = (
        picture("P", "ND_image_vector3"),
        node("N", "ND_normalmap_float", link("float3", "in", "P"), "float inputs:scale = 0.5"),
    )
    scene, material = read(tmp_path, OPEN, link("float3", "geometry_normal", "N"), nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.normal_texture)[..., :3], 2 * codes - 1, atol=ROUNDING)
    assert (material.normal_scale, material.not_read) == (0.5, ())


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (link("float3", "normal", "P"), "normal (texture)"),
        (link("float3", "normal", "O"), "normal (texture)"),
        (link("float3", "coat_normal", "N"), None),
        (link("float3", "tangent", "B"), "tangent through ND_bump_vector3"),
    ],
)
def test_normals_of_other_spaces_are_named(tmp_path, lines, says):
    image(tmp_path / "t.png")
    nodes = (
        picture("P", "ND_image_vector3"),
        node("N", "ND_normalmap", link("float3", "in", "P")),
        node("O", "ND_normalmap", link("float3", "in", "P"), 'string inputs:space = "object"'),
        node("B", "ND_bump_vector3"),
    )
    _, material = read(tmp_path, STANDARD, lines, nodes=nodes)
    assert material.normal_texture is None
    assert material.not_read == ((says,) if says else ("coat_normal (texture)",))


UV = node("U", "ND_texcoord_vector2", out="float2")


def place(*lines, kind="ND_place2d_vector2", key="texcoord"):
    return node("T", kind, link("float2", key, "U"), *lines, out="float2")


QUARTER = "float inputs:rotate = 90", "float2 inputs:scale = (2, 4)", "float2 inputs:offset = (0.25, 0.5)"


@pytest.mark.parametrize(
    ("transform", "expected"),
    [
        # MaterialX 1.39, place2d: (uv - pivot) / scale, turned clockwise by `rotate`, minus offset, plus pivot
        (place(*QUARTER), [[0, 1 / 4, -0.25], [-1 / 2, 0, -0.5]]),
        # operationorder 1: minus offset, turned, divided by scale
        (place(*QUARTER, "int inputs:operationorder = 1"), [[0, 1 / 2, -0.25], [-1 / 4, 0, 0.0625]]),
        (place("float2 inputs:scale = (2, 2)", "float2 inputs:pivot = (0.5, 0.5)"), [[0.5, 0, 0.25], [0, 0.5, 0.25]]),
        (place("float2 inputs:in2 = (2, 3)", kind="ND_multiply_vector2", key="in1"), [[2, 0, 0], [0, 3, 0]]),
        (place("float inputs:in2 = 4", kind="ND_divide_vector2FA", key="in1"), [[0.25, 0, 0], [0, 0.25, 0]]),
        (place("float2 inputs:in1 = (2, 3)", kind="ND_add_vector2", key="in2"), [[1, 0, 2], [0, 1, 3]]),
        (place("float inputs:amount = 90", kind="ND_rotate2d_vector2", key="in"), [[0, 1, 0], [-1, 0, 0]]),
    ],
)
def test_transforms_of_coordinates(tmp_path, transform, expected):
    image(tmp_path / "t.png")
    nodes = picture("I", "ND_image_color3", link("float2", "texcoord", "T")), transform, UV
    _, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    np.testing.assert_allclose(material.base_texture.uv, expected, atol=ROUNDING)
    assert material.not_read == ()


def test_tiles_of_an_image(tmp_path):
    image(tmp_path / "t.png")
    tiling = (
        "float2 inputs:uvtiling = (4, 2)",
        "float2 inputs:uvoffset = (0.5, 0.25)",
        "float2 inputs:realworldtilesize = (2, 1)",
    )
    _, material = read(tmp_path, STANDARD, BASE, nodes=[picture("I", "ND_tiledimage_color3", *tiling)])
    # (uv * uvtiling - uvoffset) / realworldimagesize * realworldtilesize
    np.testing.assert_allclose(material.base_texture.uv, [[8, 0, -1], [0, 2, -0.25]], atol=ROUNDING)


def test_address_modes(tmp_path):
    image(tmp_path / "t.png")
    modes = 'string inputs:uaddressmode = "mirror"', 'string inputs:vaddressmode = "constant"'
    scene, material = read(tmp_path, STANDARD, BASE, nodes=[picture("I", "ND_image_color3", *modes)])
    assert scene.textures[0].wrap == ("mirror", "clamp")
    assert material.not_read == ("wrap mode constant of base_color: it is read with clamp",)


@pytest.mark.parametrize(
    ("reader", "primvar"),
    [
        (node("U", "ND_geompropvalue_vector2", 'string inputs:geomprop = "map1"'), "map1"),
        (node("U", "ND_UsdPrimvarReader_vector2", 'string inputs:varname = "map1"'), "map1"),
        (node("U", "ND_texcoord_vector2", "int inputs:index = 1"), "st1"),
        (UV, "st"),
    ],
)
def test_sets_of_coordinates_by_name_and_number(tmp_path, reader, primvar):
    image(tmp_path / "t.png")
    nodes = picture("I", "ND_image_color3", link("float2", "texcoord", "U")), reader
    mesh = (f'texCoord2f[] primvars:{primvar} = [(0.25, 2)] (interpolation = "constant")',)
    scene, _ = read(tmp_path, STANDARD, BASE, nodes=nodes, mesh=mesh)
    assert (scene.meshes[0].uv == [0.25, 2]).all()


def test_vertex_colours_drive_the_base(tmp_path):
    nodes = [node("I", "ND_geompropvalue_color3", 'string inputs:geomprop = "displayColor"')]
    mesh = ('color3f[] primvars:displayColor = [(0.25, 0.5, 1)] (interpolation = "constant")',)
    scene, material = read(tmp_path, STANDARD, BASE, nodes=nodes, mesh=mesh)
    assert (material.base_color, material.vertex_colors, material.not_read) == ((1, 1, 1), "base_color", ())
    assert (scene.meshes[0].colors == [0.25, 0.5, 1, 1]).all()


@pytest.mark.parametrize(
    ("kind", "lines", "says"),
    [
        (STANDARD, ("float inputs:coat = 0.5", "float inputs:coat_IOR = 1.25"), ("coat 0.5", "coat_IOR 1.25")),
        (STANDARD, ("float inputs:coat_roughness = 0.5",), ()),
        (STANDARD, ("float inputs:transmission = 1", "color3f inputs:transmission_color = (1, 0.5, 0)"),
         ("transmission 1", "transmission_color (1, 0.5, 0)")),
        (STANDARD, ("float inputs:subsurface = 0.25",), ("subsurface 0.25",)),
        (STANDARD, ("float inputs:sheen = 0.5",), ("sheen 0.5",)),
        (STANDARD, ("float inputs:specular_anisotropy = 0.5",), ("specular_anisotropy 0.5",)),
        (STANDARD, ("float inputs:diffuse_roughness = 0.5",), ("diffuse_roughness 0.5",)),
        (STANDARD, ("float inputs:specular_IOR = 2",), ("specular_IOR 2: F0 is 0.08, not 0.111",)),
        (STANDARD, ("color3f inputs:specular_color = (1, 0.5, 0)",), ("specular_color (1, 0.5, 0): F0 is grey, its mean",)),
        (STANDARD, ("float inputs:metalness = 1", "color3f inputs:specular_color = (1, 0.5, 0)"),
         ("specular_color (1, 0.5, 0) of a metal: its edge is white",)),
        (STANDARD, ("float inputs:metalness = 1", "float inputs:specular_IOR = 3"), ()),
        (STANDARD, (BASE.replace("I.", "F."),), ("base_color through ND_fractal3d_color3",)),
        (STANDARD, (link("float", "base", "G"),), ("base (texture)",)),
        (STANDARD, (link("float", "coat", "G"),), ("coat (texture)",)),
        (STANDARD, (link("float", "coat_roughness", "G"),), ()),
        (STANDARD, ("float inputs:metalness.timeSamples = { 0: 0, 9: 1 }",),
         ("animation of metalness: it stays as it begins",)),
        (OPEN, ("float inputs:fuzz_weight = 0.5",), ("fuzz_weight 0.5",)),
        (OPEN, ("float inputs:coat_weight = 1", "float inputs:coat_roughness = 0.5"), ("coat_weight 1", "coat_roughness 0.5")),
        (GLTF, ("float inputs:metallic = 0", "float inputs:occlusion = 0.5"), ("occlusion 0.5",)),
        (GLTF, ("color3f inputs:sheen_color = (0.5, 0, 0)",), ("sheen_color (0.5, 0, 0)",)),
        (GLTF, (link("float", "alpha", "G"),), ()),
    ],
)  # fmt: skip
def test_what_a_surface_does_not_do_is_named_where_it_acts(tmp_path, kind, lines, says):
    image(tmp_path / "t.png")
    nodes = picture("G", "ND_image_float"), node("F", "ND_fractal3d_color3")
    assert read(tmp_path, kind, *lines, nodes=nodes)[1].not_read == says


@pytest.mark.parametrize(
    ("nodes", "kind"),
    [
        ((picture("P"), picture("Q"),
          node("I", "ND_multiply_color3", link("color3f", "in1", "P"), link("color3f", "in2", "Q"))), "ND_multiply_color3"),
        ((node("I", "ND_multiply_color3", BASE.replace("base_color", "in1"), "color3f inputs:in2 = (1, 1, 1)"),),
         "ND_multiply_color3"),
        ((picture("P"), node("I", "ND_mix_color3", link("color3f", "fg", "P"))), "ND_mix_color3"),
    ],
    ids=["two images", "a circle", "another node"],
)  # fmt: skip
def test_networks_that_are_not_read_are_named_and_leave_the_default(tmp_path, nodes, kind):
    image(tmp_path / "t.png")
    _, material = read(tmp_path, STANDARD, BASE, nodes=nodes)
    np.testing.assert_allclose(material.base_color, [0.8] * 3, rtol=ROUNDING)
    assert (material.base_texture, material.not_read) == (None, (f"base_color through {kind}",))


def test_preview_surfaces_of_materialx_are_read_as_usds(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = (
        picture("I", space="srgb_texture"),
        node("R", "ND_UsdUVTexture_23", "asset inputs:file = @t.png@", link("float2", "st", "T"), "float outputs:g"),
        node("T", "ND_UsdTransform2d", link("float2", "in", "U"), "float inputs:rotation = 90", out="float2"),
        node("U", "ND_UsdPrimvarReader_vector2", 'string inputs:varname = "map1"'),
    )
    lines = link("color3f", "diffuseColor", "I"), link("float", "roughness", "R", "g"), "float inputs:metallic = 0.25"
    scene, material = read(tmp_path, PREVIEW, *lines, nodes=nodes)
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., :3], decoded(codes), rtol=ROUNDING)
    np.testing.assert_allclose(texels_of(scene, material.surface_texture)[..., 1], codes[..., 1], rtol=ROUNDING)
    np.testing.assert_allclose(material.surface_texture.uv, [[0, -1, 0], [1, 0, 0]], atol=ROUNDING)
    assert (material.metallic, material.surface_texture.uv_set, material.not_read) == (0.25, 1, ())


def test_a_universal_surface_comes_first(tmp_path):
    universal = (
        "token outputs:surface.connect = </M/P.outputs:surface>",
        prim("Shader", "P", 'uniform token info:id = "UsdPreviewSurface"', "float inputs:roughness = 0.125",
             "token outputs:surface"),
    )  # fmt: skip
    assert read(tmp_path, STANDARD, others=universal)[1].roughness == 0.125


def test_a_universal_surface_of_an_unknown_kind_gives_way(tmp_path):
    universal = (
        "token outputs:surface.connect = </M/P.outputs:surface>",
        prim("Shader", "P", 'uniform token info:id = "PxrSurface"', "token outputs:surface"),
    )
    _, material = read(tmp_path, STANDARD, "float inputs:specular_roughness = 0.125", others=universal)
    assert (material.roughness, material.not_read) == (0.125, ())


def test_a_materialx_surface_may_be_the_universal_one(tmp_path):
    assert read(tmp_path, STANDARD, "float inputs:metalness = 0.5", terminal="outputs:surface")[1].metallic == 0.5


def test_interfaces_of_node_graphs_are_followed(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    graph = prim(
        "NodeGraph",
        "G",
        'asset inputs:picture = @t.png@ (colorSpace = "srgb_texture")',
        "color3f outputs:color.connect = </M/G/I.outputs:out>",
        node("I", "ND_image_color3", "asset inputs:file.connect = </M/G.inputs:picture>"),
    )
    scene, material = read(tmp_path, STANDARD, "color3f inputs:base_color.connect = </M/G.outputs:color>", nodes=[graph])
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., :3], decoded(codes), rtol=ROUNDING)


def test_an_unknown_surface_is_named(tmp_path):
    assert read(tmp_path, "ND_lama_surface")[1].not_read == ("shader ND_lama_surface",)


def test_a_missing_image_names_file_material_and_input(tmp_path):
    file = surface(tmp_path, STANDARD, BASE, nodes=[picture("I", file="gone.png")])
    with pytest.raises(InputError, match=rf"^{file}, /M\.base_color: missing texture gone.png"):
        load_scene(file)


def test_a_referenced_materialx_file_is_one_error(tmp_path):
    (tmp_path / "m.mtlx").write_text('<?xml version="1.0"?>\n<materialx version="1.39"/>\n')
    file = usd(tmp_path, prim("Xform", "x", metadata="references = @m.mtlx@"))
    with pytest.raises(InputError, match="m.mtlx") as error:
        load_scene(file)
    assert "\n" not in str(error.value) and str(error.value).startswith(str(tmp_path))


def test_rotations_of_place2d_and_transform2d_turn_against_each_other(tmp_path):
    # MaterialX turns clockwise, UsdTransform2d counter-clockwise.
    image(tmp_path / "t.png")
    nodes = picture("I", "ND_image_color3", link("float2", "texcoord", "T")), place("float inputs:rotate = 30"), UV
    uv = read(tmp_path, STANDARD, BASE, nodes=nodes)[1].base_texture.uv
    assert math.degrees(math.atan2(uv[1][0], uv[0][0])) == pytest.approx(-30, abs=1e-5)
