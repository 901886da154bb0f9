"""Networks of histories: their inputs, their bounds, what they can learn."""

import json

import numpy as np
import pandas as pd
import pytest

from softnn import cli
from softnn.contracts import Chunk, InputError
from softnn.models.units import Units
from softnn.neural import (
    BoundedNetwork,
    Scaling,
    Seen,
    StoredNetwork,
    fit_samples,
    samples,
)
from softnn.neural.inputs import HISTORIES
from softnn.neural.recurrent import train_recurrent
from softnn.recording import Recording


def wave(n=400, dt=0.05):
    time = np.arange(n) * dt
    strain = 0.2 - 0.2 * np.cos(time) * np.cos(0.3 * time)
    return time, strain


def law(time, strain):
    """A spring, and a Maxwell branch of a second: a strip that cannot push."""
    _, branch, _ = Units("sls", (0.0, 1.0), (1.0,)).respond(Chunk(time, strain))
    return np.maximum(2 * strain + 3 * branch[:, 0], 0)


def bounded(low=-1.0, high=3.0):
    rng = np.random.default_rng(2)
    inputs = Scaling(np.zeros(7), np.full(7, 0.4))
    target = Scaling(np.array(low), np.array(high))
    return BoundedNetwork(rng.normal(size=(5, 8)), rng.normal(size=6), inputs, target)


def test_inputs_are_strains_of_maxwell_springs():
    """By a second route: unit responses of the piecewise-linear models."""
    time, strain = wave()
    got = samples([Recording(time, strain, strain)], "FFH7", 0.1)
    times = tuple(0.1 * 10**k for k in range(5))
    _, want, _ = Units("wiechert", (0.0, 1.0), times).respond(Chunk(time, strain))
    np.testing.assert_allclose(got.inputs[:, 2:], want, atol=1e-12)
    np.testing.assert_array_equal(got.inputs[:, 1], np.maximum.accumulate(strain))
    assert len(got.names) == HISTORIES["FFH7"].width == 7


@pytest.mark.parametrize(("low", "high", "sign"), [(-1.0, 3.0, 1), (-3.0, 1.0, -1)])
def test_stress_has_one_sign_and_does_not_run_away(low, high, sign):
    net = bounded(low, high)
    x = np.random.default_rng(1).uniform(-5, 5, (2000, 7))
    out = net.predict(x)
    assert (sign * out >= 0).all()
    assert 0 < np.mean(out == 0) < 1
    inside = np.clip(x, 0.0, 0.4)
    np.testing.assert_array_equal(out, net.predict(inside))
    free = super(BoundedNetwork, net).predict(inside)
    np.testing.assert_array_equal(out[sign * free > 0], free[sign * free > 0])


def test_it_learns_a_history_that_strain_and_rate_do_not_tell():
    """Maxwell's branch of a second, judged on another rhythm than it has learned."""
    time, strain = wave()
    known = [
        Recording(time * k, strain, law(time * k, strain)) for k in (0.2, 0.5, 1.0, 3.0)
    ]
    unseen = Recording(0.7 * time, strain, law(0.7 * time, strain))
    error = {}
    for name in ("FFH7", "FFRD4"):
        rows = samples(known, name, 0.01)
        mask = np.ones((1, len(rows.target)), bool)
        (one,) = fit_samples(rows, name, neurons=[6], train_mask=mask, seeds=[0])
        model = StoredNetwork(one.network, name, 0.01)
        (out,) = model.stress([""], [Chunk(unseen.time_s, unseen.strain)], [None])
        error[name] = np.sqrt(np.mean((out - unseen.stress_MPa) ** 2))
        if name == "FFH7":
            assert out.min() >= 0
    assert error["FFH7"] < 0.03 * unseen.stress_MPa.std()
    assert error["FFRD4"] > 3 * error["FFH7"]


def test_simulate_takes_it(tmp_path, capsys):
    model = StoredNetwork(bounded(), "FFH7", 0.01, Seen((0.0, 0.4), (-1.0, 1.0)))
    file, table = tmp_path / "network.json", tmp_path / "walk.csv"
    file.write_text(json.dumps(model.source))
    time, strain = wave()
    pd.DataFrame({"time_s": time, "strain": strain}).to_csv(table, index=False)
    out = str(tmp_path / "out")
    assert cli.main(["simulate", str(file), str(table), "--out", out]) == 0
    got = pd.read_csv(tmp_path / "out" / "walk.csv")["simulated_MPa"]
    (want,) = model.stress([""], [Chunk(time, strain)], [None])
    np.testing.assert_allclose(got, want, rtol=1e-6)
    assert got.min() >= 0


@pytest.mark.slow
def test_a_recurrent_network_learns_a_memory_and_the_same_seed_is_the_same():
    time, strain = wave()
    known = [Recording(time, strain, law(time, strain))]
    how = {"units": 4, "step_s": 0.05, "epochs": 400, "seed": 3}
    one, two = (train_recurrent(known, **how) for _ in range(2))
    stress = one.predict(known[0])
    np.testing.assert_array_equal(stress, two.predict(known[0]))
    true = known[0].stress_MPa
    assert np.sqrt(np.mean((stress - true) ** 2)) < 0.1 * true.std()
    # It looks back, never ahead.
    later = strain.copy()
    later[300:] = 0
    changed = one.predict(Recording(time, later, true))
    np.testing.assert_array_equal(changed[:300], stress[:300])


def test_what_a_recurrent_network_cannot_learn_from_is_refused():
    with pytest.raises(InputError, match="must be above 0"):
        train_recurrent([], units=2, step_s=0.1, epochs=1, seed=0)
