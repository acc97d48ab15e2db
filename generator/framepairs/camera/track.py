"""A camera path prepared for a scene: the camera at any time, a pure function of path, scene and time.

Neither the frame rate nor what was asked before changes a pose. Preparing costs O(n), a sample O(log n).
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..camera_path import CameraPath, CameraSample
from ..errors import InputError
from ..transforms import Matrix, Vector, quaternion_from_rotation, rigid, rotation_from_quaternion, slerp
from .clock import Clock, at_rest, clock_of, rests_around, scene_times, shots_of, slack
from .keyframe_pieces import keyframe_pieces
from .keys import ObjectPoint
from .lens import EXPOSURE, FOV, HEIGHT, ROLL, SHIFT_X, SHIFT_Y, lens_of
from .move_pieces import move_pieces
from .pieces import Piece, headings_of_piece, positions_at, rotations_of
from .rotations import Horizon, horizon_of
from .shake import Noise, fade_between, make_noise, shaken
from .splines import Array, Cubic, cubic_at

PlaceOf = Callable[[str, float], Matrix]


@dataclass(frozen=True, kw_only=True)
class PoseTable:
    """Explicit poses. times: [n]. matrices: [n, 4, 4]. lenses: [n, 6]. shots: [n]. Between two of a shot, places and lenses
    are linear and rotations slerped."""

    times: list[float]
    matrices: Array
    lenses: Array
    shots: list[int]


@dataclass(frozen=True, kw_only=True)
class Track:
    """begins: of the pieces, seconds. place_of: of an object's name and the animation's time."""

    clock: Clock
    begins: list[float]
    pieces: tuple[Piece, ...]
    poses: PoseTable | None
    horizon: Horizon
    noise: Noise | None
    fade_s: float
    orthographic: bool
    place_of: PlaceOf | None
    headings: dict[int, Cubic] = field(default_factory=dict)  # of pieces that pass a pole, found when one is first asked for

    def places(self, name: str, times: Array) -> Array:
        """Places [t, 3] of an object at times [t] of the path."""
        return np.array([self.place_of(name, float(t))[:3, 3] for t in scene_times(self.clock, times)]).reshape(-1, 3)


def prepare_track(path: CameraPath, scene_up: Vector, place_of: PlaceOf | None = None) -> Track:
    """The track of a path in a scene. scene_up: [3], where the path gives no up.

    place_of gives the rigid matrix of an object, or of a group of them, at a time of the animation: the middle of its bounds
    and its rotation; it raises InputError for names that are none. Raises InputError naming the field of the path.
    """
    for where, name in _objects(path):
        if place_of is None:
            raise InputError(f"there is no scene that has {name!r}", file="camera path", field=where)
        try:
            place_of(name, 0.0)
        except InputError as error:
            raise InputError(error.problem, file="camera path", field=where) from None
    track = Track(
        clock=clock_of(path),
        begins=[],
        pieces=(),
        poses=_pose_table(path) if path.poses else None,
        horizon=horizon_of(np.array(path.up, dtype=float) if path.up else np.asarray(scene_up, dtype=float)),
        noise=_noise(path),
        fade_s=path.shake.fade_s if path.shake else 1.0,
        orthographic=path.projection == "orthographic",
        place_of=place_of,
    )

    def frames_of(name: str, times: Array) -> Array:
        return np.array([place_of(name, float(t)) for t in times])

    pieces: list[Piece] = []
    if path.keyframes:
        pieces = list(keyframe_pieces(path, track.horizon, track.clock, track.places, frames_of))
    if path.moves:
        pieces = list(move_pieces(path, track.horizon, track.places))
    keys = {name: getattr(track, name) for name in Track.__dataclass_fields__}
    return Track(**{**keys, "pieces": tuple(pieces), "begins": [piece.begin for piece in pieces]})


def sample(track: Track, time: float) -> CameraSample:
    """The camera at `time` seconds; before the first and after the last stop it stands still. All times of a hold are one."""
    rest = at_rest(track.clock, time)
    if track.poses is not None:
        matrix, lens, shot = _pose_at(track.poses, rest)
    else:
        index = max(bisect_right(track.begins, rest + slack(rest)) - 1, 0)
        matrix, lens, shot = _piece_at(track, index, rest)
    if track.noise is not None:
        share = fade_between(rest, *rests_around(track.clock, rest, shot), track.fade_s)
        matrix = shaken(matrix, track.noise, rest, share)
    return CameraSample(
        world_from_camera=matrix,
        fov_y=float(lens[FOV]),
        shot=shot,
        scene_time_s=float(scene_times(track.clock, np.array([time]))[0]),
        height=float(lens[HEIGHT]) if track.orthographic else None,
        shift=(float(lens[SHIFT_X]), float(lens[SHIFT_Y])),
        exposure_ev=float(lens[EXPOSURE]),
    )


def cameras_at(track: Track, times: Array) -> Array:
    """world_from_camera [t, 4, 4] at times [t] in seconds of the path, as `sample` has them, all at once; for keyframes and
    moves."""
    rest = np.array([at_rest(track.clock, float(time)) for time in times])
    piece_of = np.maximum(np.searchsorted(track.begins, rest + slack(rest), side="right") - 1, 0)
    matrices = np.empty((len(rest), 4, 4))
    for index in np.unique(piece_of):
        here = np.flatnonzero(piece_of == index)
        matrices[here] = _piece_views(track, index, rest[here])[0]
    if track.noise is not None:
        for k, time in enumerate(rest.tolist()):
            shot = track.pieces[piece_of[k]].shot
            share = fade_between(time, *rests_around(track.clock, time, shot), track.fade_s)
            matrices[k] = shaken(matrices[k], track.noise, time, share)
    return matrices


def smooth_headings(track: Track, index: int) -> Cubic:
    """Headings of a piece that looks steeply up or down somewhere: `camera.pieces.rotations_of` asks for them there."""
    if index not in track.headings:
        track.headings[index] = headings_of_piece(track.pieces[index], track.horizon, track.places)
    return track.headings[index]


def _piece_at(track: Track, index: int, time: float) -> tuple[Matrix, Array, int]:
    matrices, lenses = _piece_views(track, index, np.array([time]))
    return matrices[0], lenses[0], track.pieces[index].shot


def _piece_views(track: Track, index: int, times: Array) -> tuple[Array, Array]:
    """world_from_camera [t, 4, 4] and lenses [t, 6] at times [t] of one piece."""
    piece = track.pieces[index]
    inside = np.clip(times, piece.begin, piece.end)
    matrices = np.tile(np.eye(4), (len(times), 1, 1))
    matrices[:, :3, :3] = rotations_of(piece, inside, track.horizon, track.places, partial(smooth_headings, track, index))
    matrices[:, :3, 3] = positions_at(piece, inside, track.places)
    lenses = cubic_at(piece.lens, times)
    for k in np.flatnonzero(lenses[:, ROLL]):
        cosine, sine = math.cos(lenses[k, ROLL]), math.sin(lenses[k, ROLL])
        matrices[k, :3, :3] = matrices[k, :3, :3] @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return matrices, lenses


def _pose_table(path: CameraPath) -> PoseTable:
    return PoseTable(
        times=[pose.time for pose in path.poses],
        matrices=np.array([pose.world_from_camera for pose in path.poses], dtype=float),
        lenses=np.array([lens_of(path, pose) for pose in path.poses]),
        shots=shots_of(path),
    )


def _pose_at(poses: PoseTable, time: float) -> tuple[Matrix, Array, int]:
    near = float(slack(time))
    index = max(bisect_right(poses.times, time + near) - 1, 0)
    shot, first = poses.shots[index], poses.matrices[index]
    if index + 1 == len(poses.times) or poses.shots[index + 1] != shot or time <= poses.times[index] + near:
        return first.copy(), poses.lenses[index], shot
    t = (time - poses.times[index]) / (poses.times[index + 1] - poses.times[index])
    second = poses.matrices[index + 1]
    lens = poses.lenses[index] + t * (poses.lenses[index + 1] - poses.lenses[index])
    if np.array_equal(first, second):  # a camera that stands still does so to the last bit
        return first.copy(), lens, shot
    rotation = rotation_from_quaternion(slerp(*(quaternion_from_rotation(m[:3, :3]) for m in (first, second)), t))
    return rigid(rotation, (1 - t) * first[:3, 3] + t * second[:3, 3]), lens, shot


def _noise(path: CameraPath) -> Noise | None:
    shake = path.shake
    if shake is None or not (shake.position or shake.rotation_deg):
        return None
    return make_noise(shake.position, shake.rotation_deg, shake.low_hz, shake.high_hz, shake.seed)


def _objects(path: CameraPath) -> Iterator[tuple[str, str]]:
    """(field, object's name) wherever the path names an object; each name once."""
    found: dict[str, str] = {}
    if path.follow is not None:
        found[path.follow.object] = "follow.object"
    for index, key in enumerate(path.keyframes):
        if isinstance(key.look_at, ObjectPoint):
            found.setdefault(key.look_at.object, f"keyframes.{index}.look_at")
    for index, move in enumerate(path.moves):
        for name in ("center", "look", "look_at"):
            if isinstance(getattr(move, name, None), ObjectPoint):
                found.setdefault(getattr(move, name).object, f"moves.{index}.{name}")
    return ((where, name) for name, where in found.items())
