"""Material cards for Abaqus, Ansys and FEBio; each states the effects that it lacks.

Both codes let one curve, the instantaneous one, relax by a Prony series: a branch
stands in proportion to the spring at every strain. Here branches are linear and the
spring is not, so shares are taken that fit the lasting curve best, and the card says
how far its lasting curve is off. A hyperelastic base is the card's own law, and loses
nothing; neither does a Bergström-Boyce base, whose card is for Abaqus alone. Units N,
mm, s, MPa.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

import softnn
from softnn.cards.texts import described, remark
from softnn.contracts import Array, Effect, InputError
from softnn.model_file import Stored
from softnn.models.bergstrom_boyce import BergstromBoyce
from softnn.models.hyperelastic import Hyper, Values, bulk
from softnn.neural import StoredNetwork

POINTS = 12  # of the curve, a segment
LEAST = 1e-3  # of the stress, that lasts: shares must add up to less than 1
MULLINS = ("MullinsSoftening", "EnergySoftening")


@dataclass(frozen=True)
class Card:
    """What a card says: curve (n,), shares and times of the Prony series, Mullins.

    `lasting_error` is the largest distance of the card's relaxed curve from the
    model's, over the largest stress of that. `missing` are lines on what the card
    lacks, `left_out` the places of the effects among them in the model. `of_test` are
    the ids of effects of the rig and the sensors, which no material has. `flows` is the
    base of a card whose second network flows; the law is then that of the first.
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
    law: Hyper | None = None
    moduli: Values = ()  # of the law before it relaxes, in MPa
    flows: BergstromBoyce | None = None
    second_MPa: float = 0.0  # initial Young's modulus of the network that flows

    @property
    def young(self) -> float:
        """Modulus of the law in MPa, in the sense of `Hyper`."""
        return 0.0 if self.law is None else self.law.law.young(self.moduli)

    @property
    def law_name(self) -> str:
        """The law, or "marlow" for the curve as it is."""
        return "marlow" if self.law is None else self.law.law_name


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
    if not np.isfinite([*model.stiffness, *knots, *units.relaxation_times]).all():
        raise InputError("the model holds NaN or infinity, no numbers of a card")
    steps = [np.linspace(a, b, POINTS, endpoint=False) for a, b in pairwise(knots)]
    strain = np.unique(np.concatenate([*steps, knots[-1:], [0.0]]))
    strain = strain[strain > -0.95]  # no length is left at -1
    springs = model.stiffness[: units.segments]
    branches = model.stiffness[units.segments :]
    flows = units if isinstance(units, BergstromBoyce) else None
    second = float(branches.sum())
    if flows is not None:  # its second network is no series, and has its own keyword
        branches = np.zeros(len(branches))
    used = np.flatnonzero(branches)
    scale = np.prod(
        [1 + np.mean(p.values["error"]) for p in model.pieces if p.effect.scatter]
    )
    lasting = units.springs(strain) @ springs * scale
    whole = lasting + branches.sum() * units.undamped(strain) * scale
    law = units if isinstance(units, Hyper) else None
    law = law if flows is None else flows.elastic
    young = (springs.sum() + branches.sum()) * scale
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
        effect, p = piece.effect, piece.values
        if effect.stage != "material":  # the scale is in the curve
            continue
        carried = effect.form in MULLINS and softening is None and flows is None
        if carried and 0 < p["depth"] < 1:
            if "energy_MPa" in p:  # of the lasting part
                energy = p["energy_MPa"] / max(fits, LEAST)
                softening = 1 / p["depth"], energy, p["sharpness"]
            else:
                softening = _mullins(p, strain, whole)
                missing += _unlike(p)
        else:
            values = ", ".join(f"{k} {np.max(v):.4g}" for k, v in p.items())
            missing.append(f"{effect.id} ({effect.form}): {values}")
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
        law,
        () if law is None else law.law.scaled(law.moduli, young),
        flows,
        second * scale,
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
    of = "instantaneous" if made.flows is None else "of the network that lasts"
    lines = [
        f"{code} material card of {described(model)}, by softnn {softnn.__version__}",
        "units N, mm, s, MPa; engineering strain and stress, tension positive",
        f"{of}, strain {low:.4g} to {high:.4g}, {_volume(made)}",
    ]
    if made.law is not None:
        lines += made.law.remarks()
    elif len(made.shares):
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


def _volume(made: Card) -> str:
    if made.law is None or made.law.poisson == 0.5:
        return "incompressible"
    return f"Poisson ratio {made.law.poisson:.4g}"


def _bulk(made: Card) -> float:
    """Return the bulk modulus in MPa, 0 of an incompressible law and of a foam."""
    law = made.law
    if law is None or law.law.foam or law.poisson == 0.5:
        return 0.0
    return bulk(law.law.young(made.moduli), law.poisson)


def _row(values: Sequence[float]) -> str:
    return ", ".join(f"{v:.9g}" for v in values)


# What the keyword of Abaqus says of a law, and its lines of data, D included.
ABAQUS = {
    "neo-hooke": "neo hooke",
    "mooney-rivlin": "mooney-rivlin",
    "yeoh": "yeoh",
    "ogden1": "ogden, n=1",
    "ogden2": "ogden, n=2",
    "ogden3": "ogden, n=3",
    "arruda-boyce": "arruda-boyce",
    "hyperfoam": "n=2",
}


def _abaqus_law(made: Card, moduli: str) -> list[str]:
    if made.law is None:
        pairs = zip(made.stress_MPa, made.strain, strict=True)
        data = [_row(pair) for pair in pairs if pair[1]]
        return [f"*Hyperelastic, marlow{moduli}", "*Uniaxial Test Data", *data]
    said = ABAQUS.get(made.law_name)
    if said is None:
        raise InputError(
            f"Abaqus has no {made.law_name} law; diagnose with another base, or write "
            "the card --to ansys"
        )
    values = list(made.moduli)
    if made.law.law.foam:
        terms = range(0, len(values), 3)
        values = [x for k in terms for x in values[k : k + 2]] + values[2::3]
    else:
        count = 3 if said == "yeoh" else int(said[-1]) if "n=" in said else 1
        stiff = _bulk(made)
        values += [2 / stiff if stiff else 0.0] + [0.0] * (count - 1)
    word = "Hyperfoam" if made.law.law.foam else "Hyperelastic"
    data = [_row(values[k : k + 8]) for k in range(0, len(values), 8)]
    return [f"*{word}, {said}{moduli}", *data]


def abaqus(model: Stored | StoredNetwork, name: str) -> str:
    """`*Material` for an input file: its law, Prony series, flow, Mullins effect."""
    made = card(model)
    assert isinstance(model, Stored)
    out = [f"** {line}" for line in _head(model, made, "Abaqus")]
    # Without it Abaqus takes the curve for the relaxed one, which lies lower.
    moduli = ", moduli=INSTANTANEOUS" if len(made.shares) else ""
    out += [f"*Material, name={name}", *_abaqus_law(made, moduli)]
    if len(made.shares):
        # A compressible material relaxes as a whole.
        alike = made.law is not None and made.law.poisson < 0.5
        out.append("*Viscoelastic, time=PRONY")
        out += [
            f"{g:.9g}, {f'{g:.9g}' if alike else '0.'}, {t:.9g}"
            for g, t in zip(made.shares, made.times_s, strict=True)
        ]
    if made.flows is not None and made.second_MPa:
        flows, ratio = made.flows, made.second_MPa / made.young
        creep = flows.creep_parameter(made.second_MPa)
        exponents = flows.stress_exponent, flows.strain_exponent
        out += ["*Hysteresis", _row((ratio, creep, *exponents))]
    if made.mullins:
        out += ["*Mullins Effect", _row(made.mullins)]
    return "\n".join(out) + "\n"


def _for_abaqus(made: Card) -> None:
    """Raise `InputError` if a card is of a flow, which Abaqus alone has here."""
    if made.flows is not None:
        raise InputError(
            f"a {made.flows.name} base has a card for Abaqus alone; write it --to "
            "abaqus, or diagnose with --model arruda-boyce-prony"
        )


def _ansys_law(made: Card) -> list[str]:
    if made.law is None:
        out = ["TB,HYPER,MATID,,1,RESPONSE", "TBDATA,1,1E-4", "TBDATA,3,0"]
        for what, side in (("UNITENSION", 1), ("UNICOMPRESSION", -1)):
            points = made.strain * side > 0
            if points.any():
                out.append(f"TB,EXPE,MATID,,,{what}")
                pairs = zip(made.strain[points], made.stress_MPa[points], strict=True)
                out += [f"TBPT,DEFI,{e:.9g},{s:.9g}" for e, s in pairs]
        return out
    name, m = made.law_name, list(made.moduli)
    d = 2 / _bulk(made) if _bulk(made) else 0.0
    if name.startswith("ogden"):
        n = len(m) // 2
        m = [x for k in range(0, 2 * n, 2) for x in (2 * m[k] / m[k + 1], m[k + 1])]
        said, values = f"{n},OGDEN", [*m, d, *[0.0] * (n - 1)]
    elif made.law.law.foam:
        m2 = [x for k in (0, 3) for x in (2 * m[k] / m[k + 1], m[k + 1])]
        said, values = "2,FOAM", m2 + [nu / (1 - 2 * nu) for nu in m[2::3]]
    else:
        said, values = {
            "neo-hooke": ("2,NEO", [2 * m[0], d]),
            "mooney-rivlin": ("2,MOONEY", [*m, d]),
            "yeoh": ("3,YEOH", [*m, d, 0.0, 0.0]),
            "arruda-boyce": ("3,BOYCE", [*m, d]),
            "gent": ("3,GENT", [*m, d]),
        }[name]
    return [
        f"TB,HYPER,MATID,1,{said}",
        *(
            f"TBDATA,{k + 1}," + ",".join(f"{v:.9g}" for v in values[k : k + 6])
            for k in range(0, len(values), 6)
        ),
    ]


def febio(model: Stored | StoredNetwork, name: str) -> str:
    """`<material>` for a FEBio file: the law with its Prony series."""
    made = card(model)
    assert isinstance(model, Stored)
    _for_abaqus(made)
    if made.mullins is not None:
        lost = f"Mullins effect: r, m, beta {_row(made.mullins)}"
        made = replace(made, mullins=None, missing=(*made.missing, lost))
    m, shares = made.moduli, made.shares
    if made.law is None or made.law_name not in FEBIO or made.law.poisson < 0.5:
        raise InputError(
            "FEBio has a law for incompressible bases of "
            f"{', '.join(FEBIO)}; the base is {model.units.name}, {_volume(made)}"
        )
    kind, tags = FEBIO[made.law_name]
    # Moduli there are those that last; shares are over these.
    lasting = 1 - float(shares.sum())
    values = dict(zip(tags, _febio_moduli(made.law_name, m, lasting), strict=True))
    values["k"] = STIFF * made.law.law.young(m) * lasting
    inner = [f"<{tag}>{v:.9g}</{tag}>" for tag, v in values.items()]
    lines = [
        f"<!-- {line.replace('--', '-')} -->" for line in _head(model, made, "FEBio")
    ]
    if not len(shares):
        body = [f'<material id="1" name="{name}" type="{kind}">', *inner, "</material>"]
    else:
        if len(shares) > TERMS:
            raise InputError(
                f"the series has {len(shares)} terms, and FEBio takes {TERMS}; write "
                "the card --to abaqus or ansys"
            )
        rows = list(enumerate(zip(shares, made.times_s, strict=True), start=1))
        body = [
            f'<material id="1" name="{name}" type="uncoupled viscoelastic">',
            f"<k>{values['k']:.9g}</k>",
            *(f"<g{i}>{g / lasting:.9g}</g{i}>" for i, (g, _) in rows),
            *(f"<t{i}>{t:.9g}</t{i}>" for i, (_, t) in rows),
            f'<elastic type="{kind}">',
            *inner,
            "</elastic>",
            "</material>",
        ]
    return "\n".join(["<Material>", *lines, *body, "</Material>"]) + "\n"


STIFF = 1e3  # bulk modulus over Young's modulus: incompressible, and still solvable
TERMS = 6  # of a series of FEBio
FEBIO = {
    "neo-hooke": ("Mooney-Rivlin", ("c1", "c2")),
    "mooney-rivlin": ("Mooney-Rivlin", ("c1", "c2")),
    "yeoh": ("Yeoh", ("c1", "c2", "c3")),
    "ogden1": ("Ogden", ("c1", "m1")),
    "ogden2": ("Ogden", ("c1", "m1", "c2", "m2")),
    "ogden3": ("Ogden", ("c1", "m1", "c2", "m2", "c3", "m3")),
    "arruda-boyce": ("Arruda-Boyce", ("mu", "N")),
}


def _febio_moduli(law: str, m: Values, lasting: float) -> list[float]:
    if law == "neo-hooke":
        return [m[0] * lasting, 0.0]
    if law.startswith("ogden"):
        return [x for k in range(0, len(m), 2) for x in (2 * m[k] * lasting, m[k + 1])]
    if law == "arruda-boyce":
        return [m[0] * lasting, m[1] ** 2]
    return [x * lasting for x in m]


def ansys(model: Stored | StoredNetwork, name: str) -> str:
    """Commands for Mechanical APDL: response function, Prony series, Mullins effect."""
    made = card(model)
    assert isinstance(model, Stored)
    _for_abaqus(made)
    out = [f"! {line}" for line in _head(model, made, "Ansys")]
    out += [
        f"! material {name}: set MATID before, for example MATID=1",
        *_ansys_law(made),
    ]
    if count := len(made.shares):
        out.append(f"TB,PRONY,MATID,1,{count},SHEAR")
        for i, (g, t) in enumerate(zip(made.shares, made.times_s, strict=True)):
            out.append(f"TBDATA,{2 * i + 1},{g:.9g},{t:.9g}")
        if made.law is not None and made.law.poisson < 0.5:
            series = [line.replace("SHEAR", "BULK") for line in out[-count - 1 :]]
            out += series
    if made.mullins:
        out.append("TB,CDM,MATID,1,3,PSE2")
        out.append("TBDATA,1," + ",".join(f"{v:.9g}" for v in made.mullins))
    return "\n".join(out) + "\n"


# The form of an export, its file name's ending and its writer.
WRITERS: dict[str, tuple[str, Callable[[Stored | StoredNetwork, str], str]]] = {
    "abaqus": (".inp", abaqus),
    "ansys": (".mac", ansys),
    "febio": (".feb", febio),
}
