"""Forms that real recordings asked for, against the sources they are taken from."""

import numpy as np
import pytest
from scipy.special import erf

from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.models.units import Units
from softnn.simulate import Term, simulate

SPRING = Units("hooke", (0.0, 1.0))


@pytest.mark.parametrize("power", [1.2, 2.0, 3.0])
def test_softening_is_that_of_ogden_and_roxburgh_for_a_power_law_energy(power):
    # W = K e^q, eta = 1 - erf((W_m - W) / (m + beta W_m)) / r with 1/r = d,
    # beta = s, m = s K c^q; K falls out.
    law = effect("mullins_softening")
    d, c, s, k = 0.7, 0.15, 0.6, 3.7
    strain = np.array([0.0, 0.2, 0.5, 0.4, 0.1, 0.3, 0.5, 0.7])
    largest = np.maximum.accumulate(strain)
    top, now = k * largest**power, k * strain**power
    eta = 1 - d * erf((top - now) / (s * k * c**power + s * top))
    values = {
        "depth": d, "scale": c, "sharpness": s, "viscous_share": 1.0, "power": power
    }  # fmt: skip
    pull = Chunk(np.arange(8.0), strain)
    out = simulate(SPRING, [2.0], [Term(law, values)], [pull])[0]
    np.testing.assert_allclose(out, 2.0 * eta * strain, rtol=1e-12)


def test_a_crooked_strip_shows_the_line_of_southwell():
    # Deflection over load, against deflection, is straight, of slope 1 / Euler load.
    law, euler = effect("tension_only", "CrookedStrip"), 0.03
    values = {"amount": 1.0, "buckling_MPa": euler}
    strain = np.array([0.0, 0.3, -0.05, -0.1, -0.2, -0.4])
    out = simulate(SPRING, [2.0], [Term(law, values)], [Chunk(np.arange(6.0), strain)])[
        0
    ]
    assert out[1] == pytest.approx(2.0 * strain[1])  # taut as ever
    short = -strain[2:]
    slope = np.diff(short / -out[2:]) / np.diff(short)
    np.testing.assert_allclose(slope, 1 / euler, rtol=1e-12)


@pytest.mark.parametrize("stretch", [0.6, 1.5, 3.0])
def test_a_branch_too_quick_to_flow_is_a_neo_hookean_strip(stretch):
    # Engineering stress of an incompressible neo-Hookean strip, E / 3 (l - l^-2).
    law, e = effect("finite_strain", "StretchedBranches"), 1.7
    values = {"amount": 1.0, "section": 1.0, "modulus_MPa": e}
    units = Units("wiechert", (0.0, 1.0), (1e9,))
    pull = Chunk(np.arange(3.0), np.array([0.0, 0.5, 1.0]) * (stretch - 1))
    out = simulate(units, [0.0, e], [Term(law, values)], [pull])[0]
    np.testing.assert_allclose(out[-1], e / 3 * (stretch - stretch**-2), rtol=1e-6)


HELD = np.concatenate([[0.0, 1e-9], np.linspace(0.1, 8, 80)])  # a step, and a hold


def held_branches(values, stretch):
    """Stress of branches of 0.7 and 0.4 MPa, 0.5 and 5 s, held at a stretch."""
    law, units = effect("finite_strain", "DirectedBranches"), ("wiechert", (0.0, 1.0))
    step = Chunk(HELD, np.append(0.0, np.full(81, stretch - 1)))
    base = Units(*units, (0.5, 5.0))
    return simulate(base, [0.0, 0.7, 0.4], [Term(law, values)], [step])[0]


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 2.0])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("stretch", [0.6, 2.5])
def test_branches_of_which_a_share_is_finite_are_the_sum_of_both(
    share, exponent, stretch
):
    # Stress of a strip by its energy in a Seth-Hill strain, all directions together.
    values = {"amount": share}
    values |= {"strain_exponent": exponent, "stress_exponent": exponent}

    def energy(x):
        sides = np.array([x, x**-0.5, x**-0.5])
        one = np.log(sides) if exponent == 0 else (sides**exponent - 1) / exponent
        return np.sum(one**2) / 3

    slope = (energy(stretch + 1e-6) - energy(stretch - 1e-6)) / 2e-6
    both = (1 - share) * (stretch - 1) + share * slope
    fading = 0.7 * np.exp(-HELD[1:] / 0.5) + 0.4 * np.exp(-HELD[1:] / 5.0)
    np.testing.assert_allclose(
        held_branches(values, stretch)[1:], both * fading, rtol=1e-6
    )


@pytest.mark.parametrize("rate", [-0.1, 0.4])
def test_an_upper_convected_branch_is_maxwells_equation_in_a_moving_frame(rate):
    from scipy.integrate import solve_ivp

    # Pulled at a constant logarithmic rate: each direction by itself.
    tau, e = 2.0, 1.5
    time = np.linspace(0, 3, 3001)
    law = effect("finite_strain", "DirectedBranches")
    values = {"amount": 1.0, "strain_exponent": -2.0, "stress_exponent": 2.0}
    pull = Chunk(time, np.expm1(rate * time))
    units = Units("wiechert", (0.0, 1.0), (tau,))
    out = simulate(units, [0.0, e], [Term(law, values)], [pull])[0]

    def flow(_, s):  # axial and lateral stress, with a shear modulus e / 3
        pace = np.array([rate, -rate / 2])
        return 2 * pace * s + 2 * e / 3 * pace - s / tau

    found = solve_ivp(flow, (0, 3), [0, 0], t_eval=time, rtol=1e-9, atol=1e-12).y
    true = (found[0] - found[1]) * np.exp(-rate * time)
    np.testing.assert_allclose(out, true, atol=1e-6 * e)


def test_all_branches_finite_are_those_of_the_first_form():
    pull = Chunk(np.linspace(0, 9, 91), 1.5 * np.sin(np.linspace(0, 3, 91)))
    units, stiffness = Units("wiechert", (0.0, 1.0), (0.5, 5.0)), [1.0, 0.7, 0.4]
    law, whole = effect("finite_strain", "DirectedBranches"), effect("finite_strain")
    part = {"amount": 1.0, "strain_exponent": 0.0, "stress_exponent": 0.0}
    hencky = {"amount": 1.0, "section": 1.0}
    np.testing.assert_allclose(
        simulate(units, stiffness, [Term(law, part)], [pull])[0],
        simulate(units, stiffness, [Term(whole, hencky)], [pull])[0],
        rtol=1e-10,
    )


def test_green_strain_gives_the_second_stress_of_piola_and_kirchhoff():
    law, stretch = effect("finite_strain"), np.linspace(0.5, 2.5, 41)
    pull = Chunk(np.arange(42.0), np.append(0.0, stretch - 1))
    units = Units("wiechert", (0.0, 1.0), (1e9,))
    term = Term(law, {"amount": -1.0, "section": 1.0})
    out = simulate(units, [0.0, 1.7], [term], [pull])[0]
    np.testing.assert_allclose(
        out[1:], 1.7 * stretch * (stretch**2 - 1) / 2, rtol=1e-6, atol=1e-7
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_wall_friction_is_a_share_of_the_load_up_and_down(side):
    # Slid through, the load is (1 + mu) times that of the spring on the way out and
    # (1 - mu) times on the way back, whichever way out is.
    law = effect("friction_hysteresis", "WallFriction")
    strain = side * np.concatenate([np.linspace(0, 0.6, 121), np.linspace(0.6, 0, 121)])
    values = {"coefficient": 0.2, "presliding": 1e-3, "spread": 0.05}
    chunk = Chunk(np.arange(242.0), strain)
    out = simulate(SPRING, [2.0], [Term(law, values)], [chunk])[0]
    ratio = out / np.where(strain == 0, 1.0, 2.0 * strain)
    np.testing.assert_allclose(ratio[5:121], 1.2, rtol=1e-9)
    np.testing.assert_allclose(ratio[126:-1], 0.8, rtol=1e-9)


SET = effect("permanent_set").defaults() | {"ratio": 0.2}  # all of it, in all parts


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("lost", [0.0, 0.6, 1.0])
def test_within_its_set_a_strip_bears_only_what_buckling_leaves(side, lost):
    # Set 0.2 x 0.5 = 0.1: below it a spring of 2 MPa would push back.
    law = effect("permanent_set")
    strain = side * np.array([0.5, 0.3, 0.1, 0.05, 0.0])
    values = SET | {"buckling": lost}
    chunk = Chunk(np.arange(5.0), strain)
    out = simulate(SPRING, [2.0], [Term(law, values)], [chunk])[0]
    bare = 2.0 * side * np.array([0.4, 0.2, 0.0, -0.05, -0.1])
    expected = np.where(side * bare < 0, (1 - lost) * bare, bare)
    np.testing.assert_allclose(out, expected, atol=1e-12)


def test_a_slack_strip_is_not_strained_back():
    # Spring and branch are as if it had been kept at the length it has grown to.
    law = effect("permanent_set")
    maxwell = Units("sls", (0.0, 1.0), (2.0,))
    time = np.linspace(0, 6, 601)
    strain = np.interp(time, [0, 1, 2, 4, 5, 6], [0, 0.5, 0, 0, 0.5, 0.5])
    (slack,) = simulate(
        maxwell, [1.0, 1.0], [Term(law, SET | {"buckling": 1.0})], [Chunk(time, strain)]
    )
    grown = 0.2 * np.maximum.accumulate(strain)
    kept = Chunk(time, np.maximum(strain - grown, 0.0))
    np.testing.assert_allclose(
        slack, simulate(maxwell, [1.0, 1.0], [], [kept])[0], atol=1e-12
    )


def test_buckling_without_a_set_is_nothing():
    law = effect("permanent_set")
    time = np.linspace(0, 2, 201)
    chunk = Chunk(time, np.interp(time, [0, 1, 2], [0, 0.5, -0.2]))
    values = SET | {"ratio": 0.0, "buckling": 1.0}
    out = simulate(SPRING, [2.0], [Term(law, values)], [chunk])[0]
    np.testing.assert_array_equal(out, 2.0 * chunk.strain)


def test_a_mass_on_a_mount_is_late_by_its_time_and_smaller_as_theory_says():
    # First-order lag of the force of a sine: the specimen's own stress is not lagged.
    law = next(f for f in effect("inertia").second_forms if f.form == "CompliantMount")
    omega, tau, mass = 3.0, 0.2, 0.4
    time = np.arange(0, 40, 0.002)
    chunk = Chunk(time, 0.1 * (1 - np.cos(omega * time)))
    values = {"mass": mass, "mount_s": tau}
    stress = simulate(SPRING, [2.0], [Term(law, values)], [chunk])[0]
    force = 0.1 * mass * omega**2 / np.hypot(1, omega * tau)
    late = np.arctan(omega * tau)
    expected = 2.0 * chunk.strain + force * np.cos(omega * time - late)
    settled = slice(len(time) // 2, -1)
    np.testing.assert_allclose(stress[settled], expected[settled], atol=2e-3 * force)


def test_a_value_for_each_recording_is_asked_for():
    two = [Chunk(np.arange(3.0), np.arange(3.0) / 10)] * 2
    term = Term(effect("zero_offset"), {"offset_MPa": np.array([0.1])})
    with pytest.raises(InputError, match="1 values of offset_MPa for 2 recordings"):
        simulate(SPRING, [1.0], [term], two)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_branches_feel_their_share_of_a_set(share):
    law = effect("permanent_set")
    values = law.defaults() | {"ratio": 0.2, "viscous_share": share}
    time = np.linspace(0, 8, 801)
    strain = np.interp(time, [0, 2, 4, 6, 8], [0, 0.6, 0, 0.6, 0.6])
    chunk = [Chunk(time, strain)]
    largest = np.maximum.accumulate(strain)
    # A spring is shifted by the set, a branch by its share, as if moved by less.
    spring = Units("wiechert", (0.0, 1.0), (1.0,))
    (stiff,) = simulate(spring, np.array([2.0, 0.0]), [Term(law, values)], chunk)
    np.testing.assert_allclose(stiff, 2.0 * (strain - 0.2 * largest), atol=1e-12)
    (flows,) = simulate(spring, np.array([0.0, 2.0]), [Term(law, values)], chunk)
    moved = [Chunk(time, strain - share * 0.2 * largest)]
    (as_moved,) = simulate(spring, np.array([0.0, 2.0]), [], moved)
    np.testing.assert_allclose(flows, as_moved, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "form", "amplitude"),
    [
        ("thermal_softening", "ThermalClock", "quickening_per_C"),
        ("strain_dependent_relaxation", "StrainClock", "growth"),
    ],
)
def test_a_clock_that_is_off_is_off_exactly_at_odd_times(name, form, amplitude):
    # Summed steps of a clock are not its stamps to the last digit.
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(1e-3, 0.3, 300))
    warm = 23 + rng.normal(size=300)
    chunk = Chunk(time, 0.3 + 0.3 * np.sin(time), warm)
    units = Units("wiechert", (0.0, 1.0), (0.5, 5.0))
    term = Term(effect(name, form), {amplitude: 0.0})
    (off,) = simulate(units, [1.0, 2.0, 3.0], [term], [chunk])
    (plain,) = simulate(units, [1.0, 2.0, 3.0], [], [chunk])
    np.testing.assert_array_equal(off, plain)


@pytest.mark.parametrize("start", [0.0, 7.0])
def test_at_one_temperature_branches_are_those_of_shifted_times(start):
    # Williams, Landel and Ferry: warmer is as good as shorter relaxation times.
    time = start + np.linspace(0, 20, 400)
    strain = np.interp(time - start, [0, 3, 8, 11, 20], [0, 0.5, 0.5, 0.2, 0.2])
    law = effect("thermal_softening", "ThermalClock")
    term = Term(law, {"quickening_per_C": 0.1})
    warm = Chunk(time, strain, np.full(400, 43.0))
    tau, stiffness = np.array([0.5, 5.0]), [1.0, 2.0, 3.0]
    (out,) = simulate(Units("w", (0.0, 1.0), tuple(tau)), stiffness, [term], [warm])
    shifted = Units("w", (0.0, 1.0), tuple(tau / np.exp(0.1 * 20)))
    (expected,) = simulate(shifted, stiffness, [], [Chunk(time, strain)])
    np.testing.assert_allclose(out, expected, rtol=1e-10, atol=1e-14)


def test_held_at_a_strain_branches_are_those_of_shifted_times():
    law = effect("strain_dependent_relaxation", "StrainClock")
    time = np.linspace(0, 20, 401)
    hold = Chunk(time, np.full(401, -0.5))  # reached in a step, of either sign
    units = Units("wiechert", (0.0, 1.0), (4.0,))
    (out,) = simulate(units, [0.0, 2.0], [Term(law, {"growth": 3.0})], [hold])
    np.testing.assert_allclose(out, -np.exp(-time * np.exp(1.5) / 4.0), rtol=1e-10)


@pytest.mark.parametrize(
    ("form", "more"),
    [
        ("SpreadBranch", {"width_decades": 0.0}),  # all at one time
        ("TwoBranches", {"share": 0.0, "ratio": 10.0}),
    ],
)
def test_branches_of_one_time_are_the_one_branch(form, more):
    values = {"stiffness_MPa": 2.0, "relaxation_time_s": 3.0}
    pull = Chunk(np.linspace(0, 9, 91), 0.5 * np.sin(np.linspace(0, 3, 91)))
    (one,), (many,) = (
        simulate(SPRING, [1.0], [Term(effect("relaxation_branch", f), v)], [pull])
        for f, v in ((None, values), (form, values | more))
    )
    np.testing.assert_allclose(many, one, rtol=1e-12, atol=1e-14)
