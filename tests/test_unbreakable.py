"""Whatever ends a render, the next one goes on, and the corpus is the one that an undisturbed render writes.

FRAMEPAIRS_KILLS: how often the long test kills (default 4).
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from test_pipeline import contents

KILLS = int(os.environ.get("FRAMEPAIRS_KILLS", "4"))
FRAMES = 60
OBJ = "mtllib quad.mtl\nusemtl wall\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
OBJ += "f 1/1 2/2 3/3 4/4\n"
MTL = "newmtl wall\nmap_Kd wall.png\n"
SLOW = ("--display", "320x180", "--aa", "16", "--scale", "2", "--streams", "native,jittered_mip")


def flight() -> dict:
    ends = [{"time": t, "position": [x, 0.2, 3], "look_at": [0, 0, 0]} for t, x in ((0, -1), ((FRAMES - 1) / 24, 1))]
    return {"version": 1, "fps": 24, "keyframes": ends}


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    return write_scene(tmp_path_factory.mktemp("files"))


def write_scene(folder: Path) -> Path:
    """A textured quad and a path along it, as files; gives the folder."""
    (folder / "quad.obj").write_text(OBJ)
    (folder / "quad.mtl").write_text(MTL)
    (folder / "flight.json").write_text(json.dumps(flight()))
    rows, columns = np.indices((64, 64))
    Image.fromarray(np.where((rows // 8 + columns // 8) % 2, 230, 40).astype(np.uint8)).save(folder / "wall.png")
    return folder


def started(files: Path, out: Path, *arguments, own_group: bool = False) -> subprocess.Popen:
    command = [sys.executable, "-m", "framepairs.cli", "render", str(files / "quad.obj")]
    command += ["--camera", str(files / "flight.json"), *SLOW, "--out", str(out), "--json", *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, **pipes, text=True, start_new_session=own_group)


def finished(files: Path, out: Path, *arguments) -> dict:
    child = started(files, out, *arguments)
    said, errors = child.communicate(timeout=300)
    assert child.returncode == 0, errors
    return json.loads(said)


def wait_for_frames(child: subprocess.Popen, out: Path, count: int = 1) -> None:
    """Until so many frames are whole."""
    end = time.monotonic() + 120
    while len(list(out.glob("*/frames/[0-9]*.json"))) < count:
        assert child.poll() is None and time.monotonic() < end, child.communicate()
        time.sleep(0.01)


@pytest.fixture(scope="module")
def reference(files, tmp_path_factory) -> dict[str, str]:
    out = tmp_path_factory.mktemp("undisturbed") / "corpus"
    assert finished(files, out)["rendered"] == FRAMES
    return contents(out)


def test_random_kills_leave_no_trace(files, reference, tmp_path):
    """Each kill comes at a random time of a render; what it left behind is read by the next one."""
    out, kills, times = tmp_path / "corpus", 0, random.Random(7)
    while kills < KILLS:
        child = started(files, out)
        try:
            while child.poll() is None and not (out / ".lock").is_file():
                time.sleep(0.005)
            child.wait(timeout=times.uniform(0, 3))
            assert child.returncode == 0, child.communicate()
            assert contents(out) == reference  # it came to its end before
            shutil.rmtree(out)
        except subprocess.TimeoutExpired:
            child.send_signal(signal.SIGKILL)
            kills += 1
        child.communicate()
    finished(files, out)
    assert contents(out) == reference


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_is_one_line_exit_130_and_goes_on(files, reference, tmp_path, sent):
    out = tmp_path / "corpus"
    child = started(files, out)
    wait_for_frames(child, out, 3)
    child.send_signal(sent)
    errors = child.communicate(timeout=30)[1]
    assert child.returncode == 130
    assert [line for line in errors.splitlines() if line.strip()] == ["framepairs: interrupted; type the same command again"]
    assert not (out / ".lock").exists() and not list(out.rglob("*.part"))
    again = finished(files, out)
    assert 0 < again["rendered"] <= FRAMES - 3
    assert contents(out) == reference


def test_an_interrupt_of_a_fleet_ends_its_workers(files, reference, tmp_path):
    """Ctrl-C reaches all processes of a terminal; workers do not mind, and end with their client."""
    import psutil

    out = tmp_path / "corpus"
    child = started(files, out, "--engine", "dask", "--workers", 2, own_group=True)
    wait_for_frames(child, out, 2)
    workers = psutil.Process(child.pid).children(recursive=True)
    assert len(workers) >= 2
    os.killpg(child.pid, signal.SIGINT)
    errors = child.communicate(timeout=30)[1]
    assert child.returncode == 130
    assert [line for line in errors.splitlines() if line.strip()] == ["framepairs: interrupted; type the same command again"]
    assert not psutil.wait_procs(workers, timeout=10)[1] and not (out / ".lock").exists()
    assert 0 < finished(files, out)["rendered"] < FRAMES
    assert contents(out) == reference


def test_two_processes_do_not_write_one_corpus(files, reference, tmp_path):
    out = tmp_path / "corpus"
    first = started(files, out)
    wait_for_frames(first, out)
    second = started(files, out)
    errors = second.communicate(timeout=60)[1]
    assert second.returncode == 1 and f"process {first.pid} on " in errors and "is writing this corpus" in errors
    errors = first.communicate(timeout=300)[1]
    assert first.returncode == 0, errors
    assert contents(out) == reference


def test_a_texture_that_vanishes_is_named_by_whoever_reads_it_next(files, reference, tmp_path):
    """This process has read it; a renewed child has not."""
    shutil.copytree(files, tmp_path / "here")
    out = tmp_path / "corpus"
    child = started(tmp_path / "here", out, "--renew-every", 20)
    wait_for_frames(child, out, 3)
    (tmp_path / "here" / "wall.png").rename(tmp_path / "away.png")
    errors = child.communicate(timeout=120)[1]
    assert child.returncode == 2 and "wall.png" in errors and len(errors.strip().splitlines()) == 1
    assert len(list(out.glob("*/frames/*.json"))) == 20
    (tmp_path / "away.png").rename(tmp_path / "here" / "wall.png")
    assert finished(tmp_path / "here", out, "--renew-every", 25)["rendered"] == FRAMES - 20
    here = {name: value for name, value in contents(out).items() if name.endswith(".exr")}
    assert here == {name: value for name, value in reference.items() if name.endswith(".exr")}


def test_a_child_that_is_killed_is_named(files, tmp_path):
    """As the kernel does where memory ends."""
    import psutil

    out = tmp_path / "corpus"
    child = started(files, out, "--renew-every", 40)
    wait_for_frames(child, out, 2)
    renderers = [p for p in psutil.Process(child.pid).children() if "resource_tracker" not in " ".join(p.cmdline())]
    assert len(renderers) == 1
    renderers[0].kill()
    errors = child.communicate(timeout=60)[1]
    assert child.returncode == 1 and "the process that rendered frames 0 to 39 ended by signal 9" in errors
    assert not (out / ".lock").exists()
