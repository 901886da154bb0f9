"""Materials of Ansys Mechanical APDL: TB,HYPER with TB,PRONY and TB,CDM.

Moduli of a law with a Prony series are those before it relaxes. Numbers are literal, or
names that the file has set before.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from softnn.cards.given import (
    Given,
    bulk_of,
    compressible,
    numbers,
    text_of,
    unit_of,
)
from softnn.contracts import InputError

# Commands that say nothing of a stress; all others but TB are refused inside a card.
NO_STRESS = ("/", "MP,DENS", "MP,ALPX", "MP,KXX", "MP,C,", "ET,", "FINISH", "EXIT")
LAWS = ("NEO", "MOON", "YEOH", "OGDE", "BOYC", "FOAM", "GENT")
READ = ("HYPER", "PRONY", "CDM")


@dataclass
class Table:
    """The data of one TB command: its options and the constants by place."""

    kind: str
    terms: int
    option: str
    where: str
    values: dict[int, float] = field(default_factory=dict)

    def first(self, count: int) -> list[float]:
        """Return the constants 1 to `count`; those that are not given are 0.

        Raises `InputError` where there are more.
        """
        if any(x for k, x in self.values.items() if not 1 <= k <= count):
            raise InputError(
                f"{self.where}: TB,{self.kind} has more constants than its {count}; "
                "is its NPTS right?"
            )
        return [self.values.get(k, 0.0) for k in range(1, count + 1)]


def read(path: Path) -> list[Given]:
    """Return the materials of a file that have a hyperelastic law."""
    comments, notes = list[str](), list[str]()
    names: dict[str, str] = {}
    found: dict[str, list[Table]] = {}
    now: Table | None = None
    for i, raw in enumerate(text_of(path).splitlines(), start=1):
        code, _, comment = raw.partition("!")
        comments.append(comment)
        for line in filter(None, (x.strip() for x in code.split("$"))):
            where = f"{path.name}, line {i}"
            fields = [names.get(f.strip().upper(), f.strip()) for f in line.split(",")]
            word = fields[0].upper()
            if "=" in line and "," not in line:
                key, _, value = line.partition("=")
                names[key.strip().upper()] = value.strip()
            elif word == "TB":
                now = _table(fields, where)
                found.setdefault(fields[2] if len(fields) > 2 else "", []).append(now)
            elif word == "TBDATA" and now is not None:
                # After the last one filled, where no place is given; a blank keeps.
                place = (fields[1:2] or [""])[0] or str(max(now.values, default=0) + 1)
                first = int(numbers([place], where)[0])
                for k, field in enumerate(fields[2:], start=first):
                    if field:
                        now.values[k] = numbers([field], where)[0]
            elif word == "TBTEMP":
                if now is not None and now.values:
                    raise InputError(
                        f"{where}: constants at more than one temperature; keep those "
                        "of the temperature of the test"
                    )
            elif line.upper().startswith(NO_STRESS):
                notes.append(f"not read: {line[:40]}")
            else:
                raise InputError(
                    f"{where}: {line[:60]!r} is no command of a material that softnn "
                    "knows; give a file with TB, TBDATA and TBTEMP"
                )
    out = [
        replace(_material(name or "1", tables), unit=unit_of("\n".join(comments)))
        for name, tables in found.items()
        if any(t.kind == "HYPER" for t in tables)
    ]
    if not out:
        raise InputError("no TB,HYPER in it", file=path)
    return [replace(one, notes=(*one.notes, *notes)) for one in out]


def _table(fields: list[str], where: str) -> Table:
    fields = [*fields, "", "", "", ""]
    kind, temperatures, option = (fields[k].upper() for k in (1, 3, 5))
    if kind not in READ:
        raise InputError(
            f"{where}: TB,{kind[:20]} changes the stress, and softnn does not know it; "
            f"it reads TB with {', '.join(READ)}"
        )
    if temperatures not in ("", "0", "1"):
        raise InputError(f"{where}: constants at more than one temperature")
    if kind == "HYPER":
        option = option or "MOONEY"
    usual = "2" if kind == "HYPER" and option.startswith("MOON") else "1"
    terms = int(numbers([fields[4] or usual], where)[0])
    return Table(kind, terms, option, where)


def _material(name: str, tables: list[Table]) -> Given:
    given: Given | None = None
    d: list[float] = [0.0]
    law_at = ""
    series: dict[str, tuple[list[float], list[float]]] = {}
    mullins = None
    for table in tables:
        if table.kind == "HYPER":
            given, d = _law(name, table)
            law_at = table.where
        elif table.kind == "PRONY":
            values = table.first(2 * table.terms)
            if table.option[:4] not in ("SHEA", "BULK", ""):
                raise InputError(
                    f"{table.where}: TB,PRONY is read with SHEAR and BULK, in shares "
                    "and times"
                )
            series[table.option[:4] or "SHEA"] = values[::2], values[1::2]
        elif table.kind == "CDM":
            if not table.option.startswith("PSE2"):
                raise InputError(f"{table.where}: TB,CDM is read with PSE2 alone")
            r, m, beta = table.first(3)
            mullins = r, m, beta
    assert given is not None  # asked before
    bulk = bulk_of(given, d, law_at)
    shares, times = series.get("SHEA", ([], []))
    given = replace(given, shares=tuple(shares), times_s=tuple(times), mullins=mullins)
    other = series.get("BULK")
    alike = other is not None and other[1] == times and np.allclose(other[0], shares)
    return compressible(given, bulk, alike)


def _law(name: str, table: Table) -> tuple[Given, list[float]]:
    option, n = table.option[:4], table.terms
    said = option if option in LAWS else option[:3]

    def made(
        law: str, moduli: list[float], d: list[float]
    ) -> tuple[Given, list[float]]:
        return Given("ansys", name, law, tuple(moduli)), d

    if said == "NEO":
        mu, d = table.first(2)
        return made("neo-hooke", [mu / 2], [d])
    if said == "MOON" and n == 2:
        *c, d = table.first(3)
        return made("mooney-rivlin", c, [d])
    if said == "YEOH" and n in (1, 2, 3):
        values = table.first(2 * n)
        return made("yeoh", (values[:n] + [0.0, 0.0])[:3], values[n:])
    if said == "OGDE" and n in (1, 2, 3):
        values = table.first(3 * n)
        # W = sum of mu / alpha (...): the shear modulus is half of the sum of products.
        pairs = zip(values[0 : 2 * n : 2], values[1 : 2 * n : 2], strict=True)
        moduli = [x for mu, a in pairs for x in (mu * a / 2, a)]
        return made(f"ogden{n}", moduli, values[2 * n :])
    if said == "BOYC":
        *m, d = table.first(3)
        return made("arruda-boyce", m, [d])
    if said == "GENT":
        *m, d = table.first(3)
        return made("gent", m, [d])
    if said == "FOAM" and n in (1, 2):
        values = table.first(3 * n)
        betas = values[2 * n :]
        ratios = [b / (1 + 2 * b) for b in betas]
        terms: list[float] = []
        for k in range(2):
            mu, a = values[2 * k : 2 * k + 2] if k < n else (0.0, -2.0)
            terms += [mu * a / 2, a, ratios[min(k, n - 1)]]
        given = Given("ansys", name, "hyperfoam", tuple(terms), poisson=ratios[0])
        return given, [0.0]
    raise InputError(
        f"{table.where}: TB,HYPER with {table.option[:20] or 'no law'} of {n} "
        "constants is not read; NEO, MOONEY of 2, YEOH and OGDEN up to 3, BOYCE, "
        "GENT and FOAM up to 2 are"
    )
