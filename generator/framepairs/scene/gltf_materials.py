"""glTF's materials as ours: extensions that map onto ours are read, what is not drawn is named.

Sources: glTF 2.0 and the extensions' specifications in KhronosGroup/glTF. Everything works on the checked JSON of
`gltf_document`.
"""

from typing import Any

import numpy as np

from ..errors import InputError
from .description import Material, Texture
from .gltf_document import Document
from .gltf_textures import WEBP, TextureReader, set_of
from .reflectance import f0_of_ior, specular_of_f0

SPECULAR_GLOSSINESS, UNLIT = "KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit"
READ_EXTENSIONS = (
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    UNLIT,
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_mesh_gpu_instancing",
    WEBP,
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
GRAZING = 1e-3  # difference of reflectances at grazing angles that is told
INSTEAD = {SPECULAR_GLOSSINESS: "pbrSpecularGlossiness: its metallic-roughness values are drawn"}
# May stand among extensionsRequired: they are read, or named and do not change what else the file means.
ALLOWED_IF_REQUIRED = (*READ_EXTENSIONS, *STRENGTH_KEYS, *INSTEAD, "KHR_materials_variants", "KHR_xmp_json_ld")
MOST_SETS = 2  # of texture coordinates: Mesh.uv and Mesh.uv2


class MaterialReader:
    """Materials of one file, each once; `materials` and `textures` grow as primitives ask for them."""

    def __init__(self, document: Document) -> None:
        self.materials: list[Material] = []
        self._textures = TextureReader(document)
        self._document = document
        self._known: dict[int | None, int] = {}

    @property
    def textures(self) -> list[Texture]:
        return self._textures.textures

    def source(self, number: int | None) -> dict[str, Any]:
        """The JSON of glTF's material `number`, with metallic-roughness values; None is glTF's default."""
        plain = self._document.entry("materials", number) if number is not None else {"name": "default"}
        return with_metallic_roughness(plain)

    def index(self, number: int | None) -> int:
        """Index into `materials` of glTF's material `number`; None is glTF's default. Raises InputError naming the file."""
        if number not in self._known:
            try:
                source = self.source(number)
                material = self._unlit if is_unlit(source) else self._material
                self.materials.append(material(source, source.get("name") or f"material {number}"))
            except InputError as error:
                raise InputError(error.problem, file=self._document.file, field=error.field) from None
            self._known[number] = len(self.materials) - 1
        return self._known[number]

    def _material(self, source: dict[str, Any], name: str) -> Material:
        infos, sets = references(source), sets_of(source)
        pbr = source.get("pbrMetallicRoughness", {})
        strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        specular, said = specular_of(source)
        slot = self._textures.slot
        return Material(
            name=name,
            base_color=tuple(pbr.get("baseColorFactor", [1.0] * 4)[:3]),
            **_alpha(source),
            roughness=pbr.get("roughnessFactor", 1.0),
            metallic=pbr.get("metallicFactor", 1.0),
            specular=specular,
            emission=tuple(float(c) * strength for c in source.get("emissiveFactor", [0.0] * 3)),
            normal_scale=infos.get("normalTexture", {}).get("scale", 1.0),
            base_texture=slot(infos.get("baseColorTexture"), sets, srgb=True),
            surface_texture=slot(infos.get("metallicRoughnessTexture"), sets, scale=(0, 1, 1, 0), bias=(1, 0, 0, 1)),
            normal_texture=slot(infos.get("normalTexture"), sets, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)),
            emission_texture=slot(infos.get("emissiveTexture"), sets, srgb=True),
            not_read=(*unread_of(source), *said),
        )

    def _unlit(self, source: dict[str, Any], name: str) -> Material:
        """KHR_materials_unlit: a surface that reflects nothing and emits its base colour, in `path` onto others, too."""
        pbr = source.get("pbrMetallicRoughness", {})
        base = self._textures.slot(references(source).get("baseColorTexture"), sets_of(source), srgb=True)
        alpha = _alpha(source)
        return Material(
            name=name,
            base_color=(0.0, 0.0, 0.0),
            **alpha,
            roughness=1.0,
            metallic=0.0,
            specular=0.0,
            emission=tuple(float(c) for c in pbr.get("baseColorFactor", [1.0] * 4)[:3]),
            base_texture=base if alpha["alpha"] != "opaque" else None,  # for its opacity
            emission_texture=base,
            vertex_colors="emission",
            not_read=unread_of(source),
        )


def is_unlit(source: dict[str, Any]) -> bool:
    return UNLIT in source.get("extensions", {})


def references(source: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """glTF's references to the textures that are drawn, by their key."""
    pbr = source.get("pbrMetallicRoughness", {})
    if is_unlit(source):
        return {"baseColorTexture": pbr["baseColorTexture"]} if "baseColorTexture" in pbr else {}
    found = {key: pbr[key] for key in ("baseColorTexture", "metallicRoughnessTexture") if key in pbr}
    return found | {key: source[key] for key in ("normalTexture", "emissiveTexture") if key in source}


def sets_of(source: dict[str, Any]) -> tuple[int, ...]:
    """Numbers of the sets of texture coordinates that become uv and, where there is a second, uv2."""
    return tuple(sorted({set_of(info) for info in references(source).values()})[:MOST_SETS])


def _alpha(source: dict[str, Any]) -> dict[str, Any]:
    alpha = {"MASK": "mask", "BLEND": "blend"}.get(source.get("alphaMode", "OPAQUE"), "opaque")
    base = source.get("pbrMetallicRoughness", {}).get("baseColorFactor", [1.0] * 4)
    opacity = 1.0 if alpha == "opaque" else float(base[3])
    return {"alpha": alpha, "opacity": opacity, "alpha_cutoff": source.get("alphaCutoff", 0.5)}


def specular_of(material: dict[str, Any]) -> tuple[float, tuple[str, ...]]:
    """(specular with F0 = 0.08 specular, what is left out of KHR_materials_ior and KHR_materials_specular).

    F0 = min(((ior - 1) / (ior + 1))^2 specularColorFactor, 1) specularFactor; the colour is left out. glTF multiplies the
    reflectance at grazing angles by specularFactor, too; ours is min(50 F0, 1) there.
    """
    extensions = material.get("extensions", {})
    ior = extensions.get("KHR_materials_ior", {}).get("ior", 1.5)
    values = extensions.get("KHR_materials_specular", {})
    factor, color = values.get("specularFactor", 1.0), values.get("specularColorFactor", [1.0] * 3)
    if is_metal(material):
        return 0.5, ()
    f0 = min(f0_of_ior(ior, material.get("name") or "material"), 1.0) * factor
    specular, limited = specular_of_f0(f0, f"ior {ior:g}")
    said = [f"specularColorFactor {_text(color)}"] if color != [1.0] * 3 else []
    said += [f"{key} of KHR_materials_specular" for key in ("specularTexture", "specularColorTexture") if key in values]
    grazing = min(50 * f0, 1.0)
    differs = factor != 1 and abs(grazing - factor) > GRAZING
    said += [f"specularFactor {factor:g} at grazing angles: reflectance is {grazing:g} there"] if differs else []
    return specular, (*said, *limited)


def is_metal(material: dict[str, Any]) -> bool:
    """Metal all over, so that what concerns dielectrics does not act."""
    pbr = material.get("pbrMetallicRoughness", {})
    return pbr.get("metallicFactor", 1) == 1 and "metallicRoughnessTexture" not in pbr


def unread_of(material: dict[str, Any]) -> tuple[str, ...]:
    """What of the material is not drawn, where it acts, each with its value."""
    if is_unlit(material):
        return ()
    said = []
    if material.get("occlusionTexture", {"strength": 0}).get("strength", 1) != 0:
        said.append("occlusion map")
    for name, values in material.get("extensions", {}).items():
        short = name.removeprefix("KHR_materials_")
        if name in STRENGTH_KEYS:
            strength = values.get(STRENGTH_KEYS[name], 0)
            said += [f"{short} {_text(strength)}"] if np.any(np.array(strength, dtype=float) != 0) else []
        elif name not in READ_EXTENSIONS:
            said.append(INSTEAD.get(name, f"extension {name}"))
    sets = sets_of(material)
    for key, info in references(material).items():
        if set_of(info) not in sets:
            said.append(f"texCoord {set_of(info)} of {key}: it is read with {sets[0]}")
    return tuple(said)


def is_told_by_materials(extension: str) -> bool:
    """Whether materials themselves say what of the extension is not drawn."""
    return extension.startswith("KHR_materials_") and extension != "KHR_materials_variants"


def with_metallic_roughness(material: dict[str, Any]) -> dict[str, Any]:
    """The material; one that has specular-glossiness values alone with the nearest core ones: diffuse colour,
    1 - glossiness, no metal. Its specular colour and its specular-glossiness texture are left out."""
    values = material.get("extensions", {}).get(SPECULAR_GLOSSINESS)
    if values is None or "pbrMetallicRoughness" in material:
        return material
    nearest = {
        "baseColorFactor": values.get("diffuseFactor", [1.0] * 4),
        "metallicFactor": 0.0,
        "roughnessFactor": 1 - values.get("glossinessFactor", 1.0),
    }
    if "diffuseTexture" in values:
        nearest["baseColorTexture"] = values["diffuseTexture"]
    return {**material, "pbrMetallicRoughness": nearest}


def _text(value) -> str:
    return f"({', '.join(f'{c:g}' for c in value)})" if isinstance(value, list | tuple) else f"{value:g}"
