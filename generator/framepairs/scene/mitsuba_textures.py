"""Textures and numbers in Mitsuba's dictionaries: constants, and bitmaps as our textures.

Mitsuba's images begin at v = 0, ours at v = 1. Meshes are therefore read with v_ours = 1 - v_mitsuba, and `to_uv` is turned
over accordingly. Normal maps mean the same in both, with the tangents that `mitsuba_shapes` gives the meshes that wear one.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .containment import Reach, within
from .description import IDENTITY_UV, Slot, Texture
from .images import decode_srgb, linear_texels, pack_channels, read_image
from .mitsuba_dictionary import LUMINANCE, constant_color, float_of, number_of, type_of

WRAP_MODES = ("repeat", "mirror", "clamp")
Rgb = tuple[float, float, float]
Placed = tuple[Texture, tuple]  # a texture and the 2x3 rows of its uv transform


class TextureReader:
    """Reads the textures of one object; `textures`, `said` (what is not drawn) and `files` grow meanwhile.

    texels: what was decoded already, by file, shared between the readers of a scene.
    """

    def __init__(self, reach: Reach, texels: dict[Path, NDArray] | None = None) -> None:
        self.reach = reach
        self.textures: list[Texture] = []
        self.said: list[str] = []
        self.files: list[Path] = []
        self._texels = {} if texels is None else texels
        self._decoded: dict[Path, NDArray] = {}

    def color(
        self, values: Mapping[str, Any], key: str, default: float = 0.5, *, emits: bool = False
    ) -> tuple[Rgb, Slot | None]:
        """Constant and slot of a colour: the slot's texture multiplies the constant."""
        value = values.get(key, default)
        scale = 1.0
        if isinstance(value, Mapping) and value.get("type") == "d65" and isinstance(value.get("color"), Mapping):
            value, scale = value["color"], number_of(value.get("scale", 1.0), f"scale of {key}")
        constant = constant_color(value, key, emits=emits)
        if constant is not None:
            return tuple(scale * component for component in constant), None
        if value["type"] == "bitmap":
            texture, uv = self.bitmap(value, key)
            return (scale,) * 3, self.slot(texture, uv)
        self.said.append(f"{key} through {value['type']}: grey {default:g} is drawn")
        return (scale * default,) * 3, None

    def number(self, values: Mapping[str, Any], key: str, default: float) -> tuple[float, Placed | None]:
        """Constant and image of a number, whose image's RGB components are equal."""
        value = values.get(key, default)
        if not isinstance(value, Mapping):
            return number_of(value, key), None
        constant = constant_color(value, key)
        if constant is not None:
            is_grey = constant[0] == constant[1] == constant[2]
            return constant[0] if is_grey else float(np.array(constant) @ LUMINANCE), None
        if value["type"] == "bitmap":
            texture, uv = self.bitmap(value, key)
            return 1.0, (_gray(texture), uv)
        self.said.append(f"{key} through {value['type']}: {default:g} is drawn")
        return default, None

    def bitmap(self, values: Mapping[str, Any], key: str) -> Placed:
        if "filename" not in values:
            raise InputError(f"bitmap of {key} without a filename")
        if values.get("filter_type", "bilinear") != "bilinear":
            self.said.append(f"{values['filter_type']} filter of {key}: it is filtered trilinearly")
        wrap = values.get("wrap_mode", "repeat")
        if wrap not in WRAP_MODES:
            raise InputError(f"wrap_mode {str(wrap)[:80]} of {key}: one of {', '.join(WRAP_MODES)} is expected")
        file = existing(self.reach, values["filename"], "image")
        self.files.append(file)
        if file not in self._texels:
            self._texels[file] = read_image(file)
        texels, is_raw = self._texels[file], bool(values.get("raw", False))
        if texels.dtype != np.uint8 and not is_raw and file.suffix.lower() not in (".exr", ".hdr"):
            texels = self._decoded.setdefault(file, decode_srgb(texels))
        is_srgb = texels.dtype == np.uint8 and not is_raw
        texture = Texture(name=str(values["filename"]), texels=texels, srgb=is_srgb, wrap=(wrap, wrap))
        return texture, uv_rows(values.get("to_uv"), key)

    def surface_slot(self, name: str, images: dict[int, Placed | None]) -> Slot | None:
        """Specular, roughness and metallic (components 0 to 2) in one texture; what is not sampled multiplies by 1."""
        parts = {k: (image[0], 0) for k, image in images.items() if image}
        if not parts:
            return None
        uvs = [image[1] for image in images.values() if image]
        if any(uv != uvs[0] for uv in uvs):
            self.said.append("to_uv of metallic: that of roughness is used")
        return self.slot(pack_channels(f"{name} surface", parts), uvs[0])

    def normal_slot(self, values: Mapping[str, Any]) -> Slot:
        texture, uv = self.bitmap(values, "normalmap")
        return self.slot(replaced(texture, texture.texels, srgb=texture.srgb, scale=2.0, bias=-1.0), uv)

    def slot(self, texture: Texture, uv: tuple) -> Slot:
        self.textures.append(texture)
        return Slot(texture=len(self.textures) - 1, uv=uv)


def existing(reach: Reach, name: Any, what: str) -> Path:
    """The file of that name within reach. Raises InputError where there is none."""
    if not isinstance(name, str):
        raise InputError(f"filename is {str(name)[:80]!r}, a string is expected")
    file = within(reach, name)
    if not file.is_file():
        raise InputError(f"missing {what} {name[:200]}")
    return file


def image_files(values: Mapping[str, Any], reach: Reach) -> tuple[Path, ...]:
    """The image files that a dictionary names, at any depth, each once. Raises InputError for those out of reach."""
    found = []
    if values.get("type") == "bitmap" and "filename" in values:
        found.append(existing(reach, values["filename"], "image"))
    for value in values.values():
        found += image_files(value, reach) if isinstance(value, Mapping) else []
    return tuple(dict.fromkeys(found))


def uv_rows(matrix: Any, key: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Our 2x3 rows of `to_uv`, a 3x3 or 4x4 matrix on Mitsuba's uv: with F = (u, 1 - v), F to_uv F."""
    if matrix is None:
        return IDENTITY_UV
    try:
        given = np.array(matrix, dtype=float)
    except (TypeError, ValueError):
        given = np.empty(0)
    if given.shape not in ((3, 3), (4, 4)) or not np.isfinite(given).all():
        raise InputError(f"to_uv of {key} is no 3x3 or 4x4 matrix")
    affine = np.eye(3)
    affine[:2, :2], affine[:2, 2] = given[:2, :2], given[:2, -1]
    flip = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
    return tuple(tuple(row) for row in (flip @ affine @ flip)[:2].tolist())


def replaced(texture: Texture, texels: NDArray, srgb: bool = False, scale: float = 1.0, bias: float = 0.0) -> Texture:
    scales, biases = (scale, scale, scale, 1.0), (bias, bias, bias, 0.0)
    return replace(texture, texels=texels, srgb=srgb, scale=scales, bias=biases)


def acts(value: Any) -> bool:
    """Whether a parameter that does nothing at 0 does something."""
    if isinstance(value, Mapping):
        constant = constant_color(value, type_of(value)) if value.get("type") != "bitmap" else None
        return constant is None or any(constant)
    return isinstance(value, str) or float_of(value) != 0


def _gray(texture: Texture) -> Texture:
    """The image as a number, as Mitsuba reads it: decoded, then the luminance of its colours."""
    texels = texture.texels
    if not texture.srgb and (texels[..., :1] == texels[..., 1:3]).all():
        return texture
    value = linear_texels(texture)[..., :3] @ np.float32(LUMINANCE)
    return replaced(texture, np.repeat(value[..., None], 4, axis=-1).astype(np.float32))
