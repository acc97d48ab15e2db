"""Where USD prims stand and when they show: transforms, visibility, and the instances of point instancers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from ..errors import InputError
from .usd_arrays import integers

LocalMatrix = Callable[[Usd.TimeCode], NDArray[np.float64]]
INSTANCE_TRANSFORM_ATTRIBUTES = (
    "positions", "orientations", "orientationsf", "scales", "protoIndices", "ids"
)  # fmt: skip
MOST_INSTANCES = 2_000_000  # and objects before them; each takes some 700 bytes
INSTANCE_MOTION_ATTRIBUTES = ("velocities", "accelerations", "angularVelocities")


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Some objects in a row. matrices: of a transform cache at a time to world_from_object [count, 4, 4]. visible: of the
    time to [count] bool, None where all are always drawn. moves: matrices change."""

    count: int
    matrices: Callable[[UsdGeom.XformCache], NDArray[np.float64]]
    visible: Callable[[Usd.TimeCode], NDArray[np.bool_]] | None
    moves: bool


@dataclass(frozen=True, kw_only=True)
class Visibility:
    """drawn: at some time at least. changing: the prim is hidden while one of these attributes says invisible."""

    drawn: bool
    changing: tuple[Usd.Attribute, ...] = ()

    def at(self, code: Usd.TimeCode) -> bool:
        return self.drawn and all(item.Get(code) != UsdGeom.Tokens.invisible for item in self.changing)


def read_visibility(prim: Usd.Prim, top: Usd.Prim | None = None) -> Visibility:
    """Visibility (inherited) and purpose of a prim. top: root of its prototype, where the inheritance ends."""
    if not prim.IsA(UsdGeom.Imageable):
        return Visibility(drawn=bool(prim.IsActive()))
    if UsdGeom.Imageable(prim).ComputePurpose() not in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render):
        return Visibility(drawn=False)
    changing = []
    for item in _upwards(prim, top):
        attribute = UsdGeom.Imageable(item).GetVisibilityAttr() if item.IsA(UsdGeom.Imageable) else None
        if not attribute:
            continue
        if attribute.ValueMightBeTimeVarying():
            changing.append(attribute)
        elif attribute.Get(Usd.TimeCode.EarliestTime()) == UsdGeom.Tokens.invisible:
            return Visibility(drawn=False)
    times = sorted({time for item in changing for time in item.GetTimeSamples()})
    shown = [Visibility(drawn=True, changing=tuple(changing)).at(Usd.TimeCode(time)) for time in times]
    if all(shown):
        return Visibility(drawn=True)
    return Visibility(drawn=any(shown), changing=tuple(changing))


def is_animated(prim: Usd.Prim, top: Usd.Prim | None = None) -> bool:
    """The transform of the prim, or of one above it up to `top`, changes."""
    return any(
        xformable and xformable.TransformMightBeTimeVarying() for xformable in map(UsdGeom.Xformable, _upwards(prim, top))
    )


def _upwards(prim: Usd.Prim, top: Usd.Prim | None):
    while prim and not prim.IsPseudoRoot():
        yield prim
        if prim == top:
            return
        prim = prim.GetParent()


def place(anchor: Usd.Prim, local: LocalMatrix | None, local_moves: bool, visibility: Visibility) -> Placement:
    """One object in the space of `anchor`, or of what `local` gives there."""

    def matrices(cache: UsdGeom.XformCache) -> NDArray[np.float64]:
        world = np.array(cache.GetLocalToWorldTransform(anchor)).T
        if not np.isfinite(world).all():
            raise InputError("its transform is not finite", field=str(anchor.GetPath()))
        return (world @ local(cache.GetTime()) if local else world)[None]

    return Placement(
        count=1,
        matrices=matrices,
        visible=(lambda code: np.array([visibility.at(code)])) if visibility.changing else None,
        moves=local_moves or is_animated(anchor),
    )


@dataclass(frozen=True, kw_only=True)
class PrototypePart:
    """A mesh of a prototype: which prototype, its root, and where the mesh stands in it, as for `place`."""

    prototype: int
    root: Usd.Prim
    anchor: Usd.Prim
    local: LocalMatrix | None
    local_moves: bool
    visibility: Visibility


@dataclass(frozen=True, kw_only=True)
class Instances:
    """The instances that an instancer draws at some time.

    ids, prototypes: [n]. rows: [n] their places in the instancer's arrays; None where those places change. changes: instances
    come, go or hide. at_first: [n] the time code at which each is first there.
    """

    instancer: UsdGeom.PointInstancer
    ids: NDArray[np.int64]
    prototypes: NDArray[np.int64]
    rows: NDArray[np.int64] | None
    changes: bool
    at_first: NDArray[np.float64]

    @property
    def moves(self) -> bool:
        prim = self.instancer.GetPrim()
        varies = any(prim.GetAttribute(name).ValueMightBeTimeVarying() for name in INSTANCE_TRANSFORM_ATTRIBUTES)
        driven = any(prim.GetAttribute(name).HasAuthoredValue() for name in INSTANCE_MOTION_ATTRIBUTES)
        return varies or driven or is_animated(prim)


def read_instances(instancer: UsdGeom.PointInstancer) -> Instances:
    """The instances of an instancer. Raises InputError naming it where its arrays do not fit."""
    path = str(instancer.GetPath())
    roster = instancer.GetProtoIndicesAttr(), instancer.GetIdsAttr()
    varying = [item for item in (*roster, instancer.GetInvisibleIdsAttr()) if item.ValueMightBeTimeVarying()]
    times = sorted({time for item in varying for time in item.GetTimeSamples()}) or [0.0]
    prototype_count = len(instancer.GetPrototypesRel().GetForwardedTargets())
    moving_rows = any(item.ValueMightBeTimeVarying() for item in roster)
    members: dict[tuple[int, int, int], tuple[int, float]] = {}
    shown_at = []
    for time in times:
        ids, prototypes, shown = _roster(instancer, Usd.TimeCode(time))
        if len(prototypes) and (prototypes.min() < 0 or prototypes.max() >= prototype_count):
            wrong = prototypes.max() if prototypes.max() >= prototype_count else prototypes.min()
            raise InputError(f"prototype index {wrong} with only {prototype_count} prototypes", field=path)
        if len(ids) != len(prototypes):
            raise InputError(f"{len(ids)} ids for {len(prototypes)} instances", field=path)
        _instance_matrices(instancer, Usd.TimeCode(time), len(prototypes))
        there = np.flatnonzero(shown)
        apart = np.zeros_like(there) if moving_rows else there  # equal ids are one instance only where rows change
        present = list(zip(ids[there].tolist(), prototypes[there].tolist(), apart.tolist(), strict=True))
        for key, row in zip(present, there.tolist(), strict=True):
            members.setdefault(key, (row, time))
        shown_at.append(set(present))
    keys = np.array(list(members), dtype=np.int64).reshape(-1, 3)
    firsts = list(members.values())
    return Instances(
        instancer=instancer,
        ids=keys[:, 0],
        prototypes=keys[:, 1],
        rows=None if moving_rows else np.array([row for row, _ in firsts], dtype=np.int64),
        changes=any(item != shown_at[0] for item in shown_at),
        at_first=np.array([time for _, time in firsts]),
    )


def check_count(instances: int, path: str) -> None:
    """Raises InputError naming the instancer for more than MOST_INSTANCES."""
    if instances > MOST_INSTANCES:
        raise InputError(f"{instances} instances, more than {MOST_INSTANCES}", field=path)


def _roster(instancer: UsdGeom.PointInstancer, code: Usd.TimeCode) -> tuple[NDArray, NDArray, NDArray]:
    """ids, prototype indices and whether they are shown, [n] each."""
    prototypes, ids = integers(instancer.GetProtoIndicesAttr(), code), integers(instancer.GetIdsAttr(), code)
    check_count(len(prototypes), str(instancer.GetPath()))
    ids = ids if len(ids) else np.arange(len(prototypes))
    mask = instancer.ComputeMaskAtTime(code)
    return ids, prototypes, np.array(mask, dtype=bool) if len(mask) else np.ones(len(prototypes), dtype=bool)


def _instance_matrices(instancer: UsdGeom.PointInstancer, code: Usd.TimeCode, count: int) -> NDArray[np.float64]:
    """instancer_from_prototype [count, 4, 4], with the transforms of the prototypes' roots."""
    found = instancer.ComputeInstanceTransformsAtTime(
        code, code, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    )
    if len(found) != count:
        raise InputError(f"positions, orientations or scales do not fit its {count} instances", field=str(instancer.GetPath()))
    matrices = np.array(found).reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(matrices).all():
        raise InputError("positions, orientations or scales are not finite", field=str(instancer.GetPath()))
    return matrices


def place_instances(instances: Instances, parts: Sequence[PrototypePart], visibility: Visibility) -> Placement:
    """The objects of an instancer: for each part in turn, the instances of its prototype in the order of `instances`."""
    instancer = instances.instancer
    members = [np.flatnonzero(instances.prototypes == part.prototype) for part in parts]
    first = _first_matrices(instances) if instances.rows is None else None

    def matrices(cache: UsdGeom.XformCache) -> NDArray[np.float64]:
        code = cache.GetTime()
        world = np.array(cache.GetLocalToWorldTransform(instancer.GetPrim())).T
        placed = world @ _all_matrices(instances, code, first)
        rows = [np.zeros((0, 4, 4))]
        for part, chosen in zip(parts, members, strict=True):
            inside = np.array(cache.ComputeRelativeTransform(part.anchor, part.root)[0]).T
            rows.append(placed[chosen] @ (inside @ part.local(code) if part.local else inside))
        return np.concatenate(rows)

    def visible(code: Usd.TimeCode) -> NDArray[np.bool_]:
        shown = _shown(instances, code) & visibility.at(code)
        rows = [shown[chosen] & part.visibility.at(code) for part, chosen in zip(parts, members, strict=True)]
        return np.concatenate([np.zeros(0, dtype=bool), *rows])

    hides = instances.changes or bool(visibility.changing) or any(part.visibility.changing for part in parts)
    inside_moves = any(
        part.local_moves or is_animated(part.anchor, part.root) or is_animated(part.root, part.root) for part in parts
    )
    return Placement(
        count=sum(len(chosen) for chosen in members),
        matrices=matrices,
        visible=visible if hides else None,
        moves=instances.moves or inside_moves,
    )


def _found(instances: Instances, ids: NDArray, prototypes: NDArray) -> NDArray[np.int64]:
    """Row [n] of each instance among the ids and prototypes of one time, -1 where it is not there."""
    where = {key: row for row, key in reversed(list(enumerate(zip(ids.tolist(), prototypes.tolist(), strict=True))))}
    keys = zip(instances.ids.tolist(), instances.prototypes.tolist(), strict=True)
    return np.array([where.get(key, -1) for key in keys], dtype=np.int64)


def _all_matrices(instances: Instances, code: Usd.TimeCode, absent: NDArray | None) -> NDArray[np.float64]:
    """instancer_from_prototype [n, 4, 4]; `absent` gives those that are not there."""
    ids, prototypes, _ = _roster(instances.instancer, code)
    found = _instance_matrices(instances.instancer, code, len(prototypes))
    if instances.rows is not None:
        return found[instances.rows]
    rows = _found(instances, ids, prototypes)
    out = absent.copy()
    out[rows >= 0] = found[rows[rows >= 0]]
    return out


def _first_matrices(instances: Instances) -> NDArray[np.float64]:
    """instancer_from_prototype [n, 4, 4] of each instance when it is first there."""
    out = np.zeros((len(instances.ids), 4, 4))
    for time in np.unique(instances.at_first):
        ids, prototypes, _ = _roster(instances.instancer, Usd.TimeCode(time))
        found = _instance_matrices(instances.instancer, Usd.TimeCode(time), len(prototypes))
        chosen = instances.at_first == time
        out[chosen] = found[_found(instances, ids, prototypes)[chosen]]
    return out


def _shown(instances: Instances, code: Usd.TimeCode) -> NDArray[np.bool_]:
    ids, prototypes, mask = _roster(instances.instancer, code)
    if instances.rows is not None:
        return mask[instances.rows]
    rows = _found(instances, ids, prototypes)
    return (rows >= 0) & np.append(mask, False)[rows]
