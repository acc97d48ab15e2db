"""Scenes whose answers are known by hand, and the shortest way to render one."""

from collections.abc import Callable

import numpy as np

from framepairs.camera_path import CameraPath, make_camera_path
from framepairs.channels import CHANNELS
from framepairs.frame import Shoot
from framepairs.plan import RenderPlan, make_plan
from framepairs.scene.description import Environment, Light, Material, Mesh, SceneDescription, SceneObject, Texture

ALL = frozenset(channel.name for channel in CHANNELS)
IDENTITY = np.eye(4)


def quad(width: float, height: float, name: str = "quad") -> Mesh:
    """A rectangle in the plane z = 0 around the origin, facing +z, uv (0, 0) at its lower left."""
    x, y = width / 2, height / 2
    return Mesh(
        name=name,
        positions=np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        normals=np.array([[0, 0, 1]] * 4, np.float32),
        uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    )


def uv_sphere(columns: int = 64, rows: int = 32) -> Mesh:
    """The unit sphere with its exact normals, poles on the y axis."""
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, columns + 1)[None, :]
    points = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta) * np.ones_like(phi), np.sin(theta) * np.cos(phi)], axis=-1)
    uv = np.stack(np.broadcast_arrays(phi / (2 * np.pi), 1 - theta / np.pi), axis=-1)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    down, right = columns + 1, 1
    faces = np.concatenate(
        [np.stack([first, first + down, first + right], 1), np.stack([first + right, first + down, first + down + right], 1)]
    )
    flat = points.reshape(-1, 3).astype(np.float32)
    area = np.linalg.norm(np.cross(flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]]), axis=1)
    return Mesh(
        name="sphere",
        positions=flat,
        faces=faces[area > 1e-9].astype(np.uint32),  # the poles' triangles have no area
        normals=flat.copy(),
        uv=uv.reshape(-1, 2).astype(np.float32),
    )


def at(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def constant_sky(radiance=(0.0, 0.0, 0.0)) -> Environment:
    return Environment(name="constant", texels=np.broadcast_to(np.float32(radiance), (8, 16, 3)).copy())


def make_scene(
    *parts: tuple[Mesh, Material, np.ndarray | Callable[[float], np.ndarray]],
    sky: Environment | None = None,
    lights: tuple[Light, ...] = (),
    textures: tuple[Texture, ...] = (),
) -> SceneDescription:
    """One object for each (mesh, material, world_from_object or a function of time that gives it)."""
    moves = [callable(matrix) for _, _, matrix in parts]

    def world_from_object(time_s: float) -> np.ndarray:
        matrices = [matrix(time_s) if callable(matrix) else matrix for _, _, matrix in parts]
        return np.array(matrices, dtype=float).reshape(-1, 4, 4)

    return SceneDescription(
        name="analytic",
        files=(),
        meshes=tuple(mesh for mesh, _, _ in parts),
        materials=tuple(material for _, material, _ in parts),
        textures=textures,
        objects=tuple(SceneObject(name=f"part {k}", mesh=k, material=k, moves=m) for k, m in enumerate(moves)),
        lights=lights,
        environment=sky or constant_sky(),
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=world_from_object,
    )


def path_of(*matrices: np.ndarray, fov_y_deg: float = 60, cuts: tuple[int, ...] = (), **keys) -> CameraPath:
    """One frame for each camera matrix, at one frame per second."""
    poses = [
        {"time": k, "world_from_camera": np.asarray(matrix).tolist(), "cut": k in cuts} for k, matrix in enumerate(matrices)
    ]
    return make_camera_path({"version": 1, "fps": 1, "fov_y_deg": fov_y_deg, "near": 0.01, "far": 1000, **keys, "poses": poses})


def plan_of(**keys) -> RenderPlan:
    defaults = {"display": (48, 27), "scales": (2,), "antialiasing": 4, "brdf_table": 64, "channels": "all"}
    return make_plan(defaults | keys)


class Stage:
    """A scene, a path and an engine; `arrays` renders one stream of one frame."""

    def __init__(self, scene: SceneDescription, path: CameraPath, **plan):
        from framepairs.engine import Engine
        from framepairs.plan import plan_streams

        self.plan = plan_of(**plan)
        self.shoot = Shoot(scene, path, self.plan.display[0] / self.plan.display[1], self.plan.motion_offsets)
        self.engine = Engine(scene, self.plan)
        self.streams = {stream.name: stream for stream in plan_streams(self.plan)}

    def arrays(self, frame: int = 0, stream: str = "hr", channels: frozenset[str] = ALL) -> dict[str, np.ndarray]:
        return self.engine.render(self.shoot.state(frame), self.streams[stream], channels, 0).arrays


def camera_basis(stage: Stage, frame: int = 0) -> tuple[np.ndarray, float, float]:
    """(world_from_camera, tangent of half the field of view in x, in y)."""
    camera = stage.shoot.camera(frame)
    tangent = np.tan(camera.fov_y / 2)
    return camera.world_from_camera, tangent * camera.aspect, tangent


def fractions(width: int, height: int, jitter: tuple[float, float] = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Fractions of the frame [height, width] that the pixels sample: (centre - J) / size."""
    x = (np.arange(width) + 0.5 - jitter[0]) / width
    y = (np.arange(height) + 0.5 - jitter[1]) / height
    return np.meshgrid(x, y)


def project(point: np.ndarray, world_from_camera: np.ndarray, tan_x: float, tan_y: float) -> np.ndarray:
    """Float64 fractions of the frame [..., 2] of world points [..., 3]."""
    local = np.concatenate([point, np.ones_like(point[..., :1])], axis=-1) @ np.linalg.inv(world_from_camera).T
    x, y, z = local[..., 0], local[..., 1], -local[..., 2]
    return np.stack([0.5 + 0.5 * x / (z * tan_x), 0.5 - 0.5 * y / (z * tan_y)], axis=-1)
