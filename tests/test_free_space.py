"""Free space: bounds without the absurd, open cells, ground, reachability, and distances against exact ones."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import at, make_scene
from framepairs.errors import InputError
from framepairs.sampling.bounds import STRAY, VAST, work_bounds
from framepairs.sampling.coverage import make_coverage, seen_cells
from framepairs.sampling.free_space import air_around, explore, make_grid, reachable, stands_on_ground
from framepairs.sampling.probe import first_hits, make_probe, sphere_directions, turned_spheres
from sampling_scenes import GREY, box, distances_to_triangles, field_of_posts, flat_ground, maze, merged, room, world_triangles


def explored(scene, heights=(0.9, 2.2), clearance=0.3, cell=None, times=(0.0,)):
    """(probe, free space) of a scene whose bounds are centred on the probe's origin."""
    low, high = work_bounds(scene, times)
    origin = (low + high) / 2
    probe = make_probe(scene, origin, times)
    local = (low - origin, high - origin)
    ground = stands_on_ground(probe, local, 1)
    grid = make_grid(air_around(probe, local, 1, heights[1], ground), 1, heights, cell, clearance, ground)
    return probe, explore(probe, grid, heights, clearance, 2.0, 96, ground)


def test_exact_distances_of_the_reference():
    """The reference itself, by hand: over the inside, beside an edge, and past a corner of one triangle."""
    triangle = np.array([[[0, 0, 0], [2, 0, 0], [0, 2, 0]]], float)
    points = np.array([[0.5, 0.5, 3], [1, -4, 0], [-3, -4, 12]], float)
    assert distances_to_triangles(points, triangle) == pytest.approx([3, 4, 13], abs=1e-12)


def test_directions_cover_the_sphere():
    """No direction is farther from the lattice than what the guarantee of a clearance is made of."""
    rng = np.random.default_rng(3)
    asked = rng.normal(size=(20000, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    for count in (96, 512):
        lattice = sphere_directions(count)
        assert np.abs(np.linalg.norm(lattice, axis=1) - 1).max() < 1e-6  # float32 rounding of three components
        angle = np.arccos(np.clip((asked @ lattice.T).max(axis=1), -1, 1))
        assert angle.max() <= 2.8 / np.sqrt(count)
    turned = turned_spheres(5, 96, 1)
    assert np.allclose(turned[:, :, 1], sphere_directions(96)[:, 2])  # turned about the second axis
    assert not np.allclose(turned[0], turned[1])


def test_bounds_leave_out_a_horizon_and_a_stray():
    ground, stray = flat_ground(5000.0), box([0, 0, 0], [1, 1, 1])
    parts = [(box([x, 0, z], [x + 1, 2, z + 1]), GREY, np.eye(4)) for x in range(0, 20, 4) for z in range(0, 8, 4)]
    low, high = work_bounds(make_scene(*parts, (ground, GREY, np.eye(4)), (stray, GREY, at(4000.0, 0, 0))), (0.0,))
    assert np.allclose(low, [0, 0, 0]) and np.allclose(high, [17, 2, 5])


def test_bounds_of_one_merged_mesh_leave_out_its_horizon():
    scene = make_scene((merged(*(box([x, 0, 0], [x + 1, 2, 1]) for x in (0, 3, 6)), flat_ground(5000.0)), GREY, np.eye(4)))
    low, high = work_bounds(scene, (0.0,))
    assert np.allclose(low, [0, 0, 0]) and np.allclose(high, [7, 2, 1])


def test_bounds_keep_what_is_merely_large():
    """A room whose walls are a little less than VAST times its table, and three objects far apart, count whole."""
    table = box([0, 0, 0], [0.3, 0.3, 0.3])
    walls = box([-2, 0, -2], [2, 3, 2])
    assert np.linalg.norm([4, 3, 4]) < VAST * np.linalg.norm([0.3] * 3)
    low, high = work_bounds(make_scene((table, GREY, np.eye(4)), (walls, GREY, np.eye(4))), (0.0,))
    assert np.allclose(low, [-2, 0, -2]) and np.allclose(high, [2, 3, 2])
    spread = make_scene(*((table, GREY, at(x, 0, 0)) for x in (0, 1, STRAY / 2)))
    assert np.allclose(work_bounds(spread, (0.0,))[1][0], STRAY / 2 + 0.3)


def test_room_of_open_cells_is_no_less_than_the_clearance_and_near_the_truth():
    """Rays overestimate a distance. With 96 of them, the nearest one is within 2.8 / sqrt(96) = 0.29 rad of the true
    direction: on a plane that is 1 / cos(0.29) - 1 = 4.4 %; at edges, which rays pass, it may be more, so there the median."""
    scene = field_of_posts()
    probe, space = explored(scene)
    truth = distances_to_triangles(space.centres[::37] + probe.origin, world_triangles(scene))
    found = space.room[::37]
    near = truth < 1.1
    assert near.sum() > 50
    assert np.all(found[near] >= truth[near] - 1e-4)
    assert np.median(found[near] / truth[near]) < 1.044


def test_no_open_cell_lies_inside_a_solid_or_below_the_ground():
    scene = field_of_posts()
    probe, space = explored(scene)
    nodes = reachable(space, (0.9, 2.2), 0.6)
    places = space.centres[nodes] + probe.origin
    boxes = [(m.positions.min(axis=0), m.positions.max(axis=0)) for m in scene.meshes[1:]]
    inside = [np.all((places > low) & (places < high), axis=1).any() for low, high in boxes]
    assert not any(inside)
    assert places[:, 1].min() > 0
    assert len(nodes) > 1000


def test_the_chambers_of_a_maze_are_joined_and_its_outside_is_not():
    probe, space = explored(maze(), cell=0.4)
    places = space.centres[reachable(space, (0.9, 2.2), 0.6)] + probe.origin
    chambers = {(int(x // 3), int(z // 3)) for x, z in np.floor(places[:, [0, 2]] + 7.5)}
    assert {(i, j) for i in range(5) for j in range(5)} <= chambers
    assert np.abs(places[:, [0, 2]]).max() < 7.5


def test_neighbours_are_not_joined_through_a_thin_wall():
    """A sheet without thickness between two halves of a yard: no joined pair has its ends on both sides."""
    sheet = box([0, 0, -5], [0, 3, 5])
    scene = make_scene((flat_ground(5.0), GREY, np.eye(4)), (sheet, GREY, np.eye(4)))
    probe, space = explored(scene, clearance=0.05, cell=0.5)
    start, end = space.joined.nonzero()
    x = space.centres[:, 0] + probe.origin[0]
    both = (x[start] < 0) != (x[end] < 0)
    assert len(start) > 500 and not both.any()


def test_the_inside_of_a_closed_room_wins():
    probe, space = explored(room())
    places = space.centres[reachable(space, (0.9, 2.2), 0.6)] + probe.origin
    assert np.abs(places[:, [0, 2]]).max() < 3 and 0 < places[:, 1].min() and places[:, 1].max() < 3


def test_what_moves_is_not_free_at_any_of_the_times():
    def place(time_s):
        return at(-6 + 12 * time_s, 0, 0)

    scene = replace(
        make_scene((flat_ground(8.0), GREY, np.eye(4)), (box([-1, 0, -1], [1, 3, 1]), GREY, place)), animation_end_s=1.0
    )
    times = (0.0, 0.5, 1.0)
    probe, space = explored(scene, cell=0.5, times=times)
    places = space.centres + probe.origin
    for time_s in times:
        truth = distances_to_triangles(places[::5], world_triangles(scene, time_s))
        assert truth.min() > 0.3 * np.cos(0.29)  # the clearance, and the rays' angle to the nearest point of a plane
    places = places[reachable(space, (0.9, 2.2), 0.6)]  # the box's own inside is open, but nobody comes there
    in_the_way = np.any(np.abs(places[:, None, 0] - np.array([-6.0, 0, 6])) < 1, axis=1) & (np.abs(places[:, 2]) < 1)
    assert not in_the_way.any()


@pytest.mark.parametrize("scale, metres", [(1.0, 1.0), (100.0, 0.01)])
def test_units_change_nothing(scale, metres):
    scene = replace(field_of_posts(scale=scale), metres_per_unit=metres)
    _, space = explored(scene, heights=(0.9 * scale, 2.2 * scale), clearance=0.3 * scale, cell=0.5 * scale)
    _, same = explored(field_of_posts(), cell=0.5)
    assert abs(len(space.cells) - len(same.cells)) <= 0.002 * len(same.cells)  # float32 rays decide at the clearance itself


def test_geometry_far_from_the_origin_is_the_same():
    """By matrices 1e6 units away: points are relative to the probe's origin."""
    _, space = explored(field_of_posts(centre=(1e6, 0, -1e6)), cell=0.5)
    _, same = explored(field_of_posts(), cell=0.5)
    assert abs(len(space.cells) - len(same.cells)) <= 0.002 * len(same.cells)


def test_a_camera_that_faces_a_wall_sees_the_wall_and_not_what_is_behind():
    parts = [(flat_ground(8.0), GREY, np.eye(4)), (box([-8, 0, -4], [8, 4, -3.9]), GREY, np.eye(4))]
    probe, space = explored(make_scene(*parts), cell=0.5)
    coverage = make_coverage(space, [np.arange(len(space.cells))], 20.0)
    camera = np.eye(4)
    camera[:3, 3] = np.array([0, 1.5, 2.0]) - probe.origin
    (seen,) = seen_cells(coverage, probe.posed(0.0), [camera[None]], [np.radians(60)])
    centres = space.grid.centres(coverage.cells[seen]) + probe.origin
    assert len(seen) > 50
    assert centres[:, 2].min() > -4.3 and centres[:, 2].max() < 2.0  # nothing behind the wall, or behind the camera
    assert (centres[:, 1] > 0.5).any() and (centres[:, 1] < 0.5).any()  # wall and ground


def test_a_scene_without_room_is_refused_in_one_line():
    crowded = make_scene((box([0, 0, 0], [1, 1, 1]), GREY, np.eye(4)))
    with pytest.raises(InputError, match="no cell of the grid has"):
        explored(crowded, clearance=5.0)


def test_cells_too_small_are_refused():
    with pytest.raises(InputError, match="choose larger ones"):
        explored(field_of_posts(), cell=0.01)


def test_rays_reach_as_far_as_asked():
    probe = make_probe(make_scene((flat_ground(8.0), GREY, np.eye(4))), np.zeros(3), (0.0,))
    points, down = np.array([[0, 2.0, 0], [0, 3.0, 0]]), np.tile([0.0, -1, 0], (2, 1))
    assert first_hits(probe.posed(0.0), points, down, 2.5).tolist() == [2.0, np.inf]
