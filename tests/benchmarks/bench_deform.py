"""What do a figure of 100 000 skinned triangles, and a wood of bending leaves, cost a frame?

python tests/benchmarks/bench_deform.py

Of the figure, its skinning, its pose on the device (upload and BVH), and motion with dual motion and visibility, over the raw
primary rays of 960 x 540. Of 1000 clusters of 450 triangles that bend alike, the pose where they share one mesh and where each
has its own. The least of five rounds.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from history import record

from analytic import Stage, at, make_scene, path_of
from framepairs.backend import dr, mi
from framepairs.gbuffer import camera_ray
from framepairs.projection import view_of
from framepairs.scene import light_scene
from framepairs.scene.description import Deformed, Material, Mesh
from gltf_files import GltfFile, turned_about_z

SIDE, JOINTS, ROUNDS, SIZE = 224, 60, 5, (960, 540)


def figure(folder: Path):
    """A sheet of 2 * 223^2 = 99 458 triangles, four random ones of 60 joints to each vertex; all joints turn."""
    file = GltfFile()
    x, y = np.meshgrid(np.linspace(0, 1, SIDE), np.linspace(0, 1, SIDE))
    k = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + SIDE], 1), np.stack([k + 1, k + SIDE + 1, k + SIDE], 1)])
    grid = np.float32(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
    random = np.random.default_rng(1)
    influences = {"JOINTS_0": random.integers(0, JOINTS, (len(grid), 4), dtype=np.uint8)}
    influences["WEIGHTS_0"] = np.float32(random.random((len(grid), 4)))
    joints = [
        file.node(name=f"j{n}", children=[n + 1] if n + 1 < JOINTS else [], translation=[0, 0.01, 0]) for n in range(JOINTS)
    ]
    mesh = file.mesh(grid, faces, NORMAL=np.float32([[0, 0, 1]] * len(grid)), **influences)
    file.node(mesh=mesh, skin=file.skin(joints))
    turns = [turned_about_z(0), turned_about_z(1)]
    file.clip(*((joint, "rotation", [0, 20], turns, "LINEAR") for joint in joints))
    return file.load(folder)


def wood(shared: bool, side: int = 16, count: int = 1000):
    """Clusters in rows; all bend with the time."""
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + side], 1), np.stack([k + 1, k + side + 1, k + side], 1)])
    rest = np.float32(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
    mesh = Mesh(name="cluster", positions=rest, faces=faces.astype(np.uint32), deforms=True)
    scene = make_scene(*((mesh, Material(name="leaf"), at(n % 40, 0, -(n // 40))) for n in range(count)))

    def bent(seconds: float) -> dict[int, Deformed]:
        moved = rest + np.float32([[0, 0, 0.3 * seconds]]) * rest[:, 1:2] ** 2
        return dict.fromkeys(range(len(scene.meshes) if not shared else 1), Deformed(positions=moved))

    objects = tuple(replace(item, mesh=0 if shared else item.mesh, moves=True) for item in scene.objects)
    return replace(scene, meshes=scene.meshes[:1] if shared else scene.meshes, objects=objects, deformed=bent)


def pose_seconds(scene) -> float:
    stage, seconds = Stage(scene, path_of(*[at(20, 0.5, 5)] * (3 + ROUNDS)), display=SIZE), []
    for frame in range(1, 3 + ROUNDS):
        state = stage.shoot.state(frame)
        start = time.perf_counter()
        pose, _ = stage.engine.shading.geometry.pose(state)
        dr.sync_thread()
        seconds.append(time.perf_counter() - start)
    return min(seconds[2:])


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        scene, _ = light_scene(figure(Path(folder)), None)
    stage = Stage(scene, path_of(*[at(0.5, 0.7, 2)] * 20), display=SIZE)
    engine, costs = stage.engine, {"skinning": [], "pose": [], "motion, dual motion, visibility": [], "raw primary rays": []}
    for frame in range(1, 3 + ROUNDS):
        times = [time.perf_counter()]
        state = stage.shoot.state(frame)
        times.append(time.perf_counter())
        pose, _ = engine.shading.geometry.pose(state)
        dr.sync_thread()
        times.append(time.perf_counter())
        engine.render(state, stage.streams["hr"], frozenset({"motion", "dual_motion", "visibility"}), 0)
        times.append(time.perf_counter())
        view, index = view_of(state.camera, state.render_origin), dr.arange(mi.UInt32, SIZE[0] * SIZE[1])
        x, y = (mi.Float(index % SIZE[0]) + 0.5) / SIZE[0], (mi.Float(index // SIZE[0]) + 0.5) / SIZE[1]
        dr.eval(pose.scene.ray_intersect_preliminary(camera_ray(view, x, y), coherent=True).t)
        dr.sync_thread()
        times.append(time.perf_counter())
        for name, seconds in zip(costs, np.diff(times), strict=True):
            costs[name].append(seconds)
    least = {name: min(seconds[2:]) for name, seconds in costs.items()}
    rays = least["raw primary rays"]
    print(f"{sum(len(mesh.faces) for mesh in scene.meshes)} triangles; over raw primary rays ({1000 * rays:.1f} ms)")
    for name, seconds in least.items():
        print(f"{seconds / rays:8.1f} x  {name} ({1000 * seconds:.0f} ms)")
    one, each = (pose_seconds(wood(shared)) for shared in (True, False))
    print(f"1000 clusters that bend: pose {1000 * one:.0f} ms with one mesh, {each / one:.1f} x with a mesh for each")
    ratios = {f"{name} / raw primary rays": seconds / rays for name, seconds in least.items() if name != "raw primary rays"}
    record("deform", ratios | {"1000 clusters: a mesh for each / one mesh": each / one}, rays_ms=1000 * rays, size=list(SIZE))


if __name__ == "__main__":
    main()
