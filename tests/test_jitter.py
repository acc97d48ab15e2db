"""Where samples lie: Halton jitter and the anti-aliasing positions."""

from fractions import Fraction

import numpy as np
import pytest

from framepairs.jitter import antialiasing_positions, default_length, jitter, radical_inverse


@pytest.mark.parametrize(
    ("index", "base", "expected"),
    [
        (0, 2, 0.0),
        (1, 2, 1 / 2),
        (2, 2, 1 / 4),
        (3, 2, 3 / 4),
        (6, 2, 3 / 8),  # 110 mirrored is 0.011
        (1, 3, 1 / 3),
        (2, 3, 2 / 3),
        (3, 3, 1 / 9),
        (5, 3, 7 / 9),  # 12 in base 3, mirrored 0.21 = 2/3 + 1/9
    ],
)
def test_radical_inverse_by_hand(index, base, expected):
    assert radical_inverse(index, base) == expected


def test_radical_inverse_is_exact_at_large_indices():
    assert radical_inverse(2**31, 2) == 2.0**-32
    assert radical_inverse(2**31 - 1, 2) == 1 - 2.0**-31
    for index in (2**31 - 1, 2**31, 3**19 + 2):
        mirrored, rest, weight = Fraction(0), index, Fraction(1, 3)
        while rest:
            rest, digit = divmod(rest, 3)
            mirrored, weight = mirrored + digit * weight, weight / 3
        assert radical_inverse(index, 3) == float(mirrored)


def test_jitter_begins_with_the_first_halton_points():
    # Halton(2, 3) from index 1: (1/2, 1/3), (1/4, 2/3), (3/4, 1/9), (1/8, 4/9), (5/8, 7/9).
    expected = [(1 / 2, 1 / 3), (1 / 4, 2 / 3), (3 / 4, 1 / 9), (1 / 8, 4 / 9), (5 / 8, 7 / 9)]
    assert [jitter(frame, 32) for frame in range(5)] == [(x - 0.5, y - 0.5) for x, y in expected]


@pytest.mark.parametrize("length", [1, 7, 16, 58, 1000])
def test_jitter_lies_in_the_half_open_pixel_and_repeats(length):
    points = [jitter(frame, length) for frame in range(length)]
    assert all(-0.5 <= value < 0.5 for point in points for value in point)
    assert len(set(points)) == length
    assert [jitter(frame + 3 * length, length) for frame in range(length)] == points


@pytest.mark.parametrize("length", [8, 16, 32, 58, 72, 128])
def test_jitter_over_a_period_has_a_small_mean(length):
    # The means of a low-discrepancy sequence miss the centre by no more than its discrepancy, log2(N) / N per axis.
    bound = length.bit_length() / length
    for axis in (0, 1):
        assert abs(sum(jitter(frame, length)[axis] for frame in range(length)) / length) <= bound / 2


@pytest.mark.parametrize(("scale", "length"), [(1, 8), (1.3, 13), (1.5, 18), (1.7, 23), (2, 32), (2.7, 58), (3, 72), (4, 128)])
def test_default_length_is_that_of_fsr_2(scale, length):
    # FSR 2's ffxFsr2GetJitterPhaseCount(renderWidth, displayWidth): int(8 * (display / render)^2).
    assert default_length(scale) == length


def test_one_sample_lies_at_the_centre():
    assert antialiasing_positions(1) == ((0.5, 0.5),)


@pytest.mark.parametrize("samples", [1, 2, 3, 7, 16, 35, 91, 256, 1000, 4096])
def test_antialiasing_positions_lie_inside_and_average_to_the_centre(samples):
    positions = antialiasing_positions(samples)
    assert len(set(positions)) == samples
    assert all(0 < value < 1 for position in positions for value in position)
    for axis in (0, 1):
        # N rounded additions of numbers below 1: at most N * 2^-53 after dividing, 5e-13 for 4096.
        assert sum(position[axis] for position in positions) / samples == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("samples", [2, 3, 5, 8, 13, 16, 64, 100, 1024])
def test_every_column_of_the_pixel_holds_one_sample(samples):
    assert sorted(int(x * samples) for x, _ in antialiasing_positions(samples)) == list(range(samples))


@pytest.mark.parametrize("samples", [2, 4, 8, 16, 64, 1024])
def test_every_row_of_the_pixel_holds_one_sample_for_powers_of_two(samples):
    assert sorted(int(y * samples) for _, y in antialiasing_positions(samples)) == list(range(samples))


def test_halton_positions_are_the_sequence_from_index_one():
    assert antialiasing_positions(3, "halton") == ((0.5, 1 / 3), (0.25, 2 / 3), (0.75, 1 / 9))


def test_enhanced_positions_are_eight_in_each_quarter_around_its_centre():
    places = np.array(antialiasing_positions(32, "qrisp_enhanced")).reshape(4, 8, 2)
    assert np.allclose(places.mean(axis=1), [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]], atol=1e-15)
    inside = places - places.mean(axis=1, keepdims=True)
    assert np.abs(inside).max() < 0.25
    # one sample in each of eight rows and columns of a quarter, as Direct3D's pattern has
    assert all(len(np.unique(np.round(inside[0, :, axis] * 32))) == 8 for axis in (0, 1))
