"""Which surface a pixel's history belongs to, as a game can know it: dilated motion, and depth against the previous depth.

Passes 1 and 2 of the temporal methods, after FSR 2.2 (AMD 2023); separation of depths after Akeley and Su 2006.
"""

import math

from ..backend import dr, jit
from ..warp import Image, fetch, pixel_centres
from .inputs import FAR
from .settings import UpscaleSettings
from .spatial import Jitter, opaque

NEIGHBOURS = tuple((column, row) for row in (-1, 0, 1) for column in (-1, 0, 1))


def dilate(depth: Image, motion: Image) -> Image:
    """Depth and motion [3] of the nearest surface within 3x3 pixels: the blend at an edge moves with what is in front."""
    i, j = pixel_indices(depth.width, depth.height)
    nearest, column, row = fetch(depth, i, j)[0], jit.Int32(i), jit.Int32(j)
    for across, down in NEIGHBOURS:
        z = fetch(depth, i + across, j + down)[0]
        nearer = z < nearest
        nearest = dr.select(nearer, z, nearest)
        column, row = dr.select(nearer, i + across, column), dr.select(nearer, j + down, row)
    planes = (nearest, *fetch(motion, column, row))
    dr.eval(planes)
    return Image(planes, depth.width, depth.height)


def hidden(
    surface: Image,
    previous: Image,
    jitter: Jitter,
    previous_jitter: Jitter,
    coefficients: tuple[float, ...],
    settings: UpscaleSettings,
) -> Image:
    """[1] share in [0, 1] of a pixel's history that shows something in front of it, or that lies outside the previous frame.

    surface, previous: depth and motion [3] of the present and the previous frame, of one size and dilation, motion in pixels.
    A surface is expected at `coefficients` (`previous_depth_coefficients`) applied to its depth, which holds for what stands
    still; objects change their depth little from frame to frame. What is in front only hides if it moves otherwise: thin
    things that one frame's samples hit and the next one's miss do not.
    """
    width, height = surface.width, surface.height
    x, y = pixel_centres(width, height)
    x, y = x - opaque(jitter[0]), y - opaque(jitter[1])
    z, *motion = surface.planes
    across, down = x * opaque(1 / width), y * opaque(1 / height)
    a, b, c, d, e, f = (opaque(value) for value in coefficients)
    expected = z * (a * across + b * down + c) + d * across + e * down + f
    expected = dr.select(z >= FAR, FAR, expected)
    tolerance = opaque(settings.slope) * _slope(surface, settings)
    relative = opaque(settings.separation * math.hypot(width, height))
    parting = opaque(1 / settings.least_parting)

    x, y = x + motion[0], y + motion[1]
    outside = (x < 0) | (y < 0) | (x > opaque(width)) | (y > opaque(height))
    x, y = x + opaque(previous_jitter[0]) - 0.5, y + opaque(previous_jitter[1]) - 0.5
    left, top = dr.floor(x), dr.floor(y)
    right_share, lower_share = x - left, y - top
    share = jit.Float(0)
    for row in (0, 1):
        for column in (0, 1):
            weight = (right_share if column else 1 - right_share) * (lower_share if row else 1 - lower_share)
            there, *moved = fetch(previous, jit.Int32(left) + column, jit.Int32(top) + row)
            needed = dr.fma(relative, dr.maximum(expected, there), tolerance)
            in_front = dr.clip((expected - there) / needed - 1, 0, 1)
            apart = dr.sqrt(dr.square(moved[0] - motion[0]) + dr.square(moved[1] - motion[1]))
            share += weight * in_front * dr.minimum(apart * parting, 1)
    share = dr.select(outside, 1, dr.minimum(share, 1))
    dr.eval(share)
    return Image((share,), width, height)


def pixel_indices(width: int, height: int) -> tuple:
    """Column and row of every pixel, Int32, row-major."""
    x, y = pixel_centres(width, height)
    return jit.Int32(x), jit.Int32(y)


def border(image: Image, i, j, column: int) -> tuple:
    """Whether pixels are the first and the last of their row (column 1) or column (0): they have one neighbour there."""
    place, last = (i, image.width - 1) if column else (j, image.height - 1)
    return place == 0, place == dr.opaque(jit.Int32, last)


def _slope(depth: Image, settings: UpscaleSettings):
    """The depth's change to the neighbour where it changes less, left or right plus above or below."""
    i, j = pixel_indices(depth.width, depth.height)
    z = depth.planes[0]

    def change(column: int, row: int):
        after, before = (dr.abs(fetch(depth, i + s * column, j + s * row)[0] - z) for s in (1, -1))
        first, last = border(depth, i, j, column)
        return dr.select(first, after, dr.select(last, before, dr.minimum(after, before)))

    return dr.minimum(change(1, 0) + change(0, 1), opaque(settings.most_slope) * z)
