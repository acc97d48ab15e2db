"""What moves, and the lights. Everything repeats after four seconds."""

from collections.abc import Callable

import numpy as np
from pxr import Gf, UsdGeom, UsdLux
from scenes.making.shapes import Shape, ball, lathe, merged, quad, sheet
from scenes.making.usd_stage import RATE, Stage

from .centre import brazier, gate_leaf, lantern_body
from .plants import strand
from .sky import TO_SUN

PERIOD = 4.0
TURN = 2 * np.pi / PERIOD  # radians a second, once around


def lamp(m: Stage, path: str, color, intensity: Callable[[float], float], place) -> UsdLux.SphereLight:
    """A point light of `intensity` W/sr at the seconds t; `place` a constant or a function of them."""
    light = UsdLux.SphereLight.Define(m.stage, f"{m.root}/{path}")
    light.CreateRadiusAttr(0)
    light.CreateTreatAsPointAttr(True)
    light.CreateColorAttr(Gf.Vec3f(*color))
    value = light.CreateIntensityAttr()
    for time in m.times:
        value.Set(round(4 * float(intensity(time / RATE)), 4), time)  # a sphere of radius 0: intensity / 4
    if callable(place):
        m.animate(UsdGeom.Xformable(light), "translate", place)
    else:
        UsdGeom.Xformable(light).AddTranslateOp().Set(Gf.Vec3d(*place))
    return light


def flicker(t: float, seed: int) -> float:
    """About 0.75 to 1.25, periodic."""
    rng = np.random.default_rng(seed)
    return 1 + sum(
        a * np.sin(n * TURN * t + p)
        for n, a, p in zip((5, 9, 13, 22, 31), (0.06, 0.07, 0.06, 0.04, 0.03), rng.uniform(0, 6.3, 5), strict=True)
    )


def lantern(m: Stage, place) -> None:
    m.group("Lantern", place)
    swing = m.group("Lantern/Swing")
    m.animate(swing, "rotateX", lambda t: 21 * np.sin(2 * TURN * t))
    m.animate(swing, "rotateZ", lambda t: 9 * np.sin(2 * TURN * t + 1.3))
    m.add("Lantern/Swing/body", lantern_body(), "bronze")
    tongue = lathe([(0, -1.855), (0.022, -1.835), (0.026, -1.81), (0.014, -1.77), (0, -1.74)], 10, refine=2)
    m.add("Lantern/Swing/flame", tongue, "flame")
    lamp(m, "Lantern/Swing/light", (1.0, 0.62, 0.28), lambda t: 13.0 * (1 + 0.5 * (flicker(t, 400) - 1)), (0, -1.69, 0))


def fire(m: Stage, name: str, place, seed: int, strength: float) -> None:
    brazier(m, name, place)
    rng = np.random.default_rng(seed)
    for k in range(6):
        a, r, tall = 1.1 * k, 0.0 if k == 0 else 0.17, 0.55 if k == 0 else rng.uniform(0.26, 0.42)
        tongue, foot = m.group(f"{name}/Flame{k}"), np.array([r * np.sin(a), 0.92, r * np.cos(a)])
        speed, phase = int(rng.integers(5, 10)), rng.uniform(0, 6.3)
        m.animate(tongue, "translate", lambda t, s=speed, p=phase, f=foot: f + [0, 0.05 * np.sin(s * TURN * t + p), 0])
        m.animate(tongue, "rotateZ", lambda t, s=speed, p=phase: 13 * np.sin((s - 2) * TURN * t + 2 * p))
        profile = [(0, -0.05), (0.1, 0.02), (0.115, 0.12), (0.07, 0.3), (0.03, 0.42), (0, 0.55)]
        shape = lathe([(x * (0.6 + 0.6 * tall), y * tall / 0.55) for x, y in profile], 9, refine=2)
        twist = 0.05 * np.sin(9 * shape.points[:, 1:2] / tall + k) * np.clip(shape.points[:, 1:2] / tall, 0, 1)
        m.add(f"{name}/Flame{k}/fire", Shape(shape.points + twist * [1, 0, 0.6], shape.normals, shape.st, shape.faces), "flame")

    def sway(t: float) -> tuple[float, float, float]:
        return 0.035 * np.sin(7 * TURN * t + seed), 1.68 + 0.04 * np.sin(11 * TURN * t), 0.035 * np.cos(9 * TURN * t)

    lamp(m, f"{name}/light", (1.0, 0.48, 0.16), lambda t: strength * flicker(t, seed), sway)


def crow(m: Stage, name: str, centre, radius: tuple[float, float], beats: int, phase: float, way: int) -> None:
    """Flies an ellipse about `centre` once in four seconds, beating its wings `beats` times."""

    def place(t: float) -> tuple[float, float, float]:
        a = way * TURN * t + phase
        return centre[0] + radius[0] * np.sin(a), centre[1] + 0.5 * np.sin(2 * a + phase), centre[2] + radius[1] * np.cos(a)

    bird = m.group(name)
    m.animate(bird, "translate", place)

    def heading(t: float) -> float:  # its beak is towards -x; unwrapped, so that nothing is interpolated across a jump
        turns = way * (TURN * t) + phase
        dx, dz = way * radius[0] * np.cos(turns), -way * radius[1] * np.sin(turns)
        angle = np.degrees(np.arctan2(dz, -dx))
        full = np.degrees(turns)
        return angle + 360 * np.round((full - angle) / 360)

    m.animate(bird, "rotateY", heading)
    m.animate(bird, "rotateX", lambda t: -22 * way)
    body = lathe([(0, -0.2), (0.03, -0.17), (0.06, -0.06), (0.062, 0.05), (0.04, 0.12), (0, 0.15)], 12, refine=2).turned(
        "z", 90
    )
    tail = quad((0.12, 0.0, 0.035), (0, 0, -0.07), (0.17, 0.0, -0.03))
    beak = lathe([(0.018, 0), (0, 0.07)], 6).turned("z", 90).at(-0.2, 0.03, 0)
    m.add(f"{name}/body", merged([body, ball(0.045, 10, 7).at(-0.17, 0.03, 0), tail, beak]), "feather")
    for side_name, side in (("Left", 1), ("Right", -1)):
        wing = m.group(f"{name}/{side_name}", (0, 0.03, 0.03 * side))
        m.animate(wing, "rotateX", lambda t, side=side: side * (-8 + 42 * np.sin(beats * TURN * t + phase)))
        z, x = np.meshgrid(np.linspace(0, 0.42, 7) * side, np.linspace(-1, 1, 3))
        span = np.abs(z) / 0.42
        x = 0.01 + x * 0.1 * (1 - 0.6 * span**2) + 0.14 * span
        shape = sheet(np.stack([x, 0.04 * np.sin(3 * span), z], axis=-1)[::side], np.stack([x, z], axis=-1)[::side])
        m.add(f"{name}/{side_name}/wing", shape, "feather")


def leaves(m: Stage) -> None:
    """Dry leaves in an eddy beside the fountain."""
    rng = np.random.default_rng(410)
    card = quad((-0.035, -0.035, 0), (0.07, 0, 0), (0, 0.07, 0))
    bent = Shape(
        card.points + [[0.01, 0.01, 0.014], [0, 0, -0.007], [-0.01, -0.01, 0.014], [0, 0, -0.007]],
        card.normals,
        card.st,
        card.faces,
    )
    for k in range(12):
        r, height, speed, phase = rng.uniform(0.35, 1.2), rng.uniform(0.15, 1.2), int(rng.integers(1, 3)), rng.uniform(0, 6.3)
        x, z = (4.2, -4.3) if k % 2 else (-1.2, -3.4)
        leaf = m.group(f"Leaves/Leaf{k}")

        def place(t: float, r=r, height=height, speed=speed, phase=phase, x=x, z=z) -> tuple[float, float, float]:
            a = speed * TURN * t + phase
            return x + r * np.sin(a), 0.12 + height * (0.5 + 0.5 * np.sin(2 * a + phase)), z + r * np.cos(a) * 0.8

        m.animate(leaf, "translate", place)
        for op, spin, begin in ((leaf.AddRotateXOp(), 180 * speed, 57 * phase), (leaf.AddRotateYOp(), 90, 80 * phase)):
            for time in (m.times[0], m.times[-1]):  # linear between them
                op.Set(round(spin * time / RATE + begin, 3), time)
        m.add(f"Leaves/Leaf{k}/blade", bent, ("clay", "clay_pale", "clay_dark")[k % 3])


def strands(m: Stage) -> None:
    spots = (
        (4.72, 4.72, -2.6),
        (4.74, 4.9, -9.3),
        (4.72, 4.6, -6.1),
        (-4.7, 4.3, -4.4),
        (-1.1, 4.6, -19.64),
        (1.35, 4.55, -19.64),
        (5.3, 4.7, -2.2),
    )
    shapes = [strand(1.5, 420), strand(1.1, 421)]
    for k, (x, y, z) in enumerate(spots):
        hung = m.group(f"Strands/Strand{k}", (x, y, z), 50.0 * k)
        m.animate(hung, "rotateX", lambda t, k=k: 7 * np.sin(2 * TURN * t + k) + 2.5 * np.sin(5 * TURN * t + 2 * k))
        m.animate(hung, "rotateZ", lambda t, k=k: 5 * np.sin(3 * TURN * t + 1.7 * k))
        m.add(f"Strands/Strand{k}/leaves", shapes[k % 2], "ivy")


def sun(m: Stage) -> None:
    """Ten degrees to and fro in four seconds: shadows sweep over the brick."""
    m.light(TO_SUN, 5.4, (1.0, 0.74, 0.46), sky=1.45)
    prim = UsdGeom.Xformable(m.stage.GetPrimAtPath(f"{m.root}/Sun"))
    for op in prim.GetOrderedXformOps():
        if op.GetOpName() == "xformOp:rotateY":
            middle = op.Get()
            for time in m.times:
                op.Set(round(float(middle + 5 * np.sin(TURN * time / RATE)), 4), time)


def moving(m: Stage) -> None:
    lantern(m, (5.0, 4.5, -4.25))
    fire(m, "BrazierRight", (3.25, 0, -5.9), 401, 8.0)
    fire(m, "BrazierLeft", (-3.1, 0, -11.4), 402, 8.0)
    leaf = gate_leaf(1.72, 2.75)
    for side, name in ((1, "Left"), (-1, "Right")):
        m.group(f"Gate/{name}", (-1.74 * side, 0, -19.95), 0 if side > 0 else 180)
        hinge = m.group(f"Gate/{name}/Hinge")
        m.animate(
            hinge, "rotateY", lambda t, s=side: (-34 + 20 * np.sin(TURN * t)) if s > 0 else (62 + 14 * np.sin(TURN * t + 2))
        )
        m.add(f"Gate/{name}/Hinge/bars", leaf, "iron")
    crow(m, "Crows/Crow0", (0.6, 4.2, -5.0), (4.6, 6.0), 14, 2.4, 1)
    crow(m, "Crows/Crow1", (-1.5, 6.4, -13.0), (5.0, 4.0), 12, 0.3, -1)
    crow(m, "Crows/Crow2", (1.0, 7.6, -15.0), (6.5, 5.0), 13, 4.1, 1)
    leaves(m)
    strands(m)
    sun(m)
