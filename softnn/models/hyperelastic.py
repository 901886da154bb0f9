r"""Hyperelastic laws as bases, alone and with a Prony series.

A law gives the Kirchhoff stresses :math:`\tau_i = \lambda_i\,\partial W/\partial
\lambda_i` of three principal stretches. The stress of a test follows from them: of
uniaxial tension and compression, incompressible or with a Poisson ratio, and of simple
shear. A Prony series relaxes the deviatoric second Piola-Kirchhoff stress, as
finite-element codes do (Simo 1987, doi:10.1016/0045-7825(87)90107-1):

.. math:: P(t) = \lambda H_1 - \lambda^{-2} H_2, \qquad
          H_k(t) = \int_0^t G(t-s)\, dS_k(s), \qquad
          G(t) = g_\infty + \sum_i g_i e^{-t/\tau_i}

with :math:`S_1 = \tfrac23 P_0/\lambda` along and :math:`S_2 = -\tfrac13 P_0\lambda^2`
across an incompressible strip. A compressible material relaxes as a whole, as codes let
a foam do; its sides stay free of stress then.

Moduli have the names that Abaqus gives them. A base holds them for an initial Young's
modulus of 1 MPa. So its stiffnesses are Young's moduli: the lasting one, and one for
each branch. All branches have the law in common, which makes the stress a product of
the law's ratios and the series. These ratios are therefore nonlinear parameters (named
`shape`), with ranges in which the law is stable (Drucker).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from softnn.contracts import Array, InputError, Parameter, increments
from softnn.models.base import Base

PER_DECADE = 3  # relaxation times; neighbours then differ by a factor of 2.2
THINNEST = 0.05  # smallest stretch: a specimen in compression cannot get flatter
FLATTEST = 0.98  # of the slope at which a Yeoh law ceases to rise
LEFT = 0.01  # of the way to the limit of a Gent law, where its slope ceases to grow
CHAIN = np.array([1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750])  # Arruda, Boyce
POWERS = np.arange(1, 6)
BEYOND = 1.25  # times the largest strains: how far stability is checked
STEPS = 400  # strains at which it is checked
GRID = 2000  # stretches at which the sides of a compressible strip are solved for
PRONY, SHEAR, RATIO = "-prony", "shear", "nu="

Stretches = tuple[Array, Array, Array]
Values = tuple[float, ...]
Mode = Literal["uniaxial", "shear"]


@dataclass(frozen=True)
class Law:
    """A hyperelastic law.

    `moduli` are names and units. `stresses(moduli, stretches)` gives the Kirchhoff
    stresses [MPa], of an incompressible law up to a pressure. `young(moduli)` is the
    initial modulus [MPa]. `shape` are the free parameters. `made` turns them into
    moduli of an initial modulus of 1, and `read` turns these back; `top` is the largest
    I1 - 3 of the recordings. `c` is C of t, the stress along less
    that across, at a stretch l.
    """

    name: str
    moduli: tuple[tuple[str, str], ...]
    stresses: Callable[[Values, Stretches], Stretches]
    young: Callable[[Values], float]
    shape: tuple[Parameter, ...]
    made: Callable[[Values, float], Values]
    read: Callable[[Values, float], Values]
    starts: tuple[Values, ...]
    c: Callable[[Values], str]
    said: str
    foam: bool = False

    def scaled(self, moduli: Values, factor: float) -> Values:
        """Return the moduli with those in MPa times a factor."""
        return tuple(
            float(m * factor) if unit == "MPa" else float(m)
            for m, (_, unit) in zip(moduli, self.moduli, strict=True)
        )

    def unit(self, moduli: Values) -> Values:
        """Return the moduli for an initial Young's modulus of 1 MPa."""
        young = self.young(moduli)
        if not young > 0:
            raise InputError(
                f"the {self.name} law has an initial modulus of {young:.4g} MPa; it "
                "must be above 0"
            )
        return self.scaled(moduli, 1 / young)


# -- laws of invariants ----------------------------------------------------------------

Slopes = Callable[[Values, Array, Array], tuple[Array | float, Array | float]]


def _invariants(slopes: Slopes) -> Callable[[Values, Stretches], Stretches]:
    """Stresses of a law whose slopes by I1 and I2 are given."""

    def stresses(m: Values, stretch: Stretches) -> Stretches:
        a, b, c = (s * s for s in stretch)
        w1, w2 = slopes(m, a + b + c, 1 / a + 1 / b + 1 / c)
        return tuple(2 * (w1 * x - w2 / x) for x in (a, b, c))  # type: ignore[return-value]

    return stresses


def _slopes_in_c(w1: str, w2: str = "0.0") -> str:
    return (
        "    const double i1 = l * l + 2.0 / l, i2 = 2.0 * l + 1.0 / (l * l);\n"
        f"    const double w1 = {w1};\n    const double w2 = {w2};\n"
        "    (void)i1, (void)i2;\n"
        "    t = 2.0 * (w1 * (l * l - 1.0 / l) + w2 * (l - 1.0 / (l * l)));\n"
    )


def _c(x: float) -> str:
    return f"({float(x)!r})"


def _yeoh(m: Values, i1: Array, i2: Array) -> tuple[Array | float, float]:
    x = i1 - 3
    return m[0] + 2 * m[1] * x + 3 * m[2] * x * x, 0.0


# In simple tension a Yeoh law rises at all strains, as its log-log slope does, if
# 1 + 6 c2 x + 15 c3 x^2 > 0, with c2 and c3 over C10 and x = I1 - 3. In compression
# less is asked.
_DIP = FLATTEST * np.sqrt(60.0) / 6


def _yeoh_made(shape: Values, top: float) -> Values:
    rise, bend = shape
    c2 = rise - _DIP * bend
    return 1 / 6, c2 / top / 6, (bend / top) ** 2 / 6


def _yeoh_read(m: Values, top: float) -> Values:
    bend = float(np.sqrt(max(m[2] / m[0], 0.0))) * top
    return m[1] / m[0] * top + _DIP * bend, bend


def _chain(limit: float) -> Array:
    """Coefficients of powers 1 to 5 of I1 in Arruda and Boyce's law, over mu."""
    return CHAIN / limit ** (2 * POWERS - 2)


def _arruda(m: Values, i1: Array, i2: Array) -> tuple[Array, float]:
    terms = m[0] * POWERS * _chain(m[1])
    out = np.full(np.shape(i1), terms[-1])
    for term in terms[-2::-1]:
        out = out * i1 + term
    return out, 0.0


def _arruda_young(m: Values) -> float:
    terms = POWERS * _chain(m[1])
    return float(6 * m[0] * (terms @ 3.0 ** (POWERS - 1)))


def _gent(m: Values, i1: Array, i2: Array) -> tuple[Array, float]:
    # A fit may try strains that the law cannot reach: it keeps its last slope there.
    return m[0] / 2 / np.maximum(1 - (i1 - 3) / m[1], LEFT), 0.0


# -- laws of stretches -----------------------------------------------------------------


def _ogden(m: Values, stretch: Stretches) -> Stretches:
    logs = [np.log(s) for s in stretch]
    terms = list(zip(m[::2], m[1::2], strict=True))
    return tuple(  # type: ignore[return-value]
        sum(2 * mu / a * np.exp(a * x) for mu, a in terms) for x in logs
    )


def _ogden_c(m: Values) -> str:
    terms = zip(m[::2], m[1::2], strict=True)
    lines = (
        f"    t += {_c(2 * mu / a)} * (pow(l, {_c(a)}) - pow(l, {_c(-a / 2)}));\n"
        for mu, a in terms
    )
    return "".join(lines)


def _shares(ratios: Sequence[float]) -> Array:
    """Shares of the first term, of ratio 1, and of the others; their sum is 1."""
    parts = np.array([1.0, *ratios])
    return parts / parts.sum()


def _ogden_made(shape: Values, top: float) -> Values:
    """Exponents and ratios of terms: (a1, r2, a2, r3, a3)."""
    shares = _shares(shape[1::2]) / 3
    pairs = zip(shares, shape[::2], strict=True)
    return tuple(float(x) for pair in pairs for x in pair)


def _ogden_read(m: Values, top: float) -> Values:
    out = [m[1]]
    for mu, a in zip(m[2::2], m[3::2], strict=True):
        out += [mu / m[0], a]
    return tuple(out)


def _foam_beta(nu: float) -> float:
    return nu / (1 - 2 * nu)


def _foam(m: Values, stretch: Stretches) -> Stretches:
    logs = [np.log(s) for s in stretch]
    volume = logs[0] + logs[1] + logs[2]
    terms = list(zip(m[::3], m[1::3], m[2::3], strict=True))
    return tuple(  # type: ignore[return-value]
        sum(
            2 * mu / a * (np.exp(a * x) - np.exp(-a * _foam_beta(nu) * volume))
            for mu, a, nu in terms
        )
        for x in logs
    )


def _foam_young(m: Values) -> float:
    mu = sum(m[::3])
    bulk = sum(
        2 * s * (1 / 3 + _foam_beta(nu)) for s, nu in zip(m[::3], m[2::3], strict=True)
    )
    return 9 * bulk * mu / (3 * bulk + mu)


def _foam_c(m: Values) -> str:
    lines = (
        f"    t += {_c(2 * mu / a)} * (pow(l, {_c(a)}) - pow(l, {_c(-nu * a)}));\n"
        for mu, a, nu in zip(m[::3], m[1::3], m[2::3], strict=True)
    )
    return "".join(lines)


def _foam_made(shape: Values, nu: float) -> Values:
    shares = _shares(shape[1::2]) / (2 * (1 + nu))
    out: list[float] = []
    for mu, a in zip(shares, shape[::2], strict=True):
        out += [float(mu), a, nu]
    return tuple(out)


def _foam_read(m: Values, nu: float) -> Values:
    pairs = zip(m[::3], m[1::3], strict=True)
    return _ogden_read(tuple(x for pair in pairs for x in pair), nu)


# -- the laws --------------------------------------------------------------------------


def _terms(low_high: Sequence[tuple[float, float, float]]) -> tuple[Parameter, ...]:
    """Exponents of terms within ranges, each with its ratio to the first term."""
    out: list[Parameter] = []
    for k, (low, high, usual) in enumerate(low_high, start=1):
        if k > 1:
            out.append(Parameter(f"ratio_{k}", "-", 0.0, 1e4, 0.3))
        out.append(Parameter(f"alpha_{k}", "-", low, high, usual))
    return tuple(out)


def _ogden_law(terms: int, ranges: Sequence, starts: Sequence[Values]) -> Law:
    names = [
        (f"{n}{k}", u)
        for k in range(1, terms + 1)
        for n, u in (("MU", "MPa"), ("ALPHA", "-"))
    ]
    return Law(
        f"ogden{terms}",
        tuple(names),
        _ogden,
        lambda m: 3 * sum(m[::2]),
        _terms(ranges),
        _ogden_made,
        _ogden_read,
        tuple(starts),
        _ogden_c,
        f"Ogden, {terms} term{'s'[: terms > 1]}",
    )


# Terms of Ogden's law rise at all stretches where their exponent is at least 1, or at
# most -2.
_UP, _DOWN, _STEEP = (1.0, 12.0, 1.5), (-12.0, -2.0, -2.0), (4.0, 25.0, 6.0)

LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        Law(
            "neo-hooke",
            (("C10", "MPa"),),
            _invariants(lambda m, i1, i2: (m[0], 0.0)),
            lambda m: 6 * m[0],
            (),
            lambda shape, top: (1 / 6,),
            lambda m, top: (),
            ((),),
            lambda m: _slopes_in_c(_c(m[0])),
            "neo-Hooke",
        ),
        Law(
            "mooney-rivlin",
            (("C10", "MPa"), ("C01", "MPa")),
            _invariants(lambda m, i1, i2: (m[0], m[1])),
            lambda m: 6 * (m[0] + m[1]),
            (Parameter("share", "-", 0.0, 1.0, 0.5, meaning="C01 over C10 + C01"),),
            lambda shape, top: ((1 - shape[0]) / 6, shape[0] / 6),
            lambda m, top: (m[1] / (m[0] + m[1]),),
            ((0.5,),),
            lambda m: _slopes_in_c(_c(m[0]), _c(m[1])),
            "Mooney-Rivlin",
        ),
        Law(
            "yeoh",
            (("C10", "MPa"), ("C20", "MPa"), ("C30", "MPa")),
            _invariants(_yeoh),
            lambda m: 6 * m[0],
            (
                Parameter("rise", "-", 0.0, 1e3, 0.3, meaning="of the slope with I1"),
                Parameter("bend", "-", 0.0, 1e2, 0.3, meaning="root of C30 over C10"),
            ),
            _yeoh_made,
            _yeoh_read,
            ((0.1, 0.0), (0.3, 0.3)),
            lambda m: _slopes_in_c(
                f"{_c(m[0])} + (i1 - 3.0) * ({_c(2 * m[1])} + "
                f"{_c(3 * m[2])} * (i1 - 3.0))"
            ),
            "Yeoh",
        ),
        _ogden_law(1, [(-25.0, 25.0, 2.0)], [(2.0,), (-4.0,), (8.0,)]),
        _ogden_law(2, [_UP, _DOWN], [(1.5, 0.3, -2.0), (6.0, 1.0, -2.0)]),
        _ogden_law(
            3,
            [_UP, _DOWN, _STEEP],
            [(1.5, 0.1, -2.0, 0.01, 6.0), (1.3, 0.5, -4.0, 0.3, 8.0)],
        ),
        Law(
            "arruda-boyce",
            (("MU", "MPa"), ("LAMBDA_M", "-")),
            _invariants(_arruda),
            _arruda_young,
            (Parameter("lambda_m", "-", 1.02, 100.0, 2.0, "log", "locking stretch"),),
            lambda shape, top: (1 / _arruda_young((1.0, shape[0])), shape[0]),
            lambda m, top: (m[1],),
            ((1.5,), (4.0,)),
            lambda m: _slopes_in_c(
                " + i1 * (".join(_c(x) for x in m[0] * POWERS * _chain(m[1])) + "))))"
            ),
            "Arruda-Boyce",
        ),
        Law(
            "gent",
            (("MU", "MPa"), ("J_M", "-")),
            _invariants(_gent),
            lambda m: 3 * m[0],
            (
                Parameter(
                    "limit", "-", 1.02, 1e4, 3.0, "log", "of I1 - 3, over the largest"
                ),
            ),
            lambda shape, top: (1 / 3, shape[0] * top),
            lambda m, top: (m[1] / top,),
            ((1.5,), (10.0,)),
            lambda m: _slopes_in_c(
                f"{_c(m[0] / 2)} / fmax(1.0 - (i1 - 3.0) / {_c(m[1])}, {LEFT!r})"
            ),
            "Gent",
        ),
        Law(
            "hyperfoam",
            tuple(
                (f"{n}{k}", u)
                for k in (1, 2)
                for n, u in (("MU", "MPa"), ("ALPHA", "-"), ("NU", "-"))
            ),
            _foam,
            _foam_young,
            _terms([(1.0, 40.0, 8.0), (-25.0, -0.5, -2.0)]),
            _foam_made,
            _foam_read,
            ((8.0, 0.1, -2.0), (20.0, 0.02, -4.0), (2.0, 0.1, -2.0)),
            _foam_c,
            "hyperfoam (Ogden-Storakers)",
            foam=True,
        ),
    )
}
SAID = {
    f"{law.name}{series}": law.said + also
    for law in LAWS.values()
    for series, also in (("", ""), (PRONY, " with a Prony series"))
}
NAMES = tuple(SAID)


@dataclass(frozen=True)
class Hyper(Base):
    """A hyperelastic law over a range of strain, with relaxation times (branches,) s.

    `moduli` are those of an initial Young's modulus of 1 MPa. `poisson` is 0.5 for an
    incompressible material; the terms of a foam have their own. With a ratio below 0.5
    the modulus of 1 MPa is three times the shear modulus.
    """

    name: str
    law_name: str
    moduli: Values
    strain: tuple[float, float]
    relaxation_times: Values = ()
    mode: Mode = "uniaxial"
    poisson: float = 0.5
    fixed: bool = False  # whether its moduli keep their ratios in a fit

    def __post_init__(self) -> None:
        if any(not t > 0 for t in self.relaxation_times):
            raise InputError("relaxation times must be above 0 s")
        if not -1 < self.poisson <= 0.5:
            raise InputError(
                f"the Poisson ratio is {self.poisson:.6g}; allowed is above -1 to 0.5"
            )
        if len(self.moduli) != len(self.law.moduli):
            names = ", ".join(name for name, _ in self.law.moduli)
            raise InputError(f"a {self.law.name} law has the moduli {names}")
        if self.law.foam and self.mode == SHEAR:
            raise InputError("simple shear of a foam is not available; try another law")

    # -- what it is --------------------------------------------------------------------

    @property
    def law(self) -> Law:
        return LAWS[self.law_name]

    @property
    def segments(self) -> int:
        return 1

    @property
    def reach(self) -> tuple[float, float]:
        return self.strain

    @property
    def corners(self) -> Array:
        low, high = self.strain
        return np.unique(np.append(np.linspace(low, high, 9), 0.0))

    @property
    def has(self) -> frozenset[str]:
        branches = {"relaxation_branch", "finite_strain"}
        series = branches if self.name.endswith(PRONY) else set()
        return frozenset({"nonlinear_elasticity"} | series)

    @property
    def _top(self) -> float:
        """Return I1 - 3 at the largest strain; of a foam its Poisson ratio."""
        if self.law.foam:
            return self.poisson
        a, b, c = self._stretches(np.array([x for x in self.reach if x]))
        return float(np.max(a * a + b * b + c * c - 3))

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        if self.fixed:
            return ()
        values = self.law.read(self.moduli, self._top)
        return tuple(
            replace(p, default=float(np.clip(v, p.low, p.high)))
            for p, v in zip(self.law.shape, values, strict=True)
        )

    def having(self, values: Mapping[str, float]) -> Hyper:
        shape = {p.name: p.default for p in self.nonlinear} | dict(values)
        return self._shaped(tuple(shape.values()))

    def _shaped(self, shape: Values) -> Hyper:
        return replace(self, moduli=self.law.made(shape, self._top))

    def starts(self) -> Sequence[Hyper]:
        return [self, *(self._shaped(one) for one in self.law.starts)]

    def only(self, branches: NDArray[np.integer]) -> Hyper:
        times = np.array(self.relaxation_times)[branches]
        return replace(self, relaxation_times=tuple(times.tolist()))

    def to_dict(self) -> dict[str, Any]:
        names = (name for name, _ in self.law.moduli)
        return {
            "name": self.name,
            "moduli_of_1_MPa": dict(zip(names, self.moduli, strict=True)),
            "strain": list(self.reach),
            "mode": self.mode,
            "poisson": self.poisson,
            "relaxation_times_s": list(self.relaxation_times),
        }

    # -- what it does ------------------------------------------------------------------

    def _stretches(self, strain: Array) -> Stretches:
        """Return the principal stretches, the first along (or turned by) the strain."""
        if self.mode == SHEAR:
            first = strain / 2 + np.sqrt(1 + strain * strain / 4)
            return first, 1 / first, np.ones_like(first)
        first = np.maximum(1 + strain, THINNEST)
        across = self._across(first)
        return first, across, across

    def _across(self, first: Array) -> Array:
        """Return the stretch of the free sides."""
        if self.law.foam and len(set(self.moduli[2::3])) == 1:
            return first ** -self.moduli[2]
        if self.poisson == 0.5 and not self.law.foam:
            return 1 / np.sqrt(first)
        return np.exp(_sides(self.law_name, self.moduli, self.poisson)(np.log(first)))

    def driven(self, strain: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Return what relaxes, and by what it counts in the stress, for E of 1 MPa."""
        a, b, c = self._stretches(strain)
        t1, t2, t3 = _kirchhoff(self.law, self.moduli, self.poisson, (a, b, c))
        if self.mode == SHEAR:
            wide = a * a / (1 + a * a)
            side = (1 - wide) * t1 + wide * t2 - (t1 + t2 + t3) / 3
            along = (t1 - t2) * wide / a - strain * side
            return (along, side), (np.ones_like(a), strain)
        if self.poisson < 0.5 or self.law.foam:  # it relaxes as a whole
            return ((t1 - t2) / a**2,), (a,)
        t = t1 - t2
        return (2 / 3 * t / a**2, -1 / 3 * t * a), (a, -1 / a**2)

    def curve(self, strain: Array) -> Array:
        """Return the nominal stress at any strain, for E of 1 MPa."""
        driven, weights = self.driven(strain)
        return np.sum([x * w for x, w in zip(driven, weights, strict=True)], axis=0)

    def springs(self, strain: Array) -> Array:
        return self.curve(strain)[:, None]

    def undamped(self, strain: Array) -> Array:
        return self.curve(strain)

    def spring_stress(self, strain: Array, stiffness: Array) -> Array:
        return stiffness[0] * self.curve(strain)

    def branches(
        self, decays: tuple[Array, Array], strain: Array, state: Any = None
    ) -> tuple[Array, Any]:
        from softnn.models.unit_kernel import maxwell

        driven, weights = self.driven(strain)
        count = len(self.relaxation_times)
        total, after = np.zeros((len(strain), count)), []
        for x, weight, own in zip(
            driven, weights, state or [None] * len(driven), strict=True
        ):
            before, carried = (0.0, np.zeros(count)) if own is None else own
            out = np.empty_like(total)
            maxwell(*decays, increments(x, before), carried, out)
            after.append((float(x[-1]), out[-1].copy()))
            total += weight[:, None] * out
        return total, after

    def branch_stress(
        self,
        decays: tuple[Array, Array],
        strain: Array,
        stiffness: Array,
        state: tuple[Array, Array] | None = None,
    ) -> tuple[Array, tuple[Array, Array]]:
        from softnn.models.unit_kernel import borne

        driven, weights = self.driven(strain)
        used, sets = np.flatnonzero(stiffness), strain.shape[1]
        decay, gain = (np.ascontiguousarray(d[:, used]) for d in decays)
        last, carried = (
            (np.zeros((sets, 2)), np.zeros((sets, 2, len(used))))
            if state is None
            else (state[0].copy(), state[1].copy())
        )
        total = np.zeros(strain.shape)
        for k, (x, weight) in enumerate(zip(driven, weights, strict=True)):
            out, mine = np.zeros(strain.shape), np.ascontiguousarray(carried[:, k])
            borne(decay, gain, increments(x, last[:, k]), stiffness[used], mine, out)
            last[:, k], carried[:, k] = x[-1], mine
            total += weight * out
        return total, (last, carried)

    def in_c(self, stiffness: Array) -> tuple[str, dict[str, Any]]:
        sided = self.law.foam and len(set(self.moduli[2::3])) > 1
        if self.mode == SHEAR or sided or (self.poisson < 0.5 and not self.law.foam):
            raise InputError(
                f"no C is written for {self.name} in {self.mode} with a Poisson ratio "
                f"of {self.poisson:.4g}; uniaxial and incompressible laws and foams "
                "have one"
            )
        parts = (
            ("t / (l * l)", "0.0")
            if self.law.foam
            else (
                "2.0 / 3.0 * t / (l * l)",
                "-1.0 / 3.0 * t * l",
            )
        )
        return "hyperelastic", {
            "law": self.law.c(self.moduli),
            "lasting": float(stiffness[0]),
            "thinnest": THINNEST,
            "along": parts[0],
            "across": parts[1],
        }

    # -- stability ---------------------------------------------------------------------

    def stable(self, beyond: float = BEYOND) -> tuple[float, float]:
        """Return the range of strain over which the law is stable, see `stable_range`.

        It is searched from zero to `beyond` times the strains it was made for.
        """
        low, high = (beyond * x for x in self.reach)
        return stable_range(self.law, self.moduli, low, high)

    def remarks(self) -> tuple[str, ...]:
        low, high = self.stable()
        asked = max(BEYOND * self.reach[0], THINNEST - 1), BEYOND * self.reach[1]
        only = "" if low <= asked[0] and high >= asked[1] else " only"
        return (
            f"Base {self.name}: stable{only} (Drucker) at strains from {low:.3g} to "
            f"{high:.3g}; recorded: {self.reach[0]:.3g} to {self.reach[1]:.3g}, "
            f"checked: {asked[0]:.3g} to {asked[1]:.3g}.",
        )


def stable_range(
    law: Law, moduli: Values, low: float, high: float
) -> tuple[float, float]:
    """Return the strains, within `low` to `high`, at which a law is stable.

    Stable by Drucker: any small strain adds work, so the difference of the Kirchhoff
    stresses rises with the logarithm of the stretch. It is checked in uniaxial,
    equibiaxial and plane strain; a foam in uniaxial strain with free sides.
    """
    ends = []
    for end in (max(low, THINNEST - 1), high):
        log = np.linspace(0.0, np.log1p(end), STEPS)
        first = np.exp(log)
        if law.foam:
            side = Hyper(law.name, law.name, moduli, (low, high))._across(first)
            modes = [(first, side, side)]
        else:
            one = np.ones_like(first)
            modes = [
                (first, first**-0.5, first**-0.5),
                (first, first, first**-2),
                (first, one, 1 / first),
            ]
        good = np.ones(STEPS - 1, bool)
        for mode in modes:
            t = law.stresses(moduli, mode)
            with np.errstate(divide="ignore", invalid="ignore"):
                slope = np.diff(t[0] - t[2]) / np.diff(log)
            good &= ~(slope <= 0)
        ends.append(end if good.all() else float(np.expm1(log[int(np.argmin(good))])))
    return ends[0], ends[1]


def _kirchhoff(
    law: Law, moduli: Values, poisson: float, stretch: Stretches
) -> Stretches:
    """Return the Kirchhoff stresses, of a compressible law with its pressure."""
    if law.foam or poisson == 0.5:
        return law.stresses(moduli, stretch)
    volume = stretch[0] * stretch[1] * stretch[2]
    own = volume ** (-1 / 3)
    t = law.stresses(moduli, tuple(s * own for s in stretch))  # type: ignore[arg-type]
    mean = (t[0] + t[1] + t[2]) / 3
    # K (J - 1) J: the volume term (J - 1)^2 / D of Abaqus, with K = 2 / D.
    pressure = bulk(law.young(moduli), poisson) * (volume - 1) * volume
    return tuple(x - mean + pressure for x in t)  # type: ignore[return-value]


def bulk(young: float, poisson: float) -> float:
    """Return the initial bulk modulus of a law whose shear modulus is young / 3.

    >>> round(bulk(3.0, 0.25), 3)
    1.667
    """
    return 2 * young / 3 * (1 + poisson) / (3 * (1 - 2 * poisson))


@lru_cache(maxsize=64)
def _sides(law_name: str, moduli: Values, poisson: float) -> CubicSpline:
    """Return the logarithm of the stretch of sides without stress, by that along."""
    law = LAWS[law_name]
    logs = np.log(THINNEST) * np.linspace(1, -1, GRID + 1)  # zero is among them
    first = np.exp(logs)
    low, high = -np.abs(logs) - 1e-9, np.abs(logs) + 1e-9
    for _ in range(60):
        side = (low + high) / 2
        wide = np.exp(side)
        out = _kirchhoff(law, moduli, poisson, (first, wide, wide))[1] > 0
        high, low = np.where(out, side, high), np.where(out, low, side)
    return CubicSpline(logs, (low + high) / 2)


def build(
    name: str,
    strain_low: float,
    strain_high: float,
    interval_s: float,
    duration_s: float,
) -> Hyper:
    """Return the base `name` over a range of strain and of time [s].

    Options follow a colon: `yeoh-prony:shear` is simple shear, `hyperfoam:nu=0.3` has a
    Poisson ratio (default 0 for a foam, else 0.5).

    >>> build("yeoh-prony", 0.0, 0.5, 0.1, 60.0).segments
    1
    >>> build("gent:shear", 0.0, 0.5, 0.1, 60.0).mode
    'shear'
    """
    stem, mode, poisson = parsed(name)
    low, high = min(strain_low, 0.0), max(strain_high, 0.0)
    if not high > low:
        raise InputError("the strain never leaves zero; there is nothing to simulate")
    law = LAWS[stem.removesuffix(PRONY)]
    times: Values = ()
    if stem.endswith(PRONY):
        longest = 3 * max(duration_s, 2 * interval_s)
        count = max(int(np.ceil(PER_DECADE * np.log10(longest / interval_s))), 2)
        times = tuple(float(t) for t in np.geomspace(interval_s, longest, count))
    first = law.made(law.starts[0], poisson if law.foam else 1.0)
    plain = Hyper(stem, law.name, first, (low, high), times, mode, poisson)
    return plain._shaped(law.starts[0])


def parsed(name: str) -> tuple[str, Mode, float]:
    """Return the name without its options, the mode of the test, the Poisson ratio.

    Raises `InputError` for an unknown option.
    """
    stem, *options = name.split(":")
    law = LAWS[stem.removesuffix(PRONY)]
    mode: Mode = "uniaxial"
    poisson = 0.0 if law.foam else 0.5
    for option in options:
        number = option.removeprefix(RATIO)
        if option == SHEAR:
            mode = "shear"
        elif number != option and number.replace(".", "", 1).isdecimal():
            poisson = float(number)
        else:
            raise InputError(
                f"{name!r}: {option!r} is no option of a base; allowed are ':shear' "
                "and ':nu=0.3' (a Poisson ratio)"
            )
    if law.foam and not poisson < 0.5:
        raise InputError(f"{name!r}: the Poisson ratio of a foam is below 0.5")
    return stem, mode, poisson


def from_dict(given: Mapping[str, Any], times: Values) -> Hyper:
    """Return the base that a model.json describes."""
    stem = str(given["name"])
    law = LAWS[stem.removesuffix(PRONY)]
    moduli = {k: float(v) for k, v in given["moduli_of_1_MPa"].items()}
    low, high = (float(x) for x in given["strain"])
    mode = str(given.get("mode", "uniaxial"))
    if mode not in ("uniaxial", SHEAR):
        raise InputError(f"mode is {mode!r}; allowed: uniaxial, shear")
    if (
        set(moduli) != {n for n, _ in law.moduli}
        or not np.isfinite([*moduli.values(), low, high]).all()
    ):
        raise InputError(
            f"moduli are {sorted(moduli)}; a {law.name} law has "
            f"{[n for n, _ in law.moduli]}, each a finite number"
        )
    return Hyper(
        stem,
        law.name,
        tuple(moduli[n] for n, _ in law.moduli),
        (low, high),
        times,
        mode,  # type: ignore[arg-type]
        float(given.get("poisson", 0.5)),
    )
