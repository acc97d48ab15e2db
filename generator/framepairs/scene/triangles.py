"""Static scenes through trimesh: glTF, GLB, OBJ, PLY, STL, OFF.

trimesh rounds glTF's colour factors to bytes, so these are read from the file's JSON with pygltflib.
"""

import copy
import io
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
from .gltf_materials import (
    ALLOWED_IF_REQUIRED,
    SPECULAR_GLOSSINESS,
    specular_of,
    unread_of,
    unread_of_document,
    uv_of,
    with_metallic_roughness,
)
from .images import texels_of

GLTF_SUFFIXES = (".gltf", ".glb")
SUFFIXES = (*GLTF_SUFFIXES, ".obj", ".ply", ".stl", ".off")
GLTF_WRAP = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


def load_triangles(file: Path) -> SceneDescription:
    """Read a static scene. Raises InputError naming the file."""
    is_gltf = file.suffix.lower() in GLTF_SUFFIXES
    document, files = _read_gltf_json(file) if is_gltf else (None, [file, *_files_of_obj(file)])
    loaded = _load(file, document)
    if not loaded.geometry:
        raise InputError("no geometry in it", file=file)
    reader = _MaterialReader(document, file)
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
        not_read=tuple(unread_of_document(document) if document else _colored(loaded, names)),
    )


def _load(file: Path, document: pygltflib.GLTF2 | None) -> trimesh.Scene:
    """trimesh's scene. glTF's materials are renamed to their index first, so that what trimesh leaves out can be found."""
    try:
        if document is None:
            return trimesh.load_scene(file, process=False)
        numbered = copy.deepcopy(document)
        for index, material in enumerate(numbered.materials):
            material.name = str(index)
            (material.extensions or {}).pop(SPECULAR_GLOSSINESS, None)  # trimesh would convert it
        is_binary = file.suffix.lower() == ".glb"
        data = b"".join(numbered.save_to_bytes()) if is_binary else numbered.to_json().encode()
        resolver = trimesh.resolvers.FilePathResolver(file)
        return trimesh.load_scene(io.BytesIO(data), file_type=file.suffix[1:].lower(), resolver=resolver, process=False)
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        raise InputError(f"cannot be read: {type(error).__name__}: {error}", file=file) from None


def _files_of_obj(file: Path) -> list[Path]:
    """The material libraries of an OBJ file and the images that these name."""
    if file.suffix.lower() != ".obj":
        return []
    libraries = [file.parent / name for name in _words_after(file, ("mtllib",))]
    missing = [library for library in libraries if not library.is_file()]
    if missing:
        raise InputError(f"missing material library {missing[0].name}", file=file)
    images = [library.parent / name for library in libraries for name in _words_after(library, ("map_Kd", "map_Ka"))]
    missing = [image for image in images if not image.is_file()]
    if missing:
        raise InputError(f"missing texture {missing[0].name}", file=file)
    return [*libraries, *dict.fromkeys(images)]


def _words_after(file: Path, keywords: tuple[str, ...]) -> list[str]:
    try:
        lines = [line.split() for line in file.read_text(errors="replace").splitlines()]
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    return [words[-1] for words in lines if len(words) > 1 and words[0] in keywords]


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
    except Exception as error:  # pygltflib passes on whatever a damaged file makes of it
        raise InputError(f"not glTF: {type(error).__name__}: {error}", file=file) from None
    if document is None:
        raise InputError("not glTF", file=file)
    refused = [name for name in document.extensionsRequired or () if name not in ALLOWED_IF_REQUIRED]
    if refused:
        raise InputError(f"extension {refused[0]} is not read, and the file requires it", file=file)
    for material in document.materials:
        with_metallic_roughness(material)
    used = {_source(texture) for texture in document.textures}  # others are alternatives in formats of extensions
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


def _source(texture: pygltflib.Texture) -> int | None:
    """Index of its image: WebP where there is one, as trimesh chooses."""
    return (texture.extensions or {}).get("EXT_texture_webp", {}).get("source", texture.source)


def _colored(loaded: trimesh.Scene, names: list[str]) -> list[str]:
    """Vertex and face colours of formats without textures."""
    kinds = {name: getattr(loaded.geometry[name].visual, "kind", None) for name in names}
    return [f"{kind} colours of {name}" for name, kind in kinds.items() if kind in ("vertex", "face")]


def _unread_of_mtl(values: dict) -> tuple[str, ...]:
    """Lines of an MTL material that act and are not drawn; opaque, without emission and reflection they would be neutral."""
    neutral = {"d": 1.0, "tr": 0.0, "ks": 0.0, "ke": 0.0, "pm": 0.0, "ps": 0.0, "pc": 0.0, "aniso": 0.0}
    said = []
    for key, value in values.items():
        words = [str(word) for word in np.atleast_1d(np.array(value, dtype=object))]
        if key in neutral:
            acts = any(_number(word) != neutral[key] for word in words)
        else:
            acts = key in ("pr", "bump", "disp", "norm", "refl") or key.startswith("map_") and key not in ("map_kd", "map_ka")
        said += [f"{key} {' '.join(words)}"] if acts else []
    return tuple(said)


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


class _MaterialReader:
    """Materials of one file, each once; `materials` and `textures` grow as meshes ask for them."""

    def __init__(self, document: pygltflib.GLTF2 | None, file: Path) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._document, self._file = document, file
        self._known: dict[int, int] = {}
        self._texels: dict[int, NDArray] = {}

    def index(self, visual) -> int:
        material = getattr(visual, "material", None)
        key = id(material)
        if key not in self._known:
            self._known[key] = len(self.materials)
            if isinstance(material, trimesh.visual.material.PBRMaterial):
                try:
                    self.materials.append(self._physically_based(material))
                except InputError as error:
                    raise InputError(error.problem, file=self._file, field=error.field) from None
            else:
                self.materials.append(self._simple(material))
        return self._known[key]

    def _simple(self, material) -> Material:
        """OBJ's material, or the default grey where there is none."""
        if not isinstance(material, trimesh.visual.material.SimpleMaterial):
            return Material(name="default")
        rgb = tuple(float(c) for c in np.asarray(material.diffuse[:3]) / 255)
        slot = self._slot(material.image, None, srgb=True)
        color = (1.0, 1.0, 1.0) if slot else rgb
        return Material(name=str(material.name), base_color=color, base_texture=slot, not_read=_unread_of_mtl(material.kwargs))

    def _physically_based(self, material) -> Material:
        source = pygltflib.Material()
        if self._document is not None and str(material.name).isdigit():
            source = self._document.materials[int(material.name)]
        pbr = source.pbrMetallicRoughness or pygltflib.PbrMetallicRoughness()
        base, emission = pbr.baseColorFactor or (1.0,) * 4, source.emissiveFactor or (0.0,) * 3
        strength = (source.extensions or {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        alpha = {"MASK": "mask", "BLEND": "blend"}.get(source.alphaMode or "OPAQUE", "opaque")
        normal_scale = source.normalTexture.scale if source.normalTexture else 1.0
        specular, said = specular_of(source)
        return Material(
            name=source.name or f"material {material.name}",
            base_color=tuple(base[:3]),
            opacity=1.0 if alpha == "opaque" else float(base[3]),
            roughness=_or(pbr.roughnessFactor, 1.0),
            metallic=_or(pbr.metallicFactor, 1.0),
            specular=specular,
            emission=tuple(float(c) * strength for c in emission),
            alpha=alpha,
            alpha_cutoff=_or(source.alphaCutoff, 0.5),
            normal_scale=_or(normal_scale, 1.0),
            base_texture=self._slot(material.baseColorTexture, pbr.baseColorTexture, srgb=True),
            surface_texture=self._slot(
                material.metallicRoughnessTexture, pbr.metallicRoughnessTexture, scale=(0, 1, 1, 0), bias=(1, 0, 0, 1)
            ),
            normal_texture=self._slot(material.normalTexture, source.normalTexture, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)),
            emission_texture=self._slot(material.emissiveTexture, source.emissiveTexture, srgb=True),
            not_read=(*unread_of(source), *said),
        )

    def _slot(self, image: Image.Image | None, info, *, srgb: bool = False, scale=(1,) * 4, bias=(0,) * 4) -> Slot | None:
        """`info` is glTF's reference to the texture, or None; trimesh gives no image where it could not decode one."""
        if image is None and info is None:
            return None
        wrap = self._wrap(info) if info is not None else ("repeat", "repeat")
        if image is None:
            raise InputError(f"{self._name_of(info)} cannot be read as an image", file=self._file, field="images")
        texels = self._texels.setdefault(id(image), texels_of(image))
        name = self._name_of(info) if info is not None else f"image {len(self.textures)}"
        wanted = Texture(name=name, texels=texels, srgb=srgb, wrap=wrap, scale=scale, bias=bias)
        for index, texture in enumerate(self.textures):
            if texture.texels is texels and replace(texture, texels=None) == replace(wanted, texels=None):
                return Slot(texture=index, uv=uv_of(info))
        self.textures.append(wanted)
        return Slot(texture=len(self.textures) - 1, uv=uv_of(info))

    def _wrap(self, info) -> tuple[str, str]:
        texture = self._entry("textures", info.index)
        if texture.sampler is None:
            return "repeat", "repeat"
        sampler = self._entry("samplers", texture.sampler)
        return GLTF_WRAP[_or(sampler.wrapS, 10497)], GLTF_WRAP[_or(sampler.wrapT, 10497)]

    def _name_of(self, info) -> str:
        source = _source(self._entry("textures", info.index))
        image = self._entry("images", source) if source is not None else None
        return (image.uri if image and image.uri and not image.uri.startswith("data:") else None) or f"image {source}"

    def _entry(self, kind: str, index: int):
        entries = getattr(self._document, kind)
        if not 0 <= index < len(entries):
            raise InputError(f"names {kind[:-1]} {index}, there are {len(entries)}", file=self._file, field=kind)
        return entries[index]


def _or(value, default):
    return default if value is None else value
