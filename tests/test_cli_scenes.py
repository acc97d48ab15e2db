"""The command line around a user's own scene: what it needs and saves, its cameras, files outside its folder, overlays."""

import json

import numpy as np
import OpenEXR
from PIL import Image

from framepairs.corpus import Corpus
from framepairs.scene import light_scene, load_scene
from test_cli import TINY, framepairs

STAGE = """#usda 1.0
(
    upAxis = "Y"
    startTimeCode = 0
    endTimeCode = 3
    timeCodesPerSecond = 24
)
def Mesh "Floor" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    uniform token subdivisionScheme = "none"
    rel material:binding = </Paint>
}}
def Material "Paint"
{{
    token outputs:surface.connect = </Paint/Surface.outputs:surface>
    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Paint/Image.outputs:rgb>
        token outputs:surface
    }}
    def Shader "Image"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{image}@
        float3 outputs:rgb
    }}
}}
def Camera "Main"
{{
    double3 xformOp:translate.timeSamples = {{ 0: (0, 0.5, 4), 3: (0.3, 0.5, 4) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


def stage(folder, image="paint.png"):
    (folder / "scene").mkdir(exist_ok=True)
    for place in (folder / "paint.png", folder / "scene" / "paint.png"):
        Image.new("RGB", (8, 8), (200, 120, 40)).save(place)
    file = folder / "scene" / "set.usda"
    file.write_text(STAGE.format(image=image))
    return file


def write_gray(file, radiance):
    OpenEXR.File({}, {"RGB": np.full((4, 8, 3), radiance, np.float32)}).write(str(file))


def test_describe_says_what_leaving_out_saves(tmp_path):
    file = stage(tmp_path)
    told = json.loads(framepairs("describe", file, "--display", "64x36", "--json").stdout)
    assert told["cameras"] == ["/Main"] and told["triangles"] == 2 and told["not read"] == []
    rows = told["channels"]
    assert rows["albedo"]["needed"] and rows["albedo"]["bytes"] == 0 and rows["albedo"]["milliseconds"] == 0
    for name in ("metallic", "transparency", "overlay"):
        row = rows[name]
        assert not row["needed"] and row["value"] == "constant 0" and row["bytes"] > 0 and row["milliseconds"] > 0
    assert rows["motion"]["needed"] and not rows["dual_motion"]["value"]


def test_describe_measures_motion_where_nothing_moves(tmp_path):
    still = tmp_path / "still.json"
    keyframe = {"time": 0, "position": [0, 1, 4], "look_at": [0, 0, 0], "hold": 0.5}
    still.write_text(json.dumps({"version": 1, "fps": 4, "keyframes": [keyframe]}))
    told = json.loads(framepairs("describe", stage(tmp_path), "--camera", still, "--display", "64x36", "--json").stdout)
    motion, dual = told["channels"]["motion"], told["channels"]["dual_motion"]
    assert (motion["value"], dual["value"]) == ("constant 0 0", "same as motion")
    assert motion["bytes"] > 0 and dual["bytes"] > 0
    quick = json.loads(framepairs("describe", stage(tmp_path), "--no-measure", "--json").stdout)
    assert quick["channels"]["overlay"]["bytes"] is None


def test_describe_prints_a_table(tmp_path):
    done = framepairs("describe", stage(tmp_path), "--display", "64x36", COLUMNS="160")
    assert done.returncode == 0 and "MB saved" in done.stdout and "/Main" in done.stdout
    assert any("overlay" in line and "no overlays" in line for line in done.stdout.splitlines())


def test_a_camera_of_the_scene_is_flown(tmp_path):
    file = stage(tmp_path)
    out = tmp_path / "corpus"
    done = framepairs("render", file, "--camera", "/Main", "--out", out, "--frames", "0:2", *TINY)
    assert done.returncode == 0, done.stderr
    corpus = Corpus(out)
    entry = corpus.sequence("set_Main")
    assert entry.camera_path_name == "/Main" and entry.frames == 4  # time codes 0 to 3 at 24 per second
    assert abs(corpus.record("set_Main", 1).camera.view_from_world[0][3] + 0.1) < 1e-12
    again = framepairs("regenerate", out, "--scale", "3", "--out", tmp_path / "again")
    assert again.returncode == 0, again.stderr
    wrong = framepairs("render", file, "--camera", "/Other", "--out", tmp_path / "other", *TINY)
    assert wrong.returncode == 2 and "/Main" in wrong.stderr and not (tmp_path / "other").exists()


def test_files_outside_the_folder_are_refused_unless_they_are_allowed(tmp_path):
    file = stage(tmp_path, image="../paint.png")
    for command in ("describe", "render"):
        done = framepairs(command, file, *(TINY if command == "render" else ()), cwd=tmp_path)
        assert done.returncode == 2 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1
        assert "paint.png lies outside the scene's folder (--allow-outside reads it)" in done.stderr
    assert not (tmp_path / "set-corpus").exists()
    out = tmp_path / "corpus"
    done = framepairs("render", file, "--allow-outside", "--out", out, "--frames", "0:1", *TINY)
    assert done.returncode == 0, done.stderr
    assert framepairs("regenerate", out, "--scale", "3").returncode == 2
    assert framepairs("regenerate", out, "--scale", "3", "--allow-outside").returncode == 0


def test_an_overlay_is_rendered_regenerated_and_named_where_it_is_wrong(tmp_path):
    file, out, overlay = stage(tmp_path), tmp_path / "corpus", tmp_path / "hud.json"
    overlay.write_text(json.dumps({"version": 1, "elements": [{"text": "HUD", "screen": [0.5, 0.5], "size": 0.5}]}))
    done = framepairs("render", file, "--overlay", overlay, "--out", out, "--frames", "0:1", *TINY)
    assert done.returncode == 0, done.stderr
    assert Corpus(out).read("set_orbit", "hr", "overlay", 0).max() > 0.2
    assert framepairs("regenerate", out, "--scale", "3").returncode == 0
    overlay.write_text(json.dumps({"version": 1, "elements": [{"text": "HUD", "screen": [0.5, 0.5]}]}))
    wrong = framepairs("render", file, "--overlay", overlay, "--out", tmp_path / "other", *TINY)
    assert wrong.returncode == 2 and "hud.json, elements.0: give exactly one of size, world_height" in wrong.stderr
    assert not (tmp_path / "other").exists()


def test_what_lies_beside_a_scene_is_taken_up(tmp_path):
    """A sky and an overlay, which no reader of glTF or XML needs to know of; both may be replaced."""
    file, element = stage(tmp_path), {"text": "HUD", "screen": [0.5, 0.5], "size": 0.5}
    file.with_name("set.overlay.json").write_text(json.dumps({"version": 1, "elements": [element]}))
    write_gray(file.with_name("set.environment.exr"), 0.25)
    scene = load_scene(file)
    assert scene.environment.texels.max() == 0.25 and scene.files[-1].name == "set.environment.exr"
    assert framepairs("render", file, "--out", tmp_path / "a", "--frames", "0:1", *TINY).returncode == 0
    assert Corpus(tmp_path / "a").read("set_orbit", "hr", "overlay", 0).max() > 0.2
    assert Corpus(tmp_path / "a").sequence("set_orbit").overlay == "scene"
    assert framepairs("regenerate", tmp_path / "a", "--scale", "4", "--quiet").returncode == 0
    done = framepairs("render", file, "--overlay", "none", "--out", tmp_path / "b", "--frames", "0:1", *TINY)
    assert done.returncode == 0 and Corpus(tmp_path / "b").sequence("set_orbit").overlay is None
    assert framepairs("regenerate", tmp_path / "b", "--scale", "4", "--quiet").returncode == 0
    write_gray(tmp_path / "other.exr", 0.5)
    lit, named = light_scene(scene, tmp_path / "other.exr")
    assert lit.environment.texels.max() == 0.5 and named.endswith("other.exr")


def test_sampled_paths_become_sequences_that_say_their_split(tmp_path):
    file, cameras, out = stage(tmp_path), tmp_path / "cameras", tmp_path / "corpus"
    done = framepairs("cameras", "sample", file, "--count", "3", "--frames", "3", "--out", cameras, "--json")
    told = json.loads(done.stdout)
    assert done.returncode == 0 and {path["split"] for path in told["paths"]} == {"train", "val", "test"}
    assert framepairs("render", file, "--camera", cameras, "--out", out, *TINY).returncode == 0
    corpus = Corpus(out)
    assert {name: corpus.sequence(name).split for name in corpus.sequences} == {
        f"set_{path['file'].removesuffix('.json')}": path["split"] for path in told["paths"]
    }
    assert framepairs("regenerate", out, "--scale", "4", "--quiet").returncode == 0
    assert {Corpus(out).sequence(name).split for name in corpus.sequences} == {"train", "val", "test"}
    some = framepairs("render", file, "--camera", cameras, "--split", "val", "--out", tmp_path / "val", *TINY)
    assert some.returncode == 0 and len(Corpus(tmp_path / "val").sequences) == 1
    for arguments, says in (
        (("market", "--camera", cameras), "another scene"), ((file, "--split", "val"), "--camera with a folder"),
        ((file, "--camera", cameras, "--split", "x"), "no path is of split 'x'"),
        ((file, "--camera", tmp_path), "cameras.json"),
    ):  # fmt: skip
        done = framepairs("render", *arguments, "--out", tmp_path / "no", *TINY)
        assert done.returncode == 2 and says in done.stderr and not (tmp_path / "no").exists(), done.stderr
    again = framepairs("cameras", "sample", file, "--count", "2", "--frames", "3", "--out", cameras)
    assert again.returncode == 2 and "count" in again.stderr


def test_a_file_beside_the_scene_says_where_cameras_may_go(tmp_path):
    file = stage(tmp_path)
    hints = file.with_name("set.sampling.json")
    hints.write_text(json.dumps({"version": 1, "bounds": [-1, 0, -1, 1, 2, 3]}))
    sample = ("cameras", "sample", file, "--count", "1", "--frames", "2", "--json")
    told = json.loads(framepairs(*sample, "--out", tmp_path / "a").stdout)
    assert told["options"]["bounds"] == [-1, 0, -1, 1, 2, 3]
    told = json.loads(framepairs(*sample, "--bounds=-2,0,-2,2,3,2", "--out", tmp_path / "b").stdout)
    assert told["options"]["bounds"] == [-2, 0, -2, 2, 3, 2]
    flat = '{"version": 1, "bounds": [0, 0, 0, 1, 1, 0]}'
    for text, says in ((flat, "bounds"), ("{", "set.sampling.json"), ("{}", "version")):
        hints.write_text(text)
        done = framepairs(*sample, "--out", tmp_path / "c")
        assert done.returncode == 2 and says in done.stderr and "set.sampling.json" in done.stderr, done.stderr
        assert not (tmp_path / "c").exists()
    hints.unlink()
    (tmp_path / "elsewhere.json").write_text('{"version": 1, "bounds": [-1, 0, -1, 1, 2, 3]}')
    hints.symlink_to(tmp_path / "elsewhere.json")
    assert framepairs(*sample, "--out", tmp_path / "c").returncode == 2


def test_the_same_path_at_another_frame_rate(tmp_path):
    file, out = stage(tmp_path), tmp_path / "corpus"
    path = tmp_path / "slide.json"
    ends = [{"time": t, "position": [t, 1, 4], "look_at": [0, 0, 0]} for t in (0, 0.25)]
    path.write_text(json.dumps({"version": 1, "fps": 12, "keyframes": ends}))
    for rate in ((), ("--fps", "24")):
        assert framepairs("render", file, "--camera", path, *rate, "--out", out, *TINY).returncode == 0
    corpus = Corpus(out)
    slow, fast = "set_slide", "set_slide_24fps"
    assert (corpus.sequences, len(corpus.frames(slow)), len(corpus.frames(fast))) == ([slow, fast], 4, 7)
    for frame in range(4):
        a, b = (corpus.record(name, frame * rate) for name, rate in ((slow, 1), (fast, 2)))
        assert a.time_s == b.time_s
        np.testing.assert_allclose(a.camera.view_from_world, b.camera.view_from_world, atol=1e-9)
    assert framepairs("render", file, "--camera", path, "--fps", "0", "--out", tmp_path / "no", *TINY).returncode == 2
