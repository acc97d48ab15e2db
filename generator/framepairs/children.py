"""Rendering in child processes that are renewed: whatever a long run gathers in memory goes with each of them."""

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

from .errors import FramepairsError, MachineError
from .job import Job
from .orders import Order, job_of
from .pipeline import Progress, Renderer, render_frames
from .resume import wanted_of


def renewed_renderer(order: Order, frames_each: int, profile: bool = False) -> Renderer:
    """Renders in a child process, a new one after every `frames_each` frames. The files are those that one process writes."""

    def render(job: Job, frames: Sequence[int], token: str) -> Iterator[Progress]:
        lacking: list[int] = []
        for frame in frames:
            if wanted_of(job, frame).as_recorded:
                yield Progress(frame=frame, rendered=False, bytes=0)
            else:
                lacking.append(frame)
        for first in range(0, len(lacking), frames_each):
            yield from _in_child(order, lacking[first : first + frames_each], token, profile)

    return render


def _in_child(order: Order, frames: list[int], token: str, profile: bool) -> Iterator[Progress]:
    """Raises what the child raised; MachineError where it was killed."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_render, args=(order, frames, token, profile, sender), daemon=True)
    child.start()
    sender.close()
    try:
        while (message := _received(receiver)) is not None:
            if isinstance(message, BaseException):
                raise message
            yield message
        child.join()
        if child.exitcode != 0:
            how = f"by signal {-child.exitcode}" if child.exitcode < 0 else f"with exit code {child.exitcode}"
            raise MachineError(f"the process that rendered frames {frames[0]} to {frames[-1]} ended {how}")
    finally:
        child.terminate()
        child.join()


def _received(receiver: Connection) -> Any:
    try:
        return receiver.recv()
    except EOFError:
        return None


def _render(order: Order, frames: list[int], token: str, profile: bool, sender: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears it too, and ends us
    try:
        for step in render_frames(job_of(order), frames, token, profile=profile):
            sender.send(step)
    except FramepairsError as error:
        sender.send(error)
