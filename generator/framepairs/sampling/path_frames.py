"""Where the camera of a sampled path is, as the camera path language has it: at its frames, and close together between them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera.clock import scene_times
from ..camera.track import cameras_at, prepare_track
from ..camera_path import CameraPath, frame_times
from ..transforms import Vector

STEP = 1 / 3  # distance of the points that a clearance is checked from, over the clearance
ARC = 1.05  # an arc's length over its chord's, at that distance


@dataclass(frozen=True)
class PathFrames:
    """A path at its frames, relative to the probe's origin. cameras: [frames, 4, 4]. times: [frames] of the animation."""

    cameras: NDArray[np.float64]
    times: NDArray[np.float64]

    @property
    def turn_deg(self) -> float:
        """Largest angle between the viewing directions of neighbouring frames."""
        forward = -self.cameras[:, :3, 2]
        sine = np.linalg.norm(np.cross(forward[1:], forward[:-1]), axis=1)
        return float(np.degrees(np.arctan2(sine, np.sum(forward[1:] * forward[:-1], axis=1))).max(initial=0))


@dataclass(frozen=True)
class PathPoints:
    """Places along a path, relative to the probe's origin. points: [m, 3], `per_frame` for each frame but the last.
    spacing: longest way between two of them."""

    points: NDArray[np.float64]
    per_frame: int
    spacing: float

    @property
    def length(self) -> float:
        """Along the path, scene units."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def frames_of(path: CameraPath, up: Vector, origin: Vector) -> PathFrames:
    """up: [3], the scene's. origin: the probe's."""
    track, times = prepare_track(path, up), np.array(frame_times(path))
    cameras = cameras_at(track, times)
    cameras[:, :3, 3] -= origin
    return PathFrames(cameras, scene_times(track.clock, times))


def points_of(path: CameraPath, up: Vector, frames: PathFrames, clearance: float, origin: Vector) -> PathPoints:
    """The path at as many places between its frames as the check of `clearance` needs."""
    step = float(np.linalg.norm(np.diff(frames.cameras[:, :3, 3], axis=0), axis=1).max(initial=0))
    per_frame = max(1, math.ceil(ARC * step / (STEP * clearance)))
    times = np.arange((len(frames.cameras) - 1) * per_frame + 1) / (path.fps * per_frame)
    points = cameras_at(prepare_track(path, up), times)[:, :3, 3] - origin
    return PathPoints(points, per_frame, ARC * float(np.linalg.norm(np.diff(points, axis=0), axis=1).max(initial=0)))
