"""Materials of an Abaqus input file: hyperelastic laws, Prony series, softening, flow.

Keywords and data lines as in the Abaqus Keywords Reference. Nothing is guessed: an
option or keyword that changes the stress and is not known raises `InputError`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from softnn.cards.given import (
    Given,
    bulk_of,
    compressible,
    numbers,
    series_for,
    text_of,
    unit_of,
)
from softnn.contracts import InputError
from softnn.models.bergstrom_boyce import XI
from softnn.models.hyperelastic import LAWS as HYPERELASTIC

DEEPEST = 8  # files that include files
# Keywords of a material that do not change the stress of a test at one temperature.
NO_STRESS = {
    "density", "expansion", "conductivity", "specificheat", "electricalconductivity",
    "dielectric", "diffusivity", "solubility", "trs", "usermaterialvariables",
}  # fmt: skip
SERIES = {"sheartestdata", "combinedtestdata", "volumetrictestdata"}
LAWS = ("neohooke", "mooney-rivlin", "yeoh", "ogden", "arruda-boyce")
FORMS = (*LAWS, "reducedpolynomial", "polynomial")


@dataclass
class Block:
    """A keyword, its options, its data lines, and where it stands."""

    word: str
    options: dict[str, str]
    rows: list[list[float]]
    where: str


def read(path: Path) -> list[Given]:
    """Return the materials of a file that have a hyperelastic law."""
    out: list[Given] = []
    material: list[Block] | None = None
    name, comments = "", list[str]()
    every: list[tuple[str, list[Block]]] = []
    for block in blocks(path, path.parent.resolve(), comments):
        if block.word == "material":
            name = block.options.get("name", "") or f"material {len(every) + 1}"
            material = []
            every.append((name, material))
        elif block.word in _ENDS:
            material = None
        elif material is not None:
            material.append(block)
    unit = unit_of("\n".join(comments))
    for name, parts in every:
        words = {b.word for b in parts}
        if words & {"hyperelastic", "hyperfoam"}:
            out.append(replace(_material(name, parts), unit=unit))
    if not out:
        raise InputError("no *HYPERELASTIC or *HYPERFOAM in a *MATERIAL", file=path)
    return out


# Keywords after which a line belongs to no material any more.
_ENDS = {
    "step", "part", "assembly", "node", "element", "solidsection", "shellsection",
    "membranesection", "cohesivesection", "boundary", "amplitude", "instance", "nset",
    "elset", "surface", "initialconditions", "surfaceinteraction", "contactpair",
    "contact", "contactcontrols", "equation", "mpc", "coupling", "tie", "rigidbody",
    "orientation", "transform", "system", "heading", "preprint", "restart",
    "timepoints", "physicalconstants", "predefinedfield",
}  # fmt: skip


def blocks(
    path: Path, folder: Path, comments: list[str], depth: int = 0
) -> Iterator[Block]:
    """Yield the keywords of a file and of those that it includes, in order."""
    if depth > DEEPEST:
        raise InputError(f"includes more than {DEEPEST} files in turn", file=path)
    now: Block | None = None
    lines = text_of(path).splitlines()
    i = 0
    while i < len(lines):
        line, at = lines[i].strip(), f"{path.name}, line {i + 1}"
        i += 1
        if line.startswith("**") or not line:
            comments.append(line)
            continue
        if not line.startswith("*"):
            if now is not None and now.word in _READ:
                fields = line.rstrip(",").split(",")
                now.rows.append(numbers(fields, at))
            continue
        while line.endswith(",") and i < len(lines):
            more = lines[i].strip()
            line += "" if more.startswith("**") else more
            i += 1
        word, *options = (x.strip() for x in line[1:].split(","))
        given = {}
        for option in options:
            key, _, value = option.partition("=")
            given[_plain(key)] = value.strip().strip('"')
        if now is not None:
            yield now
            now = None
        if _plain(word) == "include":
            yield from blocks(
                _inside(given.get("input", ""), folder, at), folder, comments, depth + 1
            )
            continue
        now = Block(_plain(word), given, [], at)
    if now is not None:
        yield now


_ONCE = {"hyperelastic", "viscoelastic", "mullinseffect", "hysteresis"}
_READ = {*_ONCE, "hyperfoam", *SERIES}


def _plain(text: str) -> str:
    return "".join(text.lower().split())


def _inside(name: str, folder: Path, where: str) -> Path:
    """Return an included file, which must lie in the folder of the card."""
    path = (folder / name).resolve()
    if not name or not path.is_relative_to(folder) or not path.is_file():
        raise InputError(
            f"{where}: *INCLUDE of {name[:80]!r}, which is no file in the folder of "
            "the card; copy it there"
        )
    return path


def _material(name: str, parts: list[Block]) -> Given:
    law: Given | None = None
    notes: list[str] = []
    lasting = True  # Abaqus takes moduli for long-term ones unless told otherwise
    d: list[float] = [0.0]
    law_at = ""
    series: tuple[list[float], list[float], list[float]] = ([], [], [])
    mullins = hysteresis = None
    awaited: Block | None = None
    words = [b.word.replace("hyperfoam", "hyperelastic") for b in parts]
    for block in parts:
        same = block.word.replace("hyperfoam", "hyperelastic")
        if same in _ONCE and words.count(same) > 1:
            raise InputError(f"{block.where}: *{block.word.upper()} stands there twice")
        if block.word in ("hyperelastic", "hyperfoam"):
            said = _plain(block.options.get("moduli", "longterm"))
            if said not in ("longterm", "instantaneous"):
                raise InputError(f"{block.where}: MODULI={said} is not known")
            lasting = said == "longterm"
            foam = block.word == "hyperfoam"
            law, d = (_foam if foam else _hyperelastic)(name, block)
            law_at = block.where
        elif block.word == "viscoelastic":
            kind = _plain(block.options.get("time", "") or "")
            if kind == "prony":
                if not block.rows or any(any(r[3:]) for r in block.rows):
                    raise InputError(
                        f"{block.where}: a series has one term a line: shares of shear "
                        "and bulk, and the time"
                    )
                rows = [r + [0.0] * (3 - len(r)) for r in block.rows]
                series = tuple([r[k] for r in rows] for k in range(3))  # type: ignore[assignment]
            elif kind == "relaxationtestdata":
                awaited = block
            else:
                raise InputError(
                    f"{block.where}: *VISCOELASTIC is read with TIME=PRONY or "
                    "TIME=RELAXATION TEST DATA"
                )
        elif block.word in SERIES and awaited is not None:
            if block.word == "volumetrictestdata":
                raise InputError(f"{block.where}: bulk relaxation data are not read")
            shares, bulk_shares, times, off = _relaxation(block)
            series = shares, bulk_shares, times
            notes.append(
                f"{len(shares)} Prony terms for the relaxation data, off by up to "
                f"{100 * off:.2g} % of the initial modulus"
            )
        elif block.word == "mullinseffect":
            mullins = _mullins(block)
        elif block.word == "hysteresis":
            hysteresis = _hysteresis(block)
        elif block.word in NO_STRESS:
            notes.append(f"not read: *{block.word.upper()}")
        else:
            raise InputError(
                f"{block.where}: *{block.word.upper()[:40]} changes the stress, and "
                "softnn does not know it; take it out, or simulate with your code and "
                "give the column simulated_MPa"
            )
    assert law is not None  # asked before
    if awaited is not None and not series[0]:
        raise InputError(f"{awaited.where}: no *SHEAR TEST DATA that relaxes follows")
    g, k, tau = series
    if hysteresis is not None and not lasting:  # moduli of both networks together
        factor = 1 / (1 + hysteresis[0])
        law = replace(law, moduli=HYPERELASTIC[law.law].scaled(law.moduli, factor))
    given = replace(
        law,
        shares=tuple(g),
        times_s=tuple(tau),
        mullins=mullins,
        hysteresis=hysteresis,
        notes=(*law.notes, *notes),
    )
    bulk = bulk_of(law, d, law_at)
    if lasting and g:
        factor = 1 / (1 - sum(g))
        given = replace(given, moduli=HYPERELASTIC[law.law].scaled(law.moduli, factor))
        if not sum(k) < 1:
            raise InputError(f"material {name}: shares of bulk add up to {sum(k):.4g}")
        bulk /= 1 - sum(k)
    alike = bool(g) and np.allclose(g, k, rtol=1e-6)
    return compressible(given, bulk, alike)


def _relaxation(block: Block) -> tuple[list[float], list[float], list[float], float]:
    """Return shares of shear, of bulk, times, and the error for relaxation data.

    A line holds the modulus of shear, in combined data that of bulk, and the time.
    """
    count = 3 if block.word == "combinedtestdata" else 2
    if any(len(r) < count or any(r[count:]) for r in block.rows) or not block.rows:
        raise InputError(
            f"{block.where}: a line of relaxation data has {count} numbers"
        )
    modulus, *bulk, time = np.array([r[:count] for r in block.rows]).T
    told = block.options.get("shrinf")
    lasting = None if told is None else numbers([told], block.where)[0]
    if lasting is not None and not 0 < lasting < 1:
        raise InputError(
            f"{block.where}: SHRINF is {lasting:.4g}; it is above 0, below 1"
        )
    shares, times, off = series_for(time, modulus, lasting)
    alike = bool(bulk) and np.allclose(bulk[0], modulus, rtol=1e-6)
    if bulk and not alike and not np.allclose(bulk[0], 1.0, rtol=1e-6):
        raise InputError(
            f"{block.where}: bulk relaxation data are read where they equal those of "
            "shear"
        )
    return list(shares), [g * alike for g in shares], list(times), off


def _mullins(block: Block) -> tuple[float, float, float]:
    if set(block.options) - {"beta"} or len(block.rows) != 1 or len(block.rows[0]) < 3:
        raise InputError(
            f"{block.where}: *MULLINS EFFECT is read with one line of r, m and beta"
        )
    r, m, beta = block.rows[0][:3]
    return r, m, beta


def _hysteresis(block: Block) -> tuple[float, float, float, float]:
    """Return S, A, m and C of the Bergström-Boyce model."""
    values = [x for row in block.rows for x in row]
    if block.options or len(values) not in (4, 5) or {*values[4:]} - {XI}:
        raise InputError(
            f"{block.where}: *HYSTERESIS is read with one line of S, A, m and C; E is "
            f"{XI:g} or left out"
        )
    s, a, m, c = values[:4]
    if not (s > 0 and a > 0):
        raise InputError(
            f"{block.where}: S is {s:.6g} and A is {a:.6g}; both are above 0"
        )
    return s, a, m, c


def _data(block: Block, count: int) -> list[float]:
    """Return the numbers of one set of moduli; later temperatures are refused."""
    values = [x for row in block.rows for x in row]
    first = len(block.rows[0]) if block.rows else 0
    lines = -(-count // 8)
    if len(block.rows) > lines or first > 8:
        raise InputError(
            f"{block.where}: moduli at more than one temperature; keep the line of "
            "the temperature of the test"
        )
    if any(len(row) < 8 for row in block.rows[:-1]) and any(
        x for row in block.rows[1:] for x in row
    ):
        raise InputError(
            f"{block.where}: a line of moduli has 8 numbers before the next one begins"
        )
    if any(values[count + 1 :]):
        raise InputError(
            f"{block.where}: more numbers than its {count} moduli and a temperature; "
            "is N right?"
        )
    return (values + [0.0] * count)[:count]


def _hyperelastic(name: str, block: Block) -> tuple[Given, list[float]]:
    options = {k: v for k, v in block.options.items() if k != "moduli"}
    form = next((f for f in FORMS if f in options), "polynomial")
    terms = int(numbers([options.get("n", "1")], block.where)[0])
    unknown = set(options) - {form, "n"}
    if unknown or not block.rows:
        what = ", ".join(sorted(unknown)).upper()[:60] or "test data"
        what = what.replace("TESTDATAINPUT", "TEST DATA INPUT")
        raise InputError(
            f"{block.where}: *HYPERELASTIC is read with its moduli, in the forms "
            f"{', '.join(FORMS).upper()}; not with {what}"
        )

    def given(
        law: str, moduli: list[float], d: list[float]
    ) -> tuple[Given, list[float]]:
        return Given("abaqus", name, law, tuple(moduli)), d

    if form == "neohooke" or (form == "reducedpolynomial" and terms == 1):
        c10, d1 = _data(block, 2)
        return given("neo-hooke", [c10], [d1])
    if form == "mooney-rivlin" or (form == "polynomial" and terms == 1):
        *c, d1 = _data(block, 3)
        return given("mooney-rivlin", c, [d1])
    if form == "yeoh" or (form == "reducedpolynomial" and terms in (2, 3)):
        terms = 3 if form == "yeoh" else terms
        values = _data(block, 2 * terms)
        return given("yeoh", (values[:terms] + [0.0])[:3], values[terms:])
    if form == "ogden" and terms in (1, 2, 3):
        values = _data(block, 3 * terms)
        return given(f"ogden{terms}", values[: 2 * terms], values[2 * terms :])
    if form == "arruda-boyce":
        *c, d1 = _data(block, 3)
        return given("arruda-boyce", c, [d1])
    raise InputError(
        f"{block.where}: {form.upper()} of {terms} terms is not read; OGDEN is up to "
        "N=3, REDUCED POLYNOMIAL up to N=3, POLYNOMIAL with N=1"
    )


def _foam(name: str, block: Block) -> tuple[Given, list[float]]:
    terms = int(numbers([block.options.get("n", "1")], block.where)[0])
    unknown = set(block.options) - {"n", "moduli"}
    if unknown or terms not in (1, 2) or not block.rows:
        what = ", ".join(sorted(unknown)).upper()[:60] or f"N={terms}"
        what = what.replace("TESTDATAINPUT", "TEST DATA INPUT")
        raise InputError(
            f"{block.where}: *HYPERFOAM is read with its moduli and N=1 or N=2; not "
            f"with {what if block.rows or unknown else 'no moduli'}"
        )
    values = _data(block, 3 * terms)
    pairs, ratios = values[: 2 * terms], values[2 * terms :]
    moduli: list[float] = []
    for k in range(2):
        # One term: the second has no modulus.
        more = (
            [*pairs[2 * k : 2 * k + 2], ratios[k]]
            if k < terms
            else [0.0, -2.0, ratios[0]]
        )
        moduli += more
    return Given("abaqus", name, "hyperfoam", tuple(moduli), poisson=ratios[0]), [0.0]
