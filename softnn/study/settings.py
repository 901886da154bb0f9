"""Settings of the network studies, and the command line that fills them."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from softnn.contracts import InputError
from softnn.neural import ARCHITECTURES, Regularisation, device_of
from softnn.study.common import (
    RUNS,
    Parser,
    database,
    parser,
    results_folder,
    runs_folder,
)

SPLITS = ("random", "specimen", "rate", "recording")
MOST_SAMPLES = 500  # a real recording; sampled at one rate, slow tests outweigh others


@dataclass(frozen=True)
class Settings:
    """What a network study is asked to do; all of it goes into the study's name."""

    material: str | None = None  # None: NatPolR, or every material of a real set
    data: str = "virtual"
    inputs: str = "FFRD4"
    neurons: tuple[int, ...] = tuple(range(1, 21))
    split: str = "random"
    regularisation: str = "bayesian"
    folds: int = 10
    seed: int = 0
    fraction: float = 1.0  # of the samples, drawn at random
    samples: int | None = None  # a recording, at most; None: as described in `prepared`
    lag_s: float | None = None  # of past inputs; None: one sample, as published
    as_is: bool = False  # take implausible numbers as they stand
    cycles: bool = False  # whole recordings of those that unload, not first loadings
    device: str = "cpu"  # that networks of tanh neurons are trained on

    def __post_init__(self) -> None:
        one_of("inputs", self.inputs, ARCHITECTURES)
        one_of("split", self.split, SPLITS)
        Regularisation.parse(self.regularisation)
        if not self.neurons or min(self.neurons) < 1:
            raise InputError(f"neurons are {self.neurons}; allowed is 1 or more")
        if self.folds < 2:
            raise InputError(f"folds is {self.folds}; at least 2 are needed")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}; it must be 0 or more")
        if not 0 < self.fraction <= 1:
            raise InputError(
                f"fraction is {self.fraction}; allowed is above 0, at most 1"
            )
        if self.lag_s is not None and not 0 < self.lag_s < float("inf"):
            raise InputError(f"lag is {self.lag_s} s; it must be above 0")
        if self.samples is not None and self.samples < 2:
            raise InputError(f"samples is {self.samples}; at least 2 are needed")

    def file_name(self, study: str) -> str:
        """The study, and what sets these data apart from the default ones."""
        parts = [study]
        if self.data != "virtual":
            parts.append(Path(self.data).stem)
        if self.material not in (None, "NatPolR"):
            parts.append(slug(str(self.material)))
        if self.cycles:
            parts.append("cycles")
        return "-".join(parts)


@dataclass(frozen=True)
class Places:
    """Where a study keeps its trials, its runs and its results."""

    storage: str
    tracking: str
    results: Path
    fresh: bool
    worker: bool = False  # does trials of a study that another process leads


def study_parser(
    name: str, doc: str | None, defaults: Settings, omit: str = ""
) -> Parser:
    """The options of a network study but for those in `omit`, which it varies."""
    made = parser(name, doc)

    def add(option: str, **about: Any) -> None:
        if option.removeprefix("--") not in omit.split():
            made.add_argument(option, **about)

    add("--material", metavar="NAME", help="a material, or all")
    add(
        "--data",
        default=defaults.data,
        metavar="SOURCE",
        help="virtual, a set of recordings in SOFTNN_DATA, a folder or a tidy CSV",
    )
    add("--inputs", default=defaults.inputs, help=" ".join(ARCHITECTURES))
    add("--neurons", default=listed(defaults.neurons), help="1:20, 12 or 3,5,8")
    add("--split", default=defaults.split, help=", ".join(SPLITS))
    add(
        "--regularisation",
        default=defaults.regularisation,
        help="bayesian, early-stopping or l2=WEIGHT",
    )
    add(
        "--lag-s",
        type=float,
        metavar="SECONDS",
        help="of past inputs (one sample, as published)",
    )
    add("--as-is", action="store_true", help="take implausible numbers as they stand")
    add(
        "--cycles",
        action="store_true",
        help="whole recordings of those that unload, not first loadings alone",
    )
    add("--folds", type=int, default=defaults.folds, help="of a random split")
    add("--fraction", type=float, default=defaults.fraction, help="of the samples")
    add(
        "--samples",
        type=int,
        default=defaults.samples,
        help="a recording, at most, at equal strain steps (virtual: as Table 6.2; "
        f"real: {MOST_SAMPLES})",
    )
    add("--device", default=defaults.device, help="cpu, cuda or auto: its rounding")
    add("--storage", help=f"Optuna (sqlite:///{RUNS}/optuna.db; postgresql+psycopg:)")
    add("--tracking", help=f"MLflow (sqlite:///{RUNS}/mlflow.db)")
    add("--out", type=Path, metavar="FOLDER", help="for the result and its figures")
    add("--fresh", action="store_true", help="start over; forget finished trials")
    return made


def add_worker(made: Parser) -> None:
    """The option of studies that several processes can carry out."""
    made.add_argument(
        "--worker",
        action="store_true",
        help="do trials of a study whose --storage is a database server, no more",
    )


def settings_of(
    arguments: argparse.Namespace, defaults: Settings | None = None
) -> Settings:
    """The settings that a command line asks for."""
    given = {
        item.name: getattr(arguments, item.name)
        for item in fields(Settings)
        if hasattr(arguments, item.name)
    }
    given["neurons"] = parse_neurons(given["neurons"])
    given["device"] = device_of(given["device"])
    return replace(defaults or Settings(), **given)


def of_one_count(settings: Settings) -> Settings:
    """The same; raises `InputError` where they hold several neuron counts."""
    if len(settings.neurons) > 1:
        raise InputError(f"neurons are {settings.neurons}; give one count")
    return settings


def smoked(settings: Settings) -> Settings:
    """The same, cut down to seconds: few samples, few neurons, few folds."""
    return replace(
        settings,
        neurons=tuple(sorted({min(count, 5) for count in settings.neurons}))[:3],
        folds=min(settings.folds, 3),
        samples=min(settings.samples or 30, 30),
        fraction=1.0,
    )


def places_of(arguments: argparse.Namespace, published: bool = True) -> Places:
    """Where to keep things.

    Results replace the project's own with --publish, if `published` says that these
    settings may.
    """
    worker = getattr(arguments, "worker", False)
    if worker and (arguments.fresh or arguments.smoke):
        raise InputError("a --worker starts nothing over; leave out --fresh, --smoke")
    home = runs_folder(arguments.smoke)
    results = (
        results_folder(arguments.smoke, arguments.publish)
        if published
        else home / "results"
    )
    return Places(
        storage=database(arguments.storage, arguments.smoke, "optuna"),
        tracking=database(arguments.tracking, arguments.smoke),
        results=arguments.out or results,
        fresh=arguments.fresh or arguments.smoke,
        worker=worker,
    )


def parse_neurons(text: str) -> tuple[int, ...]:
    """Neuron counts from `1:20` (both ends), `12` or `3,5,8`, in growing order.

    >>> parse_neurons("1:3,8")
    (1, 2, 3, 8)
    """
    counts: set[int] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,4})(?:\s*:\s*(\d{1,4}))?\s*", part)
        low, high = (int(g) if g else 0 for g in match.groups()) if match else (0, 0)
        high = high if match and match.group(2) else low
        if not 1 <= low <= high:
            raise InputError(
                f"neurons are {text!r}; allowed is a range from low to high such as "
                "1:20, a number such as 12, or a list such as 3,5,8"
            )
        counts.update(range(low, high + 1))
    return tuple(sorted(counts))


def slug(text: str) -> str:
    """Letters and digits alone, for a file name.

    >>> slug("rubber (unspecified; class lab)")
    'rubber-unspecified-class-lab'
    """
    return "-".join(re.findall(r"\w+", text))[:40]


def listed(counts: Sequence[int]) -> str:
    """Neuron counts as they are given on the command line."""
    if len(counts) > 1 and list(counts) == list(range(counts[0], counts[-1] + 1)):
        return f"{counts[0]}:{counts[-1]}"
    return ",".join(map(str, counts))


def one_of(what: str, value: str, allowed: Iterable[str]) -> None:
    """Raise `InputError` unless `value` is one of `allowed`."""
    if value not in allowed:
        raise InputError(f"{what} is {value!r}; allowed is {', '.join(allowed)}")
