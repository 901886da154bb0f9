"""Detection limits: what is swept, what is kept when stopped, what is counted."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from bench import scoring
from bench.hands import grid
from bench.hands.families import EFFECTS, SIDES
from bench.hands.power import power
from bench.hands.testing import simulate
from bench.limits import reporting as limits_report
from bench.limits import summary
from bench.limits import trial as limits

ROOT = Path(__file__).parents[1]
GRID = limits.Grid(
    12, ("slack", "inertia"), (0.1, 1.0), (0.002, 0.01), ("white", "long"), 3, 5
)


# --- the grid -------------------------------------------------------------------------


def test_a_case_is_the_same_in_every_grid_that_holds_it():
    wanted = GRID.orders()
    assert len(wanted) == 2 * 2 * 2 * 2 * 3 + 2 * 5
    assert len({o.name for o in wanted}) == len(wanted)
    larger = replace(
        GRID, effects=EFFECTS, strengths=limits.STRENGTHS, cases=4, nulls=9
    )
    assert set(wanted) <= set(larger.orders())
    assert {o.name for o in wanted}.isdisjoint(
        o.name for o in replace(GRID, seed=13).orders()
    )
    # Cut short anywhere, every cell has had about the same number of cases.
    half = wanted[: len(wanted) // 2]
    counts = pd.Series([(o.effect, o.strength, o.level) for o in half]).value_counts()
    assert counts.max() - counts.min() <= 5


def order(effect, strength, level, colour, index=0):
    return limits.Order(effect, strength, level, colour, index, 12, SIDES[0])


def test_a_curve_over_strength_is_one_specimen_with_more_of_the_effect():
    weak, strong = (
        grid.at(12, 0, "zero_offset", s, 0.005, limits.COLOURS["short"], SIDES[0])
        for s in (0.1, 1.0)
    )
    for a, b in zip(weak.setup.courses, strong.setup.courses, strict=True):
        np.testing.assert_array_equal(a.strain, b.strain)
    assert weak.planted[0][1] == pytest.approx(0.1 * strong.planted[0][1])
    energy = [c.energies["energy_alone"]["zero_offset"] for c in (weak, strong)]
    # An offset is linear: a tenth of it has a hundredth of the energy.
    assert energy[1] / energy[0] == pytest.approx(100, rel=0.1)
    low, high = (c.energies["oracle_power"][0] for c in (weak, strong))
    assert low < high


def test_strength_one_is_as_clear_for_every_law_and_the_noise_is_as_asked():
    for effect in ("mullins_softening", "sensor_lag"):
        case = grid.at(12, 1, effect, 1.0, grid.LEVEL, 0.0, SIDES[0])
        act, a = case.planted[0]
        told = case.energies["energy_alone"][effect]
        assert a == act.limit or told == pytest.approx(grid.CLEAR, rel=0.2)
        clean = simulate(case.setup, ())
        span = max(c.max() for c in clean) - min(c.min() for c in clean)
        np.testing.assert_allclose(case.noise.levels, grid.LEVEL * span)
    quiet = grid.at(12, 1, "", 1.0, 0.002, 1.0, SIDES[0])
    assert (quiet.cls, quiet.planted) == ("null", [])
    assert quiet.noise.times.tolist() == [1.0]


def test_power_is_the_false_alarm_at_no_energy_and_a_normal_tail_of_one_parameter():
    assert power(0.0, 4) == pytest.approx(0.01, rel=1e-6)
    # One parameter: a two-sided test of a normal mean (any textbook).
    limit = norm.isf(0.005)
    exact = norm.sf(limit - 3) + norm.cdf(-limit - 3)
    assert power(9.0, 1) == pytest.approx(exact, rel=1e-6)


def test_every_grid_has_trial_and_development_seeds_alike():
    for arguments, nulls, cells in (
        (["--quick"], 90, 19 * 5 * 1 * 3 * 2),
        ([], 1200, 19 * 6 * 3 * 3 * 10),
    ):
        grid = limits.grid_of(limits.make_parser().parse_args(arguments))
        wanted = grid.orders()
        assert sum(o.effect == "null" for o in wanted) == nulls
        assert sum(o.effect != "null" for o in wanted) == cells


# --- stopping and going on ------------------------------------------------------------


def fake(order: limits.Order) -> dict:
    """An outcome as the power of the oracle has it: named from strength 1 on."""
    single = order.effect != "null"
    named = single and order.strength >= 1
    selected = [order.effect] if named else []
    return {
        "effect": order.effect,
        "strength": order.strength,
        "level": order.level,
        "colour": order.colour,
        "number": order.index,
        "verdict": "explained" if named else "nothing_missing",
        "selected": selected,
        "equivalent": [],
        "named": named,
        "right": named or not single,
        "oracle": min(order.strength, 0.9) if single else None,
        "energy": 4000 * order.strength**2 if single else None,
        "samples": 1000,
        "base_nrmse": 0.01,
        "sigma_over_true": 1.0 if single else 0.5,
        "correlation_s": limits.COLOURS[order.colour],
        "seconds": 2.0,
        "error": None,
    }


def test_stopped_by_ctrl_c_it_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    called: list[str] = []

    def interrupted(order: limits.Order) -> dict:
        called.append(order.name)
        if len(called) == 4:
            raise KeyboardInterrupt
        return fake(order)

    monkeypatch.setattr(limits, "outcome", interrupted)
    monkeypatch.setattr(limits, "code", lambda: "as it was")
    grid = ["--effects", "slack", "--strengths", "0.1", "1", "--levels", "0.01"]
    grid += ["--cases", "3", "--nulls", "2", "--jobs", "1", "--seed", "12"]
    assert limits.main(grid) == 130
    assert limits.main(["--report", *grid]) == 0  # of the three there are
    assert "21 cases of the grid are missing" in capsys.readouterr().out
    assert limits.main(grid) == 0
    assert "3 of 24 cases were diagnosed before" in capsys.readouterr().out
    assert len(called) == 25  # the fourth, alone, was begun twice
    assert len(set(called)) == 24
    assert limits.main(grid) == 0
    assert len(called) == 25
    result = json.loads((tmp_path / "mlruns/limits/seed-12/limits.json").read_text())
    assert result["headline"]["power_ratio/slack"] == pytest.approx(0.5 / 0.5)
    assert result["record"]["published"] is False
    # Other code, other outcomes.
    monkeypatch.setattr(limits, "code", lambda: "changed")
    assert limits.main(["--report", *grid]) == 2
    assert "holds no case of this grid and this code" in capsys.readouterr().err


def test_code_is_told_by_what_it_does(tmp_path, monkeypatch):
    (tmp_path / "hands").mkdir()
    file = tmp_path / "hands" / "x.py"
    monkeypatch.setattr(limits, "HERE", tmp_path)
    found = []
    for text in ("a = 1\n", "a = (1)  # a remark\n", "a = 2\n"):
        file.write_text(text)
        found.append(limits.code())
    assert found[0] == found[1] != found[2]


def kept(folder: Path) -> dict[str, str]:
    file = folder / "mlruns" / "limits" / "seed-12.sqlite"
    if not file.exists():
        return {}
    with sqlite3.connect(file, timeout=5) as base:
        try:
            return dict(base.execute("SELECT name, row FROM outcomes"))
        except sqlite3.OperationalError:  # the table is being made
            return {}


def ends(group: int) -> bool:
    """Whether no process of a group is left within a minute."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_killed_it_keeps_what_was_finished(stop, tmp_path):
    command = [sys.executable, "-m", "studies.limits", "--seed", "12", "--jobs", "2"]
    command += ["--effects", "zero_offset", "--strengths", "1", "--levels", "0.01"]
    command += ["--colours", "white", "--cases", "6", "--nulls", "1"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}

    def start() -> subprocess.Popen:
        return subprocess.Popen(
            command,
            cwd=tmp_path,
            env=environment,
            start_new_session=True,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    child = start()
    deadline = time.monotonic() + 900  # slow machines, several tests at a time
    while len(kept(tmp_path)) < 2:
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    if stop == signal.SIGINT:  # a terminal sends it to all of them
        os.killpg(child.pid, stop)
    else:
        child.send_signal(stop)
    child.communicate(timeout=120)
    assert child.returncode == (-9 if stop == signal.SIGKILL else 130)
    assert ends(child.pid), "a worker outlived its parent"
    before = kept(tmp_path)
    assert 2 <= len(before) < 7
    child = start()
    out, err = child.communicate(timeout=300)
    assert child.returncode == 0, err
    assert f"{len(before)} of 7 cases were diagnosed before" in out
    after = kept(tmp_path)
    assert len(after) == 7
    assert before.items() <= after.items()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--effects", "magic"], "no effect is called 'magic'"),
        (["--strengths", "0"], "--strengths must be above 0"),
        (["--cases", "-1"], "must be 0 or more"),
        (["--levels", "2"], "--levels between 0 and 0.5"),
    ],
)
def test_refusals(options, said, capsys):
    assert limits.main(options) == 2
    assert said in capsys.readouterr().err


def test_a_case_that_cannot_be_diagnosed_stops_nobody(monkeypatch):
    from softnn.mismatch import diagnosis

    def broken(*_):
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr(diagnosis, "diagnose", broken)
    row = limits.outcome(order("slack", 1.0, 0.01, "white"))
    assert row["error"] == "ZeroDivisionError: by nought"
    assert row["verdict"] == "no diagnosis"
    assert not row["named"]
    assert row["samples"] > 1000
    assert row["oracle"] == pytest.approx(power(row["energy"], 6), abs=1e-3)


def test_what_could_not_be_told_from_the_name_is_kept():
    explanation = {
        "effect": "slack",
        "equivalent": ["zero_offset", "gain_error"],
        "probability": 0.9,
    }
    found = {
        "verdict": "explained",
        "selected": ["slack"],
        "explanations": [explanation],
    }
    truth = {
        "cls": "single",
        "effects": ["gain_error"],
        "oracle_power": [0.5],
        "energy_alone": {"gain_error": 9.0},
        "noise": {"sigma_MPa": [0.1]},
        "model": "sls",
        "recordings": [{"samples": 10}],
    }
    row = limits.row_of(order("gain_error", 1.0, 0.01, "white"), truth, found, None)
    assert (row["oracle"], row["energy"]) == (0.5, 9.0)
    assert row["equivalent"] == ["gain_error", "zero_offset"]
    assert not row["named"]


# --- what is counted ------------------------------------------------------------------


def test_shares_by_hand():
    wanted = replace(GRID, effects=("slack",), cases=2, nulls=3).orders()
    rows = [fake(o) for o in wanted]
    # One of the weak ones is named after all, with another beside it.
    weak = next(r for r in rows if r["strength"] == 0.1)
    weak |= {"named": True, "selected": ["slack", "inertia"], "verdict": "explained"}
    # Another is listed as equivalent to what was named instead.
    other = next(r for r in rows if r["strength"] == 0.1 and not r["named"])
    other |= {"selected": ["grip_slip"], "equivalent": ["slack"], "right": False}
    alarm = next(r for r in rows if r["effect"] == "null" and r["colour"] == "long")
    alarm |= {"verdict": "unexplained", "right": False}
    found = summary.summarise(rows)
    slack = found["effects"]["slack"]
    assert slack["named"]["right"] == 9
    assert slack["right"]["right"] == 8
    assert slack["oracle_power"] == pytest.approx(0.5)
    assert slack["ratio"] == pytest.approx((9 / 16) / 0.5)
    assert slack["ratio_listed"] == pytest.approx((10 / 16) / 0.5)
    assert found["lists"]["with_a_list"]["of"] == 10
    assert found["lists"]["mean_length"] == pytest.approx(0.1)
    assert slack["ratio_low"] <= slack["ratio"] <= slack["ratio_high"]
    assert slack["smallest_strength"] == 1.0
    # An energy of 4000 over 1000 samples is twice the noise in each.
    assert slack["smallest_signal"] == pytest.approx(2.0)
    assert slack["oracle_smallest_signal"] == pytest.approx(2.0)
    at = slack["strengths"]["0.1"]
    assert (at["named"]["right"], at["named"]["of"]) == (1, 8)
    assert at["named"]["high"] == pytest.approx(scoring.wilson(1, 8)[1])
    assert at["signal"] == pytest.approx(0.2)
    assert len(slack["cells"]) == 4
    assert set(slack["colours"]) == {"white", "long"}
    assert found["nulls"]["white"]["false_alarm"]["right"] == 0
    assert found["nulls"]["long"]["false_alarm"]["right"] == 1
    assert found["nulls"]["long"]["false_name"]["right"] == 0
    assert found["nulls"]["long"]["said"] == {"unexplained": 1}
    # 16 singles and 6 nulls: the nulls are the lowest tenth, and more.
    sigma = found["noise"]["white"]["sigma_over_true"]
    assert (sigma["low"], sigma["median"], sigma["high"]) == (0.5, 1.0, 1.0)
    assert found["noise"]["long"]["correlation_s"]["median"] == 1.0
    headline = limits_report.headline_of(found)
    assert headline["false_alarm/long"] == pytest.approx(1 / 3)
    assert headline["effects_at_bar"] == 1
    assert "| slack " in limits_report.tables(found)["effects"]


def test_smallest_strength_is_the_one_from_which_on_it_holds():
    part = pd.DataFrame(
        {"strength": [0.1, 0.2, 0.4, 1.0], "named": [True, False, True, True]}
    )
    assert summary.smallest_strength(part) == 0.4
    part.named = [True, True, True, False]
    assert summary.smallest_strength(part) is None


def test_smallest_signal_of_the_oracle_is_where_its_power_is_ninety_per_cent():
    # The noncentrality at which a test of one parameter at 1 % has a power of 0.9 is
    # (2.5758 + 1.2816) squared, from the normal quantiles.
    size = pd.Series(np.linspace(0.01, 0.3, 2000))
    chance = pd.Series([power(1000 * s**2, 1) for s in size])
    found = summary.smallest_signal(size, chance)
    assert found == pytest.approx((2.5758 + 1.2816) / np.sqrt(1000), abs=2e-4)
    assert summary.smallest_signal(size, 0.5 * chance) is None
