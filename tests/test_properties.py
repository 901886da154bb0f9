"""Properties against closed forms and a second route."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from softnn import properties
from softnn.contracts import InputError
from softnn.readers.tidy import read_folder
from softnn.recording import Recording
from softnn.study import property_sets


def curve(stress_of, ultimate=2.0, n=2001, noise=0.0, scale=1.0, **about):
    strain = np.linspace(0, ultimate, n)
    rng = np.random.default_rng(n)
    stress = scale * stress_of(strain) + noise * rng.standard_normal(n)
    return Recording(strain / 0.1, strain, stress, **about)


def bilinear(strain):
    """5 MPa to strain 0.4, then 1 MPa: offset yield where 5 (e - 0.2) = 2 + e - 0.4."""
    return np.where(strain < 0.4, 5 * strain, 2 + (strain - 0.4))


def test_bilinear_curve_gives_both_slopes_and_the_offset_yield():
    p = properties.elastic(curve(bilinear), bend=1e-9)
    assert p.E_small_MPa == pytest.approx(5)
    assert p.E_large_MPa == pytest.approx(1)
    assert p.yield_strain == pytest.approx((2 - 0.4 + 1) / 4)
    assert p.yield_stress_MPa == pytest.approx(2 + 0.65 - 0.4)
    assert p.small[1] == pytest.approx(0.4, abs=0.002)
    assert p.intercept_MPa == pytest.approx(0, abs=1e-9)


def test_compression_gives_the_same_magnitudes():
    pulled = curve(bilinear)
    pushed = Recording(pulled.time_s, -pulled.strain, -pulled.stress_MPa)
    assert properties.elastic(pushed) == properties.elastic(pulled)


@pytest.mark.parametrize("bend", [0.01, 0.03, 0.06])
def test_first_range_of_a_parabola_ends_where_its_bend_says(bend):
    """y = E (x - x^2 / 2a) on [0, L]: slope E (1 - L/2a), bend E L^2 / 2a sqrt(180).

    So the range ends where L^2 / (2a sqrt(180)) = bend (L - L^2 / 2a).
    """
    a, modulus = 2.0, 3.0
    p = properties.elastic(
        curve(lambda e: modulus * (e - e**2 / (2 * a)), ultimate=1.9), bend=bend
    )
    root = np.sqrt(180)
    length = bend / (1 / (2 * a * root) + bend / (2 * a))
    assert p.small[1] == pytest.approx(length, rel=0.01)
    assert p.E_small_MPa == pytest.approx(modulus * (1 - length / (2 * a)), rel=0.01)


def test_first_range_of_a_curve_that_softens_and_then_stiffens():
    """y = 3 x - 3 x^2 + x^3 about its inflection at 1: no parabola in it on [0, 2].

    The slope falls from 3 to 0; a range over both arms is not straight.
    """
    p = properties.elastic(curve(lambda e: 3 * e - 3 * e**2 + e**3))
    assert p.small[1] < 0.6
    assert p.E_small_MPa > 2


def test_default_bend_is_an_r2_of_99_per_cent_of_a_parabola():
    made = curve(lambda e: e - e**2 / 4, ultimate=1.9)
    end = properties.elastic(made).small[1]
    inside = made.strain <= end
    r = stats.linregress(made.strain[inside], made.stress_MPa[inside]).rvalue
    assert r**2 == pytest.approx(0.99, abs=0.001)


def test_noise_does_not_shorten_the_first_range():
    def knee(strain):
        return -np.expm1(-strain / 0.3) + 0.5 * strain

    clean, noisy = (properties.elastic(curve(knee, noise=s)) for s in (0, 0.02))
    assert noisy.small[1] == pytest.approx(clean.small[1], rel=0.15)
    assert noisy.E_small_MPa == pytest.approx(clean.E_small_MPa, rel=0.05)
    assert noisy.E_large_MPa == pytest.approx(clean.E_large_MPa, rel=0.05)


def test_large_modulus_is_of_the_plateau_not_of_the_upturn():
    def crystallising(strain):
        return bilinear(strain) + 40 * np.maximum(strain - 1.6, 0) ** 3

    p = properties.elastic(curve(crystallising))
    assert p.E_large_MPa == pytest.approx(1, rel=0.15)
    assert p.large[1] < 1.9


def test_a_flat_plateau_has_no_second_modulus():
    p = properties.elastic(curve(lambda e: np.minimum(5 * e, 2), noise=0.01))
    assert p.E_small_MPa == pytest.approx(5, rel=0.1)
    assert p.yield_stress_MPa == pytest.approx(2, rel=0.02)
    assert np.isnan(p.E_large_MPa)


def test_a_stiffening_curve_has_no_yield():
    p = properties.elastic(curve(lambda e: np.expm1(e)))
    assert np.isnan(p.yield_stress_MPa)
    assert np.isnan(p.yield_strain)
    assert p.E_large_MPa > p.E_small_MPa


def test_too_short_a_curve_is_refused():
    with pytest.raises(InputError, match="5 samples of growing strain; at least 10"):
        properties.elastic(curve(bilinear, n=5))
    with pytest.raises(InputError, match="bend is 0"):
        properties.elastic(curve(bilinear), bend=0)


# --- several specimens ---------------------------------------------------------------


def test_table_of_scaled_specimens():
    """Scaling stress scales stresses and moduli and leaves strains where they are."""
    scales = [0.8, 0.9, 1.3]
    group = [curve(bilinear, scale=s, material="M", test="tensile") for s in scales]
    (p,) = properties.tensile(group, np.random.default_rng(0), resamples=50)
    one = properties.elastic(curve(bilinear))
    top = float(bilinear(np.array(2.0)))
    assert p.specimens == 3
    assert p.values["ultimate_stress_median"].value == pytest.approx(0.9 * top)
    assert p.values["ultimate_stress_mean"].value == pytest.approx(top)
    assert p.values["E_small"].value == pytest.approx(one.E_small_MPa, rel=1e-3)
    assert p.values["E_small"].low >= 0.8 * one.E_small_MPa * 0.999
    assert p.values["E_small"].high <= 1.3 * one.E_small_MPa * 1.001
    assert p.values["yield_strain"].low == pytest.approx(one.yield_strain, rel=0.01)


def test_one_specimen_has_no_interval():
    (p,) = properties.tensile([curve(bilinear)], np.random.default_rng(0), 10)
    assert p.values["E_large"].value == pytest.approx(1, rel=0.1)
    assert all(np.isnan([e.low, e.high]).all() for e in p.values.values())


def test_bootstrap_agrees_with_scipys_percentile_interval():
    values = np.random.default_rng(3).gamma(3, 2, 40)
    mine = properties.bootstrap(
        40, lambda i: values[i].mean(), np.random.default_rng(0), 20000
    )
    theirs = stats.bootstrap(
        (values,), np.mean, method="percentile", n_resamples=20000, rng=1
    ).confidence_interval
    np.testing.assert_allclose(mine, theirs, rtol=0.01)


# --- relaxation ----------------------------------------------------------------------


def held(tau=20.0, left=0.6, noise=0.0, strain=0.3, hold=600.0, **about):
    """A ramp in 0.5 s, then the exponential decay of one branch from the peak of 1."""
    time = np.concatenate(
        [np.linspace(0, 0.5, 51), 0.5 + np.arange(1, 6001) * hold / 6000]
    )
    after = np.maximum(time - 0.5, 0)
    stress = np.minimum(time / 0.5, 1) * (left + (1 - left) * np.exp(-after / tau))
    stress = stress + noise * np.random.default_rng(0).standard_normal(len(time))
    return Recording(time, strain * np.minimum(time / 0.5, 1), stress, **about)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_relaxation_of_one_exponential(sign, noise):
    made = held(noise=noise)
    p = properties.relaxation(
        Recording(made.time_s, sign * made.strain, sign * made.stress_MPa)
    )
    assert p.stress_start_MPa == pytest.approx(1, abs=0.004 + 2 * noise)
    assert p.stress_end_MPa == pytest.approx(0.6, abs=1e-6 + noise)
    assert p.relaxed_percent == pytest.approx(40, abs=0.3 + 300 * noise)
    assert p.time_s == pytest.approx(20, rel=0.01 + 10 * noise)
    assert p.strain == pytest.approx(0.3, rel=1e-3)
    assert p.hold_s == pytest.approx(600, rel=1e-3)


def test_no_hold_is_said():
    with pytest.raises(InputError, match=r"no hold after a loading; .* has: loading"):
        properties.relaxation(curve(bilinear))


def test_relaxation_tests_group_by_strain_and_time_held():
    made = [
        held(material="M", strain=e, hold=h)
        for e, h in [(0.3, 600), (0.15, 600), (0.301, 600), (0.3, 6000)]
    ]
    sizes = [len(group) for group, _ in properties.relaxations(made)]
    assert sizes == [2, 1, 1]


def test_a_hold_in_pieces_is_one_hold():
    """The strain gauge jumps for a few seconds: 8 % of the strain, then back."""
    made = held(tau=200.0)
    strain = made.strain.copy()
    strain[2000:2020] *= 1.08
    p = properties.relaxation(Recording(made.time_s, strain, made.stress_MPa))
    assert p.hold_s == pytest.approx(600, rel=1e-3)


def test_a_staircase_gives_its_first_hold():
    time = np.arange(0, 100, 0.1)
    strain = np.interp(time, [0, 5, 45, 50, 100], [0, 0.2, 0.2, 0.4, 0.4])
    stress = strain + 0.1 * np.exp(-np.abs(time - 5) / 10)
    p = properties.relaxation(Recording(time, strain, stress))
    assert p.hold_s == pytest.approx(40, abs=0.5)
    assert p.strain == pytest.approx(0.2)


# --- real recordings -----------------------------------------------------------------


def test_ultimate_values_of_real_elastomers_are_those_of_the_index(data_folder):
    """19 pulls to failure; five files have a time that counts 40.9, 40.1, 40.11 s."""
    folder = data_folder / "soft-robotics-elastomers-pull"
    index = pd.read_csv(folder / "index.csv").set_index("file")
    found = property_sets.of_set(folder.name)
    assert len(found["time_rebuilt"]) == 5
    assert len(found["tensile"]) == len(index) == 19
    for row in found["tensile"]:
        listed = index.loc[f"tidy/{row['name']}.csv"]
        assert row["ultimate_stress"] == pytest.approx(listed.peak_stress_MPa, rel=5e-3)
        # A negative load at the start is taken off, slack before it too.
        assert row["ultimate_strain"] == pytest.approx(listed.max_strain, rel=0.01)
        assert 0.001 < row["E_small"] < 5


def test_real_relaxation_grows_with_the_rate_of_the_ramp(data_folder):
    """Rubber at three rates a decade apart: the faster ramp leaves more to relax."""
    folder = data_folder / "rubber-compression-relaxation"
    index = pd.read_csv(folder / "index.csv").set_index("file")
    by_rate = {}
    for recording in read_folder(folder):
        p = properties.relaxation(recording)
        peak = index.loc[f"tidy/{recording.name}.csv"].peak_stress_MPa
        assert p.stress_start_MPa == pytest.approx(abs(peak), rel=0.01)
        assert p.hold_s == pytest.approx(120, rel=0.02)
        assert p.strain == pytest.approx(0.2, rel=0.01)
        size = recording.name.split("_")[0]
        decade = round(np.log10(recording.rate_per_s / 6.3e-4))
        by_rate.setdefault((size, decade), []).append(p.relaxed_percent)
    for size in ("large", "small"):
        slow, middle, fast = (by_rate[size, decade] for decade in (0, 1, 2))
        assert max(slow) < min(middle)
        assert max(middle) < min(fast)


def test_real_holds_of_half_an_hour(data_folder):
    for recording in read_folder(data_folder / "vhb4910-zhao"):
        if recording.test == "relaxation":
            p = properties.relaxation(recording)
            assert p.hold_s == pytest.approx(1800, rel=0.01)
            assert p.strain == pytest.approx(recording.strain.max(), rel=0.03)
            assert 0 < p.time_s < 180  # most of it goes in the first tenth
