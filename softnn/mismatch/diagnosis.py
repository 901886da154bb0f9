"""From a case to its diagnosis: verdict, names, regions, held-out errors, as JSON."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from softnn.axes import Axes, common
from softnn.contracts import Array, InputError
from softnn.fit import Engine, Fit, Piece, fit
from softnn.mismatch import locate, own_units, untaught, verify, words
from softnn.mismatch.accounts import Search, search
from softnn.mismatch.base import Baseline, baseline, beyond, given, weigh_by
from softnn.mismatch.case import (
    Case,
    check_case,
    check_model,
    mask_failure,
    mask_gaps,
    thin,
    to_data,
)
from softnn.mismatch.learn import Learned, learn
from softnn.mismatch.model_file import Stored, from_dict, to_dict
from softnn.mismatch.posterior import NAMED, SURE, Posterior, posterior
from softnn.recording import data_hash

if TYPE_CHECKING:
    import pandas as pd

    from softnn.neural import StoredNetwork

VERSION = 1
SEARCH = 1000  # samples a recording while searching
REPORT = 6000  # samples a recording for regions, figures and errors
NEAR = 0.05  # of misfit over noise, a sample, up to which nothing more is seen
HELPS = 1 / 3  # of the held-out error over the noise, that an explanation takes away
FEWEST = 30  # samples in all, below which nothing is told apart
DEFAULT = "pl-wiechert"


@dataclass
class Diagnosis:
    """What was left out, how sure that is, and the corrected model.

    Arrays are lists of one (n,) a recording: time in s, strain, stress in MPa measured
    and simulated before and after the correction. Of a component they are in its own
    units, as `axes` says.
    """

    case: Case
    result: dict[str, Any]  # diagnosis.json
    model_json: dict[str, Any]
    base_json: dict[str, Any]
    time_s: list[Array]
    strain: list[Array]
    measured: list[Array]
    before: list[Array]
    after: list[Array]

    @property
    def axes(self) -> Axes:
        """What strain and stress are here, with their units."""
        return self.case.recordings[0].axes

    @property
    def summary(self) -> str:
        """The answer in a sentence or two, with how sure it is."""
        return str(self.result["summary"])

    @property
    def verdict(self) -> str:
        """explained, partly_explained, unexplained, nothing_missing or undetermined."""
        return str(self.result["verdict"])

    @property
    def selected(self) -> list[str]:
        """Ids of the effects named: those of probability 0.5 or more."""
        return list(self.result["selected"])

    @property
    def probability(self) -> dict[str, float]:
        """Probability of every effect that was tried."""
        rows = self.result["candidates"]
        return {r["effect"]: r["probability"] for r in rows if r["effect"] is not None}

    @property
    def model(self) -> Stored:
        """The corrected model; `model.simulate(recording)` gives its stress."""
        stored = from_dict(self.model_json)
        assert isinstance(stored, Stored)
        return stored

    def to_frame(self) -> pd.DataFrame:
        """The candidates, a row each, the likeliest first."""
        import pandas as pd

        return pd.DataFrame(self.result["candidates"])

    def report(self, path: str | Path) -> Path:
        """Write report.html and its pictures into the folder `path`; the page."""
        from softnn.report import write_report

        Path(path).mkdir(parents=True, exist_ok=True)
        return write_report(self, path)[-1]

    def save(self, folder: str | Path) -> Path:
        """Write diagnosis.json, model.json, base.json and the report into `folder`."""
        from softnn.mismatch.commands import write

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write(target / "model.json", self.model_json)
        write(target / "base.json", self.base_json)
        self.report(target)
        write(target / "diagnosis.json", self.result)  # last: it says all is there
        return target


def diagnose(
    case: Case, model: str | Stored | StoredNetwork | None = None, seed: int = 0
) -> Diagnosis:
    """Diagnose a case with the base `model`.

    None takes the model the case names, else its `simulated_MPa`, else pl-wiechert. A
    stored model is taken as it is, not refitted. Raises `InputError` for recordings
    that cannot be diagnosed.
    """
    # Its products are small: more threads than one take longer.
    with threadpool_limits(limits=1, user_api="blas"):
        return _diagnose(case, model, seed)


def _diagnose(
    case: Case, model: str | Stored | StoredNetwork | None, seed: int
) -> Diagnosis:
    clock = time.perf_counter()
    check_case(case)
    if seed < 0:
        raise InputError(f"seed is {seed}; allowed is a whole number from 0")
    rng = np.random.default_rng(seed)
    chosen = model if model is not None else case.model
    source, whole, never = None, case, list[untaught.Stretch]()
    if chosen is not None and not isinstance(chosen, str):
        source = chosen.source
        case = whole = replace(_simulated_by(case, chosen), model=None)
        if not isinstance(chosen, Stored):  # a network knows what it was shown
            never = untaught.stretches(case, chosen.known)
            case = untaught.taught(case, never)
        chosen = None
    elif chosen is not None:
        check_model(chosen)
    own, (case, axes) = case, own_units.counted(case)
    base = start(case, chosen)
    found = search(base)
    told = Told(found, posterior(found.accounts))
    full = _Full.of(usable(case, REPORT), told)
    learned = None
    if told.verdict == "unexplained":
        learned = learn(base.engine, base.fit, rng)
    result = _result(own, axes, told, full, learned, rng)
    untaught.tell(result, whole, never)
    result["seconds"] = round(time.perf_counter() - clock, 3)
    names = [r.name for r in case.recordings]
    corrected = full.after if told.names else full.before
    extra = learned.to_dict() if learned is not None and not told.names else None

    def stored(one: Fit, extra: Mapping[str, Any] | None = None) -> dict[str, Any]:
        model = to_dict(one.guess, names, case.history, base.fixed, extra, source)
        return own_units.labelled(model, axes)

    x, y, engine = axes.strain.one, axes.stress.one, full.engine
    after, before = stored(corrected, extra), stored(full.before)
    if never:
        return _of_whole(whole, result, after, before)
    return Diagnosis(
        own,
        result,
        after,
        before,
        [c.time_s for c in engine.data.chunks],
        own_units.back([c.strain for c in engine.data.chunks], x),
        own_units.back(list(engine.data.stress_MPa), y),
        own_units.back(engine.by_recording(full.before.stress), y),
        own_units.back(engine.by_recording(corrected.stress), y),
    )


def _of_whole(
    case: Case, result: dict[str, Any], after: dict[str, Any], before: dict[str, Any]
) -> Diagnosis:
    """A diagnosis made on part of a case, shown on all of it."""
    data = to_data(usable(case, REPORT))

    def stress(model: dict[str, Any]) -> list[Array]:
        given_ = list(data.simulated_MPa or [None] * len(data.chunks))
        return from_dict(model).stress(data.names, data.chunks, given_)

    return Diagnosis(
        case,
        result,
        after,
        before,
        [c.time_s for c in data.chunks],
        [c.strain for c in data.chunks],
        list(data.stress_MPa),
        stress(before),
        stress(after),
    )


def usable(case: Case, samples: int) -> Case:
    """What can be used of a case, at most about so many samples a recording."""
    return thin(mask_failure(mask_gaps(case)), samples)


def start(case: Case, model: str | None = None) -> Baseline:
    """The base of a case at its best: what a search starts from."""
    data, fine = to_data(usable(case, SEARCH)), to_data(usable(case, REPORT))
    if sum(int(np.isfinite(s).sum()) for s in data.stress_MPa) < 4:
        raise InputError(f"{case.name}: fewer than four stresses in all; record more")
    model = model or (case.model if isinstance(case.model, str) else None)
    if data.simulated_MPa is not None and model is None:
        return given(data, data.simulated_MPa, case.groups(), fine)
    return baseline(data, model or DEFAULT, case.groups(), fine)


def _simulated_by(case: Case, stored: Stored | StoredNetwork) -> Case:
    """The case with the stress of a stored model as its simulation."""
    common({"the model": stored.axes} | {r.name: r.axes for r in case.recordings})
    data = to_data(case)
    given_ = data.simulated_MPa or [None] * len(data.chunks)
    stress = stored.stress(
        data.names, data.chunks, list(given_), case.history == "continued"
    )
    return replace(case, simulated_MPa=tuple(stress))


class Told:
    """What is said of a search: verdict and names, and the account they stand on."""

    def __init__(self, found: Search, probable: Posterior) -> None:
        self.found, self.probable = found, probable
        self.base, self.engine = found.base, found.base.engine
        self.account = probable.best
        self.final = self.account.fit
        self.before = verify.heldout(self.engine, self.base.fit)
        self.after = verify.heldout(self.engine, self.final)
        self.squares = float(np.sum(self.engine.target**2))
        self.floor = float(np.sqrt(np.sum(self.engine.sigma**2) / self.squares))
        self.names = self._names()
        self.verdict = self._verdict()

    def _names(self) -> list[str]:
        """The selected effects in the order in which they act, if they may be named."""
        if self.account.effects != self.probable.selected or not self.tellable:
            return []
        pieces = self.final.guess.pieces
        names = [p.effect.id for p in pieces if not p.nuisance]
        return names if names and self.helps else []

    @property
    def few(self) -> bool:
        """Whether there are too few samples to tell anything apart."""
        return len(self.engine.target) < FEWEST

    @property
    def tellable(self) -> bool:
        """Whether these recordings can show what was selected.

        On first loading most physics looks alike: softening, set and friction are a
        spring there. What a rig or a channel does can still be told.
        """
        if self.few:
            return False
        pieces = [p for p in self.final.guess.pieces if not p.nuisance]
        material = any(p.effect.stage == "material" for p in pieces)
        return not (material and locate.only_loading(self.engine))

    @property
    def helps(self) -> bool:
        """Whether recordings left out are foretold better, by more than a little.

        Where their error is the noise, there is nothing that could be taken from it.
        """
        old, new = self.before[0].sum(), self.after[0].sum()
        least = float(np.sum(self.engine.sigma**2))
        over = old - least
        return bool(over < NEAR * least or old - new > HELPS * over)

    @property
    def left(self) -> float:
        """Misfit over noise, a sample, that the account leaves."""
        return self.final.chi2 / len(self.engine.target) - 1

    def _verdict(self) -> str:
        probable = self.probable
        if self.few:
            return "undetermined"
        if self.names:
            least = min(probable.effects[n] for n in self.names)
            if least < SURE:
                return "undetermined"
            beside = probable.other > NAMED or self.left > NEAR
            return "partly_explained" if beside else "explained"
        if probable.nothing >= NAMED:
            return "nothing_missing"
        if probable.nothing_named >= NAMED:
            return "unexplained"
        return (
            "undetermined"
            if self.tellable and not probable.selected
            else ("unexplained" if self.tellable else "undetermined")
        )


@dataclass
class _Full:
    """The two simulations at the resolution of the report."""

    engine: Engine
    before: Fit
    after: Fit

    @classmethod
    def of(cls, case: Case, told: Told) -> _Full:
        base = told.base
        data = to_data(case)
        engine = Engine(data)
        if base.fixed and data.simulated_MPa is not None:
            engine = beyond(data, data.simulated_MPa, base.fit.guess)
        weigh_by(engine, told.found.noise)
        before = fit(engine, base.fit.guess, fixed_base=base.fixed, iterations=2)
        after = fit(engine, told.final.guess, fixed_base=base.fixed, iterations=3)
        return cls(engine, before, after)

    def nrmse(self, one: Fit) -> float:
        miss = self.engine.target - one.stress
        return float(np.sqrt(np.sum(miss**2) / np.sum(self.engine.target**2)))


# --- what is written ------------------------------------------------------------------


def _result(
    case: Case,
    axes: Axes,
    told: Told,
    full: _Full,
    learned: Learned | None,
    rng: np.random.Generator,
) -> dict[str, Any]:
    names, probable = told.names, told.probable
    after, left = (told.after, full.after) if names else (told.before, full.before)
    ratio, low, high = verify.ratio_interval(told.before[0], after[0], rng)
    result: dict[str, Any] = {
        "case": case.name,
        "data_sha256": data_hash(case.recordings),
        "model": told.base.name,
        "version": VERSION,
        "verdict": told.verdict,
        "summary": "",
        "selected": names,
        "noise": _noise(told),
        "mismatch": _regions(told, full, rng),
        "explanations": [
            _explanation(told, full, i, piece)
            for i, piece in enumerate(full.after.guess.pieces)
            if not piece.nuisance and piece.effect.id in names
        ],
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
            "before": {
                "nrmse": full.nrmse(full.before),
                "heldout_nrmse": verify.nrmse_of(*told.before),
            },
            "after": {
                "nrmse": full.nrmse(left),
                "heldout_nrmse": verify.nrmse_of(*after),
            },
            "heldout_ratio": ratio,
            "heldout_ratio_95": [low, high],
            "noise_nrmse": told.floor,
            "residual_correlation": verify.whiteness(
                told.engine, told.final if names else told.base.fit
            ),
        },
        "next_recording": words.next_recording(told),
        "candidates": _candidates(told),
        "structure": None
        if learned is None
        else {
            "depends_on": learned.importance,
            "heldout_ratio": learned.ratio,
            "period": learned.period,
        },
    }
    own_units.tell(result, axes)
    result["summary"] = words.summary(result, told)
    return result


def _noise(told: Told) -> dict[str, Any]:
    noise = told.found.noise
    return {
        "sigma_MPa": float(np.sqrt(np.mean(told.engine.sigma**2))),
        "correlation_time_s": float(np.median([n.correlation_s for n in noise])),
        "share_of_stress": float(np.median([n.share for n in noise])),
        "step_MPa": float(max(n.step_MPa for n in noise)),
    }


def _regions(told: Told, full: _Full, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Where named effects act beyond two sigma; else where noise does not explain."""
    engine = full.engine
    if told.names:
        moved = locate.action(engine, full.after)
        mask = np.abs(moved) > locate.SIGMAS * engine.sigma
        return locate.regions(engine, mask, moved**2, moved)
    if told.verdict == "nothing_missing":
        return []
    miss = engine.target - full.before.stress
    mask, _, _ = locate.scan(engine, full.before, rng)
    return locate.regions(engine, mask, miss**2, miss)


def _explanation(told: Told, full: _Full, index: int, piece: Piece) -> dict[str, Any]:
    law, engine = piece.effect, full.engine
    limits = verify.intervals(full.after)
    parameters: dict[str, Any] = {}

    def write(name: str, value: float, low: float, high: float, unit: str) -> None:
        numbers = {"value": float(value), "low": float(low), "high": float(high)}
        parameters[name] = numbers | {"unit": unit}

    for p in law.parameters:
        value = piece.values[p.name]
        if not np.ndim(value):
            ends = verify.profiled(engine, full.after, index, p.name, limits)
            write(p.name, value, *ends, p.unit)
            continue
        for group in piece.groups:
            ends = limits.get((index, p.name, group), (np.nan, np.nan))
            for r in group:
                name = f"{p.name} of {engine.data.names[r]}"
                write(name, value[r], *ends, p.unit)
    rest = tuple(q for q in full.after.guess.pieces if q is not piece)
    bare = replace(full.after.guess, pieces=rest)
    acts = np.abs(full.after.stress - engine.run(bare, False)[0]) > 2 * engine.sigma
    refit = fit(engine, bare, fixed_base=full.after.fixed_base, iterations=3)
    return {
        "effect": law.id,
        "stage": law.stage,
        "form": law.form,
        "probability": round(told.probable.effects[law.id], 4),
        "parameters": parameters,
        "where": law.where,
        "equivalent": told.probable.instead(law.id),
        "recordings": [
            name
            for r, name in enumerate(engine.data.names)
            if acts[engine.owner == r].any()
        ],
        "nrmse_without": full.nrmse(refit),
    }


def _candidates(told: Told) -> list[dict[str, Any]]:
    """The base and every effect tried, alone at its best, the likeliest first."""
    accounts = told.found.accounts
    top = accounts[0].evidence.alone

    def row(name: str | None, probability: float) -> dict[str, Any]:
        which = frozenset() if name is None else frozenset([name])
        own = [a for a in accounts if a.effects == which]
        best = max(own, key=lambda a: a.evidence.alone, default=accounts[0])
        return {
            "effect": name,
            "probability": round(probability, 4),
            "heldout_nrmse": verify.nrmse_of(*verify.heldout(told.engine, best.fit)),
            "evidence": float(best.evidence.alone - top),
            "seconds": round(best.seconds, 3),
        }

    rows = [row(name, p) for name, p in told.probable.effects.items()]
    return [row(None, told.probable.nothing), *rows]
