"""Builds the bundled scene `forest`, an old wood on an early autumn morning, into a folder (default: this one), from the top
of the checkout: `python -m scenes.forest.build [FOLDER]`.

Everything is made from numbers with fixed seeds: textures.py and sky.py have the images, looks.py the materials, trees.py and
undergrowth.py the prototypes, terrain.py and ground.py the land, wind.py and moving.py what moves; here is what stands where.
"""

import sys
from pathlib import Path

import numpy as np
from scenes.making.shapes import merged
from scenes.making.usd_stage import Stage

from . import textures
from .ground import backdrop, ground
from .instancing import Member, begin_prototypes, instance, prototype, recoloured, scatter, set_ior, sway
from .looks import IOR, LOOKS, MIST
from .moving import LANTERN, moving, near_path
from .sky import TO_SUN, write_sky
from .terrain import GLADE, SUNWARDS, height, off_path
from .trees import Tree, cluster, crown, tree
from .undergrowth import fern, grass, leaf_litter, log, mushroom, stone
from .wind import CYCLE_S

NEAR, FAR = 21.0, 43.0  # radii: where trees are whole, where single trees end
SPECIES = {  # name: (trunks, material of leaves, prototypes of leaf clusters)
    "Oak": (("OakA", "OakB", "OakC"), ("OakLeavesA", "OakLeavesB")),
    "Birch": (("BirchA", "BirchB"), ("BirchLeavesA", "BirchLeavesB")),
    "Golden": (("BirchA", "BirchB"), ("GoldenLeavesA", "GoldenLeavesB")),
}
TRUNKS = {
    "OakA": dict(seed=100, height=12.5, radius=0.30, branches=11, lowest=0.33, spread=3.4, bend=0.7, flare=0.75),
    "OakB": dict(seed=110, height=14.0, radius=0.37, branches=12, lowest=0.36, spread=3.7, bend=0.5, flare=0.9),
    "OakC": dict(seed=120, height=11.0, radius=0.24, branches=10, lowest=0.38, spread=2.9, bend=1.1, flare=0.6),
    "BirchA": dict(seed=130, height=12.5, radius=0.15, branches=12, lowest=0.40, spread=2.1, bend=0.8, flare=0.35),
    "BirchB": dict(seed=140, height=11.0, radius=0.12, branches=11, lowest=0.36, spread=1.9, bend=1.3, flare=0.3),
    "OldOak": dict(seed=150, height=11.5, radius=0.72, branches=13, lowest=0.24, spread=5.2, bend=0.9, flare=1.0, sides=26,
                   rings=30, twigs=3),
}  # fmt: skip
OLD_OAK = 5.0, -2.4
LIT = np.array([(0.4, 5.2, 3.7), (2.4, -2.6, 3.6), (0.2, 13.6, 2.4), (-1.5, -11.0, 3.2)])  # x, z, half width of a beam of sun


def tree_prototypes(m: Stage, images: Path) -> dict[str, Tree]:
    trees = {name: tree(**values) for name, values in TRUNKS.items()}
    for name, one in trees.items():
        kind = "birch" if name.startswith("Birch") else "oak"
        path = prototype(m, name)
        m.add(f"{path}/root", one.root, f"{kind}_root")
        m.add(f"{path}/bark", one.bark, f"{kind}_bark")
    for k, letter in enumerate("AB"):
        for name, material, size, radius in (("Oak", "oak_leaves", 0.72, 1.3), ("Birch", "birch_leaves", 0.6, 1.05)):
            cards = cluster(200 + 7 * k + len(name), 24, radius, 0.58, size, 0.15, 72, textures.solid_spots(images, material))
            path = prototype(m, f"{name}Leaves{letter}")
            m.add(f"{path}/cards", cards.shape, material)
            sway(m, f"{path}/cards", cards.shape.points, cards.reach, 210 + k)
        recoloured(m, f"GoldenLeaves{letter}", f"BirchLeaves{letter}", {"cards": "golden_leaves"})
    for kind, trunk, leaf, size in (("Oak", "OakB", "oak_leaves", 1.15), ("Birch", "BirchA", "birch_leaves", 1.0)):
        tips = trees[trunk].tips[::2]
        crown_shape = crown(230 + len(kind), tips, 40, 0.27 * size, 1.45)
        low = tree(**(TRUNKS[trunk] | dict(sides=8, rings=9, branches=6, twigs=0)))
        for number in MIST:
            path = prototype(m, f"Far{kind}{number}")
            m.add(f"{path}/trunk", merged([low.root, low.bark]), f"{kind.lower()}_bark_{number}")
            m.add(f"{path}/leaves", crown_shape, f"{leaf}_{number}")
        bush = crown(240, np.array([(0, 0.45, 0), (0.7, 0.3, 0.5), (-0.5, 0.25, 0.4)]), 50, 0.2 * size, 0.75)
        for number in MIST:
            m.add(f"{prototype(m, f'FarBush{kind}{number}')}/leaves", bush, f"{leaf}_{number}")
    for number in MIST:
        recoloured(m, f"FarGolden{number}", f"FarBirch{number}", {"leaves": f"golden_leaves_{number}"})
    return trees


def spots(count: int, inner: float, outer: float, apart: float, seed: int, free) -> np.ndarray:
    """Places [n, 2] (x, z) in a ring, at least `apart` metres from each other, where free(x, z)."""
    rng, found = np.random.default_rng(seed), np.zeros((0, 2))
    for _ in range(count * 60):
        r, a = np.sqrt(rng.uniform(inner**2, outer**2)), rng.uniform(0, 2 * np.pi)
        place = np.array([r * np.sin(a), r * np.cos(a)])
        if free(*place) and (not len(found) or np.hypot(*(found - place).T).min() > apart):
            found = np.concatenate([found, place[None]])
        if len(found) == count:
            break
    return found


def shades(x: float, z: float) -> bool:
    """Whether a tree's crown there would stand between the sun and a place that is to be lit."""
    beams = np.array([x, z]) - LIT[:, :2]
    ahead, aside = beams @ SUNWARDS[[0, 2]], np.abs(beams @ np.array([-SUNWARDS[2], SUNWARDS[0]]))
    return bool(np.any((ahead > 1.5) & (ahead < 25) & (aside < LIT[:, 2])))


def _free_for_trees(x: float, z: float) -> bool:
    glade = np.hypot(*(np.array([x, z]) - GLADE[0])) < GLADE[1]
    oak = np.hypot(x - OLD_OAK[0], z - OLD_OAK[1]) < 5.0
    post = np.hypot(x - LANTERN[0], z - LANTERN[1]) < 2.2
    return not (glade or oak or post or shades(x, z)) and off_path(x, z) > 2.1


def stand(
    m: Stage, name: str, species: str, trunk: str, tips: np.ndarray, place, turn: float, size: float, hung: int, seed: int
):
    """A whole tree: its trunk, and leaf clusters on `hung` of its tips."""
    rng = np.random.default_rng(seed)
    m.group(f"Trees/{name}", place)
    instance(m, f"Trees/{name}/trunk", Member(trunk, (0, 0, 0), turn, size=size))
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = size * tips @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    chosen = turned[rng.permutation(len(turned))[:hung]]
    clusters = SPECIES[species][1]
    members = [
        Member(clusters[int(rng.integers(2))], tuple(tip + rng.normal(0, 0.08, 3)), rng.uniform(0, 360),
               tuple(rng.normal(0, 9, 2)), rng.uniform(0.75, 1.15))
        for tip in chosen
    ]  # fmt: skip
    scatter(m, f"Trees/{name}/leaves", members)


def trees_around(m: Stage, trees: dict[str, Tree]) -> np.ndarray:
    """Trees that stand near, and an old oak; returns their places."""
    rng = np.random.default_rng(300)
    x, z = OLD_OAK
    stand(m, "OldOak", "Oak", "OldOak", trees["OldOak"].tips, (x, float(height(x, z)) - 0.05, z), 40, 1.0, 40, 301)
    places = spots(46, 0, NEAR, 3.3, 302, _free_for_trees)
    for k, (x, z) in enumerate(places):
        species = ("Oak", "Birch", "Oak", "Golden", "Oak", "Birch", "Oak")[int(rng.integers(7))]
        trunk = SPECIES[species][0][int(rng.integers(len(SPECIES[species][0])))]
        place = (float(x), float(height(x, z)) - 0.05, float(z))
        stand(m, f"{species}{k:02d}", species, trunk, trees[trunk].tips, place, float(rng.uniform(0, 360)),
              float(rng.uniform(0.85, 1.2)), 15, 310 + k)  # fmt: skip
    return np.concatenate([places, [OLD_OAK]])


def far_trees(m: Stage) -> None:
    rng, members = np.random.default_rng(400), {"Middle": [], "Distant": []}
    for x, z in spots(105, NEAR + 1.5, FAR, 3.1, 401, lambda x, z: (off_path(x, z) > 2.4 or z < -27) and not shades(x, z)):
        distance, sunny = np.hypot(x, z), np.array([x, z]) @ SUNWARDS[[0, 2]] / np.hypot(x, z) > 0.2
        ring = "Middle" if distance < 31 else "Distant"
        kind = ("Oak", "Birch", "Oak", "Golden", "Oak")[int(rng.integers(5))]
        number = (1 if ring == "Middle" else 3) + int(sunny)
        place = (x, float(height(x, z)) - 0.1, z)
        members[ring].append(Member(f"Far{kind}{number}", place, rng.uniform(0, 360), (0, 0), rng.uniform(0.85, 1.25)))
    bushes = []
    for x, z in spots(100, NEAR + 0.5, FAR - 4, 2.4, 402, lambda x, z: off_path(x, z) > 1.6):
        number = (1 if np.hypot(x, z) < 29 else 3) + int(np.array([x, z]) @ SUNWARDS[[0, 2]] / np.hypot(x, z) > 0.2)
        kind = ("Oak", "Birch")[int(rng.integers(2))]
        place = (x, float(height(x, z)) - 0.1, z)
        bushes.append(Member(f"FarBush{kind}{number}", place, rng.uniform(0, 360), (0, 0), rng.uniform(0.8, 1.7)))
    for ring, some in {**members, "Bushes": bushes}.items():
        scatter(m, f"FarTrees/{ring}", some)


def plants(m: Stage, trees: np.ndarray) -> None:
    for k in range(2):
        for name, cards, material in (
            (f"Fern{k}", fern(500 + k, 13 - 2 * k, 0.95 - 0.15 * k), "fern"),
            (f"Grass{k}", grass(510 + k, 7, 0.40, 0.27), "grass"),
        ):
            path = prototype(m, name)
            m.add(f"{path}/cards", cards.shape, material)
            sway(m, f"{path}/cards", cards.shape.points, cards.reach, 520 + k)
        m.add(f"{prototype(m, f'Litter{k}')}/leaves", leaf_litter(530 + k, 60 - 26 * k, 1.1 + 0.2 * k), "fallen_leaves")
    rng = np.random.default_rng(540)

    def off_trees(x, z):
        return np.hypot(*(trees - [x, z]).T).min()

    def strewn(path, names, places, low, high, lean, sink):
        members = [
            Member(names[int(rng.integers(len(names)))], (x, float(height(x, z)) + sink, z), rng.uniform(0, 360),
                   tuple(rng.normal(0, lean, 2)), rng.uniform(low, high))
            for x, z in places
        ]  # fmt: skip
        scatter(m, path, members)

    def shade(x, z):
        return off_path(x, z) > 1.5 and off_trees(x, z) > 0.7 and np.hypot(*(np.array([x, z]) - GLADE[0])) > 3.0

    front = [
        near_path(z, off)[::2]
        for z, off in ((11.3, 1.75), (10.2, 2.2), (9.0, -1.75), (7.6, 2.0), (6.2, 1.8), (4.0, -1.7), (2.6, 2.3))
    ] + [(-3.9, 1.6), (-5.9, 0.6)]
    strewn("Ferns", ["Fern0", "Fern1"], [*front, *spots(150, 0, 22, 0.75, 541, shade)], 0.6, 1.25, 4, 0.0)
    verge = [near_path(z, side * rng.uniform(1.0, 1.9))[::2] for z in np.arange(-21, 17, 0.75) for side in (-1, 1)]
    meadow = spots(70, 0, 6.5, 0.6, 543, lambda x, z: off_path(x + GLADE[0][0], z + GLADE[0][1]) > 1.2) + GLADE[0]
    strewn("Grass", ["Grass0", "Grass1"], [*verge, *meadow, *spots(40, 0, 21, 1.0, 542, shade)], 0.6, 1.3, 5, 0.0)
    trodden = [near_path(z, rng.normal(0, 0.45))[::2] for z in np.arange(-15, 14.5, 1.15)]
    strewn("PathLeaves", ["Litter1"], trodden, 0.85, 1.25, 1, 0.015)
    strewn("Litter", ["Litter0", "Litter1"], spots(90, 0, 18, 1.1, 544, lambda x, z: off_trees(x, z) > 0.8), 0.8, 1.3, 1, 0.0)


def stones_and_wood(m: Stage, trees: np.ndarray) -> None:
    for k, size in enumerate(((0.5, 0.34, 0.42), (0.42, 0.4, 0.36), (0.62, 0.3, 0.46))):
        m.add(f"{prototype(m, f'Stone{k}')}/rock", stone(600 + k, size), "rock")
    rng = np.random.default_rng(610)
    free = spots(26, 0, 20, 1.8, 611, lambda x, z: off_path(x, z) > 1.6 and np.hypot(*(trees - [x, z]).T).min() > 1.0)
    kerb = [
        near_path(z, side)[::2] for z, side in ((10.4, 1.35), (9.8, 1.6), (7.3, -1.5), (3.0, 1.7), (1.2, -1.55), (-5.2, 1.5))
    ]
    members = []
    for k, (x, z) in enumerate([*kerb, *free]):
        size = rng.uniform(0.35, 0.75) if k < len(kerb) else rng.uniform(0.4, 1.5)
        members.append(Member(f"Stone{k % 3}", (x, float(height(x, z)) - 0.05 * size, z), rng.uniform(0, 360), (0, 0), size))
    scatter(m, "Stones", members)
    long, path = 4.6, prototype(m, "Log")
    for name, shape, material in zip(
        ("bark", "moss", "ends"), log(620, long, 0.27), ("oak_bark", "rock", "end_grain"), strict=True
    ):
        m.add(f"{path}/{name}", shape, material)
    for k, (x, z, turn, size) in enumerate(((-3.5, 6.2, 24, 1.0), (8.6, -9.0, -50, 1.15), (-9.5, -13, 70, 0.9))):
        dx, dz = np.cos(np.radians(turn)), -np.sin(np.radians(turn))
        rise = float(height(x + dx * long / 2, z + dz * long / 2) - height(x - dx * long / 2, z - dz * long / 2))
        y = float(height(x, z)) - 0.06
        tilt = np.degrees(np.arctan2(rise, long))
        m.group(f"Logs/Log{k}", (x, y, z), turn).AddRotateZOp().Set(float(tilt))
        instance(m, f"Logs/Log{k}/wood", Member("Log", (0, 0, 0), 180.0 * (k % 2), size=size))
    for name, tall, wide, flat, material in (("Fly", 0.15, 0.075, 0.55, "cap"), ("Bolete", 0.11, 0.06, 0.45, "brown_cap")):
        caps, stems = [], []
        for _ in range(6):
            size, x, z = rng.uniform(0.5, 1.3), *rng.normal(0, 0.2, 2)
            for parts, shape in zip((caps, stems), mushroom(tall * size, wide * size, flat), strict=True):
                parts.append(shape.turned("x", 8 * np.sin(9 * x)).turned("z", 8 * np.cos(9 * z)).at(x, 0.0, z))
        path = prototype(m, name)
        m.add(f"{path}/caps", merged(caps), material)
        m.add(f"{path}/stems", merged(stems), "stem")
    groups = (
        (2.95, 9.0, 0),
        (3.7, -0.9, 0),
        (-2.1, 5.2, 1),
        (6.5, -1.2, 1),
        (-6.5, 3.0, 0),
        (-1.9, -8.2, 0),
        (2.9, 3.0, 1),
        (-3.2, 2.3, 0),
    )
    members = [Member(("Fly", "Bolete")[k], (x, float(height(x, z)) + 0.005, z), 77.0 * x, (0, 0), 1.0) for x, z, k in groups]
    scatter(m, "Mushrooms", members)


def saplings(m: Stage) -> None:
    """Young trees and bushes at eye height: leaf clusters low over the floor."""
    rng, members = np.random.default_rng(700), []
    for x, z in spots(34, 6, 21, 2.4, 701, lambda x, z: off_path(x, z) > 2.6 and _free_for_trees(x, z)):
        kind = ("BirchLeaves", "OakLeaves", "GoldenLeaves")[int(rng.integers(3))]
        for level in range(2):
            place = (x + rng.normal(0, 0.3), float(height(x, z)) + 0.45 + 0.75 * level, z + rng.normal(0, 0.3))
            size = rng.uniform(0.6, 0.85) * (1 - 0.3 * level)
            members.append(Member(kind + "AB"[level], place, rng.uniform(0, 360), (0, 0), size))
    scatter(m, "Bushes", members)


def build(folder: Path) -> None:
    textures.write_all(folder / "textures")
    write_sky(folder / "textures")
    forest = Stage(folder, "forest", LOOKS, seconds=CYCLE_S)
    for material, ior in IOR.items():
        set_ior(forest, material, ior)
    begin_prototypes(forest)
    ground(forest)
    trees = trees_around(forest, tree_prototypes(forest, folder / "textures"))
    far_trees(forest)
    backdrop(forest)
    plants(forest, trees)
    stones_and_wood(forest, trees)
    saplings(forest)
    moving(forest)
    forest.light(TO_SUN, 14, (1.0, 0.79, 0.52), sky=1.4)
    forest.save()
    print(f"{forest.objects} meshes, {forest.triangles} triangles")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
