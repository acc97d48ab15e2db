"""Meshes that deform and objects that appear: motion against float64 projections of the same material points."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, fractions, make_scene, path_of, project, quad
from framepairs.conventions import Stream
from framepairs.scene.description import Deformed, Light, Material, Mesh, Slot, Texture
from framepairs.scene.needs import channel_needs

GRAY = Material(name="gray")
DISPLAY = (192, 108)


def grid(cells: int, size: float, name: str = "grid") -> Mesh:
    """A square in the plane z = 0 of cells x cells quads."""
    ticks = np.linspace(-size / 2, size / 2, cells + 1, dtype=np.float32)
    x, y = np.meshgrid(ticks, ticks)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    up = cells + 1
    faces = np.concatenate(
        [np.stack([first, first + 1, first + 1 + up], 1), np.stack([first, first + 1 + up, first + up], 1)]
    )
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size, np.float32)], axis=1)
    normals = np.tile(np.float32([0, 0, 1]), (len(positions), 1))
    return Mesh(name=name, positions=positions, faces=faces.astype(np.uint32), normals=normals, deforms=True)


def deforming(matrix, bend, mesh=None, **keys):
    """A scene with one mesh whose vertices at a time are `bend`(time, positions)."""
    mesh = mesh or grid(16, 2.0)
    scene = make_scene((mesh, GRAY, lambda time: matrix(time) if callable(matrix) else matrix), **keys)

    def deformed(time: float) -> dict[int, Deformed]:
        return {0: Deformed(positions=bend(time, mesh.positions.astype(float)).astype(np.float32), normals=mesh.normals)}

    return replace(scene, deformed=deformed)


def sheared(time: float, points: np.ndarray) -> np.ndarray:
    """Affine in the plane, so that every point of a triangle is known: x += 0.3 t y, y scaled by 1 + 0.2 t."""
    x, y, z = points.T
    return np.stack([x + 0.3 * time * y, y * (1 + 0.2 * time), z + 0.1 * time], axis=1)


def unsheared(time: float, points: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(points, -1, 0)
    y = y / (1 + 0.2 * time)
    return np.stack([x - 0.3 * time * y, y, z - 0.1 * time], axis=-1)


@pytest.mark.parametrize("scale, far_away", [(1.0, 0.0), (1.0, 1e6), (1e-3, 0.0)])
def test_motion_follows_the_material_point_of_a_shearing_mesh(scale, far_away):
    """At 1920 x 1080, as the whole scene, its units, or its distance from the origin change."""
    size = (1920, 1080)
    place = at(far_away, -far_away, far_away) @ np.diag([scale, scale, scale, 1.0]) @ at(0, 0, -3)
    camera = at(far_away, -far_away, far_away)
    before = at(far_away + 0.05 * scale, -far_away, far_away)
    path = path_of(before, camera, near=0.01 * scale, far=100 * scale)
    stage = Stage(deforming(place, sheared), path)
    stream = Stream(name="hr", size=size)
    arrays = stage.engine.render(stage.shoot.state(1), stream, frozenset({"motion", "object_id"}), 0).arrays
    _, tan_x, tan_y = camera_basis(stage, 1)
    x, y = fractions(*size)
    depth = 3 - 0.1  # of the plane at time 1, in units of `scale`
    local = np.stack([(2 * x - 1) * tan_x * depth, (1 - 2 * y) * tan_y * depth, np.full_like(x, -depth)], axis=-1)
    material = unsheared(1.0, local + [0, 0, 3])
    then = sheared(0.0, material.reshape(-1, 3)).reshape(material.shape) - [0, 0, 3]
    expected = (project(then * scale, at(0.05 * scale, 0, 0), tan_x, tan_y) - np.stack([x, y], axis=-1)) * size
    hit = arrays["object_id"][..., 0] == 1
    error = np.abs(arrays["motion"] - expected)[hit]
    assert hit.sum() > 400_000
    assert np.median(error) <= 1e-4 and error.max() <= (1e-2 if far_away or scale != 1 else 5e-3)


def test_vertices_that_stand_still_do_not_move():
    """One corner of the mesh is bent; all else, and everything on the next frame, has motion exactly 0."""

    def bend(time, points):
        bent = points.copy()
        bent[points[:, 0] > 0.7] += [0, 0, 0.2 * min(time, 1)]
        return bent

    stage = Stage(deforming(at(0, 0, -3), bend), path_of(*[np.eye(4)] * 3), display=DISPLAY)
    moved, still = (stage.arrays(frame, "hr") for frame in (1, 2))
    width, height = DISPLAY
    x, _ = fractions(width, height)
    left = (arrays_left := moved["object_id"][..., 0] == 1) & (x < 0.5)
    assert left.sum() > 500 and not moved["motion"][left].any()
    assert moved["motion"][arrays_left & (x > 0.62)].any()
    assert not still["motion"].any() and (still["visibility"] == 7).all()


def test_any_frame_alone_equals_itself_in_the_sequence():
    scene = deforming(lambda time: at(0.1 * time, 0, -3), sheared)
    path = path_of(*(at(0.02 * k, 0, 0) for k in range(4)))
    in_order, alone = Stage(scene, path, display=DISPLAY), Stage(scene, path, display=DISPLAY)
    for frame in range(3):
        in_order.arrays(frame, "hr")
    expected, found = in_order.arrays(3, "hr"), alone.arrays(3, "hr")
    assert all(np.array_equal(expected[name], found[name]) for name in expected)


def test_instances_share_a_mesh_that_deforms_as_if_each_had_its_own():
    """Three objects, two of which move, with one mesh that leaves its first bounds; then each with a mesh of its own."""
    mesh = grid(8, 1.0)
    places = [
        lambda time: at(-0.8, 0, -4) @ np.diag([1.2, 1, 1, 1]),
        lambda time: at(0.3, 0.1 * time, -3.5),
        lambda time: at(0.9 - 0.1 * time, -0.4, -5) @ np.diag([1, -1, 1, 1]),
    ]
    path = path_of(*(at(0.02 * k, 0, 0) for k in range(4)))

    def deformed(time, meshes):
        positions = (sheared(time, mesh.positions.astype(float)) + [0, 0.2 * time**2, 0]).astype(np.float32)
        return {index: Deformed(positions=positions, normals=mesh.normals) for index in range(meshes)}

    own = make_scene(*((mesh, GRAY, place) for place in places))
    own = replace(own, deformed=lambda time: deformed(time, 3))
    objects = tuple(replace(item, mesh=0, moves=True) for item in own.objects)
    shared = replace(own, meshes=(mesh,), objects=objects, deformed=lambda time: deformed(time, 1))
    stages = [Stage(scene, path, display=DISPLAY) for scene in (shared, own)]
    for frame in range(4):
        a, b = (stage.arrays(frame, "hr") for stage in stages)
        same = a["object_id"][..., 0] == b["object_id"][..., 0]
        assert same.mean() > 0.999 and set(np.unique(a["object_id"])) == {0, 1, 2, 3}  # edges may fall to either side
        for name, tolerance in (("depth", 2**-20), ("motion", 1e-3), ("normal", 2**-20)):
            finite = same & np.isfinite(b["depth"][..., 0])
            np.testing.assert_allclose(a[name][finite], b[name][finite], rtol=2**-20, atol=tolerance, err_msg=name)
        assert (a["visibility"][same] == b["visibility"][same]).mean() > 0.999


def test_normals_follow_the_vertices():
    def turned(time):
        return {0: Deformed(positions=MESH.positions, normals=np.tile(np.float32([0.6, 0, 0.8]), (len(MESH.positions), 1)))}

    MESH = grid(2, 4.0)
    scene = replace(make_scene((MESH, GRAY, lambda time: at(0, 0, -3))), deformed=turned)
    normal = Stage(scene, path_of(np.eye(4)), display=DISPLAY).arrays(0, "hr")["normal"][54, 96]
    np.testing.assert_allclose(normal, [0.6, 0, 0.8], atol=2**-20)


def blinking():
    """A wall, and a card before it that is drawn at times 1 and 2 only."""
    scene = make_scene((quad(20, 20), GRAY, at(0, 0, -4)), (quad(1, 1), GRAY, lambda time: at(0, 0, -2)))
    return replace(scene, visible=lambda time: np.array([True, 1 <= time < 3]))


def test_an_object_appears_and_disappears():
    stage = Stage(blinking(), path_of(*[np.eye(4)] * 4), display=DISPLAY)
    centre = (54, 96)
    ids = [stage.arrays(frame, "hr")["object_id"][(*centre, 0)] for frame in range(4)]
    assert ids == [1, 2, 2, 1]
    appeared, stays, gone = (stage.arrays(frame, "hr")["visibility"][(*centre, 0)] for frame in (1, 2, 3))
    assert appeared == 3 and stays == 7 and gone == 3  # bit 2: the previous frame saw the wall, the card, the card
    assert not stage.arrays(3, "hr")["motion"].any()


def test_what_is_hidden_casts_no_shadow():

    sun = Light(name="sun", kind="directional", radiance=(3, 3, 3), direction=(0.6, 0, -0.8))
    stage = Stage(replace(blinking(), lights=(sun,)), path_of(*[np.eye(4)] * 2), display=DISPLAY, antialiasing=1)
    hidden, drawn = (stage.arrays(frame, "lr_x2")["color"] for frame in (0, 1))
    wall = stage.arrays(1, "lr_x2")["object_id"][..., 0] == 1
    assert hidden.min() > 0 and (drawn[wall].max(-1) == 0).any()


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.diag([1.0, 0, 1, 1])])
def test_an_object_without_extent_is_not_drawn_and_breaks_nothing(matrix):
    poses = [at(0, 0, -2), matrix @ at(0, 0, -2), at(0, 0, -2)]
    poses[1][3] = [0, 0, 0, 1]
    scene = make_scene((quad(20, 20), GRAY, at(0, 0, -4)), (quad(1, 1), GRAY, lambda time: poses[round(time)]))
    path = path_of(at(0, 0, 1), at(0, 0, 1), at(0, 0, -1))  # around the render origin, which the first two see
    stage = Stage(scene, path, display=DISPLAY)
    for frame, seen in ((0, 2), (1, 1), (2, 2)):
        arrays = stage.arrays(frame, "hr")
        assert arrays["object_id"][54, 96, 0] == seen
        assert all(np.isfinite(array).all() for array in arrays.values())


def test_lights_and_materials_change_and_move_no_surface():
    """A wall with a texture that scrolls by half of itself a frame, under a sun that dims and a glow that grows."""
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[:, 1, :3] = 0
    image = Texture(name="halves", texels=texels, srgb=False)
    sun = Light(name="sun", kind="directional", radiance=(np.pi,) * 3, direction=(0, 0, -1))

    def wall(time: float) -> Material:
        slot = Slot(texture=0, uv=((1.0, 0.0, 0.5 * time), (0.0, 1.0, 0.0)))
        return Material(
            name="wall", base_color=(1, 1, 1), specular=0.0, roughness=1.0, base_texture=slot, emission=(0.25 * time,) * 3
        )

    scene = replace(
        make_scene((quad(4, 4), wall(0), at(0, 0, -1)), lights=(sun,), textures=(image,)),
        lights_at=lambda time: (replace(sun, radiance=(np.pi * (1 - 0.5 * time),) * 3),),
        materials_at=lambda time: (wall(time),),
    )
    keys = {"anisotropy": 1, "scales": (1,)}
    stage = Stage(scene, path_of(*[np.eye(4)] * 2), display=DISPLAY, **keys)
    first, second = (stage.arrays(frame, "lr_x1") for frame in (0, 1))
    pixel = (54, 72)  # x = -0.14 of the wall's -2 to 2: u = 0.43, near the edge of the white half's middle
    assert first["albedo"][pixel][0] + second["albedo"][pixel][0] == pytest.approx(1, abs=1e-3)
    assert not second["motion"].any() and (second["visibility"] == 7).all()
    for arrays, dimmed, glow in ((first, 1.0, 0.0), (second, 0.5, 0.25)):
        np.testing.assert_allclose(arrays["emission"][pixel], glow, atol=1e-6)
        lit = arrays["color"][pixel] - arrays["emission"][pixel]
        np.testing.assert_allclose(lit, dimmed * arrays["albedo"][pixel], rtol=0.02, atol=2e-3)  # Schlick's rim at specular 0
    alone = Stage(scene, path_of(*[np.eye(4)] * 2), display=DISPLAY, **keys).arrays(1, "lr_x1")
    assert all(np.array_equal(alone[name], second[name]) for name in alone)
    assert channel_needs(scene, stage.shoot.samples, stage.plan)["emission"].needed


@pytest.mark.parametrize("mode", ["raster", "path"])
def test_a_glow_that_begins_later_lights_others(mode):
    lamp = Material(name="lamp", base_color=(0, 0, 0), specular=0.0)
    scene = make_scene((quad(4, 4), GRAY, at(0, 0, -3)), (quad(0.5, 0.5), lamp, at(1.5, 0, -2.5)))
    glowing = (scene.materials[0], replace(lamp, emission=(20.0, 20.0, 20.0)))
    scene = replace(
        scene, materials_at=lambda time: glowing if time >= 1 else scene.materials, animation_end_s=1.0
    )
    stage = Stage(
        scene, path_of(*[np.eye(4)] * 2), display=(32, 18), mesh_lights=True, shading=mode, samples_per_pixel=16, max_depth=2
    )
    dark, lit = (stage.arrays(frame, "hr") for frame in (0, 1))
    wall = dark["object_id"][..., 0] == 1
    assert not dark["color"].any() and np.median(lit["color"][wall]) > 0.01
    assert len(stage.engine.shading.mesh_lights.objects) == 1
