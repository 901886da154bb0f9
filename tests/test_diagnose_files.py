"""The files of a diagnosis, and the commands that write and read them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made import STIFFNESS, UNITS, histories, mullins, write_case

import softnn.mismatch
from softnn.cli import main
from softnn.contracts import InputError
from softnn.fit import Guess
from softnn.mismatch import diagnosis
from softnn.mismatch.case import read_case
from softnn.mismatch.diagnosis import diagnose
from softnn.model_file import from_dict, read_model, to_dict
from softnn.simulate import simulate

FOLDER = Path(softnn.mismatch.__file__).parent


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


def test_files_keep_to_their_schemas(softened):
    _, out = softened
    for name, schema in (
        ("diagnosis", "diagnosis"),
        ("model", "model"),
        ("base", "model"),
    ):
        value = json.loads((out / f"{name}.json").read_text())
        conforms(value, json.loads((FOLDER / f"{schema}.schema.json").read_text()))


def test_report_is_of_the_diagnosis_and_escapes_names(softened):
    _, out = softened
    page = (out / "report.html").read_text()
    assert "<b>" not in page
    assert "soft &lt;b&gt;" in page
    _, told = page.split('<script type="application/json" id="diagnosis">')
    stored = json.loads((out / "diagnosis.json").read_text())
    assert json.loads(told.split("</script>")[0]) == stored


def test_simulate_repeats_the_corrected_model_without_the_stress(softened, tmp_path):
    case, out = softened
    files = sorted((case / "recordings").glob("*.csv"))
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


def test_model_file_reads_back_as_it_was(softened):
    _, out = softened
    stored = read_model(out / "model.json")
    assert stored.pieces[0].effect.id == "mullins_softening"
    data = json.loads((out / "model.json").read_text())
    data["effects"][0]["effect"] = "x"
    with pytest.raises(InputError, match="no effect 'x'"):
        from_dict(data)
    with pytest.raises(InputError, match="kind"):
        from_dict({})


def test_a_shape_that_a_model_file_does_not_know_is_the_usual_one(softened):
    _, out = softened
    data = json.loads((out / "model.json").read_text())
    values = data["effects"][0]["values"]
    del values["viscous_share"]
    assert from_dict(data).pieces[0].values["viscous_share"] == 1
    del values["depth"]  # its size is no shape
    with pytest.raises(InputError, match="depth"):
        from_dict(data)


@pytest.mark.slow
def test_a_stored_model_is_a_base(softened):
    folder, out = softened
    case = read_case(folder)
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
    refuse(capsys, ["diagnose", str(folder), *out], "stands at 0")


def small_case(folder):
    """One recording of a spring, for what is not about the diagnosis."""
    (folder / "recordings").mkdir(parents=True)
    time, rng = np.linspace(0, 9, 90), np.random.default_rng(0)
    table = {"time_s": time, "strain": 0.3 * (1 - np.abs(time / 4.5 - 1))}
    table["stress_MPa"] = table["strain"] + 0.01 * rng.standard_normal(90)
    pd.DataFrame(table).to_csv(folder / "recordings/a.csv", index=False)
    return folder


def test_a_finished_case_is_left_alone_until_its_data_change(tmp_path, capsys):
    case = small_case(tmp_path / "case")
    page = tmp_path / "out" / "case" / "report.html"
    again = ["diagnose", str(case), "--out", str(tmp_path / "out"), "--jobs", "1"]
    again += ["--model", "hooke", "--resume"]
    assert main(again) == 0
    before = page.stat().st_mtime_ns
    assert "done before" not in capsys.readouterr().out
    assert main(again) == 0
    assert "done before: " in capsys.readouterr().out
    assert page.stat().st_mtime_ns == before
    (case / "case.toml").write_text('history = "continued"\n')
    assert main(again) == 0
    assert "done before" not in capsys.readouterr().out
    assert page.stat().st_mtime_ns > before


def test_a_case_that_softnn_fails_on_does_not_stop_the_others(
    tmp_path, capsys, monkeypatch
):
    cases = [small_case(tmp_path / name) for name in ("first", "second")]
    whole = diagnosis.diagnose

    def failing(case, *rest):
        if case.name == "first":
            raise ZeroDivisionError("by a law")
        return whole(case, *rest)

    monkeypatch.setattr(diagnosis, "diagnose", failing)
    out, told = tmp_path / "out", tmp_path / "out/first/error.txt"
    asked = ["diagnose", *map(str, cases), "--out", str(out), "--model", "hooke"]
    assert main([*asked, "--jobs", "1"]) == 2
    said = capsys.readouterr()
    assert "ZeroDivisionError: by a law" in said.err
    assert str(told) in said.err
    assert "Traceback" not in said.err
    assert "in failing" in told.read_text()
    assert "second" in said.out
    assert (out / "second/report.html").exists()
    monkeypatch.undo()
    assert main([*asked, "--jobs", "1"]) == 0
    assert not told.exists()


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path, capsys):
    case = write_case(tmp_path / "good")
    taken = tmp_path / "file"
    taken.write_text("")
    told = "cannot be written to"
    refuse(capsys, ["diagnose", str(case), "--out", str(taken)], told)
    refuse(capsys, ["diagnose", str(case), "--out", str(taken / "x")], told)
    model = tmp_path / "model.json"
    model.write_text(json.dumps(to_dict(Guess(UNITS, STIFFNESS), [], "fresh", False)))
    file = str(case / "recordings" / "r0.csv")
    refuse(capsys, ["simulate", str(model), file, "--out", str(taken)], told)
    seed = ["diagnose", str(case), "--out", str(tmp_path / "o"), "--seed", "-1"]
    refuse(capsys, seed, "--seed is -1")


OFFSET = {
    "effect": "zero_offset", "form": "ZeroOffset", "values": {"offset_MPa": 0.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("base.name", "banana", "no base 'banana'"),
        ("base.stiffness_MPa", [1e308] * 4, "out of range"),
        ("base.stiffness_MPa", [float("inf")] * 4, "no number"),
        ("base.stiffness_MPa", [1, 1, "x", 1], "cannot be read"),
        ("base.stiffness_MPa", [1.0], "4 numbers"),
        ("base.knots", [0.0, float("nan"), 1.0], "no number"),
        ("base.relaxation_times_s", [0.0, 1.0], "above 0"),
        ("base", [], "cannot be read"),
        ("history", "tired", "history is 'tired'"),
        ("effects", [OFFSET | {"own": []}], "cannot be read"),
        ("effects", [OFFSET | {"own": {"offset_MPa": [1.0]}}], "cannot be read"),
        ("effects", [OFFSET | {"own": {"x": {"a": 1.0}}}], "'x'"),
        ("effects", [OFFSET | {"own": {"offset_MPa": {"a": 1e300}}}], "allowed is"),
        ("effects", [[]], "cannot be read"),
        ("learned", "junk", "cannot be read"),
        ("learned", {"features": ["mood"], "network": {}}, "mood"),
        ("learned", {"features": ["strain"], "network": {}}, "not a network"),
        ("simulation", [], "kind"),
    ],
)
def test_junk_in_a_model_file_is_refused_in_one_line(
    key, value, said, tmp_path, capsys
):
    data = to_dict(Guess(UNITS, STIFFNESS), [], "fresh", False)
    *outer, last = key.split(".")
    (data[outer[0]] if outer else data)[last] = value
    file = tmp_path / "model.json"
    file.write_text(json.dumps(data))
    recording = tmp_path / "r.csv"
    recording.write_text("time_s,strain\n0,0\n1,0.1\n")
    out = ["--out", str(tmp_path / "out")]
    refuse(capsys, ["simulate", str(file), str(recording), *out], "model.json", said)


def test_a_file_without_bottom_is_refused(tmp_path):
    file = tmp_path / "model.json"
    file.write_text("[" * 200_000)
    with pytest.raises(InputError, match="nested too deep"):
        read_model(file)
