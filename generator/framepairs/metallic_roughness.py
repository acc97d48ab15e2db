"""The BRDF of `brdf` as a Mitsuba plugin: for scenes of your own in Mitsuba, and to hold `path` against its integrators.

`register` makes it known; after that, `mi.load_dict({"type": "metallic_roughness", ...})` takes:

    base_color   texture or RGB, default 0.8
    roughness    texture or number, perceptual, default 0.5
    metallic     texture or number, default 0
    specular     texture or number, default 0.5; F0 = lerp(0.08 specular, base_color, metallic)
    visibility   "separable_smith" (default), "height_correlated" or "schlick_k"
    mapping      "squared" (default) or "linear"

The four textures are children of these names: `mi.traverse` finds and updates them. Surfaces are seen from both sides.
"""

from dataclasses import dataclass
from typing import get_args

from . import brdf
from .backend import dr, mi
from .conventions import BrdfModel, RoughnessMapping, Visibility
from .errors import InputError

DEFAULTS = {"base_color": 0.8, "roughness": 0.5, "metallic": 0.0, "specular": 0.5}
UP = mi.Vector3f(0, 0, 1)


class MetallicRoughness(mi.BSDF):
    """Component 0 is the diffuse lobe, component 1 the glossy one; a context may ask for either alone."""

    def __init__(self, properties: mi.Properties):
        super().__init__(properties)
        self.textures = {name: properties.get_texture(name, value) for name, value in DEFAULTS.items()}
        self.model = BrdfModel(
            _choice(properties, "visibility", get_args(Visibility)), _choice(properties, "mapping", get_args(RoughnessMapping))
        )
        flags = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        if any(texture.is_spatially_varying() for texture in self.textures.values()):
            flags |= mi.BSDFFlags.SpatiallyVarying
        self.m_components = [mi.BSDFFlags.DiffuseReflection | flags, mi.BSDFFlags.GlossyReflection | flags]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def traverse(self, callback):
        for name, texture in self.textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)

    def to_string(self):
        return f"MetallicRoughness[{self.model}, {self.textures}]"

    def sample(self, context, si, sample1, sample2, active=True):
        surface, wi = self._surface(si, active), _upwards(si.wi, si)
        chance = self._chance(context, surface, wi)
        is_specular = sample1 < chance
        specular = brdf.sample_specular(self.model, surface.roughness, UP, wi, sample2)
        wo = dr.select(is_specular, specular, mi.warp.square_to_cosine_hemisphere(sample2))
        value, density = self._value_and_density(context, surface, wi, wo)
        valid = active & (density > 0)
        drawn = dr.zeros(mi.BSDFSample3f)
        drawn.wo = _upwards(wo, si)
        drawn.pdf = dr.select(valid, density, 0)
        drawn.eta = 1.0
        kinds = mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DiffuseReflection
        drawn.sampled_type = dr.select(is_specular, *(mi.UInt32(+kind) for kind in kinds))
        drawn.sampled_component = dr.select(is_specular, mi.UInt32(1), mi.UInt32(0))
        return drawn, dr.select(valid, value / density, 0)

    def eval(self, context, si, wo, active=True):
        return self.eval_pdf(context, si, wo, active)[0]

    def pdf(self, context, si, wo, active=True):
        return self.eval_pdf(context, si, wo, active)[1]

    def eval_pdf(self, context, si, wo, active=True):
        surface = self._surface(si, active)
        value, density = self._value_and_density(context, surface, _upwards(si.wi, si), _upwards(wo, si))
        return dr.select(active, value, 0), dr.select(active, density, 0)

    def _surface(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> "_Surface":
        base_color = self.textures["base_color"].eval(si, active)
        metallic, roughness, specular = (self.textures[k].eval_1(si, active) for k in ("metallic", "roughness", "specular"))
        return _Surface(base_color, metallic, roughness, brdf.f0_of(base_color, metallic, specular))

    def _chance(self, context: mi.BSDFContext, surface: "_Surface", wi: mi.Vector3f) -> mi.Float:
        """Probability of the glossy lobe."""
        diffuse, glossy = _enabled(context)
        if diffuse and glossy:
            return brdf.specular_chance(surface.base_color, surface.metallic, surface.f0, wi.z)
        return mi.Float(1 if glossy else 0)

    def _value_and_density(
        self, context: mi.BSDFContext, surface: "_Surface", wi: mi.Vector3f, wo: mi.Vector3f
    ) -> tuple[mi.Color3f, mi.Float]:
        """BRDF times cosine, and the density of `sample`, of the lobes that the context asks for."""
        diffuse, glossy = _enabled(context)
        cosine, chance = dr.maximum(wo.z, 0), self._chance(context, surface, wi)
        value, density = mi.Color3f(0), (1 - chance) * cosine * dr.inv_pi
        if diffuse:
            value += (1 - surface.metallic) * surface.base_color * (cosine * dr.inv_pi)
        if glossy:
            value += brdf.evaluate_specular(self.model, surface.roughness, surface.f0, UP, wi, wo)
            density += chance * brdf.specular_density(self.model, surface.roughness, UP, wi, wo)
        return value, dr.select(diffuse or glossy, density, 0)


@dataclass(frozen=True)
class _Surface:
    """What the textures say at a hit."""

    base_color: mi.Color3f
    metallic: mi.Float
    roughness: mi.Float
    f0: mi.Color3f


def register() -> None:
    """Make `metallic_roughness` known to Mitsuba; may be called again."""
    mi.register_bsdf("metallic_roughness", MetallicRoughness)


def _choice(properties: mi.Properties, key: str, known: tuple[str, ...]) -> str:
    chosen = properties.get(key, known[0])
    if chosen not in known:
        raise InputError(f"must be one of {', '.join(known)}, not {chosen!r}", field=f"metallic_roughness.{key}")
    return chosen


def _enabled(context: mi.BSDFContext) -> tuple[bool, bool]:
    """Whether the context asks for the diffuse and for the glossy lobe."""
    flags = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection
    diffuse, glossy = (context.is_enabled(flag, component) for component, flag in enumerate(flags))
    return diffuse, glossy


def _upwards(direction: mi.Vector3f, si: mi.SurfaceInteraction3f) -> mi.Vector3f:
    """To the frame in which wi is above the surface, and back."""
    return mi.Vector3f(direction.x, direction.y, dr.mulsign(direction.z, si.wi.z))
