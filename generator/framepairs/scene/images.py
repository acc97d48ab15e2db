"""Reading images into texels, and merging single channels of several images into one texture."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from ..errors import InputError
from .description import Texture

Image.MAX_IMAGE_PIXELS = 2**28  # refuse decompression bombs: larger images than 16384 x 16384


def decode_image(data: bytes, name: str) -> NDArray:
    """Texels [height, width, 4], uint8, or float32 for files of more than 8 bits, from the bytes of an image file.

    Grey images are spread over RGB; alpha is 1 (255) where the file has none. Raises InputError naming `name`.
    """
    if data[:4] == b"\x76\x2f\x31\x01":
        return _decode_exr(data, name)
    if data[:2] == b"#?":
        return _decode_radiance(data, name)
    try:
        image = Image.open(io.BytesIO(data))
        image.load()
    except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"cannot be read as an image: {error}", file=name) from None
    return texels_of(image)


def texels_of(image: Image.Image) -> NDArray:
    """Texels of a decoded PIL image; see `decode_image`."""
    if image.mode in ("I;16", "I;16B", "I", "F"):
        gray = np.asarray(image, dtype=np.float32) / (65535 if image.mode != "F" else 1)
        return np.stack([gray, gray, gray, np.ones_like(gray)], axis=-1)
    return np.asarray(image.convert("RGBA"))


def read_image(file: Path) -> NDArray:
    try:
        return decode_image(file.read_bytes(), str(file))
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None


def linear_texels(texture: Texture) -> NDArray[np.float32]:
    """[height, width, 4]: the stored texels decoded from sRGB (RGB only, IEC 61966-2-1), scaled and biased."""
    texels = texture.texels
    if texels.dtype == np.uint8:
        codes = np.arange(256) / 255.0
        linear = codes.astype(np.float32)
        decoded = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4).astype(np.float32)
        tables = [decoded if texture.srgb and k < 3 else linear for k in range(4)]
        values = np.stack([table[texels[..., k]] for k, table in enumerate(tables)], axis=-1)
    else:
        values = texels.astype(np.float32)
    return values * np.float32(texture.scale) + np.float32(texture.bias)


def pack_channels(name: str, parts: dict[int, tuple[Texture, int]]) -> Texture:
    """One texture whose component `k` is component `parts[k][1]` of `parts[k][0]`; components not named are 1.

    Used for roughness, metallic and specular, and for opacity beside base colour. Images of different sizes are brought
    to the largest by bilinear interpolation. Wrap modes are the first part's; scale and bias follow their component.
    """
    textures = [texture for texture, _ in parts.values()]
    first = textures[0]
    if all(texture.texels is first.texels for texture in textures) and all(k == c for k, (_, c) in parts.items()):
        return first
    height = max(texture.texels.shape[0] for texture in textures)
    width = max(texture.texels.shape[1] for texture in textures)
    dtype = np.uint8 if all(texture.texels.dtype == np.uint8 for texture in textures) else np.float32
    one = 255 if dtype == np.uint8 else 1
    texels = np.full((height, width, 4), one, dtype=dtype)
    scale, bias = [1.0] * 4, [0.0] * 4
    for component, (texture, source) in parts.items():
        channel = Image.fromarray(np.ascontiguousarray(texture.texels[..., source]))
        if channel.size != (width, height):
            channel = channel.resize((width, height), Image.Resampling.BILINEAR)
        value = np.asarray(channel)
        texels[..., component] = value / 255 if dtype == np.float32 and value.dtype == np.uint8 else value
        scale[component], bias[component] = texture.scale[source], texture.bias[source]
    return replace(first, name=name, texels=texels, scale=tuple(scale), bias=tuple(bias))


def _decode_exr(data: bytes, name: str) -> NDArray:
    try:
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            planes = {key: np.asarray(channel.pixels, dtype=np.float32) for key, channel in file.channels().items()}
    except Exception as error:  # OpenEXR raises bare Exceptions of several kinds; each becomes the one kind of ours
        raise InputError(f"cannot be read as OpenEXR: {error}", file=name) from None
    first = next(iter(planes.values()))
    gray = planes.get("Y", first)
    alpha = planes.get("A", np.ones_like(first))
    return np.stack([planes.get("R", gray), planes.get("G", gray), planes.get("B", gray), alpha], axis=-1)


def _decode_radiance(data: bytes, name: str) -> NDArray:
    from ..backend import mi  # Mitsuba reads RGBE; no other dependency does

    stream = mi.MemoryStream()
    stream.write(data)
    stream.seek(0)
    try:
        bitmap = mi.Bitmap(stream).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    except RuntimeError as error:
        raise InputError(f"cannot be read as Radiance RGBE: {error}", file=name) from None
    rgb = np.array(bitmap)
    return np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=-1)
