"""Random numbers of a variation, and the names that its patterns choose.

Each number is a hash of the seed and of what it decides (kind of rule, its place in the list, name, key), so that adding a
rule, an object or a key changes no other number.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from ..errors import InputError


@dataclass(frozen=True)
class Draws:
    """The numbers of one rule."""

    seed: int
    kind: str
    rule: int = 0

    def number(self, name: str, key: str) -> float:
        """In [0, 1): 53 bits of a BLAKE2b hash."""
        text = "\0".join((str(self.seed), self.kind, str(self.rule), name, key))
        digest = hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).digest()
        return (int.from_bytes(digest, "little") >> 11) / 2.0**53

    def within(self, ends: tuple[float, float], name: str, key: str) -> float:
        """Even between the two ends."""
        return ends[0] + (ends[1] - ends[0]) * self.number(name, key)

    def one_of(self, items: Sequence, name: str, key: str):
        """One of the items, or None where there are none."""
        return items[int(self.number(name, key) * len(items))] if items else None


def matching(patterns: Sequence[str], names: Sequence[str], file: Path | None, field: str) -> list[int]:
    """Indices of the names that any pattern matches. Raises InputError for a pattern that matches none."""
    chosen: set[int] = set()
    for pattern in patterns:
        found = {index for index, name in enumerate(names) if fnmatchcase(name, pattern)}
        if not found:
            raise _no_match(pattern, names, file, field)
        chosen |= found
    return sorted(chosen)


def groups(patterns: Sequence[str], names: Sequence[str], file: Path | None, field: str) -> dict[str, list[int]]:
    """Indices of names by group: a group is what the names begin with, as many parts between `/` as the pattern has.

    Raises InputError for a pattern that matches none.
    """
    found: dict[str, list[int]] = {}
    for pattern in patterns:
        parts = pattern.count("/") + 1
        starts = ["/".join(name.split("/")[:parts]) for name in names]
        matched = {index: start for index, start in enumerate(starts) if fnmatchcase(start, pattern)}
        if not matched:
            raise _no_match(pattern, names, file, field)
        for index, start in matched.items():
            members = found.setdefault(start, [])
            if index not in members:
                members.append(index)
    return found


def _no_match(pattern: str, names: Sequence[str], file: Path | None, field: str) -> InputError:
    known = ", ".join([*names[:6], *(["..."] if len(names) > 6 else [])]) or "none"
    return InputError(f"{pattern!r} matches nothing; there are {known}", file=file, field=field)
