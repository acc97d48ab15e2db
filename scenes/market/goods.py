"""What the market sells: stalls, crates of fruit, ceramics, pans, cloth, spices."""

import numpy as np
from scenes.making.shapes import Shape, ball, box, canopy, lathe, merged, quad, sheet, tube
from scenes.making.usd_stage import Stage

VASES = {  # profiles (radius, y) of about 0.4 m
    "slim": [(0, 0), (0.06, 0), (0.065, 0.02), (0.11, 0.17), (0.09, 0.28), (0.04, 0.35), (0.037, 0.4), (0.06, 0.44)],
    "round": [(0, 0), (0.07, 0), (0.08, 0.015), (0.15, 0.12), (0.14, 0.22), (0.07, 0.29), (0.065, 0.32), (0.09, 0.35)],
    "jar": [
        (0, 0),
        (0.09, 0),
        (0.095, 0.02),
        (0.115, 0.15),
        (0.105, 0.25),
        (0.06, 0.285),
        (0.065, 0.31),
        (0.03, 0.335),
    ],
}
POT = [
    (0, 0),
    (0.1, 0),
    (0.1, 0),
    (0.13, 0.05),
    (0.135, 0.15),
    (0.135, 0.15),
    (0.142, 0.155),
    (0.125, 0.15),
    (0.12, 0.02),
]


def crate(m: Stage, path: str, place, turn: float, fruit: str, radius: float, tilt: float = 14) -> None:
    """A slatted box leaning towards +z with one mesh of fruit in it."""
    m.group(path, place, turn)
    w, h, d = 0.56, 0.17, 0.38
    parts = [box(w, 0.015, d)]
    for y in (0.02, 0.105):
        parts += [box(w, 0.065, 0.012, 0, y, side * (d / 2 - 0.006)) for side in (-1, 1)]
        parts += [box(0.012, 0.065, d - 0.026, side * (w / 2 - 0.006), y, 0) for side in (-1, 1)]
    parts += [box(0.025, h, 0.025, a * (w / 2 - 0.026), 0, b * (d / 2 - 0.026)) for a in (-1, 1) for b in (-1, 1)]
    m.add(f"{path}/box", merged(parts).turned("x", tilt), "pine")
    rng = np.random.default_rng(60)  # one heap for all crates of a radius: the file holds it once
    heap, step = [], 1.9 * radius
    for layer, y in ((0, h - 0.3 * radius), (1, h + 1.0 * radius)):
        for i in range(int((w - 0.06) / step) - layer):
            for j in range(int((d - 0.04) / step) - layer):
                x = (i + 0.5) * step - (int((w - 0.06) / step) - layer) * step / 2
                z = (j + 0.5) * step - (int((d - 0.04) / step) - layer) * step / 2
                if layer and rng.uniform() < 0.3:
                    continue
                one = (
                    ball(radius, 8 if radius < 0.06 else 14, 4 if radius < 0.06 else 7)
                    .scaled(1, rng.uniform(0.88, 1), 1)
                    .turned("x", rng.uniform(0, 180))
                )
                heap.append(one.turned("y", rng.uniform(0, 360)).at(x + rng.normal(0, 0.006), y, z + rng.normal(0, 0.006)))
    m.add(f"{path}/{fruit}", merged(heap).turned("x", tilt), fruit)


def stall(m: Stage, name: str, place, turn: float, canvas: str, cloth: str) -> None:
    """Posts, canopy, table with a cloth in folds, and a back cloth; the customer stands at +z."""
    m.group(name, place, turn)
    posts = [box(0.07, 2.56 if z < 0 else 2.16, 0.07, x, 0, z) for x in (-1.42, 1.42) for z in (-0.86, 0.86)]
    bars = [box(2.98, 0.05, 0.05, 0, y, z) for y, z in ((2.5, -0.86), (2.08, 0.86))]
    m.add(f"{name}/posts", merged([*posts, *bars]), "oak")
    m.add(f"{name}/canopy", canopy(3.25, 2.05, 2.66, 2.2), canvas)
    m.add(f"{name}/table", box(2.7, 0.05, 1.15, 0, 0.82, 0.1), "pine")
    x, y = np.meshgrid(np.linspace(-1.37, 1.37, 60), np.array([0.03, 0.45, 0.875]))
    fold = 0.69 + 0.045 * (1 - y) * np.sin(x * 17 + 1.5 * np.sin(2 * x)) + 0.022 * (1 - y) * np.sin(x * 39 + 1)
    skirt = sheet(np.stack([x, y, fold], axis=-1), np.stack([x, y], axis=-1))
    z, y = np.meshgrid(np.linspace(-0.5, 0.69, 30), np.array([0.03, 0.45, 0.875]))
    left = np.stack([-1.37 + 0 * z - 0.02 * (1 - y) * np.sin(z * 19), y, z], axis=-1)
    ends = [
        sheet(left, np.stack([z, y], axis=-1)),
        sheet(left[:, ::-1] * [-1, 1, 1], np.stack([z, y], axis=-1)[:, ::-1]),
    ]
    m.add(f"{name}/skirt", merged([skirt, *ends]), cloth)
    x, y = np.meshgrid(np.linspace(-1.4, 1.4, 30), np.array([0.25, 1.2, 2.45]))
    m.add(
        f"{name}/back",
        sheet(np.stack([x, y, -0.8 + 0.05 * np.sin(x * 12 + np.sin(3 * x))], axis=-1), np.stack([x, y], axis=-1)),
        "dark_cloth",
    )


def pan(m: Stage, path: str, place, metal: str, size: float = 1.0) -> None:
    """A pan that hangs from its handle's eye at `place`, its bottom to +z."""
    bowl = lathe(
        [
            (0, 0),
            (0.1, 0),
            (0.1, 0),
            (0.125, 0.06),
            (0.125, 0.06),
            (0.13, 0.062),
            (0.118, 0.06),
            (0.095, 0.008),
            (0, 0.007),
        ],
        20,
    )
    grip = tube([(0, 0.05, -0.12), (0, 0.06, -0.2), (0, 0.062, -0.34)], 0.009)
    m.add(path, merged([bowl, grip]).turned("x", 90).turned("y", 180).at(0, -0.34, 0), metal, place, size=size)


def folded(width: float, height: float, depth: float) -> Shape:
    """A length of cloth, folded: its front and back are round."""
    angle = np.linspace(0, 2 * np.pi, 14)
    c, s = np.cos(angle), np.sin(angle)
    z, y = np.sign(c) * np.abs(c) ** 0.25 * depth / 2, (1 + np.sign(s) * np.abs(s) ** 0.7) * height / 2
    x, y = np.meshgrid([-width / 2, width / 2], y)
    z = np.tile(z[:, None], 2)
    sleeve = sheet(np.stack([x, y, z], axis=-1)[::-1], np.stack([x, z], axis=-1)[::-1])
    ends = [quad((side * width / 2, 0, side * depth / 2), (0, 0, -side * depth), (0, height, 0)) for side in (-1, 1)]
    return merged([sleeve, *ends])


def hanging(width: float, length: float, seed: int) -> Shape:
    """A cloth that hangs in folds from y = 0."""
    x, t = np.meshgrid(np.linspace(-0.5, 0.5, 11), np.linspace(1, 0, 5))
    z = 0.035 * np.sin(x * 17 + seed) * (0.5 + 0.5 * t)
    x, y = x * width * (0.85 + 0.15 * t), -length * t * (1 + 0.06 * np.sin(5 * x + seed))
    return sheet(np.stack([x, y, z], axis=-1), np.stack([x, y], axis=-1))


def braids(m: Stage) -> None:
    """Garlic and peppers that hang from the front bars of two stalls, and price tags on the crates."""
    rng = np.random.default_rng(61)
    for name, spots in (("Fruit", (-1.25, -0.55, 0.2, 1.25)), ("Greens", (-1.2, -0.4, 0.45, 1.2))):
        white, red, tags = [], [], []
        for k, x in enumerate(spots):
            for j in range(9):
                a = 2.4 * j
                y, out = 2.0 - 0.055 * j, 0.035
                spot = x + out * np.cos(a), y, 0.84 + out * np.sin(a)
                if (k + len(name)) % 2:
                    white.append(ball(0.032, 7, 4).scaled(1, 1.1, 1).at(*spot))
                else:
                    pod = (
                        lathe([(0, -0.1), (0.012, -0.05), (0.017, 0), (0, 0.02)], 6)
                        .turned("z", 25 * np.cos(a))
                        .turned("x", -25 * np.sin(a))
                    )
                    red.append(pod.at(*spot))
        for k in range(4):
            tag = box(0.13, 0.085, 0.006, 0, 0, 0).turned("x", -12).turned("y", rng.normal(0, 5))
            tags.append(
                tag.at(
                    -0.98 + 0.65 * k + rng.normal(0, 0.05), 1.0 if name == "Fruit" else 1.02, 0.675 if name == "Fruit" else 0.64
                )
            )
        m.add(f"{name}/garlic", merged(white), "chalk")
        m.add(f"{name}/peppers", merged(red), "apple")
        m.add_faceted(f"{name}/tags", merged(tags), "chalk")


def sacks(m: Stage) -> None:
    """Open sacks of pulses and spices before the greens."""
    bag = [(0, 0), (0.2, 0), (0.25, 0.1), (0.24, 0.28), (0.21, 0.4), (0.235, 0.44), (0.24, 0.47), (0.2, 0.46), (0.19, 0.4)]
    heap = [(0.21, 0.41), (0.16, 0.44), (0.08, 0.49), (0, 0.5)]
    for k, (x, z, spice) in enumerate(
        ((-1.15, 1.02, "gold_flag"), (-0.6, 1.08, "apple"), (-0.02, 1.0, "lime"), (1.75, 0.25, "gold_flag"))
    ):
        size = 1 - 0.08 * (k % 3)
        sack = lathe(bag, 16, refine=2)
        lean = 1 + 0.05 * np.sin(3 * np.arctan2(sack.points[:, 0], sack.points[:, 2]))[:, None] * [1, 0, 1]
        st = sack.st * [1.4, 0.8]
        m.add(f"Greens/Sack{k}/bag", Shape(sack.points * lean, sack.normals, st, sack.faces), "burlap", (x, 0, z), 40 * k, size)
        m.add(f"Greens/Sack{k}/heap", lathe(heap, 16), spice, (x, 0, z), 0, size)


def vase(m: Stage, path: str, place, kind: str, glaze: str, size: float = 1.0) -> None:
    m.add(path, lathe(VASES[kind], 28, refine=3), glaze, place, size=size)


def stalls(m: Stage) -> None:
    stall(m, "Fruit", (-4.3, 0, -2.3), 0, "red_canvas", "linen")
    kinds = (
        ("orange", 0.043),
        ("apple", 0.043),
        ("lemon", 0.035),
        ("lime", 0.035),
        ("plum", 0.035),
        ("orange", 0.043),
        ("apple", 0.043),
        ("lemon", 0.035),
    )
    for k, (fruit, radius) in enumerate(kinds):
        crate(
            m,
            f"Fruit/Crate{k}",
            (-0.98 + 0.65 * (k % 4), 0.9 + 0.19 * (k // 4), 0.46 - 0.42 * (k // 4)),
            0,
            fruit,
            radius,
        )
    crate(m, "Fruit/Crate8", (-0.7, 0.02, 1.15), 8, "melon", 0.11, 0)
    crate(m, "Fruit/Crate9", (0.1, 0.02, 1.2), -6, "melon", 0.11, 0)
    stall(m, "Pottery", (3.7, 0, -2.4), 0, "blue_canvas", "linen")
    wares = (
        ("slim", "glaze"),
        ("round", "celadon"),
        ("jar", "glaze"),
        ("slim", "oxblood"),
        ("round", "glaze"),
        ("jar", "honey"),
        ("slim", "celadon"),
    )
    for k, (kind, glaze) in enumerate(wares):
        vase(m, f"Pottery/vase{k}", (-1.15 + 0.38 * k, 0.87, 0.28 + 0.16 * (k % 2)), kind, glaze, 0.85 + 0.15 * (k % 3))
    for k in range(5):
        pan(m, f"Pottery/pan{k}", (-1.1 + 0.5 * k, 2.07, 0.9), ("copper", "steel", "brass")[k % 3], 1.0 - 0.1 * (k % 2))
        m.add(
            f"Pottery/pot{k}",
            lathe(POT, 22, refine=2),
            ("copper", "brass")[k % 2],
            (-1.0 + 0.5 * k, 0.87, -0.22),
            size=1.1,
        )
    stall(m, "Greens", (-7.2, 0, 0.6), 48, "green_canvas", "burlap")
    for k, (fruit, radius) in enumerate((("lime", 0.035), ("plum", 0.035), ("apple", 0.043), ("melon", 0.11))):
        crate(m, f"Greens/Crate{k}", (-0.98 + 0.65 * k, 0.9, 0.42), 0, fruit, radius)
    stall(m, "Cloth", (7.4, 0, -0.9), -52, "red_canvas", "dark_cloth")
    for k in range(6):
        layers = [
            folded(0.34, 0.045, 0.6 + 0.03 * (j % 3))
            .turned("y", 5 * np.sin(9 * k + 4 * j))
            .at(0.012 * np.sin(5 * j + k), 0.87 + 0.046 * j, 0.2)
            for j in range(3 + 2 * (k % 3))
        ]
        m.add(
            f"Cloth/bale{k}",
            merged(layers).at(-1.0 + 0.4 * k),
            ("blue_flag", "linen", "red_flag", "gold_flag", "green_canvas", "burlap")[k],
        )
    for k in range(5):
        m.add(
            f"Cloth/shawl{k}",
            hanging(0.42, 1.15 - 0.1 * (k % 2), k).at(-1.12 + 0.56 * k, 2.4, -0.7),
            ("gold_flag", "red_flag", "chalk", "blue_flag", "linen")[k],
        )
    rolls = [
        lathe([(0, 0), (0.07, 0), (0.07, 1.1), (0, 1.1)], 12).turned("z", 7 * (-1) ** k).at(1.62 + 0.16 * k, 0, 0.1 * k)
        for k in range(3)
    ]
    for roll, material in zip(rolls, ("runner", "linen", "blue_flag"), strict=True):
        m.add(f"Cloth/roll_{material}", roll, material)
    braids(m)
    sacks(m)
    for k, (x, z, size) in enumerate(((-6.3, -1.6, 1), (5.7, -1.5, 1), (6.0, -2.3, 1.15), (-2.35, -3.0, 1.1))):
        barrel = [
            (0, 0),
            (0.24, 0),
            (0.24, 0),
            (0.3, 0.25),
            (0.315, 0.4),
            (0.3, 0.55),
            (0.24, 0.8),
            (0.24, 0.8),
            (0.22, 0.8),
            (0.22, 0.77),
            (0, 0.77),
        ]
        m.add(f"Barrels/staves{k}", lathe(barrel, 20), "oak", (x, 0, z), size=size)
        hoops = [
            lathe([(r + 0.004, y), (r + 0.012, y), (r + 0.012, y + 0.04), (r + 0.004, y + 0.04)], 24)
            for r, y in ((0.272, 0.12), (0.272, 0.64))
        ]
        m.add(f"Barrels/hoops{k}", merged(hoops), "iron", (x, 0, z), size=size)
