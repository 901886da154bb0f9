"""One table of a file -> one Recording: columns chosen, units converted, gaps named.

In this order these decide: options of the user, rules of the dialect, names and units
of the columns, the header. Nothing is assumed silently: each choice is written into the
recording's log, and a missing value is an error that names the option.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.chosen import Chosen, called
from softnn.readers.clocks import spread
from softnn.readers.header import header_number
from softnn.readers.lacking import Lacking, NoRecording, placed
from softnn.readers.measures import STRAIN, STRESS, measure
from softnn.readers.numbers import FEW, MANY, decimal_mark, numbers
from softnn.readers.options import NO_FORCE, NO_TRAVEL, ReadOptions, Rules, name_of
from softnn.readers.source import Source
from softnn.readers.table import (
    Table,
    by_specimen,
    find_tables,
    has_role,
    named_apart,
    upright,
    without_reserve,
    without_twins,
)
from softnn.readers.units import parse_unit
from softnn.readers.vocabulary import (
    COMPRESSIVE,
    DIMENSION,
    HEIGHT,
    PRESSED,
    REMARK,
    TEST_KIND,
    plain,
    rank,
)
from softnn.recording import Recording, Step
from softnn.start import ODD, OFFSET, beginning, resting, stale, start, unloaded

# Beyond these a unit or the geometry is wrong, not the material: 100 is 10,000 %,
# 20 GPa is beyond any wire.
MAX_STRAIN = 100.0
MAX_STRESS = 20_000.0
LOST = 5  # samples or a fiftieth, that may stand far off together
AGAINST = -0.5  # correlation of load and travel, where one has the sign reversed
# What is read of a dynamic test, in place of a sweep over frequencies.
SWEEP = (
    "a sweep is a result. softnn reads histories: columns of time, strain and stress "
    "of the waveforms (softnn.dynamic makes storage and loss modulus of them), or an "
    "axial, ramp or relaxation step; export those"
)
ROUNDED = "{!r} is rounded, and rows share a time: they are spread evenly"
DOUBTFUL = 1.4  # where that is told
EXTENSOMETER = re.compile(r"\b(ave|video|strain \d)\b")
DISAGREE = 3.0  # a column against force / area or displacement / length


def assemble(
    table: Table, rules: Rules, options: ReadOptions, decimal: str = "."
) -> Recording:
    """The recording of one table; raises `InputError` naming file, row and column."""
    try:
        return _Assembly(table, rules, options, decimal).recording()
    except InputError as error:
        raise placed(error, table.where) from None


class _Assembly(Chosen):
    """The recording made of the columns."""

    turned = False  # whether the load changes sign to go with the travel

    def recording(self) -> Recording:
        table, options = self.table, self.options
        if not table.rows:
            raise InputError("no rows; at least two samples are needed")
        if table.bad:
            self.left_out(table.bad)
        if swept(table):
            raise NoRecording(f"holds storage and loss modulus: {SWEEP}")
        if self.lacks() > 1:
            raise NoRecording(
                f"no columns of a test; it has {self.have()}; name them with --time, "
                "--force or --stress, and --displacement or --strain"
                + "; a component has time_s,deflection_deg,torque_Nm"
                * any("torque" in c.plain for c in table.columns)
            )
        force, stress, strain, elongation, time = self.channels()
        self.check_short()
        old = self.first
        if old:
            self.note_stale()
        elif count := stale(strain, stress):
            # Zeros and lengths are those of the first row that counts.
            one = _Assembly(table, self.rules, options, self.decimal, count)
            return one.recording()
        timed = self.timed(time)
        self.check_time(time[timed], strain[timed])
        self.check_size(strain, MAX_STRAIN, "strain", "--length")
        self.check_size(stress, MAX_STRESS, "stress [MPa]", "--area")
        self.note_jumps(strain, "strain")
        self.note_jumps(stress, "stress")
        stress = self.nominal(stress, strain)
        arguments: dict[str, Any] = {
            "dialect": self.rules.dialect,
            "columns": self.used,
            "notes": self.notes,
        }
        if table.sheet:
            arguments["sheet"] = table.sheet
        if vain := self.in_vain():
            arguments["in_vain"] = vain
        specimen = options.specimen or table.label or self.header.specimen
        if table.label and specimen == table.label:
            arguments["label"] = table.label
        channels = {
            "time_s": time - np.nanmin(time[old:]) if old else time,
            "strain": strain,
            "stress_MPa": stress,
            "temperature_C": self.optional("temperature"),
            "force_N": force,
            "elongation_mm": elongation,
            "simulated_MPa": self.simulated(),
        }
        kept: dict[str, Any] = {k: v for k, v in channels.items() if v is not None}
        return Recording(
            **{k: v[timed][old:] for k, v in kept.items()},
            name=name_of(table.file),
            specimen=specimen,
            material=options.material or self.header.material,
            test=options.test,
            rate_per_s=self.rate(),
            geometry=self.geometry,
            source=str(table.file),
            log=(Step("read", arguments),),
        )

    def lacks(self) -> int:
        """How many of time, load and travel have no column, named or not."""
        options = self.options
        timed = options.interval_s is not None or options.rate_per_s is not None
        return (
            2
            - sum(
                any(self.candidates(role) for role in roles)
                for roles in (("force", "stress"), ("displacement", "strain"))
            )
            + (not timed and not self.candidates("time"))
        )

    def timed(self, time: Array) -> Array:
        """Rows (n,) to keep: those with a time, where others may be left out."""
        good = np.isfinite(time)
        few = (~good).sum() <= max(FEW, MANY * len(time))
        if not good.all() and self.options.skip_bad_cells and few:
            self.notes.append(f"{(~good).sum()} rows without a time left out")
            return good
        return np.ones(len(time), bool)

    def simulated(self) -> Array | None:
        """The stress of a simulation that stands beside the measured one."""
        for i, column in enumerate(self.table.columns):
            unit = parse_unit(self.unit_of(column, "simulated"))
            named = re.search(r"\bsimulat", column.plain)
            if named and unit is not None and unit.dimension == "stress":
                values, _ = numbers(
                    self.table, i, self.decimal, self.options.skip_bad_cells
                )
                self.used["simulated"] = str(column)
                sign = -1.0 if self.flipped(column, "stress") != self.turned else 1.0
                return sign * values * unit.factor
        return None

    def channels(self) -> tuple[Array | None, Array, Array, Array | None, Array]:
        """Force, stress, strain, elongation and time; all that lacks is said at once.

        Raises `NoRecording` where there is nothing of a test.
        """
        lacking: Lacking | None = None
        force = stress = strain = elongation = time = None
        try:
            force, stress = self.force_and_stress()
        except Lacking as error:
            lacking = error
        try:
            load = stress if force is None else force
            strain, elongation = self.strain(load)
        except Lacking as error:
            lacking = error if lacking is None else lacking.and_also(error)
        try:
            time = self.time(strain)
        except Lacking as error:
            lacking = error if lacking is None else lacking.and_also(error)
        if lacking is not None:
            columns = {role: name for name, role in lacking.units.items()}
            raise lacking.judged(strain, columns)
        assert stress is not None
        assert strain is not None
        assert time is not None
        turn_strain, self.turned = self.one_sign(strain, stress)
        if turn_strain:
            strain = -strain
            elongation = None if elongation is None else -elongation
        if self.turned:
            stress, force = -stress, None if force is None else -force
        if self.options.zero_stress:
            rest = slice(self.first, self.first + resting(strain[self.first :]))
            offset = float(np.nanmedian(stress[rest])) if len(stress) else 0.0
            self.notes.append(f"{offset:.4g} MPa taken off the stress (--zero-stress)")
            stress = stress - offset
            if force is not None:
                force = force - float(np.nanmedian(force[rest]))
        return force, stress, strain, elongation, time

    def force_and_stress(self) -> tuple[Array | None, Array]:
        """Force and stress; the force may be unclear where it is not needed."""
        try:
            force = self.read("force")
        except Lacking as error:
            wanted = self.options.force or self.options.has_area
            if wanted or self.find("stress") is None:
                if self.geometry.area is None:
                    error = error.and_also(Lacking(["area"]))
                raise error from None
            self.notes.append("force left out: its unit is not known")
            force = None
        return force, self.stress(force)

    def optional(self, role: str) -> Array | None:
        """A channel nothing depends on: without a clear unit it is left out."""
        try:
            return self.read(role)
        except InputError as error:
            if getattr(self.options, role):
                raise
            self.notes.append(f"{role} left out: {error}")
            return None

    def stress(self, force: Array | None) -> Array:
        """Force / area when the user gives the section, else stress as recorded."""
        options, area = self.options, self.geometry.area
        if options.has_area and force is not None and not options.stress:
            assert area is not None
            self.note_apart(self.beside("stress"), force / area, "force / area", 1)
            return force / area
        stress = self.read("stress")
        if options.has_area and not options.stress:
            self.notes.append(NO_FORCE)
        if stress is not None:
            if measure(plain(self.used["stress"]), STRESS):
                pass  # made nominal once the strain is known
            elif force is not None and area is not None:
                self.agree(stress, force / area, "stress", "force / area")
            return stress
        if force is None:
            raise InputError(
                self.empty("force", "stress")
                or f"no column of force or stress; it has {self.have()}. "
                "Name one with --force or --stress"
            )
        if area is None:
            self.header.refuse_unknown(("area", "width", "thickness", "diameter"))
            raise Lacking(["area"])
        return force / area

    def nominal(self, stress: Array, strain: Array) -> Array:
        """A column of another stress made nominal, force over the first section."""
        other = measure(plain(self.used.get("stress", "")), STRESS)
        if other is None:
            return stress
        self.notes.append(other[0])
        return stress * other[1](1 + strain)

    def note_fraction(self, strain: Array) -> None:
        """A note where a column without a unit is taken as it stands."""
        name = self.used["strain"]
        top = float(np.nanmax(np.abs(strain), initial=0.0))
        bare = any(str(c) == name and not self.unit_of(c, "strain")
                   for c in self.table.columns)  # fmt: skip
        if bare and not self.rules.unitless:
            self.notes.append(
                f"{name!r} has no unit and is taken as a fraction, up to "
                f"{100 * top:.4g} %; if it is in per cent, say --unit '{name}=%'"
            )

    def one_sign(self, strain: Array, load: Array) -> tuple[bool, bool]:
        """Whether the strain or the load has to change sign to go with the other.

        One is compression by its name, or a gap that closes, and counts so; the other
        has a name of no direction, and grows where it should fall.
        """
        options = self.options
        turned = [options.flips(a, self.table.file) for a in ("strain", "stress")]
        told = options.compression or any(turned) or self.rules.compression
        travel, pull = (
            next((r for r in roles if r in self.names), "")
            for roles in (("displacement", "strain"), ("force", "stress"))
        )
        name = self.names.get(travel, "")
        shut = COMPRESSIVE.search(name) or HEIGHT.search(name)
        pressed = COMPRESSIVE.search(self.names.get(pull, ""))
        good = np.isfinite(strain) & np.isfinite(load)
        if told or good.sum() < 5:
            return False, False
        if not shut and not pressed and self.said_pressed(strain[good], load[good]):
            return True, True
        if bool(shut) == bool(pressed):
            return False, False
        if not (np.ptp(strain[good]) > 0 and np.ptp(load[good]) > 0):
            return False, False
        if np.corrcoef(strain[good], load[good])[0, 1] > AGAINST:
            return False, False
        named, other = (travel, pull) if shut else (pull, travel)
        self.notes.append(
            f"{self.used[other]!r} is turned: it counts compression as positive, as "
            f"{self.used[named]!r} tells"
        )
        return not shut, bool(shut)

    def said_pressed(self, strain: Array, load: Array) -> bool:
        """Whether the header says compression, and both axes count it as positive."""
        entry = next(
            (
                e
                for e in self.table.header
                if TEST_KIND.search(plain(e.key)) and PRESSED.search(plain(e.value))
            ),
            None,
        )
        if entry is None or min(strain.sum(), load.sum()) <= 0:
            return False
        self.notes.append(
            f"the header's {entry.key!r} is {entry.value!r}: positive values are taken "
            "as compression"
        )
        return True

    def left_out(self, bad: Sequence[tuple[int, str]]) -> None:
        """Rows that fit no column are left out if the user says so, else refused."""
        line, told = bad[0]
        few = len(bad) <= max(FEW, MANY * len(self.table.rows))
        if not (self.options.skip_bad_cells and few):
            how = (
                "; repair the row, or leave such rows out with --skip-bad-cells"
                if few
                else f", and {len(bad) - 1} more rows alike; export the file again"
            )
            raise InputError(told + how, file=self.table.where, row=line)
        self.notes.append(f"{len(bad)} rows left out, the first {line}: {told}")

    def check_short(self) -> None:
        """Refuse a row without some of its last cells, unless none of them is needed.

        A cell lost within a row moves the others to the left; so those that are used
        have to go on from the rows around.
        """
        table, width = self.table, len(self.table.columns)
        if not table.short:
            return
        shortest = min(count for _, count in table.short)
        if all(REMARK.search(c.plain) for c in table.columns[shortest:]):
            return  # a column for what an operator types now and then
        many = len(table.short) > max(FEW, MANY * len(table.rows))
        whole = np.arange(len(table.rows))
        others = np.setdiff1d(whole, [k for k, _ in table.short])
        for k, count in table.short:
            near = others[np.argsort(np.abs(others - k), kind="stable")[:6]]
            if many or not all(
                i < count and self.goes_on(i, k, near) for i in self.cells
            ):
                raise InputError(
                    f"{count} values under {width} column names, and it is open which "
                    "is missing; complete the row, or delete it",
                    file=table.where,
                    row=int(table.lines[k]),
                )
        first = int(table.lines[table.short[0][0]])
        self.notes.append(
            f"{len(table.short)} rows lack their last cells, which are not needed; "
            f"the first is row {first}"
        )

    def goes_on(self, index: int, k: int, near: Array) -> bool:
        """Whether a cell of row k fits those of the rows `near`."""
        values = self.cells.get(index)
        if values is None:
            return True
        if not len(near) or not np.isfinite(values[near]).any():
            return False
        low, high = np.nanmin(values[near]), np.nanmax(values[near])
        slack = 3 * (high - low) + 0.01 * (np.nanmax(values) - np.nanmin(values))
        return bool(low - slack <= values[k] <= high + slack)

    def note_stale(self) -> None:
        """A note on the first rows, which are left out."""
        first, last = self.table.lines[0], self.table.lines[self.first - 1]
        rows = f"row {first}" if self.first == 1 else f"rows {first} to {last}"
        self.notes.append(
            f"{rows} left out: a channel jumps there alone, or from a load to none, as "
            "where a machine writes what was left from before"
        )

    def zeroed(self, moved: Array, load: Array | None, role: str) -> Array:
        """Travel from where the recording starts, if that cannot be the specimen's."""
        name = self.used.get(role, role)
        if self.options.zero:
            self.notes.append(f"{name!r} counts from where it starts (--zero)")
            return moved - start(moved[self.first :])
        if load is None or any(n.startswith("zero of") for n in self.notes):
            return moved
        first, share = beginning(moved[self.first :], load[self.first :], preload=True)
        bears = "no load" if unloaded(load[self.first :]) else "but a preload"
        unit = " mm" if role == "displacement" else ""
        if role == "displacement" and share > OFFSET:
            self.notes.append(
                f"{name!r} starts at {first:.4g}{unit} with {bears}, the machine's "
                "position; it counts from there"
            )
            return moved - first
        if role == "strain" and 0.9 < first < 1.1:
            column = name.partition(" [")[0]
            self.notes.append(
                f"{column!r} starts at {first:.4g} with {bears}, as a stretch ratio "
                f"does; if it is one, say --unit '{column}=stretch'"
            )
        elif share > ODD:
            self.notes.append(
                f"{name!r} starts at {first:.4g}{unit} with {bears}; if that is the "
                "machine's position, say --zero"
            )
        return moved

    def strain(self, load: Array | None = None) -> tuple[Array, Array | None]:
        """Strain and elongation; from the displacement when a length is given."""
        options = self.options
        elongation: Array | None = None
        if options.length_mm is not None and not options.strain:
            elongation = self.read("displacement")
            if elongation is not None:
                elongation = self.zeroed(elongation, load, "displacement")
                made = elongation / options.length_mm
                self.note_apart(self.beside("strain"), made, "travel / length", 1)
                return made, elongation
            self.notes.append(NO_TRAVEL)
        strain = self.read("strain")
        if strain is not None:
            other = measure(plain(self.used["strain"]), STRAIN)
            if other is not None:
                self.notes.append(other[0])
                strain = other[1](strain)
            self.note_fraction(strain)
            strain = self.zeroed(strain, load, "strain")
            elongation = self.optional("displacement")
            length = self.geometry.length_mm
            if elongation is not None and length is not None:
                extensometer = EXTENSOMETER.search(plain(self.used["strain"]))
                self.agree(
                    strain,
                    elongation / length,
                    "strain",
                    "displacement / length",
                    30.0 if extensometer else DISAGREE,
                )
            return strain, elongation
        length = self.geometry.length_mm
        try:
            elongation = self.read("displacement")
        except Lacking as error:
            if length is None:
                error = error.and_also(Lacking(["length"]))
            raise error from None
        if elongation is None:
            raise InputError(
                self.empty("displacement", "strain")
                or f"no column of strain or displacement; it has {self.have()}. "
                "Name one with --strain or --displacement"
            )
        length = self.geometry.length_mm  # a column of height brings its own
        if length is None:
            self.header.refuse_unknown(("length",))
            raise Lacking(["length"])
        elongation = self.zeroed(elongation, load, "displacement")
        return elongation / length, elongation

    def time(self, strain: Array | None) -> Array | None:
        """Time [s]; None where it is made of a strain that lacks something itself."""
        options = self.options
        if options.interval_s is not None:
            self.used["time"] = f"every {options.interval_s:g} s (--interval)"
            return np.arange(float(len(self.table.rows))) * options.interval_s
        time = self.read("time")
        if time is not None:
            even = spread(time)
            if even is None:
                return time
            self.notes.append(ROUNDED.format(self.used["time"]))
            return even
        if options.rate_per_s is not None:
            if strain is None:
                return None
            steps = np.abs(np.diff(strain, prepend=strain[:1]))
            if np.isnan(steps).any():
                raise InputError("strain has gaps, so --rate gives no time")
            self.used["time"] = f"strain at {options.rate_per_s:g} 1/s (--rate)"
            return np.asarray(np.cumsum(steps) / options.rate_per_s, dtype=float)
        if empty := self.empty("time"):
            raise InputError(empty)
        raise Lacking(["time"], have=self.have() + self.speed_told())

    def rate(self) -> float | None:
        if self.options.rate_per_s is not None:
            return self.options.rate_per_s
        speeds = {s for s in self.header.speeds if s > 0}
        if len(speeds) == 1 and self.geometry.length_mm is not None:
            return speeds.pop() / self.geometry.length_mm
        return None

    def speed_told(self) -> str:
        """The rate that the header's speed would give, to be said by the user."""
        rate = self.rate()
        return "" if rate is None else f" (and the header's speed: --rate {rate:.4g})"

    # -- checks ---------------------------------------------------------------------

    def check_time(self, time: Array, strain: Array) -> None:
        """Name the row of the file, which a Recording no longer knows."""
        column = self.used.get("time")
        missing, back = np.isnan(time), np.diff(time, prepend=time[:1]) < 0
        if missing.any():
            bad = missing
            what = (
                "no time; every row needs one. Leave such rows out with "
                "--skip-bad-cells, if they are few"
            )
        elif back.any():
            bad = back
            at = [i for i, c in enumerate(self.table.columns) if i in self.cells
                  and column and c.name == column.partition(" [")[0]]  # fmt: skip
            texts = [str(c) for c in self.table.cells(at[0])] if at else []
            what = backwards(time, strain, texts)
        else:
            return
        raise InputError(
            what,
            file=self.table.where,
            row=int(self.table.lines[int(bad.argmax())]),
            column=column,
        )

    def check_size(self, values: Array, limit: float, what: str, option: str) -> None:
        too_large = np.abs(values) > limit
        if too_large.any():
            k = int(too_large.argmax())
            raise InputError(
                f"{what} is {values[k]:.6g}; beyond {limit:g} a unit, the geometry "
                f"({option}) or the value is wrong",
                file=self.table.where,
                row=int(self.table.lines[k]),
            )

    def note_jumps(self, values: Array, what: str) -> None:
        """Samples far off both neighbours, one or a few: left in, and told."""
        finite = values[np.isfinite(values)]
        if finite.size < 20:
            return
        far = 0.2 * np.ptp(finite)
        steps = np.diff(values)
        big = np.flatnonzero(np.abs(steps) > far)
        most = max(LOST, len(values) // 50)
        if len(big) > most:  # it swings: only single samples tell
            most = 1
        alone = [
            (int(a) + 1, int(b) - int(a))
            for a, b in itertools.pairwise(big)
            if b - a <= most
            and steps[a] * steps[b] < 0
            and abs(values[b + 1] - values[a]) < far / 2
        ]
        if alone:
            row = int(self.table.lines[alone[0][0]])
            count = sum(n for _, n in alone)
            self.notes.append(
                f"{count} samples of {what} stand far off their neighbours, the first "
                f"in row {row}"
            )

    def agree(
        self,
        column: Array,
        computed: Array,
        what: str,
        how: str,
        allowed: float = DISAGREE,
    ) -> None:
        """A recorded column against the same made from two others, to catch a unit."""
        good = np.isfinite(column) & np.isfinite(computed)
        if not good.any():
            return
        a = np.percentile(np.abs(column[good]), 90)
        b = np.percentile(np.abs(computed[good]), 90)
        if a > 0 and b > 0 and not 1 / allowed < a / b < allowed:
            raise InputError(
                f"the column of {what} is {a / b:.3g} times {how}: a unit or the "
                f"geometry is wrong. Give the geometry or --unit, or name the column "
                f"to trust with --{what}"
            )
        if allowed == DISAGREE:
            self.note_apart((self.used[what], column), computed, how, 0)

    def beside(self, role: str) -> tuple[str, Array] | None:
        """A column of stress or strain that is not used, where it is a clear one."""
        typed = set(self.typed)
        try:
            found = self.find(role)
            if found is None:
                return None
            i, unit = found
            column = self.table.columns[i]
            values, _ = numbers(self.table, i, self.decimal, skip_bad=True)
        except InputError:
            return None
        finally:
            self.typed = typed  # what is not used is no use of a unit
        if measure(column.plain, STRESS if role == "stress" else STRAIN):
            return None
        if EXTENSOMETER.search(column.plain):
            return None  # it differs from the travel between the grips
        return str(column), values * unit.factor + unit.offset

    def note_apart(
        self, column: tuple[str, Array] | None, computed: Array, how: str, used: int
    ) -> None:
        """A note where a column and the same made of two others are a factor apart.

        `used`: 0 where the column is, 1 where what was made is.
        """
        if column is None:
            return
        name, values = column
        good = np.isfinite(values) & np.isfinite(computed)
        if good.sum() < 2:
            return
        a, b = (float(np.ptp(v[good])) for v in (values, computed))
        if min(a, b) > 0 and not 1 / DOUBTFUL < a / b < DOUBTFUL:
            self.notes.append(
                f"{name!r} is {a / b:.3g} times {how}; the "
                f"{'latter' if used else 'column'} is used"
            )


def backwards(time: Array, strain: Array, texts: Sequence[str] = ()) -> str:
    """What is wrong with a clock that goes back, and what to do.

    `texts`: the cells of the file. To sort the rows is advised only where the strain
    (n,) then runs more smoothly: elsewhere it would scramble them.

    >>> time = np.array([0.0, 0.1, 0.2, 0.0, 0.1, 0.2])
    >>> backwards(time, np.zeros(6))[:54]
    'time starts again, as where a second test or step begi'
    >>> time, texts = np.array([40.8, 40.9, 40.10, 40.11]), ["40.8", "40.9", "40.10"]
    >>> backwards(time, np.zeros(4), [*texts, "40.11"])[:41]
    "time goes back from '40.9' to '40.10', as"
    """
    step = np.diff(time)
    if len(texts) == len(time) and np.any(step < 0):
        k = int(np.argmax(step < 0))
        told = f"time goes back from {texts[k]!r} to {texts[k + 1]!r}, as where "
        parts = [re.split("[.,]", t) for t in texts]
        digits = all(all(p.isdigit() for p in row) for row in parts)
        if re.fullmatch(r"\d{1,3}([.,]\d{3})+", texts[k + 1]) and digits:
            joined = np.array([float("".join(row)) for row in parts])
            if np.all(np.diff(joined) >= 0):
                mark = "," if "." in texts[k + 1] else "."
                return f"{told}a mark parts thousands; say --decimal {mark}"
        if digits and all(len(row) == 2 for row in parts):
            pairs = [(int(a), int(b)) for a, b in parts]
            if pairs == sorted(pairs):
                return (
                    f"{told}a logger leaves out zeros behind the point; number the "
                    "samples with --interval SECONDS"
                )
    if np.all(step <= 0):
        return "time runs from the last row to the first; sort the rows by time"
    again = np.flatnonzero(step < 0)
    if len(again) == 1 and again[0] == len(step) - 1:
        return (
            "time goes back in the last row alone; if that row is a mean or a sum, "
            "delete it"
        )
    few = len(again) == 1 or len(again) <= 0.1 * len(step)  # more is no order at all
    if few and time[again[0] + 1] <= time[0] + 2 * abs(np.nanmedian(step)):
        return (
            "time starts again, as where a second test or step begins; split the file "
            "there if it is another test, or, if one test goes on, number its samples "
            f"with --interval {np.nanmedian(step):.4g}"
        )
    finite = np.isfinite(strain)
    order = np.argsort(time[finite], kind="stable")
    as_is, by_time = (
        float(np.abs(np.diff(v)).sum()) for v in (strain[finite], strain[finite][order])
    )
    sort = "sort the rows by time, " if by_time < 0.5 * as_is else ""
    return (
        f"time goes backwards; {sort}split the file where a new test begins, or "
        "replace its clock with --interval SECONDS"
    )


def recordings(
    tables: list[Table],
    rules: Rules,
    options: ReadOptions,
    file: Path,
    sheets: Sequence[str] = (),
) -> list[Recording]:
    """A recording of every table that is a test; result tables and such are left out.

    Raises `InputError` for the reason the best of them is none. `sheets`: the names of
    all sheets of a workbook.
    """
    if len(sheets) > 1 and not any(_has_both(t, options) for t in tables):
        raise NoRecording(
            f"no sheet ({', '.join(map(repr, sheets[:5]))}) has time, load and travel "
            "side by side; copy the columns of each test into one sheet, with headings "
            "such as Time (s), Force (N), Extension (mm)",
            file=file,
        )
    if not tables:
        raise NoRecording(
            "no rows of numbers below column names; expected are columns of time, "
            "force or stress, and displacement or strain",
            file=file,
        )
    decimal = options.decimal or decimal_mark(tables, file)
    tables = [
        named_apart(part)
        for table in _joined(tables)
        for part in by_specimen(without_twins(without_reserve(table)))
    ]
    if not decimal:
        note = (
            "some columns have decimal commas, others points: each is read by its own"
        )
        rules = replace(rules, notes=(*rules.notes, note))
    chosen = [t for t in tables if _is_test(t, options)]
    if not chosen:
        chosen = [max(tables, key=lambda t: len(t.rows))]
    left_out = [t for t in tables if not any(t is c for c in chosen)]
    if left_out:
        names = dict.fromkeys(repr(t.sheet) for t in left_out if t.sheet)
        where = f" (sheet {', '.join(names)})" if names else ""
        note = f"{len(left_out)} further tables are no test and left out{where}"
        rules = replace(rules, notes=(*rules.notes, note))
    return [
        assemble(table, rules, _for_table(options, table, chosen), decimal)
        for table in chosen
    ]


def _for_table(
    options: ReadOptions, table: Table, every: Sequence[Table]
) -> ReadOptions:
    """The options without columns that only other tables of the file have."""
    gone: dict[str, Any] = {
        role: ""
        for role in DIMENSION
        if (wanted := getattr(options, role))
        and not called(table.columns, wanted)
        and any(called(other.columns, wanted) for other in every)
    }
    return replace(options, **gone)


def _joined(tables: list[Table]) -> list[Table]:
    """Tables whose names come again on every page, put together again."""
    out: list[Table] = []
    for table in tables:
        before = out[-1] if out else None
        if before is None or not _continues(before, table):
            out.append(table)
            continue
        note = f"names repeated above row {int(table.lines[0])}: one table"
        out[-1] = replace(
            before,
            rows=before.rows + table.rows,
            lines=np.concatenate([before.lines, table.lines]),
            short=before.short
            + tuple((len(before.rows) + k, count) for k, count in table.short),
            bad=before.bad + table.bad,
            notes=(*before.notes, *table.notes, note),
        )
    return out


def _continues(before: Table, table: Table) -> bool:
    """Whether a table of the same columns goes on where the one before it ends."""
    if before.columns != table.columns or table.header or table.label:
        return False
    if before.sheet != table.sheet:
        return False
    clock = [i for i, c in enumerate(table.columns) if rank("time", c.plain) == 0]
    if not clock or len(before.rows) < 3:
        return False
    times = [*before.cells(clock[0])[-3:], *table.cells(clock[0])[:1]]
    numbers_ = [header_number(str(t)) for t in times]
    if any(t is None for t in numbers_):
        return False
    a, b, c, d = (t or 0.0 for t in numbers_)
    return 0 < d - c <= 10 * max(c - b, b - a)


def swept(table: Table) -> bool:
    """Whether a table holds the moduli of a sweep over frequencies."""
    names = " ".join(c.plain for c in table.columns)
    return "storage modulus" in names and "loss modulus" in names


def _has(table: Table, options: ReadOptions, *roles: str) -> bool:
    dimensions = {u.dimension for c in table.columns if (u := parse_unit(c.unit))}
    return any(
        getattr(options, role)
        or has_role(table, role)
        or (table.nameless and DIMENSION[role] in dimensions)
        for role in roles
    )


def _has_both(table: Table, options: ReadOptions) -> bool:
    """Whether load and travel stand side by side."""
    return _has(table, options, "force", "stress") and _has(
        table, options, "displacement", "strain"
    )


def _is_test(table: Table, options: ReadOptions) -> bool:
    timed = options.interval_s or options.rate_per_s or _has(table, options, "time")
    return bool(
        len(table.rows) > 1 and not swept(table) and timed and _has_both(table, options)
    )


def read_source(source: Source, rules: Rules, options: ReadOptions) -> list[Recording]:
    """The recordings of all tables of a file, each table a test: what most need."""
    shown: list[Table] = []
    hidden: list[Table] = []
    wrong: dict[str, InputError] = {}
    for sheet in source.sheets:
        name = sheet.name if not source.is_text else ""
        grid = upright(sheet.grid)
        try:
            found = find_tables(grid or sheet.grid, source.path, name)
        except InputError as error:
            wrong[name] = error
            continue
        if grid is not None:
            note = "its channels stand in rows: turned into columns"
            found = [replace(t, notes=(*t.notes, note)) for t in found]
        (hidden if sheet.hidden else shown).extend(found)
    if wrong and not any(_is_test(t, options) for t in shown):
        raise next(iter(wrong.values()))
    for name, told in wrong.items():
        said = str(told).removeprefix(str(told.file)).lstrip(":, ")
        note = f"sheet {name!r} is left out: {said}"
        rules = replace(rules, notes=(*rules.notes, note))
    if any(_is_test(t, options) for t in shown):
        names = dict.fromkeys(repr(t.sheet) for t in hidden if _is_test(t, options))
        if names:
            note = f"hidden in the workbook, left out: sheet {', '.join(names)}"
            rules = replace(rules, notes=(*rules.notes, note))
        hidden = []
    sheets = [] if source.is_text else [sheet.name for sheet in source.sheets]
    return recordings([*shown, *hidden], rules, options, source.path, sheets)
