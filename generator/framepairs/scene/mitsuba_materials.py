"""BSDFs of Mitsuba dictionaries into materials and textures, without Mitsuba.

`principled` has our parameters: alpha = roughness^2, F0 = 0.08 specular for dielectrics (from `eta` by Fresnel) and the base
colour for metals. One thing differs and cannot be mapped: its diffuse part is Disney's (Burley 2012), with retro-reflection,
ours Lambert. Measured with Mitsuba 3.9.1 at specular 0 and white, its directional albedo is 0.98 to 1.04 at normal incidence,
where Lambert has 1; at cosine 0.1 it is 0.69, 1.02 and 1.38 for roughness 0, 0.5 and 1, at cosine 0.02 0.54, 1.01 and 1.52;
its mean over the hemisphere is 0.953, 1.008 and 1.065. `diffuse` is our Lambert with specular 0, where Schlick's reflectance
stays 1 at grazing angles: roughness 1 keeps what that adds below 0.04 (0.003 over the hemisphere; height-correlated Smith).

Mitsuba's images begin at v = 0, ours at v = 1. Meshes are therefore read with v_ours = 1 - v_mitsuba, and `to_uv` is turned
over accordingly. Normal maps mean the same in both.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import IDENTITY_UV, Material, Slot, Texture
from .images import linear_texels, pack_channels, read_image
from .reflectance import LARGEST_F0, f0_of_ior, specular_of_f0

LUMINANCE = (0.212671, 0.715160, 0.072169)  # of Rec. 709, with Mitsuba's digits; how it reads a colour image as a number
WRAP_MODES = ("repeat", "mirror", "clamp")
PRINCIPLED = ("base_color", "roughness", "metallic", "specular", "eta")
# Parameters of `principled` without counterpart; those named second act only through the first.
WITHOUT_COUNTERPART = ("anisotropic", "spec_trans", "spec_tint", "sheen", "flatness", "clearcoat")
DEPENDENT = {"sheen_tint": "sheen", "clearcoat_gloss": "clearcoat"}
SAMPLING = ("main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate")


def material_from_principled(values: dict, name: str, folder: Path) -> tuple[Material, tuple[Texture, ...]]:
    """Material of a BSDF dictionary, and its textures, to which its slots' indices refer (from 0).

    values: {"type": "principled" | "diffuse", ...}, also inside `twosided`, `mask`, `normalmap` and `bumpmap`; colours are
    linear Rec. 709. `diffuse` is specular 0 and roughness 1. `mask` becomes a mask where its image is black and white, else
    a blend. Any other BSDF is drawn in the default grey. What is not drawn stands in Material.not_read. Images are read from
    `folder` (see `image_files`). Raises InputError naming the material for paths that leave it, for what cannot be read, for
    values of the wrong kind and for `eta` beside `specular`.
    """
    try:
        reader = _Reader(name, Path(folder))
        return reader.material(values), tuple(reader.textures)
    except InputError as error:
        raise InputError(error.problem, file=error.file, frame=error.frame, field=error.field or name) from None


def image_files(values: dict, folder: Path) -> tuple[Path, ...]:
    """The image files that a dictionary names, at any depth, each once. Raises InputError for those outside `folder`."""
    found = []
    if values.get("type") == "bitmap" and "filename" in values:
        found.append(_inside(values["filename"], folder))
    for value in values.values():
        found += image_files(value, folder) if isinstance(value, dict) else []
    return tuple(dict.fromkeys(found))


class _Reader:
    """One material; `textures` and `said` grow while it is read."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        self.textures: list[Texture] = []
        self.said: list[str] = []
        self._texels: dict[Path, NDArray] = {}

    def material(self, values: dict) -> Material:
        inner, opacity, normal = self._unwrapped(values)
        readers = {"principled": self._principled, "diffuse": self._diffuse}
        if inner["type"] not in readers:
            self.said.append(f"BSDF {inner['type']}: the default grey is drawn")
        fields = readers[inner["type"]](inner) if inner["type"] in readers else {}
        fields |= self._opacity(fields, opacity)
        if normal is not None:
            fields["normal_texture"] = self._normal_slot(normal)
        base = fields.pop("base", None)
        return Material(name=self.name, base_texture=base, **fields, not_read=tuple(self.said))

    def _unwrapped(self, values: dict) -> tuple[dict, object, dict | None]:
        """The BSDF inside its adapters, the opacity of `mask` and the image of `normalmap` (None without)."""
        opacity, normal = None, None
        while _type_of(values) in ("twosided", "mask", "normalmap", "bumpmap"):
            textures = ("opacity", "normalmap", "arbitrary")
            nested = [v for k, v in values.items() if isinstance(v, dict) and k not in textures and _is_bsdf(v)]
            if not nested:
                raise InputError(f"{values['type']} without a BSDF in it")
            if len(nested) > 1:
                self.said.append("BSDF of the back side: the front's is drawn on both")
            if values["type"] == "mask":
                opacity = values.get("opacity", 0.5)
            elif values["type"] == "normalmap":
                normal = values.get("normalmap")
                if not isinstance(normal, dict) or normal.get("type") != "bitmap":
                    raise InputError("normalmap without a bitmap")
            elif values["type"] == "bumpmap":
                self.said.append("bump map")
            values = nested[0]
        return values, opacity, normal

    def _diffuse(self, values: dict) -> dict:
        self._tell_unknown(values, ("reflectance",))
        color, base = self._color(values, "reflectance")
        return {"base_color": color, "base": base, "roughness": 1.0, "metallic": 0.0, "specular": 0.0}

    def _principled(self, values: dict) -> dict:
        self._tell_unknown(values, (*PRINCIPLED, *WITHOUT_COUNTERPART, *DEPENDENT, *SAMPLING))
        color, base = self._color(values, "base_color")
        roughness, roughness_image = self._number(values, "roughness", 0.5)
        metallic, metallic_image = self._number(values, "metallic", 0.0)
        for key in (*WITHOUT_COUNTERPART, *DEPENDENT):
            acts = all(_acts(values.get(k, 0)) for k in (key, DEPENDENT.get(key, key)))
            self.said += [f"{key} {_text(values[key])}"] if acts else []
        return {
            "base_color": color,
            "base": base,
            "roughness": roughness,
            "metallic": metallic,
            "specular": self._specular(values, is_metal=metallic == 1 and metallic_image is None),
            "surface_texture": self._surface_slot({1: roughness_image, 2: metallic_image}),
        }

    def _specular(self, values: dict, is_metal: bool) -> float:
        if "eta" in values and "specular" in values:
            raise InputError("eta and specular, which say the same: one is expected")
        key = "eta" if "eta" in values else "specular"
        given, image = self._number(values, key, 0.5)
        if image is not None:
            self.said.append(f"{key} through an image: 0.5 is specular")
            return 0.5
        f0 = f0_of_ior(given, self.name) if key == "eta" else LARGEST_F0 * given
        specular, said = specular_of_f0(f0, f"{key} {given:g}")
        self.said += [] if is_metal else said
        return specular

    def _opacity(self, fields: dict, opacity) -> dict:
        """Fields that `mask` sets."""
        if opacity is None:
            return {}
        value, image = self._number({"opacity": opacity}, "opacity", 1.0)
        if image is None:
            return {"opacity": value, "alpha": "opaque" if value >= 1 else "blend"}
        texture, uv = image
        alpha = linear_texels(texture)[..., 0]
        base = fields.get("base")
        if base and base.uv != uv:
            self.said.append("to_uv of opacity: that of base_color is used")
        color = self.textures[base.texture] if base else _replaced(texture, texture.texels, scale=0.0, bias=1.0)
        packed = pack_channels(f"{self.name} base", {0: (color, 0), 1: (color, 1), 2: (color, 2), 3: (texture, 0)})
        slot = self._slot(packed, base.uv if base else uv)
        if base:
            self.textures[base.texture] = self.textures.pop()
            slot = base
        is_mask = bool(((alpha == 0) | (alpha == 1)).all())
        return {"base": slot, "alpha": "mask" if is_mask else "blend"}

    def _color(self, values: dict, key: str) -> tuple[tuple[float, float, float], Slot | None]:
        """Constant and slot of a colour, by default grey 0.5."""
        value = values.get(key, 0.5)
        if not isinstance(value, dict):
            return _rgb(value, key), None
        if value.get("type") in ("rgb", "srgb", "uniform", "spectrum"):
            given = value.get("value", value.get("color"))
            if value["type"] != "spectrum" or not isinstance(given, list | tuple):
                return _rgb(given, key), None
        if value.get("type") == "bitmap":
            texture, uv = self._bitmap(value, key)
            return (1.0, 1.0, 1.0), self._slot(texture, uv)
        self.said.append(f"{key} through {value.get('type')}: grey 0.5 is drawn")
        return (0.5, 0.5, 0.5), None

    def _number(self, values: dict, key: str, default: float) -> "tuple[float, tuple[Texture, tuple] | None]":
        """Constant and image [h, w, 4] of a number, whose image's components are equal."""
        value = values.get(key, default)
        if not isinstance(value, dict):
            return _number_of(value, key), None
        if value.get("type") in ("uniform", "spectrum", "rgb") and not isinstance(value.get("value"), str | dict):
            given = np.atleast_1d(np.array(value.get("value"), dtype=float))
            if given.size in (1, 3):
                return _number_of(float(given @ LUMINANCE) if given.size == 3 else float(given[0]), key), None
        if value.get("type") == "bitmap":
            texture, uv = self._bitmap(value, key)
            return 1.0, (_gray(texture), uv)
        self.said.append(f"{key} through {value.get('type')}: {default:g} is drawn")
        return default, None

    def _bitmap(self, values: dict, key: str) -> tuple[Texture, tuple]:
        if "filename" not in values:
            raise InputError(f"bitmap of {key} without a filename")
        if values.get("filter_type", "bilinear") != "bilinear":
            self.said.append(f"{values['filter_type']} filter of {key}: it is filtered trilinearly")
        wrap = values.get("wrap_mode", "repeat")
        if wrap not in WRAP_MODES:
            raise InputError(f"wrap_mode {wrap} of {key}: one of {', '.join(WRAP_MODES)} is expected")
        file = _inside(values["filename"], self.folder)
        if file not in self._texels:
            self._texels[file] = read_image(file)
        texels, is_raw = self._texels[file], bool(values.get("raw", False))
        if texels.dtype != np.uint8 and not is_raw and file.suffix.lower() not in (".exr", ".hdr"):
            self.said.append(f"sRGB of {values['filename']}, more than 8 bits: it is read as linear")
        texture = Texture(
            name=values["filename"], texels=texels, srgb=texels.dtype == np.uint8 and not is_raw, wrap=(wrap, wrap)
        )
        return texture, _uv_of(values.get("to_uv"), key)

    def _surface_slot(self, images: "dict[int, tuple[Texture, tuple] | None]") -> Slot | None:
        """Roughness and metallic in one texture; what is not sampled multiplies by 1."""
        parts = {k: (image[0], 0) for k, image in images.items() if image}
        if not parts:
            return None
        uvs = [image[1] for image in images.values() if image]
        if any(uv != uvs[0] for uv in uvs):
            self.said.append("to_uv of metallic: that of roughness is used")
        return self._slot(pack_channels(f"{self.name} surface", parts), uvs[0])

    def _normal_slot(self, values: dict) -> Slot:
        texture, uv = self._bitmap(values, "normalmap")
        return self._slot(_replaced(texture, texture.texels, srgb=texture.srgb, scale=2.0, bias=-1.0), uv)

    def _slot(self, texture: Texture, uv: tuple) -> Slot:
        self.textures.append(texture)
        return Slot(texture=len(self.textures) - 1, uv=uv)

    def _tell_unknown(self, values: dict, known: tuple[str, ...]) -> None:
        self.said += [f"property {key}" for key in values if key not in (*known, "type", "id")]


def _acts(value) -> bool:
    """Whether a parameter that does nothing at 0 does something."""
    if isinstance(value, dict):
        return value.get("type") not in ("uniform", "spectrum", "rgb") or bool(np.any(np.array(value.get("value")) != 0))
    return value != 0


def _type_of(values) -> str:
    if not isinstance(values, dict) or not isinstance(values.get("type"), str):
        raise InputError("a BSDF without a type")
    return values["type"]


def _is_bsdf(values: dict) -> bool:
    return values.get("type") not in ("bitmap", "rgb", "srgb", "uniform", "spectrum", "checkerboard", None)


def _inside(filename, folder: Path) -> Path:
    """The file, which must lie in `folder`, links followed."""
    root = Path(folder).resolve()
    file = (root / str(filename)).resolve()
    if not file.is_relative_to(root):
        raise InputError(f"image {filename} lies outside the scene's folder")
    if not file.is_file():
        raise InputError(f"missing image {filename}")
    return file


def _uv_of(matrix, key: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Our 2x3 rows of `to_uv`, a 3x3 or 4x4 matrix on Mitsuba's uv: with F = (u, 1 - v), F to_uv F."""
    if matrix is None:
        return IDENTITY_UV
    given = np.array(matrix, dtype=float)
    if given.shape not in ((3, 3), (4, 4)):
        raise InputError(f"to_uv of {key} is no 3x3 or 4x4 matrix")
    affine = np.eye(3)
    affine[:2, :2], affine[:2, 2] = given[:2, :2], given[:2, -1]
    flip = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
    return tuple(tuple(row) for row in (flip @ affine @ flip)[:2].tolist())


def _gray(texture: Texture) -> Texture:
    """The image as a number, as Mitsuba reads it: decoded, then the luminance of its colours."""
    texels = texture.texels
    if not texture.srgb and (texels[..., :1] == texels[..., 1:3]).all():
        return texture
    value = linear_texels(texture)[..., :3] @ np.float32(LUMINANCE)
    return _replaced(texture, np.repeat(value[..., None], 4, axis=-1).astype(np.float32))


def _replaced(texture: Texture, texels: NDArray, srgb: bool = False, scale: float = 1.0, bias: float = 0.0) -> Texture:
    scales, biases = (scale, scale, scale, 1.0), (bias, bias, bias, 0.0)
    return Texture(name=texture.name, texels=texels, srgb=srgb, wrap=texture.wrap, scale=scales, bias=biases)


def _rgb(value, key: str) -> tuple[float, float, float]:
    given = value if isinstance(value, list | tuple | np.ndarray) else [value] * 3
    if len(given) != 3:
        raise InputError(f"{key} has {len(given)} components, 3 are expected")
    return tuple(_number_of(component, key) for component in given)


def _number_of(value, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise InputError(f"{key} is {value!r}, a number is expected")
    return float(value)


def _text(value) -> str:
    if isinstance(value, dict):
        return f"({value.get('type')})" if value.get("type") == "bitmap" else str(value.get("value"))
    return f"{value:g}" if isinstance(value, int | float) else str(value)
