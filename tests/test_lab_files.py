"""Files as labs have them: each way to write a pull gives that pull, or a question."""

import numpy as np
import pytest
from lab_made import (
    HEADER,
    LENGTH,
    LOAD,
    SIZES,
    STRAIN,
    STRESS,
    TIDY,
    TIME,
    WAY,
    N,
    clock,
    rows,
    texts,
    written,
)

import softnn
from softnn.contracts import InputError
from softnn.plausible import accidents, check_plausible
from softnn.readers import read

ROUNDED = 2e-4  # of times in ms and of cells in four digits


def notes(recording):
    return " | ".join(recording.log[0].arguments["notes"])


# -- clocks ----------------------------------------------------------------------------

NIGHT = 86390.0  # ten seconds before midnight
CLOCKS = {
    "hh:mm:ss": ("Time", clock(0, "%H:%M:%S.%f")),
    "over midnight": ("Time", clock(NIGHT, "%H:%M:%S.%f")),
    "twelve hours": ("Time", clock(43190.0, "%I:%M:%S.%f %p")),
    "mm:ss": ("Time", texts("00:%04.1f", TIME)),
    "ISO": ("Timestamp", clock(NIGHT, "%Y-%m-%dT%H:%M:%S.%f")),
    "ISO with a zone": ("Timestamp", clock(NIGHT, "%Y-%m-%d %H:%M:%S.%fZ")),
    "German": ("Zeitstempel", clock(NIGHT, "%d.%m.%Y %H:%M:%S.%f")),
    "American": ("Date Time", clock(NIGHT, "%m/%d/%Y %I:%M:%S.%f %p")),
    "a month by name": ("Date Time", clock(NIGHT, "%d-%b-%Y %H:%M:%S.%f")),
    "epoch in s": ("timestamp", texts("%.4f", 1709337590.25 + TIME)),
    "epoch in ms": ("timestamp", texts("%d", 1709337590250 + 1000 * TIME)),
    "epoch in ns": ("timestamp_ns", texts("%d", 1709337590 * 10**9 + 1e9 * TIME)),
    "days of a spreadsheet": ("Time", texts("%.9f", 45352.99 + TIME / 86400)),
    "days of MATLAB": ("Time", texts("%.9f", 738946.5 + TIME / 86400)),
    "min": ("Time (min)", texts("%.9f", TIME / 60)),
}


@pytest.mark.parametrize(("name", "cells"), CLOCKS.values(), ids=CLOCKS)
def test_a_clock_of_any_kind_is_seconds_since_the_first_row(name, cells, tmp_path):
    header = f"{name},Extension (mm),Load (N)"
    (one,) = read(written(tmp_path / "a.csv", header, cells, WAY, LOAD), **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-3)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)


def test_date_and_time_in_two_columns_and_decimal_commas(tmp_path):
    file = written(
        tmp_path / "a.csv", "Datum;Uhrzeit;Weg (mm);Kraft (N)",
        clock(NIGHT, "%d.%m.%Y"), clock(NIGHT, "%H:%M:%S,%f"),
        texts("%.5f", WAY, True), texts("%.5f", LOAD, True), delimiter=";",
    )  # fmt: skip
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-3)
    assert "midnight" in notes(one)


def test_cells_of_a_workbook_that_are_times(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    from datetime import datetime, timedelta

    begin = datetime(2024, 3, 1, 23, 59, 50)
    for make in (
        lambda t: begin + timedelta(seconds=t),
        lambda t: (begin + timedelta(seconds=t)).time(),
        lambda t: timedelta(seconds=t),
    ):
        book = openpyxl.Workbook()
        book.active.append(["Time", "Extension (mm)", "Load (N)"])
        for t, x, f in zip(TIME.tolist(), WAY.tolist(), LOAD.tolist(), strict=True):
            book.active.append([make(round(t, 3)), x, f])
        book.save(tmp_path / "a.xlsx")
        (one,) = read(tmp_path / "a.xlsx", **SIZES)
        np.testing.assert_allclose(one.time_s, TIME, atol=2e-3)


def test_minutes_or_hours_is_asked_and_the_answer_works(tmp_path):
    cells = [f"{int(t // 60):02d}:{int(t % 60):02d}" for t in 10 * TIME]
    file = written(tmp_path / "a.csv", "Time,Extension (mm),Load (N)", cells, WAY, LOAD)
    with pytest.raises(InputError, match="--unit 'Time=mm:ss' or --unit 'Time=hh:mm'"):
        read(file, **SIZES)
    for unit, seconds in (("mm:ss", 239.0), ("hh:mm", 60 * 239.0)):
        (one,) = read(file, units={"Time": unit}, **SIZES)
        assert one.time_s[-1] == pytest.approx(seconds, rel=0.01)


def test_whole_seconds_that_rows_share_are_spread_evenly(tmp_path):
    file = written(
        tmp_path / "a.csv", "Time,Extension (mm),Load (N)", clock(0, "%H:%M:%S"), WAY,
        LOAD,
    )  # fmt: skip
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-9)


# -- what strain is --------------------------------------------------------------------

RATIOS = {
    "stretch": ("Time (s),stretch,Stress (MPa)", 1 + STRAIN),
    "lambda": ("Time (s),lambda [-],Stress (MPa)", 1 + STRAIN),
    "Greek": ("Time (s),\u03bb,Stress (MPa)", 1 + STRAIN),
    "per cent": ("Time (s),Stretch ratio (%),Stress (MPa)", 100 + 100 * STRAIN),
    "German": ("Zeit (s),Dehnungsverh\u00e4ltnis,Spannung (MPa)", 1 + STRAIN),
}


@pytest.mark.parametrize(("header", "values"), RATIOS.values(), ids=RATIOS)
def test_a_stretch_ratio_is_no_strain(header, values, tmp_path):
    (one,) = read(written(tmp_path / "a.csv", header, TIME, values, STRESS))
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    assert "stretch ratio" in notes(one)


@pytest.mark.parametrize("header", ["Time (s),Strain (mm/mm),Stress (MPa)", TIDY])
def test_a_ratio_by_the_name_of_strain_is_met_and_the_advice_works(header, tmp_path):
    file = written(tmp_path / "a.csv", header, TIME, 1 + STRAIN, STRESS)
    (one,) = read(file)
    with pytest.raises(InputError, match=r"stretch ratio.*--unit strain=stretch"):
        check_plausible(one)
    (one,) = read(file, units={"strain": "stretch"})
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)


@pytest.mark.parametrize(
    "name", ["Height (mm)", "Sample height (mm)", "h [mm]", "Gap (mm)", "Length (mm)",
             "Grip separation (mm)", "Probenh\u00f6he [mm]"],
)  # fmt: skip
def test_the_height_of_a_specimen_is_its_length_and_its_change(name, tmp_path):
    height = LENGTH * (1 - STRAIN / 2)
    header = f"Time (s),{name},Force (N)"
    (one,) = read(written(tmp_path / "a.csv", header, TIME, height, -LOAD), area_mm2=18)
    np.testing.assert_allclose(one.strain, -STRAIN / 2, atol=1e-6)
    assert one.geometry.length_mm == pytest.approx(LENGTH)


def test_the_position_of_a_crosshead_counts_from_where_the_test_starts(tmp_path):
    for name in ("Extension (mm)", "Crosshead (mm)", "Position (mm)"):
        header = f"Time (s),{name},Load (N)"
        (one,) = read(
            written(tmp_path / "a.csv", header, TIME, 112 + WAY, LOAD), **SIZES
        )
        np.testing.assert_allclose(one.strain, STRAIN, atol=1e-5)
        assert notes(one)
    # Loaded from the first row on, it may be what the test is about.
    file = written(tmp_path / "b.csv", HEADER, TIME, 112 + WAY, LOAD + 5)
    (one,) = read(file, **SIZES)
    assert one.strain[0] == pytest.approx(112 / LENGTH)
    (one,) = read(file, zero=True, **SIZES)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-5)


@pytest.mark.parametrize("count", [1, 2])
def test_first_rows_left_from_before_are_left_out(count, tmp_path):
    way, load = WAY.copy(), LOAD.copy()
    way[:count], load[:count] = 5.2, 33.0
    (one,) = read(written(tmp_path / "a.csv", HEADER, TIME, way, load), **SIZES)
    np.testing.assert_allclose(one.strain, STRAIN[count:], atol=1e-6)
    assert "left out" in notes(one)


def test_a_step_of_strain_is_no_row_left_from_before(tmp_path):
    way, load = np.full(N, 5.0), 9 * np.exp(-TIME / 5)
    way[0], load[0] = 0.0, 0.0
    (one,) = read(written(tmp_path / "a.csv", HEADER, TIME, way, load), **SIZES)
    assert len(one) == N
    assert one.strain[0] == 0


# -- what cells and rows are -----------------------------------------------------------


def machine(tmp_path, after="", header=HEADER, last=N):
    file = written(tmp_path / "a.csv", header, TIME[:last], WAY[:last], LOAD[:last],
                   after=after)  # fmt: skip
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    return one


@pytest.mark.parametrize(
    ("after", "told"),
    [
        ("END OF TEST\n", ""),
        ("END\nMaximum,9.9,5.3\nMean,1,2\n", "Maximum"),
        (
            "Break,,\nModulus (MPa),0.91,\nStrength,0.31,\nA,1,2\nB,1,2\nC,1,2\n",
            "Break",
        ),
    ],
)
def test_marks_and_sums_below_the_data_are_passed_over(after, told, tmp_path):
    assert told in notes(machine(tmp_path, after))


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("*** operator paused ***\n", "paused"),
        ("\nTime (s),Extension (mm),Load (N)\n", "names repeated"),
    ],
)
def test_lines_between_the_rows_are_passed_over_and_named(line, told, tmp_path):
    assert told in notes(machine(tmp_path, line + rows(100, N), last=100))


def test_a_delimiter_within_the_names(tmp_path):
    machine(tmp_path, header="Time, s, Extension, mm, Load, N")


@pytest.mark.parametrize("dash", ["\u2212", "\u2013", "\uff0d"])
def test_minus_signs_of_word_processors(dash, tmp_path):
    way, load = ([v.replace("-", dash) for v in texts("%.6f", -x)] for x in (WAY, LOAD))
    (one,) = read(written(tmp_path / "a.csv", HEADER, TIME, way, load), **SIZES)
    np.testing.assert_allclose(one.stress_MPa, -STRESS, atol=1e-6)


@pytest.mark.parametrize("mark", ["'", "\u2019", "\u00a0", "\u202f"])
def test_thousands_parted_by_what_is_no_decimal_mark(mark, tmp_path):
    way = [f"{1e6 * v:,.1f}".replace(",", mark) for v in WAY]
    header = "Time (s);Extension (nm);Load (N)"
    file = written(tmp_path / "a.csv", header, TIME, way, LOAD, delimiter=";")
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)


def test_cells_that_are_no_numbers_are_skipped_only_where_they_are_few(tmp_path):
    load = texts("%.6f", LOAD)
    load[7] = "OL"
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, load)
    with pytest.raises(InputError, match="--skip-bad-cells"):
        read(file, **SIZES)
    (one,) = read(file, skip_bad_cells=True, **SIZES)
    assert np.isnan(one.stress_MPa).sum() == 1
    load[60:160] = ["OL"] * 100
    file = written(tmp_path / "b.csv", HEADER, TIME, WAY, load)
    for skip in (True, False):
        with pytest.raises(InputError, match="100 more of 240 cells") as error:
            read(file, skip_bad_cells=skip, **SIZES)
        assert "--skip" not in str(error.value)


def test_cells_missing_at_the_end_matter_only_where_they_are_needed(tmp_path):
    lines = [f"{t:.6g},{x:.6g},{f:.6g},{i}" for i, (t, x, f) in
             enumerate(zip(TIME, WAY, LOAD, strict=True))]  # fmt: skip
    lines[5] = lines[5].rpartition(",")[0]
    file = tmp_path / "a.csv"
    file.write_text("\n".join(["Time (s),Extension (mm),Load (N),Index", *lines]))
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    # A cell lost within the row moves the index under the load.
    cells = lines[200].split(",")
    lines[200] = ",".join([cells[0], cells[1], cells[3]])
    file.write_text("\n".join(["Time (s),Extension (mm),Load (N),Index", *lines]))
    with pytest.raises(InputError, match="3 values under 4 column names"):
        read(file, **SIZES)


# -- all that lacks at once ------------------------------------------------------------


def test_units_and_sizes_that_lack_are_asked_for_at_once_and_the_answer_works(tmp_path):
    file = written(tmp_path / "a.csv", "Time,Extension,Load", TIME, WAY, LOAD)
    with pytest.raises(InputError) as error:
        read(file)
    for word in ("'Time=s'", "'Extension=mm'", "'Load=N'", "--length", "--area"):
        assert word in str(error.value)
    units = {"Time": "s", "Extension": "mm", "Load": "N"}
    (one,) = read(file, units=units, **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


def test_python_is_told_of_arguments(tmp_path):
    file = written(tmp_path / "a.csv", "Time,Extension (mm),Load (N)", TIME, WAY, LOAD)
    with pytest.raises(InputError, match=r"units=\{'Time': 's'\}.*length_mm") as error:
        softnn.read(file)
    assert "--" not in str(error.value)
    with pytest.raises(InputError, match="'length_mm'"):
        softnn.read(file, length=3)


# -- accidents -------------------------------------------------------------------------


def recording(stress, strain=STRAIN, time=TIME):
    return softnn.Recording(time, strain, stress, name="mine")


NOISE = 0.0005 * np.random.default_rng(1).standard_normal(N)


def test_after_a_tear_the_stress_is_not_used():
    for at in (60, 100, 200):
        pull = np.linspace(0, 0.5, N)
        stress = np.where(np.arange(N) < at, pull - pull**2 / 2, 0.0) + NOISE
        kept, (note,) = accidents(recording(stress, pull))
        assert "torn" in note
        used = np.flatnonzero(np.isfinite(kept.stress_MPa))
        assert at - 0.02 * N < used[-1] < at


def test_slack_and_a_set_are_no_tear():
    """A band that hangs loose, one that stays longer, and one that is whole."""
    loose = np.maximum(STRAIN - 0.15, 0) + NOISE
    back = np.arange(N) > N // 2
    longer = np.where(back, np.maximum(2 * STRAIN - 0.4, 0), STRAIN) + NOISE
    for stress in (loose, longer, STRESS):
        assert accidents(recording(stress))[1] == []


@pytest.mark.parametrize(
    "strain", [0 * TIME, 0 * TIME + 0.1, 0.2 + 1e-4 * TIME,
               1e-5 * np.random.default_rng(0).standard_normal(N)],
)  # fmt: skip
def test_a_strain_that_never_moves_is_refused(strain):
    with pytest.raises(InputError, match=r"stands|noise"):
        check_plausible(recording(STRESS, strain))


def test_stiff_tissue_is_a_remark_and_rubber_in_kPa_is_not():
    (note,) = check_plausible(recording(420 * STRAIN / 10 + NOISE, STRAIN / 10))
    assert "tendon" in note
    with pytest.raises(InputError, match="--unit stress=kPa"):
        check_plausible(recording(1000 * STRESS))
    with pytest.raises(InputError, match="2000"):
        check_plausible(recording(2e5 * STRAIN / 100 + NOISE, STRAIN / 100))


def test_few_samples_are_judged_too():
    few = slice(None, None, 22)
    with pytest.raises(InputError, match="--flip strain"):
        check_plausible(recording(STRESS[few], -STRAIN[few], TIME[few]))


def test_the_advice_for_a_wrong_sign_works(tmp_path):
    file = written(tmp_path / "a.csv", TIDY, TIME, -STRAIN, STRESS)
    (one,) = read(file, flip="strain")
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    assert check_plausible(one) == []


def test_columns_swapped_on_a_first_loading_are_noted():
    pull = np.linspace(0, 0.5, N)
    stress = (1 + pull - (1 + pull) ** -2) / 3 + NOISE
    assert any("swapped" in n for n in check_plausible(recording(pull, stress)))
    assert check_plausible(recording(stress, pull)) == []


def test_whole_numbers_far_apart_may_be_ms(tmp_path):
    file = written(tmp_path / "a.csv", TIDY, np.round(20 * TIME) * 5, STRAIN, STRESS)
    (one,) = read(file)
    assert any("--unit time=ms" in n for n in check_plausible(one))
    (one,) = read(file, units={"time": "ms"})
    np.testing.assert_allclose(one.time_s, np.round(20 * TIME) / 200, atol=1e-9)
