"""The evidence of a set of effects against the textbook's, with dense covariances."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.fit import Data, Engine, Guess, Piece, fit
from softnn.mismatch import evidence
from softnn.mismatch.discrepancy import trailing
from softnn.mismatch.evidence import Weigher, changes, climb, gained
from softnn.mismatch.specimens import UNSAID
from softnn.models.units import Units

HOOKE = Units("hooke", (0.0, 1.0))
SIGMA, SHARE, TAU = 0.02, 0.7, 0.6  # of the noise: level, share that remembers, time
N = 60


def engine(seed=0, memory=((SHARE, TAU),)):
    """Two short recordings of a spring, at uneven times, in coloured noise."""
    rng = np.random.default_rng(seed)
    chunks, stress = [], []
    for peak in (0.4, 0.6):
        time = np.cumsum(rng.uniform(0.05, 0.3, N))
        strain = peak * np.sin(time / time[-1] * np.pi)
        chunks.append(Chunk(time, strain))
        stress.append(2 * strain + SIGMA * rng.standard_normal(N))
    made = Engine(Data(("a", "b"), tuple(chunks), tuple(stress)))
    made.set_noise([np.full(N, SIGMA)] * 2, [memory] * 2)
    return made


def covariance(made, share=SHARE):
    """Of the noise of both recordings, one independent of the other (valid, valid)."""
    time = np.concatenate([c.time_s for c in made.chunks])
    apart = np.abs(time[:, None] - time)
    same = made.owner[:, None] == made.owner
    dense = same * share * np.exp(-apart / TAU)
    return SIGMA**2 * (dense + (1 - share) * np.eye(len(time)))


def log_density(made, residual):
    white = made.whiten(residual)
    n = len(residual)
    return made.log_norm - 0.5 * n * np.log(2 * np.pi) - 0.5 * white @ white


@pytest.mark.parametrize("share", [0.0, 0.7, 1.0])
def test_density_of_what_is_whitened_is_that_of_the_noise(share):
    made = engine(memory=((share, TAU),) if share else ())
    residual = made.target
    expected = multivariate_normal.logpdf(residual, cov=covariance(made, share))
    assert log_density(made, residual) == pytest.approx(expected, rel=1e-9)


def test_weights_integrated_out_add_to_the_covariance():
    made = engine()
    rng = np.random.default_rng(1)
    columns, scale = rng.standard_normal((2 * N, 7)), rng.uniform(0.01, 0.1, 7)
    scale[3] = 0.0
    residual = made.target - 1.9 * np.concatenate([c.strain for c in made.chunks])
    white, left = made.whiten(columns), made.whiten(residual)
    made_by = gained(white.T @ white, white.T @ left, scale)
    whole = covariance(made) + (columns * scale**2) @ columns.T
    expected = multivariate_normal.logpdf(residual, cov=whole)
    assert log_density(made, residual) + made_by == pytest.approx(expected, rel=1e-9)


def test_nothing_is_gained_by_weights_of_no_size():
    gram = np.eye(3)
    assert gained(gram, np.ones(3), np.zeros(3)) == 0.0
    # One of no size beside another changes nothing either.
    one = gained(gram[:1, :1], np.ones(1), np.array([0.3]))
    assert gained(gram, np.ones(3), np.array([0.3, 0, 0])) == pytest.approx(one)


def offset(made, free=()):
    law = effect("zero_offset")
    piece = Piece(law, {"offset_MPa": np.array([0.0, 0.05])}, free, ((1,),))
    return Guess(HOOKE, np.array([2.0]), (piece,))


@pytest.fixture
def normal(monkeypatch):
    """No sample is off by more than noise: evidence is the textbook's."""
    monkeypatch.setattr(evidence, "MOST", 0.0)


@pytest.mark.usefixtures("normal")
@pytest.mark.parametrize("c", [0.005, 0.02])
def test_evidence_of_an_account_is_the_density_of_its_residual(monkeypatch, c):
    made = engine()
    base = fit(made, Guess(HOOKE, np.array([2.0])), fixed_base=True)
    found = fit(made, offset(made), fixed_base=True)  # nothing free: none projected
    weigher = Weigher(made, base)
    assert weigher.unseen.shape == (2 * N, 0)  # there is no gap
    tau, a, b, *_ = scales = (0.2, 0.01, 0.02, c, 0.0)
    monkeypatch.setattr(evidence, "GRIDS", tuple((s,) for s in scales))
    dense = covariance(made)
    (change,) = changes(made, found)
    for size, columns in (
        (tau, weigher.bent(change)),
        (a, weigher.shared),
        (b, weigher.stiffer),
        (c, weigher.own),
    ):
        dense = dense + size**2 * columns @ columns.T
    residual = made.target - found.stress
    expected = multivariate_normal.logpdf(residual, cov=dense)
    expected -= 0.5 * (tau / evidence.FORM_PRIOR) ** 2
    wander = 0.5 * (c / evidence.ELSE_PRIOR) ** 2  # but what no machine has is free
    own = wander * (c <= evidence.CLASS)
    told = weigher.weigh(found)
    assert told.beside == pytest.approx(expected - own, rel=1e-6)
    slight = 0.5 * (a**2 + b**2) / evidence.ELSE_PRIOR**2 + wander - own
    assert told.alone == pytest.approx(told.beside - slight, rel=1e-9)


def one_scaled(made, **kind):
    """The second recording scaled; density of both with that variance beside noise."""
    law = effect("gain_error")
    off = {k: np.full(2, v) for k, v in law.off.items()}
    piece = Piece(law, off, tuple(off), ((1,),), **kind)
    found = fit(made, Guess(HOOKE, np.array([2.0]), (piece,)), fixed_base=True)
    assert abs(found.guess.pieces[0].values["error"][1]) > 1e-5
    plain = 2 * np.concatenate([c.strain for c in made.chunks])
    column = plain * (made.owner == 1)

    def density(variance):
        dense = covariance(made) + variance * np.outer(column, column)
        return multivariate_normal.logpdf(made.target - plain, cov=dense)

    return found, density


@pytest.mark.usefixtures("normal")
def test_specimens_nobody_named_differ_each_from_a_mean_of_all(monkeypatch):
    made, apart = engine(), 0.03
    found, density = one_scaled(made, nuisance=True, unsaid=True)
    monkeypatch.setattr(evidence, "GRIDS", ((0.0,),) * 4 + ((apart,) * 3, (0.0,)))
    told = Weigher(made, found).weigh(found)
    # The second over the first, both of them off the mean: twice the variance.
    expected = density(2 * apart**2)
    expected -= 0.5 * (apart / evidence.SCATTER_PRIOR) ** 2 + UNSAID
    assert told.alone == pytest.approx(expected, rel=1e-5)
    assert told.numbers == 0  # no news


@pytest.mark.usefixtures("normal")
def test_a_scale_that_is_a_mistake_is_weighed_by_its_own_prior(monkeypatch):
    made, size = engine(), 0.3
    found, density = one_scaled(made)
    monkeypatch.setattr(evidence, "GRIDS", ((0.0,),) * 5 + ((size,),))
    told = Weigher(made, found).weigh(found)
    either = np.log(2)  # of the two may be the wrong one
    assert told.bare == pytest.approx(density(size**2) - either, rel=1e-5)
    assert told.numbers == 0  # paid for by the prior


def test_what_a_gap_leaves_is_projected_out():
    """A memory that fades at a pace of the base after a gap counts for nothing."""
    made = engine()
    late = made.chunks[1].time_s + 40.0 * (np.arange(N) >= 30)
    chunks = (made.chunks[0], Chunk(late, made.chunks[1].strain))
    data = Data(("a", "b"), chunks, made.data.stress_MPa)
    units = Units("wiechert", (0.0, 1.0), (0.5, 3.0))
    forgot = np.exp(-(late - late[30]) / 3.0) * (np.arange(N) >= 30)
    told = []
    for size in (0.0, 0.4):
        stress = (data.stress_MPa[0], data.stress_MPa[1] + size * forgot)
        one = Engine(Data(("a", "b"), chunks, stress))
        one.set_noise([np.full(N, SIGMA)] * 2, None)
        base = fit(one, Guess(units, np.array([2.0, 0.1, 0.1])), fixed_base=True)
        told.append(Weigher(one, base).weigh(base).bare)
    assert told[1] == pytest.approx(told[0], rel=1e-6)


@pytest.mark.usefixtures("normal")
def test_without_form_error_and_discrepancy_it_is_the_profile_likelihood(monkeypatch):
    monkeypatch.setattr(evidence, "GRIDS", ((0.0,),) * len(evidence.GRIDS))
    made = engine()
    base = fit(made, Guess(HOOKE, np.ones(1)))
    found = fit(made, offset(made, ("offset_MPa",)))
    told = Weigher(made, base).weigh(found)
    assert told.alone == told.beside
    assert told.numbers == 1
    # Stiffness and offset at their best: generalised least squares, by hand.
    strain = np.concatenate([c.strain for c in made.chunks])
    x = np.column_stack([strain, made.owner == 1])
    inverse = np.linalg.inv(covariance(made))
    best = np.linalg.solve(x.T @ inverse @ x, x.T @ inverse @ made.target)
    expected = multivariate_normal.logpdf(made.target, x @ best, covariance(made))
    assert told.alone == pytest.approx(expected, rel=1e-6)


def test_the_base_alone_is_never_worse_off_for_what_else_there_may_be():
    made = engine()
    base = fit(made, Guess(HOOKE, np.ones(1)))
    told = Weigher(made, base).weigh(base)
    plain = log_density(made, made.target - base.stress)
    assert told.beside >= told.alone >= plain - 1e-6
    assert told.form == 0.0  # there is no effect that could be bent


def test_something_smooth_that_is_not_in_the_base_is_seen_beside():
    made = engine()
    strain = np.concatenate([c.strain for c in made.chunks])
    made.target = made.target + 2.0 * strain**3
    base = fit(made, Guess(HOOKE, np.ones(1)))
    told = Weigher(made, base).weigh(base)
    assert told.beside_size > 0
    assert told.beside > log_density(made, made.target - base.stress) + 10


@pytest.mark.parametrize("seed", range(4))
def test_climbing_ends_on_the_one_top_of_a_smooth_hill(seed):
    rng = np.random.default_rng(seed)
    top = [int(rng.integers(len(g))) for g in evidence.GRIDS]

    def value(scales):
        place = [g.index(s) for g, s in zip(evidence.GRIDS, scales, strict=True)]
        return -float(np.sum((np.array(place) - top) ** 2))

    nothing, every = [0] * len(top), range(len(top))
    assert climb(value, nothing, every) == (top, 0.0)
    # Without a form error to move, its coordinate stays where it is.
    place, height = climb(value, nothing, every[1:])
    assert place == [0, *top[1:]]
    assert height == -(top[0] ** 2)


def test_what_trails_is_the_exponential_of_its_own_recording():
    time = np.tile(0.1 * np.arange(50), 2)
    owner = np.repeat([0, 1], 50)
    x = np.where(time > 0.95, 1.0, 0.0) * (1 + owner)
    late = trailing(x, time, owner, 0.5)
    since = np.maximum(np.round((time - 0.9) / 0.1), 0)
    expected = (1 + owner) * (1 - np.exp(-0.1 * since / 0.5))
    np.testing.assert_allclose(late, expected, atol=1e-12)


def test_a_moment_pays_for_two_numbers():
    made = engine()
    law = effect("grip_slip")
    values = law.defaults() | {
        "slip": np.array([0.0, 0.05]),
        "moment_s": np.full(2, 3.0),
    }
    free = ("slip", "moment_s")
    for names, expected in ((("slip",), 1), (free, 3), ((*free, "duration_s"), 4)):
        piece = Piece(law, values, names, ((1,),))
        found = fit(made, Guess(HOOKE, np.array([2.0]), (piece,)), iterations=0)
        assert Weigher(made, found).weigh(found).numbers == expected


def test_what_wanders_more_than_a_machine_is_something_else(monkeypatch):
    in_time = ((0.0,),) * 3 + evidence.GRIDS[3:]
    monkeypatch.setattr(evidence, "GRIDS", in_time)
    made = engine(memory=())
    base = fit(made, Guess(HOOKE, np.array([2.0])), fixed_base=True)
    weigher = Weigher(made, base)
    quiet = weigher.weigh(base)
    clock = np.concatenate([c.time_s / c.time_s[-1] for c in made.chunks])
    own = np.cos(3 * np.pi * clock) * (made.owner == 1)
    for size, seen in ((0.1, True), (0.002, False)):
        there = replace(
            base, residual=base.residual + made.whiten(size * made.level * own)
        )
        told = weigher.weigh(there)
        assert (told.beside - told.alone > quiet.beside - quiet.alone + 20) == seen
