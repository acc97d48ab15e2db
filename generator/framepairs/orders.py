"""From a job to its order and back: what another process or machine needs to render the same frames."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .backend import activate
from .bundled import find_scene, scene_names
from .camera_path import CameraPath
from .errors import InputError
from .job import Job
from .options import make_job
from .plan import RenderPlan


@dataclass(frozen=True, kw_only=True)
class Order:
    """Plain data that pickles. Files are absolute; None: the scene is a bundled one. names: what the manifest calls things.
    sources: what the job must come out of, so that nobody renders another scene, or with another version."""

    scene_file: Path | None
    environment_file: Path | None
    overlay_file: Path | str
    allow_outside: bool
    plan: RenderPlan
    path: CameraPath
    clip: str | None
    variation: int | None
    out: Path
    names: dict[str, Any]
    sources: dict[str, Any]


NAMES = ("scene_name", "path_name", "environment", "overlay_name", "split", "variant")


def order_of(job: Job, allow_outside: bool = False) -> Order:
    """The order of a job that was made from files. allow_outside: whether its scene may name files outside its folder."""
    return Order(
        scene_file=None if job.scene_name in scene_names() else job.scene.files[0].absolute(),
        environment_file=None if job.environment in (None, "default") else Path(job.environment).absolute(),
        overlay_file="none" if job.overlay is None else job.overlay.files[0].absolute(),
        allow_outside=allow_outside,
        plan=job.plan,
        path=job.path,
        clip=job.clip,
        variation=job.variation,
        out=job.out.absolute(),
        names={name: getattr(job, name) for name in NAMES},
        sources=job.sources,
    )


def job_of(order: Order, before: tuple[Order, Job] | None = None) -> Job:
    """The job of an order. Raises InputError where this machine would render something else, or cannot find the files.

    before: another order and its job; where these differ in the camera path alone, the scene is not read again."""
    if before is not None and _without_path(order) == _without_path(before[0]):
        return replace(before[1], path=order.path, **order.names)
    activate("cuda" if order.names["variant"].startswith("cuda") else "llvm")
    name = order.names["scene_name"]
    job = make_job(
        name,
        order.scene_file or find_scene(name),
        None,
        order.plan,
        order.out,
        environment=order.environment_file,
        clip=order.clip,
        allow_outside=order.allow_outside,
        overlay=order.overlay_file,
        vary=order.variation,
        path=(order.path, order.names["path_name"]),
    )
    job = replace(job, **order.names)
    for key, value in order.sources.items():
        if job.sources[key] != value:
            raise InputError(f"this machine has another {key}: {_difference(job.sources[key], value)}", file=job.scene.files[0])
    return job


def _without_path(order: Order) -> tuple:
    """All that two orders of one scene share."""
    names = {key: value for key, value in order.names.items() if key not in ("path_name", "split")}
    sources = {key: value for key, value in order.sources.items() if key not in ("camera_path", "sequence")}
    return replace(order, path=None, names={}, sources={}), names, sources


def _difference(here: Any, there: Any) -> str:
    if not isinstance(here, dict):
        return f"{here}, not {there}"
    key = next(key for key in {*here, *there} if here.get(key) != there.get(key))
    return f"{key} {here.get(key)}, not {there.get(key)}"
