"""The project's own files, as the tests of its structure see them."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("spherify", "service", "worker")
FOLDERS = (*PACKAGES, "tests", "docs", "benchmarks", "deploy")


def modules() -> dict[str, Path]:
    """Every module of the packages by its full name, such as ``spherify.jobs.run``."""
    found = {}
    for package in PACKAGES:
        for path in _ours(ROOT / package):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def python_files() -> list[Path]:
    """Every Python file that people read and write here."""
    return [path for folder in FOLDERS for path in _ours(ROOT / folder)]


def web_files() -> list[Path]:
    """Every file of the web page that people read and write here."""
    sources = ROOT / "service" / "web" / "src"
    return [
        path
        for path in sorted(sources.rglob("*"))
        if path.suffix in {".ts", ".css"} and "generated" not in path.parts
    ]


def _ours(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*.py")) if "node_modules" not in path.parts]


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of everything a file imports, within functions too, but not what only types need."""
    tree = ast.parse(path.read_text("utf-8"), str(path))
    skipped = {inner for node in ast.walk(tree) if _is_for_types(node) for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute here"
            assert node.module is not None
            # `from service import uploads` imports service.uploads; a name that is no module does no harm
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def is_standard(name: str) -> bool:
    """Whether a module comes with Python."""
    return name.split(".", maxsplit=1)[0] in sys.stdlib_module_names


def within(name: str, package: str) -> bool:
    """Whether a module is a package or lies in it."""
    return name == package or name.startswith(f"{package}.")


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
