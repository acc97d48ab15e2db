"""What a camera has beside its place and direction: [6] field of view and roll in radians, height, lens shift, exposure."""

import math

import numpy as np

from ..camera_path import CameraPath
from .splines import Array

FOV, HEIGHT, SHIFT_X, SHIFT_Y, EXPOSURE, ROLL = range(6)


def lens_of(path: CameraPath, keys=None, before: Array | None = None) -> Array:
    """[6] of a keyframe, pose or move; what it leaves out is that of `before`, else the path's. Without keys: the path's."""
    values = np.empty(6)
    values[FOV] = _fov(path, path) if before is None else before[FOV]
    values[HEIGHT] = (path.height or 0.0) if before is None else before[HEIGHT]
    values[SHIFT_X : SHIFT_Y + 1] = path.lens_shift if before is None else before[SHIFT_X : SHIFT_Y + 1]
    values[EXPOSURE] = path.exposure_ev if before is None else before[EXPOSURE]
    values[ROLL] = 0.0 if before is None else before[ROLL]
    if keys is not None:
        own = (_fov(path, keys), keys.height, keys.exposure_ev)
        for index, value in zip((FOV, HEIGHT, EXPOSURE), own, strict=True):
            values[index] = values[index] if value is None else value
        if keys.lens_shift is not None:
            values[SHIFT_X : SHIFT_Y + 1] = keys.lens_shift
        roll = getattr(keys, "roll_deg", None)
        values[ROLL] = values[ROLL] if roll is None else math.radians(roll)
    return values


def _fov(path: CameraPath, keys) -> float | None:
    if keys.focal_length_mm is not None:
        return 2 * math.atan2(path.sensor_height_mm / 2, keys.focal_length_mm)
    return math.radians(keys.fov_y_deg) if keys.fov_y_deg is not None else None
