"""Mitsuba's XML files as the dictionaries that `mi.load_dict` takes, without Mitsuba.

Mitsuba's own parser (`mi.parser`, 3.9.1) parses without making objects, but it opens whatever file an <include> or a
<spectrum> names, wherever it lies, and needs a back end. So this is our own: files come from within reach alone.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..transforms import translation
from .containment import Reach, within
from .mitsuba_dictionary import DEEPEST
from .mitsuba_elements import MOST_ELEMENTS, Element, Values, read_tree
from .mitsuba_textures import existing

DEEPEST_INCLUDE = 15  # as Mitsuba has it
MOST_FILES = 1000
LARGEST_SPECTRA = 2**22  # bytes, of all files of spectra as often as they are named
OBJECTS = "scene shape sampler film rfilter emitter bsdf phase integrator volume medium texture sensor spectrum".split()
Place = tuple[Path, int]


@dataclass(frozen=True)
class Document:
    """scene: nested dictionaries, references as {"type": "ref", "id"}. files: all that were read, the main one first. places:
    file and line of each dictionary, by its id()."""

    scene: dict[str, Any]
    files: tuple[Path, ...]
    places: dict[int, Place]


def parse_xml(file: Path, reach: Reach) -> Document:
    """Raises InputError naming the file and the line (as field)."""
    return _Parser(file, reach).document()


class _Parser:
    """The state of one parse: parameters, folders to look in, and what was read."""

    def __init__(self, file: Path, reach: Reach) -> None:
        self.file, self.reach = file, reach
        self.values = Values()
        self.files: list[Path] = []
        self.elements = self.spectrum_bytes = 0
        self.folders: list[Path] = []
        self.places: dict[int, Place] = {}
        self.references: list[dict[str, Any]] = []
        self.aliases: dict[str, str] = {}
        self.version = (3, 0, 0)

    def document(self) -> Document:
        root = self.tree(self.file)
        if root.tag != "scene":
            raise root.error(f"<{root.tag[:80]}> is no scene")
        scene = self.object(root, 0)
        for reference in self.references:
            reference["id"] = self.target(reference["id"])
        return Document(scene, tuple(dict.fromkeys(self.files)), self.places)

    def target(self, name: str) -> str:
        """What an alias, also one of an alias, stands for."""
        passed: set[str] = set()
        while name in self.aliases and name not in passed:
            passed.add(name)
            name = self.aliases[name]
        self.aliases |= dict.fromkeys(passed - {name}, name)  # the next one finds it at once
        return name

    def tree(self, file: Path) -> Element:
        self.files.append(file)
        if len(self.files) > MOST_FILES:
            raise InputError(f"more than {MOST_FILES} files are included", file=self.file)
        root, count = read_tree(file, MOST_ELEMENTS - self.elements)
        self.elements += count
        return root

    def object(self, element: Element, depth: int) -> dict[str, Any]:
        """The dictionary of an element that is a plugin."""
        if depth > DEEPEST:
            raise element.error(f"objects are nested deeper than {DEEPEST}")
        values: dict[str, Any] = {"type": "scene" if element.tag == "scene" else self.values.text(element, "type")}
        self.places[id(values)] = (element.file, element.line)
        if "version" in element.attributes:
            self.version = self.version_of(element)
        if "id" in element.attributes and element.tag != "scene":
            values["id"] = self.values.text(element, "id")
        self.fill(values, element, depth, 0)
        return values

    def version_of(self, element: Element) -> tuple[int, ...]:
        text = self.values.text(element, "version")
        if not re.fullmatch(r"\d{1,6}\.\d{1,6}\.\d{1,6}", text):
            raise element.error(f"version {text[:80]!r} is not three numbers with dots")
        return tuple(int(part) for part in text.split("."))

    def fill(self, values: dict[str, Any], element: Element, depth: int, included: int) -> None:
        for inner in element.inner:
            tag = inner.tag
            if tag == "include":
                self.include(values, inner, depth, included)
            elif tag == "default":
                self.values.parameters.setdefault(self.values.text(inner, "name"), self.values.text(inner, "value"))
            elif tag == "path":
                self.folders.append(self.folder(inner))
            elif tag == "alias":
                self.aliases[self.values.text(inner, "as")] = self.values.text(inner, "id")
            else:
                self.put(values, inner, self.name(inner, values), self.property(inner, depth))
        self.upgrade(values)

    def property(self, element: Element, depth: int) -> Any:
        tag = element.tag
        if tag == "ref":
            self.references.append({"type": "ref", "id": self.values.text(element, "id")})
            return self.references[-1]
        if tag in OBJECTS and (tag != "spectrum" or "type" in element.attributes):
            return self.object(element, depth + 1)
        if tag == "transform":
            return self.values.transform(element)
        if tag == "string":
            text = self.values.text(element, "value")
            return self.found(text) if element.attributes.get("name") == "filename" else text
        if tag == "spectrum":
            if "filename" in element.attributes:
                return self.values.spectrum(element, self.spectrum_file(element))
            return self.values.spectrum(element, self.values.text(element, "value"))
        return self.values.value(element)

    def put(self, values: dict[str, Any], element: Element, key: str, value: Any) -> None:
        if key in values:
            raise element.error(f"{key[:80]} stands there twice")
        if isinstance(value, dict):
            self.places.setdefault(id(value), (element.file, element.line))
        values[key] = value

    def name(self, element: Element, values: dict[str, Any]) -> str:
        """The key of an element: its name, else a number where it is an object."""
        if "name" not in element.attributes:
            if element.tag not in (*OBJECTS, "ref"):
                raise element.error(f"<{element.tag[:80]}> without a name")
            return f"_arg_{len(values)}"
        given = self.values.text(element, "name")
        if self.version < (2, 0, 0):
            given = re.sub(r"(?<=[a-z0-9])([A-Z]+)", lambda match: "_" + match.group(1), given).lower()
        if given in ("type", "id"):
            raise element.error(f"{given} as a name")
        return given

    def include(self, values: dict[str, Any], element: Element, depth: int, included: int) -> None:
        if included >= DEEPEST_INCLUDE:
            raise element.error(f"includes in more than {DEEPEST_INCLUDE} levels")
        root = self.tree(self.file_of(element))
        if root.tag == "scene":
            self.fill(values, root, depth, included + 1)
        else:
            self.put(values, root, self.name(root, values), self.object(root, depth + 1))

    def file_of(self, element: Element) -> Path:
        try:
            return existing(self.reach, self.found(self.values.text(element, "filename")), "file")
        except InputError as error:
            raise element.error(error.problem) from None

    def spectrum_file(self, element: Element) -> str:
        """Pairs, one to a line, as text with colons."""
        file = self.file_of(element)
        self.files.append(file)
        self.spectrum_bytes += file.stat().st_size
        if self.spectrum_bytes > LARGEST_SPECTRA:
            raise element.error(f"{file.name} is, with the spectra before it, larger than {LARGEST_SPECTRA} bytes")
        lines = [line.split("#")[0].split() for line in file.read_text(errors="replace").splitlines()]
        return " ".join(":".join(line) for line in lines if line)

    def folder(self, element: Element) -> Path:
        probe = f"{self.values.text(element, 'value')}/_"
        return within(self.reach, probe, file=element.file, field=f"line {element.line}").parent

    def found(self, name: str) -> str:
        """The name, or the file of that name in a folder that a <path> gives (the last one first)."""
        candidates = [folder / name for folder in reversed(self.folders)]
        return next((str(file) for file in candidates if _exists(file)), name)

    def upgrade(self, values: dict[str, Any]) -> None:
        """What files of Mitsuba 0.6 and earlier call otherwise."""
        if self.version >= (2, 0, 0):
            return
        if values["type"] == "diffuse" and "diffuse_reflectance" in values:
            values["reflectance"] = values.pop("diffuse_reflectance")
        if values["type"] == "bitmap" and {"uoffset", "voffset", "uscale", "vscale"} & values.keys():
            scale = [_float(values.pop(key, 1.0)) for key in ("uscale", "vscale")]
            offset = [_float(values.pop(key, 0.0)) for key in ("uoffset", "voffset")]
            values["to_uv"] = (np.diag([*scale, 1.0, 1.0]) @ translation(np.array([*offset, 0.0]))).tolist()


def _float(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _exists(file: Path) -> bool:
    try:
        return file.is_file()
    except (OSError, ValueError):
        return False
