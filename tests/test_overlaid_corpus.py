"""An overlay through the whole pipeline: which channels know of it, what resumes, and what is rendered again."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analytic import plan_of
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.job import Job
from framepairs.options import make_job, stored_job
from framepairs.overlay_elements import make_overlay, read_overlay
from framepairs.pipeline import render_sequence
from sample_corpus import two_quads_job

BOX = {"text": "HUD", "screen": [0.5, 0.5], "size": 0.3, "background": {"opacity": 1, "color": "#204060"}}


def written(folder: Path, **changes) -> Path:
    file = folder / "hud.overlay.json"
    file.write_text(json.dumps({"version": 1, "elements": [BOX | changes]}))
    return file


def job_of(out: Path, overlay: Path | None, **plan) -> Job:
    job = two_quads_job(out, scales=(2,), channels="needed", **plan)
    return job if overlay is None else replace(job, overlay=read_overlay(overlay), overlay_name=str(overlay))


@pytest.fixture(scope="module")
def corpora(tmp_path_factory) -> tuple[Corpus, Corpus]:
    """(with an overlay, without), frames 0 to 2."""
    folder = tmp_path_factory.mktemp("overlaid")
    for name, overlay in (("with", written(folder)), ("without", None)):
        list(render_sequence(job_of(folder / name, overlay), range(3)))
    return Corpus(folder / "with"), Corpus(folder / "without")


def test_only_colour_and_the_overlay_s_own_channel_know_of_it(corpora):
    overlaid, plain = corpora
    for stream in overlaid.streams("two_quads_slide"):
        for row in overlaid.manifest.channels:
            ours, theirs = (corpus.read("two_quads_slide", stream, row["name"], 2) for corpus in corpora)
            differs = not np.array_equal(ours, theirs)
            assert differs == (row["name"] in ("color", "overlay")), (stream, row["name"])
        coverage = overlaid.read("two_quads_slide", stream, "overlay", 2)[..., 0]
        colors = [corpus.read("two_quads_slide", stream, "color", 2) for corpus in corpora]
        assert np.array_equal(colors[0][coverage == 0], colors[1][coverage == 0])
        height, width = coverage.shape
        assert coverage[height // 2, width // 2] == 1 and coverage[0, 0] == 0


def test_the_channel_is_a_constant_where_there_is_none(corpora):
    overlaid, plain = corpora
    entries = [corpus.sequence("two_quads_slide") for corpus in corpora]
    assert "overlay" in entries[0].channels and entries[1].constants["overlay"].surface == [0.0]
    assert entries[0].overlay.endswith("hud.overlay.json") and entries[1].overlay is None


def test_a_changed_overlay_renders_the_frames_again_and_says_why(tmp_path):
    first = job_of(tmp_path / "corpus", written(tmp_path))
    list(render_sequence(first, range(1)))
    assert [step.rendered for step in render_sequence(first, range(1))] == [False]
    second = job_of(tmp_path / "corpus", written(tmp_path, text="other"))
    steps = list(render_sequence(second, range(1)))
    assert [(step.rendered, step.why) for step in steps] == [(True, "overlay changed")]
    with pytest.raises(InputError, match="overlay: sequence two_quads_slide is there with another overlay"):
        list(render_sequence(job_of(tmp_path / "corpus", None), range(1)))


def test_an_overlay_that_does_not_fit_the_scene_leaves_nothing_behind(tmp_path):
    elements = [{"text": "HUD", "object": "nobody", "size": 0.1}]
    (tmp_path / "a.overlay.json").touch()  # its bytes are hashed
    overlay = make_overlay({"version": 1, "elements": elements}, file=tmp_path / "a.overlay.json")
    job = replace(two_quads_job(tmp_path / "corpus", scales=(2,)), overlay=overlay)
    with pytest.raises(InputError, match="no object named 'nobody'"):
        list(render_sequence(job, range(1)))
    assert not (tmp_path / "corpus").exists()


def test_a_changed_overlay_is_not_taken_for_the_recorded_one(tmp_path):
    scene = tmp_path / "quad.obj"
    scene.write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n")
    overlay, plan = written(tmp_path), plan_of(scales=(2,), variants=("native",), antialiasing=1, channels="needed")
    job = make_job(str(scene), scene, None, plan, tmp_path / "corpus", overlay=overlay)
    list(render_sequence(job, range(1)))
    entry = Corpus(tmp_path / "corpus").sequence("quad_orbit")
    again, _ = stored_job(entry, None, plan, tmp_path / "again")
    assert again.overlay is not None and again.inputs(0) == job.inputs(0)
    written(tmp_path, text="changed")
    with pytest.raises(InputError, match=r"hud.overlay.json: is not the overlay that the corpus was rendered with"):
        stored_job(entry, None, plan, tmp_path / "again")


def test_streams_of_another_mip_bias_are_not_equal_under_an_overlay(tmp_path):
    from test_left_out import plain_job

    job = plain_job(tmp_path, "needed")
    assert job.equal_streams
    (tmp_path / "a.overlay.json").touch()  # its bytes are hashed
    overlay = make_overlay({"version": 1, "elements": [BOX]}, file=tmp_path / "a.overlay.json")
    assert replace(job, overlay=overlay).equal_streams == {}
    assert replace(job, overlay=replace(overlay, elements=(), picture=(), pictures=())).equal_streams == job.equal_streams
