"""Sampled camera paths: they keep their distance by an independent exact check, see the scene, and stay within their style."""

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from analytic import at, make_scene
from framepairs.bundled import find_scene
from framepairs.camera.track import cameras_at, prepare_track
from framepairs.camera_path import make_camera_path, read_camera_path
from framepairs.errors import InputError
from framepairs.frame import Shoot
from framepairs.sampling.clearance import clearance_of
from framepairs.sampling.files import CamerasFile, make_options, parse_numbers, read_cameras, split_paths
from framepairs.sampling.gaze import choose_gaze, direction_of
from framepairs.sampling.path_frames import PathPoints
from framepairs.sampling.plot import plot_paths
from framepairs.sampling.probe import make_probe
from framepairs.sampling.sampler import sample_cameras
from framepairs.sampling.styles import STYLES, Style
from framepairs.sampling.takes import make_schedule
from framepairs.sampling.writer import check_folder, sample_into, write_sampling
from framepairs.scene import load_scene
from sampling_scenes import (
    GREY,
    box,
    distances_to_triangles,
    field_of_posts,
    flat_ground,
    maze,
    room,
    with_mover,
    world_triangles,
)

CLEARANCE = 0.3


@lru_cache
def sampled(style: str, count: int = 4, frames: int = 49):
    return sample_cameras(
        field_of_posts(), make_options(count=count, frames=frames, styles=(style,), seed=5, cell_m=0.7), "posts"
    )


def paths_of(sampling):
    return [make_camera_path(values) for values in sampling.values]


def finely(scene, path, per_frame: int = 7):
    """(places [n, 3], times of the animation [n]) of a path, `per_frame` for each frame, by Shoot alone."""
    samples = Shoot(scene, path.model_copy(update={"fps": path.fps * per_frame}), 16 / 9).samples
    return np.array([item.world_from_camera[:3, 3] for item in samples]), np.array([item.scene_time_s for item in samples])


@pytest.mark.parametrize("style", STYLES)
def test_paths_keep_their_clearance_by_exact_distances(style):
    """Point to triangle distances in float64, at seven places a frame, share nothing with the rays that checked the paths. A
    surface that fills a disc of 2.8 / sqrt(512) = 0.12 radians is met; a post's edge may come nearer by what such a disc needs
    before it: 1 - cos(0.12) of the ray, under 1 % of the clearance."""
    scene, sampling = field_of_posts(), sampled(style)
    triangles = world_triangles(scene)
    for path, record in zip(paths_of(sampling), sampling.file.paths, strict=True):
        least = distances_to_triangles(finely(scene, path)[0], triangles).min()
        assert least >= 0.99 * CLEARANCE
        assert record.clearance_m >= CLEARANCE
        if record.clearance_m < 3.9 * CLEARANCE:
            assert 0.75 * record.clearance_m < least < 1.25 * record.clearance_m  # half the points' distance, and the rays'


def test_paths_through_the_forest_meet_no_leaf_in_the_wind():
    """Of the bundled forest (1778 objects, most of them bending), by the same exact distances at some frames' own times."""
    scene = load_scene(find_scene("forest"))
    sampling = sample_cameras(scene, make_options(count=4, frames=100, styles=("fast",), seed=7))
    assert sampling.file.coverage > 0.2
    for frame in (0, 37, 90):
        triangles = world_triangles(scene, frame / 24)
        low, high = triangles.min(axis=1), triangles.max(axis=1)
        for cameras in sampling.cameras:
            place = cameras[frame, :3, 3]
            near = np.all((low < place + 2 * CLEARANCE) & (high > place - 2 * CLEARANCE), axis=1)
            if near.any():
                assert distances_to_triangles(place[None], triangles[near]).min() >= 0.99 * CLEARANCE


def test_a_path_too_near_is_told_with_its_distance():
    """Half a metre beside a wall, and through it. Points 0.1 apart, so half of that goes off the distance."""
    wall = box([0, 0, -5], [1, 4, 5])
    probe = make_probe(make_scene((wall, GREY, np.eye(4))), np.zeros(3), (0.0,))
    z = np.linspace(-3, 3, 61)
    beside = PathPoints(np.stack([np.full(61, -0.5), np.full(61, 2.0), z], axis=1), 1, 0.1)
    found = clearance_of(probe.posed(0.0), beside, 0.3, 512, 1)
    assert 0.45 - 1e-4 <= found <= 0.5 / np.cos(0.13) - 0.05
    through = PathPoints(np.array([[-2.0, 2, 0], [3.0, 2, 0]]), 1, 0.0)  # the ends alone are far from the wall
    assert clearance_of(probe.posed(0.0), through, 0.3, 512, 1) == 0


@pytest.mark.parametrize("style", STYLES)
def test_paths_stay_within_their_style(style):
    wanted, scene, sampling = STYLES[style], field_of_posts(), sampled(style)
    for path, record in zip(paths_of(sampling), sampling.file.paths, strict=True):
        shoot = Shoot(scene, path, 16 / 9)
        assert len(shoot) == record.frames == 49
        cameras = np.array([item.world_from_camera for item in shoot.samples])
        forward = -cameras[:, :3, 2]
        turn = np.degrees(np.arccos(np.clip(np.sum(forward[1:] * forward[:-1], axis=1), -1, 1))) * 24
        assert turn.max() <= wanted.turn_deg_s + 1e-3  # arccos near 1 loses half of the digits
        assert record.speed_m_s <= 1.1 * wanted.speed_m_s[1]  # the spline is longer than the curve through its keyframes
        low, high = wanted.height_m
        slack = wanted.step_m if wanted.step_m is not None else high
        assert cameras[:, 1, 3].min() > max(low - slack, low / 2) - 1e-3 and cameras[:, 1, 3].max() < high + slack + 0.01
        assert wanted.fov_y_deg[0] <= path.fov_y_deg <= wanted.fov_y_deg[1]
        assert np.abs(cameras[:, 1, 0]).max() < (1e-9 if wanted.shake is None else 0.1)  # the horizon is level
        assert (path.shake is not None) == (wanted.shake is not None)


def test_stop_and_go_stands_still_to_the_last_bit_for_half_a_second():
    for path in paths_of(sampled("stop-and-go")):
        holds = [key for key in path.keyframes if key.hold > 0]
        assert holds and all(key.hold >= 0.5 - 1e-9 and key.animation == "runs" for key in holds)
        samples = Shoot(field_of_posts(), path, 16 / 9).samples
        still = [np.array_equal(a.world_from_camera, b.world_from_camera) for a, b in zip(samples, samples[1:], strict=False)]
        assert sum(still) >= 11 * len(holds)  # 0.5 s at 24 fps are 12 frames


def test_fast_paths_move_tens_of_pixels_a_frame():
    assert np.median([record.motion_px for record in sampled("fast").file.paths]) > 15


@pytest.mark.parametrize("style", ["hand-held", "stop-and-go"])
def test_many_times_at_once_give_the_poses_of_the_camera_path_language(style):
    scene = field_of_posts()
    for path in paths_of(sampled(style)):
        shoot = Shoot(scene, path, 16 / 9)
        found = cameras_at(prepare_track(path, scene.up), np.array(shoot.times))
        expected = np.array([item.world_from_camera for item in shoot.samples])
        assert np.abs(found - expected).max() < 1e-12  # the same operations, in another order of sums


def test_what_moves_is_kept_clear_of_at_its_own_time():
    """A wall of 3 m that sweeps through the middle of the yard. The exact distance at each frame's own time."""
    sweeping = with_mover(lambda t: at(-10 + 10 * min(max(t, 0), 2), 0, 0), 2.0, box([-0.3, 0, -1.5], [0.3, 2, 1.5], "mover"))
    sampling = sample_cameras(sweeping, make_options(count=4, frames=49, styles=("calm",), seed=2, cell_m=0.7), "sweeping")
    assert sampling.file.moving_checked == 49
    mover = replace(sweeping, objects=sweeping.objects[-1:], world_from_object=lambda t: sweeping.world_from_object(t)[-1:])
    for path in paths_of(sampling):
        for item in Shoot(sweeping, path, 16 / 9).samples:
            place = item.world_from_camera[None, :3, 3]
            assert distances_to_triangles(place, world_triangles(mover, item.scene_time_s)).min() >= 0.99 * CLEARANCE


def test_equal_options_give_equal_bytes_and_another_seed_does_not(tmp_path):
    options = make_options(count=3, frames=25, styles=("calm",), seed=5, cell_m=0.7)
    folders = [tmp_path / name for name in ("first", "second", "third")]
    for folder, given in zip(folders, (options, options, options.model_copy(update={"seed": 6})), strict=True):
        write_sampling(sample_cameras(field_of_posts(), given, "posts"), folder)
    first, second, third = ({file.name: file.read_bytes() for file in folder.iterdir()} for folder in folders)
    assert first == second
    assert set(first) == {"calm_000.json", "calm_001.json", "calm_002.json", "cameras.json", "paths.svg", "paths.png"}
    assert first["calm_000.json"] != third["calm_000.json"]


def test_more_paths_see_more_and_the_first_ones_stay():
    few, many = sampled("calm", 4), sampled("calm", 8)
    assert few.values == many.values[:4]
    assert few.file.coverage < many.file.coverage
    assert many.file.cells_seen <= many.file.cells and max(many.file.coverage_of.values()) <= many.file.coverage


def test_paths_see_most_of_a_maze():
    """25 chambers; 12 fast paths of 4 s."""
    sampling = sample_cameras(maze(), make_options(count=12, frames=97, styles=("fast",), seed=1, cell_m=0.5), "maze")
    assert sampling.file.coverage > 0.8


def test_a_closed_room_is_seen_from_inside():
    sampling = sample_cameras(room(), make_options(count=3, frames=49, styles=("calm",), seed=1), "room")
    places = np.concatenate(sampling.cameras)[:, :3, 3]
    assert np.abs(places[:, [0, 2]]).max() < 3 and places[:, 1].max() < 3 and sampling.file.coverage > 0.5


def test_styles_take_turns_and_file_names_tell_them():
    options = make_options(count=3, frames=10, styles=("calm", "vehicle"), seed=1, cell_m=0.7)
    names = [record.file for record in sample_cameras(field_of_posts(), options, "posts").file.paths]
    assert names == ["calm_000.json", "vehicle_001.json", "calm_002.json"]


def test_two_frames_are_enough():
    sampling = sample_cameras(field_of_posts(), make_options(count=1, frames=2, styles=("stop-and-go",), cell_m=0.7), "posts")
    assert len(sampling.cameras[0]) == 2


@pytest.mark.parametrize("count", [1, 2, 3, 5, 10, 54, 101])
def test_splits_have_their_shares_and_each_path_one(count):
    middles = np.random.default_rng(count).uniform(-10, 10, (count, 2))
    splits = split_paths(middles, (0.8, 0.1, 0.1), 7)
    numbers = [splits.count(name) for name in ("train", "val", "test")]
    assert sum(numbers) == count and splits == split_paths(middles, (0.8, 0.1, 0.1), 7)
    if count >= 3:
        assert min(numbers) >= 1
    assert abs(numbers[0] - 0.8 * count) <= 2


def test_every_split_lies_all_over_the_map():
    """Four quarters; every tenth path lies in the same one, so that a split by number would stay there. val and test have
    paths in at least three of them."""
    rng = np.random.default_rng(4)
    corners = np.array([[0, 0], [10, 0], [0, 10], [10, 10]])
    middles = rng.uniform(0, 10, (100, 2)) + corners[np.arange(100) % 10 % 4]
    for seed in range(5):
        splits = np.array(split_paths(middles, (0.8, 0.1, 0.1), seed))
        for name in ("val", "test"):
            quarters = {(x > 10, y > 10) for x, y in middles[splits == name]}
            assert len(quarters) >= 3


def test_schedule_with_stops_ends_with_the_last_frame():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        schedule = make_schedule(STYLES["stop-and-go"], rng.uniform(1.3, 9), 10, rng)
        stops = schedule.holds[schedule.holds > 0]
        assert np.all(np.diff(schedule.times) > 0) and stops.min() >= 0.5 - 1e-9
        assert np.all(schedule.times[:-1] + schedule.holds[:-1] < schedule.times[1:])
        assert schedule.fractions[0] == 0 and schedule.fractions[-1] == pytest.approx(1)
        assert schedule.moving_s + stops.sum() == pytest.approx(schedule.times[-1] + schedule.holds[-1])


def test_the_view_turns_towards_what_is_unseen_as_fast_as_it_may():
    """Something to see at yaw -60 degrees in the first two places and at 60 in the last three: no view holds both. A slow
    path turns as its style may, one with time enough turns at once."""
    worth = np.zeros((5, 48, 9))
    worth[:2, 39:42] = worth[2:, 7:10] = 1.0
    style: Style = STYLES["calm"]

    def turns(seconds: float) -> np.ndarray:
        chosen = choose_gaze(worth, np.zeros(5), np.full(4, seconds), style, np.radians(45), np.random.default_rng(0))
        return np.degrees(np.abs(np.diff(chosen[0])))

    assert 0 < turns(1.0).max() <= style.turn_deg_s / 1.9 + 1e-6
    assert turns(10.0)[1] > 30
    ahead = direction_of(np.array(0.0), np.array(0.0), 1)
    assert ahead.tolist() == [0, 0, 1]


def test_files_are_read_back_and_another_sampling_is_not_overwritten(tmp_path):
    sampling, out = sampled("calm"), tmp_path / "out"
    files = write_sampling(sampling, out)
    assert {file.name for file in files} == {file.name for file in out.iterdir()}
    assert read_cameras(out / "cameras.json") == sampling.file
    for record, values in zip(sampling.file.paths, sampling.values, strict=True):
        assert read_camera_path(out / record.file) == make_camera_path(values)
    before = {file: file.read_bytes() for file in out.iterdir()}
    write_sampling(sampling, out)  # the same again is allowed
    assert before == {file: file.read_bytes() for file in out.iterdir()}
    other = sampled("calm", 8)
    with pytest.raises(InputError, match="holds another sampling: count is 4 there, 8 here"):
        write_sampling(other, out)
    write_sampling(other, out, force=True)
    few = sampled("fast")
    write_sampling(few, out, force=True)
    assert {file.stem for file in out.glob("*.json")} == {"cameras", *(f"fast_{k:03d}" for k in range(4))}
    assert check_folder(out, "posts", few.file.scene_sha256, few.file.options) == few.file


def test_schema_of_cameras_json_refuses_unknown_keys():
    values = json.loads(sampled("calm").file.model_dump_json())
    assert CamerasFile.model_validate(values)
    with pytest.raises(ValueError, match="Extra inputs"):
        CamerasFile.model_validate(values | {"more": 1})


def test_plots_are_pictures():
    assert plot_paths(sampled("calm"), "png").startswith(b"\x89PNG")
    svg = plot_paths(sampled("calm"), "svg").decode()
    assert "train: " in svg or "<svg" in svg


@pytest.mark.parametrize(
    "values, field, said",
    [
        ({"count": 0}, "count", "greater than or equal to 1"),
        ({"frames": 1}, "frames", "greater than or equal to 2"),
        ({"styles": ("drunk",)}, "styles", "must be of calm, fast, stop-and-go, hand-held, vehicle, not 'drunk'"),
        ({"seed": -1}, "seed", "greater than or equal to 0"),
        ({"split": (0.5, 0.1, 0.1)}, "split", "add up to 0.7"),
        ({"clearance_m": -1.0}, "clearance_m", "greater than 0"),
        ({"bounds": (0, 0, 0, 1, 0, 1)}, "bounds", "must lie below"),
    ],
)
def test_refusals_name_the_option(values, field, said):
    with pytest.raises(InputError, match=said) as caught:
        make_options(**values)
    assert caught.value.field == field and "\n" not in str(caught.value)


def test_shares_are_parsed():
    assert parse_numbers("0.7,0.2,0.1", "0.8,0.1,0.1", "split") == (0.7, 0.2, 0.1)
    assert parse_numbers(None, "0.8,0.1,0.1", "split") is None
    for text in ("a,b", "1,2", ""):
        with pytest.raises(InputError, match="must look like 0.8,0.1,0.1"):
            parse_numbers(text, "0.8,0.1,0.1", "split")


def test_another_sampling_is_refused_before_it_is_sampled(tmp_path):
    options, scene = make_options(count=1, frames=2, cell_m=0.7), field_of_posts()
    done = []
    sample_into(scene, "posts", options, tmp_path, on_path=lambda count, share: done.append((count, 0 < share <= 1)))
    with pytest.raises(InputError, match="seed is 0 there, 1 here"):
        sample_into(scene, "posts", options.model_copy(update={"seed": 1}), tmp_path, on_path=lambda *_: done.append(None))
    assert done == [(1, True)]


def test_scenes_without_anything_or_without_room_are_refused():
    options = make_options(count=1, frames=10)
    with pytest.raises(InputError, match="no surfaces"):
        sample_cameras(make_scene(), options, "empty")
    with pytest.raises(InputError, match="room at camera heights"):
        sample_cameras(room(), options.model_copy(update={"clearance_m": 4.0}), "room")


@pytest.mark.parametrize("flat", [False, True])
def test_a_scene_of_one_triangle(flat):
    corners = [[0, 0, 0], [1, 0, 0], [0, 0, 1] if flat else [0, 1, 0]]
    mesh = replace(flat_ground(1.0), positions=np.array(corners, np.float32), faces=np.array([[0, 2, 1]], np.uint32))
    sampling = sample_cameras(make_scene((mesh, GREY, np.eye(4))), make_options(count=2, frames=20, seed=1), "triangle")
    places = np.concatenate(sampling.cameras)[:, :3, 3]
    kept = sampling.file.clearance_m
    assert kept == pytest.approx(0.3 / 4)  # a metre is a quarter of SMALL_M
    assert distances_to_triangles(places, world_triangles(make_scene((mesh, GREY, np.eye(4))))).min() >= 0.99 * kept


def test_a_horizon_and_tiny_things_on_it():
    parts = [
        (flat_ground(20000.0), GREY, np.eye(4)),
        *((mesh, GREY, np.eye(4)) for mesh in (box([k, 0, 0], [k + 0.5, 1, 1]) for k in range(0, 9, 3))),
    ]
    sampling = sample_cameras(make_scene(*parts), make_options(count=3, frames=49, seed=1), "horizon")
    places = np.concatenate(sampling.cameras)[:, :3, 3]
    assert np.abs(places).max() < 15 and sampling.file.coverage > 0.5
