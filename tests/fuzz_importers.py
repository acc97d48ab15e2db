"""Damaged scene files of every format: each must load, or be one InputError, in bounded time and memory.

    python tests/fuzz_importers.py FORMAT [--examples 200] [--seconds 0] [--seed 0]

Runs in a process of its own, so that a crash of a library ends it and not the tests. Of each mutated file, everything that a
renderer would ask is asked. Limits: 10 s and 2 GiB of data a file; nothing may appear outside the scene's folder, and no file
there may be read that only a path leaving the folder names. With --seconds, it goes on with further seeds.
"""

import argparse
import json
import re
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import zlib
from pathlib import Path
from random import Random

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from PIL import Image

from framepairs.errors import InputError
from framepairs.scene import load_scene, scene_hash
from gltf_files import GltfFile

MOST_SECONDS, MOST_BYTES = 10, 2 * 2**30
NUMBERS = (b"-1", b"0", b"1", b"7", b"0.5", b"1e30", b"1e400", b"4294967295", b"2147483648", b"-9223372036854775808", b"9" * 40)
TOKENS = (
    *(*NUMBERS, b"nan", b"inf"),
    *(b"../outside.png", b"/etc/passwd", b"scene", b"", b"{", b"}", b"[", b"]", b"\n", b"(", b")", b"<", b">", b"&", b"#"),
    *(b"\x00" * 4, b"\xff" * 4, b"\x00\x00\x80\x7f", b"\x00\x00\xc0\x7f", struct.pack("<I", 2**31), struct.pack("<Q", 2**40)),
)
KINDS_OF_CHANGE = ("flip", "token", "insert", "cut", "double", *["number"] * 5, *["word"] * 4)
ROOT, RAISED = (f"((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, {y}, 0, 1))" for y in (0, 1))
FACES = "0, 1, 2, 0, 2, 3"
POINTS = "(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)"
USDA = f"""#usda 1.0
(
    upAxis = "Y"
    startTimeCode = 0
    endTimeCode = 24
)
def SkelRoot "Figure"
{{
    def Skeleton "Bones"
    {{
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [{ROOT}, {RAISED}]
        uniform matrix4d[] restTransforms = [{ROOT}, {RAISED}]
        rel skel:animationSource = </Figure/Walk>
    }}
    def SkelAnimation "Walk"
    {{
        uniform token[] joints = ["a", "a/b"]
        float3[] translations.timeSamples = {{ 0: [(0,0,0), (0,1,0)], 24: [(1,0,0), (0,2,0)] }}
        quatf[] rotations = [(1,0,0,0), (1,0,0,0)]
        half3[] scales = [(1,1,1), (1,1,1)]
    }}
    def Mesh "Skin" (prepend apiSchemas = ["SkelBindingAPI", "MaterialBindingAPI"])
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [{POINTS}]
        int[] primvars:skel:jointIndices = [0, 0, 1, 1] (
            interpolation = "vertex"
            elementSize = 1
        )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
            interpolation = "vertex"
            elementSize = 1
        )
        texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")
        rel skel:skeleton = </Figure/Bones>
        rel material:binding = </Paint>
    }}
}}
def Mesh "Box"
{{
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [{FACES}]
    point3f[] points.timeSamples = {{ 0: [{POINTS}], 24: [{POINTS}] }}
    int[] creaseIndices = [0, 1]
    int[] creaseLengths = [2]
    float[] creaseSharpnesses = [2.5]
    double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 24: (1, 2, 3) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def PointInstancer "Many"
{{
    rel prototypes = </Many/Leaf>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0,0,0), (1,0,0), (2,0,0)]
    def Mesh "Leaf"
    {{
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]
        uniform token subdivisionScheme = "none"
    }}
}}
def Material "Paint"
{{
    token outputs:surface.connect = </Paint/Surface.outputs:surface>
    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Paint/Image.outputs:rgb>
        float inputs:roughness = 0.4
        token outputs:surface
    }}
    def Shader "Image"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @image.png@
        float2 inputs:st.connect = </Paint/Reader.outputs:result>
        float3 outputs:rgb
    }}
    def Shader "Reader"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}
def Camera "Eye"
{{
    float focalLength = 35
    float2 clippingRange = (0.1, 100)
}}
def RectLight "Window"
{{
    float inputs:width = 2
    float inputs:intensity.timeSamples = {{ 0: 1, 24: 5 }}
}}
"""
XML = """<scene version="3.0.0">
  <default name="size" value="2"/>
  <bsdf type="twosided" id="paint"><bsdf type="principled">
    <texture type="bitmap" name="base_color"><string name="filename" value="image.png"/></texture>
    <float name="roughness" value="0.3"/></bsdf></bsdf>
  <shape type="rectangle" id="floor"><transform name="to_world"><scale value="$size"/><rotate x="1" angle="-90"/></transform>
    <ref id="paint"/></shape>
  <shape type="sphere" id="ball"><point name="center" x="0" y="1" z="0"/><float name="radius" value="0.5"/>
    <bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf></shape>
  <shape type="obj"><string name="filename" value="mesh.obj"/><ref id="paint"/></shape>
  <shape type="cube"><emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter></shape>
  <emitter type="envmap"><string name="filename" value="image.png"/></emitter>
  <emitter type="spot"><transform name="to_world"><lookat origin="0,5,0" target="0,0,0" up="0,0,1"/></transform></emitter>
  <sensor type="perspective"><float name="fov" value="45"/>
    <film type="hdrfilm"><integer name="width" value="64"/></film></sensor>
</scene>
"""
SIDECAR = {
    "version": 1,
    "objects": {"ball": {"keyframes": [{"time": 0, "translation": [0, 0, 0]}, {"time": 1, "translation": [1, 0, 0]}]}},
}
OBJ = "mtllib mesh.mtl\no quad\n" + "".join(f"v {x} {y} 0 0.5 0.2 0.9\nvt {x} {y}\nvn 0 0 1\n" for x in (0, 1) for y in (0, 1))
OBJ += "usemtl paint\nf 1/1/1 3/3/3 4/4/4\nf 1/1/1 4/4/4 2/2/2\ng other\nf -4 -3 -2\n"
MTL = "newmtl paint\nKd 0.5 0.4 0.3\nNs 30\nd 0.7\nKe 0 0 1\nmap_Kd -s 2 2 1 image.png\nPr 0.4\nPm 0.1\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
PLY += "property uchar green\nproperty uchar blue\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
PLY += "0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 9 9 9\n3 0 1 2\n3 0 2 3\n"


def write_seeds(folder: Path, kind: str) -> tuple[str, tuple[str, ...]]:
    """Writes small whole scenes; gives the file that is loaded for a format, and those that are damaged in turn."""
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (5, 7, 3), dtype=np.uint8)).save(folder / "image.png")
    (folder / "scene.usda").write_text(USDA)
    if kind.startswith("usd"):
        _write_usd(folder)
    _write_gltf(folder)
    (folder / "scene.xml").write_text(XML)
    (folder / "scene.animation.json").write_text(json.dumps(SIDECAR))
    (folder / "mesh.obj").write_text(OBJ)
    (folder / "mesh.mtl").write_text(MTL)
    (folder / "mesh.ply").write_text(PLY)
    header = PLY[: PLY.index("end_header\n") + 11].replace("ascii", "binary_little_endian").encode()
    vertex = b"".join(struct.pack("<3f3B", x, y, 0, 1, 2, 3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    (folder / "binary.ply").write_bytes(header + vertex + struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3))
    facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (folder / "mesh.stl").write_bytes(bytes(80) + struct.pack("<I", 2) + facet * 2)
    text = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    (folder / "text.stl").write_text(f"solid a\n{text * 2}endsolid a\n")
    (folder / "mesh.off").write_text("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3 0.5 0.5 0.5\n")
    return {
        "usda": ("scene.usda", ("scene.usda", "image.png")),
        "usdc": ("scene.usdc", ("scene.usdc",)),
        "usdz": ("scene.usdz", ("scene.usdz",)),
        "gltf": ("scene.gltf", ("scene.gltf", "image.png")),
        "glb": ("scene.glb", ("scene.glb",)),
        "xml": ("scene.xml", ("scene.xml", "scene.animation.json", "mesh.obj")),
        "obj": ("mesh.obj", ("mesh.obj", "mesh.mtl", "image.png")),
        "ply": ("mesh.ply", ("mesh.ply",)),
        "binary ply": ("binary.ply", ("binary.ply",)),
        "stl": ("mesh.stl", ("mesh.stl",)),
        "text stl": ("text.stl", ("text.stl",)),
        "off": ("mesh.off", ("mesh.off",)),
    }[kind]


FORMATS = ("usda", "usdc", "usdz", "gltf", "glb", "xml", "obj", "ply", "binary ply", "stl", "text stl", "off")


def _write_usd(folder: Path) -> None:
    from pxr import Sdf, UsdUtils

    Sdf.Layer.FindOrOpen(str(folder / "scene.usda")).Export(str(folder / "scene.usdc"))
    UsdUtils.CreateNewUsdzPackage(str(folder / "scene.usda"), str(folder / "scene.usdz"))


def _write_gltf(folder: Path) -> None:
    image = {"images": [{"uri": "image.png"}], "textures": [{"source": 0}]}
    paint = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaMode": "MASK", "doubleSided": True}
    lamp = {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}, "intensity": 5}]}}
    eye = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}
    file = GltfFile(materials=[paint], extensions=lamp, extensionsUsed=list(lamp), cameras=[eye], **image)
    uv = np.float32([[0, 0], [1, 0], [0, 1]])
    joints, weights = np.uint8([[0, 1, 0, 0]] * 3), np.float32([[0.5, 0.5, 0, 0]] * 3)
    targets = [{"POSITION": np.float32([[0, 0, 1]] * 3)}]
    mesh = file.mesh(
        TEXCOORD_0=uv, JOINTS_0=joints, WEIGHTS_0=weights, targets=targets, faces=[[0, 1, 2]], primitive_keys={"material": 0}
    )  # fmt: skip
    file.node(name="figure", mesh=mesh, skin=0)
    file.node(name="a", children=[2])
    file.node(name="b", translation=[0, 1, 0], camera=0)
    file.node(name="lamp", extensions={"KHR_lights_punctual": {"light": 0}})
    file.skin([1, 2], np.array([np.eye(4)] * 2))
    file.clip(
        (1, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]], "LINEAR"), (0, "weights", [0, 1], [0, 1], "STEP"), name="walk"
    )  # fmt: skip
    file.json["scenes"] = [{"nodes": [0, 1, 3]}]
    file.save(folder)
    file.save(folder, "scene.glb")


def mutated(data: bytes, dice: Random) -> bytes:
    """`data` with one to three changes."""
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        kind, place, length = dice.choice(KINDS_OF_CHANGE), dice.randrange(len(data) + 1), dice.randint(1, 64)
        token = dice.choice(TOKENS)
        if kind == "flip" and place < len(data):
            data = data[:place] + bytes([data[place] ^ (1 << dice.randrange(8))]) + data[place + 1 :]
        elif kind == "token":
            data = data[:place] + token + data[place + len(token) :]
        elif kind == "insert":
            data = data[:place] + token * dice.randint(1, 3) + data[place:]
        elif kind == "cut":
            data = data[:place] + (data[place + length :] if dice.random() < 0.8 else b"")
        elif kind == "double":
            data = data[: place + length] + data[place:]
        elif kind in ("number", "word"):
            data = _replaced_token(data, kind, dice, token)
    return data


def _replaced_token(data: bytes, kind: str, dice: Random, token: bytes) -> bytes:
    """One whole number of a text replaced by an odd one, or one word by another of its own."""
    found = list(re.finditer(rb"-?\d+\.?\d*" if kind == "number" else rb"[A-Za-z_.][\w.:/]*", data))
    if not found:
        return data
    chosen, other = dice.choice(found), dice.choice(found).group()
    token = dice.choice((dice.choice(NUMBERS), other) if kind == "number" else (other, other, token))
    return data[: chosen.start()] + token + data[chosen.end() :]


def ask_everything(file: Path) -> None:
    """Loads a scene and asks it all that a renderer asks."""
    scene = load_scene(file)
    scene_hash(scene)
    for time_s in (0.0, 0.3, 1e3):
        assert np.shape(scene.world_from_object(time_s)) == (len(scene.objects), 4, 4)
        for function in (scene.deformed, scene.visible, scene.lights_at, scene.materials_at):
            if function is not None:
                function(time_s)
        for camera in scene.cameras:
            camera.at(time_s)
    for mesh in scene.meshes:
        assert np.isfinite(mesh.positions).all() and (not len(mesh.faces) or mesh.faces.max() < len(mesh.positions))


def fuzz(kind: str, folder: Path, examples: int, number: int) -> int:
    """Loads `examples` damaged scenes; how many loaded all the same. Raises what is no InputError."""
    whole, scene_folder = folder / "whole", folder / "scene"
    whole.mkdir(exist_ok=True)
    (folder / "outside.png").touch()
    entry, parts = write_seeds(whole, kind)
    ask_everything(whole / entry)  # the whole one loads
    outside = {path: zlib.crc32(path.read_bytes()) for path in [*whole.iterdir(), folder / "outside.png"]}
    loaded = []

    @seed(number)
    @settings(
        max_examples=examples, database=None, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
    )
    @given(st.sampled_from(parts), st.integers(0, 2**64))
    def one(part: str, roll: int) -> None:
        shutil.rmtree(scene_folder, ignore_errors=True)
        shutil.copytree(whole, scene_folder)
        (scene_folder / part).write_bytes(mutated((whole / part).read_bytes(), Random(roll)))
        before = {path.name for path in scene_folder.iterdir()}
        signal.alarm(MOST_SECONDS)
        try:
            ask_everything(scene_folder / entry)
            loaded.append(1)
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 2000, "an error is one line"
        finally:
            signal.alarm(0)
        assert {path.name for path in scene_folder.iterdir()} == before, "a file appeared in the scene's folder"

    one()
    assert outside == {path: zlib.crc32(path.read_bytes()) for path in [*whole.iterdir(), folder / "outside.png"]}
    assert {path.name for path in folder.iterdir()} <= {"whole", "scene", "outside.png"}, "a file appeared outside"
    return len(loaded)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("kind", choices=FORMATS)
    parser.add_argument("--examples", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    given_ = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder = Path(tempfile.mkdtemp(prefix="fuzz_"))
    start, number, loaded, tried = time.monotonic(), given_.seed, 0, 0
    try:
        while tried == 0 or time.monotonic() - start < given_.seconds:
            loaded, tried = loaded + fuzz(given_.kind, folder, given_.examples, number), tried + given_.examples
            number += 1
    except BaseException:
        print(f"the file that failed lies in {folder / 'scene'}", file=sys.stderr)
        raise
    shutil.rmtree(folder)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    seconds = round(time.monotonic() - start, 1)
    print(json.dumps({"kind": given_.kind, "tried": tried, "loaded": loaded, "seconds": seconds, "peak_mib": round(peak)}))


if __name__ == "__main__":
    main()
