"""G-buffer and motion of real glTF files, and of a made one that has what these lack, against `independent` in float64.

The streams are one sample per pixel at scale 1 with a mip bias of -8 and without anisotropy, so that both sides read the
finest texels: `hr` has the same samples of everything but textures. Excluded, counted and few: pixels whose nearest object
differs, which are silhouettes that pass within rounding of a pixel's sample.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image

from analytic import Stage, path_of, uv_sphere
from framepairs.camera_path import CameraPath
from framepairs.frame import orbit
from framepairs.scene import light_scene, load_scene
from framepairs.transforms import look_at
from gltf_files import GltfFile
from independent import Gltf, intersect, places, seen_by, soup_of, texels, transformed, world_matrices

CHANNELS = frozenset({"depth", "normal", "albedo", "object_id", "motion"})
STREAMS = ("lr_x1_mip-8", "lr_x1_jittered_mip-8")
DISPLAY = (320, 180)
RAYS = 5000
ANIMATED = ("Fox/Fox.glb", "CesiumMilkTruck/CesiumMilkTruck.glb", "MorphStressTest/MorphStressTest.gltf")
STILL = ("FlightHelmet/FlightHelmet.gltf", "AlphaBlendModeTest/AlphaBlendModeTest.glb")
ROOM = "BreakfastRoom/BreakfastRoom.gltf"
SINGLE = 2.0**-24
HALF = 2.0**-12  # greatest rounding of a texel below 1 that is kept in half precision


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Of rays [N] that meet the same object in both. differing: share of those that meet one in either and not the same.
    depth: relative. normal: degrees; raw_normal: against normal maps whose texels are blended as they are stored. albedo:
    greatest of the components. motion: pixels."""

    differing: float
    object: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    raw_normal: np.ndarray
    albedo: np.ndarray
    motion: np.ndarray

    def __str__(self) -> str:
        share, quantiles = (self.albedo <= 1 / 255).mean(), (0.5, 0.95, 0.99, 1)
        columns = (self.depth, self.normal, self.raw_normal, self.motion, self.albedo)
        texts = (", ".join(f"{value:.1e}" for value in np.quantile(values, quantiles)) for values in columns)
        names = ("depth", "normal", "raw normal", "motion", "albedo")
        found = "; ".join(f"{name} {text}" for name, text in zip(names, texts, strict=True))
        return f"{len(self.object)} rays, {self.differing:.2%} differ; at 50, 95, 99, 100 %: {found} ({share:.2%} within 1/255)"

    def of(self, number: int) -> "Errors":
        """Those on one object."""
        arrays = {name: values[self.object == number] for name, values in vars(self).items() if name != "differing"}
        return Errors(differing=self.differing, **arrays)


def errors_of(file, stage: Stage, frame: int, stream: str, rays: int = RAYS) -> Errors:
    """The renderer's samples of some pixels against the evaluation of the same file."""
    gltf, state = Gltf(file), stage.shoot.state(frame)
    rendered = stage.engine.render(state, stage.streams[stream], CHANNELS, 0)
    width, height = stage.streams[stream].size
    rows, columns = np.divmod(np.random.default_rng(frame).choice(width * height, rays, replace=False), width)
    x, y = (columns + 0.5 - rendered.jitter[0]) / width, (rows + 0.5 - rendered.jitter[1]) / height
    times = [stage.shoot.samples[k].scene_time_s for k in (frame, frame if state.reset else frame - 1)]
    now = soup_of(gltf, times[0])
    before = now if state.reset else soup_of(gltf, times[1])
    seen = seen_by(gltf, now, state.camera, x, y)
    motion = (places(before, state.previous_camera, seen) - np.stack([x, y], axis=1)) * (width, height)
    found = {name: array[rows, columns].astype(float) for name, array in rendered.arrays.items()}
    same = found["object_id"][:, 0] == seen.object
    either = (found["object_id"][:, 0] > 0) | (seen.object > 0)
    drawn = same & either
    assert np.isinf(found["depth"][~either]).all() and not found["normal"][~either].any()
    return Errors(
        differing=float((either & ~same).sum() / either.sum()),
        object=seen.object[drawn],
        depth=np.abs(found["depth"][drawn, 0] / seen.depth[drawn] - 1),
        normal=angle(found["normal"][drawn], seen.normal[drawn]),
        raw_normal=angle(found["normal"][drawn], seen.raw_normal[drawn]),
        albedo=np.abs(found["albedo"] - seen.albedo)[drawn].max(axis=1),
        motion=np.linalg.norm(found["motion"] - (0 if state.reset else motion), axis=1)[drawn],
    )


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Degrees [N] between unit vectors [N, 3]."""
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=1) / 2, 1)))


def stage_of(scene, path: CameraPath) -> Stage:
    keys = {"scales": (1,), "variants": ("mip", "jittered_mip"), "mip_bias_offset": -8, "anisotropy": 1}
    return Stage(light_scene(scene, None)[0], path, display=DISPLAY, antialiasing=1, channels=tuple(CHANNELS), **keys)


def close_orbit(scene) -> CameraPath:
    """The default orbit through a longer lens, so that the scene fills the frame."""
    return orbit(scene).model_copy(update={"fov_y_deg": 24.0})


# Smooth normals: the place errs by some 16 roundings of the distance, on triangles a hundredth of it wide, across which normals
# turn by a radian at most.
# Normal maps: the renderer gives their texels unit length before it blends them, so that mip levels may hold means of
# directions, and keeps them in half precision: three components err by HALF at most. Graphics hardware blends them as they are:
# texels of 8 bits, or out of a JPEG, are up to tenths longer or shorter than 1, which moves normals between them.
SMOOTH, BUMPY, RAW = np.degrees(16 * SINGLE * 100), np.degrees(np.sqrt(3) * HALF), 0.5


def check(errors: Errors, normals_p99: float, rays: int = 600) -> None:
    """The bounds of the acceptance, and tighter ones where the precision of what is stored gives them. Base colour: a texel's
    rounding, and as much again for the place between texels (float32 uv times up to 2048 texels, times their contrast)."""
    print(errors)
    assert len(errors.object) >= rays and errors.differing < 0.01, str(errors)
    assert np.median(errors.depth) <= 1e-6 and np.quantile(errors.depth, 0.99) <= 1e-5, str(errors)
    assert np.median(errors.normal) <= 0.05 and np.quantile(errors.normal, 0.99) <= normals_p99, str(errors)
    assert np.median(errors.raw_normal) <= 0.05 and np.quantile(errors.raw_normal, 0.95) <= RAW, str(errors)
    assert np.quantile(errors.motion, 0.99) <= 8 * SINGLE * DISPLAY[0], str(errors)  # roundings of a fraction of the frame
    assert np.quantile(errors.albedo, 0.99) <= 2 * HALF <= 1 / 255, str(errors)


@pytest.mark.parametrize("name", ANIMATED)
def test_animated_assets_at_the_first_frame_and_later(assets, name):
    file = assets / name
    scene = load_scene(file)
    stage = stage_of(scene, close_orbit(scene))
    assert scene.moves and stage.shoot.state(13).time_s > 0.5
    for frame, stream in zip((0, 13), STREAMS, strict=True):
        check(errors_of(file, stage, frame, stream), SMOOTH)


@pytest.mark.parametrize("name", STILL)
def test_textured_assets_with_normal_maps_masks_and_blended_layers(assets, name):
    file = assets / name
    scene = load_scene(file)
    stage = stage_of(scene, close_orbit(scene))
    for frame, stream in zip((0, 27), STREAMS, strict=True):
        check(errors_of(file, stage, frame, stream), BUMPY)


def test_a_room_from_within(assets):
    """By the file's own first camera: walls reach behind it."""
    file = assets / ROOM
    gltf = Gltf(file)
    (number,) = [k for k, node in enumerate(gltf.json["nodes"]) if node.get("camera") == 0]
    place = world_matrices(gltf, 0)[0][number]
    place[:3, :3] /= np.linalg.norm(place[:3, :3], axis=0)  # a camera's scale does not count
    stage = stage_of(load_scene(file), path_of(place, fov_y_deg=45))
    for stream in STREAMS:
        check(errors_of(file, stage, 0, stream, rays=700), SMOOTH)


# A made scene.


def bumpy_pixels(seed: int, width: int = 24, height: int = 16) -> np.ndarray:
    """Normals within some 45 degrees of +z, as 8 bits."""
    slopes = np.random.default_rng(seed).uniform(-0.7, 0.7, (height, width, 2))
    normals = np.concatenate([slopes, np.ones((height, width, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.rint((normals + 1) * 127.5).astype(np.uint8)


def made_file(folder):
    """Spheres, turned and scaled unevenly, two mirrored, with all that textures and vertices may have; a wall behind."""
    random = np.random.default_rng(5)
    Image.fromarray(random.integers(0, 256, (20, 28, 4), dtype=np.uint8)).save(folder / "color.png")
    Image.fromarray(bumpy_pixels(6)).save(folder / "normal.png")
    file = GltfFile(
        images=[{"uri": "color.png"}, {"uri": "normal.png"}],
        samplers=[{"wrapS": 33648, "wrapT": 33071}, {"wrapS": 10497, "wrapT": 33648}],
        textures=[{"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}, {"source": 0, "sampler": 1}],
        extensionsUsed=["KHR_texture_transform"],
        scene=0,
    )
    turned = {"KHR_texture_transform": {"offset": [0.3, -0.2], "rotation": 0.5, "scale": [1.7, 1.3]}}
    second = {"KHR_texture_transform": {"offset": [0.1, 0.4], "scale": [2.0, -1.5], "texCoord": 1}}
    bumps = {"index": 1, "scale": 0.8}
    mirrored = {"KHR_texture_transform": {"offset": [0.1, 0.0], "rotation": -0.7, "scale": [1.2, -0.9], "texCoord": 1}}
    file.json["materials"] = [
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.9, 0.8, 0.7, 1], "baseColorTexture": {"index": 0, "extensions": turned},
            },
            "normalTexture": bumps,
        },
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 2, "extensions": second}},
            "normalTexture": {"index": 1, "extensions": mirrored},
        },
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.9, 0.6, 0.9], "baseColorTexture": {"index": 2, "texCoord": 1},
            },
            "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": True, "normalTexture": bumps,
        },
        {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.9, 0.5]}, "alphaMode": "BLEND"},
        {"pbrMetallicRoughness": {"baseColorFactor": [0.3, 0.5, 0.2, 1]}},
    ]  # fmt: skip
    sphere = uv_sphere(20, 10)
    normals, down = sphere.normals, sphere.uv * np.float32([1, -1]) + np.float32([0, 1])
    along = np.cross([0, 1, 0], normals) + [1e-9, 0, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    tangent = np.float32(np.concatenate([along, np.ones((len(along), 1))], axis=1))
    colors = random.uniform(0.3, 1, (len(normals), 4)).astype(np.float32)
    bytes_of_colors = file.accessor(random.integers(80, 256, (len(normals), 4), dtype=np.uint8), normalized=True)
    other = (down * np.float32([3, 2]) + np.float32([0.2, -0.4])).astype(np.float32)
    keys = {"NORMAL": normals, "TEXCOORD_0": down, "TEXCOORD_1": other}

    def mesh(material, positions=sphere.positions, faces=sphere.faces, **attributes):
        return file.mesh(positions, faces, primitive_keys={"material": material}, **attributes)

    meshes = [
        mesh(0, **keys, TANGENT=tangent),
        mesh(0, **keys, TANGENT=tangent * np.float32([1, 1, 1, -1])),
        mesh(1, **keys, COLOR_0=colors),
        mesh(2, **{**keys, "TEXCOORD_0": np.abs(2 * down - 1)}, COLOR_0=bytes_of_colors),
        mesh(3, **keys),
        mesh(4, np.float32([[-9, -9, -3], [9, -9, -3], [9, 9, -3], [-9, 9, -3]]), [[0, 1, 2], [0, 2, 3]]),
    ]
    turn, half = [0.2, 0.3, -0.1, 0.9273618495495703], np.sqrt(0.5)
    file.node(mesh=meshes[0], translation=[-1.5, 1, 0], rotation=turn, scale=[1, 0.5, 1.2])
    file.node(mesh=meshes[1], translation=[1.5, 1, 0], rotation=turn, scale=[-0.6, 1, 0.8])
    file.node(mesh=meshes[2], translation=[-1.5, -1, 0], scale=[1.1, 1, 0.4], rotation=[half, 0, 0, half])
    file.node(mesh=meshes[2], matrix=[0.8, 0.2, 0, 0, -0.3, 0.7, 0.1, 0, 0, 0.3, -0.9, 0, 0, -1, 0.2, 1])  # mirrored
    file.node(mesh=meshes[3], translation=[1.6, -1.1, 0], rotation=turn)
    file.node(mesh=meshes[4], translation=[0, 0.8, 1])
    file.node(mesh=meshes[5])
    file.node(children=[0, 1, 2, 3, 4, 5], rotation=[0, 0.1, 0, np.sqrt(0.99)])
    file.json["scenes"] = [{"nodes": [7, 6]}]
    return file.save(folder)


@pytest.fixture(scope="module")
def made_errors(tmp_path_factory) -> dict[str, Errors]:
    """By stream, of the made scene."""
    file = made_file(tmp_path_factory.mktemp("made"))
    view = look_at(np.array([0.6, 0.4, 7.0]), np.zeros(3), np.array([0.0, 1, 0]))
    stage = stage_of(load_scene(file), path_of(view, view, fov_y_deg=38))
    return {stream: errors_of(file, stage, 1, stream, rays=12000) for stream in STREAMS}


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize(
    ("number", "bound"),
    [(1, BUMPY), (2, BUMPY), (3, BUMPY), (4, BUMPY), (5, BUMPY), (7, SMOOTH)],
    ids=[
        "tangents",
        "left-handed tangents on a mirrored node",
        "turned normal map of the second uv set",
        "the same on a mirrored and sheared node",
        "mask and mirrored uv",
        "flat wall",
    ],
)
def test_a_made_scene(made_errors, number, bound, stream):
    assert (made_errors[stream].object != 6).all()  # the blended sphere
    check(made_errors[stream].of(number), bound, rays=200)


# The evaluation itself.


def test_the_evaluation_meets_a_triangle_where_it_lies():
    corners = np.array([[[1.0, 0, -4], [3, 0, -4], [1, 2, -4]]])
    depth, u, v = intersect(np.zeros(3), np.array([[0.5, 0.125, -1]]), corners)
    np.testing.assert_array_equal((depth[0], u[0], v[0]), (4, 0.5, 0.25))  # (2, 0.5, -4) = corner + edge 1 / 2 + edge 2 / 4


def test_the_evaluation_turns_texture_coordinates_as_the_extension_shows():
    """The first example of KHR_texture_transform: the lower left quadrant of the image, turned clockwise by 90 degrees."""
    values = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    info = {"extensions": {"KHR_texture_transform": values}}
    uv = transformed(info, np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]))  # from the top left, clockwise
    np.testing.assert_allclose(uv, [[0, 1], [0, 0.5], [0.5, 0.5], [0.5, 1]], atol=1e-15)


@pytest.mark.parametrize(("mode", "order"), [(10497, (2, 0, 1, 2, 0)), (33071, (0, 0, 1, 2, 2)), (33648, (0, 0, 1, 2, 2))])
def test_the_evaluation_reads_texels_at_their_centres_and_beyond_edges(tmp_path, mode, order):
    gray = np.uint8([[0, 51, 255]])
    Image.fromarray(gray).save(tmp_path / "t.png")
    file = GltfFile(images=[{"uri": "t.png"}], samplers=[{"wrapS": mode}], textures=[{"source": 0, "sampler": 0}])
    gltf = Gltf(file.save(tmp_path))
    centres = (np.arange(-1, 4) + 0.5) / 3
    uv = np.stack([centres, np.full(5, 0.5)], axis=1)[:, None]
    found = texels(gltf, {"index": 0}, uv, "normal")
    np.testing.assert_allclose(found[:, 0], 2.0 * gray[0, list(order)] / 255 - 1, atol=1e-14)
    between = texels(gltf, {"index": 0}, np.array([[[1 / 3, 0.2]]]), "normal")
    np.testing.assert_allclose(between, [[-0.8, -0.8, -0.8, 1]], atol=1e-14)
    color = texels(gltf, {"index": 0}, np.array([[[0.5, 0.5]]]), "color")  # 51 / 255 = 0.2 of sRGB
    np.testing.assert_allclose(color[0, :3], ((0.2 + 0.055) / 1.055) ** 2.4, rtol=1e-14)
