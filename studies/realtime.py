"""Why does a network that predicts tensile tests fail on a sine in real time?

Section 7.3 of the thesis (Figs 7.2, 7.3): four sines of strain, at 1 kHz, into networks
trained on tensile tests, with the strain rate from the sine and with a constant one.
Networks of every input architecture, several of each, on virtual specimens; what the
text leaves open is tried in every reading: where the sine lies, what is fed as its
rate, and whether a lag is a sample of the training or of the controller. Failures are
counted, and what the guard on the training range says of them.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import material, table
from softnn.neural import ARCHITECTURES, PUBLISHED, Seen
from softnn.recording import data_hash
from softnn.study import common
from softnn.study.material_data import Data, prepared
from softnn.study.realtime_inputs import (
    NAME,
    SCENARIOS,
    STEP_S,
    Row,
    counted,
    law,
    networks,
    offsets,
    readings,
    sine,
)
from softnn.study.settings import Settings
from studies.shown.realtime import Drawn, draw, headline_of, report, verdict


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.realtime`; returns the exit code."""
    parser = common.parser("realtime", __doc__)
    parser.add_argument("--networks", type=int, default=10, help="of each kind (10)")
    options = parser.parse_args(argv)

    def work() -> None:
        if options.networks < 1:
            raise InputError(f"--networks is {options.networks}; at least 1 is needed")
        number = 2 if options.smoke else options.networks
        (data,) = prepared(Settings(material=NAME, seed=options.seed))
        place = common.results_folder(options.smoke, options.publish)
        neurons = table("6.6").row(material=NAME, model="ANN")["neurons"]
        nets = {a: networks(data, a, number, neurons, options.seed) for a in PUBLISHED}
        seen = Seen.of(data.tensile)
        rows, drawn = by_rate(nets["FFRD4"], seen)
        rows += by_lag(nets, data, seen)
        headline = headline_of(rows, neurons, number)
        body = {"seen": seen.to_dict(), "rows": rows, "verdict": verdict(rows, number)}
        print(report(body))
        path = common.write_result(
            "realtime",
            headline,
            body,
            seed=options.seed,
            data={data.source: data_hash(data.tensile)},
            folder=place,
        )
        common.save_figure(draw(drawn), "realtime", place)
        print(f"\nresult: {path}")

    return common.guarded(work)


def by_rate(nets: Sequence[Any], seen: Seen) -> tuple[list[Row], Drawn]:
    """FFRD4 on every input, in every place and with every reading of the rate."""
    length = material(NAME).length_mm
    rows: list[Row] = []
    drawn: Drawn = {}
    for name, speed in SCENARIOS.items():
        for where, offset in offsets(name, speed, length).items():
            strain, rate = sine(speed, length, offset)
            for what, read in readings(length).items():
                fed = read(strain, rate)
                if name == "d":  # saturated: nothing below zero is passed on
                    fed = np.maximum(fed, 0)
                inputs = np.column_stack([strain, fed])
                out = np.array([net.predict(inputs) for net in nets])
                flags = seen.flags(strain, fed)
                rows.append(
                    {"inputs": "FFRD4", "scenario": name, "place": where, "fed": what}
                    | counted(out, law(strain), flags)
                )
                drawn[name, where, what] = (strain, fed, out, law(strain))
    return rows, drawn


def by_lag(nets: Mapping[str, Sequence[Any]], data: Data, seen: Seen) -> list[Row]:
    """FFRI1-3, a lag being a sample of the controller, or one of the training."""
    length = material(NAME).length_mm
    slowest = max(np.median(np.diff(r.time_s)) for r in data.tensile)
    fastest = min(np.median(np.diff(r.time_s)) for r in data.tensile)
    lags = {
        "controller's sample": STEP_S,
        "fastest test's sample": float(fastest),
        "slowest test's sample": float(slowest),
    }
    rows = []
    for architecture in ("FFRI1", "FFRI2", "FFRI3"):
        for name, speed in SCENARIOS.items():
            for where, offset in offsets(name, speed, length).items():
                strain, rate = sine(speed, length, offset)
                for what, lag_s in lags.items():
                    lag = max(round(lag_s / STEP_S), 1)
                    past = [
                        np.concatenate([np.full(k * lag, strain[0]), strain])[
                            : len(strain)
                        ]
                        for k in ARCHITECTURES[architecture].lags
                    ]
                    inputs = np.column_stack(past)
                    out = np.array([n.predict(inputs) for n in nets[architecture]])
                    found = counted(out, law(strain), seen.flags(strain, rate))
                    row = {"inputs": architecture, "scenario": name, "place": where}
                    rows.append(row | {"fed": what} | found)
    return rows


if __name__ == "__main__":
    sys.exit(main())
