"""python -m bench.hands --side development --seed 1 --out DIR ..."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.hands.forging import forge


def main() -> None:
    """Forge cases into a new folder."""
    parser = argparse.ArgumentParser(prog="python -m bench.hands")
    parser.add_argument(
        "--side", choices=("development", "held-out"), default="development"
    )
    parser.add_argument("--seed", type=int, default=1)
    for name in ("nulls", "singles", "pairs", "aliens", "mixed", "bent"):
        parser.add_argument(f"--{name}", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    said = vars(parser.parse_args())
    said["side"] = said["side"].replace("-", "_")
    forge(said.pop("out"), **said)


if __name__ == "__main__":
    main()
