"""Which network survives strain that goes up and down, at a rate that changes?

The network of section 7.3 fails on a sine. One with history inputs that need no
differentiation (`FFH7`: strain, largest strain, the springs of five Maxwell branches),
inputs held within the training and stress of one sign, trained on cyclic recordings and
on histories that the corrected physical model simulates, is put beside what there is:
on the sines of the thesis, on virtual recordings, on foam and VHB not learned from; in
C, and in the closed loop of a walking actuator.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.survivor import data, networks
from bench.survivor.report import draw, headline_of, report, write_page
from bench.survivor.scores import Row, real_time, scores, sines
from softnn.contracts import InputError
from softnn.recording import data_hash
from softnn.study import common
from softnn.taught import INPUTS, histories, lag_of, network_of, simulated_by

PUBLISHED_NETWORK = "FFRD4 as published"


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.survivor`; returns the exit code."""
    parser = common.parser("survivor", __doc__)
    parser.add_argument(
        "--only",
        default="",
        help="problems with this in their name; the rest as found before",
    )
    parser.add_argument("--page", action="store_true", help="the page alone, from JSON")
    options = parser.parse_args(argv)

    def work() -> None:
        place = common.results_folder(options.smoke, options.publish)
        if options.page:
            print(write_page(common.RESULTS))
            return
        size = networks.SMALL if options.smoke else networks.Size()
        problems = [data.virtual_problem(options.seed, size.specimens, size.samples)]
        problems += [] if options.smoke else data.real_problems(size.samples)
        problems = [p for p in problems if options.only in p.name]
        if not problems:
            raise InputError(f"--only {options.only!r} is in the name of no problem")
        body, read = kept(place, size, options.seed)
        rows = {row["name"]: row for row in body["problems"]}
        for problem in problems:
            row, found = judged(problem, size, options.seed, options.smoke)
            rows[problem.name] = row
            body |= found | {"problems": list(rows.values())}
            read[problem.name] = data_hash([*problem.known, *problem.unseen])
            # After each, so that what is finished is kept.
            path = common.write_result(
                "survivor",
                headline_of(body),
                body,
                seed=options.seed,
                data=read,
                folder=place,
            )
            print(f"{problem.name}: {row['seconds']:.0f} s", flush=True)
        print(report(body))
        if "sines" in body:
            common.save_figure(draw(body), "survivor", place)
        if options.publish and not options.smoke:
            write_page(place)
        print(f"\nresult: {path}")

    return common.guarded(work)


def kept(place: Path, size: networks.Size, seed: int) -> tuple[Row, dict[str, str]]:
    """What an earlier run of the same size has found, and in which data.

    Each row states the commit that made it.
    """
    body: Row = {"problems": [], "size": vars(size)}
    file = place / "survivor.json"
    if file.exists():
        old = json.loads(file.read_text(encoding="utf-8"))
        if (old["size"], old["seed"]) == (vars(size), seed):
            found = {k: old[k] for k in (*body, "sines", "real_time") if k in old}
            about = common.provenance_of(old)
            found["problems"] = [about | row for row in old["problems"]]
            return found, old["data"]
    return body, {}


def judged(
    problem: data.Problem, size: networks.Size, seed: int, smoke: bool
) -> tuple[Row, Row]:
    """All models on one problem; and what only the virtual one is asked."""
    began = time.thread_time()
    models = data.physics(problem, common.RUNS / "survivor", "sls" if smoke else None)
    corrected, base = (data.model_of(models[k]) for k in ("corrected", "base"))
    known, factor = problem.alike(corrected)
    made = histories(corrected, problem.span, size.simulated, seed, factor)
    lag_s = lag_of(known)
    stored, how = network_of([*known, *made], lag_s, size.neurons, size.starts, seed)
    about = {k: getattr(how, k) for k in ("parameters", "gamma", "iterations")}
    predict: dict[str, networks.Predict] = {
        "corrected model": partial(simulated_by, corrected),
        "PL-Wiechert": partial(simulated_by, base),
        INPUTS: partial(networks.stress_of, stored),
        **networks.others(known, made, lag_s, size, seed),
    }
    found: Row = {}
    if problem.name.startswith("virtual"):
        published = networks.as_published(seed, size)
        predict[PUBLISHED_NETWORK] = partial(networks.stress_of, published)
        found = {
            "sines": sines({PUBLISHED_NETWORK: published, INPUTS: stored}),
            "real_time": real_time(stored, problem, size),
        }
    row = {
        "name": problem.name,
        **common.provenance(),
        "specimens": len(problem.known),
        "unseen": len(problem.unseen),
        "selected": models["selected"],
        "lag_s": lag_s,
        "network": about,
    }
    for name, one in predict.items():
        for key, value in scores(one(problem.unseen), problem).items():
            row.setdefault(key, {})[name] = value
    row["seconds"] = time.thread_time() - began
    return row, found


if __name__ == "__main__":
    sys.exit(main())
