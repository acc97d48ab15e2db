"""`raster` colour of scenes whose light is known by hand."""

import numpy as np
import pytest

from analytic import Stage, at, constant_sky, make_scene, path_of, quad
from framepairs.scene.description import Environment, Light, Material, rotation_from_y_up

WHITE = Material(name="white", base_color=(0.4, 0.5, 0.6), roughness=1.0, specular=0.0)
SUN = Light(name="sun", kind="directional", radiance=(3.0, 2.0, 1.0), direction=(0.0, -0.6, -0.8))
CENTRE = (13, 24)


def center_color(stage: Stage, stream: str = "lr_x1") -> np.ndarray:
    return stage.arrays(0, stream)["color"][CENTRE]


def facing(material: Material, *extra, **keys) -> Stage:
    return Stage(make_scene((quad(40, 40), material, at(0, 0, -2)), *extra, **keys), path_of(np.eye(4)), scales=(1,))


def test_directional_light_on_a_diffuse_plane():
    stage = facing(WHITE, lights=(SUN,))
    lambert = np.array(WHITE.base_color) / np.pi * np.array(SUN.radiance) * 0.8
    # specular = 0 leaves Schlick's grazing term (1 - v.h)^5: at most that much of the light over pi
    v_h = np.sqrt((1 + 0.8) / 2)
    grazing = (1 - v_h) ** 5 * np.array(SUN.radiance) * 0.8
    color = center_color(stage)
    assert np.all(color >= lambert - 1e-4) and np.all(color <= lambert + grazing + 1e-2 * lambert)


def test_point_light_falls_off_with_the_square():
    def lit(distance):
        light = Light(name="p", kind="point", radiance=(5, 5, 5), position=(0, 0, -2 + distance))
        return center_color(facing(WHITE, lights=(light,)))

    assert lit(1.0) / lit(2.0) == pytest.approx(4, rel=5e-3)  # the pixel's centre lies beside the axis


def test_spot_light_is_dark_outside_its_cone():
    aim = {"position": (0, 0, 0), "direction": (0.0, 0.0, -1.0)}
    narrow = Light(name="s", kind="spot", radiance=(5, 5, 5), cone=(np.cos(0.1), np.cos(0.2)), **aim)
    color = facing(WHITE, lights=(narrow,)).arrays(0, "lr_x1")["color"]
    assert color[CENTRE].min() > 0 and not color[0, 0].any()


def test_shadows_are_attached_and_have_the_casters_shape():
    card = (quad(0.4, 0.4), WHITE, at(0, 0.3, -1.5))  # 0.5 before the wall
    stage = Stage(make_scene((quad(40, 40), WHITE, at(0, 0, -2)), card, lights=(SUN,)), path_of(np.eye(4)), scales=(1,),
                  display=(192, 108))  # fmt: skip
    arrays = stage.arrays(0, "lr_x1")
    wall = arrays["object_id"][..., 0] == 1
    dark = wall & (arrays["color"].sum(-1) < 1e-6)
    # going down the light 0.5 in z moves the shadow by -0.6 / 0.8 * 0.5 = -0.375 in y: centred at y = -0.075 on the wall
    j, i = np.nonzero(dark)
    tangent = np.tan(np.radians(30))
    y = (1 - 2 * (j + 0.5) / 108) * tangent * 2
    x = (2 * (i + 0.5) / 192 - 1) * tangent * 16 / 9 * 2
    pixel = 2 * tangent * 2 / 108
    assert y.max() <= 0.125 + pixel and y.min() == pytest.approx(-0.275, abs=pixel)
    assert x.max() == pytest.approx(0.2, abs=pixel) and x.min() == pytest.approx(-0.2, abs=pixel)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_under_constant_light_colour_is_f_beta_times_light(roughness, metallic):
    """The split sum is exact here: demodulated lighting is the sky's radiance everywhere on the surface."""
    material = Material(name="m", base_color=(0.9, 0.3, 0.1), roughness=roughness, metallic=metallic)
    stage = facing(material, sky=constant_sky((2.0, 1.0, 0.5)))
    arrays = stage.arrays(0, "lr_x1")
    # irradiance by nine harmonics, integrated by midpoints to 1e-4 of the light
    assert np.abs(arrays["color"] / arrays["brdf"] / (2.0, 1.0, 0.5) - 1).max() < 2e-4


def test_emission_is_added_and_kept_apart():
    glow = Material(name="glow", base_color=(0, 0, 0), specular=0.0, roughness=1.0, emission=(4, 2, 1))
    arrays = facing(glow).arrays(0, "lr_x1")
    assert np.abs(arrays["emission"][CENTRE] - (4, 2, 1)).max() < 1e-6
    assert np.abs(arrays["color"][CENTRE] - (4, 2, 1)).max() < 1e-3


def test_background_is_the_sky_in_colour_and_emission_and_brdf_is_zero():
    stage = Stage(make_scene(sky=constant_sky((0.1, 0.2, 0.3))), path_of(np.eye(4)))
    arrays = stage.arrays(0, "hr")
    assert np.abs(arrays["color"] - (0.1, 0.2, 0.3)).max() < 1e-3 and np.array_equal(arrays["color"], arrays["emission"])
    assert not arrays["brdf"].any()


@pytest.mark.parametrize("up_axis", ["Y", "Z", "X"])
def test_the_sky_stands_where_its_image_says(up_axis):
    """One bright texel, 45 degrees to the right of -z and 20 degrees up, in the scene's own axes."""
    height, width = 90, 180
    texels = np.zeros((height, width, 3), np.float32)
    direction = np.array([np.cos(np.radians(20)) * np.sin(np.pi / 4), np.sin(np.radians(20)),
                          -np.cos(np.radians(20)) * np.cos(np.pi / 4)])  # fmt: skip
    u = 0.5 - np.arctan2(direction[0], direction[2]) / (2 * np.pi)
    v = np.arccos(direction[1]) / np.pi
    texels[int(v * height) - 1 : int(v * height) + 2, int(u * width) - 1 : int(u * width) + 2] = 100
    rotation = rotation_from_y_up(up_axis)
    sky = Environment(name="s", texels=texels, world_from_environment=rotation)
    camera = np.eye(4)
    camera[:3, :3] = rotation
    color = Stage(make_scene(sky=sky), path_of(camera, fov_y_deg=100), display=(192, 108)).arrays(0, "hr")["color"]
    j, i = np.unravel_index(np.argmax(color.sum(-1)), color.shape[:2])
    tangent = np.tan(np.radians(50))
    x = 0.5 + 0.5 * direction[0] / -direction[2] / (tangent * 16 / 9)
    y = 0.5 - 0.5 * direction[1] / -direction[2] / tangent
    assert abs(i + 0.5 - x * 192) < 3 and abs(j + 0.5 - y * 108) < 3  # a texel is 2 degrees


def test_blended_layers_cover_colour_but_not_the_gbuffer():
    glass = Material(name="glass", base_color=(0, 0, 0), specular=0, roughness=1.0, emission=(1, 0, 0), opacity=0.25,
                     alpha="blend")  # fmt: skip
    glow = Material(name="glow", base_color=(0, 0, 0), specular=0, roughness=1.0, emission=(0, 8, 0))
    stage = facing(glow, (quad(40, 40), glass, at(0, 0, -1)), (quad(40, 40), glass, at(0, 0, -1.2)))
    arrays = stage.arrays(0, "lr_x1")
    assert (arrays["object_id"] == 1).all() and np.abs(arrays["depth"] - 2).max() < 1e-5
    through = 0.75**2
    assert np.abs(arrays["transparency"] - (1 - through)).max() < 1e-6
    assert np.abs(arrays["color"][CENTRE] - (0.25 + 0.75 * 0.25, 8 * through, 0)).max() < 1e-3


def test_hr_colour_is_the_mean_of_its_samples():
    """Half of a pixel column is covered: 16 stratified samples see it to 1/16."""
    glow = Material(name="glow", base_color=(0, 0, 0), specular=0, roughness=1.0, emission=(1, 1, 1))
    tangent = np.tan(np.radians(30)) * 16 / 9
    edge = 2 * tangent * 2 * (30.3 / 48 - 0.5)  # the quad's right edge lies 0.3 into column 30
    stage = Stage(make_scene((quad(8, 8), glow, at(edge - 4, 0, -2))), path_of(np.eye(4)), antialiasing=16, scales=(1,))
    hr, lr = (stage.arrays(0, name)["color"][13, :, 0] for name in ("hr", "lr_x1"))
    assert hr[29] == pytest.approx(1, abs=1e-3) and hr[31] == 0
    assert abs(hr[30] - 0.3) <= 1 / 16
    assert set(np.round(lr[28:33], 3)) == {0.0, 1.0}  # one sample: aliased


def test_two_seeds_give_equal_raster_frames():
    frames = [facing(WHITE, lights=(SUN,)).arrays(0, "hr")["color"] for _ in range(2)]
    assert np.array_equal(*frames)


def test_a_point_light_shines_all_around():
    """Also straight against its unused default direction, where a spot of cone -1 would have a hole of 0.8 degrees."""
    light = Light(name="p", kind="point", radiance=(5, 5, 5), position=(0, 0, -1), direction=(0.0, 0.0, 1.0))
    scene = make_scene((quad(40, 40), WHITE, at(0, 0, -2)), lights=(light,))
    stage = Stage(scene, path_of(np.eye(4)), display=(49, 27), scales=(1,))  # odd: one pixel looks along the axis
    color = stage.arrays(0, "lr_x1")["color"][..., 0]
    assert color[13, 24] == color.max() and color[13, 24] == pytest.approx(0.4 * 5 / np.pi, rel=0.05)
