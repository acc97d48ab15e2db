"""Mip pyramids and look-ups of non-square, non-power-of-two textures."""

import numpy as np
import pytest

from framepairs.backend import dr, mi
from framepairs.scene.description import Texture
from framepairs.textures import build_textures, mip_pyramid, sample_level, sample_texture

RNG = np.random.default_rng(3)
HALF_STEP = 2.0**-11  # relative rounding of texels stored as half
NO_SLOPE = (mi.Vector2f(0), mi.Vector2f(0))


def texture(height: int, width: int, wrap=("repeat", "repeat")) -> Texture:
    texels = RNG.integers(0, 256, (height, width, 4), dtype=np.uint8)
    return Texture(name="t", texels=texels, srgb=False, wrap=wrap)


def look_up(image: Texture, u, v, level: float = 0.0) -> np.ndarray:
    table = build_textures((image,))
    return np.array(sample_level(table, mi.UInt32(0), mi.Point2f(u, v), mi.Float(level), mi.Bool(True))).T


@pytest.mark.parametrize(("height", "width"), [(5, 7), (8, 3), (1, 6), (16, 16), (13, 1)])
def test_every_level_keeps_the_mean(height, width):
    pyramid = mip_pyramid(texture(height, width))
    for level in pyramid:
        assert np.abs(level.mean((0, 1)) - pyramid[0].mean((0, 1))).max() < 16 * 2.0**-24
    assert pyramid[-1].shape == (1, 1, 4)
    assert len(pyramid) == int(np.floor(np.log2(max(height, width)))) + 1


def test_texel_centres_give_texels_and_row_0_is_at_the_top():
    image = texture(5, 7)
    j, i = np.indices((5, 7))
    got = look_up(image, ((i + 0.5) / 7).ravel(), (1 - (j + 0.5) / 5).ravel()).reshape(5, 7, 4)
    # a place of float32 lies up to 7 * 2^-23 texels beside the centre; texels are halves
    assert np.abs(got - image.texels / 255).max() < HALF_STEP + 7 * 2.0**-22


def reference(image: Texture, u: float, v: float) -> np.ndarray:
    """Bilinear by hand, with explicit wrapping of integer indices."""
    texels = image.texels / 255
    height, width = texels.shape[:2]

    def index(k, n, mode):
        if mode == "repeat":
            return k % n
        if mode == "clamp":
            return min(max(k, 0), n - 1)
        k = k % (2 * n)
        return k if k < n else 2 * n - 1 - k

    x, y = u * width - 0.5, (1 - v) * height - 0.5
    i, j = int(np.floor(x)), int(np.floor(y))
    total = np.zeros(4)
    for dj, wy in ((0, 1 - (y - j)), (1, y - j)):
        for di, wx in ((0, 1 - (x - i)), (1, x - i)):
            total += wx * wy * texels[index(j + dj, height, image.wrap[1]), index(i + di, width, image.wrap[0])]
    return total


@pytest.mark.parametrize("wrap", [("repeat", "repeat"), ("clamp", "mirror"), ("mirror", "clamp"), ("repeat", "clamp")])
def test_wrap_modes_agree_with_indices_by_hand(wrap):
    image = texture(5, 7, wrap)
    places = RNG.uniform(-2.5, 2.5, (60, 2))
    got = look_up(image, *places.T)
    expected = np.array([reference(image, float(np.float32(u)), float(np.float32(v))) for u, v in places])
    assert np.abs(got - expected).max() < HALF_STEP + 7 * 2.5 * 2.0**-22


def test_srgb_is_decoded_before_filtering():
    texels = np.zeros((1, 2, 4), np.uint8)
    texels[0, 1] = 255
    image = Texture(name="t", texels=texels, srgb=True)
    assert np.abs(look_up(image, 0.5, 0.5)[0] - 0.5).max() < HALF_STEP  # the mean of black and white is 0.5 linear


def test_level_comes_from_the_larger_derivative_and_the_bias_moves_it():
    image = texture(64, 128)
    table = build_textures((image,))
    pyramid = mip_pyramid(image)
    uv = mi.Point2f(0.5 / 16, 1 - 0.5 / 8)  # the centre of texel (0, 0) of level 3
    for bias in (0, -1, 1):
        slope = mi.Vector2f(2.0 ** (3 - bias) / 128, 0), mi.Vector2f(0, 0.1 / 64)
        got = np.array(sample_texture(table, mi.UInt32(0), uv, *slope, mi.Float(bias), mi.Bool(True))).ravel()
        assert np.abs(got - pyramid[3][0, 0]).max() < HALF_STEP + 1e-4  # log2 in float32 shifts the level by some 1e-6


def test_degenerate_derivatives_are_clamped_never_nan():
    table = build_textures((texture(5, 7),))
    for bad in (np.nan, np.inf, 0.0, 1e-30, 1e30):
        value = sample_texture(
            table, mi.UInt32(0), mi.Point2f(0.3, 0.3), mi.Vector2f(bad), mi.Vector2f(0), mi.Float(0), mi.Bool(True)
        )
        assert np.isfinite(np.array(value)).all()


def test_textures_of_one_table_do_not_mix():
    images = tuple(texture(*size) for size in ((3, 5), (4, 4), (7, 2)))
    table = build_textures(images)
    index = mi.UInt32([0, 1, 2])
    got = np.array(sample_level(table, index, mi.Point2f(0.5, 0.5), mi.Float(9), mi.Bool(True))).T
    means = np.array([image.texels.mean((0, 1)) / 255 for image in images])
    assert np.abs(got - means).max() < HALF_STEP


def test_an_inactive_look_up_touches_nothing():
    table = build_textures((texture(3, 5),))
    wild = mi.UInt32(dr.opaque(mi.UInt32, 4_000_000_000))
    value = sample_texture(table, wild, mi.Point2f(0.5), *NO_SLOPE, mi.Float(0), mi.Bool(False))
    assert np.isfinite(np.array(value)).all()
