"""Sizes, names and numbers of streams, and the channel table."""

import math

import pytest

from framepairs.channels import CHANNELS, MOTION_CHANNELS
from framepairs.conventions import (
    CONVENTIONS,
    Stream,
    default_mip_bias,
    frame_name,
    lr_size,
    lr_stream_name,
    short_number,
    truth_mip_bias,
)

# What outsiders rely on: names in this order, the names inside the EXR files, and dtypes.
EXPECTED = {
    "color": (("R", "G", "B"), "half"),
    "color_variance": (("R", "G", "B"), "float"),
    "emission": (("R", "G", "B"), "half"),
    "albedo": (("R", "G", "B"), "half"),
    "normal": (("X", "Y", "Z"), "half"),
    "depth": (("V",), "float"),
    "roughness": (("V",), "half"),
    "metallic": (("V",), "half"),
    "specular": (("V",), "half"),
    "object_id": (("I",), "uint"),
    "motion": (("X", "Y"), "float"),
    "dual_motion": (("X", "Y"), "float"),
    "visibility": (("I",), "uint"),
    "brdf": (("R", "G", "B"), "half"),
    "transparency": (("V",), "half"),
    "overlay": (("V",), "half"),
}


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (2.0, "2"),
        (2.7, "2.7"),
        (2.75, "2.75"),
        (-1.433, "-1.433"),
        (-math.log2(2.7), "-1.433"),
        (-math.log2(3), "-1.585"),
        (10, "10"),
        (100.0, "100"),
        (1.0001, "1"),
        (0.9996, "1"),
        (0.05, "0.05"),
        (0.0, "0"),
        (-0.0, "0"),
        (-0.0004, "0"),
        (-0.0006, "-0.001"),
    ],
)
def test_numbers_are_written_as_short_as_they_are_exact_to_three_decimals(value, written):
    assert short_number(value) == written


@pytest.mark.parametrize(
    ("display", "scale", "size"),
    [
        ((1920, 1080), 2.7, (711, 400)),
        ((960, 540), 2.7, (356, 200)),
        ((1920, 1080), 1, (1920, 1080)),
        ((5, 7), 2, (3, 4)),  # halves go up: 2.5 and 3.5
        ((5, 7), 3, (2, 2)),
        ((1, 70), 64, (1, 1)),
        ((16384, 1), 1.5, (10923, 1)),
    ],
)
def test_sizes_are_rounded_per_axis_and_never_empty(display, scale, size):
    assert lr_size(display, scale) == size


def test_effective_scale_is_per_axis():
    # DESIGN: 1920 x 1080 at 2.7 is 711 x 400; the width's scale is not the nominal one.
    assert Stream(name="lr", size=(711, 400), scale=2.7).effective_scale((1920, 1080)) == (1920 / 711, 2.7)


def test_stream_names():
    assert lr_stream_name(2, jittered=False, mip_bias=0) == "lr_x2"
    assert lr_stream_name(2, jittered=True, mip_bias=0.0) == "lr_x2_jittered"
    assert lr_stream_name(3, jittered=False, mip_bias=-1.5) == "lr_x3_mip-1.5"
    assert lr_stream_name(2.7, jittered=True, mip_bias=-math.log2(2.7)) == "lr_x2.7_jittered_mip-1.433"


def test_frame_names_have_six_digits():
    assert [frame_name(frame) for frame in (0, 31, 999999)] == ["000000", "000031", "999999"]


@pytest.mark.parametrize(("scale", "bias"), [(1, 0), (2, -1), (4, -2), (2.7, -1.432959407)])
def test_default_mip_bias_is_minus_log2_of_the_scale(scale, bias):
    assert default_mip_bias(scale) == pytest.approx(bias, abs=1e-9)  # as many digits as are written above
    assert default_mip_bias(scale, -1) == pytest.approx(bias - 1, abs=1e-9)


@pytest.mark.parametrize(("samples", "bias"), [(1, 0), (4, -1), (16, -2), (8, -1.5)])
def test_truth_mip_bias_is_minus_half_log2_of_the_samples(samples, bias):
    assert truth_mip_bias(samples) == bias


def test_no_bias_is_a_negative_zero():
    # JSON would hold "-0.0"
    assert [math.copysign(1, value) for value in (truth_mip_bias(1), default_mip_bias(1))] == [1, 1]


def test_the_channel_table_is_that_of_the_format():
    assert {channel.name: (channel.exr, channel.dtype) for channel in CHANNELS} == EXPECTED
    assert [channel.name for channel in CHANNELS] == list(EXPECTED)


def test_components_and_bytes_follow_from_the_table():
    size = {"half": 2, "float": 4, "uint": 4}
    for channel in CHANNELS:
        assert channel.components == len(channel.exr)
        assert channel.bytes_per_pixel == len(channel.exr) * size[channel.dtype]
    # By hand: four colours and the normal at 6, variance 12, five half scalars at 2, depth 4, two motions at 8, two bits at 4.
    assert sum(channel.bytes_per_pixel for channel in CHANNELS) == 80


def test_only_light_is_averaged():
    averaged = {channel.name for channel in CHANNELS if channel.averaged}
    assert averaged == {"color", "color_variance", "emission", "brdf", "transparency", "overlay"}


def test_backgrounds_have_as_many_components_as_their_channel():
    background = {channel.name: channel.background for channel in CHANNELS}
    for channel in CHANNELS:
        assert channel.background is None or len(channel.background) == channel.components
    # The sky has colour, emission, motion, dual motion and visibility of its own.
    assert {name for name, value in background.items() if value is None} == {"color", "emission", *MOTION_CHANNELS}
    assert background["depth"] == (math.inf,)
    assert all(set(value) == {0} for name, value in background.items() if value and name != "depth")


def test_every_channel_says_what_it_means():
    for channel in CHANNELS:
        assert channel.meaning and channel.unit and channel.needed_by and channel.frame_of_reference
    assert all(CONVENTIONS.values())
