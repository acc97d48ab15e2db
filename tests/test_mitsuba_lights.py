"""Mitsuba's emitters: their radiance, place and direction are those that Mitsuba itself evaluates."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene.mitsuba import scene_from_dict
from framepairs.scene.mitsuba_spectra import EQUAL_ENERGY, emission_of_spectrum, reflectance_of_spectrum

SINGLE = 2.0**-23
PLACE = np.array([[0, -1, 0, 0.5], [1, 0, 0, -0.25], [0, 0, 1, 1], [0, 0, 0, 1]]) @ np.array(
    [[1, 0, 0, 0], [0, 0.6, -0.8, 0], [0, 0.8, 0.6, 0], [0, 0, 0, 1.0]]
)


def read(folder, **emitters):
    return scene_from_dict({"type": "scene", **emitters}, folder)


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


def irradiance_from_mitsuba(emitter, point):
    """(incident radiance or irradiance [3], direction towards the light) at a point, without shadows."""
    from framepairs.backend import mi

    scene = mi.load_dict({"type": "scene", "e": emitter, "s": {"type": "sphere", "radius": 0.01}})
    si = mi.SurfaceInteraction3f()
    si.p = mi.Point3f(*map(float, point))
    sample, weight = scene.emitters()[0].sample_direction(si, mi.Point2f(0.5, 0.5))
    return np.array(weight).ravel(), np.array(sample.d).ravel()


@pytest.mark.renders
@pytest.mark.parametrize(
    "emitter",
    [
        {"type": "point", "position": [1.0, 2, 3], "intensity": rgb(3, 2, 1)},
        {"type": "point", "to_world": PLACE, "intensity": 2.0},
        {"type": "point", "to_world": PLACE},
        {"type": "directional", "direction": [1.0, -2, 0.5], "irradiance": rgb(3, 2, 1)},
        {"type": "directional", "to_world": PLACE, "irradiance": {"type": "spectrum", "value": 2.0}},
    ],
)
def test_point_and_directional_lights_are_mitsubas(tmp_path, emitter):
    from framepairs.backend import mi

    (light,) = read(tmp_path, e=emitter).lights
    theirs = {k: mi.ScalarTransform4f(v) if k == "to_world" else v for k, v in emitter.items()}
    point = np.array([0.25, -1, 0.5])
    weight, direction = irradiance_from_mitsuba(theirs, point)
    towards = np.array(light.position) - point if light.kind == "point" else -np.array(light.direction)
    falloff = 1 / (towards @ towards) if light.kind == "point" else 1
    np.testing.assert_allclose(towards / np.linalg.norm(towards), direction, atol=8 * SINGLE)
    np.testing.assert_allclose(np.array(light.radiance) * falloff, weight, rtol=8 * SINGLE)


@pytest.mark.renders
@pytest.mark.parametrize("keys", [{}, {"cutoff_angle": 30.0}, {"cutoff_angle": 40.0, "beam_width": 10.0}])
def test_spots_have_mitsubas_rim(tmp_path, keys):
    from framepairs.backend import mi

    emitter = {"type": "spot", "intensity": rgb(3, 2, 1), **keys}
    scene = read(tmp_path, e={**emitter, "to_world": PLACE})
    (light,) = scene.lights
    assert scene.not_read == ("falloff of spot e: it is linear in the cosine, not in the angle",)
    inner, outer = np.arccos(light.cone)
    across = np.cross(light.direction, [0.3, 0.5, 0.7])
    across /= np.linalg.norm(across)
    for angle, share in ((0.98 * inner, 1), ((inner + outer) / 2, 0.5), (1.02 * outer, 0)):
        point = np.array(light.position) + 2 * (np.cos(angle) * np.array(light.direction) + np.sin(angle) * across)
        weight, _ = irradiance_from_mitsuba({**emitter, "to_world": mi.ScalarTransform4f(PLACE)}, point)
        np.testing.assert_allclose(weight, share * np.array(light.radiance) / 4, rtol=1024 * SINGLE, atol=1e-7)


@pytest.mark.renders
@pytest.mark.parametrize("place", [np.eye(4), PLACE])
def test_envmaps_look_as_mitsubas(tmp_path, place):
    """Rows are interpolated anew: a slow gradient stays, to a row's difference to the second order."""
    from framepairs.backend import mi

    height, width = 32, 64
    v, u = np.meshgrid(np.arange(height) / (height - 1), np.arange(width) / width, indexing="ij")
    texels = np.stack([1 + v, 1.5 + 0.5 * np.sin(2 * np.pi * u), 1.5 + 0.5 * np.cos(2 * np.pi * u) * v], axis=-1)
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(texels, np.float32)}).write(str(tmp_path / "e.exr"))
    sky = read(tmp_path, e={"type": "envmap", "filename": "e.exr", "scale": 2.0, "to_world": place}).environment
    bitmap = mi.Bitmap(np.ascontiguousarray(texels, np.float32))
    theirs = mi.load_dict({"type": "envmap", "bitmap": bitmap, "scale": 2.0, "to_world": mi.ScalarTransform4f(place)})
    directions = np.random.default_rng(3).normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for direction in directions:
        x, y, z = sky.world_from_environment.T @ direction
        column, row = (0.5 - np.arctan2(x, z) / (2 * np.pi)) * width - 0.5, np.arccos(y) / np.pi * height - 0.5
        i, j = int(np.floor(column)), int(np.clip(np.floor(row), 0, height - 2))
        a, b = column - i, np.clip(row - j, 0, 1)
        corner = [[sky.texels[j + dj, (i + di) % width] for di in (0, 1)] for dj in (0, 1)]
        ours = (1 - b) * ((1 - a) * corner[0][0] + a * corner[0][1]) + b * ((1 - a) * corner[1][0] + a * corner[1][1])
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*map(float, -direction))
        # half a row beyond the last ones the gradient of 2 in v is held: 2 * 0.5 / 32
        near_pole = np.arccos(abs(y)) < np.pi / height
        np.testing.assert_allclose(ours, np.array(theirs.eval(si)).ravel(), atol=2 / 32 if near_pole else 0.01)


def test_a_constant_sky(tmp_path):
    sky = read(tmp_path, e={"type": "constant", "radiance": rgb(1, 2, 3)}).environment
    assert sky.texels.shape == (1, 2, 3) and (sky.texels == [1, 2, 3]).all()


def test_area_emitters_make_copies_of_their_material(tmp_path):
    Image.fromarray(np.full((5, 7, 3), 200, np.uint8)).save(tmp_path / "t.png")
    textured = {"type": "area", "radiance": {"type": "bitmap", "filename": "t.png"}}
    values = {
        "paint": {"type": "diffuse", "reflectance": rgb(0.1, 0.2, 0.3)},
        "a": {"type": "sphere", "bsdf": {"type": "ref", "id": "paint"}},
        "b": {"type": "sphere", "bsdf": {"type": "ref", "id": "paint"}, "light": {"type": "area", "radiance": rgb(1, 2, 3)}},
        "c": {"type": "sphere", "light": textured},
    }
    scene = read(tmp_path, **values)
    plain, lit, shown = scene.materials
    assert [item.material for item in scene.objects] == [0, 1, 2]
    assert (plain.emission, plain.shines, lit.base_color) == ((0, 0, 0), False, (0.1, 0.2, 0.3))
    assert (lit.emission, lit.emits, lit.shines, lit.emission_texture) == ((1, 2, 3), "front", True, None)
    assert (shown.emission, scene.textures[shown.emission_texture.texture].srgb) == ((1, 1, 1), True)


@pytest.mark.parametrize(("weight", "shines"), [(0.0, False), (0.5, True)])
def test_an_area_emitter_that_is_not_sampled_only_glows(tmp_path, weight, shines):
    light = {"type": "area", "radiance": rgb(1, 2, 3), "sampling_weight": weight}
    scene = read(tmp_path, b={"type": "sphere", "light": light})
    material = scene.materials[scene.objects[0].material]
    assert (material.emission, material.shines, scene.not_read) == ((1, 2, 3), shines, ())


@pytest.mark.parametrize(
    ("emitter", "says"),
    [
        ({"type": "projector"}, "emitter projector e"),
        ({"type": "sunsky"}, "emitter sunsky e"),
        ({"type": "point", "sampling_weight": 2.0}, "property sampling_weight of e"),
        ({"type": "point", "intensity": {"type": "checkerboard"}}, "emitter point e: intensity through checkerboard"),
    ],
)
def test_what_is_not_drawn_is_named(tmp_path, emitter, says):
    assert read(tmp_path, e=emitter).not_read == (says,)


def test_environments_that_are_sheared_are_refused(tmp_path):
    OpenEXR.File({}, {"RGB": np.ones((4, 8, 3), np.float32)}).write(str(tmp_path / "e.exr"))
    for place in (np.diag([-1.0, 1, 1, 1]), np.array([[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])):
        with pytest.raises(InputError, match="e: to_world is no rotation"):
            read(tmp_path, e={"type": "envmap", "filename": "e.exr", "to_world": place})


@pytest.mark.renders
@pytest.mark.parametrize(
    "pairs",
    [
        [[400, 0.2], [500, 0.5], [700, 0.1]],
        [[360, 1.0], [830, 1.0]],
        [[300, 0.0], [400, 0.1], [550, 0.9], [600, 0.2], [900, 0.1]],
    ],
)
def test_spectra_have_mitsubas_colours(pairs):
    """The matching functions are a fit; its authors state its errors as below 1 % of the peaks."""
    from framepairs.backend import mi

    values = {"type": "spectrum", "value": [tuple(map(float, pair)) for pair in pairs]}
    si = mi.SurfaceInteraction3f()
    si.wi, si.sh_frame = mi.Vector3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1))
    emitted = np.array(mi.load_dict({"type": "constant", "radiance": values}).eval(si)).ravel()
    reflected = np.array(mi.load_dict({"type": "diffuse", "reflectance": values}).eval_diffuse_reflectance(si)).ravel()
    np.testing.assert_allclose(emission_of_spectrum(np.array(pairs)), emitted, atol=0.01)
    np.testing.assert_allclose(reflectance_of_spectrum(np.array(pairs)), reflected, atol=0.01)


def test_white_surfaces_are_white():
    assert reflectance_of_spectrum(np.array([[300.0, 1.0], [900.0, 1.0]])) == (1, 1, 1)


@pytest.mark.renders
def test_a_uniform_spectrum_emits_equal_energy():
    from framepairs.backend import mi

    si = mi.SurfaceInteraction3f()
    found = np.array(mi.load_dict({"type": "constant", "radiance": {"type": "spectrum", "value": 1.0}}).eval(si)).ravel()
    np.testing.assert_allclose(EQUAL_ENERGY, found, atol=1e-6)
