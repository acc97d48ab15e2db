"""Looking up and carrying images, against plain loops."""

import numpy as np
import pytest

from framepairs.backend import jit
from framepairs.warp import bilinear, catmull_rom, fetch, nearest, pixel_centres, to_array, to_image

RNG = np.random.default_rng(11)
IMAGE = RNG.uniform(0, 1, (5, 7, 3)).astype(np.float32)
EPSILON = 2.0**-24


def slow(image, x, y, weights):
    """The same filter, pixel by pixel in float64."""
    height, width, _ = image.shape
    taps = len(weights(0.0))
    left, top = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
    wx, wy = weights(x - 0.5 - left), weights(y - 0.5 - top)
    total = np.zeros(3)
    for row in range(taps):
        for column in range(taps):
            j = min(max(top + row - taps // 2 + 1, 0), height - 1)
            i = min(max(left + column - taps // 2 + 1, 0), width - 1)
            total += wy[row] * wx[column] * image[j, i].astype(float)
    return total


def cubic(t):
    """Keys 1981 with a = -1/2, written by distance."""

    def kernel(d):
        d = abs(d)
        return 1.5 * d**3 - 2.5 * d**2 + 1 if d < 1 else -0.5 * d**3 + 2.5 * d**2 - 4 * d + 2

    return [kernel(t + 1), kernel(t), kernel(1 - t), kernel(2 - t)]


@pytest.mark.parametrize(("fast", "weights"), [(bilinear, lambda t: [1 - t, t]), (catmull_rom, cubic)])
def test_filters_equal_their_plain_loops(fast, weights):
    x, y = RNG.uniform(-2, 9, 80).astype(np.float32), RNG.uniform(-2, 7, 80).astype(np.float32)
    got = np.stack([np.array(p) for p in fast(to_image(IMAGE), jit.Float(x), jit.Float(y))], axis=-1)
    expected = np.array([slow(IMAGE, float(a), float(b), weights) for a, b in zip(x, y, strict=True)])
    # the fraction of a float32 place up to 9 is good to 2^-21; slopes are below 2 a pixel
    assert np.abs(got - expected).max() < 2 * 2 * 2.0**-21 + 32 * EPSILON


@pytest.mark.parametrize("fast", [nearest, bilinear, catmull_rom])
def test_pixel_centres_give_the_image_back_exactly(fast):
    planes = fast(to_image(IMAGE), *pixel_centres(7, 5))
    assert np.array_equal(to_array(planes, 7, 5), IMAGE)


def test_fetch_clamps_and_keeps_integers():
    ids = to_image(np.arange(35, dtype=np.uint32).reshape(5, 7, 1) + 4_000_000_000)
    got = np.array(fetch(ids, jit.Int32([-3, 99, 2]), jit.Int32([-1, 99, 3]))[0])
    assert got.tolist() == [4_000_000_000, 4_000_000_034, 4_000_000_023]
