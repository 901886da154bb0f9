"""Physics that has no name on the list of effects, but is known to be mistaken for it.

A list is never complete. What is named must explain more than these plain laws do:
wear with time under load, structure that breaks with travel or load and heals at rest,
flow that goes one way more easily than the other, crystals that stretch makes, friction
that grows at rest, travel that wobbles.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles

MODES = 3  # of diffusion
OTHER = 1.5  # times as fast out as in, from which it is not the same
GROWN = 0.3  # of what friction is, that it grows by in the longest recording


class Stranger(Effect):
    """A law outside the list; its own id, since no file of `effects` is its own."""

    stage: Literal["rig", "material", "sensor"] = "material"
    called: str
    words: str

    @property
    def id(self):
        return self.called

    def strange(self, values, scales):
        """Whether these values make it something that is on no list."""
        return True

    def telltale(self):
        return cycles([0.5] * 4, 0.2)


class Wear(Stranger):
    r"""Stiffness wears with the time spent under load.

    .. math:: \sigma \to \sigma / (1 + a W), \quad
              W = \int (|\varepsilon| / \varepsilon_0)^p\,\mathrm{d}t

    a in 1/s, power p; epsilon_0 a large strain, of those recorded. Time-dependent
    damage, Kachanov 1958, doi:10.1023/A:1018671022008.
    """

    called = "wear"
    words = "stiffness that wears with the time under load"
    ports = ("equilibrium", "branches")
    parameters = (
        Parameter("rate_per_s", "1/s", -1.0, 1.0, 1e-3, meaning="a"),
        Parameter("power", "-", 0.5, 6.0, 2.0, "log", "p"),
        Parameter("large_strain", "-", 1e-6, 1e3, 1.0, "log", "epsilon_0"),
    )
    off = {"rate_per_s": 0.0}
    amplitude = "rate_per_s"
    shape = ("power", "large_strain")
    where = "after long times under load"
    twins = {
        "load_cell_drift": "a stretch without load: wear waits, drift goes on",
        "cyclic_softening": "the same cycles at rates two decades apart",
        "mullins_softening": "a long hold at one strain between equal cycles",
    }

    def after(self, p, signal, state):
        last, worn = (signal.time_s[0], 0.0) if state is None else state
        step = np.diff(signal.time_s, prepend=last)[:, None]
        load = (np.abs(signal.strain) / p["large_strain"]) ** p["power"]
        worn = worn + np.cumsum(load * step, axis=0)
        factor = 1 / np.maximum(1 + p["rate_per_s"] * worn, 0.1)
        new = replace(
            signal,
            equilibrium=signal.equilibrium * factor,
            branches=signal.branches * factor,
        )
        return new, (signal.time_s[-1], worn[-1:])

    def starts(self, scales):
        total = float(np.sum(scales.duration_s))
        strain = float(np.clip(scales.strain, 1e-6, 1e3))
        return [
            {
                "rate_per_s": min(k / total, 1.0),
                "power": 2.0,
                "large_strain": strain,
            }
            for k in (0.5, 3.0)
        ]


class Structure(Stranger):
    r"""Structure that travel breaks and rest rebuilds (thixotropy).

    .. math:: \sigma \to \sigma (1 - a (1 - \lambda)), \quad
              \dot\lambda = (1 - \lambda)/\tau - k|\dot\varepsilon| \lambda

    Mewis and Wagner 2009, doi:10.1016/j.cis.2008.09.005.
    """

    called = "structure"
    words = "structure that travel breaks and rest rebuilds"
    ports = ("equilibrium", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("share", "-", -0.9, 0.9, 0.2, meaning="a"),
        Parameter("rebuild_s", "s", 1e-2, 1e5, 20.0, "log", "tau"),
        Parameter("breaking", "-", 1e-3, 1e4, 2.0, "log", "k, per strain"),
    )
    off = {"share": 0.0}
    amplitude = "share"
    where = "in motion, less so after every rest"
    twins = {
        "mullins_softening": "the same cycles again after a pause",
        "friction_hysteresis": "the same cycles again after a pause",
        "gain_error": "one recording with a rest in its middle",
    }

    def after(self, p, signal, state):
        from softnn.effects._kernels import structure

        fresh = state is None
        last_time, last, carried = (signal.time_s[0], 0.0, 1.0) if fresh else state
        step = np.diff(signal.time_s, prepend=last_time)
        travel = np.abs(np.diff(signal.strain, axis=0, prepend=last))
        sets = max(travel.shape[1], *(p[k].size for k in ("rebuild_s", "breaking")))
        carried = np.broadcast_to(carried, (sets,)).astype(float)
        out = np.empty((len(step), sets))
        travel = np.ascontiguousarray(travel)
        structure(step, travel, p["rebuild_s"], p["breaking"], carried, out)
        factor = 1 - p["share"] * (1 - out)
        new = replace(
            signal,
            equilibrium=signal.equilibrium * factor,
            branches=signal.branches * factor,
        )
        return new, (signal.time_s[-1], signal.strain[-1:], carried)

    def strange(self, values, scales):
        # What does not heal while it is watched is softening with travel.
        return values["rebuild_s"] < float(np.max(scales.duration_s))

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        return [
            {
                "share": 0.2,
                "rebuild_s": float(np.clip(t * middle, 1e-2, 1e5)),
                "breaking": float(np.clip(k / scales.strain, 1e-3, 1e4)),
            }
            for t in (0.1, 0.5)
            for k in (0.7, 3.0)
        ]


class OneWay(Stranger):
    r"""Fluid in the pores of a slab, drawn in slowly and pressed out quickly.

    .. math:: \dot q_k = w_k \dot\varepsilon - k^2 q_k / \tau, \quad
              \sigma = E \sum q_k, \quad
              \tau = \tau_{in} \text{ while } \sigma > 0, \tau_{in}/r \text{ else}

    k = 1, 3, 5 the first modes of diffusion through the slab, w_k as 1/k^2. Biot 1941,
    doi:10.1063/1.1712886.
    """

    called = "one_way"
    words = "flow that goes one way more easily than the other"
    ports = ("branches",)
    parameters = (
        Parameter("stiffness_MPa", "MPa", -1e6, 1e6, 0.3, meaning="E"),
        Parameter("time_s", "s", 1e-3, 1e6, 8.0, "log", "tau"),
        Parameter("faster", "-", 1.0, 50.0, 4.0, "log", "r"),
    )
    off = {"stiffness_MPa": 0.0}
    amplitude = "stiffness_MPa"
    shape = ("faster",)
    where = "on the way up, gone soon after it turns"
    twins = {
        "relaxation_branch": "holds on the way up and on the way down",
        "grip_slip": "a second cycle to the same strain",
    }

    def after(self, p, signal, state):
        from softnn.effects._kernels import valve

        last_time, last, carried = (
            (signal.time_s[0], 0.0, np.zeros((1, MODES))) if state is None else state
        )
        step = np.diff(signal.time_s, prepend=last_time)
        increment = np.diff(signal.branch_strain, axis=0, prepend=last)
        sets = max(increment.shape[1], *(p[k].size for k in ("time_s", "faster")))
        carried = np.array(np.broadcast_to(carried, (sets, MODES)))
        out = np.empty((len(step), sets))
        increment = np.ascontiguousarray(increment)
        valve(step, increment, p["time_s"], p["faster"], carried, out)
        new = replace(signal, branches=signal.branches + p["stiffness_MPa"] * out)
        return new, (signal.time_s[-1], signal.branch_strain[-1:], carried)

    def strange(self, values, scales):
        # What goes both ways alike is relaxation, and suction holds back.
        return values["stiffness_MPa"] > 0 and bool(values["faster"] > OTHER)

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        size = 0.2 * scales.stress_MPa / scales.strain
        return [
            {
                "stiffness_MPa": size,
                "time_s": float(np.clip(t * middle, 1e-3, 1e6)),
                "faster": 4.0,
            }
            for t in (0.03, 0.1, 0.3)
        ]


class Crystals(Stranger):
    r"""Crystals that form in stretched chains, and melt later than they formed.

    .. math:: \sigma \to \sigma + E c\,\mathrm{sgn}\,\varepsilon, \quad
              \tau \dot c = \max(|\varepsilon| - \varepsilon_0, 0) - c
              \text{ while it grows}, \quad
              \tau \dot c = \max(|\varepsilon| - m \varepsilon_0, 0) - c
              \text{ while it melts}

    Between the two lines nothing changes. Flory 1947, doi:10.1063/1.1746537.
    """

    called = "crystals"
    words = "crystals that form at large strain and melt late on the way back"
    ports = ("equilibrium",)
    parameters = (
        Parameter("stiffness_MPa", "MPa", -1e6, 1e6, 0.3, meaning="E"),
        Parameter("onset", "-", 1e-4, 20.0, 0.5, "log", "epsilon_0"),
        Parameter("melting", "-", 0.0, 1.0, 0.7, meaning="m"),
        Parameter("time_s", "s", 1e-3, 1e6, 3.0, "log", "tau"),
    )
    off = {"stiffness_MPa": 0.0}
    amplitude = "stiffness_MPa"
    shape = ("melting",)
    where = "beyond a strain, and on the way back to well below it"
    twins = {
        "nonlinear_elasticity": "a hold beyond the upturn, and the way back from it",
        "strain_dependent_relaxation": "the way back to just below the upturn",
    }

    def after(self, p, signal, state):
        from softnn.effects._kernels import crystals

        last, carried = (signal.time_s[0], 0.0) if state is None else state
        step = np.diff(signal.time_s, prepend=last)
        sets = max(signal.strain.shape[1], *(v.size for v in p.values()))
        carried = np.broadcast_to(carried, (sets,)).astype(float)
        out = np.empty((len(step), sets))
        strain = np.ascontiguousarray(signal.strain)
        crystals(step, strain, p["onset"], p["melting"], p["time_s"], carried, out)
        stress = p["stiffness_MPa"] * out * np.sign(signal.strain)
        new = replace(signal, equilibrium=signal.equilibrium + stress)
        return new, (signal.time_s[-1], carried)

    def strange(self, values, scales):
        # What comes and goes with strain alone is a spring.
        late = values["melting"] < 0.95 or values["time_s"] > scales.interval_s
        return values["stiffness_MPa"] > 0 and bool(late)

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        size = scales.stress_MPa / scales.strain
        return [
            {
                "stiffness_MPa": 0.3 * size,
                "onset": float(np.clip(k * scales.strain, 1e-4, 20.0)),
                "melting": 0.7,
                "time_s": float(np.clip(t * middle, 1e-3, 1e6)),
            }
            for k in (0.4, 0.6, 0.8)
            for t in (0.01, 0.1)
        ]


class Ageing(Stranger):
    r"""Friction whose contacts grow stronger at rest (stiction).

    .. math:: \sigma \to \sigma + F z, \quad
              z' = \frac{4}{d} \left((1 + a m)\,\mathrm{sgn}\,\dot\varepsilon - z\right)
              |\dot\varepsilon|, \quad
              \dot m = (1 - m)/\tau - |\dot\varepsilon| m / d

    Dieterich 1979, doi:10.1029/JB084iB05p02161, for contacts that age.
    """

    called = "ageing"
    words = "friction that grows at rest"
    ports = ("equilibrium",)
    parameters = (
        Parameter("friction_MPa", "MPa", -1e6, 1e6, 0.03, meaning="F"),
        Parameter("growth", "-", 0.0, 50.0, 2.0, meaning="a"),
        Parameter("time_s", "s", 1e-2, 1e6, 10.0, "log", "tau"),
        Parameter("travel", "-", 1e-5, 10.0, 0.05, "log", "d, strain"),
    )
    off = {"friction_MPa": 0.0}
    amplitude = "friction_MPa"
    shape = ("growth",)
    where = "where motion begins again after a rest, and at turns"
    twins = {
        "friction_hysteresis": "rests of several lengths, each before a start",
        "relaxation_branch": "the same cycles at rates two decades apart",
    }

    def after(self, p, signal, state):
        from softnn.effects._kernels import ageing

        last_time, last, carried = (
            (signal.time_s[0], 0.0, np.zeros((1, 2))) if state is None else state
        )
        step = np.diff(signal.time_s, prepend=last_time)
        increment = np.diff(signal.strain, axis=0, prepend=last)
        sets = max(increment.shape[1], *(v.size for v in p.values()))
        carried = np.array(np.broadcast_to(carried, (sets, 2)))
        out = np.empty((len(step), sets))
        increment = np.ascontiguousarray(increment)
        ageing(step, increment, p["growth"], p["time_s"], p["travel"], carried, out)
        new = replace(signal, equilibrium=signal.equilibrium + p["friction_MPa"] * out)
        return new, (signal.time_s[-1], signal.strain[-1:], carried)

    def strange(self, values, scales):
        # Friction that does not grow while it is watched has a name.
        rest = float(np.max(scales.duration_s))
        grown = values["growth"] * -np.expm1(-rest / values["time_s"])
        return values["friction_MPa"] > 0 and bool(grown > GROWN)

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        return [
            {
                "friction_MPa": 0.02 * scales.stress_MPa,
                "growth": 3.0,
                "time_s": float(np.clip(t * middle, 1e-2, 1e6)),
                "travel": float(np.clip(k * scales.strain, 1e-5, 10.0)),
            }
            for t in (0.03, 0.3)
            for k in (0.02, 0.1, 0.4)
        ]


class Flocs(Structure):
    r"""Structure that load breaks and rest rebuilds (thixotropy with a yield point).

    .. math:: \sigma_b \to \sigma_b (1 - a (1 - \lambda)), \quad
              \sigma_{eq} \to \sigma_{eq} (1 - b a (1 - \lambda)), \quad
              \dot\lambda = (1 - \lambda)/\tau
              - k \max(|\varepsilon| / \varepsilon_0 - 1, 0) \lambda

    Mewis and Wagner 2009, doi:10.1016/j.cis.2008.09.005.
    """

    called = "flocs"
    words = "structure that load breaks and rest rebuilds"
    parameters = (
        Parameter("share", "-", -0.9, 0.9, 0.2, meaning="a"),
        Parameter("rebuild_s", "s", 1e-2, 1e5, 20.0, "log", "tau"),
        Parameter("breaking_per_s", "1/s", 1e-5, 1e3, 0.3, "log", "k"),
        Parameter("yield_strain", "-", 1e-6, 20.0, 0.1, "log", "epsilon_0"),
        Parameter("skeleton", "-", 0.0, 1.0, 0.5, meaning="b"),
    )
    shape = ("yield_strain", "skeleton")
    where = "beyond a load, less so after every rest"
    twins = {
        "mullins_softening": "the same cycles again after a pause",
        "relaxation_branch": "the same cycles again after a pause",
    }

    def after(self, p, signal, state):
        from softnn.effects._kernels import structure

        last_time, carried = (signal.time_s[0], 1.0) if state is None else state
        step = np.diff(signal.time_s, prepend=last_time)
        load = np.maximum(np.abs(signal.strain) / p["yield_strain"] - 1, 0)
        load = np.ascontiguousarray(load * step[:, None])
        sets = max(load.shape[1], *(v.size for v in p.values()))
        carried = np.broadcast_to(carried, (sets,)).astype(float)
        out = np.empty((len(step), sets))
        structure(step, load, p["rebuild_s"], p["breaking_per_s"], carried, out)
        broken = p["share"] * (1 - out)
        new = replace(
            signal,
            equilibrium=signal.equilibrium * (1 - p["skeleton"] * broken),
            branches=signal.branches * (1 - broken),
        )
        return new, (signal.time_s[-1], carried)

    def strange(self, values, scales):
        return values["share"] > 0 and super().strange(values, scales)

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        return [
            {
                "share": 0.2,
                "rebuild_s": float(np.clip(t * middle, 1e-2, 1e5)),
                "breaking_per_s": float(np.clip(k / middle, 1e-5, 1e3)),
                "yield_strain": float(np.clip(0.25 * scales.strain, 1e-6, 20.0)),
                "skeleton": 0.5,
            }
            for t in (0.1, 0.5)
            for k in (3.0, 30.0)
        ]


class Wobble(Stranger):
    r"""A periodic error of travel (a screw, a rack): strain wobbles with strain.

    .. math:: \varepsilon \to \varepsilon
              + A (\sin(2\pi \varepsilon / p + \varphi) - \sin\varphi)

    ISO 230-2:2014 asks for targets within a pitch because of such errors of an axis.
    """

    stage = "rig"
    called = "wobble"
    words = "travel with an error that comes again at equal distances"
    ports = ("strain", "branch_strain")
    parameters = (
        Parameter("size", "-", -1.0, 1.0, 0.01, meaning="A, strain"),
        Parameter("pitch", "-", 1e-4, 20.0, 0.1, "log", "p, strain"),
        Parameter("phase", "rad", -7.0, 7.0, 0.0, meaning="phi"),
    )
    off = {"size": 0.0}
    amplitude = "size"
    where = "at strains a pitch apart"
    twins = {"nonlinear_elasticity": "the same travel from another place of the screw"}

    def before(self, p, signal, state):
        def turned(strain):
            angle = 2 * np.pi * strain / p["pitch"] + p["phase"]
            return strain + p["size"] * (np.sin(angle) - np.sin(p["phase"]))

        new = replace(
            signal,
            strain=turned(signal.strain),
            branch_strain=turned(signal.branch_strain),
        )
        return new, None

    def strange(self, values, scales):
        # What does not come again within the travel is the shape of a spring.
        return bool(values["pitch"] < 0.5 * scales.strain)

    def starts(self, scales):
        return [
            {"size": 0.01 * scales.strain, "pitch": k * scales.strain, "phase": phase}
            for k in np.geomspace(0.08, 0.4, 15)
            for phase in (0.0, np.pi / 2)
        ]


STRANGERS = (Wear(), Structure(), Flocs(), OneWay(), Crystals(), Ageing(), Wobble())


def words(name: str) -> str:
    """What the law `name` is, for a summary."""
    return next(s.words for s in STRANGERS if s.id == name)
