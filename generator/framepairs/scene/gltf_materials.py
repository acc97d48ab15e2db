"""glTF's materials and images as ours: extensions that map onto ours are read, what is not drawn is named.

Sources: glTF 2.0 and the extensions' specifications in KhronosGroup/glTF. Everything works on the checked JSON of
`gltf_document`.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import IDENTITY_UV, Material, Slot, Texture
from .gltf_document import Document, is_elsewhere, read_uri
from .images import decode_image
from .reflectance import f0_of_ior, specular_of_f0

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
READ_EXTENSIONS = (
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_mesh_quantization",
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
GLTF_WRAP = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


class MaterialReader:
    """Materials of one file, each once; `materials` and `textures` grow as primitives ask for them."""

    def __init__(self, document: Document) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._document = document
        self._known: dict[int | None, int] = {}
        self._texels: dict[int, NDArray] = {}

    def index(self, number: int | None) -> int:
        """Index into `materials` of glTF's material `number`; None is glTF's default. Raises InputError naming the file."""
        if number not in self._known:
            source = self._document.entry("materials", number) if number is not None else {"name": "default"}
            try:
                material = self._material(with_metallic_roughness(source), f"material {number}")
            except InputError as error:
                raise InputError(error.problem, file=self._document.file, field=error.field) from None
            self._known[number] = len(self.materials)
            self.materials.append(material)
        return self._known[number]

    def _material(self, source: dict[str, Any], name: str) -> Material:
        pbr = source.get("pbrMetallicRoughness", {})
        base, normal = pbr.get("baseColorFactor", [1.0] * 4), source.get("normalTexture")
        strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        alpha = {"MASK": "mask", "BLEND": "blend"}.get(source.get("alphaMode", "OPAQUE"), "opaque")
        specular, said = specular_of(source)
        surface = self._slot(pbr.get("metallicRoughnessTexture"), scale=(0, 1, 1, 0), bias=(1, 0, 0, 1))
        return Material(
            name=source.get("name") or name,
            base_color=tuple(base[:3]),
            opacity=1.0 if alpha == "opaque" else float(base[3]),
            roughness=pbr.get("roughnessFactor", 1.0),
            metallic=pbr.get("metallicFactor", 1.0),
            specular=specular,
            emission=tuple(float(c) * strength for c in source.get("emissiveFactor", [0.0] * 3)),
            alpha=alpha,
            alpha_cutoff=source.get("alphaCutoff", 0.5),
            normal_scale=(normal or {}).get("scale", 1.0),
            base_texture=self._slot(pbr.get("baseColorTexture"), srgb=True),
            surface_texture=surface,
            normal_texture=self._slot(normal, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0)),
            emission_texture=self._slot(source.get("emissiveTexture"), srgb=True),
            not_read=(*unread_of(source), *said),
        )

    def _slot(self, info: dict[str, Any] | None, *, srgb: bool = False, scale=(1,) * 4, bias=(0,) * 4) -> Slot | None:
        """`info` is glTF's reference to the texture, or None."""
        if info is None:
            return None
        texture = self._document.entry("textures", info["index"])
        source = image_of(texture)
        if source is None:
            raise InputError(f"texture {info['index']} names no image that is read", field="textures")
        image = self._document.entry("images", source)
        uri = image.get("uri")
        name = uri if uri and is_elsewhere(uri) else f"image {source}"
        if source not in self._texels:
            self._texels[source] = self._decoded(image, name)
        texels = self._texels[source]
        wanted = Texture(name=name, texels=texels, srgb=srgb, wrap=self._wrap(texture), scale=scale, bias=bias)
        for index, known in enumerate(self.textures):
            if known.texels is texels and replace(known, texels=None) == replace(wanted, texels=None):
                return Slot(texture=index, uv=uv_of(info))
        self.textures.append(wanted)
        return Slot(texture=len(self.textures) - 1, uv=uv_of(info))

    def _decoded(self, image: dict[str, Any], name: str) -> NDArray:
        if "uri" in image:
            data = read_uri(image["uri"], self._document.file, "images")
        elif "bufferView" in image:
            data = bytes(self._document.view(image["bufferView"]))
        else:
            raise InputError(f"{name} has neither uri nor bufferView", field="images")
        try:
            return decode_image(data, name)
        except InputError as error:
            raise InputError(f"{name} {error.problem}", field="images") from None

    def _wrap(self, texture: dict[str, Any]) -> tuple[str, str]:
        sampler = self._document.entry("samplers", texture["sampler"]) if "sampler" in texture else {}
        modes = [sampler.get(key, 10497) for key in ("wrapS", "wrapT")]
        if not set(modes) <= set(GLTF_WRAP):
            raise InputError(f"wrap mode {modes} is none of glTF's: {sorted(GLTF_WRAP)}", field="samplers")
        return GLTF_WRAP[modes[0]], GLTF_WRAP[modes[1]]


def image_of(texture: dict[str, Any]) -> int | None:
    """Index of a texture's image: WebP where there is one; None where only other extensions name one."""
    return texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source", texture.get("source"))


def specular_of(material: dict[str, Any]) -> tuple[float, tuple[str, ...]]:
    """(specular with F0 = 0.08 specular, what is left out of KHR_materials_ior and KHR_materials_specular).

    F0 = min(((ior - 1) / (ior + 1))^2 specularColorFactor, 1) specularFactor; the colour is left out. glTF multiplies the
    reflectance at grazing angles by specularFactor, too; ours stays 1 there.
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
    said += [f"specularFactor {factor:g} at grazing angles: reflectance is 1 there"] if factor != 1 else []
    return specular, (*said, *limited)


def is_metal(material: dict[str, Any]) -> bool:
    """Metal all over, so that what concerns dielectrics does not act."""
    pbr = material.get("pbrMetallicRoughness", {})
    return pbr.get("metallicFactor", 1) == 1 and "metallicRoughnessTexture" not in pbr


def unread_of(material: dict[str, Any]) -> tuple[str, ...]:
    """What of the material is not drawn, where it acts, each with its value."""
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
    pbr = material.get("pbrMetallicRoughness", {})
    for key in ("baseColorTexture", "metallicRoughnessTexture", "normalTexture", "emissiveTexture"):
        info = pbr.get(key) or material.get(key) or {}
        texcoord = _transform(info).get("texCoord", info.get("texCoord", 0))
        said += [f"texCoord {texcoord} of {key}: it is read with 0"] if texcoord else []
    return tuple(said)


def is_told_by_materials(extension: str) -> bool:
    """Whether materials themselves say what of the extension is not drawn."""
    return extension.startswith("KHR_materials_") and extension != "KHR_materials_variants"


def uv_of(info: dict[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Rows of the 2x3 matrix of KHR_texture_transform, for our uv, whose v runs up.

    In glTF's uv, v down, it is translation x rotation x scale, where the rotation is counter-clockwise as seen on the image:
    (u, v) -> (c u + s v, -s u + c v). With v = 1 - v_up on both sides it is the matrix below.
    """
    values = _transform(info)
    if not {"offset", "rotation", "scale"} & set(values):
        return IDENTITY_UV
    (x, y), (a, b) = values.get("offset", (0.0, 0.0)), values.get("scale", (1.0, 1.0))
    c, s = math.cos(values.get("rotation", 0.0)), math.sin(values.get("rotation", 0.0))
    return (c * a, -s * b, s * b + x), (s * a, c * b, 1 - c * b - y)


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


def _transform(info: dict[str, Any]) -> dict[str, Any]:
    return info.get("extensions", {}).get("KHR_texture_transform", {})


def _text(value) -> str:
    return f"({', '.join(f'{c:g}' for c in value)})" if isinstance(value, list | tuple) else f"{value:g}"
