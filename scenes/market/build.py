"""Builds the bundled scene `market`, a small square in the late afternoon, into a folder (default: this one), from the top
of the checkout: `python -m scenes.market.build [FOLDER]`.

Everything is made from numbers with fixed seeds: textures.py and sky.py have the images, looks.py the materials, goods.py
the stalls, moving.py what moves; here are the houses and the street. Metres, y up.
"""

import sys
from pathlib import Path

import numpy as np
from scenes.making.shapes import Shape, ball, bow, box, foliage, lathe, merged, quad, sheet, tube, wall
from scenes.making.usd_stage import Stage

from . import textures
from .goods import hero, stalls, vase
from .looks import LOOKS
from .moving import moving
from .sky import TO_SUN, write_sky

PANE = 0.17  # how far window panes stand behind the wall


def ground(m: Stage) -> None:
    x, z = np.meshgrid(np.linspace(-32, 32, 17), np.linspace(16, -32, 13))
    m.add("Ground/cobbles", sheet(np.stack([x, 0 * x, z], axis=-1), np.stack([x, -z], axis=-1)), "cobbles")
    m.add("Ground/terrace", box(8.1, 0.14, 1.7, 1.15, 0, -6.15), "flags")
    m.add("Ground/terrace_step", box(1.9, 0.07, 0.35, 0, 0, -5.13), "stone")
    m.add("Ground/pavement_left", box(8.0, 0.12, 1.1, -6.95, 0, -6.45), "flags")
    m.add("Ground/pavement_right", box(1.3, 0.12, 15, 9.35, 0, 0.5), "flags")


def building(
    m: Stage, name: str, place, turn: float, width: float, height: float, skin: str, windows, shutters="", lit=()
):
    """A facade from its left lower corner `place`, `windows` as (x, y, width, height), with roof and side walls."""
    m.group(name, place, turn)
    m.add(f"{name}/wall", wall(width, height, windows, reveal=PANE + 0.01), skin)
    frames, sills, blinds, panes = [], [], [], {"glass": [], "shop": []}
    for k, (x, y, w, h) in enumerate(windows):
        panes["shop" if k in lit else "glass"].append(quad((x, y, -PANE), (w, 0, 0), (0, h, 0), st=(1, 1)))
        z, bars = -PANE + 0.035, max(2, round(w / 0.55) + 1)
        frames += [box(0.06, h, 0.06, x + 0.03 + (w - 0.06) * i / (bars - 1), y, z) for i in range(bars)]
        frames += [box(w, 0.055, 0.05, x + w / 2, y + (h - 0.055) * t, z) for t in (0, 0.62, 1)]
        if y > 0.5:
            sills.append(box(w + 0.24, 0.07, 0.34, x + w / 2, y - 0.055, 0))
            sills.append(box(w + 0.2, 0.16, 0.05, x + w / 2, y + h + 0.004, 0.015))
        if shutters and y > 2:
            for side in (-1, 1):
                at = x + w / 2 + side * (w / 2 + w / 4 + 0.05)
                blinds += [box(w / 2, h + 0.04, 0.03, at, y - 0.02, 0.025)]
                blinds += [box(w / 2 - 0.1, 0.02, 0.03, at, y + 0.12 + 0.2 * i, 0.042) for i in range(int(h / 0.2) - 1)]
    m.add(f"{name}/frames", merged(frames), "white_paint")
    if sills:
        m.add(f"{name}/sills", merged(sills), "stone")
    if blinds:
        m.add(f"{name}/shutters", merged(blinds), shutters)
    for glass, parts in panes.items():
        if parts:
            m.add(f"{name}/{glass}", merged(parts), glass)
    doors = [w for w in windows if w[1] < 0.5]
    edges = [0.0, *(v for x, _, w, _ in sorted(doors) for v in (x, x + w)), width]
    plinth = [box(b - a, 0.55, 0.1, (a + b) / 2, 0, 0.01) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    cornice = [
        box(width + 0.1, 0.14, 0.3, width / 2, height - 0.3, 0.05),
        box(width + 0.2, 0.16, 0.5, width / 2, height - 0.16, 0.1),
    ]
    m.add(f"{name}/trim", merged([*plinth, *cornice]), "stone")
    deep, ridge = 4.6, 2.4  # from the facade to the ridge, and its height above the walls
    section = np.array([(0, 0), (-2 * deep, 0), (-2 * deep, height + 0.2), (-deep, height + ridge), (0, height + 0.2)])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    sides = []
    for x, faces in ((0, fan[:, ::-1]), (width, fan)):
        points = np.insert(section[:, ::-1], 0, x, axis=1)
        sides.append(Shape(points, np.tile((1.0 if x else -1.0, 0, 0), (5, 1)), section, faces))
    m.add(f"{name}/sides", merged(sides), skin)
    fall = ridge * (1 + 0.45 / deep)  # both slopes go 0.45 m past the walls
    eaves, along = (-0.15, height + ridge + 0.04 - fall, 0.45), (width + 0.3, 0, 0)
    slopes = [
        quad(eaves, along, (0, fall, -deep - 0.45)),
        quad((eaves[0], eaves[1] + fall, -deep), along, (0, -fall, -deep - 0.45)),
        quad((eaves[0], eaves[1] - 0.06, 0.45), along, (0, 0.06, 0)),
    ]
    m.add(f"{name}/roof", merged(slopes), "tiles")


def row(first: float, step: float, count: int, y: float, w: float = 1.0, h: float = 1.55) -> list:
    return [(first + step * k, y, w, h) for k in range(count)]


def town(m: Stage) -> None:
    building(
        m, "Ochre", (-11, 0, -7), 0, 8.1, 6.5, "ochre", row(0.9, 2.5, 3, 1.1) + row(0.9, 2.5, 3, 4.0), "teal_paint"
    )
    shop = [(1.0, 0.75, 1.7, 1.75), (3.5, 0.14, 1.15, 2.35), (5.4, 0.75, 1.9, 1.75)]
    building(m, "Brick", (-2.9, 0, -7), 0, 8.1, 7.3, "brick", shop + row(1.2, 2.4, 3, 4.5), lit=(0, 2))
    building(m, "Rose", (7.2, 0, -7), 0, 2.8, 6.2, "rose", row(0.9, 1, 1, 1.1) + row(0.9, 1, 1, 3.9), "white_paint")
    building(
        m,
        "Cream",
        (10, 0, -7),
        -90,
        16,
        6.0,
        "cream",
        row(1.1, 2.6, 6, 1.1) + row(1.1, 2.6, 6, 3.8),
        "teal_paint",
        (2,),
    )
    building(
        m, "Left", (-11, 0, -2.6), 90, 4.4, 5.6, "rose", row(0.9, 1.9, 2, 1.1) + row(0.9, 1.9, 2, 3.6), "white_paint"
    )
    building(m, "Farther", (-16, 0, 12), 90, 14, 4.6, "cream", row(0.9, 2.4, 5, 1.1), "teal_paint")
    building(m, "Distant", (0, 0, -21), 0, 14, 8.5, "ochre", row(1, 2.2, 6, 5))
    m.group("Tower", (5.6, 0, -27))
    m.add("Tower/shaft", box(3.4, 15, 3.4), "cream")
    m.add("Tower/spire", lathe([(2.7, 15), (2.5, 15.1), (0, 21)], 4).turned("y", 45), "tiles")
    m.add("Tower/belfry", merged([box(0.9, 2, 0.05, x, 11.8, 1.7) for x in (-0.7, 0.7)]), "iron")
    m.group("Neon", (0.9, 3.0, -6.93))
    m.add("Neon/board", box(3.3, 0.95, 0.07, 0, 0, 0.08), "iron")
    m.add("Neon/tubes", quad((-1.55, 0.09, 0.125), (3.1, 0, 0), (0, 0.775, 0), st=(1, 1)), "neon")
    chimneys = [box(0.7, 1.6, 0.6, x, 7.6, -9.4) for x in (-8.5, -4.5, 1.4, 4.2)]
    m.add("Chimneys/stacks", merged(chimneys), "brick")


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
    m.add(f"{path}/leaves", foliage(95, 0.5, 0.8, 0.34, seed), "leaves", (0, 0.3 * size, 0), 67 * seed % 360, size)


def street(m: Stage) -> None:
    railing(m, "Rail/terrace_left", (-2.85, 0.14, -5.36), (-0.95, 0.14, -5.36))
    railing(m, "Rail/terrace_right", (0.95, 0.14, -5.36), (5.15, 0.14, -5.36))
    railing(m, "Rail/flowerbed", (-2.3, 0, -1.15), (0.35, 0, -1.15), 0.75)
    curb = [box(2.6, 0.16, 0.12, -0.98, 0, z) for z in (-1.35, -2.25)] + [
        box(0.12, 0.16, 0.78, x, 0, -1.8) for x in (-2.22, 0.26)
    ]
    m.add("Bed/curb", merged(curb), "stone")
    m.add("Bed/earth", box(2.36, 0.1, 0.78, -0.98, 0, -1.8), "earth")
    shrubs = [foliage(34, 0.4, 0.5, 0.3, 90 + k).at(-1.95 + 0.49 * k, 0.08, -1.8 + 0.12 * (-1) ** k) for k in range(5)]
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
    post = lathe(
        [(0.14, 0), (0.14, 0.1), (0.07, 0.2), (0.05, 0.6), (0.04, 3.3), (0.06, 3.34), (0.02, 3.5), (0, 3.52)], 16
    )
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
    market = Stage(folder, "market", LOOKS, seconds=2)
    for part in (ground, town, stalls, hero, street, moving):
        part(market)
    market.light(TO_SUN, 4.5, (1.0, 0.82, 0.58), sky=1.05)
    market.save()
    print(f"{market.objects} meshes, {market.triangles} triangles")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
