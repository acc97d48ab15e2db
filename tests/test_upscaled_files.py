"""What `upscale` writes and prints: EXR, PNG, differences, the page, trajectories, the table; and what it refuses."""

import json

import numpy as np
import pytest
from PIL import Image

from framepairs.channels import CHANNEL
from framepairs.corpus import Corpus
from framepairs.exr import decode
from framepairs.metrics import to_display
from framepairs.preview import LABEL
from framepairs.upscaling.comparison import FLIP_FRAMES, judge_sequence, summarise
from framepairs.upscaling.pictures import DIFFERENCE_GAIN, ROW_HEIGHT
from framepairs.upscaling.sequence import upscale_sequence
from sample_corpus import MOVING, STILL
from test_cli import framepairs

SEQUENCE, STREAM, ROW = "two_quads_slide", "lr_x2_jittered_mip-1", 30


@pytest.fixture(scope="module")
def written(two_quads_corpus, tmp_path_factory):
    out = tmp_path_factory.mktemp("upscaled") / "out"
    options = ["--stream", STREAM, "--method", "bicubic", "--method", "temporal", "--trajectory", ROW, "--json"]
    done = framepairs("upscale", two_quads_corpus, *options, "--out", out)
    assert done.returncode == 0, done.stderr
    return out, json.loads(done.stdout)


def test_frames_are_written_as_they_are_computed(written, two_quads_corpus):
    out, corpus = written[0], Corpus(two_quads_corpus)
    for result in upscale_sequence(corpus, SEQUENCE, STREAM, "temporal"):
        file = out / SEQUENCE / STREAM / "temporal" / f"{result.frame:06d}.exr"
        stored, header = decode(file.read_bytes(), CHANNEL["color"].exr, file)
        assert np.array_equal(stored, result.image.astype(np.float16))
        assert header["framepairs:method"] == "temporal" and header["framepairs:stream"] == STREAM
        shown = to_display(np.maximum(result.image, 0), 0.0)
        truth = to_display(corpus.read(SEQUENCE, "hr", "color", result.frame), 0.0)
        picture = np.asarray(Image.open(file.with_suffix(".png")))
        assert np.array_equal(picture, np.round(shown * 255).astype(np.uint8))
        off = np.asarray(Image.open(file.with_name(f"{result.frame:06d}_difference.png")))
        expected = np.round(np.clip(DIFFERENCE_GAIN * np.abs(shown - truth), 0, 1) * 255).astype(np.uint8)
        assert np.array_equal(off, expected)


def test_truth_and_lr_frames_stand_beside_them(written):
    folder = written[0] / SEQUENCE
    names = {f"{frame:06d}.png" for frame in range(MOVING + STILL)}
    for place, size in (("truth", (96, 54)), (f"{STREAM}/lr", (48, 27))):
        assert {file.name for file in (folder / place).iterdir()} == names
        assert Image.open(folder / place / "000003.png").size == size
    assert {file.name for file in (folder / STREAM).iterdir()} == {"lr", "bicubic", "temporal"}


def test_the_page_names_files_that_are_there(written):
    out = written[0]
    text = (out / "index.html").read_text()
    start = text.index('<script id="data"')
    [entry] = json.loads(text[text.index(">", start) + 1 : text.index("</script>", start)])
    assert [picture["name"] for picture in entry["pictures"]] == ["truth", STREAM, f"{STREAM} bicubic", f"{STREAM} temporal"]
    files = [file for picture in entry["pictures"] for file in picture["files"]]
    assert len(files) == 4 * (MOVING + STILL) and all((out / file).is_file() for file in files)


def test_a_trajectory_shows_one_row_of_every_frame(written, two_quads_corpus):
    out, frames = written[0], MOVING + STILL
    picture = np.asarray(Image.open(out / SEQUENCE / f"trajectory_{ROW}.png"))
    cell = LABEL + ROW_HEIGHT * frames
    assert picture.shape == (3 * cell, 96, 3)
    for k, part in enumerate(("truth", f"{STREAM}/bicubic", f"{STREAM}/temporal")):
        for frame in range(frames):
            row = np.asarray(Image.open(out / SEQUENCE / part / f"{frame:06d}.png"))[ROW]
            assert np.array_equal(picture[k * cell + LABEL + ROW_HEIGHT * frame], row), (part, frame)


def test_rows_are_means_of_what_each_frame_measures(written, two_quads_corpus):
    corpus = Corpus(two_quads_corpus)
    pairs = [(STREAM, "bicubic"), (STREAM, "temporal")]
    frames = list(judge_sequence(corpus, SEQUENCE, pairs))
    assert sum(frame.results[0].flip is not None for frame in frames) == FLIP_FRAMES
    assert [frame.frame for frame in frames if not frame.follows] == [0, MOVING]
    for k, row in enumerate(written[1]):
        results = [frame.results[k] for frame in frames]
        assert (row["sequence"], row["stream"], row["method"]) == (SEQUENCE, *pairs[k])
        assert row["psnr"] == pytest.approx(np.mean([result.psnr for result in results]), rel=1e-6)
        assert row["ssim"] == pytest.approx(np.mean([result.ssim for result in results]), rel=1e-6)
        follow = [result for result, frame in zip(results, frames, strict=True) if frame.follows]
        changed = np.mean([result.change_error for result in follow])
        assert row["tpsnr"] == pytest.approx(-10 * np.log10(changed), rel=1e-6)
        assert row["warp_error"] == pytest.approx(np.mean([result.warp_error for result in follow]), rel=1e-4)
        settled = np.stack([result.shown for result in results[MOVING + STILL // 2 :]]).astype(float)
        assert row["static_std"] == pytest.approx(255 * settled.std(axis=0).mean(), rel=1e-6)
        assert row["ms"] > 0


def test_temporal_figures_tell_flicker_from_what_is_steady(written):
    bicubic, temporal = written[1]
    assert temporal["tpsnr"] > bicubic["tpsnr"] + 5
    assert temporal["static_std"] < bicubic["static_std"] / 4
    assert temporal["warp_error"] < bicubic["warp_error"] / 2
    assert temporal["flip"] < bicubic["flip"]


def test_what_a_corpus_cannot_tell_is_null(tmp_path):
    from sample_corpus import render_two_quads

    corpus = Corpus(render_two_quads(tmp_path / "c", scales=(2,), channels=("color",), antialiasing=1))
    [row] = summarise(corpus, SEQUENCE, [("lr_x2", "nearest")])
    assert row["warp_error"] is None and row["static_std"] is None and row["tpsnr"] is not None
    assert json.dumps(row, allow_nan=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--trajectory", "3"], "trajectory: needs --out"),
        (["--trajectory", "54", "--out", "o"], "must be a row from 0 to 53, not 54"),
        (["--method", "dlss"], "unknown method 'dlss'; known are nearest, bilinear"),
        (["--stream", "lr_x9"], "no LR stream 'lr_x9'; there are lr_x2"),
        (["--truth", "hr_native"], "no stream 'hr_native'"),
    ],
)
def test_what_is_not_there_is_refused_before_anything_is_written(two_quads_corpus, tmp_path, options, message):
    done = framepairs("upscale", two_quads_corpus, *options, cwd=tmp_path)
    assert done.returncode == 2 and message in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_corpus_is_not_written_into(two_quads_corpus):
    for out in (two_quads_corpus, two_quads_corpus / "upscaled"):
        done = framepairs("upscale", two_quads_corpus, "--method", "nearest", "--out", out)
        assert done.returncode == 2 and "lies in the corpus" in done.stderr
    assert not (two_quads_corpus / "index.html").exists() and not (two_quads_corpus / "upscaled").exists()


def test_an_output_folder_that_is_a_file_is_refused(two_quads_corpus, tmp_path):
    (tmp_path / "file").write_text("")
    done = framepairs("upscale", two_quads_corpus, "--method", "nearest", "--out", tmp_path / "file")
    assert done.returncode == 2 and "cannot be written into" in done.stderr
