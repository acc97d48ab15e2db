"""Streams whose kernels run, and the arrays that come of them."""

from dataclasses import dataclass

from numpy.typing import NDArray

from .backend import dr, mi
from .conventions import Stream
from .lanes import array_of


@dataclass(frozen=True)
class StreamFrame:
    """One stream of one frame: channel name to array [height, width, components] (float32 or uint32); J in pixels; and what
    `path` shading counted."""

    stream: Stream
    jitter: tuple[float, float]
    arrays: dict[str, NDArray]
    fireflies: int = 0
    rejected_paths: int = 0


@dataclass(frozen=True)
class Started:
    """A stream whose kernel runs: J, channel name to image, and per lane what `path` shading counts."""

    stream: Stream
    jitter: tuple[float, float]
    images: dict[str, mi.Float | mi.UInt32]
    firefly: mi.Bool
    rejected: mi.UInt32


@dataclass(frozen=True)
class Launched:
    """What `Engine.launch` started, for `fetch`."""

    streams: tuple[Started, ...]


def fetch(launched: Launched) -> list[StreamFrame]:
    """Wait for what was launched."""
    return [
        StreamFrame(
            stream=each.stream,
            jitter=each.jitter,
            arrays={name: array_of(image, each.stream.size) for name, image in each.images.items()},
            fireflies=int(dr.count(each.firefly)[0]),
            rejected_paths=int(dr.sum(each.rejected)[0]),
        )
        for each in launched.streams
    ]
