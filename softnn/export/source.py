"""A model as one C99 source and its header."""

from __future__ import annotations

import textwrap

import softnn
from softnn.cards.texts import described, remark
from softnn.export.instance import instance, kernels_for
from softnn.export.parts import Options
from softnn.export.templates_of import fill, template
from softnn.model_file import Stored
from softnn.neural import StoredNetwork


def c_source(
    model: Stored | StoredNetwork, name: str, options: Options | None = None
) -> tuple[str, str]:
    """Header and source of a model; `name` is a C identifier (`identifier`).

    The step takes seconds and engineering strain and gives MPa, as everything here.
    Raises `InputError` for what cannot be stepped and was not left out.
    """
    made = instance(model, name, options or Options())
    functions = "\n".join(made.functions)
    places = {
        "name": name,
        "guard": name.upper(),
        "what": described(model),
        "version": remark(softnn.__version__),
        "types": "\n".join(made.types),
        "functions": functions,
        "kernels": kernels_for(functions),
        "unusable": " || !isfinite(simulated_MPa)" if made.needs_simulated else "",
        "thermal": "degC, NAN where unknown" if made.needs_temperature else "not used",
        "simulated": (
            "what the corrected simulation says" if made.needs_simulated else "not used"
        ),
        "notes": _remarks([*made.notes, *_units(model)]),
    }
    return fill(template("model.h"), places), fill(template("model.c"), places)


def _units(model: Stored | StoredNetwork) -> list[str]:
    """Return the quantities and units of a component."""
    axes = model.axes
    if not axes.component:
        return []
    return [
        f"A component: strain is its {axes.strain.label}, and what a step returns, and "
        f"simulated_MPa, its {axes.stress.label}, not in MPa."
    ]


def _remarks(notes: list[str]) -> str:
    lines = [
        line
        for note in notes or ["Nothing of the model is left out."]
        for line in textwrap.wrap(note, 76)
    ]
    return "".join(f" * {line}\n" for line in lines)


def meanings(
    model: Stored | StoredNetwork, name: str, options: Options | None = None
) -> dict[str, str]:
    """Return the meaning of the inputs beside the strain for this model."""
    made = instance(model, name, options or Options())
    return {
        "thermal": "degC, NAN where unknown" if made.needs_temperature else "not used",
        "simulated": (
            "what the corrected simulation says" if made.needs_simulated else "not used"
        ),
    }
