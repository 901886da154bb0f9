"""Diagnosis end to end: on forged histories, on bad input, through the commands."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import softnn.mismatch
from softnn.cli import main
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.fit import Data, Engine, Guess, Piece, fit
from softnn.mismatch import diagnose, diagnosis, explain, read_case, verify
from softnn.mismatch.base import baseline
from softnn.mismatch.case import mask_gaps, thin, to_data
from softnn.mismatch.contest import ENTRY, Rival, at_best, candidates, names, rivals
from softnn.mismatch.diagnosis import _probability, worse
from softnn.mismatch.locate import BRANCHES, only_loading, phases, runs
from softnn.mismatch.model_file import from_dict, read_model, to_dict
from softnn.mismatch.screen import Screen
from softnn.mismatch.verify import heldout, ratio_interval
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import Term, simulate

FOLDER = Path(softnn.mismatch.__file__).parent
UNITS = Units("pl-wiechert", (0.0, 0.3, 1.0), (0.4, 8.0))
STIFFNESS = np.array([1.0, 0.6, 0.5, 0.4])


def straight(levels, rates, interval):
    steps = np.abs(np.diff(levels)) / np.broadcast_to(rates, len(levels) - 1)
    steps = np.where(steps > 0, steps, 60.0)
    corners = np.concatenate([[0], np.cumsum(steps)])
    time = np.arange(0, corners[-1], interval)
    return Chunk(time, np.interp(time, corners, levels))


def histories():
    """Three ramps over a decade of rates, growing cycles, a hold: 2 000 samples."""
    return [
        straight([0, 0.6, 0], 0.02, 0.15),
        straight([0, 0.6, 0], 0.06, 0.05),
        straight([0, 0.6, 0], 0.2, 0.02),
        straight([0, 0.2, 0.05, 0.4, 0.05, 0.6, 0.05, 0.6, 0], 0.05, 0.15),
        straight([0, 0.4, 0.4, 0.1], 0.1, 0.2),
    ]


def write_case(folder, terms=(), noise=0.002, seed=0, toml="", stress=None):
    rng = np.random.default_rng(seed)
    (folder / "recordings").mkdir(parents=True)
    chunks = histories()
    clean = (
        simulate(UNITS, STIFFNESS, list(terms), chunks) if stress is None else stress
    )
    for i, (chunk, s) in enumerate(zip(chunks, clean, strict=True)):
        table = {
            "time_s": chunk.time_s,
            "strain": chunk.strain,
            "stress_MPa": s + noise * rng.standard_normal(len(s)),
        }
        pd.DataFrame(table).to_csv(folder / f"recordings/r{i}.csv", index=False)
    if toml:
        (folder / "case.toml").write_text(toml)
    return folder


def mullins(depth=0.4):
    law = effect("mullins_softening")
    return Term(law, law.defaults() | {"depth": depth, "scale": 0.1})


# -- verdicts --------------------------------------------------------------------------


def test_nothing_concealed_is_nothing_missing(tmp_path):
    found = diagnose(read_case(write_case(tmp_path / "null")))
    assert found.result["verdict"] == "nothing_missing"
    assert found.result["selected"] == []
    assert found.result["mismatch"] == []
    assert found.result["fit"]["heldout_ratio"] == 1.0


def test_softening_is_named_measured_and_located(tmp_path):
    found = diagnose(read_case(write_case(tmp_path / "soft", [mullins()])))
    result = found.result
    assert result["verdict"] == "explained"
    assert result["selected"] == ["mullins_softening"]
    told = result["explanations"][0]
    depth = told["parameters"]["depth"]
    assert depth["value"] == pytest.approx(0.4, abs=0.05)
    assert depth["low"] < depth["value"] < depth["high"]
    assert told["probability"] > 0.9
    fit_ = result["fit"]
    # The noise is the floor of any prediction; it was drawn at 0.002 MPa.
    assert result["noise"]["sigma_MPa"] == pytest.approx(0.002, rel=0.15)
    assert fit_["after"]["heldout_nrmse"] < 1.2 * fit_["noise_nrmse"]
    assert fit_["heldout_ratio_95"][1] < 0.6
    # First loading is where softening does not act.
    assert {r["branch"] for r in result["mismatch"]} <= {
        "unloading",
        "reloading",
        "hold",
        "first loading",
    }
    first = sum(
        r["share"] for r in result["mismatch"] if r["branch"] == "first loading"
    )
    assert first < 0.05
    assert sum(r["share"] for r in result["mismatch"]) == pytest.approx(1.0)


def test_first_loading_alone_does_not_tell_what_is_missing(tmp_path):
    # A viscous law that no base has shows in ramps of three rates, as others would.
    law = effect("finite_strain")
    ramps = [straight([0, 0.9], rate, 0.9 / rate / 400) for rate in (0.02, 0.06, 0.2)]
    units = Units("pl-wiechert", (0.0, 0.3, 0.9), (0.4, 8.0))
    terms = [Term(law, law.defaults())]
    rng = np.random.default_rng(0)
    (tmp_path / "recordings").mkdir()
    clean = simulate(units, np.array([1.0, 0.6, 2.0, 2.0]), terms, ramps)
    for i, (chunk, s) in enumerate(zip(ramps, clean, strict=True)):
        table = {"time_s": chunk.time_s, "strain": chunk.strain}
        table["stress_MPa"] = s + 0.002 * rng.standard_normal(len(s))
        pd.DataFrame(table).to_csv(tmp_path / f"recordings/r{i}.csv", index=False)
    result = diagnose(read_case(tmp_path), "hooke").result
    assert result["verdict"] == "undetermined"
    assert result["selected"] == []
    assert "first loading" in result["summary"]
    assert "cycles" in result["next_recording"]["strain_programme"]


@pytest.mark.slow
def test_two_effects_are_both_named(tmp_path, monkeypatch):
    lag = Term(effect("sensor_lag"), {"time_constant_s": 0.3, "second": 0.0})
    tried, reformed = [], explain.reformed
    monkeypatch.setattr(
        explain,
        "reformed",
        lambda e, fit: tried.append(len(names(fit))) or reformed(e, fit),
    )
    found = diagnose(read_case(write_case(tmp_path / "pair", [mullins(), lag])))
    assert sorted(found.result["selected"]) == ["mullins_softening", "sensor_lag"]
    # In whichever form suits best, before one is added to, and before any goes.
    assert tried == [1, 2]


def test_what_is_on_no_list_is_named_after_nothing_on_it(tmp_path):
    # Wear with the time under load, by a law of its own: nearest come drift and slip.
    worn = []
    for c, s in zip(
        histories(), simulate(UNITS, STIFFNESS, [], histories()), strict=True
    ):
        wear = np.concatenate([[0], np.cumsum(np.diff(c.time_s) * c.strain[1:] ** 2)])
        worn.append(s * np.exp(-0.03 * wear))
    found = diagnose(read_case(write_case(tmp_path / "worn", stress=worn)))
    assert found.result["verdict"] == "unexplained"
    assert found.result["selected"] == []
    assert "wears with the time under load" in found.summary


def test_offsets_in_two_recordings_are_told_by_name(tmp_path):
    own = np.array([0, 0.03, 0, 0, -0.02])
    offset = Term(effect("zero_offset"), {"offset_MPa": own})
    found = diagnose(read_case(write_case(tmp_path / "off", [offset])))
    assert found.result["selected"] == ["zero_offset"]
    values = found.result["explanations"][0]["parameters"]
    assert values["offset_MPa of r1"]["value"] == pytest.approx(0.03, abs=0.001)
    assert values["offset_MPa of r4"]["value"] == pytest.approx(-0.02, abs=0.001)
    assert found.result["explanations"][0]["recordings"] == ["r1", "r4"]


def test_a_gap_that_all_recordings_have_is_measured_whole(tmp_path):
    # With a sharp corner, gaps alike in all of them would be the foot of a spring.
    gaps, chunks = (0.035, 0.05, 0.03, 0.06, 0.045), histories()
    taut = [
        replace(c, strain=(np.hypot(c.strain - g, 0.2 * g) + c.strain) / 2 - 0.51 * g)
        for c, g in zip(chunks, gaps, strict=True)
    ]
    stress = simulate(UNITS, STIFFNESS, [], taut)
    found = diagnose(read_case(write_case(tmp_path / "c", stress=stress))).result
    assert found["selected"] == ["slack"]
    told = found["explanations"][0]["parameters"]
    for i, gap in enumerate(gaps):
        assert told[f"gap of r{i}"]["value"] == pytest.approx(gap, rel=0.1)


def test_a_gap_too_small_for_any_recording_is_seen_in_all_together(tmp_path):
    law, gap = effect("slack"), 0.0012
    slack = Term(law, law.defaults() | {"gap": np.full(5, gap)})
    case = read_case(write_case(tmp_path / "c", [slack]))
    base = baseline(to_data(case), "pl-wiechert")
    leads, _ = Screen(base.engine, base.fit).lead(law, ENTRY)
    assert {lead.piece.groups for lead in leads} == {((0, 1, 2, 3, 4),)}
    found = diagnose(case).result
    assert found["selected"] == ["slack"]
    told = found["explanations"][0]["parameters"]
    values = [told[f"gap of r{i}"]["value"] for i in range(5)]
    assert len(set(values)) == 1
    assert values[0] == pytest.approx(gap, rel=0.3)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        # Gaps of 2 % of the largest strain and less; 1.5 % of the stress cut off.
        ("slack", {"gap": np.array([4, 12, 1, 9, 6]) * 1e-3, "toe": 0.0}),
        ("slack", {"gap": np.array([4, 12, 1, 9, 6]) * 3e-4, "toe": 0.0}),
        ("load_cell_saturation", {"limit_MPa": 0.985 * 0.7201, "knee": 0.0}),
    ],
)
def test_a_score_test_promises_what_a_fit_of_something_small_gains(
    tmp_path, name, values
):
    law = effect(name)
    case = read_case(write_case(tmp_path / "c", [Term(law, values)], noise=0.0006))
    base = baseline(to_data(case), "pl-wiechert")
    screen = Screen(base.engine, base.fit)
    leads, _ = screen.lead(law, ENTRY)
    gained = base.fit.chi2 - at_best(base.engine, screen, law).chi2
    assert gained > 400
    assert max(lead.gain for lead in leads) > 0.95 * gained


@pytest.mark.parametrize("sizes", [(0, 0, 0, 0.03, 0.02), (0, 0.02, 0, 0.015, 0)])
@pytest.mark.parametrize("lasting_s", [0.3, 8.0])
def test_a_slip_is_found_where_it_is_however_long_it_lasts(tmp_path, sizes, lasting_s):
    law = effect("grip_slip")
    slip, moment = np.array(sizes), np.array([0, 0, 0, 37.3, 21.7])
    values = {"slip": slip, "moment_s": moment, "duration_s": lasting_s}
    case = read_case(write_case(tmp_path / "c", [Term(law, values)]))
    base = baseline(to_data(case), "pl-wiechert")
    found = at_best(base.engine, Screen(base.engine, base.fit), law)
    ((rival,), _) = rivals(base.engine, base.fit, [law], np.random.default_rng(0))
    own = np.flatnonzero(slip)
    for one in (rival.fit, found):
        (piece,) = (p for p in one.guess.pieces if not p.nuisance)
        assert piece.groups == tuple((i,) for i in own)
    np.testing.assert_allclose(piece.values["slip"][own], slip[own], rtol=0.05)
    middle = piece.values["moment_s"] + piece.values["duration_s"] / 2
    near = 0.1 + 0.05 * lasting_s
    np.testing.assert_allclose(middle[own], (moment + lasting_s / 2)[own], atol=near)


def test_scale_between_specimens_is_no_news(tmp_path):
    chunks = histories()
    clean = simulate(UNITS, STIFFNESS, [], chunks)
    scaled = [s * (1.15 if i > 2 else 1.0) for i, s in enumerate(clean)]
    lines = "".join(f'r{i} = "{"B" if i > 2 else "A"}"\n' for i in range(5))
    folder = write_case(tmp_path / "two", stress=scaled, toml="[specimen]\n" + lines)
    assert diagnose(read_case(folder)).result["verdict"] == "nothing_missing"
    (folder / "case.toml").unlink()
    assert diagnose(read_case(folder)).result["selected"] == ["gain_error"]


def test_a_simulation_from_elsewhere_is_kept_as_it_is(tmp_path):
    folder = write_case(tmp_path / "given", [mullins()])
    for chunk, s, file in zip(
        histories(),
        simulate(UNITS, STIFFNESS, [], histories()),
        sorted((folder / "recordings").glob("*.csv")),
        strict=True,
    ):
        frame = pd.read_csv(file)
        frame["simulated_MPa"] = s
        frame.to_csv(file, index=False)
        assert len(chunk.time_s) == len(frame)
    found = diagnose(read_case(folder))
    assert found.result["model"] == "simulated"
    assert found.result["selected"] == ["mullins_softening"]
    assert found.model["base"]["corrects_simulated_MPa"]


@pytest.mark.slow
def test_what_is_on_no_list_is_not_named_with_confidence(tmp_path):
    chunks = histories()
    clean = simulate(UNITS, STIFFNESS, [], chunks)
    # A bump at one strain on every loading, gone on unloading: no effect here.
    odd = []
    for chunk, s in zip(chunks, clean, strict=True):
        up = np.gradient(chunk.strain) > 0
        odd.append(
            s + 0.06 * up * np.sin(25 * chunk.strain) ** 2 * (chunk.strain > 0.1)
        )
    result = diagnose(read_case(write_case(tmp_path / "odd", stress=odd))).result
    assert result["verdict"] != "nothing_missing"
    assert all(e["probability"] < 0.5 for e in result["explanations"])


# -- pieces ----------------------------------------------------------------------------


def test_phases_of_a_triangle_with_a_hold():
    chunk = straight([0, 0.5, 0.1, 0.6, 0.6, 0], 0.1, 0.05)
    told = [BRANCHES[b] for b in phases(chunk).branch]
    at = {t: told[int(t / 0.05)] for t in (2.5, 7.0, 11.0, 13.5, 40.0, 77.0)}
    assert at == {
        2.5: "first loading",
        7.0: "unloading",
        11.0: "reloading",
        13.5: "first loading",
        40.0: "hold",
        77.0: "unloading",
    }
    assert phases(chunk).cycle.max() == 2


def test_runs():
    mask = np.array([1, 1, 0, 1, 1, 1], bool)
    label = np.array([0, 0, 0, 1, 1, 2])
    assert runs(mask, label) == [(0, 2), (3, 5), (5, 6)]


def test_heldout_of_a_linear_base_is_that_of_refitting():
    rng = np.random.default_rng(2)
    chunks = tuple(histories()[:3])
    units = Units("pl-sls", (0.0, 0.2, 1.0), (1.0,))
    units = Units("pl-wiechert", units.knots, (0.5, 5.0))
    stress = tuple(
        s + 0.01 * rng.standard_normal(len(s))
        for s in simulate(UNITS, STIFFNESS, [], chunks)
    )
    engine = Engine(Data(("a", "b", "c"), chunks, stress))
    found = fit(engine, Guess(units, np.zeros(4)))
    errors, _ = heldout(engine, found)
    for r in range(3):
        rest = [i for i in range(3) if i != r]
        other = Engine(
            Data(
                ("x", "y"),
                tuple(chunks[i] for i in rest),
                tuple(stress[i] for i in rest),
            )
        )
        alone = fit(other, Guess(units, np.zeros(4))).guess
        (predicted,) = simulate(units, alone.stiffness, [], [chunks[r]])
        expected = float(np.sum((predicted - stress[r]) ** 2))
        assert errors[r] == pytest.approx(expected, rel=2e-3)


def test_heldout_of_one_recording_with_values_of_its_own_is_that_of_refitting():
    # Five stretches; what the recording alone has is read off the other four.
    rng = np.random.default_rng(3)
    chunks, offset = tuple(histories()[:1]), effect("zero_offset")
    term = Term(offset, {"offset_MPa": np.array([0.2])})
    (stress,) = simulate(UNITS, STIFFNESS, [term], chunks)
    noisy = stress + 0.01 * rng.standard_normal(len(stress))
    engine = Engine(Data(("a",), chunks, (noisy,)), [np.full(len(noisy), 0.01)], [0.0])
    piece = Piece(offset, {"offset_MPa": np.array([0.1])}, ("offset_MPa",), ((0,),))
    for fixed in (False, True):
        guess = Guess(UNITS, np.asarray(STIFFNESS, float), (piece,))
        found = fit(engine, guess, fixed_base=fixed)
        errors, _ = heldout(engine, found)
        assert len(errors) == 5
        for g, error in enumerate(errors):
            test = np.arange(len(noisy)) * 5 // len(noisy) == g
            if fixed:
                level = (noisy - stress + 0.2)[~test].mean()
                expected = np.sum((noisy - stress + 0.2 - level)[test] ** 2)
                assert error == pytest.approx(expected, rel=2e-3)
            assert error < 1.3 * test.sum() * 0.01**2


def test_ratio_interval_covers_the_ratio():
    rng = np.random.default_rng(0)
    before = rng.uniform(1, 2, 7)
    ratio, low, high = ratio_interval(before, 0.25 * before, rng)
    assert ratio == pytest.approx(0.5)
    assert low == pytest.approx(0.5)
    assert high == pytest.approx(0.5)


def test_stress_after_a_gap_on_the_move_is_not_used():
    time = np.concatenate([np.arange(0, 10, 0.1), np.arange(13, 60, 0.1)])
    strain = 0.3 * np.sin(2 * np.pi * time / 2.0)
    recording = Recording(time, strain, strain, name="a")
    case = softnn.mismatch.Case("c", (recording,))
    stress = mask_gaps(case).recordings[0].stress_MPa
    assert np.isnan(stress[(time > 12) & (time < 30)]).all()
    assert np.isfinite(stress[(time < 10) | (time > 40)]).all()
    still = Recording(time, np.full(len(time), 0.3), strain, name="a")
    held = mask_gaps(softnn.mismatch.Case("c", (still,))).recordings[0].stress_MPa
    assert np.isfinite(held).all()


def test_thinning_keeps_reversals():
    time = np.arange(0, 100, 0.01)
    strain = 0.5 * np.abs((time / 10) % 2 - 1)
    case = softnn.mismatch.Case("c", (Recording(time, strain, strain, name="a"),))
    few = to_data(thin(case, 200)).chunks[0]
    assert len(few.time_s) < 300
    assert np.interp(10.0, few.time_s, few.strain) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.interp(time, few.time_s, few.strain) - strain).max() < 0.01


# -- files and commands ----------------------------------------------------------------


def conforms(value, schema, root=None, path="$"):
    """The part of JSON Schema that the schemas here use."""
    root = root or schema
    if "$ref" in schema:
        node = root
        for key in schema["$ref"].removeprefix("#/").split("/"):
            node = node[key]
        schema = node
    kinds = {
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "null": type(None),
        "number": (int, float),
        "integer": int,
    }
    allowed = schema.get("type")
    if allowed is not None:
        allowed = [allowed] if isinstance(allowed, str) else allowed
        good = any(
            isinstance(value, kinds[k])
            and not (isinstance(value, bool) and k != "boolean")
            for k in allowed
        )
        assert good, f"{path}: {value!r} is not {allowed}"
    if "enum" in schema:
        assert value in schema["enum"], f"{path}: {value!r}"
    if "const" in schema:
        assert value == schema["const"], f"{path}: {value!r}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        assert value >= schema.get("minimum", -np.inf), f"{path}: {value}"
        assert value <= schema.get("maximum", np.inf), f"{path}: {value}"
    if isinstance(value, dict):
        missing = set(schema.get("required", [])) - set(value)
        assert not missing, f"{path}: no {missing}"
        known = schema.get("properties", {})
        extra = schema.get("additionalProperties", True)
        for key, item in value.items():
            if key in known:
                conforms(item, known[key], root, f"{path}.{key}")
            elif isinstance(extra, dict):
                conforms(item, extra, root, f"{path}.{key}")
            else:
                assert extra, f"{path}: {key} is not in the schema"
    if isinstance(value, list) and "items" in schema:
        assert len(value) >= schema.get("minItems", 0), path
        for i, item in enumerate(value):
            conforms(item, schema["items"], root, f"{path}[{i}]")


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cases")
    write_case(folder / "soft <b>", [mullins()])
    out = folder / "out"
    code = main(
        ["diagnose", str(folder / "soft <b>"), "--out", str(out), "--jobs", "1"]
    )
    assert code == 0
    return folder, out / "soft__b_"


def test_files_keep_to_their_schemas(diagnosed):
    _, out = diagnosed
    for name, schema in (
        ("diagnosis", "diagnosis"),
        ("model", "model"),
        ("base", "model"),
    ):
        value = json.loads((out / f"{name}.json").read_text())
        conforms(value, json.loads((FOLDER / f"{schema}.schema.json").read_text()))


def test_report_stands_alone_and_escapes_names(diagnosed):
    _, out = diagnosed
    page = (out / "report.html").read_text()
    assert "<b>" not in page
    assert "soft &lt;b&gt;" in page
    assert "http" not in page.replace("http-equiv", "")
    for name in ("recordings", "residuals", "candidates"):
        assert (out / f"{name}.png").read_bytes()[:4] == b"\x89PNG"


def test_simulate_repeats_the_corrected_model_without_the_stress(diagnosed, tmp_path):
    folder, out = diagnosed
    files = sorted((folder / "soft <b>" / "recordings").glob("*.csv"))
    bare = tmp_path / "bare"
    bare.mkdir()
    for file in files:
        pd.read_csv(file)[["time_s", "strain"]].to_csv(bare / file.name, index=False)
    model = str(out / "model.json")
    assert (
        main(["simulate", model, *map(str, files), "--out", str(tmp_path / "a")]) == 0
    )
    again = [str(bare / f.name) for f in files]
    assert main(["simulate", model, *again, "--out", str(tmp_path / "b")]) == 0
    clean = simulate(UNITS, STIFFNESS, [mullins()], histories())
    for file, truth in zip(files, clean, strict=True):
        one = pd.read_csv(tmp_path / "a" / file.name)
        two = pd.read_csv(tmp_path / "b" / file.name)
        np.testing.assert_array_equal(one["simulated_MPa"], two["simulated_MPa"])
        assert "stress_MPa" in one
        assert "stress_MPa" not in two
        # Twice the noise of the 2 000 samples it was fitted to, at worst.
        assert np.sqrt(np.mean((one["simulated_MPa"] - truth) ** 2)) < 0.002


def test_model_file_reads_back_as_it_was(diagnosed):
    _, out = diagnosed
    stored = read_model(out / "model.json")
    assert stored.pieces[0].effect.id == "mullins_softening"
    data = json.loads((out / "model.json").read_text())
    data["effects"][0]["effect"] = "x"
    with pytest.raises(InputError, match="no effect 'x'"):
        from_dict(data)
    with pytest.raises(InputError, match="kind"):
        from_dict({})


def test_a_shape_that_a_model_file_does_not_know_is_the_usual_one(diagnosed):
    _, out = diagnosed
    data = json.loads((out / "model.json").read_text())
    values = data["effects"][0]["values"]
    del values["viscous_share"]
    assert from_dict(data).pieces[0].values["viscous_share"] == 1
    del values["depth"]  # its size is no shape
    with pytest.raises(InputError, match="depth"):
        from_dict(data)


@pytest.mark.slow
def test_a_stored_model_is_a_base(diagnosed):
    folder, out = diagnosed
    case = read_case(folder / "soft <b>")
    corrected = diagnose(case, read_model(out / "model.json"))
    assert corrected.result["verdict"] == "nothing_missing"
    plain = from_dict(to_dict(Guess(UNITS, STIFFNESS), [], "fresh", False))
    assert diagnose(case, plain).result["selected"] == ["mullins_softening"]


def refuse(capsys, arguments, *words):
    assert main(arguments) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    for word in words:
        assert word in said


def test_bad_input_is_one_clear_line(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out"), "--jobs", "1"]
    empty = tmp_path / "empty"
    empty.mkdir()
    refuse(capsys, ["diagnose", str(empty), *out], "no recordings")
    refuse(capsys, ["diagnose", str(tmp_path / "none"), *out], "no such folder")
    good = write_case(tmp_path / "good")
    refuse(
        capsys, ["diagnose", str(good), *out, "--model", "mawxell"], "mawxell", "hooke"
    )
    for name, column, factor, word in (
        ("percent", "strain", 100, "per cent"),
        ("pascal", "stress_MPa", 1e6, "Pa"),
    ):
        folder = write_case(tmp_path / name)
        file = folder / "recordings/r2.csv"
        frame = pd.read_csv(file)
        frame[column] *= factor
        frame.to_csv(file, index=False)
        refuse(capsys, ["diagnose", str(folder), *out], "r2.csv", "row", word)
    folder = write_case(tmp_path / "nan")
    frame = pd.read_csv(folder / "recordings/r0.csv")
    frame["stress_MPa"] = np.nan
    frame.to_csv(folder / "recordings/r0.csv", index=False)
    refuse(capsys, ["diagnose", str(folder), *out], "r0.csv", "no number")
    folder = write_case(tmp_path / "key", toml='modle = "hooke"\n')
    refuse(capsys, ["diagnose", str(folder), *out], "modle")
    folder = write_case(tmp_path / "still", toml='model = "hooke"\n')
    for file in (folder / "recordings").glob("*.csv"):
        frame = pd.read_csv(file)
        frame["strain"] = 0.0
        frame.to_csv(file, index=False)
    refuse(capsys, ["diagnose", str(folder), *out], "never leaves zero")


@pytest.mark.parametrize("n", [4, 10, 25])
def test_a_few_samples_get_an_honest_verdict(tmp_path, n):
    (tmp_path / "recordings").mkdir()
    rng = np.random.default_rng(0)
    strain = np.linspace(0, 0.5, n)
    pd.DataFrame(
        {
            "time_s": np.arange(n),
            "strain": strain,
            "stress_MPa": strain + 0.01 * rng.standard_normal(n),
        }
    ).to_csv(tmp_path / "recordings/a.csv", index=False)
    assert diagnose(read_case(tmp_path)).result["verdict"] in (
        "undetermined",
        "nothing_missing",
    )


def test_constant_strain_and_one_recording_are_allowed(tmp_path):
    (tmp_path / "recordings").mkdir()
    rng = np.random.default_rng(0)
    time = np.arange(0, 50, 0.1)
    stress = 0.3 + 0.2 * np.exp(-time / 5) + 0.002 * rng.standard_normal(len(time))
    pd.DataFrame({"time_s": time, "strain": 0.4, "stress_MPa": stress}).to_csv(
        tmp_path / "recordings/a.csv", index=False
    )
    result = diagnose(read_case(tmp_path)).result
    assert result["verdict"] in ("nothing_missing", "undetermined")


def test_a_clock_may_run_on_and_repeat_the_last_sample(tmp_path):
    folder = write_case(tmp_path, toml='history = "continued"\n')
    begins = 0.0
    for file in sorted((folder / "recordings").glob("*.csv")):
        table = pd.read_csv(file)
        table["time_s"] += begins
        begins = table["time_s"].iloc[-1]
        table.to_csv(file, index=False)
    assert 0 < diagnose(read_case(folder)).result["fit"]["after"]["nrmse"] < 0.1


@pytest.mark.parametrize(
    ("levels", "only"),
    [
        ([0, 0.8], True),
        ([0, 0, 0.8], True),
        ([0, 0.8, 0.8], False),
        ([0, 0.8, 0], False),
    ],
)
def test_a_wait_before_the_pull_is_no_hold(levels, only):
    chunk = straight(levels, 0.02, 0.1)
    data = Data(("a",), (chunk,), (chunk.strain,))
    assert only_loading(Engine(data)) == only


@pytest.mark.parametrize(("dwell_s", "only"), [(4.0, True), (12.0, False)])
def test_a_short_dwell_at_the_end_of_a_pull_is_no_hold(dwell_s, only):
    time = np.arange(0, 40 + dwell_s, 0.1)
    chunk = Chunk(time, 0.02 * np.minimum(time, 40.0))
    data = Data(("a",), (chunk,), (chunk.strain,))
    assert only_loading(Engine(data)) == only


@pytest.mark.parametrize(
    ("levels", "shown"),
    [
        ([0, 0.4, 0.4, 0.8, 0.8], False),  # held twice, never let back
        ([0, 0.8, 0.8, 0.79], False),
        ([0, 0.4, 0.4, 0.8, 0.8, 0.4], True),
        ([0, 0.8], True),  # first loading alone has a verdict of its own
    ],
)
@pytest.mark.parametrize("split", [False, True])
def test_what_shows_on_the_way_back_is_not_asked_for_before(levels, shown, split):
    chunk = straight(levels, 0.02, 0.1)
    chunks = [chunk]
    if split and len(levels) > 4:  # the same history, recorded in two parts
        half = len(chunk.time_s) // 2
        chunks = [
            Chunk(chunk.time_s[part], chunk.strain[part])
            for part in (slice(half), slice(half, None))
        ]
    names = tuple("ab"[: len(chunks)])
    strains = tuple(c.strain for c in chunks)
    engine = Engine(Data(names, tuple(chunks), strains, continued=split))
    asked = {e.id for e in candidates(engine, "pl-wiechert", False)}
    back = {"mullins_softening", "permanent_set", "cyclic_softening"}
    back |= {"friction_hysteresis"}
    assert (back <= asked) if shown else not (back & asked)
    assert {"finite_strain", "nonlinear_viscosity", "slack"} <= asked


@pytest.mark.parametrize(
    ("factors", "certain"),
    [([0.9] * 5, False), ([1.3] * 5, True), ([0.5, 0.5, 0.5, 3, 1], False)],
)
def test_effects_that_foretell_worse_are_not_named(monkeypatch, factors, certain):
    errors = {"base": np.ones(5), "found": np.array(factors)}
    monkeypatch.setattr(verify, "heldout", lambda engine, name: (errors[name], None))
    base = SimpleNamespace(engine=None, fit="base")
    assert worse(base, SimpleNamespace(final="found")) == certain


def test_a_verdict_without_names_where_more_is_foretold_worse(tmp_path, monkeypatch):
    case = read_case(write_case(tmp_path / "a", [mullins()]))
    monkeypatch.setattr(diagnosis, "worse", lambda base, found: True)
    result = diagnose(case).result
    assert (result["verdict"], result["selected"]) == ("unexplained", [])


@pytest.mark.parametrize(("scale", "doubtful"), [(0.12, True), (0.3, False)])
def test_a_law_at_the_end_of_what_it_could_be_is_doubtful(scale, doubtful):
    # Softening all done before a fifth of the largest strain, 0.6, is a joint.
    time = np.arange(5.0)
    scales = Data(("a",), (Chunk(time, time * 0.15),), (time,)).scales()
    law = effect("mullins_softening").second_forms[0].within(scales)
    piece = Piece(law, law.defaults() | {"scale": scale}, ("depth", "scale"))
    assert diagnosis.strained(piece) == doubtful
    wide = effect("mullins_softening")
    assert not diagnosis.strained(Piece(wide, wide.defaults() | {"scale": 1e-3}, ()))


@pytest.mark.parametrize("end", [True, False])
def test_a_name_whose_law_is_at_its_end_is_not_confident(tmp_path, monkeypatch, end):
    case = read_case(write_case(tmp_path / "a", [mullins()]))
    monkeypatch.setattr(diagnosis, "strained", lambda piece: end)
    found = diagnose(case).result["explanations"]
    assert [e["effect"] for e in found] == ["mullins_softening"]
    assert (found[0]["probability"] < 0.5) == end


def test_rivals_beside_other_effects_count_in_the_probability(tmp_path, monkeypatch):
    case = read_case(write_case(tmp_path / "a", [mullins()]))

    def tied(engine, found, pool, sure):
        names = ("mullins_softening", "permanent_set")
        return found, {names[0]: [Rival(n, found, 0.0) for n in names]}

    monkeypatch.setattr(explain, "twins", tied)
    found = diagnose(case).result["explanations"]
    assert found[0]["probability"] == pytest.approx(0.5, abs=0.01)


def test_a_diagnosis_keeps_to_one_blas_thread(tmp_path, monkeypatch):
    case = read_case(write_case(tmp_path / "a", [mullins()]))

    def threads(*_):
        about = threadpool_info()
        return {i["num_threads"] for i in about if i["user_api"] == "blas"}

    monkeypatch.setattr(diagnosis, "_diagnose", threads)
    with threadpool_limits(limits=2, user_api="blas"):
        assert threads() == {2}
        assert diagnose(case) == {1}


def account(**other):
    """An explanation as the verdict sees it: a mismatch of ten times the noise."""
    values = {"left": 0.01, "excess_before": 10.0, "excess_after": 0.1, "line": 0.0}
    values |= {"excess_bent": 0.05, "selected": ["slack"], "odds_of_strangers": 0.0}
    guess = SimpleNamespace(pieces=())
    values |= {"final": SimpleNamespace(guess=guess), "base": SimpleNamespace(engine=0)}
    return SimpleNamespace(**values | other, noise=[SimpleNamespace(correlation=0.0)])


@pytest.mark.parametrize(
    ("other", "sure"),
    [
        ({}, True),
        ({"left": 0.05}, False),
        ({"left": 0.3, "excess_after": 0.001}, False),  # no more than noise, but much
        ({"excess_bent": 0.5}, False),  # no form of the effect takes it up
        ({"line": 6.0}, False),  # something that comes back regularly is left
        ({"selected": ["slack", "gain_error"]}, True),
        ({"selected": ["slack", "gain_error"], "excess_before": 2.0}, False),
        ({"selected": ["slack", "gain_error", "inertia"]}, False),
    ],
)
def test_a_name_is_sure_only_where_little_speaks_against_it(other, sure):
    law = effect("slack")
    rival = SimpleNamespace(
        effect="slack", fit=SimpleNamespace(residual=[0] * 9, chi2=9.0, parameters=1)
    )
    excess = other.get("excess_before", 10.0)
    found = account(**{"excess_bent": 0.005 * excess, **other})
    chance = _probability(found, [rival], SimpleNamespace(effect=law))
    assert (chance >= 0.5) == sure


def test_a_dwell_is_as_long_as_it_lasts_however_few_its_samples():
    time = np.concatenate([np.arange(0, 40, 0.1), [40, 44, 48, 52]])
    chunk = Chunk(time, 0.02 * np.minimum(time, 40.0))
    assert not only_loading(Engine(Data(("a",), (chunk,), (chunk.strain,))))
