"""Images of textures: every format's values, and files that are damaged or lie about their size."""

import io
import resource
import struct
import subprocess
import sys
import time
import zlib

import numpy as np
import OpenEXR
import pytest
from PIL import Image, PngImagePlugin

from framepairs.errors import InputError
from framepairs.scene import load_scene
from framepairs.scene.images import MOST_PIXELS, decode_image, linear_texels
from gltf_files import GltfFile

WHOLE = np.random.default_rng(3).integers(0, 256, (5, 7, 4), dtype=np.uint8)
EXR_MAGIC = b"\x76\x2f\x31\x01"


def saved(pixels, form, mode=None, **keys):
    buffer = io.BytesIO()
    picture = Image.fromarray(pixels)
    (picture.convert(mode) if mode else picture).save(buffer, form, **keys)
    return buffer.getvalue()


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(width, height, depth, color, rows, *others):
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    body = chunk(b"IDAT", rows)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + b"".join(others) + body + chunk(b"IEND", b"")


def deep_png(codes):
    """A PNG of 16 bits; its rows take the filters none, sub and up in turn."""
    height, width, planes = codes.shape
    rows = codes.astype(">u2").view(np.uint8).reshape(height, -1).astype(int)
    left = np.pad(rows, ((0, 0), (2 * planes, 0)))[:, : -2 * planes]
    above = np.pad(rows, ((1, 0), (0, 0)))[:-1]
    kinds = np.arange(height) % 3
    coded = (rows - np.choose(kinds[:, None], [np.zeros_like(rows), left, above])) % 256
    table = np.concatenate([kinds[:, None], coded], axis=1).astype(np.uint8)
    return png(width, height, 16, {1: 0, 2: 4, 3: 2, 4: 6}[planes], zlib.compress(table.tobytes()))


def exr(channels, compression=OpenEXR.ZIP_COMPRESSION):
    buffer = io.BytesIO()
    OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, channels).write(buffer)
    return buffer.getvalue()


def attribute(name, kind, data):
    return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data


def luminance_chroma(luminance, red, blue):
    """An uncompressed OpenEXR file with chroma at every second pixel."""
    height, width = luminance.shape
    planes = ((b"BY", 2), (b"RY", 2), (b"Y", 1))
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 2, 0, step, step) for name, step in planes) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = EXR_MAGIC + struct.pack("<i", 2)
    head += attribute(b"channels", b"chlist", channels) + attribute(b"compression", b"compression", b"\0")
    head += attribute(b"dataWindow", b"box2i", window) + attribute(b"displayWindow", b"box2i", window)
    head += attribute(b"lineOrder", b"lineOrder", b"\0") + attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
    head += attribute(b"screenWindowCenter", b"v2f", bytes(8)) + attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1))
    lines = []
    for row in range(height):
        parts = [blue[row // 2], red[row // 2]] if row % 2 == 0 else []
        data = b"".join(part.astype("<f4").tobytes() for part in (*parts, luminance[row]))
        lines.append(struct.pack("<ii", row, len(data)) + data)
    places = len(head) + 1 + 8 * height + np.cumsum([0, *map(len, lines[:-1])])
    return head + b"\0" + places.astype("<u8").tobytes() + b"".join(lines)


@pytest.mark.parametrize("form", ["PNG", "WEBP", "TIFF", "TGA"])
def test_formats_without_loss_keep_their_codes(form):
    keys = {"lossless": True, "exact": True} if form == "WEBP" else {}
    np.testing.assert_array_equal(decode_image(saved(WHOLE, form, **keys), "a"), WHOLE)


@pytest.mark.parametrize("form", ["BMP", "PPM"])
def test_opacity_is_full_where_a_file_has_none(form):
    texels = decode_image(saved(WHOLE[..., :3], form), "a")
    np.testing.assert_array_equal(texels[..., :3], WHOLE[..., :3])
    assert (texels[..., 3] == 255).all()


def test_palettes_with_a_transparent_colour():
    indices = (np.arange(35) % 3).astype(np.uint8).reshape(5, 7)
    picture = Image.frombytes("P", (7, 5), indices.tobytes())
    palette = np.uint8([[255, 0, 0], [0, 128, 0], [0, 0, 64]])
    picture.putpalette(palette.tobytes())
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", transparency=1)
    texels = decode_image(buffer.getvalue(), "a")
    np.testing.assert_array_equal(texels[..., :3], palette[indices])
    np.testing.assert_array_equal(texels[..., 3], np.where(indices == 1, 0, 255))


def test_cmyk_becomes_rgb():
    pixels = np.full((8, 8, 3), (255, 0, 0), np.uint8)
    texels = decode_image(saved(pixels, "JPEG", mode="CMYK", quality=100), "a")
    assert texels.shape == (8, 8, 4) and np.abs(texels[..., :3].astype(int) - pixels).max() <= 4  # JPEG's own loss


def test_orientations_are_not_applied():
    turned = Image.Exif()
    turned[0x0112] = 6  # turn by 90 degrees
    assert decode_image(saved(WHOLE[..., :3], "JPEG", exif=turned), "a").shape == (5, 7, 4)


def test_interlaced_png():
    # Adam7 of a 2 x 2 grey image: passes 1, 6 and 7 hold (0, 0), (1, 0) and the second row
    rows = zlib.compress(bytes([0, 10, 0, 20, 0, 30, 40]))
    data = bytearray(png(2, 2, 8, 0, rows))
    data[28] = 1
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    np.testing.assert_array_equal(decode_image(bytes(data), "a")[..., 0], [[10, 20], [30, 40]])


@pytest.mark.parametrize("planes", [1, 2, 3, 4])
def test_png_of_16_bits_keeps_them(planes):
    codes = np.random.default_rng(planes).integers(0, 65536, (5, 7, planes), dtype=np.uint16)
    texels = decode_image(deep_png(codes), "a")
    rgb = codes[..., :3] if planes > 2 else codes[..., [0, 0, 0]]
    alpha = codes[..., -1:] if planes % 2 == 0 else np.full_like(codes[..., :1], 65535)
    np.testing.assert_array_equal(texels, np.concatenate([rgb, alpha], axis=-1).astype(np.float32) / np.float32(65535))


def test_layers_of_openexr():
    planes = np.random.default_rng(5).random((4, 5, 7)).astype(np.float32)
    named = dict(zip(("depth.Z", "diffuse.R", "diffuse.G", "diffuse.B"), map(np.ascontiguousarray, planes), strict=True))
    np.testing.assert_array_equal(decode_image(exr(named), "a")[..., :3], np.moveaxis(planes[1:], 0, -1))
    both = {**named, "R": planes[0].copy(), "G": planes[0].copy(), "B": planes[0].copy()}
    np.testing.assert_array_equal(decode_image(exr(both), "a")[..., 1], planes[0])


def test_luminance_and_chroma_of_openexr():
    random = np.random.default_rng(6)
    luminance = random.random((4, 6), np.float32) + 0.5
    red, blue = random.random((2, 2, 3), np.float32) - 0.5
    texels = decode_image(luminance_chroma(luminance, red, blue), "a")
    np.testing.assert_allclose(texels[..., 0], (1 + red.repeat(2, 0).repeat(2, 1)) * luminance, rtol=2.0**-22)
    rebuilt = texels[..., :3] @ np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
    np.testing.assert_allclose(rebuilt, luminance, rtol=2.0**-20)  # 16 roundings of float32


# Each with its problem: none may take more than a moment or what the machine has not.
LIES = {
    "png": (png(60000, 60000, 8, 2, zlib.compress(bytes(1000))), "3600000000 pixels"),
    "just above": (png(16385, 16384, 8, 0, b""), "pixels"),
    "empty png": (png(0, 7, 8, 2, b""), "cannot be read"),
    "exr": (exr({"Y": np.zeros((9, 13), np.float32)}).replace(
        struct.pack("<4i", 0, 0, 12, 8), struct.pack("<4i", 0, 0, 59999, 59999)), "60000 x 60000 pixels"),
    "exr backwards": (exr({"Y": np.zeros((9, 13), np.float32)}).replace(
        struct.pack("<4i", 0, 0, 12, 8), struct.pack("<4i", 2**31 - 1, 0, -(2**31), 8)), "cannot be read"),
    "exr cut": (exr({"Y": np.random.default_rng(1).random((9, 13), np.float32)})[:-9], "cannot be read"),
    "hdr": (b"#?RADIANCE\n\n-Y 99999 +X 99999\n\2\2\0\0", "99999 x 99999 pixels"),
    "hdr short": (b"#?RADIANCE\n\n-Y 16000 +X 16000\n\2\2\x3e\x80" + bytes(100), "cut short"),
    "hdr flat": (b"#?RADIANCE\n\n-Y 16000 +X 5\n" + bytes(100), "cut short"),
    "hdr digits": (b"#?RADIANCE\n\n-Y " + b"9" * 5000 + b" +X 1\n", "no header"),
    "eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\nshowpage\n", "cannot be read"),
    "a format that is not ours": (saved(WHOLE[..., :3], "PCX"), "cannot be read"),
    "text": (b"no image at all", "cannot be read"),
    "nothing": (b"", "cannot be read"),
    "only magic": (EXR_MAGIC, "cannot be read"),
    "cut jpeg": (saved(WHOLE[..., :3], "JPEG")[:-40], "cannot be read"),
    "cut png": (saved(WHOLE, "PNG")[:-40], "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("name", LIES)
def test_images_that_lie_are_refused_at_once(name):
    data, says = LIES[name]
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(InputError, match=f"^picture: .*{says}"):
        decode_image(data, "picture")
    assert time.process_time() - start < 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**20  # KiB


def test_the_largest_image_is_the_one_that_is_told():
    assert MOST_PIXELS == 16384**2


@pytest.mark.parametrize("kind", ["iCCP", "zTXt", "iTXt"])
def test_chunks_that_swell_do_not(kind):
    packed = zlib.compress(bytes(2**27), 9)  # 128 MiB of zeros in 130 kB
    data = {
        "iCCP": chunk(b"iCCP", b"p\0\0" + packed),
        "zTXt": chunk(b"zTXt", b"k\0\0" + packed),
        "iTXt": chunk(b"iTXt", b"k\0\1\0\0\0" + packed),
    }[kind]
    rows = zlib.compress(bytes(2 * 3))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        assert decode_image(png(2, 2, 8, 0, rows, data), "a").shape == (2, 2, 4)
    except InputError:
        pass
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**17  # KiB; the swollen chunk alone has 2^17
    assert PngImagePlugin.MAX_TEXT_CHUNK <= 2**20


MUTATE = """
import io, os, random, sys
import numpy as np
import OpenEXR
from framepairs.errors import InputError
from framepairs.scene.images import decode_image
os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # OpenEXR warns there
seeds, chance = [], random.Random(11)
for name in ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA"):
    buffer = io.BytesIO()
    header = {"compression": getattr(OpenEXR, name + "_COMPRESSION"), "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.random.default_rng(1).random((9, 13, 3)).astype(np.float16)}).write(buffer)
    seeds.append(buffer.getvalue())
for _ in range(400):
    data = bytearray(chance.choice(seeds))
    for _ in range(chance.choice([1, 2, 5])):
        place = 4 + chance.randrange(len(data) - 5)
        if chance.random() < 0.6:
            data[place] = chance.randrange(256)
        elif chance.random() < 0.5:
            data[place : place + 4] = chance.choice([b"\\xff\\xff\\xff\\x7f", bytes(4), b"\\0\\0\\0\\x80"])
        else:
            del data[place : place + chance.randrange(1, 30)]
    try:
        decode_image(bytes(data), "a.exr")
    except InputError:
        pass
print("done")
"""


def test_damaged_openexr_never_ends_the_process():
    result = subprocess.run([sys.executable, "-c", MUTATE], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0 and result.stdout.endswith("done\n"), result.stderr[-500:]


GREY = 128


def written_obj(folder, data):
    (folder / "t.png").write_bytes(data)
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd t.png\nmap_Pr t.png\n")
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    return load_scene(folder / "a.obj")


def written_ply(folder, data):
    (folder / "t.png").write_bytes(data)
    header = "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\n"
    header += "".join(f"property float {name}\n" for name in "xyzst") + "element face 1\n"
    (folder / "a.ply").write_text(
        header + "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    )
    return load_scene(folder / "a.ply")


def written_gltf(folder, data):
    (folder / "t.png").write_bytes(data)
    paint = {"pbrMetallicRoughness": {key: {"index": 0} for key in ("baseColorTexture", "metallicRoughnessTexture")}}
    file = GltfFile(materials=[paint], images=[{"uri": "t.png"}], textures=[{"source": 0}])
    file.node(mesh=file.mesh(TEXCOORD_0=np.zeros((3, 2), np.float32), primitive_keys={"material": 0}))
    return file.load(folder)


@pytest.mark.parametrize("reader", [written_obj, written_ply, written_gltf])
def test_8_and_16_bits_of_one_grey_are_one_albedo(tmp_path, reader):
    found = {}
    for bits, codes in ((8, saved(np.full((2, 2), GREY, np.uint8), "PNG")), (16, deep_png(np.full((2, 2, 1), GREY * 257)))):
        scene = reader(tmp_path, codes)
        material = scene.materials[scene.objects[0].material]
        found[bits] = [
            linear_texels(scene.textures[slot.texture])[0, 0, 1]
            for slot in (material.base_texture, material.surface_texture)
            if slot is not None
        ]
    np.testing.assert_allclose(found[16], found[8], rtol=2**-20)  # 16 roundings of float32
    assert found[8][0] == np.float32(((GREY / 255 + 0.055) / 1.055) ** 2.4)


def test_openexr_is_linear_in_obj(tmp_path):
    data = exr({key: np.full((2, 2), 0.25, np.float32) for key in "RGB"})
    (tmp_path / "t.exr").write_bytes(data)
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd t.exr\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    scene = load_scene(tmp_path / "a.obj")
    np.testing.assert_array_equal(linear_texels(scene.textures[0])[..., :3], 0.25)


def test_warnings_of_openexr_stay_out_of_the_output(capsys):
    data = bytearray(exr({key: np.zeros((8, 8), np.float32) for key in "RGB"}))
    data[-60:] = bytes(60)
    with pytest.raises(InputError, match="OpenEXR"):
        decode_image(bytes(data), "a.exr")
    captured = capsys.readouterr()
    assert captured.out == "" and "Warning" in captured.err
