"""The upscaler: identities, alignment, and convergence of a static scene to its truth."""

import numpy as np
import pytest

from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.metrics import psnr, ssim, to_display
from framepairs.upscale import METHODS, SPATIAL, compare_sequence, summarise, upscale, upscale_sequence
from framepairs.warp import to_array, to_image
from sample_corpus import MOVING, STILL, render_two_quads

SEQUENCE = "two_quads_slide"
RNG = np.random.default_rng(2)


@pytest.mark.parametrize("method", SPATIAL)
def test_scale_1_without_jitter_is_the_identity(method):
    image = RNG.uniform(0, 5, (5, 7, 3)).astype(np.float32)
    assert np.array_equal(to_array(upscale(to_image(image), method, (7, 5), (0, 0)), 7, 5), image)


@pytest.mark.parametrize("size", [(20, 12), (19, 13), (27, 11)])
def test_a_linear_ramp_is_reproduced_between_centres_for_any_scale_and_jitter(size):
    """LR pixel (i, j) shows place centre - J: a ramp over the frame must come out as the same ramp, not shifted."""
    width, height, jitter = 10, 6, (0.3, -0.4)
    x = (np.arange(width) + 0.5 - jitter[0]) / width
    y = (np.arange(height) + 0.5 - jitter[1]) / height
    lr = np.stack(np.broadcast_arrays(x[None], y[:, None], 0 * x[None] * y[:, None]), axis=-1).astype(np.float32)
    got = to_array(upscale(to_image(lr), "bilinear", size, jitter), *size)
    expected_x, expected_y = (np.arange(size[0]) + 0.5) / size[0], (np.arange(size[1]) + 0.5) / size[1]
    inside_x = (expected_x > x[0]) & (expected_x < x[-1])
    inside_y = (expected_y > y[0]) & (expected_y < y[-1])
    assert np.abs(got[:, inside_x, 0] - expected_x[inside_x]).max() < 1e-6
    assert np.abs(got[inside_y, :, 1] - expected_y[inside_y, None]).max() < 1e-6


@pytest.mark.parametrize("stream", ["lr_x2_jittered_mip-1", "lr_x3_jittered_mip-1.585"])
def test_accumulation_converges_on_the_still_segment(two_quads_corpus, stream):
    corpus = Corpus(two_quads_corpus)
    native = stream.split("_jittered")[0]
    accumulated, bicubic = scores(corpus, (stream, "accumulate"), (native, "bicubic"))
    gained = accumulated[MOVING:]
    assert len(gained) == STILL
    assert gained[0] < gained[3] < gained[7] < gained[15]
    assert gained[15] >= bicubic[-1] + 6


def test_unbiased_frames_accumulate_to_the_truth_without_bias(tmp_path):
    """LR at bias -log2 S reads the texture level of native HR: that is hr_mip0's, while hr's is two levels finer."""
    names = ("color", "motion", "visibility")
    corpus = Corpus(render_two_quads(tmp_path / "c", scales=(2,), hr_mip0=True, channels=names))
    pair = ("lr_x2_jittered_mip-1", "accumulate")
    sharper, own = (scores(corpus, pair, truth=truth)[0][-1] for truth in ("hr", "hr_mip0"))
    assert own > sharper + 3  # measured: 34.0 and 29.0 dB


def scores(corpus, *pairs, truth="hr"):
    """PSNR of every frame, per pair."""
    frames = list(compare_sequence(corpus, SEQUENCE, list(pairs), truth))
    return [[frame[k][0].psnr for frame in frames] for k in range(len(pairs))]


def test_wrong_jitter_does_not_converge(two_quads_corpus, monkeypatch):
    """What the data claims matters: with the jitter negated, accumulation loses most of what it gains."""
    corpus = Corpus(two_quads_corpus)
    stream = "lr_x2_jittered_mip-1"
    right = scores(corpus, (stream, "accumulate"))[0][-1]
    real = corpus.record

    def negated(sequence, frame):
        record = real(sequence, frame)
        entry = record.streams[stream]
        turned = entry.model_copy(update={"jitter": tuple(-v for v in entry.jitter)})
        return record.model_copy(update={"streams": {**record.streams, stream: turned}})

    monkeypatch.setattr(corpus, "record", negated)
    wrong = scores(corpus, (stream, "accumulate"))[0][-1]
    assert wrong < right - 3


def test_history_is_dropped_at_the_cut(two_quads_corpus):
    corpus = Corpus(two_quads_corpus)
    frames = dict((frame, image) for frame, image, _ in upscale_sequence(corpus, SEQUENCE, "lr_x2", "accumulate"))
    fresh = to_image(corpus.read(SEQUENCE, "lr_x2", "color", MOVING))
    from framepairs.upscale import AccumulateSettings, accumulate, resolved

    zeros = to_image(np.zeros((27, 48, 2), np.float32))
    alone = resolved(accumulate(None, fresh, zeros, zeros, (96, 54), (0, 0), AccumulateSettings()))
    assert np.array_equal(frames[MOVING], to_array(alone, 96, 54))


def test_summary_has_the_whole_and_the_still_part(two_quads_corpus, tmp_path):
    rows = summarise(Corpus(two_quads_corpus), SEQUENCE, [("lr_x2", "nearest")], tmp_path)
    assert [row["part"] for row in rows] == ["all", "still", "still, end"]
    assert [row["frames"] for row in rows] == [MOVING + STILL, STILL - 1, 1]
    assert len(list(tmp_path.rglob("*.png"))) == MOVING + STILL


def test_unknown_methods_are_refused(two_quads_corpus):
    with pytest.raises(InputError, match="unknown method 'dlss'"):
        list(upscale_sequence(Corpus(two_quads_corpus), SEQUENCE, "lr_x2", "dlss"))
    assert METHODS == ("nearest", "bilinear", "bicubic", "accumulate")


def test_extreme_colours_stay_finite():
    bad = RNG.uniform(0, 1, (5, 7, 3)).astype(np.float32)
    bad[0, 0] = 1e6
    for method in SPATIAL:
        shown = to_display(np.maximum(to_array(upscale(to_image(bad), method, (14, 10), (0.2, 0.1)), 14, 10), 0), 0.0)
        assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1


def test_psnr_and_ssim_by_hand():
    truth = np.full((16, 18, 3), 0.5, np.float32)
    assert psnr(truth + np.float32(0.1), truth) == pytest.approx(20, abs=1e-4)
    assert psnr(truth, truth) == np.inf and ssim(truth, truth) == pytest.approx(1)
    assert np.isnan(ssim(np.zeros((3, 3, 3)), np.ones((3, 3, 3))))
