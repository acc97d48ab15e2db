"""Which files the layers of a USD stage name: they are followed, and checked, before the stage opens any of them."""

import zipfile
from collections.abc import Iterator
from pathlib import Path

from pxr import Ar, Sdf, Tf

from ..errors import InputError
from .containment import Reach, within

PACKAGE = ".usdz"
DEEPEST_PACKAGE = 8
MOST_LAYERS = 100_000
LOCAL_HEADER = 30  # bytes before the name of an entry in a zip file (PKWARE's APPNOTE, 4.3.7)


def open_layers(file: Path, reach: Reach) -> list[Sdf.Layer]:
    """All layers that a stage may compose, its own first: sublayers, references, payloads and value clips, also those inside
    variants. What is missing is left to the stage, since it may never ask for it.

    Raises InputError naming the layer for a file that the scene may not read, for packages that are no plain, stored zip
    files, and for layers that cannot be read. Nothing outside `reach` is opened.
    """
    layers: list[Sdf.Layer] = []
    waiting, seen = [str(file)], {str(file)}
    packages: set[str] = set()
    while waiting:
        path = waiting.pop()
        package, _ = _outermost(path)
        if package.lower().endswith(PACKAGE) and package not in packages:
            packages.add(package)
            _check_package(Path(package))
        layer = _open(path)
        if layer is None:
            continue
        layers.append(layer)
        for found in _checked_paths(layer, reach):
            if found not in seen:
                seen.add(found)
                waiting.append(found)
        if len(layers) > MOST_LAYERS:
            raise InputError(f"names more than {MOST_LAYERS} layers", file=file)
    if not layers:
        raise InputError("not a USD stage: it has no layer", file=file)
    return layers


def _outermost(path: str) -> tuple[str, str]:
    """The file of a path and what lies inside it: ("a.usdz", "b.usda") of "a.usdz[b.usda]"."""
    return Ar.SplitPackageRelativePathOuter(path) if Ar.IsPackageRelativePath(path) else (path, "")


def _open(path: str) -> Sdf.Layer | None:
    try:
        layer = Sdf.Layer.FindOrOpen(path)
        if layer is not None:
            layer.Reload()  # where another stage holds it as the file was before
        return layer
    except Tf.ErrorException as error:
        raise InputError(f"not a USD stage: {' '.join(str(error).split())}"[:500], file=_outermost(path)[0]) from None


def _checked_paths(layer: Sdf.Layer, reach: Reach) -> Iterator[str]:
    """The layers that a layer names and that are there, as the resolver finds them."""
    own = _outermost(layer.realPath or layer.identifier)[0]
    packed = own.lower().endswith(PACKAGE)
    for asset in sorted({*layer.GetCompositionAssetDependencies(), *_clips(layer)}):
        if asset.startswith("`"):
            if reach.outside:
                continue
            raise InputError(f"{asset[:200]} is an expression: which file it names is not followed", file=own)
        if not asset:
            continue
        plain = Sdf.Layer.SplitIdentifier(asset)[0]
        found = Ar.GetResolver().Resolve(Sdf.ComputeAssetPathRelativeToLayer(layer, plain)).GetPathString()
        if not found:
            if not packed and plain.startswith(("/", ".")):  # refused, there or not: the answer would tell what exists
                within(reach, Path(own).parent / plain, file=Path(own))
            continue
        outer = _outermost(found)[0]
        if packed and outer != own and not reach.outside:
            raise InputError(f"{plain[:200]} lies outside its package", file=own)
        within(reach, outer, file=Path(own))
        yield found


def _clips(layer: Sdf.Layer) -> Iterator[str]:
    """The layers of value clips, those of a template with each number that is there."""
    folder = Path(_outermost(layer.realPath or layer.identifier)[0]).parent

    found: list[dict] = []
    layer.Traverse("/", lambda path: found.append(_clip_sets(layer, path)))
    for item in (item for sets in found for item in sets.values()):
        paths = item.get("assetPaths") or ()
        yield from (path.path for path in paths)
        manifest, template = item.get("manifestAssetPath"), item.get("templateAssetPath")
        yield from [manifest.path] if manifest else []
        if template:
            pattern = template.replace("#", "[0-9]")
            matches = sorted(folder.glob(pattern)) if not Path(template).is_absolute() else []
            yield from (str(path) for path in matches) if matches else (template,)


def _clip_sets(layer: Sdf.Layer, path: Sdf.Path) -> dict:
    if path.IsPropertyPath():
        return {}
    spec = layer.GetObjectAtPath(path)
    return dict(spec.GetInfo("clips")) if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips") else {}


def _check_package(file: Path, archive=None, depth: int = 0) -> None:
    """A .usdz is a zip file whose entries are stored as they are, one behind the other, under names inside it."""
    try:
        with zipfile.ZipFile(archive or file) as package:
            end = package.start_dir
            entries = sorted(package.infolist(), key=lambda item: item.header_offset, reverse=True)
            for entry in entries:
                _check_entry(file, entry, end)
                end = entry.header_offset
                if entry.filename.lower().endswith(PACKAGE):
                    if depth == DEEPEST_PACKAGE:
                        raise InputError(f"its packages are more than {DEEPEST_PACKAGE} deep", file=file)
                    with package.open(entry) as inner:
                        _check_package(file, inner, depth + 1)
    except FileNotFoundError:
        return
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError, EOFError) as error:
        raise InputError(f"not a .usdz package: {error}", file=file) from None


def _check_entry(file: Path, entry: zipfile.ZipInfo, end: int) -> None:
    name = entry.filename[:200]
    if entry.compress_type != zipfile.ZIP_STORED or entry.flag_bits & 1 or entry.compress_size != entry.file_size:
        raise InputError(f"{name} is compressed or encrypted: entries of a .usdz are stored as they are", file=file)
    if entry.header_offset + LOCAL_HEADER + len(entry.filename) + entry.file_size > end:
        raise InputError(f"{name} overlaps with another entry or ends behind the package", file=file)
    if Path(name).is_absolute() or ".." in Path(name.replace("\\", "/")).parts or "\0" in name:
        raise InputError(f"{name!r} leaves the package", file=file)
