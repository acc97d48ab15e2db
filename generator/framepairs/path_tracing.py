"""`path` shading: Mitsuba's path tracer from primary rays that are fixed where a rasteriser would sample.

Textures are bilinear and have no mips: a stream's mip bias does not reach them. The scene that Mitsuba sees is scaled by
a power of two (exact in float32), because Mitsuba lifts rays off surfaces by an absolute 1e-4 at least.
"""

import hashlib
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .conventions import Stream
from .frame import FrameState
from .gbuffer import camera_ray
from .jitter import antialiasing_positions
from .plan import RenderPlan
from .projection import View
from .scene.description import Environment, Light, Material, Mesh, SceneDescription, Slot, scene_bounds
from .scene.images import linear_texels

LEAST_EXTENT = 16.0  # of the scaled scene, in its units
HALF_MAX = 65504.0
NORMAL_MAP_OPTIONS = {}


class PathTracer:
    """A scene in Mitsuba's form, posed for any FrameState.

    Every object is a mesh of its own: Mitsuba's `ray_intersect` slows down with the number of instances. What was last
    uploaded is remembered only in order not to upload it again.
    """

    def __init__(self, scene: SceneDescription, plan: RenderPlan):
        self.plan = plan
        self._description = scene
        low, high = scene_bounds(scene)
        extent = float((high - low).max())
        self.scale = 2.0 ** max(0, math.ceil(math.log2(LEAST_EXTENT / extent))) if extent > 0 else 1.0
        layered = any(material.alpha != "opaque" for material in scene.materials)
        # `path` takes the holes of a masked surface for solid when it looks for lights; `volpath` does not
        kind = "volpath" if layered else "path"
        self.integrator = mi.load_dict({"type": kind, "max_depth": plan.max_depth})
        self._lamps = [(light, _Lamp(light, self.scale)) for light in scene.lights if light.kind != "directional"]
        surfaces = [_Surface(scene, material) for material in scene.materials or (Material(name="default"),)]
        solid = [index for index, item in enumerate(scene.objects) if len(scene.meshes[item.mesh].faces)]
        shapes = {_key(k): surfaces[scene.objects[k].material].on(scene.meshes[scene.objects[k].mesh]) for k in solid}
        lights = [lamp for _, lamp in self._lamps] + _distant_lights(scene)
        self._scene = mi.load_dict({"type": "scene", **shapes, **{f"light_{k}": v for k, v in enumerate(lights)}})
        self._parameters = mi.traverse(self._scene)
        self._posed: dict[int, bytes] = dict.fromkeys(solid, b"")

    def pose(self, frame: FrameState) -> mi.Scene:
        """The scene at `frame`, around its render origin and scaled."""
        for light, lamp in self._lamps:
            lamp.place((np.array(light.position) - frame.render_origin) * self.scale)
        changed = False
        for index, before in self._posed.items():
            matrix = frame.world_from_object[index].copy()
            matrix[:3, 3] -= frame.render_origin
            matrix = (matrix[:3] * self.scale).astype(np.float32)  # rounded as the G-buffer's
            if matrix.tobytes() != before:
                self._move(index, matrix.astype(np.float64))
                self._posed[index], changed = matrix.tobytes(), True
        if changed:
            self._parameters.update()
        return self._scene

    def _move(self, index: int, matrix: NDArray[np.float64]) -> None:
        mesh = self._description.meshes[self._description.objects[index].mesh]
        positions = mesh.positions.astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
        self._parameters[f"{_key(index)}.vertex_positions"] = mi.Float(positions.astype(np.float32).ravel())
        if mesh.normals is not None:
            # set together with the positions, or Mitsuba makes up its own
            normals = _turned(mesh, matrix[:, :3])
            self._parameters[f"{_key(index)}.vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())


def path_color(
    tracer: PathTracer, frame: FrameState, view: View, stream: Stream, jitter: tuple[float, float], seed: int
) -> mi.Color3f:
    """Radiance [3] per pixel, row-major, linear Rec. 709: the mean over plan.samples_per_pixel light paths.

    Primary rays are fixed: at pixel centre - `jitter` (pixels, y down) where the stream has one sample a pixel, else at
    its anti-aliasing positions, which share the light paths (at least one each). Samples that are not finite count as 0;
    bright ones are not clamped. `seed` (any integer) with the frame's number and the stream decides all random numbers.
    """
    width, height = stream.size
    index = dr.arange(mi.UInt32, width * height)
    columns = dr.opaque(mi.UInt32, width)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, _seed(seed, frame.frame, stream)), width * height)
    shift = (dr.opaque(mi.Float, offset) for offset in jitter)
    paths = max(1, tracer.plan.samples_per_pixel // stream.samples)
    places = np.array(antialiasing_positions(stream.samples), dtype=np.float32)
    return _mean_radiance(
        tracer.integrator,
        tracer.pose(frame),
        sampler,
        (view, dr.opaque(mi.Float, tracer.scale)),
        mi.Point2f(mi.Float(index % columns), mi.Float(index // columns)),
        mi.Vector2f(*shift),
        mi.Vector2f(dr.opaque(mi.Float, width), dr.opaque(mi.Float, height)),
        mi.Float(places.ravel()),
        dr.opaque(mi.UInt32, paths),
        dr.opaque(mi.UInt32, paths * stream.samples),
    )


@dr.syntax
def _mean_radiance(integrator, scene, sampler, camera, corner, shift, size, places, paths, count) -> mi.Color3f:
    """A loop and no film, so that the samples of a pixel are summed in one order and equal calls give equal bytes."""
    total, k = mi.Color3f(0), mi.UInt32(0)
    while dr.hint(k < count, exclude=[integrator, scene, camera, corner, shift, size, places, paths, count]):
        place = (corner + dr.gather(mi.Vector2f, places, k // paths) - shift) / size
        radiance, _, _ = integrator.sample(scene, sampler, _unit_ray(*camera, place))
        total += dr.select(dr.all(dr.isfinite(radiance)), radiance, 0)
        k += 1
    return total / mi.Float(count)


def _unit_ray(view: View, scale: mi.Float, place: mi.Point2f) -> mi.RayDifferential3f:
    """Through fraction `place` of the frame, from the near to the far plane, in the scaled scene."""
    along_z = camera_ray(view, place.x, place.y)
    length = dr.norm(along_z.d)
    ray = mi.RayDifferential3f(scale * (along_z.o + view.near * along_z.d), along_z.d / length)
    ray.maxt = scale * (view.far - view.near) * length
    return ray


def _seed(seed: int, frame: int, stream: Stream) -> int:
    """32 bits."""
    text = f"{seed} {frame} {stream.name} {stream.size[0]}x{stream.size[1]}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def _key(index: int) -> str:
    return f"object_{index}"


def _turned(mesh: Mesh, linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals [V, 3] under a linear map; where one vanishes, the sum of its triangles' normals stands in."""
    a, b, c = linear
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)]) * np.sign(np.linalg.det(linear))
    normals = mesh.normals.astype(np.float64) @ cofactor.T
    missing = ~(np.abs(normals).max(axis=1) > 0)
    if missing.any():
        corners = (mesh.positions.astype(np.float64) @ linear.T)[mesh.faces]
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sums = np.zeros_like(normals)
        np.add.at(sums, mesh.faces.ravel(), facing.repeat(3, axis=0))
        normals[missing] = sums[missing]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1), (0, 0, 1))


class _Surface:
    """A Material in Mitsuba's terms, for any number of meshes: its BSDF, opacity and emission (None where there is none)."""

    def __init__(self, scene: SceneDescription, material: Material):
        base = _texels(scene, material.base_texture) * np.float32((*material.base_color, material.opacity))
        packed = _texels(scene, material.surface_texture)[..., :3]
        packed = np.clip(packed * np.float32((material.specular, material.roughness, material.metallic)), 0, 1)
        metallic = packed[..., 2:]
        bsdf = {
            "type": "principled",
            "base_color": _texture(scene, material.base_texture, np.clip(base[..., :3], 0, 1)),
            "specular": float(packed[..., 0].mean(dtype=np.float64)),  # F0 = 0.08 specular; takes no texture
            "roughness": _texture(scene, material.surface_texture, packed[..., 1:2]),
            "metallic": _texture(scene, material.surface_texture, metallic) if metallic.any() else 0.0,
        }
        bsdf = {"type": "twosided", "front": bsdf}
        if material.normal_texture:
            scale = np.float32((material.normal_scale, material.normal_scale, 1))
            encoded = _texels(scene, material.normal_texture)[..., :3] * scale / 2 + np.float32(0.5)
            normals = _Changed(_texture(scene, material.normal_texture, encoded), after=_mirrored)
            bsdf = {"type": "normalmap", "normalmap": normals, "on": bsdf, **NORMAL_MAP_OPTIONS}
        self.opacity = _texture(scene, material.base_texture, np.clip(base[..., 3:], 0, 1))
        if material.alpha == "mask":
            cutoff = dr.opaque(mi.Float, material.alpha_cutoff)
            self.opacity = _Changed(self.opacity, after=lambda si, value: dr.select(value >= cutoff, mi.Float(1), 0))
        elif material.alpha == "opaque":
            self.opacity = mi.load_dict({"type": "uniform", "value": 1.0})
        if material.alpha != "opaque":
            bsdf = {"type": "mask", "opacity": self.opacity, "on": bsdf}
        self.bsdf = mi.load_dict(bsdf)
        emission = _texels(scene, material.emission_texture)[..., :3] * np.float32(material.emission)
        emission = np.clip(emission, 0, HALF_MAX)
        self.gain = float(emission.max())
        self.emission = _texture(scene, material.emission_texture, emission / self.gain) if self.gain else None

    def on(self, mesh: Mesh) -> mi.Mesh:
        """A mesh of this material; `PathTracer.pose` places it."""
        properties = mi.Properties()
        properties["bsdf"] = self.bsdf
        if self.emission:
            properties["emitter"] = _Glow(self)
        shape = mi.Mesh(mesh.name, len(mesh.positions), len(mesh.faces), properties, mesh.normals is not None, True)
        uv = np.zeros((len(mesh.positions), 2), np.float32) if mesh.uv is None else mesh.uv
        parameters = mi.traverse(shape)
        parameters["vertex_positions"] = np.ascontiguousarray(mesh.positions).ravel()
        parameters["vertex_texcoords"] = np.ascontiguousarray(uv).ravel()
        parameters["faces"] = np.ascontiguousarray(mesh.faces).ravel()
        parameters.update()
        return shape


def _texels(scene: SceneDescription, slot: Slot | None) -> NDArray[np.float32]:
    """[h, w, 4], linear; white where the slot is empty."""
    return np.ones((1, 1, 4), np.float32) if slot is None else linear_texels(scene.textures[slot.texture])


def _texture(scene: SceneDescription, slot: Slot | None, values: NDArray[np.float32]) -> mi.Texture:
    """`values` [h, w, 1 or 3], first row at v = 1 (Mitsuba's lies at v = 0), in half precision as in `raster`."""
    if slot is None:
        value = values[0, 0].tolist()
        return mi.load_dict({"type": "rgb", "value": value} if len(value) == 3 else {"type": "uniform", "value": value[0]})
    for axis in (0, 1):
        values = values.repeat(2, axis) if values.shape[axis] == 1 else values  # Mitsuba asks for 2 x 2
    u_wrap, v_wrap = scene.textures[slot.texture].wrap
    bitmap = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(values[::-1], dtype=np.float16)),
        "raw": True,
        "accel": False,  # CUDA's texture units interpolate with 8 bits
        "wrap_mode": u_wrap,
    }
    if u_wrap == v_wrap:
        return mi.load_dict({**bitmap, "to_uv": mi.ScalarTransform3f(np.array([*slot.uv, (0, 0, 1)]))})
    raise NotImplementedError


def _mirrored(si: mi.SurfaceInteraction3f, encoded: mi.Color3f) -> mi.Color3f:
    """Mitsuba's bitangent is n x t; where uv are mirrored it should be the opposite, the direction of v."""
    turns = dr.dot(dr.cross(si.sh_frame.n, si.dp_du), si.dp_dv) < 0
    return mi.Color3f(encoded.x, dr.select(turns, 1 - encoded.y, encoded.y), encoded.z)


class _Changed(mi.Texture):
    """Another texture, whose values are changed by `after`."""

    def __init__(self, inner: mi.Texture, after: Callable):
        super().__init__(mi.Properties())
        self.inner, self.after = inner, after

    def eval(self, si, active=True):
        return self.after(si, self.inner.eval(si, active))

    def eval_1(self, si, active=True):
        return self.after(si, self.inner.eval_1(si, active))

    def eval_3(self, si, active=True):
        return self.after(si, self.inner.eval_3(si, active))

    def is_spatially_varying(self):
        return True


class _Glow(mi.Emitter):
    """Emission of a surface, seen from both sides (Mitsuba's `area` has one), thinned by its opacity.

    Points are sampled uniformly by area, so that uv may overlap or repeat.
    """

    def __init__(self, surface: _Surface):
        super().__init__(mi.Properties())
        self.surface, self.gain = surface, dr.opaque(mi.Float, surface.gain)
        self.m_flags = mi.EmitterFlags.Surface

    def eval(self, si, active=True):
        return self.gain * self.surface.emission.eval(si, active) * self.surface.opacity.eval_1(si, active)

    def sample_direction(self, it, sample, active=True):
        found = self.get_shape().sample_direction(it, sample, active)
        found.emitter = mi.EmitterPtr(self)
        usable = active & (found.pdf > 0)
        value = self.eval(mi.SurfaceInteraction3f(found, it.wavelengths), usable) / found.pdf
        return found, dr.select(usable, value, 0)

    def pdf_direction(self, it, ds, active=True):
        return self.get_shape().pdf_direction(it, ds, active)

    def eval_direction(self, it, ds, active=True):
        return self.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), active)


class _Lamp(mi.Emitter):
    """A point or spot light whose cone fades as in `raster`: linearly in the cosine (Mitsuba's: in the angle)."""

    def __init__(self, light: Light, scale: float):
        super().__init__(mi.Properties())
        self.m_flags = mi.EmitterFlags.DeltaPosition
        self.intensity = _opaque(mi.Color3f, np.array(light.radiance) * scale**2)
        self.aim = _opaque(mi.Vector3f, light.direction)
        inner, outer = light.cone if light.kind == "spot" else (-2.0, -3.0)
        self.outer, self.width = (dr.opaque(mi.Float, value) for value in (outer, max(inner - outer, 1e-4)))
        self.place((0, 0, 0))

    def place(self, position: NDArray[np.float64]) -> None:
        """`position` [3] in the space of the scaled scene."""
        self.position = _opaque(mi.Point3f, position)

    def eval(self, si, active=True):
        return mi.Color3f(0)

    def sample_direction(self, it, sample, active=True):
        ds = dr.zeros(mi.DirectionSample3f, dr.width(it))
        ds.p, ds.pdf, ds.delta, ds.emitter = self.position, 1.0, True, mi.EmitterPtr(self)
        towards = self.position - it.p
        ds.dist = dr.norm(towards)
        ds.d = towards / ds.dist
        cone = dr.clip((-dr.dot(ds.d, self.aim) - self.outer) / self.width, 0, 1)
        return ds, self.intensity * cone / dr.square(ds.dist)

    def pdf_direction(self, it, ds, active=True):
        return mi.Float(0)


def _distant_lights(scene: SceneDescription) -> list:
    lights = [
        {
            "type": "directional",
            "irradiance": {"type": "rgb", "value": list(light.radiance)},
            "direction": list(light.direction),
        }
        for light in scene.lights
        if light.kind == "directional"
    ]
    environment = scene.environment
    if environment is not None and environment.texels.any():
        lights.append(_sky(environment))
    return lights


def _sky(environment: Environment) -> dict:
    """Mitsuba's first and last rows lie at the poles: with the means between rows it interpolates ours exactly."""
    texels = np.maximum(environment.texels.astype(np.float32), 0)
    texels = texels.repeat(2, axis=1) if texels.shape[1] == 1 else texels
    rows = np.empty((2 * len(texels) + 1, *texels.shape[1:]), np.float32)
    rows[1::2] = texels
    rows[0], rows[-1] = texels[0], texels[-1]
    rows[2:-1:2] = (texels[1:] + texels[:-1]) / 2
    world_from_environment = np.eye(4)
    world_from_environment[:3, :3] = environment.world_from_environment
    return {"type": "envmap", "bitmap": mi.Bitmap(rows), "to_world": mi.ScalarTransform4f(world_from_environment)}


def _opaque(kind, values):
    return kind(*(dr.opaque(mi.Float, float(value)) for value in values))
