"""What recordings show by themselves: each fault alone, in its recordings, on a
material that no law of softnn describes; and nothing where there is no fault."""

from dataclasses import replace

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.effects import EFFECTS, effect
from softnn.effects._signs import APART, minority
from softnn.fit import Data, Engine
from softnn.mismatch.candidates import shown as screened

AMPLITUDES = (0.50, 0.40, 0.52, 0.45, 0.50, 0.48)
SPEEDS = (0.05, 0.1, 0.05, 0.1, 0.05, 0.1)
NOISE = 0.002


def programme(amplitude, speed, cycles=5):
    levels = np.array([0.0, *[amplitude, 0.0] * cycles])
    corners = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)) / speed)]) + 0.5
    time = np.arange(0, corners[-1], corners[-1] / 3000)
    return time, np.interp(time, corners, levels)


def foam(time, strain):
    """Softens by cycles, is slow to come back, and yields: no list has its law."""
    up = np.gradient(strain) > 0
    curve = np.where(up, np.tanh(4 * strain) + strain**3, 1.4 * strain**1.5)
    slow = np.exp(-time / time[-1] / 0.3)
    return curve * (1 + 0.3 * slow) - 0.05 * (1 - slow)


def recorded(
    change=None, odd=(), amplitudes=AMPLITUDES, material=foam, side=1, noise=NOISE
):
    rng = np.random.default_rng(4)
    chunks, stress = [], []
    for i, (amplitude, speed) in enumerate(zip(amplitudes, SPEEDS, strict=True)):
        time, strain = programme(amplitude, speed)
        measured = rng.uniform(0.85, 1.15) * material(time, strain)
        if i in odd:
            time, strain, measured = change(time, strain, measured)
        chunks.append(Chunk(time, side * strain))
        stress.append(side * measured + noise * rng.standard_normal(len(time)))
    return chunks, stress


def shown(recordings):
    found = {e.id: e.shown(*recordings) for e in EFFECTS}
    return {k: v for k, v in found.items() if v is not None}


def offset(time, strain, stress):
    return time, strain, stress + 0.06


def gap(time, strain, stress):
    """The machine counts 0.03 of strain before the specimen is taut."""
    speed = 0.05
    lead = np.arange(0, 0.03 / speed, time[1])
    return (
        np.concatenate([lead, time + 0.03 / speed]),
        np.concatenate([speed * lead, strain + 0.03]),
        np.concatenate([np.full(len(lead), stress[0]), stress]),
    )


def slip(time, strain, stress):
    """From two thirds of the first loading on, the specimen has 0.05 less."""
    top = np.argmax(strain > 0.99 * strain.max())
    lost = 0.05 * (np.arange(len(time)) > 2 * top // 3)
    return time, strain, foam(time, np.maximum(strain - lost, 0))


def drift(time, strain, stress):
    return time, strain, stress + 0.15 * time / time[-1]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("name", "change", "odd", "value"),
    [
        ("zero_offset", offset, (1, 4), 0.06),
        ("slack", gap, (0, 3), 0.03),
        ("slack", gap, (0, 2, 3, 5), 0.03),
        ("grip_slip", slip, (2,), 0.05),
    ],
)
def test_a_fault_of_some_recordings_shows_in_those(name, change, odd, value, side):
    found = shown(recorded(change, odd, side=side))
    assert set(found) == {name}
    law = effect(name)
    values = np.array(found[name][law.amplitude])
    assert set(np.flatnonzero(values)) == set(odd)
    sign = side if name != "slack" else 1
    assert values[list(odd)] == pytest.approx(sign * value, rel=0.35)


@pytest.mark.parametrize("side", [1, -1])
def test_a_drift_shows_where_cycles_do_not_settle(side):
    found = shown(recorded(drift, range(6), side=side))
    assert set(found) == {"load_cell_drift"}
    longest = programme(AMPLITUDES[2], SPEEDS[2])[0][-1]
    speed = side * found["load_cell_drift"]["drift_MPa_per_s"]
    assert 0.5 * 0.15 / longest < speed < 3 * 0.15 / longest


def test_a_clip_shows_as_one_highest_stress():
    chunks, stress = recorded()
    limit = 0.8 * max(s.max() for s in stress)
    found = shown((chunks, [np.minimum(s, limit) for s in stress]))
    assert found == {"load_cell_saturation": {"limit_MPa": pytest.approx(limit)}}


def yielding(time, strain):
    """A plateau that every specimen has is the material's."""
    return np.minimum(5 * strain, 1.0) + 0.2 * strain


def slow(time, strain):
    """Relaxation far longer than the recording: the stress at zero falls for long."""
    return strain - 0.2 * time / time[-1]


def settling(time, strain):
    """A stress at zero strain that builds up, towards the load, and stays."""
    return strain + 0.1 * -np.expm1(-time / time[-1] / 0.4)


def ratchet(time, strain):
    """The same with every new maximum: it goes on only where the cycles grow."""
    return strain + 0.2 * np.maximum.accumulate(strain)


@pytest.mark.parametrize("noise", [NOISE, 0.02])
@pytest.mark.parametrize("material", [foam, yielding, slow, settling, ratchet])
@pytest.mark.parametrize("amplitudes", [AMPLITUDES, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)])
def test_nothing_shows_without_a_fault(material, amplitudes, noise):
    found = shown(recorded(amplitudes=amplitudes, material=material, noise=noise))
    assert found == {}


def test_nothing_shows_where_one_recording_has_cycles_that_grow():
    """Its stress at zero strain moves on, as all others' have done at once."""
    chunks, stress = recorded(material=ratchet)
    grown = np.linspace(0.3, 0.5, 6)
    levels = np.ravel(np.column_stack([np.zeros(6), grown]))
    corners = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)) / 0.05)])
    time = np.arange(0, corners[-1], 0.03)
    strain = np.interp(time, corners, levels)
    for _ in range(9):  # most of the recordings
        chunks.append(Chunk(time, strain))
        stress.append(ratchet(time, strain))
    assert shown((chunks[6:], stress[6:])) == {}


def test_a_change_of_speed_is_no_slip():
    """A viscous stress falls where the machine slows down."""

    def slower(time, strain, stress):
        bend = time[np.argmax(strain > 0.6 * strain.max())]
        warped = np.where(time < bend, time, bend + (time - bend) * 2.5)
        rate = np.where(time < bend, 1.0, 0.4)
        return warped, strain, strain + 0.1 * rate * (strain > 0)

    def viscous(time, strain):
        return strain + 0.1 * (strain > 0)

    assert shown(recorded(slower, (2,), material=viscous)) == {}


def test_serrations_are_no_slip():
    def serrated(time, strain, stress):
        return time, strain, stress - 0.08 * ((25 * strain) % 1)

    assert "grip_slip" not in shown(recorded(serrated, (2,)))


def test_what_most_recordings_lose_is_the_material():
    assert "grip_slip" not in shown(recorded(slip, (0, 1, 2, 3)))


def coarse(recordings, every):
    chunks, stress = recordings
    thin = [Chunk(c.time_s[::every], c.strain[::every]) for c in chunks]
    return thin, [s[::every] for s in stress]


@pytest.mark.parametrize("every", [1, 10, 11, 12])  # 300 to 25 samples of a loading
def test_a_slip_shows_where_the_first_loading_has_few_samples(every):
    found = shown(coarse(recorded(slip, (2,), noise=0.0005), every))
    assert set(found) == {"grip_slip"}
    assert found["grip_slip"]["slip"] == pytest.approx([0, 0, 0.05, 0, 0, 0], abs=0.015)


def test_too_few_samples_show_no_slip():
    assert "grip_slip" not in shown(coarse(recorded(slip, (2,), noise=0.0005), 15))


def held(odd=(), response=0.0, law=np.tanh):
    """Ramps to six strains, each then held; in `odd` strain moves by 0.06 meanwhile.

    `response`: of what the stress would be if the specimen felt it.
    """
    rng = np.random.default_rng(5)
    time = np.arange(0, 60.0, 0.05)
    chunks, stress = [], []
    for i, top in enumerate(np.linspace(0.4, 0.6, 6)):
        strain = np.minimum(0.1 * time, top)
        moved = 0.06 * (i in odd) * np.clip((time - 40.0) / 0.5, 0, 1)
        felt = law(strain) + response * (law(strain + moved) - law(strain))
        slack = 0.7 + 0.3 * np.exp(-np.maximum(time - 10 * top, 0) / 8)
        chunks.append(Chunk(time, strain + moved))
        stress.append(felt * slack + 0.001 * rng.standard_normal(len(time)))
    return chunks, stress


@pytest.mark.parametrize("side", [1, -1])
def test_strain_that_moves_in_a_hold_without_stress_is_a_slip(side):
    chunks, stress = held((1, 4))
    chunks = [Chunk(c.time_s, side * c.strain) for c in chunks]
    found = shown((chunks, [side * s for s in stress]))
    assert set(found) == {"grip_slip"}
    expected = side * 0.06 * np.isin(range(6), (1, 4))
    assert found["grip_slip"]["slip"] == pytest.approx(expected, abs=0.002)
    moments = found["grip_slip"]["moment_s"]
    assert moments[[1, 4]] == pytest.approx(40.0, abs=2.0)


def test_strain_that_moves_in_a_hold_and_is_felt_is_none():
    assert shown(held((1, 4), response=1.0)) == {}
    assert shown(held((1, 4), response=0.3)) == {}
    assert shown(held()) == {}


def test_strain_that_moves_where_there_is_no_load_is_no_slip():
    chunks, stress = held((1, 4))
    broken = [0.001 * np.random.default_rng(i).standard_normal(1200) for i in range(6)]
    stress = [broken[i] if i in (1, 4) else s for i, s in enumerate(stress)]
    assert "grip_slip" not in shown((chunks, stress))


def test_a_step_on_the_way_of_what_slides_is_no_slip():
    def steps(time, strain, stress):
        up = strain - 0.2
        step = np.where(up < 0.03, up, np.where(up < 0.05, 0.03, up - 0.02))
        return time, strain, stress + 3 * np.clip(step, 0, 0.06)

    def sliding(time, strain):
        return np.minimum(20 * strain, 1.0)

    assert "grip_slip" not in shown(recorded(steps, (2,), material=sliding))


def test_what_slides_moves_without_stress_and_does_not_slip():
    def sliding(strain):
        return np.minimum(20 * strain, 1.0)

    assert shown(held((1, 4), law=sliding)) == {}


def test_zeros_agree_as_well_as_the_usual_stress_is_large():
    """One recording of ten times the stress does not make the others' zeros vague."""
    chunks, stress = recorded(offset, (1, 4), noise=0.0005)
    stress = [10 * s if i == 2 else s for i, s in enumerate(stress)]
    assert set(
        np.flatnonzero(shown((chunks, stress))["zero_offset"]["offset_MPa"])
    ) == {
        1,
        4,
    }


def test_little_is_no_fault():
    def little(time, strain, stress):
        return time, strain, stress + 0.008

    def hardly(time, strain, stress):
        return time, strain, stress + 0.01 * time / time[-1]

    assert shown(recorded(little, (1, 4), noise=0.0005)) == {}
    straight = recorded(hardly, range(6), material=lambda _, e: e, noise=0.0001)
    assert shown(straight) == {}


def test_coarse_steps_of_a_channel_are_no_fault():
    chunks, stress = recorded()
    step = 0.03 * max(s.max() for s in stress)
    coarse = [step * np.round(s / step) for s in stress]
    assert shown((chunks, coarse)) == {}
    coarse[1] += step  # what rounding may do
    assert shown((chunks, coarse)) == {}


def test_a_channel_that_lags_is_not_slack():
    def late(time, strain, stress):
        return time, strain, np.interp(time - 0.4, time, stress)

    assert "slack" not in shown(recorded(late, range(6)))


def test_two_recordings_tell_no_odd_one():
    chunks, stress = recorded(offset, (1,))
    assert shown((chunks[:2], stress[:2])) == {}


def test_without_rest_at_the_beginning_there_is_no_zero():
    def high(time, strain, stress):
        return time, strain, stress + 2.0

    chunks, stress = recorded(high, (1, 4))
    begun = [slice(np.argmax(c.strain > 0.1), None) for c in chunks]
    cut = [Chunk(c.time_s[b], c.strain[b]) for c, b in zip(chunks, begun, strict=True)]
    assert shown((cut, [s[b] for s, b in zip(stress, begun, strict=True)])) == {}


def test_empty_channels_and_idle_recordings_show_nothing_and_break_nothing():
    chunks, stress = recorded(offset, (1, 4))
    stress[0] = np.full(len(stress[0]), np.nan)
    chunks[2] = Chunk(chunks[2].time_s, np.zeros(len(chunks[2].time_s)))
    chunks[3], stress[3] = (
        Chunk(chunks[3].time_s[:2], chunks[3].strain[:2]),
        stress[3][:2],
    )
    found = shown((chunks, stress))
    assert set(found) <= {"zero_offset"}
    nothing = [np.full(len(s), np.nan) for s in stress]
    assert shown((chunks, nothing)) == {}


def test_a_recording_that_does_not_begin_at_rest_leaves_the_others_their_zero():
    chunks, stress = recorded(offset, (1, 4))
    late = slice(np.argmax(chunks[5].strain > 0.1), None)
    chunks[5] = Chunk(chunks[5].time_s[late], chunks[5].strain[late])
    stress[5] = stress[5][late]
    offsets = shown((chunks, stress))["zero_offset"]["offset_MPa"]
    assert np.flatnonzero(offsets).tolist() == [1, 4]
    assert offsets[[1, 4]] == pytest.approx(0.06, abs=0.01)


def test_the_few_are_those_beyond_the_spread_of_the_others():
    values = np.array([0.0, 1.0, 0.2, 2.5, 0.4])
    assert minority(values).tolist() == []
    values[3] = 1.0 + 1.01 * APART * np.std([0.0, 1.0, 0.2, 0.4])
    assert minority(values).tolist() == [3]
    assert minority(values, floor=0.5).tolist() == []
    assert minority(-values).tolist() == [3]
    assert minority(-values, above=True).tolist() == []


def test_what_is_shown_becomes_a_piece_of_the_fit():
    chunks, stress = recorded(offset, (1, 4))
    data = Data(tuple("abcdef"), tuple(chunks), tuple(stress))
    (piece,) = screened(Engine(data), EFFECTS)
    assert piece.effect.id == "zero_offset"
    assert piece.groups == ((1,), (4,))
    assert piece.values["offset_MPa"][[0, 2, 3, 5]].tolist() == [0, 0, 0, 0]
    # A specimen that goes on from another recording is not at rest.
    assert screened(Engine(replace(data, continued=True)), EFFECTS) == []


@pytest.mark.parametrize("step", [2, 5])
def test_stamps_that_repeat_are_no_sign_and_break_nothing(step):
    """A clock coarser than the sampling: several samples at one time."""
    chunks, stress = recorded(noise=0.0005)
    coarse = [
        Chunk(np.repeat(c.time_s[::step], step)[: len(c.strain)], c.strain)
        for c in chunks
    ]
    assert shown((coarse, stress)) == {}
