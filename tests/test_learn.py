"""What no effect explains is learned: on what it depends, and with which period."""

from types import SimpleNamespace

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import diagnose
from softnn.mismatch.learn import kinds, learn, period
from softnn.model_file import Correction
from softnn.models.units import Units
from softnn.recording import Recording

HOOKE = Units("hooke", (0.0, 1.0))
SIGMA = 0.005


def recordings(extra, seed=0):
    """Three triangles of different rate; `extra(time, strain)` on top of 2 MPa."""
    rng = np.random.default_rng(seed)
    out = []
    for i, (peak, seconds) in enumerate(((0.4, 40.0), (0.6, 25.0), (0.5, 60.0))):
        time = np.arange(0, seconds, 0.1)
        strain = peak * np.abs((4 * time / seconds + 1) % 2 - 1)
        strain = peak - strain
        stress = 2 * strain + extra(time, strain)
        stress += SIGMA * rng.standard_normal(len(time))
        out.append(Recording(time, strain, stress, name=f"r{i}"))
    return out


def engine_of(found):
    chunks = tuple(Chunk(r.time_s, r.strain) for r in found)
    data = Data(
        tuple(r.name for r in found), chunks, tuple(r.stress_MPa for r in found)
    )
    return Engine(data, [np.full(len(r), SIGMA) for r in found])


@pytest.mark.parametrize("seconds", [1.3, 3.7])
def test_period_in_time_is_found(seconds):
    found = recordings(lambda t, e: 0.03 * np.sin(2 * np.pi * t / seconds))
    engine = engine_of(found)
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    told = period(engine, base.residual, np.random.default_rng(1))
    assert told is not None
    assert told["axis"] == "time"
    assert told["period"] == pytest.approx(seconds, rel=0.03)


def test_period_in_strain_is_found():
    found = recordings(lambda t, e: 0.03 * np.sin(2 * np.pi * e / 0.05))
    engine = engine_of(found)
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    told = period(engine, base.residual, np.random.default_rng(1))
    assert told is not None
    assert told["axis"] == "strain"
    assert told["period"] == pytest.approx(0.05, rel=0.05)


def test_noise_has_no_period():
    engine = engine_of(recordings(lambda t, e: 0 * t))
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    assert period(engine, base.residual, np.random.default_rng(1)) is None


def test_what_it_depends_on_is_named():
    # More on the way up than on the way down: direction carries it, together with
    # strain, and time or travel do not.
    def lifted(time, strain):
        return 0.1 * np.sign(np.gradient(strain))

    engine = engine_of(recordings(lifted))
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    told = learn(engine, base, np.random.default_rng(1))
    assert told is not None
    assert told.ratio < 0.4
    assert told.correction is not None
    assert max(told.importance, key=told.importance.get) == "direction"


def test_what_foretells_nothing_is_told_and_corrects_nothing():
    # A hum is no function of the state: its period is found, and no network helps.
    hum = recordings(lambda t, e: 0.06 * np.sin(2 * np.pi * t / 1.3))
    engine = engine_of(hum)
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    told = learn(engine, base, np.random.default_rng(1))
    assert told is not None
    assert told.ratio > 0.97
    assert told.period["period"] == pytest.approx(1.3, rel=0.03)
    assert told.correction is None


def test_a_correction_does_not_leave_what_it_has_seen():
    seen = SimpleNamespace(low=np.array([-1.0]), high=np.array([2.0]))
    stress = SimpleNamespace(low=-3.0, high=4.0)
    steep = SimpleNamespace(inputs=seen, target=stress, predict=lambda x: 2.5 * x[:, 0])
    told = Correction(("strain",), steep).at(np.array([[-9.0], [0.5], [9.0]]))
    np.testing.assert_allclose(told, [-2.5, 1.25, 4.0])


def test_an_unknown_disturbance_is_not_explained_away():
    hum = recordings(lambda t, e: 0.06 * np.sin(2 * np.pi * t / 2.9))
    told = diagnose(Case("hum", tuple(hum)), "hooke").result
    assert told["verdict"] == "unexplained"
    assert told["selected"] == []
    assert told["structure"]["period"]["period"] == pytest.approx(2.9, rel=0.03)


def test_a_replicate_is_of_a_kind_with_what_it_repeats():
    # What follows the rate is the same in replicates, and foretells no other rate.
    def programme(peak, seconds):
        time = np.arange(0, seconds, 0.1)
        return Chunk(time, peak * (1 - np.abs(2 * time / seconds - 1)))

    def engine(*programmes):
        chunks = tuple(programme(*p) for p in programmes)
        stress = tuple(c.strain for c in chunks)
        names = tuple(f"r{i}" for i in range(len(chunks)))
        sigma = [np.full(len(s), SIGMA) for s in stress]
        return Engine(Data(names, chunks, stress), sigma)

    def found(*programmes):
        made = engine(*programmes)
        kind = kinds(made)
        return [int(kind[made.owner == r][0]) for r in range(len(programmes))]

    assert found((0.4, 40), (0.4, 10), (0.41, 41), (0.4, 10)) == [0, 1, 0, 1]
    assert found((0.4, 40), (0.8, 80)) == [0, 1]  # as fast, and twice as far
    assert found((0.4, 40), (0.4, 41)) == [0, 1]  # of one kind: each its own


def test_a_twin_is_no_other_recording():
    # Too stiff when fast and too soft when slow: twins foretell each other alone.
    rng = np.random.default_rng(0)
    found = []
    for i, (seconds, more) in enumerate(((40, -0.3), (10, 0.3)) * 2):
        time = np.arange(0, seconds, 0.1)
        strain = 0.4 * (1 - np.abs(2 * time / seconds - 1))
        stress = (2 + more) * strain + SIGMA * rng.standard_normal(len(time))
        found.append(Recording(time, strain, stress, name=f"r{i}"))
    engine = engine_of(found)
    base = fit(engine, Guess(HOOKE, np.ones(1)))
    told = learn(engine, base, np.random.default_rng(1))
    assert told is None or told.correction is None
