"""Camera shake: band-limited noise, a sum of seeded sinusoids of the path's own time."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..transforms import Matrix, rigid
from .rotations import quaternion_of_turn, rotation_of_quaternion
from .splines import smoothstep

Array = NDArray[np.float64]

SINUSOIDS = 16  # per component


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Six components, x y z of place and of turn in camera axes. amplitudes, frequencies, phases: [6, SINUSOIDS], scene units
    or radians, radians per second, radians."""

    amplitudes: Array
    frequencies: Array
    phases: Array


def make_noise(position: float, rotation_deg: float, low_hz: float, high_hz: float, seed: int) -> Noise:
    """position: root mean square length of the displacement, scene units; rotation_deg: of the angle of turn.

    One frequency lies in each of SINUSOIDS equal parts of the band. The numbers are the raw bits of NumPy's Philox (Salmon et
    al. 2011) with `seed` as its key, which NumPy does not change between versions.
    """
    bits = np.random.Philox(key=seed).random_raw(3 * 6 * SINUSOIDS)
    uniform = ((bits >> np.uint64(11)) * 2.0**-53).reshape(3, 6, SINUSOIDS)
    hertz = low_hz + (high_hz - low_hz) * (np.arange(SINUSOIDS) + uniform[0]) / SINUSOIDS
    weights = 0.5 + uniform[1]
    weights *= math.sqrt(2 / 3) / np.linalg.norm(
        weights, axis=1, keepdims=True
    )  # a sinusoid's mean square is half of its square
    sizes = np.repeat([position, math.radians(rotation_deg)], 3)[:, None]
    return Noise(amplitudes=sizes * weights, frequencies=2 * math.pi * hertz, phases=2 * math.pi * uniform[2])


def noise_at(noise: Noise, time: float) -> Array:
    """[6] displacement in scene units and turn in radians."""
    return (noise.amplitudes * np.sin(noise.frequencies * time + noise.phases)).sum(axis=1)


def shaken(world_from_camera: Matrix, noise: Noise, time: float, share: float) -> Matrix:
    """The pose with `share` in [0, 1] of the noise; at 0 the matrix itself, to the last bit."""
    if share == 0:
        return world_from_camera
    values = share * noise_at(noise, time)
    turn = rotation_of_quaternion(quaternion_of_turn(values[None, 3:]))[0]
    return world_from_camera @ rigid(turn, values[:3])


def fade_between(time: float, rest_before: float | None, rest_after: float | None, fade_s: float) -> float:
    """Share of the noise: 0 with slope 0 at the end of the rest before and at the begin of the rest after, 1 from `fade_s`
    away on. None: there is no such rest."""
    since = 1.0 if rest_before is None else float(smoothstep(np.float64((time - rest_before) / fade_s)))
    until = 1.0 if rest_after is None else float(smoothstep(np.float64((rest_after - time) / fade_s)))
    return since * until
