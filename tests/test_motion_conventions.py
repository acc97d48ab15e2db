"""Conversions of motion, dilation and masks of missing history, each against numbers worked by hand."""

import array_api_strict
import numpy as np
import pytest

from framepairs import motion_conventions as conventions
from framepairs.errors import InputError
from framepairs.motion_conventions import (
    MotionConvention,
    block_dilated,
    dilated,
    disoccluded,
    from_convention,
    newly_appeared,
    occluded_by_dual_motion,
    off_screen,
    rescaled,
    sampling_grid,
    to_convention,
    with_jitter,
    without_history,
    without_jitter,
)

RNG = np.random.default_rng(5)
J, J_BEFORE = (0.25, -0.375), (-0.125, 0.5)
NAMED = ("OURS", "NSRD", "DFASR", "FUSESR", "RDG", "QRISP", "QRISP_JITTERED", "ARM_NSS", "GRID_SAMPLE", "GRID_SAMPLE_CORNERS")
EPSILON = 2.0**-24


def uniform(x, y, height=5, width=8) -> np.ndarray:
    return np.broadcast_to(np.float32([x, y]), (height, width, 2)).copy()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        # the surface was 2 px to the left and 1 px further down: previous - current = (-2, +1) in 8 x 5 pixels
        ("OURS", (-2, 1)),
        ("NSRD", (2 / 8, -1 / 5)),
        ("DFASR", (2, 1)),  # it moved right and up, and y points up
        ("FUSESR", (-2 / 4, 1 / 2.5)),
        ("RDG", (-2, -1)),
        ("QRISP", (2 / 8, 1 / 5)),
        # as a move inside the jittered buffers: current - previous + J(t) - J(t-1) = (2 + 3/8, -1 - 7/8), y turned up
        ("QRISP_JITTERED", (2.375 / 8, 1.875 / 5)),
        ("ARM_NSS", (2 / 8, -1 / 5)),
        ("GRID_SAMPLE", (-2 / 4, 1 / 2.5)),
        ("GRID_SAMPLE_CORNERS", (-2 / 3.5, 1 / 2)),
    ],
)
def test_conventions_by_hand(name, expected):
    got = to_convention(uniform(-2, 1), getattr(conventions, name), J, J_BEFORE)
    assert got.dtype == np.float32
    assert np.array_equal(got, uniform(*expected))  # one rounding of a quotient of small exact numbers


@pytest.mark.parametrize("name", NAMED)
def test_conventions_go_back_to_ours(name):
    convention = getattr(conventions, name)
    motion = RNG.uniform(-300, 300, (7, 9, 2)).astype(np.float32)
    back = from_convention(to_convention(motion, convention, J, J_BEFORE), convention, J, J_BEFORE)
    # a quotient and a product, and with jitter a sum and a difference: each rounds its value, at most |motion| + 1
    assert np.all(np.abs(back - motion) <= 4 * EPSILON * (np.abs(motion) + 1))
    if convention.unit == "pixels":
        assert np.array_equal(back, motion)


def test_every_named_convention_is_in_these_tests():
    assert set(NAMED) == {name for name, value in vars(conventions).items() if isinstance(value, MotionConvention)}


def test_qrisp_equation_1():
    """MV + J(t-1) - J(t) on its current - previous motion, here in pixels with y down as our jitter is."""
    stored = MotionConvention(direction="current_minus_previous", unit="pixels", y="down", jittered=True)
    unjittered = MotionConvention(direction="current_minus_previous", unit="pixels", y="down")
    motion = RNG.integers(-9, 9, (4, 6, 2)).astype(np.float32)  # exact with eighths of a pixel of jitter
    compensated = to_convention(motion, stored, J, J_BEFORE) + np.float32(J_BEFORE) - np.float32(J)
    assert np.array_equal(compensated, to_convention(motion, unjittered))


def test_a_still_surface_moves_by_the_jitters_difference_and_not_without():
    still = uniform(0, 0)
    moved = with_jitter(still, J, J_BEFORE)
    # the place p is at p + J now and at p + J(t-1) before
    assert np.array_equal(moved, uniform(J_BEFORE[0] - J[0], J_BEFORE[1] - J[1]))
    assert not without_jitter(moved, J, J_BEFORE).any()


def test_motion_of_one_frame_in_pixels_of_another_buffer():
    assert np.array_equal(rescaled(uniform(1, -2, height=4, width=6), (9, 8)), uniform(1.5, -4, height=4, width=6))


def plain_grid_sample(image, grid, align_corners):
    """Bilinear, border padding, from the definition in torch's documentation, in float64: [height, width, components]."""
    height, width, _ = image.shape
    extent = np.array([width, height])
    index = (grid + 1) / 2 * (extent - 1) if align_corners else ((grid + 1) * extent - 1) / 2
    index = np.clip(index.astype(float), 0, extent - 1)
    low = np.minimum(np.floor(index), extent - 2).astype(int)
    tx, ty = (index - low)[..., :1], (index - low)[..., 1:]
    i, j = low[..., 0], low[..., 1]
    top, bottom = (image[j + d, i] * (1 - tx) + image[j + d, i + 1] * tx for d in (0, 1))
    return top * (1 - ty) + bottom * ty


@pytest.mark.parametrize("align_corners", [False, True])
def test_grid_takes_each_pixel_from_the_right_place(align_corners):
    """An image that holds its own place: bilinear look-ups give back the place that was asked for."""
    j, i = np.indices((5, 8))
    places = np.stack([i + 0.5, j + 0.5], axis=-1)
    motion = RNG.uniform(-1, 1, (5, 8, 2)).astype(np.float32)
    grid = sampling_grid(motion, align_corners=align_corners, jitter=J, previous_jitter=J_BEFORE)
    got = plain_grid_sample(places, grid, align_corners)
    wanted = np.clip(places - J + motion + J_BEFORE, 0.5, [7.5, 4.5])
    # the grid's values are below 2 and rounded four times; half the width is 4 pixels a unit
    assert grid.dtype == np.float32 and np.abs(got - wanted).max() < 4 * 2 * 4 * EPSILON


def test_grid_corners_by_hand():
    half, corners = (sampling_grid(uniform(0, 0), align_corners=flag) for flag in (False, True))
    assert np.array_equal(half[0, 0], np.float32([-7 / 8, -4 / 5])) and np.array_equal(half[-1, -1], -half[0, 0])
    assert np.array_equal(corners[0, 0], [-1, -1]) and np.array_equal(corners[-1, -1], [1, 1])


def test_align_corners_needs_two_pixels():
    with pytest.raises(InputError, match="align_corners=True has no unit for a buffer of 1x5"):
        sampling_grid(uniform(0, 0, width=1), align_corners=True)
    assert sampling_grid(uniform(0, 0, width=1), align_corners=False)[0, 0, 0] == 0


def slow_dilated(values, depth, radius):
    height, width, _ = values.shape
    result = values.copy()
    for j in range(height):
        for i in range(width):
            best = depth[j, i, 0]
            for b in range(max(0, j - radius), min(height, j + radius + 1)):
                for a in range(max(0, i - radius), min(width, i + radius + 1)):
                    if depth[b, a, 0] < best:
                        best, result[j, i] = depth[b, a, 0], values[b, a]
    return result


def scattered(height=6, width=9):
    """Motion and depth with equal depths and background in it."""
    depth = RNG.choice(np.float32([1, 2, 2, 3, np.inf, np.inf]), (height, width, 1))
    return RNG.uniform(-3, 3, (height, width, 2)).astype(np.float32), depth


@pytest.mark.parametrize("radius", [0, 1, 2])
def test_dilation_equals_its_plain_loop(radius):
    motion, depth = scattered()
    assert np.array_equal(dilated(motion, depth, radius), slow_dilated(motion, depth, radius))
    assert np.array_equal(dilated(depth, depth, radius), slow_dilated(depth, depth, radius))


def test_a_thin_object_grows_by_one_pixel_over_the_sky():
    depth = np.full((4, 5, 1), np.inf, np.float32)
    depth[:, 2] = 3
    motion = np.where(np.isinf(depth), np.float32([9, 9]), np.float32([1, -1]))
    got = dilated(motion, depth)
    assert np.array_equal(got[:, 1:4], uniform(1, -1, 4, 3)) and np.array_equal(got[:, ::4], uniform(9, 9, 4, 2))


def slow_block_dilated(motion, depth, size, block, jitter):
    """HR pixel by HR pixel."""
    height, width, _ = motion.shape
    result = np.zeros((size[1], size[0], 2), np.float32)
    scale = np.float32([size[0] / width, size[1] / height])
    for top in range(0, size[1], block):
        for left in range(0, size[0], block):
            inside = (slice(top, top + block), slice(left, left + block))
            places = []
            for y in range(top, min(top + block, size[1])):
                for x in range(left, min(left + block, size[0])):
                    j = min(max(int(np.floor((y + 0.5) * (height / size[1]) + jitter[1])), 0), height - 1)
                    i = min(max(int(np.floor((x + 0.5) * (width / size[0]) + jitter[0])), 0), width - 1)
                    places.append((j, i))
            result[inside] = motion[min(places, key=lambda place: depth[place][0])] * scale
    return result


@pytest.mark.parametrize("size", [(18, 12), (27, 18), (36, 24), (25, 17), (9, 6)])
@pytest.mark.parametrize("jitter", [(0, 0), J])
def test_blocks_equal_their_plain_loop(size, jitter):
    motion, depth = scattered()
    got = block_dilated(motion, depth, size, jitter=jitter)
    assert got.dtype == np.float32 and np.array_equal(got, slow_block_dilated(motion, depth, size, 8, jitter))


def test_a_block_at_twice_the_size_is_four_lr_pixels_wide():
    depth, motion = np.full((8, 12, 1), 5, np.float32), uniform(0, 0, 8, 12)
    depth[3, 7], motion[3, 7] = 1, (1, -0.5)  # the last pixel of the block in row 0, column 1
    got = block_dilated(motion, depth, (24, 16))
    expected = np.zeros((16, 24, 2), np.float32)
    expected[:8, 8:16] = (2, -1)  # in HR pixels
    assert np.array_equal(got, expected)


def test_masks_by_hand():
    # bits 1 inside the previous frame, 2 in front of its camera, 4 seen by it
    visibility = np.uint32([[[7], [3], [2], [0]]])
    assert off_screen(visibility)[0, :, 0].tolist() == [False, False, True, True]
    assert disoccluded(visibility)[0, :, 0].tolist() == [False, True, False, False]
    assert without_history(visibility)[0, :, 0].tolist() == [False, True, True, True]
    assert np.array_equal(without_history(visibility), off_screen(visibility) | disoccluded(visibility))


def test_newly_appeared_objects_by_hand():
    before = np.uint32([[[3], [3], [4_000_000_000]]])
    now = np.uint32([[[0], [3], [2]], [[4_000_000_000], [4_000_000_001], [9]]])
    assert newly_appeared(now, before)[..., 0].tolist() == [[False, False, True], [False, True, True]]


def test_nsrd_occlusion_is_a_tenth_of_a_pixel_in_x_or_y():
    motion = np.zeros((1, 4, 2), np.float32)
    dual = np.float32([[[0.09, 0.09], [0.11, 0], [0, -0.11], [0, 0]]])
    assert occluded_by_dual_motion(motion, dual)[0, :, 0].tolist() == [False, True, True, False]


def results(xp) -> list:
    """Every function once, on arrays of `xp`."""
    rng = np.random.default_rng(8)
    motion, dual = (xp.asarray(rng.uniform(-3, 3, (6, 9, 2)).astype(np.float32)) for _ in range(2))
    depth = xp.asarray(rng.choice(np.float32([1, 2, np.inf]), (6, 9, 1)))
    bits = xp.asarray(rng.integers(0, 8, (6, 9, 1)).astype(np.uint32))
    ids, old_ids = (xp.asarray(rng.integers(0, 6, (6, 9, 1)).astype(np.uint32)) for _ in range(2))
    converted = [to_convention(motion, getattr(conventions, name), J, J_BEFORE) for name in NAMED]
    return [
        *converted,
        *(from_convention(m, getattr(conventions, name), J, J_BEFORE) for m, name in zip(converted, NAMED, strict=True)),
        *(sampling_grid(motion, align_corners=flag, jitter=J, previous_jitter=J_BEFORE) for flag in (False, True)),
        dilated(motion, depth),
        block_dilated(motion, depth, (25, 17), jitter=J),
        off_screen(bits),
        disoccluded(bits),
        without_history(bits),
        newly_appeared(ids, old_ids),
        occluded_by_dual_motion(motion, dual),
    ]


def test_it_needs_nothing_but_the_array_api():
    for strict, expected in zip(results(array_api_strict), results(np), strict=True):
        assert isinstance(strict, array_api_strict._array_object.Array)
        assert np.array_equal(np.asarray(strict), expected)


def test_torch_gives_the_same_and_grid_sample_warps():
    torch = pytest.importorskip("torch")
    for got, expected in zip(results(torch), results(np), strict=True):
        # its sums and products round alike; a fused one may differ by an ulp of values below 16
        assert isinstance(got, torch.Tensor) and np.abs(got.numpy() * 1.0 - expected * 1.0).max() < 16 * 2 * EPSILON
    image = RNG.uniform(0, 1, (5, 8, 3)).astype(np.float32)
    motion = RNG.uniform(-2, 2, (5, 8, 2)).astype(np.float32)
    for corners in (False, True):
        grid = sampling_grid(torch.asarray(motion), align_corners=corners)
        got = torch.nn.functional.grid_sample(
            torch.asarray(image).permute(2, 0, 1)[None], grid[None], padding_mode="border", align_corners=corners
        )
        expected = plain_grid_sample(image, sampling_grid(motion, align_corners=corners), corners)
        # places of up to 8 pixels, rounded a few times; slopes below 1 a pixel
        assert np.abs(got[0].permute(1, 2, 0).numpy() - expected).max() < 8 * 8 * EPSILON
