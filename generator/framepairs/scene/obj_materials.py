"""Materials of MTL files as ours.

Sources: Wavefront's MTL format 4.2 (P. Bourke's copy, October 1995), and the PBR lines that Exocortex proposed for clara.io.
What neither settles is decided here:

- Kd multiplies map_Kd, as the format says; a black Kd beside map_Kd counts as white. Colours of constants are linear.
- d, else 1 - Tr, is the opacity; map_d takes its image's opacity where that has some, else its red. It makes a mask where it is
  black and white alone, a blend otherwise.
- Pr, Pm and their maps are roughness and metal; a map stands in the place of its number. Without Pr and Pm, illum and Ks say
  whether there is a specular part: not where illum is 0 or 1 or Ks is black (then specular 0, roughness 1). Where Ks is given,
  F0 is its mean, up to 0.08, and Ns, the exponent of Blinn's lobe, gives alpha = sqrt(2 / (Ns + 2)) = roughness^2 (Walter et
  al. 2007, section 5.2; the format takes the half vector, too). Where Ks is not given, specular and roughness are 0.5.
- uv of a map is uv * s + o, as Blender reads it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .containment import Reach, within
from .description import IDENTITY_UV, Material, Slot, Texture
from .images import decode_srgb, linear_texels, pack_channels, read_image
from .mtl_lines import MapLine, MtlMaterial
from .reflectance import specular_of_f0

PBR = ("pr", "pm", "map_pr", "map_pm")
NAMED_MAPS = ("map_ks", "map_ns", "map_bump", "bump", "disp", "decal", "refl", "map_ps", "map_disp", "map_refl", "map_tr")
NAMED_NUMBERS = ("ps", "pc", "pcr", "aniso", "anisor")  # that act where they are not 0
IGNORED_OPTIONS = {"-t": "0", "-boost": "0", "-cc": "off", "-imfchan": "r", "-mm": None}
LINEAR = (".exr", ".hdr")  # images whose values are no sRGB codes
REFRACTION = ("4", "6", "7", "9")


class MaterialReader:
    """Materials of one scene, each once; `materials`, `textures` and `files` grow as meshes ask for them."""

    def __init__(self, known: dict[str, MtlMaterial], reach: Reach) -> None:
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self.files: list[Path] = []
        self._known, self._reach = known, reach
        self._index: dict[tuple[str | None, bool, bool], int] = {}
        self._texels: dict[tuple[Path, bool], NDArray] = {}  # of a file, as stored or decoded from sRGB

    def index(self, name: str | None, colored: bool = False, blends: bool = False) -> int:
        """Index into `materials` of MTL's `name`; None, and what no library holds, is grey, or white under vertex colours.
        blends: opacities of vertices are below 1. Raises InputError naming the library and the material."""
        key = name if name in self._known else None
        if (key, colored, blends) not in self._index:
            plain = Material(name="default", base_color=(1.0,) * 3 if colored else (0.8,) * 3)
            material = plain if key is None else self._material(self._known[key], colored)
            if blends and material.alpha == "opaque":
                material = replace(material, alpha="blend")
            self._index[key, colored, blends] = len(self.materials)
            self.materials.append(material)
        return self._index[key, colored, blends]

    def textured(self, image: Path, name: str) -> int:
        """Index of a white material with an image of its own (PLY's TextureFile)."""
        slot = self._slot(Texture(name=name, texels=self._read(image, True), srgb=True))
        self.materials.append(Material(name=name, base_color=(1.0,) * 3, base_texture=slot))
        return len(self.materials) - 1

    def _material(self, source: MtlMaterial, colored: bool) -> Material:
        said: list[str] = []
        base, color = source.map("map_kd"), source.color("kd")
        if color is None or base and not any(color):
            color = (1.0,) * 3 if base or colored else (0.8,) * 3
        slot, opacity = self._base(source, base, said)
        emission, glow = source.color("ke"), source.map("map_ke")
        if emission is None or glow and not any(emission):
            emission = (1.0,) * 3 if glow else (0.0,) * 3
        normal = source.map("norm", "map_kn")
        bump = normal.numbers("-bm", 1.0, 1)[0] if normal else 1.0
        emission_texture = self._image_slot(source, glow, said, srgb=True)
        normal_texture = self._image_slot(source, normal, said, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))
        fields = self._surface(source, said)
        return Material(
            name=source.name,
            base_color=color,
            base_texture=slot,
            emission=emission,
            emission_texture=emission_texture,
            normal_scale=bump,
            normal_texture=normal_texture,
            **opacity,
            **fields,
            not_read=(*said, *unread_of(source)),
        )

    def _base(self, source: MtlMaterial, base: MapLine | None, said: list[str]) -> tuple[Slot | None, dict]:
        """Slot of base colour and opacity, and what else concerns the opacity."""
        value, opposite, image = source.number("d"), source.number("tr"), source.map("map_d")
        value = value if value is not None else 1 - (opposite or 0)
        opacity = min(max(value, 0.0), 1.0)
        if image is None:
            texture = self._texture(source, base, said, srgb=True) if base else None
            if texture is not None and _has_opacity(texture.texels):
                said.append(f"opacity of {base.name}: there is no map_d")
            fields = {"opacity": opacity, "alpha": "opaque" if opacity == 1 else "blend"}
            return self._slot(texture, base) if texture else None, fields
        mask = self._texture(source, image, said)
        channel = 3 if _has_opacity(mask.texels) else 0
        if base is None:
            color = replace(mask, scale=(0.0,) * 4, bias=(1.0,) * 4)
            where = image
        else:
            color, where = self._texture(source, base, said, srgb=True), base
            if _transform(base) != _transform(image):
                said.append("-o and -s of map_d: those of map_Kd are used")
        packed = pack_channels(f"{source.name} base", {0: (color, 0), 1: (color, 1), 2: (color, 2), 3: (mask, channel)})
        opacities = linear_texels(mask)[..., channel]
        is_mask = opacity == 1 and bool(((opacities == 0) | (opacities == 1)).all())
        return self._slot(packed, where), {"opacity": opacity, "alpha": "mask" if is_mask else "blend"}

    def _surface(self, source: MtlMaterial, said: list[str]) -> dict:
        """Roughness, metal and specular."""
        specular, exponent, illum = source.color("ks"), source.number("ns"), source.values.get("illum", "2").strip()
        if any(key in source.values for key in PBR):
            rough, metal = source.map("map_pr"), source.map("map_pm")
            said += ["Ks: Pr and Pm are drawn"] if specular is not None and any(specular) else []
            numbers = [1.0 if image else source.number(key) for key, image in (("pr", rough), ("pm", metal))]
            return {
                "roughness": min(numbers[0] if numbers[0] is not None else 0.5, 1.0),
                "metallic": min(numbers[1] or 0.0, 1.0),
                "surface_texture": self._packed_surface(source, {1: rough, 2: metal}, said),
            }
        if illum in ("0", "1") or specular is not None and not any(specular):
            return {"specular": 0.0, "roughness": 1.0}
        if specular is None:
            return {}
        said += [f"colour of Ks {source.values['ks']}: its mean is used"] if max(specular) - min(specular) > 1e-6 else []
        amount, limited = specular_of_f0(sum(specular) / 3, f"Ks {source.values['ks']}")
        said += limited
        return {"specular": amount, "roughness": (2 / (exponent + 2)) ** 0.25 if exponent is not None else 0.5}

    def _packed_surface(self, source: MtlMaterial, maps: dict[int, MapLine | None], said: list[str]) -> Slot | None:
        given = {component: line for component, line in maps.items() if line is not None}
        if not given:
            return None
        lines = list(given.values())
        if any(_transform(line) != _transform(lines[0]) for line in lines):
            said.append("-o and -s of map_Pm: those of map_Pr are used")
        parts = {component: (self._texture(source, line, said), 0) for component, line in given.items()}
        return self._slot(pack_channels(f"{source.name} surface", parts), lines[0])

    def _image_slot(self, source: MtlMaterial, line: MapLine | None, said: list[str], **keys) -> Slot | None:
        return None if line is None else self._slot(self._texture(source, line, said, **keys), line)

    def _texture(self, source: MtlMaterial, line: MapLine, said: list[str], *, srgb=False, scale=(1,) * 4, bias=(0,) * 4):
        where = {"file": source.library, "field": source.name}
        file = within(self._reach, source.library.parent / line.name, **where)
        if not file.is_file():
            raise InputError(f"missing texture {line.name[:200]}", **where)
        said += [f"{key} {' '.join(line.options[key])} of {line.name}" for key in _acting(line)]
        wrap = "clamp" if line.options.get("-clamp", ("off",))[:1] == ("on",) else "repeat"
        texels = self._read(file, srgb)
        return Texture(name=line.name, texels=texels, srgb=srgb, wrap=(wrap, wrap), scale=scale, bias=bias)

    def _read(self, file: Path, srgb: bool) -> NDArray:
        """The texels of an image; where more than 8 bits of it are sRGB codes, decoded."""
        if (file, False) not in self._texels:
            self._texels[file, False] = read_image(file)
            self.files.append(file)
        key = file, srgb and file.suffix.lower() not in LINEAR
        if key not in self._texels:
            stored = self._texels[file, False]
            self._texels[key] = stored if stored.dtype == np.uint8 else decode_srgb(stored)
        return self._texels[key]

    def _slot(self, texture: Texture, line: MapLine | None = None) -> Slot:
        uv = _transform(line) if line else IDENTITY_UV
        for index, known in enumerate(self.textures):
            if known.texels is texture.texels and replace(known, texels=None) == replace(texture, texels=None):
                return Slot(texture=index, uv=uv)
        self.textures.append(texture)
        return Slot(texture=len(self.textures) - 1, uv=uv)


def unread_of(source: MtlMaterial) -> tuple[str, ...]:
    """Lines that act and are not drawn."""
    values = source.values
    said = [f"{key} {values[key]}" for key in NAMED_MAPS if values.get(key)]
    said += [f"{key} {values[key]}" for key in NAMED_NUMBERS if key in values and any(source.numbers(key))]
    said += [f"{key} {values[key]}" for key in ("kd", "ks", "ke") if key in values and source.color(key) is None]
    said += [f"tf {values['tf']}"] if source.color("tf") not in (None, (1.0,) * 3) else []
    said += [f"d {values['d']}"] if values.get("d", "").startswith("-halo") else []
    illum = values.get("illum", "")
    said += [f"illum {illum}: refraction"] if illum in REFRACTION else []
    return (*said, *(["illum 0: it is lit"] if illum == "0" else []))


def _acting(line: MapLine) -> list[str]:
    """Options of a map that are not read, where they act."""
    return [key for key, neutral in IGNORED_OPTIONS.items() if set(line.options.get(key, ())) - {neutral}]


def _transform(line: MapLine):
    (a, b), (x, y) = line.numbers("-s", 1.0, 2), line.numbers("-o", 0.0, 2)
    return ((a, 0.0, x), (0.0, b, y))


def _has_opacity(texels: NDArray) -> bool:
    return bool((texels[..., 3] < (255 if texels.dtype == np.uint8 else 1)).any())
