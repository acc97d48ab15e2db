"""Static scenes through trimesh: glTF, GLB, OBJ, PLY, STL, OFF.

trimesh rounds glTF's colour factors to bytes, so these are read from the file's JSON by material name with pygltflib.
"""

import json
import urllib.parse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pygltflib
import trimesh
from numpy.typing import NDArray
from PIL import Image

from ..errors import InputError
from .description import Material, Mesh, SceneDescription, SceneObject, Slot, Texture, validate_mesh
from .images import texels_of

GLTF_SUFFIXES = (".gltf", ".glb")
SUFFIXES = (*GLTF_SUFFIXES, ".obj", ".ply", ".stl", ".off")
UNREADABLE_EXTENSIONS = ("KHR_draco_mesh_compression", "KHR_texture_basisu", "EXT_meshopt_compression")
READ_EXTENSIONS = ("KHR_materials_emissive_strength",)


def load_triangles(file: Path) -> SceneDescription:
    """Read a static scene. Raises InputError naming the file."""
    document, files = _read_gltf_json(file) if file.suffix.lower() in GLTF_SUFFIXES else (None, [file])
    try:
        loaded = trimesh.load_scene(file, process=False)
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        raise InputError(f"cannot be read: {type(error).__name__}: {error}", file=file) from None
    if not loaded.geometry:
        raise InputError("no geometry in it", file=file)
    reader = _MaterialReader(document)
    names = [name for name, geometry in loaded.geometry.items() if isinstance(geometry, trimesh.Trimesh)]
    meshes = [_mesh(name, loaded.geometry[name], file) for name in names]
    materials = [reader.index(loaded.geometry[name].visual) for name in names]
    objects, matrices = [], []
    for node in sorted(loaded.graph.nodes_geometry):
        matrix, geometry = loaded.graph[node]
        if geometry in names:
            index = names.index(geometry)
            objects.append(SceneObject(name=str(node), mesh=index, material=materials[index]))
            matrices.append(matrix)
    world = np.array(matrices, dtype=float).reshape(-1, 4, 4)
    return SceneDescription(
        name=file.stem,
        files=tuple(files),
        meshes=tuple(meshes),
        materials=tuple(reader.materials),
        textures=tuple(reader.textures),
        objects=tuple(objects),
        lights=(),
        environment=None,
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=lambda time_s: world,
        not_read=tuple(_not_read(document) if document else ()),
    )


def _mesh(name: str, geometry: trimesh.Trimesh, file: Path) -> Mesh:
    uv = getattr(geometry.visual, "uv", None)
    has_normals = "vertex_normals" in geometry._cache  # as stored in the file; asking the property would make them up
    mesh = Mesh(
        name=name,
        positions=np.ascontiguousarray(geometry.vertices, dtype=np.float32),
        faces=np.ascontiguousarray(geometry.faces, dtype=np.uint32),
        normals=np.ascontiguousarray(geometry.vertex_normals, dtype=np.float32) if has_normals else None,
        uv=np.ascontiguousarray(uv, dtype=np.float32) if uv is not None and len(uv) == len(geometry.vertices) else None,
    )
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, file=file, field=name)
    return mesh


def _read_gltf_json(file: Path) -> tuple[pygltflib.GLTF2, list[Path]]:
    """The parsed JSON and the files that it names. Raises InputError for what is missing or cannot be read."""
    try:
        document = pygltflib.GLTF2().load(str(file))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise InputError(f"not glTF: {error}", file=file) from None
    if document is None:
        raise InputError("not glTF", file=file)
    refused = [name for name in UNREADABLE_EXTENSIONS if name in (document.extensionsRequired or ())]
    if refused:
        raise InputError(f"extension {refused[0]} is not read", file=file)
    used = {texture.source for texture in document.textures}  # others are alternatives in formats of extensions
    named = [("buffers", item.uri) for item in document.buffers]
    named += [("images", item.uri) for index, item in enumerate(document.images) if index in used]
    files = [file]
    for field, uri in named:
        if uri and not uri.startswith("data:"):
            other = file.parent / urllib.parse.unquote(uri)
            if not other.is_file():
                what = "texture" if field == "images" else "buffer"
                raise InputError(f"missing {what} {uri}", file=file, field=field)
            files.append(other)
    return document, files


def _not_read(document: pygltflib.GLTF2) -> list[str]:
    found = [f"extension {name}" for name in document.extensionsUsed or () if name not in READ_EXTENSIONS]
    found += [f"animation {clip.name or index}" for index, clip in enumerate(document.animations)]
    found += [f"skin {skin.name or index}" for index, skin in enumerate(document.skins)]
    return found


class _MaterialReader:
    """Materials of one file, each once; `materials` and `textures` grow as meshes ask for them."""

    def __init__(self, document: pygltflib.GLTF2 | None) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._factors = {item.name: item for item in document.materials} if document else {}
        self._known: dict[int, int] = {}
        self._texels: dict[int, NDArray] = {}

    def index(self, visual) -> int:
        material = getattr(visual, "material", None)
        key = id(material)
        if key not in self._known:
            self._known[key] = len(self.materials)
            if isinstance(material, trimesh.visual.material.PBRMaterial):
                self.materials.append(self._physically_based(material))
            else:
                self.materials.append(self._simple(material))
        return self._known[key]

    def _simple(self, material) -> Material:
        """OBJ's material, or the default grey where there is none."""
        if not isinstance(material, trimesh.visual.material.SimpleMaterial):
            return Material(name="default")
        rgb = tuple(float(c) for c in np.asarray(material.diffuse[:3]) / 255)
        slot = self._slot(material.image, srgb=True)
        return Material(name=str(material.name), base_color=(1, 1, 1) if slot else rgb, base_texture=slot)

    def _physically_based(self, material) -> Material:
        base, roughness, metallic, emission = (1.0, 1.0, 1.0, 1.0), 1.0, 1.0, (0.0, 0.0, 0.0)
        strength, normal_scale, occluded = 1.0, 1.0, material.occlusionTexture is not None
        source = self._factors.get(material.name)
        if source is not None:
            pbr = source.pbrMetallicRoughness or pygltflib.PbrMetallicRoughness()
            base = _or(pbr.baseColorFactor, base)
            roughness, metallic = _or(pbr.roughnessFactor, 1.0), _or(pbr.metallicFactor, 1.0)
            emission = _or(source.emissiveFactor, emission)
            strength = (source.extensions or {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
            normal_scale = _or(source.normalTexture.scale, 1.0) if source.normalTexture else 1.0
        elif material.baseColorFactor is not None:
            base = tuple(np.asarray(material.baseColorFactor, dtype=float) / 255)
        alpha = {"MASK": "mask", "BLEND": "blend"}.get(material.alphaMode or "OPAQUE", "opaque")
        return Material(
            name=str(material.name),
            base_color=tuple(base[:3]),
            opacity=1.0 if alpha == "opaque" else float(base[3]),
            roughness=float(roughness),
            metallic=float(metallic),
            emission=tuple(float(c) * strength for c in emission),
            alpha=alpha,
            alpha_cutoff=float(_or(material.alphaCutoff, 0.5)),
            normal_scale=float(normal_scale),
            base_texture=self._slot(material.baseColorTexture, srgb=True),
            surface_texture=self._slot(material.metallicRoughnessTexture, scale=(0, 1, 1, 0), bias=(1, 0, 0, 1)),
            normal_texture=self._slot(material.normalTexture, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)),
            emission_texture=self._slot(material.emissiveTexture, srgb=True),
            not_read=("occlusion map",) if occluded else (),
        )

    def _slot(self, image: Image.Image | None, *, srgb: bool = False, scale=(1,) * 4, bias=(0,) * 4) -> Slot | None:
        if image is None:
            return None
        texels = self._texels.setdefault(id(image), texels_of(image))
        wanted = Texture(name=f"image {len(self.textures)}", texels=texels, srgb=srgb, scale=scale, bias=bias)
        for index, texture in enumerate(self.textures):
            if texture.texels is texels and replace(texture, name=wanted.name, texels=None) == replace(wanted, texels=None):
                return Slot(texture=index)
        self.textures.append(wanted)
        return Slot(texture=len(self.textures) - 1)


def _or(value, default):
    return default if value is None else value
