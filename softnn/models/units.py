r"""Unit responses of a base simulation: one column a spring segment, one a branch.

Every base here is a sum of columns with non-negative stiffnesses: springs
``clip(strain - knot, 0, width)`` (thesis eq. 5.7) and Maxwell branches of fixed
relaxation time. So a fit can solve for the stiffnesses exactly, and a score test can
compute how much they could absorb. The update of a branch is the exact one of
`softnn.models.branches`. Each branch keeps its own column; decays over a history are
computed once and used for many strains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError, Parameter, increments
from softnn.models.base import Base

BASES = ("hooke", "sls", "wiechert", "pl-sls", "pl-wiechert")


@dataclass(frozen=True)
class Units(Base):
    """Knots (segments + 1,) of the spring, relaxation times (branches,) in s.

    The two outermost segments extend without limit: strain beyond the knots meets the
    stiffness of the outermost segment.

    >>> base = Units("sls", (0.0, 1.0), (2.0,))
    >>> from softnn.contracts import Chunk
    >>> hold = Chunk(np.array([0.0, 2.0]), np.array([0.1, 0.1]))
    >>> base.respond(hold)[1].round(4).ravel().tolist()
    [0.1, 0.0368]
    """

    name: str
    knots: tuple[float, ...]
    relaxation_times: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.knots) < 2 or not (np.diff(self.knots) > 0).all():
            raise InputError(
                f"knots are {self.knots}; they must increase, two at least"
            )
        if len(self.knots) > 2 and 0.0 not in self.knots:
            raise InputError("no knot at zero strain; the stress is zero there")
        if any(not t > 0 for t in self.relaxation_times):
            raise InputError("relaxation times must be above 0 s")

    @property
    def segments(self) -> int:
        return len(self.knots) - 1

    @property
    def reach(self) -> tuple[float, float]:
        return self.knots[0], self.knots[-1]

    @property
    def corners(self) -> Array:
        return np.array(self.knots)

    @property
    def has(self) -> frozenset[str]:
        branches = {"relaxation_branch"} if self.name.endswith("wiechert") else set()
        bends = {"nonlinear_elasticity"} if self.name.startswith("pl-") else set()
        return frozenset(branches | bends)

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        """The relaxation time [s] of an SLS; other bases have a grid of them."""
        if not self.name.endswith("sls"):
            return ()
        return tuple(
            Parameter(f"relaxation_time_{j}", "s", t / 1e4, t * 1e4, t, "log")
            for j, t in enumerate(self.relaxation_times)
        )

    def having(self, values: Mapping[str, float]) -> Units:
        times = list(self.relaxation_times)
        for name, value in values.items():
            times[int(name.rpartition("_")[2])] = value
        return replace(self, relaxation_times=tuple(times))

    def only(self, branches: NDArray[np.integer]) -> Units:
        times = np.array(self.relaxation_times)[branches]
        return replace(self, relaxation_times=tuple(times.tolist()))

    def to_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "knots": [float(k) for k in self.knots],
            "relaxation_times_s": [float(t) for t in self.relaxation_times],
        }

    def finer(self) -> Units:
        """The same base with a knot between any two, and a time where it has a grid.

        Two times more are shorter than the first: branches too fast for the clock.

        >>> Units("pl-wiechert", (0.0, 1.0, 2.0), (1.0, 4.0)).finer()
        Units(name='pl-wiechert', knots=(0.0, 0.5, 1.0, 1.5, 2.0), \
relaxation_times=(0.25, 0.5, 1.0, 2.0, 4.0))
        """
        knots, times = np.array(self.knots), np.array(self.relaxation_times)
        if self.segments > 1:
            knots = np.sort(np.append(knots, (knots[1:] + knots[:-1]) / 2))
        if self.name.endswith("wiechert") and len(times):
            times = np.sort(np.append(times, np.sqrt(times[1:] * times[:-1])))
            times = np.append(times[0] / np.array([4.0, 2.0]), times)
        return replace(
            self, knots=tuple(knots.tolist()), relaxation_times=tuple(times.tolist())
        )

    def springs(self, strain: Array) -> Array:
        """Strain taken by each segment, (n, segments); the sum is the strain."""
        if self.segments == 1:
            return np.array(strain)[:, None]
        low, high, start = self._ends
        return np.minimum(np.maximum(strain[:, None], low), high) - start

    def spring_stress(self, strain: Array, stiffness: Array) -> Array:
        """Stress of the springs at any strain: `springs` times stiffness (segments,).

        >>> base = Units("pl-sls", (0.0, 1.0, 2.0))
        >>> base.spring_stress(np.array([-1.0, 3.0]), np.array([2.0, 4.0])).tolist()
        [-2.0, 10.0]
        """
        if self.segments == 1:
            return strain * stiffness[0]
        knots = np.array(self.knots)
        # Straight between the knots, and beyond them on the outermost segments.
        out = np.interp(strain, knots, self.springs(knots) @ stiffness)
        out += stiffness[0] * np.minimum(strain - knots[0], 0)
        return out + stiffness[-1] * np.maximum(strain - knots[-1], 0)

    def undamped(self, strain: Array) -> Array:
        return strain

    def branch_stress(
        self,
        decays: tuple[Array, Array],
        strain: Array,
        stiffness: Array,
        state: tuple[Array, Array] | None = None,
    ) -> tuple[Array, tuple[Array, Array]]:
        """Stress (n, sets) of all branches for strains (n, sets), and the state.

        Stress is in the unit of `stiffness` (branches,), MPa. The state is the last
        strain (sets,) and the carried unit stresses; None is rest.
        """
        from softnn.models.unit_kernel import borne

        used, sets = np.flatnonzero(stiffness), strain.shape[1]
        decay, gain = (np.ascontiguousarray(d[:, used]) for d in decays)
        last, carried = (np.zeros(sets), None) if state is None else state
        carried = np.zeros((sets, len(used))) if carried is None else carried.copy()
        increment = increments(strain, last)
        out = np.zeros(strain.shape)
        borne(decay, gain, increment, stiffness[used], carried, out)
        return out, (strain[-1], carried)

    @cached_property
    def _ends(self) -> tuple[Array, Array, Array]:
        """Low and high end of each segment, and the strain at which it takes none."""
        low, high = np.array(self.knots[:-1]), np.array(self.knots[1:])
        start = np.where(low >= 0, low, high)  # the end nearer to zero strain
        low[0], high[-1] = -np.inf, np.inf
        return low, high, np.clip(start, low, high)

    def branches(
        self, decays: tuple[Array, Array], strain: Array, state: Any = None
    ) -> tuple[Array, Any]:
        """Return unit branch stresses (n, branches) for `strain`, and the state.

        The state is the last strain and the carried unit stresses.
        """
        from softnn.models.unit_kernel import maxwell

        before, carried = (
            (0.0, np.zeros(len(self.relaxation_times))) if state is None else state
        )
        out = np.empty((len(strain), len(self.relaxation_times)))
        maxwell(*decays, increments(strain, before), carried, out)
        return out, (float(strain[-1]), out[-1].copy())

    def in_c(self, stiffness: Array) -> tuple[str, dict[str, Any]]:
        springs = stiffness[: self.segments]
        # A single spring is a line through the origin, wherever its ends are.
        knots = np.array(self.knots) if self.segments > 1 else np.zeros(2)
        return "", {
            "segments": len(springs),
            "last": len(springs) - 1,
            "knots": knots[:-1],
            "at": (self.springs(knots) @ springs)[:-1],
            "slopes": springs,
        }


def build(
    name: str,
    strain_low: float,
    strain_high: float,
    interval_s: float,
    duration_s: float,
    segments: int = 16,
    per_decade: int = 7,
) -> Units:
    """Return the base `name` over a range of strain and of time.

    Relaxation times [s] are logarithmic, `per_decade` each decade, from the sampling
    interval to three times the longest recording. Branches outside these limits are
    indistinguishable from springs. The single branch of an SLS starts in the middle; a
    fit moves it.
    """
    if name not in BASES:
        raise InputError(f"no base {name!r}; allowed is one of {list(BASES)}")
    low, high = min(strain_low, 0.0), max(strain_high, 0.0)
    if not high > low:
        raise InputError("the strain never leaves zero; there is nothing to simulate")
    knots: tuple[float, ...] = (low, high)
    if name.startswith("pl-"):
        above = max(round(segments * high / (high - low)), 1) if high > 0 else 0
        below = max(segments - above, 1) if low < -0.05 * high else 0
        parts = [np.linspace(low, 0, below + 1)] if below else [np.zeros(1)]
        if above:
            parts.append(np.linspace(0, high, above + 1)[1:])
        knots = tuple(float(k) for k in np.concatenate(parts))
    times: tuple[float, ...] = ()
    shortest, longest = interval_s, 3 * max(duration_s, 2 * interval_s)
    if name.endswith("sls"):
        times = (float(np.sqrt(shortest * longest)),)
    elif name.endswith("wiechert"):
        count = max(int(np.ceil(per_decade * np.log10(longest / shortest))), 2)
        times = tuple(float(t) for t in np.geomspace(shortest, longest, count))
    return Units(name, knots, times)
