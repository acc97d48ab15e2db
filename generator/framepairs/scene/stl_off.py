"""STL (binary and text) and OFF files as meshes, through trimesh.

STL: 3D Systems 1989, "StereoLithography Interface Specification"; each solid of a text is a mesh. OFF: Geomview's manual,
section "OFF Files"; trimesh reads its points and faces alone, and polygons of 5 corners or more where all have as many.
"""

import io
import re
from pathlib import Path

import numpy as np
from trimesh.exchange.off import load_off
from trimesh.exchange.stl import load_stl

from ..errors import InputError
from .trimesh_meshes import MeshFile, loaded, mesh_of

STL_HEADER, STL_TRIANGLE = 84, 50  # bytes
MOST_SOLIDS = 1000  # trimesh takes time that grows with their square
OFF_HEADER = re.compile(r"\s*(ST)?(C)?(N)?(4)?(n)?OFF(?![A-Za-z])[ \t]*(BINARY)?")


def read_stl(file: Path, data: bytes) -> MeshFile:
    """The triangles of an STL file. Raises InputError; its caller adds the file."""
    count = int.from_bytes(data[80:STL_HEADER], "little") if len(data) >= STL_HEADER else 0
    size = STL_HEADER + count * STL_TRIANGLE
    if len(data) != size and re.match(rb"\s*solid\b", data, re.IGNORECASE) and b"\0" not in data[:4096]:
        return _text(file, data)
    if len(data) < max(size, STL_HEADER):
        claim = f"a header of {STL_HEADER} bytes" if len(data) < STL_HEADER else f"{count} triangles of {size} bytes"
        raise InputError(f"cut short, or no STL: {claim}, there are {len(data)}")
    found = loaded(load_stl, io.BytesIO(data[:size]))
    if "faces" not in found:
        return MeshFile((), ())
    said = [f"colours or other attributes of {file.name}"] if np.any(found["face_attributes"]["stl"]) else []
    said += [f"{len(data) - size} bytes behind the triangles of {file.name}"] if len(data) > size else []
    return MeshFile((mesh_of(file.name, found),), (None,), tuple(said))


def _text(file: Path, data: bytes) -> MeshFile:
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    lower, said = data.lower(), ()
    solids = lower.count(b"endsolid")
    if solids > MOST_SOLIDS:
        data = b"solid\n" + re.sub(rb"(?im)^[ \t]*(end)?solid[^\n]*", b"", data) + b"\nendsolid\n"
        said = (f"{solids} solids: they are drawn as one",)
    found = loaded(load_stl, io.StringIO(data.decode(errors="replace")))
    found = found["geometry"] if "geometry" in found else {found["metadata"]["name"]: found}
    corners, facets = sum(len(arrays["vertices"]) for arrays in found.values()), lower.count(b"endfacet")
    if corners != 3 * facets or not solids:
        raise InputError(f"cut short or damaged: {corners} vertices in {facets} finished facets")
    names = [file.name if name == "geometry_1" else name for name in found]  # trimesh's name of the first one without
    return MeshFile(tuple(map(mesh_of, names, found.values())), (None,) * len(names), said)


def read_off(file: Path, data: bytes) -> MeshFile:
    """The faces of an OFF file. Raises InputError; its caller adds the file."""
    text = data.decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n").removeprefix("\ufeff")
    text = re.sub(r"#[^\n]*", "", text)  # at comments, trimesh repeats the lines before them
    header = OFF_HEADER.match(text)
    if header is None:
        raise InputError("cannot be read: no OFF header")
    if any(header.groups()[3:]):
        raise InputError("cannot be read: OFF of other than 3 dimensions, or a binary one")
    sizes = re.match(r"\s*(\d{1,18})\s+(\d{1,18})\b", text[header.end() :])
    lines = text.count("\n", header.end()) + 1
    vertices, faces = map(int, sizes.groups()) if sizes else (0, 0)
    if not sizes or vertices + faces > lines:
        raise InputError(f"cut short or damaged: {vertices or 'no'} vertices and {faces or 'no'} faces on {lines} lines")
    if not vertices or not faces:
        raise InputError("no faces in it: point clouds are not drawn")
    mesh = mesh_of(file.name, loaded(load_off, io.StringIO("OFF" + text[header.end() :])))
    kinds = ("texture coordinates", "colours", "normals")
    said = [f"{kind} of {file.name}" for kind, given in zip(kinds, header.groups(), strict=False) if given]
    last = text.rstrip().rpartition("\n")[2].split()
    if last[0].isdecimal() and len(last) > int(last[0][:9]) + 1:
        said.append(f"colours of the faces of {file.name}")
    return MeshFile((mesh,), (None,), tuple(said))
