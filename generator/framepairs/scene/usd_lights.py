"""Lights of USD stages (UsdLux) as Lights and Environments. Radiance and normalization: see usd_light_inputs."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux

from ..errors import InputError
from .description import Environment, Light, Texture, rotation_from_y_up
from .images import linear_texels
from .usd_light_inputs import EARLIEST, OF_RADIANCE, LightAt, differences, has_path, radiance_of, value_of, varying_attributes
from .usd_textures import TextureReader

HARD_SHADOW_DEGREES = 0.6  # diameter of a distant light above which its penumbra is missed; the sun's is 0.53
UNEQUAL = 1e-3  # relative difference of scales, and cosine between axes, above which a shape is told to be another one


# Attributes whose change over time is drawn; that of others is named.
FOLLOWED = OF_RADIANCE | {f"inputs:{name}" for name in ("angle", "width", "height", "radius")} | {"treatAsPoint"}


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
    images: TextureReader,
) -> Light | ChangingLight | Environment | None:
    """The light of a prim with LightAPI, or None for a kind that is not drawn.

    moved_by: attributes that animate its transform. visible: of the time code, where its visibility changes. `not_read` and
    `images` grow. Distant lights become directional ones whatever their angle, with the irradiance of their cone; sphere
    lights become points where treatAsPoint says so or their radius is 0, and spots where ShapingAPI gives them a cone of
    less than 180 degrees off the axis. Environments are those of the earliest time. Raises InputError naming the prim for
    numbers that are not finite and for images that cannot be read.
    """
    path = str(prim.GetPath())
    varying = varying_attributes(prim)
    if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        if visible is not None:
            not_read.append(f"changing visibility of light {path}: it shines all the time")
        if moved_by or varying:
            not_read.append(f"motion of {path}: it shines as it begins")
        not_read += differences(prim)
        return _dome(prim, np.array(UsdGeom.XformCache(EARLIEST).GetLocalToWorldTransform(prim)).T, images)
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
    not_read += differences(prim)
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


def _distant(light: LightAt, not_read: list[str]) -> Light:
    """Normalized: intensity is the irradiance. Otherwise a disk of radiance L in the sky, pi L sin^2(angle / 2)."""
    degrees = light.value("inputs:angle")
    half_angle = min(math.radians(degrees) / 2, math.pi / 2)
    extent = 1.0 if light.value("inputs:normalize") or half_angle == 0 else math.pi * math.sin(half_angle) ** 2
    path = light.path
    if degrees > HARD_SHADOW_DEGREES:
        not_read.append(f"angle of distant light {path}, {degrees:g} degrees: its shadows are hard")
    direction = _shining_along(light.matrix)
    return Light(name=path, kind="directional", radiance=_tuple(radiance_of(light) * extent), direction=direction)


def _sphere(light: LightAt, not_read: list[str]) -> Light:
    """A sphere of radius r and radiance L has the radiant intensity pi r^2 L to all sides, normalized L / 4.

    A point of radius 0 that is not normalized would shine with 0; it takes the normalized intensity, too.
    """
    path = light.path
    radiance, normalize, cone = radiance_of(light), light.value("inputs:normalize"), _cone(light.prim)
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
    radiance = radiance_of(light) / (area_factor * size if light.value("inputs:normalize") else 1)
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
    degrees, softness = value_of(prim, "inputs:shaping:cone:angle"), value_of(prim, "inputs:shaping:cone:softness")
    if degrees >= 180:
        return None
    outer = math.radians(max(degrees, 0))
    return math.cos(outer * (1 - min(max(softness, 0), 1))), math.cos(outer)


def _dome(prim: Usd.Prim, matrix: NDArray, images: TextureReader) -> Environment:
    texels = np.ones((1, 2, 3), dtype=np.float32)
    if has_path(value_of(prim, "inputs:texture:file")):
        image, name, _ = images.image(prim.GetAttribute("inputs:texture:file"), str(prim.GetPath()))
        texels = linear_texels(Texture(name=name, texels=image.texels, srgb=image.texels.dtype == np.uint8))[..., :3]
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    rotation = np.divide(matrix[:3, :3], lengths, out=np.full((3, 3), np.nan), where=lengths > 0)
    if not np.isfinite(rotation).all():
        raise InputError("light with a number that is not finite, or a scale of 0", field=str(prim.GetPath()))
    environment = Environment(
        name=str(prim.GetPath()),
        texels=(texels * radiance_of(LightAt(prim, matrix, EARLIEST))).astype(np.float32),
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


def _tuple(vector: NDArray) -> tuple[float, ...]:
    return tuple(np.asarray(vector, dtype=float).tolist())
