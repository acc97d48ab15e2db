"""The bundled scenes: each builds to the committed files again."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from framepairs.bundled import find_scene, scene_names
from framepairs.scene.images import read_image

TOP = Path(__file__).parents[1]
IMAGES = (".png", ".exr")
BUILT = (".usda", ".usdc", ".gltf", ".bin", ".xml", ".ply", *IMAGES)  # made by build.py; what else lies there was written


def built(folder: Path) -> set[Path]:
    return {file.relative_to(folder) for file in folder.rglob("*") if file.suffix in BUILT}


@pytest.mark.parametrize("name", scene_names())
def test_the_build_script_makes_the_committed_files_again(name, tmp_path):
    """All but PNG and EXR bytes, which depend on the encoder's version, and crates, which name usd-core's: texels are compared."""
    folder = find_scene(name).parent
    subprocess.run([sys.executable, "-m", f"scenes.{name}.build", str(tmp_path)], cwd=TOP, check=True, timeout=300)
    assert built(tmp_path) == built(folder)
    for file in sorted(built(folder)):
        if file.suffix in IMAGES:
            a, b = (read_image(where / file) for where in (tmp_path, folder))
            assert np.abs(a.astype(float) - b).max() <= (1 if a.dtype == np.uint8 else 1e-3), file
        elif file.suffix != ".usdc":
            assert len({hashlib.sha256((where / file).read_bytes()).digest() for where in (tmp_path, folder)}) == 1, file
