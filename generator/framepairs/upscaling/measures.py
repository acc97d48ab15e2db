"""How an upscaled sequence compares with the truth and with itself over time, on the display transform `aces_srgb`.

Pictures are display codes in [0, 1], [height, width, 3]; warp error and deviation are given in codes of 255.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..backend import dr, jit
from ..channels import seen_before
from ..corpus import Corpus
from ..warp import Image, backward_warp, to_image

CODES = 255


def change_error(image: NDArray, previous: NDArray, truth: NDArray, previous_truth: NDArray) -> float:
    """Mean squared difference between the change since the previous frame and the truth's change: what flickers or lags."""
    return float(np.mean(np.square((image - previous).astype(np.float64) - (truth - previous_truth))))


def warp_error(image: NDArray, previous: NDArray, motion: Image, visibility: Image) -> float | None:
    """Root mean square difference, in codes of 255, between a frame and the previous one, warped onto it by exact HR motion,
    over pixels that the previous frame shows; None where there are none (Lai et al. 2018, equation 8, with an exact mask). The
    truth has one, too: its light changes, and warping interpolates."""
    seen = seen_before(visibility.planes[0])
    warped = backward_warp(to_image(previous), motion, "catmull_rom")
    squared = sum(dr.square(a - b) for a, b in zip(to_image(image).planes, warped, strict=True)) / 3
    sums, count = dr.sum(dr.select(seen, squared, 0)), dr.sum(dr.select(seen, jit.Float(1), 0))
    return CODES * float(np.sqrt(sums[0] / count[0])) if count[0] else None


class Deviation:
    """Standard deviation over time per pixel and component, running (Welford 1962)."""

    def __init__(self):
        self.count, self.mean, self.squares = 0, 0.0, 0.0

    def add(self, image: NDArray) -> None:
        self.count += 1
        off = image.astype(np.float64) - self.mean
        self.mean = self.mean + off / self.count
        self.squares = self.squares + off * (image - self.mean)

    def result(self) -> float | None:
        """Mean over the image, in codes of 255; None for less than two frames."""
        return CODES * float(np.mean(np.sqrt(self.squares / self.count))) if self.count > 1 else None


def still_shots(corpus: Corpus, sequence: str) -> list[list[int]]:
    """Runs of frames between which nothing moves: HR motion is 0 in all but the first of each. None without motion."""
    entry = corpus.sequence(sequence)
    if "motion" not in entry.channels and "motion" not in entry.constants:
        return []
    runs: list[list[int]] = []
    for frame in corpus.frames(sequence):
        record = corpus.record(sequence, frame)
        follows = bool(runs) and runs[-1][-1] == frame - 1 and not record.reset
        if follows and not corpus.read(sequence, "hr", "motion", frame).any():
            runs[-1].append(frame)
        else:
            runs.append([frame])
    return [run for run in runs if len(run) > 1]


def settled_frames(shots: Sequence[Sequence[int]]) -> list[list[int]]:
    """The later half of each still shot: what changes there is flicker, not convergence. Shots of less than four frames have
    none."""
    return [list(run[len(run) // 2 :]) for run in shots if len(run) >= 4]
