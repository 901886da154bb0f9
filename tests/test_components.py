"""A component without geometry: read, diagnosed and simulated in its own units."""

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from softnn import cli, readers
from softnn.axes import COMPONENTS, SPECIMEN, axes_of
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.mismatch import api
from softnn.model_file import read_model
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import Term, simulate

FORCE, TORQUE = COMPONENTS
STIFFNESS, FRICTION, PRESLIDING = 20.0, 0.5, 0.02  # Nm/deg, Nm, deg


def bench(amplitude, seed):
    """A torsional spring with friction: three sweeps, 0.01 Nm of noise."""
    time = np.linspace(0, 12, 601)
    corners = amplitude * np.array([0, 1, -1, 1, -1, 0])
    angle = np.interp(time, [0, 1, 4, 7, 10, 12], corners)
    law = effect("friction_hysteresis")
    values = law.defaults() | {"friction_MPa": FRICTION, "presliding": PRESLIDING}
    (torque,) = simulate(
        Units("hooke", (0.0, 1.0)),
        [STIFFNESS],
        [Term(law, values)],
        [Chunk(time, angle)],
    )
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(time))
    return time, angle, torque + noise


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    for name, amplitude in (("small", 0.2), ("large", 0.5)):
        table = dict(zip(TORQUE.columns, bench(amplitude, 1), strict=True))
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def diagnosed(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    command = ["diagnose", str(folder), "--model", "hooke", "--out", str(out)]
    assert cli.main(command) == 0
    return out / folder.name


def test_what_a_file_holds_is_told_by_its_columns():
    assert axes_of(["time_s", "strain", "stress_MPa", "force_N", "elongation_mm"]) == (
        SPECIMEN
    )
    assert axes_of(["elongation_mm", "force_N", "time_s"]) == FORCE
    assert axes_of(["deflection_deg", "force_N"]) is None


def test_read_keeps_the_units(folder, tmp_path, capsys):
    (one,) = readers.read(folder / "large.csv")
    assert one.axes == TORQUE
    assert one.strain.max() == 0.5
    command = ["read", str(folder / "large.csv"), "--out", str(tmp_path)]
    assert cli.main(command) == 0
    told = capsys.readouterr().out
    assert "-0.5 to 0.5 deg" in told
    assert " Nm" in told
    assert "MPa" not in told
    written = pd.read_csv(tmp_path / "large.csv")
    assert tuple(written.columns) == TORQUE.columns
    np.testing.assert_allclose(written["torque_Nm"], one.stress_MPa, rtol=1e-8)
    table = Recording.from_frame(written)
    assert (table.axes, table.strain.max()) == (TORQUE, 0.5)


def test_friction_of_a_spring_is_named_in_newton_metres(diagnosed):
    told = json.loads((diagnosed / "diagnosis.json").read_text())
    assert told["selected"] == ["friction_hysteresis"]
    numbers = told["explanations"][0]["parameters"]
    # The radii spread about r are in the law; half the loop's height is F.
    assert numbers["friction_MPa"]["value"] == pytest.approx(FRICTION, rel=0.05)
    assert numbers["friction_MPa"]["unit"] == "Nm"
    assert numbers["presliding"]["value"] == pytest.approx(PRESLIDING, rel=0.1)
    assert numbers["presliding"]["unit"] == "deg"
    assert told["noise"]["sigma_Nm"] == pytest.approx(0.01, rel=0.15)
    assert all(abs(x) <= 0.5 for m in told["mismatch"] for x in m["deflection_deg"])


def test_corrected_model_simulates_another_amplitude(diagnosed, tmp_path):
    file = tmp_path / "new.csv"
    time, angle, torque = bench(0.42, 2)
    table = dict(zip(TORQUE.columns, (time, angle, torque), strict=True))
    pd.DataFrame(table).to_csv(file, index=False)
    model = diagnosed / "model.json"
    command = ["simulate", str(model), str(file), "--out", str(tmp_path / "out")]
    assert cli.main(command) == 0
    made = pd.read_csv(tmp_path / "out" / "new.csv")
    assert list(made) == ["time_s", "deflection_deg", "simulated_Nm", "torque_Nm"]
    miss = made["simulated_Nm"] - torque
    assert np.sqrt(np.mean(miss**2)) < 0.02  # two sigmas of the noise
    stored = read_model(model)
    assert stored.axes.like(TORQUE)
    base = json.loads(model.read_text())["base"]
    per = stored.axes.stress.one / stored.axes.strain.one
    assert base["stiffness_MPa"][0] * per == pytest.approx(STIFFNESS, rel=0.02)


def test_the_unit_changes_no_answer():
    """Millimetres or tens of kilometres: the same names, the same errors."""
    told = []
    for size in (1.0, 1000.0):
        recordings = [
            Recording(t, size * x, 50 * size * y, name=str(a), axes=FORCE)
            for a, (t, x, y) in ((a, bench(a, 1)) for a in (0.2, 0.5))
        ]
        told.append(api.diagnose(recordings, "hooke").result)
    assert told[0]["selected"] == told[1]["selected"] == ["friction_hysteresis"]
    one, two = (t["explanations"][0]["parameters"]["presliding"] for t in told)
    assert two["value"] == pytest.approx(1000 * one["value"], rel=1e-6)
    assert (one["unit"], two["unit"]) == ("mm", "mm")
    errors = [t["fit"]["after"]["heldout_nrmse"] for t in told]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


def test_kinds_do_not_mix(diagnosed):
    time, angle, torque = bench(0.2, 1)
    spring = Recording(time, angle, torque, name="spring", axes=TORQUE)
    strip = Recording(time, angle, torque, name="strip")
    with pytest.raises(InputError, match=r"strip holds stress \[MPa\], spring torque"):
        api.diagnose([spring, strip])
    with pytest.raises(InputError, match="all of one kind"):
        read_model(diagnosed / "model.json").simulate(strip)


def test_missing_column_is_told_with_what_would_do(tmp_path):
    file = tmp_path / "half.csv"
    file.write_text("time_s,torque_Nm\n0,1\n1,2\n")
    with pytest.raises(InputError, match="deflection_deg,torque_Nm"):
        readers.tidy.read_tidy(file)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_c_takes_degrees_and_gives_newton_metres(diagnosed, tmp_path):
    model = diagnosed / "model.json"
    command = ["export", str(model), "--to", "c", "--name", "s", "--out", str(tmp_path)]
    assert cli.main(command) == 0
    assert "torque [Nm]" in (tmp_path / "s.h").read_text()
    library = tmp_path / "s.so"
    gcc = ["gcc", "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([*gcc, tmp_path / "s.c", "-lm", "-o", library], check=True)
    step = ctypes.CDLL(str(library))
    step.s_step.restype = ctypes.c_double
    step.s_step.argtypes = [ctypes.c_void_p] + 4 * [ctypes.c_double]
    state = ctypes.create_string_buffer(1 << 16)
    step.s_init(state)
    time, angle, _ = bench(0.4, 3)
    lapse = np.diff(time, prepend=0.0)
    c = [
        step.s_step(state, d, x, np.nan, 0.0) for d, x in zip(lapse, angle, strict=True)
    ]
    (wanted,) = read_model(model).stress(["x"], [Chunk(time, angle)], [None])
    np.testing.assert_allclose(c, wanted, rtol=1e-9, atol=1e-12)
    assert (
        cli.main(["export", str(model), "--to", "abaqus", "--out", str(tmp_path)]) == 2
    )


def test_specimens_are_as_they_were():
    bare = replace(Recording(np.arange(3.0), np.arange(3.0), np.arange(3.0)), name="a")
    assert list(bare.columns) == ["time_s", "strain", "stress_MPa"]
