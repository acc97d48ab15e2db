"""Small rendered corpora whose upscaling is known by hand: a fence that stands, and a bright card that slides over a wall."""

from pathlib import Path

import numpy as np

from analytic import at, constant_sky, make_scene, path_of, plan_of, quad
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene.description import Material, SceneDescription

DARK, BRIGHT = 0.02, 0.8


def emitter(name: str, value: float) -> Material:
    return Material(name=name, base_color=(0, 0, 0), emission=(value,) * 3)


def render(scene: SceneDescription, cameras: list[np.ndarray], out: Path, **plan) -> Path:
    defaults = {"display": (96, 54), "scales": (2,), "antialiasing": 16, "hr_mip0": True}
    job = Job(
        scene=scene, scene_name="analytic", environment=None, path=path_of(*cameras), path_name="path",
        plan=plan_of(**(defaults | plan)), out=out,
    )  # fmt: skip
    list(render_sequence(job, range(len(cameras))))
    return out


def fence(bars: int = 5, width: float = 0.02) -> SceneDescription:
    """Bright bars before a dark wall, a third of an LR pixel wide at 48 pixels across; they lean, so that no row is alike."""
    lean = np.eye(4)
    lean[0, 1] = 0.15
    parts = [(quad(20, 12, "wall"), emitter("wall", DARK), at(0, 0, -6))]
    for k in range(bars):
        place = at(-2.6 + 5.2 * k / (bars - 1), 0, -3) @ lean
        parts.append((quad(width, 6, f"bar {k}"), emitter(f"bar {k}", BRIGHT), place))
    return make_scene(*parts, sky=constant_sky())


def sliding_card(step: float) -> SceneDescription:
    """A bright card that moves to the right by `step` per frame before a dark wall that stands."""
    return make_scene(
        (quad(20, 12, "wall"), emitter("wall", DARK), at(0, 0, -6)),
        (quad(1.0, 1.6, "card"), emitter("card", BRIGHT), lambda time: at(-1.2 + step * time, 0, -3)),
        sky=constant_sky(),
    )
