r"""How far a material card is from its model, in stress.

Finite-element codes relax the deviatoric second Piola-Kirchhoff stress (Simo 1987,
doi:10.1016/0045-7825(87)90107-1). In an incompressible strip of stretch
$\lambda = 1 + \varepsilon$:

$$ S_k(t) = \Big(1 - \sum_i g_i\Big) S_k^0(t)
   + \sum_i g_i \int_0^t e^{-(t-s)/\tau_i}\, \dot S_k^0(s)\, ds, $$

with $S_1^0 = \tfrac{2}{3} \eta P_0/\lambda$ along the strip and
$S_2^0 = -\tfrac{1}{3} \eta P_0 \lambda^2$ across it. $P_0(\lambda)$ is the curve of the
card, $g_i$ and $\tau_i$ are its Prony series, $\eta$ is the softening of Ogden and
Roxburgh. The nominal stress is $P = \lambda S_1 - S_2 / \lambda^2$: the sides are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import erf

from softnn.cards.written import Card, of_test
from softnn.contracts import Array, Chunk
from softnn.model_file import Stored
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import simulate

MOST = 0.1  # of the stress, that a card may be off without being asked for
SECONDS = 10.0  # of a ramp, where no branch says how long one is
STEPS = 60  # of a ramp


@dataclass(frozen=True)
class Loss:
    """Root mean square of the difference over that of the stress: of all, of effects.

    `of` holds (id of the effect, what the stress changes without it alone).
    """

    whole: float
    of: tuple[tuple[str, float], ...]
    over: str

    @property
    def line(self) -> str:
        """The same in a sentence."""
        alone = ", ".join(f"{name} {100 * x:.2g} %" for name, x in self.of)
        return (
            f"the stress of this card is {100 * self.whole:.2g} % off the model's, "
            f"{self.over}" + (f"; not carried, one by one: {alone}" if alone else "")
        )


def loss(model: Stored, made: Card, recordings: Sequence[Recording] = ()) -> Loss:
    """Return how far the card is from the model over the strain of recordings.

    Without any: over cycles and a hold in the model's own range of strain and time.
    Effects of the rig and the sensors take no part, as a card is of the material.
    """
    seen = [i for i, p in enumerate(model.pieces) if not of_test(p.effect)]
    if recordings:
        names = [r.name for r in recordings]
        chunks = [r.history for r in recordings]
        over = f"over {len(chunks)} recording{'' if len(chunks) == 1 else 's'}"
    else:
        chunks = programme(model)
        names = [""] * len(chunks)
        reach = max(chunks[0].strain, key=abs)
        over = f"over cycles to a strain of {reach:.3g} and a hold"
    none = [None] * len(chunks)

    def having(places: Sequence[int]) -> Array:
        some = replace(
            model,
            pieces=tuple(model.pieces[k] for k in places),
            own=tuple(model.own[k] for k in places),
        )
        return np.concatenate(some.stress(names, chunks, none))

    whole = having(seen)
    of = [
        (model.pieces[i].effect.id, _share(having([k for k in seen if k != i]), whole))
        for i in made.left_out
    ]
    card = np.concatenate([card_stress(made, c) for c in chunks])
    return Loss(_share(card, whole), tuple(of), over)


def _share(stress: Array, whole: Array) -> float:
    good = np.isfinite(stress) & np.isfinite(whole)
    off = np.linalg.norm(stress[good] - whole[good])
    return float(off / max(float(np.linalg.norm(whole[good])), 1e-300))


def card_stress(made: Card, chunk: Chunk) -> Array:
    """Return the nominal stress (n,), MPa, of a finite-element code with the card."""
    strain = np.asarray(chunk.strain, float)
    if made.flows is not None:
        return simulate(made.flows, [made.young, made.second_MPa], [], [chunk])[0]
    stretch: Array = 1 + np.maximum(strain, -0.95)  # no length is left at -1
    left: Array | float = 1.0
    if made.mullins is not None:
        left = _softened(made, strain, *made.mullins)
    if made.law is not None:
        driven, weights = made.law.driven(strain)
        parts = [left * made.young * x for x in driven]
    else:
        first = left * _curve(made, strain)
        parts = [2 / 3 * first / stretch, -1 / 3 * first * stretch**2]
        weights = stretch, -1 / stretch**2
    if len(made.shares):
        relaxed = Units("wiechert", (0.0, 1.0), tuple(map(float, made.times_s)))
        shares = np.array([1 - made.shares.sum(), *made.shares])
        # A branch answers whatever is imposed: here a stress, in place of a strain.
        parts = simulate(relaxed, shares, [], [replace(chunk, strain=s) for s in parts])
    return np.sum([x * w for x, w in zip(parts, weights, strict=True)], axis=0)


def _curve(made: Card, strain: Array) -> Array:
    """The curve (n,), MPa, going on straight beyond its ends."""
    if made.law is not None:
        return made.young * made.law.curve(strain)
    x, y = made.strain, made.stress_MPa
    below = y[0] + (strain - x[0]) * (y[1] - y[0]) / (x[1] - x[0])
    above = y[-1] + (strain - x[-1]) * (y[-1] - y[-2]) / (x[-1] - x[-2])
    inside = np.interp(strain, x, y)
    return np.where(strain < x[0], below, np.where(strain > x[-1], above, inside))


def _softened(made: Card, strain: Array, r: float, m: float, beta: float) -> Array:
    """The share (n,) of the stress that is left: 1 - erf((W_m - W)/(m + b W_m))/r."""
    fine = np.linspace(min(strain.min(), 0.0), max(strain.max(), 0.0), 2001)
    stress = _curve(made, fine)
    steps = np.diff(fine) * (stress[1:] + stress[:-1]) / 2
    grown = np.concatenate([[0.0], np.cumsum(steps)])
    energy = np.interp(strain, fine, grown) - np.interp(0.0, fine, grown)
    most = np.maximum.accumulate(energy)
    return 1 - erf((most - energy) / np.maximum(m + beta * most, 1e-300)) / r


def programme(model: Stored) -> list[Chunk]:
    """Two cycles at up to three rates, and a hold, in the model's own range."""
    units = model.units
    high = max(units.reach[1], units.reach[0], key=abs)
    used = np.flatnonzero(model.stiffness[units.segments :])
    times = np.array(units.relaxation_times)[used]
    low, long = (times.min(), times.max()) if len(times) else (SECONDS, SECONDS)
    ramps = sorted({low, float(np.sqrt(low * long)), long})
    chunks = [_through([0, high, 0, high, 0], [t] * 4) for t in ramps]
    return [*chunks, _through([0, high / 2, high / 2], [low, max(long, 10 * low)])]


def _through(levels: Sequence[float], seconds: Sequence[float]) -> Chunk:
    corners = np.concatenate([[0.0], np.cumsum(seconds)])
    fractions = np.arange(STEPS) / STEPS
    ramps = [a + (b - a) * fractions for a, b in pairwise(corners)]
    time = np.concatenate([*ramps, corners[-1:]])
    return Chunk(time, np.interp(time, corners, levels))
