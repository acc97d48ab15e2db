"""The published contracts: one JSON schema for each JSON file that is read or written, generated from the models."""

import json
from functools import lru_cache
from pathlib import Path

import jsonschema

from .bundled import bundled_folder
from .camera_path import CameraPath
from .errors import InputError
from .manifest import CorpusManifest, FrameRecord, SequenceIndex
from .overlay_elements import OverlayFile
from .plan import RenderPlan
from .sampling.files import CamerasFile, SamplingHints
from .scene.animation import SceneAnimation
from .scene.variation_file import Variation

MODELS = {
    "render_plan": RenderPlan,
    "camera_path": CameraPath,
    "corpus": CorpusManifest,
    "sequence": SequenceIndex,
    "frame": FrameRecord,
    "overlay": OverlayFile,
    "scene_animation": SceneAnimation,
    "scene_variation": Variation,
    "cameras": CamerasFile,
    "scene_sampling": SamplingHints,
}


def schema_of(name: str) -> dict:
    """The schema as the code has it now."""
    schema = MODELS[name].model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"framepairs/{name}.schema.json", **schema}


def write_schemas(folder: Path) -> None:
    """Write `<name>.schema.json` for every model (`make schemas`)."""
    for name in MODELS:
        (folder / f"{name}.schema.json").write_text(json.dumps(schema_of(name), indent=1, sort_keys=True) + "\n")


@lru_cache
def _validator(name: str) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads((bundled_folder("schemas") / f"{name}.schema.json").read_text()))


def check_file(name: str, file: Path) -> None:
    """Raises InputError naming file and field where a JSON file does not follow its published schema."""
    try:
        values = json.loads(file.read_text())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    except ValueError as error:
        raise InputError(f"not JSON: {error}", file=file) from None
    for error in _validator(name).iter_errors(values):
        raise InputError(error.message[:200], file=file, field=".".join(str(part) for part in error.path) or None)


if __name__ == "__main__":
    write_schemas(bundled_folder("schemas"))
