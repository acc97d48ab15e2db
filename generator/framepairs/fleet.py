"""Rendering on many workers with dask.distributed: one range of frames per task, files straight into the shared corpus.

The client opens the corpus, holds its lock and shows progress; workers render, and write frames as one machine would. A task
that is lost with its worker is rendered elsewhere, and finds the frames that were finished. Nothing listens beyond this machine
unless a scheduler elsewhere is named, and that one must speak TLS or be allowed by word.
"""

import json
import logging
import os
import queue
import secrets
import signal
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .errors import FramepairsError, InputError, MachineError
from .job import Job
from .locking import is_held
from .manifest import LOCK
from .orders import Order, job_of
from .pipeline import Progress, Renderer, render_frames, usable_cores

LOOPBACK = "127.0.0.1"
QUIET = logging.CRITICAL  # what goes wrong comes back as an error
LOOK_S = 5.0  # between looks whether there are workers


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Who renders. scheduler: address, or file that names it; None: `workers` processes of this machine, one per GPU with CUDA,
    one per core else. tls: certificate authority, certificate and key. insecure: a scheduler elsewhere may speak no TLS.
    frames_per_task: None: four tasks per worker, at most 32 frames. retries: of a task that fails. patience_s: while there is
    no worker. sharing_s: until a worker sees the client's lock in the folder: network file systems may be that late."""

    scheduler: str | None = None
    workers: int | None = None
    tls: tuple[Path, Path, Path] | None = None
    insecure: bool = False
    frames_per_task: int | None = None
    retries: int = 2
    patience_s: float = 600.0
    sharing_s: float = 60.0


def fleet_renderer(client: Any, order: Order, fleet: Fleet) -> Renderer:
    """Renders with the workers of a client (`connected`). Its generator raises what a worker was refused for, and MachineError
    where one fails too often or does not see this corpus."""

    def render(job: Job, frames: Sequence[int], token: str) -> Iterator[Progress]:
        return _rendered(client, order, fleet, job, frames, token)

    return render


def scheduler_address(fleet: Fleet) -> str | None:
    """The address that was given or that stands in the file. Raises InputError for one beyond this machine without TLS."""
    if fleet.scheduler is None:
        return None
    address = fleet.scheduler
    if "://" not in address:
        file = Path(address)
        try:
            address = json.loads(file.read_text())["address"]
        except OSError as error:
            raise InputError(f"no address (tcp://, tls://) and no scheduler file: {error.strerror}", file=file) from None
        except (ValueError, KeyError, TypeError):
            raise InputError("is no scheduler file: it has no address", file=file) from None
    try:
        parts = urlsplit(str(address))
        scheme, host = parts.scheme, parts.hostname or ""
    except ValueError:
        scheme, host = "", ""
    if scheme not in ("tcp", "tls", "ucx", "ws", "wss") or not host:
        raise InputError(f"must look like tls://host:8786, not {address!r}", field="scheduler")
    here = host in ("localhost", "::1") or host.startswith("127.")
    if scheme not in ("tls", "wss") and not here and not fleet.insecure:
        raise InputError(f"{address} is another machine without TLS: whoever reaches it runs code; use tls:// with "
                         "--tls, or allow it with --insecure", field="scheduler")  # fmt: skip
    return address


@contextmanager
def connected(fleet: Fleet, variant: str) -> Iterator[Any]:
    """A client of the fleet's scheduler, with its own cluster where none is named. variant: of Mitsuba, that renders.

    Raises InputError for an address that is refused, MachineError where no worker comes or dask is not installed.
    """
    address = scheduler_address(fleet)
    try:
        from distributed import Client, Security
    except ImportError:
        raise MachineError("dask is not installed: pip install 'framepairs[dask]'") from None
    security = None
    if fleet.tls is not None:
        names = dict(zip(("tls_ca_file", "tls_client_cert", "tls_client_key"), map(str, fleet.tls), strict=True))
        security = Security(require_encryption=True, **names)
    with ExitStack() as stack:
        try:
            if address is None:
                address = stack.enter_context(_own_cluster(fleet, variant)).scheduler_address
            patience = min(30, fleet.patience_s)
            client = stack.enter_context(Client(address, security=security, timeout=patience, set_as_default=False))
            client.wait_for_workers(1, timeout=fleet.patience_s)
        except TimeoutError:
            raise MachineError(f"no worker came to {address} within {fleet.patience_s:g} s") from None
        except (OSError, ValueError, TypeError) as error:
            raise MachineError(f"cannot reach the scheduler at {address}: {error}") from None
        yield client


@contextmanager
def _own_cluster(fleet: Fleet, variant: str) -> Iterator[Any]:
    """Scheduler and workers of this machine. Ctrl-C is the client's: workers never see it, and end at once when it leaves."""
    from distributed import SpecCluster

    interrupts_of = {signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, interrupts_of)  # what starts now inherits it
    try:
        cluster = SpecCluster(**_specification(fleet, variant), silence_logs=QUIET)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, interrupts_of)
    with cluster:
        try:
            yield cluster
        except BaseException:
            for nanny in cluster.workers.values():
                nanny.auto_restart = False
                if nanny.pid is not None:
                    os.kill(nanny.pid, signal.SIGKILL)
            raise


def _specification(fleet: Fleet, variant: str) -> dict[str, Any]:
    """On loopback alone: HTTP servers listen everywhere unless they are told."""
    from distributed import Nanny, Scheduler

    alone = {"host": LOOPBACK, "dashboard": False, "dashboard_address": f"{LOOPBACK}:0"}
    gpus = _gpus() if variant.startswith("cuda") else []
    count = fleet.workers or len(gpus) or usable_cores()
    options = alone | {"nthreads": 1 if not gpus else max(usable_cores() // count, 1), "memory_limit": 0, "silence_logs": QUIET}
    workers = {}
    for index in range(count):
        environment = {"CUDA_VISIBLE_DEVICES": gpus[index % len(gpus)]} if gpus else {}
        workers[index] = {"cls": Nanny, "options": options | {"env": environment}}
    return {"scheduler": {"cls": Scheduler, "options": alone | {"port": 0}}, "workers": workers}


def _gpus() -> list[str]:
    """What CUDA_VISIBLE_DEVICES would call this machine's GPUs."""
    named = os.environ.get("CUDA_VISIBLE_DEVICES")
    if named is not None:
        return [name for name in named.split(",") if name]
    return [file.name.removeprefix("nvidia") for file in sorted(Path("/dev").glob("nvidia[0-9]*"))]


def _rendered(client, order: Order, fleet: Fleet, job: Job, frames: Sequence[int], token: str) -> Iterator[Progress]:
    topic, steps = f"framepairs-{secrets.token_hex(8)}", queue.SimpleQueue()
    workers = max(len(client.scheduler_info()["workers"]), 1)
    size = fleet.frames_per_task or min(32, max(1, len(frames) // (4 * workers)))
    ranges = [list(frames[first : first + size]) for first in range(0, len(frames), size)]
    client.subscribe_topic(topic, lambda event: steps.put(event[1]))
    submit = partial(client.submit, _render_range, order, pure=False, retries=fleet.retries)
    futures = [submit(part, token, fleet.sharing_s, topic, key=f"frames-{part[0]}-{topic}") for part in ranges]
    for future in futures:
        future.add_done_callback(steps.put)
    left, seen = len(futures), set()
    try:
        while left:
            item = _next(steps, client, fleet)
            finished = [item] if isinstance(item, dict) else _result(item)
            left -= not isinstance(item, dict)
            for values in finished:
                step = Progress(**values)
                if step.frame in seen:
                    continue  # told twice, or rendered again after its worker was lost
                seen.add(step.frame)
                yield step
    finally:
        client.cancel(futures)
        client.unsubscribe_topic(topic)


def _next(steps: queue.SimpleQueue, client, fleet: Fleet) -> Any:
    """What is told next. Raises MachineError where nobody is there any more to tell it."""
    alone_since = time.monotonic()
    while True:
        try:
            return steps.get(timeout=LOOK_S)
        except queue.Empty:
            if client.scheduler_info()["workers"]:
                alone_since = time.monotonic()
            if time.monotonic() - alone_since > fleet.patience_s:
                raise MachineError(f"no worker has been there for {fleet.patience_s:g} s") from None


def _result(future) -> list[dict]:
    """What a task did. Raises what it was refused for, or MachineError."""
    if future.cancelled():
        raise MachineError("lost the scheduler")
    error = future.exception()
    if error is None:
        value = future.result()
        if isinstance(value, FramepairsError):
            raise value
        return value
    if isinstance(error, FramepairsError):
        raise error
    raise MachineError(f"a worker failed: {type(error).__name__}: {' '.join(str(error).split())[:300]}") from error


# ---- on a worker ----


@lru_cache(1)
def _renderer() -> ThreadPoolExecutor:
    """The one thread of this process that renders: variant and flags of Dr.Jit belong to a thread, and its kernels use all."""
    return ThreadPoolExecutor(1)


_last: list[tuple[Order, Job, list]] = []  # order, its job, and its engine, in `_renderer`'s thread


def _render_range(order: Order, frames: list[int], token: str, sharing_s: float, topic: str) -> list[dict] | FramepairsError:
    """Task: the frames of a range, told one by one under `topic`. Bad input comes back as a value, which is not tried again."""
    from distributed import get_worker

    worker = get_worker()

    def run() -> list[dict]:
        _see_lock(order.out, token, sharing_s, worker.address)
        job, engines = _prepared(order, worker.state.nthreads)
        told = []
        for step in render_frames(job, frames, token, engines=engines, writers=worker.state.nthreads):
            told.append(vars(replace(step, worker=worker.address, profile=None)))
            worker.log_event(topic, told[-1])
        return told

    try:
        return _renderer().submit(run).result()
    except InputError as error:
        return error


def _see_lock(folder: Path, token: str, patience_s: float, worker: str) -> None:
    """Raises MachineError where the folder is not the one that the client holds, or the client has gone."""
    start = time.monotonic()
    while not is_held(folder, token):
        if (folder / LOCK).is_file() or time.monotonic() - start > patience_s:
            problem = "the client's lock is not there: it has gone, or --out is not a folder that all machines share"
            raise MachineError(f"{folder} on {worker}: {problem}")
        if folder.is_dir():
            os.listdir(folder)  # makes a network file system look again
        time.sleep(0.2)


def _prepared(order: Order, threads: int) -> tuple[Job, list]:
    """The job, and a list for its engine: those of the order before where the scene is the same."""
    if not _last or _last[0][0] != order:
        before = _last.pop() if _last else None
        job = job_of(order, before[:2] if before else None)
        same_scene = before is not None and job.scene is before[1].scene
        _last.append((order, job, before[2] if same_scene else []))
        from .backend import dr

        dr.set_thread_count(threads)
    return _last[0][1:]
