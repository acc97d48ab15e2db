"""The documentation names what the code has: channels, files' keys, commands."""

import json
import re
from pathlib import Path

import pytest

from framepairs.bundled import bundled_folder
from framepairs.camera.keys import Follow, Keyframe, ObjectPoint, Pose, Shake
from framepairs.camera.moves import Dolly, FlyThrough, Hold, Orbit, Pan
from framepairs.channels import CHANNEL, CHANNELS
from framepairs.cli import app
from framepairs.manifest import CameraRecord, Constant, FileRecord, FrameEntry, SequenceRecord, StreamRecord, TableRecord
from framepairs.overlay_elements import Background, Element, Outline
from framepairs.sampling.files import PathRecord, SamplingOptions
from framepairs.scene import animation, variation_file
from framepairs.schemas import MODELS, schema_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
FILES = (ROOT / "docs" / "files.md").read_text()
NESTED = (Keyframe, Pose, SequenceRecord, Constant, TableRecord, FrameEntry, CameraRecord, StreamRecord, FileRecord)
NESTED += (ObjectPoint, Shake, Follow, Orbit, Dolly, FlyThrough, Pan, Hold)
NESTED += (Element, Outline, Background, animation.Keyframe, animation.ObjectTrack, animation.Shown, animation.Track)
NESTED += (variation_file.Daylight, variation_file.EnvironmentRule, variation_file.LightRule, variation_file.Palette)
NESTED += (variation_file.Glow, variation_file.Placement, variation_file.Absence, variation_file.Timing)
NESTED += (SamplingOptions, PathRecord)


def first_columns(text: str) -> list[str]:
    return re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)


def test_the_readmes_channel_table_is_the_channel_table():
    table = README.split("## Channels")[1].split("\n## ")[0]
    rows = [line for line in table.splitlines() if line.startswith("| `")]
    expected = [f"| `{c.name}` | `{' '.join(c.exr)}` | {c.dtype} | {c.unit} | {c.meaning} |" for c in CHANNELS]
    assert rows == expected and len(CHANNEL) == len(CHANNELS)


@pytest.mark.parametrize("name", MODELS)
def test_published_schemas_are_the_models(name):
    published = json.loads((bundled_folder("schemas") / f"{name}.schema.json").read_text())
    assert published == json.loads(json.dumps(schema_of(name)))
    assert published["additionalProperties"] is False
    assert set(published["properties"]) == set(MODELS[name].model_fields)


def test_no_schema_is_missing_or_left_over():
    assert {file.name for file in bundled_folder("schemas").iterdir()} == {f"{name}.schema.json" for name in MODELS}


def test_the_page_of_files_names_the_same_keys_as_the_models():
    sections = re.split(r"^#{2,3} ", FILES, flags=re.MULTILINE)[1:]
    documented = [first_columns(section) for section in sections]
    expected = [list(model.model_fields) for model in (*MODELS.values(), *NESTED)]
    assert sorted(documented) == sorted(expected)


def test_every_command_the_readme_shows_exists():
    known = {command.name or command.callback.__name__ for command in app.registered_commands}
    known |= {group.name for group in app.registered_groups}
    shown = set(re.findall(r"framepairs (\w+)", README)) - {"renders"}
    assert shown <= known, shown - known


def test_tests_named_by_the_conventions_exist():
    text = (ROOT / "docs" / "conventions.md").read_text()
    named = {name for group in re.findall(r"\[(test_[a-z_, ]+)\]", text) for name in group.split(", ")}
    assert named and all((ROOT / "tests" / f"{name}.py").is_file() for name in named)


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 250


def test_the_page_of_the_upscaler_names_its_methods_figures_and_relations():
    from framepairs.upscaling.roundtrip import DECLARED, RELATIONS
    from framepairs.upscaling.sequence import METHODS

    text = (ROOT / "docs" / "upscaling.md").read_text()
    rows = [set(re.findall(r"`(\w+)`", line.split("|")[1])) for line in text.splitlines() if line.startswith("| `")]
    named = set().union(*rows)
    figures = {"psnr", "ssim", "flip", "tpsnr", "warp_error", "static_std", "ms"}
    assert {*METHODS, *figures, *(relation.id for relation in RELATIONS), *DECLARED} == named
    for relation in RELATIONS:
        needed = f"{relation.needed:g} dB".replace("-", "−")
        assert f"| `{relation.id}` | {needed} |" in text
