"""From a case to its diagnosis: all steps, and the result."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from softnn import glance, progress
from softnn.axes import Axes, common
from softnn.cards.given import Given
from softnn.contracts import Array, InputError
from softnn.fit import Fit
from softnn.mismatch import base, families, plan, untaught, written
from softnn.mismatch.base import Baseline, beyond, usable
from softnn.mismatch.case import Case, check_case, in_order, to_data
from softnn.mismatch.decision import TOLERANCE
from softnn.mismatch.judgement import judge
from softnn.mismatch.learn import learn
from softnn.mismatch.own_card import OwnCard, answer, notes, own_card, started
from softnn.mismatch.plan import Plan
from softnn.model_file import Correction, Stored, from_dict, in_units, to_dict
from softnn.models import bergstrom_boyce, hyperelastic
from softnn.models.bases import check
from softnn.recording import Recording

if TYPE_CHECKING:
    import pandas as pd

    from softnn.neural import StoredNetwork


@dataclass(repr=False)
class Diagnosis:
    """The answer: effects that were left out, how sure that is, the corrected model.

    Arrays are lists of one (n,) for each recording: time in s, strain, and stress in
    MPa, measured and simulated before and after the correction. Stresses and strains of
    a component are in its own units, which `axes` gives.
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
    card: str | None = None  # the corrected card, where a card came in

    def __repr__(self) -> str:
        count = len(self.case.recordings)
        return (
            f"<Diagnosis of {self.case.name!r}, {count} "
            f"recording{'s'[: count != 1]}: {self.summary}>"
        )

    def _repr_html_(self) -> str:
        every = list(
            zip(self.strain, self.measured, self.before, self.after, strict=True)
        )
        x, measured, before, after = max(every, key=lambda e: float(np.ptp(e[0])))
        drawn = glance.svg([(x, measured), (x, before), (x, after)])
        return (
            f"<figure style='margin:0'><figcaption><b>{escape(self.case.name)}</b>: "
            f"{escape(self.summary)}</figcaption>{drawn}<div><small>measured (blue), "
            "simulated before (red) and after correction (green)</small></div></figure>"
        )

    @property
    def axes(self) -> Axes:
        """The quantities and units of strain and stress in this case."""
        return self.case.recordings[0].axes

    @property
    def summary(self) -> str:
        """The answer in a sentence or two, with its probability."""
        return str(self.result["summary"])

    @property
    def verdict(self) -> str:
        """One of the verdicts of `softnn.mismatch.decision.TABLE`."""
        return str(self.result["verdict"])

    @property
    def selected(self) -> list[str]:
        """Ids of the effects named: those with a probability of 0.5 or more."""
        return list(self.result["selected"])

    @property
    def probability(self) -> dict[str, float]:
        """Probability of every effect that was tried, by its id."""
        rows = self.result["candidates"]
        return {r["effect"]: r["probability"] for r in rows if r["effect"] is not None}

    @property
    def model(self) -> Stored:
        """The corrected model; `model.simulate(recording)` gives its stress."""
        stored = from_dict(self.model_json)
        assert isinstance(stored, Stored)
        return stored

    def next_recording(
        self,
        minutes: float | None = None,
        max_strain: float | None = None,
        max_rate: float | None = None,
    ) -> Plan | None:
        """Return the recording that separates the models left; None if one is left.

        Its `time_s` and `strain` are the programme, in the units of `axes`. `minutes`,
        `max_strain` and `max_rate` (1/s) limit it; None takes what was recorded so far.
        Raises `InputError` if nothing fits into the limits.
        """
        left = plan.Alternatives.from_dict(self.result["alternatives"])
        return left.plan(plan.Limits(minutes, max_strain, max_rate))

    def to_frame(self) -> pd.DataFrame:
        """Return a table of the candidates, a row each, the likeliest first."""
        import pandas as pd

        return pd.DataFrame(self.result["candidates"])

    def report(self, path: str | Path) -> Path:
        """Write report.html and its pictures into the folder `path`; return it."""
        from softnn.report import write_report

        Path(path).mkdir(parents=True, exist_ok=True)
        return write_report(self, path)[-1]

    def save(self, folder: str | Path) -> Path:
        """Write diagnosis.json, model.json, base.json and the report into `folder`.

        next_recording.csv is the programme to record next, if there is one. Where a
        material card was corrected, it is there too.
        """
        from softnn.json_file import write, write_text

        progress.stage("writing")
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        # Write into a temporary folder first: a full disk spoils no earlier result.
        with tempfile.TemporaryDirectory(prefix=".new-", dir=target) as new:
            aside = Path(new)
            write(aside / "model.json", self.model_json)
            write(aside / "base.json", self.base_json)
            self.report(aside)
            files = ["model.json", "base.json", "report.html"]
            if self.card is not None:
                files.append(self.result["card"]["file"])
                write_text(aside / files[-1], self.card)
            write(aside / "diagnosis.json", self.result)
            if plan.write(self.next_recording(), aside) is None:
                (target / plan.FILE).unlink(missing_ok=True)  # of an earlier diagnosis
            for file in (*files, plan.FILE, plan.DONE):  # diagnosis.json last
                if (aside / file).exists():
                    (aside / file).replace(target / file)
        return target


def diagnose(
    case: Case,
    model: str | Stored | StoredNetwork | Given | None = None,
    seed: int = 0,
    tolerance: float = TOLERANCE,
) -> Diagnosis:
    """Diagnose a case with the base `model`; return a `Diagnosis`.

    None takes the model that the case names, else its `simulated_MPa`, else
    pl-wiechert. A stored model stays as it is, without a refit; so does a material card
    unless it says `refit`. `tolerance` is the error of prediction, a fraction, that is
    good enough. Raises `InputError` for recordings that cannot be diagnosed.
    """
    # The matrices are small: with several threads the products take longer.
    with threadpool_limits(limits=1, user_api="blas"):
        return _diagnose(case, model, seed, tolerance)


def _diagnose(
    case: Case,
    model: str | Stored | StoredNetwork | Given | None,
    seed: int,
    tolerance: float,
) -> Diagnosis:
    clock = time.perf_counter()
    progress.stage("diagnosing")
    check_case(case)
    case = in_order(case)
    if seed < 0:
        raise InputError(f"seed is {seed}; allowed is a whole number from 0")
    if not 0 < tolerance < 1:
        raise InputError(
            f"tolerance is {tolerance:g}; allowed is a fraction above 0 and below 1, "
            "as 0.02 for 2 %"
        )
    rng = np.random.default_rng(seed)
    model = case.model if model is None else model
    source, never = None, list[untaught.Stretch]()
    own = None
    if isinstance(model, Given):
        own = own_card(case, model)
        case = replace(case, notes=(*case.notes, *notes(own)))
        model = own.model if own.simulates else None
    if isinstance(model, str):
        if model != families.AUTO:
            check(model)
    elif model is not None:
        source = model.source
        case = replace(_simulated_by(case, model), model=None)
        if not isinstance(model, Stored):  # a network knows the range of its training
            never = untaught.stretches(case, model.known)
        model = None
    whole, case = case, untaught.taught(case, never)
    axes = _axes(case)
    given = None if own is None or own.simulates else own
    base_ = _start(counted(case, axes), model, axes, given)
    told = judge(base_, tolerance)
    progress.part("the result", 0)
    learned = None
    if told.verdict == "unexplained":
        learned = learn(told.engine, told.decision.account.fit, rng)
    result = written.diagnosis(case, axes, told, learned, rng, whole)
    untaught.tell(result, whole, never)
    result["seconds"] = round(time.perf_counter() - clock, 3)

    shown = told.fine
    if never:  # the diagnosed part of the case
        data = to_data(usable(counted(whole, axes), base.REPORT))
        shown = beyond(data, data.simulated_MPa or (), told.before.guess)
    names, fixed = shown.data.names, shown.remainder is not None

    def stored(one: Fit, extra: Correction | None = None) -> dict[str, Any]:
        guess, own = in_units(one.guess, axes)
        if extra is not None and own is not axes:
            extra = extra.with_stress(axes.stress.one)
        return to_dict(guess, names, case.history, fixed, extra, source, own)

    def stress(one: Fit) -> list[Array]:
        found = shown.by_recording(shown.run(one.guess, False)[0])
        return [s * axes.stress.one for s in found]

    corrected = stored(told.after, None if learned is None else learned.correction)
    text = None
    if own is not None:
        corrected_model = from_dict(corrected)
        assert isinstance(corrected_model, Stored)
        result["card"], text = answer(own, whole, corrected_model, result)
        result["notes"].insert(0, result["card"]["summary"])
    return Diagnosis(
        whole,
        result,
        corrected,
        stored(told.before),
        [c.time_s for c in shown.data.chunks],
        [c.strain * axes.strain.one for c in shown.data.chunks],
        [s * axes.stress.one for s in shown.data.stress_MPa],
        stress(told.before),
        stress(told.after),
        text,
    )


def _start(case: Case, model: str | None, axes: Axes, own: OwnCard | None) -> Baseline:
    """Return the best fit of the base; strains of a component are deflections."""
    if own is not None:
        return started(case, own, axes.stress.one)
    if model == families.AUTO:
        return families.chosen(case, axes.component)
    if (
        axes.component
        and model is not None
        and model.split(":")[0] in (*hyperelastic.NAMES, bergstrom_boyce.NAME)
    ):
        raise InputError(
            f"model is {model!r}; a hyperelastic law needs strains, and these are "
            "deflections: give --length and --area, or take --model pl-wiechert"
        )
    return base.start(case, model)


def _simulated_by(case: Case, stored: Stored | StoredNetwork) -> Case:
    """Return the case with the stress of a stored model as its simulation."""
    common({"the model": stored.axes} | {r.name: r.axes for r in case.recordings})
    data = to_data(case)
    given_ = data.simulated_MPa or [None] * len(data.chunks)
    stress = stored.stress(
        data.names, data.chunks, list(given_), case.history == "continued"
    )
    return replace(case, simulated_MPa=tuple(stress))


def _axes(case: Case) -> Axes:
    """Return the axes of a case, with what counts as 1 in fits.

    That is the largest stress of specimens, so no answer depends on the unit of stress;
    and round numbers of the units of a component.
    """
    axes = common({r.name: r.axes for r in case.recordings})
    if not axes.component:
        every = [np.nanmax(np.abs(r.stress_MPa), initial=0.0) for r in case.recordings]
        largest = float(max(every)) or 1.0
        return replace(axes, stress=replace(axes.stress, one=largest))
    strain = max(float(np.nanmax(np.abs(r.strain))) for r in case.recordings)
    stress = max(float(np.nanmax(np.abs(r.stress_MPa))) for r in case.recordings)
    return axes.counted(strain, stress)


def counted(case: Case, axes: Axes) -> Case:
    """Return the case with its channels rescaled to strain and MPa by these axes."""
    x, y = axes.strain.one, axes.stress.one

    def one(r: Recording) -> Recording:
        return replace(r, strain=r.strain / x, stress_MPa=r.stress_MPa / y)

    simulated = tuple(s / y for s in case.simulated_MPa or ()) or None
    recordings = tuple(map(one, case.recordings))
    return replace(case, recordings=recordings, simulated_MPa=simulated)
