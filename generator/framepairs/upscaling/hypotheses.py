"""How well a frame fits its truth under what a corpus declares of jitter and motion, and under what is often confused with it.

Both need no history, so that they judge frames in motion, and neither gains by a blur that hides an error.
"""

import numpy as np
from numpy.typing import NDArray

from ..backend import dr
from ..channels import seen_before
from ..metrics import psnr, to_display
from ..warp import Image, backward_warp, to_array, to_image
from .inputs import FrameReader
from .spatial import Jitter, upscale

MOTIONS = {
    "declared": (1, 1), "negated": (-1, -1), "flipped in x": (-1, 1), "flipped in y": (1, -1), "halved": (0.5, 0.5),
    "doubled": (2, 2), "none": (0, 0),
}  # fmt: skip


def jitters(declared: Jitter, before: Jitter | None) -> dict[str, Jitter]:
    """J by what a corpus may have meant. before: of the frame before, where there is one."""
    x, y = declared
    found = {"declared": (x, y), "negated": (-x, -y), "flipped in x": (-x, y), "flipped in y": (x, -y), "swapped": (y, x)}
    found |= {"doubled": (2 * x, 2 * y), "none": (0.0, 0.0)}
    return found | ({"one frame late": before} if before else {})


def jitter_fits(reader: FrameReader, stream: str, truth: NDArray, before: Jitter | None) -> dict[str, float]:
    """PSNR in dB of the frame, upscaled bilinearly at each J, against the truth's display codes."""
    color, size = reader.image(stream, "color"), tuple(reader.record.streams["hr"].size)
    fits = {}
    for name, jitter in jitters(tuple(reader.record.streams[stream].jitter), before).items():
        image = to_array(upscale(color, "bilinear", size, jitter), *size)
        fits[name] = psnr(to_display(np.maximum(image, 0), reader.record.exposure_ev), truth)
    return fits


def motion_fits(reader: FrameReader, stream: str, truth: NDArray, previous: NDArray) -> dict[str, float]:
    """PSNR in dB of the previous frame's truth, warped by each motion of `stream`, against the truth, display codes, over what
    the previous frame shows; nothing where that is nothing, or where nothing moves."""
    motion, bits = reader.image(stream, "motion"), reader.image(stream, "visibility").planes[0]
    seen = np.array(seen_before(bits)).reshape(motion.height, motion.width)
    if not seen.any() or not any(np.any(np.array(plane)) for plane in motion.planes):
        return {}
    size, jitter = (motion.width, motion.height), tuple(reader.record.streams[stream].jitter)
    now, then = to_image(truth), to_image(previous)

    def warped(image: Image, factors: tuple[float, float]) -> NDArray:
        planes = tuple(plane * dr.opaque(type(plane), factor) for plane, factor in zip(motion.planes, factors, strict=True))
        return to_array(backward_warp(image, Image(planes, *size), "bilinear", jitter), *size)[seen]

    here = warped(now, (0, 0))
    return {name: psnr(warped(then, factors), here) for name, factors in MOTIONS.items()}
