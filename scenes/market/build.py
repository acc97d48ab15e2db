"""Builds the bundled scene `market`, a small square in the late afternoon, into a folder (default: this one), from the top
of the checkout: `python -m scenes.market.build [FOLDER]`.

Everything is made from numbers with fixed seeds: textures.py, lettering.py and sky.py have the images, looks.py the
materials, houses.py and town.py the houses, square.py the ground, goods.py the stalls, hero.py the table in the foreground,
clutter.py what makes the place used, moving.py what moves; here is the street. Metres, y up.
"""

import sys
from pathlib import Path

import numpy as np
from scenes.making.shapes import Shape, ball, bow, box, foliage, lathe, merged, quad, tube
from scenes.making.usd_stage import Stage

from . import textures
from .clutter import clutter
from .goods import stalls, vase
from .hero import hero
from .looks import LOOKS
from .moving import moving
from .sky import TO_SUN, write_sky
from .square import square
from .town import town


def railing(m: Stage, path: str, start, end, height: float = 0.95) -> None:
    """Bars of 8 mm every 9 cm between posts: from 4 m away thinner than a pixel of 480 x 270."""
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    count = int(np.linalg.norm(end - start) / 0.09)
    spots = [start + (end - start) * k / count for k in range(count + 1)]
    bars = [tube([p + [0, 0.06, 0], p + [0, height, 0]], 0.004, 5) for p in spots]
    rails = [tube([start + [0, y, 0], end + [0, y, 0]], 0.007, 5) for y in (0.08, height - 0.12, height)]
    posts = [tube([p, p + [0, height + 0.06, 0]], 0.014, 6) for p in (start, (start + end) / 2, end)]
    m.add(path, merged([*bars, *rails, *posts]), "iron")


def potted(m: Stage, path: str, place, size: float, seed: int) -> None:
    m.group(path, place)
    pot = [
        (0, 0),
        (0.15, 0),
        (0.15, 0),
        (0.2, 0.28),
        (0.2, 0.28),
        (0.225, 0.285),
        (0.23, 0.34),
        (0.23, 0.34),
        (0.2, 0.34),
        (0.19, 0.28),
        (0, 0.28),
    ]
    m.add(f"{path}/pot", lathe(pot, 32), "terracotta", size=size)
    m.add(f"{path}/leaves", foliage(80, 0.5, 0.8, 0.35, seed), "leaves", (0, 0.3 * size, 0), 67 * seed % 360, size)


def street(m: Stage) -> None:
    railing(m, "Rail/terrace_left", (-2.85, 0.14, -5.36), (-0.95, 0.14, -5.36))
    railing(m, "Rail/terrace_right", (0.95, 0.14, -5.36), (5.15, 0.14, -5.36))
    railing(m, "Rail/flowerbed", (-2.3, 0, -1.15), (0.35, 0, -1.15), 0.75)
    curb = [box(2.6, 0.16, 0.12, -0.98, 0, z) for z in (-1.35, -2.25)] + [
        box(0.12, 0.16, 0.78, x, 0, -1.8) for x in (-2.22, 0.26)
    ]
    m.add("Bed/curb", merged(curb), "stone")
    m.add("Bed/earth", box(2.36, 0.1, 0.78, -0.98, 0, -1.8), "earth")
    shrubs = [foliage(29, 0.4, 0.5, 0.31, 90 + k).at(-1.95 + 0.49 * k, 0.08, -1.8 + 0.12 * (-1) ** k) for k in range(5)]
    m.add("Bed/leaves", merged(shrubs), "leaves")
    spots = (
        (-1.45, 0, 2.1, 0.9),
        (-2.6, 0, 1.75, 0.85),
        (-0.62, 0.14, -5.75, 1.0),
        (1.0, 0.14, -6.5, 0.9),
        (8.4, 0, -4.4, 1.2),
        (4.9, 0, 0.2, 0.95),
        (-9.6, 0, -2.0, 1.2),
    )
    for k, (x, y, z, size) in enumerate(spots):
        potted(m, f"Plants/Pot{k}", (x, y, z), size, 100 + k % 3)
    m.group("Lamp", (1.75, 0, -1.3))
    post = lathe([(0.14, 0), (0.14, 0.1), (0.07, 0.2), (0.05, 0.6), (0.04, 3.3), (0.06, 3.34), (0.02, 3.5), (0, 3.52)], 16)
    m.add("Lamp/post", merged([post, tube(bow((0, 3.2, 0), (0.6, 3.2, 0), (0, 0.18, 0)), 0.016)]), "iron")
    for k, (x, z) in enumerate(((-2.0, -6.0), (2.3, -6.1), (4.2, -5.9))):
        table = lathe(
            [
                (0.2, 0),
                (0.2, 0.02),
                (0.02, 0.04),
                (0.02, 0.7),
                (0.34, 0.71),
                (0.34, 0.71),
                (0.34, 0.735),
                (0.34, 0.735),
                (0, 0.735),
            ],
            28,
        )
        m.add(f"Cafe/table{k}", table, "white_paint", (x, 0.14, z))
        vase(m, f"Cafe/vase{k}", (x, 0.877, z), "slim", ("glaze", "celadon", "honey")[k], 0.5)
    x, y, z = 3.2, 0.14, -6.0
    m.add(
        "Cafe/parasol",
        lathe([(1.15, 2.05), (1.16, 2.2), (0.6, 2.45), (0.05, 2.62), (0, 2.64)], 8).at(x, y, z),
        "green_canvas",
    )
    m.add("Cafe/parasol_pole", tube([(x, y, z), (x, y + 2.6, z)], 0.02), "pine")
    lines = (
        ((1.75, 3.4, -1.3), (9.9, 4.4, -1.5)),
        ((1.75, 3.4, -1.3), (-10.9, 5.0, -3.0)),
        ((-10.9, 4.6, -5.5), (-3.0, 4.0, -6.8)),
        ((9.9, 4.6, 3.0), (4.0, 4.1, -6.8)),
    )
    flags: dict[str, list[Shape]] = {"red_flag": [], "blue_flag": [], "gold_flag": [], "chalk": []}
    cords = []
    for a, b in lines:
        span = np.linalg.norm(np.subtract(b, a))
        cord = np.array(bow(a, b, (0, -0.05 * span, 0), int(span / 0.34)))
        cords.append(tube(cord, 0.004, 4))
        for k, (p, q) in enumerate(zip(cord[1:], cord[2:], strict=False)):
            flag = quad(p, (q - p) * 0.75, (0, -0.3, 0.05 * np.sin(5.0 * k)))
            tip = flag.points[[0, 1, 2]] - np.array([[0, 0, 0], [0, 0, 0], (q - p) * 0.375])
            list(flags.values())[k % 4].append(Shape(tip, -flag.normals[:3], flag.st[:3], np.array([[0, 2, 1]])))
    m.add("Bunting/cords", merged(cords), "wire")
    for colour, shapes in flags.items():
        m.add(f"Bunting/{colour}", merged(shapes), colour)
    cord = np.array(bow((-2.8, 3.0, -5.5), (5.1, 3.0, -5.5), (0, -0.45, 0), 24))
    m.add("Bulbs/cord", tube(cord, 0.006, 4), "wire")
    m.add("Bulbs/glass", merged([ball(0.04, 7, 4).at(*(p - [0, 0.05, 0])) for p in cord]), "bulb")


def build(folder: Path) -> None:
    textures.write_all(folder / "textures")
    write_sky(folder / "textures")
    market = Stage(folder, "market", LOOKS, seconds=4)
    for part in (square, town, stalls, hero, street, clutter, moving):
        part(market)
    market.light(TO_SUN, 4.5, (1.0, 0.82, 0.58), sky=1.05)
    market.save()
    print(f"{market.objects} meshes, {market.triangles} triangles")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
