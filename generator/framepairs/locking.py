"""One writer per corpus: a lock file with its owner, which dies with its owner.

A lease: the owner touches the file while it lives. A lock whose process is gone from this machine is taken over at once, one of
another machine when it was not touched for LEASE_S. Readers need no lock.
"""

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from filelock import SoftFileLease, Timeout

from .errors import InputError, MachineError
from .manifest import LOCK

LEASE_S, HEARTBEAT_S = 120.0, 15.0  # a network file system may show a file's time a minute late


@dataclass(frozen=True)
class Hold:
    """A lock that we hold. token: its name in the file. lost: set when it is ours no more."""

    token: str
    lost: threading.Event = field(default_factory=threading.Event)


@contextmanager
def corpus_lock(folder: Path) -> Iterator[Hold]:
    """Hold the corpus for writing; `folder` is made where it is missing, and goes again if nothing came into it.

    Raises MachineError that names the owner of a lock that is held, and InputError for a folder that cannot be written into.
    """
    file, lost = folder / LOCK, threading.Event()
    lease = SoftFileLease(
        file, lease_duration=LEASE_S, heartbeat_interval=HEARTBEAT_S, on_compromise=lambda _: lost.set(), thread_local=False
    )
    made = not folder.is_dir()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _acquire(lease, file)
    except Timeout:
        raise MachineError(f"{folder}: {_owner(file)} is writing this corpus") from None
    except OSError as error:
        raise InputError(f"cannot be written into: {error.strerror}", file=folder) from None
    try:
        yield Hold(_fields(file).get("token", ""), lost)
    finally:
        lease.release()
        if made and not any(folder.iterdir()):
            folder.rmdir()


def _acquire(lease: SoftFileLease, file: Path) -> None:
    """Of this machine's processes, it is known whether they live. For another's we wait: until it touches its lock, or not."""
    try:
        lease.acquire(timeout=0)
    except Timeout:
        if "host" not in _fields(file):
            _remove_ownerless(file)
            return lease.acquire(timeout=0)
        if _fields(file).get("host") == socket.gethostname():
            raise
        touched = _modified(file)
        lease.acquire(timeout=LEASE_S + HEARTBEAT_S, cancel_check=lambda: _modified(file) != touched)


def _remove_ownerless(file: Path) -> None:
    """A lock without a name is what a loss of power leaves, or is being written at this moment."""
    written = _modified(file)
    if written is not None and time.time() - written / 1e9 < LEASE_S:
        raise MachineError(f"{file}: a lock that names no owner; if nobody writes this corpus, remove it")
    file.unlink(missing_ok=True)


def _modified(file: Path) -> int | None:
    try:
        return os.stat(file).st_mtime_ns
    except OSError:
        return None


def is_held(folder: Path, token: str) -> bool:
    """Whether a corpus is still locked by the holder of `token`: who writes in its name asks before each file."""
    return _fields(folder / LOCK).get("token") == token


def _owner(file: Path) -> str:
    fields = _fields(file)
    return f"process {fields.get('pid', '?')} on {fields.get('host', 'an unknown machine')}"


def _fields(file: Path) -> dict[str, str]:
    try:
        lines = file.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    return dict(line.split("=", 1) for line in lines if "=" in line)
