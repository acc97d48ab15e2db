"""What a scene seen along a path needs: per channel a scene that needs it and one that does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from framepairs.camera_path import CameraSample
from framepairs.channels import CHANNELS
from framepairs.plan import RenderPlan, make_plan, plan_streams
from framepairs.scene.description import Environment, Material, Mesh, SceneDescription, SceneObject, Slot, Texture
from framepairs.scene.needs import channel_needs, equal_streams, table_need
from framepairs.transforms import translation

TRIANGLE = Mesh(name="m", positions=np.eye(3, dtype=np.float32), faces=np.array([[0, 1, 2]], dtype=np.uint32))
BLACK = Environment(name="black", texels=np.zeros((1, 2, 3), np.float32))
SKY = Environment(name="sky", texels=np.ones((1, 2, 3), np.float32))
IMAGE = Texture(name="t", texels=np.zeros((5, 7, 4), np.uint8), srgb=False)
# As the readers pack roughness and metallic: what is not sampled multiplies by 1.
SURFACE = replace(IMAGE, scale=(0, 1, 1, 0), bias=(1, 0, 0, 1))


def scene(*materials, environment=BLACK, moves=False, textures=(IMAGE,)):
    objects = tuple(SceneObject(name=str(k), mesh=0, material=k, moves=moves) for k in range(len(materials)))
    return SceneDescription(
        name="s",
        files=(Path("s.usda"),),
        meshes=(TRIANGLE,),
        materials=materials,
        textures=textures,
        objects=objects,
        lights=(),
        environment=environment,
        up_axis="Y",
        metres_per_unit=1.0,
        world_from_object=lambda time_s: np.tile(np.eye(4), (len(objects), 1, 1)),
    )


def camera(x=0.0, yaw=0.0, fov=0.8, shot=0):
    matrix = translation(np.array([x, 0.0, 0.0]))
    c, s = np.cos(yaw), np.sin(yaw)
    matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    return CameraSample(world_from_camera=matrix, fov_y=fov, shot=shot, scene_time_s=0.0)


def material(**values):
    return Material(name="m", **values)


def needs(*materials, samples=(camera(), camera()), plan=None, **keys):
    return channel_needs(scene(*materials, **keys), samples, plan or RenderPlan())


def test_there_is_one_need_per_channel_in_the_order_of_the_table():
    found = needs(material())
    assert list(found) == [channel.name for channel in CHANNELS]
    assert all(need.channel == name and need.why for name, need in found.items())


def test_constants_have_the_components_of_their_channel():
    components = {channel.name: channel.components for channel in CHANNELS}
    for need in needs(material()).values():
        assert need.needed == (need.constant is None and need.same_as is None)
        assert need.constant is None or len(need.constant) == components[need.channel]


def test_what_every_scene_needs_is_needed_by_an_empty_one():
    found = channel_needs(scene(), [camera()], RenderPlan())
    assert {name for name, need in found.items() if need.needed} == {"color", "normal", "depth", "object_id", "brdf"}


@pytest.mark.parametrize(
    ("channel", "values", "constant"),
    [
        ("albedo", {"base_color": (0.25, 0.5, 0.75)}, (0.25, 0.5, 0.75)),
        ("roughness", {"roughness": 0.3}, (0.3,)),
        ("metallic", {"metallic": 1.0}, (1.0,)),
        ("specular", {"specular": 0.2}, (0.2,)),
        ("roughness", {"roughness": 1.5}, (1.0,)),  # as the G-buffer clips it
    ],
)
def test_one_value_on_all_surfaces_is_a_constant_and_two_are_a_channel(channel, values, constant):
    alone = needs(material(**values), material(**values))[channel]
    assert (alone.needed, alone.constant) == (False, constant)
    assert needs(material(**values), material(base_color=(0, 0, 0), roughness=0.9, metallic=0.5, specular=0.9))[channel].needed


def test_materials_that_no_object_wears_do_not_count():
    described = scene(material(roughness=0.3), material(roughness=0.7))
    described = replace(described, objects=described.objects[:1])
    assert channel_needs(described, [camera()], RenderPlan())["roughness"].constant == (0.3,)


def test_textures_need_the_channels_that_they_vary():
    slot = Slot(texture=0)
    values = ("albedo", "specular", "roughness", "metallic")
    base = needs(material(base_texture=slot))
    assert [name for name in values if base[name].needed] == ["albedo"]
    surface = needs(material(surface_texture=slot, metallic=1.0), textures=(SURFACE,))
    assert [name for name in values if surface[name].needed] == ["roughness", "metallic"]
    # One whose texels do not count may still be another value than 1.
    gray = replace(IMAGE, scale=(0, 0, 0, 1), bias=(0.3, 0.3, 0.3, 0))
    assert needs(material(base_texture=slot), textures=(gray,))["albedo"].needed
    # A factor of 0 leaves a texture nothing to vary.
    dielectric = needs(material(surface_texture=slot, metallic=0.0), textures=(SURFACE,))["metallic"]
    assert (dielectric.needed, dielectric.constant) == (False, (0.0,))


def test_emission_is_needed_by_a_sky_or_an_emitter():
    dark = needs(material())["emission"]
    assert (dark.needed, dark.constant) == (False, (0.0, 0.0, 0.0))
    assert needs(material(), environment=SKY)["emission"].needed
    assert needs(material(emission=(0, 0, 0.1)))["emission"].needed


def test_transparency_is_needed_by_blended_materials_alone():
    assert needs(material(alpha="blend", opacity=0.5))["transparency"].needed
    assert needs(material(alpha="mask", opacity=0.5))["transparency"].constant == (0.0,)


def test_no_scene_has_overlays():
    assert needs(material())["overlay"].constant == (0.0,)


def motion(samples, **keys):
    found = needs(material(), samples=samples, **keys)
    return {name: found[name] for name in ("motion", "dual_motion", "visibility")}


def test_where_nothing_moves_motion_is_constant():
    found = motion([camera()] * 5)
    assert not any(need.needed for need in found.values())
    assert found["motion"].constant == (0.0, 0.0)
    assert found["visibility"].constant == (7,)  # inside, in front and seen
    assert found["dual_motion"].same_as == "motion"


@pytest.mark.parametrize("last", [camera(yaw=0.1), camera(fov=0.7)])
def test_a_camera_that_only_turns_or_zooms_has_one_motion(last):
    found = motion([camera(), last])
    assert found["motion"].needed and found["visibility"].needed
    assert (found["dual_motion"].needed, found["dual_motion"].same_as) == (False, "motion")


def test_an_orthographic_camera_that_turns_has_parallax():
    """Its rays are parallel: what hides what changes with their direction."""
    turning = [replace(camera(), height=2.0), replace(camera(yaw=0.1), height=2.0)]
    assert all(need.needed for need in motion(turning).values())


@pytest.mark.parametrize(("samples", "moves"), [([camera(), camera(x=1e-6)], False), ([camera(), camera()], True)])
def test_a_camera_that_travels_or_an_object_that_moves_needs_all_motion(samples, moves):
    assert all(need.needed for need in motion(samples, moves=moves).values())


def test_the_whole_path_counts():
    assert all(need.needed for need in motion([*[camera()] * 40, camera(x=1)]).values())


def test_a_cut_is_no_motion():
    found = motion([camera(), camera(x=5, shot=1), camera(x=5, shot=1)])
    assert not any(need.needed for need in found.values())


def test_variance_is_of_light_paths():
    assert needs(material())["color_variance"].constant == (0.0, 0.0, 0.0)
    assert needs(material(), plan=RenderPlan(shading="path"))["color_variance"].needed


def test_filtered_normals_make_roughness_vary_unless_the_plan_says_no():
    bumpy = material(normal_texture=Slot(texture=0))
    texture = Texture(name="bumps", texels=np.zeros((2, 2, 4), np.uint8), srgb=False)
    assert needs(bumpy, textures=(texture,))["roughness"].needed
    assert needs(bumpy, textures=(texture,), plan=RenderPlan(normal_variance=False))["roughness"].constant == (0.5,)


def test_vertex_colours_need_albedo_unless_they_are_white_or_colour_light():
    def albedo(color, **values):
        described = scene(material(**values))
        colors = np.tile(np.float32(color), (3, 1))
        described = replace(described, meshes=(replace(TRIANGLE, colors=colors),))
        return channel_needs(described, [camera()], RenderPlan())["albedo"].needed

    assert albedo((1, 0.5, 1, 1))
    assert not albedo((1, 1, 1, 0.5))
    assert not albedo((1, 0.5, 1, 1), vertex_colors="emission")
    assert not albedo((1, 0.5, 1, 1), base_color=(0, 0, 0))


def test_without_textures_a_mip_bias_changes_nothing():
    plan = make_plan({"scales": [2, 3], "variants": ["native", "mip", "jittered", "jittered_mip"]})
    names = {stream.name for stream in plan_streams(plan)}
    twins = equal_streams(scene(material()), plan)
    assert twins == {
        "lr_x2_mip-1": "lr_x2",
        "lr_x2_jittered_mip-1": "lr_x2_jittered",
        "lr_x3_mip-1.585": "lr_x3",
        "lr_x3_jittered_mip-1.585": "lr_x3_jittered",
    }
    assert set(twins) < names
    assert equal_streams(scene(material(base_texture=Slot(texture=0))), plan) == {}
    alone = make_plan({"variants": ["native", "jittered_mip"]})
    assert equal_streams(scene(material()), alone) == {}  # its twin is not among the streams


@pytest.mark.parametrize(
    ("values", "needed"),
    [
        ({"specular": 0.0}, False),
        ({"specular": 0.01}, True),
        ({"specular": 0.0, "metallic": 0.1}, True),
        ({"specular": 0.5, "surface_texture": Slot(texture=0)}, True),
        ({"specular": 0.0, "metallic": 1.0, "surface_texture": Slot(texture=1)}, False),  # its texture leaves no metal
    ],
)
def test_the_table_is_needed_by_specular_surfaces(values, needed):
    without_metal = replace(IMAGE, scale=(1, 1, 0, 0), bias=(0, 0, 0, 1))
    assert table_need(scene(material(**values), textures=(SURFACE, without_metal)), RenderPlan()).needed == needed
