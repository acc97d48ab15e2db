"""Mitsuba's BSDF dictionaries as our materials: constants, images, adapters, what is named, what is refused."""

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene.containment import Reach
from framepairs.scene.description import Material
from framepairs.scene.images import linear_texels
from framepairs.scene.mitsuba_kept import INDICES, PARAMETERS, kept_bsdf
from framepairs.scene.mitsuba_materials import METALS, material_of
from framepairs.scene.mitsuba_textures import image_files
from usd_stages import image

SINGLE = 2.0**-23  # texels are float32


def read(folder, values, name="m"):
    """(material, textures) of a dictionary."""
    found = material_of(values, name, Reach(folder.resolve()))
    return found.material, found.textures


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
        ({"anisotropic": {"type": "uniform", "value": 0.5}}, ("anisotropic 0.5",)),
        ({"anisotropic": {"type": "uniform", "value": 0}}, ()),
        ({"spec_trans": {"type": "uniform", "value": 0.0}}, ()),
        ({"flatness": bitmap()}, ("flatness (bitmap)",)),
        ({"spec_tint": 0.1}, ("spec_tint 0.1",)),
        ({"main_specular_sampling_rate": 2}, ()),
        ({"hue": 2}, ("property hue",)),
        ({"base_color": {"type": "checkerboard"}}, ("base_color through checkerboard: grey 0.5 is drawn",)),
        ({"roughness": {"type": "checkerboard"}}, ("roughness through checkerboard: 0.5 is drawn",)),
    ],
)
def test_what_is_not_drawn_is_named_where_it_acts(tmp_path, keys, says):
    image(tmp_path / "t.png")
    material = read(tmp_path, {"type": "principled", **keys})[0]
    has_lobes = bool(says) and says[0].split()[0] in ("clearcoat", "sheen", "anisotropic", "flatness", "spec_tint")
    kept = ("BSDF principled: kept for path, raster draws a stand-in, not demodulated",) if has_lobes else ()
    assert material.not_read == (*says, *kept)
    assert (material.bsdf is not None) == has_lobes


KEPT = [
    ({"type": "plastic", "diffuse_reflectance": rgb(0.1, 0.2, 0.3)}, {"base_color": (0.1, 0.2, 0.3), "roughness": 0.0}),
    ({"type": "roughplastic", "alpha": 0.25, "nonlinear": True}, {"base_color": (0.5, 0.5, 0.5), "roughness": 0.5}),
    ({"type": "pplastic", "alpha": 0.25}, {"base_color": (0.5, 0.5, 0.5), "roughness": 0.5}),
    ({"type": "dielectric", "int_ior": "water", "ext_ior": 1.0}, {"alpha": "blend", "opacity": 0.1, "roughness": 0.0}),
    ({"type": "thindielectric"}, {"alpha": "blend", "opacity": 0.1, "roughness": 0.0}),
    ({"type": "roughdielectric", "alpha": 0.04}, {"alpha": "blend", "opacity": 0.1, "roughness": 0.2}),
    ({"type": "principled", "spec_trans": 1.0, "roughness": 0.25}, {"alpha": "blend", "opacity": 0.1, "roughness": 0.25}),
    ({"type": "principledthin", "base_color": rgb(0.1, 0.2, 0.3)}, {"base_color": (0.1, 0.2, 0.3), "roughness": 0.5}),
    ({"type": "roughconductor", "material": "Au", "alpha": 0.04}, {"base_color": (1, 1, 1), "metallic": 1, "roughness": 0.2}),
    ({"type": "roughconductor", "alpha_u": 0.01, "alpha_v": 0.16, "distribution": "ggx"}, {"metallic": 1, "roughness": 0.2}),
    ({"type": "conductor", "material": "SiC"}, {"metallic": 1, "roughness": 0.0}),
    ({"type": "hair"}, {"base_color": (0.5, 0.5, 0.5)}),
    (
        {"type": "blendbsdf", "weight": 0.75, "a": {"type": "diffuse"}, "b": {"type": "conductor"}},
        {"metallic": 1, "roughness": 0},
    ),
]


@pytest.mark.renders
@pytest.mark.parametrize(("values", "fields"), KEPT)
@pytest.mark.parametrize("sides", [False, True])
def test_other_bsdfs_are_kept_as_mitsuba_takes_them(tmp_path, values, fields, sides):
    """Glass cannot stand inside `twosided`, in Mitsuba neither."""
    from framepairs.backend import mi

    is_clear = fields.get("alpha") == "blend" or values["type"] in ("hair", "principledthin")
    sides = sides and not is_clear
    wrapped = {"type": "twosided", "id": "x", "inside": values} if sides else values
    material, textures = read(tmp_path, wrapped)
    assert textures == ()
    for key, value in fields.items():
        assert getattr(material, key) == (value if isinstance(value, str) else pytest.approx(value)), key
    said = f"BSDF {values['type']}: kept for path, raster draws a stand-in, not demodulated"
    assert material.not_read == (said,)
    assert material.bsdf == ({"type": "twosided", "inner": values} if sides else values)
    mi.load_dict(dict(material.bsdf))


def test_files_and_transforms_of_kept_bsdfs_are_absolute_and_plain(tmp_path):
    image(tmp_path / "t.png")
    texture = bitmap(to_uv=[[2, 0, 0.5], [0, 3, 0.25], [0, 0, 1]])
    bump = {"type": "bumpmap", "arbitrary": bitmap(raw=True), "bsdf": {"type": "plastic", "diffuse_reflectance": texture}}
    found = material_of({"type": "twosided", "bsdf": bump}, "m", Reach(tmp_path.resolve()))
    to_uv = [[2, 0, 0, 0.5], [0, 3, 0, 0.25], [0, 0, 1, 0], [0, 0, 0, 1]]
    name = str(tmp_path / "t.png")
    plastic = {"type": "plastic", "diffuse_reflectance": {"type": "bitmap", "filename": name, "to_uv": to_uv}}
    kept = {"type": "bumpmap", "arbitrary": {"type": "bitmap", "filename": name, "raw": True}, "inner": plastic}
    assert found.material.bsdf == {"type": "twosided", "inner": kept}
    assert found.files == (tmp_path / "t.png",)


def test_masks_of_one_opacity_and_normal_maps_stay_in_kept_bsdfs(tmp_path):
    """`path` draws the kept one with Mitsuba's normal map, the G-buffer and `raster` with ours."""
    image(tmp_path / "n.png")
    normal = {"type": "normalmap", "normalmap": bitmap("n.png", raw=True), "bsdf": {"type": "plastic"}}
    material, _ = read(tmp_path, {"type": "mask", "opacity": 0.25, "bsdf": {"type": "twosided", "bsdf": normal}})
    assert (material.opacity, material.alpha) == (0.25, "blend")
    map_there = {"type": "bitmap", "filename": str(tmp_path / "n.png"), "raw": True}
    inside = {"type": "normalmap", "normalmap": map_there, "inner": {"type": "plastic"}}
    masked = {"type": "mask", "opacity": 0.25, "inner": {"type": "twosided", "inner": inside}}
    assert material.bsdf == masked
    assert material.normal_texture is not None


def test_null_is_not_drawn(tmp_path):
    found = material_of({"type": "null"}, "m", Reach(tmp_path))
    assert (found.drawn, found.material.opacity, found.material.bsdf) == (False, 0.0, None)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"type": "evil"}, "m: unknown type 'evil'"),
        ({"type": "cube"}, "m: cube is no BSDF"),
        ({"type": "plastic", "diffuse_reflectance": {"type": "../evil"}}, "m: ../evil in a BSDF"),
        ({"type": "plastic", "diffuse_reflectance": bitmap("../t.png")}, "m: ../t.png lies outside"),
        ({"type": "plastic", "diffuse_reflectance": bitmap("bad.hdr")}, "bad.hdr, m: cannot be read as Radiance"),
        ({"type": "measured", "filename": "/etc/hostname"}, "m: /etc/hostname lies outside"),
        ({"type": "conductor", "material": "../../secret"}, "m: material is '../../secret', a name is expected"),
        ({"type": "dielectric", "int_ior": "banana"}, "m: int_ior is 'banana', a number or one of acetone"),
        ({"type": "dielectric", "int_ior": float("inf")}, "m: int_ior is inf, a number is expected"),
        ({"type": "dielectric", "ext_ior": 0.0}, "m: ext_ior is 0"),
        ({"type": "blendbsdf", "weight": 0.5}, "m: blendbsdf without a BSDF in it"),
        ({"type": "roughconductor", "distribution": "ggx", "alpha": 2.0}, "m: alpha is 2, 0 to 1 is expected"),
    ],
)
def test_kept_bsdfs_are_checked(tmp_path, values, says):
    folder = tmp_path / "in"
    folder.mkdir()
    image(tmp_path / "t.png")
    (folder / "bad.hdr").write_bytes(b"#?RADIANCE\n\n-Y 9 +X 9\n123")
    with pytest.raises(InputError, match=says):
        read(folder, values)


def test_unknown_parameters_of_kept_bsdfs_are_left_out_and_named(tmp_path):
    values = {"type": "plastic", "hue": 3, "diffuse_reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}
    kept, said = kept_bsdf(values, Reach(tmp_path))
    assert (kept, said) == ({"type": "plastic"}, ("plastic.hue", "plastic.diffuse_reflectance through mesh_attribute"))


@pytest.mark.renders
@pytest.mark.parametrize("name", [name for name in METALS if name != "none"])
def test_metals_reflect_what_mitsubas_do(tmp_path, name):
    """Fresnel's equations at normal incidence of the indices that Mitsuba holds; the table has 4 digits."""
    from framepairs.backend import mi

    found = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
    eta, k = (np.array(found[f"{key}.value"]).ravel() for key in ("eta", "k"))
    material, _ = read(tmp_path, {"type": "conductor", "material": name})
    np.testing.assert_allclose(material.base_color, ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2), atol=1e-4)


@pytest.mark.renders
@pytest.mark.parametrize("cosine", [1.0, 0.8])
def test_rough_metal_is_mitsubas(tmp_path, cosine):
    """At the mirror direction D G F / (4 cos^2); separable Smith. Schlick's F differs from Fresnel's by below 0.01 there."""
    from framepairs.backend import mi

    values = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.25, "material": "Cu"}
    material, _ = read(tmp_path, {**values, "specular_reflectance": rgb(1, 0.5, 0.25)})
    assert (material.metallic, material.roughness, material.bsdf) == (1, 0.5, None)
    bsdf = mi.load_dict({**values, "specular_reflectance": rgb(1, 0.5, 0.25)})
    sine = float(np.sqrt(1 - cosine**2))
    si = mi.SurfaceInteraction3f()
    si.wi, si.sh_frame = mi.Vector3f(sine, 0, cosine), mi.Frame3f(mi.Vector3f(0, 0, 1))
    theirs = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(-sine, 0, cosine))).ravel()
    f0 = np.array(METALS["Cu"])
    alpha = material.roughness**2
    g = (2 / (1 + np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)))) ** 2
    fresnel = f0 + (1 - f0) * (1 - cosine) ** 5
    ours = np.array([1, 0.5, 0.25]) * fresnel * g / (np.pi * alpha**2 * 4 * cosine)
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


def test_alpha_through_an_image_becomes_roughness(tmp_path):
    codes = np.arange(35, dtype=np.uint8).reshape(5, 7) * 7
    Image.fromarray(codes).save(tmp_path / "t.png")
    values = {"type": "roughconductor", "distribution": "ggx", "alpha": bitmap(raw=True)}
    material, textures = read(tmp_path, values)
    texels = linear_texels(textures[material.surface_texture.texture])
    np.testing.assert_allclose(texels[..., 1], np.sqrt(codes / 255), atol=4 * SINGLE)


@pytest.mark.renders
def test_the_indices_are_mitsubas():
    from framepairs.backend import mi

    for name, index in INDICES.items():
        theirs = mi.traverse(mi.load_dict({"type": "dielectric", "int_ior": name, "ext_ior": 1.0}))["eta"]
        assert index == pytest.approx(float(np.array(theirs).ravel()[0]), rel=2e-7), name


@pytest.mark.renders
def test_every_kept_parameter_is_one_of_mitsubas():
    """Mitsuba refuses what it does not know; the values here are neutral ones of the right kind."""
    from framepairs.backend import mi

    texts = {"distribution": "ggx", "material": "Cu"}
    flags = ("sample_visible", "nonlinear", "polarizing", "left_handed", "use_shadowing_function", "flip_invalid_normals")
    nested = {"twosided": 1, "bumpmap": 1, "normalmap": 1, "mask": 1, "blendbsdf": 2}
    for kind, keys in PARAMETERS.items():
        if kind in ("bitmap", "checkerboard", "rgb", "srgb", "uniform", "spectrum", "measured"):
            continue
        for key in keys - {"normalmap"}:
            value = texts.get(key, True if key in flags else 0.25)
            values = {"type": kind, key: value, **{f"b{k}": {"type": "diffuse"} for k in range(nested.get(kind, 0))}}
            values |= {"k": 1.0} if key == "eta" and "conductor" in kind else {"eta": 1.0} if key == "k" else {}
            values |= {"alpha_v": 0.25} if key == "alpha_u" else {"alpha_u": 0.25} if key == "alpha_v" else {}
            values |= {"eta": 1.5} if key == "eta" and "principled" in kind else {}
            values |= {"eumelanin": 0.5, "pheomelanin": 0.25} if "melanin" in key else {}
            texture = {"normalmap": "normalmap", "bumpmap": "arbitrary"}.get(kind)
            values |= {texture: {"type": "checkerboard"}} if texture else {}
            mi.load_dict(values)


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
    for attempt in (lambda: read(folder, values), lambda: image_files(values, Reach(folder.resolve()))):
        with pytest.raises(InputError, match=f"{name} lies outside the scene's folder"):
            attempt()


def test_image_files_are_found_at_any_depth(tmp_path):
    (tmp_path / "maps").mkdir()
    image(tmp_path / "t.png")
    image(tmp_path / "maps" / "n.png")
    inner = {"type": "principled", "base_color": bitmap(), "roughness": bitmap()}
    values = {"type": "normalmap", "normalmap": bitmap("maps/n.png"), "bsdf": inner}
    assert image_files(values, Reach(tmp_path)) == (tmp_path / "maps" / "n.png", tmp_path / "t.png")


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
