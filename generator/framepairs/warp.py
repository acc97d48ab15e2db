"""Looking up images at real positions, and warping the previous frame onto the present one, in Dr.Jit.

Images are `Image`s: planes of Dr.Jit floats in row-major order. Positions are in pixels of the image, the centre of pixel
(i, j) at (i + 0.5, j + 0.5); what lies outside takes the nearest edge pixel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, jit


@dataclass(frozen=True)
class Image:
    """planes: one array of width * height values per component."""

    planes: tuple
    width: int
    height: int


def to_image(array: NDArray) -> Image:
    """From [height, width, components], float32 or uint32."""
    height, width, components = array.shape
    kind = jit.UInt32 if array.dtype == np.uint32 else jit.Float
    planes = tuple(kind(np.ascontiguousarray(array[..., k]).ravel()) for k in range(components))
    return Image(planes, width, height)


def to_array(planes, width: int, height: int) -> NDArray:
    """[height, width, components] from planes."""
    return np.stack([np.array(plane).reshape(height, width) for plane in planes], axis=-1)


def pixel_centres(width: int, height: int) -> tuple:
    """x and y of every pixel's centre, row-major."""
    index = dr.arange(jit.UInt32, width * height)
    columns = dr.opaque(jit.UInt32, width)
    return jit.Float(index % columns) + 0.5, jit.Float(index // columns) + 0.5


def fetch(image: Image, i, j) -> list:
    """The pixel in column i, row j (Int32), clamped to the image."""
    right, bottom = dr.opaque(jit.Int32, image.width - 1), dr.opaque(jit.Int32, image.height - 1)
    place = jit.UInt32(dr.clip(j, 0, bottom)) * jit.UInt32(right + 1) + jit.UInt32(dr.clip(i, 0, right))
    return [dr.gather(type(plane), plane, place) for plane in image.planes]


def nearest(image: Image, x, y) -> list:
    """The pixel that holds (x, y)."""
    return fetch(image, jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y)))


def bilinear(image: Image, x, y) -> list:
    """Linear between the four pixel centres around (x, y)."""
    return _separable(image, x, y, 2, _linear_weights)


def catmull_rom(image: Image, x, y) -> list:
    """Catmull-Rom (bicubic, a = -1/2) between sixteen pixel centres; overshoots."""
    return _separable(image, x, y, 4, _catmull_rom_weights)


def _separable(image: Image, x, y, taps: int, weights) -> list:
    left, top = dr.floor(x - 0.5), dr.floor(y - 0.5)
    wx, wy = weights(x - 0.5 - left), weights(y - 0.5 - top)
    i, j = jit.Int32(left) - (taps // 2 - 1), jit.Int32(top) - (taps // 2 - 1)
    total = [jit.Float(0) for _ in image.planes]
    for row in range(taps):
        line = [jit.Float(0) for _ in image.planes]
        for column in range(taps):
            pixel = fetch(image, i + column, j + row)
            line = [dr.fma(wx[column], value, so_far) for value, so_far in zip(pixel, line, strict=True)]
        total = [dr.fma(wy[row], value, so_far) for value, so_far in zip(line, total, strict=True)]
    return total


def _linear_weights(t) -> list:
    return [1 - t, t]


def _catmull_rom_weights(t) -> list:
    t2, t3 = t * t, t * t * t
    return [
        -0.5 * t3 + t2 - 0.5 * t,
        1.5 * t3 - 2.5 * t2 + 1,
        -1.5 * t3 + 2 * t2 + 0.5 * t,
        0.5 * t3 - 0.5 * t2,
    ]
