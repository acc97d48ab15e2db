"""Mip-mapped textures in one table, so that one kernel samples any texture of a scene at any bias.

Texels are linear RGBA in half precision (`mip_pyramids`). A look-up is trilinear, or anisotropic: the pixel's footprint in
texels is an ellipse, its shorter axis decides the level, and taps are spread along its longer axis.

The stream's bias is added to the level and leaves the taps where they are, which is what graphics hardware does (Vulkan 1.3
specification, "Level-of-Detail Operation": the bias is added to the level after the ellipse was divided into taps).
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .mip_pyramids import COLOR, ROUNDING, Role, mip_pyramid, tiled_halves
from .scene.description import Texture
from .texels import WRAP_CODE, Image, Kind, Level, TextureTable, bilinear, finite_place, image_of, level_of, two_levels

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


def build_textures(
    textures: Sequence[Texture],
    roles: Sequence[Role] | None = None,
    anisotropy: int = 1,
    with_alpha: Collection[int] = (),
) -> TextureTable:
    """Pyramids of all textures, each in its role (colours without `roles`). Nothing gives a table with one white texel.
    with_alpha: the textures whose alpha alone `sample_each` may be asked for."""
    roles = roles or [COLOR] * len(textures)
    pyramids = [mip_pyramid(*pair) for pair in zip(textures, roles, strict=True)] or [[np.ones((1, 1, 4), np.float32)]]
    tiles = [[tiled_halves(level) for level in pyramid] for pyramid in pyramids]
    sizes = [[len(level) for level in pyramid] for pyramid in tiles]
    begins, alphas, excess = _begins(map(sum, sizes)), [], np.zeros(len(tiles), np.int64)
    for k in sorted(with_alpha):
        excess[k] = begins[k] - sum(map(len, alphas))
        alphas += [tiled_halves(_alphas(level, textures[k].wrap)) for level in pyramids[k]]
    wraps = [WRAP_CODE[t.wrap[0]] | WRAP_CODE[t.wrap[1]] << 2 for t in textures] or [0]
    shapes = zip((pyramid[0].shape for pyramid in pyramids), wraps, strict=True)
    return TextureTable(
        texels=mi.UInt64(np.concatenate(sum(tiles, []))),
        alphas=mi.UInt64(np.concatenate(alphas or [np.zeros(1, np.uint64)])),
        offset=_table(_begins(sum(sizes, []))),
        first_level=_table(_begins(len(pyramid) for pyramid in pyramids)),
        facts=mi.UInt64(np.array([shape[1] | shape[0] << 29 | wrap << 58 for shape, wrap in shapes], dtype=np.uint64)),
        excess=_table(excess),
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
    return sample_each(table, texture, uv, duv_dx, duv_dy, (bias,), active)[0]


def sample_each(
    table: TextureTable,
    texture: mi.UInt32,
    uv: mi.Point2f,
    duv_dx: mi.Vector2f,
    duv_dy: mi.Vector2f,
    biases: Sequence[mi.Float],
    active: mi.Bool,
    kind: Kind = "texel",
) -> list[mi.Vector4f] | list[mi.Float]:
    """`sample_texture` for each of `biases`, or `sample_normal`, or A alone of textures that the table was built
    `with_alpha` (a quarter of the gathers). Only the levels differ: the footprint and its taps are found once."""
    image = image_of(table, texture, active)
    unbiased, taps, axis = _footprint(table, image, duv_dx, duv_dy)
    levels = [two_levels(table, image, unbiased + bias, active) for bias in biases]
    if kind == "alpha":
        excess = dr.gather(mi.UInt32, table.excess, texture, active)
        levels = [(*(replace(each, offset=each.offset - excess) for each in pair), weight) for *pair, weight in levels]
    uv = finite_place(uv)
    if table.anisotropy == 1:
        values = _look_ups(table, levels, image.wrap, uv, active, kind)
    else:
        values = _means_of_taps(table, levels, image.wrap, uv, axis, taps, active, kind)
    return [_with_lost_length(value) for value in values] if kind == "normal" else values


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
    return sample_each(table, texture, uv, duv_dx, duv_dy, (bias,), active, "normal")[0]


def sample_level(table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, level: mi.Float, active: mi.Bool) -> mi.Vector4f:
    """RGBA at `uv`, trilinear at a real `level`, clamped to the levels there are."""
    image = image_of(table, texture, active)
    uv = finite_place(uv)
    level = level + 0 * uv.x  # as many lanes as places: a branch asks for the level
    return _trilinear(table, *two_levels(table, image, level, active), image.wrap, uv, active, "texel")


def sample_finest(table: TextureTable, texture: mi.UInt32, uv: mi.Point2f, active: mi.Bool) -> mi.Vector4f:
    """RGBA at `uv`, bilinear at level 0."""
    image = image_of(table, texture, active)
    return bilinear(table, level_of(table, image, mi.UInt32(0), active), image.wrap, finite_place(uv), active, "texel")


def mip_level(
    table: TextureTable, texture: mi.UInt32, duv_dx: mi.Vector2f, duv_dy: mi.Vector2f, bias: mi.Float, active: mi.Bool
) -> mi.Float:
    """The level that `sample_texture` takes, before it is clamped to the levels there are.

    log2 of the footprint's shorter axis in texels (of the longer over `anisotropy`, where that is more), plus `bias`;
    for `anisotropy` 1, of the longer of the two derivatives.
    """
    image = image_of(table, texture, active)
    return _footprint(table, image, duv_dx, duv_dy)[0] + bias


def _footprint(table: TextureTable, image: Image, duv_dx, duv_dy) -> tuple[mi.Float, mi.Float, mi.Vector2f]:
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
def _means_of_taps(
    table: TextureTable, levels, wrap: mi.UInt32, uv: mi.Point2f, axis: mi.Vector2f, taps: mi.Float, active: mi.Bool, kind: Kind
) -> list[mi.Vector4f] | list[mi.Float]:
    """For each of `levels` the mean of `taps` look-ups in the middles of equal parts of `axis` around `uv`.

    Equal weights err least: 0.011 on a checkerboard to the horizon; Gaussian ones at least twice that.
    """
    k, totals = mi.Float(0), _zeros(len(levels), kind)
    while dr.hint(active & (k < taps), exclude=[table, levels, wrap, uv, axis, kind]):
        totals = _sums(totals, _look_ups(table, levels, wrap, uv + axis * ((k + 0.5) / taps - 0.5), active, kind))
        k += 1
    return _quotients(totals, taps)


def _look_ups(table: TextureTable, levels, wrap, uv, active, kind: Kind) -> list[mi.Vector4f] | list[mi.Float]:
    values = [_trilinear(table, *levels[0], wrap, uv, active, kind)]
    for level in levels[1:]:
        values.append(_unless_equal(table, values[0], levels[0], level, wrap, uv, active, kind))
    return values


@dr.syntax
def _unless_equal(table: TextureTable, value, known, level, wrap, uv, active, kind: Kind) -> mi.Vector4f | mi.Float:
    """The look-up of `level`; `value` where it is that of `known`: many levels are all clamped to the finest."""
    differs = active & ((level[0].offset != known[0].offset) | (level[2] != known[2]))
    if dr.hint(differs, exclude=[table, known, level, wrap, uv, kind]):
        value = _trilinear(table, *level, wrap, uv, differs, kind)
    return value


@dr.syntax
def _trilinear(table: TextureTable, fine: Level, coarse: Level, weight, wrap, uv, active, kind: Kind) -> mi.Vector4f | mi.Float:
    """Many look-ups lie on level 0, or are magnified: there the coarser level is not read."""
    value, between = bilinear(table, fine, wrap, uv, active, kind), active & (weight > 0)
    if dr.hint(between, exclude=[table, coarse, weight, wrap, uv, kind]):
        value = dr.lerp(value, bilinear(table, coarse, wrap, uv, between, kind), weight)
    return _with_unit_normal(value) if dr.hint(kind == "normal", mode="scalar") else value


def _sums(first: list, second: list) -> list:
    return [a + b for a, b in zip(first, second, strict=True)]


def _quotients(values: list, divisor: mi.Float) -> list:
    return [value / divisor for value in values]


def _zeros(count: int, kind: Kind) -> list[mi.Vector4f] | list[mi.Float]:
    return [mi.Float(0) if kind == "alpha" else mi.Vector4f(0) for _ in range(count)]


def _with_unit_normal(value: mi.Vector4f) -> mi.Vector4f:
    scale = dr.rcp(dr.maximum(dr.norm(mi.Vector3f(value.x, value.y, value.z)), 1e-20))
    return mi.Vector4f(value.x * scale, value.y * scale, value.z * scale, value.w)


def _with_lost_length(value: mi.Vector4f) -> mi.Vector4f:
    length = dr.norm(mi.Vector3f(value.x, value.y, value.z))
    lost = dr.select(1 - length > ROUNDING, 1 - length, 0) / dr.maximum(length, ROUNDING)
    return mi.Vector4f(value.x, value.y, dr.select(length > ROUNDING, value.z, 1), value.w + lost)


def _finite_slope(slope: mi.Vector2f) -> mi.Vector2f:
    """Texels per pixel: what is no number counts as very many."""
    return mi.Vector2f(*(dr.select(dr.isfinite(s), dr.clip(s, -FARTHEST, FARTHEST), FARTHEST) for s in slope))


def _alphas(level: NDArray[np.float32], wrap: tuple[str, str]) -> NDArray[np.float32]:
    """[h, w, 4]: A of each texel of a level, and of what a bilinear look-up takes right, below and right below it."""
    alpha = level[..., 3]
    rows, columns = (
        (np.arange(count) + 1) % count if repeats == "repeat" else np.minimum(np.arange(count) + 1, count - 1)
        for count, repeats in zip(alpha.shape, wrap[::-1], strict=True)
    )
    return np.stack([alpha, alpha[:, columns], alpha[rows], alpha[rows][:, columns]], axis=-1)


def _begins(counts: Iterable[int]) -> NDArray[np.int64]:
    """Where each of consecutive parts with these numbers of elements begins."""
    counts = list(counts)
    return np.cumsum([0, *counts])[: len(counts)]


def _table(values: Sequence[int] | NDArray) -> mi.UInt32:
    return mi.UInt32(np.asarray(values, dtype=np.uint32))
