"""Which channels a scene seen along a path needs, decided before anything is rendered.

A channel that is not needed is not rendered and not written: its value is a constant in the manifest, and readers give
back the same arrays. The whole path counts, whatever part of it is rendered.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..camera_path import CameraSample
from ..channels import channels_with, motion_name
from ..plan import RenderPlan, plan_streams
from .description import Material, SceneDescription, Texture, slots_of


@dataclass(frozen=True, kw_only=True)
class Need:
    """Whether a channel is needed, and why. Where it is not: `constant` is its value on surfaces (everywhere, for motion
    and visibility), or `same_as` names the channel that it equals."""

    channel: str
    needed: bool
    why: str
    constant: tuple[float, ...] | None = None
    same_as: str | None = None


def channel_needs(
    scene: SceneDescription, samples: Sequence[CameraSample], plan: RenderPlan, overlaid: bool = False
) -> dict[str, Need]:
    """One Need per channel of the table, in its order. `scene` has its environment already. overlaid: something is drawn over
    the frames."""
    found = {
        **_material_needs(scene, plan),
        **_motion_needs(scene, samples),
        "emission": _emission_need(scene),
        "color_variance": _variance_need(plan),
        "transparency": _layer_need("transparency", any(m.alpha == "blend" for m in scene.materials), "blended materials"),
        "overlay": _layer_need("overlay", overlaid, "overlays"),
    }
    names = [channel.name for channel in channels_with(plan.motion_offsets)]
    always = {name: Need(channel=name, needed=True, why="every scene needs it") for name in names}
    if scene.materials_at is not None:
        changing = ("albedo", "specular", "roughness", "metallic", "emission")
        found |= {name: Need(channel=name, needed=True, why="materials change") for name in changing}
    needs = {name: found.get(name, need) for name, need in always.items()}
    for name in map(motion_name, plan.motion_offsets):
        moving = needs["motion"].needed
        why = "the plan asks for it" if moving else needs["motion"].why
        needs[name] = Need(channel=name, needed=moving, why=why, same_as=None if moving else "motion")
    return needs


def equal_streams(scene: SceneDescription, plan: RenderPlan) -> dict[str, str]:
    """LR streams that differ from another one in mip bias alone, where there is no texture: name to the other's name."""
    if any(slots_of(material) for material in _used(scene)):
        return {}
    streams = [stream for stream in plan_streams(plan) if stream.samples == 1]
    unbiased = {(stream.size, stream.jittered): stream.name for stream in streams if stream.mip_bias == 0}
    twins = {stream.name: unbiased.get((stream.size, stream.jittered)) for stream in streams if stream.mip_bias != 0}
    return {name: twin for name, twin in twins.items() if twin is not None}


def table_need(scene: SceneDescription, plan: RenderPlan) -> Need:
    """Whether any surface has a specular lobe, which the table of A and B integrates, or the plan wants all there is."""
    if plan.channels == "all":
        return Need(channel="brdf_table", needed=True, why="the plan asks for everything")
    for material in _used(scene):
        packed = material.surface_texture and scene.textures[material.surface_texture.texture]
        specular, metallic = (value > 0 and _varies(packed, k) for k, value in ((0, material.specular), (2, material.metallic)))
        if specular or metallic:
            return Need(channel="brdf_table", needed=True, why=f"{material.name} is specular")
    if scene.materials_at is not None:
        return Need(channel="brdf_table", needed=True, why="materials change")
    return Need(channel="brdf_table", needed=False, why="all surfaces are diffuse", constant=(0.0, 0.0))


def _varies(packed: Texture | None, component: int) -> bool:
    """Whether a surface texture leaves anything of a component."""
    return packed is None or packed.scale[component] != 0 or packed.bias[component] != 0


def _used(scene: SceneDescription) -> list[Material]:
    return [scene.materials[index] for index in sorted({item.material for item in scene.objects})]


def _material_needs(scene: SceneDescription, plan: RenderPlan) -> dict[str, Need]:
    used = _used(scene)
    bumpy = [material.name for material in used if material.normal_texture is not None]
    roughness = _value_need("roughness", scene, used, lambda m: (m.roughness,), "surface_texture", (1,))
    if bumpy and plan.normal_variance and not roughness.needed:
        why = f"filtered normals roughen {bumpy[0]}"
        roughness = Need(channel="roughness", needed=True, why=why)
    return {
        "albedo": _colored_need(scene)
        or _value_need("albedo", scene, used, lambda m: m.base_color, "base_texture", (0, 1, 2)),
        "specular": _value_need("specular", scene, used, lambda m: (m.specular,), "surface_texture", (0,)),
        "roughness": roughness,
        "metallic": _value_need("metallic", scene, used, lambda m: (m.metallic,), "surface_texture", (2,)),
    }


def _colored_need(scene: SceneDescription) -> Need | None:
    """Of albedo, where vertex colours that are not white multiply a base colour that is not black."""
    for item in scene.objects:
        material, colors = scene.materials[item.material], scene.meshes[item.mesh].colors
        tints = material.vertex_colors == "base_color" and any(material.base_color)
        if colors is not None and tints and (colors[:, :3] != 1).any():
            return Need(channel="albedo", needed=True, why=f"vertex colours of {scene.meshes[item.mesh].name}")
    return None


def _value_need(channel: str, scene: SceneDescription, used: list[Material], value, slot: str, components) -> Need:
    """Needed where materials differ, or where a texture changes one of `components` of a slot: not where it is 1 all over."""
    values = sorted({tuple(float(np.clip(v, 0, 1)) for v in value(material)) for material in used})
    if len(values) > 1:
        return Need(channel=channel, needed=True, why=f"{len(values)} different values")
    for material in used:
        texture = getattr(material, slot) and scene.textures[getattr(material, slot).texture]
        if texture and any(values[0]) and any((texture.scale[k], texture.bias[k]) != (0, 1) for k in components):
            return Need(channel=channel, needed=True, why=f"textured in {material.name}")
    constant = values[0] if values else (0.0,) * len(components)
    return Need(channel=channel, needed=False, why="one value on all surfaces", constant=constant)


def _emission_need(scene: SceneDescription) -> Need:
    if scene.environment is not None and np.any(scene.environment.texels):
        return Need(channel="emission", needed=True, why="the sky shines")
    if any(any(material.emission) for material in scene.materials):
        return Need(channel="emission", needed=True, why="emissive materials")
    return Need(channel="emission", needed=False, why="nothing emits", constant=(0.0, 0.0, 0.0))


def _variance_need(plan: RenderPlan) -> Need:
    if plan.shading == "path":
        return Need(channel="color_variance", needed=True, why="light paths are random")
    return Need(channel="color_variance", needed=False, why="raster shading has no noise", constant=(0.0, 0.0, 0.0))


def _layer_need(channel: str, needed: bool, what: str) -> Need:
    why = f"there are {what}" if needed else f"no {what}"
    return Need(channel=channel, needed=needed, why=why, constant=None if needed else (0.0,))


def _looks_from_elsewhere(a: CameraSample, b: CameraSample) -> bool:
    """Whether what hides what may change between two cameras. Orthographic ones have parallel rays: turning is enough."""
    columns = slice(3, 4) if a.height is None else slice(0, 4)
    return not np.array_equal(a.world_from_camera[:3, columns], b.world_from_camera[:3, columns])


def _motion_needs(scene: SceneDescription, samples: Sequence[CameraSample]) -> dict[str, Need]:
    pairs = [(a, b) for a, b in zip(samples, samples[1:], strict=False) if a.shot == b.shot]
    lenses = [((a.fov_y, a.height, a.shift), (b.fov_y, b.height, b.shift)) for a, b in pairs]
    turns = any(not np.array_equal(a.world_from_camera, b.world_from_camera) for a, b in pairs)
    turns = turns or any(a != b for a, b in lenses)
    travels = any(_looks_from_elsewhere(a, b) for a, b in pairs)
    why = "objects move" if scene.moves else "the camera travels" if travels else "the camera turns or zooms"
    if not scene.moves and not turns:
        why = "nothing moves"
        return {
            "motion": Need(channel="motion", needed=False, why=why, constant=(0.0, 0.0)),
            "dual_motion": Need(channel="dual_motion", needed=False, why=why, same_as="motion"),
            "visibility": Need(channel="visibility", needed=False, why=why, constant=(7,)),
        }
    occludes = scene.moves or travels
    dual = Need(channel="dual_motion", needed=True, why=why)
    if not occludes:
        dual = Need(channel="dual_motion", needed=False, why="without parallax nothing occludes", same_as="motion")
    return {
        "motion": Need(channel="motion", needed=True, why=why),
        "dual_motion": dual,
        "visibility": Need(channel="visibility", needed=True, why=why),
    }
