"""A scan marks what noise does not explain; regions are told in their own units."""

import numpy as np
import pytest

from softnn.axes import COMPONENTS, SPECIMEN
from softnn.contracts import Chunk
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.locate import regions, scan
from softnn.models.units import Units

SIGMA, N = 0.01, 400
BUMP = slice(N + 250, N + 314)  # on the way back of the second recording
# Of three standard deviations. No spring takes up what goes up and down: the fit stays.
UP, UP_DOWN = np.full(64, 3.0), np.repeat([3.0, -3.0], 32)


def engine_of(seed, bump=0.0):
    """Two triangles of a spring of 2 MPa, in white noise, and a bump in the second."""
    time = np.linspace(0, 40, N)
    chunk = Chunk(time, 0.5 * (1 - np.abs(time / 20 - 1)))
    noise = SIGMA * np.random.default_rng(seed).standard_normal((2, N))
    noise.reshape(-1)[BUMP] += bump * SIGMA
    stress = tuple(2 * chunk.strain + e for e in noise)
    data = Data(("first", "second"), (chunk, chunk), stress)
    return Engine(data, [np.full(N, SIGMA)] * 2)


def scanned(seed, bump=0.0):
    engine = engine_of(seed, bump)
    base = fit(engine, Guess(Units("hooke", (0.0, 1.0)), np.ones(1)))
    return engine, base, scan(engine, base, np.random.default_rng(seed))


def test_noise_alone_is_marked_in_one_case_of_twenty():
    marked = sum(scanned(seed)[2].any() for seed in range(20))
    assert marked <= 4  # more than that has a chance of 0.003 at 5 %


def test_a_bump_is_marked_in_its_recording_alone():
    _, _, mask = scanned(1, UP_DOWN)
    assert mask[BUMP].mean() > 0.9
    assert not mask[:N].any()


@pytest.mark.parametrize("axes", [SPECIMEN, COMPONENTS[1].counted(0.5, 9.0)])
def test_a_region_is_told_in_the_units_of_the_recording(axes):
    engine, base, _ = scanned(1, UP)
    mask = np.zeros(2 * N, bool)
    mask[BUMP] = True
    (one,) = regions(engine, mask, engine.target - base.stress, axes)
    assert (one["recording"], one["branch"], one["cycle"]) == ("second", "unloading", 1)
    assert one["sign"] == "simulation too soft"
    assert one["share"] == pytest.approx(1.0)
    strain = engine.chunks[1].strain[BUMP.start - N : BUMP.stop - N] * axes.strain.one
    assert one[axes.strain.column] == pytest.approx([strain.min(), strain.max()])
    # 0.5 of strain in 20 s, all the way back.
    rate = -0.025 * axes.strain.one
    assert one[axes.rate_key] == pytest.approx([rate, rate])


def test_too_few_samples_for_any_window_are_not_marked():
    time = np.arange(5.0)
    data = Data(("few",), (Chunk(time, time / 10),), (time,))
    engine = Engine(data, [np.full(5, SIGMA)])
    base = fit(engine, Guess(Units("hooke", (0.0, 1.0)), np.ones(1)))
    assert not scan(engine, base, np.random.default_rng(0)).any()
