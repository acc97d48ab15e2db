"""A short run of `fuzz_importers.py` for each format, in a process of its own that a crash would end."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz_importers import FORMATS, MOST_BYTES

FUZZER = Path(__file__).parent / "fuzz_importers.py"


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files_are_one_error_or_load(kind):
    done = subprocess.run(
        [sys.executable, str(FUZZER), kind, "--examples", "40"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["tried"] == 40 and 0 < told["loaded"] < 40  # neither harmless changes alone nor hopeless ones
    assert told["peak_mib"] < MOST_BYTES / 2**20
