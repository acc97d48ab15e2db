"""FrameState: everything about one frame that the passes need, now and one frame earlier, as float64 data.

The previous state is part of the data, never the memory of an earlier call: any frame renders alone.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .camera.places import object_places
from .camera.track import prepare_track, sample
from .camera_path import MOST_FRAMES, CameraPath, CameraSample, frame_durations, frame_times, make_camera_path
from .errors import InputError
from .scene.description import Deformed, Light, Material, SceneCamera, SceneDescription, rotation_from_y_up, scene_bounds
from .transforms import Matrix, Vector, clip_from_view, look_at, orthographic_clip_from_view

ORIGIN_CELL_M = 4096.0


@dataclass(frozen=True, kw_only=True)
class CameraState:
    """A camera. world_from_camera: [4, 4] rigid, looking along -z. fov_y in radians. near, far: scene units. height: of an
    orthographic view, scene units; None for a pinhole. shift: of the image, fractions of the frame, x right, y down."""

    world_from_camera: Matrix
    fov_y: float
    aspect: float
    near: float
    far: float
    height: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def view_from_world(self) -> Matrix:
        return np.linalg.inv(self.world_from_camera)

    @property
    def clip_from_view(self) -> Matrix:
        if self.height is not None:
            return orthographic_clip_from_view(self.height, self.aspect, self.near, self.far, self.shift)
        return clip_from_view(self.fov_y, self.aspect, self.near, self.far, self.shift)


@dataclass(frozen=True, kw_only=True)
class ObjectStates:
    """All objects at one time. world_from_object: [objects, 4, 4]. visible: [objects]. deformed: vertices by mesh index."""

    world_from_object: NDArray[np.float64]
    visible: NDArray[np.bool_]
    deformed: dict[int, Deformed]


@dataclass(frozen=True, kw_only=True)
class OtherTime:
    """Another frame of the same shot; where there is none, `exists` is false and the rest is the present frame's."""

    camera: CameraState
    objects: ObjectStates
    exists: bool


@dataclass(frozen=True, kw_only=True)
class FrameState:
    """One frame. On a reset (frame 0 of the path, or the first after a cut) the previous state equals the current.

    time_s: seconds of the path. frame_time_ms: since the frame before, of the first frame 1000 / fps.
    objects, previous_objects: where they are, which are drawn, and the vertices of those that deform. others: by frame
    offset, what further motion leads to. lights, materials: as they are in this frame. render_origin: [3],
    the point that the passes take as (0, 0, 0) so that float32 resolves what lies around the camera.
    """

    frame: int
    time_s: float
    frame_time_ms: float
    reset: bool
    exposure_ev: float
    camera: CameraState
    previous_camera: CameraState
    objects: ObjectStates
    previous_objects: ObjectStates
    others: dict[int, OtherTime]
    lights: tuple[Light, ...]
    materials: tuple[Material, ...]
    render_origin: Vector


@dataclass(frozen=True)
class Shoot:
    """A scene seen along a path at one aspect ratio: gives the state of any frame, in any order. camera_scene: which the camera
    follows and whose bounds give its planes, where that is not the scene (a variation moves no camera)."""

    scene: SceneDescription
    path: CameraPath
    aspect: float
    motion_offsets: tuple[int, ...] = ()
    camera_scene: SceneDescription | None = None

    @cached_property
    def samples(self) -> tuple[CameraSample, ...]:
        track = prepare_track(self.path, self.scene.up, object_places(self.camera_scene or self.scene))
        return tuple(sample(track, time) for time in self.times)

    @cached_property
    def times(self) -> tuple[float, ...]:
        """Seconds of the path, one per frame."""
        return frame_times(self.path)

    @cached_property
    def _durations(self) -> tuple[float, ...]:
        return frame_durations(self.path)

    @cached_property
    def clip_planes(self) -> tuple[float, float]:
        low, high = scene_bounds(self.camera_scene or self.scene)
        centres = np.array([item.world_from_camera[:3, 3] for item in self.samples])
        reach = float(np.linalg.norm(np.maximum(high, centres.max(axis=0)) - np.minimum(low, centres.min(axis=0)))) or 1.0
        near, far = self.path.near or 1e-3 * reach, self.path.far or 100 * reach
        if far <= near:
            raise InputError(f"near {near:g} is not less than far {far:g}", file="camera path", field="near")
        return near, far

    @cached_property
    def _origins(self) -> tuple[Vector, ...]:
        """One origin per frame: the middle of the shot's camera positions, or a coarse grid where the shot is too long."""
        cell = ORIGIN_CELL_M / self.scene.metres_per_unit
        positions = np.array([item.world_from_camera[:3, 3] for item in self.samples])
        shots = np.array([item.shot for item in self.samples])
        origins = np.empty_like(positions)
        for shot in np.unique(shots):
            inside = positions[shots == shot]
            low, high = inside.min(axis=0), inside.max(axis=0)
            snapped = np.round(inside / cell) * cell
            origins[shots == shot] = (low + high) / 2 if np.all(high - low <= cell) else snapped
        return tuple(origins)

    def camera(self, frame: int) -> CameraState:
        near, far = self.clip_planes
        item = self.samples[frame]
        return CameraState(
            world_from_camera=item.world_from_camera,
            fov_y=item.fov_y,
            aspect=self.aspect,
            near=near,
            far=far,
            height=item.height,
            shift=item.shift,
        )

    def objects(self, time_s: float) -> ObjectStates:
        """All objects at a time of the animation. The last few are kept: a frame's are the next frame's previous ones."""
        kept = self._kept.get(time_s)
        if kept is None:
            scene = self.scene
            visible = scene.visible(time_s) if scene.visible else np.ones(len(scene.objects), dtype=bool)
            deformed = scene.deformed(time_s) if scene.deformed else {}
            kept = ObjectStates(world_from_object=scene.world_from_object(time_s), visible=visible, deformed=deformed)
            while len(self._kept) > 1 + len(self.motion_offsets):
                del self._kept[next(iter(self._kept))]
            self._kept[time_s] = kept
        return kept

    @cached_property
    def _kept(self) -> dict[float, ObjectStates]:
        return {}

    def state(self, frame: int) -> FrameState:
        """The state of `frame`, 0 <= frame < len(self)."""
        reset = frame == 0 or self.samples[frame].shot != self.samples[frame - 1].shot
        before = frame if reset else frame - 1
        time_s = self.samples[frame].scene_time_s
        return FrameState(
            frame=frame,
            time_s=self.times[frame],
            frame_time_ms=1000 * self._durations[frame],
            reset=reset,
            exposure_ev=self.samples[frame].exposure_ev,
            camera=self.camera(frame),
            previous_camera=self.camera(before),
            objects=self.objects(time_s),
            previous_objects=self.objects(self.samples[before].scene_time_s),
            lights=self.scene.lights_at(time_s) if self.scene.lights_at else self.scene.lights,
            materials=self.scene.materials_at(time_s) if self.scene.materials_at else self.scene.materials,
            others={offset: self._other(frame, offset) for offset in self.motion_offsets},
            render_origin=self._origins[frame],
        )

    def _other(self, frame: int, offset: int) -> OtherTime:
        there = frame + offset
        exists = 0 <= there < len(self) and self.samples[there].shot == self.samples[frame].shot
        there = there if exists else frame
        return OtherTime(camera=self.camera(there), objects=self.objects(self.samples[there].scene_time_s), exists=exists)

    def __len__(self) -> int:
        return len(self.samples)


def check_frames(frames: Sequence[int], count: int) -> None:
    """Raises InputError for frames that a path of `count` frames has not."""
    if len(frames) == 0 or frames[0] < 0 or frames[-1] >= count:
        asked = f"{frames[0]}:{frames[-1] + 1} does" if frames else "no frames do"
        raise InputError(f"{asked} not lie in 0:{count}, the frames of the path", field="frames")


def frame_states(shoot: Shoot, frames: Sequence[int]) -> Iterator[FrameState]:
    """States of `frames`; numbers past the end of the path raise InputError."""
    check_frames(frames, len(shoot))
    return (shoot.state(frame) for frame in frames)


def path_of_camera(camera: SceneCamera, end_s: float, fps: float = 24, still_frames: int = 32) -> CameraPath:
    """The path of a scene's own camera: a pose per frame up to `end_s` seconds, or `still_frames` frames where nothing moves.

    Raises InputError for a camera that changes between a perspective and an orthographic view.
    """
    last = min(math.floor(end_s * fps + 1e-6), MOST_FRAMES - 1) if end_s > 0 else still_frames - 1
    frames = range(last + 1) if camera.moves else sorted({0, last})
    views = [camera.at(frame / fps) for frame in frames]
    first = views[0]
    if len({view.height is None for view in views}) > 1:
        raise InputError("changes between a perspective and an orthographic view", field=camera.name)
    lens = "fov_y_deg" if first.height is None else "height"
    poses = [
        {
            "time": frame / fps,
            "world_from_camera": view.world_from_camera.tolist(),
            lens: math.degrees(view.fov_y) if view.height is None else view.height,
            "lens_shift": view.shift,
        }
        for frame, view in zip(frames, views, strict=True)
    ]
    kind = "perspective" if first.height is None else "orthographic"
    planes = {"near": first.near if first.near and first.near > 0 else None, "far": first.far or None}
    return make_camera_path({"version": 1, "fps": fps, "projection": kind, **planes, "poses": poses}, file=camera.name)


def orbit(scene: SceneDescription, frames: int = 32, fps: float = 24, fov_y_deg: float = 45) -> CameraPath:
    """The default path of a scene that brings none: an eighth of a circle around its bounds, slightly from above.

    The distance fits the bounding sphere into the vertical field of view.
    """
    low, high = scene_bounds(scene)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 or 1.0
    distance = 1.1 * radius / math.sin(math.radians(fov_y_deg) / 2)
    elevation = math.radians(18)
    world_from_y_up = rotation_from_y_up(scene.up_axis)
    poses = []
    for frame in range(frames):
        azimuth = math.radians(30) + math.pi / 4 * frame / max(frames - 1, 1)
        direction = world_from_y_up @ np.array(
            [
                math.sin(azimuth) * math.cos(elevation),
                math.sin(elevation),
                math.cos(azimuth) * math.cos(elevation),
            ]
        )
        matrix = look_at(centre + distance * direction, centre, scene.up)
        poses.append({"time": frame / fps, "world_from_camera": matrix.tolist()})
    return make_camera_path({"version": 1, "fps": fps, "fov_y_deg": fov_y_deg, "poses": poses}, file="orbit")
