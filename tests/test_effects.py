"""Properties every effect must have, none of them written for one effect.

An exemption stands on the class (`exempt`), with its reason.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effects_made import STIFFNESS, UNITS, planted, stress

import softnn.effects
from softnn.contracts import Chunk, Effect, InputError, Scales
from softnn.effects import EFFECTS, effect
from softnn.fit import Data, Engine, Guess, Piece, fit, get, put, slots
from softnn.simulate import Term, measured, reach, simulate, to_model

LAWS = [law for e in EFFECTS for law in (e, *e.second_forms)]

IDS = [law.form for law in LAWS]


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
        springs, branches, state = UNITS.respond(to_model(signal), state)
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

        def own(x, j=j):
            return np.ascontiguousarray(x[..., min(j, x.shape[-1] - 1), None])

        alone = {
            port: own(x)
            for port in ("strain", "branch_strain", "branch_time_s")
            if (x := getattr(signal, port)) is not None
        }
        parts = tuple((own(w), own(e)) for w, e in signal.branch_parts)
        inner = to_model(replace(signal, **alone, branch_parts=parts))
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


@pytest.mark.parametrize("continued", [False, True])
@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_moves_made_at_once_equal_one_at_a_time(law, continued):
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
    data = Data(("a", "b"), (chunk, chunk), (chunk.strain, chunk.strain), continued)
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
        low, high = p.allowed
        for bad in (np.nan, low - 1 - abs(low), high + 1 + abs(high)):
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


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_a_search_starts_where_there_is_something_of_it(law):
    scales = Scales(0.5, 1.0, 0.01, np.array([60.0]), 3.0, 5.0)
    some = law.within(scales)
    closer = [values for shape in some.closer(scales) for values in shape]
    for values in [*some.starts(scales), *closer]:
        size = np.abs((law.defaults() | values)[law.amplitude])
        assert size.max() > 0 or law.off.get(law.amplitude) != 0
