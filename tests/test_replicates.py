"""What one recording has apart from its replicates, whatever laws get wrong."""

from dataclasses import replace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight

from softnn import Recording
from softnn.effects import EFFECTS
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.accounts import search
from softnn.mismatch.base import start
from softnn.mismatch.candidates import refine
from softnn.mismatch.case import Case
from softnn.mismatch.faults import asked, named, on
from softnn.mismatch.posterior import Hypothesis, Posterior
from softnn.mismatch.replicates import (
    POINTS,
    Group,
    Regression,
    Replicates,
    are_specimens,
    independent,
    stand_out,
)
from softnn.mismatch.screen import only, start_pieces

CYCLES = [0, 0.5, 0.1, 0.5, 0]
(SLACK,) = (law for law in EFFECTS if law.id == "slack")


def recordings(programmes, stress, step=0.05, rate=0.1):
    """One a programme, each of the stress that it is given for its strain."""
    chunks = [straight(p, step, rate) for p in programmes]
    values = [stress(i, c) for i, c in enumerate(chunks)]
    names = tuple(f"r{i}" for i in range(len(chunks)))
    return Engine(Data(names, tuple(chunks), tuple(values)))


def noisy(i, chunk):
    rng = np.random.default_rng(i)
    return 2 * chunk.strain + 1e-3 * rng.standard_normal(len(chunk.strain))


def test_replicates_go_through_the_same():
    def of(*programmes):
        return Replicates(recordings(programmes, noisy)).groups

    near = [0, 0.52, 0.1, 0.5, 0]
    assert of(CYCLES, CYCLES, near) == [[0, 1, 2]]
    assert of(CYCLES, [0, 0.9, 0.1, 0.9, 0]) == []  # further
    assert of(CYCLES, CYCLES[:3], CYCLES, near) == [[0, 2, 3]]  # shorter
    assert of(CYCLES, CYCLES) == []  # of two nobody can say which is wrong
    slow = straight(CYCLES, 0.05, 0.1)
    further = replace(slow, strain=1.5 * slow.strain)  # in the same time
    for other in (straight(CYCLES, 0.01, 0.4), further):
        three = slow, slow, other
        data = Data(tuple("abc"), three, tuple(2 * c.strain for c in three))
        assert Replicates(Engine(data)).groups == []


def test_what_has_no_stress_is_no_replicate():
    def stress(i, chunk):
        return np.where(i == 1, np.nan, noisy(i, chunk))

    assert Replicates(recordings([CYCLES] * 4, stress)).groups == [[0, 2, 3]]


def left_of(made, stress):
    """Squares of the differences that a simulation leaves, and how many values."""
    (group,) = (Group(Replicates(made), g, stress, {}) for g in Replicates(made).groups)
    return float((group.left**2).sum()), independent(group.left)


def test_scales_zeros_and_what_all_have_alike_are_no_difference():
    made = recordings([CYCLES] * 3, noisy)
    first = [c.time_s < c.time_s[np.argmax(c.strain)] for c in made.chunks]
    own = np.concatenate(
        [
            0.1 * i + (1 + 0.2 * i + 0.3 * i * fresh) * 2 * c.strain
            for i, (c, fresh) in enumerate(zip(made.chunks, first, strict=True))
        ]
    )
    alike = np.concatenate(
        [np.sin(30 * c.strain) + np.cos(c.time_s) for c in made.chunks]
    )
    usual, many = left_of(made, np.zeros(len(made.target)))
    stretches = len(CYCLES) - 1
    assert usual == pytest.approx(2e-6 * POINTS * stretches, rel=0.5)  # the noise's
    assert many == pytest.approx(2 * POINTS * stretches, rel=0.5)  # each value its own
    for values in (own, alike, own + alike):
        assert left_of(made, values)[0] == pytest.approx(usual, rel=0.02)


@pytest.mark.parametrize("count", [2, 4])
@pytest.mark.parametrize(
    ("by", "different"), [(0.0, False), (0.004, False), (0.05, True), (0.3, True)]
)
def test_replicates_that_differ_by_a_factor_are_different_specimens(
    count, by, different
):
    def stress(i, chunk):
        return noisy(i, chunk) * (1 + by * (-1) ** i) + 0.05 * i  # zeros are no matter

    assert are_specimens(recordings([CYCLES] * count, stress)) is different


def test_what_is_no_factor_is_no_specimen():
    def drifting(i, chunk):
        return noisy(i, chunk) + 0.05 * i * np.sin(2 * chunk.time_s)

    for stress in (gap, drifting):
        assert not are_specimens(recordings([CYCLES] * 4, stress))
    other = [[0, 0.9, 0.1, 0.9, 0], CYCLES, CYCLES[:3]]  # and no replicates, no answer
    assert not are_specimens(recordings(other, lambda i, c: (1 + i) * noisy(i, c)))


def gap(i, chunk):
    """Of one there is slack: a kink near zero, no scale."""
    taut = np.maximum(chunk.strain - 0.05 * (i == 2), 0)
    rng = np.random.default_rng(i)
    return 2 * taut + 2e-3 * rng.standard_normal(len(taut))


def both(i, chunk):
    """One hangs loose, another slips at 3 s."""
    slipped = 0.05 * (i == 3) * np.clip((chunk.time_s - 3.0) / 0.2, 0, 1)
    taut = np.maximum(chunk.strain - 0.05 * (i == 2), 0) - slipped
    rng = np.random.default_rng(i)
    return 2 * taut + 2e-3 * rng.standard_normal(len(taut))


def bent(i, chunk):
    """No fault, in a material that no law here describes."""
    return noisy(i, chunk) * (1 + 0.3 * np.sin(20 * chunk.strain) * chunk.time_s / 9)


def bare(made):
    return fit(made, Guess(UNITS, STIFFNESS), iterations=30)


def found(stress, count=5, **more):
    made = recordings([CYCLES] * count, stress, **more)
    return {f.effect: f for f in stand_out(made, bare(made))}


def test_a_gap_and_a_slip_are_found_together():
    told = found(both)
    assert {k for k, f in told.items() if f.likely} == {"slack", "grip_slip"}
    assert (on(told["slack"].piece), on(told["grip_slip"].piece)) == ({2}, {3})
    gap_, slip = told["slack"].piece.values, told["grip_slip"].piece.values
    assert gap_["gap"][2] == pytest.approx(0.05, rel=0.2)
    assert slip["slip"][3] == pytest.approx(0.05, rel=0.2)
    assert slip["moment_s"][3] == pytest.approx(3.0, abs=0.3)


def test_no_fault_is_seen_in_replicates_of_a_strange_material():
    assert not any(f.likely for f in found(bent).values())


def test_what_all_have_some_have_more_of():
    def loose(i, chunk):
        taut = np.maximum(chunk.strain - 0.04 - 0.05 * (i == 2), 0)
        return 2 * taut + 2e-3 * np.random.default_rng(i).standard_normal(len(taut))

    made = recordings([CYCLES] * 5, loose)
    piece = start_pieces(made, SLACK)[0]
    gaps = piece.values | {"gap": np.full(5, 0.04)}
    start_ = Guess(UNITS, STIFFNESS, (replace(piece, values=gaps),))
    (fault,) = stand_out(made, fit(made, start_, iterations=0))
    assert fault.piece.values["gap"] == pytest.approx(
        [0.04] * 2 + [0.09] + [0.04] * 2, rel=0.2
    )
    assert on(fault.piece) == set(range(5))


def loose(*gaps, noise=5e-4):
    """Replicates that hang loose by so much each, of a largest strain of 0.5."""

    def stress(i, chunk):
        rng = np.random.default_rng(i)
        taut = np.maximum(chunk.strain - gaps[i], 0)
        return 2 * taut + noise * rng.standard_normal(len(taut))

    return found(stress, len(gaps))


def test_a_gap_among_gaps_of_any_size_is_no_fault():
    """A difference is clear in both; one stands out, the other does not."""
    (one,) = loose(0.002, 0.003, 0.05, 0.001, 0.002).values()
    assert one.likely
    (other,) = loose(0.004, 0.012, 0.02, 0.008, 0.016).values()
    assert not other.likely


def test_less_than_strains_are_off_by_is_no_fault():
    assert loose(0.0, 0.0, 0.004, 0.0, 0.0, noise=2e-5) == {}


def test_what_slips_before_it_bears_load_hangs_loose():
    def early(i, chunk):
        slipped = 0.05 * (i == 3) * np.clip((chunk.time_s - 0.7) / 0.2, 0, 1)
        rng = np.random.default_rng(i)
        return 2 * (chunk.strain - slipped) + 2e-3 * rng.standard_normal(len(slipped))

    made = recordings([CYCLES] * 5, early)
    law = next(law for law in EFFECTS if law.id == "grip_slip")
    for fault in stand_out(made, bare(made)):
        if fault.effect == law.id:
            values, data = fault.piece.values, made.data
            may = law.possible(values, data.chunks, data.stress_MPa)
            assert may[sorted(on(fault.piece))].all()


def test_a_specimen_that_bears_no_load_cannot_slip():
    law = next(law for law in EFFECTS if law.id == "grip_slip")
    made = recordings([CYCLES] * 3, gap)
    values = law.defaults() | {"moment_s": np.array([0.2, 2.0, 0.7])}
    may = law.possible(values, made.data.chunks, made.data.stress_MPa)
    assert may.tolist() == [False, True, False]  # 15 % of the load after 0.75 s


def test_odds_are_those_of_two_regressions():
    made = recordings([CYCLES] * 4, gap)
    regression = Regression(made, bare(made).guess)
    told = regression.forward(frozenset({"slack"}))
    ((group,), (left,)) = regression.groups, regression.left(told)
    many = min(independent(group.left), independent(left))
    ratio = float((group.left**2).sum() / (left**2).sum())
    each = 0.5 * np.log(many) * len(told.terms)
    assert [t.recording for t in told.terms] == [2]
    assert told.odds == pytest.approx(0.5 * many * np.log(ratio) - each)
    assert told.odds > 5
    # By an independent route, with dense matrices: the same squares are left.
    mean = np.eye(4) - 0.25
    column = np.kron(mean[:, 2], group.changes["slack"][2, told.terms[0].start])
    size = column @ group.left.ravel() / (column @ column)
    rest = group.left.ravel() - size * column
    assert float((left**2).sum()) == pytest.approx(rest @ rest, rel=1e-6)


def test_without_a_replicate_nothing_is_asked():
    far = [0, 0.9, 0.1, 0.9, 0]
    made = recordings([CYCLES, far], gap)
    assert stand_out(made, bare(made)) == []


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_scales_and_zeros_are_asked_elsewhere(law):
    made = recordings([CYCLES] * 3, noisy)
    asked = Regression(made, bare(made).guess).pieces
    expected = law.amplitude in law.per_recording
    assert (law.id in asked) == (expected and not (law.scatter or law.unmoved))


@pytest.mark.parametrize("stress", [gap, noisy])
def test_replicates_tell_what_laws_leave_open(stress):
    """Accounts at odds of nine to one against slack: it is in one of five, or none."""
    c = straight(CYCLES, 0.1, 0.1)
    every = [
        Recording(c.time_s, c.strain, stress(i, c), name=f"r{i}") for i in range(5)
    ]
    found = search(start(Case("case", tuple(every))))
    base, engine = found.accounts[0], found.base.engine
    piece = only(start_pieces(engine, SLACK)[0], np.array([2]))
    slack = replace(base, fit=refine(engine, base.fit, piece))
    two = tuple(Hypothesis(a) for a in (base, slack))
    before = Posterior(two, np.array([0.9, 0.1]), np.zeros(2))
    told = stand_out(engine, base.fit)
    after = before
    for fault in told:
        after = asked(after, fault, engine)
    assert (after.effects["slack"] > 0.5) == (stress is gap)
    assert (named(told, slack.fit) == {"slack"}) == (stress is gap)


def test_a_size_that_is_hardly_known_hides_no_fault(monkeypatch):
    made = recordings([CYCLES] * 4, both)
    regression = Regression(made, bare(made).guess)
    told = regression.forward(frozenset({"grip_slip"}))
    assert {t.recording for t in told.terms} == {3}

    def chance(error):
        def relative(self, group, left, term, by):
            return (0.09, 0.005) if term.recording == 3 else (0.05, error)

        monkeypatch.setattr(Regression, "_relative", relative)
        return regression.faulty(told, "grip_slip")

    assert chance(0.05) > 0.5 > chance(0.001)


def test_sizes_come_with_the_error_that_draws_of_the_noise_show():
    sizes, errors = [], []
    for draw in range(16):

        def stress(i, chunk, draw=draw):
            taut = np.maximum(chunk.strain - 0.05 * (i == 2), 0)
            rng = np.random.default_rng([draw, i])
            return 2 * taut + 0.01 * rng.standard_normal(len(taut))

        made = recordings([CYCLES] * 4, stress)
        regression = Regression(made, bare(made).guess)
        told = regression.forward(frozenset({"slack"}))
        (group,), (left,) = regression.groups, regression.left(told)
        ours = (t for t in zip(told.terms, told.sizes, strict=True))
        term, by = next((t, by) for t, by in ours if t.recording == 2)
        size, error = regression._relative(group, left, term, by)
        sizes.append(size)
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.std(sizes, ddof=1), rel=0.5)
