"""The materials of a varied scene: palettes of base colour and roughness, and what glows.

Hue and chroma are those of Oklab (Björn Ottosson, "A perceptual color space for image processing", 2020), whose matrices
stand below. On a textured material they act on the texels, in a texture of its own: a tint cannot turn the hue of stripes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .description import Material, SceneDescription, Slot, Texture, slots_of
from .images import linear_texels
from .variation_draws import Draws, matching
from .variation_file import Glow, Palette, Variation

LMS_FROM_RGB = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
LAB_FROM_CUBE_ROOTS = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
STRIP = 2**18  # texels that are turned at a time
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Turn:
    """Of a hue by degrees, and a factor of the chroma."""

    hue_deg: float
    saturation: float

    def __call__(self, rgb: NDArray) -> NDArray:
        """[..., 3] linear Rec. 709 at the same Oklab lightness; components below 0 become 0."""
        if self == Turn(0.0, 1.0):
            return rgb
        sine, cosine = np.sin(np.radians(self.hue_deg)), np.cos(np.radians(self.hue_deg))
        turn = np.eye(3)
        turn[1:, 1:] = self.saturation * np.array([[cosine, -sine], [sine, cosine]])
        roots = np.cbrt(np.maximum(rgb @ LMS_FROM_RGB.T, 0))
        mixed = np.linalg.inv(LAB_FROM_CUBE_ROOTS) @ turn @ LAB_FROM_CUBE_ROOTS
        return np.maximum((roots @ mixed.T) ** 3 @ np.linalg.inv(LMS_FROM_RGB).T, 0)


@dataclass
class _Textures:
    """The scene's textures, and those that are made; each is made once."""

    items: list[Texture]
    made: dict[tuple, int] = field(default_factory=dict)

    def turned(self, slot: Slot, turn: Turn, tint: Color) -> Slot:
        key = (slot.texture, turn, tint)
        if key not in self.made:
            self.made[key] = len(self.items)
            self.items.append(turned_texture(self.items[slot.texture], turn, tint))
        return replace(slot, texture=self.made[key])

    def peak(self, slot: Slot | None) -> float:
        """Of RGB, decoded; 1 without a texture."""
        if slot is None:
            return 1.0
        texture = self.items[slot.texture]
        return float(linear_texels(replace(texture, texels=texture.texels.max(axis=(0, 1), keepdims=True)))[..., :3].max())


def vary_materials(scene: SceneDescription, variation: Variation, seed: int, file: Path | None) -> SceneDescription:
    """The scene in other colours. Raises InputError for patterns that match nothing."""
    textures, names = _Textures(list(scene.textures)), [material.name for material in scene.materials]
    folds = scene.materials_at is None  # constants that change over time stay constants
    changes: dict[int, list[Callable[[Material], Material]]] = {}
    kept: dict[str, None] = {}
    for kind, rules, make in (("palettes", variation.palettes, _painted), ("emission", variation.emission, _glowing)):
        for number, rule in enumerate(rules):
            draws = Draws(seed, kind, number)
            for index in matching(rule.materials, names, file, f"{kind}.{number}.materials"):
                if scene.materials[index].bsdf is not None:
                    kept[names[index]] = None
                    continue
                now = _apply(changes.get(index, ()), scene.materials[index])
                changes.setdefault(index, []).append(make(rule, draws, now, textures, folds))

    def changed(materials: tuple[Material, ...]) -> tuple[Material, ...]:
        return tuple(_apply(changes.get(index, ()), material) for index, material in enumerate(materials))

    materials_at = scene.materials_at
    varied = replace(
        scene,
        materials=changed(scene.materials),
        materials_at=(lambda time_s: changed(materials_at(time_s))) if materials_at else None,
        not_read=(*scene.not_read, *(f"variation of {name}, which Mitsuba's own BSDF draws" for name in kept)),
    )
    return replace(varied, textures=_without_unused(scene, varied, textures.items))


def turned_texture(texture: Texture, turn: Turn, tint: Color) -> Texture:
    """The texture whose decoded RGB is turned after it is multiplied by `tint`; opacity stays. 8 bits stay 8 bits."""
    height, width = texture.texels.shape[:2]
    step = max(1, STRIP // width)
    strips = [texture.texels[top : top + step] for top in range(0, height, step)]
    decoded = [turn(linear_texels(replace(texture, texels=strip))[..., :3] * np.float32(tint)) for strip in strips]
    name, alpha = f"{texture.name} varied", (texture.scale[3], texture.bias[3])
    if texture.texels.dtype != np.uint8:
        values = np.concatenate(decoded).astype(np.float32)
        texels = np.concatenate([values, texture.texels[..., 3:].astype(np.float32)], axis=-1)
        return replace(texture, name=name, texels=texels, scale=(1, 1, 1, alpha[0]), bias=(0, 0, 0, alpha[1]))
    peak = max(1.0, *(float(strip.max()) for strip in decoded))
    texels = texture.texels.copy()
    texels[..., :3] = np.concatenate([np.round(255 * _encoded(strip / peak)) for strip in decoded])
    return replace(texture, name=name, texels=texels, srgb=True, scale=(peak,) * 3 + alpha[:1], bias=(0, 0, 0, alpha[1]))


def _encoded(linear: NDArray) -> NDArray:
    """sRGB codes in 0 to 1, IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def _apply(changes, material: Material) -> Material:
    for change in changes:
        material = change(material)
    return material


def _painted(rule: Palette, draws: Draws, old: Material, textures: _Textures, folds: bool):
    """The change of one material by one rule. old: the material as the rules before leave it."""
    name = old.name
    chosen = draws.one_of(rule.base_color, name, "base_color")
    slot, recolored = _recolored(rule, draws, name, chosen, old.base_color, old.base_texture, textures, folds)
    value, rougher = draws.within(rule.value, name, "value"), draws.within(rule.roughness, name, "roughness")
    peak = textures.peak(slot)

    def change(material: Material) -> Material:
        color = recolored(material.base_color)
        largest = float(color.max()) * peak
        limit = max(1.0, 1 / largest) if largest > 0 else 1.0  # reflectance stays below 1, or where the file has it
        color = tuple((color * min(value, limit)).tolist())
        return replace(material, base_color=color, base_texture=slot, roughness=min(material.roughness * rougher, 1.0))

    return change


def _glowing(rule: Glow, draws: Draws, old: Material, textures: _Textures, folds: bool):
    """The change of one material by one rule. old: the material as the rules before leave it."""
    name = old.name
    chosen = draws.one_of(rule.color, name, "color")
    slot, recolored = _recolored(rule, draws, name, chosen, old.emission, old.emission_texture, textures, folds)
    gain = 0.0 if draws.number(name, "dark") < rule.dark else draws.within(rule.gain, name, "gain")

    def change(material: Material) -> Material:
        return replace(material, emission=tuple((gain * recolored(material.emission)).tolist()), emission_texture=slot)

    return change


def _recolored(rule, draws: Draws, name: str, chosen: Color | None, constant: Color, slot: Slot | None, textures, folds: bool):
    """(the texture that is left, the change of its constant [3]). A colour chosen from a list replaces a constant without
    texture and multiplies one with a texture; a turn acts on the texels where there are some, times `constant` if it
    `folds` into them."""
    turn = Turn(draws.within(rule.hue_deg, name, "hue_deg"), draws.within(rule.saturation, name, "saturation"))
    if slot is None:
        return None, lambda color: turn(np.array(color if chosen is None else chosen, dtype=float))
    if turn == Turn(0.0, 1.0):
        return slot, lambda color: np.array(_tinted(color, chosen))
    slot = textures.turned(slot, turn, _tinted(constant, chosen) if folds else (1.0, 1.0, 1.0))
    return slot, lambda color: np.ones(3) if folds else np.array(_tinted(color, chosen))


def _tinted(color: Color, chosen: Color | None) -> Color:
    return tuple(float(v) for v in (color if chosen is None else np.multiply(color, chosen)))


def _without_unused(old: SceneDescription, new: SceneDescription, textures: list[Texture]) -> tuple[Texture, ...]:
    """The textures, with one texel each of those that no material reads any longer."""
    read = {slot.texture for material in new.materials for slot in slots_of(material)}
    gone = {slot.texture for material in old.materials for slot in slots_of(material)} - read
    gone |= set(range(len(old.textures), len(textures))) - read
    return tuple(replace(t, texels=t.texels[:1, :1]) if index in gone else t for index, t in enumerate(textures))
