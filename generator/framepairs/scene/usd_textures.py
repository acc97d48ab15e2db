"""Images that USD materials name, read once each and no further than the scene may reach, and the slots they fill."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Ar, Sdf, Usd, UsdShade

from ..errors import InputError
from .containment import Reach, within
from .description import Slot, Texture
from .images import decode_image, decode_srgb, pack_channels
from .usd_networks import PRIMVAR_OF_UV, changing, uv_matrix, value

UDIM = "<UDIM>"
FIRST_TILE = "1001"
GRAY_MODES = ("1", "L", "LA")  # of 8 bits, with one channel beside opacity


@dataclass(frozen=True, kw_only=True)
class Sampled:
    """A texture behind an input. components: of the texture, one for each of the input's. uv_name: primvar of its texture
    coordinates; uv_nodes: what transforms them, the last one applied first. node: the shader that names the image.
    normal_scale: of a normal map. said: what of it is not drawn."""

    texture: Texture
    components: tuple[int, ...]
    uv_name: str
    uv_nodes: tuple[UsdShade.Shader, ...]
    node: UsdShade.Shader
    normal_scale: float = 1.0
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImageFile:
    """texels: as of `decode_image`. is_srgb: of 8 bits and in colour, which USD's `auto` takes for sRGB."""

    texels: NDArray
    is_srgb: bool


class TextureReader:
    """Reads the images of one stage; `textures` (those that slots use) and `files` grow.

    reach: what may be opened; None: everything.
    """

    def __init__(self, reach: Reach | None) -> None:
        self.textures: list[Texture] = []
        self.files: list[Path] = []
        self._reach = reach
        self._images: dict[str, ImageFile] = {}
        self._decoded: dict[int, NDArray] = {}
        self._known: list[Texture] = []

    def image(self, attribute: Usd.Attribute | None, field: str) -> tuple[ImageFile, str, tuple[str, ...]]:
        """(the image that an attribute names, its name, what of it is not read). Raises InputError naming `field`."""
        asset = attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            raise InputError("texture without a file", field=field)
        layer = attribute.GetPropertyStack(Usd.TimeCode.EarliestTime())[0].layer
        resolved, said = asset.resolvedPath, ()
        if UDIM in asset.path:
            resolved = _resolved(asset.path.replace(UDIM, FIRST_TILE), layer)
            said = (f"tiles of {asset.path}: {FIRST_TILE} is drawn everywhere",)
        key = f"{resolved} in {package_of(layer.realPath or layer.identifier)}"
        if key not in self._images:
            data = self.read(resolved, asset.path, layer, field)
            texels = decode_image(data, asset.path)
            self._images[key] = ImageFile(texels, texels.dtype == np.uint8 and not _is_gray(data))
        return self._images[key], asset.path, said

    def decoded(self, image: ImageFile) -> NDArray[np.float32]:
        """The texels of more than 8 bits of an image whose colours are sRGB, decoded."""
        if id(image) not in self._decoded:
            self._decoded[id(image)] = decode_srgb(image.texels)
        return self._decoded[id(image)]

    def read(self, resolved: str, name: str, layer: Sdf.Layer, field: str) -> bytes:
        """The bytes of a file that `layer` names. Raises InputError where it is missing or out of reach."""
        if not resolved:
            raise InputError(f"missing texture {name}", field=field)
        package, own = package_of(resolved), package_of(layer.realPath or layer.identifier)
        if self._reach is not None:
            within(self._reach, package or resolved, field=field)
            if own and package != own and not self._reach.outside:
                raise InputError(f"{name} lies outside its package {Path(own).name}", field=field)
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
        if not opened:
            raise InputError(f"missing texture {name}", field=field)
        if not package:
            self.files.append(Path(resolved))
        return bytes(opened.GetBuffer())

    def deduplicated(self, texture: Texture) -> Texture:
        """`texture`, or an equal one that is known."""
        for other in self._known:
            if other.texels is texture.texels and _settings(other) == _settings(texture):
                return other
        self._known.append(texture)
        return texture

    def slot(self, texture: Texture | None) -> Slot | None:
        """A slot with a texture, which is from now on one of `textures`."""
        if texture is None:
            return None
        index = next((index for index, other in enumerate(self.textures) if other is texture), len(self.textures))
        self.textures += [texture] if index == len(self.textures) else []
        return Slot(texture=index)

    def color_slot(self, name: str, color: Sampled | None) -> Slot | None:
        """RGB."""
        if color is None or color.components[:3] == (0, 1, 2):
            return self.slot(color.texture if color else None)
        return self.slot(pack_channels(name, {k: (color.texture, _component(color, k)) for k in range(3)}))

    def base_slot(self, name: str, color: Sampled | None, opacity: Sampled | None, opaque: bool) -> Slot | None:
        """RGB of `color` and A of `opacity`, which may be missing; opaque: A is not looked at."""
        if opacity is None and (color is None or opaque):
            return self.color_slot(name, color)
        if opacity is None:
            texture = color.texture
            one = replace(texture, scale=(*texture.scale[:3], 0.0), bias=(*texture.bias[:3], 1.0))
            return self.color_slot(name, replace(color, texture=self.deduplicated(one)))
        white = replace(opacity.texture, scale=(0,) * 4, bias=(1,) * 4)
        rgb = {k: (color.texture, _component(color, k)) if color else (white, 0) for k in range(3)}
        packed = pack_channels(name, {**rgb, 3: (opacity.texture, opacity.components[0])})
        return self.slot(replace(packed, srgb=bool(color) and packed.srgb))

    def surface_slot(
        self, name: str, roughness: Sampled | None, metallic: Sampled | None, specular: Sampled | None = None
    ) -> Slot | None:
        """R specular, G roughness and B metallic; what is not sampled multiplies by 1."""
        parts = {k: (item.texture, item.components[0]) for k, item in enumerate((specular, roughness, metallic)) if item}
        if not parts:
            return None
        packed = pack_channels(name, parts)
        scale = tuple(packed.scale[k] if k in parts else 0.0 for k in range(4))
        bias = tuple(packed.bias[k] if k in parts else 1.0 for k in range(4))
        return self.slot(self.deduplicated(replace(packed, scale=scale, bias=bias)))


_settings = attrgetter("srgb", "wrap", "scale", "bias")


def _component(item: Sampled, k: int) -> int:
    return item.components[min(k, len(item.components) - 1)]


def package_of(path: str) -> str:
    """The outermost package that a path leads into (`a.usdz[0/b.png]`), or '' for a plain file."""
    is_inside = Ar.IsPackageRelativePath(path)
    outer = Ar.SplitPackageRelativePathOuter(path)[0] if is_inside else path
    return outer if is_inside or outer.endswith(".usdz") else ""


def _resolved(name: str, layer: Sdf.Layer) -> str:
    """Where a file that a layer names lies; '' where it is not there."""
    package = package_of(layer.realPath or layer.identifier)
    anchored = Ar.JoinPackageRelativePath([package, name]) if package else Sdf.ComputeAssetPathRelativeToLayer(layer, name)
    return str(Ar.GetResolver().Resolve(anchored))


def _is_gray(data: bytes) -> bool:
    return Image.open(io.BytesIO(data)).mode in GRAY_MODES


Slots = Mapping[str, Sequence[tuple[str, Sampled]]]


def uv_names_of(slots: Slots) -> tuple[str, ...]:
    """The primvars, one or two, that the slots of a material take texture coordinates from. slots: by their names, the (input,
    texture) that fill them; the first one gives its coordinates to the slot."""
    return tuple(dict.fromkeys(items[0][1].uv_name for items in slots.values() if items))[:2] or (PRIMVAR_OF_UV,)


def slot_at(slot: Slot, item: Sampled, names: tuple[str, ...], code: Usd.TimeCode) -> Slot:
    """The slot with the texture coordinates of a texture at a time."""
    uv_set = names.index(item.uv_name) if item.uv_name in names else 0
    return replace(slot, uv=uv_matrix(item.uv_nodes, code), uv_set=uv_set)


def unread_textures(slots: Slots, codes: Sequence[Usd.TimeCode]) -> list[str]:
    """What textures ask for beyond two sets of uv for a material, and one way to read each of its slots."""
    said, names = [], uv_names_of(slots)
    for items in slots.values():
        for key, item in items:
            said += [f"{what}, of {key}" for what in item.said]
            used = items[0][1].uv_name if items[0][1].uv_name in names else names[0]
            said += [f"uv {item.uv_name} of {key}: it is read with {used}"] if item.uv_name != used else []
            said += [f"wrap mode {mode} of {key}: it is read with clamp" for mode in _bordered(item.node)]
            still = changing(item.node) if item.node not in item.uv_nodes else ()
            said += [f"animation of {name} of the texture of {key}: it stays as it begins" for name in still]
        for key, item in items[1:]:
            first_key, first = items[0]
            differs = any(uv_matrix(item.uv_nodes, code) != uv_matrix(first.uv_nodes, code) for code in codes)
            if differs or item.texture.wrap != first.texture.wrap:
                said.append(f"transform of uv or wrap mode of {key}: those of {first_key} are used")
    return said


def _bordered(node: UsdShade.Shader) -> list[str]:
    """'black' or 'constant' where the image ends in such a border."""
    modes = [value(node, key) for key in ("wrapS", "wrapT", "uaddressmode", "vaddressmode")]
    return sorted({str(mode) for mode in modes if mode in ("black", "constant")})
