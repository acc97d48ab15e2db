"""Colour in Dr.Jit against the package colour-science, an independent implementation of the same standards."""

import ast
from pathlib import Path

import colour
import numpy as np
import pytest

import framepairs.colour as ours
from colour_samples import EPSILON, extreme_pixels, pixels, vector, vector_derivative
from framepairs import tone_maps, transfer
from framepairs.backend import dr, jit
from framepairs.errors import InputError

# colour-science evaluates both branches of a curve everywhere.
pytestmark = [pytest.mark.renders, pytest.mark.filterwarnings("ignore::RuntimeWarning:colour")]

SPACES = {
    "ITU-R BT.709": ours.REC_709,
    "P3-D65": ours.P3_D65,
    "ITU-R BT.2020": ours.REC_2020,
    "ACEScg": ours.ACESCG,
    "ACES2065-1": ours.ACES2065_1,
}
PAIRS = [(a, b) for a in SPACES for b in SPACES if a != b]


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


@pytest.mark.parametrize("module", [ours, transfer, tone_maps])
def test_colour_imports_dr_jit_and_the_standard_library_alone(module):
    tree = ast.parse(Path(module.__file__).read_text())
    relative = {(n.module, a.name) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.level for a in n.names}
    absolute = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    absolute |= {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and not n.level}
    assert absolute <= {"math", "dataclasses"}
    assert {name for name, _ in relative} <= {"backend", "errors", "transfer", "colour"}
    assert [what for name, what in relative if name == "backend"] == ["dr"]


@pytest.mark.parametrize("name", SPACES)
def test_spaces_are_those_of_colour_science(name):
    published, space = colour.RGB_COLOURSPACES[name], SPACES[name]
    np.testing.assert_array_equal(space.white, published.whitepoint)
    derived = colour.models.normalised_primary_matrix(published.primaries, published.whitepoint)
    np.testing.assert_allclose(space.xyz_from_rgb, derived, atol=1e-14)
    # The Academy publishes ten digits of AP0.
    np.testing.assert_allclose(space.xyz_from_rgb, published.matrix_RGB_to_XYZ, atol=1e-9)


def test_rows_from_rec_709_to_rec_2020_are_those_of_bt_2087():
    # Rec. ITU-R BT.2087-0, equation for M2: four digits
    published = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    np.testing.assert_allclose(ours.rgb_from_rgb(ours.REC_709, ours.REC_2020), published, atol=0.51e-4)


@pytest.mark.parametrize("name", ["bradford", "cat02"])
def test_adaptations_are_those_of_colour_science(name):
    published = {"bradford": "Bradford", "cat02": "CAT02"}[name]
    cones = colour.adaptation.CHROMATIC_ADAPTATION_TRANSFORMS[published]
    np.testing.assert_array_equal(ours.ADAPTATIONS[name], cones)
    for source, target in ((ours.D65, ours.ACES_WHITE), (ours.ACES_WHITE, ours.D65), ((0.44757, 0.40745), ours.D65)):
        whites = [colour.xy_to_XYZ(np.array(white)) for white in (source, target)]
        expected = colour.adaptation.matrix_chromatic_adaptation_VonKries(*whites, published)
        np.testing.assert_allclose(ours.white_adaptation(source, target, name), expected, atol=1e-14)


@pytest.mark.parametrize("adaptation, published", [("bradford", "Bradford"), ("cat02", "CAT02"), ("none", None)])
@pytest.mark.parametrize("source, target", PAIRS)
def test_rows_between_spaces_are_those_of_colour_science(source, target, adaptation, published):
    rows = ours.rgb_from_rgb(SPACES[source], SPACES[target], adaptation)
    expected = colour.matrix_RGB_to_RGB(*(colour.RGB_COLOURSPACES[name] for name in (source, target)), published)
    np.testing.assert_allclose(rows, expected, atol=5e-9)  # from the published digits of AP0
    if adaptation != "none":
        np.testing.assert_allclose(np.sum(rows, axis=1), 1, atol=1e-14)  # white stays white


@pytest.mark.parametrize("source, target", PAIRS)
def test_converting_there_and_back_gives_the_colour(source, target):
    rgb, there, back = pixels(), SPACES[source], SPACES[target]
    shown = vector(lambda x: ours.convert(x, there, back), rgb)
    rows = np.array(ours.rgb_from_rgb(there, back))
    # Three rounded products with rounded factors, and two sums: 4 epsilon of the sizes summed.
    sizes = np.abs(rgb.astype(float)) @ np.abs(rows).T
    assert (np.abs(shown - rgb.astype(float) @ rows.T) <= 4 * EPSILON * sizes).all()
    rows_back = np.abs(ours.rgb_from_rgb(back, there))
    error = np.abs(vector(lambda x: ours.convert(ours.convert(x, there, back), back, there), rgb) - rgb)
    assert (error <= 8 * EPSILON * sizes @ rows_back.T).all()
    np.testing.assert_allclose(np.array(rows) @ ours.rgb_from_rgb(back, there), np.eye(3), atol=1e-14)


def test_xyz_is_a_space_like_others():
    rgb = np.abs(pixels(high=10))
    adapted = colour.RGB_to_XYZ(rgb.astype(float), "ACEScg", np.array(ours.D65), "CAT02")
    shown = vector(lambda x: ours.convert(x, ours.ACESCG, ours.XYZ_D65, "cat02"), rgb)
    np.testing.assert_allclose(shown, adapted, atol=4 * EPSILON * 20)  # sums of up to 10 + 10
    np.testing.assert_allclose(ours.rgb_from_rgb(ours.ACESCG, ours.xyz_space(ours.ACES_WHITE)), ours.ACESCG.xyz_from_rgb)


def test_a_colour_of_the_same_space_is_left_alone():
    rgb = jit.Array3f(1, 2, 3)
    assert ours.convert(rgb, ours.REC_709, ours.REC_709) is rgb
    assert ours.rgb_from_rgb(ours.P3_D65, ours.P3_D65) == ours.IDENTITY


def test_an_unknown_adaptation_is_refused():
    with pytest.raises(InputError, match="unknown adaptation 'sharp'; there are bradford, cat02, none"):
        ours.convert(jit.Array3f(1, 2, 3), ours.ACESCG, ours.REC_709, "sharp")


ICTCP = {
    "pq": (ours.ictcp_pq_from_rgb, ours.rgb_from_ictcp_pq, "ITU-R BT.2100-2 PQ"),
    "hlg": (ours.ictcp_hlg_from_rgb, ours.rgb_from_ictcp_hlg, "ITU-R BT.2100-2 HLG"),
}


def light_2020(kind):
    """Rec. 2020 [N, 3] float32 over the standards' range, and what 1.0 is: 1 cd/m2 for PQ, the camera's peak for HLG."""
    return (np.abs(pixels(high=1e4)), (1.0,)) if kind == "pq" else (np.abs(pixels(high=1)), ())


@pytest.mark.parametrize("kind", ICTCP)
def test_ictcp_is_that_of_colour_science(kind):
    encode, decode, method = ICTCP[kind]
    rgb, white = light_2020(kind)
    expected = colour.RGB_to_ICtCp(rgb.astype(float), method=method)
    # Codes of at most 1, off by 4 epsilon (test_transfer), and sums of three: 6 epsilon, times rows whose sizes sum to 8.8.
    np.testing.assert_allclose(vector(lambda x: encode(x, *white), rgb), expected, atol=8.8 * 6 * EPSILON)
    # There and back codes are off by 8 epsilon: 4 of encoding, 1 of I, Ct and Cp times rows of size 2.6, 1 of the sum. Light
    # follows a code of PQ by 20 of its size at most above 1 cd/m2, one of HLG by 6 at the top and by its square below; the rows
    # from LMS to RGB have sizes that sum to 6.
    bound = {"pq": 20, "hlg": 6}[kind] * 8 * 6 * EPSILON * rgb.max(axis=1, keepdims=True)
    seen = rgb.max(axis=1) > 1e-4 * rgb.max()
    there_and_back = vector(lambda x: decode(encode(x, *white), *white), rgb)
    undone = vector(lambda x: decode(x, *white), np.float32(expected))
    assert (np.abs(there_and_back - rgb) <= bound)[seen].all() and (np.abs(undone - rgb) <= bound)[seen].all()


@pytest.mark.parametrize("kind", ICTCP)
def test_ictcp_of_grey_is_its_code(kind):
    encode, _, _ = ICTCP[kind]
    grey = np.float32(np.geomspace(1e-3, 1, 101))
    shown = vector(encode, np.repeat(grey[:, None], 3, axis=1))
    code = transfer.pq_encode if kind == "pq" else transfer.hlg_encode
    np.testing.assert_allclose(shown[:, 0], np.array(code(jit.Float(grey))), atol=4 * EPSILON)
    np.testing.assert_allclose(shown[:, 1:], 0, atol=8.8 * 4 * EPSILON)  # rows sum to 0


@pytest.mark.parametrize("kind", ICTCP)
def test_ictcp_of_extremes_is_finite(kind):
    encode, decode, _ = ICTCP[kind]
    for function in (encode, decode):
        assert np.isfinite(vector(function, extreme_pixels())).all()
        assert np.isfinite(vector_derivative(function, extreme_pixels())).all()


@pytest.mark.parametrize("function", [ours.aces_hill, ours.display_transform, ours.luminance, ours.ycocg_from_rgb])
def test_derivatives_of_extremes_are_finite(function):
    rgb = extreme_pixels()
    assert np.isfinite(vector(function, rgb)).all() and np.isfinite(vector_derivative(function, rgb)).all()


def test_exposure_from_ev100():
    # EV100 15, sunlight: 1 / (1.2 x 32768) (Lagarde and de Rousiers 2014, section 5.1)
    assert 2 ** ours.exposure_ev_from_ev100(15) == pytest.approx(1 / (1.2 * 32768), rel=1e-14)
    assert ours.exposure_ev_from_ev100(0) == pytest.approx(-0.2630344, abs=1e-7)  # log2 1.2
    assert ours.exposure_ev_from_ev100(ours.exposure_ev_from_ev100(9.3)) == pytest.approx(9.3, rel=1e-14)
    assert np.array(ours.exposure_ev_from_ev100(jit.Float([15, -3]))) == pytest.approx([-15.2630344, 2.7369656], rel=EPSILON)
