"""Quantities and units of the two axes of a recording; the one place that owns units.

A specimen of known length and cross-section gives strain and stress. A component gives
force against elongation or torque against deflection, and results are in those units.
Models and effects know strain and MPa alone. So a diagnosis counts a component in round
numbers of its own units (`Axis.one`), as if it had a length and a section that make its
deflection a small strain. Effects of large strain do not apply to a component.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn.contracts import InputError, Parameter

# Of a component: what finite strain does is little there, and the ranges of effects,
# made for specimens, are not left either.
LARGEST_STRAIN = 0.1


@dataclass(frozen=True)
class Axis:
    """A quantity and its unit; `one` [unit] is what counts as 1 (strain, or MPa)."""

    name: str
    unit: str
    one: float = 1.0

    @property
    def column(self) -> str:
        """Its column in a file."""
        return self.name if self.unit == "-" else f"{self.name}_{self.unit}"

    @property
    def label(self) -> str:
        """As it stands at an axis of a figure."""
        return f"{self.name} [{self.unit}]"

    def counted(self, largest: float, most: float) -> Axis:
        """The same with a round number as `one`: `largest` counts `most`, or less.

        >>> Axis("force", "N").counted(34.0, 1.0).one
        50.0
        """
        if not largest > 0:
            return self
        power = np.floor(np.log10(largest / most))
        lead = largest / most / 10.0**power
        round_ = next(x for x in (1, 2, 5, 10) if lead <= x * (1 + 1e-9))
        return replace(self, one=float(f"{round_ * 10.0**power:.6g}"))


@dataclass(frozen=True)
class Axes:
    """The imposed quantity (strain) and the response (stress), with their units."""

    strain: Axis
    stress: Axis

    @property
    def columns(self) -> tuple[str, str, str]:
        """Columns that a file needs.

        >>> COMPONENTS[1].columns
        ('time_s', 'deflection_deg', 'torque_Nm')
        """
        return "time_s", self.strain.column, self.stress.column

    @property
    def simulated(self) -> str:
        """The column of a simulated stress."""
        return f"simulated_{self.stress.unit}"

    @property
    def rate(self) -> str:
        """Unit of the strain rate."""
        return "1/s" if self.strain.unit == "-" else f"{self.strain.unit}/s"

    @property
    def rate_key(self) -> str:
        """What the rate is called in JSON."""
        return f"{self.strain.column}_per_s" if self.component else "rate_per_s"

    @property
    def component(self) -> bool:
        """Whether it is a component, of which no strain is known."""
        return self.strain.name != "strain"

    def like(self, other: Axes) -> bool:
        """Whether both are of the same quantities, whatever counts as 1."""
        return self.columns == other.columns

    def counted(self, strain: float, stress: float) -> Axes:
        """Axes for a component whose largest sizes, in its own units, are these."""
        return Axes(
            self.strain.counted(strain, LARGEST_STRAIN),
            self.stress.counted(stress, 1.0),
        )

    def of(self, parameter: Parameter) -> tuple[float, str]:
        """What 1 of a parameter of an effect is in own units, and the unit.

        >>> bench = COMPONENTS[1].counted(0.5, 9.0)
        >>> bench.of(Parameter("stiffness_MPa", "MPa", 0, 1, 0, per_strain=1))
        (2.0, 'Nm/deg')
        """
        unit = parameter.unit.replace("MPa", self.stress.unit)
        size = self.stress.one**-parameter.per_stress
        if not self.component:
            return size, unit
        power = -parameter.per_strain
        if power:
            size *= self.strain.one**power
            more = self.strain.unit + (f"{abs(power)}" if abs(power) > 1 else "")
            if power > 0:
                unit = more if unit == "-" else f"{unit} {more}"
            else:
                unit = f"1/{more}" if unit == "-" else f"{unit}/{more}"
        return float(f"{size:.12g}"), unit  # round, but for the last digit

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready; `from_dict` takes it back."""
        return {
            key: {"name": axis.name, "unit": axis.unit, "one": axis.one}
            for key, axis in (("strain", self.strain), ("stress", self.stress))
        }

    @classmethod
    def from_dict(cls, given: Any) -> Axes:
        """Axes of a model file; `InputError` where they are none known here."""
        if given is None:
            return SPECIMEN
        try:
            pair = [
                Axis(str(g["name"]), str(g["unit"]), float(g["one"]))
                for g in (given["strain"], given["stress"])
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"axes cannot be read: {error!r}") from None
        found = cls(*pair)
        if not any(found.like(one) for one in (SPECIMEN, *COMPONENTS)):
            raise InputError(f"axes are {pair[0].label}, {pair[1].label}; {_allowed()}")
        if not all(1e-30 < axis.one < 1e30 for axis in pair):
            raise InputError("one of an axis must be above 0, and a number")
        return found


SPECIMEN = Axes(Axis("strain", "-"), Axis("stress", "MPa"))
COMPONENTS = (
    Axes(Axis("elongation", "mm"), Axis("force", "N")),
    Axes(Axis("deflection", "deg"), Axis("torque", "Nm")),
)


def axes_of(columns: Collection[str]) -> Axes | None:
    """The axes that a file with these columns has; strain and stress before others.

    >>> axes_of(["time_s", "force_N", "elongation_mm"]).stress.label
    'force [N]'
    """
    for axes in (SPECIMEN, *COMPONENTS):
        if {axes.strain.column, axes.stress.column} <= set(columns):
            return axes
    return None


def common(found: Mapping[str, Axes]) -> Axes:
    """The axes that all recordings, by name, have; `InputError` where they differ."""
    (first, axes), *others = found.items()
    for name, other in others:
        if not other.like(axes):
            raise InputError(
                f"{name} holds {other.stress.label}, {first} {axes.stress.label}; "
                "recordings of one case are all of one kind"
            )
    return axes


def _allowed() -> str:
    pairs = (f"{a.strain.column},{a.stress.column}" for a in (SPECIMEN, *COMPONENTS))
    return f"allowed: {' or '.join(pairs)}"
