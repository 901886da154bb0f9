"""`softnn simulate` says what a corrected model does not know of a recording."""

import json

import numpy as np
import pandas as pd
import pytest

from softnn.cli import main
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.model_file import to_dict
from softnn.models.units import Units

UNITS = Units("pl-wiechert", (0.0, 0.3, 1.0), (0.4, 8.0))
STIFFNESS = np.array([1.0, 0.6, 0.5, 0.4])


def offset_model(folder, **own):
    """A stored model of strain 0 to 1 with zero offsets of single recordings."""
    law = effect("zero_offset")
    values = {"offset_MPa": np.array(list(own.values())) if own else 0.0}
    guess = Guess(UNITS, STIFFNESS, (Piece(law, values, ()),))
    file = folder / "model.json"
    file.write_text(json.dumps(to_dict(guess, list(own), "fresh", False)))
    return str(file)


def test_simulate_warns_in_a_line_of_what_the_model_does_not_know(tmp_path, capsys):
    model, files = offset_model(tmp_path, known=0.1, other=0.2), []
    for name, peak in (("known", 1.005), ("near", 0.9), ("far", 1.2)):
        files.append(str(tmp_path / f"{name}.csv"))
        pull = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "strain": [0.0, peak, 0.0]})
        pull.to_csv(files[-1], index=False)
    out = str(tmp_path / "out")
    assert main(["simulate", model, *files, "--out", out]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "softnn: far: strain beyond 0 to 1, which the model was made from",
        "softnn: near, far: unknown to the model by name; own values of that recording "
        "are off (it knows known, other; --like NAME takes those of one)",
    ]
    starts = [
        pd.read_csv(tmp_path / "out" / f"{n}.csv")["simulated_MPa"][0]
        for n in ("known", "near", "far")
    ]
    assert starts == [0.1, 0.0, 0.0]
    assert main(["simulate", model, *files, "--out", out, "--like", "other"]) == 0
    assert "unknown" not in capsys.readouterr().err
    again = pd.read_csv(tmp_path / "out" / "near.csv")["simulated_MPa"][0]
    assert again == 0.2
    assert main(["simulate", model, *files, "--out", out, "--like", "othr"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "did you mean 'other'?" in told


def test_simulate_is_quiet_where_nothing_is_unknown(tmp_path, capsys):
    model, file = offset_model(tmp_path), tmp_path / "a.csv"
    file.write_text("time_s,strain\n0,0\n1,0.5\n")
    assert main(["simulate", model, str(file), "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().err == ""
    columns = pd.read_csv(tmp_path / "out" / "a.csv").columns
    assert "outside" not in columns


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("time_s,stress_MPa\n0,0\n1,1\n", "column 'strain': no such column"),
        (
            "time_s,strain\n0,0\n1,much\n",
            "row 3, column 'strain': 'much' is not a number",
        ),
        ("time_s,strain\n0,0\n1,inf\n", "row 3, column 'strain': infinite"),
        ("time_s,strain\n0,\n1,\n", "column 'strain': holds no number"),
        ("time_s,strain\n1,0\n0,1\n", "row 3, column 'time_s': time goes backwards"),
        ("time_s,strain\n0,0\n", "one row"),
    ],
)
def test_a_history_that_cannot_be_simulated_is_refused_in_its_row(
    rows, said, tmp_path, capsys
):
    model, file = offset_model(tmp_path), tmp_path / "a.csv"
    file.write_text(rows)
    assert main(["simulate", model, str(file), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_missing_strain_is_bridged_straight_in_time(tmp_path, capsys):
    model, file = offset_model(tmp_path), tmp_path / "a.csv"
    out = tmp_path / "out"
    made = []
    for middle in ("", "0.25"):
        file.write_text(f"time_s,strain\n0,0\n1,{middle}\n2,0.5\n")
        assert main(["simulate", model, str(file), "--out", str(out)]) == 0
        made.append(pd.read_csv(out / "a.csv")["simulated_MPa"].to_numpy())
    np.testing.assert_array_equal(*made)
