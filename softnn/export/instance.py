"""One model as C: its types, its functions, and the step that joins them.

`Instance` knows a corrected model (`Stored`) and a network (`StoredNetwork`). A model
that corrects another one holds an instance of it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.effects.friction_hysteresis import BoucWen, FrictionHysteresis
from softnn.effects.relaxation_branch import TIMES_S, SpreadBranch
from softnn.export.network import network
from softnn.export.parts import DEEPEST, UNSTEPPED, Instance, Options, struct_of
from softnn.export.templates_of import FOLDER, blocks, fill, indented, literal
from softnn.model_file import Stored
from softnn.neural import StoredNetwork
from softnn.neural.guard import SLACK


def instance(
    model: Stored | StoredNetwork, name: str, options: Options, number: int = 0
) -> Instance:
    """The C of a model and of those it holds; `InputError` for what has none."""
    if number > DEEPEST:
        raise InputError(f"more than {DEEPEST} models that correct one another")
    prefix = f"{name}_m{number}"
    if isinstance(model, StoredNetwork):
        return network(model, name, prefix, options)
    return _corrected(model, name, prefix, options, number)


# -- corrected models ------------------------------------------------------------------


def _corrected(
    model: Stored, name: str, prefix: str, options: Options, number: int
) -> Instance:
    out = Instance(prefix)
    if model.learned is not None:
        _unless_left_out("learned", options, out)
    members: list[str] = []
    low, high = model.units.reach
    slack = SLACK * (high - low)
    places: dict[str, Any] = {
        "p": prefix,
        "springs": f"{prefix}_springs(e)",
        "branches": "0.0",
        "guard": name.upper(),
        "lowest": low - slack,
        "highest": high + slack,
    }
    base, segments = blocks("base.c"), model.units.segments
    family, filled = model.units.in_c(model.stiffness)
    family += " " if family else ""
    out.functions.append(fill(base[f"{family}springs"], filled | {"p": prefix}))
    used = np.flatnonzero(model.stiffness[segments:])
    if len(used):
        filled |= {
            "p": prefix,
            "n": len(used),
            "times": np.array(model.units.relaxation_times)[used],
            "stiffness": model.stiffness[segments:][used],
        }
        out.types.append(fill(base[f"{family}branches_type"], filled))
        out.functions.append(fill(base[f"{family}branches"], filled))
        members.append(f"{prefix}_branches_t fitted;")
        places["branches"] = f"{prefix}_branches(&s->fitted, lapse, b)"
    steps, own = _effects(model, options, out, places["branches"] != "0.0")
    members += own
    correct, (enter, result) = "", _own_units(model)
    if model.needs_simulated:
        given = "simulated_MPa"
        if model.simulation is not None:
            inner = instance(model.simulation, name, options, number + 1)
            out.types[:0], out.functions[:0] = inner.types, inner.functions
            out.notes += inner.notes
            out.needs_simulated = inner.needs_simulated
            out.needs_temperature |= inner.needs_temperature
            out.is_network = inner.is_network
            members.append(f"{inner.prefix}_t simulation;")
            given = (
                f"{inner.prefix}_step(&s->simulation, first, dt, t, "
                f"{'own' if enter else 'strain'}, temperature_C,\n"
                "        simulated_MPa, flags)"
            )
        else:
            out.needs_simulated = True
        # The given simulation replaces the stress of the base without effects.
        if enter:
            given += f" / {literal(model.axes.stress.one)}"
        correct = f"    y += {given};\n    y -= {prefix}_springs(strain);\n"
        if len(used):
            members.append(f"{prefix}_branches_t plain;")
            correct += f"    y -= {prefix}_branches(&s->plain, dt, strain);\n"
    out.types.append(struct_of(prefix, members))
    out.functions.append(
        fill(
            blocks("step.c")["corrected"],
            places | steps | {"correct": correct, "enter": enter, "result": result},
        )
    )
    return out


def _own_units(model: Stored) -> tuple[str, str]:
    """Return C that converts a component's deflection and stress between units."""
    axes = model.axes
    if not axes.component:
        return "", "y"
    enter = "    const double own = strain;\n    (void)own;\n"
    enter += f"    strain /= {literal(axes.strain.one)};\n"
    return enter, f"y * {literal(axes.stress.one)}"


def _unless_left_out(what: str, options: Options, out: Instance) -> None:
    if what not in options.leave_out:
        raise InputError(
            f"{what} cannot be stepped: {UNSTEPPED[what]}; --leave-out {what} "
            "exports the rest"
        )
    out.notes.append(f"Left out: {what}.")


def _effects(
    model: Stored, options: Options, out: Instance, branches: bool
) -> tuple[dict[str, str], list[str]]:
    """C of all effects by place, in the order in which `simulate` applies them.

    `branches`: whether the model has any; else what acts on them does nothing.
    """
    steps = {"before": "", "after": "", "sensor": ""}
    members = []
    order = [
        (s, i, piece)
        for s in ("rig", "material", "sensor")
        for i, piece in enumerate(model.pieces)
        if piece.effect.stage == s
    ]
    # Hooks before the model go by stage; behind it rig and material as they are listed.
    after = sorted(order, key=lambda entry: (entry[0] == "sensor", entry[1]))
    for kind, entries in (("before", order), ("after", after)):
        for stage, i, piece in entries:
            law = piece.effect
            if "causal" in law.exempt:
                if kind == "before":
                    _unless_left_out(law.id, options, out)
                continue
            text = _template(law.id, law.form)
            if not branches and "{p}_branches" in "".join(
                text.get(f"{law.form} {part}", "") for part in ("state", "after")
            ):
                continue
            places = _places(model, i, options) | {"p": out.prefix}
            body = text.get(f"{law.form} {kind}")
            if kind == "before" and (state := text.get(f"{law.form} state")):
                members.append(f"struct {{ {fill(state, places).strip()} }} e{i};")
            if body is None:
                continue
            body = fill(body, places).replace("q->", f"s->e{i}.")
            place = "sensor" if stage == "sensor" else kind
            steps[place] += indented(f"/* {law.id} */\n{body}")
            out.needs_temperature |= law.needs_temperature
    return steps, members


def _template(id: str, form: str) -> dict[str, str]:
    file = f"effects/{id}.c"
    found = blocks(file) if (FOLDER / file).is_file() else {}
    if not any(k.split()[0] == form for k in found):
        raise InputError(f"no C is written for {id} ({form}); add it to {file}")
    return found


def _places(model: Stored, i: int, options: Options) -> dict[str, Any]:
    """Values of an effect, and what its template needs besides."""
    law, own = model.pieces[i].effect, model.own[i]
    values: dict[str, Any] = dict(model.pieces[i].values)
    for key in law.per_recording:  # as `Stored.stress` takes them
        known = own.get(key, {})
        values[key] = known.get(options.recording or "", values[key])
    law.prepare(values)
    if isinstance(law, FrictionHysteresis) and not isinstance(law, BoucWen):
        # Elements that slide one after the other.
        radius, weight = law.elements({k: np.array([v]) for k, v in values.items()})
        values |= {"elements": radius.size, "radius": radius[0], "weight": weight[0]}
    if isinstance(law, SpreadBranch):
        parts = law.parts(values)
        shares, times = (np.array(x, float) for x in zip(*parts, strict=True))
        values |= {
            "elements": len(times),
            "stiffnesses": shares * values["stiffness_MPa"],
            "times": np.clip(times, *TIMES_S),
        }
    if law.form in ("Delay", "DelayedLag"):
        values["capacity"] = options.capacity(values["time_constant_s"])
    return values


def kernels_for(functions: str) -> str:
    """The kernels that the functions call, and those that these call, in order."""
    have: Mapping[str, str] = blocks("kernels.c")
    wanted: set[str] = set()
    text = functions
    while True:
        found = {k for k in have if re.search(rf"\b{k}(_at|_push)?\(", text)} - wanted
        if not found:
            return "\n".join(have[k] for k in have if k in wanted)
        wanted |= found
        text = "".join(have[k] for k in found)
