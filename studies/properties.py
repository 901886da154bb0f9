"""Which properties do the recordings give, and how far are they from the published?

Tables 4.2 and 4.4 of the virtual specimens stand beside the published ones, with the
deviation of each figure and a reason, computed where it can be, for each above 25 %;
then the same properties of real recordings. Figures in the manner of Figs 4.6 to 4.18.

The generator of the virtual specimens was calibrated to the published tables with the
rules of `softnn.properties`: agreement says that one material can have these figures
together, not that the rules are those of the thesis's eye.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from softnn.materials import MATERIALS
from softnn.properties import BEND
from softnn.study import common, property_sets
from softnn.study.virtual_properties import of_virtual
from softnn.tracking import Tracker
from studies.shown import properties as shown
from studies.shown.properties import _listed, headline_of, report


def main(argv: Sequence[str] | None = None) -> int:
    parser = common.parser("properties", __doc__)
    parser.add_argument(
        "--data",
        metavar="SOURCE",
        help="virtual, a set in SOFTNN_DATA, a folder or a tidy CSV; "
        "without it virtual and every real set that allows it",
    )
    parser.add_argument("--resamples", type=int, default=200, help="of the bootstrap")
    parser.add_argument(
        "--tracking", help=f"MLflow (sqlite:///{common.RUNS}/mlflow.db)"
    )
    options = parser.parse_args(argv)

    def work() -> None:
        smoke, whole = options.smoke, options.data is None
        home = common.runs_folder(smoke)
        place = (
            common.results_folder(smoke, options.publish) if whole else home / "results"
        )
        found: dict[str, Any] = {}
        figures: list[Path] = []
        if whole or options.data == "virtual":
            names = ("NatPolR",) if smoke else MATERIALS
            resamples = 5 if smoke else options.resamples
            found["virtual"] = made = of_virtual(names, options.seed, resamples)
            for name, figure in shown.virtual_figures(made.pop("drawn")).items():
                figures += common.save_figure(figure, f"properties_{name}", place)
        for source in _real(options.data, smoke):
            label = Path(source).stem
            found[label] = property_sets.of_set(source)
            if curves := found[label].pop("drawn"):
                # Not into the project: a drawn curve is the recording, and most of
                # the sets carry no licence.
                drawn, runs = shown.set_figure(curves), home / "results"
                figures += common.save_figure(drawn, f"properties_{label}", runs)
        hashes = {label: one.pop("data_sha256") for label, one in found.items()}
        headline, text = headline_of(found), report(found)
        print(text)
        name = "properties" if whole else f"properties-{Path(options.data).stem}"
        path = common.write_result(
            name, headline, found, seed=options.seed, data=hashes, folder=place
        )
        uri = common.database(options.tracking, smoke)
        track(uri, options.seed, headline, hashes, figures, {f"{name}.md": text})
        print(f"\nresult: {path}; figures: {_listed(figures)}; runs: {uri}")

    return common.guarded(work)


def _real(source: str | None, smoke: bool) -> list[str]:
    """The real sets that are asked for: all there are, one, or none."""
    if source is None:
        return [] if smoke else property_sets.available()
    return [] if source == "virtual" else [source]


def track(
    uri: str,
    seed: int,
    headline: dict[str, Any],
    hashes: dict[str, str],
    figures: Sequence[Path],
    texts: dict[str, str],
) -> None:
    """One run in MLflow: the headline, the tables and the figures."""
    with Tracker(
        uri,
        "properties",
        study=f"properties {','.join(hashes)}",
        identity=common.fingerprint([hashes, datetime.now().isoformat()]),
        name=", ".join(hashes),
        parameters={"seed": seed, "bend": BEND},
        data=(next(iter(hashes)), common.fingerprint(hashes)),
    ) as tracker:
        rows = [[k, f"{v:.4g}"] for k, v in headline.items()]
        note = common.markdown(["figure", "value"], rows)
        tracker.result(headline, note=note, files=figures, texts=texts)


if __name__ == "__main__":
    sys.exit(main())
