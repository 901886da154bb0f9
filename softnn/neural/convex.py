r"""A network whose units are springs and Maxwell branches: it holds at unseen rates.

A network of free tanh units answers anything beyond its training. Here physics limits
each unit, and the fit has one minimum. The strain and time of the recordings fix the
units and their history; the stiffnesses are non-negative least squares. After Linka and
Kuhl (2023, doi:10.1016/j.cma.2022.115731) and, with branches, Abdolazizi, Linka and
Cyron (2024, doi:10.1016/j.jcp.2023.112704).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from softnn.contracts import Array, InputError
from softnn.neural.network import Network, Scaling
from softnn.recording import Recording

SPRINGS = 12  # that engage one after the other, at quantiles of the strain
LIMITS = (0.3, 0.1, 0.03)  # of the largest strain, at which a branch's strain saturates
SHORTEST, LONGEST = 1 / 30, 3.0  # relaxation times, by the shortest and longest history
SMOOTH = 1e-4  # weight of the squared stiffnesses of springs, columns of unit size
# All ways to use measures, holds and decays are fitted; `study.holding` weighs them.
MEASURES = ("straight", "saturating")  # strain of the branches
HOLDS = ("without holds", "holds lightly", "with holds", "shape of holds")
DECAYS = {"light": 1e-3, "heavy": 1e-1}  # weights of the branches' squared stiffnesses
LIGHTLY = 0.1  # weight of all holds; that of all loading curves is 1
REACHED = 0.995  # of the held strain, where a hold starts
WAYS = tuple(product(MEASURES, HOLDS, DECAYS))


@dataclass(frozen=True)
class ConvexNetwork(Network):
    r"""Springs, and branches with a strain measure that may saturate.

    .. math:: \sigma = \sum_i w_i u_i, \qquad
              x_i = H(\varepsilon - \varepsilon_i)(\varepsilon - \varepsilon_i), \qquad
              \psi_i = L_i (1 - e^{-|x_i| / L_i})\, \mathrm{sign}\, x_i

    A spring says :math:`u = \psi`, a branch :math:`\dot u = \dot\psi - u / \tau_i`.
    hidden (s, 3): knot, limit L (0: none) and relaxation time [s] (0: a spring) of each
    unit; output (s + 1,): stiffnesses [MPa] and, last, 0. A knot below zero engages in
    compression, one at zero both ways. Inputs are strain and time [s] of one history,
    in order; nothing is normalised.
    """

    def predict(self, inputs: Array) -> Array:
        """Stress (n,) in MPa of one history, inputs (n, 2)."""
        return self.layer(inputs) @ self.output[:-1] + self.output[-1]

    def at(self, asked: np.ndarray, inputs: Array, recording: np.ndarray) -> Array:
        out = np.empty(len(inputs))
        for one in np.unique(recording[asked]):
            mine = recording == one
            out[mine] = self.predict(inputs[mine])
        return out[asked]

    def layer(self, inputs: Array) -> Array:
        strain, time = np.asarray(inputs, float).T
        return units(strain, time, self.hidden)

    @property
    def springs(self) -> int:
        """Number of units without memory; the others are branches."""
        return int(np.sum(self.hidden[:, 2] == 0))


def units(strain: Array, time_s: Array, table: Array) -> Array:
    """Return the outputs (n, s) of units (s, 3) of a `ConvexNetwork` for a history."""
    knot, limit, time = np.asarray(table, float).T
    away = strain[:, None] - knot
    engaged = np.where(knot > 0, np.maximum(away, 0), np.minimum(away, 0))
    engaged = np.where(knot == 0, away, engaged)
    size = np.where(limit > 0, limit, 1.0)
    bent = np.sign(engaged) * size * -np.expm1(-np.abs(engaged) / size)
    out = np.where(limit > 0, bent, engaged)
    slow = time > 0
    out[:, slow] -= behind(out[:, slow], time_s, time[slow])
    return out


def behind(values: Array, time_s: Array, times: Array) -> Array:
    """Values (n, s) behind low-pass filters of time constants (s,); 0 at the start.

    Exact for values that are straight between samples, as
    `softnn.neural.history.filtered`.
    """
    step = np.diff(time_s)[:, None]
    decay = np.exp(-step / times)
    rest = np.where(step > 0, -np.expm1(-step / times) * times, 1.0)
    gained = rest / np.where(step > 0, step, 1.0)
    out = np.zeros_like(values)
    rise = np.diff(values, axis=0) * gained
    for i in range(1, len(values)):
        now = values[i]
        out[i] = now - (values[i - 1] - out[i - 1]) * decay[i - 1] - rise[i - 1]
    return out


def network(table: Array, weights: Array, seen: Iterable[Recording]) -> ConvexNetwork:
    """A network of units (s, 3) with stiffnesses (s,); equal units become one."""
    rows, of = np.unique(table, axis=0, return_inverse=True)
    sums = np.bincount(of.ravel(), weights, len(rows))
    used = sums != 0
    ends = [(r.strain, r.time_s, r.stress_MPa) for r in seen]
    strain, time, stress = (np.concatenate(one) for one in zip(*ends, strict=True))
    inputs = np.column_stack([strain, time])
    known = np.isfinite(inputs).all(axis=1) & np.isfinite(stress)
    return ConvexNetwork(
        rows[used],
        np.append(sums[used], 0.0),
        Scaling.of(inputs[known]),
        Scaling.of(stress[known]),
    )


def mixed(
    members: Mapping[str, ConvexNetwork],
    weights: Mapping[str, float],
    seen: Iterable[Recording],
) -> ConvexNetwork:
    """Return the weighted mean of networks, which is a network of the same kind."""
    some = [(members[name], weight) for name, weight in weights.items() if weight]
    table = np.concatenate([one.hidden for one, _ in some])
    return network(
        table, np.concatenate([one.output[:-1] * w for one, w in some]), seen
    )


def fitted(
    curves: Sequence[Recording], holds: Sequence[Recording] = ()
) -> dict[str, ConvexNetwork]:
    """Return a network fitted in each of `WAYS`, by name.

    The fit minimises the squared NRMSE of all samples of `curves` and that of the
    holds. A hold counts by its stress, or by its shape alone: the stress over the
    stress at its start, which does not depend on the scale of the specimen. Without
    holds, only the ways without them are fitted.
    """
    if not curves:
        raise InputError("no curves; at least one is needed")
    strain = np.concatenate([r.strain for r in curves])
    side = -1.0 if np.median(strain) < 0 else 1.0
    size = np.abs(strain)
    lengths = [float(r.time_s[-1] - r.time_s[0]) for r in [*curves, *holds]]
    if not (size.max() > 0 and min(lengths) > 0):
        raise InputError("strain never leaves zero, or time stands still")
    knots = np.quantile(size[size > 0], np.linspace(0, 1, SPRINGS + 1)[1:-1])
    low, high = min(lengths) * SHORTEST, max(lengths) * LONGEST
    times = np.geomspace(low, high, max(2, int(np.log10(high / low)) + 1))
    limits = [0.0, *(size.max() * part for part in LIMITS)]
    table = np.array(
        [(0.0, 0.0, 0.0)]
        + [(side * knot, 0.0, 0.0) for knot in knots]
        + [(0.0, limit, time) for time in times for limit in limits]
    )
    task = _Task(table, len(knots) + 1, curves, holds)
    return {
        f"convex, {measure}, {how}, {decay}": network(
            table, task.solved(measure, how, DECAYS[decay]), curves
        )
        for measure, how, decay in WAYS
        if holds or how == HOLDS[0]
    }


class _Task:
    """The least squares of `fitted`; all ways with the same holds share the sums."""

    def __init__(
        self,
        table: Array,
        springs: int,
        curves: Sequence[Recording],
        holds: Sequence[Recording],
    ) -> None:
        self.table, self.springs = table, springs
        total = np.sqrt(sum(float(np.sum(r.stress_MPa**2)) for r in curves))
        self.curves = self._triangle([_said(r, table) / total for r in curves])
        self.holds = {HOLDS[0]: self.curves}
        if holds:
            rows = [_said(r, table) for r in holds]
            size = [np.linalg.norm(x[:, -1]) * np.sqrt(len(holds)) for x in rows]
            alike = [x / s for x, s in zip(rows, size, strict=True)]
            shape = [
                _shape(x, r) / s for x, r, s in zip(rows, holds, size, strict=True)
            ]
            for how, part in zip(
                HOLDS[1:],
                ([np.sqrt(LIGHTLY) * x for x in alike], alike, shape),
                strict=True,
            ):
                self.holds[how] = self._triangle([self.curves, *part])

    @staticmethod
    def _triangle(rows: Sequence[Array]) -> Array:
        return np.asarray(np.linalg.qr(np.vstack(rows), mode="r"))

    def solved(self, measure: str, how: str, decay: float) -> Array:
        """Return stiffnesses (s,); those of branches are not below zero."""
        straight = (self.table[:, 2] == 0) | (self.table[:, 1] == 0)
        used = np.flatnonzero(straight | (measure != MEASURES[0]))
        rows, m = self.holds[how], self.springs
        columns, target = rows[:, used], rows[:, -1:]
        size = np.sqrt(np.sum(columns**2, axis=0))
        size[size == 0] = 1.0
        weight = np.full(len(used), np.sqrt(decay))
        weight[0], weight[1:m] = 0.0, np.sqrt(SMOOTH)
        ridge = np.column_stack([np.diag(weight), np.zeros(len(used))])
        both = np.vstack([np.column_stack([columns / size, target]), ridge])
        triangle = np.asarray(np.linalg.qr(both, mode="r"))
        branches, _ = nnls(triangle[m:, m:-1], triangle[m:, -1], maxiter=10_000)
        left = triangle[:m, -1] - triangle[:m, m:-1] @ branches
        out = np.zeros(len(self.table))
        springs = solve_triangular(triangle[:m, :m], left)
        out[used] = np.concatenate([springs, branches]) / size
        return out


def _said(recording: Recording, table: Array) -> Array:
    """Return the outputs of the units, and last the stress (n, s + 1)."""
    said = units(recording.strain, recording.time_s, table)
    return np.column_stack([said, recording.stress_MPa])


def _shape(rows: Array, hold: Recording) -> Array:
    """Return rows (n, s) of a hold that ask for its shape, whatever its scale.

    r is the measured stress over the measured stress at the start. The stress of the
    units less r times their stress at the start should be 0.
    """
    size = np.abs(hold.strain)
    start = int(np.argmax(size >= REACHED * np.median(size[len(size) // 2 :]))) + 1
    start = max(0, min(start, len(size) - 3))
    after = rows[start:]
    if after[0, -1] == 0:
        return after[:0]  # no stress, no shape
    return after - rows[start] * (after[:, -1:] / after[0, -1])
