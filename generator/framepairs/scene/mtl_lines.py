"""The lines of MTL files (Wavefront material libraries) and the files that OBJ and MTL name."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import InputError
from .containment import Reach, within

ARGUMENTS = {  # words behind each option of a map: how many at most
    **dict.fromkeys(("-o", "-s", "-t"), 3),
    **dict.fromkeys(("-blendu", "-blendv", "-boost", "-bm", "-cc", "-clamp", "-imfchan", "-texres", "-type"), 1),
    **{"-mm": 2},
}


@dataclass(frozen=True)
class MapLine:
    """A map of a material. name: the image, as it stands there. options: its options' words."""

    name: str
    options: dict[str, tuple[str, ...]]

    def numbers(self, option: str, default: float, count: int) -> tuple[float, ...]:
        """The option's first numbers, `default` where there are fewer."""
        found = [float(word) for word in self.options.get(option, ())[:count]]
        return (*found, *[default] * (count - len(found)))


@dataclass
class MtlMaterial:
    """One newmtl. values: the text behind each keyword, which is lower case; of equal ones the last."""

    name: str
    library: Path
    values: dict[str, str] = field(default_factory=dict)

    def number(self, key: str) -> float | None:
        """Raises InputError for other than one number of 0 or more, as the others do."""
        return self.numbers(key)[0] if key in self.values else None

    def color(self, key: str) -> tuple[float, float, float] | None:
        """One number stands for grey. None where it is not given as RGB."""
        if key not in self.values or self.values[key].split()[:1] in (["spectral"], ["xyz"]):
            return None
        found = self.numbers(key)
        return tuple(found[:3]) if len(found) >= 3 else (found[0],) * 3

    def numbers(self, key: str) -> list[float]:
        try:
            found = [float(word) for word in self.values[key].removeprefix("-halo").split()]
        except ValueError:
            found = []
        if not found or not all(0 <= number < float("inf") for number in found):
            problem = f"{key} {self.values[key][:40]!r}: numbers of 0 or more are expected"
            raise InputError(problem, file=self.library, field=self.name)
        return found

    def map(self, *keys: str) -> MapLine | None:
        """The first of these maps. Raises InputError where it cannot be read."""
        text = next((self.values[key] for key in keys if self.values.get(key)), None)
        if text is None:
            return None
        try:
            return map_of(text)
        except ValueError:
            raise InputError(f"{keys[0]} {text[:40]!r} cannot be read", file=self.library, field=self.name) from None


def map_of(text: str) -> MapLine:
    """A map's options and the name behind them, which may hold spaces. Raises ValueError without a name."""
    options, rest = {}, text.strip()
    while (match := re.match(r"(-[A-Za-z]+)(?:\s+|$)", rest)) and match[1].lower() in ARGUMENTS:
        option, rest, words = match[1].lower(), rest[match.end() :], []
        while len(words) < ARGUMENTS[option] and (word := re.match(r"(\S+)(?:\s+|$)", rest)):
            if option in ("-o", "-s", "-t", "-mm", "-bm", "-boost") and not _is_number(word[1]):
                break
            words.append(word[1])
            rest = rest[word.end() :]
        options[option] = tuple(words)
    name = _plain(rest)
    if not name:
        raise ValueError
    return MapLine(name, options)


def _is_number(word: str) -> bool:
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word) is not None


def _plain(name: str) -> str:
    """A file's name without quotes, with / for the backslash of other systems."""
    return name.strip().strip('"').strip().replace("\\", "/")


def library_files(named: tuple[str, ...], file: Path, reach: Reach) -> tuple[Path, ...]:
    """The files behind `mtllib`: one whose name holds spaces, or several. Raises InputError where one is missing."""
    found = []
    for text in named:
        whole = within(reach, _plain(text), file=file, field="mtllib") if _plain(text) else None
        if whole is not None and whole.is_file():
            found.append(whole)
            continue
        for quoted, word in re.findall(r'"([^"]*)"|(\S+)', text):
            library = within(reach, _plain(quoted or word), file=file, field="mtllib")
            if not library.is_file():
                raise InputError(f"missing material library {_plain(quoted or word)[:200]}", file=file)
            found.append(library)
    return tuple(dict.fromkeys(found))


def read_libraries(libraries: tuple[Path, ...]) -> dict[str, MtlMaterial]:
    """Materials by name; of equal names the first."""
    materials: dict[str, MtlMaterial] = {}
    for library in libraries:
        current = None
        try:
            text = library.read_bytes().removeprefix(b"\xef\xbb\xbf").decode(errors="replace")
        except OSError as error:
            raise InputError(error.strerror or "cannot be read", file=library) from None
        for line in re.split(r"[\r\n]+", text):
            key, _, rest = re.sub(r"\s", " ", line.strip()).partition(" ")
            if key.lower() == "newmtl":
                current = MtlMaterial(" ".join(rest.split()), library)  # as in OBJ files
                materials.setdefault(current.name, current)
            elif current is not None and key and not key.startswith("#"):
                current.values[key.lower()] = re.sub(r"\s#.*", "", rest).strip()
    return materials
