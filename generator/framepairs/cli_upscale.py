"""The commands that bring a corpus back to high resolution: `upscale`, `roundtrip`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .cli_options import CorpusFolder, Json, Quiet
from .errors import CheckFailed, InputError
from .terminal import print_table, print_upscaled, progress


def upscale(
    corpus: CorpusFolder,
    method: Annotated[
        list[str] | None,
        typer.Option(
            help="nearest, bilinear, bicubic, lanczos, accumulate, temporal, oracle, joint_bilateral, guided, "
            "guided_temporal or guided_oracle, repeatable; all: every one; default: bicubic, accumulate and temporal"
        ),
    ] = None,
    stream: Annotated[list[str] | None, typer.Option(help="LR stream, repeatable; default: all")] = None,
    truth: Annotated[str, typer.Option(help="stream to measure against: hr, hr_mip0 or hr_native")] = "hr",
    out: Annotated[
        Path | None, typer.Option(help="write frames there (EXR, PNG, differences), and index.html, which compares them")
    ] = None,
    trajectory: Annotated[
        int | None, typer.Option(metavar="ROW", help="with --out: this pixel row of every frame, one below the other")
    ] = None,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Bring LR streams back to the display's size and measure them against the truth (display transform aces_srgb)."""
    from .corpus import Corpus
    from .manifest import make_folder
    from .upscaling.comparison import summarise
    from .upscaling.page import write_comparison
    from .upscaling.pictures import add_row, compared, write_frame, write_trajectory

    opened, entries, rows = Corpus(corpus), [], []
    if out is not None and out.resolve().is_relative_to(corpus.resolve()):
        raise InputError("lies in the corpus, which holds nothing else", file=out, field="out")
    if trajectory is not None and out is None:
        raise InputError("needs --out", field="trajectory")
    height = opened.manifest.plan.display[1]
    if trajectory is not None and not 0 <= trajectory < height:
        raise InputError(f"must be a row from 0 to {height - 1}, not {trajectory}", field="trajectory")
    chosen = {name: _pairs(opened, name, stream, method, truth) for name in opened.sequences if opened.frames(name)}
    if not chosen:
        raise InputError("holds no frames", file=corpus)
    if out is not None:
        make_folder(out)
    with progress(quiet or json_) as bar:
        task = bar.add_task("upscaling", total=sum(len(opened.frames(name)) for name in opened.sequences))
        for sequence, pairs in chosen.items():
            lines: dict[str, list] = {}

            def take(judged, *, sequence=sequence, lines=lines) -> None:
                if out is not None:
                    write_frame(opened, sequence, judged, out)
                if trajectory is not None:
                    add_row(lines, judged, trajectory)
                bar.advance(task)

            measured = summarise(opened, sequence, pairs, truth, on_frame=take)
            rows += measured
            if out is not None:
                entries.append(compared(opened, sequence, measured))
            if lines:
                write_trajectory(lines, trajectory, out / sequence / f"trajectory_{trajectory}.png")
    if out is not None:
        write_comparison(f"{corpus.resolve().name}, upscaled", entries, out / "index.html")
    if json_:
        print(json.dumps(rows, indent=1, allow_nan=False))
    elif not quiet:
        print_upscaled(rows)


def roundtrip(corpus: CorpusFolder, json_: Json = False, quiet: Quiet = False) -> None:
    """Check by upscaling what healthy data show: exit code 1 where a relation is broken."""
    from dataclasses import asdict

    from .corpus import Corpus
    from .upscaling.roundtrip import roundtrip as judge
    from .upscaling.roundtrip import scales_of

    opened = Corpus(corpus)
    with progress(quiet or json_) as bar:
        frames = sum(len(opened.frames(name)) * len(scales_of(opened, name)) for name in opened.sequences)
        task = bar.add_task("upscaling", total=frames)
        verdicts = judge(opened, on_frame=lambda: bar.advance(task))
    if json_:
        print(json.dumps([asdict(verdict) for verdict in verdicts], indent=1, allow_nan=False))
    elif not quiet:
        for sequence, scale in dict.fromkeys((v.sequence, v.scale) for v in verdicts):
            own = [v for v in verdicts if (v.sequence, v.scale) == (sequence, scale)]
            rows = [(v.id, v.verdict, v.why if v.figure is None else f"{v.figure:+.2f} dB", f"{v.needed:+.2f}") for v in own]
            print_table(f"{sequence} at {scale:g}x", ["relation", "verdict", "by", "needed"], rows)
    if all(v.verdict == "not applicable" for v in verdicts):
        raise CheckFailed(f"{corpus}: nothing could be judged")
    broken = [v for v in verdicts if v.verdict == "broken"]
    if broken:
        first = broken[0]
        where = f"{first.sequence} at {first.scale:g}x by {first.figure:+.2f} dB, {first.needed:+.2f} needed"
        names = ", ".join(dict.fromkeys(v.id for v in broken))
        raise CheckFailed(f"{corpus}: broken: {names}; {first.id} proves that {first.proves}: {where}")


def _pairs(corpus, sequence: str, streams: list[str] | None, methods: list[str] | None, truth: str) -> list[tuple[str, str]]:
    """(stream, method) of a sequence as asked for. Raises InputError for a stream or method that is not there."""
    from .upscaling.sequence import METHODS, method_named

    names = list(METHODS) if "all" in (methods or ()) else methods or ["bicubic", "accumulate", "temporal"]
    for name in names:
        method_named(name)
    there = corpus.streams(sequence)
    lr = [name for name in there if name.startswith("lr_")]
    unknown = [name for name in streams or () if name not in lr]
    if unknown or not lr:
        wanted = f"no LR stream {unknown[0]!r}" if unknown else "no LR streams"
        raise InputError(f"{wanted}; there are {', '.join(lr) or 'none'}", file=corpus.folder, field=sequence)
    if truth not in there:
        raise InputError(f"no stream {truth!r}; there are {', '.join(there)}", file=corpus.folder, field=sequence)
    return [(stream, name) for stream in dict.fromkeys(streams or lr) for name in dict.fromkeys(names)]
