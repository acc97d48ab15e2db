"""What changes in a USD stage, as functions of the time in seconds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom, UsdUtils

from ..errors import InputError
from .description import Deformed, Light
from .usd_arrays import begin_of
from .usd_deform import Deformation, deformed_vertices, pose
from .usd_lights import ChangingLight
from .usd_meshes import VertexSource
from .usd_placement import Placement


@dataclass(frozen=True)
class Moving:
    """A mesh prim whose vertices move. parts: where the vertices of a part come from, and its mesh."""

    deformation: Deformation
    parts: tuple[tuple[VertexSource, int], ...]


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Adds the file to an InputError that does not name one, and makes one of USD's own errors. Meanwhile, USD's warnings do
    not reach the terminal."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()  # takes them up as long as it lives
    try:
        with np.errstate(all="ignore"):  # what becomes infinite is refused
            yield
    except Tf.ErrorException as error:
        raise InputError(f"USD: {' '.join(str(error).split())[:300]}", file=file) from None
    except UnicodeDecodeError:
        raise InputError("USD: it holds text that is not UTF-8", file=file) from None
    except InputError as error:
        if error.file is None:
            raise InputError(error.problem, file=file, frame=error.frame, field=error.field) from None
        raise
    finally:
        del delegate


def of_seconds(stage: Usd.Stage, file: Path, function: Callable[[Usd.TimeCode], Any]) -> Callable[[float], Any]:
    """`function` of a time code as one of the seconds since the stage's animation begins, whose InputErrors name the file."""
    begin, rate = begin_of(stage), stage.GetTimeCodesPerSecond()

    def of_time(time_s: float):
        assert stage  # the closure keeps the stage alive: prims of a stage that is gone answer with identities
        with naming(file):
            return function(Usd.TimeCode(begin + time_s * rate))

    return of_time


def seconds_of(stage: Usd.Stage) -> float:
    """How long the stage's animation is; 0 where it says nothing of it."""
    length = stage.GetEndTimeCode() - begin_of(stage) if stage.HasAuthoredTimeCodeRange() else 0.0
    return max(length, 0.0) / stage.GetTimeCodesPerSecond()


def world_from_objects(
    placements: Sequence[Placement], begin_code: Usd.TimeCode
) -> Callable[[Usd.TimeCode], NDArray[np.float64]]:
    """Of a time code to [objects, 4, 4]; what stands still is computed once."""
    start = UsdGeom.XformCache(begin_code)
    begin = np.concatenate([np.zeros((0, 4, 4)), *(item.matrices(start) for item in placements)])
    moving = [(row, item) for row, item in _rows(placements) if item.moves]

    def world_from_object(code: Usd.TimeCode) -> NDArray[np.float64]:
        cache = UsdGeom.XformCache(code)
        matrices = begin.copy()
        for row, item in moving:
            matrices[row : row + item.count] = item.matrices(cache)
        return matrices

    return world_from_object


def visible_at(placements: Sequence[Placement], code: Usd.TimeCode) -> NDArray[np.bool_]:
    """Which objects are drawn, [objects]."""
    shown = np.ones(sum(item.count for item in placements), dtype=bool)
    for row, item in _rows(placements):
        if item.visible is not None:
            shown[row : row + item.count] = item.visible(code)
    return shown


def _rows(placements: Sequence[Placement]) -> Iterator[tuple[int, Placement]]:
    row = 0
    for item in placements:
        yield row, item
        row += item.count


def deformed_at(moving: Sequence[Moving], code: Usd.TimeCode) -> dict[int, Deformed]:
    """The vertices of every mesh that moves, by its index."""
    out: dict[int, Deformed] = {}
    for item in moving:
        now = pose(item.deformation, code)
        for source, mesh in item.parts:
            out[mesh] = deformed_vertices(item.deformation, now, source, code)
    return out


def lights_at(lights: Sequence[Light], changing: Mapping[int, ChangingLight], code: Usd.TimeCode) -> tuple[Light, ...]:
    """All lights, those that change by their index in `changing`."""
    cache = UsdGeom.XformCache(code)
    changed = {index: item.at(cache) for index, item in changing.items()}
    return tuple(changed.get(index, item) for index, item in enumerate(lights))
