"""Real third-party scenes, with the default orbit and the default light: a validated corpus from what others made."""

import numpy as np
import pytest

from analytic import plan_of
from framepairs.corpus import Corpus
from framepairs.frame import orbit
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene import light_scene, load_scene
from framepairs.validate import validate_corpus

MOVING = (
    "AnimatedCubeUSD/AnimatedCube.usdz",
    "RiggedFigureUSD/RiggedFigure.usdz",
    "Fox/Fox.glb",
    "CesiumMilkTruck/CesiumMilkTruck.glb",
    "MorphStressTest/MorphStressTest.gltf",
)
STILL = ("FlightHelmet/FlightHelmet.gltf", "BreakfastRoom/BreakfastRoom.gltf", "AlphaBlendModeTest/AlphaBlendModeTest.glb")
BLENDED = "RoughnessTestUSD/RoughnessTest.usdz"  # cut out of images by opacity without a threshold: no opaque surface


@pytest.mark.parametrize("name", [*MOVING, *STILL, BLENDED])
def test_a_third_party_scene_gives_a_validated_corpus(assets, tmp_path, name):
    file = find(assets, name)
    scene, light = light_scene(load_scene(file), None)
    assert light == "default" and scene.moves == (name in MOVING)
    job = Job(
        scene=scene, scene_name=str(file), environment=light, path=orbit(scene), path_name="orbit", out=tmp_path / "c",
        plan=plan_of(display=(240, 135), scales=(2,), antialiasing=4, channels="needed"),
    )  # fmt: skip
    list(render_sequence(job, range(12, 20)))
    corpus = Corpus(tmp_path / "c")
    failed = {result.id: result.worst for result in validate_corpus(corpus) if result.verdict == "fail"}
    assert failed == {}
    (sequence,) = corpus.sequences
    color = corpus.read(sequence, "hr", "color", 15)
    seen = corpus.read(sequence, "hr", "transparency" if name == BLENDED else "object_id", 15)[..., 0] > 0.5
    assert 0.02 < seen.mean() < 0.9
    assert 0.01 < np.median(color[seen]) < 2
    motion = corpus.read(sequence, "hr", "motion", 15)
    assert np.abs(motion).max() > 0.5


def find(assets, name: str):
    """The file of that name below the assets, wherever its folder keeps it."""
    folder, file = name.split("/")
    return next((assets / folder).rglob(file))
