"""Heads, necks, hands and shoes, and hair in several cuts."""

import numpy as np
from scenes.making.shapes import ball

from .body import ARM, arm_ring, arm_weights
from .cloth import Cloth, Piece, joined, rigid, step
from .skeleton import Build, joints_of

AZIMUTHS = np.radians([0, 12, 27, 46, 70, 96, 126, 156, 180, 204, 234, 264, 290, 314, 333, 348])
# height above the chin: half width, front, back; metres of an adult's head
SKULL = (
    (0.000, 0.020, 0.078, -0.020),
    (0.030, 0.051, 0.098, -0.036),
    (0.052, 0.060, 0.094, -0.066),
    (0.072, 0.064, 0.095, -0.082),
    (0.090, 0.067, 0.094, -0.090),
    (0.124, 0.072, 0.087, -0.100),
    (0.142, 0.074, 0.094, -0.103),
    (0.172, 0.0765, 0.092, -0.104),
    (0.208, 0.067, 0.070, -0.088),
    (0.232, 0.033, 0.024, -0.044),
)
NOSE = {0.072: 0.006, 0.090: 0.023, 0.124: 0.007}
CROWN = 0.237


def _chin(build: Build) -> np.ndarray:
    return joints_of(build)["head"] + np.array([0, 0.012, 0.004]) * build.height


def _size(build: Build) -> float:
    return build.head * build.height


def skull_ring(width: float, front: float, back: float, azimuths=AZIMUTHS) -> np.ndarray:
    """[n, 2] x and z."""
    s, c = np.sin(azimuths), np.cos(azimuths)
    middle = 0.25 * front + 0.75 * back if front + back > 0 else 0.5 * (front + back)
    middle = -0.012
    x = np.sign(s) * np.abs(s) ** 0.88 * width
    z = middle + np.where(c > 0, (front - middle) * np.abs(c) ** 0.8, (back - middle) * np.abs(c) ** 0.92 * -np.sign(c) * 1.0)
    return np.stack([x, np.where(c > 0, z, middle + (back - middle) * np.abs(c) ** 0.92)], axis=1)


def head(build: Build) -> Piece:
    """Skin of head, ears and neck."""
    size, chin, cloth = _size(build), _chin(build), Cloth()
    follows = {"head": np.ones(len(AZIMUTHS))}
    last = None
    for y, width, front, back in SKULL:
        flat = skull_ring(width, front, back)
        flat[0, 1] += NOSE.get(y, 0.0)
        socket = -0.0065 if y == 0.124 else 0.0
        flat[[1, 2, -2, -1], 1] += np.array([0.4, 1, 1, 0.4]) * socket
        points = chin + size * np.stack([flat[:, 0], np.full(len(flat), y), flat[:, 1]], axis=1)
        colors = np.ones((len(AZIMUTHS), 3))
        front_only = step(0.75, 0.3, np.minimum(AZIMUTHS, 2 * np.pi - AZIMUTHS))[:, None]
        if y == 0.052:  # lips
            colors = 1 - front_only * step(0.32, 0.15, np.minimum(AZIMUTHS, 2 * np.pi - AZIMUTHS))[:, None] * [0.1, 0.42, 0.42]
        if y in (0.072, 0.090):  # cheeks and nose
            colors = 1 - front_only * [0.0, 0.16, 0.17]
        if y == 0.124:
            colors = 1 - front_only * [0.22, 0.27, 0.27]
        if y < 0.01:
            colors = colors * 0.62
        ring = cloth.ring(points, points[:, :2], follows, colors)
        if last is None:
            cloth.cap(ring, {"head": 1.0}, up=False)
        else:
            cloth.bridge(last, ring)
        last = ring
    cloth.cap(last, {"head": 1.0}, up=True, point=chin + size * np.array([0, CROWN, -0.012]))
    ears = [
        rigid(
            ball(0.5, 6, 3)
            .scaled(0.02, 0.062, 0.036)
            .turned("x", -12)
            .scaled(size, size, size)
            .at(*(chin + size * np.array([s * 0.077, 0.107, -0.014]))),
            "head",
            (0.92, 0.78, 0.75),
        )
        for s in (-1, 1)
    ]
    return joined([cloth.piece(), *ears, neck(build)])


def neck(build: Build) -> Piece:
    h, cloth, last = build.height, Cloth(), None
    places, chin, turn = joints_of(build), _chin(build), np.arange(10) * 2 * np.pi / 10
    low, high = places["neck"] * [1, 1, 1] + [0, -0.035 * h, 0.0], chin + _size(build) * np.array([0, 0.04, -0.018])
    for t in (0.0, 0.5, 1.0):
        radius = (0.062 - 0.008 * t) * h * (0.75 + 0.25 * build.limbs) * (build.head if t > 0.5 else 1) ** 0.5
        points = low + (high - low) * t + radius * np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
        ring = cloth.ring(
            points,
            points[:, :2],
            {"chest": (1 - t) ** 2, "neck": 1 - (1 - t) ** 2 - t * t * 0.6, "head": t * t * 0.6},
            1 - 0.45 * t * t,
        )
        if last is not None:
            cloth.bridge(last, ring)
        last = ring
    return cloth.piece()


def eyes(build: Build) -> Piece:
    """Eyes and brows, to be drawn in the hair's material, darker."""
    size, chin, parts = _size(build), _chin(build), []
    for s in (-1, 1):
        eye = ball(0.5, 6, 4).scaled(0.031, 0.0185, 0.013).scaled(size, size, size)
        parts.append(rigid(eye.at(*(chin + size * np.array([s * 0.031, 0.1215, 0.0735]))), "head", (0.16, 0.14, 0.16)))
        brow = ball(0.5, 5, 3).scaled(0.038, 0.0085, 0.013).turned("z", -s * 7).scaled(size, size, size)
        parts.append(rigid(brow.at(*(chin + size * np.array([s * 0.032, 0.1415, 0.0815]))), "head", (0.6, 0.55, 0.55)))
    return joined(parts)


HAIR = {  # height of the hairline at the front, temple, ear, back; thickness; length of the ends below, and their flare
    "short": (0.192, 0.176, 0.128, 0.050, 0.014),
    "side": (0.186, 0.168, 0.120, 0.030, 0.024),
    "bob": (0.184, 0.160, 0.030, 0.000, 0.024),
    "long": (0.186, 0.160, -0.03, -0.14, 0.022),
    "bun": (0.190, 0.172, 0.128, 0.046, 0.012),
    "curly": (0.184, 0.165, 0.088, 0.012, 0.040),
    "fringe": (0.150, 0.152, 0.088, 0.020, 0.020),
    "receding": (0.222, 0.196, 0.120, 0.048, 0.010),
}


def hair(build: Build, cut: str, seed: int = 0) -> Piece:
    """A cap of hair over the skull from the hairline up, which hangs down where the line lies below the ears."""
    size, chin, cloth = _size(build), _chin(build), Cloth()
    front, temple, ear, back, thick = HAIR[cut]
    bend = np.degrees(np.minimum(AZIMUTHS, 2 * np.pi - AZIMUTHS))
    line = np.interp(bend, (0, 40, 62, 90, 125, 180), (front, front, temple, ear, 0.3 * ear + 0.7 * back, back))
    table = np.array([row for row in SKULL])
    rng, last = np.random.default_rng(seed), None
    lump = 1 + (0.35 if cut == "curly" else 0.12) * rng.standard_normal((9, len(AZIMUTHS)))
    for number, t in enumerate((0.0, 0.02, 0.18, 0.4, 0.63, 0.84)):
        y = line + (0.234 - line) * t
        level = np.maximum(y, 0.045)
        shape = [np.interp(level, table[:, 0], table[:, k]) for k in (1, 2, 3)]
        flat = np.array([skull_ring(*(part[k] for part in shape), AZIMUTHS)[k] for k in range(len(AZIMUTHS))])
        grow = -0.004 if number == 0 else thick * min(1.0, 0.55 + t) * lump[number]
        hang = step(0.05, -0.1, y)  # what hangs stands off the neck and falls straight
        outward = flat - [0, -0.012]
        outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        flat = flat + outward * np.reshape(grow + 0.012 * hang, (-1, 1))
        points = chin + size * np.stack([flat[:, 0], y, flat[:, 1]], axis=1)
        loose = 0.75 * step(0.0, -0.16, y)
        streak = 0.8 + 0.2 * rng.uniform(0, 1, len(AZIMUTHS)) - (0.25 if number == 0 else 0)
        uv = np.stack([np.minimum(AZIMUTHS, 2 * np.pi - AZIMUTHS) * 0.1, y], axis=1)
        ring = cloth.ring(points, uv, {"head": 1 - loose, "chest": loose}, streak)
        if last is not None:
            cloth.bridge(last, ring)
        last = ring
    cloth.cap(last, {"head": 1.0}, up=True, point=chin + size * np.array([0, CROWN + thick * 0.8, -0.02]))
    parts = [cloth.piece(), eyes(build)]
    if cut == "bun":
        knot = ball(0.5, 10, 6).scaled(0.085, 0.08, 0.075).scaled(size, size, size)
        parts.append(rigid(knot.at(*(chin + size * np.array([0, 0.165, -0.125]))), "head"))
    if cut == "curly":
        for k in range(7):
            a, lift = np.radians(45 + 45 * k), rng.uniform(0.07, 0.19)
            tuft = ball(0.5, 6, 4).scaled(0.075, 0.07, 0.07).scaled(size, size, size)
            parts.append(
                rigid(
                    tuft.at(*(chin + size * np.array([0.078 * np.sin(a), lift, -0.02 + 0.085 * np.cos(a)]))),
                    "head",
                    (0.85, 0.85, 0.85),
                )
                if np.cos(a) < 0.55
                else rigid(
                    tuft.at(*(chin + size * np.array([0.05 * np.sin(a), 0.22, -0.02 + 0.05 * np.cos(a)]))),
                    "head",
                    (0.92, 0.92, 0.92),
                )
            )
    return joined(parts)


def hands(build: Build, sleeve: float = 0.97) -> Piece:
    """Hands with a thumb, and the arms' skin from the end of the sleeves on."""
    h, places, cloth = build.height, joints_of(build), Cloth()
    turn = np.arange(8) * 2 * np.pi / 8
    for side in ("l", "r"):
        mirror = np.array([1 if side == "l" else -1, 1, 1])
        rings = []
        for s in [v for v in (0.1, 0.2, 0.285, 0.36, 0.46) if v > 0.535 * sleeve - 0.05] + [0.53]:
            points, _ = arm_ring(places, build, side, s, ARM(s) * build.limbs, turn)
            rings.append(cloth.ring(points, points[:, :2], arm_weights(build, side, s, 8)))
        forth = places["hand_l"] - places["forearm_l"]
        forth = forth / np.linalg.norm(forth)
        out = np.array([-forth[1], forth[0], 0]) / np.hypot(forth[0], forth[1])
        for s, wide, thick, curl in (
            (0.035, 0.036, 0.017, 0),
            (0.075, 0.042, 0.016, 0.002),
            (0.13, 0.034, 0.012, 0.015),
            (0.178, 0.013, 0.007, 0.038),
        ):
            centre = places["hand_l"] + (forth * s - out * curl) * h
            points = centre + h * (np.cos(turn)[:, None] * np.array([0, 0, wide]) + np.sin(turn)[:, None] * out * thick)
            shade = 1.0 if s < 0.1 else 0.9
            rings.append(cloth.ring(points * mirror, points[:, :2], {f"hand_{side}": np.ones(8)}, shade))
        for inner, outer in zip(rings, rings[1:], strict=False):
            cloth.bridge(*((outer, inner) if side == "l" else (inner, outer)))
        cloth.cap(rings[-1], {f"hand_{side}": 1.0}, up=side == "r")
        thumb = np.arange(5) * 2 * np.pi / 5
        rings = []
        for s, z, radius in ((0.02, 0.022, 0.015), (0.06, 0.048, 0.014), (0.098, 0.058, 0.0105), (0.112, 0.059, 0.005)):
            centre = places["hand_l"] + forth * s * h - out * 0.008 * h + np.array([0, 0, z * h])
            points = centre + radius * h * (np.cos(thumb)[:, None] * np.array([0, 0, 1]) + np.sin(thumb)[:, None] * out)
            rings.append(cloth.ring(points * mirror, points[:, :2], {f"hand_{side}": np.ones(5)}, 0.95))
        for inner, outer in zip(rings, rings[1:], strict=False):
            cloth.bridge(*((outer, inner) if side == "l" else (inner, outer)))
    return cloth.piece()


def shoes(build: Build, ankle: float = 0.1, heel: float = 0.012) -> Piece:
    """Both shoes: sections along the foot with a flat sole, and a shaft up to the height `ankle`."""
    h, places, cloth = build.height, joints_of(build), Cloth()
    sections = (
        (-0.085, 0.026, 0.055),
        (-0.068, 0.037, 0.078),
        (0.02, 0.042, 0.086),
        (0.09, 0.05, 0.058),
        (0.15, 0.045, 0.043),
        (0.19, 0.018, 0.027),
    )
    turn = np.radians([-90, -40, -8, 35, 90, 145, 188, 220])
    for side in ("l", "r"):
        sign = 1 if side == "l" else -1
        rings = []
        for z, wide, high in sections:
            wide, high = wide * (0.9 + 0.1 * build.limbs), high * (0.9 + 0.1 * build.limbs)
            x, y = np.cos(turn) * wide, np.sin(turn)
            y = np.where(y < 0.2, np.where(y < -0.5, 0.0, 0.014 + heel * (z < 0)), high * np.maximum(y, 0) ** 0.8)
            x = x + sign * 0.006 * np.sin(np.clip((z + 0.05) / 0.24, 0, 1) * np.pi) - sign * 0.004
            forward = np.full(len(turn), places["foot_l"][2] + (z + 0.012) * h)
            points = np.stack([sign * places["foot_l"][0] + x * h, y * h, forward], axis=1)
            toe = step(0.06, 0.12, np.full(len(turn), z))
            shade = np.where(y < 0.03, 0.3, 1.0)
            rings.append(cloth.ring(points, points[:, [0, 2]], {f"foot_{side}": 1 - toe, f"toe_{side}": toe}, shade))
        for rear, fore in zip(rings, rings[1:], strict=False):
            cloth.bridge(rear, fore)
        cloth.cap(rings[-1], {f"toe_{side}": 1.0}, up=True)
        cloth.cap(rings[0], {f"foot_{side}": 1.0}, up=False)
        around, shaft = np.arange(8) * np.pi / 4, []
        for y in (0.06, ankle, ankle - 0.01) if ankle < 0.15 else (0.06, 0.15, 0.22, ankle, ankle - 0.01):
            inner = 0.01 if y == ankle - 0.01 else 0.0
            radius = (0.044 + 0.004 * (ankle > 0.15) - inner) * h
            points = (
                places["foot_l"] * [sign, 0, 1]
                + np.array([0, y * h, 0])
                + radius * np.stack([np.sin(around), 0 * around, 1.15 * np.cos(around)], axis=1)
            )
            up = step(0.09, 0.16, np.full(8, y))
            shaft.append(cloth.ring(points, points[:, :2], {f"foot_{side}": 1 - up, f"shin_{side}": up}, 0.5 if inner else 1.0))
        for low, high in zip(shaft, shaft[1:], strict=False):
            cloth.bridge(low, high)
    return cloth.piece()
