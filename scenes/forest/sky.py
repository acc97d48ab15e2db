"""The sky over the forest: a low sun in the mist, as a latitude-longitude image without the sun itself."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, sky_directions, smooth

TO_SUN = np.array([-0.80, 0.54, -0.36]) / np.linalg.norm([-0.80, 0.54, -0.36])


def write_sky(folder: Path) -> None:
    """512 x 256, half: pale blue zenith, warm mist around the sun, cool mist opposite, tree tops, a dark wood below."""
    height, width = 256, 512
    direction = sky_directions(height, width)
    up, towards = direction[..., 1], np.clip(direction @ TO_SUN, -1, 1)
    warm = smooth(-0.5, 1.0, towards)
    mist = mix((0.50, 0.58, 0.66), (1.25, 0.98, 0.62), warm)
    colour = mix((0.26, 0.42, 0.72), mist, np.exp(-np.maximum(up, 0) * 2.6))
    cover = smooth(0.2, 1.7, noise(height, width, 1.6, 50, stretch=0.5)) * smooth(0.15, 0.4, up) * smooth(0.98, 0.7, up)
    colour = mix(colour, mix((0.75, 0.76, 0.8), (1.5, 1.25, 0.95), warm), 0.6 * cover)
    angle = np.arccos(towards)
    colour += (2.2 * np.exp(-angle * 6) + 0.5 * np.exp(-angle * 2))[..., None] * np.array([1.0, 0.78, 0.46])
    tops = 0.3 + 0.035 * noise(height, width, 1.2, 51, low=4)[height // 2] + 0.02 * noise(height, width, 0.5, 52, low=20)[0]
    wood = mix((0.085, 0.105, 0.075), (0.30, 0.25, 0.13), smooth(0.1, 0.95, towards))
    wood = wood * (0.7 + 0.6 * smooth(0.0, 0.3, up))[..., None]
    colour = mix(wood, colour, smooth(-0.06, 0.06, up - tops))
    floor = np.array([0.075, 0.062, 0.036]) * (0.8 + 0.4 * smooth(0.5, -1, up))[..., None]
    save_radiance(folder, "sky", mix(floor, colour, smooth(-0.1, 0.03, up)))
