"""What people wear beside clothes: hats, scarves, and the shirts and ties in the V of a jacket."""

import numpy as np
from scenes.making.shapes import ball, lathe, sheet

from .body import Top, torso_ring, trunk_weights
from .cloth import Cloth, Piece, joined, rigid
from .skeleton import Build, joints_of


def _crown(build: Build) -> tuple[np.ndarray, float]:
    size = build.head * build.height
    return joints_of(build)["head"] + np.array([0, 0.012, 0.004]) * build.height, size


def hat(build: Build, cut: Top) -> Piece:
    chin, size = _crown(build)
    profile = [
        (0.17, 0.178),
        (0.172, 0.184),
        (0.1, 0.186),
        (0.097, 0.188),
        (0.097, 0.188),
        (0.1, 0.215),
        (0.098, 0.215),
        (0.096, 0.26),
        (0.08, 0.285),
        (0.0, 0.275),
    ]
    crown = lathe(profile, 20).scaled(0.96, 1, 1.14).scaled(size, size, size).turned("x", -5)
    band = lathe([(0.102, 0.189), (0.102, 0.212)], 20).scaled(0.96, 1, 1.14).scaled(size, size, size).turned("x", -5)
    place = chin + size * np.array([0, 0.0, -0.026])
    return joined([rigid(crown.at(*place), "head"), rigid(band.at(*place), "head", (0.3, 0.28, 0.28))])


def beanie(build: Build, cut: Top) -> Piece:
    chin, size = _crown(build)
    profile = [
        (0.094, 0.165),
        (0.101, 0.167),
        (0.103, 0.2),
        (0.097, 0.203),
        (0.097, 0.22),
        (0.082, 0.256),
        (0.045, 0.278),
        (0.0, 0.283),
    ]
    shape = lathe(profile, 18).scaled(0.9, 1, 1.09).scaled(size, size, size).turned("x", -9)
    pompom = ball(0.035, 8, 6).scaled(size, size, size).at(0, 0.288 * size, 0.0)
    place = chin + size * np.array([0, 0.0, -0.03])
    return joined([rigid(shape.at(*place), "head"), rigid(pompom.at(*place), "head", (0.85, 0.85, 0.85))])


def cap(build: Build, cut: Top) -> Piece:
    chin, size = _crown(build)
    dome = lathe([(0.092, 0.176), (0.098, 0.178), (0.096, 0.215), (0.075, 0.25), (0.04, 0.266), (0, 0.27)], 18).scaled(
        0.9, 1, 1.1
    )
    turn = np.linspace(-1.15, 1.15, 9)
    rows = [
        np.stack(
            [
                0.088 * np.sin(turn) * (1 + 0.1 * t),
                0.183 - 0.02 * t - 0.02 * t * np.abs(turn) ** 2,
                0.1 * np.cos(turn) + 0.085 * t * np.cos(turn) ** 0.7,
            ],
            axis=-1,
        )
        for t in (0.0, 0.5, 1.0)
    ]
    peak = sheet(np.array(rows), np.zeros((3, 9, 2)))
    place = chin + size * np.array([0, 0.0, -0.022])
    return joined([rigid(part.scaled(size, size, size).turned("x", -4).at(*place), "head") for part in (dome, peak)])


def scarf(build: Build, cut: Top) -> Piece:
    h, turn = build.height, np.arange(14) * 2 * np.pi / 14
    cloth = Cloth()
    centre = joints_of(build)["neck"] + np.array([0, 0.02, 0.004]) * h
    rings = []
    for a in np.arange(8) * 2 * np.pi / 8:
        r = 0.085 + 0.026 * np.cos(a) + cut.ease * 0.4
        y = 0.042 * np.sin(a) - 0.018 * np.cos(turn)
        points = centre + h * np.stack([r * np.sin(turn), y, (r * 1.02) * np.cos(turn)], axis=1)
        rings.append(cloth.ring(points, points[:, :2] * 0.7, {"chest": 0.65, "neck": 0.35}, 0.75 + 0.25 * (np.cos(a) > -0.2)))
    for a, b in zip(rings, rings[1:] + rings[:1], strict=True):
        cloth.bridge(a, b)
    for x, length in ((0.035, 0.3), (-0.02, 0.2)):
        strip = []
        for t in np.linspace(0, 1, 5):
            y = 1.455 - length * t
            z = torso_ring(build, y * h, (cut.ease + 0.022) * h, np.array([0.0]))[0, 2]
            xs = np.array([-0.035, 0.0, 0.035]) * h
            points = np.stack([x * h + xs + 0.02 * h * t, np.full(3, y * h), z + np.array([-0.008, 0.004, -0.008]) * h], axis=1)
            strip.append(cloth.ring(points, points[:, :2] * 0.7, trunk_weights(build, points)))
        for high, low in zip(strip, strip[1:], strict=False):
            cloth.bridge(low, high, closed=False)
    return cloth.piece()


def shirt(build: Build, cut: Top) -> Piece:
    """What shows in the V of a jacket: a shirt's front and collar."""
    h, cloth, rings = build.height, Cloth(), []
    low = 1.475 - max(cut.neckline, 0.08)
    for t in np.linspace(0, 1, 7):
        y = low + (1.478 - low) * t
        half = (0.002 + 0.05 * t) * h
        xs = np.linspace(-half, half, 5)
        front = torso_ring(build, y * h, (cut.ease if y < 1.47 else 0.5 * cut.ease) * h + 0.0055 * h, np.array([0.0]))[0, 2]
        points = np.stack([xs, np.full(5, y * h), front - 3.0 * xs**2 / h - 0.012 * h * t**2], axis=1)
        rings.append(cloth.ring(points, points[:, :2], trunk_weights(build, points)))
    for a, b in zip(rings, rings[1:], strict=False):
        cloth.bridge(a, b, closed=False)
    turn, last = np.arange(14) * 2 * np.pi / 14, None
    for y, r in ((1.486, 0.078), (1.515, 0.066), (1.528, 0.063), (1.52, 0.058)):
        points = np.stack([r * np.sin(turn) * h, (y + 0.012 * -np.cos(turn)) * h, (r * np.cos(turn) - 0.018) * h], axis=1)
        ring = cloth.ring(points, points[:, :2], {"chest": 0.5, "neck": 0.5})
        if last is not None:
            cloth.bridge(last, ring)
        last = ring
    return cloth.piece()


def tie(build: Build, cut: Top) -> Piece:
    h, cloth, rings = build.height, Cloth(), []
    low = 1.475 - max(cut.neckline, 0.08)
    for t, half in ((0.0, 0.004), (0.12, 0.022), (0.6, 0.018), (0.88, 0.011), (0.94, 0.02), (1.0, 0.017)):
        y = low + (1.482 - low) * t
        front = (
            torso_ring(build, y * h, (cut.ease if y < 1.47 else 0.5 * cut.ease) * h + 0.011 * h, np.array([0.0]))[0, 2]
            - 0.012 * h * t**2
        )
        points = np.stack(
            [np.array([-half, 0, half]) * h, np.full(3, y * h), front + np.array([-0.003, 0.002, -0.003]) * h], axis=1
        )
        rings.append(cloth.ring(points, points[:, :2], trunk_weights(build, points)))
    for a, b in zip(rings, rings[1:], strict=False):
        cloth.bridge(a, b, closed=False)
    return cloth.piece()
