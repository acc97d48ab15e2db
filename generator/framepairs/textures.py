"""Mip-mapped textures in one table, so that one kernel samples any texture of a scene at any bias.

Texels are linear RGBA in half precision; each level is the box-filtered level above it. The level of a look-up comes from
the derivatives of uv per pixel, plus the stream's bias, and is filtered trilinearly.
"""

from dataclasses import dataclass

import numpy as np

from .backend import dr, mi
from .scene.description import Texture
from .scene.images import linear_texels

WRAP_CODE = {"repeat": 0, "mirror": 1, "clamp": 2}


@dataclass(frozen=True)
class TextureTable:
    """texels: [4 x all texels] half. Per level: offset (in texels), width, height. Per texture: first_level, levels and
    wrap (codes of u and v). only_repeat: no texture of the table wraps otherwise."""

    texels: object
    offset: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32
    first_level: mi.UInt32
    levels: mi.UInt32
    wrap: mi.UInt32
    only_repeat: bool


def build_textures(textures: tuple[Texture, ...]) -> TextureTable:
    """Pyramids of all textures. An empty tuple gives a table with one white texel."""
    pyramids = [mip_pyramid(texture) for texture in textures] or [[np.ones((1, 1, 4), np.float32)]]
    levels = [level for pyramid in pyramids for level in pyramid]
    sizes = [level.shape[0] * level.shape[1] for level in levels]
    counts = [len(pyramid) for pyramid in pyramids]
    wraps = [WRAP_CODE[t.wrap[0]] | WRAP_CODE[t.wrap[1]] << 2 for t in textures] or [0]
    half = dr.float16_array_t(mi.Float)
    return TextureTable(
        texels=half(np.concatenate([level.reshape(-1) for level in levels]).astype(np.float16)),
        offset=_table(np.concatenate([[0], np.cumsum(sizes)[:-1]])),
        width=_table([level.shape[1] for level in levels]),
        height=_table([level.shape[0] for level in levels]),
        first_level=_table(np.concatenate([[0], np.cumsum(counts)[:-1]])),
        levels=_table(counts),
        wrap=_table(wraps),
        only_repeat=not any(wraps),
    )


def mip_pyramid(texture: Texture) -> list[np.ndarray]:
    """Levels [h, w, 4] float32 linear, from the full image down to 1 x 1; sizes are halved and rounded down."""
    levels = [linear_texels(texture)]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(_halved(levels[-1], 0), 1))
    return levels


def _halved(texels: np.ndarray, axis: int) -> np.ndarray:
    """Means over equal parts of an axis, half as many rounded down; an odd axis gives three weights to each part."""
    x = np.moveaxis(texels, axis, 0)
    size = len(x)
    half = size // 2
    if size == 1:
        return texels
    if size % 2 == 0:
        mean = (x[0::2] + x[1::2]) * np.float32(0.5)
    else:
        part = np.arange(half, dtype=np.float32).reshape(-1, *[1] * (x.ndim - 1))
        mean = ((half - part) * x[0:-1:2] + half * x[1::2] + (part + 1) * x[2::2]) / np.float32(size)
    return np.moveaxis(mean, 0, axis)


def sample_texture(
    table: TextureTable,
    texture: mi.UInt32,
    uv: mi.Point2f,
    duv_dx: mi.Vector2f,
    duv_dy: mi.Vector2f,
    bias: mi.Float,
    active: mi.Bool,
) -> mi.Vector4f:
    """RGBA at `uv` (v up), filtered for a pixel whose uv derivatives are `duv_dx`, `duv_dy`, `bias` levels further."""
    first = dr.gather(mi.UInt32, table.first_level, texture, active)
    size = mi.Vector2f(_size(table, first, active))
    squared = dr.maximum(dr.squared_norm(duv_dx * size), dr.squared_norm(duv_dy * size))
    squared = dr.select(dr.isfinite(squared), dr.clip(squared, 1e-30, 1e30), 1e30)
    return sample_level(table, texture, uv, 0.5 * dr.log2(squared) + bias, active)


def sample_level(
    table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, level: mi.Float, active: mi.Bool
) -> mi.Vector4f:
    """RGBA at `uv`, trilinear at a real `level`, clamped to the levels there are."""
    first = dr.gather(mi.UInt32, table.first_level, texture, active)
    last = dr.gather(mi.UInt32, table.levels, texture, active) - 1
    wrap = dr.gather(mi.UInt32, table.wrap, texture, active)
    level = dr.clip(level, 0, mi.Float(last))
    below = dr.minimum(mi.UInt32(level), last)
    fine = _bilinear(table, first + below, uv, wrap, active)
    coarse = _bilinear(table, first + dr.minimum(below + 1, last), uv, wrap, active)
    return dr.lerp(fine, coarse, level - mi.Float(below))


def sample_finest(table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, active: mi.Bool) -> mi.Vector4f:
    """RGBA at `uv`, bilinear at level 0."""
    first = dr.gather(mi.UInt32, table.first_level, texture, active)
    return _bilinear(table, first, uv, dr.gather(mi.UInt32, table.wrap, texture, active), active)


def _bilinear(table: TextureTable, level: mi.UInt32, uv: mi.Point2f, wrap: mi.UInt32, active: mi.Bool) -> mi.Vector4f:
    offset = dr.gather(mi.UInt32, table.offset, level, active)
    size = _size(table, level, active)
    left, right, fx = _neighbours(uv.x, size.x, wrap & 3, table.only_repeat)
    top, bottom, fy = _neighbours(1 - uv.y, size.y, wrap >> 2, table.only_repeat)

    def texel(x, y):
        vector = dr.float16_array_t(mi.Vector4f)
        return mi.Vector4f(dr.gather(vector, table.texels, offset + y * size.x + x, active))

    upper = dr.lerp(texel(left, top), texel(right, top), fx)
    lower = dr.lerp(texel(left, bottom), texel(right, bottom), fx)
    return dr.lerp(upper, lower, fy)


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
    first = dr.select(first < 0, under, dr.minimum(first, count - 1))
    second = dr.select(second >= count, over, second)
    return mi.UInt32(first), mi.UInt32(second), place - floor


def _size(table: TextureTable, level: mi.UInt32, active: mi.Bool) -> mi.Vector2u:
    return mi.Vector2u(
        dr.gather(mi.UInt32, table.width, level, active), dr.gather(mi.UInt32, table.height, level, active)
    )


def _table(values) -> mi.UInt32:
    return mi.UInt32(np.asarray(values, dtype=np.uint32))
