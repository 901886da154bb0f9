"""Laws that are wrong, as laws of real materials are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_hands import a_setup

from bench.hands import bending
from bench.hands.drawing import draw
from bench.hands.families import DEVELOPMENT
from bench.hands.orders import LAWS
from bench.hands.testing import Act, simulate


def test_bends_bend_and_none_bends_nothing():
    rng = np.random.default_rng(3)
    time, e = np.linspace(0, 20, 400), np.abs(np.sin(np.linspace(0, 9, 400)))
    change = 0.1 * e**2
    most = float(change.max())
    none = bending.Bend(0.0, 0.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(none(change, most, e, 1.0, time), change)
    # A power of the size alone, by hand.
    sized = replace(none, size=0.5)(change, most, e, 1.0, time)
    small = bending.SMALL
    by_hand = change * np.sqrt((change / most + small) / (1 + small))
    np.testing.assert_allclose(sized, np.maximum(by_hand, bending.LOW * change))
    # What is late arrives late: it lags at the first rise, and all of it in the end.
    late = replace(none, late=1.0, lag_s=0.5)
    step = np.where(time > 5, 1.0, 0.0)
    assert late(step, 1.0, step, 1.0, time)[102] < 0.5
    assert late(step, 1.0, step, 1.0, time)[-1] == pytest.approx(1.0)
    law = replace(LAWS[0], stage="material")
    sizes = [bending.draw_bend(rng, 0.3, 1.0).size for _ in range(400)]
    assert np.std(sizes) == pytest.approx(0.3, rel=0.1)
    machine = replace(law, stage="sensor")
    setup = SimpleNamespace(pace_s=1.0, model="wiechert")
    drawn = [bending.Bends.draw(rng, [law, machine], setup) for _ in range(300)]
    spread = np.std([[b.size for b in d.laws] for d in drawn], axis=0)
    assert spread[0] / spread[1] == pytest.approx(10, rel=0.25)
    # A straight base takes no curve: that would be an effect.
    assert {(d.bare.size, d.bare.strain) for d in drawn} == {(0.0, 0.0)}


def test_a_law_is_as_wrong_in_what_is_held_as_in_what_was_recorded():
    time = np.linspace(0, 20, 400)
    e = np.abs(np.sin(time / 2))
    setup = a_setup(time, e, 0.5 * e, 0.5 * e)
    setup.n, setup.factors = 2, np.ones(2)
    law = Act(limit=1.0, extra=lambda run, e, stress, a: a * e**2)
    bend = bending.Bend(0.5, 0.0, 0.0, 0.0, 1.0)
    bends = bending.Bends(replace(bend, size=0.0), (bend,))
    _, seen = bending.simulate_bent(setup, [(law, 0.1)], bends)
    (unseen,) = bending.simulate_bent(setup, [(law, 0.1)], bends, held=True)
    np.testing.assert_allclose(unseen, seen)
    plain = simulate(setup, [(law, 0.1)])[1]
    assert np.abs(seen - plain).max() > 0.005


@pytest.mark.parametrize("index", range(3))
def test_wrong_laws_of_one_to_three_effects(index):
    case = draw(4, index, "bent", DEVELOPMENT)
    assert len({law.effect for law in case.laws}) == len(case.laws) == index + 1
    told = case.energies
    assert told["energy_of_bare_bent"] < 0.1 * min(told["energy_alone"].values())
    unbent = simulate(case.setup, case.planted)
    changed = [b - u for b, u in zip(case.stress(), unbent, strict=True)]
    assert max(float(np.abs(c).max()) for c in changed) > 0
    fresh = replace(case, bends=None)
    for a, b in zip(fresh.stress(), unbent, strict=True):
        np.testing.assert_array_equal(a, b)
    held = case.stress(held=True)
    assert len(held) == len(case.setup.courses) - case.setup.n
