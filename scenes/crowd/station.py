"""The arcade along the left of the square, and the strips and arches that it is made of."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.shapes import Shape, box, lathe, merged, quad, sheet, tube, unit, wall

BAY, BAYS, FRONT = 4.4, 11, -9.0  # width of a bay, how many, and the x of the arcade's face
NEAR, HALL = 12.4, -36.0  # z of the arcade's near end and of the hall's front
SPRING, RADIUS, FLOOR = 3.1, 1.62, 5.55  # of the arches, and where the upper storey begins


def ribbon(line: np.ndarray, across: np.ndarray, st_scale: float = 1.0) -> Shape:
    """A strip along points [n, 3], as wide as the vectors `across` [n, 3] or [3]."""
    line = np.asarray(line, float)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    across = np.broadcast_to(np.asarray(across, float), line.shape)
    width = np.linalg.norm(across, axis=1)
    st = np.stack([np.stack([along, 0 * along], axis=-1), np.stack([along, width], axis=-1)])
    return sheet(np.stack([line, line + across]), st * st_scale)


def arch_line(x: float, spring: float, radius: float, z: float, count: int = 17) -> np.ndarray:
    turn = np.linspace(np.pi, 0, count)
    return np.stack([x + radius * np.cos(turn), spring + radius * np.sin(turn), np.full(count, z)], axis=1)


def arch_wall(x: float, bottom: float, top: float, left: float, right: float, spring: float, radius: float, z: float) -> Shape:
    """A wall at z that faces +z from `left` to `right` with an opening that ends in a half circle; st in metres."""
    arc = arch_line(x, spring, radius, z, 25)
    fan = np.interp(arc[:, 0], (x - radius, x + radius), (left, right))
    crown = np.stack([fan, np.full(25, top), np.full(25, z)], axis=1)
    over = sheet(np.stack([arc, crown]), np.stack([arc[:, :2], crown[:, :2]]))
    sides = [
        quad((left, bottom, z), (x - radius - left, 0, 0), (0, spring - bottom, 0)),
        quad((x + radius, bottom, z), (right - x - radius, 0, 0), (0, spring - bottom, 0)),
    ]
    corners = [
        Shape(
            np.array([(left, spring, z), (x - radius, spring, z), (left, top, z)]),
            np.tile((0.0, 0, 1), (3, 1)),
            np.array([(left, spring), (x - radius, spring), (left, top)]),
            np.array([[0, 1, 2]]),
        )
    ]
    corners += [
        Shape(
            np.array([(x + radius, spring, z), (right, spring, z), (right, top, z)]),
            np.tile((0.0, 0, 1), (3, 1)),
            np.array([(x + radius, spring), (right, spring), (right, top)]),
            np.array([[0, 1, 2]]),
        )
    ]
    sides = [Shape(part.points, part.normals, part.points[:, :2], part.faces) for part in sides]
    shape = merged([over, *sides, *corners])
    return Shape(shape.points, np.tile((0.0, 0, 1), (len(shape.points), 1)), shape.points[:, :2], shape.faces)


def moulded_arch(x: float, spring: float, radius: float, z: float, width: float, proud: float) -> Shape:
    """An archivolt: a band around the arch that stands `proud` of the wall."""
    inner, outer = arch_line(x, spring, radius, z + proud, 25), arch_line(x, spring, radius + width, z + proud, 25)
    face = ribbon(inner, outer - inner)
    lip = ribbon(outer, (0, 0, -proud))
    flat = Shape(face.points, np.tile((0.0, 0, 1), (len(face.points), 1)), face.st, face.faces)
    return merged([flat, lip])


def bay() -> dict[str, Shape]:
    """One bay, from x = 0 to BAY, that faces +z: by material."""
    middle, depth = BAY / 2, 0.75
    face = arch_wall(middle, 0, FLOOR, 0, BAY, SPRING, RADIUS, 0)
    arc = arch_line(middle, SPRING, RADIUS, 0, 25)
    jambs = np.concatenate([[(middle - RADIUS, 0, 0)], arc, [(middle + RADIUS, 0, 0)]])
    reveal = ribbon(jambs[::-1], (0, 0, -depth))
    back = face.at(0, 0, -depth)
    windows = [(0.85, 6.75, 1.0, 2.2), (BAY - 1.85, 6.75, 1.0, 2.2)]
    upper = wall(BAY, 4.35, [(x, y - FLOOR, w, h) for x, y, w, h in windows], reveal=0.24).at(0, FLOOR, 0)
    trims = [moulded_arch(middle, SPRING, RADIUS, 0, 0.3, 0.07), box(0.36, 0.62, 0.22, middle, SPRING + RADIUS - 0.05, 0.06)]
    for x in (0.0, BAY):  # half of a pilaster on each side; the neighbour has the other half
        at = x + (0.27 if x == 0 else -0.27)
        trims += [
            box(0.54, 0.55, 0.2, at, 0, 0.1),
            box(0.5, 0.14, 0.16, at, 0.55, 0.08),
            box(0.44, FLOOR - 1.2, 0.1, at, 0.69, 0.05),
        ]
        trims += [box(0.5, 0.12, 0.16, at, FLOOR - 0.55, 0.08), box(0.56, 0.2, 0.22, at, FLOOR - 0.43, 0.1)]
        trims += [box(0.4, 3.5, 0.08, at - (0.04 if x == 0 else -0.04), FLOOR + 0.35, 0.04)]
    for side in (-1, 1):  # imposts
        trims.append(box(0.3, 0.16, depth + 0.12, middle + side * (RADIUS + 0.12), SPRING - 0.16, -depth / 2 + 0.02))
    trims += [box(BAY, 0.22, 0.26, middle, FLOOR - 0.14, 0.1), box(BAY, 0.1, 0.38, middle, FLOOR + 0.08, 0.14)]
    for x, y, w, h in windows:
        c = x + w / 2
        trims += [
            box(w + 0.4, 0.12, 0.3, c, y - 0.12, 0.06),
            box(0.16, h, 0.1, x - 0.08, y, 0.03),
            box(0.16, h, 0.1, x + w + 0.08, y, 0.03),
        ]
        trims += [box(w + 0.5, 0.2, 0.18, c, y + h, 0.05), box(w + 0.7, 0.09, 0.34, c, y + h + 0.2, 0.1)]
    trims += [
        box(BAY, 0.3, 0.2, middle, 9.3, 0.06),
        box(BAY, 0.16, 0.62, middle, 9.72, 0.24),
        box(BAY, 0.12, 0.8, middle, 9.88, 0.33),
    ]
    trims += [box(0.16, 0.17, 0.3, 0.22 + 0.44 * k, 9.55, 0.24) for k in range(10)]
    trims += [
        box(BAY, 0.1, 0.3, middle, 10.0, 0.1),
        box(BAY, 0.14, 0.36, middle, 10.72, 0.1),
        box(0.5, 0.62, 0.34, 0.25, 10.1, 0.1),
    ]
    profile = [(0.05, 0), (0.07, 0.04), (0.1, 0.16), (0.055, 0.32), (0.045, 0.46), (0.075, 0.58), (0.08, 0.62)]
    trims += [lathe(profile, 8).at(0.72 + 0.37 * k, 10.1, 0.1) for k in range(10)]
    frames, panes = [], []
    for x, y, w, h in windows:
        panes.append(quad((x, y, -0.2), (w, 0, 0), (0, h, 0), st=(1, 1)))
        frames += [box(0.07, h, 0.07, x + 0.035 + (w - 0.07) * t, y, -0.17) for t in (0, 0.5, 1)]
        frames += [box(w, 0.06, 0.06, x + w / 2, y + (h - 0.06) * t, -0.17) for t in (0, 0.66, 1)]
    return {
        "ashlar": merged([face, reveal, Shape(back.points, -back.normals, back.st, back.faces[:, ::-1]), upper]),
        "trim": merged(trims),
        "cream_paint": merged(frames),
        "glass": merged(panes),
    }


def shopfront() -> dict[str, Shape]:
    """The wall at the back of one bay of the arcade: a window with a lit shop, a door, a lantern."""
    frames = [box(0.08, 2.7, 0.1, x, 0.45, 0.05) for x in (0.5, 1.62, 2.74)] + [
        box(2.32, 0.1, 0.12, 1.62, y, 0.05) for y in (0.45, 2.4, 3.1)
    ]
    frames += [
        box(1.1, 0.1, 0.12, 3.6, 3.1, 0.05),
        box(0.1, 3.1, 0.12, 3.1, 0, 0.05),
        box(0.1, 3.1, 0.12, 4.1, 0, 0.05),
        box(0.9, 0.9, 0.06, 3.6, 0.1, 0.02),
    ]
    frames.append(box(2.4, 0.45, 0.1, 1.62, 0, 0.05))
    lantern = merged(
        [
            lathe([(0.0, 3.3), (0.11, 3.36), (0.17, 3.75), (0.0, 3.9)], 8),
        ]
    ).at(BAY / 2, 0, 2.0)
    chain = tube([(BAY / 2, 3.88, 2.0), (BAY / 2, 5.2, 2.0)], 0.012, 4)
    return {
        "stucco": wall(BAY, 5.3, [(0.5, 0.45, 2.24, 2.7), (3.1, 0.0, 1.0, 3.15)], reveal=0.12),
        "green_paint": merged(frames),
        "shop": quad((0.5, 0.45, -0.1), (2.24, 0, 0), (0, 2.7, 0), st=(1, 1)),
        "glass": quad((3.1, 0, -0.1), (1.0, 0, 0), (0, 3.15, 0), st=(1, 1)),
        "lamp": lantern,
        "iron": chain,
    }


def _grime(shape: Shape) -> np.ndarray:
    """Vertex colours [V, 3]: splashes above the ground, soot below the ledges, dusk under the arches."""
    x, y, z = shape.points.T
    shade = 0.72 + 0.28 * np.clip(y / 1.1, 0, 1) ** 0.6
    for ledge, deep in ((FLOOR - 0.1, 0.7), (9.3, 1.0)):
        below = ledge - y
        shade = shade * np.where((below > 0) & (below < deep) & (z < 0.09), 0.86, 1.0)
    shade = shade * np.where(z < -0.3, 0.6, 1.0) * (0.97 + 0.03 * np.sin(5.1 * x + 2.3 * y))
    return np.clip(shade, 0, 1)[:, None] * np.array([1.0, 0.985, 0.96])


def arcade(m: GltfStage) -> None:
    parts, shops = bay(), shopfront()
    grime = {name: _grime(shape) for name, shape in parts.items()}
    for k in range(BAYS):
        z = NEAR - BAY * k
        group = m.group(f"Arcade/Bay{k}", (FRONT, 0, z), 90)
        for material, shape in parts.items():
            m.add(f"Arcade/Bay{k}/{material}", shape, material, parent=group, colors=grime[material])
        inner = m.group(f"Arcade/Shop{k}", (FRONT - 4.6, 0, z), 90)
        for material, shape in shops.items():
            m.add(f"Arcade/Shop{k}/{material}", shape, material, parent=inner)
    length = BAY * BAYS
    m.add("Arcade/floor", quad((FRONT - 4.6, 0.012, NEAR), (4.0, 0, 0), (0, 0, -length)), "kerb")
    m.add("Arcade/ceiling", quad((FRONT - 4.6, 5.25, NEAR - length), (4.6, 0, 0), (0, 0, length)), "vault")
    m.add("Arcade/roof", quad((FRONT - 0.1, 10.1, NEAR), (0, 0, -length), (-6, 2.4, 0)), "slate")
    m.add("Arcade/end", box(6.6, 10, 0.3, FRONT - 3.2, 0, NEAR + 0.1), "ashlar")
    for k in range(4):
        z, colour = NEAR - BAY * (1 + 2.0 * k) - 0.0, ("banner_red", "banner_blue")[k % 2]
        m.add(f"Banners/pole{k}", tube([(FRONT, 8.9, z), (FRONT + 1.5, 9.25, z)], 0.03, 6), "iron")
        pivot = m.group(f"Banners/Flag{k}", (FRONT + 0.85, 9.05, z))
        t, x = np.meshgrid(np.linspace(0, 1, 9), np.linspace(-0.55, 0.55, 5), indexing="ij")
        points = np.stack([x, -3.1 * t + 0.12 * x, 0.08 * np.sin(5 * t + 2 * x) * t], axis=-1)[::-1]
        m.add(f"Banners/Flag{k}/cloth", sheet(points, np.stack([x, -3.1 * t], axis=-1)[::-1]), colour, parent=pivot)
        times = np.linspace(0, 8, 65)
        swing = 5 * np.sin(2 * np.pi * times / 4 + k) + 3 * np.sin(2 * np.pi * times / 2 + 2 * k)
        half = np.radians(swing) / 2
        m.animate(pivot, "rotation", times, np.stack([np.sin(half), 0 * half, 0 * half, np.cos(half)], axis=1))


def face_normals(shape: Shape) -> Shape:
    """Every triangle with its own normal."""
    points, st = shape.points[shape.faces].reshape(-1, 3), shape.st[shape.faces].reshape(-1, 2)
    a, b, c = points[::3], points[1::3], points[2::3]
    return Shape(points, np.repeat(unit(np.cross(b - a, c - a)), 3, axis=0), st, np.arange(len(points)).reshape(-1, 3))
