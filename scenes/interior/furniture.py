"""Shapes of the library's furniture. Metres, y up; what stands, stands on y = 0; fronts face +z; st in metres."""

import numpy as np
from scenes.making.shapes import Shape, ball, bow, box, lathe, merged, quad, sheet, tube, unit


def cushion(width: float, height: float, depth: float, radius: float, puff: float = 0, steps: int = 7, buttons=None) -> Shape:
    """A box with round edges that stands on the origin; `puff` swells its faces; `buttons` (spacing, depth) tuft its front."""
    half = np.array([width, height, depth]) / 2
    sides = []
    for axis in range(3):
        for sign in (-1, 1):
            first, second = ((axis + 1) % 3, (axis + 2) % 3)[::sign]
            fine = 3 * steps if buttons and axis == 2 and sign > 0 else steps
            counts = [fine if h > 2 * radius else max(3, steps // 2) for h in (half[first], half[second])]
            lines = [_spaced(half[k], radius, count) for k, count in zip((first, second), counts, strict=True)]
            u, v = np.meshgrid(*lines)
            points = np.zeros((*u.shape, 3))
            points[..., first], points[..., second], points[..., axis] = u, v, sign * half[axis]
            core = np.clip(points, radius - half, half - radius)
            out = unit(points - core)
            points = core + radius * out
            swell = np.prod([np.cos(np.pi / 2 * np.clip(points[..., k] / half[k], -1, 1)) for k in (first, second)], axis=0)
            points[..., axis] += sign * puff * swell
            if buttons and axis == 2 and sign > 0:
                points[..., 2] -= _tufts(points[..., 0], points[..., 1], *buttons) * (swell > 0.1) * swell**0.3
            sides.append(sheet(points[:, ::-1], np.stack([u, v], axis=-1)[:, ::-1]))
    return merged(
        [Shape(s.points, s.normals, s.st, s.faces[:, ::-1] if _inside(s) else s.faces) for s in map(_outward, sides)]
    ).at(y=height / 2)


def _spaced(half: float, radius: float, count: int) -> np.ndarray:
    inner = np.linspace(radius - half, half - radius, max(count, 2))
    rim = radius * np.array([1.0, 0.72, 0.36])
    return np.concatenate([-(half - radius) - rim, inner, half - radius + rim[::-1]])


def _outward(side: Shape) -> Shape:
    wrong = (side.normals * side.points).sum() < 0
    return Shape(side.points, -side.normals if wrong else side.normals, side.st, side.faces)


def _inside(side: Shape) -> bool:
    a, b, c = (side.points[side.faces[:, k]] for k in range(3))
    return bool((np.cross(b - a, c - a) * side.normals[side.faces[:, 0]]).sum() < 0)


def _tufts(x: np.ndarray, y: np.ndarray, spacing: float, depth: float) -> np.ndarray:
    """Depth of buttons on a diamond grid, and of the folds between them."""
    a, b = (x + y) / spacing, (x - y) / spacing
    near = np.hypot(a - a.round(), b - b.round()) * spacing
    fold = np.minimum(np.abs(a - a.round()), np.abs(b - b.round())) * spacing
    return depth * (np.exp(-((near / (0.25 * spacing)) ** 2)) + 0.35 * np.exp(-((fold / (0.1 * spacing)) ** 2)))


def armchair() -> dict[str, Shape]:
    """A club chair with rolled arms and a buttoned back, 0.95 wide: parts `leather`, `wood`, `brass`."""
    parts = [cushion(0.62, 0.2, 0.68, 0.06, 0.035).at(0, 0.27, 0.06), cushion(0.9, 0.2, 0.82, 0.04).at(0, 0.09, 0)]
    back = cushion(0.7, 0.6, 0.2, 0.08, 0.02, buttons=(0.2, 0.028)).turned("x", -12).at(0, 0.4, -0.3)
    roll = [tube(bow((-0.36, 0, 0), (0.36, 0, 0), (0, 0, 0), 7), 0.1, 16).at(0, 0.98, -0.45)]
    roll += [ball(0.1, 16, 8).scaled(0.45, 1, 1).at(x, 0.98, -0.45) for x in (-0.36, 0.36)]
    nails = []
    for side in (-1, 1):
        parts.append(cushion(0.14, 0.36, 0.78, 0.04).at(side * 0.385, 0.22, 0.02))
        arm = [(side * 0.405, 0.6, z) for z in np.linspace(-0.42, 0.4, 5)]
        roll += [tube(arm, 0.105, 18), ball(0.105, 18, 8).scaled(1, 1, 0.3).at(side * 0.405, 0.6, 0.4)]
        for a in np.linspace(-200, 20, 15):
            x, y = side * 0.405 + 0.084 * np.cos(np.radians(-a)), 0.6 + 0.084 * np.sin(np.radians(-a))
            nails.append(ball(0.009, 6, 3).at(x, y, 0.424))
        nails += [ball(0.009, 6, 3).at(side * 0.425, 0.2 + 0.03 * k, 0.418) for k in range(12)]
    wing = [cushion(0.1, 0.42, 0.24, 0.045).turned("y", -side * 10).at(side * 0.37, 0.6, -0.3) for side in (-1, 1)]
    feet = [
        lathe([(0.016, 0), (0.022, 0.02), (0.035, 0.08), (0.03, 0.1)], 12).at(x, 0, z)
        for x in (-0.38, 0.38)
        for z in (-0.34, 0.34)
    ]
    return {"leather": merged([*parts, back, *roll, *wing]), "wood": merged(feet), "brass": merged(nails)}


def table(width: float, depth: float, height: float) -> Shape:
    """A library table with turned legs, an apron with a bead, and a top with a moulded edge."""
    leg = [(0.02, 0), (0.034, 0.02), (0.03, 0.07), (0.022, 0.1), (0.04, 0.26), (0.046, 0.36), (0.028, 0.46), (0.028, 0.46),
           (0.044, 0.49), (0.028, 0.52), (0.028, 0.52), (0.04, 0.56), (0.04, 0.56), (0.04, height - 0.05)]  # fmt: skip
    x, z = width / 2 - 0.09, depth / 2 - 0.09
    legs = [lathe(leg, 20, refine=2).at(i * x, 0, j * z) for i in (-1, 1) for j in (-1, 1)]
    apron = [box(2 * x, 0.11, 0.025, 0, height - 0.155, j * z) for j in (-1, 1)]
    apron += [box(0.025, 0.11, 2 * z, i * x, height - 0.155, 0) for i in (-1, 1)]
    top = [
        cushion(width, 0.032, depth, 0.014, steps=3).at(0, height - 0.032, 0),
        box(width - 0.04, 0.016, depth - 0.04, 0, height - 0.048, 0),
    ]
    return merged([*legs, *apron, *top])


def round_table(radius: float, height: float) -> Shape:
    top = [(0, height - 0.035), (radius - 0.05, height - 0.035), (radius - 0.01, height - 0.025), (radius, height - 0.012),
           (radius - 0.006, height), (radius - 0.006, height), (0, height)]  # fmt: skip
    post = [(0.09, 0.07), (0.05, 0.11), (0.035, 0.16), (0.065, 0.24), (0.07, 0.28), (0.035, 0.34), (0.08, height - 0.035)]
    feet = [
        tube([(0, 0.12, 0.05), (0, 0.1, 0.16), (0, 0.05, 0.26), (0, 0.024, 0.32), (0, 0.022, 0.35)], 0.024, 8).turned("y", a)
        for a in (0, 90, 180, 270)
    ]
    return merged([lathe(top, 48), lathe(post, 20, refine=3), *feet])


def side_chair() -> dict[str, Shape]:
    """A chair with a bowed back and a leather seat."""
    wood = [tube([(x, 0, 0.2), (x, 0.43, 0.19)], 0.018, 8) for x in (-0.19, 0.19)]
    wood += [
        tube([(x, 0, -0.24), (x, 0.44, -0.19), (x, 0.75, -0.23), (x * 0.95, 0.95, -0.28)], 0.018, 8) for x in (-0.19, 0.19)
    ]
    wood += [
        box(0.4, 0.05, 0.4, 0, 0.4, 0),
        tube(bow((-0.18, 0.95, -0.28), (0.18, 0.95, -0.28), (0, 0.05, -0.03), 9), 0.024, 8),
    ]
    wood += [tube([(x, 0.45, -0.19), (x, 0.75, -0.235), (x, 0.97, -0.29)], 0.009, 6) for x in (-0.11, -0.055, 0, 0.055, 0.11)]
    wood += [tube([(-0.19, 0.16, 0.2), (-0.19, 0.16, -0.22)], 0.01, 6), tube([(0.19, 0.16, 0.2), (0.19, 0.16, -0.22)], 0.01, 6)]
    return {"wood": merged(wood), "leather": cushion(0.42, 0.07, 0.42, 0.025, 0.012, steps=5).at(0, 0.44, 0)}


def banker_lamp() -> dict[str, Shape]:
    """Brass foot and stem, a green glass trough over a bulb: parts `brass`, `glass`, `bulb`. The trough lies along x."""
    foot = lathe([(0.1, 0), (0.1, 0.012), (0.085, 0.022), (0.03, 0.032), (0.016, 0.05), (0.01, 0.09), (0.016, 0.11),
                (0.009, 0.13),
                  (0.009, 0.33)], 24)  # fmt: skip
    arm = tube([(0, 0.33, 0), (0, 0.37, 0.005), (0, 0.395, 0.03), (0, 0.4, 0.06)], 0.007, 8)
    chain = tube([(0.05, 0.35, 0.06), (0.05, 0.24, 0.06)], 0.0016, 4)
    caps = [ball(0.011, 10, 6).at(x, 0.36, 0.055) for x in (-0.14, 0.14)]
    angle, along = np.meshgrid(np.radians(np.linspace(-78, 82, 13)), np.linspace(-0.135, 0.135, 9))
    squeeze = 1 - 0.25 * (np.abs(along) / 0.135) ** 6
    points = np.stack([along, 0.33 + 0.072 * np.cos(angle) * squeeze, 0.055 + 0.085 * np.sin(angle) * squeeze], axis=-1)
    trough = sheet(points, np.stack([along, angle * 0.07], axis=-1))
    ends = []
    for side in (-1, 1):
        rim = points[-1 if side > 0 else 0]
        fan = np.concatenate([rim, [[side * 0.135, 0.335, 0.055]]])
        faces = np.array([[k, k + 1, len(rim)] for k in range(len(rim) - 1)])
        ends.append(
            Shape(fan, np.tile((float(side), 0, 0), (len(fan), 1)), fan[:, 2:0:-1], faces if side > 0 else faces[:, ::-1])
        )
    bulb = tube([(-0.1, 0.345, 0.055), (0.1, 0.345, 0.055)], 0.014, 8)
    bead = ball(0.006, 6, 4).at(0.05, 0.238, 0.06)
    return {"brass": merged([foot, arm, chain, *caps, bead]), "glass": merged([trough, *ends]), "bulb": bulb}


def shade(low: float, high: float, height: float, y: float) -> Shape:
    """A cloth lampshade, open at both ends; st from 0 to 1."""
    pleats = [
        (low, y),
        (low * 0.72 + high * 0.28, y + height * 0.25),
        (low * 0.45 + high * 0.55, y + height * 0.53),
        (high, y + height),
    ]
    return lathe(pleats, 40)


def lamp_foot(height: float, kind: str) -> Shape:
    """A vase (`table`) or a tall turned post (`floor`) that carries a shade."""
    if kind == "table":
        body = [(0.07, 0), (0.075, 0.012), (0.05, 0.02), (0.075, 0.07), (0.1, 0.15), (0.085, 0.22), (0.035, 0.27), (0.02, 0.29)]
        return merged([lathe(body, 32, refine=3), tube([(0, 0.28, 0), (0, height, 0)], 0.006, 6)])
    foot = [(0.15, 0), (0.15, 0.018), (0.13, 0.03), (0.05, 0.04), (0.022, 0.07), (0.016, 0.12), (0.014, height * 0.5),
                (0.03, height * 0.53),
            (0.014, height * 0.56), (0.012, height)]  # fmt: skip
    return lathe(foot, 24)


def picture(width: float, height: float, panel: int) -> dict[str, Shape]:
    """A picture in a carved frame, its middle at the origin; `panel` 0 to 2 of the image's three."""
    rims = []
    for k, (inset, z) in enumerate(((0.0, 0.02), (0.03, 0.035), (0.07, 0.012))):
        thick = 0.035
        w, h = width + 0.15 - 2 * inset, height + 0.15 - 2 * inset
        rims += [box(w, thick, 0.03, 0, s * (h - thick) / 2 - thick / 2, z + 0.002 * k) for s in (-1, 1)]
        rims += [box(thick, h, 0.028, s * (w - thick) / 2, -h / 2, z + 0.002 * k) for s in (-1, 1)]
    canvas = quad((-width / 2, -height / 2, 0.008), (width, 0, 0), (0, height, 0), st=(1 / 3, 1))
    moved = Shape(canvas.points, canvas.normals, canvas.st + [panel / 3, 0], canvas.faces)
    return {"gold": merged(rims), "canvas": moved}


def curtain(width: float, height: float, seed: int) -> Shape:
    """A drawn curtain that hangs in folds, gathered at two fifths of its height."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, 72), np.linspace(0, 1, 18))
    phase, waves = rng.uniform(0, 6, 4), rng.uniform(0.6, 1.3, 4)
    tie = np.exp(-(((v - 0.4) / 0.14) ** 2))
    fold = sum(np.sin(2 * np.pi * (5 + 1.7 * k) * u * waves[k] + phase[k]) / (1 + k) for k in range(4))
    x = (u - 0.5) * width * (1 - 0.45 * tie) - 0.2 * width * tie
    z = 0.045 * fold * (0.65 + 0.5 * (1 - v)) * (1 - 0.35 * tie) + 0.05 * tie
    return sheet(np.stack([x, v * height, z], axis=-1), np.stack([u * width * 1.8, v * height], axis=-1))


def candle(height: float) -> dict[str, Shape]:
    """A candlestick with its candle: parts `brass`, `wax`, `flame`."""
    stick = lathe([(0.05, 0), (0.05, 0.01), (0.018, 0.03), (0.01, 0.08), (0.018, 0.12), (0.01, 0.16), (0.028, 0.19),
                (0.028, 0.2),
                   (0.0, 0.2)], 20)  # fmt: skip
    wax = lathe([(0.0105, 0.2), (0.0105, 0.2 + height), (0.008, 0.203 + height), (0, 0.2 + height)], 12)
    flame = lathe(
        [(0, 0.205 + height), (0.005, 0.212 + height), (0.0065, 0.22 + height), (0.004, 0.235 + height), (0, 0.25 + height)], 10
    )
    return {"brass": stick, "wax": wax, "flame": flame}
