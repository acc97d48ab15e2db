"""The front of the station's hall at the end of the square: a glazed half circle between two towers."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.shapes import Shape, ball, box, lathe, merged, quad, sheet, tube, wall

from .station import HALL, arch_line, arch_wall, moulded_arch, ribbon


def write(m: GltfStage) -> None:
    """The front of the hall: a glazed half circle between two towers, doors below, the clock above."""
    place = m.group("Hall", (1.0, 0, HALL))
    radius, spring = 7.2, 6.4

    def add(name: str, shapes: list[Shape] | Shape, material: str) -> None:
        m.add(f"Hall/{name}", shapes if isinstance(shapes, Shape) else merged(shapes), material, parent=place)

    face = arch_wall(0, 5.2, 16.2, -10.2, 10.2, spring, radius, 0)
    lower = wall(20.4, 5.2, [(1.5 + 2.56 * k, 0, 1.75, 3.7) for k in range(7)], reveal=0.5).at(-10.2, 0, 0)
    line = np.concatenate([[(-radius, 5.2, 0)], arch_line(0, spring, radius, 0, 33), [(radius, 5.2, 0)]])
    add("front", [face, lower, ribbon(line[::-1], (0, 0, -0.9))], "ashlar")
    trims = [
        moulded_arch(0, spring, radius, 0, 0.75, 0.16),
        moulded_arch(0, spring, radius + 0.75, 0, 0.2, 0.26),
        box(1.1, 1.15, 0.5, 0, spring + radius - 0.22, 0.1),
    ]
    trims += [
        box(20.8, 0.3, 0.6, 0, 4.75, 0.2),
        box(20.8, 0.14, 0.9, 0, 5.05, 0.3),
        box(21, 0.5, 0.5, 0, 15.4, 0.1),
        box(21.4, 0.22, 1.1, 0, 15.9, 0.35),
    ]
    trims += [box(0.22, 0.24, 0.4, -10 + 0.5 * k, 15.66, 0.4) for k in range(41)]
    gable = np.array([(-10.4, 16.1, 0.2), (10.4, 16.1, 0.2), (0, 19.0, 0.2)])
    trims.append(Shape(gable, np.tile((0.0, 0, 1), (3, 1)), gable[:, :2], np.array([[0, 1, 2]])))
    for side in (-1, 1):
        slope = np.array([(side * 10.9, 16.0, 0), (0, 19.05, 0)])
        trims.append(tube(slope + [0, 0.12, 0.45], 0.2, 4))
        trims += [box(0.5, 5.2, 0.24, side * x, 0, 0.12) for x in (0.0, 10.0)]
    add("trim", trims, "trim")
    glass_arc = arch_line(0, spring, radius, -0.6, 33)
    base = glass_arc * [1, 0, 1] + [0, 5.2, 0]
    pane = sheet(np.stack([base, glass_arc]), np.zeros((2, 33, 2)))
    add("glass", Shape(pane.points, np.tile((0.0, 0, 1), (len(pane.points), 1)), pane.st, pane.faces), "hall_glass")
    bars = [
        tube(np.stack([r * np.cos(t), spring + r * np.sin(t), 0 * t - 0.5], axis=1), 0.06, 4)
        for r in (2.4, 4.8)
        for t in [np.linspace(0, np.pi, 25)]
    ]
    bars += [
        tube(
            [(2.4 * np.cos(a), spring + 2.4 * np.sin(a), -0.5), (7.2 * np.cos(a), spring + 7.2 * np.sin(a), -0.5)],
            0.05 if k % 2 else 0.1,
            4,
        )
        for k, a in enumerate(np.linspace(0, np.pi, 17))
    ]
    bars += [tube([(-7.2, y, -0.5), (7.2, y, -0.5)], 0.08, 4) for y in (5.25, spring)]
    bars += [tube([(x, 5.2, -0.5), (x, spring, -0.5)], 0.05, 4) for x in np.linspace(-6.4, 6.4, 9)]
    add("bars", bars, "iron")
    doors = [quad((-8.7 + 2.56 * k, 0, -0.42), (1.75, 0, 0), (0, 3.7, 0), st=(1, 1)) for k in range(7)]
    add("doors_lit", doors[1::2], "shop")
    add("doors", doors[::2], "glass")
    add(
        "door_frames",
        [box(0.09, 3.7, 0.1, -8.7 + 2.56 * k + x, 0, -0.38) for k in range(7) for x in (0.05, 0.87, 1.7)]
        + [box(1.75, 0.12, 0.1, -7.83 + 2.56 * k, 2.6, -0.38) for k in range(7)],
        "green_paint",
    )
    canopy = [box(19, 0.16, 3.4, 0, 4.05, 1.7), box(19.2, 0.3, 0.08, 0, 3.95, 3.42)]
    canopy += [tube([(x, 4.2, 3.3), (x, 6.0, 0.1)], 0.03, 5) for x in (-9, -4.5, 0, 4.5, 9)]
    add("canopy", canopy, "iron")
    add("frieze", quad((-3.6, 14.62, 0.06), (7.2, 0, 0), (0, 0.76, 0), st=(1, 1)), "frieze")
    add("clock", lathe([(1.5, 0), (1.5, 0.12)], 40).turned("x", 90).at(0, 17.3, 0.25), "iron")
    add(
        "clock_rim", lathe([(1.22, 0.0), (1.24, 0.14), (1.36, 0.14), (1.38, 0)], 40).turned("x", 90).at(0, 17.25, 0.24), "brass"
    )
    dial = lathe([(1.25, 0.0), (0.0, 0.001)], 40).turned("x", 90)
    add(
        "dial",
        Shape(dial.points, np.tile((0.0, 0, 1), (len(dial.points), 1)), dial.points[:, :2] / 2.5 + 0.5, dial.faces).at(
            0, 17.25, 0.32
        ),
        "clock",
    )
    hands = [
        box(0.09, 1.05, 0.03).turned("z", -62).at(0, 17.25, 0.37),
        box(0.13, 0.7, 0.03).turned("z", 112).at(0, 17.25, 0.35),
    ]
    add("hands", hands, "iron")
    for side in (-1, 1):
        tower(m, f"Hall/Tower{'LR'[side > 0]}", (1.0 + side * 13.2, 0, HALL + 0.4))


def tower(m: GltfStage, name: str, place) -> None:
    group = m.group(name, place)
    holes = [(2.4, 1.0, 1.2, 2.6), (2.4, 6.4, 1.2, 2.4), (2.4, 10.6, 1.2, 2.4)]
    front = wall(6, 17.5, holes, reveal=0.35).at(-3, 0, 0)
    sides = [
        wall(5, 17.5, [(1.9, y, 1.2, h) for _, y, _, h in holes], reveal=0.35).turned("y", a).at(s * 3, 0, z)
        for a, s, z in ((90, 1, 0), (-90, -1, -5))
    ]
    m.add(f"{name}/walls", merged([front, *sides]), "ashlar", parent=group)
    trims = [
        box(6.3, h, 0.4 + d, 0, y, 0)
        for y, h, d in (
            (5.05, 0.14, 0.5),
            (4.75, 0.3, 0.2),
            (9.4, 0.25, 0.25),
            (14.4, 0.3, 0.3),
            (17.0, 0.3, 0.5),
            (17.3, 0.2, 1.1),
        )
    ]
    trims += [
        box(0.3, h, 5.2, s * 3.05, y, -2.5) for s in (-1, 1) for y, h in ((4.85, 0.3), (9.4, 0.25), (14.4, 0.3), (17.2, 0.3))
    ]
    trims += [box(0.7, 17.4, 0.16, s * 2.6, 0, 0.06) for s in (-1, 1)]
    trims += [box(1.9, 0.24, 0.3, 0, y, 0.1) for y in (3.65, 8.85, 13.05)] + [
        box(1.7, 0.14, 0.3, 0, y, 0.08) for y in (6.25, 10.45)
    ]
    m.add(f"{name}/trim", merged(trims), "trim", parent=group)
    panes = [quad((-0.6, y, -0.33), (1.2, 0, 0), (0, h, 0), st=(1, 1)) for _, y, _, h in holes]
    panes += [
        quad((s * 2.68, y, -1.9 if s > 0 else -3.1), (0, 0, -1.2 * s), (0, h, 0), st=(1, 1))
        for s in (-1, 1)
        for _, y, _, h in holes
    ]
    m.add(f"{name}/glass", merged(panes), "glass", parent=group)
    roof = (
        lathe(
            [
                (4.6, 17.5),
                (4.3, 17.7),
                (3.6, 19.4),
                (2.0, 21.0),
                (1.2, 21.5),
                (1.2, 21.5),
                (1.05, 22.8),
                (0.5, 23.6),
                (0, 24.6),
            ],
            4,
        )
        .turned("y", 45)
        .scaled(1, 1, 0.86)
        .at(0, 0, -2.5)
    )
    m.add(f"{name}/roof", roof, "verdigris", parent=group)
    m.add(
        f"{name}/finial",
        merged([tube([(0, 24.4, -2.5), (0, 26.4, -2.5)], 0.05, 5), ball(0.18, 8, 5).at(0, 25.3, -2.5)]),
        "brass",
        parent=group,
    )
