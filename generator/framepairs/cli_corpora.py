"""The commands that read a corpus: `validate`, `warp`, `preview`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .bundled import find_scene
from .cli_options import AllowOutside, CorpusFolder, Json, Quiet
from .errors import CheckFailed, InputError
from .terminal import print_table, progress


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


def preview(
    target: Annotated[str, typer.Argument(metavar="CORPUS|SCENE", help="folder of a corpus; with --compare, a scene")],
    compare: Annotated[tuple[str, str] | None, typer.Option(help="two shading modes, as: raster path")] = None,
    display: Annotated[str | None, typer.Option(help="size, as 640x360 (--compare)")] = None,
    frames: Annotated[str | None, typer.Option(help="first:end (--compare); default: first, middle and last")] = None,
    spp: Annotated[int | None, typer.Option(help="light paths per pixel (--compare)")] = None,
    camera: Annotated[str | None, typer.Option(help="bundled name or JSON file (--compare)")] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", help="key=value of the plan, repeatable (--compare)")] = None,
    allow_outside: AllowOutside = False,
    out: Annotated[Path | None, typer.Option(help="folder; default: CORPUS-preview beside the corpus")] = None,
    quiet: Quiet = False,
) -> None:
    """Write PNG contact sheets of a corpus (every channel, every stream), or a scene in two shading modes side by side."""
    from .corpus import Corpus
    from .manifest import make_folder
    from .preview import write_previews

    if compare is not None:
        values = {"display": display or "640x360", "spp": spp, "settings": settings}
        _compare(target, camera, compare, frames, values, allow_outside, out or Path(f"{Path(target).stem}-preview"), quiet)
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


def _compare(
    target: str, camera, modes: tuple[str, str], frames, values: dict, allow_outside: bool, out: Path, quiet: bool
) -> None:
    from .comparison import compare_modes, write_comparison
    from .frame import Shoot
    from .options import camera_path_of, frame_range, plan_options, read_scene
    from .plan import make_plan
    from .scene import light_scene

    plan = make_plan(plan_options(**values), file="options")
    for mode in modes:
        make_plan({"shading": mode}, file="compare")
    scene, _ = light_scene(read_scene(find_scene(target), None, plan, allow_outside), None)
    path, _ = camera_path_of(target, camera, scene)
    count = len(Shoot(scene, path, 1.0))
    chosen = sorted({0, count // 2, count - 1}) if frames is None else list(frame_range(frames, count))
    compared = compare_modes(scene, path, plan, modes, chosen)
    file = write_comparison(compared, modes, out / f"{scene.name}_{modes[0]}_{modes[1]}.png")
    if not quiet:
        rows = [(item.frame, f"{item.psnr:.2f}", f"{item.mean_ratio:.3f}") for item in compared]
        print_table(f"{modes[1]} against {modes[0]}", ["frame", "PSNR", "mean radiance ratio"], rows)
        print(file)
