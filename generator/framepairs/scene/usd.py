"""USD stages (.usd .usda .usdc .usdz): meshes, animated transforms, UsdPreviewSurface and lights."""

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

from ..errors import InputError
from .description import Environment, Light, Mesh, SceneDescription, SceneObject, validate_mesh
from .usd_lights import read_light
from .usd_materials import MaterialReader


def load_usd(file: Path) -> SceneDescription:
    """Read a stage. Raises InputError naming the file and the prim."""
    try:
        stage = Usd.Stage.Open(str(file))
    except Tf.ErrorException as error:
        raise InputError(f"not a USD stage: {' '.join(str(error).split())}", file=file) from None
    problems = stage.GetCompositionErrors()
    if problems:
        raise InputError(f"does not compose: {' '.join(str(problems[0]).split())[:300]}", file=file)
    try:
        return _read_stage(stage, file)
    except InputError as error:
        if error.file is None:
            raise InputError(error.problem, file=file, frame=error.frame, field=error.field) from None
        raise


def _read_stage(stage: Usd.Stage, file: Path) -> SceneDescription:
    reader = MaterialReader()
    meshes: list[Mesh] = []
    index_of: dict[tuple, int] = {}
    objects: list[SceneObject] = []
    prims: list[Usd.Prim] = []
    not_read: list[str] = []
    lights: list[Light] = []
    environments: list[Environment] = []
    rate = stage.GetTimeCodesPerSecond()
    to_world = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    prims_in_order = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in prims_in_order:
        if prim.IsA(UsdGeom.PointInstancer):
            prims_in_order.PruneChildren()  # its prototypes are not drawn in their own place
        if not _is_drawn(prim):
            continue
        if prim.IsA(UsdGeom.Mesh):
            moves = _is_animated(prim)
            if prim.HasAPI(UsdLux.LightAPI):
                not_read.append(f"light of mesh {prim.GetPath()}: it is drawn without shining")
            for name, material, key, triangulate in _mesh_parts(UsdGeom.Mesh(prim), reader, not_read):
                if key not in index_of:
                    index_of[key] = len(meshes)
                    meshes.append(triangulate())
                objects.append(SceneObject(name=name, mesh=index_of[key], material=material, moves=moves))
                prims.append(prim)
        elif prim.HasAPI(UsdLux.LightAPI):
            matrix = np.array(to_world.GetLocalToWorldTransform(prim)).T
            item = read_light(prim, matrix, _is_animated(prim), not_read, reader.files)
            if isinstance(item, Light):
                lights.append(item)
            elif isinstance(item, Environment):
                environments.append(item)
        elif prim.IsA(UsdSkel.Skeleton):
            not_read.append(f"skinning by {prim.GetPath()}: the bind pose is drawn")
        elif prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer):
            not_read.append(f"{prim.GetTypeName()} {prim.GetPath()}")
    not_read += [f"dome light {extra.name}: only one is drawn" for extra in environments[1:]]
    # a layer inside a .usdz is called package.usdz[layer.usda]: the package itself is among the files already
    layers = [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath and "[" not in layer.realPath]
    files = [file, *sorted({*layers, *reader.files} - {file.resolve(), file})]

    def world_from_object(time_s: float) -> NDArray[np.float64]:
        assert stage  # the closure keeps the stage alive: prims of a stage that is gone answer with identities
        cache = UsdGeom.XformCache(Usd.TimeCode(time_s * rate))
        matrices = [np.array(cache.GetLocalToWorldTransform(prim)).T for prim in prims]
        return np.array(matrices).reshape(-1, 4, 4)

    return SceneDescription(
        name=file.stem,
        files=tuple(files),
        meshes=tuple(meshes),
        materials=tuple(reader.materials),
        textures=tuple(reader.textures),
        objects=tuple(objects),
        lights=tuple(lights),
        environment=environments[0] if environments else None,
        up_axis=str(UsdGeom.GetStageUpAxis(stage)),
        metres_per_unit=float(UsdGeom.GetStageMetersPerUnit(stage)),
        world_from_object=world_from_object,
        animation_end_s=stage.GetEndTimeCode() / rate if stage.HasAuthoredTimeCodeRange() else 0.0,
        not_read=tuple(not_read),
    )


def _is_drawn(prim: Usd.Prim) -> bool:
    if prim.IsA(UsdGeom.Imageable):
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility() == UsdGeom.Tokens.invisible:
            return False
        return imageable.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
    return bool(prim.IsActive())


def _is_animated(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False


def _mesh_parts(usd_mesh: UsdGeom.Mesh, reader: MaterialReader, not_read: list[str]):
    """For each material subset, and for the faces in none: (name, material index, key, function that makes the Mesh).

    Instances of one prototype have equal keys, so that their mesh is made once.
    """
    prim = usd_mesh.GetPrim()
    path = str(prim.GetPath())
    shared = str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
    counts = np.array(usd_mesh.GetFaceVertexCountsAttr().Get(Usd.TimeCode.EarliestTime()) or (), dtype=np.int64)
    if not len(counts):
        return
    if usd_mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none and len(counts) and (counts != 3).any():
        not_read.append(f"subdivision of {path}: its control mesh is drawn")
    if usd_mesh.GetPointsAttr().ValueMightBeTimeVarying():
        not_read.append(f"moving points of {path}: they are drawn as they begin")
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    rest = np.ones(len(counts), dtype=bool)
    selections: list[tuple[str, Usd.Prim, NDArray]] = []
    for subset in subsets:
        faces = np.array(subset.GetIndicesAttr().Get() or (), dtype=np.int64)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(counts)):
            raise InputError("subset names a face that the mesh has not", field=str(subset.GetPath()))
        rest[faces] = False
        selections.append((subset.GetPrim().GetName(), subset.GetPrim(), faces))
    if rest.any():
        selections.append(("", prim, np.flatnonzero(rest)))
    for name, bound, faces in selections:
        material = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()[0]
        index = reader.material_index(material if material else None)
        if not material and UsdGeom.Gprim(prim).GetDisplayColorAttr().HasAuthoredValue():
            not_read.append(f"displayColor of {path}: it is drawn grey")
        uv_name = reader.uv_names.get(index, "st")
        part = f"{path}/{name}" if name else path
        yield part, index, (shared, name, uv_name), partial(_triangles, usd_mesh, counts, faces, uv_name, part)


def _triangles(usd_mesh: UsdGeom.Mesh, counts: NDArray, faces: NDArray, uv_name: str, name: str) -> Mesh:
    time = Usd.TimeCode.EarliestTime()
    points = np.array(usd_mesh.GetPointsAttr().Get(time) or (), dtype=np.float32).reshape(-1, 3)
    indices = np.array(usd_mesh.GetFaceVertexIndicesAttr().Get(time) or (), dtype=np.int64)
    if counts.min() < 0 or counts.sum() != len(indices):
        raise InputError(f"face counts ask for {counts.sum()} indices, there are {len(indices)}", field=name)
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        raise InputError(f"face index {indices.max()} with only {len(points)} points", field=name)
    corner, face = _fan(counts, faces)
    if usd_mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        corner, face = corner[:, ::-1], face[:, ::-1]
    api = UsdGeom.PrimvarsAPI(usd_mesh)
    normals = _primvar(api.GetPrimvar("normals"), corner, face, indices, 3, name)
    if normals is None and usd_mesh.GetNormalsAttr().Get(time):
        values = np.array(usd_mesh.GetNormalsAttr().Get(time), dtype=np.float32)
        normals = _interpolated(values, str(usd_mesh.GetNormalsInterpolation()), corner, face, indices, name)
    uv = _primvar(api.GetPrimvar(uv_name), corner, face, indices, 2, name)
    smooth = normals is None and usd_mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none
    positions = points[indices[corner]]
    if smooth:
        normals = _vertex_normals(points, indices[corner])[indices[corner]]
    mesh = _indexed(name, positions, normals, uv)
    problem = validate_mesh(mesh)
    if problem:
        raise InputError(problem, field=name)
    return mesh


def _fan(counts: NDArray, faces: NDArray) -> tuple[NDArray, NDArray]:
    """Corner indices [T, 3] of fan triangles of the chosen faces, and the face [T, 3] each corner belongs to."""
    starts = np.concatenate([[0], np.cumsum(counts)])[faces]
    inner = np.maximum(counts[faces] - 2, 0)
    start, face = np.repeat(starts, inner), np.repeat(faces, inner)
    step = np.arange(len(start)) - np.repeat(np.cumsum(inner) - inner, inner)
    return np.stack([start, start + step + 1, start + step + 2], axis=1), np.stack([face] * 3, axis=1)


def _primvar(primvar: UsdGeom.Primvar, corner: NDArray, face: NDArray, indices: NDArray, width: int, name: str):
    if not primvar or not primvar.HasValue():
        return None
    flat = primvar.ComputeFlattened(Usd.TimeCode.EarliestTime())
    values = np.array(flat, dtype=np.float32).reshape(len(flat), -1)[:, :width]
    return _interpolated(values, str(primvar.GetInterpolation()), corner, face, indices, name)


def _interpolated(values: NDArray, interpolation: str, corner: NDArray, face: NDArray, indices: NDArray, name: str):
    """Values [T, 3, k] at each corner."""
    lookup = {
        "constant": np.zeros_like(corner),
        "uniform": face,
        "vertex": indices[corner],
        "varying": indices[corner],
        "faceVarying": corner,
    }[interpolation]
    if lookup.size and lookup.max() >= len(values):
        raise InputError(f"{interpolation} primvar has {len(values)} values, {lookup.max() + 1} are needed", field=name)
    return values[lookup]


def _vertex_normals(points: NDArray, triangles: NDArray) -> NDArray:
    """Area-weighted normals [V, 3]."""
    a, b, c = (points[triangles[:, k]].astype(float) for k in range(3))
    weighted = np.cross(b - a, c - a)
    sums = np.zeros((len(points), 3))
    for k in range(3):
        np.add.at(sums, triangles[:, k], weighted)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return (sums / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def _indexed(name: str, positions: NDArray, normals: NDArray | None, uv: NDArray | None) -> Mesh:
    """A mesh from corner values [T, 3, k], with equal corners merged."""
    parts = [array.reshape(-1, array.shape[-1]) for array in (positions, normals, uv) if array is not None]
    corners = np.ascontiguousarray(np.concatenate(parts, axis=1))
    unique, inverse = np.unique(corners, axis=0, return_inverse=True) if len(corners) else (corners, np.zeros(0, int))
    columns = iter(np.split(unique, np.cumsum([part.shape[1] for part in parts])[:-1], axis=1))
    return Mesh(
        name=name,
        positions=np.ascontiguousarray(next(columns)),
        normals=np.ascontiguousarray(next(columns)) if normals is not None else None,
        uv=np.ascontiguousarray(next(columns)) if uv is not None else None,
        faces=inverse.reshape(-1, 3).astype(np.uint32),
    )
