"""What moves, with a period of twelve seconds: toy train, ladder, ceiling fan, globe, pendulum, paper plane, flames."""

import numpy as np
from scenes.making.shapes import Shape, ball, box, lathe, merged, quad, tube

from .furniture import cushion
from .room import BACK, CEILING
from .scene_file import SceneFile

PERIOD = 12.0
STRAIGHT, CURVE = 1.7, 0.72  # of the track: length of its straights, radius of its ends
TRACK = (-0.4, -0.2)  # its middle
LAP = 2 * STRAIGHT + 2 * np.pi * CURVE


def about(axis, degrees: float) -> np.ndarray:
    """Quaternion w, x, y, z."""
    half = np.radians(degrees) / 2
    return np.array([np.cos(half), *(np.sin(half) * np.array(axis, float) / np.linalg.norm(axis))])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation b, then a."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def times(rate: float) -> np.ndarray:
    return np.arange(round(PERIOD * rate) + 1) / rate


def along_track(s: float) -> tuple[float, float, float]:
    """Place x, z and heading (degrees from +x, counter-clockwise about y) at `s` metres along the track."""
    s %= LAP
    arc = np.pi * CURVE
    if s < STRAIGHT:
        x, z, turn = s - STRAIGHT / 2, CURVE, 0.0
    elif s < STRAIGHT + arc:
        a = (s - STRAIGHT) / CURVE
        x, z, turn = STRAIGHT / 2 + CURVE * np.sin(a), CURVE * np.cos(a), np.degrees(a)
    elif s < 2 * STRAIGHT + arc:
        x, z, turn = STRAIGHT / 2 - (s - STRAIGHT - arc), -CURVE, 180.0
    else:
        a = (s - 2 * STRAIGHT - arc) / CURVE
        x, z, turn = -STRAIGHT / 2 - CURVE * np.sin(a), -CURVE * np.cos(a), 180 + np.degrees(a)
    return TRACK[0] + x, TRACK[1] + z, turn


def wheels(length: float, radius: float, count: int) -> Shape:
    disc = lathe([(0, -0.006), (radius + 0.004, -0.006), (radius + 0.004, -0.003), (radius, -0.003), (radius, 0.006),
                (radius * 0.8, 0.006),
                  (radius * 0.75, 0.002), (0, 0.004)], 18)  # fmt: skip
    spots = np.linspace(-length / 2, length / 2, count)
    parts = [disc.turned("x", 90 * s).at(x, radius, s * 0.045) for x in spots for s in (-1, 1)]
    parts += [tube([(x, radius, -0.045), (x, radius, 0.045)], 0.004, 6) for x in spots]
    return merged([*parts, box(length + 0.06, 0.014, 0.06, 0, radius + 0.008, 0)])


def train(m: SceneFile) -> None:
    rails = []
    spots = [along_track(s) for s in np.linspace(0, LAP, 97)]
    for side in (-0.045, 0.045):
        line = [(x + side * np.sin(np.radians(a)), 0.016, z + side * np.cos(np.radians(a))) for x, z, a in spots]
        rails.append(tube(line, 0.005, 5))
    m.add("Train/rails", merged(rails), "steel")
    sleepers = [
        box(0.025, 0.011, 0.14).turned("y", a).at(x, 0, z) for x, z, a in (along_track(s) for s in np.arange(0, LAP, 0.085))
    ]
    m.add("Train/sleepers", merged(sleepers), "walnut")
    boiler = tube([(-0.04, 0.12, 0), (0.06, 0.12, 0), (0.16, 0.12, 0)], 0.042, 24)
    nose = lathe([(0.042, 0), (0.04, 0.008), (0.02, 0.014), (0, 0.016)], 24).turned("z", -90).at(0.16, 0.12, 0)
    cab = [
        box(0.1, 0.02, 0.12, -0.1, 0.06, 0),
        box(0.1, 0.06, 0.006, -0.1, 0.08, 0.056),
        box(0.1, 0.06, 0.006, -0.1, 0.08, -0.056),
    ]
    cab += [box(0.008, 0.13, 0.008, x, 0.08, z) for x in (-0.146, -0.054) for z in (-0.054, 0.054)]
    cab += [cushion(0.135, 0.016, 0.135, 0.007, steps=3).at(-0.1, 0.205, 0), box(0.006, 0.06, 0.11, -0.052, 0.08, 0)]
    m.mesh("loco_body", merged([boiler, nose, *cab, box(0.3, 0.022, 0.1, 0.02, 0.052, 0)]))
    funnel = lathe([(0.016, 0.15), (0.014, 0.2), (0.022, 0.225), (0.024, 0.23), (0.018, 0.23)], 16).at(0.125, 0, 0)
    dome = lathe([(0.022, 0.155), (0.022, 0.17), (0.014, 0.187), (0, 0.192)], 16, refine=2).at(0.04, 0, 0)
    rings = [
        lathe([(0.0425, -0.004), (0.0445, -0.003), (0.0445, 0.003), (0.0425, 0.004)], 24).turned("z", -90).at(x, 0.12, 0)
        for x in (0.0, 0.08, 0.15)
    ]
    m.mesh("loco_brass", merged([funnel, dome, *rings, ball(0.014, 12, 8).at(0.178, 0.12, 0)]))
    m.mesh(
        "loco_wheels",
        merged(
            [
                wheels(0.2, 0.036, 3),
                box(0.02, 0.03, 0.13, 0.18, 0.03, 0),
                tube([(-0.1, 0.036, 0.056), (0.1, 0.036, 0.056)], 0.005, 6),
            ]
        ),
    )
    coach = [
        box(0.3, 0.02, 0.11, 0, 0.055, 0),
        box(0.29, 0.045, 0.105, 0, 0.07, 0),
        cushion(0.3, 0.03, 0.125, 0.013, steps=3).at(0, 0.165, 0),
    ]
    coach += [box(0.016, 0.06, 0.105, x, 0.11, 0) for x in np.linspace(-0.137, 0.137, 7)]
    m.mesh("coach_body", merged(coach))
    m.mesh("coach_wheels", merged([wheels(0.2, 0.026, 2), tube([(0.13, 0.05, 0), (0.2, 0.05, 0)], 0.005, 6)]))
    stock = [
        (
            "Loco",
            0.0,
            (("body", "loco_body", "loco_green"), ("brass", "loco_brass", "polished_brass"), ("wheels", "loco_wheels", "iron")),
        )
    ]
    for k, colour in enumerate(("wagon_red", "wagon_cream", "wagon_blue")):
        stock.append((f"Coach{k}", 0.36 + 0.345 * k, (("body", "coach_body", colour), ("wheels", "coach_wheels", "iron"))))
    for name, behind, parts in stock:
        for part, mesh, look in parts:
            m.add(f"Train/{name}/{part}", mesh, look)

            def place(t: float, behind: float = behind) -> tuple:
                x, z, _ = along_track(0.35 + LAP * t / PERIOD - behind)
                return x, 0.0205, z

            def heading(t: float, behind: float = behind) -> np.ndarray:
                return about((0, 1, 0), along_track(0.35 + LAP * t / PERIOD - behind)[2])

            m.animate(f"Train/{name}/{part}", times(10), place, heading)


def ladder(m: SceneFile) -> None:
    """Leans on the rail of the bookcases and rolls to and fro."""
    foot, head = np.array([3.78, 0.06, 0.0]), np.array([4.47, 3.12, 0.0])
    wood = [tube([foot + [0, 0, z], head + [0, 0, z * 0.85]], 0.024, 8) for z in (-0.23, 0.23)]
    wood += [box(0.1, 0.022, 0.44, *(foot + (head - foot) * s)) for s in np.linspace(0.09, 0.93, 10)]
    brass = [
        lathe([(0, -0.014), (0.055, -0.014), (0.06, 0), (0.055, 0.014), (0, 0.014)], 20).turned("x", 90).at(foot[0], 0.06, z)
        for z in (-0.23, 0.23)
    ]
    brass += [tube([(4.44, 3.06, z), (4.47, 3.11, z), (4.5, 3.1, z), (4.53, 3.06, z)], 0.012, 6) for z in (-0.2, 0.2)]
    for part, shapes, look in (("wood", wood, "mahogany"), ("brass", brass, "polished_brass")):
        m.add(f"Ladder/{part}", merged(shapes), look)
        m.animate(f"Ladder/{part}", times(12), lambda t: (0, 0, -1.4 - 1.0 * np.cos(2 * np.pi * t / 6)))


def fan(m: SceneFile) -> None:
    place = (0, CEILING - 0.72, 0.6)
    m.add(
        "Fan/rod",
        merged([tube([(0, 0.06, 0), (0, 0.72, 0)], 0.014, 10), lathe([(0.07, 0.66), (0.07, 0.7), (0.03, 0.72)], 24)]),
        "brass",
        place,
    )
    motor = lathe([(0, -0.07), (0.05, -0.065), (0.12, -0.03), (0.13, 0.02), (0.08, 0.06), (0.02, 0.07)], 32)
    arms = [box(0.16, 0.008, 0.05, 0.19, -0.012, 0).turned("y", 72 * k) for k in range(5)]
    blade = cushion(0.62, 0.012, 0.15, 0.005, steps=3).turned("x", 13).at(0.56, -0.012, 0)
    for part, shape, look in (
        ("motor", merged([motor, *arms]), "brass"),
        ("blades", merged([blade.turned("y", 72 * k) for k in range(5)]), "mahogany"),
    ):
        m.add(f"Fan/{part}", shape, look)
        m.animate(f"Fan/{part}", times(4), lambda t: place, lambda t: about((0, 1, 0), 360 * t * 0.75))


def globe(m: SceneFile) -> None:
    """A globe in a wooden stand; it turns once in four seconds about its tilted axis."""
    x, z, y = -2.7, 0.55, 0.82
    sphere = ball(0.34, 48, 28)
    m.add("Globe/map", sphere, "globe")
    m.animate("Globe/map", times(2), lambda t: (x, y, z), lambda t: product(about((0, 0, 1), -23), about((0, 1, 0), 90 * t)))
    ring = [(0.375 * np.cos(a), 0.375 * np.sin(a), 0) for a in np.linspace(0, 2 * np.pi, 49)]
    axis = np.array([np.sin(np.radians(23)), np.cos(np.radians(23)), 0])
    pins = [tube([s * 0.335 * axis, s * 0.38 * axis], 0.012, 8) for s in (-1, 1)]
    m.add("Globe/meridian", merged([tube(ring, 0.01, 8), *pins]), "polished_brass", (x, y, z))
    rim = lathe([(0.39, -0.015), (0.5, -0.015), (0.51, 0), (0.5, 0.015), (0.39, 0.015), (0.39, -0.015)], 48).at(0, y, 0)
    legs = [tube([(0.46 * np.cos(a), y, 0.46 * np.sin(a)), (0.4 * np.cos(a), 0.5, 0.4 * np.sin(a)),
                (0.3 * np.cos(a), 0.22, 0.3 * np.sin(a)),
                  (0.36 * np.cos(a), 0, 0.36 * np.sin(a))], 0.024, 10) for a in np.radians((45, 135, 225, 315))]  # fmt: skip
    shelf = lathe([(0, 0.2), (0.33, 0.2), (0.34, 0.21), (0.33, 0.222), (0, 0.222)], 40)
    m.add("Globe/stand", merged([rim, *legs, shelf, tube([(0, 0.22, 0), (0, y - 0.37, 0)], 0.02, 10)]), "mahogany", (x, 0, z))


def clock(m: SceneFile) -> None:
    """A long-case clock whose pendulum swings in an open case; one swing to and fro takes two seconds."""
    x, z = -4.35, BACK + 0.04
    wood = [box(0.56, 0.5, 0.3, 0, 0, 0.15), box(0.6, 0.06, 0.33, 0, 0.0, 0.16), box(0.6, 0.05, 0.33, 0, 0.48, 0.16)]
    wood += [box(0.06, 1.0, 0.26, s * 0.19, 0.5, 0.13) for s in (-1, 1)] + [box(0.4, 1.0, 0.03, 0, 0.5, 0.015)]
    wood += [box(0.54, 0.06, 0.32, 0, 1.48, 0.15), box(0.52, 0.52, 0.28, 0, 1.54, 0.14), box(0.6, 0.07, 0.36, 0, 2.06, 0.16)]
    wood += [
        box(0.5, 0.1, 0.2, 0, 2.13, 0.12),
        lathe([(0.03, 2.2), (0.05, 2.25), (0.01, 2.32), (0, 2.36)], 16, refine=2).at(0, 0, 0.14),
    ]
    wood += [cushion(0.4, 0.34, 0.02, 0.008, steps=2).at(0, 0.08, 0.303)]
    m.add("Clock/wood", merged(wood), "mahogany", (x, 0, z))
    m.add("Clock/dial", quad((-0.2, 1.6, 0.284), (0.4, 0, 0), (0, 0.4, 0), st=(1, 1)), "dial", (x, 0, z))
    ring = lathe([(0.2, 0), (0.225, 0.004), (0.23, 0.014), (0.215, 0.02), (0.2, 0.006)], 40).turned("x", 90).at(0, 1.8, 0.28)
    m.add("Clock/ring", ring, "polished_brass", (x, 0, z))
    bob = lathe([(0, -0.012), (0.06, -0.008), (0.075, 0), (0.06, 0.008), (0, 0.012)], 32).turned("x", 90).at(0, -0.72, 0)
    weights = [tube([(s * 0.08, 0.62 + 0.1 * s, 0.1), (s * 0.08, 0.86 + 0.1 * s, 0.1)], 0.024, 16) for s in (-1, 1)]
    m.add("Clock/weights", merged(weights), "polished_brass", (x, 0, z))
    m.add("Clock/pendulum", merged([box(0.012, 0.74, 0.004, 0, -0.72, 0), bob]), "polished_brass")
    m.animate("Clock/pendulum", times(12), lambda t: (x, 1.44, z + 0.2), lambda t: about((0, 0, 1), 5.5 * np.sin(np.pi * t)))


def paper_plane(m: SceneFile) -> None:
    """Glides through the room in rounds of six seconds, banking."""
    tip, tail = np.array([0.17, 0, 0]), -0.15
    folds = [(0.13, 0.02), (0.012, 0.0), (0.0, -0.045), (-0.012, 0.0), (-0.13, 0.02)]
    corners = [np.array([tail, y, z]) for z, y in folds]
    sides = []
    for a, b in zip(corners, corners[1:], strict=False):
        normal = np.cross(b - tip, a - tip)
        normal = normal / np.linalg.norm(normal) * (1 if normal[1] > 0 else -1)
        points = np.array([tip, a, b])
        sides.append(Shape(points, np.tile(normal, (3, 1)), points[:, [0, 2]], np.array([[0, 1, 2]])))
    m.add("Plane/paper", merged(sides), "paper")

    def place(t: float) -> tuple:
        a = 2 * np.pi * t / 6 + 1.1
        return 0.2 + 2.3 * np.cos(a), 1.95 + 0.28 * np.sin(a + 0.5), -0.6 - 2.6 * np.sin(a)

    def attitude(t: float) -> np.ndarray:
        way = np.subtract(place(t + 0.01), place(t - 0.01))
        yaw, pitch = np.degrees(np.arctan2(-way[2], way[0])), np.degrees(np.arctan2(way[1], np.hypot(way[0], way[2])))
        return product(about((0, 1, 0), yaw), product(about((0, 0, 1), pitch), about((1, 0, 0), -24)))

    m.animate("Plane/paper", times(12), place, attitude)


def flames(m: SceneFile) -> None:
    """Tongues of fire that stretch and shrink."""
    rng = np.random.default_rng(500)
    tongue = m.mesh("flame", lathe([(0, 0), (0.4, 0.1), (0.55, 0.24), (0.36, 0.5), (0.14, 0.78), (0, 1)], 14, refine=2))
    for k in range(11):
        x, z = -0.29 + 0.058 * k + rng.uniform(-0.02, 0.02), BACK + 0.2 + rng.uniform(-0.04, 0.06)
        wide, tall, phase = rng.uniform(0.05, 0.085), rng.uniform(0.26, 0.54) * (1.1 - 0.09 * abs(k - 5)), rng.uniform(0, 6, 3)
        m.add(f"Fire/Flames/flame{k}", tongue, "flame", (x, 0.14, z), 0, (wide, tall, wide), glow="flame_glow")

        def height(t: float, wide: float = wide, tall: float = tall, phase: np.ndarray = phase) -> tuple:
            beat = sum(
                np.sin(2 * np.pi * n * t / PERIOD + p) / j for j, (n, p) in enumerate(zip((17, 29, 47), phase, strict=True), 1)
            )
            return wide * (1 - 0.12 * beat), tall * (1 + 0.2 * beat), wide * (1 - 0.1 * beat)

        m.animate(f"Fire/Flames/flame{k}", times(12), lambda t, x=x, z=z: (x, 0.14, z), None, height)


def moving(m: SceneFile) -> None:
    for part in (train, ladder, fan, globe, clock, paper_plane, flames):
        part(m)
