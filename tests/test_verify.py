"""Intervals against a profile walked step by step; equivalents by making anew."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from test_forms import BASE, fitted, recorded, recorded_scales

from softnn.effects import effect
from softnn.fit import Engine, fit
from softnn.mismatch import verify
from softnn.mismatch.contest import Rival, score
from softnn.mismatch.diagnosis import equivalent
from softnn.mismatch.explain import Explanation

SIGMA = 2e-3


def engine_for(law, values):
    data = recorded(law, values, SIGMA)
    return Engine(data, [np.full(600, SIGMA)] * 3, [0.0] * 3)


@pytest.mark.parametrize(("law", "name"), [("mullins_softening", "scale")])
def test_interval_is_that_of_the_profile(law, name):
    one = effect(law)
    values = one.defaults() | dict(one.starts(recorded_scales())[0])
    engine = engine_for(law, values)
    free = tuple(p.name for p in one.parameters if p.name not in one.shape)
    found = fitted(engine, law, values, free)
    low, high = verify.profiled(engine, found, 0, name, verify.intervals(found))

    def cost(value):
        piece = found.guess.pieces[0]
        held = replace(
            piece,
            values=piece.values | {name: value},
            free=tuple(f for f in free if f != name),
        )
        guess = replace(found.guess, pieces=(held,))
        return fit(engine, guess, iterations=15).chi2 - found.chi2 - 1.96**2

    best = float(found.guess.pieces[0].values[name])
    assert low < best < high
    assert low == pytest.approx(brentq(cost, 0.6 * best, best), rel=0.03)
    assert high == pytest.approx(brentq(cost, best, 1.7 * best), rel=0.03)


def explained(engine, own, rivals):
    class Base:
        pass

    base = Base()
    base.engine = engine
    return Explanation(base, [], own, [], 15.0, 1.0, 0.0, 0.0, rivals, [])


def test_a_flow_law_is_equivalent_to_the_branch_it_contains():
    law = effect("relaxation_branch")
    values = law.defaults() | dict(law.starts(recorded_scales())[0])
    engine = engine_for("relaxation_branch", values)
    branch = fitted(engine, "relaxation_branch", values)
    flow = effect("nonlinear_viscosity")
    # Far below its threshold an Eyring element is linear.
    start = {
        "stiffness_MPa": values[law.amplitude],
        "time_s": next(v for k, v in values.items() if "time" in k),
        "threshold": 9.0,
    }
    rivals = [
        Rival("relaxation_branch", branch, 0.0),
        Rival("nonlinear_viscosity", fitted(engine, flow.id, start), 0.0),
        Rival("mullins_softening", fitted(engine, "mullins_softening", {}), 0.0),
    ]
    found = explained(engine, branch, rivals)
    assert equivalent(found, rivals, law) == ["nonlinear_viscosity"]


def test_the_measured_stress_is_back_after_making_anew():
    law = effect("mullins_softening")
    engine = engine_for(law.id, law.defaults() | dict(law.starts(recorded_scales())[0]))
    before = engine.target
    with engine.made_by(np.zeros_like(before)):
        assert not engine.target.any()
    assert engine.target is before
    assert BASE.segments == 1


def test_a_stranger_must_leave_little_itself():
    law = effect("relaxation_branch")
    values = law.defaults() | dict(law.starts(recorded_scales())[0])
    engine = engine_for("relaxation_branch", values)
    right = fitted(engine, "relaxation_branch", values)
    wrong = fitted(engine, "mullins_softening", {})
    n = len(engine.target)
    poor = explained(engine, wrong, [])
    poor.excess_after = wrong.chi2 / n - 1
    poor.strangers = [Rival("wear", right, 0.0)]
    assert poor.odds_of_strangers > 1e3
    # Better than what was named, and wrong by more than half of it.
    less = 0.2 * right.chi2 + 0.8 * wrong.chi2
    poor.strangers = [Rival("wear", replace(right, chi2=less), 0.0)]
    assert score(poor.strangers[0].fit) < score(wrong) - 100
    assert poor.odds_of_strangers == 0.0
