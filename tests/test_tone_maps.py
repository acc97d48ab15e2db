"""Tone maps against their published formulas in float64, written anew, and against what holds for every tone map."""

import colour
import numpy as np
import pytest

import framepairs.tone_maps as ours
from colour_samples import EPSILON, extreme_pixels, pixels, vector, vector_derivative
from framepairs.colour import LUMINANCE_709, aces_hill

pytestmark = pytest.mark.renders

TONE_MAPS = {
    "reinhard": ours.reinhard,
    "reinhard_extended": ours.reinhard_extended,
    "hable": ours.hable,
    "agx": ours.agx,
    "pbr_neutral": ours.pbr_neutral,
    "aces": ours.aces,
}


def grey(values):
    return np.repeat(np.float32(values)[:, None], 3, axis=1)


def reinhard_in_float64(rgb, white=np.inf):
    """Reinhard, Stark, Shirley and Ferwerda 2002, equations 3 and 4, as a scale of the colour."""
    light = np.maximum(rgb, 0) @ LUMINANCE_709
    scale = (1 + light / white**2) / (1 + light)
    return np.clip(np.maximum(rgb, 0) * scale[:, None], 0, 1)


def hable_in_float64(rgb):
    """John Hable, Filmic Tonemapping Operators (filmicworlds.com, 2010), with its constants and exposure bias 2."""
    A, B, C, D, E, F, white = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30, 11.2

    def curve(x):
        return (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F

    return np.clip(curve(2 * np.maximum(rgb, 0)) / curve(white), 0, 1)


def agx_in_float64(rgb):
    """Benjamin Wrensch, Minimal AgX Implementation (2023): columns as published, the 6th-order fit, exponent 2.2."""
    columns = [
        [0.842479062253094, 0.0423282422610123, 0.0423756549057051],
        [0.0784335999999992, 0.878468636469772, 0.0784336],
        [0.0792237451477643, 0.0791661274605434, 0.879142973793104],
    ]
    columns_back = [
        [1.19687900512017, -0.0528968517574562, -0.0529716355144438],
        [-0.0980208811401368, 1.15190312990417, -0.0980434501171241],
        [-0.0990297440797205, -0.0989611768448433, 1.15107367264116],
    ]
    v = np.maximum(np.maximum(rgb, 0) @ np.array(columns), 1e-10)
    x = (np.clip(np.log2(v), -12.47393, 4.026069) + 12.47393) / (4.026069 + 12.47393)
    x = 15.5 * x**6 - 40.14 * x**5 + 31.96 * x**4 - 6.868 * x**3 + 0.4298 * x**2 + 0.1191 * x - 0.00232
    return np.clip(x @ np.array(columns_back), 0, 1) ** 2.2


def pbr_neutral_in_float64(rgb):
    """Khronos PBR Neutral tone mapper, specification 1.0: F90 = 0.04, Ks = 0.8 - F90, Kd = 0.15, pixel by pixel."""
    shown = []
    for pixel in np.maximum(rgb, 0):
        least = pixel.min()
        fresnel = least - least**2 / (4 * 0.04) if least <= 0.08 else 0.04
        peak = pixel.max() - fresnel
        start = 0.8 - 0.04
        if peak <= start:
            shown.append(pixel - fresnel)
            continue
        new_peak = 1 - (1 - start) ** 2 / (peak + 1 - 2 * start)
        share = 1 / (0.15 * (peak - new_peak) + 1)
        shown.append((pixel - fresnel) * new_peak / peak * share + new_peak * (1 - share))
    return np.array(shown)


def test_aces_is_the_fit_of_limited_light():
    rgb = pixels()
    np.testing.assert_array_equal(vector(ours.aces, rgb), vector(aces_hill, np.clip(rgb, 0, 1000)))


def test_reinhard_is_its_formula_in_float64():
    rgb = pixels()
    # A luminance of three products, a sum, a division: 8 epsilon of what is 1 at most after the cut.
    np.testing.assert_allclose(vector(ours.reinhard, rgb), reinhard_in_float64(rgb.astype(float)), atol=8 * EPSILON)
    shown = vector(lambda x: ours.reinhard_extended(x, 7.5), rgb)
    np.testing.assert_allclose(shown, reinhard_in_float64(rgb.astype(float), 7.5), atol=10 * EPSILON)


def test_reinhard_meets_its_anchors():
    np.testing.assert_allclose(vector(ours.reinhard, grey([1, 3]))[:, 0], [0.5, 0.75], rtol=4 * EPSILON)
    # 4: (4 (1 + 4 / 16)) / 5 = 1; 1: (1 + 1 / 16) / 2
    np.testing.assert_allclose(vector(ours.reinhard_extended, grey([1, 4]))[:, 1], [17 / 32, 1], rtol=4 * EPSILON)


def test_hable_is_its_formula_in_float64():
    rgb = pixels()
    # A quotient of two polynomials with positive terms, divided by f(11.2) = 0.73.
    np.testing.assert_allclose(vector(ours.hable, rgb), hable_in_float64(rgb.astype(float)), rtol=12 * EPSILON, atol=1e-12)


def test_hable_meets_its_anchors():
    # f(2) = (2 x 0.35 + 0.004) / (2 x 0.8 + 0.06) - 1 / 15 = 0.424096 - 0.066667 = 0.357430; f(11.2) = (11.2 x 1.73 + 0.004) /
    # (11.2 x 2.18 + 0.06) - 1 / 15 = 19.38 / 24.476 - 1 / 15 = 0.725129; 0.357430 / 0.725129 = 0.492919
    shown = vector(ours.hable, grey([0, 1, 5.6, 20]))[:, 2]
    np.testing.assert_allclose(shown, [0, 0.492919, 1, 1], atol=2e-6)


def test_agx_is_its_formula_in_float64():
    rgb = pixels()
    # log2 is up to 12.5 of 16.5 wide, off by an epsilon of itself; the polynomial's terms reach 40, so that Horner's sums are
    # off by some 40 epsilon; the exponent 2.2 and the outset matrix magnify by 3.
    np.testing.assert_allclose(vector(ours.agx, rgb), agx_in_float64(rgb.astype(float)), atol=3 * 80 * EPSILON)


def agx_sigmoid(x):
    """Troy Sobotka's contrast curve (AgX configuration, 2022) through (0, 0) and (1, 1).

    A branch t / (1 + t^p)^(1/p) on either side of (10 / 16.5, 0.5), of slope 2 there; p is 3 below and 3.25 above.
    """
    pivot, slope = 10 / 16.5, 2.0

    def branch(reach, power):  # gains 0.5 over `reach`
        scale = ((slope * reach) ** -power * ((slope * reach / 0.5) ** power - 1)) ** (-1 / power)
        t = slope * np.abs(x - pivot) / scale
        return scale * t / (1 + t**power) ** (1 / power)

    return 0.5 + np.where(x < pivot, -branch(pivot, 3.0), branch(1 - pivot, 3.25))


def test_agx_curve_is_the_fit_of_the_sigmoid_that_was_published():
    x = np.linspace(0, 1, 4096)  # the size of AgX's table
    sigmoid = agx_sigmoid(x)
    assert sigmoid[[0, -1]] == pytest.approx([0, 1], abs=1e-12)
    best = np.polynomial.polynomial.polyfit(x, sigmoid, 6)
    error = np.polynomial.polynomial.polyval(x, best) - sigmoid
    assert np.mean(error**2) == pytest.approx(3.6705141e-06, rel=1e-6)  # Wrensch's figure: the fit before it was rounded
    np.testing.assert_allclose(ours.AGX_CURVE, best, rtol=5e-4)  # half of the fourth digit
    rounded = ours._polynomial(ours.AGX_CURVE, x) - sigmoid
    assert np.mean(rounded**2) == pytest.approx(7.09e-6, rel=1e-3) and np.abs(rounded).max() < 0.0058  # the docstring's


def test_agx_matrices_undo_each_other_and_keep_grey():
    # The published digits do not fit better than this.
    np.testing.assert_allclose(np.array(ours.AGX_INSET) @ ours.AGX_OUTSET, np.eye(3), atol=2e-4)
    for rows in (ours.AGX_INSET, ours.AGX_OUTSET):
        np.testing.assert_allclose(np.sum(rows, axis=1), 1, atol=2e-4)
    assert ours.AGX_RANGE == pytest.approx((np.log2(0.18) - 10, np.log2(0.18) + 6.5), abs=1e-5)


def test_agx_meets_its_anchors():
    # 0.18 is x = 10 / 16.5, where the sigmoid is 0.5 and the fit 0.4965 (Horner by hand); 0.4965^2.2 = 0.2143. White: the sum
    # of the coefficients, 0.99858, to 2.2 is 0.99688.
    shown = vector(ours.agx, grey([0, 0.18, 100, 1e5]))
    np.testing.assert_array_equal(shown[0], 0)
    assert 0.5**2.2 - 0.01 < shown[1, 1] < 0.5**2.2 + 0.01
    np.testing.assert_allclose(shown[2:], 0.99688, atol=5e-4)  # the matrices' rows do not sum to 1 better


def test_pbr_neutral_is_its_formula_in_float64():
    rgb = np.concatenate([pixels(), pixels(high=1)])
    np.testing.assert_allclose(vector(ours.pbr_neutral, rgb), pbr_neutral_in_float64(rgb.astype(float)), atol=8 * EPSILON)


def test_pbr_neutral_meets_its_anchors():
    # The specification's promise: base colours in [0.08, 0.8] come out as they are, less F90 = 0.04.
    base = np.float32([[0.08, 0.3, 0.8], [0.5, 0.2, 0.1]])
    np.testing.assert_allclose(vector(ours.pbr_neutral, base), base - 0.04, atol=EPSILON)
    # Grey 0.04: 0.04 - (0.04 - 0.01) = 0.01. Grey 1.04: peak 1, 1 - 0.24^2 / 0.48 = 0.88.
    np.testing.assert_allclose(vector(ours.pbr_neutral, grey([0.04, 1.04]))[:, 0], [0.01, 0.88], atol=2 * EPSILON)


@pytest.mark.parametrize("name", TONE_MAPS)
def test_black_and_negative_light_are_black(name):
    dark = np.float32([[0, 0, 0], [-0.1, -0.05, -0.01], [-1e-40, 0, -1e5]])
    np.testing.assert_array_equal(vector(TONE_MAPS[name], dark), 0)


@pytest.mark.parametrize("name", TONE_MAPS)
def test_results_lie_between_0_and_1_and_derivatives_are_finite(name):
    rgb = extreme_pixels()
    shown = vector(TONE_MAPS[name], rgb)
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1
    assert np.isfinite(vector_derivative(TONE_MAPS[name], rgb)).all()


@pytest.mark.parametrize("name", TONE_MAPS)
def test_infinite_light_is_limited(name):
    rgb = np.float32([[np.inf, np.inf, np.inf], [np.inf, 0, 0], [3e38, 65504, -np.inf]])
    shown = vector(TONE_MAPS[name], rgb)
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1


@pytest.mark.parametrize("name", TONE_MAPS)
def test_results_rise_with_grey(name):
    shown = vector(TONE_MAPS[name], grey(np.geomspace(1e-5, 1e4, 4001)))
    # AgX's polynomial is off by 40 epsilon (above); neighbours near white differ by less.
    assert (np.diff(shown, axis=0) >= -80 * EPSILON).all()
    assert (np.diff(shown[::400][:9], axis=0) >= 0).all() and shown[0, 1] < 0.001 and shown[-1, 1] > 0.99


@pytest.mark.parametrize("name", TONE_MAPS)
def test_grey_stays_grey(name):
    shown = vector(TONE_MAPS[name], grey(np.geomspace(1e-4, 1e4, 401)))
    # Rows of AgX's matrices sum to 1 within 2e-4, twice; Hill's within 2e-5.
    np.testing.assert_allclose(shown, shown[:, 1:2] * np.ones(3), atol={"agx": 1e-3, "aces": 6e-5}.get(name, 4 * EPSILON))


@pytest.mark.parametrize("name", ["reinhard", "reinhard_extended", "pbr_neutral"])
def test_hue_stays_where_nothing_is_cut(name):
    rgb = np.abs(pixels(high=3))
    rgb = np.float32(rgb[rgb.min(axis=1) > 0.01])
    shown = vector(TONE_MAPS[name], rgb)
    hue, before = (colour.RGB_to_HSV(np.clip(image.astype(float), 0, None) / 3)[:, 0] for image in (shown, rgb))
    uncut = (shown.max(axis=1) < 1) & (rgb.max(axis=1) - rgb.min(axis=1) > 0.05)
    assert uncut.sum() > 20
    turn = np.abs(hue - before)[uncut]
    assert np.minimum(turn, 1 - turn).max() <= 2e-5  # differences of at least 0.05 between numbers off by some epsilon
