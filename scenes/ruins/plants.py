"""What grows in the ruins: ivy on walls, hanging strands, grass in the joints, trees outside. Cards are cut by alpha."""

import numpy as np
from scenes.making.shapes import Shape, foliage, merged, quad, tube, unit
from scenes.making.usd_stage import Stage


def ivy(climbers: int, width: float, height: float, seed: int, out: float = 0.36) -> Shape:
    """Cards that climb a wall whose front lies at z = `out`, from y = 0, within `width` about x = 0."""
    rng = np.random.default_rng(seed)
    cards = []
    for _ in range(climbers):
        x, y, reach = rng.normal(0, width / 4), -0.1, height * rng.uniform(0.35, 1) ** 0.8
        drift = rng.normal(0, 0.35)
        while y < reach:
            size = rng.uniform(0.42, 0.62) * (1 - 0.4 * y / height)
            card = quad((-size / 2, -size / 2, 0), (size, 0, 0), (0, size, 0), st=(1, 1)).turned("z", rng.uniform(-60, 60))
            card = card.turned("x", rng.normal(-14, 13)).turned("y", rng.normal(0, 20))
            normals = unit(card.normals + rng.normal(0, 0.12, 3))
            card = Shape(card.points, normals, card.st, card.faces)
            cards.append(card.at(x, y, out + rng.uniform(0.05, 0.15)))
            y += rng.uniform(0.2, 0.34)
            x += 0.25 * drift + rng.normal(0, 0.13)
    return merged(cards)


def strand(length: float, seed: int) -> Shape:
    """Ivy that hangs from the origin."""
    rng = np.random.default_rng(seed)
    cards = []
    for y in np.arange(0.0, length, 0.24):
        size = 0.44 * (1 - 0.45 * y / length)
        card = quad((-size / 2, -size, 0), (size, 0, 0), (0, size, 0), st=(1, 1)).turned(
            "z", rng.uniform(-25, 25) + 180 * (rng.uniform() < 0.5)
        )
        cards.append(card.turned("y", rng.uniform(0, 180)).at(rng.normal(0, 0.03), -y - 0.1, rng.normal(0, 0.03)))
    return merged(cards)


def tufts(count: int, radius: float, seed: int, size: float = 0.42) -> Shape:
    """Grass: crossed cards around the origin."""
    rng = np.random.default_rng(seed)
    cards = []
    for _ in range(count):
        r, a = radius * rng.uniform() ** 0.7, rng.uniform(0, 2 * np.pi)
        tall, turn = size * rng.uniform(0.6, 1.15), rng.uniform(0, 180)
        for k in range(2):
            card = quad((-tall / 2, -0.03, 0), (tall, 0, 0), (0, tall, 0), st=(1, 1)).turned(
                "y", turn + 90 * k + rng.normal(0, 15)
            )
            normals = unit(0.5 * card.normals + [0, 1.0, 0])
            cards.append(Shape(card.points, normals, card.st, card.faces).at(r * np.sin(a), 0, r * np.cos(a)))
    return merged(cards)


def tree(m: Stage, name: str, place, size: float, turn: float) -> None:
    m.group(name, place, turn)
    rng = np.random.default_rng(370)
    limbs = [tube([(0, -0.2, 0), (0.05, 1.2, 0.03), (-0.05, 2.6, 0.1), (0.1, 4.2, 0)], 0.16, 7)]
    tips = []
    for k in range(7):
        a, y = 2.4 * k, 2.2 + 0.35 * k
        tip = np.array([1.7 * np.sin(a), y + 1.1, 1.7 * np.cos(a)]) * [1 - 0.07 * k, 1, 1 - 0.07 * k]
        limbs.append(tube([(0, y - 0.4, 0.05), tuple(tip * [0.5, 0.93, 0.5]), tuple(tip)], 0.055, 5))
        tips.append(tip)
    m.add(f"{name}/trunk", merged(limbs), "oak", size=size)
    crowns = [
        foliage(34, 1.1, 0.85, 0.95, 371 + k % 3).at(*(tip + [0, -0.25, 0]))
        for k, tip in enumerate([*tips, np.array([0, 5.0, 0])])
    ]
    m.add(f"{name}/leaves", merged(crowns), "ivy", size=size * rng.uniform(0.98, 1.0))


def plants(m: Stage) -> None:
    spots = (
        ("Right0", (4.99, 0, -16.4), -90, 0, 1.0), ("Right1", (8.6, 0, -1.6), -90, 1, 1.0),
        ("Right2", (8.6, 0, -11.6), -90, 0, 1.1), ("End0", (4.3, 0, -20), 0, 1, 1.15),
        ("End1", (-3.9, 0, -20), 0, 2, 1.0), ("Left0", (-8.6, 0, -8.2), 90, 2, 0.8),
    )  # fmt: skip
    shapes = [ivy(13, 2.6, 4.4, 380), ivy(10, 2.0, 5.2, 381), ivy(9, 3.2, 2.2, 382)]
    for name, place, turn, kind, size in spots:
        m.group(f"Ivy/{name}", place, turn)
        m.add(f"Ivy/{name}/leaves", shapes[kind], "ivy", size=size)
    shapes = [tufts(9, 0.7, 390), tufts(7, 0.45, 391, 0.34), tufts(12, 1.1, 392, 0.5)]
    rng = np.random.default_rng(393)
    places = [
        (-4.5, 3.2),
        (-4.6, -0.4),
        (4.4, 2.1),
        (4.6, -4.2),
        (4.4, -9.4),
        (-4.4, -12.2),
        (-2.9, -6.0),
        (2.7, -8.6),
        (7.9, -4.0),
        (7.9, -9.5),
    ]
    places += [
        (-1.9, 2.5),
        (1.6, -18.9),
        (-3.4, -18.8),
        (8.0, 0.6),
        (-6.2, -5.0),
        (-7.8, -11.0),
        (-7.2, 0.5),
        (-5.6, -15.0),
        (2.6, 4.4),
    ]
    for k, (x, z) in enumerate(places):
        m.add(
            f"Weeds/tuft{k}", shapes[k % 3], "grass", (x, -0.02, z), float(rng.integers(360)), round(rng.uniform(0.75, 1.15), 2)
        )
    for k in range(26):
        a, r = rng.uniform(0, 2 * np.pi), rng.uniform(11, 19)
        m.add(
            f"Weeds/meadow{k}",
            shapes[2],
            "grass",
            (1.1 * r * np.sin(a), -0.1, -6 + 1.5 * r * np.cos(a)),
            float(rng.integers(360)),
            1.5,
        )
    for k, (x, z, size) in enumerate(
        ((-15.5, -22, 1.15), (-21, -13, 1.4), (-12.5, -33, 1.3), (16, -27, 1.5), (14.5, -2, 1.2), (4.5, -34, 1.4))
    ):
        tree(m, f"Trees/Tree{k}", (x, -0.2, z), size, 77 * k)
