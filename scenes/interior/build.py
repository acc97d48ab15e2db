"""Builds the bundled scene `interior`, a library in the evening, into a folder (default: this one), from the top of the
checkout: `python -m scenes.interior.build [FOLDER]`.

Everything is made from numbers with fixed seeds: textures.py and light.py have the images, looks.py the materials, room.py
the walls and shelves, lamps.py the lights, moving.py what moves; here is what stands in the room. Metres, y up.
"""

import sys
from pathlib import Path

import numpy as np
from scenes.making.shapes import Shape, box, lathe, merged, sheet, tube

from . import light, textures
from .furniture import armchair, candle, cushion, round_table, side_chair, table
from .lamps import DESK, TABLE_LAMPS, lamps
from .looks import LOOKS
from .moving import moving
from .room import chimney, library, shell, windows
from .scene_file import SceneFile
from .shelves import pile


def fireside(m: SceneFile) -> None:
    """Rug, two armchairs, a low table between them."""
    x, z = -0.1, -3.75
    m.add("Fireside/rug", _rug(3.9, 2.9), "rug", (x, 0, z))
    rng = np.random.default_rng(600)
    threads = [
        box(0.05, 0.006, 0.012, s * 1.97 + rng.uniform(-0.01, 0.01), 0.001, w).turned("y", 0)
        for s in (-1, 1)
        for w in np.arange(-1.43, 1.44, 0.026)
    ]
    m.add("Fireside/fringe", merged(threads), "fringe", (x, 0, z))
    chair = {part: m.mesh(f"armchair_{part}", shape) for part, shape in armchair().items()}
    for k, (cx, cz, turn, look) in enumerate(
        ((-1.5, -3.9, 62, "leather"), (1.35, -3.75, -58, "leather"), (-3.75, -1.75, 80, "green_leather"))
    ):
        for part, skin in (("leather", look), ("wood", "mahogany"), ("brass", "brass")):
            m.add(f"Armchairs/Chair{k}/{part}", chair[part], skin, (cx, 0.012 if k < 2 else 0, cz), turn)
    m.add("Fireside/table", round_table(0.48, 0.47), "mahogany", (-0.1, 0.012, -3.6))
    m.add(
        "Fireside/footstool",
        cushion(0.6, 0.24, 0.44, 0.07, 0.03, buttons=(0.16, 0.012)).at(0, 0.12, 0),
        "green_leather",
        (0.75, 0.012, -4.75),
        -25,
    )
    pillow = m.mesh("pillow", cushion(0.42, 0.4, 0.13, 0.06, 0.05).turned("x", -24))
    for k, (px, pz, turn, look) in enumerate(((-1.62, -3.97, 62, "teal_cloth"), (1.49, -3.84, -58, "mustard_cloth"))):
        m.add(f"Armchairs/pillow{k}", pillow, look, (px, 0.49, pz), turn + 14 * (-1) ** k)
    m.add("Fireside/floor_books", pile(611, 6), "books", (-2.15, 0.0, -3.15), 40)
    m.add("Fireside/floor_book", pile(612, 2), "books", (-1.75, 0.012, -2.75), -20)
    tea(m, (-0.1, 0.482, -3.6))
    m.add("Fireside/side_table", round_table(0.27, 0.55), "walnut", (TABLE_LAMPS["Fireside"][0], 0, TABLE_LAMPS["Fireside"][2]))
    m.add("Window/side_table", round_table(0.32, 0.71), "walnut", (TABLE_LAMPS["Window"][0], 0, TABLE_LAMPS["Window"][2]))


def _rug(width: float, depth: float) -> Shape:
    top = box(width, 0.012, depth)
    st = np.stack([top.points[:, 0] / width + 0.5, 0.5 - top.points[:, 2] / depth], axis=-1)
    return Shape(top.points, top.normals, st, top.faces)


def tea(m: SceneFile, place) -> None:
    """Pot, cups, a tray and a pile of books."""
    x, y, z = place
    pot = lathe([(0.04, 0), (0.045, 0.008), (0.075, 0.04), (0.085, 0.075), (0.07, 0.115), (0.045, 0.135),
                (0.045, 0.14), (0.02, 0.155), (0.012, 0.165), (0.016, 0.178), (0, 0.19)], 36, refine=3)  # fmt: skip
    spout = tube([(0.07, 0.05, 0), (0.11, 0.07, 0), (0.13, 0.11, 0), (0.15, 0.135, 0)], 0.011, 10)
    handle = tube([(-0.075, 0.05, 0), (-0.12, 0.06, 0), (-0.135, 0.09, 0), (-0.115, 0.12, 0), (-0.065, 0.115, 0)], 0.007, 8)
    m.add("Tea/pot", merged([pot, spout, handle]), "cobalt", (x + 0.06, y + 0.012, z + 0.02), 35)
    cup = lathe(
        [(0.018, 0.006), (0.022, 0.012), (0.037, 0.035), (0.042, 0.06), (0.0395, 0.06), (0.034, 0.035), (0, 0.02)], 28, refine=2
    )
    saucer = lathe([(0.03, 0), (0.035, 0.003), (0.068, 0.012), (0.066, 0.014), (0, 0.006)], 28)
    cups = m.mesh("teacup", merged([cup, saucer]))
    for k, (dx, dz) in enumerate(((0.22, 0.14), (-0.13, 0.2))):
        m.add(f"Tea/cup{k}", cups, "porcelain", (x + dx, y + (0.012 if k else 0), z + dz))
    m.add(
        "Tea/tray",
        lathe([(0, 0), (0.2, 0), (0.215, 0.008), (0.22, 0.022), (0.214, 0.022), (0.205, 0.01), (0, 0.01)], 48),
        "silver",
        (x, y + 0.001, z + 0.05),
    )
    m.add("Tea/books", pile(610, 3), "books", (x - 0.24, y, z - 0.18), 30)


def desk(m: SceneFile) -> None:
    """The library table with its lamps, books, papers and chairs."""
    x, z = DESK
    m.add("Desk/table", table(1.05, 2.7, 0.78), "mahogany", (x, 0, z))
    m.add("Desk/leather", box(0.8, 0.003, 2.4), "green_leather", (x, 0.779, z))
    chair = {part: m.mesh(f"side_chair_{part}", shape) for part, shape in side_chair().items()}
    for k, (dx, dz, turn) in enumerate(((-0.72, -0.75, 96), (-0.86, 0.15, 62), (0.75, -0.4, -88), (0.78, 0.6, -96))):
        for part, look in (("wood", "mahogany"), ("leather", "leather")):
            m.add(f"Desk/Chair{k}/{part}", chair[part], look, (x + dx, 0, z + dz), turn)
    for k, (dx, dz, count, turn) in enumerate(
        ((-0.2, -0.42, 4, -70), (0.25, 0.5, 5, 110), (-0.3, 1.18, 3, -60), (0.28, -1.1, 3, 100))
    ):
        m.add(f"Desk/books{k}", pile(620 + k, count), "books", (x + dx, 0.783, z + dz), turn)
    opened = m.mesh("open_book", _open_book())
    m.add("Desk/open_book0", opened, "paper", (x - 0.27, 0.783, z + 0.32), -84)
    m.add("Desk/open_book1", opened, "paper", (x - 0.24, 0.783, z - 0.95), -97)
    rng = np.random.default_rng(630)
    sheets = [
        box(0.21, 0.0008, 0.297)
        .turned("y", rng.uniform(-40, 40))
        .at(rng.uniform(-0.08, 0.08), 0.001 * k, rng.uniform(-0.09, 0.09))
        for k in range(6)
    ]
    m.add("Desk/papers", merged(sheets), "paper", (x - 0.25, 0.783, z + 0.78), 10)
    glass = lathe([(0.035, 0), (0.035, 0.05), (0.03, 0.055), (0.012, 0.06), (0, 0.05)], 20)
    m.add("Desk/inkwell", glass, "cobalt", (x - 0.05, 0.783, z + 0.3))
    m.add("Desk/magnifier", merged([lathe([(0.045, 0.004), (0.05, 0.008), (0.045, 0.012), (0.042, 0.008),
                (0.045, 0.004)], 28), tube([(0.05, 0.008, 0), (0.15, 0.008, 0)], 0.007, 8)]), "copper",
                (x - 0.36, 0.785, z + 0.02), 40)  # fmt: skip


def _open_book() -> Shape:
    """Lies open; its leaves arch on both sides of the fold."""
    u, v = np.meshgrid(np.linspace(-1, 1, 25), np.linspace(-1, 1, 3))
    lift = 0.012 + 0.028 * np.abs(u) ** 0.5 * (1 - np.abs(u) ** 2.5)
    points = np.stack([0.165 * u, lift, -0.12 * v], axis=-1)
    return merged([sheet(points, np.stack([u * 0.165, v * 0.12], axis=-1)), box(0.34, 0.01, 0.25)])


def mantelpiece(m: SceneFile) -> None:
    y, z = 1.345, -6.45
    vase = lathe([(0.05, 0), (0.055, 0.01), (0.09, 0.08), (0.1, 0.15), (0.06, 0.23), (0.035, 0.27), (0.05, 0.3),
                (0.045, 0.3), (0.03, 0.27), (0, 0.26)], 36, refine=3)  # fmt: skip
    m.add("Mantel/vase", vase, "celadon", (0.36, y, z))
    m.add("Mantel/books", pile(640, 3), "books", (-0.2, y, z), 8)
    stick = candle(0.12)
    m.add("Desk/candlestick", stick["brass"], "copper", (DESK[0] + 0.3, 0.783, DESK[1] + 0.05))
    m.add("Desk/candle", stick["wax"], "wax", (DESK[0] + 0.3, 0.783, DESK[1] + 0.05))


def plant(m: SceneFile, name: str, place, size: float, seed: int) -> None:
    """A palm in a brass pot: long leaves that arch outwards."""
    rng = np.random.default_rng(seed)
    leaves = []
    for k in range(34):
        rise, reach, turn = rng.uniform(0.35, 1.15), rng.uniform(0.35, 0.75), 137.5 * k + rng.uniform(-15, 15)
        t, side = np.meshgrid(np.linspace(0, 1, 9), np.linspace(-1, 1, 3))
        wide = 0.05 * np.sin(np.pi * np.clip(t, 0.02, 1) ** 0.7) + 0.004
        x = reach * t**1.4
        y = 0.42 + rise * (1.5 * t - 0.85 * t**2.4) + 0.35 * wide * side**2
        leaf = sheet(np.stack([x, y, side * wide], axis=-1)[::-1], np.stack([t, side], axis=-1)[::-1])
        leaves.append(leaf.turned("z", rng.uniform(-4, 4)).turned("y", turn))
    m.add(f"Plants/{name}/leaves", merged(leaves), "leaf", place, 0, size)
    pot = [
        (0, 0),
        (0.17, 0),
        (0.2, 0.05),
        (0.23, 0.2),
        (0.22, 0.34),
        (0.245, 0.4),
        (0.25, 0.42),
        (0.235, 0.42),
        (0.21, 0.36),
        (0, 0.36),
    ]
    m.add(f"Plants/{name}/pot", lathe(pot, 40), "copper", place, 0, size)


def doors(m: SceneFile) -> None:
    """A double door in the wall behind the camera."""
    leaves = [
        box(1.9, 2.75, 0.06, 0, 0, 0.03),
        *(box(0.16, 2.95, 0.1, s * 1.0, 0, 0.05) for s in (-1, 1)),
        box(2.3, 0.22, 0.12, 0, 2.78, 0.06),
    ]
    leaves += [
        cushion(0.66, h, 0.03, 0.012, steps=2).at(s * 0.46, y, 0.06) for s in (-1, 1) for y, h in ((0.2, 0.7), (1.05, 1.5))
    ]
    m.add("Room/doors", merged([*leaves, box(0.03, 2.7, 0.02, 0, 0, 0.065)]), "walnut", (0, 0, 7.5), 180)
    m.add("Room/dado", merged([box(3.7, 1.0, 0.03, s * 3.05, 0, 0.015) for s in (-1, 1)]), "walnut", (0, 0, 7.5), 180)


def hearthside(m: SceneFile) -> None:
    """Tools and a log basket beside the fire."""
    stand = [lathe([(0.11, 0), (0.11, 0.015), (0.03, 0.03), (0.012, 0.05), (0.01, 0.66), (0.03, 0.69), (0, 0.72)], 20)]
    stand += [
        tube([(0.07 * np.cos(a), 0.06, 0.07 * np.sin(a)), (0.06 * np.cos(a), 0.64, 0.06 * np.sin(a))], 0.007, 6)
        for a in (0.3, 2.4, 4.5)
    ]
    stand += [
        lathe([(0.004, 0.64), (0.016, 0.66), (0.012, 0.7), (0, 0.71)], 10).at(0.06 * np.cos(a), 0, 0.06 * np.sin(a))
        for a in (0.3, 2.4, 4.5)
    ]
    m.add("Hearth/tools", merged(stand), "polished_brass", (-0.98, 0.05, -6.25))
    rng = np.random.default_rng(650)
    wood = []
    for k in range(13):
        row, spot = divmod(k, 5)
        log = lathe([(0, -0.2), (0.048, -0.2), (0.048, -0.2), (0.05, 0.2), (0.05, 0.2), (0, 0.2)], 10).turned("z", 90)
        wood.append(log.turned("y", 90 + rng.uniform(-4, 4)).at(0.1 * (spot - 2) + 0.05 * (row % 2), 0.08 + 0.088 * row, 0))
    m.add("Hearth/logs", merged(wood), "bark", (1.12, 0.0, -6.2), 6)
    rack = [
        tube([(s * 0.3, 0.4, z), (s * 0.27, 0.02, z), (-s * 0.27, 0.02, z)], 0.01, 8) for s in (-1, 1) for z in (-0.12, 0.12)
    ]
    m.add("Hearth/rack", merged(rack), "iron", (1.12, 0.012, -6.2), 6)


def build(folder: Path) -> None:
    textures.write_all(folder / "textures")
    light.write_all(folder / "textures")
    m = SceneFile(folder, "interior", LOOKS)
    for part in (shell, windows, chimney, library, fireside, desk, mantelpiece, hearthside, doors, lamps, moving):
        part(m)
    plant(m, "Palm0", (-4.35, 0, 1.35), 1.15, 660)
    plant(m, "Palm1", (3.55, 0, -5.55), 0.95, 661)
    m.environment("Room/probe", "probe")
    m.save()
    unique = sum(len(shape.faces) for shape in m.meshes.values())
    print(f"{m.shapes} shapes, {len(m.meshes)} meshes, {unique} triangles, {m.triangles} placed")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
