"""What a camera sees of a glTF file, evaluated plainly in float64: the second opinion on readers and kernels.

Nothing of framepairs takes part. Sources: the glTF 2.0 specification, KHR_texture_transform, and Moeller and Trumbore (1997).
Where the specification leaves a choice: the first clip is played; a skin's normals go by the blended inverse transposes of its
joints' matrices (glTF-Sample-Viewer, UsdSkel); a tangent stays as interpolated and is not made perpendicular to the normal; the
bitangent is mirrored with a mirrored node; without TANGENT, the tangent is the triangle's direction of growing u, after
KHR_texture_transform, made perpendicular to the normal. Not read: sparse accessors, strips, fans, STEP, CUBICSPLINE.
"""

import base64
import json
import struct
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from PIL import Image

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
CELLS = 20  # of the frame, per axis: the rays of a cell are held against the triangles whose bounds meet it


class Gltf:
    """A glTF file: its JSON and its bytes."""

    def __init__(self, file: Path):
        self.file, data = file, file.read_bytes()
        if data[:4] == b"glTF":
            length = struct.unpack("<I", data[12:16])[0]
            self.json, self.rest = json.loads(data[20 : 20 + length]), data[28 + length :]
        else:
            self.json, self.rest = json.loads(data), b""
        self.buffers = [self._bytes(item["uri"]) if "uri" in item else self.rest for item in self.json.get("buffers", ())]
        self.images: dict[int, np.ndarray] = {}

    def _bytes(self, uri: str) -> bytes:
        return (
            base64.b64decode(uri.split(",")[1]) if uri.startswith("data:") else (self.file.parent / unquote(uri)).read_bytes()
        )

    def view(self, index: int) -> bytes:
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]]

    def accessor(self, index: int) -> np.ndarray:
        """[count, width] float64."""
        item = self.json["accessors"][index]
        assert "sparse" not in item
        dtype, width = np.dtype(COMPONENTS[item["componentType"]]), WIDTHS[item["type"]]
        stride = self.json["bufferViews"][item["bufferView"]].get("byteStride", dtype.itemsize * width)
        data, strides = self.view(item["bufferView"]), (stride, dtype.itemsize)
        values = np.ndarray((item["count"], width), dtype, data, item.get("byteOffset", 0), strides).astype(float)
        return np.maximum(values / np.iinfo(dtype).max, -1) if item.get("normalized") else values

    def image(self, index: int) -> np.ndarray:
        """[height, width, 4] in [0, 1], as stored."""
        if index not in self.images:
            item = self.json["images"][index]
            data = self._bytes(item["uri"]) if "uri" in item else self.view(item["bufferView"])
            self.images[index] = np.asarray(Image.open(BytesIO(data)).convert("RGBA")) / 255.0
        return self.images[index]


@dataclass(frozen=True, kw_only=True)
class Soup:
    """All triangles of the scene in the world at one time, corner by corner.

    corners, normals: [T, 3, 3]; normals have any length, and are the triangle's own where the file has none. tangents: [T,
    3, 4], zeros where there are none. uv: [T, 3, 2 sets, 2], v down. colors: [T, 3, 4]. object: [T] 1 + the number of the
    primitive, in the order of nodes. material: [T] index, -1 for the default.
    """

    corners: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray
    uv: np.ndarray
    colors: np.ndarray
    object: np.ndarray
    material: np.ndarray


def soup_of(gltf: Gltf, time_s: float) -> Soup:
    nodes, parts = gltf.json["nodes"], []
    world, weights = world_matrices(gltf, time_s)
    for number in sorted(world):
        if "mesh" not in nodes[number]:
            continue
        mesh = gltf.json["meshes"][nodes[number]["mesh"]]
        targets = weights.get(number, nodes[number].get("weights", mesh.get("weights", ())))
        joints = joint_matrices(gltf, nodes[number]["skin"], world) if "skin" in nodes[number] else None
        for primitive in mesh["primitives"]:
            parts.append(_part(gltf, primitive, world[number], joints, targets, len(parts) + 1))
    return Soup(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def _part(gltf: Gltf, primitive: dict, matrix, joints, target_weights, number: int) -> dict[str, np.ndarray]:
    assert primitive.get("mode", 4) == 4
    read = {name: gltf.accessor(index) for name, index in primitive["attributes"].items()}
    count = len(read["POSITION"])
    for weight, target in zip(target_weights, primitive.get("targets", ()), strict=False):
        for name in {"POSITION", "NORMAL"} & set(target) & set(read):
            read[name] = read[name] + weight * gltf.accessor(target[name])
    if primitive.get("targets") and "NORMAL" in read:
        read["NORMAL"] = unit(read["NORMAL"])
    matrices = np.broadcast_to(matrix, (count, 4, 4))
    if joints is not None:  # the node's own matrix does not count
        share = read["WEIGHTS_0"] / read["WEIGHTS_0"].sum(axis=1, keepdims=True)
        matrices = np.einsum("vk,vkij->vij", share, joints[read["JOINTS_0"].astype(int)])
    linear = matrices[:, :3, :3]
    turns = np.linalg.inv(linear).transpose(0, 2, 1)
    if joints is not None:
        of_joints = np.linalg.inv(joints[:, :3, :3]).transpose(0, 2, 1)
        turns = np.einsum("vk,vkij->vij", share, of_joints[read["JOINTS_0"].astype(int)])
    positions = np.einsum("vij,vj->vi", linear, read["POSITION"]) + matrices[:, :3, 3]
    order = gltf.accessor(primitive["indices"])[:, 0].astype(int) if "indices" in primitive else np.arange(count)
    faces = order.reshape(-1, 3)
    corners = positions[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.repeat(flat[:, None], 3, axis=1)
    if "NORMAL" in read:
        turned = np.einsum("vij,vj->vi", turns, read["NORMAL"])
        normals = (unit(turned) if joints is not None else turned)[faces]
    tangents = np.zeros((count, 4))
    if "TANGENT" in read and joints is None:
        tangents[:, :3] = np.einsum("vij,vj->vi", linear, read["TANGENT"][:, :3])
        tangents[:, 3] = read["TANGENT"][:, 3] * np.sign(np.linalg.det(linear))
    uv = np.stack([read.get(f"TEXCOORD_{k}", np.zeros((count, 2))) for k in (0, 1)], axis=1)
    colors = np.ones((count, 4))
    if "COLOR_0" in read:
        colors[:, : read["COLOR_0"].shape[1]] = read["COLOR_0"]
    return {
        "corners": corners,
        "normals": normals,
        "tangents": tangents[faces],
        "uv": uv[faces],
        "colors": colors[faces],
        "object": np.full(len(faces), number),
        "material": np.full(len(faces), primitive.get("material", -1)),
    }


def world_matrices(gltf: Gltf, time_s: float) -> tuple[dict[int, np.ndarray], dict[int, np.ndarray]]:
    """([4, 4] of every node in the scene, the morph weights of those where they are animated)."""
    moved = animated(gltf, time_s)
    world: dict[int, np.ndarray] = {}

    def visit(number: int, parent: np.ndarray) -> None:
        node = {**gltf.json["nodes"][number], **moved.get(number, {})}
        world[number] = parent @ local_matrix(node)
        for child in node.get("children", ()):
            visit(child, world[number])

    for root in gltf.json["scenes"][gltf.json.get("scene", 0)]["nodes"]:
        visit(root, np.eye(4))
    return world, {number: values["weights"] for number, values in moved.items() if "weights" in values}


def local_matrix(node: dict) -> np.ndarray:
    if "matrix" in node:
        return np.reshape(node["matrix"], (4, 4)).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=float) / np.linalg.norm(node.get("rotation", (0, 0, 0, 1)))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) + 2 * w * cross + 2 * cross @ cross) @ np.diag(node.get("scale", (1, 1, 1)))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def joint_matrices(gltf: Gltf, skin: int, world: dict[int, np.ndarray]) -> np.ndarray:
    """[joints, 4, 4]: world from bind pose."""
    item = gltf.json["skins"][skin]
    binds = gltf.accessor(item["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    return np.array([world[joint] @ bind for joint, bind in zip(item["joints"], binds, strict=True)])


def animated(gltf: Gltf, time_s: float) -> dict[int, dict[str, np.ndarray]]:
    """By node and property: what the first clip says at a time."""
    found: dict[int, dict[str, np.ndarray]] = {}
    for clip in gltf.json.get("animations", ())[:1]:
        for channel in clip["channels"]:
            sampler, path = clip["samplers"][channel["sampler"]], channel["target"]["path"]
            assert sampler.get("interpolation", "LINEAR") == "LINEAR"
            times = gltf.accessor(sampler["input"])[:, 0]
            values = gltf.accessor(sampler["output"]).reshape(len(times), -1)
            time = np.clip(time_s, times[0], times[-1])
            after = min(max(int(np.searchsorted(times, time, side="right")), 1), len(times) - 1) if len(times) > 1 else 0
            before = max(after - 1, 0)
            share = (time - times[before]) / (times[after] - times[before]) if after else 0.0
            a, b = values[before], values[after]
            value = slerp(a, b, share) if path == "rotation" else (1 - share) * a + share * b
            found.setdefault(channel["target"]["node"], {})[path] = value
    return found


def slerp(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    b = b if a @ b >= 0 else -b
    angle = np.arccos(min(a @ b, 1.0))
    if angle < 1e-6:
        return (1 - share) * a + share * b
    return (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)


def rays(camera, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(origin [3], directions [N, 3]) through fractions of the frame; a direction's length along the viewing axis is 1."""
    tangent = np.tan(camera.fov_y / 2)
    local = np.stack([(2 * x - 1) * tangent * camera.aspect, (1 - 2 * y) * tangent, -np.ones_like(x)], axis=1)
    return camera.world_from_camera[:3, 3], local @ camera.world_from_camera[:3, :3].T


def meetings(soup: Soup, camera, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """All pairs of ray and triangle that meet between near and far: (ray, triangle, depth, u, v), each [M]."""
    low, high = bounds(soup, camera)
    origin, directions = rays(camera, x, y)
    place = np.stack([x, y], axis=1)
    cell = np.floor(place * CELLS) @ (CELLS, 1)
    pairs = []
    for number in np.unique(cell):
        mine = np.flatnonzero(cell == number)
        near = np.flatnonzero(((low <= place[mine].max(axis=0)) & (high >= place[mine].min(axis=0))).all(axis=1))
        inside = ((low[near] <= place[mine][:, None]) & (place[mine][:, None] <= high[near])).all(axis=-1)
        ray, triangle = np.nonzero(inside)
        pairs.append((mine[ray], near[triangle]))
    ray, triangle = (np.concatenate(column) for column in zip(*pairs, strict=True))
    depth, u, v = intersect(origin, directions[ray], soup.corners[triangle])
    kept = (u >= 0) & (v >= 0) & (u + v <= 1) & (depth >= camera.near) & (depth <= camera.far)
    return tuple(column[kept] for column in (ray, triangle, depth, u, v))


def bounds(soup: Soup, camera) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest fractions of the frame [T, 2] that a triangle covers: all of them where a corner lies behind."""
    tangent = np.tan(camera.fov_y / 2)
    local = (soup.corners - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, :3]
    depth = -local[..., 2:]
    behind = (depth <= 0).any(axis=1)
    place = 0.5 + 0.5 * local[..., :2] * (1, -1) / np.where(depth > 0, depth, 1) / (tangent * camera.aspect, tangent)
    return np.where(behind, -np.inf, place.min(axis=1)), np.where(behind, np.inf, place.max(axis=1))


def intersect(origin: np.ndarray, directions: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, ...]:
    """Moeller and Trumbore for pairs of rays [P, 3] and triangles [P, 3, 3]: (t, u, v), NaN or infinite where parallel."""
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = origin - corners[:, 0]
    across, turned = np.cross(directions, edge2), np.cross(offset, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / dot(across, edge1)
        return dot(turned, edge2) * scale, dot(across, offset) * scale, dot(directions, turned) * scale


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What rays see [N]: object is 0 and depth infinite where they see nothing. triangle, u, v: where it lies, 0 there. normal,
    raw_normal, albedo: [N, 3]; texels of normal maps are given unit length before they are blended, or (raw_normal) blended
    as they are."""

    object: np.ndarray
    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    raw_normal: np.ndarray
    albedo: np.ndarray


def seen_by(gltf: Gltf, soup: Soup, camera, x: np.ndarray, y: np.ndarray) -> Seen:
    """The nearest opaque or alpha-tested surface through fractions (x, y) [N] of the frame."""
    ray, triangle, depth, u, v = meetings(soup, camera, x, y)
    solid = is_solid(gltf, soup, triangle, u, v)
    order = np.lexsort((depth, ray))
    order = order[solid[order]]
    _, first = np.unique(ray[order], return_index=True)
    nearest = order[first]
    ray, triangle, u, v = ray[nearest], triangle[nearest], u[nearest], v[nearest]
    directions = rays(camera, x, y)[1][ray]
    found = {name: np.zeros(len(x), dtype=int) for name in ("object", "triangle")}
    found |= {"depth": np.full(len(x), np.inf), "u": np.zeros(len(x)), "v": np.zeros(len(x))}
    seen = Seen(**found, **{name: np.zeros((len(x), 3)) for name in ("normal", "raw_normal", "albedo")})
    seen.object[ray], seen.triangle[ray], seen.depth[ray] = soup.object[triangle], triangle, depth[nearest]
    seen.u[ray], seen.v[ray] = u, v
    seen.normal[ray] = shading_normals(gltf, soup, triangle, u, v, directions, "unit normal")
    seen.raw_normal[ray] = shading_normals(gltf, soup, triangle, u, v, directions, "normal")
    seen.albedo[ray] = base_colors(gltf, soup, triangle, u, v)[:, :3]
    return seen


def over(values: np.ndarray, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Values at corners [T, 3, ...], interpolated."""
    a, b, c = (values[triangle, k] for k in range(3))
    u, v = (np.reshape(s, (-1, *[1] * (a.ndim - 1))) for s in (u, v))
    return (1 - u - v) * a + u * b + v * c


def places(soup: Soup, camera, seen: Seen) -> np.ndarray:
    """Fractions of the frame [N, 2] at which a camera has what was seen, at the time of `soup`."""
    points = over(soup.corners, seen.triangle, seen.u, seen.v)
    x, y, z = ((points - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, :3]).T
    tangent = np.tan(camera.fov_y / 2)
    return 0.5 + 0.5 * np.stack([x / (-z * tangent * camera.aspect), -y / (-z * tangent)], axis=1)


def material_of(gltf: Gltf, number: int) -> dict:
    return gltf.json["materials"][number] if number >= 0 else {}


def is_solid(gltf: Gltf, soup: Soup, triangle, u, v) -> np.ndarray:
    """Blended surfaces are not, and masked ones where their alpha is below the cutoff."""
    solid = np.ones(len(triangle), dtype=bool)
    for number in np.unique(soup.material[triangle]):
        mine, material = soup.material[triangle] == number, material_of(gltf, number)
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "BLEND":
            solid[mine] = False
        elif mode == "MASK":
            alpha = base_colors(gltf, soup, triangle[mine], u[mine], v[mine])[:, 3]
            solid[mine] = alpha >= material.get("alphaCutoff", 0.5)
    return solid


def base_colors(gltf: Gltf, soup: Soup, triangle, u, v) -> np.ndarray:
    """[N, 4]: factor x texel x COLOR_0, linear."""
    found = over(soup.colors, triangle, u, v)
    uv = over(soup.uv, triangle, u, v)
    for number in np.unique(soup.material[triangle]):
        mine, pbr = soup.material[triangle] == number, material_of(gltf, number).get("pbrMetallicRoughness", {})
        found[mine] *= pbr.get("baseColorFactor", (1, 1, 1, 1))
        if "baseColorTexture" in pbr:
            found[mine] *= texels(gltf, pbr["baseColorTexture"], uv[mine], "color")
    return found


def shading_normals(gltf: Gltf, soup: Soup, triangle, u, v, directions, kind: str) -> np.ndarray:
    """[N, 3] unit, towards the camera: the side of the triangle on which the interpolated normal lies is its front."""
    corners = soup.corners[triangle]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    flat, normal = np.cross(edge1, edge2), unit(over(soup.normals, triangle, u, v))
    front = np.sign(dot(flat, normal))
    bent = normal.copy()
    for number in np.unique(soup.material[triangle]):
        info = material_of(gltf, number).get("normalTexture")
        if info is None:
            continue
        mine = np.flatnonzero(soup.material[triangle] == number)
        uv = over(soup.uv, triangle, u, v)[mine]
        texel = texels(gltf, info, uv, kind)[:, :3]
        texel[:, :2] *= info.get("scale", 1)
        tangent, bitangent = tangents_of(soup, triangle[mine], u[mine], v[mine], normal[mine], info)
        x, y, z = (texel[:, k : k + 1] for k in range(3))
        bent[mine] = unit(x * tangent + y * bitangent + z * normal[mine])
    return np.where((front * dot(flat, directions) > 0)[:, None], -bent, bent)


def tangents_of(soup: Soup, triangle, u, v, normal, info: dict) -> tuple[np.ndarray, np.ndarray]:
    """(tangent, bitangent) [N, 3]: the directions of the normal map's x and y, which is up on the image: -v."""
    corners, uv = soup.corners[triangle], transformed(info, soup.uv[triangle, :, uv_set(info)])
    edges = corners[:, 1:] - corners[:, :1]  # [N, 2, 3]
    changes = uv[:, 1:] - uv[:, :1]  # [N, 2 edges, 2]
    determinant = changes[:, 0, 0] * changes[:, 1, 1] - changes[:, 0, 1] * changes[:, 1, 0]
    regular = np.where((determinant != 0)[:, None, None], changes, np.eye(2))
    along = np.linalg.solve(regular, edges)  # rows: d position / du, d position / dv
    tangent = unit(along[:, 0] - normal * dot(normal, along[:, 0])[:, None])
    handed = np.sign(dot(np.cross(normal, tangent), -along[:, 1]))
    given = over(soup.tangents, triangle, u, v)
    has = given.any(axis=1)
    tangent = np.where(has[:, None], unit(given[:, :3]), tangent)
    handed = np.where(has, np.sign(given[:, 3]), handed)
    return tangent, np.cross(normal, tangent) * handed[:, None]


def uv_set(info: dict) -> int:
    transform = info.get("extensions", {}).get("KHR_texture_transform", {})
    return transform.get("texCoord", info.get("texCoord", 0))


def transformed(info: dict, uv: np.ndarray) -> np.ndarray:
    """KHR_texture_transform of uv [..., 2], v down: scaled, then turned counter-clockwise as seen on the image, then moved."""
    transform = info.get("extensions", {}).get("KHR_texture_transform", {})
    angle = transform.get("rotation", 0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (uv * transform.get("scale", (1, 1))) @ turn.T + transform.get("offset", (0, 0))


def texels(gltf: Gltf, info: dict, uv: np.ndarray, kind: str) -> np.ndarray:
    """[N, 4]: the bilinear mean of the four texels around uv [N, 2 sets, 2] at the finest level, decoded as their `kind` is."""
    texture = gltf.json["textures"][info["index"]]
    sampler = gltf.json["samplers"][texture["sampler"]] if "sampler" in texture else {}
    image = gltf.image(texture["source"])
    height, width = image.shape[:2]
    place = transformed(info, uv[:, uv_set(info)]) * (width, height) - 0.5
    low = np.floor(place).astype(int)
    share = place - low
    found = np.zeros((len(uv), 4))
    for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column = wrapped(low[:, 0] + right, width, sampler.get("wrapS", 10497))
        row = wrapped(low[:, 1] + below, height, sampler.get("wrapT", 10497))
        weight = (share[:, 0] if right else 1 - share[:, 0]) * (share[:, 1] if below else 1 - share[:, 1])
        found += weight[:, None] * decoded(image[row, column], kind)
    return found


def decoded(stored: np.ndarray, kind: str) -> np.ndarray:
    """Texels [N, 4] in [0, 1] as "color" (from sRGB, but for alpha), "normal" (in [-1, 1]) or "unit normal"."""
    rgb = stored[:, :3]
    if kind == "color":
        value = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    else:
        value = 2 * rgb - 1 if kind == "normal" else unit(2 * rgb - 1)
    return np.concatenate([value, stored[:, 3:]], axis=1)


def wrapped(index: np.ndarray, size: int, mode: int) -> np.ndarray:
    if WRAPS[mode] == "repeat":
        return index % size
    if WRAPS[mode] == "clamp":
        return np.clip(index, 0, size - 1)
    index = index % (2 * size)
    return np.minimum(index, 2 * size - 1 - index)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(axis=-1)


def unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)
