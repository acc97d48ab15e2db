"""What moves beside the people: trams and pigeons."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.shapes import Shape, ball, box, lathe, merged, sheet, tube

from .station import face_normals


def tram(m: GltfStage, name: str, x: float, start: float, speed: float) -> None:
    """An old two-axle tram that rolls along z; at `start` after 0 s, in metres a second."""
    group = m.group(name, (x, 0, start))

    def add(part: str, shapes: list[Shape], material: str) -> None:
        m.add(f"{name}/{part}", merged(shapes), material, parent=group)

    outline = np.array(
        [
            (1.0, -5.0),
            (0.72, -5.45),
            (0.0, -5.6),
            (-0.72, -5.45),
            (-1.0, -5.0),
            (-1.0, 5.0),
            (-0.72, 5.45),
            (0.0, 5.6),
            (0.72, 5.45),
            (1.0, 5.0),
            (1.0, -5.0),
        ]
    )[::-1]

    def skirt(y0: float, y1: float, grow: float = 1.0) -> Shape:
        low = np.stack([outline[:, 0] * 1.1 * grow, np.full(len(outline), y0), outline[:, 1] * grow], axis=1)
        return face_normals(sheet(np.stack([low, low + [0, y1 - y0, 0]]), np.zeros((2, len(outline), 2))))

    add("lower", [skirt(0.38, 1.32), skirt(2.66, 2.86, 1.01)], "tram_red")
    add("upper", [skirt(1.32, 1.5), skirt(2.4, 2.66)], "tram_cream")
    add("windows", [skirt(1.5, 2.4, 0.985)], "glass")
    posts = [box(0.05, 0.92, 0.14, s * 1.09, 1.49, z) for s in (-1, 1) for z in np.linspace(-5, 5, 9)]
    posts += [box(0.12, 0.92, 0.1, s * 0.78, 1.49, e * 5.42) for s in (-1, 1) for e in (-1, 1)]
    add("pillars", posts, "tram_cream")
    roof = np.stack(
        [
            np.stack([outline[:, 0] * 1.1 * r, np.full(len(outline), y), outline[:, 1] * (0.25 + 0.75 * r)], axis=1)
            for r, y in ((1.03, 2.86), (0.95, 3.05), (0.65, 3.18), (0.0, 3.24))
        ]
    )
    add("roof", [sheet(roof, roof[..., [0, 2]]), box(0.9, 0.2, 6, 0, 3.15, 0)], "slate")
    add("under", [box(1.9, 0.3, 8.6, 0, 0.12, 0), *(box(0.3, 0.22, 0.2, 0, 0.5, s * 5.65) for s in (-1, 1))], "rubber")
    wheels = [
        lathe([(0.0, 0), (0.33, 0.0), (0.33, 0.1), (0, 0.1)], 16).turned("z", 90).at(s * 0.75 + 0.05, 0.28, z)
        for s in (-1, 1)
        for z in (-1.9, 1.9)
    ]
    add("wheels", wheels, "iron")
    add("lights", [ball(0.13, 10, 6).at(0, 1.0, s * 5.62) for s in (-1, 1)], "lamp")
    add(
        "pole",
        [
            tube([(0, 3.2, -0.6), (0, 4.2, 0.5), (0, 5.1, -0.4)], 0.025, 5),
            tube([(-0.7, 5.1, -0.4), (0.7, 5.1, -0.4)], 0.025, 5),
        ],
        "iron",
    )
    times = np.array([0.0, 8.0])
    m.animate(group, "translation", times, np.array([(x, 0, start), (x, 0, start + 8 * speed)]))


def pigeons(m: GltfStage) -> None:
    """Some peck on the ground, some fly across."""
    body = merged(
        [
            ball(0.5, 12, 8).scaled(0.13, 0.125, 0.25).turned("x", -14).at(0, 0.125, 0),
            ball(0.5, 8, 5).scaled(0.075, 0.02, 0.17).at(0, 0.115, -0.17),
        ]
    )
    front = merged(
        [
            ball(0.5, 10, 7).scaled(0.075, 0.13, 0.085).turned("x", 20).at(0, 0.2, 0.1),
            ball(0.5, 9, 6).scaled(0.062, 0.062, 0.07).at(0, 0.262, 0.125),
            ball(0.5, 6, 4).scaled(0.012, 0.012, 0.05).at(0, 0.255, 0.17),
        ]
    )
    legs = merged([tube([(x, 0, 0.01), (x, 0.09, 0.01)], 0.006, 4) for x in (-0.025, 0.025)])
    wing = sheet(
        np.array(
            [[(0, 0, 0.1), (0.2, 0.02, 0.11), (0.4, 0, -0.02)], [(0, 0, -0.09), (0.2, 0.02, -0.12), (0.36, 0, -0.1)]], float
        )[::-1],
        np.zeros((2, 3, 2)),
    )
    rng = np.random.default_rng(90)
    times = np.linspace(0, 8, 65)
    for k in range(11):
        x, z = (
            (-1.1 + rng.normal(0, 0.9), 3.6 + rng.normal(0, 0.8))
            if k < 7
            else (1.6 + rng.normal(0, 0.7), -4.0 + rng.normal(0, 0.8))
        )
        group = m.group(f"Pigeons/Pigeon{k}", (x, 0, z), float(rng.uniform(0, 360)), 1.05)
        m.add(f"Pigeons/Pigeon{k}/legs", legs, "terracotta", parent=group)
        pivot = m.group(f"Pigeons/Pigeon{k}/Pivot", (0, 0.1, 0), parent=group)
        m.add(f"Pigeons/Pigeon{k}/body", body, "pigeon", (0, -0.1, 0), parent=pivot)
        m.add(f"Pigeons/Pigeon{k}/neck", front, "pigeon_dark", (0, -0.1, 0), parent=pivot)
        peck = np.clip(np.sin(2 * np.pi * times / 2 + 1.9 * k) + 0.5 * np.sin(2 * np.pi * times + k), 0, 1) * (
            0.35 + 0.25 * (k % 3)
        )
        m.animate(
            pivot, "rotation", times, np.stack([np.sin(peck / 2 * 1.7), 0 * peck, 0 * peck, np.cos(peck / 2 * 1.7)], axis=1)
        )
    for k in range(6):
        start = np.array([-7.5 - 0.9 * k, 4.6 + 0.35 * np.sin(3.0 * k), -7.0 + 1.1 * k * (-1) ** k])
        along = times[:, None] * np.array([3.4, 0.28, 0.5])
        arc = np.stack([0 * times, 0.4 * np.sin(times * 1.3 + k), 0.5 * np.sin(times * 0.8 + k)], axis=1)
        group = m.group(f"Pigeons/Flying{k}", tuple(start), 82.0)
        m.animate(group, "translation", times, start + along + arc)
        m.add(
            f"Pigeons/Flying{k}/body",
            merged([body.at(0, -0.125, 0), front.turned("x", 50).at(0, -0.1, 0.1)]),
            "pigeon",
            parent=group,
        )
        beat = np.linspace(0, 8, 193)
        for side in (0, 1):
            flap = np.radians(-8 + 46 * np.sin(2 * np.pi * beat * 3 + k))
            pivot = m.group(f"Pigeons/Flying{k}/Wing{side}", (0.04 * (1 - 2 * side), 0.05, 0), parent=group)
            shape = wing if not side else wing.turned("z", 180)
            m.add(f"Pigeons/Flying{k}/wing{side}", shape, "pigeon", parent=pivot)
            turn = flap * (1 - 2 * side)
            m.animate(pivot, "rotation", beat, np.stack([0 * turn, 0 * turn, np.sin(turn / 2), np.cos(turn / 2)], axis=1))
