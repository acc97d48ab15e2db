"""A USD stage that a build script fills: materials as UsdPreviewSurface networks, groups, meshes, animation and light.

<name>.usda holds transforms, animation, materials and lights; its sublayer <name>_geometry.usdc holds the points.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from .shapes import Shape

RATE = 24  # time codes a second


@dataclass(frozen=True)
class Look:
    """A metallic-roughness material.

    base, emission: linear RGB, or (image, tint or factor); roughness: a number, or (image, factor); normal, mask: an image
    (of the mask, the alpha; the same as of `base`). Images are PNG files of the folder `textures`, named without suffix.
    tile: metres per repeat of shapes whose st is in metres.
    """

    base: tuple
    roughness: float | tuple[str, float]
    metallic: float = 0
    normal: str | None = None
    tile: float = 1
    emission: tuple | None = None
    mask: str | None = None


class Stage:
    """The stage of scene `name`: `group` makes an Xform, `add` a mesh below it. `looks` are its materials by name."""

    def __init__(self, folder: Path, name: str, looks: Mapping[str, Look], seconds: float) -> None:
        geometry = Sdf.Layer.CreateNew(str(folder / f"{name}_geometry.usdc"))
        self.stage = Usd.Stage.CreateNew(str(folder / f"{name}.usda"))
        self.stage.GetRootLayer().subLayerPaths.append(f"./{name}_geometry.usdc")
        self.geometry = geometry
        self.root = f"/{name.title()}"
        self.looks = looks
        self.times = range(round(seconds * RATE) + 1)
        self.materials: dict[str, UsdShade.Material] = {}
        self.triangles = self.objects = 0
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1)
        self.stage.SetTimeCodesPerSecond(RATE)
        self.stage.SetStartTimeCode(0)
        self.stage.SetEndTimeCode(self.times[-1])
        self.stage.SetDefaultPrim(self.group("").GetPrim())
        for key, look in looks.items():
            self._material(key, look)

    def group(self, path: str, place=(0, 0, 0), turn: float = 0) -> UsdGeom.Xform:
        """An Xform at `place`, turned by `turn` degrees about y."""
        xform = UsdGeom.Xform.Define(self.stage, f"{self.root}/{path}".rstrip("/"))
        if any(place):
            xform.AddTranslateOp().Set(Gf.Vec3d(*map(float, place)))
        if turn:
            xform.AddRotateYOp().Set(float(turn))
        return xform

    def add(self, path: str, shape: Shape, material: str, place=(0, 0, 0), turn: float = 0, size: float = 1) -> None:
        """A mesh, placed like a group and scaled: shapes that differ only in that share their arrays in the file."""
        tile = self.looks[material].tile
        with Usd.EditContext(self.stage, self.geometry):
            mesh = UsdGeom.Mesh.Define(self.stage, f"{self.root}/{path}")
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(shape.points.round(5).astype(np.float32)))
            mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(shape.normals.round(4).astype(np.float32)))
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
            mesh.CreateFaceVertexCountsAttr([3] * len(shape.faces))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.faces.astype(np.int32).ravel()))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            mesh.CreateDoubleSidedAttr(True)
            st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
            )
            st.Set(Vt.Vec2fArray.FromNumpy((shape.st / tile).round(5).astype(np.float32)))
        self._placed(mesh, material, place, turn, size)
        self.triangles, self.objects = self.triangles + len(shape.faces), self.objects + 1

    def add_faceted(self, path: str, shape: Shape, material: str, place=(0, 0, 0), turn: float = 0, size: float = 1) -> None:
        """Like `add`, with flat faces: without normals, and points and st that are equal stored once; a third of the size."""
        tile = self.looks[material].tile
        points, at = np.unique(shape.points.round(4), axis=0, return_inverse=True)
        coordinates, of = np.unique((shape.st / tile).round(4), axis=0, return_inverse=True)
        faces = at.reshape(-1)[shape.faces]
        with Usd.EditContext(self.stage, self.geometry):
            mesh = UsdGeom.Mesh.Define(self.stage, f"{self.root}/{path}")
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
            mesh.CreateFaceVertexCountsAttr([3] * len(faces))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            mesh.CreateDoubleSidedAttr(True)
            kind = Sdf.ValueTypeNames.TexCoord2fArray
            st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.faceVarying)
            st.Set(Vt.Vec2fArray.FromNumpy(coordinates.astype(np.float32)))
            st.SetIndices(Vt.IntArray.FromNumpy(of.reshape(-1)[shape.faces].astype(np.int32).ravel()))
        self._placed(mesh, material, place, turn, size)
        self.triangles, self.objects = self.triangles + len(faces), self.objects + 1

    def add_subdivided(self, path: str, points, faces, st, corners, material: str, place=(0, 0, 0), turn=0.0, size=1.0) -> None:
        """A Catmull-Clark surface of quads: points [N, 3], faces [F, 4], st [M, 2] in metres and which of them each corner of
        each face takes, corners [F, 4]."""
        with Usd.EditContext(self.stage, self.geometry):
            mesh = UsdGeom.Mesh.Define(self.stage, f"{self.root}/{path}")
            mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.round(5).astype(np.float32)))
            mesh.CreateFaceVertexCountsAttr([4] * len(faces))
            mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
            mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
            mesh.CreateDoubleSidedAttr(True)
            kind = Sdf.ValueTypeNames.TexCoord2fArray
            primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.faceVarying)
            primvar.Set(Vt.Vec2fArray.FromNumpy((st / self.looks[material].tile).round(5).astype(np.float32)))
            primvar.SetIndices(Vt.IntArray.FromNumpy(corners.astype(np.int32).ravel()))
        self._placed(mesh, material, place, turn, size)
        self.triangles, self.objects = self.triangles + 2 * len(faces), self.objects + 1

    def _placed(self, mesh: UsdGeom.Mesh, material: str, place, turn: float, size: float) -> None:
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self.materials[material])
        if any(place):
            mesh.AddTranslateOp().Set(Gf.Vec3d(*(round(float(v), 5) for v in place)))
        if turn:
            mesh.AddRotateYOp().Set(float(turn))
        if size != 1:
            mesh.AddScaleOp().Set(Gf.Vec3f(size))

    def _material(self, name: str, look: Look) -> None:
        path = f"{self.root}/Materials/{name}"
        material = self.materials[name] = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, f"{path}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        kinds = Sdf.ValueTypeNames
        shader.CreateInput("metallic", kinds.Float).Set(float(look.metallic))
        self._input(shader, "diffuseColor", kinds.Color3f, look.base, "rgb")
        self._input(shader, "roughness", kinds.Float, look.roughness, "r")
        if look.emission:
            self._input(shader, "emissiveColor", kinds.Color3f, look.emission, "rgb")
        if look.normal:
            self._input(shader, "normal", kinds.Normal3f, (look.normal, 2), "rgb", bias=-1)
        if look.mask:
            self._input(shader, "opacity", kinds.Float, (look.mask, 1), "a")
            shader.CreateInput("opacityThreshold", kinds.Float).Set(0.5)

    def _input(self, shader: UsdShade.Shader, name: str, kind, value, output: str, bias: float = 0) -> None:
        """A constant, or (texture, factor) through UsdUVTexture and UsdPrimvarReader_float2."""
        target = shader.CreateInput(name, kind)
        if not (isinstance(value, tuple) and isinstance(value[0], str)):
            target.Set(Gf.Vec3f(*value) if isinstance(value, tuple) else float(value))
            return
        file, factor = value
        material = shader.GetPrim().GetParent().GetPath()
        reader = UsdShade.Shader.Define(self.stage, f"{material}/st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        image = UsdShade.Shader.Define(self.stage, f"{material}/{'diffuseColor' if output == 'a' else name}_texture")
        if output != "a":  # opacity is the alpha of the base colour's image
            image.CreateIdAttr("UsdUVTexture")
            image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./textures/{file}.png")
            space = "sRGB" if "Color" in name else "raw"
            image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
            image.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("repeat")
            image.CreateInput("wrapT", Sdf.ValueTypeNames.Token).Set("repeat")
            factors = factor if isinstance(factor, tuple) else (factor,) * 3
            if bias or set(factors) != {1}:
                image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*map(float, factors), 1))
            if bias:
                image.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(bias, bias, bias, 0))
            image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        kind = Sdf.ValueTypeNames.Float3 if output == "rgb" else Sdf.ValueTypeNames.Float
        image.CreateOutput(output, kind)
        target.ConnectToSource(image.ConnectableAPI(), output)

    def animate(self, xform: UsdGeom.Xform, kind: str, value: Callable[[float], object]) -> None:
        """Add an op ('translate', 'rotateX', 'rotateY', 'rotateZ') with value(seconds) at every time code."""
        op = {
            "translate": xform.AddTranslateOp,
            "rotateX": xform.AddRotateXOp,
            "rotateY": xform.AddRotateYOp,
            "rotateZ": xform.AddRotateZOp,
        }[kind]()
        for time in self.times:
            now = value(time / RATE)
            op.Set(Gf.Vec3d(*(round(float(v), 5) for v in now)) if kind == "translate" else round(float(now), 4), time)

    def light(self, to_sun: np.ndarray, irradiance: float, color, sky: float = 1.0) -> None:
        """The sun in the unit direction `to_sun`, with its irradiance on a facing surface, and the sky of textures/sky.exr."""
        sun = UsdLux.DistantLight.Define(self.stage, f"{self.root}/Sun")
        sun.CreateIntensityAttr(irradiance)
        sun.CreateColorAttr(Gf.Vec3f(*color))
        sun.CreateAngleAttr(0.53)
        sun.CreateNormalizeAttr(True)
        sun.AddRotateYOp().Set(float(np.degrees(np.arctan2(to_sun[0], to_sun[2])).round(4)))
        sun.AddRotateXOp().Set(float(-np.degrees(np.arcsin(to_sun[1])).round(4)))
        dome = UsdLux.DomeLight.Define(self.stage, f"{self.root}/Sky")
        dome.CreateTextureFileAttr("./textures/sky.exr")
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        dome.CreateIntensityAttr(sky)

    def save(self) -> None:
        self.geometry.Save()
        self.stage.GetRootLayer().Save()
