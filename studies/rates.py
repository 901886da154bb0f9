"""Do springs fitted at one strain rate predict the stress at the others?

Table 5.2 and Figs 5.16 to 5.19 of the thesis: the generalisation error (eq. 5.13) of
PL-SLS and PL-Wiechert with the strain-dependent stiffness k* taken from one rate, the
published values beside. Beyond the thesis: k* from each of the rates in turn; every
reading of the way to branches; branches at a share of their stiffness; springs and
branches fitted to all rates together; each rate predicted from the others; and, in the
same way, Std. Lin. SDS.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

from softnn.study.baselines import (
    MODELS,
    Choice,
    best,
    choices,
    described,
    jointly,
    literal,
    softened,
    stated,
)
from softnn.study.common import markdown, percent
from softnn.study.left_out_rate import error_by_rate, std_lin_sds
from softnn.study.piecewise import Case, Work, carry_out, speed_label
from studies.shown.rates import draw, rows_of


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.rates`; returns the exit code."""
    return carry_out("rates", __doc__, argv, study, draw)


def study(work: Work, case: Case) -> dict[str, Any]:
    """Generalisation error of both models, fitted at each rate in turn and jointly."""
    began = time.perf_counter()
    found = {
        speed_label(case, c): choices(case.curves, case.variants, [c])
        for c in case.curves
    }
    soft_found = choices(case.curves, softened(case.variants), [case.fitted])
    seconds = time.perf_counter() - began
    thesis = speed_label(case, case.fitted)
    models: dict[str, Any] = {}
    headline: dict[str, Any] = {}
    trials: list[dict[str, Any]] = []
    rows: list[list[Any]] = []
    shown: dict[str, Choice] = {}
    for model in MODELS:
        # As the thesis has it: one way to branches, the tolerance of least error.
        shown[model] = literal(found[thesis], model)
        by_text = stated(found[thesis], model)
        any_reading = best(found[thesis], model)
        soft = best(soft_found, model)
        by_rate = {
            rate: described(best(fits, model), case.curves)
            for rate, fits in found.items()
        }
        joint = jointly(model, case.curves)
        apart = error_by_rate(model, case)
        published = case.published("5.2", model)
        models[model] = {
            "fitted_at": thesis,
            "as_in_thesis": described(shown[model], case.curves),
            "as_stated": by_text and described(by_text, case.curves),
            "any_reading": described(any_reading, case.curves),
            "softened": described(soft, case.curves),
            "fitted_at_each_rate": by_rate,
            "joint": joint,
            "each_rate_from_the_others": apart,
            "published": published and published["generalisation_error"] / 100,
        }
        key = model.lower().replace("-", "_")
        headline |= {
            f"{key}_ge": shown[model].generalisation_error,
            f"{key}_ge_as_stated": by_text and by_text.generalisation_error,
            f"{key}_ge_any_reading": any_reading.generalisation_error,
            f"{key}_ge_softened": soft.generalisation_error,
            f"{key}_ge_best_rate": min(
                e["generalisation_error"] for e in by_rate.values()
            ),
            f"{key}_nrmse_joint": joint and joint["nrmse_over_rates"],
            f"{key}_nrmse_rate_left_out": apart and apart["nrmse"],
        }
        rows += rows_of(model, models[model], published)
        trials += [
            {
                "name": f"{model}, k* at {rate}, {entry['rule']}",
                "parameters": {
                    "model": model,
                    "fitted_at": rate,
                    "tolerance": entry["tolerance"],
                    "rule": entry["rule"],
                    "held_strain": entry["held_strain"],
                },
                "metrics": {
                    "generalisation_error": entry["generalisation_error"],
                    "segments": entry["segments"],
                    "branches": entry["branches"],
                    "nrmse": list(entry["nrmse_by_rate"].values()),
                    "seconds": seconds,
                },
            }
            for rate, entry in by_rate.items()
        ]
    sds = std_lin_sds(case)
    rows.append(["Std. Lin. SDS, 20 equal segments", percent(sds), None, 20, 1, ""])
    headline["std_lin_sds_ge"] = sds
    header = ["model", "GE", "tolerance", "segments", "branches", "branches from"]
    text = markdown(header, rows)
    print(f"\n{case.label}\n\n{text}")
    return {
        "material": case.material,
        "label": case.label,
        "holds_from": case.holds_from,
        "headline": headline,
        "models": models,
        "std_lin_sds": sds,
        "seconds": seconds,
        "trials": trials,
        "text": text,
        "drawn": shown,
    }


if __name__ == "__main__":
    sys.exit(main())
