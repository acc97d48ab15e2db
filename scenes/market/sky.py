"""The sky over the market: late afternoon, as a latitude-longitude image without the sun itself."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, smooth

TO_SUN = np.array([-0.8, 0.5, 0.33]) / np.linalg.norm([-0.8, 0.5, 0.33])


def write_sky(folder: Path) -> None:
    """512 x 256, half: blue zenith, warm haze, thin clouds, a soft glow around the sun, a skyline, grey ground."""
    height, width = 256, 512
    polar = (np.arange(height) + 0.5)[:, None] / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5)[None, :] / width) * 2 * np.pi
    direction = np.stack(
        [np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.cos(azimuth)], axis=-1
    )
    up, towards = direction[..., 1], np.clip(direction @ TO_SUN, -1, 1)
    haze = np.exp(-np.maximum(up, 0) * 6.5)
    colour = mix((0.15, 0.32, 0.74), (0.9, 0.84, 0.78), haze)
    cover = smooth(0.1, 1.6, noise(height, width, 1.55, 50, stretch=0.45) + 0.2 * noise(height, width, 0.9, 51, low=6))
    cover *= smooth(0.02, 0.12, up) * smooth(0.97, 0.75, up)
    colour = mix(colour, mix((0.98, 0.97, 1.0), (1.7, 1.45, 1.15), smooth(0.2, 0.95, towards)), 0.8 * cover)
    angle = np.arccos(towards)
    colour += (1.9 * np.exp(-angle * 7) + 0.35 * np.exp(-angle * 2))[..., None] * np.array([1.0, 0.8, 0.52])
    roofs = noise(height, width, 1.3, 52, low=3)[height // 2] * 0.025  # low hills, and houses behind the camera
    skyline = 0.05 + 0.02 * roofs + np.where(direction[..., 2] > 0.1, 0.2 + 2.2 * roofs.round(2), 0)
    colour = mix(
        np.array([0.3, 0.24, 0.18]) * (0.75 - 0.55 * towards[..., None]), colour, smooth(-0.012, 0.012, up - skyline)
    )
    ground = np.array([0.27, 0.225, 0.18]) * (0.75 + 0.25 * np.maximum(-up, 0))[..., None]
    colour = mix(ground, colour, smooth(-0.03, 0.01, up))
    save_radiance(folder, "sky", colour)
