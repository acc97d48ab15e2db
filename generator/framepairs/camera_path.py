"""Camera paths: JSON files with keyframes, explicit poses or moves (docs/camera_paths.md), their models and their frames.

Times are seconds, so that a path gives equal poses at equal times whatever its frame rate. `camera.track` samples them.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, model_validator

from .camera.keys import TAGS, Exposure, FieldOfView, Follow, Keyframe, Keys, Point, Pose, Positive, Rate, Shake, Shift
from .camera.moves import MOVES, Hold, Move
from .errors import InputError
from .transforms import Matrix

MOST_FRAMES = 10**6  # frames have names of six digits
KINDS = ("keyframes", "poses", "moves")


class CameraPath(Keys):
    """A camera path file: exactly one of `keyframes`, `poses` and `moves`. Unknown keys are refused."""

    version: Literal[1]
    fps: Rate = Field(24, description="frames per second")
    fov_y_deg: FieldOfView | None = Field(None, description="vertical field of view, degrees; 45 without focal_length_mm")
    focal_length_mm: Positive | None = Field(None, description="focal length in millimetres, instead of fov_y_deg")
    sensor_height_mm: Positive = Field(24, description="what focal lengths refer to")
    projection: Literal["perspective", "orthographic"] = Field("perspective", description="kind of the camera")
    height: Positive | None = Field(None, description="of an orthographic view, scene units")
    lens_shift: Shift = Field((0, 0), description="of the image, fractions of the frame, x right, y down")
    near: Positive | None = Field(None, description="near plane, scene units; null: 1/1000 of the scene's diagonal")
    far: Positive | None = Field(None, description="far plane, scene units; null: 100 times the scene's diagonal")
    exposure_ev: Exposure = Field(0, description="display = colour * 2^exposure_ev")
    up: Point | None = Field(None, description="up for level cameras; null: the scene's up axis")
    shake: Shake | None = Field(None, description="seeded noise of place and direction")
    follow: Follow | None = Field(None, description="a damped spring towards an object gives the place; with keyframes")
    keyframes: tuple[Keyframe, ...] = Field((), description="in order of time")
    poses: tuple[Pose, ...] = Field((), description="in order of time")
    moves: tuple[Move, ...] = Field((), description="one after another")

    @model_validator(mode="before")
    @classmethod
    def _default_lens(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("fov_y_deg") is None and values.get("focal_length_mm") is None:
            return {**values, "fov_y_deg": 45}
        return values

    @model_validator(mode="after")
    def _consistent(self) -> "CameraPath":
        kinds = [kind for kind in KINDS if getattr(self, kind)]
        if len(kinds) != 1:
            raise ValueError("give either keyframes or poses or moves")
        if self.fov_y_deg is not None and self.focal_length_mm is not None:
            raise ValueError("give one of fov_y_deg and focal_length_mm")
        if self.keyframes:
            _check_keyframes(self)
        if not self.moves:
            _check_times(kinds[0], self.keyframes or self.poses)
        elif isinstance(self.moves[0], Hold):
            raise ValueError("moves.0: a hold keeps the last view, and there is none")
        if self.follow is not None and not self.keyframes:
            raise ValueError("follow: is of paths with keyframes")
        if sum(count for _, _, count in _runs(self)) > MOST_FRAMES:
            raise ValueError(f"{kinds[0]}: more than {MOST_FRAMES} frames")
        _check_lens(self, [stop.height for stop in self.keyframes or self.poses or self.moves])
        if self.near and self.far and self.far <= self.near:
            raise ValueError("far must be greater than near")
        if self.up is not None and not any(self.up):
            raise ValueError("up has length zero")
        return self


def _check_keyframes(path: CameraPath) -> None:
    for index, key in enumerate(path.keyframes):
        if path.follow is None and key.position is None:
            raise ValueError(f"keyframes.{index}.position: is missing")
        if path.follow is None and key.look_at is None and key.quaternion is None:
            raise ValueError(f"keyframes.{index}: give exactly one of look_at and quaternion")
        if path.follow is not None and (key.position is not None or key.speed is not None):
            raise ValueError(f"keyframes.{index}: position and speed come from follow")
        if path.follow is not None and key.hold and key.animation == "runs":
            raise ValueError(f"keyframes.{index}.animation: cannot run in a hold of a camera that follows")


def _check_times(kind: str, stops: tuple[Keyframe, ...] | tuple[Pose, ...]) -> None:
    for index, (a, b) in enumerate(zip(stops, stops[1:], strict=False), start=1):
        if b.time == a.time:
            raise ValueError(f"{kind}.{index}: two {kind} at time {b.time:g}")
        rounding = 1e-9 * max(1.0, abs(b.time))  # decimal times meet but for their last digits
        if b.time < a.time + getattr(a, "hold", 0) - rounding:
            raise ValueError(f"{kind}.{index}: time {b.time:g} lies before the end of what precedes it")
    if stops[0].time != 0:
        raise ValueError(f"{kind}.0: the first time must be 0, not {stops[0].time:g}")


def _check_lens(path: CameraPath, heights: list[float | None]) -> None:
    if path.projection == "orthographic" and path.height is None and not all(heights):
        raise ValueError("an orthographic path needs a height")
    if path.projection == "perspective" and (path.height is not None or any(heights)):
        raise ValueError("height is of orthographic paths")


@dataclass(frozen=True, kw_only=True)
class CameraSample:
    """The camera at one time.

    world_from_camera: [4, 4] float64. fov_y: radians. height: of an orthographic view, scene units, None for a pinhole.
    shift: of the image, fractions of the frame. shot: index of the shot, counted from 0. scene_time_s: time of the scene's
    animation, which holds may have stopped. exposure_ev: display = colour * 2^exposure_ev.
    """

    world_from_camera: Matrix
    fov_y: float
    shot: int
    scene_time_s: float
    height: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)
    exposure_ev: float = 0.0


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
        of_move = first["loc"][:1] == ("moves",)
        parts = [part for k, part in enumerate(first["loc"]) if part not in TAGS and not (of_move and k == 2 and part in MOVES)]
        field = ".".join(str(part) for part in parts) or None
        raise InputError(f"{first['msg'].removeprefix('Value error, ')}", file=file, field=field) from None


def move_times(path: CameraPath) -> list[float]:
    """Begin of each move, and the end of the last, seconds."""
    times = [0.0]
    for move in path.moves:
        times.append(times[-1] + move.seconds)
    return times


def end_of(path: CameraPath) -> float:
    """Seconds from the begin of the path to its end."""
    if path.moves:
        return move_times(path)[-1]
    last = (path.keyframes or path.poses)[-1]
    return last.time + getattr(last, "hold", 0)


def with_fps(path: CameraPath, fps: float) -> CameraPath:
    """The path at one frame rate all along: the same poses at the same times. Raises InputError for a rate that is none."""
    values = path.model_dump(mode="json")
    for kind in KINDS:
        values[kind] = [{**stop, "fps": None} for stop in values[kind]]
    return make_camera_path({**values, "fps": fps})


def frame_times(path: CameraPath) -> tuple[float, ...]:
    """Times of the frames, seconds: begin + i / fps from each place on where `fps` is given; the path's end included."""
    return tuple(begin + i / fps for begin, fps, count in _runs(path) for i in range(count))


def frame_durations(path: CameraPath) -> tuple[float, ...]:
    """Seconds since the frame before, one for each frame; the first one's is 1 / fps."""
    durations: list[float] = []
    last = None
    for begin, fps, count in _runs(path):
        durations.append(1 / fps if last is None else begin - last)
        durations.extend([1 / fps] * (count - 1))
        last = begin + (count - 1) / fps
    return tuple(durations)


def _runs(path: CameraPath) -> list[tuple[float, float, int]]:
    """(begin in seconds, frames per second, frames) of each part of one frame rate."""
    stops = path.keyframes or path.poses or path.moves
    begins = move_times(path)[:-1] if path.moves else [stop.time for stop in stops]
    rates = [(begin, stop.fps) for begin, stop in zip(begins, stops, strict=True) if stop.fps is not None]
    if not rates or rates[0][0] > 0:
        rates.insert(0, (0.0, path.fps))
    ends = [begin for begin, _ in rates[1:]]
    runs = [(begin, fps, max(math.ceil((end - begin) * fps - 1e-6), 1)) for (begin, fps), end in zip(rates, ends, strict=False)]
    begin, fps = rates[-1]
    return [*runs, (begin, fps, math.floor((end_of(path) - begin) * fps + 1e-6) + 1)]
