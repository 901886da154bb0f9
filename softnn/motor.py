"""Parts of a series-viscoelastic actuator: motor and gearbox, a bundle of strips.

Electrical and angular quantities are SI (V, A, Nm, rad), strips N, mm, MPa.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.linalg import expm

from softnn.contracts import InputError
from softnn.materials import material, table
from softnn.model_file import Stored

SMOOTH = 1.0  # rad/s of the motor, over which friction turns round
RPM = 2 * math.pi / 60


class Strip(Protocol):
    """What a bundle is made of: `softnn.export.compiled.Compiled`, or `Law`."""

    def reset(self) -> None: ...
    def step(self, step_s: float, strain: float) -> float: ...


@dataclass(frozen=True)
class Motor:
    """Motor and gearbox, SI units; `ratio` turns of the motor are one of the pulley.

    Friction [Nm] is that of the motor's shaft; the thesis gives none.
    """

    voltage_V: float
    inductance_H: float
    resistance_ohm: float
    torque_constant_Nm_per_A: float
    back_emf_V_s: float
    inertia_kg_m2: float
    ratio: float
    friction_Nm: float = 0.0

    @classmethod
    def published(cls) -> Motor:
        """Table 7.3, with the inertia in g cm2 where it prints g/cm2.

        >>> Motor.published().inertia_kg_m2
        7.92e-06
        """
        row = {r["parameter"]: r["value"] for r in table("7.3").rows}
        return cls(
            row["nominal_voltage"],
            1e-3 * row["inductance"],
            row["resistance"],
            1e-3 * row["torque_constant"],
            row["back_emf_constant"],
            round(1e-7 * row["motor_inertia"], 12),
            float(row["gear_ratio"].split("/")[1]),
        )

    def reach(self, torque_Nm: float) -> dict[str, float]:
        """What a torque at the pulley takes, without losses of the gearbox."""
        current = torque_Nm / self.ratio / self.torque_constant_Nm_per_A
        speed = (self.voltage_V - self.resistance_ohm * current) / self.back_emf_V_s
        stall = self.voltage_V / self.resistance_ohm * self.torque_constant_Nm_per_A
        return {
            "current_A": current,
            "heat_W": self.resistance_ohm * current**2,
            "speed_rpm": speed / self.ratio / RPM,
            "no_load_rpm": self.voltage_V / self.back_emf_V_s / self.ratio / RPM,
            "stall_torque_Nm": stall * self.ratio,
        }

    def step_matrices(self, step_s: float) -> list[list[float]]:
        """(i, omega, theta) after a step from them, V, and T/n at both ends."""
        k, j = self.torque_constant_Nm_per_A, self.inertia_kg_m2
        a = np.zeros((6, 6))
        a[0, :2] = (-self.resistance_ohm, -self.back_emf_V_s)
        a[0, 3] = 1
        a[0] /= self.inductance_H
        a[1, 0], a[1, 4] = k / j, -1 / j
        a[2, 1] = 1
        a[4, 5] = 1 / step_s  # the torque goes straight from one end to the other
        phi = expm(a * step_s)[:3]
        start, slope = phi[:, 4].copy(), phi[:, 5]
        return np.column_stack([phi[:, :4], start - slope, slope]).tolist()


@dataclass(frozen=True)
class Bundle:
    """Strips side by side on a pulley: number, mm2 each, mm long, pulley's radius."""

    strips: int = 8
    area_mm2: float = 30.0
    length_mm: float = 33.0
    radius_mm: float = 25.0

    def strain(self, angle_rad: float) -> float:
        """Of the strips, for an angle of the pulley against the load."""
        return self.radius_mm * angle_rad / self.length_mm

    def torque_Nm(self, stress_MPa: float) -> float:
        """At the pulley; a cable cannot push."""
        force = self.strips * self.area_mm2 * max(stress_MPa, 0.0)
        return 1e-3 * self.radius_mm * force

    def for_torque(self, torque_Nm: float, stress_MPa: float) -> Bundle:
        """The same with the radius at which a stress gives a torque."""
        return replace(
            self,
            radius_mm=1e3 * torque_Nm / (self.strips * self.area_mm2 * stress_MPa),
        )


class Law:
    """Springs in turn and Maxwell branches, stepped in plain Python, or as an ODE."""

    def __init__(self, model: Stored) -> None:
        if model.pieces or model.needs_simulated or model.learned is not None:
            raise InputError("a law of springs and branches has no effects; compile it")
        units, self.stiffness = model.units, model.stiffness[model.units.segments :]
        self.times = np.array(units.relaxation_times)[self.stiffness != 0]
        self.stiffness = self.stiffness[self.stiffness != 0]
        self._slopes = model.stiffness[: units.segments].tolist()
        # A single spring is a line through the origin, wherever its ends are.
        knots = units.corners[:-1] if units.segments > 1 else np.zeros(1)
        self._knots = knots.tolist()
        self._at = (units.springs(knots) @ model.stiffness[: units.segments]).tolist()
        self._rows: list[tuple[float, float]] = []
        self.reset()

    def reset(self) -> None:
        self._carried, self._last, self._before = [0.0] * len(self.times), 0.0, -1.0

    def spring(self, strain: float) -> float:
        """Stress [MPa] that lasts."""
        k = max(bisect_right(self._knots, strain) - 1, 0)
        return self._at[k] + self._slopes[k] * (strain - self._knots[k])

    def step(self, step_s: float, strain: float) -> float:
        if step_s != self._before:
            x = step_s / self.times
            lost = -np.expm1(-x)
            gain = np.where(x > 1e-9, lost / np.maximum(x, 1e-300), 1 - x / 2)
            self._rows = list(
                zip((1 - lost).tolist(), (gain * self.stiffness).tolist(), strict=True)
            )
            self._before = step_s
        jump = strain - self._last
        self._carried = [
            decay * q + gain * jump
            for (decay, gain), q in zip(self._rows, self._carried, strict=True)
        ]
        self._last = strain
        return self.spring(strain) + sum(self._carried)


def published_checks(stress_at_working_range_MPa: float) -> dict[str, float]:
    """Table 7.3 against itself: torque through the gearbox, and areas of the strips.

    `radius_*` are the radii [mm] at which 8 strips give 15 Nm at the working range: at
    the printed area, at the printed width, and at the width of Table 7.2.
    """
    row = {r["parameter"]: r["value"] for r in table("7.3").rows}
    thick = material(row["material"]).thickness_mm[0]
    wide = table("7.2").row(material=row["material"])["strip_width"]
    areas = {"printed": row["area"], "20_mm": row["strip_width"] * thick}
    areas["66_mm"] = wide * thick
    out = {}
    for name, area in areas.items():
        bundle = Bundle(row["strips"], area, row["strip_length"])
        one = bundle.for_torque(15.0, stress_at_working_range_MPa)
        out[f"area_{name}_mm2"] = row["strips"] * area
        out[f"radius_{name}_mm"] = one.radius_mm
        turn = row["working_range"] / one.radius_mm
        out[f"turn_{name}_degree"] = math.degrees(turn)
    motor = Motor.published()
    gap = motor.torque_constant_Nm_per_A / motor.back_emf_V_s - 1
    return out | motor.reach(15.0) | {"torque_over_back_emf_constant_less_1": gap}
