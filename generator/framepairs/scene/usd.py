"""USD stages (.usd .usda .usdc .usdz): meshes that move and deform, instances, UsdPreviewSurface and lights."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux, UsdSkel

from ..errors import InputError
from .containment import Reach
from .description import Environment, Light, Mesh, SceneDescription, SceneObject
from .usd_arrays import CornerBudget, begin_of
from .usd_cameras import read_cameras
from .usd_deform import Deformation, deformed_vertices, find_skins, object_matrix, pose, read_deformation
from .usd_dependencies import check_prims, open_layers, outermost_file
from .usd_light_meshes import cylinder_light, shining_materials
from .usd_lights import ChangingLight, read_light
from .usd_materials import MaterialReader
from .usd_meshes import MeshPart, mesh_of, mesh_parts, shape_key, still_mesh, with_vertices
from .usd_placement import (
    Placement,
    PrototypePart,
    Visibility,
    check_count,
    place,
    place_instances,
    read_instances,
    read_visibility,
)
from .usd_surfaces import Surface, read_surface
from .usd_times import Moving, deformed_at, lights_at, naming, of_seconds, seconds_of, visible_at, world_from_objects

SHOWN = Usd.TraverseInstanceProxies()
ALSO_ABSTRACT = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


@dataclass
class Reading:
    """What was read of a stage so far. surfaces: of mesh prims, by their shape. placements: of the objects, in their order.
    for_viewports: paths of what is not drawn for its purpose, by that."""

    reader: MaterialReader
    subdivision: int
    corners: CornerBudget
    surfaces: dict[tuple[str, ...], Surface | None] = field(default_factory=dict)
    meshes: list[Mesh] = field(default_factory=list)
    index_of: dict[tuple, int] = field(default_factory=dict)
    objects: list[SceneObject] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    moving: list[Moving] = field(default_factory=list)
    skins: dict = field(default_factory=dict)
    skin_cache: UsdSkel.Cache = field(default_factory=UsdSkel.Cache)
    lights: list[Light] = field(default_factory=list)
    changing_lights: dict[int, ChangingLight] = field(default_factory=dict)
    environments: list[Environment] = field(default_factory=list)
    for_viewports: dict[str, list[str]] = field(default_factory=dict)
    not_read: list[str] = field(default_factory=list)


def load_usd(file: Path, reach: Reach, subdivision: int) -> SceneDescription:
    """Read a stage. Raises InputError naming the file and the prim."""
    with naming(file):
        layers = open_layers(file, reach)
        corners = CornerBudget(outermost_file(layer) for layer in layers)
        check_prims(layers[0])
        stage = Usd.Stage.Open(layers[0])
        problems = stage.GetCompositionErrors()
        if problems:
            raise InputError(f"does not compose: {' '.join(str(problems[0]).split())[:300]}", file=file)
        return _read_stage(stage, file, Reading(MaterialReader(reach), subdivision, corners))


def _read_stage(stage: Usd.Stage, file: Path, reading: Reading) -> SceneDescription:
    units = {"timeCodesPerSecond": stage.GetTimeCodesPerSecond(), "metersPerUnit": UsdGeom.GetStageMetersPerUnit(stage)}
    for name, value in units.items():
        if not 0 < value < np.inf:
            raise InputError(f"{value:g} is no unit", field=name)
    of_time = partial(of_seconds, stage, file)
    for prim, visibility in _drawn_prims(stage.GetPseudoRoot(), None, SHOWN, reading):
        if prim.IsA(UsdGeom.Mesh):
            _read_mesh(prim, visibility, reading)
        elif prim.IsA(UsdGeom.PointInstancer):
            _read_instancer(UsdGeom.PointInstancer(prim), visibility, reading)
        elif prim.HasAPI(UsdLux.LightAPI):
            _read_light(prim, visibility, reading)
    cameras = read_cameras(stage, of_time, reading.not_read)
    not_read = [*reading.not_read, *(f"dome light {item.name}: only one is drawn" for item in reading.environments[1:])]
    for purpose, paths in reading.for_viewports.items():
        not_read.append(f"{len(paths)} prims of purpose {purpose}, as {paths[0]}: they are for viewports")
    # a layer inside a .usdz is called package.usdz[layer.usda]: the package itself is among the files already
    layers = [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath and "[" not in layer.realPath]
    files = [file, *sorted({*layers, *reading.reader.files} - {file.resolve(), file})]
    return SceneDescription(
        name=file.stem,
        files=tuple(files),
        meshes=tuple(reading.meshes),
        materials=tuple(reading.reader.materials),
        textures=tuple(reading.reader.textures),
        objects=tuple(reading.objects),
        lights=tuple(reading.lights),
        environment=reading.environments[0] if reading.environments else None,
        up_axis=str(UsdGeom.GetStageUpAxis(stage)),
        metres_per_unit=float(UsdGeom.GetStageMetersPerUnit(stage)),
        world_from_object=of_time(world_from_objects(reading.placements, Usd.TimeCode(begin_of(stage)))),
        deformed=of_time(partial(deformed_at, reading.moving)) if reading.moving else None,
        visible=of_time(partial(visible_at, reading.placements)) if any(p.visible for p in reading.placements) else None,
        lights_at=of_time(partial(lights_at, reading.lights, reading.changing_lights)) if reading.changing_lights else None,
        materials_at=of_time(reading.reader.materials_at) if reading.reader.changing else None,
        cameras=cameras,
        animation_end_s=seconds_of(stage),
        not_read=tuple(not_read),
    )


def _drawn_prims(root: Usd.Prim, top: Usd.Prim | None, predicate, reading: Reading) -> Iterator[tuple[Usd.Prim, Visibility]]:
    """Prims under `root` that are drawn, with their visibility under `top`; finds their skins, and names kinds not read."""
    prims = iter(Usd.PrimRange(root, predicate))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()  # its prototypes are not drawn in their own place
        if prim.IsA(UsdSkel.Root):
            reading.skins.update(find_skins(prim, predicate, reading.skin_cache))
        visibility = read_visibility(prim, top)
        if not visibility.drawn:
            purpose = str(UsdGeom.Imageable(prim).ComputePurpose()) if prim.IsA(UsdGeom.Gprim) else ""
            if purpose in ("guide", "proxy"):
                reading.for_viewports.setdefault(purpose, []).append(str(prim.GetPath()))
            continue
        if prim.IsA(UsdSkel.Skeleton):
            if not UsdSkel.Root.Find(prim):
                reading.not_read.append(f"skeleton {prim.GetPath()}: it lies under no SkelRoot")
        elif prim.IsA(UsdGeom.Gprim) and not prim.IsA(UsdGeom.Mesh) and not prim.HasAPI(UsdLux.LightAPI):
            reading.not_read.append(f"{prim.GetTypeName()} {prim.GetPath()}")
        else:
            yield prim, visibility


def _read_light(prim: Usd.Prim, visibility: Visibility, reading: Reading) -> None:
    if prim.IsA(UsdLux.CylinderLight):
        _read_cylinder(prim, visibility, reading)
        return
    visible = visibility.at if visibility.changing else None
    item = read_light(prim, _moving_attributes(prim), visible, reading.not_read, reading.reader.images)
    if isinstance(item, ChangingLight):
        reading.changing_lights[len(reading.lights)] = item
        item = item.at(UsdGeom.XformCache(Usd.TimeCode.EarliestTime()))
    if isinstance(item, Light):
        reading.lights.append(item)
    elif isinstance(item, Environment):
        reading.environments.append(item)


def _read_cylinder(prim: Usd.Prim, visibility: Visibility, reading: Reading) -> None:
    placement = place(prim, None, False, visibility)
    light = cylinder_light(prim, partial(_matrix, placement), placement.moves, reading.reader, reading.not_read)
    if light is None:
        return
    mesh, material = light
    moves = placement.moves or placement.visible is not None
    reading.objects.append(SceneObject(name=mesh.name, mesh=len(reading.meshes), material=material, moves=moves))
    reading.meshes.append(mesh)
    reading.placements.append(placement)


def _matrix(placement: Placement, cache: UsdGeom.XformCache) -> NDArray[np.float64]:
    return placement.matrices(cache)[0]


def _shining(prim: Usd.Prim, added: list, placement: Placement | None, reading: Reading) -> list[tuple[MeshPart, int]]:
    """The parts of a prim, with materials that shine where it is a light. added: of `_add_meshes`."""
    if not prim.HasAPI(UsdLux.LightAPI) or not added:
        return added
    meshes = [reading.meshes[index] for _, index in added]
    matrix = partial(_matrix, placement) if placement is not None else None
    moves = placement is not None and placement.moves
    materials = [part.material for part, _ in added]
    shining = shining_materials(prim, materials, meshes, matrix, moves, reading.reader, reading.not_read)
    return [(replace(part, material=material), mesh) for (part, mesh), material in zip(added, shining, strict=True)]


def _read_mesh(prim: Usd.Prim, visibility: Visibility, reading: Reading) -> None:
    deformation, parts = _mesh_and_parts(prim, None, reading)
    anchor, local, local_moves = _frame(prim, deformation)
    placement = place(anchor, local, local_moves, visibility)
    moves = placement.moves or placement.visible is not None or (deformation is not None and deformation.moves)
    for part, mesh in _shining(prim, list(_add_meshes(deformation, parts, reading)), placement, reading):
        both = _double_sided(prim)
        item = SceneObject(name=part.name, mesh=mesh, material=part.material, moves=moves, double_sided=both)
        reading.objects.append(item)
        reading.placements.append(placement)


def _double_sided(prim: Usd.Prim) -> bool:
    return bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get(Usd.TimeCode.EarliestTime()))


def _read_instancer(instancer: UsdGeom.PointInstancer, visibility: Visibility, reading: Reading) -> None:
    path = str(instancer.GetPath())
    stage = instancer.GetPrim().GetStage()
    roots = [stage.GetPrimAtPath(target) for target in instancer.GetPrototypesRel().GetForwardedTargets()]
    if not roots:
        reading.not_read.append(f"PointInstancer {path}: it has no prototypes")
        return
    instances = read_instances(instancer)
    placed: list[PrototypePart] = []
    objects: list[SceneObject] = []
    for number, root in enumerate(roots):
        if not root:
            raise InputError("names a prototype that is not there", field=path)
        members = instances.ids[instances.prototypes == number].tolist()
        predicate = SHOWN if root.IsDefined() and not root.IsAbstract() else ALSO_ABSTRACT
        for prim, shown in _drawn_prims(root, root, predicate, reading) if members else ():
            if prim.IsA(UsdGeom.PointInstancer) or (prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Mesh)):
                reading.not_read.append(f"{prim.GetTypeName()} {prim.GetPath()} in a prototype of {path}")
            if not prim.IsA(UsdGeom.Mesh):
                continue
            deformation, parts = _mesh_and_parts(prim, root, reading)
            anchor, local, local_moves = _frame(prim, deformation)
            for part, mesh in _shining(prim, list(_add_meshes(deformation, parts, reading)), None, reading):
                placed.append(
                    PrototypePart(
                        prototype=number, root=root, anchor=anchor, local=local, local_moves=local_moves, visibility=shown
                    )  # fmt: skip
                )
                inside = part.name[len(str(root.GetPath().GetParentPath()).rstrip("/")) :]
                moves, both = deformation is not None and deformation.moves, _double_sided(prim)
                check_count(len(reading.objects) + len(members), path)
                objects += [
                    SceneObject(
                        name=f"{path}[{member}]{inside}", mesh=mesh, material=part.material, moves=moves, double_sided=both
                    )
                    for member in members
                ]  # fmt: skip
    placement = place_instances(instances, placed, visibility)
    if placement.moves or placement.visible is not None:
        objects = [replace(item, moves=True) for item in objects]
    reading.objects += objects
    reading.placements.append(placement)


def _mesh_and_parts(prim: Usd.Prim, top: Usd.Prim | None, reading: Reading) -> tuple[Deformation | None, list[MeshPart]]:
    key = shape_key(prim)
    if key not in reading.surfaces:
        reading.surfaces[key] = read_surface(UsdGeom.Mesh(prim), reading.subdivision, reading.not_read, reading.corners)
    surface = reading.surfaces[key]
    parts = [part for part in mesh_parts(prim, surface, reading.reader) if len(part.faces)] if surface else []
    return (read_deformation(prim, surface, reading.skins, top, reading.not_read) if parts else None), parts


def _frame(prim: Usd.Prim, deformation: Deformation | None):
    """The prim that carries the object, its matrix in that prim's space, and whether that matrix changes."""
    skin = deformation.skin if deformation is not None else None
    if skin is None:
        return prim, None, False
    return deformation.anchor, partial(object_matrix, deformation), skin.rigid and skin.moves


def _add_meshes(deformation: Deformation | None, parts: list[MeshPart], reading: Reading) -> Iterator[tuple[MeshPart, int]]:
    """For each part of a prim its mesh, which all instances of a point instancer share. Other instances share it, too, unless
    a skeleton or blend shapes act on it."""
    reshapes = deformation is not None and deformation.reshapes
    own = reshapes and (deformation.skin is not None or deformation.shapes is not None)
    keys = [(*part.key, str(deformation.prim.GetPath())) if own else part.key for part in parts]
    if not all(key in reading.index_of for key in keys):
        _make_meshes(deformation if reshapes else None, parts, keys, reading)
    return zip(parts, [reading.index_of[key] for key in keys], strict=True)


def _make_meshes(deformation: Deformation | None, parts: list[MeshPart], keys: list[tuple], reading: Reading) -> None:
    first = len(reading.meshes)
    reading.index_of.update({key: first + number for number, key in enumerate(keys)})
    if deformation is None:
        reading.meshes += [still_mesh(part) for part in parts]
        return
    begin = Usd.TimeCode(begin_of(deformation.prim.GetStage()))
    now = pose(deformation, begin)
    sources = []
    for index, part in enumerate(parts, start=first):
        mesh, source = mesh_of(part)
        vertices = deformed_vertices(deformation, now, source, begin)
        reading.meshes.append(with_vertices(mesh, vertices.positions, vertices.normals, deformation.moves))
        sources.append((source, index))
    if deformation.moves:
        reading.moving.append(Moving(deformation, tuple(sources)))


def _moving_attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """The attributes that animate the transform of a prim."""
    above = [prim.GetStage().GetPrimAtPath(path) for path in prim.GetPath().GetAncestorsRange()]
    frames = [UsdGeom.Xformable(item) for item in above if item.IsA(UsdGeom.Xformable)]
    return [item.GetAttr() for frame in frames for item in frame.GetOrderedXformOps() if item.MightBeTimeVarying()]
