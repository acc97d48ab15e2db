"""Trunks with roots and branches, and the leaf clusters that hang on them."""

from dataclasses import dataclass

import numpy as np
from scenes.making.shapes import Shape, merged, unit

ROOT_HEIGHT = 1.6  # metres of a trunk that have the mossy image


@dataclass(frozen=True)
class Tree:
    """root, bark: the trunk's foot, and the rest with the branches. tips: [n, 3] where leaf clusters hang."""

    root: Shape
    bark: Shape
    tips: np.ndarray


@dataclass(frozen=True)
class Cards:
    """Leaf cards and the metres [n] that wind moves each of their points by."""

    shape: Shape
    reach: np.ndarray


def limb(line: np.ndarray, radii: np.ndarray, sides: int, around: float, per_metre: float, bulge=None) -> Shape:
    """A tapered tube along a polyline [n, 3]; st: u from 0 to `around` about it, v along it. bulge: of angle and height."""
    tangents = unit(np.gradient(line, axis=0))
    side = np.array([1.0, 0, 0]) if abs(tangents[0][0]) < 0.8 else np.array([0, 0, 1.0])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    rows, st = [], []
    for place, tangent, radius, s in zip(line, tangents, radii, along, strict=True):
        side = unit(side - tangent * (side @ tangent))
        normal = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(tangent, side)
        factor = bulge(angle, place[1])[:, None] if bulge else 1.0
        rows.append(place + radius * factor * normal)
        st.append(np.stack([angle / (2 * np.pi) * around, np.full(sides + 1, s * per_metre)], axis=-1))
    points = np.array(rows)
    du = np.gradient(points, axis=1)
    du[:, 0] = du[:, -1] = (points[:, 1] - points[:, -2]) / 2  # closed
    normals = unit(np.cross(du, np.gradient(points, axis=0)))
    outwards = np.sum(normals * (points - line[:, None]), axis=-1, keepdims=True)
    normals = np.where(outwards.mean() < 0, -normals, normals)
    index = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    first, second, third = (points.reshape(-1, 3)[faces[:, k]] for k in range(3))
    if np.mean(np.sum(np.cross(second - first, third - first) * normals.reshape(-1, 3)[faces[:, 0]], axis=-1)) < 0:
        faces = faces[:, ::-1]
    return Shape(points.reshape(-1, 3), normals.reshape(-1, 3), np.concatenate(st), faces)


def _trunk_line(rng, height: float, bend: float, low: float, high: float, count: int) -> np.ndarray:
    phase, turn = rng.uniform(0, 2 * np.pi, 2), rng.uniform(0, 2 * np.pi)
    y = np.linspace(low, high, count)
    t = np.maximum(y, 0) / height
    off = bend * (t**1.4 + 0.25 * np.sin(5 * t + phase[0]) * t)
    drift = 0.35 * bend * np.sin(3.4 * t + phase[1]) * t
    return np.stack([off * np.sin(turn) + drift * np.cos(turn), y, off * np.cos(turn) - drift * np.sin(turn)], axis=-1)


def tree(
    seed: int, height: float, radius: float, *, branches: int, lowest: float, spread: float, bend: float, flare: float,
    sides: int = 18, rings: int = 26, twigs: int = 2,
) -> Tree:  # fmt: skip
    """A tree that stands at the origin. lowest: share of the height where branches begin; spread: metres they reach."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, 4)
    lobes = 4 + seed % 3

    def bulge(angle: np.ndarray, y: float) -> np.ndarray:
        low = flare * np.exp(-max(y + 0.1, 0) / 0.34)
        ridges = 0.5 + 0.5 * np.cos(lobes * angle + phase[0] + 0.6 * y) * (1 + 0.3 * np.cos(2 * angle + phase[1]))
        lumps = 0.05 * np.cos(3 * angle + phase[2] + 2.2 * y) + 0.035 * np.cos(5 * angle - phase[3] + 3.7 * y)
        return 1 + low * (0.35 + 1.1 * ridges) + lumps

    def thickness(y: np.ndarray) -> np.ndarray:
        return radius * np.maximum(1 - 0.86 * np.maximum(y, 0) / height, 0.05)

    def part(low: float, high: float, count: int) -> np.ndarray:
        return _trunk_line(np.random.default_rng(seed + 1), height, bend, low, high, count)

    around = max(1, round(2 * np.pi * radius / 1.1))
    foot, rest = part(-0.25, ROOT_HEIGHT, 13), part(ROOT_HEIGHT, height, rings)
    root = limb(foot, thickness(foot[:, 1]), sides, around, 1.0, bulge)
    st = np.stack([root.st[:, 0], np.repeat(np.clip(foot[:, 1], 0.01, None) / ROOT_HEIGHT * 0.98 + 0.005, sides + 1)], axis=-1)
    root = Shape(root.points, root.normals, st, root.faces)
    bark = limb(rest, thickness(rest[:, 1]), sides, around, 1 / ROOT_HEIGHT, bulge)
    bark = Shape(bark.points, bark.normals, bark.st - [0, 0.015], bark.faces)
    rng = np.random.default_rng(seed + 2)
    limbs, tips = [bark], [rest[-1]]
    azimuth = rng.uniform(0, 2 * np.pi)
    for k in range(branches):
        share = lowest + (0.96 - lowest) * (k + rng.uniform(0, 0.6)) / branches
        azimuth += 2.4 + rng.normal(0, 0.3)
        start = part(share * height, share * height + 1e-3, 2)[0]
        length = spread * (1.05 - 0.75 * (share - lowest) / (1 - lowest)) * rng.uniform(0.75, 1.2)
        tips += _branch(limbs, rng, start, azimuth, length, float(thickness(np.array(start[1]))) * 0.42, twigs)
    return Tree(root, merged(limbs), np.array(tips))


def _branch(limbs: list, rng, start, azimuth: float, length: float, radius: float, twigs: int) -> list:
    out = np.array([np.sin(azimuth), 0, np.cos(azimuth)])
    aside = np.array([out[2], 0, -out[0]])
    t = np.linspace(0, 1, 7)[:, None]
    rise, wander = rng.uniform(0.2, 0.7), rng.normal(0, 0.16, 2)
    line = start + length * (t * out + (rise * t - 0.18 * t**2) * [0, 1, 0] + wander[0] * np.sin(3 * t) * t * aside)
    radius = max(min(radius, 0.04 + 0.022 * length), 0.018)
    limbs.append(limb(line, radius * np.linspace(1.15, 0.28, 7), 6, 1, 1 / ROOT_HEIGHT))
    tips = [line[-1], line[4] + rng.normal(0, 0.12, 3)] if length > 1.4 else [line[-1]]
    for j in range(twigs):
        root = line[3 + j]
        angle = azimuth + (-1) ** j * rng.uniform(0.5, 1.0)
        reach = 0.42 * length * rng.uniform(0.7, 1.2)
        end = root + reach * np.array([np.sin(angle), rng.uniform(0.1, 0.6), np.cos(angle)])
        bent = np.array([root, (root + end) / 2 + [0, 0.06, 0], end])
        limbs.append(limb(bent, radius * np.array([0.5, 0.36, 0.2]), 5, 1, 1 / ROOT_HEIGHT))
        tips.append(end)
    return tips


def cluster(
    seed: int, cards: int, radius: float, flat: float, size: float, reach: float, leaves: int, solid: np.ndarray
) -> Cards:
    """Cards in a flattened ball about the origin, and single leaves without holes within it, which end most rays; wind moves
    the outer ends most. solid: [n, 2] places in the image whose neighbourhood is opaque."""
    rng = np.random.default_rng(seed)
    directions = unit(rng.normal(size=(cards, 3)))
    places = directions * rng.uniform(0.3, 1, (cards, 1)) ** (1 / 2.2) * radius * np.array([1, flat, 1])
    shapes, reaches = [], []
    for place in places:
        outward = unit(place * [1, 1.4, 1] + rng.normal(0, 0.35 * radius, 3) + [0, 0.25 * radius, 0])
        normal = unit(np.array([0, 0.75, 0]) + 0.6 * unit(place) + rng.normal(0, 0.45, 3))
        across = unit(np.cross(outward, normal))
        normal = np.cross(across, outward)
        span = size * rng.uniform(0.75, 1.2)
        corners = np.array([(-0.2, 0.1), (0.2, 0.1), (0.5, 1), (-0.5, 1)])  # the image's lower corners are empty
        st = corners + [0.5, 0]
        st = st * [-1, 1] + [1, 0] if rng.random() < 0.5 else st
        points = place + span * (corners[:, :1] * across + (corners[:, 1:] - 0.35) * outward)
        points[2:] += span * 0.16 * -normal
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        if np.cross(points[1] - points[0], points[2] - points[0]) @ normal < 0:
            faces = faces[:, ::-1]
        smooth = unit(normal + 0.9 * unit(points + [0, 0.5 * radius, 0]))
        shapes.append(Shape(points, smooth, st, faces))
        reaches.append(reach * (0.35 + 0.65 * np.linalg.norm(place) / radius) * np.array([0.7, 0.7, 1.15, 1.15]))
    for _ in range(leaves):
        place = unit(rng.normal(size=3)) * rng.uniform(0.1, 0.92) ** 0.5 * radius * np.array([1, flat, 1])
        normal = unit(np.array([0, 0.7, 0]) + 0.5 * unit(place) + rng.normal(0, 0.5, 3))
        along = unit(np.cross(normal, rng.normal(size=3)))
        across, long = np.cross(along, normal), size * rng.uniform(0.16, 0.27)
        half = 0.3 * long * across - 0.08 * long * normal
        points = place + np.array(
            [-long * along, half - 0.1 * long * along, long * along, -half - 0.12 * long * across - 0.1 * long * along]
        )
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        if np.cross(points[1] - points[0], points[2] - points[0]) @ normal < 0:
            faces = faces[:, ::-1]
        st = solid[int(rng.integers(len(solid)))] + 0.012 * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
        shapes.append(Shape(points, unit(normal + 0.9 * unit(points + [0, 0.5 * radius, 0])), st, faces))
        reaches.append(np.full(4, reach * (0.35 + 0.5 * np.linalg.norm(place) / radius)))
    return Cards(merged(shapes), np.concatenate(reaches))


def crown(seed: int, tips: np.ndarray, leaves: int, size: float, radius: float) -> Shape:
    """The leaves of a tree far away, as one mesh without mask: triangles about every tip, lit as a ball would be."""
    rng, shapes = np.random.default_rng(seed), []
    for tip in tips:
        directions = unit(rng.normal(size=(leaves, 3)))
        middles = directions * rng.uniform(0.2, 1, (leaves, 1)) ** 0.5 * radius * [1, 0.6, 1]
        across, along = unit(rng.normal(size=(leaves, 3))), unit(rng.normal(size=(leaves, 3)) * [1, 0.6, 1])
        span = size * rng.uniform(0.5, 1.25, (leaves, 1))
        corners = np.stack([middles - span * along, middles + 0.9 * span * across, middles + span * along], axis=1).reshape(
            -1, 3
        )
        faces = np.arange(3 * leaves).reshape(-1, 3)
        normals = np.repeat(unit(directions + [0, 0.5, 0]), 3, axis=0)
        a, b, c = (corners[faces[:, k]] for k in range(3))
        turned = np.sum(np.cross(b - a, c - a) * normals[::3], axis=1) < 0
        st = np.tile([(0.45, 0.5), (0.5, 0.55), (0.55, 0.5)], (leaves, 1)) + np.repeat(
            rng.uniform(-0.1, 0.1, (leaves, 2)), 3, axis=0
        )
        shapes.append(Shape(corners + tip, normals, st, np.where(turned[:, None], faces[:, ::-1], faces)))
    return merged(shapes)
