"""Scene files of triangles that stand still, through trimesh: OBJ with its materials, PLY, STL and OFF.

Nothing in them says which way is up or how long a unit is: Y and metres. What a file claims is held against its size before
trimesh reads it, and no other file is opened but by `within`.
"""

from pathlib import Path

import numpy as np

from ..errors import InputError
from .containment import Reach, within
from .description import Mesh, SceneDescription, SceneObject
from .mtl_lines import library_files, read_libraries
from .obj import read_obj
from .obj_materials import MaterialReader
from .ply import read_ply
from .stl_off import read_off, read_stl
from .trimesh_meshes import MeshFile

READERS = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl, ".off": read_off}


def load_triangles(file: Path, reach: Reach) -> SceneDescription:
    """Read a scene. Raises InputError naming the file."""
    found = _read(file)
    libraries = library_files(found.libraries, file, reach)
    known = read_libraries(libraries)
    reader = MaterialReader(known, reach)
    image = None
    if found.image is not None and found.meshes[0].uv is not None:
        image = within(reach, found.image.replace("\\", "/"), file=file, field="TextureFile")
        if not image.is_file():
            raise InputError(f"missing texture {found.image[:200]}", file=file)
    worn = []
    for mesh, name in zip(found.meshes, found.materials, strict=True):
        colored = mesh.colors is not None
        blends = colored and bool((mesh.colors[:, 3] < 1).any())
        worn.append(reader.textured(image, found.image) if image else reader.index(name, colored, blends))
    unknown = dict.fromkeys(name for name in found.materials if name is not None and name not in known)
    world = np.tile(np.eye(4), (len(found.meshes), 1, 1))
    return SceneDescription(
        name=file.stem,
        files=(file, *libraries, *reader.files),
        meshes=found.meshes,
        materials=tuple(reader.materials),
        textures=tuple(reader.textures),
        objects=tuple(SceneObject(name=mesh.name, mesh=k, material=worn[k]) for k, mesh in enumerate(found.meshes)),
        lights=(),
        environment=None,
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=lambda time_s: world,
        not_read=(*found.not_read, *(f"material {name}: no library holds it" for name in unknown)),
    )


def read_meshes(file: Path, reach: Reach) -> tuple[Mesh, ...]:
    """The triangles of a file (.obj .ply .stl .off) in its own space, without materials: one mesh for each object, group and
    material. Raises InputError naming the file."""
    return _read(within(reach, file)).meshes


def _read(file: Path) -> MeshFile:
    try:
        found = READERS[file.suffix.lower()](file, file.read_bytes())
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except InputError as error:
        raise InputError(error.problem, file=file, field=error.field) from None
    if not any(len(mesh.faces) for mesh in found.meshes):
        raise InputError("no triangles in it", file=file)
    return found
