"""Builds the bundled scene `ruins`, a roofless abbey church in the last hour of sun, into a folder (default: this one), from
the top of the checkout: `python -m scenes.ruins.build [FOLDER]`.

Everything is made from numbers with fixed seeds: textures.py and sky.py have the images, looks.py the materials, masonry.py
walls, arches and loose bricks, centre.py fountain, columns, lantern and gate, ground.py the floor and what lies on it,
plants.py what grows, moving.py what moves and shines; here are the walls. The nave runs along -z between arcades at x = -5
and 5. Metres, y up.
"""

import sys
from pathlib import Path

import numpy as np
from pxr import Usd
from scenes.making.images import noise
from scenes.making.shapes import Shape, merged, unit
from scenes.making.usd_stage import Stage

from . import textures
from .centre import basin, column, figure
from .ground import fallen, ground, rubble
from .looks import LOOKS
from .masonry import CELL, COURSE, LENGTH, THICK, arch, brick, centres, pierce, solid, tumbled, wall
from .moving import PERIOD, moving
from .plants import plants, tufts
from .sky import write_sky

BAY, SPRING, RADIUS = 3.5, 21 * CELL[1], 1.4  # an arcade's bays; its arches spring 3.09 m high
KINDS = ("brick", "brick_pale", "brick_dark", "brick_moss")


def zones(mask: np.ndarray, seed: int, moss: float = 0.8) -> np.ndarray:
    """Which of KINDS each cell is: moss near the ground, soot below the broken top, patches of repair."""
    x, y = centres(mask)
    field, other = (noise(128, 128, 1.5, seed + k, low=2)[: mask.shape[0], : mask.shape[1]] for k in (0, 1))
    depth = mask.sum(axis=0)[None, :] * CELL[1] - y
    zone = np.where(other > 0.9, 1, 0)
    zone = np.where((field > 1.15) | (depth + 0.5 * other < 0.75), 2, zone)
    zone = np.where(y < moss + 0.45 * field, 3, zone)
    return np.repeat(np.repeat(zone[::2, ::2], 2, axis=0), 2, axis=1)[: mask.shape[0], : mask.shape[1]]


def standing(m: Stage, name: str, mask: np.ndarray, seed: int, moss: float = 0.8) -> None:
    faces, edges = wall(mask, zones(mask, seed, moss), seed)
    for kind, shape in sorted(faces.items()):
        shift = np.array([3 * LENGTH, 10 * COURSE]) * kind * (kind < 3)  # so that patches do not go on with the same bricks
        m.add(f"{name}/{KINDS[kind]}", Shape(shape.points, shape.normals, shape.st + shift, shape.faces), KINDS[kind])
    for kind, shape in sorted(edges.items()):
        m.add_faceted(f"{name}/{KINDS[kind]}_edges", shape, KINDS[kind])
    rng = np.random.default_rng(seed + 7)
    loose, grass, tops = [], [], np.argwhere(mask & ~np.pad(mask, ((0, 1), (0, 0)))[1:])
    for j, i in tops:
        at = np.array([(i + rng.uniform(0.2, 0.8)) * CELL[0], (j + 1) * CELL[1], rng.uniform(-0.22, 0.22)])
        if at[1] < SPRING:
            continue
        if rng.uniform() < 0.55:
            lying = tumbled(brick(rng, 0.015), rng, 0.12 if rng.uniform() < 0.7 else 0.8)
            loose.append(lying.at(*(at + [0, -lying.points[:, 1].min() - 0.008, 0])))
        if rng.uniform() < 0.12:
            grass.append(tufts(2, 0.2, int(rng.integers(1000)), 0.36).at(*(at + [0, -0.03, 0])))
    if loose and grass:
        m.add_faceted(f"{name}/loose", merged(loose), "clay")
        m.add_faceted(f"{name}/grass", merged(grass), "grass")


def ring(m: Stage, name: str, at, radius: float, width: float, depth: float, seed: int, span=(0, 180), skin="brick") -> None:
    """An arch of brick and stone wedges; `at` its springing's middle in the wall's frame."""
    parts = arch(radius, width, depth, seed, span=span)
    for kind, shape in zip(("bricks", "stones"), parts, strict=True):
        if shape is not None:
            m.add_faceted(f"{name}_{kind}", shape, skin if kind == "bricks" else "stone", at)


def right_arcade(m: Stage) -> None:
    """Seven bays, x along +z from the end wall; above them a clerestory that has crumbled towards the entrance."""

    def top(x: np.ndarray) -> np.ndarray:
        return np.interp(
            x, [0, 2, 5, 9, 12, 15, 17, 19, 21, 22.5, 24.5], [6.6, 8.3, 8.6, 8.4, 7.6, 8.0, 7.2, 6.2, 5.9, 4.6, 3.4]
        )

    mask = solid(98, 60, top, 431)
    cx, cy = centres(mask)
    mask &= cy > SPRING
    m.group("RightArcade", (5, 0, -20), -90)
    for k in range(7):
        middle = BAY * (k + 0.5)
        pierce(mask, middle, SPRING, RADIUS)
        ring(
            m,
            f"RightArcade/arch{k}",
            (middle, SPRING, 0),
            RADIUS,
            0.36,
            THICK + 0.1,
            432 + k % 2,
            (0, 180) if k < 6 else (0, 78),
        )
        if k < 6:
            pierce(mask, middle, 39.5 * CELL[1], 0.5, 36 * CELL[1])
            ring(m, f"RightArcade/window{k}", (middle, 39.5 * CELL[1], 0), 0.5, 0.24, THICK + 0.05, 434)
    standing(m, "RightArcade", mask, 440, moss=-9)
    for k in range(8):
        column(m, f"RightArcade/Column{k}", (BAY * k if k else 0.2, 0, 0), 1 + k)


def left_arcade(m: Stage) -> None:
    """Two arches stand in the middle, and the springing of a third; the rest are stumps."""

    def top(x: np.ndarray) -> np.ndarray:
        xs = [0, 2.2, 3.2, 3.9, 9.6, 10.2, 10.8, 12.2, 14, 16, 17.3, 18.2, 18.9, 24.5]
        return np.interp(x, xs, [5.4, 4.9, 3.9, 0, 0, 3.7, 4.9, 5.5, 6.2, 5.7, 5.4, 4.2, 0, 0])

    mask = solid(98, 50, top, 451, ragged=0.35)
    cx, cy = centres(mask)
    mask &= cy > SPRING
    m.group("LeftArcade", (-5, 0, -20), -90)
    for k, span in ((0, (0, 180)), (1, (125, 180)), (2, (0, 52)), (3, (0, 180)), (4, (0, 180)), (5, (138, 180))):
        middle = BAY * (k + 0.5)
        pierce(mask, middle, SPRING, RADIUS)
        ring(m, f"LeftArcade/arch{k}", (middle, SPRING, 0), RADIUS, 0.36, THICK + 0.1, 432 + k % 2, span)
    standing(m, "LeftArcade", mask, 460, moss=-9)
    for k, stands in enumerate((True, True, 0.7, True, True, True, 1.3, 0.35)):
        column(
            m, f"LeftArcade/Column{k}", (BAY * k if k else 0.2, 0, 0), 11 + k, 0.0 if stands is True else stands, stands is True
        )


def end_wall(m: Stage) -> None:
    """From x = -9 to 9 at z = -20, falling to the left; the portal in the middle and a round window above it."""

    def top(x: np.ndarray) -> np.ndarray:
        return np.interp(
            x,
            [0, 2.5, 4, 5.6, 6.8, 7.7, 8.4, 9.6, 11, 14, 15, 16.5, 18],
            [1.3, 1.6, 2.6, 4.1, 5.6, 5.9, 8.2, 9.6, 9.9, 8.9, 7.2, 6.2, 5.6],
        )

    mask = solid(72, 70, top, 471)
    middle, spring, eye = 9.0, 18 * CELL[1], (9.3, 46 * CELL[1])
    pierce(mask, middle, spring, 1.75)
    cx, cy = centres(mask)
    mask &= np.hypot(cx - eye[0], cy - eye[1]) > 1.05 + 0.13
    m.group("EndWall", (-9, 0, -20))
    ring(m, "EndWall/portal", (middle, spring, 0), 1.75, 0.42, THICK + 0.16, 472)
    ring(m, "EndWall/portal_outer", (middle, spring, 0), 2.25, 0.22, THICK + 0.06, 473)
    ring(m, "EndWall/eye", (*eye, 0), 1.05, 0.3, THICK + 0.1, 474)
    eye_low = arch(1.05, 0.3, THICK + 0.1, 475)
    for kind, shape in zip(("bricks", "stones"), eye_low, strict=True):
        m.add_faceted(f"EndWall/eye_low_{kind}", shape.turned("z", 180), "brick" if kind == "bricks" else "stone", (*eye, 0))
    for x in (4.3, 14.2):
        pierce(mask, x, 22 * CELL[1], 0.55, 13 * CELL[1])
        ring(m, f"EndWall/window{int(x)}", (x, 22 * CELL[1], 0), 0.55, 0.26, THICK + 0.06, 476)
    standing(m, "EndWall", mask, 480)


def outer_walls(m: Stage) -> None:
    m.group("RightWall", (8.6, 0, -20), -90)
    mask = solid(108, 44, lambda x: np.interp(x, [0, 6, 12, 17, 20, 22, 24, 27], [5.8, 5.4, 5.6, 5.2, 4.2, 4.4, 2.6, 1.4]), 491)
    for k in range(6):
        x = BAY * (k + 0.5)
        pierce(mask, x, 22 * CELL[1], 0.625, 11 * CELL[1])
        ring(m, f"RightWall/window{k}", (x, 22 * CELL[1], 0), 0.625, 0.28, THICK + 0.06, 492 + k % 2)
    standing(m, "RightWall", mask, 500, moss=1.0)
    m.group("LeftWall", (-8.6, 0, 8), 90)
    mask = solid(
        112, 22, lambda x: np.interp(x, [0, 4, 7, 12, 16, 18, 24, 28], [0.7, 1.6, 0.9, 2.1, 1.2, 2.3, 1.1, 1.5]), 495, 0.6
    )
    standing(m, "LeftWall", mask, 505, moss=0.9)


def painted(m: Stage) -> None:
    """Plaster that still holds, a finger in front of the brick."""
    spots = (
        ("Right0", (8.6, 0, -6.05), -90, (2.2, 3.0), 2.3), ("Right1", (8.6, 0, -9.5), -90, (2.1, 2.5), 2.1),
        ("Right2", (8.6, 0, -2.45), -90, (1.9, 2.2), 2.0), ("End0", (5.9, 0, -20), 0, (3.0, 3.4), 5.4),
        ("Arcade0", (5, 0, -9.5), -90, (2.0, 1.7), 5.9),
    )  # fmt: skip
    for name, place, turn, (width, tall), y in spots:
        m.group(f"Fresco/{name}", place, turn)
        corners = np.array([[(s * width / 2, y + t * tall / 2, THICK / 2 + 0.075) for s in (-1, 1)] for t in (-1, 1)])
        st = np.array([[(0, 0), (1, 0)], [(0, 1), (1, 1)]], dtype=float)
        normals = np.tile(unit(np.array([0.0, 0, 1])), (4, 1))
        shape = Shape(corners.reshape(-1, 3), normals, st.reshape(-1, 2), np.array([[0, 1, 3], [0, 3, 2]]))
        m.add(f"Fresco/{name}/plaster", shape, "fresco")


def build(folder: Path) -> None:
    textures.write_all(folder / "textures")
    write_sky(folder / "textures")
    ruins = Stage(folder, "ruins", LOOKS, seconds=PERIOD)
    for part in (ground, right_arcade, left_arcade, end_wall, outer_walls, rubble, fallen, painted, basin, figure, plants):
        part(ruins)
    with Usd.EditContext(ruins.stage, ruins.geometry):  # four seconds of time samples: a fourth of their size as text
        moving(ruins)
    ruins.save()
    print(f"{ruins.objects} meshes, {ruins.triangles} triangles")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
