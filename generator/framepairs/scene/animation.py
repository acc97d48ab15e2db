"""The animation that stands beside a scene file, in JSON: keyframes that place objects and cameras over time.

It is for formats that cannot move by themselves (Mitsuba's XML, OBJ, PLY ...): `<stem>.animation.json`. Times are seconds.
Between two keyframes, positions and scales follow a line and rotations the shorter arc (slerp); `step` keeps the earlier one.
Before the first and after the last keyframe things stand still. Matrices are taken apart into translation, rotation and scale
and follow the same rule; those with a shear, which that cannot hold, run along a line component by component.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..errors import InputError
from ..transforms import Matrix, quaternion_from_rotation, rigid, rotation_from_quaternion, slerp
from .beside import read_beside
from .containment import Reach, within
from .description import CameraView, SceneCamera, SceneDescription

LARGEST = 1e18  # its square is still a single-precision number
Finite = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Point = tuple[Finite, Finite, Finite]
Row = tuple[Finite, Finite, Finite, Finite]
LARGEST_FILE = 2**26  # bytes
SHEAR = 1e-6  # of the normalised columns: their products that still count as rounding


class Keyframe(BaseModel):
    """Where an object or camera is at a time: a matrix, or any of translation, rotation and scale (applied in the order scale,
    rotation, translation; what is absent is neutral)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(description="seconds")
    world_from_object: tuple[Row, Row, Row, Row] | None = Field(None, description="4x4 matrix, row major")
    translation: Point | None = Field(None, description="scene units")
    rotation: Row | None = Field(None, description="quaternion w, x, y, z")
    scale: Point | Finite | None = Field(None, description="per axis of the object, or one for all")

    @model_validator(mode="after")
    def _one_place(self) -> "Keyframe":
        parts = [part for part in (self.translation, self.rotation, self.scale) if part is not None]
        if (self.world_from_object is None) == (not parts):
            raise ValueError("give either world_from_object, or translation, rotation and scale")
        if self.rotation is not None and not 0 < np.linalg.norm(self.rotation) < np.inf:
            raise ValueError("rotation has no length")
        if self.world_from_object is not None and self.world_from_object[3] != (0, 0, 0, 1):
            raise ValueError("the last row of world_from_object is not 0 0 0 1")
        return self


class Shown(BaseModel):
    """From a time on, whether an object is drawn."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    time: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(description="seconds")
    visible: bool = Field(description="from then on")


def _ordered(items: tuple, what: str) -> None:
    for index, (a, b) in enumerate(zip(items, items[1:], strict=False), start=1):
        if b.time <= a.time:
            raise ValueError(f"{what}.{index}: time {b.time:g} is not after the one before it")


class Track(BaseModel):
    """What one object or camera does."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    interpolation: Literal["linear", "step"] = Field("linear", description="between keyframes")
    keyframes: tuple[Keyframe, ...] = Field((), description="in order of time; none: it stays where the scene has it")

    @model_validator(mode="after")
    def _in_order(self) -> "Track":
        _ordered(self.keyframes, "keyframes")
        return self


class ObjectTrack(Track):
    """What one object does."""

    visibility: tuple[Shown, ...] = Field((), description="in order of time; before the first, the object is drawn")

    @model_validator(mode="after")
    def _shown_in_order(self) -> "ObjectTrack":
        _ordered(self.visibility, "visibility")
        return self


class SceneAnimation(BaseModel):
    """An animation file. Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1]
    objects: dict[str, ObjectTrack] = Field({}, description="by the name of the object (in Mitsuba's XML: the shape's id)")
    cameras: dict[str, Track] = Field({}, description="by the name of the camera; x right, y up, looking along -z, no scale")


def animation_beside(file: Path) -> Path:
    """Where the animation of a scene file would be; it may not exist."""
    return file.with_name(f"{file.stem}.animation.json")


def with_animation(scene: SceneDescription, file: Path, reach: Reach) -> SceneDescription:
    """The scene of `file`, moved by the animation beside it where there is one. Raises InputError."""
    beside = animation_beside(file)
    return apply_animation(scene, within(reach, beside.name, file=file)) if beside.exists() else scene


def read_animation(file: Path) -> SceneAnimation:
    """Raises InputError naming the file and the field."""
    return read_beside(SceneAnimation, file, LARGEST_FILE)


def apply_animation(scene: SceneDescription, file: Path) -> SceneDescription:
    """The scene with the animation of `file` on it, which replaces what moves these objects and cameras in the scene.

    Raises InputError naming file and field, among others for names that the scene does not have.
    """
    animation = read_animation(file)
    names = [item.name for item in scene.objects]
    for kind, known in (("objects", names), ("cameras", [camera.name for camera in scene.cameras])):
        for name in getattr(animation, kind):
            if name not in known:
                problem = f"no such {kind[:-1]} in the scene, which has {', '.join(known[:8]) or 'none'}"
                raise InputError(problem, file=file, field=f"{kind}.{name}")
    tracks = {names.index(name): track for name, track in animation.objects.items()}
    curves = {index: _curve(track) for index, track in tracks.items() if track.keyframes}
    shows = {index: track.visibility for index, track in tracks.items() if track.visibility}
    ends = [track.keyframes[-1].time for track in (*tracks.values(), *animation.cameras.values()) if track.keyframes]
    ends += [track.visibility[-1].time for track in tracks.values() if track.visibility]
    moving = {index for index, track in tracks.items() if len(track.keyframes) > 1 or track.visibility}

    def world_from_object(time_s: float) -> NDArray[np.float64]:
        world = np.array(scene.world_from_object(time_s))
        for index, curve in curves.items():
            world[index] = curve(time_s)
        return world

    def visible(time_s: float) -> NDArray[np.bool_]:
        drawn = np.array(scene.visible(time_s)) if scene.visible else np.ones(len(names), dtype=bool)
        for index, items in shows.items():
            drawn[index] = _shown(items, time_s)
        return drawn

    return replace(
        scene,
        files=(*scene.files, file),
        objects=tuple(replace(item, moves=item.moves or index in moving) for index, item in enumerate(scene.objects)),
        world_from_object=world_from_object,
        visible=visible if shows else scene.visible,
        cameras=tuple(_moved(camera, animation.cameras.get(camera.name), file) for camera in scene.cameras),
        animation_end_s=max([scene.animation_end_s, *ends]),
    )


def _moved(camera: SceneCamera, track: Track | None, file: Path) -> SceneCamera:
    if track is None or not track.keyframes:
        return camera
    for index, keyframe in enumerate(track.keyframes):
        parts = _taken_apart(_matrix(keyframe))
        if parts is None or not np.allclose(parts[2], 1, atol=1e-4):
            field = f"cameras.{camera.name}.keyframes.{index}"
            raise InputError("a camera's place is a rotation and a translation", file=file, field=field)
    curve = _curve(track)

    def at(time_s: float) -> CameraView:
        return replace(camera.at(time_s), world_from_camera=curve(time_s))

    return SceneCamera(name=camera.name, at=at, moves=camera.moves or len(track.keyframes) > 1)


def _curve(track: Track) -> Callable[[float], Matrix]:
    """The matrix of a track at a time."""
    times = [keyframe.time for keyframe in track.keyframes]
    matrices = [_matrix(keyframe) for keyframe in track.keyframes]
    parts = [_taken_apart(matrix) for matrix in matrices]

    def at(time_s: float) -> Matrix:
        slack = 1e-9 * max(1.0, abs(time_s))  # a frame's time i / fps and a keyframe's decimal time differ in the last digits
        index = max(bisect_right(times, time_s + slack) - 1, 0)
        last = index + 1 >= len(times)
        if last or track.interpolation == "step" or time_s <= times[index] + slack:
            return matrices[index]
        t = (time_s - times[index]) / (times[index + 1] - times[index])
        a, b = parts[index], parts[index + 1]
        if a is None or b is None:
            return (1 - t) * matrices[index] + t * matrices[index + 1]
        rotation = rotation_from_quaternion(slerp(a[1], b[1], t))
        return rigid(rotation * ((1 - t) * a[2] + t * b[2]), (1 - t) * a[0] + t * b[0])

    return at


def _matrix(keyframe: Keyframe) -> Matrix:
    if keyframe.world_from_object is not None:
        return np.array(keyframe.world_from_object, dtype=float)
    rotation = rotation_from_quaternion(np.array(keyframe.rotation or (1.0, 0, 0, 0)))
    scale = 1.0 if keyframe.scale is None else keyframe.scale
    return rigid(rotation * np.broadcast_to(np.array(scale, dtype=float), 3), np.array(keyframe.translation or (0.0, 0, 0)))


def _taken_apart(matrix: Matrix) -> tuple[NDArray, NDArray, NDArray] | None:
    """Translation, quaternion and scale, so that matrix = T R S; None for a shear or a collapsed axis. A mirror is a scale
    below 0 along x."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if not (scale > 0).all() or not np.isfinite(scale).all():
        return None
    rotation = matrix[:3, :3] / scale
    if np.linalg.det(rotation) < 0:
        rotation, scale = rotation * [-1, 1, 1], scale * [-1, 1, 1]
    if not np.allclose(rotation.T @ rotation, np.eye(3), atol=SHEAR):
        return None
    return matrix[:3, 3], quaternion_from_rotation(rotation), scale


def _shown(items: tuple[Shown, ...], time_s: float) -> bool:
    slack = 1e-9 * max(1.0, abs(time_s))
    index = bisect_right([item.time for item in items], time_s + slack) - 1
    return items[index].visible if index >= 0 else True
