"""Arrays of USD attributes as NumPy arrays, whatever a damaged file holds in their place."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from ..errors import InputError

SPARE_CORNERS, CORNERS_PER_BYTE = 2**24, 8
EARLIEST = Usd.TimeCode.EarliestTime()


def begin_of(stage: Usd.Stage) -> float:
    """The time code at which a scene's time is 0 seconds: where the stage's animation begins, else 0."""
    return stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else 0.0


class CornerBudget:
    """How many corners of faces may be built of a stage in `files`: arrays of equal numbers take next to nothing in a .usdc,
    and subdivision multiplies, so that a small file could ask for any memory."""

    def __init__(self, files: Iterable[Path]) -> None:
        self._most = SPARE_CORNERS + CORNERS_PER_BYTE * sum(file.stat().st_size for file in set(files))
        self._spent = 0

    def spend(self, corners: int, path: str) -> None:
        """Counts corners before they are built. Raises InputError naming the prim where they are too many."""
        self._spent += corners
        if self._spent > self._most:
            problem = f"{self._spent} corners of faces with those before it, up to {self._most} are read of files of this size"
            raise InputError(f"{problem}; less subdivision makes fewer", field=path)


def integers(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.int64]:
    """Whole numbers [n]; none where there is no value. Raises InputError naming the attribute for another type."""
    return _array(attribute, code, (), "iu", np.int64)


def numbers(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.float64]:
    """Numbers [n]; as `integers`."""
    return _array(attribute, code, (), "iuf", np.float64)


def vectors(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> NDArray[np.float64]:
    """Vectors [n, 3]; as `integers`."""
    return _array(attribute, code, (3,), "iuf", np.float64)


def _array(attribute: Usd.Attribute, code: Usd.TimeCode, element: tuple[int, ...], kinds: str, dtype: type) -> NDArray:
    """[n, *element] of numbers of these kinds; no elements where there is no value."""
    found = _value(attribute, code)
    if found.size == 0:
        return np.zeros((0, *element), dtype)
    if found.ndim != 1 + len(element) or found.shape[1:] != element or found.dtype.kind not in kinds:
        raise _wrong_type(attribute)
    return found.astype(dtype)


def typed(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> Any:
    """The value of an attribute at a time, None where there is none. Raises InputError naming the prim for one of another type
    than the attribute has: files may hold any."""
    item, like = attribute.Get(code), attribute.GetTypeName().defaultValue
    if item is not None and not isinstance(item, type(like)):
        raise _wrong_type(attribute)
    return item


def number(attribute: Usd.Attribute, code: Usd.TimeCode = EARLIEST) -> float:
    """As `typed`. Raises InputError also where there is no value."""
    item = typed(attribute, code)
    if item is None:
        raise InputError(f"{attribute.GetName()} has no value", field=str(attribute.GetPrim().GetPath()))
    return float(item)


def _value(attribute: Usd.Attribute, code: Usd.TimeCode) -> NDArray:
    value = attribute.Get(code)
    return np.zeros(0) if value is None else np.array(value)


def _wrong_type(attribute: Usd.Attribute) -> InputError:
    problem = f"{attribute.GetName()} holds values of another type than {attribute.GetTypeName()}"
    return InputError(problem, field=str(attribute.GetPrim().GetPath()))
