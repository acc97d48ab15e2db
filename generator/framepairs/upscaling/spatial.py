"""Upscaling one LR image by itself: nearest, bilinear, bicubic (Catmull-Rom), Lanczos-2."""

from ..backend import dr, jit
from ..warp import Image, bilinear, catmull_rom, lanczos2, nearest, pixel_centres

SPATIAL = {"nearest": nearest, "bilinear": bilinear, "bicubic": catmull_rom, "lanczos": lanczos2}

Size = tuple[int, int]
Jitter = tuple[float, float]


def upscale(image: Image, method: str, size: Size, jitter: Jitter) -> list:
    """One LR image at the HR pixel centres, for `size` = (width, height): planes of the result.

    At scale 1 without jitter each method gives the image back, bit for bit. Bicubic and Lanczos overshoot at edges.
    """
    return SPATIAL[method](image, *lr_places(image, size, jitter))


def lr_places(image: Image, size: Size, jitter: Jitter) -> tuple:
    """(x, y) in LR pixels of every HR pixel's centre, row-major.

    The LR pixel (i, j) shows the place (i + 0.5 - Jx, j + 0.5 - Jy), so a place p of the frame is looked up at p + J.
    """
    x, y = pixel_centres(*size)
    across, down = opaque(image.width / size[0]), opaque(image.height / size[1])
    return x * across + opaque(jitter[0]), y * down + opaque(jitter[1])


def opaque(value: float) -> jit.Float:
    """A number that the kernel reads instead of containing it, so that the next frame's replays it."""
    return dr.opaque(jit.Float, value)
