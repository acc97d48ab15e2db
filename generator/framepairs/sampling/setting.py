"""What all sampled paths of a scene share: its free space, what counts as seen, and how large a metre is."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..scene.description import SceneDescription
from .bounds import work_bounds
from .coverage import Coverage, make_coverage
from .files import SamplingOptions
from .free_space import FreeSpace, air_around, explore, make_grid, reachable, stands_on_ground
from .probe import Probe, animation_times, drawn_objects, make_probe
from .routes import Walks, make_walks
from .styles import styles_of

SMALL_M = 4.0  # scenes smaller than this get smaller heights, speeds and clearance
CLEARANCE_M, VIEW_M, NEAR_M = 0.3, 20.0, 1.5
POSES = 6  # of a moving scene, to find free space


@dataclass(frozen=True)
class Setting:
    """What all paths share. unit: scene units per metre of the styles. clearance: scene units. walks: by the style's name."""

    probe: Probe
    space: FreeSpace
    options: SamplingOptions
    unit: float
    clearance: float
    walks: dict[str, Walks]
    coverage: Coverage


def prepare(scene: SceneDescription, options: SamplingOptions) -> Setting:
    """Explore the scene's free space for the styles of `options`."""
    styles = styles_of(tuple(dict.fromkeys(options.styles)))
    times = animation_times(scene, (options.frames - 1) / options.fps, POSES)
    if not drawn_objects(scene, times).objects:
        raise InputError("has no surfaces, so nothing to go past", file=scene.files[0] if scene.files else scene.name)
    fitted = work_bounds(drawn_objects(scene, times), times)
    given = options.bounds and (np.array(options.bounds[:3]), np.array(options.bounds[3:]))
    bounds = given or fitted
    origin = (bounds[0] + bounds[1]) / 2
    up = "XYZ".index(scene.up_axis)
    extent_m = float(np.max(fitted[1] - fitted[0])) * scene.metres_per_unit
    if not extent_m > 0:
        raise InputError("has no extent, so nothing to go past", file=scene.files[0] if scene.files else scene.name)
    unit = min(1.0, extent_m / SMALL_M) / scene.metres_per_unit
    clearance = CLEARANCE_M * unit if options.clearance_m is None else options.clearance_m / scene.metres_per_unit
    farthest = VIEW_M * unit if options.view_distance_m is None else options.view_distance_m / scene.metres_per_unit
    cell = None if options.cell_m is None else options.cell_m / scene.metres_per_unit
    probe = make_probe(scene, origin, times)
    local = (bounds[0] - origin, bounds[1] - origin)
    ground = stands_on_ground(probe, local, up)
    heights = tuple(
        f(values) * unit for f, values in ((min, [s.height_m[0] for s in styles]), (max, [s.height_m[1] for s in styles]))
    )
    local = local if options.bounds else air_around(probe, local, up, heights[1], ground)
    grid = make_grid(local, up, heights, cell, clearance, ground)
    near = max(NEAR_M * unit, heights[0] * 1.5) + float(grid.size.max())
    space = explore(probe, grid, heights, clearance, near, options.rays, ground)
    nodes = {s.name: reachable(space, _scaled(s.height_m, unit), s.step_m and s.step_m * unit) for s in styles}
    walks = {s.name: make_walks(space, nodes[s.name], s, unit, clearance) for s in styles}
    coverage = make_coverage(space, list(nodes.values()), farthest)
    if not len(coverage.cells):
        raise InputError("no surface lies near where cameras may go", field="bounds")
    return Setting(probe, space, options, unit, clearance, walks, coverage)


def _scaled(values: tuple[float, float], unit: float) -> tuple[float, float]:
    return values[0] * unit, values[1] * unit
