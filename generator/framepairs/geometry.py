"""Triangles on the device: attribute tables that our kernels gather from, and the structure that rays are traced through.

Mitsuba finds the triangle (`ray_intersect_preliminary`); position, normal and uv are gathered from our own tables by
object and triangle, so that a kernel has no virtual calls and a thousand instances cost no more than one.
"""

import hashlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .frame import FrameState, ObjectStates
from .scene.description import Deformed, Mesh, SceneDescription, has_colors, has_tangents, slots_of


@dataclass(frozen=True)
class Tables:
    """uv: [2 V]; uv2, colors, tangents: [2 V], [4 V], [4 V], None where no material reads them; faces: [3 T] indices into
    vertices. Per object: first_face, material, single_sided. object_of_shape: object index by Mitsuba's registry number of
    the shape or instance."""

    uv: mi.Float
    uv2: mi.Float | None
    colors: mi.Float | None
    tangents: mi.Float | None
    faces: mi.UInt32
    first_face: mi.UInt32
    material: mi.UInt32
    single_sided: mi.Bool
    object_of_shape: mi.UInt32


@dataclass(frozen=True)
class Pose:
    """The scene at one time. scene: what rays are traced through, if any. render_from_object: [12 objects], 3x4 matrices
    into the space around the render origin, and precise_from_object the same in float64. positions, normals: [3 V] in
    object space. hidden: [objects], not drawn."""

    scene: mi.Scene | None
    render_from_object: mi.Float
    precise_from_object: mi.Float64
    positions: mi.Float
    normals: mi.Float
    hidden: mi.Bool


@dataclass(frozen=True)
class _Placement:
    """All objects around a render origin. precise, matrices: [objects, 3, 4], float64 and rounded. hidden: [objects], also
    where a matrix is singular."""

    precise: NDArray[np.float64]
    matrices: NDArray[np.float32]
    hidden: NDArray[np.bool_]
    deformed: dict[int, Deformed]
    key: bytes


class Geometry:
    """A scene's triangles on the device, posed for any FrameState.

    Two Mitsuba scenes take turns: what was the current frame's is the previous one's when frames come in order. They are
    a cache only: a pose is found by what decides it, and built or updated where none fits. hides: objects may be hidden, so
    rays must ask. culls: camera rays pass the back faces of some objects.
    """

    def __init__(self, scene: SceneDescription, cull_back_faces: bool = False):
        self._scene = scene
        uses = np.bincount([item.mesh for item in scene.objects], minlength=len(scene.meshes))
        deforms = [scene.meshes[item.mesh].deforms for item in scene.objects]
        pairs = zip(scene.objects, deforms, strict=True)
        self._instanced = [uses[item.mesh] > 1 or (item.moves and not deforming) for item, deforming in pairs]
        self._fixed = [not item.moves for item in scene.objects]
        grouped = {item.mesh for item, instanced in zip(scene.objects, self._instanced, strict=True) if instanced}
        self._changing = sorted(mesh for mesh in grouped if scene.meshes[mesh].deforms)
        self._groups = {mesh: _group(scene.meshes[mesh]) for mesh in sorted(grouped - {*self._changing})}
        self._slots: list[_Slot] = []
        self._statics: tuple[bytes, dict[int, mi.Shape]] | None = None
        self._still = tuple(mi.Float(array.ravel()) for array in _vertices(scene))
        self._first_vertex = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
        self.hides = scene.visible is not None
        self.culls = cull_back_faces and not all(item.double_sided for item in scene.objects)
        self.tables: Tables | None = None

    def pose(self, frame: FrameState) -> tuple[Pose, Pose]:
        """(current, previous). Both are one where nothing moved."""
        now, before = (_placement(states, frame.render_origin) for states in (frame.objects, frame.previous_objects))
        self.hides |= bool(now.hidden.any() or before.hidden.any())
        current = self._slot(now, avoid=before.key).pose
        return current, current if now.key == before.key else self._slot(before, avoid=now.key).pose

    def pose_without_rays(self, states: ObjectStates, origin: NDArray[np.float64]) -> Pose:
        """Where everything is at another time, for motion alone: nothing can be traced through it."""
        return self._pose(None, _placement(states, origin))

    def _slot(self, placed: _Placement, avoid: bytes) -> "_Slot":
        for slot in self._slots:
            if slot.placed.key == placed.key:
                return slot
        statics_key = placed.matrices[self._fixed].tobytes()
        if self._statics is None or self._statics[0] != statics_key:
            statics = {k: self._shape(k, placed, self._groups) for k, fixed in enumerate(self._fixed) if fixed}
            self._statics = (statics_key, statics)
            self._slots.clear()
        free = [slot for slot in self._slots if slot.placed.key != avoid]
        if len(self._slots) < 2 or not free:
            slot = self._build(placed)
            self._slots.append(slot)
            self._retabulate()
        else:
            slot = free[0]
            self._slots = [other for other in self._slots if other is not slot]
            self._move(slot, placed)
            slot = replace(slot, placed=placed, pose=self._pose(slot.pose.scene, placed))
            self._slots.append(slot)
        return slot

    def _build(self, placed: _Placement) -> "_Slot":
        fixed, meshes = self._statics[1], self._scene.meshes
        own = {mesh: _group(meshes[mesh], self._positions(mesh, placed)) for mesh in self._changing}
        groups = self._groups | own
        shapes = [fixed[k] if k in fixed else self._shape(k, placed, groups) for k in range(len(self._scene.objects))]
        named = {f"group_{mesh}": group for mesh, group in groups.items()}
        named |= {f"object_{index}": shape for index, shape in enumerate(shapes)}
        scene = mi.load_dict({"type": "scene", **named})
        return _Slot(placed, shapes, own, mi.traverse(scene), self._pose(scene, placed))

    def _shape(self, index: int, placed: _Placement, groups: dict[int, mi.Shape]) -> mi.Shape:
        item = self._scene.objects[index]
        matrix = placed.matrices[index]
        if self._instanced[index]:
            transform = mi.ScalarTransform4f(_invertible(matrix))
            return mi.load_dict({"type": "instance", "group": groups[item.mesh], "to_world": transform})
        return _mesh(self._scene.meshes[item.mesh], _moved(self._positions(item.mesh, placed), matrix))

    def _move(self, slot: "_Slot", placed: _Placement) -> None:
        """Replace what differs: transforms of instances, vertices of meshes that deform (once for all their instances)."""
        changed = self._reshape_groups(slot, placed)
        for index in np.flatnonzero(~np.array(self._fixed, dtype=bool)):
            item, matrix, old = self._scene.objects[index], placed.matrices[index], slot.placed.matrices[index]
            same = np.array_equal(matrix, old)
            if self._instanced[index]:
                if same:
                    continue
                # A literal, for kernels read transforms from tables of ours: opaque, it would be 32 arrays to read back.
                slot.parameters[f"object_{index}.to_world"] = mi.Transform4f(_invertible(matrix))
            else:
                positions, before = (self._positions(item.mesh, p) for p in (placed, slot.placed))
                if same and np.array_equal(positions, before):
                    continue
                slot.parameters[f"object_{index}.vertex_positions"] = mi.Float(_moved(positions, matrix).ravel())
            changed = True
        if changed:
            slot.parameters.update()

    def _reshape_groups(self, slot: "_Slot", placed: _Placement) -> bool:
        """Gives the groups of meshes that deform their vertices, and marks an instance of each."""
        changed = False
        for mesh, group in slot.groups.items():
            positions = self._positions(mesh, placed)
            if not np.array_equal(positions, self._positions(mesh, slot.placed)):
                parameters = mi.traverse(group)
                parameters["mesh.vertex_positions"] = mi.Float(positions.ravel())
                parameters.update()
                user = next(k for k, item in enumerate(self._scene.objects) if item.mesh == mesh)
                slot.parameters.set_dirty(f"object_{user}.to_world")
                changed = True
        return changed

    def _positions(self, mesh: int, placed: _Placement) -> NDArray[np.float32]:
        return placed.deformed.get(mesh, self._scene.meshes[mesh]).positions

    def _pose(self, scene: mi.Scene | None, placed: _Placement) -> Pose:
        positions, normals = (mi.Float(array) for array in self._still)  # copied, on the device, when something is put in
        for mesh, vertices in placed.deformed.items():
            first = int(self._first_vertex[mesh])
            _put(positions, first, vertices.positions)
            if vertices.normals is not None:
                _put(normals, first, vertices.normals)
        hidden = mi.Bool(placed.hidden if len(placed.hidden) else np.zeros(1, dtype=bool))
        precise = mi.Float64(placed.precise.ravel()) if placed.precise.size else dr.opaque(mi.Float64, 0)
        return Pose(scene, _upload(placed.matrices), precise, positions, normals, hidden)

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
    """A Mitsuba scene: its shapes, the groups that deform, and what `mi.traverse` found in it."""

    placed: _Placement
    shapes: list
    groups: dict[int, mi.Shape]
    parameters: mi.SceneParameters
    pose: Pose


def _placement(states: ObjectStates, origin: NDArray[np.float64]) -> _Placement:
    precise = states.world_from_object[:, :3, :].copy()
    precise[:, :, 3] -= origin
    matrices = np.ascontiguousarray(precise, dtype=np.float32)
    regular = np.abs(np.linalg.det(matrices[:, :, :3].astype(np.float64))) > 0
    hidden = ~(states.visible & regular)
    digest = hashlib.blake2b(precise.tobytes() + hidden.tobytes())
    for mesh, vertices in sorted(states.deformed.items()):
        digest.update(mesh.to_bytes(4, "little") + vertices.positions.tobytes())
        digest.update(b"" if vertices.normals is None else vertices.normals.tobytes())
    return _Placement(precise, matrices, hidden, states.deformed, digest.digest())


def _invertible(matrix: NDArray[np.float32]) -> list[list[float]]:
    """The matrix [4, 4], or the identity for a singular one: its object is hidden, and Mitsuba needs an inverse."""
    regular = abs(np.linalg.det(matrix[:, :3].astype(np.float64))) > 0
    return [*(matrix if regular else np.eye(4, dtype=np.float32)[:3]).tolist(), [0, 0, 0, 1]]


def _moved(positions: NDArray[np.float32], matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    exact = matrix.astype(np.float64)
    return (positions.astype(np.float64) @ exact[:, :3].T + exact[:, 3]).astype(np.float32)


def _put(values: mi.Float, first: int, rows: NDArray[np.float32]) -> None:
    """Replaces rows [n, 3] of `values` from row `first` on; what stands still is not uploaded again."""
    place = dr.arange(mi.UInt32, rows.size) + dr.opaque(mi.UInt32, 3 * first)
    dr.scatter(values, mi.Float(rows.ravel()), place)


def _upload(matrices: NDArray) -> mi.Float:
    return dr.opaque(mi.Float, 0) if not matrices.size else mi.Float(matrices.ravel())


def _mesh(mesh: Mesh, positions: NDArray[np.float32] | None = None) -> mi.Mesh:
    positions = mesh.positions if positions is None else positions
    shape = mi.Mesh(mesh.name, len(positions), len(mesh.faces))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(positions).ravel()
    parameters["faces"] = np.ascontiguousarray(mesh.faces).ravel()
    parameters.update()
    return shape


def _group(mesh: Mesh, positions: NDArray[np.float32] | None = None) -> mi.Shape:
    """What instances of a mesh refer to."""
    return mi.load_dict({"type": "shapegroup", "mesh": _mesh(mesh, positions)})


def _registry_numbers(shapes: list) -> NDArray[np.int64]:
    pointers = [mi.ShapePtr(shape) for shape in shapes]
    return np.array([int(dr.reinterpret_array(mi.UInt32, pointer)[0]) for pointer in pointers], dtype=np.int64)


def _vertices(scene: SceneDescription) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(positions, normals) [V, 3] of all meshes; zeros where a mesh has no normals."""
    normals = [np.zeros_like(mesh.positions) if mesh.normals is None else mesh.normals for mesh in scene.meshes]
    return _gathered([mesh.positions for mesh in scene.meshes], np.float32, 3), _gathered(normals, np.float32, 3)


def _tables(scene: SceneDescription, object_of_shape: NDArray) -> Tables:
    first_vertex = np.concatenate([[0], np.cumsum([len(mesh.positions) for mesh in scene.meshes])])
    first_face = np.concatenate([[0], np.cumsum([len(mesh.faces) for mesh in scene.meshes])])
    slots = [slot for material in scene.materials for slot in slots_of(material)]
    has_bumps = any(material.normal_texture is not None for material in scene.materials)
    faces = [mesh.faces.astype(np.int64) + first_vertex[index] for index, mesh in enumerate(scene.meshes)]
    meshes = [item.mesh for item in scene.objects]
    return Tables(
        uv=_attribute(scene, "uv", (0, 0)),
        uv2=_attribute(scene, "uv2", (0, 0)) if any(slot.uv_set == 1 for slot in slots) else None,
        colors=_attribute(scene, "colors", (1, 1, 1, 1)) if has_colors(scene) else None,
        tangents=_attribute(scene, "tangents", (0, 0, 0, 0)) if has_bumps and has_tangents(scene) else None,
        faces=mi.UInt32(_gathered(faces, np.uint32, 3).ravel()),
        first_face=mi.UInt32(first_face[meshes].astype(np.uint32) if meshes else np.zeros(1, np.uint32)),
        material=mi.UInt32(np.array([item.material for item in scene.objects] or [0], dtype=np.uint32)),
        single_sided=mi.Bool(np.array([not item.double_sided for item in scene.objects] or [False])),
        object_of_shape=mi.UInt32(object_of_shape),
    )


def _attribute(scene: SceneDescription, name: str, otherwise: tuple[float, ...]) -> mi.Float:
    """Values per vertex of all meshes; `otherwise` for meshes without them."""
    width = len(otherwise)
    given = [(getattr(mesh, name), len(mesh.positions)) for mesh in scene.meshes]
    filled = [np.full((count, width), otherwise, np.float32) if values is None else values for values, count in given]
    return mi.Float(_gathered(filled, np.float32, width).ravel())


def _gathered(arrays: list[NDArray], dtype, width: int) -> NDArray:
    """All rows [n, width]; a few zeros where there are none."""
    rows = [np.asarray(array, dtype=dtype).reshape(-1, width) for array in arrays if array.size]
    return np.concatenate(rows or [np.zeros((4, width), dtype)])
