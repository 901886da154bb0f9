"""What does a network lack, where a piecewise-linear model predicts better?

`studies.architectures` has materials on which the best piecewise-linear model has less
error at unseen rates than the chosen network. For each of them the network is trained
again without its worst fold, and diagnosed on the recordings of that fold. One sentence
names the effects that the network lacks. Where the training did not show it such rates
or holds, no physics can be named, and the sentence says so. It adds how much of the
error is a stress that is too high or too low throughout.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.architectures.choices import folds_of, worse_by
from bench.architectures.page import result_files
from bench.architectures.trials import TRAINING
from softnn.contracts import Array, InputError
from softnn.crossval import Folds
from softnn.metrics import nrmse
from softnn.mismatch import untaught
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import diagnose
from softnn.neural import Seen, StoredNetwork
from softnn.report.phrases import listed, plain
from softnn.study.common import (
    RESULTS,
    guarded,
    parser,
    provenance,
    provenance_of,
    results_folder,
    write_result,
)
from softnn.study.material_data import prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer

MOST = 4  # recordings that are diagnosed
AFTER = "later samples"  # than any that was never shown
LEAST = 0.05  # of the samples, by which it is worth a word
Result = Mapping[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.lacks`; returns the exit code."""
    made = parser("lacks", __doc__)
    made.add_argument("--only", default="", help="materials with this in their name")
    return guarded(lambda: run(made.parse_args(argv)))


def run(a: Any) -> None:
    place = results_folder(a.smoke, a.publish)
    kept = place / "lacks.json"
    found: dict[str, Any] = {}
    worse = smallest() if a.smoke else wanted()
    if kept.exists():
        old = json.loads(kept.read_text(encoding="utf-8"))
        about = provenance_of(old)
        found = {k: about | row for k, row in old["materials"].items()}
    # Of others, or of networks that are chosen no more, nothing is carried on.
    now = {one["label"]: one["choices"]["unseen"]["words"] for one, _ in worse}
    found = {
        k: row
        for k, row in found.items()
        if row["network"] == now.get(k) and "sentence" in row
    }
    known: dict[str, str] = {}
    for one, settings in (w for w in worse if a.only in w[0]["label"]):
        found[one["label"]] = asked(one, settings, 1 if a.smoke else MOST)
        known[one["label"]] = one["data_sha256"]
        print(f"{one['label']}: {found[one['label']]['sentence']}", flush=True)
        written(found, known, a.seed, place)
    if not found:
        raise InputError("no network of studies/results is worse than its PL model")


def wanted() -> list[tuple[Result, Result]]:
    """Materials on which the network is worse, each with the settings of its study."""
    return [
        (one, result["settings"])
        for result in result_files(RESULTS).values()
        for one in result["materials"]
        if worse_by(one) is not None
    ]


def smallest() -> list[tuple[Result, Result]]:
    """NatPolR, whose recordings everybody has, worse or not."""
    found = json.loads((RESULTS / "architectures.json").read_text(encoding="utf-8"))
    return [(found["materials"][0], found["settings"])]


def written(
    found: Mapping[str, Any], known: Mapping[str, str], seed: int, place: Path
) -> None:
    headline = {"materials": len(found)}
    headline |= {
        "named": sum(bool(one["selected"]) for one in found.values()),
        "never_shown": sum(bool(one["never_shown"]) for one in found.values()),
    }
    write_result(
        "lacks", headline, {"materials": found}, seed=seed, data=known, folder=place
    )


def asked(one: Result, given: Result, most: int) -> dict[str, Any]:
    """What a diagnosis of the worst fold says of the network trained without it.

    `most` of its recordings are diagnosed, evenly drawn.
    """
    settings = Settings(
        **{**given, "neurons": tuple(given["neurons"]), "material": one["material"]}
    )
    (data,) = [d for d in prepared(settings) if d.material == one["material"]]
    trainer = Trainer(data, settings, TRAINING, threads=1)
    # The starting weights with which the choice was judged.
    anew = {"folds_seed": settings.seed + 1}
    chosen = trainer.chosen(one["choices"]["unseen"]["configuration"] | anew)
    folds = trainer.folds(
        one["unseen"], chosen["inputs"], chosen["folds_seed"], chosen["lag_s"]
    )
    errors = folds_of(one["choices"]["unseen"]["anew"], "unseen")
    worst = int(np.argmax(errors))
    alone = Folds(
        folds.test[worst : worst + 1], folds.names[worst : worst + 1], folds.split
    )
    (trained,) = trainer.networks(chosen, [alone], [worst])
    known, test = trainer.samples(chosen["inputs"], chosen["lag_s"]), folds.test[worst]
    held = sorted(set(known.recording[test].tolist()))
    seen = Seen.of([r for i, r in enumerate(data.tensile) if i not in held])
    about = chosen["inputs"], chosen["lag_s"], seen
    network = StoredNetwork(trained.network, *about)
    some = np.unique(np.linspace(0, len(held) - 1, most).astype(int))
    case = Case(data.file_name, tuple(data.tensile[held[i]] for i in some))
    told = diagnose(case, network)
    shares = never_shown(case, network)
    said = trained.network.at(test, known.inputs, known.recording)
    error = nrmse(said, known.target[test])
    factor, left = level(said, known.target[test])
    return {
        "network": one["choices"]["unseen"]["words"],
        "unseen": folds.names[worst],
        "error": error,
        "verdict": told.verdict,
        "selected": list(told.selected),
        "summary": told.summary,
        "never_shown": shares,
        "factor": factor,
        "error_without_factor": left,
        "sentence": sentence(
            {name: told.probability[name] for name in told.selected},
            shares,
            (error, factor, left),
        ),
        **provenance(),
    }


def never_shown(case: Case, network: StoredNetwork) -> dict[str, float]:
    """What the network was never shown, with its share of the samples of a case.

    Later samples of a recording have a history that was never shown either. Their share
    stands last, under `AFTER`.
    """
    total = sum(len(r) for r in case.recordings)
    counts: dict[str, int] = {}
    first: dict[int, int] = {}
    for one in untaught.stretches(case, network.known):
        counts[one.what] = counts.get(one.what, 0) + one.last - one.first
        first[one.recording] = min(first.get(one.recording, total), one.first)
    shares = dict(sorted(counts.items(), key=lambda item: -item[1]))
    later = sum(len(case.recordings[i]) - start for i, start in first.items())
    rest = later - sum(counts.values())
    if rest > LEAST * total:
        shares[AFTER] = rest
    return {what: count / total for what, count in shares.items()}


def level(predicted: Array, measured: Array) -> tuple[float, float]:
    """The factor by which a prediction (n,) is too high, and the NRMSE without it.

    The factor is the one that leaves the least error.

    >>> level(np.array([2.0, 4.0]), np.array([1.0, 2.0]))
    (2.0, 0.0)
    """
    factor = float(predicted @ predicted / (predicted @ measured))
    return factor, nrmse(predicted / factor, measured)


def sentence(
    named: Mapping[str, float],
    shares: Mapping[str, float],
    errors: tuple[float, float, float],
) -> str:
    """What a network lacks: effects with their probability, or what it never saw.

    `errors` are its NRMSE, the factor by which its stress is too high, and the NRMSE
    without that factor.

    >>> said = sentence({}, {"faster rates": 0.98}, (0.14, 0.88, 0.05))
    >>> said.split(". ")[0]
    'It was never shown faster rates (98 % of the samples)'
    >>> said.split("; ")[1]
    'at the right level its error of 14 % would be 5 %.'
    >>> said = sentence({}, {"holds": 0.04, AFTER: 0.64}, (0.14, 0.88, 0.05))
    >>> said.split(". ")[1]
    'Later samples (64 %) have a history that it was never shown either'
    """
    error, factor, left = errors
    parts = []
    if named:
        effects = [f"{plain(n)} ({100 * p:.0f} %)" for n, p in named.items()]
        parts.append(f"lacks {listed(effects)}")
    seen = [
        f"{what} ({100 * s:.0f} % of the samples)"
        for what, s in shares.items()
        if what != AFTER
    ]
    if seen:
        parts.append(f"was never shown {listed(seen)}")
    if not parts:
        parts.append("was shown all that it is asked, and no effect can be named")
    told = f"It {' and '.join(parts)}. "
    if AFTER in shares:
        told += (
            f"{AFTER.capitalize()} ({100 * shares[AFTER]:.0f} %) have a history that "
            "it was never shown either. "
        )
    return told + (
        f"Its stress is {100 * abs(factor - 1):.0f} % too "
        f"{'high' if factor > 1 else 'low'} overall; at the right level its error of "
        f"{100 * error:.0f} % would be {100 * left:.0f} %."
    )


if __name__ == "__main__":
    sys.exit(main())
