"""Readers against one invented test written in every dialect, and against tidy files.

Each file in tests/reference holds the same test: 12 samples at 2 a second, elongation
0.2 i mm on 20 mm, force i + i^2 / 4 N on 5 mm x 2 mm; so one set of numbers is
expected of all of them, whatever their units, marks and languages.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from readers_made import (
    AREA,
    BOTH,
    LENGTH,
    REFERENCE,
    STRAIN,
    STRESS,
    TIME,
    assert_same,
    zwick_workbook,
)

from softnn import readers
from softnn.contracts import InputError
from softnn.readers import READERS, ReadOptions, read
from softnn.readers.source import Sheet, Source
from softnn.readers.tidy import read_tidy
from softnn.readers.units import convert, parse_unit

# file, what it does not say itself, dialect, sign of the stress
CASES = [
    ("bluehill_rawdata.csv", {}, "Instron Bluehill", 1),
    ("bluehill_results_first.csv", BOTH, "Instron Bluehill", 1),
    ("bluehill_us_units.csv", BOTH, "Instron Bluehill", 1),
    ("bluehill_german.csv", BOTH, "Instron Bluehill", 1),
    ("bluehill_chinese.csv", {}, "Instron Bluehill", 1),
    ("bluehill_compression.csv", BOTH, "Instron Bluehill", -1),
    ("wavematrix.steps.tracking.csv", LENGTH, "Instron WaveMatrix", 1),
    ("bluehill_italian.csv", {}, "Instron Bluehill", 1),
    ("wavematrix_linear.csv", BOTH, "Instron WaveMatrix", 1),
    ("walter_bai_plain.csv", BOTH, "Walter+Bai Dion", 1),
    ("trios_shear.txt", {}, "TA TRIOS", 1),
    ("generic_chinese.csv", {}, "delimited table", 1),
    ("mts_timed.txt", AREA, "MTS TestSuite", 1),
    ("mts_793.txt", BOTH, "MTS TestSuite", 1),
    ("zwick_french.TRA", {}, "Zwick testXpert", 1),
    ("zwick_german.TXT", {}, "Zwick testXpert", 1),
    ("zwick_english.TRA", {}, "Zwick testXpert", 1),
    ("shimadzu_single.csv", BOTH, "Shimadzu Trapezium", 1),
    ("shimadzu_japanese.csv", BOTH, "Shimadzu Trapezium", 1),
    ("walter_bai_french.csv", BOTH, "Walter+Bai Dion", 1),
    ("walter_bai_german.csv", BOTH, "Walter+Bai Dion", 1),
    ("trios_raw.txt", AREA, "TA TRIOS", 1),
    ("dma850_steps.txt", {}, "TA DMA850", 1),
    ("cellscale_stretch.csv", AREA, "CellScale UniVert", 1),
    ("lab_template.csv", {}, "lab template (key;value)", 1),
    ("true_values_only.csv", {}, "delimited table", 1),
    ("labview.lvm", BOTH, "LabVIEW measurement", 1),
    ("generic_comma.csv", {}, "delimited table", 1),
    ("generic_suffix.csv", BOTH, "delimited table", 1),
    ("generic_spaces.dat", BOTH, "delimited table", 1),
    ("generic_spanish.csv", {}, "delimited table", 1),
    ("generic_italian.csv", BOTH, "delimited table", 1),
    ("generic_french.csv", {}, "delimited table", 1),
    ("generic_german.csv", {}, "delimited table", 1),
    ("generic_utf16.txt", {}, "delimited table", 1),
    ("generic_thousands.csv", {}, "delimited table", 1),
    ("generic_psi.csv", {}, "delimited table", 1),
]


def reason(name: str, **given: object) -> str:
    with pytest.raises(InputError) as caught:
        read(REFERENCE / name, **given)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "given", "dialect", "sign"), CASES, ids=[c[0] for c in CASES]
)
def test_dialect(name: str, given: dict, dialect: str, sign: int) -> None:
    (found,) = read(REFERENCE / name, **given)
    assert_same(found, sign)
    assert found.log[0].arguments["dialect"] == dialect
    for option, flag in (("length_mm", "--length"), ("area_mm2", "--area")):
        if option in given:  # what is missing is named, with its option
            less = {k: v for k, v in given.items() if k != option}
            assert flag in reason(name, **less)


@pytest.mark.parametrize("name", sorted({c[0] for c in CASES}))
def test_content_not_name_decides(name: str, tmp_path: Path) -> None:
    given = next(c[1] for c in CASES if c[0] == name)
    raw = (REFERENCE / name).read_bytes()
    if name.startswith("wavematrix"):
        given = BOTH  # without the side-car beside it
    other = tmp_path / "unnamed.bin"
    other.write_bytes(gzip.compress(raw))
    (found,) = read(other, **given)
    (expected,) = read(REFERENCE / name, **given)
    np.testing.assert_array_equal(found.stress_MPa, expected.stress_MPa)
    np.testing.assert_array_equal(found.strain, expected.strain)


def test_every_dialect_is_listed_and_has_a_reference() -> None:
    folder = Path(readers.__file__).parent
    with_recognises = {
        p.stem for p in folder.glob("*.py") if "\ndef recognises(" in p.read_text()
    }
    assert with_recognises == {m.__name__.rsplit(".", 1)[1] for m in READERS}
    tested = {c[2] for c in CASES} | {"tidy CSV", "GABO Eplexor"}
    assert {m.NAME for m in READERS} == tested


# -- several recordings in a file


def test_specimens_one_after_another() -> None:
    first, second = read(REFERENCE / "bluehill_two_specimens.csv", **BOTH)
    assert_same(first)
    assert_same(second)
    assert [r.specimen for r in (first, second)] == ["1", "2"]
    assert first.name != second.name


def test_specimens_side_by_side_of_unequal_length() -> None:
    first, second = read(REFERENCE / "shimadzu_two.csv", **BOTH)
    assert_same(first)
    assert_same(second, rows=slice(8))
    assert [r.specimen for r in (first, second)] == ["1 _ 1", "1 _ 2"]


def test_sets_in_one_file_compressed() -> None:
    first, second = read(REFERENCE / "cellscale_two_sets.csv", **AREA)
    assert_same(first, -1)
    assert_same(second, -1)
    assert [r.specimen for r in (first, second)] == ["first", "second"]


def test_steps_with_clocks_of_their_own_become_one_test() -> None:
    (found,) = read(REFERENCE / "trios_steps.txt", length_mm=20)
    plate = np.pi * 8**2 / 4  # from `8.0mm parallel plate`
    force = 10 * STRESS[1:]
    np.testing.assert_allclose(found.stress_MPa, force / plate, atol=1e-7)
    np.testing.assert_allclose(found.time_s, TIME[1:])
    # elongation counts from the first gap of the test
    np.testing.assert_allclose(found.strain, STRAIN[1:] - STRAIN[1], atol=1e-12)


def test_normal_stress_of_a_rheometer_is_not_axial_stress() -> None:
    # Its column is 2 F / area: twice what the area of the plate gives.
    (found,) = read(REFERENCE / "trios_steps.txt", area_mm2=10, length_mm=20)
    np.testing.assert_allclose(found.stress_MPa, STRESS[1:], atol=1e-9)


# -- workbooks


def test_zwick_workbook_takes_each_specimens_section(tmp_path: Path) -> None:
    path = zwick_workbook(tmp_path / "book.xlsx")
    first, second = read(path, **LENGTH)
    assert_same(first)
    assert_same(second)  # twice the force on twice the section
    assert (first.specimen, second.specimen) == ("one", "two")
    assert first.rate_per_s == pytest.approx(0.02)


def source_of(sheets: dict[str, list[list]], path: Path) -> Source:
    """A workbook as the readers see it, for .xls, which nothing here can write."""
    source = Source(path, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")
    source.__dict__["sheets"] = [Sheet(name, grid) for name, grid in sheets.items()]
    return source


def test_dma850_workbook(tmp_path: Path) -> None:
    names = ["Time", "Step time", "Force", "Displacement", "Temperature"]
    units = ["s", "s", "N", "mm", "\u00b0C"]
    rows = [
        [t, t, 10 * s, 20 * e, 25.0]
        for t, e, s in zip(TIME, STRAIN, STRESS, strict=True)
    ]
    details = [
        ["Filename", "invented"],
        ["Instrument name", "DMA0850-0"],
        ["Instrument type", "DMA850"],
        ["Length", "20.0 mm"],
        ["Width", "0.5 cm"],
        ["Thickness", "2000 \u00b5m"],
    ]
    sheets = {
        "Details": details,
        "Ramp - 1": [["Ramp - 1"], names, units, *rows[:6]],
        "Hold - 2": [["Hold - 2"], names, units, *rows[6:]],
    }
    source = source_of(sheets, tmp_path / "a.xls")
    dialect = next(m for m in READERS if m.recognises(source))
    (found,) = dialect.read(source, ReadOptions())
    assert dialect.NAME == "TA DMA850"
    assert_same(found)
    np.testing.assert_array_equal(found.temperature_C, 25.0)


def test_eplexor_sweep_is_refused_and_static_test_read(tmp_path: Path) -> None:
    static = [
        ["Nr", "F stat.", "Strain stat", "Stress stat", "Time", "T"],
        ["", "N", "%", "MPa", "s", "\u00b0C"],
        *(
            [float(k), 10 * s, 100 * e, s, t, 25.0]
            for k, (t, e, s) in enumerate(zip(TIME, STRAIN, STRESS, strict=True))
        ),
    ]
    dynamic = [
        [*row, *more]
        for row, more in zip(
            static,
            [["F dyn.", "f", "E'", "tan delta"], ["N", "Hz", "MPa", ""]]
            + [[1.0, 0.1, 5.0, 0.1]] * 12,
            strict=True,
        )
    ]
    for grid, fine in ((static, True), (dynamic, False)):
        source = source_of({"Exported Data": grid}, tmp_path / "a.xls")
        dialect = next(m for m in READERS if m.recognises(source))
        assert dialect.NAME == "GABO Eplexor"
        if fine:
            (found,) = dialect.read(source, ReadOptions())
            assert_same(found)
        else:
            with pytest.raises(InputError, match="dynamic sweep"):
                dialect.read(source, ReadOptions())


# -- header facts


def test_header_gives_geometry_rate_and_names() -> None:
    (found,) = read(REFERENCE / "zwick_german.TXT")
    g = found.geometry
    assert (g.length_mm, g.width_mm, g.thickness_mm) == (20, 5, 2)
    assert found.rate_per_s == pytest.approx(0.4 / 20)
    assert (found.specimen, found.material) == ("strip 7", "PR")
    # 20 mm of measuring length against 120 mm between the grips: said, not hidden
    assert any("2 lengths" in note for note in found.log[0].arguments["notes"])


def test_side_car_gives_the_section() -> None:
    (found,) = read(REFERENCE / "wavematrix.steps.tracking.csv", **LENGTH)
    assert found.geometry.area_mm2 == 10
    assert any("specimen.txt" in n for n in found.log[0].arguments["notes"])


def test_options_go_before_the_header() -> None:
    (found,) = read(REFERENCE / "bluehill_rawdata.csv", length_mm=40, diameter_mm=2)
    np.testing.assert_allclose(found.strain, STRAIN / 2, atol=1e-9)
    np.testing.assert_allclose(found.stress_MPa, 10 * STRESS / np.pi, atol=1e-9)


def test_columns_and_units_by_option() -> None:
    (found,) = read(
        REFERENCE / "bad_no_unit.csv",
        units={"stress": "MPa", "time": "s", "strain": "1"},
    )
    assert_same(found)
    (found,) = read(REFERENCE / "zwick_german.TXT", displacement="Traversenweg absolut")
    assert_same(found)  # it starts at 33 mm, which is set to zero


def test_time_from_interval_or_rate() -> None:
    (found,) = read(REFERENCE / "bad_no_time.csv", **BOTH, interval_s=0.5)
    assert_same(found)
    (found,) = read(REFERENCE / "bad_no_time.csv", **BOTH, rate_per_s=0.02)
    assert_same(found)


# -- refusals


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("bad_unknown_unit.csv", BOTH, "'zN', unknown here; give it with --unit"),
        ("bad_no_unit.csv", {}, "'stress' has no unit; give it with --unit"),
        ("bad_no_time.csv", BOTH, "--interval SECONDS"),
        ("bad_mixed_marks.csv", BOTH, "--decimal"),
        ("bad_dropped_cell.csv", BOTH, "row 8: 2 values under 3"),
        ("bad_thousandfold_stress.csv", {}, "0.001 times force / area"),
        ("bad_sweep.txt", {}, "oscillation"),
        ("wavematrix.log", {}, "tracking.csv"),
        ("wavematrix.specimen.txt", {}, "tracking.csv"),
        ("wavematrix.steps.trends.csv", {}, "trends"),
        ("absent.csv", {}, "no such file"),
        ("zwick_german.TXT", {"force": "Weg"}, "no column 'Weg'"),
    ],
)
def test_refused_in_one_line(name: str, given: dict, said: str) -> None:
    assert said in reason(name, **given)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        # kgf, lbf and inch by their legal definitions (NIST SP 811, appendix B)
        ("kgf", 9.80665),
        ("gf", 9.80665e-3),
        ("lbf", 4.4482216152605),
        ("kN", 1e3),
        ("KN", 1e3),
        ("mN", 1e-3),
        ("in", 25.4),
        ("(\u00b5m)", 1e-3),
        ("m", 1e3),
        ("%", 0.01),
        ("microstrain", 1e-6),
        ("psi", 6.894757e-3),
        ("N/mm\u00b2", 1),
        ("N/mm^2", 1),
        ("kPa", 1e-3),
        ("GPa", 1e3),
        ("ms", 1e-3),
        ("min", 60),
        ("h", 3600),
    ],
)
def test_unit(unit: str, factor: float) -> None:
    found = parse_unit(unit)
    assert found is not None
    assert found.factor == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize("unit", ["mPa", "MN", "mpA", "g", "kg", "zN", "", "N m", "xx"])
def test_unit_unknown_or_one_case_from_another(unit: str) -> None:
    assert parse_unit(unit) is None


def test_temperatures() -> None:
    # 77 degF = 25 degC = 298.15 K
    assert convert(77, "\u00b0F", "temperature", "T") == pytest.approx(25)
    assert convert(298.15, "K", "temperature", "T") == pytest.approx(25)
    assert convert(25, "\u2103", "temperature", "T") == 25


def test_a_tidy_csv_is_read_packed_too(tmp_path):
    text = b"time_s,strain,stress_MPa\n0,0,0\n1,0.1,0.2\n"
    file = tmp_path / "pull_0.1mm_s.csv.gz"
    file.write_bytes(gzip.compress(text))
    (one,) = read(file)
    assert (one.name, one.stress_MPa.tolist()) == ("pull_0.1mm_s", [0, 0.2])
    file.write_bytes(gzip.compress(text)[:-12])
    with pytest.raises(InputError, match="damaged gzip file"):
        read(file)
    with pytest.raises(InputError, match="damaged gzip file"):
        read_tidy(file)
