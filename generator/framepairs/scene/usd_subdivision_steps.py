"""One refinement of a subdivision surface: topology, and the sparse matrices that give the new points from the old ones.

Sources: Catmull and Clark, "Recursively generated B-spline surfaces on arbitrary topological meshes" (1978); Loop, "Smooth
Subdivision Surfaces Based on Triangles" (1987); DeRose, Kass and Truong, "Subdivision Surfaces in Character Animation" (1998),
section 3 (semi-sharp creases); OpenSubdiv's documentation of boundaries and of the blending of rules where a crease ends
between two levels, against which the results were compared.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

INFINITE = 10.0  # sharpness that does not fade (OpenSubdiv, UsdGeomMesh)
SMOOTH_TRIANGLE = 0.470  # weight of a triangle's point in the points of its edges under the `smooth` triangle rule
Scheme = Literal["catmullClark", "bilinear", "loop"]


@dataclass(frozen=True, kw_only=True)
class Net:
    """Polygons and what is sharp.

    counts: corners [F] of each face. vertex: [C] of each corner, of `size` in all. edge: [C] the edge from each corner to the
    next one; ends: [E, 2]. edge_sharpness: [E], vertex_sharpness: [size]; boundaries are infinitely sharp edges.
    """

    counts: NDArray[np.int64]
    vertex: NDArray[np.int64]
    size: int
    edge: NDArray[np.int64]
    ends: NDArray[np.int64]
    edge_sharpness: NDArray[np.float64]
    vertex_sharpness: NDArray[np.float64]

    @cached_property
    def face(self) -> NDArray[np.int64]:
        """The face [C] of each corner."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def following(self) -> NDArray[np.int64]:
        """The next corner [C] of the same face."""
        ends = np.cumsum(self.counts)
        out = np.arange(1, len(self.vertex) + 1)
        out[ends[self.counts > 0] - 1] = (ends - self.counts)[self.counts > 0]
        return out

    @cached_property
    def faces_at(self) -> NDArray[np.int64]:
        """How many faces each edge belongs to, [E]."""
        return np.bincount(self.edge, minlength=len(self.ends))


def net_of(counts: NDArray, vertex: NDArray, size: int, corner_sharpness: NDArray, vertex_sharpness: NDArray) -> Net:
    """A net whose edges are as sharp as the sharpest of their corners, [C], says. Edges of one face, or of more than two, are
    infinitely sharp."""
    bare = Net(
        counts=counts, vertex=vertex, size=size, edge=np.zeros(0, np.int64), ends=np.zeros((0, 2), np.int64),
        edge_sharpness=np.zeros(0), vertex_sharpness=vertex_sharpness,
    )  # fmt: skip
    other = vertex[bare.following]
    low, high = np.minimum(vertex, other), np.maximum(vertex, other)
    keys, edge = np.unique(low * max(size, 1) + high, return_inverse=True)
    ends = np.stack([keys // max(size, 1), keys % max(size, 1)], axis=1)
    sharpness = np.zeros(len(ends))
    np.maximum.at(sharpness, edge, corner_sharpness)
    net = replace(bare, edge=edge, ends=ends, edge_sharpness=sharpness)
    return replace(net, edge_sharpness=np.where(net.faces_at == 2, np.minimum(sharpness, INFINITE), INFINITE))


def crease_sharpness(counts: NDArray, vertex: NDArray, size: int, edges: NDArray, sharpness: NDArray) -> NDArray[np.float64]:
    """Sharpness [C] of the edge that follows each corner, from creased edges [K, 2] and their sharpness [K]."""
    net = net_of(counts, vertex, size, np.zeros(len(vertex)), np.zeros(size))
    keys = net.ends[:, 0] * size + net.ends[:, 1]
    wanted = edges.min(axis=1) * size + edges.max(axis=1)
    place = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    there = keys[place] == wanted if len(keys) else np.zeros(len(wanted), bool)
    of_edge = np.zeros(len(keys))
    np.maximum.at(of_edge, place[there], sharpness[there])
    return of_edge[net.edge]


@dataclass(frozen=True, kw_only=True)
class Step:
    """One refinement. The new vertices are the old ones, then one per edge, then one per face: `direct` [V + E, V] and
    `through` [V + E, F] give the first two from old vertices and face points, `faces` [F, V] gives the face points. Triangles
    have no face points."""

    faces: csr_array
    direct: csr_array
    through: csr_array

    def __call__(self, values: NDArray) -> NDArray:
        points = self.faces @ values
        return np.concatenate([self.direct @ values + self.through @ points, points])


def split(net: Net) -> Net:
    """The net of the next level: one quad per corner, which begins at the corner's vertex."""
    size, edges, corners = net.size, len(net.ends), len(net.vertex)
    before = np.empty(corners, np.int64)
    before[net.following] = np.arange(corners)
    here, last = net.edge, net.edge[before]
    quads = np.stack([net.vertex, size + here, size + edges + net.face, size + last], axis=1)

    def half(edge: NDArray) -> NDArray:
        return 2 * edge + (net.ends[edge, 0] != net.vertex)

    inner = 2 * edges + np.arange(corners)
    child_edges = np.stack([half(here), inner, inner[before], half(last)], axis=1)
    halves = np.stack([net.ends.reshape(-1), size + np.repeat(np.arange(edges), 2)], axis=1)
    spokes = np.stack([size + here, size + edges + net.face], axis=1)
    return Net(
        counts=np.full(corners, 4),
        vertex=quads.reshape(-1),
        size=size + edges + len(net.counts),
        edge=child_edges.reshape(-1),
        ends=np.concatenate([halves, spokes]),
        edge_sharpness=np.concatenate([np.repeat(_faded(net.edge_sharpness), 2), np.zeros(corners)]),
        vertex_sharpness=np.concatenate([_faded(net.vertex_sharpness), np.zeros(edges + len(net.counts))]),
    )


def split_triangles(net: Net) -> Net:
    """The net of triangles of the next level: of each one those at its corners and the one in its middle."""
    size, edges, faces = net.size, len(net.ends), len(net.counts)
    vertex, middle = net.vertex.reshape(-1, 3), size + net.edge.reshape(-1, 3)
    before = np.roll(middle, 1, axis=1)
    inner = 2 * edges + np.arange(3 * faces).reshape(-1, 3)  # from the middle of each edge to that of the one before
    here = 2 * net.edge + (net.ends[net.edge, 0] != net.vertex)
    last = 2 * np.roll(net.edge.reshape(-1, 3), 1, axis=1).reshape(-1)
    last += net.ends[last // 2, 0] != net.vertex
    outer = np.stack([vertex, middle, before], axis=2)
    outer_edges = np.stack([here.reshape(-1, 3), inner, last.reshape(-1, 3)], axis=2)
    central_edges = np.roll(inner, -1, axis=1)
    halves = np.stack([net.ends.reshape(-1), size + np.repeat(np.arange(edges), 2)], axis=1)
    sides = np.stack([middle.reshape(-1), before.reshape(-1)], axis=1)
    return Net(
        counts=np.full(4 * faces, 3),
        vertex=np.concatenate([outer, middle[:, None]], axis=1).reshape(-1),
        size=size + edges,
        edge=np.concatenate([outer_edges, central_edges[:, None]], axis=1).reshape(-1),
        ends=np.concatenate([halves, sides]),
        edge_sharpness=np.concatenate([np.repeat(_faded(net.edge_sharpness), 2), np.zeros(3 * faces)]),
        vertex_sharpness=np.concatenate([_faded(net.vertex_sharpness), np.zeros(edges)]),
    )


def _faded(sharpness: NDArray) -> NDArray[np.float64]:
    return np.where(sharpness >= INFINITE, INFINITE, np.maximum(sharpness - 1, 0))


def _face_points(net: Net) -> csr_array:
    weights = np.repeat(1 / np.maximum(net.counts, 1), net.counts)
    starts = np.concatenate([[0], np.cumsum(net.counts)])
    return csr_array((weights, net.vertex, starts), shape=(len(net.counts), net.size))


def step_of(net: Net, scheme: Scheme, smooth_triangles: bool = False) -> Step:
    """One step of a scheme; `loop` and what is refined linearly beside it ask for triangles."""
    if scheme == "bilinear":
        return _bilinear_step(net, _face_points(net))
    return _loop_step(net) if scheme == "loop" else _catmull_clark_step(net, smooth_triangles)


def linear_triangles(net: Net) -> Step:
    """One linear step on triangles."""
    return _bilinear_step(net, csr_array((0, net.size)))


def _bilinear_step(net: Net, faces: csr_array) -> Step:
    size, edges = net.size, len(net.ends)
    rows = np.concatenate([np.arange(size), np.repeat(np.arange(size, size + edges), 2)])
    columns = np.concatenate([np.arange(size), net.ends.reshape(-1)])
    weights = np.concatenate([np.ones(size), np.full(2 * edges, 0.5)])
    direct = coo_array((weights, (rows, columns)), shape=(size + edges, size)).tocsr()
    return Step(faces=faces, direct=direct, through=csr_array((size + edges, faces.shape[0])))


def _catmull_clark_step(net: Net, smooth_triangles: bool) -> Step:
    size, edges = net.size, len(net.ends)
    corner, crease_before, crease_after, smooth = _vertex_rules(net)
    valence = np.maximum(np.bincount(net.ends.reshape(-1), minlength=size), 1)
    spread = smooth / valence**2
    own = corner + 0.75 * (crease_before + crease_after) + smooth * (valence - 2) / valence
    sharp = np.clip(net.edge_sharpness, 0, 1)
    to_face = _weights_of_faces(net, smooth_triangles) * (1 - sharp)
    to_end = 0.5 - to_face
    starts, ends = net.ends.reshape(-1), net.ends[:, ::-1].reshape(-1)  # each edge from either side
    ring = spread[starts] + _crease_ring(net, crease_before, crease_after)
    number = np.arange(size, size + edges)
    rows = np.concatenate([np.arange(size), starts, np.repeat(number, 2)])
    columns = np.concatenate([np.arange(size), ends, starts])
    weights = np.concatenate([own, ring, np.repeat(to_end, 2)])
    direct = coo_array((weights, (rows, columns)), shape=(size + edges, size)).tocsr()
    rows, columns = np.concatenate([net.vertex, number[net.edge]]), np.concatenate([net.face, net.face])
    weights = np.concatenate([spread[net.vertex], to_face[net.edge]])
    through = coo_array((weights, (rows, columns)), shape=(size + edges, len(net.counts))).tocsr()
    return Step(faces=_face_points(net), direct=direct, through=through)


def _loop_step(net: Net) -> Step:
    size, edges = net.size, len(net.ends)
    corner, crease_before, crease_after, smooth = _vertex_rules(net)
    valence = np.maximum(np.bincount(net.ends.reshape(-1), minlength=size), 1)
    neighbour = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / valence) / 4) ** 2) / valence
    own = corner + 0.75 * (crease_before + crease_after) + smooth * (1 - valence * neighbour)
    sharp = np.clip(net.edge_sharpness, 0, 1)
    starts, ends = net.ends.reshape(-1), net.ends[:, ::-1].reshape(-1)
    ring = (smooth * neighbour)[starts] + _crease_ring(net, crease_before, crease_after)
    number, opposite = np.arange(size, size + edges), net.vertex[net.following[net.following]]
    rows = np.concatenate([np.arange(size), starts, np.repeat(number, 2), number[net.edge]])
    columns = np.concatenate([np.arange(size), ends, starts, opposite])
    weights = np.concatenate([own, ring, np.repeat(3 / 8 + sharp / 8, 2), (1 - sharp[net.edge]) / 8])
    direct = coo_array((weights, (rows, columns)), shape=(size + edges, size)).tocsr()
    return Step(faces=csr_array((0, size)), direct=direct, through=csr_array((size + edges, 0)))


def _crease_ring(net: Net, before: NDArray, after: NDArray) -> NDArray[np.float64]:
    """What each edge, from either side [2 E], gives to its start by the crease rules of this level and of the next."""
    starts = net.ends.reshape(-1)
    is_sharp, stays_sharp = (np.repeat(item > 0, 2) for item in (net.edge_sharpness, _faded(net.edge_sharpness)))
    return (is_sharp * before[starts] + stays_sharp * after[starts]) / 8


def _weights_of_faces(net: Net, smooth_triangles: bool) -> NDArray[np.float64]:
    """Weight [E] of each of the two face points in the point of a smooth edge."""
    if not smooth_triangles or not (net.counts == 3).any():
        return np.full(len(net.ends), 0.25)
    weights = np.where(net.counts == 3, SMOOTH_TRIANGLE, 0.25)
    return np.bincount(net.edge, weights[net.face], len(net.ends)) / np.maximum(net.faces_at, 1)


def _vertex_rules(net: Net) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Shares [V] of the rules for vertices: corner, crease along the edges that are sharp, crease along those that stay sharp,
    and smooth. Where sharpness runs out, the rules of this level and of the next are mixed by what is left of it."""
    faded_edges, faded_vertices = _faded(net.edge_sharpness), _faded(net.vertex_sharpness)
    before = _rule(net, net.edge_sharpness, net.vertex_sharpness)
    after = _rule(net, faded_edges, faded_vertices)
    ending = (net.edge_sharpness > 0) & (faded_edges == 0)
    both = np.repeat(ending, 2)
    total = np.bincount(net.ends.reshape(-1), both * np.repeat(net.edge_sharpness, 2), net.size)
    number = np.bincount(net.ends.reshape(-1), both, net.size)
    vertex_ends = (net.vertex_sharpness > 0) & (faded_vertices == 0)
    total, number = total + vertex_ends * net.vertex_sharpness, number + vertex_ends
    share = np.where(before == after, 1, np.minimum(total / np.maximum(number, 1), 1))
    of_before = [share * (before == kind) for kind in ("corner", "crease", "smooth")]
    of_after = [(1 - share) * (after == kind) for kind in ("corner", "crease", "smooth")]
    return of_before[0] + of_after[0], of_before[1], of_after[1], of_before[2] + of_after[2]


def _rule(net: Net, edge_sharpness: NDArray, vertex_sharpness: NDArray) -> NDArray[np.str_]:
    sharp = np.bincount(net.ends.reshape(-1), np.repeat(edge_sharpness > 0, 2), net.size)
    return np.where((vertex_sharpness > 0) | (sharp > 2), "corner", np.where(sharp == 2, "crease", "smooth"))
