"""Transfer functions in Dr.Jit alone: sRGB, pure gamma, ACEScct, PQ and HLG, each with its inverse.

Curves take any Dr.Jit array of floats, or a Python float, and act on each component. Over [-0.1, 1e5] values and derivatives
are finite: where a standard's derivative is infinite at 0, the derivative below `SMALLEST` is 0.
"""

import math

from .backend import dr

SMALLEST = 1e-30  # powers of what is smaller are 0
REFERENCE_WHITE = 203.0  # cd/m2, HDR reference white of Report ITU-R BT.2408

ACESCCT_JOINT = 0.0078125  # scene-linear; this and the next four lines: Academy S-2016-001 (ACEScct)
ACESCCT_CODE_JOINT = 0.155251141552511
ACESCCT_SLOPE, ACESCCT_OFFSET = 10.5402377416545, 0.0729055341958355
ACESCCT_LARGEST = 65504.0
ACESCCT_LARGEST_CODE = (math.log2(ACESCCT_LARGEST) + 9.72) / 17.52

PQ_PEAK = 10000.0  # cd/m2 at code 1; this and the next lines: SMPTE ST 2084 and Rec. ITU-R BT.2100, table 4
PQ_M1, PQ_M2 = 2610 / 16384, 2523 / 4096 * 128
PQ_C2, PQ_C3 = 2413 / 4096 * 32, 2392 / 4096 * 32
PQ_C1 = PQ_C3 - PQ_C2 + 1
PQ_BLACK = PQ_C1**PQ_M2  # the code of 0 cd/m2, 7.3e-7
PQ_LARGEST_CODE = 1.75  # 4.4e8 cd/m2; the inverse has a pole at 1.99

HLG_A = 0.17883277  # Rec. ITU-R BT.2100, table 5
HLG_B, HLG_C = 1 - 4 * HLG_A, 0.5 - HLG_A * math.log(4 * HLG_A)
HLG_LARGEST_CODE = 4.0  # scene light 1.9e7
LUMINANCE_2020 = (0.2627, 0.6780, 0.0593)  # Rec. ITU-R BT.2020 and BT.2100, as the standards round them


def srgb_encode(linear):
    """IEC 61966-2-1: linear [0, 1] to code [0, 1]; negative values take the straight part of the curve."""
    curve = 1.055 * dr.power(dr.maximum(linear, 0.0031308), 1 / 2.4) - 0.055
    return dr.select(linear <= 0.0031308, 12.92 * linear, curve)


def srgb_decode(code):
    """The inverse of `srgb_encode`."""
    curve = dr.power((dr.maximum(code, 0.04045) + 0.055) / 1.055, 2.4)
    return dr.select(code <= 0.04045, code / 12.92, curve)


def gamma_encode(linear, gamma=2.2):
    """linear^(1 / gamma), [0, 1] to [0, 1]; negative values are mirrored, -|linear|^(1 / gamma). `gamma` is at least 1."""
    return _mirrored_power(linear, 1 / gamma)


def gamma_decode(code, gamma=2.2):
    """The inverse of `gamma_encode`: code^gamma, mirrored for negative codes."""
    return _mirrored_power(code, gamma)


def acescct_encode(linear):
    """Academy S-2016-001: scene-linear AP1 (ACEScg) to code; 0.18 is at 0.4136.

    Negative values take the straight part of the curve. Nothing is limited above.
    """
    curve = (dr.log2(dr.maximum(linear, ACESCCT_JOINT)) + 9.72) / 17.52
    return dr.select(linear <= ACESCCT_JOINT, ACESCCT_SLOPE * linear + ACESCCT_OFFSET, curve)


def acescct_decode(code):
    """The inverse of `acescct_encode`; it ends at 65504, as the standard says."""
    curve = dr.exp2(dr.clip(code, ACESCCT_CODE_JOINT, ACESCCT_LARGEST_CODE) * 17.52 - 9.72)
    return dr.select(code <= ACESCCT_CODE_JOINT, (code - ACESCCT_OFFSET) / ACESCCT_SLOPE, curve)


def pq_encode(linear, white=REFERENCE_WHITE):
    """SMPTE ST 2084, inverse EOTF: display light, of which 1.0 is `white` cd/m2, to code; 10000 cd/m2 is at 1.

    Negative light is 0, whose code is 7.3e-7. Light above 10000 cd/m2 goes on along the same formula, towards 1.99.

    The standard's ((c1 + c2 t) / (1 + c3 t))^m2 raises a rounded number near 1 to the power 78.8. With c1 = 1 + c3 - c2 the
    ratio is 1 - u, u = (c2 - c3) (1 - t) / (1 + c3 t), and log(1 - u) = -2 artanh(u / (2 - u)) keeps float32's precision.
    """
    t = _power(linear * (white / PQ_PEAK), PQ_M1)
    u = (PQ_C2 - PQ_C3) * (1 - t) / (1 + PQ_C3 * t)
    z = u / (2 - u)  # 0.09 at most: what the series leaves out is below 4e-12 of it
    z2 = z * z
    series = 1 + z2 * (1 / 3 + z2 * (1 / 5 + z2 * (1 / 7 + z2 * (1 / 9))))
    return dr.exp(-2 * PQ_M2 * z * series)


def pq_decode(code, white=REFERENCE_WHITE):
    """The inverse of `pq_encode`, the EOTF of SMPTE ST 2084: code to display light, of which 1.0 is `white` cd/m2.

    Codes below that of black give 0; codes are limited to 1.75, 4.4e8 cd/m2, because the formula has a pole at 1.99.
    """
    w = dr.log(dr.clip(code, PQ_BLACK, PQ_LARGEST_CODE)) / PQ_M2
    # s = 1 - exp(w) for w in [-0.18, 0.01]: what the series leaves out is below 1e-11 of it.
    s = -w * (1 + w / 2 * (1 + w / 3 * (1 + w / 4 * (1 + w / 5 * (1 + w / 6 * (1 + w / 7 * (1 + w / 8)))))))
    light = _power((PQ_C2 - PQ_C3 - s) / (PQ_C2 - PQ_C3 + PQ_C3 * s), 1 / PQ_M1)
    return light * (PQ_PEAK / white)


def hlg_encode(linear):
    """Rec. ITU-R BT.2100, table 5, OETF: scene light [0, 1] to code [0, 1]; 1/12 is at 0.5.

    Negative light is 0; light above 1 goes on along the logarithm.
    """
    root = dr.select(linear > SMALLEST, dr.sqrt(3 * dr.maximum(linear, SMALLEST)), 0)
    curve = HLG_A * dr.log(12 * dr.maximum(linear, 1 / 12) - HLG_B) + HLG_C
    return dr.select(linear <= 1 / 12, root, curve)


def hlg_decode(code):
    """The inverse of `hlg_encode`. Negative codes give 0; codes are limited to 4, scene light 1.9e7."""
    positive = dr.maximum(code, 0)
    curve = (dr.exp((dr.clip(code, 0.5, HLG_LARGEST_CODE) - HLG_C) / HLG_A) + HLG_B) / 12
    return dr.select(code <= 0.5, positive * positive / 3, curve)


def hlg_system_gamma(peak):
    """1.2 + 0.42 log10(peak / 1000) for displays of 400 to 2000 cd/m2: Rec. ITU-R BT.2100, table 5."""
    return 1.2 + 0.42 * math.log10(peak / 1000)


def hlg_display_from_scene(rgb, peak=1000.0):
    """HLG's OOTF: scene light, linear Rec. 2020 in [0, 1], to display light in cd/m2, F = peak Y^(gamma - 1) E.

    `peak` is the display's nominal peak luminance in cd/m2 (a Python number), its black is 0. Negative light is 0.
    Source: Rec. ITU-R BT.2100, table 5.
    """
    scene = dr.maximum(rgb, 0)
    return scene * (peak * _power(_luminance_2020(scene), hlg_system_gamma(peak) - 1))


def hlg_scene_from_display(rgb, peak=1000.0):
    """The inverse of `hlg_display_from_scene`: display light in cd/m2 to scene light, linear Rec. 2020."""
    display = dr.maximum(rgb, 0) / peak
    gamma = hlg_system_gamma(peak)
    return display * _power(_luminance_2020(display), (1 - gamma) / gamma)


def _luminance_2020(rgb):
    return LUMINANCE_2020[0] * rgb[0] + LUMINANCE_2020[1] * rgb[1] + LUMINANCE_2020[2] * rgb[2]


def _power(base, exponent):
    """base^exponent; 0 with derivative 0 where the base is below SMALLEST."""
    return dr.select(base > SMALLEST, dr.power(dr.maximum(base, SMALLEST), exponent), 0)


def _mirrored_power(base, exponent):
    power = _power(dr.abs(base), exponent)
    return dr.select(base < 0, -power, power)
