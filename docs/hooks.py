"""Pages that mkdocs makes of the code: one for each effect, drawn from its telltale."""

from __future__ import annotations

import inspect
import io
import re
from dataclasses import replace
from typing import Any

import numpy as np

from softnn.contracts import Chunk, Effect
from softnn.effects import EFFECTS, effect
from softnn.fit import Data
from softnn.mismatch.demo import MATERIAL, STIFFNESS_MPa
from softnn.simulate import Term, simulate

WARMING_C = 20.0  # over the recording, where an effect needs it


def on_files(files: Any, config: Any) -> Any:
    """Add the gallery to the pages."""
    from mkdocs.structure.files import File

    made = {"gallery/index.md": overview()}
    for law in EFFECTS:
        made[f"gallery/{law.id}.md"] = page(law)
        made[f"gallery/{law.id}.svg"] = figure(law)
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    return files


def title(law: Effect) -> str:
    return law.id.replace("_", " ").capitalize()


def overview() -> str:
    rows = [f"| [{title(e)}]({e.id}.md) | {e.stage} | {e.where} |" for e in EFFECTS]
    return "\n".join(
        [
            "# What each effect looks like",
            "",
            "Drawn by the effects themselves: a soft silicone, simulated over the "
            "strain programme on which each effect shows best, with it and without.",
            "",
            "| effect | stage | where it shows |",
            "| --- | --- | --- |",
            *rows,
            "",
        ]
    )


def page(law: Effect) -> str:
    """Physics, picture and confounders of one effect, from its class."""
    text = inspect.cleandoc(type(law).__doc__ or "")
    text = re.sub(
        r"\.\. math::(.*?)(?=\n\n)",
        lambda m: "\n$$\n" + inspect.cleandoc(m[1]).replace("\n", " ") + "\n$$\n",
        text + "\n\n",
        flags=re.S,
    )
    twins = [
        f"| [{title(effect(name))}]({name}.md) | {apart} |"
        for name, apart in law.twins.items()
    ]
    ranges = [
        f"| `{p.name}` | {p.unit} | {p.low:g} to {p.high:g} | {p.meaning} |"
        for p in law.parameters
    ]
    parts = [
        f"# {title(law)}",
        f"![With and without {title(law).lower()}]({law.id}.svg)",
        text.strip(),
        "## Parameters\n",
        "| name | unit | range | meaning |\n| --- | --- | --- | --- |",
        "\n".join(ranges),
    ]
    if twins:
        parts += [
            "## What looks the same\n",
            "| effect | what tells them apart |\n| --- | --- |",
            "\n".join(twins),
        ]
    joined = "\n\n".join(parts)
    return re.sub(r"(\| --- \|)\n\n", r"\1\n", joined) + "\n"


def curves(law: Effect) -> tuple[Chunk, np.ndarray, np.ndarray]:
    """The telltale programme, and the stress [MPa] without the effect and with it."""
    chunk = law.telltale()
    if law.needs_temperature and chunk.temperature_C is None:
        share = chunk.time_s / chunk.time_s[-1]
        chunk = replace(chunk, temperature_C=20 + WARMING_C * share)
    without = simulate(MATERIAL, STIFFNESS_MPa, [], [chunk])
    scales = Data(("telltale",), (chunk,), tuple(without)).scales()
    terms = [Term(law, law.defaults() | law.starts(scales)[0])]
    return chunk, without[0], simulate(MATERIAL, STIFFNESS_MPa, terms, [chunk])[0]


def figure(law: Effect) -> str:
    """Stress over strain and over time as SVG, legible on light and on dark pages."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    chunk, without, with_ = curves(law)
    grey = "#808890"
    style = {
        "svg.hashsalt": law.id, "text.color": grey, "axes.labelcolor": grey,
        "axes.edgecolor": grey, "xtick.color": grey, "ytick.color": grey,
    }  # fmt: skip
    with rc_context(style):
        drawn = Figure(figsize=(8, 3.2), layout="constrained")
        left, right = drawn.subplots(1, 2, sharey=True)
        for axes, x in ((left, chunk.strain), (right, chunk.time_s)):
            axes.plot(x, without, color=grey, linewidth=1, label="without")
            axes.plot(x, with_, color="#e07020", linewidth=1.3, label="with")
            axes.spines[["top", "right"]].set_visible(False)
        left.set(xlabel="strain [-]", ylabel="stress [MPa]")
        right.set(xlabel="time [s]")
        left.legend(frameon=False)
        out = io.StringIO()
        drawn.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    return out.getvalue()
