"""Why does a network that foretells tensile tests fail on a sine in real time?

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
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError
from softnn.materials import material, table
from softnn.neural import ARCHITECTURES, PUBLISHED, Seen, samples, train
from softnn.neural.guard import DIRECTION
from softnn.recording import data_hash
from softnn.study import common
from softnn.study.material_data import Data, prepared
from softnn.study.realtime_inputs import (
    NAME,
    SCENARIOS,
    SECONDS,
    STEP_S,
    law,
    offsets,
    readings,
    sine,
)
from softnn.study.settings import Settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_MPa = 0.01  # a stress below minus this is negative
Row = dict[str, Any]
Drawn = dict[tuple[str, str, str], Any]  # by scenario, place and what was fed


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
        place = common.results_folder(options.smoke)
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


def networks(
    data: Data, architecture: str, number: int, neurons: int, seed: int
) -> list[Any]:
    """Networks of one kind on all samples of all specimens, as published."""
    known = samples(data.tensile, architecture)
    every = np.ones((number, len(known.target)), bool)
    seeds = [1000 * seed + i for i in range(number)]
    trained = train(
        known.inputs,
        known.target,
        neurons=[neurons] * number,
        train_mask=every,
        seeds=seeds,
    )
    return [one.network for one in trained]


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


def counted(out: Array, true: Array, flags: NDArray[np.uint8]) -> Row:
    """Failures of networks (m, n) against the law (n,): medians over the networks.

    A jump is the largest change in a controller's sample over the law's largest.
    `flagged` is the share of all samples outside the training, `negative_flagged` that
    of the negative ones.
    """
    negative = out < -LEAST_MPa
    rms = np.sqrt(np.mean(true**2))
    error = np.sqrt(np.mean((out - true) ** 2, axis=1))
    steps = np.max(np.abs(np.diff(out, axis=1)), axis=1)
    largest = np.max(np.abs(np.diff(true)))
    return {
        "networks_negative": int(np.sum(negative.any(axis=1))),
        "networks": len(out),
        "negative": float(np.median(negative.mean(axis=1))),
        "least_MPa": float(np.median(out.min(axis=1))),
        "most_MPa": float(np.median(out.max(axis=1))),
        "nrmse": float(np.median(error) / rms) if rms > 0 else None,
        "jump": float(np.median(steps) / largest) if largest > 0 else None,
        "flagged": float(np.mean(flags > 0)),
        "negative_flagged": _share(negative & (flags > 0), negative),
        "negative_unloading": _share(negative & (flags & DIRECTION > 0), negative),
    }


def _share(part: NDArray[np.bool], whole: NDArray[np.bool]) -> float | None:
    return float(part.sum() / whole.sum()) if whole.any() else None


# --- what the thesis saw, and what is seen here ---------------------------------------


def one(rows: Sequence[Row], scenario: str, place: str, fed: str) -> Row:
    """The one row of FFRD4 with these."""
    wanted = {"inputs": "FFRD4", "scenario": scenario, "place": place, "fed": fed}
    return next(r for r in rows if wanted.items() <= r.items())


def verdict(rows: Sequence[Row], number: int) -> list[Row]:
    """Five statements of section 7.3, for each reading: how many networks agree."""
    out = []
    for fed in readings(1.0):
        a, b, d = (one(rows, s, "from zero", fed) for s in "abd")
        below = one(rows, "c", "below zero", fed)
        out.append(
            {
                "fed": fed,
                "a_negative_in": a["networks_negative"],
                "b_negative_in": b["networks_negative"],
                "c_negative_share": below["negative"],
                "d_negative_in": d["networks_negative"],
                "nrmse_a": a["nrmse"],
                "nrmse_b": b["nrmse"],
                "nrmse_d": d["nrmse"],
                "networks": number,
            }
        )
    return out


def headline_of(rows: Sequence[Row], neurons: int, number: int) -> Row:
    """The plain reading, the derivative of a sine from zero, beside a constant rate."""
    out: Row = {"neurons": neurons, "networks": number}
    for key, fed in (("varying", "derivative"), ("constant", "constant 250 mm/min")):
        for s in "abd":
            row = one(rows, s, "from zero", fed)
            out[f"{key}_{s}_networks_negative"] = row["networks_negative"]
            out[f"{key}_{s}_negative_share"] = row["negative"]
            out[f"{key}_{s}_nrmse"] = row["nrmse"]
        out[f"{key}_c_negative_share"] = one(rows, "c", "below zero", fed)["negative"]
    plain = [one(rows, s, "from zero", "derivative") for s in "ab"]
    for what in ("negative_flagged", "negative_unloading"):
        shares = [r[what] for r in plain if r[what] is not None]
        out[f"varying_{what}"] = min(shares) if shares else None
    for kind in ("FFRI1", "FFRI2", "FFRI3"):
        for lag in ("controller's sample", "slowest test's sample"):
            some = [r for r in rows if r["inputs"] == kind and r["fed"] == lag]
            some = [
                r for r in some if r["scenario"] in "ab" and r["place"] == "from zero"
            ]
            key = f"{kind}_lag_of_{lag.split(chr(39))[0].replace(' ', '_')}_nrmse"
            out[key] = float(np.mean([r["nrmse"] for r in some]))
    return out


def report(body: Row) -> str:
    """The verdict as a table; shares of time are in per cent."""
    header = ["fed as the rate", "a: negative in", "b: in", "d: in", "c: of the time"]
    header += ["NRMSE a", "b", "d"]
    rows = [
        [
            v["fed"],
            *(f"{v[f'{s}_negative_in']} of {v['networks']}" for s in "abd"),
            common.percent(v["c_negative_share"], 0),
            *(common.percent(v[f"nrmse_{s}"], 0) for s in "abd"),
        ]
        for v in body["verdict"]
    ]
    return common.markdown(header, rows)


def draw(drawn: Drawn) -> Figure:
    """Figs 7.2 and 7.3: all networks, the law, with the sine's rate and a constant."""
    figure = common.new_figure(7.2, 4.2)
    grid = figure.subplots(2, 4, sharex=True)
    t = np.arange(0, SECONDS, STEP_S)
    for line, fed in zip(grid, ("derivative", "constant 250 mm/min"), strict=True):
        for axes, name in zip(line, SCENARIOS, strict=True):
            where = "below zero" if name == "c" else "from zero"
            _, _, out, true = drawn[name, where, fed]
            colour = common.COLOURS[1 if fed == "derivative" else 0]
            for stress in out:
                axes.plot(t, stress, color=colour, linewidth=0.6, alpha=0.6)
            axes.plot(t, true, color=common.INK, linewidth=1.2)
            axes.axhline(0, color=common.FAINT, linewidth=0.6)
            axes.set_title(f"({name}) {SCENARIOS[name]:g} mm/min")
        line[0].set_ylabel("stress [MPa]")
        line[-1].text(
            1.02, 0.5, fed, transform=line[-1].transAxes, rotation=-90, va="center"
        )
    for axes in grid[1]:
        axes.set_xlabel("time [s]")
    figure.suptitle("networks (thin), law of the specimens (black)", fontsize=9)
    return figure


if __name__ == "__main__":
    sys.exit(main())
