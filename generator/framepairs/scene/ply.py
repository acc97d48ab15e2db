"""PLY files as meshes, through trimesh (Turk 1994, "The PLY polygon file format").

Colours of integer properties are sRGB-encoded, as scanners and modellers write them; those of floats are linear. trimesh reads
polygons of several sizes from text alone, and one image.
"""

import io
from pathlib import Path

import numpy as np
from trimesh.exchange.ply import load_ply

from ..errors import InputError
from .trimesh_meshes import MeshFile, loaded, mesh_of

LONGEST_HEADER = 2**16
CORNERS = "texcoord"  # the property of faces with the texture coordinates of their corners


def read_ply(file: Path, data: bytes) -> MeshFile:
    """The faces of a PLY file, polygons as fans. Raises InputError; its caller adds the file."""
    elements, images = _header(data)
    for name, needed in (("vertex", "no vertices in it"), ("face", "no faces in it: point clouds and strips are not drawn")):
        if not elements.get(name, (0,))[0]:
            raise InputError(needed)
    has_corners = CORNERS in elements["face"][1]
    try:
        found = loaded(load_ply, io.BytesIO(data), skip_materials=True, fix_texture=False)
    except InputError as error:
        mixed = "; polygons of several sizes are read from text alone" if "unexpected length" in error.problem else ""
        raise InputError(error.problem + mixed) from None
    if len(found["vertices"]) != elements["vertex"][0]:
        raise InputError(f"cut short or damaged: {len(found['vertices'])} of {elements['vertex'][0]} vertices")
    if has_corners:
        found = _split(found, loaded(load_ply, io.BytesIO(data), skip_materials=True, fix_texture=True))
    mesh = mesh_of(file.name, found, encoded=False)
    return MeshFile((mesh,), (None,), tuple(_told(file.name, found, mesh, elements, images)), (), next(iter(images), None))


def _split(found: dict, split: dict) -> dict:
    """`split`, whose vertices trimesh has split by the texture coordinates of corners, with the normals and colours that it
    left unsplit; `found` is the file without splits. Both have the same corners."""
    before, now = np.asarray(found["faces"]), np.asarray(split["faces"])
    if before.shape != now.shape or (before < 0).any() or (before >= len(found["vertices"])).any():
        return found
    origin = np.zeros(len(split["vertices"]), np.int64)
    origin[now.reshape(-1)] = before.reshape(-1)
    own = {key: found[key][origin] for key in ("vertex_normals", "vertex_colors") if found.get(key) is not None}
    return {**split, **own}


def _header(data: bytes) -> tuple[dict[str, tuple[int, list[str]]], list[str]]:
    """({element: (rows, names of its properties)}, the images that comments name). Raises InputError where the file cannot
    hold the rows: each of their values takes a byte or more, and in text each row a line."""
    end = data.find(b"end_header", 0, LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise InputError("cannot be read: no PLY header")
    elements, images, lists = {}, [], []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        try:
            if words[:1] == ["element"]:
                lists = []
                if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > 18 or words[1] in elements:
                    raise ValueError
                elements[words[1]] = int(words[2]), lists
            elif words[:1] == ["property"]:
                if words[-1] in lists or len(words) != (5 if words[1] == "list" else 3):
                    raise ValueError
                lists.append(words[-1])
            elif [word.lower() for word in words[:2]] == ["comment", "texturefile"] and len(words) > 2:
                images.append(line.split(maxsplit=2)[2].strip())
        except (ValueError, IndexError):
            raise InputError(f"cannot be read: {line[:60]!r} in its PLY header") from None
    size = len(data) - end
    for name, (rows, properties) in elements.items():
        if rows * max(len(properties), 1) > size:
            raise InputError(f"cut short or damaged: {rows} rows of {name} in {size} bytes")
    lines, rows = data[end:].strip().count(b"\n"), sum(rows for rows, _ in elements.values())
    if b"format ascii" in data[:end] and lines < rows:
        raise InputError(f"cut short or damaged: {rows} rows in {lines} lines")
    return elements, images


def _told(name: str, found: dict, mesh, elements: dict, images: list[str]) -> list[str]:
    """What of the file is not drawn."""
    vertex, face = elements["vertex"][1], elements["face"][1]
    said = []
    if found.get("face_colors") is not None:
        if found.get("vertex_colors") is not None:
            said.append(f"face colours of {name}: those of its vertices are drawn")
        elif mesh.colors is None:
            said.append(f"face colours of {name}: its faces are of several sizes")
    said += [f"colours diffuse_red, _green and _blue of {name}"] if "diffuse_red" in vertex + face else []
    has_uv = CORNERS in face or "texture_s" in vertex  # which trimesh does not know
    said += [f"texture coordinates of {name}"] if has_uv and mesh.uv is None else []
    said += [f"{len(images) - 1} images of {name} beyond {images[0]}"] if len(images) > 1 else []
    return said
