"""From keyframes to pieces of a camera track."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..camera_path import CameraPath, end_of
from ..errors import InputError
from ..transforms import quaternion_from_rotation, rotation_from_quaternion
from .clock import Clock, is_left_at, scene_times, shots_of
from .keys import Keyframe, ObjectPoint
from .lens import lens_of
from .pieces import Hanging, Motion, Piece, Places, Targets, positions_at
from .rotations import Horizon, RotationSpline, camera_rotations, headings_of, rotation_spline
from .splines import STEEPEST, Array, catmull_rom, monotone_cubic
from .springs import follow_spring

SPRING_STEP = 1 / 240  # seconds
CLOSEST_S = 1e-12  # keyframes
LONGEST_FOLLOW_S = 3600.0  # of a shot: a place of the object is asked for at every step


class _Part:
    """Keyframes first, ... of a path that are one piece. times: [n] of nodes, two for a hold; key: [n] keyframe of a node, from
    0; rests: [n]."""

    def __init__(self, path: CameraPath, first: int, end: int, shot: int):
        self.path, self.first, self.shot = path, first, shot
        self.keys = path.keyframes[first:end]
        holds = np.array([key.hold for key in self.keys])
        arrives = np.array([key.time for key in self.keys])
        self.key = np.repeat(np.arange(len(self.keys)), 1 + (arrives + holds > arrives))
        second = np.concatenate([[False], self.key[1:] == self.key[:-1]])
        self.times = arrives[self.key] + np.where(second, holds[self.key], 0.0)
        self.rests = holds[self.key] > 0
        gaps = self.times[1:] - self.times[:-1]
        if gaps.min(initial=np.inf) < CLOSEST_S:
            close = np.flatnonzero(gaps < CLOSEST_S)
            problem = f"follows {gaps[close[0]]:g} s after what precedes it: less than {CLOSEST_S:g} s"
            raise InputError(problem, file="camera path", field=self.field(self.key[close[0] + 1], "time"))

    def field(self, key: int, name: str) -> str:
        return f"keyframes.{self.first + key}.{name}"


def keyframe_pieces(path: CameraPath, horizon: Horizon, clock: Clock, places: Places, frames_of=None) -> Iterator[Piece]:
    """frames_of: of an object's name and times [t] of the scene to its rigid matrices [t, 4, 4]; for paths that follow."""
    shots = shots_of(path)
    begins = [0] + [k for k in range(1, len(path.keyframes)) if _begins_piece(path.keyframes[k - 1], path.keyframes[k])]
    hanging = {}
    for first, end in zip(begins, [*begins[1:], len(path.keyframes)], strict=True):
        part = _Part(path, first, end, shots[first])
        if path.follow is None:
            position = _travel(part)
        else:
            if part.shot not in hanging:
                hanging[part.shot] = _hang(part, clock, frames_of)
            position = hanging[part.shot]
        yield _piece(part, position, horizon, places)


def _begins_piece(before: Keyframe, key: Keyframe) -> bool:
    """After a cut, or where no time passes between the hold before and this keyframe."""
    return key.cut or is_left_at(before, key)


def _piece(part: _Part, position: Motion | Hanging, horizon: Horizon, places: Places) -> Piece:
    end = float(part.times[-1])
    if part.path.follow is not None:
        after = part.first + len(part.keys)
        end = part.path.keyframes[after].time if after < len(part.path.keyframes) else end_of(part.path)
    lens = np.array([lens_of(part.path, key) for key in part.keys])[part.key]
    keys = {
        "begin": float(part.times[0]),
        "end": end,
        "shot": part.shot,
        "knots": part.times,
        "fields": tuple(f"keyframes.{part.first + key}" for key in part.key),
        "position": position,
        "lens": monotone_cubic(part.times, lens),
    }
    if not any(key.quaternion for key in part.keys):
        return Piece(view=_targets(part, places), **keys)
    return Piece(view=_turns(part, Piece(view=None, **keys), horizon, places), **keys)


def _travel(part: _Part) -> Motion:
    curve, index = catmull_rom(np.array([key.position for key in part.keys], dtype=float))
    index = index[part.key]
    timing = monotone_cubic(part.times, curve.lengths[index], part.rests | curve.turns[index])
    if len(part.keys) == 1:
        return Motion(curve=curve, timing=timing)
    means = np.diff(timing.values) / np.diff(part.times)
    for node, key in enumerate(part.key):
        speed = part.keys[key].speed
        if speed is None or part.rests[node]:
            continue
        if speed > 0 and curve.turns[index[node]] and len(curve.table):
            raise InputError("not 0 where the way turns straight back", file="camera path", field=part.field(key, "speed"))
        around = means[max(node - 1, 0) : node + 1]
        if len(around) and speed > STEEPEST * around.min() * (1 + 1e-9):
            problem = f"{speed:g} is more than {STEEPEST:g} times the neighbouring way's mean speed {around.min():g}"
            problem += ": the camera would run backwards"
            raise InputError(problem, file="camera path", field=part.field(key, "speed"))
        timing.slopes[node] = speed
    return Motion(curve=curve, timing=timing)


def _target(part: _Part, key: int, places: Places) -> tuple[str | None, Array]:
    """(object, point or offset) of a keyframe. What holds while the animation runs stands still: so does its target."""
    keyframe = part.keys[key]
    look = keyframe.look_at
    if look is None:
        look = ObjectPoint(object=part.path.follow.object)
    if not isinstance(look, ObjectPoint):
        return None, np.array(look, dtype=float)
    if keyframe.hold > 0 and keyframe.animation == "runs":
        return None, places(look.object, np.array([keyframe.time]))[0] + look.offset
    return look.object, np.array(look.offset, dtype=float)


def _targets(part: _Part, places: Places) -> Targets:
    targets = [_target(part, key, places) for key in range(len(part.keys))]
    switches = [k for k in range(1, len(targets)) if targets[k][0] != targets[k - 1][0]]
    runs = []
    for first, end in zip([0, *switches], [*switches, len(targets)], strict=True):
        nodes = np.flatnonzero((part.key >= first) & (part.key < end))
        rests = part.rests[nodes]
        rests[0] |= first > 0
        rests[-1] |= end < len(targets)
        curve, index = catmull_rom(np.array([point for _, point in targets[first:end]]))
        index = index[part.key[nodes] - first]
        timing = monotone_cubic(part.times[nodes], curve.lengths[index], rests | curve.turns[index])
        runs.append(Motion(curve=curve, timing=timing, anchor=targets[first][0]))
    return Targets(runs=tuple(runs))


def _turns(part: _Part, piece: Piece, horizon: Horizon, places: Places) -> RotationSpline:
    """Where any keyframe has a quaternion, what others look at counts at their times alone."""
    quaternions: list[Array | None] = []
    upright: list[tuple[int, Array]] = []  # look straight up or down: their heading is a neighbour's
    for k, key in enumerate(part.keys):
        if key.quaternion is not None:
            quaternions.append(np.array(key.quaternion) / np.linalg.norm(key.quaternion))
            continue
        time = np.array([key.time])
        anchor, point = _target(part, k, places)
        target = point if anchor is None else point + places(anchor, time)[0]
        away = target - positions_at(piece, time, places)[0]
        if not np.linalg.norm(away) > 0:
            raise InputError("is the camera's own position", file="camera path", field=part.field(k, "look_at"))
        forward = away[None] / np.linalg.norm(away)
        if np.linalg.norm(np.cross(forward[0], horizon.up)) < 1e-6:
            upright.append((k, forward))
            quaternions.append(None)
        else:
            quaternions.append(quaternion_from_rotation(camera_rotations(forward, headings_of(forward, horizon), horizon)[0]))
    for k, forward in upright:
        near = next((q for q in [*quaternions[:k][::-1], *quaternions[k:]] if q is not None), np.array([1.0, 0, 0, 0]))
        right = rotation_from_quaternion(near)[:, 0]
        heading = np.arctan2(right @ horizon.ahead, right @ horizon.right)
        quaternions[k] = quaternion_from_rotation(camera_rotations(forward, np.array([heading]), horizon)[0])
    return rotation_spline(part.times, np.array(quaternions)[part.key], part.rests)


def _hang(part: _Part, clock: Clock, frames_of) -> Hanging:
    """The spring of a shot. Its time is the animation's, which stands in holds."""
    follow = part.path.follow
    keys = part.path.keyframes
    cut = next((keys[k].time for k in range(part.first + 1, len(keys)) if keys[k].cut), end_of(part.path))
    begin, end = scene_times(clock, np.array([part.times[0], cut]))
    if end - begin > LONGEST_FOLLOW_S:
        problem = f"a shot that follows lasts at most {LONGEST_FOLLOW_S:g} s, not {end - begin:g}"
        raise InputError(problem, file="camera path", field=f"keyframes.{part.first}")
    times = begin + SPRING_STEP * np.arange(int(np.ceil((end - begin) / SPRING_STEP)) + 2)
    frames = frames_of(follow.object, times)
    offset = np.array(follow.offset, dtype=float)
    targets = frames[:, :3, 3] + (frames[:, :3, :3] @ offset if follow.offset_space == "object" else offset)
    spring = follow_spring(targets, SPRING_STEP, follow.stiffness, follow.damping_ratio)

    def seconds(t: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.maximum(scene_times(clock, t) - begin, 0.0)

    return Hanging(spring=spring, seconds=seconds)
