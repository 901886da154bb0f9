"""Piecewise-linear models on the recordings that the networks are trained on.

Two questions are separate. *Over rates* (thesis Fig. 5.6): branches come from a hold,
and the springs k* from the mean curve of one rate. The error is that over the mean
curves of all rates, the fitted one included, and the tolerance is chosen for it. *Like
for like*: the error on the samples that a network is judged on, by a fit that was made
and chosen on the training recordings alone.

`WAYS` names the ways to find branches, the same in every study: as in the thesis, by
any reading of the holds, or jointly with the springs from the curves alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn import prepare
from softnn.contracts import Array, InputError
from softnn.crossval import make_folds, score
from softnn.metrics import generalisation_error, nrmse
from softnn.models.fit_piecewise import PiecewiseFit, branch_stress, fit_jointly, sweep
from softnn.models.relaxation import (
    Hold,
    Relaxation,
    best_branches,
    mean_hold,
    non_negative,
    three_points,
)
from softnn.models.segments import Tolerance
from softnn.recording import Recording
from softnn.study.material_data import first_loading

TOLERANCES = tuple(t / 100 for t in range(10, 101, 10))
MODELS = ("PL-SLS", "PL-Wiechert")
SPLITS = ("specimen", "rate")
WAYS = {
    "as_in_thesis": "as in the thesis",
    "any_reading": "any reading of the holds",
    "joint": "fitted jointly",
}
RULES = {"PL-SLS": "tau of the decaying part", "PL-Wiechert": "collocation"}
STATED = "tau read literally"  # the text of section 5.4: 36.8 % of the initial stress
JOINT_BRANCHES = {"PL-SLS": 1, "PL-Wiechert": 5}
# The thesis takes k* from 500 mm/min, for SR, which has none, from the slowest.
SLOWEST = ("SR",)
SHARES = (0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
ALIKE = 0.1  # held strains within this fraction of each other are one test
WINDOW = 0.01  # of a hold, smoothed over


@dataclass(frozen=True)
class Variant:
    """Branches of one model from one relaxation test, and how they were found.

    `share` is the fraction of their stiffness that is used.
    """

    model: str
    relaxation: Relaxation
    held_strain: float
    held_s: float
    rule: str
    share: float = 1.0


def hold_of(recording: Recording) -> tuple[Hold, float]:
    """Time since the strain was reached and modulus of a ramp and hold; its strain.

    The held strain is the median of the second half of the time. The hold starts where
    99.5 % of it is first reached. Its stress is smoothed by Savitzky and Golay's filter
    where it is noisy (thesis 4.3.2), or start and end would each be one sample's noise.
    """
    known = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    part = recording.take(np.flatnonzero(known))
    time, strain = part.time_s, part.strain
    late = time >= (time[0] + time[-1]) / 2
    level = float(np.median(strain[late]))
    if not abs(level) > 0:
        raise InputError(f"{recording.name}: no strain is held at its end")
    start = int(np.argmax(strain / level >= 0.995))
    if len(part) - start < 3:
        raise InputError(f"{recording.name}: the hold is shorter than three samples")
    hold = part.take(np.arange(start, len(part)))
    held_s = float(hold.time_s[-1] - hold.time_s[0])
    stress = prepare.smooth(hold, window_s=WINDOW * held_s).stress_MPa
    return (hold.time_s - hold.time_s[0], stress / level), level


@dataclass(frozen=True)
class RelaxationTest:
    """One relaxation test: its holds, their mean and the mean strain held."""

    holds: list[Hold]
    held_strain: float

    @property
    def mean(self) -> Hold:
        return mean_hold(self.holds)

    @property
    def held_s(self) -> float:
        return float(min(time[-1] for time, _ in self.holds))


def relaxation_tests(recordings: Sequence[Recording]) -> list[RelaxationTest]:
    """Holds at the same strain for as long are one test; the shortest first."""
    holds = [hold_of(r) for r in recordings]
    groups: list[list[tuple[Hold, float]]] = []
    for hold, level in sorted(holds, key=lambda h: (h[0][0][-1], h[1])):
        for group in groups:
            (time, _), other = group[0]
            near = abs(level - other) <= ALIKE * abs(other)
            if near and hold[0][-1] <= 2 * time[-1]:
                group.append((hold, level))
                break
        else:
            groups.append([(hold, level)])
    return [
        RelaxationTest([h for h, _ in g], float(np.mean([level for _, level in g])))
        for g in groups
    ]


def late_tau(hold: Hold) -> Relaxation:
    """Eq. 5.2 with tau read literally: the stress nearest to 36.8 % of its start.

    Most holds never fall that far; tau is then near their end, and the branch is
    all but a spring within a tensile test.
    """
    fit = three_points(*hold)
    time, modulus = hold
    nearest = int(np.argmin(np.abs(modulus - modulus[0] / np.e)))
    tau = float(time[nearest] - time[0])
    late = Relaxation(fit.equilibrium, fit.stiffness, (tau,), "three points, literal")
    error = late.modulus(time - time[0]) - modulus
    return Relaxation(
        late.equilibrium,
        late.stiffness,
        late.relaxation_time,
        late.method,
        float(np.sqrt(np.mean(error**2))),
    )


def variants(recordings: Sequence[Recording]) -> Iterator[Variant]:
    """Every reading of the thesis's way to branches, for every group of holds."""
    for test in relaxation_tests(recordings):
        hold, about = test.mean, (test.held_strain, test.held_s)
        decaying = three_points(*hold)
        yield Variant("PL-SLS", decaying, *about, "tau of the decaying part")
        yield Variant("PL-SLS", late_tau(hold), *about, STATED)
        collocated, _ = best_branches(hold)
        yield Variant("PL-Wiechert", collocated, *about, "collocation")
        constrained = non_negative(*hold, collocated.branches)
        yield Variant("PL-Wiechert", constrained, *about, "non-negative least squares")


def softened(found: Sequence[Variant]) -> list[Variant]:
    """The same branches at a share of their stiffness.

    A hold at a strain of 0.2 says little of a strain of 4, where most elastomers relax
    by less in proportion; a linear branch goes on as it began. The share is chosen as
    the thesis chooses the tolerance, by the error over rates.
    """
    return [
        replace(v, relaxation=v.relaxation.scaled(share), share=share)
        for v in found
        for share in SHARES
    ]


def rate_errors(fit: PiecewiseFit, curves: Sequence[Recording]) -> list[float]:
    """NRMSE on each curve."""
    return [nrmse(fit.predict(c), c.stress_MPa) for c in curves]


def fitted_curve(curves: Sequence[Recording]) -> Recording:
    """The mean curve k* is taken from: the fastest; of some materials the slowest."""
    ordered = sorted(curves, key=lambda c: c.rate_per_s or 0.0)
    return ordered[0 if ordered[0].material in SLOWEST else -1]


@dataclass(frozen=True)
class Choice:
    """A fit, what it was chosen from, and its NRMSE on the mean curve of each rate."""

    fit: PiecewiseFit
    variant: Variant
    tolerance: float
    errors: list[float]

    @property
    def generalisation_error(self) -> float:
        return generalisation_error(self.errors)


def choices(
    curves: Sequence[Recording],
    found: Sequence[Variant],
    train: Sequence[Recording] | None = None,
) -> list[Choice]:
    """A fit to `train` (as in the thesis, one curve) per variant and tolerance."""
    train = [fitted_curve(curves)] if train is None else train
    rows = sweep(
        train, [v.relaxation for v in found], [Tolerance(t) for t in TOLERANCES]
    )
    made = []
    for variant, row in zip(found, rows, strict=True):
        viscous = [branch_stress(variant.relaxation, c) for c in curves]
        for tolerance, fit in zip(TOLERANCES, row, strict=True):
            errors = [
                nrmse(fit.predict(c, v), c.stress_MPa)
                for c, v in zip(curves, viscous, strict=True)
            ]
            made.append(Choice(fit, variant, tolerance, errors))
    return made


def best(found: Sequence[Choice], model: str) -> Choice:
    """The choice of least generalisation error among those of a model."""
    mine = [c for c in found if c.variant.model == model]
    return min(mine, key=lambda c: c.generalisation_error)


def literal(found: Sequence[Choice], model: str) -> Choice:
    """The same by the thesis's own way to branches, whichever hold it is taken from."""
    return best([c for c in found if c.variant.rule == RULES[model]], model)


def stated(found: Sequence[Choice], model: str) -> Choice | None:
    """The same with the relaxation time where the text of the thesis puts it.

    Only PL-SLS has such a time; None for PL-Wiechert, whose times are spread by
    collocation.
    """
    mine = [c for c in found if c.variant.rule == STATED]
    return best(mine, model) if model == "PL-SLS" else None


def piecewise_baselines(
    tensile: Sequence[Recording], relaxation: Sequence[Recording]
) -> dict[str, Any]:
    """Return PL-SLS and PL-Wiechert on prepared specimens and holds, ready for JSON.

    Each model has its generalisation error over rates as in the thesis (eq. 5.13), with
    the tolerance (a fraction), segments, branches and variant chosen for it. It has the
    same for every variant, for branches at a share of their stiffness (`softened`), and
    for springs and branches fitted jointly. Like for like, it has the mean NRMSE over
    folds by specimen and by rate in each of `WAYS`. Errors are fractions.

    Raises `InputError` if there is no hold to take branches from.
    """
    if not relaxation:
        raise InputError("no relaxation test; piecewise models take branches from one")
    curves = prepare.unify(tensile)
    readings = list(variants(relaxation))
    found = choices(curves, readings)
    soft = choices(curves, softened(readings))
    table: dict[str, Any] = {}
    for model in MODELS:
        chosen = literal(found, model)
        table[model] = {
            **described(chosen, curves),
            "fitted_rate_per_s": fitted_curve(curves).rate_per_s,
            "variants": [
                described(best([c for c in found if c.variant is v], model), curves)
                for v in dict.fromkeys(c.variant for c in found)
                if v.model == model
            ],
            "softened": described(best(soft, model), curves),
            "joint": jointly(model, curves),
            "like_for_like": {},
        }
    for split in SPLITS:
        for model, entry in like_for_like(split, tensile, relaxation).items():
            table[model]["like_for_like"][split] = entry
    return table


def described(choice: Choice, curves: Sequence[Recording]) -> dict[str, Any]:
    """A choice as it is reported."""
    v = choice.variant
    return {
        "generalisation_error": choice.generalisation_error,
        "tolerance": choice.tolerance,
        "segments": choice.fit.segments,
        "branches": choice.fit.branches,
        "negative_branches": v.relaxation.negative,
        "rule": v.rule,
        "share": v.share,
        "held_strain": v.held_strain,
        "held_s": v.held_s,
        "relaxation": v.relaxation.to_dict(),
        "nrmse_by_rate": _by_rate(curves, choice.errors),
    }


def jointly(model: str, curves: Sequence[Recording]) -> dict[str, Any] | None:
    """Springs and branches from the mean curves of all rates; None for one rate."""
    if len({c.rate_per_s for c in curves}) < 2:
        return None
    fit = fit_jointly(curves, JOINT_BRANCHES[model])
    errors = rate_errors(fit, curves)
    return {
        "nrmse_over_rates": generalisation_error(errors),
        "segments": fit.segments,
        "branches": fit.branches,
        "nrmse_by_rate": _by_rate(curves, errors),
    }


def like_for_like(
    split: str, tensile: Sequence[Recording], relaxation: Sequence[Recording]
) -> dict[str, Any]:
    """Mean NRMSE over the folds a network is judged on, by model; see the module.

    A hold of a held-out recording is not used; see `training_fits`.
    """
    index = np.repeat(np.arange(len(tensile)), [len(r) for r in tensile])
    target = np.concatenate([r.stress_MPa for r in tensile])
    try:
        folds = make_folds(tensile, index, split)
    except InputError as reason:
        return {model: {"not_possible": str(reason)} for model in MODELS}
    kept: dict[tuple[str, str], list[Array]] = {}
    reasons: dict[tuple[str, str], str] = {}
    for test in folds.test:
        held_out = set(index[test])
        train = [r for i, r in enumerate(tensile) if i not in held_out]
        names = {tensile[i].name for i in held_out}
        holds = [r for r in relaxation if r.name not in names]
        fits = training_fits(train, holds, reasons)
        for key, fit in fits.items():
            predicted = np.full(len(target), np.nan)
            for i in held_out:
                predicted[index == i] = fit.predict(tensile[i])
            kept.setdefault(key, []).append(predicted)
    table: dict[str, Any] = {}
    for model in MODELS:
        table[model] = {}
        for way in WAYS:
            rows = kept.get((model, way), [])
            if len(rows) < len(folds.test):
                why = reasons.get((model, way), "a fold has no training recording")
                table[model][way] = {"not_possible": why}
                continue
            scores = score(folds, np.stack(rows), target)
            table[model][way] = {
                "nrmse": scores.generalisation_error,
                "r2": scores.mean_r2,
                "nrmse_by_fold": dict(
                    zip(folds.names, scores.nrmse.tolist(), strict=True)
                ),
            }
        table[model]["note"] = folds.note
    return table


def training_fits(
    train: Sequence[Recording],
    holds: Sequence[Recording],
    reasons: dict[tuple[str, str], str],
) -> dict[tuple[str, str], PiecewiseFit]:
    """A fit for each model and way, from training recordings; else the reason.

    Tolerance, and reading where there is a choice, are those of least error over the
    mean curves of the training recordings; `joint` is fitted to those curves.
    """
    fits: dict[tuple[str, str], PiecewiseFit] = {}
    curves = prepare.unify(train) if train else []
    found = choices(curves, list(variants(holds))) if curves and holds else []
    rates = {c.rate_per_s for c in curves}
    for model in MODELS:
        if found:
            fits[model, "as_in_thesis"] = literal(found, model).fit
            fits[model, "any_reading"] = best(found, model).fit
        else:
            for way in ("as_in_thesis", "any_reading"):
                reasons[model, way] = "a fold leaves no hold to train on"
        if len(rates) > 1:
            fits[model, "joint"] = fit_jointly(curves, JOINT_BRANCHES[model])
        else:
            reasons[model, "joint"] = (
                "a fold leaves one rate: branches pass for springs"
            )
    return fits


def cyclic_fits(
    train: Sequence[Recording],
    holds: Sequence[Recording],
    reasons: dict[tuple[str, str], str],
) -> dict[tuple[str, str], PiecewiseFit]:
    """The same for whole cycles, which tell a branch from a spring at one rate too.

    From holds and curves, as in the thesis, it is the first loadings that are fitted;
    jointly, the cycles themselves.
    """
    loadings = [first_loading(r, len(r)) for r in train]
    fits = training_fits(loadings, holds, reasons)
    for model in MODELS:
        fits[model, "joint"] = fit_jointly(train, JOINT_BRANCHES[model])
    return fits


def _by_rate(curves: Sequence[Recording], errors: Sequence[float]) -> dict[str, float]:
    return {
        "not given" if c.rate_per_s is None else f"{c.rate_per_s:.4g}": error
        for c, error in zip(curves, errors, strict=True)
    }
