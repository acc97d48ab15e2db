"""The lie of the land: its height, the path's course, and how much mist lies before a place far away. Metres."""

import numpy as np

from .sky import TO_SUN

PATH_HALF_WIDTH = 1.05
END = 74.0  # half the edge of the ground
GLADE = np.array([-4.6, -2.5]), 6.2  # middle (x, z) and radius: open ground towards the sun
SUNWARDS = TO_SUN * [1, 0, 1] / np.hypot(TO_SUN[0], TO_SUN[2])


def path_x(z):
    """Where the path is at z."""
    z = np.asarray(z, float)
    return 1.7 * np.sin(0.16 * z + 0.5) - 0.55 * np.sin(0.33 * z) + 0.012 * (z - 4) ** 2 * (z < 4) * 0.55


def off_path(x, z):
    """Distance to the path's middle line, about."""
    slope = (path_x(np.asarray(z) + 0.05) - path_x(np.asarray(z) - 0.05)) / 0.1
    return np.abs(np.asarray(x) - path_x(z)) / np.hypot(1, slope)


def height(x, z):
    """Gentle waves, a hollow way along the path, and banks that rise around the wood."""
    x, z = np.asarray(x, float), np.asarray(z, float)
    waves = 0.22 * np.sin(0.21 * x + 0.6) * np.cos(0.17 * z - 0.4) + 0.10 * np.sin(0.47 * x - 0.31 * z + 1.1)
    waves = waves + 0.035 * np.sin(1.15 * x + 0.4) * np.sin(0.95 * z + 1.3)
    hollow = -0.16 * np.exp(-((off_path(x, z) / 1.5) ** 2))
    banks = 0.035 * np.maximum(np.hypot(x, z) - 17, 0) ** 1.35
    return waves + hollow + banks


def mist(points: np.ndarray) -> np.ndarray:
    """Radiance [n, 3] of the mist before points [n, 3], seen from the middle: from 16 m on, warm towards the sun."""
    flat = points * [1, 0, 1]
    distance = np.linalg.norm(flat, axis=-1)
    towards = flat @ SUNWARDS / np.maximum(distance, 1e-9)
    warm = np.clip(0.5 + 0.5 * towards, 0, 1)[:, None] ** 1.5
    amount = 1 - np.exp(-np.maximum(distance - 17, 0) / 26)
    cool, gold = np.array([0.36, 0.43, 0.45]), np.array([1.25, 0.98, 0.57])
    return amount[:, None] * (cool * (1 - warm) + gold * warm)
