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
from forge_made import BASE, PACE, order

from bench.concealed import (
    forge,
    orders,
    rivals,
    sealing,
    settings,
)
from bench.concealed.bases import maxwell
from bench.concealed.planting import material_stress, run_material
from bench.concealed.programmes import FAMILIES, HELD_OUT, STEP_S, Imposed
from bench.concealed.unlisted import UNLISTED

FAMILIES_AND_HELD_OUT = FAMILIES | HELD_OUT


# --- cases ----------------------------------------------------------------------------


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
    judges = {"trial.py", "reporting.py", "noise_check.py", "unseen.py", "acting.py"}
    assert knowing == judges


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
