"""The network alone, with scikit-learn's interface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from softnn.contracts import Array, InputError
from softnn.metrics import r2
from softnn.neural.fitting import fit_samples, run
from softnn.neural.guard import Seen
from softnn.neural.inputs import samples
from softnn.neural.stored import StoredNetwork
from softnn.neural.training import Regularisation
from softnn.recording import Recording


class StressNetwork(BaseEstimator):
    """A network from recordings, for stress of others; X is a list of `Recording`.

    - `inputs`: an architecture of `softnn.neural.ARCHITECTURES`.
    - `neurons`: 1 or more.
    - `regularisation`: bayesian, early-stopping or l2=WEIGHT.
    - `lag_s`: lag of past inputs [s], one sample by default.
    - `seed`: of the starting weights. `device`: cpu, cuda or auto.

    `stored_` is the trained network, ready for JSON by `.source`. Bad parameters raise
    `InputError` in `fit`.

    >>> from sklearn.base import clone
    >>> from sklearn.model_selection import cross_val_score
    >>> from softnn.crossval import RecordingFolds
    >>> strain = np.linspace(0, 1, 40)
    >>> pulls = [
    ...     Recording(strain / rate, strain, (1 + rate) * strain, test="tensile",
    ...               rate_per_s=rate, name=f"{rate}", specimen=f"{rate}")
    ...     for rate in (0.1, 0.2, 0.3, 0.4)
    ... ]
    >>> model = StressNetwork(inputs="FFRD4", neurons=3).fit(pulls)
    >>> model.predict(pulls[1])[-1].round(3)
    np.float64(1.2)
    >>> clone(model).get_params()["neurons"]
    3
    >>> scores = cross_val_score(model, pulls, cv=RecordingFolds("rate"))
    >>> scores.shape, bool(scores[1:3].min() > 0.99)
    ((4,), True)
    """

    def __init__(
        self,
        inputs: str = "FFRD4",
        neurons: int = 13,
        regularisation: str = "bayesian",
        lag_s: float | None = None,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        self.inputs = inputs
        self.neurons = neurons
        self.regularisation = regularisation
        self.lag_s = lag_s
        self.seed = seed
        self.device = device

    def fit(self, recordings: Sequence[Recording], y: None = None) -> StressNetwork:
        """Train on every sample of the recordings; their stress is the target."""
        recordings = _listed(recordings)
        known = samples(recordings, self.inputs, self.lag_s)
        (one,) = fit_samples(
            known,
            self.inputs,
            neurons=[self.neurons],
            train_mask=np.ones((1, len(known.target)), bool),
            seeds=[self.seed],
            regularisation=Regularisation.parse(self.regularisation),
            device=self.device,
        )
        self.stored_ = StoredNetwork(
            one.network, self.inputs, self.lag_s, Seen.of(recordings)
        )
        return self

    @overload
    def predict(self, recordings: Recording) -> Array: ...
    @overload
    def predict(self, recordings: Sequence[Recording]) -> list[Array]: ...
    def predict(
        self, recordings: Recording | Sequence[Recording]
    ) -> Array | list[Array]:
        """Stress (n,) of a recording in MPa, a list of them for a list; its own stress
        is not used."""
        check_is_fitted(self)
        one = isinstance(recordings, Recording)
        out = run(self.stored_.network, self.inputs, _listed(recordings), self.lag_s)
        return out[0] if one else out

    def score(self, recordings: Sequence[Recording], y: None = None) -> float:
        """R2 over the samples of all recordings that have a stress."""
        measured = np.concatenate([r.stress_MPa for r in _listed(recordings)])
        predicted = np.concatenate(self.predict(_listed(recordings)))
        known = np.isfinite(measured) & np.isfinite(predicted)
        return r2(predicted[known], measured[known])


def _listed(recordings: Recording | Sequence[Recording]) -> list[Recording]:
    if isinstance(recordings, Recording):
        return [recordings]
    for one in recordings:
        if not isinstance(one, Recording):
            raise InputError(
                f"recordings hold a {type(one).__name__}; Recording.from_frame makes a "
                "recording of a table"
            )
    return list(recordings)
