"""Recordings of one programme against each other, whatever the material does."""

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.effects import EFFECTS
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.base import nuisance, units_for
from softnn.mismatch.siblings import odd_ones, shared, siblings

AMPLITUDES = (0.50, 0.52, 0.49, 0.51, 0.50)


def programme(amplitude, speed=0.25, cycles=3):
    levels = np.array([0.0, *[amplitude, 0.0] * cycles])
    corners = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)) / speed)])
    time = np.arange(0, corners[-1], 0.03)
    return Chunk(time, np.interp(time, corners, levels))


def recorded(odd=None, change=lambda chunk, stress: (chunk, stress)):
    """Replicates of a foam that no law here describes; each with a scale of its own."""
    rng = np.random.default_rng(3)
    chunks, stress = [], []
    for i, amplitude in enumerate(AMPLITUDES):
        chunk = programme(amplitude)
        strain, time = chunk.strain, chunk.time_s
        up = np.gradient(strain) > 0
        own = np.where(up, strain * (1 + 2 * strain), 3 * strain**2)
        own = own * (1 + 0.15 * np.exp(-time / 3)) * rng.uniform(0.85, 1.15)
        if i in (odd or ()):
            chunk, own = change(chunk, own)
        chunks.append(chunk)
        stress.append(own + 0.002 * rng.standard_normal(len(own)))
    return Data(tuple(f"r{i}" for i in range(5)), tuple(chunks), tuple(stress))


def fitted(data):
    engine = Engine(data)
    units = units_for("pl-wiechert", data)
    pieces = nuisance(data, [(i,) for i in range(5)])
    return engine, fit(engine, Guess(units, np.zeros(units.columns), pieces))


def offset(chunk, stress):
    return chunk, stress + 0.06 * stress.max()


def gap(chunk, stress):
    """The machine counts 0.05 of strain before the specimen is taut."""
    lead = np.arange(0, 0.05, 0.0075)
    time = np.concatenate([lead / 0.25, chunk.time_s + 0.2])
    strain = np.concatenate([lead, chunk.strain + 0.05])
    return Chunk(time, strain), np.concatenate([np.zeros(len(lead)), stress])


@pytest.mark.parametrize(
    ("effect", "change"), [("zero_offset", offset), ("slack", gap)]
)
def test_what_sets_some_apart_is_found_in_those(effect, change):
    engine, found = fitted(recorded((1, 3), change))
    piece = odd_ones(engine, found, EFFECTS)
    assert piece is not None
    assert piece.effect.id == effect
    assert piece.groups == ((1,), (3,))


def test_replicates_that_differ_in_scale_alone_are_not_out_of_line():
    engine, found = fitted(recorded())
    assert found.chi2 > 50 * 0.002**2 * len(found.residual)  # the law misses much
    assert odd_ones(engine, found, EFFECTS) is None


def test_siblings_have_one_programme():
    chunks = [programme(a) for a in (0.5, 0.52, 0.5)]
    chunks += [programme(0.5, cycles=5), programme(0.5, speed=0.05), programme(0.25)]
    stress = tuple(c.strain for c in chunks)
    data = Data(tuple("abcdef"), tuple(chunks), stress)
    assert siblings(Engine(data)).tolist() == [0, 1, 2]


def test_what_depends_on_the_place_in_the_programme_is_shared():
    data = recorded()
    engine = Engine(data)
    columns = shared(engine, np.arange(5))
    way = [c.strain / c.strain.max() for c in data.chunks]
    smooth = np.concatenate([w**2 - w for w in way])
    own = np.where(engine.owner == 2, smooth, 0.0)
    for target, left in ((smooth, 0.01), (own, 0.5)):
        x = np.linalg.lstsq(columns, target, rcond=None)[0]
        miss = np.linalg.norm(target - columns @ x) / np.linalg.norm(target)
        assert (miss < left) == (left < 0.1)
