"""What a user adds to a file, as options of a command."""

from __future__ import annotations

import argparse
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
            type=float,
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
        metavar="COLUMN=UNIT",
        help="unit of a column the file gives none for, e.g. 'Force=kN'",
    )
    group.add_argument("--decimal", default="", choices=[".", ","])
    group.add_argument(
        "--compression", action="store_true", help="the file counts compression > 0"
    )
    group.add_argument(
        "--skip-bad-cells",
        action="store_true",
        help="cells that are no numbers become missing values",
    )
    for name in ("specimen", "material", "test"):
        group.add_argument(f"--{name}", default="", help=f"{name}, to be recorded")


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
