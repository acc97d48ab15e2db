"""UsdPreviewSurface networks as materials, also as MaterialX's node of that name.

Source: the UsdPreviewSurface specification, version 2.6. What has no counterpart is named in Material.not_read where it acts.
wrapS and wrapT useMetadata, the default, are read as repeat: images say nothing of their wrap modes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from pxr import Usd, UsdShade

from .description import Material
from .reflectance import f0_of_ior, specular_of_f0
from .usd_inputs import Constant, Driven, Primvar, ReadMaterial, Unread, driven_by
from .usd_networks import EARLIEST, as_text, changing, kind_of, source, value
from .usd_textures import Sampled, TextureReader, slot_at, unread_textures, uv_names_of

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
DRIVEN = ("diffuseColor", "emissiveColor", "normal", "roughness", "metallic", "opacity")
SLOTS = {  # the inputs that fill our slots
    "base_texture": ("diffuseColor", "opacity"), "surface_texture": ("roughness", "metallic"),
    "normal_texture": ("normal",), "emission_texture": ("emissiveColor",),
}  # fmt: skip
NORMAL_SCALE, NORMAL_BIAS = (2.0, 2.0, 2.0, 1.0), (-1.0, -1.0, -1.0, 0.0)  # which the specification asks of 8 bits

Inputs = Mapping[str, Driven | None]


def read_preview(name: str, shader: UsdShade.Shader, textures: TextureReader) -> ReadMaterial:
    """The material of a surface shader. Raises InputError naming it for images that cannot be read and a bad ior."""
    read: dict[str, Driven | None] = {key: driven_by(shader, key, textures, color=key in COLORS) for key in DRIVEN}
    read |= {"metallic": None} if _value(shader, "useSpecularWorkflow") else {}
    normal_said = _repair_normal(read, textures)
    followed = _followed(shader, read)
    codes = [EARLIEST, *map(Usd.TimeCode, sorted({time for item in followed for time in item.GetTimeSamples()}))]
    alpha = _alpha(shader, read, codes)
    slots = {slot: [(key, read[key]) for key in keys if isinstance(read[key], Sampled)] for slot, keys in SLOTS.items()}
    by_key = {key: item for items in slots.values() for key, item in items}
    base, emissive = read["diffuseColor"], read["emissiveColor"]
    color = next((item for item in (base, emissive) if isinstance(item, Primvar)), None)
    material = Material(
        name=name,
        alpha=alpha,
        base_texture=textures.base_slot(f"{name} base", by_key.get("diffuseColor"), by_key.get("opacity"), alpha == "opaque"),
        surface_texture=textures.surface_slot(f"{name} surface", by_key.get("roughness"), by_key.get("metallic")),
        normal_texture=textures.slot(by_key["normal"].texture if "normal" in by_key else None),
        emission_texture=textures.color_slot(f"{name} emission", by_key.get("emissiveColor")),
        vertex_colors="emission" if color is not None and color is not base else "base_color",
        normal_scale=by_key["normal"].normal_scale if "normal" in by_key else 1.0,
        not_read=(*_unread_inputs(shader, read, alpha), *unread_textures(slots, codes), *normal_said),
    )
    at = partial(_material_at, material, shader, read, slots)
    return ReadMaterial(
        material=at(EARLIEST),
        at=at if followed else None,
        codes=tuple(codes),
        uv_names=uv_names_of(slots),
        color=color,
        opacity=read["opacity"] if isinstance(read["opacity"], Primvar) else None,
    )


def _value(shader: UsdShade.Shader, key: str, code: Usd.TimeCode = EARLIEST):
    return value(shader, key, DEFAULTS[key], code)


def _constant(shader: UsdShade.Shader, read: Inputs, key: str, code: Usd.TimeCode):
    """What textures and primvars multiply, or the value where there are none."""
    item, default = read.get(key), DEFAULTS[key]
    size = len(default) if isinstance(default, tuple) else 1
    if isinstance(item, Constant):
        numbers = (item.value * size)[:size] if len(item.value) == 1 else item.value[:size]
        return numbers if isinstance(default, tuple) else numbers[0]
    if isinstance(item, Sampled) or (isinstance(item, Primvar) and not _is_left_out(read, key)):
        return (1.0, 1.0, 1.0) if isinstance(default, tuple) else 1.0
    return _value(shader, key, code)


def _is_left_out(read: Inputs, key: str) -> bool:
    """A primvar that Mesh.colors cannot hold beside the first one, or that no vertex colour stands for."""
    second = key == "emissiveColor" and isinstance(read["diffuseColor"], Primvar)
    return isinstance(read.get(key), Primvar) and (second or key not in ("diffuseColor", "emissiveColor", "opacity"))


def _alpha(shader: UsdShade.Shader, read: Inputs, codes: Sequence[Usd.TimeCode]) -> str:
    varies = isinstance(read["opacity"], Sampled | Primvar)
    transparent = varies or min(_constant(shader, read, "opacity", code) for code in codes) < 1
    masked = max(_value(shader, "opacityThreshold", code) for code in codes) > 0
    return "mask" if masked and transparent else "blend" if transparent else "opaque"


def _repair_normal(read: dict[str, Driven | None], textures: TextureReader) -> list[str]:
    """Gives a normal map of 8 bits that is read as it stands, in [0, 1], the scale and bias of the specification."""
    item = read["normal"]
    if not isinstance(item, Sampled) or item.texture.texels.dtype != np.uint8:
        return []
    if any(item.texture.bias[:3]) or tuple(item.texture.scale[:3]) != (1.0, 1.0, 1.0):
        return []
    repaired = textures.deduplicated(replace(item.texture, scale=NORMAL_SCALE, bias=NORMAL_BIAS))
    read["normal"] = replace(item, texture=repaired)
    return ["normal map without scale 2 and bias -1: it is read with them"]


def _material_at(material: Material, shader: UsdShade.Shader, read: Inputs, slots, code: Usd.TimeCode) -> Material:
    """The material with the constants and transforms of uv of a time."""
    constant = {key: _constant(shader, read, key, code) for key in FOLLOWED}
    names = uv_names_of(slots)
    filled = {slot: slot_at(getattr(material, slot), items[0][1], names, code) for slot, items in slots.items() if items}
    material = replace(
        material,
        base_color=tuple(constant["diffuseColor"]),
        opacity=float(constant["opacity"]),
        roughness=float(constant["roughness"]),
        metallic=float(constant["metallic"]),
        emission=tuple(constant["emissiveColor"]),
        alpha_cutoff=float(constant["opacityThreshold"]) or (0.0 if material.alpha == "mask" else 0.5),
        **filled,
    )
    if _value(shader, "useSpecularWorkflow"):
        return _with_specular_color(replace(material, metallic=0.0), shader, constant, read)
    metal = constant["metallic"] >= 1 and not isinstance(read["metallic"], Sampled)
    return _with_ior(material, shader, constant["ior"], metal)


def _followed(shader: UsdShade.Shader, read: Inputs) -> list[Usd.Attribute]:
    """The attributes that change over time behind constants and transforms of uv."""
    nodes = [node for item in read.values() if isinstance(item, Sampled) for node in item.uv_nodes]
    found = [(key in FOLLOWED, attributes) for key, attributes in changing(shader).items()]
    found += [(True, attributes) for node in nodes for attributes in changing(node).values()]
    return [attribute for followed, attributes in found if followed for attribute in attributes]


def _with_ior(material: Material, shader: UsdShade.Shader, ior: float, metal: bool) -> Material:
    """A metal has no part that the ior concerns."""
    specular, said = specular_of_f0(f0_of_ior(ior, material.name), f"ior {ior:g}")
    said = ("ior (texture)",) if source(shader, "ior") else said
    return replace(material, specular=specular, not_read=(*material.not_read, *(() if metal else said)))


def _with_specular_color(material: Material, shader: UsdShade.Shader, constant: dict, read: Inputs) -> Material:
    """The specular workflow: F0 is specularColor. A metal where nothing is diffuse, a dielectric where F0 is a dark grey."""
    f0 = np.array(constant["specularColor"], dtype=float)
    if source(shader, "specularColor"):
        return replace(material, not_read=(*material.not_read, "specularColor (texture)"))
    if not any(constant["diffuseColor"]) and not isinstance(read["opacity"], Sampled):
        return replace(material, base_color=tuple(f0.tolist()), metallic=1.0)
    specular, said = specular_of_f0(float(f0.mean()), f"specularColor {as_text(f0)}")
    if not said and np.ptp(f0) > GRAY:
        said = (f"specularColor {as_text(f0)}: F0 is grey, its mean",)
    return replace(material, specular=specular, not_read=(*material.not_read, *said))


def _unread_inputs(shader: UsdShade.Shader, read: Inputs, alpha: str) -> list[str]:
    """Inputs that act and are not drawn, each with its value."""
    said, authored = [], {key: _value(shader, key) for key in DEFAULTS}
    for key in WITHOUT_COUNTERPART:
        found = source(shader, key)
        if found and kind_of(found[0]) == "UsdUVTexture":
            said += [] if read.get(key) else ["occlusion map" if key == "occlusion" else f"{key} (texture)"]
        elif not found and not np.allclose(authored[key], DEFAULTS[key]):
            said.append(f"{key} {as_text(authored[key])}")
        if key == "clearcoat" and said:
            said.append(f"clearcoatRoughness {as_text(authored['clearcoatRoughness'])}")
    if alpha == "blend" and authored["opacityMode"] != "presence":
        said.append(f"opacityMode {authored['opacityMode']}: highlights fade with opacity, too")
    for key in DEFAULTS:
        item, found = read.get(key), source(shader, key)
        is_read = isinstance(item, Sampled | Constant | Primvar) and not _is_left_out(read, key)
        if found and not is_read and kind_of(found[0]) != "UsdUVTexture":
            said.append(f"{key} through {item.kind if isinstance(item, Unread) else kind_of(found[0])}")
        if isinstance(item, Constant) and key == "normal" and not np.allclose(item.value, DEFAULTS["normal"]):
            said.append(f"normal {as_text(item.value)}")
    return said + [f"animation of {key}: it stays as it begins" for key in changing(shader) if key not in FOLLOWED]
