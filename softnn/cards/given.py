"""A card as it was read: a hyperelastic law, a Prony series, Mullins softening."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from softnn.cards import UNITS
from softnn.contracts import Array, InputError
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.model_file import Stored, from_dict, to_dict
from softnn.models import bergstrom_boyce
from softnn.models.bergstrom_boyce import BergstromBoyce
from softnn.models.hyperelastic import LAWS, PRONY, Hyper, Values

INCOMPRESSIBLE = 0.49  # Poisson ratio; above it the stress of a strip hardly depends
OWN_VOLUME = ("arruda-boyce", "gent")  # other volume terms in Abaqus and Ansys
LARGEST = 20_000_000  # bytes of a card, with all that it includes
PER_DECADE = 2  # relaxation times in a series for relaxation data
HELD = 1e4  # weight of a lasting modulus that the card gives
SMALL = 1e-6  # of the relaxation; a smaller share is none
WIDE = 10.0  # strain to which a card is taken to hold, until recordings say more
_UNIT = re.compile(r"\b(MPa|N/mm\^?2|N, ?mm|kPa|GPa|psi|Pa)\b")


@dataclass(frozen=True)
class Given:
    """A card. Moduli are of the law before it relaxes, in the unit of the card.

    `shares` and `times_s` are of the Prony series. `mullins` are r, m and beta of Ogden
    and Roxburgh. `hysteresis` are S, A, m and C of Abaqus; moduli are then those of the
    first network. `unit` is that of a stress, "" where the file does not say it.
    `notes` name keywords that were passed over, and inferences.
    """

    dialect: str  # of `softnn.cards.written.WRITERS`
    name: str
    law: str
    moduli: Values
    poisson: float = 0.5
    shares: Values = ()
    times_s: Values = ()
    mullins: tuple[float, float, float] | None = None
    hysteresis: tuple[float, float, float, float] | None = None
    unit: str = ""
    notes: tuple[str, ...] = ()
    refit: bool = False  # whether a diagnosis may fit its moduli

    def __post_init__(self) -> None:
        values = (*self.moduli, *self.shares, *self.times_s, *(self.mullins or ()))
        if not np.isfinite(values).all():
            raise InputError(f"material {self.name} holds NaN or infinity")
        if any(not 0 <= g <= 1 for g in self.shares) or sum(self.shares) >= 1:
            raise InputError(
                f"material {self.name}: the shares of the Prony series add up to "
                f"{sum(self.shares):.4g}; each is 0 or more, together below 1"
            )
        if any(not t > 0 for t in self.times_s):
            raise InputError(f"material {self.name}: relaxation times are above 0 s")
        exponents = zip(LAWS[self.law].moduli, self.moduli, strict=True)
        if any(
            name.startswith("ALPHA") and not value for (name, _), value in exponents
        ):
            raise InputError(f"material {self.name}: an exponent of its law is 0")
        if self.mullins is not None:
            r, m, beta = self.mullins
            if not (r > 1 and m >= 0 and beta >= 0 and m + beta > 0):
                raise InputError(
                    f"material {self.name}: r, m and beta of the Mullins effect are "
                    f"{r:.4g}, {m:.4g}, {beta:.4g}; r is above 1, the others 0 or more"
                )
        LAWS[self.law].unit(self.moduli)  # raises unless the modulus is above 0
        if self.hysteresis is not None:
            alone = not self.shares and self.mullins is None and self.poisson == 0.5
            if self.law != bergstrom_boyce.LAW.name or not alone:
                raise InputError(
                    f"material {self.name}: *HYSTERESIS is read with an incompressible "
                    "ARRUDA-BOYCE law, without a Prony series or a Mullins effect"
                )
            self.base()  # raises unless its numbers are in range

    @property
    def young(self) -> float:
        """Initial Young's modulus before it relaxes, in the unit of the card."""
        return LAWS[self.law].young(self.moduli)

    @property
    def said(self) -> str:
        """What the card is, in a few words."""
        terms = len(self.shares)
        series = [f"{terms} Prony term{'s'[: terms != 1]}"] if terms else []
        series += ["hysteresis"] * (self.hysteresis is not None)
        more = " and ".join(series + ["Mullins effect"] * (self.mullins is not None))
        return f"{LAWS[self.law].said} card" + (f" with {more}" if more else "")

    def base(
        self, reach: tuple[float, float] = (-0.95, WIDE)
    ) -> Hyper | BergstromBoyce:
        """Return its law with its series or its flow, for strains of this range."""
        law = LAWS[self.law]
        if self.hysteresis is not None:
            ratio, creep, *exponents = self.hysteresis
            second = ratio * self.young
            return bergstrom_boyce.of_creep(
                creep, second, (exponents[0], exponents[1]), self.moduli[1], reach
            )
        name = self.law + (PRONY if self.shares else "")
        unit = law.unit(self.moduli)
        return Hyper(
            name, self.law, unit, reach, self.times_s, "uniaxial", self.poisson
        )

    def stored(self, unit: str, reach: tuple[float, float] = (-0.95, WIDE)) -> Stored:
        """Return the card as a model in MPa, given the unit of its stresses."""
        young = self.young * UNITS[unit]
        lasting = 1 - sum(self.shares)
        second = () if self.hysteresis is None else self.hysteresis[:1]
        stiffness = young * np.array([lasting, *self.shares, *second])
        pieces: tuple[Piece, ...] = ()
        if self.mullins is not None:
            r, m, beta = self.mullins
            values = {
                "depth": 1 / r,
                "energy_MPa": m * UNITS[unit] * lasting,
                "sharpness": beta,
            }
            pieces = (
                Piece(effect("mullins_softening", "EnergySoftening"), values, ()),
            )
        guess = Guess(self.base(reach), stiffness, pieces)
        model = from_dict(to_dict(guess, [], "fresh", False))
        assert isinstance(model, Stored)
        return model


def compressible(given: Given, bulk: float, relaxes: bool) -> Given:
    """Return the card with its Poisson ratio, from a bulk modulus (0: incompressible).

    `relaxes`: whether the bulk modulus relaxes by the same series. Raises `InputError`
    where only a simulation in space would tell the stress.
    """
    if LAWS[given.law].foam and given.shares and not relaxes:
        raise InputError(
            f"material {given.name} is a foam, which relaxes as a whole: give the bulk "
            "the shares and times of the shear"
        )
    if given.mullins is not None and given.shares:
        note = (
            "the Mullins effect is taken to soften all stress, by the energy before it "
            "relaxes; your code may soften the lasting part alone"
        )
        given = replace(given, notes=(*given.notes, note))
    if not bulk > 0:
        return given
    poisson = _poisson(given.young, bulk)
    if poisson >= INCOMPRESSIBLE:
        note = f"Poisson ratio {poisson:.5g}, taken as incompressible"
        return replace(given, notes=(*given.notes, note))
    if given.shares and not relaxes:
        raise InputError(
            f"material {given.name} has a Poisson ratio of {poisson:.4g} and a series "
            "for shear alone, which softnn does not simulate; it takes ratios from "
            f"{INCOMPRESSIBLE} on, or a bulk series equal to that of shear"
        )
    notes = given.notes
    if given.law in OWN_VOLUME:
        notes = *notes, f"volume term taken as (J - 1)^2, which {given.law} has not"
    return replace(given, poisson=float(poisson), notes=notes)


def _poisson(young: float, bulk: float) -> float:
    """Return the Poisson ratio of a law whose shear modulus is young / 3."""
    return (9 * bulk - 2 * young) / (2 * (9 * bulk + young))


def bulk_of(given: Given, d: Sequence[float], where: str) -> float:
    """Return the bulk modulus, 2 / d, of a card's own volume terms (0: incompressible).

    The volume terms are d_i, of (J - 1)^(2 i) / d_i. Raises `InputError` for those that
    the model does not hold and that change the stress.
    """
    if any(x < 0 for x in d):
        raise InputError(f"{where}: D or d is {min(d):.4g}; it is 0 or more")
    if not d[0]:
        return 0.0
    bulk = 2 / d[0]
    if _poisson(given.young, bulk) < INCOMPRESSIBLE and any(d[1:]):
        raise InputError(
            f"{where}: more than one volume term (D2, D3) is not read where the "
            f"Poisson ratio is below {INCOMPRESSIBLE}"
        )
    return bulk


def unit_of(text: str) -> str:
    """Return the unit of stress that a comment says, "" if none or several.

    >>> unit_of("** units N, mm, s, MPa"), unit_of("* Pa or kPa")
    ('MPa', '')
    """
    alias = {"N/mm2": "MPa", "N/mm^2": "MPa", "N, mm": "MPa", "N,mm": "MPa"}
    found = {alias.get(x, x) for x in _UNIT.findall(text)}
    return found.pop() if len(found) == 1 else ""


def series_for(
    time_s: Array, modulus: Array, lasting: float | None = None
) -> tuple[Values, Values, float]:
    """Return shares and times of a Prony series for relaxation data, and its error.

    `modulus` is over that at time 0, and so is `lasting`, to which it falls, where that
    is known. Least squares with shares of 0 or more, at fixed times; the error is the
    largest difference.
    """
    good = time_s > 0
    time_s, modulus = time_s[good], modulus[good]
    if len(time_s) < 2 or not ((modulus > 0) & (modulus <= 1)).all():
        raise InputError(
            "relaxation data hold a modulus over the initial one, above 0 to 1, at two "
            "times above 0 or more"
        )
    first, last = time_s.min(), time_s.max()
    count = max(int(np.ceil(PER_DECADE * np.log10(last / first))), 1) + 1
    times = np.geomspace(first, last, count)
    columns = -np.expm1(-time_s[:, None] / times)
    rows, values = columns, 1 - modulus
    if lasting is not None:
        rows = np.vstack([columns, np.full(count, HELD)])
        values = np.append(values, HELD * (1 - lasting))
    shares, _ = nnls(rows, values)
    off = float(np.abs(1 - columns @ shares - modulus).max())
    kept = shares > SMALL
    return tuple(shares[kept].tolist()), tuple(times[kept].tolist()), off


def numbers(fields: Sequence[str], where: str) -> list[float]:
    """Return the numbers of a line; empty fields are 0. Raises `InputError`."""
    out = []
    for field in fields:
        text = field.strip().lower().replace("d", "e")
        try:
            out.append(float(text) if text else 0.0)
        except ValueError:
            raise InputError(f"{where}: {field.strip()[:40]!r} is no number") from None
    return out


def text_of(path: Path) -> str:
    """Return the text of a card. Raises `InputError` unless it is text."""
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(
                f"has more than {LARGEST // 10**6} MB; give the material alone",
                file=path,
            )
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if b"\0" in data:
        raise InputError("is no text file", file=path)
    return data.decode("utf-8", errors="replace")
