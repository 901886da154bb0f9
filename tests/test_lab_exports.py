"""Exports of other countries, loggers and cameras: read right, or one line."""

import numpy as np
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
    N,
    rows,
    texts,
    written,
)

from softnn import progress
from softnn.cli import main
from softnn.contracts import InputError
from softnn.readers import read
from softnn.readers.folder import files_of


def same(file, **given):
    """The one recording of a file, which holds the pull."""
    (one,) = read(file, **given)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-3)
    np.testing.assert_allclose(one.strain, STRAIN, atol=2e-5)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=2e-5)
    return " | ".join(one.log[0].arguments["notes"])


def commas(*columns):
    return [texts("%.6f", c, True) for c in columns]


# -- code pages ------------------------------------------------------------------------

PAGES = {
    "Czech": ("cp1250", "\u010cas (s);Prodlou\u017een\u00ed (mm);S\u00edla (N)"),
    "Polish": ("cp1250", "Czas [s];Wyd\u0142u\u017cenie [mm];Si\u0142a [N]"),
    "Polish, ISO": ("iso8859-2", "Czas [s];Wyd\u0142u\u017cenie [mm];Si\u0142a [N]"),
    "Slovak": ("cp1250", "\u010cas [s];Pred\u013a\u017eenie [mm];Sila [N]"),
    "Hungarian": ("cp1250", "Id\u0151 [s];Elmozdul\u00e1s [mm];Er\u0151 [N]"),
    "Croatian": ("cp1250", "Vrijeme [s];Pomak [mm];Sila [N]"),
    "Turkish": ("cp1254", "Zaman (s);Uzama (mm);Kuvvet (N)"),
    "German, DOS": ("cp850", "Pr\u00fcfzeit (s);Verl\u00e4ngerung (mm);Kraft (N)"),
    "Russian": (
        "cp1251",
        "\u0412\u0440\u0435\u043c\u044f (\u0441);"
        "\u041f\u0435\u0440\u0435\u043c\u0435\u0449\u0435\u043d\u0438\u0435 "
        "(\u043c\u043c);\u041d\u0430\u0433\u0440\u0443\u0437\u043a\u0430 (\u041d)",
    ),
    "Russian, UTF-8": (
        "utf-8",
        "\u0412\u0440\u0435\u043c\u044f (\u0441);"
        "\u0423\u0434\u043b\u0438\u043d\u0435\u043d\u0438\u0435 (\u043c\u043c);"
        "\u0421\u0438\u043b\u0430 (\u043a\u041d)",
    ),
    "UTF-32": ("utf-32", HEADER.replace(",", ";")),
}


@pytest.mark.parametrize(("page", "header"), PAGES.values(), ids=PAGES)
def test_headings_in_the_code_page_of_their_country(page, header, tmp_path):
    load = LOAD / 1000 if "\u043a\u041d" in header else LOAD
    cells = [texts("%.9f", c, True) for c in (TIME, WAY, load)]
    file = tmp_path / "a.csv"
    written(file, header, *cells, delimiter=";", encoding=page)
    same(file, **SIZES)


# -- cells -----------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [" ", ""])
@pytest.mark.parametrize("header", ["Time,Extension,Load", HEADER])
def test_numbers_with_their_unit_behind_them(header, gap, tmp_path):
    cells = [texts(f"%.5f{gap}{unit}", c)
             for c, unit in ((TIME, "s"), (WAY, "mm"), (LOAD, "N"))]  # fmt: skip
    same(written(tmp_path / "a.csv", header, *cells), **SIZES)


@pytest.mark.parametrize("header", [TIDY, "Time (s),Strain,Stress (MPa)"])
def test_per_cent_in_the_cells(header, tmp_path):
    cells = texts("%.5f %%", 100 * STRAIN)
    same(written(tmp_path / "a.csv", header, TIME, cells, STRESS))


def test_the_unit_of_the_cells_counts_and_is_told(tmp_path):
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, texts("%.4f mN", 1e3 * LOAD))
    assert "the unit of the cells counts" in same(file, **SIZES)


def test_a_unit_that_changes_down_the_column_is_refused_in_its_place(tmp_path):
    load = [f"{v:.4f} N" if v >= 1 else f"{1000 * v:.2f} mN" for v in LOAD]
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, load)
    first = next(k for k, v in enumerate(LOAD) if v >= 1) + 2
    with pytest.raises(InputError, match="the whole column in one unit") as error:
        read(file, **SIZES)
    assert (error.value.row, error.value.column) == (first, "Load (N)")


def test_sizes_above_the_rows_are_no_column_with_units(tmp_path):
    lines = "Length;25 mm\nWidth;6 mm\nThickness;3 mm\n\n"
    header = lines + HEADER.replace(",", ";")
    same(written(tmp_path / "a.csv", header, TIME, WAY, LOAD, delimiter=";"))


def test_each_column_may_have_its_decimal_mark(tmp_path):
    header = HEADER.replace(",", ";")
    cells = texts("%.4f", TIME, True)
    file = written(tmp_path / "a.csv", header, cells, WAY, LOAD, delimiter=";")
    assert "each is read by its own" in same(file, **SIZES)
    # Where one column changes, the row is named.
    load = texts("%.4f", LOAD[:100]) + texts("%.4f", LOAD[100:], True)
    file = written(tmp_path / "b.csv", header, TIME, WAY, load, delimiter=";")
    with pytest.raises(InputError, match=r"column 'Load' from row 102 \('"):
        read(file, **SIZES)


def test_infinite_cells_are_skipped_as_others_are(tmp_path):
    load = texts("%.6f", LOAD)
    load[50:52] = "inf", "-Inf"
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, load)
    with pytest.raises(InputError, match=r"row 52.*--skip-bad-cells"):
        read(file, **SIZES)
    (one,) = read(file, skip_bad_cells=True, **SIZES)
    assert np.isnan(one.stress_MPa).sum() == 2


# -- columns ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "told", ["Position set (mm)", "Cmd Disp (mm)", "Ref Disp (mm)",
             "Displacement demand (mm)", "Reference displacement (mm)"],
)  # fmt: skip
def test_what_the_machine_was_told_is_not_what_it_measured(told, tmp_path):
    header = f"Time (s),{told},Displacement actual (mm),Force (N)"
    same(written(tmp_path / "a.csv", header, TIME, 1.2 * WAY, WAY, LOAD), **SIZES)
    # Alone it is all there is.
    header = f"Time (s),{told},Force (N)"
    same(written(tmp_path / "b.csv", header, TIME, WAY, LOAD), **SIZES)


def test_the_second_of_two_columns_of_one_name_has_one_of_its_own(tmp_path):
    header = "Time (s),Extension (mm),Load (N),Load (N)"
    file = written(tmp_path / "a.csv", header, TIME, WAY, 2 * LOAD, LOAD)
    (one,) = read(file, **SIZES)
    assert "not Load (2) [N]" in " ".join(one.log[0].arguments["notes"])
    same(file, force="Load (2)", **SIZES)


@pytest.mark.parametrize(
    ("across", "along"),
    [("Eng. strain xx (%)", "Eng. strain yy (%)"), ("Strain x (%)", "Strain y (%)"),
     ("exx (%)", "eyy (%)")],
)  # fmt: skip
def test_strains_of_two_directions_are_a_question(across, along, tmp_path):
    header = f"Time (s),{across},{along},Force (N)"
    file = written(tmp_path / "a.csv", header, TIME, -50 * STRAIN, 100 * STRAIN, LOAD)
    name = along.partition(" (")[0]
    with pytest.raises(InputError, match=f"2 directions.*--strain '?{name}"):
        read(file, area_mm2=18)
    same(file, strain=name, area_mm2=18)


def test_a_column_of_formulas_without_values_is_told(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(HEADER.split(","))
    for t, x, f in zip(TIME.tolist(), WAY.tolist(), LOAD.tolist(), strict=True):
        book.active.append([t, x, f"={f:.6f}*1"])
    book.save(tmp_path / "a.xlsx")
    with pytest.raises(InputError, match=r"'Load \[N\]' has no values.*save it"):
        read(tmp_path / "a.xlsx", **SIZES)


def test_hidden_sheets_are_left_out_and_told(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    old = book.create_sheet("old")
    old.sheet_state = "hidden"
    for sheet, factor in ((book.active, 1.0), (old, 2.0)):
        sheet.append(HEADER.split(","))
        for row in zip(TIME.tolist(), (factor * WAY).tolist(), LOAD.tolist(),
                       strict=True):  # fmt: skip
            sheet.append(row)
    book.save(tmp_path / "a.xlsx")
    assert "sheet 'old'" in same(tmp_path / "a.xlsx", **SIZES)


# -- rows ------------------------------------------------------------------------------


def test_a_last_row_that_a_remark_calls_a_mean(tmp_path):
    file = written(
        tmp_path / "a.csv", HEADER + ",Remark", TIME, WAY, LOAD, [""] * N,
        after="23.9,5.0,2.9,Mean\n24.0,2.0,1.1,Std\n",
    )  # fmt: skip
    assert "Mean" in same(file, **SIZES)


def test_rows_of_zeros_that_a_logger_had_reserved(tmp_path):
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, LOAD, after="0,0,0\n" * 20)
    assert "20 rows of zeros" in same(file, **SIZES)


def test_one_last_row_back_in_time_may_be_a_mean(tmp_path):
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, LOAD, after="11.9,5,2.9\n")
    with pytest.raises(InputError, match=r"row 242.*last row alone.*delete it"):
        read(file, **SIZES)


def test_channels_in_rows_are_turned_and_too_many_are_told(tmp_path):
    lines = [",".join([name, *texts("%.5f", c)]) for name, c in
             zip(HEADER.split(","), (TIME, WAY, LOAD), strict=True)]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    same(tmp_path / "a.csv", **SIZES)
    long = [line + ",1" * 1000 for line in lines]
    (tmp_path / "a.csv").write_text("\n".join(long) + "\n")
    with pytest.raises(InputError, match=r"columns; allowed are 1000.*Transpose"):
        read(tmp_path / "a.csv", **SIZES)


def test_a_line_of_underscores_below_the_names(tmp_path):
    file = tmp_path / "a.txt"
    names = "Time_s   Extension_mm   Load_N\n______   ____________   ______\n\n"
    file.write_text(names + rows(0, N).replace(",", "    "))
    same(file, **SIZES)


# -- files -----------------------------------------------------------------------------


@pytest.mark.parametrize("x", ["One", "No"])
def test_a_LabVIEW_file_with_units_in_its_header(x, tmp_path):
    head = (
        f"LabVIEW Measurement\t\nX_Columns\t{x}\n***End_of_Header***\t\n\t\t\t\n"
        "Channels\t2\t\t\nY_Unit_Label\tN\tmm\t\nX_Dimension\tTime\tTime\t\n"
        "Delta_X\t0,1\t0,1\t\n***End_of_Header***\t\t\t\n"
        "X_Value\tForce\tDisplacement\tComment"
    )
    time, load, way = commas(TIME, LOAD, WAY)
    if x == "No":
        time = [""] * N
    file = written(tmp_path / "a.lvm", head, time, load, way, [""] * N, delimiter="\t")
    same(file, **SIZES)
    assert files_of(tmp_path)[0] == [file]


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600)
         + "EncryptedPackage".encode("utf-16-le") + bytes(900), "password"),
        (b"<table><tr><td>Time</td></tr></table>", "web page"),
    ],
)  # fmt: skip
def test_files_of_other_kinds_say_which(raw, said, tmp_path):
    (tmp_path / "a.xls").write_bytes(raw)
    with pytest.raises(InputError, match=said):
        read(tmp_path / "a.xls", **SIZES)


def test_an_OpenDocument_table_says_how_to_save_it(tmp_path):
    import zipfile

    with zipfile.ZipFile(tmp_path / "a.ods", "w") as archive:
        archive.writestr("content.xml", "<x/>")
    with pytest.raises(InputError, match=r"OpenDocument.*\.xlsx or CSV"):
        read(tmp_path / "a.ods", **SIZES)


def test_no_file_is_written_over_by_what_is_read_from_it(tmp_path, capsys):
    file = written(tmp_path / "a.csv", HEADER, TIME, WAY, LOAD)
    before = file.read_bytes()
    assert main(["read", str(tmp_path), *WORDS, "--out", str(tmp_path)]) == 2
    assert "name another --out" in capsys.readouterr().err
    assert file.read_bytes() == before
    assert main(["read", str(tmp_path), *WORDS, "--out", str(tmp_path / "tidy")]) == 0


def test_links_to_nothing_are_named(tmp_path):
    written(tmp_path / "a.csv", HEADER, TIME, WAY, LOAD)
    (tmp_path / "gone.csv").symlink_to("nowhere")
    files, notes = files_of(tmp_path)
    assert [f.name for f in files] == ["a.csv"]
    assert notes == ["gone.csv: a link to nothing, not read"]


# -- how far a run is ------------------------------------------------------------------


def test_the_time_left_is_that_of_the_part_under_way(monkeypatch):
    now, heard = [100.0], []
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress.heard(heard.append):
        progress.stage("diagnosing")
        assert heard[-1].left_s is None
        progress.part("one effect", 4)
        now[0] = 110.0
        progress.piece(0.5)
        progress.piece()
        now[0] = 120.0
        progress.piece()
        now[0] = 130.0
        progress.step()
        assert heard[-1].share == pytest.approx(0.5)
        assert heard[-1].left_s == pytest.approx(30.0)  # two of four in 30 s
        progress.part("two effects", 0)
        now[0] = 140.0
        progress.step()
        assert heard[-1].left_s is None
    shown = progress.Shown("mine", quiet=True)
    shown(progress.Progress("diagnosing", 10, 3.0, 0.5, 42.0, part="one effect"))
    assert "comparing models, one effect [" in shown.line()
    assert "left of this part" in shown.line()
