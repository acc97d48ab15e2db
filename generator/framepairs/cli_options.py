"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from .errors import InputError

Json = Annotated[bool, typer.Option("--json", help="print JSON for machines")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="no progress, no summary")]
Backend = Annotated[str, typer.Option(help="auto, llvm or cuda")]
Clip = Annotated[str | None, typer.Option(help="animation clip of a glTF file; default: the first")]
EnvironmentFile = Annotated[Path | None, typer.Option(help="latitude-longitude image that lights the scene")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="any key of the plan, as key=value, repeatable")]
Vary = Annotated[
    int | None, typer.Option("--vary", min=0, max=2**63 - 1, help="seed of the content: light, colours, places; not the camera")
]
AllowOutside = Annotated[bool, typer.Option("--allow-outside", help="the scene may read files outside its own folder")]
CorpusFolder = Annotated[Path, typer.Argument(metavar="CORPUS", help="folder of a corpus")]


def activate_backend(backend: str) -> None:
    """Raises InputError for an unknown back end, MachineError for one that this machine has not."""
    if backend not in ("auto", "llvm", "cuda"):
        raise InputError(f"must be auto, llvm or cuda, not {backend!r}", field="backend")
    from .backend import activate

    activate(backend)
