"""Colour in Dr.Jit alone: works on any Dr.Jit array, inside kernels, on any back end, differentiably.

RGB arguments are arrays with three components, scene-linear Rec. 709 unless said otherwise. The oracle in the tests is the
package colour-science.
"""

from .backend import dr

LUMINANCE_709 = (0.2126, 0.7152, 0.0722)  # Rec. ITU-R BT.709-6, item 3.2

# Stephen Hill's fit of the ACES reference rendering and output transforms for Rec. 709 displays (BakingLab, 2016).
ACES_FROM_RGB = ((0.59719, 0.35458, 0.04823), (0.07600, 0.90834, 0.01566), (0.02840, 0.13383, 0.83777))
RGB_FROM_ACES = ((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602))


def srgb_encode(linear):
    """IEC 61966-2-1: linear [0, 1] to code [0, 1]; negative values take the straight part of the curve."""
    curve = 1.055 * dr.power(dr.maximum(linear, 0.0031308), 1 / 2.4) - 0.055
    return dr.select(linear <= 0.0031308, 12.92 * linear, curve)


def srgb_decode(code):
    """The inverse of `srgb_encode`."""
    curve = dr.power((dr.maximum(code, 0.04045) + 0.055) / 1.055, 2.4)
    return dr.select(code <= 0.04045, code / 12.92, curve)


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


def aces_hill(rgb):
    """Hill's ACES fit: scene-linear RGB to display-linear RGB in [0, 1]."""
    v = _matrix(ACES_FROM_RGB, rgb)
    v = type(rgb)(*((c * (c + 0.0245786) - 0.000090537) / (c * (0.983729 * c + 0.4329510) + 0.238081) for c in v))
    return dr.clip(_matrix(RGB_FROM_ACES, v), 0, 1)


def display_transform(rgb, exposure_ev=0.0):
    """The transform `aces_srgb` on which metrics and pictures are made: exposure, Hill's ACES fit, sRGB; in [0, 1].

    The fit turns around above some 1e4, so what comes in is limited to 1000 after exposure.
    """
    exposed = dr.clip(rgb * dr.exp2(exposure_ev), 0, 1000)
    return dr.clip(srgb_encode(aces_hill(exposed)), 0, 1)


def _matrix(rows, rgb):
    return type(rgb)(*(row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2] for row in rows))
