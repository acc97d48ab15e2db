"""Every error that framepairs raises on purpose.

FramepairsError
├── InputError     what came in is wrong: a file, a key, an option (exit code 2)
├── MachineError   this machine cannot do it: no back end, no space, no permission (exit code 1)
└── CheckFailed    the work was done and the answer is no (exit code 1)

The text of each is one line; the command line prints it as it stands.
"""

from pathlib import Path


class FramepairsError(Exception):
    """Base of all errors raised on purpose; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(FramepairsError):
    """Bad input. `file`, `frame` and `field` say where it stands."""

    exit_code = 2

    def __init__(
        self, problem: str, *, file: str | Path | None = None, frame: int | None = None, field: str | None = None
    ):
        self.problem, self.file, self.frame, self.field = problem, file, frame, field
        places = [
            str(file) if file is not None else None,
            f"frame {frame}" if frame is not None else None,
            field,
        ]
        where = ", ".join(place for place in places if place)
        super().__init__(" ".join((f"{where}: {problem}" if where else problem).split()))


class MachineError(FramepairsError):
    """The machine lacks something: the text says what to install, free or allow."""


class CheckFailed(FramepairsError):
    """A check was carried out and failed."""
