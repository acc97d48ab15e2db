"""How figures move: walk cycles whose feet stand still on the ground, and people who stand, talk and sit.

A pose is {joint: rotation [3, 3] against its parent} with the hips' place. Legs come from the feet by inverse kinematics.
"""

from dataclasses import dataclass

import numpy as np
from scenes.making.gltf_values import about

from .skeleton import ARM_ANGLE, PARENT

KEYS = 16  # per cycle


@dataclass(frozen=True)
class Gait:
    """A way to walk. stride: metres of one cycle of two steps, for legs of an adult of 1.75 m; period: seconds.

    stance: share of the cycle that a foot is on the ground. arms: degrees of swing. elbow: least bend. lean: of the trunk.
    sway, bob: metres of the hips. width: share of the hips' width between the feet. toes: degrees that they point outwards.
    """

    stride: float = 1.3
    period: float = 1.05
    stance: float = 0.61
    arms: float = 22
    elbow: float = 14
    lean: float = 3
    sway: float = 0.022
    bob: float = 0.017
    roll: float = 4
    twist: float = 6
    width: float = 0.75
    toes: float = 6


GAITS = {
    "stroll": Gait(1.2, 1.16, 0.63, 17, 12, 1, 0.026),
    "brisk": Gait(1.45, 0.98, 0.59, 30, 26, 5, 0.018, 0.021, 3.5, 8),
    "sway": Gait(1.22, 1.04, 0.61, 20, 16, 1, 0.032, 0.016, 6.5, 9, 0.35, 3),
    "heavy": Gait(1.14, 1.14, 0.64, 15, 18, 2, 0.036, 0.014, 3, 5, 1.05, 13),
    "elder": Gait(0.86, 1.12, 0.68, 9, 28, 8, 0.024, 0.009, 2, 3, 0.95, 10),
    "child": Gait(1.3, 0.84, 0.57, 34, 22, 3, 0.02, 0.03, 4, 9, 0.8, 4),
}


def walk(gait: Gait, places: dict[str, np.ndarray], height: float) -> list[dict]:
    """KEYS poses of one cycle, the left heel strikes at the first. The body moves by stride x height per cycle."""
    rough = [_walk_pose(gait, places, height, k / KEYS, None) for k in range(KEYS)]
    lift = max(pose["short"] for pose in rough)  # so that no leg is ever too short for its foot
    return [_walk_pose(gait, places, height, k / KEYS, lift) for k in range(KEYS)]


def _walk_pose(gait: Gait, places, h: float, p: float, lower: float | None) -> dict:
    turn = 2 * np.pi * p
    pelvis = about("y", -gait.twist * np.cos(turn)) @ about("z", gait.roll * np.sin(turn)) @ about("x", gait.lean * 0.4)
    place = places["hips"] + np.array([gait.sway * np.sin(turn), -gait.bob * np.cos(2 * turn + 0.5), 0]) * h
    place = place - [0, (gait.bob + (lower or 0.0)), 0]
    pose = {"hips_at": place, "hips": pelvis}
    short = 0.0
    for side, at in (("l", p), ("r", (p + 0.5) % 1)):
        sign = 1 if side == "l" else -1
        ankle, pitch, bend = _foot(gait, places, h, at, side)
        short = max(short, _leg(pose, places, side, ankle, about("y", sign * gait.toes) @ about("x", pitch)))
        pose[f"toe_{side}"] = about("x", bend)
    pose["short"] = short
    chest = about("y", 0.8 * gait.twist * np.cos(turn)) @ about("z", -0.35 * gait.roll * np.sin(turn)) @ about("x", gait.lean)
    half = about("y", 0) @ about("z", -0.25 * gait.roll * np.sin(turn)) @ about("x", gait.lean * 0.6)
    pose["spine"], pose["chest"] = pelvis.T @ half, half.T @ chest
    pose["neck"] = about("y", -0.4 * gait.twist * np.cos(turn))
    pose["head"] = about("x", -gait.lean + 1.5 * np.cos(2 * turn)) @ about("y", -0.3 * gait.twist * np.cos(turn))
    pose["tail"] = about("x", 7 + 5 * np.cos(2 * turn - 1.2)) @ about("z", 4 * np.sin(turn - 0.9))
    for side, sign in (("l", 1), ("r", -1)):
        swing = sign * gait.arms * np.cos(turn - 0.2) - 0.12 * gait.arms
        bend = gait.elbow * (1 + 0.55 * -sign * np.cos(turn - 0.55))
        pose |= hanging_arm(side, swing, bend)
    return pose


def hanging_arm(side: str, swing: float, bend: float, away: float = 9) -> dict:
    """An arm that hangs: swing is degrees backwards, bend of the elbow forwards, away from the body."""
    sign = 1 if side == "l" else -1
    return {
        f"arm_{side}": about("x", swing) @ about("z", -sign * (ARM_ANGLE - away)),
        f"forearm_{side}": about("z", sign * (ARM_ANGLE - 4)).T
        @ about("x", -bend)
        @ about("z", sign * (ARM_ANGLE - 4))
        @ about("z", -sign * 5),
        f"hand_{side}": about("z", sign * 3),
    }


def reaching_arm(side: str, up: float, out: float, bend: float, inward: float = 0) -> dict:
    """An arm raised forwards by `up` degrees and outwards by `out`, the forearm bent up by `bend`, turned inwards."""
    sign = 1 if side == "l" else -1
    lower = about("z", -sign * (ARM_ANGLE - 4))
    return {
        f"arm_{side}": about("x", -up) @ about("z", sign * out) @ lower,
        f"forearm_{side}": lower.T @ about("y", -sign * inward) @ about("x", -bend) @ lower,
        f"hand_{side}": np.eye(3),
    }


def _foot(gait: Gait, places, h: float, p: float, side: str):
    """(ankle [3], pitch of the foot, bend of the toes) at phase p after its heel's strike, in the body's moving frame."""
    if p <= gait.stance:
        ankle, pitch, bend = _standing(gait, places, h, p)
    else:
        step = 1e-4
        start, lift_off, bend = _standing(gait, places, h, gait.stance)
        before = _standing(gait, places, h, gait.stance - step)[0]
        end, strike, _ = _standing(gait, places, h, 0.0)
        after = _standing(gait, places, h, step)[0]
        span = 1 - gait.stance
        u = (p - gait.stance) / span
        a, b = 2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u
        c, d = 3 * u**2 - 2 * u**3, u**3 - u**2
        ankle = a * start + b * span * (start - before) / step + c * end + d * span * (after - end) / step
        ankle = ankle + np.array([0, 0.035 * h * np.sin(np.pi * u) ** 2, 0])
        ease = u * u * (3 - 2 * u)
        pitch, bend = lift_off * (1 - ease) + strike * ease - 8 * np.sin(np.pi * u), bend * (1 - u) ** 2
    sign = 1 if side == "l" else -1
    x = sign * places["thigh_l"][0] * gait.width
    return np.array([x, ankle[1], ankle[2]]), pitch, bend


def _standing(gait: Gait, places, h: float, p: float):
    """As `_foot` while it is on the ground: on the heel, flat, then on the ball of the foot."""
    stride = gait.stride * h
    flat = places["foot_l"] * [0, 1, 1] + [0, 0, stride * (0.285 - p)]
    heel, ball = np.array([0, 0, -0.062 * h]), np.array([0, 0, places["toe_l"][2]])
    shift = np.array([0, 0, flat[2] - places["foot_l"][2]])
    strike = -19 * (1 - min(p / 0.09, 1)) ** 1.5
    rise = 44 * (max(p - 0.33, 0) / (gait.stance - 0.33)) ** 1.7
    if strike < 0:
        ankle = shift + heel + about("x", strike) @ (flat - shift - heel)
        return ankle, strike, 0.0
    ankle = shift + ball + about("x", rise) @ (flat - shift - ball)
    return ankle, rise, -min(rise, 40.0)


def _leg(pose: dict, places, side: str, ankle: np.ndarray, foot: np.ndarray) -> float:
    """Writes thigh, shin and foot so that the ankle is at its place; how much the leg is too short, metres."""
    hip = pose["hips_at"] + pose["hips"] @ (places[f"thigh_{side}"] - places["hips"])
    upper, lower = (places[f"shin_{side}"] - places[f"thigh_{side}"]), (places[f"foot_{side}"] - places[f"shin_{side}"])
    reach = ankle - hip
    side_angle = np.degrees(np.arctan2(reach[0], -reach[1]))
    y, z = -np.hypot(reach[0], reach[1]), reach[2]
    a, b = np.linalg.norm(upper[1:]), np.linalg.norm(lower[1:])
    full = np.hypot(y, z)
    distance = min(full, (a + b) * 0.9985)
    knee = np.arccos(np.clip((a * a + distance**2 - b * b) / (2 * a * distance), -1, 1))
    towards = np.arctan2(z, -y)
    first = towards + knee  # of the thigh, forwards from straight down
    tip = np.array([-np.cos(first), np.sin(first)]) * a
    rest = np.array([y, z]) * distance / full - tip
    second = np.arctan2(rest[1], -rest[0])
    bind_first, bind_second = np.arctan2(upper[2], -upper[1]), np.arctan2(lower[2], -lower[1])
    lateral = about("z", side_angle)
    thigh = lateral @ about("x", -np.degrees(first - bind_first))
    shin = lateral @ about("x", -np.degrees(second - bind_second))
    pose[f"thigh_{side}"], pose[f"shin_{side}"] = pose["hips"].T @ thigh, thigh.T @ shin
    pose[f"foot_{side}"] = shin.T @ foot
    return full - (a + b) * 0.9985


def stand(places, h: float, t: float, seed: int, talk: float = 0.0) -> dict:
    """Somebody who stands, of period 4 s: weight shifts, head turns, the more hands the more `talk`."""
    turn, s = 2 * np.pi * t / 4, seed * 1.7
    side = np.sin(turn + s)
    pose = {"hips_at": places["hips"] + np.array([0.03 * side, -0.022 + 0.003 * np.cos(2 * turn), 0.006]) * h}
    pose["hips"] = about("z", 2.5 * side) @ about("y", 5 * np.sin(turn + s + 0.6))
    for leg, sign in (("l", 1), ("r", -1)):
        forward = 0.05 * sign * (1 if seed % 2 else -1)
        foot = places[f"foot_{leg}"] * [1.25, 1, 1] + [0, 0, forward * h]
        _leg(pose, places, leg, foot, about("y", sign * 14))
        pose[f"toe_{leg}"] = np.eye(3)
    pose["spine"] = about("z", -2 * side) @ about("x", 1.5 + 0.5 * np.sin(2 * turn))
    pose["chest"] = about("y", -6 * np.sin(turn + s + 0.2)) @ about("x", 1.0 * np.sin(2 * turn + 1))
    pose["neck"] = about("y", 7 * np.sin(turn + s + 1.1))
    pose["head"] = (
        about("x", 3 * np.sin((2 + 2 * (talk > 0)) * turn + s)) @ about("y", 9 * np.sin(turn + 0.5 * s)) @ about("z", 3 * side)
    )
    pose["tail"] = about("x", 2 * np.sin(turn))
    pose |= hanging_arm("l", -3 + 3 * side, 14 + 4 * np.sin(turn), 11) | hanging_arm("r", -3 - 3 * side, 16, 11)
    if talk:
        beat = np.sin(2 * turn + s) + 0.5 * np.sin(3 * turn)
        pose |= reaching_arm("r", 24 + 9 * talk * beat, 10, 74 + 20 * talk * beat, 18 + 14 * np.sin(turn))
        if seed % 2:
            pose |= reaching_arm("l", 18 + 7 * talk * np.sin(2 * turn), 8, 80 + 16 * talk * np.sin(3 * turn + s), 25)
    return pose


def sit(places, h: float, t: float, seat: float, seed: int) -> dict:
    """Somebody who sits on something of height `seat`, metres, and reads what lies in the hands; of period 4 s."""
    turn, s = 2 * np.pi * t / 4, seed * 1.1
    pose = {"hips_at": np.array([0, seat + 0.1 * h, -0.02]), "hips": about("x", -6)}
    for leg, sign in (("l", 1), ("r", -1)):
        foot = places[f"foot_{leg}"] * [1.0, 1, 1] + [0.02 * sign, 0, (0.41 + 0.05 * sign) * h]
        _leg(pose, places, leg, foot, about("y", sign * 10))
        pose[f"toe_{leg}"] = np.eye(3)
    pose["spine"] = about("x", 8 + 0.8 * np.sin(turn))
    pose["chest"] = about("x", 8) @ about("y", 2 * np.sin(turn))
    pose["neck"] = about("x", 10) @ about("y", 5 * np.sin(turn + s))
    pose["head"] = about("x", 8 + 4 * np.sin(turn + 1)) @ about("y", 8 * np.sin(turn + s))
    pose["tail"] = about("x", -50)
    pose |= reaching_arm("l", 30, 4, 66 + 2 * np.sin(turn), 32) | reaching_arm("r", 30, 4, 66 + 2 * np.sin(turn), 32)
    return pose


def in_world(pose: dict, places: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Matrices [4, 4] of all joints in the figure's space: the plain reference for whether feet stand still."""
    found = {"ground": np.eye(4)}
    for name, parent in PARENT.items():
        local = np.eye(4)
        local[:3, :3] = pose.get(name, np.eye(3))
        local[:3, 3] = pose["hips_at"] if name == "hips" else places[name] - places[parent]
        found[name] = found[parent] @ local
    return found
