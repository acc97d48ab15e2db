"""Light from infinitely far away, ready for shading: the sky itself, its irradiance, and its GGX-filtered levels.

The split sum (Karis 2013): specular light is filtered(reflection, roughness) times (F0 A + F90 B), where the filter takes the
lobe seen along the normal. Irradiance is nine spherical harmonics (Ramamoorthi and Hanrahan 2001), exact for the light's
first three bands.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from .backend import dr, mi, opaque
from .brdf import alpha_of, ggx, ggx_half_vector
from .conventions import BrdfModel
from .scene.description import Environment, Texture
from .textures import TextureTable, build_textures, sample_finest, sample_level, sample_texture

LEVELS = 9  # roughness 0, 1/8, ... 1
FILTERED_SIZE = (64, 128)  # height, width of all levels but the first
FILTER_SAMPLES = 1024  # on a smooth sky within 0.4 % of the integral (tests/test_split_sum.py); 256 err up to 1.4 %
SH_ROWS = 128  # midpoints over this many rows integrate the nine basis functions to some 1e-4


@dataclass(frozen=True)
class Sky:
    """textures: index 0 is the sky, 1 ... LEVELS - 1 its filtered levels. harmonics: nine RGB coefficients of irradiance
    / pi in environment axes. rows: environment_from_world. brightness: density over the image from which `sample_sky`
    draws. black: no light comes from the sky. gain: of the textures, which hold at most a half's 65504."""

    textures: TextureTable
    harmonics: tuple[mi.Color3f, ...]
    rows: tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f]
    brightness: mi.MarginalContinuous2D0
    black: bool
    gain: mi.Float


def build_sky(environment: Environment, model: BrdfModel) -> Sky:
    rows = environment.world_from_environment.T
    gain = max(1.0, float(environment.texels.max(initial=0)) / 65504)
    scaled = replace(environment, texels=environment.texels / np.float32(gain))
    source = _texture("sky", scaled.texels)
    alone = build_textures((source,))
    steps = [level / (LEVELS - 1) for level in range(1, LEVELS)]
    filtered = [_texture(f"sky {step}", _filtered(alone, scaled, model, step)) for step in steps]
    return Sky(
        textures=build_textures((source, *filtered)),
        harmonics=tuple(opaque(mi.Color3f, c) for c in _irradiance_harmonics(environment.texels)),
        rows=tuple(opaque(mi.Vector3f, row) for row in rows),
        brightness=mi.MarginalContinuous2D0(_brightness(environment.texels)),
        black=not environment.texels.any(),
        gain=dr.opaque(mi.Float, gain),
    )


def sky_radiance(
    sky: Sky, direction: mi.Vector3f, ddx: mi.Vector3f, ddy: mi.Vector3f, active: mi.Bool
) -> mi.Color3f:
    """Radiance [3] along a world direction, filtered for a pixel with these direction derivatives."""
    local, uv = _place(sky, direction)
    moved = (_place(sky, direction + change)[1] - uv for change in (ddx, ddy))
    wrapped = [mi.Vector2f(d.x - dr.round(d.x), d.y) for d in moved]  # across the seam, u jumps by one
    return sky.gain * _rgb(sample_texture(sky.textures, mi.UInt32(0), uv, *wrapped, mi.Float(0), active))


def sample_sky(sky: Sky, u: mi.Point2f) -> tuple[mi.Vector3f, mi.Color3f, mi.Float]:
    """(world direction, radiance [3], density per solid angle) of light drawn by its brightness, with u in [0, 1)^2."""
    place, _ = sky.brightness.sample(u)
    theta, azimuth = place.y * dr.pi, (0.5 - place.x) * dr.two_pi
    sine = dr.sin(theta)
    local = mi.Vector3f(sine * dr.sin(azimuth), dr.cos(theta), sine * dr.cos(azimuth))
    direction = sum(sky.rows[k] * local[k] for k in range(3))
    radiance, density = sky_along(sky, direction, mi.Bool(True))
    return direction, radiance, density


def sky_along(sky: Sky, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
    """(radiance [3] along a world direction, unfiltered; density per solid angle with which `sample_sky` gives it)."""
    local, uv = _place(sky, direction)
    per_area = sky.brightness.eval(mi.Point2f(uv.x, 1 - uv.y), active=active)
    sine = dr.safe_sqrt(1 - dr.square(local.y))
    density = per_area / dr.maximum(2 * dr.square(dr.pi) * sine, 1e-6)
    return sky.gain * _rgb(sample_finest(sky.textures, mi.UInt32(0), uv, active)), density


def diffuse_light(sky: Sky, normal: mi.Vector3f) -> mi.Color3f:
    """Irradiance / pi [3] on a surface with world normal `normal`, never negative."""
    n, _ = _place(sky, normal)
    total = mi.Color3f(0)
    for basis, coefficient in zip(_basis(n.x, n.y, n.z), sky.harmonics, strict=True):
        total += basis * coefficient
    return dr.maximum(total, 0)


def specular_light(sky: Sky, reflection: mi.Vector3f, roughness: mi.Float, active: mi.Bool) -> mi.Color3f:
    """Sky radiance [3] filtered by the GGX lobe of `roughness` around the mirror direction."""
    _, uv = _place(sky, reflection)
    place = dr.clip(roughness, 0, 1) * (LEVELS - 1)
    below = dr.minimum(mi.UInt32(place), LEVELS - 2)
    finer, coarser = (sample_finest(sky.textures, level, uv, active) for level in (below, below + 1))
    return sky.gain * _rgb(dr.lerp(finer, coarser, place - mi.Float(below)))


def _place(sky: Sky, direction: mi.Vector3f) -> tuple[mi.Vector3f, mi.Point2f]:
    """Unit direction in environment axes, and its uv (v up) in the latitude-longitude image."""
    unit = dr.normalize(direction)
    local = mi.Vector3f(*(dr.dot(row, unit) for row in sky.rows))
    return local, _uv(local)


def _uv(unit: mi.Vector3f) -> mi.Point2f:
    return mi.Point2f(0.5 - dr.atan2(unit.x, unit.z) * dr.inv_two_pi, 1 - dr.safe_acos(unit.y) * dr.inv_pi)


def _filtered(table: TextureTable, environment: Environment, model: BrdfModel, roughness: float) -> np.ndarray:
    """[64, 128, 3]: the mean of the sky over GGX half vectors around each direction, weighted by the cosine.

    One texel where the sky is constant. Hammersley samples; each looks up the level whose texels subtend as much as the
    sample stands for.
    """
    if np.array_equal(environment.texels, np.broadcast_to(environment.texels[:1, :1], environment.texels.shape)):
        return environment.texels[:1, :1]
    height, width = FILTERED_SIZE
    index = dr.arange(mi.UInt32, height * width)
    theta = (mi.Float(index // width) + 0.5) / height * dr.pi
    azimuth = (0.5 - (mi.Float(index % width) + 0.5) / width) * 2 * dr.pi
    axis = mi.Vector3f(dr.sin(theta) * dr.sin(azimuth), dr.cos(theta), dr.sin(theta) * dr.cos(azimuth))
    texel_angle = 4 * math.pi / (environment.texels.shape[0] * environment.texels.shape[1])
    count = dr.opaque(mi.UInt32, FILTER_SAMPLES)

    mean = _lobe_mean(table, mi.Frame3f(axis), axis, alpha_of(model, dr.opaque(mi.Float, roughness)), texel_angle, count)
    return np.moveaxis(np.array(mean).reshape(3, height, width), 0, 2)


@dr.syntax
def _lobe_mean(
    table: TextureTable, frame: mi.Frame3f, axis: mi.Vector3f, alpha: mi.Float, texel_angle: float, count: mi.UInt32
) -> mi.Color3f:
    k, total, weights = mi.UInt32(0), mi.Color3f(0), mi.Float(0)
    while dr.hint(k < count, exclude=[table]):
        half = frame.to_world(ggx_half_vector(k, count, alpha))
        cos_h = dr.dot(half, axis)
        light = 2 * cos_h * half - axis
        weight = dr.maximum(dr.dot(axis, light), 0)
        density = ggx(dr.squared_norm(dr.cross(half, axis)), alpha) / 4  # of light's directions, the view along the normal
        level = 0.5 * dr.log2(1 / (mi.Float(count) * density * texel_angle))
        texel = sample_level(table, mi.UInt32(0), _uv(light), level, weight > 0)
        total += weight * _rgb(texel)
        weights += weight
        k += 1
    return total / weights


def _brightness(texels: np.ndarray) -> np.ndarray:
    """[rows + 1, columns + 1] at the corners of the texels: mean radiance times the sine of the angle from the pole, and a
    thousandth of the mean everywhere, so that no direction that shines has density 0."""
    mean = np.maximum(texels, 0).mean(axis=-1, dtype=np.float64)
    padded = np.pad(np.pad(mean, ((1, 1), (0, 0)), mode="edge"), ((0, 0), (1, 1)), mode="wrap")
    corners = (padded[:-1, :-1] + padded[1:, :-1] + padded[:-1, 1:] + padded[1:, 1:]) / 4
    sine = np.sin(np.arange(len(corners)) / (len(corners) - 1) * np.pi)
    weighted = corners * sine[:, None]
    return (weighted + max(1e-3 * float(weighted.mean()), 1e-20)).astype(np.float32)


def _irradiance_harmonics(texels: np.ndarray) -> np.ndarray:
    """[9, 3] coefficients of irradiance / pi: the projection of radiance times the cosine lobe's 1, 2/3 and 1/4."""
    finer = max(1, -(-SH_ROWS // texels.shape[0]))  # a coarse sky is integrated as what it is: constant within texels
    texels = texels.repeat(finer, axis=0).repeat(finer, axis=1)
    height, width = texels.shape[:2]
    theta = (np.arange(height) + 0.5) / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    x, z = np.sin(theta)[:, None] * np.sin(azimuth), np.sin(theta)[:, None] * np.cos(azimuth)
    y = np.cos(theta)[:, None] * np.ones(width)
    # the exact solid angle of each row of texels
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    solid_angle = (edges[:-1] - edges[1:]) * 2 * np.pi / width
    lobe = [1.0] + [2 / 3] * 3 + [1 / 4] * 5
    return np.array(
        [
            factor * np.einsum("hw,h,hwc->c", basis * np.ones_like(x), solid_angle, texels.astype(float))
            for factor, basis in zip(lobe, _basis(x, y, z), strict=True)
        ]
    )


def _basis(x, y, z) -> tuple:
    """The nine real spherical harmonics of bands 0 to 2 at a unit vector."""
    return (
        0.28209479177387814,
        0.4886025119029199 * y,
        0.4886025119029199 * z,
        0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        1.0925484305920792 * y * z,
        0.31539156525252005 * (3 * z * z - 1),
        1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y),
    )


def _texture(name: str, rgb: np.ndarray) -> Texture:
    texels = np.concatenate([np.minimum(rgb, 65504), np.ones_like(rgb[..., :1])], axis=-1).astype(np.float32)
    return Texture(name=name, texels=texels, srgb=False, wrap=("repeat", "clamp"))


def _rgb(rgba: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(rgba.x, rgba.y, rgba.z)
