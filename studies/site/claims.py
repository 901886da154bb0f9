"""What the thesis says in words, held against the results: found so, or contradicted.

A claim is one sentence of the thesis, the cases it speaks of (materials, fits, scenes),
and for each whether the results on virtual specimens agree. Nothing is judged by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median, stdev
from typing import Any

import numpy as np

from bench.architectures import compared
from bench.architectures.compared import METHODS
from softnn.materials import MATERIALS, table
from softnn.neural import PUBLISHED
from softnn.study.common import markdown, percent

Result = Mapping[str, Any]
PL = ("PL-SLS", "PL-Wiechert")
CLOSE = 1.1  # errors "very similar" in the thesis: one at most 1.1 times the other
CLEAR = 10.0  # "an order of magnitude"
FEW_R2 = 0.999
TEN = 10  # neurons


@dataclass(frozen=True)
class Claim:
    """A sentence of the thesis, and in which cases the results agree with it."""

    key: str
    where: str
    says: str
    found: str
    holds: Mapping[str, bool]

    @property
    def contradicted(self) -> list[str]:
        """The cases in which the results say otherwise."""
        return [name for name, so in self.holds.items() if not so]

    @property
    def verdict(self) -> str:
        """In words.

        >>> Claim("k", "5.1", "", "", {"EPR": True, "FR": False}).verdict
        '**contradicted** for FR'
        """
        wrong, of = self.contradicted, len(self.holds)
        if not wrong:
            return "found so"
        if len(wrong) == of:
            return "**contradicted**"
        if len(wrong) <= 3:
            return f"**contradicted** for {', '.join(wrong)}"
        return f"**contradicted** in {len(wrong)} of {of}"


def written(claims: Sequence[Claim]) -> str:
    """Claims as a table, with a line that counts the contradictions."""
    rows = [[c.where, c.says, c.found, c.verdict] for c in claims]
    wrong = sum(bool(c.contradicted) for c in claims)
    heads = ["section", "the thesis says", "found", "so"]
    return (
        f"{markdown(heads, rows)}\n\nStatements found so: {len(claims) - wrong} of "
        f"{len(claims)}. Contradicted, in all of their cases or in those named: "
        f"{wrong}."
    )


def least(folds: Mapping[str, Sequence[float]]) -> list[str]:
    """Return the names with the least mean over folds, or within its standard error.

    >>> least({"a": [1.0, 1.2, 1.4], "b": [1.2, 1.3, 1.4], "c": [2.0, 2.1, 2.2]})
    ['a', 'b']
    """
    best = min(folds.values(), key=mean)
    enough = mean(best) + stdev(best) / len(best) ** 0.5
    return [k for k, v in folds.items() if mean(v) <= enough]


def by_material(result: Result) -> dict[str, Any]:
    """The materials of a result, by name, in the thesis's order."""
    found = {m["material"]: m for m in result["materials"]}
    return {name: found[name] for name in MATERIALS}


def listed(values: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


# --- chapter 3 ------------------------------------------------------------------------


def motion(gait: Result) -> list[Claim]:
    """Section 3.2.2."""
    head = gait["headline"]
    low, high = head["low_whole"], head["high_whole"]
    return [
        Claim(
            "knee",
            "3.2.2",
            "ages 50 to 70 need a knee of 5 to 63 degrees: three studies agree on it",
            f"{low} to {high} degrees in {head['studies']} studies",
            {"knee": (low, high) == (5, 63)},
        )
    ]


# --- chapter 5 ------------------------------------------------------------------------


def piecewise(accuracy: Result, rates: Result, segments: Result) -> list[Claim]:
    """Sections 5.4 and 5.5."""
    best = {k: m["best"] for k, m in by_material(accuracy).items()}
    over = {k: m["models"] for k, m in by_material(rates).items()}
    return [
        _branches(best),
        *_tolerance(by_material(segments), best),
        *_improvement(by_material(accuracy)),
        *_over_rates(over),
        _predecessor(by_material(accuracy)),
    ]


def _branches(best: Mapping[str, Any]) -> Claim:
    counts = {k: b["PL-Wiechert"]["branches"] for k, b in best.items()}
    return Claim(
        "branches",
        "5.4",
        "the best number of branches is 5 to 8",
        listed({k: str(n) for k, n in counts.items()}),
        {k: 5 <= n <= 8 for k, n in counts.items()},
    )


def _tolerance(segments: Mapping[str, Any], best: Mapping[str, Any]) -> list[Claim]:
    def counts(name: str, model: str) -> list[int]:
        rows = segments[name]["models"][model]["by_tolerance"]
        return [r["segments"] for r in rows]

    def exponential(name: str) -> bool:
        fits = []
        for model in PL:
            n = np.array(counts(name, model), float)
            fits.append(_straight(np.log(n)) > _straight(n))
        return all(fits)

    at_least = {
        f"{name} ({model})": best[name][model]["tolerance"]
        for name in best
        for model in PL
    }
    of_thesis = [
        table("5.1").row(material=name, model=model)["tolerance"]
        for name in best
        for model in PL
    ]
    lowest = min(at_least.values())
    said = ("EPR", "FR", "NR", "NatPolR", "NatR")
    fewer = {k: [best[k][m]["segments"] for m in PL] for k in said}
    bent = {k: exponential(k) for k in best}
    falling = {
        f"{k} ({m})": bool(np.all(np.diff(counts(k, m)) <= 0)) for k in best for m in PL
    }
    return [
        Claim(
            "smaller tolerance",
            "5.5.1",
            "the smaller the tolerance, the more segments",
            f"in {sum(falling.values())} of {len(falling)} fits segments never grow "
            "with the tolerance",
            falling,
        ),
        Claim(
            "exponential",
            "5.5.1",
            "segments fall exponentially with the tolerance, of SR rather in a line",
            "an exponential fits both models better than a line for "
            + (", ".join(k for k, so in bent.items() if so) or "none"),
            {k: so is (k != "SR") for k, so in bent.items()},
        ),
        Claim(
            "fewer segments",
            "5.5.1",
            f"PL-Wiechert needs fewer segments than PL-SLS: {', '.join(said)} (Table "
            "5.1 has more for EPR and NatR)",
            listed({k: f"{b} against {a}" for k, (a, b) in fewer.items()}),
            {k: b < a for k, (a, b) in fewer.items()},
        ),
        Claim(
            "not the smallest",
            "5.5.1",
            f"the smallest tolerance, {percent(lowest, 0)}, is not always the best "
            f"(best in {sum(t <= 100 * lowest for t in of_thesis)} of "
            f"{len(of_thesis)} fits of Table 5.1)",
            f"best in {sum(t <= lowest for t in at_least.values())} of {len(at_least)}",
            {k: t > lowest for k, t in at_least.items()},
        ),
    ]


def _straight(y: np.ndarray) -> float:
    """R2 of a straight line through values (n,) at equal steps."""
    x = np.arange(len(y))
    return float(np.corrcoef(x, y)[0, 1] ** 2) if np.ptp(y) > 0 else 0.0


def _improvement(accuracy: Mapping[str, Any]) -> list[Claim]:
    made = []
    names = {
        "delta_accuracy": ("5.11", "accuracy"),
        "delta_complexity": ("5.12", "complexity"),
    }
    for key, (equation, what) in names.items():
        pairs = {
            k: (
                table("5.1").row(material=k, model="improvement")[key],
                m["improvement"][f"{key}_percent"],
            )
            for k, m in accuracy.items()
        }
        signs = listed({k: f"{p:+g} %" for k, (p, _) in pairs.items()})
        made.append(
            Claim(
                f"sign of {what}",
                f"5.5.2, eq. {equation}",
                f"PL-Wiechert changes the {what} by {signs}",
                listed({k: f"{f:+.0f} %" for k, (_, f) in pairs.items()})
                + "; judged by the sign",
                {k: np.sign(p) == np.sign(round(f)) for k, (p, f) in pairs.items()},
            )
        )
    return made


def _over_rates(over: Mapping[str, Any]) -> list[Claim]:
    error = {
        k: {m: over[k][m]["as_in_thesis"]["generalisation_error"] for m in PL}
        for k in over
    }
    farther = {}
    for k, models in over.items():
        for m in PL:
            rows = models[m]["as_in_thesis"]["nrmse_by_rate"]
            errors = [rows[rate] for rate in sorted(rows, key=float)]
            if k != "SR":
                farther[f"{k} ({m})"] = errors == sorted(errors, reverse=True)
    slower = {}
    for k, models in over.items():
        for m in PL:
            each = models[m]["fitted_at_each_rate"]
            errors = [each[r]["generalisation_error"] for r in each]
            slower[f"{k} ({m})"] = errors[0] < errors[-1]
    first = ("EPR", "SR")
    return [
        Claim(
            "farther rates",
            "5.5.3",
            "with k* at 500 mm/min the error grows with the distance of the rate",
            f"so in {sum(farther.values())} of {len(farther)} fits",
            farther,
        ),
        Claim(
            "slower k*",
            "5.5.3",
            "a slower rate for k* may do better",
            f"the slowest does better than the fastest in {sum(slower.values())} of "
            f"{len(slower)} fits",
            slower,
        ),
        Claim(
            "sls better",
            "5.5.3",
            "PL-SLS errs less over rates than PL-Wiechert, but for "
            f"{' and '.join(first)}",
            listed(
                {
                    k: " against ".join(str(percent(e[m])) for m in PL)
                    for k, e in error.items()
                }
            ),
            {k: (e[PL[0]] < e[PL[1]]) is (k not in first) for k, e in error.items()},
        ),
        Claim(
            "below 5 %",
            "5.5.3",
            "both err by less than 5 % over rates, but for EPR",
            f"{sum(e[m] < 0.05 for e in error.values() for m in PL)} of "
            f"{len(PL) * len(error)} are below 5 %",
            {k: all(e[m] < 0.05 for m in PL) is (k != "EPR") for k, e in error.items()},
        ),
    ]


def _predecessor(accuracy: Mapping[str, Any]) -> Claim:
    found = {}
    for k, m in accuracy.items():
        (old,) = [v for n, v in m["rivals"].items() if n.startswith("Std. Lin. SDS")]
        found[k] = old, max(m["best"][model]["nrmse"] for model in PL)
    old_errors = [old for old, _ in found.values()]
    return Claim(
        "predecessor",
        "5.5.3",
        "both models do better than Std. Lin. SDS, which has 13.6 % in the literature",
        f"Std. Lin. SDS has {percent(min(old_errors), 0)} to "
        f"{percent(max(old_errors), 0)} on the same curves, at 20 equal segments; the "
        "worse of both models at most "
        f"{percent(max(new for _, new in found.values()))}",
        {k: new < old for k, (old, new) in found.items()},
    )


# --- chapter 6 ------------------------------------------------------------------------

CHAPTER_6 = ("inputs-all", "feedback", "neurons-all", "grid-all")  # results


def networks(
    inputs: Result, feedback: Result, neurons: Result, grid: Result
) -> list[Claim]:
    """Section 6.4."""
    folds = {
        name: {t["inputs"]: t["nrmse"] for t in m["trials"] if t["split"] == "random"}
        for name, m in by_material(inputs).items()
    }
    fed = feedback["materials"]
    gain = {
        k: v["nrmse_without_feedback"] / v["nrmse_measured"] for k, v in fed.items()
    }
    return [
        *_inputs(folds),
        _feedback(gain),
        *_neurons(by_material(neurons)),
        *_grid(grid["materials"]),
    ]


def _inputs(folds: Mapping[str, Mapping[str, Sequence[float]]]) -> list[Claim]:
    error = {k: {i: mean(v) for i, v in one.items()} for k, one in folds.items()}
    close = {k: (error[k]["FFRI1"], error[k]["FFRD4"]) for k in ("EPR", "NR")}
    past = {
        k: (error[k]["FFRI1"], min(error[k]["FFRI2"], error[k]["FFRI3"]))
        for k in ("FR", "NR", "SR")
    }
    return [
        Claim(
            "best inputs",
            "6.4.1",
            "FFRD4 has the least error",
            "least, or within a standard error of the least, for "
            + ", ".join(k for k, v in folds.items() if "FFRD4" in least(v)),
            {k: "FFRD4" in least(v) for k, v in folds.items()},
        ),
        Claim(
            "close inputs",
            "6.4.1",
            "for EPR and NR the error of FFRI1 is very similar to that of FFRD4",
            listed(
                {k: f"{percent(a)} against {percent(b)}" for k, (a, b) in close.items()}
            ),
            {k: a <= CLOSE * b for k, (a, b) in close.items()},
        ),
        Claim(
            "past strain",
            "6.4.1",
            "past strain does not help FR, NR and SR",
            listed(
                {
                    k: f"{percent(a)} without, {percent(b)} with"
                    for k, (a, b) in past.items()
                }
            ),
            {k: b * CLOSE >= a for k, (a, b) in past.items()},
        ),
    ]


def _feedback(gain: Mapping[str, float]) -> Claim:
    return Claim(
        "stress fed back",
        "6.4.1",
        "with the stress of a sample ago the error is at least an order of magnitude "
        "lower",
        listed({k: f"{g:.0f} times" for k, g in gain.items()}) + " lower than FFRD4",
        {k: g >= CLEAR for k, g in gain.items()},
    )


def _neurons(neurons: Mapping[str, Any]) -> list[Claim]:
    mean_r2 = {k: max(t["r2_mean"] for t in m["grid"]) for k, m in neurons.items()}
    fold_r2 = {k: max(max(t["r2"]) for t in m["grid"]) for k, m in neurons.items()}
    lowest = min(mean_r2, key=lambda k: mean_r2[k])
    dearer = {}
    for k, m in neurons.items():
        h = m["headline"]
        dearer[k] = h["nrmse_random"], h["nrmse_pl_sls_over_rates"]
    said = {
        k: table("6.6").row(material=k, model="ANN")["generalisation_error"]
        > table("6.6").row(material=k, model="PL-SLS")["generalisation_error"]
        for k in neurons
    }
    more = [k for k, so in said.items() if so]
    return [
        Claim(
            "first rule",
            "6.4.2",
            f"of NR alone R2 exceeds {percent(FEW_R2, 1)}, so that the fewest such "
            "neurons are taken",
            f"the largest mean R2 of NR is {percent(mean_r2['NR'])}, the best of all "
            f"its folds {percent(fold_r2['NR'])}; "
            + (
                "the rule never acts"
                if max(mean_r2.values()) <= FEW_R2
                else "the rule acts for "
                + ", ".join(k for k, v in mean_r2.items() if v > FEW_R2)
            ),
            {k: (v > FEW_R2) is (k == "NR") for k, v in mean_r2.items()},
        ),
        Claim(
            "lowest R2",
            "6.4.2",
            "NatR has the lowest R2, 81.6 %",
            f"{lowest} has the lowest, {percent(mean_r2[lowest], 1)}",
            {"NatR": lowest == "NatR"},
        ),
        Claim(
            "networks or springs",
            "6.4.2",
            f"networks err more than PL-SLS over rates: {', '.join(more)}",
            listed(
                {
                    k: f"{percent(dearer[k][0])} against {percent(dearer[k][1])}"
                    for k in more
                }
            ),
            {k: dearer[k][0] > dearer[k][1] for k in more},
        ),
    ]


def _grid(materials: Sequence[Result]) -> list[Claim]:
    """What the whole grid says of inputs, regularisation and neurons."""
    every = {m["material"]: compared.lines(m["trials"]) for m in materials}
    known = {k: of["FFRD4", "bayesian"] for k, of in every.items()}
    stopped = {k: of["FFRD4", "early-stopping"] for k, of in every.items()}
    by_inputs = {
        k: {i: min(min(of[i, how].values()) for how in METHODS) for i in PUBLISHED}
        for k, of in every.items()
    }
    bayesian = {k: min(v.values()) for k, v in known.items()}
    early = {k: min(v.values()) for k, v in stopped.items()}
    most = {k: (v[max(v)], min(v.values())) for k, v in known.items()}
    few = {k: compared.plateau(v) for k, v in known.items()}
    far = {}
    for m in materials:
        line = compared.lines(m["trials"], "unseen")["FFRD4", "bayesian"]
        at_most = median(e for n, e in line.items() if n <= TEN)
        far[m["material"]] = at_most, median(e for n, e in line.items() if n > TEN)
    printed = {k: table("6.6").row(material=k, model="ANN")["neurons"] for k in every}
    percents = f"{percent(compared.ENOUGH - 1, 0)}"
    return [
        Claim(
            "best inputs of the grid",
            "6.4.1",
            "a network of strain and rate does better than one of strains",
            "inputs of the least error of all counts and regularisations: "
            + listed({k: min(of, key=lambda i: of[i]) for k, of in by_inputs.items()}),
            {
                k: of["FFRD4"] <= compared.ENOUGH * min(of.values())
                for k, of in by_inputs.items()
            },
        ),
        Claim(
            "bayesian better",
            "6.4",
            "Bayesian regularisation does better than early stopping",
            listed(
                {
                    k: f"{percent(b)} against {percent(early[k])}"
                    for k, b in bayesian.items()
                }
            )
            + f"; better by more than {percents} of the error",
            {k: compared.ENOUGH * b < early[k] for k, b in bayesian.items()},
        ),
        Claim(
            "too many neurons",
            "6.2",
            "too many neurons bring a risk of over-fitting",
            "by random folds, "
            + listed(
                {
                    k: f"{percent(last)} with {max(known[k])}, least {percent(best)}"
                    for k, (last, best) in most.items()
                }
            )
            + f"; above the least by more than {percents} of it",
            {k: last > compared.ENOUGH * best for k, (last, best) in most.items()},
        ),
        Claim(
            "too many neurons, unseen",
            "6.2",
            "over-fitting keeps a network from generalising",
            f"at rates never seen, the median error with more than {TEN} neurons "
            f"against at most {TEN}: "
            + listed(
                {k: f"{percent(b)} against {percent(a)}" for k, (a, b) in far.items()}
            ),
            {k: b > compared.ENOUGH * a for k, (a, b) in far.items()},
        ),
        Claim(
            "more than ten",
            "6.1",
            f"the best number of neurons exceeds {TEN} (Table 6.6: "
            f"{listed({k: str(n) for k, n in printed.items()})})",
            f"fewest within {percents} of the least error: "
            + listed({k: str(n) for k, n in few.items()}),
            {k: n > TEN for k, n in few.items()},
        ),
    ]


# --- chapter 7 ------------------------------------------------------------------------

VARYING, CONSTANT = "derivative", "constant 250 mm/min"


def real_time(result: Result) -> list[Claim]:
    """Section 7.3, of one network in the thesis, of several here.

    A claim on a network holds if it holds for most of them.
    """
    said = {v["fed"]: v for v in result["verdict"]}
    varying, constant = said[VARYING], said[CONSTANT]
    jumps = {
        r["scenario"]: r["jump"]
        for r in result["rows"]
        if (r["inputs"], r["fed"], r["place"]) == ("FFRD4", VARYING, "from zero")
    }
    number = varying["networks"]
    error = {s: varying[f"nrmse_{s}"] for s in "abd"}
    stable = {s: constant[f"{s}_negative_in"] for s in "ab"}

    def counted(s: str) -> str:
        return f"negative stress in {varying[f'{s}_negative_in']} of {number} networks"

    def most(s: str) -> bool:
        return bool(varying[f"{s}_negative_in"] > number / 2)

    return [
        Claim(
            "a negative", "7.3, Fig. 7.2a", "(a) has negative stresses", counted("a"),
            {"a": most("a")},
        ),
        Claim(
            "a best", "7.3", "the network does best in (a)",
            listed({f"({s})": str(percent(e, 0)) for s, e in error.items()}) + " NRMSE",
            {"a": min(error, key=lambda s: error[s]) == "a"},
        ),
        Claim(
            "b unstable", "7.3, Fig. 7.2b", "(b) is less stable than (a)",
            f"the largest step from sample to sample is {jumps['b']:.0f} times that of "
            f"the law in (b), {jumps['a']:.0f} times in (a)",
            {"b": jumps["b"] > jumps["a"]},
        ),
        Claim(
            "b not negative", "7.3, Fig. 7.2b", "(b) never is negative", counted("b"),
            {"b": not most("b")},
        ),
        Claim(
            "c always negative", "7.3, Fig. 7.2c", "(c) always is negative",
            f"{percent(varying['c_negative_share'], 0)} of the time",
            {"c": varying["c_negative_share"] >= 1},
        ),
        Claim(
            "d both signs", "7.3, Fig. 7.2d",
            "(d) goes from positive to negative, though its rate is never below zero",
            counted("d"),
            {"d": most("d")},
        ),
        Claim(
            "constant stable", "7.3, Fig. 7.3",
            "at a constant rate the network is very stable",
            "negative stress in "
            + listed({f"({s})": f"{n} of {number}" for s, n in stable.items()})
            + f"; of (c), whose strain is negative, "
            f"{percent(constant['c_negative_share'], 0)} of the time",
            {s: n == 0 for s, n in stable.items()},
        ),
    ]  # fmt: skip


# --- all of them ----------------------------------------------------------------------


def every(result: Callable[[str], Result]) -> dict[int, list[Claim]]:
    """The claims of each chapter, from the results of these names."""
    return {
        3: motion(result("gait")),
        5: piecewise(result("accuracy"), result("rates"), result("segments")),
        6: networks(*(result(name) for name in CHAPTER_6)),
        7: real_time(result("realtime")),
    }
