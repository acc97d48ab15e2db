"""Camera paths: JSON files with keyframes or explicit poses, sampled at frame i = time i / fps.

Time runs in seconds. Keyframes give position and either a target or a quaternion; positions and targets follow a cubic
through the keyframes (Catmull-Rom tangents over their real times), quaternions the shorter arc, the field of view a line.
A keyframe with `hold` keeps the camera still for that long and, unless `animation` says 'runs', stops the scene's time
too. A keyframe (or pose) with `cut` begins a new shot: nothing is interpolated across it.
"""

import json
import math
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .errors import InputError
from .transforms import (
    Matrix,
    Vector,
    look_at,
    quaternion_from_rotation,
    rigid,
    rotation_from_quaternion,
    slerp,
)

MOST_FRAMES = 10**6  # frames have names of six digits

Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Height = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Shift = tuple[Finite, Finite]
FieldOfView = Annotated[float, Field(gt=0, lt=180)]
Row = tuple[Finite, Finite, Finite, Finite]


class Keyframe(BaseModel):
    """One keyframe: exactly one of `look_at` and `quaternion`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time: Finite = Field(description="seconds")
    position: Point = Field(description="world units")
    look_at: Point | None = Field(None, description="point in world units at the image's centre")
    quaternion: Row | None = Field(None, description="world_from_camera rotation as w, x, y, z")
    fov_y_deg: FieldOfView | None = Field(None, description="vertical field of view; null: the path's")
    height: Height | None = Field(None, description="of an orthographic view, scene units; null: the path's")
    lens_shift: Shift | None = Field(None, description="of the image, fractions of the frame; null: the path's")
    hold: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(0, description="seconds to stand still from here")
    animation: Literal["stops", "runs"] = Field("stops", description="what the scene's time does during the hold")
    cut: bool = Field(False, description="a new shot begins here")

    @model_validator(mode="after")
    def _one_direction(self) -> "Keyframe":
        if (self.look_at is None) == (self.quaternion is None):
            raise ValueError("give exactly one of look_at and quaternion")
        if self.quaternion is not None and not any(self.quaternion):
            raise ValueError("quaternion has length zero")
        if self.look_at == self.position:
            raise ValueError("look_at is the position itself")
        return self


class Pose(BaseModel):
    """One explicit pose."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time: Finite = Field(description="seconds")
    world_from_camera: tuple[Row, Row, Row, Row] = Field(description="rigid 4x4 matrix, row major")
    fov_y_deg: FieldOfView | None = Field(None, description="vertical field of view; null: the path's")
    height: Height | None = Field(None, description="of an orthographic view, scene units; null: the path's")
    lens_shift: Shift | None = Field(None, description="of the image, fractions of the frame; null: the path's")
    cut: bool = Field(False, description="a new shot begins here")

    @model_validator(mode="after")
    def _rigid(self) -> "Pose":
        matrix = np.array(self.world_from_camera)
        rotation = matrix[:3, :3]
        if not np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
            raise ValueError("world_from_camera is not a rotation and translation")
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise ValueError("the last row of world_from_camera is not 0 0 0 1")
        return self


class CameraPath(BaseModel):
    """A camera path file: `keyframes` or `poses`. Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1]
    fps: Annotated[float, Field(gt=0, le=1000)] = Field(24, description="frames per second")
    fov_y_deg: FieldOfView = Field(45, description="vertical field of view, degrees")
    projection: Literal["perspective", "orthographic"] = Field("perspective", description="kind of the camera")
    height: Height | None = Field(None, description="of an orthographic view, scene units")
    lens_shift: Shift = Field((0, 0), description="of the image, fractions of the frame, x right, y down")
    near: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None, description="near plane, scene units; null: 1/1000 of the scene's diagonal"
    )
    far: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None, description="far plane, scene units; null: 100 times the scene's diagonal"
    )
    exposure_ev: Annotated[float, Field(ge=-32, le=32)] = Field(0, description="display = colour * 2^exposure_ev")
    up: Point | None = Field(None, description="up for look_at; null: the scene's up axis")
    keyframes: tuple[Keyframe, ...] = Field((), description="in order of time")
    poses: tuple[Pose, ...] = Field((), description="in order of time")

    @model_validator(mode="after")
    def _consistent(self) -> "CameraPath":
        if bool(self.keyframes) == bool(self.poses):
            raise ValueError("give either keyframes or poses")
        stops = self.keyframes or self.poses
        kind = "keyframes" if self.keyframes else "poses"
        for index, (a, b) in enumerate(zip(stops, stops[1:], strict=False), start=1):
            if b.time == a.time:
                raise ValueError(f"{kind}.{index}: two {kind} at time {b.time:g}")
            if b.time < a.time + getattr(a, "hold", 0):
                raise ValueError(f"{kind}.{index}: time {b.time:g} lies before the end of what precedes it")
        if stops[0].time != 0:
            raise ValueError(f"{kind}.0: the first time must be 0, not {stops[0].time:g}")
        if (stops[-1].time + getattr(stops[-1], "hold", 0)) * self.fps >= MOST_FRAMES:
            raise ValueError(f"{kind}: more than {MOST_FRAMES} frames")
        heights = [stop.height or self.height for stop in stops]
        if self.projection == "orthographic" and not all(heights):
            raise ValueError("an orthographic path needs a height")
        if self.projection == "perspective" and any(heights):
            raise ValueError("height is of orthographic paths")
        if self.near and self.far and self.far <= self.near:
            raise ValueError("far must be greater than near")
        if self.up is not None and not any(self.up):
            raise ValueError("up has length zero")
        return self


@dataclass(frozen=True, kw_only=True)
class CameraSample:
    """The camera at one time.

    world_from_camera: [4, 4] float64. fov_y: radians. height: of an orthographic view, scene units, None for a pinhole.
    shift: of the image, fractions of the frame. shot: index of the shot, counted from 0. scene_time_s: time of the scene's
    animation, which holds may have stopped.
    """

    world_from_camera: Matrix
    fov_y: float
    shot: int
    scene_time_s: float
    height: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)


def read_camera_path(file: Path) -> CameraPath:
    """Raises InputError that names the file and the field."""
    try:
        text = file.read_text()
        values = json.loads(text)
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON: {error}", file=file) from None
    return make_camera_path(values, file=file)


def make_camera_path(values: object, *, file: Path | str = "camera path") -> CameraPath:
    try:
        return CameraPath.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise InputError(f"{first['msg'].removeprefix('Value error, ')}", file=file, field=field) from None


def frame_count(path: CameraPath) -> int:
    """Frames of the path: i / fps for every i up to the end, the end included."""
    stops = path.keyframes or path.poses
    end = stops[-1].time + getattr(stops[-1], "hold", 0)
    return math.floor(end * path.fps + 1e-6) + 1


def sample(path: CameraPath, time: float, scene_up: Vector) -> CameraSample:
    """The camera at `time` seconds; before the first and after the last stop it stands still."""
    stops = path.keyframes or path.poses
    slack = _slack(time)
    index = max(bisect_right(stops, time + slack, key=lambda stop: stop.time) - 1, 0)
    stop = stops[index]
    following = stops[index + 1] if index + 1 < len(stops) and not stops[index + 1].cut else None
    leaves = stop.time + getattr(stop, "hold", 0)
    t = 0.0
    if following is not None and following.time > leaves and time > leaves + slack:
        t = min(max((time - leaves) / (following.time - leaves), 0.0), 1.0)
    lenses = [_lens(path, s) for s in (stop, following or stop)]
    fov_y, height, *shift = (a + t * (b - a) for a, b in zip(*lenses, strict=True))
    up = np.array(path.up, dtype=float) if path.up else scene_up
    if isinstance(stop, Pose):
        matrix = _between_poses(stop, following or stop, t)
    else:
        matrix = _between_keyframes(path, index, following is not None, t, up)
    return CameraSample(
        world_from_camera=matrix,
        fov_y=fov_y,
        shot=sum(s.cut for s in stops[1 : index + 1]),
        scene_time_s=_scene_time(path, time),
        height=height if path.projection == "orthographic" else None,
        shift=tuple(shift),
    )


def _lens(path: CameraPath, stop: Keyframe | Pose) -> tuple[float, float, float, float]:
    """fov_y in radians, height (0 for a perspective path), shift in x and y."""
    shift = stop.lens_shift or path.lens_shift
    return math.radians(stop.fov_y_deg or path.fov_y_deg), stop.height or path.height or 0.0, *shift


def _slack(time: float) -> float:
    """A frame's time i / fps and a stop's decimal time may differ in the last digits: so near, they are the same."""
    return 1e-9 * max(1.0, abs(time))


def _between_poses(a: Pose, b: Pose, t: float) -> Matrix:
    first, second = np.array(a.world_from_camera), np.array(b.world_from_camera)
    if t == 0 or np.array_equal(first, second):  # a camera that stands still does so to the last bit
        return first
    quaternions = [quaternion_from_rotation(matrix[:3, :3]) for matrix in (first, second)]
    rotation = rotation_from_quaternion(slerp(*quaternions, t))
    return rigid(rotation, (1 - t) * first[:3, 3] + t * second[:3, 3])


def _between_keyframes(path: CameraPath, index: int, moves: bool, t: float, up: Vector) -> Matrix:
    first, last = _shot_of(path, index)
    shot = path.keyframes[first : last + 1]
    a = path.keyframes[index]
    b = path.keyframes[index + 1] if moves else a
    position = _cubic([k.position for k in shot], shot, index - first, t)
    targets = [k.look_at for k in shot if k.look_at is not None]
    if len(targets) == len(shot):
        target = _cubic(targets, shot, index - first, t)
        try:
            return look_at(position, target, up)
        except ValueError as error:
            problem = f"{error} on the way to the next keyframe"
            raise InputError(problem, file="camera path", field=f"keyframes.{index}") from None
    rotation = rotation_from_quaternion(slerp(_orientation(a, up), _orientation(b, up), t))
    return rigid(rotation, position)


def _orientation(keyframe: Keyframe, up: Vector) -> np.ndarray:
    if keyframe.quaternion is not None:
        quaternion = np.array(keyframe.quaternion)
        return quaternion / np.linalg.norm(quaternion)
    return quaternion_from_rotation(look_at(np.array(keyframe.position), np.array(keyframe.look_at), up)[:3, :3])


def _shot_of(path: CameraPath, index: int) -> tuple[int, int]:
    """First and last keyframe of the shot that keyframe `index` belongs to."""
    begins = [i for i, keyframe in enumerate(path.keyframes) if i == 0 or keyframe.cut]
    first = max(i for i in begins if i <= index)
    last = min((i - 1 for i in begins if i > index), default=len(path.keyframes) - 1)
    return first, last


def _cubic(points: list[Point], shot: tuple[Keyframe, ...], index: int, t: float) -> Vector:
    """Cubic Hermite between point `index` and the next at `t`; a keyframe that holds is left and reached at rest."""
    values = np.array(points, dtype=float)
    if t == 0 or index + 1 >= len(points):
        return values[index]
    width = shot[index + 1].time - shot[index].time - shot[index].hold
    start, end = (_velocity(values, shot, i) * width for i in (index, index + 1))
    a, b = values[index], values[index + 1]
    return (
        a + t * t * (3 - 2 * t) * (b - a) + t * (1 - t) * ((1 - t) * start - t * end)  # exact where a = b and at rest
    )


def _velocity(values: np.ndarray, shot: tuple[Keyframe, ...], index: int) -> Vector:
    if shot[index].hold > 0:
        return np.zeros(3)
    before, after = max(index - 1, 0), min(index + 1, len(shot) - 1)
    seconds = shot[after].time - shot[before].time - shot[before].hold
    return (values[after] - values[before]) / seconds


def _scene_time(path: CameraPath, time: float) -> float:
    """Time of the animation: constant, to the last bit, while a hold stops it."""
    stopped, slack = 0.0, _slack(time)
    for keyframe in path.keyframes:
        if time < keyframe.time - slack:
            break
        if keyframe.animation != "stops" or keyframe.hold == 0:
            continue
        if time <= keyframe.time + keyframe.hold + slack:
            return keyframe.time - stopped
        stopped += keyframe.hold
    return time - stopped
