"""The sky over the ruins: the last hour of sun, as a latitude-longitude image without the sun itself."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, sky_directions, smooth

TO_SUN = np.array([-0.60, 0.37, -0.71]) / np.linalg.norm([-0.60, 0.37, -0.71])


def write_sky(folder: Path) -> None:
    """640 x 320, half: slate-blue zenith, amber horizon towards the sun, lit clouds, dark ground."""
    height, width = 320, 640
    direction = sky_directions(height, width)
    up, towards = direction[..., 1], np.clip(direction @ TO_SUN, -1, 1)
    level = TO_SUN * [1, 0, 1] / np.hypot(TO_SUN[0], TO_SUN[2])
    side = 0.5 + 0.5 * (direction @ level)  # 1 on the sun's side
    angle = np.arccos(towards)
    horizon = mix((0.31, 0.28, 0.34), (1.0, 0.55, 0.27), side**1.6)
    colour = mix(mix((0.10, 0.16, 0.33), (0.13, 0.22, 0.42), side), horizon, np.exp(-np.maximum(up, 0) * 4.2))
    colour = colour + (1.0 * np.exp(-angle * 6) + 0.25 * np.exp(-angle * 2))[..., None] * np.array([1.0, 0.68, 0.36])
    stretched = noise(height, width, 1.6, 300, stretch=0.3, low=2) + 0.28 * noise(height, width, 1.0, 301, stretch=0.4, low=8)
    cover = smooth(0.15, 1.7, stretched) * smooth(0.03, 0.16, up) * smooth(0.98, 0.7, up)
    lit = mix((0.24, 0.23, 0.29), (1.02, 0.62, 0.38), smooth(-0.35, 1.0, towards) ** 1.5)
    colour = mix(colour, lit, 0.85 * cover)
    ground = np.array([0.10, 0.085, 0.062]) * (0.7 + 0.6 * side)[..., None]
    save_radiance(folder, "sky", mix(ground, colour, smooth(-0.012, 0.004, up)))
