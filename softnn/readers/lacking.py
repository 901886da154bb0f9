"""Two kinds of refusal that a folder treats apart: facts lack, or it is no test."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import Array, InputError
from softnn.plausible import spelt
from softnn.readers.guess import UNITS, strain_unit, stress_unit, time_unit, time_units
from softnn.readers.units import known
from softnn.readers.vocabulary import DIMENSION

USUAL = {
    "time": "s",
    "force": "N",
    "stress": "MPa",
    "displacement": "mm",
    "strain": "%",
    "temperature": "degC",
}
SECTION = "--area MM2, or --width MM and --thickness MM, or --diameter MM"


ASKED = {
    "area": ("--area", "MM2"),
    "length": ("--length", "MM"),
    "time": ("--interval", "SECONDS"),
}


class NoRecording(InputError):
    """A file that holds no test: a note, a lock file, a table of results."""


class Lacking(InputError):
    """A recording that does not say all that stress and strain are made of.

    `sizes`: "area" or "length" of the specimen, or "time"; `units`: role of each
    column without a known unit, by its name, `FILE:NAME` where it is of one file alone;
    `likely`: the unit that its numbers speak for, "" or absent where they may be
    either; `fits`: the units of a time that they do not speak against; `have`: the
    columns that are there.
    """

    def __init__(
        self,
        sizes: Iterable[str] = (),
        units: Mapping[str, str] | None = None,
        *,
        unknown: Mapping[str, str] | None = None,
        likely: Mapping[str, str] | None = None,
        fits: Mapping[str, list[str]] | None = None,
        values: Mapping[str, Array] | None = None,
        have: str = "",
        said: str = "",
        file: str | Path | None = None,
    ) -> None:
        self.sizes = tuple(s for s in ("area", "length", "time") if s in sizes)
        self.have = have
        self.units, self.unknown = dict(units or {}), dict(unknown or {})
        self.likely, self.values = dict(likely or {}), dict(values or {})
        self.fits = dict(fits or {})
        super().__init__(said or self._said(), file=file)

    def _said(self) -> str:
        parts = []
        for column, role in self.units.items():
            text, likely = self.unknown.get(column, ""), self.likely.get(column, "")
            what = f"has the unit {text!r}, unknown here" if text else "has no unit"
            unit = likely or "UNIT"
            parts.append(
                f"column {column!r} {what}; give it with --unit '{column}={unit}', or "
                f"in place of {unit} one of: {known(DIMENSION[role])}"
                + self._makes(column)
            )
        if "area" in self.sizes:
            both = "length" in self.sizes
            parts.append(
                f"no cross-section{' and no length' if both else ''} of the specimen "
                f"in it; give {SECTION}{'; and --length MM' if both else ''}"
            )
        elif "length" in self.sizes:
            parts.append(
                "no length of the specimen in it, so displacement gives no strain; "
                "give --length MM"
            )
        if "time" in self.sizes:
            parts.append(
                f"no column of time; it has {self.have}. Name one with --time, or give "
                "--interval SECONDS between samples, or --rate STRAIN_PER_SECOND"
            )
        return ". ".join(parts)

    def _makes(self, column: str) -> str:
        """The numbers of a column, and what the likely unit makes of them."""
        values, likely = self.values.get(column), self.likely.get(column, "")
        if values is None or not np.isfinite(values).any():
            return ""
        role, top = self.units[column], float(np.nanmax(np.abs(values)))
        said = f". It goes to {top:.4g}"
        if role == "strain":
            units = [likely] if likely else ["mm/mm", "%"]
            told = [f"{100 * top * UNITS[role][u]:.4g} % in {u}" for u in units]
            return f"{said}: {' or '.join(told)}"
        if role == "time":
            lasts = float(np.nanmax(values) - np.nanmin(values))
            units = [likely] if likely else ["s", "ms"]
            told = [f"{spelt(lasts * UNITS[role][u])} in {u}" for u in units]
            return f"{said}: {' or '.join(told)}"
        return said

    def judged(self, strain: Array | None, columns: Mapping[str, str]) -> Lacking:
        """The same with the units that the numbers speak for.

        `strain` (n,) as a fraction, None where it is not known; `columns`: the columns
        without a unit that are used, by role.
        """
        likely, fits = {}, {}
        if (name := columns.get("strain")) is not None:
            likely[name] = strain_unit(self.values[name])
            if likely[name]:
                strain = self.values[name] * UNITS["strain"][likely[name]]
        for role, judge in (("stress", stress_unit), ("time", time_unit)):
            if (name := columns.get(role)) is not None:
                likely[name] = judge(self.values[name], strain)
        if (name := columns.get("time")) is not None:
            fits[name] = time_units(self.values[name], strain)
        for role in ("force", "displacement", "temperature"):
            if (name := columns.get(role)) is not None:
                likely[name] = USUAL[role]
        return Lacking(
            self.sizes,
            self.units,
            unknown=self.unknown,
            likely=likely,
            fits=fits,
            values=self.values,
            have=self.have,
        )

    def with_likely(self, likely: Mapping[str, str]) -> Lacking:
        """The same with other units for those of the columns that it lacks."""
        more = {c: u for c, u in likely.items() if c in self.units}
        return self.and_also(Lacking(units={}, likely=more)) if more else self

    @property
    def options(self) -> list[str]:
        """The words that a command lacks, with the units that the numbers speak for."""
        units = [
            word
            for column in self.units
            for word in ("--unit", f"{column}={self.likely.get(column) or 'UNIT'}")
        ]
        sizes = [word for s in self.sizes for word in ASKED[s]]
        return [*units, *sizes]

    def and_also(self, other: Lacking) -> Lacking:
        """Both at once."""
        return Lacking(
            (*self.sizes, *other.sizes),
            self.units | other.units,
            unknown=self.unknown | other.unknown,
            likely=self.likely | other.likely,
            fits=self.fits | other.fits,
            values=self.values | other.values,
            have=self.have or other.have,
        )


def together(lacking: Mapping[str, Lacking], others: bool) -> Lacking:
    """What several files lack, by file; `others`: whether more files lack nothing.

    A unit is asked for by the name of the file where other files have a column of that
    name in another unit, or with numbers that speak for another. Rates differ by more
    than minutes from seconds: a time has one unit in all files, one that fits each of
    them, or is left open.
    """
    units: dict[str, str] = {}
    lacking = {file: one.with_likely(_clocks(lacking)) for file, one in lacking.items()}
    about: Any = {"unknown": {}, "likely": {}, "values": {}}
    for column in dict.fromkeys(c for one in lacking.values() for c in one.units):
        of = {file: one for file, one in lacking.items() if column in one.units}
        likely = [one.likely.get(column, "") for one in of.values()]
        usual = max(dict.fromkeys(likely), key=likely.count)
        for file, one in of.items():
            alike = one.likely.get(column, "") == usual
            general = alike and not others and len(of) == len(lacking)
            key = column if general else f"{file}:{column}"
            units[key] = one.units[column]
            for name, values in about.items():
                if column in getattr(one, name):
                    values[key] = getattr(one, name)[column]
    return Lacking(
        {s for one in lacking.values() for s in one.sizes},
        units,
        have=next((one.have for one in lacking.values() if one.have), ""),
        **about,
    )


def _clocks(lacking: Mapping[str, Lacking]) -> dict[str, str]:
    """The unit of each column of time on which the files do not agree, "" if open."""
    out = {}
    for column in dict.fromkeys(c for one in lacking.values() for c in one.fits):
        fits = [one.fits[column] for one in lacking.values() if column in one.fits]
        likely = {one.likely.get(column, "") for one in lacking.values()
                  if column in one.fits}  # fmt: skip
        if len(likely) > 1:
            shared = [u for u in UNITS["time"] if all(u in f for f in fits)]
            out[column] = shared[0] if shared else ""
    return out


def placed(error: InputError, file: str | Path) -> InputError:
    """The error, with its kind, as one of this file."""
    if error.file is not None:
        return error
    if isinstance(error, Lacking):
        return Lacking(
            error.sizes,
            error.units,
            unknown=error.unknown,
            likely=error.likely,
            fits=error.fits,
            values=error.values,
            have=error.have,
            said=str(error),
            file=file,
        )
    kind = NoRecording if isinstance(error, NoRecording) else InputError
    return kind(str(error), file=file)
