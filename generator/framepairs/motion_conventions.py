"""Motion as each paper wants it: direction, unit, y axis, jitter; sampling grids; dilation; masks of missing history.

Pure functions on a frame's arrays, NumPy's or torch's alike (Python array API), [height, width, components] as
`Corpus.read` gives them. Our own motion is previous - current place of the surface point, in pixels of its own buffer,
y down, without jitter, not dilated (docs/conventions.md). Floating-point types are kept as they come.
"""

from dataclasses import dataclass
from typing import Any, Literal

from array_api_compat import array_namespace, device

from .channels import INSIDE_PREVIOUS_FRAME, SEEN_BY_PREVIOUS_CAMERA
from .errors import InputError

Array = Any
Pair = tuple[float, float]
NO_JITTER: Pair = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class MotionConvention:
    """What two stored numbers of motion mean.

    unit: `pixels` of the buffer that holds the motion; `fraction` of the frame (full extent 1); `ndc`, full extent 2, which
    is also torch's grid with align_corners=False; `grid_corners`, torch's grid with align_corners=True, in which the centres
    of the first and last pixel are 2 apart. jittered: a place in the jittered buffer, which shows the place p of the frame
    at p + J, so that the jitter's change is part of the motion.
    """

    direction: Literal["previous_minus_current", "current_minus_previous"]
    unit: Literal["pixels", "fraction", "ndc", "grid_corners"]
    y: Literal["down", "up"]
    jittered: bool = False


# How public code and data of the papers store motion. DFASR's pixels are those of the HR frame: give it the HR motion.
OURS = MotionConvention(direction="previous_minus_current", unit="pixels", y="down")
NSRD = MotionConvention(direction="current_minus_previous", unit="fraction", y="down")
DFASR = MotionConvention(direction="current_minus_previous", unit="pixels", y="up")
FUSESR = MotionConvention(direction="previous_minus_current", unit="ndc", y="down")
RDG = MotionConvention(direction="previous_minus_current", unit="pixels", y="up")
QRISP = MotionConvention(direction="current_minus_previous", unit="fraction", y="up")
QRISP_JITTERED = MotionConvention(direction="current_minus_previous", unit="fraction", y="up", jittered=True)
ARM_NSS = MotionConvention(direction="current_minus_previous", unit="fraction", y="down")
GRID_SAMPLE = MotionConvention(direction="previous_minus_current", unit="ndc", y="down")
GRID_SAMPLE_CORNERS = MotionConvention(direction="previous_minus_current", unit="grid_corners", y="down")


def to_convention(
    motion: Array, convention: MotionConvention, jitter: Pair = NO_JITTER, previous_jitter: Pair = NO_JITTER
) -> Array:
    """Our motion [..., height, width, 2] as `convention` stores it.

    The jitters J and J of the previous frame, in pixels of this buffer, y down, matter where the convention is jittered.
    Raises InputError for `grid_corners` and an extent of one pixel, where that unit does not exist.
    """
    if convention.jittered:
        motion = with_jitter(motion, jitter, previous_jitter)
    return motion / _pixels_per_unit(motion, convention)


def from_convention(
    motion: Array, convention: MotionConvention, jitter: Pair = NO_JITTER, previous_jitter: Pair = NO_JITTER
) -> Array:
    """Our motion of what `convention` stores: the inverse of `to_convention` to two roundings of the value, and with jitter
    two more of the largest term. The jitters are given as ours, whatever the convention. Raises as `to_convention`."""
    motion = motion * _pixels_per_unit(motion, convention)
    return without_jitter(motion, jitter, previous_jitter) if convention.jittered else motion


def with_jitter(motion: Array, jitter: Pair, previous_jitter: Pair) -> Array:
    """From a place in the jittered buffer to the place in the previous jittered buffer: motion + J(t-1) - J(t), since a
    buffer shows the place p of the frame at p + J. [..., 2] pixels, previous - current, y down."""
    return motion + _pair(motion, previous_jitter[0] - jitter[0], previous_jitter[1] - jitter[1])


def without_jitter(motion: Array, jitter: Pair, previous_jitter: Pair) -> Array:
    """Jitter compensation, the inverse of `with_jitter`: motion - J(t-1) + J(t).

    QRISP 2023, equation 1, adds J(t-1) and subtracts J(t) instead, because its motion is current - previous.
    """
    return motion - _pair(motion, previous_jitter[0] - jitter[0], previous_jitter[1] - jitter[1])


def rescaled(motion: Array, size: tuple[int, int]) -> Array:
    """Motion [..., height, width, 2] in pixels of a buffer of `size` (width, height) that spans the same frustum."""
    return motion * _pair(motion, size[0] / motion.shape[-2], size[1] / motion.shape[-3])


def sampling_grid(motion: Array, *, align_corners: bool, jitter: Pair = NO_JITTER, previous_jitter: Pair = NO_JITTER) -> Array:
    """Where torch's `grid_sample` must look in the previous buffer, of the same size: [height, width, 2], x then y.

    motion: ours [height, width, 2]. jitter: of the buffer that holds the motion, whose pixels show centre - J.
    previous_jitter: of the buffer that is sampled; both in pixels, y down, and 0 for the truth, for streams without jitter
    and for an accumulated history. The place is centre - J(t) + motion + J(t-1). With align_corners=False -1 and 1 are the
    outer edges of the first and last pixel, with True their centres. Raises InputError for True and an extent of one pixel.
    """
    xp, (height, width, _) = array_namespace(motion), motion.shape
    x = xp.arange(width, dtype=motion.dtype, device=device(motion))[None, :] + 0.5
    y = xp.arange(height, dtype=motion.dtype, device=device(motion))[:, None] + 0.5
    centres = xp.stack(xp.broadcast_arrays(x, y), axis=-1)
    place = centres + with_jitter(motion, jitter, previous_jitter)
    convention = GRID_SAMPLE_CORNERS if align_corners else GRID_SAMPLE
    return (place - _pair(motion, width / 2, height / 2)) / _pixels_per_unit(motion, convention)


def dilated(values: Array, depth: Array, radius: int = 1) -> Array:
    """Depth-informed dilation: each pixel takes the values of the nearest surface in its window of 2 radius + 1 pixels.

    values: [height, width, components], motion or any other channel. depth: [height, width, 1], +inf for the background.
    The window is cut at the image's edge; among equals the pixel itself wins, then the first in reading order. 3x3 as in
    Karis 2014 and in FSR 2, which take motion and depth from there: dilate both.
    """
    xp, (height, width, _) = array_namespace(values, depth), depth.shape
    rows, columns = (xp.arange(extent, device=device(depth)) for extent in (height, width))
    offsets = range(-radius, radius + 1)
    best, nearest = values, depth
    for down in offsets:
        row = xp.clip(rows + down, 0, height - 1)
        for right in offsets:
            column = xp.clip(columns + right, 0, width - 1)
            there = _picked(depth, row, column)
            closer = there < nearest
            best = xp.where(closer, _picked(values, row, column), best)
            nearest = xp.where(closer, there, nearest)
    return best


def block_dilated(motion: Array, depth: Array, size: tuple[int, int], block: int = 8, jitter: Pair = NO_JITTER) -> Array:
    """QRISP 2023, section 4.1: motion for the HR frame in blocks, each with the motion of its frontmost pixel.

    motion [height, width, 2] and depth [height, width, 1] are LR (or HR). Returns [H, W, 2] for `size` (W, H): previous -
    current in HR pixels, y down, one value per `block` x `block` HR pixels (fewer at the right and bottom edge). An HR pixel
    p belongs to the LR pixel that holds p + J, so that at 3x a block takes in every LR pixel that it touches; `jitter` is in
    LR pixels. Blocks of background alone take their first pixel. QRISP's own sign is `to_convention(..., QRISP)`.
    """
    xp, (height, width, _) = array_namespace(motion, depth), depth.shape
    rows, down = _blocks(depth, size[1], height, jitter[1], block)
    columns, across = _blocks(depth, size[0], width, jitter[0], block)
    place = rows[:, None] * width + columns[None, :]
    z = _flat(depth)
    z = xp.reshape(xp.take(z[:, 0], xp.reshape(place, (-1,))), (down, block, across, block))
    place = xp.reshape(place, (down, block, across, block))
    z, place = (xp.reshape(xp.permute_dims(a, (0, 2, 1, 3)), (down * across, block * block)) for a in (z, place))
    first = xp.argmin(z, axis=1) + xp.arange(down * across, device=device(depth)) * block * block
    front = xp.reshape(xp.take(xp.reshape(place, (-1,)), first), (down, across))
    over_rows, over_columns = (xp.arange(extent, device=device(depth)) // block for extent in (size[1], size[0]))
    front = xp.take(xp.take(front, over_rows, axis=0), over_columns, axis=1)
    moved = xp.take(_flat(rescaled(motion, size)), xp.reshape(front, (-1,)), axis=0)
    return xp.reshape(moved, (size[1], size[0], motion.shape[-1]))


def off_screen(visibility: Array) -> Array:
    """Bool, the shape of `visibility`: the surface point's place was outside the previous frame, or behind its camera.
    True everywhere on a reset."""
    return (_bits(visibility) & INSIDE_PREVIOUS_FRAME) == 0


def disoccluded(visibility: Array) -> Array:
    """Bool: the place was inside the previous frame, but another surface hid it. Exact, by ray; False on a reset."""
    return ~off_screen(visibility) & ((_bits(visibility) & SEEN_BY_PREVIOUS_CAMERA) == 0)


def without_history(visibility: Array) -> Array:
    """Bool: off-screen or disoccluded. What the previous frame holds at x + motion is not this surface."""
    return (_bits(visibility) & SEEN_BY_PREVIOUS_CAMERA) == 0


def newly_appeared(object_id: Array, previous_object_id: Array) -> Array:
    """Bool, the shape of `object_id`: an object of which the previous frame shows no pixel. The background is never new."""
    xp = array_namespace(object_id, previous_object_id)
    ids = _bits(object_id)
    known = xp.unique_values(_bits(previous_object_id))
    place = xp.searchsorted(known, xp.reshape(ids, (-1,)))
    found = xp.take(known, xp.clip(place, 0, known.shape[0] - 1))
    return (xp.reshape(found, ids.shape) != ids) & (ids != 0)


def occluded_by_dual_motion(motion: Array, dual_motion: Array, threshold: float = 0.1) -> Array:
    """Bool [..., height, width, 1]: motion and dual motion differ by at least `threshold` pixels in x or y. NSRD 2024,
    supplement, section 2, subtracts the two; the threshold of 0.1 LR pixel is that of its code."""
    xp = array_namespace(motion, dual_motion)
    return xp.any(xp.abs(dual_motion - motion) >= threshold, axis=-1, keepdims=True)


def _pixels_per_unit(motion: Array, convention: MotionConvention) -> Array:
    """[2], with the signs that turn our direction and y axis into the convention's."""
    height, width = motion.shape[-3], motion.shape[-2]
    if convention.unit == "grid_corners" and min(height, width) < 2:
        raise InputError(f"align_corners=True has no unit for a buffer of {width}x{height}: give two pixels per axis or False")
    x, y = {
        "pixels": (1, 1),
        "fraction": (width, height),
        "ndc": (width / 2, height / 2),
        "grid_corners": ((width - 1) / 2, (height - 1) / 2),
    }[convention.unit]
    forward = -1 if convention.direction == "current_minus_previous" else 1
    return _pair(motion, forward * x, forward * (y if convention.y == "down" else -y))


def _pair(like: Array, x: float, y: float) -> Array:
    return array_namespace(like).asarray([x, y], dtype=like.dtype, device=device(like))


def _picked(array: Array, rows: Array, columns: Array) -> Array:
    xp = array_namespace(array)
    return xp.take(xp.take(array, rows, axis=0), columns, axis=1)


def _flat(array: Array) -> Array:
    return array_namespace(array).reshape(array, (-1, array.shape[-1]))


def _bits(array: Array) -> Array:
    """As int64: torch has few operations on unsigned integers."""
    xp = array_namespace(array)
    return xp.astype(array, xp.int64)


def _blocks(like: Array, extent: int, own: int, jitter: float, block: int) -> tuple[Array, int]:
    """(per HR pixel of one axis, filled up to whole blocks by its last pixel: the index of its LR pixel; blocks)."""
    xp, count = array_namespace(like), -(-extent // block)
    pixel = xp.clip(xp.arange(count * block, device=device(like)), 0, extent - 1)
    place = (xp.astype(pixel, xp.float64) + 0.5) * (own / extent) + jitter
    return xp.clip(xp.astype(xp.floor(place), xp.int64), 0, own - 1), count
