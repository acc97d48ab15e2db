"""What all lights of UsdLux have in common: their radiance, what of them changes over time, and what is not drawn.

UsdLux (its LightAPI): a light emits radiance L = intensity * 2^exposure * color, tinted by the black body where
enableColorTemperature says so; `normalize` divides L by the light's surface area in world space, so that the power, pi L
times that area, no longer depends on the size.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdLux

from .usd_arrays import typed

EARLIEST = Usd.TimeCode.EarliestTime()
# Attributes of the radiance: their change over time is drawn.
OF_RADIANCE = frozenset(
    f"inputs:{name}" for name in ("intensity", "exposure", "color", "enableColorTemperature", "colorTemperature", "normalize")
)


@dataclass(frozen=True)
class LightAt:
    """A light's prim at a time. matrix: [4, 4] world from light then."""

    prim: Usd.Prim
    matrix: NDArray[np.float64]
    code: Usd.TimeCode

    @property
    def path(self) -> str:
        return str(self.prim.GetPath())

    def value(self, name: str):
        return value_of(self.prim, name, self.code)


def radiance_of(light: LightAt) -> NDArray[np.float64]:
    """[3], before `normalize`."""
    color = np.array(light.value("inputs:color"), dtype=float)
    if light.value("inputs:enableColorTemperature"):
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(light.value("inputs:colorTemperature")))
    return light.value("inputs:intensity") * 2.0 ** light.value("inputs:exposure") * color


def varying_attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """The attributes of a light that change over time, beside those that place and hide it."""
    varying = [item for item in prim.GetAttributes() if item.ValueMightBeTimeVarying() and item.GetName() != "visibility"]
    return [item for item in varying if not item.GetName().startswith("xformOp")]


def differences(prim: Usd.Prim) -> list[str]:
    """What the prim asks for and is not drawn, each a sentence."""
    return [f"{what} of {prim.GetPath()}{instead}" for what, instead in _differences(prim)]


def _differences(prim: Usd.Prim) -> Iterator[tuple[str, str]]:
    """(what is not drawn, what is drawn instead)."""
    light = UsdLux.LightAPI(prim)
    if light.GetFiltersRel().GetTargets():
        yield "light filters", ""
    for kind, name in (("diffuse", "inputs:diffuse"), ("specular", "inputs:specular")):
        if value_of(prim, name) != 1:
            yield f"{kind} multiplier {value_of(prim, name):g}", ""
    for what, collection in (("light", light.GetLightLinkCollectionAPI()), ("shadow", light.GetShadowLinkCollectionAPI())):
        chosen = collection.GetExcludesRel().GetTargets() or not collection.GetIncludeRootAttr().Get()
        if chosen:
            yield f"{what} linking", ": it concerns all objects"
    if prim.HasAPI(UsdLux.ShadowAPI):
        if not value_of(prim, "inputs:shadow:enable"):
            yield "shadow:enable = false", ": it casts shadows"
        if any(value_of(prim, "inputs:shadow:color")) or value_of(prim, "inputs:shadow:distance") >= 0:
            yield "colour or distance of shadows", ": they are black and long"
    if prim.HasAPI(UsdLux.ShapingAPI):
        if value_of(prim, "inputs:shaping:focus"):
            yield f"shaping:focus {value_of(prim, 'inputs:shaping:focus'):g}", ""
        if value_of(prim, "inputs:shaping:ies:file"):
            yield "IES profile", ""
        is_cut = value_of(prim, "inputs:shaping:cone:angle") < 90 or value_of(prim, "inputs:shaping:cone:softness") > 0
        if is_cut and not prim.IsA(UsdLux.SphereLight):
            yield "cone", ": it shines to its whole side"
    if prim.IsA(UsdLux.RectLight) and has_path(value_of(prim, "inputs:texture:file")):
        yield "texture", ": it shines evenly"
    if value_of(prim, "inputs:texture:format") not in (None, "automatic", "latlong"):
        yield f"texture format {value_of(prim, 'inputs:texture:format')}", ": it is read as latlong"
    if any(prim.HasAttribute(name) for name in ("intensity", "exposure", "color")):
        yield "attributes without `inputs:`, as before USD 21.02,", ""


def value_of(prim: Usd.Prim, name: str, code: Usd.TimeCode = EARLIEST):
    """The value of an attribute, None where there is none. Raises InputError naming the prim for one of another type."""
    attribute = prim.GetAttribute(name)
    return typed(attribute, code) if attribute else None


def has_path(asset) -> bool:
    return asset is not None and bool(asset.path)
