"""Mitsuba scenes, XML files or dictionaries, as they stand: shapes, BSDFs, emitters and sensors.

Integrators, samplers and films are the renderer's and are not looked at, but for the film's aspect. Mitsuba's scenes do not
say which way is up: it is the axis nearest to the first sensor's up, else Y. BSDFs inside `twosided` reflect from both sides;
others are black from behind in Mitsuba and left out where the plan culls back faces.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .animation import with_animation
from .containment import Reach
from .description import Environment, Light, Material, SceneCamera, SceneDescription, SceneObject, Slot, Texture
from .mitsuba_dictionary import children, resolved
from .mitsuba_lights import emission_of, environment_of, light_of
from .mitsuba_materials import ReadMaterial, material_of
from .mitsuba_sensors import camera_of, up_axis
from .mitsuba_shapes import Placed, ShapeReader, placed_shapes
from .mitsuba_textures import TextureReader
from .mitsuba_xml import parse_xml

MOST_OBJECTS = 200_000
SLOTS = ("base_texture", "surface_texture", "normal_texture", "emission_texture")
DEFAULT_BSDF = {"type": "diffuse"}  # Mitsuba's, of shapes without one, reflectance 0.5 ...
BLACK_BSDF = {"type": "diffuse", "reflectance": 0.0}  # ... and of those that emit


def load_mitsuba(file: Path, reach: Reach) -> SceneDescription:
    """Read an XML scene, and the animation in `<stem>.animation.json` beside it where there is one. Raises InputError naming
    the file and, where it can, the object or the line."""
    document = parse_xml(file, reach)
    try:
        scene = _Reader(resolved(document.scene), reach).scene(file.stem, document.files)
    except InputError as error:
        raise InputError(error.problem, file=error.file or file, field=error.field) from None
    return with_animation(scene, file, reach)


def scene_from_dict(
    values: Mapping[str, Any], folder: Path, *, name: str = "scene", allow_outside: bool = False
) -> SceneDescription:
    """The scene of a dictionary as `mi.load_dict` takes it: {"type": "scene", name: {"type": ...}, ...}.

    Files that it names lie in `folder` (elsewhere, too, with allow_outside). Transforms are 4x4 matrices, nested lists, arrays
    or `mi.ScalarTransform4f`; objects that Mitsuba made already are refused. Raises InputError naming the object.
    """
    if not isinstance(values, Mapping) or values.get("type") != "scene":
        raise InputError('no dictionary of a scene: {"type": "scene", ...} is expected')
    return _Reader(resolved(values), Reach(Path(folder).resolve(), allow_outside)).scene(name, ())


class _Reader:
    """One scene; its lists grow while it is read."""

    def __init__(self, values: dict[str, Any], reach: Reach) -> None:
        self.values, self.reach = values, reach
        self.texels: dict[Path, NDArray] = {}
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self.files: list[Path] = []
        self.said: list[str] = []
        self._bsdfs: dict[int, ReadMaterial] = {}
        self._materials: dict[tuple[int, int], int] = {}
        self._drawn: dict[int, tuple[Texture, int]] = {}

    def scene(self, name: str, files: tuple[Path, ...]) -> SceneDescription:
        objects, matrices, meshes = self.objects()
        lights, environment = self.lights()
        cameras = self.cameras()
        self.said += [f"shape {v['type']} {_name(k, v)}" for k, v in children(self.values, "shape not drawn")]
        self.said += [f"{v['type']} {_name(k, v)}" for k, v in children(self.values, "medium")]
        world = np.array(matrices, dtype=float).reshape(-1, 4, 4)
        return SceneDescription(
            name=name,
            files=tuple(dict.fromkeys((*files, *meshes.files, *self.files))),
            meshes=tuple(meshes.meshes),
            materials=tuple(self.materials),
            textures=tuple(self.textures),
            objects=tuple(objects),
            lights=lights,
            environment=environment,
            up_axis=up_axis(cameras[0].at(0.0).world_from_camera) if cameras else "Y",
            metres_per_unit=1.0,
            world_from_object=lambda time_s: world,
            cameras=cameras,
            not_read=tuple(dict.fromkeys((*meshes.said, *self.said))),
        )

    def objects(self) -> tuple[list[SceneObject], list[NDArray[np.float64]], ShapeReader]:
        meshes = ShapeReader(self.reach)
        objects: list[SceneObject] = []
        matrices: list[NDArray[np.float64]] = []
        names: dict[str, int] = {}
        for shape in placed_shapes(self.values):
            read, material = self.material(shape)
            if not read.drawn and not any(self.materials[material].emission):
                continue
            names[shape.name] = names.get(shape.name, 0) + 1
            name = shape.name if names[shape.name] == 1 else f"{shape.name} {names[shape.name]}"
            mesh = meshes.index(shape, self.materials[material].normal_texture is not None)
            objects.append(SceneObject(name=name, mesh=mesh, material=material, double_sided=read.two_sided))
            matrices.append(shape.world_from_object)
            if len(objects) > MOST_OBJECTS:
                raise InputError(f"more than {MOST_OBJECTS} objects")
        return objects, matrices, meshes

    def material(self, shape: Placed) -> tuple[ReadMaterial, int]:
        """What was read of the shape's BSDF, and the index of its material, a copy where the shape emits."""
        bsdfs = [v for _, v in children(shape.values, "bsdf")]
        emitters = [v for _, v in children(shape.values, "emitter")]
        for what, found in (("BSDFs", bsdfs), ("emitters", emitters)):
            if len(found) > 1:
                raise InputError(f"{len(found)} {what}, one is expected", field=shape.name)
        emitter = emitters[0] if emitters else None
        bsdf = bsdfs[0] if bsdfs else BLACK_BSDF if emitter else DEFAULT_BSDF
        if id(bsdf) not in self._bsdfs:
            own = bsdf.get("id") or (f"material of {shape.name}" if bsdfs else "black" if emitter else "default")
            self._bsdfs[id(bsdf)] = self.adopted(material_of(bsdf, str(own), self.reach, self.texels))
        read = self._bsdfs[id(bsdf)]
        key = (id(bsdf), id(emitter))
        if key not in self._materials:
            self._materials[key] = len(self.materials)
            self.materials.append(self.emitting(read.material, emitter, shape.name) if emitter else read.material)
        return read, self._materials[key]

    def adopted(self, read: ReadMaterial) -> ReadMaterial:
        """With the scene's textures in place of its own."""
        self.files += read.files
        return replace(read, material=self.renumbered(read.material, read.textures))

    def renumbered(self, material: Material, textures: tuple[Texture, ...], slots: Iterable[str] = SLOTS) -> Material:
        indices = [self.texture(texture) for texture in textures]
        found = {slot: getattr(material, slot) for slot in slots}
        changed = {k: replace(slot, texture=indices[slot.texture]) for k, slot in found.items() if isinstance(slot, Slot)}
        return replace(material, **changed)

    def texture(self, texture: Texture) -> int:
        """Its index in the scene; equal ones of one image are one."""
        for known, index in self._drawn.values():
            if known.texels is texture.texels and replace(known, texels=texture.texels, name="") == replace(texture, name=""):
                return index
        self._drawn[len(self.textures)] = texture, len(self.textures)
        self.textures.append(texture)
        return len(self.textures) - 1

    def emitting(self, material: Material, emitter: Mapping[str, Any], name: str) -> Material:
        parts = TextureReader(self.reach, self.texels)
        try:
            fields, said = emission_of(emitter, name, parts)
        except InputError as error:
            raise InputError(error.problem, file=error.file, field=error.field or name) from None
        self.files += parts.files
        self.said += [*said, *parts.said]
        material = replace(material, name=f"{material.name} of {name}", **fields)
        return self.renumbered(material, tuple(parts.textures), ("emission_texture",))

    def lights(self) -> tuple[tuple[Light, ...], Environment | None]:
        lights: list[Light] = []
        environments: list[Environment] = []
        for key, values in children(self.values, "emitter"):
            name = _name(key, values)
            try:
                if values["type"] in ("constant", "envmap"):
                    parts = TextureReader(self.reach, self.texels)
                    environment, said = environment_of(values, name, parts)
                    environments.append(environment)
                    self.files += parts.files
                    self.said += parts.said
                else:
                    light, said = light_of(values, name)
                    lights += [light] if light else []
            except InputError as error:
                raise InputError(error.problem, file=error.file, field=error.field or name) from None
            self.said += said
        if len(environments) > 1:
            raise InputError(f"{len(environments)} environments, one is expected", field=environments[1].name)
        return tuple(lights), environments[0] if environments else None

    def cameras(self) -> tuple[SceneCamera, ...]:
        cameras: list[SceneCamera] = []
        for key, values in children(self.values, "sensor"):
            name = _name(key, values)
            try:
                camera, said = camera_of(values, name)
            except InputError as error:
                raise InputError(error.problem, file=error.file, field=error.field or name) from None
            cameras += [camera] if camera else []
            self.said += said
        return tuple(cameras)


def _name(key: str, values: Mapping[str, Any]) -> str:
    return str(values.get("id") or (f"{values['type']} {key.removeprefix('_arg_')}" if key.startswith("_arg_") else key))
