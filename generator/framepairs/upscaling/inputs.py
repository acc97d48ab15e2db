"""What an upscaler is handed for one frame, read from a corpus.

Values that are not finite, which other engines' corpora hold, are replaced here: colours that are NaN count as black, those
beyond 1e18 as 1e18, depth as the background's, motion as none.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..corpus import Corpus
from ..errors import InputError
from ..manifest import FrameRecord
from ..warp import Image, to_image

BRIGHTEST = 1e18  # its square is a float
FAR, NEAR = 1e30, 1e-30  # depth of the background; least depth
FASTEST = 1e6  # pixels

LAYERS = ("transparency", "overlay")


@dataclass(frozen=True, kw_only=True)
class UpscaleFrame:
    """One frame: `lr` and `hr` map channels to images. size: (width, height) of the result. jitter: J, LR pixels, y down.
    exposure: 2^exposure_ev. previous_depth: `previous_depth_coefficients` of its camera."""

    lr: dict[str, Image]
    hr: dict[str, Image]
    size: tuple[int, int]
    jitter: tuple[float, float]
    exposure: float
    previous_depth: tuple[float, ...]


class FrameReader:
    """Channels of one frame as images, each read and brought to the device once, however many methods ask for it."""

    def __init__(self, corpus: Corpus, sequence: str, frame: int):
        self.corpus, self.sequence, self.frame = corpus, sequence, frame
        self.record = corpus.record(sequence, frame)
        self._images: dict[tuple[str, str], Image] = {}

    def image(self, stream: str, channel: str) -> Image:
        """Raises InputError, as `Corpus.read`, for a channel that was not rendered."""
        if (stream, channel) not in self._images:
            array = self.corpus.read(self.sequence, stream, channel, self.frame)
            self._images[stream, channel] = to_image(finite(channel, array))
        return self._images[stream, channel]

    def upscale_frame(self, stream: str, lr: tuple[str, ...], hr: tuple[str, ...]) -> UpscaleFrame:
        """The named channels of an LR stream and of `hr`. Raises InputError where the frame lacks the stream."""
        missing = [name for name in (stream, "hr") if name not in self.record.streams]
        if missing:
            raise InputError(f"no stream {missing[0]!r} in this frame", file=self.corpus.folder, frame=self.frame)
        return UpscaleFrame(
            lr={name: self.image(stream, name) for name in lr},
            hr={name: self.image("hr", name) for name in hr},
            size=tuple(self.record.streams["hr"].size),
            jitter=tuple(self.record.streams[stream].jitter),
            exposure=2.0**self.record.exposure_ev,
            previous_depth=previous_depth_coefficients(self.record),
        )


def layers_drawn(corpus: Corpus, sequence: str) -> tuple[str, ...]:
    """Which of LAYERS any frame may hold: those whose files exist or whose constant is not 0."""
    entry = corpus.sequence(sequence)
    constant = {name: value.surface or value.everywhere or [0.0] for name, value in entry.constants.items()}
    return tuple(name for name in LAYERS if name in entry.channels or any(constant.get(name, ())))


def finite(channel: str, array: NDArray) -> NDArray:
    """The array with what is not finite, or absurd, replaced."""
    if array.dtype == np.uint32:
        return array
    if channel == "depth":
        return np.clip(np.nan_to_num(array, nan=FAR, posinf=FAR, neginf=NEAR), NEAR, FAR)
    most = FASTEST if channel == "motion" else BRIGHTEST
    return np.clip(np.nan_to_num(array, nan=0.0, posinf=most, neginf=-most), -most, most)


def previous_depth_coefficients(record: FrameRecord) -> tuple[float, ...]:
    """(a, b, c, d, e, f): what stands still at fraction (X, Y) of the frame, y down, and depth z had the depth
    z (a X + b Y + c) + d X + e Y + f in the previous frame. Perspective cameras have d = e = 0, orthographic ones a = b = 0."""
    camera = record.camera
    clip, view, previous = (
        np.array(matrix, dtype=np.float64)
        for matrix in (camera.clip_from_view, camera.view_from_world, camera.previous_view_from_world)
    )
    x, y, z, one = -(previous @ np.linalg.inv(view))[2]
    # view x is ((2 X - 1) w - offset) / scale with w = z for perspective and 1 for orthographic cameras; y likewise, turned.
    perspective = clip[3, 3] == 0
    offset_x, offset_y = (-clip[0, 2], -clip[1, 2]) if perspective else (clip[0, 3], clip[1, 3])
    across, down = 2 * x / clip[0, 0], -2 * y / clip[1, 1]
    at_origin = x * (-1 - offset_x) / clip[0, 0] + y * (1 - offset_y) / clip[1, 1]
    if perspective:
        return across, down, at_origin - z, 0.0, 0.0, one
    return 0.0, 0.0, -z, across, down, at_origin + one
