"""`--model auto`: the family of bases that predicts recordings left out best."""

from __future__ import annotations

from dataclasses import replace

from softnn import progress
from softnn.fit import fit
from softnn.mismatch.base import DEFAULT, Baseline, start
from softnn.mismatch.case import Case
from softnn.mismatch.prediction import Candidate, Judge, alike
from softnn.models import bergstrom_boyce, hyperelastic

AUTO = "auto"
# Three terms of Ogden's law have more freedom than tests in one mode can settle.
TRIED = (
    DEFAULT,
    *(f"{law}{hyperelastic.PRONY}" for law in hyperelastic.LAWS if law != "ogden3"),
    bergstrom_boyce.NAME,
)


REFITTED = 3  # families whose errors come from refits; of the others one step does


def chosen(case: Case, component: bool) -> Baseline:
    """Return the base that predicts best, with the errors of all in its notes.

    `component`: deflections are no strains, so laws of large strain take no part.
    """
    names = (DEFAULT,) if component else TRIED
    progress.part("families of bases", len(names))
    found = []
    for name in names:
        found.append((name, *judged(start(case, name))))
        progress.piece()
    found.sort(key=lambda one: one[2].score)
    best = [(n, judge.judged(c.fit, refit=True)) for n, judge, c in found[:REFITTED]]
    best.sort(key=lambda one: one[1].score)
    rows = best + [(n, c) for n, _, c in found[REFITTED:]]
    said = ", ".join(f"{n} {100 * c.heldout.nrmse:.2g} %" for n, c in rows)
    base = start(case, rows[0][0])
    note = f"{AUTO} takes {rows[0][0]}. Errors on what was left out: {said}."
    return replace(base, notes=(note, *base.notes))


def judged(base: Baseline) -> tuple[Judge, Candidate]:
    """Return the judge of a base and its error, with samples weighed as in an error."""
    engine = alike(base.engine)
    found = fit(engine, base.fit.guess)
    judge = Judge(engine, found.guess)
    return judge, judge.judged(found)
