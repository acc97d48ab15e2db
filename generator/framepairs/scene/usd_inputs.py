"""What drives an input of a surface shader: a constant, a texture, a primvar, or a network that is not read.

Sources: the UsdPreviewSurface specification, version 2.6 (UsdUVTexture, UsdPrimvarReader), and MaterialX 1.39's standard
nodes. A network is read where it is one image, or one primvar, changed component by component by constants (multiply, divide,
add, subtract, invert) and rearranged (extract, separate, swizzle, convert); a chain of constants is a constant.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdShade

from .description import Material, Texture
from .usd_networks import kind_of, node_of, source, uv_nodes, value, value_attribute
from .usd_textures import Sampled, TextureReader

COMPONENTS = {"r": (0,), "g": (1,), "b": (2,), "a": (3,), "rgb": (0, 1, 2), "rgba": (0, 1, 2, 3)}
WRAP = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp", "useMetadata": "repeat"}
ADDRESS = {"periodic": "repeat", "mirror": "mirror", "clamp": "clamp", "constant": "clamp"}  # MaterialX
LINEAR_SPACES = ("raw", "none", "data", "lin_rec709", "lin_rec709_scene", "identity")
SRGB_SPACES = ("srgb_texture", "srgb_rec709_scene", "sRGB")
SIZE = {"float": 1, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4, "vector2": 2, "color3FA": 3, "vector3FA": 3}
LETTERS = {letter: k for letters in ("rgba", "xyzw") for k, letter in enumerate(letters)}
DEPTH = 32  # nodes in a row beyond which a network, or one that feeds itself, is not read


@dataclass(frozen=True)
class Constant:
    value: tuple[float, ...]


@dataclass(frozen=True)
class Primvar:
    """A colour or opacity of the mesh. fallback: where the mesh has none."""

    name: str
    fallback: tuple[float, ...]


@dataclass(frozen=True)
class Unread:
    kind: str


Driven = Constant | Sampled | Primvar | Unread


def driven_by(
    shader: UsdShade.Shader, key: str, textures: TextureReader, *, color: bool = False, depth: int = 0
) -> Driven | None:
    """What drives an input, or None for a value of its own. color: an image of 8 bits whose colour space nobody names is
    sRGB. Raises InputError, naming material and input, for images that cannot be read."""
    found = source(shader, key)
    if found is None:
        return None
    node, output = found
    read = READERS.get(node_of(node))
    if read is None or depth > DEPTH:
        return Unread(kind_of(node))
    field = f"{shader.GetPath().GetParentPath()}.{key}"
    return read(Asked(node, output, textures, color, field, depth))


@dataclass(frozen=True, kw_only=True)
class ReadMaterial:
    """A material as its network gives it. at: of the time code to the material, None where it stays. codes: of its time
    samples. uv_names: primvars of Mesh.uv and, where there are two, Mesh.uv2. color, opacity: primvars of the RGB and the
    alpha of Mesh.colors."""

    material: Material
    at: Callable[[Usd.TimeCode], Material] | None = None
    codes: tuple[Usd.TimeCode, ...] = ()
    uv_names: tuple[str, ...] = ("st",)
    color: Primvar | None = None
    opacity: Primvar | None = None


@dataclass(frozen=True)
class Asked:
    """An output of a node that is to be read; see `driven_by`."""

    node: UsdShade.Shader
    output: str
    textures: TextureReader
    color: bool
    field: str
    depth: int

    def input(self, key: str, default: float | None = None) -> Driven:
        """What an input of the node is; its own value is a constant."""
        driven = driven_by(self.node, key, self.textures, color=self.color, depth=self.depth + 1)
        return driven or self._constant(value(self.node, key, default, sizes=(0, 1, 2, 3, 4)))

    def _constant(self, item) -> Driven:
        try:
            return Constant(tuple(np.atleast_1d(np.array(item, dtype=float)).tolist()))
        except (TypeError, ValueError):
            return self.unread()

    def unread(self) -> Unread:
        return Unread(kind_of(self.node))


def _uv_texture(asked: Asked) -> Driven:
    node = asked.node
    space = value(node, "sourceColorSpace", "auto")
    wrap = tuple(str(value(node, key) or "useMetadata") for key in ("wrapS", "wrapT"))
    scale, bias = tuple(value(node, "scale", (1.0,) * 4)), tuple(value(node, "bias", (0.0,) * 4))
    srgb = None if space == "auto" else space == "sRGB"
    components = COMPONENTS.get(asked.output, (0, 1, 2))
    return _sampled(asked, "st", srgb, tuple(WRAP.get(item, "repeat") for item in wrap), scale, bias, components)


def _image(asked: Asked) -> Driven:
    """ND_image and ND_tiledimage. Without a colour space, 8 bits of a colour are sRGB, as USD's `auto` has it."""
    node = asked.node
    attribute = value_attribute(node, "file")
    space = str(attribute.GetColorSpace()) if attribute else ""
    srgb = True if space in SRGB_SPACES else False if space in LINEAR_SPACES or "_color" not in kind_of(node) else None
    wrap = tuple(ADDRESS.get(str(value(node, key, "periodic")), "repeat") for key in ("uaddressmode", "vaddressmode"))
    size = SIZE.get(kind_of(node).split("_")[-1], 1)
    item = _sampled(asked, "texcoord", srgb, wrap, (1.0,) * 4, (0.0,) * 4, tuple(range(size)))
    is_known = space in ("", *SRGB_SPACES, *LINEAR_SPACES)
    said = () if is_known else (f"colour space {space} of {item.texture.name}: it is read as {_space(item.texture.srgb)}",)
    if node_of(node) == "tiledimage":
        item = replace(item, uv_nodes=(node, *item.uv_nodes))
    return replace(item, said=(*item.said, *said))


def _space(srgb: bool) -> str:
    return "sRGB" if srgb else "linear"


def _sampled(asked: Asked, uv_key: str, srgb: bool | None, wrap, scale, bias, components: tuple[int, ...]) -> Sampled:
    image, name, said = asked.textures.image(value_attribute(asked.node, "file"), asked.field)
    srgb = asked.color and image.is_srgb if srgb is None else srgb
    texels = asked.textures.decoded(image) if srgb and image.texels.dtype != np.uint8 else image.texels
    texture = Texture(name=name, texels=texels, srgb=srgb and texels is image.texels, wrap=wrap, scale=scale, bias=bias)
    nodes, uv_name, unread = uv_nodes(asked.node, uv_key)
    said += (f"uv through {unread}: it is read with {uv_name}",) if unread else ()
    return Sampled(
        texture=asked.textures.deduplicated(texture),
        components=components,
        uv_name=uv_name,
        uv_nodes=nodes,
        node=asked.node,
        said=said,
    )


def _primvar(asked: Asked) -> Driven:
    """Readers of colours and of opacity alone: what else a primvar may mean, meshes do not hold."""
    is_materialx = node_of(asked.node) == "geompropvalue"
    name = value(asked.node, "geomprop" if is_materialx else "varname")
    fallback = asked._constant(value(asked.node, "default" if is_materialx else "fallback", 0.0, sizes=(2, 3, 4)))
    if not name or isinstance(fallback, Unread):
        return asked.unread()
    return Primvar(str(name), fallback.value)


def _arithmetic(asked: Asked) -> Driven:
    """in1 (operation) in2, of which one at least is constant."""
    node = node_of(asked.node)
    neutral = 1.0 if node in ("multiply", "divide") else 0.0
    first, second = asked.input("in1", 0.0), asked.input("in2", neutral)
    operation = {"multiply": np.multiply, "divide": np.divide, "add": np.add, "subtract": np.subtract}[node]
    with np.errstate(divide="ignore", invalid="ignore"):
        if isinstance(first, Constant) and isinstance(second, Constant):
            return Constant(tuple(np.atleast_1d(operation(first.value, second.value)).tolist()))
        if isinstance(second, Constant):
            return _mapped(asked, first, lambda x: operation(x, second.value))
        if isinstance(first, Constant) and node != "divide":
            return _mapped(asked, second, lambda x: operation(first.value, x))
    return next((item for item in (first, second) if isinstance(item, Unread)), asked.unread())


def _invert(asked: Asked) -> Driven:
    amount = asked.input("amount", 1.0)
    return (
        _mapped(asked, asked.input("in", 0.0), lambda x: amount.value - x) if isinstance(amount, Constant) else asked.unread()
    )


def _normal_map(asked: Asked) -> Driven:
    """ND_normalmap: its input is encoded in [0, 1]."""
    item = _mapped(asked, asked.input("in"), lambda x: 2 * x - 1)
    strength = asked.input("scale", 1.0)
    if not isinstance(item, Sampled) or not isinstance(strength, Constant):
        return item if isinstance(item, Unread | Constant) else asked.unread()
    return replace(item, normal_scale=item.normal_scale * strength.value[0])


def _mapped(asked: Asked, item: Driven, function: Callable[[NDArray], NDArray]) -> Driven:
    """`item` under a function that is affine in each component."""
    if isinstance(item, Constant):
        return Constant(tuple(np.atleast_1d(function(np.array(item.value))).tolist()))
    if not isinstance(item, Sampled):
        return item if isinstance(item, Unread) else asked.unread()
    size = len(item.components)
    at_0, at_1 = (np.broadcast_to(function(np.full(size, x)), size) for x in (0.0, 1.0))
    scale, bias = np.array(item.texture.scale), np.array(item.texture.bias)
    slope, components = at_1 - at_0, list(item.components)
    if len(set(components)) < size and (np.ptp(slope) or np.ptp(at_0)):
        return asked.unread()  # one component that would take several values
    scale[components], bias[components] = slope * scale[components], slope * bias[components] + at_0
    texture = replace(item.texture, scale=tuple(scale.tolist()), bias=tuple(bias.tolist()))
    return replace(item, texture=asked.textures.deduplicated(texture))


def _extract(asked: Asked) -> Driven:
    return _chosen(asked, asked.input("in"), (int(value(asked.node, "index", 0)),))


def _separate(asked: Asked) -> Driven:
    return _chosen(asked, asked.input("in"), (LETTERS.get(asked.output.removeprefix("out"), 0),))


def _swizzle(asked: Asked) -> Driven:
    """By letters; 0 and 1 in them are not read."""
    letters = str(value(asked.node, "channels", ""))
    return _chosen(asked, asked.input("in"), tuple(LETTERS.get(letter, -1) for letter in letters))


def _convert(asked: Asked) -> Driven:
    """A float becomes all components of a colour; colours and vectors lose or gain their last one."""
    item, size = asked.input("in"), SIZE.get(kind_of(asked.node).split("_")[-1], 1)
    count = len(item.components) if isinstance(item, Sampled) else len(item.value) if isinstance(item, Constant) else size
    return _chosen(asked, item, tuple(0 if count == 1 else k for k in range(min(size, count) if count > 1 else size)))


def _chosen(asked: Asked, item: Driven, indices: tuple[int, ...]) -> Driven:
    """The components `indices` of an item."""
    if isinstance(item, Primvar) and indices == tuple(range(len(item.fallback))):
        return item
    has = item.value if isinstance(item, Constant) else item.components if isinstance(item, Sampled) else ()
    if not indices or not all(0 <= k < len(has) for k in indices):
        return item if isinstance(item, Unread) else asked.unread()
    chosen = tuple(has[k] for k in indices)
    return Constant(chosen) if isinstance(item, Constant) else replace(item, components=chosen)


def _same(asked: Asked) -> Driven:
    return asked.input("in")


READERS: dict[str, Callable[[Asked], Driven]] = {
    "UsdUVTexture": _uv_texture, "image": _image, "tiledimage": _image,
    "UsdPrimvarReader_float3": _primvar, "UsdPrimvarReader_float4": _primvar, "UsdPrimvarReader_float": _primvar,
    "UsdPrimvarReader": _primvar, "geompropvalue": _primvar,
    "multiply": _arithmetic, "divide": _arithmetic, "add": _arithmetic, "subtract": _arithmetic, "invert": _invert,
    "normalmap": _normal_map, "extract": _extract, "separate2": _separate, "separate3": _separate, "separate4": _separate,
    "swizzle": _swizzle, "convert": _convert, "dot": _same, "constant": lambda asked: asked.input("value", 0.0),
}  # fmt: skip
