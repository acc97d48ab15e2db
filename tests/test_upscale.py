"""The upscaler: identities, alignment, convergence of what stands to its truth, and what must not be left behind what moves."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import at, path_of
from framepairs.channels import SEEN_BY_PREVIOUS_CAMERA
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.jitter import jitter
from framepairs.metrics import flip, psnr, ssim, to_display
from framepairs.pipeline import render_sequence
from framepairs.upscaling.comparison import judge_sequence, summarise
from framepairs.upscaling.inputs import UpscaleFrame
from framepairs.upscaling.sequence import METHODS, upscale_sequence
from framepairs.upscaling.settings import UpscaleSettings
from framepairs.upscaling.spatial import SPATIAL, upscale
from framepairs.warp import to_array, to_image
from sample_corpus import MOVING, STILL, render_two_quads, two_quads_job
from upscaled_scenes import BRIGHT, fence, render, sliding_card

SEQUENCE = "two_quads_slide"
JITTERED = "lr_x2_jittered_mip-1"
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


@pytest.fixture(scope="module")
def still_corpus(tmp_path_factory):
    """The wall and the card of `two_quads`, at rest for 33 frames: Halton 32 at 2x, and once around."""
    job = two_quads_job(tmp_path_factory.mktemp("still") / "c", scales=(2,), hr_mip0=True)
    job = replace(job, path=path_of(*[at(0.2, 0.03, 0.1)] * 33))
    list(render_sequence(job, range(33)))
    return Corpus(job.out)


def scores(corpus, sequence, *pairs, truth="hr", settings=None):
    """PSNR of every frame, per pair."""
    options = {} if settings is None else {"settings": settings}
    frames = list(judge_sequence(corpus, sequence, list(pairs), truth, **options))
    return [[frame.results[k].psnr for frame in frames] for k in range(len(pairs))]


def test_what_stands_converges_to_the_truth_of_its_texture_level(still_corpus):
    """The figures that are asked of a static scene with Halton 32 at 2x."""
    pairs = [(JITTERED, name) for name in ("accumulate", "oracle", "temporal")]
    accumulated, oracle, temporal, bicubic = scores(
        still_corpus, SEQUENCE, *pairs, ("lr_x2", "bicubic"), truth="hr_mip0"
    )
    assert accumulated[31] >= bicubic[31] + 10
    assert accumulated[31] > accumulated[15] > accumulated[0]
    assert np.diff(accumulated[:32]).min() > -1
    assert abs(oracle[31] - accumulated[31]) < 1
    assert temporal[31] > accumulated[31] - 5


def test_the_kernel_that_fsr_uses_converges_too(still_corpus):
    settings = UpscaleSettings(kernel="radial_lanczos")
    [radial] = scores(still_corpus, SEQUENCE, (JITTERED, "temporal"), truth="hr_mip0", settings=settings)
    [gaussian] = scores(still_corpus, SEQUENCE, (JITTERED, "temporal"), truth="hr_mip0")
    assert gaussian[31] - 3 < radial[31] != gaussian[31]


@pytest.mark.parametrize("stream", ["lr_x2_jittered_mip-1", "lr_x3_jittered_mip-1.585"])
def test_accumulation_converges_on_the_still_segment(two_quads_corpus, stream):
    corpus = Corpus(two_quads_corpus)
    native = stream.split("_jittered")[0]
    accumulated, bicubic = scores(corpus, SEQUENCE, (stream, "accumulate"), (native, "bicubic"))
    gained = accumulated[MOVING:]
    assert len(gained) == STILL
    assert gained[0] < gained[3] < gained[7] < gained[15]
    assert gained[15] >= bicubic[-1] + 6


def test_unbiased_frames_accumulate_to_the_truth_without_bias(still_corpus):
    """LR at bias -log2 S reads the texture level of native HR: that is hr_mip0's, while hr's is two levels finer."""
    pair = (JITTERED, "accumulate")
    sharper, own = (scores(still_corpus, SEQUENCE, pair, truth=truth)[0][-1] for truth in ("hr", "hr_mip0"))
    assert own > sharper + 3


def test_history_is_rejected_behind_what_moves(tmp_path):
    """A card slides by 8 HR pixels a frame. What it uncovers is the wall at once: at most 1 % of the card's light is left, and
    1 % of the wall's is missing nowhere but beside edges."""
    step = 8 / 96 * 2 * 3 * np.tan(np.radians(30)) * 96 / 54
    corpus = Corpus(render(sliding_card(step), [at(0, 0, 0)] * 6, tmp_path / "c"))
    sequence = corpus.sequences[0]
    for method in ("temporal", "oracle", "guided_temporal", "guided_oracle"):
        seen = 0
        for frame in upscale_sequence(corpus, sequence, JITTERED, method):
            if frame.frame == 0:
                continue
            truth = corpus.read(sequence, "hr", "color", frame.frame)
            uncovered = corpus.read(sequence, "hr", "visibility", frame.frame)[..., 0] & SEEN_BY_PREVIOUS_CAMERA == 0
            inside = uncovered & ~beside_an_edge(truth[..., 0], 3)
            seen += inside.sum()
            assert np.abs(frame.image - truth)[inside].max() <= 0.01 * BRIGHT, (method, frame.frame)
        assert seen > 100, method


def beside_an_edge(plane, reach):
    """Within `reach` pixels of a change."""
    near = np.zeros(plane.shape, bool)
    for axis in (0, 1):
        for shift in range(-reach, reach + 1):
            near |= np.abs(np.roll(plane, shift, axis) - plane) > 1e-3
    return near


def test_a_thin_fence_stands_still(tmp_path):
    """Bars a third of an LR pixel wide, 64 frames: over the later half the image's mean deviation over time is 0.6 codes or
    less, while one frame alone flickers by more than ten times that."""
    corpus = Corpus(render(fence(), [at(0, 0, 0)] * 64, tmp_path / "c", channels="needed"))
    pairs = [(JITTERED, name) for name in ("bicubic", "temporal", "oracle")]
    rows = {row["method"]: row for row in summarise(corpus, corpus.sequences[0], pairs, "hr_mip0")}
    assert rows["bicubic"]["static_std"] > 6
    for method in ("temporal", "oracle"):
        assert rows[method]["static_std"] <= 0.6, method
        assert rows[method]["psnr"] > rows["bicubic"]["psnr"] + 3, method


@pytest.mark.parametrize("moving", [0.0, 1.5])
@pytest.mark.parametrize("method", ["temporal", "guided_temporal"])
def test_light_that_changes_is_followed_at_once(method, moving):
    """A wall that nothing hides, twelve frames dark and then bright: history lies outside what the samples vary by, which is
    nothing. Where nothing moves, `accumulate` mixes both by weight, and `oracle` believes that a surface keeps its look."""
    found = {}
    for name in (method, "accumulate", "oracle"):
        history = None
        for k in range(13):
            history, planes = METHODS[name].step(history, wall_frame(0.1 if k < 12 else 0.9, k, moving), UpscaleSettings())
        found[name] = to_array(planes, 14, 10)
    # the variance of equal samples rounds to some epsilon, 3 times 1.7 of its root are 2e-3, and expanding is by (1 + 0.9)^2
    assert np.abs(found[method] - 0.9).max() < 0.01
    if not moving:
        assert found["accumulate"].max() < 0.5 and found["oracle"].max() < 0.5


def wall_frame(light, index, moving):
    """A wall of albedo 1 before the camera, lit evenly, as LR 7x5 and HR 14x10; it moves by `moving` HR pixels a frame."""
    constants = {"color": (light,) * 3, "emission": (0,) * 3, "brdf": (1,) * 3, "normal": (0, 0, 1), "depth": (2,)}

    def buffer(width, height, motion):
        values = constants | {"motion": (motion, 0)}
        arrays = {name: np.full((height, width, len(value)), value, np.float32) for name, value in values.items()}
        codes = {"object_id": 1, "visibility": 7}
        arrays |= {name: np.full((height, width, 1), value, np.uint32) for name, value in codes.items()}
        return {name: to_image(array) for name, array in arrays.items()}

    return UpscaleFrame(
        lr=buffer(7, 5, moving / 2), hr=buffer(14, 10, moving), size=(14, 10), jitter=jitter(index, 32), exposure=1.0,
        previous_depth=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


def test_wrong_jitter_does_not_converge(two_quads_corpus, monkeypatch):
    """What the data claims matters: with the jitter negated, accumulation loses most of what it gains."""
    corpus = Corpus(two_quads_corpus)
    right = scores(corpus, SEQUENCE, (JITTERED, "accumulate"))[0][-1]
    real = corpus.record

    def negated(sequence, frame):
        record = real(sequence, frame)
        entry = record.streams[JITTERED]
        turned = entry.model_copy(update={"jitter": tuple(-v for v in entry.jitter)})
        return record.model_copy(update={"streams": {**record.streams, JITTERED: turned}})

    monkeypatch.setattr(corpus, "record", negated)
    wrong = scores(corpus, SEQUENCE, (JITTERED, "accumulate"))[0][-1]
    assert wrong < right - 3


@pytest.mark.parametrize("method", ["accumulate", "temporal", "oracle", "guided_temporal", "guided_oracle"])
def test_history_is_dropped_at_the_cut(two_quads_corpus, method):
    """The first frame after the cut equals that of a corpus that begins there."""
    corpus, alone = Corpus(two_quads_corpus), Corpus(two_quads_corpus)
    alone.frames = lambda sequence: list(range(MOVING, MOVING + 2))
    for fresh in upscale_sequence(alone, SEQUENCE, JITTERED, method):
        after = [each for each in upscale_sequence(corpus, SEQUENCE, JITTERED, method) if each.frame == fresh.frame]
        assert np.array_equal(after[0].image, fresh.image)


def test_history_ends_where_a_frame_is_missing(two_quads_corpus):
    gap, alone = Corpus(two_quads_corpus), Corpus(two_quads_corpus)
    gap.frames = lambda sequence: [0, 1, 3]
    alone.frames = lambda sequence: [3]
    *_, after = upscale_sequence(gap, SEQUENCE, JITTERED, "temporal")
    [fresh] = upscale_sequence(alone, SEQUENCE, JITTERED, "temporal")
    assert np.array_equal(after.image, fresh.image)


def test_every_method_takes_every_stream_of_any_scale(tmp_path):
    """Also scales that are no whole numbers and differ between the axes, and a scale of 1 and 16."""
    corpus = Corpus(render_two_quads(tmp_path / "c", display=(50, 30), scales=(1, 2.7, 16), antialiasing=4, channels="needed"))
    corpus.frames = lambda sequence: [0, 1, 2]
    sizes = {tuple(corpus.record(SEQUENCE, 0).streams[name].size) for name in corpus.streams(SEQUENCE) if "lr" in name}
    assert sizes == {(50, 30), (19, 11), (3, 2)}
    for stream in corpus.streams(SEQUENCE):
        for method in METHODS if stream.startswith("lr_") else ():
            for frame in upscale_sequence(corpus, SEQUENCE, stream, method):
                assert frame.image.shape == (30, 50, 3) and np.isfinite(frame.image).all(), (stream, method)


def test_accumulating_at_scale_1_without_jitter_changes_nothing(tmp_path):
    corpus = Corpus(render_two_quads(tmp_path / "c", scales=(1,), variants=("native",), antialiasing=1, channels="needed"))
    frames = list(range(MOVING, MOVING + 4))
    corpus.frames = lambda sequence: frames
    for result in upscale_sequence(corpus, SEQUENCE, "lr_x1", "accumulate"):
        given = corpus.read(SEQUENCE, "lr_x1", "color", result.frame)
        if result.frame == frames[0]:
            assert np.array_equal(result.image, given)
        # each later frame is a weighted mean of equal values: three roundings of each
        assert np.allclose(result.image, given, rtol=3 * 4 * np.finfo(np.float32).eps, atol=0)


def test_guides_and_demodulation_keep_a_texture(two_quads_corpus):
    corpus = Corpus(two_quads_corpus)
    pairs = [(JITTERED, name) for name in ("bicubic", "joint_bilateral", "guided", "guided_temporal")]
    means = [np.mean(values) for values in scores(corpus, SEQUENCE, *pairs)]
    bicubic, bilateral, guided, temporal = means
    assert guided > bilateral + 3 and guided > bicubic + 3 and temporal > guided - 0.5


def test_an_overlay_is_upscaled_as_it_is(tmp_path):
    """G-buffers know nothing of what is drawn over colour: `guided` takes it from the bicubic picture."""
    corpus = Corpus(render_two_quads(tmp_path / "c", scales=(2,), channels="all"))
    read, covered = corpus.read, np.zeros((54, 96, 1), np.float32)
    covered[20:30, 30:60] = 1

    def overlaid(sequence, stream, channel, frame):
        return covered if (stream, channel) == ("hr", "overlay") else read(sequence, stream, channel, frame)

    corpus.read = overlaid
    frames = [next(upscale_sequence(corpus, SEQUENCE, "lr_x2", name)).image for name in ("guided", "bicubic")]
    inside = covered[..., 0] > 0
    assert np.array_equal(frames[0][inside], frames[1][inside])
    assert np.abs(frames[0] - frames[1])[~inside].max() > 0.05


def test_unknown_methods_streams_and_channels_are_refused(two_quads_corpus, tmp_path):
    corpus = Corpus(two_quads_corpus)
    with pytest.raises(InputError, match="unknown method 'dlss'"):
        list(upscale_sequence(corpus, SEQUENCE, "lr_x2", "dlss"))
    with pytest.raises(InputError, match="lr_x9"):
        list(upscale_sequence(corpus, SEQUENCE, "lr_x9", "bicubic"))
    bare = Corpus(render_two_quads(tmp_path / "c", scales=(2,), channels=("color", "depth"), antialiasing=1))
    with pytest.raises(InputError, match="'motion' was not rendered"):
        list(upscale_sequence(bare, SEQUENCE, "lr_x2", "temporal"))


def test_extreme_colours_stay_finite():
    bad = RNG.uniform(0, 1, (5, 7, 3)).astype(np.float32)
    bad[0, 0] = 1e6
    for method in SPATIAL:
        shown = to_display(np.maximum(to_array(upscale(to_image(bad), method, (14, 10), (0.2, 0.1)), 14, 10), 0), 0.0)
        assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1


def test_psnr_ssim_and_flip_by_hand():
    truth = np.full((16, 18, 3), 0.5, np.float32)
    assert psnr(truth + np.float32(0.1), truth) == pytest.approx(20, abs=1e-4)
    assert psnr(truth, truth) == np.inf and ssim(truth, truth) == pytest.approx(1) and flip(truth, truth) == 0
    assert np.isnan(ssim(np.zeros((3, 3, 3)), np.ones((3, 3, 3))))
    black, white = np.zeros((24, 24, 3), np.float32), np.ones((24, 24, 3), np.float32)
    assert flip(black, white) == pytest.approx(1, abs=0.05)  # the metric is 1 for the largest difference that there is
