"""Materials of glTF stages, and numbers in the forms that glTF stores."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Look:
    """A metallic-roughness material.

    base, emission: linear RGB, or (image, tint); roughness: a number, or (image, factor), of which green is roughness and
    blue metal; normal: an image, or (image, scale); mask: the alpha of the base's image is cut at 0.5. Images are PNG files of
    the folder `textures`, named without suffix. tile: metres per repeat of shapes whose st is in metres. emission is radiance.
    """

    base: tuple
    roughness: float | tuple[str, float] = 0.8
    metallic: float = 0
    normal: str | tuple[str, float] | None = None
    tile: float = 1
    emission: tuple | None = None
    mask: bool = False


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """x, y, z, w [..., 4] of rotations [..., 3, 3]."""
    return Rotation.from_matrix(matrix).as_quat()


def about(axis: str, degrees) -> np.ndarray:
    """Rotations [..., 3, 3] about 'x', 'y' or 'z', counter-clockwise."""
    return Rotation.from_euler(axis, degrees, degrees=True).as_matrix()


def unit_integers(values: np.ndarray, kind: str) -> np.ndarray:
    """Vectors of length 1 as integers of `kind`, to be divided by its greatest."""
    values = values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-12)
    return np.round(values * np.iinfo(kind).max).astype(kind)


def textured(value, width: int) -> tuple[str | None, tuple]:
    """(image or None, factors [width])."""
    image, factor = value if isinstance(value, tuple) and isinstance(value[0], str) else (None, value)
    return image, tuple(factor) if isinstance(factor, tuple | list | np.ndarray) else (factor,) * width


def rounded(values, digits: int) -> list[float]:
    return [round(float(v), digits) for v in values]
