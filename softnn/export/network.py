"""A network as C: its inputs from the history, its neurons, and its guard."""

from __future__ import annotations

from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.export.parts import Instance, Options, struct_of
from softnn.export.templates_of import blocks, fill, literal, literals
from softnn.neural import (
    Architecture,
    BoundedNetwork,
    Network,
    StoredNetwork,
    architecture_of,
)
from softnn.neural.convex import ConvexNetwork
from softnn.neural.guard import SLACK
from softnn.neural.inputs import FILTER_S


def network(model: StoredNetwork, name: str, prefix: str, options: Options) -> Instance:
    if isinstance(model.network, ConvexNetwork):
        return _convex(model, model.network, name, prefix)
    out = Instance(prefix, is_network=True)
    row, net = stepped(model), model.network
    size, wide = net.hidden.shape[0], net.hidden.shape[1] - 1
    out.functions.append(
        fill(
            blocks("base.c")["network"],
            {
                "p": prefix,
                "n": size,
                "d": wide,
                "middle": (net.inputs.low + net.inputs.high) / 2,
                "half": net.inputs.half,
                "hidden": net.hidden,
                "output": net.output,
                **_bounds(net),
            },
        )
    )
    most = max(row.lags)
    places: dict[str, Any] = {"p": prefix, "d": wide, "guard": name.upper()}
    if model.lag_s is None:
        members = [f"double past[{most + 1}], before, rate;"]
        inputs = fill(blocks("step.c")["sample_lags"], places | {"lags": most})
        columns = [f"s->past[{lag}]" for lag in row.lags]
    else:
        longest = max(most, 1) * model.lag_s
        capacity = options.capacity(longest)
        members = [
            f"double time[{capacity}], value[{capacity}], rate;",
            "int end, count;",
        ]
        timed = {"capacity": capacity, "longest": longest, "lag": model.lag_s}
        inputs = fill(blocks("step.c")["time_lags"], places | timed)
        columns = [
            f"ring_at(s->time, s->value, {capacity}, s->end, s->count, "
            f"t - {literal(lag * model.lag_s)})"
            if lag
            else "strain"
            for lag in row.lags
        ]
    columns += ["rate"] * row.rate
    if row.largest:
        members.append("double largest;")
        inputs += "    s->largest = fmax(s->largest, fabs(strain));\n"
        columns.append("s->largest")
    if past := row.filters + row.branches:
        times = np.array(past) * (FILTER_S if model.lag_s is None else model.lag_s)
        filled = {"p": prefix, "n": len(past), "times": times}
        filled["stiffness"] = np.ones(len(past))  # only the strain of each is wanted
        out.types.append(fill(blocks("base.c")["branches_type"], filled))
        out.functions.append(fill(blocks("base.c")["branches"], filled))
        members.append(f"{prefix}_branches_t behind;")
        inputs += (
            "    if (first || dt > 0.0) {\n"
            f"        (void){prefix}_branches(&s->behind, dt, strain);\n    }}\n"
        )
        held = [f"(s->behind.last - s->behind.carried[{j}])" for j in range(len(past))]
        columns += held[: len(row.filters)]
        columns += [f"strain - {y}" for y in held[len(row.filters) :]]
    inputs += "".join(f"    x[{j}] = {c};\n" for j, c in enumerate(columns))
    check = _check(model, name.upper())
    out.functions.append(
        fill(blocks("step.c")["network"], places | {"inputs": inputs, "check": check})
    )
    out.types.append(struct_of(prefix, members))
    out.notes.append(
        "The strain rate of the first sample is unknown and taken as 0, so its stress "
        "is no more than a start."
        if row.rate
        else "Before the first sample the strain is taken as that of the first."
        if len(row.lags) > 1
        else "Before the first sample the specimen is at rest at zero strain."
    )
    return out


def _convex(
    model: StoredNetwork, net: ConvexNetwork, name: str, prefix: str
) -> Instance:
    """Return C of springs and Maxwell branches (`softnn.neural.convex`)."""
    out = Instance(prefix, is_network=True)
    knots, limits, times = net.hidden.T
    filled = {
        "p": prefix,
        "n": len(net.hidden),
        "knots": knots,
        "limits": limits,
        "times": times,
        "stiffness": net.output[:-1],
        "rest": float(net.output[-1]),
    }
    rate = fill(blocks("step.c")["sample_lags"], {"lags": 0})
    check = _check(model, name.upper())
    out.types.append(fill(blocks("base.c")["convex_type"], filled))
    out.functions.append(fill(blocks("base.c")["convex"], filled))
    places = {"p": prefix, "inputs": rate, "check": check}
    out.functions.append(fill(blocks("step.c")["convex"], places))
    members = ["double past[1], before, rate;", f"{prefix}_units_t units;"]
    out.types.append(struct_of(prefix, members))
    out.notes.append("Before the first sample the specimen is at rest at zero strain.")
    return out


def stepped(model: StoredNetwork) -> Architecture:
    """The inputs of a network of tanh neurons; `InputError` for any other network."""
    row = architecture_of(model.architecture)
    if row.feedback or row.radial or row.recurrent or row.convex:
        why = (
            "to ONNX: its units have a memory, which ONNX has not; try --to c"
            if row.convex
            else "as C or ONNX: there is none for stress fed back, Gaussian or "
            "recurrent units"
        )
        raise InputError(
            f"a network of inputs {model.architecture} cannot be exported {why}"
        )
    return row


def _bounds(net: Network) -> dict[str, str]:
    """Return code that holds inputs in the training range and stress to one sign."""
    middle = float((net.target.low + net.target.high) / 2)
    stress = f"sum * {literal(float(net.target.half))} + {literal(middle)}"
    if not isinstance(net, BoundedNetwork):
        return {"limits": "", "known": "x[j]", "stress": stress}
    ends = "".join(
        f"    static const double {name}[{len(end)}] = {{{literals(end)}}};\n"
        for name, end in (("low", net.inputs.low), ("high", net.inputs.high))
    )
    one_sided = f"{'fmax' if net.pulls else 'fmin'}({stress}, 0.0)"
    return {"limits": ends, "known": "clip(x[j], low[j], high[j])", "stress": one_sided}


def _check(model: StoredNetwork, guard: str) -> str:
    """Return code for flags outside the training range: `Seen.flags`, line by line."""
    seen = model.known

    def beyond(what: str, low: float, high: float) -> str:
        slack = SLACK * (high - low)
        return f"{what} < {literal(low - slack)} || {what} > {literal(high + slack)}"

    text = f"    if ({beyond('strain', *seen.strain)}) {{\n"
    text += f"        *flags |= {guard}_STRAIN;\n    }}\n"
    if seen.rate_per_s is None:
        return text
    low, high = seen.rate_per_s
    other = [
        f"rate < 0.0 && {literal(low)} >= 0.0",
        f"rate > 0.0 && {literal(high)} <= 0.0",
    ]
    text += (
        f"    if (!first && (({other[0]})\n                   || ({other[1]}))) {{\n"
    )
    text += f"        *flags |= {guard}_DIRECTION;\n"
    text += f"    }} else if (!first && ({beyond('rate', low, high)})) {{\n"
    return text + f"        *flags |= {guard}_RATE;\n    }}\n"
