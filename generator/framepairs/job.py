"""One sequence to render into a corpus: what it needs, what its frames are made from, and its entry in corpus.json."""

import hashlib
import re
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path

from .backend import mi, versions
from .brdf_tables import brdf_table, table_channel
from .camera_path import CameraPath
from .channels import Channel, channels_with
from .conventions import CONVENTIONS, Stream
from .digests import digest
from .errors import InputError
from .exr import encode
from .frame import Shoot
from .manifest import (
    LOCK,
    Constant,
    CorpusManifest,
    SequenceRecord,
    TableRecord,
    frame_key,
    from_json,
    to_json,
    write_atomically,
)
from .overlay_elements import Overlay
from .plan import STREAM_KEYS, RenderPlan, brdf_model, jitter_length, plan_streams
from .scene import files_hash, scene_hash
from .scene.description import SceneDescription
from .scene.needs import Need, channel_needs, equal_streams, table_need

EVERYWHERE = ("motion", "visibility")  # channels whose constant holds in the background too
# What makes a sequence another one. All else about it may change: then its frames are compared part by part.
NAMING = ("scene", "environment", "camera_path_name", "animation_clip", "overlay", "variation", "split")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One sequence to render. scene must be lit (`light_scene`); the names are what the manifest says. variant: of Mitsuba,
    that renders; where workers do, it need not be this process's."""

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
    def overlay_sha256(self) -> str | None:
        return files_hash(self.overlay.files) if self.overlay is not None else None

    @cached_property
    def scene_sha256(self) -> str:
        return scene_hash(self.scene)

    @cached_property
    def scene_content(self) -> str:
        """sha256 of what the scene is at all times: meshes, textures, materials, sky, and what lights are chosen by."""
        scene = self.scene
        kept = self.scene_sha256 if any(material.bsdf is not None for material in scene.materials) else None
        still = (scene.meshes, scene.textures, scene.materials, scene.objects, scene.environment, kept)
        return digest((still, scene.metres_per_unit, scene.squared_diagonal))

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

    def inputs(self, frame: int) -> str | None:
        """sha256 of `sources` and the frame: where it is a record's, nothing that decides the frame has changed. None for a
        scene without files, about which it would say nothing."""
        return frame_key({**self.sources, "frame": frame}) if self.scene.files else None


@dataclass(frozen=True)
class Opened:
    """A corpus on the way to a new manifest. changes: whether what lies there may have been made from something else."""

    manifest: CorpusManifest
    table: bytes | None
    changes: bool


def open_corpus(job: Job, *, add_streams: bool = False, update: bool = False) -> Opened:
    """What corpus.json will be with the job's sequence in it. Nothing is written.

    Raises InputError for a corpus of another plan; with `add_streams`, scales and variants may grow, and with `update` the
    plan of a corpus without other sequences may change. Also for a sequence of that name that is another scene's or path's.
    """
    file = job.out / "corpus.json"
    existing: CorpusManifest | None = None
    if file.is_file():
        existing = from_json(CorpusManifest, file)
        others = [name for name in existing.sequences if name != job.sequence]
        if not (update and not others):
            _refuse_other_plan(existing.plan, job.plan, file, add_streams, others if update else None)
    elif job.out.is_dir() and any(name.name != LOCK for name in job.out.iterdir()):
        raise InputError("is not empty and holds no corpus.json: choose another folder with --out", file=job.out)
    sequences = dict(existing.sequences) if existing else {}
    known, entry = sequences.get(job.sequence), _sequence_record(job)
    if known is not None:
        _refuse_other_sequence(known, entry, job.sequence, file)
    table, data = _table(job) if table_need(job.scene, job.plan).needed else (None, None)
    manifest = CorpusManifest(
        plan=job.plan,
        backend=job.variant,
        versions=versions(),
        conventions=CONVENTIONS,
        channels=[_channel_row(channel) for channel in job.table],
        streams=[_stream_row(job.plan, stream) for stream in plan_streams(job.plan)],
        brdf_table=table or (existing.brdf_table if existing else None),
        sequences={**sequences, job.sequence: entry},
    )
    changes = known is not None and (not job.scene.files or to_json(manifest) != file.read_bytes())
    return Opened(manifest, data, changes)


def write_manifest(job: Job, opened: Opened) -> None:
    """Write corpus.json and the table, and clear away what a killed render left. Raises MachineError."""
    for left_over in (job.out / job.sequence).rglob(".*.part"):
        left_over.unlink(missing_ok=True)
    write_atomically(job.out / "corpus.json", to_json(opened.manifest))
    if opened.table is not None:
        write_atomically(job.out / opened.manifest.brdf_table.path, opened.table)


def _refuse_other_sequence(known: SequenceRecord, entry: SequenceRecord, name: str, file: Path) -> None:
    for key in NAMING:
        old, new = getattr(known, key), getattr(entry, key)
        both_its_own = key == "environment" and {old, new} == {None, "default"}  # a scene may gain its first light
        if old != new and not both_its_own:
            raise InputError(f"sequence {name} is there with another {key}", file=file, field=key)


def _refuse_other_plan(
    existing: RenderPlan, wanted: RenderPlan, file: Path, add_streams: bool, others: list[str] | None
) -> None:
    for key in RenderPlan.model_fields:
        old, new = getattr(existing, key), getattr(wanted, key)
        extends = add_streams and key in ("scales", "variants") and new[: len(old)] == old
        if old != new and not extends:
            way = f"; sequence {others[0]} has it, too" if others else "; --update renders again what it decides"
            raise InputError(f"the corpus has {key} = {old}, not {new}{way}", file=file, field=f"plan.{key}")


def _table(job: Job) -> tuple[TableRecord, bytes]:
    model = brdf_model(job.plan)
    channel = table_channel(model)
    encoded = encode(channel, brdf_table(model, job.plan.brdf_table).numpy(), attributes={})
    path = f"tables/brdf_{model.visibility}.exr"
    return TableRecord(model=model.visibility, path=path, sha256=encoded.sha256, axes=channel.meaning), encoded.data


def _sequence_record(job: Job) -> SequenceRecord:
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


def _channel_row(channel: Channel) -> dict:
    row = asdict(channel)
    if channel.background is not None:
        row["background"] = ["inf" if value == float("inf") else float(value) for value in channel.background]
    return row


def _stream_row(plan: RenderPlan, stream: Stream) -> dict:
    length = jitter_length(plan, stream.scale) if stream.jittered else None
    sequence = "Halton(2, 3) from index 1, minus 0.5" if stream.jittered else None
    return {
        **asdict(stream),
        "effective_scale": list(stream.effective_scale(plan.display)),
        "jitter_length": length,
        "jitter_sequence": sequence,
    }
