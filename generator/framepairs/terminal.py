"""What the command line prints: tables, progress, one line per thing."""

import json
from collections.abc import Iterable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

out_console, error_console = Console(highlight=False), Console(stderr=True, highlight=False)


def progress(silent: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=error_console, transient=True, disable=silent)


def print_upscaled(rows: list[dict]) -> None:
    """A table per sequence and stream: what `upscaling.comparison.summarise` gives."""
    digits = {"psnr": 2, "ssim": 3, "flip": 3, "tpsnr": 2, "warp_error": 2, "static_std": 2, "ms": 1}
    for sequence, stream in dict.fromkeys((row["sequence"], row["stream"]) for row in rows):
        own = [row for row in rows if (row["sequence"], row["stream"]) == (sequence, stream)]
        figures = [["" if row[key] is None else f"{row[key]:.{n}f}" for key, n in digits.items()] for row in own]
        table = [[row["method"], *line] for row, line in zip(own, figures, strict=True)]
        columns = ["method", "PSNR", "SSIM", "FLIP", "tPSNR", "warp error", "still std", "ms"]
        print_table(f"{sequence} {stream}", columns, table)
    out_console.print("means over frames on aces_srgb; PSNR in dB, warp error and still std in codes of 255")


def print_description(scene, found: dict, channels: list) -> None:
    """What `scene_report` found: facts, a line per channel, and what is not read."""
    shown = {key: ", ".join(value) if isinstance(value, list) else value for key, value in found.items() if key != "not read"}
    print_table(scene.name, ["", ""], shown.items())
    values = ["needed" if row.needed else row.value for row in channels]
    savings = [_saving_text(row.bytes, row.milliseconds) for row in channels]
    rows = [(row.name, value, row.why, *saved) for row, value, saved in zip(channels, values, savings, strict=True)]
    print_table("channels", ["channel", "as", "why", "MB saved", "ms saved"], rows)
    for line in found["not read"]:
        out_console.print(f"not read: {line}", markup=False)
    out_console.print("F_beta may exceed 1 at grazing angles: Lambert plus specular does not conserve energy")
    materials = [scene.materials[item.material] for item in scene.objects]
    glowing = sum(any(material.emission) and not material.shines for material in materials)
    if glowing:
        out_console.print(f"{glowing} objects glow; in raster they light others with --set mesh_lights=true")
    if found["single-sided objects"]:
        out_console.print("single-sided objects are drawn from both sides; --set cull_back_faces=true leaves their backs out")


def print_profile(profiles: dict[int, dict]) -> None:
    """A line per frame: seconds by stage, and kernels."""
    columns = list(next(iter(profiles.values())))
    rows = [(frame, *(f"{v:.3f}" if isinstance(v, float) else "" if v is None else v for v in values.values()))
            for frame, values in profiles.items()]  # fmt: skip
    print_table("seconds by stage (encode, write: summed over threads), and kernels", ["frame", *columns], rows)


def _saving_text(size: int | None, milliseconds: float | None) -> tuple[str, str]:
    if size is None:
        return "?", "?"
    return (f"{size / 1e6:.3f}" if size else "", f"{milliseconds:.1f}" if milliseconds else "")


def print_rows(columns: list[str], rows: list[tuple], json_: bool) -> None:
    if json_:
        print(json.dumps([dict(zip(columns, row, strict=True)) for row in rows], indent=1))
    else:
        print_table("", columns, rows)


def print_table(title: str, columns: list[str], rows: Iterable[Iterable]) -> None:
    table = Table(*columns, title=title or None, title_justify="left", show_header=any(columns))
    for row in rows:
        table.add_row(*(str(value) for value in row))
    out_console.print(table, markup=False)
