"""Colour in Dr.Jit against the package colour-science, an independent implementation of the same standards."""

import ast
from pathlib import Path

import colour
import numpy as np
import pytest

import framepairs.colour as ours
from framepairs.backend import dr, jit

pytestmark = pytest.mark.renders

EPSILON = 2.0**-23  # of float32
# Code values from below black to far above white, dense where the curves have their joints.
JOINTS = np.linspace(0.003, 0.0033, 31), np.linspace(0.0403, 0.0406, 31)
VALUES = np.float32(np.concatenate([np.linspace(-0.1, 1.2, 1301), *JOINTS, np.geomspace(1, 1e5, 200)]))


def pixels(count=500, low=-0.1, high=1e5):
    """RGB [count, 3] float32: signs and sizes mixed, from a fixed seed."""
    generator = np.random.default_rng(20240607)
    sizes = np.exp(generator.uniform(np.log(1e-6), np.log(high), (count, 3)))
    return np.float32(np.where(generator.uniform(size=(count, 3)) < 0.1, low * generator.uniform(size=(count, 3)), sizes))


def scalar(function, values):
    return np.array(function(jit.Float(np.ascontiguousarray(values, dtype=np.float32))))


def vector(function, rgb):
    """function of Array3f on [N, 3], as [N, 3] or [N]."""
    return np.array(function(jit.Array3f(np.ascontiguousarray(rgb.T, dtype=np.float32)))).T


def test_srgb_encode_is_that_of_colour_science():
    expected = colour.models.eotf_inverse_sRGB(VALUES.astype(float))
    # power() is accurate to a few ulp of its result; 12.92 x and 1.055 x - 0.055 add one rounding each.
    np.testing.assert_allclose(scalar(ours.srgb_encode, VALUES), expected, rtol=8 * EPSILON, atol=EPSILON)


def test_srgb_decode_is_that_of_colour_science():
    codes = VALUES[VALUES <= 100]  # 100^2.4 is some 7e4: beyond lies no code
    expected = colour.models.eotf_sRGB(codes.astype(float))
    # The exponent 2.4 multiplies the relative error of the rounded base.
    np.testing.assert_allclose(scalar(ours.srgb_decode, codes), expected, rtol=16 * EPSILON, atol=EPSILON)


def test_srgb_decode_undoes_srgb_encode():
    there_and_back = scalar(lambda x: ours.srgb_decode(ours.srgb_encode(x)), VALUES)
    # Relative error as above; the offset 0.055 of the encoding costs absolute precision near black. The standard's two
    # thresholds, 0.0031308 and 0.04045, miss each other by 4e-8 of code.
    np.testing.assert_allclose(there_and_back, VALUES, rtol=32 * EPSILON, atol=EPSILON)


def test_luminance_weights_are_those_of_rec_709():
    published = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ[1]
    # Rec. ITU-R BT.709 publishes four digits of what follows from its primaries.
    np.testing.assert_allclose(ours.LUMINANCE_709, published, atol=0.5e-4)
    assert sum(ours.LUMINANCE_709) == pytest.approx(1, abs=1e-15)


def test_luminance_is_the_weighted_sum():
    rgb = pixels()
    terms = rgb.astype(float) * ours.LUMINANCE_709
    error = np.abs(vector(ours.luminance, rgb) - terms.sum(axis=1))
    assert (error <= 4 * EPSILON * np.abs(terms).sum(axis=1)).all()


def test_ycocg_is_that_of_colour_science():
    rgb = pixels()
    error = np.abs(vector(ours.ycocg_from_rgb, rgb) - colour.RGB_to_YCoCg(rgb.astype(float)))
    assert (error <= 2 * EPSILON * np.abs(rgb).max(axis=1, keepdims=True)).all()


def test_ycocg_round_trips():
    rgb = pixels()
    error = np.abs(vector(lambda x: ours.rgb_from_ycocg(ours.ycocg_from_rgb(x)), rgb) - rgb)
    assert (error <= 6 * EPSILON * np.abs(rgb).max(axis=1, keepdims=True)).all()
    expected = colour.YCoCg_to_RGB(rgb.astype(float))
    error = np.abs(vector(ours.rgb_from_ycocg, rgb) - expected)
    assert (error <= 4 * EPSILON * np.abs(rgb).max(axis=1, keepdims=True)).all()


def hill_in_float64(rgb):
    """Stephen Hill, BakingLab, ACES.hlsl (2016): the published formula with its published numbers, written anew."""
    to_aces = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
    from_aces = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
    v = np.asarray(rgb, dtype=float) @ to_aces.T
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return np.clip(v @ from_aces.T, 0, 1)


def test_aces_hill_meets_anchors_worked_out_by_hand():
    # A grey g stays grey: the rows of both matrices sum to 1 (to 1e-5). For g = 1:
    # (1.0245786 - 0.000090537) / (0.983729 + 0.432951 + 0.238081) = 1.024488063 / 1.654761 = 0.619115; g = 0: below 0.
    greys = vector(ours.aces_hill, np.float32([[0, 0, 0], [1, 1, 1], [0.18, 0.18, 0.18]]))
    np.testing.assert_allclose(greys[0], 0, atol=0)
    np.testing.assert_allclose(greys[1], 0.619115, atol=2e-5)
    # 0.18: (0.18 x 0.2045786 - 0.000090537) / (0.18 x 0.61002222 + 0.238081) = 0.036733611 / 0.347885 = 0.105591
    np.testing.assert_allclose(greys[2], 0.105591, atol=2e-5)


def test_aces_hill_is_its_formula_in_float64():
    rgb = pixels()
    # Three sums of three products whose terms reach 1.7 in size.
    np.testing.assert_allclose(vector(ours.aces_hill, rgb), hill_in_float64(rgb), atol=16 * EPSILON)


def test_aces_hill_rises_with_grey_and_stays_in_range():
    greys = np.float32(np.geomspace(1e-6, 1e5, 4001))
    mapped = vector(ours.aces_hill, np.repeat(greys[:, None], 3, axis=1))
    assert mapped.min() >= 0 and mapped.max() == 1
    assert (np.diff(mapped, axis=0) >= -4 * EPSILON).all()  # neighbours differ by less than rounding near white
    assert (vector(ours.aces_hill, pixels()) >= 0).all() and (vector(ours.aces_hill, pixels()) <= 1).all()


@pytest.mark.parametrize("exposure", [-3.5, 0.0, 2.0])
def test_display_transform_exposes_maps_and_encodes(exposure):
    rgb = pixels()
    exposed = np.clip(rgb.astype(float) * 2**exposure, 0, 1000)
    expected = colour.models.eotf_inverse_sRGB(hill_in_float64(exposed))
    # sRGB is 12.92 times as steep at black as it is long.
    shown = vector(lambda x: ours.display_transform(x, exposure), rgb)
    np.testing.assert_allclose(shown, expected, atol=12.92 * 16 * EPSILON)


def test_display_transform_of_extremes_is_in_range():
    extremes = np.float32([[0, 0, 0], [-1, -0.5, -1e5], [65504, 1e5, 3e38], [np.inf, 0, 1], [1e-38, 1e-45, 0]])
    shown = vector(ours.display_transform, extremes)
    assert np.isfinite(shown).all() and shown.min() >= 0 and shown.max() <= 1
    np.testing.assert_array_equal(shown[:2], 0)
    np.testing.assert_allclose(shown[2], 1, atol=EPSILON)  # 1.055 - 0.055 in float32


def test_colours_are_differentiable():
    x = jit.Float([0.002, 0.5, 3])
    dr.enable_grad(x)
    dr.backward(dr.sum(ours.srgb_encode(x)))
    # d/dx of 12.92 x, and of 1.055 x^(1/2.4) - 0.055
    expected = [12.92, 1.055 / 2.4 * 0.5 ** (1 / 2.4 - 1), 1.055 / 2.4 * 3 ** (1 / 2.4 - 1)]
    np.testing.assert_allclose(np.array(dr.grad(x)), expected, rtol=8 * EPSILON)


def test_colour_imports_dr_jit_alone():
    tree = ast.parse(Path(ours.__file__).read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]
    assert [(node.module, node.level, [name.name for name in node.names]) for node in imports] == [("backend", 1, ["dr"])]
