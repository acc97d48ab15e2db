"""Reading images into texels, and merging single channels of several images into one texture."""

import io
import re
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
    to the largest by bilinear interpolation. Where images of 8 bits meet floats, they become floats, decoded from sRGB.
    Wrap modes and, for 8 bits, srgb are the first part's; scale and bias follow their component.
    """
    textures = [texture for texture, _ in parts.values()]
    first = textures[0]
    scale, bias = [1.0] * 4, [0.0] * 4
    for component, (texture, source) in parts.items():
        scale[component], bias[component] = texture.scale[source], texture.bias[source]
    if all(texture.texels is first.texels for texture in textures) and all(k == c for k, (_, c) in parts.items()):
        return replace(first, scale=tuple(scale), bias=tuple(bias))
    height = max(texture.texels.shape[0] for texture in textures)
    width = max(texture.texels.shape[1] for texture in textures)
    dtype = np.uint8 if all(texture.texels.dtype == np.uint8 for texture in textures) else np.float32
    one = 255 if dtype == np.uint8 else 1
    texels = np.full((height, width, 4), one, dtype=dtype)
    for component, (texture, source) in parts.items():
        plain = replace(texture, scale=(1.0,) * 4, bias=(0.0,) * 4)
        planes = texture.texels if dtype == np.uint8 else linear_texels(plain)
        channel = Image.fromarray(np.ascontiguousarray(planes[..., source]))
        if channel.size != (width, height):
            channel = channel.resize((width, height), Image.Resampling.BILINEAR)
        texels[..., component] = np.asarray(channel)
    srgb = first.srgb and dtype == np.uint8
    return replace(first, name=name, texels=texels, srgb=srgb, scale=tuple(scale), bias=tuple(bias))


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
    """Radiance RGBE (.hdr), plain or run-length encoded, rows from the top.

    Our own, because Mitsuba's reader corrupts memory where a file is cut short.
    """
    header = re.match(rb"#\?.*?\n\n-Y (\d+) \+X (\d+)\n", data, re.DOTALL)
    if header is None:
        raise InputError("cannot be read as Radiance RGBE: no header with -Y and +X", file=name)
    height, width = (int(number) for number in header.groups())
    if not 0 < height * width <= Image.MAX_IMAGE_PIXELS:
        raise InputError(f"cannot be read as Radiance RGBE: {width} x {height} pixels", file=name)
    body = np.frombuffer(data, np.uint8, offset=header.end())
    try:
        pixels = _run_lengths(body, width, height) if _is_run_length_encoded(body, width) else body[: 4 * width * height]
        rgbe = pixels.reshape(height, width, 4)
    except (ValueError, IndexError):
        raise InputError("cannot be read as Radiance RGBE: it is cut short or damaged", file=name) from None
    exponent = np.ldexp(np.float32(1), rgbe[..., 3:].astype(np.int32) - 136)
    rgb = np.where(rgbe[..., 3:] > 0, rgbe[..., :3].astype(np.float32) * exponent, np.float32(0))
    return np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=-1)


def _is_run_length_encoded(body: NDArray, width: int) -> bool:
    return 8 <= width < 32768 and len(body) >= 4 and (body[0], body[1]) == (2, 2) and int(body[2]) * 256 + int(body[3]) == width


def _run_lengths(body: NDArray, width: int, height: int) -> NDArray:
    """[height, width, 4] from rows that begin with 2, 2, width and hold one component after the other."""
    rows, place = np.empty((height, 4, width), np.uint8), 0
    for row in rows:
        if tuple(body[place : place + 2]) != (2, 2):
            raise ValueError("a row without its mark")
        place += 4
        for component in row:
            filled = 0
            while filled < width:
                count = int(body[place])
                run = count > 128
                count = count - 128 if run else count
                values = body[place + 1] if run else body[place + 1 : place + 1 + count]
                if count == 0 or filled + count > width:
                    raise ValueError("a run that leaves its row")
                component[filled : filled + count] = values
                filled, place = filled + count, place + 1 + (1 if run else count)
    return rows.transpose(0, 2, 1)
