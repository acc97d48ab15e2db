"""USD stages (.usd .usda .usdc .usdz): meshes that move and deform, instances, UsdPreviewSurface and lights."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom, UsdLux, UsdSkel

from ..errors import InputError
from .description import Deformed, Environment, Light, Mesh, SceneDescription, SceneObject
from .usd_deform import Deformation, deformed_vertices, find_skins, object_matrix, pose, read_deformation
from .usd_lights import ChangingLight, read_light
from .usd_materials import MaterialReader
from .usd_meshes import MeshPart, VertexSource, mesh_parts, moving_mesh, still_mesh, with_vertices
from .usd_placement import Placement, PrototypePart, Visibility, place, place_instances, read_instances, read_visibility

SHOWN = Usd.TraverseInstanceProxies()
ALSO_ABSTRACT = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


@dataclass(frozen=True)
class Moving:
    """A mesh prim whose vertices move. parts: where the vertices of a part come from, and the meshes that it is drawn as."""

    deformation: Deformation
    parts: tuple[tuple[VertexSource, tuple[int, ...]], ...]


@dataclass
class Reading:
    """What was read of a stage so far. placements: of the objects, in their order."""

    reader: MaterialReader = field(default_factory=MaterialReader)
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
    not_read: list[str] = field(default_factory=list)


def load_usd(file: Path) -> SceneDescription:
    """Read a stage. Raises InputError naming the file and the prim."""
    try:
        stage = Usd.Stage.Open(str(file))
    except Tf.ErrorException as error:
        raise InputError(f"not a USD stage: {' '.join(str(error).split())}", file=file) from None
    problems = stage.GetCompositionErrors()
    if problems:
        raise InputError(f"does not compose: {' '.join(str(problems[0]).split())[:300]}", file=file)
    with _naming(file):
        return _read_stage(stage, file)


@contextmanager
def _naming(file: Path) -> Iterator[None]:
    """Adds the file to an InputError that does not name one."""
    try:
        yield
    except InputError as error:
        if error.file is None:
            raise InputError(error.problem, file=file, frame=error.frame, field=error.field) from None
        raise


def _read_stage(stage: Usd.Stage, file: Path) -> SceneDescription:
    reading = Reading()
    of_time = partial(_of_time, stage, file)
    for prim, visibility in _drawn_prims(stage.GetPseudoRoot(), None, SHOWN, reading):
        if prim.IsA(UsdGeom.Mesh):
            _read_mesh(prim, visibility, reading)
        elif prim.IsA(UsdGeom.PointInstancer):
            _read_instancer(UsdGeom.PointInstancer(prim), visibility, reading)
        elif prim.HasAPI(UsdLux.LightAPI):
            _read_light(prim, visibility, reading)
    not_read = [*reading.not_read, *(f"dome light {item.name}: only one is drawn" for item in reading.environments[1:])]
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
        world_from_object=of_time(_world_from_object(reading.placements)),
        deformed=of_time(partial(_deformed, reading.moving)) if reading.moving else None,
        visible=of_time(partial(_visible, reading.placements)) if any(p.visible for p in reading.placements) else None,
        lights_at=of_time(partial(_lights_at, reading)) if reading.changing_lights else None,
        materials_at=of_time(reading.reader.materials_at) if reading.reader.changing else None,
        animation_end_s=stage.GetEndTimeCode() / stage.GetTimeCodesPerSecond() if stage.HasAuthoredTimeCodeRange() else 0.0,
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
            continue
        if prim.IsA(UsdSkel.Skeleton):
            if not UsdSkel.Root.Find(prim):
                reading.not_read.append(f"skeleton {prim.GetPath()}: it lies under no SkelRoot")
        elif prim.IsA(UsdGeom.Gprim) and not prim.IsA(UsdGeom.Mesh) and not prim.HasAPI(UsdLux.LightAPI):
            reading.not_read.append(f"{prim.GetTypeName()} {prim.GetPath()}")
        else:
            yield prim, visibility


def _read_light(prim: Usd.Prim, visibility: Visibility, reading: Reading) -> None:
    visible = visibility.at if visibility.changing else None
    item = read_light(prim, _moving_attributes(prim), visible, reading.not_read, reading.reader.files)
    if isinstance(item, ChangingLight):
        reading.changing_lights[len(reading.lights)] = item
        item = item.at(UsdGeom.XformCache(Usd.TimeCode.EarliestTime()))
    if isinstance(item, Light):
        reading.lights.append(item)
    elif isinstance(item, Environment):
        reading.environments.append(item)


def _read_mesh(prim: Usd.Prim, visibility: Visibility, reading: Reading) -> None:
    deformation, parts = _mesh_and_parts(prim, None, reading)
    anchor, local, local_moves = _frame(prim, deformation)
    placement = place(anchor, local, local_moves, visibility)
    moves = placement.moves or placement.visible is not None or (deformation is not None and deformation.moves)
    for part, indices in _add_meshes(deformation, parts, 1, reading):
        reading.objects.append(SceneObject(name=part.name, mesh=indices[0], material=part.material, moves=moves))
        reading.placements.append(placement)


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
            if prim.IsA(UsdGeom.PointInstancer) or prim.HasAPI(UsdLux.LightAPI):
                reading.not_read.append(f"{prim.GetTypeName()} {prim.GetPath()} in a prototype of {path}")
            if not prim.IsA(UsdGeom.Mesh):
                continue
            deformation, parts = _mesh_and_parts(prim, root, reading)
            anchor, local, local_moves = _frame(prim, deformation)
            for part, indices in _add_meshes(deformation, parts, len(members), reading):
                placed.append(
                    PrototypePart(
                        prototype=number, root=root, anchor=anchor, local=local, local_moves=local_moves, visibility=shown
                    )  # fmt: skip
                )
                inside = part.name[len(str(root.GetPath().GetParentPath()).rstrip("/")) :]
                moves = deformation is not None and deformation.moves
                objects += [
                    SceneObject(name=f"{path}[{member}]{inside}", mesh=index, material=part.material, moves=moves)
                    for member, index in zip(members, indices, strict=True)
                ]
    placement = place_instances(instances, placed, visibility)
    if placement.moves or placement.visible is not None:
        objects = [SceneObject(name=item.name, mesh=item.mesh, material=item.material, moves=True) for item in objects]
    reading.objects += objects
    reading.placements.append(placement)


def _mesh_and_parts(prim: Usd.Prim, top: Usd.Prim | None, reading: Reading) -> tuple[Deformation | None, list[MeshPart]]:
    usd_mesh = UsdGeom.Mesh(prim)
    if prim.HasAPI(UsdLux.LightAPI):
        reading.not_read.append(f"light of mesh {prim.GetPath()}: it is drawn without shining")
    parts = list(mesh_parts(usd_mesh, reading.reader, reading.not_read))
    return (read_deformation(usd_mesh, reading.skins, top, reading.not_read) if parts else None), parts


def _frame(prim: Usd.Prim, deformation: Deformation | None):
    """The prim that carries the object, its matrix in that prim's space, and whether that matrix changes."""
    skin = deformation.skin if deformation is not None else None
    if skin is None:
        return prim, None, False
    return deformation.anchor, partial(object_matrix, deformation), skin.rigid and skin.moves


def _add_meshes(deformation: Deformation | None, parts: list[MeshPart], count: int, reading: Reading):
    """Adds the meshes of a prim that is drawn `count` times: for each part, the mesh of every drawing. Meshes that keep their
    shape are shared; those that move belong to one object each."""
    if deformation is None or not deformation.reshapes:
        for part in parts:
            if part.key not in reading.index_of:
                reading.index_of[part.key] = len(reading.meshes)
                reading.meshes.append(still_mesh(part))
            yield part, [reading.index_of[part.key]] * count
        return
    begin = Usd.TimeCode(0)
    now = pose(deformation, begin)
    sources = []
    for part in parts:
        mesh, source = moving_mesh(part)
        first = deformed_vertices(deformation, now, source, begin)
        mesh = with_vertices(mesh, first.positions, first.normals, deformation.moves)
        copies = count if deformation.moves else 1
        indices = list(range(len(reading.meshes), len(reading.meshes) + copies))
        reading.meshes += [mesh] * copies
        sources.append((source, tuple(indices)))
        yield part, indices if deformation.moves else indices * count
    if deformation.moves:
        reading.moving.append(Moving(deformation, tuple(sources)))


def _of_time(stage: Usd.Stage, file: Path, function: Callable[[Usd.TimeCode], Any]) -> Callable[[float], Any]:
    """`function` of a time code as one of the time in seconds, whose InputErrors name the file."""
    rate = stage.GetTimeCodesPerSecond()

    def of_time(time_s: float):
        assert stage  # the closure keeps the stage alive: prims of a stage that is gone answer with identities
        with _naming(file):
            return function(Usd.TimeCode(time_s * rate))

    return of_time


def _world_from_object(placements: list[Placement]) -> Callable[[Usd.TimeCode], NDArray[np.float64]]:
    start = UsdGeom.XformCache(Usd.TimeCode(0))
    begin = np.concatenate([np.zeros((0, 4, 4)), *(item.matrices(start) for item in placements)])
    moving = [(row, item) for row, item in _rows(placements) if item.moves]

    def world_from_object(code: Usd.TimeCode) -> NDArray[np.float64]:
        cache = UsdGeom.XformCache(code)
        matrices = begin.copy()
        for row, item in moving:
            matrices[row : row + item.count] = item.matrices(cache)
        return matrices

    return world_from_object


def _visible(placements: list[Placement], code: Usd.TimeCode) -> NDArray[np.bool_]:
    shown = np.ones(sum(item.count for item in placements), dtype=bool)
    for row, item in _rows(placements):
        if item.visible is not None:
            shown[row : row + item.count] = item.visible(code)
    return shown


def _rows(placements: list[Placement]) -> Iterator[tuple[int, Placement]]:
    row = 0
    for item in placements:
        yield row, item
        row += item.count


def _deformed(moving: list[Moving], code: Usd.TimeCode) -> dict[int, Deformed]:
    out: dict[int, Deformed] = {}
    for item in moving:
        now = pose(item.deformation, code)
        for source, indices in item.parts:
            out |= dict.fromkeys(indices, deformed_vertices(item.deformation, now, source, code))
    return out


def _lights_at(reading: Reading, code: Usd.TimeCode) -> tuple[Light, ...]:
    cache = UsdGeom.XformCache(code)
    changed = {index: item.at(cache) for index, item in reading.changing_lights.items()}
    return tuple(changed.get(index, item) for index, item in enumerate(reading.lights))


def _moving_attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """The attributes that animate the transform of a prim."""
    above = [prim.GetStage().GetPrimAtPath(path) for path in prim.GetPath().GetAncestorsRange()]
    frames = [UsdGeom.Xformable(item) for item in above if item.IsA(UsdGeom.Xformable)]
    return [item.GetAttr() for frame in frames for item in frame.GetOrderedXformOps() if item.MightBeTimeVarying()]
