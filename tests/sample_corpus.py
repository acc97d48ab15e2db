"""A small real corpus for the tests of everything that reads one."""

from pathlib import Path

import numpy as np

from analytic import at, constant_sky, make_scene, path_of, plan_of, quad
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.scene.description import Light, Material, SceneDescription, Slot, Texture

DISPLAY, MOVING, STILL = (96, 54), 4, 16


def checker(width: int, height: int, cell: int) -> np.ndarray:
    j, i = np.indices((height, width))
    value = np.where((i // cell + j // cell) % 2, 220, 60).astype(np.uint8)
    texels = np.stack([value, value // 2 + 40, 255 - value, np.full_like(value, 255)], axis=-1)
    return np.ascontiguousarray(texels)


def two_quads() -> SceneDescription:
    wall = Texture(name="wall", texels=checker(256, 128, 16), srgb=True)
    card = Texture(name="card", texels=checker(64, 64, 16), srgb=True)
    return make_scene(
        (quad(8, 5, "wall"), Material(name="wall", base_color=(1, 1, 1), base_texture=Slot(texture=0)), at(0, 0, -4)),
        (
            quad(1.2, 1.0, "card"),
            Material(name="card", base_color=(1, 1, 1), metallic=1.0, roughness=0.4, base_texture=Slot(texture=1)),
            lambda time: at(-1.0 + 0.35 * min(time, MOVING - 1), 0.1, -2.5),
        ),
        textures=(wall, card),
        sky=constant_sky((0.6, 0.7, 0.9)),
        lights=(Light(name="sun", kind="directional", radiance=(2, 2, 1.8), direction=(0.36, -0.48, -0.8)),),
    )


def two_quads_job(out: Path, **plan) -> Job:
    cameras = [at(0.08 * k, 0.02 * k, 0) for k in range(MOVING)] + [at(0.2, 0, 0.1)] * STILL
    path = path_of(*cameras, cuts=(MOVING,))
    defaults = {"display": DISPLAY, "scales": (2, 3), "antialiasing": 16}
    scene = two_quads()
    return Job(
        scene=scene, scene_name="two_quads", environment=None, path=path, path_name="slide",
        plan=plan_of(**(defaults | plan)), out=out,
    )  # fmt: skip


def render_two_quads(out: Path, **plan) -> Path:
    job = two_quads_job(out, **plan)
    list(render_sequence(job, range(MOVING + STILL)))
    return out
