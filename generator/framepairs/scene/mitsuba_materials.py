"""BSDFs of Mitsuba dictionaries into materials and textures, without Mitsuba.

`principled` has our parameters: alpha = roughness^2, F0 = 0.08 specular for dielectrics (from `eta` by Fresnel) and the base
colour for metals. One thing differs and cannot be mapped: its diffuse part is Disney's (Burley 2012), with retro-reflection,
ours Lambert. Measured with Mitsuba 3.9.1 at specular 0 and white, its directional albedo is 0.98 to 1.04 at normal incidence,
where Lambert has 1; at cosine 0.1 it is 0.69, 1.02 and 1.38 for roughness 0, 0.5 and 1, at cosine 0.02 0.54, 1.01 and 1.52;
its mean over the hemisphere is 0.953, 1.008 and 1.065. `diffuse` is our Lambert: without specular and metal there is no
specular lobe, and roughness is 1.

`conductor` and `roughconductor` with `ggx` are our metal: alpha = roughness^2, and F0 is Fresnel's reflectance at normal
incidence of the RGB indices. Between there and grazing angles Schlick's curve is not Fresnel's: over the hemisphere it
reflects up to 0.005 more for Ag, Au and Cu, 0.015 for Al and 0.037 for Cr, near grazing angles up to 0.03, 0.13 and 0.27.

Everything else is kept as it is (see `mitsuba_kept`), also a `principled` with a clearcoat, sheen or another lobe that ours
lacks; its other values stand in for it. `plastic` is not ours: its diffuse part falls with the light that the
coat lets in and out. At reflectance 0.5 and alpha 0.09 its directional albedo is 0.48, 0.50 and 0.57 at cosines 1, 0.5 and
0.2, where Lambert and GGX have 0.54, 0.57 and 0.75; at alpha 0.36 it is 0.34 where they have 0.53 to 0.59.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .containment import Reach
from .description import Material, Texture
from .images import linear_texels, pack_channels
from .mitsuba_dictionary import constant_color, kind_of, type_of
from .mitsuba_kept import kept_bsdf, stand_in
from .mitsuba_textures import TextureReader, acts, image_files, replaced
from .reflectance import LARGEST_F0, f0_of_ior, specular_of_f0

PRINCIPLED = ("base_color", "roughness", "metallic", "specular", "eta")
# Parameters of `principled` without counterpart; those named second act only through the first.
WITHOUT_COUNTERPART = ("anisotropic", "spec_tint", "sheen", "flatness", "clearcoat")
DEPENDENT = {"sheen_tint": "sheen", "clearcoat_gloss": "clearcoat"}
SAMPLING = ("main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate")
# F0 by Fresnel's equations of the RGB indices that Mitsuba 3.9.1 makes of its data/ior (llvm_ad_rgb).
METALS = {
    "none": (1.0, 1.0, 1.0), "Ag": (0.9748, 0.9575, 0.9063), "Al": (0.9280, 0.9178, 0.9189), "Au": (0.9667, 0.8020, 0.3241),
    "Be": (0.5975, 0.5206, 0.5062), "Cr": (0.6876, 0.6491, 0.6870), "Cu": (0.9520, 0.6198, 0.5106),
    "Cu_palik": (0.9494, 0.6217, 0.5092), "Hg": (0.8140, 0.7702, 0.7631), "Ir": (0.7426, 0.6802, 0.6308),
    "K": (0.9539, 0.9363, 0.9201), "Li": (0.9248, 0.8844, 0.7933), "Mo": (0.6182, 0.5618, 0.5409),
    "Na_palik": (0.9785, 0.9597, 0.9315), "Nb": (0.5640, 0.4895, 0.4731), "Ni_palik": (0.7001, 0.5942, 0.4936),
    "Rh": (0.8243, 0.7544, 0.7216), "TiN": (0.6409, 0.4523, 0.1976), "V_palik": (0.5727, 0.5107, 0.5365),
    "W": (0.5746, 0.4778, 0.4331),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ReadMaterial:
    """A material, its textures, to which its slots' indices refer (from 0), and the files it was read from. two_sided: its
    BSDF reflects from both sides. drawn: False for `null`, which light passes unchanged."""

    material: Material
    textures: tuple[Texture, ...]
    files: tuple[Path, ...]
    two_sided: bool
    drawn: bool = True


def material_of(values: Mapping[str, Any], name: str, reach: Reach, texels: dict[Path, NDArray] | None = None) -> ReadMaterial:
    """Material of a BSDF dictionary.

    values: any BSDF of Mitsuba's, also inside `twosided`, `mask`, `normalmap` and `bumpmap`; colours are linear Rec. 709.
    `mask` becomes a mask where its image is black and white, else a blend. What is not drawn stands in Material.not_read.
    Images are read within `reach` (see `image_files`); texels: those of files that were read before. Raises InputError naming
    the material for paths that leave it, for what cannot be read, for values of the wrong kind and for types that are none.
    """
    try:
        return _Reader(name, reach, texels).read(values)
    except InputError as error:
        raise InputError(error.problem, file=error.file, frame=error.frame, field=error.field or name) from None


def _has_more(principled: Mapping[str, Any]) -> bool:
    """Whether it has a lobe that our material lacks."""
    return any(key in WITHOUT_COUNTERPART for key in _acting(principled))


def _acting(principled: Mapping[str, Any]) -> list[str]:
    """Its parameters without counterpart that change anything."""
    keys = (*WITHOUT_COUNTERPART, *DEPENDENT)
    return [key for key in keys if all(acts(principled.get(k, 0)) for k in (key, DEPENDENT.get(key, key)))]


class _Reader:
    """One material."""

    def __init__(self, name: str, reach: Reach, texels: dict[Path, NDArray] | None) -> None:
        self.name, self.reach = name, reach
        self.texels = {} if texels is None else texels
        self.parts = TextureReader(reach, self.texels)
        self.said = self.parts.said

    def read(self, values: Mapping[str, Any]) -> ReadMaterial:
        inner, around, opacity, normal = self._unwrapped(values)
        kind = inner["type"]
        if self._is_ours(inner):
            self.said += ["bump map"] if "bumpmap" in around else []
            readers = {"principled": self._principled, "diffuse": self._diffuse}
            fields = readers.get(kind, self._conductor)(inner)
            fields |= {"bsdf": self._kept(inner, around)} if kind == "principled" and _has_more(inner) else {}
        elif kind == "null":
            fields = {}
        else:
            bsdf = self._kept(inner, around)
            fields = {**stand_in(bsdf), "bsdf": bsdf}
        fields |= self._opacity(fields, opacity)
        if normal is not None:
            fields["normal_texture"] = self.parts.normal_slot(normal)
        base = fields.pop("base", None)
        if kind == "null":
            fields |= {"opacity": 0.0, "alpha": "mask", "bsdf": None}
        material = Material(name=self.name, base_texture=base, **fields, not_read=tuple(self.said))
        files = (*self.parts.files, *image_files(fields.get("bsdf") or {}, self.reach))
        return ReadMaterial(
            material=material,
            textures=tuple(self.parts.textures),
            files=tuple(dict.fromkeys(files)),
            two_sided="twosided" in around or fields.get("bsdf") is not None,
            drawn=kind != "null",
        )

    def _is_ours(self, values: Mapping[str, Any]) -> bool:
        kind = values["type"]
        if kind == "principled":
            return not acts(values.get("spec_trans", 0))
        if kind == "conductor" or kind == "roughconductor":
            rough = kind == "conductor" or values.get("distribution", "beckmann") == "ggx" and "alpha_u" not in values
            return rough and self._f0(values) is not None
        return kind == "diffuse"

    def _unwrapped(self, values: Mapping[str, Any]) -> tuple[Mapping, dict[str, Mapping], Any, Any]:
        """The BSDF inside its adapters, these by type, the opacity of `mask` and the image of `normalmap` (None without)."""
        opacity, normal = None, None
        around: dict[str, Mapping] = {}
        while type_of(values, "a BSDF") in ("twosided", "mask", "normalmap", "bumpmap"):
            textures = ("opacity", "normalmap", "arbitrary")
            nested = [v for k, v in values.items() if isinstance(v, Mapping) and k not in textures and kind_of(v) == "bsdf"]
            if not nested:
                raise InputError(f"{values['type']} without a BSDF in it")
            if len(nested) > 1:
                self.said.append("BSDF of the back side: the front's is drawn on both")
            if values["type"] == "mask":
                opacity = values.get("opacity", 0.5)
            elif values["type"] == "normalmap":
                normal = values.get("normalmap")
                if not isinstance(normal, Mapping) or normal.get("type") != "bitmap":
                    raise InputError("normalmap without a bitmap")
            around.setdefault(values["type"], values)
            values = nested[0]
        if kind_of(values) != "bsdf":
            raise InputError(f"{values['type']} is no BSDF")
        return values, around, opacity, normal

    def _kept(self, inner: Mapping[str, Any], around: dict[str, Mapping]) -> dict[str, Any]:
        """The BSDF as it is, inside its normal map, bump map and `twosided`, and in a `mask` of one opacity; images of
        opacity are ours."""
        kind = inner["type"]
        for adapter, values in reversed(around.items()):
            if adapter != "mask" or self._is_constant(values.get("opacity", 0.5)):
                own = {k: v for k, v in values.items() if not isinstance(v, Mapping) or kind_of(v) != "bsdf"}
                inner = {**own, "inner": inner}
        bsdf, left_out = kept_bsdf(inner, self.reach, self.texels)
        self.said.append(f"BSDF {kind}: kept for path, raster draws a stand-in, not demodulated")
        self.said += left_out
        return bsdf

    def _is_constant(self, opacity: Any) -> bool:
        return not isinstance(opacity, Mapping) or constant_color(opacity, "opacity") is not None

    def _diffuse(self, values: Mapping[str, Any]) -> dict:
        self._tell_unknown(values, ("reflectance",))
        color, base = self.parts.color(values, "reflectance")
        return {"base_color": color, "base": base, "roughness": 1.0, "metallic": 0.0, "specular": 0.0}

    def _conductor(self, values: Mapping[str, Any]) -> dict:
        known = ("material", "eta", "k", "specular_reflectance", "distribution", "sample_visible", "alpha")
        self._tell_unknown(values, known)
        tint, base = self.parts.color(values, "specular_reflectance", 1.0)
        alpha, image = (0.0, None) if values["type"] == "conductor" else self.parts.number(values, "alpha", 0.1)
        if image is not None:
            texture, uv = image
            root = np.sqrt(np.clip(linear_texels(texture), 0, 1)).astype(np.float32)
            image = replaced(texture, root), uv
        elif not 0 <= alpha <= 1:
            raise InputError(f"alpha is {alpha:g}, 0 to 1 is expected")
        return {
            "base_color": tuple(a * b for a, b in zip(tint, self._f0(values), strict=True)),
            "base": base,
            "roughness": alpha**0.5,
            "metallic": 1.0,
            "surface_texture": self.parts.surface_slot(self.name, {1: image}),
        }

    def _f0(self, values: Mapping[str, Any]) -> tuple[float, float, float] | None:
        """Of a metal by its name, or by eta and k; None where these are textures or the name is not in our table."""
        if "eta" not in values and "k" not in values:
            return METALS.get(str(values.get("material", "none")))
        eta, k = (constant_color(values.get(key, default), key) for key, default in (("eta", 0.0), ("k", 1.0)))
        if eta is None or k is None:
            return None
        return tuple(((e - 1) ** 2 + c**2) / max((e + 1) ** 2 + c**2, 1e-12) for e, c in zip(eta, k, strict=True))

    def _principled(self, values: Mapping[str, Any]) -> dict:
        self._tell_unknown(values, (*PRINCIPLED, *WITHOUT_COUNTERPART, *DEPENDENT, *SAMPLING, "spec_trans"))
        color, base = self.parts.color(values, "base_color")
        roughness, roughness_image = self.parts.number(values, "roughness", 0.5)
        metallic, metallic_image = self.parts.number(values, "metallic", 0.0)
        self.said += [f"{key} {_text(values[key])}" for key in _acting(values)]
        return {
            "base_color": color,
            "base": base,
            "roughness": roughness,
            "metallic": metallic,
            "specular": self._specular(values, is_metal=metallic == 1 and metallic_image is None),
            "surface_texture": self.parts.surface_slot(self.name, {1: roughness_image, 2: metallic_image}),
        }

    def _specular(self, values: Mapping[str, Any], is_metal: bool) -> float:
        if "eta" in values and "specular" in values:
            raise InputError("eta and specular, which say the same: one is expected")
        key = "eta" if "eta" in values else "specular"
        given, image = self.parts.number(values, key, 0.5)
        if image is not None:
            self.said.append(f"{key} through an image: 0.5 is specular")
            return 0.5
        f0 = f0_of_ior(given, self.name) if key == "eta" else LARGEST_F0 * given
        specular, said = specular_of_f0(f0, f"{key} {given:g}")
        self.said += [] if is_metal else said
        return specular

    def _opacity(self, fields: dict, opacity: Any) -> dict:
        """Fields that `mask` sets."""
        if opacity is None:
            return {}
        value, image = self.parts.number({"opacity": opacity}, "opacity", 1.0)
        below = fields.get("opacity", 1.0)
        if image is None:
            return {"opacity": value * below, "alpha": "opaque" if value * below >= 1 else "blend"}
        texture, uv = image
        alpha = linear_texels(texture)[..., 0]
        base, textures = fields.get("base"), self.parts.textures
        if base and base.uv != uv:
            self.said.append("to_uv of opacity: that of base_color is used")
        color = textures[base.texture] if base else replaced(texture, texture.texels, scale=0.0, bias=1.0)
        packed = pack_channels(f"{self.name} base", {0: (color, 0), 1: (color, 1), 2: (color, 2), 3: (texture, 0)})
        slot = self.parts.slot(packed, base.uv if base else uv)
        if base:
            textures[base.texture] = textures.pop()
            slot = base
        is_mask = bool(((alpha == 0) | (alpha == 1)).all()) and below == 1
        return {"base": slot, "alpha": "mask" if is_mask else "blend"}

    def _tell_unknown(self, values: Mapping[str, Any], known: tuple[str, ...]) -> None:
        self.said += [f"property {key}" for key in values if key not in (*known, "type", "id")]


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"({value.get('type')})" if value.get("type") == "bitmap" else str(value.get("value"))
    return f"{value:g}" if isinstance(value, int | float) else str(value)
