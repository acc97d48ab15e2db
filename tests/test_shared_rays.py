"""Streams that sample the same places share rays: each must be, byte for byte, what it is when rendered alone."""

import numpy as np
import pytest

from analytic import ALL, Stage, at, constant_sky, make_scene, path_of, quad
from framepairs.backend import dr, mi
from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.engine import Engine, fetch
from framepairs.frame import Shoot
from framepairs.lanes import array_of, image_of, lanes_of, pixels_of
from framepairs.plan import make_plan, plan_streams
from framepairs.scene import light_scene, load_scene
from framepairs.scene.description import Light, Material, Slot, Texture
from sample_corpus import two_quads

VARIANTS = ("native", "jittered", "mip", "jittered_mip")


def assert_equal_alone_and_together(engine, state, streams):
    together = fetch(engine.launch(state, streams, ALL, 0))
    assert [each.stream for each in together] == list(streams)
    for each in together:
        alone = engine.render(state, each.stream, ALL, 0)
        assert (alone.jitter, alone.arrays.keys()) == (each.jitter, each.arrays.keys())
        for name, array in alone.arrays.items():
            assert array.dtype == each.arrays[name].dtype, (each.stream.name, name)
            assert array.tobytes() == each.arrays[name].tobytes(), (each.stream.name, name)
    return {each.stream.name: each.arrays for each in together}


def leaves(seed: int = 3) -> Texture:
    """Alpha in specks of one texel: every level passes another alpha test."""
    texels = np.random.default_rng(seed).integers(0, 256, (128, 128, 4), dtype=np.uint8)
    return Texture(name="leaves", texels=texels, srgb=False)


def leafy_stage(**plan) -> Stage:
    """A masked quad slides before another masked quad and an opaque one, under a camera that moves."""
    slot = Slot(texture=0)
    masked = Material(name="masked", alpha="mask", alpha_cutoff=0.5, base_texture=slot, normal_texture=slot)
    far = Material(name="far", base_texture=slot, roughness=0.4)
    scene = make_scene(
        (quad(3, 3), masked, lambda time: at(0.3 * time - 0.4, 0, -2)),
        (quad(3, 3), masked, at(-0.1, 0, -3)),
        (quad(9, 9), far, at(0, 0, -5)),
        textures=(leaves(),),
        sky=constant_sky((0.5, 0.6, 0.8)),
        lights=(Light(name="sun", kind="directional", radiance=(2, 2, 1.8), direction=(0.36, -0.48, -0.8)),),
    )
    cameras = path_of(*[at(0.05 * k, 0.02 * k, 0) for k in range(4)])
    return Stage(scene, cameras, **{"display": (90, 54), "variants": VARIANTS, **plan})


def test_streams_of_the_market_are_the_same_alone_and_together():
    scene, _ = light_scene(load_scene(find_scene("market")), None)
    plan = make_plan({"display": (320, 180), "scales": (2,), "variants": VARIANTS, "antialiasing": 2, "channels": "all"})
    shoot = Shoot(scene, read_camera_path(find_camera_path("market")), 320 / 180)
    arrays = assert_equal_alone_and_together(Engine(scene, plan), shoot.state(10), plan_streams(plan))
    assert not np.array_equal(arrays["lr_x2"]["albedo"], arrays["lr_x2_mip-1"]["albedo"])


def test_alpha_tests_that_end_differently_are_made_anew():
    """Sizes that are no multiples of 4, hits that depend on the bias, in this frame and in the one before."""
    stage = leafy_stage()
    arrays = assert_equal_alone_and_together(stage.engine, stage.shoot.state(2), list(stage.streams.values()))
    ids, mip_ids = (arrays[name]["object_id"] for name in ("lr_x2", "lr_x2_mip-1"))
    assert 0.005 < (ids != mip_ids).mean() < 0.5
    motion = (arrays[name]["dual_motion"][ids[..., 0] == mip_ids[..., 0]] for name in ("lr_x2", "lr_x2_mip-1"))
    assert not np.array_equal(*motion)


def test_path_shading_is_the_same_alone_and_together():
    stage = leafy_stage(shading="path", samples_per_pixel=4, max_depth=3)
    assert_equal_alone_and_together(stage.engine, stage.shoot.state(1), list(stage.streams.values()))


def test_shared_streams_run_each_pass_once():
    stage = Stage(two_quads(), path_of(np.eye(4), at(0.1, 0, 0)), variants=("native", "mip"))
    stage.engine.launch(stage.shoot.state(1), [stage.streams[name] for name in ("lr_x2", "lr_x2_mip-1")], ALL, 0)
    assert {name: stage.engine.passes[name] for name in ("gbuffer", "motion", "dual_motion", "radiance")} == {
        "gbuffer": 1, "motion": 1, "dual_motion": 1, "radiance": 1,
    }  # fmt: skip


@pytest.mark.parametrize("size", [(7, 5), (8, 4), (1, 9), (16, 12)])
def test_tiles_cover_every_pixel_once(size):
    width, height = size
    lanes = lanes_of(size)
    image = image_of(lanes, mi.Vector3f(lanes.x, lanes.y, mi.Float(lanes.index)))
    numbers = image_of(lanes, lanes.index)
    dr.eval(image, numbers)
    array, rows = array_of(image, size), np.arange(width * height).reshape(height, width)
    assert array.shape == (height, width, 3) and array.flags.c_contiguous and array.dtype == np.float32
    assert np.array_equal(array, np.dstack([rows % width, rows // width, rows]))
    assert np.array_equal(array_of(numbers, size)[..., 0], rows) and array_of(numbers, size).dtype == np.uint32
    inside, index = np.array(lanes.inside), np.array(lanes.index)
    assert sorted(index[inside]) == list(range(width * height))
    assert np.array_equal(np.array(pixels_of(lanes, dr.arange(mi.Float, width * height))), index)


def test_a_packet_is_a_tile():
    lanes = lanes_of((13, 6))
    for values, extent in ((lanes.x, 13), (lanes.y, 6)):
        packets = np.array(values).reshape(-1, 16)
        assert (np.ptp(packets, axis=1) <= 3).all() and packets.max() == extent - 1
