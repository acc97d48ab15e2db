"""KHR_lights_punctual: the lights of a glTF's nodes.

Source: KhronosGroup/glTF, extensions/2.0/Khronos/KHR_lights_punctual. Its lux and candela are taken as they stand for
irradiance and radiant intensity, as engines take them. Between a spot's angles the specification recommends the square of a
ramp in the cosine; ours is the ramp itself.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Light
from .gltf_document import Document
from .gltf_nodes import NodeTree, rigid_place

EXTENSION = "KHR_lights_punctual"
DEFAULT_OUTER = math.pi / 4


@dataclass(frozen=True)
class PlacedLights:
    """lights: at time 0. at: of the time in seconds to the same lights, None where none moves. not_read: as in a scene."""

    lights: tuple[Light, ...]
    at: Callable[[float], tuple[Light, ...]] | None
    not_read: tuple[str, ...]


def read_lights(document: Document, tree: NodeTree, nodes: Sequence[int], matrices: Callable) -> PlacedLights:
    """The lights of `nodes`. matrices: of the time to parent_from_node and world_from_node of all nodes.

    A node's scale changes no light. Raises InputError naming the light.
    """
    sources = document.json.get("extensions", {}).get(EXTENSION, {}).get("lights", [])
    found: list[tuple[int, Light]] = []
    said: dict[int, str] = {}
    for number in nodes:
        node = document.entry("nodes", number)
        if EXTENSION in node.get("extensions", {}):
            index = node["extensions"][EXTENSION]["light"]
            where = {"file": document.file, "field": f"extensions.{EXTENSION}.lights"}
            if index >= len(sources):
                raise InputError(f"node {number} names light {index}, there are {len(sources)}", **where)
            source = sources[index]
            name = node.get("name") or source.get("name") or f"light {index}"
            where["field"] += f"[{index}]"
            found.append((number, Light(name=name, **_values(source, where))))
            if "range" in source and source["type"] != "directional":
                said[index] = f"range {source['range']:g} of light {source.get('name') or index}: it shines without end"

    def at(time_s: float) -> tuple[Light, ...]:
        world = matrices(float(time_s))[1]
        return tuple(_placed(light, world[number]) for number, light in found)

    moves = any(tree.moving[number] for number, _ in found)
    return PlacedLights(at(0.0), at if moves else None, tuple(said.values()))


def _values(source: dict[str, Any], where: dict) -> dict[str, Any]:
    """A light's kind, radiance and cone."""
    color, intensity, kind = source.get("color", [1.0] * 3), source.get("intensity", 1.0), source["type"]
    if kind not in ("directional", "point", "spot"):
        raise InputError(f"light type {kind!r} is none of glTF's", **where)
    if min(*color, intensity) < 0:
        raise InputError(f"colour {color} and intensity {intensity:g}: they begin at 0", **where)
    values = {"kind": kind, "radiance": tuple(float(c * intensity) for c in color)}
    if kind == "spot":
        angles = source.get("spot", {})
        outer = angles.get("outerConeAngle", DEFAULT_OUTER)
        inner = min(angles.get("innerConeAngle", 0.0), outer)
        if not 0 <= inner or not 0 < outer <= math.pi / 2 + 1e-6:  # float32's pi / 2 is more than pi / 2
            raise InputError(f"cone from {inner:g} to {outer:g}: angles from 0 to pi / 2 were expected", **where)
        values["cone"] = math.cos(inner), math.cos(outer)
    return values


def _placed(light: Light, world_from_node: NDArray[np.float64]) -> Light:
    """The light at its node: it shines along the node's -z."""
    place = rigid_place(world_from_node)
    return replace(light, position=tuple(place[:3, 3].tolist()), direction=tuple((-place[:3, 2]).tolist()))
