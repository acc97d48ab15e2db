"""EXR files: what is written comes back, and damage is named."""

import hashlib
import io

import numpy as np
import OpenEXR
import pytest

from framepairs.channels import CHANNEL, CHANNELS
from framepairs.errors import InputError
from framepairs.exr import DTYPE, REC_709, decode, encode, read_checked

SIZES = [(5, 7), (300, 270), (1, 1), (256, 512)]  # height, width: inside one tile, across four, exact tiles


def pixels(channel, height=5, width=7, dtype=None):
    """Values that the file can hold exactly."""
    generator = np.random.default_rng(sum(map(ord, channel.name)))
    shape = (height, width, channel.components)
    stored = dtype or channel.dtype
    if stored == "uint":
        return generator.integers(0, 2**32, shape, dtype=np.uint32)
    return generator.normal(0, 100, shape).astype(DTYPE[stored])


def bytes_of(channel, array, **keys):
    return encode(channel, array, attributes={}, **keys).data


def header_of(data):
    with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
        return dict(file.header())


@pytest.mark.parametrize("channel", CHANNELS, ids=lambda channel: channel.name)
@pytest.mark.parametrize(("height", "width"), SIZES)
def test_every_channel_comes_back_bit_for_bit(tmp_path, channel, height, width):
    array = pixels(channel, height, width)
    back, _ = decode(bytes_of(channel, array), channel.exr, tmp_path / "a.exr")
    assert back.dtype == DTYPE[channel.dtype] and back.flags.c_contiguous
    np.testing.assert_array_equal(back, array)


def test_extremes_of_floats_come_back(tmp_path):
    values = [np.inf, -np.inf, np.nan, 0.0, -0.0, 1e-45, 3.4e38, 1e-38]
    array = np.array(values, dtype=np.float32).reshape(2, 4, 1)
    back, _ = decode(bytes_of(CHANNEL["depth"], array), ("V",), tmp_path)
    assert back.tobytes() == array.tobytes()


def test_large_ids_come_back(tmp_path):
    array = np.array([[[0], [1], [2**31]], [[4_000_000_000], [2**32 - 1], [2**24 + 1]]], dtype=np.uint32)
    back, _ = decode(bytes_of(CHANNEL["object_id"], array), ("I",), tmp_path)
    np.testing.assert_array_equal(back, array)


@pytest.mark.parametrize("name", ["color", "motion", "object_id"])
def test_arrays_in_any_memory_order_are_written_right(tmp_path, name):
    channel = CHANNEL[name]
    array = pixels(channel, 10, 14)
    views = {
        "fortran": np.asfortranarray(array),
        "reversed": np.ascontiguousarray(array[::-1, ::-1])[::-1, ::-1],
        "strided": np.repeat(np.repeat(array, 2, axis=0), 3, axis=1)[::2, ::3],
        "components first": np.ascontiguousarray(np.moveaxis(array, -1, 0)).transpose(1, 2, 0),
    }
    expected = bytes_of(channel, array)
    for what, view in views.items():
        assert bytes_of(channel, view) == expected, what


def test_colours_can_be_floats(tmp_path):
    array = pixels(CHANNEL["color"], dtype="float") * 1e30
    encoded = encode(CHANNEL["color"], array, attributes={}, dtype="float")
    back, _ = decode(encoded.data, ("R", "G", "B"), tmp_path)
    np.testing.assert_array_equal(back, array)
    assert encoded.saturated == 0


def test_what_a_half_cannot_hold_saturates_and_is_counted(tmp_path):
    array = np.zeros((5, 7, 3), dtype=np.float32)
    array[0, :4, 0] = 65504, 65505, np.inf, 1e9
    array[4, 6] = -np.inf, -65504, -7e4
    given = array.copy()
    encoded = encode(CHANNEL["color"], array, attributes={})
    back, _ = decode(encoded.data, ("R", "G", "B"), tmp_path)
    assert encoded.saturated == 5
    np.testing.assert_array_equal(back, np.clip(given, -65504, 65504).astype(np.float16))
    np.testing.assert_array_equal(array, given)  # the caller's array is as it was


def test_floats_round_to_the_nearest_half(tmp_path):
    # Between 1 and 2 halves are 2^-10 apart: 1 + 3/8 of a step goes down, 1 + 5/8 goes up.
    array = np.float32([1 + 0.375 * 2**-10, 1 + 0.625 * 2**-10]).reshape(1, 2, 1)
    back, _ = decode(bytes_of(CHANNEL["roughness"], array), ("V",), tmp_path)
    assert back.ravel().tolist() == [1, 1 + 2**-10]


def test_equal_arrays_give_equal_bytes_and_the_hash_is_theirs():
    array = pixels(CHANNEL["color"], 300, 270)
    first, second = (encode(CHANNEL["color"], array.copy(), attributes={"framepairs:stream": "hr"}) for _ in range(2))
    assert first == second
    assert first.sha256 == hashlib.sha256(first.data).hexdigest()


def test_headers_say_what_the_file_holds():
    attributes = {"framepairs:stream": "lr_x2"}
    data = encode(CHANNEL["motion"], pixels(CHANNEL["motion"], 300, 270), attributes=attributes).data
    header = header_of(data)
    assert header["framepairs:channel"] == "motion" and header["framepairs:stream"] == "lr_x2"
    assert header["framepairs:unit"] == CHANNEL["motion"].unit
    assert header["framepairs:sampling"] == "one sample per pixel"
    assert "chromaticities" not in header
    assert (header["type"], header["compression"]) == (OpenEXR.tiledimage, OpenEXR.ZIP_COMPRESSION)
    assert (header["tiles"].xSize, header["tiles"].ySize) == (256, 256)
    assert header["dataWindow"][1].tolist() == [269, 299]
    assert attributes == {"framepairs:stream": "lr_x2"}


@pytest.mark.parametrize("name", ["color", "emission", "albedo", "brdf"])
def test_colours_carry_the_primaries_of_rec_709(name):
    # Rec. ITU-R BT.709-6, item 1.3 and D65
    assert REC_709 == (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    found = header_of(bytes_of(CHANNEL[name], pixels(CHANNEL[name])))["chromaticities"]
    np.testing.assert_array_equal(np.float32(found), np.float32(REC_709))


def test_a_missing_channel_is_named(tmp_path):
    file = tmp_path / "a.exr"
    with pytest.raises(InputError, match=f"^{file}: EXR channel Z is missing .*X, Y"):
        decode(bytes_of(CHANNEL["motion"], pixels(CHANNEL["motion"])), ("X", "Z"), file)


@pytest.mark.parametrize("name", ["color", "depth"])
def test_damaged_files_are_named(tmp_path, name):
    channel = CHANNEL[name]
    encoded = encode(channel, pixels(channel, 300, 270), attributes={})
    file = tmp_path / f"{name}.exr"
    flipped = bytearray(encoded.data)
    flipped[len(flipped) * 2 // 3] ^= 1
    cut = encoded.data[: len(encoded.data) // 2]
    for data in (bytes(flipped), cut, b""):
        file.write_bytes(data)
        with pytest.raises(InputError, match=f"^{file}: .*sha256"):
            read_checked(file, encoded.sha256, channel.exr)
    file.write_bytes(encoded.data)
    assert read_checked(file, encoded.sha256, channel.exr).shape == (300, 270, channel.components)
    file.unlink()
    with pytest.raises(InputError, match=f"^{file}: cannot be read: No such file"):
        read_checked(file, encoded.sha256, channel.exr)


@pytest.mark.parametrize("kept", [0, 3, 4, 8, 40, 200, 400, 0.3, 0.5, 0.9, 0.999])
def test_cut_files_are_named_without_a_hash_as_well(tmp_path, kept):
    data = bytes_of(CHANNEL["color"], pixels(CHANNEL["color"], 300, 270))
    file = tmp_path / "a.exr"
    file.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    with pytest.raises(InputError, match=f"^{file}: "):
        read_checked(file, None, ("R", "G", "B"))


@pytest.mark.parametrize("data", [b"no image at all", b"\x89PNG\r\n\x1a\n" + bytes(100), b"\x76\x2f\x31\x01" + b"\xff" * 300])
def test_files_that_are_no_exr_are_named(tmp_path, data):
    file = tmp_path / "a.exr"
    file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: "):
        read_checked(file, None, ("R", "G", "B"))
