"""Sun and sky made from numbers, against the paper's formulas written out, tables of daylight, and what a sky must be."""

import math
import time

import numpy as np
import pytest

from framepairs.scene.clouds import cloud_layer
from framepairs.scene.daylight import _directions, _unit, irradiance, luminance, sky, sun_direction, sun_irradiance

SINGLE = float(np.finfo(np.float32).eps)
REC709 = ((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560), (0.0556434, -0.2040259, 1.0572252))


def direction_of(row: int, column: int, height: int = 256) -> tuple[float, float, float]:
    """Of a texel's centre: u = 0.5 - atan2(x, z) / 2 pi, v = acos(y) / pi."""
    polar, azimuth = math.pi * (row + 0.5) / height, 2 * math.pi * (0.5 - (column + 0.5) / (2 * height))
    return math.sin(polar) * math.sin(azimuth), math.cos(polar), math.sin(polar) * math.cos(azimuth)


def preetham(direction, to_sun, turbidity: float) -> list[float]:
    """Linear Rec. 709, in kilocandela per square metre: appendix A.2 of the paper, one number at a time."""
    t, angle = turbidity, math.acos(to_sun[1])
    gamma = math.acos(sum(a * b for a, b in zip(direction, to_sun, strict=True)))
    chi = (4 / 9 - t / 120) * (math.pi - 2 * angle)
    zenith = [
        (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192,
        t**2 * (0.00166 * angle**3 - 0.00375 * angle**2 + 0.00209 * angle)
        + t * (-0.02903 * angle**3 + 0.06377 * angle**2 - 0.03202 * angle + 0.00394)
        + (0.11693 * angle**3 - 0.21196 * angle**2 + 0.06052 * angle + 0.25886),
        t**2 * (0.00275 * angle**3 - 0.00610 * angle**2 + 0.00317 * angle)
        + t * (-0.04214 * angle**3 + 0.08970 * angle**2 - 0.04153 * angle + 0.00516)
        + (0.15346 * angle**3 - 0.26756 * angle**2 + 0.06670 * angle + 0.26688),
    ]
    coefficients = (
        (0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703),
        (-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452),
        (-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529),
    )

    def shape(cosine, from_sun, a, b, c, d, e):
        return (1 + a * math.exp(b / cosine)) * (1 + c * math.exp(d * from_sun) + e * math.cos(from_sun) ** 2)

    luminous, x, y = (
        value * shape(direction[1], gamma, *five) / shape(1.0, angle, *five)
        for value, five in zip(zenith, coefficients, strict=True)
    )
    xyz = (luminous * x / y, luminous, luminous * (1 - x - y) / y)
    return [sum(m * v for m, v in zip(row, xyz, strict=True)) for row in REC709]


@pytest.mark.parametrize(("elevation", "turbidity"), [(60, 2.5), (25, 4), (8, 3)])
def test_a_clear_sky_is_the_papers(elevation, turbidity):
    to_sun = sun_direction(-50, elevation)
    texels = sky(to_sun, turbidity)
    for row, column in ((0, 0), (30, 100), (70, 300), (110, 511), (120, 250)):
        expected = _unit() * np.maximum(preetham(direction_of(row, column), to_sun, turbidity), 0)
        np.testing.assert_allclose(texels[row, column], expected, rtol=4 * SINGLE, atol=SINGLE)  # rounded once to float32


@pytest.mark.parametrize("elevation", [10, 20, 30, 60, 90])
def test_the_clear_sun_gives_what_tables_of_daylight_say(elevation):
    """IES RP-21-84: a clear sky's direct normal illuminance is 127.5 klx exp(-0.21 / sin(elevation)). The two models differ
    by up to 4.6 % (10 degrees) at turbidity 2, when this was written."""
    expected = 127.5 * math.exp(-0.21 / math.sin(math.radians(elevation)))
    assert float(luminance(sun_irradiance(elevation, 2.0))) / _unit() == pytest.approx(expected, rel=0.06)


def test_sun_and_sky_share_the_bundled_scenes_exposure():
    assert float(luminance(sun_irradiance(60))) == pytest.approx(4.5, rel=1e-12)
    mean = float(luminance(irradiance(sky(sun_direction(0, 60))))) / math.pi
    assert 0.4 < mean < 0.6  # the market's sky: 0.5 on average
    share = float(luminance(irradiance(sky(sun_direction(0, 60))))) / (4.5 * math.sin(math.radians(60)))
    assert 0.1 < share < 0.5  # skylight to sunlight on level ground, clear: 0.17 (IES) to 0.42 (Preetham, turbidity 3)


def test_a_low_sun_is_warm_and_fades():
    suns = [sun_irradiance(elevation) for elevation in (60, 30, 15, 8, 4)]
    warmth = [sun[0] / sun[2] for sun in suns]
    strength = [float(luminance(sun)) for sun in suns]
    assert warmth == sorted(warmth) and strength == sorted(strength, reverse=True)
    assert sun_irradiance(-1.5).tolist() == [0, 0, 0]
    means = [float(sky(sun_direction(0, elevation))[:128].mean()) for elevation in (20, 5, 0, -2.5, -5)]
    assert means == sorted(means, reverse=True) and means[-1] < 0.03 * means[0]


def test_it_is_finite_everywhere_it_may_be_asked():
    for elevation in (-5, -0.5, 0, 1, 45, 90):
        for turbidity in (1.9, 6, 10):
            for clouds in (0, 0.5, 1):
                texels = sky(sun_direction(200, elevation), turbidity, clouds, height=24)
                assert texels.shape == (24, 48, 3) and texels.dtype == np.float32
                assert np.isfinite(texels).all() and (texels >= 0).all()
                assert np.isfinite(sun_irradiance(elevation, turbidity, clouds)).all()


def test_a_sky_of_one_radiance_gives_pi():
    """The rows' integrals add up to 1/2 exactly; float32 texels are exact here."""
    assert irradiance(np.ones((32, 64, 3), np.float32)) == pytest.approx([math.pi] * 3, rel=1e-12)


def test_the_ground_reflects_what_sun_and_sky_give_it():
    to_sun = sun_direction(30, 40)
    texels = sky(to_sun, 3, 0.3, 4, ground=(0.5, 0.2, 0.1))
    light = irradiance(texels) + sun_irradiance(40, 3, 0.3) * to_sun[1]
    # The horizon is soft, so that the lowest rows of the sky hold some ground: 1e-3 of the light on level ground.
    np.testing.assert_allclose(texels[200, 17], np.array([0.5, 0.2, 0.1]) * light / math.pi, rtol=2e-3)


@pytest.mark.parametrize("cover", [0.2, 0.5, 0.8])
def test_clouds_cover_the_share_that_was_asked_for(cover):
    directions = _directions(128)
    high = directions[..., 1] > 0.2  # far from the horizon and, below, from the sun's gap
    opacity, light = cloud_layer(directions, sun_direction(0, 5), cover, 3)
    # The quantile is over all texels above the horizon; those that are high are half of them, in features of some degrees.
    assert float((opacity[high] > 0.5).mean()) == pytest.approx(cover, abs=0.15)
    assert (opacity[directions[..., 1] < 0] == 0).all() and light.min() > 0 and light.max() <= 1


def test_clouds_have_seeds_lit_sides_and_leave_the_sun_its_gap():
    to_sun = sun_direction(20, 35)
    clear, one, again, other = (sky(to_sun, 3, cover, seed) for cover, seed in ((0, 1), (0.4, 1), (0.4, 1), (0.4, 2)))
    assert np.array_equal(one, again)
    assert np.abs(one - other)[:120].mean() > 0.05 and np.abs(one - clear)[:120].mean() > 0.05
    at_sun = np.unravel_index(np.argmax(_directions(256) @ to_sun), (256, 512))
    for seed in range(6):  # at 40 % cover some would have a cloud there
        np.testing.assert_allclose(sky(to_sun, 3, 0.4, seed)[at_sun], clear[at_sun], rtol=0.02)
    _, light = cloud_layer(_directions(128), to_sun, 0.4, 1)
    assert light.min() < 0.6 < 0.95 < light.max()


def test_an_overcast_sky_hides_the_sun():
    assert np.array_equal(sun_irradiance(40, 3, 0.5), sun_irradiance(40, 3, 0.0))
    assert sun_irradiance(40, 3, 1.0).tolist() == [0, 0, 0]
    light = float(luminance(irradiance(sky(sun_direction(0, 40), 4, 1.0))))
    clear = float(luminance(sun_irradiance(40))) * math.sin(math.radians(40))
    assert 0.1 < light / clear < 1.0


def test_it_takes_less_than_a_second():
    start = time.process_time()
    sky(sun_direction(0, 30), 3, 0.5)
    assert time.process_time() - start < 1  # 0.35 s when this was written
