"""What grows and lies on the floor: ferns, grass, fallen leaves, stones, logs, mushrooms."""

import numpy as np
from scenes.making.shapes import Shape, lathe, merged, sheet, unit

from .trees import Cards, limb


def fern(seed: int, fronds: int, length: float) -> Cards:
    """Fronds that rise from the origin and arch over; each a strip with a crease along its middle."""
    rng = np.random.default_rng(seed)
    shapes, reaches = [], []
    for k in range(fronds):
        azimuth = 2 * np.pi * (k + rng.uniform(-0.35, 0.35)) / fronds
        long, lift = length * rng.uniform(0.75, 1.15), np.radians(rng.uniform(48, 76))
        s = np.linspace(0, 1, 7)
        bend = lift - s * np.radians(rng.uniform(62, 95))
        step = long / 6
        r = np.concatenate([[0], np.cumsum(np.cos(bend[:-1]) * step)])
        y = np.concatenate([[0], np.cumsum(np.sin(bend[:-1]) * step)])
        out, aside = np.array([np.sin(azimuth), 0, np.cos(azimuth)]), np.array([np.cos(azimuth), 0, -np.sin(azimuth)])
        spine = r[:, None] * out + y[:, None] * [0, 1, 0]
        width = np.maximum(np.sin(np.pi * np.minimum(0.72 * s + 0.25, 1)) ** 0.9, 0.05)  # the image's outline
        across = np.array([-1.0, 0, 1.0])
        points = (
            spine[:, None]
            + (width[:, None] * across * 0.26 * long)[..., None] * aside
            - (np.abs(across) * 0.05 * long)[None, :, None] * [0, 1, 0]
        )
        st = np.stack(np.broadcast_arrays(0.5 + 0.5 * width[:, None] * across, s[:, None]), axis=-1)
        shape = sheet(points, st)
        normals = np.where(shape.normals[:, 1:2] < 0, -shape.normals, shape.normals)
        faces = shape.faces
        a, b, c = (shape.points[faces[:, j]] for j in range(3))
        down = np.sum(np.cross(b - a, c - a) * normals[faces[:, 0]], axis=1) < 0
        faces = np.where(down[:, None], faces[:, ::-1], faces)
        shapes.append(Shape(shape.points, unit(normals + [0, 0.5, 0]), shape.st, faces))
        reaches.append(np.repeat(0.11 * long * s**1.5, 3))
    return Cards(merged(shapes), np.concatenate(reaches))


def grass(seed: int, cards: int, radius: float, height: float) -> Cards:
    """Upright cards around the origin, lit as the ground is."""
    rng = np.random.default_rng(seed)
    shapes, reaches = [], []
    for _ in range(cards):
        a, r, turn = rng.uniform(0, 2 * np.pi), radius * np.sqrt(rng.uniform()), rng.uniform(0, np.pi)
        tall = height * rng.uniform(0.55, 1.15)
        across = np.array([np.cos(turn), 0, np.sin(turn)]) * height * 0.55
        base, lean = np.array([r * np.sin(a), -0.03, r * np.cos(a)]), rng.normal(0, 0.22, 2) * tall
        top = base + [lean[0], tall, lean[1]]
        points = np.array([base - across, base + across, top + across, top - across])
        out = unit(np.cross(across, top - base))
        st = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
        for side in (-1, 1):  # a card for either side: both are lit from above
            normal = np.tile(unit(np.array([0, 1.0, 0]) + 0.45 * side * out), (4, 1))
            faces = np.array([[0, 1, 2], [0, 2, 3]])
            if np.cross(points[1] - points[0], points[2] - points[0]) @ out * side < 0:
                faces = faces[:, ::-1]
            shapes.append(Shape(points + 0.003 * side * out, normal, st, faces))
            reaches.append(np.array([0, 0, 0.18, 0.18]) * tall)
    return Cards(merged(shapes), np.concatenate(reaches))


def lone_leaf(cell: int, size: float, curl: float) -> Shape:
    """One leaf around the origin, face up, curled about its length; its outline lies within a leaf of the grid of 3 x 3."""
    z = np.array([-0.4, -0.12, 0.16, 0.4])
    x = np.array([0.0, 0.2, 0.19, 0.0])[:, None] * np.array([-1, 0, 1]) + 0.004 * np.array([-1, 0, 1])
    z = z[:, None] + 0 * x
    y = curl * (4 * x**2 - 0.5 * z**2 + 0.4 * z)
    tilt = (-8, 14, 3, -18, 8, 20, -14, 10, -5)[cell]
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    u, v = x * c - 0.9 * z * s, 0.9 * z * c + x * s
    st = np.stack([u + 0.5, v + 0.5], axis=-1) / 3 + [cell % 3 / 3, cell // 3 / 3]
    leaf = sheet(np.stack([x, y, z], axis=-1) * size * 1.25, st)
    up = leaf.normals[:, 1].mean() > 0
    return Shape(leaf.points, leaf.normals if up else -leaf.normals, leaf.st, leaf.faces if up else leaf.faces[:, ::-1])


def leaf_litter(seed: int, count: int, radius: float) -> Shape:
    """Leaves lying on flat ground around the origin, each at its own height and tilt."""
    rng = np.random.default_rng(seed)
    leaves = []
    for _ in range(count):
        a, r = rng.uniform(0, 2 * np.pi), radius * rng.uniform(0, 1) ** 0.6
        leaf = lone_leaf(int(rng.integers(9)), rng.uniform(0.09, 0.17), rng.uniform(-0.25, 0.6))
        leaf = leaf.turned("x", rng.normal(0, 16)).turned("z", rng.normal(0, 16)).turned("y", rng.uniform(0, 360))
        leaves.append(leaf.at(r * np.sin(a), rng.uniform(0.012, 0.045), r * np.cos(a)))
    return merged(leaves)


def stone(seed: int, size=(0.5, 0.34, 0.42), rings: int = 20) -> Shape:
    """A boulder: a ball under low noise, cut flat by a few planes; sits a quarter deep in the ground."""
    rng = np.random.default_rng(seed)
    theta, phi = np.linspace(0.02, np.pi - 0.02, rings), np.linspace(0, 2 * np.pi, 2 * rings + 1)
    d = np.stack([np.sin(theta)[:, None] * np.cos(phi), np.cos(theta)[:, None] + 0 * phi, np.sin(theta)[:, None] * np.sin(phi)],
                 axis=-1)  # fmt: skip
    radius = np.ones(d.shape[:2])
    for k in range(14):
        axis = rng.normal(size=3) * (1.2 + 0.55 * k)
        radius += 0.11 / (1 + 0.5 * k) * np.sin(d @ axis + rng.uniform(0, 6))
    for _ in range(7):
        axis = unit(rng.normal(size=3))
        limit, facing = rng.uniform(0.72, 0.95), np.maximum(d @ axis, 1e-3)
        radius = np.minimum(radius, np.where(facing > 0.2, limit / facing, 9.0))
    points = d * radius[..., None] * np.array(size)
    st = np.stack(np.broadcast_arrays(phi / (2 * np.pi) * 2.2, 1 - theta[:, None] / np.pi * 1.3), axis=-1)
    shape = sheet(points, st * np.mean(size) * 2.4)
    outward = np.sum(shape.normals * shape.points) > 0
    faces = shape.faces if outward else shape.faces[:, ::-1]
    normals = (shape.normals if outward else -shape.normals).reshape(*points.shape)
    normals[:, 0] = normals[:, -1] = unit(normals[:, 0] + normals[:, -1])
    return Shape(shape.points, normals.reshape(-1, 3), shape.st, faces).at(0, size[1] * 0.42, 0)


def log(seed: int, length: float, radius: float) -> tuple[Shape, Shape, Shape]:
    """A fallen trunk along x on the ground: bark, mossy upper side with stubs, sawn ends."""
    rng = np.random.default_rng(seed)
    x = np.linspace(-length / 2, length / 2, 24)
    line = np.stack([x, radius * 0.86 + 0.03 * np.sin(1.9 * x), 0.12 * np.sin(0.8 * x + 1)], axis=-1)
    radii = radius * np.linspace(1.08, 0.78, 24)
    phase = rng.uniform(0, 6, 3)

    def bulge(angle: np.ndarray, _: float) -> np.ndarray:
        return 1 + 0.05 * np.cos(3 * angle + phase[0]) + 0.04 * np.cos(5 * angle + phase[1])

    bark = limb(line, radii, 20, 1, 1 / 1.6, bulge)
    stubs = []
    for _ in range(4):
        at, a = line[int(rng.integers(4, 20))], rng.uniform(-1.1, 1.1)
        out = np.array([rng.normal(0, 0.4), np.cos(a), np.sin(a)])
        reach = radius + rng.uniform(0.08, 0.45)
        stubs.append(limb(np.array([at, at + out * reach * 0.6, at + out * reach]), np.array([0.07, 0.055, 0.035]), 7, 1, 0.6))
    ends = []
    for index, side in ((0, -1), (-1, 1)):
        angle = np.linspace(0, 2 * np.pi, 21)
        rim = bark.points.reshape(24, 21, 3)[index]
        points = np.concatenate([line[index][None], rim])
        st = 0.5 + 0.48 * np.concatenate([[[0, 0]], np.stack([np.cos(angle), np.sin(angle)], axis=-1)])
        fan = np.stack([np.zeros(20, int), np.arange(1, 21), np.arange(2, 22)], axis=-1)
        normal = np.tile([float(side), 0, 0], (22, 1))
        cross = np.cross(points[1] - points[0], points[2] - points[0])[0] * side
        ends.append(Shape(points, normal, st, fan if cross > 0 else fan[:, ::-1]))
    angle = np.linspace(-1.15, 1.25, 13)
    cap = []
    for place, radius_here in zip(line, radii, strict=True):
        wobble = 1.022 + 0.02 * np.sin(7 * angle + 5 * place[0]) - 0.05 * (np.abs(angle) / 1.2) ** 6
        full = radius_here * wobble * np.interp(angle, np.linspace(-np.pi, np.pi, 9), np.ones(9))
        cap.append(np.stack([np.full(13, place[0]), place[1] + full * np.cos(angle), place[2] + full * np.sin(angle)], axis=-1))
    grid = np.array(cap)
    st = np.stack(np.broadcast_arrays(x[:, None], (angle * radius)[None, :]), axis=-1)
    moss = sheet(grid, st / 1.3)
    up = moss.normals[:, 1].mean() > 0
    moss = Shape(moss.points, moss.normals if up else -moss.normals, moss.st, moss.faces if up else moss.faces[:, ::-1])
    return merged([bark, *stubs]), moss, merged(ends)


def mushroom(height: float, width: float, flat: float) -> tuple[Shape, Shape]:
    """(cap, stem) standing at the origin."""
    rim = height * (1 - 0.5 * flat)
    under = [(0, rim * 0.99), (width * 0.55, rim), (width, rim * 0.96), (width * 1.02, rim)]
    cap = lathe([*under, (width * 0.86, height * 0.95), (width * 0.5, height * 1.08), (0, height * 1.13)], 12, refine=2)
    stem = lathe([(0, -0.02), (width * 0.34, -0.02), (width * 0.24, height * 0.3), (width * 0.2, rim)], 8)
    return cap, stem
