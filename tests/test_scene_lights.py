"""What lights a scene: lights of USD stages, environments, defaults; and the scene's hash and bounds."""

import math
import shutil
import subprocess
import sys

import numpy as np
import pytest
from pxr import Sdf, UsdUtils

from framepairs.errors import InputError
from framepairs.scene import light_scene, load_scene, scene_hash
from framepairs.scene.description import default_environment, rotation_from_y_up, scene_bounds
from framepairs.scene.images import decode_image
from usd_stages import QUAD, image, load, placed, prim, usd

ROUNDING = 32 * np.finfo(np.float64).eps
SKY = "asset inputs:texture:file = @sky.png@"
SUN = prim("DistantLight", "sun")


@pytest.mark.parametrize(("normalize", "factor"), [(1, 1), (0, math.pi * math.sin(math.radians(15)) ** 2)])
def test_distant_light(tmp_path, normalize, factor):
    size = "float inputs:angle = 30", f"bool inputs:normalize = {normalize}", *placed("double xformOp:rotateX", -90)
    strength = "float inputs:intensity = 3", "float inputs:exposure = 1", "color3f inputs:color = (1, 0.5, 0.25)"
    light = load(tmp_path, prim("DistantLight", "sun", *size, *strength)).lights[0]
    # It shines along its -z, which the turn takes to -y. Without normalize it is a disk of radiance 6 and half angle 15.
    np.testing.assert_allclose(light.direction, (0, -1, 0), atol=ROUNDING)
    np.testing.assert_allclose(light.radiance, np.array([6, 3, 1.5]) * factor, rtol=2.0**-23)  # USD's numbers are floats
    assert (light.kind, light.name) == ("directional", "/sun")


@pytest.mark.parametrize(("normalize", "factor"), [(1, 1 / 4), (0, math.pi * 0.25)])
def test_sphere_light_shines_as_a_point_of_its_power(tmp_path, normalize, factor):
    lines = "float inputs:radius = 0.5", f"bool inputs:normalize = {normalize}", "float inputs:intensity = 8"
    place = placed("double3 xformOp:translate", "(1, 2, 3)")
    light = load(tmp_path, prim("SphereLight", "bulb", *lines, *place)).lights[0]
    assert (light.kind, light.position) == ("point", (1, 2, 3))
    np.testing.assert_allclose(light.radiance, [8 * factor] * 3, rtol=2.0**-23)


def test_dome_light_is_decoded_scaled_and_turned(tmp_path):
    pixels = image(tmp_path / "sky.png") / 255
    turned = placed("double xformOp:rotateY", 90)
    environment = load(tmp_path, prim("DomeLight", "sky", SKY, "float inputs:intensity = 2", *turned)).environment
    expected = 2 * np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    np.testing.assert_allclose(environment.texels, expected, rtol=2.0**-22)
    np.testing.assert_allclose(environment.world_from_environment @ [0, 0, 1], [1, 0, 0], atol=ROUNDING)


@pytest.mark.parametrize(
    ("kind", "pole", "up"),
    [("DomeLight_1", "scene", 2), ("DomeLight_1", "Y", 1), ("DomeLight_1", "Z", 2), ("DomeLight", None, 1)],
)
def test_the_pole_of_a_dome(tmp_path, kind, pole, up):
    # UsdLux: DomeLight's pole is +Y whatever the stage's up axis; DomeLight_1 follows poleAxis, by default the stage.
    axis = [f'uniform token poleAxis = "{pole}"'] if pole else []
    environment = load(tmp_path, prim(kind, "sky", *axis), header='upAxis = "Z"').environment
    np.testing.assert_allclose(environment.world_from_environment @ [0, 1, 0], np.eye(3)[up], atol=ROUNDING)


def test_a_missing_dome_texture_is_named(tmp_path):
    file = usd(tmp_path, prim("DomeLight", "sky", "asset inputs:texture:file = @nowhere.exr@"))
    with pytest.raises(InputError, match=f"^{file}, /sky: missing texture nowhere.exr"):
        load_scene(file)


def test_the_center_of_a_latitude_longitude_image_lies_along_plus_z():
    # OpenEXR's convention, which UsdLux adopts: u = 0.5 - atan2(x, z) / 2 pi. The default sky has its patch towards
    # (0.5, 0.707, 0.5): an eighth of a turn from +z towards +x is u = 0.375, and 45 degrees up is v = 0.25.
    texels = default_environment("Y").texels
    brightest = np.unravel_index(np.argmax(texels.sum(axis=-1)), texels.shape[:2])
    assert abs(brightest[0] + 0.5 - 0.25 * texels.shape[0]) <= 1
    assert abs(brightest[1] + 0.5 - 0.375 * texels.shape[1]) <= 1


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_the_default_environment_is_finite_and_stands_upright(axis):
    environment = default_environment(axis)
    assert np.isfinite(environment.texels).all() and environment.texels.min() > 0
    rotation = environment.world_from_environment
    np.testing.assert_array_equal(rotation @ [0, 1, 0], np.eye(3)["XYZ".index(axis)])
    assert np.linalg.det(rotation_from_y_up(axis)) == 1


def test_a_scene_without_light_gets_the_default(tmp_path):
    scene, lit_by = light_scene(load(tmp_path, prim("Mesh", "m", QUAD), header='upAxis = "Z"'), None)
    assert (lit_by, scene.environment.name) == ("default", "default")
    np.testing.assert_array_equal(scene.environment.world_from_environment, rotation_from_y_up("Z"))


def test_a_scene_with_lights_alone_gets_a_black_sky(tmp_path):
    scene, lit_by = light_scene(load(tmp_path, SUN), None)
    assert lit_by is None and len(scene.lights) == 1 and not scene.environment.texels.any()


def test_a_scene_with_a_sky_keeps_it(tmp_path):
    given = load(tmp_path, SUN, prim("DomeLight", "sky"))
    assert light_scene(given, None) == (given, None)


def test_an_environment_file_replaces_the_sky_and_counts_as_read(tmp_path):
    image(tmp_path / "other.png")
    given = load(tmp_path, prim("DomeLight", "sky"), header='upAxis = "Z"')
    scene, lit_by = light_scene(given, tmp_path / "other.png")
    assert lit_by == str(tmp_path / "other.png") and scene.environment.texels.shape == (5, 7, 3)
    np.testing.assert_array_equal(scene.environment.world_from_environment @ [0, 1, 0], [0, 0, 1])
    assert scene_hash(scene) != scene_hash(given)


@pytest.mark.parametrize("data", [None, b"", b"no image", b"\x76\x2f\x31\x01 cut off"], ids=["missing", "empty", "text", "exr"])
def test_an_environment_that_cannot_be_read_is_named(tmp_path, data):
    file = tmp_path / "sky.hdr"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: "):
        light_scene(load(tmp_path, prim("Mesh", "m", QUAD)), file)


RADIANCE = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 5 +X %d\n"


def test_radiance_files_are_read():
    # Flat RGBE: value = mantissa / 256 * 2^(exponent - 128). 7 pixels wide, so that no run-length coding is allowed.
    codes = np.random.default_rng(3).integers(1, 256, (5, 7, 4), dtype=np.uint8)
    codes[..., 3] = 126 + codes[..., 3] % 5
    texels = decode_image(RADIANCE % 7 + codes.tobytes(), "sky.hdr")
    expected = codes[..., :3] / 256 * 2.0 ** (codes[..., 3:].astype(int) - 128)
    np.testing.assert_allclose(texels, np.concatenate([expected, np.ones((5, 7, 1))], axis=-1), rtol=2.0**-23)


@pytest.mark.parametrize(
    "data",
    [b"#?RADIANCE\ncut off", RADIANCE % 7, RADIANCE % 7 + bytes(50), RADIANCE % 64 + b"\2\2\0\x40\x40", RADIANCE % -7],
    ids=["header", "no pixels", "few pixels", "runs", "negative width"],
)
def test_cut_radiance_files_are_bad_input(data):
    # In a child process: Mitsuba 3.9.1 answers such files with an endless loop or a damaged heap.
    program = "import sys; from framepairs.scene.images import decode_image; decode_image(bytes.fromhex(sys.argv[1]), 'a.hdr')"
    child = subprocess.run([sys.executable, "-c", program, data.hex()], capture_output=True, text=True, timeout=20)
    assert child.stderr.splitlines()[-1].startswith("framepairs.errors.InputError: a.hdr: ")


def test_the_hash_follows_contents_and_not_the_place(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    image(here / "sky.png")
    file = usd(here, prim("DomeLight", "sky", SKY), prim("Mesh", "m", QUAD))
    first = scene_hash(load_scene(file))
    shutil.copytree(here, there)
    assert scene_hash(load_scene(there / file.name)) == first
    image(there / "sky.png", seed=2)
    assert scene_hash(load_scene(there / file.name)) != first
    shutil.copy(here / "sky.png", there)
    (there / file.name).write_text(file.read_text() + "\n")
    assert scene_hash(load_scene(there / file.name)) != first


def test_the_hash_follows_referenced_layers(tmp_path):
    inner = usd(tmp_path, prim("Xform", "r", prim("Mesh", "m", QUAD)), header='defaultPrim = "r"', name="inner.usda")
    outer = usd(tmp_path, prim("Xform", "r", metadata="references = @inner.usda@"), header='defaultPrim = "r"')
    scene = load_scene(outer)
    assert scene.files == (outer, inner)
    first = scene_hash(scene)
    inner.write_text(inner.read_text() + "\n")
    assert scene_hash(scene) != first


def test_a_usdz_package_with_layers_inside_has_a_hash(tmp_path):
    usd(tmp_path, prim("Xform", "r", prim("Mesh", "m", QUAD)), header='defaultPrim = "r"', name="inner.usda")
    outer = usd(tmp_path, prim("Xform", "r", metadata="references = @inner.usda@"), header='defaultPrim = "r"')
    package = tmp_path / "package.usdz"
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(outer)), str(package))
    scene = load_scene(package)
    assert [item.name for item in scene.objects] == ["/r/m"]
    assert len(scene_hash(scene)) == 64


def test_bounds_are_those_of_the_turned_boxes_at_a_time(tmp_path):
    move = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (10, 0, 0) }"
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = load(tmp_path, prim("Mesh", "a", QUAD, move, order), prim("Mesh", "b", QUAD, *placed("double xformOp:rotateZ", 90)))
    # QUAD fills [0, 2] x [0, 1] with one more point, at (1, 3), that no face uses; turned by 90 degrees x becomes -y.
    low, high = scene_bounds(scene, 0.5)
    np.testing.assert_allclose(low, [-1, 0, 0], atol=ROUNDING)
    np.testing.assert_allclose(high, [7, 2, 0], atol=ROUNDING)


def test_an_empty_scene_has_bounds(tmp_path):
    low, high = scene_bounds(load(tmp_path))
    assert low.tolist() == high.tolist() == [0, 0, 0]


@pytest.mark.parametrize(("name", "says"), [("scene.abc", "unknown scene format '.abc'"), ("none.usda", "no such scene")])
def test_files_that_are_no_scenes_are_named(tmp_path, name, says):
    (tmp_path / "scene.abc").touch()
    with pytest.raises(InputError, match=f"^{tmp_path / name}: {says}"):
        load_scene(tmp_path / name)
