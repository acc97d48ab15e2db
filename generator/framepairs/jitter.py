"""Where samples lie: the Halton jitter of LR streams and the anti-aliasing positions of the HR truth.

Plain Python floats: these are a few numbers per frame, exact in float64, and opaque to the kernels that use them.
"""

from functools import lru_cache

from .conventions import AntialiasingPattern

# Direct3D 11's standard positions for 8 samples, sixteenths of a pixel from its centre.
MSAA_8 = ((1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7))
ENHANCED_SAMPLES = 4 * len(MSAA_8)


def radical_inverse(index: int, base: int) -> float:
    """The van der Corput value of `index` >= 0: its digits in `base`, mirrored at the radix point, in [0, 1).

    Exact integer arithmetic with one division, so that indices up to 2^31 lose nothing before float64 rounding.
    """
    numerator, denominator = 0, 1
    while index:
        index, digit = divmod(index, base)
        numerator, denominator = numerator * base + digit, denominator * base
    return numerator / denominator


def default_length(scale: float) -> int:
    """int(8 S^2), the sequence length of FSR 2."""
    return int(8 * scale * scale)


def jitter(frame: int, length: int) -> tuple[float, float]:
    """J of `frame`: Halton(2, 3) from index 1, minus 0.5, repeating after `length` frames.

    LR pixels, x right, y down, each in [-0.5, 0.5). The pixel then samples the unjittered position centre - J.
    """
    index = frame % length + 1
    return radical_inverse(index, 2) - 0.5, radical_inverse(index, 3) - 0.5


@lru_cache
def antialiasing_positions(samples: int, pattern: AntialiasingPattern = "strata") -> tuple[tuple[float, float], ...]:
    """`samples` positions inside a pixel, in (0, 1)^2, x right, y down.

    strata: the Hammersley set with each coordinate at the middle of its stratum: every column and every row of 1/N holds
    one sample (for N that is no power of two, y takes the rank of its radical inverse), and the mean position is the
    centre, so that the truth is not displaced against the one-sample channels. halton: (2, 3) from index 1, whose mean is
    off the centre by some 1 / (2 N). qrisp_enhanced: the standard 8-sample pattern of Direct3D 11 in each quarter of the
    pixel, whatever `samples` is (QRISP 2023: twice the resolution with 8 samples, halved).
    """
    if pattern == "halton":
        return tuple((radical_inverse(index, 2), radical_inverse(index, 3)) for index in range(1, samples + 1))
    if pattern == "qrisp_enhanced":
        quarters = [(i, j) for j in (0, 1) for i in (0, 1)]
        return tuple(((i + 0.5 + x / 16) / 2, (j + 0.5 + y / 16) / 2) for i, j in quarters for x, y in MSAA_8)
    order = sorted(range(samples), key=lambda index: radical_inverse(index, 2))
    rank = {index: place for place, index in enumerate(order)}
    return tuple(((index + 0.5) / samples, (rank[index] + 0.5) / samples) for index in range(samples))
