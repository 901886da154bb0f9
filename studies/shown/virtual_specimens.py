"""How `studies.virtual_specimens` shows what it found."""

from __future__ import annotations

from typing import Any

from softnn import prepare, virtual
from softnn.materials import Material, material
from softnn.study import common

LISTED = 0.25  # a miss above this needs a reason


def report(result: dict[str, Any]) -> str:
    """The table that is printed: misses by material and property, in per cent."""
    rows = result["properties"]
    keys = list(dict.fromkeys(r["property"] for r in rows))
    places = list(dict.fromkeys((r["material"], r["where"]) for r in rows))
    misses = {(r["material"], r["where"], r["property"]): r["deviation"] for r in rows}
    lines: list[list[str | None]] = []
    for place in places:
        found = [misses.get((*place, key)) for key in keys]
        lines.append([" ".join(place)])
        lines[-1] += [None if v is None else f"{100 * v:+.0f}" for v in found]
    text = [common.markdown(["miss in %", *keys], lines)]
    for r in rows:
        if abs(r["deviation"]) > LISTED:
            what = f"{r['material']}, {r['where']}, {r['property']}"
            text.append(f"{what}: {r['deviation']:+.0%}; {r['reason'] or 'no reason'}")
    text += [f"{k}: {v:.4g}" for k, v in result["headline"].items()]
    return "\n".join(text)


def draw(names: tuple[str, ...], seed: int) -> Any:
    """Stress over strain of every virtual specimen, with the published points."""
    columns = min(4, len(names))
    lines = -(-len(names) // columns)
    figure = common.new_figure(2.6 * columns, 2.3 * lines)
    for i, name in enumerate(names):
        axes = figure.add_subplot(lines, columns, i + 1)
        m = material(name)
        for speed, colour in zip((50, 250, 500), common.COLOURS, strict=False):
            if speed in m.speeds:
                _draw_speed(axes, m, speed, colour, seed)
        axes.set_title(name)
        axes.set_ylim(bottom=0)
        if i % columns == 0:
            axes.set_ylabel("stress [MPa]")
        if i >= len(names) - columns:
            axes.set_xlabel("strain")
    last = figure.axes[-1]
    last.plot([], [], "ko", ms=4, mfc="none", label="published")
    for line in last.legend(fontsize=7, loc="upper left").get_lines():
        line.set_linewidth(1.5)
    figure.suptitle("Virtual specimens, prepared, and the published values", size=9)
    return figure


def _draw_speed(axes: Any, m: Material, speed: int, colour: str, seed: int) -> None:
    label: str | None = f"{speed} mm/min"
    for r in virtual.tensile(m.name, seed):
        if r.rate_per_s == m.rate_per_s(speed):
            ready = prepare.specimen(r, samples=60)
            axes.plot(ready.strain, ready.stress_MPa, color=colour, lw=0.5, label=label)
            label = None
    row = m.elastic[speed]
    strain = [row[k] for k in ("yield_strain", "ultimate_strain_mean")]
    stress = [row[k] for k in ("yield_stress", "ultimate_stress_mean")]
    strain.append(row["ultimate_strain_median"])
    stress.append(row["ultimate_stress_median"])
    axes.plot(strain, stress, "o", color=colour, mec="k", mew=0.6, ms=4)
