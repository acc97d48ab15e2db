"""The benchmarks' memory: what each of them found, when, at which commit, on which machine.

    python tests/benchmarks/history.py [BENCH ...]     prints the records, oldest first

Ratios of two costs within one run compare between machines; facts (seconds, bytes, sizes) say what they were measured on. The
file is tests/benchmarks/history.jsonl, one JSON object per line, or what FRAMEPAIRS_BENCH_HISTORY names.
"""

import datetime
import math
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

from pydantic import BaseModel, ConfigDict, FiniteFloat, JsonValue

ROOT = Path(__file__).parents[2]
FILE = Path(__file__).with_name("history.jsonl")
MEASURED = ("generator", "tests", "scenes", "camera_paths", "pyproject.toml")


class Record(BaseModel):
    """One run of one benchmark. commit: with "+" where what is measured differs from it; None without Git. date: ISO day."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    bench: str
    date: str
    commit: str | None
    machine: str
    ratios: dict[str, FiniteFloat]
    facts: dict[str, JsonValue] = {}


def record(bench: str, ratios: dict[str, float], **facts: JsonValue) -> Record:
    """Append what `bench` found to the history. Numbers keep four digits. Raises ValueError for one that is not finite."""
    now = datetime.datetime.now(datetime.UTC).date().isoformat()
    kept = {name: _rounded(value) for name, value in ratios.items()}
    made = Record(bench=bench, date=now, commit=commit(), machine=machine(), ratios=kept, facts=_rounded(facts))
    with open(history_file(), "a") as file:
        file.write(made.model_dump_json() + "\n")
    return made


def print_ratios(ratios: dict[str, float]) -> None:
    for name, value in ratios.items():
        print(f"{value:9.3g} x  {name}")


def read_history() -> list[Record]:
    """All records, oldest first. Raises pydantic's ValidationError for a line that is none."""
    file = history_file()
    return [Record.model_validate_json(line) for line in file.read_text().splitlines() if line] if file.is_file() else []


def history_file() -> Path:
    return Path(os.environ.get("FRAMEPAIRS_BENCH_HISTORY") or FILE)


def commit() -> str | None:
    """Of the checkout that holds this file; the history itself does not count as a change."""
    if not (ROOT / ".git").exists():
        return None
    changes = _output("git", "status", "--porcelain", "--", *MEASURED, f":(exclude){FILE.relative_to(ROOT)}")
    found = _output("git", "rev-parse", "HEAD")
    return found + ("+" if changes else "") if found else None


def machine() -> str:
    """Processor, logical cores, and the GPU where Dr.Jit computes on one."""
    try:
        model = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        model = None
    parts = [model[1].strip() if model else platform.processor() or platform.machine(), f"{os.cpu_count()} logical cores"]
    mitsuba = sys.modules.get("mitsuba")
    if mitsuba is not None and (mitsuba.variant() or "").startswith("cuda"):
        names = _output("nvidia-smi", "--query-gpu=name", "--format=csv,noheader")
        parts.append(names.splitlines()[0] if names else "a GPU")
    return ", ".join(parts)


def _output(*command: str) -> str | None:
    """What a command prints, without the line's end; None where it is missing or fails."""
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _rounded(value):
    """The same with four digits in every float."""
    if isinstance(value, dict):
        return {name: _rounded(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    if isinstance(value, str | int | None):
        return value
    if not math.isfinite(value):
        raise ValueError(f"not a finite number: {value}")
    return float(f"{float(value):.4g}")


def main() -> None:
    for item in read_history():
        if not sys.argv[1:] or item.bench in sys.argv[1:]:
            short = re.sub(r"^(.{10})[^+]*", r"\1", item.commit or "no commit")
            print(f"{item.bench}  {item.date}  {short}  {item.machine}")
            print_ratios(item.ratios)


if __name__ == "__main__":
    main()
