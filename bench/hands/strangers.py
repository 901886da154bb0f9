"""Things that happen and are on no list of effects."""

from __future__ import annotations

import numpy as np

from bench.hands import kernels
from bench.hands.families import (
    DEVELOPMENT,
    HELD_OUT,
    Array,
    Rng,
    farthest,
    loguniform,
    some,
)
from bench.hands.testing import Act, Law, Run, Setup


def _since(run: Run) -> Array:
    """Time since the beginning of each recording."""
    starts = np.unique(run.owner, return_index=True)[1]
    counts = np.diff([*starts, len(run.owner)])
    return run.time_s - np.repeat(run.time_s[starts], counts)


def thermal_expansion(rng: Rng, s: Setup) -> Act:
    """The clamped specimen grows with warmth: strain less a dT."""
    swing = max(s.swing_C, 1.0)

    def strain(run: Run, e: Array, a: float) -> Array:
        return e - a * s.em * run.warmer / swing

    return Act(0.3, strain=strain)


def partial_tear(rng: Rng, s: Setup) -> Act:
    """Ligaments part at a strain of some recordings, for good."""
    torn, at = some(rng, s.n, 0.2, 0.6), rng.uniform(0.5, 0.9)
    width = rng.uniform(0.005, 0.05)

    def whole(run: Run, x: Array, a: float) -> Array:
        far = farthest(run.strain) / s.em
        share = 1 / (1 + np.exp(-np.clip((far - at) / width, -40, 40)))
        return np.where(np.isin(run.owner, torn), x * (1 - a * share), x)

    return Act(0.8, {"recordings": torn, "at": at}, whole=whole)


def post_cure(rng: Rng, s: Setup) -> Act:
    """Cross-links go on forming, in the strained state too."""
    tau = s.pace_s * loguniform(rng, 3, 30)

    def spring(run: Run, x: Array, a: float) -> Array:
        late = -np.expm1(-run.time_s / tau)
        return x + a * np.cumsum(np.diff(x, prepend=0.0) * late)

    return Act(4.0, {"tau_s": tau}, spring=spring)


def thixotropy(rng: Rng, s: Setup) -> Act:
    """Structure breaks with the rate of strain and is rebuilt at rest."""
    rebuild, breaking = s.pace_s * loguniform(rng, 0.5, 5), rng.uniform(0.5, 3)

    def whole(run: Run, x: Array, a: float) -> Array:
        travel = np.abs(np.diff(run.strain, prepend=0.0)) / s.em * breaking
        heal = run.clock / rebuild
        return x * (1 - a + a * kernels.structure(travel, heal))

    return Act(0.9, {"rebuild_s": rebuild, "breaking": breaking}, whole=whole)


def crystallisation(rng: Rng, s: Setup) -> Act:
    """Crystals form beyond a strain, slowly, and melt later on the way back."""
    onset, tau = rng.uniform(0.4, 0.7), s.pace_s * rng.uniform(0.05, 0.5)
    lag = rng.uniform(1.5, 5)

    def extra(run: Run, e: Array, x: Array, a: float) -> Array:
        want = np.maximum(np.abs(e) / s.em - onset, 0) / (1 - onset)
        share = kernels.follow(want, run.clock, tau, tau * lag)
        return a * s.peak * np.sign(e) * share * np.abs(e) / s.em

    return Act(1.0, {"onset": onset, "tau_s": tau}, extra=extra)


def humidity(rng: Rng, s: Setup) -> Act:
    """Swelling as moisture diffuses in: a root of time, then its plateau."""
    tau = s.pace_s * loguniform(rng, 2, 30)

    def strain(run: Run, e: Array, a: float) -> Array:
        return e - a * s.em * np.tanh(np.sqrt(_since(run) / tau))

    return Act(0.3, {"tau_s": tau}, strain=strain)


def creep_rupture(rng: Rng, s: Setup) -> Act:
    """Kachanov's damage: dD/dt ~ (|stress|/(1 - D))^n, speeding up to the end."""
    n = rng.uniform(2, 6)

    def whole(run: Run, x: Array, a: float) -> Array:
        dose = np.cumsum((np.abs(x) / s.peak) ** n * run.clock)
        total = dose[-1] if s.continued else s.pace_s * 8
        left = np.maximum(1 - a * np.minimum(dose / total, 1), 0.02)
        return x * left ** (1 / (n + 1))

    return Act(0.97, {"n": n}, whole=whole)


def one_way_flow(rng: Rng, s: Setup) -> Act:
    """Pores: fluid is pressed out against drag and drawn in freely."""
    tau = s.pace_s * rng.uniform(0.1, 1.0)

    def extra(run: Run, e: Array, x: Array, a: float) -> Array:
        pressed = np.diff(np.abs(e), prepend=0.0)
        pressed = np.where(pressed > 0, pressed, 0.1 * pressed)
        drag = kernels.responses(pressed, run.clock, np.array([tau]))[:, 0]
        return a * s.peak / s.em * np.sign(e) * drag

    return Act(1.5, {"tau_s": tau}, extra=extra)


def ageing_contacts(rng: Rng, s: Setup) -> Act:
    """Stiction that grows with the logarithm of the time at rest, then breaks away."""
    slide, short = s.em * rng.uniform(0.02, 0.08), rng.uniform(0.1, 1.0)

    def extra(run: Run, e: Array, x: Array, a: float) -> Array:
        steps = np.diff(e, prepend=0.0)
        speed = np.abs(steps) / np.maximum(run.clock, 1e-9)
        still = speed < 0.02 * s.em / s.pace_s
        out = kernels.stiction(steps / slide, still, run.clock / short)
        return a * s.peak * out

    return Act(0.5, {"slide": slide, "short_s": short}, extra=extra)


def buckled_partly(rng: Rng, s: Setup) -> Act:
    """Beyond a load the specimen bows out, and snaps back at a lower one."""
    up = rng.uniform(0.45, 0.75)
    down = up * rng.uniform(0.5, 0.9)

    def whole(run: Run, x: Array, a: float) -> Array:
        out = kernels.latch(np.abs(x) / s.peak, up, down)
        return x * (1 - a * kernels.follow(out, run.clock, 0.2, 0.2))

    return Act(0.5, {"up": up, "down": down}, whole=whole)


_A = "alien"
STRANGERS = (
    Law(
        _A,
        "thermal_expansion",
        DEVELOPMENT,
        "Anthony, Caston & Guth 1942, 10.1021/j150423a005",
        thermal_expansion,
    ),
    Law(_A, "partial_tear", DEVELOPMENT, "ISO 34-1, tearing", partial_tear),
    Law(
        _A,
        "post_cure",
        HELD_OUT,
        "Tobolsky 1960, Properties and Structure of Polymers",
        post_cure,
    ),
    Law(
        _A,
        "thixotropy",
        HELD_OUT,
        "Barnes 1997, 10.1016/S0377-0257(97)00004-9",
        thixotropy,
    ),
    Law(
        _A,
        "crystallisation",
        DEVELOPMENT,
        "Flory 1947, 10.1063/1.1746537",
        crystallisation,
    ),
    Law(_A, "humidity", HELD_OUT, "Crank 1975, The Mathematics of Diffusion", humidity),
    Law(
        _A, "creep_rupture", DEVELOPMENT, "Kachanov 1958; Rabotnov 1969", creep_rupture
    ),
    Law(
        _A,
        "one_way_flow",
        DEVELOPMENT,
        "after Mow et al. 1980, 10.1115/1.3138202",
        one_way_flow,
    ),
    Law(
        _A,
        "ageing_contacts",
        HELD_OUT,
        "Dieterich 1972, 10.1029/JB077i020p03690",
        ageing_contacts,
    ),
    Law(_A, "buckled_partly", HELD_OUT, "Timoshenko & Gere 1961", buckled_partly),
)
