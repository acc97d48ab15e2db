"""One writer per corpus, and no lock that outlives its owner."""

import os
import signal
import subprocess
import sys
import time

import pytest

from framepairs import locking
from framepairs.errors import FramepairsError, InputError, MachineError
from framepairs.locking import corpus_lock, is_held

HOLDER = """
import sys, time
from pathlib import Path
from framepairs.locking import corpus_lock, is_held
with corpus_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture()
def holder(tmp_path):
    """Another process that holds the lock of tmp_path / 'corpus'."""
    child = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path / "corpus")], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "held\n"
    yield child
    child.kill()
    child.wait()


def foreign_lock(folder, **changes):
    fields = {"pid": 1, "host": "elsewhere", "mode": "lease", "token": "0" * 32, "duration": locking.LEASE_S, "start": 1}
    fields |= changes
    folder.mkdir()
    (folder / ".lock").write_text("filelock/2\n" + "".join(f"{key}={value}\n" for key, value in fields.items()))


def test_a_lock_leaves_nothing_behind(tmp_path):
    with corpus_lock(tmp_path / "a" / "corpus"):
        assert (tmp_path / "a" / "corpus" / ".lock").is_file()
    assert not (tmp_path / "a" / "corpus").exists()
    (tmp_path / "there").mkdir()
    with corpus_lock(tmp_path / "there"):
        pass
    assert list((tmp_path / "there").iterdir()) == []


def test_a_second_writer_is_refused_and_told_who_the_first_is(tmp_path, holder):
    says = f"corpus: process {holder.pid} on .* is writing this corpus"
    with pytest.raises(MachineError, match=says), corpus_lock(tmp_path / "corpus"):
        pass
    assert holder.poll() is None and (tmp_path / "corpus" / ".lock").is_file()


def test_the_lock_of_a_killed_process_is_taken_over_at_once(tmp_path, holder):
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    start = time.monotonic()
    with corpus_lock(tmp_path / "corpus") as hold:
        assert not hold.lost.is_set() and is_held(tmp_path / "corpus", hold.token)
    assert time.monotonic() - start < locking.LEASE_S / 4


def test_a_lock_of_another_machine_that_is_touched_is_alive(tmp_path, monkeypatch):
    import threading

    foreign_lock(tmp_path / "corpus")
    touch = threading.Timer(0.5, os.utime, [tmp_path / "corpus" / ".lock"])
    touch.start()
    with pytest.raises(MachineError, match="process 1 on elsewhere is writing"), corpus_lock(tmp_path / "corpus"):
        pass
    touch.join()
    assert (tmp_path / "corpus" / ".lock").is_file()


def test_a_lock_of_another_machine_that_nobody_touches_is_taken_over(tmp_path, monkeypatch):
    monkeypatch.setattr(locking, "LEASE_S", 1.5)
    monkeypatch.setattr(locking, "HEARTBEAT_S", 0.5)
    foreign_lock(tmp_path / "corpus", duration=1.5)
    with corpus_lock(tmp_path / "corpus"):
        assert "host=elsewhere" not in (tmp_path / "corpus" / ".lock").read_text()


def test_a_lock_without_a_name_is_refused_while_it_is_young(tmp_path):
    """A loss of power leaves it, or another process writes its name this moment."""
    (tmp_path / "corpus").mkdir()
    (tmp_path / "corpus" / ".lock").touch()
    with pytest.raises(MachineError, match=r"\.lock: a lock that names no owner"), corpus_lock(tmp_path / "corpus"):
        pass
    old = time.time() - 2 * locking.LEASE_S
    os.utime(tmp_path / "corpus" / ".lock", (old, old))
    with corpus_lock(tmp_path / "corpus"):
        pass


def test_a_lock_that_was_lost_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(locking, "LEASE_S", 1.5)
    monkeypatch.setattr(locking, "HEARTBEAT_S", 0.2)
    with corpus_lock(tmp_path / "corpus") as hold:
        (tmp_path / "corpus" / ".lock").unlink()
        assert hold.lost.wait(5) and not is_held(tmp_path / "corpus", hold.token)


def test_a_folder_that_cannot_be_made_is_bad_input(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written into"), corpus_lock(tmp_path / "file" / "corpus"):
        pass


def test_an_error_inside_releases_it(tmp_path):
    with pytest.raises(FramepairsError), corpus_lock(tmp_path / "corpus"):
        raise FramepairsError("broken")
    assert not (tmp_path / "corpus").exists()
