"""Damped springs: against the differential equation, at any stiffness, damping and frame rate."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from framepairs.camera.springs import follow_spring, spring_at, transition

STEP = 1 / 240


def line(seconds, velocity=(3.0, 0, -1)):
    return np.arange(round(seconds / STEP) + 2)[:, None] * STEP * np.array(velocity)


def jump(seconds, after_s=0.5, by=(1.0, -2, 0.5)):
    times = np.arange(round(seconds / STEP) + 2) * STEP
    return np.where(times[:, None] >= after_s, 1.0, 0.0) * np.array(by)


@pytest.mark.parametrize("damping", [0.05, 0.7, 0.999999, 1, 1.000001, 1.5, 40])
@pytest.mark.parametrize("stiffness", [0.3, 20, 900])
def test_a_step_solves_the_differential_equation(stiffness, damping):
    def derivative(_, state):
        return [state[1], -stiffness * state[0] - 2 * damping * math.sqrt(stiffness) * state[1]]

    for state in ([1.0, 0.0], [0.0, 1.0]):
        exact = solve_ivp(derivative, (0, 0.7), state, method="Radau", rtol=1e-10, atol=1e-13).y[:, -1]
        # Radau's stated tolerance, times the steps it takes; speeds are of size sqrt(k).
        np.testing.assert_allclose(transition(stiffness, damping, 0.7) @ state, exact, atol=3e-8 * max(1, math.sqrt(stiffness)))


@pytest.mark.parametrize("damping", [0.2, 1, 3])
def test_two_half_steps_are_one(damping):
    half = transition(50, damping, 0.05)
    np.testing.assert_allclose(half @ half, transition(50, damping, 0.1), atol=1e-13)


def test_close_to_critical_damping_nothing_breaks():
    critical = transition(30, 1, 0.2)
    for distance in (1e-3, 1e-6, 1e-9, 1e-12, 1e-15):
        for damping in (1 - distance, 1 + distance):
            # The exponent changes by sqrt(30) * 0.2 * distance at first order.
            np.testing.assert_allclose(transition(30, damping, 0.2), critical, atol=40 * distance + 1e-13)


@pytest.mark.parametrize("stiffness", [10.0**k for k in range(-3, 13, 3)])
@pytest.mark.parametrize("damping", [0.1, 1, 30])
@pytest.mark.parametrize("fps", [1, 24, 240])
def test_any_stiffness_stays_finite_and_within_the_step(stiffness, damping, fps):
    spring = follow_spring(jump(4), STEP, stiffness, damping)
    places = spring_at(spring, np.arange(0, 4, 1 / fps))
    assert np.isfinite(places).all()
    # A damped spring overshoots a step by less than the step.
    assert (np.abs(places) <= 2 * np.array([1, 2, 0.5]) * (1 + 1e-9)).all()


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e3, 1e6, 1e12])
def test_it_converges_to_its_target(stiffness):
    # exp(-sqrt(k) t) (1 + sqrt(k) t) < 1e-6 from sqrt(k) t = 17 on; here the step is 0.5 s after the begin.
    seconds = min(max(20 / math.sqrt(stiffness), 0.2), 700)
    spring = follow_spring(jump(0.5 + seconds), STEP, stiffness, 1)
    at_end = spring_at(spring, np.array([0.5 + seconds]))[0]
    np.testing.assert_allclose(at_end, [1, -2, 0.5], atol=4e-6)


@pytest.mark.parametrize("stiffness", [1e-3, 20, 1e12])
def test_a_target_of_constant_velocity_is_followed_without_lag(stiffness):
    spring = follow_spring(line(5), STEP, stiffness, 0.8)
    times = np.array([0, 0.001, 1.2345, 5])
    # Rounding of places up to 15 units, over 1200 steps.
    np.testing.assert_allclose(spring_at(spring, times), times[:, None] * [3, 0, -1], atol=1e-11)


def test_places_and_speeds_are_continuous_at_nodes():
    random = np.random.default_rng(3)
    spring = follow_spring(np.cumsum(random.normal(size=(50, 3)), axis=0), STEP, 200, 0.5)
    nodes, h = np.arange(2, 40) * STEP, 1e-7
    before = (spring_at(spring, nodes - h) - spring_at(spring, nodes - 2 * h)) / h
    after = (spring_at(spring, nodes + 2 * h) - spring_at(spring, nodes + h)) / h
    # The target's velocity jumps by 300 a node; 3 h times the acceleration (some 1e4) and rounding of 1e-15 / h remain.
    np.testing.assert_allclose(before, after, atol=2e-2)
    assert np.abs(before).max() > 5


def test_where_it_is_does_not_depend_on_what_was_asked_before():
    spring = follow_spring(jump(2), STEP, 90, 0.3)
    times = np.linspace(0, 2, 77)
    np.testing.assert_array_equal(spring_at(spring, times), [spring_at(spring, times[k : k + 1])[0] for k in range(77)])
