r"""Fits that a user knows: piecewise-linear, Prony and published laws.

All but Bergstroem and Boyce's are a spring and Maxwell branches driven by a measure of
strain (`MEASURES`), fitted by least squares in stress with non-negative stiffnesses.
With the stress of an elastic law as the measure that is quasi-linear viscoelasticity:

.. math:: \sigma(t) = \int G(t - t')\, \frac{d\sigma_e}{dt'}\, dt', \qquad
          G(t) = g_\infty + \sum_i g_i e^{-t/\tau_i}

Fung 1993, *Biomechanics*, section 7.6; Abaqus calls it large-strain viscoelasticity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares, minimize

from bench.rivals.network_b import BergstroemBoyce
from bench.rivals.problem import Predict
from bench.rivals.problem import least_squares as fitted
from softnn.contracts import Array, Chunk
from softnn.effects import effect
from softnn.fit import Data, Fit, Piece
from softnn.models.units import build
from softnn.simulate import Term, simulate

THINNEST = 0.02  # smallest stretch
STEEPEST = 30.0  # exponent of Fung's law at the largest strain
EVALUATIONS = 60  # of a fit without derivatives

Measure = Callable[[Array, Array], Array]


def linear(strain: Array, p: Array) -> Array:
    return strain


def fung(strain: Array, p: Array) -> Array:
    """Exponential, of slope 1 at zero strain; Fung 1993, section 7.5."""
    a = p[0]
    if abs(a) < 1e-6:
        return strain
    return np.expm1(np.clip(a * strain, -STEEPEST, STEEPEST)) / a


def yeoh(strain: Array, p: Array) -> Array:
    """Engineering stress of Yeoh's law over its modulus; 1993, doi:10.5254/1.3538343.

    p (2,): C2 and C3 over C1. With both at zero it is neo-Hooke's.
    """
    stretch = np.maximum(1 + strain, THINNEST)
    i = stretch**2 + 2 / stretch - 3
    slope = 1 + 2 * p[0] * i + 3 * p[1] * i**2
    return (stretch - stretch**-2) * slope / 3


@dataclass(frozen=True)
class Elastic:
    """A measure of strain, where its parameters are looked for, and in what unit."""

    measure: Measure
    starts: Callable[[float], list[list[float]]]


MEASURES = {
    "linear": Elastic(linear, lambda reach: [[]]),
    "fung": Elastic(fung, lambda reach: [[2 / reach], [-1 / reach]]),
    "yeoh": Elastic(yeoh, lambda reach: [[0.0, 0.0]]),
}


def measured(data: Data, elastic: Elastic, p: Array) -> Data:
    """The data with the measure in place of the strain."""
    return replace(data, chunks=tuple(driven(data.chunks, elastic, p)))


def driven(chunks: Sequence[Chunk], elastic: Elastic, p: Array) -> list[Chunk]:
    return [replace(c, strain=elastic.measure(c.strain, p)) for c in chunks]


def spring_and_branches(
    data: Data, base: str, segments: int, per_decade: int, pieces: Sequence[Piece] = ()
) -> Fit:
    """The base fitted to strain as the data have it."""
    low = min(float(c.strain.min()) for c in data.chunks)
    high = max(float(c.strain.max()) for c in data.chunks)
    scales = data.scales()
    units = build(
        base,
        low,
        high,
        scales.interval_s,
        float(scales.duration_s.max()),
        segments,
        per_decade,
    )
    return fitted(data, units, pieces)


def predicted(found: Fit, elastic: Elastic, p: Array) -> Predict:
    guess = found.guess
    terms = [Term(piece.effect, piece.values) for piece in guess.pieces]

    def predict(chunks: Sequence[Chunk]) -> list[Array]:
        return simulate(guess.units, guess.stiffness, terms, driven(chunks, elastic, p))

    return predict


def piecewise(
    data: Data, rng: np.random.Generator, base: str, segments: int, per_decade: int = 3
) -> Predict:
    """PL-SLS or PL-Wiechert with so many segments."""
    found = spring_and_branches(data, base, segments, per_decade)
    return predicted(found, MEASURES["linear"], np.zeros(0))


def quasi_linear(
    data: Data,
    rng: np.random.Generator,
    law: str,
    per_decade: int,
    base: str = "wiechert",
) -> Predict:
    """A Prony series on an elastic law; the law's parameters by a simplex search."""
    elastic = MEASURES[law]
    found, p = elastic_fit(data, elastic, base, per_decade)
    return predicted(found, elastic, p)


def elastic_fit(
    data: Data, elastic: Elastic, base: str, per_decade: int
) -> tuple[Fit, Array]:
    """Branches at their best for the best parameters of the elastic law."""

    def at(p: Array) -> Fit:
        return spring_and_branches(measured(data, elastic, p), base, 1, per_decade)

    def cost(p: Array) -> float:
        value = at(p).chi2
        return float(np.log(value)) if np.isfinite(value) and value > 0 else 1e6

    reach = float(max(np.abs(c.strain).max() for c in data.chunks))
    best, least = np.zeros(0), np.inf
    for start in elastic.starts(reach):
        if not start:
            return at(np.zeros(0)), np.zeros(0)
        sizes = np.where(np.array(start) == 0, 0.2 / reach, np.array(start))
        simplex = np.array([start, *(np.array(start) + np.diag(sizes))])
        options = {
            "maxfev": EVALUATIONS,
            "initial_simplex": simplex,
            "xatol": 1e-3,
            "fatol": 1e-4,
        }
        found = minimize(cost, start, method="Nelder-Mead", options=options)
        if found.fun < least:
            best, least = found.x, found.fun
    return at(best), best


def ogden_roxburgh(
    data: Data, rng: np.random.Generator, spring: str, per_decade: int
) -> Predict:
    """Ogden and Roxburgh's softening on reloading, of a spring and a Prony series.

    The spring is Yeoh's or piecewise linear. 1999, doi:10.1098/rspa.1999.0431.
    """
    elastic, p, base = MEASURES["linear"], np.zeros(0), "pl-wiechert"
    if spring == "yeoh":
        elastic, base = MEASURES["yeoh"], "wiechert"
        _, p = elastic_fit(data, elastic, base, per_decade)
    seen, law = measured(data, elastic, p), effect("mullins_softening")
    fits = []
    for start in law.starts(seen.scales()):
        values: dict[str, Any] = law.defaults() | dict(start)
        piece = Piece(law, values, tuple(values))
        fits.append(spring_and_branches(seen, base, 8, per_decade, [piece]))
    return predicted(min(fits, key=lambda f: f.chi2), elastic, p)


def bergstroem_boyce(data: Data, rng: np.random.Generator) -> Predict:
    """Yeoh's spring beside a spring and a dashpot of power-law flow.

    Bergstroem and Boyce 1998, doi:10.1016/S0022-5096(97)00075-6.
    """
    best, least = None, np.inf
    for start in BergstroemBoyce.starts(data):
        found = least_squares(
            lambda x: BergstroemBoyce.of(x).residual(data),
            start,
            bounds=BergstroemBoyce.bounds(data),
            x_scale="jac",
            max_nfev=40,
        )
        if found.cost < least:
            best, least = found.x, found.cost
    assert best is not None  # there is a start
    return BergstroemBoyce.of(best).predict
