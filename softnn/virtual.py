r"""Virtual specimens of the seven published materials, as a machine would write them.

The recordings behind the published tables were never released, so a physical generator
replaces them. Its parameters are in `data/virtual/NAME.toml`, written by `python -m
studies.calibration`. They bring it as close to Tables 4.2 and 4.4 as one material with
scattering specimens can come. `studies/results/virtual_specimens.json` has the error of
each published property. A number obtained on virtual specimens never reproduces a
measurement.

A specimen under the strain :math:`\varepsilon(t)` carries

.. math::
    \sigma = f \Big[ a \, u (1 + u^n)^{-1/n}
        + p \big( E \varepsilon + C \langle\varepsilon/x - \varepsilon_c\rangle^3 \big)
        + \sum_j k_j q_j \Big], \quad u = \varepsilon / \varepsilon_k, \quad
    \dot q_j = h'(\varepsilon)\,\dot\varepsilon - q_j / \tau_j ,

an equilibrium curve with a knee, a plateau slope and an upturn (crystallisation), and
branches whose strain measure :math:`h' = s + (1-s) e^{-\varepsilon/\varepsilon_h}`
saturates, as a network's transient part does. f, p and x scatter from specimen to
specimen. It shares no code with `softnn.models`, which are tested against it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtri

from softnn.contracts import Array, InputError
from softnn.materials import Material, data_path, material
from softnn.recording import Geometry, Recording

TESTS = ("tensile", "relaxation")
VERSION = 1  # of the generator; every recording's source names it

RAMP_SPEED = 500  # mm/min, to the hold of a relaxation test (thesis section 4.3.2)
# A 50 kN load cell read at a few newtons (thesis section 4.3): rms noise, resolution
# and error of the zero after balancing, N. Inferred, not published.
NOISE_N, RESOLUTION_N, ZERO_N = 0.05, 0.01, 0.03
RESOLUTION_MM = 1e-4  # of the crosshead's encoder
SLACK_MM = (0.3, 1.2)  # take-up slack of a tensile specimen, range
SEATING_MM = 0.08  # width of the toe in which the grips seat
AFTER_FAILURE = 8  # samples a specimen, on average, before the machine stops
LATE = 0.08  # how far, at most, an ultimate strain lies above the median
# Sampling of a relaxation test: from this time after the ramp, this interval, s.
HOLD_SAMPLING = ((0.0, 0.1), (60.0, 1.0), (900.0, 5.0))
RAMP_INTERVAL = 0.01
BANDS = 12  # NatR: two batches of six resistance bands (thesis section 4.3.1.2)


@dataclass(frozen=True)
class Calibration:
    """Parameters of one material; MPa, strain and s. See the module's equation.

    `stiffness` and `extensibility` are the mean f and x of the specimens pulled at a
    speed (mm/min): each speed was measured on other specimens.
    """

    knee_stress: float
    knee_strain: float
    knee_sharpness: float
    modulus: float
    upturn: float
    upturn_strain: float
    branch_moduli: tuple[float, ...]
    branch_times: tuple[float, ...]
    branch_share: float
    branch_strain: float
    scatter: float
    relaxation_slack_mm: float
    stiffness: Mapping[int, float]
    extensibility: Mapping[int, float]


@dataclass(frozen=True)
class Specimen:
    """What sets one specimen apart; the default is the mean one, without slack."""

    stiffness: float = 1.0
    plateau: float = 1.0
    extensibility: float = 1.0
    slack_mm: float = 0.0
    thickness_mm: float = 1.0
    ultimate_strain: float = np.inf


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
    return list(_stored(name, "tensile", seed))


def relaxation(name: str, seed: int = 0) -> list[Recording]:
    """Stress relaxation tests of the material `name`, raw: ramp and hold of Table 4.3.

    >>> [round(r.time_s[-1]) for r in relaxation("NatR")]
    [905, 905]
    """
    return list(_stored(name, "relaxation", seed))


@cache
def _stored(name: str, test: str, seed: int) -> tuple[Recording, ...]:
    # Kept in memory only: building takes milliseconds, no longer than reading a file.
    if not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed is {seed!r}; allowed is a whole number from 0")
    return tuple(build(material(name), calibration(name), test, seed))


@cache
def calibration(name: str) -> Calibration:
    """The stored calibration of one material."""
    path = data_path() / "virtual" / f"{material(name).name}.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    for key in ("stiffness", "extensibility"):
        content[key] = {int(speed): value for speed, value in content[key].items()}
    for key in ("branch_moduli", "branch_times"):
        content[key] = tuple(content[key])
    return Calibration(**{f.name: content[f.name] for f in fields(Calibration)})


def build(m: Material, c: Calibration, test: str, seed: int) -> list[Recording]:
    """Recordings of a "tensile" or "relaxation" test from a calibration."""
    rng = np.random.default_rng([seed, int(test == "relaxation")])
    return _tensile(m, c, rng) if test == "tensile" else _relaxation(m, c, rng)


# --- the material ---------------------------------------------------------------------


def stress(c: Calibration, strain: Array, interval: float, specimen: Specimen) -> Array:
    """Stress [MPa] (n,) for `strain` (n,) sampled every `interval` s, from rest.

    Exact where the branches' strain measure is linear between samples.
    """
    branches = _carried(c, _branches(c, strain, interval))
    return specimen.stiffness * (equilibrium(c, strain, specimen) + branches)


def hold(
    m: Material, c: Calibration, test: Mapping[str, float], specimen: Specimen
) -> tuple[Array, Array, Array]:
    """Time, elongation and stress of a ramp to the elongation of `test`, then held.

    `test` is a row of Table 4.3; the elongation includes the specimen's slack.
    """
    velocity, end = RAMP_SPEED / 60, 60 * test["duration"]
    steps = int(np.ceil(test["elongation"] / velocity / RAMP_INTERVAL))
    ramp = np.linspace(0, test["elongation"] / velocity, steps + 1)
    strain = _seated(velocity * ramp, specimen.slack_mm) / m.length_mm
    until = [start for start, _ in HOLD_SAMPLING[1:]] + [np.inf]
    held = np.concatenate(
        [
            np.arange(start, min(stop, end), every)
            for (start, every), stop in zip(HOLD_SAMPLING, until, strict=True)
        ]
    )
    held = np.append(held[1:], end)
    # Held strain: equilibrium stays, every branch decays from where the ramp left it.
    last = _branches(c, strain, ramp[1])[:, -1]
    decay = np.exp(-held / np.array(c.branch_times)[:, None])
    branches = _carried(c, last[:, None] * decay)
    relaxing = specimen.stiffness * (equilibrium(c, strain[-1:], specimen) + branches)
    elongation = np.append(velocity * ramp, np.full(len(held), test["elongation"]))
    loading = stress(c, strain, ramp[1], specimen)
    time = np.append(ramp, ramp[-1] + held)
    return time, elongation, np.append(loading, relaxing)


def equilibrium(c: Calibration, strain: Array, specimen: Specimen) -> Array:
    """Stress [MPa] (n,) that lasts, less the specimen's `stiffness`; strain from 0."""
    u, n = strain / c.knee_strain, c.knee_sharpness
    knee = c.knee_stress * u * (1 + u**n) ** (-1 / n)
    beyond = np.maximum(strain / specimen.extensibility - c.upturn_strain, 0)
    return knee + specimen.plateau * (c.modulus * strain + c.upturn * beyond**3)


def _branches(c: Calibration, strain: Array, interval: float) -> Array:
    """Internal strain q of each branch, (branches, n)."""
    soft = -c.branch_strain * np.expm1(-strain / c.branch_strain)
    measure = c.branch_share * strain + (1 - c.branch_share) * soft
    step = np.diff(measure, prepend=0.0)
    return np.array(
        [
            lfilter(
                [-time / interval * np.expm1(-interval / time)],
                [1, -np.exp(-interval / time)],
                step,
            )
            for time in c.branch_times
        ]
    )


def _carried(c: Calibration, strains: Array) -> Array:
    """Stress [MPa] (n,) of internal strains (branches, n), in fixed order (no BLAS)."""
    parts = (k * q for k, q in zip(c.branch_moduli, strains, strict=True))
    return sum(parts, start=np.zeros(strains.shape[1]))


def _seated(elongation: Array, slack_mm: float) -> Array:
    """Elongation [mm] of the specimen itself: slack taken up, grips seated."""
    if slack_mm == 0:
        return elongation
    toe = SEATING_MM * np.logaddexp(0, (elongation - slack_mm) / SEATING_MM)
    return toe - toe[0]


# --- the tests ------------------------------------------------------------------------


def _tensile(m: Material, c: Calibration, rng: np.random.Generator) -> list[Recording]:
    recordings = []
    for speed, number in m.specimens.items():
        specimens = _pulled(m, c, speed, number, rng)
        velocity = speed / 60
        duration = [
            (s.ultimate_strain * m.length_mm + s.slack_mm) / velocity for s in specimens
        ]
        interval, loaded, after = _sampling(np.array(duration), m.samples[speed])
        for i, s in enumerate(specimens):
            elongation = velocity * interval * np.arange(loaded[i])
            whole = stress(
                c, _seated(elongation, s.slack_mm) / m.length_mm, interval, s
            )
            # The halves spring back: within a sample or two the load is gone.
            broken = whole[-1] * 0.02 ** np.arange(1, 1 + after[i])
            time = interval * np.arange(loaded[i] + after[i])
            curve = time, velocity * time, np.append(whole, broken)
            name = f"{m.name}-{speed}-{i + 1:02d}"
            recordings.append(_record(m, s, name, "tensile", speed, curve, rng))
    return recordings


def _relaxation(
    m: Material, c: Calibration, rng: np.random.Generator
) -> list[Recording]:
    recordings = []
    for number, test in m.relaxation.items():
        for i, s in enumerate(_held(m, c, int(test["recordings"]), rng)):
            name = f"{m.name}-relaxation-{number}-{i + 1:02d}"
            curve = hold(m, c, test, s)
            recordings.append(_record(m, s, name, "relaxation", RAMP_SPEED, curve, rng))
    return recordings


def _record(
    m: Material,
    specimen: Specimen,
    name: str,
    test: str,
    speed: int,
    curve: tuple[Array, Array, Array],
    rng: np.random.Generator,
) -> Recording:
    """The recording a machine makes: noise, an imperfect zero, finite resolution."""
    time, elongation, stress_MPa = curve
    area = m.width_mm * specimen.thickness_mm
    force = stress_MPa * area
    force = force + rng.normal(0, NOISE_N, len(force)) + rng.normal(0, ZERO_N)
    # Finite resolution absorbs the rounding of exp, which differs between processors.
    force = RESOLUTION_N * np.round(force / RESOLUTION_N)
    elongation = RESOLUTION_MM * np.round(elongation / RESOLUTION_MM)
    return Recording(
        time_s=time,
        strain=elongation / m.length_mm,
        stress_MPa=force / area,
        force_N=force,
        elongation_mm=elongation,
        name=name,
        specimen=name,
        material=m.name,
        test=test,
        rate_per_s=m.rate_per_s(speed),
        geometry=Geometry(
            length_mm=m.length_mm,
            width_mm=m.width_mm,
            thickness_mm=specimen.thickness_mm,
        ),
        source=f"virtual specimen, generator {VERSION}: not a measurement",
    )


def _sampling(duration: Array, total: int) -> tuple[float, Array, Array]:
    """Return interval [s], samples under load and samples after failure of each test.

    All tests at a speed have one interval, to a hundredth of a millisecond. The samples
    add up to `total`; the remainder goes to the time after failure.
    """
    number = len(duration)
    interval = duration.sum() / (total - (AFTER_FAILURE + 0.5) * number)
    interval = float(np.ceil(interval * 1e5) / 1e5)
    loaded = np.floor(duration / interval).astype(int) + 1
    spare = total - int(loaded.sum())
    after = np.full(number, spare // number)
    after[: spare % number] += 1
    return interval, loaded, after


# --- scatter between specimens --------------------------------------------------------


def _pulled(
    m: Material, c: Calibration, speed: int, number: int, rng: np.random.Generator
) -> list[Specimen]:
    """Tensile specimens; their mean factors are the calibrated ones of the speed."""
    common, plateau, order = (_scores(number, rng) for _ in range(3))
    rank = _ranks(order)
    published = m.elastic[speed]
    ultimate = _ultimate_strains(
        published["ultimate_strain_median"], published["ultimate_strain_mean"], rank
    )
    # A band that crystallises late breaks late, if nothing tears it before.
    spread = LATE * rank if m.thickness_mm[0] < m.thickness_mm[1] else 0 * rank
    slack = rng.uniform(*SLACK_MM, number)
    thickness = _thickness(m, number, rng)
    return [
        Specimen(
            stiffness=c.stiffness.get(speed, 1.0) * np.exp(c.scatter * common[i]),
            plateau=np.exp(c.scatter / 2 * plateau[i]),
            extensibility=c.extensibility.get(speed, 1.0) * (1 + spread[i]),
            slack_mm=slack[i],
            thickness_mm=thickness[i],
            ultimate_strain=ultimate[i],
        )
        for i in range(number)
    ]


def _held(
    m: Material, c: Calibration, number: int, rng: np.random.Generator
) -> list[Specimen]:
    """Specimens of a relaxation test."""
    common, slack = (_scores(number, rng) for _ in range(2))
    thickness = _thickness(m, number, rng)
    return [
        Specimen(
            stiffness=np.exp(c.scatter * common[i]),
            slack_mm=c.relaxation_slack_mm * (1 + 0.2 * slack[i]),
            thickness_mm=thickness[i],
        )
        for i in range(number)
    ]


def _ultimate_strains(median: float, mean: float, rank: Array) -> Array:
    """Ultimate strains with the published median and mean, in the order of `rank`.

    A law that is tight above the median and, where the mean lies below it, has a tail
    of early failures: premature tearing is one-sided. Its form is inferred.
    """
    if len(rank) == 1:
        return np.array([median])
    late, early = np.maximum(rank, 0), np.maximum(-rank, 0)
    shortfall = LATE * late.mean() + 1 - mean / median
    for power in (1.0, 0.5, 0.25):  # the least convex tail that stays above zero
        depth = shortfall / (early**power).mean()
        if depth * early.max() ** power < 0.9:
            return median * (1 + LATE * late - depth * early**power)
    raise InputError(f"no law has median {median} and mean {mean} of {len(rank)}")


def _ranks(scores: Array) -> Array:
    """Ranks from -1 to 1, evenly spaced; 0 for the middle one or the middle two."""
    n = len(scores)
    u = (2 * scores.argsort().argsort() + 1) / n - 1
    return np.sign(u) * np.maximum(np.abs(u) - 1 / n, 0)


def _scores(number: int, rng: np.random.Generator) -> Array:
    """Shuffled normal scores of zero mean and unit variance: scatter without luck.

    The published figures come from one draw of specimens; independent draws would
    miss them by chance. One specimen has no scatter within its batch.
    """
    if number == 1:
        return np.zeros(1)
    scores = ndtri((np.arange(number) + 0.5) / number)
    return rng.permutation(scores / scores.std())


def _thickness(m: Material, number: int, rng: np.random.Generator) -> list[float]:
    levels = np.linspace(*m.thickness_mm, BANDS)
    return [round(float(t), 2) for t in rng.choice(levels, number)]
