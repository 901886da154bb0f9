"""A material card as the simulation: as it stands or refitted, and written back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn.cards.given import Given
from softnn.cards.loss import MOST, loss
from softnn.cards.read import with_unit
from softnn.cards.written import WRITERS, card
from softnn.contracts import InputError
from softnn.fit import Engine, Guess, fit
from softnn.mismatch.base import (
    COARSE,
    REPORT,
    SEARCH,
    Baseline,
    nuisance,
    start,
    usable,
    weigh,
)
from softnn.mismatch.case import Case, to_data
from softnn.mismatch.verify import nrmse_of
from softnn.model_file import Stored
from softnn.models.bergstrom_boyce import BergstromBoyce
from softnn.models.hyperelastic import Hyper


@dataclass(frozen=True)
class OwnCard:
    """A card with the unit of its stresses, and its model in MPa.

    `nrmse` is its error on all recordings, with nothing fitted.
    """

    given: Given
    model: Stored
    nrmse: float

    @property
    def simulates(self) -> bool:
        """Whether it takes part as a stress alone: nothing else can hold its damage."""
        return self.given.mullins is not None and not self.given.refit


def own_card(case: Case, given: Given) -> OwnCard:
    """Return a card as the simulation of a case. Raises `InputError` without a unit."""
    strain, stress = (
        np.concatenate([getattr(r, x) for r in case.recordings])
        for x in ("strain", "stress_MPa")
    )
    if case.recordings[0].axes.component:
        raise InputError(
            "a material card needs strains, and these are deflections: give --length "
            "and --area"
        )
    given = with_unit(given, strain, stress)
    reach = min(float(np.nanmin(strain)), 0.0), max(float(np.nanmax(strain)), 0.0)
    model = given.stored(given.unit, reach)
    data = to_data(usable(case, REPORT))
    found = model.stress(data.names, data.chunks, [None] * len(data.chunks))
    error, measured = np.concatenate(found), np.concatenate(data.stress_MPa)
    good = np.isfinite(measured)
    off = nrmse_of((error - measured)[good] ** 2, measured[good] ** 2)
    return OwnCard(given, model, off)


def started(case: Case, own: OwnCard, one: float) -> Baseline:
    """Return the card as a base: its law and its series, fixed or refitted.

    `one` is the stress in MPa that counts as 1 in the case.
    """
    units = own.model.units
    assert isinstance(units, Hyper | BergstromBoyce)
    if own.given.refit:
        return start(case, units)
    data, fine, few = (to_data(usable(case, n)) for n in (SEARCH, REPORT, COARSE))
    engine = Engine(data, fine=Engine(fine))
    stiffness, pieces = own.model.stiffness / one, nuisance(data, case.groups())
    found = fit(
        engine, Guess(replace(units, fixed=True), stiffness, pieces), fixed_base=True
    )
    for _ in range(2):
        noise = weigh(engine, found)
        found = fit(engine, found.guess, fixed_base=True)
    said, less = bool(case.specimen) or case.history == "continued", Engine(few)
    notes = units.remarks()
    return Baseline(engine, found, noise, units.name, True, said, less, notes)


def answer(
    own: OwnCard, case: Case, model: Stored, result: Mapping[str, Any]
) -> tuple[dict[str, Any], str | None]:
    """Return what diagnosis.json says of the card, and the corrected card to write.

    `model` is the corrected model. There is no card (None) where it corrects a stress
    alone, or where the code lacks the law. `not_carried` are effects of the material
    that no card holds, with what the stress changes without them.
    """
    given, fits = own.given, result["fit"]
    before, after = (fits[k]["heldout_nrmse"] for k in ("before", "after"))
    by = [_word(name) for name in result["corrected_by"]]
    said = f"Your {given.said} predicts these recordings to {_percent(own.nrmse)}"
    if given.refit:
        said += f"; refitted, those left out to {_percent(before)}"
    if by:
        several = " and ".join(filter(None, [", ".join(by[:-1]), by[-1]]))
        said += f"; with {several}, those left out to {_percent(after)}"
    written, text, why, off, lost = None, None, None, None, list[dict[str, Any]]()
    try:
        made = card(model)
        # Without their names: a card has the scale of a new specimen.
        found = loss(model, made, [replace(r, name="") for r in case.recordings])
        text = WRITERS[given.dialect][1](model, "corrected")
        written = f"card{WRITERS[given.dialect][0]}"
        off = found.whole
        lost = [{"effect": name, "costs": x} for name, x in found.of]
        said += f". The corrected card is {written}"
        if off > MOST:
            said += f", but its stress is {_percent(off)} off the corrected model's"
        if lost:
            each = (
                f"{x['effect'].replace('_', ' ')} ({_percent(x['costs'])})"
                for x in lost
            )
            said += f"; no card carries {', '.join(each)}"
    except InputError as error:
        why = str(error)
        if own.simulates:
            why = "its Mullins effect is kept as it is; --refit writes a corrected card"
        said += f". No corrected card: {why}"
    return {
        "summary": f"{said}.",
        "said": given.said,
        "material": given.name,
        "dialect": given.dialect,
        "unit": given.unit,
        "refitted": given.refit,
        "nrmse": own.nrmse,
        "refitted_heldout_nrmse": before if given.refit else None,
        "corrected_heldout_nrmse": after if by else None,
        "file": written,
        "why_not": why,
        "off": off,
        "not_carried": lost,
        "notes": list(given.notes),
    }, text


def notes(own: OwnCard) -> list[str]:
    """Return what reading the card inferred, or passed over."""
    return [f"card: {note}" for note in own.given.notes]


def _word(effect: str) -> str:
    return effect.replace("_", " ").replace("mullins", "Mullins")


def _percent(x: float) -> str:
    return f"{100 * x:.2g} %"
