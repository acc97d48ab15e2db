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
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .errors import FramepairsError, InputError, MachineError
from .job import Job
from .orders import Order, job_of
from .pipeline import Progress, Renderer, render_frames, usable_cores
from .resume import record_file

LOOPBACK = "127.0.0.1"
QUIET = logging.CRITICAL  # what goes wrong comes back as an error
SHARING_S = 60.0  # a network file system may show a new file that late


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Who renders. scheduler: address, or file that names it; None: `workers` processes of this machine, one per GPU with CUDA,
    one per core else. tls: certificate authority, certificate and key. insecure: a scheduler elsewhere without TLS is allowed.
    frames_per_task: None: four tasks per worker, at most 32 frames. retries: of a task that fails. patience_s: for the first
    worker."""

    scheduler: str | None = None
    workers: int | None = None
    tls: tuple[Path, Path, Path] | None = None
    insecure: bool = False
    frames_per_task: int | None = None
    retries: int = 2
    patience_s: float = 600.0


def fleet_renderer(client: Any, order: Order, fleet: Fleet) -> Renderer:
    """Renders with the workers of a client (`connected`). Its generator raises what a worker was refused for, and MachineError
    where one fails too often or writes files that are not seen here."""

    def render(job: Job, frames: Sequence[int]) -> Iterator[Progress]:
        return _rendered(client, order, fleet, job, frames)

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
        from distributed import Client, Security, SpecCluster
    except ImportError:
        raise MachineError("dask is not installed: pip install 'framepairs[dask]'") from None
    security = None
    if fleet.tls is not None:
        names = dict(zip(("tls_ca_file", "tls_client_cert", "tls_client_key"), map(str, fleet.tls), strict=True))
        security = Security(require_encryption=True, **names)
    with ExitStack() as stack:
        try:
            if address is None:
                cluster = stack.enter_context(SpecCluster(**_own_cluster(fleet, variant), silence_logs=QUIET))
                address = cluster.scheduler_address
            patience = min(30, fleet.patience_s)
            client = stack.enter_context(Client(address, security=security, timeout=patience, set_as_default=False))
            client.wait_for_workers(1, timeout=fleet.patience_s)
        except TimeoutError:
            raise MachineError(f"no worker came to {address} within {fleet.patience_s:g} s") from None
        except (OSError, ValueError, TypeError) as error:
            raise MachineError(f"cannot reach the scheduler at {address}: {error}") from None
        yield client


def _own_cluster(fleet: Fleet, variant: str) -> dict[str, Any]:
    """Scheduler and workers of this machine, on loopback alone: HTTP servers listen everywhere unless they are told."""
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


def _rendered(client, order: Order, fleet: Fleet, job: Job, frames: Sequence[int]) -> Iterator[Progress]:
    topic, steps = f"framepairs-{secrets.token_hex(8)}", queue.SimpleQueue()
    workers = max(len(client.scheduler_info()["workers"]), 1)
    size = fleet.frames_per_task or min(32, max(1, len(frames) // (4 * workers)))
    ranges = [list(frames[first : first + size]) for first in range(0, len(frames), size)]
    client.subscribe_topic(topic, lambda event: steps.put(event[1]))
    futures = [
        client.submit(_render_range, order, part, topic, pure=False, retries=fleet.retries, key=f"frames-{part[0]}-{topic}")
        for part in ranges
    ]
    for future in futures:
        future.add_done_callback(steps.put)
    left, seen, checked = len(futures), set(), False
    try:
        while left:
            item = steps.get()
            finished = [item] if isinstance(item, dict) else _result(item)
            left -= not isinstance(item, dict)
            for values in finished:
                step = Progress(**values)
                if step.frame in seen:
                    continue  # told twice, or rendered again after its worker was lost
                seen.add(step.frame)
                checked = checked or _is_shared(job, step.frame)
                yield step
    finally:
        client.cancel(futures)
        client.unsubscribe_topic(topic)


def _result(future) -> list[dict]:
    """What a task did. Raises what it was refused for, or MachineError."""
    error = future.exception()
    if error is None:
        value = future.result()
        if isinstance(value, FramepairsError):
            raise value
        return value
    if isinstance(error, FramepairsError):
        raise error
    raise MachineError(f"a worker failed: {type(error).__name__}: {' '.join(str(error).split())[:300]}") from error


def _is_shared(job: Job, frame: int) -> bool:
    file, start = record_file(job, frame), time.monotonic()
    while not file.is_file():
        if time.monotonic() - start > SHARING_S:
            raise MachineError(f"{file}: a worker wrote it, and it is not here: --out must be a folder that all machines share")
        os.listdir(job.out)  # makes a network file system look again
        time.sleep(0.2)
    return True


# ---- on a worker ----


@lru_cache(1)
def _renderer() -> ThreadPoolExecutor:
    """The one thread of this process that renders: variant and flags of Dr.Jit belong to a thread, and its kernels use all."""
    return ThreadPoolExecutor(1)


_last: list[tuple[Order, Job, list]] = []  # order, its job, and its engine, in `_renderer`'s thread


def _render_range(order: Order, frames: list[int], topic: str) -> list[dict] | FramepairsError:
    """Task: the frames of a range, told one by one under `topic`. Bad input comes back as a value, which is not tried again."""
    from distributed import get_worker

    worker = get_worker()

    def run() -> list[dict]:
        job, engines = _prepared(order, worker.state.nthreads)
        told = []
        for step in render_frames(job, frames, engines=engines, writers=worker.state.nthreads):
            told.append(vars(replace(step, worker=worker.address, profile=None)))
            worker.log_event(topic, told[-1])
        return told

    try:
        return _renderer().submit(run).result()
    except InputError as error:
        return error


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
