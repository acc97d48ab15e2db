"""The bundled scenes: each builds to the committed files again, renders along its own path, and validates."""

import hashlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from analytic import plan_of
from framepairs.bundled import camera_path_names, find_scene, scene_names
from framepairs.corpus import Corpus
from framepairs.engine import Engine
from framepairs.listings import pictured_frame
from framepairs.options import make_job
from framepairs.pipeline import render_sequence
from framepairs.plan import plan_streams
from framepairs.sampling.files import hinted_bounds
from framepairs.scene.images import read_image
from framepairs.validate import validate_corpus

TOP = Path(__file__).parents[1]
IMAGES = (".png", ".exr")
BUILT = (".usda", ".usdc", ".gltf", ".bin", ".xml", ".ply", ".serialized", *IMAGES)  # by build.py; the rest is written


def built(folder: Path) -> set[Path]:
    return {file.relative_to(folder) for file in folder.rglob("*") if file.suffix in BUILT}


@pytest.mark.parametrize("name", scene_names())
def test_the_build_script_makes_the_committed_files_again(name, tmp_path):
    """Texels are compared, and not the bytes of PNG and EXR, which depend on the encoder's version; crates name usd-core's,
    and serialized meshes are deflated."""
    folder = find_scene(name).parent
    subprocess.run([sys.executable, "-m", f"scenes.{name}.build", str(tmp_path)], cwd=TOP, check=True, timeout=300)
    assert built(tmp_path) == built(folder)
    for file in sorted(built(folder)):
        if file.suffix in IMAGES:
            a, b = (read_image(where / file) for where in (tmp_path, folder))
            assert np.abs(a.astype(float) - b).max() <= (1 if a.dtype == np.uint8 else 1e-3), file
        elif file.suffix not in (".usdc", ".serialized"):
            assert len({hashlib.sha256((where / file).read_bytes()).digest() for where in (tmp_path, folder)}) == 1, file


@pytest.mark.parametrize("name", scene_names())
def test_its_files_beside_it_are_sound(name):
    file = find_scene(name)
    assert file.with_name(f"{name}.variation.json").is_file()
    bounds = hinted_bounds(file)  # raises where it is not sound
    assert bounds is None or np.all(np.subtract(bounds[3:], bounds[:3]) > 2)


def said_constant(name: str) -> set[str]:
    """The channels that a scene's README calls constant."""
    text = (find_scene(name).parent / "README.md").read_text()
    line = re.search(r"Constant channels: ((?:`\w+`(?:, )?)+)", text)
    return set(re.findall(r"`(\w+)`", line[1]))


@pytest.fixture(scope="module", params=scene_names())
def corpus(request, tmp_path_factory) -> Corpus:
    """The first 16 frames of a scene's own path."""
    name, out = request.param, tmp_path_factory.mktemp(request.param) / "corpus"
    plan = plan_of(display=(320, 180), scales=(2,), antialiasing=4, variants=("native", "jittered_mip"), channels="needed")
    for _ in render_sequence(make_job(name, find_scene(name), None, plan, out), range(16)):
        pass
    return Corpus(out)


def test_it_has_a_path_of_its_name_and_passes_every_check(corpus):
    name = corpus.sequences[0].split("_")[0]
    assert corpus.sequences == [f"{name}_{name}"] and name in camera_path_names()
    results = validate_corpus(corpus)
    assert {item.id: item.worst for item in results if item.verdict == "fail"} == {}
    assert {item.id for item in results if item.verdict == "pass"} >= {"warp_object", "warp_place", "files", "complete"}


def test_no_channel_is_constant_but_those_that_the_readme_names(corpus):
    sequence = corpus.sequences[0]
    entry, name = corpus.sequence(sequence), corpus.sequences[0].split("_")[0]
    assert set(entry.constants) == said_constant(name)
    for channel in entry.channels:
        arrays = (corpus.read(sequence, "hr", channel, frame) for frame in corpus.frames(sequence))
        assert any(np.ptp(np.where(np.isfinite(array), array, 0)) > 0 for array in arrays), channel


def test_something_moves_besides_the_camera_and_occludes(corpus):
    sequence = corpus.sequences[0]
    entry = corpus.sequence(sequence)
    seen, hidden = set(), []
    for frame in corpus.frames(sequence)[1:]:
        seen |= set(np.unique(corpus.read(sequence, "hr", "object_id", frame)).tolist()) & set(entry.moving)
        bits = corpus.read(sequence, "hr", "visibility", frame)
        hidden.append(float(((bits & 4 == 0) & (bits & 1 == 1)).mean()))
    assert len(seen) >= 3 and max(hidden) > 0.002  # of the pixels


@pytest.mark.parametrize("name", scene_names())
def test_seeds_vary_the_content_and_not_the_camera(name, tmp_path):
    """A picture as bright in which every pixel errs by 5 codes of 255 differs by 0.02 after Reinhard's curve, x / (1 + x)."""
    plan, file = plan_of(display=(96, 54), antialiasing=1, channels=["color"]), find_scene(name)
    jobs = {seed: make_job(name, file, None, plan, tmp_path, vary=seed, overlay="none") for seed in (None, 1, 2, 3)}
    assert file.with_name(f"{name}.variation.json").is_file()
    pictures, frame, plain = [], pictured_frame(name), jobs[None]
    for job in jobs.values():
        assert [item.name for item in job.scene.objects] == [item.name for item in plain.scene.objects]
        assert job.scene.not_read == plain.scene.not_read
        for at in np.linspace(0, len(plain.shoot) - 1, 4).astype(int):
            now, then = job.shoot.camera(int(at)), plain.shoot.camera(int(at))
            assert np.array_equal(now.world_from_camera, then.world_from_camera)
            assert (now.fov_y, now.near, now.far) == (then.fov_y, then.near, then.far)
        engine = Engine(job.scene, job.plan, job.overlay)
        rendered = engine.render(job.shoot.state(frame), plan_streams(plan)[0], frozenset(["color"]), frame).arrays["color"]
        pictures.append(rendered / (1 + rendered))
        assert np.isfinite(pictures[-1]).all() and 0.02 < np.median(pictures[-1]) < 0.6
    for a in range(len(pictures)):
        for b in range(a):
            assert np.abs(pictures[a] - pictures[b]).mean() > 0.02, (a, b)
