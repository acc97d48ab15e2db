"""One sequence to render into a corpus: what it needs, what its frames are made from, and its entry in corpus.json."""

import hashlib
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from .backend import mi, versions
from .camera_path import CameraPath
from .channels import Channel, channels_with
from .conventions import Stream
from .digests import digest
from .frame import Shoot
from .manifest import (
    Constant,
    SequenceRecord,
    frame_key,
)
from .mesh_lights import at_their_brightest
from .overlay_elements import Overlay
from .plan import STREAM_KEYS, RenderPlan, plan_streams
from .scene import files_hash, scene_hash
from .scene.description import SceneDescription
from .scene.needs import Need, channel_needs, equal_streams

EVERYWHERE = ("motion", "visibility")  # channels whose constant holds in the background too


@dataclass(frozen=True, kw_only=True)
class Job:
    """One sequence to render. scene must be lit (`light_scene`); the names are what the manifest says. variant: of Mitsuba,
    that renders; where workers do, it need not be this process's. scene_sha256, overlay_sha256: of the files as they were read;
    by default as they are now."""

    scene: SceneDescription
    scene_name: str
    environment: str | None
    path: CameraPath
    path_name: str
    plan: RenderPlan
    out: Path
    clip: str | None = None
    overlay: Overlay | None = None
    overlay_name: str | None = None
    variation: int | None = None
    camera_scene: SceneDescription | None = None
    split: str = "train"
    variant: str = field(default_factory=lambda: mi.variant())
    scene_sha256: str = ""
    overlay_sha256: str | None = None

    def __post_init__(self):
        if not self.scene_sha256:
            object.__setattr__(self, "scene_sha256", scene_hash(self.scene))
        if self.overlay is not None and self.overlay_sha256 is None:
            object.__setattr__(self, "overlay_sha256", files_hash(self.overlay.files))

    @cached_property
    def shoot(self) -> Shoot:
        aspect = self.plan.display[0] / self.plan.display[1]
        return Shoot(self.scene, self.path, aspect, self.plan.motion_offsets, self.camera_scene)

    @cached_property
    def sequence(self) -> str:
        is_of_scene = self.path_name in {camera.name for camera in self.scene.cameras}
        path = re.sub(r"[^\w.-]+", "_", self.path_name).strip("_") if is_of_scene else Path(self.path_name).stem
        varied = "" if self.variation is None else f"_vary{self.variation}"
        return f"{Path(self.scene_name).stem}_{path}{varied}"

    @cached_property
    def needs(self) -> dict[str, Need]:
        return channel_needs(self.scene, self.shoot.samples, self.plan, bool(self.overlay and self.overlay.elements))

    @cached_property
    def equal_streams(self) -> dict[str, str]:
        """Streams that become no files, and those that they equal. An overlay is filtered by the mip bias, too."""
        forced = self.plan.channels == "all" or self.needs["overlay"].needed
        return {} if forced else equal_streams(self.scene, self.plan)

    @cached_property
    def streams(self) -> tuple[Stream, ...]:
        """Streams that become files."""
        return tuple(stream for stream in plan_streams(self.plan) if stream.name not in self.equal_streams)

    @cached_property
    def table(self) -> tuple[Channel, ...]:
        """Every channel that there could be."""
        return channels_with(self.plan.motion_offsets)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Channels that become files."""
        chosen = self.plan.channels
        if chosen == "all":
            return self.table
        if chosen == "needed":
            return tuple(channel for channel in self.table if self.needs[channel.name].needed)
        return tuple(channel for channel in self.table if channel.name in chosen)

    @cached_property
    def scene_content(self) -> str:
        """sha256 of what the scene is at all times: meshes, textures, materials, sky, and what lights are chosen by."""
        scene, kept = self.scene, [material.bsdf for material in self.scene.materials if material.bsdf is not None]
        if kept and scene.files:
            kept = self.scene_sha256  # they may name images
        still = (scene.meshes, scene.textures, scene.materials, scene.objects, scene.environment, kept)
        return digest((still, scene.metres_per_unit, scene.squared_diagonal, at_their_brightest(scene)))

    @cached_property
    def overlay_content(self) -> str | None:
        """sha256 of the overlay's elements and pictures, letters drawn."""
        overlay = self.overlay
        return None if overlay is None else digest((overlay.elements, overlay.picture, overlay.pictures))

    @cached_property
    def seed(self) -> int:
        """Of the sequence's light paths, 32 bits."""
        return int(hashlib.sha256(f"{self.plan.seed} {self.sequence}".encode()).hexdigest()[:8], 16)

    @cached_property
    def sources(self) -> dict:
        """What a frame is made from, as it came in: files, path, plan and versions."""
        return {
            "plan": self.plan.model_dump(mode="json", exclude=set(STREAM_KEYS | {"channels"})),
            "scene": self.scene_sha256,
            "environment": self.environment,
            "animation_clip": self.clip,
            "overlay": self.overlay_sha256,
            "camera_path": self.path.model_dump(mode="json"),
            "sequence": self.sequence,
            "versions": versions(),
            "backend": self.variant,
        }

    @cached_property
    def _sources_key(self) -> str:
        return frame_key(self.sources)

    def inputs(self, frame: int) -> str | None:
        """sha256 of `sources` and the frame: where it is a record's, nothing that all its streams share has changed. None for a
        scene without files, about which it would say nothing."""
        return frame_key({"sources": self._sources_key, "frame": frame}) if self.scene.files else None


def sequence_record(job: Job) -> SequenceRecord:
    written = {channel.name for channel in job.channels}
    constants = {
        name: Constant(
            same_as=need.same_as,
            everywhere=list(need.constant) if need.constant is not None and name in EVERYWHERE else None,
            surface=list(need.constant) if need.constant is not None and name not in EVERYWHERE else None,
        )
        for name, need in job.needs.items()
        if not need.needed and name not in written and _can_be_filled(job, need, written)
    }
    return SequenceRecord(
        scene=job.scene_name,
        scene_sha256=job.scene_sha256,
        environment=job.environment,
        camera_path=job.path,
        camera_path_name=job.path_name,
        frames=len(job.shoot),
        up_axis=job.scene.up_axis,
        metres_per_unit=job.scene.metres_per_unit,
        objects=[item.name for item in job.scene.objects],
        moving=[index for index, item in enumerate(job.scene.objects, start=1) if item.moves],
        deforming=[index for index, item in enumerate(job.scene.objects, start=1) if job.scene.meshes[item.mesh].deforms],
        not_demodulated=_not_demodulated(job),
        animation_clip=job.clip,
        overlay=job.overlay_name,
        overlay_sha256=job.overlay_sha256,
        variation=job.variation,
        split=job.split,
        channels=[channel.name for channel in job.channels],
        constants=constants,
        equal_streams=job.equal_streams,
    )


def _not_demodulated(job: Job) -> list[int]:
    """Blended ones are layers before a surface, which has its own F_beta and the id."""
    worn = [job.scene.materials[item.material] for item in job.scene.objects]
    kept = [material.bsdf is not None and material.alpha != "blend" for material in worn]
    return [index for index, is_kept in enumerate(kept, start=1) if is_kept and job.plan.shading == "path"]


def _can_be_filled(job: Job, need: Need, written: set[str]) -> bool:
    """Whether a reader can tell the array from what is written: a value on surfaces alone needs to know where these are."""
    if need.same_as:
        return need.same_as in written or not job.needs[need.same_as].needed
    return need.channel in EVERYWHERE or not any(need.constant) or "object_id" in written
