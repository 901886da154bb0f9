"""How many branches does a relaxation test call for, and what are they?

Section 5.4 and Fig. 5.5 of the thesis: RMSE of Wiechert's model fitted by collocation
(eq. 5.3) with 1 to 10 branches, and of the standard linear solid through three points.
Beside them non-negative least squares, the stiffnesses that collocation makes negative,
and the number of branches that predicts held-out data best: another specimen, up to
its stiffness, or a stretch of the one hold there is.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from softnn.models.relaxation import (
    Relaxation,
    held_out_branches,
    log_spaced,
    three_points,
)
from softnn.study.baselines import RelaxationTest, late_tau
from softnn.study.piecewise import Case, Work, carry_out
from studies.shown.branches import METHODS, draw, written

MOST = 10


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.branches`; returns the exit code."""
    return carry_out("branches", __doc__, argv, study, draw)


def study(work: Work, case: Case) -> dict[str, Any]:
    """Fits of every count to every test; RMSE as a fraction of the first modulus."""
    tests, texts, trials, drawn = [], [], [], []
    for test in case.tests:
        found, fits = one_test(test)
        name = f"strain {test.held_strain:.2f} for {test.held_s / 60:.0f} min"
        tests.append({"held_strain": test.held_strain, "held_s": test.held_s, **found})
        texts.append(f"{name}, {len(test.holds)} specimens\n\n{written(found)}")
        drawn.append((name, test, fits))
        trials += [
            {
                "name": f"{name}, {method}, {row['branches']} branches",
                "parameters": {
                    "held_strain": test.held_strain,
                    "method": method,
                    "branches": row["branches"],
                },
                "metrics": {
                    "rmse": row[method]["rmse"],
                    "negative": row[method]["negative"],
                    "held_out": row[method]["held_out"],
                },
            }
            for row in found["by_branches"]
            for method in METHODS
        ]
    text = "\n\n".join(texts)
    print(f"\n{case.label}\n\n{text}")
    last = tests[-1]
    return {
        "material": case.material,
        "label": case.label,
        "headline": {
            "branches_collocation": last["collocation"]["least_rmse_branches"],
            "branches_collocation_negative": last["collocation"]["negative"],
            "branches_collocation_held_out": last["collocation"]["held_out_branches"],
            "branches_non_negative_held_out": last["non-negative"]["held_out_branches"],
            "rmse_three_points": last["three_points_rmse"],
            "rmse_collocation": last["collocation"]["rmse"],
            "rmse_non_negative": last["non-negative"]["rmse"],
        },
        "tests": tests,
        "trials": trials,
        "text": text,
        "drawn": drawn[-1],
    }


def one_test(test: RelaxationTest) -> tuple[dict[str, Any], dict[str, Relaxation]]:
    """What is reported of a test, and the fits that are drawn.

    RMSE is on the hold as it was sampled, as in the thesis; held-out error on means
    over bins of log time, so that the last hour does not decide alone.
    """
    hold = test.mean
    start = float(hold[1][0])
    sls, literal = three_points(*hold), late_tau(hold)
    thinned = [log_spaced(*h) for h in test.holds]
    found: dict[str, Any] = {
        "three_points_rmse": sls.rmse / start,
        "three_points_tau_s": sls.relaxation_time[0],
        "literal_rmse": literal.rmse / start,
        "literal_tau_s": literal.relaxation_time[0],
    }
    rows: list[dict[str, Any]] = [{"branches": b} for b in range(1, MOST + 1)]
    drawn = {"SLS, three points": sls}
    for method, fitted in METHODS.items():
        fits = [fitted(*hold, b) for b in range(1, MOST + 1)]
        count, held_out = held_out_branches(thinned, fitted, MOST)
        for row, fit, error in zip(rows, fits, held_out, strict=True):
            row[method] = {
                "rmse": fit.rmse / start,
                "negative": fit.negative,
                "held_out": error / start,
            }
        best = min(fits, key=lambda f: f.rmse)
        found[method] = {
            "least_rmse_branches": best.branches,
            "rmse": best.rmse / start,
            "negative": best.negative,
            "held_out_branches": count,
            "fit": best.to_dict(),
        }
        drawn[f"Wiechert, {method}, {best.branches} branches"] = best
    return {**found, "by_branches": rows}, drawn


if __name__ == "__main__":
    sys.exit(main())
