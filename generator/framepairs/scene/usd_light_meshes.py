"""UsdLux lights that are drawn: cylinders, and meshes with a light. They are objects whose materials shine.

Sources: UsdLux's CylinderLight (an open tube along its x axis), MeshLightAPI and light:materialSyncMode of its LightAPI.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from ..errors import InputError
from .description import Material, Mesh
from .usd_light_inputs import EARLIEST, OF_RADIANCE, LightAt, differences, radiance_of, value_of, varying_attributes
from .usd_materials import MaterialReader

TUBE_ERROR = 0.003  # relative, of a tube's projected area from any side; its own area is exact
SIDES = math.ceil(math.pi / math.sqrt(3 * TUBE_ERROR))
BLACK = {"base_color": (0.0, 0.0, 0.0), "specular": 0.0}  # reflects nothing

Matrix = Callable[[UsdGeom.XformCache], NDArray[np.float64]]


def tube(name: str, radius: float, length: float) -> Mesh:
    """An open tube of SIDES sides along x around the origin, with smooth normals, seen from outside.

    Its corners lie a little outside the cylinder, so that its area is the cylinder's: r' = r (pi / n) / sin(pi / n). Seen from
    any side, its width lies between 1 + (pi / n)^2 / 6 and 1 - (pi / n)^2 / 3 times 2 r.
    """
    angle = 2 * math.pi * np.arange(SIDES) / SIDES
    around = np.stack([np.zeros(SIDES), np.cos(angle), np.sin(angle)], axis=1)
    outer = radius * (math.pi / SIDES) / math.sin(math.pi / SIDES)
    ends = [outer * around + (x, 0, 0) for x in (-length / 2, length / 2)]
    first = np.arange(SIDES)
    following = (first + 1) % SIDES
    faces = [(first, following, first + SIDES), (following, following + SIDES, first + SIDES)]
    return Mesh(
        name=name,
        positions=np.concatenate(ends).astype(np.float32),
        normals=np.tile(around, (2, 1)).astype(np.float32),
        faces=np.concatenate([np.stack(face, axis=1) for face in faces]).astype(np.uint32),
    )


def cylinder_light(
    prim: Usd.Prim, matrix: Matrix, moves: bool, reader: MaterialReader, not_read: list[str]
) -> tuple[Mesh, int] | None:
    """(mesh, index of its material) of a CylinderLight, or None where it has no area.

    matrix: of a transform cache to world_from_light [4, 4]; moves: it changes. treatAsLine is a hint that is not needed.
    Raises InputError naming the prim for numbers that are not finite.
    """
    path = str(prim.GetPath())
    radius, length = (float(value_of(prim, f"inputs:{name}")) for name in ("radius", "length"))
    if not math.isfinite(radius) or not math.isfinite(length):
        raise InputError("light with a number that is not finite", field=path)
    mesh = tube(path, radius, length)
    if min(radius, length) <= 0 or not world_area([mesh], matrix(UsdGeom.XformCache(EARLIEST))):
        not_read.append(f"{prim.GetTypeName()} {path}: it has no area")
        return None
    plain = reader.added(Material(name=path, **BLACK))
    (index,) = shining_materials(prim, [plain], [mesh], matrix, moves, reader, not_read)
    return mesh, index


def shining_materials(
    prim: Usd.Prim,
    materials: Sequence[int],
    meshes: Sequence[Mesh],
    matrix: Matrix | None,
    moves: bool,
    reader: MaterialReader,
    not_read: list[str],
) -> list[int]:
    """Copies of the materials of a prim that is a light, which shine as it does.

    By light:materialSyncMode: noMaterialResponse, the light alone and no reflection; independent, the light instead of the
    material's glow; materialGlowTintsLight, the product of both, or the light alone where the material does not glow. meshes:
    those of the materials. matrix, moves: as for `cylinder_light`; None: many places, and `normalize` divides by the area in
    the meshes' own space. Light comes from the front alone, but of meshes that are doubleSided. `not_read` grows.
    """
    path = str(prim.GetPath())
    not_read += differences(prim)
    varying = [item.GetName() for item in varying_attributes(prim) if item.GetName().startswith(("inputs:", "light:"))]
    not_read += [f"animation of {name} of {path}: it stays as it begins" for name in varying if name not in OF_RADIANCE]
    normalizes = bool(value_of(prim, "inputs:normalize"))
    if normalizes and (matrix is None or any(mesh.deforms for mesh in meshes)):
        what = "in its prototype" if matrix is None else "as it begins"
        not_read.append(f"normalize of light {path}: by its area {what}")
    mode = str(value_of(prim, "light:materialSyncMode"))
    double_sided = prim.IsA(UsdGeom.Gprim) and UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get()
    emits = "both" if double_sided else "front"
    changes = any(name in OF_RADIANCE for name in varying) or (normalizes and moves)

    def emitted(code: Usd.TimeCode) -> NDArray[np.float64]:
        light = LightAt(prim, np.eye(4), code)
        radiance = radiance_of(light)
        if light.value("inputs:normalize"):
            world = np.eye(4) if matrix is None else matrix(UsdGeom.XformCache(code))
            radiance = radiance / world_area(meshes, world)
        if not np.isfinite(radiance).all():
            raise InputError("light with a number that is not finite, or without an area", field=path)
        return radiance

    copies: dict[int, int] = {}
    for index in dict.fromkeys(materials):
        glows = mode == "materialGlowTintsLight" and _glows(reader, index)
        if glows and not np.allclose(emitted(EARLIEST), 1):
            not_read.append(f"glow of light {path} for the camera: it is tinted as its light is")

        def shine(material: Material, code: Usd.TimeCode, glows: bool = glows) -> Material:
            radiance = emitted(code)
            if mode == "noMaterialResponse":
                return Material(name=material.name, emission=_tuple(radiance), emits=emits, shines=True, **BLACK)
            glow = {"emission": _tuple(radiance * material.emission)} if glows else _plain(material, radiance)
            return replace(material, emits=emits, shines=True, not_read=(), **glow)  # the material says it

        copies[index] = reader.shining_copy(index, shine, changes)
    return [copies[index] for index in materials]


def _plain(material: Material, radiance: NDArray) -> dict:
    """The fields of an emission that nothing of the material changes."""
    tinted = material.vertex_colors == "emission"
    return {"emission": _tuple(radiance), "emission_texture": None} | ({"vertex_colors": "base_color"} if tinted else {})


def _glows(reader: MaterialReader, index: int) -> bool:
    """At some time."""
    codes = reader.codes.get(index, ())
    return any(reader.materials[index].emission) or any(any(reader.changing[index](code).emission) for code in codes)


def world_area(meshes: Sequence[Mesh], world_from_object: NDArray) -> float:
    """Of all triangles, squared scene units."""
    total = 0.0
    for mesh in meshes:
        corners = mesh.positions[mesh.faces].astype(float) @ np.asarray(world_from_object)[:3, :3].T
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        total += float(np.linalg.norm(sides, axis=1).sum() / 2)
    return total


def _tuple(vector: NDArray) -> tuple[float, float, float]:
    return tuple(np.asarray(vector, dtype=float).tolist())
