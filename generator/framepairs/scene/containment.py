"""Which files a scene may read: a scene is data from anywhere, so it reaches no further than its own folder."""

import stat
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError


@dataclass(frozen=True)
class Reach:
    """folder: the one that the scene file lies in. outside: whether files elsewhere may be read, too (`--allow-outside`)."""

    folder: Path
    outside: bool = False


def reach_of(file: Path, allow_outside: bool = False) -> Reach:
    """What the scene in `file` may read."""
    return Reach(file.parent.resolve(), allow_outside)


def within(reach: Reach, named: str | Path, *, file: Path | None = None, field: str | None = None) -> Path:
    """The file that a scene names, relative to its folder or absolute, with all links followed.

    It may not exist: reading it tells. Raises InputError naming `file` and `field` for a path that leaves the folder, by
    `..`, as an absolute one or by a link, unless that is allowed, and for what is no plain file (devices, pipes, folders).
    """
    try:
        found = (reach.folder / named).resolve()
        mode = found.stat().st_mode if found.exists() else stat.S_IFREG
    except (OSError, ValueError, RuntimeError) as error:  # names that no file can have, loops of links
        raise InputError(f"cannot name a file: {str(named)[:200]!r} ({error})", file=file, field=field) from None
    if not reach.outside and not found.is_relative_to(reach.folder):
        problem = f"{str(named)[:200]} lies outside the scene's folder (--allow-outside reads it)"
        raise InputError(problem, file=file, field=field)
    if not stat.S_ISREG(mode):
        raise InputError(f"{str(named)[:200]} is no plain file", file=file, field=field)
    return found
