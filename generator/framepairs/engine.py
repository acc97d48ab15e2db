"""Renders one FrameState into arrays: one kernel per stream for everything that is one sample, one for what is averaged."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .brdf import Brdf
from .brdf_tables import brdf_table
from .channels import MOTION_CHANNELS, motion_name
from .conventions import Stream
from .frame import FrameState
from .gbuffer import GBuffer, Pixel, gbuffer, pixel_of
from .geometry import Pose
from .jitter import antialiasing_positions, jitter
from .lights import Lights, lights_around
from .materials import with_values
from .motion import Before, Motion, motion_of
from .overlay import build_layer, composited, overlay_of, overlays_around
from .overlay_elements import Overlay
from .path_tracing import path_light, path_seed
from .plan import RenderPlan, brdf_model, jitter_length
from .projection import View, view_of
from .radiance import Radiance, shade
from .scene.description import SceneDescription
from .scene.needs import table_need
from .shading import Shading, build_shading

AVERAGED = ("color", "emission", "brdf", "transparency")
PASSES = ("brdf_table", "gbuffer", "motion", "dual_motion", "radiance", "path", "overlay")
PATH_CHANNELS = frozenset({"color", "color_variance"})


@dataclass(frozen=True)
class StreamFrame:
    """One stream of one frame: channel name to array [height, width, components] (float32 or uint32); J in pixels; and what
    `path` shading counted."""

    stream: Stream
    jitter: tuple[float, float]
    arrays: dict[str, NDArray]
    fireflies: int = 0
    rejected_paths: int = 0


@dataclass(frozen=True)
class _Moment:
    """A frame on the device: now and before, everything that its streams share."""

    shading: Shading
    pose: Pose
    view: View
    previous_pose: Pose
    previous_view: View
    precise_views: tuple[View, View]
    moves_on: mi.Bool
    others: dict[int, Before]
    lights: Lights


class Engine:
    """A scene on the device, ready to render any of its frames.

    overlay: what is drawn over colour. passes counts how often each pass was run, so that a test can prove that an unneeded
    one never was.
    """

    def __init__(self, scene: SceneDescription, plan: RenderPlan, overlay: Overlay | None = None):
        self.scene, self.plan = scene, plan
        self._overlay = build_layer(overlay, scene) if overlay is not None and overlay.elements else None
        model, specular = brdf_model(plan), table_need(scene, plan).needed
        table = brdf_table(model, plan.brdf_table) if specular else None
        self.shading = build_shading(scene, plan, Brdf(model, table))
        self._lit = plan.shading == "raster"
        self.passes = dict.fromkeys(PASSES, 0)
        self.passes["brdf_table"] += specular

    def render(self, frame: FrameState, stream: Stream, channels: frozenset[str], sequence_seed: int) -> StreamFrame:
        """The `channels` of one stream of one frame. `sequence_seed` decides the light paths of `path` shading."""
        pose, previous_pose = self.shading.geometry.pose(frame)
        shading = self.shading
        if self.scene.materials_at is not None:
            shading = replace(shading, materials=with_values(shading.materials, frame.materials))
        moment = _Moment(
            shading=shading,
            pose=pose,
            view=view_of(frame.camera, frame.render_origin),
            previous_pose=previous_pose,
            previous_view=view_of(frame.previous_camera, frame.render_origin),
            precise_views=tuple(
                view_of(camera, frame.render_origin, precise=True) for camera in (frame.camera, frame.previous_camera)
            ),
            moves_on=dr.opaque(mi.Bool, not frame.reset),
            others={k: self._other(frame, k) for k in frame.others if motion_name(k) in channels},
            lights=lights_around(self.scene, self.shading.mesh_lights, frame),
        )
        length = jitter_length(self.plan, stream.scale)
        offset = jitter(frame.frame, length) if stream.jittered else (0.0, 0.0)
        columns = self._single_sample(moment, stream, offset, channels)
        if stream.samples > 1 and channels & {*AVERAGED, *PATH_CHANNELS}:
            columns |= self._averaged(moment, stream)
        firefly, rejected = mi.Bool(False), mi.UInt32(0)
        if self.plan.shading == "path" and channels & PATH_CHANNELS:
            self.passes["path"] += 1
            _, pixel = _size_and_pixel(moment.view, stream, stream.mip_bias)
            seed = path_seed(sequence_seed, frame.frame, stream)
            found = path_light(
                shading, moment.lights, self.plan, moment.pose, moment.view, pixel, stream, offset, seed
            )
            columns |= {"color": columns["emission"] + found.reflected, "color_variance": found.variance}
            firefly, rejected = found.firefly, found.rejected
        if self._overlay is not None and channels & {"overlay", *PATH_CHANNELS}:
            columns |= self._overlaid(frame, stream, offset, columns)
        columns = {name: value for name, value in columns.items() if name in channels}
        dr.eval(columns, firefly, rejected)  # together: each evaluation by itself would trace all paths again
        arrays = {name: _to_array(value, stream.size) for name, value in columns.items()}
        return StreamFrame(stream, offset, arrays, int(dr.count(firefly)[0]), int(dr.sum(rejected)[0]))

    def _overlaid(self, frame: FrameState, stream: Stream, offset: tuple[float, float], columns: dict) -> dict:
        """Colour under the overlay, its variance, and the overlay's coverage."""
        self.passes["overlay"] += 1
        value = overlay_of(overlays_around(self._overlay, frame, stream), stream, offset)
        drawn = {"overlay": value.alpha, "color_variance": columns["color_variance"] * dr.square(1 - value.alpha)}
        return drawn | ({"color": composited(columns["color"], value)} if "color" in columns else {})

    def _single_sample(self, moment: _Moment, stream: Stream, offset: tuple[float, float], channels: frozenset[str]) -> dict:
        """Lazily, every channel from one sample per pixel at centre - J."""
        # The stream's bias belongs to what is averaged: one sample at a finer level than the pixel's would alias.
        size, pixel = _size_and_pixel(moment.view, stream, stream.mip_bias if stream.samples == 1 else 0.0)
        i, j = _pixel_indices(stream)
        x = (i + 0.5 - dr.opaque(mi.Float, offset[0])) / size[0]
        y = (j + 0.5 - dr.opaque(mi.Float, offset[1])) / size[1]
        shading = moment.shading
        self.passes["gbuffer"] += 1
        sample = gbuffer(shading.geometry, shading.materials, shading.brdf, moment.pose, moment.view, x, y, pixel)
        columns = _gbuffer_columns(sample, mi.UInt32(i))
        if channels & set(MOTION_CHANNELS):
            columns |= self._motion_columns(moment, sample, x, y, size, pixel, channels)
        for offset, other in moment.others.items():
            self.passes["motion"] += 1
            columns[motion_name(offset)] = self._motion(moment, other, sample, x, y, size, False).motion
        if stream.samples == 1 and channels & {*AVERAGED, *PATH_CHANNELS}:
            self.passes["radiance"] += 1
            columns |= _radiance_columns(
                shade(shading, moment.lights, moment.pose, moment.view, x, y, pixel, sample, self._lit), mi.UInt32(i)
            )
        return columns

    def _motion_columns(self, moment: _Moment, sample: GBuffer, x, y, size, pixel: Pixel, channels) -> dict:
        occlusion = bool(channels & {"dual_motion", "visibility"})
        self.passes["motion"] += 1
        self.passes["dual_motion"] += occlusion
        before = Before(
            pose=moment.previous_pose,
            view=moment.previous_view,
            precise_view=moment.precise_views[1],
            pixel=pixel_of(moment.previous_view, size, pixel.bias),
            exists=moment.moves_on,
        )
        moved = self._motion(moment, before, sample, x, y, size, occlusion)
        return {"motion": moved.motion, "dual_motion": moved.dual_motion, "visibility": moved.visibility}

    def _motion(self, moment: _Moment, before: Before, sample: GBuffer, x, y, size, occlusion: bool) -> Motion:
        tables = moment.shading.geometry, moment.shading.materials
        now = moment.pose, moment.view, moment.precise_views[0]
        return motion_of(*tables, *now, before, sample, x, y, size, occlusion)

    def _other(self, frame: FrameState, offset: int) -> Before:
        other, origin = frame.others[offset], frame.render_origin
        view = view_of(other.camera, origin)
        return Before(
            pose=self.shading.geometry.pose_without_rays(other.objects, origin),
            view=view,
            precise_view=view_of(other.camera, origin, precise=True),
            pixel=pixel_of(view, (mi.Float(1), mi.Float(1)), mi.Float(0)),
            exists=dr.opaque(mi.Bool, other.exists),
        )

    @dr.syntax
    def _averaged(self, moment: _Moment, stream: Stream) -> dict:
        """Colour, emission, F_beta and transparency as means over the stream's AA samples; the loop keeps their order."""
        self.passes["radiance"] += 1
        size, pixel = _size_and_pixel(moment.view, stream, stream.mip_bias)
        i, j = _pixel_indices(stream)
        positions = mi.Float(np.array(antialiasing_positions(stream.samples, stream.pattern), dtype=np.float32).ravel())
        count = dr.opaque(mi.UInt32, stream.samples)
        k = mi.UInt32(0)
        color, emission, f_beta = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
        transparency = mi.Float(0)
        shading, lit = moment.shading, self._lit
        while dr.hint(k < count, exclude=[self, shading, lit, moment, pixel, size]):
            place = dr.gather(mi.Point2f, positions, k)
            x, y = (i + place.x) / size[0], (j + place.y) / size[1]
            sample = gbuffer(shading.geometry, shading.materials, shading.brdf, moment.pose, moment.view, x, y, pixel)
            drawn = shade(shading, moment.lights, moment.pose, moment.view, x, y, pixel, sample, lit)
            color += drawn.color
            emission += drawn.emission
            f_beta += drawn.f_beta
            transparency += drawn.transparency
            k += 1
        n = mi.Float(count)
        return _radiance_columns(Radiance(color / n, emission / n, f_beta / n, transparency / n), mi.UInt32(i))


def _size_and_pixel(view: View, stream: Stream, bias: float) -> tuple[tuple[mi.Float, mi.Float], Pixel]:
    size = tuple(dr.opaque(mi.Float, float(extent)) for extent in stream.size)
    if stream.samples == 1:
        return size, pixel_of(view, size, dr.opaque(mi.Float, bias))
    # Each of many samples stands for its share of the pixel: its footprint shrinks, taps and all, not its level alone.
    share = dr.opaque(mi.Float, 2.0**-bias)
    return size, pixel_of(view, (size[0] * share, size[1] * share), dr.opaque(mi.Float, 0.0))


def _pixel_indices(stream: Stream) -> tuple[mi.Float, mi.Float]:
    width, height = stream.size
    index = dr.arange(mi.UInt32, width * height)
    columns = dr.opaque(mi.UInt32, width)
    return mi.Float(index % columns), mi.Float(index // columns)


def _gbuffer_columns(sample: GBuffer, shape: mi.UInt32) -> dict:
    valid, surface = sample.hit.valid, sample.surface
    return {
        "albedo": dr.select(valid, surface.base_color, 0),
        "normal": sample.normal,
        "depth": sample.depth,
        "roughness": dr.select(valid, surface.roughness, 0),
        "metallic": dr.select(valid, surface.metallic, 0),
        "specular": dr.select(valid, surface.specular, 0),
        "object_id": sample.object_id,
        "overlay": mi.Float(shape) * 0,
        "color_variance": mi.Color3f(mi.Float(shape) * 0),
    }


def _radiance_columns(drawn: Radiance, shape: mi.UInt32) -> dict:
    return {
        "color": drawn.color,
        "emission": drawn.emission,
        "brdf": drawn.f_beta,
        "transparency": drawn.transparency + mi.Float(shape) * 0,
    }


def _to_array(value, size: tuple[int, int]) -> NDArray:
    """[height, width, components], contiguous."""
    width, height = size
    array = np.array(value)
    array = array.reshape(-1, height * width) if array.size > array.shape[0] or array.ndim == 2 else array.reshape(1, -1)
    return np.ascontiguousarray(array.reshape(-1, height, width).transpose(1, 2, 0))
