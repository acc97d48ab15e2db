"""The 3x3 LR samples around each HR pixel: the colour that they suggest for it, and how colours vary among them.

Passes 3 and 5 of the temporal methods. Samples count at the places that they show, without jitter.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..backend import dr, jit
from ..colour import rgb_from_ycocg, ycocg_from_rgb
from ..warp import Image, fetch
from .rectification import compress
from .settings import UpscaleSettings
from .spatial import neighbours, opaque

STATISTICS = -2.3  # exponent per squared LR pixel of the weights of mean and deviation (FSR 2.2)
NARROWEST = 1.99  # most that the radial kernel's distances are scaled by, so that it reaches 1 LR pixel far (FSR 2.2)


@dataclass(frozen=True)
class Neighbourhood:
    """color: compressed RGB, between the least and greatest of the samples. weight: sum of the kernel, small where no sample
    fell near. low, high: of the samples. mean, deviation: weighted, compressed YCoCg."""

    color: jit.Array3f
    weight: jit.Float
    low: jit.Array3f
    high: jit.Array3f
    mean: jit.Array3f
    deviation: jit.Array3f


def neighbourhood(color: Image, x, y, scale, sigma, strength, settings: UpscaleSettings) -> Neighbourhood:
    """color: LR, scene-linear [3]. x, y: HR pixels' places in LR pixels, jitter added (`lr_places`). scale: HR pixels per LR
    pixel and axis. sigma: HR pixels, of the Gaussian kernel. strength: of `compress`."""
    kernel = _radial_lanczos(scale) if settings.kernel == "radial_lanczos" else gaussian_kernel(scale, sigma, settings)
    sums, weight = jit.Array3f(0), jit.Float(0)
    first, second, total = jit.Array3f(0), jit.Array3f(0), jit.Float(0)
    low, high = jit.Array3f(math.inf), jit.Array3f(-math.inf)
    for near in neighbours(color, x, y):
        sample = compress(jit.Array3f(*fetch(color, near.column, near.row)), strength)
        w = kernel(near.dx, near.dy) * near.inside
        sums, weight = dr.fma(sample, w, sums), weight + w
        low, high = dr.minimum(low, sample), dr.maximum(high, sample)
        w = dr.exp(STATISTICS * (dr.square(near.dx) + dr.square(near.dy))) * near.inside
        ycocg = ycocg_from_rgb(sample)
        first, second, total = dr.fma(ycocg, w, first), dr.fma(dr.square(ycocg), w, second), total + w
    mean = first / total
    known = weight > opaque(settings.least_weight)
    estimate = dr.select(known, sums / dr.select(known, weight, 1), rgb_from_ycocg(mean))
    return Neighbourhood(
        dr.clip(estimate, low, high),
        dr.maximum(weight, opaque(settings.least_weight)),
        low,
        high,
        mean,
        dr.sqrt(dr.maximum(second / total - dr.square(mean), 0)),
    )


def sample_sigma(speed, still: float, moving: float):
    """HR pixels, of one sample's Gaussian: from `still` to `moving` at a speed of 1 HR pixel per frame."""
    return dr.lerp(opaque(still), opaque(moving), dr.minimum(speed, 1))


def gaussian_kernel(scale, sigma, settings: UpscaleSettings) -> Callable:
    """Weight of a sample at (dx, dy) LR pixels: a Gaussian of `sigma` HR pixels and a share of one as wide as the LR pixel,
    under a tent that ends at the neighbours' centres. It is 1 at the centre, and at scale 1 without jitter 0 for every other
    sample. scale: HR pixels per LR pixel and axis."""
    narrow = -0.5 / dr.square(sigma)
    share = opaque(settings.wide)

    def weight(dx, dy):
        near = dr.exp(narrow * (dr.square(dx * scale[0]) + dr.square(dy * scale[1])))
        wide = dr.exp(-2 * (dr.square(dx) + dr.square(dy)))
        tent = dr.maximum(1 - dr.abs(dx), 0) * dr.maximum(1 - dr.abs(dy), 0)
        return dr.lerp(near, wide, share) * tent

    return weight


def _radial_lanczos(scale) -> Callable:
    """sinc(d) sinc(d / 2) of the distance d in LR pixels times min(NARROWEST, scale): no interpolation, its sum is not 1."""
    across, down = (dr.minimum(factor, NARROWEST) for factor in scale)

    def weight(dx, dy):
        d = dr.sqrt(dr.square(dx * across) + dr.square(dy * down))
        return dr.select(d < 2, _sinc(d) * _sinc(0.5 * d), 0)

    return weight


def _sinc(d):
    near = d < 1e-4
    angle = math.pi * dr.select(near, 1, d)
    return dr.select(near, 1, dr.sin(angle) / angle)
