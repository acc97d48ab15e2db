"""Reading images into texels, and merging single channels of several images into one texture."""

import contextlib
import io
import re
import struct
import sys
import warnings
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from ..errors import InputError
from .description import Texture

MOST_PIXELS = 2**28  # refuse decompression bombs: larger images than 16384 x 16384
FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "TGA", "GIF", "PPM", "DDS")  # no others: some start programs (EPS)
EXR_MAGIC = b"\x76\x2f\x31\x01"
STRIP = 2**22  # pixels that are converted at a time
Image.MAX_IMAGE_PIXELS = MOST_PIXELS
CHROMA = (0.2126, 0.7152, 0.0722)  # luminance of Rec. 709, the primaries of an OpenEXR file that names none
GRAY16_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I")


def decode_image(data: bytes, name: str) -> NDArray:
    """Texels [height, width, 4], uint8, or float32 for files of more than 8 bits, from the bytes of an image file.

    PNG, JPEG, WebP, TIFF, BMP, TGA, GIF, PPM, DDS, OpenEXR and Radiance RGBE; of several pictures the first, as it is stored
    (orientations of EXIF are not applied, nor colour profiles). 16 bits are the codes divided by 65535, not decoded from sRGB.
    Grey images are spread over RGB; alpha is 1 (255) where the file has none; CMYK becomes RGB without a profile. Raises
    InputError naming `name`, also for more than 2^28 pixels.
    """
    if data[:4] == EXR_MAGIC:
        return _decode_exr(data, name)
    if data[:2] == b"#?":
        return _decode_radiance(data, name)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # we refuse where PIL warns
            image = Image.open(io.BytesIO(data), formats=FORMATS)
        with image:
            _check_size(image.width, image.height, name)
            deep = _deep_png(data, image)
            if deep is not None:
                return deep
            image.load()
            return texels_of(image)
    except InputError:
        raise
    except Exception as error:  # PIL's readers raise whatever they stumble over
        raise InputError(f"cannot be read as an image: {str(error) or type(error).__name__}", file=name) from None


def texels_of(image: Image.Image) -> NDArray:
    """Texels of a decoded PIL image; see `decode_image`."""
    if image.mode in GRAY16_MODES or image.mode == "F":
        gray = np.asarray(image, dtype=np.float32) / np.float32(65535 if image.mode != "F" else 1)
        return np.stack([gray, gray, gray, np.ones_like(gray)], axis=-1)
    texels = np.empty((image.height, image.width, 4), np.uint8)
    step = max(1, STRIP // max(image.width, 1))
    for top in range(0, image.height, step):
        strip = image.crop((0, top, image.width, min(top + step, image.height)))
        texels[top : top + step] = np.asarray(strip.convert("RGBA"))
    return texels


def _deep_png(data: bytes, image: Image.Image) -> NDArray[np.float32] | None:
    """The texels of a PNG of 16 bits in colour or with opacity, of which PIL keeps 8; None for others.

    PIL decodes them twice, once for the upper and once for the lower bytes. Grey with opacity is read as RGBA of 8 bits, whose
    rows are the same bytes.
    """
    if image.format != "PNG" or len(data) < 33 or data[24] != 16 or data[25] not in (2, 4, 6):
        return None
    if data[25] == 4:
        header = data[12:24] + b"\x08\x06" + data[26:29]
        same = data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]
        with Image.open(io.BytesIO(same), formats=("PNG",)) as pairs:
            codes = np.asarray(pairs).reshape(image.height, image.width, 4).astype(np.float32)
        values = (codes[..., 0::2] * 256 + codes[..., 1::2]) / np.float32(65535)
        return values[..., [0, 0, 0, 1]]
    texels = np.ones((image.height, image.width, 4), np.float32)
    planes = 3 if data[25] == 2 else 4
    texels[..., :planes] = np.asarray(image)[..., :planes]
    with Image.open(io.BytesIO(data), formats=("PNG",)) as lower:
        codec, extents, offset, mode = lower.tile[0]
        lower.tile = [(codec, extents, offset, mode.replace(";16B", ";16L"))]
        texels[..., :planes] = (texels[..., :planes] * 256 + np.asarray(lower)[..., :planes]) / np.float32(65535)
    return texels


def _check_size(width: int, height: int, name: str) -> None:
    if not 0 < width * height <= MOST_PIXELS:
        raise InputError(f"cannot be read as an image: {width} x {height} pixels, up to {MOST_PIXELS} are read", file=name)


def decode_srgb(texels: NDArray) -> NDArray[np.float32]:
    """RGB from sRGB codes in 0 to 1 (IEC 61966-2-1); what stands behind the first three components stays. [..., 3 or more]."""
    codes = texels[..., :3]
    linear = np.where(codes <= 0.04045, codes / 12.92, ((np.maximum(codes, 0) + 0.055) / 1.055) ** 2.4)
    return np.concatenate([linear, texels[..., 3:]], axis=-1).astype(np.float32)


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


def _decode_exr(data: bytes, name: str) -> NDArray[np.float32]:
    """The first part's R, G, B and A, those of its first layer, or Y with or without chroma.

    Of damaged pixels, OpenEXR's binding prints warnings to sys.stdout, which belongs to what the commands answer.
    """
    try:
        with OpenEXR.File(io.BytesIO(data), header_only=True) as file:
            (left, top), (right, bottom) = (corner.tolist() for corner in file.header()["dataWindow"])
        _check_size(right - left + 1, bottom - top + 1, name)
        with contextlib.redirect_stdout(sys.stderr), OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            planes = {key: np.asarray(channel.pixels, dtype=np.float32) for key, channel in file.channels().items()}
        return _rgba(planes, (bottom - top + 1, right - left + 1))
    except InputError:
        raise
    except Exception as error:  # OpenEXR raises bare Exceptions of several kinds; each becomes the one kind of ours
        raise InputError(f"cannot be read as OpenEXR: {error}", file=name) from None


def _rgba(planes: dict[str, NDArray[np.float32]], shape: tuple[int, int]) -> NDArray[np.float32]:
    """[height, width, 4] of an OpenEXR file's channels. Raises ValueError where they do not fit."""
    layers = dict.fromkeys(key.rpartition(".")[0] for key in planes)
    layer = "" if "" in layers else next((layer for layer in layers if f"{layer}.R" in planes), next(iter(layers)))
    prefix = f"{layer}." if layer else ""
    own = {key.removeprefix(prefix): plane for key, plane in planes.items() if key.rpartition(".")[0] == layer}
    first = own.get("Y", next(iter(own.values())))
    if {"Y", "RY", "BY"} <= set(own):
        red, blue = ((_enlarged(own[key], shape) + 1) * first for key in ("RY", "BY"))
        own |= {"R": red, "G": (first - CHROMA[0] * red - CHROMA[2] * blue) / np.float32(CHROMA[1]), "B": blue}
    found = [own.get("R", first), own.get("G", first), own.get("B", first), own.get("A", np.ones(shape, np.float32))]
    if any(plane.shape != shape for plane in found):
        raise ValueError("channels of several sizes")
    return np.stack(found, axis=-1)


def _enlarged(chroma: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Chroma of every second pixel, repeated."""
    steps = [-(-size // max(own, 1)) for size, own in zip(shape, chroma.shape, strict=True)]
    return chroma.repeat(steps[0], axis=0).repeat(steps[1], axis=1)[: shape[0], : shape[1]]


def _decode_radiance(data: bytes, name: str) -> NDArray[np.float32]:
    """Radiance RGBE (.hdr), plain or run-length encoded, rows from the top.

    Our own, because Mitsuba's reader corrupts memory where a file is cut short.
    """
    header = re.match(rb"#\?.*?\n\n-Y (\d{1,9}) \+X (\d{1,9})\n", data[:65536], re.DOTALL)
    if header is None:
        raise InputError("cannot be read as Radiance RGBE: no header with -Y and +X", file=name)
    height, width = (int(number) for number in header.groups())
    _check_size(width, height, name)
    body = memoryview(data)[header.end() :]
    is_encoded = 8 <= width < 32768 and bytes(body[:4]) == bytes((2, 2, width >> 8, width & 255))
    least = height * (4 + 4 * 2 * -(-width // 127)) if is_encoded else 4 * width * height
    try:
        if len(body) < least:
            raise ValueError("fewer bytes than its rows need")
        pixels = _run_lengths(body, width, height) if is_encoded else np.frombuffer(body[:least], np.uint8)
        rgbe = pixels.reshape(height, width, 4)
    except (ValueError, IndexError):
        raise InputError("cannot be read as Radiance RGBE: it is cut short or damaged", file=name) from None
    texels = np.ones((height, width, 4), np.float32)
    scale = np.ldexp(np.float32(1), np.arange(256, dtype=np.int32) - 136)
    scale[0] = 0
    np.multiply(rgbe[..., :3], scale[rgbe[..., 3:]], out=texels[..., :3])
    return texels


def _run_lengths(body: memoryview, width: int, height: int) -> NDArray[np.uint8]:
    """[height, width, 4] from rows that begin with 2, 2, width and hold one component after the other."""
    rows, place = bytearray(height * 4 * width), 0
    for row in range(height):
        if bytes(body[place : place + 2]) != b"\x02\x02":
            raise ValueError("a row without its mark")
        place += 4
        for component in range(4):
            filled = (row * 4 + component) * width
            end = filled + width
            while filled < end:
                count = body[place]
                is_run = count > 128
                count = count - 128 if is_run else count
                if count == 0 or filled + count > end:
                    raise ValueError("a run that leaves its row")
                values = bytes((body[place + 1],)) * count if is_run else body[place + 1 : place + 1 + count]
                rows[filled : filled + count] = values
                if len(values) != count:
                    raise ValueError("cut short")
                filled, place = filled + count, place + 1 + (1 if is_run else count)
    return np.frombuffer(rows, np.uint8).reshape(height, 4, width).transpose(0, 2, 1)
