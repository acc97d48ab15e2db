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
from framepairs.options import make_job
from framepairs.pipeline import render_sequence
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
