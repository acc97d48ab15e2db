"""From moves to pieces of a camera track, each checked to begin where and as fast as the one before ended."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..camera_path import CameraPath, move_times
from ..errors import InputError
from ..transforms import quaternion_from_rotation
from .clock import shots_of
from .keys import ObjectPoint, Target
from .lens import lens_of
from .moves import Dolly, FlyThrough, Hold, Move, Orbit, Pan
from .pieces import Ahead, Angles, Motion, Piece, Places, Targets, headings_of_piece, positions_at, rotations_of
from .rotations import Horizon, direction_of, multiply, turn_of_quaternion
from .splines import Array, Cubic, catmull_rom, hermite_curve, monotone_cubic

ORBIT_STEP_DEG = 1.0  # between points of an orbit's curve: 3e-10 of the radius off the circle
SHORTEST = 1e-12  # seconds of a move, and share of the time at which it ends
MOMENT = 1e-6  # of a move's duration, over which velocities are taken


@dataclass(frozen=True, kw_only=True)
class _End:
    """Where a move ended: position [3], heading and elevation in radians."""

    position: Array
    yaw: float
    pitch: float


def move_pieces(path: CameraPath, horizon: Horizon, places: Places) -> Iterator[Piece]:
    """Raises InputError that names the move where one does not go on where and as fast as the one before ended."""
    times, shots = move_times(path), shots_of(path)
    lenses = _lenses(path, times, shots)
    last, held = None, False
    for k, move in enumerate(path.moves):
        if times[k + 1] - times[k] < SHORTEST * max(1.0, times[k + 1]):
            raise InputError(f"lasts {move.seconds:g} s: too short", file="camera path", field=f"moves.{k}")
        if isinstance(move, Hold):
            _check_rest(last, k, horizon, places)
            held = True
            continue
        joined = last is not None and not move.cut
        end = _end_of(last, horizon, places) if joined else None
        begin, until = times[k], times[k + 1]
        curve, lengths, anchor = _way(move, end, horizon, k)
        piece = Piece(
            begin=begin,
            end=until,
            shot=shots[k],
            knots=np.array([begin, until]),
            fields=(f"moves.{k}", f"moves.{k}"),
            position=Motion(curve=curve, timing=_eased(move, begin, until, lengths), anchor=anchor),
            view=_view(move, end, curve, begin, until),
            lens=lenses[shots[k]],
        )
        if joined:
            _check_joint(last, piece, held, k, horizon, places)
        last, held = piece, False
        yield piece


def _lenses(path: CameraPath, times: list[float], shots: list[int]) -> list[Cubic]:
    """One for each shot: every move's end has its own, the shot's begin that of its first move."""
    lenses = []
    for shot in range(shots[-1] + 1):
        inside = [k for k, of in enumerate(shots) if of == shot]
        values, before = [], None
        for k in inside:
            before = lens_of(path, path.moves[k], before)
            values.append(before)
        nodes = np.array([times[inside[0]], *[times[k + 1] for k in inside]])
        lenses.append(monotone_cubic(nodes, np.array([values[0], *values])))
    return lenses


def _eased(move: Move, begin: float, end: float, values: Array) -> Cubic:
    """From the first to the last of two values [2] or [2, components]: at constant rate, or from rest to rest."""
    slopes = np.repeat(np.diff(values, axis=0) / (end - begin), 2, axis=0)
    return Cubic(times=np.array([begin, end]), values=values, slopes=slopes if move.ease == "none" else 0 * slopes)


def _way(move: Move, end: _End | None, horizon: Horizon, index: int):
    """(curve, arc length at begin and end [2], object that it goes along with)."""
    if isinstance(move, Orbit):
        anchor, centre = _anchored(move.center)
        curve = _circle(move, centre, horizon)
        return curve, curve.lengths[[0, -1]], anchor
    if isinstance(move, FlyThrough):
        curve, _ = catmull_rom(np.array(move.points, dtype=float))
        if curve.turns.any():
            raise InputError("turn straight back", file="camera path", field=f"moves.{index}.points")
        return curve, curve.lengths[[0, -1]], None
    name = "position" if isinstance(move, Pan) else "from_position"
    begin = getattr(move, name)
    if begin is None and end is None:
        raise InputError("is missing: there is no move before", file="camera path", field=f"moves.{index}.{name}")
    first = end.position if begin is None else np.array(begin, dtype=float)
    last = first if isinstance(move, Pan) else np.array(move.to_position, dtype=float)
    curve, _ = catmull_rom(np.stack([first, last]))
    return curve, curve.lengths[[0, -1]], None


def _circle(move: Orbit, centre: Array, horizon: Horizon):
    """Hermite segments with the circle's or helix' own tangents."""
    count = max(math.ceil(abs(move.to_deg - move.from_deg) / ORBIT_STEP_DEG), 1)
    span, elevation = math.radians(move.to_deg - move.from_deg), math.radians(move.elevation_deg)
    share = np.linspace(0.0, 1.0, count + 1)
    yaw = math.radians(move.from_deg) + span * share
    out, along = -direction_of(yaw, 0 * yaw, horizon), -direction_of(yaw + math.pi / 2, 0 * yaw, horizon)
    flat = move.radius * math.cos(elevation)
    height = move.radius * math.sin(elevation) + move.rise * share
    points = centre + flat * out + height[:, None] * horizon.up
    if span == 0 and move.rise == 0:
        points, share = points[:1], share[:1]
    return hermite_curve(share, points, (flat * span * along + move.rise * horizon.up)[: len(points)])


def _anchored(target: Target) -> tuple[str | None, Array]:
    if isinstance(target, ObjectPoint):
        return target.object, np.array(target.offset, dtype=float)
    return None, np.array(target, dtype=float)


def _view(move: Move, end: _End | None, curve, begin: float, until: float):
    if isinstance(move, FlyThrough) and move.look == "ahead":
        return Ahead(distance=move.look_ahead or float(curve.lengths[-1]) / 20)
    look = {Orbit: "center", FlyThrough: "look", Dolly: "look_at"}.get(type(move))
    target = getattr(move, look) if look else None
    if target is not None:
        anchor, point = _anchored(target)
        return Targets(runs=(Motion(curve=catmull_rom(point[None])[0], timing=_still(begin), anchor=anchor),))
    before = (end.yaw, end.pitch) if end is not None else (0.0, 0.0)
    prefix = "from_" if isinstance(move, Pan) else ""
    first = [_or(getattr(move, prefix + key), value) for key, value in zip(("yaw_deg", "pitch_deg"), before, strict=True)]
    last = first
    if isinstance(move, Pan):
        last = [_or(value, start) for value, start in zip((move.to_yaw_deg, move.to_pitch_deg), first, strict=True)]
    return Angles(angles=_eased(move, begin, until, np.array([first, last])))


def _or(degrees: float | None, radians: float) -> float:
    return radians if degrees is None else math.radians(degrees)


def _still(time: float) -> Cubic:
    return monotone_cubic(np.array([time]), np.zeros(1))


def _rotation(piece: Piece, time: float, horizon: Horizon, places: Places) -> Array:
    times = np.array([time])
    return rotations_of(piece, times, horizon, places, lambda: headings_of_piece(piece, horizon, places))[0]


def _end_of(piece: Piece, horizon: Horizon, places: Places) -> _End:
    rotation = _rotation(piece, piece.end, horizon, places)
    position = positions_at(piece, np.array([piece.end]), places)[0]
    if isinstance(piece.view, Angles):  # a heading of several turns stays one
        return _End(position=position, yaw=piece.view.angles.values[-1, 0], pitch=piece.view.angles.values[-1, 1])
    right, forward = rotation[:, 0], -rotation[:, 2]
    heading = math.atan2(right @ horizon.ahead, right @ horizon.right)
    return _End(position=position, yaw=heading, pitch=math.asin(max(-1.0, min(1.0, float(forward @ horizon.up)))))


def _pose(piece: Piece, at_end: bool, horizon: Horizon, places: Places):
    """(position, rotation, velocity, angular velocity) at an end of a piece."""
    moment = MOMENT * (piece.end - piece.begin)
    time, inside = (piece.end, piece.end - moment) if at_end else (piece.begin, piece.begin + moment)
    here, there = positions_at(piece, np.array([time, inside]), places)
    rotations = [_rotation(piece, t, horizon, places) for t in (time, inside)]
    turn = _turn(*rotations)
    sign = -1 if at_end else 1
    return here, rotations[0], sign * (there - here) / moment, sign * turn / moment


def _turn(a: Array, b: Array) -> Array:
    """Rotation vector from one rotation to another, in world axes."""
    first, second = quaternion_from_rotation(a), quaternion_from_rotation(b)
    return turn_of_quaternion(multiply(second, first * [1.0, -1, -1, -1]))


def _tracks(piece: Piece) -> bool:
    """Whether it goes along with an object, whose own velocity a hold stops."""
    runs = piece.view.runs if isinstance(piece.view, Targets) else ()
    return any(motion.anchor is not None for motion in (piece.position, *runs))


def _check_rest(last: Piece, index: int, horizon: Horizon, places: Places) -> None:
    if not _tracks(last):
        _, _, velocity, rate = _pose(last, True, horizon, places)
        _refuse_jump(last, last, velocity, 0 * velocity, rate, 0 * rate, index)


def _check_joint(last: Piece, piece: Piece, held: bool, index: int, horizon: Horizon, places: Places) -> None:
    a, b = _pose(last, True, horizon, places), _pose(piece, False, horizon, places)
    scale = np.linalg.norm(a[0]) + np.linalg.norm(b[0]) + _length(last) + _length(piece)
    if np.linalg.norm(a[0] - b[0]) > 1e-6 * scale:
        text = f"begins at {_text(b[0])}, yet the move before ends at {_text(a[0])}: let it begin there, or give it cut"
        raise InputError(text, file="camera path", field=f"moves.{index}")
    angle = math.degrees(float(np.linalg.norm(_turn(a[1], b[1]))))
    if angle > 1e-3:
        text = (
            f"begins {angle:.3g} degrees away from where the move before looks at its end: let it go on there, or give it cut"
        )
        raise InputError(text, file="camera path", field=f"moves.{index}")
    if held and _tracks(last):
        return
    before = (0 * a[2], 0 * a[3]) if held else (a[2], a[3])
    _refuse_jump(last, piece, before[0], b[2], before[1], b[3], index)


def _refuse_jump(last: Piece, piece: Piece, before: Array, after: Array, rate: Array, rate_after: Array, index: int) -> None:
    """Velocities over a MOMENT err by a share of the mean ones, and by rounding."""
    moment = MOMENT * min(last.end - last.begin, piece.end - piece.begin)
    mean = sum(_length(p) / (p.end - p.begin) for p in (last, piece))
    reach = max(np.abs(p.position.curve.points).max() for p in (last, piece))
    allowed = 1e-2 * max(np.linalg.norm(before), np.linalg.norm(after)) + 1e-4 * mean + 1e-14 * reach / moment
    allowed_rate = 1e-2 * max(np.linalg.norm(rate), np.linalg.norm(rate_after)) + 1e-3 + 1e-14 / moment
    if np.linalg.norm(after - before) > allowed:
        what = f"speed jumps from {np.linalg.norm(before):.3g} to {np.linalg.norm(after):.3g} units/s"
    elif np.linalg.norm(rate_after - rate) > allowed_rate:
        what = "turning jumps from {:.3g} to {:.3g} degrees/s".format(
            *np.degrees([np.linalg.norm(r) for r in (rate, rate_after)])
        )
    else:
        return
    problem = f"the camera's {what} or changes its direction here: ease both moves in_out, or give this one cut"
    raise InputError(problem, file="camera path", field=f"moves.{index}")


def _length(piece: Piece) -> float:
    return float(piece.position.curve.lengths[-1])


def _text(point: Array) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in point) + "]"
