"""Samplers of the search over architectures: TPE, NSGA-II, and a grid that is whole."""

import json
from concurrent.futures import Future
from itertools import product
from types import SimpleNamespace

import pytest
from scipy.stats import binomtest

from bench.architectures.trials import (
    FIRST_OF,
    WEIGHT,
    Front,
    Halving,
    Judge,
    Rule,
    by_front,
    by_halving,
    conditions,
    configuration,
    never,
    opening,
    space,
    tabulated,
    trials_of,
)
from softnn.contracts import InputError
from softnn.search import Range, Search
from softnn.search.samplers import STARTUP, Generations
from softnn.study.material_data import prepared
from softnn.study.settings import Places, Settings, smoked
from softnn.study.sweep import Sweep
from softnn.study.trainer import Trainer
from studies import architectures

SETTINGS = Settings(neurons=(1, 2, 3))
SPACE = {"kind": ["square", "line"], "x": Range(-2, 2), "k": [1, 2, 3]}
WHEN = {"x": lambda c: c["kind"] == "square", "k": lambda c: c["kind"] == "line"}


def told(values, **result):
    future: Future = Future()
    future.set_result((values, result))
    return future


def parabolas(parameters, known):
    """Least values at 0 and 1; a line is worse in both than squares between."""
    x = parameters.get("x", 1.2 + parameters.get("k", 0))
    return told((x**2, (x - 1) ** 2), x=x)


def explored(storage, trials, sampler="nsga2"):
    with Search(storage, "s", SPACE, objectives=2, sampler=sampler) as search:
        return list(search.explore(parabolas, trials, when=WHEN))


def test_generations_come_nearer_to_the_front():
    """Of what few trials have, too: by chance a fourth of all x lies on the front."""
    found = explored("sqlite://", 6 * STARTUP)
    assert all(("x" in t.parameters) == ("k" not in t.parameters) for t in found)
    later = found[2 * STARTUP :]
    x = [t.parameters["x"] for t in later if "x" in t.parameters]
    assert binomtest(len(x), len(later), 1 / 2, "greater").pvalue < 0.01
    inside = sum(0 <= one <= 1 for one in x)
    assert binomtest(inside, len(x), 1 / 4, "greater").pvalue < 0.01
    assert len(set(x)) > STARTUP  # it does not stop at what it has


@pytest.mark.parametrize("stop", [STARTUP + 5, 2 * STARTUP + 4])
def test_nsga2_goes_on_where_it_was(stop, tmp_path):
    storage = f"sqlite:///{tmp_path / 'o.db'}"
    with Search(storage, "s", SPACE, objectives=2, sampler="nsga2") as search:
        found = search.explore(parabolas, 70, when=WHEN)
        before = [next(found) for _ in range(stop)]
        found.close()
    after = explored(storage, 70)
    assert [t.stored for t in after] == [True] * stop + [False] * (70 - stop)
    straight = explored("sqlite://", 70)
    assert [t.parameters for t in after] == [t.parameters for t in straight]
    assert [t.parameters for t in before] == [t.parameters for t in straight[:stop]]


def test_samplers_draw_alike_only_what_is_given():
    def draws(sampler):
        with Search("sqlite://", "s", SPACE, objectives=2, sampler=sampler) as search:
            first = [{"kind": "square", "x": 0.5}]
            found = search.explore(parabolas, 70, first=first, when=WHEN)
            return [t.parameters for t in found]

    one, other = draws("tpe"), draws("nsga2")
    assert one[0] == other[0]
    assert one[STARTUP + 4 :] != other[STARTUP + 4 :]
    with pytest.raises(InputError, match="allowed is tpe, nsga2, grid"):
        draws("simplex")


def test_parents_are_chosen_of_whole_generations_in_order():
    sampler = Generations(0)
    trials = [SimpleNamespace(number=i) for i in range(2 * STARTUP + 5)]
    study = SimpleNamespace(get_trials=lambda **_: trials)
    assert sampler.get_trial_generation(study, None) == 2
    assert sampler.get_population(study, 1) == trials[STARTUP : 2 * STARTUP]


def test_the_search_has_its_own_space_with_nsga2():
    """Every draw has what its architecture has, and is one that can be judged."""
    when = conditions(differenced=True)

    def judged(parameters, known):
        names = {n for n in about if n not in when or when[n](parameters)}
        assert set(parameters) == names
        return told((parameters["neurons"], len(configuration(parameters)["inputs"])))

    about = space(SETTINGS, [0, 1])
    first = opening(SETTINGS)
    with Search("sqlite://", "s", about, objectives=2, sampler="nsga2") as search:
        found = list(search.explore(judged, 100, first=first, when=when))
    assert len({t.parameters["inputs"] for t in found[STARTUP:]}) > 1


# --- the grid -------------------------------------------------------------------------


def grid(storage, asked):
    def judged(parameters, known):
        asked.append(configuration(parameters))
        return told((1.0, 1.0))

    about, points = space(SETTINGS, [0, 1]), tabulated(SETTINGS)
    with Search(storage, "g", about, objectives=2, sampler="grid") as search:
        every = search.explore(
            judged, len(points), first=points, when=conditions(differenced=False)
        )
        yield from every


def test_a_grid_has_every_combination_once_and_goes_on(tmp_path):
    storage, asked = f"sqlite:///{tmp_path / 'o.db'}", []
    running = grid(storage, asked)
    kept = [next(running) for _ in range(10)]
    running.close()
    again: list = []
    every = list(grid(storage, again))
    wanted = {
        (inputs, neurons, how, None)
        for inputs, neurons, how in product(
            ("FFRI1", "FFRI2", "FFRI3", "FFRD4"), (1, 2, 3),
            ("bayesian", "early-stopping", f"l2={WEIGHT!r}"),
        )
    }  # fmt: skip
    found = [tuple(configuration(t.parameters).values()) for t in every]
    assert len(found) == len(wanted) == 36
    assert set(found) == wanted
    assert [t.stored for t in every] == [True] * len(kept) + [False] * 26
    assert len(again) == 26
    assert not [one for one in again if one in asked[: len(kept)]]


def test_no_trial_of_a_grid_stops():
    (data,) = prepared(smoked(SETTINGS))
    trainer = Trainer(data, smoked(SETTINGS))
    asked = []

    class Known(Judge):
        def _submit(self, chosen, rule):
            asked.append(rule)
            return told((1.0, 1.0))

    ahead = SimpleNamespace(
        values=(0.0, 0.0),
        number=0,
        result={"nrmse": [0.0], "stopped_after": None, "configuration": {}},
        parameters={"inputs": "FFRI1"},
    )
    places = Places("sqlite://", "", None, False)
    for rule in (by_front, by_halving, never):
        Known(trainer, places, rule).submit(tabulated(SETTINGS)[0], [ahead])
    assert asked[:2] == [Front([(0.0, [0.0])]), Halving([[0.0]])]
    assert type(asked[2]) is Rule
    assert not asked[2].stops([9.0] * 4, 9.0)


def test_how_many_trials():
    assert trials_of("tpe", None, 300) == trials_of("grid", None, 300) == 300
    assert trials_of("nsga2", 7, 300) == 7
    with pytest.raises(InputError, match="at least 1"):
        trials_of("tpe", 0, 300)


def test_trials_of_a_grid_are_not_asked_for(capsys):
    assert architectures.main(["--sampler", "grid", "--trials", "5"]) == 2
    said = capsys.readouterr().err.strip()
    assert "leave out --trials" in said
    assert "\n" not in said
    assert architectures.main(["--sampler", "annealing"]) == 2
    assert "allowed is tpe, nsga2, grid" in capsys.readouterr().err


# --- the study ------------------------------------------------------------------------


def test_the_sampler_is_part_of_the_key_and_logged(tmp_path):
    from mlflow.tracking import MlflowClient

    settings = smoked(SETTINGS)
    (data,) = prepared(settings)
    tracking = f"sqlite:///{tmp_path / 'mlflow.db'}"
    places = Places("sqlite://", tracking, tmp_path, False)
    trainer, keys = Trainer(data, settings), set()
    for sampler in FIRST_OF:
        about = {"k": [1]}, places, 1, 2, trainer, (), sampler
        with Sweep("architectures", data, settings, *about) as sweep:
            keys.add(sweep.key)
    assert len(keys) == len(FIRST_OF)
    client = MlflowClient(tracking)
    experiment = client.get_experiment_by_name("architectures")
    runs = client.search_runs([experiment.experiment_id])
    assert {run.data.params["sampler"] for run in runs} == set(FIRST_OF)


@pytest.mark.slow
@pytest.mark.parametrize(("sampler", "trials"), [("nsga2", 6), ("grid", 12)])
def test_the_study_runs_with_it(sampler, trials, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["--smoke", "--neurons", "2", "--sampler", sampler]
    assert architectures.main(asked) == 0
    (file,) = (tmp_path / "mlruns" / "smoke" / "results").glob("*.json")
    found = json.loads(file.read_text())
    assert found["sampler"] == sampler
    (one,) = found["materials"]
    assert len(one["trials"]) == trials
    if sampler == "grid":
        assert all(t["stopped_after"] is None for t in one["trials"])
