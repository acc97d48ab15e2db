"""The JSON files of a corpus: equal bytes, named errors, whole files, keys."""

import json
import math

import pytest

from framepairs.errors import InputError, MachineError
from framepairs.manifest import (
    FrameRecord,
    SequenceIndex,
    frame_key,
    from_json,
    make_folder,
    rebuild_sequence_index,
    to_json,
    write_atomically,
)

IDENTITY = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
CAMERA = {"fov_y_rad": 0.7853981633974483, "near": 0.1, "far": 1e4} | {
    f"{which}{name}": IDENTITY for which in ("", "previous_") for name in ("view_from_world", "clip_from_view")
}
STREAM = {"size": (711, 400), "scale": (1920 / 711, 2.7), "jitter": (1 / 3 - 0.5, 0.0), "mip_bias": -1.433, "saturated": 0}


def record(frame=0, streams=("hr", "lr_x2"), sizes=(10, 7)):
    return FrameRecord(
        frame=frame,
        time_s=frame / 24,
        frame_time_ms=1000 / 24,
        reset=frame == 0,
        exposure_ev=0,
        camera=CAMERA,
        streams={name: STREAM for name in streams},
        files=[{"path": f"hr/{k}.exr", "sha256": "0" * 64, "size": size} for k, size in enumerate(sizes)],
        key=f"{frame:064x}",
    )


def test_json_is_sorted_and_the_same_each_time(tmp_path):
    data = to_json(record(streams=("lr_x2", "hr")))
    assert data == to_json(record(streams=("hr", "lr_x2")))
    values = json.loads(data)
    assert list(values) == sorted(values) and list(values["streams"]) == ["hr", "lr_x2"]
    assert data.endswith(b"}\n")


def test_records_read_back_equal_to_the_last_bit(tmp_path):
    file = tmp_path / "000003.json"
    file.write_bytes(to_json(record(3)))
    assert from_json(FrameRecord, file) == record(3)


def test_names_outside_ascii_stay_readable(tmp_path):
    index = SequenceIndex(sequence="Straße_日", frames=[], streams=[], bytes=0)
    file = tmp_path / "sequence.json"
    file.write_bytes(to_json(index))
    assert "Straße_日".encode() in file.read_bytes()
    assert from_json(SequenceIndex, file) == index


def test_numbers_that_json_has_not_are_never_written():
    broken = record().model_copy(update={"exposure_ev": math.nan})
    with pytest.raises(ValueError):
        to_json(broken)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"colour": 1}, "colour: Extra inputs"),
        ({"camera": {**CAMERA, "shift": 0}}, r"camera\.shift: Extra inputs"),
        ({"camera": {**CAMERA, "view_from_world": IDENTITY[:3]}}, r"camera\.view_from_world: "),
        ({"key": "0" * 63}, "key: "),
        ({"files": [{"path": "a", "sha256": "x" * 64, "size": 1}]}, r"files\.0\.sha256: "),
        ({"frame": None}, "frame: "),
    ],
)
def test_wrong_records_are_refused_by_file_and_field(tmp_path, change, says):
    file = tmp_path / "000000.json"
    file.write_text(json.dumps({**json.loads(to_json(record())), **change}))
    with pytest.raises(InputError, match=f"^{file}, {says}"):
        from_json(FrameRecord, file)


@pytest.mark.parametrize("data", [None, b"", b"{", b"\xff\xfe", b"[]", b"[" * 100_000])
def test_files_that_are_no_records_are_named(tmp_path, data):
    file = tmp_path / "000000.json"
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(InputError, match=f"^{file}: "):
        from_json(FrameRecord, file)


def test_files_are_written_whole_into_new_folders(tmp_path):
    file = tmp_path / "a" / "b" / "c.json"
    write_atomically(file, b"first")
    write_atomically(file, b"second")
    assert file.read_bytes() == b"second"
    assert list(file.parent.iterdir()) == [file]


def test_a_target_that_is_a_folder_leaves_nothing_behind(tmp_path):
    target = tmp_path / "c.json"
    target.mkdir()
    with pytest.raises(MachineError, match=f"^{target}: cannot be written: "):
        write_atomically(target, b"data")
    assert list(tmp_path.iterdir()) == [target]


def test_a_parent_that_is_a_file_is_named(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(MachineError, match=f"^{tmp_path}/a/c.json: cannot be written: "):
        write_atomically(tmp_path / "a" / "c.json", b"data")


def test_an_interrupted_write_keeps_the_old_file_and_leaves_nothing(tmp_path, monkeypatch):
    file = tmp_path / "c.json"
    write_atomically(file, b"old")

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(file, b"new")
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_an_output_folder_that_cannot_be_made_is_bad_input(tmp_path):
    (tmp_path / "a").touch()
    for folder in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(InputError, match=f"^{folder}: cannot be written into: "):
            make_folder(folder)
    make_folder(tmp_path / "c" / "d")
    assert list((tmp_path / "c" / "d").iterdir()) == []


def test_the_key_of_a_frame_changes_with_any_value_and_not_with_their_order():
    values = {"seed": 0, "size": [5, 7], "camera": {"near": 0.1, "far": 100.0}, "path": None, "reset": True}
    key = frame_key(values)
    assert len(key) == 64
    assert frame_key(dict(reversed(values.items()))) == key
    assert frame_key({**values, "camera": {"far": 100, "near": 0.1}}) == key  # 100 and 100.0 are one JSON number
    changed = [
        {**values, "seed": 1},
        {**values, "size": [7, 5]},
        {**values, "camera": {"near": math.nextafter(0.1, 1), "far": 100.0}},
        {**values, "path": ""},
        {**values, "reset": False},
        {**values, "more": None},
    ]
    assert len({key, *map(frame_key, changed)}) == 1 + len(changed)


def test_a_sequence_index_is_rebuilt_from_its_records(tmp_path):
    folder = tmp_path / "market_market"
    for frame, streams in ((10, ("hr", "lr_x2")), (2, ("hr", "lr_x2", "lr_x3"))):
        write_atomically(folder / "frames" / f"{frame:06d}.json", to_json(record(frame, streams)))
    (folder / "frames" / ".000003.json.99.part").write_bytes(b"cut")
    index = rebuild_sequence_index(folder)
    assert [(entry.frame, entry.time_s, entry.reset) for entry in index.frames] == [(2, 2 / 24, False), (10, 10 / 24, False)]
    assert (index.sequence, index.streams, index.bytes) == ("market_market", ["hr", "lr_x2"], 34)
    assert from_json(SequenceIndex, folder / "sequence.json") == index
    assert rebuild_sequence_index(folder) == index


def test_a_sequence_without_frames_has_an_index(tmp_path):
    index = rebuild_sequence_index(tmp_path / "none")
    assert (index.frames, index.streams, index.bytes) == ([], [], 0)


def test_a_broken_record_is_a_frame_that_is_not_whole(tmp_path):
    """It is left out, so that a render of other frames can end; rendering its frame writes it anew, validating names it."""
    write_atomically(tmp_path / "s" / "frames" / "000000.json", b"{")
    assert rebuild_sequence_index(tmp_path / "s").frames == []
