"""Mitsuba's BSDF dictionaries as our materials: constants, images, adapters, what is named, what is refused."""

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene.description import Material
from framepairs.scene.images import linear_texels
from framepairs.scene.mitsuba_materials import image_files, material_from_principled
from usd_stages import image

SINGLE = 2.0**-23  # texels are float32


def read(folder, values, name="m"):
    """(material, textures) of a dictionary."""
    return material_from_principled(values, name, folder)


def bitmap(file="t.png", **keys):
    return {"type": "bitmap", "filename": file, **keys}


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


def decoded(codes):
    """IEC 61966-2-1."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_constants_of_principled(tmp_path):
    values = {"base_color": rgb(0.1, 0.2, 0.3), "roughness": 0.25, "metallic": 0.75, "specular": 0.4}
    material, textures = read(tmp_path, {"type": "principled", **values})
    expected = Material(name="m", base_color=(0.1, 0.2, 0.3), roughness=0.25, metallic=0.75, specular=0.4)
    assert (material, textures) == (expected, ())


def test_defaults_are_mitsubas(tmp_path):
    material, _ = read(tmp_path, {"type": "principled"})
    assert material == Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=0.5, metallic=0, specular=0.5)


@pytest.mark.parametrize(
    ("value", "color"),
    [
        (0.25, (0.25,) * 3),
        ({"type": "uniform", "value": 0.25}, (0.25,) * 3),
        ({"type": "spectrum", "value": 0.25}, (0.25,) * 3),
        ({"type": "rgb", "value": 0.25}, (0.25,) * 3),
        ([0.25, 0.5, 1], (0.25, 0.5, 1)),
        ({"type": "srgb", "color": [0.25, 0.5, 1]}, (0.25, 0.5, 1)),
    ],
)
def test_ways_to_write_a_color(tmp_path, value, color):
    material, _ = read(tmp_path, {"type": "principled", "base_color": value})
    assert (material.base_color, material.not_read) == (color, ())


@pytest.mark.parametrize("value", [0.25, {"type": "uniform", "value": 0.25}, rgb(0.25, 0.25, 0.25)])
def test_ways_to_write_a_number(tmp_path, value):
    assert read(tmp_path, {"type": "principled", "roughness": value})[0].roughness == pytest.approx(0.25, rel=SINGLE)


@pytest.mark.parametrize(
    ("keys", "specular", "says"),
    [
        ({"eta": 1.5}, 0.5, ()),
        ({"eta": 1.33}, (0.33 / 2.33) ** 2 / 0.08, ()),
        ({"eta": 2}, 1, ("eta 2: F0 is 0.08, not 0.111",)),  # (1 / 3)^2
        ({"eta": 2, "metallic": 1}, 1, ()),
        ({"specular": 1}, 1, ()),
        ({"specular": bitmap()}, 0.5, ("specular through an image: 0.5 is specular",)),
    ],
)
def test_eta_and_specular(tmp_path, keys, specular, says):
    image(tmp_path / "t.png")
    material, _ = read(tmp_path, {"type": "principled", **keys})
    assert (material.specular, material.not_read) == (pytest.approx(specular, abs=1e-12), says)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"clearcoat": 0.5}, ("clearcoat 0.5",)),
        ({"clearcoat": 0.5, "clearcoat_gloss": 0.25}, ("clearcoat 0.5", "clearcoat_gloss 0.25")),
        ({"clearcoat": 0, "clearcoat_gloss": 0.25}, ()),
        ({"sheen": 1, "sheen_tint": 0.5}, ("sheen 1", "sheen_tint 0.5")),
        ({"sheen_tint": 0.5}, ()),
        ({"spec_trans": 1.0}, ("spec_trans 1",)),
        ({"anisotropic": {"type": "uniform", "value": 0.5}}, ("anisotropic 0.5",)),
        ({"anisotropic": {"type": "uniform", "value": 0}}, ()),
        ({"flatness": bitmap()}, ("flatness (bitmap)",)),
        ({"spec_tint": 0.1}, ("spec_tint 0.1",)),
        ({"main_specular_sampling_rate": 2}, ()),
        ({"hue": 2}, ("property hue",)),
        ({"base_color": {"type": "checkerboard"}}, ("base_color through checkerboard: grey 0.5 is drawn",)),
        ({"roughness": {"type": "checkerboard"}}, ("roughness through checkerboard: 0.5 is drawn",)),
    ],
)
def test_what_is_not_drawn_is_named_where_it_acts(tmp_path, keys, says):
    assert read(tmp_path, {"type": "principled", **keys})[0].not_read == says


@pytest.mark.parametrize("kind", ["roughconductor", "plastic", "roughplastic", "dielectric", "thindielectric", "hair"])
def test_other_bsdfs_are_grey_and_named(tmp_path, kind):
    material, textures = read(tmp_path, {"type": "twosided", "bsdf": {"type": kind}})
    assert (material, textures) == (Material(name="m", not_read=(f"BSDF {kind}: the default grey is drawn",)), ())


def test_diffuse_is_lambert_alone(tmp_path):
    material, _ = read(tmp_path, {"type": "diffuse", "reflectance": rgb(0.1, 0.2, 0.3)})
    assert material == Material(name="m", base_color=(0.1, 0.2, 0.3), roughness=1, metallic=0, specular=0)


@pytest.mark.parametrize(("raw", "decode"), [(True, lambda codes: codes), (False, decoded)])
def test_images_are_decoded_unless_raw(tmp_path, raw, decode):
    codes = image(tmp_path / "t.png") / 255
    keys = {"base_color": bitmap(raw=raw, wrap_mode="mirror"), "roughness": bitmap(raw=raw)}
    material, textures = read(tmp_path, {"type": "principled", **keys})
    assert (material.base_color, material.roughness, material.metallic, material.not_read) == ((1, 1, 1), 1, 0, ())
    base, surface = (textures[slot.texture] for slot in (material.base_texture, material.surface_texture))
    assert (base.wrap, surface.wrap) == (("mirror", "mirror"), ("repeat", "repeat"))
    np.testing.assert_allclose(linear_texels(base)[..., :3], decode(codes), rtol=4 * SINGLE)
    luminance = decode(codes) @ [0.212671, 0.715160, 0.072169]
    texels = linear_texels(surface)
    np.testing.assert_allclose(texels[..., 1], luminance, rtol=4 * SINGLE)
    assert (texels[..., [0, 2, 3]] == 1).all()


def test_grey_raw_images_stay_bytes(tmp_path):
    codes = np.arange(35, dtype=np.uint8).reshape(5, 7)
    Image.fromarray(codes).save(tmp_path / "t.png")
    material, textures = read(tmp_path, {"type": "principled", "metallic": bitmap(raw=True)})
    texels = textures[material.surface_texture.texture].texels
    assert texels.dtype == np.uint8 and material.metallic == 1
    np.testing.assert_array_equal(texels[..., 2], codes)


@pytest.mark.renders
def test_images_and_their_place_are_mitsubas(tmp_path):
    """At the centres of texels, Mitsuba's own look-up; its v runs down where ours runs up."""
    from framepairs.backend import mi

    image(tmp_path / "t.png", width=7, height=5)
    to_uv = [[0.5, 0.25, 0.125], [-0.25, 1, 0.5], [0, 0, 1]]
    keys = {"raw": False, "filter_type": "nearest", "to_uv": to_uv}
    material, textures = read(tmp_path, {"type": "principled", "base_color": bitmap(**keys), "roughness": bitmap(**keys)})
    plugin = {**bitmap(str(tmp_path / "t.png")), **keys, "to_uv": mi.ScalarTransform3f(np.array(to_uv))}
    theirs = mi.load_dict(plugin)
    place = np.array(material.base_texture.uv)
    for u, v in np.random.default_rng(1).uniform(0, 1, (20, 2)):
        si = mi.SurfaceInteraction3f()
        si.uv = mi.Point2f(float(u), float(v))
        x, y = place @ [u, 1 - v, 1]
        row, column = int((1 - y) % 1 * 5), int(x % 1 * 7)
        for slot, component, found in (
            (material.base_texture, slice(0, 3), theirs.eval(si)),
            (material.surface_texture, 1, theirs.eval_1(si)),
        ):
            ours = linear_texels(textures[slot.texture])[row, column, component]
            # Mitsuba keeps 8-bit images in half precision, with 11 bits
            np.testing.assert_allclose(ours, np.array(found).ravel(), rtol=2.0**-10, atol=2.0**-24)
    assert material.not_read == tuple(
        f"nearest filter of {key}: it is filtered trilinearly" for key in ("base_color", "roughness")
    )


@pytest.mark.renders
@pytest.mark.parametrize("keys", [{"specular": 0.3}, {"eta": 1.6}, {"metallic": 1.0, "base_color": rgb(0.2, 0.5, 0.9)}])
def test_reflectance_along_the_normal_is_mitsubas(tmp_path, keys):
    """There the half vector is the normal: f = F0 / (4 pi alpha^2), and Disney's diffuse part is base / pi."""
    from framepairs.backend import mi

    values = {"type": "principled", "roughness": 0.5, **keys}
    material, _ = read(tmp_path, values)
    si = mi.SurfaceInteraction3f()
    si.wi, si.sh_frame = mi.Vector3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1))
    theirs = np.array(mi.load_dict(values).eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1))).ravel()
    base = np.array(material.base_color)
    f0 = (1 - material.metallic) * 0.08 * material.specular + material.metallic * base
    ours = (1 - material.metallic) * base / np.pi + f0 / (4 * np.pi * material.roughness**4)
    # float32: D at its peak, where 1 - cos^2 cancels, has some 16 roundings divided by alpha^2 = 1 / 16
    np.testing.assert_allclose(ours, theirs, rtol=256 * SINGLE)


def test_adapters_are_opened(tmp_path):
    codes = image(tmp_path / "n.png") / 255
    inner = {"type": "principled", "roughness": 0.125}
    normal = {"type": "normalmap", "normalmap": bitmap("n.png", raw=True), "bsdf": inner}
    bump = {"type": "bumpmap", "any name": bitmap("n.png", raw=True), "bsdf": normal}
    material, textures = read(tmp_path, {"type": "twosided", "bsdf": {"type": "mask", "opacity": 0.25, "bsdf": bump}})
    assert (material.roughness, material.alpha, material.opacity, material.not_read) == (0.125, "blend", 0.25, ("bump map",))
    texels = linear_texels(textures[material.normal_texture.texture])
    np.testing.assert_allclose(texels[..., :3], 2 * codes - 1, atol=4 * SINGLE)


def test_two_sides_are_one_and_the_other_is_named(tmp_path):
    sides = {"front": {"type": "principled", "roughness": 0.125}, "back": {"type": "diffuse"}}
    material, _ = read(tmp_path, {"type": "twosided", **sides})
    assert (material.roughness, material.not_read) == (0.125, ("BSDF of the back side: the front's is drawn on both",))


@pytest.mark.parametrize(("levels", "alpha"), [((0, 255), "mask"), ((0, 128, 255), "blend")])
@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("textured", [True, False])
def test_opacity_masks_where_it_is_black_and_white_and_blends_elsewhere(tmp_path, levels, alpha, raw, textured):
    colors = image(tmp_path / "c.png") / 255
    codes = np.random.default_rng(2).choice(np.uint8(levels), (5, 7))
    Image.fromarray(codes).save(tmp_path / "o.png")
    inner = {"type": "principled", "base_color": bitmap("c.png") if textured else rgb(0.5, 0.25, 1)}
    material, textures = read(tmp_path, {"type": "mask", "opacity": bitmap("o.png", raw=raw), "bsdf": inner})
    assert (material.alpha, material.opacity, len(textures)) == (alpha, 1, 1)
    expected = codes / 255 if raw else decoded(codes / 255)
    texture = textures[material.base_texture.texture]
    assert (texture.texels.dtype == np.uint8, texture.srgb) == (raw, raw and textured)
    texels = linear_texels(texture)
    np.testing.assert_allclose(texels[..., 3], expected, rtol=4 * SINGLE)
    np.testing.assert_allclose(texels[..., :3], decoded(colors) if textured else np.ones((5, 7, 3)), rtol=4 * SINGLE)
    assert material.base_color == ((1, 1, 1) if textured else (0.5, 0.25, 1))


def test_a_mask_of_opacity_1_is_opaque(tmp_path):
    material, _ = read(tmp_path, {"type": "mask", "opacity": 1, "bsdf": {"type": "principled"}})
    assert (material.alpha, material.opacity) == ("opaque", 1)


@pytest.mark.parametrize("name", ["../secret.png", "/etc/hostname", "a/../../secret.png", "link.png"])
def test_images_outside_the_folder_are_refused(tmp_path, name):
    folder = tmp_path / "scene"
    folder.mkdir()
    image(tmp_path / "secret.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    values = {"type": "principled", "base_color": bitmap(name)}
    for attempt in (lambda: read(folder, values), lambda: image_files(values, folder)):
        with pytest.raises(InputError, match=f"image {name} lies outside the scene's folder"):
            attempt()


def test_image_files_are_found_at_any_depth(tmp_path):
    (tmp_path / "maps").mkdir()
    image(tmp_path / "t.png")
    image(tmp_path / "maps" / "n.png")
    inner = {"type": "principled", "base_color": bitmap(), "roughness": bitmap()}
    values = {"type": "normalmap", "normalmap": bitmap("maps/n.png"), "bsdf": inner}
    assert image_files(values, tmp_path) == (tmp_path / "maps" / "n.png", tmp_path / "t.png")


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"type": "principled", "eta": 1.5, "specular": 0.5}, "m: eta and specular, which say the same: one is expected"),
        ({"type": "principled", "eta": -1}, "m: index of refraction -1.0"),
        ({"type": "principled", "roughness": "rough"}, "m: roughness is 'rough', a number is expected"),
        ({"type": "principled", "roughness": float("nan")}, "m: roughness is nan"),
        ({"type": "principled", "base_color": rgb(1, 2)}, "m: base_color has 2 components, 3 are expected"),
        ({"type": "principled", "base_color": bitmap("nowhere.png")}, "m: missing image nowhere.png"),
        ({"type": "principled", "base_color": {"type": "bitmap"}}, "m: bitmap of base_color without a filename"),
        ({"type": "principled", "base_color": bitmap(wrap_mode="border")}, "m: wrap_mode border of base_color: one of"),
        ({"type": "principled", "base_color": bitmap(to_uv=[[1, 2]])}, "m: to_uv of base_color is no 3x3 or 4x4 matrix"),
        ({"type": "principled", "base_color": bitmap("broken.png")}, "broken.png, m: cannot be read as an image"),
        ({"type": "twosided"}, "m: twosided without a BSDF in it"),
        ({"type": "normalmap", "bsdf": {"type": "principled"}}, "m: normalmap without a bitmap"),
        ({}, "m: a BSDF without a type"),
    ],
)
def test_what_is_wrong_is_named_with_the_material(tmp_path, values, says):
    image(tmp_path / "t.png")
    (tmp_path / "broken.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=says):
        read(tmp_path, values)
