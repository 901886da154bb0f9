"""What a user adds to a file, as options of a command."""

from __future__ import annotations

import argparse
import re
import shlex
from dataclasses import fields

from softnn.contracts import InputError
from softnn.readers.options import ReadOptions

_SIZES = {
    "length": "mm",
    "area": "mm2",
    "width": "mm",
    "thickness": "mm",
    "diameter": "mm",
    "rate": "per_s",
    "interval": "s",
}
_HELP = {
    "rate": "nominal strain rate, 1/s; without a time column it gives the time",
    "interval": "seconds between samples, in place of a time column",
}
_QUANTITIES = ("time", "force", "displacement", "strain", "stress", "temperature")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Give a command the fields of `ReadOptions` as options."""
    group = parser.add_argument_group("what the files do not say")
    for name, unit in _SIZES.items():
        group.add_argument(
            f"--{name}",
            dest=f"{name}_{unit}",
            type=_number,
            metavar=unit.upper(),
            help=_HELP.get(name, f"{name} of the specimen, {unit}"),
        )
    for name in _QUANTITIES:
        group.add_argument(
            f"--{name}", default="", metavar="COLUMN", help=f"the column of {name}"
        )
    group.add_argument(
        "--unit",
        action="append",
        default=[],
        metavar="[FILE:]COLUMN=UNIT",
        help="unit of a column, e.g. 'Force=kN'; of one file, 'fast.csv:Force=kN'",
    )
    group.add_argument("--decimal", default="", choices=[".", ","])
    group.add_argument(
        "--compression", action="store_true", help="the file counts compression > 0"
    )
    group.add_argument(
        "--flip",
        default="",
        metavar="[FILE:]strain|stress",
        help="the one whose sign the file has reversed",
    )
    group.add_argument(
        "--zero", action="store_true", help="strain counts from where the file starts"
    )
    group.add_argument(
        "--zero-stress",
        action="store_true",
        help="force and stress count from where the file starts",
    )
    group.add_argument(
        "--skip-bad-cells",
        action="store_true",
        help="cells that are no numbers, or that repeat one far outside all others, "
        "become missing values",
    )
    for name in ("specimen", "material", "test"):
        group.add_argument(f"--{name}", default="", help=f"{name}, to be recorded")


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number; put the size in its place, as 33.5"
        ) from None


_SWITCHES = ("as_is", "compression", "skip_bad_cells", "zero", "zero_stress")


def as_arguments(text: str) -> str:
    """A message that names options of a command, in arguments of a function.

    >>> as_arguments("no length in it; give --length MM, or --unit 'Way=mm'")
    "no length in it; give length_mm=..., or units={'Way': 'mm'}"
    >>> as_arguments("If it is right, say --as-is")
    'If it is right, say as_is=True'
    """

    def gathered(match: re.Match[str]) -> str:
        words = shlex.split(match[0])
        if words[0] == "--skip":
            return f"skip={words[1::2]}"
        pairs = (word.rpartition("=") for word in words[1::2])
        return f"units={ ({c: u for c, _, u in pairs}) }"

    def option(match: re.Match[str]) -> str:
        name, value = match[1].replace("-", "_"), match[2]
        if name in _SWITCHES:
            return f"{name}=True"
        if name in _SIZES:
            return f"{name}_{_SIZES[name]}" + ("=..." if value else "")
        if name in (*_QUANTITIES, "decimal", "model", "seed", "skip"):
            return name + ("=..." if value else "")
        return match[0]

    word = r"(?:'[^']*'|[^\s',;]*[^\s',;.?)])"
    text = re.sub(rf"--unit {word}(?:,? --unit {word})*", gathered, text)
    text = re.sub(rf"--skip {word}(?: --skip {word})*", gathered, text)
    text = text.replace("--unit", "units={COLUMN: UNIT}")
    text = re.sub(rf"--flip ({word})", lambda m: f"flip={shlex.split(m[1])[0]!r}", text)
    return re.sub(r"--([a-z]+(?:-[a-z]+)*)( [A-Z][A-Z0-9_]*\b)?", option, text)


def options_of(arguments: argparse.Namespace) -> ReadOptions:
    """The options as given. Raises `InputError` for one that cannot be."""
    units = {}
    for pair in arguments.unit:
        column, mark, unit = pair.rpartition("=")
        if not mark or not column.strip() or not unit.strip():
            raise InputError(f"--unit is {pair!r}; allowed is COLUMN=UNIT")
        units[column.strip()] = unit.strip()
    given = {
        f.name: getattr(arguments, f.name)
        for f in fields(ReadOptions)
        if f.name != "units"
    }
    return ReadOptions(**given, units=units)
