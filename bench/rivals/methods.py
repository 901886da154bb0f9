"""All rivals, in the order of the table."""

from __future__ import annotations

from importlib.util import find_spec
from itertools import product

from bench.rivals import laws, learners
from bench.rivals.choice import Method
from bench.rivals.features import SETS
from softnn.contracts import InputError, nearest

SEGMENTS = (4, 8, 16)
DENSITIES = (1, 3)  # relaxation times a decade
PRONY = tuple({"per_decade": n} for n in DENSITIES)
EITHER = ({"on_base": False}, {"on_base": True})
INSTALL = "pip install 'softnn[rivals]'"


METHODS: tuple[Method, ...] = (
    Method(
        "pl_sls",
        "piecewise-linear spring, one branch (PL-SLS)",
        laws.piecewise,
        tuple({"base": "pl-sls", "segments": n} for n in SEGMENTS),
    ),
    Method(
        "pl_wiechert",
        "piecewise-linear spring, many branches (PL-Wiechert)",
        laws.piecewise,
        tuple(
            {"base": "pl-wiechert", "segments": n, "per_decade": k}
            for n, k in product(SEGMENTS, DENSITIES)
        ),
    ),
    Method(
        "prony",
        "linear Prony series",
        laws.quasi_linear,
        tuple({"law": "linear", **p} for p in PRONY),
        law=True,
    ),
    Method(
        "fung",
        "quasi-linear viscoelasticity (Fung)",
        laws.quasi_linear,
        tuple({"law": "fung", **p} for p in PRONY),
        law=True,
    ),
    Method(
        "yeoh",
        "Yeoh alone",
        laws.quasi_linear,
        ({"law": "yeoh", "per_decade": 1, "base": "hooke"},),
        law=True,
    ),
    Method(
        "yeoh_prony",
        "Yeoh with a Prony series",
        laws.quasi_linear,
        tuple({"law": "yeoh", **p} for p in PRONY),
        law=True,
    ),
    Method(
        "ogden_roxburgh",
        "Ogden-Roxburgh softening with a Prony series",
        laws.ogden_roxburgh,
        tuple({"spring": s, **p} for s, p in product(("yeoh", "piecewise"), PRONY)),
        law=True,
    ),
    Method("bergstroem_boyce", "Bergstroem-Boyce", laws.bergstroem_boyce, law=True),
    Method(
        "trees",
        "gradient-boosted trees on history features",
        learners.trees,
        tuple({"leaves": n, **b} for n, b in product((6, 24), EITHER)),
    ),
    Method(
        "gaussian_process",
        "Gaussian process on history features",
        learners.gaussian_process,
        tuple({"inputs": i, **b} for i, b in product(SETS, EITHER)),
    ),
    Method(
        "network",
        "small network of histories",
        learners.network,
        tuple(
            {"inputs": i, "neurons": n, **b}
            for i, n, b in product(SETS, (3, 8), EITHER)
        ),
        quick={"starts": 1},
    ),
    Method(
        "pysindy",
        "PySINDy on history features",
        learners.pysindy,
        tuple(
            {"inputs": i, "degree": d, "threshold": t, **b}
            for i, d, t, b in product(SETS, (1, 2), (0.01, 0.1), EITHER)
        ),
        package="pysindy",
    ),
)


def chosen(names: list[str]) -> list[Method]:
    """Rivals by name, all without a name. Raises `InputError` for a name of none."""
    known = {m.name: m for m in METHODS}
    for name in names:
        if name not in known:
            raise InputError(
                f"no rival is called {name!r}{nearest(name, list(known))}; allowed: "
                f"{', '.join(known)}"
            )
    return [known[n] for n in names or known]


def missing(method: Method) -> bool:
    """Whether the rival needs a package that is not installed."""
    return method.package is not None and find_spec(method.package) is None
