"""The square itself: cobbles in panels between stone bands, gutters, grime and puddles, fallen leaves, the fountain."""

import numpy as np
from scenes.making.shapes import Shape, ball, box, lathe, merged, quad, sheet, tube
from scenes.making.usd_stage import Stage

XS, ZS = (-32, -6.6, 1.05, 8.7, 32), (16, 9.2, 2.75, -4.9, -32)  # where the stone bands run
TURNS = np.array([[0, 1, 0, 1], [3, 0, 1, 2], [0, 3, 0, 1], [1, 0, 3, 0]])  # quarter turns of each panel's setts
BAND = 0.44


def laid(points: np.ndarray) -> np.ndarray:
    """st, in metres, of cobbles at points [N, 3]: panels are turned and shifted, so that no pattern runs on."""
    column = np.clip(np.searchsorted(XS, points[:, 0].mean()) - 1, 0, 3)
    line = np.clip(np.searchsorted(-np.array(ZS), -points[:, 2].mean()) - 1, 0, 3)
    angle = np.radians(90) * TURNS[line, column]
    x, y = points[:, 0] + 1.3 * column, -points[:, 2] + 0.9 * line
    return np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], axis=-1)


def blot(
    x: float, z: float, width: float, depth: float, y: float, seed: int, ragged: float = 0.16, corners: float = 2
) -> Shape:
    """A flat patch with a ragged outline; corners: 2 makes an ellipse, more a rounded rectangle."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    radius = 1 + ragged * sum(rng.normal() / k**0.8 * np.sin(k * angle + rng.uniform(0, 7)) for k in (2, 3, 5, 8, 13, 21))
    c, s = np.cos(angle), np.sin(angle)
    radius = radius / (np.abs(c) ** corners + np.abs(s) ** corners) ** (1 / corners)
    rim = np.stack([x + radius * c * width / 2, np.full(72, y), z - radius * s * depth / 2], axis=-1)
    points = np.concatenate([[[x, y, z]], rim])
    around = np.arange(72)
    faces = np.stack([0 * around, 1 + around, 1 + (around + 1) % 72], axis=-1)
    return Shape(points, np.tile((0.0, 1.0, 0.0), (73, 1)), laid(points), faces)


def seam(start, end, width: float, seed: int, y: float = 0.0015) -> Shape:
    """Grime along a wall's foot from start to end (x, z), to the left of that direction, with a ragged edge."""
    rng = np.random.default_rng(seed)
    a, b = np.array(start, float), np.array(end, float)
    count = max(4, int(np.linalg.norm(b - a) / 0.2))
    t = np.linspace(0, 1, count)[:, None]
    along = (b - a) / np.linalg.norm(b - a)
    wide = width * (0.65 + 0.35 * np.convolve(rng.normal(0, 1, count + 4), np.ones(5) / 2.2, "valid"))
    inner = a + (b - a) * t
    outer = inner + np.array([along[1], -along[0]]) * np.clip(wide, 0.05, 2 * width)[:, None]
    rows = [np.insert(line, 1, y, axis=1) for line in (inner, outer)]
    points = np.stack(rows)
    return sheet(points, laid(points.reshape(-1, 3)).reshape(2, count, 2))


def band(x0: float, z0: float, x1: float, z1: float) -> Shape:
    """One row of slabs from corner to corner, 6 mm proud of the cobbles."""
    long = max(x1 - x0, z1 - z0)
    slab = box(x1 - x0, 0.05, z1 - z0, (x0 + x1) / 2, -0.044, (z0 + z1) / 2)
    run, across = (0, 2) if x1 - x0 == long else (2, 0)
    st = np.stack([slab.points[:, run], (slab.points[:, across] - (x0, 0, z0)[across]) / BAND * 0.52 + 0.006], axis=-1)
    return Shape(slab.points, slab.normals, st, slab.faces)


def ground(m: Stage) -> None:
    panels: dict[str, list[Shape]] = {"cobbles": [], "cobbles_worn": []}
    for i in range(4):
        for j in range(4):
            x, z = np.meshgrid(np.linspace(XS[j], XS[j + 1], 3), np.linspace(ZS[i], ZS[i + 1], 3))
            points = np.stack([x, 0 * x, z], axis=-1)
            st = laid(points.reshape(-1, 3)).reshape(3, 3, 2)
            panels["cobbles_worn" if (i + j) % 2 else "cobbles"].append(sheet(points, st))
    for name, shapes in panels.items():
        m.add_faceted(f"Ground/{name}", merged(shapes), name)
    half = BAND / 2
    bands = [band(x - half, -5.3, x + half, 13.6) for x in XS[1:4]] + [band(-15.6, z - half, 9.9, z + half) for z in ZS[1:3]]
    m.add_faceted("Ground/bands", merged(bands), "flags")
    m.add_faceted("Ground/terrace", box(8.1, 0.14, 1.7, 1.15, 0, -6.15), "flags")
    m.add("Ground/terrace_step", box(1.9, 0.07, 0.35, 0, 0, -5.13), "stone")
    m.add_faceted("Ground/pavement_left", box(8.0, 0.12, 1.1, -6.95, 0, -6.45), "flags")
    m.add_faceted("Ground/pavement_right", box(1.3, 0.12, 15, 9.35, 0, 0.5), "flags")
    m.add_faceted("Ground/pavement_south", box(31, 0.12, 1.2, -1.5, 0, 13.4), "flags")
    m.add_faceted("Ground/pavement_west", box(1.1, 0.12, 14, -15.45, 0, 5), "flags")
    grime = [
        blot(*place, 0.0015, 300 + k, 0.07, 5)
        for k, place in enumerate(
            (
                (-4.3, -2.1, 3.3, 2.2),
                (3.7, -2.2, 3.3, 2.2),
                (-7.1, 0.7, 3.2, 3.0),
                (7.3, -0.8, 3.2, 3.0),
                (-0.98, -1.75, 3.0, 1.5),
                (2.15, 1.75, 2.2, 1.3),
                (-6.0, 4.6, 4.3, 4.3),
                (1.0, -3.1, 1.1, 1.1),
                (1.75, -1.3, 0.75, 0.75),
                (-0.6, -5.0, 4.2, 0.5),
                (3.4, -5.1, 4.0, 0.5),
                (-8.6, -5.7, 5.0, 0.7),
            )
        )
    ]
    grime += [
        seam(*line, 0.3, 320 + k)
        for k, line in enumerate(
            (
                ((-2.95, -5.3), (5.2, -5.3)),
                ((-10.95, -5.9), (-2.95, -5.9)),
                ((8.7, -6.9), (8.7, 8.0)),
                ((-11, -2.6), (-11, -7)),
                ((-20, -2.6), (-11, -2.6)),
                ((-14.9, 12), (-14.9, -2)),
                ((5.2, -7), (10, -7)),
                ((12, 12.8), (-16, 12.8)),
            )
        )
    ]
    m.add_faceted("Ground/grime", merged(grime), "cobbles_grimy")


def puddles(m: Stage) -> None:
    """Water in the hollows, and wet stones around it."""
    places = (
        (-0.35, 1.55, 1.25, 0.5),
        (0.42, 0.95, 0.5, 0.24),
        (-4.9, 1.7, 1.5, 0.7),
        (5.9, 1.3, 1.3, 0.6),
        (-2.0, 7.2, 2.0, 0.9),
        (4.2, 6.6, 1.6, 0.8),
        (-4.6, 3.5, 0.9, 0.5),
        (2.7, -4.2, 0.8, 0.4),
    )
    m.add_faceted(
        "Puddles/wet",
        merged([blot(x, z, 1.55 * w, 1.75 * d, 0.0025, 200 + k, 0.1) for k, (x, z, w, d) in enumerate(places)]),
        "cobbles_wet",
    )
    m.add_faceted(
        "Puddles/shallow",
        merged([blot(x, z, 1.25 * w, 1.3 * d, 0.0035, 230 + k, 0.13) for k, (x, z, w, d) in enumerate(places)]),
        "shallow",
    )
    m.add_faceted(
        "Puddles/water",
        merged([blot(x, z, 0.75 * w, 0.6 * d, 0.0045, 200 + k, 0.13) for k, (x, z, w, d) in enumerate(places)]),
        "puddle",
    )


def leaf_litter(m: Stage) -> None:
    """Fallen leaves, gathered where wind leaves them."""
    rng = np.random.default_rng(210)
    hollows = (
        (-1.0, -1.0, 1.6, 0.12),
        (-2.6, -1.8, 0.15, 0.6),
        (0.6, -1.7, 0.12, 0.5),
        (-6.0, 6.4, 1.3, 0.3),
        (-4.4, 4.6, 0.3, 1.0),
        (8.5, 1.0, 0.15, 4.0),
        (-7, -5.75, 3.0, 0.12),
        (1.5, -5.15, 2.8, 0.1),
        (1.2, 2.4, 3.5, 2.4),
        (-3.5, 2.5, 3, 2),
        (-2, 12.6, 9, 0.15),
    )
    leaves: list[list[Shape]] = [[], [], []]
    for x, z, wide, deep in hollows:
        for _ in range(16):
            size = rng.uniform(0.035, 0.065)
            points = np.array([(0, 0, 0.9), (0.5, 0.14, 0.1), (0, 0.05, -1), (-0.5, 0.14, 0.1)]) * size
            leaf = Shape(points, np.tile((0.0, 1.0, 0.0), (4, 1)), np.zeros((4, 2)), np.array([[0, 1, 2], [0, 2, 3]]))
            leaf = leaf.turned("x", rng.normal(0, 9)).turned("z", rng.normal(0, 9)).turned("y", rng.uniform(0, 360))
            leaves[int(rng.integers(3))].append(leaf.at(x + rng.normal(0, wide / 2), 0.014, z + rng.normal(0, deep / 2)))
    for name, shapes in zip(("amber", "russet", "umber"), leaves, strict=True):
        m.add(f"Litter/{name}", merged(shapes), f"leaf_{name}")


def fountain(m: Stage) -> None:
    m.group("Fountain", (-6.0, 0, 4.6))
    basin = [
        (1.75, 0),
        (1.75, 0),
        (1.75, 0.13),
        (1.75, 0.13),
        (1.42, 0.13),
        (1.42, 0.13),
        (1.36, 0.2),
        (1.3, 0.27),
        (1.3, 0.5),
        (1.3, 0.5),
        (1.42, 0.54),
        (1.42, 0.62),
        (1.42, 0.62),
        (1.14, 0.62),
        (1.14, 0.62),
        (1.12, 0.2),
    ]
    column = [
        (0.3, 0.2),
        (0.3, 0.62),
        (0.3, 0.62),
        (0.2, 0.68),
        (0.15, 0.8),
        (0.14, 1.2),
        (0.18, 1.28),
        (0.34, 1.34),
        (0.56, 1.46),
        (0.58, 1.5),
        (0.58, 1.5),
        (0.5, 1.5),
        (0.46, 1.44),
        (0.46, 1.44),
        (0.1, 1.44),
        (0.08, 1.6),
        (0.1, 1.72),
        (0.06, 1.8),
        (0.1, 1.9),
        (0.0, 2.0),
    ]
    stone = [lathe(basin, 36), lathe(column, 22)]
    stone = [
        Shape(s.points, s.normals, (0.02 + 0.95 * s.st) * [around, 6.4], s.faces)
        for s, around in zip(stone, (12.8, 6.4), strict=True)
    ]
    m.add("Fountain/stone", merged(stone), "fountain")
    m.add("Fountain/water", merged([lathe([(1.135, 0.47), (0, 0.47)], 40), lathe([(0.49, 1.485), (0, 1.485)], 24)]), "water")
    m.add(
        "Fountain/moss", merged([lathe([(1.139, 0.46), (1.135, 0.55)], 40), lathe([(1.765, 0.0), (1.756, 0.045)], 40)]), "moss"
    )
    spouts = [
        tube([(0.1 * np.sin(a), 1.2, 0.1 * np.cos(a)), (0.36 * np.sin(a), 1.16, 0.36 * np.cos(a))], 0.022, 7)
        for a in np.arange(4) * np.pi / 2
    ]
    m.add("Fountain/spouts", merged([*spouts, ball(0.1, 14, 8).at(0, 2.03, 0)]), "copper")


def drain(m: Stage) -> None:
    """A cast-iron grating where the bands cross."""
    x, z = XS[2], ZS[2]
    bars = [box(0.4, 0.012, 0.022, x, 0.004, z - 0.17 + 0.0425 * k) for k in range(9)]
    rim = [box(0.44, 0.014, 0.03, x, 0.004, z + side * 0.205) for side in (-1, 1)]
    rim += [box(0.03, 0.014, 0.44, x + side * 0.205, 0.004, z) for side in (-1, 1)]
    m.add_faceted("Ground/drain", merged([*bars, *rim]), "iron")
    pit = quad((x - 0.2, 0.0075, z + 0.2), (0.4, 0, 0), (0, 0, -0.4))
    m.add("Ground/pit", pit, "earth")


def square(m: Stage) -> None:
    for part in (ground, puddles, leaf_litter, fountain, drain):
        part(m)
