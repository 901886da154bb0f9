"""Material cards for Abaqus and Ansys; each states the effects that it lacks.

Both codes let one curve, the instantaneous one, relax by a Prony series: a branch
stands in proportion to the spring at every strain. Here branches are linear and the
spring is not, so shares are taken that fit the lasting curve best, and the card says
how far its lasting curve is off. Units N, mm, s, MPa.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

import softnn
from softnn.contracts import Array, Effect, InputError
from softnn.export.source import described
from softnn.export.templates_of import literal, remark
from softnn.model_file import Stored
from softnn.neural import StoredNetwork

POINTS = 12  # of the curve, a segment
LEAST = 1e-3  # of the stress, that lasts: shares must add up to less than 1
MULLINS = "MullinsSoftening"


@dataclass(frozen=True)
class Card:
    """What a card says: curve (n,), shares and times of the Prony series, Mullins.

    `lasting_error` is the largest distance of the card's relaxed curve from the
    model's, over the largest stress of that. `missing` are lines on what the card
    lacks, `left_out` the places of the effects among them in the model. `of_test` are
    the ids of effects of the rig and the sensors, which no material has.
    """

    strain: Array
    stress_MPa: Array
    shares: Array
    times_s: Array
    mullins: tuple[float, float, float] | None
    lasting_error: float
    missing: tuple[str, ...]
    left_out: tuple[int, ...] = ()
    of_test: tuple[str, ...] = ()


def of_test(law: Effect) -> bool:
    """Return whether an effect is one of the rig or the sensors.

    The scale of the stress is not: the card has that of a new recording, as C has it.
    """
    return law.stage != "material" and not law.scatter


def card(model: Stored | StoredNetwork) -> Card:
    """The curve, the series and the softening of a model; `InputError` for none."""
    if isinstance(model, StoredNetwork):
        raise InputError("a network has no material card; try --to c, onnx or fmu")
    if model.needs_simulated:
        raise InputError(
            "this model corrects a simulation, whose material a card would have to "
            "hold; for a card of the whole material diagnose the same recordings with "
            "--model pl-wiechert"
        )
    units = model.units
    knots = units.corners
    for value in (*model.stiffness, *knots, *units.relaxation_times):
        literal(value)  # raises on NaN and infinity
    steps = [np.linspace(a, b, POINTS, endpoint=False) for a, b in pairwise(knots)]
    strain = np.unique(np.concatenate([*steps, knots[-1:], [0.0]]))
    strain = strain[strain > -0.95]  # no length is left at -1
    springs = model.stiffness[: units.segments]
    branches = model.stiffness[units.segments :]
    used = np.flatnonzero(branches)
    scale = np.prod(
        [1 + np.mean(p.values["error"]) for p in model.pieces if p.effect.scatter]
    )
    lasting = units.springs(strain) @ springs * scale
    whole = lasting + branches.sum() * strain * scale
    if not np.isfinite(whole).all() or not (np.diff(whole) > 0).all():
        raise InputError(
            "the curve does not rise with strain; a card needs one that does"
        )
    fits = float(lasting @ whole / (whole @ whole))
    kept = max(fits, LEAST) if len(used) else 1.0
    shares = (1 - kept) * branches[used] / max(branches.sum(), 1e-300)
    least = max(np.max(np.abs(lasting)), LEAST * np.max(np.abs(whole)))
    off = np.max(np.abs(kept * whole - lasting)) / least
    softening, missing, left_out = None, list[str](), list[int]()
    if kept > fits:
        missing.append(
            f"the model relaxes to {100 * fits:.2g} % of its stress, the card to "
            f"{100 * LEAST:g} %: shares must add up to less than 1"
        )
    for i, piece in enumerate(model.pieces):
        law, p = piece.effect, piece.values
        if law.stage != "material":  # the scale is in the curve
            continue
        if law.form == MULLINS and softening is None and 0 < p["depth"] < 1:
            softening = _mullins(p, strain, whole)
            missing += _unlike(p)
        else:
            values = ", ".join(f"{k} {np.max(v):.4g}" for k, v in p.items())
            missing.append(f"{law.id} ({law.form}): {values}")
            left_out.append(i)
    if model.learned is not None:
        missing.append("a learned correction")
    return Card(
        strain,
        whole,
        shares,
        np.array(units.relaxation_times)[used],
        softening,
        float(off),
        tuple(remark(m, 200) for m in missing),
        tuple(left_out),
        tuple(p.effect.id for p in model.pieces if of_test(p.effect)),
    )


def _mullins(p: dict, strain: Array, stress: Array) -> tuple[float, float, float]:
    """r, m and beta of Ogden and Roxburgh: 1 - erf((W_m - W)/(m + beta W_m)) / r.

    Here the energy goes as a power of the strain, and m is the energy at `scale`.
    """
    up = strain >= 0
    x = np.append(strain[up], max(p["scale"], strain[up][-1]))
    y = np.append(stress[up], np.interp(x[-1], strain[up], stress[up]))
    inside = x <= p["scale"]
    x = np.append(x[inside], p["scale"])
    y = np.interp(x, strain[up], stress[up])
    energy = float(np.trapezoid(y, x))
    return 1 / p["depth"], p["sharpness"] * energy, p["sharpness"]


def _unlike(p: dict) -> list[str]:
    out = [
        "in the card Mullins softening follows the energy of the curve, in the model "
        f"strain to the power {p['power']:.3g}"
    ]
    share = p["viscous_share"]
    if share != 1:
        whole, part = "springs", "branches"
        if share > 1:
            whole, part = part, whole
        out.append(
            "in the card Mullins softening lowers all stress, in the model that of the "
            f"{whole} and {100 * min(share, 2 - share):.2g} % of that of the {part}"
        )
    return out


def _head(model: Stored, made: Card, code: str) -> list[str]:
    """Return the lines above a card: its model, and the effects that it lacks."""
    low, high = made.strain[0], made.strain[-1]
    lines = [
        f"{code} material card of {described(model)}, by softnn {softnn.__version__}",
        "units N, mm, s, MPa; engineering strain and stress, tension positive",
        f"curve: instantaneous, strain {low:.4g} to {high:.4g}, incompressible",
    ]
    if len(made.shares):
        lines.append(
            "Prony shares relax the whole curve alike, the model only its branches: "
            f"the lasting curve is off by up to {100 * made.lasting_error:.3g} %"
        )
    lines += [f"NOT CARRIED: {m}" for m in made.missing]
    if made.of_test:
        lines.append(f"of the test, not of the material: {', '.join(made.of_test)}")
    if not made.missing:
        lines.append("nothing else of the model is missing")
    return lines


def abaqus(model: Stored | StoredNetwork, name: str) -> str:
    """`*Material` for an input file: Marlow, Prony series, Mullins effect."""
    made = card(model)
    assert isinstance(model, Stored)
    out = [f"** {line}" for line in _head(model, made, "Abaqus")]
    # Without it Abaqus takes the curve for the relaxed one, which lies lower.
    moduli = ", moduli=INSTANTANEOUS" if len(made.shares) else ""
    out += [f"*Material, name={name}", f"*Hyperelastic, marlow{moduli}"]
    out.append("*Uniaxial Test Data")
    out += [
        f"{s:.9g}, {e:.9g}"
        for e, s in zip(made.strain, made.stress_MPa, strict=True)
        if e
    ]
    if len(made.shares):
        out.append("*Viscoelastic, time=PRONY")
        out += [
            f"{g:.9g}, 0., {t:.9g}"
            for g, t in zip(made.shares, made.times_s, strict=True)
        ]
    if made.mullins:
        out.append("*Mullins Effect")
        out.append(", ".join(f"{v:.9g}" for v in made.mullins))
    return "\n".join(out) + "\n"


def ansys(model: Stored | StoredNetwork, name: str) -> str:
    """Commands for Mechanical APDL: response function, Prony series, Mullins effect."""
    made = card(model)
    assert isinstance(model, Stored)
    out = [f"! {line}" for line in _head(model, made, "Ansys")]
    out += [
        f"! material {name}: set MATID before, for example MATID=1",
        "TB,HYPER,MATID,,1,RESPONSE",
        "TBDATA,1,1E-4",
        "TBDATA,3,0",
    ]
    for what, side in (("UNITENSION", 1), ("UNICOMPRESSION", -1)):
        points = made.strain * side > 0
        if points.any():
            out.append(f"TB,EXPE,MATID,,,{what}")
            pairs = zip(made.strain[points], made.stress_MPa[points], strict=True)
            out += [f"TBPT,DEFI,{e:.9g},{s:.9g}" for e, s in pairs]
    if count := len(made.shares):
        out.append(f"TB,PRONY,MATID,1,{count},SHEAR")
        for i, (g, t) in enumerate(zip(made.shares, made.times_s, strict=True)):
            out.append(f"TBDATA,{2 * i + 1},{g:.9g},{t:.9g}")
    if made.mullins:
        out.append("TB,CDM,MATID,1,3,PSE2")
        out.append("TBDATA,1," + ",".join(f"{v:.9g}" for v in made.mullins))
    return "\n".join(out) + "\n"
