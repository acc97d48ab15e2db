"""Mitsuba's emitters as lights, environments and emission."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from .description import Environment, Light
from .images import linear_texels
from .mitsuba_dictionary import constant_color, flag, kind_of, matrix, number, vector
from .mitsuba_textures import TextureReader

PARAMETERS = {
    "point": ("intensity", "position", "to_world"),
    "spot": ("intensity", "cutoff_angle", "beam_width", "to_world"),
    "directional": ("irradiance", "direction", "to_world"),
    "constant": ("radiance", "to_world"),
    "envmap": ("filename", "scale", "to_world", "mis_compensation"),
    "area": ("radiance", "sampling_weight"),
}


def light_of(values: Mapping[str, Any], name: str) -> tuple[Light | None, tuple[str, ...]]:
    """A point, spot or directional light, or None for other emitters; and what is not drawn of it.

    A spot is linear in the angle between `beam_width` and `cutoff_angle`; ours is linear in the cosine.
    """
    kind = values["type"]
    if kind not in ("point", "spot", "directional"):
        return None, (f"emitter {kind} {name}",)
    said = tuple(_unknown(values, name))
    world = matrix(values)
    key = "irradiance" if kind == "directional" else "intensity"
    radiance = constant_color(values.get(key, 1.0), key, emits=True)
    if radiance is None:
        return None, (*said, f"emitter {kind} {name}: {key} through {values[key]['type']}")
    if kind == "point":
        position = vector(values, "position", (0, 0, 0)) if "position" in values else world[:3, 3]
        return Light(name=name, kind="point", radiance=radiance, position=tuple(position.tolist())), said
    if kind == "directional" and "direction" in values:
        direction = _unit(vector(values, "direction", (0, 0, 1)), "direction")
    else:
        direction = _unit(world[:3, 2], "to_world")
    if kind == "directional":
        return Light(name=name, kind="directional", radiance=radiance, direction=direction), said
    cutoff = number(values, "cutoff_angle", 20.0)
    beam = number(values, "beam_width", cutoff * 0.75)
    if not 0 <= beam <= cutoff <= 180:
        raise InputError(f"beam_width {beam:g} and cutoff_angle {cutoff:g}, 0 <= beam_width <= cutoff_angle is expected")
    soft = (f"falloff of spot {name}: it is linear in the cosine, not in the angle",) if beam < cutoff else ()
    return Light(
        name=name,
        kind="spot",
        radiance=radiance,
        position=tuple(world[:3, 3].tolist()),
        direction=direction,
        cone=(float(np.cos(np.radians(beam))), float(np.cos(np.radians(cutoff)))),
    ), (*said, *soft)


def environment_of(values: Mapping[str, Any], name: str, parts: TextureReader) -> tuple[Environment, tuple[str, ...]]:
    """Of a `constant` or `envmap` emitter.

    Mitsuba's first and last row of texels lie at the poles, ours half a row from them: rows are interpolated anew. Its image
    otherwise runs as ours does. Raises InputError for what cannot be read and for a `to_world` that is no rotation.
    """
    said = tuple(_unknown(values, name))
    if values["type"] == "constant":
        color = constant_color(values.get("radiance", 1.0), "radiance", emits=True)
        if color is None:
            raise InputError("radiance is no colour", field=name)
        return Environment(name=name, texels=np.tile(np.float32(color), (1, 2, 1))), said
    texture, _ = parts.bitmap(values, "envmap")
    texels = linear_texels(texture)[..., :3]
    rotation = matrix(values)[:3, :3]
    lengths = np.linalg.norm(rotation, axis=0)
    if not (lengths > 0).all():
        raise InputError("to_world is no rotation", field=name)
    rotation = rotation / lengths
    if not np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-5) or np.linalg.det(rotation) < 0:
        raise InputError("to_world is no rotation", field=name)
    height = len(texels)
    rows = np.clip((np.arange(height) + 0.5) / height * (height - 1), 0, max(height - 1, 0))
    low = np.minimum(rows.astype(int), max(height - 2, 0))
    weight = np.float32(rows - low)[:, None, None]
    high = np.minimum(low + 1, height - 1)
    texels = (1 - weight) * texels[low] + weight * texels[high]
    with np.errstate(over="ignore"):  # infinite texels are told and limited where a scene is lit
        scaled = texels * np.float32(number(values, "scale", 1.0))
    flag(values, "mis_compensation")
    return Environment(name=name, texels=scaled, world_from_environment=rotation), said


def emission_of(values: Mapping[str, Any], name: str, parts: TextureReader) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Fields of a Material that an `area` emitter on a shape sets, none for other emitters; and what is not drawn. One of
    `sampling_weight` 0 glows as other emissive surfaces do: in `raster` it lights nothing unless the plan has `mesh_lights`."""
    if kind_of(values) != "emitter":
        raise InputError(f"{values['type']} is no emitter")
    if values["type"] != "area":
        return {}, (f"emitter {values['type']} of {name}",)
    radiance, slot = parts.color(values, "radiance", 1.0, emits=True)
    shines = number(values, "sampling_weight", 1.0) > 0
    fields = {"emission": radiance, "emission_texture": slot, "emits": "front", "shines": shines}
    return fields, tuple(_unknown(values, name))


def _unknown(values: Mapping[str, Any], name: str) -> list[str]:
    return [f"property {key} of {name}" for key in values if key not in (*PARAMETERS[values["type"]], "type", "id")]


def _unit(given: np.ndarray, what: str) -> tuple[float, float, float]:
    length = np.linalg.norm(given)
    if not 0 < length < np.inf:
        raise InputError(f"{what} gives no direction")
    return tuple((given / length).tolist())
