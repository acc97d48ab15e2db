"""From a job to files: the same bytes twice, resuming, adding streams, and refusing what does not fit."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from framepairs.channels import CHANNELS
from framepairs.corpus import Corpus
from framepairs.errors import FramepairsError, InputError, MachineError
from framepairs.pipeline import estimated_bytes, render_sequence
from framepairs.validate import validate_corpus
from sample_corpus import two_quads_job

SMALL = {"display": (48, 27), "scales": (2,), "antialiasing": 4}


def contents(folder: Path) -> dict[str, str]:
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def render(out: Path, frames=range(4), **plan) -> Path:
    list(render_sequence(two_quads_job(out, **(SMALL | plan)), frames))
    return out


@pytest.fixture(scope="module")
def reference(tmp_path_factory) -> Path:
    return render(tmp_path_factory.mktemp("reference") / "corpus")


def test_two_runs_give_equal_bytes(reference, tmp_path):
    assert contents(render(tmp_path / "again")) == contents(reference)


def test_a_frame_rendered_alone_equals_itself_in_the_sequence(reference, tmp_path):
    alone = contents(render(tmp_path / "alone", range(2, 3)))
    whole = contents(reference)
    mine = {path: value for path, value in alone.items() if "000002" in path}
    assert len(mine) == 3 * len(CHANNELS) + 1
    assert all(whole[path] == value for path, value in mine.items())


def test_files_are_where_outsiders_expect_them(reference):
    paths = set(contents(reference))
    streams = ("hr", "lr_x2", "lr_x2_jittered_mip-1")
    expected = {f"two_quads_slide/{s}/{c.name}/00000{k}.exr" for s in streams for c in CHANNELS for k in range(4)}
    expected |= {f"two_quads_slide/frames/00000{k}.json" for k in range(4)}
    expected |= {"corpus.json", "two_quads_slide/sequence.json", "tables/brdf_separable_smith.exr"}
    assert paths == expected


def test_frame_records_have_the_documented_keys(reference):
    record = json.loads((reference / "two_quads_slide/frames/000002.json").read_text())
    assert set(record) == {
        "frame", "time_s", "frame_time_ms", "reset", "exposure_ev", "camera", "streams", "files", "parts", "inputs", "key"
    }  # fmt: skip
    assert set(record["camera"]) == {
        "fov_y_rad", "near", "far", "view_from_world", "clip_from_view", "previous_view_from_world",
        "previous_clip_from_view",
    }  # fmt: skip
    counted = {"saturated", "fireflies", "rejected_paths", "part"}
    assert all(set(s) == {"size", "scale", "jitter", "mip_bias", *counted} for s in record["streams"].values())
    assert all(set(f) == {"path", "sha256", "size"} for f in record["files"])


def test_matrices_in_the_record_hold_no_jitter_and_project_depth_to_its_pixel(reference):
    corpus = Corpus(reference)
    record = corpus.record("two_quads_slide", 1)
    stream = "lr_x2_jittered_mip-1"
    depth = corpus.read("two_quads_slide", stream, "depth", 1)[..., 0].astype(float)
    height, width = depth.shape
    jitter = record.streams[stream].jitter
    assert any(jitter)
    x = (np.arange(width) + 0.5 - jitter[0]) / width
    clip = np.array(record.camera.clip_from_view)
    on_wall = corpus.read("two_quads_slide", stream, "object_id", 1)[..., 0] == 1
    z = depth[on_wall]
    view_x = np.broadcast_to((2 * x - 1) / clip[0, 0], depth.shape)[on_wall] * z
    world = np.linalg.inv(np.array(record.camera.view_from_world)) @ np.stack([view_x, 0 * z, -z, np.ones_like(z)])
    assert np.abs(world[2] + 4).max() < 1e-5  # the wall stands at z = -4


def test_a_finished_render_is_not_rendered_again_and_a_damaged_frame_is(reference, tmp_path):
    out = render(tmp_path / "corpus")
    steps = list(render_sequence(two_quads_job(out, **SMALL), range(4)))
    assert [step.rendered for step in steps] == [False] * 4
    (out / "two_quads_slide/hr/depth/000001.exr").unlink()
    (out / "two_quads_slide/frames/000002.json").write_text("{")
    steps = list(render_sequence(two_quads_job(out, **SMALL), range(4)))
    assert [step.rendered for step in steps] == [False, True, True, False]
    assert contents(out) == contents(reference)


def test_a_frame_of_another_version_is_rendered_again(reference, tmp_path):
    """Its key differs, because everything that decides pixels is in it."""
    out = render(tmp_path / "corpus")
    file = out / "two_quads_slide/frames/000002.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"key": "0" * 64}))
    steps = list(render_sequence(two_quads_job(out, **SMALL), range(4)))
    assert [step.rendered for step in steps] == [False, False, True, False]
    assert contents(out) == contents(reference)


def test_frames_added_later_give_the_same_corpus(reference, tmp_path):
    out = render(tmp_path / "corpus", range(2, 4))
    render(out, range(0, 3))
    assert contents(out) == contents(reference)


def test_an_interrupted_render_leaves_no_record_of_an_unfinished_frame(tmp_path):
    steps = render_sequence(two_quads_job(tmp_path / "corpus", **SMALL), range(4))
    next(steps)
    steps.close()
    corpus = Corpus(tmp_path / "corpus")
    for frame in corpus.frames("two_quads_slide"):
        for channel in CHANNELS:
            corpus.read("two_quads_slide", "hr", channel.name, frame)
    assert not list((tmp_path / "corpus").rglob("*.part"))


def test_scales_are_added_in_place_without_touching_what_is_there(reference, tmp_path):
    out = render(tmp_path / "corpus")
    job = two_quads_job(out, **(SMALL | {"scales": (2, 2.7)}))
    list(render_sequence(job, range(4), add_streams=True))
    before, after = contents(reference), contents(out)
    images = {path for path in before if path.endswith(".exr")}
    assert all(after[path] == before[path] for path in images)
    record = Corpus(out).record("two_quads_slide", 3)
    assert record.streams["lr_x2.7"].size == (18, 10)  # floor(48 / 2.7 + 0.5), floor(27 / 2.7 + 0.5)
    fresh = render(tmp_path / "fresh", scales=(2, 2.7))
    assert contents(fresh) == after


@pytest.mark.parametrize(("key", "value"), [("antialiasing", 8), ("display", (50, 27)), ("seed", 3), ("scales", (2, 3))])
def test_another_plan_is_refused_with_the_differing_key(reference, key, value):
    before = contents(reference)
    with pytest.raises(InputError, match=f"plan.{key}"):
        render(reference, **{key: value})
    assert contents(reference) == before


def test_a_folder_with_other_things_in_it_is_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="not empty"):
        render(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.txt"]


def test_an_output_folder_that_cannot_be_made_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FramepairsError, match="cannot be written"):
        render(tmp_path / "file" / "corpus")


def test_a_disk_that_fills_up_stops_with_the_file_named_and_resumes(reference, tmp_path, monkeypatch):
    import os

    real, left = os.fsync, [40]

    def full(descriptor):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")
        real(descriptor)

    out = tmp_path / "corpus"
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MachineError, match="No space left"):
        render(out)
    monkeypatch.undo()
    assert not list(out.rglob("*.part"))
    render(out)
    assert contents(out) == contents(reference)


def test_what_a_killed_render_left_is_cleared_away(reference, tmp_path):
    out = render(tmp_path / "corpus", range(2))
    for name in ("two_quads_slide/hr/depth/.000002.exr.77.part", "two_quads_slide/frames/.000002.json.77.part"):
        (out / name).write_bytes(b"half")
    render(out)
    assert contents(out) == contents(reference)


def test_a_render_that_was_killed_before_its_first_file_is_no_stranger(reference, tmp_path):
    out = tmp_path / "corpus"
    out.mkdir()
    (out / ".corpus.json.0123abcd.part").write_bytes(b"half")
    render(out)
    assert contents(out) == contents(reference)


def test_a_damaged_record_elsewhere_does_not_stop_a_render(tmp_path):
    out = render(tmp_path / "corpus", range(2))
    (out / "two_quads_slide/frames/000000.json").write_text("{")
    render(out, range(2, 3))
    index = json.loads((out / "two_quads_slide/sequence.json").read_text())
    assert [entry["frame"] for entry in index["frames"]] == [1, 2]


def test_frames_need_not_be_a_range(tmp_path):
    list(render_sequence(two_quads_job(tmp_path / "c", **SMALL), [0, 3]))
    assert Corpus(tmp_path / "c").frames("two_quads_slide") == [0, 3]


def test_only_chosen_channels_are_written(tmp_path):
    corpus = Corpus(render(tmp_path / "corpus", range(1), channels=("depth", "motion")))
    assert corpus.sequence("two_quads_slide").channels == ["depth", "motion"]
    assert "fail" not in {result.verdict for result in validate_corpus(corpus)}
    with pytest.raises(InputError, match="albedo"):
        corpus.read("two_quads_slide", "hr", "albedo", 0)


def test_a_profile_counts_no_compilation_after_the_second_frame(tmp_path):
    steps = list(render_sequence(two_quads_job(tmp_path / "corpus", **SMALL), range(6), profile=True))
    assert [step.profile.compiled for step in steps[2:]] == [0] * 4
    assert all(0 < step.profile.launches < 20 for step in steps[2:])  # a few per stream
    parts = ("state", "render", "encode", "write", "close")
    assert all(getattr(step.profile, part) > 0 for step in steps for part in parts)


def test_the_estimate_is_an_upper_bound(reference):
    job = two_quads_job(reference, **SMALL)
    written = sum(file.stat().st_size for file in (reference / "two_quads_slide").rglob("*.exr"))
    headers = 4 * 3 * len(CHANNELS) * 1500
    assert written <= estimated_bytes(job, 4) + headers
