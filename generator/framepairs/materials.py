"""Materials in one table: constants times textures, evaluated for any hit in one kernel."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from .backend import dr, mi
from .brdf import roughened
from .conventions import BrdfModel
from .mip_pyramids import COLOR, NORMAL, Role
from .scene.description import IDENTITY_UV, Material, SceneDescription, Slot, Texture
from .texels import Kind
from .textures import TextureSettings, TextureTable, build_textures, sample_each

SLOTS = ("base_texture", "surface_texture", "normal_texture", "emission_texture")
# Floats per material: base 3, opacity, specular, roughness, metallic, cutoff, emission 3, normal scale, whether vertex colours
# multiply the emission, whether it emits from the front alone, whether Mitsuba draws it, 1 free.
CONSTANTS = 16
ALPHA_CODE = {"opaque": 0, "mask": 1, "blend": 2}
NO_TEXTURE = 0xFFFFFFFF


@dataclass(frozen=True)
class MaterialTable:
    """constants: [16 M]. alpha: [M] code. slots: [4 M] texture indices. sets: [4 M] of texture coordinates, 0 or 1. uv:
    [24 M], a 2x3 matrix per slot. used: the slots that any material fills. masks, blends, moves_uv (has a uv transform),
    has_fronts (emits from its front alone): whether any material does. keeps: whether any is drawn by the BSDF of its
    file, which sees through itself, is met whole and has no F_beta of ours. model: what roughness means. normal_variance:
    whether what filtered normal maps lost becomes roughness."""

    constants: mi.Float
    alpha: mi.UInt32
    slots: mi.UInt32
    sets: mi.UInt32
    uv: mi.Float
    textures: TextureTable
    used: frozenset[str]
    masks: bool
    blends: bool
    moves_uv: bool
    has_fronts: bool
    keeps: bool
    model: BrdfModel
    normal_variance: bool


@dataclass(frozen=True)
class Footprint:
    """What a look-up covers: uv [2] and its derivatives per pixel in x and y, and the mip bias in levels. second: the same of
    the second set of texture coordinates. color: the vertices' [4]. None where no material, or no mesh, has them."""

    uv: mi.Point2f
    duv_dx: mi.Vector2f
    duv_dy: mi.Vector2f
    bias: mi.Float
    second: "Footprint | None" = None
    color: mi.Vector4f | None = None


@dataclass(frozen=True)
class Surface:
    """A material at a point: base_color, specular, roughness, metallic, emission, and the tangent-space normal."""

    base_color: mi.Color3f
    specular: mi.Float
    roughness: mi.Float
    metallic: mi.Float
    emission: mi.Color3f
    tangent_normal: mi.Vector3f


def build_materials(
    scene: SceneDescription,
    model: BrdfModel | None = None,
    settings: TextureSettings | None = None,
    keep_bsdfs: bool = False,
) -> MaterialTable:
    """The scene's materials, and a pyramid for each of their textures in each role that it plays. keep_bsdfs: those that
    have a BSDF of their own are drawn by it."""
    model, settings = model or BrdfModel(), settings or TextureSettings()
    materials = scene.materials or (Material(name="default"),)
    slots = [[getattr(material, name) for name in SLOTS] for material in materials]
    keeps = keep_bsdfs and any(material.bsdf is not None for material in materials)
    indices, pairs = _pyramids(scene, materials, settings)
    seen_through = (material.alpha != "opaque" for material in materials)
    with_alpha = set(compress(indices[:: len(SLOTS)], seen_through)) - {NO_TEXTURE}
    return MaterialTable(
        constants=_all_constants(materials, keeps),
        alpha=mi.UInt32(np.array([ALPHA_CODE[material.alpha] for material in materials], dtype=np.uint32)),
        slots=mi.UInt32(np.array(indices, dtype=np.uint32)),
        sets=mi.UInt32(np.array([0 if slot is None else slot.uv_set for row in slots for slot in row], dtype=np.uint32)),
        uv=_all_uv(materials),
        textures=build_textures(
            [texture for texture, _ in pairs], [role for _, role in pairs], settings.anisotropy, with_alpha
        ),
        used=frozenset(name for name in SLOTS if any(getattr(material, name) for material in materials)),
        masks=any(material.alpha == "mask" for material in materials),
        blends=any(material.alpha == "blend" for material in materials),
        moves_uv=scene.materials_at is not None
        or any(slot is not None and slot.uv != IDENTITY_UV for row in slots for slot in row),
        keeps=keeps,
        has_fronts=any(material.emits == "front" for material in materials),
        model=model,
        normal_variance=settings.normal_variance,
    )


def with_values(table: MaterialTable, materials: tuple[Material, ...]) -> MaterialTable:
    """The table with the constants and uv transforms of `materials`, which are otherwise those that it was built from."""
    return replace(table, constants=_all_constants(materials, table.keeps), uv=_all_uv(materials))


def opacity_of(table: MaterialTable, material: mi.UInt32, footprint: Footprint, active: mi.Bool) -> mi.Float:
    """Opacity in [0, 1]: 1 for opaque materials, 0 or 1 for masked ones."""
    return opacities_of(table, material, footprint, (footprint.bias,), active)[0]


def opacities_of(
    table: MaterialTable, material: mi.UInt32, footprint: Footprint, biases: Sequence[mi.Float], active: mi.Bool
) -> list[mi.Float]:
    """`opacity_of` with each of `biases` in place of the footprint's."""
    alpha = dr.gather(mi.UInt32, table.alpha, material, active)
    full, cutoff = (dr.gather(mi.Float, table.constants, material * CONSTANTS + k, active) for k in (3, 7))
    if footprint.color is not None:
        full *= footprint.color.w
    opaque, masked = alpha == ALPHA_CODE["opaque"], alpha == ALPHA_CODE["mask"]
    values = [full * texel for texel in _slot(table, "base_texture", material, footprint, biases, active & ~opaque, "alpha")]
    seen = [dr.select(masked, dr.select(value >= cutoff, mi.Float(1), 0), dr.clip(value, 0, 1)) for value in values]
    return [dr.select(opaque, 1, value) for value in seen]


def is_kept(table: MaterialTable, material: mi.UInt32, active: mi.Bool) -> mi.Bool:
    """Whether the material is drawn by the BSDF of its file."""
    return dr.gather(mi.Float, table.constants, material * CONSTANTS + 14, active) > 0


def bumps_by_second(table: MaterialTable, material: mi.UInt32, active: mi.Bool) -> mi.Bool:
    """Whether the material's normal map reads the second set of texture coordinates."""
    return dr.gather(mi.UInt32, table.sets, material * len(SLOTS) + SLOTS.index("normal_texture"), active) == 1


def bump_change(table: MaterialTable, material: mi.UInt32, change: mi.Vector2f, active: mi.Bool) -> mi.Vector2f:
    """A change of uv [2] after the transform of the material's normal map, whose x and y lie along the transformed uv."""
    place = material * len(SLOTS) + SLOTS.index("normal_texture")
    u, v = (dr.gather(mi.Vector3f, table.uv, place * 2 + row, active) for row in range(2))
    return mi.Vector2f(u.x * change.x + u.y * change.y, v.x * change.x + v.y * change.y)


def is_opaque(table: MaterialTable, material: mi.UInt32, active: mi.Bool) -> mi.Bool:
    return dr.gather(mi.UInt32, table.alpha, material, active) == ALPHA_CODE["opaque"]


def is_blended(table: MaterialTable, material: mi.UInt32, active: mi.Bool) -> mi.Bool:
    return dr.gather(mi.UInt32, table.alpha, material, active) == ALPHA_CODE["blend"]


def surface_of(table: MaterialTable, material: mi.UInt32, footprint: Footprint, active: mi.Bool) -> Surface:
    """The material's values; base colour, roughness, metallic and specular are clamped to [0, 1].

    Roughness grows by what the filtered normal map lost, so that a bumpy surface far away shines as its bumps together do.
    """
    return surfaces_of(table, material, footprint, (footprint.bias,), active)[0]


def surfaces_of(
    table: MaterialTable, material: mi.UInt32, footprint: Footprint, biases: Sequence[mi.Float], active: mi.Bool
) -> list[Surface]:
    """`surface_of` with each of `biases` in place of the footprint's."""
    constants = [dr.gather(mi.Vector4f, table.constants, material * 4 + k, active) for k in range(3)]
    tints = _tints(table, material, footprint, active)
    bases = _slot(table, "base_texture", material, footprint, biases, active)
    packed = _slot(table, "surface_texture", material, footprint, biases, active)
    emissions = _slot(table, "emission_texture", material, footprint, biases, active)
    normals = _slot(table, "normal_texture", material, footprint, biases, active, "normal")
    return [_surface(table, constants, tints, *each) for each in zip(bases, packed, emissions, normals, strict=True)]


def _surface(table: MaterialTable, constants, tints, base, packed, emission, bump) -> Surface:
    c0, c1, c2 = constants
    roughness, normal = dr.clip(c1.y * packed.y, 0, 1), mi.Vector3f(0, 0, 1)
    if "normal_texture" in table.used:
        normal = mi.Vector3f(bump.x * c2.w, bump.y * c2.w, bump.z)
        if table.normal_variance:
            roughness = roughened(table.model, roughness, bump.w * dr.square(c2.w))
    return Surface(
        base_color=mi.Color3f(*(dr.clip(c0[k] * base[k] * tints[0][k], 0, 1) for k in range(3))),
        specular=dr.clip(c1.x * packed.x, 0, 1),
        roughness=roughness,
        metallic=dr.clip(c1.z * packed.z, 0, 1),
        emission=mi.Color3f(*(dr.maximum(c2[k] * emission[k] * tints[1][k], 0) for k in range(3))),
        tangent_normal=normal,
    )


def emitted(
    table: MaterialTable, material: mi.UInt32, emission: mi.Color3f, outward: mi.Vector3f, ray: mi.Vector3f, active: mi.Bool
) -> mi.Color3f:
    """The part of `emission` [3] that a ray of this direction meets: none behind what emits from its front alone."""
    if not table.has_fronts:
        return emission
    front = dr.gather(mi.Float, table.constants, material * CONSTANTS + 13, active) > 0
    return dr.select(front & (dr.dot(outward, ray) > 0), 0, emission)


def _tints(table: MaterialTable, material: mi.UInt32, footprint: Footprint, active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f]:
    """What vertex colours multiply base colour and emission with."""
    if footprint.color is None:
        return mi.Color3f(1), mi.Color3f(1)
    color = mi.Color3f(footprint.color.x, footprint.color.y, footprint.color.z)
    glows = dr.gather(mi.Float, table.constants, material * CONSTANTS + 12, active) > 0
    return dr.select(glows, 1, color), dr.select(glows, color, 1)


@dr.syntax
def _slot(
    table: MaterialTable, name: str, material: mi.UInt32, footprint: Footprint, biases, active: mi.Bool, kind: Kind = "texel"
) -> list[mi.Vector4f] | list[mi.Float]:
    """The texel of a slot, or its alpha, for each bias; where the material leaves it empty, white or an unbent normal.
    Nothing is traced for a slot that no material fills, and nothing runs for groups of rays that do not need it."""
    texels = _empty(kind, len(biases))
    if dr.hint(name in table.used, mode="scalar"):
        place = material * len(SLOTS) + SLOTS.index(name)
        texture = dr.gather(mi.UInt32, table.slots, place, active)
        filled = active & (texture != NO_TEXTURE)
        if dr.hint(filled, exclude=[table, footprint, biases, name, kind]):
            texels = _sampled(table, texture, place, footprint, biases, filled, kind)
    return texels


def _empty(kind: Kind, count: int) -> list[mi.Vector4f] | list[mi.Float]:
    if kind == "alpha":
        return [mi.Float(1) for _ in range(count)]
    return [mi.Vector4f(1) if kind == "texel" else mi.Vector4f(0, 0, 1, 0) for _ in range(count)]


def _sampled(
    table: MaterialTable, texture: mi.UInt32, place: mi.UInt32, footprint: Footprint, biases, filled: mi.Bool, kind: Kind
) -> list[mi.Vector4f] | list[mi.Float]:
    uv, duv_dx, duv_dy = footprint.uv, footprint.duv_dx, footprint.duv_dy
    if footprint.second is not None:
        second = dr.gather(mi.UInt32, table.sets, place, filled) == 1
        pairs = ((uv, footprint.second.uv), (duv_dx, footprint.second.duv_dx), (duv_dy, footprint.second.duv_dy))
        uv, duv_dx, duv_dy = (dr.select(second, other, first) for first, other in pairs)
    if table.moves_uv:
        u, v = (dr.gather(mi.Vector3f, table.uv, place * 2 + row, filled) for row in range(2))

        def linear(vector) -> mi.Vector2f:
            return mi.Vector2f(u.x * vector.x + u.y * vector.y, v.x * vector.x + v.y * vector.y)

        uv, duv_dx, duv_dy = mi.Point2f(linear(uv) + mi.Vector2f(u.z, v.z)), linear(duv_dx), linear(duv_dy)
    return sample_each(table.textures, texture, uv, duv_dx, duv_dy, biases, filled, kind)


def _pyramids(
    scene: SceneDescription, materials: tuple[Material, ...], settings: TextureSettings
) -> tuple[list[int], list[tuple[Texture, Role]]]:
    """For each slot of each material its pyramid's index, and the pyramids; equal ones are one."""
    indices, pairs, known = [], [], {}
    for material in materials:
        for name in SLOTS:
            slot = getattr(material, name)
            if slot is None:
                indices.append(NO_TEXTURE)
                continue
            texture, role = scene.textures[slot.texture], _role(material, name, settings)
            key = (id(texture.texels), texture.srgb, texture.wrap, texture.scale, texture.bias, role)
            if key not in known:
                known[key] = len(pairs)
                pairs.append((texture, role))
            indices.append(known[key])
    return indices, pairs


def _role(material: Material, slot: str, settings: TextureSettings) -> Role:
    if slot == "normal_texture":
        return NORMAL
    masked = slot == "base_texture" and material.alpha == "mask" and settings.mask_coverage and material.opacity > 0
    return Role("mask", material.alpha_cutoff / material.opacity) if masked else COLOR


def _all_constants(materials: tuple[Material, ...], keeps: bool) -> mi.Float:
    return mi.Float(np.array([_constants(material, keeps) for material in materials], dtype=np.float32).ravel())


def _all_uv(materials: tuple[Material, ...]) -> mi.Float:
    slots = [[getattr(material, name) or Slot(texture=0) for name in SLOTS] for material in materials]
    return mi.Float(np.array([[slot.uv for slot in row] for row in slots], dtype=np.float32).ravel())


def _constants(material: Material, keeps: bool) -> list[float]:
    kept = keeps and material.bsdf is not None
    values = [*material.base_color, 1.0 if kept else material.opacity, material.specular, material.roughness, material.metallic]
    values += [material.alpha_cutoff, *material.emission, material.normal_scale]
    values += [float(material.vertex_colors == "emission"), float(material.emits == "front"), float(kept)]
    return values + [0.0] * (CONSTANTS - len(values))
