"""Storage and loss moduli against closed forms, and of recordings that swing."""

import numpy as np
import pytest

from softnn import dynamic
from softnn.contracts import InputError
from softnn.models.linear import Wiechert
from softnn.recording import Recording
from studies import dynamic as study

FREQUENCIES = np.logspace(-2, 2, 9)


class Linear:
    """A model of softnn with its parameters, as a stored one simulates."""

    def __init__(self, model, **parameters):
        self.model, self.parameters = model, parameters

    def stress(self, names, chunks, simulated):
        return [self.model.apply(self.parameters, c)[0] for c in chunks]


@pytest.mark.parametrize("tau", [1e-3, 0.03, 1.0, 30.0, 1e3])
def test_one_branch_has_its_closed_form(tau):
    model = Linear(
        Wiechert(1), equilibrium_stiffness=1.0, stiffness_1=2.0, relaxation_time_1=tau
    )
    found = dynamic.sweep(model, FREQUENCIES, 0.3, 0.1)
    x = (2 * np.pi * FREQUENCIES * tau) ** 2
    np.testing.assert_allclose(found.storage_MPa, 1 + 2 * x / (1 + x), rtol=1e-3)
    loss = 2 * np.sqrt(x) / (1 + x)
    # Strain is linear between samples: of 120 a cycle, 1 part in 4,000 of a branch.
    np.testing.assert_allclose(found.loss_MPa, loss, atol=1e-3)
    np.testing.assert_allclose(
        found.loss_tangent, loss / (1 + 2 * x / (1 + x)), atol=1e-3
    )
    assert found.other.max() < 1e-3
    closed = dynamic.of_branches(1.0, [2.0], [tau], FREQUENCIES)
    np.testing.assert_allclose(closed.loss_MPa, loss, rtol=1e-12)


def test_branches_add_up():
    both = dynamic.of_branches(1.0, [2.0, 3.0], [0.1, 10.0], FREQUENCIES)
    one = dynamic.of_branches(1.0, [2.0], [0.1], FREQUENCIES)
    two = dynamic.of_branches(0.0, [3.0], [10.0], FREQUENCIES)
    np.testing.assert_allclose(both.storage_MPa, one.storage_MPa + two.storage_MPa)
    np.testing.assert_allclose(both.loss_MPa, one.loss_MPa + two.loss_MPa)


def swung(frequency=0.25, cycles=10.4, samples=40, noise=0.0, **about):
    """E' 2 MPa, E'' 0.3 MPa, about a mean, with a drift and uneven samples."""
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, cycles / frequency, round(samples * cycles)))
    angle = 2 * np.pi * frequency * time + 0.4
    strain = 0.2 + 0.05 * np.sin(angle)
    stress = 0.7 + 0.05 * (2 * np.sin(angle) + 0.3 * np.cos(angle)) - 1e-4 * time
    return Recording(
        time, strain, stress + noise * rng.standard_normal(len(time)), name="s", **about
    )


def test_a_recorded_sine_gives_what_it_was_made_of():
    found = dynamic.of_recording(swung())
    assert found.frequency_Hz[0] == pytest.approx(0.25, rel=1e-5)
    assert found.storage_MPa[0] == pytest.approx(2.0, rel=1e-4)
    assert found.loss_MPa[0] == pytest.approx(0.3, rel=1e-3)
    assert found.other[0] < 1e-3


def test_noise_averages_out_and_is_told():
    # 0.01 MPa beside a sine of rms 0.0715: 416 samples leave an error of 0.01 x
    # sqrt(2 / 416) / 0.05 = 0.014 MPa of a modulus.
    found = dynamic.of_recording(swung(noise=0.01), 0.25)
    assert found.storage_MPa[0] == pytest.approx(2.0, abs=0.05)
    assert found.loss_MPa[0] == pytest.approx(0.3, abs=0.05)
    assert found.other[0] == pytest.approx(0.01 / np.hypot(0.01, 0.0715), rel=0.1)


def test_what_is_missing_is_left_out():
    whole = swung()
    stress = whole.stress_MPa.copy()
    stress[10:20] = np.nan
    gap = Recording(whole.time_s, whole.strain, stress, name="s")
    assert dynamic.of_recording(gap).loss_MPa[0] == pytest.approx(0.3, rel=1e-3)


def test_a_spring_that_stiffens_has_harmonics_and_no_loss():
    one = swung()
    bent = Recording(one.time_s, one.strain, 5 * one.strain**2, name="bent")
    found = dynamic.of_recording(bent, 0.25)
    # Samples at random tell the second harmonic from the first to 0.009 MPa only.
    assert found.storage_MPa[0] == pytest.approx(2 * 5 * 0.2, abs=0.02)  # at the mean
    assert abs(found.loss_MPa[0]) < 0.02
    # 5 e^2 swings by 2 x 5 x 0.2 x 0.05, and by 5 x 0.05^2 / 2 at twice the frequency
    assert found.other[0] == pytest.approx(0.00625 / np.hypot(0.1, 0.00625), rel=0.02)


@pytest.mark.parametrize(
    ("recording", "frequency", "words"),
    [
        (swung(), 1.1, "does not swing at 1.1 Hz"),
        (swung(cycles=0.6), 0.25, "a whole cycle"),
        (swung(samples=4), 0.25, "a whole cycle with 8 samples"),
        (Recording(np.arange(20.0), np.ones(20), np.ones(20)), None, "does not swing"),
    ],
)
def test_what_is_no_sine_is_refused(recording, frequency, words):
    with pytest.raises(InputError, match=words):
        dynamic.of_recording(recording, frequency)


@pytest.mark.parametrize("asked", [([0.0], 0.1), ([-1.0], 0.1), ([1.0], 0.0)])
def test_a_sweep_that_cannot_be_is_refused(asked):
    with pytest.raises(InputError, match="must be above 0"):
        dynamic.sweep(Linear(Wiechert(1)), asked[0], 0.3, asked[1])


# --- the study ------------------------------------------------------------------------


def test_a_recording_of_few_cycles_is_left_out():
    assert study.of_one(swung())["cycles"] == pytest.approx(10.4, rel=0.01)
    with pytest.raises(InputError, match="cycles; 3 are needed"):
        study.of_one(swung(cycles=2.2, samples=100))


def test_a_model_is_as_far_off_as_its_complex_modulus():
    law = dynamic.of_branches(1.0, [2.0], [1.0], FREQUENCIES)
    assert study.row("law", law, law)["error"] == 0
    stiffer = dynamic.of_branches(1.1, [2.2], [1.0], FREQUENCIES)
    assert study.row("stiffer", stiffer, law)["error"] == pytest.approx(0.1)
    assert study.row("stiffer", stiffer, law)["makes_energy"] == 0
    odd = dynamic.of_branches(1.0, [-2.0], [1.0], FREQUENCIES)
    assert study.row("odd", odd, law)["makes_energy"] == len(FREQUENCIES)
