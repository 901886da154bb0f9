"""What an effect is in the forge: hooks at the stages of a measurement it acts in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from bench.concealed.bases import Base
from bench.concealed.programmes import STEP_S, Array, Imposed, Pace


@dataclass
class Signals:
    """A material history on the fine clock; all (n,). One recording or several."""

    strain: Array
    temperature_C: Array
    spring_strain: Array
    branch_strain: Array
    spring: Array = field(default_factory=lambda: np.zeros(0))
    branches: Array = field(default_factory=lambda: np.zeros(0))
    extra: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def rate(self) -> Array:
        return np.diff(self.strain, prepend=0.0) / STEP_S

    @property
    def largest(self) -> Array:
        """Largest strain so far, not below zero."""
        return np.maximum.accumulate(np.maximum(self.strain, 0.0))


@dataclass
class Context:
    """What a plant may look at while it draws its parameters.

    `stress` is the fine stress of every recording as the stage before the effect
    gives it: of the bare base for rig and material, with these in it for sensors.
    """

    rng: np.random.Generator
    strength: float
    base: Base
    pace: Pace
    programmes: Sequence[Imposed]
    stress: Sequence[Array]

    @property
    def peak(self) -> float:
        """Largest stress of the case, MPa."""
        return max(float(np.abs(s).max()) for s in self.stress)

    def amount(self, low: float, high: float) -> float:
        """A draw from the range of strength 1, scaled."""
        return float(self.rng.uniform(low, high)) * self.strength

    def pick(self, *forms: str) -> str:
        return str(self.rng.choice(forms))

    def some(self, share: float) -> list[int]:
        """A `share` of the recordings, at least one, never all."""
        n = len(self.programmes)
        count = min(max(1, round(share * n)), max(1, n - 1))
        return sorted(int(i) for i in self.rng.choice(n, count, replace=False))


MaterialHook = Callable[[Signals], None]
StressHook = Callable[[Signals, Array], Array]
# (recording, programme, signal) -> signal
RecordingHook = Callable[[int, Imposed, Array], Array]


@dataclass
class Planted:
    """One effect as planted in a case; hooks that it does not use are None."""

    effect: str
    form: str
    parameters: dict[str, object]
    rig: RecordingHook | None = None
    strain: MaterialHook | None = None
    parts: MaterialHook | None = None
    stress: StressHook | None = None
    sensor: RecordingHook | None = None


def material_stress(
    base: Base, planted: Sequence[Planted], strain: Array, temperature_C: Array
) -> Array:
    """Stress (n,) of the specimen for its own strain history."""
    h = Signals(strain, temperature_C, strain.copy(), strain.copy())
    for p in planted:
        if p.strain:
            p.strain(h)
    h.spring = base.spring(h.spring_strain)
    h.branches = base.relaxing(h.branch_strain)
    h.extra = np.zeros_like(strain)
    for p in planted:
        if p.parts:
            p.parts(h)
    stress = h.spring + h.branches + h.extra
    for p in planted:
        if p.stress:
            stress = p.stress(h, stress)
    return stress


def specimen_strains(
    planted: Sequence[Planted], programmes: Sequence[Imposed]
) -> list[Array]:
    """What strain reaches the specimen, per recording."""
    result = []
    for i, programme in enumerate(programmes):
        strain = programme.strain
        for p in planted:
            if p.rig:
                strain = p.rig(i, programme, strain)
        result.append(strain)
    return result


def run_material(
    base: Base,
    planted: Sequence[Planted],
    programmes: Sequence[Imposed],
    temperatures: Sequence[Array],
    continued: bool,
) -> list[Array]:
    """Stress of every recording, each on a virgin specimen or one history long."""
    strains = specimen_strains(planted, programmes)
    if not continued:
        return [
            material_stress(base, planted, e, t)
            for e, t in zip(strains, temperatures, strict=True)
        ]
    whole = material_stress(
        base, planted, np.concatenate(strains), np.concatenate(temperatures)
    )
    return np.split(whole, np.cumsum([len(e) for e in strains])[:-1])


def run_sensor(
    planted: Sequence[Planted], programmes: Sequence[Imposed], stress: Sequence[Array]
) -> list[Array]:
    """What the load cell writes down, per recording, still without noise."""
    result = []
    for i, (programme, signal) in enumerate(zip(programmes, stress, strict=True)):
        for p in planted:
            if p.sensor:
                signal = p.sensor(i, programme, signal)
        result.append(signal)
    return result
