"""Shapes of Mitsuba's scenes as meshes and placed objects.

Mitsuba's v runs down, ours up: v = 1 - v_mitsuba. OBJ files are turned over when Mitsuba reads them (`flip_tex_coords`, by
default there), so that theirs stay. Meshes without normals get smooth ones, each face weighted by its angle at the vertex
(Thuermer and Wuethrich, "Computing Vertex Normals from Polygonal Facets", JGT 3(1), 1998), unless `face_normals` is set.
A mirroring `to_world` turns the sides of spheres and of meshes without normals of their own, as it does in Mitsuba.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..transforms import Matrix
from . import mitsuba_tessellation as tessellation
from .containment import Reach
from .description import Mesh
from .mitsuba_dictionary import children, flag, kind_of, matrix, number, vector
from .mitsuba_serialized import read_serialized
from .mitsuba_textures import existing
from .triangles import read_meshes

COMMON = ("type", "id", "to_world", "flip_normals")
PARAMETERS = {
    "obj": ("filename", "face_normals", "flip_tex_coords"),
    "ply": ("filename", "face_normals", "flip_tex_coords"),
    "serialized": ("filename", "face_normals", "flip_tex_coords", "shape_index"),
    "sphere": ("center", "radius"),
    "cylinder": ("p0", "p1", "radius"),
    "rectangle": (), "cube": (), "disk": (), "instance": (), "shapegroup": (), "merge": (),
}  # fmt: skip
LARGEST = 1e18  # its square is still a single-precision number
FROM_FILES = ("obj", "ply", "serialized")
# What may be built of mesh files: a damaged one must not ask for memory that its own size does not tell.
SPARE_BYTES, BYTES_PER_BYTE = 2**29, 16
SUFFIXES = {"obj": ".obj", "ply": ".ply"}


@dataclass(frozen=True)
class Placed:
    """A shape that is drawn: its dictionary, its name and world_from_object."""

    values: Mapping[str, Any]
    name: str
    world_from_object: Matrix


def placed_shapes(scene: Mapping[str, Any]) -> Iterator[Placed]:
    """Every shape of a scene, those of groups once for each instance. Raises InputError naming the shape."""
    counts: dict[str, int] = {}
    for key, values in children(scene, "shape"):
        counts[values["type"]] = counts.get(values["type"], 0) + 1
        unnamed = f"{values['type']} {counts[values['type']]}"
        yield from _placed(values, str(values.get("id") or (unnamed if key.startswith("_arg_") else key)), np.eye(4), 0)


def _placed(values: Mapping[str, Any], name: str, world_from_parent: Matrix, depth: int) -> Iterator[Placed]:
    kind = values["type"]
    if kind == "shapegroup" and depth == 0:
        return
    try:
        with np.errstate(all="ignore"):
            world = world_from_parent @ matrix(values)
        if not (np.abs(world) < LARGEST).all():
            raise InputError(f"to_world holds numbers beyond {LARGEST:g}")
    except InputError as error:
        raise InputError(error.problem, field=name) from None
    if kind not in ("instance", "merge", "shapegroup"):
        yield Placed(values, name, world)
        return
    inner = list(children(values, "shape"))
    if kind == "instance" and (len(inner) != 1 or inner[0][1]["type"] != "shapegroup"):
        raise InputError("an instance holds one shapegroup", field=name)
    if kind == "instance":
        yield from _placed(inner[0][1], name, world, 1)
        return
    for index, (_, item) in enumerate(inner, start=1):
        own = item.get("id") or f"{item['type']} {index}"
        yield from _placed(item, name if len(inner) == 1 else f"{name}/{own}", world, 1)


class ShapeReader:
    """Meshes of shapes, each once; `meshes`, `files` and `said` grow."""

    def __init__(self, reach: Reach) -> None:
        self.reach = reach
        self.meshes: list[Mesh] = []
        self.files: list[Path] = []
        self.said: list[str] = []
        self._known: dict[tuple, int] = {}
        self._read: dict[tuple, tuple[Mesh, bool]] = {}
        self._room = SPARE_BYTES

    def index(self, shape: Placed, has_normal_map: bool = False) -> int:
        """Of the shape's mesh, which has tangents for a normal map. Raises InputError naming the shape."""
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what becomes infinite is refused
                return self._index(shape, has_normal_map)
        except InputError as error:
            raise InputError(error.problem, file=error.file, field=error.field or shape.name) from None

    def _index(self, shape: Placed, has_normal_map: bool) -> int:
        values, kind = shape.values, shape.values["type"]
        known = (*COMMON, *PARAMETERS[kind])
        for key, value in values.items():
            if isinstance(value, Mapping) and kind_of(value) not in ("bsdf", "emitter", "sensor"):
                self.said.append(f"{value['type']} of {shape.name}")
            elif not isinstance(value, Mapping) and key not in known:
                self.said.append(f"property {key} of {shape.name}")
        parameters = self._parameters(values)
        linear = shape.world_from_object[:3, :3]
        mirrored = bool(np.linalg.det(linear) < 0)
        stretch = self._stretch(parameters, linear)
        key = (*parameters, flag(values, "flip_normals"), mirrored, stretch, has_normal_map)
        if key not in self._known:
            mesh, has_own_normals = self._mesh(parameters, stretch)
            self._room -= sum(
                array.nbytes for array in (mesh.positions, mesh.faces, mesh.normals, mesh.uv) if array is not None
            )
            if self._room < 0:
                raise InputError(f"its meshes need more than {SPARE_BYTES} bytes, and {BYTES_PER_BYTE} for each of their files")
            turns = mirrored and (kind == "sphere" or not has_own_normals)
            if turns != flag(values, "flip_normals"):
                mesh = _turned(mesh)
            if has_normal_map and mesh.uv is not None:
                mesh = replace(mesh, tangents=tangents_along_u(mesh, -1.0 if mirrored else 1.0))
            self._known[key] = len(self.meshes)
            self.meshes.append(mesh)
        return self._known[key]

    def _stretch(self, parameters: tuple, linear: NDArray[np.float64]) -> tuple[float, ...] | None:
        """The linear part of `to_world`, where it decides smooth normals: Mitsuba weighs angles in world space."""
        if parameters[0] not in FROM_FILES or parameters[4]:
            return None
        mesh, asks_for_faces = self._raw(*parameters[:3])
        if mesh.normals is not None or asks_for_faces or not np.linalg.det(linear):
            return None
        squares = linear.T @ linear
        is_similarity = np.allclose(squares, np.eye(3) * squares.trace() / 3, rtol=0, atol=1e-6 * squares.trace())
        return None if is_similarity else tuple(linear.ravel().tolist())

    def _parameters(self, values: Mapping[str, Any]) -> tuple:
        """What decides the mesh."""
        kind = values["type"]
        if kind in FROM_FILES:
            file = existing(self.reach, values.get("filename"), "mesh")
            if kind in SUFFIXES and file.suffix.lower() != SUFFIXES[kind]:
                raise InputError(f"{file.name} does not end in {SUFFIXES[kind]}")
            if file not in self.files:
                self.files.append(file)
                self._room += BYTES_PER_BYTE * file.stat().st_size
            index = values.get("shape_index", 0)
            if isinstance(index, bool) or not isinstance(index, int):
                raise InputError(f"shape_index is {str(index)[:80]!r}, an integer is expected")
            flips = flag(values, "flip_tex_coords", default=kind == "obj")
            return (kind, file, index, flips, flag(values, "face_normals"))
        if kind == "sphere":
            return (kind, *vector(values, "center", (0, 0, 0)), _positive(values))
        if kind == "cylinder":
            return (kind, *vector(values, "p0", (0, 0, 0)), *vector(values, "p1", (0, 0, 1)), _positive(values))
        return (kind,)

    def _mesh(self, parameters: tuple, stretch: tuple[float, ...] | None) -> tuple[Mesh, bool]:
        """The mesh, and whether it has normals that a mirror leaves on their side."""
        kind = parameters[0]
        if kind in FROM_FILES:
            return self._from_file(*parameters, stretch)
        if kind == "sphere":
            mesh = tessellation.sphere(np.array(parameters[1:4]), parameters[4])
        elif kind == "cylinder":
            start, end = np.array(parameters[1:4]), np.array(parameters[4:7])
            if not 0 < np.linalg.norm(end - start) < np.inf:
                raise InputError("p0 and p1 of a cylinder are one point")
            mesh = tessellation.cylinder(start, end, parameters[7])
        else:
            mesh = {"rectangle": tessellation.rectangle, "cube": tessellation.cube, "disk": tessellation.disk}[kind]()
        if not np.isfinite(mesh.positions).all():
            raise InputError(f"a {kind} that is too large")
        return mesh, True

    def _raw(self, kind: str, file: Path, index: int) -> tuple[Mesh, bool]:
        """The mesh as it stands in the file, and whether it asks for normals of faces."""
        if (file, index) not in self._read:
            if kind == "serialized":
                self._read[file, index] = read_serialized(file, index)
            else:
                self._read[file, index] = _joined(read_meshes(file, self.reach), file.stem), False
        return self._read[file, index]

    def _from_file(
        self, kind: str, file: Path, index: int, flips: bool, by_faces: bool, stretch: tuple[float, ...] | None
    ) -> tuple[Mesh, bool]:
        mesh, asks_for_faces = self._raw(kind, file, index)
        by_faces = by_faces or asks_for_faces
        has_own = mesh.normals is not None and not by_faces
        normals = mesh.normals if has_own else None if by_faces else smooth_normals(mesh, stretch)
        uv = mesh.uv
        if uv is not None and not flips:  # stored as Mitsuba's v, which runs down
            uv = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=-1)
        return replace(mesh, normals=normals, uv=uv, colors=None), has_own


def _positive(values: Mapping[str, Any]) -> float:
    radius = number(values, "radius", 1.0)
    if not radius > 0:
        raise InputError(f"radius is {radius:g}, above 0 is expected")
    return radius


def _joined(meshes: tuple[Mesh, ...], name: str) -> Mesh:
    """One mesh of several; normals and uv only where all have them."""
    if len(meshes) == 1:
        return replace(meshes[0], name=name, uv2=None, tangents=None)
    begins = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    faces = [mesh.faces + np.uint32(begin) for mesh, begin in zip(meshes, begins, strict=False)]

    def all_of(arrays: list) -> NDArray[np.float32] | None:
        return None if any(array is None for array in arrays) else np.concatenate(arrays)

    return Mesh(
        name=name,
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        faces=np.concatenate(faces),
        normals=all_of([mesh.normals for mesh in meshes]),
        uv=all_of([mesh.uv for mesh in meshes]),
    )


def smooth_normals(mesh: Mesh, stretch: tuple[float, ...] | None = None) -> NDArray[np.float32]:
    """[V, 3] unit normals in object space, the mean of the faces' weighted by their angle at the vertex; +z where no face has
    an area. stretch: world from object, [9] of a row-major 3x3 matrix, in which angles are measured."""
    linear = np.eye(3) if stretch is None else np.array(stretch).reshape(3, 3)
    corners = mesh.positions.astype(np.float64) @ linear.T
    corners = corners[mesh.faces.astype(np.int64)]
    edges = np.roll(corners, -1, axis=1) - corners  # of each corner to the next
    face = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(face, axis=-1, keepdims=True)
    face = np.divide(face, length, out=np.zeros_like(face), where=length > 0)
    before = -np.roll(edges, 1, axis=1)
    angles = np.arctan2(np.linalg.norm(np.cross(edges, before), axis=-1), (edges * before).sum(-1))
    total = np.zeros((len(mesh.positions), 3))
    for axis in range(3):
        weights = (angles * face[:, None, axis]).ravel()
        total[:, axis] = np.bincount(mesh.faces.ravel(), weights, minlength=len(mesh.positions))
    total = total @ linear * np.sign(np.linalg.det(linear))  # normals are covectors
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(length > 1e-20, total / np.maximum(length, 1e-20), [0.0, 0, 1]).astype(np.float32)


def tangents_along_u(mesh: Mesh, sign: float) -> NDArray[np.float32]:
    """[V, 4] directions of growing u, the mean of the faces', and the sign of the bitangent.

    In Mitsuba the bitangent of a normal map is cross(normal, tangent) in world space, whichever way v runs; a mirroring
    matrix turns the sign once more.
    """
    corners, uv = (array[mesh.faces.astype(np.int64)].astype(np.float64) for array in (mesh.positions, mesh.uv))
    (edge1, edge2), (uv1, uv2) = (((a[:, 1] - a[:, 0]), (a[:, 2] - a[:, 0])) for a in (corners, uv))
    determinant = uv1[:, :1] * uv2[:, 1:] - uv1[:, 1:] * uv2[:, :1]
    along = (edge1 * uv2[:, 1:] - edge2 * uv1[:, 1:]) * np.sign(determinant)
    total = np.zeros((len(mesh.positions), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(mesh.faces.ravel(), np.repeat(along[:, axis], 3), minlength=len(mesh.positions))
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    unit = np.where(length > 1e-20, total / np.maximum(length, 1e-20), [1.0, 0, 0])
    return np.concatenate([unit, np.full((len(unit), 1), sign)], axis=-1).astype(np.float32)


def _turned(mesh: Mesh) -> Mesh:
    """Its other side is the front."""
    normals = None if mesh.normals is None else -mesh.normals
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=normals)
