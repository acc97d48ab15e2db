"""The bundled scene: its path, what stands still, and that it needs every channel its README names."""


import numpy as np
import pytest

from analytic import plan_of
from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.corpus import Corpus
from framepairs.frame import Shoot
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene import light_scene, load_scene
from framepairs.scene.needs import channel_needs
from framepairs.validate import validate_corpus


@pytest.fixture(scope="module")
def market():
    return light_scene(load_scene(find_scene("market")), None)[0]


@pytest.fixture(scope="module")
def shoot(market):
    return Shoot(market, read_camera_path(find_camera_path("market")), 16 / 9)


def test_the_path_is_a_pan_a_cut_and_sixteen_frames_in_which_everything_stops(shoot):
    assert len(shoot) == 32
    states = [shoot.state(frame) for frame in range(32)]
    assert [state.frame for state in states if state.reset] == [0, 16]
    for state in states[17:]:
        assert np.array_equal(state.camera.world_from_camera, states[16].camera.world_from_camera)
        assert np.array_equal(state.objects.world_from_object, states[16].objects.world_from_object)
    for state in states[1:16]:
        assert not np.array_equal(state.camera.world_from_camera, state.previous_camera.world_from_camera)
        assert not np.array_equal(state.objects.world_from_object, state.previous_objects.world_from_object)


def test_everything_in_it_is_read_and_nearly_every_channel_needed(market, shoot):
    assert market.not_read == () and not [m.name for m in market.materials if m.not_read]
    constant = {name for name, need in channel_needs(market, shoot.samples, plan_of()).items() if not need.needed}
    assert constant <= {"specular", "transparency", "overlay", "color_variance"}


def test_rendered_small_it_passes_validation_and_stands_still(market, tmp_path):
    path = read_camera_path(find_camera_path("market"))
    job = Job(
        scene=market, scene_name="market", environment=None, path=path, path_name="market", out=tmp_path / "c",
        plan=plan_of(display=(320, 180), scales=(2,)),
    )  # fmt: skip
    list(render_sequence(job, range(13, 19)))
    results = {result.id: result for result in validate_corpus(Corpus(tmp_path / "c"))}
    assert {id: result.worst for id, result in results.items() if result.verdict == "fail"} == {}
    assert results["still"].verdict == "pass"  # frames 17 and 18
    corpus = Corpus(tmp_path / "c")
    for frame in (14, 15):
        bits = corpus.read("market_market", "hr", "visibility", frame)
        hidden = (bits & 4 == 0) & (bits & 1 == 1)
        assert 0.002 < hidden.mean() < 0.3  # occlusion happens
        dual, motion = (corpus.read("market_market", "hr", name, frame) for name in ("dual_motion", "motion"))
        assert np.any(dual[hidden[..., 0]] != motion[hidden[..., 0]])
    color = corpus.read("market_market", "hr", "color", 14)
    assert 0.05 < np.median(color) < 0.6 and np.isfinite(color).all()
