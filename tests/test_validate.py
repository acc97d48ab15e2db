"""The validator passes a healthy corpus, and names each planted mistake with the right check."""

import json
import shutil

import numpy as np
import pytest

from framepairs.channels import CHANNEL
from framepairs.corpus import Corpus
from framepairs.exr import encode
from framepairs.manifest import FrameRecord, from_json, to_json
from framepairs.validate import CHECKS, validate_corpus

SEQUENCE, STREAM = "two_quads_slide", "lr_x2"


def verdicts(folder) -> dict[str, str]:
    return {result.id: result.verdict for result in validate_corpus(Corpus(folder))}


def failed(folder) -> set[str]:
    return {check for check, verdict in verdicts(folder).items() if verdict == "fail"}


@pytest.fixture
def copy(two_quads_corpus, tmp_path):
    return shutil.copytree(two_quads_corpus, tmp_path / "corpus")


def record_file(folder, frame):
    return folder / SEQUENCE / "frames" / f"{frame:06d}.json"


def rewrite(folder, channel, frame, change, stream=STREAM):
    """Replace a channel's array, its file and its recorded hash, as a faulty generator would have written them."""
    corpus = Corpus(folder)
    array = change(corpus.read(SEQUENCE, stream, channel, frame).copy())
    encoded = encode(CHANNEL[channel], array, attributes={})
    file, _ = corpus.file_of(SEQUENCE, stream, channel, frame)
    file.write_bytes(encoded.data)
    record: FrameRecord = from_json(FrameRecord, record_file(folder, frame))
    name = file.relative_to(folder / SEQUENCE).as_posix()
    files = [
        item.model_copy(update={"sha256": encoded.sha256, "size": len(encoded.data)}) if item.path == name else item
        for item in record.files
    ]
    record_file(folder, frame).write_bytes(to_json(record.model_copy(update={"files": files})))


def test_a_healthy_corpus_passes_every_check(two_quads_corpus):
    assert verdicts(two_quads_corpus) == {check.id: "pass" for check in CHECKS}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("negated", lambda m: -m),
        ("y flipped", lambda m: m * np.float32([1, -1])),
        ("swapped", lambda m: m[..., ::-1].copy()),
        ("halved", lambda m: m / 2),
        ("doubled", lambda m: m * 2),
        ("none", lambda m: m * 0),
        ("jitter left in", lambda m: m + np.float32([0.21, -0.13])),
    ],
)
def test_wrong_motion_fails_the_warp_check(copy, name, change):
    for frame in (1, 2, 3):
        rewrite(copy, "motion", frame, change)
    assert "warp_place" in failed(copy), name


def test_motion_of_the_camera_alone_is_found(copy):
    """The sliding card's own motion is missing: its pixels get the motion of a still card."""
    corpus = Corpus(copy)
    for frame in (1, 2, 3):
        card = corpus.read(SEQUENCE, STREAM, "object_id", frame)[..., 0] == 2
        rewrite(copy, "motion", frame, lambda m, card=card: np.where(card[..., None], m * 0, m))
    assert failed(copy) & {"warp_place", "warp_object"}


def plant_still(folder):
    rewrite(folder, "motion", 9, lambda m: m + np.float32(1e-6))


def plant_nan(folder):
    def change(color):
        color[3, 4, 1] = np.nan
        return color

    rewrite(folder, "color", 2, change)


def plant_long_normal(folder):
    rewrite(folder, "normal", 2, lambda n: n * np.float32(1.1))


def plant_finite_background(folder):
    rewrite(folder, "depth", 2, lambda d: np.where(np.isinf(d), np.float32(1e4), d), stream="lr_x3")
    rewrite(folder, "object_id", 2, lambda i: i * (np.arange(i.shape[1]) > 2)[None, :, None].astype(np.uint32), stream="lr_x3")


def plant_reset(folder):
    rewrite(folder, "motion", 4, lambda m: m + 1)


def plant_dual(folder):
    rewrite(folder, "dual_motion", 3, lambda m: m + 1)


def plant_jitter(folder):
    record = json.loads(record_file(folder, 5).read_text())
    record["streams"]["lr_x2_jittered_mip-1"]["jitter"][0] += 0.01
    record_file(folder, 5).write_text(json.dumps(record))


def plant_unknown_key(folder):
    record = json.loads(record_file(folder, 5).read_text())
    record["renderer"] = "ours"
    record_file(folder, 5).write_text(json.dumps(record))


def plant_flipped_bit(folder):
    file, _ = Corpus(folder).file_of(SEQUENCE, "hr", "color", 6)
    data = bytearray(file.read_bytes())
    data[-100] ^= 4
    file.write_bytes(data)


def plant_missing_file(folder):
    Corpus(folder).file_of(SEQUENCE, "hr", "depth", 6)[0].unlink()


def plant_empty_file(folder):
    Corpus(folder).file_of(SEQUENCE, STREAM, "albedo", 6)[0].write_bytes(b"")


def plant_surplus(folder):
    (folder / SEQUENCE / "hr" / "color" / "000099.exr").write_bytes(b"left over")


def plant_bad_table(folder):
    next((folder / "tables").iterdir()).write_bytes(b"bad")


def plant_missing_stream(folder):
    record = json.loads(record_file(folder, 7).read_text())
    del record["streams"]["lr_x3"]
    record_file(folder, 7).write_text(json.dumps(record))


def plant_other_key(folder):
    record = json.loads(record_file(folder, 7).read_text())
    record_file(folder, 7).write_text(json.dumps(record | {"key": "0" * 64}))


@pytest.mark.parametrize(
    ("plant", "check"),
    [
        (plant_still, "still"), (plant_nan, "finite"), (plant_long_normal, "range"), (plant_finite_background, "range"),
        (plant_reset, "reset"), (plant_dual, "dual_motion"), (plant_jitter, "jitter"), (plant_unknown_key, "schema"),
        (plant_flipped_bit, "files"), (plant_missing_file, "files"), (plant_empty_file, "files"), (plant_surplus, "surplus"),
        (plant_bad_table, "complete"), (plant_missing_stream, "complete"), (plant_other_key, "complete"),
    ],
)  # fmt: skip
def test_each_mistake_fails_its_own_check(copy, plant, check):
    plant(copy)
    assert check in failed(copy)


def test_the_worst_places_are_named(copy):
    plant_nan(copy)
    result = next(r for r in validate_corpus(Corpus(copy)) if r.id == "finite")
    assert result.figure == 1 and "frame 2" in result.worst[0] and "color" in result.worst[0]
