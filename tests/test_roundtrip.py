"""What upscaling proves about a corpus: healthy ones show every relation, and each fault breaks the relation that names it."""

import json
import shutil

import numpy as np
import pytest

from framepairs.corpus import Corpus
from framepairs.upscaling.roundtrip import DECLARED, RELATIONS, roundtrip
from sample_corpus import MOVING, render_two_quads
from test_cli import framepairs

NATIVE, JITTERED, BIASED = "lr_x2", "lr_x2_jittered", "lr_x2_jittered_mip-1"
JITTER_FAULTS = {
    "negated": lambda jitters, k: (-jitters[k][0], -jitters[k][1]),
    "flipped x": lambda jitters, k: (-jitters[k][0], jitters[k][1]),
    "flipped y": lambda jitters, k: (jitters[k][0], -jitters[k][1]),
    "swapped": lambda jitters, k: jitters[k][::-1],
    "one frame late": lambda jitters, k: jitters[k - 1],
    "absent": lambda jitters, k: (0.0, 0.0),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("roundtrip") / "c"
    return render_two_quads(out, scales=(2,), variants=("native", "jittered", "jittered_mip"))


class Faulty(Corpus):
    """A corpus whose arrays, or whose records' jitter, are changed as they are read."""

    def __init__(self, folder, *, array=None, jitter=None):
        super().__init__(folder)
        self.array, self.jitter = array, jitter

    def read(self, sequence, stream, channel, frame):
        changed = self.array(super().read, sequence, stream, channel, frame) if self.array else None
        return super().read(sequence, stream, channel, frame) if changed is None else changed

    def record(self, sequence, frame):
        record = super().record(sequence, frame)
        if self.jitter is None:
            return record
        streams = {}
        for name, entry in record.streams.items():
            jitters = [super(Faulty, self).record(sequence, k).streams[name].jitter for k in self.frames(sequence)]
            changed = self.jitter(jitters, frame) if "jittered" in name else entry.jitter
            streams[name] = entry.model_copy(update={"jitter": changed})
        return record.model_copy(update={"streams": streams})


def broken(corpus) -> set[str]:
    return {verdict.id for verdict in roundtrip(corpus) if verdict.verdict == "broken"}


def test_a_healthy_corpus_shows_every_relation(folder):
    verdicts = roundtrip(Corpus(folder))
    assert [verdict.id for verdict in verdicts] == [*(relation.id for relation in RELATIONS), *DECLARED]
    assert {verdict.verdict for verdict in verdicts} == {"holds"}
    assert all(verdict.figure >= verdict.needed and verdict.scale == 2 for verdict in verdicts)


@pytest.mark.parametrize("fault", JITTER_FAULTS)
def test_wrong_jitter_breaks_convergence(folder, fault):
    found = broken(Faulty(folder, jitter=JITTER_FAULTS[fault]))
    if fault == "absent":  # no other hypothesis is left to compare with
        assert "jittered_beats_unjittered" in found
    else:
        assert found >= {"declared_jitter_wins"} and found & {"converges", "accumulation_beats_bicubic"}


@pytest.mark.parametrize("fault", [name for name in JITTER_FAULTS if name != "absent"])
def test_wrong_jitter_is_seen_where_everything_moves(folder, fault):
    corpus = Faulty(folder, jitter=JITTER_FAULTS[fault])
    corpus.frames = lambda sequence: list(range(MOVING))
    verdicts = {verdict.id: verdict for verdict in roundtrip(corpus)}
    assert verdicts["converges"].verdict == "not applicable"
    assert verdicts["declared_jitter_wins"].verdict == "broken" and verdicts["declared_jitter_wins"].why.startswith("closest: ")


def test_pictures_that_are_not_jittered_break_what_jitter_gains(folder):
    def still(read, sequence, stream, channel, frame):
        return read(sequence, NATIVE, channel, frame) if "jittered" in stream else None

    assert "jittered_beats_unjittered" in broken(Faulty(folder, array=still))


def test_pictures_that_are_not_biased_break_what_bias_gains(folder):
    def unbiased(read, sequence, stream, channel, frame):
        return read(sequence, JITTERED, channel, frame) if stream == BIASED else None

    assert "bias_beats_native" in broken(Faulty(folder, array=unbiased))


@pytest.mark.parametrize(("which", "relation"), [("hr", "history_beats_bicubic"), ("lr", "lr_history_beats_bicubic")])
@pytest.mark.parametrize("factor", [(-1, -1), (2, 2), (-1, 1)], ids=["negated", "doubled", "x flipped"])
def test_wrong_motion_breaks_what_history_gains(folder, which, relation, factor):
    def wrong(read, sequence, stream, channel, frame):
        if channel == "motion" and stream.startswith(which):
            return read(sequence, stream, channel, frame) * np.float32(factor)
        return None

    found = broken(Faulty(folder, array=wrong))
    assert relation in found and ("declared_motion_wins" if which == "hr" else "declared_lr_motion_wins") in found


def test_light_that_changes_where_nothing_moves_is_no_fault(folder):
    """A fade, and a flash while the card moves: truth and LR agree, and no relation may blame the data."""
    for gain in (lambda frame: 1 - 0.03 * frame, lambda frame: 4 if frame == 2 else 1):

        def lit(read, sequence, stream, channel, frame, gain=gain):
            light = channel in ("color", "emission")
            return read(sequence, stream, channel, frame) * np.float32(gain(frame)) if light else None

        assert not broken(Faulty(folder, array=lit))


def test_black_frames_are_no_fault_and_no_proof(folder):
    def black(read, sequence, stream, channel, frame):
        dark = channel in ("color", "emission") and frame < 3
        return 0 * read(sequence, stream, channel, frame) if dark else None

    assert not broken(Faulty(folder, array=black))


def test_displaced_guides_break_what_they_gain(folder):
    def displaced(read, sequence, stream, channel, frame):
        if stream == "hr" and channel not in ("color", "motion", "visibility"):
            return np.roll(read(sequence, stream, channel, frame), (7, 9), (0, 1))
        return None

    assert "guides_beat_color" in broken(Faulty(folder, array=displaced))


def test_material_that_is_not_the_colours_breaks_what_demodulation_gains(folder):
    def foreign(read, sequence, stream, channel, frame):
        return np.roll(read(sequence, stream, channel, frame), 7, 1) if (channel, stream) == ("brdf", "hr") else None

    assert "demodulation_beats_none" in broken(Faulty(folder, array=foreign))


def test_what_cannot_be_judged_says_why(tmp_path):
    bare = Corpus(render_two_quads(tmp_path / "c", scales=(2,), channels=("color", "depth"), antialiasing=1))
    why = {verdict.id: verdict.why for verdict in roundtrip(bare) if verdict.verdict == "not applicable"}
    assert set(why) == {*(relation.id for relation in RELATIONS), *DECLARED} - {"declared_jitter_wins"}
    assert why["converges"] == "motion was not rendered" and why["bias_beats_native"] == "no unbiased stream at this scale"


def test_streams_that_are_the_same_files_are_not_compared(folder):
    corpus = Corpus(folder)
    entry = corpus.sequence("two_quads_slide")
    sequences = {"two_quads_slide": entry.model_copy(update={"equal_streams": {BIASED: JITTERED}})}
    corpus.manifest = corpus.manifest.model_copy(update={"sequences": sequences})
    [verdict] = [verdict for verdict in roundtrip(corpus) if verdict.id == "bias_beats_native"]
    assert (verdict.verdict, verdict.why) == ("not applicable", "both streams are the same files")


def test_the_command_fails_with_the_broken_relation(folder, tmp_path):
    done = framepairs("roundtrip", folder)
    assert done.returncode == 0 and "demodulation_beats_none" in done.stdout, done.stderr
    wrong = shutil.copytree(folder, tmp_path / "wrong")
    for file in (wrong / "two_quads_slide" / "frames").glob("*.json"):
        record = json.loads(file.read_text())
        for entry in record["streams"].values():
            entry["jitter"] = [-value for value in entry["jitter"]]
        file.write_text(json.dumps(record))
    done = framepairs("roundtrip", wrong, "--json")
    assert done.returncode == 1
    assert "converges" in done.stderr and "two_quads_slide at 2x by" in done.stderr
    verdicts = {verdict["id"]: verdict for verdict in json.loads(done.stdout)}
    assert verdicts["converges"]["verdict"] == "broken" and verdicts["guides_beat_color"]["verdict"] == "holds"
