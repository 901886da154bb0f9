"""The search over architectures: front, ties, early stop, resumption."""

from concurrent.futures import Future
from datetime import datetime
from threading import Timer
from types import SimpleNamespace

import numpy as np
import pytest

from bench.architectures.choices import choices, folds, front, paired, words
from bench.architectures.search import once_more
from bench.architectures.trials import beaten, conditions, configuration
from softnn.search import TOGETHER, Finished, Range, Search
from softnn.study.settings import Settings
from studies import neurons

NOW = datetime(2026, 1, 1)


def trial(number, random, unseen, neurons=5, stopped=None):
    result = {
        "nrmse": list(random),
        "unseen": {"nrmse": list(unseen)},
        "stopped_after": stopped,
        "parameters": 4 * neurons + 1,
        "configuration": {
            "inputs": "FFRI2",
            "neurons": neurons,
            "regularisation": "l2=0.001",
            "lag_s": None,
        },
    }
    values = (float(np.mean(random)), float(np.mean(unseen)))
    return Finished(
        number, {"neurons": neurons}, values[0], result, NOW, NOW, False, values
    )


def the_same(trials, use):
    return [folds(t, use) for t in trials]


def test_luck_of_one_draw_does_not_choose():
    """The best of many has had luck: drawn once more it is the worse of two."""
    trials = [
        trial(0, [0.1, 0.1], [0.02, 0.03, 0.04], neurons=9),
        trial(1, [0.1, 0.1], [0.05, 0.06, 0.07], neurons=5),
    ]
    again = {0: [0.30, 0.32, 0.34], 1: [0.05, 0.06, 0.08]}

    def once_more(final, use):
        if use == "random":
            return the_same(final, use)
        return [np.array(again[t.number]) for t in final]

    found = choices(trials, once_more)["unseen"]
    assert (found.trial.number, found.ties) == (1, 1)


@pytest.mark.parametrize(("use", "split"), [("random", "random"), ("unseen", "rate")])
def test_finalists_are_judged_by_what_nothing_else_has_seen(use, split):
    asked = []

    def judge_parts(chosen, parts):
        asked.append((chosen, parts))
        return {split: {"nrmse": [0.1 * len(asked), 0.2]}}

    trainer = SimpleNamespace(settings=Settings(seed=5), judge_parts=judge_parts)
    done = SimpleNamespace(
        trainer=trainer,
        unseen="rate",
        apart=lambda work, *a: SimpleNamespace(result=lambda: work(trainer, *a)),
    )
    tried = [trial(k, [0.1], [0.2], neurons=k + 1) for k in range(2)]
    found = once_more(done)(tried, use)
    np.testing.assert_allclose(found, [[0.1, 0.2], [0.2, 0.2]])
    for one, (chosen, parts) in zip(tried, asked, strict=True):
        assert parts == {split: slice(None)}  # every fold
        assert chosen.pop("folds_seed") not in (5, 6)  # of the search; of the choice
        assert chosen == one.result["configuration"]


def test_front_holds_what_nothing_beats_in_both():
    trials = [
        trial(0, [0.1, 0.1], [0.9, 0.9]),
        trial(1, [0.2, 0.2], [0.5, 0.5]),
        trial(2, [0.3, 0.3], [0.6, 0.6]),  # beaten by 1 in both
        trial(3, [0.05], [0.1], stopped=1),  # not judged whole
        trial(4, [0.4, 0.4], [0.2, 0.2]),
    ]
    assert [t.number for t in front(trials)] == [0, 1, 4]


def test_the_smallest_within_one_standard_error_is_chosen():
    """Least mean .10, four folds of .09 and .11: standard error .006."""
    trials = [
        trial(0, [0.09, 0.11], [0.9, 0.9], neurons=9),
        trial(1, [0.103, 0.103], [0.5, 0.7], neurons=4),
        trial(2, [0.12, 0.12], [0.5, 0.5], neurons=2),
    ]
    found = choices(trials, the_same)
    assert found["random"].best.number == 0
    assert found["random"].trial.number == 1
    assert (found["random"].ties, found["random"].fewest) == (2, 4)
    assert found["unseen"].trial.number == 2
    assert found["unseen"].ties == 1  # the standard error of its best is 0
    assert words(trials[0]) == "FFRI2, 9 neurons, L2 1.0e-03, lag one sample"


def test_ahead_on_every_fold_is_no_tie_however_the_folds_differ():
    """Rates differ in difficulty: the error of the best scatters, its lead does not."""
    trials = [
        trial(0, [0.1, 0.1], [0.04, 0.14, 0.24], neurons=9),
        trial(1, [0.1, 0.1], [0.085, 0.185, 0.29], neurons=4),
    ]
    assert choices(trials, the_same)["unseen"].trial.number == 0
    assert choices(trials, the_same)["unseen"].ties == 1


def test_failing_on_one_fold_is_no_tie():
    """Its difference is as wide as it is large."""
    trials = [
        trial(0, [0.1, 0.1], [0.10, 0.11, 0.12], neurons=9),
        trial(1, [0.1, 0.1], [0.10, 0.11, 0.90], neurons=4),
    ]
    assert choices(trials, the_same)["unseen"].trial.number == 0


def test_paired_error_is_that_of_the_differences():
    one = np.array([1.0, 5.0, 9.0])
    assert paired(one + 0.5, one) == pytest.approx((0.5, 0.0))


@pytest.mark.parametrize(
    ("errors", "unseen", "stops"),
    [
        ([2.0, 3.0, 4.0, 5.0], 0.6, True),  # worse in all four folds: p = 1 / 16
        ([2.0, 3.0, 4.0, 5.0], 0.4, False),  # but better at unseen rates
        ([2.0, 3.0, 4.0, 0.5], 0.6, False),  # one fold better: p = 1 / 8 or more
        ([2.0, 3.0, 4.0], 0.6, False),  # three folds cannot say so
        ([1.0, 1.0, 1.0, 1.0], 0.6, False),  # the same
    ],
)
def test_folds_stop_when_the_front_is_better_in_both(errors, unseen, stops):
    assert beaten(errors, unseen, [(0.5, [1.0] * 10)]) is stops
    assert not beaten(errors, unseen, [])


def test_parameters_go_with_their_architecture():
    when = conditions(differenced=False)
    row = {"inputs": "FFRD4", "regularisation": "bayesian"}
    assert not when["lag"](row)  # a nominal rate knows no lag
    assert conditions(differenced=True)["lag"](row)
    assert when["lag_s"]({"inputs": "FFH4"})
    assert not when["lag_s"]({"inputs": "FFRI3", "lag": "one sample"})
    assert when["weight"]({"inputs": "RBF", "closed_form": "l2"})
    assert not when["regularisation"]({"inputs": "RBF"})
    given = {"inputs": "RBF", "neurons": 2, "closed_form": "l2", "weight": 1e-3}
    assert configuration(given)["regularisation"] == "l2=0.001"


# --- the search itself ----------------------------------------------------------------

SPACE = {"kind": ["square", "line"], "x": Range(-2, 2), "k": [1, 2, 3]}


def done(parameters, known):
    """Two parabolas, with least values at 0 and 1: every x between is on the front."""
    x = parameters.get("x", 0.1 * parameters.get("k", 0))
    future: Future = Future()
    future.set_result(((x**2, (x - 1) ** 2), {"x": x}))
    return future


FIRST = [{"kind": "square", "x": 1.5}]
WHEN = {"x": lambda c: c["kind"] == "square", "k": lambda c: c["kind"] == "line"}


def explored(storage, trials, submit=done):
    with Search(storage, "s", SPACE, objectives=2) as search:
        return list(search.explore(submit, trials, first=FIRST, when=WHEN))


def test_explore_draws_what_there_is_and_finds_the_front(tmp_path):
    found = explored(f"sqlite:///{tmp_path / 'o.db'}", 60)
    assert found[0].parameters == {"kind": "square", "x": 1.5}
    assert all(("x" in t.parameters) == ("k" not in t.parameters) for t in found)
    later = [t for t in found[30:] if -0.1 < t.result["x"] < 1.1]
    assert len(later) > 15  # half by chance would be 30 x (.3 to .5)


@pytest.mark.parametrize("stop", [3, 7, 36])  # drawn by chance, and by estimators
def test_explore_goes_on_where_it_was(stop, tmp_path):
    storage = f"sqlite:///{tmp_path / 'o.db'}"
    told = []

    with Search(storage, "s", SPACE, objectives=2) as search:
        found = search.explore(done, 40, first=FIRST, when=WHEN)
        told += [next(found) for _ in range(stop)]
        found.close()
    after = explored(storage, 40)
    assert [t.stored for t in after] == [True] * stop + [False] * (40 - stop)
    straight = explored(f"sqlite:///{tmp_path / 'p.db'}", 40)
    assert [t.parameters for t in after[:stop]] == [t.parameters for t in told]
    assert [t.parameters for t in after] == [t.parameters for t in straight]


def test_explore_draws_alike_whichever_trial_ends_first(tmp_path):
    """Every other trial is the slower one, or none is."""

    def late(parameters, known):
        future: Future = Future()
        seen.append(len(known))
        if len(seen) % 2:
            answer = done(parameters, known).result()
            Timer(0.02, future.set_result, [answer]).start()
            return future
        return done(parameters, known)

    seen: list[int] = []
    one = explored(f"sqlite:///{tmp_path / 'o.db'}", 40, late)
    other = explored(f"sqlite:///{tmp_path / 'p.db'}", 40)
    assert [t.parameters for t in one] == [t.parameters for t in other]
    assert seen == [max(0, i + 1 - TOGETHER) for i in range(40)]


@pytest.mark.parametrize("option", ["--inputs", "--split", "--regularisation"])
def test_the_study_of_neurons_refuses_what_it_searches_over(option, capsys):
    assert neurons.main([option, "FFRD4"]) == 2
    message = capsys.readouterr().err
    assert f"{option} is searched over" in message
    assert "--as-in-thesis" in message
