"""What the network studies share: one trial, and trials kept and tracked.

A trial is one configuration, cross-validated: its networks are trained in one batch
and scored on what they have not seen. `Sweep` keeps every finished trial in the search
storage and mirrors it in MLflow, so that a study can be stopped at any moment.
"""

from __future__ import annotations

import re
import sys
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

import softnn
from softnn.contracts import InputError
from softnn.crossval import Folds, make_folds, rate_groups, score
from softnn.metrics import nrmse
from softnn.neural import Regularisation, Samples, Trained, samples, train
from softnn.search import Finished, Objective, Range, Search, Value
from studies.common import fingerprint
from studies.material_data import Data
from studies.settings import Places, Settings, listed

if TYPE_CHECKING:
    from softnn.tracking import Tracker

WHAT = {
    "random": "random folds",
    "specimen": "by specimen",
    "rate": "by rate",
    "recording": "by recording",
}


# --- one trial ------------------------------------------------------------------------


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


# --- trials, kept and tracked ---------------------------------------------------------


class Sweep:
    """The trials of one study on one material: stored by Optuna, mirrored in MLflow.

    Open it as a context. Its key is a hash of the settings, the data and the code that
    trains and scores, so results of different ones never mix.
    """

    def __init__(
        self,
        study: str,
        data: Data,
        settings: Settings,
        space: Mapping[str, Sequence[Value] | Range],
        places: Places,
        total: int,
    ) -> None:
        from softnn.tracking import Tracker

        self._began = time.perf_counter()
        self.study, self.data, self.settings = study, data, settings
        content = {
            "study": study,
            "settings": asdict(settings) | {"data": data.source},
            "material": data.material,
            "space": {k: str(v) for k, v in space.items()},
            "data": data.digest,
            "version": softnn.__version__,
        }
        name = re.sub(r"\W+", "-", f"{study}-{data.source}-{data.material}")[:60]
        self.key = f"{name}-{fingerprint(content, files=_code())}"
        self.trainer = Trainer(data, settings)
        # What cannot be split is said before anything is opened.
        self.trainer.folds(settings.split, settings.inputs, settings.seed)
        self.search = Search(
            places.storage, self.key, space, seed=settings.seed, fresh=places.fresh
        )
        try:
            identity = self.search.remember("identity", uuid.uuid4().hex)
            self.stored = len(self.search.finished)
            self.tracker: Tracker = Tracker(
                places.tracking,
                study,
                study=self.key,
                identity=identity,
                name=data.label,
                parameters={
                    "material": data.material,
                    "inputs": settings.inputs,
                    "neurons": listed(settings.neurons),
                    "split": settings.split,
                    "regularisation": settings.regularisation,
                    "folds": settings.folds,
                    "fraction": settings.fraction,
                    "seed": settings.seed,
                },
                data=(data.source, data.digest),
            )
        except BaseException:
            self.search.__exit__(None, None, None)
            raise
        self.trials: list[Finished] = []
        self._bar = tqdm(
            total=total,
            desc=data.material,
            unit="trial",
            dynamic_ncols=True,
            mininterval=0.1 if sys.stderr.isatty() else 10,
        )

    def __enter__(self) -> Sweep:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.close()
        self.tracker.__exit__(kind, error, trace)
        self.search.__exit__(kind, error, trace)

    def possible(self, split: str) -> str | None:
        """None if the data can be split so, else why not."""
        try:
            self.trainer.folds(split, self.settings.inputs, self.settings.seed)
        except InputError as reason:  # one rate only, one specimen only ...
            return str(reason)
        return None

    def expect(self, more: int) -> None:
        """Lengthen the progress bar by so many trials."""
        self._bar.total += more
        self._bar.refresh()

    def run(self, objective: Objective | None = None, **parameters: Value) -> Finished:
        """The trial of these parameters, now or from the store."""
        return self._keep(self.search.run(parameters, objective or self.trainer))

    def minimise(
        self,
        objective: Objective,
        trials: int,
        **fixed: Value,
    ) -> Iterator[Finished]:
        """`trials` trials that look for the least generalisation error."""
        for trial in self.search.minimise(objective, trials, **fixed):
            yield self._keep(trial)

    def _keep(self, trial: Finished) -> Finished:
        found = trial.result
        metrics = {
            key: found[key]
            for key in ("nrmse", "r2", "gamma", "iterations", "seconds", "samples")
        }
        metrics |= {
            "nrmse_mean": found["generalisation_error"],
            "r2_mean": found["r2_mean"],
            "gamma_mean": float(np.mean(found["gamma"])),
            "parameters": found["parameters"],
        }
        self.tracker.trial(
            describe(trial.parameters),
            trial.parameters,
            metrics,
            started=trial.started,
            ended=trial.ended,
            tags={"folds": ", ".join(found["folds"])[:5000], "note": found["note"]},
        )
        self.trials.append(trial)
        here = self.settings.split
        best = max(
            (t for t in self.trials if t.parameters.get("split", here) == here),
            key=lambda t: t.result["r2_mean"],
        )
        self._bar.set_postfix_str(
            f"best R2 {100 * best.result['r2_mean']:.3f} %, {describe(best.parameters)}"
        )
        self._bar.update()
        return trial

    @property
    def ended(self) -> datetime:
        """When the last trial finished."""
        return max(t.ended for t in self.trials)

    @property
    def seconds(self) -> float | None:
        """Time since the opening; None where no run has done all the work at once.

        Asked for again from the store, it is that of the run which did the work.
        """
        if not any(t.stored for t in self.trials):
            taken = time.perf_counter() - self._began
            return float(self.search.remember("seconds", f"{taken:.2f}"))
        kept = self.search.remembered("seconds")
        return None if kept is None else float(kept)

    def from_store(self) -> str:
        """One line on what was not run again, or nothing."""
        old = sum(t.stored for t in self.trials)
        if not old:
            return ""
        return (
            f"{old} of {len(self.trials)} trials were finished before and are taken "
            "from the store (--fresh runs them again)"
        )


def headline_of_all(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The headlines of several materials as one flat one, and the time all took."""
    headline: dict[str, Any] = {}
    for one in found:
        prefix = f"{one['material']}_" if len(found) > 1 else ""
        headline |= {prefix + key: value for key, value in one["headline"].items()}
    seconds = [one["seconds"] for one in found]
    whole = None if None in seconds else round(sum(seconds), 1)
    return headline | {"study_s": whole}


def trial_entry(trial: Finished) -> dict[str, Any]:
    """A trial as the result file keeps it."""
    return {**trial.parameters, **trial.result}


def describe(parameters: Mapping[str, Any]) -> str:
    """A trial in a few words, unlike that of any other trial of its study.

    >>> describe({"neurons": 1, "split": "rate"})
    '1 neuron, by rate'
    """
    words = []
    for key, value in parameters.items():
        if key == "neurons":
            words.append(f"{value} neuron" + "s" * (value != 1))
        elif key == "split":
            words.append(WHAT[value])
        elif key == "folds_seed":
            words.append(f"folds drawn with seed {value}")
        elif isinstance(value, float):
            words.append(f"{key} {value:.6g}")
        else:
            words.append(str(value))
    return ", ".join(words)


@cache
def _code() -> tuple[Path, ...]:
    """The files whose change would change a trial's result, data apart."""
    package = Path(softnn.__file__).parent
    single = [package / "crossval.py", package / "metrics.py", Path(__file__)]
    return (*sorted((package / "neural").glob("*.py")), *single)
