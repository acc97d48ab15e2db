"""Where the objects of a varied scene stand, and which of them are there at all.

What is absent has no triangles: it costs nothing to trace, unlike a hidden object, which stays in the structure that rays are
traced through. Its place in the list stays, so every object_id is the same under every seed.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..transforms import Matrix, rigid, translation
from .description import Deformed, Mesh, SceneDescription
from .variation_draws import Draws, groups
from .variation_file import Placement, Variation
from .variation_light import rotation_about


def vary_places(scene: SceneDescription, variation: Variation, seed: int, file: Path | None) -> SceneDescription:
    """The scene with groups shifted, turned and scaled. Raises InputError for patterns that match nothing."""
    if not variation.placement:
        return scene
    names = [item.name for item in scene.objects]
    placed = np.tile(np.eye(4), (len(names), 1, 1))  # world from the world before
    start, poses = scene.world_from_object(0.0), scene.deformed(0.0) if scene.deformed else {}
    for number, rule in enumerate(variation.placement):
        draws = Draws(seed, "placement", number)
        for group, members in groups(rule.objects, names, file, f"placement.{number}.objects").items():
            low_middle = _underside(scene, members, placed @ start, poses)
            matrix = _place(scene, rule, draws, group, low_middle)
            placed[members] = matrix @ placed[members]
    world_from_object = scene.world_from_object
    return replace(scene, world_from_object=lambda time_s: placed @ world_from_object(time_s))


def _underside(scene: SceneDescription, members: list[int], world: NDArray, poses: dict[int, Deformed]) -> NDArray[np.float64]:
    """[3], middle of the bottom of the bounding box of objects at `world` [objects, 4, 4]; poses: of what deforms."""
    corners = []
    for index in members:
        mesh = scene.objects[index].mesh
        positions = poses.get(mesh, scene.meshes[mesh]).positions.astype(np.float64)
        if len(positions):
            points = positions @ world[index, :3, :3].T + world[index, :3, 3]
            corners += [points.min(axis=0), points.max(axis=0)]
    if not corners:
        return np.zeros(3)
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return np.where(scene.up > 0, low, (low + high) / 2)


def _place(scene: SceneDescription, rule: Placement, draws: Draws, group: str, pivot: NDArray) -> Matrix:
    shift = [draws.within((-half, half), group, f"shift.{axis}") for axis, half in enumerate(rule.shift)]
    angle = np.radians(draws.within((-rule.turn_deg, rule.turn_deg), group, "turn_deg"))
    size = draws.within(rule.scale, group, "scale")
    turned = rigid(size * rotation_about(scene.up, float(angle)), np.zeros(3))
    return translation(pivot + np.array(shift)) @ turned @ translation(-pivot)


def vary_presence(scene: SceneDescription, variation: Variation, seed: int, file: Path | None) -> SceneDescription:
    """The scene without some of its groups. Raises InputError for patterns that match nothing."""
    names = [item.name for item in scene.objects]
    absent: set[int] = set()
    for number, rule in enumerate(variation.absent):
        draws = Draws(seed, "absent", number)
        share = draws.within(rule.share, "", "share")
        found = groups(rule.objects, names, file, f"absent.{number}.objects")
        absent |= {index for group, members in found.items() if draws.number(group, "gone") < share for index in members}
    return _without(scene, absent) if absent else scene


def _without(scene: SceneDescription, absent: set[int]) -> SceneDescription:
    """An empty mesh for each absent object, so that none is an instance, and it stands still; meshes that nothing draws any
    longer are emptied."""
    meshes, objects = list(scene.meshes), list(scene.objects)
    drawn = {item.mesh for index, item in enumerate(objects) if index not in absent}
    gone = {objects[index].mesh for index in absent} - drawn
    for index in sorted(absent):
        objects[index] = replace(objects[index], mesh=len(meshes), moves=False)
        meshes.append(_empty(objects[index].name))
    for index in gone:
        meshes[index] = _empty(meshes[index].name)
    deformed, world_from_object, missing = scene.deformed, scene.world_from_object, sorted(absent)
    start = np.array(world_from_object(0.0))[missing]

    def world(time_s: float) -> NDArray[np.float64]:
        matrices = np.array(world_from_object(time_s))
        matrices[missing] = start
        return matrices

    kept = (lambda time_s: {k: v for k, v in deformed(time_s).items() if k not in gone}) if deformed else None
    return replace(scene, meshes=tuple(meshes), objects=tuple(objects), world_from_object=world, deformed=kept)


def _empty(name: str) -> Mesh:
    return Mesh(name=name, positions=np.zeros((0, 3), np.float32), faces=np.zeros((0, 3), np.uint32))
