"""Headings, units and columns as labs write them: the pull comes out, or a question."""

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
    written,
)

from softnn.contracts import InputError
from softnn.readers import read

STRETCH = 1 + STRAIN
POUND, KILOPOND, INCH = 4.4482216, 9.80665, 25.4


def notes(recording):
    return " | ".join(recording.log[0].arguments["notes"])


MEASURES = {
    "true": ("Stretch \u03bb (-),Cauchy stress (kPa)", STRETCH, 1e3 * STRESS * STRETCH),
    "log": (
        "Logarithmic strain,True stress (MPa)",
        np.log(STRETCH),
        STRESS * STRETCH,
    ),
    "Green": (
        "Green-Lagrange strain (-),2nd Piola-Kirchhoff stress (MPa)",
        (STRETCH**2 - 1) / 2,
        STRESS / STRETCH,
    ),
    "short": ("Green strain (%),PK2 (kPa)", 50 * (STRETCH**2 - 1),
              1e3 * STRESS / STRETCH),
    "nominal": ("Strain (\u2030),1st Piola-Kirchhoff stress (kPa)", 1e3 * STRAIN,
                1e3 * STRESS),
}  # fmt: skip


@pytest.mark.parametrize(("names", "strain", "stress"), MEASURES.values(), ids=MEASURES)
def test_other_measures_of_strain_and_stress_by_name(names, strain, stress, tmp_path):
    file = written(tmp_path / "a.csv", f"Time (s),{names}", TIME, strain, stress)
    (one,) = read(file)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


HEADINGS = {
    "R": ("Time.s.,Tensile.extension..mm.,Load..N.", TIME, WAY, LOAD),
    "imperial": ("Time (sec),Extension (in),Load (lbf)", TIME, WAY / INCH,
                 LOAD / POUND),
    "a logger": ("millis,position_mm,weight_g", 1e3 * TIME, WAY, 1e3 * LOAD / KILOPOND),
    "only units": ("s,mm,N", TIME, WAY, LOAD),
    "Spanish": ("Tiempo [s],Desplazamiento [mm],Fuerza [kgf]", TIME, WAY,
                LOAD / KILOPOND),
    "capitals": ("TIME [S],WAY [MM],LOAD [N]", TIME, WAY, LOAD),
    "a catman file": ("Time 1 - default sample rate [s],Force [N],Travel [mm]", TIME,
                      LOAD, WAY),
    "abbreviated": ("Elapsed (s),Displ. (mm),F / N", TIME, WAY, LOAD),
    "Greek": ("t / s,\u0394l / mm,F / N", TIME, WAY, LOAD),
    "from a preload": ("Load (N),Extension from Preload (mm),Time (sec)", LOAD, WAY,
                       TIME),
    "braces": ("Time{s},Extension{mm},Load{N}", TIME, WAY, LOAD),
    "dots": ("Time.s,Extension.mm,Load.N", TIME, WAY, LOAD),
    "dashes": ("Time - s,Extension - mm,Load: N", TIME, WAY, LOAD),
    "Dutch": ("Tijd (s),Verplaatsing (mm),Kracht (N)", TIME, WAY, LOAD),
    "Portuguese": ("Tempo (s),Deslocamento (mm),For\u00e7a (N)", TIME, WAY, LOAD),
    "Swedish": ("Tid (s),F\u00f6rl\u00e4ngning (mm),Kraft (N)", TIME, WAY, LOAD),
    "minutes": ("minutes,Crosshead (mm),Load (N)", TIME / 60, WAY, LOAD),
}  # fmt: skip


@pytest.mark.parametrize("name", HEADINGS)
def test_headings_of_other_software(name, tmp_path):
    header, *columns = HEADINGS[name]
    (one,) = read(written(tmp_path / "a.csv", header, *columns), **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-4)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-5)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-5)


def test_a_data_frame_of_R_does_not_say_what_its_strain_is(tmp_path):
    file = written(tmp_path / "a.csv", "Time..s.,Strain....,Stress..MPa.", TIME,
                   100 * STRAIN, STRESS)  # fmt: skip
    with pytest.raises(InputError, match="--unit 'Strain=%'"):
        read(file)
    (one,) = read(file, units={"Strain": "%"})
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)


def test_a_strain_without_unit_beyond_one_is_a_question(tmp_path):
    file = written(tmp_path / "a.csv", "Time (s),Strain,Stress (MPa)", TIME,
                   10 * STRAIN, STRESS)  # fmt: skip
    with pytest.raises(InputError, match=r"has no unit.*in mm/mm or .*in %"):
        read(file)
    (one,) = read(file, units={"Strain": "%"})
    np.testing.assert_allclose(one.strain, STRAIN / 10, atol=1e-6)


def test_readings_that_are_not_calibrated_are_refused(tmp_path):
    for header in (
        "Time (s),Extension (mm),Load (V)",
        "Time (s),Travel (counts),Load (N)",
    ):
        file = written(tmp_path / "a.csv", header, TIME, WAY, LOAD)
        with pytest.raises(InputError, match="calibrat") as error:
            read(file, **SIZES)
        assert "--unit" not in str(error.value)


@pytest.mark.parametrize(
    ("header", "way"),
    [
        ("Time (s),Compression (mm),Force (N)", WAY),
        ("Time (s),Extension (mm),Compressive load (N)", WAY),
        ("Time (s),Gap (mm),Force (N)", LENGTH - WAY),
    ],
)
def test_what_goes_with_compression_is_compression(header, way, tmp_path):
    (one,) = read(written(tmp_path / "a.csv", header, TIME, way, LOAD), **SIZES)
    np.testing.assert_allclose(one.strain, -STRAIN, atol=1e-6)
    np.testing.assert_allclose(one.stress_MPa, -STRESS, atol=1e-6)
    assert "compression" in notes(one)


def test_sizes_in_columns_that_do_not_change(tmp_path):
    header = f"{HEADER},Width (mm),Thickness (cm),Gauge length (mm)"
    sizes = (["9"] * N, ["0.2"] * N, ["25"] * N)
    file = written(tmp_path / "a.csv", header, TIME, WAY, LOAD, *sizes)
    (one,) = read(file)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    assert read(file, length_mm=50)[0].strain.max() == pytest.approx(STRAIN.max() / 2)


@pytest.mark.parametrize("thick", ["Thickness 0,2 cm", "Dicke: 2,00 mm"])
def test_sizes_in_lines_of_one_cell(thick, tmp_path):
    header = f"Length 25 mm\nWidth = 9.0 mm\n{thick}\n\n{HEADER}"
    (one,) = read(written(tmp_path / "a.csv", header, TIME, WAY, LOAD))
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


def test_decimal_commas_between_commas_are_told(tmp_path):
    columns = [[f"{v:.3f}".replace(".", ",") for v in c] for c in (TIME, WAY, LOAD)]
    with pytest.raises(InputError, match=r"6 values under 3.*semicolons"):
        read(written(tmp_path / "a.csv", HEADER, *columns), **SIZES)


def test_an_empty_column_is_none(tmp_path):
    header = "Time (s),Load (N),Stress (kPa),Strain (mm),Position (mm)"
    file = written(tmp_path / "a.csv", header, TIME, LOAD, ["N/A"] * N, [""] * N, WAY)
    with pytest.raises(InputError, match="--area"):
        read(file, length_mm=25)
    (one,) = read(file, **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


@pytest.mark.parametrize("name", ["Specimen", "Sample ID", "Test no"])
def test_specimens_by_a_column(name, tmp_path):
    half = N // 2
    time = np.r_[TIME[:half], TIME[: N - half]]
    whose = ["A"] * half + ["B"] * (N - half)
    header = f"{name},Time (s),Extension (mm),Load (N)"
    first, second = read(
        written(tmp_path / "a.csv", header, whose, time, WAY, LOAD), **SIZES
    )
    assert (first.specimen, second.specimen) == ("A", "B")
    np.testing.assert_allclose(first.stress_MPa, STRESS[:half], atol=1e-6)
    np.testing.assert_allclose(second.stress_MPa, STRESS[half:], atol=1e-6)


def test_a_clock_that_starts_again_is_asked_about_and_the_answer_works(tmp_path):
    time = np.r_[TIME[: N // 2], TIME[: N - N // 2]]
    file = written(tmp_path / "a.csv", HEADER, time, WAY, LOAD)
    with pytest.raises(InputError, match=r"starts again.*--interval 0\.1"):
        read(file, **SIZES)
    (one,) = read(file, interval_s=0.1, **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-6)


def test_the_speed_in_the_header_is_offered_where_time_lacks(tmp_path):
    header = "Test speed: 75 mm/min\nGauge length: 25 mm\n\nExtension (mm),Load (N)"
    file = written(tmp_path / "a.csv", header, WAY, LOAD)
    with pytest.raises(InputError, match=r"--rate 0\.05\b"):
        read(file, area_mm2=18)
    (one,) = read(file, area_mm2=18, rate_per_s=0.05)
    assert one.time_s[-1] == pytest.approx(2 * STRAIN.max() / 0.05, rel=0.02)


# -- what rows and cells hold ----------------------------------------------------------


@pytest.mark.parametrize(("value", "count"), [(-999.0, 1), (-9999.0, 6), (1e30, 2)])
def test_what_a_logger_writes_for_no_reading_is_missing(value, count, tmp_path):
    load = LOAD.copy()
    load[80 : 80 + count] = value
    if value == 1e30:
        load = [f"{v:.7g}" for v in load]
    (one,) = read(written(tmp_path / "a.csv", HEADER, TIME, WAY, load), **SIZES)
    good = np.isfinite(one.stress_MPa)
    assert (~good).sum() == count
    np.testing.assert_allclose(one.stress_MPa[good], STRESS[good], atol=1e-6)
    assert "no reading" in notes(one)


def test_a_reading_of_999_among_others_is_one(tmp_path):
    load = np.where(np.arange(N) == 90, 999.0, 2000 * LOAD / LOAD.max())
    header = "Time (s),Extension (mm),Load (mN)"
    (one,) = read(written(tmp_path / "a.csv", header, TIME, WAY, load), **SIZES)
    assert np.isfinite(one.stress_MPa).all()


def test_a_channel_that_is_lost_for_a_while_is_told(tmp_path):
    way = WAY.copy()
    way[100:104] = 0.0
    (one,) = read(written(tmp_path / "a.csv", HEADER, TIME, way, LOAD), **SIZES)
    assert "4 samples of strain stand far off" in notes(one)


@pytest.mark.parametrize("size", [1.0, 0.5])
@pytest.mark.parametrize("tidy", [True, False])
def test_times_that_are_rounded_are_spread_evenly(size, tidy, tmp_path):
    time = size * np.floor((TIME + 1e-9) / size)
    header, x, y = (TIDY, STRAIN, STRESS) if tidy else (HEADER, WAY, LOAD)
    (one,) = read(written(tmp_path / "a.csv", header, time, x, y), **SIZES)
    np.testing.assert_allclose(one.time_s, TIME, atol=1e-6)
    assert "rounded" in notes(one)


def test_rows_that_are_there_twice_count_once(tmp_path):
    twice = [np.repeat(v, 2) for v in (TIME, WAY, LOAD)]
    (one,) = read(written(tmp_path / "a.csv", HEADER, *twice), **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    assert "240 rows repeat" in notes(one)


def test_the_newest_row_first_is_told_without_an_interval(tmp_path):
    file = written(tmp_path / "a.csv", HEADER, TIME[::-1], WAY[::-1], LOAD[::-1])
    with pytest.raises(InputError, match="sort the rows by time"):
        read(file, **SIZES)


def test_a_standard_deviation_is_no_load(tmp_path):
    header = "Time (s),Load SD (N),Extension (mm),Load (N)"
    (one,) = read(
        written(tmp_path / "a.csv", header, TIME, 0.01 * LOAD, WAY, LOAD), **SIZES
    )
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    assert "differ" not in notes(one)


@pytest.mark.parametrize(
    ("header", "columns", "told"),
    [
        ("Time (s),Extension (mm),Load 1 (N),Load 2 (N)", (WAY, LOAD, 1.2 * LOAD),
         "Load 2 [N], which differ; another one is named with --force"),
        ("Time (s),Extension (mm),LVDT (mm),Load (N)", (WAY, 0.9 * WAY, LOAD),
         "LVDT [mm], which differ; another one is named with --displacement"),
    ],
)  # fmt: skip
def test_columns_that_may_be_meant_as_well_are_told(header, columns, told, tmp_path):
    (one,) = read(written(tmp_path / "a.csv", header, TIME, *columns), **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)
    assert told in notes(one)


def test_results_beside_the_rows_and_exponents_of_Fortran(tmp_path):
    header = "Time (s),Extension (mm),Load (N),,Modulus (MPa),1.2"
    columns = [[f"{v:.6E}".replace("E", "D") for v in c] for c in (TIME, WAY, LOAD)]
    (one,) = read(written(tmp_path / "a.csv", header, *columns), **SIZES)
    np.testing.assert_allclose(one.stress_MPa, STRESS, atol=1e-6)


def test_a_header_that_says_compression_is_believed(tmp_path):
    head = f"Test type,Compression\n\n{HEADER}"
    one = read(written(tmp_path / "a.csv", head, TIME, WAY, LOAD), **SIZES)[0]
    np.testing.assert_allclose(one.strain, -STRAIN, atol=1e-6)
    np.testing.assert_allclose(one.stress_MPa, -STRESS, atol=1e-6)
    assert "'Test type' is 'Compression'" in notes(one)
    # Values that count it as negative, a tension, and what the user says, stay.
    for kind, sign, more in (("Compression", -1, {}), ("Tension", 1, {}),
                             ("Compression set", 1, {})):  # fmt: skip
        head = f"Test type,{kind}\n\n{HEADER}"
        file = written(tmp_path / "a.csv", head, TIME, sign * WAY, sign * LOAD)
        (one,) = read(file, **SIZES, **more)
        np.testing.assert_allclose(one.strain, sign * STRAIN, atol=1e-6)
        assert "Test type" not in notes(one)


IN_CONFLICT = {
    "area and width": ("Width,6,mm\nThickness,3,mm\nArea,36,mm2\n", {},
                       "width 6 mm times thickness 3 mm is 18 mm2; 36 mm2"),
    "area twice": ("Area,18,mm2\nArea,36,mm2\n", {"length_mm": 25.0},
                   "area is 18, 36 mm2 in the header; the first is used"),
    "width and diameter": ("", {"width_mm": 6.0, "diameter_mm": 4.8},
                           "--width is not used: the section is given by --diameter"),
}  # fmt: skip


@pytest.mark.parametrize("case", IN_CONFLICT)
def test_sizes_that_disagree_are_told(case, tmp_path):
    above, more, said = IN_CONFLICT[case]
    head = f"Length,25,mm\n{above}\n{HEADER}"
    (one,) = read(written(tmp_path / "a.csv", head, TIME, WAY, LOAD), **more)
    assert said in notes(one)
    close = "Width,6,mm\nThickness,3,mm\nArea,18.2,mm2\nWidth,6.1,mm\n"
    head = f"Length,25,mm\n{close}\n{HEADER}"
    (one,) = read(written(tmp_path / "a.csv", head, TIME, WAY, LOAD))
    assert notes(one) == ""


def test_a_column_that_disagrees_with_the_same_made_of_others_is_told(tmp_path):
    head = "Time (s),Strain (%),Stress (MPa),Load (N),Extension (mm)"
    columns = TIME, 200 * STRAIN, 2 * STRESS, LOAD, WAY
    (one,) = read(written(tmp_path / "a.csv", head, *columns), **SIZES)
    assert "'Stress [MPa]' is 2 times force / area; the latter is used" in notes(one)
    assert "'Strain [%]' is 2 times travel / length; the latter is used" in notes(one)
    np.testing.assert_allclose(one.strain, STRAIN, atol=1e-6)
    sizes = "Length,25,mm\nArea,18,mm2\n\n"
    (one,) = read(written(tmp_path / "a.csv", sizes + head, *columns))
    assert "'Stress [MPa]' is 2 times force / area; the column is used" in notes(one)
    columns = TIME, 100 * STRAIN, STRESS, LOAD, WAY
    (one,) = read(written(tmp_path / "a.csv", head, *columns), **SIZES)
    assert notes(one) == ""
