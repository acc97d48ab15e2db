"""What stands on the square: lamps, benches, a kiosk, an advertising column, the tram's stop."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.shapes import Shape, ball, bow, box, lathe, merged, quad, sheet, tube

from .station import face_normals


def lamp(m: GltfStage, name: str, place) -> None:
    group = m.group(name, place)
    profile = [
        (0.2, 0),
        (0.2, 0.1),
        (0.15, 0.14),
        (0.13, 0.5),
        (0.09, 0.62),
        (0.06, 0.8),
        (0.05, 3.4),
        (0.075, 3.45),
        (0.04, 3.55),
        (0.03, 4.1),
        (0.0, 4.2),
    ]
    arms = [tube(bow((0, 3.55, 0), (s * 0.62, 3.5, 0), (0, 0.2, 0), 9), 0.022, 6) for s in (-1, 1)]
    caps = [lathe([(0.2, 0), (0.1, 0.1), (0.03, 0.14), (0, 0.2)], 12).at(s * 0.62, 3.42, 0) for s in (-1, 1)]
    m.add(f"{name}/post", merged([lathe(profile, 14), *arms, *caps]), "iron", parent=group)
    m.add(f"{name}/globes", merged([ball(0.17, 12, 8).at(s * 0.62, 3.28, 0) for s in (-1, 1)]), "lamp", parent=group)


def bench(m: GltfStage, name: str, place, turn: float) -> None:
    group = m.group(name, place, turn)
    slats = [box(1.8, 0.035, 0.075, 0, 0.44, -0.16 + 0.095 * k) for k in range(5)]
    slats += [box(1.8, 0.075, 0.03, 0, 0.56 + 0.105 * k, -0.24 - 0.028 * k) for k in range(4)]
    m.add(f"{name}/slats", merged(slats), "oak", parent=group)
    irons = []
    for x in (-0.78, 0.78):
        irons += [
            tube([(x, 0, 0.24), (x, 0.3, 0.2), (x, 0.43, 0.22), (x, 0.43, -0.2), (x, 0.6, -0.25), (x, 0.95, -0.34)], 0.02, 6)
        ]
        irons += [
            tube([(x, 0, -0.34), (x, 0.25, -0.22), (x, 0.43, -0.18)], 0.02, 6),
            tube([(x, 0.43, 0.22), (x, 0.66, 0.2), (x, 0.68, -0.27)], 0.017, 6),
        ]
    m.add(f"{name}/frame", merged(irons), "iron", parent=group)


def kiosk(m: GltfStage, place, turn: float) -> None:
    """A newspaper kiosk with eight sides, an awning and a small dome."""
    group = m.group("Kiosk", place, turn)

    def add(name: str, shapes: list[Shape], material: str) -> None:
        m.add(f"Kiosk/{name}", merged(shapes), material, parent=group)

    def prism(profile: list) -> Shape:
        return face_normals(lathe(profile, 8).turned("y", 22.5))

    add(
        "body",
        [
            prism([(1.32, 0), (1.32, 0.12), (1.25, 0.14), (1.25, 0.95), (1.3, 0.97), (1.3, 1.03), (1.2, 1.03)]),
            prism([(1.2, 2.25), (1.34, 2.28), (1.36, 2.5), (1.5, 2.56), (1.52, 2.66), (1.3, 2.7)]),
        ],
        "green_paint",
    )
    corners = [(1.2 * np.sin(a), 1.2 * np.cos(a)) for a in np.radians(22.5 + 45 * np.arange(8))]
    add("posts", [tube([(x, 1.0, z), (x, 2.3, z)], 0.05, 6) for x, z in corners], "green_paint")
    add(
        "dome",
        [
            lathe(
                [
                    (1.36, 2.68),
                    (1.3, 2.8),
                    (1.05, 3.12),
                    (0.62, 3.38),
                    (0.28, 3.5),
                    (0.28, 3.5),
                    (0.24, 3.72),
                    (0.1, 3.8),
                    (0.05, 4.1),
                    (0, 4.2),
                ],
                24,
            )
        ],
        "verdigris",
    )
    add("sign", [prism([(1.375, 2.34), (1.375, 2.36)])], "brass")
    panes, lit = [], []
    for k, ((x0, z0), (x1, z1)) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        pane = quad(
            (x0 * 0.985, 1.03, z0 * 0.985), (x1 * 0.985 - x0 * 0.985, 0, z1 * 0.985 - z0 * 0.985), (0, 1.22, 0), st=(0.5, 1)
        )
        (lit if k in (7, 0, 6) else panes).append(pane)
    add("shelves", lit, "shop")
    add("panes", panes, "glass")
    t, x = np.meshgrid(np.linspace(0, 1, 6), np.linspace(-1.25, 1.25, 21), indexing="ij")
    cloth = np.stack([x, 2.42 - 0.5 * t - 0.05 * np.sin(np.pi * t), 1.15 + 0.95 * t], axis=-1)
    edge = np.stack([x[:3], 1.92 - 0.2 * t[:3] * 2.5 * (0.6 + 0.4 * np.abs(np.sin(x[:3] * 7.5))), 2.1 + 0.03 * t[:3]], axis=-1)
    add(
        "awning",
        [sheet(cloth[::-1], np.stack([t, x], axis=-1)[::-1]), sheet(edge[::-1], np.stack([1 + t[:3], x[:3]], axis=-1)[::-1])],
        "awning",
    )
    rng = np.random.default_rng(80)
    add(
        "counter",
        [
            box(2.1, 0.05, 0.45, 0, 0.92, 1.42),
            box(2.0, 0.06, 0.5, 0, 0.35, 1.5),
            *(box(0.05, 0.92, 0.4, x, 0, 1.45) for x in (-1, 1)),
        ],
        "oak",
    )
    papers = [
        box(0.24, 0.03 + 0.09 * rng.uniform(), 0.32, -0.85 + 0.29 * k, y, 1.46).turned("y", 0)
        for k in range(7)
        for y in (0.97, 0.41)
    ]
    add("papers", papers, "paper")
    covers = [quad((-1.0 + 0.27 * k, 0.5, 1.69), (0.22, 0, 0), (0, 0.3, -0.06), st=(0.25, 1)) for k in range(8)]
    add("magazines", [Shape(c.points, c.normals, c.st + [0.25 * (k % 4), 0], c.faces) for k, c in enumerate(covers)], "posters")


def column(m: GltfStage, place) -> None:
    """An advertising column."""
    group = m.group("Column", place)
    m.add(
        "Column/base",
        lathe(
            [
                (0.72, 0),
                (0.72, 0.18),
                (0.66, 0.22),
                (0.64, 0.42),
                (0.6, 0.45),
                (0.6, 0.45),
                (0.6, 3.0),
                (0.72, 3.06),
                (0.74, 3.2),
                (0.6, 3.26),
            ],
            28,
        ),
        "green_paint",
        parent=group,
    )
    m.add(
        "Column/roof",
        lathe([(0.74, 3.2), (0.7, 3.3), (0.4, 3.55), (0.12, 3.66), (0.06, 3.95), (0, 4.0)], 28),
        "verdigris",
        parent=group,
    )
    a, y = np.meshgrid(np.linspace(0, 2 * np.pi, 33), (0.75, 2.75))
    around = np.stack([0.606 * np.sin(a), y, 0.606 * np.cos(a)], axis=-1)
    m.add("Column/posters", sheet(around, np.stack([a / np.pi, (y - 0.75) / 2], axis=-1)), "posters", parent=group)


def stop(m: GltfStage, place) -> None:
    """The tram stop: a glass shelter, a timetable and the sign."""
    group = m.group("Stop", place)
    frame = [tube([(0.5, 0, z), (0.5, 2.45, z)], 0.04, 6) for z in (-2, 0, 2)] + [
        tube([(0.5, y, -2), (0.5, y, 2)], 0.03, 6) for y in (0.3, 2.2)
    ]
    frame += [box(1.7, 0.08, 4.6, -0.1, 2.45, 0), tube([(-1.9, 0, 3.4), (-1.9, 3.4, 3.4)], 0.04, 8)]
    m.add("Stop/frame", merged(frame), "iron", parent=group)
    m.add("Stop/bench", box(0.4, 0.06, 3.2, 0.2, 0.45, 0), "oak", parent=group)
    m.add("Stop/legs", merged([box(0.3, 0.45, 0.06, 0.2, 0, z) for z in (-1.2, 1.2)]), "steel", parent=group)
    plate = quad((-2.35, 2.55, 3.4), (0.9, 0, 0), (0, 0.9, 0), st=(1, 1))
    m.add("Stop/sign", merged([plate.at(0, 0, 0.045), plate.turned("y", 180).at(-3.8, 0, 6.755)]), "stop", parent=group)
    m.add("Stop/sign_edge", box(0.94, 0.94, 0.07, -1.9, 2.53, 3.4), "iron", parent=group)
    ad = quad((0.46, 0.35, -2.0 + 0.1), (0, 0, 1.2), (0, 1.8, 0), st=(0.25, 1))
    m.add("Stop/poster", Shape(ad.points, ad.normals, ad.st + [0.25, 0], ad.faces), "posters", parent=group)
