"""A case before anything is planted in it: model, material, machine and habits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from bench.concealed import oracle
from bench.concealed.bases import Base, draw_base
from bench.concealed.noises import LEVELS
from bench.concealed.orders import FIRST_TRIAL_SEED, NEEDS_SINE, Order
from bench.concealed.planting import Planted, run_material, run_sensor
from bench.concealed.programmes import (
    FAMILIES,
    HELD_OUT,
    STEP_S,
    Array,
    Imposed,
    Pace,
    sample,
)

BENT_TRIES = 8  # after which a case of next to no noise gets a straight spring


@dataclass(frozen=True)
class Setting:
    """The case before anything is planted in it."""

    model: str
    base: Base
    pace: Pace
    programmes: tuple[Imposed, ...]
    temperatures: tuple[Array, ...]
    continued: bool
    gains: tuple[float, ...]  # of the specimens; ones without a specimen table
    specimens: tuple[str, ...]
    warm: bool  # whether a temperature channel is written
    level: float  # of noise

    def bare(self) -> list[Array]:
        return run_material(
            self.base, (), self.programmes, self.temperatures, self.continued
        )

    def run(self, planted: Sequence[Planted]) -> list[Array]:
        stress = run_material(
            self.base, planted, self.programmes, self.temperatures, self.continued
        )
        stress = [g * s for g, s in zip(self.gains, stress, strict=True)]
        return run_sensor(planted, self.programmes, stress)

    def sampled(self, signals: Sequence[Array]) -> Array:
        return np.concatenate(
            [s[p.index] for s, p in zip(signals, self.programmes, strict=True)]
        )

    def refit(self, times_s: Sequence[float] | None = None) -> oracle.Refit:
        """What the model can choose from, knowing what went before a recording.

        `times_s`: relaxation times offered beside the grid, by default the true ones.
        """
        before: list[Array] = []
        past = np.zeros(0)
        for programme in self.programmes:
            before.append(past)
            if self.continued:
                past = np.concatenate([past, programme.strain])
        times = [t for _, t in self.base.branches] if times_s is None else times_s
        return oracle.refit(self.model, self.programmes, before, times)


def draw_model(rng: np.random.Generator, effects: Sequence[str]) -> str:
    """A model that leaves the effects out, and nothing else."""
    if "nonlinear_elasticity" in effects:
        if "relaxation_branch" in effects:
            return "sls"
        return str(rng.choice(["wiechert", "sls"], p=[0.6, 0.4]))
    if "relaxation_branch" in effects:
        return str(rng.choice(["sls", "pl-sls"]))
    if "finite_strain" in effects:
        return "pl-wiechert"
    if "strain_dependent_relaxation" in effects:
        return str(rng.choice(["pl-wiechert", "wiechert"], p=[0.75, 0.25]))
    models = ["pl-wiechert", "wiechert", "pl-sls", "sls", "hooke"]
    return str(rng.choice(models, p=[0.65, 0.12, 0.10, 0.08, 0.05]))


def draw_setting(rng: np.random.Generator, order: Order) -> Setting:
    """Model, material, machine and habits of one case."""
    effects = order.effects
    model = draw_model(rng, effects)
    wide = "finite_strain" in effects
    peak = float(np.exp(rng.uniform(*np.log((0.8, 2.2) if wide else (0.2, 1.2)))))
    low = 0.0
    if "tension_only" in effects or (
        not {"slack", "grip_slip"} & set(effects) and rng.random() < 0.2
    ):
        low = -min(rng.uniform(0.1, 0.3), 0.25 / peak)
    quick = {"inertia", "sensor_lag"} & set(effects)
    pace = Pace(
        peak,
        float(np.exp(rng.uniform(*np.log((2.0, 5.0))))),
        float(rng.uniform(0.12, 0.25)),
        float(np.exp(rng.uniform(*np.log((0.5, 1.5) if quick else (0.15, 1.0))))),
        low,
    )
    programmes = draw_programmes(rng, order, pace, quick=bool(quick))
    temperatures = draw_temperatures(rng, programmes)
    continued = bool(rng.random() < 0.25)
    specimens: tuple[str, ...] = ()
    gains = np.ones(len(programmes))
    if not (continued or order.simulated or rng.random() > 0.15):
        number = int(rng.integers(2, 4))
        whose = np.arange(len(programmes)) % number
        if not {"gain_error", "zero_offset"} & set(effects):
            specimens = tuple(f"S{w + 1}" for w in whose)
            gains = (1 + 0.03 * rng.standard_normal(number))[whose]
    setting = Setting(
        model,
        draw_base(rng, peak, True, 0),
        pace,
        programmes,
        temperatures,
        continued,
        tuple(float(g) for g in gains),
        specimens,
        "thermal_softening" in effects or bool(rng.random() < 0.15),
        LEVELS[-1],
    )
    branches = {"hooke": 0, "sls": 1, "pl-sls": 1}.get(model, int(rng.integers(2, 5)))
    for tries in count():
        # Where noise is given, and next to none, no bent spring may be good enough.
        linear = not model.startswith("pl-") or (
            order.level is not None and tries >= BENT_TRIES
        )
        base = draw_base(rng, peak, linear, branches)
        # A level of its own to every try: a bent spring comes with the louder ones.
        level = float(rng.choice(LEVELS))
        if order.level is not None:
            level = order.level
        setting = replace(setting, base=base, level=level)
        stress = setting.sampled(setting.bare())
        sigma = setting.level * float(np.ptp(stress))
        # A spring that 16 segments cannot follow would be a mismatch of its own.
        if base.name == "linear" or oracle.adequate(base, programmes, sigma):
            break
    return setting


def draw_programmes(
    rng: np.random.Generator, order: Order, pace: Pace, quick: bool
) -> tuple[Imposed, ...]:
    """About seven programmes in shuffled order, sampled."""
    names = list(FAMILIES)
    if order.seed >= FIRST_TRIAL_SEED:
        replaceable = ["ramp-medium", "growing", "staircase"]
        if not set(NEEDS_SINE) & set(order.effects):
            replaceable.append("sine")
        for old in rng.permutation(replaceable)[: int(rng.integers(1, 4))]:
            names.remove(str(old))
            names.append(str(rng.choice(list(HELD_OUT))))
    if rng.random() < 0.2:
        names.remove(str(rng.choice([n for n in names if n != "sine"])))
    elif rng.random() < 0.2:
        names.append(str(rng.choice(["growing", "staircase", "ramp-medium"])))
    interval = float(
        np.exp(rng.uniform(*np.log((0.02, 0.05) if quick else (0.03, 0.1))))
    )
    clocks = ["jittered", "gappy"] if order.dirty else ["steady", "two-speed"]
    result = []
    for name in rng.permutation(names):
        strain = (FAMILIES | HELD_OUT)[str(name)](rng, pace)
        clock = str(rng.choice(clocks))
        dense = min(interval, 1 / (25 * pace.cycle_hz) if name == "sine" else 1.0)
        samples = int(np.clip(len(strain) * STEP_S / dense, 300, 3000))
        if name == "hold" and clock != "steady":
            samples = int(rng.integers(500, 1500))
        result.append(Imposed(str(name), strain, sample(rng, strain, samples, clock)))
    return tuple(result)


def draw_temperatures(
    rng: np.random.Generator, programmes: Sequence[Imposed]
) -> tuple[Array, ...]:
    """Slow swings within and steps between recordings, 6-15 degC over the case."""
    curves = []
    for p in programmes:
        t = p.time_s
        waves = sum(
            rng.uniform(0.2, 0.5)
            * np.sin(
                2 * np.pi * t / rng.uniform(0.6, 2.5) / t[-1] + rng.uniform(0, 6.3)
            )
            for _ in range(2)
        )
        curves.append(np.asarray(waves) + rng.uniform(-0.7, 0.7))
    low = min(float(c.min()) for c in curves)
    high = max(float(c.max()) for c in curves)
    swing, middle = rng.uniform(6, 15), rng.uniform(20, 27)
    return tuple(middle + swing * ((c - low) / (high - low) - 0.5) for c in curves)
