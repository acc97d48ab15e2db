"""Ten thousand animated instances: told apart, moved, and no slower to look at than one."""

import numpy as np

from analytic import Stage, at, camera_basis, fractions, path_of, project, quad
from framepairs.scene.description import Environment, Material, SceneDescription, SceneObject

COUNT, DISPLAY = 10_000, (192, 108)
ERROR = 200 * 16 * 10 / 3 * 2.0**-24  # as in test_motion


def crowd() -> SceneDescription:
    """100 x 100 cards of one mesh on the plane z = -10, of which every hundredth slides."""
    places = np.array([[(i - 49.5) * 0.2, (j - 49.5) * 0.12, -10.0] for j in range(100) for i in range(100)])
    still = np.tile(np.eye(4), (COUNT, 1, 1))
    still[:, :3, 3] = places

    def world_from_object(seconds: float) -> np.ndarray:
        matrices = still.copy()
        matrices[::100, 0, 3] += 0.05 * seconds
        return matrices

    return SceneDescription(
        name="crowd", files=(), meshes=(quad(0.15, 0.1),), materials=(Material(name="card"),), textures=(),
        objects=tuple(SceneObject(name=str(k), mesh=0, material=0, moves=k % 100 == 0) for k in range(COUNT)),
        lights=(), environment=Environment(name="black", texels=np.zeros((1, 2, 3), np.float32)), up_axis="Y",
        metres_per_unit=1.0, world_from_object=world_from_object,
    )  # fmt: skip


def test_ten_thousand_instances():
    scene = crowd()
    stage = Stage(scene, path_of(*[np.eye(4)] * 4, far=100.0), display=DISPLAY)
    channels = frozenset({"object_id", "motion", "dual_motion", "visibility", "depth"})
    for frame in range(4):
        arrays = stage.arrays(frame, "hr", channels)
    _, tan_x, tan_y = camera_basis(stage, 3)
    x, y = fractions(*DISPLAY)
    point = np.stack([(2 * x - 1) * tan_x * 10, (1 - 2 * y) * tan_y * 10, np.full_like(x, -10)], axis=-1)
    identity = arrays["object_id"][..., 0].astype(int)
    centre = scene.world_from_object(3.0)[identity - 1, :3, 3]
    seen = identity > 0
    assert seen.mean() > 0.3 and len(np.unique(identity)) > 5000
    assert (np.abs(point - centre)[seen] <= [0.075 + 1e-5, 0.05 + 1e-5, 1e-5]).all()
    slides = seen & ((identity - 1) % 100 == 0)
    then = np.where(slides[..., None], point - [0.05, 0, 0], point)
    expected = (project(then, np.eye(4), tan_x, tan_y) - np.stack([x, y], -1)) * DISPLAY
    assert slides.sum() > 50 and np.abs(arrays["motion"] - expected)[seen].max() < ERROR
    assert not arrays["motion"][seen & ~slides].any() and not arrays["motion"][~seen].any()


def test_a_camera_among_them_moves_on():
    stage = Stage(crowd(), path_of(np.eye(4), at(0.1, 0, 0)), display=(48, 27))
    arrays = stage.arrays(1, "hr", frozenset({"object_id", "motion"}))
    assert (np.abs(arrays["motion"][arrays["object_id"][..., 0] > 0]) > 0).any()
