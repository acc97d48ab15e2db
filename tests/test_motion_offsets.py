"""Motion to other frames: two back, one ahead; and that forward and backward motion cancel."""

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, fractions, make_scene, path_of, plan_of, project, quad
from framepairs.backend import dr, mi
from framepairs.channels import CHANNEL, channel_named, motion_name
from framepairs.corpus import Corpus
from framepairs.errors import InputError
from framepairs.gbuffer import gbuffer, pixel_of
from framepairs.job import Job
from framepairs.pipeline import render_sequence
from framepairs.plan import make_plan
from framepairs.projection import view_of
from framepairs.scene.description import Material
from framepairs.transforms import look_at

GRAY = Material(name="gray")
DISPLAY = (192, 108)
ERROR = 200 * 16 * 10 / 3 * 2.0**-24  # as in test_motion
OFFSETS = (-2, 1, 3)


def card(time: float) -> np.ndarray:
    """A card before the wall that slides and turns."""
    c, s = np.cos(0.2 * time), np.sin(0.2 * time)
    turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    return at(-0.4 + 0.15 * time, 0.05 * time, -2) @ turn


def cameras(count: int = 5) -> list[np.ndarray]:
    eyes = [np.array([0.06 * k, 0.02 * k, 0.03 * k]) for k in range(count)]
    return [look_at(eye, np.array([0.1, 0.05 * k, -4]), np.array([0, 1.0, 0])) for k, eye in enumerate(eyes)]


def stage(**keys) -> Stage:
    scene = make_scene((quad(30, 30), GRAY, at(0, 0, -4)), (quad(1.2, 0.9), GRAY, card))
    return Stage(scene, path_of(*cameras(), **keys), display=DISPLAY, motion_offsets=OFFSETS)


CHANNELS = frozenset({"motion", "object_id", "visibility", *map(motion_name, OFFSETS)})


@pytest.mark.parametrize("offset", [-2, -1, 1])
def test_motion_leads_to_where_the_point_is_in_that_frame(offset):
    made, frame = stage(), 2
    arrays = made.arrays(frame, "hr", CHANNELS)
    camera, tan_x, tan_y = camera_basis(made, frame)
    other, other_x, other_y = camera_basis(made, frame + offset)
    x, y = fractions(*DISPLAY)
    ray = np.stack([(2 * x - 1) * tan_x, (1 - 2 * y) * tan_y, -np.ones_like(x)], axis=-1) @ camera[:3, :3].T
    for identity, z, moved in ((1, -4, np.eye(4)), (2, -2, card(frame + offset) @ np.linalg.inv(card(frame)))):
        point = camera[:3, 3] + ((z - camera[2, 3]) / ray[..., 2])[..., None] * ray
        there = (np.concatenate([point, np.ones_like(x)[..., None]], -1) @ moved.T)[..., :3]
        expected = (project(there, other, other_x, other_y) - np.stack([x, y], -1)) * DISPLAY
        hit = arrays["object_id"][..., 0] == identity
        assert hit.sum() > 300
        assert np.abs(arrays[motion_name(offset)] - expected)[hit].max() < 10 * ERROR  # the wall is 30 units wide


def test_frames_that_the_shot_has_not_have_no_motion():
    made = stage(cuts=(3,))
    assert not made.arrays(1, "hr", CHANNELS)["motion_m2"].any()  # would be frame -1
    arrays = made.arrays(2, "hr", CHANNELS)
    assert arrays["motion_m2"].any() and not arrays["motion_p1"].any()  # frame 3 begins another shot
    assert not made.arrays(4, "hr", CHANNELS)["motion_p1"].any() and not made.arrays(0, "hr", CHANNELS)["motion_p3"].any()


def test_forward_and_backward_motion_cancel_at_the_exact_place():
    """motion(+1) of the previous frame, traced at x + motion(-1), against motion(-1), where both see the surface."""
    made, frame = stage(), 2
    arrays = made.arrays(frame, "hr", CHANNELS)
    before = made.shoot.state(frame - 1)
    x, y = fractions(*DISPLAY)
    there = [mi.Float(((v + m / s)).astype(np.float32).ravel()) for v, m, s in
             zip((x, y), np.moveaxis(arrays["motion"].astype(float), -1, 0), DISPLAY, strict=True)]  # fmt: skip
    engine = made.engine
    pose, previous = engine.shading.geometry.pose(before)
    view = view_of(before.camera, before.render_origin)
    size = tuple(dr.opaque(mi.Float, extent) for extent in DISPLAY)
    pixel = pixel_of(view, size, mi.Float(0))
    shading = engine.shading
    sample = gbuffer(shading.geometry, shading.materials, shading.brdf, pose, view, *there, pixel)
    ahead = engine._other(before, 1)
    from framepairs.motion import motion_of

    precise = view_of(before.camera, before.render_origin, precise=True)
    forward = motion_of(shading.geometry, shading.materials, pose, view, precise, ahead, sample, *there, size, False).motion
    forward = np.array(forward).T.reshape(*x.shape, 2)
    same = np.array(sample.object_id).reshape(x.shape) == arrays["object_id"][..., 0]
    seen = (arrays["visibility"][..., 0] == 7) & same
    assert seen.mean() > 0.7
    assert np.abs(forward + arrays["motion"])[seen].max() < 1e-3


def test_a_corpus_holds_what_the_plan_asks_for(tmp_path):
    scene = make_scene((quad(30, 30), GRAY, at(0, 0, -4)))
    for name, path in (("moves", path_of(*cameras(3))), ("still", path_of(*[np.eye(4)] * 3))):
        job = Job(
            scene=scene, scene_name=name, environment=None, path=path, path_name="p", out=tmp_path / name,
            plan=plan_of(display=(32, 18), motion_offsets=(-2,), channels="needed"),
        )  # fmt: skip
        list(render_sequence(job, range(3)))
        corpus = Corpus(tmp_path / name)
        assert (("motion_m2" in corpus.sequence(f"{name}_p").channels) is (name == "moves"))
        motion = corpus.read(f"{name}_p", "hr", "motion_m2", 2)
        assert motion.shape == (18, 32, 2) and motion.any() == (name == "moves")


def test_names_of_offsets():
    assert [motion_name(k) for k in (-3, -1, 2)] == ["motion_m3", "motion", "motion_p2"]
    assert channel_named("motion_m2").exr == ("X", "Y") and channel_named("motion") is CHANNEL["motion"]
    assert all(channel_named(name) is None for name in ("motion_m1", "motion_p0", "motion_x", "motion_m02"))


@pytest.mark.parametrize("offsets", [(-1,), (0,), (2, 2), (99,)])
def test_offsets_that_make_no_sense_are_refused(offsets):
    with pytest.raises(InputError, match="motion_offsets"):
        make_plan({"motion_offsets": offsets})
