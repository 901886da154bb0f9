"""A folder as a lab has it, by command and from Python: what is asked, how often."""

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lab_made import (
    HEADER,
    LOAD,
    SIZES,
    STRAIN,
    STRESS,
    TIDY,
    TIME,
    WAY,
    WORDS,
    written,
)

import softnn
from softnn import progress
from softnn.cli import main
from softnn.contracts import InputError
from softnn.fit import Guess
from softnn.mismatch.api import plausible, to_case
from softnn.mismatch.case import case_of
from softnn.model_file import to_dict
from softnn.models.units import Units
from softnn.plausible import check_plausible
from softnn.readers.tidy import read_tidy, write_table


@pytest.fixture
def lab(tmp_path):
    """Two recordings, one in a subfolder, a copy, and what lies beside them."""
    folder = tmp_path / "lab"
    written(folder / "a.csv", HEADER, TIME, WAY, LOAD)
    written(folder / "day 2" / "b.csv", HEADER, TIME, 0.8 * WAY, 0.8 * LOAD)
    (folder / "a (copy).csv").write_bytes((folder / "a.csv").read_bytes())
    (folder / "notes.txt").write_text("Pulled on Monday.\nHumid.\n")
    (folder / "contacts.csv").write_text("name,mail\nAnna,a@x.org\nBob,b@x.org\n")
    (folder / "~$x.xlsx").write_bytes(b"\x05Anna" + b" " * 60)
    (folder / "._a.csv").write_bytes(b"\x00\x05\x16\x07Mac OS X")
    (folder / "results.csv").write_text("Specimen,Max load (N)\n1,9.1\n2,9.3\n3,9.2\n")
    return folder


BESIDE = ("a (copy).csv", "notes.txt", "contacts.csv", "~$x.xlsx", "._a.csv", "results")


def told(capsys, *words):
    code = main([str(w) for w in words])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_strays_and_copies_are_passed_over_and_named(lab):
    case = to_case(lab, **SIZES)
    assert sorted(r.name for r in case.recordings) == ["a", "b"]
    for name in BESIDE:
        assert any(name in note for note in case.notes), name


def test_all_sizes_are_asked_for_in_one_message_and_its_command_works(
    lab, tmp_path, capsys
):
    out = tmp_path / "out"
    words = ["diagnose", lab, "--model", "hooke", "--out", out]
    code, _, err = told(capsys, *words)
    assert code == 2
    assert err.count("\n") == 1
    typed = shlex.split(re.search(r"Type: (softnn diagnose.*?)\. Sizes", err)[1])
    typed[typed.index("MM2")] = "18"
    typed[typed.index("MM")] = "25"
    code, said, err = told(capsys, *typed[1:])
    assert code == 0
    page = next(x for x in said.splitlines() if x.startswith("report: "))
    assert Path(page.removeprefix("report: ")).is_file()
    assert "2 recordings of unnamed specimens" in err
    assert all(name in err for name in BESIDE)


def test_sizes_of_each_specimen_come_from_the_table_that_the_command_writes(
    lab, capsys
):
    code, said, _ = told(capsys, "diagnose", lab, "--template")
    table = lab / "specimens.csv"
    assert code == 0
    assert str(table) in said
    frame = pd.read_csv(table, dtype=str)
    assert sorted(frame["file"]) == ["a.csv", "day 2/b.csv"]  # recordings, each once
    frame["length_mm"] = ["25", "25"]
    frame.loc[frame["file"] == "a.csv", ["specimen", "area_mm2"]] = ["A", "18"]
    frame.loc[frame["file"] != "a.csv", ["specimen", "width_mm", "thickness_mm"]] = [
        "B", "6", "2",
    ]  # fmt: skip
    frame.to_csv(table, index=False)
    case = to_case(lab)
    stress = {r.name: r.stress_MPa for r in case.recordings}
    np.testing.assert_allclose(stress["a"], STRESS, atol=1e-6)
    np.testing.assert_allclose(stress["b"], 0.8 * LOAD / 12, atol=1e-6)
    assert case.specimen == {"a": "A", "b": "B"}
    # A second time, what was filled in stays.
    told(capsys, "diagnose", lab, "--template")
    pd.testing.assert_frame_equal(pd.read_csv(table, dtype=str), frame)


TABLES = {
    "no endings": b"file,specimen,length_mm,area_mm2\na,A,25,18\nb,B,25,18\n",
    "German": "Datei;Probe;Messl\u00e4nge (cm);Querschnitt (mm\u00b2);Bemerkung\n"
    "a.csv;A;2,5;18;neu\nday 2/b.csv;B;2,5;18;\n".encode("cp1252"),
    "UTF-16": "File\tSpecimen\tLength [mm]\tArea [mm2]\n"
    "a.csv\tA\t25\t18\nb.csv\tB\t25\t18\n".encode("utf-16"),
}


@pytest.mark.parametrize("name", ["specimens.csv", "Specimens.csv"])
@pytest.mark.parametrize("table", TABLES)
def test_a_table_of_sizes_as_labs_write_it(table, name, lab):
    (lab / name).write_bytes(TABLES[table])
    case = to_case(lab)
    assert case.specimen == {"a": "A", "b": "B"}
    np.testing.assert_allclose(case.recordings[0].stress_MPa, STRESS, atol=1e-6)


def test_a_table_of_sizes_in_a_workbook(lab):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["file", "length_mm", "area_mm2"], ["a", 25, 18], ["b", 25, 9]):
        book.active.append(row)
    book.save(lab / "specimens.xlsx")
    first, second = to_case(lab).recordings
    np.testing.assert_allclose(first.stress_MPa, STRESS, atol=1e-6)
    assert second.geometry.area == 9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("file,Width\na.csv,3\n", "write it as width_mm"),
        ("file,length_mm,Length [cm]\na.csv,3,3\n", "twice"),
        ("file,length_mm\nc.csv,3\n", "did you mean 'a.csv'"),
        ("file,lenght_mm\na.csv,3\n", "did you mean 'length_mm'"),
        ("name,length_mm\na.csv,3\n", "no column 'file'"),
        ("file,length_mm\na.csv,-3\n", "no size"),
        ("file;length_mm\na.csv;drei\n", "no size"),
    ],
)
def test_a_table_of_sizes_that_cannot_be_is_refused_in_its_place(lab, text, said):
    (lab / "specimens.csv").write_text(text)
    with pytest.raises(InputError, match=said) as error:
        to_case(lab)
    assert "specimens.csv" in str(error.value)


def test_what_cannot_be_read_is_said_at_once_and_the_advice_works(lab, capsys):
    for i in (1, 2):
        written(lab / f"bad{i}.csv", HEADER, TIME[::-1], WAY, i * LOAD)
    with pytest.raises(InputError, match="2 of 8 files") as error:
        to_case(lab, **SIZES)
    skips = shlex.split(str(error.value).partition("leave them out: ")[2])[1::2]
    assert skips == ["bad1.csv", "bad2.csv"]
    assert len(to_case(lab, skip=skips, **SIZES).recordings) == 2


def test_recordings_of_one_name_get_their_folders(tmp_path):
    for day in ("mon", "tue"):
        written(tmp_path / day / "a.csv", TIDY, TIME, STRAIN, STRESS + 0.01 * len(day)
                + 0.1 * (day == "tue"))  # fmt: skip
    names = [r.name for r in softnn.read(tmp_path)]
    assert names == ["mon-a", "tue-a"]


@pytest.mark.slow
def test_two_cases_of_one_name_are_told_apart(tmp_path, capsys):
    cases = [tmp_path / day / "case" for day in ("mon", "tue")]
    for case in cases:
        written(case / "a.csv", TIDY, TIME, STRAIN, STRESS)
    out = tmp_path / "out"
    words = ("--out", out, "--model", "hooke", "--jobs", 1, "--json")
    code, said, _ = told(capsys, "diagnose", *cases, *words)
    assert code == 0
    assert [row["case"] for row in json.loads(said)] == ["mon_case", "tue_case"]


def test_copies_by_content_are_no_second_specimen(tmp_path):
    written(tmp_path / "a.csv", TIDY, TIME, STRAIN, STRESS)
    again = written(tmp_path / "b.txt", "t [s];strain [%];stress [kPa]", TIME,
                    100 * STRAIN, 1000 * STRESS, delimiter=";")  # fmt: skip
    case = to_case(tmp_path)
    assert len(case.recordings) == 1
    assert any(again.name in n and "a copy of a.csv" in n for n in case.notes)
    one, other = (softnn.read(tmp_path / f)[0] for f in ("a.csv", "b.txt"))
    found = softnn.diagnose([one, other], "hooke")
    assert len(found.case.recordings) == 1


def test_the_same_test_in_fewer_samples_or_digits_is_a_copy(tmp_path):
    written(tmp_path / "processed" / "a.csv", TIDY, TIME[::3], STRAIN[::3], STRESS[::3])
    written(tmp_path / "raw" / "test 1.csv", HEADER, TIME, WAY, LOAD)
    written(tmp_path / "a_short.csv", TIDY, TIME, [f"{v:.5f}" for v in STRAIN],
            [f"{v:.5f}" for v in STRESS])  # fmt: skip
    case = to_case(tmp_path, length_mm=25, area_mm2=18)
    assert len(case.recordings) == 1
    assert len(case.recordings[0]) == len(TIME)
    assert sum("a copy of" in note for note in case.notes) == 2


def test_a_file_a_cycle_is_told_and_a_new_test_is_not(tmp_path):
    for k in range(3):
        part = slice(80 * k, 80 * k + 80)
        written(tmp_path / f"{k}.csv", TIDY, TIME[part], STRAIN[part], STRESS[part])
    (note,) = to_case(tmp_path).notes
    assert "1 begins loaded, where 0 ends, and 1 more alike" in note
    (tmp_path / "case.toml").write_text('history = "continued"\n')
    assert to_case(tmp_path).notes == ()
    other = written(tmp_path / "other" / "a.csv", TIDY, TIME, STRAIN, STRESS)
    again = written(tmp_path / "other" / "b.csv", TIDY, TIME, STRAIN, 1.01 * STRESS)
    assert to_case([other, again]).notes == ()


def test_one_length_for_specimens_of_several_is_told(tmp_path):
    files = [
        written(tmp_path / f"{k}.csv", HEADER, TIME, factor * WAY, LOAD * (1 + k / 50))
        for k, factor in enumerate((1, 1.1, 0.95))
    ]
    (note,) = to_case(files, length_mm=25, area_mm2=18).notes
    assert "factor" in note
    assert "--template" in note
    # Amplitudes of one specimen differ by more.
    files = [
        written(tmp_path / "b" / f"{k}.csv", HEADER, TIME, k * WAY / 3, k * LOAD / 3)
        for k in (1, 2, 3)
    ]
    assert to_case(files, length_mm=25, area_mm2=18).notes == ()


# -- a simulation beside the recordings ------------------------------------------------


def test_a_simulation_in_a_plain_folder_is_the_base(tmp_path):
    simulated = 0.5 * STRAIN
    for name, scale in (("a", 1.0), ("b", 0.9)):
        for folder in (tmp_path / "plain", tmp_path / "case" / "recordings"):
            written(folder / f"{name}.csv", TIDY + ",simulated_MPa", TIME,
                    scale * STRAIN, STRESS, simulated)  # fmt: skip
    plain, case = to_case(tmp_path / "plain"), to_case(tmp_path / "case")
    files = to_case([tmp_path / "plain" / f for f in ("a.csv", "b.csv")])
    for one in (plain, case, files):
        for values in one.simulated_MPa:
            np.testing.assert_allclose(values, simulated, atol=1e-6)
    (first, _) = softnn.read(tmp_path / "plain")
    np.testing.assert_allclose(first.simulated_MPa, simulated, atol=1e-6)
    assert softnn.diagnose(first).result["model"] == "simulated"


def test_the_column_of_a_simulation_is_never_the_measured_stress(tmp_path):
    header = "Time (s),Strain (-),Simulated stress (MPa),Measured stress (MPa)"
    file = written(tmp_path / "a.csv", header, TIME, STRAIN, STRAIN, STRESS)
    (one,) = softnn.read(file)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    np.testing.assert_allclose(one.simulated_MPa, STRAIN, atol=1e-6)


# -- what is written -------------------------------------------------------------------


def test_time_reads_back_exactly(tmp_path):
    times = 1709337590.25 + TIME
    write_table(tmp_path / "a.csv", {"time_s": times, "strain": STRAIN,
                                     "stress_MPa": STRESS})  # fmt: skip
    np.testing.assert_array_equal(read_tidy(tmp_path / "a.csv").time_s, times)


def test_files_are_written_before_the_text(tmp_path):
    """`softnn read ... | head -1`, with so much text that the pipe fills up."""
    files = [written(tmp_path / f"f{i}.csv", TIDY, TIME, STRAIN, STRESS)
             for i in range(3)]  # fmt: skip
    out = tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, "-m", "softnn.cli", "read", *map(str, files), "--out", out],
        stdout=subprocess.PIPE,
    ) as child:
        child.stdout.close()
        assert child.wait(60) == 0
    assert {f.name for f in out.glob("f*.csv")} == {f.name for f in files}


def test_a_full_disk_leaves_what_was_there(tmp_path, capsys, monkeypatch):
    file = written(tmp_path / "a.csv", TIDY, TIME, STRAIN, STRESS)
    words = ("diagnose", file, "--model", "hooke", "--out", tmp_path / "out")
    assert told(capsys, *words)[0] == 0
    folder = tmp_path / "out" / "a"
    before = {f.name: f.read_bytes() for f in folder.iterdir() if f.name[0] != "."}

    def full(self, *_args, **_more):
        raise OSError(28, "No space left on device", str(self))

    from softnn.mismatch.diagnosis import Diagnosis

    monkeypatch.setattr(Diagnosis, "report", full)
    code, said, err = told(capsys, *words)
    assert code == 2
    assert "No space left" in err
    assert "report: " not in said  # of the run before
    assert "earlier run" in err
    after = {f.name: f.read_bytes() for f in folder.iterdir() if f.name[0] != "."}
    assert after == before
    assert not list(folder.glob(".new*"))


@pytest.mark.slow
def test_ctrl_c_ends_with_one_line(tmp_path):
    files = [
        written(tmp_path / f"{i}.csv", TIDY, TIME, STRAIN * (1 + 0.1 * i), STRESS)
        for i in range(8)
    ]
    with subprocess.Popen(
        [sys.executable, "-m", "softnn.cli", "diagnose", *map(str, files),
         "--out", tmp_path / "out"],
        stderr=subprocess.PIPE, text=True,
    ) as child:  # fmt: skip
        for line in child.stderr:
            if "base: " in line:  # it has read, and begins to fit
                break
        time.sleep(1)
        child.send_signal(signal.SIGINT)
        rest = child.stderr.read()
        assert child.wait(20) == 130
    assert "Traceback" not in rest
    assert rest.strip().splitlines()[-1].startswith("softnn: stopped")
    assert not list((tmp_path / "out").rglob("*.json"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("read FOLDER", "no recordings in it"),
        ("diagnose FOLDER --template", "no recordings in it"),
        ("simulate a.csv m.json --out o", "the model comes first"),
        ("simulate FOLDER a.csv --out o", "is a folder; name the model.json in it"),
        ("simulate m.json EMPTY --out o", "an argument is empty"),
        ("export m.json --to c --out o/motor.c", "say --out o --name motor"),
    ],
)
def test_what_is_given_in_the_wrong_place_is_told(
    words, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "FOLDER").mkdir()
    written(tmp_path / "a.csv", TIDY, TIME, STRAIN, STRESS)
    given = ["" if w == "EMPTY" else w for w in words.split()]
    code, out, err = told(capsys, *given)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1
    assert (out, sorted(p.name for p in tmp_path.iterdir())) == (
        "",
        ["FOLDER", "a.csv"],
    )


def test_files_are_named_while_they_are_read(lab):
    heard = []
    with progress.heard(lambda now: heard.append(now)):
        to_case(lab, length_mm=25, area_mm2=18)
    assert {"reading"} == {now.stage for now in heard}
    shown = progress.Shown("lab", quiet=True)
    shown(progress.Progress("reading", 2, 1.0, 0.5, 8.0, "b.csv"))
    line = shown.line()
    assert "lab: reading b.csv [##########----------]" in line
    assert line.endswith("about 8 s left")


# -- simulate, and Python --------------------------------------------------------------


@pytest.mark.slow
def test_simulate_takes_what_diagnose_takes(lab, tmp_path, capsys):
    found = softnn.diagnose(lab, "hooke", **SIZES)
    found.save(tmp_path / "found")
    model = tmp_path / "found" / "model.json"
    code, said, _ = told(
        capsys, "simulate", model, lab, *WORDS, "--out", tmp_path / "o"
    )
    assert code == 0
    for line, name in zip(said.splitlines(), ("a", "b"), strict=True):
        path = tmp_path / "o" / f"{name}.csv"
        assert line.endswith(f"written to {path}")
        one = pd.read_csv(path)
        error = np.sqrt(
            np.sum((one["simulated_MPa"] - one["stress_MPa"]) ** 2)
            / np.sum(one["stress_MPa"] ** 2)
        )
        assert float(re.search(r"error ([\d.]+) %", line)[1]) == pytest.approx(
            100 * error, rel=0.01
        )


@pytest.mark.parametrize("given", ["FOLDER", "FILE"])
def test_simulate_writes_over_no_file_that_it_reads(tmp_path, capsys, given):
    raw, model = tmp_path / "raw", tmp_path / "model.json"
    raw.mkdir()
    written(raw / "a.csv", TIDY, TIME, STRAIN, STRESS)
    before = (raw / "a.csv").read_bytes()
    guess = Guess(Units("hooke", (0.0, 1.0)), np.array([2.0]))
    model.write_text(json.dumps(to_dict(guess, (), "fresh", False)))
    source = raw if given == "FOLDER" else raw / "a.csv"
    code, _, err = told(capsys, "simulate", model, source, "--as-is", "--out", raw)
    assert (code, err.count("\n")) == (2, 1)
    assert "would be lost" in err
    assert (raw / "a.csv").read_bytes() == before
    out = tmp_path / "out"
    for _ in range(2):  # what it wrote itself is made anew
        code, _, err = told(capsys, "simulate", model, source, "--as-is", "--out", out)
        assert code == 0
    assert (out / "a.csv").is_file()


def test_a_specimen_that_breaks_in_part_is_told(tmp_path):
    stress = np.where(np.arange(len(TIME)) > 0.4 * len(TIME), 0.2, 1.0) * STRESS
    one = softnn.Recording(TIME, STRAIN, stress, name="a")
    notes = plausible(case_of([one], "c")).notes
    (said,) = [n for n in notes if "failure" in n]
    at = float(re.search(r"at ([\d.]+) s", said)[1])
    assert at == pytest.approx(TIME[int(0.4 * len(TIME))], rel=0.05)
    whole = softnn.Recording(TIME, STRAIN, STRESS, name="a")
    assert not any("failure" in n for n in plausible(case_of([whole], "c")).notes)


def test_a_strain_that_stops_while_the_stress_rises_is_told():
    stops = np.where(TIME > 5, np.interp(5, TIME, STRAIN), STRAIN)
    (note,) = [n for n in check_plausible(made(stops, STRESS)) if "stands at" in n]
    assert float(re.search(r"from ([\d.]+) s", note)[1]) == pytest.approx(5, abs=0.2)
    # In a hold the stress relaxes, and an offset of it changes nothing.
    held = np.minimum(STRAIN, 0.2)
    for stress in (held * np.exp(-TIME / 10), held * np.exp(-TIME / 10) - 0.05):
        assert not any("stands at" in n for n in check_plausible(made(held, stress)))


def made(strain, stress):
    return softnn.Recording(TIME, strain, stress, name="a")


def test_dir_shows_the_public_names():
    assert dir(softnn) == sorted(softnn.__all__)
    assert all(hasattr(softnn, name) for name in dir(softnn))
    assert softnn.neural.StressNetwork


@pytest.mark.slow
def test_one_recording_a_list_and_a_folder_are_diagnosed_and_shown_in_short(lab):
    one, *_ = every = softnn.read(lab, **SIZES)
    seen = []
    found = softnn.diagnose(one, "hooke", progress=seen.append)
    assert found.case.recordings[0].name == "a"
    assert {p.stage for p in seen} == {"diagnosing"}
    assert all(0 <= p.share <= 1 for p in seen)
    # The error of the simulation comes before any search, then what leads so far.
    told = list(dict.fromkeys(p.so_far for p in seen if p.so_far))
    assert told[0].startswith("the simulation is")
    assert all(t.startswith(("with ", "the simulation is")) for t in told)
    first = next(p for p in seen if p.so_far)
    assert first.seconds < 0.5 * seen[-1].seconds
    for made in (one, found):
        assert len(repr(made)) < 1000
        assert "\n" not in repr(made)
        assert "<svg" in made._repr_html_()
    assert "'a'" in repr(one)
    assert found.summary in repr(found)
    assert len(softnn.diagnose(every, "hooke").case.recordings) == 2
    assert len(softnn.diagnose(lab, "hooke", **SIZES).case.recordings) == 2
    with pytest.raises(InputError, match=r"softnn\.read"):
        softnn.diagnose(one, "hooke", **SIZES)


def test_a_name_that_is_markup_is_shown_as_text():
    one = softnn.Recording(TIME, STRAIN, STRESS, name="<script>")
    assert "<script>" not in one._repr_html_()


def test_the_answer_so_far_is_a_line_of_its_own_and_said_once(capsys):
    shown = progress.Shown("mine")
    with progress.heard(shown):
        progress.so_far("the simulation is 9 % off")
        progress.part("one effect", 2)
        progress.so_far("the simulation is 9 % off")
        progress.so_far("with slack it is 2 % off")
    told = capsys.readouterr().err.splitlines()
    assert told == [
        "mine, so far: the simulation is 9 % off",
        "mine, so far: with slack it is 2 % off",
    ]


def test_a_listener_hears_stages_and_may_stop_the_run(tmp_path):
    class Stopped(Exception):
        pass

    def stop(now):
        raise Stopped

    with progress.heard(stop), pytest.raises(Stopped):
        progress.stage("reading")
    progress.stage("reading")  # nobody listens: nothing happens
    shown = progress.Shown("mine", quiet=True)
    shown(progress.Progress("diagnosing", 10, 3.0, 0.5, 42.0))
    assert re.match(r"mine: comparing models \[#{10}-{10}\] .*42 s left", shown.line())


def test_one_unit_of_time_is_advised_that_fits_all_files(tmp_path, capsys):
    """Minutes of a slow test look like seconds of a fast one; the fast one tells."""
    folder = tmp_path / "lab"
    for name, lasts in (("slow", 40.0), ("fast", 4.0), ("cycle", 24.0)):
        clock = TIME / TIME[-1] * lasts / 60
        written(folder / f"{name}.csv", "time,strain,stress", clock, STRAIN, STRESS)
    _, _, err = told(capsys, "diagnose", folder, "--out", tmp_path / "out")
    typed = shlex.split(re.search(r"Type: softnn (.*)", err)[1])
    assert [w for w in typed if w.partition("=")[0].endswith("time")] == ["time=min"]
    # No unit makes usual tests of an impact and of a test of a week: it is asked for.
    for name, lasts in (("slow", 6e5), ("fast", 1e-3)):
        clock = TIME / TIME[-1] * lasts
        written(folder / f"{name}.csv", "time,strain,stress", clock, STRAIN, STRESS)
    _, _, err = told(capsys, "diagnose", folder, "--out", tmp_path / "out")
    typed = shlex.split(re.search(r"Type: softnn (.*)", err)[1])
    assert [w for w in typed if w.partition("=")[0].endswith("time")] == ["time=UNIT"]


def test_read_ends_with_2_where_a_folder_holds_no_recording(lab, tmp_path, capsys):
    empty = tmp_path / "empty"
    for name, content in {"a.csv": b"", "b.csv": b"\x89PNG\x00\x01" * 99}.items():
        empty.mkdir(exist_ok=True)
        (empty / name).write_bytes(content)
    assert told(capsys, "read", empty)[0] == 2
    assert told(capsys, "read", lab, *WORDS)[0] == 0  # notes beside recordings
    assert told(capsys, "read", lab, empty, *WORDS)[0] == 2


def test_read_takes_sizes_from_the_table_of_the_folder(lab, capsys):
    (lab / "a (copy).csv").unlink()
    (lab / "specimens.csv").write_text("file,length_mm,area_mm2\na,25,18\nb,25,9\n")
    code, out, err = told(capsys, "read", lab)
    assert (code, out.count("length 25 mm, area")) == (0, 2), err
    assert "area 9 mm2" in out
    (lab / "specimens.csv").write_text("file,length_mm,area_mm2\na,25,18\nc,25,9\n")
    code, _, err = told(capsys, "read", lab)
    assert code == 2
    assert "names 'c'" in err


def test_read_advises_for_the_file_that_is_wrong_alone(tmp_path, capsys):
    for name, factor in (("slow", 1), ("fast", 100), ("cycle", 1)):
        written(tmp_path / f"{name}.csv", TIDY, TIME, factor * STRAIN, STRESS)
    _, out, _ = told(capsys, "read", tmp_path)
    assert out.count("odd:") == 1
    (advised,) = re.findall(r"\(--unit (\S+)\)", out)
    code, out, _ = told(capsys, "read", tmp_path, "--unit", advised)
    assert (code, out.count("odd:"), out.count("0 to 0.3983\n")) == (0, 0, 6)
    written(tmp_path / "fast.csv", TIDY, TIME, STRAIN, 3e4 * STRESS)
    _, out, _ = told(capsys, "read", tmp_path)
    assert "If it is right" not in out or "say --as-is to softnn diagnose" in out


def test_a_strain_read_in_per_cent_is_not_advised_to_be_in_per_cent(tmp_path, capsys):
    file = written(tmp_path / "a.csv", TIDY, TIME, 1000 * STRAIN, 2 * STRAIN)
    _, out, _ = told(capsys, "read", file, "--unit", "strain=%")
    (advised,) = re.findall(r"\(--unit (\S+)\)", out)
    code, out, _ = told(capsys, "read", file, "--unit", advised)
    assert (code, out.count("odd:"), out.count("0 to 0.3983\n")) == (0, 0, 2)


def test_read_says_which_units_act_on_nothing(tmp_path, capsys):
    written(tmp_path / "a.csv", TIDY, TIME, STRAIN, STRESS)
    for unit in ("Kraft=N", "zzz.csv:strain=%"):
        code, out, err = told(capsys, "read", tmp_path, "--unit", unit)
        assert (code, err.count("\n")) == (2, 1)
        assert unit.partition("=")[0] in err
        assert "rows" in out  # the file is shown all the same


def test_read_tells_of_no_tear_where_the_numbers_are_marks(tmp_path, capsys):
    load = np.where(np.isin(np.arange(len(TIME)), (60, 61, 62)), -999.0, STRESS)
    file = written(tmp_path / "a.csv", TIDY, TIME, STRAIN, load)
    _, out, _ = told(capsys, "read", file)
    assert "leave them out with --skip-bad-cells" in out
    assert "torn" not in out


@pytest.mark.filterwarnings("error")
def test_read_tells_of_a_clock_that_stands_without_a_warning(tmp_path, capsys):
    load = np.where(np.arange(len(TIME)) > 200, 0.0, STRESS)
    file = written(tmp_path / "a.csv", TIDY, 0 * TIME, STRAIN, load)
    code, out, err = told(capsys, "read", file)
    assert (code, err) == (0, "")
    assert "needs a clock that runs" in out


def test_options_that_act_on_nothing_are_told(lab, tmp_path, capsys):
    def of(folder, **given):
        return " | ".join(to_case(folder, **given).notes)

    said = of(lab, skip=["note.txt", "*copy*"], **SIZES)
    assert "--skip note.txt leaves nothing out" in said
    assert "did you mean 'notes.txt'" in said
    assert "--skip '*copy*'" not in said
    assert "--length, --area not used" not in said
    tidy = tmp_path / "tidy"
    written(tidy / "a.csv", TIDY, TIME, STRAIN, STRESS)
    assert "--length, --area not used: the files have strain and stress" in of(
        tidy, **SIZES
    )
    assert "--skip is for folders" in of([tidy / "a.csv"], skip=["b*"])
    # Beside files of a machine the sizes are used.
    written(tidy / "b.csv", HEADER, TIME, 0.8 * WAY, 0.8 * LOAD)
    assert "not used" not in of(tidy, **SIZES)
    (tidy / "index.csv").write_text("file\na.csv\n")
    assert "act on nothing here" in of(tidy, **SIZES)
    assert "act on nothing here" not in of(tidy)
    for words in (["--refit"], ["--card-unit", "kPa"]):
        code, _, err = told(capsys, "diagnose", tidy, "--out", tmp_path / "o", *words)
        assert (code, err.count("\n")) == (2, 1)
        assert "name one with --model CARD" in err
