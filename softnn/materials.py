"""The seven published materials and the published tables, read from `data/thesis/`.

Values are as printed; keys, units and oddities are in the files. In a checkout (or an
editable installation of it) `data/` lies beside the package; a wheel installs it as
`share/softnn/data` of the environment.
"""

from __future__ import annotations

import sysconfig
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from softnn.contracts import InputError

MATERIALS = ("EPR", "FR", "NatPolR", "NR", "PR", "SR", "NatR")  # thesis order
SPEEDS = (50, 250, 500)  # crosshead, mm/min


@dataclass(frozen=True)
class Table:
    """One published table: rows as dictionaries, in printed order.

    >>> table("4.2").row(material="NR", speed=50)["E_small"]
    4.29
    >>> table("4.2").units["E_small"]
    'MPa'
    """

    id: str
    what: str
    source: str
    rows: tuple[dict[str, Any], ...]
    units: Mapping[str, str]
    notes: tuple[str, ...]

    def row(self, **where: Any) -> dict[str, Any]:
        """The one row whose entries equal `where`; `InputError` for none or several."""
        found = [r for r in self.rows if where.items() <= r.items()]
        if len(found) != 1:
            raise InputError(
                f"{len(found)} rows of Table {self.id} have {where}; "
                f"its keys are {', '.join(self.rows[0])}"
            )
        return found[0]


@dataclass(frozen=True)
class Material:
    """Published properties of one material. Speeds are in mm/min.

    `thickness_mm` is (least, largest). `specimens` (Table 4.1) and `samples` (Table
    6.2) count tensile specimens and samples by speed. `elastic` has the rows of Table
    4.2 by speed. `relaxation` has those of Tables 4.3 and 4.4, by number of the test.

    >>> nr = material("NR")
    >>> nr.full_name, nr.specimens[50], nr.elastic[50]["yield_stress"]
    ('Nitrile Rubber', 8, 1.41)
    >>> round(nr.rate_per_s(500), 4)
    0.2525
    """

    name: str
    full_name: str
    length_mm: float
    width_mm: float
    thickness_mm: tuple[float, float]
    specimens: Mapping[int, int]
    samples: Mapping[int, int]
    elastic: Mapping[int, Mapping[str, float]]
    relaxation: Mapping[int, Mapping[str, float]]

    @property
    def speeds(self) -> tuple[int, ...]:
        return tuple(self.specimens)

    def rate_per_s(self, speed: float) -> float:
        """Nominal strain rate [1/s] of a crosshead speed [mm/min]."""
        return speed / 60 / self.length_mm


@cache
def material(name: str) -> Material:
    """The published facts of one of `MATERIALS`."""
    if name not in MATERIALS:
        raise InputError(f"no material {name!r}; there are {', '.join(MATERIALS)}")
    specimens = table("4.1").row(material=name)
    samples = table("6.2").row(material=name)
    geometry = _read("4.1")["geometry"]
    thickness = specimens["thickness"]
    low, high = thickness if isinstance(thickness, list) else (thickness, thickness)
    speeds = [s for s in SPEEDS if f"specimens_{s}" in specimens]
    relaxation = {
        r["test"]: r | table("4.4").row(test=r["test"], material=name)
        for r in table("4.3").rows
        if r["material"] == name
    }
    return Material(
        name=name,
        full_name=specimens["name"],
        length_mm=geometry["length_mm"],
        width_mm=geometry["width_mm"],
        thickness_mm=(low, high),
        specimens={s: specimens[f"specimens_{s}"] for s in speeds},
        samples={s: samples[f"samples_{s}"] for s in speeds},
        elastic={s: table("4.2").row(material=name, speed=s) for s in speeds},
        relaxation=relaxation,
    )


@cache
def table(id: str) -> Table:
    """The published table with that number, such as "4.2"."""
    content = _read(id)
    return Table(
        id=content["table"],
        what=content["what"],
        source=content["source"],
        rows=tuple(content["rows"]),
        units=content.get("units", {}),
        notes=tuple(content.get("notes", ())),
    )


def tables() -> tuple[str, ...]:
    """The numbers of the published tables there are."""
    files = (data_path() / "thesis").glob("table_*.toml")
    return tuple(sorted(f.stem.removeprefix("table_").replace("_", ".") for f in files))


@cache
def data_path() -> Path:
    """The folder `data/` of published facts."""
    beside = Path(__file__).resolve().parents[1] / "data"
    installed = Path(sysconfig.get_path("data")) / "share" / "softnn" / "data"
    for folder in (beside, installed):
        if (folder / "thesis").is_dir():
            return folder
    raise InputError(
        f"no published tables in {beside} nor {installed}; install softnn again"
    )


def _read(id: str) -> dict[str, Any]:
    if id not in tables():
        raise InputError(f"no Table {id!r}; there are {', '.join(tables())}")
    path = data_path() / "thesis" / f"table_{id.replace('.', '_')}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))
