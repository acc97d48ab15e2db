"""`accumulate`: a weighted sum of jittered samples at their unjittered places, carried along the motion, and forgotten where
the previous frame did not see the surface. Colours are not rectified, so a static scene converges to its truth.
"""

from dataclasses import dataclass

from ..backend import dr, jit
from ..channels import seen_before
from ..warp import Image, bilinear, fetch, nearest, pixel_centres
from .inputs import UpscaleFrame
from .neighbourhood import gaussian_kernel
from .settings import UpscaleSettings
from .spatial import lr_places, neighbours, opaque
from .temporal import scales

LEAST_WEIGHT = 1e-6  # of the nearest sample, however far jitter has moved it


@dataclass(frozen=True)
class Sums:
    """Mean colour [3] and its weight [1], per HR pixel."""

    color: Image
    weight: Image


def accumulate(history: Sums | None, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple[Sums, list]:
    """Add one LR frame to what is remembered (None: after a reset): that, and the upscaled image's planes, scene-linear."""
    width, height = frame.size
    if history is None:
        empty = [dr.opaque(jit.Float, 0, width * height) for _ in range(4)]
        history = Sums(Image(tuple(empty[:3]), width, height), Image((empty[3],), width, height))
    x, y = lr_places(frame.lr["color"], frame.size, frame.jitter)
    sums, weight = splat(frame.lr["color"], x, y, scales(frame), settings)
    old, old_weight = _carried(history, frame, x, y, settings)
    total = weight + old_weight
    mean = [(new + before * old_weight) / total for new, before in zip(sums, old, strict=True)]
    dr.eval(mean, total)
    return Sums(Image(tuple(mean), width, height), Image((total,), width, height)), mean


def splat(color: Image, x, y, scale, settings: UpscaleSettings) -> tuple:
    """Weighted sums [3] of the 3x3 LR samples nearest to each HR pixel, and the weight: > 0 everywhere."""
    kernel = gaussian_kernel(scale, opaque(settings.still_sigma), settings)
    sums, weight = [jit.Float(0)] * 3, jit.Float(0)
    for near in neighbours(color, x, y):
        w = kernel(near.dx, near.dy) * near.inside
        w = dr.maximum(w, LEAST_WEIGHT) if near.middle else w
        pixel = fetch(color, near.column, near.row)
        sums = [dr.fma(w, value, so_far) for value, so_far in zip(pixel, sums, strict=True)]
        weight += w
    return sums, weight


def _carried(history: Sums, frame: UpscaleFrame, x, y, settings: UpscaleSettings) -> tuple:
    """What is remembered at the place where each HR pixel's surface was: (mean [3], weight); weight 0 where it was not seen."""
    moved = nearest(frame.lr["motion"], x, y)
    bits = nearest(frame.lr["visibility"], x, y)[0]
    hx, hy = pixel_centres(*frame.size)
    dx, dy = (value * factor for value, factor in zip(moved, scales(frame), strict=True))
    weight = bilinear(history.weight, hx + dx, hy + dy)[0]
    still = (dx == 0) & (dy == 0)
    kept = dr.select(still, weight, dr.minimum(weight, opaque(settings.accumulate_most_moving)))
    return bilinear(history.color, hx + dx, hy + dy), dr.select(seen_before(bits), kept, 0)
