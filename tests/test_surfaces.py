"""What meshes and materials bring beside constants and one texture: second uv, vertex colours, tangents, sides, unlit ones."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import Stage, at, camera_basis, constant_sky, fractions, make_scene, path_of, plan_of, quad
from framepairs.mesh_lights import build_mesh_lights
from framepairs.scene.description import Light, Material, SceneDescription, Slot, Texture
from framepairs.scene.needs import channel_needs

FLOAT32 = 2.0**-23
RAMP = np.linspace(0, 1, 16, dtype=np.float32)


def ramp(along: int) -> Texture:
    """16 x 16 texels of which R is u (along 0) or v (along 1, up) at texel centres; clamped."""
    grid = np.broadcast_to(RAMP[None, :] if along == 0 else RAMP[::-1, None], (16, 16))
    texels = np.stack([grid, grid, grid, np.ones_like(grid)], axis=-1)
    return Texture(name=f"ramp {along}", texels=texels.astype(np.float32), srgb=False, wrap=("clamp", "clamp"))


def facing(**plan) -> dict:
    """A camera 2 above the origin that looks at z = 0 straight on, with the finest texels and taps of no extent."""
    return {"path": path_of(at(0, 0, 2), at(0, 0, 2)), "anisotropy": 1, "mip_bias_offset": -8, **plan}


def seen(scene: SceneDescription, stream: str = "hr", **plan) -> dict[str, np.ndarray]:
    return Stage(scene, **facing(**plan)).arrays(stream=stream)


def place_on_quad(stage: Stage, arrays: dict, jitter=(0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Float64 x and y on the plane z = 0 that the pixels of a frame see."""
    height, width = arrays["depth"].shape[:2]
    x, y = fractions(width, height, jitter)
    _, tan_x, tan_y = camera_basis(stage)
    return (2 * x - 1) * tan_x * 2, (1 - 2 * y) * tan_y * 2


def test_each_slot_reads_its_own_set_of_texture_coordinates():
    mesh = quad(8, 8)
    turned = replace(mesh, uv2=np.stack([1 - mesh.uv[:, 1], mesh.uv[:, 0]], axis=1))  # u2 = 1 - v, v2 = u
    material = Material(
        name="m",
        base_color=(1, 1, 1),
        emission=(1, 1, 1),
        base_texture=Slot(texture=0, uv_set=1),
        emission_texture=Slot(texture=0),
    )
    scene = make_scene((turned, material, at(0, 0, 0)), textures=(ramp(0),))
    stage = Stage(scene, **facing(antialiasing=1))
    arrays = stage.arrays()
    x, y = place_on_quad(stage, arrays)
    u, u2 = (x + 4) / 8, 1 - (y + 4) / 8
    for name, coordinate in (("emission", u), ("albedo", u2)):
        expected = np.clip((coordinate * 16 - 0.5) / 15, 0, 1)
        assert np.abs(arrays[name][..., 0] - expected).max() < 2e-3  # texels are kept in half precision: 2^-11, and weights


def test_a_footprint_of_the_second_set_chooses_its_level():
    """The second set repeats the texture 64 times a unit: its texels are far below the pixel's size, and average to grey."""
    mesh = quad(8, 8)
    board = np.indices((16, 16)).sum(axis=0) % 2
    texels = np.repeat(board[..., None], 4, axis=-1).astype(np.float32)
    texture = Texture(name="board", texels=texels, srgb=False)
    for uv_set, is_gray in ((0, False), (1, True)):
        material = Material(name="m", base_color=(1, 1, 1), base_texture=Slot(texture=0, uv_set=uv_set))
        scene = make_scene((replace(mesh, uv2=mesh.uv * 512), material, at(0, 0, 0)), textures=(texture,))
        albedo = seen(scene, mip_bias_offset=0)["albedo"][..., 0]
        assert (np.abs(albedo - 0.5).max() < 0.01) == is_gray


@pytest.mark.parametrize("target", ["base_color", "emission"])
def test_vertex_colours_multiply_base_colour_or_emission(target):
    mesh = quad(8, 8)
    colors = np.array([[0, 1, 0.5, 1], [1, 1, 0.5, 1], [1, 0, 0.5, 1], [0, 0, 0.5, 1]], np.float32)  # R: x, G: 1 - y
    material = Material(name="m", base_color=(0.5, 1, 1), emission=(2, 2, 2), vertex_colors=target)
    scene = make_scene((replace(mesh, colors=colors), material, at(0, 0, 0)))
    stage = Stage(scene, **facing(antialiasing=1))
    arrays = stage.arrays()
    x, y = place_on_quad(stage, arrays)
    tint = np.stack([(x + 4) / 8, 1 - (y + 4) / 8, np.full_like(x, 0.5)], axis=-1)
    base, emission = np.array([0.5, 1, 1]), np.full(3, 2.0)
    expected = {"albedo": base, "emission": emission}
    expected["albedo" if target == "base_color" else "emission"] = tint * (base if target == "base_color" else emission)
    for name, value in expected.items():
        # the hit's barycentric coordinates err by some tens of roundings of the camera's distance over the quad's size
        assert np.abs(arrays[name] - value).max() < 64 * FLOAT32, name
    assert channel_needs(scene, stage.shoot.samples, stage.plan)["albedo"].needed == (target == "base_color")


def test_alpha_of_vertex_colours_cuts_masks():
    mesh = quad(8, 8)
    colors = np.array([[1, 1, 1, 0], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 0]], np.float32)
    material = Material(name="m", alpha="mask", alpha_cutoff=0.5)
    stage = Stage(make_scene((replace(mesh, colors=colors), material, at(0, 0, 0))), **facing(antialiasing=1))
    arrays = stage.arrays()
    x, _ = place_on_quad(stage, arrays)
    clear = np.abs(x) > 1e-4
    assert np.array_equal((arrays["object_id"][..., 0] > 0)[clear], (x > 0)[clear])


def bumped(tangent: tuple[float, float, float, float] | None, matrix: np.ndarray, uv_set: int = 0) -> np.ndarray:
    """The shading normal of a quad whose map says (0.6, 0, 0.8) everywhere."""
    texel = np.array([0.6, 0.0, 0.8, 1], np.float32)
    texture = Texture(name="bump", texels=np.broadcast_to(texel, (4, 4, 4)).copy(), srgb=False)
    mesh = quad(8, 8)
    mesh = replace(mesh, uv2=np.stack([mesh.uv[:, 1], mesh.uv[:, 0]], axis=1))
    mesh = mesh if tangent is None else replace(mesh, tangents=np.array([tangent] * 4, np.float32))
    material = Material(name="m", normal_texture=Slot(texture=0, uv_set=uv_set))
    normal = seen(make_scene((mesh, material, matrix), textures=(texture,)))["normal"]
    assert np.ptp(normal.reshape(-1, 3), axis=0).max() < 1e-5
    return normal[0, 0]


def test_normal_maps_follow_the_tangents_of_the_mesh_or_of_their_uv():
    half = 1e-3  # the map is kept in half precision
    mirror = np.diag([-1.0, 1, 1, 1])
    assert np.allclose(bumped(None, at(0, 0, 0)), (0.6, 0, 0.8), atol=half)
    assert np.allclose(bumped(None, at(0, 0, 0), uv_set=1), (0, 0.6, 0.8), atol=half)  # u2 grows with y
    assert np.allclose(bumped((0, 1, 0, 1), at(0, 0, 0)), (0, 0.6, 0.8), atol=half)
    assert np.allclose(bumped((0, 1, 0, 1), mirror), (0, 0.6, 0.8), atol=half)
    assert np.allclose(bumped((1, 0, 0, 1), mirror), (-0.6, 0, 0.8), atol=half)
    assert np.allclose(bumped((0, 0, 0, 1), at(0, 0, 0)), (0.6, 0, 0.8), atol=half)  # none: taken from uv


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_bitangent_s_sign_turns_what_a_map_says_about_v(sign, mirrored):
    texel = np.array([0.0, 0.6, 0.8, 1], np.float32)
    texture = Texture(name="bump", texels=np.broadcast_to(texel, (4, 4, 4)).copy(), srgb=False)
    mesh = replace(quad(8, 8), tangents=np.array([(1, 0, 0, sign)] * 4, np.float32))
    scene = make_scene(
        (mesh, Material(name="m", normal_texture=Slot(texture=0)), np.diag([-1.0, 1, 1, 1]) if mirrored else at(0, 0, 0)),
        textures=(texture,),
    )
    assert np.allclose(seen(scene)["normal"][5, 5], (0, 0.6 * sign, 0.8), atol=1e-3)


def turned() -> np.ndarray:
    return np.diag([-1.0, 1, -1, 1])  # half a turn about y: its back to the camera


def test_back_faces_of_single_sided_objects_are_culled_where_the_plan_says_so():
    def ids(matrix: np.ndarray, cull: bool, double_sided: bool) -> set:
        front = Material(name="front")
        scene = make_scene((quad(8, 8), front, matrix), (quad(9, 9), Material(name="behind"), at(0, 0, -1)))
        first = replace(scene.objects[0], double_sided=double_sided)
        scene = replace(scene, objects=(first, scene.objects[1]))
        stage = Stage(scene, **facing(cull_back_faces=cull))
        return {int(value) for value in np.unique(stage.arrays()["object_id"])}

    mirrored = np.diag([1.0, 1, -1, 1]) @ turned()  # mirrors: its front is still on the side of its normals
    assert ids(turned(), False, False) == {1}
    assert ids(turned(), True, False) == {2}
    assert ids(turned(), True, True) == {1}
    assert ids(at(0, 0, 0), True, False) == {1}
    assert ids(mirrored, True, False) == {1}


def test_shadows_of_culled_faces_stay():
    """A light above a single-sided screen that turns its back to the camera: unseen, and dark behind it."""
    light = Light(name="l", kind="directional", radiance=(3, 3, 3), direction=(0, 0, -1))
    scene = make_scene(
        (quad(0.5, 0.5), Material(name="screen"), at(0, 0, 1) @ turned()),
        (quad(9, 9), Material(name="wall", base_color=(1, 1, 1)), at(0, 0, -1)),
        lights=(light,),
    )
    scene = replace(scene, objects=(replace(scene.objects[0], double_sided=False), scene.objects[1]))
    arrays = Stage(scene, **facing(cull_back_faces=True, antialiasing=1)).arrays()
    assert set(np.unique(arrays["object_id"])) == {2}
    middle, corner = arrays["color"][13, 24, 0], arrays["color"][0, 0, 0]
    assert middle == 0 and corner > 0.5


@pytest.mark.parametrize("shading", ["raster", "path"])
def test_what_emits_from_its_front_is_dark_behind_and_lights_one_side(shading):
    """A glowing panel between two walls: the one before its front is lit, the one behind is not."""
    panel = Material(name="panel", base_color=(0, 0, 0), specular=0, emission=(5, 5, 5), emits="front", shines=True)
    wall = Material(name="wall", base_color=(1, 1, 1), specular=0)
    for matrix, is_front in ((at(0, 0, 0), True), (turned(), False)):
        scene = make_scene(
            (quad(0.5, 0.5), panel, matrix), (quad(40, 40), wall, at(0, 0, -1)), (quad(1, 1), wall, at(0, 0, 20) @ turned())
        )
        plan = {"shading": shading, "antialiasing": 1, "samples_per_pixel": 64, "max_depth": 2, "light_samples": 16}
        arrays = Stage(scene, **facing(**plan)).arrays()
        on_panel = arrays["object_id"][..., 0] == 1
        assert (arrays["emission"][on_panel] == (5 if is_front else 0)).all()
        lit = arrays["color"][..., 0][~on_panel]
        assert (lit.max() > 0.05) == (not is_front)
        if is_front:
            assert lit.max() == 0


def test_only_what_shines_is_a_light_in_raster_by_itself():
    glow = Material(name="glow", emission=(1, 1, 1))
    scene = make_scene((quad(1, 1), glow, at(0, 0, 0)), (quad(1, 1), replace(glow, shines=True), at(0, 0, 1)))
    assert build_mesh_lights(scene, wanted=False).objects == (1,)
    assert build_mesh_lights(scene, wanted=True).objects == (0, 1)


@pytest.mark.parametrize("shading", ["raster", "path"])
def test_an_unlit_surface_shows_what_it_emits_and_nothing_else(shading):
    unlit = Material(name="u", base_color=(0, 0, 0), specular=0, metallic=0, emission=(0.25, 0.5, 0.75))
    light = Light(name="l", kind="directional", radiance=(30, 30, 30), direction=(0, 0.6, -0.8))
    scene = make_scene((quad(40, 40), unlit, at(0, 0, 0)), sky=constant_sky((4, 4, 4)), lights=(light,))
    arrays = seen(scene, shading=shading, samples_per_pixel=16)
    assert np.array_equal(arrays["color"], np.broadcast_to(np.float32([0.25, 0.5, 0.75]), arrays["color"].shape))
    assert (arrays["brdf"] == 0).all()


def test_the_plan_s_new_keys_are_off_or_modest_by_default():
    assert plan_of().cull_back_faces is False and plan_of().subdivision == 2
