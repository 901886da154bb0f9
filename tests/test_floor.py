"""The floor: by how much replicates differ, and what does not count as a difference."""

from dataclasses import replace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight

from softnn.fit import Data, Engine, Guess
from softnn.mismatch.floor import floor
from softnn.simulate import simulate

PATH = [0, 0.5, 0.05, 0.9, 0]
GUESS = Guess(UNITS, STIFFNESS)


def engine(change, count=4, rates=None):
    """Replicates; `change` maps a clean stress (n,), its time and its index."""
    rates = rates or [0.1] * count
    chunks = tuple(straight(PATH, rate, 0.05) for rate in rates)
    clean = simulate(UNITS, STIFFNESS, [], chunks)
    stress = [
        change(s, c.time_s, i)
        for i, (s, c) in enumerate(zip(clean, chunks, strict=True))
    ]
    names = tuple(f"r{i}" for i in range(count))
    return Engine(Data(names, chunks, tuple(stress)))


def test_scales_of_specimens_are_no_difference_and_of_one_specimen_they_are():
    made = engine(lambda s, t, i: (1 + 0.1 * i) * s)
    assert floor(made, GUESS, specimens=True).nrmse < 1e-3
    assert floor(made, GUESS, specimens=False).nrmse > 0.05


def test_it_is_the_difference_between_a_replicate_and_the_mean_of_the_others():
    """Independent ripples of one size: a mean of three others adds a third."""

    def rippled(s, t, i):
        return s + 0.02 * np.sin((11 + 4 * i) * t + i)

    made = engine(rippled)
    share = made.share
    ripple = 0.02**2 / 2 * (1 + 1 / 3)
    expected = np.sqrt(ripple * share.sum() / (share @ made.target**2))
    found = floor(made, GUESS, specimens=False)
    assert found.nrmse == pytest.approx(expected, rel=0.15)
    assert found.low < found.nrmse < found.high
    assert found.of == "recordings"


def test_what_a_fit_misses_in_all_replicates_cancels():
    made = engine(lambda s, t, i: s * (1 + 0.3 * np.sin(3 * t)))
    assert floor(made, GUESS, specimens=False).nrmse < 1e-6


def test_programmes_that_differ_a_little_are_no_difference_of_specimens():
    made = engine(lambda s, t, i: s, rates=[0.1, 0.104, 0.097, 0.101])
    assert floor(made, GUESS, specimens=False).nrmse < 1e-6


def test_a_tear_ends_the_comparison():
    def torn(s, t, i):
        wavy = s * (1 + 0.3 * np.sin(3 * t))  # cancels where all are measured
        return np.where((i == 2) & (t > 14), np.nan, wavy)

    assert floor(engine(torn), GUESS, specimens=True).nrmse < 1e-6


def test_without_replicates_there_is_none():
    made = engine(lambda s, t, i: s, count=1)
    assert floor(made, GUESS, specimens=True) is None
    other = replace(made.data, chunks=made.data.chunks * 2)
    short = straight([0, 0.2, 0], 0.1, 0.05)
    stress = (made.data.stress_MPa[0], simulate(UNITS, STIFFNESS, [], [short])[0])
    data = Data(("a", "b"), (other.chunks[0], short), stress)
    assert floor(Engine(data), GUESS, specimens=True) is None
