"""The study of real recordings: groups, splits, predictions, made faults, the command.

Faults are checked by a second route: the effect that stands for a fault, applied to the
faulty strain, must give the faulty stress.
"""

import json
import os
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from recordings_made import SPRING, STIFFNESS, triangle
from smoke import smoked

from bench.recordings import groups, predict, promise, reporting, sets, trial
from bench.recordings.rows import Row, agreement, made_of, met
from softnn import Recording
from softnn.contracts import Chunk
from softnn.database import Store
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.metrics import weights
from softnn.mismatch.case import Case
from softnn.mismatch.plan import Alternatives
from softnn.mismatch.programmes import Programme, recorded
from softnn.model_file import to_dict
from softnn.readers.tidy import data_folder

# --- groups and splits ----------------------------------------------------------------


def test_a_rate_between_others_is_held_out_and_two_rates_predict_each_other():
    three = [triangle(str(r), r) for r in (0.01, 0.03, 0.0301, 0.05)]
    (split,) = groups.splits(["rate"], three)
    assert (split.fit, split.unseen, split.outside) == ((0, 3), (1, 2), False)
    two = [triangle(str(r), r) for r in (0.01, 0.05)]
    assert [(s.fit, s.unseen, s.outside) for s in groups.splits(["rate"], two)] == [
        ((1,), (0,), True),
        ((0,), (1,), True),
    ]


def test_three_of_five_specimens_are_fitted():
    five = [triangle(str(i)) for i in range(5)]
    (split,) = groups.splits(["specimen"], five)
    assert (split.fit, split.unseen) == ((0, 1, 2), (3, 4))
    assert groups.splits(["specimen"], five[:1]) == []


def test_groups_come_from_names_and_monotonic_pulls_at_one_rate_are_left_out():
    about = sets.About(group=r"^(.+)_t\d+$", tests=())
    time = np.linspace(0, 5, 101)
    pull = Recording(time, 0.1 * time, 0.2 * time, name="c_t1", test="")
    given = [triangle(n, test="") for n in ("a_t1", "a_t2", "b_x_t1")] + [pull]
    found = groups.divide("made", about, given)
    assert [(g.name, len(g.recordings)) for g in found] == [("a", 2), ("b_x", 1)]
    faster = Recording(time / 10, 0.1 * time, 0.2 * time, name="c_t2", test="")
    found = groups.divide("made", about, [pull, faster])
    assert [g.name for g in found] == ["c"]  # two rates tell something


def test_one_bad_file_does_not_cost_the_set(tmp_path):
    folder = tmp_path / "soft"
    folder.mkdir()
    for name, second in (("good", "0.1,0.1,0.2"), ("bad", "-1,0.1,0.2")):
        rows = ["time_s,strain,stress_MPa", "0,0,0", second, "0.2,0,0"]
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
    (folder / "index.csv").write_text("file,test\nbad.csv,cyclic\ngood.csv,cyclic\n")
    (found,), left_out = groups.discover(tmp_path)
    assert [r.name for r in found.recordings] == ["good"]
    assert list(left_out) == ["soft/bad.csv"]
    assert left_out["soft/bad.csv"].startswith("soft/bad.csv, row 3, column 'time_s'")
    (folder / "good.csv").unlink()
    none, left_out = groups.discover(tmp_path)
    assert none == []
    assert list(left_out) == ["soft"]
    assert left_out["soft"].startswith("soft/bad.csv, row 3")


def test_first_loading_ends_at_the_first_turn():
    recording = triangle(rate=0.1, side=-1.0)
    assert groups.first_turn(recording) == 101
    assert groups.rate(recording) == pytest.approx(0.1)
    assert groups.amplitude(recording) == pytest.approx(0.5)
    (cut,) = groups.first_loading(Case("c", (recording,))).recordings
    assert cut.strain[-1] == pytest.approx(-0.5)
    assert not groups.comes_back(cut)


# --- predictions ----------------------------------------------------------------------


def test_a_scale_for_each_unseen_specimen_is_free_and_its_shape_is_not():
    model = to_dict(Guess(SPRING, np.array([STIFFNESS])), [], "fresh", False)
    other = triangle("b")
    bent = other.with_step("bent", stress_MPa=3.0 * other.strain + 0.1)
    case = Case("c", (other.with_step("x", stress_MPa=3.0 * other.strain), bent))
    models = {"before": model, "after": model}
    free = predict.misses(models, case, True)
    assert free["after"][0].sum() == pytest.approx(0, abs=1e-20)
    assert free["after"][1].sum() > 0.01
    fixed = predict.misses(models, case, False)
    error = predict.summary(fixed, np.random.default_rng(0))
    # (3 - 2) / 3 on the first; both recordings together by hand.
    y = np.concatenate([r.stress_MPa for r in case.recordings])
    s = STIFFNESS * np.concatenate([r.strain for r in case.recordings])
    share = np.concatenate([weights(r.time_s, r.strain) for r in case.recordings])
    by_hand = np.sqrt(share @ (y - s) ** 2 / (share @ y**2))
    assert error["after"] == pytest.approx(by_hand)
    assert error["ratio"] == pytest.approx(1)
    assert error["ratio_95"] == pytest.approx([1, 1])
    low, high = error["after_95"]
    assert low < error["after"] < high


def test_only_the_samples_asked_for_count():
    model = to_dict(Guess(SPRING, np.array([STIFFNESS])), [], "fresh", False)
    recording = triangle()
    wrong = np.array(recording.stress_MPa)
    wrong[:50] = 9.0
    case = Case("c", (recording.with_step("x", stress_MPa=wrong),))
    later = [np.arange(len(recording)) >= 50]
    found = predict.misses({"before": model, "after": model}, case, False, later)
    assert found["after"].sum() == pytest.approx(0, abs=1e-20)


def test_agreement_with_the_literature():
    material = sets.Material(
        (("finite_strain", "nonlinear_viscosity"), ("tension_only",)),
        ("mullins_softening",),
        bars={"nrmse": 0.035},
    )
    row = Row("s", "g", "split", "b", selected=["finite_strain", "tension_only"])
    assert agreement(row, material)["agrees"] is True
    row.unseen = {"after": 0.03, "ratio": 0.9}
    assert met(row, material) is True
    row.unseen["after"] = 0.036
    assert met(row, material) is False
    row.selected = ["mullins_softening", "tension_only"]
    said = agreement(row, material)
    assert said["missed"] == ["finite_strain or nonlinear_viscosity"]
    assert said["named_though_absent"] == ["mullins_softening"]
    row.kind = "monotonic"
    assert agreement(row, material)["agrees"] is None


def test_sets_cite_their_sources():
    for name, about in sets.SETS.items():
        for _, material in about.kinds:
            assert material.says, name
            kinds = ("doi:", "arXiv:", "github.com/")
            assert all(any(k in s for k in kinds) for s in material.sources), name
            known = {e for any_ in material.contains for e in any_} | {*material.absent}
            for each in known:
                assert effect(each)


def test_a_device_is_read_as_force_about_its_middle(tmp_path):
    time = np.arange(0, 40, 0.1)
    x = 10 * (1 - np.cos(time / 4))
    force = 50 + 8 * np.sign(np.gradient(x))  # air, and friction of 8 N
    (tmp_path / "a.csv").write_text(
        "time_s,elongation_mm,force_N\n"
        + "".join(f"{t},{a},{b}\n" for t, a, b in zip(time, x, force, strict=True))
    )
    (tmp_path / "index.csv").write_text(
        "file,material,test,specimen\na.csv,seal,cyclic,1\n"
    )
    (read,) = sets.read_device(tmp_path, {})
    assert read.axes.columns == ("time_s", "elongation_mm", "force_N")
    assert np.abs(read.stress_MPa[1:-1]).max() == pytest.approx(8.0)  # N
    assert read.strain.max() == pytest.approx(20.0, rel=1e-3)  # mm


# --- the command ----------------------------------------------------------------------


@pytest.mark.slow
def test_smoke_runs_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    found = smoked("recordings")["recordings"]
    head = found["headline"]
    assert head["groups_in_agreement"] == head["groups"] == 1
    assert head["faults_found"] == 1.0
    (split,) = [r for r in found["rows"] if r["kind"] == "split"]
    assert split["unseen"]["ratio"] < 0.2
    with Store(tmp_path / "mlruns/smoke/recordings/rows.sqlite") as store:
        rows = store.rows()
    # A copy without a fault is the group as it is; an oracle is asked of the other.
    assert len(rows) == 6
    assert found["faults"]["copies"][0]["oracle"]["seen"]
    assert all("model" not in r for r in found["rows"])
    assert len(found["faults"]["originals"]) == len(found["faults"]["copies"]) == 1
    assert "5 diagnoses, 0 of them at hand" in capsys.readouterr().out


def test_sure_names_are_counted_and_held_against_the_literature():
    material = {("soft", "a"): sets.Material((("slack",),), ("inertia",))}
    row = Row("soft", "a", "all", "pl-wiechert", selected=["slack", "inertia"])
    row.probability = {"slack": 0.93, "inertia": 0.89}
    head = reporting.headline([row], material, None, "pl-wiechert")
    assert (head["sure_names"], head["sure_names_excluded"]) == (1, 0)
    row.probability["inertia"] = 0.9
    head = reporting.headline([row], material, None, "pl-wiechert")
    assert (head["sure_names"], head["sure_names_excluded"]) == (2, 1)


def test_other_bases_and_faults_stay_with_the_commit_that_made_them(tmp_path):
    here = groups.Group("soft", "a", (triangle(),), False, sets.Material(), ())
    old = {"made": "2026-11-20", "softnn": "0.1.0", "commit": "0123abc"}
    rows = [
        Row("soft", "a", "all", "hooke", heldout=[0.2, 0.1], **old),
        Row("soft", "a", "all", "pl-wiechert", heldout=[0.2, 0.1], **old),
        Row("soft", "gone", "all", "hooke"),
    ]
    file = tmp_path / "recordings.json"
    told = [{**asdict(r), "agrees": None, "missed": []} for r in rows]
    faults = {"found": {"rate": 0.5, "of": 2}}
    whole = {"made": "2026-11-21", "versions": {"softnn": "0.1.0"}, "commit": "1234abc"}
    content = {**whole, "rows": told, "faults": faults}
    file.write_text(json.dumps(content), encoding="utf-8")
    before = reporting.kept(file, ["pl-wiechert"], [here])
    assert before["rows"] == rows[:1]
    # Without one of their own they are of the commit of the file.
    assert before["faults"] == faults | old | {
        "made": "2026-11-21",
        "commit": "1234abc",
    }
    assert reporting.kept(tmp_path / "none.json", [], [here])["rows"] == []
    new = replace(rows[1], made="2026-11-28", commit="fedc987")
    by = reporting.by_base([new, *before["rows"]], {("soft", "a"): here.material})
    assert {b: one["commit"] for b, one in by.items()} == {
        "pl-wiechert": "fedc987",
        "hooke": "0123abc",
    }
    assert by["hooke"]["groups"] == 1
    both = made_of([new, *before["rows"]])
    assert (both["commit"], both["made"]) == ("0123abc, fedc987", "2026-11-28")


def test_without_recordings_it_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert trial.main(["--data", str(tmp_path)]) == 0
    assert "no sets of recordings" in capsys.readouterr().out
    assert not (tmp_path / "mlruns").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--bases", "steel"], "no base 'steel'"),
        (["--samples", "5"], "--samples is 5"),
        (["--size", "0"], "--size above 0"),
    ],
)
def test_refusals_are_one_line(options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert trial.main(options) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(
    "SOFTNN_DATA" not in os.environ, reason="SOFTNN_DATA: no real recordings"
)
def test_every_set_in_the_folder_is_divided_or_left_out_with_a_reason():
    found, left_out = groups.discover(data_folder())
    folders = {p.parent.name for p in data_folder().glob("*/index.csv")}
    assert {g.set for g in found} | {k.split("/")[0] for k in left_out} == folders
    assert all(left_out.values())
    for group in found:
        for split in group.splits:
            assert split.fit
            assert split.unseen
            assert not set(split.fit) & set(split.unseen)


def test_made_faults_that_were_not_run_are_no_headline():
    found = {"found": {"of": 3, "rate": 1.0}, "with_a_false_name": {"rate": 0.0}}
    assert reporting.headline([], {}, found, "hooke")["faults"] == 3
    assert "faults" not in reporting.headline([], {}, None, "hooke")


# --- recordings put back --------------------------------------------------------------


def row_of(kind, promise=None, **chance):
    named = [n for n, p in chance.items() if p >= 0.5]
    own = {n: chance[n] for n in named}
    row = Row("set", "", kind, "hooke", selected=named, probability=own, chance=chance)
    return replace(row, promise=promise or {})


@pytest.mark.parametrize(
    ("chance", "came"),
    [
        ({"slack": 0.95, "slip": 0.3}, True),
        ({"slack": 0.05, "slip": 0.02, "inertia": 0.6}, True),  # none is likely
        ({"slack": 0.8, "slip": 0.1}, False),
        ({"slack": 0.05, "slip": 0.2, "inertia": 0.95}, False),  # nobody asked for it
    ],
)
def test_what_was_in_question_is_settled_with_the_recordings_put_back(chance, came):
    assert promise.settled(row_of("all", **chance), ["slack", "slip"]) == came


def test_a_class_of_laws_settles_nothing_since_names_are_promised():
    whole = row_of("all", slack=0.6, slip=0.4)
    laws = [{"name": "", "members": ["slack", "slip"], "probability": 1.0}]
    whole = replace(whole, classes=laws)
    assert whole.said(0.9)
    assert not promise.settled(whole, ["slack", "slip"])


def test_promises_stand_beside_what_came_of_them():
    whole = row_of("all", slack=0.95, slip=0.3)
    asked = [
        ("split", "slack", 0.9), ("fault", "slack", 0.8), ("split", "slip", 0.5),
        ("split", "slip", 0.1),
    ]  # fmt: skip
    rows = [row_of(k, {"open": [name], "sure": p}) for k, name, p in asked]
    found = promise.promises([*rows, row_of("split"), whole])
    assert found["all"]["promised"] == pytest.approx(0.575)
    assert (found["all"]["came"]["right"], found["all"]["came"]["of"]) == (2, 4)
    parts = [(p["promised"], p["came"]["right"]) for p in found["parts"]]
    assert parts == [(0.1, 0), (pytest.approx(0.65), 1), (0.9, 1)]
    assert promise.promises([whole])["all"]["came"]["of"] == 0


def test_the_promise_is_that_of_the_recordings_left_out():
    among = Alternatives.from_dict(open_between())
    time = np.linspace(0, 40, 401)
    strains = [0.5 * np.abs(np.sin(w * time)) for w in (0.1, 0.3)]
    left = [
        Recording(time + 5, x, x, name=f"r{i}", test="") for i, x in enumerate(strains)
    ]
    found = SimpleNamespace(result={"alternatives": among.to_dict()})
    told = promise.promised(found, Case("c", tuple(left[:1])))
    score = among.score(Programme("r0", time, strains[0]))
    assert (told["open"], told["sure"]) == (among.open, pytest.approx(score.sure))
    both = promise.promised(found, Case("c", tuple(left)))
    scores = [
        [among.score(Programme("", time, x), count) for x in strains]
        for count in (1, 2)
    ]
    best = max((0, 1), key=lambda i: scores[0][i].gain)
    assert both["sure"] == pytest.approx(scores[1][best].sure)
    # Nothing is in question with one model, nor promised where likelihood decides.
    for less in (open_between(1), open_between(folds=())):
        nothing = SimpleNamespace(result={"alternatives": less})
        assert promise.promised(nothing, Case("c", tuple(left))) == {}


def open_between(models=2, folds=(0.02, 0.03, 0.025)):
    """Softening or permanent set: both predict first loading alike."""
    given = [
        {
            "effects": [name],
            "probability": 0.5,
            "nrmse": 0.05,
            "folds": list(folds),
            "model": to_dict(
                Guess(
                    SPRING,
                    np.array([STIFFNESS]),
                    (Piece(effect(name), effect(name).defaults() | values, ()),),
                ),
                (),
                "fresh",
                False,
            ),
        }
        for name, values in (
            ("mullins_softening", {"depth": 0.4, "scale": 0.05}),
            ("permanent_set", {"ratio": 0.2}),
        )
    ]
    strain = np.linspace(0, 0.5, 100)
    chunk = Chunk(np.linspace(0, 40, 100), strain)
    known = recorded(["a"], [chunk], [strain], False)
    return {
        "recorded": known.to_dict(), "noise": 0.0, "floor": 0.0, "action": "record",
        "sets": given[:models],
    }  # fmt: skip
