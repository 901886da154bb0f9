"""Could another effect have made the same recordings? Asked after a miss.

The rival is given more than it could have: every shape that a few draws of it take in
this very case, in any mixture and sign, recording by recording where its size is free
in each, on top of everything that the base can move. What it still cannot follow is
all that anybody has to tell the two apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bench.concealed import forge, oracle
from bench.concealed.orders import EFFECTS, NAMES, Order
from bench.concealed.planting import Context, Planted
from bench.concealed.programmes import Array
from bench.concealed.sensor import VIBRATING
from bench.concealed.settings import Setting

DRAWS = 4


def distinct_power(order: Order, answer: dict) -> dict[str, float]:
    """Chance, by rival, to tell what was planted from it (one false alarm in 100)."""
    _, setting, planted = forge.draw_case(order)
    sizes = [len(p.index) for p in setting.programmes]
    scale = np.repeat(setting.gains, sizes)
    off = setting.sampled(setting.run(()))
    clean = setting.sampled(setting.run(planted))
    sigma = np.full(len(off), answer["noise"]["sigma_MPa"]) / scale
    base = np.zeros((len(off), 0)) if order.simulated else movable(setting)
    freedom = max((forge.degrees(p) for p in planted), default=1)
    found = {}
    for name in possible(setting):
        if name in order.effects:
            continue
        rival = shapes(name, setting, off, sizes)
        rows = np.column_stack([base, rival, clean - off])
        rows = rows / (scale * sigma)[:, np.newaxis]
        if answer["noise"]["correlation_s"] > 0:
            times = [p.time_s[p.index] for p in setting.programmes]
            rows = oracle.whiten(rows, times, answer["noise"]["correlation_s"])
        r: Array = np.asarray(np.linalg.qr(rows, mode="r"))
        fitted = r[:, :-1] @ np.linalg.lstsq(r[:, :-1], r[:, -1], rcond=1e-9)[0]
        left = float(np.sum((r[:, -1] - fitted) ** 2))
        found[name] = oracle.power(left, freedom)
    return dict(sorted(found.items(), key=lambda item: item[1]))


def movable(setting: Setting) -> Array:
    """What a refit can change near the truth: columns (n, k)."""
    if not setting.model.endswith("sls"):
        return setting.refit().columns
    # One branch: its stiffness and its time, the latter by a finite difference.
    (_, time), *_ = setting.base.branches
    refit = setting.refit([0.98 * time, 1.02 * time])
    return np.column_stack([refit.springs, refit.branches[:, -2:]])


def possible(setting: Setting) -> list[str]:
    """Effects that these recordings could be suspected of."""
    names = set(NAMES)
    if not setting.warm:
        names.remove("thermal_softening")
    if setting.base.name != "linear":
        names.remove("nonlinear_elasticity")
    if not setting.base.branches:
        names -= {"relaxation_branch", "strain_dependent_relaxation", "finite_strain"}
    if not any(p.family in VIBRATING for p in setting.programmes):
        names.remove("inertia")
    return sorted(names)


def shapes(name: str, setting: Setting, off: Array, sizes: Sequence[int]) -> Array:
    """What a few draws of an effect change in this case: columns (n, k)."""
    make = dict(zip(NAMES, EFFECTS, strict=True))[name]
    bare = setting.run(())
    columns = []
    for draw in range(DRAWS):
        context = Context(
            np.random.default_rng(draw),
            1.0,
            setting.base,
            setting.pace,
            setting.programmes,
            bare,
        )
        rival = make(context)
        change = setting.sampled(setting.run([rival])) - off
        columns += one_each(change, sizes) if own_sizes(rival) else [change]
    return np.column_stack(columns)


def own_sizes(planted: Planted) -> bool:
    return any(isinstance(v, dict | list) for v in planted.parameters.values())


def one_each(change: Array, sizes: Sequence[int]) -> list[Array]:
    which = np.repeat(np.arange(len(sizes)), sizes)
    parts = [np.where(which == i, change, 0.0) for i in range(len(sizes))]
    return [p for p in parts if p.any()]
