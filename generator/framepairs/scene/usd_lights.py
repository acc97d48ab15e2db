"""Lights of USD stages (UsdLux) as Lights and Environments.

UsdLux (its LightAPI): a light emits radiance L = intensity * 2^exposure * color, tinted by the black body where
enableColorTemperature says so; `normalize` divides L by the light's surface area in world space, so that the power, pi L
times that area, no longer depends on the size.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Ar, Usd, UsdGeom, UsdLux

from ..errors import InputError
from .description import Environment, Light, Texture, rotation_from_y_up
from .images import decode_image, linear_texels

EARLIEST = Usd.TimeCode.EarliestTime()
HARD_SHADOW_DEGREES = 0.6  # diameter of a distant light above which its penumbra is missed; the sun's is 0.53
UNEQUAL = 1e-3  # relative difference of scales, and cosine between axes, above which a shape is told to be another one


# Attributes whose change over time is drawn; that of others is named.
FOLLOWED = {f"inputs:{name}" for name in ("intensity", "exposure", "color", "enableColorTemperature", "colorTemperature")}
FOLLOWED |= {f"inputs:{name}" for name in ("normalize", "angle", "width", "height", "radius")} | {"treatAsPoint"}


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
        return _value(self.prim, name, self.code)


@dataclass(frozen=True)
class ChangingLight:
    """A light that changes over time. shining: the light at some time when it shines. visible: of the time code to whether it
    is drawn; None: always."""

    prim: Usd.Prim
    shining: Light
    visible: Callable[[Usd.TimeCode], bool] | None

    def at(self, cache: UsdGeom.XformCache) -> Light:
        """The light at the cache's time: of radiance 0 while it is hidden, has no area or is of another kind than `shining`.
        Raises InputError as `read_light` does."""
        now = _light_at(self.prim, cache, [])
        if now is None or now.kind != self.shining.kind:
            return replace(self.shining, radiance=(0.0, 0.0, 0.0))
        if self.visible is not None and not self.visible(cache.GetTime()):
            return replace(now, radiance=(0.0, 0.0, 0.0))
        return now


def read_light(
    prim: Usd.Prim,
    moved_by: list[Usd.Attribute],
    visible: Callable[[Usd.TimeCode], bool] | None,
    not_read: list[str],
    files: list[Path],
) -> Light | ChangingLight | Environment | None:
    """The light of a prim with LightAPI, or None for a kind that is not drawn.

    moved_by: attributes that animate its transform. visible: of the time code, where its visibility changes. `not_read` and
    `files` grow. Distant lights become directional ones whatever their angle, with the irradiance of their cone; sphere
    lights become points where treatAsPoint says so or their radius is 0, and spots where ShapingAPI gives them a cone of
    less than 180 degrees off the axis. Environments are those of the earliest time. Raises InputError naming the prim for
    numbers that are not finite and for images that cannot be read.
    """
    path = str(prim.GetPath())
    varying = [a for a in prim.GetAttributes() if a.ValueMightBeTimeVarying() and a.GetName() != "visibility"]
    varying = [a for a in varying if not a.GetName().startswith("xformOp")]
    if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        if visible is not None:
            not_read.append(f"changing visibility of light {path}: it shines all the time")
        if moved_by or varying:
            not_read.append(f"motion of {path}: it shines as it begins")
        not_read += [f"{what} of {path}{instead}" for what, instead in _differences(prim)]
        return _dome(prim, np.array(UsdGeom.XformCache(EARLIEST).GetLocalToWorldTransform(prim)).T, files)
    if not any(prim.IsA(schema) for schema in READERS):
        not_read.append(f"{prim.GetTypeName()} {path}")
        return None
    followed = [*moved_by, *(a for a in varying if a.GetName() in FOLLOWED)]
    times = sorted({time for attribute in followed for time in attribute.GetTimeSamples()})
    said: list[str] = []
    lights = [_light_at(prim, UsdGeom.XformCache(code), said) for code in (EARLIEST, *map(Usd.TimeCode, times))]
    shining = next((item for item in lights if item), None)
    if shining is None:
        not_read.append(f"{prim.GetTypeName()} {path}: it has no area")
        return None
    not_read += {text.split(" light ")[0]: text for text in reversed(said)}.values()  # what first applies, once
    not_read += [f"kind of {path}, a {kind} at times: it is dark then" for kind in _kinds(lights) - {shining.kind}]
    unread = [a.GetName() for a in varying if a.GetName() not in FOLLOWED]
    not_read += [f"animation of {name} of {path}: it stays as it begins" for name in unread]
    not_read += [f"{what} of {path}{instead}" for what, instead in _differences(prim)]
    return ChangingLight(prim, shining, visible) if followed or visible is not None else shining


def _kinds(lights: list[Light | None]) -> set[str]:
    return {item.kind for item in lights if item}


def _light_at(prim: Usd.Prim, cache: UsdGeom.XformCache, not_read: list[str]) -> Light | None:
    """The light at the cache's time; None where it has no area."""
    read = next(reader for schema, reader in READERS.items() if prim.IsA(schema))
    light = LightAt(prim, np.array(cache.GetLocalToWorldTransform(prim)).T, cache.GetTime())
    item = read(light, not_read)
    if item and not np.isfinite([*item.radiance, *item.position, *item.direction]).all():
        raise InputError("light with a number that is not finite, or a scale of 0", field=light.path)
    return item


def _radiance(light: LightAt) -> NDArray[np.float64]:
    """[3], before `normalize`."""
    color = np.array(light.value("inputs:color"), dtype=float)
    if light.value("inputs:enableColorTemperature"):
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(light.value("inputs:colorTemperature")))
    return light.value("inputs:intensity") * 2.0 ** light.value("inputs:exposure") * color


def _distant(light: LightAt, not_read: list[str]) -> Light:
    """Normalized: intensity is the irradiance. Otherwise a disk of radiance L in the sky, pi L sin^2(angle / 2)."""
    degrees = light.value("inputs:angle")
    half_angle = min(math.radians(degrees) / 2, math.pi / 2)
    extent = 1.0 if light.value("inputs:normalize") or half_angle == 0 else math.pi * math.sin(half_angle) ** 2
    path = light.path
    if degrees > HARD_SHADOW_DEGREES:
        not_read.append(f"angle of distant light {path}, {degrees:g} degrees: its shadows are hard")
    direction = _shining_along(light.matrix)
    return Light(name=path, kind="directional", radiance=_tuple(_radiance(light) * extent), direction=direction)


def _sphere(light: LightAt, not_read: list[str]) -> Light:
    """A sphere of radius r and radiance L has the radiant intensity pi r^2 L to all sides, normalized L / 4.

    A point of radius 0 that is not normalized would shine with 0; it takes the normalized intensity, too.
    """
    path = light.path
    radiance, normalize, cone = _radiance(light), light.value("inputs:normalize"), _cone(light.prim)
    scales = np.linalg.svd(light.matrix[:3, :3], compute_uv=False)
    radius = float(light.value("inputs:radius") * np.prod(scales) ** (1 / 3))
    common = {"name": path, "position": tuple(light.matrix[:3, 3].tolist())}
    is_point = bool(light.value("treatAsPoint")) or radius == 0
    if radius > 0 and scales[0] > scales[2] * (1 + UNEQUAL):
        not_read.append(f"unequal scale of sphere light {path}: a sphere of its mean radius shines")
    if not is_point and cone is None:
        emitted = radiance / (4 * math.pi * radius**2) if normalize else radiance
        return Light(kind="sphere", radiance=_tuple(emitted), half_u=(radius, 0, 0), **common)
    intensity = _tuple(radiance / 4 if normalize or radius == 0 else radiance * math.pi * radius**2)
    if cone is None:
        return Light(kind="point", radiance=intensity, **common)
    if not is_point:
        not_read.append(f"radius of sphere light {path} with a cone: it shines from a point")
    return Light(kind="spot", radiance=intensity, direction=_shining_along(light.matrix), cone=cone, **common)


def _rectangle(light: LightAt, not_read: list[str]) -> Light | None:
    u = light.matrix[:3, 0] * light.value("inputs:width") / 2
    v = light.matrix[:3, 1] * light.value("inputs:height") / 2
    if abs(u @ v) > UNEQUAL * np.linalg.norm(u) * np.linalg.norm(v):
        not_read.append(f"shear of rect light {light.path}: a rectangle of its area shines")
    squared = u @ u
    return _flat(light, "rectangle", 4, u, v - u * (u @ v / squared) if squared else v)


def _disk(light: LightAt, not_read: list[str]) -> Light | None:
    """Its world shape is an ellipse, whose half axes are the singular vectors of the image of the disk's plane."""
    directions, lengths, _ = np.linalg.svd(light.matrix[:3, :2] * light.value("inputs:radius"), full_matrices=False)
    return _flat(light, "disk", math.pi, *(directions * lengths).T)


def _flat(light: LightAt, kind: str, area_factor: float, u: NDArray, v: NDArray) -> Light | None:
    """A light of area `area_factor` |u x v| that shines to the side of its -z axis; None where it has no area."""
    across = np.cross(u, v)
    size = float(np.linalg.norm(across))
    if size == 0:
        return None
    radiance = _radiance(light) / (area_factor * size if light.value("inputs:normalize") else 1)
    return Light(
        name=light.path,
        kind=kind,
        radiance=_tuple(radiance),
        position=_tuple(light.matrix[:3, 3]),
        direction=_tuple(across / (-size if across @ light.matrix[:3, 2] >= 0 else size)),
        half_u=_tuple(u),
        half_v=_tuple(v),
    )


READERS = {UsdLux.DistantLight: _distant, UsdLux.SphereLight: _sphere, UsdLux.RectLight: _rectangle, UsdLux.DiskLight: _disk}


def _cone(prim: Usd.Prim) -> tuple[float, float] | None:
    """Cosines of the inner and outer half angle at the earliest time, or None where nothing is cut off.

    ShapingAPI: no light beyond cone:angle; from (1 - softness) angle on it falls smoothly. Both borders are kept; between
    them our spot falls linearly in the cosine and UsdLux's as a smoothstep of the angle.
    """
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return None
    degrees, softness = _value(prim, "inputs:shaping:cone:angle"), _value(prim, "inputs:shaping:cone:softness")
    if degrees >= 180:
        return None
    outer = math.radians(max(degrees, 0))
    return math.cos(outer * (1 - min(max(softness, 0), 1))), math.cos(outer)


def _differences(prim: Usd.Prim) -> Iterator[tuple[str, str]]:
    """(what the prim asks for and is not drawn, what is drawn instead)."""
    light = UsdLux.LightAPI(prim)
    if light.GetFiltersRel().GetTargets():
        yield "light filters", ""
    for kind, name in (("diffuse", "inputs:diffuse"), ("specular", "inputs:specular")):
        if _value(prim, name) != 1:
            yield f"{kind} multiplier {_value(prim, name):g}", ""
    for what, collection in (("light", light.GetLightLinkCollectionAPI()), ("shadow", light.GetShadowLinkCollectionAPI())):
        chosen = collection.GetExcludesRel().GetTargets() or not collection.GetIncludeRootAttr().Get()
        if chosen:
            yield f"{what} linking", ": it concerns all objects"
    if prim.HasAPI(UsdLux.ShadowAPI):
        if not _value(prim, "inputs:shadow:enable"):
            yield "shadow:enable = false", ": it casts shadows"
        if any(_value(prim, "inputs:shadow:color")) or _value(prim, "inputs:shadow:distance") >= 0:
            yield "colour or distance of shadows", ": they are black and long"
    if prim.HasAPI(UsdLux.ShapingAPI):
        if _value(prim, "inputs:shaping:focus"):
            yield f"shaping:focus {_value(prim, 'inputs:shaping:focus'):g}", ""
        if _value(prim, "inputs:shaping:ies:file"):
            yield "IES profile", ""
        is_cut = _value(prim, "inputs:shaping:cone:angle") < 90 or _value(prim, "inputs:shaping:cone:softness") > 0
        if is_cut and not prim.IsA(UsdLux.SphereLight):
            yield "cone", ": it shines to its whole side"
    if prim.IsA(UsdLux.RectLight) and _has_path(_value(prim, "inputs:texture:file")):
        yield "texture", ": it shines evenly"
    if _value(prim, "inputs:texture:format") not in (None, "automatic", "latlong"):
        yield f"texture format {_value(prim, 'inputs:texture:format')}", ": it is read as latlong"
    if any(prim.HasAttribute(name) for name in ("intensity", "exposure", "color")):
        yield "attributes without `inputs:`, as before USD 21.02,", ""


def _dome(prim: Usd.Prim, matrix: NDArray, files: list[Path]) -> Environment:
    asset = _value(prim, "inputs:texture:file")
    texels = np.ones((1, 2, 3), dtype=np.float32)
    if _has_path(asset):
        opened = asset.resolvedPath and Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath))
        if not opened:
            raise InputError(f"missing texture {asset.path}", field=str(prim.GetPath()))
        decoded = decode_image(bytes(opened.GetBuffer()), asset.path)
        if "[" not in asset.resolvedPath:
            files.append(Path(asset.resolvedPath))
        texels = linear_texels(Texture(name=asset.path, texels=decoded, srgb=decoded.dtype == np.uint8))[..., :3]
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    rotation = np.divide(matrix[:3, :3], lengths, out=np.full((3, 3), np.nan), where=lengths > 0)
    if not np.isfinite(rotation).all():
        raise InputError("light with a number that is not finite, or a scale of 0", field=str(prim.GetPath()))
    environment = Environment(
        name=str(prim.GetPath()),
        texels=(texels * _radiance(LightAt(prim, matrix, EARLIEST))).astype(np.float32),
        world_from_environment=rotation,
    )
    if prim.IsA(UsdLux.DomeLight_1) and _pole(prim) == "Z":
        environment = replace(environment, world_from_environment=rotation @ rotation_from_y_up("Z"))
    return environment


def _pole(prim: Usd.Prim) -> str:
    """'Y' or 'Z': DomeLight_1's pole, by default the stage's up axis (DomeLight's is always Y)."""
    pole = str(UsdLux.DomeLight_1(prim).GetPoleAxisAttr().Get() or "scene")
    return str(UsdGeom.GetStageUpAxis(prim.GetStage())) if pole == "scene" else pole


def _shining_along(matrix: NDArray) -> tuple[float, float, float]:
    """World direction of the light's -z; not a number where its scale is 0."""
    length = np.linalg.norm(matrix[:3, 2])
    return _tuple(-matrix[:3, 2] / length) if length else (math.nan,) * 3


def _value(prim: Usd.Prim, name: str, code: Usd.TimeCode = EARLIEST):
    attribute = prim.GetAttribute(name)
    return attribute.Get(code) if attribute else None


def _has_path(asset) -> bool:
    return asset is not None and bool(asset.path)


def _tuple(vector: NDArray) -> tuple[float, ...]:
    return tuple(np.asarray(vector, dtype=float).tolist())
