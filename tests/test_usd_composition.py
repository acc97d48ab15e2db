"""USD composition: what a stage is put together from, and which files it may be put together from."""

import os
import struct
import zipfile

import numpy as np
import pytest
from pxr import Sdf

from framepairs.errors import InputError
from framepairs.scene import load_scene
from usd_stages import QUAD, load, placed, prim, triangles, usd

FLAT = 'uniform token subdivisionScheme = "none"'
MESH = prim("Mesh", "m", QUAD, FLAT)
UP = placed("double3 xformOp:translate", "(0, 0, 5)")


def names(scene):
    return [item.name for item in scene.objects]


def heights(scene, seconds=0.0):
    return scene.world_from_object(seconds)[:, 2, 3].tolist()


def part(folder, *prims, name="part.usda", header='defaultPrim = "part"'):
    return usd(folder, *prims, header=header, name=name)


def test_sublayers_are_stacked_and_the_stronger_wins(tmp_path):
    part(tmp_path, prim("Mesh", "m", QUAD, FLAT, *UP), header="", name="weak.usda")
    over = 'over "m"\n{\ndouble3 xformOp:translate = (0, 0, 7)\n}\n'
    scene = load(tmp_path, over, header="subLayers = [@./weak.usda@]")
    assert names(scene) == ["/m"] and heights(scene) == [7]
    assert [file.name for file in scene.files] == ["scene.usda", "weak.usda"]


@pytest.mark.parametrize("kind", ["references", "payload"])
def test_references_and_payloads_are_drawn_where_they_are_named(tmp_path, kind):
    part(tmp_path, prim("Xform", "part", prim("Mesh", "m", QUAD, FLAT, *UP)))
    scene = load(tmp_path, prim("Xform", "a", *UP, metadata=f"{kind} = @part.usda@"))
    assert names(scene) == ["/a/m"] and heights(scene) == [10]


def test_the_chosen_variant_is_drawn(tmp_path):
    sizes = (
        '"size" = {\n"big" {\n'
        + prim("Mesh", "big", QUAD, FLAT)
        + '}\n"small" {\n'
        + prim("Mesh", "small", QUAD, FLAT)
        + "}\n}"
    )
    chosen = 'variants = { string size = "small" }\nprepend variantSets = "size"'
    scene = load(tmp_path, prim("Xform", "a", f"variantSet {sizes}", metadata=chosen))
    assert names(scene) == ["/a/small"]


@pytest.mark.parametrize("kind", ["inherits", "specializes"])
def test_classes_are_drawn_where_they_are_taken_up_alone(tmp_path, kind):
    base = prim("Xform", "_base", MESH).replace("def Xform", "class Xform", 1)
    scene = load(tmp_path, base, prim("Xform", "a", *UP, metadata=f"{kind} = </_base>"))
    assert names(scene) == ["/a/m"] and heights(scene) == [5]


def test_instances_inside_instances(tmp_path):
    leaf = prim("Xform", "_leaf", prim("Mesh", "m", QUAD, FLAT)).replace("def Xform", "class Xform", 1)
    shares = "instanceable = true\nreferences = </{}>"
    leaves = [
        prim("Xform", f"l{k}", *placed("double3 xformOp:translate", f"(0, 0, {k})"), metadata=shares.format("_leaf"))
        for k in (0, 1)
    ]
    tree = prim("Xform", "_tree", *leaves).replace("def Xform", "class Xform", 1)
    trees = [
        prim("Xform", f"t{k}", *placed("double3 xformOp:translate", f"(0, 0, {10 * k})"), metadata=shares.format("_tree"))
        for k in (0, 1)
    ]
    scene = load(tmp_path, leaf, tree, *trees)
    assert names(scene) == ["/t0/l0/m", "/t0/l1/m", "/t1/l0/m", "/t1/l1/m"]
    assert heights(scene) == [0, 1, 10, 11] and {item.mesh for item in scene.objects} == {0}


def test_instances_keep_the_colours_that_they_inherit(tmp_path):
    leaf = prim("Xform", "_leaf", prim("Mesh", "m", QUAD, FLAT)).replace("def Xform", "class Xform", 1)
    shares = "instanceable = true\nreferences = </_leaf>"
    tints = ((1, 0, 0), (0, 1, 0), (1, 0, 0))
    trees = [
        prim("Xform", f"t{k}", f"color3f[] primvars:displayColor = [{tint}]", metadata=shares) for k, tint in enumerate(tints)
    ]
    scene = load(tmp_path, leaf, *trees)
    found = [scene.meshes[item.mesh].colors[0].tolist() for item in scene.objects]
    assert found == [[*tint, 1] for tint in tints]


def test_what_is_inactive_or_only_an_over_is_not_drawn(tmp_path):
    scene = load(
        tmp_path,
        prim("Mesh", "off", QUAD, FLAT, metadata="active = false"),
        prim("Mesh", "over", QUAD, FLAT).replace("def Mesh", "over Mesh"),
        prim("Mesh", "on", QUAD, FLAT),
    )
    assert names(scene) == ["/on"]


def test_proxies_and_guides_are_left_to_the_viewport(tmp_path):
    purposes = [prim("Mesh", name, QUAD, FLAT, f'uniform token purpose = "{name}"') for name in ("guide", "proxy", "render")]
    assert names(load(tmp_path, *purposes, MESH)) == ["/render", "/m"]


def test_layer_offsets_move_and_stretch_time(tmp_path):
    """The referenced layer counts 24 codes a second, the scene 10: USD maps a second to a second, then doubles and delays."""
    moving = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (0, 0, 8) }"
    mesh = prim("Mesh", "m", QUAD, FLAT, moving, 'uniform token[] xformOpOrder = ["xformOp:translate"]')
    part(tmp_path, prim("Xform", "part", mesh), header='defaultPrim = "part"\ntimeCodesPerSecond = 24')
    scene = load(
        tmp_path,
        prim("Xform", "a", metadata="references = @part.usda@ (offset = 5; scale = 2)"),
        header="timeCodesPerSecond = 10",
    )
    assert [heights(scene, t)[0] for t in (0.5, 1.0, 1.5, 2.5, 9.0)] == pytest.approx([0, 2, 4, 8, 8], abs=1e-12)


def test_relocated_prims_have_their_new_path(tmp_path):
    part(tmp_path, prim("Xform", "part", prim("Xform", "old", MESH)))
    header = "relocates = { </a/old>: </a/new> }"
    scene = load(tmp_path, prim("Xform", "a", metadata="references = @part.usda@"), header=header)
    assert names(scene) == ["/a/new/m"]


@pytest.mark.parametrize("name", ["references", "payload", "subLayers"])
def test_missing_layers_are_one_error(tmp_path, name):
    file = usd(tmp_path, header="subLayers = [@./gone.usda@]") if name == "subLayers" else None
    file = file or usd(tmp_path, prim("Xform", "a", metadata=f"{name} = @./gone.usda@"))
    with pytest.raises(InputError, match=f"^{file}: .*gone.usda"):
        load_scene(file)


@pytest.mark.parametrize("name", ["references", "subLayers"])
def test_layers_that_name_themselves_are_one_error(tmp_path, name):
    if name == "references":
        part(tmp_path, prim("Xform", "part", metadata="references = @scene.usda@</a>"))
        file = usd(tmp_path, prim("Xform", "a", metadata="references = @part.usda@"))
    else:
        part(tmp_path, header="subLayers = [@scene.usda@]")
        file = usd(tmp_path, MESH, header="subLayers = [@part.usda@]")
    with pytest.raises(InputError, match=f"^{file}: does not compose: .*[Cc]ycle"):
        load_scene(file)


def naming(how, asset):
    """A stage whose layer names `asset` in one of the ways in which layers name each other."""
    variant = f'variantSet "v" = {{\n"no" (references = @{asset}@) {{\n}}\n"yes" {{\n}}\n}}'
    clips = f'clips = {{ dictionary default = {{ asset[] assetPaths = [@{asset}@]\nstring primPath = "/part" }} }}'
    template = f'clips = {{ dictionary default = {{ string templateAssetPath = "{asset}"\nstring primPath = "/part" }} }}'
    return {
        "reference": (prim("Xform", "a", metadata=f"references = @{asset}@"), ""),
        "payload": (prim("Xform", "a", metadata=f"payload = @{asset}@"), ""),
        "sublayer": (MESH, f"subLayers = [@{asset}@]"),
        "variant": (prim("Xform", "a", variant, metadata='variants = { string v = "yes" }\nprepend variantSets = "v"'), ""),
        "clip": (prim("Xform", "a", metadata=clips), ""),
        "template": (prim("Xform", "a", metadata=template), ""),
    }[how]


HOW = ["reference", "payload", "sublayer", "variant", "clip", "template"]


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("route", ["up", "absolute", "link", "nested"])
def test_layers_outside_the_folder_are_refused_before_they_are_opened(tmp_path, monkeypatch, how, route):
    inside = tmp_path / "inside"
    inside.mkdir()
    outside = part(tmp_path, prim("Xform", "part", MESH), name="out.1.usda")
    if route == "link":
        (inside / "in.1.usda").symlink_to(outside)
    asset = {"up": "../out.1.usda", "absolute": str(outside), "link": "./in.1.usda", "nested": "../out.1.usda"}[route]
    asset = asset.replace(".1.", ".#.") if how == "template" else asset
    text, header = naming(how, asset)
    if route == "nested":
        usd(inside, text, header=header, name="middle.usda")
        text, header = MESH, "subLayers = [@./middle.usda@]"
    opened, find = [], Sdf.Layer.FindOrOpen
    monkeypatch.setattr(Sdf.Layer, "FindOrOpen", lambda path: opened.append(str(path)) or find(path))
    file = usd(inside, text, header=header)
    with pytest.raises(InputError, match=r"lies outside the scene's folder \(--allow-outside reads it\)"):
        load_scene(file)
    assert Sdf.Layer.Find(str(outside)) is None and not any(str(outside) in item for item in opened)
    if how not in ("clip", "template"):
        load_scene(file, allow_outside=True)


@pytest.mark.parametrize("how", HOW)
def test_layers_inside_the_folder_are_read(tmp_path, how):
    (tmp_path / "sub").mkdir()
    part(tmp_path / "sub", prim("Xform", "part", MESH), name="in.1.usda")
    asset = "./sub/in.#.usda" if how == "template" else "./sub/../sub/in.1.usda"
    text, header = naming(how, asset)
    load(tmp_path, text, header=header)


def test_paths_that_are_computed_are_not_followed(tmp_path):
    with pytest.raises(InputError, match="is an expression"):
        load(tmp_path, MESH, header='subLayers = [@`"../${NAME}.usda"`@]')


def packaged(folder, layers, **keys):
    """A .usdz of text layers, (name, text) each, the first one its root."""
    file = folder / "pack.usdz"
    with zipfile.ZipFile(file, "w", keys.get("compression", zipfile.ZIP_STORED)) as package:
        for name, text in layers:
            package.writestr(name, text)
    return file


STAGE = "#usda 1.0\n(\n{}\n)\n{}"


def test_a_package_is_read_and_its_layers_find_each_other(tmp_path):
    layers = [("root.usda", STAGE.format("subLayers = [@./more/a.usda@]", "")), ("more/a.usda", STAGE.format("", MESH))]
    assert names(load_scene(packaged(tmp_path, layers))) == ["/m"]
    assert names(load(tmp_path, header="subLayers = [@./pack.usdz@]")) == ["/m"]


@pytest.mark.parametrize("asset", ["../out.usda", "{}/out.usda", "out.usda"])
def test_layers_in_a_package_do_not_leave_it(tmp_path, monkeypatch, asset):
    outside = part(tmp_path, prim("Xform", "part", MESH), name="out.usda")
    monkeypatch.chdir(tmp_path)  # where the resolver looks for what it does not find
    inside = tmp_path / "inside"
    inside.mkdir()
    file = packaged(inside, [("root.usda", STAGE.format(f"subLayers = [@{asset.format(tmp_path)}@]", MESH))])
    with pytest.raises(InputError, match=f"^{file}: .*out.usda"):
        load_scene(file)
    assert Sdf.Layer.Find(str(outside)) is None


def test_layers_in_a_package_do_not_see_what_lies_beside_it(tmp_path, monkeypatch):
    part(tmp_path, prim("Xform", "part", MESH), name="out.usda")
    monkeypatch.chdir(tmp_path)
    file = packaged(tmp_path, [("root.usda", STAGE.format("subLayers = [@out.usda@]", MESH))])
    with pytest.raises(InputError, match=f"^{file}: out.usda lies outside its package"):
        load_scene(file)


@pytest.mark.parametrize("there", [False, True])
def test_what_lies_outside_is_not_told(tmp_path, there):
    inside = tmp_path / "inside"
    inside.mkdir()
    if there:
        part(tmp_path, MESH, name="out.usda")
    with pytest.raises(InputError, match="scene.usda: .*out.usda lies outside"):
        load(inside, header="subLayers = [@../out.usda@]")


def test_a_file_that_has_changed_is_read_anew(tmp_path):
    """Also while the scene of its first version is still in use."""
    first = load(tmp_path, MESH)
    file = usd(tmp_path, prim("Mesh", "other", QUAD, FLAT))
    os.utime(file, ns=(0, first.files[0].stat().st_mtime_ns + 10**10))
    assert names(load_scene(file)) == ["/other"]


def damaged(folder, kind):
    text = STAGE.format("", MESH)
    if kind == "empty":
        return packaged(folder, [("readme.txt", "nothing")])
    if kind == "compressed":
        return packaged(folder, [("root.usda", text * 9)], compression=zipfile.ZIP_DEFLATED)
    if kind == "leaving":
        return packaged(folder, [("root.usda", text), ("../../evil.usda", text)])
    file = packaged(folder, [("root.usda", text), ("other.usda", text)])
    data = bytearray(file.read_bytes())
    if kind == "truncated":
        data = data[: len(data) // 2]
    elif kind == "no zip":
        data = bytearray(b"PK\3\4" + bytes(100))
    else:
        entry = data.index(b"PK\1\2", data.index(b"PK\1\2") + 1)  # the second entry of the central directory
        size, offset = struct.unpack_from("<I", data, entry + 24)[0], 0
        if kind == "absurd":
            size = 2**31
        else:
            offset = 0
        struct.pack_into("<II", data, entry + 20, size, size)
        struct.pack_into("<I", data, entry + 42, offset)
    file.write_bytes(data)
    return file


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("compressed", "root.usda is compressed"), ("leaving", "leaves the package"), ("truncated", "not a .usdz package"),
        ("no zip", "not a .usdz package"), ("absurd", "overlaps"), ("overlapping", "overlaps"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("named", [False, True])
def test_damaged_packages_are_one_error(tmp_path, kind, says, named):
    file = damaged(tmp_path, kind)
    scene = usd(tmp_path, header="subLayers = [@./pack.usdz@]") if named else file
    with pytest.raises(InputError, match=f"^{file}: .*{says}"):
        load_scene(scene)


def test_packages_without_a_layer_are_one_error(tmp_path):
    file = damaged(tmp_path, "empty")
    with pytest.raises(InputError, match=f"^{file}: not a USD stage"):
        load_scene(file)


def test_warnings_of_usd_stay_off_the_terminal(tmp_path, capfd):
    part(tmp_path, MESH, header="")
    with pytest.raises(InputError, match="does not compose: Invalid sublayer offset"):
        load(tmp_path, header="subLayers = [@part.usda@ (scale = -1)]")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "header", ["timeCodesPerSecond = 0", "timeCodesPerSecond = nan", "metersPerUnit = 0", "metersPerUnit = -1"]
)
def test_units_that_are_none_are_one_error(tmp_path, header):
    with pytest.raises(InputError, match=f"scene.usda, {header.split()[0]}: "):
        load(tmp_path, MESH, header=header)


def test_heights_and_units_come_from_the_root_layer(tmp_path):
    part(tmp_path, prim("Xform", "part", MESH), header='defaultPrim = "part"\nupAxis = "Y"\nmetersPerUnit = 1')
    scene = load(tmp_path, prim("Xform", "a", metadata="references = @part.usda@"), header='upAxis = "Z"\nmetersPerUnit = 0.5')
    assert (scene.up_axis, scene.metres_per_unit) == ("Z", 0.5)
    np.testing.assert_array_equal(scene.world_from_object(0.0)[0], np.eye(4))


MOVES = """double3 xformOp:translate.timeSamples = {{ {a}: (0, 0, 0), {b}: (8, 0, 0) }}
uniform token[] xformOpOrder = ["xformOp:translate"]"""


@pytest.mark.parametrize(("start", "end", "length"), [(1001, 1049, 2.0), (0, 24, 1.0), (-24, 24, 2.0), (5, 5, 0.0)])
def test_time_is_0_where_the_stage_s_animation_begins(tmp_path, start, end, length):
    """In films the first frame is 1001: a camera path that starts at 0 s must meet it."""
    box = prim("Mesh", "m", triangles([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), *MOVES.format(a=start, b=start + 24).splitlines())
    first, last = "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]", "[(2, 0, 0), (3, 0, 0), (2, 1, 0)]"
    sampled = f"point3f[] points.timeSamples = {{ {start}: {first}, {start + 24}: {last} }}"
    deforming = prim("Mesh", "d", "int[] faceVertexCounts = [3]", "int[] faceVertexIndices = [0, 1, 2]", sampled)
    scene = load_scene(usd(tmp_path, box, deforming, header=f"startTimeCode = {start}\n endTimeCode = {end}"))
    assert scene.animation_end_s == length
    for time_s in (0.0, 0.5, 1.0):
        assert scene.world_from_object(time_s)[0, 0, 3] == pytest.approx(8 * time_s, abs=1e-6)
        assert scene.deformed(time_s)[1].positions[0, 0] == pytest.approx(2 * time_s, abs=1e-6)
    assert scene.meshes[1].positions[0, 0] == 0
