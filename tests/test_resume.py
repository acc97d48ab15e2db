"""A changed scene, path, plan or version renders again the frames that it changes, no others, and says why."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analytic import plan_of
from framepairs import frame_parts, job, opening
from framepairs.camera_path import make_camera_path
from framepairs.corpus import Corpus
from framepairs.digests import digest
from framepairs.errors import InputError
from framepairs.options import make_job
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
    for module in (job, frame_parts, opening):
        monkeypatch.setattr(module, "versions", lambda: ours | {"mitsuba": "99"})
    assert run(job_at(corpus)) == dict.fromkeys(range(FRAMES), "versions changed")


def test_what_decides_no_pixel_renders_nothing(corpus, monkeypatch):
    """A reader of other scenes' formats, and the seed of light paths in raster."""
    ours = job.versions()
    for module in (job, frame_parts, opening):
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


def overlaid(out, elements, tmp_path, fps=24):
    from framepairs.overlay_elements import make_overlay

    written = {"version": 1, "elements": elements}
    file = tmp_path / "hud.overlay.json"
    file.write_text(json.dumps(written))
    poses = [{"time": k / fps, "world_from_camera": np.eye(4).tolist()} for k in range(FRAMES)]
    path = make_camera_path({"version": 1, "fps": fps, "fov_y_deg": 45, "poses": poses}, file="still")
    made = job_at(out, path=path, channels=("color",))
    return replace(made, overlay=make_overlay(written, file=file), overlay_name="hud", overlay_sha256=None)


def test_an_element_that_comes_in_time_renders_the_frames_that_it_comes_into(tmp_path):
    """At half the rate, frames 2 and later are at other times: text that begins at 0.15 s comes two frames earlier."""
    text = [{"text": "HUD", "screen": [0.5, 0.5], "size": 0.3, "from_s": 0.15}]
    scene = replace(two_quads(), world_from_object=lambda time: two_quads().world_from_object(0.0))
    out = tmp_path / "corpus"
    assert len(run(replace(overlaid(out, text, tmp_path), scene=scene))) == FRAMES
    made = replace(overlaid(out, text, tmp_path, fps=12), scene=scene)
    assert run(made) == {2: "overlay changed", 3: "overlay changed"}
    assert_as_fresh(made, tmp_path)


def test_an_overlay_is_what_it_draws_and_not_its_file(tmp_path):
    out = tmp_path / "corpus"
    made = overlaid(out, [{"text": "HUD", "screen": [0.5, 0.5], "size": 0.3}], tmp_path)
    run(made)
    picture = made.overlay.pictures[0]
    bolder = replace(made.overlay, pictures=(replace(picture, texels=picture.texels // 2),))
    assert set(run(replace(made, overlay=bolder)).values()) == {"overlay changed"}


def test_emission_that_peaks_later_decides_the_choice_of_lights(tmp_path):
    """Which the files of a frame at the beginning depend on, with path shading."""
    scene = two_quads()
    glows = lambda peak: replace(  # noqa: E731
        scene,
        animation_end_s=10.0,
        materials_at=lambda time: (replace(scene.materials[0], emission=(peak if time > 9 else 0.1,) * 3), scene.materials[1]),
    )
    first, second = (job_at(tmp_path / "corpus", scene=glows(peak)) for peak in (1.0, 50.0))
    assert first.scene_content == job_at(tmp_path, scene=glows(1.0)).scene_content != second.scene_content


def test_a_bsdf_of_a_scene_without_files_is_a_part_of_it(tmp_path):
    scene = two_quads()
    made = [
        job_at(tmp_path, scene=replace(scene, materials=(replace(scene.materials[0], bsdf={"type": name}), scene.materials[1])))
        for name in ("diffuse", "conductor", "diffuse")
    ]
    assert made[0].scene_content == made[2].scene_content != made[1].scene_content


def test_scales_of_one_name_are_still_two(tmp_path):
    """2.0 and 2.0004 are both lr_x2; at 6400 pixels their sizes differ."""
    wide = {"display": (6400, 6), "channels": ("object_id",), "antialiasing": 1, "variants": ("native",)}
    run(job_at(tmp_path / "corpus", scales=(2.0,), **wide), [0])
    made = job_at(tmp_path / "corpus", scales=(2.0004,), **wide)
    assert run(made, [0], update=True) == {0: "lr_x2 changed"}


def test_a_corpus_from_files_loses_what_update_takes_away(tmp_path):
    """Where the files are the same, too, so that no part is compared."""
    made = file_job(tmp_path / "corpus", tmp_path, channels=("color", "depth"), scales=(2, 3))
    run(made, range(2))
    less = replace(made, plan=plan_of(**(PLAN | {"channels": ("color",), "scales": (2,)})))
    assert run(less, range(2), update=True) == {}
    fresh = replace(less, out=tmp_path / "fresh")
    run(fresh, range(2))
    assert contents(less.out) == contents(fresh.out)


def test_another_table_takes_the_place_of_the_first(tmp_path):
    made = file_job(tmp_path / "corpus", tmp_path)
    run(made, range(1))
    other = replace(made, plan=plan_of(**(PLAN | {"brdf_model": "height_correlated"})))
    assert run(other, range(1), update=True) == {0: "plan changed"}
    assert [file.name for file in (tmp_path / "corpus" / "tables").iterdir()] == ["brdf_height_correlated.exr"]


def test_images_of_a_frame_without_record_go_when_its_path_ends_before_it(corpus):
    (corpus / "two_quads_slide/frames/000005.json").unlink()
    run(job_at(corpus, path=turning(frames=4)))
    assert not list(corpus.rglob("000005.exr"))


def test_the_hash_of_the_files_is_of_what_was_read(tmp_path):
    made = file_job(tmp_path / "corpus", tmp_path)
    before = made.inputs(0)
    (tmp_path / "quad.obj").write_text(QUAD + "# edited while frames are rendered\n")
    assert replace(made, path=turning()).scene_sha256 == made.scene_sha256 and made.inputs(0) == before
    assert file_job(tmp_path / "corpus", tmp_path, write=False).inputs(0) != before


def test_a_scene_by_another_name_of_its_file_is_the_same(tmp_path, monkeypatch):
    run(file_job(tmp_path / "corpus", tmp_path), range(2))
    monkeypatch.chdir(tmp_path)
    made = file_job(tmp_path / "corpus", Path("."), write=False)
    assert run(made, range(2)) == {}
    (tmp_path / "elsewhere").mkdir()
    with pytest.raises(InputError, match=r"another scene: .*quad.obj, not elsewhere/quad.obj"):
        run(file_job(tmp_path / "corpus", Path("elsewhere"), extra="f 1 2 3\n"), range(2))


def test_what_frames_are_made_from_is_hashed_once(tmp_path, monkeypatch):
    """A path of thousands of poses is a part of it, and each frame asks."""
    made, counted, real = file_job(tmp_path / "corpus", tmp_path), [], job.frame_key
    monkeypatch.setattr(job, "frame_key", lambda values: counted.append(len(values)) or real(values))
    assert len({made.inputs(frame) for frame in range(50)}) == 50
    assert counted.count(len(made.sources)) == 1


QUAD = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"


def file_job(out, folder, write=True, extra="", **plan):
    if write:
        (folder / "quad.obj").write_text(QUAD + extra)
    return make_job(str(folder / "quad.obj"), folder / "quad.obj", None, plan_of(**(PLAN | plan)), out)


def test_digests_are_of_values_and_not_of_names():
    first, second = two_quads(), two_quads()
    assert digest(first.meshes) == digest(second.meshes)
    assert digest(first.objects[0]) == digest(replace(first.objects[0], name="renamed"))
    assert digest((1, "a")) != digest(("1", "a")) != digest(["1a"])
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1}) != digest({"a": 2, "b": 1})
