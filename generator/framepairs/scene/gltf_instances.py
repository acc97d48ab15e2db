"""EXT_mesh_gpu_instancing: one node's mesh drawn many times (KhronosGroup/glTF, extensions/2.0/Vendor)."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .gltf_accessors import read_numbers
from .gltf_animation import REST, unit
from .gltf_document import Document
from .gltf_nodes import transforms_of

EXTENSION = "EXT_mesh_gpu_instancing"
TYPES = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}


def read_instances(document: Document, node: int) -> NDArray[np.float64] | None:
    """node_from_instance [instances, 4, 4]; None for a node without the extension. Raises InputError naming the node."""
    values = document.entry("nodes", node).get("extensions", {}).get(EXTENSION)
    if values is None:
        return None
    where = {"file": document.file, "field": f"nodes[{node}].extensions.{EXTENSION}"}
    given = {path: values["attributes"].get(path.upper()) for path in TYPES}
    found = {path: read_numbers(document, index, TYPES[path]) for path, index in given.items() if index is not None}
    counts = {len(array) for array in found.values()}
    if len(counts) != 1:
        raise InputError(f"attributes of {sorted(counts)} instances", **where)
    (count,) = counts
    document.spend(512 * count, where["field"])
    parts = {path: np.array(found.get(path, np.tile(rest, (count, 1))), dtype=float) for path, rest in REST.items()}
    if not parts["rotation"].any(axis=1).all():
        raise InputError("a rotation of length 0", **where)
    parts["rotation"] = unit(parts["rotation"])
    return transforms_of(**parts)
