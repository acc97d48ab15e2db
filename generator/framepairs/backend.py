"""The one place that chooses between CUDA and LLVM, and the first that imports Dr.Jit.

Dr.Jit's wheel brings no LLVM, and some libLLVM load and then abort the whole process at the first kernel (14 to 16 do).
So every candidate is tried in a child process, newest first, with a kernel that needs the instruction that they lack,
and the answer is remembered by path, size and modification time. The other modules write `from .backend import dr, mi`
(or `jit`: Dr.Jit's array types of the chosen back end): looking up such a name activates the default back end, unless
`activate` was called before.
"""

import json
import os
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from functools import lru_cache
from glob import glob
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from .errors import MachineError

Choice = Literal["auto", "llvm", "cuda"]
VARIANTS = {"llvm": "llvm_ad_rgb", "cuda": "cuda_ad_rgb"}
INSTALL_LINE = (
    "no usable back end: install libLLVM 17 or newer (Debian, Ubuntu: apt-get install libllvm19 libatomic1) "
    "or point DRJIT_LIBLLVM_PATH at one, or use a machine with an NVIDIA driver"
)
LLVM_PATTERNS = (
    "/usr/lib*/libLLVM*.so*",
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm*/lib/libLLVM*.so*",
    "/usr/local/lib*/libLLVM*.so*",
    "/opt/*/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)
PROBE = """
import sys, drjit as dr
module = getattr(dr, sys.argv[1])
a, b = module.Float([1, 5, 3]), module.Float([2, -1, 3])
dr.make_opaque(a, b)
answer = list(dr.minimum(a, b)) + list(dr.maximum(dr.sqrt(a), b))
sys.exit(0 if answer[:3] == [1, -1, 3] and answer[3] == 2 else 3)
"""


@dataclass(frozen=True)
class Library:
    """One libLLVM file: `path` without links, its major `version` (0 where the name does not tell), and the verdict."""

    path: str
    version: int
    works: bool
    why: str


@dataclass(frozen=True)
class Machine:
    """What was found: `chosen` is 'cuda', 'llvm' or None; `library` is the libLLVM that LLVM would use."""

    chosen: str | None
    cuda: bool
    library: Library | None
    libraries: tuple[Library, ...]


def find_machine(choice: Choice = "auto", *, try_all: bool = False) -> Machine:
    """Look for CUDA and for the newest libLLVM that works; with `try_all`, give every libLLVM its verdict.

    A path in DRJIT_LIBLLVM_PATH goes before all others. Nothing is imported or loaded in this process.
    """
    cuda = choice != "llvm" and _has_cuda_driver() and _probe("cuda", None) == "works"
    tried: list[Library] = []
    found: Library | None = None
    if choice != "cuda":
        for path, major in _candidates():
            if found and not try_all:
                break
            why = _remembered_probe(path)
            tried.append(Library(path, major, why == "works", why))
            found = found or (tried[-1] if tried[-1].works else None)
    return Machine("cuda" if cuda else "llvm" if found else None, cuda, found, tuple(tried))


@lru_cache
def activate(choice: Choice = "auto") -> str:
    """Set Mitsuba's variant and return 'cuda' or 'llvm'. Raises MachineError with what to install."""
    machine = find_machine(choice)
    if machine.chosen is None:
        raise MachineError(INSTALL_LINE if choice != "cuda" else "no CUDA device: an NVIDIA driver is needed")
    if machine.library:
        os.environ["DRJIT_LIBLLVM_PATH"] = machine.library.path
    import mitsuba

    mitsuba.set_variant(VARIANTS[machine.chosen])
    if machine.chosen == "llvm":
        # Packet gathers are chosen by the memory's alignment, which varies from frame to frame: each alignment would
        # compile the kernel anew (0.9 to 2.4 s here), and the single gathers are as fast on LLVM.
        import drjit

        drjit.set_flag(drjit.JitFlag.PacketOps, False)
    return machine.chosen


def __getattr__(name: str):
    if name not in ("dr", "mi", "jit"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if not _variant():
        activate(os.environ.get("FRAMEPAIRS_BACKEND", "auto"))
    import drjit
    import mitsuba

    is_cuda = mitsuba.variant().startswith("cuda")
    return {"dr": drjit, "mi": mitsuba, "jit": drjit.cuda.ad if is_cuda else drjit.llvm.ad}[name]


def opaque(kind, values):
    """A vector type of Dr.Jit from numbers that kernels do not bake in: they are replayed when the numbers change."""
    from drjit import opaque, value_t

    return kind(*(opaque(value_t(kind), float(value)) for value in values))


def release_memory() -> None:
    """Give back what is free: glibc keeps half a gigabyte after the market was read and uploaded, for each worker."""
    import ctypes

    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def versions() -> dict[str, str]:
    """Versions of what decides pixels and files."""
    return {name: version(name) for name in ("framepairs", "mitsuba", "drjit", "OpenEXR", "usd-core", "trimesh", "pillow")}


def describe_machine() -> dict:
    """What `framepairs doctor` prints, as plain data."""
    machine = find_machine(try_all=True)
    return {
        "python": ".".join(str(part) for part in sys.version_info[:3]),
        "versions": versions(),
        "variant": VARIANTS[machine.chosen] if machine.chosen else None,
        "cuda": machine.cuda,
        "libllvm": machine.library.path if machine.library else None,
        "libraries": [asdict(library) for library in machine.libraries],
    }


def _variant() -> str | None:
    return sys.modules["mitsuba"].variant() if "mitsuba" in sys.modules else None


def _candidates() -> list[tuple[str, int]]:
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    folders = [folder for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":") if folder]
    folders += [str(Path(sys.prefix) / "lib")]
    patterns = [*LLVM_PATTERNS, *(f"{folder}/libLLVM*.so*" for folder in folders)]
    files = {os.path.realpath(file) for pattern in patterns for file in glob(pattern)}
    found = sorted(((file, _major_version(file)) for file in files), key=lambda item: (-item[1], item[0]))
    if named and os.path.isfile(named):
        real = os.path.realpath(named)
        found = [(real, _major_version(real))] + [item for item in found if item[0] != real]
    return found


def _major_version(path: str) -> int:
    match = re.search(r"libLLVM(?:-|\.so\.|\.)?(\d+)", Path(path).name)
    return int(match.group(1)) if match else 0


def _has_cuda_driver() -> bool:
    return any(glob(pattern) for pattern in ("/usr/lib*/**/libcuda.so.1", "/usr/local/nvidia/lib*/libcuda.so.1")) or any(
        os.path.exists(os.path.join(folder, "libcuda.so.1"))
        for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":")
        if folder
    )


def _probe(module: str, library: str | None) -> str:
    """'works', or why not, in a few words; the kernel runs in a child process, which may die."""
    environment = dict(os.environ) | ({"DRJIT_LIBLLVM_PATH": library} if library else {})
    try:
        child = subprocess.run(
            [sys.executable, "-c", PROBE, module], env=environment, capture_output=True, text=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return "did not answer within 120 s"
    if child.returncode == 0:
        return "works"
    said = [line.strip() for line in child.stderr.splitlines() if line.strip()]
    telling = [line for line in said if re.search(r"too old|LLVM ERROR|ImportError|cannot open|could not", line)]
    reason = (telling or said or ["no message"])[0][:160]
    return f"aborts the process ({reason})" if child.returncode < 0 else f"fails ({reason})"


def _remembered_probe(path: str) -> str:
    stat = os.stat(path)
    key = f"{path}:{stat.st_size}:{stat.st_mtime_ns}:{version('drjit')}"
    memory_file = _memory_file()
    try:
        memory = json.loads(memory_file.read_text())
    except (OSError, ValueError):
        memory = {}
    # Only answers about the library itself are remembered: a missing package may be installed tomorrow.
    if memory.get(key) is None:
        answer = _probe("llvm", path)
        if answer != "works" and "ImportError" in answer:
            return answer
        memory[key] = answer
        _write_memory(memory_file, memory)
    return memory[key]


def _memory_file() -> Path:
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(cache) / "framepairs" / "libllvm.json"


def _write_memory(file: Path, memory: dict[str, str]) -> None:
    temporary = file.with_suffix(f".{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(json.dumps(memory, indent=1))
        os.replace(temporary, file)
    except OSError:
        return  # a home that cannot be written costs one probe a start, nothing else
