r"""A series-viscoelastic actuator: motor, gearbox, a bundle of strips, a load.

The bench of Fig. 7.1 of the thesis imposes the strain and has neither motor nor load
(`bench`); the chain of Table 7.3 is

.. math::
    L \dot i = V - R i - K_b \omega, \qquad
    J \dot\omega = K_a i - \tau_f \tanh(\omega/\omega_0) - T/n, \qquad
    T = r N A\,\sigma(\varepsilon), \quad
    \varepsilon = r (\theta/n - q) / l

with the motor's angle theta, n turns of it for one of the pulley, radius r, N strips
of area A and length l, and the angle q of the load. A cable cannot push, so T is not
below zero. `walk` runs it sample by sample, the motor solved exactly between samples;
`walk_ode` integrates the same with SciPy. Electrical and angular quantities are SI
(V, A, Nm, rad), strips N, mm, MPa.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from softnn.contracts import Array, InputError
from softnn.motor import SMOOTH, Bundle, Law, Motor, Strip


@dataclass(frozen=True)
class Controller:
    """PI on the torque, with the model's stiffness and the motor's law ahead of it.

    V = R/(K_a n) T_ref + K_b n (dq/dt + (dT_ref/dt + K_p e + K_i sum e) / k), k the
    stiffness [Nm/rad] that the model gives near the torque wanted.
    """

    proportional_per_s: float = 60.0
    integral_per_s2: float = 200.0
    stiffness_Nm_per_rad: float = 20.0
    compensate_friction: bool = False


@dataclass(frozen=True)
class Chain:
    """Motor, bundle, controller, and the time between its samples."""

    motor: Motor
    bundle: Bundle
    controller: Controller = Controller()
    step_s: float = 1e-3


@dataclass(frozen=True)
class Walk:
    """What came of it, each (n,): torques in Nm, V, A, rad/s of the motor, strain.

    `estimate_Nm` is what the controller takes the torque for, `torque_Nm` what it is.
    """

    time_s: Array
    torque_Nm: Array
    estimate_Nm: Array
    voltage_V: Array
    current_A: Array
    speed_rad_per_s: Array
    strain: Array


def bench(strip: Strip, bundle: Bundle, time_s: Array, strain: Array) -> Array:
    """Force [N] (n,) of the bundle for an imposed strain (n,): Fig. 7.1.

    Nothing is cut at zero: what the strip says is what there is to see.
    """
    strip.reset()
    steps = np.diff(time_s, prepend=time_s[0])
    stress = [
        strip.step(float(s), float(e)) for s, e in zip(steps, strain, strict=True)
    ]
    return bundle.strips * bundle.area_mm2 * np.array(stress)


def walk(
    chain: Chain, reference_Nm: Array, load_rad: Array, plant: Strip, model: Strip
) -> Walk:
    """The chain in closed loop, sample by sample: reference and load angle (n,).

    `plant` is what the strips are, `model` what the controller takes them for. Between
    samples the torque of the strips is taken to go on as it went: second order.
    """
    motor = chain.motor
    rows = motor.step_matrices(chain.step_s)
    before = {"torque": 0.0, "friction": 0.0}

    def advance(
        x: tuple[float, ...], volts: float, torque: float, *_: object
    ) -> tuple[float, ...]:
        friction = motor.friction_Nm * math.tanh(x[1] / SMOOTH)
        now = torque / motor.ratio + friction
        ahead = 2 * now - before["torque"]
        before["torque"] = now
        u = (*x, volts, now, ahead)
        return tuple(sum(a * b for a, b in zip(row, u, strict=True)) for row in rows)

    plant.reset()

    def stress_of(strain: float, k: int) -> float:
        return plant.step(chain.step_s if k else 0.0, strain)

    return _loop(chain, reference_Nm, load_rad, model, stress_of, advance)


def walk_ode(
    chain: Chain, reference_Nm: Array, load_rad: Array, plant: Law, model: Strip
) -> Walk:
    """The same with SciPy between samples: strips and motor as one set of equations."""
    motor, bundle = chain.motor, chain.bundle
    carried = np.zeros(len(plant.times))
    stress = 0.0

    def rates(t: float, y: Array, volts: float, load: tuple[float, float]) -> Array:
        i, omega, theta = y[:3]
        q = load[0] + (load[1] - load[0]) * t / chain.step_s
        pace = (load[1] - load[0]) / chain.step_s
        strain = bundle.strain(theta / motor.ratio - q)
        strain_rate = bundle.strain(omega / motor.ratio - pace)
        torque = bundle.torque_Nm(plant.spring(strain) + float(y[3:].sum()))
        friction = motor.friction_Nm * math.tanh(omega / SMOOTH)
        drive = motor.torque_constant_Nm_per_A * i - friction - torque / motor.ratio
        volts -= motor.resistance_ohm * i + motor.back_emf_V_s * omega
        branches = plant.stiffness * strain_rate - y[3:] / plant.times
        return np.array(
            [volts / motor.inductance_H, drive / motor.inertia_kg_m2, omega, *branches]
        )

    def advance(
        x: tuple[float, ...], volts: float, _torque: float, load: tuple[float, float]
    ) -> tuple[float, ...]:
        nonlocal carried, stress
        found = solve_ivp(
            rates,
            (0.0, chain.step_s),
            [*x, *carried],
            method="LSODA",
            args=(volts, load),
            rtol=1e-9,
            atol=1e-11,
        )
        carried = found.y[3:, -1]
        return tuple(float(v) for v in found.y[:3, -1])

    def stress_of(strain: float, k: int) -> float:
        nonlocal carried
        if k == 0:
            carried = plant.stiffness * strain  # reached in a step
        return plant.spring(strain) + float(carried.sum())

    return _loop(chain, reference_Nm, load_rad, model, stress_of, advance)


def _loop(
    chain: Chain,
    reference: Array,
    load: Array,
    model: Strip,
    stress_of: Callable[[float, int], float],
    advance: Callable[..., tuple[float, ...]],
) -> Walk:
    """The controller at its samples; `advance` moves the motor from one to the next."""
    if len(reference) != len(load) or len(load) < 2:
        raise InputError(
            f"{len(reference)} samples of the reference and {len(load)} of the load; "
            "as many of both are needed, two at least"
        )
    motor, bundle, control, dt = (
        chain.motor,
        chain.bundle,
        chain.controller,
        chain.step_s,
    )
    ahead = motor.resistance_ohm / (motor.torque_constant_Nm_per_A * motor.ratio)
    back = motor.back_emf_V_s * motor.ratio
    wanted, angles = reference.tolist(), load.tolist()
    model.reset()
    x: tuple[float, ...] = (0.0, 0.0, motor.ratio * angles[0])
    total, rows = 0.0, []
    for k, (goal, q) in enumerate(zip(wanted, angles, strict=True)):
        strain = bundle.strain(x[2] / motor.ratio - q)
        torque = bundle.torque_Nm(stress_of(strain, k))
        estimate = bundle.torque_Nm(model.step(dt if k else 0.0, strain))
        error = goal - estimate
        later = min(k + 1, len(wanted) - 1)
        rise, pace = (wanted[later] - goal) / dt, (angles[later] - q) / dt
        push = control.proportional_per_s * error + control.integral_per_s2 * total
        speed = pace + (rise + push) / control.stiffness_Nm_per_rad
        volts = ahead * goal + back * speed
        if control.compensate_friction:
            volts += ahead * motor.ratio * math.copysign(motor.friction_Nm, speed)
        limited = min(max(volts, -motor.voltage_V), motor.voltage_V)
        if limited == volts:  # no winding up while the voltage is at its limit
            total += error * dt
        rows.append((torque, estimate, limited, x[0], x[1], strain))
        x = advance(x, limited, torque, (q, angles[later]))
    columns: list[Array] = [np.array(c, float) for c in zip(*rows, strict=True)]
    time: Array = np.arange(len(wanted), dtype=np.float64) * float(dt)
    return Walk(time, *columns)
