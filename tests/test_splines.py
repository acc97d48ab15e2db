"""Curves by arc length and monotone cubics: known curves, repeated points, reversals, and no running back."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from framepairs.camera.splines import catmull_rom, cubic_at, curve_at, hermite_curve, monotone_cubic, smoothstep

EPSILON = np.finfo(np.float64).eps
WALK = np.array([[0, 0, 0], [1, 2, 0], [4, 2, -1], [5, 0, 3], [5, -7, 3]], dtype=float)


def test_the_curve_meets_its_points_exactly():
    curve, index = catmull_rom(WALK)
    np.testing.assert_array_equal(curve_at(curve, curve.lengths[index]), WALK)


def test_inside_it_is_barry_and_goldmans_pyramid():
    knots = np.concatenate([[0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(WALK, axis=0), axis=1)))])
    curve, _ = catmull_rom(WALK)
    np.testing.assert_allclose(curve.knots, knots, rtol=4 * EPSILON)

    def pyramid(t):  # Barry and Goldman 1988, of points 0 to 3 between 1 and 2
        level = list(WALK[:4])
        while len(level) > 1:
            level = blend(level, t)
        return level[0]

    def blend(level, t):
        ends = {4: [(0, 1), (1, 2), (2, 3)], 3: [(0, 2), (1, 3)], 2: [(1, 2)]}[len(level)]
        mixed = []
        for (a, b), p, q in zip(ends, level, level[1:], strict=False):
            mixed.append(((knots[b] - t) * p + (t - knots[a]) * q) / (knots[b] - knots[a]))
        return mixed

    for share in (0.1, 0.5, 0.8):
        t = knots[1] + share * (knots[2] - knots[1])
        hermite = hermite_curve(curve.knots[1:3], curve.points[1:3], curve.tangents[1:3])
        u, a, b = share, hermite.points[0], hermite.points[1]
        start, end = hermite.tangents * (knots[2] - knots[1])
        ours = a + u * u * (3 - 2 * u) * (b - a) + u * (1 - u) * ((1 - u) * start - u * end)
        np.testing.assert_allclose(ours, pyramid(t), atol=64 * EPSILON * 7)


def test_arc_lengths_are_those_of_a_fine_polygon():
    curve, _ = catmull_rom(WALK)
    places = curve_at(curve, np.linspace(0, curve.lengths[-1], 20_001))
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    # A chord is shorter than its arc by (step * curvature)^2 / 24: 1e-6 where the curve bends with a radius of 0.2.
    np.testing.assert_allclose(steps, curve.lengths[-1] / 20_000, rtol=1e-5)


def test_a_straight_line_has_its_length_and_even_places():
    curve, _ = catmull_rom(np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 5], [0, 0, 5.5]]))
    assert curve.lengths[-1] == pytest.approx(5.5, rel=16 * EPSILON)
    np.testing.assert_allclose(curve_at(curve, np.array([0.3, 2.2, 4.9]))[:, 2], [0.3, 2.2, 4.9], rtol=1e-12)


def test_arc_length_is_inverted_to_twelve_digits():
    curve, _ = catmull_rom(WALK)
    for row in range(4):
        width, chord = curve.knots[row + 1] - curve.knots[row], curve.points[row + 1] - curve.points[row]
        start, end = curve.tangents[row] * width, curve.tangents[row + 1] * width

        def speed(u, chord=chord, start=start, end=end):
            return np.linalg.norm(6 * u * (1 - u) * chord + (1 - u) * (1 - 3 * u) * start + u * (3 * u - 2) * end)

        for u in (0.07, 0.31, 0.5, 0.93):
            length = curve.lengths[row] + quad(speed, 0, u, epsabs=1e-13, epsrel=1e-13)[0]
            place = curve.points[row] + u * u * (3 - 2 * u) * chord + u * (1 - u) * ((1 - u) * start - u * end)
            # 8 nodes on a quarter of a segment: 3e-13 of the length here.
            np.testing.assert_allclose(curve_at(curve, np.array([length]))[0], place, atol=1e-12 * curve.lengths[-1])


def test_beyond_its_ends_it_goes_straight_on():
    curve, _ = catmull_rom(np.array([[0.0, 0, 0], [0, 0, 2]]))
    np.testing.assert_allclose(curve_at(curve, np.array([-1.0, 3.0])), [[0, 0, -1], [0, 0, 3]], atol=8 * EPSILON)


def test_repeated_points_collapse():
    curve, index = catmull_rom(WALK[[0, 0, 1, 1, 1, 2]])
    assert index.tolist() == [0, 0, 1, 1, 1, 2] and len(curve.points) == 3
    again, _ = catmull_rom(WALK[:3])
    np.testing.assert_array_equal(curve.tangents, again.tangents)
    alone, _ = catmull_rom(WALK[[3, 3, 3]])
    np.testing.assert_array_equal(curve_at(alone, np.array([0.0, 1])), WALK[[3, 3]])


def test_where_the_way_leads_straight_back_it_says_so():
    there_and_back = np.array([[0.0, 0, 0], [3, 4, 0], [0.3, 0.4, 0]])
    curve, _ = catmull_rom(there_and_back)
    assert curve.turns.tolist() == [False, True, False]
    assert curve.lengths[-1] == pytest.approx(5 + 4.5, rel=1e-9)
    np.testing.assert_allclose(curve_at(curve, np.array([5.5]))[0], [2.7, 3.6, 0], atol=1e-9)
    assert not catmull_rom(WALK)[0].turns.any()


@pytest.mark.parametrize("seed", range(5))
def test_any_points_give_finite_increasing_lengths(seed):
    random = np.random.default_rng(seed)
    points = random.normal(size=(200, 3)) * 10.0 ** random.integers(-8, 6, size=(200, 1))
    curve, index = catmull_rom(points + 1e3)
    assert np.isfinite(curve.tangents).all() and (np.diff(curve.lengths) > 0).all()
    np.testing.assert_array_equal(curve_at(curve, curve.lengths[index]), curve.points[index])


def test_a_monotone_cubic_never_runs_back():
    random = np.random.default_rng(7)
    times = np.cumsum(10.0 ** random.uniform(-9, 1, 300))
    values = np.cumsum(np.maximum(random.normal(size=300), 0))
    cubic = monotone_cubic(times, values)
    fine = cubic_at(cubic, np.sort(np.concatenate([times, random.uniform(times[0], times[-1], 20_000)])))
    assert (np.diff(fine) >= -4 * EPSILON * values[-1]).all()
    np.testing.assert_array_equal(cubic_at(cubic, times), values)


def test_its_slope_is_continuous_zero_at_rest_and_that_of_the_chord_at_the_ends():
    times, values = np.array([0, 1, 1.5, 4.0]), np.array([0, 2, 5, 6.0])
    cubic = monotone_cubic(times, values, np.array([False, False, True, False]))
    h = 1e-6
    slopes = (
        (cubic_at(cubic, times + h) - cubic_at(cubic, times)) / h,
        (cubic_at(cubic, times) - cubic_at(cubic, times - h)) / h,
    )
    # One-sided differences err by h / 2 times the second derivative, some 30 here.
    np.testing.assert_allclose(slopes[0][1:3], slopes[1][1:3], atol=1e-4)
    assert slopes[0][2] == pytest.approx(0, abs=1e-4)
    assert (slopes[0][0], slopes[1][3]) == (pytest.approx(2, abs=1e-4), pytest.approx(0.4, abs=1e-4))
    assert slopes[0][1] == pytest.approx(4.5 / (2 / 2 + 2.5 / 6), abs=1e-4)  # weights 1 + 2 / 2 and 2 + 1 / 2, by hand


def test_components_are_interpolated_alone_and_constants_stay():
    cubic = monotone_cubic(np.array([0.0, 1, 2]), np.array([[0.1, 0], [0.1, 1], [0.1, 0]]))
    found = cubic_at(cubic, np.array([-1.0, 0.3, 0.9999, 1.7, 5]))
    np.testing.assert_array_equal(found[:, 0], 0.1)
    assert found[:, 1].max() <= 1 and found[0, 1] == 0 and found[-1, 1] == 0


def test_smoothstep_by_hand():
    np.testing.assert_array_equal(smoothstep(np.array([-1, 0, 0.5, 1, 2.0])), [0, 0, 0.5, 1, 1])
    assert smoothstep(np.array(0.25)) == 3 / 16 - 2 / 64
    assert math.isclose(smoothstep(np.array(1e-3)), 3e-6, rel_tol=1e-3)
