"""The light of a scene that brings none."""

import numpy as np

from .description import Environment, rotation_from_y_up


def default_environment(up_axis: str) -> Environment:
    """The light of a scene that brings none: an overcast studio sky, 0.5 below the horizon to 1.25 above, with a bright
    soft patch 45 degrees up so that shapes read. Radiance; mean about 1."""
    height, width = 64, 128
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    longitude = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    x = np.cos(latitude)[:, None] * np.sin(longitude)
    y = np.sin(latitude)[:, None] * np.ones(width)
    z = np.cos(latitude)[:, None] * np.cos(longitude)
    blend = 1 / (1 + np.exp(-12 * y))
    key = np.array([0.5, 0.707, 0.5]) @ np.stack([x, y, z]).reshape(3, -1)
    patch = 6 * np.exp(12 * (key.reshape(height, width) - 1))
    gray = 0.5 + 0.75 * blend + patch
    tint = np.array([0.98, 1.0, 1.03])
    return Environment(
        name="default",
        texels=(gray[..., None] * tint).astype(np.float32),
        world_from_environment=rotation_from_y_up(up_axis),
    )
