"""`path` shading: Mitsuba's path tracer from primary rays that are fixed where a rasteriser would sample.

Textures are bilinear without mips, so a stream's mip bias does not reach them. Mitsuba sees the scene enlarged by a power
of two (exact in float32), because it lifts rays off surfaces by 1e-4 of its units at least.
"""

import hashlib
import math

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi, opaque
from .conventions import Stream
from .frame import FrameState
from .gbuffer import camera_ray
from .jitter import antialiasing_positions
from .path_materials import MitsubaSurface
from .plan import RenderPlan
from .projection import View
from .scene.description import Environment, Light, Material, Mesh, SceneDescription, scene_bounds

LEAST_EXTENT = 16.0  # of the enlarged scene, in its units


class PathTracer:
    """A scene in Mitsuba's form, posed for any FrameState.

    Every object is a mesh of its own: Mitsuba's `ray_intersect` slows down with the number of instances. What was last
    uploaded is remembered only so as not to upload it again.
    """

    def __init__(self, scene: SceneDescription, plan: RenderPlan):
        self.plan, self._description = plan, scene
        low, high = scene_bounds(scene)
        extent = float((high - low).max()) or LEAST_EXTENT
        self.scale = 2.0 ** max(0, math.ceil(math.log2(LEAST_EXTENT / extent)))
        # `path` lets no light of point, spot and directional lights through the holes of masked surfaces; `volpath` does
        layered = any(material.alpha != "opaque" for material in scene.materials)
        self.integrator = mi.load_dict({"type": "volpath" if layered else "path", "max_depth": plan.max_depth})
        self._lamps = [(light, _Lamp(light, self.scale)) for light in scene.lights if light.kind != "directional"]
        surfaces = [MitsubaSurface(scene, material) for material in scene.materials or (Material(name="default"),)]
        shapes = {
            index: surfaces[item.material].on(scene.meshes[item.mesh])
            for index, item in enumerate(scene.objects)
            if len(scene.meshes[item.mesh].faces)
        }
        lights = [lamp for _, lamp in self._lamps] + _distant_lights(scene)
        named = {f"object_{k}": v for k, v in shapes.items()} | {f"light_{k}": v for k, v in enumerate(lights)}
        self._scene = mi.load_dict({"type": "scene", **named})
        self._parameters = mi.traverse(self._scene)
        self._flat = {k: mi.traverse(v.emitter().flat) for k, v in shapes.items() if v.is_emitter()}
        self._posed: dict[int, bytes] = dict.fromkeys(shapes, b"")

    def pose(self, frame: FrameState) -> mi.Scene:
        """The scene at `frame`, around its render origin and enlarged."""
        for light, lamp in self._lamps:
            lamp.place((np.array(light.position) - frame.render_origin) * self.scale)
        changed = False
        for index, before in self._posed.items():
            matrix = frame.world_from_object[index, :3].copy()
            matrix[:, 3] -= frame.render_origin
            matrix = (matrix * self.scale).astype(np.float32)  # rounded like the G-buffer's
            if matrix.tobytes() != before:
                self._move(index, matrix.astype(np.float64))
                self._posed[index], changed = matrix.tobytes(), True
        if changed:
            self._parameters.update()
        return self._scene

    def _move(self, index: int, matrix: NDArray[np.float64]) -> None:
        mesh = self._description.meshes[self._description.objects[index].mesh]
        places = mesh.positions.astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
        positions = mi.Float(places.astype(np.float32).ravel())
        self._parameters[f"object_{index}.vertex_positions"] = positions
        if mesh.normals is not None:  # in the same update as the positions, or Mitsuba makes up its own
            normals = _normals(mesh, matrix[:, :3], places)
            self._parameters[f"object_{index}.vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())
        if index in self._flat:
            self._flat[index]["vertex_positions"] = positions
            self._flat[index].update()


def path_color(
    tracer: PathTracer, frame: FrameState, view: View, stream: Stream, jitter: tuple[float, float], seed: int
) -> mi.Color3f:
    """Radiance [3] per pixel, row-major, linear Rec. 709: the mean over plan.samples_per_pixel light paths.

    Primary rays are fixed: at pixel centre - `jitter` (pixels, y down) where the stream has one sample a pixel, else at
    its anti-aliasing positions, which share the light paths (one each at least). Samples that are not finite count as 0;
    bright ones are not clamped. `seed`, the frame's number and the stream decide all random numbers.
    """
    width, height = stream.size
    index, columns = dr.arange(mi.UInt32, width * height), dr.opaque(mi.UInt32, width)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, _seed(seed, frame.frame, stream)), width * height)
    paths = max(1, tracer.plan.samples_per_pixel // stream.samples)
    return _mean_radiance(
        tracer.integrator,
        tracer.pose(frame),
        sampler,
        (view, dr.opaque(mi.Float, tracer.scale)),
        corner=mi.Vector2f(mi.Float(index % columns), mi.Float(index // columns)),
        inside=mi.Float(np.array(antialiasing_positions(stream.samples), dtype=np.float32).ravel()),
        jitter=opaque(mi.Vector2f, jitter),
        size=opaque(mi.Vector2f, stream.size),
        paths=dr.opaque(mi.UInt32, paths),
        count=dr.opaque(mi.UInt32, paths * stream.samples),
    )


@dr.syntax
def _mean_radiance(integrator, scene, sampler, camera, corner, inside, jitter, size, paths, count) -> mi.Color3f:
    """A loop and no film, so that a pixel's samples are summed in one order: equal calls give equal bytes."""
    total, k = mi.Color3f(0), mi.UInt32(0)
    while dr.hint(k < count, exclude=[integrator, scene, camera, corner, inside, jitter, size, paths, count]):
        place = (corner + dr.gather(mi.Vector2f, inside, k // paths) - jitter) / size
        radiance, _, _ = integrator.sample(scene, sampler, _unit_ray(*camera, place))
        total += dr.select(dr.all(dr.isfinite(radiance)), radiance, 0)
        k += 1
    return total / mi.Float(count)


def _unit_ray(view: View, scale: mi.Float, place: mi.Vector2f) -> mi.RayDifferential3f:
    """From the near to the far plane of the enlarged scene, through fraction `place` of the frame."""
    along_z = camera_ray(view, place.x, place.y)
    length = dr.norm(along_z.d)
    ray = mi.RayDifferential3f(scale * (along_z.o + view.near * along_z.d), along_z.d / length)
    ray.maxt = scale * (view.far - view.near) * length
    return ray


def _seed(seed: int, frame: int, stream: Stream) -> int:
    """32 bits."""
    text = f"{seed} {frame} {stream.name} {stream.size[0]}x{stream.size[1]}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def _normals(mesh: Mesh, linear: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals [V, 3] under a linear map; where one vanishes, its triangles' normals stand in."""
    a, b, c = linear
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)]) * np.sign(np.linalg.det(linear))
    normals = mesh.normals.astype(np.float64) @ cofactor.T
    gone = ~normals.any(axis=1)
    if gone.any():
        p0, p1, p2 = (places[mesh.faces[:, k]] for k in range(3))
        sums = np.zeros_like(normals)
        np.add.at(sums, mesh.faces, np.cross(p1 - p0, p2 - p0)[:, None])
        normals[gone] = sums[gone]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


class _Lamp(mi.Emitter):
    """A point or spot light; its cone fades as in `raster`, linearly in the cosine (Mitsuba's: in the angle)."""

    def __init__(self, light: Light, scale: float):
        super().__init__(mi.Properties())
        self.m_flags = mi.EmitterFlags.DeltaPosition
        self.intensity = opaque(mi.Color3f, np.array(light.radiance) * scale**2)
        self.aim = opaque(mi.Vector3f, light.direction)
        inner, outer = light.cone if light.kind == "spot" else (-2, -3)
        self.outer, self.width = dr.opaque(mi.Float, outer), dr.opaque(mi.Float, max(inner - outer, 1e-4))
        self.place(np.zeros(3))

    def place(self, position: NDArray[np.float64]) -> None:
        """`position` [3] in the enlarged scene."""
        self.position = opaque(mi.Point3f, position)

    def sample_direction(self, it, sample, active=True):
        ds = dr.zeros(mi.DirectionSample3f, dr.width(it))
        ds.p, ds.pdf, ds.delta, ds.emitter = self.position, 1, True, mi.EmitterPtr(self)
        ds.d = self.position - it.p
        ds.dist = dr.norm(ds.d)
        ds.d /= ds.dist
        cone = dr.clip((-dr.dot(ds.d, self.aim) - self.outer) / self.width, 0, 1)
        return ds, self.intensity * cone / dr.square(ds.dist)

    def pdf_direction(self, it, ds, active=True):
        return mi.Float(0)

    def eval(self, si, active=True):
        return mi.Color3f(0)


def _distant_lights(scene: SceneDescription) -> list[dict]:
    suns = [light for light in scene.lights if light.kind == "directional"]
    lights = [
        {
            "type": "directional",
            "direction": list(sun.direction),
            "irradiance": {"type": "rgb", "value": list(sun.radiance)},
        }
        for sun in suns
    ]
    return lights + ([_sky(scene.environment)] if scene.environment and scene.environment.texels.any() else [])


def _sky(environment: Environment) -> dict:
    """Mitsuba's first and last rows lie on the poles: with means between our rows it interpolates as we do."""
    texels = np.maximum(environment.texels, 0)
    texels = texels.repeat(2, axis=1) if texels.shape[1] == 1 else texels
    rows = np.repeat(texels, 2, axis=0)
    rows = np.concatenate([texels[:1], rows])
    rows[2:-1:2] = (texels[1:] + texels[:-1]) / 2
    matrix = np.eye(4)
    matrix[:3, :3] = environment.world_from_environment
    return {"type": "envmap", "bitmap": mi.Bitmap(rows.astype(np.float32)), "to_world": mi.ScalarTransform4f(matrix)}
