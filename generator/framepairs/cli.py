"""The command `framepairs`: parses options, makes one library call, prints. Exit codes: 0 done, 1 a check failed or the
machine cannot, 2 bad input, 130 interrupted."""

import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from . import __version__, cli_corpora, cli_scenes
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
from .errors import FramepairsError, InputError, MachineError
from .terminal import error_console, out_console, print_table, progress

app = typer.Typer(no_args_is_help=True, add_completion=True, pretty_exceptions_enable=False, help=__doc__)


for command in (cli_scenes.scenes, cli_scenes.describe):
    app.command()(command)
app.add_typer(cli_scenes.cameras, name="cameras")
for command in (cli_corpora.validate, cli_corpora.warp, cli_corpora.upscale, cli_corpora.preview):
    app.command()(command)


def main() -> None:
    """Run the command line; our own errors become one line and an exit code."""
    try:
        if app(standalone_mode=False) == 130:  # newer Typer returns the exit code of an interrupt instead of raising
            raise KeyboardInterrupt
    except FramepairsError as error:
        error_console.print(f"framepairs: {error}", style="bold red", markup=False, soft_wrap=True)
        sys.exit(error.exit_code)
    except MemoryError:
        error_console.print("framepairs: this needs more memory than the machine has", style="bold red")
        sys.exit(1)
    except typer.Exit as leave:
        sys.exit(leave.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        _leave_interrupted()
    except Exception as error:
        if _comes_from_interrupt(error):  # Dr.Jit wraps what is raised while it traces a loop
            _leave_interrupted()
        usage = getattr(error, "format_message", None)
        if usage is None:
            raise
        if usage():  # empty where Typer has printed the help already
            error_console.print(f"framepairs: {usage()}", style="bold red", markup=False, soft_wrap=True)
        sys.exit(2)


def _leave_interrupted() -> None:
    error_console.print("framepairs: interrupted; type the same command again")
    sys.exit(130)


def _comes_from_interrupt(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


@app.command()
def doctor(json_: Json = False) -> None:
    """Say which back end this machine has, and what to install where it has none."""
    from .backend import INSTALL_LINE, describe_machine

    found = describe_machine()
    if json_:
        print(json.dumps(found, indent=1))
    else:
        rows = [("python", found["python"]), *found["versions"].items(), ("variant", found["variant"] or "none")]
        rows += [("libLLVM", f"{lib['path']}: {lib['why']}") for lib in found["libraries"]]
        rows += [("used", found["libllvm"] or "none"), ("CUDA", "yes" if found["cuda"] else "no")]
        print_table("", ["", ""], rows)
    if found["variant"] is None:
        raise MachineError(INSTALL_LINE)


@app.command()
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
    activate_backend(backend)
    default = Path(f"{scene_file.stem}-corpus")
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside, "overlay": overlay, "vary": vary}
    make = partial(make_job, scene, scene_file, plan=resolved, out=out or default, fps=fps, **given)
    folder = Path(camera) if camera is not None and Path(camera).is_dir() else None
    if split is not None and folder is None:
        raise InputError("needs --camera with a folder of sampled paths", field="split")
    jobs = [make(camera)] if folder is None else sampled_jobs(folder, split, fps, make)
    _render([(job, frame_range(frames, len(job.shoot))) for job in jobs], quiet=quiet, json_=json_, add_streams=False)


@app.command()
def regenerate(
    corpus: CorpusFolder,
    scale: Annotated[list[float], typer.Option(help="scale factor of the new LR streams, repeatable")],
    out: Annotated[Path | None, typer.Option(help="write a new corpus there instead of adding streams")] = None,
    scene: Annotated[str | None, typer.Option(help="where the scene lies now, if it was moved")] = None,
    allow_outside: AllowOutside = False,
    backend: Backend = "auto",
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
    activate_backend(backend)
    jobs = [stored_job(opened.sequence(name), scene, resolved, out or corpus, allow_outside) for name in opened.sequences]
    if scene is not None and not any(moved for _, moved in jobs):
        raise InputError("is no scene of this corpus (sha256 differs)", file=scene)
    frames = [opened.frames(name) or range(opened.sequence(name).frames) for name in opened.sequences]
    asked = [(job, chosen) for (job, _), chosen in zip(jobs, frames, strict=True)]
    _render(asked, quiet=quiet, json_=json_, add_streams=out is None)


@app.command()
def brdf(
    model: Annotated[str, typer.Option(help="separable_smith, height_correlated or schlick_k")] = "separable_smith",
    mapping: Annotated[str, typer.Option(help="alpha of a roughness r: squared (r^2) or linear (r)")] = "squared",
    size: Annotated[int, typer.Option(min=8, max=2048, help="nodes per axis")] = 512,
    out: Annotated[Path | None, typer.Option(help="write the table there, as EXR with channels A and B")] = None,
    plot: Annotated[Path | None, typer.Option(help="write error against time there, as .svg or .png")] = None,
    json_: Json = False,
) -> None:
    """Make the pre-integrated BRDF table by every method: its error against float64 quadrature, and its time."""
    from dataclasses import asdict
    from typing import get_args

    from .brdf_report import report
    from .conventions import BrdfModel, RoughnessMapping, Visibility

    for field, value, known in (("model", model, get_args(Visibility)), ("mapping", mapping, get_args(RoughnessMapping))):
        if value not in known:
            raise InputError(f"must be one of {', '.join(known)}, not {value!r}", field=field)
    rows = report(BrdfModel(model, mapping), size, table_file=out, plot_file=plot)
    if json_:
        print(json.dumps([asdict(row) for row in rows], indent=1))
    else:
        shown = [(r.method, r.samples, f"{r.seconds:.3f}", f"{r.max_error:.2e}", f"{r.rms_error:.2e}") for r in rows]
        columns = ["method", "samples", "seconds", "largest error", "RMS error"]
        print_table(f"{model}, {mapping}, {size} x {size}: A and B against float64 quadrature", columns, shown)


@app.command()
def version() -> None:
    """Print the version."""
    print(__version__)


def _render(asked: list[tuple], *, quiet: bool, json_: bool, add_streams: bool) -> None:
    """Renders jobs with their frames. With --json, one document: an object for one sequence, a list for several."""
    summaries = [_render_one(job, frames, quiet=quiet, json_=json_, add_streams=add_streams) for job, frames in asked]
    if json_:
        print(json.dumps(summaries if len(summaries) != 1 else summaries[0]))


def _render_one(job, frames: Sequence[int], *, quiet: bool, json_: bool, add_streams: bool) -> dict:
    import time

    from .pipeline import estimated_bytes, render_sequence

    silent = quiet or json_
    if not silent:
        estimate = estimated_bytes(job, len(frames)) / 1e9
        out_console.print(f"{job.sequence}: {len(frames)} frames into {job.out}, at most {estimate:.2f} GB", markup=False)
    start, rendered, size = time.perf_counter(), 0, 0
    with progress(silent) as bar:
        task = bar.add_task(job.sequence, total=len(frames))
        for step in render_sequence(job, frames, add_streams=add_streams):
            rendered, size = rendered + step.rendered, size + step.bytes
            elapsed = time.perf_counter() - start
            bar.update(task, advance=1, description=f"{job.sequence}  {elapsed / max(rendered, 1):.2f} s/frame")
    elapsed = time.perf_counter() - start
    summary = {
        "corpus": str(job.out), "sequence": job.sequence, "frames": len(frames), "rendered": rendered, "bytes": size,
        "seconds": round(elapsed, 3), "channels": [channel.name for channel in job.channels],
    }  # fmt: skip
    if not silent:
        out_console.print(
            f"{rendered} frames rendered, {len(frames) - rendered} were there; {size / 1e6:.1f} MB in {elapsed:.1f} s",
            markup=False,
        )
    return summary


if __name__ == "__main__":
    main()
