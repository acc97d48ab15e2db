"""Which pixel each lane of a kernel renders, and how lanes become images.

A packet of 16 lanes is a tile of 4 x 4 pixels: its rays, texels and branches lie nearer together than those of 16 pixels in
a row. Images whose sides are no multiples of 4 are filled up with copies of the pixels at their edge, which nobody sees.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi

SIDE = 4  # of a tile, in pixels


@dataclass(frozen=True)
class Lanes:
    """Per lane: x, y: column and row of its pixel; index: the pixel's number in rows from the top; inside: whether the lane
    stands for its pixel, and is no copy at an edge. size: (width, height) of the image."""

    x: mi.Float
    y: mi.Float
    index: mi.UInt32
    inside: mi.Bool
    size: tuple[int, int]


def lanes_of(size: tuple[int, int]) -> Lanes:
    """The lanes of an image of `size` pixels, tiles in rows from the top."""
    tiles = tuple(-(-extent // SIDE) for extent in size)
    number, across = dr.arange(mi.UInt32, tiles[0] * tiles[1] * SIDE**2), dr.opaque(mi.UInt32, tiles[0])
    tile, place = number // SIDE**2, number % SIDE**2
    column, row = tile % across * SIDE + place % SIDE, tile // across * SIDE + place // SIDE
    width, height = (dr.opaque(mi.UInt32, extent) for extent in size)
    inside = (column < width) & (row < height)
    column, row = dr.minimum(column, width - 1), dr.minimum(row, height - 1)
    return Lanes(mi.Float(column), mi.Float(row), row * width + column, inside, size)


def image_of(lanes: Lanes, value) -> mi.Float | mi.UInt32:
    """The pixels' values in rows, components together, once the kernel has run: `value` is a number or vector per lane."""
    kind = mi.UInt32 if dr.type_v(value) == dr.VarType.UInt32 else mi.Float
    image = dr.empty(kind, lanes.size[0] * lanes.size[1] * (1 if dr.depth_v(value) == 1 else len(value)))
    dr.scatter(image, value, lanes.index, lanes.inside)
    return image


def pixels_of(lanes: Lanes, rows):
    """Per lane, what `rows`, already evaluated for all pixels in rows, has for its pixel."""
    dr.eval(rows)
    return (
        dr.gather(type(rows), rows, lanes.index) if dr.depth_v(rows) == 1 else type(rows)(*(pixels_of(lanes, c) for c in rows))
    )


def array_of(image: mi.Float | mi.UInt32, size: tuple[int, int]) -> NDArray:
    """[height, width, components], contiguous, in the memory of `image` where the back end shares it."""
    return np.asarray(image.numpy()).reshape(size[1], size[0], -1)
