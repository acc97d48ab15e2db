"""Triangle meshes of the market's things: boxes, lathes, tubes, sheets, walls with holes. Metres, y up, st in metres
except where a function says that it runs from 0 to 1."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shape:
    """points, normals [N, 3], st [N, 2], faces [T, 3] counter-clockwise from outside."""

    points: np.ndarray
    normals: np.ndarray
    st: np.ndarray
    faces: np.ndarray

    def at(self, x: float = 0, y: float = 0, z: float = 0) -> "Shape":
        return Shape(self.points + np.array([x, y, z]), self.normals, self.st, self.faces)

    def turned(self, axis: str, degrees: float) -> "Shape":
        """Rotated counter-clockwise about the axis 'x', 'y' or 'z' through the origin."""
        a, b = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        matrix = np.eye(3)
        matrix[a, a], matrix[a, b], matrix[b, a], matrix[b, b] = c, -s, s, c
        return Shape(self.points @ matrix.T, self.normals @ matrix.T, self.st, self.faces)

    def scaled(self, x: float, y: float, z: float) -> "Shape":
        normals = self.normals / np.array([x, y, z])
        return Shape(self.points * np.array([x, y, z]), unit(normals), self.st, self.faces)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def merged(shapes: Sequence[Shape]) -> Shape:
    offsets = np.cumsum([0] + [len(shape.points) for shape in shapes])
    return Shape(
        *(np.concatenate([getattr(shape, name) for shape in shapes]) for name in ("points", "normals", "st")),
        np.concatenate([shape.faces + offset for shape, offset in zip(shapes, offsets, strict=False)]),
    )


def quad(origin, right, up, st=None) -> Shape:
    """Parallelogram seen from right x up; st in metres, or `st` times 0 to 1."""
    origin, right, up = (np.array(v, dtype=float) for v in (origin, right, up))
    extent = np.array(st if st is not None else (np.linalg.norm(right), np.linalg.norm(up)), dtype=float)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    points = origin + corners[:, :1] * right + corners[:, 1:] * up
    normal = unit(np.cross(right, up))
    return Shape(points, np.tile(normal, (4, 1)), corners * extent, np.array([[0, 1, 2], [0, 2, 3]]))


def box(width: float, height: float, depth: float, x: float = 0, y: float = 0, z: float = 0) -> Shape:
    """A box standing on (x, y, z) in the middle of its base; st along each face's longer side, shifted by its place."""
    size, sides = np.array([width, height, depth]), []
    for axis in range(3):
        for sign in (-1, 1):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            if sign < 0:
                first, second = second, first
            right, up = np.eye(3)[first] * size[first], np.eye(3)[second] * size[second]
            corner = sign * np.eye(3)[axis] * size[axis] / 2 - right / 2 - up / 2
            side = quad(corner, right, up)
            st = side.st[:, ::-1] if size[second] > size[first] else side.st
            sides.append(Shape(side.points, side.normals, st + (x * 1.37 + z * 0.71 + y * 0.53), side.faces))
    return merged(sides).at(x, y + height / 2, z)


def lathe(profile: Sequence[tuple[float, float]], segments: int = 32, refine: int = 1) -> Shape:
    """A profile of (radius, y), from bottom to top along the outside, revolved about y; st from 0 to 1, u around.

    `refine` > 1 draws a cubic through the profile. Corners sharper than about 50 degrees stay sharp.
    """
    line = np.array(profile, dtype=float)
    if refine > 1:
        line = _curve(line, refine)
    steps = np.diff(line, axis=0)
    outward = unit(np.stack([steps[:, 1], -steps[:, 0]], axis=-1))
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(steps, axis=1))])
    along /= along[-1]
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    around, rings = np.stack([np.sin(angle), np.cos(angle)], axis=-1), []
    for k in range(len(steps)):
        ends = []
        for j, other in ((k, k - 1), (k + 1, k + 1)):
            soft = 0 <= other < len(steps) and outward[other] @ outward[k] > 0.64
            ends.append((line[j], unit(outward[k] + outward[other]) if soft else outward[k], along[j]))
        rings.append(ends)
    points, normals, st, faces = [], [], [], []
    last = None
    for start, end in rings:
        for ring in (start, end):
            if last is not None and np.allclose(np.concatenate([last[0], last[1]]), np.concatenate([ring[0], ring[1]])):
                continue
            (r, y), (nr, ny), v = ring
            points.append(np.stack([r * around[:, 0], np.full(len(angle), y), r * around[:, 1]], axis=-1))
            normals.append(np.stack([nr * around[:, 0], np.full(len(angle), ny), nr * around[:, 1]], axis=-1))
            st.append(np.stack([angle / (2 * np.pi), np.full(len(angle), v)], axis=-1))
            if ring is end:
                faces.append(_strip(len(points) - 2, segments))
            last = ring
    shape = Shape(*(np.concatenate(part) for part in (points, normals, st, faces)))
    a, b, c = (shape.points[shape.faces[:, k]] for k in range(3))
    keep = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12
    return Shape(shape.points, shape.normals, shape.st, shape.faces[keep])


def _strip(ring: int, segments: int) -> np.ndarray:
    a = ring * (segments + 1) + np.arange(segments)
    b = a + segments + 1
    return np.concatenate([np.stack([a, a + 1, b + 1], axis=-1), np.stack([a, b + 1, b], axis=-1)])


def _curve(line: np.ndarray, refine: int) -> np.ndarray:
    """Catmull-Rom through the points; a point given twice is a corner."""
    ends = np.concatenate([line[:1], line, line[-1:]])
    points = []
    for p0, p1, p2, p3 in zip(ends, ends[1:], ends[2:], ends[3:], strict=False):
        if np.allclose(p1, p2):
            continue
        for t in np.arange(refine) / refine:
            a, b = (p2 - p0) / 2, (p3 - p1) / 2
            points.append(p1 + t * a + t * t * (3 * (p2 - p1) - 2 * a - b) + t**3 * (2 * (p1 - p2) + a + b))
    return np.maximum(np.array([*points, line[-1]]), [0, -1e9])


def ball(radius: float, segments: int = 12, rings: int = 7) -> Shape:
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return lathe([(max(radius * np.cos(a), 0), radius * np.sin(a)) for a in angle], segments)


def tube(path: Sequence[Sequence[float]], radius: float, sides: int = 6) -> Shape:
    """A pipe along a polyline, open at both ends; st in metres along u."""
    line = np.array(path, dtype=float)
    tangents = unit(np.gradient(line, axis=0))
    side = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    points, normals, st = [], [], []
    for place, tangent, s in zip(line, tangents, along, strict=True):
        side = unit(side - tangent * (side @ tangent))
        normal = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(tangent, side)
        points.append(place + radius * normal)
        normals.append(normal)
        st.append(np.stack([np.full(sides + 1, s), angle * radius], axis=-1))
    faces = np.concatenate([_strip(k, sides) for k in range(len(line) - 1)])
    return Shape(*(np.concatenate(part) for part in (points, normals, st)), faces)


def bow(start, end, rise, count: int = 9) -> list[np.ndarray]:
    """Points of an arc from start to end that rises by the vector `rise` in the middle."""
    start, end, rise = (np.array(v, dtype=float) for v in (start, end, rise))
    return [start + (end - start) * t + rise * np.sin(np.pi * t) for t in np.linspace(0, 1, count)]


def sheet(points: np.ndarray, st: np.ndarray) -> Shape:
    """A smooth surface through a grid [rows, columns, 3] of points with st [rows, columns, 2]."""
    rows, columns = points.shape[:2]
    normals = unit(np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return Shape(points.reshape(-1, 3), normals.reshape(-1, 3), st.reshape(-1, 2), faces)


def canopy(width: float, depth: float, back: float, front: float, drop: float = 0.24, scallops: int = 10) -> Shape:
    """Canvas from the back bar to the front bar, sagging between them, with a scalloped valance; st in metres."""
    x, t = np.meshgrid(np.linspace(-width / 2, width / 2, 33), np.linspace(0, 1, 8))
    sag = 0.09 * np.sin(np.pi * t) * (0.75 + 0.25 * np.cos(x / width * 6 * np.pi))
    z = (t - 0.5) * depth
    roof = sheet(np.stack([x, back + (front - back) * t - sag, z], axis=-1)[::-1], np.stack([x, z], axis=-1)[::-1])
    x, t = np.meshgrid(np.linspace(-width / 2, width / 2, scallops * 6 + 1), np.linspace(0, 1, 3))
    lobe = np.abs(np.sin(np.pi * (x / width + 0.5) * scallops)) ** 0.6
    y = front - t * drop * (0.55 + 0.45 * lobe)
    out = depth / 2 + 0.03 * t + 0.015 * np.sin(x * 9) * t
    return merged(
        [roof, sheet(np.stack([x, y, out], axis=-1)[::-1], np.stack([x, depth / 2 + front - y], axis=-1)[::-1])]
    )


def wall(width: float, height: float, holes: Sequence[tuple[float, float, float, float]], reveal: float = 0.2) -> Shape:
    """A wall from x = 0 to width at z = 0 that faces +z, with holes (x, y, width, height) as deep as `reveal`."""
    xs = sorted({0.0, width, *(h[0] for h in holes), *(h[0] + h[2] for h in holes)})
    ys = sorted({0.0, height, *(h[1] for h in holes), *(h[1] + h[3] for h in holes)})
    parts = []
    for x0, x1 in zip(xs, xs[1:], strict=False):
        for y0, y1 in zip(ys, ys[1:], strict=False):
            x, y = (x0 + x1) / 2, (y0 + y1) / 2
            if not any(h[0] < x < h[0] + h[2] and h[1] < y < h[1] + h[3] for h in holes):
                side = quad((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0))
                parts.append(Shape(side.points, side.normals, side.points[:, :2], side.faces))
    for x, y, w, h in holes:
        parts += [
            quad((x, y, -reveal), (0, 0, reveal), (0, h, 0)),
            quad((x + w, y, 0), (0, 0, -reveal), (0, h, 0)),
            quad((x, y, 0), (w, 0, 0), (0, 0, -reveal)),
            quad((x, y + h, -reveal), (w, 0, 0), (0, 0, reveal)),
        ]
    return merged(parts)


def foliage(count: int, radius: float, height: float, size: float, seed: int) -> Shape:
    """Twig cards on a dome of the given radius over the origin; st from 0 to 1 on each card."""
    rng = np.random.default_rng(seed)
    cards = []
    for _ in range(count):
        azimuth, lift, reach = rng.uniform(0, 360), np.degrees(np.arcsin(rng.uniform(0.0, 0.97))), rng.uniform(0.25, 1)
        card = quad((-size / 2, 0, 0), (size, 0, 0), (0, size, 0), st=(1, 1)).turned("y", rng.uniform(-70, 70))
        card = card.turned("x", np.clip(90 - lift + rng.normal(0, 18), 5, 115))  # droops outwards low down
        a, b = np.radians(azimuth), np.radians(lift)
        out = np.array([np.sin(a) * np.cos(b) * radius, np.sin(b) * height, np.cos(a) * np.cos(b) * radius])
        card = card.turned("y", azimuth).at(*(out * reach * 0.7))
        outward = unit(card.points - np.array([0, -0.2 * height, 0]))
        faces = card.faces
        if card.normals[0] @ outward.mean(axis=0) < 0:
            card, faces = Shape(card.points, -card.normals, card.st, faces), faces[:, ::-1]
        cards.append(Shape(card.points, unit(card.normals + 0.7 * outward), card.st, faces))
    return merged(cards)
