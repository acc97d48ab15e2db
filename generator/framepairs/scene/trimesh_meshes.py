"""What trimesh's loaders give, as meshes: their dictionaries of arrays, before trimesh makes objects of them.

A loader is given the bytes of one file and nothing to open others with.
"""

import logging
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .description import Mesh
from .images import decode_srgb

MOST_PARTS = 10_000  # meshes of one file, as each costs a mesh of the renderer; beyond them they are joined, or refused


logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it tells what it skips on stderr, with tracebacks


@dataclass(frozen=True)
class MeshFile:
    """What a file holds. materials: of each mesh the name, or None. libraries: what follows each mtllib of an OBJ file, as it
    stands there. image: the one that a PLY file names."""

    meshes: tuple[Mesh, ...]
    materials: tuple[str | None, ...]
    not_read: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()
    image: str | None = None


def loaded(loader: Callable[..., dict], file_obj: Any, **options: Any) -> dict[str, Any]:
    """What a loader of trimesh gives. Raises InputError for all that it raises; its caller adds the file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy's of numbers that do not fit or cannot be read
            return loader(file_obj, **options)
    except Exception as error:  # its loaders raise whatever they stumble over
        said = f"{type(error).__name__}: {error}"[:200]
        raise InputError(f"cannot be read, cut short or damaged ({said})") from None


def mesh_of(name: str, arrays: dict[str, Any], encoded: bool = True) -> Mesh:
    """A mesh of a loader's arrays, polygons as fans; colours of faces split the vertices.

    encoded: floats of colours are sRGB codes; integers always are. Raises InputError; its caller adds the file.
    """
    faces = _table(arrays.get("faces", np.zeros((0, 3), int)), f"faces of {name}")
    size = len(arrays["vertices"])
    outside = (faces < 0) | (faces >= size)
    if outside.any():
        count, first = outside.sum(), faces[outside][0]
        raise InputError(f"{count} of {faces.size} indices of faces of {name} outside 0 to {size - 1}, as {first}")
    inner = np.arange(1, faces.shape[1] - 1)
    fan = np.stack([np.zeros_like(inner), inner, inner + 1], axis=1)
    triangles = faces[:, fan].reshape(-1, 3)
    attributes = {
        "positions": _float32(arrays["vertices"], f"points of {name}", 3),
        "normals": _float32(arrays.get("vertex_normals"), f"normals of {name}", 3),
        "uv": _float32(getattr(arrays.get("visual"), "uv", None), f"texture coordinates of {name}", 2),
        "colors": _colors(arrays.get("vertex_colors"), encoded),
    }
    painted = _colors(arrays.get("face_colors"), encoded)
    if painted is not None and attributes["colors"] is None and len(painted) == len(faces):
        attributes = {key: None if values is None else values[triangles.reshape(-1)] for key, values in attributes.items()}
        attributes["colors"] = np.repeat(painted, 3 * len(fan), axis=0)
        triangles = np.arange(triangles.size).reshape(-1, 3)
    wrong = [key for key, values in attributes.items() if values is not None and len(values) != len(attributes["positions"])]
    if wrong:
        raise InputError(f"{wrong[0]} of {name}: not one for each vertex")
    return Mesh(name=name, faces=np.ascontiguousarray(triangles, dtype=np.uint32), **attributes)


def _table(values: Any, what: str) -> NDArray:
    """[rows, columns] of numbers. Raises InputError where they are no table."""
    values = np.asarray(values)
    if not values.size and values.ndim != 2:
        return np.zeros((0, 3), int)
    if values.ndim != 2 or values.dtype.kind not in "iuf":
        raise InputError(f"{what} are no table of numbers")
    return values


def _float32(values: Any, what: str, width: int) -> NDArray[np.float32] | None:
    """[V, width], contiguous. Raises InputError for another width, and with how many are not finite."""
    if values is None:
        return None
    values = _table(values, what)
    if values.shape[1] != width:
        raise InputError(f"{what} with other than {width} numbers each")
    with np.errstate(over="ignore"):
        rounded = np.ascontiguousarray(values, dtype=np.float32)
    finite = np.isfinite(rounded)
    if not finite.all():
        raise InputError(f"{(~finite).any(axis=1).sum()} of {len(rounded)} {what} are not finite")
    return rounded


def _colors(values: Any, encoded: bool) -> NDArray[np.float32] | None:
    """[V, 4] linear Rec. 709 and opacity from colours [V, 3 or 4], which are sRGB codes in 0 to 1 (beyond they are clipped)
    or linear. Codes of floats of which one is above 2 are taken to run from 0 to 255. Opacities that are all 0 count as none
    given: they would hide the whole mesh. Raises InputError with how many are not finite.
    """
    if values is None:
        return None
    values = _table(values, "colours")
    if values.dtype.kind in "iu":
        values, encoded = values / np.iinfo(values.dtype).max, True
    codes = _float32(values, "colours", values.shape[1])
    if encoded and codes.max(initial=0) > 2:
        codes = codes / 255
    rgb = decode_srgb(np.clip(codes[:, :3], 0, 1)) if encoded else np.maximum(codes[:, :3], 0)
    alpha = np.clip(codes[:, 3:4], 0, 1)
    return np.concatenate([rgb, alpha if alpha.any() else np.ones_like(rgb[:, :1])], axis=1)
