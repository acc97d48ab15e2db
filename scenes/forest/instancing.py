"""What the scene's stage has beside scenes/making: abstract prototypes, points that sway, instancers, light from vertices."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt
from scenes.making.usd_stage import RATE, Stage

from .wind import CYCLE_S, EVERY, swayed

PROTOTYPES = "Prototypes"


@dataclass(frozen=True)
class Member:
    """One instance: which prototype, its place, its turn about y and lean [degrees about x, z], its size."""

    prototype: str
    place: tuple[float, float, float]
    turn: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)
    size: float = 1.0


def begin_prototypes(m: Stage) -> None:
    """Prototypes live below an abstract prim: they are drawn where instances refer to them, and nowhere else."""
    m.group(PROTOTYPES).GetPrim().SetSpecifier(Sdf.SpecifierClass)


def prototype(m: Stage, name: str) -> str:
    """An empty prototype; its meshes go below the path that is returned, by Stage.add."""
    m.group(f"{PROTOTYPES}/{name}")
    return f"{PROTOTYPES}/{name}"


def sway(m: Stage, path: str, points: np.ndarray, reach: np.ndarray, seed: int) -> None:
    """Gives a mesh points that move in the wind; the last sample is the first again."""
    mesh = UsdGeom.Mesh(m.stage.GetPrimAtPath(f"{m.root}/{path}"))
    samples = {code: swayed(points, reach, code / RATE, seed) for code in range(0, round(CYCLE_S * RATE) + 1, EVERY)}
    with Usd.EditContext(m.stage, m.geometry):
        mesh.GetPointsAttr().Clear()
        for code, now in samples.items():
            mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(now.round(4).astype(np.float32)), code)


def recoloured(m: Stage, name: str, of: str, materials: dict[str, str]) -> str:
    """A prototype that is another one in other materials, by the name of its meshes."""
    prim = UsdGeom.Xform.Define(m.stage, f"{m.root}/{PROTOTYPES}/{name}").GetPrim()
    prim.GetReferences().AddInternalReference(f"{m.root}/{PROTOTYPES}/{of}")
    for mesh, material in materials.items():
        over = m.stage.OverridePrim(prim.GetPath().AppendChild(mesh))
        UsdShade.MaterialBindingAPI.Apply(over).Bind(m.materials[material])
    return name


def instance(m: Stage, path: str, member: Member) -> None:
    """One prim that refers to a prototype."""
    prim = m.group(path, member.place, member.turn).GetPrim()
    if member.size != 1:
        UsdGeom.Xformable(prim).AddScaleOp().Set(Gf.Vec3f(round(member.size, 4)))
    prim.GetReferences().AddInternalReference(f"{m.root}/{PROTOTYPES}/{member.prototype}")
    prim.SetInstanceable(True)


def scatter(m: Stage, path: str, members: Sequence[Member]) -> None:
    """A point instancer."""
    names = sorted({member.prototype for member in members})
    instancer = UsdGeom.PointInstancer.Define(m.stage, f"{m.root}/{path}")
    for name in names:
        instancer.CreatePrototypesRel().AddTarget(f"{m.root}/{PROTOTYPES}/{name}")
    instancer.CreateProtoIndicesAttr([names.index(member.prototype) for member in members])
    with Usd.EditContext(m.stage, m.geometry):
        places = np.array([member.place for member in members]).round(4)
        instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(places.astype(np.float32)))
        instancer.CreateOrientationsAttr(Vt.QuathArray([_quaternion(member) for member in members]))
        sizes = np.repeat([[round(member.size, 4)] for member in members], 3, axis=1)
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(sizes.astype(np.float32)))


def _quaternion(member: Member) -> Gf.Quath:
    turn = Gf.Rotation(Gf.Vec3d.YAxis(), member.turn)
    lean = Gf.Rotation(Gf.Vec3d.XAxis(), member.lean[0]) * Gf.Rotation(Gf.Vec3d.ZAxis(), member.lean[1])
    quaternion = (turn * lean).GetQuat()  # Gf composes from left to right: first the turn, then the lean
    return Gf.Quath(float(quaternion.GetReal()), *(float(v) for v in quaternion.GetImaginary()))


def shining_vertices(m: Stage, material: str) -> None:
    """The material's emission is the primvar `mist`."""
    base = f"{m.root}/Materials/{material}"
    reader = UsdShade.Shader.Define(m.stage, f"{base}/mist")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("mist")
    output = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    surface = UsdShade.Shader.Get(m.stage, f"{base}/surface")
    surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(output)


def set_ior(m: Stage, material: str, ior: float) -> None:
    surface = UsdShade.Shader.Get(m.stage, f"{m.root}/Materials/{material}/surface")
    surface.CreateInput("ior", Sdf.ValueTypeNames.Float).Set(ior)


def add_mist(m: Stage, path: str, points: np.ndarray, radiance: Callable[[np.ndarray], np.ndarray]) -> None:
    """Gives a mesh the primvar `mist`: radiance of points [n, 3]."""
    with Usd.EditContext(m.stage, m.geometry):
        prims = UsdGeom.PrimvarsAPI(m.stage.GetPrimAtPath(f"{m.root}/{path}"))
        values = prims.CreatePrimvar("mist", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex)
        values.Set(Vt.Vec3fArray.FromNumpy(radiance(points).round(4).astype(np.float32)))
