"""Broken brick walls, arches of wedges, loose bricks, columns. Local frames: x along the wall, y up, the front towards +z."""

from collections.abc import Callable, Sequence

import numpy as np
from scenes.making.shapes import Shape, lathe, merged, unit

from .textures import WALL

LENGTH, COURSE = WALL / 10, WALL / 34
CELL = np.array([LENGTH, 2 * COURSE])  # what a wall breaks into
BLOCK = 4  # cells along each side of the largest faces
THICK = 0.62


def flat(corners: Sequence, st: Sequence) -> Shape:
    """A planar quad from its corners, counter-clockwise from outside."""
    points = np.array(corners, dtype=float)
    normal = unit(np.cross(points[2] - points[0], points[3] - points[1]))
    return Shape(points, np.tile(normal, (4, 1)), np.array(st, dtype=float), np.array([[0, 1, 2], [0, 2, 3]]))


def welded(shape: Shape) -> Shape:
    """Vertices that are equal in all become one."""
    rows = np.concatenate([shape.points, shape.normals, shape.st], axis=1).round(5)
    _, first, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return Shape(shape.points[first], shape.normals[first], shape.st[first], index.reshape(-1)[shape.faces])


def solid(columns: int, rows: int, top: Callable[[np.ndarray], np.ndarray], seed: int, ragged: float = 0.45) -> np.ndarray:
    """[rows, columns] cells of a wall that has crumbled in steps about the height top(x), in metres, give or take `ragged`."""
    rng = np.random.default_rng(seed)
    x = (np.arange(columns) + 0.5) * CELL[0]
    walk, at = np.zeros(columns), 0
    while at < columns:  # steps of one to four bricks
        run = int(rng.choice([1, 1, 2, 2, 3, 4]))
        walk[at:] = 0.72 * walk[at - 1] + rng.normal(0, 0.42) if at else 0
        at += run
    height = top(x) + ragged * walk
    return (np.arange(rows) + 0.5)[:, None] * CELL[1] < height[None, :]


def centres(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[0 : mask.shape[0], 0 : mask.shape[1]] + 0.5
    return x * CELL[0], y * CELL[1]


def pierce(mask: np.ndarray, x: float, spring: float, radius: float, sill: float = -1.0) -> None:
    """Takes the cells of a round-arched opening out of a wall; its ring of wedges covers the steps."""
    cx, cy = centres(mask)
    inside = np.hypot(cx - x, cy - spring) < radius + 0.13
    mask &= ~(inside & (cy >= spring - 0.05)) & ~((np.abs(cx - x) < radius) & (cy < spring) & (cy > sill))


def wall(mask: np.ndarray, zone: np.ndarray, seed: int, thick: float = THICK, wobble: float = 0.025):
    """A broken wall by zone (a number per cell, which picks the material): its faces, and its broken edges, which are flat.
    st: metres, courses in step with the cells. Faces bulge by `wobble` metres; cells of a block lie on one bilinear patch."""
    rows, columns = mask.shape
    lattice = np.random.default_rng(seed).normal(0, wobble, (rows // BLOCK + 3, columns // BLOCK + 3))

    def bulge(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        a, b = i / BLOCK, j / BLOCK
        i0, j0 = np.floor(a).astype(int), np.floor(b).astype(int)
        s, t = a - i0, b - j0
        low = lattice[j0, i0] * (1 - s) + lattice[j0, i0 + 1] * s
        return low * (1 - t) + (lattice[j0 + 1, i0] * (1 - s) + lattice[j0 + 1, i0 + 1] * s) * t

    def shape(quads: list, side: int) -> Shape:
        """quads: (i0, i1, j0, j1) in cells; side: 1 front, -1 back."""
        q = np.array(quads, dtype=float)
        i, j = q[:, [0, 1, 1, 0]].ravel(), q[:, [2, 2, 3, 3]].ravel()
        x, y = i * CELL[0], j * CELL[1]
        reach = 1.2
        dx = (bulge(i + reach, j) - bulge(np.maximum(i - reach, 0), j)) / (2 * reach * CELL[0])
        dy = (bulge(i, j + reach) - bulge(i, np.maximum(j - reach, 0))) / (2 * reach * CELL[1])
        normals = unit(np.stack([-dx, -dy, np.ones_like(dx)], axis=-1))
        points = np.stack([x, y, side * thick / 2 + bulge(i, j)], axis=-1)
        first = 4 * np.arange(len(q))[:, None]
        order = [[0, 1, 2], [0, 2, 3]] if side > 0 else [[0, 2, 1], [0, 3, 2]]
        faces = np.concatenate([first + np.array([o]) for o in order])
        return welded(Shape(points, side * normals, np.stack([side * x, y], axis=-1), faces))

    quads: dict[int, list] = {}

    def split(i: int, j: int, size: int) -> None:
        part, kinds = mask[j : j + size, i : i + size], zone[j : j + size, i : i + size]
        if part.size and part.shape == (size, size) and part.all() and (kinds == kinds[0, 0]).all():
            quads.setdefault(int(kinds[0, 0]), []).append((i, i + size, j, j + size))
        elif part.any():
            half = size // 2
            for b in (0, half):
                for a in (0, half):
                    split(i + a, j + b, half)

    for j in range(0, rows, BLOCK):
        for i in range(0, columns, BLOCK):
            split(i, j, BLOCK)
    parts = {kind: [shape(q, 1), shape(q, -1)] for kind, q in quads.items()}
    padded, edges = np.pad(mask, 1), {}
    for (di, dj), (a, b) in {
        (1, 0): ((1, 0), (1, 1)), (-1, 0): ((0, 1), (0, 0)), (0, 1): ((1, 1), (0, 1)), (0, -1): ((0, 0), (1, 0)),
    }.items():  # fmt: skip
        open_side = mask & ~padded[1 + dj : 1 + dj + rows, 1 + di : 1 + di + columns]
        for j, i in np.argwhere(open_side):
            ends = []
            for ci, cj in ((i + a[0], j + a[1]), (i + b[0], j + b[1])):
                depth = float(bulge(np.array([ci * 1.0]), np.array([cj * 1.0]))[0])
                ends.append((np.array([ci * CELL[0], cj * CELL[1]]), depth))
            (p, dp), (q, dq) = ends
            corners = [(*p, thick / 2 + dp), (*p, dp - thick / 2), (*q, dq - thick / 2), (*q, dq + thick / 2)]
            along = [(c[2] + 0.4, c[1] if di else c[0]) for c in corners]
            edges.setdefault(int(zone[j, i]), []).append(flat(corners, along))
    return {kind: merged(shapes) for kind, shapes in parts.items()}, {kind: merged(e) for kind, e in edges.items()}


def wedge(a0: float, a1: float, r0: float, r1: float, z0: float, z1: float) -> Shape:
    """A stone of an arch about the origin between two angles, radii and depths. st: (radius or depth, arc), metres."""
    angle, radius, depth = np.meshgrid([a0, a1], [r0, r1], [z0, z1], indexing="ij")
    p = np.stack([radius * np.cos(angle), radius * np.sin(angle), depth], axis=-1)
    middle = (r0 + r1) / 2
    arc = np.array([a0, a1])[:, None, None] * middle + 0 * radius
    faces = []
    for axis in range(3):
        for side in (0, 1):
            face = np.moveaxis(p, axis, 0)[side].reshape(4, 3)[[0, 1, 3, 2]]
            first, second = (radius, depth) if axis == 0 else (depth, arc) if axis == 1 else (radius, arc)
            st = np.stack([np.moveaxis(v, axis, 0)[side].reshape(4)[[0, 1, 3, 2]] for v in (first, second)], axis=-1)
            out = face.mean(axis=0) - p.reshape(8, 3).mean(axis=0)
            turned = np.cross(face[1] - face[0], face[2] - face[0]) @ out < 0
            faces.append(flat(face[::-1], st[::-1]) if turned else flat(face, st))
    return merged(faces)


def arch(radius: float, ring: float, depth: float, seed: int, count: int = 0, span: tuple[float, float] = (0, 180)):
    """Wedges of an arch whose springing is the origin: (brick ones, stone ones), taking turns. span: degrees that still
    stand."""
    rng = np.random.default_rng(seed)
    count = count or int(round(np.pi * radius / 0.235)) | 1
    kinds: tuple[list[Shape], list[Shape]] = ([], [])
    for k in range(count):
        a0, a1 = np.pi * k / count, np.pi * (k + 1) / count
        if not (span[0] <= np.degrees(a0) and np.degrees(a1) <= span[1]):
            continue
        gap, out = 0.006 / radius, rng.uniform(-0.012, 0.022)
        is_stone = k % 3 == 0 or k == count // 2
        grown = 0.05 if is_stone else 0.0
        kinds[is_stone].append(
            wedge(
                a0 + gap,
                a1 - gap,
                radius + rng.uniform(-0.008, 0.008),
                radius + ring + grown,
                -depth / 2 - out,
                depth / 2 + out,
            )
        )
    return tuple(merged(shapes) if shapes else None for shapes in kinds)


def brick(rng: np.random.Generator, chipped: float = 0.012) -> Shape:
    """A loose brick about the origin with corners knocked off; st in metres, shifted at random."""
    size = np.array([LENGTH, 0.062, 0.12]) * rng.uniform(0.93, 1.03, 3) * [rng.choice([1, 1, 1, 0.6, 0.45]), 1, 1]
    corner = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, 8).T * size / 2
    corner = corner * (1 - np.abs(rng.normal(0, chipped, (8, 3))) / size)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    shift = rng.uniform(0, 3, 2)
    faces = []
    for k, side in enumerate(sides):
        points = corner[list(side)]
        keep = [axis for axis in range(3) if axis != k // 2]
        faces.append(flat(points, points[:, keep] + shift))
    return merged(faces)


def tumbled(shape: Shape, rng: np.random.Generator, lying: float = 1.0) -> Shape:
    """Turned about y at random, and out of the level by about 25 degrees times `lying`."""
    shape = shape.turned("x", rng.normal(0, 22 * lying)).turned("z", rng.normal(0, 22 * lying))
    return shape.turned("y", rng.uniform(0, 360))


def pile(count: int, radius: float, height: float, seed: int) -> tuple[Shape, Shape, Shape]:
    """Bricks on a heap: (bricks, darker bricks, the earth under them)."""
    rng = np.random.default_rng(seed)

    def slope(r: np.ndarray) -> np.ndarray:
        return height * np.clip(1 - r / radius, 0, 1) ** 1.25

    kinds: tuple[list[Shape], list[Shape]] = ([], [])
    for _ in range(count):
        r, a = radius * 1.25 * rng.uniform() ** 0.62, rng.uniform(0, 2 * np.pi)
        lift = slope(r) + rng.uniform(0.0, 0.05)
        shape = tumbled(brick(rng), rng, 1.0 if r < radius else 0.12)
        lowest = shape.points[:, 1].min()
        base = 0.92 * lift - 0.04 - lowest * 0.6 if r < radius else -lowest - 0.006
        kinds[rng.uniform() < 0.35].append(shape.at(r * np.sin(a), base, r * np.cos(a)))
    profile = [(0.92 * radius * t, 0.7 * slope(radius * t) - 0.05) for t in (1.0, 0.85, 0.65, 0.45, 0.25, 0.1)] + [
        (0.0, height * 0.66)
    ]
    earth = lathe(profile, 14)
    bumps = 1 + 0.1 * np.sin(7 * earth.points[:, :1] / radius + seed) * np.cos(5 * earth.points[:, 2:] / radius)
    return merged(kinds[0]), merged(kinds[1]), Shape(earth.points * bumps, earth.normals, earth.points[:, [0, 2]], earth.faces)


BASE = (
    (0.42, 0),
    (0.42, 0.09),
    (0.42, 0.09),
    (0.40, 0.10),
    (0.415, 0.16),
    (0.37, 0.2),
    (0.335, 0.2),
    (0.345, 0.26),
    (0.30, 0.30),
    (0.29, 0.33),
)
CAPITAL = (
    (0.255, 0),
    (0.285, 0.02),
    (0.285, 0.05),
    (0.25, 0.07),
    (0.255, 0.14),
    (0.29, 0.26),
    (0.36, 0.36),
    (0.43, 0.42),
    (0.43, 0.45),
)


def drum(radius: float, top: float, height: float, seed: int, segments: int = 28) -> Shape:
    """A worn length of a shaft standing on the origin, with chipped rims; st in metres."""
    rng = np.random.default_rng(seed)
    rows = np.linspace(0, 1, 6)
    profile = [(0, 0), (radius - 0.012, 0), (radius - 0.012, 0)]
    profile += [(radius + (top - radius) * t, 0.012 + (height - 0.024) * t) for t in rows]
    profile += [(top - 0.012, height), (top - 0.012, height), (0, height)]
    shape = lathe(profile, segments)
    angle = np.arctan2(shape.points[:, 0], shape.points[:, 2])
    wave = sum(
        rng.normal(0, 0.006 / k) * np.sin(k * angle + 6 * rng.uniform() + 2 * shape.points[:, 1] / height) for k in (1, 2, 3, 5)
    )
    points = shape.points * (1 + wave / radius)[:, None] ** [1, 0, 1]
    st = np.stack([shape.st[:, 0] * 2 * np.pi * radius, points[:, 1]], axis=-1)
    level = np.abs(shape.normals[:, 1]) > 0.9
    return Shape(points, shape.normals, np.where(level[:, None], points[:, [0, 2]], st), shape.faces)


def lathed(profile: Sequence, segments: int = 28, refine: int = 1) -> Shape:
    """A lathe with st in metres."""
    shape = lathe(profile, segments, refine)
    radius = max(r for r, _ in profile)
    level = np.abs(shape.normals[:, 1]) > 0.9
    st = np.stack([shape.st[:, 0] * 2 * np.pi * radius, shape.points[:, 1]], axis=-1)
    return Shape(shape.points, shape.normals, np.where(level[:, None], shape.points[:, [0, 2]], st), shape.faces)
