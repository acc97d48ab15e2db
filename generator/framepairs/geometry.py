"""Triangles on the device: attribute tables that our kernels gather from, and the structure that rays are traced through.

Mitsuba finds the triangle (`ray_intersect_preliminary`); position, normal and uv are gathered from our own tables by
object and triangle, so that a kernel has no virtual calls and a thousand instances cost no more than one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .frame import FrameState
from .scene.description import SceneDescription


@dataclass(frozen=True)
class Tables:
    """positions, normals: [3 V] and uv: [2 V] in object space; faces: [3 T] indices into them. Per object: first_face,
    material. object_of_shape: object index by Mitsuba's registry number of the shape or instance."""

    positions: mi.Float
    normals: mi.Float
    uv: mi.Float
    faces: mi.UInt32
    first_face: mi.UInt32
    material: mi.UInt32
    object_of_shape: mi.UInt32


@dataclass(frozen=True)
class Pose:
    """The scene at one time. scene: what rays are traced through. render_from_object: [12 objects], rows of 3x4 matrices
    into the space around the render origin."""

    scene: mi.Scene
    render_from_object: mi.Float


class Geometry:
    """A scene's triangles on the device, posed for any FrameState.

    Two Mitsuba scenes take turns: what was the current frame's is the previous one's when frames come in order. They are
    a cache only: a pose is found by its matrices, and built or updated where none fits.
    """

    def __init__(self, scene: SceneDescription):
        self._scene = scene
        uses = np.bincount([item.mesh for item in scene.objects], minlength=len(scene.meshes))
        self._instanced = [item.moves or uses[item.mesh] > 1 for item in scene.objects]
        self._groups = {
            item.mesh: mi.load_dict({"type": "shapegroup", "mesh": _mesh(scene.meshes[item.mesh])})
            for item, instanced in zip(scene.objects, self._instanced, strict=True)
            if instanced
        }
        self._slots: list[_Slot] = []
        self._statics: tuple[bytes, list[mi.Shape]] | None = None
        self.tables: Tables | None = None

    def pose(self, frame: FrameState) -> tuple[Pose, Pose]:
        """(current, previous). Both are one where nothing moved."""
        matrices = [
            _around(matrices, frame.render_origin)
            for matrices in (frame.world_from_object, frame.previous_world_from_object)
        ]
        keys = [matrix.tobytes() for matrix in matrices]
        current = self._slot(matrices[0], keys[0], avoid=keys[1]).pose
        previous = current if keys[0] == keys[1] else self._slot(matrices[1], keys[1], avoid=keys[0]).pose
        return current, previous

    def _slot(self, matrices: NDArray, key: bytes, avoid: bytes) -> "_Slot":
        for slot in self._slots:
            if slot.key == key:
                return slot
        statics_key = matrices[[not moves for moves in self._moving]].tobytes()
        if self._statics is None or self._statics[0] != statics_key:
            shapes = [
                _mesh(self._scene.meshes[item.mesh], matrix)
                for item, matrix, instanced in zip(self._scene.objects, matrices, self._instanced, strict=True)
                if not instanced
            ]
            self._statics = (statics_key, shapes)
            self._slots.clear()
        free = [slot for slot in self._slots if slot.key != avoid]
        if len(self._slots) < 2 or not free:
            slot = self._build(matrices, key)
            self._slots.append(slot)
            self._retabulate()
        else:
            slot = free[0]
            self._slots.remove(slot)
            slot = slot.moved(matrices, key, self._moving)
            self._slots.append(slot)
        return slot

    @property
    def _moving(self) -> list[bool]:
        return [item.moves for item in self._scene.objects]

    def _build(self, matrices: NDArray, key: bytes) -> "_Slot":
        statics = iter(self._statics[1])
        shapes: list[mi.Shape] = []
        for item, matrix, instanced in zip(self._scene.objects, matrices, self._instanced, strict=True):
            if instanced:
                transform = mi.ScalarTransform4f(_full(matrix))
                group = self._groups[item.mesh]
                shapes.append(mi.load_dict({"type": "instance", "group": group, "to_world": transform}))
            else:
                shapes.append(next(statics))
        named = {f"object_{index}": shape for index, shape in enumerate(shapes)}
        groups = {f"group_{index}": group for index, group in self._groups.items()}
        scene = mi.load_dict({"type": "scene", **groups, **named})
        return _Slot(key, matrices, shapes, Pose(scene, _upload(matrices)))

    def _retabulate(self) -> None:
        numbers = [_registry_numbers(slot.shapes) for slot in self._slots]
        table = np.zeros(1 + max((int(n.max()) for n in numbers if len(n)), default=0), dtype=np.uint32)
        for per_slot in numbers:
            table[per_slot] = np.arange(len(per_slot), dtype=np.uint32)
        if self.tables is None:
            self.tables = _tables(self._scene, table)
        else:
            self.tables = Tables(**{**vars(self.tables), "object_of_shape": mi.UInt32(table)})


@dataclass(frozen=True)
class _Slot:
    key: bytes
    matrices: NDArray
    shapes: list
    pose: Pose

    def moved(self, matrices: NDArray, key: bytes, moving: list[bool]) -> "_Slot":
        """This slot with the transforms of all moving instances that differ replaced."""
        for index, moves in enumerate(moving):
            if moves and not np.array_equal(matrices[index], self.matrices[index]):
                parameters = mi.traverse(self.shapes[index])
                transform = mi.Transform4f(_full(matrices[index]))
                dr.make_opaque(transform)
                parameters["to_world"] = transform
                parameters.update()
        scene = mi.traverse(self.pose.scene)
        scene.set_dirty(next(name for name in scene.keys() if name.endswith("to_world")))
        scene.update()
        return _Slot(key, matrices, self.shapes, Pose(self.pose.scene, _upload(matrices)))


def _around(matrices: NDArray[np.float64], origin: NDArray[np.float64]) -> NDArray[np.float32]:
    """[objects, 3, 4] float32, composed in float64."""
    shifted = matrices[:, :3, :].copy()
    shifted[:, :, 3] -= origin
    return np.ascontiguousarray(shifted, dtype=np.float32)


def _full(matrix: NDArray) -> list:
    return [*matrix.tolist(), [0, 0, 0, 1]]


def _upload(matrices: NDArray) -> mi.Float:
    return dr.opaque(mi.Float, 0) if not matrices.size else mi.Float(matrices.ravel())


def _mesh(mesh, matrix: NDArray | None = None) -> mi.Mesh:
    positions = mesh.positions
    if matrix is not None:
        exact = matrix.astype(np.float64)
        positions = (positions.astype(np.float64) @ exact[:, :3].T + exact[:, 3]).astype(np.float32)
    shape = mi.Mesh(mesh.name, len(positions), len(mesh.faces))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(positions).ravel()
    parameters["faces"] = np.ascontiguousarray(mesh.faces).ravel()
    parameters.update()
    return shape


def _registry_numbers(shapes: list) -> NDArray[np.int64]:
    pointers = [mi.ShapePtr(shape) for shape in shapes]
    return np.array([int(dr.reinterpret_array(mi.UInt32, pointer)[0]) for pointer in pointers], dtype=np.int64)


def _tables(scene: SceneDescription, object_of_shape: NDArray) -> Tables:
    vertex_counts = [len(mesh.positions) for mesh in scene.meshes]
    face_counts = [len(mesh.faces) for mesh in scene.meshes]
    first_vertex = np.concatenate([[0], np.cumsum(vertex_counts)])
    first_face = np.concatenate([[0], np.cumsum(face_counts)])

    def gathered(arrays: list[NDArray], dtype) -> NDArray:
        return np.concatenate([np.ascontiguousarray(a, dtype=dtype).ravel() for a in arrays if a.size] or [np.zeros(12, dtype)])

    def or_zeros(array: NDArray | None, count: int, width: int) -> NDArray:
        return np.zeros((count, width), np.float32) if array is None else array

    faces = [mesh.faces.astype(np.int64) + first_vertex[index] for index, mesh in enumerate(scene.meshes)]
    meshes = [item.mesh for item in scene.objects]
    return Tables(
        positions=mi.Float(gathered([mesh.positions for mesh in scene.meshes], np.float32)),
        normals=mi.Float(gathered([or_zeros(m.normals, len(m.positions), 3) for m in scene.meshes], np.float32)),
        uv=mi.Float(gathered([or_zeros(m.uv, len(m.positions), 2) for m in scene.meshes], np.float32)),
        faces=mi.UInt32(gathered(faces, np.uint32)),
        first_face=mi.UInt32(first_face[meshes].astype(np.uint32) if meshes else np.zeros(1, np.uint32)),
        material=mi.UInt32(np.array([item.material for item in scene.objects] or [0], dtype=np.uint32)),
        object_of_shape=mi.UInt32(object_of_shape),
    )
