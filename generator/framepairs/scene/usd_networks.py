"""Shader networks of USD materials: what drives an input, its value at a time, and transforms of texture coordinates.

Sources: the UsdPreviewSurface specification, version 2.6 (UsdTransform2d), and MaterialX 1.39's standard nodes (place2d,
tiledimage, rotate2d, multiply, divide, add and subtract of 2-vectors).
"""

import math

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdShade

from ..errors import InputError

EARLIEST = Usd.TimeCode.EarliestTime()
PRIMVAR_OF_UV = "st"  # where no node names one, and of MaterialX's texcoord 0
INPUT_OF_UV = {"UsdTransform2d": "in", "place2d": "texcoord", "rotate2d": "in"}
ARITHMETIC = ("multiply", "divide", "add", "subtract")


def kind_of(shader: UsdShade.Shader) -> str:
    """The identifier of a shader node; '' where it has none."""
    return str(shader.GetIdAttr().Get() or "")


def node_of(shader: UsdShade.Shader) -> str:
    """The node's name without MaterialX's `ND_`, types and versions: `image` of `ND_image_color3`."""
    kind = kind_of(shader)
    return kind.removeprefix("ND_").split("_")[0] if kind.startswith("ND_") else kind


def source(shader: UsdShade.Shader, key: str) -> tuple[UsdShade.Shader, str] | None:
    """The shader that drives an input, through node graphs, and the name of its output."""
    attribute = shader.GetInput(key)
    for producer in attribute.GetValueProducingAttributes() if attribute else ():
        if UsdShade.Utils.GetType(producer.GetName()) == UsdShade.AttributeType.Output:
            return UsdShade.Shader(producer.GetPrim()), UsdShade.Utils.GetBaseNameAndType(producer.GetName())[0]
    return None


def value(shader: UsdShade.Shader, key: str, default=None, code: Usd.TimeCode = EARLIEST, sizes: tuple[int, ...] = ()):
    """The value of an input at a time, through interfaces of node graphs, or `default` where none is authored.

    Raises InputError naming the shader where it is no text, no number or no vector of such a size as the default is. sizes:
    of vectors that may stand for it, too (0: a number).
    """
    found = value_attribute(shader, key, code)
    item = found.Get(code) if found else default
    if default is None:
        return item
    given = np.asarray(item)
    wanted = "U" if isinstance(default, str) else "biuf"
    shapes = (np.shape(default), *((size,) if size else () for size in sizes))
    if given.dtype.kind not in wanted or given.shape not in shapes:
        raise InputError(f"{key} holds a value of another type", field=str(shader.GetPath()))
    return item


def value_attribute(shader: UsdShade.Shader, key: str, code: Usd.TimeCode = EARLIEST) -> Usd.Attribute | None:
    """The attribute that holds the value of an input, or None where none is authored."""
    attribute = shader.GetInput(key)
    sources = (*attribute.GetValueProducingAttributes(), attribute.GetAttr()) if attribute else ()
    return next((item for item in sources if item.Get(code) is not None), None)


def changing(shader: UsdShade.Shader) -> dict[str, list[Usd.Attribute]]:
    """The attributes that change over time behind each input that changes."""
    sources = {item.GetBaseName(): item.GetValueProducingAttributes() for item in shader.GetInputs()}
    varying = {key: [a for a in attributes if a.ValueMightBeTimeVarying()] for key, attributes in sources.items()}
    return {key: attributes for key, attributes in varying.items() if attributes}


def as_text(item) -> str:
    """A number or a tuple of numbers in a sentence."""
    return f"{item:g}" if isinstance(item, float | int) else f"({', '.join(f'{c:g}' for c in item)})"


def uv_nodes(shader: UsdShade.Shader, key: str) -> tuple[tuple[UsdShade.Shader, ...], str, str | None]:
    """What gives an input its texture coordinates: (the nodes that transform them, the last one applied first; the name of
    the primvar; the kind of a node that is not known, or None)."""
    nodes: list[UsdShade.Shader] = []
    found = source(shader, key)
    while found and (following := _input_of_uv(found[0])):
        nodes.append(found[0])
        found = source(found[0], following)
    name, unread = _primvar_of_uv(found[0]) if found else (PRIMVAR_OF_UV, None)
    return tuple(nodes), name, unread


def _input_of_uv(shader: UsdShade.Shader) -> str | None:
    """The input of a transforming node through which the coordinates come, or None for another node."""
    node = node_of(shader)
    if node in INPUT_OF_UV:
        return INPUT_OF_UV[node]
    if node in ARITHMETIC and "_vector2" in kind_of(shader):
        connected = [key for key in ("in1", "in2") if source(shader, key)]
        if len(connected) == 1 and (connected == ["in1"] or node in ("multiply", "add")):
            return connected[0]
    return None


def _primvar_of_uv(shader: UsdShade.Shader) -> tuple[str, str | None]:
    node = node_of(shader)
    if node == "texcoord":
        index = int(value(shader, "index", 0))
        return f"{PRIMVAR_OF_UV}{index or ''}", None
    if node == "geompropvalue":
        return str(value(shader, "geomprop", PRIMVAR_OF_UV) or PRIMVAR_OF_UV), None
    if node in ("UsdPrimvarReader", "UsdPrimvarReader_float2"):
        return str(value(shader, "varname", PRIMVAR_OF_UV) or PRIMVAR_OF_UV), None
    return PRIMVAR_OF_UV, kind_of(shader)


def uv_matrix(nodes: tuple[UsdShade.Shader, ...], code: Usd.TimeCode = EARLIEST) -> tuple[tuple[float, ...], ...]:
    """Rows of the 2x3 matrix that transforms texture coordinates through `nodes`, the last one applied first."""
    total = np.eye(3)
    for node in nodes:
        total = total @ _matrix_of(node, code)
    return tuple(tuple(row) for row in total[:2].tolist())


def _matrix_of(shader: UsdShade.Shader, code: Usd.TimeCode) -> NDArray[np.float64]:
    node = node_of(shader)

    def pair(key: str, default: float) -> NDArray[np.float64]:
        return np.array(value(shader, key, default, code, sizes=(2,)), dtype=float) * np.ones(2)

    if node == "UsdTransform2d":
        angle = float(value(shader, "rotation", 0.0, code))
        return _shift(pair("translation", 0)) @ _turn(angle) @ _scale(pair("scale", 1))
    if node == "rotate2d":
        return _turn(-float(value(shader, "amount", 0.0, code)))
    if node == "tiledimage":
        tiles = pair("realworldtilesize", 1) / pair("realworldimagesize", 1)
        return _scale(tiles) @ _shift(-pair("uvoffset", 0)) @ _scale(pair("uvtiling", 1))
    if node == "place2d":
        size, turn = _scale(1 / pair("scale", 1)), _turn(-float(value(shader, "rotate", 0.0, code)))
        shift, pivot = _shift(-pair("offset", 0)), pair("pivot", 0)
        ordered = size @ turn @ shift if value(shader, "operationorder", 0, code) else shift @ turn @ size
        return _shift(pivot) @ ordered @ _shift(-pivot)
    factor = pair("in2" if source(shader, "in1") else "in1", 1.0 if node in ("multiply", "divide") else 0.0)
    return {
        "multiply": lambda: _scale(factor),
        "divide": lambda: _scale(1 / factor),
        "add": lambda: _shift(factor),
        "subtract": lambda: _shift(-factor),
    }[node]()


def _scale(factors: NDArray) -> NDArray[np.float64]:
    return np.diag([*factors, 1.0])


def _shift(offset: NDArray) -> NDArray[np.float64]:
    return np.array([[1, 0, offset[0]], [0, 1, offset[1]], [0, 0, 1]], dtype=float)


def _turn(degrees: float) -> NDArray[np.float64]:
    """Counter-clockwise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
