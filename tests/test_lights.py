"""Lights drawn and met: irradiance as known in closed form, densities that are those of the samples, and nothing infinite."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import IDENTITY, at, make_scene, path_of, quad
from framepairs.backend import dr, mi
from framepairs.frame import Shoot
from framepairs.geometry import Geometry
from framepairs.lights import choose_light, light_along, lights_around, sample_light
from framepairs.materials import build_materials
from framepairs.mesh_lights import build_mesh_lights
from framepairs.scene.description import Light, Material, Mesh, Slot, Texture

DULL = Material(name="dull")
LAMP = Material(name="lamp", base_color=(0, 0, 0), emission=(3, 2, 1))
RADIANCE = np.array([3.0, 2.0, 1.0])
GRID = 128  # midpoints per axis of the unit square: the sums below are integrals to 1e-4 of smooth integrands


def state_at(scene, place):
    """The only frame of a camera at `place`, which is its render origin."""
    return Shoot(scene, path_of(at(*place)), 1.0).state(0)


class Lit:
    """A scene's lights around the origin, asked at points."""

    def __init__(self, *parts, lights=(), textures=(), **keys):
        self.scene = make_scene(*parts, lights=tuple(lights), textures=textures, **keys)
        self.geometry, self.materials = Geometry(self.scene), build_materials(self.scene)
        self.meshes, state = build_mesh_lights(self.scene, True), state_at(self.scene, np.zeros(3))
        self.pose, _ = self.geometry.pose(state)
        self.lights = lights_around(self.scene, self.meshes, state)

    def drawn(self, position, u, index=0):
        place = mi.Point3f(*(mi.Float(np.float32(c)) for c in np.asarray(position, float).T))
        active = mi.Bool(True)
        return sample_light(self.lights, self.geometry, self.materials, self.pose, mi.UInt32(index), place, u, active)

    def irradiance(self, position, normal, index=0) -> np.ndarray:
        """[3]: the mean of radiance * cosine / density over midpoints of the unit square."""
        k = dr.arange(mi.UInt32, GRID * GRID)
        u = mi.Point2f((mi.Float(k % GRID) + 0.5) / GRID, (mi.Float(k // GRID) + 0.5) / GRID)
        sample = self.drawn(position, u, index)
        cosine = dr.maximum(dr.dot(sample.towards, mi.Vector3f(*normal)), 0)
        chance = np.array(sample.density, np.float64)
        value = np.array(sample.radiance * cosine, np.float64)
        return np.divide(value, chance, out=np.zeros_like(value), where=chance > 0).mean(axis=1)


def polygon_irradiance(corners, normal) -> float:
    """Irradiance from a polygon of radiance 1 that lies wholly above the surface at the origin (Lambert 1760)."""
    unit = np.asarray(corners, float)
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(unit, np.roll(unit, -1, axis=0), strict=True):
        across = np.cross(a, b)
        total += np.arctan2(np.linalg.norm(across), a @ b) * (across / np.linalg.norm(across)) @ np.asarray(normal, float)
    return abs(total) / 2


def rectangle(half_u=(0.7, 0, 0), half_v=(0, 0.4, 0), position=(0, 0, 1), direction=(0, 0, -1)) -> Light:
    return Light(name="r", kind="rectangle", radiance=tuple(RADIANCE), position=position, direction=direction,
                 half_u=half_u, half_v=half_v)  # fmt: skip


def disk(half_u=(0.5, 0, 0), half_v=(0, 0.5, 0), **keys) -> Light:
    return replace(rectangle(half_u, half_v, **keys), kind="disk")


def sphere(radius=0.3, position=(0, 0, 1)) -> Light:
    return Light(name="s", kind="sphere", radiance=tuple(RADIANCE), position=position, half_u=(radius, 0, 0))


def triangle_mesh(*corners) -> Mesh:
    faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    return Mesh(name="t", positions=np.float32(corners), faces=faces)


@pytest.mark.parametrize("height", [0.1, 1.0, 30.0])
def test_irradiance_below_a_disk(height):
    lit = Lit(lights=[disk(position=(0, 0, height))])
    expected = np.pi * 0.25 / (0.25 + height**2) * RADIANCE
    # at 0.1, the integrand varies by 26^2 over the disk: midpoints err by some 1e-3
    np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=2e-3 if height < 1 else 2e-4)


@pytest.mark.parametrize("half_v", [(0, 0.4, 0), (0.5, 0.4, 0)])
@pytest.mark.parametrize("position", [(0, 0, 1), (0.8, -0.5, 1.0), (0.3, 0.1, 20.0)])
def test_irradiance_below_a_rectangle(position, half_v):
    """Also below a parallelogram."""
    light = rectangle(position=position, half_v=half_v)
    u, v, centre = (np.array(x, float) for x in (light.half_u, light.half_v, light.position))
    expected = polygon_irradiance([centre + u + v, centre - u + v, centre - u - v, centre + u - v], (0, 0, 1)) * RADIANCE
    np.testing.assert_allclose(Lit(lights=[light]).irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=2e-4)


@pytest.mark.parametrize("radius, distance", [(0.3, 1.0), (0.999, 1.0), (1e-3, 50.0)])
def test_irradiance_from_a_sphere(radius, distance):
    """pi L (r / d)^2 cos for a sphere wholly above the horizon."""
    lit = Lit(lights=[sphere(radius, (0, 0, distance))])
    expected = np.pi * (radius / distance) ** 2 * RADIANCE
    np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=2e-4)
    if radius < 0.5:
        np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0.6, 0, 0.8)), 0.8 * expected, rtol=2e-4)


@pytest.mark.parametrize("matrix", [IDENTITY, np.diag([2.0, 0.5, 3, 1]), np.diag([-1.0, 1, 1, 1])])
def test_irradiance_from_a_mesh(matrix):
    """Two triangles of different size, seen from both sides, scaled unevenly and mirrored."""
    corners = np.array([[-0.5, -0.3, 1], [0.6, -0.2, 1.4], [0.1, 0.7, 1.1], [0.3, 0.2, 0.8], [0.9, 0.3, 0.7], [0.5, 0.9, 1.0]])
    lit = Lit((triangle_mesh(*corners), LAMP, matrix))
    placed = corners @ matrix[:3, :3].T
    expected = sum(polygon_irradiance(part, (0, 0, 1)) for part in (placed[:3], placed[3:])) * RADIANCE
    # the face is chosen with the first coordinate: the midpoints next to the border between faces err by 1 / GRID of a face
    np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=2 / GRID)


def test_each_emissive_object_is_a_light_of_its_own():
    lamps = [(quad(1, 1), LAMP, at(0, 0, 5)), (quad(1, 1), replace(LAMP, emission=(9, 0, 9)), at(0, 0, 9))]
    lit = Lit((quad(1, 1), DULL, IDENTITY), *lamps)
    assert int(lit.lights.count[0]) == 2
    for index, (height, radiance) in enumerate(((5, (3, 2, 1)), (9, (9, 0, 9)))):
        corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) / 2 + (0, 0, height)
        expected = polygon_irradiance(corners, (0, 0, 1)) * np.array(radiance)
        np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1), index), expected, rtol=2 / GRID)


def test_the_emission_texture_and_the_mask_of_a_mesh_count():
    texels = np.ones((2, 2, 4), np.float32)
    texels[:, 0, :3], texels[0, :, 3] = 0.5, 0
    lamp = replace(LAMP, alpha="mask", base_texture=Slot(texture=0), emission_texture=Slot(texture=1))
    texture = Texture(name="t", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    lit = Lit((quad(1, 1), lamp, at(0, 0, 20)), textures=(texture, replace(texture, name="e")))
    # bilinear between texel centres: half of the area is opaque, its mean emission is 3/4; so far away all points count alike
    expected = 0.5 * 0.75 / 20**2 * RADIANCE
    np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=1e-2)


def test_light_without_extent():
    point = Light(name="p", kind="point", radiance=(5, 4, 3), position=(0, 3, 4))
    spot = replace(point, kind="spot", direction=(0, -0.6, -0.8), cone=(0.9, 0.5))
    aside = replace(spot, direction=(0, 0.6 * 0.7 - 0.8 * 0.51**0.5, 0.8 * 0.7 + 0.6 * 0.51**0.5))
    aside = replace(aside, direction=tuple(-np.array(aside.direction)))  # 0.7 in the cosine off the aim
    sun = Light(name="d", kind="directional", radiance=(5, 4, 3), direction=(0, -0.6, -0.8))
    lit = Lit(lights=[point, spot, aside, sun])
    found = [lit.irradiance((0, 0, 0), (0, 0, 1), index) for index in range(4)]
    expected = np.array([5, 4, 3]) * 0.8
    for value, share in zip(found, (1 / 25, 1 / 25, 0.5 / 25, 1), strict=True):
        np.testing.assert_allclose(value, share * expected, rtol=1e-5)


KINDS = {
    "rectangle": rectangle(half_v=(0.2, 0.4, 0.1), direction=(0, 0.24253563, -0.9701425)),
    "disk": disk(),
    "sphere": sphere(),
    "far sphere": sphere(0.01, (20, -30, 50)),
    "near sphere": sphere(0.99),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_ray_meets_what_was_drawn_with_its_density(kind):
    rng = np.random.default_rng(1)
    light = KINDS[kind]
    lit, count = Lit(lights=[light]), 20_000
    positions = rng.normal(size=(count, 3)) * 0.3 - (0, 0, 0.5)
    sample = lit.drawn(positions, mi.Point2f(rng.random((2, count), dtype=np.float32) * 0.98 + 0.01))
    place = mi.Point3f(np.float32(positions.T))
    radiance, density = light_along(lit.lights, mi.UInt32(0), place, sample.towards, sample.distance * 1.001)
    chance, met = np.array(sample.density), np.array(density)
    lights_there = chance > 0
    # Rays towards the rim of a light may miss it by their rounding.
    assert lights_there.mean() > 0.9 and ((met > 0) == lights_there).mean() > 0.999
    both = lights_there & (met > 0)
    np.testing.assert_allclose(met[both], chance[both], rtol=2e-3)
    assert np.array_equal(np.array(radiance)[:, both], np.broadcast_to(np.float32(RADIANCE)[:, None], (3, both.sum())))
    blocked = light_along(lit.lights, mi.UInt32(0), place, sample.towards, sample.distance * 0.99)[1]
    assert not np.array(blocked)[both & (light.kind != "sphere")].any()


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere", "near sphere"])
def test_densities_of_rays_integrate_to_one(kind):
    lit, count = Lit(lights=[KINDS[kind]]), 1 << 20
    z = 1 - 2 * (np.arange(count) + 0.5) / count
    phi = np.arange(count) * np.pi * (3 - 5**0.5)  # Fibonacci's lattice of the sphere
    around = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    _, density = light_along(lit.lights, mi.UInt32(0), mi.Point3f(0), mi.Vector3f(np.float32(around)), mi.Float(dr.inf))
    # the light's edge crosses some sqrt(count) cells of the lattice: 1e-3 of the lights here
    assert np.array(density, np.float64).mean() * 4 * np.pi == pytest.approx(1, rel=5e-3)


def test_an_extended_light_shines_on_its_front_only():
    for light in (rectangle(), disk()):
        lit = Lit(lights=[light])
        assert not lit.irradiance((0, 0, 2), (0, 0, -1)).any()
        _, density = light_along(lit.lights, mi.UInt32(0), mi.Point3f(0, 0, 2), mi.Vector3f(0, 0, -1), mi.Float(9))
        assert density[0] == 0


def test_from_inside_a_sphere_there_is_no_light():
    lit = Lit(lights=[sphere(1.0, (0, 0, 0.5))])
    assert not lit.irradiance((0, 0, 0), (0, 0, 1)).any()
    _, density = light_along(lit.lights, mi.UInt32(0), mi.Point3f(0), mi.Vector3f(0, 0, 1), mi.Float(9))
    assert density[0] == 0


DEGENERATE = {
    "rectangle without area": [rectangle(half_v=(1, 0, 0))],
    "rectangle of size 0": [rectangle((0, 0, 0), (0, 0, 0))],
    "disk of size 0": [disk((0, 0, 0), (0, 0, 0))],
    "sphere of radius 0": [sphere(0.0)],
    "in the plane of the light": [rectangle(position=(0, 0, 0)), disk(position=(0, 0, 0))],
    "at the centre": [sphere(0.5, (0, 0, 0)), sphere(0.0, (0, 0, 0))],
    "at the point": [Light(name="p", kind="point", radiance=(1, 1, 1)), Light(name="q", kind="spot", radiance=(1, 1, 1))],
    "black": [rectangle(), replace(sphere(), radiance=(0, 0, 0))],
}


@pytest.mark.parametrize("case", DEGENERATE)
def test_degenerate_lights_give_finite_numbers(case):
    lit = Lit(lights=DEGENERATE[case])
    for index in range(len(DEGENERATE[case])):
        sample = lit.drawn((0, 0, 0), mi.Point2f(0.5, 0.5), index)
        shares = sample.radiance / dr.maximum(sample.density, 1e-30)
        density = light_along(lit.lights, mi.UInt32(index), mi.Point3f(0), mi.Vector3f(0, 0, 1), mi.Float(9))[1]
        for value in (*sample.towards, sample.distance, sample.density, density, density * 0):
            assert np.isfinite(np.array(value)).all()
        if "point" not in case and case != "black":
            assert not np.array(sample.density).any() or np.isfinite(np.array(shares)).all()


def test_degenerate_meshes_give_finite_numbers():
    flat = triangle_mesh((0, 0, 1), (1, 0, 1), (2, 0, 1), (0, 0, 1), (1, 0, 1), (0, 1, 1))  # the first has no area
    lit = Lit((flat, LAMP, IDENTITY), (triangle_mesh((0, 0, 1), (0, 0, 1), (0, 0, 1)), LAMP, IDENTITY))
    assert int(lit.lights.count[0]) == 1  # what has no area is no light
    expected = polygon_irradiance([(0, 0, 1), (1, 0, 1), (0, 1, 1)], (0, 0, 1)) * RADIANCE
    np.testing.assert_allclose(lit.irradiance((0, 0, 0), (0, 0, 1)), expected, rtol=2 / GRID)
    assert np.isfinite(lit.irradiance((0.25, 0.25, 1), (0, 0, 1))).all()  # a point on the lamp


def test_lights_are_chosen_with_their_probability():
    """None that shines is never chosen, none that is black ever."""
    point = Light(name="p", kind="point", radiance=(5, 5, 5), position=(0, 0, 1))
    several = [point, replace(point, radiance=(0, 0, 0)), rectangle(), replace(point, radiance=(1e-6,) * 3)]
    lit = Lit((quad(1, 1), DULL, IDENTITY), (quad(1, 1), LAMP, at(0, 0, 3)), lights=several)
    u = mi.Float((np.arange(1 << 16, dtype=np.float32) + 0.5) / (1 << 16))
    index, chance = (np.array(x) for x in choose_light(lit.lights, u))
    counts = np.bincount(index, minlength=6) / len(index)
    assert (counts > 0).tolist() == [True, False, True, True, True, False]  # neither the black one nor the black sky
    np.testing.assert_allclose(counts, np.array(lit.lights.choice), atol=2 / len(index))
    np.testing.assert_array_equal(chance, np.array(lit.lights.choice)[index])


@pytest.mark.parametrize("scale", [1.0, 1e-3, 200.0])
def test_a_scaled_mesh_is_chosen_by_the_area_it_has(scale):
    """Beside a rectangle of the same area and radiance, whatever the object's matrix."""
    light = replace(rectangle((scale / 2, 0, 0), (0, scale / 2, 0)), position=(0, 0, 1))
    lit = Lit((quad(1, 1), LAMP, np.diag([scale, scale, 1, 1])), lights=[light])
    choice = np.array(lit.lights.choice)
    assert choice[0] == pytest.approx(choice[1], rel=0.3)


def test_lights_lie_around_the_render_origin():
    far = np.array([1e6, -2e6, 3e5])
    near, away = (Lit(lights=[rectangle(position=tuple(np.array([0, 0, 1.0]) + shift))]) for shift in (np.zeros(3), far))
    away.lights = lights_around(away.scene, away.meshes, state_at(away.scene, far))
    assert np.array_equal(near.irradiance((0, 0, 0), (0, 0, 1)), away.irradiance((0, 0, 0), (0, 0, 1)))
