"""glTF's materials and textures, and what of a file is found, hashed, refused or named."""

import base64
import json

import numpy as np
import pytest
import trimesh

from framepairs.errors import InputError
from framepairs.scene import load_scene, scene_hash
from framepairs.scene.images import linear_texels
from usd_stages import image

POSITIONS = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
UV = np.float32([[0, 0], [1, 0], [0, 0.25]])
BUFFER = POSITIONS.tobytes() + UV.tobytes()
TEXTURED = {"name": "t", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
IMAGES = {"images": [{"uri": "t.png"}], "textures": [{"source": 0}]}


def gltf(folder, *materials, name="scene.gltf", **keys):
    """The file of a glTF scene: one triangle per material, node k moved by (10 k, 0, 0) on top of (0, 5, 0)."""
    count = range(len(materials))
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    values = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [len(materials)]}],
        "nodes": [
            *({"mesh": k, "name": f"n{k}", "translation": [10 * k, 0, 0]} for k in count),
            {"name": "root", "children": list(count), "translation": [0, 5, 0]},
        ],
        "meshes": [{"name": f"m{k}", "primitives": [{"attributes": attributes, "material": k}]} for k in count],
        "materials": materials,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": POSITIONS.nbytes},
            {"buffer": 0, "byteOffset": POSITIONS.nbytes, "byteLength": UV.nbytes},
        ],
        "buffers": [{"byteLength": len(BUFFER), "uri": "data:;base64," + base64.b64encode(BUFFER).decode()}],
        **keys,
    }
    file = folder / name
    file.write_text(json.dumps(values))
    return file


def colored(red, **keys):
    return {"pbrMetallicRoughness": {"baseColorFactor": [red, 0.2, 0.3, 0.4]}, **keys}


def worn(scene):
    """Material by the name of the object that wears it."""
    return {item.name: scene.materials[item.material] for item in scene.objects}


def test_triangles_and_transforms_of_gltf(tmp_path):
    scene = load_scene(gltf(tmp_path, {"name": "a"}, {"name": "b"}))
    assert [item.name for item in scene.objects] == ["n0", "n1"] and not scene.moves
    np.testing.assert_array_equal(scene.world_from_object(0.7)[:, :3, 3], [[0, 5, 0], [10, 5, 0]])
    mesh = scene.meshes[0]
    np.testing.assert_array_equal(mesh.positions[mesh.faces[0]], POSITIONS)
    np.testing.assert_array_equal(mesh.uv[mesh.faces[0]], UV * [1, -1] + [0, 1])  # glTF's v runs down, ours up
    assert mesh.normals is None  # glTF: flat shading where there are none
    assert (scene.up_axis, scene.metres_per_unit) == ("Y", 1)


def test_factors_are_exact_and_not_rounded_to_bytes(tmp_path):
    pbr = {"baseColorFactor": [0.1001, 0.2002, 0.3003, 1], "roughnessFactor": 0.1234, "metallicFactor": 0.4321}
    material = load_scene(gltf(tmp_path, {"name": "a", "pbrMetallicRoughness": pbr})).materials[0]
    assert material.base_color == (0.1001, 0.2002, 0.3003)
    assert (material.roughness, material.metallic) == (0.1234, 0.4321)


def test_defaults_are_those_of_the_specification(tmp_path):
    material = load_scene(gltf(tmp_path, {"name": "a"})).materials[0]
    assert (material.base_color, material.roughness, material.metallic) == ((1, 1, 1), 1, 1)
    assert (material.emission, material.alpha, material.specular) == ((0, 0, 0), "opaque", 0.5)


@pytest.mark.parametrize("names", [({}, {}), ({"name": "same"}, {"name": "same"})])
def test_materials_without_names_of_their_own_keep_their_factors(tmp_path, names):
    materials = worn(load_scene(gltf(tmp_path, colored(0.25, **names[0]), colored(0.75, **names[1]))))
    assert [materials[node].base_color[0] for node in ("n0", "n1")] == [0.25, 0.75]


def test_alpha_modes(tmp_path):
    modes = {"alphaMode": "MASK", "alphaCutoff": 0.125}, {"alphaMode": "MASK"}, {"alphaMode": "BLEND"}, {"alphaMode": "OPAQUE"}
    found = worn(load_scene(gltf(tmp_path, *(colored(1, name=str(k), **mode) for k, mode in enumerate(modes)))))
    assert [(m.alpha, m.alpha_cutoff, m.opacity) for m in (found[f"n{k}"] for k in range(4))] == [
        ("mask", 0.125, 0.4),
        ("mask", 0.5, 0.4),
        ("blend", 0.5, 0.4),
        ("opaque", 0.5, 1.0),
    ]


def test_emissive_strength_multiplies(tmp_path):
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
    lamps = {"name": "a", "emissiveFactor": [1, 0.5, 0], "extensions": strong}, {"name": "b", "emissiveFactor": [1, 0.5, 0]}
    scene = load_scene(gltf(tmp_path, *lamps, extensionsUsed=["KHR_materials_emissive_strength"]))
    assert [worn(scene)[node].emission for node in ("n0", "n1")] == [(8, 4, 0), (1, 0.5, 0)]
    assert scene.not_read == ()


def extended(**extensions):
    """A dielectric with extensions."""
    named = {f"KHR_materials_{name}": values for name, values in extensions.items()}
    return {"name": "a", "pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": named}


@pytest.mark.parametrize(
    ("extensions", "specular", "says"),
    [
        ({}, 0.5, ()),
        ({"ior": {"ior": 1.5}}, 0.5, ()),
        ({"ior": {"ior": 1.33}}, (0.33 / 2.33) ** 2 / 0.08, ()),
        ({"ior": {"ior": 1}}, 0, ()),
        ({"ior": {"ior": 2}}, 1, ("ior 2: F0 is 0.08, not 0.111",)),  # (1 / 3)^2
        ({"ior": {"ior": 0}}, 1, ("ior 0: F0 is 0.08, not 1",)),
        ({"specular": {}}, 0.5, ()),
        ({"specular": {"specularFactor": 0}}, 0, ()),
        (
            {"specular": {"specularFactor": 0.25}},
            0.125,
            ("specularFactor 0.25 at grazing angles: reflectance is 0.5 there",),
        ),
        ({"specular": {"specularFactor": 0.5}, "ior": {"ior": 2}}, 1 / 18 / 0.08, ("specularFactor 0.5 at grazing",)),
        ({"specular": {"specularColorFactor": [1, 0.5, 0]}}, 0.5, ("specularColorFactor (1, 0.5, 0)",)),
        ({"specular": {"specularTexture": {"index": 0}}}, 0.5, ("specularTexture of KHR_materials_specular",)),
    ],
)
def test_ior_and_specular_factor_become_specular(tmp_path, extensions, specular, says):
    material = load_scene(gltf(tmp_path, extended(**extensions))).materials[0]
    assert material.specular == pytest.approx(specular, abs=1e-12)
    assert len(material.not_read) == len(says)
    assert all(found.startswith(expected) for found, expected in zip(material.not_read, says, strict=True))


def test_an_ior_of_metal_says_nothing(tmp_path):
    metal = extended(ior={"ior": 2}, specular={"specularFactor": 0.5})
    metal["pbrMetallicRoughness"] = {"metallicFactor": 1}
    material = load_scene(gltf(tmp_path, metal)).materials[0]
    assert (material.specular, material.not_read) == (0.5, ())


def test_an_ior_below_0_names_the_material(tmp_path):
    file = gltf(tmp_path, extended(ior={"ior": -1}))
    with pytest.raises(InputError, match=f"^{file}, a: index of refraction -1"):
        load_scene(file)


@pytest.mark.parametrize(
    ("name", "acting", "neutral", "says"),
    [
        ("clearcoat", {"clearcoatFactor": 0.5}, {"clearcoatFactor": 0}, "clearcoat 0.5"),
        ("sheen", {"sheenColorFactor": [0, 0.5, 0]}, {"sheenRoughnessFactor": 1}, "sheen (0, 0.5, 0)"),
        ("transmission", {"transmissionFactor": 1}, {}, "transmission 1"),
        ("volume", {"thicknessFactor": 2}, {"attenuationDistance": 1}, "volume 2"),
        ("iridescence", {"iridescenceFactor": 1}, {"iridescenceIor": 2}, "iridescence 1"),
        ("anisotropy", {"anisotropyStrength": 0.25}, {"anisotropyRotation": 1}, "anisotropy 0.25"),
        ("dispersion", {"dispersion": 0.1}, {"dispersion": 0}, "dispersion 0.1"),
        ("diffuse_transmission", {"diffuseTransmissionFactor": 0.5}, {}, "diffuse_transmission 0.5"),
        ("of_tomorrow", {}, None, "extension KHR_materials_of_tomorrow"),
    ],
)
def test_extensions_of_a_material_are_named_where_they_act(tmp_path, name, acting, neutral, says):
    used = [f"KHR_materials_{name}"]
    scene = load_scene(gltf(tmp_path, extended(**{name: acting}), extensionsUsed=used))
    assert (scene.materials[0].not_read, scene.not_read) == ((says,), ())
    if neutral is not None:
        scene = load_scene(gltf(tmp_path, extended(**{name: neutral}), extensionsUsed=used))
        assert (scene.materials[0].not_read, scene.not_read) == ((), ())


def unlit(**keys):
    return {"name": "u", "extensions": {"KHR_materials_unlit": {}}, **keys}


def test_unlit_materials_emit_their_base_colour_and_reflect_nothing(tmp_path):
    codes = image(tmp_path / "t.png", channels=4) / 255
    pbr = {"baseColorFactor": [0.5, 0.25, 1, 0.75], "baseColorTexture": {"index": 0, "texCoord": 1}, "metallicFactor": 1}
    ignored = {"normalTexture": {"index": 0}, "occlusionTexture": {"index": 0}, "emissiveFactor": [9, 9, 9]}
    modes = {}, {"alphaMode": "MASK", "alphaCutoff": 0.25}, {"alphaMode": "BLEND"}
    scene = load_scene(gltf(tmp_path, *(unlit(pbrMetallicRoughness=pbr, **ignored, **mode) for mode in modes), **IMAGES))
    for material, alpha in zip(scene.materials, ("opaque", "mask", "blend"), strict=True):
        assert (material.base_color, material.specular, material.metallic) == ((0, 0, 0), 0, 0)
        assert (material.emission, material.vertex_colors, material.not_read) == ((0.5, 0.25, 1), "emission", ())
        assert material.normal_texture is None and material.surface_texture is None
        texture = scene.textures[material.emission_texture.texture]
        np.testing.assert_array_equal(texture.texels / 255, codes)
        assert texture.srgb and material.emission_texture.uv_set == 0  # its only set is the mesh's first
        assert (material.alpha, material.opacity) == (alpha, 1 if alpha == "opaque" else 0.75)
        assert material.base_texture == (None if alpha == "opaque" else material.emission_texture)
    assert scene.materials[1].alpha_cutoff == 0.25
    assert scene.not_read == tuple(f"textures of n{k} by TEXCOORD_1, which its mesh lacks" for k in range(3))


def test_an_unlit_material_without_values_is_white(tmp_path):
    material = load_scene(gltf(tmp_path, unlit())).materials[0]
    assert (material.emission, material.emission_texture) == ((1, 1, 1), None)


def test_double_sided_materials(tmp_path):
    scene = load_scene(gltf(tmp_path, {"doubleSided": True}, {"doubleSided": False}, {}))
    assert [item.double_sided for item in scene.objects] == [True, False, False]


def test_specular_glossiness_alone_gives_its_nearest_values(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    values = {"diffuseFactor": [0.5, 0.25, 1, 0.75], "glossinessFactor": 0.75, "diffuseTexture": {"index": 0}}
    only = {"name": "a", "extensions": {"KHR_materials_pbrSpecularGlossiness": values}}
    scene = load_scene(gltf(tmp_path, only, **IMAGES))
    material = scene.materials[0]
    assert (material.base_color, material.roughness, material.metallic) == ((0.5, 0.25, 1), 0.25, 0)
    assert material.not_read == ("pbrSpecularGlossiness: its metallic-roughness values are drawn",)
    np.testing.assert_array_equal(scene.textures[material.base_texture.texture].texels[..., :3] / 255, codes)
    both = {**only, "pbrMetallicRoughness": {"roughnessFactor": 0.125, "metallicFactor": 1}}
    material = load_scene(gltf(tmp_path, both, **IMAGES)).materials[0]
    assert (material.base_color, material.roughness, material.metallic) == ((1, 1, 1), 0.125, 1)


def test_texture_transforms_turn_the_uv_of_their_texture(tmp_path):
    image(tmp_path / "t.png")
    transform = {"offset": [0.25, 0.5], "rotation": np.pi / 2, "scale": [2, 3]}
    moved = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    pbr = {"baseColorTexture": moved, "metallicRoughnessTexture": {"index": 0}}
    material = load_scene(gltf(tmp_path, {"name": "t", "pbrMetallicRoughness": pbr}, **IMAGES)).materials[0]
    # glTF's uv, v down: scaled, turned by 90 degrees counter-clockwise on the image ((1, 0) goes up to (0, -1), (0, 1) to
    # (1, 0)), then shifted. (u, v) -> (2 u, 3 v) -> (3 v, -2 u) -> (3 v + 0.25, 0.5 - 2 u).
    for u, v in ((0, 0), (1, 0), (0, 1), (0.3, 0.8)):
        expected = 3 * v + 0.25, 1 - (0.5 - 2 * u)
        np.testing.assert_allclose(np.array(material.base_texture.uv) @ [u, 1 - v, 1], expected, atol=1e-15 * 16)
    assert material.surface_texture.uv == ((1, 0, 0), (0, 1, 0)) and material.not_read == ()


def test_an_offset_alone_moves_the_image(tmp_path):
    image(tmp_path / "t.png")
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.25, 0.125]}}}
    material = load_scene(gltf(tmp_path, {"name": "t", "emissiveTexture": moved}, **IMAGES)).materials[0]
    assert material.emission_texture.uv == ((1, 0, 0.25), (0, 1, -0.125))


def test_an_occlusion_map_of_strength_0_is_not_named(tmp_path):
    image(tmp_path / "t.png")
    for strength, says in ((0, ()), (0.5, ("occlusion map",))):
        material = {"name": "t", "occlusionTexture": {"index": 0, "strength": strength}}
        assert load_scene(gltf(tmp_path, material, **IMAGES)).materials[0].not_read == says


def test_extensions_that_a_file_may_require(tmp_path):
    known = ["KHR_texture_transform", "KHR_materials_clearcoat", "KHR_materials_unlit", "KHR_lights_punctual"]
    known += ["KHR_materials_variants", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "EXT_texture_webp"]
    assert load_scene(gltf(tmp_path, {"name": "a"}, extensionsRequired=known)).objects


@pytest.mark.parametrize(
    "name",
    [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_texture_basisu",
        "EXT_texture_avif",
        "KHR_animation_pointer",
        "KHR_node_visibility",
        "EXT_of_tomorrow",
    ],
)
def test_other_extensions_that_a_file_requires_are_refused(tmp_path, name):
    file = gltf(tmp_path, {"name": "a"}, extensionsRequired=["KHR_texture_transform", name])
    with pytest.raises(InputError, match=f"^{file}: extension {name} is not read, and the file requires it$"):
        load_scene(file)


def test_extensions_that_a_file_uses_may_stand_beside_plain_data(tmp_path):
    image(tmp_path / "t.png")
    names = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu"]
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0, "extensions": {names[0]: {"bufferView": 0}}}
    textures = [{"source": 0, "extensions": {names[2]: {"source": 1}}}]
    images = [{"uri": "t.png"}, {"uri": "nowhere.ktx2"}]
    file = gltf(
        tmp_path, TEXTURED, extensionsUsed=names, textures=textures, images=images, meshes=[{"primitives": [primitive]}]
    )
    values = json.loads(file.read_text())
    values["bufferViews"][0]["extensions"] = {names[1]: {"buffer": 1}}
    file.write_text(json.dumps(values))
    scene = load_scene(file)
    assert len(scene.textures) == 1 and scene.not_read == tuple(f"extension {name}" for name in names)


def test_data_that_an_extension_alone_holds_is_refused_by_its_name(tmp_path):
    accessors = [{"componentType": 5126, "count": 3, "type": "VEC3"}]
    primitive = {"attributes": {"POSITION": 0}, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}}}
    packed = {"EXT_meshopt_compression": {"buffer": 0}}
    image(tmp_path / "t.png")
    cases = {
        "KHR_draco_mesh_compression": {"accessors": accessors, "meshes": [{"primitives": [primitive]}]},
        "EXT_meshopt_compression": {
            "bufferViews": [{"buffer": 1, "byteLength": 36, "extensions": packed}, {"buffer": 0, "byteLength": 24}],
            "buffers": [{"byteLength": 0, "uri": "data:;base64,"}, {"byteLength": 36}],
        },
        "KHR_texture_basisu": {**IMAGES, "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]},
        "EXT_texture_avif": {**IMAGES, "textures": [{"extensions": {"EXT_texture_avif": {"source": 0}}}]},
        "MSFT_texture_dds": {**IMAGES, "textures": [{"extensions": {"MSFT_texture_dds": {"source": 0}}}]},
    }
    for name, keys in cases.items():
        file = gltf(tmp_path, TEXTURED, extensionsUsed=[name], **keys)
        with pytest.raises(InputError, match=f"^{file}, .*: extension {name} is not read, and .* has no other"):
            load_scene(file)


def test_what_meshes_hold_beyond_triangles_is_named(tmp_path):
    plain = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
    bare = {**plain, "attributes": {"TEXCOORD_0": 1}}
    colors = {**plain, "attributes": {**plain["attributes"], "COLOR_1": 0, "COLOR_2": 0}}
    morphing = {**plain, "targets": [{"POSITION": 0, "COLOR_0": 0}, {"TEXCOORD_0": 1}]}
    meshes = [{"name": "m", "primitives": [colors, morphing, {**plain, "mode": 1}, bare]}]
    scene = load_scene(gltf(tmp_path, {"name": "a"}, meshes=meshes))
    assert scene.not_read == (
        "lines or points of mesh m",
        "primitives without positions of mesh m",
        "vertex colours COLOR_1 of mesh m: COLOR_0 is drawn",
        "vertex colours COLOR_2 of mesh m: COLOR_0 is drawn",
        "morph targets of COLOR_0 of mesh m",
        "morph targets of TEXCOORD_0 of mesh m",
    )
    assert [item.name for item in scene.objects] == ["n0/0", "n0/1"]


def test_third_party_files_say_what_is_not_drawn(assets):
    said = {m.name: m.not_read for m in load_scene(assets / "FlightHelmet" / "FlightHelmet.gltf").materials}
    assert len(said) == 6 and set(said.values()) == {("occlusion map",)}
    room = load_scene(assets / "BreakfastRoom" / "BreakfastRoom.gltf")  # its KHR_materials_specular is glTF's default
    assert room.not_read == ("extension MSFT_texture_dds",) and {m.specular for m in room.materials} == {0.5}


def test_textures_and_their_channels(tmp_path):
    codes = image(tmp_path / "t.png") / 255
    first = {"index": 0}
    pbr = {"baseColorTexture": first, "metallicRoughnessTexture": first}
    maps = {"normalTexture": {"index": 0, "scale": 0.5}, "occlusionTexture": first, "emissiveTexture": first}
    scene = load_scene(gltf(tmp_path, {"name": "t", "pbrMetallicRoughness": pbr, **maps}, **IMAGES))
    material = scene.materials[0]
    textures = [scene.textures[slot.texture] for slot in (material.base_texture, material.emission_texture)]
    assert [texture.srgb for texture in textures] == [True, True]
    surface, normal = (linear_texels(scene.textures[s.texture]) for s in (material.surface_texture, material.normal_texture))
    np.testing.assert_allclose(surface[..., 1:3], codes[..., 1:], rtol=2.0**-22)
    assert (surface[..., 0] == 1).all()
    np.testing.assert_allclose(normal[..., :3], 2 * codes - 1, atol=2.0**-22)
    assert material.normal_scale == 0.5 and material.not_read == ("occlusion map",)


def test_samplers_set_the_wrap_modes(tmp_path):
    image(tmp_path / "t.png")
    keys = {**IMAGES, "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33648}]}
    assert load_scene(gltf(tmp_path, TEXTURED, **keys)).textures[0].wrap == ("clamp", "mirror")
    assert load_scene(gltf(tmp_path, TEXTURED, **IMAGES)).textures[0].wrap == ("repeat", "repeat")


def test_the_hash_follows_images_and_buffers(tmp_path):
    image(tmp_path / "t.png")
    (tmp_path / "b.bin").write_bytes(BUFFER)
    file = gltf(tmp_path, TEXTURED, **IMAGES, buffers=[{"byteLength": len(BUFFER), "uri": "b.bin"}])
    scene = load_scene(file)
    assert {item.name for item in scene.files} == {"scene.gltf", "t.png", "b.bin"} and scene.files[0] == file
    first = scene_hash(scene)
    image(tmp_path / "t.png", seed=2)
    second = scene_hash(load_scene(file))
    (tmp_path / "b.bin").write_bytes(BUFFER + b"\0")
    assert len({first, second, scene_hash(load_scene(file))}) == 3


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({**IMAGES, "images": [{"uri": "nowhere.png"}]}, "images: missing texture nowhere.png"),
        ({"buffers": [{"byteLength": 60, "uri": "nowhere.bin"}]}, "buffers: missing buffer nowhere.bin"),
        ({**IMAGES, "images": [{"uri": "broken.png"}]}, "broken.png"),
        ({"textures": []}, "texture"),
        ({"meshes": []}, ""),
    ],
)
def test_what_a_gltf_file_lacks_is_named(tmp_path, keys, says):
    (tmp_path / "broken.png").write_bytes(b"no image")
    file = gltf(tmp_path, TEXTURED, **keys)
    with pytest.raises(InputError, match=f"{says}" if says == "broken.png" else f"^{file}[:,] .*{says}"):
        load_scene(file)


def test_what_is_not_read_of_gltf_is_named(tmp_path):
    clips = [{"name": name, "channels": [], "samplers": []} for name in ("walk", "run")]
    scenes = [{"nodes": [1]}, {"name": "other", "nodes": [0]}]
    used = ["KHR_animation_pointer", "KHR_materials_variants", "KHR_lights_punctual", "KHR_materials_unlit"]
    keys = {"extensionsUsed": used, "animations": clips, "scenes": scenes}
    scene = load_scene(gltf(tmp_path, {"name": "a"}, **keys))
    unread = "extension KHR_animation_pointer", "extension KHR_materials_variants"
    told = *unread, "scene other: scene 0 is drawn", "animation run: walk is played"
    assert scene.not_read == told


def test_a_primitive_without_material_wears_gltf_s_default(tmp_path):
    meshes = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    material = worn(load_scene(gltf(tmp_path, {"name": "a"}, meshes=meshes)))["n0"]
    assert (material.name, material.base_color, material.roughness, material.metallic) == ("default", (1, 1, 1), 1, 1)


@pytest.mark.parametrize("kept", [0, 3, 10, 19, 20, 100, -5])
def test_cut_glb_files_are_named(tmp_path, kept):
    file = tmp_path / "a.glb"
    trimesh.creation.box().export(file)
    assert len(load_scene(file).meshes[0].faces) == 12
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(InputError, match=f"^{file}: "):
        load_scene(file)


@pytest.mark.parametrize("data", [b"{", b"[]", b"\xff\xfe", b""])
def test_what_is_no_gltf_is_named(tmp_path, data):
    file = tmp_path / "a.gltf"
    file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: "):
        load_scene(file)


def test_a_clip_of_a_file_without_animations_is_named(tmp_path):
    with pytest.raises(InputError, match="animations: no animation 'walk'; there are: none"):
        load_scene(gltf(tmp_path, {"name": "a"}), "walk")
