"""What diagnosis.json holds, in the units of the recordings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from softnn.axes import Axes
from softnn.contracts import Array
from softnn.fit import Fit, Piece, fit
from softnn.mismatch import locate, verify, words
from softnn.mismatch.case import Case
from softnn.mismatch.evidence import changes
from softnn.mismatch.judgement import Judgement
from softnn.mismatch.learn import Learned
from softnn.recording import data_hash

VERSION = 1


def diagnosis(
    case: Case,
    axes: Axes,
    told: Judgement,
    learned: Learned | None,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """All of it but what the stretches of `untaught` add; `axes` say what counts as 1.

    The scan for regions and the interval of the held-out error draw from `rng`.
    """
    decision, probable = told.decision, told.posterior
    before, after = decision.before, decision.after
    ratio, low, high = verify.ratio_interval(before.errors, after.errors, rng)
    pieces = [(i, p) for i, p in enumerate(told.after.guess.pieces) if not p.nuisance]
    found = list(zip(pieces, changes(told.fine, told.after), strict=True))
    samples, squares = len(told.engine.target), float(np.sum(told.engine.target**2))
    result: dict[str, Any] = {
        "case": case.name,
        "data_sha256": data_hash(case.recordings),
        "model": told.base.name,
        "version": VERSION,
        "verdict": told.verdict,
        "summary": "",
        "selected": told.names,
        "noise": _noise(told, axes),
        "mismatch": _regions(told, axes, rng),
        "explanations": [
            _explanation(told, axes, i, piece, change)
            for (i, piece), change in found
            if piece.effect.id in told.names
        ],
        "corrected_by": sorted(decision.account.effects),
        "probabilities": {
            "nothing": round(probable.nothing, 4),
            "on_no_list": round(probable.nothing_named, 4),
            "something_else_too": round(probable.other - probable.nothing_named, 4),
        },
        "ways": [
            {"effects": sorted(s), "probability": round(p, 4)}
            for s, p in probable.ways()
        ],
        "fit": {
            "before": _errors(told, told.before, before),
            "after": _errors(told, told.after, after),
            "heldout_ratio": ratio,
            "heldout_ratio_95": [low, high],
            "noise_nrmse": told.noise_MPa * float(np.sqrt(samples / squares)),
            "residual_correlation": verify.whiteness(told.engine, decision.account.fit),
        },
        "next_recording": words.next_recording(told),
        "candidates": _candidates(told),
        "judged_by": told.judged_by,
        "structure": None if learned is None else _structure(learned, axes),
        "axes": {
            "strain": [axes.strain.name, axes.strain.unit],
            "stress": [axes.stress.name, axes.stress.unit],
        },
    }
    result["summary"] = words.summary(result, told)
    return result


def _noise(told: Judgement, axes: Axes) -> dict[str, Any]:
    noise, unit, one = told.noise, axes.stress.unit, axes.stress.one
    return {
        f"sigma_{unit}": one * told.noise_MPa,
        "correlation_time_s": float(np.median([n.correlation_s for n in noise])),
        "share_of_stress": float(np.median([n.share for n in noise])),
        f"step_{unit}": one * float(max(n.step_MPa for n in noise)),
    }


def _regions(
    told: Judgement, axes: Axes, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """Where named effects act beyond two sigma; else where noise does not explain."""
    engine = told.fine
    if told.names:
        moved = locate.action(engine, told.after)
        mask = np.abs(moved) > locate.SIGMAS * engine.sigma
    elif told.verdict == "nothing_missing":
        return []
    else:
        moved = engine.target - told.before.stress
        mask = locate.scan(engine, told.before, rng)
    return locate.regions(engine, mask, moved, axes)


def _nrmse(told: Judgement, one: Fit) -> float:
    target = told.fine.target
    return verify.nrmse_of((target - one.stress) ** 2, target**2)


def _errors(told: Judgement, one: Fit, heldout: verify.Heldout) -> dict[str, Any]:
    found: dict[str, Any] = {
        "nrmse": _nrmse(told, one),
        "heldout_nrmse": heldout.nrmse,
    }
    if heldout.worst is not None:
        by, error = heldout.worst
        found["worst"] = {"left_out": by, "nrmse": error}
    return found


def _explanation(
    told: Judgement, axes: Axes, index: int, piece: Piece, change: Array
) -> dict[str, Any]:
    """An effect named, with its parameters; `change` (valid,) of the stress is its."""
    law, engine, found = piece.effect, told.fine, told.after
    limits = verify.intervals(found)
    names, unknown = engine.data.names, (np.nan, np.nan)
    parameters: dict[str, Any] = {}
    for p in law.parameters:
        value = piece.values[p.name]
        if np.ndim(value):
            rows = {
                f"{p.name} of {names[r]}": (value[r], *limits.get(key, unknown))
                for key in ((index, p.name, group) for group in piece.groups)
                for r in key[2]
            }
        else:
            ends = verify.profiled(engine, found, index, p.name, limits)
            rows = {p.name: (value, *ends)}
        size, unit = axes.of(p)
        for name, row in rows.items():
            low_high = zip(("value", "low", "high"), row, strict=True)
            numbers = {key: size * float(x) for key, x in low_high}
            parameters[name] = {**numbers, "unit": unit}
    rest = tuple(q for q in found.guess.pieces if q is not piece)
    bare = replace(found.guess, pieces=rest)
    refit = fit(engine, bare, fixed_base=found.fixed_base, iterations=3)
    acts = np.abs(change) > locate.SIGMAS * engine.sigma
    return {
        "effect": law.id,
        "stage": law.stage,
        "form": law.form,
        "probability": round(told.posterior.effects[law.id], 4),
        "parameters": parameters,
        "where": law.where,
        "equivalent": told.posterior.instead(law.id),
        "recordings": [names[r] for r in np.unique(engine.owner[acts])],
        "nrmse_without": _nrmse(told, refit),
    }


def _candidates(told: Judgement) -> list[dict[str, Any]]:
    """The base and every effect tried, alone at its best, the likeliest first."""
    accounts = told.candidates
    out = []
    tried = [(None, told.posterior.nothing), *told.posterior.effects.items()]
    for name, p in tried:
        which = {name} - {None}
        own = [a for a in accounts if a.effects == which] or accounts[:1]
        best = max(own, key=told.log_odds)
        out.append(
            {
                "effect": name,
                "probability": round(p, 4),
                "heldout_nrmse": told.heldout(best).nrmse,
                "evidence": told.log_odds(best),
                "seconds": round(best.seconds, 3),
            }
        )
    return out


def _structure(learned: Learned, axes: Axes) -> dict[str, Any]:
    """What was learned of what no effect explains, a period in the recordings' unit."""
    period, x = learned.period, axes.strain
    if period and period["axis"] == "strain":
        one = {"axis": x.name, "period": period["period"] * x.one, "unit": x.unit}
        period = period | one
    return {
        "depends_on": learned.importance,
        "heldout_ratio": learned.ratio,
        "period": period,
    }
