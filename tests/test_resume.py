"""A changed scene, path, plan or version renders again the frames that it changes, no others, and says why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from framepairs import frame_parts, job
from framepairs.camera_path import make_camera_path
from framepairs.corpus import Corpus
from framepairs.digests import digest
from framepairs.errors import InputError
from framepairs.pipeline import render_sequence
from framepairs.scene.description import Light
from framepairs.transforms import look_at
from sample_corpus import two_quads, two_quads_job
from test_pipeline import contents

PLAN = {"display": (48, 27), "scales": (2,), "antialiasing": 4, "channels": ("color", "motion", "object_id")}
FRAMES = 6


def turned(angle: float):
    return look_at(np.zeros(3), np.array([np.sin(angle), 0, -np.cos(angle)]), np.array([0.0, 1, 0]))


def turning(last: float = 0.02, frames: int = FRAMES):
    """A camera that stands and turns by 0.02 a frame; `last`: between the last two."""
    angles = [0.02 * k for k in range(frames - 1)]
    angles.append(angles[-1] + last)
    poses = [
        {"time": k / 24, "world_from_camera": turned(angle).tolist()}
        for k, angle in enumerate(angles)
    ]
    return make_camera_path({"version": 1, "fps": 24, "fov_y_deg": 45, "poses": poses}, file="turning")


def job_at(out: Path, scene=None, path=None, **plan):
    made = two_quads_job(out, **(PLAN | plan))
    return replace(made, scene=scene or two_quads(), path=path or turning())


def run(made, frames=None, **options) -> dict[int, str]:
    """Why each frame was rendered, of those that were."""
    steps = list(render_sequence(made, frames or range(len(made.shoot)), **options))
    return {step.frame: step.why for step in steps if step.rendered}


@pytest.fixture()
def corpus(tmp_path) -> Path:
    out = tmp_path / "corpus"
    assert run(job_at(out)) == dict.fromkeys(range(FRAMES), "not there")
    return out


def assert_as_fresh(made, tmp_path):
    fresh = replace(made, out=tmp_path / "fresh")
    run(fresh)
    assert contents(made.out) == contents(fresh.out)


def test_nothing_is_rendered_twice(corpus):
    before = contents(corpus)
    assert run(job_at(corpus)) == {}
    assert contents(corpus) == before


def test_a_camera_that_turns_otherwise_at_the_end_renders_the_end(corpus, tmp_path):
    made = job_at(corpus, path=turning(last=0.05))
    assert run(made) == {FRAMES - 1: "camera changed"}
    assert_as_fresh(made, tmp_path)


def test_an_object_that_moves_otherwise_renders_the_frames_in_which_it_did_or_had(corpus, tmp_path):
    scene = two_quads()
    moves = scene.world_from_object

    def jumps(time):
        matrices = moves(time).copy()
        if abs(time - 3 / 24) < 1e-9:
            matrices[1, 1, 3] += 0.5
        return matrices

    made = job_at(corpus, scene=replace(scene, world_from_object=jumps))
    assert run(made) == {3: "objects changed", 4: "objects changed"}  # 4: what was before it moved
    assert_as_fresh(made, tmp_path)


def test_a_changed_light_and_a_changed_material_are_named(corpus, tmp_path):
    scene = two_quads()
    sun = Light(name="another name", kind="directional", radiance=(1, 2, 1.8), direction=(0.36, -0.48, -0.8))
    assert run(job_at(corpus, scene=replace(scene, lights=(sun,)))) == dict.fromkeys(range(FRAMES), "lights changed")
    renamed = replace(scene, lights=(replace(sun, name="the same"),))
    assert run(job_at(corpus, scene=renamed)) == {}
    rough = tuple(replace(material, roughness=0.7) for material in scene.materials)
    made = job_at(corpus, scene=replace(renamed, materials=rough))
    assert set(run(made).values()) == {"materials changed, scene changed"}
    assert_as_fresh(made, tmp_path)


def test_another_version_renders_all_and_says_so(corpus, monkeypatch):
    ours = job.versions()
    for module in (job, frame_parts):
        monkeypatch.setattr(module, "versions", lambda: ours | {"mitsuba": "99"})
    assert run(job_at(corpus)) == dict.fromkeys(range(FRAMES), "versions changed")


def test_what_decides_no_pixel_renders_nothing(corpus, monkeypatch):
    """A reader of other scenes' formats, and the seed of light paths in raster."""
    ours = job.versions()
    for module in (job, frame_parts):
        monkeypatch.setattr(module, "versions", lambda: ours | {"usd-core": "99"})
    assert run(job_at(corpus, seed=5), update=True) == {}
    assert Corpus(corpus).manifest.plan.seed == 5


def test_update_renders_the_streams_that_a_changed_key_decides(corpus, tmp_path):
    made = job_at(corpus, antialiasing=8)
    with pytest.raises(InputError, match="plan.antialiasing: the corpus has antialiasing = 4, not 8; --update"):
        run(made)
    lr = {name: value for name, value in contents(corpus).items() if "/lr_" in name}
    times = {name: (corpus / name).stat().st_mtime_ns for name in lr}
    assert run(made, update=True) == dict.fromkeys(range(FRAMES), "hr changed")
    assert {name: (corpus / name).stat().st_mtime_ns for name in lr} == times
    assert_as_fresh(made, tmp_path)


def test_update_adds_and_removes_streams_and_channels(corpus, tmp_path):
    made = job_at(corpus, scales=(3,), channels=("color", "depth"))
    reasons = set(run(made, update=True).values())
    assert reasons == {"files are missing, lr_x3 not there, lr_x3_jittered_mip-1.585 not there"}
    assert_as_fresh(made, tmp_path)


def test_update_is_refused_where_another_sequence_has_the_plan(corpus):
    run(replace(job_at(corpus), path_name="other"), [0])
    before = contents(corpus)
    with pytest.raises(InputError, match="plan.antialiasing.*sequence two_quads_other has it, too"):
        run(job_at(corpus, antialiasing=8), update=True)
    assert contents(corpus) == before


def test_a_part_of_a_changed_sequence_is_refused_and_nothing_is_lost(corpus):
    rough = tuple(replace(material, roughness=0.7) for material in two_quads().materials)
    before = contents(corpus)
    with pytest.raises(InputError, match=r"frame 0, frames: materials changed, scene changed since .* all 5 such frames"):
        run(job_at(corpus, scene=replace(two_quads(), materials=rough)), [2])
    assert contents(corpus) == before


def test_a_shorter_path_takes_the_frames_behind_its_end_away(corpus, tmp_path):
    made = job_at(corpus, path=turning(frames=4))
    assert run(made) == {}
    assert_as_fresh(made, tmp_path)


def test_a_render_that_dies_in_a_changed_sequence_leaves_no_frame_of_the_old_one(corpus, tmp_path):
    rough = tuple(replace(material, roughness=0.7) for material in two_quads().materials)
    made = job_at(corpus, scene=replace(two_quads(), materials=rough))
    steps = render_sequence(made, range(FRAMES))
    next(steps)
    steps.close()
    assert 0 < len(list((corpus / made.sequence / "frames").glob("*.json"))) < FRAMES
    run(made)
    assert_as_fresh(made, tmp_path)


def test_a_record_that_was_changed_is_not_believed(corpus):
    file = corpus / "two_quads_slide/frames/000003.json"
    text = file.read_text()
    assert '"reset": false' in text
    key = text.index('"camera": "') + len('"camera": "')
    file.write_text(text[:key] + "0" * 64 + text[key + 64 :])
    assert run(job_at(corpus)) == {3: "its record is damaged"}


def test_digests_are_of_values_and_not_of_names():
    first, second = two_quads(), two_quads()
    assert digest(first.meshes) == digest(second.meshes)
    assert digest(first.objects[0]) == digest(replace(first.objects[0], name="renamed"))
    assert digest((1, "a")) != digest(("1", "a")) != digest(["1a"])
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1}) != digest({"a": 2, "b": 1})
