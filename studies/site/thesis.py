"""The thesis, chapter by chapter: its tables beside what the studies find.

The studies use virtual specimens, which were calibrated to Tables 4.1 to 4.4. Agreement
there is no measurement. Figures of real recordings are separate and say so.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import mean, median, stdev
from typing import Any

from bench.checking import moved
from softnn.materials import MATERIALS, material, table
from softnn.neural import PUBLISHED
from softnn.study.common import made_with, markdown, percent
from softnn.study.tendon_match import Row
from studies import feedback, inputs, natr
from studies.shown import dynamic as dynamic_shown
from studies.shown import gait as gait_shown
from studies.shown import properties, realtime, tendon

RESULTS = Path(__file__).parents[1] / "results"
PL = ("PL-SLS", "PL-Wiechert")
REGULARISATION = "regularisation-all"
WAYS = ("bayesian", "early-stopping", "l2")
PICTURES = ("feedback", "dynamic")  # of studies, shown on the pages
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
    return {f"thesis/{p}.png": (RESULTS / f"{p}.png").read_bytes() for p in PICTURES}


def _index() -> str:
    return "\n\n".join(
        [
            "# The thesis, chapter by chapter",
            "*Modelling and Characterization of Soft Materials for Bio-inspired "
            "Series-elastic Actuators* (PhD thesis, 2020) measured seven materials, "
            "fitted piecewise-linear viscoelastic models and small networks to them, "
            "and tested them in an actuator. These pages are for readers who compare "
            "softnn with the thesis: each has the tables of a chapter, the results of "
            "softnn, and the command that makes them.",
            CAUTION,
            *(
                f"- [{make.__doc__.splitlines()[0]}](chapter-{n}.md)"
                for n, make in CHAPTERS.items()
                if make.__doc__
            ),
        ]
    )


def _chapter(title: str | None, says: str, study: Sequence[str], *parts: str) -> str:
    commands = "\n".join(f"python -m studies.{s}" for s in study)
    return "\n\n".join(
        [
            f"# {title}",
            says,
            CAUTION,
            *parts,
            made_by(study),
            "## The commands",
            f"```\n{commands}\n```",
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
    )


def piecewise() -> str:
    """5 Piecewise-linear viscoelastic models"""
    best = {m["material"]: m for m in result("accuracy")["materials"]}
    rates = {m["material"]: m for m in result("rates")["materials"]}
    one, two, three = [], [], []
    for name in MATERIALS:
        for model in PL:
            b = best[name]["best"][model]
            p = b["published"]
            one.append(
                [
                    f"{name}, {model}",
                    percent(p["nrmse"]),
                    percent(b["nrmse"]),
                    p["segments"],
                    b["segments"],
                    p["branches"],
                    b["branches"],
                ]
            )
            r = rates[name]["models"][model]
            two.append(
                [
                    f"{name}, {model}",
                    percent(r["published"]),
                    percent(r["as_in_thesis"]["generalisation_error"]),
                    percent(r["any_reading"]["generalisation_error"]),
                    percent(r["joint"] and r["joint"]["nrmse_over_rates"]),
                    percent(
                        r["each_rate_from_the_others"]
                        and r["each_rate_from_the_others"]["nrmse"]
                    ),
                ]
            )
    for path in sorted(RESULTS.glob("rates-*.json")):
        for m in result(path.stem)["materials"]:
            for model in PL:
                r = m["models"][model]
                three.append(
                    [
                        m["label"],
                        model,
                        percent(r["as_in_thesis"]["generalisation_error"]),
                        percent(r["joint"] and r["joint"]["nrmse_over_rates"]),
                        percent(
                            r["each_rate_from_the_others"]
                            and r["each_rate_from_the_others"]["nrmse"]
                        ),
                    ]
                )
    fitted = "springs and branches fitted to all rates together"
    apart = "each rate predicted from the others"
    return _chapter(
        piecewise.__doc__,
        "A spring whose stiffness is a step function of strain, beside one Maxwell "
        "branch (PL-SLS) or several (PL-Wiechert); the branches are read off "
        "relaxation tests, the springs off one tensile test. Errors are NRMSE.",
        ["segments", "accuracy", "rates", "branches"],
        "## Table 5.1: how well can one curve be described?",
        markdown(
            [
                "material and model",
                "NRMSE published",
                "found",
                "segments published",
                "found",
                "branches published",
                "found",
            ],
            one,
        ),
        remarks("5.1"),
        "## Table 5.2: rates never fitted",
        markdown(
            [
                "material and model",
                "published",
                "found, as in the thesis",
                "any reading of the branches",
                fitted,
                apart,
            ],
            two,
        ),
        remarks("5.2"),
        "## Why these cannot hold beside Tables 4.2 and 4.4",
        *_apart(best, rates),
        "## Real recordings",
        markdown(["recordings", "model", "as in the thesis", fitted, apart], three),
    )


def _apart(best: Row, rates: Row) -> tuple[str, str, str]:
    """What Tables 5.1 and 5.2 ask of specimens that have Tables 4.2 and 4.4."""
    rows, more, never = [], 0, []
    for name in MATERIALS:
        slow, *_, fast = material(name).elastic.values()
        r = rates[name]["models"]["PL-Wiechert"]
        soft = r["softened"]
        more += r["as_in_thesis"]["generalisation_error"] > r["published"]
        never += [name] * (soft["generalisation_error"] > r["published"])
        rows.append(
            [
                name,
                *(f"{fast[k] / slow[k]:.2f}" for k in ("E_small", "E_large")),
                percent(r["published"]),
                percent(r["as_in_thesis"]["generalisation_error"]),
                percent(soft["generalisation_error"]),
                percent(soft["share"], 0),
            ]
        )
    each = [best[name]["best"][model] for name in MATERIALS for model in PL]
    texture = [b["published"]["nrmse"] / b["nrmse"] for b in each]
    return (
        "The virtual specimens have the stiffness at each rate of Table 4.2 and the "
        "relaxation of Table 4.4. With branches from that relaxation the stress of "
        f"{more} of the {len(rows)} materials depends on the rate more than the "
        "stiffness does. The published error of Table 5.2 would need branches with "
        "the *share* of their stiffness in the last column. For some materials "
        f"({', '.join(never)}) no share gives so small an error, because the "
        "stiffness itself changes with the rate. So Tables 4.2 and 4.4 were kept.",
        markdown(
            [
                "PL-Wiechert",
                "fastest over slowest: E small",
                "E large",
                "error published (5.2)",
                "found, all of the branches",
                "with the share",
                "share",
            ],
            rows,
        ),
        f"The published errors of Table 5.1 are {min(texture):.2g} to "
        f"{max(texture):.2g} times those found, {median(texture):.2g} at the median: "
        "they are of the texture of measured curves, which a mean of virtual specimens "
        "has not. No other table says anything of it. Texture made up until 5.1 comes "
        "out would show nothing but itself, and add to the scatter that Table 6.6 has.",
    )


def networks() -> str:
    """6 Small neural networks"""
    body = result("neurons-all")
    rows = []
    for m in body["materials"]:
        h, name = m["headline"], m["material"]
        p = table("6.6").row(material=name, model="ANN")
        rows.append(
            [
                name,
                f"{p['neurons']}",
                f"{h['neurons']}",
                f"{h['neurons_few']}",
                f"{p['generalisation_error']:g} %",
                percent(h["nrmse_random"]),
                percent(h["nrmse_specimen"]),
                percent(h["nrmse_rate"]),
                percent(h["nrmse_pl_wiechert_specimen"]),
                percent(h["nrmse_pl_wiechert_rate"]),
            ]
        )
    return _chapter(
        networks.__doc__,
        "Networks of one hidden layer of 1 to 20 neurons, by Bayesian regularisation "
        "and ten-fold cross-validation. Folds drawn at random put neighbours in time "
        "on both sides, so they tell how well a network interpolates: whole specimens "
        "and whole rates left out stand beside.",
        ["inputs", "feedback", "neurons", "natr", "regularisation"],
        "## Section 6.4.1: which inputs?",
        "Figs 6.2 and 6.3 of the thesis: 20 neurons, a tenth of the samples, drawn at "
        "random. " + inputs.NOTE,
        _inputs("random"),
        "The same at rates never seen:",
        _inputs("rate"),
        "## Section 6.4.1: stress as an input",
        feedback.sentence(result("feedback")["headline"]),
        "![a network on measured stress, and on its own](feedback.png)",
        printed("6.2"),
        "## Table 6.6: how many neurons?",
        markdown(
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
        ),
        "*Fewest as good*: the fewest neurons with an R2 within one standard error of "
        "the largest. From there to 20 neurons the errors tie, and which of them is "
        "the largest R2 is chance, in the thesis and here.",
        remarks("6.6"),
        "## NatR: 25 % by all samples, 5 % by a tenth?",
        "The thesis does not say how it took the tenth. *Scatter alone* is what the "
        "mean stress of these specimens leaves, at each strain and rate. Every tenth "
        "sample of each way is taken.",
        natr.report(result("natr")["ways"]),
        natr.sentence(result("natr")["headline"]),
        "## Which regularisation?",
        "20 neurons and a tenth of the samples, so that there is something to overfit. "
        f"The L2 weight is the best of {result(REGULARISATION)['l2_trials']}; all "
        "three ways are judged on random folds that no choice has seen.",
        _regularisation(),
    )


def _regularisation() -> str:
    """NRMSE of each way of regularisation on each material, on folds drawn anew."""
    rows = []
    for m in result(REGULARISATION)["materials"]:
        anew = max(t["folds_seed"] for t in m["trials"])
        folds = {
            t["regularisation"]: t["nrmse"]
            for t in m["trials"]
            if t["folds_seed"] == anew
        }
        errors = [percent(mean(folds[way])) for way in WAYS]
        weight = f"{m['headline']['l2_weight']:.1e}"
        rows.append([m["material"], *errors, weight, ", ".join(least(folds))])
    return markdown(["material", *WAYS, "L2 weight", "least error, with ties"], rows)


def _inputs(split: str) -> str:
    """NRMSE of each input architecture on each material."""
    rows = []
    for m in result("inputs-all")["materials"]:
        folds = {t["inputs"]: t["nrmse"] for t in m["trials"] if t["split"] == split}
        errors = [percent(mean(folds[k])) for k in PUBLISHED]
        rows.append([m["material"], *errors, ", ".join(least(folds))])
    return markdown(["material", *PUBLISHED, "least error, with ties"], rows)


def least(folds: Mapping[str, Sequence[float]]) -> list[str]:
    """What has the least mean over folds, and what is within its standard error.

    >>> least({"a": [1.0, 1.2, 1.4], "b": [1.2, 1.3, 1.4], "c": [2.0, 2.1, 2.2]})
    ['a', 'b']
    """
    best = min(folds.values(), key=mean)
    enough = mean(best) + stdev(best) / len(best) ** 0.5
    return [k for k, v in folds.items() if mean(v) <= enough]


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
        "## Section 7.3: networks fed with a sine",
        realtime.report(real),
        "Networks that survive cycles are in [the survivor](../survivor.md).",
        printed("7.3"),
        "## Section 7.4: in the loop",
        markdown(
            ["model of the strips", "rms error of the torque", "largest"],
            [
                [m["model"], percent(m["rms_error"]), percent(m["largest_error"], 1)]
                for m in loop["models"]
            ],
        ),
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
    )


CHAPTERS: dict[int, Callable[[], str]] = {
    3: gait,
    4: characterization,
    5: piecewise,
    6: networks,
    7: actuator,
    8: rest,
}
