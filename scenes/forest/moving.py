"""What moves beside the leaves: butterflies, a robin, falling leaves, and the lantern on its bracket; all cyclic over 4 s."""

import numpy as np
from scenes.making.shapes import Shape, ball, bow, lathe, merged, quad, sheet, tube
from scenes.making.usd_stage import Stage

from .terrain import height, path_x
from .trees import limb
from .undergrowth import lone_leaf
from .wind import CYCLE_S

TURN = 2 * np.pi / CYCLE_S
LANTERN = 2.6, 4.6  # x, z of the post


def wing(length: float, chord: float) -> Shape:
    """A wing from the body outwards along +z."""
    z, x = np.meshgrid(np.linspace(0, 1, 6), np.linspace(-1, 1, 4))
    x = x * chord * (0.45 + 0.75 * np.sin(np.pi * np.minimum(z + 0.12, 1))) - 0.25 * chord * z
    return sheet(np.stack([x, 0.04 * length * np.sin(np.pi * z), z * length], axis=-1), np.stack([x, z], axis=-1))


def flapping(m: Stage, path: str, shape: Shape, material: str, root: float, beats: int, swing: tuple[float, float]) -> None:
    """Two wings that beat `beats` times a cycle between swing[0] -+ swing[1] degrees."""
    for name, side in (("Left", 1), ("Right", -1)):
        hinge = m.group(f"{path}/{name}", (0, 0, side * root))
        m.animate(hinge, "rotateX", lambda t, side=side: -side * (swing[0] + swing[1] * np.sin(TURN * beats * t)))
        one = (
            shape if side > 0 else Shape(shape.points * [1, 1, -1], shape.normals * [1, 1, -1], shape.st, shape.faces[:, ::-1])
        )
        m.add(f"{path}/{name}/wing", one, material)


def flight(m: Stage, path: str, at) -> None:
    """Translation along at(seconds), headed along the flight: -x of the model is ahead."""
    xform = m.group(path)
    m.animate(xform, "translate", at)
    headings = np.unwrap([np.arctan2(*(np.subtract(at(t + 0.02), at(t - 0.02))[[2, 0]])) for t in np.array(m.times) / 24])
    m.animate(xform, "rotateY", lambda t: 180 - np.degrees(headings[round(t * 24)]))


def butterflies(m: Stage) -> None:
    spots = (("Blue", (-0.7, 1.25, 8.2), "blue_wing", 0.0, 1), ("Orange", (-2.6, 1.1, 2.6), "orange_wing", 1.7, -1),
             ("Copper", (2.9, 0.95, 1.0), "orange_wing", 3.1, 1))  # fmt: skip
    for name, (x, y, z), material, phase, way in spots:

        def at(t, x=x, y=y, z=z, phase=phase, way=way):
            a = way * TURN * t + phase
            return (
                x + 0.75 * np.cos(a) + 0.12 * np.sin(3 * a),
                y + 0.22 * np.sin(2 * a) + 0.07 * np.sin(TURN * 7 * t + phase),
                z + 0.55 * np.sin(a),
            )

        flight(m, f"Butterflies/{name}", at)
        m.add(
            f"Butterflies/{name}/body",
            lathe([(0, -0.03), (0.006, -0.02), (0.005, 0.02), (0, 0.028)], 8).turned("z", 90),
            "body",
        )
        flapping(m, f"Butterflies/{name}", wing(0.058, 0.03), material, 0.004, 22, (28, 46))


def robin(m: Stage) -> None:
    """A robin that circles through the glade and over the path."""

    def at(t):
        a = TURN * t
        return (-1.2 + 4.6 * np.cos(a), 2.5 + 0.5 * np.sin(2 * a + 1), 1.2 + 3.6 * np.sin(a))

    flight(m, "Robin", at)
    body = lathe([(0, -0.085), (0.022, -0.06), (0.042, -0.005), (0.038, 0.035), (0.02, 0.06), (0, 0.07)], 16, refine=2)
    tail = quad((0.07, 0.005, 0.02), (0, 0, -0.04), (0.085, 0.012, 0))
    m.add("Robin/body", merged([body.turned("z", 90), ball(0.028, 12, 8).at(-0.075, 0.022, 0), tail]), "feather")
    m.add("Robin/breast", ball(0.036, 14, 9).scaled(1.15, 0.9, 0.92).at(-0.04, -0.008, 0), "breast")
    flapping(m, "Robin", wing(0.15, 0.05), "feather", 0.02, 24, (12, 58))


def falling_leaves(m: Stage) -> None:
    """Leaves that sail down side to side; each falls once a cycle, and begins again above where the last one lay."""
    rng = np.random.default_rng(80)
    spots = [(0.4, 9.3), (-1.4, 7.4), (1.9, 6.4), (-0.3, 4.6), (-3.0, 4.0), (0.9, 2.2), (-2.2, -0.6), (2.7, -2.6), (-4.6, -3.2),
             (0.2, -5.0)]  # fmt: skip
    for k, (x, z) in enumerate(spots):
        drop, wide, phase, spin = rng.uniform(2.9, 3.9), rng.uniform(0.18, 0.4), rng.uniform(0, 1), rng.choice([-1, 1])
        ground = float(height(x, z)) + 0.03

        def at(t, x=x, z=z, ground=ground, drop=drop, wide=wide, phase=phase):
            share = (t / CYCLE_S + phase) % 1
            left = 1 - share
            return (
                x + 0.5 * left + wide * np.sin(2 * np.pi * 3 * share) * min(1, 4 * left),
                ground + drop * left + 0.08 * np.cos(2 * np.pi * 6 * share) * min(1, 4 * left),
                z + 0.3 * left + 0.5 * wide * np.cos(2 * np.pi * 3 * share),
            )

        leaf = m.group(f"FallingLeaves/Leaf{k}")
        m.animate(leaf, "translate", at)
        m.animate(leaf, "rotateY", lambda t, phase=phase, spin=spin: spin * 360 * (t / CYCLE_S + phase))
        m.animate(leaf, "rotateZ", lambda t, phase=phase: 42 * np.sin(2 * np.pi * 3 * (t / CYCLE_S + phase)))
        m.add(f"FallingLeaves/Leaf{k}/leaf", lone_leaf(k % 9, 0.15, 0.3), "fallen_leaves")


def lantern(m: Stage) -> None:
    """A post by the path with a lantern that swings from an iron bracket."""
    x, z = LANTERN
    y, tall = float(height(x, z)), 2.25
    m.group("Lantern", (x, y, z), 12)
    line = np.stack([0.02 * np.sin(np.linspace(0, 3, 12)), np.linspace(-0.2, tall, 12), 0 * np.linspace(0, 1, 12)], axis=-1)
    post = limb(line, np.linspace(0.085, 0.068, 12), 12, 1, 1 / 1.6, lambda a, y: 1 + 0.05 * np.cos(4 * a + 2 * y))
    m.add(
        "Lantern/post",
        merged([post, lathe([(0.069, tall), (0.05, tall + 0.03), (0, tall + 0.035)], 12).at(0.003, -0.002)]),
        "wood",
    )
    arm = tube(bow((-0.02, tall - 0.12, 0), (-0.62, tall - 0.1, 0), (0, 0.14, 0), 12), 0.014, 8)
    brace = tube(bow((-0.03, tall - 0.52, 0), (-0.4, tall + 0.0, 0), (-0.1, -0.06, 0), 9), 0.010, 8)
    bands = [tube([(0, tall - h, 0), (0, tall - h + 0.05, 0)], 0.085, 14) for h in (0.16, 0.56)]
    m.add("Lantern/bracket", merged([arm, brace, *bands]), "iron")
    swing = m.group("Lantern/Swing", (-0.6, tall - 0.1, 0))
    m.animate(swing, "rotateZ", lambda t: 9 * np.sin(TURN * 3 * t) + 2 * np.sin(TURN * t))
    m.animate(swing, "rotateX", lambda t: 5 * np.sin(TURN * 2 * t + 0.8))
    ring = [(0.022 * np.sin(a), -0.03 + 0.022 * np.cos(a), 0) for a in np.linspace(0, 2 * np.pi, 13)]
    hood = lathe([(0.135, -0.2), (0.14, -0.185), (0.06, -0.125), (0.05, -0.085), (0.02, -0.06), (0, -0.05)], 24)
    base = lathe([(0, -0.475), (0.1, -0.475), (0.105, -0.45), (0.085, -0.435), (0, -0.43)], 24)
    bars = [tube([(0.088 * np.sin(a), -0.44, 0.088 * np.cos(a)), (0.105 * np.sin(a), -0.19, 0.105 * np.cos(a))], 0.006, 5)
            for a in np.arange(6) * np.pi / 3]  # fmt: skip
    m.add("Lantern/Swing/frame", merged([tube(ring, 0.006, 6), hood, base, *bars]), "brass")
    flame = lathe([(0, -0.42), (0.026, -0.405), (0.034, -0.36), (0.018, -0.3), (0, -0.262)], 16, refine=2)
    m.add("Lantern/Swing/flame", flame, "flame")


def moving(m: Stage) -> None:
    butterflies(m)
    robin(m)
    falling_leaves(m)
    lantern(m)


def near_path(z: float, off: float) -> tuple[float, float, float]:
    """A place `off` metres to the right of the path's middle at z."""
    x = float(path_x(z)) + off
    return x, float(height(x, z)), z
