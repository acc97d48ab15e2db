"""`guided_temporal`: lighting accumulated along motion under HR guides; and `guided_oracle`, which is told what is exact.

Remembered are, per HR pixel, the means of colour without emission and of F_beta over the same samples. Their ratio is the
lighting, also at edges, and it needs few samples, because light varies less than material; HR F_beta and emission of the
present frame are put on it last, so that resampling never blurs a texture.
"""

from dataclasses import dataclass

from ..backend import dr, jit
from ..colour import ycocg_from_rgb
from ..warp import Image, fetch
from .guided import LEAST_MATERIAL, LEAST_SUM, lighting_of, over_layers, remodulated, samples
from .inputs import BRIGHTEST, UpscaleFrame
from .light_changes import light_changed
from .neighbourhood import STATISTICS, sample_sigma
from .rectification import compress, expand
from .settings import UpscaleSettings
from .spatial import lr_places, opaque
from .surfaces import hidden
from .temporal import Carried, History, believed, carry, next_variance, no_history, scales, seen


def guided_temporal(history: History | None, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple[History, list]:
    """Add one frame (None: after a reset): what is remembered now, and the upscaled image's planes, scene-linear.

    An HR pixel moves as the LR sample that is most like its surface, and is new where the previous frame's HR depth shows
    something nearer.
    """
    motion = _upsampled_motion(frame, settings)
    surface = Image(frame.hr["depth"].planes + motion.planes, *frame.size)
    history = history or no_history(6, frame.size, surface)
    covered = hidden(surface, history.surface, (0, 0), (0, 0), frame.previous_depth, settings)
    changed = light_changed(_reflected(frame), history.values, frame.jitter, frame.exposure, settings)
    place = (jit.Int32(dr.floor(value)) for value in lr_places(frame.lr["color"], frame.size, frame.jitter))
    speed = dr.sqrt(dr.square(motion.planes[0]) + dr.square(motion.planes[1]))
    trust = (1 - covered.planes[0]) * (1 - fetch(changed, *place)[0] * dr.maximum(1 - speed, 0))
    carried = carry(history, frame.size, motion.planes, trust, opaque(settings.guided_most_moving))
    return _blended(carried, frame, (surface,), settings, exact=False)


def guided_oracle(history: History | None, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple[History, list]:
    """As `guided_temporal`, with HR `motion` and `visibility` of `frame.hr`."""
    history = history or no_history(6, frame.size)
    motion = frame.hr["motion"].planes
    carried = carry(history, frame.size, motion, seen(frame), opaque(settings.guided_most_moving))
    return _blended(carried, frame, (), settings, exact=True)


def _reflected(frame: UpscaleFrame) -> Image:
    """LR colour without emission."""
    color, emission = (frame.lr[name] for name in ("color", "emission"))
    planes = tuple(a - b for a, b in zip(color.planes, emission.planes, strict=True))
    return Image(planes, color.width, color.height)


def _upsampled_motion(frame: UpscaleFrame, settings: UpscaleSettings) -> Image:
    """HR motion [2], HR pixels: that of the LR sample with the greatest product of likeness and nearness."""
    best, column, row = jit.Float(-1), jit.Int32(0), jit.Int32(0)
    for sample in samples(frame, settings):
        near = sample.likeness * dr.exp(-2 * (dr.square(sample.dx) + dr.square(sample.dy)))
        better = near > best
        best = dr.select(better, near, best)
        column, row = dr.select(better, sample.column, column), dr.select(better, sample.row, row)
    moved = fetch(frame.lr["motion"], column, row)
    planes = tuple(value * factor for value, factor in zip(moved, scales(frame), strict=True))
    dr.eval(planes)
    return Image(planes, *frame.size)


@dataclass(frozen=True)
class _LightingAround:
    """Of the 3x3 samples of each HR pixel. reflected, material, weight: sums over those within about a pixel. light: by
    joint bilateral weights, lit: 0 where there is none. mean, deviation: of lighting, compressed YCoCg, on surfaces alike."""

    reflected: jit.Array3f
    material: jit.Array3f
    weight: jit.Float
    light: jit.Array3f
    lit: jit.Float
    mean: jit.Array3f
    deviation: jit.Array3f


def _lighting_around(frame: UpscaleFrame, speed, strength, settings: UpscaleSettings) -> _LightingAround:
    across, down = scales(frame)
    narrow = -0.5 / dr.square(sample_sigma(speed, settings.still_sigma, settings.guided_moving_sigma))
    spatial = opaque(-0.5 / settings.lighting_sigma**2)
    near_sums, near = [jit.Array3f(0), jit.Array3f(0)], jit.Float(0)
    alike_sums, alike = [jit.Array3f(0), jit.Array3f(0)], jit.Float(0)
    first, second, total = jit.Array3f(0), jit.Array3f(0), jit.Float(0)
    for sample in samples(frame, settings):
        pair, squared = (sample.reflected, sample.material), dr.square(sample.dx) + dr.square(sample.dy)
        w = dr.exp(narrow * (dr.square(sample.dx * across) + dr.square(sample.dy * down))) * sample.surface
        near_sums, near = [dr.fma(part, w, so_far) for part, so_far in zip(pair, near_sums, strict=True)], near + w
        w = dr.exp(spatial * squared) * sample.likeness * sample.surface
        alike_sums = [dr.fma(part, w, so_far) for part, so_far in zip(pair, alike_sums, strict=True)]
        alike += w
        w = dr.exp(STATISTICS * squared) * sample.surface * dr.maximum(sample.likeness, 1e-2)
        light = dr.clip(sample.reflected / sample.material, -BRIGHTEST, BRIGHTEST)
        ycocg = ycocg_from_rgb(compress(light, strength))
        first, second, total = dr.fma(ycocg, w, first), dr.fma(dr.square(ycocg), w, second), total + w
    over = dr.rcp(dr.maximum(total, 1e-8))
    mean = first * over
    deviation = dr.sqrt(dr.maximum(second * over - dr.square(mean), 0))
    lit = dr.select(alike > LEAST_SUM, jit.Float(1), 0)
    return _LightingAround(*near_sums, near, lighting_of(*alike_sums), lit, mean, deviation)


def _blended(carried: Carried, frame: UpscaleFrame, facts, settings: UpscaleSettings, exact: bool) -> tuple[History, list]:
    width, height = frame.size
    strength = opaque(settings.compression * frame.exposure)
    around = _lighting_around(frame, carried.speed, strength, settings)

    old_reflected, old_material = jit.Array3f(*carried.values[:3]), jit.Array3f(*carried.values[3:])
    old_light = compress(old_reflected / dr.maximum(old_material, LEAST_MATERIAL), strength)
    kept, beyond = believed(old_light, carried, around, frame.exposure, settings, exact)
    weight = carried.weight / beyond
    old_reflected = dr.select(beyond > 1, expand(kept, strength) * old_material, old_reflected)

    total = weight + around.weight
    known = total > LEAST_SUM
    over = dr.select(known, dr.rcp(dr.select(known, total, 1)), 0)
    reflected = (old_reflected * weight + around.reflected) * over
    material = (old_material * weight + around.material) * over
    bilateral = opaque(settings.guided) / (1 + total * opaque(settings.guided_decay))
    own = dr.maximum(jit.Array3f(*frame.hr["brdf"].planes), LEAST_MATERIAL) * bilateral
    own = dr.select(around.lit > 0, own, 0)
    light = lighting_of(dr.fma(around.light, own, reflected * total), dr.fma(material, total, own))
    lit = dr.select(known | (around.lit > 0), jit.Float(1), 0)
    shown = over_layers(remodulated(light, lit, frame), frame)

    sampled = compress(lighting_of(around.reflected, around.material), strength)
    variance = next_variance(carried, weight, sampled, around.weight, old_light, settings)
    total = dr.minimum(total, opaque(1e6 if exact else settings.most_still))
    dr.eval(reflected, material, total, variance, shown)
    images = (Image(tuple(part), width, height) for part in ((*reflected, *material), (total,), (variance,)))
    return History(*images, *facts), shown
