"""C, FMU and ONNX say what Python says; cards carry the numbers of the model."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from export_made import Compiled, history, network, piece, with_effects

from softnn.contracts import Chunk, InputError
from softnn.effects import EFFECTS, effect
from softnn.export.files import Options, export, stored_of, write
from softnn.export.source import c_source
from softnn.export.templates_of import FOLDER, blocks
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
from softnn.neural import PUBLISHED, Scaling, Seen, StoredNetwork
from softnn.neural.convex import ConvexNetwork
from softnn.neural.inputs import strain_rate
from softnn.recording import Recording

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
FORMS_OF_EFFECTS = [law for e in EFFECTS for law in (e, *e.second_forms)]


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


def shapes(law):
    return [p for p in law.parameters if p.name in law.shape and p.scale == "linear"]


@pytest.mark.parametrize("share", [0.1, 0.4])
@pytest.mark.parametrize(
    "law",
    [f for f in FORMS_OF_EFFECTS if shapes(f) and "causal" not in f.exempt],
    ids=lambda law: law.form,
)
def test_shapes_of_an_effect_are_in_its_c(law, share, tmp_path):
    # Effects start from plain shapes: here each is some way to the farther end.
    one, own = piece(law, -1), {}
    for p in shapes(law):
        begun = one.values[p.name]
        far = max(p.low, p.high, key=lambda end: abs(end - begun))
        own[p.name] = (1 - share) * begun + share * far
    model, chunk = with_effects(replace(one, values=one.values | own)), history(5000)
    options = Options("r", interval_s=5e-4)
    got, _ = Compiled(tmp_path, model, options=options).run(chunk)
    assert_same(got, model.stress(["r"], [chunk], [None])[0])


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


def test_a_corrected_model_flags_strain_beyond_its_recordings(tmp_path):
    inner = with_effects(piece(effect("tension_only")))
    model = with_effects(needs=True, simulation=inner)
    low, high = model.units.knots[0], model.units.knots[-1]
    strain = np.array([0.0, low, high, high + 0.1, low - 0.1, 0.0])
    chunk = Chunk(np.arange(6) * 0.1, strain)
    _, flags = Compiled(tmp_path, model).run(chunk)
    assert flags.tolist() == [0, 0, 0, 1, 1, 0]


def test_other_recordings_have_the_values_of_recordings_not_met(tmp_path):
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


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("springs_alone", [False, True])
def test_a_convex_network_says_what_python_says(side, springs_alone, tmp_path):
    rng = np.random.default_rng(4)
    units = [(side * knot, 0.0, 0.0) for knot in (0.0, 0.03, 0.11, 0.3)]
    if not springs_alone:
        units += [(0.0, limit, t) for limit in (0.0, 0.05) for t in (1e-3, 0.3, 40.0)]
    ends = Scaling(np.array([-0.1, 0.0]), np.array([0.5, 9.0]))
    net = ConvexNetwork(
        np.array(units),
        np.append(rng.uniform(0.1, 2, len(units)), 0.02),
        ends,
        Scaling(np.array(0.0), np.array(3.0)),
    )
    model = StoredNetwork(net, "CONVEX", None, Seen((0.0, 0.5), (0.02, 0.25)))
    chunk = history(4000, low=-0.4)
    got, flags = Compiled(tmp_path, model).run(chunk)
    assert_same(got, model.stress([""], [chunk], [None])[0])
    np.testing.assert_array_equal(flags[1:], model.outside(chunk)[1:])


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


@pytest.mark.parametrize("architecture", ["FFRD4S", "RBF", "GRU"])
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


def test_the_metadata_of_onnx_say_how_the_rate_is_made():
    onnx = pytest.importorskip("onnx")
    model = network("FFRD4")
    file = onnx.load_from_string(export(model, "onnx", "a")["a.onnx"])
    told = {one.key: one.value for one in file.metadata_props}
    assert told["strain_rate_per_s"].startswith("backward difference: (strain now")
    assert told["lag"] in told["strain_rate_per_s"]
    time = np.cumsum(np.linspace(0.1, 0.2, 50))
    strain = 0.3 * np.sin(time)
    made = strain_rate(Recording(time, strain, strain), model.lag_s)
    lag = np.diff(time) if model.lag_s is None else model.lag_s
    before = np.interp(time[1:] - lag, time, strain)
    np.testing.assert_allclose(made[1:], (strain[1:] - before) / lag)
    assert made[0] == made[1]


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
