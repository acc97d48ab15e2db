"""The folder of a sampling: a camera path file for each path, `cameras.json`, and the plot as SVG and PNG."""

import json
from collections.abc import Callable
from pathlib import Path

from ..errors import InputError
from ..manifest import make_folder, to_json, write_atomically
from ..scene import scene_hash
from ..scene.description import SceneDescription
from .files import CamerasFile, Sampling, SamplingOptions, read_cameras
from .plot import KINDS, plot_paths
from .sampler import sample_cameras

NAME = "cameras.json"


def check_folder(out: Path, scene: str, scene_sha256: str, options: SamplingOptions) -> CamerasFile | None:
    """What `out` holds already, None where it holds no sampling. Raises InputError naming what differs where it is another
    one's."""
    if not (out / NAME).exists():
        return None
    held = read_cameras(out / NAME)
    mine, theirs = options.model_dump(mode="json"), held.options.model_dump(mode="json")
    wanted = {"scene": scene, "scene_sha256": scene_sha256} | mine
    stored = {"scene": held.scene, "scene_sha256": held.scene_sha256} | theirs
    different = [key for key in wanted if wanted[key] != stored[key]]
    if different:
        key = different[0]
        problem = f"holds another sampling: {key} is {stored[key]} there, {wanted[key]} here; choose another --out or --force"
        raise InputError(problem, file=out / NAME, field=key)
    return held


def sample_into(
    scene: SceneDescription,
    name: str,
    options: SamplingOptions,
    out: Path,
    *,
    force: bool = False,
    on_path: Callable[[int, float], None] | None = None,
) -> Sampling:
    """Sample paths and write their folder; another sampling's folder, and one that cannot be written into, is refused before
    anything is sampled."""
    if not force:
        check_folder(out, name, scene_hash(scene), options)
    make_folder(out)
    sampling = sample_cameras(scene, options, name, on_path)
    write_sampling(sampling, out, force=force)
    return sampling


def write_sampling(sampling: Sampling, out: Path, *, force: bool = False) -> list[Path]:
    """Write the folder and return its files. Each appears whole or not at all, `cameras.json` last.

    Raises InputError where `out` holds another sampling, unless `force`: then that one's path files go. Its `cameras.json` goes
    first, so that an interrupt never leaves one that tells of other paths than lie beside it.
    """
    file = sampling.file
    if not force:
        check_folder(out, file.scene, file.scene_sha256, file.options)
    make_folder(out)
    old = _replaced(out) if force else []
    written = []
    for record, values in zip(file.paths, sampling.values, strict=True):
        written.append(out / record.file)
        write_atomically(written[-1], (json.dumps(values, indent=1, allow_nan=False) + "\n").encode())
    for kind in KINDS:
        written.append(out / f"paths.{kind}")
        write_atomically(written[-1], plot_paths(sampling, kind))
    written.append(out / NAME)
    write_atomically(written[-1], to_json(file))
    for name in set(old) - {record.file for record in file.paths}:
        (out / name).unlink(missing_ok=True)
    return written


def _replaced(out: Path) -> list[str]:
    """Removes `cameras.json`, and returns the path files that it names; none where it is damaged."""
    try:
        names = [record.file for record in read_cameras(out / NAME).paths]
    except InputError:
        names = []
    try:
        (out / NAME).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be replaced: {error.strerror}", file=out / NAME) from None
    return names
