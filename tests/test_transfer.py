"""Transfer functions against the package colour-science, an independent implementation of the same standards."""

from collections.abc import Callable
from dataclasses import dataclass

import colour
import numpy as np
import pytest
from colour.models.rgb.transfer_functions import aces, arib_std_b67, itur_bt_2100, st_2084

import framepairs.transfer as ours
from colour_samples import (
    EPSILON,
    EXTREMES,
    VALUES,
    derivative,
    pixels,
    scalar,
    scalar_in_float64,
    vector,
    vector_derivative,
)
from framepairs.backend import jit

# colour-science evaluates both branches of a curve everywhere.
pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore::RuntimeWarning:colour")]

POSITIVE = np.float32(np.geomspace(1e-6, 1e5, 4001))
CODES = np.float32(np.linspace(0.01, 1, 1001))


def power_error(result):
    """Relative error of power(), in epsilon: exp2 magnifies the rounding of its argument |log2 result| by ln 2, twice."""
    return 4 + 1.5 * np.abs(np.log(result))


def pq_encode_error(code):
    # The exponent 0.159 gives t, whose error the curve halves or doubles (condition 2.2 at most): |ln t| is 5.5 at most here.
    # exp() magnifies the few roundings of its argument |ln code|.
    return 2.2 * power_error(np.exp(-5.5)) + 4 * (1 + np.abs(np.log(code)))


def pq_decode_error(light):
    # The roundings of w = ln(code) / m2 act like an error of code of |ln code|, which the curve magnifies by its condition
    # number; those of the ratio are raised to the power 6.28.
    code = pq_encode_in_float64(light)
    return 2 * (1 + np.abs(np.log(code))) * condition(pq_encode_in_float64, light) + 4 * 6.28 + power_error(light / 1e4)


def condition(encode, linear):
    """Relative change of linear light by relative change of code, from central differences in float64."""
    step = 1e-5 * linear
    slope = (encode(linear + step) - encode(linear - step)) / (2 * step)
    return np.abs(encode(linear) / (slope * linear))


def pq_encode_in_float64(light):
    return colour.models.eotf_inverse_ST2084(light)


@dataclass(frozen=True)
class Curve:
    """Ours and colour-science's, with relative errors in epsilon: of encode by code, of decode by linear light."""

    encode: Callable
    decode: Callable
    oracle_encode: Callable
    oracle_decode: Callable
    encode_error: Callable
    decode_error: Callable
    float64_error: float = 1e-12


def one_of(number):
    return lambda values: np.full_like(values, number)


def gamma(exponent):
    return lambda x: colour.models.gamma_function(x, exponent, "Mirror")


CURVES = {
    # 1.055 x - 0.055 magnifies the error of its power 1.055 x / (1.055 x - 0.055) times, 2.4 at most.
    "srgb": Curve(
        ours.srgb_encode,
        ours.srgb_decode,
        colour.models.eotf_inverse_sRGB,
        colour.models.eotf_sRGB,
        lambda code: 2.4 * power_error(code),
        lambda linear: 2.4 * 2 + power_error(linear),
    ),
    "gamma": Curve(ours.gamma_encode, ours.gamma_decode, gamma(1 / 2.2), gamma(2.2), power_error, power_error),
    # Sums of numbers up to 26 that are divided by 17.52, of results of 0.07 at least. The argument of exp2 is 16 at most and
    # comes from numbers up to 26; near black an error of code 0.073 is divided by 10.54.
    "acescct": Curve(
        ours.acescct_encode,
        ours.acescct_decode,
        colour.models.log_encoding_ACEScct,
        colour.models.log_decoding_ACEScct,
        lambda code: 2 + 2 * 26 / 17.52 / code,
        lambda linear: 4 + 2 * 26 * np.log(2) + 2 * 0.073 / 10.54 / linear,
    ),
    # 1.0 is 1 cd/m2 here. float64 has the rounding of colour-science's own formula, magnified as in `pq_decode_error`, and
    # what our series leave out.
    "pq": Curve(
        lambda linear: ours.pq_encode(linear, 1.0),
        lambda code: ours.pq_decode(code, 1.0),
        colour.models.eotf_inverse_ST2084,
        colour.models.eotf_ST2084,
        pq_encode_error,
        pq_decode_error,
        2e-9,
    ),
    # A logarithm of 1 to 14 times 0.18, plus 0.56. Its inverse is exp of 17 at most here.
    "hlg": Curve(
        ours.hlg_encode,
        ours.hlg_decode,
        colour.models.oetf_BT2100_HLG,
        colour.models.oetf_inverse_BT2100_HLG,
        one_of(8),
        one_of(4 + 1.5 * 17),
    ),
}


@pytest.fixture(params=CURVES)
def curve(request) -> Curve:
    return CURVES[request.param]


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


def test_encoding_is_that_of_colour_science(curve):
    expected = curve.oracle_encode(POSITIVE.astype(float))
    error = np.abs(scalar(curve.encode, POSITIVE) - expected) / expected
    assert (error <= curve.encode_error(expected) * EPSILON).all()
    in_float64 = scalar_in_float64(curve.encode, POSITIVE.astype(float))
    np.testing.assert_allclose(in_float64, expected, rtol=curve.float64_error)


def test_decoding_is_that_of_colour_science(curve):
    codes = CODES[CODES > 0.0735]  # ACEScct has its black at 0.0729
    expected = curve.oracle_decode(codes.astype(float))
    error = np.abs(scalar(curve.decode, codes) - expected) / expected
    assert (error <= curve.decode_error(expected) * EPSILON).all()
    in_float64 = scalar_in_float64(curve.decode, codes.astype(float))
    np.testing.assert_allclose(in_float64, expected, rtol=curve.float64_error)


def test_pq_keeps_the_precision_of_float32():
    # code |ln code| is 1 / e at most, so the roundings of the logarithm, whatever the exponent 78.8, cost 4 epsilon of code.
    light = np.float32(np.geomspace(0.01, 1e4, 2001))
    error = scalar(lambda x: ours.pq_encode(x, 1.0), light) - pq_encode_in_float64(light.astype(float))
    assert np.abs(error).max() <= 4 * EPSILON


def test_decoding_undoes_encoding(curve):
    linear = POSITIVE[POSITIVE <= 65504]  # where ACEScct ends
    exact = linear.astype(float)
    bound = curve.encode_error(curve.oracle_encode(exact)) * condition(curve.oracle_encode, exact) + curve.decode_error(exact)
    error = np.abs(scalar(lambda x: curve.decode(curve.encode(x)), linear) - exact) / exact
    joints = 1e-7 if curve is CURVES["srgb"] else 0  # the standard's two thresholds miss each other by 4e-8
    assert (error <= bound * EPSILON + joints).all()


def test_values_and_derivatives_are_finite_from_below_black_to_1e5(curve):
    for function in (curve.encode, curve.decode):
        assert np.isfinite(scalar(function, EXTREMES)).all()
        assert np.isfinite(derivative(function, EXTREMES)).all()


def test_derivatives_are_those_of_colour_science(curve):
    linear = np.float32(np.geomspace(1e-3, 60, 801))
    linear = linear[np.abs(linear - 0.0031308) > 1e-5]  # sRGB's joint
    for function, oracle, x in (
        (curve.encode, curve.oracle_encode, linear),
        (curve.decode, curve.oracle_decode, np.float32(curve.oracle_encode(linear.astype(float)))),
    ):
        step = 1e-6 * x.astype(float)
        expected = (oracle(x + step) - oracle(x - step)) / (2 * step)
        # Central differences in float64 err by 1e-10 of what they subtract, or by a curve's joint between them; float32's
        # products of a dozen factors, each off by some 50 epsilon at most.
        np.testing.assert_allclose(derivative(function, x), expected, rtol=12 * 50 * EPSILON)


def test_encoding_rises(curve):
    codes = scalar(curve.encode, np.float32(np.geomspace(1e-4, 1e5, 1001)))  # 2 % apart
    assert (np.diff(codes) > 0).all()


def test_negative_light_does_what_each_curve_says():
    dark = np.float32([-1e-40, -1e-6, -0.01, -0.1])
    np.testing.assert_allclose(scalar(ours.srgb_encode, dark), 12.92 * dark, rtol=EPSILON, atol=1e-38)  # flushed denormals
    np.testing.assert_array_equal(scalar(ours.gamma_encode, dark), -scalar(ours.gamma_encode, -dark))
    np.testing.assert_array_equal(scalar(ours.gamma_decode, dark), -scalar(ours.gamma_decode, -dark))
    straight = colour.models.log_encoding_ACEScct(0.001) + (dark - 0.001) * 10.5402377416545
    np.testing.assert_allclose(scalar(ours.acescct_encode, dark), straight, rtol=4 * EPSILON, atol=EPSILON)
    assert (scalar(ours.acescct_decode, dark) < -0.0069).all()  # black is at code 0.0729
    np.testing.assert_allclose(scalar(ours.pq_encode, dark), ours.PQ_BLACK, rtol=64 * EPSILON)  # |ln black| is 14
    for function in (ours.pq_decode, ours.hlg_encode, ours.hlg_decode):
        np.testing.assert_array_equal(scalar(function, dark), 0)


def test_black_is_black():
    for function in (ours.srgb_encode, ours.srgb_decode, ours.gamma_encode, ours.gamma_decode, ours.hlg_encode):
        assert scalar(function, [0.0]) == 0
    assert scalar(ours.hlg_decode, [0.0]) == 0 and scalar(ours.pq_decode, [0.0]) == 0
    assert scalar(lambda x: ours.pq_decode(ours.pq_encode(x)), [0.0])[0] < 1e-12


def test_codes_beyond_a_curve_are_limited():
    assert scalar(ours.acescct_decode, [1.468, 2, 1e5]) == pytest.approx([65504] * 3, rel=1e-3)
    largest = colour.models.eotf_ST2084(1.75)
    np.testing.assert_allclose(scalar(lambda x: ours.pq_decode(x, 1.0), [1.75, 2, 1e5]), largest, rtol=1e-3)
    np.testing.assert_array_equal(scalar(ours.hlg_decode, [5, 1e5]), scalar(ours.hlg_decode, [4, 4]))


def test_anchors_of_the_standards():
    # HLG's 1/12 is at 0.5 (BT.2100), 100 cd/m2 is at PQ 0.508 (BT.2408, table 1: 203 cd/m2 at 58 %, 100 at 51 %),
    # ACEScct's 0.18 at 0.4135884 (S-2016-001).
    assert scalar(ours.hlg_encode, [1 / 12, 1.0]) == pytest.approx([0.5, 1.0], rel=4 * EPSILON)
    assert scalar(lambda x: ours.pq_encode(x, 1.0), [100, 203, 10000]) == pytest.approx([0.51, 0.58, 1.0], abs=0.005)
    assert scalar(ours.pq_encode, [1.0]) == scalar(lambda x: ours.pq_encode(x, 1.0), [203.0])
    assert scalar(ours.acescct_encode, [0.18]) == pytest.approx([0.4135884], abs=1e-7)


def test_white_scales_display_light():
    codes = np.float32([0.1, 0.5, 0.9])
    in_units_of_100 = scalar(lambda x: ours.pq_decode(x, 100.0), codes)
    np.testing.assert_allclose(in_units_of_100 * 100, colour.models.eotf_ST2084(codes.astype(float)), rtol=300 * EPSILON)
    # pq_decode_error is below 300 at these codes: condition 13 at 0.1


def test_constants_are_those_of_colour_science():
    pq, hlg, cct = st_2084.CONSTANTS_ST2084, arib_std_b67.CONSTANTS_ARIBSTDB67, aces.CONSTANTS_ACES_CCT
    assert (ours.PQ_M1, ours.PQ_M2) == (pq.m_1, pq.m_2)
    assert (ours.PQ_C1, ours.PQ_C2, ours.PQ_C3) == (pq.c_1, pq.c_2, pq.c_3)
    assert (ours.HLG_A, ours.HLG_B, ours.HLG_C) == pytest.approx((hlg.a, hlg.b, hlg.c), abs=1e-8)  # published digits
    assert (ours.ACESCCT_JOINT, ours.ACESCCT_CODE_JOINT) == (cct.X_BRK, cct.Y_BRK)
    assert (ours.ACESCCT_SLOPE, ours.ACESCCT_OFFSET) == (cct.A, cct.B)
    published = colour.RGB_COLOURSPACES["ITU-R BT.2020"].matrix_RGB_to_XYZ[1]
    np.testing.assert_allclose(ours.LUMINANCE_2020, published, atol=0.5e-4)  # the standard rounds to four digits


@pytest.mark.parametrize("peak", [400.0, 1000.0, 2000.0])
def test_hlg_display_light_is_that_of_colour_science(peak):
    assert ours.hlg_system_gamma(peak) == pytest.approx(itur_bt_2100.gamma_function_BT2100_HLG(peak), rel=1e-15)
    scene = np.abs(pixels(high=10))
    display = colour.models.ootf_BT2100_HLG(scene.astype(float), 0, peak)
    # One power of luminance, which is 1e-7 at least: error 4 + 1.5 x 0.3 x 16 epsilon, and a few products.
    np.testing.assert_allclose(vector(lambda x: ours.hlg_display_from_scene(x, peak), scene), display, rtol=20 * EPSILON)
    back = vector(lambda x: ours.hlg_scene_from_display(ours.hlg_display_from_scene(x, peak), peak), scene)
    np.testing.assert_allclose(back, scene, rtol=40 * EPSILON)
    undone = colour.models.ootf_inverse_BT2100_HLG(display, 0, peak)
    ours_undone = vector(lambda x: ours.hlg_scene_from_display(x, peak), np.float32(display))
    np.testing.assert_allclose(ours_undone, undone, rtol=20 * EPSILON)


@pytest.mark.parametrize("function", [ours.hlg_display_from_scene, ours.hlg_scene_from_display])
def test_hlg_display_light_is_finite(function):
    rgb = np.concatenate([np.repeat(EXTREMES[:, None], 3, axis=1), pixels()])
    assert np.isfinite(vector(function, rgb)).all() and np.isfinite(vector_derivative(function, rgb)).all()
    np.testing.assert_array_equal(vector(function, np.float32([[0, 0, 0], [-0.1, -1, -1e-6]])), 0)
    mixed = np.float32([[0.5, 0.2, -0.1]])
    np.testing.assert_array_equal(vector(function, mixed), vector(function, np.maximum(mixed, 0)))


def test_curves_act_on_every_component_of_any_array(curve):
    rgb = np.float32([[0.001, 0.2, 5], [0.05, 0.4, 0.9]])
    for function in (curve.encode, curve.decode):
        expected = scalar(function, rgb.ravel()).reshape(rgb.shape)
        np.testing.assert_array_equal(vector(function, rgb), expected)
        np.testing.assert_array_equal(np.array(function(jit.TensorXf(rgb))), expected)
        assert function(0.25) == pytest.approx(float(scalar(function, [0.25])[0]), rel=500 * EPSILON)
