"""Spectra as linear Rec. 709, as Mitsuba's RGB variants take them: emission as it is, reflectance under D65.

Colour matching functions: the fit of Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching
Functions", JCGT 2(2), 2013, equation 4 and listing 1 (CIE 1931). D65: CIE 015:2018, table A.1, every 10 nm, linear between.
Against Mitsuba 3.9.1, which has the tables, smooth spectra differ by up to 0.01 of their largest component.
"""

import numpy as np
from numpy.typing import NDArray

EQUAL_ENERGY = (1.204794, 0.948291, 0.908916)  # of a spectrum that is 1 at all wavelengths: Mitsuba 3.9.1, llvm_ad_rgb
STEP_NM = 1.0
WAVELENGTHS = np.arange(380.0, 780.0 + STEP_NM, STEP_NM)
# Weight, middle in nm, width below and above it, of each lobe.
X_LOBES = ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2))
Y_LOBES = ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1))
Z_LOBES = ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8))
D65_10_NM = """49.9755 54.6482 82.7549 91.486 93.4318 86.6823 104.865 117.008 117.812 114.861 115.923 108.811 109.354 107.802
    104.79 107.689 104.405 104.046 100 96.3342 95.788 88.6856 90.0062 89.5991 87.6987 83.2886 83.6992 80.0268 80.2146 82.2778
    78.2842 69.7213 71.6091 74.349 61.604 69.8856 75.087 63.5927 46.4182 66.8054 63.3828"""  # 380 to 780 nm
REC709_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)  # IEC 61966-2-1


def emission_of_spectrum(pairs: NDArray[np.float64]) -> tuple[float, float, float]:
    """pairs: [n, 2] wavelength in nm, radiance; 0 outside. Components below 0 (outside the gamut) become 0."""
    return _rec709(_sampled(pairs), np.ones_like(WAVELENGTHS))


def reflectance_of_spectrum(pairs: NDArray[np.float64]) -> tuple[float, float, float]:
    """pairs: [n, 2] wavelength in nm, reflectance; 0 outside. Components are limited to 0 to 1."""
    d65 = np.interp(WAVELENGTHS, np.arange(380.0, 781.0, 10.0), np.array(D65_10_NM.split(), dtype=float))
    white = _rec709(np.ones_like(WAVELENGTHS), d65)
    color = _rec709(_sampled(pairs), d65)
    return tuple(min(part / whole, 1.0) for part, whole in zip(color, white, strict=True))


def _sampled(pairs: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.interp(WAVELENGTHS, pairs[:, 0], pairs[:, 1], left=0.0, right=0.0)


def _rec709(spectrum: NDArray[np.float64], light: NDArray[np.float64]) -> tuple[float, float, float]:
    matching = np.stack([_lobes(lobes) for lobes in (X_LOBES, Y_LOBES, Z_LOBES)])
    xyz = matching @ (spectrum * light) / (matching[1] @ light)
    return tuple(max(float(component), 0.0) for component in REC709_FROM_XYZ @ xyz)


def _lobes(lobes: tuple[tuple[float, float, float, float], ...]) -> NDArray[np.float64]:
    total = np.zeros_like(WAVELENGTHS)
    for weight, middle, below, above in lobes:
        width = np.where(WAVELENGTHS < middle, below, above)
        total += weight * np.exp(-0.5 * ((WAVELENGTHS - middle) / width) ** 2)
    return total
