"""The commands about scenes and camera paths: `scenes`, `cameras`, `cameras sample`, `describe`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .bundled import bundled_folder, find_scene
from .cli_options import AllowOutside, Backend, Clip, EnvironmentFile, Json, Quiet, Settings, Vary, activate_backend
from .terminal import out_console, print_description, print_rows, progress

Html = Annotated[Path | None, typer.Option("--html", help="write one page with pictures there")]

cameras = typer.Typer(help="List the bundled camera paths, or sample new ones through a scene.")


def scenes(html: Html = None, json_: Json = False) -> None:
    """List the bundled scenes."""
    from .listings import listed_scenes

    _list("scene", "Bundled scenes", listed_scenes(), bundled_folder("scenes"), html, json_)


@cameras.callback(invoke_without_command=True)
def list_cameras(context: typer.Context, html: Html = None, json_: Json = False) -> None:
    """List the bundled camera paths, or sample new ones through a scene."""
    if context.invoked_subcommand is None:
        from .listings import listed_cameras

        _list("camera path", "Bundled camera paths", listed_cameras(), bundled_folder("camera_paths"), html, json_)


@cameras.command("sample")
def sample_paths(
    scene: Annotated[str, typer.Argument(help="bundled name or scene file")],
    count: Annotated[int, typer.Option(help="paths")] = 54,
    frames: Annotated[int, typer.Option(help="of each path")] = 100,
    style: Annotated[
        list[str] | None, typer.Option(help="calm, fast, stop-and-go, hand-held or vehicle, repeatable: in turn")
    ] = None,
    seed: Annotated[int, typer.Option(help="of all random choices")] = 0,
    fps: Annotated[float, typer.Option(help="frames per second")] = 24,
    clearance: Annotated[float | None, typer.Option(help="metres to keep from every surface")] = None,
    cell: Annotated[float | None, typer.Option(help="metres, size of the cells of free space")] = None,
    view_distance: Annotated[float | None, typer.Option(help="metres up to which a surface counts as seen")] = None,
    bounds: Annotated[str | None, typer.Option(help="where cameras may go: low and high corner, as -5,0,-5,5,4,5")] = None,
    split: Annotated[str | None, typer.Option(help="shares of train, val and test, as 0.8,0.1,0.1")] = None,
    out: Annotated[Path | None, typer.Option(help="folder; default: ./<scene>-cameras")] = None,
    force: Annotated[bool, typer.Option(help="replace another sampling in the folder")] = False,
    allow_outside: AllowOutside = False,
    backend: Backend = "auto",
    quiet: Quiet = False,
    json_: Json = False,
) -> None:
    """Sample camera paths through a scene's free space, split into train, val and test."""
    from .sampling.files import hinted_bounds, make_options, parse_numbers

    file = find_scene(scene)
    options = make_options(
        count=count, frames=frames, styles=style and tuple(style), seed=seed, fps=fps, clearance_m=clearance, cell_m=cell,
        view_distance_m=view_distance, bounds=parse_numbers(bounds, "-5,0,-5,5,4,5", "bounds") or hinted_bounds(file),
        split=parse_numbers(split, "0.8,0.1,0.1", "split"),
    )  # fmt: skip
    activate_backend(backend)
    from .sampling.writer import sample_into
    from .scene import load_scene

    folder = out or Path(f"{file.stem}-cameras")
    described = load_scene(file, allow_outside=allow_outside)
    with progress(quiet or json_) as bar:
        task = bar.add_task("sampling", total=count)

        def told(number: int, share: float) -> None:
            bar.update(task, completed=number, description=f"{share:.0%} seen")

        done = sample_into(described, scene, options, folder, force=force, on_path=told).file
    if json_:
        print(done.model_dump_json(indent=1))
    elif not quiet:
        seen = f"{done.coverage:.1%} of {done.cells} cells seen"
        out_console.print(f"{count} paths in {folder}: {seen}, at least {done.clearance_m:g} m from everything", markup=False)


def describe(
    scene: Annotated[str, typer.Argument(help="bundled name or scene file")],
    camera: Annotated[str | None, typer.Option(help="bundled name, JSON file, or a camera of the scene")] = None,
    clip: Clip = None,
    environment: EnvironmentFile = None,
    vary: Vary = None,
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
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside, "vary": vary}
    job = make_job(scene, find_scene(scene), camera, plan, Path(), **given)
    found, channels = facts(job.scene, job.environment, job.path_name), rows(job, measured=measure)
    if json_:
        print(json.dumps(found | {"channels": {row.name: asdict(row) for row in channels}}, indent=1))
    else:
        print_description(job.scene, found, channels)


def _list(what: str, title: str, entries: list, folder: Path, html: Path | None, json_: bool) -> None:
    from .listings import write_page

    facts = list(dict.fromkeys(key for entry in entries for key in entry.facts))
    files = [[str(path or "") if json_ else getattr(path, "name", "") for path in (e.file, e.picture)] for e in entries]
    rows = [(e.name, *(e.facts[key] for key in facts), *paths) for e, paths in zip(entries, files, strict=True)]
    if html is not None:
        write_page(title, entries, html)
    if html is None or json_:
        print_rows([what, *facts, "file", "picture"], rows, json_)
        if not json_:
            out_console.print(f"in {folder}; --html FILE makes a page of the pictures", markup=False)
    else:
        out_console.print(str(html), markup=False)
