"""Renders one FrameState into arrays: one kernel per stream for everything that is one sample, one for what is averaged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .backend import dr, mi
from .brdf import Brdf
from .brdf_tables import brdf_table
from .channels import MOTION_CHANNELS, motion_name
from .conventions import Stream
from .frame import FrameState
from .gbuffer import GBuffer, gbuffer, gbuffers, pixel_of
from .geometry import Pose
from .jitter import antialiasing_positions, jitter
from .lanes import Lanes, image_of, lanes_of, pixels_of
from .launched import Launched, Started, StreamFrame, fetch
from .lights import Lights, lights_around
from .materials import with_values
from .motion import Before, motions_of
from .overlay import build_layer, composited, overlay_of, overlays_around
from .overlay_elements import Overlay
from .path_tracing import path_light, path_seed
from .plan import RenderPlan, brdf_model, jitter_length
from .projection import View, view_of
from .radiance import Radiance, shade, shade_each
from .scene.description import SceneDescription
from .scene.needs import table_need
from .shading import Shading, build_shading
from .solid import Pixel

AVERAGED = ("color", "emission", "brdf", "transparency")
PASSES = ("brdf_table", "gbuffer", "motion", "dual_motion", "radiance", "path", "overlay")
PATH_CHANNELS = frozenset({"color", "color_variance"})


@dataclass(frozen=True)
class _Moment:
    """A frame on the device: now and before, everything that its streams share."""

    frame: FrameState
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
        return fetch(self.launch(frame, [stream], channels, sequence_seed))[0]

    def launch(self, frame: FrameState, streams: Sequence[Stream], channels: frozenset[str], sequence_seed: int) -> Launched:
        """Start rendering the `channels` of `streams`, in whose order `fetch` gives them; wait for nothing.

        Streams that sample the same places share rays; each is what it is when rendered alone.
        """
        moment, started = self._moment(frame, channels), {}
        for offset, group in self._groups(frame, streams):
            lanes = lanes_of(group[0].size)
            all_columns = self._columns(moment, lanes, group, offset, channels)
            counted = [
                self._finished(moment, lanes, *each, offset, channels, sequence_seed)
                for each in zip(group, all_columns, strict=True)
            ]
            dr.eval(counted)  # together: each evaluation by itself would trace all paths again
            started |= {id(stream): Started(stream, offset, *each) for stream, each in zip(group, counted, strict=True)}
        return Launched(tuple(started[id(stream)] for stream in streams))

    def _moment(self, frame: FrameState, channels: frozenset[str]) -> "_Moment":
        pose, previous_pose = self.shading.geometry.pose(frame)
        shading = self.shading
        if self.scene.materials_at is not None:
            shading = replace(shading, materials=with_values(shading.materials, frame.materials))
        return _Moment(
            frame=frame,
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

    def _groups(self, frame: FrameState, streams: Sequence[Stream]) -> list[tuple[tuple[float, float], list[Stream]]]:
        """(J, streams that sample the same places) for all streams."""
        groups: dict[tuple, list[Stream]] = {}
        for stream in streams:
            offset = jitter(frame.frame, jitter_length(self.plan, stream.scale)) if stream.jittered else (0.0, 0.0)
            shared = (stream.size,) if stream.samples == 1 else (stream.name,)
            groups.setdefault((offset, *shared), []).append(stream)
        return [(key[0], group) for key, group in groups.items()]

    def _columns(self, moment: _Moment, lanes: Lanes, group: list[Stream], offset, channels) -> list[dict]:
        """Lazily, the values of all channels per lane, for each stream of a group."""
        columns = self._single_sample(moment, lanes, group, offset, channels)
        if group[0].samples > 1 and channels & {*AVERAGED, *PATH_CHANNELS}:
            columns = [columns[0] | self._averaged(moment, lanes, group[0])]
        return columns

    def _finished(self, moment, lanes, stream, columns, offset, channels, sequence_seed) -> tuple[dict, mi.Bool, mi.UInt32]:
        """(images of `channels`, pixels with fireflies, rejected paths per lane)."""
        firefly, rejected = mi.Bool(False), mi.UInt32(0)
        if self.plan.shading == "path" and channels & PATH_CHANNELS:
            self.passes["path"] += 1
            _, pixel = _size_and_pixel(moment.view, stream, stream.mip_bias)
            place, seed = (moment.pose, moment.view, pixel), path_seed(sequence_seed, moment.frame.frame, stream)
            found = path_light(moment.shading, moment.lights, self.plan, *place, stream, lanes, offset, seed)
            columns |= {"color": columns["emission"] + found.reflected, "color_variance": found.variance}
            firefly, rejected = found.firefly & lanes.inside, dr.select(lanes.inside, found.rejected, 0)
        if self._overlay is not None and channels & {"overlay", *PATH_CHANNELS}:
            columns |= self._overlaid(moment.frame, lanes, stream, offset, columns)
        images = {name: image_of(lanes, value) for name, value in columns.items() if name in channels}
        return images, firefly, rejected

    def _overlaid(self, frame: FrameState, lanes: Lanes, stream: Stream, offset, columns: dict) -> dict:
        """Colour under the overlay, its variance, and the overlay's coverage."""
        self.passes["overlay"] += 1
        value = overlay_of(overlays_around(self._overlay, frame, stream), stream, offset)
        dr.eval(value.color, value.alpha)
        value = replace(value, color=pixels_of(lanes, value.color), alpha=pixels_of(lanes, value.alpha))
        drawn = {"overlay": value.alpha, "color_variance": columns["color_variance"] * dr.square(1 - value.alpha)}
        return drawn | ({"color": composited(columns["color"], value)} if "color" in columns else {})

    def _single_sample(self, moment: _Moment, lanes: Lanes, group: list[Stream], offset, channels) -> list[dict]:
        """Lazily, every channel from one sample per pixel at centre - J, for each stream of a group."""
        # The stream's bias belongs to what is averaged: one sample at a finer level than the pixel's would alias.
        biases = [dr.opaque(mi.Float, stream.mip_bias if stream.samples == 1 else 0.0) for stream in group]
        size, pixel = _size_and_pixel(moment.view, group[0], 0.0)
        x = (lanes.x + 0.5 - dr.opaque(mi.Float, offset[0])) / size[0]
        y = (lanes.y + 0.5 - dr.opaque(mi.Float, offset[1])) / size[1]
        shading, scene = moment.shading, (moment.shading.geometry, moment.shading.materials)
        self.passes["gbuffer"] += 1
        found = gbuffers(*scene, shading.brdf, moment.pose, moment.view, x, y, pixel, biases)
        columns = [_gbuffer_columns(sample) for sample in found[0]]

        def add(name: str, offset: int, before: Before, occlusion: bool) -> None:
            self.passes["motion"] += 1
            now = moment.pose, moment.view, moment.precise_views[0]
            for row, moved in zip(
                columns, motions_of(*scene, *now, before, biases, *found, x, y, size, occlusion), strict=True
            ):
                row[motion_name(offset)] = moved.motion
                if offset == -1:
                    row |= {"dual_motion": moved.dual_motion, "visibility": moved.visibility}

        if channels & set(MOTION_CHANNELS):
            occlusion = bool(channels & {"dual_motion", "visibility"})
            self.passes["dual_motion"] += occlusion
            add("motion", -1, self._before(moment, size), occlusion)
        for other, before in moment.others.items():
            add(motion_name(other), other, before, False)
        if group[0].samples == 1 and channels & {*AVERAGED, *PATH_CHANNELS}:
            self.passes["radiance"] += 1
            place = moment.lights, moment.pose, moment.view, x, y, pixel, biases
            for row, drawn in zip(columns, shade_each(shading, *place, *found, self._lit), strict=True):
                row |= _radiance_columns(drawn)
        return columns

    def _before(self, moment: _Moment, size: tuple[mi.Float, mi.Float]) -> Before:
        view, pose = moment.previous_view, moment.previous_pose
        return Before(pose, view, moment.precise_views[1], pixel_of(view, size, mi.Float(0)), moment.moves_on)

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
    def _averaged(self, moment: _Moment, lanes: Lanes, stream: Stream) -> dict:
        """Colour, emission, F_beta and transparency as means over the stream's AA samples; the loop keeps their order."""
        self.passes["radiance"] += 1
        size, pixel = _size_and_pixel(moment.view, stream, stream.mip_bias)
        i, j = lanes.x, lanes.y
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
        return _radiance_columns(Radiance(color / n, emission / n, f_beta / n, transparency / n))


def _size_and_pixel(view: View, stream: Stream, bias: float) -> tuple[tuple[mi.Float, mi.Float], Pixel]:
    size = tuple(dr.opaque(mi.Float, float(extent)) for extent in stream.size)
    if stream.samples == 1:
        return size, pixel_of(view, size, dr.opaque(mi.Float, bias))
    # Each of many samples stands for its share of the pixel: its footprint shrinks, taps and all, not its level alone.
    share = dr.opaque(mi.Float, 2.0**-bias)
    return size, pixel_of(view, (size[0] * share, size[1] * share), dr.opaque(mi.Float, 0.0))


def _gbuffer_columns(sample: GBuffer) -> dict:
    valid, surface = sample.hit.valid, sample.surface
    return {
        "albedo": dr.select(valid, surface.base_color, 0),
        "normal": sample.normal,
        "depth": sample.depth,
        "roughness": dr.select(valid, surface.roughness, 0),
        "metallic": dr.select(valid, surface.metallic, 0),
        "specular": dr.select(valid, surface.specular, 0),
        "object_id": sample.object_id,
        "overlay": mi.Float(0),
        "color_variance": mi.Color3f(0),
    }


def _radiance_columns(drawn: Radiance) -> dict:
    return {
        "color": drawn.color,
        "emission": drawn.emission,
        "brdf": drawn.f_beta,
        "transparency": drawn.transparency,
    }
