"""Scene files of triangles: glTF through our own reader; OBJ, PLY, STL and OFF, which stand still, through trimesh."""

from pathlib import Path

import numpy as np
import trimesh

from ..errors import InputError
from .description import Material, Mesh, SceneDescription, SceneObject, Slot, Texture, validate_mesh
from .gltf import SUFFIXES as GLTF_SUFFIXES
from .gltf import load_gltf
from .images import texels_of

SUFFIXES = (*GLTF_SUFFIXES, ".obj", ".ply", ".stl", ".off")


def load_triangles(file: Path, clip: str | None = None) -> SceneDescription:
    """Read a scene. clip: the animation of a glTF file by name, else its first. Raises InputError naming the file."""
    if file.suffix.lower() in GLTF_SUFFIXES:
        return load_gltf(file, clip)
    if clip is not None:
        raise InputError(f"no animation {clip!r}: files of this format have none", file=file)
    files = [file, *_files_of_obj(file)]
    loaded = _load(file)
    if not loaded.geometry:
        raise InputError("no geometry in it", file=file)
    reader = _MaterialReader()
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
        not_read=tuple(_colored(loaded, names)),
    )


def _load(file: Path) -> trimesh.Scene:
    try:
        return trimesh.load_scene(file, process=False)
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
    """Materials of one OBJ file, each once, and the default grey; both lists grow as meshes ask for them."""

    def __init__(self) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._known: dict[int, int] = {}
        self._slots: dict[int, Slot] = {}

    def index(self, visual) -> int:
        material = getattr(visual, "material", None)
        key = id(material)
        if key not in self._known:
            self._known[key] = len(self.materials)
            self.materials.append(self._material(material))
        return self._known[key]

    def _material(self, material) -> Material:
        if not isinstance(material, trimesh.visual.material.SimpleMaterial):
            return Material(name="default")
        slot = self._slot(material.image) if material.image is not None else None
        rgb = tuple(float(c) for c in np.asarray(material.diffuse[:3]) / 255)
        color = (1.0, 1.0, 1.0) if slot else rgb
        return Material(name=str(material.name), base_color=color, base_texture=slot, not_read=_unread_of_mtl(material.kwargs))

    def _slot(self, image) -> Slot:
        if id(image) not in self._slots:
            self._slots[id(image)] = Slot(texture=len(self.textures))
            self.textures.append(Texture(name=f"image {len(self.textures)}", texels=texels_of(image), srgb=True))
        return self._slots[id(image)]
