"""docs/controllers.md: every example in it, run in the order in which it stands."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from softnn import cli
from softnn.export.fmu import STRICT

PAGE = Path(__file__).parent.parent / "docs" / "controllers.md"
EXAMPLE = re.compile(r"^```(python|sh|c)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_every_example_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("onnx")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    printed = ""
    for language, text in EXAMPLE.findall(PAGE.read_text(encoding="utf-8")):
        if language == "python":
            exec(compile(text, str(PAGE), "exec"), names)
        elif language == "sh":
            for line in text.splitlines():
                command, *arguments = shlex.split(line)
                assert command == "softnn"
                assert cli.main(arguments) == 0, line
        else:
            Path("controller/main.c").write_text(text)
            command = ["gcc", *STRICT, "main.c", "strip.c", "-o", "main", "-lm"]
            subprocess.run(command, cwd="controller", check=True)
            printed = subprocess.run(
                ["controller/main"], capture_output=True, text=True, check=True
            ).stdout
    # C in a process of its own and C called from Python are one model.
    stress, flags = printed.split()
    assert float(stress) == pytest.approx(names["stress"][-1], abs=2e-9)
    assert flags == "0"
    # Both know the strips: 2 MPa, and a branch of 1 MPa that a second does not relax.
    # The strip of the controller is not one of them: it has their mean stiffness.
    assert names["stress"][-1] == pytest.approx(0.25 * (2 + 0.85), rel=0.02)
    table = pd.read_csv("simulated/a.csv")
    mean = pd.read_csv("strips/a.csv")["stress_MPa"] * (1.05 / 0.95) ** 0.5
    off = np.sqrt(np.mean((table["simulated_MPa"] - mean) ** 2) / np.mean(mean**2))
    assert off < 0.03
    assert names["error"] < 0.1
    for file in ("network.c", "network-fmi2.fmu", "network-fmi3.fmu", "network.onnx"):
        assert Path("controller", file).stat().st_size > 1000
    assert "*UNIAXIAL TEST DATA" in Path("cards/model.inp").read_text().upper()
    assert Path("cards/model.mac").exists()
