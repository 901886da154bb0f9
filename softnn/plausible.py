"""Is this a recording of a soft material? Finds wrong units, signs and columns.

No model is used. These are checked:

- the stiffness (range of stress over range of strain) is 1 kPa to 2 GPa;
- stress rises with strain;
- the imposed channel is linear in time between corners;
- a loop of loading and unloading takes work, as for every passive material;
- the strain moves at all, and where it begins;
- whether the specimen tears.
"""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softnn.axes import Axes
from softnn.contracts import Array, InputError
from softnn.recording import Recording
from softnn.start import at_rest, beginning, unloaded

SOFTEST_MPa, STIFFEST_MPa = 1e-3, 2000.0
STIFF_MPa = 10.0  # few elastomers are stiffer, and a gel of 10 kPa is, in kPa
# Beyond it tissue and plastics: tendon has 300 to 1800 MPa, strains by a tenth or two
# before it tears, and bears some 150 MPa.
TISSUE_MPa, STRETCHES, BEARS_MPa = 100.0, 0.3, 250.0
STRAIGHT = 0.04  # of the peak stress, off a chord: at a strain of 1 rubber is 0.1 off
LARGE = 7.0  # of strain: few elastomers reach it
TINY = 0.005  # of strain: few tests of soft materials stay below it
ALONE = 0.3  # of a peak, that its neighbours stay below: one wrong sample
APART_FROM = 0.3  # correlation of strain and stress, below which both are but noise
# Of strain, where it moves most: a tenth a second in ms, and in min.
SLOWEST_per_s, FASTEST_per_s = 2e-4, 5.0
AGAINST = -0.5  # correlation of stress and strain, below which one is reversed
GIVEN = -0.02  # of the work put in, that a loop gives back beyond it
CLOSED = 0.2  # of the range of strain, between the ends of a loop
STRAIGHTER = 0.3  # of the other's deviation from straight lines: was imposed
STILL = 1e-9  # MPa, or another unit: what moves by less is noise of arithmetic
FEWEST = 16  # samples, below which no shape in time is judged
FEW = 5  # samples, below which nothing is
STANDS = 0.02  # of its size, by which a strain that stands may drift
UNMOVED = 1e-4  # of the range of strain, by which it may move and yet stand
STUCK_S, RISES = 0.05, 0.2  # of the time, and of the range of stress: no relaxation
WHITE = 0.5  # von Neumann's ratio over 2: 1 of white noise, 0 of a smooth course
GONE = 0.06  # of the peak, that a torn specimen may still show
WHOLE = 0.3  # of it, that a specimen bore just before it tore
SHARP = 0.1  # of the range of strain and of the time, within which it tears
SNAPS, MOST = 0.01, 0.6  # the same of a tear from that share of the peak, at any strain
BEGINS = 0.5  # of the range of strain: a start beyond it with no stress is an offset
# Of the range of stress, before any strain, in all recordings alike to EQUAL of it: no
# preload is that large.
OFF, EQUAL = 0.1, 0.2
THOUSAND = (300.0, 3000.0)  # between stiffnesses of two files: one is in kPa
HUNDRED = (30.0, 300.0)  # between their strains as well: one is in per cent
COUNTED = 5.0  # s between samples in whole numbers, as of a clock in ms
ALIKE = 0.02  # of the range, within which two strain programmes are one
FACTOR = 1.4  # up to it, one programme over another is a length; beyond, an amplitude
LOADED, NEAR = 0.2, 0.1  # of the largest strain and stress: where a test goes on
APART = 0.05  # of the range of stress, by which specimens of one programme differ
# Kinds of material, up to a stiffness in MPa.
KINDS = (
    (0.03, "a gel or soft tissue"),
    (0.3, "a very soft silicone or adhesive"),
    (10.0, "silicone or rubber"),
    (100.0, "hard rubber or polyurethane"),
    (STIFFEST_MPa, "tendon, ligament or a plastic"),
    (np.inf, "a plastic or a metal"),
)

ABSENT = 0.05  # of the samples, without a strain or stress, beyond which it is told
# A simulation over the measurement, in steps of a thousand, and how near to one.
PREFIXES = {1e3: "kPa", 1e6: "Pa", 1e-3: "GPa"}
NEARLY = 3.0
# What repeats one value, that far outside all others (of their range), in that share.
MARK_FAR, MARK_MOST = 5.0, 0.1

Tell = Callable[[str, str], None]  # of what, in which column


@dataclass(frozen=True)
class Advice:
    """What to do about a unit of one recording: the options that act on it.

    `alone`: whether other files are read with it, on which the options must not act.
    """

    recording: Recording
    alone: bool = False

    @property
    def of(self) -> str:
        """The name of the file, with a colon, where the options are of it alone."""
        name = Path(self.recording.source).name
        return f"{name}:" if self.alone and name else ""

    def unit(self, quantity: str, unit: str) -> str:
        """The option for a unit, e.g. `--unit fast.csv:strain=%`."""
        return f"--unit {shlex.quote(f'{self.of}{quantity}={unit}')}"

    def flip(self) -> str:
        one, other = (shlex.quote(f"{self.of}{axis}") for axis in ("strain", "stress"))
        return f"--flip {one} or --flip {other}"

    def made_of(self, *roles: str) -> str:
        """The column of the first of the roles that was read, "" where none was."""
        read = self.recording.log[0].arguments if self.recording.log else {}
        used = read.get("columns", {})
        return next((str(used[r]) for r in roles if r in used), "")

    def small(self) -> str:
        """What to do where a strain is too small for the stress."""
        travel, strain = self.made_of("displacement"), self.made_of("strain")
        if travel and not strain:
            return (
                f"strain is {travel!r} over a length of "
                f"{self.recording.geometry.length_mm:.4g} mm: are both in mm?"
            )
        if "%" in strain:
            return f"is strain a fraction ({self.unit('strain', 'mm/mm')})?"
        return self.pascal()

    def percent(self) -> str:
        """What to do where the strain may be in per cent, or the length is wrong."""
        length, travel = self.recording.geometry.length_mm, self.made_of("displacement")
        if length is None or not travel or self.made_of("strain"):
            if "%" in self.made_of("strain"):
                return (
                    "it is read in per cent: is it in per mille "
                    f"({self.unit('strain', 'mm/m')})?"
                )
            return (
                f"is strain in per cent? Divide it by 100 ({self.unit('strain', '%')})"
            )
        return (
            f"strain is {travel!r} over a length of {length:.4g} mm: is that length in "
            "mm (--length MM), and is the unit of the travel right?"
        )

    def pascal(self) -> str:
        """What to do where the stress is too large: kPa, a force, or the section."""
        area, force = self.recording.geometry.area, self.made_of("force")
        if area is None or not force or self.made_of("stress"):
            return (
                f"is stress in kPa ({self.unit('stress', 'kPa')}) or Pa, or a force? "
                "It must be in MPa"
            )
        return (
            f"stress is {force!r} over a section of {area:.4g} mm2: is that section in "
            "mm2 (--area MM2; 1 cm2 is 100 mm2), and is the unit of the force right?"
        )


def check_plausible(
    recording: Recording,
    file: str | Path | None = None,
    as_is: bool = False,
    history: str = "fresh",
    alone: bool = False,
) -> list[str]:
    """Return notes on oddities, a line each. Raises `InputError` on impossible values.

    A component may have any stiffness and either sign: errors on signs and columns of a
    specimen are notes for a component. An error says what to do. `as_is` accepts the
    numbers, and returns no notes. `alone`: the options that it advises must act on this
    file alone, since others are read with it.
    """
    good = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    time = recording.time_s[good]
    strain, stress = recording.strain[good], recording.stress_MPa[good]
    if as_is or len(time) < FEW:
        return []
    axes = recording.axes
    where = file if file is not None else recording.name or None
    notes: list[str] = []
    advice = Advice(recording, alone)
    if marked := marks_told(recording):
        raise InputError(f"{marked}. If it is right, say --as-is", file=where)

    def refuse(message: str, column: str) -> None:
        end = "" if message.endswith("?") else "."
        raise InputError(
            f"{message}{end} If it is right, say --as-is", file=where, column=column
        )

    def note(message: str, _: str) -> None:
        notes.append(message)

    for axis, values in ((axes.strain, recording.strain),
                         (axes.stress, recording.stress_MPa)):  # fmt: skip
        gone = np.isnan(values)
        if gone.mean() > ABSENT:
            what = "; the stress there is not used" if axis is axes.strain else ""
            note(
                f"{100 * gone.mean():.0f} % of the {axis.name} is missing "
                f"({gone.sum()} of {len(gone)} samples, the first at "
                f"{recording.time_s[gone.argmax()]:.4g} s){what}",
                axis.column,
            )

    _still(strain, stress, axes, note if history == "continued" else refuse)
    _noise(strain, stress, axes, refuse)
    _simulated(recording, advice, refuse)
    if np.ptp(strain) == 0:
        return [f"{recording.name}: {said}" for said in notes]
    if np.ptp(stress) < STILL:
        refuse(
            f"{axes.stress.name} is {stress[0]:.4g} {axes.stress.unit} throughout "
            f"while {axes.strain.name} moves; is the channel connected, and the column "
            "the right one?",
            axes.stress.column,
        )
    _against(strain, stress, axes, advice, note if axes.component else refuse)
    _begins(strain, stress, axes, advice, note if axes.component else refuse)
    if len(time) >= FEWEST:
        _swapped(time, strain, stress, axes, note if axes.component else refuse)
    if not axes.component:
        # A column of strain may be logarithmic, a travel over a length cannot.
        made = advice.made_of("displacement") and not advice.made_of("strain")
        _possible(strain, stress, advice, refuse if made else note)
        _stiffness(strain, stress, advice, refuse)
        notes += _notes(time, strain, stress, advice)
    return [f"{recording.name}: {said}" for said in notes]


def marks(values: Array) -> NDArray[np.bool_]:
    """Which of the values (n,) repeat one number far outside all others.

    As loggers write where there is no reading; a load cell that is full has values
    all the way up to its last.

    >>> marks(np.array([0.1, 0.2, -999, 0.3, 0.4, -999, 0.5, 0.6] * 2)).sum()
    np.int64(0)
    >>> marks(np.array([*np.linspace(0, 1, 40), -9.99, -9.99])).sum()
    np.int64(2)
    """
    none = np.zeros(len(values), bool)
    known = values[np.isfinite(values)]
    if len(known) < FEWEST:
        return none
    for one in (known.min(), known.max()):
        rest, at = known[known != one], values == one
        if 1 < at.sum() <= max(2, MARK_MOST * len(known)) and len(rest):
            far = min(abs(one - rest.min()), abs(one - rest.max()))
            if far > MARK_FAR * np.ptp(rest) > 0:
                return at
    return none


def marks_told(recording: Recording) -> str:
    """Where marks of missing values stand, and what leaves them out; "" for none."""
    axes = recording.axes
    for axis, values in ((axes.strain, recording.strain),
                         (axes.stress, recording.stress_MPa)):  # fmt: skip
        at = np.flatnonzero(marks(values))
        if not len(at):
            continue
        read = recording.log[0].arguments if recording.log else {}
        if recording.source and not read.get("notes") and (
            read.get("dialect", "tidy CSV") == "tidy CSV"
        ):  # fmt: skip
            places = "rows", [str(i + 2) for i in at]
        else:
            places = "at", [f"{recording.time_s[i]:.4g} s" for i in at]
        shown = ", ".join(places[1][:3]) + f" and {len(at) - 3} more" * (len(at) > 3)
        unit = "" if axis.unit == "-" else f" {axis.unit}"
        return (
            f"{len(at)} samples of {axis.name} are {values[at[0]]:.4g}{unit}, far "
            f"outside all others ({places[0]} {shown}), as loggers write where there "
            "is no reading; leave them out with --skip-bad-cells"
        )
    return ""


def understood(recording: Recording) -> str:
    """What a recording is of, in units by which a wrong one shows.

    >>> time = np.linspace(0, 20, 41)
    >>> strain = 0.5 * (1 - np.abs(time / 10 - 1))
    >>> understood(Recording(time, strain, 1.2 * strain))
    '20 s; strain up to 50 % at 5 % a second; stress to 0.6 MPa: silicone or rubber'
    """
    good = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    time = recording.time_s[good]
    strain, stress = recording.strain[good], recording.stress_MPa[good]
    if len(time) < 2:
        return ""
    axes, rate = recording.axes, fastest(time, strain)
    span, far = spelt(time[-1] - time[0]), strain[np.argmax(np.abs(strain))]
    top = stress[np.argmax(np.abs(stress))]
    if axes.component:
        return (
            f"{span}; {axes.strain.name} to {far:.3g} {axes.strain.unit} at "
            f"{rate:.2g} {axes.rate}; {axes.stress.name} to {top:.3g} "
            f"{axes.stress.unit}"
        )
    way = "up to" if far > 0 else "down to"
    stiffness = np.ptp(stress) / max(float(np.ptp(strain)), 1e-300)
    kind = next(said for most, said in KINDS if stiffness <= most)
    return (
        f"{span}; strain {way} {100 * far:.3g} % at {100 * rate:.2g} % a second; "
        f"stress to {top:.3g} MPa: {kind}"
    )


def spelt(seconds: float) -> str:
    """A time as one would say it."""
    for size, unit in ((86400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 3 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def usual_rate(time: Array, strain: Array) -> float:
    """Rate of strain [1/s] where it moves, short of the few largest steps."""
    step = np.diff(time)
    rates = np.abs(np.diff(strain))[step > 0] / step[step > 0]
    return float(np.quantile(rates, 0.95)) if len(rates) else 0.0


def fastest(time: Array, strain: Array) -> float:
    """The usual rate, or that of the first way to the largest strain: a step and hold.

    >>> time = np.arange(100.0)
    >>> strain = np.minimum(0.1 * time, 0.2)
    >>> round(fastest(time, strain), 9), usual_rate(time, strain)
    (0.1, 0.0)
    """
    end = int(np.argmax(np.abs(strain - strain[0])))
    way = np.abs(strain[: end + 1] - strain[0])
    first = max(int(np.argmax(way > 0.2 * way[-1])) - 1, 0)
    last = int(np.argmax(way >= 0.8 * way[-1]))
    took = time[last] - time[first]
    ramp = float((way[last] - way[first]) / took) if took > 0 else 0.0
    return max(usual_rate(time, strain), ramp)


def check_together(recordings: Sequence[Recording]) -> None:
    """Raise `InputError` where recordings show together that a unit or zero is wrong.

    One of several is in other units; or all begin with the same stress before any
    strain, as where the load cell was not zeroed.
    """
    known = [r for r in recordings if not r.axes.component]
    if len(known) < 2:
        return
    stiffness, reach, initial = (
        np.array([f(r) for r in known]) for f in (_stiffness_of, _strain_of, _initial)
    )
    for i, one in enumerate(known):
        others = np.arange(len(known)) != i
        # Of two recordings either may be the wrong one: that of the larger numbers.
        stiffer = stiffness[i] / float(np.median(stiffness[others]))
        longer = reach[i] / float(np.median(reach[others]))
        advice = Advice(one, True)
        name = one.source or one.name
        if THOUSAND[0] < stiffer < THOUSAND[1]:
            raise InputError(
                f"stiffness is {stiffness[i]:.4g} MPa, {stiffer:.4g} times that of the "
                f"other recordings; {advice.pascal()}. If it is right, say --as-is",
                file=name,
                column="stress_MPa",
            )
        softer = float(np.median(initial[others])) / initial[i]
        if HUNDRED[0] < min(longer, 1 / stiffer, softer) and longer < HUNDRED[1]:
            raise InputError(
                f"strain reaches {reach[i]:.4g}, {longer:.4g} times that of the other "
                f"recordings; {advice.percent()}. If it is right, say --as-is",
                file=name,
                column="strain",
            )
    if any(r.simulated_MPa is not None for r in known):
        return  # what a simulation leaves out is asked of the diagnosis
    begins = [_offset(r) for r in known]
    if any(b is None for b in begins):
        return
    first, size = (np.array(v) for v in zip(*(b for b in begins if b), strict=True))
    usual = float(np.median(first))
    if abs(usual) > OFF * size.max() and np.ptp(first) < EQUAL * abs(usual):
        raise InputError(
            f"stress begins at {usual:.3g} MPa in all {len(known)} recordings, before "
            f"any strain, and reaches {size.max():.3g} MPa; if the load cell was not "
            "zeroed, take that off with --zero-stress. If the specimens bear it, "
            "say --as-is",
            column="stress_MPa",
        )


def _finite(recording: Recording) -> tuple[Array, Array]:
    good = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    return recording.strain[good], recording.stress_MPa[good]


def _stiffness_of(recording: Recording) -> float:
    strain, stress = _finite(recording)
    spans = [float(np.ptp(v)) if len(v) else 0.0 for v in (strain, stress)]
    return max(spans[1], 1e-300) / max(spans[0], 1e-300)


def _initial(recording: Recording) -> float:
    """Stiffness [MPa] of the first tenth of the strain, before a film yields."""
    strain, stress = _finite(recording)
    if len(strain) < FEW or np.ptp(strain) == 0:
        return 1e-300
    moved = np.abs(strain - strain[0])
    at = int(np.argmax(moved >= 0.1 * moved.max()))
    return max(abs(float(stress[at] - stress[0])), 1e-300) / max(moved[at], 1e-300)


def _strain_of(recording: Recording) -> float:
    return max(float(np.abs(_finite(recording)[0]).max(initial=0.0)), 1e-300)


def _offset(recording: Recording) -> tuple[float, float] | None:
    """Stress before any strain, and the largest; None where it begins strained."""
    strain, stress = _finite(recording)
    first = at_rest(strain, stress)
    return None if first is None else (first, float(np.abs(stress).max()))


def scattered(recordings: Sequence[Recording]) -> list[str]:
    """A note where recordings of one strain programme differ: several specimens?

    They may be those, or one specimen that wears; a line says where to say which.
    """
    apart: dict[str, float] = {}
    for i, one in enumerate(recordings):
        for other in recordings[:i]:
            if (difference := _apart(one, other)) > APART:
                for name in (one.name, other.name):
                    apart[name] = max(apart.get(name, 0.0), difference)
    if not apart:
        return []
    names = [r.name for r in recordings if r.name in apart]
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if names[3:] else "")
    return [
        f"{shown}: strained alike, and their stress differs by up to "
        f"{100 * max(apart.values()):.0f} %; softnn judges whether they are different "
        "specimens; to say so yourself, write in case.toml: [specimen], and a line "
        'each, recording = "name"'
    ]


def going_on(recordings: Sequence[Recording], history: str) -> list[str]:
    """A note where recordings begin loaded, where the one before them ends.

    A file a cycle: what the material remembers of the cycle before is lost, where each
    is taken to begin at rest.
    """
    found = [
        (before.name, one.name)
        for before, one in itertools.pairwise(recordings)
        if before.axes == one.axes and _goes_on(before, one)
    ]
    if not found or history != "fresh":
        return []
    first, second = found[0]
    more = f", and {len(found) - 1} more alike" if len(found) > 1 else ""
    return [
        f"{second} begins loaded, where {first} ends{more}; if one test goes on in the "
        'next file, say so in case.toml: history = "continued"'
    ]


def _goes_on(before: Recording, one: Recording) -> bool:
    for name in ("strain", "stress_MPa"):
        a, b = getattr(before, name), getattr(one, name)
        if not (np.isfinite(a[-3:]).any() and np.isfinite(b[:3]).any()):
            return False
        size = max(float(np.nanmax(np.abs(a))), float(np.nanmax(np.abs(b))))
        end, start = np.nanmean(a[-3:]), np.nanmean(b[:3])
        if abs(start) < LOADED * size or abs(end - start) > NEAR * size:
            return False
    return True


def one_size(recordings: Sequence[Recording]) -> list[str]:
    """A note where one length given for all makes programmes differ by a factor.

    A machine that pulls each specimen to the same strain of its own length.
    """
    sizes = {r.geometry.length_mm for r in recordings}
    if len(recordings) < 2 or len(sizes) > 1 or None in sizes:
        return []
    first = recordings[0]
    factors = [_factor(first, r) for r in recordings]
    told = [f for f in factors if f is not None]
    if len(told) < len(recordings) or max(told) / min(told) < 1 + ALIKE:
        return []
    return [
        f"the strain programmes of {first.name} and {len(recordings) - 1} more differ "
        f"by a factor alone, of up to {max(told) / min(told):.3g}, as where one length "
        "is given for specimens of several; softnn diagnose FOLDER --template writes a "
        "table for the size of each"
    ]


def _factor(one: Recording, other: Recording) -> float | None:
    """By which the strain of one programme is larger; None for another programme."""
    times = [r.time_s - r.time_s[0] for r in (one, other)]
    lasts = times[0][-1], times[1][-1]
    if one.axes != other.axes or min(map(len, times)) < FEWEST or min(lasts) <= 0:
        return None
    if not 0.98 < lasts[0] / lasts[1] < 1.02:
        return None
    grid = np.linspace(0.0, min(lasts), 200)
    a, b = (
        np.interp(grid, t, np.nan_to_num(r.strain))
        for t, r in zip(times, (one, other), strict=True)
    )
    if np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    factor = float(a @ b / (a @ a))
    off = np.abs(b - factor * a).max()
    near = FACTOR > factor > 1 / FACTOR and off < ALIKE * np.ptp(b)
    return factor if near else None


def _apart(one: Recording, other: Recording) -> float:
    """Difference of stress over its range, 0 for another strain programme."""
    if one.axes != other.axes:
        return 0.0
    grids = []
    for r in (one, other):
        good = np.isfinite(r.strain) & np.isfinite(r.stress_MPa)
        grids.append((r.time_s[good] - r.time_s[0], r.strain[good], r.stress_MPa[good]))
    (t, e, s), (u, f, v) = grids
    if min(len(t), len(u)) < FEWEST or not 0.98 < t[-1] / max(u[-1], 1e-300) < 1.02:
        return 0.0
    grid = np.linspace(0.0, min(t[-1], u[-1]), 400)
    span = float(np.ptp(e))
    if (
        span == 0
        or np.abs(np.interp(grid, t, e) - np.interp(grid, u, f)).max() > ALIKE * span
    ):
        return 0.0
    differs = np.interp(grid, t, s) - np.interp(grid, u, v)
    return float(np.quantile(np.abs(differs), 0.9) / max(float(np.ptp(s)), 1e-300))


def _noise(strain: Array, stress: Array, axes: Axes, refuse: Tell) -> None:
    """Refuse a stress that is but noise, whatever the strain does."""
    if len(strain) < FEWEST or np.ptp(strain) == 0:
        return
    usual = np.clip(
        stress, *np.quantile(stress, (0.02, 0.98))
    )  # short of wrong samples
    if np.ptp(usual) == 0 or white(usual) < WHITE:
        return
    if abs(float(np.corrcoef(strain, usual)[0, 1])) > APART_FROM:
        return  # cycles of a few samples each look alike
    x, y = axes.strain, axes.stress
    what, when = f"{y.name} is", f"while {x.name} moves"
    if white(strain) >= WHITE:
        what, when = f"{x.name} and {y.name} are", "throughout"
    refuse(
        f"{what} noise, of {np.std(usual):.2g} {y.unit} {when}; is the load cell "
        "connected, and is it the right column?",
        y.column,
    )


def _simulated(recording: Recording, advice: Advice, refuse: Tell) -> None:
    """Refuse a simulation that is a thousand times the measurement, or a millionth."""
    simulated, axes = recording.simulated_MPa, recording.axes
    if simulated is None or axes.component:
        return
    both = np.isfinite(simulated) & np.isfinite(recording.stress_MPa)
    if both.sum() < FEW:
        return
    spans = [float(np.ptp(v[both])) for v in (simulated, recording.stress_MPa)]
    if min(spans) <= 0:
        return
    times = spans[0] / spans[1]
    for size, unit in PREFIXES.items():
        if not 1 / NEARLY < times / size < NEARLY:
            continue
        how = f"is it in {unit} ({advice.unit('simulated', unit)})"
        if size < 1:
            how += f", or the stress in kPa ({advice.unit('stress', 'kPa')})"
        refuse(
            f"the simulation is {times:.3g} times the measured stress; {how}?",
            axes.simulated,
        )


def _possible(strain: Array, stress: Array, advice: Advice, tell: Tell) -> None:
    """Tell of a specimen shorter than nothing."""
    if strain.min() > -1:
        return
    travel = advice.made_of("displacement")
    whence = f", made of {travel!r} over the length," if travel else ""
    tell(
        f"strain{whence} goes down to {strain.min():.4g}: at -1 the specimen has no "
        "length left. Is it in per cent, is the sign reversed, or is the length "
        f"(--length MM) wrong? {advice.unit('strain', '%')}, {advice.flip()}",
        "strain",
    )


def _stiffness(strain: Array, stress: Array, advice: Advice, refuse: Tell) -> None:
    stiffness = float(np.ptp(stress) / np.ptp(strain))
    allowed = f"soft materials and tissue have {SOFTEST_MPa:g} to {STIFFEST_MPa:g}"
    far = np.ptp(strain) > STRETCHES or np.abs(stress).max() > BEARS_MPa
    if stiffness > STIFFEST_MPa or (stiffness > TISSUE_MPa and far):
        peak = int(np.argmax(np.abs(stress)))
        beside = np.abs(stress[[max(peak - 1, 0), min(peak + 1, len(stress) - 1)]])
        if len(stress) >= FEWEST and beside.max() < ALONE * abs(stress[peak]):
            refuse(
                f"stress is {stress[peak]:.4g} MPa in one sample, and "
                f"{beside.max():.4g} MPa in those beside it; delete that row",
                "stress_MPa",
            )
        also = "" if stiffness > STIFFEST_MPa else (
            f", yet a material stiffer than {TISSUE_MPa:g} MPa tears before a strain "
            f"of {STRETCHES:g} or a stress of {BEARS_MPa:g} MPa"
        )  # fmt: skip
        allowed += also
        refuse(
            f"stiffness is {stiffness:.4g} MPa, {allowed}; {advice.pascal()}",
            "stress_MPa",
        )
    if stiffness < SOFTEST_MPa:
        large = np.abs(strain).max() > 1
        refuse(
            f"stiffness is {stiffness:.4g} MPa, {allowed}; "
            + (advice.percent() if large else "is stress in GPa? It must be in MPa"),
            "strain" if large else "stress_MPa",
        )


def _against(
    strain: Array, stress: Array, axes: Axes, advice: Advice, tell: Tell
) -> None:
    together = float(np.corrcoef(strain, stress)[0, 1])
    if together < AGAINST:
        x, y = axes.strain, axes.stress
        tell(
            f"{y.name} falls as {x.name} grows (correlation {together:.2g}); one of "
            "them has its sign reversed: tension is positive, compression negative, in "
            f"both. Turn it with {advice.flip()}",
            x.column,
        )


def _swapped(time: Array, strain: Array, stress: Array, axes: Axes, tell: Tell) -> None:
    if imposed_is_stress(time, strain, stress):
        x, y = axes.strain, axes.stress
        tell(
            f"{y.name} runs straight in time and {x.name} does not, and a loop gives "
            f"back more work than it takes; are the columns of {x.name} and {y.name} "
            "swapped?",
            x.column,
        )


def loaded_by_stress(time: Array, strain: Array, stress: Array) -> bool:
    """Whether stress runs straight in time and strain does not, on one way.

    As under load control, or with the columns swapped: no loop tells which.

    >>> time = np.linspace(0, 1, 200)
    >>> loaded_by_stress(time, time**2, time), loaded_by_stress(time, time, time**2)
    (True, False)
    """
    closed = abs(strain[-1] - strain[0]) < CLOSED * np.ptp(strain)
    return not closed and bent(time, stress) < STRAIGHTER * bent(time, strain)


def _notes(time: Array, strain: Array, stress: Array, advice: Advice) -> list[str]:
    notes = []
    top = float(np.abs(strain).max())
    if top > LARGE:
        notes.append(
            f"strain reaches {top:.3g}, that is {100 * top:.4g} %; {advice.percent()}"
        )
    elif top > 1 and loaded_straight(strain, stress):
        notes.append(
            f"stress grows in a straight line up to a strain of {top:.3g}, which "
            f"rubber does not; {advice.percent()}"
        )
    stiffness = float(np.ptp(stress) / np.ptp(strain))
    if stiffness > STIFF_MPa:
        like = "as of tendon or a plastic" if stiffness > TISSUE_MPa else (
            "more than most elastomers have"
        )  # fmt: skip
        far = f", and strain reaches {100 * top:.3g} % at most" if top < TINY else ""
        how = advice.small() if top < TINY else advice.pascal()
        notes.append(f"stiffness is {stiffness:.3g} MPa, {like}{far}; {how}")
    rate = fastest(time, strain)
    counted = np.median(np.diff(time)) >= COUNTED and not np.any(time % 1)
    if 0 < rate < SLOWEST_per_s:
        notes.append(
            f"strain moves by {rate:.2g} 1/s at most; if time is in ms, divide it "
            f"by 1000 ({advice.unit('time', 'ms')})"
        )
    elif counted and len(time) >= FEWEST:
        notes.append(
            f"time counts in whole numbers, {np.median(np.diff(time)):g} s apart; if "
            f"they are ms, say {advice.unit('time', 'ms')}"
        )
    if (at := stuck(time, strain, stress)) is not None:
        notes.append(
            f"strain stands at {strain[at]:.4g} from {time[at]:.4g} s on while the "
            "stress rises; has its sensor come off, or is it at its end? Another "
            "column is named with --strain or --displacement"
        )
    if len(time) >= FEWEST and loaded_by_stress(time, strain, stress):
        notes.append(
            "stress runs straight in time and strain does not, as under load control; "
            "if the machine moved at a constant speed, the columns are swapped"
        )
    if FASTEST_per_s < rate and top <= LARGE:  # per cent are fast, too
        notes.append(
            f"strain moves by {rate:.3g} 1/s; if time is in min or h, "
            "multiply it by 60 or 3600"
        )
    first = at_rest(strain, stress)
    if first is not None and abs(first) > OFF * np.ptp(stress):
        notes.append(
            f"stress begins at {first:.3g} MPa with no strain, an offset or a preload; "
            "if the load cell was not zeroed, take it off with --zero-stress"
        )
    return notes


def _still(strain: Array, stress: Array, axes: Axes, tell: Tell) -> None:
    """A strain that never moves, or is but noise: another column, or no ramp."""
    x, span = axes.strain, float(np.ptp(strain))
    unit = "" if x.unit == "-" else f" {x.unit}"
    if span <= STANDS * float(np.abs(np.median(strain))) or span == 0:
        how = f"stands at {np.median(strain):.4g}{unit} from first to last sample"
    elif len(strain) >= FEWEST and white(strain) > WHITE and white(stress) < WHITE / 5:
        how = f"is noise of {np.std(strain):.2g}{unit} while the stress moves"
    else:
        return
    tell(
        f"{x.name} {how}; is it the right column, and was "
        "the ramp to it recorded? Another one is named with --strain or --displacement",
        x.column,
    )


def stuck(time: Array, strain: Array, stress: Array) -> int | None:
    """The sample from which the strain stands while the stress rises; None if none.

    In a hold stress relaxes. Where it rises, an extensometer has come off or is at its
    end.
    """
    span = float(np.ptp(strain)), float(np.ptp(np.abs(stress)))
    still = np.abs(np.diff(strain)) <= UNMOVED * span[0]
    ends = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
    for first, last in ends.reshape(-1, 2):
        load = np.abs(stress[first : last + 1])
        long = time[last] - time[first] > STUCK_S * np.ptp(time)
        if long and last - first >= FEWEST and load.max() - load[0] > RISES * span[1]:
            return int(first)
    return None


def white(values: Array) -> float:
    """Mean square of steps over twice the variance: 1 of white noise, 0 of a course.

    >>> round(white(np.random.default_rng(0).standard_normal(2000)), 1)
    1.0
    >>> white(np.linspace(0, 1, 100)) < 1e-3
    True
    """
    variance = float(np.var(values))
    return float(np.mean(np.diff(values) ** 2)) / (2 * variance) if variance else 0.0


def _begins(
    strain: Array, stress: Array, axes: Axes, advice: Advice, tell: Tell
) -> None:
    """A strain that begins far from zero with no stress: a ratio, or a position."""
    first, share = beginning(strain, stress, preload=True)
    if share <= BEGINS:
        return
    x, stretch = axes.strain, 0.9 < first < 1.1
    if not unloaded(stress) and not stretch:
        return
    # A ratio in per cent has no unit of its own.
    percent = "%" in advice.made_of("strain")
    ratio = "--zero" if percent else advice.unit("strain", "stretch")
    if not axes.component and stretch:
        tell(
            f"strain begins at {first:.4g} with little stress, as a stretch ratio does;"
            f" if it is one, say {ratio}",
            x.column,
        )
        return
    tell(
        f"{x.name} begins at {first:.4g}{'' if x.unit == '-' else ' ' + x.unit} with "
        "no stress; if that is the machine's position, count from there with --zero",
        x.column,
    )


def loaded_straight(strain: Array, stress: Array) -> bool:
    """Whether the first loading, to the largest strain, stays near its chord.

    >>> stretch = np.linspace(1, 3, 100)
    >>> loaded_straight(stretch - 1, stretch - stretch**-2)  # neo-Hooke
    False
    >>> loaded_straight(stretch - 1, 0.2 * (stretch - 1))
    True
    """
    end = int(np.argmax(np.abs(strain))) + 1
    x, y = strain[:end] - strain[0], stress[:end] - stress[0]
    if end < FEWEST or x[-1] == 0 or y[-1] == 0:
        return False
    return float(np.quantile(np.abs(y / y[-1] - x / x[-1]), 0.9)) < STRAIGHT


def imposed_is_stress(time: Array, strain: Array, stress: Array) -> bool:
    """Whether stress was the imposed one: the columns are swapped.

    A machine imposes strain, straight in time between corners. Both must say so: which
    channel is straight, and the work of a loop, which swapping makes negative.
    """
    step = np.diff(strain)
    mean = (stress[1:] + stress[:-1]) / 2
    put_in = float(np.abs(mean * step).sum())
    closed = abs(strain[-1] - strain[0]) < CLOSED * np.ptp(strain)
    if not closed or put_in == 0 or float((mean * step).sum()) > GIVEN * put_in:
        return False
    return bent(time, stress) < STRAIGHTER * bent(time, strain)


def bent(time: Array, values: Array, pieces: int = 16) -> float:
    """Typical deviation from straight lines over stretches of time, over the range.

    >>> time = np.linspace(0, 1, 400)
    >>> bent(time, 1 - np.abs(2 * time - 1)) < 1e-9 < 1e-4 < bent(time, time**2)
    True
    """
    out = []
    for index in np.array_split(np.arange(len(time)), pieces):
        if len(index) < 3 or np.ptp(time[index]) == 0:
            continue
        x = time[index] - time[index].mean()
        y = values[index] - values[index].mean()
        out.append(float(np.std(y - x * (x @ y) / (x @ x))))
    return float(np.median(out) / np.ptp(values)) if out else 0.0


def accidents(recording: Recording) -> tuple[Recording, list[str]]:
    """The recording without stress after the specimen has torn, and a note on it."""
    at = torn(recording)
    if at is None:
        return recording, []
    stress = np.array(recording.stress_MPa)
    index = np.flatnonzero(np.isfinite(stress) & np.isfinite(recording.strain))
    first = index[max(int(np.searchsorted(index, at) - 0.005 * len(index)), 0)]
    stress[first:] = np.nan
    axes, time = recording.axes, recording.time_s[at]
    unit = "" if axes.strain.unit == "-" else f" {axes.strain.unit}"
    told = (
        f"{recording.name}: {axes.stress.name} falls to zero at {time:.4g} s "
        f"({axes.strain.name} {recording.strain[at]:.3g}{unit}) and stays there: "
        "torn, or out of its grips; what follows is not used"
    )
    return recording.with_step("mask_failure", stress_MPa=stress), [told]


def torn(recording: Recording) -> int | None:
    """The sample at which the specimen tears or leaves its grips; None where it holds.

    From there on the stress stays near zero, although the strain comes back to where
    it had been borne; and it falls there at once, as slack does not.
    """
    index = np.flatnonzero(
        np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    )
    if len(index) < FEWEST:
        return None
    time, strain = recording.time_s[index], recording.strain[index]
    stress = recording.stress_MPa[index]
    peak = float(np.abs(stress).max())
    after = np.abs(stress) <= GONE * peak
    still = np.ptp(time) == 0 or np.ptp(strain) == 0
    if peak == 0 or still or not after[-1] or after.all():
        return None
    gone = int(
        len(after) - np.argmax(~after[::-1])
    )  # the first of the last, quiet part
    if len(after) - gone < max(FEW, 0.02 * len(after)):
        return None
    bore = np.flatnonzero(np.abs(stress[:gone]) >= WHOLE * peak)
    last = int(bore[-1])
    far = abs(strain[gone] - strain[last]) / np.ptp(strain)
    late = (time[gone] - time[last]) / np.ptp(time)
    # Slack comes with the way back; a specimen that is whole bears again out there.
    again = np.abs(strain[gone:]).max() >= 0.95 * np.abs(strain[bore]).max()
    if again and max(far, late) <= SHARP:
        return int(index[gone])
    at_once = max(far, late) <= SNAPS and abs(stress[last]) >= MOST * peak
    return int(index[gone]) if at_once else None
