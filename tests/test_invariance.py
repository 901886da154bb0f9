"""An answer does not depend on what does not matter."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import STIFFNESS, UNITS

from softnn import Recording, diagnose
from softnn.axes import SPECIMEN
from softnn.contracts import Chunk, InputError
from softnn.effects import EFFECTS, effect
from softnn.fit import Data, Engine, Guess, Piece, fit
from softnn.fit.point import with_stress
from softnn.metrics import weights
from softnn.mismatch.base import possible, weigh
from softnn.mismatch.case import Case, sparse, thin, to_data
from softnn.mismatch.specimens import besides_middle
from softnn.model_file import from_dict, in_units, to_dict
from softnn.models.units import Units
from softnn.noise import Noise
from softnn.simulate import simulate

RAMP = np.minimum(0.1 * np.arange(2001.0), 1.0)


# --- weights of samples ---------------------------------------------------------------


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_weights_do_not_depend_on_units(by, of):
    time = np.arange(len(RAMP))
    np.testing.assert_allclose(
        weights(by * time, of * RAMP), weights(time, RAMP), rtol=1e-6, atol=1e-9
    )


@pytest.mark.parametrize("step", [2, 5])
def test_weights_of_a_stretch_do_not_depend_on_how_often_it_was_written(step):
    """The ramp takes 10 of 2,000 s, and half of the weight, with fewer samples too."""
    time = np.arange(len(RAMP), dtype=float)
    for every in (1, step):
        own = weights(time[::every], RAMP[::every])
        early = time[::every] <= 10
        assert own[early].sum() / own.sum() == pytest.approx(0.5, abs=0.02)


def test_equal_paths_of_strain_weigh_alike_whatever_the_rate():
    time = np.concatenate([np.linspace(0, 1, 20), np.linspace(1, 20, 400)[1:]])
    strain = np.interp(time, [0, 1, 20], [0, 1, 0])
    own = weights(time, strain)
    assert own[:20].sum() == pytest.approx(own[19:].sum(), rel=0.05)


def test_equal_steps_of_the_logarithm_of_time_weigh_alike_in_a_hold():
    time = np.arange(len(RAMP), dtype=float)
    own, since = weights(time, RAMP), time - 10
    decades = [own[(since > a) & (since <= 10 * a)].sum() for a in (20, 199)]
    assert decades[0] == pytest.approx(decades[1], rel=0.3)  # not ten times as much


def test_noise_of_a_strain_channel_is_no_motion():
    time = np.arange(len(RAMP), dtype=float)
    noisy = RAMP + 1e-3 * np.random.default_rng(0).standard_normal(len(RAMP))
    early = time <= 10
    share = [
        w[early].sum() / w.sum() for w in (weights(time, x) for x in (RAMP, noisy))
    ]
    assert share[0] == pytest.approx(share[1], abs=0.05)


# --- the unit of stress ---------------------------------------------------------------


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_every_effect_scales_with_stress(law):
    """A fit in other units, taken back to MPa, gives the stress in MPa."""
    time = np.linspace(0, 40, 400)
    strain = 0.4 * np.abs(np.sin(0.3 * time)) * (1 - 0.5 * law.id.startswith("tension"))
    chunk = Chunk(time, strain, 20 + 0.1 * time)
    one = 250.0
    for form in law.forms:
        start = form.defaults() | {
            k: np.atleast_1d(v)[:1] if k in form.per_recording else v
            for k, v in form.starts(_scales(time, strain))[0].items()
        }
        guess = Guess(UNITS, STIFFNESS, (Piece(form, start, ()),))
        back = with_stress(guess, one)
        a, b = (
            simulate(UNITS, g.stiffness, g.terms(), [chunk])[0] for g in (guess, back)
        )
        np.testing.assert_allclose(b, one * a, rtol=1e-6, atol=1e-9 * one)


@pytest.mark.parametrize("one", [1e-3, 200.0])
@pytest.mark.parametrize("end", ["low", "high"])
def test_what_a_fit_finds_is_read_again_in_mpa(one, end):
    """A stress at the end of its range in the fit is no fault of the file."""
    axes = SPECIMEN.counted(1.0, one)
    for law in EFFECTS:
        for form in law.forms:
            ends = {p.name: getattr(p, end) for p in form.parameters if p.per_stress}
            values = form.defaults() | ends
            own = {k: np.atleast_1d(values[k]) for k in form.per_recording}
            guess = Guess(UNITS, STIFFNESS, (Piece(form, values | own, ()),))
            made, back = in_units(guess, axes)
            told = to_dict(made, ["a"], "fresh", False, axes=back)
            (read,) = from_dict(told).pieces
            for name in ends.keys() - own.keys():
                power = next(p for p in form.parameters if p.name == name).per_stress
                assert read.values[name] == pytest.approx(ends[name] * one**-power)


@pytest.mark.parametrize("wrong", [-1.0, np.inf, np.nan])
def test_a_stress_in_mpa_keeps_its_sign(wrong):
    law = effect("friction_hysteresis")
    with pytest.raises(InputError, match="friction_MPa is"):
        law.prepare(law.defaults() | {"friction_MPa": wrong})


def _scales(time, strain):
    return Data(("a",), (Chunk(time, strain),), (strain,)).scales()


@pytest.fixture(scope="module")
def softened():
    """Two strips of a softening material that no law here describes exactly."""
    out = []
    for i, top in enumerate((0.5, 0.8)):
        time = np.arange(0, 60, 0.25)
        strain = top * np.abs(np.sin(0.16 * time)) * np.minimum(time / 30, 1)
        largest = np.maximum.accumulate(strain)
        wavy = 1 + 0.15 * np.sin(9 * strain)
        stress = 2 * strain * wavy * (1 - 0.4 * (largest - strain) / (largest + 0.05))
        rng = np.random.default_rng(i)
        noisy = stress + 1e-3 * rng.standard_normal(len(stress))
        out.append(Recording(time, strain, noisy, name=f"s{i}"))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("by", [2.0, 1e-3], ids=["twice", "kPa"])
def test_the_unit_of_stress_changes_no_answer(softened, by):
    first = diagnose(softened, "pl-sls")
    other = diagnose(
        [replace(r, stress_MPa=by * r.stress_MPa) for r in softened],
        "pl-sls",
        as_is=True,
    )
    assert other.selected == first.selected
    assert other.probability == pytest.approx(first.probability, abs=0.01)
    errors = [d.result["fit"]["after"]["heldout_nrmse"] for d in (first, other)]
    assert errors[0] == pytest.approx(errors[1], rel=0.01)
    strip = softened[0]
    np.testing.assert_allclose(
        other.model.simulate(strip), by * first.model.simulate(strip), rtol=1e-4
    )


# --- order and names ------------------------------------------------------------------


def strips(factors):
    """Recordings of one programme, each of a specimen with its own stiffness."""
    time = np.linspace(0, 30, 90)
    strain = 0.5 * np.abs(np.sin(0.3 * time))
    rng = np.random.default_rng(0)
    return [
        Recording(time, strain, f * strain + 1e-3 * rng.standard_normal(90), name=n)
        for n, f in factors.items()
    ]


@settings(deadline=None, max_examples=20)
@given(st.permutations(range(5)))
def test_scales_refer_to_the_same_specimen_in_any_order(order):
    every = strips({"a": 1.0, "b": 1.3, "c": 0.8, "d": 1.1, "e": 0.9})
    case = Case("c", tuple(every[i] for i in order), specimen={"a": "x", "b": "y"})
    groups = [(i,) for i in range(5)]
    beside = {case.recordings[i].name for (i,) in besides_middle(to_data(case), groups)}
    assert beside == {"b", "c", "d", "e"}


@pytest.mark.slow
def test_the_names_and_the_order_of_recordings_change_no_answer(softened):
    """Four specimens that differ by a factor each, then in another order."""
    factors = (1.05, 0.93, 1.0, 0.97)
    told = [
        replace(r, stress_MPa=f * r.stress_MPa, name=f"r{i}", specimen=f"strip {i}")
        for i, (f, r) in enumerate(zip(factors, softened + softened, strict=True))
    ]
    other = [
        replace(r, name=f"r{i}", specimen=f"piece {i}")
        for i, r in enumerate(told[::-1])
    ]
    a, b = (diagnose(recordings, "pl-sls") for recordings in (told, other))
    assert a.verdict == b.verdict
    assert a.probability == pytest.approx(b.probability, abs=0.01)
    errors = [d.result["fit"]["after"]["heldout_nrmse"] for d in (a, b)]
    assert errors[0] == pytest.approx(errors[1], rel=0.01)


# --- samples of the search ------------------------------------------------------------


def test_a_ramp_keeps_its_samples_beside_a_long_hold():
    time = np.arange(len(RAMP), dtype=float)
    case = Case("c", (Recording(time, RAMP, RAMP, name="a"),))
    (kept,) = sparse(case, 100).recordings
    assert len(kept) <= 110
    assert (kept.time_s <= 10).sum() >= 10  # one sample in twenty would lose it
    (even,) = thin(case, 100).recordings
    assert (even.time_s <= 10).sum() < 4


@pytest.mark.parametrize("most", [10, 40])
def test_strain_stays_linear_between_samples_that_are_kept(most):
    corners = [0, 3, 300, 301, 900, 950, 1400, 1400.5, 2000]
    strain = [0, 1, 1, 0.2, 0.2, 0.7, 0.7, 0.1, 0.1]
    time = np.arange(0, 2000, 0.5)
    every = np.interp(time, corners, strain)
    case = Case("c", (Recording(time, every, every, name="a"),))
    (kept,) = sparse(case, most).recordings
    assert len(kept) <= 2 * most + len(corners)
    between = np.interp(time, kept.time_s, kept.strain)
    assert np.abs(between - every).max() <= 0.01 * np.ptp(every) + 1e-12


# --- sizes that a machine can have ----------------------------------------------------


@pytest.mark.parametrize("by", [1.0, 1e3])
def test_no_rig_swings_on_a_specimen_more_slowly_than_once_a_second(by):
    """The period of a mass on a spring is 2 pi sqrt(m / k)."""
    scales = replace(_scales(np.arange(50.0), 0.1 * RAMP[:50]), stress_MPa=by)
    law = effect("inertia").within(scales)
    mass = next(p for p in law.parameters if p.name == "mass")
    period = 2 * np.pi * np.sqrt(mass.high * scales.strain / scales.stress_MPa)
    assert period == pytest.approx(1.0)


# --- noise ----------------------------------------------------------------------------


def test_the_misfit_of_a_wrong_law_is_no_slow_noise():
    """Fifty smooth samples a recording, and a line fitted to a curve."""
    time = np.linspace(0, 50, 50)
    chunks = tuple(Chunk(time, top * np.abs(np.sin(0.1 * time))) for top in (0.3, 0.5))
    stress = tuple(8 * c.strain**3 for c in chunks)
    made = Engine(Data(("a", "b"), chunks, stress))
    line = fit(made, Guess(Units("hooke", (0.0, 1.0)), np.zeros(1)))
    missed = np.sqrt(np.mean((made.target - line.stress) ** 2))
    assert missed > 0.04 * np.ptp(made.target)
    noise = weigh(made, line)
    assert max(n.floor_MPa for n in noise) <= 0.02 * np.ptp(made.target) * (1 + 1e-9)


def test_no_machine_has_a_noise_that_neighbouring_samples_do_not_show():
    smooth = np.sin(np.linspace(0, 6, 200))
    (told,) = possible([Noise(0.3, 0.0, 0.0)], [smooth])
    assert told.floor_MPa == pytest.approx(0.02 * np.ptp(smooth))  # ISO 7500-1, class 2
    rough = smooth + 0.2 * np.random.default_rng(0).standard_normal(200)
    (shown,) = possible([Noise(0.2, 0.0, 0.0)], [rough])
    assert shown.floor_MPa == pytest.approx(0.2)
