"""Which files the layers of a USD stage name: they are followed, and checked, before the stage opens any of them."""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Pcp, Sdf, Tf

from ..errors import InputError
from .containment import Reach, within
from .usd_trial import try_stage

PACKAGE = ".usdz"
CRATE = b"PXR-USDC"
DEEPEST_PACKAGE = 8
MOST_LAYERS = 100_000
MOST_PRIMS = 2**18  # a stage of so many takes 10 s to open and read
DEEPEST_PRIM = 256  # what is asked of all prims above a prim takes the square of it
DEEPEST_TEXT = 1024  # brackets in brackets: usd-core 26.11's parser calls itself for each, and ends the process at some 10 000
MOST_CLIP_TIMES = 2**20
BRACKETS = b"[({])}"
NO_BRACKETS = bytes(set(range(256)) - set(BRACKETS))
STEPS = bytes.maketrans(BRACKETS, b"\x01\x01\x01\xff\xff\xff")  # +1 and -1 as signed bytes
# Strings, asset paths and comments of a .usda; one without end goes to the end of the file.
QUOTED = re.compile(
    rb'"""(?:[^"\\]|\\[\s\S]|"(?!""))*+(?:""")?|"(?:[^"\\]|\\[\s\S])*+"?'
    rb"|'''(?:[^'\\]|\\[\s\S]|'(?!''))*+(?:''')?|'(?:[^'\\]|\\[\s\S])*+'?"
    rb"|@@@(?:[^@\\]|\\(?:@@@)?+|@(?!@@))*+(?:@@@)?|@[^@]*+@?"
    rb"|#[^\n]*+|//[^\n]*+|/\*(?:[^*]|\*(?!/))*+"
)
LOCAL_HEADER = 30  # bytes before the name of an entry in a zip file (PKWARE's APPNOTE, 4.3.7)


def open_layers(file: Path, reach: Reach, tried: bool = False) -> list[Sdf.Layer]:
    """All layers that a stage may compose, its own first: sublayers, references, payloads and value clips, also those inside
    variants. What is missing is left to the stage, since it may never ask for it.

    Raises InputError naming the layer for a file that the scene may not read, for packages that are no plain, stored zip
    files, and for layers that cannot be read. Nothing outside `reach` is opened. tried: binary layers are opened without a
    trial in another process.
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
        if not _is_crate(path):
            _check_nesting(path)
        elif not tried:
            try_stage(file, reach)
            tried = True
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


def outermost_file(layer: Sdf.Layer) -> Path:
    """The file that a layer, or the package around it, lies in."""
    return Path(_outermost(layer.realPath or layer.identifier)[0])


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
        first = " ".join(str(error.args[0]).split())  # a damaged file may have millions
        raise InputError(f"not a USD stage: {first}"[:500], file=_outermost(path)[0]) from None
    except MemoryError:
        raise InputError("not a USD stage: reading it takes more memory than there is", file=_outermost(path)[0]) from None


def _checked_paths(layer: Sdf.Layer, reach: Reach) -> Iterator[str]:
    """The layers that a layer names and that are there, as the resolver finds them."""
    own = _outermost(layer.realPath or layer.identifier)[0]
    clips = set(_clips(_specs(layer, own), own, reach))
    packed = own.lower().endswith(PACKAGE)
    for asset in sorted({*layer.GetCompositionAssetDependencies(), *clips}):
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


def _is_crate(path: str) -> bool:
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    return bool(opened and opened.GetSize()) and bytes(opened.Read(len(CRATE), 0)) == CRATE


def _check_nesting(path: str) -> None:
    """Raises InputError for a layer of text whose brackets are too deep in each other."""
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    data = bytes(opened.GetBuffer()) if opened and opened.GetSize() else b""
    brackets = QUOTED.sub(b"", data).translate(STEPS, NO_BRACKETS)
    steps = np.frombuffer(brackets, np.int8)
    if np.cumsum(steps, dtype=np.int32).max(initial=0) > DEEPEST_TEXT:
        raise InputError(f"not a USD stage: brackets in more than {DEEPEST_TEXT} others", file=_outermost(path)[0])


def check_prims(layer: Sdf.Layer) -> None:
    """Walks over the prims that a stage of `layer` will have, before it makes them. Raises InputError where they are too many
    or too deep: references to references can double their number with each line of a file."""
    cache = Pcp.Cache(Pcp.LayerStackIdentifier(layer), "usd", True)
    waiting, count = [Sdf.Path.absoluteRootPath], 0
    while waiting:
        path = waiting.pop()
        index, _ = cache.ComputePrimIndex(path)
        if index.hasAnyPayloads:
            cache.RequestPayloads([path], [])
            index, _ = cache.ComputePrimIndex(path)
        count += 1
        names = index.ComputePrimChildNames()[0]
        if count + len(waiting) + len(names) > MOST_PRIMS:
            raise InputError(f"more than {MOST_PRIMS} prims", file=layer.realPath)
        if names and path.pathElementCount >= DEEPEST_PRIM:
            raise InputError(f"prims in more than {DEEPEST_PRIM} others", file=layer.realPath, field=names[0])
        waiting += [path.AppendChild(name) for name in names]


def _specs(layer: Sdf.Layer, own: str) -> list[Sdf.Spec]:
    """The prims and variants of a layer. Raises InputError where it lists what it does not hold: USD ends the process then."""
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    found = []
    for path in paths:
        is_prim = path.IsPrimPath() or path.IsPrimVariantSelectionPath()
        if path.isEmpty or (is_prim or path.IsPropertyPath()) and not layer.GetObjectAtPath(path):
            raise InputError(f"not a USD stage: {str(path)[:200] or 'a prim without a name'} is damaged", file=own)
        found += [layer.GetPrimAtPath(path)] if is_prim else []
    return [spec for spec in found if spec]  # sets of variants are none


def _clips(specs: list[Sdf.Spec], own: str, reach: Reach) -> Iterator[str]:
    """The layers of value clips, those of a template with each number that is there."""
    sets = [dict(spec.GetInfo("clips")) for spec in specs if spec.HasInfo("clips")]
    for item in (item for values in sets for item in values.values() if isinstance(item, dict)):
        paths, manifest, template = (item.get(key) for key in ("assetPaths", "manifestAssetPath", "templateAssetPath"))
        assets = [*(paths if isinstance(paths, Sdf.AssetPathArray) else ()), manifest]
        yield from (asset.path for asset in assets if isinstance(asset, Sdf.AssetPath))
        if isinstance(template, str) and template:
            _check_clip_times(item, own)
            yield from _files_of_template(template, own, reach)


def _check_clip_times(values: dict[str, Any], own: str) -> None:
    """USD asks for the file of every time of a template. Raises InputError where they are without end."""
    first, last, stride = (values.get(f"template{name}", 0.0) for name in ("StartTime", "EndTime", "Stride"))
    if all(isinstance(value, int | float) for value in (first, last, stride)) and stride > 0:
        if not (last - first) / stride < MOST_CLIP_TIMES:
            raise InputError(f"value clips at more than {MOST_CLIP_TIMES} times", file=own)


def _files_of_template(template: str, own: str, reach: Reach) -> Iterator[str]:
    """The files in whose place a template of value clips may stand: its `#` are numbers of any length. A relative one is
    looked up beside its layer, and by USD's resolver in the working folder, too. Raises InputError where it leaves `reach`."""
    named = Path(template)
    within(reach, Path(own).parent / named.parent / "_", file=Path(own))
    pattern = re.compile(re.sub(r"#+", r"-?\\d+", re.escape(named.name).replace(r"\#", "#")))
    for folder in (Path(own).parent, *([] if template.startswith(".") else [Path.cwd()])):
        beside = folder / named.parent
        names = sorted(item.name for item in beside.iterdir()) if beside.is_dir() else ()
        yield from (str(named.with_name(name)) for name in names if pattern.fullmatch(name))
    yield template


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
