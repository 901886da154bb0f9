"""Recording: one test of one specimen, as numbers, with a log of all changes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softnn import glance
from softnn.axes import COMPONENTS, SPECIMEN, Axes, axes_of
from softnn.contracts import Array, Chunk, InputError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Geometry:
    """What turns load and elongation into stress and strain. None: not known."""

    length_mm: float | None = None
    area_mm2: float | None = None
    width_mm: float | None = None
    thickness_mm: float | None = None
    diameter_mm: float | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(
                    f"geometry {item.name} is {value}; it must be a number above 0"
                )

    def check(self, where: str, alike: float = 0.02) -> None:
        """Raise `InputError` where two ways to say the section differ by over 2 %."""
        sections: dict[str, float] = {}
        if self.area_mm2 is not None:
            sections[f"area {self.area_mm2:g} mm2"] = self.area_mm2
        if self.width_mm is not None and self.thickness_mm is not None:
            name = (
                f"width {self.width_mm:g} mm times thickness {self.thickness_mm:g} mm"
            )
            sections[name] = self.width_mm * self.thickness_mm
        if self.diameter_mm is not None:
            circle = np.pi * self.diameter_mm**2 / 4
            sections[f"diameter {self.diameter_mm:g} mm"] = circle
        low, high = (f(sections.values(), default=1.0) for f in (min, max))
        if high > (1 + alike) * low:
            told = ", ".join(
                name if name.startswith("area") else f"{name} is {section:.4g} mm2"
                for name, section in sections.items()
            )
            raise InputError(
                f"the sizes {where} contradict each other: {told}; leave the wrong one "
                "out"
            )

    @property
    def area(self) -> float | None:
        """Cross-section in mm2: as given, else width x thickness, else a circle."""
        if self.area_mm2 is not None:
            return self.area_mm2
        if self.width_mm is not None and self.thickness_mm is not None:
            return self.width_mm * self.thickness_mm
        if self.diameter_mm is not None:
            return np.pi * self.diameter_mm**2 / 4
        return None


def history_of(
    history: Recording | ArrayLike,
    strain: ArrayLike | None = None,
    temperature_C: ArrayLike | None = None,
) -> tuple[str, Chunk]:
    """Return the name and the strain history of a recording, or of times and strains.

    Times (n,) [s] must not go back; strains (n,) are numbers. Raises `InputError`.

    >>> history_of([0, 1, 2], [0, 0.1, 0.2])[1].strain.tolist()
    [0.0, 0.1, 0.2]
    """
    if isinstance(history, Recording):
        if strain is not None or temperature_C is not None:
            raise InputError(
                "a recording has its own strain and temperature; give times and "
                "strain, or a recording alone"
            )
        return history.name, history.history
    if strain is None:
        raise InputError("strain is missing; give a recording, or times and strain")
    columns = [np.asarray(v, dtype=float) for v in (history, strain)]
    if temperature_C is not None:
        columns.append(np.asarray(temperature_C, dtype=float))
    time = columns[0]
    if any(v.shape != time.shape or v.ndim != 1 for v in columns) or len(time) < 2:
        raise InputError(
            f"shapes are {[v.shape for v in columns]}; allowed are rows of one length, "
            "at least two samples"
        )
    if not all(np.isfinite(v).all() for v in columns) or np.any(np.diff(time) < 0):
        raise InputError(
            "time, strain and temperature must be numbers, and time must not go back"
        )
    return "programme", Chunk(time, columns[1], columns[2] if columns[2:] else None)


@dataclass(frozen=True)
class Step:
    """One entry of a recording's log: a preparation step and its arguments."""

    name: str
    arguments: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Time, strain and stress of one test, and their source.

    Arrays are (n,), float64 and read-only. time_s [s] is finite and never decreases;
    strain [-] and stress_MPa [MPa] are engineering values, compression negative, and
    hold NaN for a missing value. `rate_per_s` is the nominal strain rate [1/s] of the
    test's loading. `log` lists all changes since the file was read. For a component
    `axes` gives the quantities and units in place of strain and stress, such as force
    in N over elongation in mm. `simulated_MPa` is the stress by the user's own
    simulation of this strain.

    >>> import numpy as np
    >>> r = Recording(np.arange(3.0), np.array([0, 0.1, 0.2]), np.array([0, 0.3, 0.5]))
    >>> r.with_step("scaled", {"by": 2}, stress_MPa=2 * r.stress_MPa).log[-1].name
    'scaled'
    """

    time_s: Array
    strain: Array
    stress_MPa: Array
    temperature_C: Array | None = None
    force_N: Array | None = None
    elongation_mm: Array | None = None
    name: str = ""
    specimen: str = ""
    material: str = ""
    test: str = ""
    rate_per_s: float | None = None
    geometry: Geometry = Geometry()
    source: str = ""
    log: tuple[Step, ...] = ()
    axes: Axes = SPECIMEN
    simulated_MPa: Array | None = None

    def __repr__(self) -> str:
        return f"<Recording {self.name!r}: {glance.facts(self)}>"

    def _repr_html_(self) -> str:
        return glance.html(self)

    def __post_init__(self) -> None:
        for column in COLUMNS:
            values = getattr(self, column)
            if values is None:
                continue
            array = np.array(values, dtype=float)  # a copy: nobody else can change it
            array.setflags(write=False)
            object.__setattr__(self, column, array)
        check_columns(self.columns, self.source or self.name or None)

    @classmethod
    def from_frame(cls, frame: pd.DataFrame, **about: Any) -> Recording:
        """A recording of a table with its columns by name; others are left alone.

        `about`: name, specimen and other fields. Raises `InputError`.

        >>> import pandas as pd
        >>> table = {"time_s": [0, 1], "strain": [0, 0.1], "stress_MPa": [0, 0.2]}
        >>> r = Recording.from_frame(pd.DataFrame(table), name="a")
        >>> r.to_frame().equals(pd.DataFrame(table, dtype=float))
        True
        """
        import pandas as pd

        axes, columns = columns_of([str(c) for c in frame.columns], about.get("name"))
        channels: dict[str, Any] = {"axes": axes}
        for channel, column in columns.items():
            values = pd.to_numeric(frame[column], errors="coerce")
            text = (values.isna() & frame[column].notna()).to_numpy()
            if text.any():
                i = int(text.argmax())
                raise InputError(
                    f"sample {i}: {str(frame[column].iloc[i])[:40]!r} is not a number",
                    file=about.get("name"),
                    column=column,
                )
            channels[channel] = values.to_numpy(float)
        return cls(**channels, **about)

    def to_frame(self) -> pd.DataFrame:
        """The channels as a table, a column each."""
        import pandas as pd

        return pd.DataFrame(self.columns)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def columns(self) -> dict[str, Array]:
        """The channels this recording has, by column name, in a fixed order."""
        own = dict(zip(REQUIRED, self.axes.columns, strict=True))
        own["simulated_MPa"] = self.axes.simulated
        return {own.get(c, c): values for c, values in self._channels.items()}

    @property
    def _channels(self) -> dict[str, Array]:
        return {c: getattr(self, c) for c in COLUMNS if getattr(self, c) is not None}

    @property
    def history(self) -> Chunk:
        """The imposed strain; missing strain is interpolated linearly in time."""
        warm = self.temperature_C
        if warm is not None and np.isnan(warm).all():
            warm = None
        return Chunk(self.time_s, bridged(self.strain, self.time_s), warm)

    def with_step(
        self, name: str, arguments: dict[str, Any] | None = None, **changes: Any
    ) -> Recording:
        """Return a changed copy whose log has the step's `name` and arguments."""
        step = Step(name, dict(arguments or {}))
        return replace(self, **changes, log=self.log + (step,))

    def take(self, index: slice | np.ndarray) -> Recording:
        """The samples at `index`, every channel; not logged, the caller does that."""
        channels: dict[str, Any] = {c: v[index] for c, v in self._channels.items()}
        return replace(self, **channels)


COLUMNS = (
    "time_s",
    "strain",
    "stress_MPa",
    "temperature_C",
    "force_N",
    "elongation_mm",
    "simulated_MPa",
)
REQUIRED = COLUMNS[:3]


def columns_of(
    given: Sequence[str], file: str | Path | None = None, row: int | None = None
) -> tuple[Axes, dict[str, str]]:
    """The axes of a table with these columns; its column of each channel that it has.

    Raises `InputError` for one without time or without both of any axes.
    """
    axes = axes_of(given)
    wanted = (axes or SPECIMEN).columns
    absent = [c for c in wanted if c not in given]
    if absent:
        others = " or ".join(",".join(a.columns[1:]) for a in COMPONENTS)
        raise InputError(
            f"no such column; it has {', '.join(map(repr, given)) or 'none'}. Needed: "
            f"{','.join(REQUIRED)}; of a component, in place of the last two, {others}",
            file=file,
            row=row,
            column=absent[0],
        )
    assert axes is not None
    found = dict(zip(REQUIRED, wanted, strict=True))
    more = {c: c for c in COLUMNS[3:] if c in given and c not in wanted}
    more.pop("simulated_MPa", None)
    if axes.simulated in given:
        more["simulated_MPa"] = axes.simulated
    return axes, found | more


def check_columns(
    columns: dict[str, Array], file: str | None = None, first_row: int | None = None
) -> None:
    """Raise `InputError` for channels that cannot be a recording, its axes first.

    `first_row` is the line of the file that holds sample 0, so that the message can
    name a row; None names the sample instead.
    """

    def fail(message: str, sample: int | None, column: str) -> None:
        if sample is not None and first_row is None:
            message = f"sample {sample}: {message}"
        row = sample + first_row if sample is not None and first_row else None
        raise InputError(message, file=file, row=row, column=column)

    time, needed = columns["time_s"], list(columns)[:3]
    if len(time) == 0:
        raise InputError("no rows; at least two samples are needed", file=file)
    if len(time) == 1:
        raise InputError("one row; at least two samples are needed", file=file)
    for name, values in columns.items():
        if values.shape != time.shape:
            raise InputError(
                f"{name} has shape {values.shape}, time_s {time.shape}; "
                "all channels need one value a sample",
                file=file,
            )
        infinite = np.isinf(values)
        if infinite.any():
            fail("infinite value; allowed is a number", int(infinite.argmax()), name)
        if name in needed and np.isnan(values).all():
            fail("holds no number at all; check the export", None, name)
    missing = np.isnan(time)
    if missing.any():
        fail("no time; every row needs one", int(missing.argmax()), "time_s")
    backwards = np.diff(time) < 0
    if backwards.any():
        i = int(backwards.argmax()) + 1
        # To sort would scramble rows of two tests, or of a clock without its zeros.
        reverse = "sort the rows by time" if np.all(np.diff(time) <= 0) else (
            "split the file where a new test begins, or number its samples with "
            "--interval SECONDS"
        )  # fmt: skip
        fail(
            f"time goes backwards, from {time[i - 1]:.9g} to {time[i]:.9g} s; "
            f"{reverse}",
            i,
            "time_s",
        )


def bridged(values: Array, time: Array) -> Array:
    """The values (n,), missing ones straight in time between their neighbours."""
    good = np.isfinite(values)
    if not good.any():
        raise InputError("a column of strain or simulation holds no number at all")
    return np.where(good, values, np.interp(time, time[good], values[good]))


def data_hash(recordings: Iterable[Recording]) -> str:
    """SHA-256 (hex) over names and channels, the same wherever the files lie."""
    digest = hashlib.sha256()
    for recording in recordings:
        digest.update(recording.name.encode())
        for column, values in recording.columns.items():
            digest.update(column.encode())
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()
