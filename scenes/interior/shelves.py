"""Bookcases, and rows of books to stand in them: a few rows are made, and each stands in many places."""

import numpy as np
from scenes.making.shapes import Shape, box, lathe, merged, quad, unit

from .furniture import cushion
from .textures import SPINES

WIDTH, DEEP = 1.2, 0.36  # of one case
BASE, SHELF, COUNT = 0.62, 0.385, 7  # height of the cupboard below, of a shelf, and how many shelves
TALL = BASE + COUNT * SHELF + 0.12
BOARD = 0.028


def bookcase() -> dict[str, Shape]:
    """A case that stands on y = 0 with its front at z = 0: parts `wood` and `back`."""
    wood = [box(0.05, TALL, DEEP, x, 0, -DEEP / 2) for x in (-WIDTH / 2, WIDTH / 2)]
    wood += [box(WIDTH - 0.05, BOARD, DEEP - 0.02, 0, BASE + k * SHELF, -DEEP / 2 - 0.01) for k in range(COUNT + 1)]
    wood += [box(0.075, TALL - 0.1, 0.03, x, 0, 0.012) for x in (-WIDTH / 2, WIDTH / 2)]
    wood += [box(0.012, TALL - 0.5, 0.012, x + s, 0.22, 0.028) for x in (-WIDTH / 2, WIDTH / 2) for s in (-0.018, 0.018)]
    wood += [box(WIDTH, 0.1, 0.06, 0, 0, 0.02), box(WIDTH, 0.04, 0.1, 0, BASE - 0.03, 0.01)]
    wood += [box(WIDTH - 0.04, BASE - 0.12, 0.02, 0, 0.1, -0.02)]
    for side in (-1, 1):
        wood += [cushion(0.46, 0.36, 0.02, 0.008, steps=2).at(side * 0.27, 0.155, -0.004)]
        wood += [cushion(0.36, 0.26, 0.02, 0.009, steps=2).at(side * 0.27, 0.205, 0.006)]
    for k, (tall, out) in enumerate(((0.05, 0.03), (0.04, 0.06), (0.06, 0.1), (0.03, 0.13))):
        wood.append(box(WIDTH, tall, DEEP + out, 0, TALL - 0.06 + 0.045 * k, -DEEP / 2 + out / 2))
    back = quad((-WIDTH / 2, 0, -DEEP + 0.01), (WIDTH, 0, 0), (0, TALL, 0))
    knobs = [
        lathe([(0.004, 0), (0.005, 0.012), (0.014, 0.02), (0.012, 0.03), (0, 0.034)], 10)
        .turned("x", 90)
        .at(s * 0.06, 0.34, 0.0)
        for s in (-1, 1)
    ]
    return {"wood": merged(wood), "back": back, "brass": merged(knobs)}


def book(width: float, height: float, depth: float, number: int) -> Shape:
    """Standing, its rounded spine at z = 0 and its pages towards -z; st in the atlas of spines."""
    column, row = number % (SPINES - 1), number // (SPINES - 1) % 2
    left, top = (column + 0.06) / SPINES, 1 - 0.5 * row - 0.004
    bulge = np.array([-1, -0.6, 0, 0.6, 1])
    x, z = bulge * width / 2, (1 - bulge**2) * 0.18 * width - 0.16 * width
    points, normals, st = [], [], []
    for y in (0, height):
        points += [(a, y, b) for a, b in zip(x, z, strict=True)]
        normals += [(b * 0.8, 0, 1 - 0.3 * abs(b)) for b in bulge]
        st += [(left + (b + 1) / 2 * 0.88 / SPINES, top - 0.49 * (1 - y / height)) for b in bulge]
    spine = Shape(
        np.array(points),
        unit(np.array(normals)),
        np.array(st),
        np.concatenate([[[k, k + 1, k + 6], [k, k + 6, k + 5]] for k in range(4)]),
    )
    covers = [
        quad((-width / 2, 0, -depth), (0, 0, depth - 0.16 * width), (0, height, 0), st=(0.02 / SPINES, 0.49)),
        quad((width / 2, 0, -0.16 * width), (0, 0, 0.16 * width - depth), (0, height, 0), st=(0.02 / SPINES, 0.49)),
    ]
    covers = [Shape(c.points, c.normals, c.st + [left, top - 0.49], c.faces) for c in covers]
    cut = quad(
        (-width / 2 + 0.002, height - 0.004, -0.16 * width),
        (width - 0.004, 0, 0),
        (0, 0, -depth + 0.01),
        st=(0.4 / SPINES, 0.3),
    )
    pages = Shape(cut.points, cut.normals, cut.st + [(SPINES - 0.7) / SPINES, 0.6], cut.faces)
    return merged([spine, *covers, pages])


def books_in_a_row(width: float, seed: int) -> Shape:
    """Books side by side from x = -width / 2, most upright, some leaning, some lying in a pile, with gaps."""
    rng = np.random.default_rng(seed)
    shapes, x = [], -width / 2 + 0.01
    sort = rng.uniform(0.7, 1.0)
    while x < width / 2 - 0.06:
        kind, series = rng.uniform(), int(rng.integers(2 * (SPINES - 1)))
        if kind < 0.07 and x < width / 2 - 0.3:
            y = 0.0
            for _ in range(rng.integers(2, 5)):
                thick, long = rng.uniform(0.025, 0.05), rng.uniform(0.2, 0.25)
                flat = book(thick, long, rng.uniform(0.15, 0.19), int(rng.integers(62))).turned("z", 90)
                shapes.append(
                    flat.turned("y", rng.uniform(-5, 5)).at(
                        x + long + rng.uniform(0, 0.015), y + thick / 2, rng.uniform(-0.04, 0)
                    )
                )
                y += thick
            x += 0.27
        elif kind < 0.12:
            x += rng.uniform(0.03, 0.08)
        else:
            same = kind > 0.75
            tall, deep, thick = rng.uniform(0.21, 0.31) * sort, rng.uniform(0.15, 0.2), rng.uniform(0.022, 0.05)
            for _ in range(rng.integers(3, 9) if same else rng.integers(2, 6)):
                if x + thick > width / 2:
                    break
                shapes.append(book(thick, tall, deep, series).at(x + thick / 2, 0, rng.uniform(-0.035, -0.005)))
                x += thick + 0.001
                if not same:
                    series = int(rng.integers(62))
                    tall, deep, thick = rng.uniform(0.2, 0.31) * sort, rng.uniform(0.15, 0.2), rng.uniform(0.02, 0.052)
            if kind < 0.2 and x < width / 2 - 0.12:
                lean = rng.uniform(9, 15)
                tall = rng.uniform(0.2, 0.26)
                shapes.append(
                    book(0.03, tall, 0.17, int(rng.integers(62)))
                    .turned("z", lean)
                    .at(x + 0.02 + tall * np.sin(np.radians(lean)), 0.004, -0.02)
                )
                x += 0.045 + tall * np.sin(np.radians(lean))
    return merged(shapes)


def pile(seed: int, count: int) -> Shape:
    """Books that lie on each other, spines towards +z or askew, from y = 0."""
    rng = np.random.default_rng(seed)
    shapes, y = [], 0.0
    for k in range(count):
        thick, long = rng.uniform(0.024, 0.048), 0.27 - 0.02 * k + rng.uniform(-0.015, 0.015)
        flat = book(thick, long, 0.19 - 0.012 * k, int(rng.integers(62))).turned("z", 90).at(long / 2, thick / 2, 0.09)
        shapes.append(flat.turned("y", rng.uniform(-25, 25)).at(0, y, 0))
        y += thick
    return merged(shapes)
