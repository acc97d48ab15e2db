"""Lighting times material plus emission is colour again, to the roundings that the three operations make."""

import array_api_strict
import numpy as np
import pytest

from framepairs.demodulation import Floor, demodulate, divisor, floor_of, remodulate
from framepairs.plan import make_plan

FLOORS = [Floor(), Floor("softplus", 100.0)]


def samples(dtype=np.float32) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """colour in [1e-6, 1e6], emission of up to all of it, F_beta from 0 to 2 with many tiny ones: [4000, 3] each."""
    rng = np.random.default_rng(3)
    color = 10 ** rng.uniform(-6, 6, (4000, 3))
    emission = color * rng.choice([0, 0, 1e-3, 0.5, 1], (4000, 3))
    f_beta = np.where(rng.random((4000, 3)) < 0.1, 0, 2 * rng.random((4000, 3)) ** 8)
    return tuple(array.astype(dtype) for array in (color, emission, f_beta))


@pytest.mark.parametrize("floor", FLOORS)
def test_remodulating_gives_the_colour_back_within_10_ulp(floor):
    color, emission, f_beta = samples()
    lighting = demodulate(color, emission, f_beta, floor)
    back = remodulate(lighting, emission, f_beta, floor)
    assert lighting.dtype == np.float32 and np.isfinite(lighting).all()
    assert np.all(np.abs(back - color) <= 10 * np.spacing(color))


@pytest.mark.parametrize("floor", FLOORS)
def test_half_precision_does_not_overflow(floor):
    color, f_beta = np.full((1, 3), 65504, np.float16), np.zeros((1, 3), np.float16)
    lighting = demodulate(color, np.zeros_like(color), f_beta, floor)
    assert lighting.dtype == np.float32 and np.isfinite(lighting).all()
    assert np.allclose(remodulate(lighting, np.zeros_like(color), f_beta, floor), 65504, rtol=2**-22)


@pytest.mark.parametrize("floor", FLOORS)
def test_the_background_has_no_lighting(floor):
    sky = np.float32([[3.0, 20.0, 1e5]])
    assert not demodulate(sky, sky, np.zeros_like(sky), floor).any()


def test_divisors_by_hand():
    f_beta = np.array([0.0, 5e-4, 1e-3, 0.1, 1.0])
    assert divisor(f_beta, Floor()).tolist() == [1e-3, 1e-3, 1e-3, 0.1, 1.0]
    softplus = divisor(f_beta, Floor("softplus", 100.0))
    assert softplus[0] == pytest.approx(np.log(2) / 100, rel=1e-15)
    assert np.allclose(softplus, np.log1p(np.exp(100 * f_beta)) / 100, rtol=1e-14)
    assert np.isfinite(divisor(np.array([-1e4, 1e4]), Floor("softplus", 100.0))).all()


def test_float64_stays_float64():
    color, emission, f_beta = samples(np.float64)
    assert demodulate(color, emission, f_beta, Floor()).dtype == np.float64


def test_it_needs_nothing_but_the_array_api():
    color, emission, f_beta = (array_api_strict.asarray(array) for array in samples())
    lighting = demodulate(color, emission, f_beta, Floor("softplus", 100.0))
    expected = demodulate(*samples(), Floor("softplus", 100.0))
    assert np.allclose(np.asarray(lighting), expected, rtol=2**-20)


def test_the_plan_states_the_floor():
    assert floor_of(make_plan({})) == Floor("max", 1e-3)
    assert floor_of(make_plan({"demodulation": "softplus"})) == Floor("softplus", 100.0)
