"""Content variation by seed: the same scene, and the same camera, at another hour, in other colours, with other things in it.

What may vary stands in `<stem>.variation.json` beside the scene file (`variation_file`); scenes without one vary modestly.
"""

from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from .containment import reach_of, within
from .description import SceneDescription
from .variation_file import EnvironmentRule, LightRule, Palette, Variation, read_variation, variation_beside
from .variation_light import vary_light
from .variation_materials import vary_materials
from .variation_motion import vary_motion
from .variation_places import vary_places, vary_presence


def varied_scene(
    scene: SceneDescription, scene_file: Path, seed: int, allow_outside: bool = False, environment: Path | None = None
) -> SceneDescription:
    """The lit scene of `scene_file` varied by what stands beside it, which then counts among its files.

    environment: what the user lights it with, if anything. Raises InputError, also where a daylight would replace that.
    """
    beside = variation_beside(scene_file)
    if not beside.exists() and not beside.is_symlink():
        return vary(scene, default_variation(scene), seed)
    file = within(reach_of(scene_file, allow_outside), beside.name, file=scene_file)
    variation = read_variation(file)
    if variation.daylight is not None and environment is not None:
        raise InputError(f"replaces the environment {environment}: leave that out", file=file, field="daylight")
    varied = vary(scene, variation, seed, file=file)
    return replace(varied, files=(*scene.files, file))


def vary(scene: SceneDescription, variation: Variation, seed: int, *, file: Path | None = None) -> SceneDescription:
    """The scene as `seed` (0 or more) has it: a pure function. Objects, and so every object_id, and cameras stay.

    file: for errors. Raises InputError naming file and field for patterns that match nothing.
    """
    scene = vary_light(scene, variation, seed, file)
    scene = vary_materials(scene, variation, seed, file)
    scene = vary_motion(scene, variation, seed, file)
    scene = vary_places(scene, variation, seed, file)
    return vary_presence(scene, variation, seed, file)


def default_variation(scene: SceneDescription) -> Variation:
    """Of a scene without a file: its light is turned about up, tinted, brighter or darker, its base colours a little other."""
    return Variation(
        version=1,
        environment=EnvironmentRule(turn_deg=(-180, 180), gain=(0.7, 1.4), temperature_k=(4500, 9500)),
        lights=(LightRule(lights=("*",), temperature_k=(4500, 9500), gain=(0.7, 1.4)),) if scene.lights else (),
        palettes=(Palette(materials=("*",), hue_deg=(-20, 20), value=(0.75, 1.2)),) if scene.materials else (),
    )
