"""Clocks of files -> seconds: hh:mm:ss, dates with times, counts since an epoch, days.

A time of day without a date goes on over midnight. Whole seconds that many rows share
are spread evenly. What may be read in two ways is refused, never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.source import Cell

DAY_S = 86400.0
FEW = 20  # cells by which a column is recognised
_STAMP = re.compile(
    r"(?:(?P<date>\d{1,4}[-/.][A-Za-z\u00e4]{3,9}\.?[-/. ]\d{2,4}|"
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})[T ,_]*)?"
    r"(?:(?P<days>\d+) days?,? )?"
    r"(?:(?P<a>\d{1,4}):(?P<b>\d{1,2}(?:[.,]\d+)?)(?::(?P<c>\d{1,2}(?:[.,:]\d+)?))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?)?"
    r"\s*(?P<zone>Z|UTC|[-+]\d\d:?\d\d)?"
)
_MONTHS = {
    "jan": 1, "feb": 2, "mar": 3, "m\u00e4r": 3, "mrz": 3, "apr": 4, "may": 5, "mai": 5,
    "jun": 6, "jul": 7, "aug": 8, "sep": 9, "oct": 10, "okt": 10, "nov": 11, "dec": 12,
    "dez": 12,
}  # fmt: skip
# A first value of this size is a count since some year, in this many seconds.
_EPOCHS = ((1e8, 1e10, 1.0, "s"), (1e11, 1e13, 1e-3, "ms"), (1e14, 1e16, 1e-6, "us"),
           (1e17, 1e19, 1e-9, "ns"))  # fmt: skip
_DAYS = ((20_000.0, 80_000.0), (700_000.0, 800_000.0))  # of Excel, of MATLAB


def is_clock(cells: Sequence[Cell]) -> bool:
    """Whether a column holds times of day or dates, in its first cells.

    >>> is_clock(["00:00:01.5", ""]), is_clock(["1.5", "2.5"]), is_clock(["a:b"])
    (True, False, False)
    """
    some = [c for c in cells[: 5 * FEW] if c != ""][:FEW]
    return bool(some) and all(isinstance(c, str) and _parts(c) for c in some)


def _parts(text: str) -> re.Match[str] | None:
    match = _STAMP.fullmatch(text.strip())
    if match is None or match["a"] is None:
        return None
    return match


def clock(cells: Sequence[Cell], unit: str = "") -> tuple[Array, list[str]]:
    """Seconds (n,) since the first cell, blank as NaN, and notes.

    `unit` may say "mm:ss" or "hh:mm" where two fields leave it open. Raises
    `InputError` for a cell that is no such time, with its place in `row` from 0.

    >>> clock(["23:59:59.5", "00:00:00.5"])[0].tolist()
    [0.0, 1.0]
    >>> clock(["01.03.2024 10:00:00", "2.3.2024 10:00:00"])[0].tolist()
    [0.0, 86400.0]
    """
    matches: list[re.Match[str] | None] = []
    for i, cell in enumerate(cells):
        found = _parts(str(cell)) if cell != "" else None
        if found is None and cell != "":
            raise InputError(f"{str(cell)[:40]!r} is no time of day", row=i)
        matches.append(found)
    good = [m for m in matches if m is not None]
    minutes = _two_fields(good, unit)
    seconds = np.array([np.nan if m is None else _of_day(m, minutes) for m in matches])
    notes = []
    if any(m["date"] for m in good):
        seconds += DAY_S * _days(matches)
    else:
        # A twelve-hour clock without AM and PM begins again at 1.
        size = DAY_S if minutes or np.nanmax(seconds) >= 13 * 3600 else DAY_S / 2
        step = np.diff(seconds, prepend=seconds[:1])
        turns = np.nancumsum(step < -size / 2)
        if turns.any():
            notes.append("the clock passes midnight" if size == DAY_S else
                         "the clock of twelve hours begins again")  # fmt: skip
        seconds = seconds + size * turns
    seconds = seconds - seconds[np.isfinite(seconds)][0]
    even = _spread(seconds)
    if even is not None:
        seconds = even
        notes.append("the clock tells whole seconds; rows of one are spread evenly")
    return seconds, notes


def _two_fields(good: Sequence[re.Match[str]], unit: str) -> bool:
    """Whether two fields are minutes and seconds; `InputError` where that is open."""
    if all(m["c"] for m in good):
        return False
    plain = re.sub(r"[^a-z:]", "", unit.casefold())
    if plain in ("mm:ss", "m:s", "min:s", "min:sec", "m:ss"):
        return True
    if plain in ("hh:mm", "h:m", "h:min", "h:mm"):
        return False
    two = [m for m in good if not m["c"]]
    if any(re.search("[.,]", m["b"]) or int(m["a"]) > 23 for m in two):
        return True
    if any(m["date"] or m["half"] for m in two):
        return False
    raise InputError(
        f"{two[0][0]!r} may be hours and minutes, or minutes and seconds; say which "
        "with --unit 'COLUMN=mm:ss' or --unit 'COLUMN=hh:mm'"
    )


def _of_day(match: re.Match[str], minutes: bool) -> float:
    a, b, c = (
        float((match[k] or "0").replace(",", ".").replace(":", ".", 1)) for k in "abc"
    )
    if match["c"] is None and minutes:
        a, b, c = 0.0, a, b
    half = (match["half"] or "").replace(".", "").casefold()
    if half:
        a = a % 12 + (12 if half == "pm" else 0)
    zone = match["zone"] or ""
    shift = 0.0
    if zone[:1] in ("+", "-") and match["date"]:
        size = 3600 * int(zone[1:3]) + 60 * int(zone[-2:])
        shift = -size if zone[0] == "+" else size
    return DAY_S * int(match["days"] or 0) + 3600 * a + 60 * b + c + shift


def _days(matches: Sequence[re.Match[str] | None]) -> Array:
    """Days (n,) of the dates; day or month first, whichever makes the test shorter."""
    texts = [m["date"] if m is not None else None for m in matches]
    different = {t: None for t in texts if t}
    best: dict[str, int] | None = None
    for day_first in (True, False):
        try:
            days = {t: _day(t, day_first) for t in different}
        except ValueError:
            continue
        order = list(days.values())
        if order != sorted(order):
            continue
        if best is None or order[-1] - order[0] < max(best.values()) - min(
            best.values()
        ):
            best = days
    if best is None:
        raise InputError(f"{next(iter(different))!r} is no date, or the dates go back")
    return np.array([np.nan if t is None else best[t] for t in texts], dtype=float)


def _day(text: str, day_first: bool) -> int:
    a, b, c = re.split(r"[-/. ]+", text)
    if len(a) == 4:
        year, month, day = a, b, c
    elif b[:3].casefold() in _MONTHS:
        day, month, year = a, b, c
    elif day_first or "." in text:
        day, month, year = a, b, c
    else:
        month, day, year = a, b, c
    number = _MONTHS.get(month[:3].casefold()) or int(month)
    whole = int(year) + (2000 if len(year) == 2 else 0)
    return date(whole, number, int(day)).toordinal()


def spread(seconds: Array) -> Array | None:
    """Times rounded so far that rows share them, spread evenly; None for any others.

    >>> spread(np.repeat(0.5 * np.arange(12.0), 2))[:4].tolist()
    [0.0, 0.25, 0.5, 0.75]
    """
    if len(seconds) < FEW or not np.isfinite(seconds).all():
        return None
    values = np.unique(seconds)
    if 2 * len(values) > len(seconds) or len(values) < 3:
        return None
    unit = float(np.median(np.diff(values)))
    count = (seconds - seconds[0]) / unit
    if np.abs(count - np.round(count)).max() > 1e-3:
        return None
    even = _spread(np.round(count))
    return None if even is None else seconds[0] + unit * even


def _spread(seconds: Array) -> Array | None:
    """Whole seconds that several rows share, spread evenly; None for any others."""
    good = np.isfinite(seconds)
    if not good.all() or len(seconds) < FEW or np.any(seconds % 1):
        return None
    values, first, count = np.unique(seconds, return_index=True, return_counts=True)
    if len(values) < 3 or np.median(count) < 2 or np.any(np.diff(seconds) < 0):
        return None
    usual = float(np.median(count))
    gap = np.diff(values, append=2 * values[-1] - values[-2])
    out = seconds.copy()
    for start, n, width in zip(first, count, gap, strict=True):
        own = np.arange(n)
        if start == 0 and n < usual:  # recording began within this second
            own = own + usual - n
        # The last second may be cut short, too; a pause is not spread over.
        size = min(width, 1.0) if width > 0 else 1.0
        out[start : start + n] += size * own / max(n, usual)
    return out


def since_an_epoch(values: Array) -> tuple[float, str] | None:
    """Seconds in one of the values (n,), and what they are; None for a usual clock.

    >>> since_an_epoch(np.array([1709337590250.0, 1709337590300.0]))
    (0.001, 'ms since an epoch')
    >>> since_an_epoch(np.array([45352.5, 45352.5001]))
    (86400.0, 'days, as in a spreadsheet')
    """
    good = values[np.isfinite(values)]
    if len(good) < 2:
        return None
    first, span = float(good[0]), float(np.ptp(good))
    for low, high, factor, unit in _EPOCHS:
        if low <= first < high:
            return factor, f"{unit} since an epoch"
    if any(low < first < high for low, high in _DAYS) and 0 < span < 2:
        return DAY_S, "days, as in a spreadsheet"
    return None
