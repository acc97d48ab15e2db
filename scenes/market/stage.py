"""The stage that build.py fills: materials as UsdPreviewSurface networks, groups, meshes and light.

market.usda holds transforms, animation, materials and lights; its sublayer market_geometry.usdc holds the points.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt
from shapes import Shape
from sky import TO_SUN

FOLDER = Path(__file__).parent
TIMES = range(49)  # time codes, 24 a second

# name: (base colour or (texture, tint), roughness or (texture, factor), metallic, normal map, metres per repeat)
PLAIN = {
    "cobbles": (("cobbles", 1), ("cobbles_roughness", 1), 0, "cobbles_normal", 4.0),
    "flags": (("flags", 1), 0.75, 0, None, 3.2),
    "brick": (("brick", 1), 0.85, 0, "brick_normal", 2.56),
    "ochre": (("plaster", (0.78, 0.50, 0.23)), 0.9, 0, "plaster_normal", 3.2),
    "rose": (("plaster", (0.74, 0.42, 0.34)), 0.9, 0, "plaster_normal", 3.2),
    "cream": (("plaster", (0.8, 0.71, 0.55)), 0.9, 0, "plaster_normal", 3.2),
    "stone": (("plaster", (0.52, 0.47, 0.4)), 0.8, 0, "plaster_normal", 1.6),
    "tiles": (("tiles", 1), 0.8, 0, "tiles_normal", 2.4),
    "oak": (("wood", (0.42, 0.24, 0.12)), ("wood_roughness", 0.85), 0, None, 0.8),
    "pine": (("wood", (0.72, 0.47, 0.25)), ("wood_roughness", 1), 0, None, 0.6),
    "teal_paint": (("wood", (0.1, 0.3, 0.31)), ("wood_roughness", 0.7), 0, None, 0.6),
    "white_paint": (("wood", (0.95, 0.92, 0.85)), ("wood_roughness", 0.7), 0, None, 0.8),
    "red_canvas": (("canvas_red", 1), 0.9, 0, None, 0.5),
    "blue_canvas": (("canvas_blue", 1), 0.9, 0, None, 0.5),
    "green_canvas": (("canvas_green", 1), 0.9, 0, None, 0.5),
    "linen": (("burlap", (0.72, 0.64, 0.5)), 0.95, 0, None, 0.12),
    "runner": (("burlap", (0.42, 0.05, 0.045)), 0.9, 0, None, 0.1),
    "burlap": (("burlap", (0.42, 0.3, 0.17)), 0.95, 0, None, 0.16),
    "dark_cloth": (("burlap", (0.13, 0.075, 0.045)), 0.95, 0, None, 0.16),
    "copper": ((0.93, 0.53, 0.38), ("brushed_roughness", 1), 1, "brushed_normal", 1),
    "brass": ((0.88, 0.68, 0.33), ("brushed_roughness", 0.75), 1, "brushed_normal", 1),
    "steel": ((0.72, 0.73, 0.74), ("brushed_roughness", 1.1), 1, "brushed_normal", 1),
    "iron": ((0.035, 0.037, 0.04), 0.45, 0, None, 1),
    "wire": ((0.05, 0.05, 0.05), 0.5, 0, None, 1),
    "glaze": (("glaze", 1), 0.09, 0, None, 1),
    "celadon": ((0.12, 0.36, 0.29), 0.07, 0, None, 1),
    "oxblood": ((0.34, 0.03, 0.02), 0.08, 0, None, 1),
    "honey": ((0.55, 0.27, 0.05), 0.1, 0, None, 1),
    "terracotta": (("plaster", (0.52, 0.24, 0.14)), 0.85, 0, "plaster_normal", 1),
    "earth": (("plaster", (0.06, 0.04, 0.03)), 1.0, 0, None, 0.5),
    "glass": ((0.02, 0.028, 0.035), 0.04, 0, None, 1),
    "orange": (("peel", (0.95, 0.38, 0.04)), 0.4, 0, None, 1),
    "lemon": (("peel", (0.95, 0.72, 0.08)), 0.38, 0, None, 1),
    "apple": (("peel", (0.6, 0.05, 0.035)), 0.22, 0, None, 1),
    "lime": (("peel", (0.3, 0.5, 0.06)), 0.3, 0, None, 1),
    "plum": (("peel", (0.16, 0.05, 0.17)), 0.3, 0, None, 1),
    "melon": (("melon", 1), 0.28, 0, None, 1),
    "ball": (("ball", 1), 0.35, 0, None, 1),
    "feather": (("peel", (0.42, 0.44, 0.5)), 0.7, 0, None, 1),
    "chalk": ((0.82, 0.8, 0.76), 0.85, 0, None, 1),
    "red_flag": ((0.55, 0.04, 0.03), 0.9, 0, None, 1),
    "blue_flag": ((0.04, 0.16, 0.4), 0.9, 0, None, 1),
    "gold_flag": ((0.8, 0.5, 0.05), 0.9, 0, None, 1),
}
GLOW = {"lantern_glass": (7.0, 3.6, 1.1), "bulb": (5.0, 3.2, 1.5)}


class Market:
    """The stage: `group` makes an Xform, `add` a mesh below it."""

    def __init__(self) -> None:
        geometry = Sdf.Layer.CreateNew(str(FOLDER / "market_geometry.usdc"))
        self.stage = Usd.Stage.CreateNew(str(FOLDER / "market.usda"))
        self.stage.GetRootLayer().subLayerPaths.append("./market_geometry.usdc")
        self.geometry = geometry
        self.materials: dict[str, UsdShade.Material] = {}
        self.triangles = self.objects = 0
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1)
        self.stage.SetTimeCodesPerSecond(24)
        self.stage.SetStartTimeCode(0)
        self.stage.SetEndTimeCode(TIMES[-1])
        self.stage.SetDefaultPrim(self.group("").GetPrim())
        for name, (base, rough, metallic, normal, _) in PLAIN.items():
            self._material(name, base, rough, metallic, normal)
        for name, radiance in GLOW.items():
            self._material(name, (0.06, 0.04, 0.02), 0.08, 0, None, emission=radiance)
        self._material("shop", (0.05, 0.04, 0.03), 0.08, 0, None, emission=("shop", (1.6, 1.6, 1.6)))
        self._material("neon", (0.015, 0.015, 0.018), 0.25, 0, None, emission=("sign", (8, 8, 8)))
        self._material("leaves", ("leaves", (1.1, 1.15, 0.9)), 0.7, 0, None, mask="leaves")

    def group(self, path: str, place=(0, 0, 0), turn: float = 0) -> UsdGeom.Xform:
        """An Xform at `place`, turned by `turn` degrees about y."""
        xform = UsdGeom.Xform.Define(self.stage, f"/Market/{path}".rstrip("/"))
        if any(place):
            xform.AddTranslateOp().Set(Gf.Vec3d(*map(float, place)))
        if turn:
            xform.AddRotateYOp().Set(float(turn))
        return xform

    def add(self, path: str, shape: Shape, material: str, place=(0, 0, 0), turn: float = 0, size: float = 1) -> None:
        """A mesh, placed like a group and scaled: shapes that differ only in that share their arrays in the file."""
        tile = PLAIN[material][4] if material in PLAIN else 1
        with Usd.EditContext(self.stage, self.geometry):
            mesh = UsdGeom.Mesh.Define(self.stage, f"/Market/{path}")
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
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self.materials[material])
        if any(place):
            mesh.AddTranslateOp().Set(Gf.Vec3d(*(round(float(v), 5) for v in place)))
        if turn:
            mesh.AddRotateYOp().Set(float(turn))
        if size != 1:
            mesh.AddScaleOp().Set(Gf.Vec3f(size))
        self.triangles, self.objects = self.triangles + len(shape.faces), self.objects + 1

    def _material(self, name: str, base, rough, metallic: float, normal, emission=None, mask=None) -> None:
        path = f"/Market/Materials/{name}"
        material = self.materials[name] = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, f"{path}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        kinds = Sdf.ValueTypeNames
        shader.CreateInput("metallic", kinds.Float).Set(float(metallic))
        self._input(shader, "diffuseColor", kinds.Color3f, base, "rgb")
        self._input(shader, "roughness", kinds.Float, rough, "r")
        if emission:
            self._input(shader, "emissiveColor", kinds.Color3f, emission, "rgb")
        if normal:
            self._input(shader, "normal", kinds.Normal3f, (normal, 2), "rgb", bias=-1)
        if mask:
            self._input(shader, "opacity", kinds.Float, (mask, 1), "a")
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
        for time in TIMES:
            now = value(time / 24)
            op.Set(Gf.Vec3d(*(round(float(v), 5) for v in now)) if kind == "translate" else round(float(now), 4), time)

    def light(self) -> None:
        """The sun, whose intensity is the irradiance on a facing surface, and the sky."""
        sun = UsdLux.DistantLight.Define(self.stage, "/Market/Sun")
        sun.CreateIntensityAttr(4.5)
        sun.CreateColorAttr(Gf.Vec3f(1.0, 0.82, 0.58))
        sun.CreateAngleAttr(0.53)
        sun.CreateNormalizeAttr(True)
        sun.AddRotateYOp().Set(float(np.degrees(np.arctan2(TO_SUN[0], TO_SUN[2])).round(4)))
        sun.AddRotateXOp().Set(float(-np.degrees(np.arcsin(TO_SUN[1])).round(4)))
        sky = UsdLux.DomeLight.Define(self.stage, "/Market/Sky")
        sky.CreateTextureFileAttr("./textures/sky.exr")
        sky.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        sky.CreateIntensityAttr(1.05)

    def save(self) -> None:
        self.geometry.Save()
        self.stage.GetRootLayer().Save()
