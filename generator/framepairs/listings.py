"""What is bundled, as lists: scenes and camera paths with their pictures, and one HTML page of either."""

import base64
import re
from dataclasses import dataclass
from pathlib import Path

import jinja2

from .bundled import bundled_folder, camera_path_names, find_camera_path, find_scene, scene_names
from .camera_path import frame_times, read_camera_path
from .manifest import write_atomically

FRAME = re.compile(r"^Frame ([0-9]+) of ", re.MULTILINE)  # under the picture of a scene's README


@dataclass(frozen=True, kw_only=True)
class Listed:
    """A bundled scene or camera path. picture: a JPEG, None where there is none. facts: short ones, by name. about: a
    paragraph. stresses: what a scene is hard for."""

    name: str
    file: Path
    picture: Path | None
    facts: dict[str, str]
    about: str = ""
    stresses: tuple[str, ...] = ()


def listed_scenes() -> list[Listed]:
    """The bundled scenes, with what their READMEs say of them."""
    found = []
    for name in scene_names():
        file = find_scene(name)
        text = _readme(name)
        paragraphs = [part for part in text.split("\n\n") if not part.startswith(("#", "!", "|", "Frame "))]
        rows = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", text, re.MULTILINE)
        kept = (item for item in file.parent.rglob("*") if item.is_file() and item.suffix not in (".py", ".pyc"))
        megabytes = sum(item.stat().st_size for item in kept) / 1e6
        found.append(
            Listed(
                name=name,
                file=file,
                picture=_picture(file.with_name(f"{name}.jpg")),
                facts={"format": file.suffix[1:], "MB": f"{megabytes:.1f}"},
                about=" ".join(paragraphs[0].split()) if paragraphs else "",
                stresses=tuple(row for row in rows if not row.startswith(("What it stresses", "---"))),
            )
        )
    return found


def scene_of_path(name: str) -> str:
    """The bundled scene that a bundled camera path is for: that of its name, or of what stands before its first "_"."""
    return name if name in scene_names() else name.split("_")[0]


def listed_cameras() -> list[Listed]:
    """The bundled camera paths; the picture is a strip of frames of their scene."""
    found = []
    for name in camera_path_names():
        file = find_camera_path(name)
        path = read_camera_path(file)
        times = frame_times(path)
        facts = {"scene": scene_of_path(name), "frames": str(len(times)), "seconds": f"{times[-1]:.2f}", "fps": f"{path.fps:g}"}
        found.append(Listed(name=name, file=file, picture=_picture(file.with_suffix(".jpg")), facts=facts))
    return found


def pictured_frame(scene: str) -> int:
    """The frame of a bundled scene's own path that its README shows. Raises ValueError where it says none."""
    match = FRAME.search(_readme(scene))
    if match is None:
        raise ValueError(f"{scene}: its README has no line 'Frame N of its own path'")
    return int(match[1])


def write_page(title: str, entries: list[Listed], file: Path) -> None:
    """One HTML file that needs no other: pictures lie inside it. Raises InputError where it cannot be written."""
    loader = jinja2.PackageLoader("framepairs")
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    pictures = {item.name: base64.b64encode(item.picture.read_bytes()).decode() for item in entries if item.picture}
    page = environment.get_template("listing.html.j2").render(title=title, entries=entries, pictures=pictures)
    write_atomically(file, page.encode())


def _readme(scene: str) -> str:
    file = bundled_folder("scenes") / scene / "README.md"
    return file.read_text() if file.is_file() else ""


def _picture(file: Path) -> Path | None:
    return file if file.is_file() else None
