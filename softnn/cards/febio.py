"""Materials of a FEBio file (.feb): laws without volume change, with a Prony series.

The file may come from anybody: a document type or an entity is refused before it is
read, so nothing in it expands or is fetched.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from softnn.cards.given import (
    INCOMPRESSIBLE,
    Given,
    compressible,
    numbers,
    text_of,
    unit_of,
)
from softnn.contracts import InputError
from softnn.models.hyperelastic import LAWS

TERMS = range(1, 7)
SERIES = ("uncoupled viscoelastic", "viscoelastic")
# Which law of the volume does not count where it hardly changes.
NO_STRESS = {"density", "pressure_model"}
_COMMENT = re.compile(r"<!--(.{0,2000}?)-->", re.S)


def read(path: Path) -> list[Given]:
    """Return the materials of a file that have a hyperelastic law."""
    text = text_of(path)
    root = _tree(text, path)
    out, others = [], []
    for node in root.iter("material"):
        name = node.get("name") or node.get("id") or "material"
        try:
            out.append(_material(name, node))
        except InputError as error:
            others.append(str(error))
    if not out:
        raise InputError(others[0] if others else "no <material> in it", file=path)
    unit = _unit_system(root) or unit_of(" ".join(_COMMENT.findall(text)))
    return [replace(one, unit=unit, notes=(*one.notes, *others)) for one in out]


def _unit_system(root: ElementTree.Element) -> str:
    """Return the unit of stress of FEBio's units attribute, as in units="mm-N-s"."""
    said = {"mm-N-s": "MPa", "mm-kg-s": "kPa", "SI": "Pa"}
    nodes = (root, *root.iter("module"), *root.iter("Module"))
    return next((said[n.get("units", "")] for n in nodes if n.get("units") in said), "")


def _tree(text: str, path: Path) -> ElementTree.Element:
    def refused(*_: object) -> None:
        raise InputError("has a document type, which no FEBio file needs", file=path)

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refused
    parser.EntityDeclHandler = refused
    # The encoding that the file names does not count: the text is decoded already.
    data = text.lstrip("\ufeff").encode()
    try:
        parser.Parse(data, True)
        return ElementTree.fromstring(data)
    except (expat.ExpatError, ElementTree.ParseError) as error:
        raise InputError(f"is no XML: {error}", file=path) from None


def _material(name: str, node: ElementTree.Element) -> Given:
    kind = node.get("type", "")
    shares: tuple[float, ...] = ()
    times: tuple[float, ...] = ()
    lasting, inner = 1.0, node
    if kind in SERIES:
        found = node.find("elastic")
        if found is None:
            raise InputError(f"material {name}: {kind} has no <elastic>")
        inner = found
        g, t = (_values(node, x, name) for x in "gt")
        lasting = _value(node, "g0", name, 1.0)
        if lone := [k for k in sorted(g) if g[k] and k not in t]:
            raise InputError(f"material {name}: <t{lone[0]}> is missing")
        pairs = [(g[k], t[k]) for k in sorted(g) if g[k]]
        whole = lasting + sum(x for x, _ in pairs)
        shares = tuple(x / whole for x, _ in pairs)
        times = tuple(x for _, x in pairs)
        lasting = whole
        _known(
            node,
            {"elastic", "g0", "k", *(f"{x}{k}" for x in "gt" for k in TERMS)},
            name,
        )
    law, moduli, bulk = _law(name, inner)
    if not bulk and node is not inner:
        bulk = _value(node, "k", name, 0.0)
    given = Given("febio", name, law, LAWS[law].scaled(tuple(moduli), lasting))
    given = replace(given, shares=shares, times_s=times)
    # The bulk modulus of an uncoupled material does not relax.
    coupled = kind == "viscoelastic"
    read = compressible(given, bulk * (lasting if coupled else 1.0), coupled)
    if read.poisson < INCOMPRESSIBLE:
        raise InputError(
            f"material {name} has a Poisson ratio of {read.poisson:.4g}; laws of FEBio "
            f"are read from {INCOMPRESSIBLE} on, as it has volume terms of its own"
        )
    return read


def _law(name: str, node: ElementTree.Element) -> tuple[str, list[float], float]:
    """Return the law, its moduli, and the bulk modulus (0: incompressible)."""
    kind = node.get("type", "")
    if kind == "neo-Hookean":
        _known(node, {"E", "v"}, name)
        young, nu = (_value(node, x, name) for x in ("E", "v"))
        if not 0 < nu < 0.5:
            raise InputError(f"material {name}: v is {nu:.4g}; a rubber has 0 to 0.5")
        shear = young / (2 * (1 + nu))
        return "neo-hooke", [shear / 2], 2 * shear * (1 + nu) / (3 * (1 - 2 * nu))
    bulk = _value(node, "k", name, 0.0)
    if kind == "incomp neo-Hookean":
        _known(node, {"G", "k"}, name)
        return "neo-hooke", [_value(node, "G", name) / 2], bulk
    if kind == "Mooney-Rivlin":
        _known(node, {"c1", "c2", "k"}, name)
        return "mooney-rivlin", [_value(node, x, name) for x in ("c1", "c2")], bulk
    c, m = (_values(node, x, name) for x in "cm")
    if kind == "Yeoh" and not any(c.get(k) for k in (4, 5, 6)):
        _known(node, {"k", *(f"c{k}" for k in TERMS)}, name)
        return "yeoh", [c.get(k, 0.0) for k in (1, 2, 3)], bulk
    if kind == "Ogden":
        _known(node, {"k", *(f"{x}{k}" for x in "cm" for k in TERMS)}, name)
        # W = sum of c / m^2 (...): the shear modulus is half of the sum of c.
        terms = [(c[k] / 2, m.get(k, 0.0)) for k in sorted(c) if c[k]]
        if 1 <= len(terms) <= 3:
            return f"ogden{len(terms)}", [x for pair in terms for x in pair], bulk
    if kind == "Arruda-Boyce":
        _known(node, {"mu", "N", "k"}, name)
        links = _value(node, "N", name)
        return "arruda-boyce", [_value(node, "mu", name), float(np.sqrt(links))], bulk
    raise InputError(
        f"material {name}: {kind[:40]!r} is not read; incomp neo-Hookean, neo-Hookean, "
        "Mooney-Rivlin, Yeoh, Ogden up to 3 terms and Arruda-Boyce are, and "
        "(uncoupled) viscoelastic with them"
    )


def _known(node: ElementTree.Element, names: set[str], name: str) -> None:
    for child in node:
        if child.tag not in names | NO_STRESS:
            raise InputError(f"material {name}: <{str(child.tag)[:40]}> is not read")


def _value(
    node: ElementTree.Element, tag: str, name: str, usual: float | None = None
) -> float:
    child = node.find(tag)
    if child is None and usual is not None:
        return usual
    if child is None or not (child.text or "").strip():
        raise InputError(f"material {name}: <{tag}> is missing")
    if child.get("lc"):
        raise InputError(f"material {name}: <{tag}> changes with a load curve")
    return numbers([child.text or ""], f"material {name}, <{tag}>")[0]


def _values(node: ElementTree.Element, letter: str, name: str) -> dict[int, float]:
    return {
        k: _value(node, f"{letter}{k}", name)
        for k in TERMS
        if node.find(f"{letter}{k}") is not None
    }
