"""corpus.json on the way to hold one more sequence, or a changed one: what is refused, and what is written."""

from dataclasses import asdict, dataclass
from pathlib import Path

from .backend import versions
from .brdf_tables import brdf_table, table_channel
from .channels import Channel
from .conventions import CONVENTIONS, Stream
from .errors import InputError
from .exr import encode
from .job import Job, sequence_record
from .manifest import LOCK, CorpusManifest, SequenceRecord, TableRecord, from_json, to_json, write_atomically
from .plan import RenderPlan, brdf_model, jitter_length, plan_streams
from .scene.needs import table_need

# What makes a sequence another one. All else about it may change: then its frames are compared part by part.
NAMING = ("scene", "environment", "camera_path_name", "animation_clip", "overlay", "variation", "split")


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
    elif job.out.is_dir() and any(item.name != LOCK and item.suffix != ".part" for item in job.out.iterdir()):
        raise InputError("is not empty and holds no corpus.json: choose another folder with --out", file=job.out)
    sequences = dict(existing.sequences) if existing else {}
    known, entry = sequences.get(job.sequence), sequence_record(job)
    if known is not None:
        entry = _renamed(entry, known)
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
    tables = job.out / "tables"
    clear_left_overs(job)
    write_atomically(job.out / "corpus.json", to_json(opened.manifest))
    if opened.table is not None:
        file = job.out / opened.manifest.brdf_table.path
        write_atomically(file, opened.table)
        for other in {*tables.glob("brdf_*.exr")} - {file}:
            other.unlink()


def clear_left_overs(job: Job) -> None:
    """Removes files under temporary names, of processes that were killed while they wrote. The caller holds the lock."""
    for folder in (job.out, job.out / "tables"):
        for file in folder.glob(".*.part"):
            file.unlink(missing_ok=True)
    for file in (job.out / job.sequence).rglob(".*.part"):
        file.unlink(missing_ok=True)


def _refuse_other_sequence(known: SequenceRecord, entry: SequenceRecord, name: str, file: Path) -> None:
    for key in NAMING:
        old, new = getattr(known, key), getattr(entry, key)
        both_its_own = key == "environment" and {old, new} == {None, "default"}  # a scene may gain its first light
        if old != new and not both_its_own:
            raise InputError(f"sequence {name} is there with another {key}: {old}, not {new}", file=file, field=key)


def _renamed(entry: SequenceRecord, known: SequenceRecord) -> SequenceRecord:
    """The entry, where its scene and path are the known ones from another place, under their names."""
    scene = {"scene": known.scene} if known.scene_sha256 == entry.scene_sha256 else {}
    path = {"camera_path_name": known.camera_path_name} if known.camera_path == entry.camera_path else {}
    return entry.model_copy(update=scene | path)


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
