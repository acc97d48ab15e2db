"""`temporal`: jittered LR frames accumulated along motion, with colours rectified; and `oracle`, which is told what is exact.

Passes 1 to 6 after FSR 2.2 (AMD 2023), Karis 2014 and Salvi 2016; the kernel and what is known over time are ours. `oracle`
replaces dilated LR motion and the test of depths by HR motion and the corpus' visibility: what is lost between the two is
the heuristics' fault, and what `oracle` loses against the truth is the data's or the method's.
"""

from dataclasses import dataclass

from ..backend import dr, jit
from ..channels import seen_before
from ..colour import ycocg_from_rgb
from ..warp import Image, bilinear, catmull_rom, fetch, pixel_centres, range_around
from .inputs import FAR, UpscaleFrame
from .light_changes import light_changed
from .neighbourhood import neighbourhood, sample_sigma
from .rectification import compress, expand, half_sizes, rectify
from .settings import UpscaleSettings
from .spatial import Jitter, lr_places, opaque
from .surfaces import dilate, hidden

LEAST_AXIS = 1e-5  # of the ellipsoid, after exposure


@dataclass(frozen=True)
class History:
    """HR: values [3, or 6 for `guided_temporal`], weight [1], variance [1] of compressed luma over time. surface: the frame's
    depth and motion [3], dilated LR for `temporal`, HR for `guided_temporal`, none for oracles; jitter: of the surface."""

    values: Image
    weight: Image
    variance: Image
    surface: Image | None = None
    jitter: Jitter = (0.0, 0.0)


@dataclass(frozen=True)
class Carried:
    """History at the place where each HR pixel's surface was: values, weight and variance, 0 where it was not seen. speed: HR
    pixels per frame. trust: share of history that may be believed."""

    values: list
    weight: jit.Float
    variance: jit.Float
    speed: jit.Float
    trust: jit.Float


def no_history(planes: int, size: tuple[int, int], surface: Image | None = None, jitter: Jitter = (0.0, 0.0)) -> History:
    """What precedes a frame after a cut: the same kernels run on it. surface: what the frame's own is like."""
    width, height = size
    empty = [dr.opaque(jit.Float, 0, width * height) for _ in range(planes + 2)]
    images = [Image(tuple(part), width, height) for part in (empty[:planes], empty[-2:-1], empty[-1:])]
    if surface is not None:  # an array of its own: one array that is given twice makes another kernel
        nowhere = tuple(dr.opaque(jit.Float, value, surface.width * surface.height) for value in (FAR, 0, 0))
        surface = Image(nowhere, surface.width, surface.height)
    return History(*images, surface, jitter)


def temporal(history: History | None, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple[History, list]:
    """Add one frame (None: after a reset): what is remembered now, and the upscaled image's planes, scene-linear."""
    color = frame.lr["color"]
    surface = dilate(frame.lr["depth"], frame.lr["motion"])
    history = history or no_history(3, frame.size, surface, frame.jitter)
    covered = hidden(surface, history.surface, frame.jitter, history.jitter, frame.previous_depth, settings)
    x, y = lr_places(color, frame.size, frame.jitter)
    i, j = jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y))
    scale = scales(frame)
    moved = [value * factor for value, factor in zip(fetch(surface, i, j)[1:], scale, strict=True)]
    changed = light_changed(color, history.values, frame.jitter, frame.exposure, settings)
    speed = dr.sqrt(dr.square(moved[0]) + dr.square(moved[1]))
    trust = (1 - fetch(covered, i, j)[0]) * (1 - fetch(changed, i, j)[0] * dr.maximum(1 - speed, 0))
    carried = carry(history, frame.size, moved, trust, opaque(settings.most_moving))
    return _blended(carried, frame, (x, y), scale, (surface, frame.jitter), settings, exact=False)


def oracle(history: History | None, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple[History, list]:
    """As `temporal`, with HR `motion` and `visibility` of `frame.hr`. What stands still is remembered without end."""
    color = frame.lr["color"]
    history = history or no_history(3, frame.size)
    carried = carry(history, frame.size, frame.hr["motion"].planes, seen(frame), opaque(settings.most_moving))
    places = lr_places(color, frame.size, frame.jitter)
    return _blended(carried, frame, places, scales(frame), (), settings, exact=True)


def scales(frame: UpscaleFrame) -> tuple:
    """HR pixels per LR pixel, per axis."""
    color = frame.lr["color"]
    return tuple(opaque(hr / lr) for hr, lr in zip(frame.size, (color.width, color.height), strict=True))


def seen(frame: UpscaleFrame):
    """1 where the previous camera saw the HR pixel's surface, else 0."""
    return dr.select(seen_before(frame.hr["visibility"].planes[0]), jit.Float(1), 0)


def carry(history: History, size: tuple[int, int], motion, trust, most_moving) -> Carried:
    """History at each HR pixel plus its motion [2], HR pixels: Catmull-Rom, between the least and greatest of the four pixels
    around it (pass 4). What lies outside is not known; a surface that moves is remembered with weight `most_moving`."""
    width, height = size
    x, y = pixel_centres(width, height)
    x, y = x + motion[0], y + motion[1]
    outside = (x < 0) | (y < 0) | (x > opaque(width)) | (y > opaque(height))
    speed = dr.sqrt(dr.square(motion[0]) + dr.square(motion[1]))
    trust = dr.select(outside, 0, trust)
    weight = bilinear(history.weight, x, y)[0]
    weight = dr.select(speed > 0, dr.minimum(weight, most_moving), weight) * trust
    return Carried(_limited(history.values, x, y), weight, bilinear(history.variance, x, y)[0] * trust, speed, trust)


def ellipsoid(carried: Carried, around, exposure: float, settings: UpscaleSettings, exact: bool) -> jit.Array3f:
    """Half axes in YCoCg within which history is believed (pass 5): LEAST_AXIS of what is shown white, at least."""
    if exact:
        sigmas, share = opaque(settings.moving_sigmas), opaque(settings.oracle_sigmas)
    else:
        unsure = dr.maximum(dr.minimum(carried.speed * opaque(1 / settings.fast), 1), 1 - carried.trust)
        sigmas, share = dr.lerp(opaque(settings.still_sigmas), opaque(settings.moving_sigmas), unsure), 0
    known = opaque(settings.temporal_sigmas) * dr.maximum(1 - carried.speed, share) * dr.sqrt(carried.variance)
    return half_sizes(around.deviation, sigmas, opaque(settings.luma_factor), known, opaque(LEAST_AXIS / exposure))


def believed(old, carried: Carried, around, exposure: float, settings: UpscaleSettings, exact: bool) -> tuple:
    """History, compressed RGB, rectified by what is around, and how far outside it was (`rectify`). With `exact`, what stands
    still and was seen is the same surface, and stays: only its light may have changed."""
    kept, beyond = rectify(old, around.mean, ellipsoid(carried, around, exposure, settings, exact))
    if not exact:
        return kept, beyond
    still = carried.speed <= 0
    return dr.select(still, old, kept), dr.select(still, 1, beyond)


def next_variance(carried: Carried, weight, sample, sample_weight, old, settings: UpscaleSettings):
    """Variance over time of compressed luma, after samples (compressed RGB) of a weight; 0 where history has none left."""
    changed = dr.square(ycocg_from_rgb(sample)[0] - ycocg_from_rgb(old)[0])
    variance = dr.lerp(carried.variance, changed, dr.minimum(sample_weight * opaque(settings.memory), 1))
    return dr.select(weight > 0, dr.maximum(variance, 0), 0)


def _blended(carried, frame, places, scale, facts, settings, exact: bool) -> tuple[History, list]:
    """Pass 6: the present samples and what is carried, by weight, in compressed light. facts: for its History."""
    color, (width, height) = frame.lr["color"], frame.size
    # What stands still is a plain mean, which is what the truth is.
    strength = opaque(settings.compression * frame.exposure) * dr.minimum(carried.speed, 1)
    sigma = sample_sigma(carried.speed, settings.still_sigma, settings.moving_sigma)
    around = neighbourhood(color, *places, scale, sigma, strength, settings)
    old = compress(jit.Array3f(*carried.values), strength)
    kept, beyond = believed(old, carried, around, frame.exposure, settings, exact)
    weight = carried.weight / beyond
    total = weight + around.weight
    value = (kept * weight + around.color * around.weight) / total
    now = opaque(settings.current) * dr.maximum(1 - weight * opaque(1 / settings.current_until), 0)
    bicubic = dr.clip(compress(jit.Array3f(*catmull_rom(color, *places)), strength), around.low, around.high)
    shown = expand((value * total + bicubic * now) / (total + now), strength)
    value = expand(value, strength)

    variance = next_variance(carried, weight, around.color, around.weight, old, settings)
    most = opaque(1e6 if exact else settings.most_still)
    total = dr.minimum(total, most)
    dr.eval(value, shown, variance, total)
    images = (Image(tuple(part), width, height) for part in (value, (total,), (variance,)))
    return History(*images, *facts), list(shown)


def _limited(image: Image, x, y) -> list:
    bounds = zip(catmull_rom(image, x, y), *range_around(image, x, y), strict=True)
    return [dr.clip(value, low, high) for value, low, high in bounds]
