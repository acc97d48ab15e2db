"""`path` shading against answers known by hand, and against `raster` where both must agree.

Mitsuba's `principled` diffuse is Disney's, not Lambert's. Seen along the normal, with specular 0 and roughness r, light from
the angle with cosine c is reflected by base / pi * (1 + (1 - c)^5 (r (1 + c) - 1/2)): exactly base / pi for light along the
normal, and integrated over the hemisphere base * (1 + (2 r - 1) / 42 + r / 84). Cameras here are far away and narrow, so that
all pixels look along the normal: (1 - cos 1 degree)^5 is 1e-19.
"""

from dataclasses import replace

import numpy as np
import pytest

from analytic import at, constant_sky, make_scene, quad
from framepairs.backend import dr, mi
from framepairs.conventions import BrdfModel, Stream
from framepairs.engine import Engine
from framepairs.environment import build_sky, sky_radiance
from framepairs.frame import CameraState, FrameState
from framepairs.path_tracing import PathTracer, path_color
from framepairs.plan import RenderPlan
from framepairs.projection import direction, view_of
from framepairs.scene.description import Environment, Light, Material, Mesh, Slot, Texture
from framepairs.transforms import look_at

pytestmark = pytest.mark.renders

SIZE = (12, 8)
LR = Stream(name="lr", size=SIZE)
WHITE_SKY = constant_sky((1, 1, 1))
MATT = Material(name="matt", base_color=(0.4, 0.4, 0.4), roughness=0.5, specular=0.0)
LAMP = Material(name="lamp", base_color=(0, 0, 0), roughness=1.0, specular=0.0, emission=(3.0, 2.0, 1.0))
DOWN = Light(name="sun", kind="directional", radiance=(np.pi, 2 * np.pi, 3 * np.pi), direction=(0, 0, -1))


def box(smooth: bool) -> Mesh:
    """The cube [-1/2, 1/2]^3 with eight vertices; smooth normals point along the diagonals."""
    corners = np.float32([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.uint32([t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])])
    return Mesh(name="box", positions=corners, faces=triangles, normals=2 * corners / 3**0.5 if smooth else None)


def camera_at(position, target=(0, 0, 0), fov_y=1.0, near=0.1, far=1e4, aspect=1.5) -> CameraState:
    matrix = look_at(np.array(position, float), np.array(target, float), np.array([0, 1.0, 0]))
    return CameraState(world_from_camera=matrix, fov_y=np.radians(fov_y), aspect=aspect, near=near, far=far)


ABOVE = camera_at((0, 0, 100))  # sees 2.618 x 1.745 of the plane z = 0


def state_of(scene, camera=ABOVE, frame=0, matrices=None, origin=(0, 0, 0)) -> FrameState:
    matrices = scene.world_from_object(0.0) if matrices is None else matrices
    return FrameState(
        frame=frame,
        time_s=0.0,
        frame_time_ms=40.0,
        reset=True,
        exposure_ev=0.0,
        camera=camera,
        previous_camera=camera,
        world_from_object=matrices,
        previous_world_from_object=matrices,
        render_origin=np.array(origin, float),
    )


def render(tracer, state, stream=LR, jitter=(0.0, 0.0), seed=1) -> np.ndarray:
    """[height, width, 3]"""
    view = view_of(state.camera, state.render_origin)
    color = np.array(path_color(tracer, state, view, stream, jitter, seed))
    return np.moveaxis(color.reshape(3, stream.size[1], stream.size[0]), 0, -1)


def path_image(scene, camera=ABOVE, spp=1, depth=2, stream=LR, jitter=(0.0, 0.0), seed=1, **state) -> np.ndarray:
    plan = RenderPlan(shading="path", samples_per_pixel=spp, max_depth=depth)
    return render(PathTracer(scene, plan), state_of(scene, camera, **state), stream, jitter, seed)


def raster_image(scene, channel, camera=ABOVE, stream=LR) -> np.ndarray:
    engine = Engine(scene, RenderPlan(display=stream.size, brdf_table=8))
    return engine.render(state_of(scene, camera), stream, frozenset({channel}), 1).arrays[channel]


def mean_and_error(image) -> tuple[np.ndarray, np.ndarray]:
    """Mean [3] over independent pixels of equal expectation, and its standard error."""
    flat = image.reshape(-1, 3).astype(np.float64)
    return flat.mean(axis=0), flat.std(axis=0, ddof=1) / len(flat) ** 0.5


@pytest.mark.parametrize("roughness", [0.25, 1.0])
def test_white_furnace(roughness):
    scene = make_scene((quad(50, 50), replace(MATT, roughness=roughness), np.eye(4)), sky=WHITE_SKY)
    mean, error = mean_and_error(path_image(scene, spp=256, depth=6))
    exact = 0.4 * (1 + (2 * roughness - 1) / 42 + roughness / 84)
    assert np.all(error < 2e-3) and np.all(np.abs(mean - exact) < 4 * error)


@pytest.mark.parametrize("matrix", [np.eye(4), np.diag([1.0, 1, -1, 1]), np.diag([-1.0, 1, 1, 1])])
def test_directional_light_gives_irradiance_times_albedo_over_pi(matrix):
    """Whichever way the surface faces."""
    image = path_image(make_scene((quad(50, 50), MATT, matrix), lights=(DOWN,)))
    np.testing.assert_allclose(image, np.broadcast_to([0.4, 0.8, 1.2], image.shape), rtol=1e-5)  # no noise: one light


def test_point_light_falls_off_with_the_squared_distance():
    light = Light(name="point", kind="point", radiance=(np.pi, np.pi, np.pi), position=(0, 0, 50), direction=(0, 0, 1))
    scene = make_scene((quad(50, 50), MATT, np.eye(4)), lights=(light,))
    # within 1.57 of the foot, 1 / d^2 and the cosine stay within 0.2 % of their values there; the light shines everywhere
    np.testing.assert_allclose(path_image(scene, origin=(7, -3, 20)), 0.4 / 50**2, rtol=2e-3)


@pytest.mark.parametrize("cosine, share", [(0.95, 1.0), (0.85, 0.75), (0.75, 0.25), (0.65, 0.0)])
def test_spot_fades_linearly_in_the_cosine(cosine, share):
    aim = (0, (1 - cosine**2) ** 0.5, -cosine)
    light = Light(name="spot", kind="spot", radiance=(1, 1, 1), position=(0, 0, 500), direction=aim, cone=(0.9, 0.7))
    scene = make_scene((quad(50, 50), MATT, np.eye(4)), lights=(light,))
    centre = path_image(scene)[3:5, 5:7].mean()  # 0.1 off the axis: the cosine is right to 2e-4
    assert centre == pytest.approx(share * 0.4 / np.pi / 500**2, rel=5e-3, abs=1e-12)


def textured(texels, uv=((1, 0, 0), (0, 1, 0)), wrap=("repeat", "repeat"), **changes):
    """A textured quad that fills ABOVE's frame of 12 x 8, lit so that colour is the texel."""
    texture = Texture(name="texels", texels=texels, srgb=False, wrap=wrap)
    material = replace(MATT, base_color=(1, 1, 1), base_texture=Slot(texture=0, uv=uv), **changes)
    height = 200 * np.tan(np.radians(0.5))
    sun = replace(DOWN, radiance=(np.pi,) * 3)
    return make_scene((quad(1.5 * height, height), material, np.eye(4)), textures=(texture,), lights=(sun,))


def random_texels(height, width, seed=0) -> np.ndarray:
    texels = np.random.default_rng(seed).uniform(0.1, 0.9, (height, width, 4)).astype(np.float32)
    texels[..., 3] = 1
    return texels


def test_texture_lies_as_its_rows_do():
    texels = random_texels(5, 7)
    stream = Stream(name="lr", size=(21, 15))  # three pixels a texel, the middle one at its centre
    image = path_image(textured(texels), stream=stream)
    np.testing.assert_allclose(image[1::3, 1::3], texels[..., :3], rtol=2e-3)  # kept in half precision


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_texture_equals_rasters_albedo(wrap):
    turned = ((0.3, -1.4, 0.9), (1.2, 0.5, -0.7))  # turns, stretches and leaves [0, 1]
    scene = textured(random_texels(5, 7), turned, (wrap, wrap))
    image, albedo = path_image(scene), raster_image(scene, "albedo", stream=replace(LR, mip_bias=-8.0))
    assert albedo.std() > 0.1
    np.testing.assert_allclose(image, albedo, atol=2e-3)


def disney(roughness, normal, to_eye, to_light) -> float:
    """Disney's diffuse over Lambert's (Burley 2012, section 5.3), as Mitsuba has it."""
    half = (to_eye + to_light) / np.linalg.norm(to_eye + to_light)
    retro = 2 * roughness * (half @ to_light) ** 2
    f_i, f_o = (1 - normal @ to_eye) ** 5, (1 - normal @ to_light) ** 5
    return (1 - f_i / 2) * (1 - f_o / 2) + retro * (f_o + f_i + f_o * f_i * (retro - 1))


@pytest.mark.parametrize("flip_u, flip_v", [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_normal_map_bends_as_in_raster(flip_u, flip_v):
    texels = np.tile(np.float32([0.45, 0.25, 0.857, 1]), (2, 3, 1))
    uv = quad(1, 1).uv * (flip_u, flip_v)
    light = replace(DOWN, radiance=(np.pi,) * 3, direction=(-0.48, -0.6, -0.64))
    material = replace(MATT, normal_texture=Slot(texture=0), normal_scale=0.8)
    texture = Texture(name="normals", texels=texels, srgb=False)
    scene = make_scene((replace(quad(50, 50), uv=np.float32(uv)), material, np.eye(4)), textures=(texture,), lights=(light,))
    normal, to_light, to_eye = raster_image(scene, "normal")[4, 6], -np.array(light.direction), np.array([0, 0, 1.0])
    assert np.sign(normal[:2]) == pytest.approx([flip_u, flip_v])
    expected = 0.4 * disney(0.5, normal, to_eye, to_light) * (normal @ to_light)
    np.testing.assert_allclose(path_image(scene)[4, 6], expected, rtol=2e-3)  # normals are kept in half precision


def test_normals_follow_matrices_that_stretch_and_mirror():
    matrix = np.eye(4)
    matrix[:3, :3] = [[2, 0.5, 0.1], [0.3, -0.7, 0], [0.2, 0.4, 1.5]]
    leaning = np.tile(np.float32([0.36, 0.48, 0.8]), (4, 1))
    scene = make_scene((replace(quad(50, 50), normals=leaning), MATT, matrix), lights=(replace(DOWN, radiance=(np.pi,) * 3),))
    normal, above = raster_image(scene, "normal")[4, 6], np.array([0, 0, 1.0])
    assert 0.3 < normal[2] < 0.9
    expected = 0.4 * disney(0.5, normal, above, above) * normal[2]
    np.testing.assert_allclose(path_image(scene)[4, 6], expected, rtol=1e-4)


def sky_with_one_bright_texel() -> Environment:
    texels = np.full((6, 10, 3), 0.1, np.float32)
    texels[1, 7], texels[4, 2] = (50, 30, 10), (1, 2, 7)
    tilt = look_at(np.zeros(3), np.array([0.3, -0.5, 0.8]), np.array([0.2, 1.0, 0.1]))[:3, :3]
    return Environment(name="one texel", texels=texels, world_from_environment=tilt)


def seen_in(sky: Environment, directions) -> np.ndarray:
    """`raster`'s radiance [n, 3] along `directions` [n, 3], without a footprint."""
    zero = mi.Vector3f(0)
    vectors = mi.Vector3f(np.ascontiguousarray(directions.T, dtype=np.float32))
    return np.array(sky_radiance(build_sky(sky, BrdfModel()), vectors, zero, zero, mi.Bool(True))).T


@pytest.mark.parametrize("target", [(1, 0, 0), (0, 0, 1), (-1, 0.3, -0.4), (0.1, 1, 0), (0.2, -1, 0)])
def test_visible_sky_is_rasters(target):
    sky, camera = sky_with_one_bright_texel(), camera_at((0, 0, 0), target, fov_y=80)
    image = path_image(make_scene(sky=sky), camera)
    fractions = [((i + 0.5) / SIZE[0], (j + 0.5) / SIZE[1]) for j in range(SIZE[1]) for i in range(SIZE[0])]
    x, y = (mi.Float(np.float32(column)) for column in zip(*fractions, strict=True))
    expected = seen_in(sky, np.array(direction(view_of(camera, np.zeros(3)), x, y)).T)
    np.testing.assert_allclose(image.reshape(-1, 3), expected, rtol=3e-3)  # half precision there


def test_a_sun_is_not_seen():
    assert np.all(path_image(make_scene(lights=(DOWN,)), camera_at((0, 0, 0), (0, 0, 1), fov_y=80)) == 0)


@pytest.mark.parametrize("facing", [(0, 0, 1), (1, 0.2, -0.3), (-0.5, -0.7, 0.2)])
def test_light_of_the_sky_comes_from_where_it_is_seen(facing):
    sky = sky_with_one_bright_texel()
    matrix = look_at(np.array(facing, float), np.zeros(3), np.array([0, 1.0, 0]))  # takes +z to `facing`
    matrix[:3, 3] = 0
    normal = matrix[:3, 2]
    scene = make_scene((quad(50, 50), MATT, matrix), sky=sky)
    mean, error = mean_and_error(path_image(scene, camera_at(100 * normal), spp=512))
    theta, phi = np.meshgrid((np.arange(720) + 0.5) / 720 * np.pi, np.arange(1440) / 1440 * 2 * np.pi, indexing="ij")
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    cosine = np.maximum(around @ normal, 0)
    reflected = 0.4 / np.pi * (1 + (1 - cosine) ** 5 * 0.5 * cosine) * cosine
    solid_angle = np.sin(theta).ravel() * (np.pi / 720) ** 2
    exact = (seen_in(sky, around) * (reflected * solid_angle)[:, None]).sum(axis=0)
    # 4 standard errors, and 0.1 % for the half precision and the steps of the sum
    assert np.all(error < 0.02 * exact) and np.all(np.abs(mean - exact) < 4 * error + 1e-3 * exact)


def test_equal_calls_give_equal_bytes():
    scene = make_scene((quad(50, 50), MATT, np.eye(4)), (box(True), LAMP, at(0, 0, 2)), sky=WHITE_SKY)
    first, second = (path_image(scene, spp=8, depth=4) for _ in range(2))
    assert first.std() > 0 and first.tobytes() == second.tobytes()


def test_samples_that_are_not_finite_count_as_nothing():
    texels = random_texels(5, 7)
    texels[1, 2] = np.nan
    image = path_image(textured(texels), stream=Stream(name="lr", size=(21, 15)))
    assert np.all(image[4, 7] == 0) and np.isfinite(image).all()
    np.testing.assert_allclose(image[10, 13], texels[3, 4, :3], rtol=2e-3)


def test_a_frame_alone_equals_itself_after_others():
    mover = [np.eye(4), at(0.3, 0.1, 1.5) @ np.diag([1, -0.7, 1.2, 1])]
    light = Light(name="point", kind="point", radiance=(9, 8, 7), position=(1, 2, 3))
    scene = make_scene((quad(50, 50), MATT, mover[0]), (box(True), LAMP, mover[1]), lights=(light,), sky=WHITE_SKY)
    other = np.array([np.diag([2.0, 1, 1, 1]), at(-0.5, 0.2, 1.1)])
    states = [
        state_of(scene, frame=0),
        state_of(scene, frame=1, matrices=other, origin=(3, 0, 1)),
        state_of(scene, camera_at((1, 2, 30), fov_y=5), frame=2, matrices=other),
        state_of(scene, frame=3),
    ]
    plan = RenderPlan(shading="path", samples_per_pixel=8, max_depth=4)
    alone = [render(PathTracer(scene, plan), state).tobytes() for state in states]
    assert len(set(alone)) == 4
    tracer = PathTracer(scene, plan)
    for k in (0, 1, 2, 3, 1, 0, 2):
        assert render(tracer, states[k]).tobytes() == alone[k]


def test_seed_frame_and_stream_change_the_noise_but_not_the_mean():
    scene = make_scene((quad(50, 50), MATT, np.eye(4)), sky=sky_with_one_bright_texel())
    plan = RenderPlan(shading="path", samples_per_pixel=64, max_depth=2)
    tracer, first, later = PathTracer(scene, plan), state_of(scene), state_of(scene, frame=1)
    other = Stream(name="other", size=SIZE)
    images = [render(tracer, first), render(tracer, first, seed=2), render(tracer, later), render(tracer, first, other)]
    assert len({image.tobytes() for image in images}) == 4
    means, errors = zip(*(mean_and_error(image) for image in images), strict=True)
    for mean, error in zip(means[1:], errors[1:], strict=True):
        assert np.all(np.abs(mean - means[0]) < 4 * np.hypot(error, errors[0]))


def leaf_before_a_floor(alpha, opacities, camera_z) -> np.ndarray:
    """Floor at z = 0, leaf at z = 1 with `opacities` from left to right, sun along -z, camera above or below the leaf."""
    texels = np.ones((2, len(opacities), 4), np.float32)
    texels[..., 3] = opacities
    leaf = replace(MATT, base_color=(0.1, 0.2, 0.3), alpha=alpha, base_texture=Slot(texture=0))
    texture = Texture(name="leaf", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    things = [(quad(50, 50), MATT, np.eye(4)), (quad(4, 4), leaf, at(0, 0, 1))]
    scene = make_scene(*things, textures=(texture,), lights=(replace(DOWN, radiance=(np.pi,) * 3),))
    fov_y = np.degrees(2 * np.arctan(0.8 / camera_z))
    return path_image(scene, camera_at((0, 0, camera_z), fov_y=fov_y))


def test_a_masked_leaf_is_seen_through_where_it_is_not():
    image = leaf_before_a_floor("mask", (0.0, 1.0), 100)
    np.testing.assert_allclose(image[:, :6], 0.4, rtol=1e-4)
    np.testing.assert_allclose(image[:, 6:], np.broadcast_to([0.1, 0.2, 0.3], image[:, 6:].shape), rtol=1e-3)


def test_a_masked_leaf_lets_the_sun_through():
    image = leaf_before_a_floor("mask", (0.0, 1.0), 0.9)  # wide angle from below the leaf: Disney's factor varies
    np.testing.assert_allclose(image[:, :6], 0.4, rtol=0.02)
    assert np.all(image[:, 6:] == 0)


def test_a_blended_leaf_takes_its_share_of_the_sun():
    np.testing.assert_allclose(leaf_before_a_floor("blend", (0.25, 0.25), 0.9), 0.75 * 0.4, rtol=0.02)


@pytest.mark.parametrize("side", [1, -1])
def test_emission_is_seen_from_both_sides(side):
    image = path_image(make_scene((quad(50, 50), LAMP, np.eye(4))), camera_at((0, 0, 100 * side)))
    np.testing.assert_allclose(image, np.broadcast_to([3, 2, 1], image.shape), rtol=1e-5)


def test_emission_is_thinned_by_opacity():
    texels = np.ones((2, 2, 4), np.float32)
    texels[:, 0, 3] = 0.25
    cloud = replace(LAMP, alpha="blend", base_texture=Slot(texture=0))
    texture = Texture(name="cloud", texels=texels, srgb=False, wrap=("clamp", "clamp"))
    image = path_image(
        make_scene((quad(60, 60), cloud, np.eye(4)), textures=(texture,)), camera_at((0, 0, 100), fov_y=20), spp=16
    )
    np.testing.assert_allclose(image[:, [0, -1]], np.multiply.outer([[0.25, 1]] * 8, [3, 2, 1]), rtol=1e-5)


@pytest.mark.parametrize("turned", [False, True])
def test_a_square_lamp_lights_the_floor(turned):
    """Below the centre of a square of side 2 h at height h: E = L * 4 atan(1 / sqrt 2) / sqrt 2 (Lambert's polygon formula
    for four equal corners), from either side of it; its texture repeats over the lamp, with mean 1/2."""
    side, height = 200.0, 100.0  # so large that all that the camera sees lies below its centre
    lamp = replace(LAMP, emission=(1, 2, 3), emission_texture=Slot(texture=0, uv=((3, 0, 0), (0, 5, 0))))
    texels = np.zeros((4, 4, 4), np.float32)
    texels[:, ::2] = 1
    matrix = at(0, 0, height) @ np.diag([1, 1, -1 if turned else 1, 1])
    scene = make_scene(
        (quad(50, 50), MATT, np.eye(4)),
        (quad(side, side), lamp, matrix),
        textures=(Texture(name="stripes", texels=texels, srgb=False),),
    )
    camera = camera_at((0, 0, 50), fov_y=2)
    mean, error = mean_and_error(path_image(scene, camera, spp=1024))
    irradiance = 4 * np.arctan(0.5**0.5) / 2**0.5 / 2 * np.array([1, 2, 3])
    # Disney's factor for r = 0.5 is 1 + c (1 - c)^5 / 2: at most 1.005 for cosines above 0.57, and 1 at 1
    assert np.all(error < 0.01 * mean)
    assert np.all(np.abs(mean - 0.4 / np.pi * irradiance) < 4 * error + 0.003 * mean)


def test_smooth_normals_do_not_change_what_a_lamp_gives():
    images = []
    for smooth in (False, True):
        things = [(quad(50, 50), MATT, np.eye(4)), (box(smooth), LAMP, at(0, 0.2, 1.2))]
        images.append(path_image(make_scene(*things), camera_at((3, 0, 3), fov_y=10), spp=1024))
    (flat, error), (smooth, other) = (mean_and_error(image) for image in images)
    flat_noise = np.abs(images[0] - images[1]).mean() / len(images[0].ravel()) ** 0.5
    assert np.all(np.abs(flat - smooth) < 5 * flat_noise + 2e-3 * flat)


def test_an_object_moves_with_its_matrix():
    scene = make_scene((quad(0.6, 0.6), LAMP, np.eye(4)))
    tracer, pixel = PathTracer(scene, RenderPlan(shading="path")), 200 * np.tan(np.radians(0.5)) / SIZE[1]
    images = [render(tracer, state_of(scene, matrices=at(pixel * x, pixel * y, 0)[None])) for x, y in ((0, 0), (3, 0), (3, 2))]
    assert 0 < images[0].sum() and images[0][4, 6].any()
    np.testing.assert_allclose(images[1], np.roll(images[0], 3, axis=1))
    np.testing.assert_allclose(images[2], np.roll(images[1], -2, axis=0))


SLANTED = look_at(np.zeros(3), np.array([0, 0, -1.0]), np.array([0.3, 1, 0]))


@pytest.mark.parametrize(
    "stream, jitter",
    [
        (LR, (0.0, 0.0)),
        (replace(LR, size=(11, 9)), (0.37, -0.21)),
        (replace(LR, size=(25, 17)), (-0.5, 0.43)),
    ],
)
def test_primary_rays_meet_what_the_g_buffer_does(stream, jitter, monkeypatch):
    scene = make_scene((quad(1.3, 0.9), replace(LAMP, emission=(1, 1, 1)), SLANTED))
    monkeypatch.setattr("framepairs.engine.jitter", lambda frame, length: jitter)
    covered = raster_image(scene, "object_id", stream=replace(stream, jittered=True)) > 0
    image = path_image(scene, spp=3, stream=stream, jitter=jitter)
    assert 0.1 < covered.mean() < 0.5 and set(np.unique(image)) == {0, 1}
    np.testing.assert_array_equal(image[..., :1] > 0, covered)


def test_anti_aliasing_positions_are_rasters():
    scene = make_scene((quad(1.3, 0.9), replace(LAMP, emission=(1, 1, 1)), SLANTED))
    stream = replace(LR, samples=8)
    for spp in (1, 8, 20):  # at least one path each, else as many as go evenly
        image = path_image(scene, spp=spp, stream=stream)
        assert np.all((image * 8) % 1 == 0) and len(np.unique(image)) > 4
        np.testing.assert_array_equal(image, raster_image(scene, "color", stream=stream))


def test_near_and_far_planes_cut():
    things = [(quad(9, 9), LAMP, np.eye(4)), (quad(9, 9), replace(LAMP, emission=(0, 1, 0)), at(0, 0, 9))]
    scene = make_scene(*things, sky=WHITE_SKY)
    seen = [path_image(scene, camera_at((0, 0, 100), near=near, far=far))[4, 6] for near, far in ((1, 500), (92, 500), (1, 90))]
    np.testing.assert_allclose(seen, [[0, 1, 0], [3, 2, 1], [1, 1, 1]], rtol=1e-5)


def test_size_of_the_scene_does_not_matter():
    """A scene 2^16 times smaller gives the same bytes: Mitsuba's ray offset of 1e-4 would otherwise swallow it."""
    images = []
    for scale in (1.0, 2.0**-16):
        shrunk = np.diag([scale, scale, scale, 1])
        light = Light(name="point", kind="point", radiance=(9 * scale**2,) * 3, position=(scale, 2 * scale, 3 * scale))
        things = [(quad(4, 4), MATT, shrunk), (box(True), LAMP, shrunk @ at(0, 0.2, 1.2))]
        scene = make_scene(*things, lights=(light,), sky=WHITE_SKY)
        camera = camera_at((3 * scale, 0, 9 * scale), fov_y=20, near=0.5 * scale, far=1e3 * scale)
        images.append(path_image(scene, camera, spp=4, depth=4))
    assert images[0].std() > 0 and images[0].tobytes() == images[1].tobytes()


def test_vanishing_normals_are_replaced_by_the_triangles():
    lying = [replace(quad(50, 50), normals=normals) for normals in (None, np.zeros((4, 3), np.float32))]
    flat, gone = (path_image(make_scene((mesh, MATT, np.eye(4)), lights=(DOWN,))) for mesh in lying)
    np.testing.assert_allclose(gone, flat, rtol=1e-5)


def test_frames_share_their_kernels():
    light = Light(name="point", kind="point", radiance=(9, 8, 7), position=(1, 2, 3))
    scene = make_scene(
        (quad(50, 50), MATT, np.eye(4)),
        (box(True), LAMP, np.eye(4)),
        lights=(
            light,
            DOWN,
        ),
        sky=WHITE_SKY,
    )
    tracer = PathTracer(scene, RenderPlan(shading="path", samples_per_pixel=4))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for frame in range(5):
            matrices = np.array([np.eye(4), at(0.1 * frame, 0, 1)])
            camera = camera_at((0, 0.3 * frame, 9), fov_y=20 + frame)
            state = state_of(scene, camera, frame=frame, matrices=matrices, origin=(frame, 0, 0))
            render(tracer, state, jitter=(0.1 * frame, -0.2), seed=frame)
            kernels = [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]
            assert kernels and (frame < 2 or all(entry["cache_hit"] for entry in kernels))
