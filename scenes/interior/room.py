"""The room itself: floor, walls, windows with dusk behind them, ceiling, chimney, bookcases."""

import numpy as np
from scenes.making.shapes import box, lathe, merged, quad, sheet, tube, wall

from .furniture import candle, curtain, picture
from .light import HIGH, ROOM, SILL, WIDE, WINDOWS
from .scene_file import SceneFile
from .shelves import BASE, BOARD, COUNT, SHELF, bookcase, books_in_a_row

(LEFT, _, BACK), (RIGHT, CEILING, FRONT) = ROOM.tolist()
BREAST = 0.42  # how far the chimney stands out of the back wall
ROWS = 12  # of books that differ
CASES = [(4.64, -6.0 + 1.2 * k, -90) for k in range(10)] + [(x, -6.64, 0) for x in (-3.2, -1.98, 1.98, 3.2)]


def shell(m: SceneFile) -> None:
    x, z = np.meshgrid(np.linspace(LEFT, RIGHT, 11), np.linspace(FRONT, BACK, 15))
    st = np.stack([x - z, -x - z], axis=-1) * np.sqrt(0.5)  # planks run at 45 degrees to the walls
    m.add("Room/floor", sheet(np.stack([x, 0 * x, z], axis=-1), st), "parquet")
    m.add("Room/ceiling", quad((LEFT, CEILING, BACK), (10, 0, 0), (0, 0, FRONT - BACK)), "plaster")
    holes = [(FRONT - z - WIDE / 2, SILL, WIDE, HIGH) for z in WINDOWS]
    m.add("Room/left_wall", wall(FRONT - BACK, CEILING, holes, 0.3), "damask", (LEFT, 0, FRONT), 90)
    m.add("Room/right_wall", wall(FRONT - BACK, CEILING, []), "damask", (RIGHT, 0, BACK), -90)
    m.add("Room/back_wall", wall(10, CEILING, []), "damask", (LEFT, 0, BACK))
    m.add("Room/front_wall", wall(10, CEILING, []), "damask", (RIGHT, 0, FRONT), 180)
    beams = [box(10, 0.2, 0.2, 0, CEILING - 0.2, z) for z in np.arange(-6.2, FRONT, 1.8)]
    beams += [box(0.2, 0.18, FRONT - BACK, x, CEILING - 0.18, (FRONT + BACK) / 2) for x in (-3.3, -1.1, 1.1, 3.3)]
    m.add("Room/beams", merged(beams), "walnut")
    crown = []
    for step, (tall, out) in enumerate(((0.05, 0.14), (0.05, 0.1), (0.06, 0.06))):
        y = CEILING - 0.05 - 0.05 * step
        crown += [box(out, tall, FRONT - BACK, x, y, 0.25) for x in (LEFT + out / 2, RIGHT - out / 2)]
        crown += [box(10, tall, out, 0, y, z) for z in (BACK + out / 2, FRONT - out / 2)]
    m.add("Room/crown", merged(crown), "moulding")
    gaps = [BACK, *(v for z in WINDOWS for v in (z - WIDE / 2 - 0.14, z + WIDE / 2 + 0.14)), FRONT]
    panels = []
    for a, b in zip(gaps[::2], gaps[1::2], strict=True):
        middle, long = (a + b) / 2, b - a
        panels += [box(0.03, 1.0, long, LEFT + 0.015, 0, middle), box(0.07, 0.05, long, LEFT + 0.035, 0.98, middle)]
        panels += [box(0.05, 0.16, long, LEFT + 0.025, 0, middle)]
        count = max(1, round(long / 0.7))
        for k in range(count):
            centre, w = a + long * (k + 0.5) / count, long / count - 0.16
            panels += [box(0.025, 0.03, w, LEFT + 0.04, y, centre) for y in (0.26, 0.84)]
            panels += [box(0.025, 0.61, 0.03, LEFT + 0.04, 0.26, centre + s * (w / 2 - 0.015)) for s in (-1, 1)]
    panels += [box(0.5, 0.2, 0.04, x, 0, BACK + 0.02) for x in (-4.6,)]
    m.add("Room/panelling", merged(panels), "walnut")


def windows(m: SceneFile) -> None:
    bars, sills = [], []
    for x in np.linspace(-WIDE / 2 + 0.03, WIDE / 2 - 0.03, 4):
        bars.append(box(0.06 if abs(x) > 0.5 else 0.032, HIGH, 0.06, x, 0, -0.17))
    bars += [
        box(WIDE, 0.06 if k in (0, 5) else 0.045 if k == 4 else 0.032, 0.058, 0, HIGH * k / 5 - 0.06 * (k == 5), -0.17)
        for k in range(6)
    ]
    bars += [box(0.14, HIGH + 0.14, 0.05, s * (WIDE / 2 + 0.07), 0, 0.025) for s in (-1, 1)]
    bars += [box(WIDE + 0.36, 0.16, 0.07, 0, HIGH, 0.03), box(WIDE + 0.42, 0.05, 0.13, 0, HIGH + 0.15, 0.05)]
    sills += [box(WIDE + 0.3, 0.05, 0.48, 0, -0.05, -0.06), box(WIDE + 0.2, 0.44, 0.03, 0, -0.5, 0.012)]
    frame, sill = m.mesh("window", merged(bars)), m.mesh("sill", merged(sills))
    rod = merged(
        [
            tube([(-1.25, 0, 0), (1.25, 0, 0)], 0.018, 10),
            *(lathe([(0, -0.03), (0.03, 0), (0, 0.05)], 12).turned("z", 90).at(x) for x in (-1.25, 1.25)),
        ]
    )
    rods, cloths = m.mesh("curtain_rod", rod), [m.mesh(f"curtain_{k}", curtain(0.62, 3.62, 200 + k)) for k in range(3)]
    for k, z in enumerate(WINDOWS):
        m.add(f"Windows/Window{k}/frame", frame, "moulding", (LEFT, SILL, z), 90)
        m.add(f"Windows/Window{k}/sill", sill, "moulding", (LEFT, SILL, z), 90)
        m.add(f"Windows/Window{k}/rod", rods, "polished_brass", (LEFT + 0.16, 3.73, z), 90)
        for s, side in enumerate((-1, 1)):
            turn = 90 if side > 0 else -90  # the gathered half lies towards the wall beside the window
            m.add(f"Windows/Window{k}/curtain{s}", cloths[(k + s) % 3], "velvet", (LEFT + 0.16, 0.06, z + side * 1.0), turn)
    m.add("Outside/dusk", ("rectangle", {}), "dusk", (-14, 4.5, -4), 90, (-30, -9.5, 1), glow="dusk")


def chimney(m: SceneFile) -> None:
    front, wide, open_w, open_h = BACK + BREAST, 2.7, 1.05, 0.92
    breast = [box((wide - open_w) / 2, CEILING, BREAST, s * (wide + open_w) / 4, 0, BACK + BREAST / 2) for s in (-1, 1)]
    breast += [box(open_w, CEILING - open_h, BREAST, 0, open_h, BACK + BREAST / 2)]
    m.add("Chimney/breast", merged(breast), "damask")
    inside = [
        quad((-open_w / 2, 0, BACK + 0.03), (open_w, 0, 0), (0, open_h, 0)),
        quad((-open_w / 2, 0, front), (0, 0, -BREAST + 0.03), (0, open_h, 0)),
        quad((open_w / 2, 0, BACK + 0.03), (0, 0, BREAST - 0.03), (0, open_h, 0)),
    ]
    m.add("Chimney/firebox", merged(inside), "soot")
    m.add(
        "Chimney/hearth",
        merged([box(2.3, 0.05, 1.0, 0, 0, front + 0.1), box(open_w, 0.06, BREAST, 0, 0, BACK + BREAST / 2)]),
        "hearth",
    )
    parts = []
    for s in (-1, 1):
        x = s * (open_w / 2 + 0.17)
        parts += [box(0.34, 0.16, 0.16, x, 0.05, front + 0.08), box(0.28, 0.82, 0.1, x, 0.21, front + 0.05)]
        parts += [box(0.04, 0.7, 0.03, x + o, 0.26, front + 0.105) for o in (-0.08, 0, 0.08)]
        parts += [box(0.34, 0.06, 0.14, x, 1.0, front + 0.07), box(0.3, 0.16, 0.12, x, 1.06, front + 0.06)]
    parts += [box(open_w, 0.14, 0.08, 0, open_h, front + 0.04), box(open_w, 0.16, 0.1, 0, 1.06, front + 0.05)]
    for k, (tall, out) in enumerate(((0.04, 0.17), (0.035, 0.22), (0.055, 0.28))):
        parts.append(box(1.78 + 0.3 * (out - 0.1), tall, out, 0, 1.22 + 0.04 * k - 0.005 * (k > 1), front + out / 2))
    m.add("Chimney/mantel", merged(parts), "marble")
    rng = np.random.default_rng(300)
    logs = []
    for k in range(5):
        log = tube([(-0.3 + 0.03 * k, 0, 0), (-0.1, 0.01, 0.01), (0.1, 0, 0), (0.28, 0.01, 0)], 0.05 + 0.006 * k, 9)
        logs.append(
            log.turned("y", rng.uniform(-25, 25))
            .turned("z", rng.uniform(-8, 8))
            .at(0.03 * k - 0.06, 0.15 + 0.075 * (k // 2), BACK + 0.2 + 0.06 * (k % 2))
        )
    m.add("Fire/logs", merged(logs), "charred")
    u, w = np.meshgrid(np.linspace(-1, 1, 15), np.linspace(-1, 1, 9))
    heap = 0.075 + 0.06 * np.exp(-2.5 * (u**2 + w**2)) + 0.012 * rng.standard_normal(u.shape)
    bed = sheet(np.stack([0.36 * u, heap, BACK + 0.22 - 0.13 * w], axis=-1), np.stack([u / 2, w / 2], axis=-1))
    m.add("Fire/embers", bed, "flame", glow="embers")
    dogs = [tube([(x, 0.06, front - 0.02), (x, 0.3, front - 0.02)], 0.014, 8) for x in (-0.34, 0.34)]
    knobs = [
        lathe([(0, 0.29), (0.03, 0.31), (0.035, 0.33), (0.02, 0.36), (0, 0.37)], 12, refine=2).at(x, 0, front - 0.02)
        for x in (-0.34, 0.34)
    ]
    m.add("Fire/dogs", merged(dogs + knobs), "brass")
    for part, shape in picture(1.15, 0.86, 0).items():
        m.add(f"Pictures/Mantel/{part}", shape, {"gold": "gold", "canvas": "pictures"}[part], (0, 2.15, front + 0.01))
    for k, (z, panel) in enumerate(((-2.5, 1), (1.1, 2))):
        for part, shape in picture(0.84, 0.62, panel).items():
            look = {"gold": "gold", "canvas": "pictures"}[part]
            m.add(f"Pictures/Wall{k}/{part}", shape, look, (LEFT + 0.01, 1.62, z), 90)
    sticks = {part: m.mesh(f"candle_{part}", shape) for part, shape in candle(0.17).items()}
    for k, (x, size) in enumerate(((-0.68, 1.15), (-0.52, 0.9), (0.64, 1.0))):
        for part, look in (("brass", "polished_brass"), ("wax", "wax"), ("flame", "flame")):
            glow = (7.0, 3.9, 1.3) if part == "flame" else None
            m.add(f"Mantel/Candle{k}/{part}", sticks[part], look, (x, 1.345, front + 0.13), 0, size, glow)


def library(m: SceneFile) -> None:
    case = {part: m.mesh(f"case_{part}", shape) for part, shape in bookcase().items()}
    rows = [m.mesh(f"books_{k}", books_in_a_row(1.12, 400 + k)) for k in range(ROWS)]
    halves = [m.mesh(f"half_row_{k}", books_in_a_row(0.66, 430 + k)) for k in range(4)]
    urn = [
        (0.03, 0),
        (0.045, 0.012),
        (0.02, 0.03),
        (0.02, 0.045),
        (0.075, 0.11),
        (0.08, 0.16),
        (0.05, 0.2),
        (0.06, 0.225),
        (0.05, 0.225),
        (0, 0.2),
    ]
    dish = [(0.04, 0), (0.045, 0.01), (0.09, 0.04), (0.11, 0.075), (0.107, 0.075), (0.08, 0.04), (0, 0.02)]
    shapes = {
        "urn": lathe(urn, 28, refine=3),
        "casket": merged([box(0.2, 0.1, 0.13), box(0.214, 0.03, 0.144, 0, 0.1, 0), box(0.03, 0.04, 0.15, 0, 0.07, 0)]),
        "dish": lathe(dish, 32),
    }
    made = {name: m.mesh(f"ornament_{name}", shape) for name, shape in shapes.items()}
    ornaments = [
        (made["urn"], "celadon"),
        (made["urn"], "cobalt"),
        (made["casket"], "walnut"),
        (made["dish"], "copper"),
        (made["urn"], "gold"),
    ]
    rng = np.random.default_rng(410)
    for k, (x, z, turn) in enumerate(CASES):
        for part, look in (("wood", "walnut"), ("back", "walnut"), ("brass", "brass")):
            m.add(f"Library/Case{k}/{part}", case[part], look, (x, 0, z), turn)
        order = rng.permutation(ROWS)[:COUNT]
        for shelf in range(COUNT):
            out = -0.035 - rng.uniform(0, 0.03)
            dx, dz = (out, 0) if turn else (0, out)
            y, half = BASE + BOARD + shelf * SHELF, rng.uniform() < 0.17 and shelf < COUNT - 1
            if not half:
                m.add(f"Library/Case{k}/books{shelf}", rows[order[shelf]], "books", (x - dx, y, z + dz), turn)
                continue
            side = rng.choice((-1, 1))
            for what, along in (("books", -0.2 * side), ("ornament", 0.36 * side)):
                mesh, look = (halves[rng.integers(4)], "books") if what == "books" else ornaments[rng.integers(len(ornaments))]
                place = (x + 0.06, y, z + along) if turn else (x + along, y, z - 0.06)
                if what == "ornament":
                    place = (place[0] + 0.1, y, place[2]) if turn else (place[0], y, place[2] - 0.1)
                m.add(f"Library/Case{k}/{what}{shelf}", mesh, look, place, turn)
    rail = tube([(4.5, 3.06, -6.5), (4.5, 3.06, 5.3)], 0.016, 10)
    arms = [tube([(4.5, 3.06, z), (4.66, 3.06, z)], 0.01, 6) for z in np.arange(-6.6, 5.5, 1.2)]
    m.add("Library/rail", merged([rail, *arms]), "polished_brass")
