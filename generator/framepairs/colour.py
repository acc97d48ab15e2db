"""Colour in Dr.Jit alone: works on any Dr.Jit array, inside kernels, on any back end, differentiably.

RGB arguments are arrays with three components, scene-linear Rec. 709 unless said otherwise. The oracle in the tests is the
package colour-science. Curves are in `transfer`, tone maps in `tone_maps`.
"""

import math
from dataclasses import dataclass

from .backend import dr
from .errors import InputError
from .transfer import REFERENCE_WHITE, hlg_decode, hlg_encode, pq_decode, pq_encode, srgb_encode
from .transfer import srgb_decode as srgb_decode

Rows = tuple[tuple[float, float, float], ...]

LUMINANCE_709 = (0.2126, 0.7152, 0.0722)  # Rec. ITU-R BT.709-6, item 3.2

# Stephen Hill's fit of the ACES reference rendering and output transforms for Rec. 709 displays (BakingLab, 2016).
ACES_FROM_RGB = ((0.59719, 0.35458, 0.04823), (0.07600, 0.90834, 0.01566), (0.02840, 0.13383, 0.83777))
RGB_FROM_ACES = ((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602))

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# Cone responses in which a white is adapted to another one.
ADAPTATIONS = {
    # Lam 1985, as in Lindbloom and ICC.1:2010, annex E
    "bradford": ((0.8951, 0.2664, -0.1614), (-0.7502, 1.7135, 0.0367), (0.0389, -0.0685, 1.0296)),
    # CIE 159:2004, CIECAM02
    "cat02": ((0.7328, 0.4296, -0.1624), (-0.7036, 1.6975, 0.0061), (0.0030, 0.0136, 0.9834)),
}
D65 = (0.3127, 0.3290)  # x, y as Rec. ITU-R BT.709 rounds them
ACES_WHITE = (0.32168, 0.33767)  # x, y; SMPTE ST 2065-1

# Rec. ITU-R BT.2100-2, table 7: LMS from linear Rec. 2020, and I, Ct, Cp from encoded LMS, for PQ and for HLG.
LMS_FROM_2020 = tuple(tuple(n / 4096 for n in row) for row in ((1688, 2146, 262), (683, 2951, 462), (99, 309, 3688)))
ICTCP_FROM_PQ = tuple(tuple(n / 4096 for n in row) for row in ((2048, 2048, 0), (6610, -13613, 7003), (17933, -17390, -543)))
ICTCP_FROM_HLG = tuple(tuple(n / 4096 for n in row) for row in ((2048, 2048, 0), (3625, -7465, 3840), (9500, -9212, -288)))


@dataclass(frozen=True)
class ColourSpace:
    """A linear space of three components: `white` is x, y of its white, `xyz_from_rgb` three rows; Y of white is 1."""

    name: str
    white: tuple[float, float]
    xyz_from_rgb: Rows


def colour_space(name, red, green, blue, white) -> ColourSpace:
    """The RGB space of three primaries and a white, each x, y: SMPTE RP 177, section 3.3."""
    columns = _transposed(tuple(_xyz(x, y) for x, y in (red, green, blue)))
    amounts = _applied(inverse(columns), _xyz(*white))
    return ColourSpace(name, white, tuple(tuple(c * a for c, a in zip(row, amounts, strict=True)) for row in columns))


def xyz_space(white=D65) -> ColourSpace:
    """CIE 1931 XYZ seen under a white, given as x, y."""
    return ColourSpace("xyz", white, IDENTITY)


def inverse(rows: Rows) -> Rows:
    """The inverse of a 3 x 3 matrix in Python's floats."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    cofactors = (
        (e * i - f * h, c * h - b * i, b * f - c * e),
        (f * g - d * i, a * i - c * g, c * d - a * f),
        (d * h - e * g, b * g - a * h, a * e - b * d),
    )
    determinant = a * cofactors[0][0] + b * cofactors[1][0] + c * cofactors[2][0]
    return tuple(tuple(n / determinant for n in row) for row in cofactors)


def product(left: Rows, right: Rows) -> Rows:
    """The matrix that applies `right`, then `left`."""
    return tuple(_applied(_transposed(right), row) for row in left)


def white_adaptation(source_white, target_white, adaptation="bradford") -> Rows:
    """XYZ under one white (x, y) to XYZ under another, by von Kries' rule on cone responses.

    `adaptation` is 'bradford', 'cat02' or 'none' (XYZ are kept). Raises InputError for another name.
    """
    if adaptation != "none" and adaptation not in ADAPTATIONS:
        raise InputError(f"unknown adaptation {adaptation!r}; there are {', '.join(ADAPTATIONS)}, none")
    if adaptation == "none" or source_white == target_white:
        return IDENTITY
    cones = ADAPTATIONS[adaptation]
    before, after = (_applied(cones, _xyz(*white)) for white in (source_white, target_white))
    scaled = tuple(tuple(n * t / s for n in row) for row, s, t in zip(cones, before, after, strict=True))
    return product(inverse(cones), scaled)


def rgb_from_rgb(source: ColourSpace, target: ColourSpace, adaptation="bradford") -> Rows:
    """Three rows, float64, that turn linear colours of `source` into those of `target`; XYZ is a space like others."""
    if source == target:
        return IDENTITY
    adapted = product(white_adaptation(source.white, target.white, adaptation), source.xyz_from_rgb)
    return product(inverse(target.xyz_from_rgb), adapted)


def convert(rgb, source: ColourSpace, target: ColourSpace, adaptation="bradford"):
    """Linear colours of `source` as those of `target`: any size, any sign; what `target` cannot hold comes out negative."""
    return rgb if source == target else transformed(rgb_from_rgb(source, target, adaptation), rgb)


def transformed(rows: Rows, rgb):
    """Three rows of numbers times a vector of three components."""
    return type(rgb)(*(row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2] for row in rows))


def luminance(rgb):
    """Relative luminance Y."""
    return LUMINANCE_709[0] * rgb[0] + LUMINANCE_709[1] * rgb[1] + LUMINANCE_709[2] * rgb[2]


def ycocg_from_rgb(rgb):
    """Y = R/4 + G/2 + B/4, Co = R/2 - B/2, Cg = -R/4 + G/2 - B/4 (Malvar and Sullivan 2003)."""
    return type(rgb)(
        0.25 * rgb[0] + 0.5 * rgb[1] + 0.25 * rgb[2],
        0.5 * rgb[0] - 0.5 * rgb[2],
        -0.25 * rgb[0] + 0.5 * rgb[1] - 0.25 * rgb[2],
    )


def rgb_from_ycocg(ycocg):
    """The inverse of `ycocg_from_rgb`."""
    y, co, cg = ycocg[0], ycocg[1], ycocg[2]
    return type(ycocg)(y + co - cg, y + cg, y - co - cg)


def ictcp_pq_from_rgb(rgb, white=REFERENCE_WHITE):
    """I in [0, 1], Ct and Cp in about [-0.5, 0.5] of linear Rec. 2020 display light, of which 1.0 is `white` cd/m2.

    Negative L, M and S are 0. Source: Rec. ITU-R BT.2100-2, table 7.
    """
    return transformed(ICTCP_FROM_PQ, pq_encode(transformed(LMS_FROM_2020, rgb), white))


def rgb_from_ictcp_pq(ictcp, white=REFERENCE_WHITE):
    """The inverse of `ictcp_pq_from_rgb`; encoded L, M and S are limited as `pq_decode` limits codes."""
    return transformed(RGB_FROM_LMS, pq_decode(transformed(PQ_FROM_ICTCP, ictcp), white))


def ictcp_hlg_from_rgb(rgb):
    """I in [0, 1], Ct and Cp of linear Rec. 2020 scene light in [0, 1], with HLG's curve: Rec. ITU-R BT.2100-2, table 7."""
    return transformed(ICTCP_FROM_HLG, hlg_encode(transformed(LMS_FROM_2020, rgb)))


def rgb_from_ictcp_hlg(ictcp):
    """The inverse of `ictcp_hlg_from_rgb`; encoded L, M and S are limited as `hlg_decode` limits codes."""
    return transformed(RGB_FROM_LMS, hlg_decode(transformed(HLG_FROM_ICTCP, ictcp)))


def exposure_ev_from_ev100(ev100):
    """The exposure of our frames, colour * 2^exposure_ev, from a camera's EV100; its own inverse.

    Luminances in cd/m2 then come out as 1.0 where the sensor saturates: 2^exposure_ev = 1 / (1.2 * 2^EV100) (ISO 12232,
    saturation-based speed; Lagarde and de Rousiers, Moving Frostbite to PBR, 2014, section 5.1).
    """
    return -ev100 - math.log2(1.2)


def aces_hill(rgb):
    """Hill's ACES fit: scene-linear RGB to display-linear RGB in [0, 1].

    Nothing is limited before the fit, which turns around below 0 and above some 1e4: see `tone_maps.aces`.
    """
    v = transformed(ACES_FROM_RGB, rgb)
    v = type(rgb)(*((c * (c + 0.0245786) - 0.000090537) / (c * (0.983729 * c + 0.4329510) + 0.238081) for c in v))
    return dr.clip(transformed(RGB_FROM_ACES, v), 0, 1)


def display_transform(rgb, exposure_ev=0.0):
    """The transform `aces_srgb` on which metrics and pictures are made: exposure, Hill's ACES fit, sRGB; in [0, 1].

    The fit turns around above some 1e4, so what comes in is limited to 1000 after exposure.
    """
    exposed = dr.clip(rgb * dr.exp2(exposure_ev), 0, 1000)
    return dr.clip(srgb_encode(aces_hill(exposed)), 0, 1)


def _xyz(x: float, y: float) -> tuple[float, float, float]:
    """XYZ with Y = 1 of a chromaticity; for y = 0 there is none."""
    return x / y, 1.0, (1 - x - y) / y


def _transposed(rows: Rows) -> Rows:
    return tuple(zip(*rows, strict=True))


def _applied(rows: Rows, vector) -> tuple[float, float, float]:
    return tuple(sum(n * v for n, v in zip(row, vector, strict=True)) for row in rows)


REC_709 = colour_space("rec709", (0.640, 0.330), (0.300, 0.600), (0.150, 0.060), D65)  # Rec. ITU-R BT.709-6, items 1.3, 1.4
P3_D65 = colour_space("p3_d65", (0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65)  # SMPTE EG 432-1, with white D65
REC_2020 = colour_space("rec2020", (0.708, 0.292), (0.170, 0.797), (0.131, 0.046), D65)  # Rec. ITU-R BT.2020-2, table 3
ACESCG = colour_space("acescg", (0.713, 0.293), (0.165, 0.830), (0.128, 0.044), ACES_WHITE)  # AP1, Academy S-2014-004
ACES2065_1 = colour_space("aces2065_1", (0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770), ACES_WHITE)  # AP0, ST 2065-1
XYZ_D65 = xyz_space(D65)

RGB_FROM_LMS, PQ_FROM_ICTCP, HLG_FROM_ICTCP = inverse(LMS_FROM_2020), inverse(ICTCP_FROM_PQ), inverse(ICTCP_FROM_HLG)
