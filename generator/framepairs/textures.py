"""Mip-mapped textures in one table, so that one kernel samples any texture of a scene at any bias.

Texels are linear RGBA in half precision (`mip_pyramids`). A look-up is trilinear, or anisotropic: the pixel's footprint in
texels is an ellipse, its shorter axis decides the level, and taps are spread along its longer axis.

The stream's bias is added to the level and leaves the taps where they are, which is what graphics hardware does (Vulkan 1.3
specification, "Level-of-Detail Operation": the bias is added to the level after the ellipse was divided into taps).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .mip_pyramids import COLOR, ROUNDING, TILE, Role, mip_pyramid, tiled_halves
from .scene.description import Texture

WRAP_CODE = {"repeat": 0, "mirror": 1, "clamp": 2}
FARTHEST = 1e9  # texels per pixel, beyond which derivatives are clamped: their fourth powers are finite
EQUAL_AXES = 1 / 64  # an ellipse is longer than wide only beyond this share: rounding alone makes no taps


@dataclass(frozen=True)
class TextureSettings:
    """How textures are filtered. anisotropy: most taps along the footprint's longer axis; 1 is trilinear.
    normal_variance: what a filtered normal map lost in length becomes roughness. mask_coverage: coarser levels of alpha
    masks keep the share of texels that pass the alpha test."""

    anisotropy: int = 16
    normal_variance: bool = True
    mask_coverage: bool = True


@dataclass(frozen=True)
class TextureTable:
    """texels: four halves each, R in the lowest bits, in tiles of 4 x 4. Per level: offset in texels. Per texture: width,
    height, first_level, levels and wrap (codes of u and v). only_repeat: no texture of the table wraps otherwise.
    anisotropy: the most taps."""

    texels: mi.UInt64
    offset: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32
    first_level: mi.UInt32
    levels: mi.UInt32
    wrap: mi.UInt32
    only_repeat: bool
    anisotropy: int


@dataclass(frozen=True)
class _Image:
    """A texture per lane: its first and last level, its size in texels, and its wrap code."""

    first: mi.UInt32
    last: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32
    wrap: mi.UInt32


@dataclass(frozen=True)
class _Level:
    """One level of a texture per lane: where its texels start, and its size."""

    offset: mi.UInt32
    width: mi.UInt32
    height: mi.UInt32


def build_textures(textures: Sequence[Texture], roles: Sequence[Role] | None = None, anisotropy: int = 1) -> TextureTable:
    """Pyramids of all textures, each in its role (colours without `roles`). Nothing gives a table with one white texel."""
    roles = roles or [COLOR] * len(textures)
    pyramids = [mip_pyramid(*pair) for pair in zip(textures, roles, strict=True)] or [[np.ones((1, 1, 4), np.float32)]]
    tiles = [tiled_halves(level) for pyramid in pyramids for level in pyramid]
    counts = [len(pyramid) for pyramid in pyramids]
    wraps = [WRAP_CODE[t.wrap[0]] | WRAP_CODE[t.wrap[1]] << 2 for t in textures] or [0]
    return TextureTable(
        texels=mi.UInt64(np.concatenate(tiles)),
        offset=_table(np.concatenate([[0], np.cumsum([len(level) for level in tiles])[:-1]])),
        width=_table([pyramid[0].shape[1] for pyramid in pyramids]),
        height=_table([pyramid[0].shape[0] for pyramid in pyramids]),
        first_level=_table(np.concatenate([[0], np.cumsum(counts)[:-1]])),
        levels=_table(counts),
        wrap=_table(wraps),
        only_repeat=not any(wraps),
        anisotropy=anisotropy,
    )


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
    return _filtered(table, texture, uv, duv_dx, duv_dy, bias, active, False)


def sample_normal(
    table: TextureTable,
    texture: mi.UInt32,
    uv: mi.Point2f,
    duv_dx: mi.Vector2f,
    duv_dy: mi.Vector2f,
    bias: mi.Float,
    active: mi.Bool,
) -> mi.Vector4f:
    """As `sample_texture`, for textures in the role of normals: direction [3] (not of unit length), and slope variance.

    The variance is the mean of what the texels lost, plus (1 - length) / length of the mean of the taps' directions. Where
    directions cancel, the direction is (0, 0, 1).
    """
    value = _filtered(table, texture, uv, duv_dx, duv_dy, bias, active, True)
    length = dr.norm(mi.Vector3f(value.x, value.y, value.z))
    lost = dr.select(1 - length > ROUNDING, 1 - length, 0) / dr.maximum(length, ROUNDING)
    return mi.Vector4f(value.x, value.y, dr.select(length > ROUNDING, value.z, 1), value.w + lost)


def sample_level(
    table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, level: mi.Float, active: mi.Bool
) -> mi.Vector4f:
    """RGBA at `uv`, trilinear at a real `level`, clamped to the levels there are."""
    image = _image(table, texture, active)
    fine, coarse, weight = _two_levels(table, image, level, active)
    return _trilinear(table, fine, coarse, weight, image.wrap, _finite_place(uv), active)


def sample_finest(table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, active: mi.Bool) -> mi.Vector4f:
    """RGBA at `uv`, bilinear at level 0."""
    image = _image(table, texture, active)
    return _bilinear(table, _level(table, image, mi.UInt32(0), active), image.wrap, _finite_place(uv), active)


def mip_level(
    table: TextureTable, texture: mi.UInt32, duv_dx: mi.Vector2f, duv_dy: mi.Vector2f, bias: mi.Float, active: mi.Bool
) -> mi.Float:
    """The level that `sample_texture` takes, before it is clamped to the levels there are.

    log2 of the footprint's shorter axis in texels (of the longer over `anisotropy`, where that is more), plus `bias`;
    for `anisotropy` 1, of the longer of the two derivatives.
    """
    image = _image(table, texture, active)
    return _footprint(table, image, duv_dx, duv_dy)[0] + bias


def _filtered(table, texture, uv, duv_dx, duv_dy, bias, active, unit: bool) -> mi.Vector4f:
    image = _image(table, texture, active)
    level, taps, axis = _footprint(table, image, duv_dx, duv_dy)
    (fine, coarse, weight), uv = _two_levels(table, image, level + bias, active), _finite_place(uv)
    if table.anisotropy == 1:
        value = _trilinear(table, fine, coarse, weight, image.wrap, uv, active)
        return _with_unit_normal(value) if unit else value
    return _mean_of_taps(table, fine, coarse, weight, image.wrap, uv, axis, taps, active, unit)


def _footprint(table: TextureTable, image: _Image, duv_dx, duv_dy) -> tuple[mi.Float, mi.Float, mi.Vector2f]:
    """(level without bias, number of taps, uv from one end of what the taps share to the other). The axes are the singular
    values of [d/dx d/dy] in texels: lengths of the pixel's unit circle after the map."""
    size = mi.Vector2f(mi.Float(image.width), mi.Float(image.height))
    dx, dy = _finite_slope(duv_dx * size), _finite_slope(duv_dy * size)
    if table.anisotropy == 1:
        squared = dr.maximum(dr.squared_norm(dx), dr.squared_norm(dy))
        return 0.5 * dr.log2(dr.maximum(squared, 1e-30)), mi.Float(1), mi.Vector2f(0)
    xx, yy = dr.square(dx.x) + dr.square(dy.x), dr.square(dx.y) + dr.square(dy.y)
    xy, half_difference = dx.x * dx.y + dy.x * dy.y, 0.5 * (xx - yy)
    root = dr.sqrt(dr.square(half_difference) + dr.square(xy))
    major = dr.sqrt(dr.maximum(0.5 * (xx + yy) + root, 1e-30))
    minor = dr.minimum(dr.abs(dx.x * dy.y - dx.y * dy.x) / major, major)
    wide, high = mi.Vector2f(half_difference + root, xy), mi.Vector2f(xy, root - half_difference)
    along = dr.select(half_difference > 0, wide, high)  # one vector, by the formula that does not cancel
    along *= major * dr.rsqrt(dr.maximum(dr.squared_norm(along), 1e-30))
    # Where the shorter axis is less than a texel, taps closer than a texel would read the same texels.
    ratio = major / dr.maximum(minor, 1)
    taps = dr.clip(dr.ceil(ratio - EQUAL_AXES), 1, table.anisotropy)
    # The outer taps, each as wide as the shorter axis, end with the longer one: with a ratio near 1 they coincide.
    reach = (1 - 1 / dr.clip(ratio, 1, table.anisotropy)) / dr.select(taps > 1, 1 - 1 / taps, 1)
    along *= reach
    level = dr.log2(dr.maximum(minor, major * (1 / table.anisotropy)))
    return level, taps, mi.Vector2f(along.x / size.x, along.y / size.y)


@dr.syntax
def _mean_of_taps(
    table: TextureTable,
    fine: _Level,
    coarse: _Level,
    weight: mi.Float,
    wrap: mi.UInt32,
    uv: mi.Point2f,
    axis: mi.Vector2f,
    taps: mi.Float,
    active: mi.Bool,
    unit: bool,
) -> mi.Vector4f:
    """The mean of `taps` trilinear look-ups in the middles of equal parts of `axis` around `uv`.

    Equal weights err least: 0.011 on a checkerboard to the horizon; Gaussian ones at least twice that.
    """
    k, total = mi.Float(0), mi.Vector4f(0)
    while dr.hint(active & (k < taps), exclude=[table, fine, coarse, weight, wrap, uv, axis, unit]):
        value = _trilinear(table, fine, coarse, weight, wrap, uv + axis * ((k + 0.5) / taps - 0.5), active)
        total += _with_unit_normal(value) if dr.hint(unit, mode="scalar") else value
        k += 1
    return total / taps


def _trilinear(table: TextureTable, fine: _Level, coarse: _Level, weight, wrap, uv, active) -> mi.Vector4f:
    finer = _bilinear(table, fine, wrap, uv, active)
    return dr.lerp(finer, _bilinear(table, coarse, wrap, uv, active & (weight > 0)), weight)


def _bilinear(table: TextureTable, level: _Level, wrap: mi.UInt32, uv: mi.Point2f, active: mi.Bool) -> mi.Vector4f:
    left, right, fx = _neighbours(uv.x, level.width, wrap & 3, table.only_repeat)
    top, bottom, fy = _neighbours(1 - uv.y, level.height, wrap >> 2, table.only_repeat)
    pitch = (level.width + TILE - 1) // TILE * TILE**2  # texels in a row of tiles
    left, right = (x // TILE * TILE**2 + x % TILE for x in (left, right))
    top, bottom = (level.offset + y // TILE * pitch + y % TILE * TILE for y in (top, bottom))
    above = dr.lerp(_texel(table, top + left, active), _texel(table, top + right, active), fx)
    below = dr.lerp(_texel(table, bottom + left, active), _texel(table, bottom + right, active), fx)
    return dr.lerp(above, below, fy)


def _texel(table: TextureTable, index: mi.UInt32, active: mi.Bool) -> mi.Vector4f:
    """One gather of 8 bytes: LLVM gathers single halves several times as slowly."""
    bits = dr.gather(mi.UInt64, table.texels, index, active)
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
    first = dr.select(first < 0, under, dr.minimum(first, count - 1))
    second = dr.select(second >= count, over, second)
    return mi.UInt32(first), mi.UInt32(second), place - floor


def _image(table: TextureTable, texture: mi.UInt32, active: mi.Bool) -> _Image:
    first, levels, width, height, wrap = (
        dr.gather(mi.UInt32, column, texture, active)
        for column in (table.first_level, table.levels, table.width, table.height, table.wrap)
    )
    return _Image(first, dr.maximum(levels, 1) - 1, width, height, wrap)


def _two_levels(table: TextureTable, image: _Image, level: mi.Float, active) -> tuple[_Level, _Level, mi.Float]:
    """The levels around a real one, clamped to those there are, and the weight of the coarser."""
    level = dr.clip(level, 0, mi.Float(image.last))
    below = dr.minimum(mi.UInt32(level), image.last)
    above = dr.minimum(below + 1, image.last)
    return _level(table, image, below, active), _level(table, image, above, active), level - mi.Float(below)


def _level(table: TextureTable, image: _Image, number: mi.UInt32, active: mi.Bool) -> _Level:
    offset = dr.gather(mi.UInt32, table.offset, image.first + number, active)
    return _Level(offset, dr.maximum(image.width >> number, 1), dr.maximum(image.height >> number, 1))


def _with_unit_normal(value: mi.Vector4f) -> mi.Vector4f:
    scale = dr.rcp(dr.maximum(dr.norm(mi.Vector3f(value.x, value.y, value.z)), 1e-20))
    return mi.Vector4f(value.x * scale, value.y * scale, value.z * scale, value.w)


def _finite_slope(slope: mi.Vector2f) -> mi.Vector2f:
    """Texels per pixel: what is no number counts as very many."""
    return mi.Vector2f(*(dr.select(dr.isfinite(s), dr.clip(s, -FARTHEST, FARTHEST), FARTHEST) for s in slope))


def _finite_place(uv: mi.Point2f) -> mi.Point2f:
    return mi.Point2f(*(dr.select(dr.isfinite(c), c, 0) for c in uv))


def _table(values: Sequence[int] | NDArray) -> mi.UInt32:
    return mi.UInt32(np.asarray(values, dtype=np.uint32))
