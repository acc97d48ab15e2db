"""Motion of a skinned and morphing glTF figure at 1920 x 1080, against float64 rays through the figure's own triangles."""

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, fractions, path_of, project
from framepairs.conventions import Stream
from framepairs.frame import Shoot
from framepairs.scene import light_scene
from gltf_files import GltfFile, turned_about_z

SIZE = (1920, 1080)
PICKED = 20_000  # pixels that are compared


def strip() -> tuple[np.ndarray, np.ndarray]:
    """A strip 2 long and 0.6 wide in the plane z = 0, 12 x 3 quads."""
    x, y = np.meshgrid(np.linspace(0, 2, 13), np.linspace(-0.3, 0.3, 4))
    first = (np.arange(3)[:, None] * 13 + np.arange(12)).ravel()
    faces = np.concatenate([np.stack([first, first + 1, first + 14], 1), np.stack([first, first + 14, first + 13], 1)])
    return np.float32(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)), faces


def skinned(file: GltfFile, place) -> None:
    """An upper arm that stands and a forearm that turns by 40 degrees a second about the elbow at x = 1."""
    positions, faces = strip()
    forearm = np.clip((positions[:, 0] - 0.7) / 0.6, 0, 1)
    weights = np.stack([1 - forearm, forearm, 0 * forearm, 0 * forearm], axis=1).astype(np.float32)
    joints = np.tile(np.uint8([0, 1, 0, 0]), (len(positions), 1))
    mesh = file.mesh(positions, faces, NORMAL=np.float32([[0, 0, 1]] * len(positions)), JOINTS_0=joints, WEIGHTS_0=weights)
    elbow = file.node(translation=[1, 0, 0])
    shoulder = file.node(translation=list(place), children=[elbow])
    unbind = np.tile(np.eye(4), (2, 1, 1))
    unbind[1, 0, 3] = -1
    file.node(mesh=mesh, skin=file.skin([shoulder, elbow], unbind))
    file.clip((elbow, "rotation", [0, 2], [turned_about_z(0), turned_about_z(80)], "LINEAR"))


def morphing(file: GltfFile, place) -> None:
    """A strip whose vertices wave out of its plane."""
    positions, faces = strip()
    wave = np.zeros_like(positions)
    wave[:, 2], wave[:, 1] = 0.4 * np.sin(3 * positions[:, 0]), 0.2 * positions[:, 0]
    mesh = file.mesh(positions, faces, NORMAL=np.float32([[0, 0, 1]] * len(positions)), targets=[{"POSITION": wave}])
    node = file.node(mesh=mesh, translation=list(place))
    file.clip((node, "weights", [0, 2], [0, 1], "LINEAR"))


def hit(origin: np.ndarray, rays: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(triangle, barycentric u and v [n, 2]) of the nearest hit of each ray; triangle -1 where there is none."""
    best, found, place = np.full(len(rays), np.inf), np.full(len(rays), -1), np.zeros((len(rays), 2))
    for k, (a, b, c) in enumerate(corners):
        across = np.cross(rays, c - a)
        determinant = across @ (b - a)
        s = origin - a
        q = np.cross(s, b - a)
        u, v, t = (across @ s) / determinant, (rays @ q) / determinant, (q @ (c - a)) / determinant
        nearer = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < best)
        best[nearer], found[nearer], place[nearer] = t[nearer], k, np.stack([u, v], axis=1)[nearer]
    return found, place


@pytest.mark.parametrize("figure", [skinned, morphing])
@pytest.mark.parametrize("far_away", [0.0, 1e6])
def test_motion_of_a_figure(tmp_path, figure, far_away):
    file = GltfFile()
    place = np.array([far_away, -far_away, far_away])
    figure(file, place)
    scene, _ = light_scene(file.load(tmp_path), None)
    cameras = [at(*(place + [0.95, 0.05, 1.6])), at(*(place + [1.0, 0.1, 1.5]))]
    stage = Stage(scene, path_of(*cameras, far=100.0))
    stage.shoot = Shoot(scene, stage.shoot.path, SIZE[0] / SIZE[1])
    frame = Stream(name="hr", size=SIZE)
    arrays = stage.engine.render(stage.shoot.state(1), frame, frozenset({"motion", "object_id"}), 0).arrays
    # the figure in float64 around `place`, so that 1e6 costs the reference nothing either
    faces = scene.meshes[0].faces
    now, before = (
        (scene.deformed(t)[0].positions.astype(float) @ m[:3, :3].T + (m[:3, 3] - place))
        for t in (1.0, 0.0)
        for m in [scene.world_from_object(t)[0]]
    )
    _, tan_x, tan_y = camera_basis(stage, 1)
    picked = np.random.default_rng(4).choice(SIZE[0] * SIZE[1], PICKED, replace=False)
    x, y = (v.ravel()[picked] for v in fractions(*SIZE))
    rays = np.stack([(2 * x - 1) * tan_x, (1 - 2 * y) * tan_y, -np.ones_like(x)], axis=1)
    face, uv = hit(np.array([1.0, 0.1, 1.5]), rays, now[faces])
    a, b, c = (before[faces[np.maximum(face, 0)][:, k]] for k in range(3))
    then = a + uv[:, :1] * (b - a) + uv[:, 1:] * (c - a)
    expected = (project(then, at(0.95, 0.05, 1.6), tan_x, tan_y) - np.stack([x, y], axis=1)) * SIZE
    seen = (face >= 0) & (arrays["object_id"].ravel()[picked] == 1)
    # triangles meet at edges, where a ray may go to either: not those
    inside = seen & (np.minimum(uv.min(axis=1), 1 - uv.sum(axis=1)) > 1e-4)
    error = np.abs(arrays["motion"].reshape(-1, 2)[picked] - expected)[inside]
    assert inside.sum() > 2000 and np.abs(expected[inside]).max() > 100
    assert np.median(error) <= 1e-4 and error.max() <= (1e-2 if far_away else 5e-3)
