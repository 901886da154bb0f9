"""A study's `--smoke`, with what every study owes it; each is run by one test."""

import importlib
import json
from pathlib import Path

import studies

FOLDER = Path(studies.__path__[0])


def smoked(name: str) -> dict[str, dict]:
    """Run a study's smoke in the current folder; its results by the names of files."""
    before = _times(FOLDER / "results")
    study = importlib.import_module(f"studies.{name}")
    assert study.main(["--smoke"]) == 0
    assert _times(FOLDER / "results") == before, "--smoke touched real results"
    if "?" not in study.__doc__.split("\n\n")[0]:
        return {}  # a tool: it answers no question, and has no result to write
    found = {
        file.stem: json.loads(file.read_text())
        for file in Path("mlruns/smoke/results").glob("*.json")
    }
    assert found, "a study ends in write_result"
    for result in found.values():
        assert result["headline"]
        values = result["headline"].values()
        assert not any(isinstance(v, dict | list) for v in values)
    return found


def _times(folder: Path) -> dict[str, int]:
    return {f.name: f.stat().st_mtime_ns for f in folder.glob("*")}
