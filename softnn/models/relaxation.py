r"""Maxwell branches from a hold: relaxation modulus in, stiffnesses and times out.

A hold is given as time since the strain was reached, ``time_s`` (n,), and stress over
the held strain, ``modulus_MPa`` (n,). In compression both stress and strain are
negative and the modulus is positive. Three methods give
:math:`k_e + \sum_j k_j e^{-t/\tau_j}` (thesis eq. 5.1). They are three points (eq.
5.2), collocation at log-spaced times (eq. 5.3), and non-negative least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from softnn.contracts import Array, InputError

Hold = tuple[Array, Array]  # time_s (n,), modulus_MPa (n,)


@dataclass(frozen=True)
class Relaxation:
    """A fitted relaxation modulus, MPa and s; `rmse` [MPa] on what it was fitted to."""

    equilibrium: float
    stiffness: tuple[float, ...]
    relaxation_time: tuple[float, ...]
    method: str
    rmse: float = float("nan")

    @property
    def branches(self) -> int:
        return len(self.stiffness)

    @property
    def negative(self) -> int:
        """Branches of negative stiffness, which no network of springs can have."""
        return sum(k < 0 for k in self.stiffness)

    @cached_property
    def branch_parameters(self) -> dict[str, float]:
        """Values of stiffness_j and relaxation_time_j for a model of this many."""
        pairs = zip(self.stiffness, self.relaxation_time, strict=True)
        return {
            name: value
            for j, (k, tau) in enumerate(pairs, start=1)
            for name, value in ((f"stiffness_{j}", k), (f"relaxation_time_{j}", tau))
        }

    def scaled(self, share: float) -> Relaxation:
        """The branches at a share of their stiffness; the lone spring is left alone."""
        stiffness = tuple(share * k for k in self.stiffness)
        method = f"{self.method}, times {share:g}"
        return replace(self, stiffness=stiffness, method=method, rmse=float("nan"))

    def modulus(self, time_s: ArrayLike) -> Array:
        """Relaxation modulus (n,), MPa, at time_s (n,) after the strain was reached."""
        time = np.asarray(time_s, dtype=float)
        decays = np.exp(-time[..., None] / np.asarray(self.relaxation_time))
        return self.equilibrium + decays @ np.asarray(self.stiffness)

    def to_dict(self) -> dict[str, object]:
        return {
            "method": self.method,
            "equilibrium_MPa": self.equilibrium,
            "stiffness_MPa": list(self.stiffness),
            "relaxation_time_s": list(self.relaxation_time),
            "rmse_MPa": self.rmse,
            "negative_stiffnesses": self.negative,
        }


def three_points(time_s: ArrayLike, modulus_MPa: ArrayLike) -> Relaxation:
    r"""One branch from start, end and the time of decay to 1/e (thesis eq. 5.2).

    The thesis takes :math:`\tau` where the stress has fallen to 36.8 % of its start.
    That is the time constant of a decay to zero only. Here :math:`\tau` is where the
    decaying part, start minus end, has fallen to 36.8 %. The crossing is interpolated
    between samples. A longer hold gives a better :math:`k_e`. Raises `InputError` for a
    hold that `checked` refuses.

    >>> t = np.linspace(0, 100, 5001)
    >>> fit = three_points(t, 1 + 2 * np.exp(-t / 5))
    >>> [round(v, 3) for v in (fit.equilibrium, *fit.stiffness, *fit.relaxation_time)]
    [1.0, 2.0, 5.0]
    """
    time, modulus = checked(time_s, modulus_MPa)
    start, end = modulus[0], modulus[-1]
    if not start > end:
        raise InputError(
            f"modulus goes from {start:.4g} to {end:.4g} MPa over the hold; three "
            "points need one that falls: cut the hold to where it relaxes"
        )
    level = end + (start - end) / np.e
    after = int(np.argmax(modulus <= level))  # sample 0 is above it
    before = after - 1
    share = (modulus[before] - level) / (modulus[before] - modulus[after])
    tau = time[before] + share * (time[after] - time[before])
    fit = Relaxation(end, (start - end,), (float(tau),), "three points")
    return _scored(fit, time, modulus)


def collocation(
    time_s: ArrayLike,
    modulus_MPa: ArrayLike,
    branches: int,
    first_s: float | None = None,
) -> Relaxation:
    r"""Branches through as many points of the curve, log-spaced in time (eq. 5.3).

    :math:`k_e` is the end of the hold. The relaxation times are the times of
    collocation; they run from `first_s` to the length of the hold. :math:`k_1` is then
    set so that the modulus is right at t = 0. `first_s` defaults to 1 s, the thesis's
    example (six times over the four decades to 10^4 s), or to a hundredth of a hold
    shorter than 100 s.

    Stiffnesses may come out negative. At the end of the hold the equations require the
    decaying part to be zero, which drives the last ones below zero: see
    `Relaxation.negative`.
    """
    time, modulus = checked(time_s, modulus_MPa)
    length = time[-1] - time[0]
    if branches < 1:
        raise InputError(f"{branches} branches; allowed is 1 or more")
    start = min(1.0, length / 100) if first_s is None else first_s
    if not 0 < start < length:
        raise InputError(f"first_s is {start:.4g} s; allowed is 0 to {length:.4g} s")
    # A single time lies in the middle of the decades.
    tau = (
        np.geomspace(start, length, branches)
        if branches > 1
        else np.array([np.sqrt(start * length)])
    )
    equilibrium = modulus[-1]
    level = np.interp(time[0] + tau, time, modulus) - equilibrium
    k = np.linalg.solve(np.exp(-tau[:, None] / tau), level)
    k[0] += modulus[0] - equilibrium - k.sum()
    fit = Relaxation(float(equilibrium), tuple(k.tolist()), tuple(tau.tolist()), "")
    return _scored(fit, time, modulus, "collocation")


def non_negative(
    time_s: ArrayLike,
    modulus_MPa: ArrayLike,
    branches: int,
    ramp_s: float = 0.0,
    times_s: ArrayLike | None = None,
) -> Relaxation:
    r"""Least squares with no stiffness below zero, on a grid of relaxation times.

    The grid is `times_s`, or `branches` times log-spaced from the first step of the
    recording to its length. A ramp of `ramp_s` [s] at a constant rate before the hold
    is allowed for exactly: a branch enters the hold with :math:`k\,(1-e^{-x})/x`, where
    :math:`x` is ramp_s over its relaxation time. Branches that come out at zero stay,
    so the count is the one requested.
    """
    time, modulus = checked(time_s, modulus_MPa)
    since = time - time[0]
    if times_s is None:
        first = float(since[1:][since[1:] > 0].min())
        tau = np.geomspace(max(first, since[-1] * 1e-6), since[-1], branches + 2)[1:-1]
    else:
        tau = np.sort(np.asarray(times_s, dtype=float))
    if tau.size != branches or branches < 1 or not (tau > 0).all():
        raise InputError(
            f"{branches} branches with {tau.size} relaxation times; "
            "allowed is 1 or more, with as many times above 0 s"
        )
    x = ramp_s / tau
    entering = -np.expm1(-x) / x if ramp_s > 0 else np.ones_like(tau)
    design = np.column_stack(
        [np.ones_like(since), entering * np.exp(-since[:, None] / tau)]
    )
    k, residual = nnls(design, modulus)
    rmse = float(residual / np.sqrt(len(modulus)))
    return Relaxation(
        float(k[0]),
        tuple(k[1:].tolist()),
        tuple(tau.tolist()),
        "non-negative least squares",
        rmse,
    )


Method = Callable[[Array, Array, int], Relaxation]


def best_branches(
    hold: Hold, method: Method = collocation, most: int = 10
) -> tuple[Relaxation, list[float]]:
    """The number of branches from 1 to `most` of least RMSE on the hold (thesis 5.4).

    Gives the fit and the RMSE [MPa] of every count.
    """
    fits = [method(*hold, branches) for branches in range(1, most + 1)]
    errors = [fit.rmse for fit in fits]
    return fits[int(np.argmin(errors))], errors


def held_out_branches(
    holds: Sequence[Hold], method: Method = non_negative, most: int = 10
) -> tuple[int, list[float]]:
    """The number of branches that predicts held-out stretches of the data best.

    With several holds each is left out in turn and predicted from the mean of the
    others. A free factor scales the prediction, because specimens differ in stiffness
    more than in relaxation. With one hold, each of five stretches of equal log-time is
    left out and predicted from the rest. Returns the count and the RMSE [MPa] of each.
    """
    if not holds:
        raise InputError("no holds; at least one is needed")
    parts = (
        _by_stretch(*checked(*holds[0])) if len(holds) == 1 else _by_hold(list(holds))
    )
    errors = []
    for branches in range(1, most + 1):
        squares = []
        for train, (time, modulus) in parts:
            predicted = method(*train, branches).modulus(time)
            if len(holds) > 1:
                predicted = predicted * (predicted @ modulus) / (predicted @ predicted)
            squares.append((predicted - modulus) ** 2)
        errors.append(float(np.sqrt(np.mean(np.concatenate(squares)))))
    return int(np.argmin(errors)) + 1, errors


def log_spaced(time_s: ArrayLike, modulus_MPa: ArrayLike, per_decade: int = 20) -> Hold:
    """Means over bins of equal width in log time, so that no decade outweighs another.

    The first sample stays as it is; bins without a sample are left out.
    """
    time, modulus = checked(time_s, modulus_MPa)
    since = time - time[0]
    step = since[since > 0][0]
    bins = np.floor(np.log10(since[since > 0] / step) * per_decade + 1e-9).astype(int)
    head = int((since <= 0).sum())
    bins = np.concatenate([np.full(head, -1), bins])
    kept, index, counts = np.unique(bins, return_inverse=True, return_counts=True)
    del kept
    mean = [np.bincount(index, weights=v) / counts for v in (since, modulus)]
    return mean[0], mean[1]


def mean_hold(holds: Sequence[Hold]) -> Hold:
    """Return the mean modulus [MPa] of several holds over the times [s] they share.

    The times are those of the hold with the most samples there.
    """
    checked_holds = [checked(*hold) for hold in holds]
    if not checked_holds:
        raise InputError("no holds; at least one is needed")
    shifted = [(time - time[0], modulus) for time, modulus in checked_holds]
    end = min(time[-1] for time, _ in shifted)
    grid = max((time[time <= end] for time, _ in shifted), key=len)
    return grid, np.mean([np.interp(grid, *hold) for hold in shifted], axis=0)


def checked(time_s: ArrayLike, modulus_MPa: ArrayLike) -> Hold:
    """Return a hold as two arrays (n,), time [s] and modulus [MPa].

    Raises `InputError` where shapes differ, there are fewer than three samples, a value
    is missing or time decreases.
    """
    time = np.asarray(time_s, dtype=float)
    modulus = np.asarray(modulus_MPa, dtype=float)
    if time.shape != modulus.shape or time.ndim != 1 or len(time) < 3:
        raise InputError(
            f"a hold of time {time.shape} and modulus {modulus.shape}; "
            "allowed is (n,) each, n at least 3"
        )
    if not (np.isfinite(time).all() and np.isfinite(modulus).all()):
        raise InputError("a hold with a missing value; fill the gap or cut it out")
    if (np.diff(time) < 0).any() or not time[-1] > time[0]:
        raise InputError("the times of a hold must increase")
    return time, modulus


def _scored(
    fit: Relaxation, time: Array, modulus: Array, method: str | None = None
) -> Relaxation:
    error = fit.modulus(time - time[0]) - modulus
    return Relaxation(
        float(fit.equilibrium),
        tuple(float(k) for k in fit.stiffness),
        fit.relaxation_time,
        method or fit.method,
        float(np.sqrt(np.mean(error**2))),
    )


def _by_hold(holds: list[Hold]) -> list[tuple[Hold, Hold]]:
    parts = []
    for i, hold in enumerate(holds):
        time, modulus = checked(*hold)
        rest = mean_hold([h for j, h in enumerate(holds) if j != i])
        inside = time - time[0] <= rest[0][-1]
        parts.append((rest, (time[inside] - time[0], modulus[inside])))
    return parts


def _by_stretch(
    time: Array, modulus: Array, number: int = 5
) -> list[tuple[Hold, Hold]]:
    since = time - time[0]
    edges = np.geomspace(since[since > 0][0], since[-1], number + 1)
    stretch = np.clip(np.searchsorted(edges, since, side="right") - 1, 0, number - 1)
    # The ends of the hold fix k_e and the start, so they stay in every training part.
    stretch[[0, -1]] = -1
    return [
        (
            (since[stretch != s], modulus[stretch != s]),
            (since[stretch == s], modulus[stretch == s]),
        )
        for s in range(number)
        if (stretch == s).any()
    ]
