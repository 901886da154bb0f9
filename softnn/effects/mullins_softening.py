r"""Softer on reloading below the largest strain so far: the Mullins effect."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import cycles

EARLY = 0.2  # of the largest strain: damage complete below it is a failing joint


class MullinsSoftening(Effect):
    r"""Stress softening below the largest strain reached (Ogden and Roxburgh).

    .. math:: \eta = 1 - d \;\mathrm{erf}\!\left(
              \frac{|\varepsilon_m|^q - |\varepsilon|^q}
                   {s\,(c^q + |\varepsilon_m|^q)}\right), \qquad
              \varepsilon_m = \max_{s \le t} |\varepsilon|

    viscous_share v in [0, 2] divides the damage. Up to v = 1 the spring is multiplied
    by eta and the branches by 1 - v (1 - eta). Beyond v = 1 the branches are multiplied
    by eta, and the spring loses less, nothing at v = 2. Depth d in [0, 1] is 1/r of the
    source; s c^q is its m. Sharpness s is the beta of the form m + beta W_m that
    finite-element codes use. The energy W is assumed proportional to a power q of the
    strain, so eta does not depend on the stress. q is 2 for a straight stress-strain
    curve, less for one that bends over, as foam does. Ogden and Roxburgh 1999,
    doi:10.1098/rspa.1999.0431.

    In a recording: the second loading to the same strain lies below the first, and
    meets it at the largest strain so far. Mistaken for a set (which shifts), friction
    (the second loop is as wide as the first) and relaxation (which a pause heals).
    """

    stage = "material"
    on_return = on_reloading = True
    ports = ("equilibrium", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("depth", "-", 0.0, 1.0, 0.4, meaning="d, loss of stiffness at most"),
        Parameter(
            "scale", "-", 1e-3, 10.0, 0.1, "log", "c, strain of full softening", -1
        ),
        Parameter("sharpness", "-", 0.02, 10.0, 0.7, "log", "s, how late it comes"),
        Parameter(
            "viscous_share",
            "-",
            0.0,
            2.0,
            1.0,
            meaning="v: 0 springs alone, 1 all stress, 2 branches alone",
        ),
        Parameter("power", "-", 0.5, 4.0, 2.0, "log", "q, energy over strain"),
    )
    off = {"depth": 0.0}
    amplitude = "depth"
    shape: tuple[str, ...] = ("sharpness", "viscous_share", "power")
    family = "softening"
    where = "on reloading and unloading below the largest strain so far"
    twins = {
        "permanent_set": "reloading to near zero strain, where a set stays",
        "cyclic_softening": "many cycles at one amplitude",
        "friction_hysteresis": "small cycles inside a large one",
        "nonlinear_viscosity": "a second cycle after a pause",
    }

    @property
    def second_forms(self):
        return (SimoDamage(), BeattySoftening(), EnergySoftening())

    def factor(self, p, strain, largest):
        power = p["power"]
        top, now = largest**power, np.abs(strain) ** power
        reach = (top - now) / (p["scale"] ** power + top)
        return 1 - p["depth"] * erf(np.maximum(reach, 0) / p["sharpness"])

    def after(self, p, signal, state):
        size = np.abs(signal.strain)
        largest = np.maximum.accumulate(np.maximum(size, 0 if state is None else state))
        factor = self.factor(p, signal.strain, largest)
        return self.softened(p, signal, 1 - factor), largest[-1:]

    @staticmethod
    def softened(p, signal, lost):
        """Signal less the share `lost` of its stress, in spring and branches by v."""
        share = p["viscous_share"]
        spring = 1 - np.minimum(2 - share, 1) * lost
        slow = 1 - np.minimum(share, 1) * lost
        return signal.having(
            equilibrium=signal.equilibrium * spring,
            branches=signal.branches * slow,
        )

    def starts(self, scales):
        return [
            {
                "depth": 0.35,
                "scale": float(np.clip(c * scales.strain, 1e-3, 10)),
                "sharpness": s,
                "viscous_share": v,
            }
            for c, s, v in ((0.2, 0.7, 1.0), (0.2, 0.7, 0.0), (1.0, 0.5, 1.0))
        ]

    def telltale(self):
        return cycles([0.3, 0.3, 0.6, 0.6], 0.05)


class SimoDamage(MullinsSoftening):
    r"""Damage that depends on the largest strain alone, on first loading too.

    .. math:: \eta = 1 - d \left(1 - e^{-(\varepsilon_m / c)^{1/s}}\right)

    Simo 1987, doi:10.1016/0045-7825(87)90107-1. A spring of free shape absorbs the
    softening of the first loading, so only reloading shows the effect.
    """

    parameters = MullinsSoftening.parameters[:4]
    shape = MullinsSoftening.shape[:2]

    def within(self, scales):
        return self.narrowed("scale", low=EARLY * scales.strain)

    def factor(self, p, strain, largest):
        power = np.minimum(1 / p["sharpness"], 20)
        return 1 - p["depth"] * -np.expm1(-((largest / p["scale"]) ** power))

    def starts(self, scales):
        return [
            {
                "depth": 0.4,
                "scale": float(np.clip(c * scales.strain, 1e-3, 10)),
                "sharpness": 1.0,
                "viscous_share": v,
            }
            for c, v in ((0.5, 1.0), (0.5, 0.0), (1.5, 1.0))
        ]


class BeattySoftening(MullinsSoftening):
    r"""Mullins softening that is steepest just below the largest strain.

    .. math:: \eta = \exp\left(-b\,
              (\varepsilon_m^2 - \varepsilon^2)^{k}\right), \qquad k = \tfrac12

    softening b per unit of strain. The source takes the square root of the strain
    intensity, which is proportional to the square of a small strain. Beatty and
    Krishnaswamy 2000, *J. Mech. Phys. Solids* 48, 1931-1965.
    """

    parameters = (
        Parameter("softening", "-", 0.0, 50.0, 0.5, meaning="b", per_strain=1),
        Parameter("exponent", "-", 0.3, 2.0, 0.5, "log", "k"),
        MullinsSoftening.parameters[3],
    )
    off = {"softening": 0.0}
    amplitude = "softening"
    shape = ("exponent", "viscous_share")

    def factor(self, p, strain, largest):
        gap = np.maximum(largest**2 - strain**2, 0)
        return np.exp(-p["softening"] * gap ** p["exponent"])

    def starts(self, scales):
        size = float(np.clip(0.5 / max(scales.strain, 1e-6), 0, 50))
        return [
            {"softening": size, "exponent": 0.5, "viscous_share": v} for v in (1.0, 0.0)
        ]


class EnergySoftening(MullinsSoftening):
    r"""Ogden and Roxburgh's law as material cards have it, by the energy of the spring.

    .. math:: \eta = 1 - d \;\mathrm{erf}\!\left(\frac{W_m - W}{m + \beta W_m}\right),
              \qquad W = \int \sigma_{eq}\, d\varepsilon

    Depth d is 1/r of the card. energy_MPa m is that of the card times the share of the
    modulus that lasts, as the energy here is that of the spring. The integral is by
    trapezia over the samples.
    """

    of_card = True
    pointwise = False
    parameters = (
        MullinsSoftening.parameters[0],
        Parameter("energy_MPa", "MPa", 0.0, 1e4, 0.01, meaning="m", per_strain=-1),
        Parameter("sharpness", "-", 0.0, 10.0, 0.1, meaning="beta"),
    )
    shape = ()

    def after(self, p, signal, state):
        strain, stress = np.broadcast_arrays(signal.strain, signal.equilibrium)
        before, held, energy, most = state or (0.0, 0.0, 0.0, 0.0)
        step = increments(strain, before)
        mean = stress - increments(stress, held) / 2
        work = energy + np.cumsum(mean * step, axis=0)
        top = np.maximum.accumulate(np.maximum(work, most))
        scale = np.maximum(p["energy_MPa"] + p["sharpness"] * top, 1e-300)
        left = 1 - p["depth"] * erf((top - work) / scale)
        softer = signal.having(
            equilibrium=signal.equilibrium * left, branches=signal.branches * left
        )
        return softer, (strain[-1], stress[-1], work[-1], top[-1])

    def starts(self, scales):
        energy = 0.2 * scales.stress_MPa * scales.strain
        return [{"depth": 0.35, "energy_MPa": energy, "sharpness": 0.2}]
