"""An ordinary folder: right units, right zero, or a question whose answer works.

The recordings are those of `docs/own.md`: three of a rubber that softens, to a strain
of 0.4 and a stress of 0.6 MPa. Each test changes what a lab may have changed.
"""

from __future__ import annotations

import re
import shlex

import numpy as np
import pytest
from lab_made import SIZES, STRAIN, STRESS, TIME, written

import softnn
from softnn.contracts import InputError
from softnn.mismatch.api import to_case
from softnn.mismatch.batch import Job, diagnose_one
from softnn.plausible import check_plausible
from softnn.readers import ReadOptions, read
from softnn.readers.arguments import add_options, options_of
from softnn.readers.lacking import Lacking

PROGRAMMES = {
    "slow": ([0, 0.4, 0], 0.02),
    "fast": ([0, 0.4, 0], 0.2),
    "cycles": ([0, 0.2, 0, 0.4, 0], 0.05),
}
TIDY = "time_s,strain,stress_MPa"


def made():
    rng = np.random.default_rng(7)
    for name, (levels, rate) in PROGRAMMES.items():
        corners = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)) / rate)])
        time = np.linspace(0, corners[-1], 200)
        strain = np.interp(time, corners, levels)
        reached = np.maximum.accumulate(strain)
        softer = np.where(
            strain < reached, 1 - 0.4 * (1 - strain / (reached + 1e-9)), 1
        )
        yield (
            name,
            time,
            strain,
            1.5 * strain * softer + 0.002 * rng.standard_normal(200),
        )


def folder(path, header=TIDY, change=lambda name, t, e, s: (t, e, s)):
    for name, *columns in made():
        written(path / f"{name}.csv", header, *change(name, *columns))
    return path


def right(case, atol=1e-5):
    """Whether all recordings have the strain and stress that were made."""
    found = {r.name: r for r in case.recordings}
    for name, time, strain, stress in made():
        np.testing.assert_allclose(found[name].time_s, time, atol=1e-3)
        np.testing.assert_allclose(found[name].strain, strain, atol=atol)
        np.testing.assert_allclose(found[name].stress_MPa, stress, atol=max(atol, 1e-5))


def typed(message):
    """The reading options of the command that a message tells to type."""
    import argparse

    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    add_options(parser)
    words = shlex.split(message.rpartition("Type: ")[2].partition(". Sizes")[0])
    return options_of(parser.parse_args(words))


def asked(path, **given):
    """The message of `softnn diagnose` where facts lack."""
    job = Job(path, path / "out", options=ReadOptions(**given))
    return diagnose_one(job).line


# -- units of one file -----------------------------------------------------------------

OTHER = {
    "per cent": (lambda e, s: (100 * e, s), {"fast.csv:strain": "%"}),
    "kPa": (lambda e, s: (e, 1000 * s), {"fast.csv:stress": "kPa"}),
    "small strain in per cent": (
        lambda e, s: (100 * e / 20, s / 20),
        {"fast.csv:strain": "%"},
    ),
}


@pytest.mark.parametrize(
    ("change", "units"), list(OTHER.values())[:2], ids=["%", "kPa"]
)
def test_one_file_in_other_units_is_mended_by_the_advice(change, units, tmp_path):
    folder(
        tmp_path,
        change=lambda n, t, e, s: (t, *(change(e, s) if n == "fast" else (e, s))),
    )
    with pytest.raises(InputError, match=re.escape("--unit fast.csv:")) as error:
        to_case(tmp_path)
    ((key, unit),) = units.items()
    assert f"--unit {key}={unit}" in str(error.value)
    right(to_case(tmp_path, units=units))


def test_a_thousandfold_stiffness_beside_others_is_a_question(tmp_path):
    """30 kPa over a strain of 0.02: in MPa a plastic, by itself not impossible."""
    small = lambda n, t, e, s: (t, e / 20, s / 20 * (1000 if n == "slow" else 1))  # noqa: E731
    folder(tmp_path, change=small)
    with pytest.raises(
        InputError, match=r"times that of the other.*slow.csv:stress=kPa"
    ):
        to_case(tmp_path)
    case = to_case(tmp_path, units={"slow.csv:stress": "kPa"})
    assert {round(float(np.ptp(r.stress_MPa)), 2) for r in case.recordings} == {0.03}


def test_a_strain_a_hundredfold_of_the_others_is_a_question(tmp_path):
    small = lambda n, t, e, s: (t, e / 20 * (100 if n == "slow" else 1), s / 20)  # noqa: E731
    folder(tmp_path, change=small)
    with pytest.raises(InputError, match=r"slow.csv:strain=%"):
        to_case(tmp_path)
    case = to_case(tmp_path, units={"slow.csv:strain": "%"})
    assert max(r.strain.max() for r in case.recordings) == pytest.approx(0.02, rel=0.01)


def test_all_files_alike_are_advised_together(tmp_path):
    folder(tmp_path, change=lambda n, t, e, s: (t, 100 * e, s))
    with pytest.raises(InputError, match=r"--unit strain=%"):
        to_case(tmp_path)
    right(to_case(tmp_path, units={"strain": "%"}))


def test_python_is_told_the_argument_of_one_file(tmp_path):
    folder(tmp_path, change=lambda n, t, e, s: (t, e * (100 if n == "fast" else 1), s))
    with pytest.raises(InputError, match=re.escape("units={'fast.csv:strain': '%'}")):
        softnn.diagnose(tmp_path)


def test_a_sign_of_one_file_is_turned_there(tmp_path):
    folder(tmp_path, change=lambda n, t, e, s: (t, e, -s if n == "slow" else s))
    with pytest.raises(
        InputError, match=r"--flip slow.csv:strain or --flip slow.csv:str"
    ):
        to_case(tmp_path)
    right(to_case(tmp_path, flip="slow.csv:stress"))


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ({"Stres": "kPa"}, "acts on nothing"),
        (
            {"fats.csv:stress": "kPa"},
            r"no file 'fats.csv' here \(did you mean 'fast.csv'",
        ),
        ({"force": "N"}, "acts on nothing"),
    ],
)
def test_a_unit_of_what_is_not_there_is_refused(units, said, tmp_path):
    with pytest.raises(InputError, match=said):
        to_case(folder(tmp_path), units=units)


def test_a_unit_of_stress_acts_on_nothing_where_stress_is_force_over_section(tmp_path):
    file = written(
        tmp_path / "a.csv", "Time (s),Extension (mm),Load (N)", TIME, 25 * STRAIN,
        18 * STRESS,
    )  # fmt: skip
    with pytest.raises(InputError, match=r"acts on nothing.*'Load \[N\]'"):
        to_case(file, units={"stress": "kPa"}, **SIZES)


# -- units that nobody wrote -----------------------------------------------------------

BARE = "time,strain,stress"
GUESSED = {
    "usual": (1, 1, 1, {"strain": "mm/mm", "stress": "MPa", "time": "s"}),
    "per cent": (1, 100, 1, {"strain": "%", "stress": "MPa", "time": "s"}),
    "kPa": (1, 1, 1000, {"strain": "mm/mm", "stress": "kPa", "time": "s"}),
    "per cent and kPa": (1, 100, 1000, {"strain": "%", "stress": "kPa", "time": "s"}),
}


@pytest.mark.parametrize(("t", "e", "s", "units"), GUESSED.values(), ids=GUESSED)
def test_the_printed_command_has_units_that_give_the_recording(
    t, e, s, units, tmp_path
):
    folder(tmp_path, BARE, lambda n, *c: (t * c[0], e * c[1], s * c[2]))
    options = typed(asked(tmp_path))
    assert options.units == units
    right(to_case(tmp_path, options=options))


def test_one_file_in_per_cent_without_units_has_its_own_in_the_command(tmp_path):
    folder(tmp_path, BARE, lambda n, t, e, s: (t, e * (100 if n == "fast" else 1), s))
    options = typed(asked(tmp_path))
    assert options.units["strain"] == "mm/mm"
    assert options.units["fast.csv:strain"] == "%"
    right(to_case(tmp_path, options=options))


def test_a_clock_in_ms_is_not_called_seconds(tmp_path):
    folder(tmp_path, BARE, lambda n, t, e, s: (1000 * t, e, s))
    line = asked(tmp_path)
    assert "time=s" not in line.rpartition("Type: ")[2]
    assert "11.1 h in s or 40 s in ms" in line
    right(to_case(tmp_path, units={"time": "ms", "strain": "mm/mm", "stress": "MPa"}))


def test_a_column_that_may_be_either_is_left_open(tmp_path):
    folder(tmp_path, "Time (s),Strain,Stress (MPa)", lambda n, t, e, s: (t, 5 * e, s))
    with pytest.raises(Lacking, match=r"199 % in mm/mm or 1.99 % in %"):
        to_case(tmp_path)


def test_a_strain_taken_as_a_fraction_is_said_so(tmp_path):
    case = to_case(folder(tmp_path, "Time (s),Strain,Stress (MPa)"))
    assert any("taken as a fraction, up to 39.8 %" in n for n in case.notes)
    right(case)


def test_a_column_without_unit_in_one_file_of_three_keeps_that_of_the_others(tmp_path):
    folder(
        tmp_path, "Time (s),Strain (%),Stress (MPa)", lambda n, t, e, s: (t, 100 * e, s)
    )
    (_, t, e, s), *_ = made()
    written(tmp_path / "slow.csv", "Time (s),Strain,Stress", t, e, s)
    options = typed(asked(tmp_path))
    assert set(options.units) == {"slow.csv:Strain", "slow.csv:Stress"}
    right(to_case(tmp_path, options=options))


# -- zeros -----------------------------------------------------------------------------


def test_a_load_cell_not_zeroed_in_all_files_is_a_question(tmp_path):
    folder(tmp_path, change=lambda n, t, e, s: (t, e, s + 0.15))
    with pytest.raises(InputError, match=r"0.15 MPa in all 3 .* --zero-stress"):
        to_case(tmp_path)
    case = to_case(tmp_path, zero_stress=True)
    right(case, atol=0.008)  # four times the noise of the first sample
    assert sum("taken off" in n for n in case.notes) == 3
    assert to_case(tmp_path, as_is=True).recordings[0].stress_MPa[0] > 0.14


def test_a_preload_or_one_offset_of_three_is_no_question(tmp_path):
    """They are for the diagnosis; a preload of a twentieth is usual."""
    folder(tmp_path / "a", change=lambda n, t, e, s: (t, e, s + 0.03))
    assert len(to_case(tmp_path / "a").recordings) == 3
    folder(tmp_path / "b", change=lambda n, t, e, s: (t, e, s + 0.15 * (n == "slow")))
    notes = to_case(tmp_path / "b").notes
    assert [n[:4] for n in notes if "no strain" in n] == ["slow"]


def test_force_is_zeroed_too(tmp_path):
    file = written(
        tmp_path / "a.csv", "Time (s),Extension (mm),Load (N)", TIME, 25 * STRAIN,
        18 * STRESS + 5,
    )  # fmt: skip
    (one,) = read(file, zero_stress=True, **SIZES)
    assert one.force_N[0] == pytest.approx(0, abs=0.05)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=0.005)


@pytest.mark.parametrize(
    "name",
    ["Actuator position", "Crosshead position", "Axial Displacement", "Position"],
)
def test_a_position_with_a_preload_counts_from_its_start(name, tmp_path):
    """1.5 N of 8.1 N at 17.5 mm, on 20 mm: a strain from 0 to 0.3, not from 0.875."""
    way, load = 17.5 + 20 * 0.3 * STRAIN / 0.4, 1.5 + 6.6 * STRAIN / 0.4
    file = written(
        tmp_path / "a.csv", f"Time (s),{name} (mm),Force (N)", TIME, way, load
    )
    (one,) = read(file, length_mm=20, area_mm2=10)
    assert one.strain.min() == pytest.approx(0, abs=1e-6)
    assert one.strain.max() == pytest.approx(0.3 * STRAIN.max() / 0.4, abs=1e-6)


def test_a_test_that_goes_on_loaded_keeps_its_travel(tmp_path):
    """Travel from 5 mm on, with the load that belongs there, is no position."""
    way, load = 5 + 25 * STRAIN, 5 + 25 * STRAIN
    file = written(
        tmp_path / "a.csv", "Time (s),Extension (mm),Force (N)", TIME, way, load
    )
    (one,) = read(file, length_mm=25, area_mm2=10)
    assert one.strain[0] == pytest.approx(0.2)


def test_a_long_hold_draws_no_false_note(tmp_path):
    """A ramp of 4 s and a hold of half an hour, 10 Hz."""
    time = np.arange(0, 1800, 0.1)
    strain = np.minimum(0.25 * time, 1.0)
    stress = 0.3 * strain * (0.6 + 0.4 * np.exp(-time / 60))
    stress += 0.0005 * np.random.default_rng(0).standard_normal(len(time))
    file = written(tmp_path / "hold.csv", TIDY, time, strain, stress)
    assert [n for n in to_case(file).notes if "no strain" in n or "ms" in n] == []


# -- sizes -----------------------------------------------------------------------------


def test_sizes_that_contradict_each_other_are_refused(tmp_path):
    with pytest.raises(
        InputError, match="area 36 mm2, width 6 mm times thickness 3 mm"
    ):
        ReadOptions(area_mm2=36, width_mm=6, thickness_mm=3)
    assert ReadOptions(area_mm2=18, width_mm=6, thickness_mm=3).geometry.area == 18
    written(
        tmp_path / "a.csv", "Time (s),Extension (mm),Load (N)", TIME, STRAIN, STRESS
    )
    (tmp_path / "specimens.csv").write_text(
        "file,length_mm,width_mm,thickness_mm,area_mm2\na.csv,25,6,3,36\n"
    )
    with pytest.raises(
        InputError, match=r"specimens.csv, row 2: the sizes of this row"
    ):
        to_case(tmp_path)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"length_mm": 25, "area_mm2": 0.18}, r"section of 0.18 mm2.*--area"),
        ({"length_mm": 0.1, "area_mm2": 18}, r"over a length of 0.1 mm.*--length"),
    ],
)
def test_a_wrong_size_is_the_cause_that_is_named(given, said, tmp_path):
    load = 18 * 5 * STRAIN
    file = written(
        tmp_path / "a.csv", "Time (s),Extension (mm),Load (N)", TIME, 25 * STRAIN, load
    )
    with pytest.raises(InputError, match=said) as error:
        to_case(file, **given)
    assert "--unit" not in str(error.value)


def test_a_specimen_cannot_be_shorter_than_nothing(tmp_path):
    """A gap that closes by more than the length is impossible; a column may be log."""
    way, load = -3 * 25 * STRAIN, -18 * STRESS
    header = "Time (s),Extension (mm),Load (N)"
    file = written(tmp_path / "a.csv", header, TIME, way, load)
    with pytest.raises(InputError, match=r"goes down to -1\.195.*--length"):
        to_case(file, **SIZES)
    file = written(tmp_path / "b.csv", TIDY, TIME, -3 * STRAIN, -STRESS)
    assert any("goes down to -1.195" in n for n in to_case(file).notes)


def test_a_pull_to_failure_beside_small_cycles_is_in_no_other_unit(tmp_path):
    """A film that yields: 0.02 in cycles, 1.3 at failure, and the same modulus."""
    law = lambda e: 100 * e / (1 + e / 0.02)  # noqa: E731
    for name, top in (("a", 0.02), ("b", 0.02), ("pull", 1.3)):
        strain = top * TIME / TIME[-1]
        written(tmp_path / f"{name}.csv", TIDY, TIME, strain, law(strain))
    assert len(to_case(tmp_path).recordings) == 2  # a and b are one


# -- columns, marks and names ----------------------------------------------------------


def test_the_header_says_which_axis_is_loaded(tmp_path):
    head = "Time (s);Position (z) (mm);Fx (N);Fy (N);Fz (N)"
    columns = (
        TIME,
        10 + 25 * STRAIN,
        0.01 * TIME % 0.02,
        0.02 * TIME % 0.03,
        18 * STRESS,
    )
    file = written(
        tmp_path / "a.csv", f"Load Cell Axis:;Fz\n{head}", *columns, delimiter=";"
    )
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    file = written(tmp_path / "b.csv", head, *columns, delimiter=";")
    with pytest.raises(InputError, match=r"forces of 3 directions.*--force Fz"):
        read(file, **SIZES)
    (one,) = read(file, force="Fz", **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


def german(value):
    """A number with a comma, and points between its thousands."""
    return f"{value:,.1f}".replace(",", " ").replace(".", ",").replace(" ", ".")


def test_points_between_thousands_beside_decimal_commas(tmp_path):
    load = [f"{round(v):,d}".replace(",", ".") for v in 5000 * STRAIN]
    file = written(
        tmp_path / "a.csv", "Zeit (s);Weg (mm);Kraft (N)", [german(t) for t in TIME],
        [german(v) for v in 25 * STRAIN], load, delimiter=";",
    )  # fmt: skip
    (one,) = read(file, length_mm=25, area_mm2=1000)
    assert one.force_N.max() == pytest.approx(round(5000 * STRAIN.max()))
    np.testing.assert_allclose(one.force_N, np.round(5000 * STRAIN))


def test_points_between_thousands_alone_are_a_question(tmp_path):
    load = [f"{round(v):,d}".replace(",", ".") for v in 5000 * STRAIN]
    file = written(
        tmp_path / "a.csv", "Time (s);Extension (mm);Force (N)", TIME.astype(int) + 0.0,
        [f"{round(10 * v)}" for v in 25 * STRAIN], load, delimiter=";",
    )  # fmt: skip
    with pytest.raises(InputError, match="part thousands"):
        read(file, length_mm=250, area_mm2=1000)
    (one,) = read(file, length_mm=250, area_mm2=1000, decimal=",")
    np.testing.assert_allclose(one.force_N, np.round(5000 * STRAIN))


@pytest.mark.parametrize(
    ("clock", "said"),
    [
        (["40.8", "40.9", "40.10", "40.11", "41.0", "41.1"], "leaves out zeros"),
        (["0", "3", "1", "4", "2", "5"], "split the file"),
    ],
)
def test_sorting_is_no_advice_where_it_would_scramble(clock, said, tmp_path):
    file = written(
        tmp_path / "a.csv", TIDY.replace("_", " "), clock, range(6), range(6)
    )
    units = {"time": "s", "strain": "%", "stress": "MPa"}
    with pytest.raises(InputError, match=said) as error:
        read(file, units=units | {"time s": "s", "stress MPa": "MPa"})
    assert "sort the rows" not in str(error.value)


def test_rows_out_of_order_are_to_be_sorted(tmp_path):
    order = np.random.default_rng(1).permutation(len(TIME))
    file = written(tmp_path / "a.csv", "Time (s),Strain (mm/mm),Stress (MPa)",
                   TIME[order], STRAIN[order], STRESS[order])  # fmt: skip
    with pytest.raises(InputError, match="sort the rows by time"):
        read(file)


@pytest.mark.parametrize("marker", ["<DATA>", "[Data]", "*** Raw data ***", "Results"])
def test_a_marker_of_the_format_is_no_specimen(marker, tmp_path):
    head = f"{marker}\nTime (s);Strain (mm/mm);Stress (MPa)"
    file = written(tmp_path / "a.csv", head, TIME, STRAIN, STRESS, delimiter=";")
    (one,) = read(file)
    assert one.specimen == ""


def test_a_title_above_all_files_is_no_specimen_and_a_specimen_is_one(tmp_path):
    for title, specimens in (
        ("Tensile test 2024", set()),
        ("Specimen 7", {"Specimen 7"}),
    ):
        place = tmp_path / title
        for k, scale in enumerate((1.0, 1.1)):
            head = f"{title}\nTime (s);Strain (mm/mm);Stress (MPa)"
            written(
                place / f"{k}.csv", head, TIME, STRAIN, scale * STRESS, delimiter=";"
            )
        case = to_case(place)
        assert set(case.specimen.values()) == specimens


def test_names_are_not_cut_at_a_point(tmp_path):
    for name in ("pull_0.1mm_s", "pull_0.5mm_s"):
        scale = float(name[5:8])
        written(tmp_path / f"{name}.csv", "Time (s),Strain (mm/mm),Stress (MPa)",
                TIME / scale, STRAIN, STRESS * (1 + scale / 10))  # fmt: skip
    (tmp_path / "case.toml").write_text(
        '[specimen]\npull_0.1mm_s = "A"\npull_0.5mm_s.csv = "B"\n'
    )
    case = to_case(tmp_path)
    assert [r.name for r in case.recordings] == ["pull_0.1mm_s", "pull_0.5mm_s"]
    assert case.specimen == {"pull_0.1mm_s": "A", "pull_0.5mm_s": "B"}


def test_a_unit_with_a_slash_after_a_word(tmp_path):
    file = written(tmp_path / "a.csv", "Zeit in s;Dehnung in %;Spannung in N/mm\u00b2",
                   TIME, 100 * STRAIN, STRESS, delimiter=";")  # fmt: skip
    (one,) = read(file)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    for name in ("Spannung in N/mm\u00b2", "Spannung", "Spannung [N/mm\u00b2]"):
        assert read(file, stress=name)[0].stress_MPa.max() == one.stress_MPa.max()


# -- sheets, rows and folders ----------------------------------------------------------


def workbook(path, sheets):
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, lines in sheets.items():
        sheet = book.create_sheet(name)
        for line in lines:
            sheet.append(line)
    book.save(path)
    return path


ROWS = [
    [float(v) for v in row] for row in np.column_stack((TIME, 100 * STRAIN, STRESS))
]
NAMES = ["Time (s)", "Strain (%)", "Stress (MPa)"]


@pytest.mark.parametrize("units", [False, True], ids=["in the name", "beside it"])
def test_channels_in_rows_are_turned(units, tmp_path):
    lines = [
        [*(name.rstrip(")").split(" (") if units else [name]), *column]
        for name, column in zip(NAMES, zip(*ROWS, strict=True), strict=True)
    ]
    (one,) = read(workbook(tmp_path / "a.xlsx", {"A": [["Sample", "7"], *lines]}))
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-9)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-9)


def test_a_sheet_with_other_names_is_named_and_can_be_had(tmp_path):
    twice = [[t, e, 1.1 * s] for t, e, s in ROWS]
    file = workbook(
        tmp_path / "a.xlsx", {"A": [NAMES, *ROWS], "B": [list("xyz"), *twice]}
    )
    (one,) = read(file)
    assert "(sheet 'B')" in " ".join(one.log[0].arguments["notes"])
    both = read(file, time="x", strain="y", stress="z",
                units={"x": "s", "y": "%", "z": "MPa"})  # fmt: skip
    assert [r.stress_MPa.max() / STRESS.max() for r in both] == pytest.approx([1, 1.1])


def test_a_sheet_without_names_does_not_lose_the_other(tmp_path):
    file = workbook(tmp_path / "a.xlsx", {"A": [NAMES, *ROWS], "B": ROWS})
    (one,) = read(file)
    assert "sheet 'B' is left out" in " ".join(one.log[0].arguments["notes"])


def test_a_quantity_a_sheet_is_refused_with_what_to_do(tmp_path):
    sheets = {n: [[n], *[[row[k]] for row in ROWS]] for k, n in enumerate(NAMES)}
    with pytest.raises(
        InputError, match="copy the columns of each test into one sheet"
    ):
        read(workbook(tmp_path / "a.xlsx", {k[:4]: v for k, v in sheets.items()}))


def test_a_sweep_says_what_would_be_read(tmp_path):
    f = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
    header = (
        "Time (s),Frequency (Hz),Strain (%),Stress (MPa),Storage modulus (MPa),"
        "Loss modulus (MPa)"
    )
    file = written(tmp_path / "a.csv", header, 10 * f, f, f, f, 1 + f, f)
    with pytest.raises(
        InputError, match=r"columns of time, strain and stress.*dynamic"
    ):
        read(file)


def test_an_archive_and_pictures_are_named(tmp_path):
    folder(tmp_path)
    for name in ("data.zip", "photo.png", "setup.jpg", "slow.png"):
        (tmp_path / name).write_bytes(b"x")
    notes = " ".join(to_case(tmp_path).notes)
    assert "data.zip: an archive, not read; unpack it" in notes
    assert "photo.png" in notes
    assert "setup.jpg" in notes
    assert "slow.png" not in notes  # the plot beside slow.csv
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "data.zip").write_bytes(b"x")
    with pytest.raises(InputError, match=r"data.zip: an archive"):
        to_case(alone)


def test_two_materials_in_one_folder_draw_a_word(tmp_path):
    folder(tmp_path)
    (tmp_path / "index.csv").write_text(
        "file,material\nslow.csv,EPDM\nfast.csv,silicone\ncycles.csv,EPDM\n"
    )
    assert any("2 materials (EPDM, silicone)" in n for n in to_case(tmp_path).notes)


# -- strain programmes from Python -----------------------------------------------------


def test_a_programme_needs_no_stress_and_warns_beyond_the_recordings():
    time = np.linspace(0, 20, 201)
    strain = 0.3 * (1 - np.abs(time / 10 - 1))
    recording = softnn.Recording(time, strain, 2 * strain, name="a")
    model = softnn.diagnose(recording, "hooke").model
    np.testing.assert_allclose(model.simulate([0, 1, 2], [0, 0.1, 0.2]), [0, 0.2, 0.4],
                               atol=1e-6)  # fmt: skip
    with pytest.warns(UserWarning, match="strain beyond 0 to 0.3, which the model was"):
        model.simulate([0, 1], [0, 30.0])
    with pytest.raises(InputError, match="strain is missing"):
        model.simulate(time)
    with pytest.raises(InputError, match="time must not go back"):
        model.simulate([1, 0], [0, 0.1])


# -- other causes that are named -------------------------------------------------------


def loaded(**change):
    columns = {"time": TIME, "strain": STRAIN, "stress": STRESS} | change
    return softnn.Recording(columns["time"], columns["strain"], columns["stress"])


NOISE = np.random.default_rng(0).standard_normal(len(TIME))
CAUSES = {
    "noise alone": (
        {"strain": 1e-5 * NOISE[::-1], "stress": 1e-4 * NOISE},
        "strain and stress are noise",
    ),
    "a load cell that is not connected": ({"stress": 1e-3 * NOISE}, "stress is noise"),
    "one wrong sample": (
        {"stress": np.where(np.arange(len(TIME)) == 50, 60.0, STRESS)},
        "60 MPa in one sample",
    ),
}


@pytest.mark.parametrize(("change", "said"), CAUSES.values(), ids=CAUSES)
def test_the_cause_is_named_not_a_unit(change, said):
    with pytest.raises(InputError, match=said) as error:
        check_plausible(loaded(**change))
    assert "--unit" not in str(error.value)


def test_a_fraction_under_per_cent_is_the_cause_that_is_noted(tmp_path):
    file = written(
        tmp_path / "a.csv", "Time (s),Strain (%),Stress (MPa)", TIME, STRAIN, 2 * STRESS
    )
    (note,) = [n for n in to_case(file).notes if "stiffness" in n]
    assert "is strain a fraction (--unit strain=mm/mm)" in note
    right_one = to_case(file, units={"strain": "mm/mm"}).recordings[0]
    np.testing.assert_allclose(right_one.strain, STRAIN, atol=1e-6)


def test_a_stretch_ratio_in_per_cent_is_mended_by_the_advice(tmp_path):
    header = "Time (s),Strain (%),Stress (MPa)"
    file = written(tmp_path / "a.csv", header, TIME, 100 * (1 + STRAIN), STRESS)
    with pytest.raises(InputError, match="say --zero"):
        to_case(file)
    one = to_case(file, zero=True).recordings[0]
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-5)


def test_a_column_that_is_there_twice_is_refused(tmp_path):
    file = written(tmp_path / "a.csv", "time_s,strain,strain,stress_MPa", TIME, STRAIN,
                   STRAIN, STRESS)  # fmt: skip
    with pytest.raises(InputError, match="'strain' is there twice"):
        read(file)
