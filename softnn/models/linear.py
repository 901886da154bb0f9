r"""Six linear networks of springs and dashpots, from Hooke to Wiechert.

Springs have a stiffness k [MPa], dashpots a viscosity [MPa s]. A Maxwell branch is a
spring and a dashpot in series, given by k and the relaxation time
:math:`\tau = \eta/k` [s]. Thesis section 5.2, Figs 5.1 and 5.2. Each class also has its
closed forms, as references. `relaxation` is the stress after a unit step of strain;
`creep` is the strain after a unit step of stress (D. Roylance, *Engineering
Viscoelasticity*, MIT, 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softnn.contracts import (
    Array,
    Chunk,
    InputError,
    Model,
    Parameter,
    Parameters,
    Response,
    State,
)
from softnn.models import branches
from softnn.models.branches import Update, check_update


def stiffness_parameter(name: str, default: float, meaning: str) -> Parameter:
    """Return a non-negative stiffness parameter [MPa]."""
    return Parameter(name, "MPa", 0.0, 1e6, default, "linear", meaning)


def time_parameter(name: str, default: float, meaning: str) -> Parameter:
    """Return a positive time parameter [s] on a logarithmic scale."""
    return Parameter(name, "s", 1e-6, 1e9, default, "log", meaning)


EQUILIBRIUM = stiffness_parameter("equilibrium_stiffness", 1.0, "the lone spring")


def values(parameters: Parameters, names: list[str]) -> Array:
    """Return the named parameters as one array (sets, len(names))."""
    columns = [np.atleast_1d(np.asarray(parameters[n], dtype=float)) for n in names]
    return (
        np.stack(np.broadcast_arrays(*columns), axis=-1) if names else np.ones((1, 0))
    )


class Branched(Model):
    """An equilibrium stress that follows the strain, beside Maxwell branches."""

    update: Update

    def __init__(self, update: Update = "exact") -> None:
        check_update(update)
        self.update = update

    def equilibrium(self, parameters: Parameters, strain: Array) -> Array:
        """Stress of the elastic part, (n, sets), for strain (n, 1 or sets)."""
        return values(parameters, ["equilibrium_stiffness"])[:, 0] * strain

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        """Stiffness and relaxation time of the branches, each (sets, branches)."""
        return (
            values(parameters, ["stiffness"]),
            values(parameters, ["relaxation_time"]),
        )

    def respond(
        self, parameters: Parameters, chunk: Chunk, state: State = None
    ) -> tuple[Response, State]:
        stress, state = branches.respond(
            *self.prony(parameters), chunk, state, self.update
        )
        strain = np.asarray(chunk.strain, dtype=float)
        flat = strain.ndim == 1 and all(np.ndim(v) == 0 for v in parameters.values())
        spring = self.equilibrium(parameters, strain.reshape(len(strain), -1))
        spring, stress = np.broadcast_arrays(spring, stress)
        if flat:
            return Response(spring[:, 0], stress[:, 0]), state
        return Response(spring, stress), state

    def relaxation(self, parameters: Parameters, time_s: ArrayLike) -> Array:
        """Relaxation modulus (n,) at time_s > 0 after a step, MPa; single values."""
        k, tau = (v[0] for v in self.prony(parameters))
        decays = np.exp(-np.asarray(time_s, dtype=float)[..., None] / tau)
        rest = float(np.squeeze(self.equilibrium(parameters, np.ones((1, 1)))))
        return rest + decays @ k

    def creep(self, parameters: Parameters, time_s: ArrayLike) -> Array:
        r"""Creep compliance (n,) at time_s > 0 after a step, 1/MPa; single values.

        The dashpot strains :math:`d_j` obey :math:`\tau_j \dot d_j = \varepsilon -
        d_j` with :math:`\varepsilon = (1 + \sum k_j d_j)/K` and
        :math:`K = k_e + \sum k_j`. Scaled by :math:`\sqrt{k_j \tau_j}`, the linear
        system is symmetric; it is solved on its eigenvectors.
        """
        k, tau = (v[0] for v in self.prony(parameters))
        rest = float(np.squeeze(self.equilibrium(parameters, np.ones((1, 1)))))
        if (k < 0).any():
            raise InputError("creep of a negative branch stiffness has no closed form")
        total = rest + k.sum()
        if not total > 0:
            raise InputError("no stiffness at all: the strain has no bound")
        root = np.sqrt(k / tau)
        rates, modes = np.linalg.eigh(np.outer(root, root) / total - np.diag(1 / tau))
        weights = (modes.T @ root) ** 2 / total**2
        time = np.asarray(time_s, dtype=float)[..., None]
        # Without the lone spring the last rate is zero: the model creeps for ever.
        flows = (np.arange(len(rates)) == len(rates) - 1) & (rest == 0)
        safe = np.where(flows, 1.0, rates)
        growth = np.where(flows, time, np.expm1(safe * time) / safe)
        return 1 / total + growth @ weights


class Hooke(Branched):
    r"""A spring: :math:`\sigma = k_e \varepsilon`.

    ::

        o---/\/\/---o
             k_e

    In a recording: no loop, no relaxation, no rate dependence.

    >>> strain = np.array([0.0, 0.1])
    >>> Hooke().apply({"equilibrium_stiffness": 2.0}, Chunk(np.arange(2.0), strain))[0]
    array([0. , 0.2])
    """

    parameters = (EQUILIBRIUM,)
    linear = ("equilibrium_stiffness",)

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return np.ones((1, 0)), np.ones((1, 0))


class KelvinVoigt(Model):
    r"""A spring beside a dashpot.

    ::

             k_e
        +---/\/\/---+
        o           o
        +----[|-----+
             eta

    .. math:: \sigma = k_e\,\varepsilon + \eta\,\dot\varepsilon

    The strain rate is the backward difference, exact for strain linear between
    samples. A step of strain needs infinite stress for an instant; a sample without a
    time step holds the stress after that instant. In a recording: stress drops at
    once when a ramp ends, and does not relax further.
    """

    parameters = (
        EQUILIBRIUM,
        Parameter("viscosity", "MPa s", 0.0, 1e9, 1.0, "linear", "the dashpot"),
    )
    linear = ("equilibrium_stiffness", "viscosity")

    def respond(
        self, parameters: Parameters, chunk: Chunk, state: State = None
    ) -> tuple[Response, State]:
        given = chunk.strain if chunk.branch_strain is None else chunk.branch_strain
        before, strain_before = (None, np.zeros(1)) if state is None else state
        time, driven, steps = branches.history(chunk.time_s, given, before)
        jumps = np.diff(
            driven, axis=0, prepend=np.broadcast_to(strain_before, (1, driven.shape[1]))
        )
        rate = np.divide(
            jumps, steps[:, None], out=np.zeros_like(jumps), where=steps[:, None] > 0
        )
        strain = np.asarray(chunk.strain, dtype=float).reshape(len(time), -1)
        k, eta = values(parameters, ["equilibrium_stiffness", "viscosity"]).T
        spring, dashpot = np.broadcast_arrays(k * strain, eta * rate)
        state = (float(time[-1]), driven[-1].copy())
        if np.ndim(chunk.strain) == 1 and all(
            np.ndim(v) == 0 for v in parameters.values()
        ):
            return Response(spring[:, 0], dashpot[:, 0]), state
        return Response(spring, dashpot), state

    def relaxation(self, parameters: Parameters, time_s: ArrayLike) -> Array:
        """Relaxation modulus (n,) at time_s > 0 after a step, MPa; single values."""
        k = np.asarray(parameters["equilibrium_stiffness"], dtype=float)
        return np.full(np.shape(time_s), k)

    def creep(self, parameters: Parameters, time_s: ArrayLike) -> Array:
        """Creep compliance (n,) at time_s > 0 after a step, 1/MPa; single values."""
        k = np.asarray(parameters["equilibrium_stiffness"], dtype=float)
        retardation = np.asarray(parameters["viscosity"]) / k
        return -np.expm1(-np.asarray(time_s, dtype=float) / retardation) / k


class Maxwell(Branched):
    r"""A spring and a dashpot in series; :math:`\tau = \eta/k`.

    ::

        o---/\/\/----[|---o
              k      eta

    In a recording: stress relaxes to nothing, a constant load creeps for ever.
    """

    parameters = (
        stiffness_parameter("stiffness", 1.0, "of the branch"),
        time_parameter("relaxation_time", 1.0, "of the branch"),
    )
    linear = ("stiffness",)

    def equilibrium(self, parameters: Parameters, strain: Array) -> Array:
        return np.zeros_like(strain)


class StandardLinearSolid(Branched):
    r"""A spring beside one Maxwell branch (thesis eqs 5.2, 5.5).

    ::

                k_e
        +-----/\/\/------+
        o                o
        +---/\/\/---[|---+
              k     eta

    .. math:: \sigma(t) = (k_e + k\,e^{-t/\tau})\,\varepsilon_0

    In a recording: relaxation with one time constant to a lasting stress.
    """

    parameters = (EQUILIBRIUM, *Maxwell.parameters)
    linear = ("equilibrium_stiffness", "stiffness")


class Burgers(Branched):
    r"""A Maxwell branch in series with a Kelvin-Voigt element.

    ::

                             k_r
                         +--/\/\/--+
        o---/\/\/---[|---+         +---o
              k     eta  +---[|----+
                             eta_r

    Given by k, :math:`\tau = \eta/k`, k_r and the retardation time
    :math:`\tau_r = \eta_r/k_r`. For imposed strain the model equals two Maxwell
    branches in parallel. Their times are :math:`1/r_{1,2}` with
    :math:`r_{1,2} = (p \pm \sqrt{p^2 - 4q})/2q`,
    :math:`p = \tau + \tau k/k_r + \tau_r` and :math:`q = \tau\tau_r`. W. N. Findley,
    J. S. Lai, K. Onaran, *Creep and Relaxation of Nonlinear Viscoelastic Materials*,
    1976, section 5.6. In a recording: like Maxwell's, with a fast part before it.
    """

    parameters = (
        stiffness_parameter("stiffness", 1.0, "of the series spring"),
        time_parameter("relaxation_time", 10.0, "series dashpot over series spring"),
        Parameter("retarded_stiffness", "MPa", 1e-9, 1e6, 1.0, "log", "Kelvin spring"),
        time_parameter("retardation_time", 1.0, "of the Kelvin-Voigt element"),
    )

    def equilibrium(self, parameters: Parameters, strain: Array) -> Array:
        return np.zeros_like(strain)

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        k, tau, k_r, tau_r = values(parameters, [p.name for p in self.parameters]).T
        p, q = tau * (1 + k / k_r) + tau_r, tau * tau_r
        root = np.sqrt(p**2 - 4 * q)  # never negative: p**2 - 4 q >= (tau - tau_r)**2
        fast = (p + root) / (2 * q)
        slow = 2 / (p + root)  # the other root; their product is 1 / q
        # Where both roots meet (k = 0 and tau = tau_r) there is no stress to split.
        gap = np.where(root > 0, root, 1.0)
        stiffness = np.stack(
            [
                k * (tau * tau_r * fast - tau) / gap,
                k * (tau - tau * tau_r * slow) / gap,
            ],
            axis=-1,
        )
        return stiffness, np.stack([1 / fast, 1 / slow], axis=-1)


class Wiechert(Branched):
    r"""A spring beside any number of Maxwell branches (generalised Maxwell model).

    ::

                 k_e
        +------/\/\/-------+
        |    k_1    eta_1  |
        o---/\/\/----[|----o
        |    k_j    eta_j  |
        +---/\/\/----[|----+

    .. math:: \sigma(t) = \Big(k_e + \sum_j k_j e^{-t/\tau_j}\Big)\varepsilon_0

    (thesis eqs 5.1, 5.6). In a recording: relaxation over several decades of time.

    >>> names = [p.name for p in Wiechert(branches=2).parameters]
    >>> names[1:]
    ['stiffness_1', 'relaxation_time_1', 'stiffness_2', 'relaxation_time_2']
    """

    def __init__(self, branches: int = 3, update: Update = "exact") -> None:
        super().__init__(update)
        self.branches = branches
        self.parameters = (EQUILIBRIUM, *branch_parameters(branches))
        self.linear = tuple(p.name for p in self.parameters if p.unit == "MPa")

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return branch_values(parameters, self.branches)


def branch_parameters(branches: int, low: float = 0.0) -> tuple[Parameter, ...]:
    """Return stiffness_j [MPa] and relaxation_time_j [s] of each branch.

    The default times are a decade apart; `low` is the smallest stiffness allowed.
    """
    if branches < 0:
        raise InputError(f"{branches} branches; allowed is 0 or more")
    declared: list[Parameter] = []
    for j in range(1, branches + 1):
        name, meaning = f"stiffness_{j}", f"of branch {j}"
        declared += [
            Parameter(name, "MPa", low, 1e6, 1.0, "linear", meaning),
            time_parameter(f"relaxation_time_{j}", 10.0 ** (j - 1), f"of branch {j}"),
        ]
    return tuple(declared)


def branch_values(parameters: Parameters, branches: int) -> tuple[Array, Array]:
    """Stiffness [MPa] and relaxation time [s], each (sets, branches), by number."""
    numbers = range(1, branches + 1)
    return (
        values(parameters, [f"stiffness_{j}" for j in numbers]),
        values(parameters, [f"relaxation_time_{j}" for j in numbers]),
    )
