"""Mitsuba scenes as plain nested dictionaries: references resolved, sizes bounded, and values read with their checks.

An object is {"type": plugin name, "id": optional, parameter or child name: value}, as `mi.load_dict` takes it. Values are
bool, int, float, str, lists of numbers, and matrices as nested lists. Nothing here imports Mitsuba.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .mitsuba_spectra import EQUAL_ENERGY, emission_of_spectrum, reflectance_of_spectrum

DEEPEST = 32  # objects in objects
MOST_OBJECTS = 200_000  # references counted as often as they stand: nested ones could double without end
LUMINANCE = (0.212671, 0.715160, 0.072169)  # of Rec. 709, with Mitsuba's digits; how it reads a colour as a number
CONSTANTS = ("rgb", "srgb", "uniform", "spectrum", "d65")

_SHAPES = "obj ply serialized rectangle cube sphere disk cylinder instance shapegroup merge"
_SHAPES_NOT_DRAWN = "bsplinecurve linearcurve sdfgrid ellipsoids ellipsoidsmesh blender"
_BSDFS = """diffuse principled principledthin conductor roughconductor plastic roughplastic pplastic dielectric thindielectric
    roughdielectric twosided mask normalmap bumpmap blendbsdf hair measured measured_polarized polarizer retarder circular
    null"""
_EMITTERS = "area directionalarea point spot directional constant envmap projector sunsky timed_sunsky"
_SENSORS = "perspective thinlens orthographic batch distant irradiancemeter radiancemeter"
_TEXTURES = "bitmap checkerboard mesh_attribute volume rgb srgb uniform spectrum d65 blackbody regular irregular rawconstant"
_MEDIA = "homogeneous heterogeneous hg isotropic rayleigh sggx tabphase blendphase constvolume gridvolume"
_RENDERER = """path direct volpath volpathmis aov depth moment stokes ptracer hdrfilm specfilm independent stratified
    multijitter orthogonal ldsampler box tent gaussian mitchell catmullrom lanczos"""
KINDS: dict[str, str] = {
    name: kind
    for kind, names in (
        ("renderer", _RENDERER),
        ("medium", _MEDIA),
        ("texture", _TEXTURES),
        ("sensor", _SENSORS),
        ("emitter", _EMITTERS),
        ("bsdf", _BSDFS),
        ("shape not drawn", _SHAPES_NOT_DRAWN),
        ("shape", _SHAPES),
    )
    for name in names.split()
}


def resolved(scene: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of plain data in which {"type": "ref", "id": ...} is the object of that id (or, at the top, of that key).

    One object stays one object (`is`) however often it is referred to. Raises InputError naming the object for unknown and
    circular references, nesting deeper than 32, more than 200 000 objects, and values that are no plain data.
    """
    names: dict[str, Any] = {}
    for key, value in scene.items():
        if isinstance(value, Mapping):
            names[key] = value
    _collect_ids(scene, names, 0)
    return _Resolver(names).object(scene, 0)[0]


def _collect_ids(values: Mapping[str, Any], names: dict[str, Any], depth: int) -> None:
    if depth > DEEPEST:
        raise InputError(f"objects are nested deeper than {DEEPEST}")
    if isinstance(values.get("id"), str) and values.get("type") != "ref":
        if names.get(values["id"], values) is not values:
            raise InputError("two objects have this id", field=values["id"])
        names[values["id"]] = values
    for value in values.values():
        if isinstance(value, Mapping):
            _collect_ids(value, names, depth + 1)


class _Resolver:
    """Copies objects, each once; `done` holds (the original, its copy, how many objects it has, how deep they are)."""

    def __init__(self, names: dict[str, Any]) -> None:
        self.names = names
        self.done: dict[int, tuple[Any, dict, int, int]] = {}
        self.open: set[int] = set()

    def object(self, values: Mapping[str, Any], depth: int) -> tuple[dict[str, Any], int, int]:
        """The copy, the number of objects in it and its depth."""
        name = str(values.get("id") or values.get("type"))
        if id(values) in self.done:
            return self.done[id(values)][1:]
        if id(values) in self.open:
            raise InputError("refers to itself", field=name)
        if depth > DEEPEST:
            raise InputError(f"objects are nested deeper than {DEEPEST}", field=name)
        self.open.add(id(values))
        copy: dict[str, Any] = {}
        count, deepest = 1, 0
        for key, value in values.items():
            if isinstance(value, Mapping):
                copy[str(key)], more, below = self.object(self.target(value), depth + 1)
                count, deepest = count + more, max(deepest, below + 1)
            else:
                copy[str(key)] = _plain(value, f"{name}.{key}")
        if count > MOST_OBJECTS or deepest > DEEPEST:
            raise InputError(f"it holds {count} objects, {MOST_OBJECTS} are read, in {DEEPEST} levels", field=name)
        self.open.remove(id(values))
        self.done[id(values)] = (values, copy, count, deepest)
        return copy, count, deepest

    def target(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        if values.get("type") != "ref":
            return values
        wanted = values.get("id")
        if not isinstance(wanted, str) or wanted not in self.names:
            raise InputError(f"no object has the id {wanted!r}", field=str(wanted))
        found = self.names[wanted]
        if found.get("type") == "ref":
            raise InputError("a reference to a reference", field=wanted)
        return found


def _plain(value: Any, what: str) -> Any:
    value = getattr(value, "matrix", value)  # mi.ScalarTransform4f
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{type(value).__name__} is no plain data", field=what) from None
    if array.ndim == 3 and array.shape[-1] == 1:
        array = array[..., 0]
    return array.tolist()


def type_of(values: Mapping[str, Any], what: str = "an object") -> str:
    if not isinstance(values, Mapping) or not isinstance(values.get("type"), str):
        raise InputError(f"{what} without a type")
    return values["type"]


def kind_of(values: Mapping[str, Any]) -> str:
    """'shape', 'bsdf', 'emitter', ... by the plugin's name. Raises InputError for a name that Mitsuba 3.9 does not have."""
    name = type_of(values)
    if name not in KINDS:
        raise InputError(f"unknown type {name[:80]!r}")
    return KINDS[name]


def children(values: Mapping[str, Any], *kinds: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The objects in an object that are of these kinds, with their keys, in order."""
    for key, value in values.items():
        if isinstance(value, Mapping) and kind_of(value) in kinds:
            yield key, value


def number_of(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not abs(float_of(value)) < np.inf:
        raise InputError(f"{key} is {repr(value)[:80]}, a number is expected")
    return float(value)


def float_of(value: Any) -> float:
    """A number as float; NaN for an integer that none can hold."""
    try:
        return float(value)
    except OverflowError:
        return float("nan")


def number(values: Mapping[str, Any], key: str, default: float) -> float:
    return number_of(values.get(key, default), key)


def flag(values: Mapping[str, Any], key: str, default: bool = False) -> bool:
    value = values.get(key, default)
    if not isinstance(value, bool):
        raise InputError(f"{key} is {str(value)[:80]!r}, true or false is expected")
    return value


def vector(values: Mapping[str, Any], key: str, default: tuple[float, float, float]) -> NDArray[np.float64]:
    return np.array(rgb_of(values.get(key, default), key))


def rgb_of(value: Any, key: str) -> tuple[float, float, float]:
    """Three numbers, or one for all three."""
    given = value if isinstance(value, list | tuple | np.ndarray) else [value] * 3
    if len(given) != 3:
        raise InputError(f"{key} has {len(given)} components, 3 are expected")
    return tuple(number_of(component, key) for component in given)


def matrix(values: Mapping[str, Any], key: str = "to_world") -> NDArray[np.float64]:
    """[4, 4], the identity by default; its last row must be 0 0 0 1."""
    given = np.array(values.get(key, np.eye(4)), dtype=object)
    try:
        found = given.astype(float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (4, 4) or not np.isfinite(found).all() or not np.array_equal(found[3], [0, 0, 0, 1]):
        raise InputError(f"{key} is no finite affine 4x4 matrix")
    return found


def constant_color(value: Any, key: str, *, emits: bool = False) -> tuple[float, float, float] | None:
    """Linear Rec. 709 of a number, a triple or a spectrum, as Mitsuba's RGB variants have it; None for a texture.

    A uniform spectrum is grey as a reflectance; what it emits has equal energy at all wavelengths, which is no grey.
    """
    if not isinstance(value, Mapping):
        return rgb_of(value, key)
    kind = type_of(value, key)
    if kind not in CONSTANTS:
        return None
    if kind == "d65":
        inner = constant_color(value.get("color", value.get("value", 1.0)), key)
        scale = number(value, "scale", 1.0)
        return None if inner is None else tuple(scale * component for component in inner)
    given = value.get("value", value.get("color"))
    if kind != "spectrum":
        return rgb_of(given, key)
    if not isinstance(given, list | tuple):
        grey = number_of(given, key)
        return tuple(grey * part for part in EQUAL_ENERGY) if emits else (grey,) * 3
    pairs = np.array(given, dtype=float)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) < 2 or not np.isfinite(pairs).all():
        raise InputError(f"{key} is no list of wavelengths and values")
    if not (np.diff(pairs[:, 0]) > 0).all():
        raise InputError(f"wavelengths of {key} do not grow")
    return emission_of_spectrum(pairs) if emits else reflectance_of_spectrum(pairs)
