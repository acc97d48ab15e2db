"""MTL: which line becomes what, which file it names, and what is named because it is not drawn."""

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.images import linear_texels
from framepairs.scene.mtl_lines import map_of
from usd_stages import image

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"


def scene_of(folder, *lines, libraries="mtllib a.mtl\n", **keys):
    """A triangle that wears a material of these lines."""
    (folder / "a.mtl").write_text("\n".join(["newmtl m", *lines]))
    (folder / "a.obj").write_text(libraries + OBJ)
    return load_scene(folder / "a.obj", **keys)


def material_of(folder, *lines):
    return scene_of(folder, *lines).materials[0]


def gray(file, rows):
    Image.fromarray(np.uint8(rows)).save(file)


def texels(scene, slot):
    return linear_texels(scene.textures[slot.texture])


def test_constants(tmp_path):
    material = material_of(tmp_path, "Kd 0.25 0.5 1", "Ke 3 0 0.5", "Ka 1 1 1", "Ni 1.5", "Tf 1 1 1", "sharpness 60")
    assert (material.base_color, material.emission, material.opacity, material.alpha) == (
        (0.25, 0.5, 1),
        (3, 0, 0.5),
        1,
        "opaque",
    )
    assert (material.roughness, material.specular, material.metallic, material.not_read) == (0.5, 0.5, 0, ())
    assert material_of(tmp_path, "Kd 0.5").base_color == (0.5,) * 3


@pytest.mark.parametrize(
    ("lines", "opacity", "alpha"),
    [
        (["d 0.25"], 0.25, "blend"),
        (["Tr 0.25"], 0.75, "blend"),
        (["d 1", "Tr 1"], 1, "opaque"),
        (["d -halo 0.5"], 0.5, "blend"),
        (["d 2"], 1, "opaque"),
    ],
)
def test_opacity(tmp_path, lines, opacity, alpha):
    material = material_of(tmp_path, *lines)
    assert (material.opacity, material.alpha) == (opacity, alpha)


@pytest.mark.parametrize(
    ("lines", "specular", "roughness", "says"),
    [
        (["Ks 0.04 0.04 0.04", "Ns 0"], 0.5, 1.0, ()),
        (["Ks 0.02 0.02 0.02", "Ns 30"], 0.25, 0.5, ()),  # alpha = sqrt(2 / 32) = 1 / 4
        (["Ks 0.06 0.04 0.02", "Ns 510"], 0.5, 0.25, ("colour of Ks 0.06 0.04 0.02: its mean is used",)),
        (["Ks 0.5 0.5 0.5", "illum 2"], 1.0, 0.5, ("Ks 0.5 0.5 0.5: F0 is 0.08, not 0.5",)),
        (["Ks 0 0 0", "Ns 100"], 0.0, 1.0, ()),
        (["Ks 1 1 1", "Ns 100", "illum 1"], 0.0, 1.0, ()),
        (["illum 0"], 0.0, 1.0, ("illum 0: it is lit",)),
        (["Ks 0.04 0.04 0.04", "illum 7"], 0.5, 0.5, ("illum 7: refraction",)),
    ],
)
def test_the_specular_part(tmp_path, lines, specular, roughness, says):
    material = material_of(tmp_path, *lines)
    assert (material.specular, material.roughness) == pytest.approx((specular, roughness), abs=1e-12)
    assert material.not_read == says


def test_the_pbr_lines_replace_the_specular_part(tmp_path):
    material = material_of(tmp_path, "Pr 0.25", "Pm 1", "Ks 1 1 1", "Ns 500", "Pc 0.5", "Ps 0")
    assert (material.roughness, material.metallic, material.specular) == (0.25, 1, 0.5)
    assert material.not_read == ("Ks: Pr and Pm are drawn", "pc 0.5")


def test_maps_of_the_pbr_lines_are_packed(tmp_path):
    rough, metal = np.arange(35).reshape(5, 7), 255 - np.arange(35).reshape(5, 7)
    gray(tmp_path / "r.png", rough)
    gray(tmp_path / "m.png", metal)
    scene = scene_of(tmp_path, "Pr 0", "map_Pr r.png", "map_Pm m.png")
    material = scene.materials[0]
    assert (material.roughness, material.metallic) == (1, 1)
    found = texels(scene, material.surface_texture)
    np.testing.assert_allclose(found[..., 1:3] * 255, np.stack([rough, metal], axis=-1), atol=255 * 2.0**-23)
    assert (found[..., 0] == 1).all()


def test_colour_maps_multiply_and_black_constants_do_not(tmp_path):
    pixels = image(tmp_path / "t.png")
    scene = scene_of(tmp_path, "Kd 0.5 0.5 0.5", "map_Kd t.png", "Ke 0 0 0", "map_Ke t.png")
    material = scene.materials[0]
    assert (material.base_color, material.emission) == ((0.5,) * 3, (1, 1, 1))
    texture = scene.textures[material.base_texture.texture]
    assert texture.srgb and material.emission_texture == material.base_texture and len(scene.textures) == 1
    np.testing.assert_array_equal(texture.texels[..., :3], pixels)
    assert material_of(tmp_path, "Kd 0 0 0", "map_Kd t.png").base_color == (1, 1, 1)


@pytest.mark.parametrize(("middle", "alpha"), [(255, "mask"), (254, "blend")])
def test_map_d_masks_where_it_is_black_and_white(tmp_path, middle, alpha):
    image(tmp_path / "t.png", width=3, height=1)
    gray(tmp_path / "d.png", [[0, middle, 255]])
    scene = scene_of(tmp_path, "map_Kd t.png", "map_d d.png")
    assert scene.materials[0].alpha == alpha
    found = texels(scene, scene.materials[0].base_texture)
    np.testing.assert_allclose(found[0, :, 3] * 255, [0, middle, 255], atol=255 * 2.0**-23)
    alone = scene_of(tmp_path, "map_d d.png")
    np.testing.assert_array_equal(texels(alone, alone.materials[0].base_texture)[..., :3], 1)


def test_map_d_takes_the_opacity_of_an_image_that_has_some(tmp_path):
    pixels = image(tmp_path / "t.png", channels=4)
    scene = scene_of(tmp_path, "map_Kd t.png", "map_d t.png")
    found = texels(scene, scene.materials[0].base_texture)
    np.testing.assert_allclose(found[..., 3] * 255, pixels[..., 3], atol=255 * 2.0**-23)
    assert material_of(tmp_path, "map_Kd t.png").not_read == ("opacity of t.png: there is no map_d",)
    assert material_of(tmp_path, "map_d -imfchan m t.png").not_read == ("-imfchan m of t.png",)


@pytest.mark.parametrize("key", ["norm", "map_Kn"])
def test_normal_maps_and_bump_maps(tmp_path, key):
    pixels = image(tmp_path / "t.png")
    scene = scene_of(tmp_path, f"{key} -bm 0.5 t.png", "map_Bump t.png")
    material = scene.materials[0]
    np.testing.assert_allclose(texels(scene, material.normal_texture)[..., :3], 2 * (pixels / 255) - 1, atol=2.0**-22)
    assert (material.normal_scale, material.not_read) == (0.5, ("map_bump t.png",))


def test_options_of_a_map(tmp_path):
    image(tmp_path / "my t.png")
    scene = scene_of(tmp_path, "map_Kd -clamp on -s 2 3 1 -o 0.25 -blendu off my t.png")
    slot = scene.materials[0].base_texture
    texture = scene.textures[slot.texture]
    assert slot.uv == ((2, 0, 0.25), (0, 3, 0)) and texture.wrap == ("clamp", "clamp")
    for option in ("-t 0.5", "-cc on", "-mm 0.1 0.5"):
        assert material_of(tmp_path, f"map_Kd {option} my t.png").not_read == (f"{option} of my t.png",)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("t.png", "t.png"),
        ('"my t.png"', "my t.png"),
        ("maps\\wood\\t.png", "maps/wood/t.png"),
        ("-s 1 1 1 -bm 0.5 file.png", "file.png"),
        ("-s 1 123.png", "123.png"),
        ("-o 1 1 1 4.png", "4.png"),
        ("-imfchan r -clamp on a -b.png", "a -b.png"),
        ("-unknown t.png", "-unknown t.png"),
    ],
)
def test_names_behind_options(text, name):
    assert map_of(text).name == name


@pytest.mark.parametrize("library", ['"my lib.mtl"', "my lib.mtl", "sub\\b.mtl", "a.mtl b.mtl", 'a.mtl "my lib.mtl"'])
def test_libraries_of_several_names(tmp_path, library):
    (tmp_path / "sub").mkdir()
    for name in ("my lib.mtl", "sub/b.mtl", "b.mtl"):
        (tmp_path / name).write_text("newmtl m\nKd 0 0 1\n")
    (tmp_path / "a.mtl").write_text("newmtl other\n")
    (tmp_path / "a.obj").write_text(f"mtllib {library}\n" + OBJ)
    assert load_scene(tmp_path / "a.obj").materials[0].base_color == (0, 0, 1)


def test_maps_lie_beside_their_library(tmp_path):
    (tmp_path / "sub").mkdir()
    image(tmp_path / "sub" / "t.png")
    (tmp_path / "sub" / "b.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    (tmp_path / "a.obj").write_text("mtllib sub/b.mtl\n" + OBJ)
    assert {file.name for file in load_scene(tmp_path / "a.obj").files} == {"a.obj", "b.mtl", "t.png"}


@pytest.mark.parametrize("named", ["../secret.png", "{folder}/../secret.png", "link.png", "/dev/zero", "sub/../../secret.png"])
def test_maps_outside_the_folder_are_refused(tmp_path, named):
    folder = tmp_path / "scene"
    folder.mkdir()
    image(tmp_path / "secret.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match="a.mtl, m: .* (outside the scene's folder|is no plain file)"):
        scene_of(folder, f"map_Kd {named.format(folder=folder)}")


@pytest.mark.parametrize("named", ["../b.mtl", "'' ../b.mtl", "a.mtl ../b.mtl", "..\\b.mtl"])
def test_libraries_outside_the_folder_are_refused(tmp_path, named):
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "''").write_text("")
    (tmp_path / "b.mtl").write_text("newmtl m\nKd 1 0 0\n")
    with pytest.raises(InputError, match="outside the scene's folder"):
        scene_of(folder, libraries=f"mtllib {named}\n")
    assert scene_of(folder, libraries="mtllib ../b.mtl\n", allow_outside=True).materials[0].base_color == (1, 0, 0)


def test_an_image_of_ply_outside_the_folder_is_refused(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    image(tmp_path / "t.png")
    header = "ply\nformat ascii 1.0\ncomment TextureFile ../t.png\nelement vertex 3\n"
    header += "".join(f"property float {name}\n" for name in "xyzst") + "element face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    (folder / "a.ply").write_text(header + "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n")
    with pytest.raises(InputError, match="TextureFile: .* outside the scene's folder"):
        load_scene(folder / "a.ply")
    assert len(load_scene(folder / "a.ply", allow_outside=True).textures) == 1


@pytest.mark.parametrize(
    "line", ["Kd red", "Kd", "Kd nan 0 0", "Kd -1 0 0", "d", "Ns 1e999", "map_Kd -s 1", "map_Kd nowhere.png"]
)
def test_broken_lines_are_named(tmp_path, line):
    with pytest.raises(InputError, match=f"^{tmp_path}/a.mtl, m: "):
        scene_of(tmp_path, line)


def test_any_library_is_read_or_refused(tmp_path):
    image(tmp_path / "t.png")
    lines = [
        "Kd 1 0 0",
        "d 0.5",
        "map_Kd -s 1 1 1 t.png",
        "Ks 1 1 1",
        "Ns 10",
        "map_d t.png",
        "Pr 1",
        "illum 2",
        "norm t.png",
        "Tf 1 1 1",
    ]
    chance = np.random.default_rng(1)
    words = ["nan", "-1", "", "\\", "-s", '"', "1e40", "\0", "../x", "t.png", "xyz", "spectral"]
    for _ in range(300):
        chosen = [
            words[chance.integers(len(words))] if chance.random() < 0.2 else w for line in lines for w in [*line.split(), "\n"]
        ]
        try:
            scene_of(tmp_path, " ".join(chosen))
        except InputError as error:
            assert str(error).startswith(str(tmp_path))
