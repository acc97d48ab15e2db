"""Holds of a camera path: when the camera stands still, and what the time of the scene's animation is meanwhile."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera_path import CameraPath, move_times
from .keys import Keyframe
from .moves import Hold
from .splines import Array


@dataclass(frozen=True, kw_only=True)
class Clock:
    """One entry per hold: arrives, leaves: seconds of the path. paused: seconds for which it stops the animation, 0 where that
    runs. before: the sum of those of earlier holds. shots: its shot. cut: whether a new shot begins
    when it leaves, so that this time is no longer its own."""

    arrives: Array
    leaves: Array
    paused: Array
    before: Array
    shots: NDArray[np.int64]
    cut: NDArray[np.bool_]


def clock_of(path: CameraPath) -> Clock:
    if path.moves:
        begins = move_times(path)
        holds = [(begins[k], move.duration, move) for k, move in enumerate(path.moves) if isinstance(move, Hold)]
    else:
        holds = [(key.time, key.hold, key) for key in path.keyframes if key.hold > 0]
    shots = dict(zip(map(id, path.keyframes or path.moves), shots_of(path), strict=False))
    stops = path.keyframes or path.moves
    cut = {
        id(stop): after.cut and (bool(path.moves) or is_left_at(stop, after))
        for stop, after in zip(stops, stops[1:], strict=False)
    }
    paused = np.array([duration if keys.animation == "stops" else 0.0 for _, duration, keys in holds])
    return Clock(
        arrives=np.array([begin for begin, _, _ in holds]),
        leaves=np.array([begin + duration for begin, duration, _ in holds]),
        paused=paused,
        before=np.concatenate([[0.0], np.cumsum(paused)])[:-1] if len(paused) else paused,
        shots=np.array([shots[id(keys)] for _, _, keys in holds], dtype=np.int64),
        cut=np.array([cut.get(id(keys), False) for _, _, keys in holds], dtype=bool),
    )


def shots_of(path: CameraPath) -> list[int]:
    """The shot of each keyframe, pose or move."""
    stops = path.keyframes or path.poses or path.moves
    cuts = np.cumsum([k > 0 and stop.cut for k, stop in enumerate(stops)])
    return [int(shot) for shot in cuts]


def slack(time: float | Array) -> float | Array:
    """A frame's time i / fps and a stop's decimal time may differ in the last digits: so near, they are the same."""
    return 1e-9 * np.maximum(1.0, np.abs(time))


def is_left_at(before: Keyframe, key: Keyframe) -> bool:
    """Whether no time passes between what a keyframe holds for and the next keyframe."""
    leaves = before.time + before.hold
    return bool(key.time <= leaves + slack(leaves)) and before.hold > 0


def scene_times(clock: Clock, times: Array) -> Array:
    """Times of the animation at times of the path: constant, to the last bit, while a hold stops it."""
    if len(clock.arrives) == 0:
        return np.asarray(times)
    hold = np.searchsorted(clock.arrives, times + slack(times), side="right") - 1
    arrived, hold = hold >= 0, np.maximum(hold, 0)
    stands = arrived & (clock.paused[hold] > 0) & (times <= clock.leaves[hold] + slack(times))
    running = times - np.where(arrived, clock.before[hold] + clock.paused[hold], 0.0)
    return np.where(stands, clock.arrives[hold] - clock.before[hold], running)


def at_rest(clock: Clock, time: float) -> float:
    """The time itself, or in a hold its begin: so all of a hold is one time."""
    if len(clock.arrives) == 0:
        return time
    hold = int(np.searchsorted(clock.arrives, time + slack(time), side="right")) - 1
    if hold < 0:
        return time
    near = float(slack(time))
    leaves = float(clock.leaves[hold])
    inside = time < leaves - near if clock.cut[hold] else time <= leaves + near
    return float(clock.arrives[hold]) if inside else time


def rests_around(clock: Clock, time: float, shot: int) -> tuple[float | None, float | None]:
    """End of the last hold before and begin of the next one after, of the same shot; None where there is none. In a hold: its
    begin and that again."""
    first, last = np.searchsorted(clock.shots, [shot, shot + 1])
    arrives, leaves = clock.arrives[first:last], clock.leaves[first:last]
    after = int(np.searchsorted(arrives, time, side="left"))
    if after < len(arrives) and arrives[after] == time:
        return time, time
    return (float(leaves[after - 1]) if after else None), (float(arrives[after]) if after < len(arrives) else None)
