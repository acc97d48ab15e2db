"""Mitsuba's sensors as cameras. Its camera looks along +z with x to the left and y up; ours along -z with x to the right."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..transforms import Matrix, rigid
from .description import CameraView, SceneCamera
from .mitsuba_dictionary import children, matrix, number

FILM = (768, 576)  # Mitsuba's default, pixels
FULL_FRAME = math.hypot(36, 24)  # diagonal in mm, which `focal_length` refers to
AXES = ("x", "y", "smaller", "larger", "diagonal")


def camera_of(values: Mapping[str, Any], name: str) -> tuple[SceneCamera | None, tuple[str, ...]]:
    """A camera (None for sensors that are none) and what is not drawn of it. Raises InputError."""
    kind = values["type"]
    if kind not in ("perspective", "thinlens", "orthographic"):
        return None, (f"sensor {kind} {name}",)
    world = matrix(values)
    lengths = np.linalg.norm(world[:3, :3], axis=0)
    if not (lengths > 0).all():
        raise InputError("to_world is singular")
    width, height = film_size(values)
    near, far = number(values, "near_clip", 1e-2), number(values, "far_clip", 1e4)
    if not 0 < near < far:
        raise InputError(f"near_clip {near:g} and far_clip {far:g}, 0 < near_clip < far_clip is expected")
    offset = [number(values, f"principal_point_offset_{axis}", 0.0) for axis in "xy"]
    lens: dict[str, Any] = {"near": near, "far": far, "shift": (-offset[0], -offset[1])}
    if kind == "orthographic":
        lens["height"] = float(2 * lengths[0] * height / width)  # the image is 2 units wide before to_world
    else:
        lens["fov_y"] = fov_y(values, width / height)
    view = CameraView(world_from_camera=_camera_axes(world, lengths), **lens)
    said = (f"aperture of {name}: it is drawn as a pinhole",) if kind == "thinlens" else ()
    return SceneCamera(name=name, at=lambda time_s: view), said


def up_axis(world_from_camera: Matrix) -> str:
    """'X', 'Y' or 'Z': the axis nearest to the camera's up; Y where it is not clear (looking up or down)."""
    up = np.abs(world_from_camera[:3, 1])
    return "XYZ"[int(np.argmax(up))] if up.max() > math.sqrt(0.5) else "Y"


def film_size(values: Mapping[str, Any]) -> tuple[int, int]:
    """Width and height of the sensor's film."""
    sizes = [FILM]
    for _, inner in children(values, "renderer"):
        if inner["type"] in ("hdrfilm", "specfilm"):
            sizes.append(tuple(inner.get(key, default) for key, default in zip(("width", "height"), FILM, strict=True)))
    width, height = sizes[-1]
    if not all(isinstance(size, int) and not isinstance(size, bool) and 0 < size < 2**20 for size in (width, height)):
        raise InputError(f"a film of {str(width)[:20]} x {str(height)[:20]} pixels")
    return width, height


def fov_y(values: Mapping[str, Any], aspect: float) -> float:
    """Vertical field of view in radians, from `fov` along `fov_axis` or from `focal_length`; aspect = width / height."""
    if "fov" in values and "focal_length" in values:
        raise InputError("fov and focal_length, which say the same: one is expected")
    if "focal_length" in values:
        length = _millimetres(values["focal_length"])
        fov, axis = 2 * math.atan(FULL_FRAME / (2 * length)), "diagonal"
    else:
        degrees = number(values, "fov", math.nan if "fov" in values else 50.0)
        if not 0 < degrees < 180:
            raise InputError(f"fov is {degrees:g}, above 0 and below 180 is expected")
        fov, axis = math.radians(degrees), values.get("fov_axis", "x")
    if axis not in AXES:
        raise InputError(f"fov_axis is {str(axis)[:80]!r}, one of {', '.join(AXES)} is expected")
    half = math.tan(fov / 2)
    if axis == "diagonal":
        return 2 * math.atan(half / math.hypot(aspect, 1))
    is_x = axis == "x" or (axis == "smaller" and aspect <= 1) or (axis == "larger" and aspect > 1)
    return 2 * math.atan(half / aspect if is_x else half)


def _millimetres(value: Any) -> float:
    text = str(value).strip().removesuffix("mm").strip()
    try:
        length = float(text)
    except ValueError:
        length = math.nan
    if not 0 < length < math.inf:
        raise InputError(f"focal_length is {str(value)[:80]!r}, as in '50mm' is expected")
    return length


def _camera_axes(world: Matrix, lengths: np.ndarray) -> Matrix:
    """Rigid world_from_camera of a `to_world`, whose scale and mirroring go."""
    forward = world[:3, 2] / lengths[2]
    up = world[:3, 1] / lengths[1]
    right = np.cross(forward, up)
    length = np.linalg.norm(right)
    if not length > 1e-6:
        raise InputError("to_world is singular")
    right = right / length
    return rigid(np.stack([right, np.cross(right, forward), -forward], axis=1), world[:3, 3])
