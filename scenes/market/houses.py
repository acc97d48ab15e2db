"""How a house of the market is built: wall with windows, doors, shutters, gutter, roof and chimneys."""

from dataclasses import dataclass

import numpy as np
from scenes.making.shapes import Shape, box, lathe, merged, quad, tube, wall
from scenes.making.usd_stage import Stage

PANE = 0.17  # how far window panes stand behind the wall
FACADE = 6.4  # metres that the image of weathered render is wide
DEEP, RIDGE = 4.6, 2.4  # from the facade to the ridge, and its height above the walls
CHIMNEY_POT = lathe([(0.11, 0), (0.085, 0.32), (0.1, 0.34), (0.1, 0.4), (0.07, 0.4), (0.06, 0)], 10)


@dataclass(frozen=True)
class House:
    """A facade from its left lower corner `place`, that faces +z before it is turned by `turn` degrees about y.

    windows: (x, y, width, height), in panes of which those in `lit` are shop windows; doors: (x, width, height);
    shutters: their material. pipes: x of downpipes; corners: x of quoins; chimneys: (x, metres behind the facade).
    far: nobody comes near.
    """

    name: str
    place: tuple
    turn: float
    width: float
    height: float
    skin: str
    windows: tuple = ()
    shutters: str = ""
    lit: tuple = ()
    doors: tuple = ()
    pipes: tuple = ()
    chimneys: tuple = ()
    dormers: tuple = ()
    corners: tuple = ()
    far: bool = False


def row(first: float, step: float, count: int, y: float, w: float = 1.0, h: float = 1.55) -> tuple:
    return tuple((first + step * k, y, w, h) for k in range(count))


def whole_height(shape: Shape, height: float, shift: float = 0.0) -> Shape:
    """st of a shape whose points' y runs over the height of the image of weathered render."""
    v = 0.008 + 0.984 * np.clip(shape.points[:, 1] / height, 0, 1)
    return Shape(shape.points, shape.normals, np.stack([shape.st[:, 0] + shift, v * FACADE], axis=-1), shape.faces)


def room(number: int) -> np.ndarray:
    """Corners, in the image `panes`, of one of its eight rooms."""
    corner = np.array([number % 4 / 4, number // 4 / 2])
    return corner + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [0.25, 0.5] * 0.94 + np.array([0.25, 0.5]) * 0.03


def windows(m: Stage, house: House, rng) -> None:
    frames, sills, blinds, panes = [], [], [], {"glass": [], "shop": []}
    for k, (x, y, w, h) in enumerate(house.windows):
        pane = quad((x, y, -PANE), (w, 0, 0), (0, h, 0), st=(1, 1))
        if k not in house.lit:
            pane = Shape(pane.points, pane.normals, room(int(rng.integers(8))), pane.faces)
        else:
            pane = Shape(pane.points, pane.normals, pane.st + [0.29 * k, 0], pane.faces)
        panes["shop" if k in house.lit else "glass"].append(pane)
        z, bars = -PANE + 0.035, max(2, round(w / 0.55) + 1)
        frames += [box(0.06, h, 0.06, x + 0.03 + (w - 0.06) * i / (bars - 1), y, z) for i in range(bars)]
        frames += [box(w, 0.055, 0.05, x + w / 2, y + (h - 0.055) * t, z) for t in (0, 0.62, 1)]
        if y > 0.5:
            sills.append(box(w + 0.24, 0.07, 0.34, x + w / 2, y - 0.055, 0))
            sills.append(box(w + 0.2, 0.16, 0.05, x + w / 2, y + h + 0.004, 0.015))
        if house.shutters and y > 2:
            for side in (-1, 1):
                swing = rng.choice([0.0, 0.0, 0.0, 25.0, 55.0, 165.0])
                leaf = [box(w / 2, h + 0.04, 0.03, w / 4 + 0.05, 0, 0)]
                leaf += [
                    box(w / 2 - 0.1, 0.02, 0.03, w / 4 + 0.05, 0.14 + 0.2 * i, 0.017)
                    for i in range(0 if house.far else int(h / 0.2) - 1)
                ]
                leaf = merged(leaf).turned("y", -swing)
                if side < 0:
                    leaf = leaf.turned("y", 180)
                    leaf = Shape(leaf.points * [1, 1, -1], leaf.normals * [1, 1, -1], leaf.st, leaf.faces[:, ::-1])
                blinds.append(leaf.at(x + w / 2 + side * w / 2, y - 0.02, 0.035))
    m.add_faceted(f"{house.name}/frames", merged(frames), "white_paint")
    if sills:
        m.add_faceted(f"{house.name}/sills", merged(sills), "stone")
    if blinds:
        m.add_faceted(f"{house.name}/shutters", merged(blinds), house.shutters)
    for glass, parts in panes.items():
        if parts:
            m.add_faceted(f"{house.name}/{glass}", merged(parts), glass)


def entrances(m: Stage, house: House) -> None:
    """Panelled doors behind the wall's face, each with a step, and a lintel."""
    leaves, stones, knobs = [], [], []
    for x, w, h in house.doors:
        leaves.append(box(w, h, 0.05, x + w / 2, 0.1, -PANE + 0.02))
        for column in (0.27, 0.73):
            leaves += [
                box(0.36 * w, part * h, 0.03, x + column * w, 0.1 + at * h, -PANE + 0.05)
                for at, part in ((0.07, 0.3), (0.45, 0.46))
            ]
        stones += [box(w + 0.5, 0.1, 0.45, x + w / 2, 0, 0.05), box(w + 0.36, 0.24, 0.1, x + w / 2, h + 0.1, 0.02)]
        stones += [box(0.18, h + 0.1, 0.09, x + w / 2 + side * (w / 2 + 0.09), 0, 0.015) for side in (-1, 1)]
        knobs.append(lathe([(0.02, 0), (0.03, 0.03), (0, 0.05)], 10).turned("x", 90).at(x + 0.85 * w, 1.1, -PANE + 0.06))
    if leaves:
        m.add_faceted(f"{house.name}/door", merged(leaves), house.shutters or "teal_paint")
        m.add_faceted(f"{house.name}/doorway", merged(stones), "stone")
        m.add(f"{house.name}/knob", merged(knobs), "brass")


def trim(m: Stage, house: House, holes) -> None:
    width, height = house.width, house.height
    doors = [hole for hole in holes if hole[1] < 0.5]
    edges = [0.0, *(v for x, _, w, _ in sorted(doors) for v in (x, x + w)), width]
    parts = [box(b - a, 0.55, 0.1, (a + b) / 2, 0, 0.01) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    parts += [
        box(width + 0.1, 0.14, 0.3, width / 2, height - 0.3, 0.05),
        box(width + 0.2, 0.16, 0.5, width / 2, height - 0.16, 0.1),
    ]
    if height > 5.5:
        parts.append(box(width + 0.04, 0.1, 0.12, width / 2, 0.5 * height + 0.1, 0.02))
    for x in house.corners:  # quoins, long and short by turns
        for k in range(int((height - 0.9) / 0.36)):
            long = 0.46 if k % 2 else 0.28
            at = x + (long / 2 if x < width / 2 else -long / 2) - np.sign(width / 2 - x) * 0.02
            parts.append(box(long, 0.34, 0.08, at, 0.56 + 0.36 * k, 0.005))
    m.add_faceted(f"{house.name}/trim", merged(parts), "stone")


def roof(m: Stage, house: House) -> None:
    width, height = house.width, house.height
    section = np.array([(0, 0), (-2 * DEEP, 0), (-2 * DEEP, height + 0.2), (-DEEP, height + RIDGE), (0, height + 0.2)])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    sides = []
    for x, faces in ((0, fan[:, ::-1]), (width, fan)):
        points = np.insert(section[:, ::-1], 0, x, axis=1)
        sides.append(Shape(points, np.tile((1.0 if x else -1.0, 0, 0), (5, 1)), section, faces))
    gables = merged(sides)
    m.add_faceted(
        f"{house.name}/sides", gables if house.skin == "brick" else whole_height(gables, height + RIDGE, 2.1), house.skin
    )
    fall = RIDGE * (1 + 0.45 / DEEP)  # both slopes go 0.45 m past the walls
    left, along = -0.15, (width + 0.3, 0, 0)
    eaves, top = height + RIDGE + 0.04 - fall, height + RIDGE + 0.04
    slopes = [
        quad((left, eaves, 0.45), along, (0, fall, -DEEP - 0.45)),
        quad((left, top, -DEEP), along, (0, -fall, -DEEP - 0.45)),
        quad((left, eaves - 0.06, 0.45), along, (0, 0.06, 0)),
    ]
    tiles = [tube([(left, top - 0.03, -DEEP), (left + width + 0.3, top - 0.03, -DEEP)], 0.12, 6)]
    verge = []
    pitch = np.degrees(np.arctan2(fall, DEEP + 0.45))
    for x in (left, left + width + 0.3):
        for sign in (1, -1):
            board = box(0.05, 0.16, (DEEP + 0.45) / np.cos(np.radians(pitch)), 0, -0.15, 0).turned("x", sign * pitch)
            verge.append(board.at(x, (eaves + top) / 2, -DEEP + sign * (DEEP + 0.45) / 2))
    for x in house.dormers:
        front, base = -1.1, height + RIDGE * 1.1 / DEEP + 0.15
        verge.append(box(1.1, 1.25, 1.6, x, base - 0.2, front - 0.8))
        slopes += [quad((x - side * 0.75, base + 0.95, front + 0.2), (side * 0.75, 0.5, 0), (0, 0, -2.3)) for side in (1, -1)]
        pane = quad((x - 0.35, base + 0.1, front + 0.012), (0.7, 0, 0), (0, 0.85, 0), st=(1, 1))
        m.add_faceted(
            f"{house.name}/dormer{round(x)}", Shape(pane.points, pane.normals, room(round(x) % 8), pane.faces), "glass"
        )
    m.add_faceted(f"{house.name}/roof", merged([*slopes, *tiles]), "tiles")
    m.add_faceted(f"{house.name}/verge", merged(verge), "white_paint" if house.skin != "brick" else "oak")
    gutter = [tube([(left, eaves - 0.06, 0.52), (left + width + 0.3, eaves - 0.09, 0.52)], 0.065, 7)]
    for x in house.pipes:
        bend = [
            (x, eaves - 0.1, 0.5),
            (x, eaves - 0.32, 0.42),
            (x, eaves - 0.75, 0.11),
            (x, eaves - 1.0, 0.09),
            (x, 0.12, 0.09),
            (x, 0.03, 0.2),
        ]
        gutter.append(tube(bend, 0.045, 7))
        gutter += [box(0.13, 0.035, 0.14, x, y, 0.07) for y in np.arange(1.2, eaves - 1.0, 1.7)]
    m.add(f"{house.name}/gutter", merged(gutter), "zinc")


def chimneys(m: Stage, house: House) -> None:
    if not house.chimneys:
        return
    stacks, pots = [], []
    for x, back in house.chimneys:
        foot = house.height + RIDGE * (1 - abs(back - DEEP) / DEEP) - 0.3
        top = house.height + RIDGE + 0.75
        stacks += [
            box(0.7, top - foot, 0.55, x, foot, -back),
            box(0.84, 0.1, 0.69, x, top - 0.25, -back),
            box(0.78, 0.08, 0.63, x, top, -back),
        ]
        pots += [CHIMNEY_POT.at(x + dx, top + 0.08, -back) for dx in (-0.18, 0.18)]
    m.add_faceted(f"{house.name}/chimneys", merged(stacks), "brick")
    m.add(f"{house.name}/chimney_pots", merged(pots), "terracotta")


def building(m: Stage, house: House) -> None:
    rng = np.random.default_rng(sum(map(ord, house.name)))
    m.group(house.name, house.place, house.turn)
    holes = [*house.windows, *((x, 0.1, w, h) for x, w, h in house.doors)]
    front = wall(house.width, house.height, holes, reveal=PANE + 0.01)
    plain = house.skin == "brick"
    m.add_faceted(
        f"{house.name}/wall", front if plain else whole_height(front, house.height, float(rng.uniform(0, FACADE))), house.skin
    )
    windows(m, house, rng)
    entrances(m, house)
    trim(m, house, holes)
    roof(m, house)
    chimneys(m, house)
