"""Clothes and limbs: tops with sleeves, coats and dresses, trousers, legs, hands and shoes, each one surface of rings."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from .cloth import Cloth, Piece, step
from .skeleton import Build, joints_of

COLUMNS = 16
HOLE = (3, 4)  # columns of the torso's left arm; the right arm's are mirrored
HOLE_ROWS = (1.28, 1.332, 1.384, 1.43)
# height: half width, depth to the front, depth to the back, of an adult of 1.75 m
TORSO = np.array(
    [
        (0.30, 0.165, 0.125, 0.150),
        (0.80, 0.172, 0.106, 0.124),
        (0.90, 0.174, 0.108, 0.126),
        (0.98, 0.163, 0.110, 0.112),
        (1.08, 0.142, 0.106, 0.098),
        (1.18, 0.148, 0.114, 0.106),
        (1.28, 0.166, 0.122, 0.114),
        (1.34, 0.177, 0.120, 0.118),
        (1.40, 0.182, 0.104, 0.114),
        (1.44, 0.170, 0.082, 0.102),
        (1.470, 0.115, 0.066, 0.086),
        (1.490, 0.072, 0.058, 0.068),
        (1.540, 0.060, 0.056, 0.060),
    ]
)
LEG = PchipInterpolator(
    (0.06, 0.10, 0.18, 0.28, 0.38, 0.46, 0.50, 0.54, 0.60, 0.68, 0.80),
    (0.034, 0.034, 0.038, 0.049, 0.055, 0.051, 0.052, 0.055, 0.064, 0.075, 0.086),
)
ARM = PchipInterpolator(
    (0, 0.08, 0.15, 0.24, 0.29, 0.36, 0.46, 0.52, 0.56), (0.062, 0.057, 0.05, 0.043, 0.041, 0.04, 0.031, 0.028, 0.028)
)


@dataclass(frozen=True)
class Top:
    """hem: height of the lower edge as a share of an adult's 1.75 m; flare: metres by which it stands off there; ease: by which
    the cloth stands off the body; sleeve: share of the arm; cuff: ease of the sleeve's end; collar: metres up the neck;
    neckline: depth of a V in front, metres; placket: a strip down the front; belt: how far the waist is drawn in, metres."""

    hem: float = 0.86
    flare: float = 0.01
    ease: float = 0.012
    sleeve: float = 0.97
    cuff: float = 0.012
    collar: float = 0.02
    neckline: float = 0.0
    placket: bool = False
    belt: float = 0.0
    folds: float = 0.004


def torso_at(build: Build, y: np.ndarray, ease: float) -> np.ndarray:
    """[n, 3] half width, front and back depth at heights y in metres."""
    h = build.height
    rows = PchipInterpolator(TORSO[:, 0], TORSO[:, 1:])(np.clip(y / h, 0.3, 1.54))
    y = y / h
    hips, upper = step(1.05, 0.92, y), step(1.12, 1.36, y)
    wide = build.hips * hips + build.shoulders * upper + build.waist * (1 - hips - upper)
    neck = step(1.46, 1.49, y)
    wide = wide * (1 - neck) + (0.9 + 0.1 * build.limbs) * neck
    front = rows[:, 1] + build.bust * np.exp(-(((y - 1.285) / 0.062) ** 2)) + build.belly * np.exp(-(((y - 1.07) / 0.11) ** 2))
    deep = build.depth * (1 - neck) + neck
    return np.stack([rows[:, 0] * wide, front * deep, rows[:, 2] * deep], axis=1) * h + ease


def torso_ring(build: Build, y: float, ease: float, angles: np.ndarray, power: float = 2.35) -> np.ndarray:
    """Points [n, 3] around the body at height y; angle 0 is the front, a quarter turn the left."""
    width, front, back = torso_at(build, np.array([y]), ease)[0]
    s, c = np.sin(angles), np.cos(angles)
    x = np.sign(s) * np.abs(s) ** (2 / power) * width
    z = np.sign(c) * np.abs(c) ** (2 / power) * np.where(c > 0, front, back)
    return np.stack([x, np.full_like(x, y), z - 0.012 * build.height], axis=1)


def trunk_weights(build: Build, points: np.ndarray, skirt: float = 0.9) -> dict[str, np.ndarray]:
    """Of points around the trunk. skirt: how far what hangs below the hips follows the thighs."""
    h = build.height
    x, y, z = points[:, 0] / h, points[:, 1] / h, points[:, 2] / h
    spine, chest, neck = step(1.0, 1.12, y), step(1.13, 1.27, y), 0.7 * step(1.46, 1.54, y)
    leg = skirt * step(0.96, 0.70, y)
    tail = 0.55 * leg * step(0.02, -0.08, z)
    left = step(-0.07, 0.07, x)
    arm = 0.42 * step(0.14, 0.03, np.hypot(np.abs(x) - 0.185 * build.shoulders, y - 1.40)) * (y > 1.2)
    trunk = {
        "hips": (1 - spine) * (1 - leg),
        "tail": tail,
        "thigh_l": (leg - tail) * left,
        "thigh_r": (leg - tail) * (1 - left),
        "spine": spine * (1 - chest),
        "chest": chest * (1 - neck) * (1 - arm),
        "neck": chest * neck * (1 - arm),
    }
    return trunk | {"arm_l": chest * arm * (x > 0), "arm_r": chest * arm * (x <= 0)}


def top(build: Build, cut: Top, seed: int = 0) -> Piece:
    """A top, coat or dress with sleeves."""
    h, cloth = build.height, Cloth()
    angles = np.arange(COLUMNS) * 2 * np.pi / COLUMNS
    around = np.minimum(angles, 2 * np.pi - angles) / np.pi * 0.55 * h
    count = max(3, round((HOLE_ROWS[0] - cut.hem) / 0.1))
    heights = [*np.linspace(cut.hem, HOLE_ROWS[0], count + 1)[:-1], *HOLE_ROWS, 1.456, 1.476, 1.492, 1.50 + cut.collar]
    first = count  # row of the arm holes' lower edge

    def row(y: float, inwards: float = 0.0, shade=1.0) -> np.ndarray:
        ease = cut.ease + cut.flare * step(1.0, min(cut.hem, 0.95), y) - inwards
        ease -= cut.belt * np.exp(-(((y - 1.07) / 0.05) ** 2))
        ease = ease if y < 1.47 else 0.5 * cut.ease + 0.012 * (y > 1.495) - inwards
        points = torso_ring(build, y * h, ease * h, angles)
        hollow = 1 - 0.45 * np.exp(-(((y - 1.27) / 0.05) ** 2)) * np.clip(np.abs(np.sin(angles)) * 3 - 2, 0, 1)
        if cut.flare > 0.03:  # a skirt's folds
            wave = 0.4 * cut.flare * step(1.0, cut.hem, y) * np.cos(5 * angles + 0.7)
            points[:, [0, 2]] *= 1 + (wave / 0.17)[:, None]
        uv = np.stack([around, np.full(COLUMNS, y * h)], axis=1)
        return cloth.ring(points, uv, trunk_weights(build, points), hollow * shade)

    openings = {*HOLE, *(COLUMNS - 1 - k for k in HOLE)}
    lip = row(cut.hem + 0.03, 0.016, 0.35)
    rows = [row(y) for y in heights]
    cloth.bridge(lip, rows[0])
    for number, (low, high) in enumerate(zip(rows, rows[1:], strict=False)):
        is_hole = first <= number < first + len(HOLE_ROWS) - 1
        cloth.bridge(low, high, skip=openings.__contains__ if is_hole else None)
    cloth.bridge(rows[-1], row(heights[-1] - 0.012, 0.014, 0.4))
    for side in ("l", "r"):
        _sleeve(cloth, build, cut, rows[first : first + len(HOLE_ROWS)], side)
    if cut.placket:
        _placket(cloth, build, cut)
    return cloth.piece(cut.folds * h, seed)


def _placket(cloth: Cloth, build: Build, cut: Top) -> None:
    h, rings = build.height, []
    for y in np.linspace(cut.hem + 0.004, 1.47 - cut.neckline, 9):
        ease = cut.ease + cut.flare * step(1.0, min(cut.hem, 0.95), y) - cut.belt * np.exp(-(((y - 1.07) / 0.05) ** 2))
        x = np.array([-0.008, 0.0, 0.034, 0.036]) * h
        front = torso_ring(build, y * h, (ease + 0.004) * h, np.array([0.0]))[0]
        z = front[2] + np.array([-0.012, 0.003, 0.001, -0.014]) * h
        points = np.stack([x, np.full(4, y * h), z], axis=1)
        rings.append(cloth.ring(points, points[:, :2], trunk_weights(build, points), (0.55, 0.9, 0.9, 0.5)))
    for low, high in zip(rings, rings[1:], strict=False):
        cloth.bridge(low, high, closed=False)


def _sleeve(cloth: Cloth, build: Build, cut: Top, rows: list[np.ndarray], side: str) -> None:
    """From the ring of the arm hole along the arm. On the right everything is mirrored, and the rings run the other way."""
    h, places = build.height, joints_of(build)
    if side == "l":
        a, b, c = HOLE[0], HOLE[0] + 1, HOLE[0] + 2
    else:
        a, b, c = COLUMNS - HOLE[0], COLUMNS - HOLE[0] - 1, COLUMNS - HOLE[0] - 2
    hole = [
        rows[0][b],
        rows[0][a],
        rows[1][a],
        rows[2][a],
        rows[3][a],
        rows[3][b],
        rows[3][c],
        rows[2][c],
        rows[1][c],
        rows[0][c],
    ]
    angles = np.radians(-90 + 36 * np.arange(10))  # 0 is the front, a quarter turn away from the body
    last = np.array(hole)
    length = 0.535 * cut.sleeve
    spots = [s for s in (0.085, 0.15, 0.255, 0.32, 0.42) if s < length - 0.02] + [length]
    rings = [last]
    for s in [*spots, length - 0.015]:
        ending = len(rings) == len(spots) + 1
        radius = ARM(s) * build.limbs + cut.ease * 0.9 + cut.cuff * step(0.3, 0.52, s) - 0.01 * ending
        points, along = arm_ring(places, build, side, s, radius, angles)
        uv = np.stack([np.abs(np.degrees(angles)) / 180 * 0.2 * h, 1.4 * h - along], axis=1)
        shade = 0.4 if ending else np.where(np.sin(angles) < -0.3, 0.75, 1.0)
        rings.append(cloth.ring(points, uv, arm_weights(build, side, s, 10), shade))
    for inner, outer in zip(rings, rings[1:], strict=False):
        cloth.bridge(*((outer, inner) if side == "l" else (inner, outer)))


def arm_ring(places, build: Build, side: str, s: float, radius: float, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points around the arm at distance s (of an adult of 1.75 m) from the shoulder, and their distance in metres."""
    h, mirror = build.height, np.array([1 if side == "l" else -1, 1, 1])
    shoulder, elbow, wrist = (places[f"{name}_l"] for name in ("arm", "forearm", "hand"))
    forth = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    at = shoulder + forth * s * h if s < 0.29 else elbow + (wrist - elbow) / 0.245 * (s - 0.29)
    out = np.array([-forth[1], forth[0], 0])
    points = at + radius * h * (np.cos(angles)[:, None] * np.array([0, 0, 1.06]) + np.sin(angles)[:, None] * out)
    return points * mirror, np.full(len(angles), s * h)


def arm_weights(build: Build, side: str, s: float, count: int) -> dict[str, np.ndarray]:
    arm, fore, hand = step(-0.04, 0.1, s), step(0.25, 0.335, s), step(0.5, 0.56, s)
    one = np.ones(count)
    return {
        "chest": (1 - arm) * one,
        f"arm_{side}": arm * (1 - fore) * one,
        f"forearm_{side}": fore * (1 - hand) * one,
        f"hand_{side}": fore * hand * one,
    }


def leg_centre(build: Build, y: float) -> np.ndarray:
    places = joints_of(build)
    heights = [places[name][1] for name in ("foot_l", "shin_l", "thigh_l")]
    x, z = (np.interp(y, heights, [places[name][k] for name in ("foot_l", "shin_l", "thigh_l")]) for k in (0, 2))
    calf = -0.012 * build.height * np.exp(-(((y / build.height - 0.36) / 0.09) ** 2))
    return np.array([x, y, z + calf])


def leg_weights(build: Build, points: np.ndarray, side: str) -> dict[str, np.ndarray]:
    y = points[:, 1] / build.height
    thigh, shin, foot = step(0.97, 0.82, y), step(0.545, 0.455, y), step(0.11, 0.06, y)
    other = "r" if side == "l" else "l"
    shared = 0.5 * step(0.03, 0.0, np.abs(points[:, 0]) / build.height) * step(0.7, 0.78, y)
    return {
        "hips": 1 - thigh,
        f"thigh_{side}": thigh * (1 - shin) * (1 - shared),
        f"thigh_{other}": thigh * (1 - shin) * shared,
        f"shin_{side}": shin * (1 - foot),
        f"foot_{side}": shin * foot,
    }


def trousers(
    build: Build,
    ease: float,
    hem: float = 0.055,
    flare: float = 0.012,
    waist: float = 1.02,
    folds: float = 0.004,
    seed: int = 1,
) -> Piece:
    """Two legs that part at the crotch. ease: metres off the leg; hem: height of the ends."""
    h, cloth = build.height, Cloth()
    angles = np.arange(COLUMNS) * 2 * np.pi / COLUMNS
    around = np.minimum(angles, 2 * np.pi - angles) / np.pi * 0.55 * h
    last = None
    for y in (waist, 0.93, 0.84):
        points = torso_ring(build, y * h, 0.004 * h, angles)
        x, left = points[:, 0], step(-0.05, 0.05, points[:, 0])
        thigh = step(0.97, 0.78, y) * np.clip(np.abs(x) / (0.1 * h) + 0.3, 0, 1)
        weights = {
            "hips": 1 - thigh,
            "thigh_l": thigh * left,
            "thigh_r": thigh * (1 - left),
            "spine": 0 * x + step(1.0, 1.1, y),
        }
        ring = cloth.ring(points, np.stack([around, np.full(COLUMNS, y * h)], axis=1), weights)
        if last is not None:
            cloth.bridge(ring, last)
        last = ring
    crotch_points = np.array([(0, 0.795, z) for z in (0.055, 0.0, -0.055)]) * h
    crotch = cloth.ring(crotch_points, crotch_points[:, [2, 1]], {"hips": 0.5, "thigh_l": 0.25, "thigh_r": 0.25}, 0.5)
    half = COLUMNS // 2
    for side in ("l", "r"):
        mirror = np.array([1 if side == "l" else -1, 1, 1])
        start = np.concatenate([last[: half + 1], crotch[::-1]])
        if side == "r":
            start = np.concatenate([last[(-np.arange(half + 1)) % COLUMNS], crotch[::-1]])
        turn = np.radians(-30 + 30 * np.arange(12))
        rings, knee = [start], joints_of(build)["shin_l"][1] / h
        spots = [y for y in (0.755, 0.65, knee + 0.045, knee, knee - 0.045, 0.36, 0.22) if y > hem + 0.04]
        for y in [*spots, hem, hem + 0.02]:
            ending = len(rings) == len(spots) + 2
            radius = LEG(y) * build.limbs + ease * step(0.8, 0.6, y) + flare * step(0.35, 0.06, y) - 0.012 * ending
            centre = leg_centre(build, y * h)
            points = centre + radius * h * np.stack([np.sin(turn), 0 * turn, 1.05 * np.cos(turn)], axis=1)
            points[:, 0] = np.maximum(points[:, 0], 0.003)
            points = points * mirror
            uv = np.stack([np.abs(np.degrees(turn) - 90) / 180 * 0.25 * h, points[:, 1]], axis=1)
            inner = np.where(np.sin(turn) < -0.6, 1 - 0.4 * step(0.55, 0.8, y), 1.0)
            rings.append(cloth.ring(points, uv, leg_weights(build, points, side), 0.4 if ending else inner))
        for high, low in zip(rings, rings[1:], strict=False):
            cloth.bridge(*((low, high) if side == "l" else (high, low)))
    return cloth.piece(folds * h, seed)


def bare_legs(build: Build, upper: float = 0.70) -> Piece:
    """Skin or tights from the height `upper` to the ankles."""
    h, cloth = build.height, Cloth()
    turn = np.arange(10) * 2 * np.pi / 10
    for side in ("l", "r"):
        mirror = np.array([1 if side == "l" else -1, 1, 1])
        rings = []
        for y in [v for v in (0.06, 0.18, 0.28, 0.38, 0.46, 0.5, 0.54, 0.62) if v < upper] + [upper]:
            around = LEG(y) * build.limbs * h * np.stack([np.sin(turn), 0 * turn, 1.05 * np.cos(turn)], axis=1)
            points = (leg_centre(build, y * h) + around) * mirror
            rings.append(cloth.ring(points, points[:, [0, 1]], leg_weights(build, points, side)))
        for low, high in zip(rings, rings[1:], strict=False):
            cloth.bridge(*((low, high) if side == "l" else (high, low)))
    return cloth.piece()
