"""What the user adds to a file, and what a dialect knows about its files."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from softnn.contracts import InputError
from softnn.recording import Geometry


@dataclass(frozen=True)
class ReadOptions:
    """What a file does not say, or says wrongly. None and "" leave it to the file.

    Geometry in mm and mm2, `rate_per_s` the nominal strain rate [1/s]; without a time
    column it gives the time too, from strain, as `interval_s` [s] between samples
    does, which also replaces a faulty clock. `time` ... `temperature` name the column
    to use; `units` gives units by column name, `{"Force": "kN"}`. `compression`: the
    file counts compression positive. `flip`: "strain" or "stress", the one whose sign
    the file has reversed. `zero`: strain and displacement count from where
    the recording starts. `skip_bad_cells`: cells that are no numbers are
    missing values.
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

        if self.flip not in ("", "strain", "stress"):
            raise InputError(f"flip is {self.flip!r}; allowed: 'strain', 'stress'")

    @property
    def has_area(self) -> bool:
        return self.geometry.area is not None

    @property
    def geometry(self) -> Geometry:
        return Geometry(**{f.name: getattr(self, f.name) for f in fields(Geometry)})


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
