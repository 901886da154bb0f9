"""The structure is what docs/decisions.md says: imports point one way, files are named
after what they hold, and configuration names things that exist."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "softnn"

# A module imports only what stands on a line above it; siblings do not know each other.
ORDER = (
    ("contracts",),
    ("axes", "glance", "json_file", "progress"),
    (
        "recording",
        "metrics",
        "materials",
        "noise",
        "bounded",
        "start",
        "workers",
        "database",
        "state",
    ),
    ("plausible",),
    ("readers", "prepare", "virtual", "models", "effects", "neural"),
    ("dynamic", "properties", "simulate", "datasets"),
    ("fit",),
    ("crossval", "model_file"),
    ("cards",),
    ("search", "tracking", "report", "taught"),
    ("mismatch",),
    ("export", "motor"),
    ("actuator",),
    ("study",),
    ("app",),
    ("cli",),
)
RANK = {name: i for i, row in enumerate(ORDER) for name in row}

# One home for each heavy dependency: whoever replaces it edits one place.
HOMES = {"optuna": "search", "mlflow": "tracking", "torch": "neural", "onnx": "export"}
HOMES |= {"plotly": "report", "jinja2": "report", "pooch": "datasets"}
HOMES |= {"nicegui": "app", "fastapi": "app"}


def modules(folder: Path) -> list[Path]:
    return sorted(p for p in folder.rglob("*.py") if "__pycache__" not in p.parts)


def imports(tree: ast.Module) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def home(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


@pytest.mark.parametrize(
    "path", modules(PACKAGE), ids=lambda p: str(p.relative_to(ROOT))
)
def test_imports_point_one_way(path):
    here = home(path)
    if here == "__init__":
        return
    assert here in RANK, f"{here} has no place in ORDER; give it one"
    for name in imports(ast.parse(path.read_text())):
        parts = name.split(".")
        assert parts[0] not in ("bench", "studies"), f"softnn never imports {parts[0]}"
        if parts[0] == "softnn" and len(parts) > 1 and parts[1] != here:
            if parts[1] in RANK:
                assert RANK[parts[1]] < RANK[here], f"{here} imports {name}"
        if parts[0] in HOMES:
            assert here == HOMES[parts[0]], f"{here} imports {parts[0]}"


@pytest.mark.parametrize(
    "path", modules(PACKAGE), ids=lambda p: str(p.relative_to(ROOT))
)
def test_figures_cost_nothing_until_they_are_drawn(path):
    for node in ast.parse(path.read_text()).body:
        names = imports(ast.Module([node], []))
        if isinstance(node, ast.Import | ast.ImportFrom):
            assert not any(n.startswith("matplotlib") for n in names)


def test_no_modules_import_each_other_in_a_circle():
    """At import time; what is imported in a function comes later."""
    files = [p for f in ("softnn", "bench", "studies") for p in modules(ROOT / f)]
    named = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in files}
    needs = {}
    for name, path in named.items():
        top = ast.Module(
            [n for n in ast.parse(path.read_text()).body if not isinstance(n, ast.If)],
            [],
        )
        found = {n for node in top.body if isinstance(node, ast.Import | ast.ImportFrom)
                 for n in imports(ast.Module([node], []))}  # fmt: skip
        needs[name] = {
            m for n in found for m in (n, n.rpartition(".")[0]) if m in named
        } - {name}
    while ready := {name for name, of in needs.items() if not of & needs.keys()}:
        needs = {name: of for name, of in needs.items() if name not in ready}
    assert needs == {}


def test_relative_imports_are_not_used():
    for path in modules(PACKAGE) + modules(ROOT / "bench") + modules(ROOT / "studies"):
        for node in ast.walk(ast.parse(path.read_text())):
            assert not (isinstance(node, ast.ImportFrom) and node.level), path


def test_bench_knows_no_study_and_the_forge_of_others_not_even_softnn():
    for path in modules(ROOT / "bench"):
        text = path.read_text()
        known = {name.split(".")[0] for name in imports(ast.parse(text))}
        assert "studies" not in known, path
        if path.parent.name == "hands":
            assert "softnn" not in known, path
            # What only a type checker imports can close a circle, too.
            assert "TYPE_CHECKING" not in text, path


def test_an_effect_is_a_file_of_its_name():
    from softnn.effects import EFFECTS

    files = {p.stem for p in (PACKAGE / "effects").glob("[a-z]*.py")}
    assert {effect.id for effect in EFFECTS} == files
    assert len(EFFECTS) == len(files)


def test_configuration_names_what_exists():
    config = tomllib.loads((ROOT / "pyproject.toml").read_text())
    tool = config["tool"]
    for name in tool["pytest"]["ini_options"]["testpaths"] + tool["mypy"]["files"]:
        assert (ROOT / name).exists(), name
    for name in config["project"]["license-files"] + [config["project"]["readme"]]:
        assert (ROOT / name).exists(), name


def test_no_pickle_and_no_eval():
    for path in modules(PACKAGE) + modules(ROOT / "bench") + modules(ROOT / "studies"):
        tree = ast.parse(path.read_text())
        assert not any(
            name.split(".")[0] in {"pickle", "joblib", "dill", "shelve"}
            for name in imports(tree)
        ), path
        called = {
            node.func.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        assert not called & {"eval", "exec"}, path
