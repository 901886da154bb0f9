"""Units as machines write them -> N, mm, s, MPa, degC. An unknown one is refused."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from softnn.contracts import InputError


@dataclass(frozen=True)
class Unit:
    """In the base unit of `dimension`, a value is value * factor + offset.

    Base units: s, N, mm, mm/mm, MPa, degC, mm2, mm/s, 1/s.
    """

    dimension: str
    factor: float
    offset: float = 0.0


_POUND = 4.4482216152605  # N, exact
_KILOPOND = 9.80665  # N, exact
_INCH = 25.4  # mm, exact
_SQUARE_INCH = _INCH**2

# Left out on purpose: mPa and MN (one letter's case away from MPa and mN, and no
# soft material is tested in them), g and kg (a mass; gf and kgf are forces).
_TABLE: dict[str, dict[str, float]] = {
    "time": {
        **dict.fromkeys(("s", "sec", "secs", "sec.", "second", "seconds", "sek"), 1.0),
        **dict.fromkeys(("seg", "segundos", "secondi", "secondes", "\u79d2"), 1.0),
        **dict.fromkeys(("sekunden", "seconde"), 1.0),
        **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e-3),
        **dict.fromkeys(("us", "micros", "microseconds"), 1e-6),
        **dict.fromkeys(("min", "mins", "min.", "minute", "minutes"), 60.0),
        **dict.fromkeys(("h", "hr", "hrs", "hour", "hours", "std"), 3600.0),
        **dict.fromkeys(("d", "day", "days"), 86400.0),
    },
    "force": {
        **dict.fromkeys(("N", "newton", "newtons", "\u725b"), 1.0),
        **dict.fromkeys(("kN", "\u5343\u725b"), 1e3),
        "mN": 1e-3,
        "uN": 1e-6,
        "cN": 1e-2,
        **dict.fromkeys(("gf", "gram-force", "p"), _KILOPOND / 1e3),
        **dict.fromkeys(("kgf", "kp"), _KILOPOND),
        "tf": _KILOPOND * 1e3,
        **dict.fromkeys(("lbf", "lb", "lbs"), _POUND),
        "klbf": _POUND * 1e3,
        "kip": _POUND * 1e3,
        "ozf": _POUND / 16,
        "dyn": 1e-5,
    },
    "length": {
        **dict.fromkeys(("mm", "\u6beb\u7c73"), 1.0),
        **dict.fromkeys(("um", "micron", "microns"), 1e-3),
        "nm": 1e-6,
        "cm": 10.0,
        "dm": 100.0,
        "m": 1000.0,
        **dict.fromkeys(("in", "in.", "inch", "inches", '"'), _INCH),
        "mil": _INCH / 1e3,
        "ft": 12 * _INCH,
    },
    "strain": {
        **dict.fromkeys(("mm/mm", "m/m", "in/in", "in./in.", "cm/cm", "1", "-"), 1.0),
        **dict.fromkeys(("strain", "--", "um/um"), 1.0),
        **dict.fromkeys(("%", "percent", "pct", "%strain"), 1e-2),
        **dict.fromkeys(("mm/m", "\u2030"), 1e-3),
        **dict.fromkeys(("ustrain", "microstrain", "u\u03b5", "ue", "um/m"), 1e-6),
        **dict.fromkeys(("mstrain", "millistrain"), 1e-3),
    },
    "stress": {
        **dict.fromkeys(("MPa", "N/mm2", "MN/m2", "\u5146\u5e15"), 1.0),
        **dict.fromkeys(("kPa", "kN/m2", "mN/mm2"), 1e-3),
        **dict.fromkeys(("Pa", "N/m2"), 1e-6),
        **dict.fromkeys(("GPa", "kN/mm2"), 1e3),
        "N/cm2": 1e-2,
        **dict.fromkeys(("psi", "lbf/in2"), _POUND / _SQUARE_INCH),
        "ksi": 1e3 * _POUND / _SQUARE_INCH,
        **dict.fromkeys(("kgf/mm2", "kg/mm2", "kp/mm2"), _KILOPOND),
        **dict.fromkeys(("kgf/cm2", "kg/cm2", "kp/cm2"), _KILOPOND / 100),
        **dict.fromkeys(("gf/mm2", "g/mm2"), _KILOPOND / 1e3),
        **dict.fromkeys(("gf/cm2", "g/cm2"), _KILOPOND / 1e5),
        "bar": 0.1,
        "mbar": 1e-4,
        "hPa": 1e-4,
        "mmHg": 133.322e-6,
        "dyn/cm2": 1e-7,
    },
    "temperature": {**dict.fromkeys(("degC", "C", "celsius"), 1.0)},
    "area": {
        **dict.fromkeys(("mm2", "mm^2", "sqmm"), 1.0),
        "cm2": 100.0,
        "m2": 1e6,
        "um2": 1e-6,
        **dict.fromkeys(("in2", "sqin"), _SQUARE_INCH),
    },
    "speed": {
        "mm/s": 1.0,
        "mm/sec": 1.0,
        "mm/min": 1 / 60,
        "mm/h": 1 / 3600,
        "um/s": 1e-3,
        "cm/min": 10 / 60,
        "m/s": 1e3,
        "m/min": 1e3 / 60,
        "in/min": _INCH / 60,
        "in/s": _INCH,
    },
    "rate": {
        **dict.fromkeys(("1/s", "/s", "s-1", "mm/mm/s"), 1.0),
        **dict.fromkeys(("%/s",), 1e-2),
        **dict.fromkeys(("1/min", "/min", "mm/mm/min"), 1 / 60),
        **dict.fromkeys(("%/min",), 1e-2 / 60),
    },
}
_EXACT = {
    text: Unit(dimension, factor)
    for dimension, row in _TABLE.items()
    for text, factor in row.items()
} | {
    **dict.fromkeys(("K", "kelvin", "degK"), Unit("temperature", 1.0, -273.15)),
    **dict.fromkeys(
        ("degF", "F", "fahrenheit"), Unit("temperature", 5 / 9, -32 * 5 / 9)
    ),
}
# Spelt out, and in Russian letters.
_EXACT |= {
    text: _EXACT[unit]
    for unit, texts in {
        "s": "\u0441 \u0441\u0435\u043a",
        "min": "\u043c\u0438\u043d",
        "mm": "millimeter millimetre millimeters millimetres \u043c\u043c",
        "cm": "centimeter centimetre centimeters centimetres",
        "um": "micrometer micrometre micrometers micrometres",
        "N": "\u041d",
        "kN": "kilonewton kilonewtons \u043a\u041d",
        "mN": "millinewton millinewtons",
        "MPa": "megapascal megapascals \u041c\u041f\u0430",
        "kPa": "kilopascal kilopascals \u043a\u041f\u0430",
        "Pa": "pascal pascals",
    }.items()
    for text in texts.split()
}
# A stretch ratio: 1 where the specimen is not strained.
_EXACT["stretch"] = Unit("strain", 1.0, -1.0)
# A scale shows grams where it means their weight.
WEIGHTS = {"g": "gf", "gr": "gf", "gram": "gf", "grams": "gf", "kg": "kgf"}
# What an amplifier or a counter shows, before it is calibrated.
READINGS = ("v", "mv", "uv", "mv/v", "volt", "volts", "counts", "count", "adc", "bit",
            "bits", "raw", "steps", "pulses", "digits", "a.u.", "au")  # fmt: skip
# Case matters for mN (MN is mega) and nm (Nm is a torque).
_FOLDED = {t.casefold(): u for t, u in _EXACT.items() if t not in ("mN", "nm")}


def unit_text(text: str) -> str:
    """The unit without brackets, spaces, exponent marks and typographic variants.

    >>> unit_text(" [N/mm\u00b2] "), unit_text("(\u00b5m)")
    ('N/mm2', 'um')
    """
    text = repair(text).strip().strip("\"'").strip()
    # A ring above and a masculine ordinal, as keyboards have them for a degree.
    text = re.sub("[\u02da\u00ba](?=[CFK]\\b)", "\u00b0", text)
    while len(text) > 1 and text[0] + text[-1] in ("()", "[]", "{}", "<>"):
        text = text[1:-1].strip()
    text = unicodedata.normalize("NFKC", text)  # superscript two, micro, degree C
    text = (
        text.replace("\u03bc", "u").replace("\u00b0", "deg").replace("\u2103", "degC")
    )
    return re.sub(r"[\s^*\u00b7]|\*\*", "", text)


def parse_unit(text: str) -> Unit | None:
    """The unit, or None when it is not one of those known here.

    >>> parse_unit("kN"), parse_unit("mPa")
    (Unit(dimension='force', factor=1000.0, offset=0.0), None)
    """
    plain = unit_text(text)
    if plain in _EXACT:
        return _EXACT[plain]
    # Any case will do, except where case tells milli from mega.
    if plain == "MN" or re.fullmatch(r"m(P[aA]|pA)", plain):
        return None
    return _FOLDED.get(plain.casefold())


def convert(value: float, text: str, dimension: str, what: str) -> float:
    """One value with its unit as text, in the base unit of `dimension`.

    >>> convert(0.18, "cm^2", "area", "section")
    18.0
    """
    unit = parse_unit(text)
    if unit is None or unit.dimension != dimension:
        raise InputError(
            f"{what} is in {text.strip()!r}, which is no unit of {dimension} known "
            f"here; allowed: {known(dimension)}"
        )
    return value * unit.factor + unit.offset


def known(dimension: str) -> str:
    """The units of a dimension, for an error message."""
    names: dict[tuple[float, float], str] = {}  # one of each size, the first
    for text, unit in _EXACT.items():
        if unit.dimension == dimension and text.isascii():
            names.setdefault((unit.factor, unit.offset), text)
    return ", ".join(names.values())


def repair(text: str) -> str:
    r"""UTF-8 read as Latin-1 and saved again, once or twice, put right.

    >>> repair("Pr\u00c3\u00bcfzeit") == "Pr\u00fcfzeit"
    True
    """
    for _ in range(2):
        if not re.search("[\u00c2-\u00c6\u00e2]", text):
            break
        try:
            text = text.encode("cp1252").decode("utf-8")
        except UnicodeError:
            try:
                text = text.encode("latin-1").decode("utf-8")
            except UnicodeError:
                break
    return text
