"""The published tables: each is checked against arithmetic that another one allows."""

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.materials import MATERIALS, SPEEDS, material, table, tables
from softnn.metrics import delta_accuracy, delta_complexity


def test_all_promised_tables_are_there():
    assert tables() == tuple("3.1 4.1 4.2 4.3 4.4 5.1 5.2 6.2 6.6 7.1 7.2 7.3".split())


@pytest.mark.parametrize("number", tables())
def test_every_key_has_a_unit_and_every_material_is_known(number):
    t = table(number)
    for row in t.rows:
        assert row.get("material", "EPR") in (*MATERIALS, "Human tendon")
        if number == "7.3":  # units stand in its rows
            continue
        plain = {"material", "name", "model", "colour", "study", "test"}
        assert set(row) - plain <= set(t.units)


def test_sample_totals_of_table_6_2():
    for row in table("6.2").rows:
        assert sum(row.get(f"samples_{s}", 0) for s in SPEEDS) == row["total"]


def test_samples_a_specimen_are_constant_within_a_material():
    for name in MATERIALS:
        m = material(name)
        each = {s: m.samples[s] / m.specimens[s] for s in m.speeds}
        if name == "FR":  # six specimens rather than the five of Table 4.1
            each[500] *= 5 / 6
        assert np.ptp(list(each.values())) < 1


def test_strain_of_table_4_3_is_elongation_over_the_gauge_length():
    for row in table("4.3").rows:
        # Two decimals, cut or rounded: 4 mm gives 0.12, 20 mm gives 0.61.
        assert row["strain"] == pytest.approx(row["elongation"] / 33, abs=0.01)


def test_relaxation_of_table_4_4_is_within_the_rounding_of_its_stresses():
    for row in table("4.4").rows:
        half = 0.005
        start, end = row["stress_start"], row["stress_end"]
        low = 100 * (1 - (end + half) / (start - half)) - 0.5
        high = 100 * (1 - (end - half) / (start + half)) + 0.5
        assert low <= row["relaxation"] <= high, row


def test_improvements_of_table_5_1_are_within_the_rounding_of_its_figures():
    t = table("5.1")
    for name in MATERIALS:
        sls = t.row(material=name, model="PL-SLS")
        wiechert = t.row(material=name, model="PL-Wiechert")
        printed = t.row(material=name, model="improvement")
        found = [
            delta_accuracy(wiechert["nrmse"] + a, sls["nrmse"] + b)
            for a in (-0.005, 0.005)
            for b in (-0.005, 0.005)
        ]
        assert min(found) - 0.5 <= printed["delta_accuracy"] <= max(found) + 0.5
        complexity = delta_complexity(wiechert["segments"], sls["segments"])
        assert printed["delta_complexity"] == pytest.approx(complexity, abs=0.6)


def test_table_6_6_repeats_table_5_2():
    for row in table("5.2").rows:
        assert row in table("6.6").rows


def test_table_7_1_repeats_tables_4_2_and_4_4():
    for name in MATERIALS:
        row, m = table("7.1").row(material=name), material(name)
        elastic = m.elastic[m.speeds[0]]
        assert row["ultimate_stress"] == elastic["ultimate_stress_median"]
        assert row["ultimate_strain"] == elastic["ultimate_strain_median"]
        assert row["E_small"] == elastic["E_small"]
        assert row["relaxation"] == m.relaxation[1]["relaxation"]


def test_table_7_2_rests_on_one_tendon_area_and_whole_strips():
    tendon = table("7.1").row(material="Human tendon")["E_small"]
    for name in MATERIALS:
        row, m = table("7.2").row(material=name), material(name)
        e_small = m.elastic[m.speeds[0]]["E_small"]
        assert row["area_new"] * e_small / tendon == pytest.approx(51.57, abs=0.01)
        factor = row["area_new"] / (row["area_factor"] * row["area_old"])
        assert row["stiffness_factor"] == round(factor)
        thickness = row["area_old"] / m.width_mm
        assert row["strips"] == round(row["area_new"] / 66 / thickness)
        assert m.thickness_mm[0] <= thickness <= m.thickness_mm[1]


def test_the_mean_ultimate_stress_of_natr_cannot_be_a_mean_of_specimens():
    m = material("NatR")
    row, n = m.elastic[250], m.specimens[250]
    least = (n + 1) // 2 * row["ultimate_stress_median"] / n
    assert row["ultimate_stress_mean"] < least


def test_unknown_names_are_refused():
    with pytest.raises(InputError, match="no material 'XR'; there are EPR, FR"):
        material("XR")
    with pytest.raises(InputError, match="no Table"):
        table("9.9")
    with pytest.raises(InputError, match="3 rows of Table"):
        table("4.2").row(material="NR")
