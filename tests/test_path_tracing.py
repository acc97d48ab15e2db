"""`path` shading: against Mitsuba's integrator, against `raster` where both must agree, and what it says of its own noise.

Cameras called ABOVE are far away and narrow, so that all pixels look along the normal of the floor z = 0: there a matt
surface of specular 0 reflects light that comes along the normal by exactly base / pi.
"""

from dataclasses import replace

import numpy as np
import pytest

import framepairs.path_tracing
import framepairs.shading
from analytic import IDENTITY, Stage, at, constant_sky, make_scene, path_of, quad
from framepairs.backend import dr, mi
from framepairs.environment import build_sky, sky_radiance
from framepairs.lights import lights_around
from framepairs.metallic_roughness import register
from framepairs.path_tracing import random_numbers
from framepairs.scene.description import Environment, Light, Material, Mesh, Slot, Texture, rotation_from_y_up
from framepairs.transforms import look_at
from reference import reflect

pytestmark = pytest.mark.renders

SIZE = (12, 8)
MATT = Material(name="matt", base_color=(0.4, 0.4, 0.4), roughness=1.0, specular=0.0)
LAMP = Material(name="lamp", base_color=(0, 0, 0), roughness=1.0, specular=0.0, emission=(3.0, 2.0, 1.0))
DOWN = Light(name="sun", kind="directional", radiance=(np.pi, 2 * np.pi, 3 * np.pi), direction=(0, 0, -1))
POINT = Light(name="point", kind="point", radiance=(9, 8, 7), position=(1, 2, 3))
SHOWN = frozenset({"color", "emission", "color_variance", "object_id", "transparency"})
FLOOR = (quad(50, 50), MATT, IDENTITY)
PATH = {"shading": "path", "scales": (1,), "variants": ("native",), "brdf_table": 8, "display": SIZE, "max_depth": 2}


@pytest.fixture(scope="module", autouse=True)
def skies_are_filtered_once():
    """Filtering a sky takes longer than all the rest here."""
    known = {}

    def build(environment, model):
        key = environment.texels.tobytes(), environment.world_from_environment.tobytes()
        known[key] = known.get(key) or build_sky(environment, model)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(framepairs.shading, "build_sky", build)
        yield


def looking(position, target=(0, 0, 0), fov_y=1.0, **keys):
    """A camera path of one frame."""
    matrix = look_at(np.array(position, float), np.array(target, float), np.array([0, 1.0, 0]))
    return path_of(matrix, fov_y_deg=fov_y, **keys)


ABOVE = looking((0, 0, 100))  # sees 2.618 x 1.745 of the plane z = 0


def stage(*parts, camera=ABOVE, lights=(), sky=None, textures=(), spp=1, **plan) -> Stage:
    scene = make_scene(*parts, lights=tuple(lights), sky=sky, textures=textures)
    return Stage(scene, camera, **(PATH | {"samples_per_pixel": spp} | plan))


def shot(made: Stage, seed=0, stream="lr_x1", frame=0):
    return made.engine.render(made.shoot.state(frame), made.streams[stream], SHOWN, seed)


def image(*parts, **keys) -> np.ndarray:
    return shot(stage(*parts, **keys)).arrays["color"]


def mean_and_error(values) -> tuple[np.ndarray, np.ndarray]:
    """Mean [3] over independent pixels of equal expectation, and its standard error."""
    flat = values.reshape(-1, 3).astype(np.float64)
    return flat.mean(axis=0), flat.std(axis=0, ddof=1) / len(flat) ** 0.5


def box(smooth: bool) -> Mesh:
    """The cube [-1/2, 1/2]^3 with eight vertices; smooth normals point along the diagonals."""
    corners = np.float32([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.uint32([t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])])
    return Mesh(name="box", positions=corners, faces=triangles, normals=2 * corners / 3**0.5 if smooth else None)


# ---- one light, no noise: `path` is `raster`


@pytest.mark.parametrize("matrix", [np.eye(4), np.diag([1.0, 1, -1, 1]), np.diag([-1.0, 1, 1, 1])])
def test_directional_light_gives_irradiance_times_albedo_over_pi(matrix):
    """Whichever way the surface faces."""
    found = image((quad(50, 50), MATT, matrix), lights=(DOWN,))
    np.testing.assert_allclose(found, np.broadcast_to([0.4, 0.8, 1.2], found.shape), rtol=1e-5)


NORMALS = Texture(name="n", texels=np.tile(np.float32([0.45, 0.25, 0.857, 1]), (2, 3, 1)), srgb=False)
LEAF_TEXELS = np.float32([[[1, 0.5, 0.2, 1], [0.3, 0.6, 0.9, 0.3]]] * 2)
LEAF = Texture(name="leaf", texels=LEAF_TEXELS, srgb=False, wrap=("clamp", "clamp"))
SHINY = Material(name="shiny", base_color=(0.7, 0.5, 0.3), roughness=0.3, metallic=0.4)


@pytest.mark.parametrize("light", [
    POINT, replace(DOWN, direction=(0.48, -0.6, -0.64)),
    replace(POINT, kind="spot", direction=(-0.2, -0.55, -0.811), cone=(0.95, 0.7)),
], ids=lambda light: light.kind)  # fmt: skip
def test_one_light_without_extent_is_rasters(light):
    """Textures, normal maps, masks, shadows, mirrored and stretched objects: the same surface and the same light."""
    textures = (NORMALS, LEAF)
    turned = at(0.4, 0.3, 0.6) @ np.diag([-1.2, 0.6, 1, 1])
    parts = [
        (quad(6, 6), replace(SHINY, normal_texture=Slot(texture=0), normal_scale=0.4), IDENTITY),
        (quad(0.8, 0.9), replace(SHINY, base_texture=Slot(texture=1), alpha="mask"), turned),
        (box(True), MATT, at(-0.8, 0, 0.5) @ np.diag([0.4, 0.6, -1, 1])),
    ]
    keys = {"camera": looking((1.5, -2, 5), fov_y=25), "lights": (light,), "textures": textures, "display": (36, 24)}
    found, expected = (image(*parts, **keys, shading=shading) for shading in ("path", "raster"))
    assert expected.std() > 0.05 * expected.mean() > 0
    # two kernels round differently: an edge's pixel may fall to the other side
    close = np.abs(found - expected) <= 1e-4 * expected + 1e-6
    assert (~close).any(axis=-1).mean() < 0.01


def test_several_lights_are_summed():
    """Each path draws one of them: the mean is raster's sum."""
    lights = [DOWN, replace(POINT, position=(0, 0, 3)), replace(POINT, position=(0, 0, 1), radiance=(0.1, 0, 0.2))]
    lights += [replace(POINT, position=(0, 0, k + 5.0), radiance=(1, 1, 1)) for k in range(200)]
    made = stage(FLOOR, lights=lights, spp=1024)
    found = shot(made).arrays
    mean, error = mean_and_error(found["color"])
    expected = image(FLOOR, lights=lights, shading="raster").mean(axis=(0, 1))
    assert np.all(error < 0.02 * mean) and np.all(np.abs(mean - expected) < 4 * error)


# ---- what is seen first


SLANTED = look_at(np.zeros(3), np.array([0, 0, -1.0]), np.array([0.3, 1, 0]))


@pytest.mark.parametrize("keys", [{"scales": (1,)}, {"scales": (1.3,)}, {"antialiasing": 8}, {"antialiasing": 16}])
def test_primary_rays_are_rasters(keys):
    """Emission is that of `raster` to the bit, in HR with any number of paths, and in jittered LR."""
    parts = (quad(1.3, 0.9), replace(LAMP, emission=(1, 1, 1)), SLANTED)
    for spp in (1, 20):
        made = [stage(parts, spp=spp, variants=("jittered",), shading=s, sky=constant_sky((0.1, 0, 0)), **keys)
                for s in ("path", "raster")]  # fmt: skip
        for name in made[0].streams:
            found, expected = (shot(one, stream=name).arrays for one in made)
            assert expected["emission"].std() > 0
            assert np.array_equal(found["emission"], expected["emission"])
            assert np.array_equal(found["object_id"], expected["object_id"])
            sky = (found["object_id"][..., 0] == 0) if name != "hr" else (found["emission"][..., 1] == 0)
            assert sky.any() and np.array_equal(found["color"][sky], found["emission"][sky])


def test_depth_one_is_what_shines_itself():
    parts, sky = (FLOOR, (box(False), LAMP, IDENTITY)), constant_sky((1, 1, 1))
    found = shot(stage(*parts, lights=(DOWN,), sky=sky, max_depth=1)).arrays
    assert found["emission"].std() > 0 and np.array_equal(found["color"], found["emission"])


def test_lights_are_not_seen_themselves():
    lights = [DOWN, replace(POINT, kind="sphere", position=(0, 0, 50), half_u=(0.1, 0, 0))]
    assert not image(lights=lights, sky=constant_sky()).any()


@pytest.mark.parametrize("side", [1, -1])
def test_emission_is_seen_from_both_sides(side):
    found = image((quad(50, 50), LAMP, IDENTITY), camera=looking((0, 0, 100 * side)))
    np.testing.assert_allclose(found, np.broadcast_to([3, 2, 1], found.shape), rtol=1e-5)


# ---- masks and blended layers


def leaf_before_a_floor(alpha, opacities, camera_z, **keys) -> np.ndarray:
    """Floor at z = 0, leaf at z = 1 with `opacities` from left to right, sun along -z, camera above or below the leaf."""
    texels = np.ones((2, len(opacities), 4), np.float32)
    texels[..., 3] = opacities
    leaf = replace(MATT, base_color=(0.1, 0.2, 0.3), alpha=alpha, base_texture=Slot(texture=0))
    texture = Texture(name="leaf", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    camera = looking((0, 0, camera_z), fov_y=np.degrees(2 * np.arctan(0.8 / camera_z)))
    light = replace(DOWN, radiance=(np.pi,) * 3)
    return image(FLOOR, (quad(4, 4), leaf, at(0, 0, 1)), textures=(texture,), camera=camera, lights=(light,), **keys)


def test_a_masked_leaf_is_seen_through_and_lets_the_sun_through():
    found = leaf_before_a_floor("mask", (0.0, 1.0), 100)
    np.testing.assert_allclose(found[:, :6], 0.4, rtol=1e-4)
    np.testing.assert_allclose(found[:, 6:], np.broadcast_to([0.1, 0.2, 0.3], found[:, 6:].shape), rtol=1e-3)
    below = leaf_before_a_floor("mask", (0.0, 1.0), 0.9)  # a wide angle, in which Schlick's grazing term varies
    np.testing.assert_allclose(below[:, :6], 0.4, rtol=0.02)
    assert not below[:, 6:].any()


def test_a_blended_leaf_takes_its_share_of_the_sun():
    found = leaf_before_a_floor("blend", (0.25, 0.25), 0.9, spp=1024)  # from below the leaf
    assert found.mean() == pytest.approx(0.75 * 0.4, rel=0.01)  # 1e5 draws of 0 or 1: 0.2 %; the view varies by 40 degrees


BLACK = Material(name="black", base_color=(0, 0, 0), roughness=1.0, specular=0.0)


@pytest.mark.parametrize("opacity", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("what", ["emission", "reflection"])
def test_blended_layers_are_composited_as_in_raster(what, opacity):
    """Two layers over a floor, in expectation front to back as in `raster`; the floor's light comes from below the layers,
    for `raster`'s layers cast no shadow."""
    glows = what == "emission"
    layer = replace(BLACK, alpha="blend", opacity=opacity, emission=(0.5, 0.1, 0.7) if glows else (0, 0, 0))
    floor = replace(BLACK, emission=(0, 0.4, 0)) if glows else SHINY
    parts = [(quad(50, 50), floor, IDENTITY), (quad(50, 50), layer, at(0, 0, 3)), (quad(50, 50), layer, at(0, 0, 3.2))]
    keys = {"lights": () if glows else (replace(POINT, position=(0, 0, 2)),), "spp": 2048}
    found, expected = (shot(stage(*parts, shading=shading, **keys)).arrays for shading in ("path", "raster"))
    mean, error = mean_and_error(found["color"])
    # what is black reflects Schlick's grazing term: less than 1 % seen along the normal
    assert np.all(np.abs(mean - expected["color"].mean(axis=(0, 1))) < 4 * error + (6e-3 if glows else 1e-5))
    assert np.array_equal(found["emission"], expected["emission"])
    assert np.abs(found["transparency"] - (1 - (1 - opacity) ** 2)).max() < 1e-6


def test_a_cloud_before_the_sky_shines_and_reflects_by_its_opacity():
    """0.25 on the left, 1 on the right; its own light, the sun's that it reflects, and the sky behind it."""
    texels = np.ones((2, 2, 4), np.float32)
    texels[:, 0, 3] = 0.25
    cloud = replace(MATT, alpha="blend", base_texture=Slot(texture=0), emission=(3, 2, 1))
    texture = Texture(name="cloud", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    sky = np.array([0.01, 0.4, 0.7])
    texels = np.zeros((8, 16, 3), np.float32)
    texels[4:] = sky  # below the cloud, where it lights nothing that is seen
    parts = (quad(60, 60), cloud, IDENTITY)
    environment = Environment(name="half", texels=texels, world_from_environment=rotation_from_y_up("Z"))
    found = shot(stage(parts, lights=(DOWN,), sky=environment, textures=(texture,), camera=looking((0, 0, 100), fov_y=20),
                       spp=1024)).arrays  # fmt: skip
    opacity = np.array([0.25, 1])[:, None]
    expected = opacity * (np.array([3, 2, 1]) + (0.4, 0.8, 1.2)) + (1 - opacity) * sky
    # whether a path meets the layer is drawn: the standard deviation is at most half of 3.4, over sqrt(1024)
    assert np.abs(found["color"][:, [0, -1]] - expected).max() < 5 * 0.5 * 3.4 / 32
    assert np.abs(found["emission"] - sky).max() < 1e-3  # that behind the layer, as there is no opaque surface


# ---- light of the sky, of lamps, and between surfaces


def sky_with_one_bright_texel() -> Environment:
    texels = np.full((6, 10, 3), 0.1, np.float32)
    texels[1, 7], texels[4, 2] = (50, 30, 10), (1, 2, 7)
    tilt = look_at(np.zeros(3), np.array([0.3, -0.5, 0.8]), np.array([0.2, 1.0, 0.1]))[:3, :3]
    return Environment(name="one texel", texels=texels, world_from_environment=tilt)


@pytest.fixture(scope="module")
def sky_around() -> tuple[Environment, np.ndarray, np.ndarray, np.ndarray]:
    """(sky, directions [n, 3], radiance [n, 3] as it is seen, solid angles [n])."""
    sky = sky_with_one_bright_texel()
    theta, phi = np.meshgrid((np.arange(360) + 0.5) / 360 * np.pi, np.arange(720) / 720 * 2 * np.pi, indexing="ij")
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    zero, vectors = mi.Vector3f(0), mi.Vector3f(np.ascontiguousarray(around.T, dtype=np.float32))
    built = build_sky(sky, stage().engine.shading.brdf.model)
    radiance = np.array(sky_radiance(built, vectors, zero, zero, mi.Bool(True))).T
    return sky, around, radiance, np.sin(theta).ravel() * (np.pi / 360) ** 2


@pytest.mark.parametrize("material", [MATT, SHINY], ids=["matt", "shiny"])
@pytest.mark.parametrize("facing", [(0, 0, 1), (1, 0.2, -0.3), (-0.5, -0.7, 0.2)])
def test_light_of_the_sky_comes_from_where_it_is_seen(facing, material, sky_around):
    sky, around, radiance, solid_angle = sky_around
    matrix = look_at(np.array(facing, float), np.zeros(3), np.array([0, 1.0, 0]))  # takes +z to `facing`
    matrix[:3, 3] = 0
    normal = matrix[:3, 2]
    found = image((quad(50, 50), material, matrix), sky=sky, camera=looking(tuple(100 * normal)), spp=256)
    mean, error = mean_and_error(found)
    value = reflect(material.base_color, material.metallic, material.roughness, normal, normal, around, material.specular)
    exact = (radiance * value * solid_angle[:, None]).sum(axis=0)
    # 4 standard errors, and 0.2 % for the half precision of texels and the steps of the sum
    assert np.all(error < 0.02 * exact) and np.all(np.abs(mean - exact) < 4 * error + 2e-3 * exact)


def test_smooth_normals_do_not_change_what_a_lamp_gives():
    images = []
    for smooth in (False, True):
        made = stage(FLOOR, (box(smooth), LAMP, at(0, 0.2, 1.2)), camera=looking((3, 0, 3), fov_y=10), spp=512)
        images.append(shot(made).arrays)
    difference = images[0]["color"] - images[1]["color"]
    error = np.sqrt(images[0]["color_variance"] + images[1]["color_variance"])
    assert images[0]["color"].min() > 0 and np.abs(difference.mean()) < 4 * np.sqrt((error**2).sum()) / error.size
    assert (np.abs(difference) <= 5 * error).mean() > 0.999


def test_a_mirror_shows_lights_and_lamps_and_the_sky():
    """Lights with an extent show in reflections: a mirror under a disk, a lamp and sky gives their radiance times F0."""
    mirror = Material(name="mirror", base_color=(0.9, 0.8, 0.7), roughness=0.0, metallic=1.0)
    disk = Light(name="d", kind="disk", radiance=(5, 6, 7), position=(0, 0, 200), direction=(0, 0, -1), half_u=(30, 0, 0),
                 half_v=(0, 30, 0))  # fmt: skip
    expected = {"disk": (5, 6, 7), "lamp": (3, 2, 1), "sky": (0.5, 1, 1.5)}
    for name, radiance in expected.items():
        parts = [(quad(50, 50), mirror, IDENTITY)] + ([(quad(60, 60), LAMP, at(0, 0, 150))] if name == "lamp" else [])
        sky = constant_sky((0.5, 1, 1.5)) if name == "sky" else None
        found = image(*parts, lights=(disk,) if name == "disk" else (), sky=sky, spp=64, camera=looking((0, 0, 100)))
        # at alpha 0.001, the tail of GGX beyond 0.15 rad / 2 holds (0.001 / 0.075)^2; A is 1 to 1e-3
        np.testing.assert_allclose(found.mean(axis=(0, 1)), np.array(radiance) * mirror.base_color, rtol=4e-3)


def mitsuba_scene(camera, depth) -> tuple[mi.Scene, dict]:
    """The scene of `test_it_is_mitsubas_path_tracer`, in Mitsuba's words."""

    def surface(material):
        base = {"type": "rgb", "value": list(material.base_color)}
        return {"type": "metallic_roughness", "base_color": base, "roughness": material.roughness,
                "metallic": material.metallic, "specular": material.specular}  # fmt: skip

    def shape(mesh, material, matrix):
        made = mi.Mesh("m", len(mesh.positions), len(mesh.faces), props=_properties(mi.load_dict(surface(material))))
        parameters = mi.traverse(made)
        world = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        parameters["vertex_positions"] = np.ascontiguousarray(world, dtype=np.float32).ravel()
        parameters["faces"] = mesh.faces.ravel()
        parameters.update()
        return made

    pose = camera.state(0).camera
    flipped = mi.ScalarTransform4f(pose.world_from_camera @ np.diag([-1.0, 1, -1, 1]))
    emitted = {"type": "rgb", "value": [r + s for r, s in zip(SQUARE.radiance, SKY, strict=True)]}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth, "rr_depth": 100},
        "sensor": {"type": "perspective", "fov": float(np.degrees(pose.fov_y)), "fov_axis": "y", "to_world": flipped,
                   "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}}},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": list(SKY)}},
        "square": {"type": "rectangle", "to_world": mi.ScalarTransform4f(SQUARE_MATRIX),
                   "emitter": {"type": "area", "radiance": emitted}},
        **{f"part {k}": shape(*part) for k, part in enumerate(ROOM)},
    })  # fmt: skip


def _properties(bsdf) -> mi.Properties:
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    return properties


SKY = (0.3, 0.4, 0.5)
SQUARE_MATRIX = look_at(np.array([-2.0, 1, 4]), np.zeros(3), np.array([0, 1.0, 0])) @ np.diag([0.7, 0.5, -1, 1])
SQUARE = Light(name="square", kind="rectangle", radiance=(8.0, 7.0, 6.0), position=(-2.0, 1, 4),
               direction=tuple(SQUARE_MATRIX[:3, 2] * 1.0), half_u=tuple(SQUARE_MATRIX[:3, 0]),
               half_v=tuple(SQUARE_MATRIX[:3, 1]))  # fmt: skip
ROOM = [
    (quad(6, 6), Material(name="floor", base_color=(0.5, 0.4, 0.3), roughness=0.25), IDENTITY),
    (box(False), Material(name="mirror", base_color=(0.9, 0.8, 0.7), roughness=0.1, metallic=1.0),
     look_at(np.array([0.6, 0.2, 0.8]), np.array([1.0, 2, 0]), np.array([0, 0, 1.0]))),
    (box(False), Material(name="red", base_color=(0.8, 0.1, 0.1), roughness=0.7), at(-0.7, 0.1, 0.5)),
]  # fmt: skip


@pytest.mark.parametrize("depth", [2, 3, 6])
def test_it_is_mitsubas_path_tracer(depth):
    """Per pixel and colour, within both standard errors. Mitsuba's rectangle hides the sky behind it, ours does not: there it
    shines by the sky's radiance more, and nothing is behind it."""
    register()
    made = stage(*ROOM, lights=(SQUARE,), sky=constant_sky(SKY), camera=looking((2, -4, 2.5), (0, 0, 0.4), fov_y=40, far=1e3),
                 spp=1024, max_depth=depth, antialiasing=64)  # fmt: skip
    found = shot(made, stream="hr").arrays
    scene = mitsuba_scene(made.shoot, depth)
    runs = np.array([np.array(mi.render(scene, spp=128, seed=seed)) for seed in range(8)])
    expected, error = runs.mean(axis=0), runs.std(axis=0, ddof=1) / 8**0.5
    error = np.sqrt(error**2 + found["color_variance"])
    # 64 places of a pixel miss an edge by up to 1/64 of what lies on both sides, here some 1
    beyond = np.abs(found["color"] - expected) - 0.015
    assert (beyond > 4 * error).mean() < 0.01
    mean = np.sqrt((error**2).sum(axis=(0, 1))) / error[..., 0].size
    assert np.all(np.abs((found["color"] - expected).mean(axis=(0, 1))) < 4 * mean + 2e-3)
    assert np.all(mean < 0.01)


def test_roulette_does_not_change_the_mean(monkeypatch):
    """Inside a closed box of bright metal that shines: half of its light has more than six edges."""
    metal = Material(name="m", base_color=(0.9, 0.9, 0.9), roughness=0.2, metallic=1.0, emission=(1, 1, 1))
    found = {}
    for sure in (framepairs.path_tracing.SURE_DEPTH, 100):
        monkeypatch.setattr(framepairs.path_tracing, "SURE_DEPTH", sure)
        made = stage((box(False), metal, IDENTITY), camera=looking((0, 0, 0.3), fov_y=60, near=1e-3), spp=256, max_depth=40)
        arrays = shot(made).arrays
        found[sure] = arrays["color"].mean(), np.sqrt(arrays["color_variance"].mean() / arrays["color"][..., 0].size)
    (short, error), (long, other) = found.values()
    assert error < 0.01 * short and abs(short - long) < 4 * np.hypot(error, other)


# ---- what it says of its noise


NOISY = {
    "lights": (replace(POINT, position=(0.3, 0.1, 0.4)), replace(POINT, radiance=(30, 20, 10))),
    "sky": constant_sky((1, 2, 3)),
}


@pytest.mark.parametrize("keys, stream, least", [
    ({"spp": 16}, "lr_x1", 0.8), ({"spp": 64, "antialiasing": 4}, "hr", 0.8), ({"spp": 16, "antialiasing": 16}, "hr", 0.5),
], ids=["lr", "hr", "hr, one path each"])  # fmt: skip
def test_variance_is_that_of_the_mean(keys, stream, least):
    """Against the spread over 24 seeds. With one path per AA position, what differs between them counts as noise."""
    parts = [FLOOR, (box(False), SHINY, at(-0.6, 0, 0.5) @ np.diag([0.5, 0.5, 1, 1]))]
    made = stage(*parts, camera=looking((1, 1, 9), fov_y=20), **NOISY, **keys)
    shots = [shot(made, seed, stream).arrays for seed in range(24)]
    spread = np.var([one["color"] for one in shots], axis=0, ddof=1).sum()
    told = np.mean([one["color_variance"] for one in shots], axis=0).sum()
    # 96 pixels of 23 degrees of freedom, some of which have most of the variance
    assert spread > 0 and least < spread / told < 1.25
    assert not shot(stage(*parts, shading="raster", **NOISY)).arrays["color_variance"].any()


def rare_light(**keys) -> tuple[Stage, float, float]:
    """(a floor under a weak light nearby and a strong one far away, probability of the former, its share of the light)."""
    near, far = 0.02, 100.0
    weak = replace(POINT, position=(0, 0, near), radiance=(1, 1, 1))
    strong = replace(POINT, position=(0, 0, far), radiance=(100, 100, 100))
    camera = looking((0, 0, 1e-2), fov_y=1, near=1e-4)
    made = stage(FLOOR, lights=(strong, weak), camera=camera, spp=8, display=(64, 32), **keys)
    choice = np.array(lights_around(made.engine.scene, made.engine.shading.mesh_lights, made.shoot.state(0)).choice)
    return made, float(choice[1]), (1 / near**2) / (1 / near**2 + 100 / far**2)


def test_fireflies_are_counted():
    """A pixel has one where exactly one of its 8 paths drew the near light."""
    made, chance, share = rare_light()
    found = shot(made)
    pixels = 64 * 32
    expected = 8 * chance * (1 - chance) ** 7
    assert share > 0.999 and 0.05 < expected < 0.6
    assert abs(found.fireflies / pixels - expected) < 5 * np.sqrt(expected / pixels)
    assert found.rejected_paths == 0
    assert shot(stage(FLOOR, lights=(DOWN,), spp=8)).fireflies == 0


def test_clamping_limits_each_path_and_only_when_the_plan_says_so():
    free, clamped = (shot(rare_light(clamp_radiance=limit)[0]).arrays["color"] for limit in (None, 2.0))
    assert free.max() > 100 and clamped.max() <= 2.0 + 1e-5
    assert np.array_equal(clamped > 1e-2, free > 1e-2)
    lit = free.max(axis=(1, 2)).max() / 8  # no path brings more than all of a pixel
    untouched = shot(rare_light(clamp_radiance=float(lit) * 1e3)[0]).arrays["color"]
    np.testing.assert_array_equal(untouched, free)


def test_paths_that_are_not_finite_count_as_nothing():
    lights = (replace(POINT, position=(0, 0, 0.005), radiance=(1e38,) * 3),)  # over the squared distance, beyond float32
    found = shot(stage(FLOOR, lights=lights, spp=4, camera=looking((0, 0, 1e-3), near=1e-4)))
    assert found.rejected_paths == 4 * SIZE[0] * SIZE[1] and not found.arrays["color"].any()


# ---- calls, frames, seeds


def moving_stage(**keys) -> Stage:
    """A lamp that turns and stretches over the floor, and a moving camera: four frames."""
    turns = [np.eye(4), at(0.3, 0.1, 1.5) @ np.diag([1, -0.7, 1.2, 1]), at(-0.5, 0.2, 1.1), np.diag([2.0, 1, 1, 1])]
    cameras = [look_at(np.array([k, 0.3 * k, 30.0]), np.zeros(3), np.array([0, 1.0, 0])) for k in range(4)]
    parts = [FLOOR, (box(True), LAMP, lambda time: turns[min(round(time), 3)])]
    return stage(*parts, camera=path_of(*cameras, fov_y_deg=5), lights=(POINT,), sky=constant_sky((1, 1, 1)), **keys)


def test_any_frame_alone_equals_itself_in_the_sequence_to_the_byte():
    keys = {"spp": 8, "max_depth": 4}
    alone = [shot(moving_stage(**keys), 0, "lr_x1", frame).arrays["color"].tobytes() for frame in range(4)]
    assert len(set(alone)) == 4
    made = moving_stage(**keys)
    for frame in (0, 1, 2, 3, 1, 0, 2):
        assert shot(made, 0, "lr_x1", frame).arrays["color"].tobytes() == alone[frame]


def test_seed_frame_and_stream_change_the_noise_but_not_the_mean():
    made = stage(FLOOR, sky=sky_with_one_bright_texel(), spp=64, camera=path_of(*[at(0, 0, 100)] * 2, fov_y_deg=1),
                 variants=("native", "jittered"))  # fmt: skip
    other = next(name for name in made.streams if "jittered" in name)
    shots = [shot(made), shot(made, 2), shot(made, frame=1), shot(made, stream=other)]
    images = [one.arrays["color"] for one in shots]
    assert len({one.tobytes() for one in images}) == 4
    means, errors = zip(*(mean_and_error(one) for one in images), strict=True)
    for mean, error in zip(means[1:], errors[1:], strict=True):
        assert np.all(np.abs(mean - means[0]) < 4 * np.hypot(error, errors[0]))


@pytest.mark.parametrize("seed", [0, 12345])
def test_neighbouring_pixels_are_independent(seed):
    """The mean over blocks of 64 pixels varies by 1/64 of a pixel's variance: PCG's neighbouring sequences alone do not."""
    numbers = random_numbers(dr.arange(mi.UInt32, 1 << 16), seed)
    for _ in range(8):
        values = np.array(numbers.next_float32(), np.float64).reshape(-1, 64)
        ratio = values.mean(axis=1).var() * 64 * 12
        assert abs(ratio - 1) < 5 * np.sqrt(2 / len(values))  # chi square of 1024 blocks
        assert abs(values.mean() - 0.5) < 5 / np.sqrt(12 * values.size)


def test_size_of_the_scene_does_not_matter():
    """A scene 2^16 times smaller gives the same bytes: ray offsets are shares of the distances at play."""
    images = []
    for scale in (1.0, 2.0**-16):
        shrunk = np.diag([scale, scale, scale, 1])
        light = replace(POINT, radiance=(9 * scale**2,) * 3, position=(scale, 2 * scale, 3 * scale))
        parts = [(quad(4, 4), MATT, shrunk), (box(True), LAMP, shrunk @ at(0, 0.2, 1.2))]
        camera = looking((3 * scale, 0, 9 * scale), fov_y=20, near=0.5 * scale, far=1e3 * scale)
        images.append(image(*parts, lights=(light,), sky=constant_sky((1, 1, 1)), camera=camera, spp=4, max_depth=4))
    # the choice between lights sees the scene's size in float64
    assert images[0].std() > 0 and (np.abs(images[1] - images[0]) > 1e-5 * images[0].max()).mean() < 0.01


BALLS = [replace(POINT, kind="sphere", position=(k % 20, k // 20, 1 + k % 3), half_u=(0.1, 0, 0)) for k in range(300)]


@pytest.mark.parametrize("keys, lit", [
    ({}, False), ({"sky": constant_sky((1, 1, 1))}, True), ({"lights": (DOWN,)}, True), ({"lights": BALLS}, True),
    ({"lights": (replace(POINT, radiance=(0, 0, 0)),)}, False),
], ids=["no light", "sky only", "black sky", "hundreds of lights", "black light"])  # fmt: skip
def test_any_set_of_lights_gives_finite_colours(keys, lit):
    parts = (FLOOR, (box(True), SHINY, at(0, 0, 0.5)))
    found = shot(stage(*parts, spp=4, max_depth=4, camera=looking((3, 1, 9), fov_y=20), **keys))
    color = found.arrays["color"]
    assert np.isfinite(color).all() and found.rejected_paths == 0 and color.any() == lit


def test_frames_share_their_kernels_and_trace_their_paths_once():
    made = moving_stage(spp=4, max_depth=4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for frame in range(4):
            dr.kernel_history_clear()
            shot(made, frame, frame=frame)
            kernels = [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]
            assert kernels and (frame < 2 or all(entry["cache_hit"] for entry in kernels))
            sizes = sorted(entry["operation_count"] for entry in kernels)
            assert len(sizes) == 1 or sizes[-2] < sizes[-1] / 2  # the second would trace the paths again for what it counts
