"""The command `framepairs`: parses options, makes one library call, prints. Exit codes: 0 done, 1 a check failed or the
machine cannot, 2 bad input, 130 interrupted."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from . import __version__, cli_corpora, cli_render, cli_scenes, cli_upscale, interrupts
from .cli_options import Json
from .errors import FramepairsError, InputError, MachineError
from .terminal import error_console, print_table

app = typer.Typer(no_args_is_help=True, add_completion=True, pretty_exceptions_enable=False, help=__doc__)


for command in (cli_render.render, cli_render.regenerate, cli_scenes.scenes, cli_scenes.describe):
    app.command()(command)
app.add_typer(cli_scenes.cameras, name="cameras")
for command in (cli_corpora.validate, cli_corpora.warp, cli_corpora.preview, cli_upscale.upscale, cli_upscale.roundtrip):
    app.command()(command)


def main() -> None:
    """Run the command line; our own errors become one line and an exit code. SIGTERM is taken as Ctrl-C is."""
    interrupts.listen()
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
    interrupts.ignore()
    error_console.print("framepairs: interrupted; type the same command again")
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


if __name__ == "__main__":
    main()
