"""Two kinds of refusal that a folder treats apart: facts lack, or it is no test."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from softnn.contracts import InputError
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


class NoRecording(InputError):
    """A file that holds no test: a note, a lock file, a table of results."""


class Lacking(InputError):
    """A recording that does not say all that stress and strain are made of.

    `sizes`: "area" or "length" of the specimen; `units`: role of each column without
    a known unit, by its name.
    """

    def __init__(
        self,
        sizes: Iterable[str] = (),
        units: Mapping[str, str] | None = None,
        *,
        unknown: Mapping[str, str] | None = None,
        said: str = "",
        file: str | Path | None = None,
    ) -> None:
        self.sizes = tuple(dict.fromkeys(s for s in ("area", "length") if s in sizes))
        self.units, self.unknown = dict(units or {}), dict(unknown or {})
        super().__init__(said or self._said(), file=file)

    def _said(self) -> str:
        parts = []
        for column, role in self.units.items():
            text = self.unknown.get(column, "")
            what = f"has the unit {text!r}, unknown here" if text else "has no unit"
            parts.append(
                f"column {column!r} {what}; give it with --unit "
                f"'{column}={USUAL[role]}', or in place of {USUAL[role]} one of: "
                f"{known(DIMENSION[role])}"
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
        return ". ".join(parts)

    @property
    def options(self) -> list[str]:
        """The words that a command lacks, with the usual units."""
        units = [
            word
            for column, role in self.units.items()
            for word in ("--unit", f"{column}={USUAL[role]}")
        ]
        sizes = [w for s in self.sizes for w in (f"--{s}", "MM2" if s == "area" else
                                                 "MM")]  # fmt: skip
        return [*units, *sizes]

    def and_also(self, other: Lacking) -> Lacking:
        """Both at once."""
        return Lacking(
            (*self.sizes, *other.sizes),
            self.units | other.units,
            unknown=self.unknown | other.unknown,
        )


def placed(error: InputError, file: str | Path) -> InputError:
    """The error, with its kind, as one of this file."""
    if error.file is not None:
        return error
    if isinstance(error, Lacking):
        return Lacking(
            error.sizes, error.units, unknown=error.unknown, said=str(error), file=file
        )
    kind = NoRecording if isinstance(error, NoRecording) else InputError
    return kind(str(error), file=file)
