"""What a scene holds and needs, and what leaving the rest out saves per frame: for `describe`.

Savings are measured, not estimated: the passes that do not run are run once here, and what is not written is encoded once.
Milliseconds are those of this machine's processors one after the other; while rendering, encoding runs beside it.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .backend import dr
from .brdf_tables import brdf_table, table_channel
from .channels import MOTION_CHANNELS, motion_name
from .conventions import Stream
from .engine import Engine
from .exr import encode
from .job import Job
from .plan import brdf_model, plan_streams
from .scene.description import SceneDescription
from .scene.needs import Need, table_need


@dataclass(frozen=True, kw_only=True)
class Row:
    """A channel, or a stream or table that may be left out. value: its constant, or the name of what it equals. bytes,
    milliseconds: saved per frame (the table's: once), 0 where it is needed; None where nothing was measured."""

    name: str
    needed: bool
    value: str | None
    why: str
    bytes: int | None = 0
    milliseconds: float | None = 0.0


def facts(scene: SceneDescription, light: str | None, path_name: str) -> dict:
    """Counts of what the scene holds, in the order in which they are shown."""
    return {
        "objects": len(scene.objects),
        "triangles": sum(len(scene.meshes[item.mesh].faces) for item in scene.objects),
        "materials": len(scene.materials),
        "texels": sum(texture.texels.shape[0] * texture.texels.shape[1] for texture in scene.textures),
        "lights": len(scene.lights),
        "light": light or "its own",
        "cameras": [camera.name for camera in scene.cameras],
        "animation": f"{scene.animation_end_s:g} s",
        "camera path": path_name,
        "single-sided objects": sum(not item.double_sided for item in scene.objects),
        "not read": [*scene.not_read, *(f"{m.name}: {what}" for m in scene.materials for what in m.not_read)],
    }


def rows(job: Job, *, measured: bool) -> list[Row]:
    """One row per channel in the table's order, then the streams and the table that are left out. Measuring needs a back end
    and renders the middle frame of the path a few times."""
    table = table_need(job.scene, job.plan)
    saved = _savings(job, table) if measured else {}

    def row(name: str, needed: bool, value: str | None, why: str) -> Row:
        unknown = (0, 0.0) if needed else (None, None)
        size, milliseconds = saved.get(name, unknown)
        return Row(name=name, needed=needed, value=value, why=why, bytes=size, milliseconds=milliseconds)

    found = [row(need.channel, need.needed, _value_of(need), need.why) for need in job.needs.values()]
    found += [row(name, False, f"same as {other}", "there are no textures") for name, other in job.equal_streams.items()]
    return found + ([] if table.needed else [row("brdf_table", False, "constant 0 0", table.why)])


def _value_of(need: Need) -> str | None:
    if need.needed:
        return None
    return f"same as {need.same_as}" if need.same_as else "constant " + " ".join(f"{value:.4g}" for value in need.constant)


def _savings(job: Job, table: Need) -> dict[str, tuple[int, float]]:
    """(bytes, milliseconds) by name."""
    left_out = {name: need for name, need in job.needs.items() if not need.needed}
    saved = {name: [0, 0.0] for name in (*left_out, *job.equal_streams)}
    if not table.needed:
        saved["brdf_table"] = list(_table_saving(job))
    if not left_out and not job.equal_streams:
        return {name: tuple(pair) for name, pair in saved.items()}
    engine, state = Engine(job.scene, job.plan), job.shoot.state(len(job.shoot) // 2)
    motions = [name for name in (*MOTION_CHANNELS, *map(motion_name, job.plan.motion_offsets)) if name in left_out]
    for stream in plan_streams(job.plan):
        if stream.name in job.equal_streams:
            names = frozenset(channel.name for channel in job.channels)
            arrays, spent = _timed(lambda names=names, stream=stream: engine.render(state, stream, names, 0).arrays)
            saved[stream.name][1] += spent
            for channel in job.channels:
                _add_encoding(saved[stream.name], channel, arrays[channel.name])
            continue
        arrays = _add_passes(saved, engine, state, stream, motions)
        for channel in job.table:
            if channel.name in left_out:
                array = arrays.get(channel.name)
                _add_encoding(saved[channel.name], channel, _constant(channel, stream, left_out) if array is None else array)
    return {name: tuple(pair) for name, pair in saved.items()}


def _add_passes(saved: dict, engine: Engine, state, stream: Stream, motions: list[str]) -> dict:
    """What each motion channel adds to the time of a stream, one after the other; and their arrays."""
    names, arrays = frozenset({"depth"} | set(MOTION_CHANNELS[:1]) - set(motions)), {}
    _, before = _timed(lambda: engine.render(state, stream, names, 0).arrays)
    for name in motions:
        names |= {name}
        arrays, after = _timed(lambda names=names: engine.render(state, stream, names, 0).arrays)
        saved[name][1] += max(after - before, 0.0)
        before = max(after, before)
    return arrays


def _timed(work: Callable[[], dict]) -> tuple[dict, float]:
    """(the result, milliseconds of the faster of two runs after one that compiles)."""
    result, spent = work(), []
    for _ in range(2):
        dr.sync_thread()
        start = time.perf_counter()
        result = work()
        spent.append(1000 * (time.perf_counter() - start))
    return result, min(spent)


def _add_encoding(pair: list, channel, array) -> None:
    start = time.perf_counter()
    pair[0] += len(encode(channel, np.array(array), attributes={}).data)
    pair[1] += 1000 * (time.perf_counter() - start)


def _constant(channel, stream: Stream, left_out: dict) -> np.ndarray:
    need = left_out[channel.name]
    value = need.constant or (0,) * channel.components
    dtype = np.uint32 if channel.dtype == "uint" else np.float32
    width, height = stream.size
    return np.broadcast_to(np.array(value, dtype), (height, width, channel.components)).copy()


def _table_saving(job: Job) -> tuple[int, float]:
    model = brdf_model(job.plan)
    start = time.perf_counter()
    table = brdf_table(model, job.plan.brdf_table).numpy()
    size = len(encode(table_channel(model), table, attributes={}).data)
    return size, 1000 * (time.perf_counter() - start)
