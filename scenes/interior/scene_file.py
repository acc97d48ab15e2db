"""A Mitsuba scene that a build script fills: BSDFs, meshes, emitters, and the animation file beside it.

<name>.xml names everything. Meshes of few triangles are PLY files (trimesh writes them), the others lie packed in
<name>.serialized, Mitsuba's own format. Shapes share them.
"""

import json
import shutil
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import trimesh
from scenes.making.shapes import Shape

Rgb = tuple[float, float, float]
FEW = 400  # triangles
SINGLE_NORMALS_UV = 0x1003  # flags of a serialized mesh


@dataclass(frozen=True)
class Look:
    """A BSDF. kind: `principled`, or the name of a metal for `roughconductor`, or `diffuse`.

    base: linear RGB or the name of an image; roughness: a number or the name of an image; both without suffix, PNG files of
    the folder `textures`. tile: metres per repeat of shapes whose st is in metres. specular: F0 / 0.08 of dielectrics.
    """

    base: Rgb | str
    roughness: float | str
    metallic: float = 0
    normal: str | None = None
    tile: float = 1
    specular: float = 0.5
    kind: str = "principled"
    two_sided: bool = False


class SceneFile:
    """The scene `name` in `folder`: `add` places a shape, `spot` and `point` light it, `animate` moves it, `save` writes it."""

    def __init__(self, folder: Path, name: str, looks: Mapping[str, Look]) -> None:
        self.folder, self.name, self.looks = folder, name, looks
        self.root = Xml.Element("scene", version="3.0.0")
        self.meshes: dict[str, Shape] = {}
        self.packed: dict[str, bytes] = {}
        self.tracks: dict[str, dict] = {}
        self.shapes = self.triangles = 0
        shutil.rmtree(folder / "meshes", ignore_errors=True)
        (folder / "meshes").mkdir(parents=True)
        for key, look in looks.items():
            self._bsdf(key, look)

    def add(
        self,
        name: str,
        shape: Shape | str | tuple[str, dict[str, str]],
        look: str,
        place=(0, 0, 0),
        turn: float = 0,
        size: float | tuple[float, float, float] = 1,
        glow: Rgb | str | None = None,
    ) -> None:
        """Place a shape, or a mesh that `mesh` made before, or a (plugin, numbers) of Mitsuba's, scaled, turned about y by
        degrees and moved. glow: emitted radiance, or the EXR image of it."""
        if isinstance(shape, Shape):
            shape = self.mesh(name.replace("/", "_").lower(), shape)
        plugin = shape[0] if isinstance(shape, tuple) else "serialized" if shape in self.packed else "ply"
        item = Xml.SubElement(self.root, "shape", type=plugin, id=name)
        if isinstance(shape, tuple):
            for key, value in shape[1].items():
                Xml.SubElement(item, "point" if "," in value else "float", name=key, value=value)
        else:
            file = f"{self.name}.serialized" if shape in self.packed else f"meshes/{shape}.ply"
            Xml.SubElement(item, "string", name="filename", value=file)
            if shape in self.packed:
                Xml.SubElement(item, "integer", name="shape_index", value=str(list(self.packed).index(shape)))
            self.triangles += len(self.meshes[shape].faces)
        transform = Xml.Element("transform", name="to_world")
        if size != 1:
            Xml.SubElement(transform, "scale", value=_text(np.broadcast_to(size, 3)))
        if turn:
            Xml.SubElement(transform, "rotate", y="1", angle=f"{turn:.6g}")
        if any(place):
            Xml.SubElement(transform, "translate", value=_text(place))
        if len(transform):
            item.append(transform)
        Xml.SubElement(item, "ref", id=look)
        if glow is not None:
            emitter = Xml.SubElement(item, "emitter", type="area")
            if isinstance(glow, str):
                self._image(emitter, "radiance", f"{glow}.exr", 1)
            else:
                Xml.SubElement(emitter, "rgb", name="radiance", value=_text(glow))
            # Lamps shine through spots; what of them glows is seen, and is no light to be sampled.
            Xml.SubElement(emitter, "float", name="sampling_weight", value="0")
        self.shapes += 1

    def mesh(self, name: str, shape: Shape) -> str:
        """Write a mesh once; its name is what `add` takes."""
        assert name not in self.meshes, name
        self.meshes[name] = shape
        points, normals = _stepped(shape.points, 2**14), _stepped(shape.normals, 2**8)
        uv = _stepped(np.stack([shape.st[:, 0], 1 - shape.st[:, 1]], axis=-1), 2**13)  # Mitsuba's v runs down
        if len(shape.faces) > FEW:
            head = (
                struct.pack("<I", SINGLE_NORMALS_UV) + name.encode() + b"\0" + struct.pack("<QQ", len(points), len(shape.faces))
            )
            arrays = (points, normals, uv, shape.faces.astype("<u4"))
            stream = zlib.compress(head + b"".join(array.tobytes() for array in arrays), 9)
            self.packed[name] = struct.pack("<HH", 0x041C, 4) + stream
            return name
        visual = trimesh.visual.TextureVisuals(uv=uv)
        solid = trimesh.Trimesh(points, shape.faces, vertex_normals=normals, visual=visual, process=False)
        data = solid.export(file_type="ply", vertex_normal=True)
        (self.folder / "meshes" / f"{name}.ply").write_bytes(data)
        return name

    def spot(self, name: str, place, target, intensity: Rgb, cutoff: float, beam: float | None = None) -> None:
        """intensity: on its axis, fading from the half angle `beam` to `cutoff` (degrees)."""
        emitter = Xml.SubElement(self.root, "emitter", type="spot", id=name)
        Xml.SubElement(emitter, "rgb", name="intensity", value=_text(intensity))
        Xml.SubElement(emitter, "float", name="cutoff_angle", value=f"{cutoff:g}")
        Xml.SubElement(emitter, "float", name="beam_width", value=f"{cutoff if beam is None else beam:g}")
        transform = Xml.SubElement(emitter, "transform", name="to_world")
        up = "1, 0, 0" if abs(place[0] - target[0]) + abs(place[2] - target[2]) < 1e-6 else "0, 1, 0"
        Xml.SubElement(transform, "lookat", origin=_text(place), target=_text(target), up=up)

    def point(self, name: str, place, intensity: Rgb) -> None:
        emitter = Xml.SubElement(self.root, "emitter", type="point", id=name)
        Xml.SubElement(emitter, "point", name="position", value=_text(place))
        Xml.SubElement(emitter, "rgb", name="intensity", value=_text(intensity))

    def directional(self, name: str, direction, irradiance: Rgb) -> None:
        emitter = Xml.SubElement(self.root, "emitter", type="directional", id=name)
        Xml.SubElement(emitter, "vector", name="direction", value=_text(direction))
        Xml.SubElement(emitter, "rgb", name="irradiance", value=_text(irradiance))

    def environment(self, name: str, image: str) -> None:
        emitter = Xml.SubElement(self.root, "emitter", type="envmap", id=name)
        Xml.SubElement(emitter, "string", name="filename", value=f"textures/{image}.exr")

    def animate(self, name: str, times, place: Callable, rotation: Callable | None = None, size=None) -> None:
        """Keyframes at `times`: place(t) and rotation(t), a quaternion w, x, y, z."""
        keyframes = []
        for time in times:
            keyframe = {"time": _rounded(time), "translation": [_rounded(v) for v in place(time)]}
            if rotation is not None:
                keyframe["rotation"] = [_rounded(v) for v in rotation(time)]
            if size is not None:
                keyframe["scale"] = [_rounded(v) for v in np.broadcast_to(size(time), 3)]
            keyframes.append(keyframe)
        self.tracks[name] = {"keyframes": keyframes}

    def save(self) -> None:
        begins = np.cumsum([0, *(len(data) for data in self.packed.values())])[:-1]
        table = begins.astype("<u8").tobytes() + struct.pack("<I", len(begins))
        (self.folder / f"{self.name}.serialized").write_bytes(b"".join(self.packed.values()) + table)
        tree = Xml.ElementTree(self.root)
        Xml.indent(tree, " ")
        tree.write(self.folder / f"{self.name}.xml", encoding="utf-8")
        animation = {"version": 1, "objects": self.tracks}
        text = json.dumps(animation, separators=(",", ":")).replace('"keyframes":', '\n"keyframes":')
        (self.folder / f"{self.name}.animation.json").write_text(text + "\n")

    def _bsdf(self, key: str, look: Look) -> None:
        parent = self.root
        for adapter in ("twosided",) * look.two_sided + ("normalmap",) * (look.normal is not None):
            parent = Xml.SubElement(parent, "bsdf", type=adapter)
            if parent in list(self.root):
                parent.set("id", key)
            if adapter == "normalmap":
                self._image(parent, "normalmap", f"{look.normal}.png", look.tile, raw=True)
        is_metal = look.kind not in ("principled", "diffuse")
        item = Xml.SubElement(parent, "bsdf", type="roughconductor" if is_metal else look.kind)
        if parent is self.root:
            item.set("id", key)
        if is_metal:
            Xml.SubElement(item, "string", name="material", value=look.kind)
            Xml.SubElement(item, "string", name="distribution", value="ggx")
            Xml.SubElement(item, "float", name="alpha", value=f"{look.roughness**2:g}")
            Xml.SubElement(item, "rgb", name="specular_reflectance", value=_text(look.base))
            return
        color = "reflectance" if look.kind == "diffuse" else "base_color"
        if isinstance(look.base, str):
            self._image(item, color, f"{look.base}.png", look.tile)
        else:
            Xml.SubElement(item, "rgb", name=color, value=_text(look.base))
        if look.kind == "diffuse":
            return
        if isinstance(look.roughness, str):
            self._image(item, "roughness", f"{look.roughness}.png", look.tile, raw=True)
        else:
            Xml.SubElement(item, "float", name="roughness", value=f"{look.roughness:g}")
        Xml.SubElement(item, "float", name="metallic", value=f"{look.metallic:g}")
        Xml.SubElement(item, "float", name="specular", value=f"{look.specular:g}")

    def _image(self, parent: Xml.Element, key: str, file: str, tile: float, raw: bool = False) -> None:
        texture = Xml.SubElement(parent, "texture", type="bitmap", name=key)
        Xml.SubElement(texture, "string", name="filename", value=f"textures/{file}")
        if raw:
            Xml.SubElement(texture, "boolean", name="raw", value="true")
        if tile != 1:
            transform = Xml.SubElement(texture, "transform", name="to_uv")
            Xml.SubElement(transform, "scale", x=f"{1 / tile:.6g}", y=f"{1 / tile:.6g}")


def _stepped(values: np.ndarray, steps: int) -> np.ndarray:
    """In steps that pack well: a hundredth of a millimetre or so, a quarter of a degree."""
    return (np.round(np.asarray(values) * steps) / steps).astype("<f4")


def _text(values) -> str:
    return ", ".join(f"{float(value):.6g}" for value in values)


def _rounded(value: float) -> float:
    return round(float(value), 5) + 0.0
