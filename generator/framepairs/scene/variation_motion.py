"""How the objects of a varied scene move: each group at its own rate, after its own delay, by its own amplitude."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..transforms import Matrix, quaternion_from_rotation, rigid, rotation_from_quaternion
from .description import Deformed, SceneDescription
from .variation_draws import Draws, groups
from .variation_file import Timing, Variation

SAMPLES = 33  # of the animation, to find what an object turns about
MOST_DEG = 170.0  # a turn beyond is near a half turn, whose axis and multiples are ambiguous
ROUNDING = 1e-6  # of rotations that come from float32 files


@dataclass(frozen=True)
class Clock:
    """The animation's time of one group, and the share of its displacement that is left."""

    rate: float = 1.0
    delay_s: float = 0.0
    amplitude: float = 1.0
    cycle_s: float | None = None

    def at(self, time_s: float) -> float:
        passed = self.rate * (time_s - self.delay_s)
        return passed % self.cycle_s if self.cycle_s is not None else max(passed, 0.0)


def vary_motion(scene: SceneDescription, variation: Variation, seed: int, file: Path | None) -> SceneDescription:
    """The scene with other clocks; the last rule that matches an object counts.

    Raises InputError for patterns that match nothing or nothing that moves, and for an amplitude of what turns by half a turn.
    """
    clocks = _clocks(scene, variation.animation, seed, file)
    if not clocks:
        return scene
    scaled = {index: field for index, (clock, field) in clocks.items() if clock.amplitude != 1}
    start = scene.world_from_object(0.0)
    pivots = _pivots(scene, start, scaled, file)
    times = {index: clock for index, (clock, _) in clocks.items()}
    world_from_object, visible, deformed = scene.world_from_object, scene.visible, scene.deformed
    meshes, objects, posed = _split(scene, times)

    def world(time_s: float) -> NDArray[np.float64]:
        matrices = _by_clock(world_from_object, times, time_s)
        for index, pivot in pivots.items():
            matrices[index] = _scaled(matrices[index], start[index], times[index].amplitude, pivot)
        return matrices

    def vertices(time_s: float) -> dict[int, Deformed]:
        at = {mesh: clock.at(time_s) if clock else time_s for mesh, (_, clock) in posed.items()}
        poses = {time: deformed(time) for time in {*at.values(), *([0.0] if scaled else [])}}
        found = {}
        for mesh, (source, clock) in posed.items():
            pose, first = poses[at[mesh]].get(source), poses.get(0.0, {}).get(source)
            if pose is not None:
                found[mesh] = pose if clock is None else _exaggerated(first or pose, pose, clock.amplitude)
        return found

    still = {index for index, clock in times.items() if clock.rate == 0 or (clock.amplitude == 0 and visible is None)}
    return replace(
        scene,
        meshes=meshes,
        objects=tuple(replace(item, moves=item.moves and index not in still) for index, item in enumerate(objects)),
        world_from_object=world,
        visible=(lambda time_s: _by_clock(visible, times, time_s)) if visible else None,
        deformed=vertices if deformed else None,
    )


def _clocks(scene, rules: tuple[Timing, ...], seed: int, file: Path | None) -> dict[int, tuple[Clock, str]]:
    """By object: its clock, and the rule's place in the file."""
    found: dict[int, tuple[Clock, str]] = {}
    names = [item.name for item in scene.objects]
    for number, rule in enumerate(rules):
        draws, field = Draws(seed, "animation", number), f"animation.{number}"
        matched = groups(rule.objects, names, file, f"{field}.objects")
        if not any(scene.objects[index].moves for members in matched.values() for index in members):
            raise InputError(f"nothing that moves is named {', '.join(rule.objects)}", file=file, field=f"{field}.objects")
        for group, members in matched.items():
            rate, delay, amplitude = (draws.within(getattr(rule, key), group, key) for key in ("rate", "delay_s", "amplitude"))
            clock = Clock(rate, delay, amplitude, rule.cycle_s)
            found |= {index: (clock, field) for index in members if scene.objects[index].moves}
    return found


def _split(scene: SceneDescription, times: dict[int, Clock]):
    """(meshes, objects, and for each mesh that deforms: whose pose it has, by whose clock). Objects that share a mesh that
    deforms and have different clocks get one each."""
    meshes, objects = list(scene.meshes), list(scene.objects)
    given: dict[tuple[int, Clock | None], int] = {}
    for index, item in enumerate(scene.objects):
        if scene.meshes[item.mesh].deforms:
            key = (item.mesh, times.get(index))
            if key not in given:
                is_first = all(source != item.mesh for source, _ in given)
                given[key] = item.mesh if is_first else len(meshes)
                meshes += [] if is_first else [scene.meshes[item.mesh]]
            objects[index] = replace(item, mesh=given[key])
    return tuple(meshes), objects, {mesh: key for key, mesh in given.items()}


def _by_clock(value_at, times: dict[int, Clock], time_s: float) -> NDArray:
    """What `value_at(time)` gives per object, each object at its own time."""
    values = np.array(value_at(time_s))
    at: dict[float, list[int]] = {}
    for index, clock in times.items():
        at.setdefault(clock.at(time_s), []).append(index)
    for time, indices in at.items():
        values[indices] = value_at(time)[indices]
    return values


def _pivots(scene: SceneDescription, start: NDArray, fields: dict[int, str], file: Path | None) -> dict[int, NDArray]:
    """What each object turns about [3]: the hinge that stays in place, where there is one, else its own origin at time 0.
    Objects that move as one share the first one's, so that they stay together."""
    if not fields:
        return {}
    end = scene.animation_end_s
    sampled = np.array([scene.world_from_object(end * k / (SAMPLES - 1)) for k in range(SAMPLES)])
    pivots: dict[int, NDArray] = {}
    known: list[tuple[NDArray, NDArray]] = []
    for index, field in fields.items():
        if np.array_equal(sampled[:, index], np.broadcast_to(start[index], sampled[:, index].shape)):
            continue  # it deforms in its place: there is nothing to scale
        relative = _relative(sampled[:, index], start[index])
        if relative is None:
            pivots[index] = start[index, :3, 3]
            continue
        turned = np.degrees(np.arccos(np.clip((np.trace(relative[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1)))
        if turned.max() > MOST_DEG:
            problem = f"{scene.objects[index].name} turns by {turned.max():.0f} degrees: what spins has a rate, no amplitude"
            raise InputError(problem, file=file, field=f"{field}.amplitude")
        same = next((pivot for other, pivot in known if np.allclose(other, relative, atol=1e-5)), None)
        pivots[index] = _pivot(relative, start[index, :3, 3]) if same is None else same
        known.append((relative, pivots[index]))
    return pivots


def _relative(matrices: NDArray, start: Matrix) -> NDArray | None:
    """[..., 4, 4] in the world against `start`; None where that is not rigid."""
    if abs(np.linalg.det(start[:3, :3])) < 1e-12:
        return None
    relative = matrices @ np.linalg.inv(start)
    linear = relative[..., :3, :3]
    rigid_ones = np.allclose(np.swapaxes(linear, -1, -2) @ linear, np.eye(3), atol=ROUNDING)
    return relative if rigid_ones and (np.linalg.det(linear) > 0).all() else None


def _pivot(relative: NDArray, origin: NDArray) -> NDArray[np.float64]:
    """The point that stays in place in all of `relative` [n, 4, 4], near `origin`, by least squares; else the origin."""
    missing = (np.eye(3) - relative[:, :3, :3]).reshape(-1, 3)
    shift = (relative[:, :3, :3] @ origin + relative[:, :3, 3] - origin).reshape(-1)
    offset = np.linalg.lstsq(missing, shift, rcond=1e-6)[0]
    left = np.abs(missing @ offset - shift).max()
    return origin + offset if left <= 1e-4 * max(np.abs(shift).max(), 1e-9) else origin


def _scaled(matrix: Matrix, start: Matrix, amplitude: float, pivot: NDArray) -> Matrix:
    """`start` moved by a share of what leads from it to `matrix`: the angle of its rotation about `pivot`, and the pivot's
    shift; the matrix's components where it is not rigid."""
    relative = _relative(matrix, start)
    if relative is None:
        return start + amplitude * (matrix - start)
    quaternion = quaternion_from_rotation(relative[:3, :3])
    quaternion = quaternion if quaternion[0] >= 0 else -quaternion
    sine = np.linalg.norm(quaternion[1:])
    half = amplitude * np.arctan2(sine, quaternion[0])
    axis = quaternion[1:] / max(sine, 1e-300)
    turn = rotation_from_quaternion(np.array([np.cos(half), *(np.sin(half) * axis)]))
    shift = relative[:3, :3] @ pivot + relative[:3, 3] - pivot
    return rigid(turn, pivot + amplitude * shift - turn @ pivot) @ start


def _exaggerated(first: Deformed, pose: Deformed, amplitude: float) -> Deformed:
    """Displacements from the first pose times `amplitude`; normals are mixed in the same way and brought to unit length."""
    if amplitude == 1:
        return pose
    positions = (first.positions + amplitude * (pose.positions.astype(np.float64) - first.positions)).astype(np.float32)
    if pose.normals is None or first.normals is None:
        return Deformed(positions=positions, normals=pose.normals)
    mixed = first.normals + amplitude * (pose.normals.astype(np.float64) - first.normals)
    length = np.linalg.norm(mixed, axis=1, keepdims=True)
    normals = np.where(length > 1e-6, mixed / np.maximum(length, 1e-6), pose.normals)
    return Deformed(positions=positions, normals=normals.astype(np.float32))
