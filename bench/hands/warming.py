"""Heat softens, and a strip buckles."""

from __future__ import annotations

import numpy as np

from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng
from bench.hands.testing import Act, Law, Run, Setup


def linear_heat(rng: Rng, s: Setup) -> Act:
    """1 - a dT over the largest dT."""
    swing = max(s.swing_C, 1.0)

    def whole(run: Run, x: Array, a: float) -> Array:
        return x * (1 - a * run.warmer / swing)

    return Act(0.6, {"per_C_at_a_of_1": 1 / swing}, "whole", whole=whole)


def arrhenius_stiffness(rng: Rng, s: Setup) -> Act:
    """exp(a (T0/T - 1)) of the stiffness, scaled to the swing."""
    kelvin = s.rest_C + 273.15
    scale = kelvin / max(s.swing_C, 1.0)

    def whole(run: Run, x: Array, a: float) -> Array:
        return x * np.exp(a * scale * (kelvin / (kelvin + run.warmer) - 1))

    return Act(0.6, {"T0_K": kelvin}, "whole", whole=whole)


def wlf(rng: Rng, s: Setup) -> Act:
    """log10 aT = -a dT/(C2 + dT): branches relax at a reduced time."""
    c2 = rng.uniform(50, 110)

    def tempo(run: Run, e: Array, a: float) -> Array:
        return 10 ** (a * run.warmer / (c2 + run.warmer))

    return Act(20.0, {"C2": c2}, "branch times", tempo=tempo)


def arrhenius_times(rng: Rng, s: Setup) -> Act:
    """ln aT = (H/R)(1/T - 1/T0), a = H/(R T0)."""
    kelvin = s.rest_C + 273.15

    def tempo(run: Run, e: Array, a: float) -> Array:
        return np.exp(a * (1 - kelvin / (kelvin + run.warmer)))

    return Act(150.0, {"T0_K": kelvin}, "branch times", tempo=tempo)


def _slack_strip(form) -> Act:
    """Less than half of the compressive stress is no longer a buckled strip."""
    return Act(1.0, {}, "whole", whole=form, least=0.5)


def no_compression(rng: Rng, s: Setup) -> Act:
    """A membrane carries nothing in compression; a is the share lost."""
    return _slack_strip(lambda run, x, a: np.where(x < 0, (1 - a) * x, x))


def wrinkled(rng: Rng, s: Setup) -> Act:
    """Wrinkling sets in gradually about zero: a logarithm of a sum."""
    width = s.peak * rng.uniform(0.005, 0.03)

    def form(run: Run, x: Array, a: float) -> Array:
        lifted = width * (np.logaddexp(0, x / width) - np.log(2))
        return (1 - a) * x + a * lifted

    return _slack_strip(form)


def euler_strip(rng: Rng, s: Setup) -> Act:
    """Beyond its critical stress a strip bows: the rest is multiplied by 1 - a."""
    critical = s.peak * rng.uniform(0.01, 0.06)
    return _slack_strip(
        lambda run, x, a: np.where(
            x < -critical, -critical + (1 - a) * (x + critical), x
        )
    )


def buckled_by_strain(rng: Rng, s: Setup) -> Act:
    """While compressed, x/(1 + a (4 + k |shortening|)): it bows more and more."""
    k = rng.uniform(20, 80)

    def form(run: Run, x: Array, a: float) -> Array:
        short = np.maximum(-run.strain, 0) / s.em
        return np.where(x < 0, x / (1 + a * (4 + k * short)), x)

    return _slack_strip(form)


_T, _O = "thermal_softening", "tension_only"
LAWS = (
    Law(_T, "linear", DEVELOPMENT, "first-order expansion", linear_heat),
    Law(
        _T,
        "arrhenius_stiffness",
        HELD_OUT,
        "Arrhenius 1889, 10.1515/zpch-1889-0416",
        arrhenius_stiffness,
    ),
    Law(
        _T,
        "wlf",
        DEVELOPMENT,
        "Williams, Landel & Ferry 1955, 10.1021/ja01619a008",
        wlf,
    ),
    Law(
        _T,
        "arrhenius_times",
        HELD_OUT,
        "Arrhenius 1889, 10.1515/zpch-1889-0416",
        arrhenius_times,
    ),
    Law(
        _O,
        "no_compression",
        DEVELOPMENT,
        "Pipkin 1986, 10.1093/imamat/36.1.85",
        no_compression,
    ),
    Law(
        _O,
        "wrinkled",
        HELD_OUT,
        "after Roddeman et al. 1987, 10.1115/1.3173044",
        wrinkled,
    ),
    Law(_O, "euler_strip", HELD_OUT, "Euler 1744; Timoshenko & Gere 1961", euler_strip),
    Law(
        _O,
        "fading",
        DEVELOPMENT,
        "after Timoshenko & Gere 1961, large bowing",
        buckled_by_strain,
    ),
)
