"""The code that a study's figures come from: what its module imports, and theirs."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import softnn

ROOT = Path(softnn.__file__).parents[1]
OURS = ("softnn", "studies", "bench")
# These show what is found, or declare what things are: a word, a colour, another field
# leaves figures as they are.
SHOWING = ("report", "reporting", "page", "shown", "cli", "tracking", "pictures")
DECLARING = ("contracts", "code")
SEARCHING = "iter_modules"  # in a package that imports all it holds


def running_study() -> str | None:
    """The module that `python -m` runs, where it is one of the studies."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    name = getattr(spec, "name", "")
    return name if name.startswith("studies.") else None


@cache
def files_of(module: str, around: bool = True) -> tuple[Path, ...]:
    """Files (sorted) of this project that a module runs, those that only show apart.

    Packages around what is imported run, too; not `around` leaves these out.
    """
    found: set[Path] = set()
    todo = [module]
    while todo:
        for file in _files(todo.pop(), around):
            if file in found or _shows(file):
                continue
            found.add(file)
            text = file.read_text(encoding="utf-8")
            package = file.name == "__init__.py"
            todo += _imported(ast.parse(text), lazily=not package)
            if package and SEARCHING in text:
                name = ".".join(file.relative_to(ROOT).parent.parts)
                todo += [f"{name}.{f.stem}" for f in file.parent.glob("*.py")]
    return tuple(sorted(found))


def _shows(file: Path) -> bool:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return any(part.rpartition("_")[2] in (*SHOWING, *DECLARING) for part in parts[1:])


def _files(module: str, around: bool) -> Iterator[Path]:
    """Its file and those of the packages around it; none where it is no module."""
    parts = module.split(".")
    if parts[0] not in OURS:
        return
    for i in range(1 if around else len(parts), len(parts) + 1):
        place = ROOT.joinpath(*parts[:i])
        for file in (place / "__init__.py", place.with_suffix(".py")):
            if file.is_file():
                yield file


def _imported(tree: ast.Module, lazily: bool) -> Iterator[str]:
    """Modules that are imported: with those within functions, where `lazily`.

    What a package offers lazily is imported from elsewhere in it by who uses it.
    """
    todo: list[ast.AST] = [tree]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            todo += node.orelse
            continue
        if lazily or not isinstance(node, ast.FunctionDef):
            todo += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
