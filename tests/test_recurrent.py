"""Recurrent units: what they compute, what they see, how the search judges them."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from export_made import memory, network

from bench.architectures.trials import (
    INPUTS,
    WAYS,
    by_front,
    conditions,
    judged,
    opening,
    way_of,
)
from softnn.contracts import Chunk, InputError
from softnn.metrics import nrmse
from softnn.models.units import Units
from softnn.neural import (
    RecurrentNetwork,
    Regularisation,
    fit_samples,
    run,
    samples,
    stored,
)
from softnn.neural.recurrent import _Gated, train_gated
from softnn.recording import Recording
from softnn.study.material_data import prepared
from softnn.study.settings import Settings, smoked
from softnn.study.trainer import Trainer

SMALL = smoked(Settings())
CHOSEN = {"inputs": "GRU", "neurons": 2, "regularisation": "l2=1e-06", "lag_s": None}


@pytest.fixture(autouse=True)
def few_epochs(monkeypatch):
    """What is asked here does not hang on how long networks are trained."""
    monkeypatch.setattr(train_gated, "__kwdefaults__", {"epochs": 10})


@cache
def data():
    (found,) = prepared(SMALL)
    return found


def test_it_computes_what_torch_computes():
    model = network("GRU", neurons=3).network
    theirs = torch.nn.GRU(2, 3, batch_first=True, dtype=torch.float64)
    weights = np.concatenate([model.gates, model.hidden])
    with torch.no_grad():
        theirs.weight_ih_l0.copy_(torch.from_numpy(weights[:, :-1]))
        theirs.bias_ih_l0.copy_(torch.from_numpy(weights[:, -1]))
        theirs.weight_hh_l0.copy_(torch.from_numpy(model.past))
        theirs.bias_hh_l0.zero_()
    x = np.random.default_rng(1).uniform(0, 0.5, (40, 2))
    with torch.no_grad():
        states = theirs(torch.from_numpy(model.inputs.apply(x))[None])[0][0].numpy()
    np.testing.assert_allclose(model.layer(x), states, atol=1e-12)


def test_its_derivatives_are_those_of_differences():
    make = torch.Generator().manual_seed(0)
    x, inputs, past = (
        torch.rand(*shape, dtype=torch.float64, generator=make) - 0.5
        for shape in ((2, 5, 3, 2), (2, 2, 12), (2, 4, 12))
    )
    free = inputs.requires_grad_(), past.requires_grad_()
    assert torch.autograd.gradcheck(lambda *w: _Gated.apply(x, *w), free)


def test_training_is_of_the_network_that_predicts():
    """The network in NumPy, made of what torch minimised, comes near the samples."""
    known = samples(data().tensile, "GRU")
    mask = np.ones((1, len(known.target)), bool)
    about = {"neurons": [2], "train_mask": mask, "seeds": [0]}
    whole = known.inputs, known.target, known.recording
    ends = {
        epochs: train_gated(
            *whole, **about, regularisation=Regularisation("l2", 1e-6), epochs=epochs
        )[0]
        for epochs in (1, 60)
    }
    first, last = (
        nrmse(one.network.at(mask[0], known.inputs, known.recording), known.target)
        for one in ends.values()
    )
    assert last < 0.5 * first


def test_a_memory_tells_what_strain_alone_does_not():
    time = np.linspace(0, 30, 120)
    pulls = []
    for k in range(4):
        strain = 0.2 - 0.2 * np.cos((0.7 + 0.2 * k) * time)
        _, branch, _ = Units("sls", (0.0, 1.0), (1.0,)).respond(Chunk(time, strain))
        pulls.append(Recording(time, strain, 2 * strain + 3 * branch[:, 0]))
    error = {}
    for name in ("FFRI1", "GRU"):
        known = samples(pulls, name)
        test = known.recording == 1
        how = Regularisation("l2", 1e-6)
        if name == "GRU":
            trained = train_gated(
                known.inputs[:, :1], known.target, known.recording, neurons=[6],
                train_mask=~test[None], seeds=[0], regularisation=how, epochs=200,
            )  # fmt: skip
            known = replace(known, inputs=known.inputs[:, :1])
        else:
            trained = fit_samples(
                known, name, neurons=[6], train_mask=~test[None], seeds=[0],
                regularisation=how,
            )  # fmt: skip
        said = trained[0].network.at(test, known.inputs, known.recording)
        error[name] = nrmse(said, known.target[test])
    assert error["GRU"] < 0.5 * error["FFRI1"]


@pytest.mark.parametrize("how", ["l2=1e-06", "early-stopping"])
@pytest.mark.parametrize("split", ["random", "rate"])
def test_the_stress_of_what_is_held_out_changes_nothing(split, how):
    trainer = Trainer(data(), SMALL, threads=1)
    chosen = trainer.chosen({**CHOSEN, "regularisation": how, "split": split})
    folds = trainer.folds(split, "GRU", SMALL.seed)
    one = replace(folds, test=folds.test[:1], names=folds.names[:1])
    known = trainer.samples("GRU")

    def said(changed, by):
        trainer._samples["GRU", None] = replace(
            known, target=np.where(changed, known.target + by, known.target)
        )
        (trained,) = trainer.networks(chosen, [one], [0])
        judged = trainer._judged(chosen, trainer.samples("GRU"), one, [trained])
        return trainer._held_out(trained.network, "GRU", None, known, one.test[0]), (
            judged["nrmse"]
        )

    noise = np.random.default_rng(0).normal(size=len(known.target))
    before, error = said(one.test[0], 0.0)
    after, other = said(one.test[0], noise)
    np.testing.assert_array_equal(before, after)
    assert error != other  # it is what is held out that is judged
    assert not np.array_equal(before, said(~one.test[0], noise)[0])


def test_random_folds_are_those_of_others_and_rates_are_left_out_whole():
    trainer = Trainer(data(), SMALL)
    for split in ("random", "rate"):
        mine, theirs = (trainer.folds(split, n, 0) for n in ("GRU", "FFRD4"))
        np.testing.assert_array_equal(mine.test, theirs.test)
        assert mine.names == theirs.names
    owner = trainer.samples("GRU").recording
    for test in trainer.folds("rate", "GRU", 0).test:
        assert not set(owner[test]) & set(owner[~test])


def test_a_trial_is_judged_on_the_folds_of_others_and_the_same_again():
    tanh = {**CHOSEN, "inputs": "FFRD4"}
    one, two, other = (
        judged(data(), SMALL, "rate", chosen, by_front(chosen, []))
        for chosen in (CHOSEN, CHOSEN, tanh)
    )
    assert one[0] == two[0]
    for key in ("folds", "test_samples", "samples"):
        assert one[1][key] == other[1][key]
    assert one[1]["unseen"]["folds"] == other[1]["unseen"]["folds"]
    assert len(one[1]["nrmse"]) == SMALL.folds


@pytest.mark.parametrize("how", ["l2=1e-06", "early-stopping"])
def test_it_is_the_same_in_any_company(how):
    trainer = Trainer(data(), SMALL, threads=1)
    chosen = {**CHOSEN, "regularisation": how}
    alone = trainer.judge_parts(chosen, {"random": slice(1, 2)})["random"]
    both = {"rate": slice(None), "random": slice(None)}
    beside = trainer.judge_parts(chosen, both)["random"]
    assert alone["nrmse"] == beside["nrmse"][1:2]


def test_its_file_gives_the_same_stress_and_takes_no_other_shape():
    model = network("GRU", neurons=3)
    source = json.loads(json.dumps(model.source))
    back = stored.from_dict(source)
    assert isinstance(back.network, RecurrentNetwork)
    pull = data().tensile[0]
    (one,), (two,) = (run(m.network, "GRU", [pull]) for m in (model, back))
    np.testing.assert_array_equal(one, two)
    wrong = replace(model.network, **memory(4, 2, np.random.default_rng(0)))
    with pytest.raises(InputError, match="not a recurrent network: gates"):
        stored.from_dict(source | {"network": wrong.to_dict()})
    del source["network"]["past"]
    with pytest.raises(InputError, match="not a recurrent network: KeyError"):
        stored.from_dict(source)


def test_bayesian_regularisation_is_refused():
    with pytest.raises(InputError, match="allowed is early-stopping or l2=WEIGHT"):
        Trainer(data(), SMALL)({**CHOSEN, "regularisation": "bayesian"})


def test_each_architecture_has_one_way_of_regularisation():
    when = conditions(differenced=False)
    for name in INPUTS:
        row = {"inputs": name, way_of(name): "l2"}
        assert [way for way in WAYS if when[way](row)] == [way_of(name)]
        assert when["weight"](row)
    assert way_of("GRU") == "by_gradient"
    assert "bayesian" not in WAYS["by_gradient"]
    begun = [trial for trial in opening(SMALL) if trial["inputs"] == "GRU"]
    assert {trial["by_gradient"] for trial in begun} == {"early-stopping"}
