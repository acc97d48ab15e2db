"""PSNR, SSIM and FLIP on the display transform `aces_srgb`."""

import flip_evaluator
import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from .backend import dr, jit
from .colour import LUMINANCE_709, display_transform


def to_display(color: NDArray, exposure_ev: float) -> NDArray[np.float32]:
    """[height, width, 3] scene-linear to display codes in [0, 1]."""
    height, width, _ = color.shape
    rgb = jit.Array3f(*(np.ascontiguousarray(color[..., k]).ravel() for k in range(3)))
    shown = display_transform(rgb, dr.opaque(jit.Float, exposure_ev))
    return np.ascontiguousarray(np.array(shown).T.reshape(height, width, 3))


def psnr(image: NDArray, truth: NDArray) -> float:
    """10 log10(1 / mean squared error) in dB for images in [0, 1]; infinite for equal ones."""
    return decibels(float(np.mean(np.square(image.astype(np.float64) - truth))))


def decibels(squared_error: float) -> float:
    """-10 log10 of a mean squared error of display codes in [0, 1]; infinite for 0."""
    return float("inf") if squared_error == 0 else -10 * float(np.log10(squared_error))


def ssim(image: NDArray, truth: NDArray) -> float:
    """Wang et al. 2004 on luma (Rec. 709 weights of display codes), Gaussian window of sigma 1.5, as scikit-image has it.

    1 where the images are too small for the window and equal; NaN where too small and different.
    """
    if min(image.shape[:2]) < 11:
        return 1.0 if np.array_equal(image, truth) else float("nan")
    luma, truth_luma = (np.ascontiguousarray(a @ np.float32(LUMINANCE_709)) for a in (image, truth))
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    return float(structural_similarity(luma, truth_luma, data_range=1.0, **options))


def flip(image: NDArray, truth: NDArray) -> float:
    """Mean FLIP error in [0, 1] of display codes (Andersson et al. 2020), at its authors' 67 pixels per degree."""
    _, mean, _ = flip_evaluator.evaluate(truth, image, "LDR", applyMagma=False)
    return float(mean)
