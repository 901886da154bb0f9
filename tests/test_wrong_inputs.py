"""Wrong inputs: each met with one line and exit code 2, or a note for the report."""

import sys
from pathlib import Path

import numpy as np
import pytest

from softnn.cli import main
from softnn.contracts import InputError
from softnn.mismatch.api import to_case
from softnn.readers.tidy import read_folder

TIME = np.linspace(0, 30, 240)
STRAIN = 0.5 * (1 - np.abs(TIME / 15 - 1))


def rubber(time=TIME, strain=STRAIN):
    """A neo-Hookean rubber of 1 MPa with a branch of 5 s: s = G (l - l^-2), delayed."""
    stress = (1 + strain - (1 + strain) ** -2) / 3
    branch = np.zeros_like(stress)
    for i in range(1, len(time)):
        keep = np.exp(-(time[i] - time[i - 1]) / 5)
        branch[i] = keep * branch[i - 1] + 0.3 * (strain[i] - strain[i - 1])
    return stress + branch + 1e-4 * np.random.default_rng(0).standard_normal(len(time))


STRESS = rubber()
HEADER = "time_s,strain,stress_MPa"


def text(time=TIME, strain=STRAIN, stress=STRESS, header=HEADER):
    rows = np.column_stack([time, strain, stress])
    return "\n".join([header, *(",".join(f"{v:.7g}" for v in r) for r in rows), ""])


def rows(change):
    """The recording with its lines changed."""
    return "\n".join(change(text().splitlines())) + "\n"


def wide(factor):
    """A pull to a strain of `factor`, of a rubber."""
    return factor * STRAIN / STRAIN.max()


def holed(values, mark):
    """The values with a logger's mark in three places."""
    out = values.copy()
    out[[50, 100, 150]] = mark
    return out


def blank(values, count):
    """The values without some in the middle."""
    out = values.copy()
    out[60 : 60 + count] = np.nan
    return out


REFUSED = {
    "strain reversed": (text(strain=-STRAIN), "sign reversed"),
    "stress reversed": (text(stress=-STRESS), "sign reversed"),
    "columns swapped": (text(strain=STRESS, stress=STRAIN), "swapped"),
    "stress in kPa": (text(stress=1e3 * STRESS), "kPa"),
    "stress in Pa": (text(stress=1e6 * STRESS), "Pa"),
    "stress in GPa": (text(stress=1e-4 * STRESS), "GPa"),
    "strain of 50 per cent": (text(strain=100 * STRAIN), "per cent"),
    "a dead channel": (text(stress=0 * STRESS + 0.2), "channel connected"),
    "zero stress": (text(stress=0 * STRESS), "channel connected"),
    "a stress of next to nothing": (text(stress=1e-300 * STRESS), "channel connected"),
    "a clock that stands": (text(time=0 * TIME), "clock"),
    "time backwards": (text(time=TIME[::-1]), "goes backwards"),
    "text in a number": (rows(lambda r: [*r[:9], "1,x,2", *r[9:]]), "not a number"),
    "a decimal comma": (rows(lambda r: [r[0], *(x.replace(".", ",") for x in r[1:])]),
                        ""),
    "a missing column": (text(header="time_s,strain,stress"), "stress"),
    "no rows": (HEADER + "\n", "no rows"),
    "an empty file": ("", "empty"),
    "too many cells": (rows(lambda r: [*r[:9], "1,2,3,4", *r[9:]]), "4 values"),
    "a mark of missing values": (text(stress=holed(STRESS, -999.0)),
                                 "(rows 52, 102, 152), as loggers write"),
    "a mark near the values": (text(stress=holed(STRESS, -9.99)), "--skip-bad-cells"),
    "a mark beyond all sizes": (text(stress=holed(STRESS, 9999.0)),
                                "(rows 52, 102, 152), as loggers write"),
    "a mark in the strain": (text(strain=holed(STRAIN, -99.0)), "--skip-bad-cells"),
    "infinite stress": (rows(lambda r: [*r[:9], "0.6,0.1,inf", *r[10:]]), "inf"),
    "not text": (b"\x80\x04\x95pickle\x00\xff", ""),
}  # fmt: skip

NOTED = {
    "strain of 5 per cent": (text(strain=10 * STRAIN, stress=0.1 * STRAIN),
                             "per cent"),
    "strain of 9 per cent": (text(strain=wide(9.0)), "per cent"),
    "kPa of a gel": (text(stress=15 * STRESS), "kPa"),
    "milliseconds": (text(time=1e4 * TIME), "ms"),
    "hours": (text(time=TIME / 3600), "3600"),
    "most of the stress missing": (text(stress=blank(STRESS, 168)),
                                   "70 % of the stress is missing"),
    "a block of strain missing": (text(strain=blank(STRAIN, 24)),
                                  "10 % of the strain is missing"),
    "an offset": (text(stress=STRESS + 7), "offset"),
    "a component wired the other way": (
        text(stress=-30 * STRESS, strain=30 * STRAIN,
             header="time_s,elongation_mm,force_N"), "sign reversed"),
}  # fmt: skip


def refused(words, capsys):
    assert main([str(w) for w in words]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1, told
    return told


@pytest.mark.parametrize(("content", "said"), REFUSED.values(), ids=REFUSED)
def test_refused_in_one_line_with_the_file(content, said, tmp_path, capsys):
    file = tmp_path / "case" / "mine.csv"
    file.parent.mkdir()
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    told = refused(["diagnose", file.parent, "--out", tmp_path / "out"], capsys)
    assert said in told
    assert "mine" in told
    assert not list((tmp_path / "out").rglob("*.json"))


@pytest.mark.parametrize(("content", "said"), NOTED.values(), ids=NOTED)
def test_noted_for_the_report(content, said, tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text(content)
    assert any(said in note for note in to_case([file]).notes)
    assert to_case([file], as_is=True).notes == ()


def test_marks_of_missing_values_are_left_out_as_advised(tmp_path):
    file = tmp_path / "mine.csv"
    for mark in (-999.0, -9.99, 9999.0):
        file.write_text(text(stress=holed(STRESS, mark)))
        (one,) = to_case([file], skip_bad_cells=True).recordings
        assert np.flatnonzero(np.isnan(one.stress_MPa)).tolist() == [50, 100, 150]
    load = holed(18 * STRESS, -99.9)
    header = "Time (s),Extension (mm),Load (N)"
    file.write_text(text(strain=33 * STRAIN, stress=load, header=header))
    sizes = {"length_mm": 33.0, "area_mm2": 18.0}
    with pytest.raises(InputError, match=r"-5\.55 MPa.*\(at 6\.276 s.*--skip-bad"):
        to_case([file], **sizes)
    (one,) = to_case([file], **sizes, skip_bad_cells=True).recordings
    assert np.isnan(one.stress_MPa).sum() == 3


@pytest.mark.parametrize("unit", ["kPa", "Pa", "GPa"])
def test_a_simulation_in_another_unit_is_asked_about(unit, tmp_path):
    per_MPa = {"kPa": 1e3, "Pa": 1e6, "GPa": 1e-3}[unit]
    file = tmp_path / "mine.csv"
    table = np.column_stack([TIME, STRAIN, STRESS, 0.9 * per_MPa * STRESS])
    head = f"{HEADER},simulated_MPa"
    np.savetxt(file, table, delimiter=",", header=head, comments="")
    with pytest.raises(InputError, match=rf"simulation.*--unit simulated={unit}\b"):
        to_case([file])
    assert to_case([file], as_is=True).simulated_MPa is not None
    (made,) = to_case([file], units={"simulated": unit}).simulated_MPa
    np.testing.assert_allclose(made, 0.9 * STRESS, rtol=1e-6)


def test_a_case_toml_is_told_what_it_may_name(tmp_path, capsys):
    """A stored model is an option of the command, no key of the case."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "mine.CSV").write_text(text())
    (tmp_path / "case.toml").write_text('model = "model.json"\n')
    told = refused(["diagnose", tmp_path, "--out", tmp_path / "out"], capsys)
    assert "--model FILE" in told
    assert "or a model.json" not in told


def test_a_case_folder_is_read_by_all(tmp_path):
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "mine.CSV").write_text(text())
    (one,) = read_folder(tmp_path)
    assert one.name == "mine"


def test_the_recording_itself_is_neither(tmp_path):
    for strain in (STRAIN, wide(1.5), wide(5.0), -0.5 * STRAIN):
        stress = rubber(strain=strain)
        file = tmp_path / "mine.csv"
        file.write_text(text(strain=strain, stress=stress))
        assert to_case([file]).notes == ()


def test_studies_have_the_same_gate(tmp_path, capsys):
    from softnn.study.material_data import prepared
    from softnn.study.settings import Settings

    file = tmp_path / "mine.csv"
    file.write_text(text(strain=100 * STRAIN, stress=0.03 * STRESS))
    with pytest.raises(InputError, match=r"per cent.*--as-is"):
        prepared(Settings(data=str(file)))
    assert prepared(Settings(data=str(file), as_is=True, samples=30))
    file.write_text(text(stress=15 * STRESS))
    prepared(Settings(data=str(file), samples=30))
    assert "kPa" in capsys.readouterr().err


# -- exports of machines, corrupted in memory ------------------------------------------


def at(row, change):
    """The line that begins with `row`, changed."""

    def corrupt(raw: bytes) -> bytes:
        lines = raw.split(b"\n")
        i = next(i for i, line in enumerate(lines) if row in line)
        lines[i] = change(lines[i])
        return b"\n".join(lines)

    return corrupt


def twice(raw: bytes) -> bytes:
    """The second half of the rows pasted once more."""
    lines = raw.rstrip(b"\n").split(b"\n")
    return b"\n".join([*lines, *lines[len(lines) // 2 :]]) + b"\n"


LEAP = "instron_bluehill/leap-tension-1_1.csv"
TENDON = "instron_bluehill/tendon_fresh_relax_1.csv"
XLS = "ta_trios/double-compression-slowest-inplane-1.xls"
SIZES = ["--length", "16.52", "--area", "61.2"]
MACHINES = {
    "N that are kN": (LEAP, at(b"(N)", lambda x: x.replace(b"(N)", b"(kN)")), SIZES),
    "a unit nobody has": (LEAP, at(b"(N)", lambda x: x.replace(b"(N)", b"(furlong)")),
                          SIZES),
    "no sizes": (LEAP, lambda raw: raw, []),
    "rows pasted twice": (LEAP, twice, SIZES),
    "names of force and travel swapped": (
        LEAP, at(b"Force", lambda x: x.replace(b"Force", b"#").replace(
            b"Displacement", b"Force").replace(b"#", b"Displacement")), SIZES),
    "a diameter a hundred times as large": (
        TENDON, at(b"Diameter", lambda x: x.replace(b"0.39900", b"39.900")), []),
    "cut within a workbook": (XLS, lambda raw: raw[: len(raw) // 2],
                              ["--area", "50.3"]),
    "a web page called .xls": (XLS, lambda _: b"<html><body>Sign in</body></html>", []),
    "only the head": (LEAP, lambda raw: b"\n".join(raw.split(b"\n")[:6]), SIZES),
    "zero bytes in the middle": (
        LEAP, lambda raw: raw[:9000] + b"\x00" * 500 + raw[9500:], SIZES),
    "an area in m2": (
        LEAP, lambda raw: raw, ["--length", "16.52", "--area", "61.2e-6"]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "corrupt", "options"), MACHINES.values(), ids=MACHINES
)
def test_a_corrupted_export_is_refused(
    name, corrupt, options, data_folder, tmp_path, capsys
):
    original = data_folder / "machine-formats" / name
    if not original.is_file():
        pytest.skip("SOFTNN_DATA has no machine-formats")
    file = tmp_path / Path(name).name
    file.write_bytes(corrupt(original.read_bytes()))
    told = refused(["diagnose", file, "--out", tmp_path / "out", *options], capsys)
    assert file.stem in told


# Files as their machines wrote them, which hold no test of a soft material, or not all
# that one needs; `said` is what settles it.
AS_THEY_ARE = {
    "a row a cycle": ("instron_wavematrix/Test1.steps.trends.csv", [], "tracking.csv"),
    "a log": ("instron_wavematrix/Test1.log", [], "tracking.csv"),
    "a side-car": ("instron_wavematrix/Test6.specimen.txt", [], "tracking.csv"),
    "a wire of steel": ("walter_bai/Exemple_WB100kN_2_Tract_L100_D2.csv",
                        ["--length", "100", "--diameter", "2"], "--as-is"),
    "invar": ("zwick_tra/Invar_LT_05_01.TRA", [], "--as-is"),
    "a sweep of frequency": ("gabo_eplexor/freq_Eplexor_raw.xls", [], "static test"),
    "a clock that jumps": ("zwick_de/DX56_D_FZ2_WR00_43.TXT", [], "--interval"),
    "no length in a workbook": ("zwick_xlsx/Traction-10_cryo.XLSX", [], "--length"),
    "no sizes, both at once": ("shimadzu/Exemple_Shimadzu_Tract_L100_D2.csv", [],
                               "--area MM2, or --width MM and --thickness MM, or "
                               "--diameter MM; and --length MM"),
    "the wrong decimal mark": ("instron_bluehill_eu/Tensile_test_PE.csv",
                               ["--decimal", ".", *SIZES], "decimal point"),
    "no section": ("ta_trios/leap-comp-4.txt", [], "--area"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "options", "said"), AS_THEY_ARE.values(),
                         ids=AS_THEY_ARE)  # fmt: skip
def test_a_file_that_is_no_such_test_is_refused(
    name, options, said, data_folder, tmp_path, capsys
):
    file = data_folder / "machine-formats" / name
    if not file.is_file():
        pytest.skip("SOFTNN_DATA has no machine-formats")
    told = refused(["diagnose", file, "--out", tmp_path / "out", *options], capsys)
    assert said in told
    assert file.stem.split(".")[0] in told
    assert not list((tmp_path / "out").rglob("*.json"))


# -- the folder to write into ----------------------------------------------------------


def test_two_commands_on_one_out_are_told_apart(tmp_path, capsys):
    from softnn.mismatch import batch

    file = tmp_path / "mine.csv"
    file.write_text(text())
    with batch.alone(tmp_path / "out"):
        told = refused(
            ["diagnose", file, "--model", "hooke", "--out", tmp_path / "out"], capsys
        )
    assert "another process" in told
    assert "--out" in told


def test_a_shell_is_told_the_commands_and_the_options(tmp_path):
    """As bash asks, by the protocol of argcomplete."""
    import os
    import subprocess

    answers = tmp_path / "answers"
    for line, meant in (("softnn di", "diagnose"),
                        ("softnn diagnose --res", "--resume"),
                        ("softnn data show vhb4910-", "vhb4910-figures")):  # fmt: skip
        asked = {
            "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)),
            "_ARGCOMPLETE_STDOUT_FILENAME": str(answers), "_ARGCOMPLETE_IFS": "\n",
        }  # fmt: skip
        subprocess.run(
            [sys.executable, "-m", "softnn.cli"], env=os.environ | asked, timeout=120
        )
        assert meant in answers.read_text()
