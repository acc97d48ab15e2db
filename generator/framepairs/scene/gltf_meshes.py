"""The vertices and triangles of a glTF's primitives (glTF 2.0, chapter 3.7)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Deformed, Mesh, validate_mesh
from .gltf_accessors import read_integers, read_numbers
from .gltf_document import Document
from .gltf_skins import read_normals

TRIANGLES, STRIP, FAN = 4, 5, 6
DRACO = "KHR_draco_mesh_compression"


def has_triangles(document: Document, primitive: dict[str, Any], field: str) -> bool:
    """Whether there are any. Raises InputError for data that an extension compresses."""
    position = document.entry("accessors", primitive["attributes"]["POSITION"])
    if DRACO in primitive.get("extensions", {}) and "bufferView" not in position:
        problem = f"extension {DRACO} is not read, and the primitive has no other data"
        raise InputError(problem, file=document.file, field=field)
    corners = document.entry("accessors", primitive["indices"]) if "indices" in primitive else position
    return position["count"] > 0 and corners["count"] >= 3


def read_vertices(document: Document, primitive: dict[str, Any], field: str) -> Deformed:
    """Positions and normals as the file has them, in its own float32 where they are floats."""
    positions = read_numbers(document, primitive["attributes"]["POSITION"], "VEC3")
    normals = read_normals(document, primitive, len(positions), field)
    return Deformed(
        positions=np.ascontiguousarray(positions, dtype=np.float32),
        normals=np.ascontiguousarray(normals, dtype=np.float32) if normals is not None else None,
    )


def build_mesh(
    document: Document,
    primitive: dict[str, Any],
    vertices: Deformed,
    *,
    name: str,
    sets: tuple[int, ...],
    tangents: bool,
    deforms: bool,
    field: str,
) -> Mesh:
    """The mesh of a primitive whose vertices are these. sets: numbers of the sets that become uv and uv2. tangents: whether
    the file's are taken. Raises InputError naming `field`."""
    count = len(vertices.positions)
    first, second = (*sets, None, None)[:2] if sets else (0, None)
    mesh = Mesh(
        name=name,
        positions=vertices.positions,
        faces=_faces(document, primitive, count, field),
        normals=vertices.normals,
        uv=_uv(document, primitive, first, count, field),
        uv2=_uv(document, primitive, second, count, field) if second is not None else None,
        colors=_colors(document, primitive, count, field),
        tangents=_tangents(document, primitive, vertices.normals, field) if tangents else None,
        deforms=deforms,
    )
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, file=document.file, field=field)
    return mesh


def unread_of_meshes(document: Document) -> list[str]:
    """What meshes hold that is not drawn, whatever their material."""
    said = []
    for index, mesh in enumerate(document.all("meshes")):
        name, primitives = mesh.get("name") or index, mesh["primitives"]
        said += [f"lines or points of mesh {name}"] if any(p.get("mode", TRIANGLES) < TRIANGLES for p in primitives) else []
        bare = any("POSITION" not in p["attributes"] for p in primitives)
        said += [f"primitives without positions of mesh {name}"] if bare else []
        colors = {key for p in primitives for key in p["attributes"] if key.startswith("COLOR_") and key != "COLOR_0"}
        said += [f"vertex colours {key} of mesh {name}: COLOR_0 is drawn" for key in sorted(colors)]
        morphed = {key for p in primitives for target in p.get("targets", ()) for key in target}
        morphed = {key for key in morphed if key.startswith(("COLOR_", "TEXCOORD_"))}
        said += [f"morph targets of {key} of mesh {name}" for key in sorted(morphed)]
    return said


def _faces(document: Document, primitive: dict[str, Any], count: int, field: str) -> NDArray[np.uint32]:
    """[T, 3]: counter-clockwise triangles of lists, strips and fans (glTF 2.0, chapter 3.7.2.1)."""
    if "indices" in primitive:
        corners = read_integers(document, primitive["indices"], "SCALAR")[:, 0]
    else:
        corners = np.arange(count, dtype=np.uint32)
    mode = primitive.get("mode", TRIANGLES)
    document.spend(12 * len(corners), field)
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


def _uv(document: Document, primitive: dict[str, Any], number: int, count: int, field: str) -> NDArray[np.float32] | None:
    """[V, 2] with v up: glTF's runs down."""
    index = primitive["attributes"].get(f"TEXCOORD_{number}")
    if index is None:
        return None
    if ("uv", index) not in document.arrays:
        stored = read_numbers(document, index, "VEC2")
        document.spend(8 * len(stored), field)
        flipped = np.stack([stored[:, 0], 1 - stored[:, 1].astype(float)], axis=1)
        document.arrays["uv", index] = np.ascontiguousarray(flipped, dtype=np.float32)
    return _of_count(document, document.arrays["uv", index], count, "texture coordinates", field)


def _colors(document: Document, primitive: dict[str, Any], count: int, field: str) -> NDArray[np.float32] | None:
    """[V, 4] of COLOR_0: linear RGB and opacity, from 0 to 1 (glTF 2.0, chapter 3.7.2.1: they are to be clamped)."""
    index = primitive["attributes"].get("COLOR_0")
    if index is None:
        return None
    if ("colors", index) not in document.arrays:
        stored = read_numbers(document, index, "VEC3", "VEC4")
        document.spend(16 * len(stored), field)
        colors = np.ones((len(stored), 4), np.float32)
        colors[:, : stored.shape[1]] = np.clip(stored, 0, 1)
        document.arrays["colors", index] = colors
    return _of_count(document, document.arrays["colors", index], count, "vertex colours", field)


def _tangents(document: Document, primitive: dict[str, Any], normals: NDArray | None, field: str) -> NDArray | None:
    """[V, 4] of TANGENT, of unit length; None without normals, where glTF ignores them.

    glTF's normal maps have green up the image, so that its bitangent cross(normal, tangent) w runs with our v, against its
    own: the sign is the same. Where the file has a direction of length 0 it becomes one that is perpendicular to the normal.
    """
    index = primitive["attributes"].get("TANGENT")
    if index is None or normals is None:
        return None
    stored = _of_count(document, read_numbers(document, index, "VEC4"), len(normals), "tangents", field)
    document.spend(16 * len(stored), field)
    direction = stored[:, :3].astype(float)
    length = np.linalg.norm(direction, axis=1)
    lost = length == 0
    direction[~lost] /= length[~lost, None]
    across = np.eye(3)[np.argmin(np.abs(normals[lost]), axis=1)]
    sideways = np.cross(across, normals[lost].astype(float))
    direction[lost] = sideways / np.maximum(np.linalg.norm(sideways, axis=1, keepdims=True), 1e-30)
    sign = np.where(stored[:, 3:] < 0, -1.0, 1.0)
    return np.ascontiguousarray(np.concatenate([direction, sign], axis=1), dtype=np.float32)


def _of_count(document: Document, values: NDArray, count: int, what: str, field: str) -> NDArray:
    if len(values) != count:
        raise InputError(f"{len(values)} {what} of {count} vertices", file=document.file, field=field)
    return values
