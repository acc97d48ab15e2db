"""The structure drawn by the imports is the one that docs/architecture.md tells."""

import ast
import re
from functools import lru_cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "generator" / "framepairs"
ARCHITECTURE = (PACKAGE.parents[1] / "docs" / "architecture.md").read_text()
DRJIT_FREE = {"corpus", "exr", "manifest", "channels", "conventions", "jitter", "plan", "errors", "camera_path"}
DRJIT_FREE |= {"motion_conventions", "demodulation"}


def module_order() -> list[str]:
    block = re.search(r"```modules\n(.*?)```", ARCHITECTURE, re.DOTALL).group(1)
    return [name for line in block.splitlines() for name in line.split(":", 1)[1].split()]


def module_name(file: Path) -> str:
    name = file.relative_to(PACKAGE).with_suffix("").as_posix()
    return name.removesuffix("/__init__")


@lru_cache
def modules() -> dict[str, ast.Module]:
    files = [file for file in PACKAGE.rglob("*.py") if file != PACKAGE / "__init__.py"]
    return {module_name(file): ast.parse(file.read_text()) for file in files}


def imports_of(name: str, tree: ast.Module) -> set[str]:
    """Modules of the package that `name` imports, anywhere in its text."""
    is_package = (PACKAGE / name / "__init__.py").exists()
    folder = Path(name) if is_package else Path(name).parent
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = folder
            for _ in range(node.level - 1):
                base = base.parent
            target = (base / (node.module or "").replace(".", "/")).as_posix().strip("./")
            named = {f"{target}/{alias.name}".strip("/") for alias in node.names}
            found |= named if named <= set(modules()) else named | {target}
    return found & set(modules())


def test_every_module_has_its_place_and_imports_only_from_above():
    order = module_order()
    assert sorted(order) == sorted(modules())
    for name, tree in modules().items():
        below = {other for other in imports_of(name, tree) if order.index(other) >= order.index(name)}
        assert not below, f"{name} imports {below}, which stand below it"


def test_no_module_is_longer_than_300_lines():
    for file in PACKAGE.rglob("*.py"):
        lines = len(file.read_text().splitlines())
        assert lines <= 300, f"{file.name}: {lines} lines"


def test_only_the_command_line_and_its_tables_print():
    for name, tree in modules().items():
        calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "print"]
        assert name in {"cli", "cli_corpora", "cli_render", "cli_scenes", "cli_upscale", "terminal"} or not calls, name


def test_nothing_but_backend_imports_drjit_or_mitsuba():
    for name, tree in modules().items():
        for node in ast.walk(tree):
            roots = [alias.name.split(".")[0] for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                roots = [node.module.split(".")[0]]
            assert name == "backend" or not {"drjit", "mitsuba"} & set(roots), name


def test_what_reads_a_corpus_never_reaches_drjit():
    trees = modules()

    def reached(name: str, seen: set[str]) -> set[str]:
        for other in imports_of(name, trees[name]) - seen:
            seen |= {other} | reached(other, seen | {other})
        return seen

    for name in DRJIT_FREE:
        assert "backend" not in reached(name, {name}), name


def test_no_module_is_called_utils():
    assert not {name for name in modules() if name.split("/")[-1] in {"utils", "helpers", "common", "misc"}}
