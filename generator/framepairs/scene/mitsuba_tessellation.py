"""Mitsuba's analytic shapes as triangles in their own space, with Mitsuba's parametrisation (v turned to grow upwards).

Round ones are inscribed: with `SEGMENTS` around, a chord lies within 0.001 radii of its arc (1 - cos(pi / 72) = 0.00095).
Normals are those of the round shape. Front sides are counter-clockwise.
"""

import numpy as np
from numpy.typing import NDArray

from .description import Mesh

SEGMENTS = 72


def rectangle() -> Mesh:
    """-1 to 1 in x and y, facing +z; Mitsuba's uv grows with x and y."""
    return _grid("rectangle", np.array([-1.0, 1]), np.array([-1.0, 1]), _flat)


def cube() -> Mesh:
    """-1 to 1, facing out. Each side has its own uv."""
    # For each side: its normal, and the directions along which Mitsuba's u and v grow.
    sides = (
        ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
        ((0, 0, -1), (0, -1, 0), (1, 0, 0)),
        ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
        ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
    )
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    positions, normals, faces = [], [], []
    for index, (n, u, v) in enumerate(np.array(sides)):
        positions += [n + s * u + t * v for s, t in corners]
        normals += [n] * 4
        order = [0, 1, 2, 3] if np.dot(np.cross(u, v), n) > 0 else [3, 2, 1, 0]
        quad = 4 * index + np.array(order)
        faces += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    uv = np.tile((corners + 1) / 2, (6, 1))
    return _mesh("cube", np.array(positions), np.array(faces), np.array(normals), uv)


def sphere(center: NDArray[np.float64], radius: float) -> Mesh:
    """Mitsuba's u is the longitude around z from x, v the angle from +z."""

    def place(u: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
        phi, theta = 2 * np.pi * u, np.pi * v
        normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
        return center + radius * normal, normal

    turns, heights = np.linspace(0, 1, SEGMENTS + 1), np.linspace(0, 1, SEGMENTS // 2 + 1)
    return _without_slivers(_grid("sphere", turns, heights, place, turned=True))


def disk() -> Mesh:
    """Radius 1 around the origin, facing +z. Mitsuba's u is the distance from its centre, v the angle from x."""
    angles = 2 * np.pi * np.linspace(0, 1, SEGMENTS + 1)
    rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    positions = np.concatenate([rim, np.zeros((SEGMENTS, 3))])  # each triangle has a centre of its own, for its v
    steps = np.arange(SEGMENTS)
    faces = np.stack([steps, steps + 1, SEGMENTS + 1 + steps], axis=-1)
    u = np.concatenate([np.ones(SEGMENTS + 1), np.zeros(SEGMENTS)])
    v = np.concatenate([angles / (2 * np.pi), (steps + 0.5) / SEGMENTS])
    return _mesh("disk", positions, faces, np.tile([0.0, 0, 1], (len(positions), 1)), np.stack([u, v], axis=-1))


def cylinder(start: NDArray[np.float64], end: NDArray[np.float64], radius: float) -> Mesh:
    """Open at its ends, facing out. Mitsuba's u is the angle around the axis, v the place along it."""
    axis = end - start
    x, y = _across(axis / np.linalg.norm(axis))

    def place(u: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
        phi = 2 * np.pi * u[..., None]
        normal = np.cos(phi) * x + np.sin(phi) * y
        return start + v[..., None] * axis + radius * normal, normal

    return _grid("cylinder", np.linspace(0, 1, SEGMENTS + 1), np.array([0.0, 1]), place)


def _across(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two axes perpendicular to a unit vector: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017."""
    sign = np.copysign(1.0, z[2])
    a = -1 / (sign + z[2])
    b = z[0] * z[1] * a
    return np.array([1 + sign * z[0] ** 2 * a, sign * b, -sign * z[0]]), np.array([b, sign + z[1] ** 2 * a, -z[1]])


def _flat(u: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
    return np.stack([u, v, 0 * u], axis=-1), np.stack([0 * u, 0 * u, 0 * u + 1], axis=-1)


def _grid(name: str, us: NDArray, vs: NDArray, place, turned: bool = False) -> Mesh:
    """A mesh over a grid of parameters. turned: its front is clockwise in (u, v)."""
    u, v = np.meshgrid(us, vs)
    positions, normals = place(u, v)
    columns = len(us)
    corner = (np.arange(len(vs) - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=-1)
    quads = quads[:, ::-1] if turned else quads
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    uv = np.stack([(u - us[0]) / np.ptp(us), (v - vs[0]) / np.ptp(vs)], axis=-1)
    return _mesh(name, positions.reshape(-1, 3), faces, normals.reshape(-1, 3), uv.reshape(-1, 2))


def _mesh(name: str, positions: NDArray, faces: NDArray, normals: NDArray, uv: NDArray) -> Mesh:
    return Mesh(
        name=name,
        positions=positions.astype(np.float32),
        faces=np.ascontiguousarray(faces, dtype=np.uint32),
        normals=normals.astype(np.float32),
        uv=np.stack([uv[:, 0], 1 - uv[:, 1]], axis=-1).astype(np.float32),
    )


def _without_slivers(mesh: Mesh) -> Mesh:
    """Without the triangles at the poles that have no area."""
    corners = mesh.positions[mesh.faces.astype(np.int64)].astype(np.float64)
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    faces = mesh.faces[twice > 1e-5 * twice.max(initial=0)]
    return Mesh(name=mesh.name, positions=mesh.positions, faces=faces, normals=mesh.normals, uv=mesh.uv)
