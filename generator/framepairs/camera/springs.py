"""A damped spring behind a moving target, in closed form: stable at any stiffness, independent of how often it is asked.

The place x obeys x'' = -k (x - p) - 2 zeta sqrt(k) (x' - p'): the damper sits between the camera and its target, so a target of
constant velocity is followed without lag. The target p is linear between nodes of a fixed grid of time; there the distance
e = x - p obeys the homogeneous equation, whose solution is exact for any step.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Spring:
    """step: seconds between nodes. targets: [n, 3] at the nodes. distances, speeds: [n, 3] x - p and x' - p' at a node, the
    latter against the target's velocity after it. stiffness: 1/s^2. damping_ratio: 1 is critical."""

    step: float
    targets: Array
    distances: Array
    speeds: Array
    stiffness: float
    damping_ratio: float


def transition(stiffness: float, damping_ratio: float, seconds: float) -> Array:
    """[2, 2] that takes (e, e') over `seconds` >= 0. Only exponentials of negative numbers, no difference of large ones."""
    frequency = math.sqrt(stiffness)
    decay = damping_ratio * frequency
    if damping_ratio <= 1:
        beta = frequency * math.sqrt((1 - damping_ratio) * (1 + damping_ratio))
        fade, cosine = math.exp(-decay * seconds), math.cos(beta * seconds)
        sine = math.sin(beta * seconds) / beta if beta * seconds > 1e-8 else seconds  # sin(beta t) / beta, also at beta = 0
    else:
        root = math.sqrt((damping_ratio - 1) * (damping_ratio + 1))
        beta = frequency * root
        fade = math.exp(-frequency / (damping_ratio + root) * seconds)  # of the slower exponential, which is left outside
        cosine = (1 + math.exp(-2 * beta * seconds)) / 2
        sine = -math.expm1(-2 * beta * seconds) / (2 * beta) if beta * seconds > 1e-8 else seconds
    return fade * np.array(
        [[cosine + decay * sine, sine], [-stiffness * sine, cosine - decay * sine]],
    )


def follow_spring(targets: Array, step: float, stiffness: float, damping_ratio: float) -> Spring:
    """The spring behind targets [n, 3], `step` seconds apart; it starts on the first with the target's velocity.

    stiffness: 1/s^2, > 0. damping_ratio: > 0.
    """
    velocities = np.diff(targets, axis=0, append=targets[-1:]) / step
    if len(targets) > 1:
        velocities[-1] = velocities[-2]
    jumps = np.diff(velocities, axis=0, prepend=velocities[:1])
    over_step = transition(stiffness, damping_ratio, step)
    states = np.zeros((len(targets), 2, 3))
    state = np.zeros((2, 3))
    for node in range(1, len(targets)):
        state = over_step @ state
        state[1] -= jumps[node]
        states[node] = state
    return Spring(
        step=step,
        targets=targets,
        distances=states[:, 0],
        speeds=states[:, 1],
        stiffness=stiffness,
        damping_ratio=damping_ratio,
    )


def spring_at(spring: Spring, seconds: Array) -> Array:
    """Places [t, 3] at times [t] since the first node, >= 0; past the last node the target goes on as before it."""
    node = np.minimum((seconds / spring.step).astype(int), max(len(spring.targets) - 2, 0))
    since = seconds - node * spring.step
    following = np.minimum(node + 1, len(spring.targets) - 1)
    target = spring.targets[node] + (since / spring.step)[:, None] * (spring.targets[following] - spring.targets[node])
    steps = np.array([transition(spring.stiffness, spring.damping_ratio, float(s))[0] for s in since]).reshape(-1, 2)
    return target + steps[:, :1] * spring.distances[node] + steps[:, 1:] * spring.speeds[node]
