"""Where the bundled scenes, camera paths and schemas lie: inside an installed wheel, or at the top of a checkout."""

from pathlib import Path

from .errors import InputError

PACKAGE = Path(__file__).parent


def bundled_folder(kind: str) -> Path:
    """Folder of `kind` ('scenes', 'camera_paths' or 'schemas')."""
    installed = PACKAGE / "bundled" / kind
    return installed if installed.is_dir() else PACKAGE.parents[1] / kind


def scene_names() -> list[str]:
    return sorted(folder.name for folder in bundled_folder("scenes").iterdir() if _description_of(folder))


def camera_path_names() -> list[str]:
    return sorted(file.stem for file in bundled_folder("camera_paths").glob("*.json"))


def find_scene(scene: str) -> Path:
    """The file of a bundled scene's name, or `scene` itself when it is a file.

    Raises InputError when it is neither.
    """
    bundled = _description_of(bundled_folder("scenes") / scene) if scene in scene_names() else None
    return _existing(bundled or Path(scene), "scene", scene_names())


def find_camera_path(path: str, others: tuple[str, ...] = ()) -> Path:
    """The JSON file of a bundled camera path's name, or `path` itself when it is a file. others: names for the error alone."""
    bundled = bundled_folder("camera_paths") / f"{path}.json" if path in camera_path_names() else None
    return _existing(bundled or Path(path), "camera path", [*camera_path_names(), *others])


def _description_of(folder: Path) -> Path | None:
    candidates = [folder / f"{folder.name}{suffix}" for suffix in (".usda", ".usd", ".usdc", ".gltf", ".glb", ".xml")]
    return next((file for file in candidates if file.is_file()), None)


def _existing(file: Path, what: str, names: list[str]) -> Path:
    if not file.is_file():
        raise InputError(f"no such {what}: neither a file nor a bundled name ({', '.join(names)})", file=file)
    return file
