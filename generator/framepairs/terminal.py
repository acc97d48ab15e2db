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


def print_upscaled(sequence: str, rows: list[dict]) -> None:
    """One line per stream and method; the parts of `summarise` side by side."""
    parts = {(row["stream"], row["method"], row["part"]): row for row in rows}
    table = []
    for stream, method in dict.fromkeys((row["stream"], row["method"]) for row in rows):
        whole, *still = (parts.get((stream, method, part)) for part in ("all", "still", "still, end"))
        stills = ["" if part is None else f"{part['psnr']:.2f}" for part in still]
        table.append([stream, method, f"{whole['psnr']:.2f}", f"{whole['ssim']:.3f}", *stills, f"{whole['ms']:.1f}"])
    columns = ["stream", "method", "PSNR", "SSIM", "still", "last still", "ms"]
    print_table(f"{sequence}: PSNR in dB and SSIM on aces_srgb, means over frames", columns, table)


def constant_text(need) -> str:
    if need.same_as:
        return f"same as {need.same_as}"
    return "constant " + " ".join(f"{value:.4g}" for value in need.constant)


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
