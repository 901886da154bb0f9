"""What is concealed in which case: every law there is, effects and laws by turns."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np

from bench.hands import (
    flowing,
    rig,
    sensing,
    softening,
    straining,
    strange_machines,
    strangers,
    warming,
)
from bench.hands.families import EFFECTS, SIDES
from bench.hands.testing import Law

LAWS = (
    *rig.LAWS,
    *softening.LAWS,
    *flowing.LAWS,
    *straining.LAWS,
    *warming.LAWS,
    *sensing.LAWS,
)
STRANGERS = (*strangers.STRANGERS, *strange_machines.STRANGERS)
# Mixed: one effect beside a stranger; bent: one to three effects whose laws are wrong.
CLASSES = ("null", "single", "pair", "alien", "mixed", "bent")

USUAL = ("pl-wiechert",) * 7 + ("wiechert", "pl-sls", "sls")
_FLOW = ("pl-wiechert",) * 6 + ("wiechert", "pl-sls", "sls")
MODELS = {
    "nonlinear_elasticity": ("hooke", "sls", "wiechert"),
    "relaxation_branch": ("hooke", "sls", "pl-sls"),
    "nonlinear_viscosity": _FLOW,
    "strain_dependent_relaxation": _FLOW,
    "finite_strain": _FLOW,
    "thermal_softening": _FLOW,
}
FLOW = {"nonlinear_viscosity", "strain_dependent_relaxation", "finite_strain"}
UNSUITED = {
    frozenset(p)
    for p in (
        ("slack", "tension_only"),
        ("zero_offset", "load_cell_drift"),
        ("grip_slip", "slack"),
        ("mullins_softening", "cyclic_softening"),
    )
}


@cache
def pairs_of() -> tuple[tuple[str, str], ...]:
    """Effects that make sense together and that one test can carry."""
    out = []
    for a, b in combinations(EFFECTS, 2):
        both = {a, b}
        models = set(MODELS.get(a, USUAL)) & set(MODELS.get(b, USUAL))
        if len(both & FLOW) < 2 and models and frozenset(both) not in UNSUITED:
            out.append((a, b))
    return tuple(out)


def third_of(two: tuple[str, str], effects: list[str], index: int) -> str:
    """The next effect in turn that goes with both, in a model of all three."""

    def together(name: str) -> bool:
        three = (*two, name)
        pairs = [p for p in combinations(EFFECTS, 2) if set(p) <= set(three)]
        models = set.intersection(*(set(MODELS.get(e, USUAL)) for e in three))
        return name not in two and set(pairs) <= set(pairs_of()) and bool(models)

    turned = [effects[(index + k) % len(effects)] for k in range(len(effects))]
    return next(e for e in turned if together(e))


def laws_of(effect: str, side: str) -> list[Law]:
    """The laws of an effect that stand on a side."""
    return [law for law in LAWS if law.effect == effect and law.side == side]


def ordered(seed: int, index: int, cls: str, side: str) -> tuple[Law, ...]:
    """What is concealed in the case of this number: effects and their laws by turns."""
    turn = np.random.default_rng([seed, 77, SIDES.index(side)])
    effects, pairs = turn.permutation(EFFECTS), turn.permutation(len(pairs_of()))
    starts = turn.integers(0, 60, 64)
    chosen = []
    if cls in ("alien", "mixed"):
        kinds = [law for law in STRANGERS if law.side == side]
        chosen = [kinds[(index + int(starts[60])) % len(kinds)]]
    count = {"single": 1, "mixed": 1, "pair": 2, "bent": 1 + index % 3}.get(cls, 0)
    if count == 1:
        names = [str(effects[index % len(EFFECTS)])]
    else:
        names = list(pairs_of()[pairs[index % len(pairs)]])[:count]
    if count > 2:
        names.append(third_of((names[0], names[1]), [str(e) for e in effects], index))
    for name in names:
        laws = laws_of(name, side)
        start = int(starts[EFFECTS.index(name)])
        chosen.append(laws[(index // len(EFFECTS) + start) % len(laws)])
    return tuple(chosen)
