"""Clouds as noise on a layer above the scene, lit from the sun's side, for skies that are made from numbers."""

import numpy as np
from numpy.typing import NDArray

OCTAVES = 6
EDGE = 0.3  # of the noise's standard deviation: half the width of a cloud's rim
FLATTENED = 0.09  # added to the height of a direction: the layer is curved, so it does not run to infinity at the horizon
TILES = 1.6  # features of the first octave in the layer's height
SHADOW_STEPS = (0.08, 0.2, 0.36)  # towards the sun, in features of the first octave
SHADOW = 1.1  # how much darker a standard deviation of cloud before the sun makes
UNLIT = 0.25  # of the sun's light comes through the thickest cloud
LOWEST, FULL = 0.005, 0.16  # heights (sine of the elevation) from which and above which few clouds are drawn
GAP_DEG = 7.0  # around the sun few clouds leave a gap, so that the sun's own light may be what it is without them
GAP_CLOSES = (0.5, 0.75)  # cover between which the gap closes


def smooth(low: float, high: float, x: NDArray) -> NDArray:
    """0 below `low`, 1 above `high`, a cubic between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def cloud_layer(directions: NDArray, to_sun: NDArray, cover: float, seed: int) -> tuple[NDArray, NDArray]:
    """(opacity, light) [...] of the layer in `directions` [..., 3] (unit, y up), both 0 to 1.

    cover: share of the layer that is cloud, 0 to 1; it is met by a quantile of this layer's own noise. light: share of the
    sun's light that arrives, by how much cloud stands towards the sun. Directions below the horizon have opacity 0.
    """
    height = directions[..., 1]
    if cover <= 0:
        return np.zeros_like(height), np.ones_like(height)
    place = TILES * directions[..., [0, 2]] / (np.maximum(height, 0) + FLATTENED)[..., None]
    values = _noise(place, seed)
    above = values[height > LOWEST]
    spread = float(above.std())
    edge = np.quantile(above, 1 - min(cover, 1)) - (2 * EDGE * spread if cover >= 1 else 0)
    opacity = smooth(edge - EDGE * spread, edge + EDGE * spread, values) * smooth(LOWEST, FULL + (0.03 - FULL) * cover, height)
    angle = np.degrees(np.arccos(np.clip(directions @ to_sun, -1, 1)))
    opacity *= 1 - np.exp(-((angle / GAP_DEG) ** 2)) * (1 - smooth(*GAP_CLOSES, np.array(cover)))
    sunwards = to_sun[[0, 2]]
    before = np.mean([_noise(place + step * sunwards, seed) for step in SHADOW_STEPS], axis=0)
    thickness = np.maximum(before - edge, 0) + 0.5 * np.maximum(values - edge, 0)
    return opacity, UNLIT + (1 - UNLIT) * np.exp(-SHADOW * thickness / spread)


def _noise(place: NDArray, seed: int) -> NDArray:
    """[...] at `place` [..., 2]: octaves of value noise, each turned against the last, with a first one that bends the rest."""
    bend = np.stack([_octave(place * 0.7, seed, 90), _octave(place * 0.7, seed, 91)], axis=-1) - 0.5
    place = place + 0.9 * bend
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    total, weight = np.zeros(place.shape[:-1]), 1.0
    for octave in range(OCTAVES):
        total += weight * _octave(place, seed, octave)
        place, weight = 2.03 * place @ turn.T + 17.3, 0.52 * weight
    return total


def _octave(place: NDArray, seed: int, octave: int) -> NDArray:
    """Value noise in [0, 1]: random numbers on a square lattice, a quintic between."""
    cell = np.floor(place)
    t = place - cell
    t = t * t * t * (t * (6 * t - 15) + 10)
    x, y = cell[..., 0].astype(np.int64), cell[..., 1].astype(np.int64)
    low = (1 - t[..., 0]) * _lattice(x, y, seed, octave) + t[..., 0] * _lattice(x + 1, y, seed, octave)
    high = (1 - t[..., 0]) * _lattice(x, y + 1, seed, octave) + t[..., 0] * _lattice(x + 1, y + 1, seed, octave)
    return (1 - t[..., 1]) * low + t[..., 1] * high


def _lattice(x: NDArray, y: NDArray, seed: int, octave: int) -> NDArray:
    """A number in [0, 1) for each lattice point, by mixing its coordinates (the finaliser of MurmurHash3)."""
    salt = (seed * 0x9E3779B1 + octave * 0x85EBCA77) & 0xFFFFFFFF
    mixed = (x * 0x27D4EB2F + y * 0x165667B1 + salt).astype(np.uint64).astype(np.uint32)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        mixed = (mixed ^ (mixed >> np.uint32(shift))) * np.uint32(factor)
    return mixed / 2.0**32
