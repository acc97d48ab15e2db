"""UsdPreviewSurface: constants, textures and how they are packed, transforms of uv, and what is missing."""

import struct
import zipfile

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene import load_scene, scene_hash, usd_textures
from framepairs.scene.description import Texture
from framepairs.scene.images import decode_image, linear_texels, pack_channels
from framepairs.scene.usd_materials import MaterialReader
from usd_stages import BINDING, QUAD, image, prim, usd

# USD's numbers are float32.
ROUNDING = 4 * 2.0**-24


def shader(name, kind, *lines):
    outputs = "float2 outputs:result", "float3 outputs:rgb", *(f"float outputs:{k}" for k in "rgba")
    return prim("Shader", name, f'uniform token info:id = "{kind}"', *lines, *outputs)


def sampler(name, *lines, file="t.png"):
    return shader(name, "UsdUVTexture", f"asset inputs:file = @{file}@", *lines)


def surface(folder, *lines, nodes=()):
    """The file of a scene with one mesh, whose material M has a preview surface with `lines`."""
    preview = shader("S", "UsdPreviewSurface", *lines, "token outputs:surface")
    material = prim("Material", "M", "token outputs:surface.connect = </M/S.outputs:surface>", preview, *nodes)
    return usd(folder, material, prim("Mesh", "m", QUAD, "rel material:binding = </M>", metadata=BINDING))


def read(folder, *lines, nodes=()):
    """(scene, its material)."""
    scene = load_scene(surface(folder, *lines, nodes=nodes))
    return scene, scene.materials[scene.objects[0].material]


def texels_of(scene, slot):
    return linear_texels(scene.textures[slot.texture])


def decoded(codes):
    """IEC 61966-2-1."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_constants(tmp_path):
    _, material = read(
        tmp_path,
        "color3f inputs:diffuseColor = (0.1, 0.2, 0.3)",
        "color3f inputs:emissiveColor = (4, 5, 6)",
        "float inputs:roughness = 0.25",
        "float inputs:metallic = 0.75",
        "float inputs:ior = 1.5",
    )
    np.testing.assert_allclose(material.base_color, (0.1, 0.2, 0.3), rtol=ROUNDING)
    assert (material.name, material.emission, material.roughness, material.metallic) == ("/M", (4, 5, 6), 0.25, 0.75)
    assert (material.alpha, material.opacity, material.not_read) == ("opaque", 1, ())
    assert material.specular == pytest.approx(0.5, rel=8 * ROUNDING)  # ((1.5 - 1) / (1.5 + 1))^2 = 0.04 = 0.08 x 0.5


def test_defaults_are_those_of_the_specification(tmp_path):
    _, material = read(tmp_path)
    np.testing.assert_allclose(material.base_color, (0.18, 0.18, 0.18), rtol=ROUNDING)
    assert (material.roughness, material.metallic, material.emission) == (0.5, 0, (0, 0, 0))


@pytest.mark.parametrize(("ior", "specular"), [(1.0, 0.0), (1.75, (3 / 11) ** 2 / 0.08), (1.33, (0.33 / 2.33) ** 2 / 0.08)])
def test_ior_becomes_specular(tmp_path, ior, specular):
    _, material = read(tmp_path, f"float inputs:ior = {ior}")
    assert material.specular == pytest.approx(specular, rel=1e-6) and material.not_read == ()  # float32 ior


@pytest.mark.parametrize(("metallic", "says"), [(0, ("ior 2: F0 is 0.08, not 0.111",)), (1, ())])  # (1 / 3)^2
def test_an_ior_beyond_the_largest_f0_is_limited_and_named_but_of_metals(tmp_path, metallic, says):
    _, material = read(tmp_path, "float inputs:ior = 2", f"float inputs:metallic = {metallic}")
    assert (material.specular, material.not_read) == (1, says)


SPECULAR = "int inputs:useSpecularWorkflow = 1"


def test_a_dark_grey_specular_color_is_f0(tmp_path):
    lines = SPECULAR, "color3f inputs:specularColor = (0.04, 0.04, 0.04)", "float inputs:metallic = 1", "float inputs:ior = 9"
    _, material = read(tmp_path, *lines)  # metallic and ior have no meaning in this workflow
    assert material.specular == pytest.approx(0.5, rel=ROUNDING) and (material.metallic, material.not_read) == (0, ())


def test_a_specular_color_without_diffuse_is_a_metal(tmp_path):
    black = "color3f inputs:diffuseColor = (0, 0, 0)"
    _, material = read(tmp_path, SPECULAR, black, "color3f inputs:specularColor = (1, 0.75, 0.25)")
    assert (material.base_color, material.metallic, material.not_read) == ((1, 0.75, 0.25), 1, ())


@pytest.mark.parametrize(
    ("color", "specular", "says"),
    [
        ("(0.5, 0.5, 0.5)", 1, "specularColor (0.5, 0.5, 0.5): F0 is 0.08, not 0.5"),
        ("(0.0625, 0.03125, 0)", 0.390625, "specularColor (0.0625, 0.03125, 0): F0 is grey, its mean"),
    ],
)
def test_other_specular_colors_are_named(tmp_path, color, specular, says):
    _, material = read(tmp_path, SPECULAR, f"color3f inputs:specularColor = {color}")
    assert (material.specular, material.not_read) == (pytest.approx(specular), (says,))


@pytest.mark.parametrize(
    ("lines", "alpha", "cutoff", "opacity"),
    [
        (("float inputs:opacity = 0.25",), "blend", 0.5, 0.25),
        (("float inputs:opacity = 0.25", "float inputs:opacityThreshold = 0.125"), "mask", 0.125, 0.25),
        (("float inputs:opacityThreshold = 0.125",), "opaque", 0.125, 1),
        (("float inputs:opacity.connect = </M/T.outputs:a>", "float inputs:opacityThreshold = 0.75"), "mask", 0.75, 1),
        (("float inputs:opacity.connect = </M/T.outputs:a>",), "blend", 0.5, 1),
    ],
)
def test_opacity_blends_and_with_a_threshold_masks(tmp_path, lines, alpha, cutoff, opacity):
    image(tmp_path / "t.png", channels=4)
    _, material = read(tmp_path, *lines, nodes=[sampler("T")])
    assert (material.alpha, material.alpha_cutoff, material.opacity) == (alpha, cutoff, opacity)


def test_colour_and_opacity_of_one_image_are_one_texture(tmp_path):
    codes = image(tmp_path / "t.png", channels=4) / 255
    connections = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", "float inputs:opacity.connect = </M/T.outputs:a>"
    scene, material = read(tmp_path, *connections, nodes=[sampler("T")])
    assert len(scene.textures) == 1 and material.base_color == (1, 1, 1)
    expected = np.concatenate([decoded(codes[..., :3]), codes[..., 3:]], axis=-1)  # alpha is never sRGB-encoded
    np.testing.assert_allclose(texels_of(scene, material.base_texture), expected, rtol=ROUNDING)


def test_opacity_of_another_image_goes_beside_the_colour(tmp_path):
    color, mask = image(tmp_path / "t.png") / 255, image(tmp_path / "m.png", seed=2) / 255
    connections = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", "float inputs:opacity.connect = </M/O.outputs:g>"
    scene, material = read(tmp_path, *connections, nodes=[sampler("T"), sampler("O", file="m.png")])
    expected = np.concatenate([decoded(color), mask[..., 1:2]], axis=-1)
    np.testing.assert_allclose(texels_of(scene, material.base_texture), expected, rtol=ROUNDING)
    assert sorted(file.name for file in scene.files[1:]) == ["m.png", "t.png"]


def test_opacity_of_sixteen_bits_keeps_the_colour_of_eight(tmp_path):
    color = image(tmp_path / "t.png") / 255
    codes = np.random.default_rng(2).integers(0, 65536, (5, 7), dtype=np.uint16)
    Image.fromarray(codes).save(tmp_path / "m.png")
    connections = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", "float inputs:opacity.connect = </M/O.outputs:r>"
    scene, material = read(tmp_path, *connections, nodes=[sampler("T"), sampler("O", file="m.png")])
    expected = np.concatenate([decoded(color), codes[..., None] / 65535], axis=-1)
    np.testing.assert_allclose(texels_of(scene, material.base_texture), expected, rtol=ROUNDING)
    assert not scene.textures[material.base_texture.texture].srgb


ORM = "float inputs:roughness.connect = </M/T.outputs:g>", "float inputs:metallic.connect = </M/{}.outputs:b>"


def test_occlusion_roughness_metallic_of_one_image_are_read_in_place(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    scene, material = read(tmp_path, ORM[0], ORM[1].format("T"), nodes=[sampler("T")])
    texels = texels_of(scene, material.surface_texture)
    np.testing.assert_allclose(texels[..., 1:3], codes[..., 1:], rtol=ROUNDING)
    assert (texels[..., 0] == 1).all() and (material.roughness, material.metallic) == (1, 1)
    assert len(scene.textures) == 1


def test_two_samplers_of_one_image_keep_their_own_scale(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    nodes = sampler("T", "float4 inputs:scale = (0.5, 0.5, 0.5, 0.5)"), sampler("U")
    scene, material = read(tmp_path, ORM[0], ORM[1].format("U"), nodes=nodes)
    texels = texels_of(scene, material.surface_texture)
    np.testing.assert_allclose(texels[..., 1], 0.5 * codes[..., 1], rtol=ROUNDING)
    np.testing.assert_allclose(texels[..., 2], codes[..., 2], rtol=ROUNDING)


def test_metallic_alone_leaves_roughness_its_constant(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    scene, material = read(tmp_path, "float inputs:roughness = 0.25", ORM[1].format("T"), nodes=[sampler("T")])
    texels = texels_of(scene, material.surface_texture)
    np.testing.assert_allclose(texels[..., 2], codes[..., 2], rtol=ROUNDING)
    assert (texels[..., :2] == 1).all() and (material.roughness, material.metallic) == (0.25, 1)


def test_parts_of_different_sizes_are_brought_to_the_largest():
    large = np.arange(5 * 7 * 4, dtype=np.uint8).reshape(5, 7, 4)
    small = np.full((3, 2, 4), 77, np.uint8)
    a, b = (Texture(name=n, texels=t, srgb=False) for n, t in (("a", large), ("b", small)))
    packed = pack_channels("p", {1: (a, 0), 2: (b, 3)}).texels
    np.testing.assert_array_equal(packed[..., 1], large[..., 0])
    assert packed.shape == (5, 7, 4) and (packed[..., 2] == 77).all() and (packed[..., [0, 3]] == 255).all()


def test_normal_maps_are_raw_with_their_scale_and_bias(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    remap = "float4 inputs:scale = (2, -2, 2, 1)", "float4 inputs:bias = (-1, 1, -1, 0)"  # green down
    scene, material = read(tmp_path, "normal3f inputs:normal.connect = </M/T.outputs:rgb>", nodes=[sampler("T", *remap)])
    texels = texels_of(scene, material.normal_texture)[..., :3]
    np.testing.assert_allclose(texels, codes * [2, -2, 2] + [-1, 1, -1], atol=ROUNDING)  # 2 c - 1 cancels near c = 0.5


@pytest.mark.parametrize(
    ("space", "key", "srgb"),
    [
        ("auto", "diffuseColor", True),
        ("raw", "diffuseColor", False),
        ("sRGB", "diffuseColor", True),
        ("auto", "emissiveColor", True),
        ("auto", "normal", False),
        ("auto", "roughness", False),
    ],
)
def test_colour_spaces(tmp_path, space, key, srgb):
    image(tmp_path / "t.png")
    output = "g" if key == "roughness" else "rgb"
    kind = {"normal": "normal3f", "roughness": "float"}.get(key, "color3f")
    node = sampler("T", f'token inputs:sourceColorSpace = "{space}"')
    scene, _ = read(tmp_path, f"{kind} inputs:{key}.connect = </M/T.outputs:{output}>", nodes=[node])
    assert [texture.srgb for texture in scene.textures] == [srgb]


def test_wrap_modes(tmp_path):
    image(tmp_path / "t.png")
    node = sampler("T", 'token inputs:wrapS = "clamp"', 'token inputs:wrapT = "mirror"')
    scene, _ = read(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[node])
    assert scene.textures[0].wrap == ("clamp", "mirror")


def turn(name, source, scale="(1, 1)", rotation=0, shift="(0, 0)"):
    inputs = f"float2 inputs:scale = {scale}", f"float inputs:rotation = {rotation}", f"float2 inputs:translation = {shift}"
    return shader(name, "UsdTransform2d", f"float2 inputs:in.connect = </M/{source}.outputs:result>", *inputs)


READER = shader("R", "UsdPrimvarReader_float2", 'string inputs:varname = "map1"')


@pytest.mark.parametrize(
    ("nodes", "expected"),
    [
        # The specification: in * scale, then rotated (degrees, counter-clockwise), then translated. (1, 0) -> (0, 2) + t.
        ([turn("X", "R", "(2, 3)", 90, "(0.25, 0.5)")], [[0, -3, 0.25], [2, 0, 0.5]]),
        # Two in a row: first Y's translation, then X's scale.
        ([turn("X", "Y", "(2, 3)"), turn("Y", "R", shift="(0.25, 0.5)")], [[2, 0, 0.5], [0, 3, 1.5]]),
    ],
)
def test_uv_transforms(tmp_path, nodes, expected):
    image(tmp_path / "t.png")
    node = sampler("T", "float2 inputs:st.connect = </M/X.outputs:result>")
    _, material = read(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[node, READER, *nodes])
    np.testing.assert_allclose(material.base_texture.uv, expected, atol=ROUNDING)


def test_the_primvar_that_the_material_names_gives_uv(tmp_path):
    image(tmp_path / "t.png")
    node = sampler("T", "float2 inputs:st.connect = </M/R.outputs:result>")
    file = surface(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[node, READER])
    primvars = (f'texCoord2f[] primvars:{name} (interpolation = "constant")' for name in ("st = [(1, 0)]", "map1 = [(2, 0)]"))
    file.write_text(file.read_text().replace("rel material", "\n".join(primvars) + "\nrel material"))
    assert (load_scene(file).meshes[0].uv == [2, 0]).all()


@pytest.mark.parametrize(("file", "says"), [("nowhere.png", "missing texture nowhere.png"), ("", "texture without a file")])
def test_a_missing_texture_names_file_and_field(tmp_path, file, says):
    node = sampler("T", file=file) if file else shader("T", "UsdUVTexture")
    scene = surface(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[node])
    with pytest.raises(InputError, match=rf"^{scene}, /M\.diffuseColor: {says}"):
        load_scene(scene)


def test_a_broken_texture_is_named(tmp_path):
    (tmp_path / "t.png").write_bytes(b"\x89PNG\r\n\x1a\n cut off")
    with pytest.raises(InputError, match="t.png: cannot be read as an image"):
        read(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[sampler("T")])


def test_the_hash_follows_a_textures_bytes(tmp_path):
    image(tmp_path / "t.png")
    file = surface(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[sampler("T")])
    first = scene_hash(load_scene(file))
    assert scene_hash(load_scene(file)) == first
    image(tmp_path / "t.png", seed=2)
    assert scene_hash(load_scene(file)) != first


FADES = "opacityMode transparent: highlights fade with opacity, too"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (("float inputs:clearcoat = 0.5",), ("clearcoat 0.5", "clearcoatRoughness 0.01")),
        (("float inputs:clearcoatRoughness = 0.5",), ()),
        (("float inputs:displacement = 0.25",), ("displacement 0.25",)),
        (("normal3f inputs:normal = (1, 0, 0)",), ("normal (1, 0, 0)",)),
        (("float inputs:occlusion = 0.5",), ("occlusion 0.5",)),
        (("float inputs:occlusion.connect = </M/T.outputs:r>",), ("occlusion map",)),
        (("float inputs:displacement.connect = </M/T.outputs:r>",), ("displacement (texture)",)),
        (("float inputs:ior.connect = </M/T.outputs:r>",), ("ior (texture)",)),
        ((SPECULAR, "color3f inputs:specularColor.connect = </M/T.outputs:rgb>"), ("specularColor (texture)",)),
        (("color3f inputs:specularColor = (1, 1, 1)",), ()),
        (("float inputs:opacity = 0.5",), (FADES,)),
        (("float inputs:opacity = 0.5", 'token inputs:opacityMode = "presence"'), ()),
        (("float inputs:opacity = 0.5", "float inputs:opacityThreshold = 0.25"), ()),
        (('token inputs:opacityMode = "presence"',), ()),
        (("float inputs:clearcoat.timeSamples = { 0: 0, 9: 1 }",), ("animation of clearcoat: it stays as it begins",)),
        (("color3f inputs:diffuseColor.connect = </M/R.outputs:rgb>",), ("diffuseColor through UsdPrimvarReader_float2",)),
    ],
)
def test_what_a_material_does_not_do_is_named_where_it_acts(tmp_path, lines, says):
    image(tmp_path / "t.png")
    _, material = read(tmp_path, *lines, nodes=[sampler("T"), READER])
    assert material.not_read == says
    assert material.roughness == 0.5


def test_inputs_that_a_material_animates_are_followed(tmp_path):
    file = surface(tmp_path, "float inputs:roughness.connect = </M.inputs:rough>")
    keyed = "float inputs:rough.timeSamples = { 0: 0.25, 24: 1 }\ntoken outputs:surface.connect"
    file.write_text(file.read_text().replace("token outputs:surface.connect", keyed, 1))
    scene = load_scene(file)
    assert (scene.materials[0].roughness, scene.materials[0].not_read) == (0.25, ())
    assert [scene.materials_at(time_s)[0].roughness for time_s in (0, 0.5, 1, 2)] == [0.25, 0.625, 1, 1]


def test_an_emission_ramp_is_held_before_its_first_sample(tmp_path):
    ramp = "color3f inputs:emissiveColor.timeSamples = { 24: (0, 0, 0), 48: (4, 2, 8) }"
    scene, material = read(tmp_path, ramp)
    assert (material.emission, material.not_read) == ((0, 0, 0), ())
    found = [scene.materials_at(time_s)[0].emission for time_s in (0, 1, 1.5, 2)]
    assert found == [(0, 0, 0), (0, 0, 0), (2, 1, 4), (4, 2, 8)]


def test_constants_change(tmp_path):
    keys = ("color3f", "diffuseColor", "(0, 0.5, 1)", "(1, 0.5, 0)"), ("float", "metallic", 0, 1), ("float", "ior", 1, 1.5)
    scene, _ = read(tmp_path, *(f"{kind} inputs:{key}.timeSamples = {{ 0: {a}, 24: {b} }}" for kind, key, a, b in keys))
    half, end = (scene.materials_at(time_s)[0] for time_s in (0.5, 1))
    assert (half.base_color, half.metallic, end.base_color) == ((0.5, 0.5, 0.5), 0.5, (1, 0.5, 0))
    # F0 = ((1.25 - 1) / (1.25 + 1))^2 = 1 / 81, and 0.04 at the end
    assert (half.specular, end.specular) == (pytest.approx(1 / 81 / 0.08), 0.5)


def test_a_material_that_fades_blends_from_the_beginning(tmp_path):
    scene, material = read(tmp_path, "float inputs:opacity.timeSamples = { 0: 1, 24: 0 }")
    faded = scene.materials_at(0.75)[0]
    assert (material.alpha, material.opacity, faded.alpha, faded.opacity) == ("blend", 1, "blend", 0.25)


def test_a_cutoff_changes_and_may_be_0_at_times(tmp_path):
    scene, material = read(tmp_path, "float inputs:opacity = 0.5", "float inputs:opacityThreshold.timeSamples = {0: 0, 24: 1}")
    assert (material.alpha, material.alpha_cutoff, scene.materials_at(0.25)[0].alpha_cutoff) == ("mask", 0, 0.25)


@pytest.mark.parametrize("alone", [True, False])
def test_a_texture_scrolls(tmp_path, alone):
    image(tmp_path / "t.png", channels=4)
    scroll = turn("X", "R").replace("translation = (0, 0)", "translation.timeSamples = { 0: (0, 0), 24: (1, 2) }")
    node = sampler("T", "float2 inputs:st.connect = </M/X.outputs:result>")
    more = () if alone else ("float inputs:opacity.connect = </M/T.outputs:a>", "float inputs:opacityThreshold = 0.5")
    color = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>"
    scene, material = read(tmp_path, color, *more, nodes=[node, READER, scroll])
    slots = [scene.materials_at(time_s)[0].base_texture for time_s in (0, 0.25, 1)]
    assert [slot.uv for slot in slots] == [((1, 0, x), (0, 1, 2 * x)) for x in (0, 0.25, 1)]
    assert {slot.texture for slot in slots} == {material.base_texture.texture} and material.not_read == ()
    assert len(scene.textures) == 1


def test_textures_whose_settings_change_are_named(tmp_path):
    image(tmp_path / "t.png")
    keyed = (
        "asset inputs:file.timeSamples = { 0: @t.png@, 9: @u.png@ }",
        "float4 inputs:scale.timeSamples = { 0: (1, 1, 1, 1), 9: (0, 0, 0, 1) }",
    )
    scene, material = read(
        tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[shader("T", "UsdUVTexture", *keyed)]
    )
    said = (f"animation of {name} of the texture of diffuseColor: it stays as it begins" for name in ("file", "scale"))
    assert set(material.not_read) == set(said) and scene.materials_at is None


def test_materials_that_stay_are_not_read_again(tmp_path):
    assert read(tmp_path)[0].materials_at is None


def test_an_ior_below_0_is_named_at_its_time(tmp_path):
    scene, _ = read(tmp_path, "float inputs:ior.timeSamples = { 0: 1.5, 24: -1 }")
    with pytest.raises(InputError, match=f"^{tmp_path / 'scene.usda'}, /M: index of refraction -1"):
        scene.materials_at(1)


def test_a_second_set_of_uv_and_a_second_transform_are_named(tmp_path):
    image(tmp_path / "t.png")
    image(tmp_path / "o.png", seed=2)
    connections = (
        "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>",
        "float inputs:opacity.connect = </M/O.outputs:r>",
        "float inputs:opacityThreshold = 0.5",
    )
    other = sampler("O", "float2 inputs:st.connect = </M/X.outputs:result>", 'token inputs:wrapS = "black"', file="o.png")
    _, material = read(tmp_path, *connections, nodes=[sampler("T"), other, READER, turn("X", "R", "(2, 2)")])
    assert material.not_read == (
        "uv map1 of opacity: it is read with st",
        "wrap mode black of opacity: it is read with clamp",
        "transform of uv or wrap mode of opacity: those of diffuseColor are used",
    )


def by_primvar(name, primvar, source="R"):
    """A sampler of t.png with the coordinates of a primvar, and its reader."""
    reader = shader(f"{source}{name}", "UsdPrimvarReader_float2", f'string inputs:varname = "{primvar}"')
    return sampler(name, f"float2 inputs:st.connect = </M/{source}{name}.outputs:result>"), reader


def test_textures_of_two_primvars_read_two_sets_of_uv(tmp_path):
    image(tmp_path / "t.png")
    keys = (
        ("color3f", "diffuseColor", "A.outputs:rgb"),
        ("float", "roughness", "B.outputs:g"),
        ("float", "metallic", "B.outputs:b"),
    )
    lines = [f"{kind} inputs:{key}.connect = </M/{output}>" for kind, key, output in keys]
    file = surface(tmp_path, *lines, nodes=[*by_primvar("A", "map1"), *by_primvar("B", "map2")])
    primvars = (f'texCoord2f[] primvars:{name} (interpolation = "constant")' for name in ("map2 = [(1, 0)]", "map1 = [(2, 0)]"))
    file.write_text(file.read_text().replace("rel material", "\n".join(primvars) + "\nrel material"))
    scene = load_scene(file)
    material = scene.materials[0]
    assert (material.base_texture.uv_set, material.surface_texture.uv_set, material.not_read) == (0, 1, ())
    assert (scene.meshes[0].uv == [2, 0]).all() and (scene.meshes[0].uv2 == [1, 0]).all()


def test_a_third_set_of_uv_is_named(tmp_path):
    image(tmp_path / "t.png")
    keys = (
        ("color3f", "diffuseColor", "A.outputs:rgb"),
        ("float", "roughness", "B.outputs:g"),
        ("color3f", "emissiveColor", "C.outputs:rgb"),
    )
    lines = [f"{kind} inputs:{key}.connect = </M/{output}>" for kind, key, output in keys]
    nodes = [node for name, primvar in zip("ABC", ("u0", "u1", "u2"), strict=True) for node in by_primvar(name, primvar)]
    _, material = read(tmp_path, *lines, nodes=nodes)
    assert material.not_read == ("uv u2 of emissiveColor: it is read with u0",)
    assert [slot.uv_set for slot in (material.base_texture, material.surface_texture, material.emission_texture)] == [0, 1, 0]


def colour_reader(name, primvar, *lines, kind="UsdPrimvarReader_float3"):
    return shader(name, kind, f'string inputs:varname = "{primvar}"', *lines)


DISPLAY = 'color3f[] primvars:tint = [(0.25, 0.5, 1)] (interpolation = "constant")'
OPACITY = 'float[] primvars:fade = [0.5] (interpolation = "constant")'


def read_with_primvars(folder, *lines, nodes=(), primvars=(DISPLAY, OPACITY)):
    file = surface(folder, *lines, nodes=nodes)
    file.write_text(file.read_text().replace("rel material", "\n".join(primvars) + "\nrel material"))
    scene = load_scene(file)
    return scene, scene.materials[scene.objects[0].material], scene.meshes[0].colors


def test_a_primvar_of_colour_and_one_of_opacity_drive_the_vertices(tmp_path):
    lines = (
        "color3f inputs:diffuseColor.connect = </M/C.outputs:result>",
        "float inputs:opacity.connect = </M/O.outputs:result>",
    )
    nodes = colour_reader("C", "tint"), colour_reader("O", "fade", kind="UsdPrimvarReader_float")
    _, material, colors = read_with_primvars(tmp_path, *lines, 'token inputs:opacityMode = "presence"', nodes=nodes)
    assert (material.base_color, material.opacity, material.alpha, material.not_read) == ((1, 1, 1), 1, "blend", ())
    assert material.vertex_colors == "base_color" and (colors == [0.25, 0.5, 1, 0.5]).all()


def test_a_primvar_drives_the_emission(tmp_path):
    lines = ("color3f inputs:emissiveColor.connect = </M/C.outputs:result>",)
    _, material, colors = read_with_primvars(tmp_path, *lines, nodes=[colour_reader("C", "tint")])
    assert (material.vertex_colors, material.emission, material.not_read) == ("emission", (1, 1, 1), ())
    np.testing.assert_allclose(material.base_color, (0.18, 0.18, 0.18), rtol=ROUNDING)
    assert (colors == [0.25, 0.5, 1, 1]).all()


def test_a_second_primvar_of_colour_is_named(tmp_path):
    lines = [f"color3f inputs:{key}.connect = </M/C.outputs:result>" for key in ("diffuseColor", "emissiveColor")]
    _, material, _ = read_with_primvars(tmp_path, *lines, nodes=[colour_reader("C", "tint")])
    assert (material.vertex_colors, material.emission) == ("base_color", (0, 0, 0))
    assert material.not_read == ("emissiveColor through UsdPrimvarReader_float3",)


def test_a_mesh_without_the_primvar_takes_the_readers_fallback(tmp_path):
    node = colour_reader("C", "elsewhere", "float3 inputs:fallback = (0.5, 0.25, 0)")
    _, _, colors = read_with_primvars(tmp_path, "color3f inputs:diffuseColor.connect = </M/C.outputs:result>", nodes=[node])
    assert (colors == [0.5, 0.25, 0, 1]).all()


def test_the_material_of_meshes_with_display_colours_alone():
    reader = MaterialReader()
    index, blended = reader.colored_default(), reader.colored_default(blend=True)
    white, fading = reader.materials[index], reader.materials[blended]
    assert (white.base_color, white.alpha, fading.alpha) == ((1, 1, 1), "opaque", "blend")
    assert index == reader.colored_default() and len({index, blended, reader.material_index(None)}) == 3


def test_values_and_textures_come_through_nested_node_graphs(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    inner = prim(
        "NodeGraph",
        "inner",
        "float inputs:deep.connect = </M/outer.inputs:shallow>",
        "float outputs:rough.connect = </M/outer/inner.inputs:deep>",
        "color3f outputs:rgb.connect = </M/outer/inner/T.outputs:rgb>",
        shader("T", "UsdUVTexture", "asset inputs:file.connect = </M.inputs:picture>"),
    )
    passed = (
        "color3f outputs:rgb.connect = </M/outer/inner.outputs:rgb>",
        "float outputs:rough.connect = </M/outer/inner.outputs:rough>",
    )
    outer = prim("NodeGraph", "outer", "float inputs:shallow = 0.125", *passed, inner)
    lines = (
        "color3f inputs:diffuseColor.connect = </M/outer.outputs:rgb>",
        "float inputs:roughness.connect = </M/outer.outputs:rough>",
    )
    file = surface(tmp_path, *lines, nodes=[outer])
    interface = "asset inputs:picture = @t.png@\ntoken outputs:surface.connect"
    file.write_text(file.read_text().replace("token outputs:surface.connect", interface, 1))
    scene = load_scene(file)
    np.testing.assert_allclose(texels_of(scene, scene.materials[0].base_texture)[..., :3], decoded(codes), rtol=ROUNDING)
    assert (scene.materials[0].roughness, scene.materials[0].not_read) == (0.125, ())


NORMAL = "normal3f inputs:normal.connect = </M/T.outputs:rgb>"


def test_a_normal_map_of_eight_bits_without_scale_and_bias_gets_them_and_is_named(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    scene, material = read(tmp_path, NORMAL, nodes=[sampler("T")])
    np.testing.assert_allclose(texels_of(scene, material.normal_texture)[..., :3], 2 * codes - 1, atol=ROUNDING)
    assert material.not_read == ("normal map without scale 2 and bias -1: it is read with them",)


@pytest.mark.parametrize(("channels", "srgb"), [(1, False), (2, False), (3, True), (4, True)])
def test_auto_takes_eight_bits_of_three_and_four_channels_for_srgb(tmp_path, channels, srgb):
    pixels = np.random.default_rng(1).integers(0, 256, (5, 7, channels), dtype=np.uint8)
    Image.fromarray(pixels[..., 0] if channels == 1 else pixels).save(tmp_path / "t.png")
    scene, _ = read(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[sampler("T")])
    assert scene.textures[0].srgb == srgb


def test_sixteen_bits_that_are_said_to_be_srgb_are_decoded(tmp_path):
    codes = np.random.default_rng(2).integers(0, 65536, (5, 7), dtype=np.uint16)
    Image.fromarray(codes).save(tmp_path / "t.png")
    node = sampler("T", 'token inputs:sourceColorSpace = "sRGB"')
    scene, material = read(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[node])
    # the power 2.4 of the code in float32
    np.testing.assert_allclose(texels_of(scene, material.base_texture)[..., 0], decoded(codes / 65535), rtol=2.4 * ROUNDING)
    assert not scene.textures[0].srgb


def test_the_alpha_of_a_colour_image_does_not_blend_where_opacity_is_a_constant(tmp_path):
    image(tmp_path / "t.png", channels=4)
    lines = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", "float inputs:opacity = 0.5"
    scene, material = read(tmp_path, *lines, nodes=[sampler("T")])
    assert (texels_of(scene, material.base_texture)[..., 3] == 1).all() and material.opacity == 0.5


def test_each_image_is_decoded_once(tmp_path, monkeypatch):
    image(tmp_path / "t.png")
    names = []
    monkeypatch.setattr(usd_textures, "decode_image", lambda data, name: (names.append(name), decode_image(data, name))[1])
    lines = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", "float inputs:roughness.connect = </M/U.outputs:g>"
    file = surface(tmp_path, *lines, nodes=[sampler("T"), sampler("U", 'token inputs:sourceColorSpace = "raw"')])
    material, mesh = file.read_text().split("\n", 4)[4].split("def Mesh")
    with file.open("a") as stage:
        stage.write((material + "def Mesh" + mesh).replace('"M"', '"N"').replace('"m"', '"n"').replace("</M", "</N"))
    scene = load_scene(file)
    assert len(scene.objects) == 2 and names == ["t.png"]
    assert len(scene.textures) == 2  # one decoded from sRGB and one raw, of the same texels, for both materials
    assert scene.textures[0].texels is scene.textures[1].texels


def outside(folder, name):
    """A scene in a folder whose texture is called `name`."""
    inner = folder / "inner"
    inner.mkdir()
    return surface(inner, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[sampler("T", file=name)])


@pytest.mark.parametrize("way", ["up", "absolute", "link"])
def test_textures_outside_the_folder_are_not_opened(tmp_path, way):
    file = outside(tmp_path, {"up": "../t.png", "absolute": f"{tmp_path}/t.png", "link": "t.png"}[way])
    (tmp_path / "t.png").write_text("never decoded")
    if way == "link":
        (tmp_path / "inner" / "t.png").symlink_to(tmp_path / "t.png")
    with pytest.raises(InputError, match=rf"^{file}, /M\.diffuseColor: .*t.png lies outside the scene's folder"):
        load_scene(file)
    image(tmp_path / "t.png")
    assert load_scene(file, allow_outside=True).textures[0].texels.shape == (5, 7, 4)


def package(folder, name, **members):
    """A .usdz of plain members, stored and aligned as USD wants it."""
    with zipfile.ZipFile(folder / name, "w") as archive:
        for member, data in members.items():
            info = zipfile.ZipInfo(member.replace("_", "."))
            info.extra = (
                bytes(2)
                + struct.pack("<H", (-(archive.fp.tell() + 30 + len(info.filename) + 4)) % 64)
                + bytes((-(archive.fp.tell() + 30 + len(info.filename) + 4)) % 64)
            )
            archive.writestr(info, data)
    return folder / name


def test_a_package_reads_its_own_images_and_no_others(tmp_path):
    image(tmp_path / "t.png")
    inside = surface(tmp_path, "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", nodes=[sampler("T")]).read_bytes()
    scene = load_scene(package(tmp_path, "good.usdz", scene_usda=inside, t_png=(tmp_path / "t.png").read_bytes()))
    assert scene.textures[0].texels.shape == (5, 7, 4) and [file.name for file in scene.files] == ["good.usdz"]
    beside = inside.replace(b"@t.png@", f"@{tmp_path}/t.png@".encode())
    file = package(tmp_path, "bad.usdz", scene_usda=beside)
    with pytest.raises(InputError, match=rf"^{file}, /M\.diffuseColor: .*t.png lies outside its package bad.usdz"):
        load_scene(file)
    assert len(load_scene(file, allow_outside=True).textures) == 1


def test_the_first_tile_of_many_is_read_and_named(tmp_path):
    image(tmp_path / "t.1001.png")
    color = "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>"
    scene, material = read(tmp_path, color, nodes=[sampler("T", file="t.<UDIM>.png")])
    assert material.not_read == ("tiles of t.<UDIM>.png: 1001 is drawn everywhere, of diffuseColor",)
    assert [file.name for file in scene.files[1:]] == ["t.1001.png"]


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("token outputs:displacement.connect = </M/D.outputs:out>", ("displacement through ND_displacement_float",)),
        ("token outputs:displacement.connect = </M/S.outputs:surface>", ()),
        ("token outputs:volume.connect = </M/D.outputs:out>", ("volume through ND_displacement_float",)),
    ],
)
def test_outputs_beside_the_surface_are_named(tmp_path, output, says):
    node = prim("Shader", "D", 'uniform token info:id = "ND_displacement_float"', "token outputs:out")
    assert read(tmp_path, nodes=[node, output])[1].not_read == says


def test_third_party_materials_say_what_is_not_drawn(assets):
    said = {what for m in load_scene(assets / "RoughnessTestUSD" / "RoughnessTest.usdz").materials for what in m.not_read}
    assert said == {FADES}  # each has a texture with parts of opacity 0 and the default opacityMode


def test_images_of_sixteen_bits_keep_them(tmp_path):
    codes = np.array([[0, 1, 257], [65535, 32768, 40000]], dtype=np.uint16)
    Image.fromarray(codes).save(tmp_path / "d.png")
    texels = decode_image((tmp_path / "d.png").read_bytes(), "d.png")
    np.testing.assert_allclose(texels[..., 0], codes / 65535, rtol=ROUNDING)
    assert (texels[..., 3] == 1).all()
