"""`guided`: one LR frame's lighting, upsampled by joint bilateral weights of HR G-buffers and given back its material.

Pass 7. Light is colour without emission over F_beta (NSRD 2024; FuseSR 2023); its weights follow Kopf et al. 2007, with the
HR pixel's plane, normal and object as guides. Where an edge mixes two surfaces, HR `brdf` and `emission` are means already,
so that only the lighting has to be mixed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..backend import dr, jit
from ..warp import Image, fetch
from .inputs import BRIGHTEST, LAYERS, UpscaleFrame
from .settings import UpscaleSettings
from .spatial import lr_places, neighbours, opaque, upscale
from .surfaces import NEIGHBOURS, border, pixel_indices
from .temporal import scales

LEAST_MATERIAL = 1e-6  # what F_beta counts with at least, as a divisor
LEAST_LIKENESS = 1e-4  # what a sample unlike the HR pixel counts with: light of another surface is better than none
LEAST_SUM = 1e-30  # of weighted material, as a divisor: weights of samples many pixels away leave the range of floats


@dataclass(frozen=True)
class Sample:
    """One of the 3x3 LR pixels around an HR pixel. column, row: in the LR image. dx, dy: its place minus the HR pixel's, LR
    pixels. reflected, material: colour without emission, and F_beta. surface: 1, or 0 for the background. likeness: (0, 1],
    to the HR pixel's surface. Both are 0 outside the image."""

    column: jit.Int32
    row: jit.Int32
    dx: jit.Float
    dy: jit.Float
    reflected: jit.Array3f
    material: jit.Array3f
    surface: jit.Float
    likeness: jit.Float


def guided(frame: UpscaleFrame, settings: UpscaleSettings, demodulated: bool = True) -> list:
    """Planes of the upscaled image, scene-linear. Without `demodulated` the colour itself is upsampled by the same weights,
    which shows what demodulation is worth."""
    spatial = opaque(-0.5 / settings.lighting_sigma**2)
    reflected, material = jit.Array3f(0), jit.Array3f(0)
    total = jit.Float(0)
    for sample in samples(frame, settings, demodulated):
        w = dr.exp(spatial * (dr.square(sample.dx) + dr.square(sample.dy))) * sample.likeness
        w *= sample.surface if demodulated else 1
        reflected, material = dr.fma(sample.reflected, w, reflected), dr.fma(sample.material, w, material)
        total += w
    if not demodulated:
        planes = list(reflected / total)
        dr.eval(planes)
        return planes
    lit = dr.select(total > LEAST_SUM, jit.Float(1), 0)
    light = Image((*lighting_of(reflected, material), lit), *frame.size)
    dr.eval(light.planes)
    mixed, lit = _mixed(light, frame, settings)
    shown = over_layers(remodulated(mixed, lit, frame), frame)
    dr.eval(shown)
    return shown


def samples(frame: UpscaleFrame, settings: UpscaleSettings, demodulated: bool = True) -> Iterator[Sample]:
    """The 3x3 `Sample`s of every HR pixel; without `demodulated`, reflected is the whole colour and material 1."""
    lr, hr = frame.lr, frame.hr
    across, down = scales(frame)
    closeness, slope_x, slope_y = _plane(hr["depth"])
    normal, identity = jit.Array3f(*hr["normal"].planes), hr["object_id"].planes[0]
    sharpness, power, other = (
        opaque(value) for value in (1 / settings.depth_tolerance, settings.normal_power, settings.other_object)
    )
    for near in neighbours(lr["color"], *lr_places(lr["color"], frame.size, frame.jitter)):
        a, b, dx, dy = near.column, near.row, near.dx, near.dy
        there = dr.rcp(fetch(lr["depth"], a, b)[0])
        expected = closeness + slope_x * dx * across + slope_y * dy * down
        off = (there - expected) / dr.maximum(there, closeness)
        alike = dr.exp(-dr.square(off * sharpness))
        alike *= dr.power(dr.clip(dr.dot(normal, jit.Array3f(*fetch(lr["normal"], a, b))), 0, 1), power)
        theirs = fetch(lr["object_id"], a, b)[0]
        alike *= dr.select(theirs == identity, 1, other)
        reflected, material = jit.Array3f(*fetch(lr["color"], a, b)), jit.Array3f(1)
        if demodulated:
            reflected -= jit.Array3f(*fetch(lr["emission"], a, b))
            material = dr.maximum(jit.Array3f(*fetch(lr["brdf"], a, b)), LEAST_MATERIAL)
        alike = dr.maximum(alike, LEAST_LIKENESS) * near.inside
        yield Sample(a, b, dx, dy, reflected, material, dr.select(theirs > 0, near.inside, 0), alike)


def lighting_of(reflected, material) -> jit.Array3f:
    """Sums of light over sums of material: at an edge this weighs each surface's lighting by its own material. 0 where no
    sample lies on a surface."""
    known = material > LEAST_SUM
    return dr.select(known, reflected / dr.select(known, material, 1), 0)


def remodulated(light, lit, frame: UpscaleFrame) -> list:
    """Planes of lighting times the HR F_beta, plus HR emission. Where `lit` is 0, no sample lies on a surface: what is too thin
    for LR shows the colour behind it, bilinear."""
    light = dr.clip(jit.Array3f(*light), -BRIGHTEST, BRIGHTEST)
    material, emission = (jit.Array3f(*frame.hr[name].planes) for name in ("brdf", "emission"))
    behind = jit.Array3f(*upscale(frame.lr["color"], "bilinear", frame.size, frame.jitter))
    return list(dr.select((lit > 0) | (dr.max(material) <= 0), light * material + emission, behind))


def over_layers(planes: list, frame: UpscaleFrame) -> list:
    """Where blended layers or an overlay cover the surface, which the G-buffers do not know, the bicubic colour instead."""
    layers = [frame.hr[name].planes[0] for name in LAYERS if name in frame.hr]
    if not layers:
        return planes
    covered = dr.clip(layers[0] if len(layers) == 1 else dr.maximum(*layers), 0, 1)
    plain = upscale(frame.lr["color"], "bicubic", frame.size, frame.jitter)
    return [dr.lerp(value, other, covered) for value, other in zip(planes, plain, strict=True)]


def _mixed(light: Image, frame: UpscaleFrame, settings: UpscaleSettings) -> tuple:
    """Lighting [3] under a Gaussian over those of 3x3 HR pixels that are surfaces and lit, which is what anti-aliasing mixes at
    an edge; and 1, or 0 where nothing is lit. light: [4], its last plane 1 where lit."""
    i, j = pixel_indices(*frame.size)
    narrow = -0.5 / settings.antialiasing_sigma**2
    sums, total = [jit.Float(0)] * 3, jit.Float(0)
    for column, row in NEIGHBOURS:
        *pixel, lit = fetch(light, i + column, j + row)
        surface = fetch(frame.hr["object_id"], i + column, j + row)[0] > 0
        w = opaque(math.exp(narrow * (column * column + row * row))) * dr.select(surface, lit, 0)
        sums = [dr.fma(w, value, so_far) for value, so_far in zip(pixel, sums, strict=True)]
        total += w
    *own, lit = light.planes
    sums = [dr.select(total > 0, value / dr.select(total > 0, total, 1), alone) for value, alone in zip(sums, own, strict=True)]
    return sums, dr.select(total > 0, 1, lit)


def _plane(depth: Image) -> tuple:
    """1 / depth, which is linear over the pixels of a plane, and its change per HR pixel to the right and down: the smaller of
    both sides', so that it stays on the surface."""
    i, j = pixel_indices(depth.width, depth.height)
    here = dr.rcp(depth.planes[0])

    def change(column: int, row: int):
        after = dr.rcp(fetch(depth, i + column, j + row)[0]) - here
        before = here - dr.rcp(fetch(depth, i - column, j - row)[0])
        first, last = border(depth, i, j, column)
        return dr.select(~last & (first | (dr.abs(after) < dr.abs(before))), after, before)

    return here, change(1, 0), change(0, 1)
