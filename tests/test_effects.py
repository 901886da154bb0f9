"""Properties every effect must have, none of them written for one effect.

An exemption stands on the class (`exempt`), with its reason.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import softnn.effects
from softnn.contracts import Chunk, Effect, InputError, Scales
from softnn.effects import EFFECTS, effect
from softnn.fit import Data, Engine, Guess, Piece, fit, get, put, slots
from softnn.mismatch.contest import at_best
from softnn.mismatch.screen import Screen
from softnn.mismatch.strangers import STRANGERS
from softnn.models.units import Units
from softnn.simulate import Term, measured, reach, run_on, simulate

LAWS = [law for e in EFFECTS for law in (e, *e.second_forms)] + [*STRANGERS]
UNITS = Units("pl-wiechert", (-1.0, 0.0, 0.4, 1.0), (0.3, 5.0))
STIFFNESS = np.array([0.8, 0.9, 1.4, 0.5, 0.4])
IDS = [law.form for law in LAWS]


def scales(chunk: Chunk) -> Scales:
    stress = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    warm = chunk.temperature_C
    return Scales(
        strain=float(np.abs(chunk.strain).max()),
        stress_MPa=float(np.abs(stress).max()),
        interval_s=float(np.median(np.diff(chunk.time_s))),
        duration_s=np.array([chunk.time_s[-1]]),
        temperature_C=0.0 if warm is None else float(np.ptp(warm)),
    )


def planted(law: Effect, chunk: Chunk) -> dict[str, float]:
    """Values of the effect's first start, as numbers."""
    values = law.defaults() | law.starts(scales(chunk))[0]
    return {k: float(np.ravel(v)[0]) for k, v in values.items()}


def stress(law: Effect, values: dict[str, float], chunk: Chunk) -> np.ndarray:
    return simulate(UNITS, STIFFNESS, [Term(law, values)], [chunk])[0]


def by_chunks(law: Effect, values: dict, chunk: Chunk, length: int) -> np.ndarray:
    """The same, a few samples at a time, with carried state."""
    term, memory, state, out = Term(law, values), {}, None, []
    ready = [law.prepare(values)]
    for a in range(0, len(chunk.time_s), length):
        part = slice(a, a + length)
        warm = chunk.temperature_C
        piece = Chunk(
            chunk.time_s[part], chunk.strain[part], None if warm is None else warm[part]
        )
        signal = reach([term], ready, piece, memory)
        signal = type(signal)(**{**vars(signal), "begun_s": float(chunk.time_s[0])})
        inner = Chunk(
            piece.time_s, signal.strain[:, 0], None, signal.branch_strain[:, 0]
        )
        springs, branches, state = UNITS.respond(inner, state)
        signal = type(signal)(
            **{
                **vars(signal),
                "equilibrium": (springs @ STIFFNESS[:3])[:, None],
                "branches": (branches @ STIFFNESS[3:])[:, None],
            }
        )
        out.append(measured([term], ready, signal, memory)[:, 0])
    return np.concatenate(out)


def test_names_are_those_of_the_files():
    folder = Path(softnn.effects.__file__).parent
    files = {f.stem for f in folder.glob("*.py") if not f.name.startswith("_")}
    assert {e.id for e in EFFECTS} == files
    for e in EFFECTS:
        assert e.id == re.sub(r"(?<!^)(?=[A-Z])", "_", type(e).__name__).lower()


def test_effects_stand_in_the_order_of_the_stages():
    order = ["rig", "material", "sensor"]
    stages = [order.index(e.stage) for e in EFFECTS]
    assert stages == sorted(stages)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_declares_what_it_is(law):
    names = {p.name for p in law.parameters}
    assert law.amplitude in names
    assert set(law.off) | set(law.shape) | set(law.per_recording) <= names
    assert set(law.twins) <= {e.id for e in EFFECTS} - {law.id}
    assert law.twins
    assert law.where
    assert set(law.ports) <= {
        "strain", "branch_strain", "equilibrium", "branches", "stress"
    }  # fmt: skip
    assert type(law).__doc__
    if law in EFFECTS:
        assert "math::" in type(law).__doc__


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_off_is_off_exactly(law):
    chunk = law.telltale()
    plain = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    values = planted(law, chunk) | dict(law.off)
    np.testing.assert_array_equal(stress(law, values, chunk), plain)


def test_all_off_stacked_is_off_exactly():
    chunk = effect("thermal_softening").telltale()
    plain = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    terms = [Term(e, e.defaults()) for e in EFFECTS]
    np.testing.assert_array_equal(simulate(UNITS, STIFFNESS, terms, [chunk])[0], plain)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_shows_on_its_telltale(law):
    chunk = law.telltale()
    plain = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    moved = stress(law, planted(law, chunk), chunk) - plain
    assert np.abs(moved).max() > 0.01 * np.abs(plain).max()


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_looks_at_nothing_ahead(law):
    if "causal" in law.exempt:
        pytest.skip(law.exempt["causal"])
    chunk = law.telltale()
    n = len(chunk.time_s) // 2
    other = np.array(chunk.strain)
    other[n:] = 0.3 + 0.1 * np.sin(np.arange(len(other) - n))
    values = planted(law, chunk)
    changed = Chunk(chunk.time_s, other, chunk.temperature_C)
    np.testing.assert_array_equal(
        stress(law, values, chunk)[:n], stress(law, values, changed)[:n]
    )


@pytest.mark.parametrize("length", [1, 7])
@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_chunks_equal_the_whole(law, length):
    if "chunked" in law.exempt:
        pytest.skip(law.exempt["chunked"])
    whole = law.telltale()
    few = slice(0, 300)
    warm = whole.temperature_C
    chunk = Chunk(
        whole.time_s[few], whole.strain[few], None if warm is None else warm[few]
    )
    values = planted(law, whole)
    np.testing.assert_allclose(
        by_chunks(law, values, chunk, length),
        stress(law, values, chunk),
        rtol=1e-9,
        atol=1e-12,
    )


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_batch_equals_loop(law):
    chunk = law.telltale()
    first = planted(law, chunk)
    second = dict(first)
    amplitude = next(p for p in law.parameters if p.name == law.amplitude)
    second[law.amplitude] = float(
        np.clip(0.6 * first[law.amplitude], amplitude.low, amplitude.high)
    )
    term = Term(law, first)
    both = {k: np.array([first[k], second[k]]) for k in first}
    ready = [law.prepare(both)]
    memory: dict = {}
    signal = reach([term], ready, chunk, memory)
    columns = []
    for j in range(2):
        pick = min(j, signal.strain.shape[1] - 1)
        inner = Chunk(
            chunk.time_s,
            np.ascontiguousarray(signal.strain[:, pick]),
            None,
            np.ascontiguousarray(
                signal.branch_strain[:, min(j, signal.branch_strain.shape[1] - 1)]
            ),
        )
        columns.append(UNITS.respond(inner)[:2])
    signal = type(signal)(
        **{
            **vars(signal),
            "equilibrium": np.stack([s @ STIFFNESS[:3] for s, _ in columns], axis=1),
            "branches": np.stack([b @ STIFFNESS[3:] for _, b in columns], axis=1),
        }
    )
    batch = measured([term], ready, signal, memory)
    for j, values in enumerate((first, second)):
        np.testing.assert_allclose(
            batch[:, j], stress(law, values, chunk), rtol=1e-10, atol=1e-13
        )


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_pointwise_is_said_where_it_is_so(law):
    chunk = law.telltale()
    ready = [law.prepare(planted(law, chunk))]
    signal = reach([Term(law, {})], ready, chunk, {})
    springs, branches, _ = UNITS.respond(chunk)
    eq = np.repeat((springs @ STIFFNESS[:3])[:, None], 2, axis=1)
    moment = len(eq) // 2
    eq[moment, 1] += 0.01
    signal = replace(
        signal, equilibrium=eq, branches=(branches @ STIFFNESS[3:])[:, None]
    )
    out = measured([Term(law, {})], ready, signal, {})
    elsewhere = np.delete(out[:, 1] - out[:, 0], moment)
    assert law.pointwise == (not elsewhere.any())


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_moves_made_at_once_equal_one_at_a_time(law):
    # Behind a gap, so that each move may have a strain of its own.
    chunk = law.telltale()
    gap, size = effect("slack"), float(np.abs(chunk.strain).max())
    values = gap.defaults() | {"gap": np.array([0.02, 0.05]) * size}
    given = {
        k: np.full(2, v) if k in law.per_recording else v
        for k, v in planted(law, chunk).items()
    }
    apart = ((0,), (1,))
    free = tuple(p.name for p in law.parameters)
    guess = Guess(
        UNITS,
        STIFFNESS,
        (Piece(gap, values, ("gap",), apart), Piece(law, given, free, apart)),
    )
    data = Data(("a", "b"), (chunk, chunk), (chunk.strain, chunk.strain))
    engine = Engine(data)
    where = slots(guess)
    moves = [
        [(s, s.outside(s.inside(get(guess, s)) + d))]
        for s in where
        for d in (-2e-2, 1e-3)
    ]
    kept = [{k: np.copy(v) for k, v in p.values.items()} for p in guess.pieces]
    at_once = engine.beside(guess, moves)
    plain, _ = engine.run(guess, False)
    for change, ((slot, value),) in zip(at_once.T, moves, strict=True):
        alone, _ = engine.run(put(guess, [slot], [value]), False)
        np.testing.assert_allclose(plain + change, alone, rtol=1e-9, atol=1e-12)
    stay = [[(s, get(guess, s))] for s in where]
    assert not engine.beside(guess, stay).any()
    for piece, before in zip(guess.pieces, kept, strict=True):
        for k, v in before.items():
            np.testing.assert_array_equal(piece.values[k], v)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_refining_the_step_converges(law):
    if "refine" in law.exempt:
        pytest.skip(law.exempt["refine"])
    coarse = law.telltale()
    values = planted(law, coarse)

    def at(factor: int) -> np.ndarray:
        n = len(coarse.time_s)
        fine = np.linspace(coarse.time_s[0], coarse.time_s[-1], (n - 1) * factor + 1)
        strain = np.interp(fine, coarse.time_s, coarse.strain)
        warm = coarse.temperature_C
        chunk = Chunk(
            fine, strain, None if warm is None else np.interp(fine, coarse.time_s, warm)
        )
        return stress(law, values, chunk)[::factor]

    one, two, four = at(1), at(2), at(4)
    size = np.sqrt(np.mean(four**2))
    first = np.sqrt(np.mean((one - four) ** 2)) / size
    second = np.sqrt(np.mean((two - four) ** 2)) / size
    assert first < 0.02
    assert second < 0.75 * first + 5e-5  # sub-steps within a sample stop at that


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_planted_value_comes_back_on_the_telltale(law):
    if "recover" in law.exempt:
        pytest.skip(law.exempt["recover"])
    # A virgin recording without the effect is what a per-recording error needs.
    chunk = law.telltale()
    chunks = (chunk, chunk) if law.per_recording else (chunk,)
    values = planted(law, chunk)
    r = len(chunks)
    full = {
        k: np.array([law.off.get(k, v)] * (r - 1) + [v])
        if k in law.per_recording
        else v
        for k, v in values.items()
    }
    data = simulate(UNITS, STIFFNESS, [Term(law, full)], list(chunks))
    rng = np.random.default_rng(3)
    sigma = 1e-4 * max(float(np.abs(s).max()) for s in data)
    noisy = tuple(s + sigma * rng.standard_normal(len(s)) for s in data)
    engine = Engine(Data(tuple("ab"[:r]), chunks, noisy))
    engine.set_noise([np.full(len(s), sigma) for s in data], None)
    start = dict(full)
    amplitude = start[law.amplitude]
    if law.off.get(law.amplitude) == 0.0:
        start[law.amplitude] = np.where(
            np.asarray(amplitude) != 0, amplitude * 0.7, 0.0
        )
        if not np.ndim(amplitude):
            start[law.amplitude] = float(start[law.amplitude])
    else:
        start[law.amplitude] = amplitude * 0.98
    free = (law.amplitude,)
    groups = ((r - 1,),) if law.per_recording else ()
    guess = Guess(UNITS, np.zeros(5), (Piece(law, start, free, groups),))
    found = fit(engine, guess, iterations=25)
    value = np.ravel(found.guess.pieces[0].values[law.amplitude])[-1]
    assert value == pytest.approx(np.ravel(amplitude)[-1], rel=0.03)
    assert found.chi2 / len(found.residual) < 1.2


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_every_bad_value_raises(law):
    good = law.defaults()
    for p in law.parameters:
        for bad in (np.nan, p.low - 1 - abs(p.low), p.high + 1 + abs(p.high)):
            with pytest.raises(InputError, match=p.name):
                law.prepare(good | {p.name: bad})
    with pytest.raises(InputError, match="no parameter 'nonsense'"):
        law.prepare(good | {"nonsense": 1.0})


def test_unknown_names_raise():
    with pytest.raises(InputError, match="no effect 'mulins'"):
        effect("mulins")
    with pytest.raises(InputError, match="no form"):
        effect("slack", "Nothing")


def test_temperature_is_asked_for():
    law = effect("thermal_softening")
    chunk = effect("slack").telltale()
    with pytest.raises(InputError, match="temperature_C"):
        simulate(UNITS, STIFFNESS, [Term(law, {"softening_per_C": 0.01})], [chunk])


# -- closed forms ----------------------------------------------------------------------


def test_relaxation_branch_is_the_exponential():
    law = effect("relaxation_branch")
    time = np.linspace(0, 10, 101)
    hold = Chunk(time, np.full(101, 0.5))
    out = simulate(
        Units("hooke", (0.0, 1.0)),
        [0.0],
        [Term(law, {"stiffness_MPa": 2.0, "relaxation_time_s": 3.0})],
        [hold],
    )[0]
    np.testing.assert_allclose(out, 2.0 * 0.5 * np.exp(-time / 3.0), rtol=1e-12)


def test_eyring_dashpot_relaxes_as_its_closed_form():
    # dg/dt = -(e/tau) sinh(g/e) has tanh(g/2e) = tanh(g0/2e) exp(-t/tau).
    law = effect("nonlinear_viscosity")
    time = np.linspace(0, 20, 201)
    hold = Chunk(time, np.full(201, 0.5))
    values = {"stiffness_MPa": 1.0, "time_s": 50.0, "threshold": 0.05}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [hold])[0]
    first = 2 * np.arctanh(out[0] / 0.1 * 0 + np.tanh(out[0] / 0.1))
    assert first == pytest.approx(out[0] / 0.05, rel=1e-6)
    expected = 0.1 * np.arctanh(np.tanh(out[0] / 0.1) * np.exp(-time / 50.0))
    np.testing.assert_allclose(out, expected, rtol=1e-6)


def test_eyring_dashpot_flows_steadily_at_arcsinh_of_the_rate():
    law = effect("nonlinear_viscosity")
    time = np.arange(0, 200, 0.05)
    ramp = Chunk(time, 0.01 * time)
    values = {"stiffness_MPa": 1.0, "time_s": 50.0, "threshold": 0.05}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [ramp])[0]
    assert out[-1] == pytest.approx(0.05 * np.arcsinh(0.01 * 50 / 0.05), rel=1e-4)


def test_friction_loop_is_twice_the_friction_high():
    law = effect("friction_hysteresis")
    chunk = Chunk(np.arange(400.0), 0.5 * np.sin(np.arange(400) / 30))
    values = {"friction_MPa": 0.1, "presliding": 0.01, "spread": 0.05, "growth": 0.0}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [chunk])[0]
    assert out.max() == pytest.approx(0.1, rel=1e-6)
    assert out.min() == pytest.approx(-0.1, rel=1e-6)


def test_dahl_friction_rises_exponentially():
    law = effect("friction_hysteresis", "BoucWen")
    strain = np.linspace(0, 0.1, 201)
    chunk = Chunk(np.arange(201.0), strain)
    values = {"friction_MPa": 1.0, "presliding": 0.02, "sharpness": 1.0, "growth": 0.0}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [chunk])[0]
    np.testing.assert_allclose(out, 1 - np.exp(-strain / 0.02), atol=2e-4)


def test_sensor_lag_follows_a_ramp_late_by_its_time_constant():
    law = effect("sensor_lag")
    time = np.linspace(0, 10, 501)
    chunk = Chunk(time, 0.02 * time)
    one = Units("hooke", (0.0, 1.0))
    values = {"time_constant_s": 0.4, "second": 0.0}
    out = simulate(one, [1.0], [Term(law, values)], [chunk])[0]
    expected = 0.02 * (time - 0.4 * (1 - np.exp(-time / 0.4)))
    np.testing.assert_allclose(out, expected, atol=1e-12)


def test_inertia_of_a_sine_is_minus_omega_squared():
    law = effect("inertia")
    time = np.linspace(0, 2, 2001)
    chunk = Chunk(time, 0.3 * np.sin(5 * time))
    out = simulate(
        Units("hooke", (0.0, 1.0)), [0.0], [Term(law, {"mass": 2.0})], [chunk]
    )
    np.testing.assert_allclose(out[0][1:-1], -25 * 2 * chunk.strain[1:-1], rtol=1e-5)


def test_softening_meets_the_first_loading_at_the_largest_strain():
    law = effect("mullins_softening")
    chunk = law.telltale()
    spring = Units("hooke", (0.0, 1.0))
    values = planted(law, chunk)
    out = simulate(spring, [1.0], [Term(law, values)], [chunk])[0]
    top = np.isclose(chunk.strain, np.maximum.accumulate(chunk.strain), atol=1e-12)
    np.testing.assert_allclose(out[top], chunk.strain[top], rtol=1e-12)
    assert np.all(out[~top] <= chunk.strain[~top] + 1e-15)


def test_continued_slip_stays_and_regripped_slip_does_not():
    chunk = Chunk(np.arange(11.0), np.full(11, 0.5))
    values = {
        "slip": np.array([0.1, 0.0]),
        "moment_s": np.array([5.0, 5.0]),
        "duration_s": 1.0,
    }
    spring = Units("hooke", (0.0, 1.0))
    kept, fresh = (
        simulate(
            spring, [1.0], [Term(effect("grip_slip", f), values)], [chunk, chunk], True
        )
        for f in ("GripSlip", "RegrippedSlip")
    )
    assert kept[1][-1] == pytest.approx(0.4)
    assert fresh[1][-1] == pytest.approx(0.5)


def test_structure_that_does_not_heal_while_watched_is_on_the_list():
    law = next(s for s in STRANGERS if s.id == "structure")
    scales = Data(("a",), (law.telltale(),), (law.telltale().strain,)).scales()
    longest = float(scales.duration_s[0])
    assert law.strange({"rebuild_s": 0.5 * longest}, scales)
    assert not law.strange({"rebuild_s": 20 * longest}, scales)


def crystals_on(peaks, **values):
    """Stress (n,) of crystals alone on triangles to `peaks`, a unit a second."""
    law = next(x for x in STRANGERS if x.id == "crystals")
    values = law.defaults() | {"stiffness_MPa": 1.0} | values
    knots = np.concatenate([[0.0], np.ravel([[p, 0.0] for p in peaks])])
    time = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(knots)))])
    fine = np.linspace(0, time[-1], 4001)
    strain = np.interp(fine, time, knots)
    none = Units("hooke", (0.0, 1.0))
    return strain, simulate(none, [0.0], [Term(law, values)], [Chunk(fine, strain)])[0]


def test_crystals_form_beyond_the_onset_and_melt_late():
    quick = {"onset": 0.4, "melting": 0.5, "time_s": 1e-3}
    strain, stress = crystals_on([0.9], **quick)
    up, down = stress[: len(stress) // 2], stress[len(stress) // 2 :][::-1]
    e = strain[: len(up)]
    # Quick ones follow one line up; they stay until the other line is met.
    assert up == pytest.approx(np.maximum(e - 0.4, 0), abs=3e-3)
    late = np.minimum(np.maximum(e - 0.2, 0), 0.5)
    assert down[: len(e)] == pytest.approx(late, abs=3e-3)


def test_crystals_take_their_time_and_need_stretch():
    slow = {"onset": 0.4, "melting": 0.5, "time_s": 10.0}
    _, stress = crystals_on([0.9], **slow)
    assert 0 < stress.max() < 0.1 * (0.9 - 0.4)
    assert crystals_on([0.39, -0.39], **slow)[1] == pytest.approx(0.0)
    # Compression makes them as stretch does.
    assert crystals_on([-0.9], **slow)[1] == pytest.approx(-stress)


@pytest.mark.parametrize(
    ("values", "strange"),
    [
        ({}, True),
        ({"stiffness_MPa": -0.3}, False),  # softening, which has names
        ({"melting": 1.0, "time_s": 1e-3}, False),  # a spring
        ({"melting": 0.9, "time_s": 1e-3}, True),
        ({"melting": 1.0}, True),
    ],
)
def test_crystals_that_come_and_go_with_strain_are_a_spring(values, strange):
    law = next(x for x in STRANGERS if x.id == "crystals")
    scales = Data(("a",), (law.telltale(),), (law.telltale().strain,)).scales()
    values = {p.name: p.default for p in law.parameters} | values
    assert law.strange(values, scales) == strange


@pytest.mark.parametrize(
    ("first", "begun"),
    [
        ([0.0, 0.1, 0.2, 0.3], 1.1),
        ([0.0, 0.1, 0.2, 5.2, 10.2], 1.1),  # a hold is recorded slowly
        ([0.0, 5.0, 5.1, 5.2], 1.1),  # one sample late
        ([0.0], 1.0),
        ([7.0, 7.1], 7.0),  # a clock that runs on
    ],
)
def test_recordings_that_go_on_do_so_at_once(first, begun):
    one, two = (Chunk(np.array(t), np.zeros(len(t))) for t in ([0.0, 0.5, 1.0], first))
    assert [id(c) for c in run_on([one, two], False)] == [id(one), id(two)]
    same, after = run_on([one, two], True)
    assert same.time_s is one.time_s
    assert after.time_s[0] == pytest.approx(begun)
    assert np.diff(after.time_s) == pytest.approx(np.diff(first))


def rubbed(rests, **values):
    """Stress (n,) of contacts in each stroke to or fro that follows a rest (s)."""
    law = next(x for x in STRANGERS if x.id == "ageing")
    values = law.defaults() | {"friction_MPa": 1.0, "travel": 0.05} | values
    time, strain, ends = [0.0], [0.0], []
    for i, rest in enumerate(rests):
        time += [time[-1] + rest, time[-1] + rest + 1.0]
        strain += [strain[-1], 0.4 * ((i + 1) % 2)]
        ends.append(time[-1])
    fine = np.linspace(0, time[-1], 20 * int(time[-1]) + 1)
    chunk = Chunk(fine, np.interp(fine, time, strain))
    stress = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [chunk])
    return [stress[0][(fine > e - 1) & (fine <= e)] for e in ends]


def test_contacts_grow_at_rest_and_are_broken_by_travel():
    rests = [1, 10, 50]
    plain = rubbed(rests, growth=0.0, time_s=10.0)
    assert [x[-1] for x in plain] == pytest.approx([1.0, -1.0, 1.0], abs=1e-3)
    strokes = rubbed(rests, growth=3.0, time_s=10.0)
    short, longer, longest = (np.abs(x).max() for x in strokes)
    assert 1 < short < longer < longest < 4
    # Eight travels later next to nothing of it is left.
    assert [x[-1] for x in strokes] == pytest.approx([1.0, -1.0, 1.0], abs=0.06)
    # What rest has built in one time is 1 - 1/e, as far as travel lets it show.
    assert (longer - 1) / (longest - 1) == pytest.approx(1 - np.exp(-1), abs=0.1)


@pytest.mark.parametrize(
    ("growth", "time", "friction", "strange"),
    [
        (3.0, 0.1, 1.0, True),
        (3.0, 100.0, 1.0, False),  # in a hundred times as long
        (50.0, 100.0, 1.0, True),
        (0.2, 0.1, 1.0, False),
        (3.0, 0.1, -1.0, False),
    ],
)
def test_friction_that_does_not_grow_while_watched_has_a_name(
    growth, time, friction, strange
):
    law = next(x for x in STRANGERS if x.id == "ageing")
    chunk = law.telltale()
    short = Chunk(chunk.time_s / 1e3, chunk.strain)
    scales = Data(("a", "b"), (chunk, short), (chunk.strain,) * 2).scales()
    longest = float(scales.duration_s.max())
    values = {"growth": growth, "time_s": time * longest, "friction_MPa": friction}
    assert law.strange(values, scales) == strange


def alone(name, time, strain, **values):
    """Stress (n,) of one law on no list, on a spring of 1 MPa, less that spring."""
    law = next(x for x in STRANGERS if x.id == name)
    chunk = Chunk(np.asarray(time), np.asarray(strain))
    terms = [Term(law, law.defaults() | values)]
    return simulate(Units("hooke", (0.0, 1.0)), [1.0], terms, [chunk])[0] - strain


@pytest.mark.parametrize(("way", "pace"), [(0.3, 1.0), (-0.3, 4.0)])
def test_fluid_is_drawn_in_as_it_diffuses_and_pressed_out_faster(way, pace):
    time = np.concatenate([[0.0, 1e-6], np.linspace(0.1, 20, 200)])
    strain = np.where(time > 0, way, 0.0)
    found = alone("one_way", time, strain, stiffness_MPa=2.0, time_s=8.0, faster=4.0)
    k = np.array([1, 3, 5])
    modes = np.exp(-(k**2) * pace * time[1:, None] / 8.0) / k**2
    expected = 2.0 * way * modes.sum(axis=1) / (1 / k**2).sum()
    assert found[1:] == pytest.approx(expected, abs=1e-5)


def test_fluid_turns_from_one_pace_to_the_other_with_the_sign_of_its_pressure():
    time = np.linspace(0, 60, 6001)
    strain = np.interp(time, [0, 1, 20, 21, 60], [0, 0.3, 0.3, -0.1, -0.1])
    values = {"stiffness_MPa": 1.0, "time_s": 8.0}
    even = alone("one_way", time, strain, faster=1.0, **values)
    quick = alone("one_way", time, strain, faster=5.0, **values)
    drawn = time < 20
    assert quick[drawn] == pytest.approx(even[drawn], abs=1e-12)
    late = np.searchsorted(time, 26.0)
    assert even[late] < 4 * quick[late] < 0


@pytest.mark.parametrize("way", [0.3, -0.3])
def test_fluid_takes_steps_of_any_length(way):
    fine = np.linspace(0, 10, 100_001)
    values = {"stiffness_MPa": 1.0, "time_s": 8.0, "faster": 4.0}
    exact = alone("one_way", fine, way * fine / 10, **values)
    coarse = alone("one_way", fine[::5000], way * fine[::5000] / 10, **values)
    assert coarse == pytest.approx(exact[::5000], abs=1e-6)


@pytest.mark.parametrize(
    ("faster", "stiffness", "strange"),
    [
        (1.0, 0.3, False),
        (1.3, 0.3, False),
        (2.0, 0.3, True),
        (2.0, -0.3, False),  # fluid does not push the slab on
    ],
)
def test_fluid_that_goes_both_ways_alike_is_relaxation(faster, stiffness, strange):
    law = next(x for x in STRANGERS if x.id == "one_way")
    assert law.strange({"faster": faster, "stiffness_MPa": stiffness}, None) == strange


def test_flocs_break_beyond_a_load_alone_and_form_again():
    time = np.linspace(0, 400, 8001)
    strain = np.interp(time, [0, 1, 100, 101, 200, 201, 400], [0, 1, 1, 3, 3, 1, 1])
    values = {"yield_strain": 1.0, "breaking_per_s": 0.1, "rebuild_s": 20.0}
    stress = alone("flocs", time, strain, share=0.5, skeleton=0.4, **values)
    lost = -stress / np.maximum(strain, 1e-9)
    at = dict(zip((100, 200, 400), np.searchsorted(time, [100, 200, 400]), strict=True))
    assert lost[1 : at[100]] == pytest.approx(0.0, abs=1e-12)
    # At three times the load that breaks: 1 - 1 / (1 + k tau (3 - 1)) are broken.
    assert lost[at[200]] == pytest.approx(0.4 * 0.5 * 0.8, rel=1e-3)
    assert lost[at[400]] == pytest.approx(0.0, abs=1e-4)
    # Compression breaks them as well.
    other = alone("flocs", time, -strain, share=0.5, skeleton=0.4, **values)
    assert other == pytest.approx(-stress)
    sound = alone("flocs", time, strain, share=0.5, skeleton=0.0, **values)
    assert sound == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("share", "rebuild", "strange"),
    [(0.2, 0.5, True), (-0.2, 0.5, False), (0.2, 20.0, False)],
)
def test_flocs_that_form_again_while_watched_are_on_no_list(share, rebuild, strange):
    law = next(x for x in STRANGERS if x.id == "flocs")
    scales = Data(("a",), (law.telltale(),), (law.telltale().strain,)).scales()
    values = {"share": share, "rebuild_s": rebuild * float(scales.duration_s[0])}
    assert law.strange(values, scales) == strange


def test_travel_that_wobbles_comes_again_at_each_pitch():
    strain = np.linspace(0, 1, 1001)
    values = {"size": 0.01, "pitch": 0.2, "phase": 0.7}
    wobble = alone("wobble", 10 * strain, strain, **values)
    assert wobble[::200] == pytest.approx(0.0, abs=1e-12)
    assert wobble[200:] == pytest.approx(wobble[:-200], abs=1e-12)
    assert np.ptp(wobble) == pytest.approx(0.02, rel=1e-3)
    assert wobble[10] == pytest.approx(0.01 * (np.sin(0.1 * np.pi + 0.7) - np.sin(0.7)))


@pytest.mark.parametrize(("pitch", "strange"), [(0.3, True), (0.7, False)])
def test_a_wobble_longer_than_the_travel_is_a_spring(pitch, strange):
    law = next(x for x in STRANGERS if x.id == "wobble")
    scales = Data(("a",), (law.telltale(),), (law.telltale().strain,)).scales()
    assert law.strange({"pitch": pitch * scales.strain}, scales) == strange


@pytest.mark.parametrize(("name", "size"), [("flocs", "share"), ("wobble", "size")])
def test_branches_feel_what_springs_feel(name, size):
    law = next(x for x in STRANGERS if x.id == name)
    chunk = Chunk(np.linspace(0, 20, 401), np.linspace(0, 1, 401))
    values = {"share": 0.5, "size": 0.02}
    terms = [Term(law, law.defaults() | {size: values[size]})]
    branches = np.where(np.arange(len(STIFFNESS)) < 3, 0.0, STIFFNESS)
    plain = simulate(UNITS, branches, [], [chunk])[0]
    moved = simulate(UNITS, branches, terms, [chunk])[0]
    assert np.abs(moved - plain).max() > 0.01 * np.abs(plain).max()


@pytest.mark.parametrize("pitch", [0.09, 0.137, 0.21, 0.33])
def test_a_wobble_of_any_pitch_is_found(pitch):
    law = next(x for x in STRANGERS if x.id == "wobble")
    time = np.linspace(0, 20, 800)
    chunk = Chunk(time, 0.4 * (1 - np.cos(0.3 * np.pi * time)) / 2)
    values = {"size": 0.004, "pitch": 0.4 * pitch, "phase": 0.9}
    units = Units("hooke", (0.0, 1.0))
    noise = 0.002 * np.random.default_rng(0).standard_normal(800)
    stress = simulate(units, [1.0], [Term(law, values)], [chunk])[0] + noise
    engine = Engine(Data(("a",), (chunk,), (stress,)))
    engine.set_noise([np.full(800, 0.002)], None)
    base = fit(engine, Guess(units, np.array([1.0])))
    found = at_best(engine, Screen(engine, base), law)
    assert found is not None
    assert found.chi2 < 1.1 * len(stress)
    own = found.guess.pieces[0].values
    assert own["pitch"] == pytest.approx(0.4 * pitch, rel=0.02)
