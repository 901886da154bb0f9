"""How far do the virtual specimens miss the published properties, and why?

Every property of Tables 4.2 and 4.4 is measured on the virtual specimens as on real
recordings (raw, prepared, unified) and stands beside the published one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.calibration import measured, targets, unexplained
from softnn import prepare, properties, virtual
from softnn.materials import MATERIALS, Material, material, table
from softnn.recording import Recording, data_hash
from softnn.study import common

LISTED = 0.25  # a miss above this needs a reason
REASONS = {
    ("NatR", "250 mm/min", "ultimate_stress_median"): "15.88 MPa at a median strain of "
    "12.11 beside a mean curve that has 7.38 MPa at 11.27: the two ask for an upturn "
    "steeper than the bands of one material and 8 % of scatter in its onset give",
    ("NatR", "test 1", "stress_start"): "Table 4.4 has 2.3 times the stress of Table "
    "4.2 at the same strain and speed; one material gives one of the two",
    ("NatR", "test 1", "stress_end"): "as for the stress at the start of the hold",
}


def main(argv: list[str] | None = None) -> int:
    parser = common.parser("virtual_specimens", __doc__)
    options = parser.parse_args(argv)

    def work() -> None:
        names = ("NatPolR",) if options.smoke else MATERIALS
        result = run(names, options.seed)
        folder = common.results_folder(options.smoke)
        path = common.write_result(
            "virtual_specimens",
            result["headline"],
            result,
            seed=options.seed,
            data={n: data_hash(_all(n, options.seed)) for n in names},
            folder=folder,
        )
        figure = draw(names, options.seed)
        common.save_figure(figure, "virtual_specimens", folder)
        print(report(result))
        print(path)

    return common.guarded(work)


def run(names: tuple[str, ...], seed: int) -> dict[str, Any]:
    """Published and recovered properties of the materials `names`."""
    rows = [row for name in names for row in compare(name, seed)]
    scatter = [_scatter(name, seed) for name in names]
    missed = np.array([abs(r["deviation"]) for r in rows])
    listed = [r for r in rows if abs(r["deviation"]) > LISTED]
    # Ultimate strains are drawn to have the published median and mean.
    judged = ["ultimate_strain" not in r["property"] for r in rows]
    headline = {
        "properties": len(rows),
        "median_deviation": float(np.median(missed)),
        "median_deviation_without_ultimate_strain": float(np.median(missed[judged])),
        "within_10_percent": float(np.mean(missed <= 0.10)),
        "above_25_percent": len(listed),
        "above_25_percent_without_reason": sum(r["reason"] is None for r in listed),
        "largest_r2_difference": max(abs(s["r2"] - s["r2_published"]) for s in scatter),
    }
    means = [row for name in names for row in _means_over_specimens(name, seed)]
    return {
        "headline": headline,
        "properties": rows,
        "scatter": scatter,
        "ultimate_stress_as_mean_over_specimens": means,
    }


def compare(name: str, seed: int = 0) -> Iterator[dict[str, Any]]:
    """One row a property: published, found, relative deviation, reason if large."""
    m = material(name)
    found = measured(m, virtual.tensile(name, seed), virtual.relaxation(name, seed))
    for (where, key), published in targets(m).items():
        value = found[where, key]
        yield {
            "material": name,
            "where": where,
            "property": key,
            "published": published,
            "found": value,
            "deviation": value / published - 1,
            "reason": REASONS.get((name, where, key)),
        }


def _means_over_specimens(name: str, seed: int) -> Iterator[dict[str, Any]]:
    """sigma_u read the other way: the mean of the specimens' ultimate stresses."""
    m = material(name)
    ready = [prepare.specimen(r) for r in virtual.tensile(name, seed)]
    for speed, group in zip(m.speeds, prepare.by_group(ready), strict=True):
        value = float(np.mean([properties.ultimate(r)[0] for r in group]))
        published = m.elastic[speed]["ultimate_stress_mean"]
        yield {
            "material": name,
            "where": f"{speed} mm/min",
            "published": published,
            "found": value,
            "deviation": value / published - 1,
        }


def _scatter(name: str, seed: int) -> dict[str, Any]:
    """What no function of strain and rate explains, beside the published networks.

    The error was calibrated to the published one; R2 was not.
    """
    recordings = virtual.tensile(name, seed)
    error = unexplained(recordings)
    ready = [prepare.specimen(r, samples=len(r)) for r in recordings]
    stress = np.concatenate([r.stress_MPa for r in ready])
    published = table("6.6").row(material=name, model="ANN")
    return {
        "material": name,
        "unexplained": error,
        "network_error_published": published["generalisation_error"] / 100,
        "r2": float(1 - error**2 * np.mean(stress**2) / np.var(stress)),
        "r2_published": published["r2"] / 100,
    }


def _all(name: str, seed: int) -> list[Recording]:
    return virtual.tensile(name, seed) + virtual.relaxation(name, seed)


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


if __name__ == "__main__":
    sys.exit(main())
