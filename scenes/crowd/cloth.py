"""Skinned surfaces made of rings of points: what bodies, clothes and hair are put together from."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scenes.making.shapes import Shape, unit

from .skeleton import heaviest_first


@dataclass(frozen=True)
class Piece:
    """A shape with joints and weights [V, 4] and vertex colours [V, 3], which multiply the material's."""

    shape: Shape
    skinning: tuple[np.ndarray, np.ndarray]
    colors: np.ndarray


@dataclass
class Cloth:
    """A surface in the making. `ring` takes points and gives their indices, `bridge` joins two rings by triangles."""

    points: list = field(default_factory=list)
    uv: list = field(default_factory=list)
    weights: list = field(default_factory=list)
    shade: list = field(default_factory=list)
    faces: list = field(default_factory=list)

    def ring(self, points: np.ndarray, uv: np.ndarray, weights: dict, shade: float | np.ndarray = 1.0) -> np.ndarray:
        start = sum(len(part) for part in self.points)
        count = len(points)
        self.points.append(np.asarray(points, float))
        self.uv.append(np.asarray(uv, float))
        self.weights.append({name: np.broadcast_to(value, (count,)) for name, value in weights.items()})
        shade = np.asarray(shade, float)
        self.shade.append(np.broadcast_to(shade if shade.ndim == 2 else np.broadcast_to(shade, (count,))[:, None], (count, 3)))
        return start + np.arange(count)

    def bridge(self, low: np.ndarray, high: np.ndarray, closed: bool = True, skip: Callable | None = None) -> None:
        """Triangles between rings of equal length; outside is seen where the rings run counter-clockwise from above.

        skip: of the column, whether it stays open.
        """
        count = len(low) if closed else len(low) - 1
        for k in range(count):
            if skip is None or not skip(k):
                a, b, c, d = low[k], low[(k + 1) % len(low)], high[(k + 1) % len(low)], high[k]
                self.faces += [(a, b, c), (a, c, d)]

    def cap(self, ring: np.ndarray, weights: dict, up: bool, point=None) -> None:
        """Close a ring by a fan around its middle."""
        middle = np.concatenate(self.points)[ring].mean(axis=0) if point is None else point
        uv = np.concatenate(self.uv)[ring].mean(axis=0)
        (centre,) = self.ring(middle[None], uv[None], weights)
        pairs = zip(ring, np.roll(ring, -1), strict=True)
        self.faces += [(a, b, centre) if up else (b, a, centre) for a, b in pairs]

    def piece(self, folds: float = 0.0, seed: int = 0) -> Piece:
        """folds: metres by which the surface is wavy."""
        points, faces = np.concatenate(self.points), np.array(self.faces)
        normals = normals_of(points, faces)
        if folds:
            points = points + normals * (folds * waves(points, seed))[:, None]
            normals = normals_of(points, faces)
        names = {name for part in self.weights for name in part}
        weights = {
            name: np.concatenate(
                [part.get(name, np.zeros(len(at))) for part, at in zip(self.weights, self.points, strict=True)]
            )
            for name in sorted(names)
        }
        shape = Shape(points, normals, np.concatenate(self.uv), faces)
        return Piece(shape, heaviest_first(weights), np.clip(np.concatenate(self.shade), 0, 1))


def normals_of(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals [V, 3]: the sum of the triangles' around a point, by area."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, faces[:, k], normal)
    return unit(total)


def waves(points: np.ndarray, seed: int) -> np.ndarray:
    """A smooth function of place, about -1 to 1, with waves of some 12 to 25 cm."""
    rng = np.random.default_rng(seed)
    total = np.zeros(len(points))
    for _ in range(5):
        wave = unit(rng.standard_normal(3) * [1, 1.4, 1]) * rng.uniform(26, 55)
        total += np.sin(points @ wave + rng.uniform(0, 6.28)) / 3
    return total


def rigid(shape: Shape, joint: str, color=(1.0, 1.0, 1.0)) -> Piece:
    """A shape that follows one joint, in the figure's space of the bind pose."""
    count = len(shape.points)
    return Piece(shape, heaviest_first({joint: np.ones(count)}), np.tile(np.array(color, float), (count, 1)))


def joined(pieces: list[Piece]) -> Piece:
    """One piece of many."""
    offsets = np.cumsum([0] + [len(piece.shape.points) for piece in pieces])
    parts = [np.concatenate([getattr(piece.shape, name) for piece in pieces]) for name in ("points", "normals", "st")]
    faces = np.concatenate([piece.shape.faces + offset for piece, offset in zip(pieces, offsets, strict=False)])
    skinning = tuple(np.concatenate([piece.skinning[k] for piece in pieces]) for k in range(2))
    return Piece(Shape(*parts, faces), skinning, np.concatenate([piece.colors for piece in pieces]))


def step(low: float, high: float, value) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth between; the other way round where low > high."""
    t = np.clip((np.asarray(value, float) - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)
