"""Content variation: what a seed decides, that names stay, and what each kind of rule does to a scene."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from analytic import at, make_scene, quad
from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.daylight import luminance
from framepairs.scene.description import Deformed, Environment, Light, Material, Slot, Texture, scene_bounds
from framepairs.scene.images import linear_texels
from framepairs.scene.variation import default_variation, varied_scene, vary
from framepairs.scene.variation_draws import Draws, groups
from framepairs.scene.variation_file import Variation, read_variation, variation_beside
from framepairs.scene.variation_light import black_body_tint
from framepairs.scene.variation_materials import LAB_FROM_CUBE_ROOTS, LMS_FROM_RGB, Turn

SINGLE = float(np.finfo(np.float32).eps)
NAMES = ("/S/Pot0/pot", "/S/Pot0/leaf", "/S/Pot1/pot", "/S/Pot1/leaf", "/S/Wall", "/S/Door")
STRIPES = Texture(name="stripes", texels=np.zeros((2, 4, 4), np.uint8), srgb=True, scale=(0.9, 0.9, 0.9, 1))
STRIPES.texels[:] = [[200, 30, 40, 255], [250, 250, 250, 128], [200, 30, 40, 0], [250, 250, 250, 9]]
SUN = Light(name="/S/Sun", kind="directional", radiance=(4.0, 3.0, 2.0), direction=(0.6, -0.8, 0.0))
LAMP = Light(name="/S/Lamp", kind="point", radiance=(1.0, 1.0, 1.0))


def swing(time_s: float) -> np.ndarray:
    """About the z axis through (3, 2, 0), 40 degrees in a second."""
    c, s = math.cos(math.radians(40 * time_s)), math.sin(math.radians(40 * time_s))
    return at(3, 2, 0) @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) @ at(-0.5, -1, 0)


@pytest.fixture
def scene():
    places = (at(1, 0.5, 2), at(1, 1.5, 2), at(-1, 0.5, 2), at(-1, 1.5, 2), at(0, 0, -5), swing)
    materials = [Material(name=f"/S/Materials/m{k}", base_color=(0.4, 0.2, 0.1)) for k in range(6)]
    materials[3] = replace(materials[3], emission=(2.0, 1.0, 0.5))
    materials[4] = replace(materials[4], base_color=(1.0, 1.0, 1.0), base_texture=Slot(texture=0))
    made = make_scene(
        *((quad(1, 1), material, place) for material, place in zip(materials, places, strict=True)),
        lights=(SUN, LAMP),
        textures=(STRIPES,),
    )
    objects = tuple(replace(item, name=name) for item, name in zip(made.objects, NAMES, strict=True))
    return replace(made, objects=objects, animation_end_s=2.0)


def varied(scene, seed=0, **keys):
    return vary(scene, Variation.model_validate({"version": 1, **keys}), seed)


def test_a_number_is_decided_by_seed_kind_rule_name_and_key_alone():
    base = Draws(7, "palettes", 1).number("red", "hue_deg")
    assert Draws(7, "palettes", 1).number("red", "hue_deg") == base == 0.24489106010876982  # on every machine
    others = [
        Draws(8, "palettes", 1).number("red", "hue_deg"), Draws(7, "emission", 1).number("red", "hue_deg"),
        Draws(7, "palettes", 2).number("red", "hue_deg"), Draws(7, "palettes", 1).number("blue", "hue_deg"),
        Draws(7, "palettes", 1).number("red", "value"),
    ]  # fmt: skip
    assert len({base, *others}) == 6
    many = np.array([Draws(k, "absent").number("", "share") for k in range(2000)])
    assert 0 <= many.min() and many.max() < 1
    assert abs(many.mean() - 0.5) < 5 * math.sqrt(1 / 12 / 2000)  # five standard errors


def test_adding_a_rule_changes_no_other(scene):
    rule = {"objects": ["/S/Pot*"], "shift": [1, 0, 1], "turn_deg": 90}
    one = varied(scene, 3, placement=[rule])
    two = varied(scene, 3, placement=[rule, {"objects": ["/S/Wall"], "shift": [2, 0, 0]}], lights=[{"lights": ["*"]}])
    assert np.array_equal(one.world_from_object(0.0)[:4], two.world_from_object(0.0)[:4])
    assert not np.array_equal(one.world_from_object(0.0)[4], two.world_from_object(0.0)[4])


def test_a_group_is_what_names_begin_with():
    assert groups(["/S/Pot*"], NAMES, None, "") == {"/S/Pot0": [0, 1], "/S/Pot1": [2, 3]}
    assert groups(["/S/Pot*/leaf"], NAMES, None, "") == {"/S/Pot0/leaf": [1], "/S/Pot1/leaf": [3]}
    assert groups(["/S"], NAMES, None, "") == {"/S": [0, 1, 2, 3, 4, 5]}
    assert groups(["/S/pot1", "/S/Wall"], (*NAMES, "/S/pot1"), None, "") == {"/S/pot1": [6], "/S/Wall": [4]}


@pytest.mark.parametrize(
    ("keys", "field"),
    [
        ({"daylight": {"sun": "*Moon"}}, "daylight.sun"),
        ({"daylight": {"sun": "*Lamp"}}, "daylight.sun"),
        ({"lights": [{"lights": ["*Moon"]}]}, "lights.0.lights"),
        ({"palettes": [{"materials": ["*"]}, {"materials": ["*m1", "x"]}]}, "palettes.1.materials"),
        ({"emission": [{"materials": ["x*"]}]}, "emission.0.materials"),
        ({"placement": [{"objects": ["/s/Pot*"]}]}, "placement.0.objects"),
        ({"absent": [{"objects": ["/S/Pot*/pot/x"], "share": [0, 1]}]}, "absent.0.objects"),
        ({"animation": [{"objects": ["x"]}]}, "animation.0.objects"),
        ({"animation": [{"objects": ["/S/Wall"]}]}, "animation.0.objects"),  # does not move
    ],
)
def test_what_matches_nothing_is_an_error_that_names_file_and_field(scene, keys, field):
    with pytest.raises(InputError) as error:
        vary(scene, Variation.model_validate({"version": 1, **keys}), 0, file=Path("a.variation.json"))
    assert (error.value.file, error.value.field) == (Path("a.variation.json"), field)


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ({"wind": 1}, "wind"),
        ({"lights": [{"lights": ["*"], "gain": [2, 1]}]}, "lights.0.gain"),
        ({"lights": [{"lights": []}]}, "lights.0.lights"),
        ({"absent": [{"objects": ["*"], "share": [0, 1.5]}]}, "absent.0.share.1"),
        ({"daylight": {"elevation_deg": [-20, 10]}}, "daylight.elevation_deg.0"),
        ({"palettes": [{"materials": ["*"], "base_color": [[1, 1]]}]}, "palettes.0.base_color.0.2"),
        ({"daylight": {}, "environment": {}}, None),
        ({"version": 2}, "version"),
    ],
)
def test_a_file_that_breaks_the_schema_is_one_error(tmp_path, keys, where):
    file = tmp_path / "a.variation.json"
    file.write_text(json.dumps({"version": 1, **keys}))
    with pytest.raises(InputError) as error:
        read_variation(file)
    assert (error.value.file, error.value.field) == (file, where)


def test_groups_move_turn_and_grow_on_their_feet(scene):
    rule = {"objects": ["/S/Pot*"], "shift": [0.5, 0, 0.25], "turn_deg": 180, "scale": [0.5, 2]}
    moved = varied(scene, 5, placement=[rule])
    old, new = scene.world_from_object(1.5), moved.world_from_object(1.5)
    assert np.array_equal(old[4:], new[4:])
    for first, second in ((0, 1), (2, 3)):
        change = new[first] @ np.linalg.inv(old[first])
        np.testing.assert_allclose(change @ old[second], new[second], atol=1e-14)  # as one
        feet = np.array([old[first][0, 3], 0.0, 2.0, 1.0])  # the pot's lower edge lies at height 0
        shift = (change @ feet - feet)[:3]
        assert abs(shift[0]) <= 0.5 and abs(shift[1]) < 1e-14 and abs(shift[2]) <= 0.25 and shift[0] != 0
        size = np.cbrt(np.linalg.det(change[:3, :3]))
        assert 0.5 <= size <= 2 and abs(size - 1) > 0.01
        np.testing.assert_allclose(change[:3, 1], [0, size, 0], atol=1e-14)  # up stays up
    assert not np.allclose((new[0] @ np.linalg.inv(old[0]))[:3, :3], (new[2] @ np.linalg.inv(old[2]))[:3, :3])


def test_what_is_absent_keeps_its_place_and_has_no_triangles(scene):
    rule = {"objects": ["/S/Pot*", "/S/Door"], "share": [0.5, 0.5]}
    seen = set()
    for seed in range(12):
        gone = varied(scene, seed, absent=[rule])
        assert [item.name for item in gone.objects] == list(NAMES)
        assert [item.material for item in gone.objects] == [item.material for item in scene.objects]
        faces = [len(gone.meshes[item.mesh].faces) for item in gone.objects]
        assert faces[0] == faces[1] and faces[2] == faces[3] and faces[4] == 2
        if not faces[5]:  # an absent object stands still, in data as in its flag
            assert not gone.moves and np.array_equal(gone.world_from_object(0.0), gone.world_from_object(1.0))
        seen.add(tuple(faces))
    assert len(seen) > 3
    everything = varied(scene, 0, absent=[{"objects": ["/S"], "share": [1, 1]}])
    assert sum(len(mesh.faces) for mesh in everything.meshes) == 0
    assert np.array_equal(scene_bounds(everything), np.zeros((2, 3)))
    assert varied(scene, 0, absent=[{"objects": ["/S"], "share": [0, 0]}]) == scene


def test_a_plain_material_takes_a_colour_of_the_palette(scene):
    palette = [[0.1, 0.2, 0.3], [0.6, 0.5, 0.4]]
    rule = {"materials": ["*m0", "*m1", "*m2"], "base_color": palette, "roughness": [0.5, 3]}
    found = {varied(scene, seed, palettes=[rule]).materials[0].base_color for seed in range(12)}
    assert found == {tuple(color) for color in palette}
    painted = varied(scene, 1, palettes=[rule]).materials
    assert all(0.25 <= material.roughness <= 1 for material in painted[:3]) and painted[3:] == scene.materials[3:]


def oklab(rgb):
    return np.cbrt(np.asarray(rgb) @ LMS_FROM_RGB.T) @ LAB_FROM_CUBE_ROOTS.T


def test_hue_turns_at_constant_lightness_and_chroma():
    color = np.array([0.4, 0.3, 0.25])
    old, new = oklab(color), oklab(Turn(70.0, 1.0)(color))
    np.testing.assert_allclose(new[0], old[0], rtol=1e-12)
    angle = math.degrees(math.atan2(new[2], new[1]) - math.atan2(old[2], old[1]))
    assert angle % 360 == pytest.approx(70, abs=1e-9)
    assert np.linalg.norm(oklab(Turn(0.0, 0.5)(color))[1:]) == pytest.approx(0.5 * np.linalg.norm(old[1:]), rel=1e-9)
    # Grey is on Oklab's axis as far as its matrices are rounded: 1e-7 of the chroma's scale, cubed up to 1e-6 of the colour.
    np.testing.assert_allclose(Turn(123.0, 2.0)(np.full(3, 0.5)), 0.5, atol=1e-5)


def test_a_texture_turns_its_texels_and_keeps_its_opacity(scene):
    painted = varied(scene, 0, palettes=[{"materials": ["*m4"], "hue_deg": [120, 120]}])
    material = painted.materials[4]
    texture = painted.textures[material.base_texture.texture]
    expected = Turn(120.0, 1.0)(linear_texels(STRIPES)[..., :3])
    decoded = linear_texels(texture)
    half_a_code = 0.5 * 2.4 / 1.055 / 255  # where the sRGB curve is steepest, at white
    np.testing.assert_allclose(decoded[..., :3], expected, atol=half_a_code * max(1, expected.max()))
    assert np.array_equal(texture.texels[..., 3], STRIPES.texels[..., 3]) and texture.texels.dtype == np.uint8
    assert decoded[0, 0, 0] < decoded[0, 0, 1]  # red has become green
    assert painted.textures[0].texels.shape == (1, 1, 4)  # nothing reads it any longer
    assert material.base_color == (1, 1, 1)


def test_a_textured_material_is_tinted_and_never_reflects_more_than_it_gets(scene):
    tinted = varied(scene, 0, palettes=[{"materials": ["*m4"], "base_color": [[0.5, 0.6, 0.7]]}])
    assert tinted.materials[4].base_color == pytest.approx((0.5, 0.6, 0.7)) and tinted.textures == scene.textures
    bright = varied(scene, 0, palettes=[{"materials": ["*m4", "*m0"], "value": [5, 5]}])
    peak = linear_texels(STRIPES)[..., :3].max() * max(bright.materials[4].base_color)
    assert peak == pytest.approx(1, rel=4 * SINGLE)
    assert bright.materials[0].base_color == pytest.approx((1, 0.5, 0.25))


def test_materials_that_change_over_time_are_varied_at_every_time(scene):
    changing = replace(
        scene,
        materials_at=lambda t: tuple(replace(m, base_color=(0.1 + 0.1 * t, 0.1, 0.1)) for m in scene.materials),
    )
    painted = varied(changing, 0, palettes=[{"materials": ["*m0", "*m4"], "value": [2, 2]}])
    assert painted.materials_at(1.0)[0].base_color == pytest.approx((0.4, 0.2, 0.2))
    assert painted.materials_at(1.0)[1].base_color == pytest.approx((0.2, 0.1, 0.1))


def test_a_kept_bsdf_is_left_alone_and_named(scene):
    materials = (replace(scene.materials[0], bsdf={"type": "plastic"}), *scene.materials[1:])
    painted = varied(replace(scene, materials=materials), 0, palettes=[{"materials": ["*"], "value": [0.5, 0.5]}])
    assert painted.materials[0] == materials[0] and painted.materials[1].base_color == pytest.approx((0.2, 0.1, 0.05))
    assert painted.not_read == ("variation of /S/Materials/m0, which Mitsuba's own BSDF draws",)


def test_what_glows_may_be_brighter_other_or_dark(scene):
    rule = {"materials": ["*m3"], "color": [[3, 2, 1]], "gain": [2, 2]}
    assert varied(scene, 0, emission=[rule]).materials[3].emission == pytest.approx((6, 4, 2))
    lit = [any(varied(scene, seed, emission=[rule | {"dark": 0.5}]).materials[3].emission) for seed in range(20)]
    assert 3 < sum(lit) < 17


def test_lamps_have_temperature_gain_and_may_be_dark(scene):
    rule = {"lights": ["*Lamp"], "temperature_k": [2500, 2500]}
    warm = varied(scene, 0, lights=[rule]).lights
    assert warm[0] == SUN and luminance(np.array(warm[1].radiance)) == pytest.approx(luminance(np.ones(3)), rel=1e-12)
    assert warm[1].radiance[0] > 1 > warm[1].radiance[2]
    np.testing.assert_allclose(black_body_tint(6500.0), 1, atol=1e-12)
    moving = replace(scene, lights_at=lambda t: (SUN, replace(LAMP, position=(t, 0, 0))))
    louder = varied(moving, 0, lights=[{"lights": ["*Lamp"], "gain": [3, 3]}]).lights_at(2.0)
    assert louder == (SUN, replace(LAMP, position=(2.0, 0, 0), radiance=(3, 3, 3)))
    dark = [any(varied(scene, seed, lights=[rule | {"dark": 0.5}]).lights[1].radiance) for seed in range(20)]
    assert 3 < sum(dark) < 17


@pytest.mark.parametrize("up", ["Y", "Z", "X"])
def test_daylight_gives_sky_and_sun_from_one_place(scene, up):
    scene = replace(scene, up_axis=up)
    keys = {"sun": "*Sun", "azimuth_deg": [40, 40], "elevation_deg": [30, 30], "clouds": [0, 0]}
    lit = varied(scene, 1, daylight=keys)
    to_sun = -np.array(lit.lights[0].direction)
    assert np.degrees(np.arcsin(to_sun @ scene.up)) == pytest.approx(30, abs=1e-9)
    assert lit.lights[1] == LAMP and lit.environment.texels.shape == (256, 512, 3)
    row, column = np.unravel_index(lit.environment.texels.sum(axis=2).argmax(), (256, 512))
    polar, azimuth = math.pi * (row + 0.5) / 256, 2 * math.pi * (0.5 - (column + 0.5) / 512)
    local = [math.sin(polar) * math.sin(azimuth), math.cos(polar), math.sin(polar) * math.cos(azimuth)]
    brightest = lit.environment.world_from_environment @ local
    assert brightest @ to_sun > math.cos(math.radians(12))  # the horizon below the sun is nearly as bright as the sky at it
    added = varied(scene, 1, daylight={k: v for k, v in keys.items() if k != "sun"})
    assert added.lights[:2] == scene.lights and added.lights[2] == replace(lit.lights[0], name="daylight")


def test_a_sun_that_moves_goes_on_from_its_new_place(scene):
    """It turns by 90 degrees about x and becomes half as bright, before and after."""

    def lights_at(time_s):
        angle = np.radians(90 * time_s)
        sun = scene.lights[0]
        turned = (0.0, -np.cos(angle), -np.sin(angle))
        return (replace(sun, direction=turned, radiance=tuple((1 - time_s / 2) * np.array(sun.radiance))), *scene.lights[1:])

    moving = replace(scene, lights=lights_at(0.0), lights_at=lights_at)
    lit = varied(moving, 1, daylight={"sun": "*Sun", "elevation_deg": [30, 30]})
    first, last = lit.lights_at(0.0)[0], lit.lights_at(1.0)[0]
    np.testing.assert_allclose(first.direction, lit.lights[0].direction, atol=1e-12)
    about_x = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # takes (0, -1, 0) to (0, 0, -1)
    np.testing.assert_allclose(last.direction, about_x @ np.array(first.direction), atol=1e-12)
    np.testing.assert_allclose(last.radiance, np.array(first.radiance) / 2, rtol=1e-12)


def test_adaptation_gives_back_what_a_low_sun_takes(scene):
    dim, adapted = (
        varied(scene, 1, daylight={"sun": "*Sun", "elevation_deg": [6, 6], "clouds": [0, 0], "adaptation": share})
        for share in (0, 1)
    )
    gain = adapted.lights[0].radiance[0] / dim.lights[0].radiance[0]
    assert gain > 3
    ratio = adapted.environment.texels.mean() / dim.environment.texels.mean()
    assert ratio == pytest.approx(gain, rel=1e-4)  # means of float32


def test_a_sky_turns_with_its_suns(scene):
    texels = np.random.default_rng(1).uniform(size=(4, 8, 3)).astype(np.float32)
    sky = replace(scene, environment=Environment(name="sky", texels=texels))
    turned = varied(sky, 0, environment={"turn_deg": [90, 90], "gain": [2, 2]})
    np.testing.assert_allclose(turned.environment.texels, 2 * texels, rtol=2 * SINGLE)
    np.testing.assert_allclose(turned.environment.world_from_environment @ [1, 0, 0], [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(turned.lights[0].direction, [0, -0.8, -0.6], atol=1e-15)
    assert turned.lights[1] == LAMP
    tinted = varied(sky, 0, environment={"temperature_k": [3000, 3000]}).environment.texels
    np.testing.assert_allclose(luminance(tinted).sum() / luminance(texels).sum(), 1, atol=0.1)
    assert (tinted[..., 0] > texels[..., 0]).all() and (tinted[..., 2] < texels[..., 2]).all()


def test_groups_have_their_own_clocks(scene):
    door = lambda t: scene.world_from_object(t)[5]  # noqa: E731
    slow = varied(scene, 0, animation=[{"objects": ["/S/Door"], "rate": [0.5, 0.5], "delay_s": [0.2, 0.2]}])
    for time, own in ((0.0, 0.0), (0.2, 0.0), (1.0, 0.4)):
        np.testing.assert_allclose(slow.world_from_object(time)[5], door(own), atol=1e-14)
        assert np.array_equal(slow.world_from_object(time)[:5], scene.world_from_object(time)[:5])
    cyclic = varied(scene, 0, animation=[{"objects": ["/S/Door"], "delay_s": [0.5, 0.5], "cycle_s": 2}])
    np.testing.assert_allclose(cyclic.world_from_object(0.0)[5], door(1.5), atol=1e-14)
    np.testing.assert_allclose(cyclic.world_from_object(3.0)[5], door(0.5), atol=1e-14)
    still = varied(scene, 0, animation=[{"objects": ["/S/Door"], "rate": [0, 0]}])
    assert not still.moves and np.array_equal(still.world_from_object(0.0), still.world_from_object(1.7))


def test_amplitude_scales_the_angle_about_the_hinge(scene):
    wide = varied(scene, 0, animation=[{"objects": ["/S/Door"], "amplitude": [1.5, 1.5]}])
    for time in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(wide.world_from_object(time)[5], swing(1.5 * time), atol=1e-12)


def test_amplitude_scales_a_shift_and_refuses_a_spin(scene):
    def slide(world):
        return replace(scene, world_from_object=lambda t: np.array([*scene.world_from_object(t)[:5], world(t)]))

    half = {"animation": [{"objects": ["/S/Door"], "amplitude": [0.5, 0.5]}]}
    flying = varied(slide(lambda t: at(2 * t, 1, 0)), 0, **half)
    np.testing.assert_allclose(flying.world_from_object(1.0)[5], at(1, 1, 0), atol=1e-14)
    growing = varied(slide(lambda t: np.diag([1 + t, 1, 1, 1])), 0, **half)
    np.testing.assert_allclose(growing.world_from_object(1.0)[5], np.diag([1.5, 1, 1, 1]), atol=1e-14)
    with pytest.raises(InputError, match="turns by") as error:
        varied(slide(lambda t: swing(5 * t)), 0, **half)
    assert error.value.field == "animation.0.amplitude"


def test_meshes_that_deform_follow_their_groups_and_are_shared_within_them(scene):
    """Four leaves share one mesh; two groups give two clocks, and so two meshes."""
    first = scene.meshes[0].positions
    meshes = (replace(scene.meshes[0], deforms=True), *scene.meshes[1:])
    objects = tuple(replace(item, mesh=0, moves=True) if k < 4 else item for k, item in enumerate(scene.objects))
    pose = lambda t: {0: Deformed(positions=first + np.float32([t, 0, 0]), normals=scene.meshes[0].normals)}  # noqa: E731
    bending = replace(scene, meshes=meshes, objects=objects, deformed=pose)
    rule = {"objects": ["/S/Pot*"], "rate": [0.5, 1], "amplitude": [2, 2]}
    blown = varied(bending, 2, animation=[rule])
    used = [item.mesh for item in blown.objects]
    assert used[0] == used[1] != used[2] == used[3] and [item.name for item in blown.objects] == list(NAMES)
    rates = [Draws(2, "animation", 0).within((0.5, 1), name, "rate") for name in ("/S/Pot0", "/S/Pot1")]
    poses = blown.deformed(0.8)
    for index, rate in ((0, rates[0]), (2, rates[1])):
        shifted = poses[used[index]].positions[:, 0] - first[:, 0]
        np.testing.assert_allclose(shifted, 2 * 0.8 * rate, rtol=8 * SINGLE)
    assert varied(bending, 2, animation=[rule | {"objects": ["/S"]}]).meshes == bending.meshes  # one clock: one mesh


def test_the_default_varies_any_scene_and_seeds_differ(scene):
    bare = replace(scene, lights=(), materials=scene.materials[:1], objects=())
    for start in (scene, bare):
        one, again, two = (vary(start, default_variation(start), seed) for seed in (1, 1, 2))
        assert one.materials == again.materials != two.materials and one.lights == again.lights
        assert not np.array_equal(one.environment.world_from_environment, two.environment.world_from_environment)
        assert one.cameras is start.cameras and one.files == start.files
        assert [item.name for item in one.objects] == [item.name for item in start.objects]


def test_a_variation_lies_beside_its_scene():
    assert variation_beside(Path("a/set.usda")) == Path("a/set.variation.json")


def test_an_empty_variation_changes_nothing(scene):
    assert varied(scene) == scene
    with pytest.raises(ValidationError):
        Variation.model_validate({})


def test_a_link_to_nowhere_beside_a_scene_is_not_taken_for_no_file(tmp_path):
    """The scene would vary as if nobody had said how."""
    (tmp_path / "scene.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "scene.variation.json").symlink_to("nowhere.json")
    with pytest.raises(InputError, match="No such file"):
        varied_scene(load_scene(tmp_path / "scene.obj"), tmp_path / "scene.obj", 1)
