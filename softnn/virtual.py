r"""Virtual specimens of the seven published materials, as a testing machine writes them.

The recordings behind the published tables were never released. These stand in for
them: a physical generator whose parameters (`data/virtual/NAME.toml`, written by
`python -m studies.virtual_specimens --calibrate`) bring it as close to Tables 4.2 and
4.4 as one material with scattering specimens can come. How far each published property
is missed is in `studies/results/virtual_specimens.json`. A number obtained on virtual
specimens is never a reproduction of a measurement.

A specimen under the strain :math:`\varepsilon(t)` carries

.. math::
    \sigma = f \Big[ a (1 - e^{-\varepsilon/\varepsilon_k})
        + p \big( E \varepsilon + C \langle\varepsilon/x - \varepsilon_c\rangle^3 \big)
        + \sum_j k_j q_j \Big], \qquad
    \dot q_j = h'(\varepsilon)\,\dot\varepsilon - q_j / \tau_j ,

an equilibrium curve with a knee, a plateau slope and an upturn (crystallisation), and
branches whose strain measure :math:`h' = s + (1-s) e^{-\varepsilon/\varepsilon_h}`
saturates, as a network's transient part does. f, p and x scatter from specimen to
specimen. It shares no code with `softnn.models`, which are tested against it.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtri

from softnn.contracts import Array, InputError
from softnn.materials import Material, data_path, material
from softnn.recording import Geometry, Recording

VERSION = 1  # of the generator; part of the name of every cached file

RAMP_SPEED = 500  # mm/min, to the hold of a relaxation test (thesis section 4.3.2)
# A 50 kN load cell read at a few newtons (thesis section 4.3): rms noise, resolution
# and error of the zero after balancing, N. Inferred, not published.
NOISE_N, RESOLUTION_N, ZERO_N = 0.05, 0.01, 0.03
RESOLUTION_MM = 1e-4  # of the crosshead's encoder
SLACK_MM = (0.3, 1.2)  # take-up slack of a tensile specimen, range
SEATING_MM = 0.08  # width of the toe in which the grips seat
AFTER_FAILURE = 8  # samples a specimen, on average, before the machine stops
# Sampling of a relaxation test: from this time after the ramp, this interval, s.
HOLD_SAMPLING = ((0.0, 0.1), (60.0, 1.0), (900.0, 5.0))
RAMP_INTERVAL = 0.01


@dataclass(frozen=True)
class Calibration:
    """Parameters of one material; MPa, strain and s. See the module's equation.

    `stiffness` and `extensibility` are the mean f and x of the specimens pulled at a
    speed (mm/min): each speed was measured on other specimens.
    """

    knee_stress: float
    knee_strain: float
    modulus: float
    upturn: float
    upturn_strain: float
    branch_moduli: tuple[float, ...]
    branch_times: tuple[float, ...]
    branch_share: float
    branch_strain: float
    scatter: float
    extensibility_scatter: float
    relaxation_slack_mm: float
    stiffness: Mapping[int, float]
    extensibility: Mapping[int, float]


@dataclass(frozen=True)
class Specimens:
    """Scatter factors, ultimate strain and slack of n specimens, each (n,)."""

    stiffness: Array
    plateau: Array
    extensibility: Array
    ultimate_strain: Array
    slack_mm: Array
    thickness_mm: Array


def tensile(name: str, seed: int = 0) -> list[Recording]:
    """Tensile tests to failure of the material `name`, raw, at its published speeds.

    Specimens as many as in Table 4.1; samples, slack and failure included, as many in
    all as in Table 6.2. `strain` and `stress_MPa` are plain conversions of
    `elongation_mm` and `force_N`.

    >>> recordings = tensile("NatPolR")
    >>> len(recordings), sum(len(r) for r in recordings)
    (17, 7229)
    >>> recordings[2].name, recordings[2].test, round(recordings[2].rate_per_s, 4)
    ('NatPolR-50-03', 'tensile', 0.0253)
    """
    return _cached(name, "tensile", seed)


def relaxation(name: str, seed: int = 0) -> list[Recording]:
    """Stress relaxation tests of the material `name`, raw: ramp and hold of Table 4.3.

    >>> [round(r.time_s[-1]) for r in relaxation("NatR")]
    [905, 905]
    """
    return _cached(name, "relaxation", seed)


@cache
def calibration(name: str) -> Calibration:
    """The stored calibration of one material."""
    path = data_path() / "virtual" / f"{material(name).name}.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    for key in ("stiffness", "extensibility"):
        content[key] = {int(speed): value for speed, value in content[key].items()}
    for key in ("branch_moduli", "branch_times"):
        content[key] = tuple(content[key])
    return Calibration(**{k: content[k] for k in Calibration.__dataclass_fields__})


def stress(c: Calibration, strain: Array, interval: float, **factors: float) -> Array:
    """Stress [MPa] (n,) of one specimen for `strain` (n,) sampled every `interval` s.

    Exact for a branch measure that is linear between samples. `factors`: stiffness,
    plateau, extensibility, each 1 by default.
    """
    branches = sum(
        k * _branch(c, strain, interval, time)
        for k, time in zip(c.branch_moduli, c.branch_times, strict=True)
    )
    return factors.get("stiffness", 1.0) * (_equilibrium(c, strain, factors) + branches)


def _equilibrium(c: Calibration, strain: Array, factors: Mapping[str, float]) -> Array:
    reduced = strain / factors.get("extensibility", 1.0) - c.upturn_strain
    plateau = c.modulus * strain + c.upturn * np.maximum(reduced, 0) ** 3
    knee = -c.knee_stress * np.expm1(-strain / c.knee_strain)
    return knee + factors.get("plateau", 1.0) * plateau


def _branch(c: Calibration, strain: Array, interval: float, time: float) -> Array:
    """Internal strain q of the branch with relaxation time `time`."""
    soft = -c.branch_strain * np.expm1(-strain / c.branch_strain)
    measure = c.branch_share * strain + (1 - c.branch_share) * soft
    gain = -time / interval * np.expm1(-interval / time)
    step = np.diff(measure, prepend=0.0)
    return lfilter([gain], [1, -np.exp(-interval / time)], step)


def _tensile(m: Material, c: Calibration, rng: np.random.Generator) -> list[Recording]:
    recordings = []
    for speed in m.speeds:
        s = _specimens(m, c, m.specimens[speed], speed, rng)
        velocity = speed / 60
        duration = (s.ultimate_strain * m.length_mm + s.slack_mm) / velocity
        interval, loaded, after = _sampling(duration, m.samples[speed])
        for i in range(len(duration)):
            time = interval * np.arange(loaded[i] + after[i])
            elongation = velocity * time
            strain = _seated(elongation, s.slack_mm[i]) / m.length_mm
            force = stress(c, strain, interval, **_factors(s, i)) * _area(m, s, i)
            # The halves spring back: within a sample or two the load is gone.
            force[loaded[i] :] = force[loaded[i] - 1] * 0.02 ** np.arange(1, 1 + after[i])
            about = f"{m.name}-{speed}-{i + 1:02d}", "tensile", m.rate_per_s(speed)
            recordings.append(_record(m, s, i, time, elongation, force, about, rng))
    return recordings


def _relaxation(
    m: Material, c: Calibration, rng: np.random.Generator
) -> list[Recording]:
    recordings = []
    for number, test in m.relaxation.items():
        s = _specimens(m, c, int(test["recordings"]), RAMP_SPEED, rng, pulled=False)
        for i in range(len(s.stiffness)):
            time, elongation, force = _hold(m, c, s, i, test)
            name = f"{m.name}-relaxation-{number}-{i + 1:02d}"
            about = name, "relaxation", m.rate_per_s(RAMP_SPEED)
            recordings.append(_record(m, s, i, time, elongation, force, about, rng))
    return recordings


def _hold(
    m: Material, c: Calibration, s: Specimens, i: int, test: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """Time, elongation and force of a ramp to the test's elongation, then held."""
    velocity, end = RAMP_SPEED / 60, 60 * test["duration"]
    steps = int(np.ceil(test["elongation"] / velocity / RAMP_INTERVAL))
    interval = test["elongation"] / velocity / steps
    ramp = interval * np.arange(steps + 1)
    strain = _seated(velocity * ramp, s.slack_mm[i]) / m.length_mm
    factors = _factors(s, i)
    starts = [*HOLD_SAMPLING[1:], (np.inf, 0.0)]
    held = np.concatenate(
        [
            np.arange(start, min(stop, end), every)
            for (start, every), (stop, _) in zip(HOLD_SAMPLING, starts, strict=True)
            if start < end
        ]
    )
    held = np.append(held[1:], end)
    # Held strain: equilibrium stays, every branch decays from where the ramp left it.
    decayed = sum(
        k * _branch(c, strain, interval, tau)[-1] * np.exp(-held / tau)
        for k, tau in zip(c.branch_moduli, c.branch_times, strict=True)
    )
    kept = _equilibrium(c, strain[-1:], factors)
    held_stress = factors["stiffness"] * (kept + decayed)
    ramp_stress = stress(c, strain, interval, **factors)
    force = np.concatenate([ramp_stress, held_stress]) * _area(m, s, i)
    elongation = np.append(velocity * ramp, np.full(len(held), test["elongation"]))
    return np.append(ramp, ramp[-1] + held), elongation, force


def _record(
    m: Material,
    s: Specimens,
    i: int,
    time: Array,
    elongation: Array,
    force: Array,
    about: tuple[str, str, float],
    rng: np.random.Generator,
) -> Recording:
    """The recording a machine makes: noise, an imperfect zero, finite resolution."""
    name, test, rate = about
    noisy = force + rng.normal(0, NOISE_N, len(force)) + rng.normal(0, ZERO_N)
    force = RESOLUTION_N * np.round(noisy / RESOLUTION_N)
    elongation = RESOLUTION_MM * np.round(elongation / RESOLUTION_MM)
    return _recording(m, time, elongation, force, name, test, rate, s.thickness_mm[i])


def _recording(
    m: Material,
    time: Array,
    elongation: Array,
    force: Array,
    name: str,
    test: str,
    rate: float,
    thickness: float,
) -> Recording:
    return Recording(
        time_s=time,
        strain=elongation / m.length_mm,
        stress_MPa=force / (m.width_mm * thickness),
        force_N=force,
        elongation_mm=elongation,
        name=name,
        specimen=name,
        material=m.name,
        test=test,
        rate_per_s=rate,
        geometry=Geometry(
            length_mm=m.length_mm, width_mm=m.width_mm, thickness_mm=float(thickness)
        ),
        source=f"virtual specimen, generator {VERSION}: not a measurement",
    )


def _specimens(
    m: Material,
    c: Calibration,
    number: int,
    speed: int,
    rng: np.random.Generator,
    pulled: bool = True,
) -> Specimens:
    """Draw `number` specimens; their mean factors are the calibrated ones of `speed`."""
    common, plateau, bands = (_normal_scores(number, rng) for _ in range(3))
    extensible = c.extensibility.get(speed, 1.0) if pulled else 1.0
    stiffness = c.stiffness.get(speed, 1.0) if pulled else 1.0
    slack = (
        rng.uniform(*SLACK_MM, number)
        if pulled
        else c.relaxation_slack_mm * (1 + 0.2 * _normal_scores(number, rng))
    )
    ultimate = np.full(number, np.inf)
    if pulled:
        row = m.elastic[speed]
        median, mean = row["ultimate_strain_median"], row["ultimate_strain_mean"]
        # The further a band extends, the later it crystallises and breaks.
        rank = bands if c.extensibility_scatter else _normal_scores(number, rng)
        ultimate = _ultimate_strains(median, mean, rank)
    low, high = m.thickness_mm
    levels = np.linspace(low, high, 12)  # NatR: two batches of six bands
    return Specimens(
        stiffness=stiffness * np.exp(c.scatter * common),
        plateau=np.exp(c.scatter / 2 * plateau),
        extensibility=extensible * np.exp(c.extensibility_scatter * bands),
        ultimate_strain=ultimate,
        slack_mm=slack,
        thickness_mm=np.round(rng.choice(levels, number), 2),
    )


def _ultimate_strains(median: float, mean: float, scores: Array) -> Array:
    """Ultimate strains with the published median and mean, in the order of `scores`.

    A law that is tight above the median (8 % at most) and, where the mean lies below
    it, has a tail of early failures: premature tearing is one-sided.
    """
    n = len(scores)
    if n == 1:
        return np.array([median])
    rank = np.empty(n)
    rank[np.argsort(scores)] = (np.arange(n) + 0.5) / n
    u = 2 * rank - 1
    above, below = np.maximum(u - 1 / n, 0), np.maximum(-u - 1 / n, 0)
    late = 0.08 * above
    wanted = late.mean() + 1 - mean / median  # mean early shortfall
    for power in (1.0, 0.5, 0.25, 0.1):
        early = below**power
        depth = wanted / early.mean()
        if depth < 0.9:
            break
    return median * (1 + late - depth * early)


def _normal_scores(number: int, rng: np.random.Generator) -> Array:
    """Shuffled normal scores of zero mean, unit variance: scatter without luck.

    The published figures come from one draw of specimens; independent draws would
    miss them by chance. One specimen has no scatter within its batch.
    """
    if number == 1:
        return np.zeros(1)
    scores = ndtri((np.arange(number) + 0.5) / number)
    return rng.permutation(scores / scores.std())


def _sampling(duration: Array, total: int) -> tuple[float, Array, Array]:
    """Interval [s], samples under load and samples after failure of each test.

    One interval for all tests at a speed, to a hundredth of a millisecond; the samples
    add up to `total`, what is left over going to the time after failure.
    """
    number = len(duration)
    interval = duration.sum() / (total - (AFTER_FAILURE + 0.5) * number)
    interval = np.ceil(interval * 1e5) / 1e5
    loaded = np.floor(duration / interval).astype(int) + 1
    spare = total - loaded.sum()
    after = np.full(number, spare // number)
    after[: spare % number] += 1
    return interval, loaded, after


def _seated(elongation: Array, slack_mm: float) -> Array:
    """Elongation [mm] of the specimen itself once slack is taken up and grips seated."""
    toe = SEATING_MM * np.logaddexp(0, (elongation - slack_mm) / SEATING_MM)
    return toe - toe[0]


def _factors(s: Specimens, i: int) -> dict[str, float]:
    return {
        "stiffness": s.stiffness[i],
        "plateau": s.plateau[i],
        "extensibility": s.extensibility[i],
    }


def _area(m: Material, s: Specimens, i: int) -> float:
    return m.width_mm * float(s.thickness_mm[i])


def _cached(name: str, test: str, seed: int) -> list[Recording]:
    m, c = material(name), calibration(name)
    rng = np.random.default_rng([seed, int(test == "relaxation")])
    return _tensile(m, c, rng) if test == "tensile" else _relaxation(m, c, rng)
