"""Laws of the literature beside the main one of each effect, against closed forms."""

from itertools import pairwise

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.models.units import Units
from softnn.simulate import Term, simulate

SPRING = Units("hooke", (0.0, 1.0))


def there_and_back(levels, n=400):
    """Straight between levels, n samples each, one a second."""
    parts = [np.linspace(a, b, n, endpoint=False) for a, b in pairwise(levels)]
    strain = np.append(np.concatenate(parts), levels[-1])
    return Chunk(np.arange(float(len(strain))), strain)


def spring_with(name, form, values, chunk, stiffness=1.0):
    return simulate(SPRING, [stiffness], [Term(effect(name, form), values)], [chunk])[0]


def stiff_branch_with(name, form, values, chunk):
    units = Units("wiechert", (0.0, 1.0), (1e12,))
    term = Term(effect(name, form), values)
    return simulate(units, [0.0, 1.0], [term], [chunk])[0]


@pytest.mark.parametrize(("share", "spring", "slow"), [(0, 1, 0), (1, 1, 1), (2, 0, 1)])
@pytest.mark.parametrize(
    ("name", "form", "amplitude"),
    [
        ("mullins_softening", None, "depth"),
        ("mullins_softening", "SimoDamage", "depth"),
        ("mullins_softening", "BeattySoftening", "softening"),
        ("cyclic_softening", "PartialSoftening", "loss"),
        ("cyclic_softening", "SaturatingSoftening", "loss"),
    ],
)
def test_softening_is_of_spring_or_branches_as_the_share_says(
    name, form, amplitude, share, spring, slow
):
    chunk, law = there_and_back([0, 0.5, 0, 0.5, 0]), effect(name, form)
    all_of_it = law.defaults() | {amplitude: 0.3}
    values = all_of_it | {"viscous_share": share}
    for run, does in ((spring_with, spring), (stiff_branch_with, slow)):
        full = run(name, form, all_of_it, chunk)
        out = run(name, form, values, chunk)
        np.testing.assert_allclose(out, full if does else chunk.strain, atol=1e-9)


@pytest.mark.parametrize("closed", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("power", [0.0, 1.0, 3.0])
def test_cycles_count_by_a_power_of_their_range_and_when_they_close(power, closed):
    chunk = there_and_back([0, 0.4, 0, 0.4, 0.2, 0.4, 0])
    values = {"loss": 0.2, "closed": closed, "power": power}
    out = spring_with("cyclic_softening", "CyclicSoftening", values, chunk)
    number = 10 ** ((1 - out[1:] / np.maximum(chunk.strain[1:], 1e-9)) / 0.2) - 1
    # Seen where half of each way is gone: up, down, up, a little down, up, down.
    small, open_half = 0.5**power, (1 - closed) / 2
    each = [0, open_half, 1, 1 + open_half, (3 + small) / 2]
    each.append((3 + small) / 2 + small * open_half)
    np.testing.assert_allclose(number[199::400], each, atol=1e-6)


def test_cycles_that_level_off_come_nearer_by_the_same_share_each():
    chunk = there_and_back([0, 0.4] * 8 + [0])
    values = {"loss": 0.3, "closed": 1.0, "power": 0.0, "cycles": 2.0}
    values["viscous_share"] = 1.0
    out = spring_with("cyclic_softening", "SaturatingSoftening", values, chunk)
    peaks = out[400::800] / 0.4
    expected = 1 - 0.3 * (1 - np.exp(-np.arange(len(peaks)) / 2))
    np.testing.assert_allclose(peaks, expected, rtol=1e-9)


def test_softening_of_beatty_is_the_root_of_what_is_missing_to_the_largest_strain():
    chunk = there_and_back([0, 0.5, 0.1, 0.7, 0])
    largest = np.maximum.accumulate(chunk.strain)
    values = {"softening": 0.8, "exponent": 0.5, "viscous_share": 1.0}
    out = spring_with("mullins_softening", "BeattySoftening", values, chunk)
    gap = np.sqrt(largest**2 - chunk.strain**2)
    np.testing.assert_allclose(out, chunk.strain * np.exp(-0.8 * gap), atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_crept_set_grows_while_strained_and_stays(side):
    time = np.append(np.linspace(0, 60, 601), [60.001, 100.0])
    strain = side * np.append(np.full(601, 0.5), [0.0, 0.0])
    values = {"ratio": 0.3, "time_s": 40.0, "viscous_share": 1.0}
    out = spring_with("permanent_set", "CreptSet", values, Chunk(time, strain), 2.0)
    grown = 0.3 * 0.5 * (1 - np.exp(-time[:601] / 40))
    np.testing.assert_allclose(out[:601], 2 * side * (0.5 - grown), rtol=1e-9)
    np.testing.assert_allclose(out[601:], -2 * side * grown[-1], rtol=1e-4)


def test_a_cyclic_set_grows_with_the_logarithm_of_cycles():
    values = effect("permanent_set").defaults() | {"ratio": 0.2, "first": 0.6}
    chunk = there_and_back([0, *[0.5, 0] * 10])
    out = spring_with("permanent_set", "PermanentSet", values, chunk)
    peaks = 0.5 - 0.2 * 0.5 * (0.6 + 0.4 * np.log10(np.arange(1, 11)))
    np.testing.assert_allclose(out[400::800], peaks, rtol=1e-9)


@pytest.mark.parametrize("pace", [0.0, 0.01, 3.0])
def test_an_element_yields_later_the_faster_it_is_strained(pace):
    # Flowing steadily g is still: r = (r + rho) (g / y)^n at a strain rate of r.
    rate, values = 0.01, {"stiffness_MPa": 2.0, "yield_strain": 0.3, "sharpness": 9.0}
    strain = np.linspace(0, 3, 3001)
    chunk = Chunk(strain / rate, strain)
    values["pace_per_s"] = pace
    out = spring_with("permanent_set", "PlasticElement", values, chunk) - strain
    still = 0.3 * (rate / (rate + pace)) ** (1 / 9)
    assert out[-1] == pytest.approx(2.0 * still, rel=1e-3)


def test_friction_grown_by_a_large_cycle_stays_grown():
    values = {"friction_MPa": 0.2, "presliding": 1e-3, "spread": 0.05}
    chunk = there_and_back([0, 0.3, 0.1, 0.9, 0.1, 0.3])
    friction = spring_with("friction_hysteresis", "GrownFriction", values, chunk)
    friction -= chunk.strain
    np.testing.assert_allclose(friction[[400, 800, -1]], [0.06, -0.06, 0.18], rtol=1e-9)


def test_a_joint_slides_bit_by_bit_and_turns_by_masings_rule():
    values = {"friction_MPa": 0.2, "presliding": 0.1, "power": 0.0}
    chunk = there_and_back([0, 0.08, -0.08])
    friction = spring_with("friction_hysteresis", "JointFriction", values, chunk)
    friction -= chunk.strain
    x = chunk.strain[:401] / 0.1
    # Reaches as many as long: Segalman's integral over those that slide and those not.
    np.testing.assert_allclose(friction[:401], 0.2 * (2 * x - x**2), atol=0.02 * 0.2)
    back = friction[400] - friction[400:]
    np.testing.assert_allclose(back, 2 * friction[:401], atol=1e-12)


def test_ogden_springs_are_those_of_neo_hooke_and_mooney():
    chunk = there_and_back([0, 1.5, -0.5])
    stretch = 1 + chunk.strain
    for a, curve in ((2.0, stretch - stretch**-2), (-2.0, 1 - stretch**-3)):
        values = {"stiffening_MPa": 1.0, "exponent": a}
        out = spring_with("nonlinear_elasticity", "OgdenSpring", values, chunk)
        np.testing.assert_allclose(out, curve / 3, atol=1e-12)


def test_branches_in_material_axes_too_quick_to_flow_are_neo_hookean():
    chunk = there_and_back([0, 1.5, -0.5])
    stretch = 1 + chunk.strain
    name, form = "finite_strain", "MaterialBranches"
    out = stiff_branch_with(name, form, {"amount": 1.0}, chunk)
    np.testing.assert_allclose(out, (stretch - stretch**-2) / 3, atol=1e-6)


def test_declining_branches_are_a_logarithm_inside_and_a_power_outside():
    chunk = there_and_back([0, 0.6, -0.4])
    x = np.abs(chunk.strain) / 0.1
    values = {"decline": 0.5, "inner": 1.0, "width": 0.1}
    name, form = "strain_dependent_relaxation", "DecliningBranches"
    out = stiff_branch_with(name, form, values, chunk)
    expected = 0.1 * np.sign(chunk.strain) * np.log1p(x) / np.sqrt(1 + x)
    np.testing.assert_allclose(out, expected, atol=1e-6)


@pytest.mark.parametrize("exponent", [0.5, 1.0])
def test_pulled_evenly_branches_thin_by_the_rate(exponent):
    law = effect("nonlinear_viscosity", "ThinningBranches")
    chunk = Chunk(np.linspace(0, 20, 401), 0.03 * np.linspace(0, 20, 401))
    term = Term(law, {"thinning_s": 50.0, "exponent": exponent})
    tau, stiffness = np.array([0.5, 5.0]), [1.0, 2.0, 3.0]
    (out,) = simulate(Units("w", (0, 1), tuple(tau)), stiffness, [term], [chunk])
    thin = Units("w", (0, 1), tuple(tau / (1 + 1.5**exponent)))
    np.testing.assert_allclose(
        out, simulate(thin, stiffness, [], [chunk])[0], rtol=1e-9
    )


def test_a_folded_strip_bears_what_it_did_as_it_buckled():
    chunk = there_and_back([0, 0.4, -0.6, 0.2])
    values = {"amount": 1.0, "buckling_strain": 0.1}
    out = spring_with("tension_only", "FoldedStrip", values, chunk)
    np.testing.assert_allclose(out, np.maximum(chunk.strain, -0.1), atol=1e-12)


def test_stiffness_falls_between_two_levels_over_a_transition():
    law, n = effect("thermal_softening", "GlassySoftening"), 201
    warm = np.linspace(-300, 400, n)
    values = {"softening_per_C": 0.03, "middle_C": 50.0, "width_C": 8.0}
    chunk = Chunk(np.arange(float(n)), np.full(n, 0.5), warm)
    (out,) = simulate(SPRING, [1.0], [Term(law, values)], [chunk])
    assert np.log(out[0] / out[-1]) == pytest.approx(2 * 0.03 * 8.0, rel=1e-6)
    middle = np.argmin(np.abs(warm - 50.0))
    assert out[middle] == pytest.approx(np.sqrt(out[0] * out[-1]), rel=1e-6)
