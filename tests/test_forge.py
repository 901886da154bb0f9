"""What the forge makes: effects of the stated size, noise, cases, their key."""

from __future__ import annotations

import ast
import itertools
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from bench.concealed import (
    forge,
    noises,
    oracle,
    orders,
    rivals,
    sealing,
    sensor,
    settings,
)
from bench.concealed.bases import Base, maxwell
from bench.concealed.planting import Context, Planted, material_stress, run_material
from bench.concealed.programmes import FAMILIES, HELD_OUT, STEP_S, Imposed, Pace
from bench.concealed.unlisted import UNLISTED

FAMILIES_AND_HELD_OUT = FAMILIES | HELD_OUT
PACE = Pace(peak=0.8, ramp_s=3.0, corner_s=0.2, cycle_hz=0.5)
BASE = Base("linear", {}, 1.0, 0.8, ())  # stress is strain: sizes are read off it


# --- strength -------------------------------------------------------------------------


def planted(name: str, seed: int, strength: float = 1.0) -> tuple[Planted, Context]:
    """An effect planted in unit stiffness; one branch where it needs one."""
    rng = np.random.default_rng(seed)
    base = replace(BASE, branches=((0.5, 2.0),))
    programmes = [
        Imposed(n, s := f(rng, PACE), np.arange(len(s)))
        for n, f in FAMILIES.items()
        if n != "hold"
    ]
    rest = [np.full(len(p.strain), 23.0) for p in programmes]
    stress = run_material(base, (), programmes, rest, False)
    context = Context(rng, strength, base, PACE, programmes, stress)
    make = dict(zip(orders.NAMES, orders.EFFECTS, strict=True))[name]
    return make(context), context


def elastic(effect: Planted, strain: np.ndarray, degC: float = 23.0) -> np.ndarray:
    return material_stress(BASE, [effect], strain, np.full(len(strain), degC))


UP_DOWN = np.concatenate([np.linspace(0, 0.8, 4001), np.linspace(0.8, 0, 4001)[1:]])


def softening(p: Planted, c: Context) -> float:
    again = elastic(p, np.concatenate([UP_DOWN, UP_DOWN[:40]]))[-1] / UP_DOWN[39]
    return 1 - again / (elastic(p, UP_DOWN[:40])[-1] / UP_DOWN[39])


def residual(p: Planted, c: Context) -> float:
    down = elastic(p, UP_DOWN)[4000:]
    return float(np.interp(0, down[::-1], UP_DOWN[4000:][::-1])) / 0.8


def loop(p: Planted, c: Context) -> float:
    stress = elastic(p, UP_DOWN)
    return float(stress[2000] - stress[-2001]) / 2 / c.peak


def cycle_loss(p: Planted, c: Context) -> float:
    many = elastic(p, np.tile(UP_DOWN, 11))
    # Mid-loading of the second cycle and of the eleventh: a decade of cycles.
    first, tenth = many[8000 + 2000], many[80_000 + 2000]
    return float(1 - tenth / first)


def drift_per_hour(p: Planted, c: Context) -> float:
    long = Imposed("hold", np.zeros(75_001), np.arange(75_001))  # 300 s
    drift = p.sensor(0, long, np.zeros(75_001))
    return abs(drift[-1]) * 12 / c.peak


def taut(p: Planted, c: Context) -> float:
    strain = UP_DOWN[:4001]
    programme = Imposed("ramp", strain, np.arange(4001))
    return float(strain[-1] - p.rig(0, programme, strain)[-1]) / PACE.peak


def slipped(p: Planted, c: Context) -> float:
    lost = [
        float((m.strain - p.rig(i, m, m.strain))[-1])
        for i, m in enumerate(c.programmes)
    ]
    assert 0 < np.sum(np.array(lost) > 1e-9) < len(lost)  # in some, not in all
    return max(lost) / PACE.peak


def recorded(p: Planted, c: Context) -> list[np.ndarray]:
    return [
        p.sensor(i, m, s)
        for i, (m, s) in enumerate(zip(c.programmes, c.stress, strict=True))
    ]


def offset(p: Planted, c: Context) -> float:
    moved = [float(r[0] - s[0]) for r, s in zip(recorded(p, c), c.stress, strict=True)]
    assert np.count_nonzero(moved) == round(len(moved) / 3)
    return max(np.abs(moved)) / c.peak


def gain(p: Planted, c: Context) -> float:
    ratio = [r.max() / s.max() for r, s in zip(recorded(p, c), c.stress, strict=True)]
    changed = np.abs(np.array(ratio) - 1)
    assert np.count_nonzero(changed > 1e-9) == round(len(ratio) / 3)
    return float(changed.max())


def clipped(p: Planted, c: Context) -> float:
    return max(float(r.max()) for r in recorded(p, c)) / c.peak


def mean_delay(p: Planted, c: Context) -> float:
    ramp = STEP_S * np.arange(5000)
    return float(ramp[-1] - p.sensor(0, Imposed("", ramp, np.arange(5000)), ramp)[-1])


def inertial(p: Planted, c: Context) -> float:
    moved = [
        np.abs(r - s)[50:-50].max()
        for r, s, m in zip(recorded(p, c), c.stress, c.programmes, strict=True)
        if m.family == "sine"
    ]
    return float(max(moved)) / c.peak


def stiffness_of_extra(p: Planted, c: Context) -> float:
    jump = elastic(p, np.full(2, 1e-6))
    return float(jump[0] / 1e-6 - 1)


def change_of_branch(p: Planted, c: Context) -> float:
    base = replace(BASE, branches=((1.0, 1e9),))
    still = np.full(2, 23.0)

    def tangent(e: float) -> float:
        jump = np.array([e, e + 1e-5])
        if p.form == "amplified":
            return float(
                material_stress(base, [p], jump[:1], still[:1])[0]
                - material_stress(BASE, [], jump[:1], still[:1])[0]
            ) / float(e)
        whole = material_stress(base, [p], jump, still)
        return float((whole[1] - whole[0]) / 1e-5 - 1)

    ratio = tangent(0.8) / tangent(1e-4)
    return max(ratio, 1 / ratio)


def stiffness_ratio(p: Planted, c: Context) -> float:
    tangent = np.gradient(elastic(p, UP_DOWN[:4001]))
    return float(tangent.max() / tangent.min())


def compression_lost(p: Planted, c: Context) -> float:
    return 1 - float(elastic(p, np.full(2, -0.5))[0]) / -0.5


def per_degree(p: Planted, c: Context) -> float:
    warm, cool = (elastic(p, UP_DOWN[:4001], t)[-1] for t in (23.5, 22.5))
    return float((cool - warm) / 0.8)


# What strength 1 means, read off signals: (what, lowest, highest).
STRENGTH = {
    "slack": (taut, 0.02, 0.081),
    "grip_slip": (slipped, 0.06, 0.14),
    "nonlinear_elasticity": (stiffness_ratio, 2.0, 8.0),
    "mullins_softening": (softening, 0.23, 0.51),
    "permanent_set": (residual, 0.05, 0.20),
    "friction_hysteresis": (loop, 0.035, 0.121),
    "relaxation_branch": (stiffness_of_extra, 0.28, 0.71),
    "nonlinear_viscosity": (stiffness_of_extra, 0.69, 1.31),
    "strain_dependent_relaxation": (change_of_branch, 1.98, 3.03),
    "thermal_softening": (per_degree, 0.006, 0.015),
    "cyclic_softening": (cycle_loss, 0.07, 0.17),
    "tension_only": (compression_lost, 0.95, 1.0),
    "inertia": (inertial, 0.035, 0.121),
    "sensor_lag": (mean_delay, 0.118, 0.402),
    "load_cell_drift": (drift_per_hour, 0.42, 1.95),
    "zero_offset": (offset, 0.03, 0.08),
    "gain_error": (gain, 0.06, 0.15),
    "load_cell_saturation": (clipped, 0.68, 0.86),
}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", STRENGTH)
def test_strength_one_is_what_it_says(name, seed):
    measure, low, high = STRENGTH[name]
    assert low <= measure(*planted(name, seed)) <= high


def test_every_effect_has_its_strength_measured():
    # Finite strain has no size of its own: it is the largest strain that makes it.
    assert set(STRENGTH) == set(orders.NAMES) - {"finite_strain"}


@pytest.mark.parametrize("name", orders.NAMES)
def test_an_effect_vanishes_with_its_strength(name):
    effect, c = planted(name, 1, strength=1e-6)
    rest = [np.full(len(p.strain), 20.0) for p in c.programmes]
    with_it = run_material(c.base, [effect], c.programmes, rest, False)
    for i, (a, b) in enumerate(zip(with_it, c.stress, strict=True)):
        read = effect.sensor(i, c.programmes[i], a) if effect.sensor else a
        np.testing.assert_allclose(read, b, atol=1e-4 * c.peak)


@pytest.mark.parametrize("name", [m.__name__ for m in UNLISTED])
def test_unlisted_things_have_the_stated_size(name):
    answer = forge.forge_case(order("unlisted", (name,), 7)).answer
    share = answer["planted"][name]["parameters"]["share_of_peak"]
    # Those that scale stiffness cannot always reach it: their size is capped.
    size = answer["planted"][name]["parameters"]["size"]
    assert 0.079 <= share <= 0.152 or (size == 0.6 and share < 0.08)


def test_running_mean_and_poles_do_not_look_ahead():
    step = (np.arange(2000) >= 1000).astype(float)
    for seed in range(6):
        effect, _ = planted("sensor_lag", seed)
        read = effect.sensor(0, Imposed("", step, np.arange(2000)), step)
        np.testing.assert_allclose(read[:1000], 0, atol=1e-12)
    assert sensor.low_pass(np.full(10, 3.0), 0.1) == pytest.approx(np.full(10, 3.0))


# --- noise and oracle -----------------------------------------------------------------


@pytest.mark.parametrize("kind", noises.KINDS)
def test_noise_has_the_stated_level(kind):
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0, 4000, 40_000))
    clean = np.abs(np.sin(time / 9))
    noise = noises.Noise(kind, 0.01, 0.3 if kind == "coloured" else 0.0, 3.0)
    error = noise.add(rng, time, clean, 1.0) - clean
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.01, rel=0.03)


def test_coloured_noise_forgets_exponentially_on_an_irregular_clock():
    rng = np.random.default_rng(6)
    time = np.cumsum(rng.uniform(0.05, 0.4, 200_000))
    noise = noises.Noise("coloured", 1.0, 0.3, 1.0)
    error = noise.add(rng, time, np.zeros_like(time), 1.0)
    gap = np.diff(time)
    for low, high in ((0.05, 0.1), (0.2, 0.25), (0.35, 0.4)):
        near = (gap > low) & (gap < high)
        found = np.mean(error[:-1][near] * error[1:][near])
        assert found == pytest.approx(np.mean(np.exp(-gap[near] / 0.3)), abs=0.02)
    white = oracle.whiten(error[:, np.newaxis], [time], 0.3)[:, 0]
    assert np.std(white) == pytest.approx(1, abs=0.01)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.01


def test_oracle_power_is_that_of_a_normal_test():
    edge = norm.ppf(1 - oracle.FALSE_ALARM / 2)
    for energy in (0.0, 2.0, 9.0, 30.0):
        shift = np.sqrt(energy)
        exact = norm.sf(edge - shift) + norm.cdf(-edge - shift)
        assert oracle.power(energy, 1) == pytest.approx(exact, rel=1e-6)


def test_oracle_sees_only_what_the_base_cannot_move():
    rng = np.random.default_rng(2)
    strain = FAMILIES["growing"](rng, PACE)
    p = Imposed("growing", strain, np.arange(0, len(strain), 10))
    refit = oracle.refit("pl-wiechert", [p], [np.zeros(0)], [2.0])
    time, sigma = [p.time_s[p.index]], np.full(len(p.index), 0.01)
    inside = (maxwell(strain, 2.0) + np.clip(strain, 0, strain.max() / 2))[p.index]
    still = np.zeros_like(inside)
    seen = oracle.visible_energy(refit, still, inside, time, sigma, 0.0)
    assert seen < 1e-6 * np.sum((inside / sigma) ** 2)
    outside = rng.standard_normal(len(p.index))
    seen = oracle.visible_energy(None, still, outside, time, sigma, 0.0)
    assert seen == pytest.approx(np.sum((outside / sigma) ** 2))
    # One branch cannot be two, though each alone is one that it could be.
    one = oracle.refit("pl-sls", [p], [np.zeros(0)], [2.0, 20.0])
    two = maxwell(strain, 2.0)[p.index], maxwell(strain, 20.0)[p.index]
    assert oracle.visible_energy(one, *two, time, sigma, 0.0) > 100
    assert oracle.visible_energy(one, two[0], 0.5 * two[0], time, sigma, 0.0) < 1e-3
    left = oracle.absorb(refit, inside, sigma)
    assert np.sqrt(np.mean(left**2)) < 1e-6
    # Beside another effect: what a bend of that, or a lag, could be is not seen.
    able = oracle.bent(None, [outside], [p])
    for bend in (outside * strain[p.index] ** 2, np.r_[[outside[0]] * 3, outside[:-3]]):
        assert oracle.visible_energy(able, still, bend, time, sigma, 0.0) < 1e-3
    assert oracle.visible_energy(able, still, inside, time, sigma, 0.0) > 1e4


# --- cases ----------------------------------------------------------------------------


def order(group: str, effects: tuple[str, ...], number: int = 0) -> orders.Order:
    return orders.Order("case-0001", group, effects, 1.0, 11, number)


@pytest.mark.parametrize("number", range(6))
def test_nothing_is_missing_from_a_null(number):
    answer = forge.forge_case(order("null", (), number)).answer
    # What a refit leaves of the clean stress drowns in the noise, everywhere.
    assert answer["left_nrmse"] < 0.06 * answer["noise_nrmse"]
    assert not any(answer["left"])
    assert not any(answer["acts"])


@pytest.fixture(scope="module")
def forged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("forged")
    wanted = orders.plan(
        12,
        1.0,
        each=1,
        nulls=2,
        pairs=1,
        unlisted=1,
        only=["mullins_softening", "thermal_softening"],
        dirty=0.5,
    )
    sealing.write_cases(wanted, folder)
    return folder, wanted


def test_a_case_shows_nothing_but_the_recordings(forged):
    folder, wanted = forged
    answers = sealing.open_key(folder)
    assert len(answers) == len(wanted) == 6
    assert {p.name for p in folder.iterdir()} == {"cases", "sealed", "seal.json"}
    for answer in answers:
        case = folder / "cases" / answer["case"]
        assert {p.name for p in case.iterdir()} == {"recordings", "case.toml"}
        told = tomllib.loads((case / "case.toml").read_text())
        assert set(told) <= {"model", "history", "specimen"}
        assert ("model" in told) != answer["simulated"]
        files = sorted((case / "recordings").iterdir())
        assert [f.stem for f in files] == [r["name"] for r in answer["recordings"]]
        written, clean = [], []
        for file, r in zip(files, answer["recordings"], strict=True):
            table = pd.read_csv(file)
            assert len(table) == r["samples"]
            assert 250 <= len(table) <= 3100
            assert (np.diff(table.time_s) > 0).all()
            assert set(table) <= {
                "time_s",
                "strain",
                "stress_MPa",
                "temperature_C",
                "simulated_MPa",
            }
            assert answer["dirty"] == bool(table.stress_MPa.isna().any())
            written.append(table.stress_MPa.to_numpy())
            clean.append(r["clean_MPa"])
        left = np.concatenate(written) - np.concatenate(clean)
        sigma = answer["noise"]["sigma_MPa"]
        assert np.sqrt(np.nanmean(left**2)) == pytest.approx(sigma, rel=0.15)
        assert sigma == pytest.approx(
            answer["noise"]["level"] * np.ptp(np.concatenate(clean)), rel=1e-4
        )


def test_the_key_is_refused_when_it_has_been_touched(forged, tmp_path):
    folder, wanted = forged
    again = tmp_path / "again"
    seal = sealing.write_cases(wanted, again)
    assert seal == json.loads((folder / "seal.json").read_text())["key_sha256"]
    (again / "sealed" / "key.json.gz").write_bytes(b"other")
    with pytest.raises(ValueError, match="the key has SHA-256"):
        sealing.open_key(again)
    with pytest.raises(FileExistsError, match="is not empty"):
        sealing.write_cases(wanted, again)


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(forged, tmp_path):
    folder, wanted = forged
    seal = sealing.write_cases(wanted, tmp_path / "two", jobs=2)
    assert seal == json.loads((folder / "seal.json").read_text())["key_sha256"]


def test_the_unseen_programme_is_the_same_specimen_again():
    one = order("single", ("nonlinear_viscosity",), 4)
    _, setting, effects = forge.draw_case(one)
    kept = forge.unseen(one, setting, effects)
    assert kept is not None
    strain = FAMILIES_AND_HELD_OUT["zigzag"](
        np.random.default_rng([one.seed, one.number, 1]), setting.pace
    )
    stress = material_stress(setting.base, effects, strain, np.zeros(len(strain)))
    index = np.round(np.array(kept["time_s"]) / STEP_S).astype(int)
    np.testing.assert_allclose(kept["clean_MPa"], stress[index], rtol=1e-6)
    assert forge.unseen(order("single", ("slack",)), setting, effects) is None


def test_a_continued_history_is_one_history():
    rng = np.random.default_rng(1)
    strains = [f(rng, PACE) for f in (FAMILIES["sine"], FAMILIES["growing"])]
    programmes = [Imposed("", s, np.arange(len(s))) for s in strains]
    rest = [np.full(len(s), 23.0) for s in strains]
    base = replace(BASE, branches=((0.7, 20.0),))
    parts = run_material(base, (), programmes, rest, continued=True)
    whole = base.spring(np.concatenate(strains))
    whole = whole + 0.7 * maxwell(np.concatenate(strains), 20.0)
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)
    fresh = run_material(base, (), programmes, rest, continued=False)
    np.testing.assert_array_equal(fresh[0], parts[0])
    assert np.abs(fresh[1] - parts[1]).max() > 0.01


def test_rivals_that_can_be_told_apart_and_one_that_cannot():
    # An offset in some recordings is a far cry from softening.
    one = order("single", ("zero_offset",), 3)
    answer = forge.forge_case(one).answer
    power = rivals.distinct_power(one, answer)
    assert "zero_offset" not in power
    assert power["mullins_softening"] > 0.99
    assert list(power.values()) == sorted(power.values())
    # Nothing at all can be told from anything: only false alarms are left.
    nothing = order("null", (), 3)
    power = rivals.distinct_power(nothing, forge.forge_case(nothing).answer)
    assert max(power.values()) < 0.02


def test_an_answer_can_be_forged_again(forged):
    folder, wanted = forged
    assert [orders.order_of(a) for a in sealing.open_key(folder)] == wanted


def test_no_pair_excludes_itself():
    names = {n for bad in orders.NOT_TOGETHER for n in bad}
    assert names <= set(orders.NAMES)
    wanted = orders.plan(1, 1.0, each=0, nulls=0, pairs=40, unlisted=0)
    assert len({o.effects for o in wanted}) == 40
    for one, two in itertools.combinations(wanted, 2):
        assert set(one.effects) != set(two.effects)


def test_the_forge_knows_nothing_of_softnn():
    knowing = set()
    for file in Path(forge.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [getattr(node, "module", None) or ""]
            if isinstance(node, ast.Import):
                names = [a.name for a in node.names]
            if isinstance(node, ast.Import | ast.ImportFrom) and any(
                n.split(".")[0] == "softnn" for n in names
            ):
                knowing.add(file.name)
    assert knowing == {"trial.py", "reporting.py", "noise_check.py"}


def test_a_case_is_made_at_any_level_of_noise():
    # No bent spring is good enough beside noise as small as that.
    springs: dict[float, list[str]] = {1e-6: [], 0.01: []}
    for level, names in springs.items():
        for number in range(12):
            one = replace(order("single", ("slack",), number), level=level)
            rng = np.random.default_rng([one.seed, one.number])
            names.append(settings.draw_setting(rng, one).base.name)
    assert set(springs[1e-6]) == {"linear"}
    assert set(springs[0.01]) > {"linear"}


def test_unlisted_things_take_turns():
    wanted = orders.plan(5, 1.0, each=0, nulls=0, pairs=0, unlisted=60)
    counts = pd.Series([o.effects[0] for o in wanted]).value_counts()
    assert set(counts.index) == {m.__name__ for m in UNLISTED}
    assert counts.max() - counts.min() <= 1


@pytest.mark.parametrize("colour", [0.0, 0.1, 1.0])
def test_prescribed_noise_is_as_prescribed(colour):
    one = replace(order("single", ("zero_offset",), 7), level=0.005)
    one = replace(one, correlation_s=colour)
    forged = forge.forge_case(one)
    clean, left = [], []
    by_step = []
    for r in forged.answer["recordings"]:
        table = forged.tables[r["name"]]
        noise = table.stress_MPa.to_numpy() - np.array(r["clean_MPa"])
        step = np.diff(table.time_s)
        keep = np.exp(-step / colour) if colour else np.zeros_like(step)
        by_step.append(noise[1:] * noise[:-1] - keep * noise[:-1] ** 2)
        clean.append(r["clean_MPa"])
        left.append(noise)
    sigma = 0.005 * np.ptp(np.concatenate(clean))
    assert np.sqrt(np.mean(np.concatenate(left) ** 2)) == pytest.approx(sigma, rel=0.2)
    # Neighbours correlate as exp(-step / time), whatever the step.
    products = np.concatenate(by_step) / sigma**2
    assert abs(products.mean()) < 4 / np.sqrt(len(products))
    assert orders.order_of(forged.answer) == one
    # The same material and effect at any noise: only what is drawn last differs.
    other = forge.forge_case(replace(one, correlation_s=None))
    assert (
        other.answer["planted"]["zero_offset"]["parameters"]
        == (forged.answer["planted"]["zero_offset"]["parameters"])
    )
