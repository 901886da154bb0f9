"""What the user adds to a file, and what a dialect knows about its files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from softnn.contracts import InputError
from softnn.recording import Geometry

# Notes where a size was given that a file does not need.
NO_FORCE = "no force to use the given section on"
NO_TRAVEL = "no displacement to use --length on"
_ENDING = re.compile(r"\.[A-Za-z]\w{0,5}")  # `0.1mm` has none, `a.tra` has one


@dataclass(frozen=True)
class ReadOptions:
    """Information that a file lacks or has wrong. None and "" leave it to the file.

    Geometry is in mm and mm2. `rate_per_s` is the nominal strain rate [1/s]; without a
    time column it gives the time too, from strain. `interval_s` [s] between samples
    gives the time as well, and also replaces a faulty clock.

    `time` ... `temperature` name the column to use; `units` gives units by column name,
    `{"Force": "kN"}`, or of one file alone, `{"fast.csv:Force": "kN"}`. `compression`:
    the file counts compression positive. `flip`: "strain" or "stress", if the file has
    its sign reversed; of one file alone, "fast.csv:strain". `zero`: count strain and
    displacement from the start of the recording. `zero_stress`: count force and stress
    from there. `skip_bad_cells`: cells that are no numbers, or that
    repeat one far outside all others, are missing values.
    """

    length_mm: float | None = None
    area_mm2: float | None = None
    width_mm: float | None = None
    thickness_mm: float | None = None
    diameter_mm: float | None = None
    rate_per_s: float | None = None
    interval_s: float | None = None
    time: str = ""
    force: str = ""
    displacement: str = ""
    strain: str = ""
    stress: str = ""
    temperature: str = ""
    units: dict[str, str] = field(default_factory=dict)
    decimal: str = ""
    compression: bool = False
    flip: str = ""
    zero: bool = False
    zero_stress: bool = False
    skip_bad_cells: bool = False
    specimen: str = ""
    material: str = ""
    test: str = ""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float | int) and not isinstance(value, bool):
                if not 1e-9 < value < 1e9:
                    raise InputError(
                        f"{item.name} is {value}; allowed is above 0, below 1e9"
                    )
        if self.decimal not in ("", ".", ","):
            raise InputError(f"decimal is {self.decimal!r}; allowed is '.' or ','")
        if self.flip.rpartition(":")[2] not in ("", "strain", "stress"):
            raise InputError(
                f"flip is {self.flip!r}; allowed: 'strain', 'stress', or one of them "
                "of one file, as 'fast.csv:strain'"
            )

        self.geometry.check("in the options")

    def flips(self, axis: str, file: str | Path) -> bool:
        """Whether the sign of "strain" or "stress" is reversed in a file."""
        name, mark, turned = self.flip.rpartition(":")
        return turned == axis and (not mark or is_called(file, name))

    @property
    def has_area(self) -> bool:
        return self.geometry.area is not None

    @property
    def geometry(self) -> Geometry:
        return Geometry(**{f.name: getattr(self, f.name) for f in fields(Geometry)})


def name_of(file: str | Path) -> str:
    """The name of a recording: that of its file without the endings.

    >>> name_of("pull_0.1mm_s.csv"), name_of("lab/a.csv.gz"), name_of("Specimen_1.TRA")
    ('pull_0.1mm_s', 'a', 'Specimen_1')
    """
    path = Path(file)
    if path.suffix.lower() == ".gz":
        path = path.with_suffix("")
    return path.stem if _ENDING.fullmatch(path.suffix) else path.name


def is_called(file: str | Path, name: str) -> bool:
    """Whether a user's name or pattern means a file: with folder and ending or without.

    >>> is_called("lab/day 1/fast.csv", "day 1/fast"), is_called("fast.csv", "f*.csv")
    (True, True)
    >>> is_called("lab/fast.csv", "lab/slow.csv"), is_called("fast.csv", "")
    (False, False)
    """
    return any(name == n or fnmatchcase(n, name) for n in _names(file))


def _names(file: str | Path) -> Iterator[str]:
    path = PurePosixPath(Path(file).as_posix())
    for k in range(1, len(path.parts) + 1):
        part = PurePosixPath(*path.parts[-k:])
        yield part.as_posix()
        yield part.with_suffix("").as_posix()


@dataclass(frozen=True)
class Rules:
    """What a dialect knows beyond names and units.

    `columns`: role -> plain names, to use in place of the vocabulary's choice.
    `ignore`: plain names that mislead. `compression`: positive is compression.
    `unitless`: dimensionless columns are fractions although no unit says so.
    """

    dialect: str
    columns: dict[str, tuple[str, ...]] = field(default_factory=dict)
    ignore: tuple[str, ...] = ()
    compression: bool = False
    unitless: bool = False
    geometry: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
