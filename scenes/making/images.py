"""What the scenes' images are drawn from: periodic noise, cells, bonds of blocks; and how they are written."""

from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image


def noise(height: int, width: int, slope: float, seed: int, stretch: float = 1.0, low: float = 1.0) -> np.ndarray:
    """Periodic noise [height, width], mean 0 and deviation 1. Amplitude falls as frequency^-slope; stretch > 1 draws it
    out along x; frequencies below `low` cycles per image are left out."""
    white = np.random.default_rng(seed).standard_normal((height, width))
    fy, fx = np.fft.fftfreq(height, 1 / height)[:, None], np.fft.fftfreq(width, 1 / width)[None, :] * stretch
    radius = np.hypot(fy, fx)
    gain = np.where(radius >= low, np.maximum(radius, 1e-9) ** -slope, 0)
    value = np.fft.ifft2(np.fft.fft2(white) * gain).real
    return (value - value.mean()) / value.std()


def smooth(low: float, high: float, value: np.ndarray) -> np.ndarray:
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def mix(a, b, t: np.ndarray) -> np.ndarray:
    """Between colours a and b ([3] or [h, w, 3]) by t [h, w]."""
    return np.asarray(a) * (1 - t[..., None]) + np.asarray(b) * t[..., None]


def save(folder: Path, name: str, linear: np.ndarray, *, colours: int | None = None, data: bool = False) -> None:
    """Write values in [0, 1] as 8-bit PNG, sRGB-encoded unless `data`; `colours` makes it a palette image."""
    value = np.clip(linear, 0, 1)
    if not data:
        rgb = value[..., :3]
        encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 1e-9) ** (1 / 2.4) - 0.055)
        value = np.concatenate([encoded, value[..., 3:]], axis=-1)
    image = Image.fromarray(np.round(value * 255).astype(np.uint8).squeeze())
    if colours:
        image = image.quantize(colours, dither=Image.Dither.NONE)
    image.save(folder / f"{name}.png", optimize=True)


def save_normal(folder: Path, name: str, height: np.ndarray, strength: float, colours: int = 64) -> None:
    """Tangent-space normals of a periodic height field in texels, as a palette image: a third of the size."""
    dx = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2 * strength
    dy = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) / 2 * strength  # rows run down, v runs up
    normal = np.stack([-dx, dy, np.ones_like(dx)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    save(folder, name, normal / 2 + 0.5, data=True, colours=colours)


def cells(size: int, columns: int, rows: int, seed: int, jitter: float, arch: float, arches: int):
    """Nearest and second nearest distance, and cell number, of setts laid in `arches` segmental arches; periodic."""
    rng = np.random.default_rng(seed)
    offset = rng.uniform(-jitter, jitter, (2, rows, columns))
    shift = rng.uniform(0, 1, rows)
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    across = (x * arches) % 1
    py = y * rows + arch * (1 - (2 * across - 1) ** 2)
    px = x * columns
    first, second, number = np.full((size, size), 9.0), np.full((size, size), 9.0), np.zeros((size, size), int)
    for step in (-1, 0, 1):
        row = np.floor(py).astype(int) + step
        sheared = px - shift[row % rows]
        for side in (-1, 0, 1):
            column = np.floor(sheared).astype(int) + side
            where = row % rows, column % columns
            distance = np.hypot(sheared - column - 0.5 - offset[0][where], py - row - 0.5 - offset[1][where])
            nearer = distance < first
            second = np.where(nearer, first, np.minimum(second, distance))
            number = np.where(nearer, where[0] * columns + where[1], number)
            first = np.where(nearer, distance, first)
    return first, second, number


def blocks(height: int, width: int, columns: int, rows: int):
    """Running bond: distance to the joint in units of a row, and block number [height, width]; periodic."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    py, px = y / height * rows, x / width * columns
    row = np.floor(py).astype(int)
    px = px + 0.5 * (row % 2)
    column = np.floor(px).astype(int)
    aspect = (width / columns) / (height / rows)
    edge = np.minimum(0.5 - np.abs(py - row - 0.5), (0.5 - np.abs(px - column - 0.5)) * aspect)
    return edge, row * columns + column % columns


def sky_directions(height: int, width: int) -> np.ndarray:
    """[height, width, 3], unit directions of the texels of a latitude-longitude image, y up."""
    polar = (np.arange(height) + 0.5)[:, None] / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5)[None, :] / width) * 2 * np.pi
    return np.stack(
        [np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.cos(azimuth)], axis=-1
    )


def save_radiance(folder: Path, name: str, radiance: np.ndarray) -> None:
    """Write [height, width, 3] as a half EXR with 6 bits of mantissa: steps of 1.6 %, a third of the size."""
    half = np.ascontiguousarray(radiance.astype(np.float16))
    half = ((half.view(np.uint16) + 8) & 0xFFF0).view(np.float16)
    channels = {letter: np.ascontiguousarray(half[..., k]) for k, letter in enumerate("RGB")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(folder / f"{name}.exr"))
