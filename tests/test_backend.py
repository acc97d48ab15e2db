"""Choosing a back end: libraries that abort are survived, and answers are remembered."""

import json
import os
from pathlib import Path

import pytest

from framepairs import backend
from framepairs.errors import MachineError


@pytest.fixture
def own_cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "framepairs" / "libllvm.json"


def test_a_library_that_is_none_is_survived_and_told(tmp_path, own_cache):
    fake = tmp_path / "libLLVM-19.so.1"
    fake.write_bytes(b"not a library")
    assert backend._remembered_probe(str(fake)).startswith(("fails", "aborts"))


@pytest.mark.parametrize("major", [14, 15, 16])
def test_libraries_that_abort_do_not_take_the_process_down(major, own_cache):
    paths = [path for path, version in backend._candidates() if version == major]
    if not paths:
        pytest.skip(f"no libLLVM {major} on this machine")
    assert backend._remembered_probe(paths[0]).startswith("aborts the process")


def test_the_newest_working_library_is_chosen_and_the_named_one_goes_first(monkeypatch, own_cache, tmp_path):
    tried = []

    def probe(path):
        tried.append(path)
        return "works" if "19" in path or "named" in path else "aborts the process (told so)"

    files = {}
    for name in ("libLLVM-15.so.1", "libLLVM.so.19.1", "libLLVM-22.so.1"):
        (tmp_path / name).write_bytes(b"")
        files[name] = str(tmp_path / name)
    monkeypatch.setattr(backend, "LLVM_PATTERNS", (f"{tmp_path}/libLLVM*.so*",))
    monkeypatch.setattr(backend, "_remembered_probe", probe)
    monkeypatch.setattr(backend, "_has_cuda_driver", lambda: False)
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    monkeypatch.setattr(backend.sys, "prefix", str(tmp_path / "nowhere"))
    found = backend.find_machine()
    assert found.chosen == "llvm" and found.library.path == files["libLLVM.so.19.1"]
    assert [Path(path).name for path in tried] == ["libLLVM-22.so.1", "libLLVM.so.19.1"]
    named = tmp_path / "named.so"
    named.write_bytes(b"")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(named))
    assert backend.find_machine().library.path == str(named)
    assert len(backend.find_machine(try_all=True).libraries) == 4


def test_answers_are_remembered_until_the_file_changes(tmp_path, own_cache, monkeypatch):
    library, calls = tmp_path / "libLLVM-19.so.1", []
    library.write_bytes(b"one")
    monkeypatch.setattr(backend, "_probe", lambda module, path: calls.append(path) or "works")
    for _ in range(3):
        assert backend._remembered_probe(str(library)) == "works"
    assert len(calls) == 1 and len(json.loads(own_cache.read_text())) == 1
    library.write_bytes(b"three")
    os.utime(library, (1, 1))
    backend._remembered_probe(str(library))
    assert len(calls) == 2


def test_a_home_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(backend, "_probe", lambda module, path: "works")
    library = tmp_path / "libLLVM-19.so.1"
    library.write_bytes(b"")
    assert backend._remembered_probe(str(library)) == "works"


def test_without_any_back_end_the_error_says_what_to_install(monkeypatch):
    nothing = backend.Machine(None, False, None, ())
    monkeypatch.setattr(backend, "find_machine", lambda choice: nothing)
    with pytest.raises(MachineError, match="apt-get install libllvm19"):
        backend.activate.__wrapped__("auto")
    with pytest.raises(MachineError, match="NVIDIA"):
        backend.activate.__wrapped__("cuda")


@pytest.mark.parametrize(
    ("name", "major"), [("libLLVM-14.so.1", 14), ("libLLVM.so.19.1", 19), ("libLLVM-22.so", 22), ("libLLVM.so", 0)]
)
def test_versions_are_read_from_names(name, major):
    assert backend._major_version(f"/usr/lib/{name}") == major
