"""What a scene does not need is not rendered, not written, and read back all the same."""

from pathlib import Path

import numpy as np
import pytest

from analytic import at, constant_sky, make_scene, path_of, plan_of, quad, uv_sphere
from framepairs.corpus import Corpus
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene.description import Light, Material
from framepairs.validate import validate_corpus

VARIANTS = ("native", "mip", "jittered", "jittered_mip")
LEFT_OUT = {"motion", "dual_motion", "visibility", "metallic", "roughness", "specular", "transparency", "overlay"}


def plain_job(out: Path, channels: str, frames: int = 3) -> Job:
    """A static camera before diffuse balls of two colours without textures."""
    red, gray = (
        Material(name=name, base_color=color, specular=0, roughness=1)
        for name, color in (("red", (0.7, 0.1, 0.1)), ("gray", (0.5, 0.5, 0.5)))
    )
    scene = make_scene(
        (uv_sphere(), red, at(-0.8, 0, -4)),
        (uv_sphere(), gray, at(0.9, 0, -5)),
        (quad(30, 30), gray, at(0, 0, -8)),
        sky=constant_sky((0.5, 0.6, 0.8)),
        lights=(Light(name="sun", kind="directional", radiance=(2, 2, 2), direction=(0.36, -0.48, -0.8)),),
    )
    plan = plan_of(display=(96, 54), scales=(2,), antialiasing=4, variants=VARIANTS, channels=channels)
    path = path_of(*[at(0, 0, 0)] * frames)
    return Job(scene=scene, scene_name="plain", environment=None, path=path, path_name="still", plan=plan, out=out)


@pytest.fixture(scope="module")
def corpora(tmp_path_factory) -> tuple[Corpus, Corpus]:
    """(what is needed, everything)."""
    folder = tmp_path_factory.mktemp("left_out")
    for name in ("needed", "all"):
        list(render_sequence(plain_job(folder / name, name), range(3)))
    return Corpus(folder / "needed"), Corpus(folder / "all")


def test_what_a_plain_scene_does_not_need_is_absent_from_disk(corpora):
    needed, everything = corpora
    folders = {path.name for path in (needed.folder / "plain_still" / "hr").iterdir()}
    assert not folders & LEFT_OUT
    assert folders == {"color", "emission", "albedo", "normal", "depth", "object_id", "brdf"}
    streams = {path.name for path in (needed.folder / "plain_still").iterdir() if path.is_dir()} - {"frames"}
    assert streams == {"hr", "lr_x2", "lr_x2_jittered"}
    assert not (needed.folder / "tables").exists() and (everything.folder / "tables").is_dir()


def test_readers_give_the_same_arrays_either_way(corpora):
    needed, everything = corpora
    assert needed.streams("plain_still") == everything.streams("plain_still")
    assert len(needed.streams("plain_still")) == 5
    names = [row["name"] for row in everything.manifest.channels]
    for stream in needed.streams("plain_still"):
        for frame in range(3):
            records = [corpus.record("plain_still", frame).streams[stream] for corpus in corpora]
            assert [record.mip_bias for record in records][0] == records[1].mip_bias
            assert records[0].jitter == records[1].jitter
            for name in names:
                ours, theirs = (corpus.read("plain_still", stream, name, frame) for corpus in corpora)
                assert np.array_equal(ours, theirs), (stream, name, frame)
                assert ours.dtype == theirs.dtype


def test_the_table_of_a_diffuse_scene_is_zeros_for_the_reader(corpora):
    needed, everything = corpora
    assert needed.brdf_table().shape == everything.brdf_table().shape == (64, 64, 2)
    assert not needed.brdf_table().any() and everything.brdf_table()[10, 10].sum() > 0.5


def test_both_pass_validation(corpora):
    for corpus in corpora:
        assert not [result.id for result in validate_corpus(corpus) if result.verdict == "fail"]


def test_passes_that_the_scene_does_not_need_never_run(tmp_path, monkeypatch):
    from framepairs import pipeline

    engines = []

    class Watched(pipeline.Engine):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            engines.append(self)

    monkeypatch.setattr(pipeline, "Engine", Watched)
    for name in ("needed", "all"):
        list(render_sequence(plain_job(tmp_path / name, name), range(2)))
    never = {"path": 0, "overlay": 0}
    none = {"brdf_table": 0, "motion": 0, "dual_motion": 0}
    assert engines[0].passes == {"gbuffer": 6, "radiance": 6} | none | never
    # Two frames of five streams, of which native and mip, and the two jittered ones, share their passes.
    assert engines[1].passes == {"gbuffer": 6, "radiance": 6, "brdf_table": 1, "motion": 6, "dual_motion": 6} | never


def test_a_specular_scene_after_a_diffuse_one_brings_the_table(tmp_path):
    from dataclasses import replace

    job = plain_job(tmp_path, "needed")
    list(render_sequence(job, range(1)))
    assert Corpus(tmp_path).manifest.brdf_table is None
    shiny = replace(job.scene, materials=tuple(replace(material, specular=0.5) for material in job.scene.materials))
    list(render_sequence(replace(job, scene=shiny, scene_name="shiny"), range(1)))
    assert Corpus(tmp_path).manifest.brdf_table is not None
    assert Corpus(tmp_path).brdf_table()[10, 10].sum() > 0.5
    list(render_sequence(replace(job, path_name="again"), range(1)))
    assert Corpus(tmp_path).manifest.brdf_table is not None  # a diffuse one does not take it away
