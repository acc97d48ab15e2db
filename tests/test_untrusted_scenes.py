"""Scenes made to harm: files outside their folder stay closed, small files ask for no great memory or time, nothing crashes.

That a file is not opened is shown by a pipe in its place: who opens one waits for ever, and the alarm ends the test.
"""

import json
import os
import signal
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from framepairs.errors import InputError
from framepairs.scene import load_scene, usd_trial
from gltf_files import GltfFile

MOST_SECONDS = 30  # of wall time: other work may slow the machine
MESH = """def Mesh "M" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
}
"""
HEADER = '#usda 1.0\n(\n    defaultPrim = "A"\n)\n'
CLIP = 'string primPath = "/A"\n double2[] active = [(0, 0)]\n double2[] times = [(0, 0), (10, 10)]'
SHAPE = '<shape type="rectangle" id="r"/>'


def too_long(*_):
    raise TimeoutError(f"{MOST_SECONDS} s")


@pytest.fixture(autouse=True)
def alarm():
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(MOST_SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def folders(tmp_path):
    """The scene's folder, and one outside it that holds pipes alone; `scene/link` leads there."""
    scene, outside = tmp_path / "scene", tmp_path / "outside"
    scene.mkdir()
    outside.mkdir()
    (scene / "link").symlink_to(outside)
    return scene, outside


def usda(file, text):
    file.write_text(HEADER + text)
    return file


def with_clips(clips, inside=""):
    return f'def Xform "A" (\n clips = {{ dictionary default = {{ {clips} }} }}\n) {{\n double x\n {inside}{MESH} }}\n'


def template(pattern, first=1001):
    times = f"double templateStartTime = {first}\n double templateEndTime = {first + 1}\n double templateStride = 1"
    return with_clips(f'string templateAssetPath = "{pattern}"\n {times}\n string primPath = "/A"')


def refused(file, words="outside"):
    with pytest.raises(InputError, match=words) as caught:
        load_scene(file)
    assert "\n" not in str(caught.value)
    return caught.value


# ---------------------------------------------------------------------------------------------------- containment

CLIPS = {
    "direct": with_clips(f"asset[] assetPaths = [@../outside/p.usda@]\n {CLIP}"),
    "link": with_clips(f"asset[] assetPaths = [@link/p.usda@]\n {CLIP}"),
    "manifest": with_clips(f"asset manifestAssetPath = @link/p.usda@\n asset[] assetPaths = [@scene.usda@]\n {CLIP}"),
    "in a variant": 'def Xform "A" (\n variants = { string v = "x" }\n prepend variantSets = "v"\n) {\n variantSet "v" = {\n'
    f' "x" (\n clips = {{ dictionary default = {{ asset[] assetPaths = [@link/p.usda@]\n {CLIP} }} }}\n ) {{\n double x\n'
    f" {MESH} }}\n }}\n}}\n",
    "template above": template("sub/../../outside/c.#.usda"),
    "template of a link": template("link/c.#.usda"),
    "numbers of four digits": template("c.#.usda"),
}


@pytest.mark.parametrize("clips", CLIPS.values(), ids=CLIPS)
def test_value_clips_stay_in_the_folder(folders, clips):
    scene, outside = folders
    for name in ("p.usda", "c.1001.usda"):
        os.mkfifo(outside / name)
    (scene / "c.1001.usda").symlink_to(outside / "c.1001.usda")
    refused(usda(scene / "scene.usda", clips))


def test_value_clips_of_a_package_stay_in_it(folders):
    scene, outside = folders
    os.mkfifo(outside / "c.1001.usda")
    with zipfile.ZipFile(scene / "scene.usdz", "w") as package:
        package.writestr("scene.usda", HEADER + template(f"{outside}/c.#.usda"))
    refused(scene / "scene.usdz")


def test_value_clips_inside_the_folder_are_read(folders):
    scene, _ = folders
    (scene / "c.1001.usda").write_text('#usda 1.0\nover "A" {}\n')
    assert len(load_scene(usda(scene / "scene.usda", template("./c.#.usda"))).objects) == 1


WRONG_CLIPS = (
    "string assetPaths = 'x'", "int assetPaths = 5", "string manifestAssetPath = 'x'", "string templateAssetPath = '.'",
    "asset templateAssetPath = @x@", "string templateAssetPath = '**x#'",
)  # fmt: skip


@pytest.mark.parametrize("clips", WRONG_CLIPS)
def test_clips_of_other_types_say_so_or_do_nothing(folders, clips):
    try:
        load_scene(usda(folders[0] / "scene.usda", with_clips(clips)))
    except InputError:
        pass


NAMES = ("../outside/p", "link/p", "./sub/../../outside/p", "{outside}/p")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("element", ("include", "spectrum", "obj", "serialized", "measured", "envmap"))
def test_mitsuba_stays_in_the_folder(folders, name, element):
    scene, outside = folders
    os.mkfifo(outside / "p.obj")
    file = name.format(outside=outside) + ".obj"
    string = f'<string name="filename" value="{file}"/>'
    text = {
        "include": f'<include filename="{file}"/>',
        "spectrum": f'<bsdf type="diffuse" id="b"><spectrum name="reflectance" filename="{file}"/></bsdf>',
        "obj": f'<shape type="obj">{string}</shape>',
        "serialized": f'<shape type="serialized">{string}</shape>',
        "measured": f'<shape type="rectangle"><bsdf type="measured">{string}</bsdf></shape>',
        "envmap": f'<emitter type="envmap">{string}</emitter>',
    }[element]
    (scene / "scene.xml").write_text(f'<scene version="3.0.0">{text}{SHAPE}</scene>')
    refused(scene / "scene.xml")


@pytest.mark.parametrize("name", (*NAMES, "..%2Foutside%2Fp", "%2e%2e/outside/p"))
def test_gltf_stays_in_the_folder(folders, name):
    scene, outside = folders
    os.mkfifo(outside / "p")
    uri = name.format(outside=outside)
    paint = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    file = GltfFile(materials=[paint], textures=[{"source": 0}], images=[{"uri": uri}])
    file.node(mesh=file.mesh(faces=[[0, 1, 2]], primitive_keys={"material": 0}))
    refused(file.save(scene) or scene / "scene.gltf")


def test_pipes_devices_and_sidecars_that_are_links_stay_closed(folders):
    scene, outside = folders
    os.mkfifo(scene / "pipe.xml")
    (scene / "scene.xml").write_text(f'<scene version="3.0.0"><include filename="pipe.xml"/>{SHAPE}</scene>')
    refused(scene / "scene.xml", "plain file")
    os.mkfifo(outside / "a.json")
    (scene / "scene.xml").write_text(f'<scene version="3.0.0">{SHAPE}</scene>')
    (scene / "scene.animation.json").symlink_to(outside / "a.json")
    refused(scene / "scene.xml")


def test_the_command_line_says_it_in_one_line_and_leaves_no_folder(folders):
    scene, outside = folders
    usda(scene / "scene.usda", CLIPS["in a variant"])
    os.mkfifo(outside / "p.usda")
    signal.alarm(60)
    for command in (["describe", "--json"], ["render", "--json", "--frames", "0:1"]):
        call = [sys.executable, "-c", "from framepairs.cli import main; main()", *command, "scene.usda"]
        done = subprocess.run(call, cwd=scene, capture_output=True, text=True, timeout=60, check=False)
        assert (done.returncode, done.stdout) == (2, "") and len(done.stderr.splitlines()) == 1
    assert sorted(item.name for item in scene.iterdir()) == ["link", "scene.usda"]


# ------------------------------------------------------------------------------------- memory, time and crashes


def doubling(arc, count=24):
    links = "".join(
        f'def "X{k}" {{\n def "a" (\n{arc.format(k + 1)}\n ) {{\n }}\n def "b" (\n{arc.format(k + 1)}\n ) {{\n }}\n}}\n'
        for k in range(count)
    )
    return f'{links}def "X{count}" {{\n {MESH} }}\n{MESH}'


@pytest.mark.parametrize("arc", ("references = </X{}>", "payload = </X{}>", "instanceable = true\nreferences = </X{}>"))
def test_references_that_double_are_counted_before_the_stage_opens(tmp_path, arc, monkeypatch):
    monkeypatch.setattr("framepairs.scene.usd_dependencies.MOST_PRIMS", 2**12)
    refused(usda(tmp_path / "scene.usda", doubling(arc)), "more than 4096 prims")


DEEP = {
    "dictionaries": "(\n customLayerData = {" + "dictionary d = {" * 50000 + "}" * 50000 + "}\n)\n",
    "tuples": 'def "A" {\n float3[] x = [' + "(" * 100000 + ")" * 100000 + "]\n}\n",
    "prims": 'def "a" {\n' * 100000 + "}\n" * 100000,
    "behind comments": "".join(f'def "a" {{ {mark}\n' for mark in ("# }", "// }", "/* } */", '( doc = "}" )')) * 25000,
    "behind a quote in a comment": '// " \n' + "(" * 100000 + '"\n',
    "behind an escape": 'def "a" (\n doc = @@@ \\@@@ " @@@ ' + "{" * 100000 + ' "\n',
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_texts_too_deep_for_the_parser_do_not_reach_it(tmp_path, text):
    (tmp_path / "scene.usda").write_text("#usda 1.0\n" + text)
    refused(tmp_path / "scene.usda", "brackets in more than 1024 others")


def test_brackets_in_strings_are_no_nesting(tmp_path):
    text = f'def "A" (\n doc = """{"(" * 2000}"""\n) {{\n # {"[" * 2000}\n {MESH} }}\n'
    assert len(load_scene(usda(tmp_path / "scene.usda", text)).objects) == 1


def test_prims_in_prims_without_end(tmp_path):
    layer = Sdf.Layer.CreateNew(str(tmp_path / "scene.usdc"))
    Sdf.CreatePrimInLayer(layer, "/a" * 300)
    layer.Save()
    refused(tmp_path / "scene.usdc", "prims in more than 256 others")


def test_clips_without_end(tmp_path):
    times = "double templateStartTime = 0\n double templateEndTime = 1e9\n double templateStride = 1e-3"
    text = with_clips(f'string templateAssetPath = "./c.#.usda"\n {times}\n string primPath = "/A"')
    refused(usda(tmp_path / "scene.usda", text), "value clips at more than")


@pytest.mark.parametrize("scheme, faces", (("none", 20_000_000), ("catmullClark", 1_000_000)))
def test_arrays_that_a_crate_packs_to_nothing(tmp_path, scheme, faces):
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usdc"))
    mesh = UsdGeom.Mesh.Define(stage, "/M")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(faces, 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray(3 * faces, 0))
    mesh.CreateSubdivisionSchemeAttr(scheme)
    stage.Save()
    assert (tmp_path / "scene.usdc").stat().st_size < 100_000
    refused(tmp_path / "scene.usdc", "corners of faces")


def test_a_pose_with_fewer_joints_than_are_used(tmp_path):
    identity = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
    skin = (
        'int[] primvars:skel:jointIndices = [0] (\n interpolation = "constant"\n)\n'
        'float[] primvars:skel:jointWeights = [1] (\n interpolation = "constant"\n)\n rel skel:skeleton = </R/S>\n'
    )
    vertex = skin.replace("[0]", "[0, 0, 0]").replace("[1]", "[1, 1, 1]").replace("constant", "vertex")
    text = 'def SkelRoot "R" {\n def Skeleton "S" {\n uniform token[] joints = ["a"]\n'
    text += f" uniform matrix4d[] bindTransforms = [{identity}]\n uniform matrix4d[] restTransforms = []\n }}\n"
    text += MESH.replace("uniform token", f"{vertex} uniform token").replace(
        '"M" {', '"M" (\n prepend apiSchemas = ["SkelBindingAPI"]\n) {'
    )
    refused(usda(tmp_path / "scene.usda", text + "}\n"), "fewer joints")


WRONG = {
    "text for a number": 'string inputs:roughness = "x"',
    "an unknown type": "wrong inputs:roughness = 0.5",
    "a vector for a number": "float3 inputs:roughness = (1, 2, 3)",
    "a number for a colour": "float inputs:diffuseColor = 1",
}


@pytest.mark.parametrize("line", WRONG.values(), ids=WRONG)
def test_inputs_of_another_type(tmp_path, line):
    material = (
        'def Material "P" {\n token outputs:surface.connect = </P/S.outputs:surface>\n def Shader "S" {\n'
        f' uniform token info:id = "UsdPreviewSurface"\n {line}\n token outputs:surface\n }}\n}}\n'
    )
    bound = MESH.replace("int[] faceVertexCounts", "rel material:binding = </P>\n int[] faceVertexCounts")
    refused(usda(tmp_path / "scene.usda", bound + material), "another type|not a USD stage")


def test_points_beyond_single_precision(tmp_path):
    text = MESH.replace("points = [(0, 0, 0)", "points.timeSamples = { 0: [(0, 0, 0)").replace(
        "(0, 1, 0)]", "(0, 1, 0)], 24: X }"
    )
    text = text.replace("point3f", "point3d").replace("X", "[(1e300, 0, 0), (1, 0, 0), (0, 1, 0)]")
    scene = load_scene(usda(tmp_path / "scene.usda", text))
    with pytest.raises(InputError, match="not finite"):
        scene.deformed(1.0)


def xml(folder, text):
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{text}{SHAPE}</scene>')
    return folder / "scene.xml"


def test_many_aliases_take_no_square_of_their_number(tmp_path):
    count = 20_000
    text = '<bsdf type="diffuse" id="b"/>' + "".join(f'<alias id="b" as="a{k}"/>' for k in range(count))
    text += "".join('<shape type="rectangle"><ref id="b"/></shape>' for _ in range(count))
    begin = time.process_time()
    assert len(load_scene(xml(tmp_path, text)).objects) == count + 1
    assert time.process_time() - begin < 8  # 1.3 s; every reference with every alias took 23 s


def test_aliases_lead_through_aliases_and_end_in_rings(tmp_path):
    chain = '<bsdf type="diffuse" id="b"/><alias id="b" as="c"/><alias id="c" as="d"/>'
    scene = load_scene(xml(tmp_path, chain + '<shape type="rectangle"><ref id="d"/></shape>'))
    assert [material.name for material in scene.materials] == ["b", "default"]
    refused(
        xml(tmp_path, '<alias id="x" as="y"/><alias id="y" as="x"/><shape type="rectangle"><ref id="x"/></shape>'), "no object"
    )


def test_many_parameters(tmp_path, monkeypatch):
    monkeypatch.setattr("framepairs.scene.mitsuba_elements.MOST_SUBSTITUTED", 2**18)
    count = 2000
    text = "".join(f'<default name="p{k}" value="1"/>' for k in range(count))
    text += "".join(f'<point name="q{k}" x="$p{k}" y="0" z="0"/>' for k in range(count))
    refused(xml(tmp_path, text), "parameters stand for")


def test_spectra_and_spheres_as_often_as_they_are_named(tmp_path):
    (tmp_path / "s.spd").write_text("".join(f"{400 + 0.005 * k:.3f} 1\n" for k in range(60_000)))
    line = '<bsdf type="diffuse" id="b{}"><spectrum name="reflectance" filename="s.spd"/></bsdf>'
    refused(xml(tmp_path, "".join(line.format(k) for k in range(100))), "spectra before it")


def test_meshes_of_a_small_scene_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr("framepairs.scene.mitsuba_shapes.SPARE_BYTES", 2**22)
    line = '<shape type="sphere"><float name="radius" value="1.{}"/></shape>'
    assert len(load_scene(xml(tmp_path, "".join(line.format(k) for k in range(1, 10)))).objects) == 10
    refused(xml(tmp_path, "".join(line.format(k) for k in range(1, 100))), "its meshes need more than")


def test_a_serialized_mesh_that_packs_to_nothing(tmp_path):
    count = 4_000_000
    head = struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", count, count)
    packed = struct.pack("<HH", 0x41C, 4) + zlib.compress(head + bytes(24 * count), 9)
    (tmp_path / "m.serialized").write_bytes(packed + struct.pack("<QI", 0, 1))
    text = '<shape type="serialized"><string name="filename" value="m.serialized"/></shape>'
    refused(xml(tmp_path, text), "more is announced than it can hold")


def test_an_image_is_read_once_for_all_bsdfs_that_are_kept(tmp_path, monkeypatch):
    from PIL import Image

    from framepairs.scene import mitsuba_kept

    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "i.png")
    calls = []
    monkeypatch.setattr(mitsuba_kept, "read_image", lambda file: calls.append(file) or np.zeros((4, 4, 4), np.uint8))
    texture = '<texture type="bitmap" name="diffuse_reflectance"><string name="filename" value="i.png"/></texture>'
    text = f'<shape type="rectangle"><bsdf type="roughplastic">{texture}</bsdf></shape>' * 5
    load_scene(xml(tmp_path, text))
    assert len(calls) <= 1


def test_a_file_too_large_for_memory(tmp_path, monkeypatch):
    file = GltfFile(materials=[{"normalTexture": {"index": 0}}], textures=[{"source": 0}], images=[{"uri": "i.png"}])
    file.node(mesh=file.mesh(faces=[[0, 1, 2]], primitive_keys={"material": 0}))
    (tmp_path / "i.png").write_bytes(b"")
    whole = Path.read_bytes

    def read_bytes(path: Path) -> bytes:
        if path.name == "i.png":
            raise MemoryError  # as for a file of terabytes
        return whole(path)

    monkeypatch.setattr(Path, "read_bytes", read_bytes)
    refused(file.save(tmp_path) or tmp_path / "scene.gltf", "memory")


def test_json_too_deep(tmp_path):
    (tmp_path / "scene.gltf").write_text('{"asset": {"version": "2.0"}, "extras": ' + "[" * 100000 + "]" * 100000 + "}")
    refused(tmp_path / "scene.gltf", "not glTF")
    (tmp_path / "scene.animation.json").write_text(json.dumps([]).replace("[]", "[" * 100000))
    refused(xml(tmp_path, ""), "not JSON")


def test_binary_layers_are_tried_in_another_process_first(tmp_path, monkeypatch):
    """usd-core ends the process on some damaged crates; which ones differs from run to run."""
    whole = usda(tmp_path / "scene.usda", MESH)
    Sdf.Layer.FindOrOpen(str(whole)).Export(str(tmp_path / "crate.usdc"))
    assert len(load_scene(tmp_path / "crate.usdc").objects) == 1
    monkeypatch.setattr(usd_trial, "CODE", "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)")
    assert len(load_scene(tmp_path / "crate.usdc").objects) == 1  # tried before
    assert len(load_scene(whole).objects) == 1  # text needs no trial
    os.utime(tmp_path / "crate.usdc", (1, 1))
    refused(tmp_path / "crate.usdc", "it is damaged, and USD's reader breaks down on it")
    monkeypatch.setattr(usd_trial, "CODE", "import time\ntime.sleep(9)")
    monkeypatch.setattr(usd_trial, "LONGEST_S", 0.2)
    os.utime(tmp_path / "crate.usdc", (2, 2))
    refused(tmp_path / "crate.usdc", "opening it takes longer than 0.2 s")
