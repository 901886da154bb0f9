"""One trial of a network study: one configuration, cross-validated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from softnn.crossval import Folds, make_folds, rate_groups, score
from softnn.metrics import generalisation_error, nrmse, r2
from softnn.neural import (
    Network,
    Regularisation,
    Samples,
    Seen,
    StoredNetwork,
    Trained,
    architecture_of,
    fit_samples,
    run,
    samples,
)
from softnn.neural import Settings as Training
from softnn.study.material_data import Data
from softnn.study.settings import Settings

DEFAULTS = Training()
KEPT = 8  # training sets held at once; a lag that is sought makes a new one each trial


class Trainer:
    """Cross-validated networks on one material: `trainer(parameters)` is one trial.

    `parameters` may hold neurons, split, inputs, lag_s, regularisation and folds_seed;
    the rest is as in the settings. A trial gives its generalisation error (thesis eq.
    6.7) and, ready for JSON, everything about it that is kept.
    """

    def __init__(
        self,
        data: Data,
        settings: Settings,
        training: Training = DEFAULTS,
        threads: int | None = None,
    ) -> None:
        self.data, self.settings, self.training = data, settings, training
        self.threads = threads
        self._samples: dict[tuple[str, float | None], Samples] = {}

    def samples(self, inputs: str, lag_s: float | None = None) -> Samples:
        """The training set of an input architecture, or the fraction asked for."""
        key = (inputs, lag_s)
        if key not in self._samples:
            whole = samples(self.data.tensile, inputs, lag_s)
            if self.settings.fraction < 1:
                rng = np.random.default_rng([self.settings.seed, 10])
                size = round(self.settings.fraction * len(whole.target))
                chosen = rng.choice(len(whole.target), size, replace=False)
                whole = whole.take(np.sort(chosen))
            if len(self._samples) >= KEPT:
                self._samples.pop(next(iter(self._samples)))
            self._samples[key] = whole
        return self._samples[key]

    def chosen(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the whole configuration: settings fill in for missing parameters."""
        chosen = asdict(self.settings) | dict(parameters)
        return chosen | {"folds_seed": chosen.get("folds_seed", self.settings.seed)}

    def folds(
        self, split: str, inputs: str, seed: int, lag_s: float | None = None
    ) -> Folds:
        """The same folds for every neuron count, as in the thesis."""
        rows = self.samples(inputs, lag_s).recording
        return make_folds(
            self.data.tensile, rows, split, number=self.settings.folds, seed=seed
        )

    def networks(
        self, chosen: Mapping[str, Any], folds: Sequence[Folds], first: Sequence[int]
    ) -> list[Trained]:
        """A network for each fold, trained without its samples, all in one batch.

        `first` says of each of `folds` the number of its first fold, where they are
        some of more.
        """
        seeds = [
            chosen["folds_seed"] * 1000 + start + i
            for start, split in zip(first, folds, strict=True)
            for i in range(len(split.names))
        ]
        return fit_samples(
            self.samples(chosen["inputs"], chosen["lag_s"]),
            chosen["inputs"],
            neurons=[chosen["neurons"]] * len(seeds),
            train_mask=np.concatenate([f.train for f in folds]),
            seeds=seeds,
            regularisation=Regularisation.parse(chosen["regularisation"]),
            settings=self.training,
            device=self.settings.device,
            threads=self.threads,
        )

    def whole(self, parameters: Mapping[str, Any]) -> StoredNetwork:
        """One network trained on every sample, for use outside the study."""
        chosen = self.chosen(parameters)
        known = self.samples(chosen["inputs"], chosen["lag_s"])
        everything = Folds(np.zeros((1, len(known.target)), bool), ("all",), "none")
        (one,) = self.networks(chosen, [everything], [0])
        return StoredNetwork(
            one.network, chosen["inputs"], known.lag_s, Seen.of(self.data.tensile)
        )

    def __call__(self, parameters: Mapping[str, Any]) -> tuple[float, dict[str, Any]]:
        judged = self.judge(parameters)
        error = generalisation_error(judged["nrmse"])
        return error, {
            "generalisation_error": error,
            "r2_mean": float(np.mean(judged["r2"])),
            **judged,
        }

    def judge(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the errors of networks on the samples held out, fold by fold."""
        split = self.chosen(parameters)["split"]
        return self.judge_parts(parameters, {split: slice(None)})[split]

    def judge_parts(
        self, parameters: Mapping[str, Any], parts: Mapping[str, slice]
    ) -> dict[str, dict[str, Any]]:
        """Return the same for some folds of several splits, all networks in one batch.

        A network with its stress fed back is judged running on its own stress;
        `nrmse_measured`, `r2_measured` are its scores with the measured stress. A
        recurrent network runs through whole recordings. It sees the strain of held-out
        samples, as other networks do in lags and filters, but never their stress.
        """
        chosen = self.chosen(parameters)
        inputs, lag_s = chosen["inputs"], chosen["lag_s"]
        known = self.samples(inputs, lag_s)
        every = []
        for split, part in parts.items():
            folds = self.folds(split, inputs, chosen["folds_seed"], lag_s)
            every.append(replace(folds, test=folds.test[part], names=folds.names[part]))
        trained = iter(
            self.networks(chosen, every, [part.start or 0 for part in parts.values()])
        )
        return {
            folds.split: self._judged(
                chosen, known, folds, [next(trained) for _ in folds.names]
            )
            for folds in every
        }

    def _judged(
        self,
        chosen: Mapping[str, Any],
        known: Samples,
        folds: Folds,
        trained: Sequence[Trained],
    ) -> dict[str, Any]:
        inputs, lag_s = chosen["inputs"], chosen["lag_s"]
        predicted = np.full(folds.test.shape, np.nan)
        for row, test, one in zip(predicted, folds.test, trained, strict=True):
            row[test] = self._held_out(one.network, inputs, lag_s, known, test)
        scores = score(folds, predicted, known.target)
        return {
            "nrmse": scores.nrmse.tolist(),
            "r2": scores.r2.tolist(),
            "gamma": [t.gamma for t in trained],
            "parameters": trained[0].parameters,
            "iterations": [t.iterations for t in trained],
            "stopped": [t.stopped for t in trained],
            "seconds": float(sum(t.seconds for t in trained)),
            "samples": len(known.target),
            "test_samples": folds.test.sum(axis=1).tolist(),
            "folds": list(folds.names),
            "note": folds.note,
            "nrmse_by_rate": self._by_rate(known, folds, predicted),
        } | self._measured(inputs, known, folds, trained)

    def _held_out(
        self,
        network: Network,
        inputs: str,
        lag_s: float | None,
        known: Samples,
        test: np.ndarray,
    ) -> np.ndarray:
        """Stress at the samples held out, MPa."""
        if not architecture_of(inputs).feedback:
            return network.at(test, known.inputs, known.recording)
        asked = known.take(test)
        mine, row = np.unique(asked.recording, return_inverse=True)
        out = run(network, inputs, [self.data.tensile[i] for i in mine], lag_s)
        found = np.empty(len(asked.target))
        for i, stress in enumerate(out):
            found[row == i] = stress[asked.position[row == i]]
        return found

    def _measured(
        self, inputs: str, known: Samples, folds: Folds, trained: Sequence[Trained]
    ) -> dict[str, Any]:
        """NRMSE, R2 fold by fold with the measured stress fed back (thesis 6.4.1)."""
        if not architecture_of(inputs).feedback:
            return {}
        pairs = [
            (t.network.predict(known.inputs[test]), known.target[test])
            for test, t in zip(folds.test, trained, strict=True)
        ]
        return {
            "nrmse_measured": [nrmse(*pair) for pair in pairs],
            "r2_measured": [r2(*pair) for pair in pairs],
        }

    def _by_rate(
        self, known: Samples, folds: Folds, predicted: np.ndarray
    ) -> dict[str, float]:
        """NRMSE of the held-out predictions at each strain rate."""
        rates = rate_groups([r.rate_per_s for r in self.data.tensile])
        of_sample = np.array([np.nan if r is None else r for r in rates])
        of_sample = of_sample[known.recording]
        # A sample is held out once, or never: the folds do not overlap.
        pooled = np.where(folds.test, predicted, 0.0).sum(axis=0)
        pooled[~folds.test.any(axis=0)] = np.nan
        return {
            f"{rate:g}": nrmse(
                pooled[of_sample == rate], known.target[of_sample == rate]
            )
            for rate in np.unique(of_sample[np.isfinite(of_sample)])
        }
