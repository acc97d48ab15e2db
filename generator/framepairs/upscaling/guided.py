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
from .inputs import UpscaleFrame
from .settings import UpscaleSettings
from .spatial import lr_places, opaque, upscale
from .surfaces import NEIGHBOURS, pixel_indices
from .temporal import scales

LEAST_MATERIAL = 1e-3  # what F_beta counts with at least, as a divisor
LEAST_LIKENESS = 1e-4  # what a sample unlike the HR pixel counts with, so that no surface is left without light


@dataclass(frozen=True)
class Sample:
    """One of the 3x3 LR pixels around an HR pixel. column, row: in the LR image. dx, dy: its place minus the HR pixel's, LR
    pixels. reflected, material: colour without emission, and F_beta. surface: 1, or 0 for the background. likeness: (0, 1],
    to the HR pixel's surface."""

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
    width, height = frame.size
    light = Image(tuple(lighting_of(reflected, material)), width, height)
    dr.eval(light.planes)
    shown = over_layers(list(remodulated(_mixed(light, frame, settings), frame)), frame)
    dr.eval(shown)
    return shown


def samples(frame: UpscaleFrame, settings: UpscaleSettings, demodulated: bool = True) -> Iterator[Sample]:
    """The 3x3 `Sample`s of every HR pixel; without `demodulated`, reflected is the whole colour."""
    lr, hr = frame.lr, frame.hr
    x, y = lr_places(lr["color"], frame.size, frame.jitter)
    across, down = scales(frame)
    i, j = jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y))
    closeness, slope_x, slope_y = _plane(hr["depth"])
    normal, identity = jit.Array3f(*hr["normal"].planes), hr["object_id"].planes[0]
    sharpness, power, other = (
        opaque(value) for value in (1 / settings.depth_tolerance, settings.normal_power, settings.other_object)
    )
    for column, row in NEIGHBOURS:
        a, b = i + column, j + row
        dx, dy = jit.Float(a) + 0.5 - x, jit.Float(b) + 0.5 - y
        there = dr.rcp(fetch(lr["depth"], a, b)[0])
        expected = closeness + slope_x * dx * across + slope_y * dy * down
        off = (there - expected) / dr.maximum(there, closeness)
        alike = dr.exp(-dr.square(off * sharpness))
        alike *= dr.power(dr.maximum(dr.dot(normal, jit.Array3f(*fetch(lr["normal"], a, b))), 0), power)
        theirs = fetch(lr["object_id"], a, b)[0]
        alike *= dr.select(theirs == identity, 1, other)
        reflected = jit.Array3f(*fetch(lr["color"], a, b))
        if demodulated:
            reflected -= jit.Array3f(*fetch(lr["emission"], a, b))
        material = dr.maximum(jit.Array3f(*fetch(lr["brdf"], a, b)), LEAST_MATERIAL)
        surface = dr.select(theirs > 0, jit.Float(1), 0)
        yield Sample(a, b, dx, dy, reflected, material, surface, dr.maximum(alike, LEAST_LIKENESS))


def lighting_of(reflected, material) -> jit.Array3f:
    """Sums of light over sums of material: at an edge this weighs each surface's lighting by its own material. 0 where no
    sample lies on a surface."""
    known = dr.max(material) > 0
    return dr.select(known, reflected / dr.select(known, material, 1), 0)


def remodulated(light, frame: UpscaleFrame) -> jit.Array3f:
    """Lighting times the HR F_beta, plus HR emission."""
    return jit.Array3f(*light) * jit.Array3f(*frame.hr["brdf"].planes) + jit.Array3f(*frame.hr["emission"].planes)


def over_layers(planes: list, frame: UpscaleFrame) -> list:
    """Where blended layers or an overlay cover the surface, which the G-buffers do not know, the bicubic colour instead."""
    layers = [frame.hr[name].planes[0] for name in ("transparency", "overlay") if name in frame.hr]
    if not layers:
        return planes
    covered = dr.clip(layers[0] if len(layers) == 1 else dr.maximum(*layers), 0, 1)
    plain = upscale(frame.lr["color"], "bicubic", frame.size, frame.jitter)
    return [dr.lerp(value, other, covered) for value, other in zip(planes, plain, strict=True)]


def _mixed(light: Image, frame: UpscaleFrame, settings: UpscaleSettings) -> list:
    """Lighting under a Gaussian over 3x3 HR pixels on surfaces: what anti-aliasing mixes at an edge."""
    i, j = pixel_indices(*frame.size)
    narrow = -0.5 / settings.antialiasing_sigma**2
    sums, total = [jit.Float(0)] * 3, jit.Float(0)
    for column, row in NEIGHBOURS:
        surface = fetch(frame.hr["object_id"], i + column, j + row)[0] > 0
        w = opaque(math.exp(narrow * (column * column + row * row))) * dr.select(surface, jit.Float(1), 1e-3)
        pixel = fetch(light, i + column, j + row)
        sums = [dr.fma(w, value, so_far) for value, so_far in zip(pixel, sums, strict=True)]
        total += w
    return [value / total for value in sums]


def _plane(depth: Image) -> tuple:
    """1 / depth, which is linear over the pixels of a plane, and its change per HR pixel to the right and down: the smaller of
    both sides', so that it stays on the surface."""
    i, j = pixel_indices(depth.width, depth.height)
    here = dr.rcp(depth.planes[0])

    def change(column: int, row: int):
        after = dr.rcp(fetch(depth, i + column, j + row)[0]) - here
        before = here - dr.rcp(fetch(depth, i - column, j - row)[0])
        return dr.select(dr.abs(after) < dr.abs(before), after, before)

    return here, change(1, 0), change(0, 1)
