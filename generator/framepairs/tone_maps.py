"""Tone maps in Dr.Jit alone: scene-linear Rec. 709 after exposure to display-linear Rec. 709 in [0, 1].

Each takes an array with three components. Negative components count as 0 and what exceeds 1e6 as 1e6, so that values and
derivatives are finite for any input but NaN. A display's curve, such as `srgb_encode`, follows.
"""

from .backend import dr
from .colour import aces_hill, luminance, transformed

LARGEST = 1e6

HABLE_A, HABLE_B, HABLE_C, HABLE_D, HABLE_E, HABLE_F = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30  # Hable 2010
HABLE_WHITE = 11.2

# Benjamin Wrensch, Minimal AgX Implementation (iolite-engine.com, 2023), after Troy Sobotka's AgX; rows.
AGX_INSET = (
    (0.842479062253094, 0.0784335999999992, 0.0792237451477643),
    (0.0423282422610123, 0.878468636469772, 0.0791661274605434),
    (0.0423756549057051, 0.0784336, 0.879142973793104),
)
AGX_OUTSET = (
    (1.19687900512017, -0.0980208811401368, -0.0990297440797205),
    (-0.0528968517574562, 1.15190312990417, -0.0989611768448433),
    (-0.0529716355144438, -0.0980434501171241, 1.15107367264116),
)
AGX_RANGE = (-12.47393, 4.026069)  # log2 of what is black and white: 10 stops below 0.18 and 6.5 above
AGX_CURVE = (-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5)  # ascending powers
AGX_GAMMA = 2.2  # AgX ends in codes of a display with this exponent

NEUTRAL_F90 = 0.04  # Khronos PBR Neutral tone mapper, specification 1.0 (2024)
NEUTRAL_START = 0.8 - NEUTRAL_F90
NEUTRAL_DESATURATION = 0.15


def reinhard(rgb):
    """L / (1 + L) on luminance: Reinhard et al. 2002, equation 3. Saturated colours are cut at 1."""
    rgb = _limited(rgb)
    return dr.clip(rgb / (1 + luminance(rgb)), 0, 1)


def reinhard_extended(rgb, white=4.0):
    """L (1 + L / white^2) / (1 + L) on luminance: Reinhard et al. 2002, equation 4. The luminance `white` becomes 1."""
    rgb = _limited(rgb)
    light = luminance(rgb)
    return dr.clip(rgb * ((1 + light / (white * white)) / (1 + light)), 0, 1)


def hable(rgb, exposure_bias=2.0, white=HABLE_WHITE):
    """John Hable's curve of Uncharted 2, per channel: f(exposure_bias * c) / f(white) (Filmic Tonemapping Operators, 2010)."""
    return dr.clip(_hable_curve(exposure_bias * _limited(rgb)) / _hable_curve(white), 0, 1)


def aces(rgb):
    """Stephen Hill's fit, `aces_hill`, of light limited to [0, 1000] as in `display_transform`: it turns around beyond."""
    return aces_hill(dr.clip(rgb, 0, 1000))


def agx(rgb):
    """AgX's base look in Benjamin Wrensch's fit of 6th order (2023), with the display's exponent 2.2 taken off at the end.

    Against Troy Sobotka's sigmoid the fit errs by 0.0058 of code at most, mean squared 7.1e-6; the published 3.67e-6 is that
    of the fit before its coefficients were rounded. It is below 0 at black, which becomes 0, and shows white as 0.997.
    """
    low, high = AGX_RANGE
    v = dr.maximum(transformed(AGX_INSET, _limited(rgb)), 1e-10)
    codes = transformed(AGX_OUTSET, _polynomial(AGX_CURVE, (dr.clip(dr.log2(v), low, high) - low) / (high - low)))
    return dr.select(codes > 0, dr.power(dr.clip(codes, 1e-6, 1), AGX_GAMMA), 0)


def pbr_neutral(rgb):
    """The Khronos PBR Neutral tone mapper: c - 0.04 for components in [0.08, 0.8], highlights compressed and desaturated."""
    rgb = _limited(rgb)
    least = dr.minimum(rgb[0], dr.minimum(rgb[1], rgb[2]))
    rgb = rgb - dr.select(least < 2 * NEUTRAL_F90, least - least * least / (4 * NEUTRAL_F90), NEUTRAL_F90)
    peak = dr.maximum(rgb[0], dr.maximum(rgb[1], rgb[2]))
    bright = dr.maximum(peak, NEUTRAL_START)
    room = 1 - NEUTRAL_START
    compressed = 1 - room * room / (bright + room - NEUTRAL_START)
    kept = 1 / (NEUTRAL_DESATURATION * (bright - compressed) + 1)
    shown = rgb * (compressed / bright * kept) + compressed * (1 - kept)
    return dr.clip(dr.select(peak < NEUTRAL_START, rgb, shown), 0, 1)


def _limited(rgb):
    return dr.clip(rgb, 0, LARGEST)


def _hable_curve(x):
    """((x (A x + C B) + D E) / (x (A x + B) + D F)) - E / F over one denominator: 0 at 0, and nothing cancels."""
    foot = HABLE_E / HABLE_F
    numerator = x * (HABLE_A * (1 - foot) * x + HABLE_B * (HABLE_C - foot))
    return numerator / (x * (HABLE_A * x + HABLE_B) + HABLE_D * HABLE_F)


def _polynomial(coefficients, x):
    result = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = result * x + coefficient
    return result
