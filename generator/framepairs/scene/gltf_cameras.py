"""The cameras of a glTF's nodes (glTF 2.0, chapter 3.10)."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import InputError
from .description import CameraView, SceneCamera
from .gltf_document import Document
from .gltf_nodes import NodeTree, rigid_place


def read_cameras(document: Document, tree: NodeTree, nodes: Sequence[int], matrices: Callable) -> tuple[SceneCamera, ...]:
    """The cameras of `nodes`. matrices: of the time to parent_from_node and world_from_node of all nodes.

    The vertical field of view and height hold, whatever the aspect ratio. A node's scale and mirroring do not reach its
    camera. Raises InputError naming the camera.
    """
    found: list[SceneCamera] = []
    names: set[str] = set()
    for number in nodes:
        node = document.entry("nodes", number)
        if "camera" in node:
            index = node["camera"]
            source = document.entry("cameras", index)
            lens = _lens(source, {"file": document.file, "field": f"cameras[{index}]"})
            name = node.get("name") or source.get("name") or f"camera {index}"
            name = f"{name} (node {number})" if name in names else name
            names.add(name)
            found.append(SceneCamera(name=name, at=_view(matrices, number, lens), moves=bool(tree.moving[number])))
    return tuple(found)


def _view(matrices: Callable, number: int, lens: dict[str, float]) -> Callable[[float], CameraView]:
    return lambda time_s: CameraView(world_from_camera=rigid_place(matrices(float(time_s))[1][number]), **lens)


def _lens(source: dict[str, Any], where: dict) -> dict[str, float]:
    """The camera's field of view or height, near and far."""
    kind = source["type"]
    if kind not in ("perspective", "orthographic") or kind not in source:
        raise InputError(f"camera type {kind!r}: perspective or orthographic was expected, with its values", **where)
    values = source[kind]
    lens = {name: float(values[key]) for name, key in (("near", "znear"), ("far", "zfar")) if key in values}
    if kind == "perspective":
        lens["fov_y"] = float(values["yfov"])
        if not 0 < lens["fov_y"] < math.pi:
            raise InputError(f"yfov {values['yfov']:g}: an angle between 0 and pi was expected", **where)
    else:
        lens["height"] = 2 * abs(float(values["ymag"]))
        if not lens["height"] > 0:
            raise InputError("ymag is 0", **where)
    near = lens.get("near", 0.0)
    if near < 0 or (kind == "perspective" and "near" in lens and near == 0) or lens.get("far", math.inf) <= near:
        raise InputError(f"znear {near:g} and zfar {lens.get('far', math.inf):g}", **where)
    return lens
