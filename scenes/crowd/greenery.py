"""Trees along the square, and clipped ones in tubs, whose crowns move in the wind."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.shapes import Shape, box, foliage, merged, tube


def tree(m: GltfStage, name: str, place, size: float, seed: int) -> None:
    """A street tree: a trunk with boughs, and a crown of leaf sprays."""
    rng = np.random.default_rng(seed)
    group = m.group(name, place, float(rng.uniform(0, 360)), size)
    trunk = tube([(0, -0.1, 0), (0.03, 1.2, 0.02), (-0.02, 2.6, 0), (0.05, 4.2, 0.03), (0, 6.0, 0)], 0.13, 9)
    thin = 1 - 0.6 * np.clip(trunk.points[:, 1:2] / 6, 0, 1)
    trunk = Shape(trunk.points * np.concatenate([thin, np.ones_like(thin), thin], axis=1), trunk.normals, trunk.st, trunk.faces)
    boughs = []
    for k in range(9):
        a, y = 2.4 * k, 2.5 + 0.35 * k
        end = np.array([1.5 * np.sin(a), y + 1.3, 1.5 * np.cos(a)]) * [1 - 0.06 * k, 1, 1 - 0.06 * k]
        boughs.append(tube([(0, y, 0), (0.45 * end[0], y + 0.5, 0.45 * end[2]), tuple(end)], 0.045, 5))
    m.add(f"{name}/trunk", merged([trunk, *boughs]), "bark", parent=group)
    crown = [
        foliage(74, 1.45, 1.25, 0.95, 1000 + seed % 2 + 10 * k).scaled(1, 1, 1).at(dx, y, dz)
        for k, (dx, y, dz) in enumerate(((0, 4.5, 0), (0.85, 3.7, 0.5), (-0.8, 3.8, 0.35), (0.1, 3.6, -0.9), (0, 5.4, 0.1)))
    ]
    crown.append(foliage(46, 1.6, -0.7, 0.9, 1000 + seed % 2 + 77).at(0, 4.0, 0))
    m.add(f"{name}/leaves", merged(crown), "leaves", parent=group)


def tub(m: GltfStage, name: str, place, seed: int) -> None:
    """A clipped bay tree in a wooden tub."""
    group = m.group(name, place, 45.0 * (seed % 2))
    sides = [box(0.66, 0.09, 0.66, 0, 0.06 + 0.115 * k, 0) for k in range(5)]
    m.add(
        f"{name}/tub",
        merged([*sides, *(box(0.09, 0.7, 0.09, x, 0, z) for x in (-0.31, 0.31) for z in (-0.31, 0.31))]),
        "green_paint",
        parent=group,
    )
    m.add(f"{name}/earth", box(0.6, 0.02, 0.6, 0, 0.6, 0), "earth", parent=group)
    m.add(f"{name}/trunk", tube([(0, 0.6, 0), (0.02, 1.0, 0.01), (0, 1.5, 0)], 0.035, 6), "bark", parent=group)
    pivot = m.group(f"{name}/Crown", parent=group)
    ballish = merged(
        [
            foliage(60, 0.55, 0.62, 0.34, 300 + seed % 2).at(0, 1.75, 0),
            foliage(34, 0.55, -0.42, 0.34, 310 + seed % 2).at(0, 1.78, 0),
        ]
    )
    m.add(f"{name}/leaves", ballish, "leaves", parent=pivot)
    _sway(m, pivot, 0.9, seed)


def _sway(m: GltfStage, node: int, degrees: float, seed: int) -> None:
    """A crown in the wind, of period 4 s."""
    times = np.linspace(0, 8, 49)
    a = np.radians(degrees) / 2 * np.sin(2 * np.pi * times / 4 + seed)
    b = np.radians(degrees) / 2 * np.sin(2 * np.pi * times / 2 + 2.2 * seed) * 0.6
    m.animate(node, "rotation", times, np.stack([a, 0 * a, b, np.sqrt(1 - a * a - b * b)], axis=1))
