"""One trial of a network study: one configuration, cross-validated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from softnn.crossval import Folds, make_folds, rate_groups, score
from softnn.metrics import nrmse
from softnn.neural import (
    Regularisation,
    Samples,
    Seen,
    StoredNetwork,
    Trained,
    samples,
    train,
)
from studies.material_data import Data
from studies.settings import Settings


class Trainer:
    """Cross-validated networks on one material: `trainer(parameters)` is one trial.

    `parameters` may hold neurons, split, inputs, regularisation and folds_seed; the
    rest is as in the settings. A trial gives its generalisation error (thesis eq. 6.7)
    and, ready for JSON, everything about it that is kept.
    """

    def __init__(self, data: Data, settings: Settings) -> None:
        self.data, self.settings = data, settings
        self._samples: dict[str, Samples] = {}

    def samples(self, inputs: str) -> Samples:
        """The training set of an input architecture, or the fraction asked for."""
        if inputs not in self._samples:
            whole = samples(self.data.tensile, inputs)
            if self.settings.fraction < 1:
                rng = np.random.default_rng([self.settings.seed, 10])
                size = round(self.settings.fraction * len(whole.target))
                index = np.sort(rng.choice(len(whole.target), size, replace=False))
                whole = replace(
                    whole,
                    inputs=whole.inputs[index],
                    target=whole.target[index],
                    recording=whole.recording[index],
                )
            self._samples[inputs] = whole
        return self._samples[inputs]

    def folds(self, split: str, inputs: str, seed: int) -> Folds:
        """The same folds for every neuron count, as in the thesis."""
        rows = self.samples(inputs).recording
        return make_folds(
            self.data.tensile, rows, split, number=self.settings.folds, seed=seed
        )

    def networks(self, chosen: Mapping[str, Any], folds: Folds) -> list[Trained]:
        """A network for each fold, trained without the samples of that fold."""
        known = self.samples(chosen["inputs"])
        number = len(folds.names)
        seed = chosen.get("folds_seed", self.settings.seed)
        return train(
            known.inputs,
            known.target,
            neurons=[chosen["neurons"]] * number,
            train_mask=folds.train,
            seeds=[seed * 1000 + i for i in range(number)],
            regularisation=Regularisation.parse(chosen["regularisation"]),
        )

    def whole(self, parameters: Mapping[str, Any]) -> StoredNetwork:
        """One network trained on every sample, for use outside the study."""
        chosen = asdict(self.settings) | dict(parameters)
        known = self.samples(chosen["inputs"])
        one = train(
            known.inputs,
            known.target,
            neurons=[chosen["neurons"]],
            train_mask=np.ones((1, len(known.target)), bool),
            seeds=[chosen.get("folds_seed", self.settings.seed) * 1000],
            regularisation=Regularisation.parse(chosen["regularisation"]),
        )[0]
        return StoredNetwork(
            one.network, chosen["inputs"], known.lag_s, Seen.of(self.data.tensile)
        )

    def __call__(self, parameters: Mapping[str, Any]) -> tuple[float, dict[str, Any]]:
        chosen = asdict(self.settings) | dict(parameters)
        known = self.samples(chosen["inputs"])
        folds = self.folds(
            chosen["split"],
            chosen["inputs"],
            chosen.get("folds_seed", self.settings.seed),
        )
        trained = self.networks(chosen, folds)
        predicted = np.full(folds.test.shape, np.nan)
        for row, test, one in zip(predicted, folds.test, trained, strict=True):
            row[test] = one.network.predict(known.inputs[test])
        scores = score(folds, predicted, known.target)
        return scores.generalisation_error, {
            "generalisation_error": scores.generalisation_error,
            "r2_mean": scores.mean_r2,
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
