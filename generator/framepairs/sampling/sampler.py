"""Camera paths sampled through a scene's free space, one after the other, each where most is still unseen.

A path is a walk over reachable cells, smoothed, with viewing directions towards what few earlier paths have seen, or none;
of several, the one that sees most of that is taken, if it keeps its clearance (`sampling.clearance` says what that means).
Objects are avoided where they are at each frame's time; what is seen is judged as the scene is at time 0.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..scene import scene_hash
from ..scene.description import SceneDescription
from ..transforms import Vector
from .candidates import Take, candidates, checked, distance_from, fov_of
from .clearance import clearances_while_moving
from .coverage import seen_cells
from .files import SPLITS, CamerasFile, PathRecord, Sampling, SamplingOptions, Split, split_paths
from .probe import first_hits
from .setting import Setting, prepare
from .styles import styles_of

ATTEMPTS, ROUNDS = 24, 12
PACES = (0.5, 0.3, 0.1, 0.0)  # least share of the speed that was drawn, in the first quarter of the attempts and so on
MAP_COLUMNS = 360


def sample_cameras(
    scene: SceneDescription,
    options: SamplingOptions,
    scene_name: str | None = None,
    on_path: Callable[[int, float], None] | None = None,
) -> Sampling:
    """Sample `options.count` paths. on_path: called with the number of paths so far and the coverage after each.

    Raises InputError where the scene has nothing to go through, or where no path of a style keeps the clearance.
    """
    setting = prepare(scene, options)
    takes: list[Take] = []
    for index in range(options.count):
        takes.append(_take(setting, index, 0, takes))
        setting.coverage.add(takes[-1].seen)
        if on_path is not None:
            on_path(index + 1, setting.coverage.share)
    times = _avoid_what_moves(setting, takes)
    return _sampling(scene, setting, takes, times, scene_name or scene.name)


def _take(setting: Setting, index: int, round_: int, others: list[Take]) -> Take:
    """Path `index`: of several candidates, the one that sees most that is new and keeps the clearance. `round_` counts how
    often the path was chosen anew."""
    style = styles_of(setting.options.styles)[index % len(setting.options.styles)]
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([setting.options.seed, index, round_, attempt])
        least = PACES[attempt * len(PACES) // ATTEMPTS]
        found = [take for take in candidates(setting, style, index, rng, others) if take.pace >= least]
        scene = setting.probe.posed(setting.probe.times[0])
        seen = seen_cells(setting.coverage, scene, [t.frames.cameras[::3] for t in found], [fov_of(t.values) for t in found])
        worth = setting.coverage.worth
        apart = 0.5 + distance_from(np.array([take.middle for take in found]).reshape(-1, 3), others)
        scores = np.array([np.sum(worth[cells]) for cells in seen]) * apart * [min(1.0, 0.3 + take.pace) for take in found]
        for best in np.argsort(-scores, kind="stable"):
            take = checked(setting, found[best])
            if take is not None:
                return take
    wanted = setting.clearance * setting.probe.scene.metres_per_unit
    raise InputError(f"no {style.name} path that keeps {wanted:.3g} m from every surface was found", field="clearance")


def _avoid_what_moves(setting: Setting, takes: list[Take]) -> int:
    """Replace takes that something moving comes too close to; returns at how many times they were checked."""
    probe, options = setting.probe, setting.options
    if len(probe.times) == 1:
        return 0
    fresh = list(range(len(takes)))
    for round_ in range(1, ROUNDS + 1):
        frames, points = [takes[index].frames for index in fresh], [takes[index].points for index in fresh]
        found = clearances_while_moving(probe, frames, points, setting.clearance, options.check_rays, setting.space.grid.up)
        for index, value in zip(fresh, found, strict=True):
            takes[index] = replace(takes[index], clearance=min(takes[index].clearance, float(value)))
        fresh = [index for index in fresh if takes[index].clearance < setting.clearance]
        if not fresh:
            return len(np.unique(np.clip([take.frames.times for take in takes], 0, probe.scene.animation_end_s)))
        for index in fresh:
            setting.coverage.add(takes[index].seen, -1)
            takes[index] = _take(setting, index, round_, takes[:index] + takes[index + 1 :])
            setting.coverage.add(takes[index].seen)
    raise InputError(f"no path that keeps clear of what moves was found in {ROUNDS} rounds", field="clearance")


def _sampling(scene: SceneDescription, setting: Setting, takes: list[Take], times: int, name: str) -> Sampling:
    options, space, origin = setting.options, setting.space, setting.probe.origin
    across, metres = _map_axes(space.grid.up), scene.metres_per_unit
    middles = np.array([take.middle[list(across)] for take in takes])
    splits = split_paths(middles, options.split, options.seed)
    file = CamerasFile(
        scene=name,
        scene_sha256=scene_hash(scene),
        options=options,
        clearance_m=_short(setting.clearance * metres),
        cell_m=tuple(_short(size * metres) for size in space.grid.size),
        view_distance_m=_short(setting.coverage.farthest * metres),
        has_ground=space.has_ground,
        moving_checked=times,
        reachable_cells=len(np.unique(np.concatenate([walks.nodes for walks in setting.walks.values()]))),
        cells=len(setting.coverage.cells),
        cells_seen=int(np.sum(setting.coverage.times_seen > 0)),
        coverage=_short(setting.coverage.share),
        coverage_of={split: _share(setting, takes, splits, split) for split in SPLITS},
        paths=[_record(setting, take, index, split) for index, (take, split) in enumerate(zip(takes, splits, strict=True))],
    )
    cameras = [take.frames.cameras.copy() for take in takes]
    for matrices in cameras:
        matrices[:, :3, 3] += origin
    heights, low, high = _height_map(setting, across)
    values = tuple(take.values for take in takes)
    return Sampling(file, values, tuple(cameras), heights, low, high, across, metres)


def _record(setting: Setting, take: Take, index: int, split: Split) -> PathRecord:
    metres, length = setting.probe.scene.metres_per_unit, take.points.length
    return PathRecord(
        file=f"{take.style.name}_{index:03d}.json",
        style=take.style.name,
        split=split,
        frames=len(take.frames.cameras),
        length_m=_short(length * metres),
        speed_m_s=_short(length * metres / take.moving_s),
        clearance_m=_short(take.clearance * metres),
        turn_deg_s=_short(take.frames.turn_deg * setting.options.fps),
        motion_px=_short(take.motion),
        cells_seen=len(take.seen),
    )


def _short(value: float) -> float:
    """Five digits: what follows them depends on the machine."""
    return float(f"{value:.5g}")


def _share(setting: Setting, takes: list[Take], splits: list[Split], wanted: Split) -> float:
    seen = [take.seen for take, split in zip(takes, splits, strict=True) if split == wanted]
    return _short(len(np.unique(np.concatenate(seen))) / max(len(setting.coverage.cells), 1)) if seen else 0.0


def _map_axes(up: int) -> tuple[int, int]:
    """World axes to the right and down on a map seen from above, against up."""
    return (up + 2) % 3, (up + 1) % 3


def _height_map(setting: Setting, across: tuple[int, int]) -> tuple[NDArray[np.float32], Vector, Vector]:
    """(heights [rows, columns], low, high corner on the map's axes in world space) of the grid, seen straight from above."""
    grid, up = setting.space.grid, setting.space.grid.up
    low, span = grid.low, grid.size * grid.shape
    columns = MAP_COLUMNS
    rows = int(np.clip(round(columns * span[across[1]] / span[across[0]]), 8, 4 * columns))
    place = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    points = np.empty((rows * columns, 3))
    for axis, steps in zip(across, place, strict=True):
        points[:, axis] = low[axis] + steps.ravel() * span[axis]
    top = low[up] + span[up]
    points[:, up] = top
    found = first_hits(setting.probe.posed(setting.probe.times[0]), points, np.tile(-np.eye(3)[up], (len(points), 1)))
    heights = np.where(np.isfinite(found), top + setting.probe.origin[up] - found, np.nan).astype(np.float32)
    start = (low + setting.probe.origin)[list(across)]
    return heights.reshape(rows, columns), start, start + span[list(across)]
