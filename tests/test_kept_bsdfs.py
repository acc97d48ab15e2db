"""BSDFs that `path` leaves to Mitsuba: against Mitsuba's own path tracer, against energy, and left out of demodulation."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from analytic import Stage, at, constant_sky, make_scene, path_of, quad, uv_sphere
from framepairs.backend import mi
from framepairs.errors import InputError
from framepairs.scene.description import Light, Material
from framepairs.transforms import look_at

pytestmark = pytest.mark.renders

SIZE = (12, 8)
MATRIX = look_at(np.array([2.0, 1.5, 6.0]), np.zeros(3), np.array([0.0, 1, 0]))
PATH = {"shading": "path", "scales": (1,), "variants": ("native",), "display": SIZE, "antialiasing": 1, "max_depth": 8}
GRAY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.4, 0.4, 0.4]}}
SUN = Light(name="sun", kind="directional", radiance=(2, 1.5, 1), direction=(0, -0.8, -0.6))
RED = {"type": "rgb", "value": [0.8, 0.2, 0.1]}
CHECKER = {"type": "checkerboard", "color0": RED, "color1": {"type": "rgb", "value": [0.1, 0.3, 0.9]}}
CHECKER |= {"to_uv": [[4, 0, 0, 0], [0, 3, 0, 0.25], [0, 0, 1, 0], [0, 0, 0, 1]]}
KEPT = {
    "dielectric": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0},
    "thindielectric": {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0},
    "roughdielectric": {"type": "roughdielectric", "alpha": 0.3, "int_ior": 1.4, "ext_ior": 1.0},
    "beckmann": {"type": "roughconductor", "distribution": "beckmann", "alpha": 0.3, "material": "Au"},
    "brushed": {"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.6, "material": "none"},
    "mirror": {"type": "conductor", "material": "Cu"},
    "plastic": {"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": CHECKER},
    "blend": {"type": "blendbsdf", "weight": 0.3, "a": GRAY, "b": {"type": "conductor", "material": "Au"}},
    "twosided": {"type": "twosided", "front": {"type": "plastic", "diffuse_reflectance": RED}},
}


def stage(bsdf, sky=constant_sky((0.5, 0.7, 1.0)), lights=(SUN,), spp=64, **plan) -> Stage:
    glass = Material(name="kept", bsdf=bsdf, alpha="blend" if bsdf["type"] == "dielectric" else "opaque", opacity=0.1)
    floor = Material(name="floor", base_color=(0.4, 0.4, 0.4), specular=0, roughness=1)
    scene = make_scene(
        (uv_sphere(), glass, at(0, 0, 0)),
        (quad(20, 20), floor, at(0, -1.5, 0) @ look_at(np.zeros(3), np.array([0, -1.0, 0]), np.array([0, 0, 1.0]))),
        sky=sky,
        lights=lights,
    )
    return Stage(scene, path_of(MATRIX, fov_y_deg=35), **(PATH | {"samples_per_pixel": spp} | plan))


def drawn(made: Stage, seed: int = 0) -> dict[str, np.ndarray]:
    channels = frozenset({"color", "emission", "brdf", "transparency", "object_id"})
    return made.engine.render(made.shoot.state(0), made.streams["lr_x1"], channels, seed).arrays


def mitsuba_scene(bsdf: dict) -> mi.Scene:
    from framepairs.kept_bsdfs import _for_mitsuba

    def shape(mesh, matrix, surface):
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(_for_mitsuba(surface))
        has = {"has_vertex_normals": True, "has_vertex_texcoords": True}
        made = mi.Mesh("m", len(mesh.positions), len(mesh.faces), props=properties, **has)
        parameters = mi.traverse(made)
        parameters["vertex_positions"] = (mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32).ravel()
        parameters["vertex_normals"] = (mesh.normals @ matrix[:3, :3].T).astype(np.float32).ravel()
        parameters["vertex_texcoords"] = np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=1).ravel()
        parameters["faces"] = mesh.faces.ravel()
        parameters.update()
        return made

    down = at(0, -1.5, 0) @ look_at(np.zeros(3), np.array([0, -1.0, 0]), np.array([0, 0, 1.0]))
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": PATH["max_depth"], "rr_depth": 100},
        "sensor": {
            "type": "perspective", "fov": 35, "fov_axis": "y", "near_clip": 0.01, "far_clip": 1000,
            "to_world": mi.ScalarTransform4f(MATRIX @ np.diag([-1.0, 1, -1, 1])),
            "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.5, 0.7, 1.0]}},
        "sun": {"type": "directional", "direction": [0, -0.8, -0.6], "irradiance": {"type": "rgb", "value": [2, 1.5, 1]}},
        "ball": shape(uv_sphere(), np.eye(4), bsdf),
        "floor": shape(quad(20, 20), down, GRAY),
    })  # fmt: skip


@pytest.mark.parametrize("name", KEPT)
def test_it_is_mitsubas(name):
    compare(KEPT[name])


@pytest.mark.parametrize("along", [0, 1])
def test_bumps_are_mitsubas(tmp_path, along):
    """They ask for the derivatives of the place by u and v, with their lengths and signs."""
    wave = np.sin(np.arange(64) / 64 * 2 * np.pi * 4)
    texels = np.broadcast_to(np.moveaxis(wave[None, :], 1, 1 - along), (64, 64)) * 100 + 128
    Image.fromarray(texels.astype(np.uint8)).save(tmp_path / "wave.png")
    image = {"type": "bitmap", "filename": str(tmp_path / "wave.png"), "raw": True}
    compare({"type": "bumpmap", "arbitrary": image, "scale": 0.1, "inner": KEPT["beckmann"]})


def compare(bsdf: dict) -> None:
    """Means over the frame and its middle: ours has one ray per pixel's centre, Mitsuba's the pixel's area; AA makes both the
    area."""
    made = stage(bsdf, spp=256, antialiasing=64)
    ours = np.array([
        made.engine.render(made.shoot.state(0), made.streams["hr"], frozenset({"color"}), seed).arrays["color"]
        for seed in range(6)
    ])  # fmt: skip
    scene = mitsuba_scene(bsdf)
    theirs = np.array([np.array(mi.render(scene, spp=256, seed=seed)) for seed in range(6)])
    for group in (lambda a: a.mean(axis=(1, 2)), lambda a: a[:, 3:5, 5:7].mean(axis=(1, 2))):
        a, b = group(ours.astype(float)), group(theirs.astype(float))
        error = np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b))
        # 5 standard errors of 6 runs each, and 0.01: 64 fixed places miss an edge by up to 1/64 of what lies on both sides
        assert (np.abs(a.mean(axis=0) - b.mean(axis=0)) < 5 * error + 0.01).all(), (a.mean(0), b.mean(0), error)


@pytest.mark.parametrize("name", ["dielectric", "thindielectric"])
def test_clear_glass_in_a_furnace_is_not_seen(name):
    made = stage(KEPT[name], sky=constant_sky((1, 1, 1)), lights=(), spp=64, max_depth=64)
    arrays = drawn(made)
    assert arrays["color"].max() < 1 + 1e-4  # the floor reflects 0.4 of it
    sky_only = replace(made.engine.scene, objects=made.engine.scene.objects[:1])
    alone = Stage(
        replace(sky_only, world_from_object=lambda time: np.eye(4)[None]), path_of(MATRIX, fov_y_deg=35),
        **(PATH | {"samples_per_pixel": 16, "max_depth": 64}),
    )  # fmt: skip
    color = drawn(alone)["color"]
    # Every path ends in the sky: nothing is lost but what total reflection keeps inside for more than 64 bounces; roulette
    # keeps the mean, and 16 paths of survival 0.95 spread by less than a tenth each.
    assert np.abs(color - 1).mean() < 0.01


def test_a_mask_of_one_opacity_takes_its_share():
    """A sunlit plate before nothing: half of it lets the black sky through."""
    plate = {"type": "diffuse", "reflectance": RED}
    means = []
    for bsdf in (plate, {"type": "mask", "opacity": 0.5, "inner": plate}):
        scene = make_scene((quad(9, 9), Material(name="kept", bsdf=bsdf), at(0, 0, 0)), lights=(SUN,))
        made = Stage(scene, path_of(at(0, 0, 3)), **(PATH | {"samples_per_pixel": 256, "max_depth": 3}))
        means.append(drawn(made)["color"].mean(axis=(0, 1)))
    # 96 pixels of 256 paths, each lit or not: a standard error of 0.5 / sqrt(24576)
    assert np.abs(means[1] / means[0] - 0.5).max() < 4 * 0.5 / 24576**0.5


def test_what_mitsuba_draws_is_divided_by_one():
    arrays = drawn(stage(KEPT["beckmann"]))
    ball = arrays["object_id"][..., 0] == 1
    assert (arrays["brdf"][ball] == 1).all()
    assert np.allclose(arrays["brdf"][arrays["object_id"][..., 0] == 2], 0.4)
    raster = drawn(stage(KEPT["beckmann"], shading="raster"))
    assert (raster["brdf"][ball] != 1).any()  # raster draws a stand-in of ours, which has a F_beta


def test_light_goes_through_glass_that_is_blended_for_raster():
    """It is met whole in `path`, whatever opacity stands for it in `raster`."""
    arrays = drawn(stage(KEPT["dielectric"]))
    assert (arrays["object_id"] == 2).sum() > 0 and not (arrays["object_id"] == 1).any()
    assert arrays["transparency"][4, 6] == 1


def test_a_bsdf_that_mitsuba_refuses_is_named():
    with pytest.raises(InputError, match="kept: Mitsuba refuses this BSDF"):
        stage({"type": "dielectric", "int_ior": "no such glass"})


def test_equal_frames_are_equal_to_the_byte():
    first, second = (drawn(stage(KEPT["roughdielectric"]), seed=3)["color"] for _ in range(2))
    assert np.array_equal(first, second)
