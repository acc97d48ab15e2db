"""Small glTF files, built from arrays, for the tests of the scene readers."""

import base64
import json
import struct

import numpy as np

from framepairs.scene import load_scene

COMPONENT_TYPES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
CORNERS = np.float32([[0, 0, 0], [1, 0, 0], [0, 2, 0]])


class GltfFile:
    """A glTF file in the making; every method gives back the index of what it added."""

    def __init__(self, **keys):
        self.json = {"asset": {"version": "2.0"}, "nodes": [], "meshes": [], "accessors": [], "bufferViews": [], **keys}
        self.data = b""

    def _add(self, kind, item):
        self.json.setdefault(kind, []).append(item)
        return len(self.json[kind]) - 1

    def view(self, data, **keys):
        self.data += bytes(-len(self.data) % 4)
        start, self.data = len(self.data), self.data + data
        return self._add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **keys})

    def accessor(self, values, **keys):
        """values: [count] or [count, width], of one of glTF's component types; 4x4 matrices are stored by columns."""
        values = np.asarray(values)
        values = values.transpose(0, 2, 1) if values.ndim == 3 else values
        values = values.reshape(len(values), -1)
        kind = {"componentType": COMPONENT_TYPES[str(values.dtype)], "type": TYPES[values.shape[1]], "count": len(values)}
        return self._add("accessors", {"bufferView": self.view(values.tobytes()), **kind, **keys})

    def mesh(self, positions=CORNERS, faces=None, *, targets=(), primitive_keys=(), mesh_keys=(), **attributes):
        """A mesh of one primitive; attributes and targets (dicts of attributes) are arrays or indices of accessors."""

        def index_of(values):
            return values if isinstance(values, int) else self.accessor(values)

        primitive = {"attributes": {k: index_of(v) for k, v in {"POSITION": positions, **attributes}.items()}}
        if faces is not None:
            primitive["indices"] = self.accessor(np.uint32(faces).ravel())
        if targets:
            primitive["targets"] = [{k: index_of(v) for k, v in target.items()} for target in targets]
        return self._add("meshes", {"primitives": [{**primitive, **dict(primitive_keys)}], **dict(mesh_keys)})

    def node(self, **keys):
        return self._add("nodes", keys)

    def skin(self, joints, joint_from_bind=None, **keys):
        if joint_from_bind is not None:
            keys["inverseBindMatrices"] = self.accessor(np.float32(joint_from_bind))
        return self._add("skins", {"joints": joints, **keys})

    def clip(self, *channels, name=None):
        """channels: (node, path, times, values, interpolation), times and values as arrays or indices of accessors."""
        clip = {"channels": [], "samplers": [], **({"name": name} if name else {})}
        for number, (node, path, times, values, interpolation) in enumerate(channels):
            times, values = (item if isinstance(item, int) else self.accessor(np.float32(item)) for item in (times, values))
            clip["channels"].append({"sampler": number, "target": {"node": node, "path": path}})
            clip["samplers"].append({"input": times, "output": values, "interpolation": interpolation})
        return self._add("animations", clip)

    def save(self, folder, name="scene.gltf"):
        """Writes the .gltf with its buffer inside, or the .glb."""
        file, buffer = folder / name, {"byteLength": len(self.data)}
        if name.endswith(".glb"):
            text = json.dumps({**self.json, "buffers": [buffer]}).encode()
            text += b" " * (-len(text) % 4)
            data = self.data + bytes(-len(self.data) % 4)
            chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
            file.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
        else:
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            file.write_text(json.dumps({**self.json, "buffers": [buffer]}))
        return file

    def load(self, folder, clip=None):
        return load_scene(self.save(folder), clip)


def moved(x, y, z):
    """The 4x4 matrix of a translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def turned_about_z(degrees):
    """The quaternion (x, y, z, w)."""
    half = np.radians(degrees) / 2
    return [0, 0, float(np.sin(half)), float(np.cos(half))]


def world_vertices(scene, index, time_s):
    """[V, 3] float64: where the vertices of object `index` are at a time."""
    mesh = scene.objects[index].mesh
    deformed = scene.deformed(time_s) if scene.deformed else {}
    positions = (deformed[mesh] if mesh in deformed else scene.meshes[mesh]).positions.astype(float)
    matrix = scene.world_from_object(time_s)[index]
    return positions @ matrix[:3, :3].T + matrix[:3, 3]
