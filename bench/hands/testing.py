"""A test run: the machine's course through rig, material and sensor, and its laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.hands import kernels
from bench.hands.families import Array, Rng
from bench.hands.materials import Material
from bench.hands.programmes import Course

FINE_S = 0.02  # steps of the integrators, at most, as far as twelve to a sample go


@dataclass(frozen=True)
class Run:
    """What one specimen goes through, on the fine clock: one recording, or all."""

    time_s: Array
    strain: Array  # that the rig lets through
    warmth_C: Array
    owner: Array  # the recording of each instant
    setup: Setup

    @property
    def clock(self) -> Array:
        """Time steps (n,), the first one zero."""
        return np.diff(self.time_s, prepend=self.time_s[0])

    @property
    def warmer(self) -> Array:
        """Degrees above the rest temperature."""
        return self.warmth_C - self.setup.rest_C


@dataclass
class Setup:
    """A material on a machine: all that a test needs but what is concealed."""

    model: str
    mode: str
    material: Material
    courses: list[Course]  # the recorded ones, then those held
    n: int  # recorded
    continued: bool
    factors: Array
    em: float
    pace_s: float
    rest_C: float
    swing_C: float
    peak: float = 1.0  # of the bare response; set by `settle`

    def reached(self) -> Array:
        """The lowest and the highest strain imposed."""
        every = np.concatenate([c.strain for c in self.courses])
        return np.array([min(every.min(), 0.0), max(every.max(), 0.0)])

    def settle(self) -> None:
        """Measure the bare response."""
        self.peak = max(float(np.abs(s).max()) for s in simulate(self, ()))


@dataclass(frozen=True)
class Act:
    """A law with its parameters drawn; the strength `a` comes last in every hook.

    Strengths run from `least` (below which the law is no longer itself) to `limit`.

    All work on the fine clock; at a = 0 every hook hands back what it was given (or
    nothing, for `extra`; or the linear branches, for `flow`).

    rig(i, t, strain, a): what reaches the specimen in recording i
    strain(run, e, a): what the material feels of it
    tempo(run, e, a): how much faster the branches relax
    flow(run, e, clock, a): stress of the branches, their own integrator
    spring(run, stress, a), whole(run, stress, a): on the spring; on all stress
    extra(run, e, stress, a): stress beside the others
    sensor(i, t, stress, a): what is written down in recording i
    """

    limit: float
    least: float = field(default=0.0, kw_only=True)
    parameters: dict[str, Any] = field(default_factory=dict)
    acts_on: str = "-"
    own_faults: bool = False  # of single recordings: not in held-out recordings
    rig: Callable[[int, Array, Array, float], Array] | None = None
    strain: Callable[[Run, Array, float], Array] | None = None
    tempo: Callable[[Run, Array, float], Array] | None = None
    flow: Callable[[Run, Array, Array, float], Array] | None = None
    spring: Callable[[Run, Array, float], Array] | None = None
    whole: Callable[[Run, Array, float], Array] | None = None
    extra: Callable[[Run, Array, Array, float], Array] | None = None
    sensor: Callable[[int, Array, Array, float], Array] | None = None


@dataclass(frozen=True)
class Law:
    """A published law for an effect, or a stranger (`effect` is then "alien")."""

    effect: str
    name: str
    side: str
    reference: str
    make: Callable[[Rng, Setup], Act]
    stage: str = "material"


def on_spring_or_whole(
    rng: Rng, hook: Callable[[Run, Array, float], Array], **rest: Any
) -> Act:
    """The same softening of the spring alone or of the whole response."""
    if rng.random() < 0.5:
        return Act(spring=hook, acts_on="spring", **rest)
    return Act(whole=hook, acts_on="whole", **rest)


Planted = Sequence[tuple[Act, float]]


def parts_of(course: Course) -> int:
    """Steps of the fine clock from one sample to the next."""
    return int(np.clip(np.ceil(1 / course.rate_Hz / FINE_S), 1, 12))


def fine(course: Course, values: Array) -> Array:
    """Straight lines between samples, on the fine clock."""
    n, m = len(values), parts_of(course)
    return np.interp(np.arange((n - 1) * m + 1) / m, np.arange(n), values)


def linear_flow(material: Material, drive: Array, clock: Array) -> Array:
    """Linear branches, driven by `drive`."""
    if not len(material.taus):
        return np.zeros(len(drive))
    steps = np.diff(drive, prepend=0.0)
    return kernels.responses(steps, clock, material.taus) @ material.moduli


def respond(run: Run, planted: Planted) -> Array:
    """Stress of the material."""
    material, e = run.setup.material, run.strain
    for act, a in planted:
        if act.strain:
            e = act.strain(run, e, a)
    clock = run.clock
    for act, a in planted:
        if act.tempo:
            clock = clock * act.tempo(run, e, a)
    spring = material.spring(e)
    for act, a in planted:
        if act.spring:
            spring = act.spring(run, spring, a)
    flows = [(act, a) for act, a in planted if act.flow]
    if len(flows) > 1:
        raise ValueError("two laws for the flow of the same branches")
    if flows and flows[0][0].flow:
        branches = flows[0][0].flow(run, e, clock, flows[0][1])
    else:
        branches = linear_flow(material, e, clock)
    stress = spring + branches
    extra = np.zeros(len(e))
    for act, a in planted:
        if act.extra:
            extra = extra + act.extra(run, e, stress, a)
    stress = stress + extra
    for act, a in planted:
        if act.whole:
            stress = act.whole(run, stress, a)
    return stress


def simulate(setup: Setup, planted: Planted, held: bool = False) -> list[Array]:
    """Noise-free stress at the samples of each recording, or of each held one.

    Held recordings are of fresh specimens of the mean kind, without faults of single
    recordings.
    """
    numbers = list(range(setup.n, len(setup.courses)) if held else range(setup.n))
    courses = [setup.courses[i] for i in numbers]
    factors = np.ones(len(numbers)) if held else setup.factors
    if held:
        planted = [(act, a) for act, a in planted if not act.own_faults]
    times = [fine(c, c.time_s) for c in courses]
    strains = [fine(c, c.strain) for c in courses]
    warmths = [fine(c, c.warmth_C) for c in courses]
    reached = list(strains)
    for act, a in planted:
        if act.rig:
            reached = [
                act.rig(i, t, e, a)
                for i, t, e in zip(numbers, times, reached, strict=True)
            ]
    places = range(len(numbers))
    together = setup.continued and not held
    out: list[Array] = []
    for group in [list(places)] if together else [[k] for k in places]:
        start, stamps = 0.0, []
        for k in group:
            stamps.append(times[k] - times[k][0] + start)
            start = stamps[-1][-1]
        run = Run(
            np.concatenate(stamps),
            np.concatenate([reached[k] for k in group]),
            np.concatenate([warmths[k] for k in group]),
            np.concatenate([np.full(len(times[k]), float(numbers[k])) for k in group]),
            setup,
        )
        stress = respond(run, planted)
        out += np.split(stress, np.cumsum([len(times[k]) for k in group])[:-1])
    for k, i in enumerate(numbers):
        stress = out[k] * factors[k]
        for act, a in planted:
            if act.sensor:
                stress = act.sensor(i, times[k], stress, a)
        out[k] = stress[:: parts_of(courses[k])]
    return out
