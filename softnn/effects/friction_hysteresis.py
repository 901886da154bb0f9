r"""Rate-independent friction inside the material or against the rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import cycles

# Radii of the stop elements, in units of the presliding strain.
RATIOS = np.array([0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0])
PARTS = np.array([0.03, 0.08, 0.16, 0.28, 0.44, 0.64, 0.87])  # of the largest radius


class FrictionHysteresis(Effect):
    r"""A loop that is as wide at every rate: elastic-perfectly plastic elements.

    .. math:: \sigma \to \sigma + F (1 + \beta|\varepsilon|) \sum_k w_k z_k, \qquad
              z_k = \mathrm{clip}(z_k + d\varepsilon / r_k, -1, 1)

    friction F in MPa (half the height of the loop), presliding strain r, growth beta
    per unit of strain. Radii r_k are r times 1/8 to 8. Weights w_k sum to one and are
    log-normal about 1, with `spread` in octaves. The presliding strain is 15 % at most;
    what slides later counts as plastic (`permanent_set`). Stop operators of
    Prandtl and Ishlinskii; Krasnosel'skii and Pokrovskii 1989,
    doi:10.1007/978-3-642-61302-9.

    In a recording: an upper and a lower branch at a constant distance, whatever the
    rate, and no relaxation. Mistaken for viscosity where there is only one rate.
    """

    stage = "material"
    on_return = True
    ports = ("equilibrium",)
    parameters: tuple[Parameter, ...] = (
        Parameter("friction_MPa", "MPa", 0.0, 1e4, 0.05, meaning="F"),
        Parameter(
            "presliding", "-", 1e-5, 0.15, 0.02, "log", "r, strain to full slip", -1
        ),
        Parameter("spread", "-", 0.05, 4.0, 0.3, "log", "octaves over which r spreads"),
        Parameter(
            "growth",
            "-",
            -1.0,
            50.0,
            0.0,
            meaning="beta, per unit of strain",
            per_strain=1,
        ),
    )
    off: Mapping[str, float] = {"friction_MPa": 0.0}
    amplitude = "friction_MPa"
    shape: tuple[str, ...] = ("spread", "growth")
    where = "after every reversal, alike at every rate"
    twins = {
        "relaxation_branch": "the same cycle at rates two decades apart, or a hold",
        "nonlinear_viscosity": "the same cycle at rates two decades apart, or a hold",
        "mullins_softening": "small cycles inside a large one",
    }

    @property
    def second_forms(self):
        return (BoucWen(), WallFriction(), GrownFriction(), JointFriction())

    def after(self, p, signal, state):
        loop, state = self.loop(p, signal, state)
        return self._added(p, signal, loop), state

    def loop(self, p, signal, state):
        """State of the sliding elements (n, sets), from -1 to 1, and what to carry."""
        from softnn.effects._kernels import stops

        last, carried = (0.0, None) if state is None else state
        increment = increments(signal.strain, last)
        radius, weight = self.elements(p)
        sets = max(increment.shape[1], len(radius))
        if carried is None:
            carried = np.zeros((sets, weight.shape[1]))
        carried = np.broadcast_to(carried, (sets, weight.shape[1])).copy()
        out = np.empty((len(increment), sets))
        stops(increment, radius, weight, carried, out)
        return out, (signal.strain[-1:], carried)

    def elements(self, p):
        """Radii, as strains, and the weights of the elements, each (sets, elements)."""
        radius, spread = np.broadcast_arrays(p["presliding"], p["spread"])
        weight = np.exp(-0.5 * (np.log2(RATIOS) / spread[:, None]) ** 2)
        return radius[:, None] * RATIOS, weight / weight.sum(axis=1, keepdims=True)

    @staticmethod
    def _added(p, signal, loop):
        size = p["friction_MPa"] * np.maximum(
            1 + p["growth"] * np.abs(signal.strain), 0
        )
        return signal.having(equilibrium=signal.equilibrium + size * loop)

    def starts(self, scales):
        return [
            {
                "friction_MPa": 0.08 * scales.stress_MPa,
                "presliding": float(np.clip(r * scales.strain, 1e-5, 0.15)),
                "spread": spread,
                "growth": 0.0,
            }
            for spread in (0.3, 1.5)
            for r in (0.03, 0.01, 0.1, 0.3)
        ]

    def telltale(self):
        return cycles([0.3, 0.6, 0.6], 0.05, floor=0.1)


class BoucWen(FrictionHysteresis):
    r"""The same loop as a differential equation, sharp or rounded.

    .. math:: dz = \frac{d\varepsilon}{r}
              \left(1 - |z|^n \,[z\,d\varepsilon > 0]\right)

    Bouc 1967; Wen 1976, doi:10.1061/JMCEA3.0002106 (beta = gamma = 1/2). n = 1 is
    Dahl's friction.
    """

    parameters = (
        *FrictionHysteresis.parameters[:2],
        Parameter("sharpness", "-", 0.3, 20.0, 1.0, "log", "n of the transition"),
        FrictionHysteresis.parameters[3],
    )
    shape = ("sharpness", "growth")

    def loop(self, p, signal, state):
        from softnn.effects._kernels import bouc_wen

        last, carried = (0.0, 0.0) if state is None else state
        increment = increments(signal.strain, last)
        radius, power = p["presliding"], p["sharpness"]
        sets = max(increment.shape[1], radius.size, power.size)
        carried = np.broadcast_to(carried, (sets,)).copy()
        out = np.empty((len(increment), sets))
        bouc_wen(increment, radius, power, carried, out)
        return out, (signal.strain[-1:], carried)

    def starts(self, scales):
        plain = super().starts(scales)
        return [
            {k: v for k, v in s.items() if k != "spread"} | {"sharpness": 1.0}
            for s in plain[:4]
        ]


class WallFriction(FrictionHysteresis):
    r"""Coulomb friction against a wall that the specimen presses on as it is loaded.

    .. math:: \sigma \to \sigma + \mu\,|\sigma_{spring}| \sum_k w_k z_k

    In a tube the wall pressure is proportional to the axial stress. So friction grows
    with the stress and starts with contact. mu is the coefficient of friction times the
    ratio of wall pressure to axial stress. Janssen 1895, translated by Sperl 2006,
    doi:10.1007/s10035-005-0224-z.
    """

    parameters = (
        Parameter("coefficient", "-", 0.0, 2.0, 0.1, meaning="mu, over axial stress"),
        *FrictionHysteresis.parameters[1:3],
    )
    off = {"coefficient": 0.0}
    amplitude = "coefficient"
    shape = ("spread",)

    @staticmethod
    def _added(p, signal, loop):
        pressure = np.abs(signal.equilibrium)
        return signal.having(
            equilibrium=signal.equilibrium + p["coefficient"] * pressure * loop,
        )

    def starts(self, scales):
        return [
            {"coefficient": 0.1, "presliding": s["presliding"], "spread": s["spread"]}
            for s in super().starts(scales)
        ]


class GrownFriction(FrictionHysteresis):
    r"""Friction that grows with the largest strain so far.

    .. math:: \sigma \to \sigma + F\,\varepsilon_m \sum_k w_k z_k, \qquad
              \varepsilon_m = \max_{s \le t} |\varepsilon|

    friction F in MPa at a largest strain of 1: surfaces torn open by loading rub. In
    Besdo and Ihlemann 2003, doi:10.1016/S0749-6419(02)00091-8, the limits of the
    hysteresis grow with the largest strain so far.
    """

    parameters = (
        Parameter("friction_MPa", "MPa", 0.0, 1e5, 0.1, meaning="F", per_strain=1),
        *FrictionHysteresis.parameters[1:3],
    )
    shape = ("spread",)

    def after(self, p, signal, state):
        top, state = (0.0, None) if state is None else state
        largest = np.maximum.accumulate(np.maximum(np.abs(signal.strain), top))
        loop, state = self.loop(p, signal, state)
        new = signal.equilibrium + p["friction_MPa"] * largest * loop
        return signal.having(equilibrium=new), (largest[-1:], state)

    def starts(self, scales):
        return [
            {
                "friction_MPa": s["friction_MPa"] / scales.strain,
                "presliding": s["presliding"],
                "spread": s["spread"],
            }
            for s in super().starts(scales)[:2]
        ]


class JointFriction(FrictionHysteresis):
    r"""A joint that slides gradually: presliding strains follow a power law.

    .. math:: \sigma \to \sigma + F \sum_k w_k z_k, \qquad
              w_k \propto r_k^{1 + \chi}, \quad 0 < r_k < r

    presliding strain r, at which the whole joint slides. All elements have one
    stiffness; the density of their presliding strains is a power law of exponent chi.
    Segalman 2005, doi:10.1115/1.1867504, after Iwan 1966, doi:10.1115/1.3625199.
    """

    parameters = (
        FrictionHysteresis.parameters[0],
        Parameter("presliding", "-", 1e-5, 0.3, 0.1, "log", "r, strain to slip", -1),
        Parameter("power", "-", -0.95, 3.0, -0.3, meaning="chi of the reaches"),
    )
    shape = ("power",)

    def elements(self, p):
        radius, power = np.broadcast_arrays(p["presliding"], p["power"])
        ends = np.concatenate([[0.0], (PARTS[1:] + PARTS[:-1]) / 2, [1.0]])
        weight = np.diff(ends ** (2 + power[:, None]), axis=1)
        return radius[:, None] * PARTS, weight / weight.sum(axis=1, keepdims=True)

    @staticmethod
    def _added(p, signal, loop):
        new = signal.equilibrium + p["friction_MPa"] * loop
        return signal.having(equilibrium=new)

    def starts(self, scales):
        return [
            {
                "friction_MPa": 0.08 * scales.stress_MPa,
                "presliding": float(np.clip(r * scales.strain, 1e-5, 0.3)),
                "power": -0.3,
            }
            for r in (0.03, 0.1, 0.3)
        ]
