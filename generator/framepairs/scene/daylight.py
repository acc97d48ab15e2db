"""Sun and sky by the hour, made from numbers: the model of Preetham, Shirley and Smits, "A Practical Analytic Model for
Daylight", SIGGRAPH 1999, with clouds.

Radiance is linear Rec. 709 in relative units: what a clear sun 60 degrees up gives a surface that faces it has luminance
4.5, as in the bundled scenes; sun and sky share the unit. Direction: y up, azimuth from +z towards +x.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .clouds import cloud_layer, smooth
from .mitsuba_spectra import REC709_FROM_XYZ, emission_of_spectrum

XYZ_FROM_REC709 = np.linalg.inv(REC709_FROM_XYZ)
CLEAR = 3.0  # turbidity of a clear day
NOON_DEG = 60.0
NOON_SUN = 4.5
SUN_KELVIN = 5778.0
SUN_KILOLUX = 128.0  # above the air
# Appendix A.2: the five coefficients of F (A to E), as slope and offset in turbidity, for Y, x and y.
PEREZ = np.array(
    [
        [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
        [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
        [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
    ]
)
# Appendix A.2: x and y at the zenith; rows by T^2, T, 1, columns by the sun's zenith angle^3, ^2, ^1, ^0.
ZENITH = np.array(
    [
        [[0.00166, -0.00375, 0.00209, 0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
        [[0.00275, -0.00610, 0.00317, 0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
    ]
)
# Table 2: absorption of ozone per cm, every 10 nm from 450 nm to 770 nm.
OZONE = """.003 .006 .009 .014 .021 .030 .040 .048 .063 .075 .085 .103 .120 .120 .115 .125 .120 .105 .090 .079 .067 .057 .048
    .036 .028 .023 .018 .014 .011 .010 .009 .007 .004"""
LEAST_TURBIDITY, LARGEST_TURBIDITY = 1.9, 10.0  # where the fits hold
GROUND = (0.2, 0.18, 0.15)  # albedo
OVERCAST = (0.55, 1.0)  # cover from which clouds stand before the sun, and at which none of it is left
OVERCAST_DIMS = 0.45  # of the light of clouds that cover everything
CLOUDS_SEE_DEG = 3.0  # clouds are high: they see the sun so much higher, and longer
FADING_DEG = 3.0  # below the horizon the sky loses a factor of 10 in so many degrees


def sun_direction(azimuth_deg: float, elevation_deg: float) -> NDArray[np.float64]:
    """Unit vector [3] to the sun, y up; azimuth from +z towards +x."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])


def sun_irradiance(elevation_deg: float, turbidity: float = CLEAR, clouds: float = 0.0) -> NDArray[np.float64]:
    """[3] of a surface that faces the sun, elevations -90 to 90 degrees, turbidity 1.9 to 10 (limited to that).

    What Rayleigh scattering, aerosol and ozone leave (appendix A.1); water vapour and mixed gases absorb beyond 680 nm and
    are left out. Fades to 0 around the horizon. clouds: share of the sky that they cover; above 0.55 they dim the sun.
    """
    above = smooth(-1.0, 0.6, np.array(elevation_deg)) * (1 - smooth(*OVERCAST, np.array(clouds)))
    return _sun_in_kilolux(max(elevation_deg, 0.0), _limited(turbidity)) * _unit() * above


def sky(
    to_sun: NDArray,
    turbidity: float = CLEAR,
    clouds: float = 0.0,
    seed: int = 0,
    *,
    ground: tuple[float, float, float] = GROUND,
    height: int = 256,
) -> NDArray[np.float32]:
    """[height, 2 height, 3] radiance, laid out as `Environment.texels`, without the sun itself.

    to_sun: unit, y up; below the horizon the sky fades. turbidity: 1.9 (clear) to 10 (haze). clouds: share of the sky that
    they cover, 0 to 1. seed: of the clouds. ground: albedo of what lies below the horizon, lit by sun and sky.
    """
    directions = _directions(height)
    elevation = float(np.degrees(np.arcsin(np.clip(to_sun[1], -1, 1))))
    clear = _clear_sky(directions, to_sun, _limited(turbidity)) * _unit() * 10 ** (min(elevation, 0) / FADING_DEG)
    ambient = irradiance(clear) / np.pi
    sun_of_clouds = sun_irradiance(elevation + CLOUDS_SEE_DEG * (1 - max(float(to_sun[1]), 0)), turbidity)
    colour = _with_clouds(clear, directions, to_sun, sun_of_clouds, ambient, clouds, seed)
    light = irradiance(colour) + sun_irradiance(elevation, turbidity, clouds) * max(float(to_sun[1]), 0)
    seen = smooth(-0.035, 0.012, directions[..., 1])[..., None]
    return (seen * colour + (1 - seen) * np.array(ground) * light / np.pi).astype(np.float32)


def irradiance(texels: NDArray) -> NDArray[np.float64]:
    """[3] that the upper half of a sky [height, 2 height, 3] gives a level surface."""
    height = len(texels)
    edges = np.linspace(0, np.pi, height + 1)
    lit = np.clip(np.sin(edges[1:]) ** 2 - np.sin(edges[:-1]) ** 2, 0, None) / 2  # integral of cosine and sine over a row
    return np.pi / height * np.einsum("h,hwc->c", lit, np.asarray(texels, dtype=np.float64))


def luminance(rgb: NDArray) -> NDArray:
    """Relative luminance Y of linear Rec. 709 [..., 3]."""
    return rgb @ XYZ_FROM_REC709[1]


def _limited(turbidity: float) -> float:
    return float(np.clip(turbidity, LEAST_TURBIDITY, LARGEST_TURBIDITY))


@lru_cache(maxsize=1)
def _unit() -> float:
    """Of this module, per kilolux."""
    return NOON_SUN / float(luminance(_sun_in_kilolux(NOON_DEG, CLEAR)))


def _sun_in_kilolux(elevation_deg: float, turbidity: float) -> NDArray[np.float64]:
    """Appendix A.1 with the black body at the sun's temperature above the air; optical mass of Kasten 1966."""
    mass = 1 / (np.sin(np.radians(elevation_deg)) + 0.15 * (3.885 + elevation_deg) ** -1.253)
    nanometres = np.arange(380.0, 781.0, 10.0)
    micrometres = nanometres / 1000
    ozone = np.interp(nanometres, np.arange(450.0, 771.0, 10.0), np.array(OZONE.split(), dtype=float), left=0, right=0)
    depth = 0.008735 * micrometres**-4.08 + (0.04608 * turbidity - 0.04586) * micrometres**-1.3 + 0.35 * ozone
    above = micrometres**-5 / np.expm1(14387.77 / (micrometres * SUN_KELVIN))
    arriving, whole = (
        np.array(emission_of_spectrum(np.stack([nanometres, spectrum], axis=1)))
        for spectrum in (above * np.exp(-depth * mass), above)
    )
    return SUN_KILOLUX * arriving / luminance(whole)


def _directions(height: int) -> NDArray[np.float64]:
    """Unit vectors [height, 2 height, 3] of the texels."""
    polar = (np.arange(height) + 0.5)[:, None] / height * np.pi
    azimuth = (0.5 - (np.arange(2 * height) + 0.5)[None, :] / (2 * height)) * 2 * np.pi
    parts = [np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth, np.sin(polar) * np.cos(azimuth)]
    return np.stack(parts, axis=-1)


def _clear_sky(directions: NDArray, to_sun: NDArray, turbidity: float) -> NDArray:
    """[..., 3] in kilocandela per square metre: equations 3 and 4 and appendix A.2, for a sun on the horizon where it is
    below; directions below the horizon have its radiance."""
    sun_angle = float(np.arccos(np.clip(to_sun[1], 0, 1)))
    cosine = np.maximum(directions[..., 1, None], 0.01)
    gamma = np.arccos(np.clip(directions @ to_sun, -1, 1))[..., None]
    a, b, c, d, e = np.moveaxis(PEREZ @ np.array([turbidity, 1.0]), 1, 0)

    def distribution(cosine, gamma):
        return (1 + a * np.exp(b / cosine)) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)

    zenith = np.array([_zenithluminance(sun_angle, turbidity), *_zenith_chromaticity(sun_angle, turbidity)])
    luminance, x, y = np.moveaxis(zenith * distribution(cosine, gamma) / distribution(1.0, sun_angle), -1, 0)
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1) * luminance[..., None]
    return np.maximum(xyz @ REC709_FROM_XYZ.T, 0)


def _zenithluminance(sun_angle: float, turbidity: float) -> float:
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * sun_angle)
    return (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192


def _zenith_chromaticity(sun_angle: float, turbidity: float) -> NDArray:
    return np.array([turbidity**2, turbidity, 1]) @ ZENITH @ np.array([sun_angle**3, sun_angle**2, sun_angle, 1])


def _with_clouds(clear, directions, to_sun, sun, ambient, cover: float, seed: int) -> NDArray:
    """The clear sky behind clouds [..., 3]: their lit sides scatter the sun's light like white surfaces, and forwards more;
    shaded sides have the sky's mean. Far ones take on the colour of the air before them."""
    opacity, light = cloud_layer(directions, to_sun, cover, seed)
    towards = np.maximum(directions @ to_sun, 0)
    dim = 1 - OVERCAST_DIMS * smooth(*OVERCAST, np.array(cover))
    forwards = (0.62 + 0.5 * towards**2 + 1.6 * towards**40)[..., None]
    shaded = 0.4 * ambient.mean() + 0.4 * ambient
    colour = dim * (shaded + light[..., None] * forwards * (sun / np.pi + 0.25 * ambient))
    air = 0.55 * (1 - smooth(0.02, 0.4, directions[..., 1]))[..., None] * (1 - 0.9 * smooth(*OVERCAST, np.array(cover)))
    colour = colour + air * (clear - colour)
    behind = clear * (1 - 0.8 * smooth(*OVERCAST, np.array(cover)))
    return behind + opacity[..., None] * (colour - behind)
