"""Networks against autograd, scikit-learn and the published behaviour of trainbr."""

import json

import numpy as np
import pytest
import torch
from sklearn.linear_model import BayesianRidge

from softnn.contracts import InputError
from softnn.metrics import nrmse
from softnn.neural import Network, Regularisation, Scaling, Settings, train
from softnn.neural.levenberg import _evidence, minimise
from softnn.neural.rows import CELLS, Rows, stacked, summary
from softnn.neural.training import _Tanh


def small_problem(rng, networks=3, rows=37, d=2, neurons=(4, 2, 3)):
    x = torch.from_numpy(rng.uniform(-1, 1, (networks, rows, d + 1)))
    x[:, :, -1] = 1
    y = torch.from_numpy(rng.standard_normal((networks, rows)))
    weight = torch.ones(networks, rows, dtype=torch.float64)
    weight[1, -5:] = 0  # a shorter fold, padded
    weight[2] *= torch.from_numpy(rng.uniform(0.5, 3, rows))  # rows that count more
    task = _Tanh(x, y, weight, torch.zeros(networks).double(), torch.tensor(neurons))
    theta = torch.from_numpy(rng.standard_normal((networks, 4 * (d + 2) + 1)))
    return task, theta


def errors(task, i, theta):
    hidden, output, bias = task.split(theta[None])
    predicted = torch.tanh(task.x[i] @ hidden[0]) @ output[0, 0] + bias[0]
    return (predicted - task.y[i]) * task.weight[i].sqrt()


def test_jacobian_gradient_and_hessian_agree_with_autograd():
    task, theta = small_problem(np.random.default_rng(1))
    hessian, gradient, exact = task.normal(theta, torch.arange(3))
    for i in range(3):
        jacobian = torch.autograd.functional.jacobian(
            lambda p, i=i: errors(task, i, p), theta[i]
        )
        torch.testing.assert_close(hessian[i], jacobian.T @ jacobian)

        def half_sse(p, i=i):
            return (errors(task, i, p) ** 2).sum() / 2

        slope = torch.autograd.functional.jacobian(half_sse, theta[i])
        torch.testing.assert_close(gradient[i], slope)
        curvature = torch.autograd.functional.hessian(half_sse, theta[i])
        torch.testing.assert_close(exact[i], curvature)
        torch.testing.assert_close(
            task.sse(theta, torch.arange(3))[i], 2 * half_sse(theta[i])
        )


class Linear:
    """y = x w as a least-squares problem: evidence in closed form elsewhere."""

    def __init__(self, x, y):
        self.x, self.y = torch.from_numpy(x)[None], torch.from_numpy(y)[None]
        self.count, self.size = torch.tensor([len(y)]), torch.tensor([x.shape[1]])

    def sse(self, parameters, which):
        return ((self.x @ parameters[:, :, None]).squeeze(2) - self.y).square().sum(1)

    def normal(self, parameters, which):
        error = (self.x @ parameters[:, :, None]).squeeze(2) - self.y
        hessian = self.x.transpose(1, 2) @ self.x
        gradient = (self.x.transpose(1, 2) @ error[:, :, None]).squeeze(2)
        return hessian, gradient, hessian

    def validation(self, parameters, which):
        return None


def test_evidence_on_a_linear_problem_equals_bayesian_ridge():
    rng = np.random.default_rng(2)
    x = rng.standard_normal((60, 8)) * np.logspace(0, -2, 8)
    y = x @ rng.standard_normal(8) + 0.3 * rng.standard_normal(60)
    ridge = BayesianRidge(
        fit_intercept=False, tol=1e-12, max_iter=5000,
        alpha_1=0, alpha_2=0, lambda_1=0, lambda_2=0,
    ).fit(x, y)  # fmt: skip
    result = minimise(
        Linear(x, y),
        torch.from_numpy(rng.standard_normal((1, 8))),
        evidence=True,
        settings=Settings(settled_nats=0, gradient=1e-10),
    )
    # Foresee and Hagan's alpha and beta are half the usual precisions.
    assert 2 * float(result.alpha[0]) == pytest.approx(ridge.lambda_, rel=1e-5)
    assert 2 * float(result.beta[0]) == pytest.approx(ridge.alpha_, rel=1e-5)
    np.testing.assert_allclose(result.parameters[0], ridge.coef_, rtol=1e-4, atol=1e-7)


def noisy_sine():
    """The example of MATLAB's trainbr page, after Foresee and Hagan (1997)."""
    x = np.arange(-1, 1.0001, 0.05)
    noise = np.random.default_rng(0).standard_normal(x.size)
    return x[:, None], np.sin(2 * np.pi * x) + 0.1 * noise


def test_effective_parameters_stay_when_neurons_are_added():
    x, y = noisy_sine()
    counts = [5, 8, 12, 20]
    trained = [
        max(
            train(
                x, y, neurons=[s] * 5, train_mask=np.ones((5, 41), bool), seeds=range(5)
            ),
            key=lambda t: -nrmse(t.network.predict(x), np.sin(2 * np.pi * x[:, 0])),
        )
        for s in counts
    ]
    gammas = np.array([t.gamma for t in trained])
    assert [t.parameters for t in trained] == [3 * s + 1 for s in counts]
    # The page reports about 12 of 61; what matters is that it does not grow.
    assert np.all((gammas > 6) & (gammas < 16))
    assert np.ptp(gammas[1:]) < 0.25 * gammas.mean()
    for t in trained:
        truth = np.sin(2 * np.pi * x[:, 0])
        assert nrmse(t.network.predict(x), truth) < 0.1  # the noise is 0.14 of it


def tensile(rng, rows=240):
    strain = rng.uniform(0, 1.2, rows)
    rate = rng.choice([0.0253, 0.126, 0.253], rows)
    stress = 4 * strain / (1 + 2 * strain) + 0.3 * np.log10(rate / 0.02) * strain
    return np.column_stack([strain, rate]), stress + 0.02 * rng.standard_normal(rows)


def test_a_network_does_not_depend_on_its_company():
    rng = np.random.default_rng(3)
    x, y = tensile(rng)
    masks = rng.random((3, len(y))) < 0.8
    how = {"settings": Settings(epochs=6)}
    together = train(x, y, neurons=[2, 6, 3], train_mask=masks, seeds=[5, 6, 7], **how)
    for i, count in enumerate([2, 6, 3]):
        (alone,) = train(
            x, y, neurons=[count], train_mask=masks[i : i + 1], seeds=[5 + i], **how
        )
        np.testing.assert_allclose(
            together[i].network.predict(x), alone.network.predict(x), rtol=1e-5
        )
        assert together[i].gamma == pytest.approx(alone.gamma, rel=1e-4)


def test_on_a_grid_rounding_does_not_grow():
    """Copies whose targets differ in the thirteenth digit end at the same numbers."""
    inputs, target = tensile(np.random.default_rng(5))
    about = dict(
        neurons=[8] * 4, train_mask=np.ones((4, len(target)), bool), seeds=range(4)
    )

    def trained(grid, rounded):
        rng = np.random.default_rng(6)
        moved = target * (1 + rounded * rng.standard_normal(len(target)))
        settings = Settings(epochs=60, settled_nats=3.0, grid=grid)
        return train(inputs, moved, settings=settings, **about)

    def weights(one):
        return np.append(one.network.hidden.ravel(), one.network.output)

    free, other = ([*map(weights, trained(0.0, r))] for r in (0.0, 1e-13))
    assert max(np.abs(a - b).max() for a, b in zip(free, other, strict=True)) > 1e-6
    grid = 2.0**-12
    for one, two in zip(trained(grid, 0.0), trained(grid, 1e-13), strict=True):
        np.testing.assert_array_equal(weights(one), weights(two))
        if one.iterations:
            np.testing.assert_array_equal(weights(one) % grid, 0)


def test_held_out_samples_are_not_seen():
    rng = np.random.default_rng(4)
    x, y = tensile(rng)
    mask = rng.random((1, len(y))) < 0.7
    other_x, other_y = x.copy(), y.copy()
    other_x[~mask[0]] *= 50
    other_y[~mask[0]] = 1e3
    for kind in ("bayesian", "early-stopping", "l2=1e-5"):
        how = {
            "neurons": [4],
            "train_mask": mask,
            "seeds": [1],
            "regularisation": Regularisation.parse(kind),
        }
        one = train(x, y, **how)[0].network
        two = train(other_x, other_y, **how)[0].network
        np.testing.assert_array_equal(one.predict(x), two.predict(x))


def test_fixed_weight_reaches_a_minimum_of_its_cost():
    rng = np.random.default_rng(5)
    x, y = tensile(rng)
    everyone = np.ones((1, len(y)), bool)
    how = {"neurons": [4], "train_mask": everyone, "seeds": [1]}
    sizes = []
    for weight in (1e-6, 1e-4, 1e-2):
        (got,) = train(
            x, y, regularisation=Regularisation("l2", weight),
            settings=Settings(settled_nats=0), **how,
        )  # fmt: skip
        net = got.network
        hidden = torch.tensor(net.hidden, requires_grad=True)
        output = torch.tensor(net.output, requires_grad=True)
        inside = torch.tanh(
            torch.from_numpy(net.inputs.apply(x)) @ hidden[:, :-1].T + hidden[:, -1]
        )
        error = inside @ output[:-1] + output[-1] - torch.tensor(net.target.apply(y))
        size = hidden.square().sum() + output.square().sum()
        (error.square().mean() + weight * size).backward()
        slope = torch.cat([hidden.grad.ravel(), output.grad])
        assert float(slope.detach().abs().max()) < 1e-6
        sizes.append(float(size.detach()))
    assert sizes[0] > sizes[1] > sizes[2]


def test_early_stopping_and_evidence_overfit_less_than_neither():
    rng = np.random.default_rng(8)
    x = np.linspace(-1, 1, 300)[:, None]
    truth = np.sin(2 * np.pi * x[:, 0])
    y = truth + 0.5 * rng.standard_normal(300)
    how = {
        "neurons": [15] * 6,
        "train_mask": np.ones((6, 300), bool),
        "seeds": range(6),
    }

    def median_error(kind, settings):
        got = train(
            x, y, regularisation=Regularisation.parse(kind), settings=settings, **how
        )
        return np.median([nrmse(t.network.predict(x), truth) for t in got]), got

    neither, _ = median_error("l2=0", Settings(settled_nats=0, epochs=100))
    stopped, nets = median_error("early-stopping", Settings())
    evidence, _ = median_error("bayesian", Settings())
    assert {t.stopped for t in nets} == {"validation error rises"}
    assert stopped < 0.9 * neither
    assert evidence < 0.65 * neither


def test_early_stopping_watches_the_start_on_few_samples_too(monkeypatch):
    seen = []

    def watched(task, start, **how):
        seen.append(task.validation(start, torch.arange(len(start))) is not None)
        return minimise(task, start, **how)

    monkeypatch.setattr("softnn.neural.training.minimise", watched)
    x, y = tensile(np.random.default_rng(10), rows=9000)
    (got,) = train(
        x, y, neurons=[4], train_mask=np.ones((1, 9000), bool), seeds=[0],
        regularisation=Regularisation("early-stopping"), settings=Settings(epochs=20),
    )  # fmt: skip
    assert seen == [True, True]
    assert nrmse(got.network.predict(x), y) < 0.1


def test_a_start_on_few_samples_ends_where_a_full_one_does(monkeypatch):
    rng = np.random.default_rng(6)
    x, y = tensile(rng, rows=1500)
    how = {"neurons": [3], "train_mask": np.ones((1, 1500), bool), "seeds": [2]}
    full = train(x, y, **how)[0]
    monkeypatch.setattr("softnn.neural.rows.SUBSET", 300)
    quick = train(x, y, **how)[0]
    assert quick.iterations < full.iterations
    assert nrmse(quick.network.predict(x), y) == pytest.approx(
        nrmse(full.network.predict(x), y), rel=0.02
    )


def test_samples_of_equal_inputs_may_be_counted_together():
    rng = np.random.default_rng(9)
    x, y = tensile(rng, rows=9000)
    scale = Scaling.of(x)
    whole = Rows(scale.apply(x), y, np.ones(len(y)))
    few = summary(whole, rng)
    assert len(few.y) <= 3 * CELLS < len(y) / 2
    assert few.weight.sum() == len(y)
    theta = torch.from_numpy(rng.standard_normal((1, 4 * 4 + 1)))
    one = torch.tensor([0])

    def costs(rows):
        arrays = (torch.from_numpy(a) for a in stacked([rows]))
        task = _Tanh(*arrays, torch.tensor([4]))
        return task.sse(theta, one), *task.normal(theta, one)[:2]

    for summed, full in zip(costs(few), costs(whole), strict=True):
        torch.testing.assert_close(summed, full, rtol=1e-4, atol=1e-4 * len(y))


def test_what_a_small_network_made_a_small_network_finds():
    rng = np.random.default_rng(7)
    x = rng.uniform(-1, 1, (200, 2))
    y = 2 * np.tanh(x @ [1.5, -1] + 0.3) - np.tanh(x @ [-0.5, 2] - 0.2)
    got = train(
        x, y, neurons=[2] * 4, train_mask=np.ones((4, 200), bool), seeds=range(4)
    )
    assert min(nrmse(t.network.predict(x), y) for t in got) < 1e-4


def test_a_matrix_that_rounding_makes_singular_has_an_evidence():
    # Two alike columns: the factor of the first ends in a zero or worse, by luck.
    slopes = torch.tensor([[1.0, 1.0, 0.5], [0.3, -0.4, 1.0]], dtype=torch.float64)
    hessian = torch.stack([torch.outer(s, s) for s in slopes])
    one = torch.ones(2, dtype=torch.float64)
    beta = torch.tensor([1e18, 2.0], dtype=torch.float64)
    gamma, value = _evidence(
        hessian,
        torch.full((2, 3), 0.1, dtype=torch.float64),
        1e-17 * one,
        2.0 * one,
        beta,
        30 * one,
        3 * one,
        True,
    )
    assert torch.isfinite(value).all()
    assert (gamma <= 3).all()
    assert (gamma > 0).all()
    # The other of the batch as if alone: one slope of square s2 beside alpha 2.
    square = float(slopes[1] @ slopes[1])
    assert gamma[1] == pytest.approx(2 * square / (2 * square + 2.0))


def test_constant_target_is_learnt_without_fuss():
    x = np.linspace(0, 1, 30)[:, None]
    (got,) = train(
        x, np.full(30, 0.7), neurons=[3], train_mask=np.ones((1, 30), bool), seeds=[0]
    )
    np.testing.assert_allclose(got.network.predict(x), 0.7, atol=1e-6)


def test_network_survives_json():
    x, y = noisy_sine()
    (got,) = train(x, y, neurons=[3], train_mask=np.ones((1, 41), bool), seeds=[0])
    back = Network.from_dict(json.loads(json.dumps(got.network.to_dict())))
    np.testing.assert_array_equal(back.predict(x), got.network.predict(x))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d.pop("hidden"),
        lambda d: d.update(output=[1.0]),
        lambda d: d.update(hidden="text"),
        lambda d: d["inputs"].update(low=[0.0, 0.0, 0.0]),
        lambda d: d.update(output=[float("nan")] * 4),
    ],
)
def test_a_bad_network_is_refused(spoil):
    x, y = noisy_sine()
    (got,) = train(x, y, neurons=[3], train_mask=np.ones((1, 41), bool), seeds=[0])
    given = got.network.to_dict()
    spoil(given)
    with pytest.raises(InputError, match="not a network"):
        Network.from_dict(given)


@pytest.mark.parametrize("text", ["", "l2", "l2=x", "l2=-1", "bayes", "bayesian=1"])
def test_unknown_regularisation_is_refused(text):
    with pytest.raises(InputError, match="allowed is bayesian, early-stopping or l2"):
        Regularisation.parse(text)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"neurons": [0]}, "1 or more"),
        ({"train_mask": np.ones((2, 41), bool)}, "as many seeds"),
        ({"train_mask": np.eye(1, 41, dtype=bool)}, "1 samples"),
        ({"seeds": [1, 2]}, "as many seeds"),
    ],
)
def test_bad_training_input_is_refused(change, match):
    x, y = noisy_sine()
    how = {"neurons": [3], "train_mask": np.ones((1, 41), bool), "seeds": [0]} | change
    with pytest.raises(InputError, match=match):
        train(x, y, **how)
    y[3] = np.nan
    with pytest.raises(InputError, match="NaN or infinity"):
        train(x, y, neurons=[3], train_mask=np.ones((1, 41), bool), seeds=[0])


@pytest.mark.parametrize("how", ["bayesian", "l2=1e-6", "early-stopping"])
def test_a_network_is_the_same_in_any_company(how):
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, (900, 3))
    y = np.tanh(2 * x[:, 0]) + 0.3 * x[:, 1] * x[:, 2]
    seen = rng.random((4, 900)) < np.array([[0.3], [0.5], [0.8], [0.9]])
    size = np.array([3, 6, 6, 6])

    def trained(which, threads):
        return train(
            x,
            y,
            neurons=size[which],
            train_mask=seen[which],
            seeds=which,
            regularisation=Regularisation.parse(how),
            settings=Settings(epochs=40),
            threads=threads,
        )

    together = trained([0, 1, 2, 3], 2)
    for which, threads in (([1], 1), ([3, 2], 1), ([2, 3], 2), ([0, 3], 1)):
        for one, i in zip(trained(which, threads), which, strict=True):
            np.testing.assert_array_equal(
                one.network.hidden, together[i].network.hidden
            )
            np.testing.assert_array_equal(
                one.network.output, together[i].network.output
            )


def test_neighbours_do_not_change_the_stages_of_training():
    """A summary of the samples brings a first stage to their own network alone."""
    rng = np.random.default_rng(6)
    x = rng.integers(0, 400, (1500, 1)) / 400.0
    y = np.tanh(3 * x[:, 0]) + 0.05 * rng.standard_normal(len(x))
    seen = np.ones((2, len(x)), bool)
    seen[1, 500:] = False

    def trained(which):
        how = {"neurons": [4] * len(which), "seeds": which, "threads": 1}
        return train(x, y, train_mask=seen[which], **how)

    for one, other in zip(trained([0, 1]), (*trained([0]), *trained([1])), strict=True):
        assert one.iterations == other.iterations
        np.testing.assert_array_equal(one.network.hidden, other.network.hidden)
