"""The command line as its users meet it: exit codes, one line for each error, and nothing left behind."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import OpenEXR
import pytest
from PIL import Image

from framepairs.preview import LABEL

QUAD_OBJ = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"
STILL = {
    "version": 1,
    "fps": 4,
    "keyframes": [{"time": 0, "position": [0, 0, 4], "look_at": [0, 0, 0], "hold": 0.5}],
}
TINY = ["--display", "32x18", "--aa", "2"]


def framepairs(*arguments, cwd: Path | None = None, **environment) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "framepairs.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    (folder / "quad.obj").write_text(QUAD_OBJ)
    (folder / "still.json").write_text(json.dumps(STILL))
    (folder / "broken.json").write_text('{"version": 1,')
    (folder / "unknown.json").write_text(json.dumps(STILL | {"frames_per_second": 3}))
    twice = STILL | {"keyframes": [STILL["keyframes"][0] | {"hold": 0}] * 2}
    (folder / "twice.json").write_text(json.dumps(twice))
    pose = {"time": 0, "world_from_camera": [[1, 0, 0, float("nan")], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    (folder / "nan.json").write_text(json.dumps({"version": 1, "poses": [pose]}))
    (folder / "plan.json").write_text(json.dumps({"displai": [32, 18]}))
    (folder / "textured.usda").write_text(
        '#usda 1.0\ndef Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n'
        "  int[] faceVertexCounts = [3]\n  int[] faceVertexIndices = [0, 1, 2]\n"
        "  point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n  rel material:binding = </mat>\n}\n"
        'def Material "mat" {\n  token outputs:surface.connect = </mat/s.outputs:surface>\n'
        '  def Shader "s" {\n    uniform token info:id = "UsdPreviewSurface"\n'
        "    color3f inputs:diffuseColor.connect = </mat/t.outputs:rgb>\n    token outputs:surface\n  }\n"
        '  def Shader "t" {\n    uniform token info:id = "UsdUVTexture"\n    asset inputs:file = @gone.png@\n'
        "    float3 outputs:rgb\n  }\n}\n"
    )
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["render", "nosuch"], "nosuch: no such scene"),
        (["render", "quad.obj", "--camera", "nosuch"], "nosuch: no such camera path"),
        (["render", "quad.obj", "--camera", "broken.json"], "broken.json: not JSON"),
        (["render", "quad.obj", "--camera", "unknown.json"], "unknown.json, frames_per_second"),
        (["render", "quad.obj", "--camera", "twice.json"], "two keyframes at time 0"),
        (["render", "quad.obj", "--camera", "nan.json"], "nan.json, poses.0.world_from_camera"),
        (["render", "quad.obj", "--plan", "plan.json"], "plan.json, displai"),
        (["render", "quad.obj", "--scale", "0.5"], "scales.0"),
        (["render", "quad.obj", "--scale", "nan"], "scales.0"),
        (["render", "quad.obj", "--display", "0x18"], "display.0"),
        (["render", "quad.obj", "--display", "big"], "1920x1080"),
        (["render", "quad.obj", "--display", "--5x2"], "1920x1080"),
        (["render", "quad.obj", "--frames", "²:3"], "must look like 0:32"),
        (["render", "quad.obj", "--frames", "0:99"], "0:99 does not lie in 0:32"),
        (["render", "quad.obj", "--frames", "5"], "must look like 0:32"),
        (["render", "quad.obj", "--channels", "colour"], "unknown 'colour'"),
        (["render", "quad.obj", "--streams", "sharp"], "variants.0"),
        (["render", "quad.obj", "--backend", "metal"], "auto, llvm or cuda"),
        (["render", "quad.obj", "--environment", "gone.hdr"], "no such environment"),
        (["render", "textured.usda"], "missing texture"),
        (["render", "still.json"], "unknown scene format"),
        (["render", "quad.obj", "--out", "still.json"], "cannot be written"),
        (["render"], "Missing argument"),
        (["render", "quad.obj", "--colour"], "No such option"),
        (["validate", "gone"], "not a corpus"),
        (["upscale", "gone"], "not a corpus"),
        (["preview", "gone"], "not a corpus"),
        (["preview", "gone", "--frames", "0:1"], "needs --compare"),
        (["preview", "gone", "--compare", "raster", "path"], "no such scene"),
        (["preview", "quad.obj", "--compare", "raster", "vector"], "shading"),
        (["preview", "quad.obj", "--compare", "raster", "path", "--frames", "9:99"], "0:32"),
        (["render", "quad.obj", "--set", "anisotropy"], "key=value"),
        (["render", "quad.obj", "--set", "anisotropy=17"], "anisotropy"),
        (["render", "quad.obj", "--set", "antialiasing_pattern=circle"], "antialiasing_pattern"),
        (["brdf", "--model", "disney"], "must be one of separable_smith"),
        (["brdf", "--size", "64", "--plot", "error.gif"], ".png"),
        (["brdf", "--size", "4"], "--size"),
        (["regenerate", "gone", "--scale", "2"], "not a corpus"),
        (["describe", "gone.usd"], "no such scene"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_exit_2_and_leaves_nothing(files, tmp_path, arguments, words):
    shutil.copytree(files, tmp_path / "here")
    before = sorted(file.name for file in (tmp_path / "here").rglob("*"))
    done = framepairs(*arguments, cwd=tmp_path / "here")
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1 and lines[0].startswith("framepairs: ") and words in lines[0], done.stderr
    assert sorted(file.name for file in (tmp_path / "here").rglob("*")) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write into read-only folders")
def test_a_read_only_folder_is_refused(files, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    done = framepairs("render", files / "quad.obj", "--out", folder / "c", *TINY)
    assert done.returncode == 2 and "cannot be written" in done.stderr and not list(folder.iterdir())


@pytest.fixture(scope="module")
def corpus(files, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("cli") / "c"
    arguments = ["--camera", files / "still.json", "--scale", 2, *TINY, "--out", out, "--json"]
    done = framepairs("render", files / "quad.obj", *arguments)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["frames"], summary["rendered"], summary["sequence"]) == (3, 3, "quad_still")
    return out


def test_rendering_again_resumes_and_a_different_plan_is_refused(corpus, files):
    same = ["render", files / "quad.obj", "--camera", files / "still.json", "--scale", 2, "--display", "32x18", "--out", corpus]
    assert json.loads(framepairs(*same, "--aa", 2, "--json").stdout)["rendered"] == 0
    other = framepairs(*same, "--aa", 4)
    assert other.returncode == 2 and "plan.antialiasing" in other.stderr


def test_regenerate_adds_a_scale_and_keeps_hr(corpus, tmp_path):
    before = {file: file.read_bytes() for file in corpus.rglob("hr/*/*.exr")}
    done = framepairs("regenerate", corpus, "--scale", "2.7", "--json")
    assert done.returncode == 0, done.stderr
    record = json.loads((corpus / "quad_still/frames/000001.json").read_text())
    assert record["streams"]["lr_x2.7"]["size"] == [12, 7]  # floor(32 / 2.7 + 0.5), floor(18 / 2.7 + 0.5)
    assert all(file.read_bytes() == data for file, data in before.items())
    elsewhere = framepairs("regenerate", corpus, "--scale", "1.5", "--out", tmp_path / "new", "--json")
    assert elsewhere.returncode == 0, elsewhere.stderr
    assert all((tmp_path / "new" / file.relative_to(corpus)).read_bytes() == data for file, data in before.items())
    assert framepairs("validate", corpus, "--quiet").returncode == 0


def interrupted_inside_a_loop():
    """Dr.Jit raises its own error from whatever stops the tracing of a loop."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise RuntimeError("dr.while_loop(): encountered an exception") from error


def interrupted():
    raise KeyboardInterrupt


@pytest.mark.parametrize("outcome", [lambda: 130, interrupted, interrupted_inside_a_loop])
def test_ctrl_c_is_one_line_and_exit_130(monkeypatch, capsys, outcome):
    """In process, because a signal at a chosen moment needs none of the luck that one from outside needs."""
    from framepairs import cli

    monkeypatch.setattr(cli, "app", lambda standalone_mode: outcome())
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 130
    assert capsys.readouterr().err.strip() == "framepairs: interrupted; type the same command again"


def test_an_interrupt_that_a_library_swallows_is_remembered():
    """As those that come while trimesh is imported, which takes any exception for a missing package."""
    lines = ["import os, signal", "from framepairs import interrupts", "interrupts.listen()"]
    lines += ["try:", "    os.kill(os.getpid(), signal.SIGTERM)", "except BaseException:", "    print('swallowed')"]
    lines += ["try:", "    interrupts.check()", "except KeyboardInterrupt:", "    print('remembered')"]
    lines += ["interrupts.ignore()", "os.kill(os.getpid(), signal.SIGINT)", "print('left in peace')"]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert done.stdout.split("\n")[:3] == ["swallowed", "remembered", "left in peace"]


def test_regenerate_renders_only_the_frames_that_are_there(files, tmp_path):
    out = tmp_path / "c"
    for frames in ("0:1", "2:3"):
        arguments = ["--camera", files / "still.json", "--frames", frames, *TINY, "--out", out]
        done = framepairs("render", files / "quad.obj", *arguments)
        assert done.returncode == 0, done.stderr
    assert framepairs("regenerate", out, "--scale", "3", "-q").returncode == 0
    assert sorted(file.stem for file in out.glob("*/frames/*.json")) == ["000000", "000002"]
    shutil.move(files / "quad.obj", tmp_path / "quad.obj")
    moved = framepairs("regenerate", out, "--scale", "4", "--scene", tmp_path / "quad.obj", "-q")
    shutil.move(tmp_path / "quad.obj", files / "quad.obj")
    assert moved.returncode == 0, moved.stderr
    (tmp_path / "quad.obj").write_text(QUAD_OBJ + "# changed\n")
    other = framepairs("regenerate", out, "--scale", "5", "--scene", tmp_path / "quad.obj", "-q")
    assert other.returncode == 2 and "no scene of this corpus" in other.stderr


def test_validate_exits_1_and_names_the_file(corpus, tmp_path):
    broken = shutil.copytree(corpus, tmp_path / "broken")
    next(broken.rglob("hr/color/000001.exr")).write_bytes(b"no")
    done = framepairs("validate", broken, "--json")
    verdicts = {row["id"]: row["verdict"] for row in json.loads(done.stdout)}
    assert done.returncode == 1 and verdicts["files"] == "fail" and verdicts["schema"] == "pass"
    assert "color/000001.exr" in done.stderr


def test_warp_tells_what_agrees_and_draws_the_worst(two_quads_corpus, tmp_path):
    done = framepairs("warp", two_quads_corpus, "--stream", "hr", "--out", tmp_path / "w", "--json")
    assert done.returncode == 0, done.stderr
    rows = {row["measure"]: row for row in json.loads(done.stdout)}
    assert set(rows) == {"object_id", "position", "albedo", "normal"}
    assert all(row["consistent"] > 0.99 for row in rows.values()) and rows["position"]["p99"] < 0.01
    pictures = sorted(file.name for file in (tmp_path / "w").iterdir())
    assert len(pictures) == 4 and all(Image.open(tmp_path / "w" / name).size == (96, 54) for name in pictures)
    done = framepairs("warp", two_quads_corpus, "--stream", "lr_x9")
    assert done.returncode == 2 and "lr_x9" in done.stderr


def test_preview_and_upscale_write_what_they_say(corpus, tmp_path):
    done = framepairs("preview", corpus, "--out", tmp_path / "sheets")
    assert done.returncode == 0 and all(Path(line).is_file() for line in done.stdout.split())
    done = framepairs("upscale", corpus, "--method", "bicubic", "--method", "temporal", "--json")
    rows = json.loads(done.stdout)
    keys = ["sequence", "stream", "method", "psnr", "ssim", "flip", "tpsnr", "warp_error", "static_std", "ms"]
    assert done.returncode == 0 and all(list(row) == keys for row in rows)
    assert {row["method"] for row in rows} == {"bicubic", "temporal"}
    done = framepairs("upscale", corpus, "--method", "dlss")
    assert done.returncode == 2 and "unknown method 'dlss'" in done.stderr


def test_upscale_measures_against_the_stream_that_is_asked_for(files, tmp_path):
    arguments = ["--camera", files / "still.json", "--streams", "native,hr_mip0", *TINY, "--out", tmp_path / "c"]
    assert framepairs("render", files / "quad.obj", *arguments).returncode == 0
    done = framepairs("upscale", tmp_path / "c", "--method", "nearest", "--truth", "hr_mip0", "--json")
    assert done.returncode == 0, done.stderr
    done = framepairs("upscale", tmp_path / "c", "--truth", "hr_native")
    assert done.returncode == 2 and "no stream 'hr_native'" in done.stderr


def test_two_modes_side_by_side(files, tmp_path):
    options = ["--compare", "raster", "path", "--display", "48x27", "--spp", 4, "--set", "antialiasing=2", "--frames", "0:2"]
    done = framepairs("preview", files / "quad.obj", *options, "--out", tmp_path / "p")
    assert done.returncode == 0, done.stderr
    file = Path(done.stdout.split()[-1])
    assert file.name == "quad_raster_path.png"
    assert Image.open(file).size == (3 * 48, 2 * (27 + LABEL))


def test_brdf_writes_a_table_and_a_plot_and_tells_its_errors(tmp_path):
    table, plot = tmp_path / "t.exr", tmp_path / "p.svg"
    done = framepairs("brdf", "--size", 64, "--model", "schlick_k", "--out", table, "--plot", plot, "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert {row["method"] for row in rows} == {"hammersley", "quadrature"}
    assert min(row["max_error"] for row in rows) < 1e-4
    with OpenEXR.File(str(table), separate_channels=True) as image:
        assert set(image.channels()) == {"A", "B"} and image.channels()["A"].pixels.shape == (64, 64)
    assert plot.read_text().startswith("<?xml")


def test_lists_and_descriptions(files, tmp_path):
    assert "market" in framepairs("scenes").stdout and "market" in framepairs("cameras").stdout
    for command in ("scenes", "cameras"):
        page, listed = tmp_path / f"{command}.html", json.loads(framepairs(command, "--json").stdout)
        assert framepairs(command, "--html", page).returncode == 0
        assert page.read_text().count("data:image/jpeg") == len(listed) >= 5
    told = json.loads(framepairs("describe", files / "quad.obj", "--json").stdout)
    assert told["triangles"] == 2 and told["light"] == "default" and told["channels"]["overlay"]["needed"] is False


def test_doctor_tells_what_to_install_where_nothing_works(tmp_path):
    """A cache that claims every libLLVM broken stands for a machine without a working one."""
    from importlib.metadata import version

    from framepairs.backend import _candidates

    memory = {}
    for path, _ in _candidates():
        stat = os.stat(path)
        memory[f"{path}:{stat.st_size}:{stat.st_mtime_ns}:{version('drjit')}"] = "fails (for this test)"
    (tmp_path / "framepairs").mkdir()
    (tmp_path / "framepairs" / "libllvm.json").write_text(json.dumps(memory))
    done = framepairs("doctor", XDG_CACHE_HOME=str(tmp_path))
    assert done.returncode == 1 and "apt-get install libllvm19" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert framepairs("doctor").returncode == 0
