"""What a search says at its end: one table, and a sentence for each of two uses.

Every figure of the table is of samples that nothing in its row has seen. The sentences
compare on the same folds, with the standard error of the paired difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bench.architectures.choices import paired, standard_error
from softnn.study.common import markdown, percent
from softnn.study.holding import NAME as CONVEX

Row = Mapping[str, Any]
"""model, and under "random", "specimen" (perhaps) and "unseen" its NRMSE by fold or why
there is none; under "r2" the same of R2. `chosen_by` is a use whose folds chose it."""

HEADS = {"random": "random folds", "specimen": "by specimen", "whole": "as simulated"}
TWICE = ("random", "unseen")  # splits with R2 beside NRMSE
BASELINE = "the best baseline"
POOR = 0.2  # of the stress
SMALL = 0.0005  # of the stress: what no decimal of a per cent shows


def best_of(rows: Sequence[Row], use: str) -> Row | None:
    """The row of least mean error for a use, if any has one."""
    able = [row for row in rows if not isinstance(row.get(use, ""), str)]
    return min(able, key=lambda row: float(np.mean(row[use])), default=None)


def table(rows: Sequence[Row], unseen: str) -> str:
    """NRMSE of every row by every split, and R2 by random folds and by unseen rate.

    "As simulated" is the network trained on everything over whole recordings, as
    `softnn simulate` is given them.

    A dash stands where no figure is possible, a star where the folds of the column
    chose the network.
    """
    every = ("random", "specimen", "unseen", "whole")
    splits = [s for s in every if any(s in r for r in rows)]
    heads = HEADS | {"unseen": f"by unseen {unseen}"}
    lines = []
    for row in rows:
        cells: list[str | None] = [row["model"]]
        for split in splits:
            star = "*" if split == row.get("chosen_by") else ""
            text = mean(row.get(split))
            cells.append(text and text + star)
        cells += [mean(row.get("r2", {}).get(s)) for s in splits if s in TWICE]
        lines.append(cells)
    titles = [f"NRMSE, {heads[s]}" for s in splits]
    titles += [f"R2, {heads[s]}" for s in splits if s in TWICE]
    text = markdown(["model", *titles], lines)
    if any("*" in (cell or "") for cells in lines for cell in cells):
        text += "\n\n* the folds of this column chose the network: a little flattered"
    why: dict[str, list[str]] = {}
    for row in rows:
        for split in splits:
            if isinstance(reason := row.get(split), str):
                names = why.setdefault(reason, [])
                names += [row["model"]] * (row["model"] not in names)
    for reason, names in why.items():
        text += f"\n\n- {'; '.join(names)}: {reason}"
    return text


def mean(values: Sequence[float] | str | None) -> str | None:
    """The mean over folds as it is printed."""
    if values is None or isinstance(values, str):
        return None
    return percent(float(np.mean(values)))


def sentences(
    networks: Sequence[Row],
    convex: Row | None,
    others: Sequence[Row],
    unseen: str,
    parts: str = "",
) -> tuple[list[str], Row]:
    """One sentence for recordings one has, one for the unseen; the row of the latter.

    `networks` are the choices of the search, the first that for recordings one has.
    `parts`: what of the recordings the folds are of, "" for all.
    """
    first = networks[0]
    rival = best_of(others, "random")
    known = f"For recordings you have, take {first['model']}: {of(first, 'random')} "
    known += f"by random folds{f' of {parts}' if parts else ''}"
    known += f"{against(first, rival, 'random')}; "
    known += f"at a {unseen} never seen it has {of(first, 'unseen')}"
    takes, rival = never_seen(networks, convex, others)
    gap = compared(first, takes, "unseen")
    if gap is not None and gap[0] > gap[1] and takes is not first:
        known += f", so do not use it there ({takes['model']}: {of(takes, 'unseen')})"
    article = "the " if takes is convex else ""
    never = f"For a {unseen} never seen, take {article}{takes['model']}: "
    never += of(takes, "unseen")
    if poor(takes, "unseen"):
        never += f", which is poor: record the {unseen}s that you need"
    beaten = "the next best baseline" if takes in others else BASELINE
    never += against(takes, rival, "unseen", beaten)
    if convex is not None and takes is not convex:
        never += f"; the {CONVEX} has {of(convex, 'unseen')}"
        never += against(convex, takes, "unseen", "")
    searched = best_of(networks, "unseen")
    if searched is not None and searched is not takes:
        never += (
            f"; of the networks searched {searched['model']} has "
            f"{of(searched, 'unseen')}, chosen by these very folds"
        )
    return [known + ".", never + "."], takes


def poor(row: Row, use: str) -> bool:
    """Whether the mean error is more than `POOR` of the stress."""
    values = row.get(use)
    return not isinstance(values, str | None) and float(np.mean(values)) > POOR


def never_seen(
    networks: Sequence[Row], convex: Row | None, others: Sequence[Row]
) -> tuple[Row, Row | None]:
    """The row to take for the unseen, and the best of the other baselines.

    A baseline is taken only where it is better than the network beyond one standard
    error. The best baseline is the best of many in hindsight; the convex network is
    weighed without these folds.
    """
    mine = convex or best_of(networks, "unseen") or networks[0]
    rival = best_of(others, "unseen")
    if rival is None:
        return mine, None
    gap = compared(mine, rival, "unseen")
    if gap is not None and gap[0] > gap[1]:
        rest = [row for row in others if row is not rival]
        return rival, best_of(rest, "unseen")
    return mine, rival


def compared(one: Row, other: Row, use: str) -> tuple[float, float] | None:
    """Mean of one - other over the same folds, and its standard error."""
    both = [one.get(use), other.get(use)]
    if any(values is None or isinstance(values, str) for values in both):
        return None
    mine, its = (np.asarray(values, float) for values in both)
    return paired(mine, its) if len(mine) == len(its) else None


def against(one: Row, other: Row | None, use: str, name: str = BASELINE) -> str:
    """How one stands to another, in words; nothing where they cannot be compared.

    `name` says what the other is; without it neither it nor its error is named.
    """
    if other is None:
        return "; no baseline can be fitted here"
    gap = compared(one, other, use)
    if gap is None:
        return ""
    size, error = gap
    if abs(size) <= error:
        small = max(abs(size), error) < SMALL
        verdict = "a tie (within 0.1 %)" if small else f"a tie ({pm(size, error)})"
    else:
        verdict = f"{'better' if size < 0 else 'worse'} by {pm(abs(size), error)}"
    if not name:
        return f", {verdict}"
    return f"; {name}, {other['model']}, has {of(other, use)}: {verdict}"


def of(row: Row, use: str) -> str:
    """The mean error of a row for a use, +- its standard error over folds."""
    values = row.get(use)
    if values is None or isinstance(values, str):
        return "no figure"
    return pm(float(np.mean(values)), standard_error(np.asarray(values)))


def pm(mean: float, error: float) -> str:
    """Fractions as they are printed, in per cent."""
    mean = round(100 * mean, 1) + 0.0  # no minus before a zero
    return f"{mean:.1f} \N{PLUS-MINUS SIGN} {100 * error:.1f} %"


def basis(
    material: str,
    shown: Mapping[str, bool],
    whole: Row | None,
    how: str,
) -> str:
    """What networks were trained on, and how far off they are over whole recordings.

    `shown`: whether they saw whole "cycles", and whether a recording "unloads";
    `whole`: the row of a network with its NRMSE by recording under "whole"; `how`: the
    arguments of `make neurons` for whole cycles.
    """
    if shown["cycles"]:
        said = "Trained and tested on whole recordings, unloading included."
    elif shown["unloads"]:
        said = (
            "Trained and tested on first loadings alone, cut at the largest strain: no "
            "network here has seen unloading."
        )
    else:
        return (
            f"Trained and tested on first loadings; no recording of {material} unloads."
        )
    if whole is not None:
        errors = [100 * e for e in whole["whole"]]
        said += (
            f" Over the whole recordings, as softnn simulate is given them, "
            f"{whole['model']} has {min(errors):.1f} to {max(errors):.1f} %"
        )
        said += " (trained on them)." if shown["cycles"] else "."
    if not shown["cycles"]:
        said += f' For networks of whole recordings: make neurons ARGS="{how}".'
    return said
