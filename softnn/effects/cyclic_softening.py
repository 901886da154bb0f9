r"""Stiffness that falls with the number of cycles."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import cycles

BAND = 0.05  # share of the largest strain; a smaller return is no reversal


class CyclicSoftening(Effect):
    r"""Fatigue softening: a share of stiffness per decade of cycles.

    .. math:: \sigma \to \sigma \left(1 - c \log_{10}(1 + N)\right)

    loss c per decade, N the number of cycles so far. A cycle of smaller range counts by
    a power of its range over the largest range; power 0 counts all cycles alike (Miner
    1945, doi:10.1115/1.4009458). Half a cycle counts at each turn, or the whole cycle
    when it is closed (`closed` 1). The factor stays above 0.05. Payne and Whittaker
    1972, doi:10.5254/1.3547464, find such logarithmic laws in rubber.

    In a recording: peaks of equal cycles fall, fast at first, then ever more slowly.
    Mistaken for Mullins softening (over after one cycle) and for relaxation (which
    depends on time and heals).
    """

    stage = "material"
    on_return = on_reloading = True
    ports = ("equilibrium", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("loss", "-", -0.2, 0.6, 0.12, meaning="c, share a decade of cycles"),
        Parameter("closed", "-", 0.0, 1.0, 0.0, meaning="1: N counts closed cycles"),
        Parameter("power", "-", 0.0, 6.0, 0.0, meaning="of a cycle's range in N"),
    )
    off = {"loss": 0.0}
    amplitude = "loss"
    shape: tuple[str, ...] = ("closed", "power")
    family = "softening"
    where = "from cycle to cycle at the same amplitude"
    twins = {
        "mullins_softening": "many cycles at one amplitude",
        "relaxation_branch": "the same cycles after a pause, or at another rate",
        "load_cell_drift": "a stretch without load after the cycles",
    }

    @property
    def second_forms(self):
        return (TravelSoftening(), SaturatingSoftening(), PartialSoftening())

    def count(self, p, signal, state):
        from softnn.effects._kernels import reversals

        strain = np.ascontiguousarray(signal.strain)
        sets = max(strain.shape[1], p["power"].size)
        strain = np.ascontiguousarray(np.broadcast_to(strain, (len(strain), sets)))
        state = np.zeros((1, 7)) if state is None else state
        state = np.broadcast_to(state, (sets, 7)).copy()
        done, half = np.empty_like(strain), np.empty_like(strain)
        reversals(strain, BAND, p["power"], state, done, half)
        return (done + (1 - p["closed"]) * half) / 2, state

    def grown(self, p, number):
        """How far the loss has grown after `number` cycles (n, sets), in decades."""
        return np.log10(1 + number)

    def after(self, p, signal, state):
        number, state = self.count(p, signal, state)
        lost = p["loss"] * self.grown(p, number)
        spring, branches = self.shares(p)
        new = signal.having(
            equilibrium=signal.equilibrium * np.maximum(1 - spring * lost, 0.05),
            branches=signal.branches * np.maximum(1 - branches * lost, 0.05),
        )
        return new, state

    def shares(self, p):
        """Shares of the loss in the spring and in the branches, each (sets,)."""
        return 1.0, 1.0

    def starts(self, scales):
        return [
            {"loss": 0.12, "closed": c, "power": k}
            for c in (0.0, 1.0)
            for k in (0.0, 2.0)
        ]

    def telltale(self):
        return cycles([0.5] * 12, 0.2)


class TravelSoftening(CyclicSoftening):
    r"""The same, with cycles counted by travel: N = travel / (2 x range so far)."""

    parameters = CyclicSoftening.parameters[:1]
    shape = ()

    def count(self, p, signal, state):
        last, travel, low, high = (0.0, 0.0, 0.0, 0.0) if state is None else state
        step = np.abs(increments(signal.strain, last))
        travel = travel + np.cumsum(step, axis=0)
        low = np.minimum.accumulate(np.minimum(signal.strain, low))
        high = np.maximum.accumulate(np.maximum(signal.strain, high))
        number = travel / np.maximum(2 * (high - low), 1e-12)
        # The first rise is no cycle yet: any test starts with half a range of travel.
        number = np.maximum(number - 0.5, 0.0)
        return number, (signal.strain[-1:], travel[-1:], low[-1:], high[-1:])

    def starts(self, scales):
        return [{"loss": 0.12}]


class PartialSoftening(CyclicSoftening):
    r"""The same in the spring or in the branches alone, or in both by shares.

    .. math:: \sigma \to \sigma \left(1 - c\,w \log_{10}(1 + N)\right)

    w is 1 for the spring and v for the branches up to v = 1, from there on 2 - v for
    the spring and 1 for the branches. Chains are cut in the network that bears for
    good; filler that breaks down is in the branches (Payne and Whittaker, there).
    """

    parameters = (
        *CyclicSoftening.parameters,
        Parameter("viscous_share", "-", 0.0, 2.0, 1.0, meaning="v, 1 all of both"),
    )

    def shares(self, p):
        share = p["viscous_share"]
        return np.minimum(2 - share, 1), np.minimum(share, 1)

    def starts(self, scales):
        return [
            {"loss": 0.15, "closed": 1.0, "power": k, "viscous_share": v}
            for k in (0.0, 2.0)
            for v in (0.2, 1.8)
        ]


class SaturatingSoftening(PartialSoftening):
    r"""The same where it comes to an end after some cycles.

    .. math:: \sigma \to \sigma \left(1 - c\,w\,(1 - e^{-N / N_0})\right)

    N_0 cycles, w as in spring and branches by shares. Cyclic stress softening of filled
    rubber that levels off, Asare, Thomas and Busfield 2009, doi:10.5254/1.3548263.
    """

    parameters = (
        *PartialSoftening.parameters,
        Parameter("cycles", "-", 0.2, 1e5, 4.0, "log", "N_0"),
    )
    shape = ("closed", "power", "viscous_share", "cycles")

    def grown(self, p, number):
        return -np.expm1(-number / p["cycles"])

    def starts(self, scales):
        return [
            {"loss": 0.12, "closed": 1.0, "power": k, "viscous_share": v, "cycles": 4.0}
            for k in (0.0, 2.0)
            for v in (0.0, 1.0)
        ]
