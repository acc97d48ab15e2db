"""Upscaling one LR image by itself: nearest, bilinear, bicubic (Catmull-Rom), Lanczos-2."""

from collections.abc import Iterator
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Neighbour:
    """One of the 3x3 pixels around a place. column, row: of the image, possibly outside. dx, dy: its centre minus the place, in
    pixels. inside: 1, or 0 where the image has no such pixel and `fetch` gives the nearest one. middle: whether it is the
    pixel that is nearest to the place."""

    column: jit.Int32
    row: jit.Int32
    dx: jit.Float
    dy: jit.Float
    inside: jit.Float
    middle: bool


def neighbours(image: Image, x, y) -> Iterator[Neighbour]:
    """The pixel of `image` nearest to each place and the eight around it, row by row. Places are in pixels of the image; with
    jitter they lie up to half a pixel outside."""
    right, bottom = dr.opaque(jit.Int32, image.width - 1), dr.opaque(jit.Int32, image.height - 1)
    i, j = dr.clip(jit.Int32(dr.floor(x)), 0, right), dr.clip(jit.Int32(dr.floor(y)), 0, bottom)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            a, b = i + column, j + row
            inside = dr.select((a >= 0) & (a <= right) & (b >= 0) & (b <= bottom), jit.Float(1), 0)
            yield Neighbour(a, b, jit.Float(a) + 0.5 - x, jit.Float(b) + 0.5 - y, inside, column == row == 0)


def opaque(value: float) -> jit.Float:
    """A number that the kernel reads instead of containing it, so that the next frame's replays it."""
    return dr.opaque(jit.Float, value)
