"""The thesis, chapter by chapter: its tables beside what the studies find.

The studies use virtual specimens, which were calibrated to Tables 4.1 to 4.4. Agreement
there is no measurement. Figures of real recordings are separate and say so.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

from bench.architectures import compared
from bench.architectures.trials import WEIGHT
from bench.checking import moved
from softnn.materials import MATERIALS, material, table
from softnn.neural import PUBLISHED
from softnn.study.common import made_with, markdown, percent
from softnn.study.tendon_match import Row
from studies import feedback, inputs, natr
from studies.shown import dynamic as dynamic_shown
from studies.shown import gait as gait_shown
from studies.shown import properties, realtime, tendon
from studies.site import claims

RESULTS = Path(__file__).parents[1] / "results"
PL = ("PL-SLS", "PL-Wiechert")
REGULARISATION = "regularisation-all"
WAYS = ("bayesian", "early-stopping", "l2")
# Figures of the thesis, by chapter: which, our picture, and what both show.
PICTURES = {
    3: [("3.3", "gait", "ranges of the knee by age; the areas are those of Table 3.1")],
    4: [
        ("4.6 to 4.9", "properties_curves", "stress over strain at each rate"),
        (
            "4.10 to 4.16",
            "properties_yield",
            "offset yield strength, the published values of Table 4.2 beside",
        ),
        ("4.17, 4.18", "properties_relaxation", "stress relaxation"),
    ],
    5: [
        ("5.5", "branches", "error of the relaxation fit by number of branches"),
        (
            "5.8 to 5.11",
            "segments",
            "error over segments by tolerance; stars: Table 5.1",
        ),
        ("5.12 to 5.15", "accuracy", "best fit; errors of Table 5.1 in the corner"),
        (
            "5.16 to 5.19",
            "rates",
            "other rates predicted; errors of Table 5.2 in the corner",
        ),
    ],
    6: [
        (
            "6.2, 6.3",
            "inputs-all",
            "error by inputs; the thesis prints no values of it",
        ),
        *(
            (
                f"{number}, {name}",
                f"neurons-all-{name}",
                "R2 and error by neurons; diamond: Table 6.6",
            )
            for name, number in {
                "EPR": "6.4", "FR": "6.4", "NatPolR": "6.4", "NR": "6.5", "PR": "6.5",
                "SR": "6.5", "NatR": "6.6",
            }.items()
        ),
    ],
    7: [
        (
            "7.2, 7.3",
            "realtime",
            "networks on a sine, with its own rate and a constant one; the thesis "
            "prints no values of it",
        )
    ],
}  # fmt: skip
# The options with which `make results` runs a study.
COMMANDS = {
    "inputs": "inputs --material all",
    "neurons": "neurons --as-in-thesis --material all --keep-best",
    "regularisation": "regularisation --material all",
}
GRID = compared.GRID
INLINE = ("feedback", GRID, "dynamic", "tendon", "actuator")  # not in the thesis
HOURS = ("grid",)  # studies that `make results` leaves out
CAUTION = (
    "*Published*: as printed in the thesis. *Found*: on virtual specimens that imitate "
    "the published ones. The recordings behind the thesis were never published."
)


def result(name: str) -> Row:
    """What `studies/results/NAME.json` holds."""
    return dict(json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8")))


def pages() -> dict[str, str]:
    """Markdown of every chapter, by path."""
    made = {f"thesis/chapter-{n}.md": make() for n, make in CHAPTERS.items()}
    made["thesis/index.md"] = _index()
    return made


def pictures() -> dict[str, bytes]:
    """The pictures that chapters show, by path."""
    shown = [stem for rows in PICTURES.values() for _, stem, _ in rows]
    return {
        f"thesis/{p}.png": (RESULTS / f"{p}.png").read_bytes()
        for p in (*shown, *INLINE)
    }


def _pictures(chapter: int) -> str:
    """The figures of a chapter of the thesis, as the studies draw them."""
    shown = [
        f"### Fig. {number}\n\n![{about}]({stem}.png)\n\n"
        f"*{about[0].upper()}{about[1:]}.*"
        for number, stem, about in PICTURES[chapter]
    ]
    return "\n\n".join(["## The figures", *shown])


def _commands(study: Sequence[str]) -> str:
    """The commands of a chapter, and that of all."""
    lines = "\n".join(
        f"python -m studies.{COMMANDS.get(s, s)} --publish" for s in study
    )
    long = [s for s in study if s in HOURS]
    but = f" but for `studies.{'`, `studies.'.join(long)}`, which takes hours"
    return (
        "## The commands\n\nEach makes its result, its tables and its figures again. "
        f"`make results` makes those of all chapters{but if long else ''}.\n\n"
        f"```\n{lines}\n```"
    )


def _index() -> str:
    return "\n\n".join(
        [
            "# The thesis, chapter by chapter",
            "*Modelling and Characterization of Soft Materials for Bio-inspired "
            "Series-elastic Actuators* (PhD thesis, 2020) measured seven materials, "
            "fitted piecewise-linear viscoelastic models and small networks to them, "
            "and tested them in an actuator. These pages are for readers who compare "
            "softnn with the thesis. Each has the tables and figures of a chapter "
            "beside the results of softnn, and the commands that make them. It says "
            "which statements of the thesis are found so, and which are contradicted.",
            CAUTION,
            *(
                f"- [{make.__doc__.splitlines()[0]}](chapter-{n}.md)"
                for n, make in CHAPTERS.items()
                if make.__doc__
            ),
        ]
    )


def _chapter(title: str | None, says: str, study: Sequence[str], *parts: str) -> str:
    return "\n\n".join(
        [
            f"# {title}",
            says,
            CAUTION,
            *parts,
            made_by(study),
            _commands(study),
        ]
    )


def made_by(studies: Sequence[str]) -> str:
    """What each result of a chapter was made with, and which figures moved since."""
    lines = []
    for file in sorted(f for s in studies for f in RESULTS.glob(f"{s}*.json")):
        if file.stem in studies or file.stem.split("-")[0] in studies:
            said = [made_with(result(file.stem)), moved(RESULTS, file.stem)]
            lines.append(f"- `{file.stem}.json`: {' '.join(filter(None, said))}")
    return "\n".join(["## How the figures were made", "", *lines])


def printed(id: str) -> str:
    """Return a published table unchanged, with its units and oddities."""
    t = table(id)
    plain = [k for r in t.rows for k in r if k not in t.units]
    keys = list(dict.fromkeys([*plain, *t.units]))
    rows = [[_cell(r.get(k)) for k in keys] for r in t.rows]
    heads = [_head(k, t.units.get(k, "")) for k in keys]
    return "\n\n".join([f"## Table {id}: {t.what}", markdown(heads, rows), remarks(id)])


def _head(key: str, unit: str) -> str:
    """A column's name with its unit; "specimens at 50 mm/min" is both."""
    unit, name = unit.split(",")[0], key.replace("_", " ")
    if unit.startswith(name.split()[0]):
        return unit
    return f"{name} [{unit}]" if unit else name


def remarks(id: str) -> str:
    """Return the oddities of a published table, in lines."""
    return "\n".join(f"- {note}" for note in table(id).notes)


def _cell(value: Any) -> str | None:
    if isinstance(value, list):
        return " to ".join(f"{v:g}" for v in value)
    return value if value is None or isinstance(value, str) else f"{value:g}"


def gait() -> str:
    """3 Ranges of motion, as a designer needs them"""
    body = result("gait")
    rows = [
        [n["studies"], "; ".join(f"{a:g} to {b:g}" for a, b in n["ranges"]) or None]
        for n in body["by_studies"]
    ]
    head, strip = body["headline"], body["strip"]
    return _chapter(
        gait.__doc__,
        "Clinical studies of walking give the knee's range by age group; where several "
        "agree, an assistive device can be laid out.",
        ["gait"],
        "## What the thesis says, and what is found",
        claims.written(claims.motion(body)),
        printed("3.1"),
        "## What studies agree on",
        f"Ages {head['group_low']:g} to {head['group_high']:g}; degrees of the knee.",
        markdown(["studies that all contain it", "range [degree]"], rows),
        f"A strip on a pulley of {strip['radius_mm']:.3g} mm is then strained by "
        f"{strip['strain_range']:.3g}, and at 50 turns a minute by "
        f"{strip['rate_at_50_rpm_per_s']:.3g} a second: "
        f"{strip['rate_over_fastest_test']:.3g} times the fastest tensile test of the "
        "thesis.",
        "## Mean range of motion",
        "Section 3.2.2 takes the mean over studies of the range of motion, and the "
        "greatest deviation of a study from it. Of the hip the thesis prints these two "
        "alone. The pulley is the one at which the mean range is the working range of "
        "a strip of 33 mm.",
        gait_shown.motions(body["motion"]),
        "## Figs 3.1 and 3.2: torque",
        "The thesis draws torque, angle and power of several activities and prints no "
        "values of them. It reads off Fig. 3.1b that the knee needs about twice the "
        "torque to ascend stairs as to descend them, in the opposite direction, and "
        "advises a pair of opposed actuators. The values are those of the clinical "
        "studies that it cites, which are not in this project: softnn neither "
        "reproduces nor contradicts this.",
        _pictures(3),
    )


def characterization() -> str:
    """4 Seven materials, pulled and held"""
    body = result("properties")
    head = body["headline"]
    real = [k for k, v in body.items() if isinstance(v, dict) and "tensile" in v]
    return _chapter(
        characterization.__doc__,
        "Tensile tests to failure at up to three speeds and stress relaxation give "
        "each material's elastic and viscous properties, after eight steps of "
        "preparation (`softnn.prepare`).",
        ["virtual_specimens", "properties"],
        printed("4.1"),
        f"Of {head['virtual_properties']} properties of Tables 4.2 and 4.4, "
        f"{percent(head['virtual_within_10_percent'], 0)} lie within 10 % of the "
        f"published; {head['virtual_above_25_percent']} do not lie within 25 %.",
        properties.virtual_report(body["virtual"]),
        "## Oddities in Table 4.2",
        remarks("4.2"),
        printed("4.3"),
        "## Oddities in Table 4.4",
        remarks("4.4"),
        "The same properties of real recordings (" + ", ".join(real) + ") are in "
        "`studies/results/properties.json`, or as text from the command.",
        _pictures(4),
    )


def piecewise() -> str:
    """5 Piecewise-linear viscoelastic models"""
    best = {m["material"]: m for m in result("accuracy")["materials"]}
    rates = {m["material"]: m for m in result("rates")["materials"]}
    return _chapter(
        piecewise.__doc__,
        "A spring whose stiffness is a step function of strain, beside one Maxwell "
        "branch (PL-SLS) or several (PL-Wiechert); the branches are read off "
        "relaxation tests, the springs off one tensile test. Errors are NRMSE.",
        ["branches", "segments", "accuracy", "rates"],
        "## What the thesis says, and what is found",
        claims.written(
            claims.piecewise(result("accuracy"), result("rates"), result("segments"))
        ),
        "## Table 5.1: how well can one curve be described?",
        _one_curve(best),
        "*Negative*: branches of negative stiffness that collocation gives, which no "
        "network of springs can have. The thesis prints no stiffnesses of branches.",
        remarks("5.1"),
        "## Table 5.2: rates never fitted",
        _other_rates(rates),
        "*Decaying part*: the relaxation time of PL-SLS is where the part of the "
        "stress that decays has fallen to 36.8 %. *As the text says*: where the "
        "stress has fallen to 36.8 % of sigma_o, its initial value, or is nearest to "
        "that. Most holds never fall so far. PL-Wiechert has its times by "
        "collocation, so that it has no such column.",
        remarks("5.2"),
        "## Tables 5.1 and 5.2 beside Tables 4.2 and 4.4",
        *_apart(best, rates),
        "## Std. Lin. SDS",
        "The predecessor of both models on the same curves, at 20 equal segments. The "
        "literature has 13.6 % for it, on another material.",
        _sds(best, rates),
        "## Real recordings",
        _real_rates(),
        _pictures(5),
    )


FITTED = "springs and branches fitted to all rates together"
APART = "each rate predicted from the others"


def _one_curve(best: Row) -> str:
    """Table 5.1, published and found."""
    heads = ["material and model"]
    heads += ["NRMSE published", "found", "segments published", "found"]
    heads += ["tolerance published", "found", "branches published", "found", "negative"]
    rows = []
    for name, model in pairs():
        b = best[name]["best"][model]
        p = b["published"]
        rows.append(
            [
                f"{name}, {model}",
                percent(p["nrmse"]),
                percent(b["nrmse"]),
                p["segments"],
                b["segments"],
                percent(p["tolerance"], 0),
                percent(b["tolerance"], 0),
                p["branches"],
                b["branches"],
                b["negative_branches"],
            ]
        )
    return markdown(heads, rows)


def _other_rates(rates: Row) -> str:
    """Table 5.2, published and found in every reading."""
    rows = []
    for name, model in pairs():
        r = rates[name]["models"][model]
        rows.append(
            [
                f"{name}, {model}",
                percent(r["published"]),
                percent(r["as_in_thesis"]["generalisation_error"]),
                percent(r["as_stated"] and r["as_stated"]["generalisation_error"]),
                percent(r["any_reading"]["generalisation_error"]),
                percent(r["joint"] and r["joint"]["nrmse_over_rates"]),
                _apart_error(r),
            ]
        )
    return markdown(
        [
            "material and model",
            "published",
            "found, decaying part",
            "found, as the text says",
            "any reading of the branches",
            FITTED,
            APART,
        ],
        rows,
    )


def _apart_error(model: Row) -> str | None:
    found = model["each_rate_from_the_others"]
    return percent(found and found["nrmse"])


def _real_rates() -> str:
    """The same of real recordings."""
    rows = []
    for path in sorted(RESULTS.glob("rates-*.json")):
        for m in result(path.stem)["materials"]:
            for model in PL:
                r = m["models"][model]
                thesis = percent(r["as_in_thesis"]["generalisation_error"])
                joint = percent(r["joint"] and r["joint"]["nrmse_over_rates"])
                rows.append([m["label"], model, thesis, joint, _apart_error(r)])
    return markdown(["recordings", "model", "decaying part", FITTED, APART], rows)


def _sds(best: Row, rates: Row) -> str:
    """Std. Lin. SDS beside both models: on one curve, and over rates."""
    rows = []
    for name in MATERIALS:
        (old,) = [v for k, v in best[name]["rivals"].items() if k.startswith("Std.")]
        over = rates[name]["models"]
        rows.append(
            [
                name,
                percent(old),
                *(percent(best[name]["best"][m]["nrmse"]) for m in PL),
                percent(rates[name]["std_lin_sds"]),
                *(percent(over[m]["as_in_thesis"]["generalisation_error"]) for m in PL),
            ]
        )
    heads = ["material", "one curve: Std. Lin. SDS", *PL]
    return markdown([*heads, "over rates: Std. Lin. SDS", *PL], rows)


def pairs() -> list[tuple[str, str]]:
    """Every material with each piecewise-linear model."""
    return [(name, model) for name in MATERIALS for model in PL]


def _apart(best: Row, rates: Row) -> tuple[str, ...]:
    """What Tables 5.1 and 5.2 ask of specimens that have Tables 4.2 and 4.4."""
    rows, more = [], dict.fromkeys(PL, 0)
    never: list[list[str | None]] = []
    able = []
    for name, model in pairs():
        slow, *_, fast = material(name).elastic.values()
        r = rates[name]["models"][model]
        soft, published = r["softened"], r["published"]
        found = r["as_in_thesis"]["generalisation_error"]
        more[model] += found > published and soft["share"] < 1
        if soft["generalisation_error"] > published:
            joint = r["joint"] and r["joint"]["nrmse_over_rates"]
            able += [f"{name} ({model})"] if joint and joint <= published else []
            errors = published, soft["generalisation_error"], joint
            never.append([f"{name}, {model}", *map(percent, errors)])
        rows.append(
            [
                f"{name}, {model}",
                *(f"{fast[k] / slow[k]:.2f}" for k in ("E_small", "E_large")),
                percent(published),
                percent(found),
                percent(soft["generalisation_error"]),
                percent(soft["share"], 0),
            ]
        )
    texture = [
        best[name]["best"][model]["published"]["nrmse"]
        / best[name]["best"][model]["nrmse"]
        for name, model in pairs()
    ]
    return (
        "The virtual specimens have the stiffness at each rate of Table 4.2 and the "
        "relaxation of Table 4.4. With branches from that relaxation the stress of "
        f"{more['PL-SLS']} of the {len(MATERIALS)} materials by PL-SLS, and of "
        f"{more['PL-Wiechert']} by PL-Wiechert, depends on the rate more than the "
        "stiffness does: a *share* of the stiffness of their branches, in the last "
        "column, errs less.",
        markdown(
            [
                "material and model",
                "fastest over slowest: E small",
                "E large",
                "error published (5.2)",
                "found, all of the branches",
                "with the share",
                "share",
            ],
            rows,
        ),
        "For these no share gives as small an error as the published one. Springs and "
        "branches that are fitted to the curves of all rates together, without the "
        f"relaxation tests, reach it for {', '.join(able) or 'none'}: there the curves "
        "alone allow the published error, and the relaxation does not.",
        markdown(
            ["material and model", "published", "with the share", "fitted together"],
            never,
        ),
        "Tables 4.2 and 4.4 were kept, since they are measurements.",
        f"The published errors of Table 5.1 are {min(texture):.2g} to "
        f"{max(texture):.2g} times those found, {median(texture):.2g} at the median: "
        "they are of the texture of measured curves, which a mean of virtual specimens "
        "has not. No other table says anything of it. Texture made up until 5.1 comes "
        "out would show nothing but itself, and add to the scatter that Table 6.6 has.",
    )


def networks() -> str:
    """6 Small neural networks"""
    return _chapter(
        networks.__doc__,
        "Networks of one hidden layer of 1 to 20 neurons, by Bayesian regularisation "
        "and ten-fold cross-validation. Folds drawn at random put neighbours in time "
        "on both sides, so they tell how well a network interpolates: whole specimens "
        "and whole rates left out stand beside. Every error is an NRMSE, with R2 in "
        "brackets.",
        ["inputs", "feedback", "neurons", "grid", "natr", "regularisation"],
        "## What the thesis says, and what is found",
        claims.written(claims.networks(*(result(name) for name in claims.CHAPTER_6))),
        "## Section 6.4.1: which inputs?",
        "Figs 6.2 and 6.3 of the thesis: 20 neurons, a tenth of the samples, drawn at "
        "random. " + inputs.NOTE,
        _inputs("random"),
        "The same at rates never seen:",
        _inputs("rate"),
        "## Section 6.4.1: stress as an input",
        feedback.report(result("feedback")["materials"]),
        *_missing(result("feedback")["materials"], "feedback"),
        f"{feedback.DRAWN}: " + feedback.sentence(result("feedback")["headline"]),
        "![a network on measured stress, and on its own](feedback.png)",
        printed("6.2"),
        "## Table 6.6: how many neurons?",
        _counts(),
        "*Fewest as good*: the fewest neurons with an R2 within one standard error of "
        "the largest. From there to 20 neurons the errors tie, and which of them is "
        "the largest R2 is chance, in the thesis and here.",
        _few_at_rates(),
        remarks("6.6"),
        "## Figs 6.4 to 6.6 for every input and regularisation",
        *_grid(result(GRID)),
        "## NatR: 25 % by all samples, 5 % by a tenth?",
        "The thesis does not say how it took the tenth. *Scatter alone* is what the "
        "mean stress of these specimens leaves, at each strain and rate. Every tenth "
        "sample of each way is taken.",
        natr.report(result("natr")["ways"]),
        _of_specimens(result("natr")),
        natr.sentence(result("natr")["headline"]),
        "## Which regularisation?",
        "20 neurons and a tenth of the samples, so that there is something to overfit. "
        f"The L2 weight is the best of {result(REGULARISATION)['l2_trials']}; all "
        "three ways are judged on random folds that no choice has seen.",
        _regularisation(),
        _pictures(6),
    )


def _missing(found: Iterable[str], study: str) -> list[str]:
    """A sentence on materials that a result lacks."""
    rest = [name for name in MATERIALS if name not in set(found)]
    if not rest:
        return []
    return [f"Not computed yet: {', '.join(rest)} (`python -m studies.{study}`)."]


def _grid(found: Row) -> list[str]:
    """The whole grid: least errors, errors at unseen rates, and the picture."""
    materials, given = found["materials"], found["settings"]
    first, *_, last = given["neurons"]
    return [
        f"{first} to {last} neurons, {len(PUBLISHED)} inputs and {len(WAYS)} ways of "
        f"regularisation, {given['folds']} random folds each; {given['samples']} "
        f"samples of a recording, and a lag is one of them; L2 weight {WEIGHT:g}.",
        f"![error by neurons for every input and regularisation]({GRID}.png)",
        "The least error of each line. In brackets: its neurons, and the fewest "
        f"neurons within {percent(compared.ENOUGH - 1, 0)} of it.",
        compared.summary(materials),
        "The same networks at rates never seen: the median over the counts of neurons.",
        compared.summary(materials, compared.middle, "unseen"),
        *_missing([m["material"] for m in materials], "grid"),
    ]


def _scored(error: float | None, r2: float | None) -> str | None:
    """An error with its R2, as fractions; None where there is none."""
    return None if error is None or r2 is None else f"{percent(error)} ({percent(r2)})"


def _counts() -> str:
    """Table 6.6, published and found."""
    rows = []
    for m in result("neurons-all")["materials"]:
        h, name = m["headline"], m["material"]
        p = table("6.6").row(material=name, model="ANN")
        springs = m["baselines"]["PL-Wiechert"]["like_for_like"]
        rows.append(
            [
                name,
                f"{p['neurons']}",
                f"{h['neurons']}",
                f"{h['neurons_few']}",
                f"{p['generalisation_error']:g} % ({p['r2']:g} %)",
                *(
                    _scored(h.get(f"nrmse_{split}"), h.get(f"r2_{split}"))
                    for split in ("random", "specimen", "rate")
                ),
                *(
                    _scored(of.get("nrmse"), of.get("r2"))
                    for of in (springs[k]["as_in_thesis"] for k in ("specimen", "rate"))
                ),
            ]
        )
    return markdown(
        [
            "material",
            "neurons published",
            "found, largest R2",
            "fewest as good",
            "random folds published",
            "found",
            "specimens never seen",
            "rates never seen",
            "PL-Wiechert, specimens",
            "PL-Wiechert, rates",
        ],
        rows,
    )


def _of_specimens(found: Row) -> str:
    """How much a tenth in whole specimens of each rate is, rounded up at each."""
    ways = {row["way"]: row for row in found["ways"]}
    one, every = ways[natr.SPECIMENS], ways[natr.AT_RANDOM]
    whole = table("6.2").row(material=natr.MATERIAL)["total"]
    share = one["samples"] * found["thin"] / whole
    return (
        f"*{natr.SPECIMENS[0].upper()}{natr.SPECIMENS[1:]}*, rounded up: "
        f"{one['specimens']} of {every['specimens']}, with {percent(share, 1)} of the "
        "samples."
    )


def _few_at_rates() -> str:
    """Errors of the fewest neurons at rates never seen, in words."""
    found = {m["material"]: m["headline"] for m in result("neurons-all")["materials"]}
    errors = {k: f"{percent(h['nrmse_rate_few'])}" for k, h in found.items()}
    return f"At rates never seen the fewest have {claims.listed(errors)}."


def _regularisation() -> str:
    """NRMSE and R2 of each way of regularisation, on folds drawn anew."""
    rows = []
    for m in result(REGULARISATION)["materials"]:
        anew = max(t["folds_seed"] for t in m["trials"])
        mine = {t["regularisation"]: t for t in m["trials"] if t["folds_seed"] == anew}
        scores = [_scored(mean(mine[w]["nrmse"]), mine[w]["r2_mean"]) for w in WAYS]
        weight = f"{m['headline']['l2_weight']:.1e}"
        ties = claims.least({k: t["nrmse"] for k, t in mine.items()})
        rows.append([m["material"], *scores, weight, ", ".join(ties)])
    return markdown(["material", *WAYS, "L2 weight", "least error, with ties"], rows)


def _inputs(split: str) -> str:
    """NRMSE and R2 of each input architecture on each material."""
    rows = []
    for m in result("inputs-all")["materials"]:
        mine = {t["inputs"]: t for t in m["trials"] if t["split"] == split}
        scores = [
            _scored(mean(mine[k]["nrmse"]), mine[k]["r2_mean"]) for k in PUBLISHED
        ]
        ties = claims.least({k: t["nrmse"] for k, t in mine.items()})
        rows.append([m["material"], *scores, ", ".join(ties)])
    return markdown(["material", *PUBLISHED, "least error, with ties"], rows)


def actuator() -> str:
    """7 A tendon of strips, and networks in real time"""
    strips, real, loop = result("tendon"), result("realtime"), result("actuator")
    return _chapter(
        actuator.__doc__,
        "How many strips are as stiff as a human tendon, what a network answers to a "
        "sine in real time, and what a controller loses by each model of the strips.",
        ["tendon", "realtime", "actuator", "survivor"],
        printed("7.1"),
        "## Table 7.2: strips as stiff as a tendon\n\nFound:",
        tendon.report(strips),
        "Published:",
        printed("7.2").split("\n\n", 1)[1],
        "![strips as stiff as a tendon](tendon.png)",
        "## Section 7.3: networks fed with a sine",
        "The thesis feeds one network and prints no values. Here "
        f"{real['headline']['networks']} networks are trained that differ in their "
        "starting weights alone, since one of them proves little.",
        claims.written(claims.real_time(real)),
        "By what is fed as the rate, beside what the thesis saw:",
        realtime.report(real),
        "Networks that survive cycles are in [the survivor](../survivor.md).",
        printed("7.3"),
        "## Section 7.4: in the loop",
        "Torque and knee angle are made up: the thesis takes both from recorded "
        "motion and prints none of it. They are one stride a second, with the peak "
        "torque of Table 7.3 and the largest speed that section 7.4 states. So the "
        "errors compare models of the strips; they are no errors of a knee.",
        markdown(
            ["model of the strips", "rms error of the torque", "largest"],
            [
                [m["model"], percent(m["rms_error"]), percent(m["largest_error"], 1)]
                for m in loop["models"]
            ],
        ),
        "![torque in the loop, by model of the strips](actuator.png)",
        _pictures(7),
    )


def rest() -> str:
    """8 What the thesis left to others: dynamic tests"""
    body = result("dynamic")
    return _chapter(
        rest.__doc__,
        "Section 8.3 asks for dynamic mechanical analysis. Sines of strain go into "
        "models of tensile tests, and real recordings of cycles are read in the same "
        "way: the storage modulus E' is what comes back, the loss modulus E'' what is "
        "lost, tan delta their ratio. A model with a negative loss modulus gives back "
        "more work than it takes.",
        ["dynamic"],
        "The networks were taught by loading at 0.025 to 0.25 a second, which this "
        "sine reaches from 0.08 to 0.8 Hz, and never saw it unload.",
        "## Models and recordings",
        "![moduli over frequency](dynamic.png)",
        dynamic_shown.report(body),
        "Of your own: `python -m studies.dynamic --model model.json`, and "
        "`--recordings FILE`; in Python `softnn.dynamic.of_recording(recording)` and "
        "`softnn.dynamic.sweep(model, frequencies, mean, amplitude)`.",
        "## The rest of section 8.3",
        FUTURE,
    )


FUTURE = """\
- *Hysteresis and cycles*: recordings that unload are fitted and diagnosed, and the
  [survivor](../survivor.md) compares models on cycles.
- *Creep*: no study. Models take a strain and give a stress, a creep test is the other
  way round, and no creep test of these materials exists to compare with.
- *Inputs without the rate, radial and recurrent networks*: in
  [the search over architectures](../architectures.md).
- *Synthetic data*: `python -m studies.augmentation`.
- *Parallel elasticity, co-contraction, variable recruitment, muscle redundancy*: no
  study. They are designs of an actuator, not models of a material. The thesis gives
  neither a load nor a control law for them, so every figure would be made up. The
  blocks are there (`softnn.actuator`, `softnn.motor`) for those who have both."""

CHAPTERS: dict[int, Callable[[], str]] = {
    3: gait,
    4: characterization,
    5: piecewise,
    6: networks,
    7: actuator,
    8: rest,
}
