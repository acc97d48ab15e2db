"""glTF 2.0 files (.gltf, .glb) as scenes: meshes, nodes, skins, morph targets, and one clip that moves them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Deformed, Mesh, SceneDescription, SceneObject, validate_mesh
from .gltf_accessors import read_integers, read_numbers
from .gltf_animation import NodeTree, clip_index, clip_names, node_matrices, property_at, read_tree, relative_matrices
from .gltf_document import Document, is_elsewhere, path_of, read_document
from .gltf_materials import ALLOWED_IF_REQUIRED, READ_EXTENSIONS, MaterialReader, image_of, is_told_by_materials
from .gltf_skins import Shape, Skin, deform, most_weighted, read_normals, read_shape, read_skin, skinning

SUFFIXES = (".gltf", ".glb")
TRIANGLES, STRIP, FAN = 4, 5, 6


@dataclass(frozen=True, kw_only=True)
class _Part:
    """One primitive of one node: an object. mesh: its index. shape: its vertices before they move, where they do.
    target_weights: [targets], those that hold where none are animated. anchor: the joint of most weight, whose place is the
    origin of a skinned object's space, so that float32 holds the figure wherever its skeleton walks."""

    node: int
    mesh: int
    shape: Shape | None = None
    target_weights: NDArray[np.float64]
    skin: Skin | None = None
    anchor: int = 0

    @property
    def place(self) -> int | None:
        """The node in whose axes the object stands; None for the world's."""
        return self.node if self.skin is None else self.skin.root


def load_gltf(file: Path, clip: str | None = None) -> SceneDescription:
    """Read a scene with one animation clip: the one named `clip` (a clip without a name goes by its number), else the first.

    A skinned object ignores its node's own transform, as glTF says; its object space has the axes of the node above all its
    joints. Raises InputError naming the file and the place in its JSON.
    """
    document = read_document(file)
    refused = [name for name in document.json.get("extensionsRequired", ()) if name not in ALLOWED_IF_REQUIRED]
    if refused:
        raise InputError(f"extension {refused[0]} is not read, and the file requires it", file=file)
    files = _files(document)
    chosen = clip_index(document, clip)
    tree = read_tree(document, chosen)
    reader, materials = _PartReader(document, tree), MaterialReader(document)
    objects: list[SceneObject] = []
    parts: list[_Part] = []
    for node, number, primitive, name in _drawn(document):
        part = reader.part(node, number, primitive, name)
        moves = reader.meshes[part.mesh].deforms or part.place is not None and bool(tree.moving[part.place])
        material = materials.index(primitive.get("material"))
        objects.append(SceneObject(name=name, mesh=part.mesh, material=material, moves=moves))
        parts.append(part)
    if not objects:
        raise InputError("no geometry in it", file=file)
    deforming = [part for part in parts if reader.meshes[part.mesh].deforms]
    world_from_object, deformed = _motion(tree, parts, deforming)
    return SceneDescription(
        name=file.stem,
        files=tuple(files),
        meshes=tuple(reader.meshes),
        materials=tuple(materials.materials),
        textures=tuple(materials.textures),
        objects=tuple(objects),
        lights=(),
        environment=None,
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=world_from_object,
        deformed=deformed if deforming else None,
        animation_end_s=tree.end_s,
        not_read=tuple(_unread(document, chosen)),
    )


def _files(document: Document) -> list[Path]:
    """The main file and those that it names. Images that no texture takes are alternatives in formats of extensions."""
    used = {image_of(texture) for texture in document.all("textures")}
    named = [("buffer", item.get("uri")) for item in document.all("buffers")]
    named += [("texture", item.get("uri")) for index, item in enumerate(document.all("images")) if index in used]
    files = [document.file]
    for what, uri in named:
        if uri and is_elsewhere(uri):
            other, field = path_of(uri, document.file), "buffers" if what == "buffer" else "images"
            try:
                found = other.is_file()
            except (OSError, ValueError):  # a name that no file can have
                found = False
            if not found:
                raise InputError(f"missing {what} {uri[:200]}", file=document.file, field=field)
            files.append(other)
    return list(dict.fromkeys(files))


def _drawn(document: Document) -> Iterator[tuple[int, int, dict[str, Any], str]]:
    """(node, number of the primitive, primitive, name of the object), for triangles in the scene, in the order of nodes."""
    nodes, names = document.all("nodes"), set()
    if document.all("scenes"):
        found = list(document.entry("scenes", document.json.get("scene", 0)).get("nodes", ()))
    else:
        children = {child for node in nodes for child in node.get("children", ())}
        found = [number for number in range(len(nodes)) if number not in children]
    for number in found:  # grows while it is walked; `read_tree` has refused cycles
        found += document.entry("nodes", number).get("children", ())
    for number in sorted(set(found)):
        if "mesh" not in nodes[number]:
            continue
        mesh = document.entry("meshes", nodes[number]["mesh"])
        base = nodes[number].get("name") or mesh.get("name") or f"node {number}"
        for index, primitive in enumerate(mesh["primitives"]):
            if primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN) and "POSITION" in primitive["attributes"]:
                name = f"{base}/{index}" if len(mesh["primitives"]) > 1 else base
                name = f"{name} (node {number})" if name in names else name
                names.add(name)
                yield number, index, primitive, name


class _PartReader:
    """Primitives of one file; `meshes` grows as nodes ask for them. What stands still and has no skin is shared by nodes."""

    def __init__(self, document: Document, tree: NodeTree) -> None:
        self.meshes: list[Mesh] = []
        self._document, self._tree = document, tree
        self._skins = [read_skin(document, index, tree) for index in range(len(document.all("skins")))]
        self._shared: dict[tuple, int] = {}

    def part(self, node: int, number: int, primitive: dict[str, Any], name: str) -> _Part:
        """Primitive `number` of the node's mesh. Raises InputError naming the file and the place in its JSON."""
        source = self._document.entry("nodes", node)
        field = f"meshes[{source['mesh']}].primitives[{number}]"
        weights = self._target_weights(node, primitive, field)
        skin = None
        if "skin" in source:
            self._document.entry("skins", source["skin"])
            skin = self._skins[source["skin"]]
        deforms = "weights" in self._tree.channels.get(node, {}) or skin is not None and skin.deforms
        key = source["mesh"], number, weights.tobytes(), node if deforms or skin is not None else None
        if key in self._shared:
            return _Part(node=node, mesh=self._shared[key], target_weights=weights)
        self._shared[key] = mesh = len(self.meshes)
        if deforms or skin is not None or weights.any():
            shape = read_shape(self._document, primitive, len(skin.joints) if skin else 0, field)
            anchor = most_weighted(shape) if skin else 0
            part = _Part(node=node, mesh=mesh, shape=shape, target_weights=weights, skin=skin, anchor=anchor)
            vertices = deform(shape, weights, self._object_from_bind(part) if skin else None)
            part = part if deforms else replace(part, shape=None)
        else:
            part, vertices = _Part(node=node, mesh=mesh, target_weights=weights), self._vertices(primitive, field)
        self.meshes.append(self._mesh(primitive, vertices, deforms, name, field))
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

    def _object_from_bind(self, part: _Part) -> NDArray[np.float64]:
        local, _ = node_matrices(self._tree, 0.0)
        return skinning(part.skin, part.anchor, relative_matrices(self._tree, local, part.skin.root, part.skin.joints))[1]

    def _vertices(self, primitive: dict[str, Any], field: str) -> Deformed:
        """As the file has them, in its own float32 where they are floats."""
        positions = read_numbers(self._document, primitive["attributes"]["POSITION"], "VEC3")
        normals = read_normals(self._document, primitive, len(positions), field)
        return Deformed(
            positions=np.ascontiguousarray(positions, dtype=np.float32),
            normals=np.ascontiguousarray(normals, dtype=np.float32) if normals is not None else None,
        )

    def _mesh(self, primitive: dict[str, Any], vertices: Deformed, deforms: bool, name: str, field: str) -> Mesh:
        mesh = Mesh(
            name=name,
            positions=vertices.positions,
            faces=_faces(self._document, primitive, len(vertices.positions), field),
            normals=vertices.normals,
            uv=_uv(self._document, primitive, len(vertices.positions), field),
            deforms=deforms,
        )
        problem = validate_mesh(mesh)
        if problem:
            raise InputError(problem, file=self._document.file, field=field)
        return mesh


def _faces(document: Document, primitive: dict[str, Any], count: int, field: str) -> NDArray[np.uint32]:
    """[T, 3]: counter-clockwise triangles of lists, strips and fans (glTF 2.0, chapter 3.7.2.1)."""
    if "indices" in primitive:
        corners = read_integers(document, primitive["indices"], "SCALAR")[:, 0]
    else:
        corners = np.arange(count)
    mode = primitive.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        if len(corners) % 3:
            raise InputError(f"{len(corners)} corners are no triangles", file=document.file, field=field)
        faces = corners.reshape(-1, 3)
    else:
        k = np.arange(max(len(corners) - 2, 0))
        odd = k % 2
        places = [k, k + 1 + odd, k + 2 - odd] if mode == STRIP else [k + 1, k + 2, 0 * k]
        faces = corners[np.stack(places, axis=1)]
    return np.ascontiguousarray(faces, dtype=np.uint32)


def _uv(document: Document, primitive: dict[str, Any], count: int, field: str) -> NDArray[np.float32] | None:
    """[V, 2] with v up: glTF's runs down."""
    if "TEXCOORD_0" not in primitive["attributes"]:
        return None
    stored = read_numbers(document, primitive["attributes"]["TEXCOORD_0"], "VEC2").astype(float)
    if len(stored) != count:
        raise InputError(f"{len(stored)} texture coordinates of {count} vertices", file=document.file, field=field)
    return np.ascontiguousarray(np.stack([stored[:, 0], 1 - stored[:, 1]], axis=1), dtype=np.float32)


def _motion(tree: NodeTree, parts: list[_Part], deforming: list[_Part]) -> tuple[Callable, Callable]:
    """The functions of time `world_from_object` and `deformed` of the scene's description."""
    vertices = {part.mesh: _remembering(part) for part in deforming}
    skinned = [(index, part) for index, part in enumerate(parts) if part.skin is not None]
    places = np.array([-1 if part.place is None else part.place for part in parts])

    @lru_cache(maxsize=4)
    def matrices(time_s: float) -> tuple[NDArray[np.float64], dict[Skin, NDArray[np.float64]]]:
        """world_from_node [nodes, 4, 4], and root_from_joint [joints, 4, 4] of every skin."""
        local, world = node_matrices(tree, time_s)
        skins = dict.fromkeys(part.skin for _, part in skinned)
        return world, {skin: relative_matrices(tree, local, skin.root, skin.joints) for skin in skins}

    def world_from_object(time_s: float) -> NDArray[np.float64]:
        world, joints = matrices(float(time_s))
        found = np.where(places[:, None, None] < 0, np.eye(4), world[places])
        for index, part in skinned:
            origin, _ = skinning(part.skin, part.anchor, joints[part.skin])
            found[index, :3, 3] += found[index, :3, :3] @ origin
        return found

    def deformed(time_s: float) -> dict[int, Deformed]:
        _, joints = matrices(float(time_s))
        found = {}
        for part in deforming:
            animated = "weights" in tree.channels.get(part.node, {})
            weights = property_at(tree, part.node, "weights", time_s) if animated else part.target_weights
            bound = skinning(part.skin, part.anchor, joints[part.skin])[1].tobytes() if part.skin else None
            found[part.mesh] = vertices[part.mesh](weights.tobytes(), bound)
        return found

    return world_from_object, deformed


def _remembering(part: _Part) -> Callable[[bytes, bytes | None], Deformed]:
    """The part's vertices from its weights and matrices; two results are kept, for a frame and the one before it."""

    @lru_cache(maxsize=2)
    def vertices(weights: bytes, joints: bytes | None) -> Deformed:
        object_from_bind = np.frombuffer(joints).reshape(-1, 4, 4) if joints is not None else None
        return deform(part.shape, np.frombuffer(weights), object_from_bind)

    return vertices


def _unread(document: Document, clip: int | None) -> list[str]:
    """What the file holds apart from materials, which tell their own."""
    used = document.json.get("extensionsUsed", ())
    found = [f"extension {name}" for name in used if name not in READ_EXTENSIONS and not is_told_by_materials(name)]
    scenes, drawn = document.all("scenes"), document.json.get("scene", 0)
    found += [f"scene {item.get('name') or k}: scene {drawn} is drawn" for k, item in enumerate(scenes) if k != drawn]
    clips = clip_names(document)
    found += [f"animation {name}: {clips[clip]} is played" for index, name in enumerate(clips) if index != clip]
    for index, mesh in enumerate(document.all("meshes")):
        name, primitives = mesh.get("name") or index, mesh["primitives"]
        found += [f"vertex colours of mesh {name}"] if any("COLOR_0" in p["attributes"] for p in primitives) else []
        found += [f"lines or points of mesh {name}"] if any(p.get("mode", TRIANGLES) < TRIANGLES for p in primitives) else []
        bare = any("POSITION" not in p["attributes"] for p in primitives)
        found += [f"primitives without positions of mesh {name}"] if bare else []
    return found
