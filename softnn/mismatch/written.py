"""The content of diagnosis.json, in the units of the recordings.

Figures come first and sentences last: `words` reads nothing but this file, and so does
the report.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from importlib.metadata import version
from platform import python_version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.axes import Axes
from softnn.contracts import Array
from softnn.fit import Fit, Piece, fit
from softnn.mismatch import faults, locate, plan, verify, words
from softnn.mismatch.case import Case
from softnn.mismatch.evidence import changes
from softnn.mismatch.judgement import Judgement
from softnn.mismatch.learn import Learned
from softnn.mismatch.posterior import Tried
from softnn.mismatch.prediction import SINGLE, Candidate
from softnn.plausible import understood
from softnn.recording import data_hash
from softnn.report import where

VERSION = 1


def diagnosis(
    case: Case,
    axes: Axes,
    told: Judgement,
    learned: Learned | None,
    rng: np.random.Generator,
    whole: Case,
) -> dict[str, Any]:
    """Return diagnosis.json, without the stretches that `untaught` adds.

    `case` is the part of the `whole` case that was diagnosed. `axes` give the units.
    `rng` draws the noise for the scan for regions and the bootstrap of the held-out
    error.
    """
    decision, probable = told.decision, told.posterior
    floor = decision.need.floor
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
        "answer": {},
        "recordings": _recordings(whole, told),
        "notes": [*_notes(whole), *told.base.notes],
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
        "classes": [
            {"name": c.name, "members": list(c.members), "probability": c.probability}
            for c in decision.classes
        ],
        "floor": floor and asdict(floor),
        "tolerance": decision.need.tolerance,
        "action": decision.action,
        "ways": [
            {"effects": sorted(s), "probability": round(p, 4)}
            for s, p in probable.ways()
        ],
        "fit": {
            "heldout_by": _heldout_by(told),
            "before": _errors(told, told.before, before),
            "after": _errors(told, told.after, after),
            "heldout_ratio": ratio,
            "heldout_ratio_95": [low, high],
            "noise_nrmse": told.noise_MPa * float(np.sqrt(samples / squares)),
            "residual_correlation": verify.whiteness(told.engine, decision.account.fit),
        },
        "next_recording": None,
        "alternatives": None,
        "candidates": _candidates(told),
        "judged_by": told.judged_by,
        "shows": {
            "few": decision.shows.few,
            "noise": decision.shows.noise,
            "only_loading": decision.shows.only_loading,
        },
        "nearest": _nearest(told),
        "structure": None if learned is None else _structure(learned, axes),
        "software": {
            "Python": python_version(),
            **{name: version(name) for name in ("numpy", "scipy")},
        },
        "axes": {
            "strain": [axes.strain.name, axes.strain.unit],
            "stress": [axes.stress.name, axes.stress.unit],
        },
    }
    result["where"] = where.sentences(
        result["mismatch"], len(case.recordings), axes.strain
    )
    left = plan.alternatives(told, case.history, axes)
    result["alternatives"] = left.to_dict()
    advice = left.plan()
    result["next_recording"] = advice and advice.to_dict()
    for row in result["candidates"]:
        row["why"] = words.reason(row, result)
    result["answer"] = words.answer(result)
    result["summary"] = words.summary(result["answer"])
    return result


def _notes(case: Case) -> list[str]:
    """Return warnings about the input that limit the trust in the answer."""
    out = list(case.notes)
    if len(case.recordings) == 1:
        out.append("One recording: nothing can be checked on another.")
    for r in case.recordings:
        missing = int((~np.isfinite(r.strain) | ~np.isfinite(r.stress_MPa)).sum())
        if missing:
            out.append(f"{r.name}: {missing} of {len(r)} samples miss a value.")
        read = [s for s in r.log if s.name == "read"]
        out += [f"{r.name}: {n}" for s in read for n in s.arguments.get("notes", [])]
    return out


def _recordings(case: Case, told: Judgement) -> list[dict[str, Any]]:
    """Return each recording as it was read, with its error before and after."""
    engine, out = told.fine, []
    for i, r in enumerate(case.recordings):
        rows = engine.owner == i
        out.append(
            {
                "name": r.name,
                "samples": len(r),
                "specimen": case.specimen.get(r.name) or r.specimen,
                "understood": understood(r),
                "source": r.source,
                "nrmse_before": _nrmse(told, told.before, rows),
                "nrmse_after": _nrmse(told, told.after, rows),
            }
        )
    return out


def _heldout_by(told: Judgement) -> str:
    """Return the unit left out in turn: specimen, recording or stretch."""
    base = told.candidates[0]
    if isinstance(base, Candidate):
        return next(f.by for f in base.folds.every if f.by in SINGLE)
    return "recording" if len(told.engine.chunks) > 1 else "stretch"


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
    """Return regions: named effects beyond two sigma, else a misfit beyond noise."""
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


def _nrmse(told: Judgement, one: Fit, rows: NDArray[np.bool] | None = None) -> float:
    """Return the NRMSE of a fit, of all samples or of those in `rows` (valid,)."""
    rows = np.ones(len(told.fine.target), bool) if rows is None else rows
    target, share = told.fine.target[rows], told.fine.share[rows]
    return verify.nrmse_of(share * (target - one.stress[rows]) ** 2, share * target**2)


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
    """Return a named effect with its parameters; `change` (valid,) is its stress."""
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
    on = _where_on(piece, engine.owner[acts])
    mine = np.isin(engine.owner, on) if on else np.ones(len(engine.owner), bool)
    return {
        "effect": law.id,
        "stage": law.stage,
        "form": law.form,
        "probability": round(told.posterior.effects[law.id], 4),
        "parameters": parameters,
        "where": law.where,
        "equivalent": told.posterior.instead(law.id),
        "recordings": [names[r] for r in on],
        "nrmse_without": _nrmse(told, refit),
        "nrmse_own": [_nrmse(told, one, mine) for one in (refit, found)],
    }


def _where_on(piece: Piece, acts: NDArray[np.integer]) -> list[int]:
    """Return the recordings in which an effect is on, or where a shared law acts."""
    if piece.effect.amplitude in piece.effect.per_recording:
        return sorted(faults.on(piece))
    return [int(r) for r in np.unique(acts)]


def _candidates(told: Judgement) -> list[dict[str, Any]]:
    """Return the base and every effect tried, alone at its best, likeliest first.

    `alone`: whether it was tried alone; if not, its figures are those of the base.
    `together`: the best set of this effect and others.
    """
    accounts, known = told.candidates, dict[int, float]()

    def error(one: Tried) -> float:
        if id(one) not in known:
            known[id(one)] = told.heldout(one).nrmse
        return known[id(one)]

    out = []
    tried = [(None, told.posterior.nothing), *told.posterior.effects.items()]
    for name, p in tried:
        which = {name} - {None}
        own = [a for a in accounts if a.effects == which]
        best = max(own or accounts[:1], key=told.log_odds)
        sets = [a for a in accounts if which < a.effects] if name else []
        beside = max(sets, key=told.log_odds, default=None)
        out.append(
            {
                "effect": name,
                "probability": round(p, 4),
                "heldout_nrmse": error(best),
                "evidence": told.log_odds(best),
                "seconds": round(best.seconds, 3),
                "alone": bool(own),
                "together": beside
                and {"effects": sorted(beside.effects), "heldout_nrmse": error(beside)},
            }
        )
    return out


def _nearest(told: Judgement) -> dict[str, Any] | None:
    """Return the likeliest effect fitted alone, and its share of the misfit."""
    for name in told.posterior.effects:
        own = [a.fit.chi2 for a in told.candidates if a.effects == {name}]
        if own:
            old = told.base.fit.chi2
            missed = max(old - len(told.engine.target), 1e-9)
            share = min(max((old - min(own)) / missed, 0.0), 1.0)
            return {"effect": name, "share": share}
    return None


def _structure(learned: Learned, axes: Axes) -> dict[str, Any]:
    """Return what the learned correction depends on; periods in recordings' units."""
    period, x = learned.period, axes.strain
    if period and period["axis"] == "strain":
        one = {"axis": x.name, "period": period["period"] * x.one, "unit": x.unit}
        period = period | one
    return {
        "depends_on": learned.importance,
        "heldout_ratio": learned.ratio,
        "period": period,
    }
