"""Which model holds at rates never seen: convex networks, free ones, or others?

Each material is judged on the rates (recordings, where it has one rate) that its
training leaves out, one by one. The convex network (`softnn.study.holding`) is weighed
inside each training set, and so is everything about the piecewise-linear models. The
free networks have a fixed size; trees and a Gaussian process are as they come. The best
of the baselines is the best in hindsight.

The convex network was made on the first sets; `CONFIRM` names sets that no choice about
it has seen.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any

from bench.architectures.unseen import CONFIRM, headline, judged, line, sentence, table
from softnn.contracts import InputError
from softnn.study import common
from softnn.study.material_data import Data, prepared
from softnn.study.settings import Settings

MADE_ON = (
    "rubber-compression-relaxation",
    "vhb4910-zhao",
    "vhb4910-hossain2012-digitised",
    "gelatin-zwick-air-control",
    "cb-silicone-stretcher",
    "virtual",
)
CYCLES = ("vhb4910-zhao", "hnbr50-stuttgart")  # judged over whole cycles too
NO_MATERIAL = ("NO specimen (air)",)
SAMPLES = 100  # of a recording


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.unseen`; returns the exit code."""
    made = common.parser("unseen", __doc__)
    made.add_argument("--data", nargs="+", metavar="SET", help="sets, or virtual")
    made.add_argument("--only", default="", help="materials with this in their name")
    return common.guarded(lambda: run(made.parse_args(argv)))


def run(a: Any) -> None:
    found: list[dict[str, Any]] = []
    left_out: dict[str, str] = {}
    known: dict[str, str] = {}
    for data, samples in materials(a):
        if a.only not in data.label:
            continue
        try:
            found.append(judged(data, a.seed, samples, free=not a.smoke))
        except InputError as reason:
            left_out[data.label] = str(reason)
            print(f"{data.label}: left out: {reason}", flush=True)
            continue
        known[data.label] = data.digest
        print(line(found[-1]), flush=True)
        path = common.write_result(  # after each material, so that it is kept
            "unseen",
            headline(found),
            {"materials": found, "left_out": left_out, "samples": samples},
            seed=a.seed,
            data=known,
            folder=common.results_folder(a.smoke, a.publish),
        )
    if not found:
        raise InputError(f"nothing can be judged: {left_out}")
    print(f"\n{table(found)}\n\n{sentence(found)}\nresult: {path}")


def materials(a: Any) -> Iterator[tuple[Data, int]]:
    """Everything asked for, real recordings first, and samples a recording."""
    if a.smoke:
        (data,) = prepared(Settings(material="NatPolR", samples=12))
        yield data, 12
        return
    for name in a.data or dict.fromkeys([*MADE_ON[:-1], *CONFIRM, *MADE_ON[-1:]]):
        for cycles in (False, True) if name in CYCLES else (False,):
            asked = Settings(data=name, material="all", samples=SAMPLES, cycles=cycles)
            for data in prepared(asked):
                if data.material not in NO_MATERIAL:
                    yield data, SAMPLES


if __name__ == "__main__":
    sys.exit(main())
