"""The command `framepairs`: parses options, makes one library call, prints. Exit codes: 0 done, 1 a check failed or the
machine cannot, 2 bad input, 130 interrupted."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from . import __version__
from .bundled import camera_path_names, find_camera_path, find_scene, scene_names
from .errors import CheckFailed, FramepairsError, InputError, MachineError
from .terminal import error_console, out_console, print_description, print_rows, print_table, print_upscaled, progress

app = typer.Typer(no_args_is_help=True, add_completion=True, pretty_exceptions_enable=False, help=__doc__)

Json = Annotated[bool, typer.Option("--json", help="print JSON for machines")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="no progress, no summary")]
Backend = Annotated[str, typer.Option(help="auto, llvm or cuda")]
Clip = Annotated[str | None, typer.Option(help="animation clip of a glTF file; default: the first")]
EnvironmentFile = Annotated[Path | None, typer.Option(help="latitude-longitude image that lights the scene")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="any key of the plan, as key=value, repeatable")]
AllowOutside = Annotated[bool, typer.Option("--allow-outside", help="the scene may read files outside its own folder")]
CorpusFolder = Annotated[Path, typer.Argument(metavar="CORPUS", help="folder of a corpus")]


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
    error_console.print("framepairs: interrupted; the same command resumes")
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
def scenes(json_: Json = False) -> None:
    """List the bundled scenes."""
    rows = [(name, str(find_scene(name))) for name in scene_names()]
    print_rows(["scene", "file"], rows, json_)


@app.command()
def cameras(json_: Json = False) -> None:
    """List the bundled camera paths."""
    from .camera_path import frame_count, read_camera_path

    paths = {name: read_camera_path(find_camera_path(name)) for name in camera_path_names()}
    rows = [(name, frame_count(path), path.fps) for name, path in paths.items()]
    print_rows(["camera path", "frames", "fps"], rows, json_)


@app.command()
def render(
    scene: Annotated[str, typer.Argument(help="bundled name, or .usd* .gltf .glb .xml .obj .ply .stl .off file")],
    camera: Annotated[
        str | None, typer.Option(help="bundled name, JSON file, or a camera of the scene; default: the scene's, or an orbit")
    ] = None,
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
        str | None, typer.Option(help="JSON file of texts and images over the frames, or none; default: the one beside the scene")
    ] = None,
    plan: Annotated[Path | None, typer.Option(help="render plan as JSON; options go over it")] = None,
    settings: Settings = None,
    allow_outside: AllowOutside = False,
    backend: Backend = "auto",
    out: Annotated[Path | None, typer.Option(help="folder; default: ./<scene>-corpus")] = None,
    quiet: Quiet = False,
    json_: Json = False,
) -> None:
    """Render a scene along a camera path into a corpus; an interrupted render resumes."""
    from .options import frame_range, make_job, plan_options
    from .plan import make_plan, read_plan

    values = read_plan(plan) if plan else {}
    values |= plan_options(scale, display, shading, aa, spp, seed, streams, channels, settings)
    resolved = make_plan(values, file=plan or "options")
    scene_file = find_scene(scene)
    _activate(backend)
    default = Path(f"{scene_file.stem}-corpus")
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside, "overlay": overlay}
    job = make_job(scene, scene_file, camera, resolved, out or default, **given)
    _render(job, frame_range(frames, len(job.shoot)), quiet=quiet, json_=json_, add_streams=False)


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
    _activate(backend)
    jobs = [stored_job(opened.sequence(name), scene, resolved, out or corpus, allow_outside) for name in opened.sequences]
    if scene is not None and not any(moved for _, moved in jobs):
        raise InputError("is no scene of this corpus (sha256 differs)", file=scene)
    for (job, _), name in zip(jobs, opened.sequences, strict=True):
        frames = opened.frames(name) or range(opened.sequence(name).frames)
        _render(job, frames, quiet=quiet, json_=json_, add_streams=out is None)


@app.command()
def describe(
    scene: Annotated[str, typer.Argument(help="bundled name or scene file")],
    camera: Annotated[str | None, typer.Option(help="bundled name, JSON file, or a camera of the scene")] = None,
    clip: Clip = None,
    environment: EnvironmentFile = None,
    display: Annotated[str | None, typer.Option(help="HR size, as 1920x1080")] = None,
    settings: Settings = None,
    measure: Annotated[bool, typer.Option(help="measure what leaving out saves (renders a frame)")] = True,
    allow_outside: AllowOutside = False,
    json_: Json = False,
) -> None:
    """Say what a scene holds, which channels it needs and why, what leaving the others out saves, and what is not read."""
    from dataclasses import asdict

    from .options import make_job, plan_options
    from .plan import make_plan
    from .scene_report import facts, rows

    plan = make_plan(plan_options(display=display, settings=settings), file="options")
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside}
    job = make_job(scene, find_scene(scene), camera, plan, Path(), **given)
    found, channels = facts(job.scene, job.environment, job.path_name), rows(job, measured=measure)
    if json_:
        print(json.dumps(found | {"channels": {row.name: asdict(row) for row in channels}}, indent=1))
    else:
        print_description(job.scene, found, channels)


@app.command()
def validate(corpus: CorpusFolder, json_: Json = False, quiet: Quiet = False) -> None:
    """Check a corpus; exit code 1 where a check fails."""
    from dataclasses import asdict

    from .corpus import Corpus
    from .validate import validate_corpus

    opened = Corpus(corpus)
    total = sum(len(opened.frames(name)) for name in opened.sequences)
    with progress(quiet or json_) as bar:
        task = bar.add_task("validating", total=total)
        results = validate_corpus(opened, on_frame=lambda *_: bar.advance(task))
    failed = [result for result in results if result.verdict == "fail"]
    if json_:
        print(json.dumps([asdict(result) for result in results], indent=1))
    elif not quiet:
        rows = [(r.id, r.verdict, "" if r.figure is None else f"{r.figure:.6g}", r.proves) for r in results]
        print_table(f"validate {corpus}", ["check", "verdict", "worst", "proves"], rows)
    if failed:
        where = f": {failed[0].worst[0]}" if failed[0].worst else ""
        raise CheckFailed(f"{corpus}: failed {', '.join(result.id for result in failed)}{where}")


@app.command()
def warp(
    corpus: CorpusFolder,
    stream: Annotated[list[str] | None, typer.Option(help="stream, repeatable; default: all")] = None,
    out: Annotated[Path | None, typer.Option(help="write pictures of the worst frames there")] = None,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Warp each frame's predecessor along motion: the worst frame's share of ids, positions, albedo and normals that agree."""
    from .consistency import sequence_consistency, summarise_sequence
    from .corpus import Corpus
    from .preview import write_consistency

    opened, rows = Corpus(corpus), []
    with progress(quiet or json_) as bar:
        task = bar.add_task("warping", total=sum(len(opened.streams(name)) for name in opened.sequences))
        for sequence in opened.sequences:
            for name in stream or opened.streams(sequence):
                results = list(sequence_consistency(opened, sequence, name))
                rows += [{"sequence": sequence, "stream": name, **row} for row in summarise_sequence(results)]
                if out is not None:
                    write_consistency(opened, sequence, name, results, out)
                bar.advance(task)
    if json_:
        print(json.dumps(rows, indent=1))
    elif not quiet:
        for place in dict.fromkeys((row["sequence"], row["stream"]) for row in rows):
            shown = [list(row.values())[2:] for row in rows if (row["sequence"], row["stream"]) == place]
            shown = [[value if isinstance(value, (str, int)) else f"{value:.4g}" for value in row] for row in shown]
            print_table(f"{' '.join(place)}: worst frames", list(rows[0])[2:], shown)


@app.command()
def upscale(
    corpus: CorpusFolder,
    method: Annotated[list[str] | None, typer.Option(help="nearest, bilinear, bicubic or accumulate, repeatable")] = None,
    stream: Annotated[list[str] | None, typer.Option(help="LR stream, repeatable; default: all")] = None,
    truth: Annotated[str, typer.Option(help="stream to measure against: hr, hr_mip0 or hr_native")] = "hr",
    out: Annotated[Path | None, typer.Option(help="write the upscaled frames there as PNG")] = None,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Bring LR streams back to the display's size and measure them against the truth (display transform aces_srgb)."""
    from .corpus import Corpus
    from .manifest import make_folder
    from .upscale import METHODS, summarise

    opened = Corpus(corpus)
    if out is not None:
        make_folder(out)
    unknown = [name for name in method or () if name not in METHODS]
    if unknown:
        raise InputError(f"unknown method {unknown[0]!r}; known are {', '.join(METHODS)}", field="method")
    rows = []
    with progress(quiet or json_) as bar:
        task = bar.add_task("upscaling", total=sum(len(opened.frames(name)) for name in opened.sequences))
        for sequence in opened.sequences:
            lr = [name for name in opened.streams(sequence) if name.startswith("lr_")]
            unknown = [name for name in stream or () if name not in lr]
            if unknown:
                raise InputError(f"no LR stream {unknown[0]!r}; there are {', '.join(lr)}", file=corpus)
            if truth not in opened.streams(sequence):
                raise InputError(f"no stream {truth!r}; there are {', '.join(opened.streams(sequence))}", file=corpus)
            pairs = [(name, chosen) for name in (stream or lr) for chosen in (method or METHODS)]
            rows += summarise(opened, sequence, pairs, out, on_frame=lambda: bar.advance(task), truth_stream=truth)
    if json_:
        print(json.dumps(rows, indent=1))
    elif not quiet:
        for sequence in opened.sequences:
            print_upscaled(sequence, [row for row in rows if row["sequence"] == sequence])


@app.command()
def preview(
    target: Annotated[str, typer.Argument(metavar="CORPUS|SCENE", help="folder of a corpus; with --compare, a scene")],
    compare: Annotated[tuple[str, str] | None, typer.Option(help="two shading modes, as: raster path")] = None,
    display: Annotated[str | None, typer.Option(help="size, as 640x360 (--compare)")] = None,
    frames: Annotated[str | None, typer.Option(help="first:end (--compare); default: first, middle and last")] = None,
    spp: Annotated[int | None, typer.Option(help="light paths per pixel (--compare)")] = None,
    camera: Annotated[str | None, typer.Option(help="bundled name or JSON file (--compare)")] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", help="key=value of the plan, repeatable (--compare)")] = None,
    out: Annotated[Path | None, typer.Option(help="folder; default: CORPUS-preview beside the corpus")] = None,
    quiet: Quiet = False,
) -> None:
    """Write PNG contact sheets of a corpus (every channel, every stream), or a scene in two shading modes side by side."""
    from .corpus import Corpus
    from .manifest import make_folder
    from .preview import write_previews

    if compare is not None:
        values = {"display": display or "640x360", "spp": spp, "settings": settings}
        _compare(target, camera, compare, frames, values, out or Path(f"{Path(target).stem}-preview"), quiet)
        return
    given = {"display": display, "frames": frames, "spp": spp, "camera": camera, "set": settings}
    if any(given.values()):
        raise InputError("needs --compare", field=next(name for name, value in given.items() if value))
    corpus = Path(target)
    opened = Corpus(corpus)
    if out is not None:
        make_folder(out)
    folder = out or corpus.with_name(f"{corpus.resolve().name}-preview")
    for file in write_previews(opened, folder):
        if not quiet:
            print(file)


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


def _compare(target: str, camera, modes: tuple[str, str], frames, values: dict, out: Path, quiet: bool) -> None:
    from .comparison import compare_modes, write_comparison
    from .frame import Shoot
    from .options import camera_path_of, frame_range, plan_options
    from .plan import make_plan
    from .scene import light_scene, load_scene

    plan = make_plan(plan_options(**values), file="options")
    for mode in modes:
        make_plan({"shading": mode}, file="compare")
    scene, _ = light_scene(load_scene(find_scene(target)), None)
    path, _ = camera_path_of(target, camera, scene)
    count = len(Shoot(scene, path, 1.0))
    chosen = sorted({0, count // 2, count - 1}) if frames is None else list(frame_range(frames, count))
    compared = compare_modes(scene, path, plan, modes, chosen)
    file = write_comparison(compared, modes, out / f"{scene.name}_{modes[0]}_{modes[1]}.png")
    if not quiet:
        rows = [(item.frame, f"{item.psnr:.2f}", f"{item.mean_ratio:.3f}") for item in compared]
        print_table(f"{modes[1]} against {modes[0]}", ["frame", "PSNR", "mean radiance ratio"], rows)
        print(file)


def _activate(backend: str) -> None:
    if backend not in ("auto", "llvm", "cuda"):
        raise InputError(f"must be auto, llvm or cuda, not {backend!r}", field="backend")
    from .backend import activate

    activate(backend)


def _render(job, frames: Sequence[int], *, quiet: bool, json_: bool, add_streams: bool) -> None:
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
    if json_:
        print(json.dumps(summary))
    elif not quiet:
        out_console.print(
            f"{rendered} frames rendered, {len(frames) - rendered} were there; {size / 1e6:.1f} MB in {elapsed:.1f} s",
            markup=False,
        )


if __name__ == "__main__":
    main()
