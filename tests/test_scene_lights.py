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
from framepairs.scene.default_sky import default_environment
from framepairs.scene.description import rotation_from_y_up, scene_bounds
from framepairs.scene.images import decode_image
from framepairs.scene.usd_light_meshes import TUBE_ERROR, tube
from usd_stages import BINDING, POINTS, QUAD, image, load, placed, prim, usd

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


def test_a_wide_distant_light_is_named_and_a_sun_is_not(tmp_path):
    wide, sun = (prim("DistantLight", name, f"float inputs:angle = {a}") for name, a in (("wide", 30), ("sun", 0.53)))
    said = load(tmp_path, wide, sun).not_read
    assert said == ("angle of distant light /wide, 30 degrees: its shadows are hard",)


PLACE = "double3 xformOp:translate = (1, 2, 3)", "double xformOp:rotateX = -90", "double3 xformOp:scale = (2, 3, 5)"
ORDER = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX", "xformOp:scale"]'
SINGLE = 2.0**-23  # USD's numbers are float32


def irradiance_on_axis(light, distance, count=200):
    """Irradiance on a patch that faces the light's centre from `distance` in front of it: the plain definition,
    the sum of L cos cos / r^2 over cells of the light, with an error of the order 1 / count^2."""
    place = np.array(light.position) + distance * np.array(light.direction)
    step = (np.arange(count) + 0.5) / count
    if light.kind == "rectangle":
        a, b = np.meshgrid(2 * step - 1, 2 * step - 1)
        area = 4 * np.linalg.norm(np.cross(light.half_u, light.half_v))
    else:
        radius, angle = np.meshgrid(np.sqrt(step), 2 * np.pi * step)
        a, b = radius * np.cos(angle), radius * np.sin(angle)
        area = np.pi * np.linalg.norm(np.cross(light.half_u, light.half_v))
    points = np.array(light.position) + a[..., None] * light.half_u + b[..., None] * light.half_v
    towards = place - points
    squared = (towards**2).sum(axis=-1)
    cosine = towards @ light.direction / np.sqrt(squared)
    return light.radiance[0] * (cosine**2 / squared).mean() * area


@pytest.mark.parametrize("normalize", [0, 1])
def test_rect_light(tmp_path, normalize):
    # 1.5 x 0.5 in its own space, 3 x 1.5 = 4.5 in the world: scaled by 2 in x and 3 in y. It shines along -z, that is -y.
    size = "float inputs:width = 1.5", "float inputs:height = 0.5", f"bool inputs:normalize = {normalize}"
    strength = "float inputs:intensity = 3", "float inputs:exposure = 1", "color3f inputs:color = (1, 0.5, 0.25)"
    scene = load(tmp_path, prim("RectLight", "panel", *size, *strength, *PLACE, ORDER))
    light = scene.lights[0]
    assert (light.name, light.kind, light.position, scene.not_read) == ("/panel", "rectangle", (1, 2, 3), ())
    np.testing.assert_allclose(light.half_u, (1.5, 0, 0), atol=ROUNDING)
    np.testing.assert_allclose(light.half_v, (0, 0, -0.75), atol=ROUNDING)
    np.testing.assert_allclose(light.direction, (0, -1, 0), atol=ROUNDING)
    expected = np.array([6, 3, 1.5]) / (4.5 if normalize else 1)
    np.testing.assert_allclose(light.radiance, expected, rtol=2 * SINGLE)
    # On the axis at h, a rectangle a x b gives (integrated by hand) with X = a / 2h and Y = b / 2h
    # E = 2 L (X / sqrt(1 + X^2) atan(Y / sqrt(1 + X^2)) + Y / sqrt(1 + Y^2) atan(X / sqrt(1 + Y^2))).
    x, y = 1.5 / 2, 0.75 / 2
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    exact = 2 * expected[0] * (x / p * math.atan(y / p) + y / q * math.atan(x / q))
    assert irradiance_on_axis(light, 2.0) == pytest.approx(exact, rel=1e-4)  # 200^2 midpoints: (1 / 200)^2 = 2.5e-5


@pytest.mark.parametrize("normalize", [0, 1])
def test_disk_light(tmp_path, normalize):
    lines = "float inputs:radius = 0.25", f"bool inputs:normalize = {normalize}", "float inputs:intensity = 8"
    scaled = placed("double3 xformOp:scale", "(4, 4, 9)")
    light = load(tmp_path, prim("DiskLight", "lamp", *lines, *scaled)).lights[0]
    expected = 8 / math.pi if normalize else 8  # its radius is 1 in the world
    np.testing.assert_allclose(light.radiance, [expected] * 3, rtol=2 * SINGLE)
    assert (light.kind, light.direction, light.position) == ("disk", (0, 0, -1), (0, 0, 0))
    np.testing.assert_allclose(np.abs(np.cross(light.half_u, light.half_v)), (0, 0, 1), rtol=2 * SINGLE)
    # On the axis at h, a disk of radius r gives E = pi L r^2 / (r^2 + h^2).
    exact = math.pi * expected / (1 + 4)
    assert irradiance_on_axis(light, 2.0) == pytest.approx(exact, rel=1e-4)


def test_a_sheared_disk_keeps_its_half_axes(tmp_path):
    # x -> x, y -> x + y: the image of the unit circle is an ellipse with half axes (1 + sqrt 5) / 2 and (sqrt 5 - 1) / 2.
    shear = placed("matrix4d xformOp:transform", "((1, 0, 0, 0), (1, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))")
    light = load(tmp_path, prim("DiskLight", "lamp", "float inputs:radius = 1", *shear)).lights[0]
    lengths = np.linalg.norm([light.half_u, light.half_v], axis=1)
    np.testing.assert_allclose(lengths, ((math.sqrt(5) + 1) / 2, (math.sqrt(5) - 1) / 2), rtol=ROUNDING)
    assert abs(np.dot(light.half_u, light.half_v)) < ROUNDING


def test_a_sheared_rectangle_keeps_its_area_and_is_named(tmp_path):
    shear = placed("matrix4d xformOp:transform", "((2, 0, 0, 0), (1, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))")
    scene = load(tmp_path, prim("RectLight", "panel", *shear))
    light = scene.lights[0]
    assert np.dot(light.half_u, light.half_v) == 0 and "shear of rect light /panel" in scene.not_read[0]
    assert 4 * np.linalg.norm(np.cross(light.half_u, light.half_v)) == pytest.approx(2, rel=ROUNDING)


@pytest.mark.parametrize("kind", ["RectLight", "DiskLight"])
def test_a_mirrored_light_shines_along_its_own_axis(tmp_path, kind):
    mirrored = placed("double3 xformOp:scale", "(-1, 1, 1)")
    assert load(tmp_path, prim(kind, "lamp", *mirrored)).lights[0].direction == (0, 0, -1)
    turned = placed("double3 xformOp:scale", "(1, 1, -1)")
    assert load(tmp_path, prim(kind, "lamp", *turned), name="turned.usda").lights[0].direction == (0, 0, 1)


@pytest.mark.parametrize("normalize", [0, 1])
def test_sphere_light(tmp_path, normalize):
    lines = "float inputs:radius = 0.5", f"bool inputs:normalize = {normalize}", "float inputs:intensity = 8"
    scaled = placed("double3 xformOp:scale", "(2, 2, 2)")
    scene = load(tmp_path, prim("SphereLight", "bulb", *lines, *scaled))
    light = scene.lights[0]
    assert (light.kind, light.position, scene.not_read) == ("sphere", (0, 0, 0), ()) and light.has_extent
    np.testing.assert_allclose(np.linalg.norm(light.half_u), 1, rtol=2 * SINGLE)
    np.testing.assert_allclose(light.radiance, [8 / (4 * math.pi) if normalize else 8] * 3, rtol=4 * SINGLE)


def test_a_sphere_of_unequal_scale_has_the_mean_radius_and_is_named(tmp_path):
    scaled = placed("double3 xformOp:scale", "(1, 2, 4)")
    scene = load(tmp_path, prim("SphereLight", "bulb", "float inputs:radius = 1", *scaled))
    assert np.linalg.norm(scene.lights[0].half_u) == pytest.approx(2, rel=SINGLE)  # (1 x 2 x 4)^(1/3)
    assert scene.not_read == ("unequal scale of sphere light /bulb: a sphere of its mean radius shines",)


POINT = "bool treatAsPoint = 1"


@pytest.mark.parametrize(
    ("lines", "intensity"),
    [
        ((POINT, "bool inputs:normalize = 1"), 8 / 4),
        ((POINT,), 8 * math.pi * 0.25),
        (("float inputs:radius = 0",), 8 / 4),
        (("float inputs:radius = 0", "bool inputs:normalize = 1"), 8 / 4),
    ],
)
def test_a_sphere_light_that_is_a_point_keeps_its_power(tmp_path, lines, intensity):
    scene = load(tmp_path, prim("SphereLight", "bulb", "float inputs:intensity = 8", *lines))
    assert (scene.lights[0].kind, scene.not_read) == ("point", ())
    np.testing.assert_allclose(scene.lights[0].radiance, [intensity] * 3, rtol=2 * SINGLE)


SHAPED = 'apiSchemas = ["ShapingAPI"]'


def test_a_cone_makes_a_spot(tmp_path):
    cone = "float inputs:shaping:cone:angle = 60", "float inputs:shaping:cone:softness = 0.25"
    turned = placed("double xformOp:rotateX", -90)
    spot = prim("SphereLight", "spot", POINT, "float inputs:intensity = 8", *cone, *turned, metadata=SHAPED)
    scene = load(tmp_path, spot)
    light = scene.lights[0]
    assert (light.kind, scene.not_read) == ("spot", ())
    np.testing.assert_allclose(light.direction, (0, -1, 0), atol=ROUNDING)
    # The light is whole up to (1 - 0.25) 60 = 45 degrees and gone at 60.
    np.testing.assert_allclose(light.cone, (math.sqrt(0.5), 0.5), rtol=2 * SINGLE)
    np.testing.assert_allclose(light.radiance, [8 * math.pi * 0.25] * 3, rtol=2 * SINGLE)


def test_a_cone_of_a_sphere_with_extent_is_kept_and_its_radius_named(tmp_path):
    cone = "float inputs:shaping:cone:angle = 30"
    scene = load(tmp_path, prim("SphereLight", "spot", cone, metadata=SHAPED))
    assert scene.lights[0].kind == "spot"
    assert scene.not_read == ("radius of sphere light /spot with a cone: it shines from a point",)


def test_a_cone_of_half_a_turn_cuts_nothing(tmp_path):
    scene = load(tmp_path, prim("SphereLight", "bulb", "float inputs:shaping:cone:angle = 180", metadata=SHAPED))
    assert (scene.lights[0].kind, scene.not_read) == ("sphere", ())


SHADOW = 'apiSchemas = ["ShadowAPI"]'


@pytest.mark.parametrize(
    ("kind", "lines", "metadata", "says"),
    [
        ("RectLight", ("asset inputs:texture:file = @any.png@",), "", "texture of /l: it shines evenly"),
        ("RectLight", ("float inputs:shaping:cone:angle = 45",), SHAPED, "cone of /l: it shines to its whole side"),
        ("DiskLight", ("float inputs:shaping:focus = 2",), SHAPED, "shaping:focus 2 of /l"),
        ("DiskLight", ("asset inputs:shaping:ies:file = @lamp.ies@",), SHAPED, "IES profile of /l"),
        ("RectLight", ("rel light:filters = </f>",), "", "light filters of /l"),
        ("DistantLight", ("bool inputs:shadow:enable = 0",), SHADOW, "shadow:enable = false of /l: it casts shadows"),
        ("DiskLight", ("float inputs:shadow:distance = 3",), SHADOW, "colour or distance of shadows of /l"),
        ("DomeLight", ("float inputs:specular = 0",), "", "specular multiplier 0 of /l"),
        ("DiskLight", ("float inputs:diffuse = 0.5",), "", "diffuse multiplier 0.5 of /l"),
        ("DomeLight", ('token inputs:texture:format = "angular"',), "", "texture format angular of /l: it is read as latlong"),
        ("DiskLight", ("rel collection:lightLink:excludes = </m>",), "", "light linking of /l: it concerns all objects"),
        ("DiskLight", ("uniform bool collection:shadowLink:includeRoot = 0",), "", "shadow linking of /l"),
        ("SphereLight", ("float intensity = 3",), "", "attributes without `inputs:`, as before USD 21.02, of /l"),
        ("RectLight", ("float inputs:width = 0",), "", "RectLight /l: it has no area"),
        ("CylinderLight", ("float inputs:radius = 0",), "", "CylinderLight /l: it has no area"),
        (
            "CylinderLight",
            ("float inputs:radius.timeSamples = { 0: 1, 9: 2 }",),
            "",
            "animation of inputs:radius of /l: it stays as it begins",
        ),
        ("CylinderLight", ("rel light:filters = </f>",), "", "light filters of /l"),
        ("PortalLight", (), "", "PortalLight /l"),
    ],
)
def test_what_a_light_does_not_do_is_named(tmp_path, kind, lines, metadata, says):
    (said,) = load(tmp_path, prim(kind, "l", *lines, metadata=metadata)).not_read
    assert said.startswith(says)


@pytest.mark.parametrize("api", [SHAPED, SHADOW])
@pytest.mark.parametrize("kind", ["RectLight", "DiskLight", "DistantLight", "DomeLight"])
def test_neutral_settings_are_not_named(tmp_path, kind, api):
    assert load(tmp_path, prim(kind, "l", metadata=api)).not_read == ()


RAMP = "float inputs:intensity.timeSamples = { 24: 3, 48: 9 }"  # 24 time codes per second are USD's default
SLIDE = "double3 xformOp:translate.timeSamples = { 0: (1, 0, 0), 24: (9, 0, 0) }"
TRANSLATED = 'uniform token[] xformOpOrder = ["xformOp:translate"]'


def test_an_intensity_ramp_is_followed_and_held_before_its_first_sample(tmp_path):
    still = prim("DiskLight", "still", "float inputs:intensity = 2")
    scene = load(tmp_path, still, prim("DiskLight", "ramp", RAMP, "float inputs:exposure.timeSamples = { 24: 0, 48: 1 }"))
    assert [light.radiance[0] for light in scene.lights] == [2, 3] and scene.not_read == ()
    assert [scene.lights_at(time_s)[1].radiance[0] for time_s in (0, 1, 2, 3)] == [3, 3, 18, 18]
    assert scene.lights_at(1.5)[1].radiance[0] == pytest.approx(6 * math.sqrt(2), rel=4 * SINGLE)  # 6 x 2^0.5
    assert scene.lights_at(2)[0] is scene.lights[0]


def test_a_light_moves_with_the_prim_above_it(tmp_path):
    scene = load(tmp_path, prim("Xform", "x", SLIDE, TRANSLATED, prim("DiskLight", "l")))
    assert scene.lights[0].position == (1, 0, 0) and scene.not_read == ()
    assert [scene.lights_at(time_s)[0].position for time_s in (0, 0.5, 1)] == [(1, 0, 0), (5, 0, 0), (9, 0, 0)]


def test_a_sun_turns_with_its_own_transform(tmp_path):
    turns = "double xformOp:rotateX.timeSamples = { 0: 0, 24: -90 }", 'uniform token[] xformOpOrder = ["xformOp:rotateX"]'
    scene = load(tmp_path, prim("DistantLight", "sun", *turns))
    np.testing.assert_allclose(scene.lights_at(0.5)[0].direction, (0, -math.sqrt(0.5), -math.sqrt(0.5)), atol=ROUNDING)


def test_the_stage_says_how_many_time_codes_a_second_has(tmp_path):
    scene = load(tmp_path, prim("DiskLight", "ramp", RAMP), header="timeCodesPerSecond = 12")
    assert scene.lights_at(3)[0].radiance[0] == pytest.approx(6, rel=SINGLE)


def test_extent_and_colour_of_a_light_change(tmp_path):
    lines = "float inputs:width.timeSamples = { 0: 2, 24: 6 }", "bool inputs:normalize = 1"
    tint = "color3f inputs:color.timeSamples = { 0: (1, 0, 0), 24: (0, 1, 0) }"
    light = load(tmp_path, prim("RectLight", "panel", *lines, tint)).lights_at(0.5)[0]
    np.testing.assert_allclose(light.half_u, (2, 0, 0), atol=ROUNDING)
    np.testing.assert_allclose(light.radiance, (0.125, 0.125, 0), rtol=2 * SINGLE)  # half of each, over an area of 4 x 1


def test_a_hidden_light_is_dark(tmp_path):
    hidden = 'token visibility.timeSamples = { 0: "invisible", 24: "inherited", 48: "invisible" }'
    scene = load(tmp_path, prim("Xform", "x", hidden, prim("SphereLight", "l", "float inputs:intensity = 2")))
    assert scene.lights[0].radiance == (0, 0, 0) and scene.not_read == ()
    assert [scene.lights_at(time_s)[0].radiance[0] for time_s in (0, 0.9, 1, 1.9, 2)] == [0, 0, 2, 2, 0]


def test_a_light_that_is_another_kind_at_times_is_dark_then_and_named(tmp_path):
    scene = load(tmp_path, prim("SphereLight", "l", "bool treatAsPoint.timeSamples = { 0: 0, 24: 1 }"))
    assert [light.kind for light in (*scene.lights, *scene.lights_at(1))] == ["sphere", "sphere"]
    assert scene.lights[0].radiance == (1, 1, 1) and scene.lights_at(1)[0].radiance == (0, 0, 0)
    assert scene.not_read == ("kind of /l, a point at times: it is dark then",)


def test_a_light_that_grows_from_nothing_is_there_and_dark(tmp_path):
    scene = load(tmp_path, prim("DiskLight", "l", "float inputs:radius.timeSamples = { 0: 0, 24: 2 }"))
    assert scene.lights[0].radiance == (0, 0, 0) and scene.lights_at(1)[0].radiance == (1, 1, 1)


def test_a_light_that_stops_being_finite_is_named(tmp_path):
    file = usd(tmp_path, prim("DiskLight", "l", "float inputs:intensity.timeSamples = { 0: 1, 24: nan }"))
    with pytest.raises(InputError, match=f"^{file}, /l: light with a number that is not finite"):
        load_scene(file)


@pytest.mark.parametrize(
    ("kind", "line", "metadata", "says"),
    [
        ("DomeLight", RAMP, "", "motion of /l: it shines as it begins"),
        ("DomeLight", SLIDE + "\n" + TRANSLATED, "", "motion of /l: it shines as it begins"),
        ("DistantLight", "float inputs:angle.timeSamples = { 0: 0.5, 9: 2, 24: 3 }", "",
         "angle of distant light /l, 2 degrees: its shadows are hard"),
        ("DomeLight", 'token visibility.timeSamples = { 0: "invisible", 9: "inherited" }', "",
         "changing visibility of light /l: it shines all the time"),
        ("DiskLight", "float inputs:diffuse.timeSamples = { 0: 1, 9: 0 }", "",
         "animation of inputs:diffuse of /l: it stays as it begins"),
        ("SphereLight", "bool treatAsPoint = 1\nfloat inputs:shaping:cone:angle.timeSamples = { 0: 40, 9: 80 }", SHAPED,
         "animation of inputs:shaping:cone:angle of /l: it stays as it begins"),
    ],
)  # fmt: skip
def test_what_of_a_light_does_not_change_is_named(tmp_path, kind, line, metadata, says):
    assert load(tmp_path, prim(kind, "l", line, metadata=metadata)).not_read == (says,)


def test_lights_that_stay_have_no_function_of_time(tmp_path):
    assert load(tmp_path, SUN, prim("DomeLight", "sky", RAMP)).lights_at is None


TUBE = "float inputs:radius = 0.25", "float inputs:length = 3", "float inputs:intensity = 8", "color3f inputs:color = (1, 2, 4)"


def shine_of(scene, time_s=None):
    """Emission of the one object, now or at a time."""
    materials = scene.materials if time_s is None else scene.materials_at(time_s)
    return materials[scene.objects[0].material].emission


@pytest.mark.parametrize("normalize", [0, 1])
def test_a_cylinder_light_is_a_shining_open_tube_along_x(tmp_path, normalize):
    scaled = placed("double3 xformOp:scale", "(2, 2, 2)")
    scene = load(tmp_path, prim("CylinderLight", "tube", *TUBE, f"bool inputs:normalize = {normalize}", *scaled))
    (item,), (mesh,) = scene.objects, scene.meshes
    material = scene.materials[item.material]
    assert (item.name, material.shines, material.emits, scene.lights, scene.not_read) == ("/tube", True, "front", (), ())
    assert (material.base_color, material.specular, material.metallic) == ((0, 0, 0), 0, 0)  # it reflects nothing
    area = 2 * math.pi * 0.5 * 6  # in the world: without the ends
    np.testing.assert_allclose(material.emission, np.array([8, 16, 32]) / (area if normalize else 1), rtol=1e-6)  # float32 r
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    np.testing.assert_array_equal([low[0], high[0]], [-1.5, 1.5])
    corners = mesh.positions[mesh.faces].astype(float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert np.linalg.norm(across, axis=1).sum() == pytest.approx(area / 4, rel=1e-6)  # float32 corners
    outwards = corners.mean(axis=1) * (0, 1, 1)
    assert (np.einsum("ij,ij->i", across, outwards) > 0).all()  # its front looks outwards
    radii = np.linalg.norm(mesh.positions[:, 1:], axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals, mesh.positions * (0, 1, 1) / radii, atol=4 * SINGLE)


def test_a_tube_is_as_wide_as_its_cylinder_from_every_side():
    mesh = tube("t", 0.5, 2.0)
    angle = np.radians(np.linspace(0, 90, 91))
    across = mesh.positions[:, 1:] @ np.stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(np.ptp(across, axis=0), 1, rtol=TUBE_ERROR)
    assert abs(np.ptp(across, axis=0) - 1).max() > TUBE_ERROR / 4  # the bound is not idle


def test_a_cylinder_light_moves_hides_and_ramps(tmp_path):
    hidden = 'token visibility.timeSamples = { 0: "inherited", 24: "invisible" }'
    scene = load(tmp_path, prim("Xform", "x", SLIDE, TRANSLATED, prim("CylinderLight", "l", RAMP, hidden)))
    assert scene.objects[0].moves and scene.world_from_object(0.5)[0, 0, 3] == 5
    assert [scene.visible(time_s)[0] for time_s in (0, 1)] == [True, False]
    assert [shine_of(scene, time_s)[0] for time_s in (0, 1, 1.5, 2)] == [3, 3, 6, 9]


def test_a_normalized_cylinder_that_grows_keeps_its_power(tmp_path):
    grows = "double3 xformOp:scale.timeSamples = { 0: (1, 1, 1), 24: (3, 3, 3) }", "bool inputs:normalize = 1"
    scene = load(tmp_path, prim("CylinderLight", "l", *grows, 'uniform token[] xformOpOrder = ["xformOp:scale"]'))
    assert shine_of(scene, 0)[0] / shine_of(scene, 1)[0] == pytest.approx(9, rel=1e-9)


MESH_LIGHT = 'apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"]'
FLAT = QUAD, 'uniform token subdivisionScheme = "none"', "float inputs:intensity = 6", "color3f inputs:color = (1, 0.5, 0)"
GLOW = "color3f inputs:emissiveColor = (2, 2, 2)"


def glowing(*lines):
    """A material M with a preview surface of `lines`, and how a mesh is bound to it."""
    surface = prim("Shader", "S", 'uniform token info:id = "UsdPreviewSurface"', *lines, "token outputs:surface")
    return prim(
        "Material", "M", "token outputs:surface.connect = </M/S.outputs:surface>", surface
    ), "rel material:binding = </M>"


@pytest.mark.parametrize(
    ("mode", "lines", "emission", "says"),
    [
        ("materialGlowTintsLight", (GLOW,), (12, 6, 0), ("glow of light /m for the camera: it is tinted as its light is",)),
        ("materialGlowTintsLight", (), (6, 3, 0), ()),
        ("independent", (GLOW,), (6, 3, 0), ()),
        ("noMaterialResponse", (GLOW,), (6, 3, 0), ()),
    ],
)
def test_a_mesh_light_shines_as_its_material_lets_it(tmp_path, mode, lines, emission, says):
    material, binding = glowing(*lines, "float inputs:roughness = 0.25")
    sync = f'uniform token light:materialSyncMode = "{mode}"'
    scene = load(tmp_path, material, prim("Mesh", "m", *FLAT, sync, binding, metadata=MESH_LIGHT))
    found = scene.materials[scene.objects[0].material]
    assert (found.emission, found.shines, found.emits, scene.not_read) == (emission, True, "front", says)
    assert (found.roughness, found.base_color == (0, 0, 0)) == ((0.5, True) if mode == "noMaterialResponse" else (0.25, False))
    assert not any(item.shines for item in scene.materials if item is not found)


def test_a_mesh_light_without_material_shines_to_both_sides_where_it_is_double_sided(tmp_path):
    scene = load(tmp_path, prim("Mesh", "m", *FLAT, "bool doubleSided = 1", metadata='apiSchemas = ["MeshLightAPI"]'))
    assert shine_of(scene) == (6, 3, 0) and scene.materials[scene.objects[0].material].emits == "both"


def test_a_mesh_light_is_normalized_by_its_area_in_the_world(tmp_path):
    lines = (*FLAT, "bool inputs:normalize = 1", *placed("double3 xformOp:scale", "(3, 1, 1)"))
    scene = load(tmp_path, prim("Mesh", "m", *lines, metadata=MESH_LIGHT))
    assert shine_of(scene) == (1, 0.5, 0)  # 2 x 1 in its own space, 6 in the world


def test_subsets_of_a_mesh_light_share_its_power_and_keep_their_materials(tmp_path):
    two = "int[] faceVertexCounts = [3, 3]", "int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]", POINTS
    face = 'uniform token elementType = "face"', 'uniform token familyName = "materialBind"', "int[] indices = [1]"
    part = prim("GeomSubset", "part", *face, "rel material:binding = </M>", metadata=BINDING)
    material, _ = glowing(GLOW)
    lines = 'uniform token subdivisionScheme = "none"', "float inputs:intensity = 6", "bool inputs:normalize = 1"
    scene = load(tmp_path, material, prim("Mesh", "m", *two, *lines, part, metadata=MESH_LIGHT))
    emissions = sorted(scene.materials[item.material].emission[0] for item in scene.objects)
    assert emissions == [3, 6]  # 6 over an area of 2, and twice that where the material glows with 2


def test_a_mesh_light_ramps_with_the_glow_of_its_material(tmp_path):
    material, binding = glowing("color3f inputs:emissiveColor.timeSamples = { 0: (0, 0, 0), 48: (2, 2, 2) }")
    scene = load(tmp_path, material, prim("Mesh", "m", QUAD, FLAT[1], RAMP, binding, metadata=MESH_LIGHT))
    assert [shine_of(scene, time_s)[0] for time_s in (0, 1, 2)] == [0, 3, 18]


def test_mesh_lights_in_prototypes_shine_and_are_named_where_normalized(tmp_path):
    lamp = prim("Mesh", "lamp", *FLAT, "bool inputs:normalize = 1", metadata=MESH_LIGHT)
    lines = "point3f[] positions = [(0, 0, 0), (9, 0, 0)]", "int[] protoIndices = [0, 0]", "rel prototypes = </p/lamp>", lamp
    scene = load(tmp_path, prim("PointInstancer", "p", *lines))
    assert [scene.materials[item.material].emission for item in scene.objects] == [(3, 1.5, 0)] * 2
    assert scene.not_read == ("normalize of light /p/lamp: by its area in its prototype",)


@pytest.mark.parametrize("kind", ["Mesh", "CylinderLight"])
def test_drawn_lights_that_are_not_finite_are_named(tmp_path, kind):
    file = usd(tmp_path, prim(kind, "l", *(FLAT[:2] if kind == "Mesh" else ()), "float inputs:intensity = inf",
                              metadata=MESH_LIGHT if kind == "Mesh" else ""))  # fmt: skip
    with pytest.raises(InputError, match=f"^{file}, /l: light with a number that is not finite"):
        load_scene(file)


def test_a_dome_texture_outside_the_folder_is_not_opened(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "sky.png").write_text("never read")
    file = usd(inner, prim("DomeLight", "sky", "asset inputs:texture:file = @../sky.png@"))
    with pytest.raises(InputError, match=r"^.*, /sky: .*sky.png lies outside the scene's folder \(--allow-outside reads it\)$"):
        load_scene(file)
    image(tmp_path / "sky.png")
    assert load_scene(file, allow_outside=True).environment.texels.shape == (5, 7, 3)


@pytest.mark.parametrize("line", ["float inputs:intensity = nan", "float inputs:exposure = inf"])
@pytest.mark.parametrize("kind", ["DistantLight", "SphereLight", "DiskLight"])
def test_lights_that_are_not_finite_are_named(tmp_path, kind, line):
    file = usd(tmp_path, prim(kind, "l", line))
    with pytest.raises(InputError, match=f"^{file}, /l: light with a number that is not finite"):
        load_scene(file)


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
