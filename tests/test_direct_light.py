"""`raster`'s light from lights with an extent: against float64 integrals over the light, shadows, ambient occlusion."""

from dataclasses import replace

import numpy as np
import pytest

import framepairs.shading
from analytic import IDENTITY, Stage, at, constant_sky, fractions, make_scene, path_of, quad
from framepairs.backend import mi
from framepairs.environment import build_sky
from framepairs.gbuffer import gbuffer, pixel_of
from framepairs.projection import view_of
from framepairs.scene.description import Light, Material, Slot, Texture
from framepairs.shading import ambient_visibility
from framepairs.transforms import look_at
from reference import reflect

BASE = (0.6, 0.4, 0.2)
RADIANCE = (3.0, 2.0, 1.0)
LAMP = Material(name="lamp", base_color=(0, 0, 0), specular=0, roughness=1, emission=RADIANCE)
COLOR = frozenset({"color"})
SUN = Light(name="sun", kind="directional", radiance=(3, 2, 1), direction=(0.6, 0, -0.8))


@pytest.fixture(scope="module", autouse=True)
def one_sky():
    """Black skies are all one: filtering them takes longer than the rest."""
    black = []

    def build(environment, model):
        if environment.texels.any() or not black:
            black.append(build_sky(environment, model))
            return black.pop() if environment.texels.any() else black[0]
        return black[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(framepairs.shading, "build_sky", build)
        yield


def rectangle(half=0.4, position=(0.5, 0, 1.5), target=(0, 0, 0), **keys) -> Light:
    """A square light that looks at `target`."""
    frame = look_at(np.array(position, float), np.array(target, float), np.array([0, 1.0, 0]))[:3, :3]
    return Light(name="light", kind="rectangle", radiance=RADIANCE, position=position, direction=tuple(-frame[:, 2]),
                 half_u=tuple(half * frame[:, 0]), half_v=tuple(half * frame[:, 1]), **keys)  # fmt: skip


def disk(half=0.4, **keys) -> Light:
    return replace(rectangle(half, **keys), kind="disk")


def sphere(half=0.4, position=(0.5, 0, 1.5)) -> Light:
    return Light(name="light", kind="sphere", radiance=RADIANCE, position=position, half_u=(half, 0, 0))


def stage(*parts, material=Material(name="m", base_color=BASE), lights=(), eye=(-1.5, 0, 2), fov=0.05, **keys) -> Stage:
    """A floor in the plane z = 0 whose middle the camera sees."""
    camera = path_of(look_at(np.array(eye, float), np.zeros(3), np.array([0, 1.0, 0])), fov_y_deg=fov)
    textures = keys.pop("textures", ())
    scene = make_scene((quad(20, 20), material, IDENTITY), *parts, lights=tuple(lights), textures=textures)
    keys = {"display": (6, 4), "scales": (1,), "variants": ("native",), "brdf_table": 8} | keys
    return Stage(scene, camera, **keys)


def color(*args, **keys) -> np.ndarray:
    return stage(*args, **keys).arrays(0, "lr_x1", COLOR)["color"]


def reflected(light: Light, material: Material, eye=(-1.5, 0, 2), nodes=600) -> np.ndarray:
    """[3]: the integral over the light of BRDF times cosine, at the origin of the floor, by midpoints in float64."""
    s, t = (x.ravel() for x in np.meshgrid(*[(np.arange(nodes) + 0.5) / nodes] * 2))
    if light.kind == "sphere":
        centre, radius = np.array(light.position, float), np.linalg.norm(light.half_u)
        distance = np.linalg.norm(centre)
        cosine = 1 - s * (1 - np.sqrt(1 - (radius / distance) ** 2))
        axes = np.linalg.svd(centre[None])[2]
        w = centre / distance
        sine, phi = np.sqrt(1 - cosine**2), 2 * np.pi * t
        l = np.outer(cosine, w) + np.outer(sine * np.cos(phi), axes[1]) + np.outer(sine * np.sin(phi), axes[2])
        weight = np.full(len(s), 2 * np.pi * (1 - np.sqrt(1 - (radius / distance) ** 2)))
    else:
        x, y = 2 * s - 1, 2 * t - 1
        area = 4.0
        if light.kind == "disk":
            x, y, area = np.sqrt(s) * np.cos(2 * np.pi * t), np.sqrt(s) * np.sin(2 * np.pi * t), np.pi
        there = np.array(light.position) + np.outer(x, light.half_u) + np.outer(y, light.half_v)
        distance = np.linalg.norm(there, axis=1)
        l = there / distance[:, None]
        area *= np.linalg.norm(np.cross(light.half_u, light.half_v))
        weight = area * np.maximum(-l @ np.array(light.direction), 0) / distance**2
    v = np.array(eye, float) / np.linalg.norm(eye)
    n = np.array([0, 0, 1.0])
    value = reflect(material.base_color, material.metallic, material.roughness, n, v, l, material.specular)
    return (value * weight[:, None]).mean(axis=0) * light.radiance


MATERIALS = {
    "matt": Material(name="m", base_color=BASE, roughness=1.0, specular=0.0),
    "plastic": Material(name="m", base_color=BASE, roughness=0.2),
    "rough metal": Material(name="m", base_color=BASE, roughness=0.6, metallic=1.0),
    "smooth metal": Material(name="m", base_color=BASE, roughness=0.15, metallic=1.0),
}
LIGHTS = {"rectangle": rectangle(), "disk": disk(), "sphere": sphere()}
MIRRORED = {"position": (1.125, 0, 1.5)}  # where the floor mirrors it to the eye
MIRRORED_LIGHTS = {"rectangle": rectangle(**MIRRORED), "disk": disk(**MIRRORED), "sphere": sphere(**MIRRORED)}


@pytest.mark.parametrize("kind", LIGHTS)
@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize("mirrored", [False, True], ids=["aside", "mirrored"])
def test_many_points_give_the_integral_over_the_light(kind, name, mirrored):
    """1024 points of the Hammersley set: some 1e-3 for what is smooth, some 1e-2 where only the tail of a lobe is lit."""
    light, material = (MIRRORED_LIGHTS if mirrored else LIGHTS)[kind], MATERIALS[name]
    tolerance = {"smooth metal": 3e-2, "plastic": 1e-2}.get(name, 3e-3)
    found = color(material=material, lights=[light], light_samples=1024).mean(axis=(0, 1))
    expected = reflected(light, material)
    np.testing.assert_allclose(found, expected, rtol=tolerance)


@pytest.mark.parametrize("kind", LIGHTS)
def test_path_gives_the_integral_over_the_light(kind):
    for name in ("plastic", "smooth metal"):
        light, material = MIRRORED_LIGHTS[kind], MATERIALS[name]
        found = stage(material=material, lights=[light], shading="path", samples_per_pixel=1024, max_depth=2).arrays(0, "lr_x1")
        error = np.sqrt(found["color_variance"].mean(axis=(0, 1)) / found["color"][..., 0].size)
        assert np.all(error < 0.02 * found["color"].mean(axis=(0, 1)))
        expected = reflected(light, material)
        # the pixels see the floor within 0.002 of the origin
        assert np.all(np.abs(found["color"].mean(axis=(0, 1)) - expected) < 4 * error + 2e-3 * expected), name


@pytest.mark.parametrize("shading", ["raster", "path"])
@pytest.mark.parametrize("matrix", [IDENTITY, np.diag([1.0, -1, -1, 1])], ids=["towards", "turned"])
def test_an_emissive_square_is_a_rectangle_that_shines_on_both_sides(matrix, shading):
    material = MATERIALS["plastic"]
    light = rectangle(0.4, position=(1.125, 0, 1.5), target=(1.125, 0, 0))
    placed = at(*light.position) @ np.diag([0.8, 0.8, 1, 1]) @ matrix
    keys = {"material": material, "shading": shading, "light_samples": 256, "samples_per_pixel": 1024, "max_depth": 2}
    found = stage((quad(1, 1), LAMP, placed), mesh_lights=True, **keys).arrays(0, "lr_x1")
    error = np.sqrt(found["color_variance"].mean(axis=(0, 1)) / 24)
    expected = reflected(light, material)
    # the face is chosen along one coordinate of the pattern, so each triangle has half of its points: some 1e-2
    tolerance = 1e-2 if shading == "raster" else 2e-3
    assert np.all(np.abs(found["color"].mean(axis=(0, 1)) - expected) < 4 * error + tolerance * expected)


def test_lamps_light_and_show_in_the_floor_alike_in_raster_and_path():
    """A masked one, and a weak one that is drawn seldom and shows in the floor."""
    texels = np.ones((4, 4, 4), np.float32)
    texels[:2, :, 3], texels[:, 1, 3] = 0, 0
    texture = Texture(name="t", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    lamp = replace(LAMP, alpha="mask", base_texture=Slot(texture=0))
    weak = (quad(0.5, 0.5), replace(LAMP, emission=(1, 1, 1)), at(*MIRRORED["position"]))
    lamps = (quad(1, 1), lamp, at(1, 1.2, 1.5)), weak
    material = Material(name="m", base_color=BASE, roughness=0.4, metallic=0.5)
    found, truth = (
        stage(*lamps, material=material, textures=(texture,), mesh_lights=True,
              shading=shading, light_samples=1024, samples_per_pixel=2048, max_depth=2).arrays(0, "lr_x1")
        for shading in ("raster", "path")
    )  # fmt: skip
    mean, error = truth["color"].mean(axis=(0, 1)), np.sqrt(truth["color_variance"].mean(axis=(0, 1)) / 24)
    assert np.all(error < 0.01 * mean)
    # a thousand points count the area within an edge to about 1 %
    assert np.all(np.abs(found["color"].mean(axis=(0, 1)) - mean) < 4 * error + 0.01 * mean)


def test_emissive_objects_light_others_in_raster_only_when_asked():
    lamp = (quad(1, 1), LAMP, at(0, 0, 1.5))
    assert not color(lamp).any() and color(lamp, mesh_lights=True).all()


@pytest.mark.parametrize("roughness", [0.15, 1.0])
def test_a_blended_lamp_gives_its_share(roughness):
    """An opacity of 1/4 thins the emission; rays of the lobe pass it, so that its points alone must stand for it."""
    material = Material(name="m", base_color=BASE, roughness=roughness, metallic=1.0)
    thin = replace(LAMP, alpha="blend", opacity=0.25)
    placed = at(*MIRRORED["position"])
    keys = {"material": material, "mesh_lights": True, "light_samples": 1024}
    whole, quarter = (color((quad(1, 1), lamp, placed), **keys).mean(axis=(0, 1)) for lamp in (LAMP, thin))
    np.testing.assert_allclose(quarter, whole / 4, rtol=2e-2 if roughness == 1 else 5e-2)


def test_blended_surfaces_cast_no_shadow_and_masked_ones_where_they_are():
    """Half a mask before a small light, which the floor sees through it."""
    texels = np.ones((2, 2, 4), np.float32)
    texels[:, 1, 3] = 0
    texture = Texture(name="t", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    light = Light(name="p", kind="point", radiance=(9, 9, 9), position=(0.5, 0, 1.5))
    colors = {}
    for name, x, alpha in (("clear", 9.0, "mask"), ("left", 0.5, "mask"), ("right", 0.05, "mask"), ("blend", 0.5, "blend")):
        # the light's ray to the origin crosses z = 0.75 at x = 0.25
        card = replace(LAMP, emission=(0, 0, 0), alpha=alpha, base_texture=Slot(texture=0))
        colors[name] = color((quad(1, 1), card, at(x, 0, 0.75)), lights=[light], textures=(texture,))
    assert colors["clear"].all() and not colors["left"].any()
    assert np.array_equal(colors["right"], colors["clear"]) and np.array_equal(colors["blend"], colors["clear"])


@pytest.mark.parametrize("shading", ["raster", "path"])
def test_a_half_hidden_light_gives_half(shading):
    """A card hides the half of a light that is seen under the same angle: what is left is half, by symmetry in y."""
    light = rectangle(0.4, position=(0, 0, 1.5))
    card = (quad(4, 4), MATERIALS["matt"], at(0, 2, 0.75))
    keys = {"lights": [light], "material": MATERIALS["matt"], "shading": shading, "max_depth": 2, "samples_per_pixel": 1024}
    free, hidden = (stage(*parts, light_samples=64, eye=(0, 0, 0.7), **keys).arrays(0, "lr_x1") for parts in ((), (card,)))
    error = np.sqrt(free["color_variance"].mean() / 24 + hidden["color_variance"].mean() / 24)
    # 32 of 64 points lie to either side of the card's edge, and each half is integrated to some 1e-2
    assert abs(hidden["color"].mean() - free["color"].mean() / 2) < 4 * error + 1e-2 * free["color"].mean()


def test_penumbrae_are_steps_without_noise():
    """The pattern is one for all pixels: with 4 points and 4 directions, a column through a shadow jumps 16 times at most."""
    card = (quad(0.5, 0.5), MATERIALS["matt"], at(0, 0, 0.5))
    keys = {"eye": (1.2, 0, 0.45), "fov": 30.0, "display": (4, 96), "light_samples": 4, "material": MATERIALS["matt"]}
    light = rectangle(0.3, position=(0, 0, 3))
    shown, free = (stage(*parts, lights=[light], **keys).arrays(0, "lr_x1") for parts in ((card,), ()))
    floor = (shown["object_id"][:, 1, 0] == 1) & (free["object_id"][:, 1, 0] == 1)
    share = shown["color"][floor, 1, 0] / free["color"][floor, 1, 0]
    jumps = np.abs(np.diff(share)) > 0.02
    assert share.min() < 0.02 and share.max() > 0.7 and 4 <= jumps.sum() <= 16
    assert np.abs(np.diff(share))[~jumps].max() < 1.5e-3  # as the light turns away
    signs = np.sign(np.diff(share)[jumps])
    assert (np.diff(signs) != 0).sum() == 1  # darker and darker, then brighter and brighter


def test_frames_are_equal_whatever_the_seed():
    made = stage(lights=[rectangle(), disk(), sphere()], fov=40, ambient_occlusion=8)
    shots = [made.engine.render(made.shoot.state(0), made.streams["lr_x1"], COLOR, seed).arrays["color"] for seed in (0, 7)]
    assert shots[0].std() > 0 and shots[0].tobytes() == shots[1].tobytes()


def test_degenerate_lights_leave_the_picture_finite():
    zero = (0.0, 0.0, 0.0)
    lights = [
        replace(rectangle(), half_u=zero, half_v=zero), replace(disk(position=(0, 0, 1e5)), half_v=zero), sphere(0.0),
        sphere(1e-9), sphere(1e9), rectangle(position=(0, 0, 1e-6)), rectangle(position=(0.5, 0, -1)), sphere(0.5, (0, 0, 0)),
        Light(name="p", kind="point", radiance=(1, 1, 1)), replace(rectangle(), half_u=(1e-12, 0, 0)),
        replace(rectangle(), radiance=zero), rectangle(1e6, position=(0, 0, 1e6)), replace(disk(), half_u=(1e-20, 0, 0)),
    ]  # fmt: skip
    for roughness in (0.0, 1.0):
        material = Material(name="m", base_color=BASE, roughness=roughness, metallic=0.5)
        for shading in ("raster", "path"):
            made = stage(material=material, lights=lights, fov=90, shading=shading, samples_per_pixel=4, light_samples=4)
            shot = made.engine.render(made.shoot.state(0), made.streams["lr_x1"], frozenset({"color", "color_variance"}), 0)
            assert np.isfinite(shot.arrays["color"]).all() and shot.arrays["color"].max() < 1e4, (roughness, shading)
            assert shot.rejected_paths == 0


def test_far_from_the_origin_light_is_the_same():
    """At 1e6 from the origin, where float32 knows no more than 1/16, a power of two away, so that the sums are exact."""
    shift = np.array([2.0**20, -(2.0**21), 2.0**20])
    images = []
    for offset in (np.zeros(3), shift):
        light = rectangle()
        light = replace(light, position=tuple(np.array(light.position) + offset))
        camera = look_at(np.array([-1.5, 0, 2]) + offset, offset, np.array([0, 1.0, 0]))
        card = (quad(0.3, 0.3), MATERIALS["matt"], at(*(offset + (0.2, 0, 0.5))))
        scene = make_scene((quad(20, 20), MATERIALS["plastic"], at(*offset)), card, lights=(light,))
        made = Stage(scene, path_of(camera, fov_y_deg=40), display=(24, 16), scales=(1,), brdf_table=8)
        images.append(made.arrays(0, "lr_x1", COLOR)["color"])
    assert images[0].std() > 0
    # camera rays are rounded alike only to 2^-24 of the offsets that NumPy subtracts in float64: shadow edges may move a pixel
    assert (np.abs(images[1] - images[0]) > 1e-4 * images[0].max()).mean() < 0.01


def wall_and_floor(**plan) -> Stage:
    """The floor z = 0 seen along x, from the foot of a wall (x = 0) to 0.5 before it; constant light."""
    white = Material(name="w", base_color=(0.5, 0.5, 0.5), roughness=1.0, specular=0.0)
    wall = (quad(80, 80), white, look_at(np.zeros(3), np.array([-1.0, 0, 0]), np.array([0, 1.0, 0])))
    scene = make_scene((quad(80, 80), white, IDENTITY), wall)
    camera = at(0.25, 0, 1.0)
    return Stage(scene, path_of(camera, fov_y_deg=4), display=(64, 8), scales=(1,), brdf_table=8, **plan)


def test_ambient_occlusion_next_to_a_wall_is_its_closed_form():
    """A wall of height far above the radius R hides, from distance d < R, the directions with sin(theta) cos(phi) > d / R.

    Visible share of the cosine hemisphere: 1 - (arccos(x) - x sqrt(1 - x^2)) / pi with x = d / R, the segment of the unit
    disk beyond x (Nusselt): 1/2 at the wall's foot, 1 from R on.
    """
    made = wall_and_floor(ambient_occlusion=1024, ambient_occlusion_radius_m=0.4)
    shading, state = made.engine.shading, made.shoot.state(0)
    pose, _ = shading.geometry.pose(state)
    view, size = view_of(state.camera, state.render_origin), (64, 8)
    x, y = (mi.Float(np.float32(c.ravel())) for c in fractions(*size))
    sample = gbuffer(shading.geometry, shading.materials, shading.brdf, pose, view, x, y, pixel_of(view, size, mi.Float(0)))
    free = np.array(ambient_visibility(shading, pose, sample))
    normal, position = np.array(sample.normal), np.array(sample.position).T + state.render_origin
    floor = (normal[2] > 0.9) & (position[:, 0] > 0)
    d = np.clip(position[floor, 0] / 0.4, 0, 1)
    expected = 1 - (np.arccos(d) - d * np.sqrt(1 - d**2)) / np.pi
    assert d.min() < 0.05 and d.max() > 0.9 and floor.sum() > 100
    # 1024 points of a Hammersley set count the segment to about N^(-3/4) = 6e-3
    assert np.abs(free[floor] - expected).max() < 1e-2


def test_ambient_occlusion_darkens_ambient_light_only_and_only_when_asked():
    bright = constant_sky((1, 1, 1))
    matt = MATERIALS["matt"]
    gap = [(quad(8, 8), matt, IDENTITY), (quad(8, 8), matt, at(0, 0, 0.3) @ np.diag([1, 1, -1, 1]))]
    camera = path_of(look_at(np.array([-1.0, 0, 0.2]), np.zeros(3), np.array([0, 1.0, 0])))
    images = []
    for sky, lights, occlusion in ((bright, (), 0), (bright, (), 16), (None, (SUN,), 0), (None, (SUN,), 16)):
        scene = make_scene(*gap, sky=sky, lights=lights)
        made = Stage(scene, camera, display=(8, 6), scales=(1,), ambient_occlusion=occlusion)
        assert made.engine.shading.occludes == bool(occlusion)
        images.append(made.arrays(0, "lr_x1", COLOR)["color"])
    assert images[1].mean() < 0.5 * images[0].mean() and np.array_equal(images[2], images[3])


def test_a_light_on_a_surface_shows_in_a_glossy_one_as_if_it_hung_below_it():
    """A panel in the plane of the ceiling: rays of the lobe meet light and ceiling at one distance, but for rounding."""
    means = []
    for gap in (0.0, 0.01):
        ceiling = (quad(30, 30), Material(name="ceiling", base_color=(0.5, 0.5, 0.5)), facing_down(at(0.1, 2, -4)))
        metal = Material(name="floor", base_color=(1, 1, 1), metallic=1.0, roughness=0.1)
        floor = (quad(30, 30), metal, facing_up(at(0, -1, -4)))
        panel = Light(
            name="panel", kind="rectangle", radiance=(5, 5, 5), position=(0, 2 - gap, -9), direction=(0, -1, 0),
            half_u=(5, 0, 0), half_v=(0, 0, 5),
        )  # fmt: skip
        stage = Stage(make_scene(ceiling, floor, lights=(panel,)), path_of(np.eye(4)), display=(96, 54), scales=(1,))
        arrays = stage.arrays(0, "lr_x1", frozenset({"color", "object_id"}))
        means.append(arrays["color"][arrays["object_id"][..., 0] == 2].mean())
    assert means[0] == pytest.approx(means[1], rel=0.03)  # the panel is a centimetre nearer of three metres


def facing_up(matrix: np.ndarray) -> np.ndarray:
    return matrix @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])


def facing_down(matrix: np.ndarray) -> np.ndarray:
    return matrix @ np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
