"""What people carry: bags, an umbrella, a trolley, a newspaper. Each is made where it is when the arms are posed, and
taken back into the bind pose of the joint that it follows."""

import numpy as np
from scenes.making.shapes import Shape, ball, bow, box, lathe, merged, quad, sheet, tube

from .body import Top, torso_at, torso_ring, trunk_weights
from .cloth import Cloth, Piece, joined, rigid
from .gait import hanging_arm, in_world, reaching_arm
from .skeleton import Build, joints_of
from .worn import beanie, cap, hat, scarf, shirt, tie

ARMS = {  # of those who hold something; hanging arms go on swinging where a side is not named
    "umbrella": reaching_arm("r", 38, 2, 78, 12),
    "trolley": hanging_arm("r", 27, 6, 14),
    "phone": reaching_arm("r", 24, 4, 84, 26),
    "strap": reaching_arm("l", 16, 12, 96, 42),
    "briefcase": hanging_arm("l", -2, 5, 9),
    "bouquet": reaching_arm("l", 30, 6, 72, 30),
}


def held(shape: Shape, joint: str, build: Build, arms: dict, color=(1.0, 1.0, 1.0)) -> Piece:
    """A shape given in the figure's space while the arms are posed like `arms` and all else is as in the bind pose."""
    places = joints_of(build)
    matrix = in_world({"hips_at": places["hips"]} | arms, places)[joint]
    points = (shape.points - matrix[:3, 3]) @ matrix[:3, :3] + places[joint]
    return rigid(Shape(points, shape.normals @ matrix[:3, :3], shape.st, shape.faces), joint, color)


def hand(build: Build, side: str, arms: dict, reach: float = 0.09) -> np.ndarray:
    """The middle of a posed hand."""
    places = joints_of(build)
    matrix = in_world({"hips_at": places["hips"]} | arms, places)[f"hand_{side}"]
    forth = places[f"hand_{side}"] - places[f"forearm_{side}"]
    return matrix[:3, 3] + matrix[:3, :3] @ (forth / np.linalg.norm(forth)) * reach * build.height


def rounded_box(width: float, height: float, depth: float, grow: float = 0.06) -> Shape:
    """A bag's body, standing on the origin: a box with bulging sides."""
    turn = (np.arange(13) + 0.5) / 12 * 2 * np.pi
    rows = []
    for t, size in ((0, 0.0), (0, 0.82), (0.08, 1.0), (0.5, 1.0 + grow), (0.9, 0.97), (1.0, 0.78), (1.0, 0.0)):
        c, s = np.cos(turn), np.sin(turn)
        x, z = np.sign(c) * np.abs(c) ** 0.5 * width / 2 * size, np.sign(s) * np.abs(s) ** 0.5 * depth / 2 * size
        rows.append(np.stack([x, np.full(13, t * height), z], axis=-1))
    points = np.array(rows)
    shape = sheet(points[::-1], points[::-1][..., :2])
    out = np.sign(((shape.points - [0, height / 2, 0]) * shape.normals).sum(axis=1).mean())
    return shape if out > 0 else Shape(shape.points, -shape.normals, shape.st, shape.faces[:, ::-1])


def backpack(build: Build, cut: Top) -> Piece:
    h = build.height
    back = torso_at(build, np.array([1.2 * h]), cut.ease * h)[0, 2] + 0.012 * h
    bag = rounded_box(0.3 * h, 0.43 * h, 0.17 * h).at(0, 1.0 * h, -back - 0.075 * h)
    pocket = rounded_box(0.24 * h, 0.2 * h, 0.07 * h).at(0, 1.02 * h, -back - 0.17 * h)
    straps = []
    for s in (-1, 1):
        path = [(s * 0.08 * h, 1.40 * h, -back), (s * 0.095 * h, 1.475 * h, -0.03 * h)]
        for y in (1.42, 1.34, 1.26, 1.18, 1.1):
            front = torso_ring(build, y * h, (cut.ease + 0.008) * h, np.array([s * 0.62]))[0]
            path.append(tuple(front))
        straps.append(tube([*path, (s * 0.15 * h, 1.04 * h, -0.02 * h), (s * 0.11 * h, 1.05 * h, -back)], 0.016 * h, 5))
    pieces = [rigid(bag, "chest"), rigid(pocket, "chest", (0.8, 0.8, 0.8))]
    return joined([*pieces, *(rigid(strap, "chest", (0.6, 0.6, 0.6)) for strap in straps)])


def shoulder_bag(build: Build, cut: Top) -> Piece:
    """A bag at the right hip with its strap over the left shoulder."""
    h, cloth = build.height, Cloth()
    side = torso_at(build, np.array([0.92 * h]), (cut.ease + 0.4 * cut.flare) * h)[0, 0]
    bag = rounded_box(0.1 * h, 0.24 * h, 0.3 * h).at(-side - 0.06 * h, 0.72 * h, 0.01 * h)
    flap = box(0.11 * h, 0.12 * h, 0.29 * h, -side - 0.062 * h, 0.85 * h, 0.01 * h)
    turn, rings = np.linspace(0, 2 * np.pi, 21)[:-1], []
    for a in turn:  # around the trunk, slantwise: high on the left, low on the right
        y = (1.16 + 0.3 * np.sin(a)) * h
        angle = np.array([a])
        at = torso_ring(build, min(y, 1.465 * h), (cut.ease + 0.007) * h, angle)[0]
        below = torso_ring(build, min(y, 1.465 * h) - 0.035 * h, (cut.ease + 0.007) * h, angle)[0]
        points = np.stack([below, at])
        rings.append(cloth.ring(points, points[:, :2], trunk_weights(build, points), 0.75))
    for a, b in zip(rings, rings[1:] + rings[:1], strict=True):
        cloth.faces += [(a[0], b[0], b[1]), (a[0], b[1], a[1])]
    return joined([rigid(bag, "hips"), rigid(flap, "hips", (0.85, 0.85, 0.85)), cloth.piece()])


def briefcase(build: Build, cut: Top) -> Piece:
    arms, h = ARMS["briefcase"], build.height
    at = hand(build, "l", arms, 0.1)
    case = rounded_box(0.09 * h, 0.3 * h, 0.4 * h, 0.03).at(at[0] + 0.01, at[1] - 0.36 * h, at[2])
    grip = tube(
        bow(
            (at[0] + 0.01, at[1] - 0.06 * h, at[2] - 0.06), (at[0] + 0.01, at[1] - 0.06 * h, at[2] + 0.06), (0, 0.07 * h, 0), 7
        ),
        0.011,
        5,
    )
    return joined([held(case, "hand_l", build, arms), held(grip, "hand_l", build, arms, (0.5, 0.5, 0.5))])


def trolley(build: Build, cut: Top) -> Piece:
    """A case on wheels that is drawn behind; it follows the ground below the figure."""
    at = hand(build, "r", ARMS["trolley"], 0.1)
    foot = np.array([at[0], 0.05, at[2] - 0.62])
    lean = np.degrees(np.arctan2(at[2] - foot[2], at[1] - foot[1]))
    case = rounded_box(0.38, 0.56, 0.23, 0.02).turned("x", lean).at(foot[0], 0.07, foot[2])
    rods = [tube([foot + [s * 0.1, 0.5, 0.62 * 0.5 / (at[1] - 0.05)], at + [s * 0.1, -0.01, 0]], 0.009, 5) for s in (-1, 1)]
    grip = tube([at + [-0.12, -0.01, 0], at + [0.12, -0.01, 0]], 0.014, 6)
    wheels = [
        lathe([(0, 0), (0.05, 0), (0.05, 0.03), (0, 0.03)], 10).turned("z", 90).at(foot[0] + s * 0.15, 0.05, foot[2] - 0.05)
        for s in (-1, 1)
    ]
    ribs = [
        tube(
            [(foot[0] + x, 0.12, foot[2] + 0.12), (foot[0] + x, 0.5, foot[2] + 0.12 + 0.4 * np.tan(np.radians(lean)))], 0.008, 4
        )
        for x in (-0.12, 0, 0.12)
    ]
    pieces = [
        rigid(case, "ground"),
        *(rigid(part, "ground", (0.25, 0.25, 0.25)) for part in [*rods, grip, *wheels]),
        *(rigid(r, "ground", (0.7, 0.7, 0.7)) for r in ribs),
    ]
    return joined(pieces)


def umbrella(build: Build, cut: Top) -> Piece:
    """Open, over the right shoulder; eight panels that sag between the ribs."""
    at = hand(build, "r", ARMS["umbrella"])
    top = at + np.array([-0.08, 0.62, -0.05])
    turn, rows = np.linspace(0, 2 * np.pi, 33), []
    for t in np.linspace(0, 1, 7):
        sag = 1 - 0.05 * t * np.abs(np.sin(4 * turn))
        r = 0.56 * np.sin(t * 1.25) / np.sin(1.25) * sag
        y = 0.26 * (np.cos(t * 1.25) - np.cos(1.25)) / (1 - np.cos(1.25)) - 0.24 - 0.035 * t**3 * np.cos(8 * turn)
        rows.append(np.stack([r * np.sin(turn), y, r * np.cos(turn)], axis=-1))
    cloth = sheet(np.array(rows)[::-1], np.zeros((7, 33, 2)))
    tilt = 10
    stick = tube([at - [0, 0.12, 0], at, top + [0, 0.06, 0]], 0.008, 5)
    ribs = [tube([(0, 0.0, 0), (0.54 * np.sin(a), -0.225, 0.54 * np.cos(a))], 0.004, 3) for a in np.radians(45 * np.arange(8))]
    arms = ARMS["umbrella"]
    return joined(
        [
            held(cloth.turned("z", tilt).at(*top), "chest", build, arms),
            held(stick, "chest", build, arms, (0.15, 0.12, 0.1)),
            *(held(rib.turned("z", tilt).at(*top), "chest", build, arms, (0.2, 0.2, 0.2)) for rib in ribs),
        ]
    )


def phone(build: Build, cut: Top) -> Piece:
    at = hand(build, "r", ARMS["phone"], 0.1)
    return held(box(0.072, 0.145, 0.01).turned("x", -35).at(*(at + [0, -0.03, 0.02])), "hand_r", build, ARMS["phone"])


def bouquet(build: Build, cut: Top) -> Piece:
    arms = ARMS["bouquet"]
    at = hand(build, "l", arms)
    wrap = lathe([(0.015, -0.16), (0.025, 0.0), (0.1, 0.2)], 10).turned("z", 12).at(*at)
    rng = np.random.default_rng(5)
    heads = [
        ball(0.035, 5, 3)
        .turned("z", 12)
        .at(*(at + np.array([-0.045 + rng.normal(0, 0.05), 0.22 + rng.normal(0, 0.025), rng.normal(0, 0.05)])))
        for _ in range(12)
    ]
    return joined([held(wrap, "chest", build, arms, (0.9, 0.85, 0.75)), *(held(head, "chest", build, arms) for head in heads)])


def newspaper(build: Build, cut: Top) -> Piece:
    arms = reaching_arm("l", 30, 4, 66, 32) | reaching_arm("r", 30, 4, 66, 32)
    at = (hand(build, "l", arms) + hand(build, "r", arms)) / 2
    leaves = [quad((0, -0.16, 0), (s * 0.3, 0, 0.09), (0, 0.4, -0.02)) for s in (-1, 1)]
    return held(merged(leaves).turned("x", -24).at(*(at + [0, 0.06, 0.03])), "chest", build, arms)


THINGS = {
    function.__name__: function
    for function in (
        backpack,
        shoulder_bag,
        briefcase,
        trolley,
        umbrella,
        phone,
        bouquet,
        newspaper,
        hat,
        beanie,
        cap,
        scarf,
        shirt,
        tie,
    )
}
