"""History against the present frame's colours: clipped into an ellipsoid in YCoCg (Salvi 2016), in compressed light.

Compression is c / (1 + s max(c)) (Karis 2014) with s the exposure times `UpscaleSettings.compression`, so that one very
bright sample does not outweigh all others.
"""

from ..backend import dr, jit
from ..colour import rgb_from_ycocg, ycocg_from_rgb

BRIGHTEST_SHOWN = 1e5  # what is decompressed is limited to this, after exposure: 1 - x has lost its digits beyond


def compress(rgb, strength):
    """rgb / (1 + strength max|rgb|), components within 1 / strength; strength 0: unchanged."""
    return rgb * dr.rcp(1 + strength * dr.max(dr.abs(rgb)))


def expand(rgb, strength):
    """The inverse of `compress`, limited to BRIGHTEST_SHOWN / strength."""
    return rgb * dr.rcp(dr.maximum(1 - strength * dr.max(dr.abs(rgb)), 1 / BRIGHTEST_SHOWN))


def rectify(history, mean, half_size) -> tuple:
    """History, compressed RGB, moved towards `mean` (YCoCg) onto the ellipsoid with half axes `half_size` (YCoCg, > 0), and
    how far outside it was, >= 1: 1 where it was inside and stays as it is."""
    offset = ycocg_from_rgb(history) - mean
    beyond = dr.maximum(dr.norm(offset / half_size), 1)
    inside = beyond <= 1
    clipped = rgb_from_ycocg(mean + offset * dr.rcp(beyond))
    return dr.select(inside, history, clipped), beyond


def half_sizes(deviation, sigmas, luma_factor, more, least) -> jit.Array3f:
    """Half axes in YCoCg: `sigmas` deviations, luma longer by `luma_factor`, plus `more` and `least` > 0."""
    return deviation * sigmas * jit.Array3f(luma_factor, 1, 1) + more + least
