"""Files of people who do this job, and the values that are right (note.txt of each)."""

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.mismatch.api import to_case
from softnn.plausible import check_plausible
from softnn.readers import read


@pytest.fixture
def field(data_folder):
    folder = data_folder / "field-reports"
    if not folder.is_dir():
        pytest.skip("SOFTNN_DATA has no field-reports")
    return folder


def test_nul_bytes_at_the_ends_of_texts_are_no_damage(field):
    (one,) = read(
        field / "01-wintest-nul-bytes/gel_ramp_dwell_sine.CSV",
        length_mm=2.5, diameter_mm=6.5,
    )  # fmt: skip
    assert one.strain.max() == pytest.approx(0, abs=2e-3)
    assert one.strain.min() == pytest.approx(-0.2, abs=2e-3)


def test_lines_that_count_are_no_data(field):
    first, second = read(field / "02-rheocompass-count-line/two_relaxations.csv")
    assert first.strain.min() == pytest.approx(0.0296)
    assert first.strain.max() == pytest.approx(0.03)
    assert first.stress_MPa.min() == pytest.approx(9.7e-6, rel=0.05)
    assert first.stress_MPa.max() == pytest.approx(3.8e-4, rel=0.01)
    assert len(second) > 50


def test_a_first_row_without_its_last_cell(field):
    (one,) = read(field / "04-trios-first-row-short/creep.txt")
    assert len(one) == 67
    assert one.strain[0] == 0
    np.testing.assert_allclose(one.stress_MPa, 0.0005, rtol=1e-3)


def test_a_stale_first_row_is_neither_zero_nor_sample(field):
    folder = field / "06-admet-stale-first-row"
    (one,) = read(folder / "admet_silicone.csv", length_mm=10, area_mm2=20,
                  compression=True)  # fmt: skip
    assert np.abs(one.strain[:10]).max() < 5e-4
    assert one.strain.max() < 5e-4  # squeezed: it never is above zero
    (one,) = read(folder / "admet_muscle.csv", length_mm=10, area_mm2=20)
    assert one.stress_MPa[0] == pytest.approx(0, abs=1e-3)
    assert one.stress_MPa.max() < 4.61 / 20


@pytest.mark.parametrize("name", ["relax", "visco1", "visco2"])
def test_columns_with_units_and_no_names(field, name):
    (one,) = read(field / f"08-units-only-header/{name}.dat")
    section = {"relax": 170.410, "visco1": 170.873, "visco2": 170.178}[name]
    good = one.force_N > 5
    np.testing.assert_allclose(
        one.stress_MPa[good] * section, one.force_N[good], rtol=0.02
    )
    assert one.strain[0] == 0


@pytest.mark.parametrize("name", ["stretch1", "stretch2", "stretch3"])
def test_a_stretch_ratio_made_strain(field, name):
    (one,) = read(field / f"09-stretch-ratio/{name}.csv")
    assert (one.strain.min(), one.strain.max()) == pytest.approx((0, 0.3), abs=1e-9)
    np.testing.assert_allclose(one.stress_MPa, 0.5 * one.strain, atol=1e-9)


def test_a_stretch_ratio_of_tissue_and_one_by_another_name(field):
    folder = field / "09-stretch-ratio"
    with pytest.raises(InputError, match="--rate"):
        read(folder / "tissue_stretch_kPa.csv")
    (one,) = read(folder / "tissue_stretch_kPa.csv", rate_per_s=0.01)
    assert (one.strain.min(), one.strain.max()) == pytest.approx((0, 1.774))
    (one,) = read(folder / "lam4.csv")
    with pytest.raises(InputError, match="stretch ratio"):
        check_plausible(one)
    (one,) = read(folder / "lam4.csv", units={"Strain": "stretch"})
    assert (one.strain.min(), one.strain.max()) == pytest.approx((0, 0.3), abs=1e-9)


def test_seconds_since_1970_are_apart_as_they_were(field, tmp_path):
    from softnn.readers.tidy import read_tidy, write_table

    (one,) = read(field / "10-epoch-time-lost/a.csv", length_mm=10, area_mm2=20)
    write_table(tmp_path / "a.csv", one.columns)
    again = read_tidy(tmp_path / "a.csv")
    np.testing.assert_array_equal(again.time_s, one.time_s)
    assert np.diff(again.time_s) == pytest.approx(0.0526, abs=2e-4)


@pytest.mark.parametrize("name", ["tT1", "tT2", "tT3", "tT4"])
def test_t_is_time_where_T_is_temperature(field, name):
    (one,) = read(field / f"11-t-and-T-columns/{name}.csv", length_mm=10, area_mm2=20)
    assert one.strain.max() == pytest.approx(0.3)
    assert one.time_s[-1] == pytest.approx(19.9)
    np.testing.assert_array_equal(one.temperature_C, 23)


@pytest.mark.parametrize("name", ["taxt_N", "taxt_g"])
def test_the_travel_of_a_probe_is_a_distance(field, name):
    found = read(field / f"14-texture-analyser-distance/{name}.tab", length_mm=10,
                 area_mm2=20, compression=True)  # fmt: skip
    assert len(found) == 2
    for one in found:
        assert one.strain.min() == pytest.approx(-0.15, abs=3e-3)
        assert one.force_N.min() < -3  # N, not gram-force


def test_files_beside_recordings_are_named(field):
    case = to_case(field / "18-files-beside-recordings/case")
    assert [r.name for r in case.recordings] == ["a", "b"]
    for name in ("note.txt", "readme.txt", "~$a.xlsx"):
        assert any(name in note for note in case.notes)


@pytest.mark.parametrize("name", ["ordinal", "ring"])
def test_signs_that_are_typed_for_a_degree(field, name):
    (one,) = read(field / f"20-celsius-signs/{name}.csv", length_mm=20, area_mm2=10)
    assert (one.temperature_C.min(), one.temperature_C.max()) == (23, 24)


def test_a_marker_line_is_no_specimen(field):
    case = to_case(field / "21-marker-line", length_mm=5, area_mm2=20, compression=True)
    assert len(case.recordings) == 3
    assert case.specimen == {}


def test_sizes_and_time_in_polish(field):
    (one,) = read(field / "23-polish-names/probka.csv")
    assert (one.geometry.length_mm, one.geometry.area) == (25, 12)
    assert one.strain.max() == pytest.approx(0.24)
    assert one.stress_MPa.max() == pytest.approx(0.85)
    assert one.time_s[1] == 0.5


@pytest.mark.parametrize("name", ["actuator", "aktuator"])
def test_a_position_under_a_preload(field, name):
    (one,) = read(field / f"24-preload-position/{name}.csv", length_mm=20, area_mm2=10)
    assert (one.strain.min(), one.strain.max()) == pytest.approx((0, 0.3))


def test_thousands_beside_decimal_commas(field):
    (one,) = read(field / "27-thousands-points/zug.csv", length_mm=5, area_mm2=1000)
    assert one.force_N[-1] == 1336
    assert one.stress_MPa[-1] == pytest.approx(1.336)


def test_torque_and_angle_of_a_rheometer_are_shear(field):
    (one,) = read(field / "28-trios-torque-relaxation/gel_relax.txt")
    assert one.strain.max() == pytest.approx(0.02)
    assert one.stress_MPa.max() == pytest.approx(32e-6, rel=0.02)
    assert one.stress_MPa[-1] == pytest.approx(8e-6, rel=0.01)
    assert one.material == ""
