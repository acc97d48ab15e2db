"""Candidates for one camera path: walks from where most is unseen, smoothed, with viewing directions, and their checks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..backend import mi
from ..camera_path import CameraPath, make_camera_path
from ..transforms import Vector
from .clearance import clearance_of
from .coverage import lacking, median_motion, seen_cells
from .gaze import choose_gaze, heading_of, worth_around
from .path_frames import PathFrames, PathPoints, frames_of, points_of
from .probe import first_hits
from .routes import arc_lengths, at_arcs, free_length, over_ground, routes_from, smoothed
from .setting import Setting
from .styles import Style
from .takes import keyframes_for, make_schedule, path_values

STARTS, GOALS = 2, 2
CLOSE = 5.0  # clearances within which a surface is too near to be looked at
POOL = 256  # cells among which the starts are looked for
SMOOTHINGS = (2.0, 1.0, 0.5)  # standard deviations in cells, the smoothest first
SHORTENINGS = (1.0, 0.7, 0.45)  # of a path that would turn too fast: the same in the same time


@dataclass(frozen=True)
class Take:
    """One path. values: its file's JSON, which `path` is made of. moving_s: seconds of movement. pace: its length over what
    its speed asks for. What follows is known once it
    is checked: seen: cells that count, as indices. clearance, in scene units: what it keeps. motion: pixels a frame."""

    style: Style
    values: dict[str, Any]
    path: CameraPath
    frames: PathFrames
    moving_s: float
    pace: float
    points: PathPoints | None = None
    seen: NDArray[np.int64] | None = None
    clearance: float = 0.0
    motion: float = 0.0

    @property
    def middle(self) -> Vector:
        """Mean place [3], relative to the probe's origin."""
        return self.frames.cameras[:, :3, 3].mean(axis=0)


def fov_of(values: dict[str, Any]) -> float:
    return math.radians(values["fov_y_deg"])


def checked(setting: Setting, take: Take) -> Take | None:
    """The take with what it sees, or None where it comes too close to a surface, or leaves the heights over the ground."""
    probe, scene, up = setting.probe, setting.probe.posed(setting.probe.times[0]), setting.space.grid.up
    if not _keeps_height(setting, scene, take):
        return None
    points = points_of(take.path, probe.scene.up, take.frames, setting.clearance, probe.origin)
    clearance = clearance_of(scene, points, setting.clearance, setting.options.check_rays, up)
    if clearance < setting.clearance:
        return None
    cameras, fov = take.frames.cameras, fov_of(take.values)
    seen = seen_cells(setting.coverage, scene, [cameras], [fov])[0]
    motion = median_motion(scene, cameras, fov, 10 * setting.coverage.farthest)
    return replace(take, points=points, seen=seen, clearance=clearance, motion=motion)


def _keeps_height(setting: Setting, scene: mi.Scene, take: Take) -> bool:
    """Whether each frame has ground below, within the style's heights, give or take a step of the ground."""
    if not setting.space.has_ground:
        return True
    places = take.frames.cameras[:, :3, 3]
    height = first_hits(scene, places, np.tile(-np.eye(3)[setting.space.grid.up], (len(places), 1))) / setting.unit
    low, high = take.style.height_m
    slack = take.style.step_m if take.style.step_m is not None else high
    return bool(np.all((height >= max(low - slack, low / 2)) & (height <= high + slack)))


def candidates(setting: Setting, style: Style, index: int, rng, others: Sequence[Take]) -> list[Take]:
    """Takes that turn no faster than the style may, in the order in which they were found; unchecked otherwise."""
    walks, coverage, options, up = setting.walks[style.name], setting.coverage, setting.options, setting.space.grid.up
    cell, scene = float(setting.space.grid.size.max()), setting.probe.posed(setting.probe.times[0])
    seconds = (options.frames - 1) / options.fps
    speed, height = rng.uniform(*style.speed_m_s) * setting.unit, rng.uniform(*style.height_m) * setting.unit
    fov, length = float(rng.uniform(*style.fov_y_deg)), speed * seconds
    wanted = lacking(coverage, walks.places, coverage.farthest / 3)
    liked = wanted + distance_from(walks.places, others)
    pool = np.sort(rng.choice(len(walks.places), min(len(walks.places), 256), replace=False))
    starts = pool[np.argsort(-(liked[pool] + rng.uniform(0, 0.2, len(pool))), kind="stable")][:STARTS]
    lines = [line for start in starts for line in routes_from(walks, int(start), length, wanted, GOALS, rng)]
    spacing, found = 0.5 * setting.clearance, []
    for line in lines:
        curve = _free_curve(setting, scene, line, length, spacing, style, height)
        for share in SHORTENINGS if curve is not None else ():
            part = curve[: max(int(share * len(curve)), 2)]
            schedule = make_schedule(style, seconds, keyframes_for(arc_lengths(part)[-1], cell / 2, options.frames), rng)
            part = part[: max(int(len(part) * schedule.moving_s / seconds), 2)]
            places = at_arcs(part, schedule.gaze_fractions)
            heading = np.interp(schedule.gaze_fractions, np.linspace(0, 1, len(part)), heading_of(part, up))
            worth = worth_around(scene, coverage, places, CLOSE * setting.clearance)
            gaze = choose_gaze(worth, heading, np.diff(schedule.gaze_moving), style, math.radians(fov), rng)
            values = path_values(
                schedule, part, gaze, style, fps=options.fps, fov_y_deg=fov, origin=setting.probe.origin,
                unit=setting.unit, clearance=setting.clearance, up=up, seed=index,
            )  # fmt: skip
            path = make_camera_path(values, file="sampled path")
            frames = frames_of(path, setting.probe.scene.up, setting.probe.origin)
            if frames.turn_deg * options.fps <= style.turn_deg_s:
                pace = arc_lengths(part)[-1] / (speed * schedule.moving_s)
                found.append(Take(style, values, path, frames, schedule.moving_s, pace))
                break
    return found


def distance_from(places: NDArray, others: Sequence[Take]) -> NDArray[np.float64]:
    """Distance [n] of places to the nearest of the other paths' middles, over the largest; 0 without others."""
    if not others:
        return np.zeros(len(places))
    middles = np.array([take.middle for take in others])
    nearest = np.sqrt(np.min([np.sum((places - middle) ** 2, axis=1) for middle in middles], axis=0))
    return nearest / nearest.max() if nearest.max(initial=0) > 0 else nearest


def _free_curve(
    setting: Setting, scene: mi.Scene, line: NDArray, length: float, spacing: float, style: Style, height: float
) -> NDArray | None:
    """The smoothest curve along a walk that seems free over its whole length, else the one that is free farthest."""
    grid, best = setting.space.grid, None
    for deviation in SMOOTHINGS:
        width = deviation * float(grid.size.max())
        curve = smoothed(line, length, spacing, width)
        if setting.space.has_ground:
            curve = over_ground(scene, curve, style, height, setting.unit, grid.up, spacing, width)
        free = free_length(scene, curve, setting.clearance, grid.up)
        if free >= 2 and (best is None or free > len(best)):
            best = curve[:free]
        if free == len(curve):
            return curve
    return best
