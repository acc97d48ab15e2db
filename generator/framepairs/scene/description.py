"""What a scene is, once read: plain data, whatever file it came from. Nothing here knows of Mitsuba or Dr.Jit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Texture:
    """An image with its way of being read.

    texels: [height, width, 4], uint8 or float32, first row at v = 1 (top), alpha 1 where the file has none. srgb: RGB
    are sRGB-encoded (alpha never is), which acts on uint8 texels alone. wrap: for u and v. scale, bias: applied to the decoded
    value, per component.
    """

    name: str
    texels: NDArray
    srgb: bool
    wrap: tuple[Literal["repeat", "mirror", "clamp"], Literal["repeat", "mirror", "clamp"]] = ("repeat", "repeat")
    scale: tuple[float, float, float, float] = (1, 1, 1, 1)
    bias: tuple[float, float, float, float] = (0, 0, 0, 0)


IDENTITY_UV = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Slot:
    """A texture in a material: index into SceneDescription.textures, the uv transform (rows of a 2x3 matrix), and the set of
    the mesh's texture coordinates that it transforms: 0 is Mesh.uv, 1 is Mesh.uv2."""

    texture: int
    uv: tuple[tuple[float, float, float], tuple[float, float, float]] = IDENTITY_UV
    uv_set: Literal[0, 1] = 0


@dataclass(frozen=True, kw_only=True)
class Material:
    """A metallic-roughness material. Each texture multiplies its constants.

    base_color, emission: linear Rec. 709, emission in radiance. roughness: perceptual. specular: F0 = 0.08 * specular.
    base_texture: RGB base colour, A opacity. surface_texture: R specular, G roughness, B metallic. normal_texture:
    tangent-space normal, decoded to [-1, 1] by the texture's scale and bias. vertex_colors: what the RGB of Mesh.colors
    multiplies; its alpha multiplies the opacity. emits: from both sides of a surface or from its front alone. shines: in
    `raster`, too, its emission lights other objects. bsdf: a BSDF without counterpart here, as a Mitsuba dictionary, which
    `path` draws as it is and `raster` by the values above. Without base colour, metal and specular, a material reflects
    nothing (an unlit one). not_read: properties of the file that have no counterpart here, named for `describe`.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    opacity: float = 1.0
    roughness: float = 0.5
    metallic: float = 0.0
    specular: float = 0.5
    emission: tuple[float, float, float] = (0, 0, 0)
    alpha: Literal["opaque", "mask", "blend"] = "opaque"
    alpha_cutoff: float = 0.5
    normal_scale: float = 1.0
    base_texture: Slot | None = None
    surface_texture: Slot | None = None
    normal_texture: Slot | None = None
    emission_texture: Slot | None = None
    vertex_colors: Literal["base_color", "emission"] = "base_color"
    emits: Literal["both", "front"] = "both"
    shines: bool = False
    bsdf: Mapping[str, Any] | None = None
    not_read: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Triangles in object space.

    positions: [V, 3] float32. faces: [T, 3] uint32, counter-clockwise from outside. normals: [V, 3] float32 or None for
    flat shading. uv, uv2: [V, 2] float32 with v up, or None. colors: [V, 4] float32, linear Rec. 709 and opacity, or None.
    tangents: [V, 4] float32, the unit direction of growing u and the sign of the bitangent cross(normal, tangent) w, towards
    growing v (v up); None to take them from uv. deforms: its vertices move (skin, morph targets, point cache), alike in all
    objects that have it; positions and normals are then those at time 0, and it has no tangents.
    """

    name: str
    positions: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32] | None = None
    uv: NDArray[np.float32] | None = None
    uv2: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    tangents: NDArray[np.float32] | None = None
    deforms: bool = False


@dataclass(frozen=True, kw_only=True)
class Deformed:
    """A mesh at one time: the same vertices in object space. positions: [V, 3]; normals: [V, 3] where the mesh has some."""

    positions: NDArray[np.float32]
    normals: NDArray[np.float32] | None = None


@dataclass(frozen=True, kw_only=True)
class SceneObject:
    """A leaf instance: one mesh with one material. Its object_id is 1 + its index. moves: its transform, its vertices or its
    visibility is animated. double_sided: its back faces are drawn even where the plan culls back faces."""

    name: str
    mesh: int
    material: int
    moves: bool = False
    double_sided: bool = True


@dataclass(frozen=True, kw_only=True)
class Light:
    """A light that is no object: it shines, and shows in reflections where it has an extent, but is not drawn itself.

    radiance: linear Rec. 709; irradiance on a facing surface for directional lights, radiant intensity for points and
    spots, emitted radiance for those with an extent. position: centre. direction: unit vector along which directional,
    spot, rectangle and disk lights shine (the latter two on that side alone). cone: cosines of the spot's inner and outer
    half angle. half_u, half_v: half edges of a rectangle or half axes of a disk, world vectors; a sphere's radius is the
    length of half_u.
    """

    name: str
    kind: Literal["directional", "point", "spot", "rectangle", "disk", "sphere"]
    radiance: tuple[float, float, float]
    position: tuple[float, float, float] = (0, 0, 0)
    direction: tuple[float, float, float] = (0, -1, 0)
    cone: tuple[float, float] = (-1, -1)
    half_u: tuple[float, float, float] = (0, 0, 0)
    half_v: tuple[float, float, float] = (0, 0, 0)

    @property
    def has_extent(self) -> bool:
        return self.kind in ("rectangle", "disk", "sphere")


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Light from infinitely far away.

    texels: [height, width, 3] float32 radiance, latitude-longitude: with environment axes y up, direction (x, y, z) lies
    at u = 0.5 - atan2(x, z) / 2 pi from the left and at acos(y) / pi from the top (USD's and OpenEXR's order).
    world_from_environment: [3, 3] rotation.
    """

    name: str
    texels: NDArray[np.float32]
    world_from_environment: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    @cached_property
    def mean(self) -> float:
        """Of all texels and components."""
        return float(self.texels.mean())


@dataclass(frozen=True, kw_only=True)
class CameraView:
    """What a scene's own camera sees at one time.

    world_from_camera: [4, 4] rigid, x right, y up, looking along -z. fov_y: vertical, radians; height: of an orthographic
    view instead, scene units. shift: of the image, fractions of the frame, x right, y down. near, far: scene units.
    """

    world_from_camera: NDArray[np.float64]
    fov_y: float | None = None
    height: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)
    near: float | None = None
    far: float | None = None


@dataclass(frozen=True, kw_only=True)
class SceneCamera:
    """A camera of the scene file. at: its view at a time in seconds. moves: whether the view changes."""

    name: str
    at: Callable[[float], CameraView]
    moves: bool = False


@dataclass(frozen=True, kw_only=True)
class SceneDescription:
    """A whole scene.

    world_from_object: function of the animation's time in seconds to [objects, 4, 4] float64. deformed: of the time to the
    vertices of every mesh that deforms, by mesh index; None where none does. visible: of the time to [objects] bool; None
    where all objects are always drawn. lights_at, materials_at: of the time to the lights and materials, in their order; None
    where none changes. Only a light's place, direction, extent and radiance may change, and a material's constants and uv
    transforms. cameras: which a camera path may be made of. files: every file that was read, the main one first. not_read:
    what the file holds and we do not draw, each a sentence.
    """

    name: str
    files: tuple[Path, ...]
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...]
    objects: tuple[SceneObject, ...]
    lights: tuple[Light, ...]
    environment: Environment | None
    up_axis: Literal["X", "Y", "Z"]
    metres_per_unit: float
    world_from_object: Callable[[float], NDArray[np.float64]]
    deformed: Callable[[float], dict[int, Deformed]] | None = None
    visible: Callable[[float], NDArray[np.bool_]] | None = None
    lights_at: Callable[[float], tuple[Light, ...]] | None = None
    materials_at: Callable[[float], tuple[Material, ...]] | None = None
    cameras: tuple[SceneCamera, ...] = ()
    animation_end_s: float = 0.0
    not_read: tuple[str, ...] = ()

    @cached_property
    def squared_diagonal(self) -> float:
        """Of the bounds at time 0, squared scene units; every frame asks, and it looks at every vertex."""
        low, high = scene_bounds(self)
        return float(np.sum((high - low) ** 2))

    @property
    def up(self) -> NDArray[np.float64]:
        return np.eye(3)["XYZ".index(self.up_axis)]

    @property
    def moves(self) -> bool:
        return any(item.moves for item in self.objects)


def slots_of(material: Material) -> list[Slot]:
    """The textures that a material reads."""
    slots = (material.base_texture, material.surface_texture, material.normal_texture, material.emission_texture)
    return [slot for slot in slots if slot is not None]


def has_colors(scene: SceneDescription) -> bool:
    """Whether any drawn mesh has vertex colours."""
    return any(scene.meshes[item.mesh].colors is not None for item in scene.objects)


def has_tangents(scene: SceneDescription) -> bool:
    """Whether any drawn mesh has tangents of its own."""
    return any(scene.meshes[item.mesh].tangents is not None for item in scene.objects)


def scene_bounds(scene: SceneDescription, time_s: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest corner [3] of all objects in world space at a time; (0, 0, 0) twice for an empty scene."""
    corners = []
    deformed = scene.deformed(time_s) if scene.deformed else {}
    for item, matrix in zip(scene.objects, scene.world_from_object(time_s), strict=True):
        positions = deformed.get(item.mesh, scene.meshes[item.mesh]).positions
        if len(positions):
            low, high = positions.min(axis=0).astype(float), positions.max(axis=0).astype(float)
            box = np.array([[x, y, z, 1] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
            corners.append((box @ matrix.T)[:, :3])
    stacked = np.concatenate(corners) if corners else np.zeros((1, 3))
    return stacked.min(axis=0), stacked.max(axis=0)


def rotation_from_y_up(up_axis: str) -> NDArray[np.float64]:
    """Rotation [3, 3] that takes +y to the scene's up axis: none, +90 degrees about x, or -90 degrees about z."""
    return {
        "Y": np.eye(3),
        "Z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
        "X": np.array([[0, 1.0, 0], [-1, 0, 0], [0, 0, 1]]),
    }[up_axis]


def validate_mesh(mesh: Mesh) -> str | None:
    """What is wrong with the mesh, or None."""
    if len(mesh.faces) and mesh.faces.max() >= len(mesh.positions):
        return f"face index {mesh.faces.max()} with only {len(mesh.positions)} points"
    arrays = {
        "points": mesh.positions,
        "normals": mesh.normals,
        "texture coordinates": mesh.uv,
        "second texture coordinates": mesh.uv2,
        "vertex colours": mesh.colors,
        "tangents": mesh.tangents,
    }
    bad = [what for what, array in arrays.items() if array is not None and not np.isfinite(array).all()]
    return f"{bad[0]} are not finite" if bad else None
