"""Piecewise baselines on recordings whose springs and branches are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from softnn import prepare, virtual
from softnn.contracts import Chunk, InputError
from softnn.materials import MATERIALS, table
from softnn.models import PLSLS, Maxwell
from softnn.models.relaxation import three_points
from softnn.recording import Recording
from softnn.study.baselines import (
    WAYS,
    best,
    choices,
    hold_of,
    late_tau,
    like_for_like,
    literal,
    piecewise_baselines,
    relaxation_tests,
    softened,
    training_fits,
    variants,
)
from softnn.study.piecewise import cases
from studies import accuracy, rates, segments

PLANTED = {
    "spring_1": 2.0,
    "spring_2": -1.2,
    "stiffness": 0.8,
    "relaxation_time": 20.0,
}
MODEL = PLSLS([0.0, 0.4])
RATES = (0.025, 0.126, 0.253)


def pulled(rate, specimen, sign=1.0, n=300, end=1.5):
    strain = sign * np.linspace(0, end, n)
    time = np.abs(strain) / rate
    stress, _ = planted(sign).apply(PLANTED, Chunk(time, strain))
    return Recording(
        time, strain, stress, name=f"{rate}-{specimen}", specimen=specimen,
        material="planted", test="tensile", rate_per_s=rate,
    )  # fmt: skip


def planted(sign):
    return PLSLS([0.0, sign * 0.4])


def held(strain=0.3, name="hold", end=900.0):
    ramp = np.linspace(0, abs(strain) / 2.5, 50)
    time = np.concatenate([ramp, ramp[-1] + np.arange(0.05, end, 0.5)])
    imposed = np.sign(strain) * np.minimum(2.5 * time, abs(strain))
    stress, _ = planted(np.sign(strain)).apply(PLANTED, Chunk(time, imposed))
    return Recording(
        time, imposed, stress, name=name, specimen=name, material="planted",
        test="relaxation", rate_per_s=2.5,
    )  # fmt: skip


def softer(share):
    """A curve a rate, of a material with a share of the stiffness of the branches."""
    weak = PLANTED | {"stiffness": share * PLANTED["stiffness"]}
    strain = np.linspace(0, 1.5, 300)
    curves = []
    for rate in RATES:
        stress, _ = MODEL.apply(weak, Chunk(strain / rate, strain))
        curves.append(replace(pulled(rate, "a"), stress_MPa=stress))
    return curves


def tensile(sign=1.0):
    return [pulled(rate, f"{rate}-{i}", sign) for rate in RATES for i in range(2)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_planted_material_is_foretold_over_rates(sign):
    found = piecewise_baselines(tensile(sign), [held(sign * 0.3)])
    for model in ("PL-SLS", "PL-Wiechert"):
        entry = found[model]
        assert entry["generalisation_error"] < 0.02
        assert entry["joint"]["nrmse_over_rates"] < 0.005
        assert set(entry["nrmse_by_rate"]) == {f"{r:.4g}" for r in RATES}
        for split in ("specimen", "rate"):
            assert entry["like_for_like"][split]["as_in_thesis"]["nrmse"] < 0.02
            assert entry["like_for_like"][split]["joint"]["nrmse"] < 0.02
    tau = found["PL-SLS"]["relaxation"]["relaxation_time_s"][0]
    assert tau == pytest.approx(20.0, rel=0.02)
    assert found["PL-SLS"]["rule"] == "tau of the decaying part"
    json.dumps(found)  # ready for JSON


def test_a_hold_is_its_modulus_over_time():
    (time, modulus), level = hold_of(held(-0.3))
    assert level == pytest.approx(-0.3)
    # A branch of 0.8 MPa beside the first spring; the ramp of 0.12 s costs 0.3 %.
    expected = 2.0 + 0.8 * np.exp(-time / 20.0)
    np.testing.assert_allclose(modulus[5:], expected[5:], rtol=3e-3)


def test_a_noisy_hold_is_read_nearer_to_the_quiet_one():
    """Noise of 1 % of the stress: half of it goes, a quarter at start and end."""
    quiet = held(0.3)
    (time, modulus), level = hold_of(quiet)
    rng = np.random.default_rng(7)
    size = 0.01 * quiet.stress_MPa.max()
    off, taus = [], []
    for _ in range(40):
        noise = size * rng.standard_normal(len(quiet))
        (_, found), _ = hold_of(replace(quiet, stress_MPa=quiet.stress_MPa + noise))
        off.append((found - modulus) * level / size)
        taus.append(three_points(time, found).relaxation_time[0])
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.median(rms) < 0.5
    assert np.mean(rms[[0, -1]]) < 0.85  # a parabola through 17 samples: 0.73
    assert np.mean(taus) == pytest.approx(20, rel=0.03)


def test_as_in_the_thesis_is_its_own_reading_whatever_fits_better():
    """Curves that carry 0.4 of the branches: a branch all but a spring fits better."""
    curves = prepare.unify(softer(0.4))
    found = choices(curves, list(variants([held(0.3)])))
    assert literal(found, "PL-SLS").variant.rule == "tau of the decaying part"
    assert best(found, "PL-SLS").variant.rule == "tau read literally"
    reasons: dict = {}
    fits = training_fits(softer(0.4), [held(0.3)], reasons)
    assert {way for _, way in fits} == set(WAYS)
    assert not reasons
    for way, chosen in (("as_in_thesis", literal), ("any_reading", best)):
        expected = chosen(found, "PL-SLS").fit.predict(curves[0])
        np.testing.assert_array_equal(fits["PL-SLS", way].predict(curves[0]), expected)


def test_holds_at_one_strain_and_of_one_length_are_one_test():
    holds = [held(0.30), held(0.31), held(0.30, end=9000.0), held(0.6)]
    levels = [round(t.held_strain, 3) for t in relaxation_tests(holds)]
    assert levels == [0.305, 0.6, 0.3]


def test_the_literal_tau_is_the_end_of_a_hold_that_never_falls_so_far():
    hold, _ = hold_of(held(0.3, end=60.0))
    assert hold[1][-1] > hold[1][0] / np.e
    assert late_tau(hold).relaxation_time[0] == pytest.approx(hold[0][-1])
    branch = Maxwell()
    time = np.arange(0, 100.0, 0.1)
    full, _ = branch.apply(
        {"stiffness": 1.0, "relaxation_time": 7.0}, Chunk(time, np.ones_like(time))
    )
    assert late_tau((time, full)).relaxation_time[0] == pytest.approx(7.0, abs=0.1)


def test_a_held_out_recording_lends_no_hold():
    # Only the recordings at the middle rate hold; by rate, that fold has none left.
    ramps = [r for r in tensile() if r.rate_per_s != RATES[1]]
    holding = held(0.3, name="ramp and hold")
    loading = replace(pulled(RATES[1], "a"), name="ramp and hold")
    found = like_for_like("rate", [*ramps, loading], [holding])
    for model in ("PL-SLS", "PL-Wiechert"):
        assert "no hold" in found[model]["as_in_thesis"]["not_possible"]
        assert found[model]["joint"]["nrmse"] < 0.02


def test_a_share_of_the_branches_is_found():
    # The hold shows branches of 0.8 MPa, the tensile curves carry 0.4 of that.
    curves = softer(0.4)
    readings = list(variants([held(0.3)]))
    plain, soft = (
        best(choices(curves, v), "PL-SLS") for v in (readings, softened(readings))
    )
    assert soft.variant.share == 0.4
    assert soft.variant.rule == "tau of the decaying part"
    assert soft.generalisation_error < 0.01 < plain.generalisation_error


def test_without_a_hold_there_is_no_piecewise_model():
    with pytest.raises(InputError, match="no relaxation test"):
        piecewise_baselines(tensile(), [])
    short = Recording(np.arange(3.0), np.zeros(3), np.ones(3), name="still")
    with pytest.raises(InputError, match="no strain is held"):
        hold_of(short)


def test_every_reading_is_tried():
    rules = {(v.model, v.rule) for v in variants(virtual.relaxation("NatPolR"))}
    assert rules == {
        ("PL-SLS", "tau of the decaying part"),
        ("PL-SLS", "tau read literally"),
        ("PL-Wiechert", "collocation"),
        ("PL-Wiechert", "non-negative least squares"),
    }


def test_a_material_that_is_not_there(capsys):
    assert segments.main(["--material", "wood"]) == 2
    assert "no material 'wood'" in capsys.readouterr().err


@pytest.mark.parametrize("material", MATERIALS)
def test_best_fits_are_no_worse_than_the_published(material):
    (case,) = cases("virtual", material, None, 0)
    for model in ("PL-SLS", "PL-Wiechert"):
        found = accuracy.best_of(case, model)
        published = table("5.1").row(material=material, model=model)["nrmse"]
        assert 100 * found.error <= published
        joint = rates.jointly(model, case.curves)
        assert joint["nrmse_over_rates"] < 0.05
