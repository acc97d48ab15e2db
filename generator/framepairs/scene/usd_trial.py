"""A trial of stages with binary layers, in a process of its own.

usd-core ends the process on some damaged ones, now and then, and nothing in Python can catch that.
"""

import json
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

from ..errors import InputError
from .containment import Reach

LONGEST_S = 60
REFUSED = 3  # exit code
CODE = f"""import json, sys
from pathlib import Path
from framepairs.errors import InputError
from framepairs.scene.containment import Reach
from framepairs.scene.usd_dependencies import open_layers

try:
    open_layers(Path(sys.argv[1]), Reach(Path(sys.argv[2]), sys.argv[3] == "True"), tried=True)
except InputError as error:
    print(json.dumps([error.problem, str(error.file) if error.file else None, error.field]))
    sys.exit({REFUSED})
"""


def try_stage(file: Path, reach: Reach) -> None:
    """Raises InputError where opening the layers of the stage in `file` is refused, ends a process, or takes it longer than a
    minute. Half a second, once for each state of the file."""
    state = file.stat()
    told = _tried(file, reach, state.st_mtime_ns, state.st_size)
    if told is not None:
        problem, where, field = told
        raise InputError(problem, file=where or file, field=field)


@lru_cache(maxsize=64)
def _tried(file: Path, reach: Reach, changed_ns: int, size: int) -> tuple[str, str | None, str | None] | None:
    """(problem, file, field), or None where all is well."""
    command = [sys.executable, "-c", CODE, str(file), str(reach.folder), str(reach.outside)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return f"not a USD stage: opening it takes longer than {LONGEST_S} s", None, None
    if done.returncode == REFUSED:
        return tuple(json.loads(done.stdout.splitlines()[-1]))
    broke_down = "not a USD stage: it is damaged, and USD's reader breaks down on it", None, None
    return broke_down if done.returncode != 0 else None
