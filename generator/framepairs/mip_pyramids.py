"""Mip pyramids of textures, built once in NumPy: linear light, any size, and a filter that suits what the texels mean.

- color: every level is the box-filtered level above it.
- normal: RGB are directions. Coarser levels store the renormalised mean, and in A the slope variance that its length tells
  (Toksvig 2005, "Mipmapping Normal Maps"); level 0 has A = 0.
- mask: alpha of coarser levels is scaled so that the share of a level that passes the alpha test, drawn bilinearly, stays that
  of level 0 (after Castano 2010, "Computing Alpha Mipmaps", who counts texels). RGB are means over the texels that pass, so
  that hidden ones do not bleed into them.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .scene.description import Texture
from .scene.images import linear_texels

TILE = 4  # texels; a tile is two cache lines
LARGEST_HALF = 65504.0
LEAST_LENGTH = 1e-4  # of a mean normal: its variance, 1e4, is a half
CLEAR = 2.0**-10  # of a value: more than rounding to half moves it
MOST_GAIN = 1e3  # of a level's alpha
ROUNDING = 1e-6  # of a mean of unit vectors, in float32


@dataclass(frozen=True)
class Role:
    """What texels mean. threshold: the least alpha of level 0 that passes the alpha test, for masks."""

    kind: Literal["color", "normal", "mask"] = "color"
    threshold: float = 0.0


COLOR, NORMAL = Role("color"), Role("normal")


def mip_pyramid(texture: Texture, role: Role = COLOR) -> list[NDArray[np.float32]]:
    """Levels [h, w, 4] linear, from the full image down to 1 x 1; level k is max(1, size >> k) texels wide and high.

    Values are finite, at most 65504 in magnitude.
    """
    texels = np.clip(np.nan_to_num(linear_texels(texture), nan=0.0), -LARGEST_HALF, LARGEST_HALF)
    if role.kind == "normal":
        return _normal_pyramid(texels[..., :3])
    if role.kind == "mask":
        return _mask_pyramid(texels, role.threshold)
    return _box_pyramid(texels)


def coverage(alpha: NDArray, threshold: float) -> float:
    """The share of a level [h, w] that has alpha >= threshold when it is drawn bilinearly and repeats."""
    return float((_drawn(alpha) >= np.float32(threshold)).mean())


def tiled_halves(level: NDArray[np.float32]) -> NDArray[np.uint64]:
    """A level as words of four halves, R lowest, in tiles of 4 x 4 texels in rows, the last ones filled up with zeros.

    Neighbours in u and in v are near each other in memory: a frame's look-ups miss fewer cache lines and pages.
    """
    height, width = level.shape[:2]
    padded = np.zeros((-(-height // TILE) * TILE, -(-width // TILE) * TILE, 4), np.float16)
    padded[:height, :width] = level
    words = padded.view(np.uint64).reshape(len(padded) // TILE, TILE, -1, TILE)
    return words.swapaxes(1, 2).ravel()


def _normal_pyramid(vectors: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    units = np.where(length > 0, vectors / np.maximum(length, 1e-30), np.float32((0, 0, 1)))
    first, *coarser = _box_pyramid(units)
    return [np.concatenate([first, np.zeros_like(first[..., :1])], axis=-1)] + [_shortened(mean) for mean in coarser]


def _shortened(mean: NDArray[np.float32]) -> NDArray[np.float32]:
    """[h, w, 4]: the direction of a mean of unit vectors, and the slope variance (1 - length) / length that it lost."""
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    direction = np.where(length > ROUNDING, mean / np.maximum(length, ROUNDING), np.float32((0, 0, 1)))
    lost = np.where(1 - length > ROUNDING, 1 - length, 0)
    return np.concatenate([direction, lost / np.maximum(length, LEAST_LENGTH)], axis=-1).astype(np.float32)


def _mask_pyramid(texels: NDArray[np.float32], threshold: float) -> list[NDArray[np.float32]]:
    alpha = texels[..., 3]
    plain = _box_pyramid(texels)
    share = coverage(alpha, threshold)
    first = np.concatenate([texels[..., :3], _unrounded(alpha, threshold)[..., None]], axis=-1)
    if not 0 < share < 1:
        return [first, *plain[1:]] if share == 0 else [
            np.concatenate([level[..., :3], _unrounded(level[..., 3], threshold)[..., None]], axis=-1) for level in plain
        ]
    seen = (alpha >= np.float32(threshold)).astype(np.float32)[..., None]
    weighted = _box_pyramid(np.concatenate([texels[..., :3] * seen, seen], axis=-1))
    colours = _means_without_holes(weighted)
    levels = [first]
    for colour, level in zip(colours[1:], plain[1:], strict=True):
        scale = min(threshold / _cut(_drawn(level[..., 3]), share), MOST_GAIN)
        levels.append(np.concatenate([colour, scale * level[..., 3:]], axis=-1).astype(np.float32))
    return levels


def _means_without_holes(weighted: list[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
    """RGB over their weight; a texel of no weight takes the colour of the coarser texel over it."""
    colours: list[NDArray[np.float32]] = []
    for level in reversed(weighted):
        rgb, weight = level[..., :3], level[..., 3:]
        mean = rgb / np.where(weight > 0, weight, 1)
        if colours:
            coarser = colours[0]
            parents = (np.minimum(np.arange(level.shape[k]) // 2, coarser.shape[k] - 1) for k in (0, 1))
            mean = np.where(weight > 0, mean, coarser[np.ix_(*parents)])
        colours.insert(0, mean)
    return colours


def _drawn(alpha: NDArray) -> NDArray[np.float32]:
    """Bilinear values at even places within every texel [places, h, w]; fewer places in large images."""
    count = 4 if alpha.size <= 2**20 else 2
    steps = (np.arange(count) + 0.5) / count - 0.5
    right, below = np.roll(alpha, -1, 1), np.roll(alpha, -1, 0)
    corner = np.roll(below, -1, 1)
    # between the centres of four texels: all places of a repeating image, each once
    shares = [(x + 0.5, y + 0.5) for x in steps for y in steps]
    return np.stack(
        [(1 - y) * ((1 - x) * alpha + x * right) + y * ((1 - x) * below + x * corner) for x, y in shares], dtype=np.float32
    )


def _cut(values: NDArray[np.float32], share: float) -> float:
    """A value that as near as possible to `share` of all values reach; clear of equal values, which cannot be parted."""
    place = min(max(round((1 - share) * values.size), 0), values.size - 1)
    value = max(float(np.partition(values, place, axis=None)[place]), 1e-6)
    cuts = value * (1 - CLEAR), value * (1 + CLEAR)
    return min(cuts, key=lambda cut: abs(float((values >= np.float32(cut)).mean()) - share))


def _unrounded(alpha: NDArray[np.float32], threshold: float) -> NDArray[np.float32]:
    """Alpha that rounding to half takes over the threshold in neither direction."""
    if abs(threshold) >= LARGEST_HALF:
        return alpha
    passing = np.float16(threshold)
    if float(passing) < np.float32(threshold):
        passing = np.nextafter(passing, np.float16(np.inf))
    failing = np.nextafter(passing, np.float16(-np.inf))
    passes = alpha >= np.float32(threshold)
    return np.where(passes, np.maximum(alpha, np.float32(passing)), np.minimum(alpha, np.float32(failing)))


def _box_pyramid(texels: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    levels = [texels]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(_halved(levels[-1], 0), 1))
    return levels


def _halved(texels: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
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
