"""Mip pyramids in their roles, and look-ups of non-square, non-power-of-two textures."""

from dataclasses import replace

import numpy as np
import pytest

from framepairs.backend import dr, mi
from framepairs.mip_pyramids import NORMAL, Role, mip_pyramid
from framepairs.scene.description import Texture
from framepairs.texels import _half
from framepairs.textures import build_textures, sample_level, sample_normal, sample_texture

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


def reference(image: Texture, u: float, v: float, texels: np.ndarray | None = None) -> np.ndarray:
    """Bilinear by hand, of level 0 or of `texels`, with explicit wrapping of integer indices."""
    texels = image.texels / 255 if texels is None else texels
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
    bad = [np.nan, np.inf, -np.inf, 0.0, 1e-30, 1e30]
    u, x, y = (column.ravel().astype(np.float32) for column in np.meshgrid([0.3, *bad], bad, bad))
    for anisotropy in (1, 16):
        aniso = replace(table, anisotropy=anisotropy)
        slopes = mi.Vector2f(x, 0.1), mi.Vector2f(x, y)
        for sample in (sample_texture, sample_normal):
            value = sample(aniso, mi.UInt32(0), mi.Point2f(u, 0.3), *slopes, mi.Float(-1), mi.Bool(True))
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


@pytest.mark.parametrize("bias", [0.0, -5.0])
def test_taps_lie_along_the_longer_axis_and_the_bias_leaves_them_there(bias):
    """Footprints of 16 x 1 texels around texels 0 to 15 of a row, or of a column: 16 taps on their centres, at level 0
    whatever the bias."""
    image = texture(64, 64)
    table = build_textures((image,), anisotropy=16)
    long, short = 16 / 64, 1 / 64
    for place, dx, dy, texels in (
        ((8 / 64, 1 - 5.5 / 64), (0, short), (long, 0), image.texels[5, :16]),
        ((5.5 / 64, 1 - 8 / 64), (short, 0), (0, long), image.texels[:16, 5]),
    ):
        slopes = mi.Vector2f(*dx), mi.Vector2f(*dy)
        got = sample_texture(table, mi.UInt32(0), mi.Point2f(*place), *slopes, mi.Float(bias), mi.Bool(True))
        # halves, and places that err by some 64 * 2^-23 texels at 16 taps
        assert np.abs(np.array(got).ravel() - texels.mean(0) / 255).max() < HALF_STEP + 64 * 2.0**-22


def anisotropic_reference(image: Texture, uv, dx, dy, bias: float, most: int) -> np.ndarray:
    """The look-up as its documentation tells it, one at a time, with singular values from LAPACK."""
    pyramid = mip_pyramid(image)
    size = np.array(image.texels.shape[1::-1])
    axes, (major, minor), _ = np.linalg.svd(np.stack([dx, dy], axis=1) * size[:, None])
    ratio = major / max(minor, 1)
    taps = int(np.clip(np.ceil(ratio - 1 / 64), 1, most))
    reach = (1 - 1 / np.clip(ratio, 1, most)) / (1 - 1 / taps) if taps > 1 else 0
    level = np.clip(np.log2(max(minor, major / most)) + bias, 0, len(pyramid) - 1)
    below = int(level)
    total = np.zeros(4)
    for k in range(taps):
        u, v = uv + axes[:, 0] * reach * major / size * ((k + 0.5) / taps - 0.5)
        fine, coarse = (reference(image, u, v, pyramid[min(j, len(pyramid) - 1)]) for j in (below, below + 1))
        total += fine + (coarse - fine) * (level - below)
    return total / taps


@pytest.mark.parametrize(("most", "wrap"), [(16, ("repeat", "repeat")), (4, ("mirror", "clamp"))])
def test_anisotropic_look_ups_agree_with_singular_values(most, wrap):
    image = texture(50, 77, wrap)
    table = build_textures((image,), anisotropy=most)
    count = 80
    uv, dx, dy = RNG.uniform(-1, 2, (count, 2)), *RNG.normal(0, 0.05, (2, count, 2))
    dy[::2] = dx[::2] * RNG.uniform(0.1, 2, (count // 2, 1)) + RNG.normal(0, 0.002, (count // 2, 2))  # long ellipses
    place, *slopes = (columns.T.astype(np.float32) for columns in (uv, dx, dy))
    footprint = mi.Point2f(place), mi.Vector2f(slopes[0]), mi.Vector2f(slopes[1])
    got = np.array(sample_texture(table, mi.UInt32(0), *footprint, mi.Float(-0.7), mi.Bool(True))).T
    expected = np.array([anisotropic_reference(image, *row, -0.7, most) for row in zip(uv, dx, dy, strict=True)])
    # Halves, and float32: the shorter axis comes from a determinant, whose rounding, 2^-23 times up to 4 major^2 / minor,
    # shifts the level by 2^-21 ratio^2; neighbouring levels differ by less than 1. Ratios reach 60 here.
    assert np.abs(got - expected).max() < HALF_STEP + 60**2 * 2.0**-21


def test_anisotropy_1_takes_the_longer_derivative():
    image = texture(64, 64)
    table = build_textures((image,))
    slope = mi.Vector2f(6 / 64, 0), mi.Vector2f(8 / 64, 0)  # an ellipse 10 texels long
    got = sample_texture(table, mi.UInt32(0), mi.Point2f(0.3, 0.6), *slope, mi.Float(0), mi.Bool(True))
    assert np.abs(np.array(got).ravel() - look_up(image, 0.3, 0.6, 3.0)[0]).max() < 1e-5


def encoded(vectors: np.ndarray) -> Texture:
    """A float normal map of these vectors [h, w, 3]."""
    texels = np.concatenate([vectors, np.ones_like(vectors[..., :1])], axis=-1).astype(np.float32)
    return Texture(name="n", texels=texels / 2 + np.float32(0.5), srgb=False, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))


def test_a_constant_normal_map_loses_nothing():
    for level in mip_pyramid(encoded(np.broadcast_to((0.3, -0.2, 0.7), (13, 21, 3))), NORMAL):
        assert (level[..., 3] == 0).all()
        assert np.abs(level[..., :3] - np.array((0.3, -0.2, 0.7)) / np.sqrt(0.62)).max() < 8 * 2.0**-24


def test_two_normals_give_the_variance_of_their_mean():
    """Columns tilted by +-a: the mean is (0, 0, cos a), so the variance is (1 - cos a) / cos a, and level 0 keeps none."""
    a = 0.6
    vectors = np.zeros((4, 6, 3))
    vectors[..., 0], vectors[..., 2] = np.sin(a) * np.where(np.arange(6) % 2, 1, -1), np.cos(a)
    pyramid = mip_pyramid(encoded(3 * vectors), NORMAL)  # of any length
    assert (pyramid[0][..., 3] == 0).all()
    assert np.abs(np.linalg.norm(pyramid[0][..., :3], axis=-1) - 1).max() < 4 * 2.0**-24
    for level in pyramid[1:]:
        assert np.abs(level[..., :3] - (0, 0, 1)).max() < 16 * 2.0**-24
        assert np.abs(level[..., 3] - (1 - np.cos(a)) / np.cos(a)).max() < 16 * 2.0**-24


def test_taps_that_disagree_have_variance_too():
    """The same map at level 0 under 16 taps along the row: texels lost nothing, but their directions differ."""
    a = 0.6
    vectors = np.zeros((8, 32, 3))
    vectors[..., 0], vectors[..., 2] = np.sin(a) * np.where(np.arange(32) % 2, 1, -1), np.cos(a)
    table = build_textures((encoded(vectors),), (NORMAL,), 16)
    for slope, variance in ((16 / 32, (1 - np.cos(a)) / np.cos(a)), (1 / 32, 0)):
        slopes = mi.Vector2f(slope, 0), mi.Vector2f(0, 1 / 8)
        centre = mi.Point2f(0.5 + (slope < 0.1) * 0.5 / 32, 0.5 / 8)
        got = np.array(sample_normal(table, mi.UInt32(0), centre, *slopes, mi.Float(0), mi.Bool(True))).ravel()
        assert abs(got[3] - variance) < HALF_STEP


def test_directions_that_cancel_give_a_direction():
    vectors = np.zeros((2, 2, 3))
    vectors[:, 0, 0], vectors[:, 1, 0] = 1, -1
    table = build_textures((encoded(vectors),), (NORMAL,))
    for level in (0.0, 1.0):
        slopes = mi.Vector2f(0.5, 0), mi.Vector2f(0, 0.5)
        got = sample_normal(table, mi.UInt32(0), mi.Point2f(0.5, 0.5), *slopes, mi.Float(level), mi.Bool(True))
        x, y, z, variance = np.array(got).ravel()
        assert (x, y, z) == (0, 0, 1) and 1e4 <= variance < np.inf


def leaf(size: int) -> np.ndarray:
    """Opacity [size, size] of a leaf on a thin stalk, its edge soft over some texels, off centre; covers a quarter."""
    y, x = (np.indices((size, size)) + 0.5) / size
    ripple = 0.03 * np.sin(31 * x + 7 * y)
    body = 0.16 - np.abs(y - 0.43) - 0.35 * (x - 0.52) ** 2 + ripple
    stalk = 0.012 - np.abs(y - 0.45 + 0.1 * x)
    return np.clip(0.5 + np.maximum(body, stalk) * size / 6, 0, 1)


def fence(size: int) -> np.ndarray:
    """Hard opacity of pickets, 2 texels of 16, and a rail: it vanishes where levels only keep the share of texels."""
    alpha = np.zeros((size, size))
    alpha[:, np.arange(size) % 16 < 2] = 1
    alpha[size // 4 : size // 4 + size // 8] = 1
    return alpha


@pytest.mark.parametrize(
    "alpha, threshold, most",
    # a level of n texels is parted to one place of 16 n, but for the fence's equal values; the estimates themselves vary by
    # 4 sqrt(p (1 - p) / 40000) = 0.01
    [(leaf(150), 0.2, 0.015), (leaf(150), 0.5, 0.015), (leaf(150), 0.83, 0.015), (fence(128), 0.5, 0.05)],
)
def test_masks_keep_their_coverage_at_every_level(alpha, threshold, most):
    """As drawn: bilinear look-ups of the stored halves at random places."""
    texels = np.ones((*alpha.shape, 4), np.float32)
    texels[..., 3] = alpha
    image = Texture(name="mask", texels=texels, srgb=False)
    places = np.random.default_rng(1).random((2, 40_000)).astype(np.float32)

    def share(table, level: float) -> float:
        found = sample_level(table, mi.UInt32(0), mi.Point2f(places), mi.Float(level), mi.Bool(True))
        return float((np.array(found.w) >= np.float32(threshold)).mean())

    kept, plain = build_textures((image,), (Role("mask", threshold),)), build_textures((image,))
    levels = len(mip_pyramid(image))
    first = share(kept, 0)
    assert 0.1 < first < 0.5
    off, without = ([abs(share(table, level) - first) for level in range(levels - 3)] for table in (kept, plain))
    assert max(off) < most, off
    if threshold != 0.5 or most > 0.015:
        assert max(without) > 2 * max(off)


def test_masks_without_holes_or_without_anything_keep_their_levels():
    """But for a step of rounding at the threshold."""
    image = texture(5, 7)
    for threshold in (0.0, -1.0, 1.5, 1e6):
        for mask, plain in zip(mip_pyramid(image, Role("mask", threshold)), mip_pyramid(image), strict=True):
            assert np.array_equal(mask[..., :3], plain[..., :3])
            assert np.abs(mask[..., 3] - plain[..., 3]).max() <= 2.0**-11


@pytest.mark.parametrize("code", [1, 5, 77, 128, 254])
def test_an_alpha_that_equals_the_threshold_is_drawn(code):
    """Rounded to half, n / 255 may lie below the float32 n / 255 that it is compared with."""
    texels = np.full((8, 8, 4), code, np.uint8)
    for level in mip_pyramid(Texture(name="flat", texels=texels, srgb=False), Role("mask", code / 255)):
        assert (level[..., 3].astype(np.float16).astype(np.float32) >= np.float32(code / 255)).all()


def test_hidden_colour_does_not_bleed_into_masks():
    texels = np.zeros((31, 40, 4), np.float32)
    texels[..., 3] = leaf(40)[:31]
    seen = texels[..., 3] >= 0.5
    texels[seen, :3] = (0.1, 0.7, 0.2)
    texels[~seen, :3] = (1, 0, 1)
    for level in mip_pyramid(Texture(name="leaf", texels=texels, srgb=False), Role("mask", 0.5))[1:]:
        assert np.abs(level[..., :3] - (0.1, 0.7, 0.2)).max() < 16 * 2.0**-24


def test_infinite_and_missing_texels_become_finite_halves():
    texels = np.ones((4, 4, 4), np.float32)
    texels[0, 0], texels[1, 1], texels[2, 2] = np.inf, np.nan, 1e9
    pyramid = mip_pyramid(Texture(name="t", texels=texels, srgb=False))
    assert [pyramid[0][k, k, 0] for k in range(4)] == [65504, 0, 65504, 1]
    for level in pyramid:
        assert np.isfinite(level.astype(np.float16)).all()


def test_halves_are_decoded_exactly():
    bits = np.arange(2**16, dtype=np.uint32)
    values = bits.astype(np.uint16).view(np.float16).astype(np.float32)
    usual = np.isfinite(values) & ((values == 0) | (np.abs(values) >= 2.0**-14))  # others may be flushed to 0
    assert usual.sum() == 2 * (1 + 30 * 1024)
    assert np.array_equal(np.array(_half(mi.UInt32(bits[usual] << 16))), values[usual])
