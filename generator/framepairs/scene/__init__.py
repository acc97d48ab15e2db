"""Reading a scene file into a SceneDescription."""

import hashlib
from pathlib import Path

from ..errors import InputError
from .description import SceneDescription


def load_scene(file: Path) -> SceneDescription:
    """The scene in `file`, by its suffix. Raises InputError naming the file."""
    suffix = file.suffix.lower()
    if not file.is_file():
        raise InputError("no such scene", file=file)
    if suffix in (".usd", ".usda", ".usdc", ".usdz"):
        from .usd import load_usd

        return load_usd(file)
    from .triangles import SUFFIXES, load_triangles

    if suffix in SUFFIXES:
        return load_triangles(file)
    raise InputError(f"unknown scene format {suffix!r}: .usd .usda .usdc .usdz {' '.join(SUFFIXES)} are read", file=file)


def scene_hash(scene: SceneDescription) -> str:
    """sha256 over the names (relative to the main file) and contents of all files that were read."""
    digest = hashlib.sha256()
    folder = scene.files[0].resolve().parent
    for file in sorted(scene.files, key=lambda item: _relative(item, folder)):
        digest.update(_relative(file, folder).encode() + b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _relative(file: Path, folder: Path) -> str:
    resolved = file.resolve()
    return resolved.relative_to(folder).as_posix() if resolved.is_relative_to(folder) else resolved.name
