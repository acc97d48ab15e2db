"""The objects of a glTF: each primitive of each node, with its mesh and with what moves it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Deformed, Mesh
from .gltf_document import Document
from .gltf_materials import references, sets_of
from .gltf_meshes import build_mesh, read_vertices
from .gltf_nodes import NodeTree, node_matrices, property_at, relative_matrices
from .gltf_skins import Shape, Skin, deform, most_weighted, read_shape, read_skin, skinning


@dataclass(frozen=True, kw_only=True)
class Part:
    """One primitive of one node: an object. mesh: its index. shape: its vertices before they move, where they do.
    target_weights: [targets], those that hold where none are animated. anchor: the joint of most weight, whose place is the
    origin of a skinned object's space, so that float32 holds the figure wherever its skeleton walks. node_from_instance:
    [4, 4], of one of many instances."""

    node: int
    mesh: int
    shape: Shape | None = None
    target_weights: NDArray[np.float64]
    skin: Skin | None = None
    anchor: int = 0
    node_from_instance: NDArray[np.float64] | None = None

    @property
    def place(self) -> int | None:
        """The node in whose axes the object stands; None for the world's."""
        return self.node if self.skin is None else self.skin.root


class PartReader:
    """Primitives of one file; `meshes` and `not_read` grow as nodes ask for them. What stands still and has no skin is shared
    by nodes."""

    def __init__(self, document: Document, tree: NodeTree) -> None:
        self.meshes: list[Mesh] = []
        self.not_read: list[str] = []
        self._document, self._tree = document, tree
        self._skins = lru_cache(maxsize=None)(lambda index: read_skin(document, index, tree))
        self._shared: dict[tuple, int] = {}

    def part(self, node: int, number: int, primitive: dict[str, Any], name: str, material: dict[str, Any]) -> Part:
        """Primitive `number` of the node's mesh. material: its JSON. Raises InputError naming the file and the place in its
        JSON."""
        source = self._document.entry("nodes", node)
        field = f"meshes[{source['mesh']}].primitives[{number}]"
        weights = self._target_weights(node, primitive, field)
        skin = self._skins(source["skin"]) if "skin" in source else None
        deforms = "weights" in self._tree.channels.get(node, {}) or skin is not None and skin.deforms
        key = source["mesh"], number, weights.tobytes(), node if deforms or skin is not None else None
        if key in self._shared:
            return Part(node=node, mesh=self._shared[key], target_weights=weights)
        self._shared[key] = mesh = len(self.meshes)
        if deforms or skin is not None or weights.any():
            shape = read_shape(self._document, primitive, len(skin.joints) if skin else 0, field)
            anchor = most_weighted(shape) if skin else 0
            part = Part(node=node, mesh=mesh, shape=shape, target_weights=weights, skin=skin, anchor=anchor)
            vertices = deform(shape, weights, self._object_from_bind(part) if skin else None)
            part = part if deforms else replace(part, shape=None)
        else:
            part = Part(node=node, mesh=mesh, target_weights=weights)
            vertices = read_vertices(self._document, primitive, field)
        as_stored = not (deforms or skin is not None or weights.any())
        self._say(primitive, name, material, as_stored)
        self.meshes.append(
            build_mesh(
                self._document,
                primitive,
                vertices,
                name=name,
                sets=sets_of(material),
                tangents=as_stored and "normalTexture" in references(material),
                deforms=deforms,
                field=field,
            )
        )
        return part

    def _target_weights(self, node: int, primitive: dict[str, Any], field: str) -> NDArray[np.float64]:
        """[targets] at time 0: the node's, else the mesh's, else 0."""
        weights, targets = property_at(self._tree, node, "weights", 0.0), primitive.get("targets", ())
        if weights is None:
            mesh = self._document.entry("meshes", self._document.entry("nodes", node)["mesh"])
            weights = np.array(mesh.get("weights") or [0.0] * len(targets), dtype=float)
        if len(weights) != len(targets):
            problem = f"{len(weights)} weights of node {node} for {len(targets)} morph targets"
            raise InputError(problem, file=self._document.file, field=field)
        return weights

    def _object_from_bind(self, part: Part) -> NDArray[np.float64]:
        local, _ = node_matrices(self._tree, 0.0)
        return skinning(part.skin, part.anchor, relative_matrices(self._tree, local, part.skin.root, part.skin.joints))[1]

    def _say(self, primitive: dict[str, Any], name: str, material: dict[str, Any], as_stored: bool) -> None:
        """Names what the material reads and the mesh has not, or has and is not drawn."""
        lacking = [number for number in sets_of(material) if f"TEXCOORD_{number}" not in primitive["attributes"]]
        self.not_read += [f"textures of {name} by TEXCOORD_{number}, which its mesh lacks" for number in lacking]
        if "TANGENT" in primitive["attributes"] and "normalTexture" in references(material) and not as_stored:
            self.not_read.append(f"tangents of {name}, whose vertices move: they are taken from its texture coordinates")


def motion_of(tree: NodeTree, parts: list[Part], deforming: list[Part], matrices: Callable) -> tuple[Callable, Callable]:
    """The functions of time `world_from_object` and `deformed` of the scene's description. matrices: of the time to
    parent_from_node and world_from_node of all nodes."""
    vertices = {part.mesh: _remembering(part) for part in deforming}
    skinned = [(index, part) for index, part in enumerate(parts) if part.skin is not None]
    skins = dict.fromkeys(part.skin for _, part in skinned)
    places = np.array([-1 if part.place is None else part.place for part in parts])
    repeated = [index for index, part in enumerate(parts) if part.node_from_instance is not None]
    node_from_instance = np.array([parts[index].node_from_instance for index in repeated]).reshape(-1, 4, 4)

    @lru_cache(maxsize=4)
    def joints_at(time_s: float) -> dict[Skin, NDArray[np.float64]]:
        """root_from_joint [joints, 4, 4] of every skin."""
        local = matrices(time_s)[0]
        return {skin: relative_matrices(tree, local, skin.root, skin.joints) for skin in skins}

    def world_from_object(time_s: float) -> NDArray[np.float64]:
        world = matrices(float(time_s))[1]
        found = np.where(places[:, None, None] < 0, np.eye(4), world[places])
        if repeated:
            found[repeated] = found[repeated] @ node_from_instance
        for index, part in skinned:
            origin, _ = skinning(part.skin, part.anchor, joints_at(float(time_s))[part.skin])
            found[index, :3, 3] += found[index, :3, :3] @ origin
        return found

    def deformed(time_s: float) -> dict[int, Deformed]:
        joints = joints_at(float(time_s))
        found = {}
        for part in deforming:
            animated = "weights" in tree.channels.get(part.node, {})
            weights = property_at(tree, part.node, "weights", time_s) if animated else part.target_weights
            bound = skinning(part.skin, part.anchor, joints[part.skin])[1].tobytes() if part.skin else None
            found[part.mesh] = vertices[part.mesh](weights.tobytes(), bound)
        return found

    return world_from_object, deformed


def _remembering(part: Part) -> Callable[[bytes, bytes | None], Deformed]:
    """The part's vertices from its weights and matrices; two results are kept, for a frame and the one before it."""

    @lru_cache(maxsize=2)
    def vertices(weights: bytes, joints: bytes | None) -> Deformed:
        object_from_bind = np.frombuffer(joints).reshape(-1, 4, 4) if joints is not None else None
        return deform(part.shape, np.frombuffer(weights), object_from_bind)

    return vertices
