"""Wavefront OBJ files as meshes, through trimesh (Alias|Wavefront, "Advanced Visualizer Manual", appendix B1: Object Files).

Objects and groups are meshes, and materials split them. Colours that stand behind the coordinates of a vertex are taken as sRGB
codes. What trimesh would read as something else is put right in its text, or refused: white space, comments behind numbers,
indices that count back from their line, index 0, and faces of kinds that it takes for one another. Of a mesh where only some
corners have a normal or texture coordinates, it reads none.
"""

import io
import re
from collections import Counter
from pathlib import Path

from trimesh.exchange.obj import load_obj

from ..errors import InputError
from .trimesh_meshes import MOST_PARTS, MeshFile, loaded, mesh_of

MOST_WORK = 2 * 10**9  # vertices of the file times meshes: for each mesh, trimesh looks at all vertices
NOT_DRAWN = {
    **{"l": "lines", "p": "points", "vp": "free-form curves and surfaces", "cstype": "free-form curves and surfaces"},
    **{"call": "other files that it calls", "csh": "commands", "shadow_obj": "shadow objects"},
}
NUMBERS_OF = {"": 1, "/": 2, ":": 2, "//": 3}  # numbers of a corner v, v/vt, v//vn, v/vt/vn without its digits, // as :
KINDS = ", ".join(("v", "v/vt", "v//vn")) + " or v/vt/vn"


def read_obj(file: Path, data: bytes) -> MeshFile:
    """The faces of an OBJ file, polygons as fans. Raises InputError; its caller adds the file."""
    text = _plain(data)
    libraries = tuple(re.findall(r"\nmtllib ([^\n]*)", text))
    kinds, confusing = _kinds_of_faces(text)
    names = dict.fromkeys(re.findall(r"\nusemtl ([^\n]*)", text))
    apart, said = _parts(text, len(names))
    if confusing:
        text = _settled(text, ("o", "g", "usemtl") if apart else ("usemtl",))
    # A library of names alone: every mesh keeps the name of its material, and trimesh has nothing else to open.
    mtl = {"names": "".join(f"newmtl {name}\n" for name in names)}
    stream = io.StringIO("mtllib names\n" + text)
    stream.name = file.name
    found = loaded(load_obj, stream, resolver=mtl, split_objects=apart, split_groups=apart).get("geometry", {})
    pairs = [(mesh_of(name, arrays), arrays["visual"]) for name, arrays in reversed(found.items())]
    pairs = [(mesh, visual) for mesh, visual in pairs if len(mesh.faces)]
    materials = [getattr(getattr(visual, "material", None), "name", None) for _, visual in pairs]
    materials = tuple(name if name in names else None for name in materials)  # trimesh makes up names, too
    meshes = tuple(mesh for mesh, _ in pairs)
    return MeshFile(meshes, materials, (*said, *_told(text, kinds, meshes)), libraries)


def _plain(data: bytes) -> str:
    """The text with single spaces, LF at the ends of lines, and neither comments nor continued lines."""
    text = "\n" + data.decode(errors="replace").removeprefix("\ufeff") + "\n"
    text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ").replace("\0", " ")
    text = text.replace("\\\n", " ")
    text = re.sub(r"#(?<!\S#)[^\n]*", "", text) if "#" in text else text
    text = re.sub(r" {2,}", " ", text) if "  " in text else text
    text = text.replace("\n ", "\n").replace(" \n", "\n")
    return re.sub(r"\nusemtl(?=\n)", "\nusemtl none", text)


def _kinds_of_faces(text: str) -> tuple[Counter[bytes], bool]:
    """(how many faces are of each kind: their corners without digits; whether `_settled` has to look at each)."""
    corners = "\n".join(re.findall(r"\nf ([^\n]*)", text)).encode()
    if not corners:
        raise InputError("no faces in it: point clouds and curves are not drawn")
    kinds = Counter(corners.replace(b"//", b":").translate(None, b"0123456789-").split(b"\n"))
    wrong = {word for kind in kinds for word in kind.decode(errors="replace").split(" ")} - set(NUMBERS_OF)
    if wrong or b" /" in corners or b"\n/" in corners or corners[:1] == b"/":
        raise InputError(f"faces with corners other than {KINDS}, as {min(wrong, default='/')[:40]!r}")
    wrapped, edges = b" " + corners + b" ", (b" ", b"\n", b"/")
    if any(before + b"0" + behind in wrapped for before in edges for behind in edges):
        raise InputError("faces with index 0: they count from 1")
    sizes = Counter(_size(kind) for kind in kinds)
    return kinds, b"-" in corners or max(sizes.values()) > 1


def _size(kind: bytes) -> int:
    return sum(NUMBERS_OF[word] for word in kind.decode().split(" "))


def _settled(text: str, split_by: tuple[str, ...]) -> str:
    """The text with indices that count from the beginning. Raises InputError where the faces of one mesh are of kinds that
    trimesh takes for one another, as it goes by the count of their numbers."""
    counts, part, sizes = {"v": 0, "vt": 0, "vn": 0}, {}, {}
    lines = text.split("\n")
    for place, line in enumerate(lines):
        key, _, rest = line.partition(" ")
        if key in counts:
            counts[key] += 1
        elif key in split_by:
            part[key] = rest
        elif key == "f":
            if "-" in rest:
                rest = " ".join(_absolute(corner, counts) for corner in rest.split(" "))
                lines[place] = f"f {rest}"
            kind = rest.replace("//", ":").encode().translate(None, b"0123456789")
            if sizes.setdefault((*part.items(), _size(kind)), kind) != kind:
                raise InputError(f"faces whose corners are of several kinds in one group, as {line[:40]!r}")
    return "\n".join(lines)


def _absolute(corner: str, counts: dict[str, int]) -> str:
    words = []
    for word, count in zip(corner.split("/"), counts.values(), strict=False):
        if "-" in word:
            index = count + 1 + int(word) if re.fullmatch(r"-\d{1,18}", word) else 0
            if index < 1:
                raise InputError(f"index {word[:20]} of a face: there are {count} before it")
            word = str(index)
        words.append(word)
    return "/".join(words)


def _parts(text: str, materials: int) -> tuple[bool, list[str]]:
    """(whether objects and groups become meshes, what is said where they do not). Raises InputError beyond MOST_PARTS."""
    state, parts = {}, set()
    for key, name in re.findall(r"\n(o|g|usemtl) ([^\n]*)", text):
        state[key] = name
        parts.add((state.get("o"), state.get("g"), state.get("usemtl")))
    most = min(MOST_PARTS, MOST_WORK // (text.count("\nv ") + 1))
    if len(parts) <= most:
        return True, []
    if materials > most:
        raise InputError(f"{materials} materials; up to {most} are read")
    return False, [f"{len(parts)} objects, groups and materials: they are drawn as one for each material"]


def _told(text: str, kinds: Counter[bytes], meshes: tuple) -> list[str]:
    """What of the file is not drawn."""
    keys = set(re.findall(r"\n(l|p|vp|cstype|call|csh|shadow_obj|s [1-9])(?![^ \n\d])", text))
    said = list(dict.fromkeys(said for key, said in NOT_DRAWN.items() if key in keys))
    thin = sum(count for kind, count in kinds.items() if kind.count(b" ") < 2)
    said += [f"{thin} faces with fewer than 3 corners"] if thin else []
    given = b"".join(kinds)
    if "\nvn " not in text and keys - set(NOT_DRAWN):
        said.append("smoothing groups: without normals it is drawn flat")
    if re.search(r"\nv(?: \S+){6}", text):
        colored, vertices = len(re.findall(r"\nv(?: \S+){6}", text)), text.count("\nv ")
        said += [f"colours of {colored} of {vertices} vertices: the others have none"] if colored < vertices else []
        said += ["opacities behind the colours of vertices"] if re.search(r"\nv(?: \S+){7}", text) else []
    for what, marks, attribute in (("texture coordinates", b"/", "uv"), ("normals", b":", "normals")):
        without = [mesh.name for mesh in meshes if getattr(mesh, attribute) is None]
        if without and (marks in given or b"//" in given):
            said.append(f"{what} of {len(without)} meshes, as {without[0]}: not all of their corners have some")
    return said
