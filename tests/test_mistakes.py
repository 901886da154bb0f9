"""A cross-section typed wrong, among specimens that were told apart and scatter."""

from dataclasses import replace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, histories, mullins
from scipy.integrate import quad
from scipy.stats import norm
from test_specimens import recorded

import softnn
from softnn.mismatch import mistakes
from softnn.mismatch.accounts import Account
from softnn.mismatch.base import baseline, given
from softnn.mismatch.evidence import Weigher
from softnn.mismatch.mistakes import allowed, told, weighed, with_mistakes, wrong
from softnn.mismatch.posterior import posterior
from softnn.mismatch.prediction import specimens_of
from softnn.recording import Recording
from softnn.simulate import simulate

SURE = 1e8  # precision of a logarithm, as good as exact


def chances(logs, precision=SURE):
    at = np.array(logs[1:]) - logs[0]
    # Of independent scales of like precision, over the first's, their mean free.
    n = len(logs)
    known = precision * (np.eye(n - 1) - 1 / n)
    return weighed(at, known)


def test_it_is_the_sum_over_all_that_scales_may_be_drawn_from(monkeypatch):
    """Three specimens, one spread, one size: normal densities, worked out by hand."""
    monkeypatch.setattr(mistakes, "SPREADS", np.array([0.05]))
    monkeypatch.setattr(mistakes, "SIZES", (0.7,))
    logs = [0.0, 0.02, 0.2]

    def density(sizes):
        return quad(
            lambda mean: np.prod(norm.pdf(logs, mean, sizes)), -3, 3, points=logs
        )[0]

    none = density([0.05] * 3)
    each = [density(np.where(np.arange(3) == i, 0.7, 0.05)) for i in range(3)]
    each = np.exp(-mistakes.UNSAID) * np.array(each) / 3
    np.testing.assert_allclose(chances(logs), each / (none + each.sum()), rtol=1e-3)


def test_who_is_told_first_changes_nothing():
    logs = np.array([0.03, -0.02, 0.5, 0.0, 0.01])
    there = chances(logs)
    order = [2, 4, 0, 3, 1]
    np.testing.assert_allclose(chances(logs[order]), there[order], rtol=1e-6)
    assert there.argmax() == 2


@pytest.mark.parametrize("factor", [1 / 8.8, 0.5, 2.0, 10.0])
@pytest.mark.parametrize("spread", [0.01, 0.05])
def test_one_far_outside_is_a_mistake(factor, spread):
    others = spread * norm.ppf((np.arange(5) + 0.5) / 5)
    assert chances([*others, np.log(factor)])[-1] > 0.9


@pytest.mark.parametrize("spread", [0.01, 0.05, 0.2, 0.6])
@pytest.mark.parametrize("count", [4, 6, 12])
def test_specimens_that_scatter_are_none(spread, count):
    scales = spread * norm.ppf((np.arange(count) + 0.5) / count)
    assert chances(scales).sum() < 0.25


def test_of_scales_hardly_known_nothing_is_said():
    """The odds are those of the prior: one case in six."""
    assert chances([0.0, 0.1, -0.1, 0.9], 1e-6).sum() == pytest.approx(
        1 / (1 + np.exp(mistakes.UNSAID)), rel=1e-3
    )


@pytest.mark.parametrize("which", [0, 2, 4])
def test_to_call_a_specimen_wrong_changes_no_stress(which):
    factors = np.array([1.0, 1.02, 0.99, 1.01, 0.98])
    factors[which] = 2.0
    base = baseline(recorded(factors), "pl-wiechert", [(r,) for r in range(5)])
    found = told(base.fit).argmax()
    assert specimens_of(base.fit.guess, 5)[found] == (which,)
    guess = wrong(base.fit.guess, found)
    stress, _ = base.engine.run(guess, False)
    np.testing.assert_allclose(stress, base.fit.stress, rtol=1e-9, atol=1e-12)
    (piece,) = [p for p in guess.pieces if not p.nuisance]
    assert piece.groups == ((which,),)
    assert piece.values["error"][which] == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("which", [0, 2])
def test_a_simulation_from_elsewhere_is_not_rescaled(which):
    factors = np.array([1.0, 1.02, 0.99, 1.01, 0.98])
    factors[which] = 2.0
    simulated = recorded(np.ones(5), seed=1).stress_MPa
    base = given(recorded(factors), simulated, [(r,) for r in range(5)])
    chance = told(base.fit)
    assert chance[0] == 0.0
    found = chance.argmax()
    assert specimens_of(base.fit.guess, 5)[found] == (which,)
    stress, _ = base.engine.run(wrong(base.fit.guess, found), False)
    np.testing.assert_allclose(stress, base.fit.stress, rtol=1e-9, atol=1e-12)


def test_a_specimen_wrong_leaves_scales_over_one_in_the_middle():
    guess = baseline(
        recorded(np.ones(5)), "pl-wiechert", [(r,) for r in range(5)]
    ).fit.guess
    (said,) = guess.pieces
    first, *others = specimens_of(guess, 5)
    error = np.zeros(5)
    for (r,), value in zip(others, (1.0, 3.0, 2.0, 4.0), strict=True):
        error[r] = value
    guess = replace(guess, pieces=(replace(said, values={"error": error}),))
    scaled, error = wrong(guess, 0).pieces
    assert error.groups == (first,)
    # 2 of 1, 2, 3, 4: the lower one of the middle
    assert {*others} - {*scaled.groups} == {others[2]}


def test_a_scale_beyond_its_range_is_not_written_down():
    """Of a specimen that is hardly there nothing is a hundredth."""
    guess = baseline(
        recorded(np.ones(5)), "pl-wiechert", [(r,) for r in range(5)]
    ).fit.guess
    (said,) = guess.pieces
    _, (weak,), *rest = specimens_of(guess, 5)
    error = np.zeros(5)
    error[weak], error[[r for (r,) in rest]] = -0.9, 19.0
    guess = replace(guess, pieces=(replace(said, values={"error": error}),))
    assert allowed(wrong(guess, 1))
    assert not allowed(wrong(guess, 0))


def test_a_mistake_out_of_range_is_no_hypothesis(monkeypatch):
    groups = [(0,), (1,), (2,), (3, 4)]
    base = baseline(recorded((1, 0.06, 1.3, 1.3, 1.3)), "pl-wiechert", groups)
    weak = specimens_of(base.fit.guess, 5).index((1,))
    assert weak != 0  # the scale of 1 is in the middle, and without it 1.3 is
    accounts = [Account(base.fit, Weigher(base.engine, base.fit).weigh(base.fit))]
    before = posterior(accounts)
    for which, there in ((weak, True), (0, False)):
        chance = 0.5 * (np.arange(4) == which)
        monkeypatch.setattr(mistakes, "told", lambda _, chance=chance: chance)
        after = with_mistakes(before, base.engine)
        assert ("gain_error" in after.effects) == there
        assert after.probability.sum() == pytest.approx(1.0)
        assert after.other == pytest.approx(before.other)  # that stays beside it


def test_of_two_specimens_or_none_told_nothing_is_said():
    data = recorded((1, 1, 2, 2, 2))
    for groups in ((), [(0, 1), (2, 3, 4)]):
        assert not len(told(baseline(data, "pl-wiechert", groups).fit))


def specimens(width_typed, terms=(), noise=0.002):
    """Four strips 10.25 mm wide that differ by 2 %, one with another width typed."""
    rng = np.random.default_rng(3)
    chunk = histories()[3]
    (clean,) = simulate(UNITS, STIFFNESS, list(terms), [chunk])
    out = []
    for i, own in enumerate((1.0, 0.98, 1.02, 1.01)):
        stress = own * clean + noise * rng.standard_normal(len(clean))
        stress *= 10.25 / width_typed if i == 1 else 1.0
        out.append(
            Recording(
                chunk.time_s, chunk.strain, stress, name=f"r{i}", specimen=f"strip {i}"
            )
        )
    return out


@pytest.mark.parametrize("width", [90.25, 1.025])
def test_a_width_typed_wrong_is_named_with_its_factor(width):
    found = softnn.diagnose(specimens(width), "pl-wiechert")
    assert found.selected == ["gain_error"]
    (said,) = found.result["explanations"]
    assert said["recordings"] == ["r1"]
    error = said["parameters"]["error of r1"]
    assert 1 + error["value"] == pytest.approx(10.25 / width, rel=0.08)
    # Specimens have scales of their own, so the error never was large.
    assert found.verdict == "good_enough"
    assert f"The stress of r1 is {1 + error['value']:.3g} times that" in found.summary
    assert "cross-section" in found.result["answer"]["next"]


def test_the_width_is_named_beside_what_the_material_does():
    found = softnn.diagnose(specimens(20.5, [mullins()]), "pl-wiechert")
    assert set(found.selected) == {"gain_error", "mullins_softening"}
    assert "The stress of r1 is 0.49 times" in found.summary


def test_a_specimen_is_named_where_no_material_can_be_told():
    """On first loading a spring that bends may be anything; a width is still wrong."""
    rng = np.random.default_rng(4)
    time = np.linspace(0.0, 30.0, 400)
    strain = 0.02 * time
    out = []
    for i, own in enumerate((1.0, 0.5, 1.02, 1.01)):
        stress = own * strain * (1 + 2 * strain) + 0.002 * rng.standard_normal(400)
        out.append(Recording(time, strain, stress, name=f"r{i}", specimen=f"strip {i}"))
    found = softnn.diagnose(out, "hooke")
    likely = {e for e, p in found.probability.items() if p >= 0.5}
    assert likely > {"gain_error"}  # and what bends, which may not be named
    assert found.selected == ["gain_error"]
    assert found.result["corrected_by"] == ["gain_error"]
    assert "The stress of r1 is 0.5 times" in found.summary


def test_specimens_told_that_differ_by_little_have_nothing_missing():
    assert softnn.diagnose(specimens(10.25), "pl-wiechert").selected == []
