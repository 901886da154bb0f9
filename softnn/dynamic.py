r"""Dynamic tests: storage and loss modulus of models and of recordings.

The strain swings about a mean, :math:`\varepsilon = \varepsilon_0 \sin \omega t`. The
part of the stress that has the same frequency is
:math:`\sigma = \varepsilon_0 (E' \sin \omega t + E'' \cos \omega t)`. The storage
modulus :math:`E'` is the share that the material gives back. The loss modulus
:math:`E''` is the share that it turns into heat, :math:`\pi E'' \varepsilon_0^2` per
volume and cycle. Their ratio is :math:`\tan \delta`. A model with
:math:`E'' < 0` makes energy out of nothing.

J. D. Ferry, *Viscoelastic Properties of Polymers*, 3rd ed., Wiley 1980, chapters 1, 3.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from softnn.contracts import Array, Chunk, InputError
from softnn.recording import Recording

SETTLE, JUDGED, SAMPLES = 24, 4, 120  # cycles, cycles, samples a cycle
DRIFT = 2  # degree of the polynomial that slow relaxation is taken for
FEWEST = 8  # samples a cycle, below which a sine cannot be read
SMALL = 0.05  # of a fundamental: a strain with less else in it is a sine


@dataclass(frozen=True)
class Moduli:
    """Storage and loss modulus [MPa] over frequency [Hz], each (n,).

    `other` is the share of the stress about its mean that is not of the frequency of
    the strain, root mean square: 0 for a linear material.
    """

    frequency_Hz: Array
    storage_MPa: Array
    loss_MPa: Array
    other: Array

    @property
    def loss_tangent(self) -> Array:
        """tan delta (n,): the loss over the storage modulus."""
        return self.loss_MPa / self.storage_MPa


class Simulates(Protocol):
    """What gives the stress of strain histories: stored models and networks."""

    def stress(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
    ) -> list[Array]: ...


def of_branches(
    equilibrium_MPa: float,
    stiffness_MPa: ArrayLike,
    relaxation_time_s: ArrayLike,
    frequency_Hz: ArrayLike,
) -> Moduli:
    r"""Moduli of a spring beside Maxwell branches, in closed form.

    .. math::
        E' = E_\infty + \sum_j k_j \frac{\omega^2\tau_j^2}{1 + \omega^2\tau_j^2}, \quad
        E'' = \sum_j k_j \frac{\omega\tau_j}{1 + \omega^2\tau_j^2}

    >>> one = of_branches(1.0, [2.0], [0.5], 1 / np.pi)  # omega tau is 1
    >>> float(one.storage_MPa[0]), float(one.loss_MPa[0])
    (2.0, 1.0)
    """
    frequency = np.atleast_1d(np.asarray(frequency_Hz, float))
    k = np.atleast_1d(np.asarray(stiffness_MPa, float))
    x = 2 * np.pi * frequency[:, None] * np.asarray(relaxation_time_s, float)
    storage = equilibrium_MPa + (k * x**2 / (1 + x**2)).sum(axis=1)
    loss = (k * x / (1 + x**2)).sum(axis=1)
    return Moduli(frequency, storage, loss, np.zeros(len(frequency)))


def sweep(
    model: Simulates, frequency_Hz: ArrayLike, mean: float, amplitude: float
) -> Moduli:
    """Moduli of a model at each frequency, by sines of strain about `mean`.

    The strain starts at rest at zero, goes to `mean - amplitude` within a cycle, and
    swings between that and `mean + amplitude`. The last cycles are judged, when slow
    relaxation has become a drift. Raises `InputError` for a strain that cannot be.
    """
    frequency = np.atleast_1d(np.asarray(frequency_Hz, float))
    if not (frequency > 0).all() or not amplitude > 0 or not np.isfinite(mean):
        raise InputError(
            f"frequencies {frequency.tolist()} Hz, mean {mean}, amplitude {amplitude}: "
            "frequencies and the amplitude must be above 0"
        )
    chunks = [sine(f, mean, amplitude) for f in frequency]
    names = [f"sine of {f:g} Hz" for f in frequency]
    every = model.stress(names, chunks, [None] * len(chunks))
    last = JUDGED * SAMPLES + 1
    return joined(
        of_sine(c.time_s[-last:], np.asarray(c.strain)[-last:], s[-last:], f)
        for c, s, f in zip(chunks, every, frequency, strict=True)
    )


def sine(frequency_Hz: float, mean: float, amplitude: float) -> Chunk:
    """The strain history of `sweep` at one frequency."""
    steps = np.arange(-SAMPLES, (SETTLE + JUDGED) * SAMPLES + 1) / SAMPLES
    strain = mean - amplitude * np.cos(2 * np.pi * steps)
    begin = steps < 0
    strain[begin] = (mean - amplitude) * (1 + steps[begin])
    return Chunk((steps + 1) / frequency_Hz, strain)


def of_recording(recording: Recording, frequency_Hz: float | None = None) -> Moduli:
    """Moduli of a recorded sine, at its own frequency unless one is given.

    Of a component they are in its units of stress over strain. A triangle has a
    fundamental too, and `other` says how much else there is. Raises `InputError` where
    the strain does not swing, or too few samples show it.
    """
    known = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    part = recording.take(np.flatnonzero(known))
    given = frequency_Hz if frequency_Hz is not None else frequency_of(part)
    try:
        return of_sine(part.time_s, part.strain, part.stress_MPa, given)
    except InputError as error:
        raise InputError(f"{recording.name}: {error}") from None


def of_sine(
    time_s: Array, strain: Array, stress_MPa: Array, frequency_Hz: float
) -> Moduli:
    """Moduli at one frequency by least squares of both fundamentals; arrays (n,).

    Beside the sine stands a polynomial in time, for a mean and a slow drift. Whole
    cycles are taken, counted back from the end, as parts of one would be read as drift.
    """
    cycles = np.floor((time_s[-1] - time_s[0]) * frequency_Hz * (1 + 1e-9) + 1e-9)
    keep = time_s >= time_s[-1] - cycles / frequency_Hz * (1 + 1e-9)
    if cycles < 1 or keep.sum() < FEWEST * cycles:
        raise InputError(
            f"{keep.sum()} samples of {cycles:.0f} cycles at {frequency_Hz:.4g} Hz; "
            f"a whole cycle with {FEWEST} samples is needed"
        )
    time = time_s[keep] - time_s[keep].mean()
    angle = 2 * np.pi * frequency_Hz * time
    drift = np.vander(time / time[-1], min(DRIFT, int(cycles)) + 1)
    columns = np.column_stack([np.cos(angle), np.sin(angle), drift])
    both = np.column_stack([strain[keep], stress_MPa[keep]])
    found = np.linalg.lstsq(columns, both, rcond=None)[0]
    left = both - columns @ found
    moved = columns[:, :2] @ found[:2]
    swing, answer = found[0] - 1j * found[1]
    if not abs(swing) > SMALL * np.ptp(strain[keep]):
        raise InputError(f"the strain does not swing at {frequency_Hz:.4g} Hz")
    modulus = answer / swing
    beside = float(np.mean(left[:, 1] ** 2))
    whole = beside + float(np.mean(moved[:, 1] ** 2))
    return Moduli(
        np.array([frequency_Hz]),
        np.array([modulus.real]),
        np.array([modulus.imag]),
        np.array([np.sqrt(beside / whole) if whole > 0 else 0.0]),
    )


def frequency_of(recording: Recording) -> float:
    """The frequency [Hz] at which the strain swings most, by least squares.

    Raises `InputError` where it does not swing.
    """
    time, strain = recording.time_s, recording.strain
    lapse = float(np.ptp(time)) if len(time) else 0.0
    if len(time) < FEWEST or not lapse > 0 or not np.ptp(strain) > 0:
        raise InputError(f"{recording.name}: the strain does not swing")
    even = np.linspace(time[0], time[-1], max(len(time), 256))
    moved = np.interp(even, time, strain)
    moved -= np.polyval(np.polyfit(even, moved, 1), even)
    first = 1 + int(np.argmax(np.abs(np.fft.rfft(moved))[1:]))

    def left(frequency: float) -> float:
        angle = 2 * np.pi * frequency * time
        columns = np.column_stack(
            [np.cos(angle), np.sin(angle), time - time[0], np.ones(len(time))]
        )
        fitted = columns @ np.linalg.lstsq(columns, strain, rcond=None)[0]
        return float(np.mean((strain - fitted) ** 2))

    near = ((first - 0.75) / lapse, (first + 0.75) / lapse)
    exact = {"xatol": 1e-9 / lapse}
    found = minimize_scalar(left, bounds=near, method="bounded", options=exact)
    return float(found.x)


def joined(parts: Iterable[Moduli]) -> Moduli:
    """Moduli at several frequencies as one."""
    every = list(parts)
    names = ("frequency_Hz", "storage_MPa", "loss_MPa", "other")
    return Moduli(*(np.concatenate([getattr(m, n) for m in every]) for n in names))
