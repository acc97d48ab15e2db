"""The commands that render: `render` and `regenerate`."""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from . import interrupts
from .bundled import find_scene
from .cli_options import (
    AllowOutside,
    Backend,
    Clip,
    CorpusFolder,
    EnvironmentFile,
    Json,
    Quiet,
    Settings,
    Vary,
    activate_backend,
)  # fmt: skip
from .errors import InputError
from .terminal import out_console, print_profile, progress

Engine = Annotated[str, typer.Option(help="local, or dask: many processes or machines")]
Workers = Annotated[int | None, typer.Option(min=1, help="dask: processes of this machine; default: one per core or GPU")]
Scheduler = Annotated[str | None, typer.Option(help="dask: address or file of a scheduler, instead of own processes")]
Tls = Annotated[
    tuple[Path, Path, Path] | None,
    typer.Option("--tls", help="dask: certificate authority, certificate and key", metavar="CA CERT KEY"),
]
Insecure = Annotated[bool, typer.Option("--insecure", help="dask: a scheduler on another machine without TLS is allowed")]
TaskFrames = Annotated[int | None, typer.Option(min=1, help="dask: frames per task; default: four tasks per worker")]
Retries = Annotated[int, typer.Option(min=0, help="dask: how often a task that fails is tried again")]
RenewEvery = Annotated[int | None, typer.Option(min=1, help="render in a child process, a new one after so many frames")]
Update = Annotated[bool, typer.Option("--update", help="the plan of a corpus may change: what it decides is rendered again")]
Profile = Annotated[bool, typer.Option("--profile", help="what each frame cost: kernels, and seconds by stage")]


def render(
    scene: Annotated[str, typer.Argument(help="bundled name, or .usd* .gltf .glb .xml .obj .ply .stl .off file")],
    camera: Annotated[
        str | None,
        typer.Option(help="bundled name, JSON file, a camera of the scene, or a folder of sampled ones; default: the scene's"),
    ] = None,
    split: Annotated[str | None, typer.Option(help="train, val or test: of a folder of sampled camera paths")] = None,
    fps: Annotated[float | None, typer.Option(help="frames per second, instead of the path's own")] = None,
    scale: Annotated[list[float] | None, typer.Option(help="scale factor of LR streams, repeatable")] = None,
    display: Annotated[str | None, typer.Option(help="HR size, as 1920x1080")] = None,
    frames: Annotated[str | None, typer.Option(help="first:end, as 0:32; default: the whole path")] = None,
    shading: Annotated[str | None, typer.Option(help="raster or path")] = None,
    aa: Annotated[int | None, typer.Option(help="samples per pixel of the HR truth")] = None,
    spp: Annotated[int | None, typer.Option(help="light paths per pixel, with path shading")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the light paths")] = None,
    streams: Annotated[str | None, typer.Option(help="LR native,jittered,mip,jittered_mip and hr_native,hr_mip0")] = None,
    channels: Annotated[str | None, typer.Option(help="a,b,c for exactly these, 'all', or 'needed'")] = None,
    environment: EnvironmentFile = None,
    clip: Clip = None,
    overlay: Annotated[
        str | None, typer.Option(help="JSON file of texts and images over the frames, or none; default: beside the scene")
    ] = None,
    vary: Vary = None,
    plan: Annotated[Path | None, typer.Option(help="render plan as JSON; options go over it")] = None,
    settings: Settings = None,
    allow_outside: AllowOutside = False,
    backend: Backend = "auto",
    out: Annotated[Path | None, typer.Option(help="folder; default: ./<scene>-corpus")] = None,
    update: Update = False,
    engine: Engine = "local",
    workers: Workers = None,
    scheduler: Scheduler = None,
    tls: Tls = None,
    insecure: Insecure = False,
    task_frames: TaskFrames = None,
    retries: Retries = 2,
    renew_every: RenewEvery = None,
    profile: Profile = False,
    quiet: Quiet = False,
    json_: Json = False,
) -> None:
    """Render a scene along a camera path into a corpus; an interrupted render resumes."""
    from .options import frame_range, make_job, plan_options, sampled_jobs
    from .plan import make_plan, read_plan

    values = read_plan(plan) if plan else {}
    values |= plan_options(scale, display, shading, aa, spp, seed, streams, channels, settings)
    resolved = make_plan(values, file=plan or "options")
    scene_file = find_scene(scene)
    activate_backend(_backend_here(engine, backend))
    default = Path(f"{scene_file.stem}-corpus")
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside, "overlay": overlay, "vary": vary}
    make = partial(make_job, scene, scene_file, plan=resolved, out=out or default, fps=fps, **given)
    folder = Path(camera) if camera is not None and Path(camera).is_dir() else None
    if split is not None and folder is None:
        raise InputError("needs --camera with a folder of sampled paths", field="split")
    jobs = [make(camera)] if folder is None else sampled_jobs(folder, split, fps, make)
    asked = [(_on(job, engine, backend), frame_range(frames, len(job.shoot))) for job in jobs]
    fleet = _fleet(engine, workers, scheduler, tls, insecure, task_frames, retries, renew_every)
    with _renderers(engine, fleet, renew_every, asked[0][0], allow_outside, profile) as renderer_of:
        _render(asked, renderer_of, quiet=quiet, json_=json_, update=update, profile=profile)


def regenerate(
    corpus: CorpusFolder,
    scale: Annotated[list[float], typer.Option(help="scale factor of the new LR streams, repeatable")],
    out: Annotated[Path | None, typer.Option(help="write a new corpus there instead of adding streams")] = None,
    scene: Annotated[str | None, typer.Option(help="where the scene lies now, if it was moved")] = None,
    allow_outside: AllowOutside = False,
    backend: Backend = "auto",
    engine: Engine = "local",
    workers: Workers = None,
    scheduler: Scheduler = None,
    tls: Tls = None,
    insecure: Insecure = False,
    task_frames: TaskFrames = None,
    retries: Retries = 2,
    renew_every: RenewEvery = None,
    profile: Profile = False,
    quiet: Quiet = False,
    json_: Json = False,
) -> None:
    """Render a corpus again at other scales, from its own manifest."""
    from .corpus import Corpus
    from .options import stored_job
    from .plan import make_plan

    opened = Corpus(corpus)
    plan = opened.manifest.plan
    kept = () if out else tuple(plan.scales)
    scales = kept + tuple(value for value in scale if value not in kept)
    resolved = make_plan(plan.model_dump() | {"scales": scales}, file="options")
    activate_backend(_backend_here(engine, backend))
    jobs = [stored_job(opened.sequence(name), scene, resolved, out or corpus, allow_outside) for name in opened.sequences]
    if scene is not None and not any(moved for _, moved in jobs):
        raise InputError("is no scene of this corpus (sha256 differs)", file=scene)
    frames = [opened.frames(name) or range(opened.sequence(name).frames) for name in opened.sequences]
    asked = [(_on(job, engine, backend), chosen) for (job, _), chosen in zip(jobs, frames, strict=True)]
    fleet = _fleet(engine, workers, scheduler, tls, insecure, task_frames, retries, renew_every)
    with _renderers(engine, fleet, renew_every, asked[0][0], allow_outside, profile) as renderer_of:
        _render(asked, renderer_of, quiet=quiet, json_=json_, add_streams=out is None, profile=profile)


def _backend_here(engine: str, backend: str) -> str:
    """The client of a fleet loads scenes and renders nothing: its own back end will do."""
    return "auto" if engine == "dask" and backend == "cuda" else backend


def _on(job, engine: str, backend: str):
    """The job, as what will render it."""
    from .backend import VARIANTS

    return replace(job, variant=VARIANTS["cuda"]) if engine == "dask" and backend == "cuda" else job


def _fleet(engine, workers, scheduler, tls, insecure, task_frames, retries, renew_every):
    """Refuses options that go with another engine."""
    from .fleet import Fleet

    if engine not in ("local", "dask"):
        raise InputError(f"must be local or dask, not {engine!r}", field="engine")
    given = {"workers": workers, "scheduler": scheduler, "tls": tls, "insecure": insecure or None, "task-frames": task_frames}
    named = next((name for name, value in given.items() if value is not None), None)
    if engine == "local" and named is not None:
        raise InputError("needs --engine dask", field=named)
    if engine == "dask" and renew_every is not None:
        raise InputError("needs --engine local; workers of dask are renewed with their --lifetime", field="renew-every")
    if scheduler is not None and workers is not None:
        raise InputError("that scheduler has its own", field="workers")
    return Fleet(
        scheduler=scheduler, workers=workers, tls=tls, insecure=insecure, frames_per_task=task_frames, retries=retries
    )


@contextmanager
def _renderers(engine: str, fleet, renew_every: int | None, job, allow_outside: bool, profile: bool) -> Iterator[Callable]:
    """A function from a job to who renders it; None: this process."""
    from .children import renewed_renderer
    from .fleet import connected, fleet_renderer
    from .orders import order_of

    if engine == "dask":
        with connected(fleet, job.variant) as client:
            yield lambda job: fleet_renderer(client, order_of(job, allow_outside), fleet)
    elif renew_every is not None:
        yield lambda job: renewed_renderer(order_of(job, allow_outside), renew_every, profile)
    else:
        yield lambda job: None


def _render(asked: list[tuple], renderer_of: Callable, *, quiet: bool, json_: bool, profile: bool, **options) -> None:
    """Renders jobs with their frames. With --json, one document: an object for one sequence, a list for several."""
    summaries = []
    for job, frames in asked:
        interrupts.check()
        options |= {"renderer": renderer_of(job), "profile": profile}
        summaries.append(_render_one(job, frames, silent=quiet or json_, options=options))
    if json_:
        print(json.dumps(summaries if len(summaries) != 1 else summaries[0]))


def _render_one(job, frames: Sequence[int], *, silent: bool, options: dict) -> dict:
    from .pipeline import estimated_bytes, render_sequence

    if not silent:
        estimate = estimated_bytes(job, len(frames)) / 1e9
        out_console.print(f"{job.sequence}: {len(frames)} frames into {job.out}, at most {estimate:.2f} GB", markup=False)
    start, size, reasons, workers, profiles = time.perf_counter(), 0, Counter(), set(), {}
    with progress(silent) as bar:
        task = bar.add_task(job.sequence, total=len(frames))
        for step in render_sequence(job, frames, **options):
            interrupts.check()
            size += step.bytes
            reasons.update([step.why] if step.rendered else [])
            workers |= {step.worker} - {""}
            if step.profile and options["profile"]:
                profiles[step.frame] = asdict(step.profile)
            pace = (time.perf_counter() - start) / max(reasons.total(), 1)
            fleet = f", {len(workers)} workers" if workers else ""
            bar.update(task, advance=1, description=f"{job.sequence}  {pace:.2f} s/frame{fleet}")
    elapsed, rendered = time.perf_counter() - start, reasons.total()
    summary = {
        "corpus": str(job.out), "sequence": job.sequence, "frames": len(frames), "rendered": rendered, "bytes": size,
        "seconds": round(elapsed, 3), "channels": [channel.name for channel in job.channels], "why": dict(reasons),
    }  # fmt: skip
    if profiles:
        summary["profile"] = profiles
    if not silent:
        if profiles:
            print_profile(profiles)
        for why, count in reasons.items():
            out_console.print(f"{count} rendered: {why}", markup=False)
        line = f"{rendered} frames rendered, {len(frames) - rendered} were there; {size / 1e6:.1f} MB in {elapsed:.1f} s"
        out_console.print(line, markup=False)
    return summary
