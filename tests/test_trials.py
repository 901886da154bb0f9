"""A trial from its seal to its result: killed, resumed, opened, entered, reported."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench import ledger, scoring
from bench.trials import noise_check, reporting, trial
from softnn.noise import estimate

ROOT = Path(__file__).parent.parent
TRUTHS = {
    "one": {"cls": "single", "effects": ["slack"], "energy_after_refit": 900},
    "two": {
        "cls": "pair",
        "effects": ["slack", "inertia"],
        "energy_after_refit": 900,
        "energy_beyond_the_other": {"slack": 900, "inertia": 30},
    },
    "none": {"cls": "null", "effects": [], "noise": {"kind": "pink"}},
    "hum": {"cls": "alien", "effects": [], "energy_after_refit": 900},
}
# Names a slack in every case, and ends its parent once it was told to.
SOFTNN = """
import json, os, signal, sys
from pathlib import Path
out = Path(sys.argv[sys.argv.index("--out") + 1])
for i, case in enumerate(sys.argv[sys.argv.index("--out") + 2:]):
    if i == 2 and Path("die-diagnosing").exists():
        Path("die-diagnosing").unlink()
        os.kill(os.getppid(), signal.SIGKILL)
        sys.exit()
    place = out / Path(case).name
    place.mkdir(parents=True)
    told = {"verdict": "explained", "selected": ["slack"], "mismatch": [],
            "explanations": [{"effect": "slack", "probability": 0.95}],
            "candidates": [{"effect": None}, {"effect": "slack"}]}
    (place / "diagnosis.json").write_text(json.dumps(told))
"""
HANDS = """
import json, os, signal, sys
from pathlib import Path
out = Path(sys.argv[sys.argv.index("--out") + 1])
for i, (name, truth) in enumerate(json.loads(Path("truths.json").read_text()).items()):
    (out / "cases" / name).mkdir(parents=True)
    (out / "truth" / name).mkdir(parents=True)
    (out / "truth" / name / "truth.json").write_text(json.dumps(truth))
    if i == 1 and Path("die-forging").exists():
        Path("die-forging").unlink()
        os.kill(os.getppid(), signal.SIGKILL)
        sys.exit()
"""


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """A diagnosis and a generator of cases that take no time; no MLflow."""
    monkeypatch.chdir(tmp_path)
    Path("softnn.py").write_text(SOFTNN)
    Path("hands.py").write_text(HANDS)
    Path("truths.json").write_text(json.dumps(TRUTHS))
    monkeypatch.setattr(trial, "SOFTNN", [sys.executable, str(tmp_path / "softnn.py")])
    monkeypatch.setattr(trial, "HANDS", [sys.executable, str(tmp_path / "hands.py")])
    monkeypatch.setattr(reporting, "track", lambda *_: None)
    return tmp_path


def killed(*arguments: str) -> int:
    """The command in a process of its own, which somebody ends; its exit code."""
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from bench.trials import trial\n"
        f"trial.SOFTNN, trial.HANDS = {trial.SOFTNN!r}, {trial.HANDS!r}\n"
        f"trial.main({list(arguments)!r})"
    )
    return subprocess.run([sys.executable, "-c", program], check=False).returncode


def opened() -> list[dict]:
    return ledger.read(Path("mlruns/smoke/results"))


@pytest.mark.slow
def test_a_trial_killed_twice_is_the_same_trial(stand_in):
    Path("die-forging").touch()
    Path("die-diagnosing").touch()
    start = ["--hands", "held-out", "--seed", "7", "--smoke", "--out", "t"]
    assert killed(*start) == -9
    assert not Path("t/forged").exists()
    assert killed("--resume", "t") == -9
    record = json.loads(Path("t/record.json").read_text())
    done = {f: f.stat().st_mtime_ns for f in Path("t").glob("diagnoses/*/*.json")}
    assert len(done) == 2
    assert not opened()  # nothing was looked at yet
    assert trial.main(["--resume", "t"]) == 0
    assert {f: f.stat().st_mtime_ns for f in done} == done
    result = json.loads(Path("t/hands.json").read_text())
    one = result["trials"]["held-out"]
    assert one["record"]["key_sha256"] == record["key_sha256"]
    # Slack alone is right of the one single; a pair with an effect nobody could see is
    # among the others; the null and what is on no list got a name.
    right = {c: (r["right"], r["of"]) for c, r in one["visible"]["naming"].items()}
    assert right == {"null": (0, 1), "single": (1, 1), "alien": (0, 1)}
    assert one["others"]["naming"]["pair"]["of"] == 1
    assert result["headline"]["held-out/single_right"] == 1
    (row,) = opened()
    assert row["right"]["pair"] == "0 of 1"
    assert row["undiagnosed"] == 0
    assert (row["side"], row["seed"], row["opened_before"]) == ("held-out", 7, [])
    # Scored again it is the same opening; forged again it was opened before.
    assert trial.main(["--score-only", "t"]) == 0
    assert trial.main([*start[:-1], "again"]) == 0
    first, second = opened()
    assert first["opened_before"] == []
    assert len(second["opened_before"]) == 1
    assert "opened before" in ledger.table(opened())


def elsewhere(folder: Path, *names: str) -> list[str]:
    for name in names:
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "truth" / name).mkdir(parents=True)
        truth = folder / "truth" / name / "truth.json"
        truth.write_text(json.dumps(TRUTHS[name]))
    return ["--cases-in", str(folder), "--smoke", "--out", f"of-{folder.name}"]


def test_cases_from_elsewhere(stand_in, capsys):
    """Some that were opened before are known by their truths, whatever their folder."""
    assert trial.main(elsewhere(Path("few"), "one", "none")) == 0
    assert trial.main(elsewhere(Path("all"), *TRUTHS)) == 0
    assert "Opened before: " in capsys.readouterr().out
    result = json.loads(Path("of-all/hands.json").read_text())["trials"]["all"]
    assert result["all"]["noise"]["pink"]["null"]["of"] == 1
    assert "few" in result["record"]["opened_before"][0]
    assert str(stand_in) not in json.dumps(result)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: (f / "truth/one/truth.json").unlink(), "truth/one/truth.json"),
        (lambda f: (f / "cases/one").rmdir(), "holds no case"),
        (
            lambda f: (f / "truth/one/truth.json").write_text('{"cls": "odd"}'),
            "truth of one: cls 'odd'",
        ),
    ],
)
def test_unusable_cases_are_refused_in_one_line(stand_in, capsys, spoil, message):
    command = elsewhere(Path("few"), "one")
    spoil(Path("few"))
    assert trial.main(command) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1


def test_truths_that_were_changed_are_refused(stand_in, capsys):
    assert trial.main(elsewhere(Path("few"), "one")) == 0
    Path("few/truth/one/truth.json").write_text(json.dumps(TRUTHS["none"]))
    assert trial.main(["--score-only", "of-few"]) == 2
    assert "truths have SHA-256" in capsys.readouterr().err


def test_the_noise_check_whitens_what_is_beyond_the_truth(tmp_path):
    rng = np.random.default_rng(4)
    time = 0.05 * np.arange(2000)
    clean = np.sin(time / 9)
    case, truth = tmp_path / "cases" / "c", tmp_path / "truth" / "c"
    for place in (case / "recordings", truth / "clean"):
        place.mkdir(parents=True)
    for name in ("a.csv", "b.csv"):
        noise = 0.01 * rng.standard_normal(len(time))
        table = pd.DataFrame({"time_s": time, "strain": clean, "stress_MPa": clean})
        table.drop(columns="strain").to_csv(truth / "clean" / name, index=False)
        table["stress_MPa"] += noise
        table.drop(index=range(5, 9)).to_csv(case / "recordings" / name, index=False)
    found = noise_check.check(tmp_path, [scoring.Truth("c", "null", noise="white")])
    assert found["white"] == found["all"]
    # White noise of one level: its mean square over the level is 1 within the estimate.
    assert found["white"]["q50"] == pytest.approx(1, abs=0.05)
    assert found["white"]["of"] == 1
    # Second route: the level alone.
    one = estimate([noise], [clean + noise], [time])[0]
    (direct,) = noise_check.whitened([noise], [clean], [time])
    assert direct == pytest.approx(np.mean(noise**2) / one.floor_MPa**2, rel=0.02)
    (truth / "clean" / "a.csv").unlink()
    assert noise_check.check(tmp_path, [scoring.Truth("c", "null")]) == {}


def test_the_command_refuses(stand_in, capsys):
    assert trial.main(["--nulls", "-1"]) == 2
    assert "counts of cases and --seed" in capsys.readouterr().err
    assert trial.main(elsewhere(Path("few"), "one")) == 0
    assert trial.main(["--cases-in", "few", "--smoke", "--out", "of-few"]) == 2
    assert "of-few holds a trial" in capsys.readouterr().err


def test_every_case_is_in_the_picture_whatever_its_verdict():
    counts = {"slack": {"slack": 1, "good_enough": 2}, "null": {"nothing_missing": 4}}
    (axes,) = reporting.confusion_figure(counts).axes
    assert sum(int(text.get_text()) for text in axes.texts) == 7
