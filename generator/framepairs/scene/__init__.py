"""Reading a scene file into a SceneDescription."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .containment import reach_of, within
from .default_sky import default_environment
from .description import Environment, Material, SceneDescription, Texture, rotation_from_y_up
from .images import linear_texels, read_image

LARGEST_HALF = 65504
SUBDIVISION = 2
USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
GLTF_SUFFIXES = (".gltf", ".glb")
TRIANGLE_SUFFIXES = (".obj", ".ply", ".stl", ".off")
SUFFIXES = (*USD_SUFFIXES, *GLTF_SUFFIXES, ".xml", *TRIANGLE_SUFFIXES)


def load_scene(
    file: Path, clip: str | None = None, *, allow_outside: bool = False, subdivision: int = SUBDIVISION
) -> SceneDescription:
    """The scene in `file`, by its suffix, with the animation clip of that name (glTF; the first by default).

    A scene without environment has the image `<stem>.environment.exr` (or .hdr) beside it, if there is one. allow_outside: it
    may name files outside its own folder. subdivision: how often subdivision surfaces are refined. Raises InputError naming
    the file.
    """
    scene = solid_where_opaque(_read_scene(file, clip, allow_outside, subdivision))
    if scene.environment is not None:
        return scene
    beside = (file.with_name(f"{file.stem}.environment{suffix}") for suffix in (".exr", ".hdr"))
    image = next((name for name in beside if name.is_file()), None)
    return scene if image is None else _with_image(scene, within(reach_of(file, allow_outside), image.name, file=file))


def solid_where_opaque(scene: SceneDescription) -> SceneDescription:
    """The scene in which materials that blend but let nothing through anywhere are opaque: exporters write many of them, and
    G-buffers would miss their surfaces."""
    if scene.materials_at is not None:
        return scene
    see_through = {
        item.material
        for item in scene.objects
        if (colors := scene.meshes[item.mesh].colors) is not None and (colors[:, 3] < 1).any()
    }
    materials = tuple(
        replace(material, alpha="opaque") if _blends_nothing(scene, material) and index not in see_through else material
        for index, material in enumerate(scene.materials)
    )
    return replace(scene, materials=materials)


def _blends_nothing(scene: SceneDescription, material: Material) -> bool:
    if material.alpha != "blend" or material.opacity < 1:
        return False
    if material.base_texture is None:
        return True
    texture = scene.textures[material.base_texture.texture]
    full = 255 if texture.texels.dtype == np.uint8 else 1
    return (texture.scale[3], texture.bias[3]) == (1, 0) and bool((texture.texels[..., 3] >= full).all())


def _read_scene(file: Path, clip: str | None, allow_outside: bool, subdivision: int) -> SceneDescription:
    suffix = file.suffix.lower()
    if not file.is_file():
        raise InputError("no such scene", file=file)
    if clip is not None and suffix not in GLTF_SUFFIXES:
        raise InputError(f"files of this format have one animation or none, no clip {clip!r}", file=file, field="clip")
    reach = reach_of(file, allow_outside)
    if suffix in USD_SUFFIXES:
        from .usd import load_usd

        return load_usd(file, reach, subdivision)
    if suffix in GLTF_SUFFIXES:
        from .gltf import load_gltf

        return load_gltf(file, reach, clip)
    if suffix == ".xml":
        from .mitsuba import load_mitsuba

        return load_mitsuba(file, reach)
    if suffix in TRIANGLE_SUFFIXES:
        from .animation import with_animation
        from .triangles import load_triangles

        return with_animation(load_triangles(file, reach), file, reach)
    raise InputError(f"unknown scene format {suffix!r}: {' '.join(SUFFIXES)} are read", file=file)


def light_scene(scene: SceneDescription, environment: Path | None) -> tuple[SceneDescription, str | None]:
    """The scene with an environment, and what lights it: the file's name, 'default', or None for its own light.

    `environment` replaces the scene's own. A scene without lights and environment gets the default one; one with lights
    alone a black sky. Texels that are no radiance are replaced and named in `not_read`.
    """
    if environment is not None:
        lit = _with_image(scene, environment)
        return _with_sky(lit, lit.environment), str(environment)
    if scene.environment is not None:
        return _with_sky(scene, scene.environment), None
    if scene.lights or any(scene.materials[item.material].shines for item in scene.objects):
        return replace(scene, environment=Environment(name="black", texels=np.zeros((1, 2, 3), np.float32))), None
    return replace(scene, environment=default_environment(scene.up_axis)), "default"


def _with_image(scene: SceneDescription, image: Path) -> SceneDescription:
    texels = linear_texels(Texture(name=image.name, texels=read_image(image), srgb=True))
    rotation = rotation_from_y_up(scene.up_axis)
    sky = Environment(name=image.name, texels=texels[..., :3], world_from_environment=rotation)
    return replace(scene, environment=sky, files=(*scene.files, image))


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
    return files_hash(scene.files)


def files_hash(files: tuple[Path, ...]) -> str:
    """sha256 over the names (relative to the first one's folder) and contents of files."""
    digest = hashlib.sha256()
    folder = files[0].resolve().parent if files else Path()
    for file in sorted(files, key=lambda item: _relative(item, folder)):
        digest.update(_relative(file, folder).encode() + b"\0")
        try:
            digest.update(hashlib.sha256(file.read_bytes()).digest())
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    return digest.hexdigest()


def _relative(file: Path, folder: Path) -> str:
    resolved = file.resolve()
    return resolved.relative_to(folder).as_posix() if resolved.is_relative_to(folder) else resolved.name
