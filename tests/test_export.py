"""C, FMU and ONNX say what Python says; cards carry the numbers of the model."""

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softnn import cli
from softnn.contracts import Chunk, InputError, Scales
from softnn.effects import EFFECTS, effect
from softnn.export.files import Options, export, stored_of, write
from softnn.export.source import c_source
from softnn.export.templates_of import FOLDER, blocks, identifier
from softnn.fit import Piece
from softnn.model_file import Stored, read_model
from softnn.models import (
    PLSLS,
    Burgers,
    Hooke,
    KelvinVoigt,
    Maxwell,
    PLWiechert,
    StandardLinearSolid,
    Wiechert,
)
from softnn.models.units import Units, build
from softnn.neural import PUBLISHED, Scaling, Seen, StoredNetwork, architecture_of

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
STRICT = ["-std=c99", "-O2", "-pedantic", "-Wall", "-Wextra", "-Werror"]
SCALES = Scales(0.6, 2.0, 1e-3, np.array([35.0]), 5.0, 5.0)
FORMS_OF_EFFECTS = [law for e in EFFECTS for law in (e, *e.second_forms)]


class Compiled:
    """A model's C, compiled strictly and loaded: `run` steps through a history."""

    def __init__(self, folder: Path, model, name="model", options=None):
        for text, ending in zip(c_source(model, name, options), "hc", strict=True):
            (folder / f"{name}.{ending}").write_text(text, encoding="ascii")
        (folder / "size.c").write_text(
            f'#include "{name}.h"\n'
            "unsigned long size(void);\nunsigned flags(const void *s);\n"
            f"unsigned long size(void) {{ return sizeof({name}_state); }}\n"
            "unsigned flags(const void *s)\n"
            f"{{ return ((const {name}_state *)s)->flags; }}\n"
        )
        path = folder / "model.so"
        files = [folder / f"{name}.c", folder / "size.c"]
        subprocess.run(
            ["gcc", *STRICT, "-shared", "-fPIC", "-o", path, *files, "-lm"], check=True
        )
        library = ctypes.CDLL(str(path))
        library.size.restype = ctypes.c_ulong
        library.flags.argtypes = [ctypes.c_void_p]
        self.flags = library.flags
        self.step = library[f"{name}_step"]
        self.step.restype = ctypes.c_double
        self.step.argtypes = [ctypes.c_void_p] + [ctypes.c_double] * 4
        self.state = ctypes.create_string_buffer(library.size())
        self.place = ctypes.addressof(self.state)
        start = library[f"{name}_init"]
        start.argtypes = [ctypes.c_void_p]
        start(self.place)

    def run(self, chunk, simulated=None):
        nothing = np.full(len(chunk.time_s), np.nan)
        warm = nothing if chunk.temperature_C is None else chunk.temperature_C
        given = nothing if simulated is None else simulated
        steps = np.diff(chunk.time_s, prepend=chunk.time_s[0])
        stress, flags = [], []
        for row in zip(steps, chunk.strain, warm, given, strict=True):
            stress.append(self.step(self.place, *row))
            flags.append(self.flags(self.place))
        return np.array(stress), np.array(flags)


def history(n=20_000, seed=0, low=-0.15):
    """Irregular time with a stamp repeated, strain of both signs, a temperature."""
    rng = np.random.default_rng(seed)
    time = 3.0 + np.cumsum(rng.uniform(5e-4, 3e-3, n))
    time[100] = time[99]
    wave = 0.5 - 0.5 * np.cos(2 * time) * np.cos(0.37 * time)
    warm = 23 + 5 * np.sin(time)
    warm[5:50] = np.nan
    return Chunk(time, low + (0.6 - low) * wave, warm)


def base(branches_a_decade=2):
    units = build("pl-wiechert", -0.2, 0.6, 1e-3, 35.0, 16, branches_a_decade)
    stiffness = np.random.default_rng(1).uniform(0, 2, units.columns)
    stiffness[[3, -2]] = 0
    return units, stiffness


def with_effects(*pieces, **more):
    own = tuple({k: {"r": p.values[k]} for k in p.effect.per_recording} for p in pieces)
    return Stored(*base(), pieces, own, more.get("needs", False), "fresh", **KEEP(more))


def KEEP(more):
    return {k: v for k, v in more.items() if k != "needs"}


def piece(law, start=0):
    values = law.starts(SCALES)[start]
    own = {k: float(np.ravel(v)[0]) for k, v in values.items()}
    return Piece(law, law.defaults() | own, ())


def assert_same(got, want, rel=1e-9):
    assert np.max(np.abs(got - want)) <= rel * np.max(np.abs(want))


@pytest.mark.parametrize("law", FORMS_OF_EFFECTS, ids=lambda law: law.form)
def test_every_effect_that_can_be_stepped_says_what_python_says(law, tmp_path):
    model, chunk = with_effects(piece(law, -1)), history()
    if "causal" in law.exempt:
        with pytest.raises(InputError, match="needs the next sample"):
            c_source(model, "model")
        assert (
            f"Left out: {law.id}"
            in c_source(model, "model", Options(leave_out=(law.id,)))[0]
        )
        return
    options = Options("r", interval_s=5e-4)
    got, _ = Compiled(tmp_path, model, options=options).run(chunk)
    (want,) = model.stress(["r"], [chunk], [None])
    assert_same(got, want)
    (plain,) = with_effects().stress(["r"], [chunk], [None])
    assert np.max(np.abs(want - plain)) > 1e-4 * np.max(np.abs(plain)), "it acts"


def test_clocks_add_up_and_leave_a_branch_that_was_added_alone(tmp_path):
    forms = (
        ("strain_dependent_relaxation", "StrainClock"),
        ("relaxation_branch", "SpreadBranch"),
        ("thermal_softening", "ThermalClock"),
    )
    model, chunk = with_effects(*(piece(effect(*f)) for f in forms)), history(5000)
    got, _ = Compiled(tmp_path, model).run(chunk)
    assert_same(got, model.stress(["r"], [chunk], [None])[0])


def test_no_template_is_of_an_effect_that_is_not_there():
    forms = {law.form for law in FORMS_OF_EFFECTS}
    for file in (FOLDER / "effects").glob("*.c"):
        assert {k.split()[0] for k in blocks(f"effects/{file.name}")} <= forms
        assert effect(file.stem)


@pytest.mark.slow
def test_all_effects_at_once_over_a_hundred_thousand_steps(tmp_path):
    pieces = [piece(e) for e in EFFECTS if e.id != "inertia"]
    model, chunk = with_effects(*pieces), history(100_000)
    got, _ = Compiled(tmp_path, model, options=Options("r")).run(chunk)
    (want,) = model.stress(["r"], [chunk], [None])
    assert_same(got, want)


def test_values_of_other_recordings_are_off(tmp_path):
    model, chunk = with_effects(piece(effect("zero_offset"))), history(500)
    got, _ = Compiled(tmp_path, model).run(chunk)
    assert_same(got, model.stress(["other"], [chunk], [None])[0])


def test_a_model_that_corrects_a_simulation_gets_it_or_holds_it(tmp_path):
    inner = with_effects(piece(effect("tension_only")))
    chunk = history(2000)
    (given,) = inner.stress([""], [chunk], [None])
    outer = with_effects(piece(effect("mullins_softening")), needs=True)
    (want,) = outer.stress([""], [chunk], [given])
    (tmp_path / "a").mkdir()
    got, _ = Compiled(tmp_path / "a", outer).run(chunk, given)
    assert_same(got, want)
    (tmp_path / "b").mkdir()
    whole = with_effects(
        piece(effect("mullins_softening")), needs=True, simulation=inner
    )
    got, _ = Compiled(tmp_path / "b", whole).run(chunk)
    assert_same(got, want)


def test_a_learned_correction_is_refused_by_name():
    model = with_effects(learned={"features": [], "network": {}})
    with pytest.raises(InputError, match="--leave-out learned"):
        c_source(model, "model")


@pytest.mark.parametrize(
    "model",
    [Hooke(), Maxwell(), StandardLinearSolid(), Burgers(), Wiechert(4)]
    + [PLSLS((-0.05, 0.0, 0.1, 0.3)), PLWiechert((0.0, 0.1, 0.3), 3)],
    ids=lambda m: type(m).__name__,
)
def test_linear_and_piecewise_models(model, tmp_path):
    rng = np.random.default_rng(2)
    parameters = {p.name: p.default * rng.uniform(0.5, 2) for p in model.parameters}
    if isinstance(model, PLWiechert):
        parameters["spring_2"] = -0.3  # a curve that softens
    chunk = history(3000)
    got, _ = Compiled(tmp_path, stored_of(model, parameters)).run(chunk)
    want, _ = model.apply(parameters, chunk)
    assert_same(got, want)


def test_a_model_that_is_no_spring_beside_branches_is_refused():
    with pytest.raises(InputError, match="KelvinVoigt is no piecewise-linear"):
        stored_of(KelvinVoigt(), {"equilibrium_stiffness": 1.0, "viscosity": 1.0})


# --- networks -------------------------------------------------------------------------


def network(architecture="FFRD4", lag_s=None, seen=None, neurons=17):
    row = architecture_of(architecture)
    width = row.width
    rng = np.random.default_rng(5)
    low, high = np.zeros(width), np.full(width, 0.5)
    if architecture == "FFRD4":
        low[1], high[1] = 0.02, 0.25
    scaling = Scaling(low, high), Scaling(np.array(0.0), np.array(3.0))
    net = row.network(
        rng.normal(size=(neurons, width + 1)), rng.normal(size=neurons + 1), *scaling
    )
    return StoredNetwork(net, architecture, lag_s, seen)


@pytest.mark.parametrize("architecture", [*PUBLISHED, "FFH4", "FFH7"])
@pytest.mark.parametrize("lag_s", [None, 0.0113])
def test_networks_say_what_python_says_and_flag_what_was_never_shown(
    architecture, lag_s, tmp_path
):
    seen = Seen((0.0, 0.5), (0.02, 0.25))
    model, chunk = network(architecture, lag_s, seen), history(4000)
    options = Options(interval_s=5e-4)
    got, flags = Compiled(tmp_path, model, options=options).run(chunk)
    (want,) = model.stress([""], [chunk], [None])
    first = int(architecture == "FFRD4")  # Python takes its rate from the next sample
    assert_same(got[first:], want[first:])
    expected = model.outside(chunk)
    np.testing.assert_array_equal(flags[1:], expected[1:])
    assert {1, 2, 4} <= set(expected.tolist())


@pytest.mark.parametrize("pulls", [True, False])
def test_a_bounded_network_keeps_its_sign_and_agrees_over_many_samples(pulls, tmp_path):
    model = network("FFH7", 0.02)
    ends = Scaling(np.array(-1.0), np.array(3.0))
    if not pulls:
        ends = Scaling(np.array(-3.0), np.array(1.0))
    model = replace(model, network=replace(model.network, target=ends))
    n = 100_000
    time = np.arange(n) * 1e-3
    strain = 0.2 * np.sin(3 * time) + 0.3 * np.sin(0.31 * time)
    got, _ = Compiled(tmp_path, model).run(Chunk(time, strain))
    (want,) = model.stress([""], [Chunk(time, strain)], [None])
    assert_same(got, want)
    assert (got.min() >= 0) if pulls else (got.max() <= 0)
    assert 0 < np.mean(got == 0) < 1  # it is not zero throughout


@pytest.mark.parametrize("architecture", ["FFRD4S", "RBF"])
def test_a_network_without_c_is_refused(architecture):
    with pytest.raises(InputError, match=f"inputs {architecture} cannot be exported"):
        export(network(architecture), "c", "a")


def test_what_is_no_number_changes_nothing(tmp_path):
    model = with_effects()
    one = Compiled(tmp_path, model)
    good = [one.step(one.place, 0.01, e, 0.0, 0.0) for e in (0.0, 0.1, 0.2)]
    for bad in ((np.nan, 0.1), (0.01, np.nan), (-0.01, 0.1), (0.01, np.inf)):
        assert one.step(one.place, *bad, 0.0, 0.0) == good[-1]
        assert one.flags(one.place) == 8
    chunk = Chunk(np.arange(4) * 0.01, np.array([0.0, 0.1, 0.2, 0.3]))
    last = one.step(one.place, 0.01, 0.3, 0.0, 0.0)
    assert last == pytest.approx(model.stress([""], [chunk], [None])[0][-1], rel=1e-9)


def test_sampled_faster_than_a_delay_was_made_for_is_flagged(tmp_path):
    model = network("FFRI2", 0.05)
    one = Compiled(tmp_path, model, options=Options(interval_s=0.01))
    chunk = Chunk(np.arange(0, 1, 1e-3), np.linspace(0, 0.4, 1000))
    _, flags = one.run(chunk)
    assert flags[-1] & 16
    with pytest.raises(InputError, match="--interval"):
        c_source(network("FFRI2", 1e3), "model", Options(interval_s=1e-6))


@pytest.mark.parametrize("architecture", ["FFRI3", "FFRD4", "FFH7"])
def test_onnx_says_what_python_says(architecture):
    runtime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnx")
    model = network(architecture)
    session = runtime.InferenceSession(export(model, "onnx", "a")["a.onnx"])
    width = len(model.network.inputs.low)
    x = np.random.default_rng(3).uniform(-0.1, 0.6, (500, width))
    stress, outside = session.run(None, {"inputs": x})
    np.testing.assert_allclose(stress, model.network.predict(x), rtol=1e-6)
    slack = 0.01 * (model.network.inputs.high - model.network.inputs.low)
    low, high = model.network.inputs.low - slack, model.network.inputs.high + slack
    np.testing.assert_array_equal(outside, ((x < low) | (x > high)).any(axis=1))
    with pytest.raises(InputError, match="ONNX is for networks"):
        export(with_effects(), "onnx", "a")


# --- FMU ------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", ["corrected", "network"])
def test_fmu_is_valid_and_says_what_python_says(version, kind, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    laws = [effect("mullins_softening"), effect("permanent_set"), effect("slack")]
    model = with_effects(*map(piece, laws)) if kind == "corrected" else network()
    files = export(model, "fmu", "strip")
    (path,) = write(
        {f"strip-fmi{version}.fmu": files[f"strip-fmi{version}.fmu"]}, tmp_path
    )
    assert validate_fmu(str(path)) == []
    step, n = 2.0**-9, 400
    time = np.arange(n + 1) * step
    strain = 0.3 - 0.2 * np.cos(6 * time)
    signal = np.array(
        list(zip(time, strain, strict=True)), [("time", float), ("strain", float)]
    )
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=n * step,
        step_size=step,
        output_interval=step,
        input=signal,
        output=["stress_MPa", "outside"],
        fmi_type="CoSimulation",
    )
    # What is set at the start of a step is the strain at its end.
    seen = Chunk(time, np.concatenate([strain[:1], strain[:-1]]))
    (want,) = model.stress([""], [seen], [None])
    assert len(result) == n + 1
    assert_same(result["stress_MPa"][1:], want[1:])
    outside = model.outside(seen) if kind == "network" else np.zeros(n + 1)
    np.testing.assert_array_equal(result["outside"], np.cumsum(outside > 0))


# --- cards ----------------------------------------------------------------------------


def card_model(**softening):
    units = Units("pl-wiechert", (0.0, 0.1, 0.3, 0.6), (0.5, 20.0))
    law = effect("mullins_softening")
    values = law.defaults() | softening
    pieces = (Piece(law, values, ()), piece(effect("slack")))
    own: tuple[dict, ...] = ({}, {"gap": {"r": 0.02}})
    stiffness = np.array([6.0, 5.0, 7.0, 0.8, 0.4])
    return Stored(units, stiffness, pieces, own, False, "fresh")


def rows_after(text, keyword):
    lines = text.splitlines()
    start = next(i for i, x in enumerate(lines) if x.lower().startswith(keyword)) + 1
    out = []
    for line in lines[start:]:
        if line.startswith("*"):
            break
        out.append([float(v) for v in line.split(",")])
    return np.array(out)


def test_abaqus_card_carries_the_curve_the_series_and_the_softening():
    model = card_model(depth=0.4, scale=0.3, sharpness=0.7)
    text = export(model, "abaqus", "Foam 3*")["foam_3.inp"].decode()
    curve = rows_after(text, "*uniaxial")
    # Instantaneous: the springs' own curve and 1.2 MPa of branches.
    strain = curve[:, 1]
    springs = np.interp(strain, (0, 0.1, 0.3, 0.6), (0, 0.6, 1.6, 3.7))
    np.testing.assert_allclose(curve[:, 0], springs + 1.2 * strain, rtol=1e-8)
    series = rows_after(text, "*viscoelastic")
    np.testing.assert_allclose(series[:, 2], (0.5, 20.0))
    assert series[0, 0] / series[1, 0] == pytest.approx(2, rel=1e-8)
    # Relaxed, the curve is that of the springs, as near as one factor can bring it.
    kept = 1 - series[:, 0].sum()
    off = np.max(np.abs(kept * curve[:, 0] - springs)) / springs.max()
    assert off < 0.02
    assert f"off by up to {100 * off:.3g} %" in text
    (softening,) = rows_after(text, "*mullins")
    # Energy up to 0.3: the trapezia of the springs and half of 1.2 x 0.3 squared.
    energy = 0.6 * 0.1 / 2 + (0.6 + 1.6) / 2 * 0.2 + 0.6 * 0.3**2
    assert softening == pytest.approx([1 / 0.4, 0.7 * energy, 0.7], rel=1e-2)
    assert "NOT CARRIED: slack (Slack)" in text
    assert "*Material, name=foam_3\n" in text


def test_ansys_card_says_the_same():
    model = card_model(depth=0.4, scale=0.3, sharpness=0.7)
    text = export(model, "ansys", "a")["a.mac"].decode()
    points = [x.split(",")[2:] for x in text.splitlines() if x.startswith("TBPT")]
    inp = export(model, "abaqus", "a")["a.inp"].decode()
    curve = rows_after(inp, "*uniaxial")
    np.testing.assert_allclose(np.array(points, float), curve[:, ::-1], rtol=1e-8)
    assert "TB,PRONY,MATID,1,2,SHEAR" in text
    assert "TB,CDM,MATID,1,3,PSE2" in text
    assert "NOT CARRIED: slack (Slack)" in text


def test_a_card_of_one_straight_spring_relaxes_exactly():
    model = stored_of(
        StandardLinearSolid(),
        {"equilibrium_stiffness": 3.0, "stiffness": 1.0, "relaxation_time": 2.0},
    )
    text = export(model, "abaqus", "a")["a.inp"].decode()
    assert rows_after(text, "*viscoelastic")[0] == pytest.approx([0.25, 0, 2.0])
    assert "off by up to" in text
    assert "Mullins" not in text


def test_a_network_has_no_card():
    with pytest.raises(InputError, match="no material card"):
        export(network(), "ansys", "a")


# --- the command, and files from outside ----------------------------------------------


def stored_file(path, name="pl-wiechert", **more):
    units, stiffness = base()
    content = {
        "kind": "softnn-model",
        "version": 1,
        "history": "fresh",
        "base": {
            "name": name,
            "knots": list(units.knots),
            "relaxation_times_s": list(units.relaxation_times),
            "stiffness_MPa": stiffness.tolist(),
        },
        "effects": [],
    } | more
    path.write_text(json.dumps(content))
    return path


def test_command_writes_c_that_compiles(tmp_path, capsys):
    model = stored_file(tmp_path / "My model (2).json")
    out = tmp_path / "out"
    assert cli.main(["export", str(model), "--to", "c", "--out", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["my_model_2.c", "my_model_2.h"]
    command = ["gcc", *STRICT, "-c", "my_model_2.c", "-o", "x.o"]
    subprocess.run(command, cwd=out, check=True)
    assert str(out / "my_model_2.c") in capsys.readouterr().out


EVIL = '*/ int main(void){return 1;} /* "\n#include </etc/passwd>\n?>\x00é'


def test_a_hostile_name_gets_into_nothing(tmp_path):
    with pytest.raises(InputError, match="no base"):  # files are refused before
        read_model(stored_file(tmp_path / "m.json", name=EVIL))
    units, stiffness = base()
    evil = replace(units, name=EVIL)
    model = Stored(evil, stiffness, (), (), False, "fresh")
    for form, marks in (("c", ("/*", " *")), ("abaqus", "**"), ("ansys", "!")):
        for file, content in export(model, form, "../../" + EVIL).items():
            assert Path(file).name == file
            text = content.decode("ascii")
            lines = [x for x in text.splitlines() if "main(" in x or "passwd" in x]
            lines = [x for x in lines if not x.startswith(marks)]
            assert not [x for x in lines if "main(" in x or "#include <" in x]
            assert text.count("/*") == text.count("*/")
    library = tmp_path / "m.so"
    library.write_bytes(export(model, "fmu", EVIL).popitem()[1])
    assert Compiled(tmp_path, model, identifier(EVIL)).flags


def test_numbers_that_are_none_are_refused(tmp_path):
    path = stored_file(tmp_path / "m.json")
    content = json.loads(path.read_text())
    content["base"]["stiffness_MPa"][0] = float("inf")
    path.write_text(json.dumps(content))
    assert cli.main(["export", str(path), "--to", "c", "--out", str(tmp_path)]) == 2


def test_a_link_in_the_folder_is_not_followed(tmp_path):
    out, other = tmp_path / "out", tmp_path / "other.c"
    out.mkdir()
    (out / "m.c").symlink_to(other)
    model = stored_file(tmp_path / "m.json")
    assert cli.main(["export", str(model), "--to", "c", "--out", str(out)]) == 2
    assert not other.exists()
