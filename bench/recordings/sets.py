"""What is known about each set of recordings, apart from what is in its files.

One `About` a set. A set that is in the folder and not here is run too, in one group,
its recordings as so many specimens, with nothing to agree with.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softnn.readers.tidy import read_folder
from softnn.recording import Recording

MULLINS = "Diani, Fayolle and Gilormini 2009, doi:10.1016/j.eurpolymj.2008.11.017"
SET = "Dorfmann and Ogden 2004, doi:10.1016/j.ijsolstr.2003.11.014"
FOAM = "Living Matter Lab 2026, arXiv:2602.12694"
VHB = "Liu, Guan, Zhao and Luo 2024, doi:10.1016/j.cma.2024.117248"
FINITE = "Reese and Govindjee 1998, doi:10.1016/S0020-7683(97)00217-5"
RUBBER = "Bergstroem and Boyce 1998, doi:10.1016/S0022-5096(97)00075-6"
FRICTION = "Al-Bender and Swevers 2008, doi:10.1109/MCS.2008.929279"
FUNGI = "Probing mycelium mechanics 2025, doi:10.1016/j.actbio.2025.07.002"
ETFE = "Comitti and Bosi 2024, doi:10.1007/s11043-024-09704-5"
BENCH = "Tregear 2023, github.com/ITregear/SeriesElasticActuation-FYP"
GELATIN = "github.com/fhshaik/Composite-Hydrogel-Experiments, 2025"
STRETCHER = "Ellingham 2021, github.com/richgumy/electromech-stretcher"
SCHAPERY = "Schapery 1969, doi:10.1002/pen.760090410"

# Laws that stand for one another where the literature only says "nonlinear viscous".
VISCOUS = (
    "finite_strain",
    "nonlinear_viscosity",
    "strain_dependent_relaxation",
)
VISCOUS_ALL = (*VISCOUS, "relaxation_branch")


@dataclass(frozen=True)
class Material:
    """What the literature says about one kind of recording.

    `contains`: each entry is a tuple of ids of which one at least is expected; `absent`
    are ids that must not be named. `bars`: what is asked of the held-out NRMSE with the
    default base, of its ratio to that of the base (`ratio`) and of itself (`nrmse`).
    """

    contains: tuple[tuple[str, ...], ...] = ()
    absent: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    says: str = ""
    bars: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class About:
    """How a set is read, divided and held out."""

    # Groups: the part of a recording's name that matches, or else the kind of its test.
    group: str = ""
    # What to predict: "specimen", "rate", "amplitude" or "recording".
    hold: tuple[str, ...] = ("specimen",)
    specimens: bool = True  # each recording is a specimen of its own, with its scale
    tests: tuple[str, ...] = ("cyclic", "relaxation")
    # The folder, and a place for why a file of it cannot be used.
    read: Callable[[Path, dict[str, str]], list[Recording]] = read_folder
    kinds: tuple[tuple[str, Material], ...] = ()  # pattern in the group -> material

    def material(self, group: str) -> Material:
        for pattern, found in self.kinds:
            if re.search(pattern, group):
                return found
        return Material()


def read_device(folder: Path, unusable: dict[str, str]) -> list[Recording]:
    """Force over displacement of a device, from where it starts.

    What pushes steadily (air under the piston) is taken out: the middle between strokes
    in and out.
    """
    out = []
    for one in read_zeroed(folder, unusable):
        speed = np.gradient(one.strain)
        fast = np.abs(speed) > 0.5 * np.quantile(np.abs(speed), 0.9)
        ways = [np.median(one.stress_MPa[fast & (speed * s > 0)]) for s in (1, -1)]
        out.append(one.with_step("middle", stress_MPa=one.stress_MPa - np.mean(ways)))
    return out


def read_zeroed(folder: Path, unusable: dict[str, str]) -> list[Recording]:
    """The folder, deflection counted from each recording's first sample."""
    return [
        r.with_step("zeroed", strain=r.strain - r.strain[0])
        for r in read_folder(folder, unusable)
    ]


# Sets that were looked at while the rules of prediction were made (docs/decisions.md,
# 28 November 2026); the others were held back until the rules stood.
DEVELOPMENT = (
    "foam-tpe-tension-cyclic",
    "rubber-compression-relaxation",
    "gelatin-zwick-air-control",
    "etfe-film-cyclic-dic",
    "vhb4910-zhao",
    "sea-bench-springs",
)

FOAM_BARS = {"ratio": 0.25, "nrmse": 0.04}

SETS: dict[str, About] = {
    "foam-tpe-tension-cyclic": About(
        group=r"^(.+)_t\d+$",
        kinds=(
            (
                "",
                Material(
                    (("mullins_softening",), ("permanent_set",)),
                    (),
                    (FOAM, MULLINS, SET),
                    "strong softening on reloading and residual strain",
                    FOAM_BARS,
                ),
            ),
        ),
    ),
    "foam-tpe-compression-cyclic": About(
        group=r"^(.+)_\d+$",
        kinds=(
            (
                "conf",
                Material(
                    (("friction_hysteresis",), ("mullins_softening",)),
                    (),
                    (FOAM, MULLINS),
                    "as the foam alone, and friction at the wall of the tube",
                ),
            ),
            (
                "",
                Material(
                    (("mullins_softening",),),
                    ("friction_hysteresis",),
                    (FOAM, MULLINS),
                    "softening on reloading; no wall to rub on",
                ),
            ),
        ),
    ),
    "vhb4910-zhao": About(
        group=r"^([a-z]+)_",
        hold=("rate", "amplitude"),
        specimens=False,
        kinds=(
            (
                "lu",
                Material(
                    (VISCOUS, ("tension_only", "slack")),
                    ("mullins_softening", "cyclic_softening"),
                    (VHB, FINITE),
                    "nonlinear viscoelasticity at finite strain; the strip goes slack; "
                    "no softening",
                    {"nrmse": 0.035},
                ),
            ),
            (
                "",
                Material(
                    (VISCOUS,),
                    ("mullins_softening", "cyclic_softening"),
                    (VHB, FINITE),
                    "relaxation that is not proportional to strain; no softening",
                ),
            ),
        ),
    ),
    # At one rate its first loadings differ by 16 to 22 %, at any strain: so many
    # strips, each with its scale. (Those of the other laboratory differ by 5 %.)
    "vhb4910-hossain2012-digitised": About(
        hold=("rate", "amplitude"),
        kinds=(
            (
                "",
                Material(
                    (VISCOUS,),
                    ("mullins_softening", "cyclic_softening"),
                    (VHB, FINITE),
                    "nonlinear viscoelasticity at finite strain; no softening",
                    {"nrmse": 0.035},
                ),
            ),
        ),
    ),
    "rubber-compression-relaxation": About(
        group=r"^([a-z]+)_",
        hold=("rate",),
        kinds=(
            (
                "",
                Material(
                    (VISCOUS,),
                    ("mullins_softening", "cyclic_softening"),
                    (RUBBER,),
                    "flow that is not proportional to stress; one loading only, so "
                    "nothing about softening",
                ),
            ),
        ),
    ),
    "oring-seal-friction": About(
        hold=("recording",),
        specimens=True,
        read=read_device,
        kinds=(
            (
                "",
                Material(
                    (("friction_hysteresis",),),
                    ("mullins_softening",),
                    (FRICTION,),
                    "friction, with elastic presliding",
                ),
            ),
        ),
    ),
    "etfe-film-cyclic-dic": About(
        group=r"^([a-z]+)_",
        kinds=(
            (
                "cyc",
                Material(
                    (VISCOUS + ("permanent_set",),),
                    (),
                    (ETFE, SCHAPERY),
                    "nonlinear viscoelasticity, strain that accumulates cycle by cycle",
                ),
            ),
            ("", Material((), (), (ETFE,), "linear viscoelasticity at small strain")),
        ),
    ),
    "oca-shear-ladder": About(
        hold=("rate",),
        kinds=(
            (
                "",
                Material(
                    (VISCOUS,),
                    (),
                    (FINITE, SCHAPERY),
                    "nonlinear viscoelasticity, fading memory",
                ),
            ),
        ),
    ),
    "silicone30a-instron": About(
        group=r"^(.+)$",  # two machines, whose strains disagree: each by itself
        kinds=(
            (
                "",
                Material(
                    (),
                    ("permanent_set", "friction_hysteresis", "cyclic_softening"),
                    (MULLINS,),
                    "next to nothing: two per cent of softening in the first cycle "
                    "(the machine shows: spikes where the grips turn)",
                ),
            ),
        ),
    ),
    "fungi-steak-double-compression": About(
        hold=("rate",),
        kinds=(
            (
                "",
                Material(
                    (("mullins_softening", "permanent_set"),),
                    (),
                    (FUNGI,),
                    "first and second compression far apart: damage and residual "
                    "strain; rate dependence",
                ),
            ),
        ),
    ),
    # Five springs: the loops are the joints', wider at larger amplitude at the one ramp
    # time; in the holds nothing moves but what slips.
    "sea-bench-springs": About(
        group=r"^(spring\d+)_",
        hold=("amplitude",),
        specimens=False,
        tests=("cyclic (one ramp-hold-ramp-hold-ramp period)",),
        read=read_zeroed,
        kinds=(
            (
                "spring5",
                Material(
                    (("friction_hysteresis",),),
                    VISCOUS_ALL,
                    (BENCH, FRICTION),
                    "a pointed loop that does not depend on rate, softer at larger "
                    "amplitude",
                ),
            ),
            (
                "spring2",
                Material(
                    (("friction_hysteresis", "grip_slip", "permanent_set"),),
                    VISCOUS_ALL,
                    (BENCH, FRICTION),
                    "a joint that slides beyond 6 Nm and comes back shifted",
                ),
            ),
            (
                "",
                Material(
                    (),
                    VISCOUS_ALL,
                    (BENCH,),
                    "a motor that sticks and lets go, stops at both ends, play",
                ),
            ),
        ),
    ),
    "gelatin-zwick-air-control": About(
        group=r"^(air|\d+)_",
        hold=("rate",),
        specimens=False,
        tests=(
            "compression ramp, 60 s hold, return",
            "compression ramp, 10 s hold, return",
            "same stroke without a specimen",
        ),
        kinds=(
            (
                "air",
                Material(
                    (("inertia",),),
                    (*VISCOUS_ALL, "mullins_softening", "permanent_set"),
                    (GELATIN,),
                    "nothing but the mass of the impactor",
                ),
            ),
            (
                "",
                Material(
                    (("permanent_set",),),
                    (),
                    (GELATIN,),
                    "relaxation, stiffening, force zero before the way back ends, then "
                    "a pull; the impactor's mass at the higher speeds",
                ),
            ),
        ),
    ),
    "cb-silicone-stretcher": About(
        group=r"^(cb\d+(?:p\d+)?)_",
        hold=("recording",),
        tests=("relaxation (multi-step)", "cyclic"),
        kinds=(
            (
                "",
                Material(
                    (),
                    ("mullins_softening", "cyclic_softening"),
                    (STRETCHER,),
                    "weak relaxation (3 to 9 % in 285 s) and rate, slow recovery below "
                    "zero force; softened before, so no softening",
                ),
            ),
        ),
    ),
}
