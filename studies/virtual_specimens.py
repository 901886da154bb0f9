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
from softnn.materials import MATERIALS, material, table
from softnn.recording import Recording, data_hash
from softnn.study import common
from studies.shown.virtual_specimens import LISTED, draw, report

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
        folder = common.results_folder(options.smoke, options.publish)
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


if __name__ == "__main__":
    sys.exit(main())
