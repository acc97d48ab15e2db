"""Motion, dual motion and visibility against float64 projections of quads that slide, turn and hide each other."""

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, fractions, make_scene, path_of, project, quad, uv_sphere
from framepairs.scene.description import Material
from framepairs.transforms import look_at

GRAY = Material(name="gray")
DISPLAY = (192, 108)
# float32 around the render origin: places of some 10 units carry 16 roundings of 2^-24, on a screen of 200 pixels over a
# view of some 3 units.
MOTION_ERROR = 200 * 16 * 10 / 3 * 2.0**-24


def exact_motion(stage, frame, hit_world, object_motion=None):
    """Float64 motion in pixels of world points [h, w, 3] whose object was moved by `object_motion` [4, 4] since."""
    camera, tan_x, tan_y = camera_basis(stage, frame)
    before, before_x, before_y = camera_basis(stage, frame - 1)
    then = hit_world
    if object_motion is not None:
        then = np.concatenate([hit_world, np.ones_like(hit_world[..., :1])], axis=-1) @ np.linalg.inv(object_motion).T
        then = then[..., :3]
    moved = project(then, before, before_x, before_y) - project(hit_world, camera, tan_x, tan_y)
    return moved * np.array(DISPLAY)


def on_plane(stage, frame, z, jitter=(0.0, 0.0)):
    """World points [h, w, 3] on the plane of constant z that the pixels see."""
    camera, tan_x, tan_y = camera_basis(stage, frame)
    x, y = fractions(*DISPLAY, jitter)
    local = np.stack([(2 * x - 1) * tan_x, (1 - 2 * y) * tan_y, -np.ones_like(x)], axis=-1)
    ray = local @ camera[:3, :3].T
    t = (z - camera[2, 3]) / ray[..., 2]
    return camera[:3, 3] + t[..., None] * ray


@pytest.mark.parametrize("far_away", [0.0, 1e6])
def test_camera_motion_over_a_plane(far_away):
    away = at(far_away, -far_away, far_away)
    cameras = [away, away @ look_at(np.array([0.3, 0.1, 0.2]), np.array([0.5, 0, -4]), np.array([0.05, 1.0, 0]))]
    stage = Stage(make_scene((quad(60, 60), GRAY, away @ at(0, 0, -4))), path_of(*cameras), display=DISPLAY)
    motion = stage.arrays(1, "hr")["motion"]
    near = Stage(
        make_scene((quad(60, 60), GRAY, at(0, 0, -4))), path_of(*(at(-far_away, far_away, -far_away) @ c for c in cameras)),
        display=DISPLAY,
    )  # fmt: skip
    assert np.abs(motion - exact_motion(near, 1, on_plane(near, 1, -4))).max() < 20 * MOTION_ERROR  # a plane 60 units wide


def test_object_motion_under_a_moving_camera():
    moves = [at(0.1, -0.2, -3), at(0.4, 0.1, -3)]
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
    poses = [moves[0], moves[1] @ turn]
    stage = Stage(
        make_scene((quad(1.5, 1.2), GRAY, lambda t: poses[round(t)])), path_of(np.eye(4), at(0.1, 0.05, 0)), display=DISPLAY
    )
    arrays = stage.arrays(1, "hr")
    hit = arrays["object_id"][..., 0] == 1
    expected = exact_motion(stage, 1, on_plane(stage, 1, -3), poses[1] @ np.linalg.inv(poses[0]))
    assert hit.sum() > 500
    assert np.abs(arrays["motion"] - expected)[hit].max() < MOTION_ERROR
    sky = ~hit  # the camera only travels: the sky stands still
    assert not arrays["motion"][sky].any()


def test_lr_motion_is_in_its_own_pixels_at_its_jittered_sample():
    stage = Stage(
        make_scene((quad(60, 60), GRAY, at(0, 0, -4))), path_of(np.eye(4), at(0.25, -0.1, 0.3)), display=DISPLAY, scales=(2.7,)
    )
    name = "lr_x2.7_jittered_mip-1.433"
    rendered = stage.engine.render(stage.shoot.state(1), stage.streams[name], frozenset({"motion"}), 0)
    width, height = stage.streams[name].size
    camera, tan_x, tan_y = camera_basis(stage, 1)
    x, y = fractions(width, height, rendered.jitter)
    point = np.stack([(2 * x - 1) * tan_x * 4.3 + 0.25, (1 - 2 * y) * tan_y * 4.3 - 0.1, np.full_like(x, -4)], axis=-1)
    expected = (project(point, np.eye(4), tan_x, tan_y) - np.stack([x, y], axis=-1)) * np.array([width, height])
    assert np.abs(rendered.arrays["motion"] - expected).max() < 20 * MOTION_ERROR


def test_the_sky_moves_by_the_cameras_rotation_and_lens():
    turned = look_at(np.zeros(3), np.array([0.3, 0.1, -2]), np.array([0, 1.0, 0]))
    path = path_of(np.eye(4), turned)
    zoomed = path.model_copy(update={"poses": (path.poses[0], path.poses[1].model_copy(update={"fov_y_deg": 50})) })
    stage = Stage(make_scene(), zoomed, display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    expected = exact_motion(stage, 1, on_plane_direction(stage, 1))
    assert np.abs(arrays["motion"] - expected).max() < MOTION_ERROR
    assert np.array_equal(arrays["motion"], arrays["dual_motion"])


def on_plane_direction(stage, frame):
    """Points so far along the pixels' rays that the origin no longer matters."""
    camera, tan_x, tan_y = camera_basis(stage, frame)
    x, y = fractions(*DISPLAY)
    local = np.stack([(2 * x - 1) * tan_x, (1 - 2 * y) * tan_y, -np.ones_like(x)], axis=-1)
    return 1e9 * (local @ camera[:3, :3].T)


def test_nothing_moves_nothing_and_a_reset_forgets():
    scene = make_scene((quad(3, 2), GRAY, at(0, 0, -3)), (quad(1, 1), GRAY, lambda t: at(0.2, 0, -2)))
    stage = Stage(scene, path_of(*[at(0.3, 0.2, 0.1)] * 2, at(0, 0, 1), cuts=(2,)), display=DISPLAY, scales=(3,))
    for stream in stage.streams:
        still = stage.arrays(1, stream)
        assert not still["motion"].any() and not still["dual_motion"].any()
        assert (still["visibility"] == 7).all()
        for frame in (0, 2):
            reset = stage.arrays(frame, stream)
            assert not any(reset[name].any() for name in ("motion", "dual_motion", "visibility"))


def test_two_sliding_quads_dual_motion_and_visibility():
    """A near quad slides right over a far wall: what it uncovers takes the near quad's place, by hand."""
    step, near_z, far_z = 0.5, -2.0, -4.0
    scene = make_scene((quad(60, 60), GRAY, at(0, 0, far_z)), (quad(1, 1), GRAY, lambda t: at(step * t, 0, near_z)))
    stage = Stage(scene, path_of(np.eye(4), np.eye(4)), display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    _, tan_x, _ = camera_basis(stage)
    x, y = fractions(*DISPLAY)
    world_x, world_y = (2 * x - 1) * tan_x * -near_z, (1 - 2 * y) * tan_x / 16 * 9 * -near_z
    was_covered = (np.abs(world_x) < 0.5) & (np.abs(world_y) < 0.5)
    is_near = (np.abs(world_x - step) < 0.5) & (np.abs(world_y) < 0.5)
    edge = 0.5 * tan_x * 4 / DISPLAY[0]  # half a pixel at the near quad's depth
    clear = (np.abs(np.abs(world_x) - 0.5) > edge) & (np.abs(np.abs(world_y) - 0.5) > edge)
    clear &= np.abs(np.abs(world_x - step) - 0.5) > edge
    uncovered = was_covered & ~is_near & clear
    slide = step / (tan_x * -near_z) * 0.5 * DISPLAY[0]  # pixels to the right per frame
    assert uncovered.sum() > 300
    assert not arrays["motion"][uncovered].any()  # the wall stands still
    # y = x; what covered it went right by `slide`, so y - z = -slide
    assert np.abs(arrays["dual_motion"][uncovered] - (-slide, 0)).max() < 1e-3
    assert (arrays["visibility"][uncovered] == 3).all()
    rest = clear & ~uncovered
    assert np.array_equal(arrays["dual_motion"][rest], arrays["motion"][rest])
    assert (arrays["visibility"][rest] == 7).all()
    assert np.abs(arrays["motion"][is_near & clear] - (-slide, 0)).max() < MOTION_ERROR


def test_what_the_sky_left_uncovered_gets_the_skys_motion():
    """A card that was not there before stands where the sky was seen: z is the sky's place now."""
    scene = make_scene((quad(1, 1), GRAY, lambda t: at(40 * (1 - t), 0, -2)))
    turned = look_at(np.zeros(3), np.array([0.1, 0, -2]), np.array([0, 1.0, 0]))
    stage = Stage(scene, path_of(np.eye(4), turned), display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    card = arrays["object_id"][..., 0] == 1
    assert card.sum() > 500 and (arrays["visibility"][card] == 2).all()  # it came from outside the frame
    assert np.array_equal(arrays["motion"][card], arrays["dual_motion"][card])
    assert np.isfinite(arrays["motion"]).all()


def test_points_behind_the_previous_camera_get_a_long_finite_motion():
    cameras = [at(0, 0, -5), np.eye(4)]  # the camera flew backwards past the card
    stage = Stage(make_scene((quad(1, 1), GRAY, at(0.7, 0.6, -2))), path_of(*cameras), display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    card = arrays["object_id"][..., 0] == 1
    assert card.any() and (arrays["visibility"][card] & 2 == 0).all()
    length = np.linalg.norm(arrays["motion"][card], axis=-1)
    assert np.abs(length / (2 * max(DISPLAY)) - 1).max() < 1e-5
    assert (arrays["motion"][card][:, 0] > 0).all() and (arrays["motion"][card][:, 1] < 0).all()  # right of it and above


@pytest.mark.parametrize("fov", [1.0, 170.0])
def test_extreme_fields_of_view_stay_finite_and_exact(fov):
    stage = Stage(
        make_scene((quad(200, 200), GRAY, at(0, 0, -4))), path_of(np.eye(4), at(0.01, 0, 0), fov_y_deg=fov), display=DISPLAY
    )
    arrays = stage.arrays(1, "hr")
    covered = arrays["object_id"][..., 0] == 1
    exact = exact_motion(stage, 1, on_plane(stage, 1, -4))
    assert covered.any() and np.isfinite(arrays["motion"]).all()
    # 200 units in float32, seen through 1 degree (0.07 units over 108 pixels) or 170 degrees
    bound = 4 * 200 * 2.0**-24 * DISPLAY[1] / (2 * 4 * np.tan(np.radians(fov) / 2)) + 1e-4
    assert np.abs(arrays["motion"] - exact)[covered].max() < bound


def test_zero_scale_transforms_draw_nothing_and_break_nothing():
    squashed = at(0, 0, -2)
    squashed[:3, :3] = 0
    scene = make_scene((quad(1, 1), GRAY, lambda t: squashed if t < 1 else at(0, 0, -2)), (quad(9, 9), GRAY, at(0, 0, -5)))
    arrays = Stage(scene, path_of(np.eye(4), at(0.1, 0, 0)), display=DISPLAY).arrays(1, "hr")
    assert set(np.unique(arrays["object_id"])) >= {1, 2}
    assert all(np.isfinite(arrays[name]).all() for name in ("motion", "dual_motion", "color", "normal"))


def test_any_frame_alone_equals_itself_in_a_sequence_bit_for_bit():
    scene = make_scene((quad(4, 3), GRAY, at(0, 0, -4)), (quad(1, 1), GRAY, lambda t: at(0.3 * t, 0.1 * t, -2)))
    path = path_of(*[at(0.1 * k, 0, 0) for k in range(6)])
    stage = Stage(scene, path, display=DISPLAY)
    in_order = [stage.arrays(frame, "hr") for frame in range(6)]
    for frame in (4, 1, 5):
        alone = Stage(scene, path, display=DISPLAY).arrays(frame, "hr")
        assert all(np.array_equal(alone[name], in_order[frame][name]) for name in alone)
    again = stage.arrays(2, "hr")
    assert all(np.array_equal(again[name], in_order[2][name]) for name in again)


@pytest.mark.parametrize("extent", [2e3, 2e5])
def test_motion_over_a_plane_a_thousand_times_larger_than_the_view(extent):
    """Two triangles: float32 places on them would err by 2^-24 of their size, 0.02 and 2 pixels of 1080 here."""
    size = (480, 1080)
    turn = look_at(np.array([0.05, 0.02, 0.03]), np.array([0.5, 0.1, -4]), np.array([0.02, 1.0, 0]))
    stage = Stage(
        make_scene((quad(extent, extent), GRAY, at(0, 0, -2) @ tilted(0.3))), path_of(np.eye(4), turn), display=size
    )
    arrays = stage.arrays(1, "hr", frozenset({"motion", "object_id", "visibility"}))
    camera, tan_x, tan_y = camera_basis(stage, 1)
    x, y = fractions(*size)
    local = np.stack([(2 * x - 1) * tan_x, (1 - 2 * y) * tan_y, -np.ones_like(x)], axis=-1)
    ray, normal = local @ camera[:3, :3].T, tilted(0.3)[:3, 2]
    t = ((np.array([0, 0, -2]) - camera[:3, 3]) @ normal) / (ray @ normal)
    point = camera[:3, 3] + t[..., None] * ray
    before, before_x, before_y = camera_basis(stage, 0)
    expected = (project(point, before, before_x, before_y) - np.stack([x, y], -1)) * size
    assert (arrays["object_id"] == 1).all()
    # what is left is x = (i + 0.5) / width in float32: 2^-25 of 1080 pixels, times what the motion changes across the frame
    assert np.abs(arrays["motion"] - expected).max() < 2e-4
    inside = (arrays["visibility"] & 1) == 1
    # a few pixels at the diagonal meet its other triangle, at depths that float32 places cannot tell apart
    assert inside.mean() > 0.5 and (arrays["visibility"][inside] == 7).mean() > 0.999


def tilted(angle: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return matrix


def test_a_large_plane_that_stands_still_does_not_move():
    stage = Stage(
        make_scene((quad(1e5, 1e5), GRAY, at(0, 0, -2) @ tilted(0.3))), path_of(*[at(0.1, 0, 0)] * 2), display=DISPLAY
    )
    assert not stage.arrays(1, "hr")["motion"].any()


def spinning(time: float) -> np.ndarray:
    """A ball that rolls to the right, grows and is sheared."""
    c, s = np.cos(0.4 * time), np.sin(0.4 * time)
    turn = np.array([[c, 0, s, 0], [0.3 * time, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
    return at(-0.8 + 0.5 * time, 0.1, -4) @ turn @ np.diag([0.6, 0.6 + 0.1 * time, 0.6, 1])


def passing(time: float) -> np.ndarray:
    """A mirrored ball that passes before the other one to the left and towards the camera."""
    return at(0.7 - 0.4 * time, -0.2, -3 + 0.3 * time) @ np.diag([-0.4, 0.5, 0.4, 1])


def test_balls_that_turn_grow_shear_and_pass_each_other():
    """At each pixel the material point is where depth says; its object's float64 matrices say where it was."""
    balls = [(uv_sphere(96, 48), GRAY, matrix) for matrix in (spinning, passing)]
    stage = Stage(make_scene(*balls), path_of(*(at(0.05 * k, 0.02 * k, 0.1 * k) for k in range(4))), display=DISPLAY)
    for frame in (1, 2, 3):
        arrays = stage.arrays(frame, "hr")
        camera, tan_x, tan_y = camera_basis(stage, frame)
        before, before_x, before_y = camera_basis(stage, frame - 1)
        x, y = fractions(*DISPLAY)
        depth = np.where(np.isfinite(arrays["depth"][..., 0]), arrays["depth"][..., 0], 1).astype(float)
        local = np.stack([(2 * x - 1) * tan_x * depth, (1 - 2 * y) * tan_y * depth, -depth, np.ones_like(x)], axis=-1)
        world = local @ camera.T
        for identity, matrix in ((1, spinning), (2, passing)):
            then = (world @ (matrix(frame - 1) @ np.linalg.inv(matrix(frame))).T)[..., :3]
            expected = (project(then, before, before_x, before_y) - np.stack([x, y], -1)) * np.array(DISPLAY)
            hit = arrays["object_id"][..., 0] == identity
            assert hit.sum() > 300
            # depth itself carries a few roundings of 4 units, seen through the motion's change with depth
            assert np.abs(arrays["motion"] - expected)[hit].max() < 4 * MOTION_ERROR
        hidden = (arrays["visibility"][..., 0] & 4) == 0
        assert hidden.any() and np.array_equal(arrays["dual_motion"][~hidden], arrays["motion"][~hidden])


def test_an_object_that_jumps_across_the_screen():
    places = [at(-200, 0, -3), at(0, 0, -3), at(300, 5, -3)]
    stage = Stage(
        make_scene((quad(60, 60), GRAY, at(0, 0, -10)), (quad(2, 2), GRAY, lambda t: places[round(t)])),
        path_of(*[np.eye(4)] * 3), display=DISPLAY,
    )  # fmt: skip
    came, left = (stage.arrays(frame, "hr") for frame in (1, 2))
    hit = came["object_id"][..., 0] == 2
    _, tan_x, _ = camera_basis(stage, 1)
    assert np.allclose(came["motion"][hit], [-200 / (2 * 3 * tan_x) * DISPLAY[0], 0], rtol=1e-5, atol=1e-3)
    assert not (came["visibility"][hit] & 1).any() and hit.sum() > 1000
    uncovered = (left["visibility"][..., 0] & 4) == 0
    assert uncovered.sum() == hit.sum() and not left["motion"].any()
    # what it hid comes out with its motion: the wall stands still, the card went 300 to the right
    away = np.array([300 / (2 * 3 * tan_x) * DISPLAY[0], 5 / (2 * 3 * tan_x) * DISPLAY[0]])
    dual = left["dual_motion"][uncovered]
    assert np.isfinite(dual).all() and np.allclose(dual, away * [-1, 1], rtol=1e-4, atol=1e-2)


def test_a_surface_that_crosses_the_near_plane_stays_finite():
    floor = at(0, -0.02, 0) @ tilted(-np.pi / 2)
    stage = Stage(make_scene((quad(50, 50), GRAY, floor)), path_of(at(0, 0, 0.3), np.eye(4), near=0.05), display=DISPLAY)
    arrays = stage.arrays(1, "hr")
    assert (arrays["object_id"] == 1).any() and all(
        np.isfinite(array).all() for name, array in arrays.items() if name != "depth"
    )
    assert arrays["depth"].min() >= 0.05 * (1 - 2.0**-20)
