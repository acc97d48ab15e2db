"""Texels in one table, and what one look-up of one level reads: four halves each, in tiles, blended bilinearly."""

from dataclasses import dataclass
from typing import Literal

from .backend import dr, mi
from .mip_pyramids import TILE

Kind = Literal["texel", "normal", "alpha"]  # what is looked up
WRAP_CODE = {"repeat": 0, "mirror": 1, "clamp": 2}


@dataclass(frozen=True)
class TextureTable:
    """texels: four halves each, R in the lowest bits, in tiles of 4 x 4. alphas: of the textures that were asked for, in the
    same order, A of a texel and of those right, below and right below it. Per level: offset in texels. Per texture:
    first_level, facts (its size and wrap codes in one word), and what its offsets exceed those into `alphas` by.
    only_repeat: no texture of the table wraps otherwise. anisotropy: the most taps."""

    texels: mi.UInt64
    alphas: mi.UInt64
    offset: mi.UInt32
    first_level: mi.UInt32
    facts: mi.UInt64
    excess: mi.UInt32
    only_repeat: bool
    anisotropy: int


@dataclass(frozen=True)
class Image:
    """A texture per lane: its first level, its size in texels, and its wrap code."""

    first: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32
    wrap: mi.UInt32


@dataclass(frozen=True)
class Level:
    """One level of a texture per lane: where its texels start, its size, and the texels in a row of its tiles."""

    offset: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32
    pitch: mi.UInt32


def image_of(table: TextureTable, texture: mi.UInt32, active: mi.Bool) -> Image:
    facts, largest = dr.gather(mi.UInt64, table.facts, texture, active), mi.UInt64(2**29 - 1)
    width, height, wrap = (mi.UInt32(value) for value in (facts & largest, (facts >> 29) & largest, facts >> 58))
    return Image(dr.gather(mi.UInt32, table.first_level, texture, active), width, height, wrap)


def two_levels(table: TextureTable, image: Image, level: mi.Float, active) -> tuple[Level, Level, mi.Float]:
    """The levels around a real one, clamped to those there are, and the weight of the coarser."""
    last = 31 - mi.UInt32(dr.lzcnt(dr.maximum(dr.maximum(image.width, image.height), 1)))
    level = dr.clip(level, 0, mi.Float(last))
    below = dr.minimum(mi.UInt32(level), last)
    above = dr.minimum(below + 1, last)
    return level_of(table, image, below, active), level_of(table, image, above, active), level - mi.Float(below)


def level_of(table: TextureTable, image: Image, number: mi.UInt32, active: mi.Bool) -> Level:
    offset = dr.gather(mi.UInt32, table.offset, image.first + number, active)
    width, height = dr.maximum(image.width >> number, 1), dr.maximum(image.height >> number, 1)
    return Level(offset, width, height, (width + TILE - 1) // TILE * TILE**2)


def bilinear(
    table: TextureTable, level: Level, wrap: mi.UInt32, uv: mi.Point2f, active: mi.Bool, kind: Kind
) -> mi.Vector4f | mi.Float:
    left, right, fx = _neighbours(uv.x, level.width, wrap & 3, table.only_repeat)
    top, bottom, fy = _neighbours(1 - uv.y, level.height, wrap >> 2, table.only_repeat)
    left, right = (x // TILE * TILE**2 + x % TILE for x in (left, right))
    top, bottom = (level.offset + y // TILE * level.pitch + y % TILE * TILE for y in (top, bottom))
    if kind == "alpha":
        corners = _texel(table.alphas, top + left, active)
    else:
        corners = [_texel(table.texels, row + column, active) for row in (top, bottom) for column in (left, right)]
    above, below = dr.lerp(corners[0], corners[1], fx), dr.lerp(corners[2], corners[3], fx)
    return dr.lerp(above, below, fy)


def _texel(words: mi.UInt64, index: mi.UInt32, active: mi.Bool) -> mi.Vector4f:
    """One gather of 8 bytes: LLVM gathers single halves several times as slowly."""
    bits = dr.gather(mi.UInt64, words, index, active)
    low, high = mi.UInt32(bits), mi.UInt32(bits >> 32)
    return mi.Vector4f(_half(low << 16), _half(low), _half(high << 16), _half(high))


def _half(bits: mi.UInt32) -> mi.Float:
    """The half in the upper 16 bits: its exponent is biased by 15, a float's by 127."""
    moved = mi.UInt32(mi.Int32(bits) >> 3) & 0x8FFFE000
    return dr.reinterpret_array(mi.Float, moved) * 2.0**112


def _neighbours(coordinate: mi.Float, extent: mi.UInt32, wrap: mi.UInt32, only_repeat: bool):
    """The two texel indices around `coordinate` (0 to 1 over `extent` texels), and the weight of the second."""
    repeated = coordinate - dr.floor(coordinate)
    if not only_repeat:
        half = 0.5 * coordinate
        mirrored = 1 - dr.abs(2 * (half - dr.floor(half)) - 1)
        bounded = dr.select(wrap == WRAP_CODE["mirror"], mirrored, dr.clip(coordinate, 0, 1))
        repeated = dr.select(wrap == WRAP_CODE["repeat"], repeated, bounded)
    place = repeated * mi.Float(extent) - 0.5
    floor = dr.floor(place)
    first, count = mi.Int32(floor), mi.Int32(extent)
    second = first + 1
    over, under = mi.Int32(0), count - 1  # what lies beyond an edge: the other side of a repeated texture,
    if not only_repeat:
        over = dr.select(wrap == WRAP_CODE["repeat"], 0, count - 1)  # the edge itself of all others
        under = dr.select(wrap == WRAP_CODE["repeat"], count - 1, 0)
    weight = place - floor
    if not only_repeat:
        weight = dr.select((first < 0) & (wrap != WRAP_CODE["repeat"]), 0, weight)  # both are the edge
    first = dr.select(first < 0, under, dr.minimum(first, count - 1))
    second = dr.select(second >= count, over, second)
    return mi.UInt32(first), mi.UInt32(second), weight


def finite_place(uv: mi.Point2f) -> mi.Point2f:
    return mi.Point2f(*(dr.select(dr.isfinite(c), c, 0) for c in uv))
