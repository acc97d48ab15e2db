"""The floor of the ruins and what lies on it: heaved bricks, puddles, turf, rubble, fallen columns; meadow and hills."""

import numpy as np
from scenes.making.images import noise, smooth
from scenes.making.shapes import Shape, merged, sheet
from scenes.making.usd_stage import Stage

from .centre import capital
from .masonry import brick, drum, pile, tumbled

FIELD = noise(64, 64, 1.7, 510)
PUDDLES = ((1.9, 0.6, 1.5), (-1.7, -1.9, 1.1), (3.4, -3.0, 0.9), (-1.5, -12.6, 1.6))  # x, z, half length


def floor_height(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Sunk and heaved by some centimetres, with hollows where water stands."""
    i, j = (z + 22) / 32 * 60, (x + 9) / 18 * 60
    i0, j0 = np.clip(np.floor(i).astype(int), 0, 62), np.clip(np.floor(j).astype(int), 0, 62)
    s, t = i - i0, j - j0
    rows = FIELD[i0, j0] * (1 - t) + FIELD[i0, j0 + 1] * t
    rise = 0.022 * (rows * (1 - s) + (FIELD[i0 + 1, j0] * (1 - t) + FIELD[i0 + 1, j0 + 1] * t) * s)
    for px, pz, wide in PUDDLES:
        rise = rise - 0.05 * np.exp(-(((x - px) / wide) ** 2) - ((z - pz) / (0.6 * wide)) ** 2)
    return rise


def overgrown(m: Stage) -> None:
    """Turf and moss that spread over the bricks, a centimetre above them."""
    rng = np.random.default_rng(512)
    spots = (
        (-2.9, 3.4, 2.6), (3.0, 3.6, 2.9), (-3.9, -3.4, 2.4), (4.3, -1.6, 2.2), (2.6, -10.6, 3.0), (-2.6, -12.4, 3.2),
        (0.6, -16.2, 3.4), (7.0, -3.2, 2.4), (7.2, -10.4, 3.0), (-7.0, -6.5, 3.6), (-6.6, 2.0, 3.6), (7.0, 3.6, 3.2),
        (0.3, 5.4, 2.4), (-6.8, -14.0, 3.6),
    )  # fmt: skip
    for k, (cx, cz, size) in enumerate(spots):
        u, v = np.meshgrid(np.linspace(-0.5, 0.5, 8), np.linspace(-0.5, 0.5, 8))
        a = rng.uniform(0, 2 * np.pi)
        x, z = cx + size * (u * np.cos(a) + v * np.sin(a)), cz + size * (u * np.sin(a) - v * np.cos(a))
        z = np.clip(z, -19.6, 9)
        shape = sheet(np.stack([x, floor_height(x, z) + 0.012, z], axis=-1), np.stack([u + 0.5, v + 0.5], axis=-1))
        m.add(f"Ground/overgrown{k}", shape, "patch")


def ground(m: Stage) -> None:
    x, z = np.meshgrid(np.linspace(-8.9, 8.9, 33), np.linspace(9.5, -20.4, 51))
    m.add("Ground/floor", sheet(np.stack([x, floor_height(x, z), z], axis=-1), np.stack([x, -z], axis=-1)), "floor")
    overgrown(m)
    for k, (cx, cz, wide) in enumerate(PUDDLES):
        x, z = np.meshgrid(np.linspace(cx - 1.5 * wide, cx + 1.5 * wide, 17), np.linspace(cz + wide, cz - wide, 11))
        level = -0.026 + 0.008 * noise(11, 17, 0.9, 515 + k, low=2)  # its edge is where it meets the bricks
        shape = sheet(np.stack([x, level, z], axis=-1), np.stack([x, -z], axis=-1))
        still = np.tile((0.0, 1.0, 0.0), (len(shape.points), 1))
        m.add(f"Ground/puddle{k}", Shape(shape.points, still, shape.st, shape.faces), "puddle")
    angle = np.linspace(0, 2 * np.pi, 97)
    for name, seed, far, low, high in (("hills", 513, 210, 4, 9), ("hills_far", 514, 330, 16, 26)):
        crest = low + (high - low) * smooth(-1.5, 2, np.append(noise(8, 96, 1.2, seed, low=2)[0], 0))
        crest[-1] = crest[0]
        rows = [(far * np.sin(angle), level_of, far * np.cos(angle)) for level_of in (0 * angle - 12, crest)]
        grid = np.stack([np.stack(row, axis=-1) for row in rows])
        m.add(f"Ground/{name}", sheet(grid, grid[..., [0, 1]]), name)
    steps = np.concatenate([np.linspace(-90, -30, 6)[:-1], np.linspace(-30, 30, 25), np.linspace(30, 90, 6)[1:]])
    x, z = np.meshgrid(steps, steps[::-1] - 6)
    away = np.maximum(np.maximum(np.abs(x) - 10, np.abs(z + 5.5) - 16), 0)
    swell = noise(64, 64, 1.6, 511)[: len(steps), : len(steps)]
    rise = -0.09 + smooth(0, 25, away) * (0.9 + 0.9 * swell) + 0.05 * swell * (away > 0)
    m.add("Ground/meadow", sheet(np.stack([x, rise, z], axis=-1), np.stack([x, -z], axis=-1)), "turf")


def rubble(m: Stage) -> None:
    piles = [pile(125, 1.25, 0.58, 520), pile(75, 0.85, 0.34, 521), pile(140, 1.7, 0.8, 522)]
    spots = (
        (-5.3, 2.2, 2), (-5.2, -14.4, 2), (-4.3, -2.2, 1), (4.2, 3.4, 0), (-6.6, -18.2, 0), (-4.5, 3.3, 1), (7.7, -14.0, 0),
        (3.6, -18.9, 1), (-7.6, -4.0, 0), (7.6, 2.4, 1), (-2.4, -18.6, 1), (5.6, 6.2, 2), (8.0, -6.4, 1),
    )  # fmt: skip
    for k, (x, z, kind) in enumerate(spots):
        m.group(f"Rubble/Pile{k}", (x, 0, z), 73.0 * k)
        for name, shape, skin in zip(("bricks", "burnt", "earth"), piles[kind], ("clay", "clay_dark", "earth"), strict=True):
            if name == "earth":
                m.add(f"Rubble/Pile{k}/{name}", shape, skin)
            else:
                m.add_faceted(f"Rubble/Pile{k}/{name}", shape, skin)
    rng = np.random.default_rng(523)
    kinds: dict[str, list[Shape]] = {"clay": [], "clay_pale": [], "clay_dark": []}
    for _ in range(120):
        side = rng.choice([-1, 1])
        x = side * np.clip(4.9 - np.abs(rng.normal(0, 1.1)), 0.4, 9)
        z = rng.uniform(-19, 6.5)
        if np.hypot(x, z + 7) < 2.9:
            continue
        shape = tumbled(brick(rng), rng, 0.1)
        kinds[("clay", "clay_pale", "clay_dark")[rng.integers(3)]].append(shape.at(x, -shape.points[:, 1].min() - 0.012, z))
    for name, shapes in kinds.items():
        m.add_faceted(f"Rubble/loose_{name}", merged(shapes), name)


def fallen(m: Stage) -> None:
    """Drums and a capital that lie in the nave."""
    lying = drum(0.275, 0.26, 1.05, 530).turned("z", 90)
    for k, (x, z, turn) in enumerate(((-3.15, -0.9, 24), (-1.95, 0.3, 66), (3.3, -1.4, 118), (-3.3, -15.2, 15))):
        m.add(f"Fallen/drum{k}", lying, "stone", (x, 0.255, z), turn)
    m.group("Fallen/Capital", (-3.75, 0.41, 0.35), 215).AddRotateXOp().Set(68.0)
    m.add("Fallen/Capital/stone", capital(), "stone", (0, -0.42, 0))
    blocks = np.random.default_rng(531)
    stones = [tumbled(brick(blocks, 0.01).scaled(2.4, 4.2, 3.0), blocks, 0.25) for _ in range(9)]
    places = (
        (3.8, 1.2),
        (-3.9, -7.4),
        (2.2, -13.2),
        (-1.0, -16.0),
        (3.9, -12.0),
        (-6.4, -1.5),
        (6.6, -9.0),
        (1.9, 3.6),
        (-4.2, -10.2),
    )
    laid = [s.at(x, -s.points[:, 1].min() - 0.03, z) for s, (x, z) in zip(stones, places, strict=True)]
    m.add_faceted("Fallen/stones", merged(laid), "stone")
