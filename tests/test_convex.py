"""Convex networks against closed forms, the piecewise models, and thermodynamics."""

from dataclasses import replace

import numpy as np
import pytest

from softnn import InputError, Recording
from softnn.models.fit_piecewise import fit_jointly
from softnn.neural import StoredNetwork, convex
from softnn.neural.convex import HOLDS, ConvexNetwork, fitted, units
from softnn.neural.fitting import run
from softnn.study.holding import of_piecewise, stored

TAU = 3.0
TIME = np.linspace(0, 20, 2001)


def ramp(rate, top=0.5, samples=80, scale=1.0):
    """A standard linear solid pulled at a rate: the closed form of its stress."""
    time = np.linspace(0, top / rate, samples)
    stress = 2.0 * rate * time + 1.5 * rate * TAU * -np.expm1(-time / TAU)
    return Recording(
        time,
        rate * time,
        scale * stress,
        test="tensile",
        rate_per_s=rate,
        name=f"at {rate}",
        specimen=f"at {rate}",
    )


def hold(rate=0.1, top=0.2, held_s=30.0, scale=1.0):
    """The same solid, its strain held after the ramp."""
    end = top / rate
    time = np.concatenate([np.linspace(0, end, 40), end + np.geomspace(0.05, held_s)])
    strain = np.minimum(rate * time, top)
    at_end = 1.5 * rate * TAU * -np.expm1(-end / TAU)
    loading = 1.5 * rate * TAU * -np.expm1(-time / TAU)
    after = at_end * np.exp(-np.maximum(time - end, 0) / TAU)
    stress = 2.0 * strain + np.where(time <= end, loading, after)
    return Recording(time, strain, scale * stress, test="relaxation", name="hold")


def error(network: ConvexNetwork, recording: Recording) -> float:
    (said,) = run(network, "CONVEX", [recording])
    return float(np.abs(said - recording.stress_MPa).max() / recording.stress_MPa.max())


def test_a_branch_is_that_of_maxwell():
    rate = 0.02
    table = np.array([[0.0, 0.0, TAU], [0.0, 0.0, 0.0]])
    said = units(rate * TIME, TIME, table)
    closed = rate * TAU * -np.expm1(-TIME / TAU)
    np.testing.assert_allclose(said[:, 0], closed, atol=1e-12)
    np.testing.assert_allclose(said[:, 1], rate * TIME, atol=1e-15)
    held = units(np.where(TIME > 0, 0.3, 0.0), TIME, table)
    after = held[1, 0] * np.exp(-(TIME[1:] - TIME[1]) / TAU)
    np.testing.assert_allclose(held[1:, 0], after, atol=1e-12)


def test_a_limit_saturates_and_a_knot_engages_on_its_side():
    strain = np.array([-2.0, -0.1, 0.0, 0.1, 2.0])
    table = np.array([[0.0, 0.1, 0.0], [0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]])
    said = units(strain, np.arange(5.0), table)
    np.testing.assert_allclose(said[[0, -1], 0], [-0.1, 0.1], rtol=1e-6)
    np.testing.assert_allclose(said[3, 0], 0.1 * (1 - np.exp(-1)), rtol=1e-12)
    np.testing.assert_allclose(said[:, 1], [0, 0, 0, 0.05, 1.95], atol=1e-15)
    np.testing.assert_allclose(said[:, 2], [-1.95, -0.05, 0, 0, 0], atol=1e-15)


@pytest.mark.parametrize("side", [1, -1])
def test_a_piecewise_model_is_such_a_network(side):
    curves = [
        replace(r, strain=side * r.strain, stress_MPa=side * r.stress_MPa)
        for r in (ramp(0.01), ramp(0.1))
    ]
    fit = fit_jointly(curves, 2)
    for one in (*curves, hold()):
        (said,) = run(of_piecewise(fit, curves), "CONVEX", [one])
        np.testing.assert_allclose(said, fit.predict(one), atol=1e-12)


def test_a_rate_never_seen_is_met_where_two_are_known():
    curves = [ramp(0.01), ramp(0.1)]
    for name, network in fitted(curves, [hold()]).items():
        if "light" in name.rsplit(", ", 1)[-1]:
            assert error(network, ramp(0.03)) < 0.03, name  # between them
            assert error(network, ramp(1.0)) < 0.15, name  # ten times beyond


def test_a_hold_of_another_scale_tells_the_shape_alone():
    """One rate: without the hold a branch is a spring; a stiff specimen misleads."""
    found = fitted([ramp(0.05)], [hold(scale=1.6)])
    far = ramp(1.0)
    errors = {
        how: error(found[f"convex, straight, {how}, light"], far) for how in HOLDS
    }
    assert errors["shape of holds"] < 0.1
    assert errors["with holds"] > 2 * errors["shape of holds"]


def test_no_cycle_gives_work_back():
    """Branches that cannot be negative dissipate, whatever the strain does."""
    rng = np.random.default_rng(0)
    network = fitted([ramp(0.01), ramp(0.1)], [hold()])[
        "convex, saturating, with holds, light"
    ]
    time = np.linspace(0, 60, 3001)
    for _ in range(20):
        steps = np.cumsum(rng.standard_normal(31))
        strain = np.interp(time, np.linspace(0, 60, 31), steps - steps[0])
        strain -= np.linspace(0, strain[-1], len(time))  # ends where it began
        (stress,) = run(network, "CONVEX", [Recording(time, strain, 0 * time)])
        branches = network.hidden[:, 2] > 0
        viscous = units(strain, time, network.hidden)[:, branches]
        assert np.trapezoid(stress, strain) > -1e-6
        assert (network.output[:-1][branches] >= 0).all()
        assert viscous.any()


def test_kept_and_read_back_it_says_the_same():
    from softnn.neural.stored import from_dict

    curves = [ramp(0.01), ramp(0.1)]
    kept = stored(fitted(curves)["convex, straight, without holds, light"], curves)
    again = from_dict(kept.source)
    assert isinstance(again, StoredNetwork)
    assert isinstance(again.network, ConvexNetwork)
    for one in curves:
        (said,) = run(again.network, "CONVEX", [one])
        np.testing.assert_array_equal(said, run(kept.network, "CONVEX", [one])[0])


def test_asked_beyond_its_rates_it_says_so():
    curves = [ramp(0.01), ramp(0.1)]
    kept = stored(fitted(curves)["convex, straight, without holds, light"], curves)
    from softnn.contracts import Chunk

    for rate, outside in ((0.05, False), (1.0, True)):
        time = np.linspace(0, 0.3 / rate, 50)
        flags = kept.outside(Chunk(time, rate * time))
        assert bool((flags[2:] > 0).all()) == outside


def test_nothing_to_fit_is_said():
    with pytest.raises(InputError, match="no curves"):
        fitted([])
    flat = Recording(TIME, 0 * TIME, 0 * TIME)
    with pytest.raises(InputError, match="strain never leaves zero"):
        fitted([flat])
    assert len(fitted([ramp(0.1)])) == len(convex.MEASURES) * len(convex.DECAYS)


def test_what_cannot_be_done_with_it_is_one_line(tmp_path):
    from softnn.cli import main
    from softnn.json_file import write
    from softnn.neural import fit_samples, samples

    curves = [ramp(0.01), ramp(0.1)]
    known = samples(curves, "CONVEX")
    mask = np.ones((1, len(known.target)), bool)
    with pytest.raises(InputError, match="fitted in one step"):
        fit_samples(known, "CONVEX", neurons=[3], train_mask=mask, seeds=[0])
    kept = stored(fitted(curves)["convex, straight, without holds, light"], curves)
    write(tmp_path / "network.json", kept.source)
    for kind, end in (("c", 0), ("onnx", 2), ("abaqus", 2)):
        asked = ["export", str(tmp_path / "network.json"), "--to", kind]
        assert main([*asked, "--out", str(tmp_path / kind)]) == end
