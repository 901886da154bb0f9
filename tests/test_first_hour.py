"""The first hour: the commands as somebody meets them who has never used them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import softnn
from softnn.cli import main
from softnn.contracts import InputError
from softnn.mismatch.api import inferred, to_case
from softnn.mismatch.demo import conceal


def spring(path, stiffness=2.0, samples=120, header="time_s,strain,stress_MPa"):
    """A file of a spring, pulled and let go, with a little white noise."""
    time = np.linspace(0, 30, samples)
    strain = 0.3 * (1 - np.abs(time / 15 - 1))
    noise = 0.003 * np.random.default_rng(list(path.name.encode())).standard_normal(
        samples
    )
    table = np.column_stack([time, strain, stiffness * strain + noise])
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.8g")
    return path


def said(capsys, *words):
    code = main([str(w) for w in words])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_demo_finds_what_it_concealed_and_names_its_report(tmp_path, capsys):
    code, out, _ = said(capsys, "demo", "--out", tmp_path / "demo", "--effect", "slack")
    assert code == 0
    page = next(x for x in out.splitlines() if x.startswith("report: "))
    assert "Slack" in out
    assert softnn.__version__ in Path(page.removeprefix("report: ")).read_text()
    found = json.loads((tmp_path / "demo/found/case/diagnosis.json").read_text())
    assert found["selected"] == ["slack"]
    assert found["provenance"]["seed"] == 0


def test_what_is_concealed_is_told_nowhere_in_the_recordings(tmp_path):
    names = conceal(tmp_path, "mullins_softening", 1)
    for name in names:
        frame = pd.read_csv(tmp_path / "recordings" / f"{name}.csv")
        assert list(frame) == ["time_s", "strain", "stress_MPa"]
    again = tmp_path / "again"
    conceal(again, "mullins_softening", 1)
    file = f"recordings/{names[0]}.csv"
    assert (again / file).read_bytes() == (tmp_path / file).read_bytes()


def test_a_plain_folder_is_a_case_and_what_is_left_out_is_told(tmp_path):
    spring(tmp_path / "a.csv")
    spring(tmp_path / "b.CSV")
    spring(tmp_path / "c.txt")
    (tmp_path / "photo.jpg").write_bytes(b"")
    case = to_case(tmp_path)
    assert [r.name for r in case.recordings] == ["a", "b", "c"]
    assert any("photo.jpg" in note for note in case.notes)
    spring(tmp_path / "case" / "recordings" / "d.CSV")
    spring(tmp_path / "case" / "recordings" / "e.txt")
    case = to_case(tmp_path / "case")
    assert [r.name for r in case.recordings] == ["d", "e"]


def test_it_says_what_it_inferred(tmp_path):
    case = to_case([spring(tmp_path / "a.csv"), spring(tmp_path / "b.csv")])
    first, *_, last = inferred(case, "hooke")
    assert first == (
        "a: tidy CSV, 120 samples, 30 s; strain up to 29.7 % at 2 % a second; "
        "stress to 0.598 MPa: silicone or rubber"
    )
    assert "2 recordings of unnamed specimens" in last
    assert last.endswith("base: hooke")


def test_files_are_one_case_and_json_is_for_programs(tmp_path, capsys):
    files = spring(tmp_path / "lab" / "a.csv"), spring(tmp_path / "lab" / "b.csv")
    out = tmp_path / "out"
    code, told, _ = said(
        capsys, "diagnose", *files, "--out", out, "--model", "hooke", "--json"
    )
    assert code == 0
    (row,) = json.loads(told)
    assert row["case"] == "lab"
    assert row["result"]["verdict"] == "nothing_missing"
    assert (out / row["page"]).is_file()


def test_options_for_machine_files_reach_them(tmp_path, capsys):
    """Load over 12 mm2 and travel over 30 mm: the stress and strain of the spring."""
    time = np.linspace(0, 30, 120)
    pull = 9 * (1 - np.abs(time / 15 - 1))
    file = tmp_path / "machine.csv"
    table = np.column_stack([time, pull, 12 * 2 * pull / 30])
    np.savetxt(
        file, table, "%.6g", ",", header="Time (s),Extension (mm),Load (N)", comments=""
    )
    with pytest.raises(InputError, match="length"):
        to_case([file])
    case = to_case([file], length_mm=30, area_mm2=12)
    np.testing.assert_allclose(
        case.recordings[0].stress_MPa, 2 * case.recordings[0].strain, atol=1e-4
    )


def test_many_cases_have_an_index_with_those_that_could_not_be_used(tmp_path, capsys):
    good = tmp_path / "good"
    spring(good / "a.csv")
    (tmp_path / "empty").mkdir()
    code, out, err = said(
        capsys, "diagnose", good, tmp_path / "empty", "--out", tmp_path / "out",
        "--model", "hooke", "--jobs", 1,
    )  # fmt: skip
    assert code == 2
    assert out.startswith("good: ")
    assert "no recordings" in err
    page = (tmp_path / "out" / "index.html").read_text()
    assert 'href="good/report.html"' in page
    assert "no recordings" in page


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["diagnos", "x"], "'diagnose'"),
        (["demo", "--out", "OUT", "--effect", "slak"], "'slack'"),
        (["diagnose", "x", "--out", "OUT", "--model", "pl-wichert"], "'pl-wiechert'"),
    ],
)
def test_a_misspelt_name_is_met_with_the_nearest(words, meant, tmp_path, capsys):
    words = [str(tmp_path / "o") if w == "OUT" else w for w in words]
    code, _, err = said(capsys, *words)
    assert code == 2
    assert f"did you mean {meant}?" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "command", ["read", "diagnose", "plan", "simulate", "export", "demo"]
)
def test_every_help_has_an_example(command, capsys):
    with pytest.raises(SystemExit, match="0"):
        main([command, "--help"])
    assert f"softnn {command} " in capsys.readouterr().out.partition("Example")[2]


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert softnn.__version__ in capsys.readouterr().out
