"""One animated scene as USD and as glTF: the same G-buffers, motion and colours before they are stored.

A textured tube that three joints bend, and a textured box whose node moves, both from the same arrays. They have no tangents,
which UsdPreviewSurface does not know: both take them from texture coordinates.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image

from analytic import ALL, Stage
from framepairs.camera_path import CameraPath
from framepairs.frame import orbit
from framepairs.scene import light_scene, load_scene
from gltf_files import GltfFile, moved
from independent import Gltf, seen_by, soup_of
from usd_stages import influences, matrix, prim, usd, values

KEYS = np.arange(9) / 8  # seconds
CODES = 24  # time codes per second
PLACE = np.array([[0.8, 0, 0.6, 0.4], [0, 1, 0, -1.2], [-0.6, 0, 0.8, 0.3], [0, 0, 0, 1]])  # of the tube's skeleton
JOINTS = 3
FRAMES = (7, 17)  # between keys, at 24 frames per second
DISPLAY = (240, 136)
SINGLE, HALF = 2.0**-24, 2.0**-12  # greatest roundings of values below 1


@dataclass(frozen=True)
class Shape:
    """points, normals: [V, 3] float32. uv: [V, 2] float32, v up. faces: [T, 3]."""

    points: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    faces: np.ndarray


def tube(columns: int = 16, rows: int = 24) -> Shape:
    """Around the y axis from 0 to 3, radius 0.4; uv in steps that float32 holds, so that 1 - v is exact."""
    row, column = np.divmod(np.arange((rows + 1) * (columns + 1)), columns + 1)
    turn = 2 * np.pi * column / columns
    normals = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], axis=1)
    points = 0.4 * normals + np.outer(3 * row / rows, [0, 1, 0])
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    up = columns + 1
    faces = np.concatenate([[first, first + 1, first + up + 1], [first, first + up + 1, first + up]], axis=1).T
    uv = np.stack([2 * column / columns, 3 * row / 32], axis=1)
    return Shape(points.astype(np.float32), normals.astype(np.float32), uv.astype(np.float32), faces)


def box() -> Shape:
    """From -0.5 to 0.5, each side with its own four corners and the whole texture, mirrored on every other side."""
    points, normals, uv = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            normal, right = np.zeros(3), np.zeros(3)
            normal[axis], right[(axis + 1) % 3] = sign, 1
            up = np.cross(normal, right)
            for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                points.append(0.5 * (normal + x * right + y * up))
                normals.append(normal)
                uv.append((0.5 + 0.5 * x * sign, 0.5 + 0.5 * y))
    first = 4 * np.arange(6)[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return Shape(np.float32(points), np.float32(normals), np.float32(uv), faces)


def weights_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(joints, weights) [V, 4] of the tube: the two joints, at heights 0, 1 and 2, between whose middles a point lies."""
    place = np.clip(points[:, 1].astype(float) - 0.5, 0, JOINTS - 1)
    lower = np.minimum(np.floor(place).astype(int), JOINTS - 2)
    upper = (place - lower).astype(np.float32)
    nothing = np.zeros_like(lower)
    joints = np.stack([lower, lower + 1, nothing, nothing], axis=1)
    return joints.astype(np.uint8), np.stack([1 - upper, upper, 0 * upper, 0 * upper], axis=1)


def turned(axis, degrees: np.ndarray) -> np.ndarray:
    """[K, 4] float32 quaternions (x, y, z, w)."""
    half = np.radians(degrees)[:, None] / 2
    return np.concatenate([np.sin(half) * axis, np.cos(half)], axis=1).astype(np.float32)


# By joint: rotations at the keys; the first one moves along, too. Then the box.
BENDS = [
    turned([0, 1, 0], 40 * KEYS),
    turned([0, 0, 1], 50 * np.sin(3 * KEYS)),
    turned([0.6, 0, 0.8], -70 * KEYS**2),
]
ROOT_PLACES = np.outer(KEYS, [0.3, 0.1, 0]).astype(np.float32)
BOX_TURNS = turned([0.48, 0.6, 0.64], 20 + 90 * KEYS)
BOX_PLACES = np.stack([-1.1 + 0.5 * KEYS, 0.3 * np.sin(4 * KEYS), 0.7 - 0.4 * KEYS], axis=1).astype(np.float32)
BOX_SCALE = (0.8, 1.1, 0.6)


def write_images(folder) -> None:
    random = np.random.default_rng(3)
    slopes = random.uniform(-0.5, 0.5, (8, 12, 2))
    normals = np.concatenate([slopes, np.ones((8, 12, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    pixels = {
        "base": random.integers(0, 256, (10, 14, 3)),
        "normal": np.rint((normals + 1) * 127.5),
        "surface": random.integers(30, 256, (6, 9, 3)),
    }
    for name, array in pixels.items():
        Image.fromarray(array.astype(np.uint8)).save(folder / f"{name}.png")


def write_gltf(folder):
    names = ("base", "normal", "surface")
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 2}}
    file = GltfFile(
        images=[{"uri": f"{name}.png"} for name in names],
        textures=[{"source": k} for k in range(3)],
        materials=[{"name": "painted", "pbrMetallicRoughness": pbr, "normalTexture": {"index": 1}}],
    )
    painted = {"primitive_keys": {"material": 0}}

    def mesh(shape: Shape, **keys) -> int:
        down = shape.uv * np.float32([1, -1]) + np.float32([0, 1])
        return file.mesh(shape.points, shape.faces, NORMAL=shape.normals, TEXCOORD_0=down, **keys, **painted)

    bending = tube()
    joints, weights = weights_of(bending.points)
    tube_node = file.node(name="tube", mesh=mesh(bending, JOINTS_0=joints, WEIGHTS_0=weights), skin=0)
    box_node = file.node(name="box", mesh=mesh(box()), scale=list(BOX_SCALE))
    bones = []
    for height in reversed(range(JOINTS)):
        bones.insert(0, file.node(translation=[0, min(height, 1), 0], **({"children": bones[:1]} if bones else {})))
    root = file.node(matrix=PLACE.T.ravel().tolist(), children=[bones[0]])
    file.skin(bones, [moved(0, -k, 0) for k in range(JOINTS)])
    turns = [(bone, "rotation", KEYS, bend, "LINEAR") for bone, bend in zip(bones, BENDS, strict=True)]
    places = [(bones[0], "translation", KEYS, ROOT_PLACES, "LINEAR"), (box_node, "translation", KEYS, BOX_PLACES, "LINEAR")]
    file.clip(*turns, *places, (box_node, "rotation", KEYS, BOX_TURNS, "LINEAR"))
    file.json["scenes"] = [{"nodes": [tube_node, box_node, root]}]
    return file.save(folder)


def samples(attribute: str, per_key) -> str:
    """An attribute with a value, as text, at each key."""
    return f"{attribute}.timeSamples = {{ {', '.join(f'{KEYS[k] * CODES}: {text}' for k, text in enumerate(per_key))} }}"


def quaternion(xyzw: np.ndarray) -> str:
    x, y, z, w = xyzw.tolist()
    return str((w, x, y, z))


def shader(name: str, kind: str, *lines: str) -> str:
    return prim("Shader", name, f'uniform token info:id = "{kind}"', *lines)


def painted() -> str:
    """The prim of the material."""

    def image(name: str, space: str, *lines: str) -> str:
        wrap = (f'token inputs:wrap{axis} = "repeat"' for axis in "ST")
        source = (f"asset inputs:file = @{name}.png@", f'token inputs:sourceColorSpace = "{space}"')
        link = "float2 inputs:st.connect = </painted/uv.outputs:result>"
        return shader(name, "UsdUVTexture", *source, link, *wrap, *lines)

    decoding = "float4 inputs:scale = (2, 2, 2, 1)", "float4 inputs:bias = (-1, -1, -1, 0)"
    preview = shader(
        "preview", "UsdPreviewSurface",
        "color3f inputs:diffuseColor.connect = </painted/base.outputs:rgb>",
        "normal3f inputs:normal.connect = </painted/normal.outputs:rgb>",
        "float inputs:roughness.connect = </painted/surface.outputs:g>",
        "float inputs:metallic.connect = </painted/surface.outputs:b>",
        "token outputs:surface",
    )  # fmt: skip
    return prim(
        "Material", "painted", "token outputs:surface.connect = </painted/preview.outputs:surface>", preview,
        shader("uv", "UsdPrimvarReader_float2", 'string inputs:varname = "st"', "float2 outputs:result"),
        image("base", "sRGB", "float3 outputs:rgb"),
        image("normal", "raw", *decoding, "float3 outputs:rgb"),
        image("surface", "raw", "float outputs:g", "float outputs:b"),
    )  # fmt: skip


def mesh_prim(name: str, shape: Shape, *lines: str, schemas: str = '"MaterialBindingAPI"') -> str:
    return prim(
        "Mesh", name, *lines,
        f"int[] faceVertexCounts = {values([3] * len(shape.faces))}",
        f"int[] faceVertexIndices = {values(shape.faces.ravel())}",
        f"point3f[] points = {values(shape.points)}",
        f'normal3f[] normals = {values(shape.normals)} (interpolation = "vertex")',
        f'texCoord2f[] primvars:st = {values(shape.uv)} (interpolation = "vertex")',
        'uniform token subdivisionScheme = "none"', "rel material:binding = </painted>",
        metadata=f"prepend apiSchemas = [{schemas}]",
    )  # fmt: skip


def write_usd(folder):
    joints = 'uniform token[] joints = ["a", "a/b", "a/b/c"]'
    binds = f"[{', '.join(matrix(moved(0, k, 0)) for k in range(JOINTS))}]"
    rests = f"[{', '.join(matrix(moved(0, min(k, 1), 0)) for k in range(JOINTS))}]"
    upright = [(0.0, 1.0, 0.0)] * (JOINTS - 1)
    animation = prim(
        "SkelAnimation", "anim", joints,
        samples("float3[] translations", (values([tuple(place.tolist()), *upright]) for place in ROOT_PLACES)),
        samples("quatf[] rotations", (f"[{', '.join(quaternion(bend[k]) for bend in BENDS)}]" for k in range(len(KEYS)))),
        f"half3[] scales = {values([(1, 1, 1)] * JOINTS)}",
    )  # fmt: skip
    skeleton = prim(
        "Skeleton", "bones", joints, f"uniform matrix4d[] bindTransforms = {binds}",
        f"uniform matrix4d[] restTransforms = {rests}", "rel skel:animationSource = </figure/anim>",
        metadata='prepend apiSchemas = ["SkelBindingAPI"]',
    )  # fmt: skip
    bending = tube()
    skin = "rel skel:skeleton = </figure/bones>", *influences(*weights_of(bending.points))
    mesh = mesh_prim("tube", bending, *skin, schemas='"MaterialBindingAPI", "SkelBindingAPI"')
    order = 'uniform token[] xformOpOrder = ["xformOp:transform"]'
    figure = prim("SkelRoot", "figure", f"matrix4d xformOp:transform = {matrix(PLACE)}", order, skeleton, animation, mesh)
    moving = mesh_prim(
        "box", box(),
        samples("float3 xformOp:translate", (str(tuple(place.tolist())) for place in BOX_PLACES)),
        samples("quatf xformOp:orient", (quaternion(turn) for turn in BOX_TURNS)),
        f"float3 xformOp:scale = {BOX_SCALE}",
        'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient", "xformOp:scale"]',
    )  # fmt: skip
    header = f'upAxis = "Y"\nmetersPerUnit = 1\ntimeCodesPerSecond = {CODES}\nstartTimeCode = 0\nendTimeCode = {CODES}'
    return usd(folder, painted(), figure, moving, header=header)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tube")
    write_images(folder)
    return write_gltf(folder), write_usd(folder)


@pytest.fixture(scope="module")
def stages(files) -> tuple[Stage, Stage]:
    """Of the glTF and of the USD file, along one path."""
    scenes = [light_scene(load_scene(file), None)[0] for file in files]
    return tuple(Stage(scene, close_path(scenes[0]), display=DISPLAY, scales=(2,)) for scene in scenes)


def close_path(scene) -> CameraPath:
    return orbit(scene).model_copy(update={"fov_y_deg": 25.0})


def test_both_readers_find_the_same_objects(stages):
    for scene in (stage.shoot.scene for stage in stages):
        assert [(item.moves, scene.meshes[item.mesh].deforms) for item in scene.objects] == [(True, True), (True, False)]
        assert (scene.animation_end_s, scene.not_read) == (1, ())


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("stream", ["hr", "lr_x2_jittered_mip-1"])
def test_a_usd_and_a_gltf_file_give_the_same_arrays(stages, frame, stream):
    """All channels within 1e-4 (depth relative) on 99.9 % of the pixels that show anything: both readers evaluate in float64,
    but round around origins of their own, and a rounding at a silhouette moves a pixel to another object."""
    ours, theirs = (stage.arrays(frame, stream) for stage in stages)
    assert set(ours) == set(theirs) == ALL
    drawn = (ours["object_id"] + theirs["object_id"])[..., 0] > 0
    shares = {name: float((difference(name, ours[name], theirs[name])[drawn] <= 1e-4).mean()) for name in ALL}
    assert min(shares.values()) >= 0.999, shares


@pytest.mark.parametrize("frame", FRAMES)
def test_both_objects_are_seen_and_move(stages, frame):
    """Otherwise equal arrays would say little."""
    arrays = stages[0].arrays(frame)
    for number, share in ((1, 0.15), (2, 0.03)):
        mine = arrays["object_id"][..., 0] == number
        assert mine.mean() > share
        assert np.linalg.norm(arrays["motion"][mine], axis=-1).max() > 1  # pixels
        assert all(np.ptp(arrays[name][mine], axis=0).min() > 0.2 for name in ("albedo", "normal", "roughness", "metallic"))


def difference(name: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[height, width]: the greatest of the components."""
    a, b = a.astype(float), b.astype(float)
    with np.errstate(invalid="ignore"):
        apart = np.abs(a - b) / (np.minimum(a, b) if name == "depth" else 1)
    return np.where(a == b, 0, apart).max(axis=-1)


@pytest.mark.parametrize("which", [0, 1], ids=["gltf", "usd"])
def test_both_are_as_the_independent_evaluation_of_the_gltf_file_has_them(files, stages, which):
    """Between two keys. Depth as precise as float32; normals as half precision holds their map's texels, but on pixels that see
    the tube edge-on: these read more than the finest texels."""
    frame, (width, height) = FRAMES[0], DISPLAY
    gltf, state = Gltf(files[0]), stages[which].shoot.state(frame)
    arrays = stages[which].arrays(frame)
    rows, columns = np.mgrid[:height:3, :width:3].reshape(2, -1)
    seen = seen_by(gltf, soup_of(gltf, state.time_s), state.camera, (columns + 0.5) / width, (rows + 0.5) / height)
    same = arrays["object_id"][rows, columns, 0] == seen.object
    drawn = same & (seen.object > 0)
    assert state.time_s == pytest.approx(7 / 24) and set(seen.object) == {0, 1, 2} and same.mean() >= 0.999
    depth, normal = arrays["depth"][rows, columns, 0][drawn], arrays["normal"][rows, columns][drawn]
    assert np.quantile(np.abs(depth / seen.depth[drawn] - 1), 0.99) <= 16 * SINGLE
    assert np.quantile(np.linalg.norm(normal - seen.normal[drawn], axis=1), 0.9) <= np.sqrt(3) * HALF
