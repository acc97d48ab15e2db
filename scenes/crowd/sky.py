"""The sky over the square: a clear morning with thin clouds, as a latitude-longitude image without the sun itself."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, sky_directions, smooth

TO_SUN = np.array([0.82, 0.47, 0.24]) / np.linalg.norm([0.82, 0.47, 0.24])


def write_sky(folder: Path) -> None:
    """512 x 256, half, beside the scene as <scene>.environment.exr: pale blue, haze, wisps of cloud, roofs, grey ground."""
    height, width = 256, 512
    direction = sky_directions(height, width)
    up, towards = direction[..., 1], np.clip(direction @ TO_SUN, -1, 1)
    haze = np.exp(-np.maximum(up, 0) * 5.0)
    colour = mix((0.17, 0.34, 0.72), (0.82, 0.83, 0.84), haze)
    wisp = noise(height, width, 1.5, 60, stretch=0.35) + 0.35 * noise(height, width, 0.9, 61, low=6, stretch=0.5)
    cover = smooth(0.0, 2.0, wisp) * smooth(0.03, 0.16, up)
    colour = mix(colour, mix((0.92, 0.94, 1.0), (1.6, 1.45, 1.25), smooth(0.2, 0.95, towards)), 0.75 * cover)
    angle = np.arccos(towards)
    colour += (1.7 * np.exp(-angle * 6) + 0.3 * np.exp(-angle * 1.8))[..., None] * np.array([1.0, 0.85, 0.62])
    rough = noise(height, width, 0.9, 62, low=3)[height // 2]
    roofs = 0.045 + 0.02 * np.round(rough * 2) / 2
    far = mix(np.array([0.42, 0.45, 0.5]), np.array([0.7, 0.62, 0.52]), smooth(0.2, 0.9, towards))
    colour = mix(far, colour, smooth(-0.008, 0.008, up - roofs[None, :]))
    ground = np.array([0.25, 0.235, 0.21]) * (0.8 + 0.2 * np.maximum(-up, 0))[..., None]
    colour = mix(ground, colour, smooth(-0.03, 0.005, up))
    save_radiance(folder, "crowd.environment", 0.8 * colour)
