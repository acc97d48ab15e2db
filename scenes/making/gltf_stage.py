"""A glTF file that a build script fills: materials, named meshes, skeletons, one clip of animation, and lights.

<name>.gltf holds nodes, materials, animation and lights, <name>.bin the arrays. Arrays of the same bytes are stored once.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf

from .gltf_values import Look, quaternion, rounded, textured, unit_integers
from .shapes import Shape

KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
VERTICES, CORNERS = 34962, 34963  # targets of buffer views


class GltfStage:
    """`group` makes a node, `add` a node with a mesh, `figure` nodes that a skin moves. Names are whole paths."""

    def __init__(self, folder: Path, name: str, looks: Mapping[str, Look], seconds: float) -> None:
        self.folder, self.name, self.looks, self.seconds = folder, name, looks, seconds
        self.triangles = self.objects = 0
        self._nodes: list[dict] = []
        self._top: list[int] = []
        self._data = bytearray()
        self._views: list[dict] = []
        self._accessors: list[dict] = []
        self._meshes: list[dict] = []
        self._materials: list[dict] = []
        self._textures: list[str] = []
        self._skins: list[dict] = []
        self._lights: list[dict] = []
        self._samplers: list[dict] = []
        self._channels: list[dict] = []
        self._known: dict = {}

    def group(self, name: str, place=(0, 0, 0), turn: float = 0, size: float = 1, parent: int | None = None) -> int:
        """A node at `place`, turned by `turn` degrees about y and scaled; its index."""
        node: dict = {"name": name}
        if any(place):
            node["translation"] = rounded(place, 5)
        if turn:
            node["rotation"] = rounded((0, np.sin(np.radians(turn) / 2), 0, np.cos(np.radians(turn) / 2)), 6)
        if size != 1:
            node["scale"] = [round(float(size), 5)] * 3
        return self._node(node, parent)

    def add(
        self,
        name: str,
        shape: Shape,
        material: str,
        place=(0, 0, 0),
        turn: float = 0,
        size: float = 1,
        parent=None,
        colors=None,
    ) -> int:
        """A mesh, placed like a group. Equal shapes share their arrays. colors: [V, 3], which multiply the base colour."""
        node = self.group(name, place, turn, size, parent)
        attributes = {
            "POSITION": self.array(shape.points.round(5).astype("f4"), target=VERTICES, bounds=True),
            "NORMAL": self._normals(shape, material),
            "TEXCOORD_0": self.array(self._uv(shape, material), target=VERTICES),
        }
        if colors is not None:
            attributes["COLOR_0"] = self._colors(colors)
        self._nodes[node]["mesh"] = self._mesh(attributes, shape.faces, material)
        return node

    def _normals(self, shape: Shape, material: str) -> int:
        """In 16 bits where reflections are sharp enough to show 8."""
        _, factor = textured(self.looks[material].roughness, 1)
        return self.array(unit_integers(shape.normals, "i2" if factor[0] < 0.45 else "i1"), target=VERTICES, normalized=True)

    def _colors(self, colors: np.ndarray) -> int:
        rgba = np.concatenate([np.clip(colors, 0, 1), np.ones_like(colors[:, :1])], axis=1)
        return self.array(np.round(rgba * 255).astype("u1"), target=VERTICES, normalized=True)

    def _uv(self, shape: Shape, material: str) -> np.ndarray:
        """v runs down in glTF. Whole repeats before the origin are taken off, so that float32 stays fine."""
        uv = shape.st * [1, -1] / self.looks[material].tile + [0, 1]
        return uv.round(5).astype("f4")

    def put(self, node: int, place=None, rotation=None) -> None:
        """Place a node anew, or turn it by a quaternion x, y, z, w."""
        if place is not None:
            self._nodes[node]["translation"] = rounded(place, 5)
        if rotation is not None:
            self._nodes[node]["rotation"] = rounded(rotation, 6)

    def skin(self, joints: Sequence[int], joint_from_bind: np.ndarray) -> int:
        """joint_from_bind: [joints, 4, 4]."""
        columns = joint_from_bind.transpose(0, 2, 1).reshape(-1, 16).round(6).astype("f4")
        self._skins.append({"joints": list(joints), "inverseBindMatrices": self.array(columns)})
        return len(self._skins) - 1

    def add_skinned(self, name: str, shape: Shape, skinning: tuple, colors: np.ndarray, material: str, skin: int, parent: int):
        """A mesh that `skin` moves. skinning: joints [V, 4] and weights [V, 4] of sum 1. colors: [V, 3], linear, 0 to 1."""
        joints, weights = skinning
        eighths = np.round(weights * 255).astype(int)
        eighths[:, 0] += 255 - eighths.sum(axis=1)  # the heaviest stands first
        attributes = {
            "POSITION": self.array(shape.points.round(5).astype("f4"), target=VERTICES, bounds=True),
            "NORMAL": self._normals(shape, material),
            "TEXCOORD_0": self.array(self._uv(shape, material), target=VERTICES),
            "JOINTS_0": self.array(joints.astype("u1"), target=VERTICES),
            "WEIGHTS_0": self.array(eighths.astype("u1"), target=VERTICES, normalized=True),
        }
        if (colors < 1).any():
            attributes["COLOR_0"] = self._colors(colors)
        node = self._node({"name": name}, parent)
        self._nodes[node]["skin"] = skin
        self._nodes[node]["mesh"] = self._mesh(attributes, shape.faces, material)

    def animate(self, node: int, path: str, times: np.ndarray, values: np.ndarray, first: int = 0) -> None:
        """Move a node's 'translation', 'rotation' (x, y, z, w) or 'scale' through values[first:] [K, n] at times [K], seconds.

        Nodes that start at different places of the same values share them.
        """
        if path == "rotation":
            stored = unit_integers(values, "i2")
        else:
            stored = values.round(5).astype("f4")
        output = self.array(stored, normalized=path == "rotation")
        if first or len(times) < len(values):
            part = self._accessors[output] | {"count": len(times), "byteOffset": first * stored.itemsize * stored.shape[1]}
            if ("part", str(part)) not in self._known:
                self._known["part", str(part)] = len(self._accessors)
                self._accessors.append(part)
            output = self._known["part", str(part)]
        key = self.array(times.round(5).astype("f4")[:, None], bounds=True), output
        if key not in self._known:
            self._known[key] = len(self._samplers)
            self._samplers.append({"input": key[0], "output": key[1]})
        self._channels.append({"sampler": self._known[key], "target": {"node": node, "path": path}})

    def light(self, name: str, kind: str, color, intensity: float, place=(0, 0, 0), towards=(0, -1, 0), cone=None) -> None:
        """A 'directional', 'point' or 'spot' light that shines along `towards`; cone: its two half angles in degrees."""
        entry = {"name": name, "type": kind, "color": rounded(color, 4), "intensity": intensity}
        if cone:
            entry["spot"] = {"innerConeAngle": round(np.radians(cone[0]), 5), "outerConeAngle": round(np.radians(cone[1]), 5)}
        self._lights.append(entry)
        z = -np.array(towards, float) / np.linalg.norm(towards)
        x = np.cross((0, 1, 0) if abs(z[1]) < 0.99 else (1, 0, 0), z)
        x /= np.linalg.norm(x)
        rotation = quaternion(np.stack([x, np.cross(z, x), z], axis=1))
        node = {"name": name, "translation": rounded(place, 4), "rotation": rounded(rotation, 6)}
        node["extensions"] = {"KHR_lights_punctual": {"light": len(self._lights) - 1}}
        self._node(node, None)

    def array(self, values: np.ndarray, target: int | None = None, normalized: bool = False, bounds: bool = False) -> int:
        """The accessor of values [count, width]; rows of vertices begin at multiples of four bytes."""
        size, width = values.dtype.itemsize, values.shape[1]
        data = np.ascontiguousarray(values.astype(values.dtype.newbyteorder("<")))
        stride = -(-size * width // 4) * 4 if target == VERTICES else size * width
        rows = np.zeros((len(values), stride), np.uint8)
        rows[:, : size * width] = data.view(np.uint8).reshape(len(values), -1)
        content = rows.tobytes()
        key = content, str(values.dtype), width, target, normalized
        if key not in self._known:
            self._data += b"\0" * (-len(self._data) % 4)
            view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(content)}
            if target:
                view["target"] = target
            if stride != size * width:
                view["byteStride"] = stride
            self._data += content
            self._views.append(view)
            accessor = {
                "bufferView": len(self._views) - 1,
                "componentType": COMPONENTS[values.dtype.str[1:]],
                "count": len(values),
                "type": KINDS[width],
            }
            if normalized:
                accessor["normalized"] = True
            if bounds:
                accessor |= {"min": values.min(axis=0).astype(float).tolist(), "max": values.max(axis=0).astype(float).tolist()}
            self._accessors.append(accessor)
            self._known[key] = len(self._accessors) - 1
        return self._known[key]

    def _node(self, node: dict, parent: int | None) -> int:
        self._nodes.append(node)
        index = len(self._nodes) - 1
        (self._top if parent is None else self._nodes[parent].setdefault("children", [])).append(index)
        return index

    def _mesh(self, attributes: dict[str, int], faces: np.ndarray, material: str) -> int:
        kind = "u2" if faces.max() < 65535 else "u4"
        corners = self.array(faces.reshape(-1, 1).astype(kind), target=CORNERS)
        primitive = {"attributes": attributes, "indices": corners, "material": self._material(material)}
        key = "mesh", tuple(attributes.items()), corners, material
        if key not in self._known:
            self._known[key] = len(self._meshes)
            self._meshes.append({"primitives": [primitive]})
        self.triangles, self.objects = self.triangles + len(faces), self.objects + 1
        return self._known[key]

    def _material(self, name: str) -> int:
        if ("look", name) in self._known:
            return self._known["look", name]
        look = self.looks[name]
        image, tint = textured(look.base, 3)
        pbr = {"baseColorFactor": [*rounded(tint, 4), 1], "metallicFactor": look.metallic}
        if image:
            pbr["baseColorTexture"] = self._texture(image)
        image, factor = textured(look.roughness, 1)
        pbr["roughnessFactor"] = factor[0]
        if image:
            pbr["metallicRoughnessTexture"] = self._texture(image)
        entry = {"name": name, "pbrMetallicRoughness": pbr, "doubleSided": True}
        if look.normal:
            image, scale = textured(look.normal if isinstance(look.normal, tuple) else (look.normal, 1), 1)
            entry["normalTexture"] = self._texture(image) | {"scale": scale[0]}
        if look.emission:
            image, radiance = textured(look.emission, 3)
            strength = max(*radiance, 1)
            entry["emissiveFactor"] = rounded(np.array(radiance) / strength, 5)
            if image:
                entry["emissiveTexture"] = self._texture(image)
            if strength > 1:
                entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        if look.mask:
            entry |= {"alphaMode": "MASK", "alphaCutoff": 0.5}
        self._materials.append(entry)
        self._known["look", name] = len(self._materials) - 1
        return len(self._materials) - 1

    def _texture(self, image: str) -> dict:
        if image not in self._textures:
            self._textures.append(image)
        return {"index": self._textures.index(image)}

    def save(self) -> None:
        """Write both files."""
        used = ["KHR_mesh_quantization"] + (["KHR_lights_punctual"] if self._lights else [])
        used += ["KHR_materials_emissive_strength"] if any("extensions" in item for item in self._materials) else []
        (self.folder / f"{self.name}.bin").write_bytes(bytes(self._data))
        document = {
            "asset": {"version": "2.0", "generator": "framepairs scenes"},
            "extensionsUsed": used,
            "extensionsRequired": ["KHR_mesh_quantization"],
            "extensions": {"KHR_lights_punctual": {"lights": self._lights}} if self._lights else {},
            "scene": 0,
            "scenes": [{"nodes": self._top}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": self._materials,
            "textures": [{"source": index} for index in range(len(self._textures))],
            "images": [{"uri": f"textures/{image}.png"} for image in self._textures],
            "skins": self._skins,
            "animations": [{"name": self.name, "channels": self._channels, "samplers": self._samplers}],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"uri": f"{self.name}.bin", "byteLength": len(self._data)}],
        }
        if not self._channels:
            del document["animations"]
        text = gltf.GLTF2.from_dict(document).gltf_to_json(indent=None, separators=(",", ":"))
        (self.folder / f"{self.name}.gltf").write_text(text + "\n")
