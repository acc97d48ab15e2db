"""Every method by name, what it reads, and a sequence upscaled with it, frame by frame."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from numpy.typing import NDArray

from ..backend import dr
from ..corpus import Corpus
from ..errors import InputError
from ..warp import to_array
from .accumulation import accumulate
from .guided import guided
from .guided_temporal import guided_oracle, guided_temporal
from .inputs import FrameReader, layers_drawn
from .settings import DEFAULTS, UpscaleSettings
from .spatial import SPATIAL, upscale
from .temporal import oracle, temporal

SHAPE = ("depth", "normal", "object_id")
GBUFFER = (*SHAPE, "emission", "brdf")
EXACT = ("motion", "visibility")


@dataclass(frozen=True)
class Method:
    """lr, hr: channels that it reads. step: (history or None, frame, settings) -> (history, planes)."""

    step: Callable
    lr: tuple[str, ...] = ("color",)
    hr: tuple[str, ...] = ()


def _alone(upscaled: Callable) -> Callable:
    """A step of a method that remembers nothing."""
    return lambda history, frame, settings: (None, upscaled(frame, settings))


def _spatial(name: str) -> Method:
    return Method(_alone(lambda frame, settings: upscale(frame.lr["color"], name, frame.size, frame.jitter)))


METHODS: dict[str, Method] = {
    **{name: _spatial(name) for name in SPATIAL},
    "accumulate": Method(accumulate, ("color", "motion", "visibility")),
    "temporal": Method(temporal, ("color", "depth", "motion")),
    "oracle": Method(oracle, ("color",), EXACT),
    "joint_bilateral": Method(_alone(lambda *given: guided(*given, demodulated=False)), ("color", *SHAPE), SHAPE),
    "guided": Method(_alone(guided), ("color", *GBUFFER), GBUFFER),
    "guided_temporal": Method(guided_temporal, ("color", "motion", *GBUFFER), GBUFFER),
    "guided_oracle": Method(guided_oracle, ("color", *GBUFFER), (*GBUFFER, *EXACT)),
}


@dataclass(frozen=True, kw_only=True)
class Upscaled:
    """image: [height, width, 3] scene-linear float32. milliseconds: of the method alone, without reading."""

    frame: int
    image: NDArray
    milliseconds: float


def method_named(name: str) -> Method:
    """Raises InputError for a name that is none."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; known are {', '.join(METHODS)}", field="method")
    return METHODS[name]


def upscale_frames(
    corpus: Corpus, sequence: str, pairs: Sequence[tuple[str, str]], settings: UpscaleSettings = DEFAULTS
) -> Iterator[tuple[FrameReader, list[Upscaled]]]:
    """Every frame in order, for each (stream, method) of `pairs`, and what has been read of it. History ends at a reset and
    where a frame is missing.

    Raises InputError for an unknown method, and for a stream or a channel that it needs and the corpus lacks.
    """
    methods = [method_named(name) for _, name in pairs]
    layers = layers_drawn(corpus, sequence)
    histories, last = [None] * len(pairs), None
    for frame in corpus.frames(sequence):
        reader = FrameReader(corpus, sequence, frame)
        if reader.record.reset or last != frame - 1:
            histories = [None] * len(pairs)
        results, last = [], frame
        for index, ((stream, _), method) in enumerate(zip(pairs, methods, strict=True)):
            given = reader.upscale_frame(stream, method.lr, method.hr + (layers if "brdf" in method.hr else ()))
            start = time.perf_counter()
            histories[index], planes = method.step(histories[index], given, settings)
            dr.eval(planes)
            dr.sync_thread()
            elapsed = 1000 * (time.perf_counter() - start)
            results.append(Upscaled(frame=frame, image=to_array(planes, *given.size), milliseconds=elapsed))
        yield reader, results


def upscale_sequence(
    corpus: Corpus, sequence: str, stream: str, name: str, settings: UpscaleSettings = DEFAULTS
) -> Iterator[Upscaled]:
    """`upscale_frames` of one stream with one method."""
    return (results[0] for _, results in upscale_frames(corpus, sequence, [(stream, name)], settings))
