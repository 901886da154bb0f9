"""Strain programmes that a machine and its specimens allow, as recorded so far.

A programme goes straight from level to level. Strains, rates and directions are those
recorded, unless limits of the user replace them. All numbers are in the units of the
recordings: s, and strain or the unit of a component.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn.axes import Axes
from softnn.contracts import Array, Chunk, InputError
from softnn.metrics import weights

TOLERANCE = 0.003  # of the range of strain, within which a path is drawn by corners
CORNERS = 120  # most corners kept of a recording
MOVES = 0.05  # of the range of strain; a shorter stretch tells no usual rate
SAMPLES = (240, 1200)  # of a programme
SLOWER = 10.0  # a machine that reaches a rate also goes this many times slower
DECADE = 3.0  # ratio of rates from which a third one between them is worth a try
BOTH = 0.1  # of the largest strain; less on the other side is no other direction
USUAL_S, TIMES = 1200.0, 10.0  # usual limit; at most so many times the longest so far
LONGEST_S = 1e7  # four months
HELD = 0.5  # of the longest recording, for one hold, if no duration is asked for
LEAST_HOLD = 20  # samples of the finest clock
REPEATS = 10  # cycles of a programme of equal cycles
WARM = 1.0  # degC; temperatures that differ by less are one
STEP = 1e-6  # of the duration; a step of strain takes so long
NONE_FITS = (
    "no programme fits into these limits; allow more --minutes or a larger --max-rate"
)


@dataclass(frozen=True)
class Course:
    """The strain of a recording, thinned to its corners (n,)."""

    name: str
    time_s: Array
    strain: Array

    @property
    def seconds(self) -> float:
        return float(self.time_s[-1] - self.time_s[0])


@dataclass(frozen=True)
class Recorded:
    """What the machine and the specimens have stood so far.

    `count` is the number of recordings. `courses` are all of them if these continue one
    another, else the longest one.
    """

    low: float  # least strain
    high: float  # largest strain
    slow: float  # least and largest usual rate, 1/s
    fast: float
    longest_s: float
    interval_s: float
    degC: tuple[float, float] | None
    continued: bool
    count: int
    courses: tuple[Course, ...]

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready; `from_dict` takes it back."""
        return {
            "strain": [self.low, self.high],
            "rate_per_s": [self.slow, self.fast],
            "longest_s": self.longest_s,
            "interval_s": self.interval_s,
            "temperature_C": self.degC,
            "continued": self.continued,
            "count": self.count,
            "courses": [
                {
                    "recording": c.name,
                    "time_s": c.time_s.tolist(),
                    "strain": c.strain.tolist(),
                }
                for c in self.courses
            ],
        }

    @classmethod
    def from_dict(cls, given: Any) -> Recorded:
        """Raise `InputError` unless `given` describes recordings."""
        try:
            courses = tuple(
                Course(
                    str(c["recording"]),
                    np.array(c["time_s"], float),
                    np.array(c["strain"], float),
                )
                for c in given["courses"]
            )
            low, high = map(float, given["strain"])
            slow, fast = map(float, given["rate_per_s"])
            longest, interval = float(given["longest_s"]), float(given["interval_s"])
            warm, count = given["temperature_C"], int(given["count"])
            degC = None if warm is None else (float(warm[0]), float(warm[1]))
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise InputError(f"alternatives cannot be read: {error!r}") from None
        numbers = [low, high, slow, fast, longest, interval, *(degC or ())]
        fine = np.isfinite(numbers).all() and low <= 0 <= high and low < high
        fine = (
            fine
            and count > 0
            and 0 < slow <= fast
            and 0 < interval <= longest <= LONGEST_S
        )
        for c in courses:
            fine = fine and c.time_s.shape == c.strain.shape and c.time_s.ndim == 1
            fine = fine and 1 < len(c.time_s) <= 2 * CORNERS
            fine = fine and bool(np.isfinite([c.time_s, c.strain]).all())
            fine = fine and bool((np.diff(c.time_s) >= 0).all()) and c.seconds > 0
        if not (fine and courses):
            raise InputError("alternatives cannot be read: numbers out of range")
        return cls(
            low, high, slow, fast, longest, interval, degC,
            bool(given.get("continued")), count, courses,
        )  # fmt: skip


def recorded(
    names: Sequence[str],
    chunks: Sequence[Chunk],
    known: Sequence[Array],
    continued: bool,
    one: float = 1.0,
) -> Recorded:
    """Return the limits of recordings: `chunks`, whose strain counts `one` each.

    `known` (n,) holds the stress, NaN where there is none: a torn specimen moves on
    without a stress, and no programme should go there.
    """
    borne = np.concatenate(
        [c.strain[np.isfinite(s)] for c, s in zip(chunks, known, strict=True)]
    )
    low, high = min(float(borne.min()), 0.0), max(float(borne.max()), 0.0)
    courses = []
    for name, chunk in zip(names, chunks, strict=True):
        time, strain = corners(chunk.time_s - chunk.time_s[0], chunk.strain)
        courses.append(Course(name, time, one * np.clip(strain, low, high)))
    rates = np.concatenate([_rates(c, one * (high - low)) for c in courses])
    slow, fast = (float(r) for r in np.quantile(rates, [0.1, 0.9]))
    steps = np.concatenate([np.diff(c.time_s) for c in chunks])
    warm = [c.temperature_C for c in chunks if c.temperature_C is not None]
    degC = np.concatenate(warm) if warm else np.zeros(0)
    degC = degC[np.isfinite(degC)]
    longest = max(courses, key=lambda c: c.seconds)
    return Recorded(
        one * low,
        one * high,
        slow,
        fast,
        longest.seconds,
        float(min(np.median(steps[steps > 0]), longest.seconds)),
        (float(degC.min()), float(degC.max())) if len(degC) else None,
        continued,
        len(courses),
        tuple(courses) if continued else (longest,),
    )


def _rates(course: Course, span: float) -> Array:
    """Return the rates (n,) of the longer stretches of a path, 1/s, one at least."""
    travel, step = np.abs(np.diff(course.strain)), np.diff(course.time_s)
    far = (travel > MOVES * span) & (step > 0)
    if not far.any():
        return np.array([max(travel.sum(), 1e-9 * span) / max(course.seconds, 1e-9)])
    return np.asarray(travel[far] / step[far])


def corners(time_s: Array, strain: Array) -> tuple[Array, Array]:
    """Return the corners (k,) of a path (n,), the largest bends first if too many.

    Ramer 1972, doi:10.1016/S0146-664X(72)80017-0.

    >>> time, strain = corners(np.arange(5.0), np.array([0.0, 1.0, 2.0, 1.0, 0.0]))
    >>> time.tolist(), strain.tolist()
    ([0.0, 2.0, 4.0], [0.0, 2.0, 0.0])
    """
    least = TOLERANCE * max(float(np.ptp(strain)), 1e-300)

    def bend(a: int, b: int) -> tuple[float, int, int, int]:
        if b - a < 2:
            return 0.0, a, a, b
        inner = slice(a + 1, b)
        line = np.interp(time_s[inner], time_s[[a, b]], strain[[a, b]])
        off = np.abs(strain[inner] - line)
        k = int(off.argmax())
        return float(off[k]), a + 1 + k, a, b

    open_, kept = [bend(0, len(time_s) - 1)], {0, len(time_s) - 1}
    while open_ and len(kept) < CORNERS:
        worst = max(open_)
        open_.remove(worst)
        size, k, a, b = worst
        if size <= least:
            break
        kept.add(k)
        open_ += [bend(a, k), bend(k, b)]
    at = sorted(kept)
    return time_s[at], strain[at]


@dataclass(frozen=True)
class Limits:
    """What the next recording may be, in the units of the recordings; None: as so far.

    `minutes` is the longest duration, `max_strain` the largest strain in the directions
    recorded, `max_rate` the largest rate.
    """

    minutes: float | None = None
    max_strain: float | None = None
    max_rate: float | None = None

    def __post_init__(self) -> None:
        """Raise `InputError` unless each limit is a number above 0."""
        for name, option, unit in (
            ("minutes", "--minutes", " min"),
            ("max_strain", "--max-strain", ""),
            ("max_rate", "--max-rate", ""),
        ):
            value = getattr(self, name)
            if value is not None and not 0 < value < LONGEST_S:
                raise InputError(
                    f"{option} is {value:g}{unit}; allowed is a number above 0"
                )


@dataclass(frozen=True)
class Programme:
    """A recording to make: its label, and time in s, strain and degC (n,) or None.

    Samples from `scored` on are recorded; earlier ones are what the specimen has gone
    through. `kind` is "programme", or a cheap one: "repeat" (another specimen), "twice"
    (one specimen, again after a pause) or "blank" (no specimen).
    """

    label: str
    time_s: Array
    strain: Array
    degC: Array | None = None
    kind: str = "programme"
    scored: int = 0

    @property
    def chunk(self) -> Chunk:
        """The strain history."""
        return Chunk(self.time_s, self.strain, self.degC)

    @property
    def seconds(self) -> float:
        return float(self.time_s[-1] - self.time_s[self.scored])

    @property
    def weights(self) -> Array:
        """Weight of each recorded sample in an error, 1 on average."""
        return weights(self.time_s[self.scored :], self.strain[self.scored :])


Moves = list[tuple[float, float]]  # (level, rate), or (NaN, duration) for a hold


class Library:
    """The programmes within the limits of the recordings, or of the user."""

    def __init__(self, known: Recorded, limits: Limits, axes: Axes) -> None:
        self.known, self.axes = known, axes
        size = max(known.high, -known.low)
        ratio = 1.0 if limits.max_strain is None else limits.max_strain / size
        low, high = ratio * known.low, ratio * known.high
        self.up = high if high >= -low else low  # the level of the main direction
        both = min(high, -low) > BOTH * max(high, -low)
        self.back = (low if self.up == high else high) if both else 0.0
        usual = max(min(USUAL_S, TIMES * known.longest_s), known.longest_s)
        self.most_s = usual if limits.minutes is None else 60 * limits.minutes
        self.limit_s = np.inf if limits.minutes is None else self.most_s
        self.held_s = self.most_s if limits.minutes else HELD * known.longest_s
        self.fast = known.fast if limits.max_rate is None else limits.max_rate
        self.slow = min(known.slow, self.fast / SLOWER)
        self.degC = None if known.degC is None else float(np.mean(known.degC))

    def programmes(self) -> list[Programme]:
        """Return every programme that fits into the time, cheap ones last."""
        found = {p.label: p for p in self._own() if p is not None}
        found |= {p.label: p for p in self._cheap() if p is not None}
        return [self._after(p) for p in found.values()]

    def covering(self) -> Programme:
        """Return a programme that shows every kind of loading.

        It takes the time it takes, unless the user limits it: then there are fewer
        levels, and a shorter hold. Raises `InputError` if one cycle does not fit.
        """
        x, r = self.up, self.fast
        hold = _round(max(HELD * self.known.longest_s, 2 * abs(x) / r))
        least = min(LEAST_HOLD * self.known.interval_s, hold)
        third, two, top = (self.level(e) for e in (x / 3, 2 * x / 3, x))
        for levels, times, what in (
            (
                (x / 3, 2 * x / 3, x),
                2,
                f"cycles to {third}, {two} and {top}, each twice,",
            ),
            ((x,), 2, f"two cycles to {top}"),
            ((x,), 1, f"a cycle to {top}"),
        ):
            cycles: Moves = [m for e in levels for m in [(e, r), (0.0, r)] * times]
            left = self.limit_s - _path([*cycles, (x, r)])[0][-1]
            if left < least:
                continue
            hold = min(hold, _round(left)) if left < hold else hold
            made = self._sampled(
                f"{what} at {self.rate(r)}, then a hold of {_seconds(hold)} at {top}",
                *_path([*cycles, (x, r), (np.nan, hold)]),
            )
            return self._after(made)
        raise InputError(NONE_FITS)

    def level(self, strain: float) -> str:
        """Return a strain in words."""
        if self.axes.component:
            return f"{strain:.3g} {self.axes.strain.unit}"
        return f"{100 * strain:.3g} %"

    def rate(self, rate: float) -> str:
        """Return a rate in words."""
        unit = "/s" if not self.axes.component else f" {self.axes.rate}"
        return f"{rate:.2g}{' ' if unit == '/s' else ''}{unit}"

    # -- the library -------------------------------------------------------------------

    def _rates(self) -> list[float]:
        rates = [self.fast, self.slow]
        if self.fast > DECADE**2 * self.slow:
            rates.insert(1, float(np.sqrt(self.fast * self.slow)))
        return rates

    def _own(self) -> Iterator[Programme | None]:
        x = self.up
        top, third, half = self.level(x), self.level(x / 3), self.level(x / 2)
        for r in self._rates():
            at = f"at {self.rate(r)}"

            def loops(*levels: float, rate: float = r) -> Moves:
                return [m for e in levels for m in ((e, rate), (0.0, rate))]

            yield self._made(f"load to {top} and back, twice, {at}", loops(x, x))
            yield self._made(
                f"cycles to {third}, {self.level(2 * x / 3)} and {top}, each twice, "
                f"{at}",
                loops(x / 3, x / 3, 2 * x / 3, 2 * x / 3, x, x),
            )
            yield self._made(
                f"cycles to {half} twice, then to {top} twice, {at}",
                loops(x / 2, x / 2, x, x),
            )
            yield self._made(f"{REPEATS} cycles to {top} {at}", loops(*([x] * REPEATS)))
            small = [x, 0.7 * x, x, 0.4 * x, 0.7 * x, 0.4 * x, x, 0.0]
            yield self._made(
                f"small cycles inside a large one to {top}, {at}",
                [(e, r) for e in small],
            )
            ripple = [0.5 * x, *([0.6 * x, 0.5 * x] * 4), x, 0.5 * x]
            ripple += [*([0.4 * x, 0.5 * x] * 4), 0.0]
            yield self._made(
                f"load to {top} and back {at}, with four cycles of "
                f"{self.level(abs(0.1 * x))} at half way up and down",
                [(e, r) for e in ripple],
            )
            yield self._held(
                f"load to {top} {at}, hold for {{}}, unload, wait as long",
                [(x, r), None, (0.0, r), None],
            )
            yield self._held(
                f"load to {top} and back {at}, wait for {{}} at zero, and the same "
                "again",
                [(x, r), (0.0, r), None, (x, r), (0.0, r)],
            )
            yield self._held(
                f"wait for {{}} before loading, load to {top} and back {at}, wait as "
                "long",
                [None, (x, r), (0.0, r), None],
            )
            levels = [x / 4, x / 2, 3 * x / 4, x, 3 * x / 4, x / 2, x / 4, 0.0]
            yield self._held(
                f"steps of {self.level(abs(x / 4))} up to {top} and down {at}, a hold "
                "of {} on each",
                [m for e in levels for m in ((e, r), None)],
            )
            yield self._held(
                f"cycles to {third}, {self.level(2 * x / 3)} and {top}, each twice, "
                f"{at}, then a hold of {{}} at {top}",
                [*loops(x / 3, x / 3, 2 * x / 3, 2 * x / 3, x, x), (x, r), None],
            )
            if self.back:
                y = self.back
                yield self._made(
                    f"cycles between {top} and {self.level(y)}, twice, {at}",
                    [(x, r), (y, r), (x, r), (y, r), (0.0, r)],
                )
                yield self._made(
                    f"load to {self.level(y)} and back, then to {top} and back, twice, "
                    f"{at}",
                    loops(y, x, y, x),
                )
            if self.known.degC is not None and np.ptp(self.known.degC) > WARM:
                cold, warm = self.known.degC
                made = self._held(
                    f"load to {top} {at}, hold for {{}} as the temperature goes from "
                    f"{cold:.3g} to {warm:.3g} degC, unload, wait as long",
                    [(x, r), None, (0.0, r), None],
                )
                if made is not None:
                    up, down = np.flatnonzero(made.strain == x)[[0, -1]]
                    ends = made.time_s[[up, down]]
                    degC = np.interp(made.time_s, ends, self.known.degC)
                    yield replace(made, degC=degC)
        a, b = self.fast, self.slow
        quarters = [x / 4, x / 2, 3 * x / 4, x]
        way = [*quarters, *quarters[2::-1], 0.0]
        yield self._made(
            f"load to {top} and back, the rate by turns {self.rate(a)} and "
            f"{self.rate(b)}, a quarter of the way each",
            [(e, (a, b)[i % 2]) for i, e in enumerate(way)],
        )
        for first, second in ((a, b), (b, a)):
            yield self._made(
                f"load to {top} and back at {self.rate(first)}, then at "
                f"{self.rate(second)}",
                [(x, first), (0.0, first), (x, second), (0.0, second)],
            )

    def _cheap(self) -> Iterator[Programme | None]:
        if self.known.continued:
            return
        course = self.known.courses[-1]
        time, strain = course.time_s, course.strain
        if course.seconds <= self.most_s:
            yield self._sampled(
                f"repeat {course.name} on another specimen", time, strain, "repeat"
            )
            yield self._sampled(
                f"run the programme of {course.name} without a specimen",
                time,
                strain,
                "blank",
            )
        pause = min(course.seconds, self.most_s - 2 * course.seconds)
        if pause > LEAST_HOLD * self.known.interval_s:
            again = time + time[-1] + pause
            yield self._sampled(
                f"run the programme of {course.name} twice on one specimen, in one "
                f"recording, with a pause of {_seconds(pause)} at its end strain",
                np.concatenate([time, again]),
                np.concatenate([strain, strain]),
                "twice",
            )

    # -- how a programme is made -------------------------------------------------------

    def _made(self, label: str, moves: Moves) -> Programme | None:
        """Return the programme of these moves; None if it takes too long."""
        time, strain = _path(moves)
        if time[-1] > self.most_s * (1 + 1e-9):
            return None
        return self._sampled(label, time, strain)

    def _held(
        self, label: str, moves: Sequence[tuple[float, float] | None]
    ) -> Programme | None:
        """Return the same with holds (None) as long as time allows."""
        level = travel = 0.0
        for move in moves:
            if move is not None:
                travel += abs(move[0] - level) / move[1]
                level = move[0]
        count = sum(m is None for m in moves)
        hold = min((self.most_s - travel) / count, self.held_s)
        hold = _round(hold) if hold > 0 else 0.0
        if hold < LEAST_HOLD * self.known.interval_s:
            return None
        named = label.format(_seconds(hold))
        return self._made(named, [(np.nan, hold) if m is None else m for m in moves])

    def _sampled(
        self, label: str, time: Array, strain: Array, kind: str = "programme"
    ) -> Programme:
        """Return a path, given by corners, at even samples and at its corners."""
        span = float(time[-1])
        count = int(np.clip(span / self.known.interval_s, *SAMPLES)) + 1
        even = np.linspace(0.0, span, count)
        # An even sample beside a corner would be a step of almost no duration.
        near = np.abs(even[np.searchsorted(even, time).clip(0, count - 1)] - time)
        near = np.minimum(near, np.abs(even[(np.searchsorted(even, time) - 1)] - time))
        own = time[near > 0.2 * span / count]
        grid = np.unique(np.concatenate([even, own]))
        if (np.diff(time) <= 0).any():
            time = time + np.linspace(0.0, STEP * span, len(time))
        warm = None if self.degC is None else np.full(len(grid), self.degC)
        return Programme(label, grid, np.interp(grid, time, strain), warm, kind)

    def _after(self, programme: Programme) -> Programme:
        """Return the programme behind all recordings, if these continue one another."""
        if not self.known.continued or programme.kind == "blank":
            return programme
        times, strains, clock = list[Array](), list[Array](), 0.0
        for course in self.known.courses:
            times.append(course.time_s + clock)
            strains.append(course.strain)
            clock += course.seconds + self.known.interval_s
        before, gone = np.concatenate(times), np.concatenate(strains)
        warm = programme.degC
        rest = abs(float(gone[-1])) / self.slow + self.known.interval_s
        return replace(
            programme,
            time_s=np.concatenate([before, programme.time_s + clock + rest]),
            strain=np.concatenate([gone, programme.strain]),
            degC=None
            if warm is None
            else np.append(np.full(len(gone), self.degC), warm),
            scored=len(before),
        )


def _path(moves: Moves) -> tuple[Array, Array]:
    """Return the corners (time, strain) of moves from zero."""
    level, clock = 0.0, 0.0
    time, strain = [0.0], [0.0]
    for to, by in moves:
        if np.isnan(to):
            clock += by
        else:
            clock += abs(to - level) / by
            level = to
        time.append(clock)
        strain.append(level)
    return np.array(time), np.array(strain)


def _round(seconds: float) -> float:
    """Return the time with two digits, rounded down.

    >>> _round(1277.0)
    1200.0
    """
    digit = 10.0 ** (np.floor(np.log10(seconds)) - 1)
    return float(digit * np.floor(seconds / digit * (1 + 1e-9)))


def _seconds(seconds: float) -> str:
    """Return a duration in words.

    >>> _seconds(45.0), _seconds(600.0)
    ('45 s', '10 min')
    """
    return f"{seconds / 60:.3g} min" if seconds >= 300 else f"{seconds:.3g} s"
