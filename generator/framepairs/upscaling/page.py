"""One HTML page on which two pictures of a frame are compared with a slider: truth, LR frames and upscaled ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from ..errors import InputError
from ..manifest import make_folder, write_atomically


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One sequence, and what is shown of it.

    frames: their numbers, in order. size: (width, height) of the truth in pixels. pictures: what is shown ("truth", "lr_x2",
    "lr_x2 temporal") -> one path per frame, relative to the page, with forward slashes; the page opens with the first at the
    left and the second at the right. LR pictures keep their own, smaller size and span the same frame: the page enlarges them
    to `size`, without smoothing. figures: what is shown -> one short line ("24.1 dB  SSIM 0.81"); any may be missing.
    """

    sequence: str
    size: tuple[int, int]
    frames: tuple[int, ...]
    pictures: dict[str, tuple[str, ...]]
    figures: dict[str, str]


def write_comparison(title: str, entries: Sequence[Compared], file: Path) -> None:
    """Write the page. It holds its own style and script, and reads nothing but the pictures, which stay where they are.

    Raises InputError that names the sequence: where there are no entries, two of one name, no frames or no pictures, where
    frames and pictures differ in number, or where a figure belongs to no picture; and where the file cannot be written.
    """
    _check(entries, file)
    loader = jinja2.PackageLoader("framepairs")
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    page = environment.get_template("comparison.html.j2").render(title=title, data=[_as_json(entry) for entry in entries])
    make_folder(file.parent)
    if file.is_dir():
        raise InputError("cannot be written: it is a folder", file=file)
    write_atomically(file, page.encode())


def _check(entries: Sequence[Compared], file: Path) -> None:
    if not entries:
        raise InputError("nothing to compare: no sequence", file=file)
    names = [entry.sequence for entry in entries]
    for entry in entries:
        where = {"file": file, "field": f"sequence {entry.sequence!r}"}
        if names.count(entry.sequence) > 1:
            raise InputError("stands twice on one page", **where)
        if not entry.frames or not entry.pictures:
            raise InputError("nothing to compare: no frames or no pictures", **where)
        for shown, paths in entry.pictures.items():
            if len(paths) != len(entry.frames):
                raise InputError(f"{len(paths)} pictures of {shown!r} for {len(entry.frames)} frames", **where)
        if unknown := [shown for shown in entry.figures if shown not in entry.pictures]:
            raise InputError(f"a figure for {unknown[0]!r}, of which there are no pictures", **where)


def _as_json(entry: Compared) -> dict[str, Any]:
    """Lists rather than objects: jinja2's `tojson` sorts keys, and the order of pictures is the caller's."""
    pictures = [
        {"name": name, "figures": entry.figures.get(name, ""), "files": files} for name, files in entry.pictures.items()
    ]
    return {"name": entry.sequence, "size": entry.size, "frames": entry.frames, "pictures": pictures}
