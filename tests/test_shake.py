"""Shake: how strong, in which band, from which seed."""

import numpy as np
import pytest

from framepairs.camera.shake import fade_between, make_noise, noise_at, shaken
from framepairs.transforms import rigid, rotation_from_quaternion

LOW, HIGH = 2.0, 5.0


def record(seconds=400.0, rate=40.0, seed=3, **keys):
    noise = make_noise(**{"position": 0.3, "rotation_deg": 2.0, "low_hz": LOW, "high_hz": HIGH, "seed": seed, **keys})
    return np.array([noise_at(noise, t) for t in np.arange(round(seconds * rate)) / rate])


def test_its_root_mean_square_is_the_one_asked_for():
    values = record()
    # Sinusoids of near frequencies beat: the mean over 400 s of a band of 3 Hz varies by some 1 / sqrt(2 * 400 * 3 / 16).
    assert np.sqrt((values[:, :3] ** 2).sum(axis=1).mean()) == pytest.approx(0.3, rel=0.05)
    assert np.degrees(np.sqrt((values[:, 3:] ** 2).sum(axis=1).mean())) == pytest.approx(2.0, rel=0.05)
    assert np.sqrt((values[:, :3] ** 2).mean(axis=0)) == pytest.approx(0.3 / np.sqrt(3), rel=0.1)


def test_its_spectrum_lies_in_the_band():
    values = record() * np.hanning(16_000)[:, None]
    power = (np.abs(np.fft.rfft(values, axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(16_000, 1 / 40)
    inside = (hertz > LOW - 0.05) & (hertz < HIGH + 0.05)  # the window spreads a line over 4 / 400 s
    assert power[~inside].sum() < 1e-9 * power.sum()
    thirds = [power[(hertz >= a) & (hertz < a + 1)].sum() / power.sum() for a in (2, 3, 4)]
    assert min(thirds) > 0.1  # every part of the band has its share


def test_a_seed_is_a_noise_and_components_differ():
    assert np.array_equal(record(2), record(2)) and not np.allclose(record(2), record(2, seed=4))
    correlation = np.corrcoef(record().T) - np.eye(6)
    assert np.abs(correlation).max() < 0.2


def test_the_numbers_of_a_seed_stay_what_they_are():
    # From this module at its first version; NumPy keeps the raw bits of Philox.
    first = record(1, 1, seed=0)[0]
    np.testing.assert_allclose(
        first, [-0.149422214776, -0.273294081780, 0.337008815144, 0.008858073060, -0.020408444468, -0.010494155211], atol=1e-12
    )


def test_a_share_of_zero_changes_no_bit_and_one_moves_in_camera_axes():
    noise = make_noise(0.3, 2.0, LOW, HIGH, 1)
    pose = rigid(rotation_from_quaternion(np.array([1.0, 2, 3, 4])), np.array([5.0, 6, 7]))
    assert shaken(pose, noise, 1.5, 0.0) is pose
    moved = shaken(pose, noise, 1.5, 1.0)
    values = noise_at(noise, 1.5)
    np.testing.assert_allclose(np.linalg.inv(pose) @ [*moved[:3, 3], 1], [*values[:3], 1], atol=1e-14)
    turn = pose[:3, :3].T @ moved[:3, :3]
    axial = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    angle = np.linalg.norm(values[3:])
    np.testing.assert_allclose(axial, values[3:] * np.sin(angle) / angle, atol=1e-14)


def test_it_fades_to_zero_with_slope_zero_at_rests():
    assert [fade_between(t, 1.0, 3.0, 0.5) for t in (1, 3)] == [0, 0]
    assert fade_between(2, 1.0, 3.0, 0.5) == 1 and fade_between(2, None, None, 0.5) == 1
    assert fade_between(1 + 1e-4, 1.0, None, 0.5) == pytest.approx(3 * (1e-4 / 0.5) ** 2, rel=1e-3)
    assert fade_between(3 - 1e-4, None, 3.0, 0.5) == pytest.approx(3 * (1e-4 / 0.5) ** 2, rel=1e-3)
    assert 0 < fade_between(1.1, 1.0, 1.2, 0.5) < 0.02  # between two near rests it hardly begins
