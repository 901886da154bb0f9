"""A network as C: its inputs from the history, its neurons, and its guard."""

from __future__ import annotations

from typing import Any

from softnn.contracts import InputError
from softnn.export.parts import Instance, Options, struct_of
from softnn.export.templates_of import blocks, fill, literal
from softnn.neural import ARCHITECTURES, PUBLISHED, Architecture, StoredNetwork
from softnn.neural.guard import SLACK


def network(model: StoredNetwork, name: str, prefix: str, options: Options) -> Instance:
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
                "target_half": float(net.target.half),
                "target_middle": float((net.target.low + net.target.high) / 2),
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
    )
    return out


def stepped(model: StoredNetwork) -> Architecture:
    """The inputs of a network; `InputError` for those that no export can make."""
    if model.architecture not in PUBLISHED:
        raise InputError(
            f"a network of inputs {model.architecture} cannot be exported; allowed is "
            f"{', '.join(PUBLISHED)}"
        )
    return ARCHITECTURES[model.architecture]


def _check(model: StoredNetwork, guard: str) -> str:
    """Flags of what the network was never shown: `Seen.flags`, line by line."""
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
