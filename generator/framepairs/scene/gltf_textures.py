"""glTF's textures as ours: images, wrap modes, transforms and sets of texture coordinates.

Sources: glTF 2.0, chapter 3.8, KHR_texture_transform and EXT_texture_webp in KhronosGroup/glTF.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import IDENTITY_UV, Slot, Texture
from .gltf_document import Document, is_elsewhere, read_uri
from .images import decode_image, decode_srgb

GLTF_WRAP = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
WEBP = "EXT_texture_webp"


class TextureReader:
    """Textures of one file, each image decoded once; `textures` grows as materials ask for them."""

    def __init__(self, document: Document) -> None:
        self.textures: list[Texture] = []
        self._document = document
        self._texels: dict[Any, NDArray] = {}

    def slot(
        self, info: dict[str, Any] | None, sets: Sequence[int], *, srgb: bool = False, scale=(1,) * 4, bias=(0,) * 4
    ) -> Slot | None:
        """`info` is glTF's reference to the texture, or None. sets: which sets of texture coordinates are uv and uv2; another
        one is read as uv. Raises InputError naming the list of the JSON."""
        if info is None:
            return None
        texture = self._document.entry("textures", info["index"])
        source = image_of(texture)
        if source is None:
            others = ", ".join(name for name in texture.get("extensions", {}))
            problem = f"extension {others} is not read, and texture {info['index']} has no other image"
            raise InputError(problem if others else f"texture {info['index']} names no image", field="textures")
        self._document.entry("images", source)
        key = self._key(source)
        if key not in self._texels:
            self._texels[key] = self._decoded(source)
        if srgb and self._texels[key].dtype != np.uint8:  # more than 8 bits: Texture decodes none of them
            key, stored = (key, "decoded"), self._texels[key]
            if key not in self._texels:
                self._texels[key] = decode_srgb(stored)
        texels, set_index = self._texels[key], set_of(info)
        uv_set = sets.index(set_index) if set_index in sets else 0
        name, wrap = self._name(source), self._wrap(texture)
        wanted = Texture(name=name, texels=texels, srgb=srgb, wrap=wrap, scale=scale, bias=bias)
        for index, known in enumerate(self.textures):
            if known.texels is texels and replace(known, texels=None, name="") == replace(wanted, texels=None, name=""):
                return Slot(texture=index, uv=uv_of(info), uv_set=uv_set)
        self.textures.append(wanted)
        return Slot(texture=len(self.textures) - 1, uv=uv_of(info), uv_set=uv_set)

    def _name(self, source: int) -> str:
        uri = self._document.entry("images", source).get("uri")
        return uri if uri and is_elsewhere(uri) else f"image {source}"

    def _key(self, source: int) -> Any:
        """What images of the same bytes share."""
        image = self._document.entry("images", source)
        return image.get("uri", image.get("bufferView", ()))

    def _decoded(self, source: int) -> NDArray:
        image, name = self._document.entry("images", source), self._name(source)
        if "uri" in image:
            data = read_uri(self._document, image["uri"], "images")
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
    return texture.get("extensions", {}).get(WEBP, {}).get("source", texture.get("source"))


def set_of(info: dict[str, Any]) -> int:
    """Number of the set of texture coordinates that a reference reads."""
    return _transform(info).get("texCoord", info.get("texCoord", 0))


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


def _transform(info: dict[str, Any]) -> dict[str, Any]:
    return info.get("extensions", {}).get("KHR_texture_transform", {})
