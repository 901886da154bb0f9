"""Which network to take for which use, material by material: a page.

`python -m studies.architectures_page` writes docs/architectures.md, its figures and the
table in README.md from the files architectures-*.json in studies/results alone; real
recordings come first.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.architectures import unseen
from bench.architectures.choices import (
    FINALISTS,
    USES,
    folds_of,
    rival_of,
    standard_error,
    worse_by,
)
from bench.architectures.report import answers, draw, table
from bench.checking import moved
from softnn.search.samplers import STARTUP
from softnn.study import common

ROOT = Path(__file__).resolve().parents[2]
MADE = (
    "Made by `python -m studies.architectures_page` from `studies/results`; no number "
    "here is typed. NRMSE is the error over the root mean square of the stress: 10 % "
    "means that the error is typically a tenth of the stress. It is the mean over "
    "folds, +- one standard error. A dash stands where a model cannot be fitted: a PL "
    "model needs holds, or two rates.",
    "How a network is chosen: the search ends with "
    f"the {FINALISTS} best networks for each use. These are trained again with other "
    "random folds and other starting weights. Of the networks that tie with the best "
    "the one with the fewest weights is chosen. A tie means: behind by at most one "
    "standard error of the paired difference over folds, and by at most one of the "
    "best itself. The error shown is that of a further training with new random folds "
    "and weights. The rates or recordings held out stay the same, so that error is a "
    "little flattered.",
    "Piecewise-linear models (PL) and boosted trees are fitted and chosen on the "
    "training recordings of each fold alone.",
    "A search begins with every architecture at 4 and 12 neurons, with Bayesian "
    "regularisation if the architecture has it. It draws at random up to trial "
    f"{STARTUP}, and then near the networks that are best in one error for a given "
    "other one (the *front*). A search of fewer trials compares architectures, but "
    "hardly neurons or regularisation.",
)
ABOUT = (
    "This page is for those who want a network and ask which one. There are two "
    "answers for each material: for recordings you have (first table), and for rates "
    "or recordings never seen (second table). Beside each stands the best of "
    "piecewise-linear models and trees. The corrected model of `softnn diagnose` is "
    "not in these tables: compare it on a recording that you left out "
    "(`softnn simulate` prints the error).",
    "A controller meets rates that no test had. So take the smallest error of the "
    "second table among the models that have C: FFRI, FFRD4, FFH, the convex network "
    "and PL, not GRU and trees. Where errors differ by less than their standard "
    "errors, or no rate was held out, take the convex network, which is bounded at any "
    "rate. If the specimen unloads or hangs slack, train [`taught`](controllers.md) "
    "as well, and compare on a recording that you left out.",
    'For a material of your own run `make neurons ARGS="--data FOLDER"`, with '
    "`--cycles` if your recordings unload. More sets of recordings stand under "
    "[Rates never seen](#rates-never-seen).",
    "- FFRI1, FFRI2, FFRI3: feed-forward networks. Inputs: the strain now; FFRI2 adds "
    "the strain one lag before, FFRI3 that of two lags before.\n"
    "- FFRD4: a feed-forward network of the strain and its rate.\n"
    "- FFH4, FFH7: feed-forward networks of the strain, the largest strain so far and "
    "the filtered past (FFH4: two filters; FFH7: five Maxwell branches).\n"
    "- GRU: a gated recurrent network.\n"
    "- convex network: springs and Maxwell branches whose stiffnesses cannot be "
    "negative, so its stress stays bounded at other rates.\n"
    "- PL: a piecewise-linear spring with one branch (PL-SLS) or several "
    "(PL-Wiechert). *As in the thesis*: branches read off the holds by its rule. *Any "
    "reading of the holds*: by the best of several rules. *Fitted jointly*: springs "
    "and branches together, from the curves. `base.json` of a diagnosis is another "
    "fit, with another error.\n"
    "- bayesian, early-stopping, L2 with its weight: the regularisation of a network.\n"
    "- lag: the time between two inputs of a network, or the unit of its filter times. "
    "The C keeps it in seconds; [down to 1 ms](controllers.md) between samples.\n"
    "- random folds: samples left out at random. Unseen: whole rates, or recordings if "
    "a material has one rate.",
)
ANSWER = 3  # paragraphs above the tables; the others explain words
JUDGED = (
    "Random folds put neighbours in time of one specimen on both sides, so they "
    "measure interpolation. They are the protocol of the thesis. Specimens and rates "
    "never seen are the harder test, and the one that a controller meets."
)
SEARCHED = (
    "Networks of the search, with errors on the folds that chose them: lower than "
    "those above, which come from a new training."
)
PANELS = {  # real recordings first
    "neurons-vhb4910-zhao": "recordings of\nVHB 4910 acrylic tape",
    "neurons-rubber-compression-relaxation": "recordings of\nrubber cylinders",
    "neurons-all": "virtual specimens of\nnatural rubber with polyester",
}
COMMAND = "python -m studies.architectures"

Result = Mapping[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.architectures_page`; returns the exit code."""
    p = common.parser("architectures_page", __doc__)
    p.add_argument(
        "--results", type=Path, default=common.RESULTS, help="where the JSON lies"
    )
    p.add_argument("--out", type=Path, help="folder of docs (this one)")
    a = p.parse_args(argv)
    folder = a.out or (common.RUNS / "smoke" if a.smoke else ROOT)
    return common.guarded(lambda: print(f"written to {make(a.results, folder)}"))


def make(results: Path, folder: Path) -> Path:
    """Write the page and its figures; the path of the page."""
    files = result_files(results)
    docs = folder / "docs"
    (docs / "figures").mkdir(parents=True, exist_ok=True)
    parts = ["# Which network for which use", *ABOUT[:ANSWER]]
    convex = {o["label"]: o for o in read(results / "unseen.json").get("materials", [])}
    parts += summary(files.values(), convex) if files else [f"Not run: `{COMMAND}`."]
    parts += ["## What the words mean, and how this was made", *ABOUT[ANSWER:], *MADE]
    lacks = lacks_of(results)
    for name, found in sections(files).items():
        common.save_figure(draw(found["materials"]), name, docs / "figures")
        (docs / "figures" / f"{name}.svg").unlink()  # a point a trial: no smaller
        parts += [f"## {title_of(found)}", run_of(found), found["made_with"]]
        parts += filter(None, [moved(results, *found["files"])])
        parts.append(f"![both errors of every trial](figures/{name}.png)")
        for one in found["materials"]:
            said = [*answers(one), *worse(one), *lacks.get(one["label"], [])]
            shown = table(one["front"], one["baselines"], f"unseen {one['unseen']}")
            parts += [f"### {one['label']}", listed(said), SEARCHED, shown]
        parts += [f"Left out: {k}: {why}" for k, why in found["left_out"].items()]
    parts += judged(results)
    parts += held_out(results)
    parts += augmented(results)
    page = docs / "architectures.md"
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page


def judged(results: Path) -> list[str]:
    """How good one network is, judged in three ways: the picture and its sources."""
    if not all((results / f"{name}.json").exists() for name in PANELS):
        return []
    made = [
        f"`{name}.json`: {common.made_with(read(results / f'{name}.json'))}"
        for name in PANELS
    ]
    return [
        "## Judged in three ways",
        "![NRMSE of networks and piecewise-linear models](figures/judged.png)",
        JUDGED,
        "\n".join(filter(None, [*made, moved(results, *PANELS)])),
    ]


def held_out(results: Path) -> list[str]:
    """Every model on rates never seen, material by material, if that was judged."""
    found = read(results / "unseen.json")
    if not found:
        return []
    about = (
        "Each material is judged on the rates (recordings, if it has one rate) that "
        "its training leaves out. The convex network and the piecewise-linear models "
        "are chosen inside each training set. The best baseline is the best of these "
        "models and of trees, in hindsight. Free networks have one size. "
        "`python -m studies.unseen` makes this."
    )
    return [
        "## Rates never seen",
        about,
        unseen.sentence(found["materials"]),
        unseen.table(found["materials"]),
        common.made_with(found),
        *filter(None, [moved(results, "unseen")]),
    ]


def result_files(results: Path) -> dict[Path, Result]:
    """Results of real recordings, then of virtual specimens, each by name."""
    found = {file: read(file) for file in sorted(results.glob("architectures*.json"))}
    return dict(sorted(found.items(), key=lambda f: (is_virtual(f[1]), f[0])))


def read(file: Path) -> Result:
    """What a study has found; nothing where it was not run."""
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}


def sections(files: Mapping[Path, Result]) -> dict[str, Result]:
    """Results by the name of their figure: the virtual materials are one."""
    found: dict[str, Result] = {
        file.stem: {**one, "made_with": made_with([one]), "files": [file.stem]}
        for file, one in files.items()
        if not is_virtual(one)
    }
    virtual = [one for one in files.values() if is_virtual(one)]
    if virtual:
        seconds = [one["headline"]["study_s"] for one in virtual]
        whole = None if None in seconds else sum(seconds)
        found["architectures-virtual"] = {
            **virtual[0],
            "made_with": made_with(virtual),
            "files": [file.stem for file, one in files.items() if is_virtual(one)],
            "materials": [m for one in virtual for m in one["materials"]],
            "left_out": {k: v for one in virtual for k, v in one["left_out"].items()},
            "headline": {"study_s": whole},
        }
    return found


def is_virtual(found: Result) -> bool:
    return bool(found["settings"]["data"] == "virtual")


def title_of(found: Result) -> str:
    given = found["settings"]
    if is_virtual(found):
        return "Virtual specimens of the materials of the thesis"
    cycles = ", whole cycles" if given["cycles"] else ""
    return f"Real recordings{cycles}: {given['data']}"


def run_of(found: Result) -> str:
    """How it was run: trials, folds, samples, machine and time."""
    rows = []
    for one in found["materials"]:
        stopped = one["headline"]["trials_stopped"]
        rows.append(f"{one['material']}: {len(one['trials'])}, {stopped} stopped early")
    seconds = found["headline"]["study_s"]
    took = "" if seconds is None else f" In all {seconds:.0f} s."
    given = found["settings"]
    return (
        f"Trials:\n\n{listed(rows)}\n\n{given['folds']} random folds, at most "
        f"{given['samples']} samples a recording; {found['machine']}." + took
    )


def made_with(found: Iterable[Result]) -> str:
    """Version, commit and date of results: a sentence for each that differs."""
    return " ".join(dict.fromkeys(map(common.made_with, found)))


def summary(found: Iterable[Result], convex: Mapping[str, Result]) -> list[str]:
    """Return a table for each use, a row a material: the network, and the best other.

    `convex` holds rows of `studies.unseen` by label, for the convex network.
    """
    rows: dict[str, list[list[str | None]]] = {use: [] for use in USES}
    for file in found:
        for one in file["materials"]:
            kind = "virtual" if is_virtual(file) else file["settings"]["data"]
            for use in USES:
                chosen = one["choices"][use]
                row = [one["material"], kind + ", cycles" * file["settings"]["cycles"]]
                row += [one["unseen"]] if use == "unseen" else []
                row += [chosen["words"], pm(folds_of(chosen["anew"], use))]
                if use == "unseen":
                    beside = convex.get(one["label"])
                    row.append(beside and pm(np.array(beside["convex"])))
                rows[use].append([*row, rival_cell(one, use)])
    header = ["material", "recordings"]
    searched = ["network of the search", "NRMSE"]
    return [
        "**For recordings you have** (random folds):",
        common.markdown([*header, *searched, "best other"], rows["random"]),
        "**For rates or recordings never seen**. Where the column *held out* says "
        "recording, nothing is known about other rates:",
        common.markdown(
            [*header, "held out", *searched, "convex network", "best other"],
            rows["unseen"],
        ),
    ]


def rival_cell(one: Result, use: str) -> str | None:
    rival = rival_of(one["baselines"], use)
    if rival is None:
        return None
    return f"{rival['model']} {common.percent(float(np.mean(rival[use])), 1)}"


def listed(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def worse(one: Result) -> list[str]:
    """A line that a piecewise model is better on unseen data, if it is."""
    found = worse_by(one)
    if found is None:
        return []
    model, gap = found
    model += "," * ("," in model)
    return [
        f"**{model} predicts a {one['unseen']} never seen better than the network "
        f"chosen**, by {common.percent(gap, 1)} of the stress."
    ]


def lacks_of(results: Path) -> dict[str, list[str]]:
    """Diagnosis of the network where it is worst, by material: see `studies.lacks`."""
    found = read(results / "lacks.json")
    return {
        label: [
            f"Diagnosis of the network where it is worst, {one['unseen']} "
            f"({one['network']}; `python -m studies.lacks`). {one['sentence']} "
            + common.made_with({**found, **one})
        ]
        for label, one in found.get("materials", {}).items()
    }


def augmented(results: Path) -> list[str]:
    """Return the part on training with simulated recordings added."""
    found = read(results / "augmentation.json")
    if not found:
        return []
    head = found["headline"]
    rows = [
        [
            row["label"],
            row["inputs"],
            row["unseen"],
            pm(np.array(row["without"])),
            pm(np.array(row["with"])),
            f"{100 * row['gain']:.1f} +- {100 * row['gain_error']:.1f} %",
        ]
        for row in real_first(found["networks"])
    ]
    header = ["material", "inputs", "unseen", "without", "with", "gain, paired"]
    return [
        "## Recordings simulated by a fitted model, added to training",
        f"{found['neurons']} neurons, Bayesian regularisation, judged on rates or "
        "recordings never seen (section 8.3 of the thesis; `python -m "
        "studies.augmentation`). By more than one standard error over folds it helps "
        f"{head['helped']} and harms {head['harmed']} of {head['networks']} networks. "
        f"{common.made_with(found)}",
        *filter(None, [moved(results, "augmentation", "lacks")]),
        common.markdown(header, rows),
        *(f"Left out: {label}: {why}" for label, why in found["left_out"].items()),
    ]


def real_first(rows: Sequence[Result]) -> list[Result]:
    """Rows of real recordings, then those of virtual specimens."""
    return sorted(rows, key=lambda row: "virtual specimens" in row["label"])


def pm(errors: np.ndarray) -> str:
    """Mean and its standard error, in per cent.

    >>> pm(np.array([0.1, 0.3]))
    '20.0 +- 10.0 %'
    """
    spread = standard_error(errors) if len(errors) > 1 else 0.0
    return f"{100 * errors.mean():.1f} +- {100 * spread:.1f} %"
