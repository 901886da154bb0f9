"""Four inputs, 1 to 20 neurons, three ways of regularisation: every fold of every one.

Figs 6.4 to 6.6 of the thesis for all four inputs of Table 6.3, with early stopping and
a fixed L2 weight beside Bayesian regularisation, on all seven materials. It takes
hours, goes on where it was stopped, and can be shared: `--storage` with a database
server, `--worker` on other machines. The result file is written after each material. At
most 100 samples of a recording are taken (`--samples`), since neighbours in time say
the same; Table 6.6 has all samples for FFRD4.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from studies import architectures


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.grid`; returns the exit code."""
    given = list(sys.argv[1:] if argv is None else argv)
    if not {"--material", "--smoke", "--data"} & set(given):
        given = ["--material", "all", *given]
    return architectures.main(["--sampler", "grid", *given])


if __name__ == "__main__":
    sys.exit(main())
