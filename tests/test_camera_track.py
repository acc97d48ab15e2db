"""Camera tracks: smoothness, what is looked at, following, shaking, and the extreme cases."""

import math

import numpy as np
import pytest

from analytic import at, make_scene, quad
from framepairs.camera.places import object_places
from framepairs.camera.track import cameras_at, prepare_track, sample
from framepairs.camera_path import frame_times, make_camera_path, with_fps
from framepairs.errors import InputError
from framepairs.frame import Shoot
from framepairs.scene.description import Material
from framepairs.transforms import rigid

Y_UP = np.array([0.0, 1.0, 0.0])
QUARTER = [math.cos(math.pi / 4), 0, math.sin(math.pi / 4), 0]  # about +y: looks along -x

WALK = (
    {"time": 0, "position": [0, 1, 5], "look_at": [0, 1, -9]},
    {"time": 0.5, "position": [2, 1.5, 4], "look_at": [3, 1, -9], "fov_y_deg": 60, "exposure_ev": 1},
    {"time": 1.25, "position": [3, 1, 2], "look_at": [9, 2, -9], "roll_deg": 20},
    {"time": 2, "position": [3, 0.5, -1], "look_at": [9, 0, 0], "hold": 0.5},
    {"time": 3, "position": [4, 0.5, -3], "look_at": [0, 0, 0]},
)
TURNS = tuple(
    {"time": k["time"], "position": k["position"], "hold": k.get("hold", 0), "quaternion": q}
    for k, q in zip(WALK, ([1, 0, 0, 0], [3, 1, 2, 0], QUARTER, [0, 1, 4, 1], [1, 1, 0, 0]), strict=True)
)


def keyed(*keyframes, **keys):
    return make_camera_path({"version": 1, "keyframes": keyframes, **keys})


def places(name, time):
    """Of a cart that drives along +x while turning left, and a lamp that stands; as `object_places` gives them."""
    if name == "cart":
        c, s = math.cos(0.5 * time), math.sin(0.5 * time)
        return rigid(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([3 * time, 0, -4 + math.sin(time)]))
    if name == "lamp":
        return rigid(np.eye(3), np.array([0, 4.0, -8]))
    raise InputError(f"the scene has no object {name!r} (cart, lamp)")


def poses(path, times, place_of=places):
    track = prepare_track(path, Y_UP, place_of)
    return np.array([sample(track, float(t)).world_from_camera for t in times])


def rates_at(path, time, side, h=1e-6, place_of=places):
    """Velocity and angular velocity, by a difference on one side of `time`."""
    first, second = poses(path, sorted([time, time + side * h]), place_of)
    turned = second[:3, :3] @ first[:3, :3].T
    axial = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / 2
    return np.concatenate([(second[:3, 3] - first[:3, 3]) / h, axial / h])


def angles_to(matrices, targets):
    """Radians between the viewing axes and targets."""
    away = targets - matrices[:, :3, 3]
    return np.linalg.norm(np.cross(-matrices[:, :3, 2], away / np.linalg.norm(away, axis=1, keepdims=True)), axis=1)


OBJECTS = (
    {"time": 0, "position": [0, 3, 5], "look_at": {"object": "cart"}},
    {"time": 1, "position": [2, 3, 5], "look_at": {"object": "cart", "offset": [0, 1, 0]}},
    {"time": 2, "position": [3, 3, 4], "look_at": {"object": "lamp"}},
    {"time": 3, "position": [4, 3, 3], "look_at": [0, 0, 0]},
)
FOLLOWING = {"follow": {"object": "cart", "offset": [0, 2, 6], "stiffness": 15, "damping_ratio": 0.7}}
SHAKEN = {"shake": {"position": 0.05, "rotation_deg": 2, "low_hz": 1, "high_hz": 8, "seed": 5}}
PATHS = {
    "look_at": keyed(*WALK),
    "quaternions": keyed(*TURNS),
    "mixed": keyed(*WALK[:3], *TURNS[3:]),
    "objects": keyed(*OBJECTS),
    "follow": keyed({"time": 0}, {"time": 3, "exposure_ev": 2}, **FOLLOWING),
    "shake": keyed(*WALK, **SHAKEN),
    "moves": make_camera_path(
        {
            "version": 1,
            "moves": [
                {"move": "orbit", "duration": 1, "center": {"object": "lamp"}, "radius": 4, "to_deg": 80, "rise": 1},
                {"move": "hold", "duration": 0.5},
                {"move": "dolly", "duration": 1, "to_position": [1, 2, 3], "roll_deg": 5},
                {"move": "pan", "duration": 0.5, "to_yaw_deg": 10, "to_pitch_deg": 0},
            ],
        }
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_rates_of_24_60_and_144_agree_at_common_times(name):
    found = {}
    for fps in (24, 60, 144):
        path = with_fps(PATHS[name], fps)
        track = prepare_track(path, Y_UP, places)
        found[fps] = [sample(track, time) for time in frame_times(path)]
    for fps in (60, 144):
        steps = 24 // math.gcd(24, fps), fps // math.gcd(24, fps)
        pairs = list(zip(found[24][:: steps[0]], found[fps][:: steps[1]], strict=True))
        assert len(pairs) > 30
        for a, b in pairs:
            np.testing.assert_allclose(a.world_from_camera, b.world_from_camera, atol=1e-9)
            assert (a.fov_y, a.exposure_ev, a.scene_time_s) == pytest.approx((b.fov_y, b.exposure_ev, b.scene_time_s), abs=1e-9)


@pytest.mark.parametrize("name", [*PATHS])
def test_velocity_and_turning_are_continuous(name):
    path = PATHS[name]
    times = [key.time for key in path.keyframes[1:-1]] + [key.time + key.hold for key in path.keyframes[1:-1]]
    times += [1.0, 1.5, 2.5] if path.moves else [0.3, 1.1]
    for time in times:
        before, after = rates_at(path, time, -1), rates_at(path, time, 1)
        # A difference over 1e-6 s errs by 1e-6 times the acceleration (up to some 1e3 with shake), and by 1e-15 / 1e-6.
        np.testing.assert_allclose(before, after, atol=5e-3)
    assert max(np.linalg.norm(rates_at(path, t, 1)) for t in [*times, 0.4]) > 0.3


@pytest.mark.parametrize("name", ["look_at", "quaternions", "shake", "moves"])
def test_holds_stand_still_to_the_last_bit_and_are_reached_and_left_at_rest(name):
    begin, end = (2, 2.5) if name != "moves" else (1, 1.5)
    matrices = poses(PATHS[name], np.linspace(begin, end, 21))
    assert len({matrix.tobytes() for matrix in matrices}) == 1
    # At rest the way is quadratic: a mean speed of some 5 units/s in 0.5 s and 1e-4 s away give 6 * 5 * 1e-4 / 0.5.
    for time, side in ((begin, -1), (end, 1)):
        assert np.linalg.norm(rates_at(PATHS[name], time, side, h=1e-4)) < 6e-3
    assert np.linalg.norm(rates_at(PATHS[name], begin - 0.1, -1)) > 0.05


def test_at_a_cut_velocity_jumps_and_both_sides_are_their_own():
    path = keyed(*WALK[:2], {**WALK[2], "cut": True}, *WALK[3:])
    before, after = poses(path, [1.25 - 1e-6, 1.25])
    np.testing.assert_allclose(before[:3, 3], WALK[1]["position"], atol=1e-12)
    np.testing.assert_array_equal(after[:3, 3], WALK[2]["position"])


def test_speed_along_the_curve_is_the_mean_one_between_two_keyframes():
    ends = [{"time": t, "position": [3 * t, 0, 0], "look_at": [0, 0, -9]} for t in (0, 2)]
    np.testing.assert_allclose(poses(keyed(*ends), [0.5, 1, 1.7])[:, 0, 3], [1.5, 3, 5.1], atol=1e-12)


@pytest.mark.parametrize("name", PATHS)
def test_many_times_at_once_are_those_one_by_one(name):
    """Up to rounding: sums over many times and over one may be added up in another order."""
    track, times = prepare_track(PATHS[name], Y_UP, places), np.linspace(-0.1, 4.2, 173)
    found = cameras_at(track, times)
    np.testing.assert_allclose(found, [sample(track, time).world_from_camera for time in times], atol=1e-12)


def test_a_speed_is_the_speed_there():
    path = keyed({**WALK[0], "speed": 0}, {**WALK[1], "speed": 4}, {**WALK[2], "speed": 1})
    speeds = [np.linalg.norm(rates_at(path, t, side)[:3]) for t, side in ((0, 1), (0.5, -1), (0.5, 1), (1.25, -1))]
    assert speeds == pytest.approx([0, 4, 4, 1], abs=1e-4)


def test_a_speed_that_would_run_backwards_is_refused():
    keys = [{**key, "look_at": [0, 0, -99]} for key in WALK[:3]]
    with pytest.raises(InputError, match=r"keyframes\.1\.speed: 10 is more than 3 times .* mean speed 3\.\d+: .*backwards"):
        prepare_track(keyed(keys[0], {**keys[1], "speed": 10}, keys[2]), Y_UP)
    back = [{"time": t, "position": [x, 0, 0], "look_at": [0, 0, -9]} for t, x in ((0, 0), (1, 1), (2, 0))]
    with pytest.raises(InputError, match=r"keyframes\.1\.speed: not 0 where the way turns"):
        prepare_track(keyed(back[0], {**back[1], "speed": 0.5}, back[2]), Y_UP)
    assert abs(rates_at(keyed(*back), 1, 1)[0]) < 1e-4  # of itself it stops there


def test_targets_are_centred_and_the_horizon_is_level():
    times = np.linspace(0, 1, 41)
    matrices = poses(PATHS["objects"], times)
    carts = np.array([places("cart", t)[:3, 3] for t in times])
    assert angles_to(matrices[:1], carts[:1]).max() < 1e-15
    assert angles_to(matrices[-1:], carts[-1:] + [0, 1, 0]).max() < 1e-15
    line = carts + np.interp(angles_to(matrices, carts), [0, 1], [0, 0])[:, None]
    away = line - matrices[:, :3, 3]
    offset = matrices[:, :3, 3] - matrices[:, :3, 2] * np.sum(-matrices[:, :3, 2] * away, axis=1)[:, None] - carts
    assert np.abs(offset[:, [0, 2]]).max() < 0.5 and (np.diff(offset[:, 1]) > -1e-9).all()  # from the cart to above it
    assert np.abs(matrices[:, 1, 0]).max() < 1e-9
    plain = poses(keyed(*({**key, "look_at": {"object": "cart"}} for key in OBJECTS)), times)
    assert angles_to(plain, carts).max() < 1e-14


def test_between_an_object_and_a_point_the_targets_are_blended():
    path = keyed(
        {"time": 0, "position": [0, 0, 50], "look_at": {"object": "cart"}},
        {"time": 2, "position": [0, 0, 50], "look_at": [5, 5, 0]},
    )
    middle = (places("cart", 1)[:3, 3] + [5, 5, 0]) / 2
    assert angles_to(poses(path, [1]), middle[None]).max() < 1e-15


def test_a_hold_in_which_the_animation_runs_looks_at_a_fixed_point():
    stops = [{**OBJECTS[0], "hold": 1, "animation": "runs"}, {**OBJECTS[1], "time": 2}]
    path = keyed(*stops)
    assert len({matrix.tobytes() for matrix in poses(path, [0, 0.5, 1])}) == 1
    np.testing.assert_allclose(rates_at(path, 1, -1), rates_at(path, 1, 1), atol=1e-3)
    assert angles_to(poses(path, [2]), places("cart", 2)[None, :3, 3] + [0, 1, 0]).max() < 1e-14


def test_scene_times_of_objects_stop_with_the_animation():
    path = keyed({**OBJECTS[0], "hold": 1}, {**OBJECTS[0], "time": 2})
    assert angles_to(poses(path, [2]), places("cart", 1)[None, :3, 3]).max() < 1e-14


def test_unknown_objects_are_refused_by_field_and_known_names_are_shown():
    scene = make_scene((quad(1, 1), Material(name="m"), at(0, 0, 0)))
    path = keyed({**OBJECTS[3], "time": 0}, {**OBJECTS[0], "time": 5})
    with pytest.raises(InputError, match=r"camera path, keyframes\.1\.look_at: the scene has no object 'cart' \(part 0\)"):
        prepare_track(path, Y_UP, object_places(scene))
    with pytest.raises(InputError, match=r"follow\.object: the scene has no object"):
        prepare_track(PATHS["follow"], Y_UP, object_places(scene))
    with pytest.raises(InputError, match=r"keyframes\.1\.look_at: there is no scene"):
        prepare_track(path, Y_UP)


def test_places_are_the_middle_of_transformed_boxes_and_groups_have_one():
    turned = rigid(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([5.0, 6, 7]))
    scene = make_scene(
        (quad(2, 4), Material(name="m"), turned @ np.diag([2, 2, 2, 1])),
        (quad(2, 2), Material(name="n"), lambda time: at(10 * time, 0, 0)),
    )
    names = ("cart/wheel", "cart/body")
    objects = tuple(type(item)(**{**item.__dict__, "name": name}) for item, name in zip(scene.objects, names, strict=True))
    place_of = object_places(type(scene)(**{**scene.__dict__, "objects": objects}))
    np.testing.assert_allclose(place_of("cart/wheel", 0.0), turned, atol=1e-12)
    # Together: x from 5 - 4 and -1 + 20 to 5 + 4 and 1 + 20, y from -1 to 6 + 2, z from 0 to 7.
    np.testing.assert_allclose(place_of("cart", 2.0)[:3, 3], [11, 3.5, 3.5], atol=1e-12)
    with pytest.raises(InputError, match=r"no object 'car' \(cart/body, cart/wheel\)"):
        place_of("car", 0.0)


def test_quaternions_are_met_and_mix_with_targets():
    ends = {"look_at": [0, 0, -3]}, {"quaternion": [5 * part for part in QUARTER]}
    keyframes = [{"time": time, "position": [0, 0, 0], **end} for time, end in enumerate(ends)]
    c = math.cos(math.pi / 4)
    np.testing.assert_allclose(poses(keyed(*keyframes), [0.5])[0, :3, :3], [[c, 0, c], [0, 1, 0], [-c, 0, c]], atol=1e-15)


@pytest.mark.parametrize("space", ["object", "world"])
def test_following_starts_at_its_target_and_keeps_the_object_in_the_middle(space):
    path = keyed({"time": 0}, {"time": 5}, follow={**FOLLOWING["follow"], "offset_space": space})
    times = np.linspace(0, 5, 101)
    matrices = poses(path, times)
    frames = np.array([places("cart", t) for t in times])
    turn = frames[:, :3, :3] if space == "object" else np.eye(3)
    targets = frames[:, :3, 3] + turn @ [0, 2, 6]
    np.testing.assert_allclose(matrices[0, :3, 3], targets[0], atol=1e-12)
    # The target's acceleration is at most 6 * 0.25 + 1: a spring of 15 / s^2 lags by about an acceleration / 15.
    assert 1e-3 < np.linalg.norm(matrices[:, :3, 3] - targets, axis=1).max() < 2.5 / 15 * 2
    assert angles_to(matrices, frames[:, :3, 3]).max() < 1e-14


def test_a_shot_that_follows_begins_anew_after_a_cut_and_freezes_in_a_hold():
    path = keyed({"time": 0}, {"time": 1, "hold": 0.5}, {"time": 2, "cut": True}, {"time": 3}, **FOLLOWING)
    assert len({matrix.tobytes() for matrix in poses(path, [1, 1.3, 1.5])}) == 1
    frame = places("cart", 1.5)
    np.testing.assert_allclose(poses(path, [2])[0, :3, 3], frame[:3, 3] + frame[:3, :3] @ [0, 2, 6], atol=1e-12)
    assert np.linalg.norm(poses(path, [1.8])[0, :3, 3] - poses(path, [1.5])[0, :3, 3]) > 0.5  # goes on until the cut


@pytest.mark.parametrize("stiffness", [1e-3, 1, 1e6, 1e12])
@pytest.mark.parametrize("fps", [1, 24, 240])
def test_following_stays_finite_at_any_stiffness_and_frame_rate(stiffness, fps):
    path = keyed({"time": 0}, {"time": 2}, fps=fps, follow={"object": "cart", "offset": [0, 1, 3], "stiffness": stiffness})
    assert np.isfinite(poses(path, frame_times(path))).all()


def test_shake_moves_the_camera_by_as_much_as_it_says():
    plain, shaken = (poses(keyed(*WALK[:2], **keys), np.linspace(0, 0.5, 400)) for keys in ({}, SHAKEN))
    distances = np.linalg.norm(plain[:, :3, 3] - shaken[:, :3, 3], axis=1)
    assert 0.2 < np.sqrt((distances**2).mean()) / 0.05 < 3  # half a second of noise from 1 Hz on is no mean
    assert (distances > 0).all()


def test_two_keyframes_a_nanosecond_apart_behave():
    path = keyed(*WALK[:2], {**WALK[2], "time": 0.5 + 1e-9, "position": [2, 1.5, 4 + 1e-9]}, {**WALK[3], "hold": 0})
    matrices = poses(path, [*np.linspace(0, 2, 200), 0.5, 0.5 + 0.5e-9, 0.5 + 1e-9])
    assert np.isfinite(matrices).all() and np.abs(matrices[:200, :3, 3]).max() < 6
    jump = keyed(*WALK[:2], {**WALK[2], "time": 0.5 + 1e-9}, {**WALK[3], "hold": 0})
    assert np.isfinite(poses(jump, np.linspace(0, 2, 200))).all()
    for p in (path, jump):
        steps = np.diff(poses(p, np.linspace(0.51, 2, 100))[:, :3, 3], axis=0)
        assert np.linalg.norm(steps, axis=1).max() < 0.3  # nothing is flung away afterwards


@pytest.mark.parametrize("kind", ["look_at", "quaternion"])
def test_segments_of_length_zero_stand_still(kind):
    stops = [{**TURNS[0], "time": t} if kind == "quaternion" else {**WALK[0], "time": t} for t in (0, 1, 2)]
    path = keyed(*stops, {**(TURNS[1] if kind == "quaternion" else WALK[1]), "time": 3})
    matrices = poses(path, [0, 0.5, 1.9, 2, 2.5, 3])
    assert len({matrix[:3, 3].tobytes() for matrix in matrices[:4]}) == 1
    np.testing.assert_allclose(matrices[0], matrices[2], atol=1e-15)
    np.testing.assert_allclose(rates_at(path, 2, 1), 0, atol=1e-3)
    np.testing.assert_array_equal(matrices[5][:3, 3], WALK[1]["position"])


def test_a_hold_up_to_the_next_keyframe_elsewhere_is_a_jump():
    path = keyed({**WALK[0], "hold": 0.5}, WALK[1])
    np.testing.assert_array_equal(poses(path, [0.25, 0.5])[:, :3, 3], [WALK[0]["position"]] * 2)
    np.testing.assert_array_equal(poses(path, [0.6])[0, :3, 3], WALK[1]["position"])


def test_looking_straight_up_at_a_keyframe_is_legal_and_smooth():
    targets = [0, 1, -9], [0, 30, 5], [9, 1, 5]
    stops = [{"time": t, "position": [0, 1, 5], "look_at": target} for t, target in enumerate(targets)]
    path = keyed(*stops)
    times = np.linspace(0, 2, 801)
    matrices = poses(path, times)
    assert np.isfinite(matrices).all()
    np.testing.assert_allclose(matrices[400, :3, 2], [0, -1, 0], atol=1e-15)
    speeds = [np.linalg.norm(rates_at(path, t, 1)[3:]) for t in times[:-1:4]]
    forward = np.degrees(np.arccos(np.clip(np.sum(matrices[1:, :3, 2] * matrices[:-1, :3, 2], axis=1), -1, 1)) / times[1])
    assert max(speeds) < 6 * np.radians(forward.max())
    np.testing.assert_allclose(rates_at(path, 1, -1), rates_at(path, 1, 1), atol=1e-3)
    quaternion = {"time": 3, "position": [0, 1, 5], "quaternion": [1, 0, 0, 0]}
    assert np.isfinite(poses(keyed(*stops, quaternion), np.linspace(0, 3, 100))).all()


def test_far_from_the_origin_positions_keep_their_digits():
    far = np.array([1e6, -2e6, 3e6])
    moved = [{**k, **{key: (far + k[key]).tolist() for key in ("position", "look_at")}} for k in WALK]
    times = np.linspace(0, 3, 61)
    here, there = poses(keyed(*WALK), times), poses(keyed(*moved), times)
    # Rounding of 3e6 is 2e-10; directions towards targets some units away err by as much.
    np.testing.assert_allclose(there[:, :3, 3] - far, here[:, :3, 3], atol=1e-7)
    np.testing.assert_allclose(there[:, :3, :3], here[:, :3, :3], atol=1e-7)


def test_frames_have_their_times_and_exposures():
    scene = make_scene((quad(1, 1), Material(name="m"), at(0, 0, -10)))
    path = keyed(*WALK[:2], {**WALK[2], "fps": 10}, fps=4)
    states = [Shoot(scene, path, 1.5).state(frame) for frame in range(6)]
    assert [state.time_s for state in states] == [0, 0.25, 0.5, 0.75, 1, 1.25]
    assert [state.frame_time_ms for state in states] == [250] * 6
    assert states[0].exposure_ev == 0 and states[2].exposure_ev == 1 and 0 < states[1].exposure_ev < 1
    later = keyed(*WALK[:2], {**WALK[2], "time": 0.6, "fps": 10}, {**WALK[3], "time": 0.9}, fps=4)
    assert [Shoot(scene, later, 1.5).state(frame).frame_time_ms for frame in (2, 3, 4)] == pytest.approx([250, 100, 100])


def test_a_sample_does_not_depend_on_earlier_ones():
    for path in PATHS.values():
        times = np.linspace(0, 2.9, 23)
        alone = [poses(path, [t])[0] for t in times[::-1]]
        np.testing.assert_array_equal(poses(path, times), alone[::-1])
