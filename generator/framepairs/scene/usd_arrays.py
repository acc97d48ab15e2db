"""Arrays of USD attributes as NumPy arrays, whatever a damaged file holds in their place."""

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from ..errors import InputError

EARLIEST = Usd.TimeCode.EarliestTime()


def integers(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.int64]:
    """Whole numbers [n]; none where there is no value. Raises InputError naming the attribute for another type."""
    found = _value(attribute, code)
    if found.size == 0:
        return np.zeros(0, np.int64)
    if found.ndim != 1 or found.dtype.kind not in "iu":
        raise _wrong_type(attribute)
    return found.astype(np.int64)


def numbers(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.float64]:
    """Numbers [n]; as `integers`."""
    found = _value(attribute, code)
    if found.size == 0:
        return np.zeros(0)
    if found.ndim != 1 or found.dtype.kind not in "iuf":
        raise _wrong_type(attribute)
    return found.astype(np.float64)


def vectors(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.float64]:
    """Vectors [n, 3]; as `integers`."""
    found = _value(attribute, code)
    if found.size == 0:
        return np.zeros((0, 3))
    if found.ndim != 2 or found.shape[1] != 3 or found.dtype.kind not in "iuf":
        raise _wrong_type(attribute)
    return found.astype(np.float64)


def _value(attribute: Usd.Attribute, code: Usd.TimeCode) -> NDArray:
    value = attribute.Get(code)
    return np.zeros(0) if value is None else np.array(value)


def _wrong_type(attribute: Usd.Attribute) -> InputError:
    problem = f"{attribute.GetName()} holds values of another type than {attribute.GetTypeName()}"
    return InputError(problem, field=str(attribute.GetPrim().GetPath()))
