"""Warp consistency on a plane and a card whose motion is known by hand, and on a rendered corpus."""

import math

import numpy as np
import pytest

from framepairs.consistency import (
    DARK,
    GREY,
    RED,
    TOLERANCES,
    consistency_picture,
    frame_errors,
    sequence_consistency,
    summarise_errors,
    warp_consistency,
    warp_errors,
    worst_frames,
)
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.manifest import CameraRecord

WIDTH, HEIGHT, DISTANCE, STEP = 24, 16, 4.0, 2.0  # the camera's step moves the wall by STEP pixels to the left
JITTER, PREVIOUS_JITTER = (0.25, -0.375), (-0.125, 0.5)
CLIP = np.diag([1.0, WIDTH / HEIGHT, -1.0, 1.0])
CLIP[2:, 2:] = [[-1.0, -0.02], [-1.0, 0.0]]
STILL = (JITTER, PREVIOUS_JITTER, [])


def camera() -> CameraRecord:
    """x / z = 1 is the edge of the frame: a pixel at DISTANCE is 2 DISTANCE / WIDTH wide."""
    previous, present = np.eye(4), np.eye(4)
    present[0, 3] = -STEP * 2 * DISTANCE / WIDTH  # the camera went right
    matrices = {
        "view_from_world": present, "previous_view_from_world": previous,
        "clip_from_view": CLIP, "previous_clip_from_view": CLIP,
    }  # fmt: skip
    rows = {name: matrix.tolist() for name, matrix in matrices.items()}
    return CameraRecord(fov_y_rad=2 * math.atan(HEIGHT / WIDTH), near=0.01, far=1e9, **rows)


def wall(jitter, offset: float) -> dict[str, np.ndarray]:
    """A wall of one object with a linear albedo, whose place in it is the place in the frame + offset pixels."""
    j, i = np.indices((HEIGHT, WIDTH))
    u, v = i + 0.5 - jitter[0] + offset, j + 0.5 - jitter[1]
    one = np.ones((HEIGHT, WIDTH, 1), np.float32)
    return {
        "object_id": one.astype(np.uint32),
        "depth": one * np.float32(DISTANCE),
        "motion": one * np.float32([STEP, 0]),
        "visibility": np.where(u - offset + STEP < WIDTH, 7, 2).astype(np.uint32)[..., None],
        "albedo": (0.5 + np.stack([u, v, u + v], axis=-1) / 100).astype(np.float32),
        "normal": one * np.float32([0, 0, 1]),
    }


def frames():
    """The present frame, and the one before it, in which all stood STEP pixels further right."""
    return wall(JITTER, STEP), wall(PREVIOUS_JITTER, 0)


def test_a_plane_before_a_sliding_camera_is_consistent():
    now, before = frames()
    errors = warp_errors(now, before, camera(), *STILL)
    # fractions of a frame 24 pixels wide in float32, reprojected in float64: a few roundings of 24 pixels
    assert np.nanmax(errors["position"]) < 4 * 24 * 2.0**-24
    assert np.nanmax(errors["object_id"]) == 0 and np.nanmax(errors["normal"]) == 0
    # a linear albedo lies between its neighbours but for float32's rounding
    assert np.nanmax(errors["albedo"]) < 2 * 2.0**-24
    for name, values in errors.items():
        measure = summarise_errors(name, values)
        assert measure.consistent == 1 and measure.pixels == np.count_nonzero(~np.isnan(values)) > 200


def test_the_band_is_left_out_and_no_more():
    now, before = frames()
    now["object_id"][:, 12:] = before["object_id"][:, 14:] = 2  # a border that moves with the wall
    for band in (1, 2):
        judged = ~np.isnan(warp_errors(now, before, camera(), *STILL, band=band)["object_id"])
        columns = set(np.flatnonzero(judged[8]))
        # J(t-1) - J(t) = (-0.375, 0.875): pixel i is found in column i + 2 (rounded down), whose band must be clear as well;
        # columns 22 and 23 were outside the previous frame
        assert columns == set(range(band, 12 - band)) | set(range(12 + band, 22))
    before["object_id"][6, 8] = 3  # in the previous frame alone, where row 5, column 6 is found
    for band in (1, 2):
        judged = ~np.isnan(warp_errors(now, before, camera(), *STILL, band=band)["object_id"])
        assert not judged[5 + band, 6] and not judged[5, 6 + band]
        assert judged[6 + band, 6] and judged[5, 7 + band]


def test_motion_that_is_wrong_by_half_a_pixel_is_off_by_half_a_pixel():
    now, before = frames()
    now["motion"] = now["motion"] + np.float32([0.3, -0.4])
    errors = warp_errors(now, before, camera(), *STILL)["position"]
    # reprojection does not depend on where motion leads, as the depth is the same everywhere
    assert np.nanmax(np.abs(errors - 0.5)) < 4 * 24 * 2.0**-24
    assert summarise_errors("position", errors).consistent == 0


def test_each_measure_finds_its_own_mistake():
    for name, change in {
        "object_id": lambda a: a + 1,
        "albedo": lambda a: a + np.float32(0.2),
        "normal": lambda a: a[..., [0, 2, 1]],
        "depth": lambda a: a * 3,
    }.items():
        now, before = frames()
        part = (slice(4, 12), slice(6, 18))
        before[name][part] = change(before[name][part])
        errors = warp_errors(now, before, camera(), *STILL)
        wrong = {key for key, values in errors.items() if summarise_errors(key, values).consistent < 1}
        # a depth that is not what it was shows only where the object is allowed to move: see the next test
        assert wrong == ({name} if name != "depth" else set()), name
    errors = warp_errors(*frames(), camera(), *STILL)
    assert set(errors) == set(TOLERANCES)


def test_normals_are_held_against_the_most_alike_of_four_in_degrees():
    now, before = frames()
    now["normal"][8, 8] = 0  # as the background has it
    assert np.isnan(warp_errors(now, before, camera(), *STILL)["normal"][8, 8])
    before["normal"][6, 8] = (0, 1, 0)  # alone: three others are around every place that touches it
    assert np.nanmax(warp_errors(now, before, camera(), *STILL)["normal"]) == 0
    before["normal"][:, 10:] = 1.0005 * np.float32([0, 0.8, 0.6])  # stored lengths are 1 to half precision only
    errors = warp_errors(now, before, camera(), *STILL)["normal"]
    # pixel i is found at i + 2.125, between the columns i + 1 and i + 2
    assert np.nanmax(errors[:, :9]) == 0
    # a chord of 0.9 from roundings of units: 2 asin(chord / 2) is steeper by 1.2, and 57 degrees a radian
    expected = np.degrees(np.arccos(0.6))
    assert np.nanmax(np.abs(errors[:, 9:] - expected)) < 8 * 1.2 * 57.3 * 2.0**-24


@pytest.mark.parametrize("value", [0.2, 0.8])
def test_albedo_is_the_mean_distance_from_the_range_of_four(value):
    now, before = frames()
    now["albedo"][:], before["albedo"][:] = 0.5, 0.5
    before["albedo"][:, 10:, 1] = value
    errors = warp_errors(now, before, camera(), *STILL)["albedo"]
    assert np.nanmax(errors[:, :9]) == 0
    assert np.nanmax(np.abs(errors[:, 9:] - 0.1)) < 4 * 2.0**-24  # 0.3 in one of three components


def test_moving_objects_may_move_in_space_but_their_normals_are_not_judged():
    """A card nearer than the wall that goes with the camera: its motion is 0."""
    now, before = frames()
    card = (slice(3, 13), slice(5, 19))
    for frame in (now, before):
        frame["object_id"][card], frame["depth"][card] = 2, 2.0
    now["motion"][card] = 0
    blamed = warp_errors(now, before, camera(), *STILL)
    excused = warp_errors(now, before, camera(), JITTER, PREVIOUS_JITTER, [2])
    inner = (slice(6, 10), slice(8, 16))
    # at half the distance the camera's step is twice as many pixels
    assert np.abs(blamed["position"][inner] - 2 * STEP).max() < 8 * 24 * 2.0**-24
    assert excused["position"][inner].max() < TOLERANCES["position"]
    assert np.isnan(excused["normal"][inner]).all() and not np.isnan(blamed["normal"][inner]).any()


def test_unseen_pixels_are_not_judged():
    now, before = frames()
    now["visibility"][:, :10] = 3
    errors = warp_errors(now, before, camera(), *STILL)
    assert all(np.isnan(values[:, :10]).all() for values in errors.values())
    now["visibility"][:] = 0
    nothing = warp_errors(now, before, camera(), *STILL)
    measure = summarise_errors("position", nothing["position"])
    assert measure.pixels == 0 and measure.consistent == 1 and np.isnan(measure.percentiles).all()
    assert warp_consistency(now, before, camera(), *STILL).pixels == 0


def test_percentiles_are_errors_that_occur():
    errors = np.full((10, 21), np.nan)
    errors.ravel()[:100] = np.arange(100) / 1000  # the percentiles 50, 90 and 99 fall on places 49.5, 89.1 and 98.01
    measure = summarise_errors("position", errors)
    assert measure.percentiles == (0.05, 0.09, 0.099, 0.099)
    assert measure.pixels == 100 and measure.consistent == 0.51
    errors[0, 0] = np.inf
    assert summarise_errors("position", errors).percentiles[3] == np.inf


def test_pictures_by_hand():
    nan = np.nan
    errors = {"position": np.array([[0.0, 0.06, nan]]), "albedo": np.array([[0.1, 0.0, nan]])}
    assert consistency_picture(errors)[0].tolist() == [list(GREY), list(RED), list(DARK)]
    errors["normal"] = np.array([[nan, nan, 90.0]])
    picture = consistency_picture(errors)
    assert picture.dtype == np.uint8 and picture[0].tolist() == [list(GREY), list(RED), list(RED)]


def test_a_rendered_sequence_is_consistent_but_for_a_planted_frame(two_quads_corpus, monkeypatch):
    corpus, stream = Corpus(two_quads_corpus), "lr_x2_jittered_mip-1"
    sequence = corpus.sequences[0]
    results = list(sequence_consistency(corpus, sequence, stream))
    assert [result.frame for result in results] == [1, 2, 3, *range(5, 20)]  # 0 begins the path, 4 follows a cut
    assert {m.consistent for result in results for m in result.measures.values()} == {1.0}
    with pytest.raises(InputError, match="no frame of the same shot precedes it"):
        frame_errors(corpus, sequence, stream, 4)

    read = corpus.read
    monkeypatch.setattr(corpus, "read", lambda *key: -read(*key) if key[2:] == ("motion", 2) else read(*key))
    results = list(sequence_consistency(corpus, sequence, stream))
    worst = worst_frames(results, "position", count=2)
    assert [result.frame for result in worst][0] == 2 and len(worst) == 2
    assert worst[0].measures["position"].consistent < 0.1 and worst[1].measures["position"].consistent == 1
    picture = consistency_picture(frame_errors(corpus, sequence, stream, 2))
    assert picture.shape == (27, 48, 3) and np.all(picture == RED, axis=-1).sum() > 100


def test_the_positions_of_what_deforms_are_not_judged():
    now, before = frames()
    now["motion"] = now["motion"] + np.float32([3, 0])
    rigid = warp_errors(now, before, camera(), JITTER, PREVIOUS_JITTER, [1, 2])["position"]
    soft = warp_errors(now, before, camera(), JITTER, PREVIOUS_JITTER, [1, 2], [1, 2])["position"]
    assert not np.isnan(rigid).all() and np.isnan(soft[now["object_id"][..., 0] > 0]).all()
