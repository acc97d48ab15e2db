"""Looking up and carrying images, against plain loops."""

import numpy as np
import pytest

from framepairs.backend import jit
from framepairs.warp import (
    FILTERS,
    backward_warp,
    bilinear,
    catmull_rom,
    fetch,
    lanczos2,
    pixel_centres,
    to_array,
    to_image,
)

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


def lanczos(t):
    """sinc(d) sinc(d / 2), divided by the sum over the four taps."""
    taps = np.array([t + 1, t, t - 1, t - 2])
    weights = np.sinc(taps) * np.sinc(taps / 2)
    return list(weights / weights.sum())


@pytest.mark.parametrize(("fast", "weights"), [(bilinear, lambda t: [1 - t, t]), (catmull_rom, cubic), (lanczos2, lanczos)])
def test_filters_equal_their_plain_loops(fast, weights):
    x, y = RNG.uniform(-2, 9, 80).astype(np.float32), RNG.uniform(-2, 7, 80).astype(np.float32)
    got = np.stack([np.array(p) for p in fast(to_image(IMAGE), jit.Float(x), jit.Float(y))], axis=-1)
    expected = np.array([slow(IMAGE, float(a), float(b), weights) for a, b in zip(x, y, strict=True)])
    # the fraction of a float32 place up to 9 is good to 2^-21; slopes are below 2 a pixel
    assert np.abs(got - expected).max() < 2 * 2 * 2.0**-21 + 32 * EPSILON


@pytest.mark.parametrize("fast", FILTERS.values())
def test_pixel_centres_give_the_image_back_exactly(fast):
    planes = fast(to_image(IMAGE), *pixel_centres(7, 5))
    assert np.array_equal(to_array(planes, 7, 5), IMAGE)


def test_fetch_clamps_and_keeps_integers():
    ids = to_image(np.arange(35, dtype=np.uint32).reshape(5, 7, 1) + 4_000_000_000)
    got = np.array(fetch(ids, jit.Int32([-3, 99, 2]), jit.Int32([-1, 99, 3]))[0])
    assert got.tolist() == [4_000_000_000, 4_000_000_034, 4_000_000_023]


def test_lanczos2_by_hand_and_at_the_ends_of_a_pixel():
    """At half a pixel the taps are L(1/2) = 4 sqrt(2) / pi^2 and L(3/2) = -1/9 of it: 9/16 and -1/16 of the sum."""
    step = to_image(np.float32([[0, 0, 0, 1, 1, 1]])[..., None])
    x = np.float32([2.5, 3, 3.5, np.nextafter(np.float32(2.5), np.float32(0)), np.nextafter(np.float32(3.5), np.float32(9)), 2])
    got = np.array(lanczos2(step, jit.Float(x), jit.Float(np.full_like(x, 0.5)))[0])
    # sines to an ulp or two, a handful of products: 16 roundings of values around 1; a 2^-22 px step moves it by no more
    assert np.abs(got - [0, 0.5, 1, 0, 1, -1 / 16]).max() < 16 * EPSILON


@pytest.mark.parametrize("method", FILTERS)
def test_constants_survive_every_filter(method):
    x, y = (jit.Float(RNG.uniform(-2, 9, 400).astype(np.float32)) for _ in range(2))
    got = np.array(FILTERS[method](to_image(np.full((5, 7, 1), 0.75, np.float32)), x, y)[0])
    # sixteen products and sums, absolute weights below 1.7 together
    assert np.abs(got - 0.75).max() < 24 * EPSILON


def places(width, height, jitter=(0.0, 0.0)):
    """An image whose pixels hold the fraction of the frame that they show."""
    j, i = np.indices((height, width))
    return np.stack([(i + 0.5 - jitter[0]) / width, (j + 0.5 - jitter[1]) / height], axis=-1).astype(np.float32)


@pytest.mark.parametrize("method", ["bilinear", "catmull_rom"])
@pytest.mark.parametrize("size", [(40, 30), (80, 90)])
def test_backward_warp_finds_where_each_surface_was(method, size):
    """Both filters keep linear images, so that what is found is the place itself: present place + motion."""
    jitter, before = (0.25, -0.375), (-0.3, 0.45)
    motion = RNG.uniform(-3, 3, (30, 40, 2)).astype(np.float32)
    got = to_array(backward_warp(to_image(places(*size, before)), to_image(motion), method, jitter, before), 40, 30)
    wanted = places(40, 30, jitter) + motion / np.float32([40, 30])
    inner = (slice(6, -6), slice(6, -6))  # further out, places beyond the outermost pixel centres are held at them
    # a place of up to 90 pixels rounded five times, in fractions; the image's own roundings are smaller
    assert np.abs(got - wanted)[inner].max() < 5 * 90 * EPSILON / 30


def test_backward_warp_carries_ids_by_nearest():
    ids = to_image(np.arange(35, dtype=np.uint32).reshape(5, 7, 1) + 4_000_000_000)
    motion = to_image(np.broadcast_to(np.float32([1, -2]), (5, 7, 2)))
    got = to_array(backward_warp(ids, motion, "nearest"), 7, 5)[..., 0]
    rows, columns = np.maximum(np.arange(5) - 2, 0), np.minimum(np.arange(7) + 1, 6)
    assert np.array_equal(got, rows[:, None] * 7 + columns + 4_000_000_000)
