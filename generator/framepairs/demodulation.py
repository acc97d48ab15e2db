"""Light without material: colour divided by the pre-integrated BRDF, and back (NSRD 2024; FuseSR 2023, equations 3 and 4).

Pure functions on a frame's arrays, NumPy's or torch's alike (Python array API). What the surface or the sky emits is taken off
first and added last, so the background's lighting is 0.
"""

from dataclasses import dataclass
from typing import Any, Literal

from array_api_compat import array_namespace

from .plan import RenderPlan

Array = Any


@dataclass(frozen=True)
class Floor:
    """What keeps the divisor above 0. max: max(F_beta, value). softplus: log(1 + exp(value F_beta)) / value, FuseSR's with
    value 100, which is 0.0069 at F_beta = 0 and F_beta + 4e-7 at 0.1."""

    kind: Literal["max", "softplus"] = "max"
    value: float = 1e-3


def floor_of(plan: RenderPlan) -> Floor:
    """The floor that a corpus states."""
    return Floor(plan.demodulation, plan.brdf_floor if plan.demodulation == "max" else plan.softplus_beta)


def divisor(f_beta: Array, floor: Floor) -> Array:
    """What colour is divided by, > 0: float32 (float64 for float64), the shape of `f_beta` [..., 3]."""
    xp, f_beta = array_namespace(f_beta), _at_least_single(f_beta)
    zero = xp.zeros_like(f_beta)
    if floor.kind == "max":
        return xp.where(f_beta > floor.value, f_beta, zero + floor.value)
    positive = xp.where(f_beta > 0, f_beta, zero)
    return positive + xp.log1p(xp.exp(-floor.value * xp.abs(f_beta))) / floor.value


def demodulate(color: Array, emission: Array, f_beta: Array, floor: Floor) -> Array:
    """Lighting = (colour - emission) / divisor, all [..., 3], scene-linear. Finite for finite input; negative only where a
    blended layer darkens what shines behind it. Under an overlay (`overlay` > 0) it holds the overlay: mask it."""
    return (_at_least_single(color) - _at_least_single(emission)) / divisor(f_beta, floor)


def remodulate(lighting: Array, emission: Array, f_beta: Array, floor: Floor) -> Array:
    """Colour = lighting * divisor + emission: the inverse of `demodulate` to a few roundings of the largest term."""
    return _at_least_single(lighting) * divisor(f_beta, floor) + _at_least_single(emission)


def _at_least_single(array: Array) -> Array:
    """Half precision would overflow: 65504 / 0.001 is 6.6e7."""
    xp = array_namespace(array)
    return array if array.dtype in (xp.float32, xp.float64) else xp.astype(array, xp.float32)
