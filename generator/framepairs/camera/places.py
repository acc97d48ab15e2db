"""Where the objects of a scene are: what cameras look at, orbit and follow."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ..errors import InputError
from ..scene.description import SceneDescription
from ..transforms import Matrix, rigid

NAMED = 8  # names that a message shows


def object_places(scene: SceneDescription) -> Callable[[str, float], Matrix]:
    """A function of a name and a time of the animation to a rigid matrix [4, 4]: the middle of the bounds in world axes of the
    object of that name, or of all whose name starts with NAME/, and the rotation of the first of them.

    Bounds are those of the corners of each mesh's box, transformed. An unknown name raises InputError.
    """
    names = [item.name for item in scene.objects]

    @lru_cache
    def chosen(name: str) -> tuple[int, ...]:
        found = [k for k, other in enumerate(names) if other == name or other.startswith(name + "/")]
        if not found:
            some = ", ".join(sorted(set(names))[:NAMED]) + (", ..." if len(set(names)) > NAMED else "")
            raise InputError(f"the scene has no object {name!r} ({some})")
        return tuple(found)

    @lru_cache(maxsize=4)
    def at(time_s: float):
        return scene.world_from_object(time_s), scene.deformed(time_s) if scene.deformed else {}

    @lru_cache
    def still_box(mesh: int) -> np.ndarray:
        return _box(scene.meshes[mesh].positions)

    @lru_cache(maxsize=4096)
    def place_of(name: str, time_s: float) -> Matrix:
        matrices, deformed = at(time_s)
        corners = [
            (_box(deformed[mesh].positions) if mesh in deformed else still_box(mesh)) @ matrices[k][:3, :3].T
            + matrices[k][:3, 3]
            for k in chosen(name)
            for mesh in (scene.objects[k].mesh,)
        ]
        stacked = np.concatenate(corners)
        place = rigid(_rotation(matrices[chosen(name)[0]][:3, :3]), (stacked.min(axis=0) + stacked.max(axis=0)) / 2)
        place.flags.writeable = False
        return place

    return place_of


def _box(positions: np.ndarray) -> np.ndarray:
    """Corners [8, 3]; of no vertices the origin alone, [1, 3]."""
    if len(positions) == 0:
        return np.zeros((1, 3))
    ends = np.stack([positions.min(axis=0), positions.max(axis=0)]).astype(float)
    return np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(8, 3)


def _rotation(linear: np.ndarray) -> np.ndarray:
    """The nearest rotation to a 3x3 matrix."""
    left, _, right = np.linalg.svd(linear)
    return left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right
