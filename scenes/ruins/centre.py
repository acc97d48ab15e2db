"""The middle of the ruins: a basin with a robed figure, fallen columns, braziers, the lantern's body, the gate's leaf."""

import numpy as np
from scenes.making.shapes import Shape, ball, box, lathe, merged, sheet, tube, unit
from scenes.making.usd_stage import Stage

from .masonry import BASE, CAPITAL, drum, flat, lathed

AT = np.array([0.0, 0.0, -7.0])


def basin(m: Stage) -> None:
    m.group("Fountain", AT)
    steps = []
    for inner, outer, low, high, seed in ((1.75, 2.1, 0.0, 0.62, 1), (2.0, 2.75, -0.05, 0.16, 2)):
        rng = np.random.default_rng(320 + seed)
        for k in range(8 * seed):
            a0, a1 = (np.pi / 4 / seed * k + rng.uniform(0.004, 0.012), np.pi / 4 / seed * (k + 1) - rng.uniform(0.004, 0.012))
            top = high + rng.normal(0, 0.008)
            p = {
                (i, j, y): (r * np.sin(a), y, r * np.cos(a))
                for i, a in enumerate((a0, a1))
                for j, r in enumerate((inner, outer + 0.0))
                for y in (low, top)
            }
            bevel = 0.03
            out = {(i, y): np.array(p[i, 1, y]) * [1 + bevel / outer, 1, 1 + bevel / outer] for i in (0, 1) for y in (low, top)}
            lip = [out[i, top] - [0, bevel, 0] for i in (0, 1)]
            run = float(outer * (a1 - a0))
            shift = float(rng.uniform(0, 2))
            st = np.array([(0, 0), (run, 0), (run, outer - inner), (0, outer - inner)]) + shift
            tall = np.array([(0, 0), (run, 0), (run, high - low), (0, high - low)]) + shift
            steps += [
                flat([p[0, 1, top], p[1, 1, top], p[1, 0, top], p[0, 0, top]], st),
                flat([out[0, low], out[1, low], lip[1], lip[0]], tall),
                flat([lip[0], lip[1], p[1, 1, top], p[0, 1, top]], tall * [1, 0.1]),
                flat([p[1, 0, low], p[0, 0, low], p[0, 0, top], p[1, 0, top]], tall),
                flat([p[0, 0, low], p[0, 1, low], p[0, 1, top], p[0, 0, top]], tall),
                flat([p[1, 1, low], p[1, 0, low], p[1, 0, top], p[1, 1, top]], tall),
            ]
    m.add_faceted("Fountain/rim", merged(steps), "stone")
    angle = np.linspace(0, 2 * np.pi, 41)[:-1]
    ring = np.stack([1.78 * np.sin(angle), 0 * angle + 0.44, 1.78 * np.cos(angle)], axis=-1)
    points = np.concatenate([[[0, 0.44, 0]], ring])
    fan = np.array([[0, k + 1, (k + 1) % 40 + 1] for k in range(40)])
    m.add("Fountain/water", Shape(points, np.tile((0.0, 1, 0), (41, 1)), points[:, [0, 2]], fan), "water")
    rng = np.random.default_rng(325)
    afloat = []
    for _ in range(26):
        r, a, size = rng.uniform(0.75, 1.7), rng.uniform(0, 6.3), rng.uniform(0.03, 0.07)
        leaf = np.array([(-1, 0, 0), (0, 0.1, 0.55), (1.1, 0.05, 0), (0, 0.15, -0.55)]) * size
        shape = flat(leaf, leaf[:, [0, 2]]).turned("y", np.degrees(rng.uniform(0, 6.3)))
        afloat.append(shape.at(r * np.sin(a), 0.445, r * np.cos(a)))
    m.add_faceted("Fountain/floating", merged(afloat), "clay_pale")
    foot = [
        (0.62, 0.2), (0.62, 0.55), (0.62, 0.55), (0.54, 0.62), (0.46, 0.7), (0.44, 1.2),
        (0.48, 1.3), (0.60, 1.36), (0.60, 1.36), (0.60, 1.5), (0.60, 1.5), (0, 1.5),
    ]  # fmt: skip
    m.add("Fountain/pedestal", lathed(foot, 8).turned("y", 22.5), "stone_dark")


def limb(path, radii, tall: float) -> Shape:
    """A rounded tube of changing radius, `tall` times as high as wide, closed by cones."""
    line, radii = np.array(path, dtype=float), np.array(radii)
    steps = np.linspace(0, len(line) - 1, 3 * len(line) - 2)
    line = np.stack([np.interp(steps, range(len(line)), line[:, k]) for k in range(3)], axis=-1)
    smoothed = line.copy()
    for _ in range(3):
        smoothed[1:-1] = (smoothed[:-2] + 2 * smoothed[1:-1] + smoothed[2:]) / 4
    radii = np.interp(steps, range(len(radii)), radii)
    tangents = unit(np.gradient(smoothed, axis=0))
    side = unit(np.cross(np.tile((0.0, 1.0, 0.0), (len(tangents), 1)), tangents))
    up = np.cross(tangents, side)
    angle = np.linspace(0, 2 * np.pi, 10)
    rings = smoothed[:, None] + radii[:, None, None] * (
        np.cos(angle)[:, None] * side[:, None] + tall * np.sin(angle)[:, None] * up[:, None]
    )
    rings = np.concatenate(
        [np.broadcast_to(smoothed[:1, None], rings[:1].shape), rings, np.broadcast_to(smoothed[-1:, None], rings[:1].shape)]
    )
    st = np.stack(np.broadcast_arrays(np.arange(len(rings))[:, None] * 0.03, angle[None] * 0.12), axis=-1)
    shape = sheet(rings, st)
    centre = np.repeat(np.concatenate([smoothed[:1], smoothed, smoothed[-1:]]), 10, axis=0)
    outward = np.sum((shape.points - centre) * shape.normals, axis=1).mean() > 0
    return shape if outward else Shape(shape.points, -shape.normals, shape.st, shape.faces[:, ::-1])


def figure(m: Stage) -> None:
    """A hooded figure as a control mesh of a subdivision surface: folds as ridges around an ellipse."""
    around, rows = 44, 46
    t = np.linspace(0, 1, rows)[:, None]
    a = np.linspace(0, 2 * np.pi, around, endpoint=False)[None, :]
    knots = np.array(
        [  # height, half width, half depth, forward
            (0.00, 0.40, 0.36, 0.00), (0.05, 0.385, 0.35, 0.00), (0.30, 0.315, 0.28, 0.01), (0.55, 0.285, 0.24, 0.01),
            (0.80, 0.275, 0.21, 0.0), (1.02, 0.265, 0.20, 0.0), (1.22, 0.295, 0.215, 0.0), (1.40, 0.32, 0.205, -0.01),
            (1.50, 0.30, 0.185, -0.015), (1.565, 0.21, 0.15, -0.005), (1.60, 0.145, 0.135, 0.02), (1.68, 0.142, 0.158, 0.05),
            (1.78, 0.145, 0.168, 0.05), (1.86, 0.122, 0.145, 0.035), (1.92, 0.085, 0.10, 0.02), (1.95, 0.04, 0.05, 0.01),
            (1.957, 0.002, 0.002, 0.01),
        ]
    )  # fmt: skip
    along = np.linspace(0, 1, len(knots))
    y, wide, deep, ahead = (np.interp(t, along, knots[:, k]) for k in range(4))
    front = np.cos(a)  # 1 towards +z
    below = np.clip(1 - y / 1.15, 0, 1)
    ridges = 0.5 - np.abs(np.cos(5.5 * a + 1.1 * np.sin(2.3 * y) + 0.8))
    folds = 0.15 * ridges + 0.035 * np.cos(17 * a + 3 * y) + 0.03 * np.cos(4 * a - 1.3)
    r = 1 + folds * (0.16 + 1.25 * below) * np.clip((1.55 - y) * 4, 0, 1)
    belt = np.exp(-(((y - 0.985) / 0.05) ** 2))
    r = r - 0.09 * belt
    hollow = np.exp(-(((y - 1.735) / 0.085) ** 2)) * np.exp(-((np.sin(a) / 0.5) ** 2)) * (front > 0)
    r = r - 0.72 * hollow  # the dark in the hood
    x, z = wide * r * np.sin(a), deep * r * front + ahead
    noise = np.random.default_rng(330).normal(0, 0.003, (rows, around)) * (y < 1.8)
    points = np.stack([x * (1 + noise), y + 0 * a, z * (1 + noise)], axis=-1).reshape(-1, 3)
    index = np.arange(rows * around).reshape(rows, around)
    right = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], right[:-1], right[1:], index[1:]], axis=-1).reshape(-1, 4)
    st = np.stack(
        [np.broadcast_to(np.arange(around + 1) / around * 2.0, (rows, around + 1)), np.broadcast_to(y, (rows, around + 1))], -1
    )
    cell = np.arange(rows * (around + 1)).reshape(rows, around + 1)
    corners = np.stack([cell[:-1, :-1], cell[:-1, 1:], cell[1:, 1:], cell[1:, :-1]], axis=-1).reshape(-1, 4)
    m.add_subdivided(
        "Fountain/figure", points, quads, st.reshape(-1, 2), corners, "marble", place=(0, 1.495, 0), turn=24, size=1.14
    )
    arms = []
    for s in (-1, 1):
        arms.append(
            limb(
                [
                    (0.24 * s, 1.44, -0.02),
                    (0.335 * s, 1.30, 0.0),
                    (0.37 * s, 1.10, 0.04),
                    (0.30 * s, 1.02, 0.15),
                    (0.17 * s, 1.06, 0.25),
                    (0.07 * s, 1.10, 0.29),
                ],
                [0.085, 0.105, 0.115, 0.125, 0.14, 0.15],
                1.25,
            )
        )
        arms.append(
            limb(
                [(0.12 * s, 1.09, 0.27), (0.03 * s, 1.12, 0.31), (-0.03 * s, 1.13 + 0.03 * s, 0.315)], [0.05, 0.055, 0.035], 0.8
            )
        )
        cord = [(0.02 * s, 0.985, 0.20), (0.035 * s, 0.9, 0.235), (0.05 * s, 0.72, 0.265), (0.055 * s, 0.5 + 0.06 * s, 0.30)]
        arms.append(tube(cord, 0.016, 6))
    hood = [(0.135 * np.sin(a), 1.745 + 0.165 * np.cos(a), 0.135 + 0.045 * np.cos(a)) for a in np.linspace(-2.5, 2.5, 9)]
    arms.append(limb(hood, [0.03 + 0.012 * np.cos(a) for a in np.linspace(-2.5, 2.5, 9)], 1.0))
    cowl = [(0.245 * np.sin(a), 1.535 + 0.03 * np.cos(2 * a), 0.015 + 0.20 * np.cos(a)) for a in np.linspace(0, 2 * np.pi, 15)]
    arms.append(limb(cowl, [0.062 + 0.012 * np.cos(3 * a) for a in np.linspace(0, 2 * np.pi, 15)], 0.9))
    rope = [(0.262 * np.sin(a), 0.985 + 0.02 * np.cos(a), 0.205 * np.cos(a)) for a in np.linspace(0, 2 * np.pi, 21)]
    arms.append(tube(rope, 0.02, 5))
    face = ball(0.1, 12, 8).scaled(0.84, 1.2, 0.8).at(0, 1.735, 0.095)
    m.add("Fountain/face", face, "stone_dark", (0, 1.495, 0), 24, 1.14)
    m.group("Fountain/robe", (0, 1.495, 0), 24)
    m.add("Fountain/robe/parts", merged(arms), "marble", size=1.14)


def brazier(m: Stage, name: str, place) -> None:
    """A bowl of coals on three legs; the fire itself is in moving.py."""
    m.group(name, place)
    bowl = lathe(
        [
            (0.02, 0.78),
            (0.2, 0.82),
            (0.31, 0.92),
            (0.36, 1.02),
            (0.385, 1.03),
            (0.38, 1.045),
            (0.345, 1.03),
            (0.28, 0.94),
            (0, 0.93),
        ],
        28,
    )
    legs = []
    for a in np.radians([10, 130, 250]):
        s, c = np.sin(a), np.cos(a)
        legs.append(
            tube(
                [(0.40 * s, 0, 0.40 * c), (0.22 * s, 0.4, 0.22 * c), (0.17 * s, 0.62, 0.17 * c), (0.27 * s, 0.88, 0.27 * c)],
                0.017,
                6,
            )
        )
    hoop = [(0.235 * np.sin(a), 0.38, 0.235 * np.cos(a)) for a in np.linspace(0, 2 * np.pi, 25)]
    m.add(f"{name}/stand", merged([bowl, *legs, tube(hoop, 0.012, 5)]), "wrought")
    rng = np.random.default_rng(340)
    coals = [
        ball(rng.uniform(0.045, 0.075), 5, 3)
        .scaled(1, 0.7, 1)
        .at(*(0.24 * rng.uniform(-1, 1, 2)).tolist()[:1], 0.97 + 0.03 * rng.uniform(), 0.22 * rng.uniform(-1, 1))
        for _ in range(26)
    ]
    m.add_faceted(f"{name}/coals", merged(coals), "coal")


def lantern_body() -> Shape:
    """Hangs from the origin: chain, roof, eight bars, floor; the light hangs 0.62 m above the floor's top."""
    links = []
    for k in range(14):
        y = -0.045 - 0.09 * k
        ring = [(0.018 * np.sin(a), y + 0.055 * np.cos(a), 0.0) for a in np.linspace(0, 2 * np.pi, 8)]
        links.append(tube(ring, 0.005, 3).turned("y", 90 * (k % 2)))
    top = -1.3
    roof = lathe(
        [(0.235, top - 0.16), (0.24, top - 0.14), (0.13, top - 0.05), (0.045, top), (0.03, top + 0.03), (0, top + 0.035)], 8
    )
    floor = lathe([(0.10, top - 0.74), (0.17, top - 0.72), (0.185, top - 0.68), (0.15, top - 0.675), (0, top - 0.675)], 8)
    bars = []
    for k in range(8):
        a = np.pi / 4 * k + np.pi / 8
        s, c = np.sin(a), np.cos(a)
        bars.append(
            tube(
                [(0.165 * s, top - 0.68, 0.165 * c), (0.205 * s, top - 0.42, 0.205 * c), (0.215 * s, top - 0.15, 0.215 * c)],
                0.008,
                5,
            )
        )
    for y, r in ((top - 0.5, 0.197), (top - 0.32, 0.209)):
        bars.append(tube([(r * np.sin(a), y, r * np.cos(a)) for a in np.linspace(0, 2 * np.pi, 17)], 0.006, 4))
    candle = lathe([(0.035, top - 0.675), (0.035, top - 0.56), (0, top - 0.555)], 10)
    return merged([*links, roof, floor, *bars, candle])


def gate_leaf(width: float, height: float) -> Shape:
    """Bars of 16 mm every 11 cm with spear heads, from the hinge at the origin along +x; 9 mm bars between them below."""
    count = int(round(width / 0.11))
    xs = np.linspace(0.03, width - 0.03, count + 1)
    parts = []
    for k, x in enumerate(xs):
        rise = height * (0.88 + 0.12 * np.sin(np.pi / 2 * x / width))
        parts.append(tube([(x, 0.08, 0), (x, rise, 0)], 0.008 if 0 < k < count else 0.016, 4))
        parts.append(lathe([(0.0, rise - 0.01), (0.02, rise + 0.03), (0.012, rise + 0.07), (0, rise + 0.16)], 4).at(x, 0, 0))
    parts += [tube([(x, 0.12, 0), (x, 0.95, 0)], 0.0045, 4) for x in (xs[:-1] + xs[1:]) / 2]
    parts += [box(width - 0.04, 0.03, 0.02, width / 2, y, 0) for y in (0.12, 0.95, height * 0.82)]
    for x in (xs[:-1] + xs[1:]) / 2:
        parts.append(
            tube(
                [(x + 0.036 * np.sin(a), height * 0.74 + 0.036 * np.cos(a), 0) for a in np.linspace(0, 2 * np.pi, 7)], 0.005, 3
            )
        )
    return merged(parts)


def capital() -> Shape:
    """A bell under its abacus, 57 cm high, standing on the origin."""
    return merged([lathed(((0, 0), (0, 0), (0.255, 0), *CAPITAL), 24, 2), box(0.92, 0.13, 0.86, 0, 0.44, 0)])


def column(m: Stage, name: str, place, seed: int, standing: float = 1.0, whole: bool = True) -> None:
    """A column of 3.1 m on its base: three drums, capital and abacus, or what stands of it (metres of shaft)."""
    m.group(name, place, (seed * 47) % 360)
    m.add(f"{name}/base", merged([box(0.9, 0.14, 0.9, 0, -0.02, 0), lathed(BASE, 24, 2).at(0, 0.12, 0)]), "stone")
    if whole:
        m.add(f"{name}/shaft", drum(0.275, 0.245, 2.04, 350 + seed % 3), "stone", (0, 0.44, 0))
        m.add(f"{name}/capital", capital(), "stone", (0, 2.48, 0))
    else:
        m.add(f"{name}/stump", drum(0.275, 0.265, standing, 360 + seed, 20), "stone", (0, 0.44, 0))
