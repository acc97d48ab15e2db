"""glTF 2.0 files (.gltf, .glb) as scenes: meshes, lights and cameras of nodes, and one clip that moves them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from .containment import Reach
from .description import SceneDescription, SceneObject
from .gltf_animation import clip_index, clip_names
from .gltf_cameras import read_cameras
from .gltf_document import Document, is_elsewhere, path_of, read_document
from .gltf_instances import read_instances
from .gltf_lights import read_lights
from .gltf_materials import ALLOWED_IF_REQUIRED, READ_EXTENSIONS, MaterialReader, is_told_by_materials
from .gltf_meshes import FAN, TRIANGLES, has_triangles, unread_of_meshes
from .gltf_nodes import drawn_nodes, read_tree, remembered_matrices
from .gltf_parts import Part, PartReader, motion_of
from .gltf_textures import image_of

BYTES_PER_OBJECT = 512


@dataclass(frozen=True, kw_only=True)
class _Drawn:
    """A primitive of triangles at a node. number: the primitive's in its mesh. name: of the object."""

    node: int
    number: int
    primitive: dict[str, Any]
    name: str


def load_gltf(file: Path, reach: Reach, clip: str | None = None) -> SceneDescription:
    """Read a scene with one animation clip: the one named `clip` (a clip without a name goes by its number), else the first.

    reach: which files it may name. A skinned object ignores its node's own transform, as glTF says; its object space has the
    axes of the node above all its joints. Raises InputError naming the file and the place in its JSON.
    """
    document = read_document(file, reach)
    refused = [name for name in document.json.get("extensionsRequired", ()) if name not in ALLOWED_IF_REQUIRED]
    if refused:
        raise InputError(f"extension {refused[0]} is not read, and the file requires it", file=file)
    files = _files(document)
    chosen = clip_index(document, clip)
    tree = read_tree(document, chosen)
    nodes = drawn_nodes(document)
    reader, materials = PartReader(document, tree), MaterialReader(document)
    objects: list[SceneObject] = []
    parts: list[Part] = []
    for item in _drawn(document, nodes):
        number = item.primitive.get("material")
        source = materials.source(number)
        part = reader.part(item.node, item.number, item.primitive, item.name, source)
        deforms = reader.meshes[part.mesh].deforms
        one = SceneObject(
            name=item.name,
            mesh=part.mesh,
            material=materials.index(number),
            moves=deforms or part.place is not None and bool(tree.moving[part.place]),
            double_sided=source.get("doubleSided", False),
        )
        for name, instance in _instances(document, item, part, deforms):
            document.spend(BYTES_PER_OBJECT, "nodes")
            objects.append(replace(one, name=name))
            parts.append(instance)
    if not objects:
        raise InputError("no geometry in it", file=file)
    matrices = remembered_matrices(tree)
    lights = read_lights(document, tree, nodes, matrices)
    deforming = [part for part in parts if reader.meshes[part.mesh].deforms]
    world_from_object, deformed = motion_of(tree, parts, deforming, matrices)
    return SceneDescription(
        name=file.stem,
        files=tuple(files),
        meshes=tuple(reader.meshes),
        materials=tuple(materials.materials),
        textures=tuple(materials.textures),
        objects=tuple(objects),
        lights=lights.lights,
        environment=None,
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=world_from_object,
        deformed=deformed if deforming else None,
        lights_at=lights.at,
        cameras=read_cameras(document, tree, nodes, matrices),
        animation_end_s=tree.end_s,
        not_read=tuple(dict.fromkeys([*_unread(document, chosen), *reader.not_read, *lights.not_read])),
    )


def _files(document: Document) -> list[Path]:
    """The main file and those that it names. Images that no texture takes are alternatives in formats of extensions."""
    used = {image_of(texture) for texture in document.all("textures")}
    named = [("buffers", item.get("uri")) for item in document.all("buffers")]
    named += [("images", item.get("uri")) for index, item in enumerate(document.all("images")) if index in used]
    elsewhere = dict.fromkeys((where, uri) for where, uri in named if uri and is_elsewhere(uri))
    return list(dict.fromkeys([document.file, *(path_of(document, uri, where) for where, uri in elsewhere)]))


def _drawn(document: Document, nodes: Sequence[int]) -> Iterator[_Drawn]:
    """Everything that has triangles, in the order of nodes. Raises InputError naming the place in the JSON."""
    names: set[str] = set()
    for number in nodes:
        node = document.entry("nodes", number)
        if "mesh" not in node:
            continue
        mesh = document.entry("meshes", node["mesh"])
        base = node.get("name") or mesh.get("name") or f"node {number}"
        for index, primitive in enumerate(mesh["primitives"]):
            field, mode = f"meshes[{node['mesh']}].primitives[{index}]", primitive.get("mode", TRIANGLES)
            if mode > FAN:
                raise InputError(f"mode {mode} is none of glTF's", file=document.file, field=field)
            if mode < TRIANGLES or "POSITION" not in primitive["attributes"] or not has_triangles(document, primitive, field):
                continue
            name = f"{base}/{index}" if len(mesh["primitives"]) > 1 else base
            name = f"{name} (node {number})" if name in names else name
            names.add(name)
            yield _Drawn(node=number, number=index, primitive=primitive, name=name)


def _instances(document: Document, item: _Drawn, part: Part, deforms: bool) -> Iterator[tuple[str, Part]]:
    """(name, part) of every object that a primitive of a node is: itself, or each of its instances."""
    matrices = read_instances(document, item.node)
    if matrices is None:
        yield item.name, part
    elif deforms or part.skin is not None:
        problem = "instances of a mesh that deforms are not read"
        raise InputError(problem, file=document.file, field=f"nodes[{item.node}]")
    else:
        for number, matrix in enumerate(matrices):
            yield f"{item.name} (instance {number})", replace(part, node_from_instance=matrix)


def _unread(document: Document, clip: int | None) -> list[str]:
    """What the file holds apart from materials, which tell their own."""
    used = document.json.get("extensionsUsed", ())
    found = [f"extension {name}" for name in used if name not in READ_EXTENSIONS and not is_told_by_materials(name)]
    scenes, drawn = document.all("scenes"), document.json.get("scene", 0)
    found += [f"scene {item.get('name') or k}: scene {drawn} is drawn" for k, item in enumerate(scenes) if k != drawn]
    clips = clip_names(document)
    found += [f"animation {name}: {clips[clip]} is played" for index, name in enumerate(clips) if index != clip]
    return [*found, *unread_of_meshes(document)]
