"""The library's images of light: dusk outside the windows, a lampshade's glow, embers, and the room as a probe sees it."""

from pathlib import Path

import numpy as np
from scenes.making.images import mix, noise, save_radiance, smooth

ROOM = np.array([(-5.0, 0.0, -7.0), (5.0, 4.3, 7.5)])  # least and greatest corner
WINDOWS = (-4.3, -0.7, 2.9)  # their middles along z, in the wall x = -5
WIDE, SILL, HIGH = 1.6, 0.5, 3.05  # of a window
PROBE = np.array([0.0, 1.5, 0.5])


def dusk(folder: Path) -> None:
    """A town park after sunset, 1024 x 256: afterglow, clouds, roofs with lit windows, bare trees."""
    height, width = 256, 1024
    v, u = 1 - (np.mgrid[0:height, 0:width][0] + 0.5) / height, (np.mgrid[0:height, 0:width][1] + 0.5) / width
    glow = np.exp(-(((v - 0.3) / 0.16) ** 2)) * (0.55 + 0.45 * np.exp(-(((u - 0.4) / 0.3) ** 2)))
    colour = mix((0.16, 0.28, 0.6), (0.035, 0.07, 0.22), smooth(0.25, 1.0, v)) + glow[..., None] * np.array([0.8, 0.36, 0.18])
    cloud = smooth(0.2, 1.6, noise(height, width, 1.6, 100, stretch=0.35)) * smooth(0.3, 0.5, v)
    colour = mix(colour, mix((0.5, 0.25, 0.22), (0.06, 0.08, 0.18), smooth(0.3, 0.75, v)), 0.7 * cloud)
    rng = np.random.default_rng(101)
    for depth in range(3):
        shade = np.array([0.045, 0.06, 0.12]) * (1 - 0.3 * depth)
        x = 0.0
        while x < 1:
            w, h = rng.uniform(0.011, 0.028), 0.41 - 0.03 * depth + rng.uniform(-0.035, 0.045)
            inside = (u >= x) & (u < x + w)
            gable = 2.2 * np.minimum(u - x, x + w - u) * rng.integers(2)
            body = inside & (v < h + gable)
            colour = np.where(body[..., None], shade, colour)
            columns, rows = np.floor((u - x) / 0.0036), np.floor((h - v) / 0.0145)
            lit = rng.uniform(0, 1, (24, 12)) > 0.72
            pane = ((u - x) % 0.0036 > 0.0017) & ((h - v) % 0.0145 > 0.0065) & inside & (v < h - 0.01) & (u - x < w - 0.002)
            on = pane & lit[np.clip(columns, 0, 23).astype(int), np.clip(rows, 0, 11).astype(int)]
            colour = np.where(on[..., None], np.array([1.5, 0.85, 0.32]) * rng.uniform(0.5, 1.2), colour)
            x += w + rng.uniform(-0.003, 0.006)
    crown = 0.2 + 0.07 * noise(4, width, 1.2, 102, low=4)[0][None, :] + 0.016 * noise(height, width, 0.9, 103, low=30)
    colour = mix(colour, (0.012, 0.02, 0.03), smooth(0.012, -0.012, v - crown))
    for x in np.arange(0.03, 1, 0.045):
        lamp = np.hypot((u - x) * 3.2, v - 0.2)
        colour = colour + (np.exp(-((lamp / 0.006) ** 2)) * 5 + np.exp(-lamp / 0.03) * 0.25)[..., None] * np.array(
            [1.0, 0.72, 0.36]
        )
    save_radiance(folder, "dusk", colour)


def glows(folder: Path) -> None:
    """A lampshade lit from inside, brightest around the bulb (v runs up); embers and flames."""
    v = 1 - (np.arange(64) + 0.5) / 64
    level = 0.3 + 1.0 * np.exp(-(((v - 0.42) / 0.3) ** 2))
    save_radiance(folder, "shade_glow", np.tile((level[:, None] * np.array([1.35, 0.74, 0.3]))[:, None], (1, 4, 1)))
    level = 0.45 + 0.75 * np.exp(-(((v - 0.45) / 0.28) ** 2))
    save_radiance(folder, "opal_glow", np.tile((level[:, None] * np.array([1.9, 1.35, 0.82]))[:, None], (1, 4, 1)))
    heat = smooth(-0.3, 1.8, noise(64, 128, 1.3, 110, low=3))
    save_radiance(folder, "embers", np.clip(heat[..., None] * np.array([5.0, 1.1, 0.12]), 0, 8))
    rise = 1 - (np.arange(64) + 0.5)[:, None] / 64 + 0 * np.arange(4)
    save_radiance(folder, "flame_glow", mix((4.2, 1.75, 0.28), (1.5, 0.22, 0.012), smooth(0.1, 0.9, rise)))


def probe(folder: Path) -> None:
    """What surrounds the middle of the room, 256 x 128: it is the ambient light, and what smooth surfaces reflect."""
    height, width = 128, 256
    polar = (np.arange(height) + 0.5)[:, None] / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5)[None, :] / width) * 2 * np.pi
    d = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.cos(azimuth)], axis=-1)
    far = np.where(d > 0, ROOM[1] - PROBE, ROOM[0] - PROBE) / np.where(np.abs(d) < 1e-9, 1e-9, d)
    side, t = far.argmin(axis=-1), far.min(axis=-1)
    place = PROBE + d * t[..., None]
    x, y, z = place[..., 0], place[..., 1], place[..., 2]
    ceiling, floor = (side == 1) & (d[..., 1] > 0), (side == 1) & (d[..., 1] < 0)
    left, right, back = (side == 0) & (d[..., 0] < 0), (side == 0) & (d[..., 0] > 0), (side == 2) & (d[..., 2] < 0)
    pools = sum(np.exp(-((x - a) ** 2 + (z - b) ** 2) / 1.2) for a in (-1.7, 1.7) for b in (-4.4, -1.2, 2.4))
    wash = 0.5 + 0.5 * np.cos(2 * np.pi * (z - 0.6) / 2.4)
    colour = np.tile(np.array([0.11, 0.082, 0.05]), (height, width, 1))
    colour[floor] = (np.array([0.045, 0.03, 0.02]) * (0.7 + 0.9 * pools)[..., None])[floor]
    colour[ceiling] = (np.array([0.27, 0.205, 0.13]) * (0.75 + 0.35 * pools)[..., None])[ceiling]
    colour[right] = (np.array([0.16, 0.1, 0.05]) * (0.35 + smooth(0.2, 3.2, y) * (0.7 + 0.5 * wash))[..., None])[right]
    colour[back] = (np.array([0.18, 0.11, 0.055]) * (0.5 + 0.5 * smooth(0.3, 3, y))[..., None])[back]
    fire = np.exp(-((x / 0.6) ** 2) - ((y - 0.45) / 0.4) ** 2)
    colour[back] += (fire[..., None] * np.array([2.2, 0.8, 0.18]))[back]
    colour[left] = (np.array([0.085, 0.08, 0.062]) * (0.6 + 0.4 * smooth(0.5, 3.5, y))[..., None])[left]
    for middle in WINDOWS:
        pane = (
            smooth(0.1, -0.1, np.abs(z - middle) - WIDE / 2)
            * smooth(-0.05, 0.1, y - SILL)
            * smooth(0.05, -0.1, y - SILL - HIGH)
        )
        outside = mix((0.6, 0.46, 0.62), (0.16, 0.28, 0.7), smooth(0.8, 3.2, y))
        colour = np.where(left[..., None], mix(colour, outside, pane), colour)
    save_radiance(folder, "probe", 1.75 * colour * (1 + 0.05 * noise(height, width, 1.0, 120))[..., None])


def write_all(folder: Path) -> None:
    for part in (dusk, glows, probe):
        part(folder)
