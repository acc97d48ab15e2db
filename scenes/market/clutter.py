"""What makes the market used: bicycles, awnings, signs, window boxes, vines, laundry, lamps on walls, a bench."""

import numpy as np
from scenes.making.shapes import Shape, ball, bow, box, canopy, lathe, merged, quad, sheet, tube
from scenes.making.usd_stage import Stage

from .goods import VASES


def ring(radius: float, thick: float, count: int = 24, sides: int = 5) -> Shape:
    """A torus about z."""
    angle = np.linspace(0, 2 * np.pi, count + 1)
    return tube([(radius * np.cos(a), radius * np.sin(a), 0) for a in angle], thick, sides)


def bicycle(m: Stage, path: str, place, turn: float, lean: float, paint: str) -> None:
    """Heading along +x of its group, leaning about its tyres' line."""
    m.group(path, place, turn)
    wheels = [(x, 0.34) for x in (-0.52, 0.52)]
    black = [ring(0.325, 0.017).at(x, y, 0) for x, y in wheels]
    bright = [ring(0.3, 0.008, 24, 4).at(x, y, 0) for x, y in wheels]
    for x, y in wheels:
        for k in range(12):
            a = 2 * np.pi * k / 12
            bright.append(tube([(x, y, 0.02 * (-1) ** k), (x + 0.3 * np.cos(a), y + 0.3 * np.sin(a), 0)], 0.0016, 3))
    crank, seat, head, fork = (-0.08, 0.3, 0), (-0.24, 0.84, 0), (0.34, 0.86, 0), (0.52, 0.34, 0)
    pipes = [
        (crank, seat),
        (crank, (0.36, 0.76, 0)),
        (seat, (0.345, 0.84, 0)),
        (crank, (-0.52, 0.34, 0)),
        ((-0.21, 0.74, 0), (-0.52, 0.34, 0)),
    ]
    frame = [tube(line, 0.017, 7) for line in pipes] + [tube([head, (0.38, 0.7, 0), fork], 0.015, 7)]
    mudguard = np.linspace(0.1, 2.5, 9)
    frame += [tube([(x + 0.36 * np.cos(a), y + 0.36 * np.sin(a), 0) for a in mudguard], 0.016, 4) for x, y in wheels]
    bright += [tube([(0.42, 0.98, side * 0.27), (0.46, 1.0, side * 0.1), (0.32, 0.98, 0)], 0.011, 6) for side in (-1, 1)]
    bright += [tube([head, (0.32, 0.98, 0)], 0.012, 6), tube([seat, (-0.265, 0.93, 0)], 0.012, 6)]
    bright += [ring(0.09, 0.006, 18, 4).at(*crank), tube([(-0.2, 0.2, 0.06), crank, (0.04, 0.4, -0.06)], 0.008, 5)]
    black += [
        ball(0.1, 12, 6).scaled(1.35, 0.45, 0.8).at(-0.28, 0.96, 0),
        *(tube([(0.42, 0.98, s * 0.2), (0.31, 0.965, s * 0.3)], 0.016, 6) for s in (-1, 1)),
    ]
    black += [box(0.09, 0.02, 0.06, x, y, z) for x, y, z in ((-0.2, 0.19, 0.1), (0.04, 0.39, -0.1))]
    basket = [
        lathe([(0.12, 0.68), (0.16, 0.92)], 14).scaled(1, 1, 1.3).at(0.58, 0, 0),
        *(ring(r, 0.009, 18, 4).turned("x", 90).scaled(1, 1, 1.3).at(0.58, y, 0) for r, y in ((0.16, 0.92), (0.14, 0.8))),
    ]
    for name, parts, material in (
        ("tyres", black, "iron"),
        ("bright", bright, "steel"),
        ("frame", frame, paint),
        ("basket", basket, "wicker"),
    ):
        m.add(f"{path}/{name}", merged(parts).turned("x", lean), material)


def awnings(m: Stage) -> None:
    """Over the lit windows of the brick house and of the cream one."""
    shapes, arms = [], []
    for x, z, turn, width in ((-1.05, -6.93, 0, 2.1), (3.45, -6.93, 0, 2.3), (9.93, -0.2, -90, 1.5)):
        cloth = canopy(width, 0.95, 2.96, 2.62, 0.2, round(width * 3)).at(0, 0, 0.5)
        shapes.append(cloth.turned("y", turn).at(x, 0, z))
        rods = merged(
            [tube([(side * (width / 2 - 0.03), 2.5, 0), (side * (width / 2 - 0.03), 2.6, 0.95)], 0.011, 5) for side in (-1, 1)]
        )
        arms.append(rods.turned("y", turn).at(x, 0, z))
    m.add("Awnings/cloth", merged(shapes), "green_canvas")
    m.add("Awnings/arms", merged(arms), "iron")


BOXES = (  # x, y, z of the middle of a sill, turn about y, width
    (-9.6, 3.95, -7, 0, 1.0),
    (-4.6, 3.95, -7, 0, 1.0),
    (-1.2, 4.45, -7, 0, 1.0),
    (1.2, 4.45, -7, 0, 1.0),
    (3.6, 4.45, -7, 0, 1.0),
    (8.6, 3.85, -7, 0, 1.0),
    (10, 3.75, -2.8, -90, 1.0),
    (10, 3.75, -5.4, -90, 1.0),
    (10, 3.75, 2.4, -90, 1.0),
    (-11, 3.55, -4.0, 90, 1.0),
    (1.5, 4.55, 14, 180, 1.0),
    (-3.3, 4.55, 14, 180, 1.0),
    (-9.1, 3.85, 14, 180, 1.0),
    (-16, 1.05, 8.2, 90, 1.0),
    (-16, 1.05, 10.6, 90, 1.0),
)


def leaf(size: float) -> Shape:
    """A pointed leaf from the origin up to y = size, folded along its middle; opaque, which is cheaper than a card."""
    points = np.array([(0, 0, 0), (0.42, 0.42, 0.14), (0, 1, 0), (-0.42, 0.42, 0.14)]) * size
    return Shape(points, np.tile((0.0, 0.0, 1.0), (4, 1)), np.zeros((4, 2)), np.array([[0, 1, 2], [0, 2, 3]]))


def window_boxes(m: Stage) -> None:
    rng = np.random.default_rng(220)
    boxes, green, blossoms = [], ([], []), {"red": [], "white": [], "gold": []}
    for k, (x, y, z, turn, width) in enumerate(BOXES):
        boxes.append(box(width, 0.17, 0.19, 0, 0, 0.17).turned("y", turn).at(x, y, z))
        for j in range(34):
            blade = leaf(rng.uniform(0.1, 0.17)).turned("x", rng.uniform(-10, 120)).turned("y", rng.normal(0, 55))
            spot = rng.uniform(-0.5, 0.5) * width, 0.15 + abs(rng.normal(0, 0.07)), 0.2 + rng.normal(0, 0.05)
            green[j % 2].append(blade.at(*spot).turned("y", turn).at(x, y, z))
        for _ in range(19):
            spot = rng.uniform(-0.5, 0.5) * width, 0.17 + abs(rng.normal(0.06, 0.09)), 0.24 + rng.normal(0, 0.07)
            size = rng.uniform(0.035, 0.06)
            flower = merged(
                [quad((-size / 2, -size / 2, 0), (size, 0, 0), (0, size, 0)).turned("y", a).turned("z", 45) for a in (-25, 65)]
            )
            blossoms[("red", "white", "red", "gold")[k % 4]].append(flower.at(*spot).turned("y", turn).at(x, y, z))
    m.add_faceted("Windowboxes/boxes", merged(boxes), "teal_paint")
    m.add_faceted("Windowboxes/leaves", merged(green[0]), "ivy")
    m.add_faceted("Windowboxes/young_leaves", merged(green[1]), "ivy_young")
    for name, shapes in blossoms.items():
        m.add_faceted(f"Windowboxes/{name}", merged(shapes), f"petal_{name}")


def vines(m: Stage) -> None:
    """Climbers on the rose house and up the pipe between the ochre and the brick house."""
    rng = np.random.default_rng(230)
    leaves: tuple[list[Shape], list[Shape]] = ([], [])
    for x, z, foot, tall, wide, count in (
        (7.5, -6.97, 0.1, 5.2, 0.5, 330),
        (-3.15, -6.97, 0.1, 5.6, 0.28, 290),
        (-11.6, -2.57, 0.0, 4.6, 0.5, 330),
    ):
        for k in range(count):
            t = (k / count) ** 0.9
            one = leaf(rng.uniform(0.13, 0.23) * (1 - 0.25 * t)).turned("z", 180 + rng.normal(0, 42))
            one = one.turned("x", rng.normal(-22, 14)).turned("y", rng.normal(0, 24))
            spread = wide * (0.35 + 0.65 * np.sin(np.pi * min(1, t + 0.2))) * rng.normal(0, 0.55)
            spot = x + spread + 0.25 * np.sin(5 * t) * wide, foot + tall * t + 0.15, z + rng.uniform(0.04, 0.15)
            leaves[int(rng.uniform() < 0.3 + 0.3 * t)].append(one.at(*spot))
    m.add_faceted("Vines/leaves", merged(leaves[0]), "ivy")
    m.add_faceted("Vines/young_leaves", merged(leaves[1]), "ivy_young")
    stems = [
        tube([(x + 0.05 * np.sin(4 * y), y, z) for y in np.arange(0, top, 0.3)], 0.016, 5)
        for x, z, top in ((7.5, -6.94, 4.6), (-11.6, -2.55, 4.0))
    ]
    m.add("Vines/stems", merged(stems), "oak")


def signs(m: Stage) -> None:
    """Boards on brackets: a vase for the pottery, a pretzel for the baker; a painted gable; the cafe's menu."""
    iron, boards, gilt = [], [], []
    for k, (x, y, z, turn) in enumerate(((6.0, 3.3, -7, 0), (-4.0, 3.25, -7, 0), (10, 3.3, 1.9, -90))):
        bracket = [
            tube([(0, 0.5, 0), (0, 0.5, 1.0)], 0.014, 6),
            tube(bow((0, 0.1, 0), (0, 0.48, 0.8), (0, -0.06, 0.08)), 0.01, 5),
        ]
        bracket += [tube([(0, 0.5, s), (0, 0.38, s)], 0.006, 4) for s in (0.4, 0.8)]
        board = (
            lathe([(0.34, -0.02), (0.36, -0.02), (0.36, 0.02), (0.34, 0.02), (0.34, 0.012), (0, 0.012)], 20)
            .turned("z", 90)
            .at(0, 0.06, 0.6)
        )
        plate = lathe([(0, -0.012), (0.34, -0.012)], 20).turned("z", 90).at(0, 0.06, 0.6)
        if k == 1:
            t = np.linspace(0.35, 2 * np.pi - 0.35, 24)
            loop = [(0, 0.06 + 0.18 * np.cos(a) * (1 - 0.2 * np.cos(2 * a)), 0.6 + 0.2 * np.sin(2 * a)) for a in t]
            emblem = tube(loop, 0.026, 6)
        else:
            emblem = lathe(VASES["round"], 12, refine=2).scaled(0.12, 1.2, 1.2).at(0, -0.15, 0.6)
        for bag, parts in ((iron, bracket), (boards, [board, plate]), (gilt, [emblem])):
            bag += [part.turned("y", turn).at(x, y, z) for part in parts]
    m.add("Signs/brackets", merged(iron), "iron")
    m.add("Signs/boards", merged(boards), "sign_green")
    m.add("Signs/emblems", merged(gilt), "gilt")
    m.add("Signs/gable", quad((-15.6, 3.5, -2.588), (3.6, 0, 0), (0, 1.0, 0), st=(1, 1)), "painted")
    m.group("Menu", (1.85, 0, -4.55), -12)
    leaves = [box(0.6, 0.95, 0.03, 0, 0, 0).turned("x", -side * 12).at(0, 0, side * 0.22) for side in (-1, 1)]
    m.add_faceted("Menu/frame", merged(leaves), "oak")
    m.add(
        "Menu/slate", quad((-0.26, 0.06, 0.017), (0.52, 0, 0), (0, 0.83, 0), st=(1, 1)).turned("x", -12).at(0, 0, 0.22), "slate"
    )


def wall_lamps(m: Stage) -> None:
    iron, glow = [], []
    for x, y, z, turn in (
        (0.2, 2.35, -7, 0),
        (2.15, 2.35, -7, 0),
        (-7.2, 3.1, -7, 0),
        (10, 2.9, -2.0, -90),
        (10, 2.9, 3.35, -90),
        (-11, 2.9, -4.75, 90),
        (-2.9, 2.9, 14, 180),
        (-16, 2.9, 3.0, 90),
    ):
        cage = [
            tube(bow((0, 0.25, 0), (0, 0.2, 0.3), (0, 0.12, 0)), 0.012, 5),
            lathe([(0.1, 0.12), (0.02, 0.2), (0, 0.22)], 6).at(0, 0, 0.3),
            lathe([(0, -0.16), (0.06, -0.16), (0.06, -0.14), (0, -0.14)], 6).at(0, 0, 0.3),
        ]
        cage += [
            tube(
                [(0.06 * np.sin(a), -0.15, 0.3 + 0.06 * np.cos(a)), (0.09 * np.sin(a), 0.12, 0.3 + 0.09 * np.cos(a))], 0.005, 4
            )
            for a in np.arange(6) * np.pi / 3
        ]
        iron += [part.turned("y", turn).at(x, y, z) for part in cage]
        glow.append(lathe([(0, -0.13), (0.045, -0.13), (0.06, 0.08), (0, 0.1)], 8).at(0, 0, 0.3).turned("y", turn).at(x, y, z))
    m.add("Walllamps/cages", merged(iron), "iron")
    m.add("Walllamps/glass", merged(glow), "lamp_glass")


def cloth(width: float, height: float, seed: int) -> Shape:
    """Linen that hangs from its upper edge."""
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, 9), np.linspace(-height, 0, 6))
    wave = 0.035 * np.sin(x * 11 + seed) * (1 - y / height) + 0.05 * np.sin(2 * seed + y * 3) * -y
    return sheet(
        np.stack([x + 0.02 * np.sin(seed + 5 * y) * -y, y - 0.03 * np.cos(x / width * np.pi), wave], axis=-1),
        np.stack([x, y], axis=-1),
    )


def laundry(m: Stage) -> None:
    """A line with sheets and towels along the cream house."""
    bags: dict[str, list[Shape]] = {"chalk": [], "linen": [], "blue_flag": [], "rose_cloth": []}
    line = np.array(bow((9.5, 3.45, -4.3), (9.5, 3.4, 0.9), (0, -0.12, 0), 15))
    cords = [tube(line, 0.005, 4)]
    for j in range(1, 14, 2):
        wide, tall = (0.62, 0.42, 0.55, 0.3)[j % 4], (0.8, 0.55, 0.95, 0.62)[3 * j % 4]
        tuple(bags.values())[(j // 2) % 4].append(cloth(wide, tall, j).turned("y", -90).at(*line[j]))
    cords += [tube([(9.5, 3.45, z), (10, 3.5, z)], 0.012, 5) for z in (-4.3, 0.9)]
    m.add("Laundry/cords", merged(cords), "wire")
    for name, shapes in bags.items():
        m.add(f"Laundry/{name}", merged(shapes), name)


def bench(m: Stage, path: str, place, turn: float) -> None:
    m.group(path, place, turn)
    slats = [box(1.6, 0.035, 0.1, 0, 0.42, -0.18 + 0.12 * k) for k in range(4)]
    slats += [box(1.6, 0.1, 0.03, 0, y, -0.27 - 0.06 * k) for k, y in enumerate((0.55, 0.69))]
    m.add_faceted(f"{path}/slats", merged(slats), "oak")
    legs = [tube([(x, 0, 0.2), (x, 0.41, 0.16), (x, 0.41, -0.22), (x, 0.8, -0.36)], 0.02, 6) for x in (-0.65, 0.65)]
    legs += [tube([(x, 0, -0.3), (x, 0.41, -0.2)], 0.02, 6) for x in (-0.65, 0.65)]
    m.add(f"{path}/iron", merged(legs), "iron")


def clutter(m: Stage) -> None:
    for part in (awnings, window_boxes, vines, signs, wall_lamps, laundry):
        part(m)
    bicycle(m, "Bicycles/Bike0", (-1.8, 0, -5.08), 0, -9, "bike_green")
    bicycle(m, "Bicycles/Bike1", (9.72, 0.12, 0.95), -90, -9, "bike_red")
    bench(m, "Benches/Bench0", (-3.4, 0, 5.6), 80)
    bench(m, "Benches/Bench1", (9.45, 0.12, 4.7), -90)
    bench(m, "Benches/Bench2", (-13.9, 0.12, 2.6), 90)
