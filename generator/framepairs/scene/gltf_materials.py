"""What glTF's JSON says beyond what trimesh reads: extensions that map onto ours, and names for what is not drawn.

Sources: glTF 2.0 and the extensions' specifications in KhronosGroup/glTF. Everything works on pygltflib's objects.
"""

import math

import numpy as np
import pygltflib

from .description import IDENTITY_UV
from .reflectance import f0_of_ior, specular_of_f0

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
READ_EXTENSIONS = (
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_texture_transform",
    "EXT_texture_webp",
)
# Extensions without counterpart: the key of their JSON that lets them act, where it is above 0.
STRENGTH_KEYS = {
    "KHR_materials_clearcoat": "clearcoatFactor",
    "KHR_materials_sheen": "sheenColorFactor",
    "KHR_materials_transmission": "transmissionFactor",
    "KHR_materials_volume": "thicknessFactor",
    "KHR_materials_iridescence": "iridescenceFactor",
    "KHR_materials_anisotropy": "anisotropyStrength",
    "KHR_materials_dispersion": "dispersion",
    "KHR_materials_diffuse_transmission": "diffuseTransmissionFactor",
}
DRAWN_MODES = (None, 4, 5)  # triangles and strips; trimesh leaves out fans, and we draw neither lines nor points
INSTEAD = {
    "KHR_materials_unlit": "unlit: it is lit",
    SPECULAR_GLOSSINESS: "pbrSpecularGlossiness: its metallic-roughness values are drawn",
}
# May stand among extensionsRequired: they are read, or named and do not change what else the file means.
ALLOWED_IF_REQUIRED = (
    *READ_EXTENSIONS,
    *STRENGTH_KEYS,
    *INSTEAD,
    "KHR_materials_variants",
    "KHR_lights_punctual",
    "KHR_xmp_json_ld",
)


def specular_of(material: pygltflib.Material) -> tuple[float, tuple[str, ...]]:
    """(specular with F0 = 0.08 specular, what is left out of KHR_materials_ior and KHR_materials_specular).

    F0 = min(((ior - 1) / (ior + 1))^2 specularColorFactor, 1) specularFactor; the colour is left out. glTF multiplies the
    reflectance at grazing angles by specularFactor, too; ours stays 1 there.
    """
    extensions = material.extensions or {}
    ior = extensions.get("KHR_materials_ior", {}).get("ior", 1.5)
    values = extensions.get("KHR_materials_specular", {})
    factor, color = values.get("specularFactor", 1.0), values.get("specularColorFactor", [1.0] * 3)
    if is_metal(material):
        return 0.5, ()
    specular, limited = specular_of_f0(min(f0_of_ior(ior, material.name or "material"), 1.0) * factor, f"ior {ior:g}")
    said = [f"specularColorFactor {_text(color)}"] if list(color) != [1.0] * 3 else []
    said += [f"{key} of KHR_materials_specular" for key in ("specularTexture", "specularColorTexture") if key in values]
    said += [f"specularFactor {factor:g} at grazing angles: reflectance is 1 there"] if factor != 1 else []
    return specular, (*said, *limited)


def is_metal(material: pygltflib.Material) -> bool:
    """Metal all over, so that what concerns dielectrics does not act."""
    pbr = material.pbrMetallicRoughness or pygltflib.PbrMetallicRoughness()
    return pbr.metallicFactor in (None, 1) and pbr.metallicRoughnessTexture is None


def unread_of(material: pygltflib.Material) -> tuple[str, ...]:
    """What of the material is not drawn, where it acts, each with its value."""
    said = []
    occlusion = material.occlusionTexture
    if occlusion is not None and occlusion.strength != 0:
        said.append("occlusion map")
    for name, values in (material.extensions or {}).items():
        short = name.removeprefix("KHR_materials_")
        if name in STRENGTH_KEYS:
            strength = values.get(STRENGTH_KEYS[name], 0)
            said += [f"{short} {_text(strength)}"] if np.any(np.array(strength, dtype=float) != 0) else []
        elif name not in READ_EXTENSIONS:
            said.append(INSTEAD.get(name, f"extension {name}"))
    pbr = material.pbrMetallicRoughness or pygltflib.PbrMetallicRoughness()
    infos = {
        "baseColorTexture": pbr.baseColorTexture,
        "metallicRoughnessTexture": pbr.metallicRoughnessTexture,
        "normalTexture": material.normalTexture,
        "emissiveTexture": material.emissiveTexture,
    }
    for key, info in infos.items():
        texcoord = _transform(info).get("texCoord", info.texCoord) if info else 0
        said += [f"texCoord {texcoord} of {key}: it is read with 0"] if texcoord else []
    return tuple(said)


def unread_of_document(document: pygltflib.GLTF2) -> list[str]:
    """What the file holds apart from materials, which tell their own."""
    used = document.extensionsUsed or ()
    found = [f"extension {name}" for name in used if name not in READ_EXTENSIONS and not _is_told_by_materials(name)]
    found += [f"animation {clip.name or index}" for index, clip in enumerate(document.animations)]
    found += [f"skin {skin.name or index}" for index, skin in enumerate(document.skins)]
    for index, mesh in enumerate(document.meshes):
        name = mesh.name or index
        found += [f"morph targets of mesh {name}"] if any(p.targets for p in mesh.primitives) else []
        found += [f"vertex colours of mesh {name}"] if any(p.attributes.COLOR_0 is not None for p in mesh.primitives) else []
        found += [f"lines, points or fans of mesh {name}"] if any(p.mode not in DRAWN_MODES for p in mesh.primitives) else []
    return found


def _is_told_by_materials(extension: str) -> bool:
    return extension.startswith("KHR_materials_") and extension != "KHR_materials_variants"


def uv_of(info: pygltflib.TextureInfo | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Rows of the 2x3 matrix of KHR_texture_transform, for our uv, whose v runs up.

    In glTF's uv, v down, it is translation x rotation x scale, where the rotation is counter-clockwise as seen on the image:
    (u, v) -> (c u + s v, -s u + c v). With v = 1 - v_up on both sides it is the matrix below.
    """
    values = _transform(info) if info is not None else {}
    if not {"offset", "rotation", "scale"} & set(values):
        return IDENTITY_UV
    (x, y), (a, b) = values.get("offset", (0.0, 0.0)), values.get("scale", (1.0, 1.0))
    c, s = math.cos(values.get("rotation", 0.0)), math.sin(values.get("rotation", 0.0))
    return (c * a, -s * b, s * b + x), (s * a, c * b, 1 - c * b - y)


def with_metallic_roughness(material: pygltflib.Material) -> None:
    """Gives a material that has specular-glossiness values alone the nearest core ones: diffuse colour, 1 - glossiness,
    no metal. Its specular colour and its specular-glossiness texture are left out."""
    values = (material.extensions or {}).get(SPECULAR_GLOSSINESS)
    if values is None or material.pbrMetallicRoughness is not None:
        return
    diffuse = values.get("diffuseTexture")
    info = pygltflib.TextureInfo(**diffuse) if diffuse else None
    material.pbrMetallicRoughness = pygltflib.PbrMetallicRoughness(
        baseColorFactor=list(values.get("diffuseFactor", [1.0] * 4)),
        baseColorTexture=info,
        metallicFactor=0.0,
        roughnessFactor=1 - values.get("glossinessFactor", 1.0),
    )


def _transform(info: pygltflib.TextureInfo) -> dict:
    return (info.extensions or {}).get("KHR_texture_transform", {})


def _text(value) -> str:
    return f"({', '.join(f'{c:g}' for c in value)})" if isinstance(value, list | tuple) else f"{value:g}"
