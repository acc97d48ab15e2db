"""Corpora of varied content: the same camera and object ids, other pictures; repeated by `regenerate`."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from analytic import plan_of
from framepairs.bundled import find_scene
from framepairs.cli import app
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.manifest import SequenceRecord
from framepairs.options import make_job, stored_job
from framepairs.pipeline import render_sequence
from framepairs.scene.variation_file import variation_beside
from test_cli import TINY
from test_cli_scenes import stage

FRAME = 15
SEEDS = (None, 1, 2, 3)


def job_of(folder, seed):
    plan = plan_of(display=(160, 90), channels="needed", variants=("native",))
    return make_job("market", find_scene("market"), None, plan, folder, vary=seed, overlay="none")


def shown(color: np.ndarray) -> np.ndarray:
    """Reinhard's curve, x / (1 + x): 0 to 1."""
    return color / (1 + color)


@pytest.fixture(scope="module")
def market(tmp_path_factory):
    """Jobs and the corpus of one frame of the market as it is and under three seeds."""
    folder = tmp_path_factory.mktemp("varied") / "c"
    jobs = {seed: job_of(folder, seed) for seed in SEEDS}
    for job in jobs.values():
        list(render_sequence(job, [FRAME]))
    return jobs, Corpus(folder)


def test_every_seed_has_the_same_camera_bit_for_bit(market):
    jobs, corpus = market
    records = {seed: corpus.record(job.sequence, FRAME) for seed, job in jobs.items()}
    for seed in SEEDS[1:]:
        assert records[seed].camera == records[None].camera and records[seed].exposure_ev == records[None].exposure_ev
        assert {name: stream.jitter for name, stream in records[seed].streams.items()} == {
            name: stream.jitter for name, stream in records[None].streams.items()
        }
        for frame in range(len(jobs[None].shoot)):
            now, then = (jobs[key].shoot.camera(frame) for key in (seed, None))
            assert np.array_equal(now.world_from_camera, then.world_from_camera)
            assert (now.fov_y, now.near, now.far) == (then.fov_y, then.near, then.far)


def test_seeds_differ_visibly(market):
    """A picture as bright in which every pixel errs by 8 codes of 255 differs by 0.03."""
    jobs, corpus = market
    pictures = [shown(corpus.read(job.sequence, "hr", "color", FRAME)) for job in jobs.values()]
    for a in range(len(pictures)):
        for b in range(a):
            assert np.abs(pictures[a] - pictures[b]).mean() > 0.03, (SEEDS[a], SEEDS[b])
    for picture in pictures:
        assert np.isfinite(picture).all() and 0.02 < np.median(picture) < 0.6


def test_object_ids_name_the_same_objects(market):
    """What does not move and is not placed otherwise is seen where it was, under the same id."""
    jobs, corpus = market
    entries = {seed: corpus.sequence(job.sequence) for seed, job in jobs.items()}
    assert all(entry.objects == entries[None].objects for entry in entries.values())
    names = [None, *entries[None].objects]
    ids = {seed: corpus.read(job.sequence, "hr", "object_id", FRAME)[..., 0] for seed, job in jobs.items()}
    houses = [index for index, name in enumerate(names) if name and name.split("/")[2] in ("Ground", "Cream", "Rose", "Brick")]
    for seed in SEEDS[1:]:
        both = np.isin(ids[seed], houses) & np.isin(ids[None], houses)
        assert both.mean() > 0.3 and np.array_equal(ids[seed][both], ids[None][both])
        drawn = {names[index].split("/")[2] for index in np.unique(ids[seed]) if index}
        assert {"Hero", "Pottery", "Cloth", "Bunting"} <= drawn
        gone = [k for k, item in enumerate(jobs[seed].scene.objects, 1) if not len(jobs[seed].scene.meshes[item.mesh].faces)]
        assert gone and not np.isin(ids[seed], gone).any()


def test_needs_and_records_are_those_of_the_varied_scene(market):
    jobs, corpus = market
    for seed in SEEDS[1:]:
        entry, objects = corpus.sequence(jobs[seed].sequence), jobs[seed].scene.objects
        assert entry.variation == seed and jobs[seed].sequence == f"market_market_vary{seed}"
        assert entry.moving == [k for k, item in enumerate(objects, 1) if item.moves]
        assert set(entry.moving) <= set(corpus.sequence(jobs[None].sequence).moving)
        assert {name for name, need in jobs[seed].needs.items() if need.needed} >= {"motion", "albedo", "emission", "roughness"}
    old = entry.model_dump(mode="json")
    del old["variation"]
    assert SequenceRecord.model_validate(old).variation is None  # records from before there were variations


def test_a_frame_of_a_seed_is_rendered_again_bit_for_bit(market, tmp_path):
    jobs, corpus = market
    entry = corpus.sequence(jobs[2].sequence)
    job, _ = stored_job(entry, None, corpus.manifest.plan, tmp_path / "again")
    list(render_sequence(job, [FRAME]))
    again = Corpus(tmp_path / "again")
    for channel in ("color", "object_id", "motion"):
        assert np.array_equal(
            again.read(job.sequence, "hr", channel, FRAME), corpus.read(jobs[2].sequence, "hr", channel, FRAME)
        )


def test_the_scenes_hash_holds_the_sidecar_only_where_it_counts(tmp_path):
    file = stage(tmp_path)
    hash_of = lambda seed: make_job("m", file, None, plan_of(), tmp_path, vary=seed).scene_sha256  # noqa: E731
    bare = hash_of(None)
    assert hash_of(1) == bare  # no sidecar: the default variation
    variation_beside(file).write_text('{"version": 1, "environment": {"gain": [1, 2]}}')
    first = hash_of(1)
    variation_beside(file).write_text('{"version": 1, "environment": {"gain": [1, 3]}}')
    assert hash_of(None) == bare and hash_of(2) == hash_of(1) != first != bare


def test_the_default_orbit_and_its_planes_are_those_of_the_scene_as_it_is(tmp_path):
    file = stage(tmp_path)
    variation_beside(file).write_text(
        '{"version": 1, "placement": [{"objects": ["*"], "shift": [90, 0, 90], "scale": [3, 4]}]}'
    )
    cameras = [make_job("m", file, None, plan_of(), tmp_path, vary=seed).shoot.camera(7) for seed in (None, 1)]
    assert np.array_equal(cameras[0].world_from_camera, cameras[1].world_from_camera)
    assert (cameras[0].near, cameras[0].far, cameras[0].fov_y) == (cameras[1].near, cameras[1].far, cameras[1].fov_y)


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_command_line_varies_describes_and_regenerates(tmp_path):
    file, out = stage(tmp_path), tmp_path / "c"
    for seed in (3, 4):
        assert run("render", file, *TINY, "--frames", "0:1", "--vary", seed, "--out", out, "-q").exit_code == 0
    corpus = Corpus(out)
    assert list(corpus.sequences) == ["set_orbit_vary3", "set_orbit_vary4"]
    a, b = (corpus.read(name, "hr", "emission", 0) for name in corpus.sequences)  # the default sky, turned and tinted
    assert not np.array_equal(a, b)
    assert run("regenerate", out, "--scale", 3, "-q").exit_code == 0
    assert any(stream.startswith("lr_x3") for stream in Corpus(out).streams("set_orbit_vary3"))
    described = run("describe", file, "--vary", 3, "--no-measure", "--json")
    assert described.exit_code == 0 and json.loads(described.stdout)["channels"]["emission"]["needed"]
    assert run("render", file, "--vary", -1, "--out", out).exit_code == 2


def test_a_daylight_beside_an_environment_that_was_asked_for_is_refused(tmp_path):
    file, sky = stage(tmp_path), tmp_path / "paint.png"
    variation_beside(file).write_text('{"version": 1, "daylight": {}}')
    with pytest.raises(InputError, match="leave that out") as error:
        make_job("m", file, None, plan_of(), tmp_path, vary=0, environment=sky)
    assert (error.value.file, error.value.field) == (variation_beside(file).resolve(), "daylight")


def test_a_camera_that_follows_an_object_goes_where_it_went_without_the_variation(tmp_path):
    path = tmp_path / "follow.json"
    follow = {"object": "/Market/Cart/body", "offset": [0, 2, 5]}
    keys = [{"time": t, "look_at": {"object": "/Market/Cart/body"}} for t in (0, 1)]
    path.write_text(json.dumps({"version": 1, "fps": 8, "follow": follow, "keyframes": keys}))
    shoots = [
        make_job("market", find_scene("market"), str(path), plan_of(), tmp_path, vary=seed, overlay="none").shoot
        for seed in (None, 1)
    ]
    for frame in range(len(shoots[0])):
        now, then = (shoot.camera(frame) for shoot in shoots)
        assert np.array_equal(now.world_from_camera, then.world_from_camera) and (now.near, now.far) == (then.near, then.far)
