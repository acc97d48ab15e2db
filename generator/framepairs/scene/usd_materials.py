"""Materials of USD stages: UsdPreviewSurface and MaterialX networks, each read once.

A material with both a universal surface and one for MaterialX (`outputs:mtlx:surface`) is read from the universal one where
that is a kind that is known, because its UsdPreviewSurface is what every renderer draws.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from pxr import Usd, UsdShade

from .containment import Reach
from .description import Material, Texture
from .usd_inputs import ReadMaterial
from .usd_materialx import SURFACES, read_materialx
from .usd_networks import kind_of
from .usd_preview import read_preview
from .usd_textures import TextureReader

PREVIEW_KINDS = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
KINDS = (*PREVIEW_KINDS, *SURFACES)
WHITE = Material(name="displayColor", base_color=(1.0, 1.0, 1.0))


class MaterialReader:
    """Reads materials of one stage, each image once; `materials`, `textures` and `files` grow as prims ask for them.

    reach: which files images may come from; None: all. changing: of the materials that change, by index, functions of the
    time code; codes: of their time samples. Of the materials by index, for the meshes that they are on: uv_names: the
    primvars of one or two sets of texture coordinates; color_names, opacity_names: the primvars of the vertices' colour (RGB)
    and opacity, where a material reads some; color_fallbacks: the linear colour where the mesh lacks it, opacity_fallbacks:
    the opacity.
    """

    def __init__(self, reach: Reach | None = None) -> None:
        self.materials: list[Material] = []
        self.images = TextureReader(reach)
        self.changing: dict[int, Callable[[Usd.TimeCode], Material]] = {}
        self.codes: dict[int, tuple[Usd.TimeCode, ...]] = {}
        self.uv_names: dict[int, tuple[str, ...]] = {}
        self.color_names: dict[int, str] = {}
        self.color_fallbacks: dict[int, tuple[float, ...]] = {}
        self.opacity_names: dict[int, str] = {}
        self.opacity_fallbacks: dict[int, float] = {}
        self._index_of: dict[str, int] = {}

    @property
    def textures(self) -> list[Texture]:
        return self.images.textures

    @property
    def files(self) -> list[Path]:
        return self.images.files

    def material_index(self, material: UsdShade.Material | None) -> int:
        """Index of `material` (None: the default grey), read at the first call."""
        path = str(material.GetPath()) if material else ""
        if path not in self._index_of:
            read = self._read(material) if material else ReadMaterial(material=Material(name="default"))
            self._index_of[path] = self._added(read)
        return self._index_of[path]

    def colored_default(self, blend: bool = False) -> int:
        """Index of the white material of meshes without one that have a displayColor; blend: and a displayOpacity."""
        name = f"{WHITE.name} {blend}"
        if name not in self._index_of:
            material = replace(WHITE, alpha="blend") if blend else WHITE
            self._index_of[name] = self._added(ReadMaterial(material=material))
        return self._index_of[name]

    def shining_copy(self, index: int, shine: Callable[[Material, Usd.TimeCode], Material], changes: bool) -> int:
        """Index of a new material: what `shine` makes of material `index` at each time. changes: it depends on the time."""
        before, begin = self.changing.get(index), Usd.TimeCode.EarliestTime()
        self.materials.append(shine(self.materials[index], begin))
        copy = len(self.materials) - 1
        for names in (self.uv_names, self.color_names, self.color_fallbacks, self.opacity_names, self.opacity_fallbacks):
            names.update({copy: names[index]} if index in names else {})
        if changes or before is not None:
            constant = self.materials[index]
            self.changing[copy] = lambda code: shine(before(code) if before else constant, code)
        return copy

    def materials_at(self, code: Usd.TimeCode) -> tuple[Material, ...]:
        """All materials at a time. Raises InputError for an index of refraction below 0."""
        changed = {index: replace(at(code), not_read=self.materials[index].not_read) for index, at in self.changing.items()}
        return tuple(changed.get(index, item) for index, item in enumerate(self.materials))

    def added(self, material: Material) -> int:
        """Index of a material that is no prim's."""
        return self._added(ReadMaterial(material=material))

    def _added(self, read: ReadMaterial) -> int:
        index = len(self.materials)
        self.materials.append(read.material)
        self.uv_names[index] = read.uv_names
        if read.at:
            self.changing[index], self.codes[index] = read.at, read.codes
        if read.color:
            self.color_names[index], self.color_fallbacks[index] = read.color.name, _padded(read.color.fallback)
        if read.opacity:
            self.opacity_names[index], self.opacity_fallbacks[index] = read.opacity.name, read.opacity.fallback[0]
        return index

    def _read(self, usd_material: UsdShade.Material) -> ReadMaterial:
        name = str(usd_material.GetPath())
        found = [usd_material.ComputeSurfaceSource(context)[0] for context in ("", "mtlx")]
        shaders = [shader for shader in found if shader]
        shader = next((item for item in shaders if kind_of(item) in KINDS), None)
        if shader is None:
            what = (kind_of(shaders[0]) or None) if shaders else "no surface"
            return ReadMaterial(material=Material(name=name, not_read=(f"shader {what}",)))
        read = read_preview if kind_of(shader) in PREVIEW_KINDS else read_materialx
        material = read(name, shader, self.images)
        said = _other_outputs(usd_material)
        return replace(material, material=replace(material.material, not_read=(*material.material.not_read, *said)))


def _padded(fallback: tuple[float, ...]) -> tuple[float, ...]:
    return (fallback * 3)[:3] if len(fallback) == 1 else fallback[:3]


def _other_outputs(usd_material: UsdShade.Material) -> list[str]:
    """Displacement and volume, which no material here has."""
    sources: Mapping[str, UsdShade.Shader] = {
        "displacement": usd_material.ComputeDisplacementSource("mtlx")[0],
        "volume": usd_material.ComputeVolumeSource("mtlx")[0],
    }
    return [f"{what} through {kind_of(item)}" for what, item in sources.items() if item and kind_of(item) not in PREVIEW_KINDS]
