"""The sky over the market: late afternoon, as a latitude-longitude image without the sun itself."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, sky_directions, smooth

TO_SUN = np.array([-0.8, 0.5, 0.33]) / np.linalg.norm([-0.8, 0.5, 0.33])
CLOUDS = 3.2  # side of the periodic field of clouds, in heights of their layer


def sampled(field: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The periodic square `field` at x, y in repeats, bilinear."""
    size = len(field)
    column, row = (x % 1) * size, (y % 1) * size
    j, i = np.floor(column).astype(int), np.floor(row).astype(int)
    s, t = column - j, row - i
    a, b, c, d = (field[(i + k) % size, (j + m) % size] for k, m in ((0, 0), (0, 1), (1, 0), (1, 1)))
    return (a * (1 - s) + b * s) * (1 - t) + (c * (1 - s) + d * s) * t


def clouds(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How much of the sky they cover, and how much of the sun reaches them, of a flat layer that thins out at the horizon."""
    field = noise(512, 512, 1.5, 50, low=2) + 0.1 * noise(512, 512, 1.1, 51, low=24)
    up = np.maximum(direction[..., 1], 0) + 0.16  # the layer bends down with the earth
    x, y = direction[..., 0] / up / CLOUDS, direction[..., 2] / up / CLOUDS
    density = smooth(0.25, 1.7, sampled(field, x, y))
    before = sum(smooth(0.1, 1.7, sampled(field, x + step * TO_SUN[0], y + step * TO_SUN[2])) for step in (0.01, 0.025, 0.05))
    return density, np.exp(-0.75 * before)


def write_sky(folder: Path) -> None:
    """768 x 384, half: blue zenith, warm haze, lit and shaded clouds, a soft glow around the sun, roofs, grey ground."""
    height, width = 384, 768
    direction = sky_directions(height, width)
    up, towards = direction[..., 1], np.clip(direction @ TO_SUN, -1, 1)
    colour = mix((0.13, 0.3, 0.7), (0.86, 0.8, 0.74), np.exp(-np.maximum(up, 0) * 6.0))
    colour = mix(colour, np.array([1.05, 0.78, 0.5]), 0.55 * np.exp(-np.maximum(up, 0) * 9) * smooth(-0.2, 0.9, towards))
    cover, lit = clouds(direction)
    cover *= smooth(0.015, 0.14, up)
    bright = mix((1.5, 1.36, 1.2), (2.2, 1.8, 1.35), smooth(0.1, 0.95, towards))
    colour = mix(colour, mix((0.6, 0.6, 0.66), bright, lit), 0.92 * cover)
    angle = np.arccos(towards)
    colour += (1.7 * np.exp(-angle * 7) + 0.3 * np.exp(-angle * 2))[..., None] * np.array([1.0, 0.8, 0.52])
    roofs = noise(height, width, 1.3, 52, low=3)[height // 2]  # hills afar; houses behind the camera, which metals reflect
    storeys = np.repeat(np.random.default_rng(53).choice([0.08, 0.1, 0.12, 0.14], width // 32), 32)
    houses = np.where(direction[..., 2] > 0.1, storeys, 0)
    low = np.array([0.34, 0.27, 0.2]) * (0.75 - 0.5 * towards[..., None])
    colour = mix(
        mix(low, np.array([0.5, 0.48, 0.5]), 0.35 + 0 * up), colour, smooth(-0.006, 0.006, up - 0.045 - 0.008 * roofs - houses)
    )
    ground = np.array([0.27, 0.225, 0.18]) * (0.75 + 0.25 * np.maximum(-up, 0))[..., None]
    colour = mix(ground, colour, smooth(-0.03, 0.01, up))
    save_radiance(folder, "sky", colour)
