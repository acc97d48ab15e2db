"""Reading a scene file into a SceneDescription."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .description import Environment, SceneDescription, Texture, default_environment, rotation_from_y_up
from .images import linear_texels, read_image

LARGEST_HALF = 65504


def load_scene(file: Path, clip: str | None = None) -> SceneDescription:
    """The scene in `file`, by its suffix, with the animation clip of that name (glTF; the first by default). Raises InputError
    naming the file."""
    suffix = file.suffix.lower()
    if not file.is_file():
        raise InputError("no such scene", file=file)
    if suffix in (".usd", ".usda", ".usdc", ".usdz"):
        from .usd import load_usd

        if clip is not None:
            raise InputError(f"has one animation, no clip {clip!r}", file=file, field="clip")

        return load_usd(file)
    from .triangles import SUFFIXES, load_triangles

    if suffix in SUFFIXES:
        return load_triangles(file, clip)
    raise InputError(f"unknown scene format {suffix!r}: .usd .usda .usdc .usdz {' '.join(SUFFIXES)} are read", file=file)


def light_scene(scene: SceneDescription, environment: Path | None) -> tuple[SceneDescription, str | None]:
    """The scene with an environment, and what lights it: the file's name, 'default', or None for its own light.

    `environment` replaces the scene's own. A scene without lights and environment gets the default one; one with lights
    alone a black sky. Texels that are no radiance are replaced and named in `not_read`.
    """
    if environment is not None:
        texels = linear_texels(Texture(name=environment.name, texels=read_image(environment), srgb=True))
        rotation = rotation_from_y_up(scene.up_axis)
        sky = Environment(name=environment.name, texels=texels[..., :3], world_from_environment=rotation)
        return _with_sky(replace(scene, files=(*scene.files, environment)), sky), str(environment)
    if scene.environment is not None:
        return _with_sky(scene, scene.environment), None
    if scene.lights:
        return replace(scene, environment=Environment(name="black", texels=np.zeros((1, 2, 3), np.float32))), None
    return replace(scene, environment=default_environment(scene.up_axis)), "default"


def _with_sky(scene: SceneDescription, sky: Environment) -> SceneDescription:
    """The scene under `sky`, whose infinite texels (suns beyond half precision) become 65504, and NaN and negative ones 0."""
    radiance = np.isfinite(sky.texels) & (sky.texels >= 0)
    if radiance.all():
        return replace(scene, environment=sky)
    texels = np.maximum(np.nan_to_num(sky.texels, nan=0.0, posinf=LARGEST_HALF, neginf=0.0), 0)
    odd = int((~radiance).any(axis=-1).sum())
    named = f"{odd} texels of environment {sky.name} that are infinite (drawn as {LARGEST_HALF}), negative or NaN (as 0)"
    return replace(scene, environment=replace(sky, texels=texels), not_read=(*scene.not_read, named))


def scene_hash(scene: SceneDescription) -> str:
    """sha256 over the names (relative to the main file) and contents of all files that were read."""
    digest = hashlib.sha256()
    folder = scene.files[0].resolve().parent if scene.files else Path()
    for file in sorted(scene.files, key=lambda item: _relative(item, folder)):
        digest.update(_relative(file, folder).encode() + b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _relative(file: Path, folder: Path) -> str:
    resolved = file.resolve()
    return resolved.relative_to(folder).as_posix() if resolved.is_relative_to(folder) else resolved.name
