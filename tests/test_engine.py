"""What the engine compiles and runs: one kernel per pass, replayed; passes that nobody needs never run."""

import random

import numpy as np

from analytic import ALL, Stage, at, make_scene, path_of, quad
from framepairs.backend import dr, mi
from framepairs.engine import fetch
from framepairs.scene.description import Material
from sample_corpus import two_quads

GRAY = Material(name="gray")


def compilations(history) -> int:
    return sum(1 for entry in history if entry["type"] == dr.KernelType.JIT and not entry["cache_hit"])


def test_no_kernel_is_compiled_after_the_second_frame():
    stage = Stage(two_quads(), path_of(*[at(0.01 * k, 0, 0) for k in range(6)]), scales=(2, 3))
    counts = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for frame in range(6):
            dr.kernel_history_clear()
            for stream in stage.streams:
                stage.arrays(frame, stream)
            counts.append(compilations(dr.kernel_history()))
    assert counts[2:] == [0, 0, 0, 0], counts


def test_no_kernel_is_compiled_after_the_second_frame_of_all_streams_together():
    """Things that move, all channels, two scales in all variants, launched at once."""
    cameras = [at(0.01 * k, 0, 0) for k in range(6)]
    stage = Stage(two_quads(), path_of(*cameras), scales=(2, 3), variants=("native", "jittered", "mip", "jittered_mip"))
    counts = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for frame in range(6):
            dr.kernel_history_clear()
            fetch(stage.engine.launch(stage.shoot.state(frame), list(stage.streams.values()), ALL, 0))
            counts.append(compilations(dr.kernel_history()))
    assert counts[2:] == [0, 0, 0, 0], counts


def test_the_counter_of_compilations_counts():
    """Kernels of earlier runs lie on the disk and are none; one with a number of its own is."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for _ in range(2):
            dr.eval(dr.arange(mi.Float, 7) * random.random())  # a literal: it is baked in
        assert compilations(dr.kernel_history()) == 2


def test_passes_that_no_channel_asks_for_do_not_run():
    stage = Stage(make_scene((quad(4, 4), GRAY, at(0, 0, -2))), path_of(np.eye(4), at(0.1, 0, 0)))
    stage.arrays(1, "hr", frozenset({"depth"}))
    assert stage.engine.passes == {**dict.fromkeys(stage.engine.passes, 0), "brdf_table": 1, "gbuffer": 1}
    stage.arrays(1, "hr", frozenset({"motion"}))
    assert (stage.engine.passes["motion"], stage.engine.passes["dual_motion"]) == (1, 0)
    stage.arrays(1, "hr", ALL)
    assert (stage.engine.passes["dual_motion"], stage.engine.passes["radiance"]) == (1, 1)


def test_a_channel_is_the_same_whatever_else_is_rendered():
    stage = Stage(two_quads(), path_of(np.eye(4), at(0.1, 0, 0)))
    whole = stage.arrays(1, "lr_x2", ALL)
    assert set(whole) == set(ALL)
    for name in ("motion", "color", "depth"):
        assert np.array_equal(stage.arrays(1, "lr_x2", frozenset({name}))[name], whole[name]), name


def test_lr_is_rendered_not_downsampled():
    """An LR pixel without jitter is one sample at its centre: at scale 2, HR's samples lie beside it, so the images differ."""
    stage = Stage(two_quads(), path_of(np.eye(4)), display=(96, 54))
    lr, hr = stage.arrays(0, "lr_x2"), stage.arrays(0, "hr")
    for name in ("color", "albedo"):
        mean = hr[name].reshape(27, 2, 48, 2, 3).mean((1, 3))
        assert np.abs(lr[name] - mean).mean() > 0.01, name
