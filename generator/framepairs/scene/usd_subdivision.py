"""Subdivision surfaces: Catmull-Clark, Loop and bilinear refinement of positions and of primvars of every interpolation.

Face-varying data follow OpenSubdiv's rules ("Face-varying interpolation rules" of its documentation) as a mesh of their own,
whose seams are boundaries. Where several semi-sharp creases end at one point of a seam, the rules are only alike.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .usd_subdivision_steps import INFINITE, Net, Scheme, Step, linear_triangles, net_of, split, split_triangles, step_of

FaceVaryingRule = Literal["none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"]


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """corners: [Q, 4 or 3] refined vertices of each face; face: [Q] the control face that it comes from."""

    corners: NDArray[np.int64]
    face: NDArray[np.int64]
    steps: tuple[Step, ...]

    @property
    def size(self) -> int:
        """How many refined vertices there are."""
        return self.steps[-1].direct.shape[0] + self.steps[-1].faces.shape[0]

    def __call__(self, values: NDArray) -> NDArray[np.float64]:
        """Refined values [R, k] from those of the control net's vertices [V, k]."""
        for step in self.steps:
            values = step(values)
        return values


def refine(net: Net, levels: int, scheme: Scheme, *, linear: bool = False, smooth_triangles: bool = False) -> Refinement:
    """The net refined `levels` times (at least once); linear: by the topology of the scheme, with points on straight lines."""
    steps, face, triangles = [], np.arange(len(net.counts)), scheme == "loop"
    for _ in range(levels):
        straight = linear_triangles(net) if triangles and linear else None
        steps.append(straight or step_of(net, "bilinear" if linear else scheme, smooth_triangles))
        face = np.repeat(face, 4) if triangles else face[net.face]
        net = split_triangles(net) if triangles else split(net)
    return Refinement(corners=net.vertex.reshape(len(net.counts), -1), face=face, steps=tuple(steps))


def refined_corners(net: Net, levels: int, scheme: Scheme) -> NDArray[np.int64]:
    """Only the vertices [Q, 4 or 3] of the refined faces, in the order of `refine`."""
    for _ in range(levels):
        net = split_triangles(net) if scheme == "loop" else split(net)
    return net.vertex.reshape(len(net.counts), -1)


def value_net(net: Net, element: NDArray[np.int64], rule: FaceVaryingRule) -> tuple[Net, NDArray[np.int64]]:
    """The net of a face-varying primvar: its vertices are the different values at each vertex of the net, its seams are
    boundaries. element: [C] the value at each corner. Gives the net and the element of each of its vertices."""
    keys, vertex = np.unique(net.vertex * (element.max(initial=0) + 1) + element, return_inverse=True)
    owner, chosen = keys // (element.max(initial=0) + 1), keys % (element.max(initial=0) + 1)
    found = net_of(net.counts, vertex, len(keys), net.edge_sharpness[net.edge], net.vertex_sharpness[owner])
    edges_at = np.bincount(found.ends.reshape(-1), minlength=len(keys))
    faces_at = np.bincount(vertex, minlength=len(keys))
    fans = np.maximum(edges_at - faces_at, 1)  # separate groups of faces that take the same value
    regions = np.bincount(owner, fans, net.size)[owner]
    on_seam, seam_inside = np.zeros(len(keys), bool), np.zeros(len(keys), bool)
    on_seam[found.ends[found.faces_at == 1]] = True
    inside = (found.faces_at[found.edge] == 1) & (net.faces_at[net.edge] == 2)
    seam_inside[found.ends[found.edge[inside]]] = True
    pinned = np.zeros(len(keys), bool)
    if rule == "boundaries":
        pinned = on_seam
    elif rule != "none":
        pinned |= (faces_at == 1) & on_seam
    if rule in ("cornersPlus1", "cornersPlus2"):
        pinned |= regions > 2
    if rule == "cornersPlus2":
        corner_at = np.bincount(owner, pinned, net.size)[owner] > 0
        pinned |= (regions == 2) & corner_at | (regions == 1) & seam_inside
    sharpness = found.vertex_sharpness
    if rule in ("cornersPlus1", "cornersPlus2"):  # of two regions, both are as sharp as the creases that end in either
        ending = np.where(found.faces_at == 2, found.edge_sharpness, 0)
        crease_at = np.zeros(net.size)
        np.maximum.at(crease_at, owner[found.ends.reshape(-1)], np.repeat(ending, 2))
        sharpness = np.where((regions == 2) & on_seam, np.maximum(sharpness, crease_at[owner]), sharpness)
    return replace(found, vertex_sharpness=np.where(pinned, INFINITE, sharpness)), chosen


def smooth_groups(net: Net, sharpness: float) -> NDArray[np.int64]:
    """For each corner the group [C] of corners at its vertex that share a normal: those that meet over edges less sharp."""
    order = np.argsort(net.edge, kind="stable")
    starts = np.cumsum(net.faces_at) - net.faces_at
    joined = np.flatnonzero((net.faces_at == 2) & (net.edge_sharpness < sharpness))
    first, second = order[starts[joined]], order[starts[joined] + 1]
    turned = net.vertex[first] != net.vertex[second]  # neighbours that agree on which side is outside
    ahead = np.where(turned, net.following[second], second)
    behind = np.where(turned, second, net.following[second])
    rows, columns = np.concatenate([first, net.following[first]]), np.concatenate([ahead, behind])
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(len(net.vertex),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)
