r"""The Bergström-Boyce model as a base: rubber whose second network flows.

Two eight-chain networks (Arruda and Boyce 1993, doi:10.1016/0022-5096(93)90013-6) with
one locking stretch carry the stress side by side. Network A is elastic. Network B is in
series with a flow that stress drives and viscous stretch hinders (Bergström and Boyce
1998, doi:10.1016/S0022-5096(97)00075-6). In an incompressible uniaxial test

.. math:: P = \frac{E_A\, t(\lambda) + E_B\, t(\lambda/\lambda_v)}{\lambda}, \qquad
          \frac{d \ln \lambda_v}{dt} = \frac{r}{\tau}
          \left(\frac{\bar\lambda_v - 1 + \xi}{r}\right)^{C}
          \left(\frac{|\sigma_B|}{r E_B}\right)^{m} \operatorname{sign} \sigma_B,
          \qquad \bar\lambda_v = \sqrt{\frac{\lambda_v^2 + 2/\lambda_v}{3}}

t is the Kirchhoff stress of the law for an initial Young's modulus of 1 MPa, and
:math:`\sigma_B = E_B\,t` the true stress of network B. A relaxation time tau stands for
the paper's rate constant. At small strain, with m = 1 and C = 0, network B is a Maxwell
branch of that time; else it has that time where :math:`\sigma_B/E_B` and the viscous
chain strain are r = 0.1. The flow depends on stress over modulus, so the stresses of
both networks are linear in their moduli.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError, Parameter, increments
from softnn.models.base import Base
from softnn.models.hyperelastic import CHAIN, LAWS, POWERS, THINNEST, Hyper

NAME = "bergstrom-boyce"
SAID = "Bergström-Boyce: two eight-chain networks, one of which flows"
LAW = LAWS["arruda-boyce"]
XI = 0.01  # keeps the flow finite at rest; the usual value
REFERENCE = 0.1  # r
ACCURACY = 2e-7  # of the largest logarithmic strain: error of a step of the flow
PARAMETERS = (
    Parameter("relaxation_time", "s", 1e-12, 1e12, 1.0, "log", "tau"),
    Parameter("stress_exponent", "-", 1.0, 20.0, 4.0, "log", "m"),
    Parameter("strain_exponent", "-", -1.0, 0.0, -0.5, meaning="C"),
    Parameter("locking_stretch", "-", 1.02, 100.0, 3.0, "log", "lambda_L"),
)


@dataclass(frozen=True)
class BergstromBoyce(Base):
    """Networks A and B; their stiffnesses are initial Young's moduli in MPa.

    `relaxation_times` holds tau in s, of network B where there is one. `strain` is the
    lowest and the highest strain that it was made for.

    >>> base = BergstromBoyce((2.0,), 1.0, 0.0, 3.0, (0.0, 0.01))
    >>> from softnn.contracts import Chunk
    >>> hold = Chunk(np.array([0.0, 2.0]), np.array([1e-4, 1e-4]))
    >>> (1e4 * base.respond(hold)[1]).round(3).ravel().tolist()
    [1.0, 0.368]
    """

    relaxation_times: tuple[float, ...]
    stress_exponent: float
    strain_exponent: float
    locking_stretch: float
    strain: tuple[float, float]
    name: str = NAME
    fixed: bool = False  # whether its nonlinear parameters stay in a fit

    def __post_init__(self) -> None:
        time, *others = PARAMETERS
        time.check(self.relaxation_times or time.default)
        for p in others:
            p.check(getattr(self, p.name))

    # -- what it is --------------------------------------------------------------------

    @cached_property
    def elastic(self) -> Hyper:
        """The law of either network for a modulus of 1 MPa."""
        moduli = LAW.made((self.locking_stretch,), 1.0)
        return Hyper(LAW.name, LAW.name, moduli, self.strain)

    @property
    def segments(self) -> int:
        return 1

    @property
    def reach(self) -> tuple[float, float]:
        return self.strain

    @property
    def corners(self) -> Array:
        return self.elastic.corners

    @property
    def has(self) -> frozenset[str]:
        return frozenset(
            {"nonlinear_elasticity", "finite_strain", "nonlinear_viscosity"}
        )

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        if self.fixed:
            return ()
        time, *others = PARAMETERS
        return (
            *(replace(time, default=t) for t in self.relaxation_times),
            *(replace(p, default=getattr(self, p.name)) for p in others),
        )

    def having(self, values: Mapping[str, float]) -> BergstromBoyce:
        new: dict[str, Any] = dict(values)
        if "relaxation_time" in new:
            new["relaxation_times"] = (new.pop("relaxation_time"),)
        return replace(self, **new)

    def starts(self) -> Sequence[BergstromBoyce]:
        pairs = ((2.0, 1.5), (6.0, 4.0))
        names = "stress_exponent", "locking_stretch"
        more = (self.having(dict(zip(names, pair, strict=True))) for pair in pairs)
        return [self, *more]

    def only(self, branches: NDArray[np.integer]) -> BergstromBoyce:
        times = np.array(self.relaxation_times)[branches]
        return replace(self, relaxation_times=tuple(times.tolist()))

    def to_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "relaxation_times_s": list(self.relaxation_times),
            **{p.name: getattr(self, p.name) for p in PARAMETERS[1:]},
            "strain": list(self.strain),
        }

    # -- what it does ------------------------------------------------------------------

    def springs(self, strain: Array) -> Array:
        return self.elastic.springs(strain)

    def undamped(self, strain: Array) -> Array:
        return self.elastic.undamped(strain)

    def spring_stress(self, strain: Array, stiffness: Array) -> Array:
        return self.elastic.spring_stress(strain, stiffness)

    def decays(self, time_s: Array, before_s: float | None) -> tuple[Array, Array]:
        """Return the steps over the relaxation time (n, branches), twice.

        A flow that is not linear has no decay and gain of its own.
        """
        first = time_s[0] if before_s is None else before_s
        steps = increments(time_s, first)[:, None] / np.array(self.relaxation_times)
        return steps, steps

    def branches(
        self, decays: tuple[Array, Array], strain: Array, state: Any = None
    ) -> tuple[Array, Any]:
        one = np.ones(len(self.relaxation_times))
        return self.branch_stress(decays, strain[:, None], one, state)

    def branch_stress(
        self,
        decays: tuple[Array, Array],
        strain: Array,
        stiffness: Array,
        state: tuple[Array, Array] | None = None,
    ) -> tuple[Array, tuple[Array, Array]]:
        """Return stress (n, sets) of network B for strains (n, sets), and the state.

        The state is the last stretch and the logarithmic viscous strain, (sets,) each.
        """
        from softnn.models.flow_kernel import network

        stretch = np.maximum(1 + strain, THINNEST)
        sets = stretch.shape[1]
        last, viscous = (np.ones(sets), np.zeros(sets)) if state is None else state
        last, viscous = last.copy(), viscous.copy()
        out = np.zeros(stretch.shape)
        for steps, modulus in zip(decays[0].T, stiffness, strict=True):
            network(self._terms, *self._flow, steps, stretch, last, viscous, out)
            out *= modulus
        return out, (last, viscous)

    @cached_property
    def _terms(self) -> Array:
        """dW/dI1 by powers of I1, for a modulus of 1 MPa."""
        mu, limit = self.elastic.moduli
        return mu * POWERS * CHAIN / limit ** (2.0 * POWERS - 2)

    @property
    def _flow(self) -> tuple[tuple[float, float, float, float], float]:
        """Numbers of the flow, and the error that a step of it may have."""
        largest = np.abs(np.log(np.maximum(1 + np.array(self.strain), THINNEST))).max()
        law = self.stress_exponent, self.strain_exponent, XI, REFERENCE
        return law, ACCURACY * float(largest)

    # -- how it is written elsewhere ---------------------------------------------------

    def in_c(self, stiffness: Array) -> tuple[str, dict[str, Any]]:
        raise InputError(
            f"no C is written for the base {self.name}; diagnose with --model "
            "pl-wiechert for C, or write a card --to abaqus"
        )

    def creep_parameter(self, young: float) -> float:
        """Return A of Abaqus, in 1/s and the unit of `young`, the modulus of network B.

        The creep rate there is A (chain strain + xi)^C stress^m, where chain strain has
        no unit; the stress is Mises's, which in a uniaxial test is that along.
        """
        m, c = self.stress_exponent, self.strain_exponent
        with np.errstate(over="ignore"):
            one = REFERENCE ** (1 - c - m) * np.power(young, -m)
        return float(one / self.relaxation_times[0])


def of_creep(
    creep_parameter: float,
    young: float,
    exponents: tuple[float, float],
    locking_stretch: float,
    strain: tuple[float, float],
) -> BergstromBoyce:
    """Return the base of Abaqus's creep parameter A and its exponents m and C.

    `young` is the modulus of network B, in the unit of stress of A; both are above 0.
    Raises `InputError` for parameters out of range.
    """
    plain = BergstromBoyce((1.0,), *exponents, locking_stretch, strain)
    time = plain.creep_parameter(young) / creep_parameter
    return plain.having({"relaxation_time": time})


def build(
    strain_low: float, strain_high: float, interval_s: float, duration_s: float
) -> BergstromBoyce:
    """Return the base over a range of strain and of time [s], from which fits start.

    >>> build(0.0, 0.5, 0.1, 60.0).columns
    2
    """
    low, high = min(strain_low, 0.0), max(strain_high, 0.0)
    if not high > low:
        raise InputError("the strain never leaves zero; there is nothing to simulate")
    time = float(np.sqrt(interval_s * max(duration_s, interval_s)))
    _, m, c, limit = (p.default for p in PARAMETERS)
    return BergstromBoyce((time,), m, c, limit, (low, high))


def from_dict(given: Mapping[str, Any], times: tuple[float, ...]) -> BergstromBoyce:
    """Return the base that a model.json describes. Raises `InputError`."""
    if len(times) != 1:
        raise InputError(f"{len(times)} relaxation times; a {NAME} base has one")
    m, c, limit = (float(given[p.name]) for p in PARAMETERS[1:])
    low, high = (float(x) for x in given["strain"])
    if not np.isfinite([low, high]).all():
        raise InputError(f"strain is {low} to {high}; both are finite numbers")
    return BergstromBoyce(times, m, c, limit, (low, high))
