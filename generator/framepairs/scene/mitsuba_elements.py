"""XML elements of Mitsuba's scene files, and the values that they hold: numbers, colours, transforms.

Untrusted: document type declarations (and with them entities) are refused, and size, number and depth are bounded.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from ..errors import InputError
from ..transforms import Matrix, translation
from .mitsuba_dictionary import DEEPEST

LARGEST_FILE = 2**26  # bytes
MOST_ELEMENTS = 500_000
MOST_SUBSTITUTED = 2**24  # characters and steps, of all values with parameters together


@dataclass(frozen=True)
class Element:
    """An XML element with the line that it begins in."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    inner: list["Element"] = field(default_factory=list)

    def error(self, problem: str) -> InputError:
        return InputError(problem, file=self.file, field=f"line {self.line}")


def read_tree(file: Path, most: int = MOST_ELEMENTS) -> tuple[Element, int]:
    """The root of a file and how many elements it has. Raises InputError naming file and line."""
    stack: list[Element] = []
    roots: list[Element] = []
    count = 0
    parser = expat.ParserCreate()

    def begins(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        element = Element(tag, attributes, file, parser.CurrentLineNumber)
        if count > most or len(stack) > 2 * DEEPEST:
            raise element.error(f"more than {MOST_ELEMENTS} elements, or more than {2 * DEEPEST} in each other")
        (stack[-1].inner if stack else roots).append(element)
        stack.append(element)

    def refuses(*_: Any) -> None:
        problem = "document type declarations and entities are not read"
        raise InputError(problem, file=file, field=f"line {parser.CurrentLineNumber}")

    parser.StartElementHandler, parser.EndElementHandler = begins, lambda tag: stack.pop()
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuses
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(f"larger than {LARGEST_FILE} bytes", file=file)
        parser.Parse(file.read_bytes(), True)
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two for encodings
        raise InputError(f"not XML: {error}", file=file) from None
    return roots[0], count


class Values:
    """Reads what stands in attributes, with $parameters replaced."""

    def __init__(self) -> None:
        self.parameters: dict[str, str] = {}
        self._longest_first: list[str] = []
        self._substituted = 0  # what replacing takes: characters, and parameters that were looked for

    def text(self, element: Element, key: str) -> str:
        if key not in element.attributes:
            raise element.error(f"<{element.tag[:80]}> without {key}")
        return self.substituted(element, element.attributes[key])

    def substituted(self, element: Element, text: str) -> str:
        if "$" in text:
            if len(self._longest_first) < len(self.parameters):
                self._longest_first = sorted(self.parameters, key=len, reverse=True)
                self._substituted += len(self.parameters)
            for key in self._longest_first:
                self._substituted += 1 + text.count("$" + key) * len(self.parameters[key])
                if self._substituted > MOST_SUBSTITUTED:
                    raise element.error(f"parameters stand for more than {MOST_SUBSTITUTED} characters")
                text = text.replace("$" + key, self.parameters[key])
                if "$" not in text:
                    break
            if "$" in text:
                raise element.error(f"undefined parameter in {text[:80]!r}")
        return text

    def numbers(self, element: Element, key: str = "value") -> list[float]:
        text = self.text(element, key)
        try:
            found = [float(word) for word in re.split(r"[\s,]+", text.strip()) if word]
        except ValueError:
            raise element.error(f"{text[:80]!r}, numbers are expected") from None
        if not found or not np.isfinite(found).all():
            raise element.error(f"{text[:80]!r}, finite numbers are expected")
        return found

    def number(self, element: Element, key: str, default: float) -> float:
        found = self.numbers(element, key) if key in element.attributes else [default]
        if len(found) != 1:
            raise element.error(f"{key} has {len(found)} numbers, one is expected")
        return found[0]

    def only(self, element: Element) -> float:
        self.text(element, "value")
        return self.number(element, "value", 0.0)

    def triple(self, element: Element, default: float, key: str = "value") -> list[float]:
        """Three numbers: from `key`, where one stands for all, or from x, y and z."""
        if key not in element.attributes:
            return [self.number(element, axis, default) for axis in "xyz"]
        found = self.numbers(element, key)
        if len(found) not in (1, 3):
            raise element.error(f"{key} has {len(found)} numbers, 1 or 3 are expected")
        return found * (3 // len(found))

    def value(self, element: Element) -> Any:
        """What a property that stands alone says."""
        tag = element.tag
        if tag == "float":
            return self.only(element)
        if tag == "integer":
            text = self.text(element, "value").strip()
            if not re.fullmatch(r"[+-]?\d{1,18}", text):
                raise element.error(f"{text[:80]!r}, an integer is expected")
            return int(text)
        if tag == "boolean":
            text = self.text(element, "value").strip().lower()
            if text not in ("true", "false"):
                raise element.error(f"{text[:80]!r}, true or false is expected")
            return text == "true"
        if tag in ("vector", "point"):
            return self.triple(element, 0.0)
        if tag in ("rgb", "srgb"):
            return self.rgb(element)
        raise element.error(f"<{tag[:80]}> is no element of a scene")

    def spectrum(self, element: Element, text: str) -> dict[str, Any]:
        """Pairs of wavelength and value, or one number."""
        element = Element(element.tag, {"value": text.replace(":", " ")}, element.file, element.line)
        if ":" not in text:
            return {"type": "spectrum", "value": self.only(element)}
        found = self.numbers(element)
        if len(found) % 2:
            raise element.error("a spectrum is pairs of wavelength and value")
        return {"type": "spectrum", "value": [list(pair) for pair in zip(found[::2], found[1::2], strict=True)]}

    def rgb(self, element: Element) -> dict[str, Any]:
        """A hexadecimal colour is sRGB, as is <srgb>; numbers in <rgb> are linear."""
        text = self.text(element, "value").strip()
        is_hex = re.fullmatch(r"#[0-9a-fA-F]{6}", text)
        found = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)] if is_hex else self.triple(element, 0.0)
        if is_hex or element.tag == "srgb":
            found = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in found]  # IEC 61966-2-1
        return {"type": "rgb", "value": found}

    def transform(self, element: Element) -> list[list[float]]:
        """[4, 4]: the last operation is applied last."""
        product = np.eye(4)
        for step in element.inner:
            try:
                with np.errstate(all="ignore"):
                    product = self.step(step) @ product
            except ValueError as error:
                raise step.error(str(error)) from None
        if not np.isfinite(product).all():
            raise element.error("the transform is not finite")
        return product.tolist()

    def step(self, element: Element) -> Matrix:
        tag = element.tag.lower()
        if tag == "translate":
            return translation(np.array(self.triple(element, 0.0)))
        if tag == "scale":
            return np.diag([*self.triple(element, 1.0), 1.0])
        if tag == "rotate":
            return _rotation(np.array(self.triple(element, 0.0)), np.radians(self.number(element, "angle", 0.0)))
        if tag in ("lookat", "look_at"):
            origin, target = (np.array(self.triple(element, 0.0, key)) for key in ("origin", "target"))
            up = np.array(self.triple(element, 0.0, "up")) if "up" in element.attributes else np.zeros(3)
            return _look_at(origin, target, up)
        if tag == "matrix":
            found = self.numbers(element)
            if len(found) not in (9, 16):
                raise element.error(f"a matrix of {len(found)} numbers, 9 or 16 are expected")
            matrix, side = np.eye(4), 3 if len(found) == 9 else 4
            matrix[:side, :side] = np.array(found).reshape(side, side)
            return matrix
        raise element.error(f"<{element.tag[:80]}> in a transform")


def _rotation(axis: np.ndarray, angle: float) -> Matrix:
    """Rodrigues' formula. As in Mitsuba 3.9.1 the axis is taken as it is, so that one of another length than 1 distorts."""
    if not 0 < np.linalg.norm(axis) < np.inf:
        raise ValueError("the axis of a rotation has no length")
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] = np.cos(angle) * np.eye(3) + (1 - np.cos(angle)) * np.outer(axis, axis) + np.sin(angle) * cross
    return matrix


def _look_at(origin: np.ndarray, target: np.ndarray, up: np.ndarray) -> Matrix:
    """Mitsuba's: z towards the target, x to the left."""
    forward = target - origin
    if not 0 < np.linalg.norm(forward) < np.inf:
        raise ValueError("a lookat whose target is its origin")
    forward = forward / np.linalg.norm(forward)
    left = np.cross(up, forward)
    if not np.linalg.norm(left) > 1e-12 * max(np.linalg.norm(up), 1e-300):
        left = np.cross(np.eye(3)[np.argmin(np.abs(forward))], forward)
    left = left / np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(forward, left), forward, origin], axis=1)
    return matrix
