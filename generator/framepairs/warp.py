"""Looking up images at real positions, and warping the previous frame onto the present one (backward warp), in Dr.Jit.

Images are `Image`s: planes of Dr.Jit floats in row-major order. Positions are in pixels of the image, the centre of pixel
(i, j) at (i + 0.5, j + 0.5); what lies outside takes the nearest edge pixel.
"""

import math
from dataclasses import dataclass
from typing import Literal

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
    planes = tuple(kind(_aligned(array[..., k])) for k in range(components))
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


def corners(image: Image, x, y) -> list[list]:
    """The four pixels whose centres are around a place."""
    i, j = jit.Int32(dr.floor(x - 0.5)), jit.Int32(dr.floor(y - 0.5))
    return [fetch(image, i + column, j + row) for row in (0, 1) for column in (0, 1)]


def range_around(image: Image, x, y) -> tuple[list, list]:
    """The least and the greatest of these four, plane by plane."""
    lowest = highest = None
    for corner in corners(image, x, y):
        lowest = [dr.minimum(a, b) for a, b in zip(lowest or corner, corner, strict=True)]
        highest = [dr.maximum(a, b) for a, b in zip(highest or corner, corner, strict=True)]
    return lowest, highest


def nearest(image: Image, x, y) -> list:
    """The pixel that holds (x, y)."""
    return fetch(image, jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y)))


def bilinear(image: Image, x, y) -> list:
    """Linear between the four pixel centres around (x, y)."""
    return _separable(image, x, y, 2, _linear_weights)


def catmull_rom(image: Image, x, y) -> list:
    """Catmull-Rom (bicubic, a = -1/2) between sixteen pixel centres; overshoots."""
    return _separable(image, x, y, 4, _catmull_rom_weights)


def lanczos2(image: Image, x, y) -> list:
    """Lanczos-2, separable: L(d) = sinc(d) sinc(d / 2) for |d| < 2 (Turkowski 1990) per axis, over sixteen pixel centres.

    The weights of each axis are divided by their sum, which is 1 to 1.019, so that constants survive. Overshoots. The radial
    form of FSR 2's upsampling is another filter: it does not give the image back at its own pixel centres.
    """
    return _separable(image, x, y, 4, _lanczos2_weights)


Filter = Literal["nearest", "bilinear", "catmull_rom", "lanczos2"]
FILTERS = {"nearest": nearest, "bilinear": bilinear, "catmull_rom": catmull_rom, "lanczos2": lanczos2}


def backward_warp(
    previous: Image,
    motion: Image,
    method: Filter = "bilinear",
    jitter: tuple[float, float] = (0.0, 0.0),
    previous_jitter: tuple[float, float] = (0.0, 0.0),
) -> list:
    """The previous buffer as seen from the present one: planes of motion.width x motion.height values.

    motion: ours (previous - current, pixels of its own buffer, y down). previous: any size that spans the same frustum;
    integer planes need `nearest`. jitter: J of the buffer that holds the motion, in its pixels; previous_jitter: J of
    `previous`, in its pixels, 0 for the truth and for an accumulated history. Each pixel shows the place centre - J, was at
    that plus motion, and is found J(t-1) further. What no history can know (visibility) is not masked here.
    """
    x, y = pixel_centres(motion.width, motion.height)
    x, y = x - dr.opaque(jit.Float, jitter[0]) + motion.planes[0], y - dr.opaque(jit.Float, jitter[1]) + motion.planes[1]
    across, down = (
        dr.opaque(jit.Float, theirs / ours)
        for theirs, ours in ((previous.width, motion.width), (previous.height, motion.height))
    )
    places = x * across + dr.opaque(jit.Float, previous_jitter[0]), y * down + dr.opaque(jit.Float, previous_jitter[1])
    return FILTERS[method](previous, *places)


def _aligned(plane: NDArray) -> NDArray:
    """A flat copy that begins at a multiple of 64 bytes. Dr.Jit maps NumPy's memory, and what is not aligned is another
    kernel to it: frames would be compiled anew by chance."""
    size = plane.size * plane.itemsize
    room = np.empty(size + 64, np.uint8)
    start = -room.ctypes.data % 64
    flat = room[start : start + size].view(plane.dtype)
    np.copyto(flat.reshape(plane.shape), plane)
    return flat


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


def _lanczos2_weights(t) -> list:
    """sin(pi d) is the same at all four taps but for its sign: 2 a b with a = sin(pi t / 2), b = sin(pi (1 - t) / 2). Written
    so that a tap at distance 0 has weight 1 and the others 0, without a rounding."""
    a, b = dr.sin(0.5 * math.pi * t), dr.sin(0.5 * math.pi * (1 - t))
    outer = -4 / math.pi**2 * a * b
    weights = [
        outer * b / dr.square(1 + t),
        dr.square(_sinc(t, a)) * b,
        dr.square(_sinc(1 - t, b)) * a,
        outer * a / dr.square(2 - t),
    ]
    scale = dr.rcp(weights[0] + weights[1] + weights[2] + weights[3])
    return [weight * scale for weight in weights]


def _sinc(t, sine):
    """sin(pi t / 2) / (pi t / 2), given the sine."""
    return dr.select(t > 0, sine / dr.select(t > 0, 0.5 * math.pi * t, 1), 1)
