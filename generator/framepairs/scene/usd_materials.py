"""UsdPreviewSurface networks into materials and textures.

Source: the UsdPreviewSurface specification, version 2.6. What has no counterpart is named in Material.not_read where it acts.
"""

import math
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Ar, Usd, UsdShade

from ..errors import InputError
from .description import Material, Slot, Texture
from .images import decode_image, pack_channels
from .reflectance import f0_of_ior, specular_of_f0

COMPONENT = {"r": 0, "g": 1, "b": 2, "a": 3, "rgb": 0, "rgba": 0}
WRAP = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp", "useMetadata": "repeat"}
EARLIEST = Usd.TimeCode.EarliestTime()
GRAY = 1e-3  # difference between the components of a colour that counts as grey
DEFAULTS = {
    "diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0.0, 0.0, 0.0), "specularColor": (0.0, 0.0, 0.0),
    "useSpecularWorkflow": 0, "metallic": 0.0, "roughness": 0.5, "opacity": 1.0, "opacityThreshold": 0.0, "ior": 1.5,
    "clearcoat": 0.0, "clearcoatRoughness": 0.01, "displacement": 0.0, "occlusion": 1.0, "normal": (0.0, 0.0, 1.0),
    "opacityMode": "transparent",
}  # fmt: skip
# Inputs without counterpart; `opacityMode` and `clearcoatRoughness` are told with those on which they depend.
WITHOUT_COUNTERPART = ("clearcoat", "displacement", "occlusion", "normal")
COLORS = ("diffuseColor", "emissiveColor", "specularColor")
FOLLOWED = (*COLORS, "roughness", "metallic", "opacity", "opacityThreshold", "ior")  # their change over time is drawn
TEXTURED = ("diffuseColor", "emissiveColor", "normal", "roughness", "metallic", "opacity")
SLOTS = {  # the inputs whose transform of uv a slot has: that of the first one with a texture
    "base_texture": ("diffuseColor", "opacity"), "surface_texture": ("roughness", "metallic"),
    "normal_texture": ("normal",), "emission_texture": ("emissiveColor",),
}  # fmt: skip


class MaterialReader:
    """Reads materials of one stage, each image once; `materials`, `textures` and `files` grow as prims ask for them.
    changing: of the materials that change, by index, functions of the time code."""

    def __init__(self) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self.files: list[Path] = []
        self.changing: dict[int, partial] = {}
        self.uv_names: dict[int, str] = {}
        self._index_by_path: dict[str, int] = {}
        self._texels: dict[str, NDArray] = {}
        self._known: list[Texture] = []

    def material_index(self, material: UsdShade.Material | None) -> int:
        """Index of `material` (None: the default grey), read at the first call."""
        path = str(material.GetPath()) if material else ""
        if path not in self._index_by_path:
            self._index_by_path[path] = len(self.materials)
            self.materials.append(self._read(material, len(self.materials)) if material else Material(name="default"))
        return self._index_by_path[path]

    def materials_at(self, code: Usd.TimeCode) -> tuple[Material, ...]:
        """All materials at a time. Raises InputError for an index of refraction below 0."""
        changed = {index: replace(at(code), not_read=self.materials[index].not_read) for index, at in self.changing.items()}
        return tuple(changed.get(index, item) for index, item in enumerate(self.materials))

    def _read(self, usd_material: UsdShade.Material, index: int) -> Material:
        name = str(usd_material.GetPath())
        shader = usd_material.ComputeSurfaceSource()[0]
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            return Material(name=name, not_read=(f"shader {shader.GetIdAttr().Get() if shader else 'no surface'}",))
        read = {key: self._texture(shader, key) for key in TEXTURED}
        if _value(shader, "useSpecularWorkflow"):
            read["metallic"] = None
        self.uv_names[index] = next((item[2] for item in read.values() if item), "st")
        followed = _followed(shader, read)
        codes = [EARLIEST, *map(Usd.TimeCode, sorted({time for item in followed for time in item.GetTimeSamples()}))]
        transparent = read["opacity"] is not None or min(_value(shader, "opacity", code) for code in codes) < 1
        masked = max(_value(shader, "opacityThreshold", code) for code in codes) > 0
        alpha = "mask" if masked and transparent else "blend" if transparent else "opaque"
        material = Material(
            name=name,
            alpha=alpha,
            base_texture=self._base_slot(name, read["diffuseColor"], read["opacity"]),
            surface_texture=self._surface_slot(name, read["roughness"], read["metallic"]),
            normal_texture=self._slot(read["normal"]),
            emission_texture=self._slot(read["emissiveColor"]),
            not_read=(*_unread_inputs(shader, read, alpha), *_unread_textures(shader, read, codes)),
        )
        self.changing |= {index: partial(_material_at, material, shader, read)} if followed else {}
        return _material_at(material, shader, read, EARLIEST)

    def _base_slot(self, name: str, color: "Read | None", opacity: "Read | None") -> Slot | None:
        if opacity is None:
            return self._slot(color)
        texture, component, _ = opacity
        white = {k: (replace(texture, scale=(0,) * 4, bias=(1,) * 4), 0) for k in range(3)}
        rgb = {k: (color[0], k) for k in range(3)} if color else white
        packed = pack_channels(f"{name} base", {**rgb, 3: (texture, component)})
        return self._slot((replace(packed, srgb=bool(color) and packed.srgb), 0, ""))

    def _surface_slot(self, name: str, roughness: "Read | None", metallic: "Read | None") -> Slot | None:
        parts = {k: (read[0], read[1]) for k, read in ((1, roughness), (2, metallic)) if read}
        if not parts:
            return None
        packed = pack_channels(f"{name} surface", parts)
        scale = tuple(packed.scale[k] if k in parts else 0.0 for k in range(4))  # what is not sampled multiplies by 1
        bias = tuple(packed.bias[k] if k in parts else 1.0 for k in range(4))
        return self._slot((self._deduplicated(replace(packed, scale=scale, bias=bias)), 0, ""))

    def _slot(self, read: "Read | None") -> Slot | None:
        if read is None:
            return None
        index = next((index for index, other in enumerate(self.textures) if other is read[0]), len(self.textures))
        self.textures += [read[0]] if index == len(self.textures) else []
        return Slot(texture=index)

    def _texture(self, shader: UsdShade.Shader, key: str) -> "Read | None":
        """(texture, component, name of the uv primvar) behind an input, or None where it is a value."""
        source = _source(shader, key)
        if source is None or source[0].GetIdAttr().Get() != "UsdUVTexture":
            return None
        texture_shader, output = source
        asset = _value(texture_shader, "file")
        field = f"{shader.GetPath().GetParentPath()}.{key}"
        if asset is None or not asset.path:
            raise InputError("texture without a file", field=field)
        texels = self._read_texels(asset, field)
        space = _value(texture_shader, "sourceColorSpace") or "auto"
        texture = Texture(
            name=asset.path,
            texels=texels,
            srgb=space == "sRGB" or (space == "auto" and key in COLORS and texels.dtype.itemsize == 1),
            wrap=tuple(WRAP[_value(texture_shader, w) or "useMetadata"] for w in ("wrapS", "wrapT")),
            scale=tuple(_value(texture_shader, "scale") or (1.0,) * 4),
            bias=tuple(_value(texture_shader, "bias") or (0.0,) * 4),
        )
        return self._deduplicated(texture), COMPONENT.get(output, 0), _uv_nodes(texture_shader)[1]

    def _deduplicated(self, texture: Texture) -> Texture:
        for other in self._known:
            if other.texels is texture.texels and _settings(other) == _settings(texture):
                return other
        self._known.append(texture)
        return texture

    def _read_texels(self, asset, field: str):
        resolved = asset.resolvedPath
        if resolved not in self._texels:
            opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
            if opened is None:
                raise InputError(f"missing texture {asset.path}", field=field)
            self._texels[resolved] = decode_image(bytes(opened.GetBuffer()), asset.path)
            if "[" not in resolved:
                self.files.append(Path(resolved))
        return self._texels[resolved]


Read = tuple[Texture, int, str]
_settings = attrgetter("srgb", "wrap", "scale", "bias")


def _material_at(material: Material, shader: UsdShade.Shader, read: "dict[str, Read | None]", code: Usd.TimeCode) -> Material:
    """The material with the constants and transforms of uv of a time."""
    value = {key: _value(shader, key, code) for key in DEFAULTS}
    value |= {key: (1.0, 1.0, 1.0) if key in COLORS else 1.0 for key in read if read[key]}
    drawn = {name: next((key for key in keys if read[key]), None) for name, keys in SLOTS.items()}
    slots = {name: replace(getattr(material, name), uv=_uv_at(shader, key, code)) for name, key in drawn.items() if key}
    material = replace(
        material,
        base_color=tuple(value["diffuseColor"]),
        opacity=float(value["opacity"]),
        roughness=float(value["roughness"]),
        metallic=float(value["metallic"]),
        emission=tuple(value["emissiveColor"]),
        alpha_cutoff=float(value["opacityThreshold"]) or (0.0 if material.alpha == "mask" else 0.5),
        **slots,
    )
    if _value(shader, "useSpecularWorkflow"):
        return _with_specular_color(replace(material, metallic=0.0), shader, value, read)
    return _with_ior(material, shader, value["ior"], metal=value["metallic"] >= 1 and not read["metallic"])


def _followed(shader: UsdShade.Shader, read: "dict[str, Read | None]") -> list[Usd.Attribute]:
    """The attributes that change over time behind constants and transforms of uv."""
    nodes = [node for key in read if read[key] for node in _uv_nodes(_source(shader, key)[0])[0]]
    found = [(key in FOLLOWED, attributes) for key, attributes in _changing(shader).items()]
    found += [(True, attributes) for node in nodes for attributes in _changing(node).values()]
    return [attribute for followed, attributes in found if followed for attribute in attributes]


def _with_ior(material: Material, shader: UsdShade.Shader, ior: float, metal: bool) -> Material:
    """A metal has no part that the ior concerns."""
    specular, said = specular_of_f0(f0_of_ior(ior, material.name), f"ior {ior:g}")
    said = ("ior (texture)",) if _source(shader, "ior") else said
    return replace(material, specular=specular, not_read=(*material.not_read, *(() if metal else said)))


def _with_specular_color(material: Material, shader: UsdShade.Shader, value: dict, read: "dict[str, Read | None]") -> Material:
    """The specular workflow: F0 is specularColor. A metal where nothing is diffuse, a dielectric where F0 is a dark grey."""
    f0 = np.array(value["specularColor"], dtype=float)
    if _source(shader, "specularColor"):
        return replace(material, not_read=(*material.not_read, "specularColor (texture)"))
    if read["diffuseColor"] is None and not any(value["diffuseColor"]) and read["opacity"] is None:
        return replace(material, base_color=tuple(f0.tolist()), metallic=1.0)
    specular, said = specular_of_f0(float(f0.mean()), f"specularColor {_text(f0)}")
    if not said and np.ptp(f0) > GRAY:
        said = (f"specularColor {_text(f0)}: F0 is grey, its mean",)
    return replace(material, specular=specular, not_read=(*material.not_read, *said))


def _unread_inputs(shader: UsdShade.Shader, read: "dict[str, Read | None]", alpha: str) -> list[str]:
    """Inputs that act and are not drawn, each with its value."""
    said, value = [], {key: _value(shader, key) for key in DEFAULTS}
    for key in WITHOUT_COUNTERPART:
        source = _source(shader, key)
        if source and source[0].GetIdAttr().Get() == "UsdUVTexture":
            said += [] if read.get(key) else ["occlusion map" if key == "occlusion" else f"{key} (texture)"]
        elif not source and not np.allclose(value[key], DEFAULTS[key]):
            said.append(f"{key} {_text(value[key])}")
        if key == "clearcoat" and said:
            said.append(f"clearcoatRoughness {_text(value['clearcoatRoughness'])}")
    if alpha == "blend" and value["opacityMode"] != "presence":
        said.append(f"opacityMode {value['opacityMode']}: highlights fade with opacity, too")
    kinds = {key: source[0].GetIdAttr().Get() for key in DEFAULTS if (source := _source(shader, key))}
    said += [f"{key} through {kind}" for key, kind in kinds.items() if kind != "UsdUVTexture"]
    return said + [f"animation of {key}: it stays as it begins" for key in _changing(shader) if key not in FOLLOWED]


def _changing(shader: UsdShade.Shader) -> dict[str, list[Usd.Attribute]]:
    """The attributes that change over time behind each input that changes."""
    sources = {item.GetBaseName(): item.GetValueProducingAttributes() for item in shader.GetInputs()}
    varying = {key: [a for a in attributes if a.ValueMightBeTimeVarying()] for key, attributes in sources.items()}
    return {key: attributes for key, attributes in varying.items() if attributes}


def _unread_textures(shader: UsdShade.Shader, read: "dict[str, Read | None]", codes: list[Usd.TimeCode]) -> list[str]:
    """What textures ask for beyond one set of uv for the mesh and one transform of them for each of our slots."""
    said, first = [], next((item for item in read.values() if item), None)
    for key, item in read.items():
        if item and item[2] != first[2]:
            said.append(f"uv {item[2]} of {key}: it is read with {first[2]}")
        source = _source(shader, key)
        if item and "black" in [_value(source[0], wrap) for wrap in ("wrapS", "wrapT")]:
            said.append(f"wrap mode black of {key}: it is read with clamp")
        names = _changing(source[0]) if item else ()
        said += [f"animation of {name} of the texture of {key}: it stays as it begins" for name in names]
    for key, other in (("opacity", "diffuseColor"), ("metallic", "roughness")):
        if read[key] and read[other]:
            uv_differs = any(_uv_at(shader, key, code) != _uv_at(shader, other, code) for code in codes)
            wrap_differs = read[key][0].wrap != read[other][0].wrap
            said += [f"transform of uv or wrap mode of {key}: those of {other} are used"] if uv_differs or wrap_differs else []
    return said


def _text(value) -> str:
    return f"{value:g}" if isinstance(value, float | int) else f"({', '.join(f'{c:g}' for c in value)})"


def _source(shader: UsdShade.Shader, key: str) -> tuple[UsdShade.Shader, str] | None:
    """The shader that drives an input, through node graphs, and the name of its output."""
    attribute = shader.GetInput(key)
    for producer in attribute.GetValueProducingAttributes() if attribute else ():
        if UsdShade.Utils.GetType(producer.GetName()) == UsdShade.AttributeType.Output:
            return UsdShade.Shader(producer.GetPrim()), UsdShade.Utils.GetBaseNameAndType(producer.GetName())[0]
    return None


def _value(shader: UsdShade.Shader, key: str, code: Usd.TimeCode = EARLIEST):
    attribute = shader.GetInput(key)
    sources = (*attribute.GetValueProducingAttributes(), attribute) if attribute else ()
    return next((value for source in sources if (value := source.Get(code)) is not None), DEFAULTS.get(key))


def _uv_nodes(texture_shader: UsdShade.Shader) -> tuple[list[UsdShade.Shader], str]:
    """The UsdTransform2d behind a texture, the last one applied first, and the name of the primvar that gives uv."""
    nodes, source = [], _source(texture_shader, "st")
    while source and source[0].GetIdAttr().Get() == "UsdTransform2d":
        nodes.append(source[0])
        source = _source(source[0], "in")
    return nodes, str((_value(source[0], "varname") if source else None) or "st")


def _uv_at(shader: UsdShade.Shader, key: str, code: Usd.TimeCode) -> tuple:
    """The 2x3 matrix that transforms uv for the texture of an input."""
    total = np.eye(3)
    for node in _uv_nodes(_source(shader, key)[0])[0]:
        scale, shift = _value(node, "scale", code) or (1, 1), _value(node, "translation", code) or (0, 0)
        angle = math.radians(_value(node, "rotation", code) or 0)
        c, s = math.cos(angle), math.sin(angle)
        total = total @ np.array([[c * scale[0], -s * scale[1], shift[0]], [s * scale[0], c * scale[1], shift[1]], [0, 0, 1]])
    return tuple(tuple(row) for row in total[:2].tolist())
