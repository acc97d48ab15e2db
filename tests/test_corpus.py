"""Reading back: constants give the same arrays as files, damage is named, and no renderer is imported."""

import subprocess
import sys

import numpy as np
import pytest

from analytic import at, constant_sky, make_scene, path_of, plan_of, quad
from framepairs.channels import CHANNELS
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene.description import Material

SEQUENCE = "two_quads_slide"


def rendered(out, channels, cameras):
    plastic = Material(name="plastic", base_color=(0.3, 0.3, 0.3), roughness=0.35, specular=0.5)
    scene = make_scene((quad(1, 1), plastic, at(0, 0, -2)), sky=constant_sky((1, 1, 1)))
    job = Job(
        scene=scene, scene_name="plain", environment=None, path=path_of(*cameras), path_name="still",
        plan=plan_of(channels=channels), out=out,
    )  # fmt: skip
    list(render_sequence(job, range(len(cameras))))
    return Corpus(out)


@pytest.mark.parametrize("moves", [False, True])
def test_left_out_channels_read_like_rendered_ones(tmp_path, moves):
    turn = np.array([[0.8, 0, 0.6, 0], [0, 1, 0, 0], [-0.6, 0, 0.8, 0], [0, 0, 0, 1]])
    cameras = [np.eye(4), turn if moves else np.eye(4)]
    needed, everything = (rendered(tmp_path / c, c, cameras) for c in ("needed", "all"))
    entry = needed.sequence("plain_still")
    left_out = {"albedo", "roughness", "metallic", "specular", "dual_motion", "transparency", "overlay", "color_variance"}
    left_out |= set() if moves else {"motion", "visibility"}
    assert set(entry.constants) == left_out and not set(entry.channels) & left_out
    assert set(entry.channels) | left_out == {channel.name for channel in CHANNELS}
    for frame in (0, 1):
        for stream in needed.streams("plain_still"):
            for channel in CHANNELS:
                a, b = (c.read("plain_still", stream, channel.name, frame) for c in (needed, everything))
                assert a.dtype == b.dtype and np.array_equal(a, b), (channel.name, stream, frame)


def test_reader_returns_what_the_table_declares(two_quads_corpus):
    corpus = Corpus(two_quads_corpus)
    for channel in CHANNELS:
        array = corpus.read(SEQUENCE, "lr_x3", channel.name, 2)
        assert array.shape == (18, 32, channel.components)
        assert array.dtype == (np.uint32 if channel.dtype == "uint" else np.float32)


def test_damage_and_absence_are_named(two_quads_corpus, tmp_path):
    import shutil

    shutil.copytree(two_quads_corpus, tmp_path / "c")
    corpus = Corpus(tmp_path / "c")
    file, _ = corpus.file_of(SEQUENCE, "hr", "color", 3)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"000003\.exr.*sha256"):
        corpus.read(SEQUENCE, "hr", "color", 3)
    file.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        corpus.read(SEQUENCE, "hr", "color", 3)
    for arguments, words in (
        ((SEQUENCE, "lr_x9", "color", 0), "no stream"),
        ((SEQUENCE, "hr", "colour", 0), "unknown channel"),
        (("other", "hr", "color", 0), "no sequence"),
        ((SEQUENCE, "hr", "color", 99), "000099.json"),
    ):
        with pytest.raises(InputError, match=words):
            corpus.read(*arguments)
    with pytest.raises(InputError, match="not a corpus"):
        Corpus(tmp_path)


def test_reading_imports_neither_drjit_nor_mitsuba(two_quads_corpus):
    code = (
        f"import sys; from framepairs.corpus import Corpus; c = Corpus({str(two_quads_corpus)!r});"
        f"c.read('{SEQUENCE}', 'hr', 'color', 0); sys.exit(any(m in sys.modules for m in ('drjit', 'mitsuba')))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
