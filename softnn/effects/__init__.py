"""All effects, in the order in which they act: rig, material, sensor."""

from __future__ import annotations

from softnn.contracts import Effect, InputError, nearest
from softnn.effects.cyclic_softening import CyclicSoftening
from softnn.effects.finite_strain import FiniteStrain
from softnn.effects.friction_hysteresis import FrictionHysteresis
from softnn.effects.gain_error import GainError
from softnn.effects.grip_slip import GripSlip
from softnn.effects.inertia import Inertia
from softnn.effects.load_cell_drift import LoadCellDrift
from softnn.effects.load_cell_saturation import LoadCellSaturation
from softnn.effects.mullins_softening import MullinsSoftening
from softnn.effects.nonlinear_elasticity import NonlinearElasticity
from softnn.effects.nonlinear_viscosity import NonlinearViscosity
from softnn.effects.permanent_set import PermanentSet
from softnn.effects.relaxation_branch import RelaxationBranch
from softnn.effects.sensor_lag import SensorLag
from softnn.effects.slack import Slack
from softnn.effects.strain_dependent_relaxation import StrainDependentRelaxation
from softnn.effects.tension_only import TensionOnly
from softnn.effects.thermal_softening import ThermalSoftening
from softnn.effects.zero_offset import ZeroOffset

EFFECTS: tuple[Effect, ...] = (
    # rig
    Slack(),
    GripSlip(),
    # material: what changes the strain first, then added elements, then factors
    PermanentSet(),
    FiniteStrain(),
    StrainDependentRelaxation(),
    NonlinearElasticity(),
    RelaxationBranch(),
    NonlinearViscosity(),
    FrictionHysteresis(),
    MullinsSoftening(),
    CyclicSoftening(),
    ThermalSoftening(),
    TensionOnly(),
    # sensor
    Inertia(),
    GainError(),
    SensorLag(),
    LoadCellDrift(),
    ZeroOffset(),
    LoadCellSaturation(),
)


def effect(name: str, form: str | None = None) -> Effect:
    """Return the effect with id `name`; with `form`, that form (class name) of its law.

    Raises `InputError`, with the nearest known name, where no effect or form has the
    name.

    >>> effect("slack").stage
    'rig'
    """
    for candidate in EFFECTS:
        if candidate.id == name:
            for law in (candidate, *candidate.second_forms):
                if form is None or law.form == form:
                    return law
            raise InputError(f"effect {name!r} has no form {form!r}")
    names = [e.id for e in EFFECTS]
    raise InputError(f"no effect {name!r}{nearest(name, names)}; allowed is {names}")
