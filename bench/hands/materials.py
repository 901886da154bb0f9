"""Materials: equilibrium springs of unit modulus, and spectra of relaxation times.

All stress is engineering stress of an incompressible bar in uniaxial load, but for
the foam.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, loguniform

Curve = Callable[[Array], Array]


@dataclass(frozen=True)
class Skeleton:
    """A spring of unit initial modulus; `make(rng, em)` draws it for strains to em."""

    name: str
    side: str
    reference: str
    make: Callable[[Rng, float], tuple[dict[str, float], Curve]]


def _bend(e: Array) -> Array:
    stretch = np.maximum(1 + e, 0.02)
    return (stretch - stretch**-2) / 3


def _first(e: Array) -> Array:
    stretch = np.maximum(1 + e, 0.02)
    return stretch**2 + 2 / stretch - 3


def neo_hooke(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = (l - l^-2)/3."""
    return {}, _bend


def mooney(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = 2 (c1 + c2/l)(l - l^-2), 6 (c1 + c2) = 1."""
    share = rng.uniform(0.1, 0.8)
    return {
        "c2_share": share
    }, lambda e: (1 - share + share / np.maximum(1 + e, 0.02)) * _bend(e)


def gent(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = (l - l^-2)/3 * J/(J - I1 + 3)."""
    limit = float(_first(np.array([em]))[0]) * loguniform(rng, 1.6, 12)
    return {
        "limit": limit
    }, lambda e: _bend(e) * limit / np.maximum(limit - _first(e), 0.05 * limit)


def ogden(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = (2/(3 alpha)) (l^(alpha-1) - l^(-alpha/2-1))."""
    alpha = rng.uniform(1.2, 4.5)

    def curve(e: Array) -> Array:
        stretch = np.maximum(1 + e, 0.02)
        return 2 / (3 * alpha) * (stretch ** (alpha - 1) - stretch ** (-alpha / 2 - 1))

    return {"alpha": alpha}, curve


def fung(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = (exp(b |e|) - 1)/b with the sign of e."""
    b = loguniform(rng, 0.3, 2.5) / em
    return {"b": b}, lambda e: np.sign(e) * np.expm1(b * np.abs(e)) / b


def yeoh(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """sigma = (l - l^-2)/3 * (1 + c2 (I1-3) + c3 (I1-3)^2)."""
    top = float(_first(np.array([em]))[0])
    c2, c3 = rng.uniform(-0.2, 0.1) / top, rng.uniform(0.1, 0.8) / top**2
    return {
        "c2": c2,
        "c3": c3,
    }, lambda e: _bend(e) * (1 + c2 * _first(e) + c3 * _first(e) ** 2)


def arruda_boyce(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """Eight chains, inverse Langevin function by its first five terms."""
    chain = rng.uniform(1.2, 4) * (1 + float(_first(np.array([em]))[0]) / 3)
    c = np.array([1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750])
    c = c * np.arange(1, 6) / chain ** np.arange(5)

    def curve(e: Array) -> Array:
        return _bend(e) * np.polyval(c[::-1], _first(e) + 3) / np.polyval(c[::-1], 3.0)

    return {"chain": chain}, curve


def foam(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """Struts bend, bow to a plateau and touch: (e + k x0 tanh(e/x0) + d e^3)/(1+k)."""
    x0, k = em * rng.uniform(0.3, 0.8), rng.uniform(0.2, 1.5)
    d = rng.uniform(0, 0.6) / em**2
    return {
        "x0": x0,
        "k": k,
        "d": d,
    }, lambda e: (e + k * x0 * np.tanh(e / x0) + d * e**3) / (1 + k)


def linear(rng: Rng, em: float) -> tuple[dict[str, float], Curve]:
    """For the bases that have one straight spring; a family of neither side."""
    return {}, lambda e: e


SKELETONS = (
    Skeleton("neo_hooke", DEVELOPMENT, "Treloar 1943, 10.1039/TF9433900241", neo_hooke),
    Skeleton("gent", DEVELOPMENT, "Gent 1996, 10.5254/1.3538357", gent),
    Skeleton("ogden", DEVELOPMENT, "Ogden 1972, 10.1098/rspa.1972.0026", ogden),
    Skeleton("fung", DEVELOPMENT, "Fung 1967, 10.1152/ajplegacy.1967.213.6.1532", fung),
    Skeleton("mooney", HELD_OUT, "Mooney 1940, 10.1063/1.1712836", mooney),
    Skeleton("yeoh", HELD_OUT, "Yeoh 1993, 10.5254/1.3538343", yeoh),
    Skeleton(
        "arruda_boyce",
        HELD_OUT,
        "Arruda & Boyce 1993, 10.1016/0022-5096(93)90013-6",
        arruda_boyce,
    ),
    Skeleton("foam", HELD_OUT, "after Gibson & Ashby 1997, Cellular Solids", foam),
)


@dataclass(frozen=True)
class Spectrum:
    """Relaxation times (s) and moduli that sum to one, about a time `mid`."""

    name: str
    side: str
    reference: str
    make: Callable[[Rng, float], tuple[Array, Array]]


def few_branches(rng: Rng, mid: float) -> tuple[Array, Array]:
    """Two to six Maxwell branches, anywhere in two decades."""
    n = int(rng.integers(2, 7))
    taus = np.sort(mid * 10 ** rng.uniform(-1, 1, n))
    return taus, rng.dirichlet(np.full(n, 3.0))


def stretched(rng: Rng, mid: float) -> tuple[Array, Array]:
    """Kohlrausch: exp(-(t/mid)^b) as a non-negative sum of exponentials."""
    from scipy.optimize import nnls

    b = rng.uniform(0.45, 0.8)
    t = mid * np.geomspace(1e-3, 30, 150)
    taus = mid * np.geomspace(1e-2, 20, 24)
    weights, _ = nnls(np.exp(-t[:, None] / taus), np.exp(-((t / mid) ** b)))
    keep = weights > 1e-4
    return taus[keep], weights[keep] / weights[keep].sum()


def fractional(rng: Rng, mid: float) -> tuple[Array, Array]:
    """Springpot t^-b between two cut-offs: weights tau^-b on a dense grid."""
    b = rng.uniform(0.1, 0.45)
    taus = mid * np.geomspace(0.03, 30, 37)
    weights = taus**-b
    return taus, weights / weights.sum()


def lognormal(rng: Rng, mid: float) -> tuple[Array, Array]:
    """A bell of relaxation times, 0.4-0.9 decades wide."""
    width = rng.uniform(0.4, 0.9)
    shift = np.linspace(-2.5, 2.5, 31)
    weights = np.exp(-(shift**2) / 2)
    return mid * 10 ** (width * shift), weights / weights.sum()


SPECTRA = (
    Spectrum(
        "few_branches",
        DEVELOPMENT,
        "Wiechert 1893, 10.1002/andp.18932861011",
        few_branches,
    ),
    Spectrum(
        "stretched",
        DEVELOPMENT,
        "Williams & Watts 1970, 10.1039/TF9706600080",
        stretched,
    ),
    Spectrum(
        "fractional",
        HELD_OUT,
        "Schiessel et al. 1995, 10.1088/0305-4470/28/23/012",
        fractional,
    ),
    Spectrum("lognormal", HELD_OUT, "Ferry 1980, Viscoelastic Properties", lognormal),
)


@dataclass(frozen=True)
class Material:
    """Spring `modulus * curve(e)` beside linear branches in engineering strain."""

    skeleton: str
    parameters: dict[str, float]
    modulus: float
    spectrum: str
    taus: Array
    moduli: Array
    curve: Curve = field(repr=False)

    def spring(self, e: Array) -> Array:
        """Stress of the spring, MPa."""
        return self.modulus * self.curve(e)

    def energy(self, e: Array) -> Array:
        """Energy of the spring, MPa."""
        top = max(float(np.abs(e).max()), 1e-9)
        grid = np.linspace(-min(top, 0.95), top, 801)
        stress = self.spring(grid)
        work = np.concatenate(
            [[0.0], np.cumsum((stress[1:] + stress[:-1]) / 2 * np.diff(grid))]
        )
        work -= np.interp(0.0, grid, work)
        return np.maximum(np.interp(e, grid, work), 0.0)  # zero may lie off the grid

    def described(self) -> dict[str, Any]:
        """For the truth file."""
        return {
            "skeleton": self.skeleton,
            "parameters": self.parameters,
            "modulus_MPa": self.modulus,
            "spectrum": self.spectrum,
            "taus_s": self.taus.tolist(),
            "moduli_MPa": self.moduli.tolist(),
        }


def draw_material(
    rng: Rng, side: str, model: str, em: float, mid: float, skeleton: Skeleton | None
) -> Material:
    """A material that the base `model` should be able to represent."""
    modulus = loguniform(rng, 0.005, 50)
    if model.startswith("pl-"):
        if skeleton is None:
            raise ValueError("a material for a bent spring needs a skeleton")
        name = skeleton.name
        parameters, curve = skeleton.make(rng, em)
    else:
        name = "linear"
        parameters, curve = linear(rng, em)
    share = loguniform(rng, 0.15, 1.2)
    if model == "hooke":
        spectrum, taus, parts = "none", np.zeros(0), np.zeros(0)
    elif model.endswith("sls"):
        spectrum = "one branch"
        taus, parts = np.array([mid * loguniform(rng, 0.3, 3)]), np.ones(1)
    else:
        kinds = [s for s in SPECTRA if s.side == side]
        kind = kinds[rng.integers(len(kinds))]
        spectrum = kind.name
        taus, parts = kind.make(rng, mid)
    moduli = modulus * share * parts
    return Material(name, parameters, modulus, spectrum, taus, moduli, curve)
