"""The render plan: defaults, what is refused, and the streams that follow from it."""

import math

import pytest

from framepairs.channels import CHANNEL
from framepairs.errors import InputError
from framepairs.manifest import to_json
from framepairs.plan import RenderPlan, jitter_length, make_plan, plan_streams, read_plan


def test_defaults_are_those_of_the_readme():
    plan = make_plan({})
    assert plan == RenderPlan()
    assert (plan.version, plan.display, plan.scales, plan.variants) == (1, (1920, 1080), (2.0,), ("native", "jittered_mip"))
    assert (plan.shading, plan.antialiasing, plan.channels, plan.color_precision) == ("raster", 16, "needed", "half")
    assert (plan.jitter_length, plan.mip_bias_offset, plan.hr_native, plan.seed) == (None, 0.0, False, 0)


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"scale": [2]}, "scale"),
        ({"version": 2}, "version"),
        ({"scales": [0.5]}, r"scales\.0"),
        ({"scales": [2, 0.999]}, r"scales\.1"),
        ({"scales": [math.nan]}, r"scales\.0"),
        ({"scales": [math.inf]}, r"scales\.0"),
        ({"scales": [2, 2]}, "scales.*twice"),
        ({"scales": [2, 3, 2.0]}, "scales.*twice"),
        ({"variants": ["native", "native"]}, "variants.*twice"),
        ({"variants": ["sharp"]}, r"variants\.0"),
        ({"display": [0, 1080]}, r"display\.0"),
        ({"display": [1920, -1]}, r"display\.1"),
        ({"display": [1920.5, 1080]}, r"display\.0"),
        ({"display": [1920]}, "display"),
        ({"antialiasing": 0}, "antialiasing"),
        ({"jitter_length": 0}, "jitter_length"),
        ({"mip_bias_offset": math.nan}, "mip_bias_offset"),
        ({"brdf_floor": 0}, "brdf_floor"),
        ({"seed": -1}, "seed"),
        ({"seed": 2**32}, "seed"),
        ({"channels": ["color", "flow"]}, "channels: unknown 'flow'; known are color,"),
        ({"channels": "some"}, "channels"),
    ],
)
def test_bad_values_are_refused_by_file_and_field(values, field):
    with pytest.raises(InputError, match=f"^plan.json[,:].*{field}"):
        make_plan(values, file="plan.json")


def test_all_channels_can_be_named():
    assert make_plan({"channels": list(CHANNEL)}).channels == tuple(CHANNEL)


# floor(d / S + 0.5) by hand: 1080 / 2.7 = 400, 1920 / 2.7 = 711.1, 540 / 2.7 = 200, 960 / 2.7 = 355.6
@pytest.mark.parametrize(
    ("display", "sizes"),
    [
        ((1920, 1080), {"2": (960, 540), "3": (640, 360), "2.7": (711, 400)}),
        ((960, 540), {"2": (480, 270), "3": (320, 180), "2.7": (356, 200)}),
    ],
)
def test_streams_of_a_plan(display, sizes):
    plan = make_plan({"display": display, "scales": [2, 3, 2.7]})
    streams = plan_streams(plan)
    assert [stream.name for stream in streams] == [
        "hr",
        "lr_x2",
        "lr_x2_jittered_mip-1",
        "lr_x3",
        "lr_x3_jittered_mip-1.585",  # log2(3) = 1.58496
        "lr_x2.7",
        "lr_x2.7_jittered_mip-1.433",  # log2(2.7) = 1.43296
    ]
    assert (streams[0].size, streams[0].samples, streams[0].mip_bias) == (display, 16, -2)
    assert [stream.size for stream in streams[1:]] == [sizes[s] for s in ("2", "2", "3", "3", "2.7", "2.7")]
    assert [stream.scale for stream in streams] == [1, 2, 2, 3, 3, 2.7, 2.7]
    assert [stream.jittered for stream in streams] == [False] + 3 * [False, True]
    assert all(stream.samples == 1 for stream in streams[1:])
    assert streams[-1].mip_bias == -math.log2(2.7)  # exactly: the name is rounded, the number is not


def test_variants_set_jitter_and_bias_apart():
    plan = make_plan({"variants": ["jittered", "mip"], "mip_bias_offset": -1})
    _, jittered, biased = plan_streams(plan)
    assert (jittered.name, jittered.jittered, jittered.mip_bias) == ("lr_x2_jittered", True, 0)
    assert (biased.name, biased.jittered, biased.mip_bias) == ("lr_x2_mip-2", False, -2)


def test_hr_native_is_one_sample_without_bias():
    streams = plan_streams(make_plan({"hr_native": True, "display": [50, 70]}))
    assert [stream.name for stream in streams[:2]] == ["hr", "hr_native"]
    assert (streams[1].size, streams[1].samples, streams[1].mip_bias, streams[1].jittered) == ((50, 70), 1, 0, False)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"scales": [2, 2.0004]}, "lr_x2"),
        ({"scales": [2], "variants": ["native", "mip"], "mip_bias_offset": 1}, "lr_x2"),  # -log2(2) + 1 = 0
    ],
)
def test_two_streams_with_one_name_are_refused(values, name):
    with pytest.raises(InputError, match=f"two streams the name '{name}'"):
        make_plan(values)


def test_jitter_length_follows_the_scale_unless_set():
    assert [jitter_length(make_plan({}), scale) for scale in (2, 3, 2.7)] == [32, 72, 58]
    assert jitter_length(make_plan({"jitter_length": 16}), 2.7) == 16


def test_a_dumped_plan_reads_back_equal(tmp_path):
    plan = make_plan(
        {"display": [51, 37], "scales": [2.7, 1.1], "hr_native": True, "channels": ["color", "motion"], "seed": 7}
    )
    file = tmp_path / "plan.json"
    file.write_bytes(to_json(plan))
    assert make_plan(read_plan(file), file=file) == plan


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (None, "No such file"),
        (b"{", "not JSON"),
        (b"[1]", "JSON object"),
        (b"\xff\xfe{", "not JSON"),
        (b"[" * 100_000, "not JSON"),  # deeper than Python's recursion
    ],
)
def test_a_file_that_is_no_plan_is_named(tmp_path, data, says):
    file = tmp_path / "plan.json"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: .*{says}"):
        read_plan(file)


def test_hr_mip0_is_the_truth_without_bias():
    streams = plan_streams(make_plan({"hr_mip0": True, "antialiasing": 8}))
    assert [stream.name for stream in streams[:2]] == ["hr", "hr_mip0"]
    assert (streams[0].mip_bias, streams[1].mip_bias, streams[1].samples) == (-1.5, 0.0, 8)


def test_the_enhanced_truth_of_qrisp_has_32_samples_at_bias_minus_one():
    plan = make_plan({"antialiasing_pattern": "qrisp_enhanced"})
    truth = plan_streams(plan)[0]
    assert (truth.samples, truth.mip_bias, truth.pattern) == (32, -1.0, "qrisp_enhanced")
    with pytest.raises(InputError, match="32 samples, not 16"):
        make_plan({"antialiasing_pattern": "qrisp_enhanced", "antialiasing": 16})
