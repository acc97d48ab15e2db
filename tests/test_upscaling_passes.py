"""The upscaler's passes, each against a plain loop over pixels in float64, on small images of unequal sizes."""

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from framepairs.backend import dr, jit
from framepairs.manifest import CameraRecord
from framepairs.transforms import clip_from_view, look_at, orthographic_clip_from_view
from framepairs.upscaling.accumulation import Sums, accumulate
from framepairs.upscaling.guided import LEAST_LIKENESS, LEAST_MATERIAL, _mixed, guided, lighting_of, over_layers, samples
from framepairs.upscaling.guided_temporal import guided_oracle, guided_temporal
from framepairs.upscaling.inputs import BRIGHTEST, FAR, LAYERS, UpscaleFrame, finite, previous_depth_coefficients
from framepairs.upscaling.measures import Deviation, change_error, settled_frames, still_shots, warp_error
from framepairs.upscaling.neighbourhood import NARROWEST, STATISTICS, neighbourhood, sample_sigma
from framepairs.upscaling.rectification import BRIGHTEST_SHOWN, compress, expand, half_sizes, rectify
from framepairs.upscaling.sequence import METHODS
from framepairs.upscaling.settings import DEFAULTS
from framepairs.upscaling.spatial import lr_places
from framepairs.upscaling.surfaces import dilate, hidden
from framepairs.upscaling.temporal import History, carry, no_history, oracle, temporal
from framepairs.warp import to_array, to_image

RNG = np.random.default_rng(8)
EPSILON = 2.0**-24  # relative rounding of one float32 operation
PLACE = 4 * EPSILON * 16  # of a place below 16 pixels, after the product, the sum and the difference that make an offset
NINE = list(itertools.product((-1, 0, 1), (-1, 0, 1)))  # (row, column)
YCOCG = np.array([[0.25, 0.5, 0.25], [0.5, 0, -0.5], [-0.25, 0.5, -0.25]])
STANDS = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # depth coefficients of a camera that stands
LR = (7, 5)
# LR size, HR size, jitter: 2x by 2.2x, 2.86x by 2.6x, 1x, 1x by 3.4x
CASES = [
    (LR, (14, 11), (0.3, -0.4)),
    (LR, (20, 13), (-0.2, 0.45)),
    (LR, LR, (0.25, 0.125)),
    ((5, 7), (5, 24), (-0.45, 0.07)),
]


@pytest.fixture(autouse=True)
def same_numbers():
    """Each test draws the same numbers, whichever run before it."""
    RNG.bit_generator.state = np.random.default_rng(8).bit_generator.state


def at(image, i, j):
    """The pixel in column i, row j, clamped to the image."""
    height, width = image.shape[:2]
    return image[min(max(j, 0), height - 1), min(max(i, 0), width - 1)].astype(np.float64)


def nearest_pixel(image, where):
    """Column and row of the pixel of `image` whose centre is nearest to a place, which jitter may have moved outside."""
    height, width = image.shape[:2]
    return min(max(math.floor(where[0]), 0), width - 1), min(max(math.floor(where[1]), 0), height - 1)


def nine_around(image, where):
    """(a, b, dx, dy, whether it is inside) of the nearest pixel and the eight around it, row by row."""
    height, width = image.shape[:2]
    ci, cj = nearest_pixel(image, where)
    for row, column in NINE:
        a, b = ci + column, cj + row
        yield a, b, a + 0.5 - where[0], b + 0.5 - where[1], 0 <= a < width and 0 <= b < height


def pixels(size):
    return itertools.product(range(size[1]), range(size[0]))  # (j, i), row-major


def places(lr, size, jitter):
    """[height, width, 2]: where HR pixels lie in LR pixels. None lies so near a pixel's border that rounding could decide."""
    result = np.zeros((size[1], size[0], 2))
    for j, i in pixels(size):
        result[j, i] = [(k + 0.5) * small / large + J for k, small, large, J in zip((i, j), lr, size, jitter, strict=True)]
    assert np.abs(result - np.round(result)).min() > 1e-3
    return result


def image_of(*shape, low=0.0, high=3.0):
    return RNG.uniform(low, high, shape).astype(np.float32)


def pictured(planes, size):
    """[height, width, components], float64, of planes that a kernel made."""
    whole = [plane + dr.zeros(jit.Float, size[0] * size[1]) for plane in planes]
    return to_array(whole, *size).astype(np.float64)


def plane(array):
    """One Dr.Jit array of [height, width]."""
    return to_image(np.ascontiguousarray(array, np.float32)[..., None]).planes[0]


def colours(array):
    """Array3f of [n, 3]."""
    return jit.Array3f(*(jit.Float(np.ascontiguousarray(array[:, k], np.float32)) for k in range(3)))


def rows(vector):
    """[n, 3] of an Array3f."""
    return np.stack([np.array(component) for component in vector], axis=-1).astype(np.float64)


def frame_of(size, jitter=(0.0, 0.0), exposure=1.0, coefficients=STANDS, lr=None, hr=None):
    made = [{name: to_image(array) for name, array in (given or {}).items()} for given in (lr, hr)]
    return UpscaleFrame(lr=made[0], hr=made[1], size=size, jitter=jitter, exposure=exposure, previous_depth=coefficients)


def channels_of(size, light=None):
    """Every channel that any method reads: speckled surfaces, single background pixels, motion of all kinds. Colour is `light`
    times F_beta plus emission, or random."""
    width, height = size
    ids = RNG.integers(1, 4, (height, width, 1)).astype(np.uint32)
    ids[1::2, 1::2] *= RNG.random(ids[1::2, 1::2].shape) < 0.5  # in no corner, and never two side by side
    surface = ids > 0
    normal = RNG.normal(size=(height, width, 3))
    brdf = np.where(surface, image_of(height, width, 3, low=0.05, high=1), 0).astype(np.float32)
    emission = image_of(height, width, 3, high=1)
    color = image_of(height, width, 3) if light is None else brdf * np.float32(light) + emission
    motion = RNG.uniform(-2, 2, (height, width, 2)) * (RNG.random((height, width, 1)) < 0.6)
    return {
        "color": color,
        "depth": np.where(surface, image_of(height, width, 1, low=2, high=3), FAR).astype(np.float32),
        "normal": (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32),
        "object_id": ids,
        "emission": emission,
        "brdf": brdf,
        "motion": motion.astype(np.float32),
        "visibility": RNG.integers(0, 8, (height, width, 1)).astype(np.uint32),
    }


# Pass 1: dilation


def slow_dilated(depth, motion):
    """Of each pixel, the nearest depth in 3x3, and the motions of those that have it."""
    found = {}
    height, width = depth.shape[:2]
    for j, i in pixels((width, height)):
        around = [(at(depth, i + c, j + r)[0], tuple(at(motion, i + c, j + r))) for r, c in NINE]
        nearest = min(z for z, _ in around)
        found[j, i] = nearest, {moved for z, moved in around if z == nearest}
    return found


@pytest.mark.parametrize("depths", ["all different", "ties", "some background", "one pixel"])
def test_dilation_takes_depth_and_motion_of_the_nearest_of_nine(depths):
    width, height = (1, 1) if depths == "one pixel" else LR
    depth, motion = image_of(height, width, 1, low=1, high=9), image_of(height, width, 2, low=-3)
    if depths == "ties":
        depth = np.ceil(depth / 4)
    if depths == "some background":
        depth[RNG.random(depth.shape) < 0.8] = FAR
    got = pictured(dilate(to_image(depth), to_image(motion)).planes, (width, height))
    for (j, i), (nearest, motions) in slow_dilated(depth, motion).items():
        assert got[j, i, 0] == nearest and tuple(got[j, i, 1:]) in motions


def test_dilation_of_a_level_surface_leaves_its_motion():
    motion = image_of(5, 7, 2)
    surface = dilate(to_image(np.full((5, 7, 1), FAR, np.float32)), to_image(motion))
    assert np.array_equal(pictured(surface.planes, LR)[..., 1:], motion)


# Pass 2: what was hidden


def lens(kind):
    """clip_from_view of an off-centre camera that is not square."""
    if kind == "perspective":
        return clip_from_view(0.9, 7 / 5, 0.1, 1000, shift=(0.11, -0.07))
    return orthographic_clip_from_view(4, 7 / 5, 0.1, 1000, shift=(0.11, -0.07))


def poses(turn=0.1):
    """view_from_world now and before: moved along all axes and turned."""
    now = look_at(np.array([0.3, 0.2, 5.0]), np.array([0.1, -0.2, 0.0]), np.array([0.1, 1.0, 0.0]))
    before = look_at(np.array([0.1, 0.4, 5.3]), np.array([0.1 - 2 * turn, 2 * turn - 0.2, 0.1]), np.array([0.0, 1.0, 0.05]))
    return np.linalg.inv(now), np.linalg.inv(before)


def record_of(clip, view, previous):
    camera = CameraRecord(
        fov_y_rad=0.9,
        near=0.1,
        far=1000,
        view_from_world=view.tolist(),
        clip_from_view=clip.tolist(),
        previous_view_from_world=previous.tolist(),
        previous_clip_from_view=clip.tolist(),
    )
    return SimpleNamespace(camera=camera)


def projected(clip, view, points):
    """(X, Y) as fractions of the frame, y down, and depth of points [n, 3]."""
    seen = np.c_[points, np.ones(len(points))] @ view.T
    x, y, _, w = (seen @ clip.T).T
    return (x / w + 1) / 2, (1 - y / w) / 2, -seen[:, 2]


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_previous_depth_is_that_of_points_projected_by_both_cameras(kind):
    clip, (view, previous) = lens(kind), poses(turn=0.7)
    points = RNG.uniform(-2, 2, (50, 3))
    x, y, z = projected(clip, view, points)
    _, _, before = projected(clip, previous, points)
    a, b, c, d, e, f = previous_depth_coefficients(record_of(clip, view, previous))
    assert np.ptp(before - z) > 0.5
    assert np.abs(z * (a * x + b * y + c) + d * x + e * y + f - before).max() < 1e-12  # float64, depths below 10
    assert (d, e) == (0, 0) if kind == "perspective" else (a, b) == (0, 0)


def slow_hidden(surface, previous, jitter, previous_jitter, coefficients, settings):
    height, width = surface.shape[:2]
    a, b, c, d, e, f = coefficients
    share = np.zeros((height, width))
    for j, i in pixels((width, height)):
        z, mx, my = surface[j, i].astype(np.float64)
        x, y = i + 0.5 - jitter[0], j + 0.5 - jitter[1]
        expected = FAR if z >= FAR else z * (a * x / width + b * y / height + c) + d * x / width + e * y / height + f

        def change(across, down, z=z, i=i, j=j):
            sides = [(i + s * across, j + s * down) for s in (-1, 1)]
            inside = [(a, b) for a, b in sides if 0 <= a < width and 0 <= b < height]
            return min(abs(at(surface, a, b)[0] - z) for a, b in inside)

        slope = min(change(1, 0) + change(0, 1), settings.most_slope * z)
        x, y = x + mx, y + my
        if x < 0 or y < 0 or x > width or y > height:
            share[j, i] = 1
            continue
        x, y = x + previous_jitter[0] - 0.5, y + previous_jitter[1] - 0.5
        left, top = math.floor(x), math.floor(y)
        for row, column in itertools.product((0, 1), (0, 1)):
            weight = (1 - abs(x - left - column)) * (1 - abs(y - top - row))
            there, *moved = at(previous, left + column, top + row)
            needed = settings.separation * math.hypot(width, height) * max(expected, there) + settings.slope * slope
            parting = min(math.hypot(moved[0] - mx, moved[1] - my) / settings.least_parting, 1)
            share[j, i] += weight * min(max((expected - there) / needed - 1, 0), 1) * parting
    return share


def test_what_was_hidden_equals_its_plain_loop():
    """Tilted and broken surfaces, background, motion out of the frame, little and much parting; not a jitter the same."""
    clip, (view, previous) = lens("perspective"), poses()
    coefficients = previous_depth_coefficients(record_of(clip, view, previous))
    surfaces = []
    for _ in range(2):
        depth = 4 + 0.02 * np.arange(12)[None] + 0.03 * np.arange(9)[:, None] + RNG.uniform(0, 0.02, (9, 12))
        depth[RNG.random(depth.shape) < 0.3] -= 0.4
        depth[RNG.random(depth.shape) < 0.1] = FAR
        motion = RNG.choice([0.0, 0.03, 1.3], (9, 12, 2)) + RNG.uniform(0, 0.04, (9, 12, 2))
        surfaces.append(np.concatenate([depth[..., None], motion], axis=-1).astype(np.float32))
    given = (0.3, -0.4), (-0.1, 0.2), coefficients, DEFAULTS
    got = pictured(hidden(*map(to_image, surfaces), *given).planes, (12, 9))[..., 0]
    expected = slow_hidden(*surfaces, *given)
    assert expected.max() == 1 and expected.min() == 0 and np.sum((expected > 0.01) & (expected < 0.99)) > 10
    # depths round by a few epsilon of 5, and a share of 1 is at least `needed`, 2e-4 of that: 4 epsilon / 2e-4
    assert np.abs(got - expected).max() < 4 * EPSILON / 2e-4


def wall(kind, size, jitters):
    """A tilted standing plane seen by both poses through jittered pixels: surface now and before [depth, motion], exactly."""
    clip, (view, previous) = lens(kind), poses()
    normal, offset = np.array([0.3, -0.2, 1.0]), -1.0
    surfaces = []
    for pose, other, jitter in ((view, previous, jitters[0]), (previous, view, jitters[1])):
        surface = np.zeros((size[1], size[0], 3))
        world = np.linalg.inv(pose)
        for j, i in pixels(size):
            ndc = np.array([2 * (i + 0.5 - jitter[0]) / size[0] - 1, 1 - 2 * (j + 0.5 - jitter[1]) / size[1]])
            ends = []
            for depth in (-1.0, 0.5):  # two points of the pixel's ray, by the inverse of the projection
                point = world @ np.linalg.inv(clip) @ [*ndc, depth, 1]
                ends.append(point[:3] / point[3])
            along = (offset - normal @ ends[0]) / (normal @ (ends[1] - ends[0]))
            hit = (ends[0] + along * (ends[1] - ends[0]))[None]
            x, y, z = projected(clip, pose, hit)
            there_x, there_y, _ = projected(clip, other, hit)
            surface[j, i] = z[0], (there_x - x)[0] * size[0], (there_y - y)[0] * size[1]
        surfaces.append(surface.astype(np.float32))
    return surfaces, previous_depth_coefficients(record_of(clip, view, previous))


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_standing_wall_hides_nothing_from_a_camera_that_moves_and_turns(kind):
    size, jitters = (12, 9), ((0.3, -0.4), (-0.45, 0.2))
    (now, before), coefficients = wall(kind, size, jitters)
    before[..., 1:] += 9  # parting counts in full: depths alone must tell
    got = pictured(hidden(to_image(now), to_image(before), *jitters, coefficients, DEFAULTS).planes, size)[..., 0]
    left = [
        not (0 <= i + 0.5 - 0.3 + now[j, i, 1] <= size[0] and 0 <= j + 0.5 + 0.4 + now[j, i, 2] <= size[1])
        for j, i in pixels(size)
    ]
    left = np.array(left, float).reshape(got.shape)
    assert 0 < left.sum() < left.size / 2
    assert np.array_equal(got, left)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_what_stood_before_the_wall_and_moved_otherwise_hides_it_in_full(kind):
    """An occluder at half the depth in columns 4 to 7; it counts half when it parts by half of `least_parting`."""
    size, jitters = (12, 9), ((0.3, -0.4), (-0.45, 0.2))
    (now, before), coefficients = wall(kind, size, jitters)
    before[:, 4:8, 0] *= 0.5
    for parting, share in ((3.0, 1.0), (0.5 * DEFAULTS.least_parting, 0.5), (0.0, 0.0)):
        covering = now.copy()
        covering[..., 1:] = (-0.5, 0.25)  # one motion, so that the parting is exact
        there = before.copy()
        there[..., 1:] = (-0.5, 0.25 + parting)
        got = pictured(hidden(to_image(covering), to_image(there), *jitters, coefficients, DEFAULTS).planes, size)[..., 0]
        x = np.arange(12) + 0.5 - 0.3 - 0.5 - 0.45 - 0.5  # LR columns of the previous buffer, centres at whole numbers
        wholly = (x > 4) & (x < 7)
        assert wholly.sum() == 3 and np.abs(got[1:-1, wholly] - share).max() < 1e-5, parting  # 0.05 of 0.5: 8 epsilon / 0.1
        assert np.all(got[1:-1, (x < 3) & (x > 0)] == 0)


# Passes 3 and 5: the neighbourhood


def slow_weight(d, scale, sigma, settings):
    if settings.kernel == "radial_lanczos":
        far = math.hypot(*(v * min(NARROWEST, s) for v, s in zip(d, scale, strict=True)))
        return np.sinc(far) * np.sinc(far / 2) if far < 2 else 0.0
    near = math.exp(-sum((v * s) ** 2 for v, s in zip(d, scale, strict=True)) / (2 * sigma**2))
    wide = math.exp(-2 * (d[0] ** 2 + d[1] ** 2))  # of half an LR pixel
    return ((1 - settings.wide) * near + settings.wide * wide) * max(1 - abs(d[0]), 0) * max(1 - abs(d[1]), 0)


def slow_compressed(rgb, strength):
    return rgb / (1 + strength * np.abs(rgb).max())


def slow_neighbourhood(color, where, scale, sigma, strength, settings):
    """color, weight, low, high, mean, deviation of one HR pixel at `where` in LR pixels."""
    found = []
    for a, b, *d, inside in nine_around(color, where):
        if inside:
            statistics = math.exp(STATISTICS * (d[0] ** 2 + d[1] ** 2))
            found.append((slow_compressed(at(color, a, b), strength), d, statistics))
    kernel = np.array([slow_weight(d, scale, sigma, settings) for _, d, _ in found])
    values, shares = np.array([value for value, _, _ in found]), np.array([w for _, _, w in found])
    mean = shares @ (values @ YCOCG.T) / shares.sum()
    deviation = np.sqrt(shares @ np.square(values @ YCOCG.T - mean) / shares.sum())
    weight = kernel.sum()
    estimate = kernel @ values / weight if weight > settings.least_weight else np.linalg.solve(YCOCG, mean)
    low, high = values.min(0), values.max(0)
    return np.clip(estimate, low, high), max(weight, settings.least_weight), low, high, mean, deviation


@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
@pytest.mark.parametrize(("kernel", "least"), [("gaussian", 1e-3), ("gaussian", 0.3), ("radial_lanczos", 1e-3)])
def test_the_neighbourhood_equals_its_plain_loop(lr, size, jitter, kernel, least):
    settings = replace(DEFAULTS, kernel=kernel, least_weight=least)
    color, strength = image_of(lr[1], lr[0], 3), 0.7
    color[1, 2] = 500
    speed = image_of(size[1], size[0], high=1.5)
    where, scale = places(lr, size, jitter), [large / small for small, large in zip(lr, size, strict=True)]
    x, y = lr_places(to_image(color), size, jitter)
    given = (
        [jit.Float(value) for value in scale],
        sample_sigma(plane(speed), settings.still_sigma, settings.moving_sigma),
        jit.Float(strength),
        settings,
    )
    got = neighbourhood(to_image(color), x, y, *given)
    fields = [pictured(part, size) for part in (got.color, [got.weight], got.low, got.high, got.mean, got.deviation)]
    clipped = 0
    for j, i in pixels(size):
        sigma = settings.still_sigma + (settings.moving_sigma - settings.still_sigma) * min(speed[j, i], 1)
        expected = slow_neighbourhood(color, where[j, i], scale, sigma, strength, settings)
        weight = abs(expected[1])
        # a weight changes by at most 2 / still_sigma per HR pixel; all values lie in 0 to 1 / 0.7
        moved = 2 / settings.still_sigma * max(scale) * PLACE + 16 * EPSILON
        assert abs(fields[1][j, i, 0] - expected[1]) < 9 * moved
        assert np.abs(fields[0][j, i] - expected[0]).max() < 9 * moved * 1.5 / max(weight, 0.02)
        for k in (2, 3):
            assert np.abs(fields[k][j, i] - expected[k]).max() < 8 * EPSILON
        assert np.abs(fields[4][j, i] - expected[4]).max() < 9 * moved
        assert np.abs(fields[5][j, i] ** 2 - expected[5] ** 2).max() < 18 * moved
        clipped += np.any((expected[0] == expected[2]) | (expected[0] == expected[3]))
    assert clipped or kernel == "gaussian"


def test_a_constant_image_is_its_own_neighbourhood():
    """Also where no sample is near enough to count: least_weight is its weight, and the mean its colour."""
    color = np.broadcast_to(np.float32([0.25, 1, 3]), (5, 7, 3)).copy()
    for kernel in ("gaussian", "radial_lanczos"):
        settings = replace(DEFAULTS, kernel=kernel, least_weight=0.4)
        x, y = lr_places(to_image(color), (20, 13), (0.2, 0.1))
        got = neighbourhood(to_image(color), x, y, [jit.Float(20 / 7), jit.Float(13 / 5)], 0.35, jit.Float(0), settings)
        assert np.array_equal(pictured(got.color, (20, 13)), np.broadcast_to(color[0, 0], (13, 20, 3)))
        assert np.abs(pictured(got.mean, (20, 13)) - YCOCG @ color[0, 0]).max() < 3 * 16 * EPSILON
        assert pictured(got.deviation, (20, 13)).max() < 3 * math.sqrt(32 * EPSILON)  # root of what 9 squares of 3 round by
        assert np.isclose(pictured([got.weight], (20, 13)).min(), 0.4)


# Compression and rectification


@pytest.mark.parametrize("strength", [0.0, 0.125, 1.0, 64.0])
def test_expanding_is_the_inverse_of_compressing(strength):
    rgb = RNG.uniform(0, 1, (200, 3)) * 10.0 ** RNG.integers(-4, 4, (200, 1))
    rgb[0], rgb[1], rgb[2], rgb[3] = 0, (-0.5, 0.25, 3), (-0.5, -0.25, -2), (-3, 1, 0.5)
    rgb = rgb.astype(np.float32)
    squeezed = rows(compress(colours(rgb), jit.Float(strength)))
    assert np.allclose(squeezed, [slow_compressed(value, strength) for value in rgb.astype(float)], rtol=8 * EPSILON)
    assert strength == 0 or squeezed.max() * strength < 1
    back = rows(expand(colours(squeezed), jit.Float(strength)))
    # 1 - s c, a difference near 1 / (1 + s max), keeps 4 epsilon times 1 + s max of its digits
    most = 1 + strength * np.abs(rgb).max(axis=-1, keepdims=True)
    known = most[:, 0] < 0.1 * BRIGHTEST_SHOWN
    assert known.sum() > 100 and np.all(
        np.abs(back - rgb)[known] <= (8 * EPSILON * most * np.abs(rgb).max(axis=-1, keepdims=True))[known]
    )


def test_compression_has_limits():
    for strength in (0.01, 1.0):
        for value in (1e6, 1e18, 3e38):
            squeezed = compress(colours(np.float32([[value, 0.5 * value, 0]])), jit.Float(strength))
            assert np.allclose(rows(squeezed)[0] * strength, [1, 0.5, 0], rtol=2e-4)  # 1 / (1 + 1e4)
            assert np.allclose(
                rows(expand(squeezed, jit.Float(strength)))[0, 0] * strength, min(value * strength, 1e5), rtol=0.01
            )
    assert np.array_equal(rows(compress(colours(np.float32([[1e18, 0, -3]])), jit.Float(0)))[0], np.float32([1e18, 0, -3]))
    assert np.array_equal(rows(compress(colours(np.zeros((1, 3))), jit.Float(1)))[0], [0, 0, 0])


def test_rectified_colours_lie_on_the_ellipsoid_or_stay():
    history, mean, half = (
        image_of(300, 3, high=1),
        image_of(300, 3, low=0.2, high=0.6) @ YCOCG.T,
        image_of(300, 3, high=0.5) + 0.02,
    )
    mean, half = mean.astype(np.float32), half.astype(np.float32)
    kept, beyond = rectify(colours(history), colours(mean), colours(half))
    kept, beyond = rows(kept), np.array(beyond)
    outside = 0
    for k in range(300):
        offset = YCOCG @ history[k] - mean[k]
        far = np.linalg.norm(offset / half[k])
        if far <= 1 - 1e-5:
            assert np.array_equal(kept[k], history[k]) and beyond[k] == 1
        elif far > 1 + 1e-5:
            outside += 1
            # offsets round by 4 epsilon of 1, and the least half axis is 0.02
            assert abs(beyond[k] - far) < 8 * EPSILON * (far + 1 / 0.02)
            moved = YCOCG @ kept[k] - mean[k]
            assert abs(np.linalg.norm(moved / half[k]) - 1) < 16 * EPSILON / 0.02
            assert np.abs(moved - offset / far).max() < 16 * EPSILON
    assert 50 < outside < 250


def test_half_axes_are_longer_for_luma_and_never_0():
    got = half_sizes(colours(np.float32([[0.1, 0.2, 0.3], [0, 0, 0]])), jit.Float(3), jit.Float(1.7), jit.Float([0.5, 0]), 1e-5)
    assert np.allclose(rows(got), [[0.51 + 0.5, 0.6 + 0.5, 0.9 + 0.5], [1e-5] * 3], rtol=1e-6, atol=1.1e-5)
    assert rows(got).min() > 0


# Pass 4: history at its place before


def slow_cubic(d):
    """Keys 1981, a = -1/2."""
    d = abs(d)
    return 1.5 * d**3 - 2.5 * d**2 + 1 if d < 1 else -0.5 * d**3 + 2.5 * d**2 - 4 * d + 2 if d < 2 else 0.0


def slow_filtered(image, x, y, reach, kernel):
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    total = 0.0
    for row, column in itertools.product(range(1 - reach, reach + 1), repeat=2):
        i, j = left + column, top + row
        total = total + kernel(x - 0.5 - i) * kernel(y - 0.5 - j) * at(image, i, j)
    return total


def slow_linear(image, x, y):
    return slow_filtered(image, x, y, 1, lambda d: 1 - abs(d))


def slow_limited(image, x, y):
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    corners = [at(image, left + c, top + r) for r, c in itertools.product((0, 1), repeat=2)]
    return np.clip(slow_filtered(image, x, y, 2, slow_cubic), np.min(corners, axis=0), np.max(corners, axis=0))


def slow_carried(values, weight, variance, motion, trust, most):
    """values, weight, variance, speed, trust of every HR pixel."""
    height, width = weight.shape[:2]
    carried = [np.zeros_like(values, float)] + [np.zeros((height, width)) for _ in range(4)]
    for j, i in pixels((width, height)):
        mx, my = motion[j, i].astype(float)
        x, y, speed = i + 0.5 + mx, j + 0.5 + my, math.hypot(mx, my)
        sure = 0.0 if x < 0 or y < 0 or x > width or y > height else float(trust[j, i])
        known = slow_linear(weight, x, y)[0]
        known = (min(known, most) if speed > 0 else known) * sure
        answers = slow_limited(values, x, y), known, slow_linear(variance, x, y)[0] * sure, speed, sure
        for part, answer in zip(carried, answers, strict=True):
            part[j, i] = answer
    return carried


@pytest.mark.parametrize("components", [3, 6])
def test_history_is_carried_as_by_its_plain_loop(components):
    size = (11, 8)
    values, weight, variance = image_of(8, 11, components), image_of(8, 11, 1, high=20), image_of(8, 11, 1)
    motion, trust = image_of(8, 11, 2, low=-4, high=4), image_of(8, 11, high=1)
    motion[2:5] = 0
    history = History(*map(to_image, (values, weight, variance)))
    got = carry(history, size, to_image(motion).planes, plane(trust), jit.Float(2.5))
    expected = slow_carried(values, weight, variance, motion, trust, 2.5)
    parts = [got.values, [got.weight], [got.variance], [got.speed], [got.trust]]
    for name, part, plain in zip(("values", "weight", "variance", "speed", "trust"), parts, expected, strict=True):
        plain = plain.reshape(8, 11, -1)
        # a filter's slope is below 2 times the range per pixel and axis
        assert np.abs(pictured(part, size) - plain).max() < 4 * PLACE * max(plain.max(), 20 if name == "weight" else 1), name
    assert np.array_equal(pictured(got.values, size)[2:5], values[2:5])  # what stands stays, bit for bit
    assert expected[1][2:5].max() > 2.5 >= expected[1][5:].max() and (expected[4] == 0).sum() > 5


# accumulate


def slow_accumulated(history, color, motion, visibility, size, jitter, settings):
    """mean [h, w, 3] and weight [h, w, 1] after one more frame."""
    lr = color.shape[1], color.shape[0]
    scale, where = [large / small for small, large in zip(lr, size, strict=True)], places(lr, size, jitter)
    mean, total = np.zeros((size[1], size[0], 3)), np.zeros((size[1], size[0], 1))
    for j, i in pixels(size):
        ci, cj = nearest_pixel(color, where[j, i])
        sums = np.zeros(3)
        for a, b, *d, inside in nine_around(color, where[j, i]):
            w = slow_weight(d, scale, settings.still_sigma, settings) * inside
            w = max(w, 1e-6) if (a, b) == (ci, cj) else w
            sums, total[j, i] = sums + w * at(color, a, b), total[j, i] + w
        if history is not None and int(at(visibility, ci, cj)[0]) & 5 == 5:
            moved = at(motion, ci, cj) * scale
            x, y = i + 0.5 + moved[0], j + 0.5 + moved[1]
            w = slow_linear(history[1], x, y)[0]
            w = min(w, settings.accumulate_most_moving) if moved.any() else w
            sums, total[j, i] = sums + w * slow_linear(history[0], x, y), total[j, i] + w
        mean[j, i] = sums / total[j, i]
    return mean, total


@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
def test_three_frames_accumulate_as_in_the_plain_loop(lr, size, jitter):
    settings = replace(DEFAULTS, accumulate_most_moving=0.3)
    history, plain = None, None
    for k in range(3):
        given = channels_of(lr)
        turned = tuple(v * (1, -0.7, 0.4)[k] for v in jitter)
        frame = frame_of(size, turned, lr={name: given[name] for name in ("color", "motion", "visibility")})
        history, planes = accumulate(history, frame, settings)
        plain = slow_accumulated(plain, *(given[name] for name in ("color", "motion", "visibility")), size, turned, settings)
    # relative: weights as in the neighbourhood's test, thrice; the least sum of weights is 3e-3
    moved = 2 / settings.still_sigma * 3.4 * PLACE + 16 * EPSILON
    assert np.abs(pictured(history.weight.planes, size) - plain[1]).max() < 30 * moved
    assert np.all(np.abs(pictured(planes, size) - plain[0]) < 3 * 27 * moved / np.maximum(plain[1], 0.3) + 1e-5)


def test_scale_1_without_jitter_accumulates_still_frames_to_their_own_mean():
    color = np.full((5, 7, 3), 0.75, np.float32)
    still = {"motion": np.zeros((5, 7, 2), np.float32), "visibility": np.full((5, 7, 1), 7, np.uint32)}
    history = None
    for _ in range(3):
        history, planes = accumulate(history, frame_of(LR, lr={"color": color, **still}), DEFAULTS)
    assert isinstance(history, Sums) and np.abs(pictured(planes, LR) - 0.75).max() < 20 * EPSILON


# Pass 7: guides


GUIDES = ("color", "depth", "normal", "object_id", "emission", "brdf")


def guided_frame(lr, size, jitter, light=None, **given):
    """A frame of unrelated LR and HR channels, and those; without `light` colours are random."""
    low, high = channels_of(lr, light), channels_of(size, light)
    return frame_of(size, jitter, lr=low, hr=high, **given), low, high


def slow_slope(depth, i, j, across, down):
    """Change of 1 / depth per HR pixel: the smaller of both sides', to the left and above where they are equal."""
    height, width = depth.shape[:2]
    inside = [s for s in (-1, 1) if 0 <= i + s * across < width and 0 <= j + s * down < height]
    return min((s * (1 / at(depth, i + s * across, j + s * down)[0] - 1 / at(depth, i, j)[0]) for s in inside), key=abs)


def slow_likeness(low, high, where, size, row, column, i, j):
    lr = low["color"].shape[1], low["color"].shape[0]
    a, b = (v + k for v, k in zip(nearest_pixel(low["color"], where[j, i]), (column, row), strict=True))
    if not (0 <= a < lr[0] and 0 <= b < lr[1]):
        return 0.0
    off = [(k + 0.5 - v) * large / small for k, v, small, large in zip((a, b), where[j, i], lr, size, strict=True)]
    here, there = 1 / at(high["depth"], i, j)[0], 1 / at(low["depth"], a, b)[0]
    on_plane = here + sum(d * slow_slope(high["depth"], i, j, *axis) for d, axis in zip(off, ((1, 0), (0, 1)), strict=True))
    alike = math.exp(-(((there - on_plane) / max(there, here) / DEFAULTS.depth_tolerance) ** 2))
    alike *= max(at(high["normal"], i, j) @ at(low["normal"], a, b), 0) ** DEFAULTS.normal_power
    alike *= 1 if at(low["object_id"], a, b)[0] == at(high["object_id"], i, j)[0] else DEFAULTS.other_object
    return max(alike, LEAST_LIKENESS)


@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
def test_samples_and_their_likeness_equal_the_plain_loop(lr, size, jitter):
    frame, low, high = guided_frame(lr, size, jitter)
    for channels in (low, high):  # near enough to each other for all kinds of likeness
        channels["depth"][channels["depth"] < FAR] = 2 + 0.03 * channels["depth"][channels["depth"] < FAR]
        turned = channels["normal"] * 0.15 + (0, 0, 1)
        channels["normal"] = (turned / np.linalg.norm(turned, axis=-1, keepdims=True)).astype(np.float32)
    frame, where = frame_of(size, jitter, lr=low, hr=high), places(lr, size, jitter)
    middling = 0
    for (row, column), sample in zip(NINE, samples(frame, DEFAULTS), strict=True):
        likeness, surface, dx, dy = (
            pictured([v], size)[..., 0] for v in (sample.likeness, sample.surface, sample.dx, sample.dy)
        )
        reflected, material = pictured(sample.reflected, size), pictured(sample.material, size)
        for j, i in pixels(size):
            a, b = (v + k for v, k in zip(nearest_pixel(low["color"], where[j, i]), (column, row), strict=True))
            inside = 0 <= a < lr[0] and 0 <= b < lr[1]
            expected = slow_likeness(low, high, where, size, row, column, i, j)
            middling += 2 * LEAST_LIKENESS < expected < 0.9
            # the exponent's root is below 3 and errs by 32 epsilon / depth_tolerance; normals by 8 epsilon, 32 times
            error = expected * (6 * 32 * EPSILON / 0.02 + 32 * 8 * EPSILON)
            assert abs(likeness[j, i] - expected) <= error, (i, j, row, column)
            assert surface[j, i] == (inside and at(low["object_id"], a, b)[0] > 0)
            assert abs(dx[j, i] - (a + 0.5 - where[j, i, 0])) + abs(dy[j, i] - (b + 0.5 - where[j, i, 1])) < PLACE
            assert np.allclose(reflected[j, i], at(low["color"], a, b) - at(low["emission"], a, b), atol=3 * EPSILON)
            assert np.allclose(material[j, i], np.maximum(at(low["brdf"], a, b), LEAST_MATERIAL), atol=EPSILON)
    assert middling > 20


def plane_channels(size, jitter, normal=(0.0, 0.0, 1.0), identity=1, nearer=1.0):
    """A steep plane: 1 / depth is linear over the frame. HR pixels show centres, LR ones centre - jitter."""
    width, height = size
    x = (np.arange(width) + 0.5 - jitter[0]) / width
    y = (np.arange(height) + 0.5 - jitter[1]) / height
    depth = (nearer / (0.2 + 0.15 * x[None] + 0.1 * y[:, None]))[..., None]
    flat = np.ones((height, width, 1))
    return {
        "color": flat.repeat(3, axis=-1).astype(np.float32),
        "depth": depth.astype(np.float32),
        "normal": (flat * normal).astype(np.float32),
        "object_id": np.full((height, width, 1), identity, np.uint32),
        "emission": np.zeros((height, width, 3), np.float32),
        "brdf": np.ones((height, width, 3), np.float32),
    }


def inner_likeness(low, lr, size, jitter):
    """Least and greatest likeness of samples of LR pixels inside the image."""
    frame = frame_of(size, jitter, lr=low, hr=plane_channels(size, (0, 0)))
    found = []
    for sample in samples(frame, DEFAULTS):
        likeness, a, b = (pictured([jit.Float(v)], size) for v in (sample.likeness, sample.column, sample.row))
        found.append(likeness[(a >= 0) & (b >= 0) & (a < lr[0]) & (b < lr[1])])
    return np.concatenate(found).min(), np.concatenate(found).max()


@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
def test_a_steep_plane_is_like_itself_and_unlike_others(lr, size, jitter):
    turned = (0.0, math.sin(0.3), math.cos(0.3))
    cases = (
        ({}, 1, 4 * EPSILON),  # a difference of 1 / depth, 2 epsilon of 0.5, counts 5 HR pixels far: (10 epsilon / 0.02)^2
        ({"normal": turned}, math.cos(0.3) ** DEFAULTS.normal_power, 1e-5),
        ({"identity": 2}, DEFAULTS.other_object, 1e-5),
        # 1 / 101 of the sample's own 1 / depth, which is the greater one but for its change over up to two LR pixels
        ({"nearer": 1 / 1.01}, math.exp(-((0.01 / 1.01 / DEFAULTS.depth_tolerance) ** 2)), 0.1),
        ({"nearer": 0.5}, LEAST_LIKENESS, 1e-5),
    )
    for given_plane, expected, error in cases:
        found = inner_likeness(plane_channels(lr, jitter, **given_plane), lr, size, jitter)
        assert found == pytest.approx((expected, expected), rel=error), given_plane


def test_lighting_weighs_by_material_and_is_0_without_any():
    """The third: sums of samples so far away that weights leave the range of floats, in the darkest component first."""
    reflected, material = [[2, 3, 0], [5, 0, 0], [1e-38, 1e-45, 0]], [[4, 2, 1], [0, 0, 0], [1e-38, 1e-45, 0]]
    got = rows(lighting_of(colours(np.float32(reflected)), colours(np.float32(material))))
    assert np.array_equal(got[:2], [[0.5, 1.5, 0], [0, 0, 0]])
    assert got[2].min() >= 0 and got[2].max() <= 1 and got[2, 2] == 0


@pytest.mark.parametrize("method", [guided_temporal, guided_oracle])
@pytest.mark.parametrize("scale", [6, 8, 16])
def test_dark_materials_are_remembered_at_any_scale(method, scale):
    """F_beta without blue: nothing that is remembered may be other than finite, where no sample lies near either."""
    lr, size, history = (5, 4), (5 * scale, 4 * scale), None
    for k in range(3):
        jitter = (0.3 - 0.2 * k, -0.4 + 0.3 * k)
        frame, low, high = guided_frame(lr, size, jitter, LIGHT)
        low["brdf"][..., 2] = 0
        frame = frame_of(size, jitter, lr={**low, "color": (LIGHT * low["brdf"] + low["emission"]).astype(np.float32)}, hr=high)
        history, planes = method(history, frame, DEFAULTS)
        assert np.isfinite(states(history)).all() and np.isfinite(pictured(planes, size)).all()


def test_lighting_is_mixed_by_a_gaussian_over_lit_surfaces():
    size, light = (9, 6), image_of(6, 9, 4)
    light[..., 3] = light[..., 3] > 1
    frame, _, high = guided_frame(LR, size, (0, 0))
    planes, lit = _mixed(to_image(light), frame, DEFAULTS)
    got, lit, alone = pictured(planes, size), pictured([lit], size), 0
    for j, i in pixels(size):
        sums, total = 0.0, 0.0
        for r, c in NINE:
            w = math.exp(-0.5 * (r * r + c * c) / DEFAULTS.antialiasing_sigma**2)
            w *= at(light, i + c, j + r)[3] if at(high["object_id"], i + c, j + r)[0] > 0 else 0
            sums, total = sums + w * at(light, i + c, j + r)[:3], total + w
        alone += total == 0
        expected = sums / total if total else light[j, i, :3]
        assert np.abs(got[j, i] - expected).max() < 3 * 20 * EPSILON
        assert lit[j, i, 0] == (1 if total else light[j, i, 3])
    assert alone < 20


def test_a_thing_that_no_lr_sample_hits_shows_what_is_behind_it():
    """All LR pixels are sky; HR knows a wire that LR colour has not: its own light is not known, and black it is not."""
    low, high = channels_of(LR), channels_of((14, 10))
    for channels in (low, high):
        channels["object_id"][:], channels["brdf"][:] = 0, 0
    low["color"][:], low["emission"][:], high["emission"][:] = 0.7, 0.7, 0.7
    high["object_id"][:, 6], high["brdf"][:, 6], high["emission"][:, 6] = 1, 0.5, 0
    frame = frame_of((14, 10), (0.3, -0.4), lr=low, hr=high)
    for planes in (guided(frame, DEFAULTS), guided_temporal(None, frame, DEFAULTS)[1]):
        got = pictured(planes, (14, 10))
        assert np.abs(got - 0.7).max() < 8 * EPSILON


@pytest.mark.parametrize("layers", [(), ("transparency",), ("overlay",), ("transparency", "overlay")])
def test_what_layers_cover_is_the_bicubic_colour(layers):
    lr, size, jitter = LR, (14, 11), (0.3, -0.4)
    covers = {name: image_of(11, 14, 1, low=-0.5, high=1.5) for name in layers}
    color, below = image_of(5, 7, 3), image_of(11, 14, 3)
    frame = frame_of(size, jitter, lr={"color": color}, hr=covers)
    got, where = pictured(over_layers(list(to_image(below).planes), frame), size), places(lr, size, jitter)
    for j, i in pixels(size):
        share = min(max([0.0, *(float(cover[j, i, 0]) for cover in covers.values())]), 1)
        expected = (1 - share) * below[j, i] + share * slow_filtered(color, *where[j, i], 2, slow_cubic)
        assert np.abs(got[j, i] - expected).max() < 12 * PLACE  # slopes below 2 x 3 per pixel and axis


LIGHT = np.array([0.75, 2.0, 5.0])
# color, brdf >= 0.05 and emission <= 1 are rounded, and color - emission <= 6: light errs by 4 x 6 epsilon / 0.05 at most, and
# 18 sums of each kind round
CONSTANT = 5 * (24 / 0.05 / 5 + 36) * EPSILON


def relit(high):
    return LIGHT * high["brdf"] + high["emission"]


@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
def test_constant_light_comes_back_exactly_under_any_material(lr, size, jitter):
    """Speckled objects, normals and depths, and single background pixels among them."""
    frame, low, high = guided_frame(lr, size, jitter, LIGHT)
    got = pictured(guided(frame, DEFAULTS), size)
    assert np.abs(got - relit(high)).max() < CONSTANT
    assert np.array_equal(got[high["object_id"][..., 0] == 0], high["emission"][high["object_id"][..., 0] == 0])


def test_constant_light_beside_the_sky_loses_nothing():
    low, high = channels_of(LR, LIGHT), channels_of((14, 10), LIGHT)
    for channels, top in ((low, 3), (high, 6)):
        channels["object_id"][:top] = 0
        channels["brdf"][:top] = 0
        channels["color"][:top] = channels["emission"][:top]
    frame = frame_of((14, 10), (0.3, -0.4), lr=low, hr=high)
    got = pictured(guided(frame, DEFAULTS), (14, 10))
    assert np.abs(got - relit(high)).max() < CONSTANT
    assert np.array_equal(got[:5], high["emission"][:5])


def test_without_demodulation_colours_are_mixed():
    """A constant colour stays; a constant light does not."""
    frame, low, high = guided_frame(LR, (14, 11), (0.3, -0.4))
    constant = replace(frame, lr={**frame.lr, "color": to_image(np.full((5, 7, 3), 0.75, np.float32))})
    assert np.abs(pictured(guided(constant, DEFAULTS, demodulated=False), (14, 11)) - 0.75).max() < 20 * EPSILON
    frame, low, high = guided_frame(LR, (14, 11), (0.3, -0.4), LIGHT)
    assert np.abs(pictured(guided(frame, DEFAULTS, demodulated=False), (14, 11)) - relit(high)).max() > 0.5


# Methods over several frames


@pytest.mark.parametrize("method", [guided_temporal, guided_oracle])
@pytest.mark.parametrize(("lr", "size", "jitter"), CASES)
def test_constant_light_comes_back_from_history_too(method, lr, size, jitter):
    """Four frames of unrelated material and motion: means of colour and F_beta keep their ratio under any resampling."""
    history = None
    for k in range(4):
        turned = tuple(v * (1, -0.7, 0.4, -1)[k] for v in jitter)
        frame, _, high = guided_frame(lr, size, turned, LIGHT)
        history, planes = method(history, frame, DEFAULTS)
        # and once more per frame what history rounds by
        assert np.abs(pictured(planes, size) - relit(high)).max() < 4 * CONSTANT, k
    alone, _ = method(None, frame, DEFAULTS)
    remembered, fresh = (pictured(state.weight.planes, size).mean() for state in (history, alone))
    assert remembered > 1.05 * fresh


STEPS = {name: METHODS[name].step for name in METHODS}
REMEMBER = ("accumulate", "temporal", "oracle", "guided_temporal", "guided_oracle")


def sequence_of(name, count, lr=LR, size=(14, 11)):
    """Frames of all channels with as many jitters, exposures and cameras; HR G-buffers span their own size."""
    frames = []
    for k in range(count):
        jitter = (0.3 - 0.17 * k, -0.4 + 0.23 * k)
        frame, _, _ = guided_frame(
            lr, size, jitter, exposure=2.0 ** (k - 1), coefficients=(0.01 * k, -0.02, 1.0, 0.0, 0.0, 0.1 * k)
        )
        frames.append(frame)
    return frames


def states(history):
    """All planes of what is remembered, [height, width, components]."""
    names = ("color", "weight") if isinstance(history, Sums) else ("values", "weight", "variance")
    images = [getattr(history, name) for name in names]
    return np.concatenate([pictured(image.planes, (image.width, image.height)) for image in images], axis=-1)


@pytest.mark.parametrize("name", REMEMBER)
def test_after_a_reset_nothing_of_the_past_is_left(name):
    first, second, third = sequence_of(name, 3)
    alone, planes = STEPS[name](None, third, DEFAULTS)
    alone, planes = states(alone), pictured(planes, (14, 11))
    history, _ = STEPS[name](STEPS[name](None, first, DEFAULTS)[0], second, DEFAULTS)
    kept, other = STEPS[name](history, third, DEFAULTS)
    assert not np.array_equal(pictured(other, (14, 11)), planes) and not np.array_equal(states(kept), alone)
    again, shown = STEPS[name](None, third, DEFAULTS)
    assert np.array_equal(states(again), alone) and np.array_equal(pictured(shown, (14, 11)), planes)


def test_no_history_is_what_a_reset_starts_with():
    """An empty history of any surface, where nothing hides or is remembered, gives what None gives."""
    first, second = sequence_of("temporal", 2)
    remembered, _ = temporal(None, first, DEFAULTS)
    for step, planes, surface in ((temporal, 3, remembered.surface), (oracle, 3, None)):
        empty = no_history(planes, (14, 11), surface, first.jitter)
        assert np.all(states(empty) == 0) and empty.jitter == first.jitter
        (a, shown), (b, expected) = step(empty, second, DEFAULTS), step(None, second, DEFAULTS)
        assert np.array_equal(pictured(shown, (14, 11)), pictured(expected, (14, 11)))
        assert np.array_equal(states(a), states(b))


def kernels(history):
    return {entry["hash"] for entry in history if entry["type"] == dr.KernelType.JIT}


@pytest.mark.parametrize("name", METHODS)
def test_all_frames_run_the_kernels_of_the_first(name):
    """By hash: what earlier tests compiled is no excuse. Sizes, jitter, exposure, cameras and a reset are no other kernels."""
    found, history = [], None
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for k, frame in enumerate(sequence_of(name, 5) + sequence_of(name, 2, (5, 7), (9, 16))):
            dr.kernel_history_clear()
            history, planes = STEPS[name](None if k in (3, 5) else history, frame, DEFAULTS)
            dr.eval(planes)
            found.append(kernels(dr.kernel_history()))
    assert found[0] and all(later <= found[0] for later in found), [len(later - found[0]) for later in found]


# What comes in may be anything


ODD = (0.0, 1.0, -1.0, 1e6, -1e6, 1e30, math.nan, math.inf, -math.inf)


CHANNELS = ("color", "depth", "normal", "emission", "brdf", "motion", *LAYERS)
ODD_FRAME = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 1000),
        "exposure": st.sampled_from([2.0**-20, 1.0, 2.0**20]),
        "share": st.sampled_from([0.3, 1.0]),
        "values": st.lists(st.sampled_from(ODD), min_size=1, max_size=2),
        "odd_lr": st.sets(st.sampled_from(CHANNELS), max_size=3),
        "odd_hr": st.sets(st.sampled_from(CHANNELS), max_size=3),
    }
)


def odd_frame(lr, size, seed, exposure, share, values, odd_lr, odd_hr):
    """A frame of which some channels hold odd values, in a share of their numbers; finite as the reader makes it."""
    rng = np.random.default_rng(seed)
    RNG.bit_generator.state = rng.bit_generator.state
    made = []
    for (width, height), odd in ((lr, odd_lr), (size, odd_hr)):
        channels = channels_of((width, height))
        channels.update((name, image_of(height, width, 1)) for name in LAYERS)
        for name in sorted(odd):
            there = rng.choice(np.float32(values), channels[name].shape)
            channels[name] = np.where(rng.random(there.shape) < share, there, channels[name]).astype(np.float32)
        made.append({name: finite(name, channel) for name, channel in channels.items()})
    return frame_of(size, (0.3, -0.4), exposure, STANDS, *made)


@pytest.mark.parametrize("name", METHODS)
@given(
    lr=st.sampled_from([(1, 1), (3, 2), (1, 4)]),
    scale=st.sampled_from([(1, 1), (16, 16), (2, 3)]),
    recipes=st.lists(ODD_FRAME, min_size=2, max_size=3),
)
@examples(max_examples=40, deadline=None, derandomize=True, database=None)
def test_whatever_comes_in_what_comes_out_is_finite(name, lr, scale, recipes):
    size, history = (lr[0] * scale[0], lr[1] * scale[1]), None
    for recipe in recipes:
        history, planes = STEPS[name](history, odd_frame(lr, size, **recipe), DEFAULTS)
        assert np.isfinite(pictured(planes, size)).all()
        if history is not None:
            assert np.isfinite(states(history)).all() and states(history)[..., -1].min() >= 0  # weight or variance


def test_what_is_not_finite_is_replaced_as_stated():
    odd = np.float32([[[math.nan, math.inf, -math.inf, 0.5, 1e30]]])
    assert np.array_equal(finite("color", odd), np.float32([[[0, BRIGHTEST, -BRIGHTEST, 0.5, BRIGHTEST]]]))
    assert np.array_equal(finite("depth", odd), np.float32([[[1e30, 1e30, 1e-30, 0.5, 1e30]]]))
    assert np.array_equal(finite("motion", odd), np.float32([[[0, 1e6, -1e6, 0.5, 1e6]]]))
    ids = np.array([[[0, 2**32 - 1]]], np.uint32)
    assert finite("object_id", ids) is ids


@pytest.mark.parametrize("name", METHODS)
def test_black_stays_black(name):
    history = None
    for frame in sequence_of(name, 3):
        nothing = {channel: to_image(np.zeros((5, 7, 3), np.float32)) for channel in ("color", "emission")}
        dark = replace(
            frame, lr={**frame.lr, **nothing}, hr={**frame.hr, "emission": to_image(np.zeros((11, 14, 3), np.float32))}
        )
        history, planes = STEPS[name](history, dark, DEFAULTS)
        assert np.array_equal(pictured(planes, (14, 11)), np.zeros((11, 14, 3)))


# Measures


def test_warp_error_is_the_root_mean_square_over_what_was_seen():
    image, previous, motion = image_of(5, 7, 3, high=1), image_of(5, 7, 3, high=1), image_of(5, 7, 2, low=-2, high=2)
    bits = RNG.integers(0, 8, (5, 7, 1)).astype(np.uint32)
    got = warp_error(image, previous, to_image(motion), to_image(bits))
    squares = []
    for j, i in pixels(LR):
        if bits[j, i, 0] & 5 == 5:
            mx, my = motion[j, i].astype(float)
            squares.append((image[j, i] - slow_filtered(previous, i + 0.5 + mx, j + 0.5 + my, 2, slow_cubic)) ** 2)
    assert 3 < len(squares) < 30
    assert got == pytest.approx(255 * math.sqrt(np.mean(squares)), rel=4 * PLACE + 40 * EPSILON)
    assert warp_error(image, previous, to_image(motion), to_image(bits & np.uint32(3))) is None
    assert warp_error(image, image, to_image(np.zeros((5, 7, 2), np.float32)), to_image(bits | np.uint32(5))) == 0


def test_change_error_by_hand():
    before, after = np.float32([[[0.5, 0.25, 0]]]), np.float32([[[0.75, 0.25, 1]]])
    truth_before, truth_after = np.float32([[[0.1, 0.5, 0]]]), np.float32([[[0.35, 0.75, 0.5]]])
    assert change_error(after, before, truth_after, truth_before) == pytest.approx((0 + 0.25**2 + 0.5**2) / 3, abs=8 * EPSILON)
    assert change_error(after, before, after + np.float32(0.25), before + np.float32(0.25)) == 0


def test_the_deviation_is_numpys_over_all_frames():
    stack = image_of(6, 5, 7, 3, high=1)
    running = Deviation()
    for k, image in enumerate(stack):
        assert (running.result() is None) == (k < 2)
        running.add(image)
    assert running.result() == pytest.approx(255 * np.std(stack.astype(float), axis=0).mean(), rel=1e-12)


class FakeCorpus:
    """A sequence by its frames: {number: (reset, moves)}."""

    def __init__(self, frames, channels=("motion",), constants=()):
        self.entries, self.entry = frames, SimpleNamespace(channels=channels, constants=dict.fromkeys(constants))

    def sequence(self, _):
        return self.entry

    def frames(self, _):
        return sorted(self.entries)

    def record(self, _, frame):
        return SimpleNamespace(reset=self.entries[frame][0])

    def read(self, sequence, stream, channel, frame):
        assert (stream, channel) == ("hr", "motion")
        return np.full((5, 7, 2), 1e-3 * self.entries[frame][1], np.float32)


def test_still_shots_end_where_something_moves_a_cut_is_or_a_frame_misses():
    still, moves, cut = (False, False), (False, True), (True, False)
    frames = {0: cut, 1: still, 2: still, 3: moves, 4: moves, 5: still, 6: cut, 7: still, 9: still, 10: still}
    assert still_shots(FakeCorpus(frames), "s") == [[0, 1, 2], [4, 5], [6, 7], [9, 10]]
    assert still_shots(FakeCorpus(frames, (), ("motion",)), "s") == still_shots(FakeCorpus(frames), "s")
    assert still_shots(FakeCorpus(frames, ()), "s") == []


def test_settled_frames_are_the_later_half_of_shots_of_four_and_more():
    assert settled_frames([[0, 1, 2], [5, 6, 7, 8], [10, 11, 12, 13, 14]]) == [[7, 8], [12, 13, 14]]
