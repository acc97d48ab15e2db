"""From the options of a command to a plan, a camera path and a job; every refusal names the option."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .bundled import camera_path_names, find_camera_path, find_scene
from .camera_path import CameraPath, read_camera_path, with_fps
from .errors import InputError
from .frame import check_frames, orbit, path_of_camera
from .overlay_elements import read_overlay
from .plan import RenderPlan
from .scene import files_hash, light_scene, load_scene, scene_hash
from .scene.description import SceneDescription
from .scene.variation import varied_scene

HR_STREAMS = ("hr_native", "hr_mip0")


def plan_options(
    scale=None, display=None, shading=None, aa=None, spp=None, seed=None, streams=None, channels=None, settings=None
) -> dict[str, Any]:
    """The options that were given, as keys of a plan; `settings` are KEY=VALUE with the value as JSON or a bare word."""
    given: dict[str, Any] = {"shading": shading, "antialiasing": aa, "samples_per_pixel": spp, "seed": seed}
    values = {key: value for key, value in given.items() if value is not None}
    if scale:
        values["scales"] = tuple(scale)
    if display is not None:
        match = re.fullmatch(r"(-?[0-9]{1,9})x(-?[0-9]{1,9})", display.lower())
        if match is None:
            raise InputError(f"must look like 1920x1080, not {display!r}", field="display")
        values["display"] = tuple(int(part) for part in match.groups())
    if streams is not None:
        names = [name.strip() for name in streams.split(",")]
        values |= {name: name in names for name in HR_STREAMS}
        values["variants"] = tuple(name for name in names if name not in HR_STREAMS)
    if channels is not None:
        names = [name.strip() for name in channels.split(",")]
        values["channels"] = names[0] if names[0] in ("all", "needed") else tuple(names)
    for setting in settings or ():
        key, equals, value = setting.partition("=")
        if not equals:
            raise InputError(f"must look like key=value, not {setting!r}", field="set")
        values[key] = _json_or_word(value)
    return values


def camera_path_of(scene: str, camera: str | None, described: SceneDescription) -> tuple[CameraPath, str]:
    """The path that was asked for (a bundled name, a file, or a camera of the scene), else the one of the scene's name, else
    an orbit; and what the manifest calls it."""
    if camera is None and scene in camera_path_names():
        camera = scene
    if camera is None:
        return orbit(described), "orbit"
    of_scene = {item.name: item for item in described.cameras}
    if camera in of_scene and camera not in camera_path_names() and not Path(camera).is_file():
        return path_of_camera(of_scene[camera], described.animation_end_s), camera
    return read_camera_path(find_camera_path(camera, tuple(of_scene))), camera


def read_scene(file: Path, clip: str | None, plan: RenderPlan, allow_outside: bool) -> SceneDescription:
    return load_scene(file, clip, allow_outside=allow_outside, subdivision=plan.subdivision)


def make_job(
    scene: str,
    file: Path,
    camera: str | None,
    plan: RenderPlan,
    out: Path,
    *,
    environment: Path | None = None,
    clip: str | None = None,
    stored=None,
    allow_outside: bool = False,
    overlay: str | Path | None = None,
    vary: int | None = None,
    fps: float | None = None,
    path: tuple[CameraPath, str] | None = None,
):
    """The Job of a scene; `stored` is the SequenceRecord that it must repeat. overlay: a file, 'none', 'scene' for the one
    beside the scene, or None for that if there is one. vary: seed of the content. fps: instead of the path's. path: with its
    name, instead of `camera`."""
    from .job import Job  # activates a back end

    if environment is not None and not environment.is_file():
        raise InputError("no such environment", file=environment)
    lit, light = light_scene(read_scene(file, clip, plan, allow_outside), environment)
    given = (stored.camera_path, stored.camera_path_name) if stored else path
    path, path_name = _at_rate(*(given or camera_path_of(scene, camera, lit)), fps)
    as_it_is = lit if vary is not None else None
    if vary is not None:
        lit = varied_scene(lit, file, vary, allow_outside, environment)
    scene_sha256 = scene_hash(lit)
    if stored is not None and scene_sha256 != stored.scene_sha256:
        raise InputError("is not the scene that the corpus was rendered from (sha256 differs)", file=file)
    named, overlay_file = _overlay_of(file, overlay)
    drawn_over = read_overlay(overlay_file, allow_outside) if overlay_file is not None else None
    overlay_sha256 = files_hash(drawn_over.files) if drawn_over is not None else None
    if stored is not None and overlay_sha256 not in (None, stored.overlay_sha256):
        raise InputError("is not the overlay that the corpus was rendered with (sha256 differs)", file=overlay_file)
    return Job(
        scene=lit,
        scene_name=scene,
        environment=light,
        path=path,
        path_name=path_name,
        plan=plan,
        out=out,
        clip=clip,
        overlay=drawn_over,
        overlay_name=named,
        variation=vary,
        camera_scene=as_it_is,
        split=stored.split if stored else "train",
        scene_sha256=scene_sha256,
        overlay_sha256=overlay_sha256,
    )


def sampled_jobs(folder: Path, split: str | None, fps: float | None, make: Callable[[str], Any]) -> list:
    """The jobs of all camera paths of a sampling (`framepairs cameras sample`), or of those of one split. make: the Job of a
    path's file; it is asked once, for the scene is the same.

    Raises InputError for another scene than the paths were sampled in, and for a split without paths.
    """
    from .sampling.files import read_cameras

    if not (folder / "cameras.json").is_file():
        raise InputError("is no camera path, nor a folder with cameras.json", file=folder)
    sampled = read_cameras(folder / "cameras.json")
    chosen = [record for record in sampled.paths if split in (None, record.split)]
    if not chosen:
        raise InputError(f"no path is of split {split!r}", file=folder / "cameras.json", field="split")
    first = make(str(folder / chosen[0].file))
    if first.variation is None and first.environment in (None, "default") and first.scene_sha256 != sampled.scene_sha256:
        raise InputError(f"was sampled in another scene than {first.scene_name} (sha256 differs)", file=folder / "cameras.json")
    jobs = []
    for record in chosen:
        path, name = _at_rate(read_camera_path(folder / record.file), record.file, fps)
        jobs.append(replace(first, path=path, path_name=name, split=record.split))
    return jobs


def _at_rate(path: CameraPath, name: str, fps: float | None) -> tuple[CameraPath, str]:
    """The path at another frame rate, which its name then tells."""
    return (path, name) if fps is None else (with_fps(path, fps), f"{Path(name).stem}_{fps:g}fps")


def _overlay_of(scene: Path, asked: str | Path | None) -> tuple[str | None, Path | None]:
    """What the manifest calls the overlay, and its file."""
    beside = scene.with_name(f"{scene.stem}.overlay.json")
    if asked == "none" or (asked is None and not beside.is_file()):
        return None, None
    return ("scene", beside) if asked in (None, "scene") else (str(asked), Path(asked))


def stored_job(entry, moved_to: str | None, plan: RenderPlan, out: Path, allow_outside: bool = False):
    """(the job of a sequence of a corpus, whether its scene was found at `moved_to`)."""
    clip = entry.animation_clip
    environment = Path(entry.environment) if entry.environment not in (None, "default") else None
    overlay = "none" if entry.overlay is None else entry.overlay
    given = {"environment": environment, "clip": clip, "allow_outside": allow_outside, "overlay": overlay}
    given["vary"] = entry.variation
    if moved_to is not None:
        try:
            return make_job(entry.scene, find_scene(moved_to), None, plan, out, stored=entry, **given), True
        except InputError as error:
            if "sha256 differs" not in error.problem:
                raise
    return make_job(entry.scene, find_scene(entry.scene), None, plan, out, stored=entry, **given), False


def frame_range(text: str | None, count: int) -> range:
    """`first:end` of a path of `count` frames; None: all."""
    if text is None:
        return range(count)
    match = re.fullmatch(r"([0-9]{0,9}):([0-9]{0,9})", text)
    if match is None:
        raise InputError(f"must look like 0:32, not {text!r}", field="frames")
    chosen = range(int(match[1] or 0), int(match[2] or count))
    check_frames(chosen, count)
    return chosen


def _json_or_word(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text
