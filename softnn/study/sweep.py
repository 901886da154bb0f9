"""Trials of a network study, kept by the search and tracked in MLflow.

A trial is one configuration, cross-validated: its networks are trained in one batch
and scored on what they have not seen. `Sweep` keeps every finished trial in the search
storage and mirrors it in MLflow, so that a study can be stopped at any moment.
"""

from __future__ import annotations

import json
import re
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from tqdm import tqdm

import softnn
from softnn.contracts import InputError
from softnn.neural import StoredNetwork
from softnn.neural.served import Served
from softnn.search import Finished, Objective, Range, Result, Search, Value, When
from softnn.study.common import fingerprint, write_result
from softnn.study.material_data import Data
from softnn.study.settings import Places, Settings, listed
from softnn.study.trainer import Trainer

if TYPE_CHECKING:
    from softnn.tracking import Tracker

WHAT = {
    "random": "random folds",
    "specimen": "by specimen",
    "rate": "by rate",
    "recording": "by recording",
}


# Parts of softnn.neural that no trial runs: they keep and serve what it trained.
AFTER = ("estimator", "guard", "served", "stored")


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
        objectives: int = 1,
        trainer: Trainer | None = None,
        code: Sequence[Path] = (),
        sampler: str = "tpe",
    ) -> None:
        from softnn.tracking import Tracker

        self._began = time.perf_counter()
        self.study, self.data, self.settings = study, data, settings
        self.trainer = trainer or Trainer(data, settings)
        content = {
            "study": study,
            "settings": asdict(settings) | {"data": data.source},
            "material": data.material,
            "space": {k: str(v) for k, v in space.items()},
            "training": asdict(self.trainer.training),
            "sampler": sampler,
            "data": data.digest,
            "version": softnn.__version__,
        }
        name = re.sub(r"\W+", "-", f"{study}-{data.source}-{data.material}")[:60]
        self.key = f"{name}-{fingerprint(content, files=(*_code(), *code))}"
        # What cannot be split is said before anything is opened.
        self.trainer.folds(settings.split, settings.inputs, settings.seed)
        self.search = Search(
            places.storage,
            self.key,
            space,
            seed=settings.seed,
            fresh=places.fresh,
            objectives=objectives,
            worker=places.worker,
            sampler=sampler,
        )
        self._tracker: Tracker | None = None

        def searched(name: str, value: str) -> str:
            values = space.get(name)  # the settings lack the parameters that are drawn
            if values is None or isinstance(values, Range):
                return value if values is None else str(values)
            return ", ".join(map(str, values))

        try:
            self.stored = len(self.search.finished)
            if not places.worker:
                identity = self.search.remember("identity", uuid.uuid4().hex)
                self._tracker = Tracker(
                    places.tracking,
                    study,
                    study=self.key,
                    identity=identity,
                    name=data.label,
                    parameters={
                        "material": data.material,
                        "inputs": searched("inputs", settings.inputs),
                        "neurons": listed(settings.neurons),
                        "split": searched("split", settings.split),
                        "regularisation": searched(
                            "regularisation", settings.regularisation
                        ),
                        "folds": settings.folds,
                        "sampler": sampler,
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

    def __exit__(self, *error: Any) -> None:
        self._bar.close()
        if self._tracker is not None:
            self._tracker.__exit__(*error)
        self.search.__exit__(*error)

    @property
    def tracker(self) -> Tracker:
        """Where runs are logged; a worker logs none."""
        assert self._tracker is not None
        return self._tracker

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

    def explore(
        self,
        submit: Callable[[dict[str, Any], Sequence[Finished]], Future[Result]],
        trials: int,
        *,
        first: Sequence[Mapping[str, Value]] = (),
        when: When | None = None,
    ) -> Iterator[Finished]:
        """`trials` trials towards the front of all objectives."""
        for trial in self.search.explore(submit, trials, first=first, when=when):
            yield self._keep(trial)

    def together(self, points: Sequence[Mapping[str, Value]]) -> None:
        """Have workers and this process do the trials of these parameters."""

        def done(parameters: dict[str, Any], _: Sequence[Finished]) -> Future[Result]:
            found: Future[Result] = Future()
            found.set_result(self.trainer(parameters))
            return found

        if self.search.on_server:
            for _ in self.search.explore(done, len(points), first=points):
                pass

    def _keep(self, trial: Finished) -> Finished:
        if self._tracker is not None:
            self._log(self._tracker, trial)
        self.trials.append(trial)
        here = self.settings.split
        best = max(
            (
                t
                for t in self.trials
                if t.parameters.get("split", here) == here
                and t.result.get("stopped_after") is None
            ),
            key=lambda t: t.result["r2_mean"],
            default=None,
        )
        if best is not None:
            r2, words = best.result["r2_mean"], describe(best.parameters)
            self._bar.set_postfix_str(f"best R2 {100 * r2:.3f} %, {words}")
        self._bar.update()
        return trial

    def _log(self, tracker: Tracker, trial: Finished) -> None:
        found = trial.result
        # The run's own figure is the mean; folds are the steps of another.
        # A trial that was stopped has no such figure: the mean of its first folds is
        # another, and would stand among those of whole trials.
        stopped = found.get("stopped_after")
        end = "" if stopped is None else "_of_folds_run"
        metrics: dict[str, Any] = {
            f"nrmse{end}": found["generalisation_error"],
            f"r2{end}": found["r2_mean"],
            "gamma": float(np.mean(found["gamma"])),
        }
        for key in ("nrmse", "r2", "gamma", "iterations"):
            metrics[f"fold_{key}"] = found[key]
        for key in ("seconds", "samples", "parameters"):
            metrics[key] = found[key]
        if "unseen" in found:
            metrics["nrmse_unseen"] = float(np.mean(found["unseen"]["nrmse"]))
            metrics["fold_nrmse_unseen"] = found["unseen"]["nrmse"]
            metrics["r2_unseen"] = float(np.mean(found["unseen"]["r2"]))
        tracker.trial(
            describe(trial.parameters),
            trial.parameters,
            metrics,
            started=trial.started,
            ended=trial.ended,
            tags={
                "folds": ", ".join(found["folds"])[:5000],
                "note": found["note"],
                "stopped": "no"
                if stopped is None
                else f"after {stopped} of {self.settings.folds} random folds",
                "softnn.again": json.dumps(self._again(trial)),
            },
        )

    def _again(self, trial: Finished) -> dict[str, Any]:
        """Return the settings that `softnn.study.rerun` needs to repeat a trial."""
        parameters = trial.result.get("configuration", trial.parameters)
        if "weight" in parameters:
            how = f"l2={parameters['weight']!r}"
            parameters = {**parameters, "regularisation": how}
        parameters = {"neurons": self.settings.neurons[0], **parameters}
        return {
            "settings": asdict(self.settings),
            "training": asdict(self.trainer.training),
            "material": self.data.material,
            "data": self.data.digest,
            "parameters": {k: v for k, v in parameters.items() if k != "weight"},
        }

    def say(self, what: str) -> None:
        """Show the current step beside the progress bar."""
        self._bar.set_postfix_str(what)

    def beside(self, row: Mapping[str, Any], unseen: str) -> None:
        """Log a model that is no trial as a run beside the trials.

        `row` has NRMSE by fold under "random", "specimen" and "unseen", or why not, and
        R2 under "r2".
        """
        metrics: dict[str, Any] = {}
        for split, end in (
            ("random", ""),
            ("specimen", "_specimen"),
            ("unseen", "_unseen"),
        ):
            if isinstance(row.get(split, ""), str):
                continue
            for name, values in (("nrmse", row[split]), ("r2", row["r2"][split])):
                metrics[f"{name}{end}"] = float(np.mean(values))
                metrics[f"fold_{name}{end}"] = values
        now = datetime.now()
        why = {s: row[s] for s in ("random", "unseen") if isinstance(row[s], str)}
        tags = {"note": "; ".join(f"{s}: {reason}" for s, reason in why.items())}
        self.tracker.trial(
            row["model"],
            {"inputs": row["model"], "unseen": unseen},
            metrics,
            started=now,
            ended=now,
            tags=tags,
        )

    def register(
        self, network: StoredNetwork, aliases: Sequence[str], about: str = ""
    ) -> str:
        """Put a network trained on everything into the registry; return its name.

        The name is the material's, with the name of the recordings in front where they
        name another. `about` says in a sentence what the network is for and how good
        it is.
        """
        first = self.data.tensile[0]
        rows = slice(None, None, max(1, len(first) // 5))
        example = {
            "time_s": first.time_s[rows].tolist(),
            "strain": first.strain[rows].tolist(),
        }
        if first.test == "tensile" and first.rate_per_s is not None:
            example["rate_per_s"] = [first.rate_per_s] * len(example["strain"])
        name, source = self.data.material, self.data.source
        if not self.data.is_virtual and source != name:
            name = f"{source}-{name}"
        said = Served(network).predict(pd.DataFrame(example))
        self.tracker.register(
            name,
            aliases,
            network.source,
            example,
            said.tolist(),
            about,
        )
        return self.tracker.registered(name)

    def entry(self, headline: Mapping[str, Any], **more: Any) -> dict[str, Any]:
        """Return the entry of this material for the result file, while it is open."""
        return {
            "material": self.data.material,
            "label": self.data.label,
            "data_sha256": self.data.digest,
            "headline": headline,
            **more,
            "trials_from_store": sum(t.stored for t in self.trials),
            "seconds": self.seconds,
            "study_key": self.key,
        }

    @property
    def ended(self) -> datetime:
        """When the last trial finished."""
        return max(t.ended for t in self.trials)

    @property
    def seconds(self) -> float | None:
        """Time since the opening, s; None if no run has done all the work at once.

        For rows from the store it is the time of the run that computed them.
        """
        if not any(t.stored for t in self.trials):
            taken = time.perf_counter() - self._began
            return float(self.search.remember("seconds", f"{taken:.2f}"))
        kept = self.search.remembered("seconds")
        return None if kept is None else float(kept)

    def from_store(self) -> str:
        """Return one line on the trials taken from the store, or ""."""
        old = sum(t.stored for t in self.trials)
        if not old:
            return ""
        return (
            f"{old} of {len(self.trials)} trials were finished before and are taken "
            "from the store (--fresh runs them again)"
        )


def write_all(
    study: str,
    settings: Settings,
    places: Places,
    found: Sequence[Mapping[str, Any]],
    **body: Any,
) -> dict[str, Any]:
    """Write the result of a study of several materials: headline and materials."""
    headline = headline_of_all(found)
    path = write_result(
        settings.file_name(study),
        headline,
        {"settings": asdict(settings), **body, "materials": found},
        seed=settings.seed,
        data={one["label"]: one["data_sha256"] for one in found},
        folder=places.results,
    )
    print(f"result: {path}; runs: {places.tracking}")
    return {"headline": headline, "materials": found}


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
    """Return the code files that a trial's result depends on."""
    package = Path(softnn.__file__).parent
    network = [
        f for f in sorted((package / "neural").glob("*.py")) if f.stem not in AFTER
    ]
    single = [
        package / "crossval.py",
        package / "metrics.py",
        Path(__file__).with_name("trainer.py"),
    ]
    return (*network, *single)
