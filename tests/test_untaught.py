"""A network is a base only for what it was shown; the rest is told, not named."""

import json
from dataclasses import replace

import numpy as np
import pytest

from softnn.effects import effect
from softnn.mismatch import untaught
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import diagnose
from softnn.neural import Seen, StoredNetwork, samples, train
from softnn.recording import Recording

RATES = 0.02, 0.2


def law(time, strain):
    """A spring that stiffens, and a Maxwell branch of 5 s (exact where straight)."""
    branch = np.zeros(len(time))
    for i in range(1, len(time)):
        x = (time[i] - time[i - 1]) / 5.0
        gain = -np.expm1(-x) / x
        branch[i] = branch[i - 1] * np.exp(-x) + gain * (strain[i] - strain[i - 1])
    return 2 * strain + 2 * strain**2 + 0.5 * branch


def pulled(rate, name, corners=(0, 0.5), n=300, **about):
    travel = np.abs(np.diff(corners))
    turns = np.concatenate([[0], np.cumsum(travel / rate)])
    time = np.linspace(0, turns[-1], n)
    strain = np.interp(time, turns, corners)
    noise = 0.003 * np.random.default_rng(len(name)).standard_normal(n)
    stress = law(time, strain) + noise
    return Recording(time, strain, stress, name=name, rate_per_s=rate, **about)


@pytest.fixture(scope="module")
def network():
    """Taught by tensile tests at two rates."""
    known = [pulled(r, f"t{r}", test="tensile") for r in RATES for _ in range(2)]
    given = samples(known, "FFRD4")
    (one,) = train(
        given.inputs,
        given.target,
        neurons=[5],
        train_mask=np.ones((1, len(given.target)), bool),
        seeds=[0],
    )
    return StoredNetwork(one.network, "FFRD4", given.lag_s, Seen.of(known))


def cyclic(rate=0.02):
    corners = (0, 0.25, 0.02, 0.4, 0.02, 0.5)
    return pulled(rate, f"cycles-{rate}", corners, 800, test="cyclic")


def test_unloading_is_told_where_it_is(network):
    one = cyclic()
    found = untaught.stretches(Case("c", (one,)), network.known)
    assert [s.what for s in found] == ["unloading", "unloading"]
    turns = np.cumsum([0.25, 0.23, 0.38, 0.38]) / 0.02
    ends = [e for s in found for e in (s.start_s, s.end_s)]
    np.testing.assert_allclose(ends, turns, atol=0.4)  # of 100, or three samples
    (left,) = untaught.taught(Case("c", (one,)), found).recordings
    assert left.time_s[-1] == pytest.approx(turns[0], abs=0.4)


@pytest.mark.parametrize(
    ("rate", "what"),
    [
        (0.02, None),
        (0.06, "rates between those shown"),
        (0.2, None),
        (0.5, "faster rates"),
        (0.005, "slower rates"),
    ],
)
def test_rates_are_told_from_those_shown(network, rate, what):
    found = untaught.stretches(Case("c", (pulled(rate, "p"),)), network.known)
    assert [s.what for s in found] == ([] if what is None else [what])


def test_holds_and_large_strains_were_not_shown(network):
    time = np.linspace(0, 60, 600)
    held = np.interp(time, [0, 15], [0, 0.3])
    far = pulled(0.02, "far", (0, 0.8))
    case = Case("c", (Recording(time, held, held, name="held"), far))
    found = untaught.stretches(case, network.known)
    assert [(s.recording, s.what) for s in found] == [
        (0, "holds"),
        (1, "strain beyond that shown"),
    ]


@pytest.fixture(scope="module")
def found(network):
    """A diagnosis of that network on cycles, which it was never shown."""
    return diagnose(Case("c", (cyclic(), cyclic(0.06))), network)


def test_cyclic_recordings_name_no_physics_of_the_material(found):
    assert all(effect(name).stage != "material" for name in found.selected)
    for said in ("unloading", "rates between", "no physics of the material"):
        assert said in found.summary
    assert {r["recording"] for r in found.result["untaught"]} == {
        "cycles-0.02",
        "cycles-0.06",
    }
    # The figures show the whole of the recordings.
    assert [t[-1] for t in found.time_s] == [
        r.time_s[-1] for r in found.case.recordings
    ]


@pytest.mark.xfail(
    strict=True,
    reason="issue 53: the diagnosis names an offset for the error of the network",
)
def test_cyclic_recordings_name_nothing_at_all(found):
    assert found.selected == []


def test_a_network_shown_both_ways_is_asked_nothing_new(network):
    seen = Seen.of([cyclic(), cyclic(0.2)])
    shown = replace(network, seen=seen)
    assert untaught.stretches(Case("c", (cyclic(),)), shown.known) == []
    again = Seen.from_dict(json.loads(json.dumps(seen.to_dict())))
    assert again == seen


def test_the_history_of_later_samples_was_never_shown_either(network):
    """The study of what a network lacks counts the samples after an unloading, too."""
    from studies.lacks import AFTER, never_shown

    one = cyclic()
    shares = never_shown(Case("c", (one,)), network)
    assert list(shares) == ["unloading", AFTER]
    turns = np.array([0.25, 0.23, 0.38, 0.38, 0.48])
    parts = turns / turns.sum()
    assert shares["unloading"] == pytest.approx(parts[1] + parts[3], abs=0.02)
    assert shares[AFTER] == pytest.approx(parts[2] + parts[4], abs=0.02)
    assert never_shown(Case("c", (pulled(0.02, "x"),)), network) == {}
